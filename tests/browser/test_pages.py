"""Pages in a real browser: nothing cut, nothing overlapping, no console error; narrow, wide, dark and printed."""

from __future__ import annotations

import csv
import html
import json
import re
import shutil
import subprocess
from collections import Counter
from dataclasses import replace
from importlib import resources
from pathlib import Path
from typing import Any, TextIO

import numpy as np
import pytest
from PIL import Image

from sma_bayes import compare, fit_campaign, modulus, study_gap
from sma_bayes.paper.twin import twin_campaign
from sma_bayes.report.explorer import Trace, chart_data
from sma_bayes.report.html import page_environment
from sma_bayes.report.tables import Column, Table

BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
pytestmark = pytest.mark.skipif(BROWSER is None, reason="no Chromium on this machine")

WIDTHS = (390, 1400, 2200)
HARNESS = """<!DOCTYPE html><meta charset="utf-8"><body>
%(frames)s<pre id="found"></pre><script>
function look(frame) {
  const page = frame.contentDocument, root = page.documentElement, wide = root.clientWidth, cut = [], over = [];
  page.querySelectorAll("details").forEach(d => d.open = true);
  const name = e => e.tagName + "." + e.className + "#" + e.id + " " + e.textContent.trim().slice(0, 40);
  for (const e of page.body.querySelectorAll("*")) {
    const r = e.getBoundingClientRect();
    if (r.width && !e.closest(".scroll") && (r.right > wide + 1 || r.left < -1)) cut.push(name(e));
    if (e.matches("p, h1, h2, h3, li, dd, dt, figcaption") && e.scrollWidth > e.clientWidth + 1) cut.push(name(e));
  }
  for (const parent of page.querySelectorAll("main, section, details, header")) {
    const rows = [...parent.children].map(e => [e, e.getBoundingClientRect()]).filter(([, r]) => r.width && r.height);
    for (let i = 1; i < rows.length; i++)
      if (rows[i][1].top < rows[i - 1][1].bottom - 1) over.push(name(rows[i][0]));
  }
  for (const c of page.querySelectorAll(".scroll caption > span"))
    if (c.getBoundingClientRect().right > wide + 1) cut.push(name(c));
  const style = getComputedStyle(page.body);
  return {wide, cut, over, beyond: root.scrollWidth - wide,
    scrolled: [...page.querySelectorAll(".scroll")].filter(e => e.scrollWidth > e.clientWidth + 1).map(name),
    small: [...page.images].filter(i => i.width && i.width < Math.min(i.naturalWidth, 650) - 12).map(i => i.alt),
    blank: [...page.images].filter(i => !i.naturalWidth).map(i => i.alt),
    ink: style.color, paper: style.backgroundColor};
}
window.onload = () => {
  const found = [...document.querySelectorAll("iframe")].map(look);
  document.getElementById("found").textContent = JSON.stringify(found);
};
</script>"""


def browser(*options: str) -> subprocess.CompletedProcess[str]:
    quiet = ("--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking")
    return subprocess.run(
        [str(BROWSER), *quiet, *options], capture_output=True, text=True, timeout=300, check=True
    )


def looked_at(page: Path, place: Path, *options: str) -> list[dict[str, Any]]:
    """What the page looks like at each width; fails on an error of the console."""
    frames = "".join(
        f'<iframe src="{page.as_uri()}" style="width: {w}px; height: 900px; border: 0"></iframe>\n'
        for w in WIDTHS
    )
    harness = place / "harness.html"
    harness.write_text(HARNESS % {"frames": frames}, encoding="utf-8")
    told = browser(
        "--allow-file-access-from-files", "--enable-logging=stderr", "--virtual-time-budget=20000", "--dump-dom",
        *options, harness.as_uri(),
    )  # fmt: skip
    assert not [line for line in told.stderr.splitlines() if "CONSOLE" in line]
    found = re.search(r'<pre id="found">(.*?)</pre>', told.stdout, re.DOTALL)
    assert found is not None
    return list(json.loads(found[1]))


def columns(file: TextIO) -> dict[str, tuple[str, ...]]:
    head, *rows = csv.reader(file)
    return dict(zip(head, zip(*rows, strict=True), strict=True))


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    twin = twin_campaign(0, ("force", "displacement"))
    few = replace(twin, records=tuple(r for r in twin.records if r.condition.id.startswith(("100g", "150g"))))
    folder = tmp_path_factory.mktemp("browser") / "run"
    fit_campaign(few, folder, jobs=1)
    return folder / "report.html"


def test_nothing_is_cut_and_nothing_overlaps(report: Path, tmp_path: Path) -> None:
    for found in looked_at(report, tmp_path):
        assert found["cut"] == []
        assert found["over"] == []
        assert found["beyond"] <= 0
        assert found["blank"] == []
        assert found["small"] == [], "letters of a figure are too small to be read"
        if found["wide"] >= 1400:
            assert found["scrolled"] == []


@pytest.fixture(scope="module")
def moduli(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Page of a study of moduli, of one heating at two frequencies."""
    place, rng = tmp_path_factory.mktemp("moduli"), np.random.default_rng(0)
    lines = ["Temperature,Storage modulus,Loss modulus,Frequency", "°F,MPa,MPa,Hz"]
    for t in np.linspace(0.0, 110.0, 50):
        for f, middle in {1.0: 50.0, 10.0: 54.0}.items():
            s = 1.0 / (1.0 + np.exp(-0.25 * (t - middle)))
            storage = 28e3 + 38e3 * s + 250.0 * rng.standard_normal()
            loss = 700.0 + 6000.0 * s * (1.0 - s) + 25.0 * rng.standard_normal()
            lines.append(f"{1.8 * t + 32.0:.3f},{storage:.6g},{loss:.6g},{f:g}")
    (place / "strip.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    modulus(place / "strip.csv", place / "out", model="bounded_logistic", loss_model="modulus_peak", jobs=1)
    return place / "out" / "report.html"


def test_moduli_of_one_branch_stand_side_by_side(moduli: Path) -> None:
    """Below each other they left half of the page empty beside them, and filled a printed page each."""
    with Image.open(moduli.parent / "figures" / "moduli.png") as image:
        assert image.width > 1.5 * image.height


def test_moduli_are_seen_first_and_nothing_is_cut(moduli: Path, tmp_path: Path) -> None:
    page = moduli.read_text(encoding="utf-8")
    assert page.index("<figure") < page.index("<table")
    head = page[page.index("<thead>") : page.index("</thead>")]
    assert head.index("value [°F]") < head.index("meaning"), "the number is seen without scrolling"
    for found in looked_at(moduli, tmp_path):
        assert found["cut"] == []
        assert found["over"] == []
        assert found["beyond"] <= 0
        assert found["blank"] == []


ASKED = """<!DOCTYPE html><meta charset="utf-8"><body>
<iframe src="%(page)s" style="width: 1000px; height: 900px; border: 0"></iframe><pre id="found"></pre><script>
window.onload = () => {
  const frame = document.querySelector("iframe"), page = frame.contentDocument, view = frame.contentWindow;
  const root = page.querySelector(".explorer"), chart = root.querySelector(".chart > svg");
  const press = key => chart.dispatchEvent(new view.KeyboardEvent("keydown", {key, bubbles: true}));
  const point = (name, x) => chart.dispatchEvent(new view.MouseEvent(name, {
    clientX: chart.getBoundingClientRect().left + x, clientY: chart.getBoundingClientRect().top + 90}));
  const rows = () => [...root.querySelectorAll("tbody tr")].map(r => [...r.cells].map(c => c.textContent.trim()));
  const place = () => root.querySelector("p").textContent, lines = () => chart.querySelectorAll("path").length;
  const ticks = () => [...chart.querySelectorAll(".axes text[text-anchor=middle]")].map(t => t.textContent);
  const found = {hidden: root.hidden, first: rows(), lines: lines(),
    still: [...page.querySelectorAll("figure.still")].map(f => view.getComputedStyle(f).display)};
  chart.setPointerCapture = () => {};
  const quantity = root.querySelector("select");
  found.quantities = [...quantity.options].map(o => o.value);
  quantity.selectedIndex = found.quantities.findIndex(q => q.startsWith("force"));
  quantity.onchange();
  press("ArrowRight");
  found.asked = [place(), rows()];
  root.querySelectorAll("fieldset input")[1].click();
  found.fewer = rows();
  found.wide = ticks();
  point("pointerdown", 300); point("pointermove", 420); point("pointerup", 420);
  found.close = ticks();
  press("0");
  found.back = ticks();
  document.getElementById("found").textContent = JSON.stringify(found);
};
</script>"""
"""Asks the chart of a page, whose own policy is in force, as a reader would."""


def test_the_chart_answers_who_points_at_it(report: Path, tmp_path: Path) -> None:
    harness = tmp_path / "asks.html"
    harness.write_text(ASKED % {"page": report.as_uri()}, encoding="utf-8")
    told = browser(
        "--allow-file-access-from-files", "--enable-logging=stderr", "--virtual-time-budget=20000", "--dump-dom",
        harness.as_uri(),
    )  # fmt: skip
    assert not [line for line in told.stderr.splitlines() if "CONSOLE" in line]
    text = re.search(r'<pre id="found">(.*?)</pre>', told.stdout, re.DOTALL)
    assert text is not None
    found = json.loads(html.unescape(text[1]))
    assert found["hidden"] is False
    assert found["first"] == []
    assert found["lines"] > 0
    assert set(found["still"]) == {"none"}
    assert [q.split()[0] for q in found["quantities"]] == ["stiffness", "force", "displacement"]
    assert found["close"] != found["wide"] == found["back"]

    place, rows = found["asked"]
    temperature = float(place.rpartition(" ")[2])
    assert len(rows) == len(found["fewer"]) + 1
    assert [r for r in rows if r not in found["fewer"]] == [rows[1]]
    for name, middle, credible, predictive in rows:
        condition, _, branch = name.partition(", ")
        with (report.parent / "bands" / f"{condition}-{branch}-force.csv").open(encoding="utf-8") as file:
            band = {k: np.array(v, dtype=float) for k, v in columns(file).items() if k != "extrapolated"}
        told_here = [float(v) for v in (middle, *json.loads(credible), *json.loads(predictive))]
        at = next(k for k in band if k.startswith("temperature"))
        right = [
            np.interp(temperature, band[at], next(v for k, v in band.items() if k.split(" ")[0] == name))
            for name in ("q50", "q05", "q95", "pred_q05", "pred_q95")
        ]
        width = right[2] - right[1]
        np.testing.assert_allclose(told_here, right, atol=0.1 * width)


def drawn_chart(page: Path, x: np.ndarray, *, style: str = "", width: str = "auto") -> str:
    """What the script of a page draws of one curve that goes through all its readings."""
    script = (resources.files("sma_bayes.report") / "templates" / "explorer.js").read_text(encoding="utf-8")
    y = np.linspace(0.0, 1.0, x.size)
    traces = chart_data([Trace("a", "heating", "force", "force", "T", x, {"q50": y}, (x[0], x[-1]), (x, y))])
    page.write_text(
        f'<style>{style}</style><div class="explorer" style="width: {width}" hidden><div class="chart"></div>'
        f'<script type="application/json">{json.dumps(traces)}</script></div><script>{script}</script>',
        encoding="utf-8",
    )
    return browser("--virtual-time-budget=5000", "--dump-dom", page.as_uri()).stdout


def test_few_readings_are_seen_on_the_lines_and_many_under_them(tmp_path: Path) -> None:
    """Dots of 1.7 pixels under a line that goes through all 28 readings of a sweep were not seen."""
    for count, few in ((28, True), (400, False)):
        x = np.linspace(20.0, 90.0, count)
        seen = drawn_chart(tmp_path / f"{count}.html", x, style=":root { --curve: 30 50; }")
        marks = re.findall(r"<(circle|path)\b[^>]*?(?:\br=\"([\d.]+)\"|stroke-width=\"([\d.]+)\")", seen)
        dots = [i for i, (tag, _, _) in enumerate(marks) if tag == "circle"]
        lines = [i for i, (tag, _, _) in enumerate(marks) if tag == "path"]
        assert len(dots) == count
        assert (min(dots) > max(lines)) is few
        assert (2.0 * float(marks[dots[0]][1]) > 2.5 * float(marks[lines[0]][2])) is few


def test_a_narrow_chart_has_three_numbers_along_its_axis(tmp_path: Path) -> None:
    """From 26.3 to 59.5 °C a telephone showed 40 alone, which tells no scale."""
    for low, high in ((26.3, 59.5), (21.0, 39.0), (30.0, 140.0), (0.2, 0.38)):
        seen = drawn_chart(tmp_path / "narrow.html", np.linspace(low, high, 28), width="330px")
        written = re.findall(r'<text x="([\d.]+)" y="([\d.]+)" text-anchor="middle">[\d.]+</text>', seen)
        assert len(written) >= 3
        places = sorted(float(x) for x, _ in written)
        assert min(np.diff(places)) > 25.0


def test_on_paper_the_still_figure_is_seen(report: Path) -> None:
    style = report.read_text(encoding="utf-8").partition("</style>")[0]
    printed = style[style.index("@media print") :]
    assert re.search(r"\.explorer\b[^}]*\{ display: none; \}", printed)
    assert "@media screen { .explored > figure.still { display: none; } }" in style


AXE = """<script>%(axe)s</script><script>
window.addEventListener("load", () => {
  document.querySelectorAll("details").forEach(d => d.open = true);
  axe.run(document, {resultTypes: ["violations"]}).then(result => {
    const found = document.createElement("pre");
    found.id = "found";
    found.textContent = JSON.stringify({
      passed: result.passes.length,
      violations: result.violations.map(v => [v.impact, v.id, v.nodes.slice(0, 3).map(n => n.html.slice(0, 200))]),
    });
    document.body.append(found);
  });
});
</script></body>"""
"""What judges a page from inside; the policy of the page would not let it in, and is taken out first."""


def judged(page: Path, place: Path, *options: str) -> dict[str, Any]:
    """Rules of axe that a page passes and breaks."""
    pytest.importorskip("axe_core_python", reason="axe-core-python is not installed")
    code = resources.files("axe_core_python").joinpath("axe.min.js").read_text(encoding="utf-8")
    text = re.sub(r'<meta http-equiv="Content-Security-Policy"[^>]*>', "", page.read_text(encoding="utf-8"))
    body, end = text.rsplit("</body>", 1)
    copy = place / "judged.html"
    copy.write_text(body + AXE % {"axe": code.replace("</script", "<\\/script")} + end, encoding="utf-8")
    told = browser("--virtual-time-budget=60000", "--dump-dom", *options, copy.as_uri())
    found = re.search(r'<pre id="found">(.*?)</pre>', told.stdout, re.DOTALL)
    assert found is not None
    return dict(json.loads(html.unescape(found[1])))


@pytest.fixture(scope="module")
def pages(report: Path) -> dict[str, Path]:
    """Reports of the verbs that people read most."""
    folder, twin = report.parent.parent, twin_campaign(0, ("force",))
    one = replace(twin, records=tuple(r for r in twin.records if r.condition.id.startswith("100g")))
    compare(one, folder / "compare", jobs=1)
    study_gap(one, folder / "gap", jobs=1)
    return {"fit": report, **{verb: folder / verb / "report.html" for verb in ("compare", "gap")}}


@pytest.mark.parametrize("verb", ["fit", "compare", "gap"])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_pages_can_be_read_by_everybody(
    pages: dict[str, Path], tmp_path: Path, verb: str, scheme: str
) -> None:
    found = judged(pages[verb], tmp_path, f"--blink-settings=preferredColorScheme={int(scheme == 'light')}")
    assert found["passed"] > 10
    assert found["violations"] == []


def test_what_can_not_be_read_is_found(tmp_path: Path) -> None:
    page = tmp_path / "bad.html"
    page.write_text(
        '<!DOCTYPE html><html lang="en"><head><meta charset="utf-8"><title>x</title></head><body><main><h1>x</h1>'
        '<p style="color: #ccc; background: #fff">pale</p><img src="data:,"></main></body></html>',
        encoding="utf-8",
    )
    broken = {rule for _, rule, _ in judged(page, tmp_path)["violations"]}
    assert {"color-contrast", "image-alt"} <= broken


def test_a_dark_page_is_dark(report: Path, tmp_path: Path) -> None:
    def brightness(colour: str) -> int:
        return sum(int(v) for v in re.findall(r"\d+", colour)[:3])

    light, dark = (
        looked_at(report, tmp_path, f"--blink-settings=preferredColorScheme={scheme}")[1] for scheme in (1, 0)
    )
    assert brightness(light["paper"]) > brightness(light["ink"]) + 400
    assert brightness(dark["ink"]) > brightness(dark["paper"]) + 400


def test_a_small_table_does_not_squeeze_its_caption(tmp_path: Path) -> None:
    """A caption is as wide as its table: of one with three short columns it had two words a line."""
    style = (resources.files("sma_bayes.report") / "templates" / "report.css").read_text(encoding="utf-8")
    page = tmp_path / "page.html"
    page.write_text(
        f"<!DOCTYPE html><style>{style}</style><div class='scroll'><table><caption><span>{'what is stated ' * 9}</span>"
        "</caption><tr><td>1</td></tr></table></div><pre id='found'></pre><script>document.getElementById('found')"
        ".textContent = document.querySelector('caption').getBoundingClientRect().width</script>",
        encoding="utf-8",
    )
    told = browser("--dump-dom", page.as_uri()).stdout
    found = re.search(r"<pre id=.found.>([\d.]+)</pre>", told)
    assert found is not None
    assert float(found[1]) > 300.0


def test_a_sentence_in_a_table_does_not_stretch_its_row_on_a_narrow_page(tmp_path: Path) -> None:
    """It was broken after every second word, beyond the edge, and what was seen of the table was mostly empty."""
    style = (resources.files("sma_bayes.report") / "templates" / "report.css").read_text(encoding="utf-8")
    cells = "<td>100g-heating</td>" * 6 + f"<td class='wide'>{'why this one is preferred ' * 6}</td>"
    page, harness = tmp_path / "page.html", tmp_path / "harness.html"
    page.write_text(
        '<!DOCTYPE html><meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<style>{style}</style><div class='scroll'><table><tbody><tr>{cells}</tr></tbody></table></div>",
        encoding="utf-8",
    )
    harness.write_text(
        f"<!DOCTYPE html><iframe src='{page.as_uri()}' style='width: 390px; border: 0'></iframe><pre id='found'></pre>"
        "<script>window.onload = () => { const page = document.querySelector('iframe').contentDocument;"
        "document.getElementById('found').textContent = page.querySelector('tr').getBoundingClientRect().height; };"
        "</script>",
        encoding="utf-8",
    )
    told = browser(
        "--allow-file-access-from-files", "--virtual-time-budget=5000", "--dump-dom", harness.as_uri()
    )
    found = re.search(r"<pre id=.found.>([\d.]+)</pre>", told.stdout)
    assert found is not None
    assert float(found[1]) < 80.0, "four lines at most"


def bright_share(page: Path, place: Path, scheme: int) -> float:
    """Share of a page that is nearly white, as the browser shows it."""
    shot = place / f"shot-{scheme}.png"
    browser(
        "--hide-scrollbars", "--window-size=1400,9000", f"--screenshot={shot}",
        f"--blink-settings=preferredColorScheme={scheme}", page.as_uri(),
    )  # fmt: skip
    with Image.open(shot) as picture:
        pixels = np.asarray(picture.convert("RGB"))
    return float((pixels.min(axis=-1) > 225).mean())


def test_figures_of_a_dark_page_are_dark(report: Path, tmp_path: Path) -> None:
    light, dark = (bright_share(report, tmp_path, scheme) for scheme in (1, 0))
    assert light > 0.7
    assert dark < 0.02, "letters and lines alone are bright"


def test_a_printed_page_has_no_more_pages_than_it_needs(report: Path, tmp_path: Path) -> None:
    out = tmp_path / "report.pdf"
    browser(f"--print-to-pdf={out}", report.as_uri())
    pages = len(re.findall(rb"/Type\s*/Page\b", out.read_bytes()))
    assert 3 <= pages <= 25


def linked_pages(printed: Path) -> list[set[bytes]]:
    """Of each page of a PDF file the names that its links lead to."""
    data = printed.read_bytes()
    linked = dict(
        re.findall(rb"(\d+) 0 obj\n<</Type /Annot\b[^(]*/URI \(https://example.org/([\w-]+)\)", data)
    )
    return [
        {linked[number] for number in re.findall(rb"(\d+) 0 R", found)}
        for found in re.findall(rb"/Annots \[([^]]*)\]", data)
    ]


def test_headings_of_a_table_are_printed_on_the_page_of_its_first_row(tmp_path: Path) -> None:
    """Wherever on a page a table begins; links tell on which page what they stand in is printed."""
    style = (resources.files("sma_bayes.report") / "templates" / "report.css").read_text(encoding="utf-8")

    def link(name: str) -> str:
        return f'<a href="https://example.org/{name}">{name}</a>'

    def table(above: int, grouped: bool) -> str:
        key = f"{above}-{'in-groups' if grouped else 'plain'}"
        group = f'<tr class="group"><th>{link("group-" + key)}</th></tr>' if grouped else ""
        row = f"<tr><td>{link('row-' + key)}</td></tr>"
        return (
            f'<div style="break-before: page; height: {above}mm"></div><table>'
            f"<caption><span>{link('caption-' + key)}</span></caption>"
            f"<thead><tr><th>{link('head-' + key)}</th></tr></thead><tbody>{group}{row * 3}</tbody></table>"
        )

    tables = "".join(table(above, grouped) for above in range(200, 250) for grouped in (False, True))
    page, out = tmp_path / "page.html", tmp_path / "page.pdf"
    page.write_text(f"<!DOCTYPE html><style>{style}</style>{tables}", encoding="utf-8")
    browser(f"--print-to-pdf={out}", page.as_uri())
    pages = [{name.partition(b"-")[::2] for name in names} for names in linked_pages(out)]
    assert {key for names in pages for kind, key in names if kind == b"row"} == {
        key for names in pages for kind, key in names
    }
    alone = {(kind, key) for names in pages for kind, key in names if (b"row", key) not in names}
    assert not alone


def test_no_row_of_a_table_is_printed_alone(tmp_path: Path) -> None:
    """Of a table that is longer than what is left of a page one row was on the next, under the head again."""
    style = (resources.files("sma_bayes.report") / "templates" / "report.css").read_text(encoding="utf-8")
    tables = "".join(
        f'<div style="break-before: page; height: {above}mm"></div><table><thead><tr><th>head</th></tr></thead><tbody>'
        + "".join(
            f'<tr><td><a href="https://example.org/row-{above}-{n}">{n}</a></td></tr>' for n in range(8)
        )
        + "</tbody></table>"
        for above in range(200, 250)
    )
    page, out = tmp_path / "page.html", tmp_path / "page.pdf"
    page.write_text(f"<!DOCTYPE html><style>{style}</style>{tables}", encoding="utf-8")
    browser(f"--print-to-pdf={out}", page.as_uri())
    rows = [
        [key for kind, key in (name.partition(b"-")[::2] for name in names) if kind == b"row"]
        for names in linked_pages(out)
    ]
    counts = [Counter(key.partition(b"-")[0] for key in some) for some in rows]
    assert sum(c.total() for c in counts) == 50 * 8
    assert max(sum(key in c for c in counts) for key in {k for c in counts for k in c}) == 2, (
        "some are broken"
    )
    assert not [key for c in counts for key, n in c.items() if n == 1]


def test_a_table_of_one_row_stays_where_a_figure_after_it_does_not_fit(tmp_path: Path) -> None:
    """It went to the next page with the figure, and left half of its own empty."""
    style = (resources.files("sma_bayes.report") / "templates" / "report.css").read_text(encoding="utf-8")
    link = '<a href="https://example.org/{0}">{0}</a>'
    page, out = tmp_path / "page.html", tmp_path / "page.pdf"
    page.write_text(
        f"<!DOCTYPE html><style>{style}</style><p>{link.format('text')}</p><div style='height: 120mm'></div>"
        "<table><caption><span>one</span></caption><thead><tr><th>head</th></tr></thead>"
        f"<tbody><tr><td>{link.format('row')}</td></tr></tbody></table>"
        f"<figure><div style='height: 140mm'></div>{link.format('figure')}</figure>",
        encoding="utf-8",
    )
    browser(f"--print-to-pdf={out}", page.as_uri())
    assert linked_pages(out) == [{b"text", b"row"}, {b"figure"}]


def test_figures_are_printed_side_by_side_and_one_alone_is_not_smaller(tmp_path: Path) -> None:
    """Twelve curves of a comparison took six pages, one below the other."""
    style = (resources.files("sma_bayes.report") / "templates" / "report.css").read_text(encoding="utf-8")
    source = "data:image/svg+xml,%3Csvg xmlns='http://www.w3.org/2000/svg' width='693' height='473'/%3E"
    page, out = tmp_path / "page.html", tmp_path / "page.pdf"

    def pages(*groups: int) -> list[set[bytes]]:
        figures = (
            f'<figure><div class="scroll"><img src="{source}" width="693" height="473"></div>'
            f'<figcaption><a href="https://example.org/of-{group}-{n}">of</a></figcaption></figure>'
            for group, count in enumerate(groups)
            for n in range(count)
        )
        blocks = (
            f'<div class="printed-pairs">{"".join(next(figures) for _ in range(n))}</div>' for n in groups
        )
        page.write_text(f"<!DOCTYPE html><style>{style}</style>{''.join(blocks)}", encoding="utf-8")
        browser(f"--print-to-pdf={out}", page.as_uri())
        return linked_pages(out)

    assert [len(p) for p in pages(12)] == [6, 6]
    assert [len(p) for p in pages(1, 1, 1)] == [2, 1]


def test_a_command_is_printed_below_what_introduces_it(tmp_path: Path) -> None:
    """It stood alone on the last page, wherever the page before ended."""
    style = (resources.files("sma_bayes.report") / "templates" / "report.css").read_text(encoding="utf-8")
    link = '<a href="https://example.org/{0}">{0}</a>'
    page, out = tmp_path / "page.html", tmp_path / "page.pdf"
    parts = "".join(
        f"<section style='break-before: page'><div style='height: {height}mm'></div>"
        f"<p>{link.format(f'says{height}')}</p><pre>{link.format(f'does{height}')}</pre></section>"
        for height in range(210, 250, 3)
    )
    page.write_text(f"<!DOCTYPE html><style>{style}</style>{parts}", encoding="utf-8")
    browser(f"--print-to-pdf={out}", page.as_uri())
    pages = linked_pages(out)
    for height in range(210, 250, 3):
        assert any({b"says%d" % height, b"does%d" % height} <= p for p in pages), height


def test_rows_of_a_group_are_printed_under_its_name(tmp_path: Path) -> None:
    """Rows that went on over a page stood there without what they are of."""
    rows = tuple((f"group {g}", f"{g}-{r}") for g in range(30) for r in range(7))
    table = Table("t", "A table", "", (Column("group", "group"), Column("row", "row")), rows, grouped=1)
    template = page_environment("sma_bayes.studies.cycles").from_string(
        '{% from "macros.html.j2" import table with context %}'
        "<!DOCTYPE html><style>{{ style }}</style>{{ table(t) }}"
    )
    text = template.render(t=table, pictures={})
    page, out = tmp_path / "page.html", tmp_path / "page.pdf"
    linked = re.sub(r">(\d+-\d+)<", r'><a href="https://example.org/\1">\1</a><', text)
    page.write_text(linked, encoding="utf-8")
    browser(f"--print-to-pdf={out}", page.as_uri())
    pages = [{name.partition(b"-")[0] for name in names} for names in linked_pages(out)]
    assert len(pages) > 2
    assert sum(map(len, pages)) == 30, "each group is on one page"


def test_what_is_long_and_a_file_of_its_own_is_not_printed(tmp_path: Path) -> None:
    template = page_environment("sma_bayes.studies.cycles").from_string(
        "<!DOCTYPE html><style>{{ style }}</style>"
        '<details><summary>some</summary><a href="https://example.org/printed">1</a></details>'
        '<details class="aside"><summary>more</summary><a href="https://example.org/aside">1</a></details>'
        '<details><summary>file</summary><pre><a href="https://example.org/file">1</a></pre></details>'
    )
    page, out = tmp_path / "page.html", tmp_path / "page.pdf"
    page.write_text(template.render(), encoding="utf-8")
    browser(f"--print-to-pdf={out}", page.as_uri())
    assert linked_pages(out) == [{b"printed"}]
