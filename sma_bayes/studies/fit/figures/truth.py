"""Figure of a fit of simulated measurements beside the truth."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from sma_bayes.report.content import KnownTruth
from sma_bayes.report.figures.sheet import (
    COLOURS,
    FAINT,
    INK,
    BranchData,
    Drawing,
    as_columns,
    axis_label,
    empty_sheet,
    panels,
    take_power,
    temperature_label,
)
from sma_bayes.studies.fit.figures.condition import branch_on_axes, channels_of, limits


def truth_figure(known: Sequence[KnownTruth], conditions: Mapping[str, Sequence[BranchData]]) -> Drawing:
    """Bands of every channel and condition with the true curve on top.

    Parameters
    ----------
    known : sequence of KnownTruth
    conditions : mapping of str to sequence of BranchData
        With the same units in all records.
    """
    channels = channels_of([b for branches in conditions.values() for b in branches])
    figure = empty_sheet(0.75 + 2.45 * len(conditions), 0.9 + 1.9 * len(channels))
    axes = panels(
        figure,
        len(channels),
        len(conditions),
        left=0.7,
        right=0.1,
        bottom=0.8,
        top=0.3,
        gap_x=0.45,
        gap_y=0.2,
    )
    for row, channel in enumerate(channels):
        for column, (condition, branches) in enumerate(conditions.items()):
            ax = axes[row, column]
            for branch in branches:
                branch_on_axes(ax, branch, channel.channel, small=True)
            for k in known:
                if (k.condition, k.channel) == (condition, channel.channel):
                    ax.plot(k.temperature, k.curve, color=INK, lw=0.9, ls=(0, (3, 2)), zorder=5)
            limits(ax, channel.channel, branches, ("q05", "q95"))
            power = take_power(ax.yaxis)
            if column == 0:
                ax.set_ylabel(axis_label(channel, power))
            if row == 0:
                ax.set_title(condition, fontsize=7.5)
            if row == len(channels) - 1:
                ax.set_xlabel(temperature_label(branches[0].content))
            else:
                ax.set_xticklabels([])
    figure.legend(
        handles=[
            *(Line2D([], [], color=c, label=f"{name}, median") for name, c in COLOURS.items()),
            Patch(color=FAINT, alpha=0.4, lw=0, label="90 % credible"),
            Line2D([], [], color=INK, lw=0.9, ls=(0, (3, 2)), label="truth"),
        ],
        loc="lower center",
        ncols=4,
        borderaxespad=0.15,
    )
    rows: list[tuple[Any, ...]] = [
        (k.condition, k.branch, k.name, k.unit, t, y)
        for k in known
        for t, y in zip(k.temperature, k.curve, strict=True)
    ]
    header = (
        "condition",
        "branch",
        "channel",
        "unit",
        f"temperature [{known[0].temperature_unit}]",
        "truth [unit]",
    )
    return Drawing(
        stem="truth",
        caption=(
            "Force, displacement and stiffness of the simulated spring: what it truly did at the temperature that it "
            "truly had (dashed), and what the fit says. Line: posterior median; inner and outer band: pointwise "
            "equal-tailed 50 % and 90 % credible intervals; points: measurements, at the temperature that was read."
        ),
        alt="true curves of the simulated spring on top of the credible bands, a panel for each channel and condition",
        figure=figure,
        data=as_columns(header, rows),
    )
