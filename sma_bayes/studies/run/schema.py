"""What `study.json` holds."""

from __future__ import annotations

from typing import Final, Literal

from pydantic import Field

from sma_bayes.runs.schema import DocumentPart, Items, Number, StudyFindings


class StatedStep(DocumentPart):
    """A step of a study."""

    step: str = Field(description="verb of the step, such as `fit`; `ask 1` and so on")
    summary: str | None = Field(
        description="its JSON file, below the folder of the study; null where it failed"
    )
    schema_: str | None = Field(alias="schema", description="schema of that file; null where it failed")
    told: str | None = Field(description="what was found, in a few words; null where it failed")
    error: str | None = Field(description="the message where it failed; else null")
    status: str = Field(description="`done`, `not converged`, `not adequate`, `alarm`, `failed` or `skipped`")
    exit_status: int = Field(description="0, 1 or 2, as on the command line")
    wall_s: Number = Field(description="time that it took [s]")


class StudyDocument(StudyFindings):
    """What `study.json` holds; it is written anew after each step."""

    schema_: Literal["sma-bayes/study/1"] = Field(alias="schema", description="name and version")
    study: str = Field(description="the study file")
    out: str = Field(default="", description="folder of the results")
    finished: bool = Field(description="whether all steps have been run")
    converged: bool = Field(description="whether all are done and converged")
    exit_status: int = Field(description="the worst of their statuses")
    steps: Items[StatedStep] = Field(description="one for each step, in order")
    wall_s: Number = Field(description="time that went by [s]")
    content_sha256: str = Field(
        default="", description="checksum of all else in the document, which every reader compares"
    )


DOCUMENTS: Final = {"run": StudyDocument}
