"""Current, temperature and channels in time, from each start."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final, Literal

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from sma_bayes.arrays import Floats
from sma_bayes.quantities import QUANTITIES, convert
from sma_bayes.report.figures.sheet import (
    FAINT,
    INK,
    Drawing,
    empty_sheet,
    heading,
    in_units_of,
    panels,
    remark,
    take_power,
)
from sma_bayes.studies.simulate.schema import SimulatedRun, StoredSimulation
from sma_bayes.studies.simulate.terminal import start_text

LOOKS: Final = {"cold": "#1f6fb2", "hot": "#c8501e", "heating": "#2f7d4f", "cooling": "#6a3d9a"}
DASHES: Final[dict[str, Literal["-", "--"]]] = {"cold": "-", "hot": "--", "heating": "-", "cooling": "--"}

SAME_COURSE: Final = 0.25
"""Distance of medians, over the width of the band of another run, up to which two starts are one line."""
LEAST_SHARE_TOLD: Final = 0.1
"""Share of a course in which a stiffness has to be told that its axis is kept to that."""
NEGATIVE_STIFFNESS_SHARE: Final = 0.02
"""Share of a course in which the band of a stiffness may reach below nought without that its axis does."""


def course_figure(stored: StoredSimulation, condition: str) -> Drawing:
    """Bands in time of one condition, all starts together; those of one course are one line.

    Parameters
    ----------
    stored : StoredSimulation
    condition : str
        Its id.
    """
    runs = [r for r in stored.found.runs if r.condition == condition]
    first, bands = runs[0], {r.file: stored.columns(r.file) for r in runs}
    channels = list(first.units)
    courses = _distinct(runs, bands)
    figure = empty_sheet(6.8, 1.35 + 0.62 + 1.35 * len(channels))
    axes = panels(
        figure, 1 + len(channels), 1, left=0.75, bottom=0.75, top=0.35, gap_y=0.16,
        tall=(0.5, *[1.0] * len(channels)),
    )[:, 0]  # fmt: skip
    time, current = (bands[first.file][name] for name in ("time_s", "current_A"))
    axes[0].step(time, current, where="post", color=INK, linewidth=0.9)
    axes[0].set_ylabel("I [A]")
    for ax, channel in zip(axes[1:], channels, strict=True):
        for run, *_ in courses:
            _draw(ax, run, channel, bands[run.file])
        unit = first.declared_units.get(channel, first.units[channel])
        _limit(ax, [(bands[r.file], r) for r in runs], channel)
        symbol = QUANTITIES[first.names[channel]].symbol
        ax.set_ylabel(f"{symbol} [{in_units_of(take_power(ax.yaxis), unit)}]")
    low, high = map(first.shown_temperature, first.measured)
    seen = [edge for edge in (low, high) if axes[1].get_ylim()[0] < edge < axes[1].get_ylim()[1]]
    for edge in seen:
        axes[1].axhline(edge, color=FAINT, linewidth=0.7, linestyle=":")
    if seen:
        remark(axes[1], "dotted: coldest or hottest that was measured", INK)
    for ax in axes:
        ax.set_xlim(time[0], time[-1])
        if ax is not axes[-1]:
            ax.tick_params(labelbottom=False)
    axes[-1].set_xlabel("time [s]")
    heading(figure, f"{condition}: course in time", "")
    handles: list[Any] = [
        Line2D(
            [], [], color=LOOKS[first.start], linestyle=DASHES[first.start],
            label=f"{' or '.join(map(start_text, same))} start, median",
        )
        for same in courses
        for first in same[:1]
    ]  # fmt: skip
    handles += [
        Patch(facecolor=INK, alpha=0.45, label="90 % of the curve"),
        Patch(facecolor=INK, alpha=0.15, label="90 % of another run"),
    ]
    figure.legend(handles=handles, loc="lower center", ncols=4, borderaxespad=0.2)
    return Drawing(
        stem=f"course-{condition}",
        caption=(
            f"{condition}: current, and temperature, {', '.join(first.names[c] for c in channels[1:])} that it makes. "
            "Lines are medians, inner bands hold 90 % of the curve, outer ones 90 % of another run. A "
            "band that is wider than its median by far leaves its axis."
        ),
        alt=f"current, temperature and response of {condition} in time, with bands",
        figure=figure,
        data={
            "start": [r.start for r in runs for _ in bands[r.file]["time_s"]],
            **{name: np.concatenate([bands[r.file][name] for r in runs]) for name in bands[first.file]},
        },
    )


def _distinct(
    runs: Sequence[SimulatedRun], bands: Mapping[str, Mapping[str, Floats]]
) -> list[list[SimulatedRun]]:
    """Runs by their course: drawn over each other, two that are alike had the colour of neither."""

    def alike(one: SimulatedRun, other: SimulatedRun) -> bool:
        for channel in one.units:
            a, b = (_shown(r, channel, bands[r.file], "q50") for r in (one, other))
            low, high = (_shown(one, channel, bands[one.file], q) for q in ("pred_q05", "pred_q95"))
            if not np.all((np.abs(a - b) <= SAME_COURSE * (high - low)) | (np.isnan(a) & np.isnan(b))):
                return False
        return True

    courses: list[list[SimulatedRun]] = []
    for run in runs:
        same = next((c for c in courses if alike(c[0], run)), None)
        if same is None:
            courses.append([run])
        else:
            same.append(run)
    return courses


def _draw(ax: Any, run: SimulatedRun, channel: str, band: Mapping[str, Floats]) -> None:
    """Median and bands of a channel from one start."""
    time, colour = band["time_s"], LOOKS[run.start]
    at = {q: _shown(run, channel, band, q) for q in ("q05", "q50", "q95", "pred_q05", "pred_q95")}
    finite = {q: np.where(np.isfinite(v), v, np.nan) for q, v in at.items()}
    ax.fill_between(time, finite["pred_q05"], finite["pred_q95"], color=colour, alpha=0.15, linewidth=0.0)
    ax.fill_between(time, finite["q05"], finite["q95"], color=colour, alpha=0.35, linewidth=0.0)
    ax.plot(time, finite["q50"], color=colour, linestyle=DASHES[run.start], linewidth=1.0)


def _shown(run: SimulatedRun, channel: str, band: Mapping[str, Floats], quantile: str) -> Floats:
    """A quantile of a channel in its declared unit."""
    unit = run.units[channel]
    return convert(band[f"{channel}_{quantile} [{unit}]"], unit, run.declared_units.get(channel, unit))


def _limit(ax: Any, bands: list[tuple[Mapping[str, Floats], SimulatedRun]], channel: str) -> None:
    """Keep an axis to where the median goes, as a slope may have bands without end, at some instants of either sign.

    Where a stiffness is told at some instants, to within its own size, only these count.
    """
    middle = np.concatenate([_shown(r, channel, b, "q50") for b, r in bands])
    lower, upper = (
        np.concatenate([_shown(r, channel, b, q) for b, r in bands]) for q in ("pred_q05", "pred_q95")
    )
    if channel == "stiffness":
        told = upper - lower < 2.0 * np.abs(middle)
        if np.mean(told) >= LEAST_SHARE_TOLD:
            middle, lower, upper = middle[told], lower[told], upper[told]
    edges = np.concatenate([lower, upper])
    middle, edges, lower = (v[np.isfinite(v)] for v in (middle, edges, lower))
    if not middle.size or not edges.size:
        return
    low, high = np.quantile(middle, (0.01, 0.99))
    room = max(3.0 * (high - low), 0.5 * abs(high + low), 1e-12)
    least, most = max(edges.min(), low - room), min(edges.max(), high + room)
    pad = 0.06 * (most - least)
    positive = (
        channel == "stiffness" and middle.min() > 0.0 and np.mean(lower < 0.0) < NEGATIVE_STIFFNESS_SHARE
    )
    ax.set_ylim(0.0 if positive and least < max(pad, 0.5 * most) else least - pad, most + pad)
