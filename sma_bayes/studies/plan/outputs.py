"""What an output folder of a plan holds, read back."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from sma_bayes.runs.documents import PLAN
from sma_bayes.runs.schema import read_document
from sma_bayes.studies.plan.schema import PlanDocument


@dataclass(frozen=True, slots=True, eq=False)
class StoredPlan:
    """A finished plan.

    Attributes
    ----------
    folder : Path
    found : PlanDocument
        What ``plan.json`` holds.
    """

    folder: Path
    found: PlanDocument


def read_plan(folder: Path) -> StoredPlan:
    """Read a plan.

    Raises
    ------
    OutputError
        If it is not finished, of another version, or can't be read.
    """
    return StoredPlan(folder, read_document(PLAN, PlanDocument, folder))
