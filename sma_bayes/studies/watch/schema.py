"""What `watch.json` and `state.json` hold."""

from __future__ import annotations

from typing import Annotated, Final, Literal

from pydantic import Field

from sma_bayes.document_part import InUnit, Temperature, TemperatureUnit, UnitOf
from sma_bayes.runs.finished_run import FinishedRun
from sma_bayes.runs.schema import (
    DeclaredUnits,
    DocumentPart,
    FilesBeside,
    IntervalDocument,
    Items,
    Number,
    NumberOrNull,
    RunAccount,
)
from sma_bayes.studies.cycles.schema import channel_of_value
from sma_bayes.studies.watch.state import ReadFile, WatchState


class WatchedNumber(DocumentPart):
    """One number of the sweeps of a branch and channel; lists go along the fitted cycles and then the watched ones."""

    branch: str = Field(description="`heating` or `cooling`")
    channel: str = Field(description="the channel")
    number: str = Field(
        description="`offset` (level halfway), `stroke`, `shift` (against the common curve), `width` (over that of the "
        "common curve), `noise` (root mean square of what these leave)"
    )
    unit: Annotated[str, UnitOf(lambda n: channel_of_value(n.number, n.channel), difference=True)] = Field(
        description="its unit"
    )
    value: InUnit[Items[Number]] = Field(description="of each sweep [`unit`]")
    normal_low: InUnit[Items[NumberOrNull]] = Field(
        description="2.5 % quantile of the value that a sweep has while nothing changes [`unit`]; null where the "
        "scatter is not known"
    )
    normal_high: InUnit[Items[NumberOrNull]] = Field(description="97.5 % quantile of it [`unit`]")
    log10_e: Items[Number] = Field(description="after each watched cycle, log10 of its own e-process")
    alarm: bool = Field(description="whether its e-process has exceeded the number of all of them over alpha")


class WatchedCause(DocumentPart):
    """Numbers together that a cause moves, weighed by what it does to each and by what sweeps usually scatter."""

    id: str = Field(description="name of the cause")
    title: str = Field(description="in words")
    of: str = Field(description="`sensor`, `specimen` or `either`")
    log10_e: Items[Number] = Field(description="after each watched cycle, log10 of its own e-process")
    alarm: bool = Field(description="whether its e-process has exceeded the number of all of them over alpha")


class OnsetDocument(DocumentPart):
    """When a change began, in watched cycles."""

    low: int = Field(description="5 % quantile")
    median: int = Field(description="median")
    high: int = Field(description="95 % quantile")
    shape: str = Field(description="`step` or `ramp`, the more probable one")


class AlarmDocument(DocumentPart):
    """The first cycle with which the evidence was enough."""

    cycle: int = Field(description="watched cycle, from 1")
    file: str = Field(description="its file")
    numbers: Items[str] = Field(description="numbers whose own e-process was enough, by then or later")
    causes: Items[str] = Field(
        default=(), description="causes of `together` whose own e-process was enough, by then or later"
    )
    onset: OnsetDocument = Field(description="when the change of the clearest of them began")


class AmountDocument(IntervalDocument):
    """How much, at the last cycle, with a 90 % interval."""

    name: str = Field(description="`offset`, `gain`, `stroke`, `shift`, `change` or `width`")
    unit: Annotated[
        str, UnitOf(lambda a: "displacement" if (a.name, a.unit) == ("offset", "1") else None)
    ] = Field(description="its unit; of gain, stroke and width the change of the logarithm, 1")


class CauseDocument(DocumentPart):
    """What may have changed."""

    id: str = Field(description="its name; two that are needed together are joined by `+`")
    title: str = Field(description="in words")
    of: str = Field(description="`sensor`, `specimen` or `either`")
    effects: Items[str] = Field(description="effects in the catalogue of `gap` that say the same, if any")
    share: Number = Field(description="share of the change that it carries [1]")
    p_value: Number = Field(description="probability that scatter alone leaves as much [1]")
    amounts: Items[AmountDocument] = Field(description="how much")


class ChangeDocument(DocumentPart):
    """What has changed."""

    verdict: Literal["none", "named", "unnamed"] = Field(
        description="`none` without alarm; `unnamed`: no cause of the list accounts for it"
    )
    causes: Items[CauseDocument] = Field(
        description="causes that these cycles can't tell apart, the best one first; each may be the whole change"
    )
    statement: str = Field(description="one sentence")


class LimitDocument(DocumentPart):
    """Cycles that remain until a limit."""

    limit: str = Field(description="as it was asked")
    branch: str = Field(description="`heating` or `cooling`")
    channel: str = Field(description="the channel")
    quantity: str = Field(description="quantity that the limit is of")
    at: Temperature[NumberOrNull] = Field(
        description="temperature [unit of temperature]; null where it is of the whole sweep"
    )
    unit: Annotated[
        str,
        UnitOf(lambda r: channel_of_value(r.quantity, r.channel), difference=lambda r: r.quantity == "shift"),
    ] = Field(description="its unit")
    fitted: InUnit[Number] = Field(description="value of the fitted cycles [`unit`]")
    now: InUnit[IntervalDocument] = Field(description="value at the last cycle [`unit`]")
    target: InUnit[Number] = Field(description="the limit [`unit`]")
    remaining: IntervalDocument = Field(description="cycles that remain; null beyond the horizon")
    probability: Number = Field(description="that it is reached within the horizon [1]")
    horizon: int = Field(description="cycles that were looked ahead")
    statement: str = Field(description="one sentence")


class WatchedCycle(DocumentPart):
    """One watched cycle."""

    cycle: int = Field(description="watched cycle, from 1")
    file: str = Field(description="its file")
    cycle_in_file: Number = Field(description="its number there")
    log10_e: Number = Field(
        description="log10 of the greatest e-process of all numbers and of those together, over how many there "
        "are; the alarm is at log10 of one over alpha"
    )


class VerdictFindings(DocumentPart):
    """Whether a spring is still the one that was fitted, by all cycles that count."""

    verdict: Literal["same", "changed"] = Field(
        description="`changed` after an alarm, for good; `same`: no evidence of a change so far"
    )
    statement: str = Field(description="one sentence")
    p_value: Number = Field(
        description="probability of as much evidence, ever, while nothing changes, at most [1]"
    )
    fitted: Items[Number] = Field(description="cycles that were fitted")
    law: str = Field(description="law of training that counts as no change, or `none`")
    cycles: Items[WatchedCycle] = Field(description="watched cycles that count")
    numbers: Items[WatchedNumber] = Field(description="what is watched")
    together: Items[WatchedCause] = Field(
        default=(), description="numbers that are watched together, by what would move them"
    )
    alarm: AlarmDocument | None = Field(description="null while there is none")
    change: ChangeDocument = Field(description="what has changed")


class WatchFindings(DeclaredUnits, VerdictFindings):
    """What a watch found."""

    schema_: Literal["sma-bayes/watch/1"] = Field(alias="schema", description="name and version")
    campaign: str = Field(description="name of the campaign")
    fit: str = Field(description="folder of the fit")
    condition: str = Field(description="id of the condition")
    seed: int = Field(description="decides the draws of cycles that remain")
    alpha: Number = Field(description="probability of an alarm, ever, while nothing changes, at most [1]")
    temperature_unit: TemperatureUnit = Field(description="unit of temperatures")
    specimen: bool = Field(
        description="whether stress, strain and modulus stand for force, displacement and stiffness"
    )
    versions: dict[str, str] = Field(description="of what computed it")
    converged: bool = Field(
        description="whether the fit did, and the common curves of its sweeps have settled"
    )
    asked: Items[str] = Field(default=(), description="limits as they were asked")
    declared_in: str = Field(
        default="", description="campaign file by which new files are read; empty where it is that of the fit"
    )
    limits: Items[LimitDocument] = Field(description="one for each branch and channel with the quantity")
    files: Items[ReadFile] = Field(description="files that were read, in their order")
    partial: Items[str] = Field(description="cycles that were not whole when they were last read, in words")
    remarks: Items[str] = Field(description="what can't be told, and what was seen")
    exit_status: int = Field(description="0; 1 after an alarm, or where the fit has not converged")


class WatchDocument(RunAccount, FilesBeside, WatchFindings):
    """What `sma-bayes watch` writes: `watch.json`."""


StoredWatch = FinishedRun[WatchDocument]
"""A watch, as its folder holds it."""
DOCUMENTS: Final = {"watch": WatchDocument, "watch-state": WatchState}
