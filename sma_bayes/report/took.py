"""What a run took, stage by stage, as a table."""

from __future__ import annotations

from typing import Final

from sma_bayes.account import Account
from sma_bayes.report.content import Number
from sma_bayes.report.tables import Column, Table
from sma_bayes.runs.schema import RunAccount

STAGES: Final = {
    "read": "reading the measurements",
    "warm_start": "least squares, choice of the noise model",
    "sample": "sampling, until the draws reach their target",
    "diagnose": "diagnostics, correlation factors, predictive checks",
    "bands": "credible bands",
    "study": "the study: fits, and what is judged of them",
    "hold_out": "choosing and predicting without a part of the measurements",
    "score": "scoring candidates on held-out measurements",
    "next_experiment": "what would separate rivals",
    "compare": "fitting all models, with folds held out",
    "sensitivity": "sensitivity, with sweeps left out",
    "write": "writing posteriors, bands and series",
    "figures": "drawing figures",
}
"""Stages in words, in the order of the table; the report itself can't say how long it took."""
LEAST_TIME_S: Final = 0.01
"""Time that counts [s]."""


def account_table(found: RunAccount, spent: Account) -> Table:
    """Stages of a run with their time.

    Parameters
    ----------
    found : RunAccount
    spent : Account
        On figures, where they have been drawn in the same run.
    """
    wall = {**found.stages_s, **spent.wall}
    cpu = {**found.stages_cpu_s, **spent.cpu}
    rows = tuple(
        (words, _seconds(wall[stage]), _seconds(cpu[stage]))
        for stage, words in STAGES.items()
        if stage in wall and stage in cpu
    )
    lost = found.workers.lost
    note = f"Tasks were done by {found.workers.where}; what ran side by side is added up. "
    if lost:
        note += (
            f"{len(lost)} came to an end in the middle ({'; '.join(lost)}), and their tasks were done again."
        )
    columns = (Column("stage", "stage"), Column("clock", "wall", "s"), Column("processor", "cpu", "s"))
    return Table("account", "What the run took", note.strip(), columns, rows)


def _seconds(value: float) -> Number:
    return Number(value, "s", max(0.1 * value, LEAST_TIME_S))
