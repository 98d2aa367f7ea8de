"""Figures of a watch: evidence against the cycle, and the numbers of the sweeps with what is normal."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from sma_bayes.report.figures.sheet import (
    COLOURS,
    FAINT,
    INK,
    Drawing,
    as_columns,
    branch_legend,
    decade_text,
    dot_handle,
    empty_sheet,
    heading,
    in_units_of,
    panels,
    remark,
    take_power,
)
from sma_bayes.report.notation import power_text
from sma_bayes.runs.store import or_nan
from sma_bayes.studies.watch.schema import StoredWatch, WatchDocument, WatchedNumber
from sma_bayes.studies.watch.state import WATCHED

ALARM: Final = "#b3261e"
MAX_MARKERS: Final = 60
"""Cycles, at most, each of which has a point of its own."""
MOST_DECADES: Final = 300
"""Beyond which evidence is no number of the machine any more."""


def evidence_figure(stored: StoredWatch) -> Drawing:
    """The e-process against the cycle, with the line of the alarm."""
    found = stored.found
    cycle = np.array([c.cycle for c in found.cycles])
    total = np.array([c.log10_e for c in found.cycles])
    needed = -float(np.log10(found.alpha))
    figure = empty_sheet(6.4, 3.2)
    ax = panels(figure, 1, 1, left=0.75, right=0.2, bottom=0.85, top=0.3)[0][0]
    series = len(found.numbers) + len(found.together)
    share = np.log10(series)
    size = 2.6 if cycle.size <= MAX_MARKERS else 0.0
    for n in found.numbers:
        own = np.array(n.log10_e) - share
        ax.plot(cycle, own, color=COLOURS[n.branch], lw=0.6, alpha=0.45, marker="o", ms=0.7 * size)
    for cause in found.together:
        ax.plot(cycle, np.array(cause.log10_e) - share, color=FAINT, lw=0.6, marker="o", ms=0.7 * size)
    ax.plot(cycle, total, color=INK, lw=1.3, marker="o", ms=size)
    ax.axhline(needed, color=ALARM, lw=0.9, ls="--")
    ax.axhline(0.0, color=FAINT, lw=0.6)
    if found.alarm is not None:
        ax.axvline(found.alarm.cycle, color=ALARM, lw=0.7, ls=":")
    low, high = min(float(total.min()), -1.0), max(float(total.max()), needed)
    ax.set(ylim=(low - 0.6, high + 0.12 * (high - low) + 0.4), xlim=(0.5, cycle[-1] + 0.5))
    ax.xaxis.set_major_locator(MaxNLocator(integer=True, nbins=8, min_n_ticks=1))
    ax.yaxis.set_major_locator(MaxNLocator(integer=True, nbins=6, min_n_ticks=1))
    ax.yaxis.set_major_formatter(lambda power, _: _evidence_text(round(power)))
    ax.set(xlabel="watched cycle", ylabel="evidence")
    heading(figure, f"{found.condition}: evidence of a change", "")
    branches = list(dict.fromkeys(n.branch for n in found.numbers))
    figure.legend(
        handles=[
            dot_handle(INK, "greatest of all"), *(dot_handle(COLOURS[b], f"numbers, {b}") for b in branches),
            dot_handle(FAINT, "together, by cause"),
            Line2D([], [], color=ALARM, lw=0.9, ls="--", label=f"alarm at {1.0 / found.alpha:.4g}"),
        ],
        loc="lower center", ncols=3 + len(branches),
    )  # fmt: skip
    data: dict[str, Any] = {"cycle": cycle, "log10_e": total, "log10_alarm": np.full(cycle.size, needed)}
    caption = (
        f"Evidence of a change after each watched cycle: thin, numbers of the sweeps and numbers together that "
        f"a cause moves; thick, the greatest; all over {series}. While nothing changes it ever comes to the dashed "
        f"line with a probability of at most {found.alpha:.3g}."
    )
    return Drawing("evidence", caption, caption, figure, data)


def _evidence_text(power: int) -> str:
    """A power of ten of the evidence, written as the sentence of the verdict writes it."""
    return decade_text(10.0**power) if abs(power) < MOST_DECADES else f"10{power_text(power)}"


def numbers_figure(stored: StoredWatch) -> Drawing:
    """The numbers of every sweep against the cycle, with what is normal."""
    found = stored.found
    channels = list(dict.fromkeys(n.channel for n in found.numbers))
    figure = empty_sheet(0.85 + 2.3 * len(WATCHED), 0.9 + 2.05 * len(channels))
    axes = panels(
        figure, len(channels), len(WATCHED), left=0.7, right=0.12, bottom=0.5, top=0.55, gap_x=0.6, gap_y=0.7
    )
    cycle = _axis(found)
    rows: list[tuple[Any, ...]] = []
    for row, channel in zip(axes, channels, strict=True):
        for ax, name in zip(row, WATCHED, strict=True):
            own = [n for n in found.numbers if n.channel == channel and n.number == name]
            for n in own:
                _draw(ax, cycle, n)
                cells = zip(cycle.tolist(), n.value, n.normal_low, n.normal_high, strict=True)
                rows += [(n.branch, n.channel, n.number, n.unit, *values) for values in cells]
            ax.axvline(0.0, color=INK, lw=0.6, ls=":")
            if found.alarm is not None:
                ax.axvline(found.alarm.cycle, color=ALARM, lw=0.7, ls=":")
            ax.set(xlabel="watched cycle", xlim=(cycle[0] - 0.5, cycle[-1] + 0.5))
            ax.xaxis.set_major_locator(MaxNLocator(integer=True, nbins=6, min_n_ticks=1))
            power = take_power(ax.yaxis)
            ax.set_title(f"{channel} {name} [{in_units_of(power, own[0].unit)}]", fontsize=7.5)
            if own[0].normal_low[-1] is None:
                remark(ax, "scatter not known yet", "#555555")
    heading(figure, f"{found.condition}: numbers of the sweeps", "")
    branch_legend(figure, (n.branch for n in found.numbers))
    caption = (
        "Offset, stroke, shift, width of every sweep and what these leave; left of the dotted line the fitted cycles, "
        "right of it the watched ones. Bands: where 95 % of the sweeps are while nothing changes."
        + (" The red line is the alarm." if found.alarm is not None else "")
    )
    header = ("branch", "channel", "number", "unit", "cycle", "value", "normal_low", "normal_high")
    return Drawing("numbers", caption, caption, figure, as_columns(header, rows))


def _axis(found: WatchDocument) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """Watched cycles from 1; the fitted ones before, the last of them 0 less a half."""
    fitted = np.arange(-len(found.fitted), 0.0) + 0.5
    return np.concatenate([fitted, np.arange(1.0, len(found.cycles) + 1.0)])


def _draw(ax: Axes, cycle: np.ndarray[tuple[int], np.dtype[np.float64]], n: WatchedNumber) -> None:
    low, high = (np.array([or_nan(v) for v in side]) for side in (n.normal_low, n.normal_high))
    ax.fill_between(cycle, low, high, color=COLOURS[n.branch], alpha=0.15, lw=0, step="mid")
    ax.plot(cycle, n.value, ls="none", marker="o", ms=2.4, color=COLOURS[n.branch], mfc="white", mew=0.7)
