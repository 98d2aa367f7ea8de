"""The steps of a study on the screen."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from sma_bayes.studies.run.schema import StudyDocument


def study_text(found: Mapping[str, Any]) -> str:
    """The steps of a study, a line each."""
    document = StudyDocument.model_validate(found)
    lines = [f"{document.campaign}, seed {document.seed}"]
    width = max(len(r.step) for r in document.steps)
    for r in document.steps:
        told = r.told or (r.error or "").replace("\n", "\n" + " " * (width + 19))
        lines.append(f"  {r.step:<{width}}  {r.status:<13}  {told}")
    return "\n".join(lines)


def failures(found: Mapping[str, Any]) -> list[str]:
    """What went wrong, a message for each step that failed: all that is told of a study that is to be quiet."""
    steps = StudyDocument.model_validate(found).steps
    return [f"error: {r.step}: {r.error}" for r in steps if r.status == "failed"]
