"""Figures of what is missing: the ladder of steps, what each effect adds, and what is known of its parameters."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Mapping, Sequence
from typing import Any, Final

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from scipy.stats import gaussian_kde

from sma_bayes.arrays import Floats
from sma_bayes.report.figures.sheet import (
    COLOURS,
    FAINT,
    INK,
    PRIOR,
    Drawing,
    abridged,
    as_columns,
    empty_sheet,
    few_ticks,
    in_units_of,
    panels,
    take_power,
)
from sma_bayes.report.notation import compact, unit_label
from sma_bayes.studies.gap.outputs import Samples, StoredStudy
from sma_bayes.studies.gap.schema import (
    AddedEffect,
    EffectParameter,
    FlexibleEvidence,
    GapOfModel,
    NamedChannel,
    StatedGap,
    StatedRound,
)
from sma_bayes.studies.gap.words import channel_text, covariate_text, p_text

ADDED, GUARD = "#20643c", "#a40000"
MOST_CURVES: Final = 6
"""Conditions whose curves are drawn."""
CANDIDATES_SHOWN: Final = 5
"""Candidates of a round that are drawn."""
TICKS: Final = (0.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1e3, 3e3, 1e4, 1e5, 1e6)
EFFECT_HEIGHT: Final = 2.5
"""Height of the figure of an effect above its lower labels [inch]."""
VALUE_WIDTH: Final = 27.0
"""Room for the values of the bars at the right of their panel, where no mark is [points]."""
LETTER_WIDTH, LINE_HEIGHT = 0.092, 0.155
"""Width of a letter and height of a line of a title [inch]."""
DODGE: Final = 0.07
"""How far the dots of neighbouring conditions stand apart [cycles]."""


def ladder_figure(study: StoredStudy) -> Drawing:
    """Round by round: what candidates and flexible terms were worth; beside it the gap on held-out measurements."""
    rounds = study.part.rounds
    bars = [_bars(r, study.part) for r in rounds]
    tall = [max(len(b), 1) for b in bars]
    height = 0.9 + sum(0.23 * n + 0.42 for n in tall)
    figure = empty_sheet(8.0, max(height, 2.6))
    size = figure.get_size_inches()
    axes = panels(figure, len(rounds), 1, left=2.05, right=2.7, bottom=0.75, top=0.3, gap_y=0.42, tall=tall)[
        :, 0
    ]
    worth = study.part.thresholds.ln_bayes_factor
    seen = [x for b in bars for _, v, g, _ in b for x in (v, g) if x is not None]
    top = 1.25 * max([worth, *seen])
    low = -worth if min(seen, default=0.0) < -0.1 * worth else -0.1 * worth
    for number, (ax, round_, some) in enumerate(zip(axes, rounds, bars, strict=True), 1):
        _round(ax, some, worth)
        ax.set_xscale("symlog", linthresh=worth)
        ax.set_xlim(low, top)
        ax.set_xticks([t for t in TICKS if t < top], [f"{t:g}" for t in TICKS if t < top])
        ax.minorticks_off()
        ax.set_title(_round_title(number, round_, study.part.thresholds.p_value))
        if number < len(rounds):
            ax.set_xticklabels([])
    axes[-1].set_xlabel("ln Bayes factor, for the model with it over the one without [1]")
    gap = figure.add_axes((1.0 - 1.75 / size[0], 0.75 / size[1], 1.6 / size[0], 1.0 - 1.05 / size[1]))
    _gap(gap, study.part.gap, ADDED if study.effects else "#8fa3b5")
    handles = [
        Patch(color=ADDED, label="effect, added"), Patch(color="#8fa3b5", label="effect, not added"),
        Patch(facecolor="white", edgecolor=FAINT, hatch="////", lw=0.5, label="f(.): smooth term without a mechanism"),
        Line2D([], [], color=GUARD, marker="|", ms=8, mew=1.6, ls="none", label="flexible term in its place"),
        Line2D([], [], color=INK, lw=0.8, ls="--", label=f"least that is added, {worth:g}"),
    ]  # fmt: skip
    figure.legend(
        handles=handles, loc="lower center", ncols=5, borderaxespad=0.15, fontsize=6.2, columnspacing=1.0
    )
    return Drawing(
        stem="ladder",
        caption=(
            "The ladder of steps. Left: in each round the candidates that came nearest, by the logarithm of the Bayes "
            "factor for the model with the effect over the model without (linear up to the threshold, logarithmic "
            "beyond); values stand at the right. An effect is added if it beats the threshold and the best smooth "
            "function without a mechanism that contains most of its signature; where none does, two at once may, each "
            "beside the other. Where no more is added, an effect may be looked for anew, or exchanged, beside the "
            "others. Right: root mean square "
            "of held-out residuals; dotted: noise alone."
        ),
        alt="logarithms of Bayes factors of candidates, round by round, and the gap on held-out measurements",
        figure=figure,
        data=as_columns(
            ("round", "what", "kind", "ln_bayes_factor [1]", "guard [1]"),
            [(i, name, kind, value, guard) for i, b in enumerate(bars, 1) for name, value, guard, kind in b],
        ),
    )  # fmt: skip


Bar = tuple[str, float, float | None, str]


def _bars(round_: StatedRound, found: GapOfModel) -> list[Bar]:
    """Candidates of a round, best first, and the flexible term that brings most."""

    def named(term: FlexibleEvidence) -> str:
        what = f"f({covariate_text(found.channels, term.covariate)})"
        return what if len(found.channels) == 1 else f"{what}, {channel_text(found.channels, term.channel)}"

    out: list[Bar] = [
        (c.id, c.ln_bayes_factor, c.guard, "added" if c.id == round_.added else "candidate")
        for c in round_.candidates[:CANDIDATES_SHOWN]
        if c.ln_bayes_factor is not None
    ]
    out += [(named(f), f.ln_bayes_factor, None, "flexible") for f in round_.flexible[:1]]
    return out


def _round_title(number: int, round_: StatedRound, least: float) -> str:
    seen = p_text(round_.p_value)
    if round_.added is not None:
        return f"Round {number}: {seen}; {round_.added} added"
    if round_.p_value > least:
        return f"Round {number}: {seen}, no more than chance"
    return f"Round {number}: {seen}; nothing was added"


def _round(ax: Axes, bars: Sequence[Bar], worth: float) -> None:
    for place, (_, value, guard, kind) in enumerate(bars):
        if kind == "flexible":
            ax.barh(place, value, height=0.66, facecolor="white", edgecolor=FAINT, hatch="////", lw=0.5)
        else:
            ax.barh(place, value, height=0.66, color=ADDED if kind == "added" else "#8fa3b5", lw=0)
        if guard is not None:
            ax.plot(
                [guard], [place], color=GUARD, marker="|", ms=9, mew=1.6, ls="none", zorder=4, clip_on=True
            )
        text = f"{value:.1f}" if abs(value) < 100.0 else f"{value:.0f}"
        ax.annotate(
            text, (1.0, place), xycoords=ax.get_yaxis_transform(), xytext=(VALUE_WIDTH, 0), textcoords="offset points",
            ha="right", va="center", fontsize=6.2,
        )  # fmt: skip
    ax.axvline(worth, color=INK, lw=0.8, ls="--", zorder=0.5)
    ax.axvline(0.0, color=INK, lw=0.5, zorder=0.5)
    ax.set_yticks(range(len(bars)), [abridged(name, 32) for name, *_ in bars])
    ax.set_ylim(len(bars) - 0.5, -0.5)
    ax.tick_params(axis="y", length=0)


def _gap(ax: Axes, gap: StatedGap, after: str) -> None:
    names = ("before", "after", "floor")
    values = (gap.before, gap.after, gap.floor)
    for place, (value, colour) in enumerate(zip(values, ("#8fa3b5", after, "#d0d0d0"), strict=True)):
        ax.bar(place, value, width=0.62, color=colour, lw=0)
        ax.annotate(
            f"{value:.2f}", (place, value), xytext=(0, 2), textcoords="offset points", ha="center", fontsize=7
        )
    ax.axhline(1.0, color=INK, lw=0.8, ls=":")
    ax.set_xticks(range(3), names)
    ax.set_xlim(-0.5, 2.5)
    ax.set_ylim(0.0, 1.15 * max(*values, 1.0))
    ax.yaxis.set_major_locator(few_ticks(5))
    ax.set_title("Held-out gap", fontsize=8)
    ax.set_ylabel("rms of innovations [noise sd]", fontsize=7)


def effect_figure(study: StoredStudy, effect: AddedEffect) -> Drawing:
    """What an effect adds to each channel that it changes, along the covariate where that varies most."""
    name = effect.id
    channels = _changed(study.samples, name)
    covariates = [_covariate(study.samples.of(channel=c), name) for c in channels]
    conditions = _few(study.samples.distinct("condition"))
    tint = _tints(conditions)
    handles = _curve_legend(study.samples, conditions, tint, covariates)
    width = max(3.4 * len(channels) + 0.9, 4.6)
    longest = max(len(h.get_label()) for h in handles)
    across = int(np.clip((width - 0.2) / (0.55 + 0.062 * longest), 2, 6))
    bottom = 0.52 + 0.17 * math.ceil(len(handles) / across)
    title = _headed(effect.title, width)
    more = LINE_HEIGHT * (len(title) - 1)
    tall = EFFECT_HEIGHT + bottom + more
    figure = empty_sheet(width, tall)
    axes = panels(figure, 1, len(channels), left=0.7, bottom=bottom, top=0.68 + more, gap_x=0.75)[0]
    rows: list[tuple[Any, ...]] = []
    for ax, channel, covariate in zip(axes, channels, covariates, strict=True):
        facts = study.part.channels.get(channel, NamedChannel(name=channel, symbol="", unit="1"))
        rows += _curves(ax, study.samples.of(channel=channel), name, covariate, conditions, tint)
        ax.axhline(0.0, color=INK, lw=0.5, zorder=1)
        ax.set_title(f"Added to {facts.name}")
        unit = {"cycle": "1"}.get(covariate) or study.part.units.get(covariate, "1")
        ax.set_xlabel(f"{covariate_text(study.part.channels, covariate)} [{unit_label(unit) or '1'}]")
        power = take_power(ax.yaxis)
        ax.set_ylabel(f"Δ{facts.symbol or facts.name} [{in_units_of(power, facts.unit)}]")
    at = 0.1 / width
    figure.text(at, 1 - 0.08 / tall, "\n".join(title), va="top", fontsize=9.5, fontweight="bold")
    below = 1 - (0.27 + more) / tall
    figure.text(at, below, f"{name} in the catalogue", va="top", fontsize=7.5, color="#555555")
    by_row = [h for i in range(across) for h in handles[i::across]]  # a legend is filled column by column
    figure.legend(handles=by_row, loc="lower center", ncols=across, borderaxespad=0.15)
    along = " and ".join(dict.fromkeys(covariates))
    return Drawing(
        stem=f"effect-{name}",
        caption=(
            f"What {name} adds to the prediction along the measured histories, all else being equal: median and "
            f"pointwise equal-tailed 90 % band of the posterior, along {along}, where it varies most. "
            + ("Points are means of a cycle. " if "cycle" in covariates else "")
            + (
                "First and last cycle. "
                if {"temperature"} & set(covariates) and _cycles(study.samples) > 1
                else ""
            )
            + f"Equation: {effect.equation}."
        ),
        alt=f"curve of what the effect {name} adds, with its 90 % band",
        figure=figure,
        data=as_columns(
            ("condition", "branch", "cycle", "channel", "along", "at", "q05", "median", "q95"), rows
        ),
    )


def _headed(title: str, width: float) -> list[str]:
    """Lines of a heading in a figure so wide [inch]."""
    return textwrap.wrap(title[:1].upper() + title[1:], int((width - 0.2) / LETTER_WIDTH))


def _changed(samples: Samples, name: str) -> list[str]:
    """Channels that an effect changes, in the order of the file; all of them where none stands out."""
    reach = {
        c: float(np.nanmax(np.abs(s[f"{name}_median"])) / max(float(np.ptp(s["measured"])), 1e-300))
        for c in samples.distinct("channel")
        for s in [samples.of(channel=c)]
    }
    return [c for c, r in reach.items() if r > 1e-6] or list(reach)


def _covariate(some: Samples, name: str) -> str:
    """Temperature, cycle or time: what tells most of the variance of what an effect adds."""
    added = some[f"{name}_median"]
    condition = np.unique(some.words["condition"], return_inverse=True)[1].astype(float)
    branch = condition * 2 + (some.words["branch"] == "heating")
    cycles = _cycles(some)
    score = {"temperature": _told(added, branch, _binned(some["temperature"], 20))}
    if cycles > 1:
        score["cycle"] = _told(added, branch, some["cycle"])
        if "time" in some.numbers and np.all(np.isfinite(some["time"])):
            part = np.zeros(some.n)
            for c in np.unique(condition):
                mask = condition == c
                part[mask] = _binned(some["time"][mask], 3 * cycles)
            score["time"] = _told(added, condition, part)
    return max(score, key=lambda k: score[k])


def _binned(x: Floats, count: int) -> Floats:
    low, high = float(np.min(x)), float(np.max(x))
    return np.asarray(np.floor((x - low) / max(high - low, 1e-300) * count * (1.0 - 1e-12)))


def _told(values: Floats, *labels: Floats) -> float:
    """Share of the variance that lies between groups of equal labels."""
    group = np.unique(np.stack(labels, axis=1), axis=0, return_inverse=True)[1].ravel()
    mean = np.bincount(group, values) / np.maximum(np.bincount(group), 1)
    return 1.0 - float(np.var(values - mean[group])) / max(float(np.var(values)), 1e-300)


def _cycles(samples: Samples) -> int:
    return int(np.unique(samples["cycle"]).size)


def _few(conditions: Sequence[str]) -> list[str]:
    if len(conditions) <= MOST_CURVES:
        return list(conditions)
    return [conditions[i] for i in np.linspace(0, len(conditions) - 1, MOST_CURVES).round().astype(int)]


def _tints(conditions: Sequence[str]) -> dict[str, Any]:
    if len(conditions) == 1:
        return {}
    return dict(
        zip(conditions, mpl.colormaps["viridis"](np.linspace(0.05, 0.85, len(conditions))), strict=True)
    )


def _curves(
    ax: Axes, some: Samples, name: str, covariate: str, conditions: Sequence[str], tint: Mapping[str, Any]
) -> list[tuple[Any, ...]]:
    """Draw the curves of a channel, and give their data."""
    rows: list[tuple[Any, ...]] = []
    for place, condition in enumerate(conditions):
        aside = DODGE * (place - 0.5 * (len(conditions) - 1)) if covariate == "cycle" else 0.0
        for branch in COLOURS if covariate != "time" else ("",):
            part = some.of(condition=condition, **({"branch": branch} if branch else {}))
            if not part.n:
                continue
            colour = tint.get(condition, COLOURS.get(branch, INK))
            dashed = branch == "cooling" and bool(tint)
            for cycle, x, quantiles in _lines(part, name, covariate):
                _curve(ax, x + aside, quantiles, colour, dashed=dashed, dots=covariate == "cycle")
                cells = zip(x, *quantiles, strict=True)
                rows += [
                    (condition, branch or "both", cycle, part.words["channel"][0], covariate, *c)
                    for c in cells
                ]
    return rows


def _lines(part: Samples, name: str, covariate: str) -> list[tuple[Any, Floats, Floats]]:
    """Cycle, places and quantiles (3, n) of the curves of a condition and branch."""
    quantiles = np.stack([part[f"{name}_{q}"] for q in ("q05", "median", "q95")])
    cycles = np.unique(part["cycle"])
    if covariate == "cycle":
        means = np.stack([quantiles[:, part["cycle"] == c].mean(axis=1) for c in cycles], axis=1)
        return [("", cycles, means)]
    if covariate == "time":
        order = np.argsort(part["time"], kind="stable")
        return [("", part["time"][order], quantiles[:, order])]
    out = []
    for cycle in dict.fromkeys((float(cycles[0]), float(cycles[-1]))):
        own = np.flatnonzero(part["cycle"] == cycle)
        order = own[np.argsort(part["temperature"][own], kind="stable")]
        out.append((int(cycle), part["temperature"][order], quantiles[:, order]))
    return out


def _curve(ax: Axes, x: Floats, quantiles: Floats, colour: Any, *, dashed: bool, dots: bool) -> None:
    low, middle, high = quantiles
    style = {"color": colour, "lw": 1.1, "ls": "--" if dashed else "-", "zorder": 3}
    if dots:
        ax.errorbar(x, middle, yerr=np.stack([middle - low, high - middle]).clip(0.0), marker="o", ms=3, elinewidth=0.9,
                    capsize=1.5, **style)  # fmt: skip
        return
    ax.fill_between(x, low, high, color=colour, alpha=0.3, lw=0, zorder=2)
    ax.plot(x, middle, **style)


def _curve_legend(
    samples: Samples, conditions: Sequence[str], tint: Mapping[str, Any], covariates: Sequence[str]
) -> list[Any]:
    band = Patch(color=FAINT, alpha=0.5, lw=0, label="90 % band")
    if not tint:
        kinds = {b: c for b, c in COLOURS.items() if set(covariates) != {"time"}} or {"history": INK}
        return [*(Line2D([], [], color=c, lw=1.2, label=b) for b, c in kinds.items()), band]
    handles: list[Any] = [Line2D([], [], color=tint[c], lw=1.4, label=abridged(c, 22)) for c in conditions]
    if set(covariates) != {"time"} and len(samples.distinct("branch")) > 1:
        handles.append(Line2D([], [], color=INK, lw=1.0, label="heating"))
        handles.append(Line2D([], [], color=INK, lw=1.0, ls="--", label="cooling"))
    return [*handles, band]


def effect_parameter_figure(study: StoredStudy) -> Drawing:
    """Posterior of each parameter of each effect, with its prior behind."""
    places = [(e, n, p) for e in study.effects for n, p in e.parameters.items()]
    columns = min(4, len(places))
    lines = math.ceil(len(places) / columns)
    figure = empty_sheet(max(2.05 * columns + 0.2, 4.2), 0.5 + 2.05 * lines)
    axes = panels(figure, lines, columns, left=0.2, right=0.2, bottom=0.75, top=0.42, gap_x=0.3, gap_y=0.98)
    for ax, (effect, name, facts) in zip(axes.flat, places, strict=False):
        full = f"{effect.id}.{name}"
        _density(ax, study.draws[full].ravel(), study.prior[full])
        ax.set_title(f"{abridged(effect.id, 20)}\n{name}", fontsize=7.5)
        power, (low, high) = take_power(ax.xaxis), facts.prior_range
        ax.set_xlabel(
            f"{name} [{in_units_of(power, facts.unit)}]\nprior, 90 %: {compact(low)} to "
            f"{compact(high)}", fontsize=7,
        )  # fmt: skip
    for ax in list(axes.flat)[len(places) :]:
        ax.remove()
    handles = [
        Patch(color=ADDED, alpha=0.55, lw=0, label="posterior"),
        Line2D([], [], color=INK, lw=1.0, label="median; 5 % and 95 %"),
        Line2D([], [], color=PRIOR, lw=1.2, label="prior, same scale"),
    ]
    figure.legend(handles=handles, loc="lower center", ncols=3, borderaxespad=0.1)
    return Drawing(
        stem="effect-parameters",
        caption=(
            "Parameters of the added effects: posterior (filled, with median, 5 % and 95 %) and prior (line, on the "
            "same scale of density). Where the prior lies flat at the bottom the data say much; where the posterior "
            "follows it, nothing."
        ),
        alt="posterior densities of the parameters of the added effects, with their priors",
        figure=figure,
        data=_density_data(study, places),
    )


def _density(ax: Axes, draws: Floats, prior: Floats) -> None:
    low, high = np.quantile(draws, [0.002, 0.998])
    margin = 0.35 * (high - low) or abs(low) * 0.1 or 1.0
    ends = (float(low - margin), float(high + margin))
    ax.hist(draws, bins=36, range=(float(low), float(high)), density=True, color=ADDED, alpha=0.55, lw=0)
    grid = np.linspace(*ends, 200)
    ax.plot(grid, prior_density(prior, grid), color=PRIOR, lw=1.2)
    for q, style in ((0.05, ":"), (0.5, "-"), (0.95, ":")):
        ax.axvline(float(np.quantile(draws, q)), color=INK, lw=0.9, ls=style)
    ax.set_xlim(*ends)
    ax.set_ylim(bottom=0.0)
    ax.set_yticks([])
    ax.spines["left"].set_visible(False)
    ax.xaxis.set_major_locator(few_ticks(3))


def prior_density(prior: Floats, grid: Floats) -> Floats:
    """Density of draws from a prior on a grid; of their logarithms where all have the same sign.

    Parameters
    ----------
    prior : ndarray, shape (S,)
    grid : ndarray, shape (m,)
    """
    sign = float(np.sign(prior[0]))
    if np.all(np.sign(prior) == sign) and sign != 0.0:
        inside = grid * sign > 0.0
        out = np.zeros(grid.size)
        x = grid[inside] * sign
        out[inside] = gaussian_kde(np.log(prior * sign))(np.log(x)) / x
        return out
    return np.asarray(gaussian_kde(prior)(grid))


def _density_data(
    study: StoredStudy, places: Sequence[tuple[AddedEffect, str, EffectParameter]]
) -> dict[str, Any]:
    rows = []
    for effect, name, facts in places:
        full = f"{effect.id}.{name}"
        for what, values in (("posterior", study.draws[full].ravel()), ("prior", study.prior[full])):
            quantiles = np.quantile(values, np.arange(1, 100) / 100.0)
            rows += [(effect.id, name, facts.unit, what, i, q) for i, q in enumerate(quantiles, 1)]
    return as_columns(("effect", "parameter", "unit", "what", "percentile", "value [unit]"), rows)
