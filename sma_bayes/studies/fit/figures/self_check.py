"""Figure of the self-check of a record: ranks of the truths, and how far uniform ones may stray."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from sma_bayes.assess.rank_uniformity import band_half_width
from sma_bayes.report.figures.sheet import FAINT, INK, WARNING, Drawing, empty_sheet, heading, panels
from sma_bayes.runs.fit_document import RecordSummary, SelfCheckSummary
from sma_bayes.studies.fit.self_check import read_places


def self_check_figure(folder: Path, record: RecordSummary, check: SelfCheckSummary) -> Drawing:
    """Empirical distribution of the ranks of each number, less the uniform one, in a band for all of them at once.

    Parameters
    ----------
    folder : Path
        Of the run.
    record : RecordSummary
    check : SelfCheckSummary
        Its self-check.
    """
    names, u = read_places(folder, record.key)
    n, wrong = len(u), {q.name for q in check.quantities if not q.uniform}
    half = band_half_width(n, len(names), check.false_alarm_rate)
    figure = empty_sheet(5.6, 3.0)
    ax = panels(figure, 1, 1, left=0.62, bottom=0.72, top=0.42)[0][0]
    ax.axhspan(-half, half, color="#e3e3e3", lw=0)
    ax.axhline(0.0, color=INK, lw=0.6)
    grid = np.linspace(0.0, 1.0, 201)
    differences = {}
    for name, column in zip(names, u.T, strict=True):
        share = np.searchsorted(np.sort(column), grid, side="right") / n
        differences[name] = share - grid
        off = name in wrong
        ax.plot(
            grid,
            share - grid,
            color=WARNING if off else INK,
            lw=1.4 if off else 0.6,
            alpha=1.0 if off else 0.5,
        )
    reach = 1.25 * max(half, *(float(np.abs(d).max()) for d in differences.values()))
    ax.set_xlim(0.0, 1.0)
    ax.set_ylim(-reach, reach)
    ax.set_xlabel("rank of the truth among the draws of its refit, as a share [1]")
    ax.set_ylabel("share below, less expected [1]")
    handles = [
        Line2D([], [], color=INK, lw=0.8, alpha=0.6, label="a number of the record"),
        *([Line2D([], [], color=WARNING, lw=1.4, label=", ".join(sorted(wrong)[:3]))] if wrong else []),
        Patch(color="#e3e3e3", lw=0, label=f"{100 * (1 - check.false_alarm_rate):g} % of uniform ranks, all at once"),
    ]  # fmt: skip
    figure.legend(handles=handles, loc="lower center", ncols=len(handles), borderaxespad=0.1)
    heading(figure, f"Self-check of {record.key}", "" if check.passed else "NOT UNIFORM")
    if not wrong:
        ax.spines["bottom"].set_color(FAINT)
    return Drawing(
        stem=f"self-check-{record.key}",
        caption=(
            f"Ranks of {n} known truths of {record.key} among the draws of their refits: empirical distribution of "
            "each number less the uniform one. An S about zero is a spread that is too narrow or too wide, a "
            "bow a shift."
        ),
        alt="deviation of the distribution of ranks from the uniform one, for each number, with a simultaneous band",
        figure=figure,
        data={"rank": grid, **differences},
    )
