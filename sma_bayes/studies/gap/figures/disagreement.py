"""Figures of where a model and measurements disagree: maps of residuals, and stretches marked on the loop."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from sma_bayes.arrays import Floats
from sma_bayes.report.figures.sheet import (
    COLOURS,
    INK,
    RASTER_ABOVE_POINTS,
    Drawing,
    abridged,
    as_columns,
    dot_handle,
    empty_sheet,
    few_ticks,
    in_units_of,
    panels,
    take_power,
    wrapped,
)
from sma_bayes.report.notation import unit_label
from sma_bayes.studies.gap.outputs import Mask, Samples, StoredStudy
from sma_bayes.studies.gap.schema import StatedDisagreement
from sma_bayes.studies.gap.words import covariate_text

MARKS: Final = {"above": "#e6a700", "below": "#a77bca"}
"""Amber or violet about the number of a disagreement, as its samples lie above or below the model."""
PALE: Final = {"above": "#fbe3a0", "below": "#e3d3f0"}
"""The same behind the samples: opaque, as many that overlap would darken, and pale, so that points stand out."""
BINS: Final = 24
"""Temperatures of a map."""
LEAST_RANGE, GREATEST_RANGE = 3.0, 10.0
"""Ends of the colours of a map, at least and at most [standard errors]."""
LABEL_LETTERS: Final = 28
"""Letters of a line of a map's labels."""
LINE_HEIGHT: Final = 0.14
"""Height of such a line [inch]."""
COLUMNS: Final = 3
COUNTED_COVARIATES: Final = frozenset({"order", "cycle"})
"""Covariates that are counted, which have no unit."""
LABEL_DISTANCES: Final = (11.0, 23.0, 35.0, 47.0)
"""Distances of the number of a stretch from its samples that are tried, the first that suits is taken [points]."""
LABEL_PLACES: Final = (0.5, 0.35, 0.65, 0.2, 0.8)
"""Places along the stretch that are tried [share of its samples]."""
LETTER_WIDTH: Final = 0.092
"""Width of a letter of a title [inch]."""
LABEL_MARGIN: Final = 0.22
"""Room above and below the residuals of a loop, for the numbers of its stretches [share of their range]."""
LEAST_LABEL_DISTANCE: Final = 14.0
"""Distance of the centres of two numbers from which on they do not touch [points]."""
CURVE_POINT_DISTANCE: Final = 3.0
"""Distance of the places along a curve that no number covers [points]."""
LABEL_RADIUS: Final = 8.0
"""Distance of a number's centre from a point from which on it does not cover that [points]."""


def residual_maps(study: StoredStudy) -> Drawing:
    """Residuals over temperature and cycle, or condition, before and after the effects were added."""
    samples = study.samples
    channels = samples.distinct("channel")
    branches = [b for b in COLOURS if b in samples.distinct("branch")]
    states = ("before", "after") if study.effects else ("before",)
    rows = _map_rows(samples)
    edges = np.linspace(*_ends(samples["temperature"]), BINS + 1)
    cells = {
        (c, b, s): _map(samples.of(channel=c, branch=b), f"whitened_{s}", rows, edges)
        for c in channels
        for b in branches
        for s in states
    }
    limit = _colour_range(np.concatenate([cells[k].ravel() for k in cells if k[2] == "before"]))
    count = len(branches) * len(states)
    tall = float(np.clip(0.17 * len(rows), 1.1, 3.4))
    labels = _row_labels(rows, tall)
    left = 0.55 + 0.065 * max(len(line) for name, _ in labels for line in name.splitlines())
    height = 1.3 + len(channels) * (tall + 0.4)
    figure = empty_sheet(left + 0.15 + max(2.0, 1.9 if count > 2 else 2.6) * count, height)
    axes = panels(figure, len(channels), count, left=left, bottom=1.0, top=0.3, gap_x=0.14, gap_y=0.4)
    for place, (line, channel) in enumerate(zip(axes, channels, strict=True), 1):
        for ax, (branch, state) in zip(line, [(b, s) for b in branches for s in states], strict=True):
            image = ax.pcolormesh(
                edges, np.arange(len(rows) + 1), cells[channel, branch, state], cmap="RdBu_r", vmin=-limit, vmax=limit,
                rasterized=True,
            )  # fmt: skip
            ax.set_facecolor("#e4e4e4")
            ax.invert_yaxis()
            ax.set_title(f"{branch}, {state}" if len(states) > 1 else branch)
            ax.xaxis.set_major_locator(few_ticks(4))
            _label_rows(ax, rows, labels if ax is line[0] else ())
            ax.tick_params(axis="y", length=0)
            if place == len(channels):
                ax.set_xlabel(f"temperature T [{unit_label(study.part.units['temperature'])}]")
        box = line[0].get_position()
        name = study.part.channels[channel].name.capitalize()
        middle = 0.5 * (box.y0 + box.y1)
        figure.text(
            0.1 / figure.get_figwidth(), middle, name, rotation=90, va="center", fontsize=9, fontweight="bold"
        )
    width = figure.get_figwidth()
    bar = figure.add_axes((0.5 - 1.5 / width, 0.4 / height, 3.0 / width, 0.11 / height))
    figure.colorbar(image, cax=bar, orientation="horizontal", extend="both")
    bar.set_xlabel("mean residual of a cell [its standard error under noise alone]", fontsize=7)
    return Drawing(
        stem="residual-maps",
        caption=_map_caption(rows, compared=len(states) > 1),
        alt="maps of residuals over temperature, by branch and channel"
        + (", before and after effects were added" if len(states) > 1 else ""),
        figure=figure,
        data=_map_data(cells, rows, edges, study.part.units["temperature"]),
    )  # fmt: skip


def _map_caption(rows: Sequence[tuple[str, int]], *, compared: bool) -> str:
    text = (
        "Residuals as innovations of the noise, averaged in cells of temperature and "
        + ("cycle" if any(cycle > 1 for _, cycle in rows) else "condition")
        + ", in standard errors: red where more was measured than is expected from the model and the sample before, "
        "blue where less, grey where nothing was measured. Under noise alone they scatter by about 1 without a pattern."
    )
    if not compared:
        return text
    return (
        f"{text} Before: the model without effects. After: with those that were added, in the same colours."
    )


def _ends(values: Floats) -> tuple[float, float]:
    low, high = float(np.min(values)), float(np.max(values))
    return (low, high) if high > low else (low - 0.5, high + 0.5)


def _colour_range(values: Floats) -> float:
    seen = np.abs(values[np.isfinite(values)])
    high = float(np.quantile(seen, 0.98)) if seen.size else LEAST_RANGE
    return float(np.clip(high, LEAST_RANGE, GREATEST_RANGE))


def _map_rows(samples: Samples) -> list[tuple[str, int]]:
    """Conditions with their cycles, one row of a map each."""
    found = zip(samples.words["condition"].tolist(), samples["cycle"].astype(int).tolist(), strict=True)
    places = {c: i for i, c in enumerate(samples.distinct("condition"))}
    return sorted(set(found), key=lambda r: (places[r[0]], r[1]))


def _map(some: Samples, column: str, rows: Sequence[tuple[str, int]], edges: Floats) -> Floats:
    """Mean of whitened residuals in each cell over its standard error, shape (rows, bins); NaN where there are none."""
    out = np.full((len(rows), len(edges) - 1), np.nan)
    at = np.clip(np.digitize(some["temperature"], edges) - 1, 0, len(edges) - 2)
    for i, (condition, cycle) in enumerate(rows):
        mask = (some.words["condition"] == condition) & (some["cycle"] == cycle)
        total = np.bincount(at[mask], some[column][mask], minlength=len(edges) - 1)
        count = np.bincount(at[mask], minlength=len(edges) - 1)
        out[i] = np.where(count > 0, total / np.sqrt(np.maximum(count, 1)), np.nan)
    return out


def _row_labels(rows: Sequence[tuple[str, int]], tall: float) -> list[tuple[str, float]]:
    """Labels of rows with their places: conditions, or the cycles of the only one; not more than there is room for.

    Long names are in as many lines as there is room for in a map `tall` inches high.
    """
    conditions = list(dict.fromkeys(c for c, _ in rows))
    if len(conditions) == 1 and len(rows) > 1:
        step = math.ceil(len(rows) / 12)
        return [(f"cycle {n}", i + 0.5) for i, (_, n) in enumerate(rows)][::step]
    middle = {c: float(np.mean([i for i, r in enumerate(rows) if r[0] == c])) + 0.5 for c in conditions}
    step = math.ceil(len(conditions) / 20)
    lines = int(np.clip(tall * step / len(conditions) / LINE_HEIGHT, 1, 3))
    return [(wrapped(c, LABEL_LETTERS, lines), y) for c, y in middle.items()][::step]


def _label_rows(ax: Axes, rows: Sequence[tuple[str, int]], labels: Sequence[tuple[str, float]]) -> None:
    ax.set_yticks([y for _, y in labels], [name for name, _ in labels])
    for i in range(1, len(rows)):
        if rows[i][0] != rows[i - 1][0]:
            ax.axhline(i, color="white", lw=1.2)


def _map_data(
    cells: Mapping[tuple[str, str, str], Floats], rows: Sequence[tuple[str, int]], edges: Floats, unit: str
) -> dict[str, Any]:
    out = [
        (channel, branch, state, condition, cycle, edges[j], edges[j + 1], values[i, j])
        for (channel, branch, state), values in cells.items()
        for i, (condition, cycle) in enumerate(rows)
        for j in range(len(edges) - 1)
        if np.isfinite(values[i, j])
    ]
    header = (
        "channel",
        "branch",
        "model",
        "condition",
        "cycle",
        f"from [{unit}]",
        f"to [{unit}]",
        "mean_residual [se]",
    )
    return as_columns(header, out)


def disagreement_loops(study: StoredStudy) -> Drawing:
    """Channels against temperature with the stretches of disagreement marked by their number."""
    found = study.part.disagreement
    places = list(dict.fromkeys((d.condition, d.channel) for d in found))
    if not places:
        conditions, channels = study.samples.distinct("condition"), study.samples.distinct("channel")
        places = [(c, k) for c in conditions for k in channels][:6]
    columns = 2 if len(places) == 4 else min(COLUMNS, len(places))
    lines = math.ceil(len(places) / columns)
    wide = 2.75 if columns > 1 else 4.2
    figure = empty_sheet(0.2 + (wide + 0.3) * columns, 0.7 + 3.95 * lines)
    axes = panels(figure, 2 * lines, columns, left=0.68, right=0.1, bottom=0.9, top=0.3, gap_x=0.68, gap_y=0.55,
                  tall=(2.0, 1.0) * lines)  # fmt: skip
    pairs = [(axes[2 * i, j], axes[2 * i + 1, j]) for i in range(lines) for j in range(columns)]
    for (upper, lower), (condition, channel) in zip(pairs, places, strict=False):
        _loop(upper, study, condition, channel)
        _strip(lower, study, condition, channel)
        upper.set_title(_loop_title(study, places, condition, channel, int(wide / LETTER_WIDTH)))
        upper.set_xlabel(f"temperature T [{unit_label(study.part.units['temperature'])}]", labelpad=1.0)
    for pair in pairs[len(places) :]:
        for ax in pair:
            ax.remove()
    handles = [
        *(
            dot_handle(c, f"measured, {b}")
            for b, c in COLOURS.items()
            if b in study.samples.distinct("branch")
        ),
        Line2D([], [], color=INK, lw=1.0, ls="--", label="model without effects"),
    ]
    if study.effects:
        handles.append(Line2D([], [], color=INK, lw=1.1, label="with the added effects"))
    sides = {d.side for d in found}
    handles += [
        Line2D([], [], lw=5, label=f"stretch, measured {side} model", **stretch_style(side))
        for side in MARKS
        if side in sides
    ]
    figure.legend(handles=handles, loc="lower center", ncols=3 if columns > 1 else 2, borderaxespad=0.2)
    return Drawing(
        stem="disagreement",
        caption=(
            ("Where model and measurement disagree: the stretches of the table above, by number. " if found
             else "The loops; no stretch disagrees by more than chance explains. ")
            + "Points: measurements. Dashed: the model without effects, at its best fit; below, what was measured less "
            "that, along the covariate of the strongest stretch (stretches of heating in the upper half, of cooling in "
            "the lower)"
            + (". Solid: with the effects that were added, refitted." if study.effects else ".")
        ),
        alt="channels against temperature with the stretches of disagreement marked",
        figure=figure,
        data=_loop_data(study, places),
    )  # fmt: skip


def _loop_title(
    study: StoredStudy, places: Sequence[tuple[str, str]], condition: str, channel: str, room: int
) -> str:
    """Condition of a loop, and its channel where the loops are of several; at most `room` letters."""
    several = len({c for _, c in places}) > 1
    what = f": {study.part.channels[channel].name}" if several else ""
    return f"{abridged(condition, room - len(what))}{what}"


def stretch_style(side: str) -> dict[str, Any]:
    """How what lies behind the samples of a disagreement is drawn."""
    return {"color": PALE[side]}


def _loop(ax: Axes, study: StoredStudy, condition: str, channel: str) -> None:
    some = study.samples.of(condition=condition, channel=channel)
    marked = [
        (str(number), d, some.where(stretch(some, d)))
        for number, d in enumerate(study.part.disagreement, 1)
        if (d.condition, d.channel) == (condition, channel)
    ]
    for _, d, inside in marked:
        ax.scatter(inside["temperature"], inside["measured"], s=34, linewidths=0, zorder=1, rasterized=True,
                   **stretch_style(d.side))  # fmt: skip
    for branch, colour in COLOURS.items():
        part = some.of(branch=branch)
        ax.scatter(part["temperature"], part["measured"], s=4, color=colour, alpha=0.8, linewidths=0, zorder=2,
                   rasterized=part.n > RASTER_ABOVE_POINTS)  # fmt: skip
        for segment in np.unique(part["segment"])[[0, -1]] if part.n else []:
            sweep = part.where(part["segment"] == segment)
            order = np.argsort(sweep["temperature"], kind="stable")
            ax.plot(sweep["temperature"][order], sweep["before"][order], color=INK, lw=0.8, ls="--", zorder=3)
            if study.effects:
                ax.plot(sweep["temperature"][order], sweep["after"][order], color=INK, lw=1.0, zorder=3.1)
    facts = study.part.channels[channel]
    ax.margins(x=0.04, y=0.08)
    power = take_power(ax.yaxis)
    ax.set_ylabel(f"{facts.name} {facts.symbol} [{in_units_of(power, facts.unit)}]")
    _number(ax, marked, np.column_stack([some["temperature"], some["measured"]]))


def _strip(ax: Axes, study: StoredStudy, condition: str, channel: str) -> None:
    """Measured less predicted without effects, along the covariate of the strongest stretch of a loop."""
    some = study.samples.of(condition=condition, channel=channel)
    own = [
        (i, d)
        for i, d in enumerate(study.part.disagreement, 1)
        if (d.condition, d.channel) == (condition, channel)
    ]
    covariate = own[0][1].covariate if own else "temperature"
    for number, d in own:
        if d.covariate == covariate:
            pad = 0.3 if covariate == "cycle" else 0.0
            ends = (d.from_ - pad, d.to + pad)
            low, high, sink = (0.5, 1.0, -5) if d.branch == "heating" else (0.0, 0.5, 5)
            ax.axvspan(*ends, low, high, lw=0, zorder=0, **stretch_style(d.side))
            for end in ends:
                ax.axvline(end, low, high, color="white", lw=1.0, zorder=0.5)
            ax.annotate(
                str(number), (0.5 * sum(ends), high if sink < 0 else low), xycoords=ax.get_xaxis_transform(),
                xytext=(0, sink), textcoords="offset points", ha="center", va="center", fontsize=6.5,
                fontweight="bold", zorder=7,
            )  # fmt: skip
    x = along(some, covariate)
    for branch, colour in COLOURS.items():
        mine = some.words["branch"] == branch
        left = (some["measured"] - some["before"])[mine]
        ax.scatter(x[mine], left, s=3, color=colour, alpha=0.7, linewidths=0, rasterized=True)
    ax.axhline(0.0, color=INK, lw=0.5)
    ax.margins(y=LABEL_MARGIN)
    facts = study.part.channels[channel]
    power = take_power(ax.yaxis)
    ax.set_ylabel(f"residual [{in_units_of(power, facts.unit)}]", fontsize=6.5)
    if covariate == "cycle":
        ax.xaxis.set_major_locator(MaxNLocator(5, integer=True))
    ax.yaxis.set_major_locator(few_ticks(3))
    unit = (
        ""
        if covariate in COUNTED_COVARIATES
        else f" [{unit_label(study.part.units.get(covariate, '1')) or '1'}]"
    )
    ax.set_xlabel(f"{covariate_text(study.part.channels, covariate)}{unit}", labelpad=1.0)


def along(some: Samples, covariate: str) -> Floats:
    """Values of a covariate; the place in the history where there is no such column."""
    return some[covariate] if covariate in some.numbers else np.arange(1.0, some.n + 1.0)


def stretch(some: Samples, d: StatedDisagreement) -> Mask:
    """Samples of a condition and channel that lie in a stretch of disagreement."""
    own: NDArray[np.bool_] = some.words["branch"] == d.branch
    values = along(some, d.covariate)
    return np.asarray(own & (values >= d.from_) & (values <= d.to))


def _number(ax: Axes, marked: Sequence[tuple[str, StatedDisagreement, Samples]], points: Floats) -> None:
    """Numbers beside the stretches of a loop, within its panel, on no curve of it and on no point (n, 2).

    Over the stretches of cooling and under those of heating, unless that room is taken.
    """
    ax.autoscale_view()  # matplotlib sets limits when it draws; places are asked for now
    taken: list[Floats] = []
    pixels = ax.figure.dpi / 72.0
    curves = [_walked(ax.transData.transform(line.get_xydata()) / pixels) for line in ax.lines]
    drawn = np.concatenate([ax.transData.transform(points) / pixels, *curves])
    frame = ax.get_window_extent().get_points() / pixels
    for number, d, inside in marked:
        if not inside.n:
            continue
        order = np.argsort(inside["temperature"], kind="stable")
        side = 1.0 if d.branch == "cooling" else -1.0
        places = [
            (int(order[int(share * (inside.n - 1))]), way * away)
            for way in (side, -side)
            for away in LABEL_DISTANCES
            for share in LABEL_PLACES
        ]
        at = np.column_stack([inside["temperature"], inside["measured"]])
        there = ax.transData.transform(at) / pixels
        centres = [there[sample] + [0.0, away] for sample, away in places]
        best = int(
            np.argmax(
                [
                    _clear(c, taken, LEAST_LABEL_DISTANCE)
                    + _clear(c, drawn, LABEL_RADIUS)
                    + _within(c, frame)
                    for c in centres
                ]
            )
        )
        taken.append(centres[best])
        sample, away = places[best]
        ax.annotate(
            number, at[sample], xytext=(0, away), textcoords="offset points", ha="center", va="center",
            fontsize=7, fontweight="bold", color=INK, zorder=7, annotation_clip=False,
            bbox={"boxstyle": "circle,pad=0.22", "facecolor": "white", "edgecolor": MARKS[d.side], "linewidth": 1.0},
            arrowprops={"arrowstyle": "-", "color": MARKS[d.side], "linewidth": 1.0, "shrinkB": 0.0},
        )  # fmt: skip


def _walked(line: Floats) -> Floats:
    """Points (m, 2) all along a line (n, 2), near enough to each other that no number fits in between [points]."""
    path = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])
    steps = np.arange(0.0, path[-1] + CURVE_POINT_DISTANCE, CURVE_POINT_DISTANCE)
    return np.column_stack([np.interp(steps, path, part) for part in line.T])


def _clear(place: Floats, others: Sequence[Floats] | Floats, enough: float) -> float:
    """Distance to the nearest of what is there already, as a share of the one that is enough; at most 1."""
    return float(min([enough, *np.hypot(*(np.reshape(others, (-1, 2)) - place).T)]) / enough)


def _within(place: Floats, frame: Floats) -> float:
    """Distance to the nearest edge of a panel, as a share of the radius of a number; at most 1, negative outside."""
    return float(min(LABEL_RADIUS, *(place - frame[0]), *(frame[1] - place)) / LABEL_RADIUS)


def _loop_data(study: StoredStudy, places: Sequence[tuple[str, str]]) -> dict[str, Any]:
    rows: list[tuple[Any, ...]] = []
    for condition, channel in places:
        some = study.samples.of(condition=condition, channel=channel)
        number = np.zeros(some.n, dtype=int)
        for i, d in enumerate(study.part.disagreement, 1):
            if (d.condition, d.channel) == (condition, channel):
                number[stretch(some, d)] = i
        unit = study.part.channels[channel].unit
        rows += zip(
            [condition] * some.n, [channel] * some.n, [unit] * some.n, some.words["branch"].tolist(),
            some["row"].astype(int).tolist(), some["temperature"], some["measured"], some["before"], some["after"],
            number.tolist(), strict=True,
        )  # fmt: skip
    unit = study.part.units["temperature"]
    header = ("condition", "channel", "unit", "branch", "row", f"temperature [{unit}]")
    return as_columns((*header, "measured [unit]", "before [unit]", "after [unit]", "stretch"), rows)
