"""Average correlation factors of a campaign, by branch and averaging rule."""

from __future__ import annotations

from typing import Final

from sma_bayes.report.content import PAPER_CORRELATION, AverageFactor, Content
from sma_bayes.report.figures.averages import Mark, average_columns, correlation_axis, tell_apart
from sma_bayes.report.figures.sheet import (
    COLOURS,
    FAINT,
    INK,
    Drawing,
    dot_handle,
    empty_sheet,
    label_width,
    name_rows,
    panels,
)

BOTH: Final = {**COLOURS, "both": INK}
"""Colours of the branches and of both together."""


def _shown_channel(a: AverageFactor) -> tuple[str, str, str]:
    return a.document.channel, a.document.quantity, a.document.unit


def average_figure(content: Content) -> Drawing:
    """Average correlation factor of each channel by branch and rule, with its interval."""
    channels = list(dict.fromkeys(map(_shown_channel, content.averages)))
    labels = list(dict.fromkeys((a.branch, a.rule) for a in content.averages))
    names = [f"{branch}, {rule}" for branch, rule in labels]
    left = label_width(names)
    figure = empty_sheet(left + max(2.7 * len(channels), 4.5) + 0.15, 1.15 + 0.24 * len(names))
    axes = panels(figure, 1, len(channels), left=left, bottom=0.75, top=0.35, gap_x=0.25)[0]
    for ax, (channel, name, unit) in zip(axes, channels, strict=True):
        marks = [
            Mark(
                labels.index((a.branch, a.rule)) + (-0.15 if a.data == "measured" else 0.18),
                a.factors["r"],
                BOTH[a.branch] if a.data == "measured" else FAINT,
            )
            for a in content.averages
            if _shown_channel(a) == (channel, name, unit)
        ]
        correlation_axis(ax, marks, beside_paper=bool(content.printed))
        name_rows(ax, names, labelled=ax is axes[0])
        ax.set_title(f"average r of {name}")
        tell_apart(ax, (name, unit), [c[1:] for c in channels])
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
            "posterior. The axis is logarithmic in 1 − r"
            + (f"; dashed: the {PAPER_CORRELATION:g} that the paper states." if content.printed else ".")
        ),
        alt="average correlation factors by channel, branch and averaging rule",
        figure=figure,
        data=average_columns(content.averages),
    )
