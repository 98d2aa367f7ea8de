"""Average correlation factors on an axis that shows 0.95 and 0.9999 alike."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from matplotlib.axes import Axes

from sma_bayes.report.content import PAPER_CORRELATION, AverageFactor, Estimate
from sma_bayes.report.figures.sheet import INK, as_columns
from sma_bayes.report.notation import unit_label

LEAST_DISTANCE_FROM_ONE: Final = 1e-9
"""How near to 1 a correlation is drawn at most."""
TICKS: Final = (-1.0, 0.0, 0.5, 0.9, 0.95, 0.99, 0.999, 0.9999, 0.99999, 0.999999)

DIGIT_WIDTH: Final = 0.06
"""Width of a digit of a label [inch]."""


@dataclass(frozen=True, slots=True)
class Mark:
    """An estimate of r at a place of the vertical axis."""

    place: float
    estimate: Estimate
    colour: str
    hollow: bool = False


def tell_apart(ax: Axes, channel: tuple[str, str], channels: Sequence[tuple[str, str]]) -> None:
    """Name the unit of a channel that was measured in several."""
    name, unit = channel
    if [n for n, _ in channels].count(name) > 1:
        ax.set_xlabel(f"r [1], {name} in {unit_label(unit)}")


def correlation_axis(ax: Axes, marks: Sequence[Mark], *, beside_paper: bool = True) -> None:
    """Draw correlation factors against an axis that is logarithmic in 1 − r, beside the paper's value if wished."""
    seen = [PAPER_CORRELATION]
    for m in marks:
        e = m.estimate
        if e.median is None or e.q05 is None or e.q95 is None:
            continue
        low, mid, high = (max(1.0 - v, LEAST_DISTANCE_FROM_ONE) for v in (e.q05, e.median, e.q95))
        ax.plot([low, high], [m.place] * 2, color=m.colour, lw=1.3, solid_capstyle="butt")
        face = "white" if m.hollow else m.colour
        ax.plot([mid], [m.place], marker="o", ms=3.6, mfc=face, mec=m.colour, mew=0.9, ls="none")
        seen += [e.q05, e.q95]
    if beside_paper:
        ax.axvline(1.0 - PAPER_CORRELATION, color=INK, lw=0.8, ls="--", zorder=0)
    far, near = max(1.0 - v for v in seen), max(min(1.0 - v for v in seen), LEAST_DISTANCE_FROM_ONE)
    ax.set_xscale("log")
    ax.set_xlim(far * 1.6, near / 1.6)
    per_decade = ax.bbox.width / ax.figure.dpi / math.log10(2.56 * far / near)
    shown = apart([t for t in TICKS if near / 1.6 <= 1.0 - t <= far * 1.6], per_decade)
    ax.set_xticks([1.0 - t for t in shown], [f"{t:.10g}" for t in shown])
    ax.minorticks_off()
    ax.set_xlabel("r [1]")


def apart(ticks: Sequence[float], per_decade: float) -> list[float]:
    """Ticks whose labels do not touch, the first and every one far enough from the last; a decade is so wide [inch].

    Examples
    --------
    >>> apart([0.5, 0.9, 0.95, 0.99], 0.4)
    [0.5, 0.9, 0.99]
    """
    kept: list[float] = []
    for tick in ticks:
        if not kept or per_decade * math.log10((1.0 - kept[-1]) / (1.0 - tick)) >= room(kept[-1], tick):
            kept.append(tick)
    return kept


def room(*ticks: float) -> float:
    """Distance of two neighbouring labels at least [inch]."""
    return DIGIT_WIDTH * (1.0 + sum(len(f"{t:.10g}") for t in ticks) / 2.0)


def average_columns(averages: Sequence[AverageFactor]) -> Mapping[str, Any]:
    """Average factors as columns of a file."""
    rows = [
        (
            a.document.channel, a.document.unit, a.branch, a.data, a.rule, len(a.document.records),
            a.r.q05, a.r.median, a.r.q95, a.r.above,
        )
        for a in averages
    ]  # fmt: skip
    header = (
        "channel",
        "unit",
        "branch",
        "data",
        "rule",
        "records [1]",
        "r_q05 [1]",
        "r_median [1]",
        "r_q95 [1]",
    )
    return as_columns((*header, f"probability above {PAPER_CORRELATION:g} [1]"), rows)
