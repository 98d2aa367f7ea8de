"""Average correlation factors on an axis that shows 0.95 and 0.9999 alike."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from matplotlib.axes import Axes

from sma_bayes.report.content import PAPER_CORRELATION, AverageFactor, Content, Estimate
from sma_bayes.report.figures.sheet import (
    COLOURS,
    FAINT,
    INK,
    Drawing,
    as_columns,
    dot_handle,
    empty_sheet,
    label_width,
    panels,
)
from sma_bayes.report.notation import unit_label
from sma_bayes.studies.compare.figures.models import drawn_order, look
from sma_bayes.studies.compare.outputs import StoredComparison
from sma_bayes.studies.compare.tables import model_averages, short

NEAREST: Final = 1e-9
"""How near to 1 a correlation is drawn at most."""
TICKS: Final = (-1.0, 0.0, 0.5, 0.9, 0.95, 0.99, 0.999, 0.9999, 0.99999, 0.999999)
BOTH: Final = {**COLOURS, "both": INK}
"""Colours of the branches and of both together."""


@dataclass(frozen=True, slots=True)
class Mark:
    """An estimate of r at a place of the vertical axis.

    Attributes
    ----------
    place : float
    estimate : Estimate
    colour : str
    hollow : bool
    """

    place: float
    estimate: Estimate
    colour: str
    hollow: bool = False


def average_figure(content: Content) -> Drawing:
    """Average correlation factor of each channel by branch and rule, with its interval.

    Parameters
    ----------
    content : Content
    """
    channels = list(dict.fromkeys((a.channel, a.name, a.unit) for a in content.averages))
    labels = list(dict.fromkeys((a.branch, a.rule) for a in content.averages))
    names = [f"{branch}, {rule}" for branch, rule in labels]
    left = label_width(names)
    figure = empty_sheet(left + max(2.7 * len(channels), 4.5) + 0.15, 1.15 + 0.24 * len(names))
    axes = panels(figure, 1, len(channels), left=left, right=0.15, bottom=0.75, top=0.35, gap_x=0.25)[0]
    for ax, (channel, name, unit) in zip(axes, channels, strict=True):
        marks = [
            Mark(
                labels.index((a.branch, a.rule)) + (-0.15 if a.data == "measured" else 0.18),
                a.factors["r"],
                BOTH[a.branch] if a.data == "measured" else FAINT,
            )
            for a in content.averages
            if (a.channel, a.name, a.unit) == (channel, name, unit)
        ]
        correlation_axis(ax, marks)
        row_names(ax, names, labelled=ax is axes[0])
        ax.set_title(f"average r of {name}")
        _tell_apart(ax, (name, unit), [c[1:] for c in channels])
    figure.legend(
        handles=[
            *(dot_handle(colour, f"{branch}, measured data") for branch, colour in BOTH.items()),
            dot_handle(FAINT, "replicated data"),
        ],
        loc="lower center", ncols=4, borderaxespad=0.1, columnspacing=1.0,
    )  # fmt: skip
    return Drawing(
        stem="correlation-average",
        caption=(
            "Average correlation factor r over the records that converged: posterior median and equal-tailed 90 % "
            "credible interval by branch and averaging rule, for the measured data and for data replicated from the "
            f"posterior. The axis is logarithmic in 1 − r; dashed: the {PAPER_CORRELATION:g} that the paper states."
        ),
        alt="average correlation factors by channel, branch and averaging rule, beside 0.95",
        figure=figure,
        data=average_columns(content.averages),
    )


def _tell_apart(ax: Axes, channel: tuple[str, str], channels: Sequence[tuple[str, str]]) -> None:
    """Name the unit of a channel that was measured in several."""
    name, unit = channel
    if [n for n, _ in channels].count(name) > 1:
        ax.set_xlabel(f"r [1], {name} in {unit_label(unit)}")


def correlation_axis(ax: Axes, marks: Sequence[Mark]) -> None:
    """Draw correlation factors against an axis that is logarithmic in 1 − r, with the paper's value."""
    seen = [PAPER_CORRELATION]
    for m in marks:
        e = m.estimate
        if e.median is None or e.q05 is None or e.q95 is None:
            continue
        low, mid, high = (max(1.0 - v, NEAREST) for v in (e.q05, e.median, e.q95))
        ax.plot([low, high], [m.place] * 2, color=m.colour, lw=1.3, solid_capstyle="butt")
        face = "white" if m.hollow else m.colour
        ax.plot([mid], [m.place], marker="o", ms=3.6, mfc=face, mec=m.colour, mew=0.9, ls="none")
        seen += [e.q05, e.q95]
    ax.axvline(1.0 - PAPER_CORRELATION, color=INK, lw=0.8, ls="--", zorder=0)
    far, near = max(1.0 - v for v in seen), max(min(1.0 - v for v in seen), NEAREST)
    ax.set_xscale("log")
    ax.set_xlim(far * 1.6, near / 1.6)
    shown = [t for t in TICKS if near / 1.6 <= 1.0 - t <= far * 1.6]
    ax.set_xticks([1.0 - t for t in shown], [f"{t:.10g}" for t in shown])
    ax.minorticks_off()
    ax.set_xlabel("r [1]")


def row_names(ax: Axes, names: Sequence[str], *, labelled: bool) -> None:
    """Name the rows of a list, every other one shaded."""
    ax.set_ylim(len(names) - 0.4, -0.6)
    ax.set_yticks(range(len(names)), list(names) if labelled else [""] * len(names))
    ax.yaxis.set_tick_params(length=0)
    for place in range(1, len(names), 2):
        ax.axhspan(place - 0.5, place + 0.5, color="#f4f5f6", lw=0, zorder=-1)


def average_columns(averages: Sequence[AverageFactor]) -> Mapping[str, Any]:
    """Average factors as columns of a file."""
    rows = [
        (a.channel, a.unit, a.branch, a.data, a.rule, len(a.records), e.q05, e.median, e.q95, a.above)
        for a in averages
        for e in (a.factors["r"],)
    ]
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


def model_average_figure(stored: StoredComparison) -> Drawing:
    """Average correlation factor of each model over all records of a channel, in sample and held out.

    Parameters
    ----------
    stored : StoredComparison
    """
    found = [(name, a) for name, a in model_averages(stored) if a.rule == "plain"]
    channels = list(dict.fromkeys((a.name, a.unit) for _, a in found))
    models = drawn_order(dict.fromkeys(name for name, _ in found))
    left = label_width(short(n) for n in models)
    figure = empty_sheet(left + max(2.7 * len(channels), 4.5) + 0.15, 1.15 + 0.26 * len(models))
    axes = panels(figure, 1, len(channels), left=left, right=0.15, bottom=0.75, top=0.35, gap_x=0.25)[0]
    for ax, channel in zip(axes, channels, strict=True):
        marks = [
            Mark(
                models.index(name) + (-0.16 if a.data == "in sample" else 0.16),
                a.factors["r"],
                look(name)[0],
                a.data == "in sample",
            )
            for name, a in found
            if (a.name, a.unit) == channel
        ]
        correlation_axis(ax, marks)
        row_names(ax, [short(n) for n in models], labelled=ax is axes[0])
        ax.set_title(f"average r of {channel[0]}")
        _tell_apart(ax, channel, channels)
    figure.legend(
        handles=[dot_handle("#555555", "in sample", hollow=True), dot_handle("#555555", "held out")],
        loc="lower center", ncols=2, borderaxespad=0.1,
    )  # fmt: skip
    columns = average_columns([a for _, a in found])
    return Drawing(
        stem="correlation-average",
        caption=(
            "Plain mean of r over the records of a channel: posterior median and equal-tailed 90 % credible interval, "
            "of the data to which the models were fitted and of what was held out. The axis is logarithmic in 1 − r; "
            f"dashed: the {PAPER_CORRELATION:g} that the paper states of its model."
        ),
        alt="average correlation factors of the models, in sample and held out, beside 0.95",
        figure=figure,
        data={"model": [name for name, _ in found], **columns},
    )
