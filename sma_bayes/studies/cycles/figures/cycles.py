"""Figures of a study of cycles: curves, the numbers of the sweeps, temperatures and values."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from sma_bayes.report.figures.sheet import (
    COLOURS,
    FAINT,
    INK,
    Drawing,
    as_columns,
    branch_legend,
    empty_sheet,
    heading,
    in_units_of,
    numbered,
    ordered_colours,
    panels,
    take_power,
)
from sma_bayes.report.notation import unit_label
from sma_bayes.runs.shown import series_shown
from sma_bayes.runs.store import or_nan
from sma_bayes.studies.cycles.schema import ConditionCycles, QuantityByCycle, StoredCycles

NUMBERS: Final = ("offset", "stroke", "shift", "width")
FORECAST: Final = "#eef1f4"
ACROSS: Final = 4
"""Panels side by side, at most."""


def curves_figure(stored: StoredCycles, number: int) -> Drawing:
    """Median curves of all cycles of a condition, first to last, and those that are forecast.

    Parameters
    ----------
    stored : StoredCycles
    number : int
        Condition, from 1.
    """
    one, unit = stored.found.conditions[number - 1], stored.found.temperature_unit
    channels = list(dict.fromkeys(c.channel for c in one.curves))
    branches = list(dict.fromkeys(c.branch for c in one.curves))
    beside = min(len(channels), ACROSS // len(branches))
    high = -(-len(channels) // beside)
    figure = empty_sheet(max(0.9 + 2.3 * beside * len(branches), 6.9), 1.0 + 2.25 * high)
    axes = panels(
        figure, high, beside * len(branches), left=0.75, bottom=0.5, top=0.75, gap_x=0.75, gap_y=0.65
    )
    names = ("cycle", f"temperature_{unit}", "q05", "q50", "q95")
    rows: list[tuple[Any, ...]] = []
    last = one.measured[-1]
    colours = ordered_colours(max(last - one.cycles[0] + 1, 2))
    for curve in one.curves:
        row, place = divmod(channels.index(curve.channel), beside)
        ax = axes[row][place * len(branches) + branches.index(curve.branch)]
        file = f"curves/{one.condition}-{curve.branch}-{curve.channel}.csv"
        columns = series_shown(stored, file, curve.channel)
        cycle, t = columns["cycle"], columns[f"temperature_{unit}"]
        for c in one.cycles:
            own = cycle == c
            if c == one.cycles[-1]:
                ax.fill_between(
                    t[own], columns["q05"][own], columns["q95"][own], color=FAINT, alpha=0.35, lw=0
                )
                ax.plot(t[own], columns["q50"][own], color=INK, ls="--", lw=0.9)
            elif c in one.measured:
                ax.plot(t[own], columns["q50"][own], color=colours[c - one.cycles[0]], lw=0.9)
        cells = zip(*(columns[name].tolist() for name in names), strict=True)
        rows += [(curve.branch, curve.channel, *values) for values in cells]
        ax.set_title(curve.branch, color=COLOURS[curve.branch])
        ax.set_xlabel(f"temperature [{unit_label(unit)}]")
        _label(ax, curve.channel, curve.unit)
    for empty in axes[-1][(len(channels) - (high - 1) * beside) * len(branches) :]:
        empty.set_axis_off()
    heading(figure, f"{one.condition}: curves by cycle", "")
    figure.text(
        0.1 / figure.get_figwidth(), 1.0 - 0.3 / figure.get_figheight(), va="top", fontsize=7.0, color="#555555",
        s=f"violet to green: cycles {one.cycles[0]} to {last}; dashed with 90 % band: cycle {one.cycles[-1]}, forecast",
    )  # fmt: skip
    caption = (
        f"Median curve of each measured cycle of {one.condition}, and of cycle {one.cycles[-1]} as it is forecast, "
        "with its 90 % predictive interval."
    )
    data = as_columns(("branch", "channel", "cycle", "temperature", "q05", "q50", "q95"), rows)
    return Drawing(numbered("curves", number), caption, caption, figure, data)


def numbers_figure(stored: StoredCycles, number: int) -> Drawing:
    """The four numbers of each sweep against the cycle.

    Parameters
    ----------
    stored : StoredCycles
    number : int
        Condition, from 1.
    """
    one = stored.found.conditions[number - 1]
    channels = list(dict.fromkeys(q.channel for q in one.quantities if q.name in NUMBERS))
    rows = [
        [[q for q in one.quantities if q.name == name and q.channel == channel] for name in NUMBERS]
        for channel in channels
    ]
    caption = (
        f"Offset, stroke, shift and width of every sweep of {one.condition}: points are sweeps by themselves with "
        "their 90 % intervals, lines and bands pooled over cycles; the shaded part is forecast."
    )
    return _against_cycle(
        one, rows, numbered("numbers", number), f"{one.condition}: numbers by cycle", caption, ""
    )


def values_figure(stored: StoredCycles, number: int) -> Drawing:
    """Transformation temperatures, and channels and stiffness at some temperatures, against the cycle.

    Parameters
    ----------
    stored : StoredCycles
    number : int
        Condition, from 1.
    """
    one, unit = stored.found.conditions[number - 1], stored.found.temperature_unit
    rest = [q for q in one.quantities if q.name not in NUMBERS and any(v is not None for v in q.median)]
    rows = _rows_of_values(rest)
    untold = sum(q.name not in NUMBERS for q in one.quantities) > len(rest)
    caption = (
        f"Transformation temperatures of {one.condition}, and channels and stiffness at the temperatures that were "
        "asked: points are sweeps by themselves with their 90 % intervals, lines and bands pooled over cycles; the "
        "shaded part is forecast." + (" What can't be told in any cycle is left out." if untold else "")
    )
    return _against_cycle(
        one, rows, numbered("values", number), f"{one.condition}: values by cycle", caption, unit
    )


def _rows_of_values(values: Sequence[QuantityByCycle]) -> list[list[list[QuantityByCycle]]]:
    """Panels in rows: start and finish, then a row for each temperature where more than one thing is told."""
    panel: dict[tuple[str, float | None], list[QuantityByCycle]] = {}
    for q in values:
        panel.setdefault((q.name, q.at), []).append(q)
    at = list(dict.fromkeys(where for _, where in panel))
    rows = [[own for (_, there), own in panel.items() if there == where] for where in at]
    if all(len(row) == 1 for where, row in zip(at, rows, strict=True) if where is not None):
        rows = [
            [own for (_, where), own in panel.items() if (where is None) is temperatures]
            for temperatures in (True, False)
        ]
    return [row[i : i + ACROSS] for row in rows for i in range(0, len(row), ACROSS)]


def _against_cycle(
    one: ConditionCycles,
    rows: Sequence[Sequence[Sequence[QuantityByCycle]]],
    stem: str,
    title: str,
    caption: str,
    temperature_unit: str,
) -> Drawing:
    wide = max(len(r) for r in rows)
    figure = empty_sheet(0.85 + 2.3 * wide, 0.9 + 2.05 * len(rows))
    axes = panels(figure, len(rows), wide, left=0.7, right=0.12, bottom=0.5, top=0.55, gap_x=0.75, gap_y=0.7)
    for r, row in enumerate(rows):
        for c in range(wide):
            ax = axes[r][c]
            if c >= len(row):
                ax.set_visible(False)
                continue
            for q in row[c]:
                _draw(ax, one, q)
            first = row[c][0]
            at = f" at {first.at:g} {unit_label(temperature_unit)}" if first.at is not None else ""
            named = first.channel if first.at is None and first.name in NUMBERS else ""
            ax.set_title(f"{named} {first.name}{at}".strip(), fontsize=7.5)
            ax.set_xlabel("cycle")
            ax.xaxis.set_major_locator(MaxNLocator(6, integer=True))
            ax.axvspan(one.measured[-1] + 0.5, one.cycles[-1] + 0.5, color=FORECAST, lw=0, zorder=-2)
            ax.set_xlim(one.cycles[0] - 0.5, one.cycles[-1] + 0.5)
            _label(ax, "", first.unit)
    heading(figure, title, "")
    branch_legend(figure, (q.branch for q in one.quantities))
    header = ("branch", "channel", "name", "unit", "at", "cycle", "own", "own_sd", "q05", "median", "q95")
    data = [
        (q.branch, q.channel, q.name, q.unit, q.at, *values)
        for q in (q for row in rows for group in row for q in group)
        for values in zip(one.cycles, q.own, q.own_sd, q.q05, q.median, q.q95, strict=True)
    ]
    return Drawing(stem, caption, caption, figure, as_columns(header, data))


def _label(ax: Axes, name: str, unit: str) -> None:
    power = take_power(ax.yaxis)
    ax.set_ylabel(f"{name} [{in_units_of(power, unit)}]".strip())


def _draw(ax: Axes, one: ConditionCycles, q: QuantityByCycle) -> None:
    cycle, colour = np.array(one.cycles, dtype=float), COLOURS[q.branch]
    low, middle, high, own, sd = (
        np.array([or_nan(v) for v in values]) for values in (q.q05, q.median, q.q95, q.own, q.own_sd)
    )
    ax.fill_between(cycle, low, high, color=colour, alpha=0.2, lw=0)
    ax.plot(cycle, middle, color=colour, lw=0.9)
    seen = np.isfinite(own)
    ax.errorbar(
        cycle[seen], own[seen], yerr=1.645 * np.nan_to_num(sd[seen]), fmt="o", ms=2.4, lw=0.7, color=colour,
        mfc="white", mew=0.7,
    )  # fmt: skip
