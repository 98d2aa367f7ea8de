"""Figures of a campaign of so many records that they can't be listed: how their numbers are distributed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from sma_bayes.arrays import Floats
from sma_bayes.report.content import PAPER_CORRELATION, Content, RecordContent, parameters_by_channel
from sma_bayes.report.figures.sheet import (
    COLOURS,
    INK,
    Drawing,
    as_columns,
    empty_sheet,
    in_units_of,
    numbered,
    panels,
    take_power,
    with_margin,
)
from sma_bayes.runs.fit_document import TARGET

BINS = 40
ACROSS = 4
"""Panels side by side."""


def diagnostics_of_many(content: Content) -> Drawing:
    """Worst R-hat and least effective sample size of each record, as histograms."""
    rows = [
        (r.key, r.branch, r.converged, getattr(r.worst_rhat, "rhat", None), getattr(r.least_ess, "ess", None))
        for r in content.records
    ]
    figure = empty_sheet(7.4, 2.7)
    rhat, ess = panels(figure, 1, 2, left=0.65, bottom=0.75, top=0.35, gap_x=0.65)[0]
    _histogram(rhat, [(row[1], row[3]) for row in rows], TARGET.rhat)
    _histogram(ess, [(row[1], row[4]) for row in rows], TARGET.ess)
    rhat.set_title(f"Worst R-hat, at most {TARGET.rhat}")
    rhat.set_xlabel("R-hat [1]")
    rhat.set_ylabel("records")
    ess.set_title(f"Least effective sample size, at least {TARGET.ess:.0f}")
    ess.set_xlabel("draws [1]")
    _legend(figure, content.records)
    return Drawing(
        stem="diagnostics",
        caption=(
            "Convergence of all records: each record's worst rank-normalised split R-hat across independent ensembles, "
            "and its least effective sample size, bulk or tail. Dashed: the target."
        ),
        alt="histograms of R-hat and effective sample size over all records, with the targets",
        figure=figure,
        data=as_columns(("record", "branch", "converged", "worst rhat [1]", "least ess [draws]"), rows),
    )


def correlation_of_many(content: Content) -> Drawing:
    """Median correlation factor of each record, as a histogram for each channel."""
    found = {
        c.name: [
            (r.key, r.branch, r.converged, c.name, own.measured["r"].median)
            for r in content.records
            for own in [r.channel(c.channel)]
            if own is not None and "r" in own.measured
        ]
        for c in content.channels
    }
    found = {name: rows for name, rows in found.items() if rows}
    figure = empty_sheet(0.8 + 3.3 * max(len(found), 1), 2.7)
    axes = panels(figure, 1, max(len(found), 1), left=0.65, bottom=0.75, top=0.35, gap_x=0.65)[0]
    for ax, (name, rows) in zip(axes, found.items(), strict=False):
        low = min(row[4] for row in rows if row[4] is not None)
        _histogram(ax, [(row[1], row[4]) for row in rows], PAPER_CORRELATION if low < 0.985 else None)
        ax.set_title(f"r of {name}")
        ax.set_xlabel("median of r [1]")
        ax.set_ylabel("records")
    _legend(figure, content.records)
    rows = [row for part in found.values() for row in part]
    return Drawing(
        stem="correlation",
        caption=(
            "Correlation factor r of all records with the measured data: posterior medians. Dashed, where it is in "
            "sight: the average that the paper states, 0.95."
        ),
        alt="histograms of the correlation factor over all records, by channel",
        figure=figure,
        data=as_columns(("record", "branch", "converged", "channel", "r_median [1]"), rows),
    )


def parameters_of_many(content: Content, number: int = 1) -> Drawing:
    """Every parameter of the response over all records: medians in order, with their intervals.

    Parameters
    ----------
    content : Content
        With the same units in all records, see `Content.by_units`.
    number : int
        Which of the parts it is, for the name of the file.
    """
    names = [name for own in parameters_by_channel(content.records).values() for name in own]
    across = min(ACROSS, len(names))
    down = math.ceil(len(names) / across)
    figure = empty_sheet(0.5 + 2.0 * across, 0.6 + 1.9 * down)
    axes = panels(figure, down, across, left=0.5, right=0.1, bottom=0.6, top=0.3, gap_x=0.5, gap_y=0.55).flat
    rows: list[tuple[Any, ...]] = []
    for ax, name in zip(axes, names, strict=False):
        unit = ""
        for branch, colour in COLOURS.items():
            told = [
                (r.key, branch, r.converged, name, p.unit, p.estimate.q05, p.estimate.median, p.estimate.q95)
                for r in content.records
                if r.branch == branch
                for p in r.model_parameters
                if p.name == name
            ]
            rows += told
            unit = told[0][4] if told else unit
            _in_order(ax, np.array([row[5:] for row in told if row[2]], dtype=float), colour)
        ax.set_title(f"{name} [{in_units_of(take_power(ax.yaxis), unit)}]")
        ax.set_xlabel("share of records" if name in names[-across:] else "")
        ax.set_xlim(0.0, 1.0)
    for ax in list(axes)[len(names) :]:
        ax.remove()
    _legend(figure, content.records)
    header = (
        "record", "branch", "converged", "parameter", "unit", "q05 [unit]", "median [unit]", "q95 [unit]"
    )  # fmt: skip
    return Drawing(
        stem=numbered("parameters", number),
        caption=(
            "Parameters of the records that converged: posterior medians in increasing order, a line for each branch, "
            "with the equal-tailed 90 % credible interval of each record as shade."
        ),
        alt=f"sorted posterior medians of {', '.join(names)} over all records, with intervals",
        figure=figure,
        data=as_columns(header, rows),
    )


def _in_order(ax: Axes, estimates: Floats, colour: str) -> None:
    """Estimates (n, 3) of q05, median, q95, by increasing median."""
    if not len(estimates):
        return
    low, median, high = estimates[np.argsort(estimates[:, 1], kind="stable")].T
    share = (np.arange(median.size) + 0.5) / median.size
    ax.fill_between(share, low, high, color=colour, alpha=0.25, linewidth=0, rasterized=True)
    ax.plot(share, median, color=colour, lw=1.2)


def _histogram(ax: Axes, values: Sequence[tuple[str, float | None]], mark: float | None) -> None:
    known = [(branch, v) for branch, v in values if v is not None and math.isfinite(v)]
    if known:
        span = with_margin(min(v for _, v in known), max(v for _, v in known))
        edges = np.histogram_bin_edges([], BINS, range=span).tolist()
        parts = [[v for b, v in known if b == branch] for branch in COLOURS]
        ax.hist(parts, edges, stacked=True, color=list(COLOURS.values()))
    if mark is not None:
        ax.axvline(mark, color=INK, lw=0.8, ls="--")


def _legend(figure: Figure, records: Sequence[RecordContent]) -> None:
    seen = {r.branch for r in records}
    handles = [Patch(color=colour, label=branch) for branch, colour in COLOURS.items() if branch in seen]
    figure.legend(handles=handles, loc="lower center", ncols=2, borderaxespad=0.2)
