"""The steps of a study on the screen."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from sma_bayes.studies.run.schema import StudyDocument


def study_text(found: Mapping[str, Any]) -> str:
    """The steps of a study, a line each, and where their results are."""
    document = StudyDocument.model_validate(found)
    lines = [f"{document.campaign}, seed {document.seed}"]
    width = max(len(r.step) for r in document.steps)
    for r in document.steps:
        told = r.told or (r.error or "").replace("\n", "\n" + " " * (width + 19))
        lines.append(f"  {r.step:<{width}}  {r.status:<13}  {told}")
    lines.append(f"{document.wall_s:.1f} s; results in {document.out}{_places(document)}")
    return "\n".join(lines)


def _places(document: StudyDocument) -> str:
    """What a reader opens: the pages of the steps, and the files of those that have none."""
    places: dict[str, list[str]] = {"pages": [], "answers": []}
    for summary in (Path(r.summary) for r in document.steps if r.summary):
        page = summary.parent / "report.html"
        if (Path(document.out) / page).is_file():
            places["pages"].append(page.as_posix())
        else:
            places["answers"].append(summary.as_posix())
    return "".join(f"; {what}: {', '.join(files)}" for what, files in places.items() if files)


def failures(found: Mapping[str, Any]) -> list[str]:
    """What went wrong, a message for each step that failed: all that is told of a study that is to be quiet."""
    steps = StudyDocument.model_validate(found).steps
    return [f"error: {r.step}: {r.error}" for r in steps if r.status == "failed"]
