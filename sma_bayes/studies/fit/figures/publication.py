"""The figure of a condition for a paper: one column wide, panels stacked, fonts at their true size, no title."""

from __future__ import annotations

from collections.abc import Sequence

from sma_bayes.report.figures.sheet import (
    BranchData,
    Drawing,
    axis_label,
    empty_sheet,
    take_power,
    temperature_label,
)
from sma_bayes.studies.fit.figures.condition import (
    branch_on_axes,
    channels_of,
    limits,
    loop_data,
    loop_legend,
    points_on_axes,
)

PANEL_ASPECT = 0.62
"""Height of a panel over the width of the figure [1]."""
LEAST, WIDEST = 30.0, 1000.0
"""Width of a figure that is drawn [mm]."""


def publication_figure(condition: str, branches: Sequence[BranchData], width: float) -> Drawing:
    """Heating and cooling of a condition, a panel for each channel, one above the other.

    Of a branch that did not converge there are measurements alone.

    Parameters
    ----------
    condition : str
    branches : sequence of BranchData
    width : float
        [inch]
    """
    channels = channels_of(branches)
    figure = empty_sheet(width, width * (PANEL_ASPECT * len(channels) + 0.2))
    figure.set_layout_engine("constrained")
    axes = figure.subplots(len(channels), 1, sharex=True, squeeze=False)[:, 0]
    for ax, channel in zip(axes, channels, strict=True):
        for branch in branches:
            if branch.content.channel(channel.channel) is None:
                continue
            if branch.content.converged:
                branch_on_axes(ax, branch, channel.channel)
            elif channel.channel in branch.stored.observed:
                points_on_axes(ax, branch, channel.channel)
        limits(ax, channel.channel, branches, ("q05", "q95", "pred_q05", "pred_q95"))
        ax.set_ylabel(axis_label(channel, take_power(ax.yaxis)))
    figure.align_ylabels(axes)
    axes[-1].set_xlabel(temperature_label(branches[0].content))
    figure.legend(
        handles=loop_legend(branches, channels),
        loc="outside upper center",
        ncols=2,
        columnspacing=1.2,
        handlelength=1.6,
    )
    names = ", ".join(c.name for c in channels)
    return Drawing(
        stem=f"loop-{condition}",
        caption=(
            f"{condition}: {names} against temperature. Points: measurements; line: posterior median; inner and outer "
            "band: 50 % and 90 % credible intervals of the curve; dotted: 90 % predictive interval."
            + ("" if all(b.content.converged for b in branches) else " What did not converge has no curve.")
        ),
        alt=f"{names} against temperature for condition {condition}",
        figure=figure,
        data=loop_data(branches),
    )
