"""A verb as a step of a study: what `run` has to know of it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field

from sma_bayes.records.toml_table import StrictTable
from sma_bayes.records.types import Record
from sma_bayes.runs.documents import Document

Figures = Literal["report", "all", "none"]
Texts = Annotated[tuple[str, ...], Field(strict=False)]


class DrawnTable(StrictTable):
    """Table of a step in a study file, whose figures may be others than ``[study]`` says.

    Attributes
    ----------
    paths : tuple of str
        Keys of files, which are relative to the folder of the study file.
    separate : bool
        Whether a fit that it reads must have parameters of its own for each condition.
    """

    paths: ClassVar[tuple[str, ...]] = ()
    separate: ClassVar[bool] = False
    figures: Figures | None = None

    @property
    def reads(self) -> str:
        """The step whose results it reads; empty where it reads the campaign, or files of its own."""
        return ""


class FromFitTable(DrawnTable):
    """A step that reads the results of ``[fit]``."""

    @property
    def reads(self) -> str:
        """The fit."""
        return "fit"


class StepTable(DrawnTable):
    """What a step on the records themselves may have otherwise than ``[study]`` says."""

    model: str | None = None
    priors: str | None = None
    pool: Literal["none", "campaign"] | None = None


Options = Mapping[str, Any]
Checks = Iterable[tuple[str, Callable[[], object]]]
"""Keys of a table, each with what raises where its value makes no sense."""


@dataclass(frozen=True, slots=True)
class StudyStep:
    """A verb as a step of a study.

    Attributes
    ----------
    table : type of DrawnTable
        Options that a study file may give.
    document : Document
        Of its results.
    call : callable
        Takes the campaign, or the folder of the step whose results it reads, or ``files`` where it has them and reads
        neither; `out`, `progress` and the options by name. Returns what the document holds.
    told : callable
        From that to what was found, in a few words.
    checks : callable
        From the options to what is checked before the campaign is read.
    questions : callable
        From the options and a record of the campaign to what is checked then.
    folder : str
        Of its results, where that is not called as the verb is.
    """

    table: type[DrawnTable]
    document: Document
    call: Callable[..., dict[str, Any]]
    told: Callable[[Mapping[str, Any]], str]
    checks: Callable[[Options], Checks] = lambda options: ()
    questions: Callable[[Options, Record], Checks] = lambda options, record: ()
    folder: str = ""


def temperatures(options: Options, check: Callable[[str], object]) -> Checks:
    """Checks of the temperatures ``at`` of a table."""
    for number, text in enumerate(options.get("at", ()), start=1):
        yield f"at, entry {number}", partial(check, text)
