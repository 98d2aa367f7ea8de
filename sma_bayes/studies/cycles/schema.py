"""What `cycles.json` holds."""

from __future__ import annotations

from typing import Annotated, Final, Literal

from pydantic import Field

from sma_bayes.document_part import In, InUnit, Temperature, TemperatureUnit, UnitOf, UnitOfChannel
from sma_bayes.runs.finished_run import FinishedRun
from sma_bayes.runs.schema import (
    DeclaredUnits,
    DocumentPart,
    FilesBeside,
    FindingDocument,
    IntervalDocument,
    Items,
    Number,
    NumberOrNull,
    RunAccount,
    StudyFindings,
)

RATIO: Final = "width"
"""A number that is a ratio whatever the unit of the channel."""


def channel_of_value(name: str, channel: str) -> str:
    """Channel whose unit a number of a sweep is in; empty for a ratio."""
    return "" if name == RATIO else "stiffness" if name == "stiffness" else channel


class CyclesOptions(DocumentPart):
    """What was asked for."""

    model: str = Field(description="response model of the common curves, or `auto`")
    at: Items[str] = Field(description="temperatures at which channels and stiffness are told")
    share: Number = Field(description="greatest change per cycle of a stable curve [share of its stroke]")
    probability: Number = Field(description="with which it is to be stable [1]")
    ahead: int = Field(description="cycles that are forecast")


class CommonCurve(DocumentPart):
    """The curve that all sweeps of a channel and branch have in common, and what is left."""

    branch: str = Field(description="`heating` or `cooling`")
    channel: str = Field(description="the channel")
    unit: UnitOfChannel = Field(description="its unit")
    model: str = Field(description="name of its response model")
    parameters: dict[str, Number] = Field(description="least-squares estimates of the curve's parameters")
    midpoint: Temperature[Number] = Field(
        description="temperature at which the mean sweep is halfway [unit of temperature]"
    )
    level: InUnit[Number] = Field(description="its level there [`unit`]")
    span: InUnit[Number] = Field(
        description="stroke of the mean sweep between the ends of the measured temperatures [`unit`]"
    )
    noise: InUnit[Number] = Field(description="standard deviation of what curve and numbers leave [`unit`]")
    missed: Number = Field(description="the same over the range of the channel [1]")
    lag1_correlation: Number = Field(description="correlation of neighbouring samples in a sweep [1]")
    own_shape: Number = Field(
        description="root mean square over all sweeps of what each has of its own beside the common curve and its four "
        "numbers, over the range of the channel [1]"
    )
    reading_noise: InUnit[Number] = Field(
        description="standard deviation of readings about the curve of their own sweep [`unit`]"
    )
    converged: bool = Field(description="whether curve and numbers have settled")


Law = Literal["none", "exponential", "stretched", "logarithmic"]


class LawOfTraining(DocumentPart):
    """The law that the numbers of a condition follow together."""

    chosen: Law = Field(
        description="the law with the greatest evidence, if it gains 3 over free changes of each sweep; else `none`"
    )
    testable: bool = Field(description="whether there are cycles enough, 3, to tell a law")
    ln_evidence: dict[str, Number] = Field(
        description="ln evidence of each law, less that of free changes (`none`) [1]"
    )
    probability: dict[str, Number] = Field(
        description="posterior probability of each, all as probable beforehand [1]"
    )
    n0: IntervalDocument | None = Field(
        description="N0 of the law with the greatest evidence [cycles]; null where none is testable"
    )
    reason: str = Field(description="one sentence")


class ChangeOfNumber(IntervalDocument):
    """Change of a number by the law, from the first to the last measured cycle.

    The interval is that of the change: of an offset or stroke over the span of the common curve, of a shift in kelvins,
    of the logarithm of a width.
    """

    branch: str = Field(description="`heating` or `cooling`")
    channel: str = Field(description="the channel")
    number: str = Field(description="`offset`, `stroke`, `shift` or `width`")
    unit: Annotated[str, UnitOf(difference=True)] = Field(
        description="unit of the change; a stroke or width changes by its logarithm, 1"
    )
    probability: Number = Field(description="that a law acts on it [1]")
    scatter: InUnit[IntervalDocument] = Field(
        description="standard deviation of the effect of a sweep [`unit`]"
    )
    step: InUnit[IntervalDocument] = Field(
        description="standard deviation of the steps of the walk from cycle to cycle [`unit`]"
    )


class Stability(DocumentPart):
    """From which cycle on the curves change by less than a share of their stroke per cycle."""

    from_cycle: int | None = Field(
        description="the first from which on that has the probability asked for; null where no cycle has it"
    )
    cycles: Items[int] = Field(description="cycles; the change is that to the next")
    probability: Items[Number] = Field(
        description="that from the cycle on no change is greater, up to the last that is forecast [1]"
    )
    change: Items[Number] = Field(description="median of the greatest change of any curve to the next [1]")
    statement: str = Field(description="the same in a sentence")


class HeldOutCycles(DocumentPart):
    """The last cycles, forecast from those before."""

    branch: str = Field(description="`heating` or `cooling`")
    channel: str = Field(description="the channel")
    trained: Items[Number] = Field(description="cycles that the forecast is made from")
    held_out: Items[Number] = Field(description="cycles that were forecast")
    rmse: Number = Field(
        description="root mean square error of the median of the forecast, over the range of the channel [1]"
    )
    rmse_last: Number = Field(description="the same of the last curve before [1]")
    covered: Number = Field(description="share of the samples in their 90 % predictive intervals [1]")
    numbers_covered: Number = Field(description="share of the numbers of the sweeps in theirs [1]")


class QuantityByCycle(DocumentPart):
    """A quantity cycle by cycle; lists go along `cycles` of the condition."""

    branch: str = Field(description="`heating` or `cooling`")
    channel: str = Field(description="the channel")
    name: str = Field(
        description="`offset` (level halfway), `stroke`, `shift` (against the mean of the measured sweeps), `width` "
        "(over theirs), `As`, `Af`, `Ms`, `Mf`, or at a temperature the channel or `stiffness`"
    )
    unit: Annotated[str, UnitOf(lambda q: channel_of_value(q.name, q.channel))] = Field(
        description="its unit"
    )
    at: Temperature[NumberOrNull] = Field(
        description="temperature [unit of temperature]; null where it is of the whole sweep"
    )
    own: InUnit[Items[NumberOrNull]] = Field(
        description="value of the sweep by itself; null where there is none"
    )
    own_sd: Annotated[Items[NumberOrNull], In(difference=True)] = Field(description="its standard deviation")
    q05: InUnit[Items[NumberOrNull]] = Field(
        description="lower end of the 90 % interval, pooled over cycles; null where fewer than 95 % of the draws have "
        "a value"
    )
    median: InUnit[Items[NumberOrNull]] = Field(description="median")
    q95: InUnit[Items[NumberOrNull]] = Field(
        description="upper end; after the last measured cycle it is predictive"
    )


class ConditionCycles(DocumentPart):
    """The cycles of one condition."""

    condition: str = Field(description="its id")
    cycles: Items[int] = Field(description="every cycle from the first measured to the last forecast")
    measured: Items[int] = Field(description="those of which a sweep was measured")
    curves: Items[CommonCurve] = Field(description="one for each branch and channel")
    law: LawOfTraining = Field(description="the law of training")
    changes: Items[ChangeOfNumber] = Field(description="change of each number by that law")
    stable: Stability = Field(description="from which cycle on the spring is stable")
    held_out: Items[HeldOutCycles] = Field(
        description="one for each branch and channel; none where there are fewer than 5 cycles"
    )
    quantities: Items[QuantityByCycle] = Field(description="numbers, temperatures, values at temperatures")
    remarks: Items[str] = Field(description="what can't be told, and why")


class CyclesFindings(StudyFindings, DeclaredUnits):
    """What a study of cycles found."""

    schema_: Literal["sma-bayes/cycles/1"] = Field(alias="schema", description="name and version")
    options: CyclesOptions = Field(description="what was asked for")
    temperature_unit: TemperatureUnit = Field(description="unit of temperatures")
    specimen: bool = Field(
        description="whether stress, strain and modulus stand for force, displacement and stiffness"
    )
    converged: bool = Field(description="whether all common curves have settled")
    conditions: Items[ConditionCycles] = Field(description="one for each condition with two cycles or more")
    left_out: Items[str] = Field(description="conditions that have fewer, in words")
    findings: Items[FindingDocument] = Field(description="about the measurements")


class CyclesDocument(RunAccount, FilesBeside, CyclesFindings):
    """What `sma-bayes cycles` writes: `cycles.json`."""


StoredCycles = FinishedRun[CyclesDocument]
"""A finished study of cycles, as its folder holds it."""
DOCUMENTS: Final = {"cycles": CyclesDocument}
