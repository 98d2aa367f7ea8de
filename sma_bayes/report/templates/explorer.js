"use strict";
// A chart that readers can question: the element before this script has its curves as JSON; see report/explorer.py.
{
  const root = document.currentScript.previousElementSibling;
  const traces = JSON.parse(root.querySelector("script").textContent);
  const SVG = "http://www.w3.org/2000/svg", HEIGHT = 380, PAD = {left: 72, right: 14, top: 12, bottom: 44};
  const FEW = 300;
  const unique = values => [...new Set(values)];
  const quantities = unique(traces.map(t => t.quantity)), conditions = unique(traces.map(t => t.condition));
  const state = {
    quantity: quantities[0], off: new Set(), predictive: false, points: true, log: false, x: null, at: null,
  };

  const make = (tag, attributes = {}, ...inside) => {
    const element = document.createElement(tag);
    for (const [name, value] of Object.entries(attributes)) element[name] = value;
    element.append(...inside);
    return element;
  };
  const draw = (parent, tag, attributes, text) => {
    const element = document.createElementNS(SVG, tag);
    for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
    if (text !== undefined) element.textContent = text;
    parent.append(element);
    return element;
  };

  // Heating in reds, cooling in blues; conditions by lightness and by dashes, so that no eye needs colour alone.
  const colour = t => {
    const share = conditions.length > 1 ? conditions.indexOf(t.condition) / (conditions.length - 1) : 0.3;
    const light = getComputedStyle(document.documentElement).getPropertyValue("--curve").split(" ").map(Number);
    const hue = t.branch === "cooling" ? 207 + 45 * (share - 0.3) : 18 + 30 * (share - 0.3);
    return `hsl(${hue.toFixed(0)} 72% ${(light[0] + share * (light[1] - light[0])).toFixed(0)}%)`;
  };
  const dash = t => ["", "7 3", "2 3", "9 3 2 3"][conditions.indexOf(t.condition) % 4];

  const decimals = step => Math.min(12, Math.max(0, -Math.floor(Math.log10(Math.abs(step)) + 1e-9)));
  const plain = (v, step) => {
    const size = Math.abs(v);
    return (size !== 0 && (size >= 1e6 || size < 1e-4) ? v.toExponential(2) : v.toFixed(decimals(step)))
      .replace("-", "\u2212");
  };
  const between = (t, name, x) => {
    const values = t[name];
    if (!values || x < t.x[0] || x > t.x[t.x.length - 1]) return null;
    let i = 1;
    while (i < t.x.length - 1 && t.x[i] < x) i++;
    const [a, b] = [values[i - 1], values[i]];
    if (a === null || b === null) return null;
    return a + (b - a) * (x - t.x[i - 1]) / (t.x[i] - t.x[i - 1]);
  };
  const resolution = (t, x) => { // two digits of the width of the band, or three of the curve
    const wide = between(t, "q95", x) - between(t, "q05", x);
    return (wide || Math.abs(between(t, "q50", x)) / 10 || 1) / 10;
  };
  const ticks = (low, high, most) => {
    const rough = (high - low) / most, power = 10 ** Math.floor(Math.log10(rough));
    const step = [1, 2, 2.5, 5, 10].find(s => s * power >= rough) * power;
    const out = [];
    for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) out.push(k * step);
    if (out.length < 3 && most < 20) return ticks(low, high, 1.5 * most); // fewer tell no scale
    return [out, step === 2.5 * power ? step / 5 : step];
  };

  const key = t => `${t.condition} ${t.branch}`;
  const those = () => traces.filter(t => t.quantity === state.quantity);
  const shown = () => those().filter(t => !state.off.has(key(t)));
  const ends = () => {
    const all = those().flatMap(t => [t.x[0], t.x[t.x.length - 1]]);
    return [Math.min(...all), Math.max(...all)];
  };
  const drawn = () => state.x || ends(); // ends of the axis as it stands
  const held = x => Math.min(drawn()[1], Math.max(drawn()[0], x));
  const along = () => (those()[0] || {}).along;
  const fine = () => (drawn()[1] - drawn()[0]) / 1000; // resolution of the place that is asked for, and told
  const ask = x => {
    state.at = held(Number(x.toFixed(decimals(fine()))));
    tell();
  };
  const steps = () => Math.max(...those().map(t => t.x.length)) - 1;

  const chart = document.createElementNS(SVG, "svg");
  chart.setAttribute("tabindex", "0");
  chart.setAttribute("role", "img");
  const choice = make("select", {}, ...quantities.map(q => make("option", {value: q}, q)));
  choice.onchange = () => { state.quantity = choice.value; state.x = state.at = null; list(); render(); };
  const toggle = (name, text) => {
    const box = make("input", {type: "checkbox", checked: state[name]});
    box.onchange = () => { state[name] = box.checked; render(); };
    return [box, make("label", {}, box, " ", text)];
  };
  const [predictive, predictiveLabel] = toggle("predictive", "90 % predictive band");
  const [points, pointsLabel] = toggle("points", "measurements");
  const [log, logLabel] = toggle("log", "logarithmic");
  const reset = make("button", {type: "button"}, "whole range");
  reset.onclick = () => { state.x = null; render(); };
  const records = make("fieldset", {}), told = make("table", {}), place = make("p", {className: "small"});
  place.setAttribute("aria-live", "polite");
  const scroll = make("div", {className: "scroll", tabIndex: 0}, told);
  scroll.setAttribute("role", "group");
  scroll.setAttribute("aria-label", "The curves at the chosen place");
  root.querySelector(".chart").append(
    make("div", {className: "controls"}, make("label", {}, "quantity ", choice), pointsLabel, predictiveLabel, logLabel, reset),
    records, chart, place, scroll,
  );

  const swatch = t => {
    const svg = document.createElementNS(SVG, "svg");
    svg.setAttribute("width", 26);
    svg.setAttribute("height", 10);
    svg.setAttribute("aria-hidden", "true");
    draw(svg, "line", {x1: 0, x2: 26, y1: 5, y2: 5, stroke: colour(t), "stroke-width": 2.5, "stroke-dasharray": dash(t)});
    return svg;
  };
  function list() {
    const legend = make("legend", {}, "records ");
    for (const [text, off] of [["all", false], ["none", true]]) {
      const button = make("button", {type: "button"}, text);
      button.setAttribute("aria-label", `${text} of the records`);
      button.onclick = () => {
        those().forEach(t => off ? state.off.add(key(t)) : state.off.delete(key(t)));
        list();
        render();
      };
      legend.append(button, " ");
    }
    records.replaceChildren(legend, ...those().map(t => {
      const box = make("input", {type: "checkbox", checked: !state.off.has(key(t))});
      box.onchange = () => { box.checked ? state.off.delete(key(t)) : state.off.add(key(t)); render(); };
      return make("label", {}, box, " ", swatch(t), ` ${t.condition}, ${t.branch}`);
    }));
  }

  let toX = null, fromX = null; // between the axis and the pixels, of what is drawn
  function limits(curves, low, high) {
    const within = (x, v) => v.filter((y, i) => y !== null && x[i] >= low && x[i] <= high);
    const core = curves.flatMap(t => [
      ...within(t.x, t.q50), ...(state.points && t.points ? within(t.points[0], t.points[1]) : []),
    ]);
    const names = state.predictive ? ["q05", "q95", "pred_q05", "pred_q95"] : ["q05", "q95"];
    const wide = curves.flatMap(t => names.flatMap(n => t[n] ? within(t.x, t[n]) : []));
    if (!core.length) return [0, 1];
    let [bottom, top] = [core.reduce((a, b) => Math.min(a, b)), core.reduce((a, b) => Math.max(a, b))];
    if (state.log && bottom > 0) return [bottom / 1.2, top * 1.2];
    const span = top - bottom || Math.abs(top) || 1; // a band may have as much again on either side
    bottom = Math.max(bottom - span, wide.reduce((a, b) => Math.min(a, b), bottom));
    top = Math.min(top + span, wide.reduce((a, b) => Math.max(a, b), top));
    return [bottom - 0.04 * (top - bottom), top + 0.04 * (top - bottom)];
  }

  function render() {
    const curves = shown(), width = Math.max(280, root.clientWidth), [low, high] = drawn();
    const values = those().flatMap(t => t.q50).filter(v => v !== null);
    const positive = values.length > 0 && values.every(v => v > 0);
    log.disabled = !positive;
    if (!positive) state.log = log.checked = false;
    predictive.disabled = !those().some(t => t.pred_q05);
    points.disabled = !those().some(t => t.points);
    reset.disabled = !state.x;
    const [bottom, top] = limits(curves, low, high);
    const scale = state.log ? Math.log : v => v, [y0, y1] = [scale(bottom), scale(top)];
    const [w, h] = [width - PAD.left - PAD.right, HEIGHT - PAD.top - PAD.bottom];
    toX = x => PAD.left + w * (x - low) / (high - low);
    fromX = p => low + (high - low) * (p - PAD.left) / w;
    const toY = y => PAD.top + h * (y1 - scale(state.log ? Math.max(y, bottom / 1e3) : y)) / (y1 - y0);
    const pair = (x, y) => `${toX(x).toFixed(1)} ${toY(y).toFixed(1)}`;

    chart.replaceChildren();
    chart.setAttribute("width", width);
    chart.setAttribute("height", HEIGHT);
    chart.setAttribute("aria-label",
      `${state.quantity} against ${along()} of ${curves.length} records; arrow keys move the reading`);
    draw(draw(chart, "clipPath", {id: "explorer-clip"}), "rect", {x: PAD.left, y: PAD.top, width: w, height: h});
    const axes = draw(chart, "g", {class: "axes"}), inside = draw(chart, "g", {"clip-path": "url(#explorer-clip)"});

    const [across, stepX] = ticks(low, high, Math.max(3, w / 110));
    for (const v of across) {
      draw(axes, "line", {x1: toX(v), x2: toX(v), y1: PAD.top, y2: PAD.top + h});
      draw(axes, "text", {x: toX(v), y: PAD.top + h + 16, "text-anchor": "middle"}, plain(v, stepX));
    }
    let [up, stepY] = state.log ? [[], 0] : ticks(bottom, top, 6);
    if (state.log) {
      for (let p = Math.floor(Math.log10(bottom)); p <= Math.log10(top); p++)
        for (const f of top / bottom > 200 ? [1] : top / bottom > 20 ? [1, 3] : [1, 1.5, 2, 3, 5, 7])
          if (f * 10 ** p >= bottom && f * 10 ** p <= top) up.push(f * 10 ** p);
    }
    for (const v of up) {
      draw(axes, "line", {x1: PAD.left, x2: PAD.left + w, y1: toY(v), y2: toY(v)});
      draw(axes, "text", {x: PAD.left - 6, y: toY(v) + 4, "text-anchor": "end"},
        state.log ? String(Number(v.toPrecision(2))) : plain(v, stepY));
    }
    draw(axes, "text", {x: PAD.left + w / 2, y: HEIGHT - 6, "text-anchor": "middle"}, along());
    draw(axes, "text", {
      x: 14, y: PAD.top + h / 2, "text-anchor": "middle", transform: `rotate(-90 14 ${PAD.top + h / 2})`,
    }, state.quantity);

    const line = (t, keep) => {
      let path = "", pen = false;
      t.q50.forEach((y, i) => {
        const here = y !== null && keep(t.x[i]);
        if (here) path += `${pen ? "L" : "M"}${pair(t.x[i], y)}`;
        pen = here;
      });
      return path;
    };
    const band = (t, lower, upper, opacity) => {
      const at = t.x.map((_, i) => i).filter(i => t[lower][i] !== null && t[upper][i] !== null);
      if (!at.length) return;
      const forth = at.map(i => pair(t.x[i], t[upper][i])), back = at.reverse().map(i => pair(t.x[i], t[lower][i]));
      draw(inside, "path", {d: `M${forth.join("L")}L${back.join("L")}Z`, fill: colour(t), "fill-opacity": opacity});
    };
    for (const t of curves) {
      if (state.predictive && t.pred_q05 && t.pred_q95) band(t, "pred_q05", "pred_q95", 0.12);
      if (t.q05 && t.q95) band(t, "q05", "q95", curves.length > 4 ? 0.17 : 0.28);
    }
    const readings = !state.points ? [] : curves.filter(t => t.points).flatMap(t =>
      t.points[0].map((x, i) => ({x, y: t.points[1][i], fill: colour(t)}))
        .filter(p => p.x !== null && p.y !== null && p.x >= low && p.x <= high));
    const few = readings.length <= FEW;  // small dots under a line that goes through them would not be seen
    const dots = looks => readings.forEach(({x, y, fill}) =>
      draw(inside, "circle", {cx: toX(x).toFixed(1), cy: toY(y).toFixed(1), fill, ...looks}));
    if (!few) dots({r: 1.7, "fill-opacity": 0.5});
    for (const t of curves) {
      const [from, to] = t.inside, looks = {fill: "none", stroke: colour(t), "stroke-width": 1.8};
      draw(inside, "path", {...looks, "stroke-dasharray": dash(t), d: line(t, x => x >= from && x <= to)});
      draw(inside, "path", {...looks, "stroke-opacity": 0.45, "stroke-width": 1.1, d: line(t, x => x <= from)});
      draw(inside, "path", {...looks, "stroke-opacity": 0.45, "stroke-width": 1.1, d: line(t, x => x >= to)});
    }
    if (few) dots({r: 2.8, "fill-opacity": 0.8});
    chart.cursor = draw(chart, "line", {class: "cursor", y1: PAD.top, y2: PAD.top + h, visibility: "hidden"});
    chart.chosen = draw(chart, "rect", {class: "chosen", y: PAD.top, height: h, visibility: "hidden"});
    tell();
  }

  function tell() {
    const head = document.createElement("thead"), body = document.createElement("tbody");
    const at = state.at, curves = shown();
    chart.cursor.setAttribute("visibility", at === null ? "hidden" : "visible");
    if (at === null) {
      place.textContent = "Point at the chart to read the curves there; drag over it to look closer, double click for the whole " +
        "range. With the keyboard: arrows move, + and \u2212 look closer and wider.";
      told.replaceChildren();
      return;
    }
    chart.cursor.setAttribute("x1", toX(at));
    chart.cursor.setAttribute("x2", toX(at));
    place.textContent = `${along()}: ${plain(at, fine())}`;
    const cell = (tag, text, scope) => {
      const element = make(tag, {className: tag === "td" ? "n" : ""}, text);
      if (scope) element.scope = scope;
      return element;
    };
    const withPredictive = curves.some(t => t.pred_q05);
    head.append(make("tr", {}, ...["record", state.quantity, "90 % credible", ...(withPredictive ? ["90 % predictive"] : [])]
      .map(text => cell("th", text, "col"))));
    for (const t of curves) {
      const [middle, step] = [between(t, "q50", at), resolution(t, at)];
      const range = (a, b) => {
        const [from, to] = [between(t, a, at), between(t, b, at)];
        return from === null || to === null ? "\u2013" : `[${plain(from, step)}, ${plain(to, step)}]`;
      };
      const beyond = middle !== null && (at < t.inside[0] || at > t.inside[1]);
      body.append(make("tr", {},
        make("td", {}, swatch(t), ` ${t.condition}, ${t.branch}${beyond ? " (extrapolated)" : ""}`),
        cell("td", middle === null ? "\u2013" : plain(middle, step)), cell("td", range("q05", "q95")),
        ...(withPredictive ? [cell("td", range("pred_q05", "pred_q95"))] : [])));
    }
    told.replaceChildren(head, body);
  }

  const position = event => held(fromX(event.clientX - chart.getBoundingClientRect().left));
  const zoom = (from, to) => {
    const [low, high] = ends(), [a, b] = [Math.max(low, from), Math.min(high, to)];
    if (b - a < (high - low) / 500) return;
    state.x = a <= low && b >= high ? null : [a, b];
    render();
  };
  let start = null;
  chart.onpointerdown = event => { start = position(event); chart.setPointerCapture(event.pointerId); };
  chart.onpointermove = event => {
    const here = position(event);
    if (start !== null) {
      chart.chosen.setAttribute("visibility", "visible");
      chart.chosen.setAttribute("x", toX(Math.min(start, here)));
      chart.chosen.setAttribute("width", Math.abs(toX(start) - toX(here)));
    }
    ask(here);
  };
  chart.onpointerup = event => {
    const [from, to] = [start, position(event)];
    start = null;
    chart.chosen.setAttribute("visibility", "hidden");
    if (from !== null && Math.abs(toX(from) - toX(to)) > 8) zoom(Math.min(from, to), Math.max(from, to));
  };
  chart.ondblclick = () => { state.x = null; render(); };
  chart.onkeydown = event => {
    const [low, high] = drawn(), at = state.at === null ? (low + high) / 2 : state.at;
    const move = (high - low) / (event.shiftKey ? 20 : Math.max(100, steps()));
    if (event.key === "ArrowRight" || event.key === "ArrowLeft") {
      ask(at + (event.key === "ArrowRight" ? move : -move));
    } else if (event.key === "+" || event.key === "-") {
      const half = (high - low) * (event.key === "+" ? 0.25 : 1);
      zoom(at - half, at + half);
    } else if (event.key === "0") {
      state.x = null;
      render();
    } else return;
    event.preventDefault();
  };

  root.hidden = false;
  root.parentElement.classList.add("explored"); // so that the still figures are seen on paper only
  list();
  render();
  new ResizeObserver(() => { if (Math.abs(root.clientWidth - chart.getAttribute("width")) > 1) render(); }).observe(root);
}
