"""Typed documents: what a verb found, and the parts that several of them have; see `sma_bayes.document_part`."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final, TypeVar

from pydantic import Field
from pydantic.json_schema import GenerateJsonSchema

from sma_bayes.arrays import Floats
from sma_bayes.checksum import numbers_checksum
from sma_bayes.document_part import (
    DocumentPart as DocumentPart,
    IntervalDocument as IntervalDocument,
    InUnit as InUnit,
    Items as Items,
    Number as Number,
    NumberOrNull as NumberOrNull,
    UnitOfQuantity as UnitOfQuantity,
)
from sma_bayes.fitting.curves import interval_where_defined
from sma_bayes.runs.documents import Document

DIALECT: Final = "https://json-schema.org/draft/2020-12/schema"

M = TypeVar("M", bound=DocumentPart)


def read_document(document: Document, model: type[M], folder: Path) -> M:
    """What a finished run found, typed.

    Raises
    ------
    OutputError
        If the run is not finished, or its document can't be read, was changed or is of another version.
    """
    return model.read_as(
        document.read(folder), folder / document.file, document.as_declared, document.in_another_folder
    )


class _WithoutTitles(GenerateJsonSchema):
    """Schemas whose keys have no title beside their description."""

    def field_title_should_be_set(self, schema: Any) -> bool:
        return False


def json_schema(model: type[DocumentPart]) -> dict[str, Any]:
    """JSON Schema of a document, by which a program in any language can check it."""
    return {"$schema": DIALECT, **model.model_json_schema(by_alias=True, schema_generator=_WithoutTitles)}


class Workers(DocumentPart):
    """Who did the tasks."""

    where: str = Field(description="where tasks were done, in words")
    lost: Items[str] = Field(
        description="what is known of each worker that came to an end in the middle of a task, which was done again"
    )


class RunAccount(DocumentPart):
    """What a run took; it stands at the end of a document."""

    figures: str = Field(description="which figures were drawn: `report`, `all` or `none`")
    stages_s: dict[str, Number] = Field(
        description="time by the clock of each stage, added up over tasks that ran side by side [s]"
    )
    stages_cpu_s: dict[str, Number] = Field(description="the same of the processor [s]")
    workers: Workers = Field(description="where tasks were done, and which workers were lost")
    wall_s: Number = Field(description="time that went by [s]")
    content_sha256: str = Field(
        default="", description="checksum of all else in the document, which every reader compares"
    )

    @property
    def numbers_sha256(self) -> str:
        """Checksum of what was found: the same where it was found again, by a run that was resumed."""
        return numbers_checksum(self.model_dump(mode="json", by_alias=True))


class FilesBeside(DocumentPart):
    """What lies beside a document."""

    files_sha256: dict[str, str] = Field(
        default_factory=dict,
        description="SHA-256 of each CSV of results beside the document, by its path; a file that differs is refused",
    )


class DeclaredUnits(DocumentPart):
    """In which units people see the numbers of a document."""

    declared_units: dict[str, str] = Field(
        default_factory=dict,
        description="by quantity or setting: the unit in which the measurements declare it, and in which terminal, "
        "page, tables and figures show it; what is missing is shown as it stands here. A load in g is a mass",
    )
    declared_differently: Items[str] = Field(
        default=(),
        description="sentences: what conditions declare in several units, and which of them is shown",
    )


class StudyFindings(DocumentPart):
    """What every study says of where its numbers come from."""

    campaign: str = Field(description="name of the campaign")
    source: str = Field(
        description="folder or file of the measurements, or folder of the fit that was studied"
    )
    seed: int = Field(description="decides every draw")
    versions: dict[str, str] = Field(description="versions of Python and of packages, by name")
    data_sha256: str | None = Field(description="SHA-256 of the measurements; null of a fit in memory")


class FindingDocument(DocumentPart):
    """What was found about the measurements."""

    kind: str = Field(description="name of what was found, such as `clipped`")
    message: str = Field(description="the same in a sentence")
    file: str = Field(description="name of the data file; empty, as what follows, where it is not known")
    rows: Items[int] = Field(description="its first rows that are concerned")
    count: int = Field(description="how many rows are concerned")
    dropped: int = Field(description="how many of them were kept out")
    condition: str = Field(description="id of the condition")
    branch: str = Field(description="`heating` or `cooling`")
    column: str = Field(description="column of the data file")
    severity: str = Field(
        description="`serious`: numbers may be other than they seem; `look`: an assumption to confirm; `note`"
    )


def interval_document(draws: Floats) -> IntervalDocument:
    """Median and 90 % interval of the draws that have a value."""
    return IntervalDocument(**interval_where_defined(draws))


class ModelChoiceDocument(DocumentPart):
    """Why a response model was taken (`--model auto`)."""

    name: str = Field(description="name of the model")
    reason: str = Field(description="one sentence")
    ln_evidence: dict[str, NumberOrNull] = Field(
        description="ln evidence by model that was looked at, less that of the chosen one [1]"
    )
    held_out: dict[str, NumberOrNull] = Field(
        description="root mean square by which each model misses samples held out, as a share of the range [1]"
    )


class Factor(IntervalDocument):
    """A correlation factor over draws of a curve."""

    undefined: Number = Field(description="share of the draws in which it is not defined [1]")


class CorrelationFactors(DocumentPart):
    """Correlation factors of curves with data."""

    r: Factor = Field(description="Pearson's r [1]")
    r2: Factor = Field(description="R² about the mean of the data [1]")
    adj_r2: Factor | None = Field(
        default=None, description="R² adjusted for the number of parameters [1]; not of what was held out"
    )
    rmse: InUnit[Factor] = Field(description="sqrt(sse/n) [unit of the channel]")


class AverageR(Factor):
    """An average of r."""

    above: NumberOrNull = Field(
        description="posterior probability that the average exceeds the threshold [1]"
    )


class CorrelationAverage(DocumentPart):
    """Averages of correlation factors over the records of a channel, by rule.

    The factors are missing where no record converged.
    """

    data: str | None = Field(default=None, description="of a fit: `measured` or `replicated`")
    channel: str = Field(description="the channel")
    quantity: str = Field(description="what it is called")
    unit: UnitOfQuantity = Field(description="its unit")
    branch: str = Field(description="the branch; empty for both")
    records: Items[str] = Field(description="keys of the records")
    left_out: Items[str] = Field(description="keys of those that did not converge")
    threshold: Number = Field(description="what the published model is said to reach, 0.95 [1]")
    n: int = Field(description="samples")
    draws: int = Field(description="draws")
    r: dict[str, AverageR] | None = Field(
        default=None, description="by rule: `plain`, `fisher`, `pooled` [1]"
    )
    r2: dict[str, Factor] | None = Field(default=None, description="by rule: `plain`, `pooled` [1]")
    adj_r2: dict[str, Factor] | None = Field(default=None, description="by rule: `plain`, `pooled` [1]")
    rmse: InUnit[dict[str, Factor] | None] = Field(
        default=None, description="by rule: `plain`, `pooled` [`unit`]"
    )
