"""What `sensitivity.json` holds."""

from __future__ import annotations

from typing import Annotated, Final, Literal

from pydantic import Field

from sma_bayes.document_part import In, InUnit, Temperature, TemperatureUnit, UnitOf
from sma_bayes.runs.finished_run import FinishedRun
from sma_bayes.runs.schema import (
    DeclaredUnits,
    DocumentPart,
    IntervalDocument,
    Items,
    Number,
    NumberOrNull,
    RunAccount,
    StudyFindings,
)

CONFLICT: Final = "prior-data conflict"
STRONG_PRIOR: Final = "strong prior / weak likelihood"
NONE: Final = "none"


class LeadingPrior(DocumentPart):
    """The parameter whose prior moves a quantity most."""

    parameter: str = Field(description="its name")
    sensitivity: NumberOrNull = Field(description="to the prior of this parameter alone [1]")


class DecidingReading(DocumentPart):
    """The reading that moves a quantity most where it is left out."""

    channel: str = Field(description="channel of the reading")
    row: int = Field(description="its row in the data file; the first one where rows were averaged")
    sweep: int = Field(description="its sweep, from 1")
    temperature: Temperature[Number] = Field(description="temperature that was read [that of the record]")
    change: NumberOrNull = Field(
        description="of the posterior mean without it, to first order [posterior sd]"
    )
    change_by_weights: NumberOrNull = Field(description="the same by weights of the draws [posterior sd]")
    pareto_k: NumberOrNull = Field(description="of these weights; above 0.7 they can't be relied on [1]")
    readings_in_effect: NumberOrNull = Field(
        description="over how many readings the influence is spread: squared sum of its sizes over the sum of "
        "squares [1]"
    )


class LeftOutSweepChange(DocumentPart):
    """What a quantity does where a sweep is left out."""

    sweep: int = Field(description="its number, from 1")
    change: NumberOrNull = Field(
        description="of the posterior mean; null where it can't be told [posterior sd]"
    )


class BootstrapInterval(IntervalDocument):
    """The quantity under sweeps weighted at random."""

    width: NumberOrNull = Field(description="width of this interval over that of the posterior [1]")


class QuantitySensitivity(IntervalDocument):
    """What a number of the fit rests on."""

    name: str = Field(description="parameter, `least stiffness`, `stiffness at 50 °C`, `As` and so on")
    kind: Literal["parameter", "noise", "curve", "transformation"] = Field(
        description="`parameter` of the curve, of the `noise`, value of a `curve`, or `transformation` temperature"
    )
    channel: str = Field(description="that it belongs to; empty for none")
    unit: Annotated[str, UnitOf("quantity", difference=lambda q: q.difference)] = Field(
        description="unit of its numbers"
    )
    meaning: str = Field(description="in words")
    temperature: Temperature[NumberOrNull] = Field(description="of a value at a temperature; else null")
    quantity: str = Field(
        default="", description="quantity whose unit is a factor of `unit`; empty where none is"
    )
    difference: bool = Field(
        default=True, description="of a temperature: whether it is the difference of two"
    )
    defined: Number = Field(
        description="share of the draws in which it is finite; below 0.5 nothing is told of what moves it [1]"
    )
    mean: InUnit[NumberOrNull] = Field(
        description="posterior mean, draws beyond the 0.5 and 99.5 % quantiles taken to lie there [unit]"
    )
    sd: Annotated[NumberOrNull, In(difference=True)] = Field(
        description="standard deviation of the same: unit of what is called posterior sd"
    )
    prior: NumberOrNull = Field(description="sensitivity to the power of the prior [1]")
    likelihood: NumberOrNull = Field(description="sensitivity to the power of the likelihood [1]")
    prior_shift: NumberOrNull = Field(
        description="change of the mean where the power of the prior is doubled, to first order [posterior sd]"
    )
    likelihood_shift: NumberOrNull = Field(description="the same of the likelihood [posterior sd]")
    without_prior: NumberOrNull = Field(
        default=None,
        description="change of the mean without any prior, to first order: `-prior_shift / ln 2` [posterior sd]",
    )
    diagnosis: Literal["prior-data conflict", "strong prior / weak likelihood", "none"] = Field(
        description="`prior-data conflict` where both sensitivities reach the threshold, the shifts have opposite "
        "signs and `without_prior` is 1 or more either way; else `strong prior / weak likelihood` where that to the "
        "prior reaches it and is the greater one, else `none`"
    )
    leading_prior: LeadingPrior | None = Field(
        description="whose prior it is; null where the diagnosis is `none`"
    )
    reading: DecidingReading | None = Field(
        description="the reading that decides most; null where the quantity does not vary, or is defined in few draws"
    )
    sweeps: Items[LeftOutSweepChange] = Field(description="without each sweep; empty where there is one")
    bootstrap: InUnit[BootstrapInterval | None] = Field(
        description="by the bootstrap of sweeps; null of the noise and with fewer than four sweeps"
    )


class LeftOutSweepWeights(DocumentPart):
    """How a sweep was left out."""

    sweep: int = Field(description="its number, from 1")
    first_row: int = Field(description="its first row in the data file")
    readings: int = Field(description="readings of each channel")
    pareto_k: NumberOrNull = Field(description="of the weights of the draws without it [1]")
    refitted: bool = Field(description="whether the others were fitted again because of it")


class BootstrapAccount(DocumentPart):
    """A bootstrap of sweeps."""

    replicates: int = Field(description="fits to sweeps weighted at random")
    failed: int = Field(description="fits that did not end, which are left out")


class RecordSensitivity(DocumentPart):
    """What the numbers of one record rest on."""

    key: str = Field(description="key of the record")
    condition: str = Field(description="id of its condition")
    branch: str = Field(description="`heating`, `cooling` or `both`")
    converged: bool = Field(description="whether its fit reached the target")
    n: int = Field(description="readings of each channel")
    rows_averaged: int = Field(description="source rows that a reading stands for, at most")
    draws: int = Field(description="posterior draws")
    temperature_unit: TemperatureUnit = Field(description="unit of temperatures")
    memory: bool = Field(
        description="whether noise has a memory, so that a reading counts by what it adds to those before"
    )
    quantities: Items[QuantitySensitivity] = Field(description="numbers of the record")
    left_out_sweeps: Items[LeftOutSweepWeights] = Field(
        description="how each sweep was left out; empty where there is one"
    )
    bootstrap: BootstrapAccount | None = Field(
        description="of sweeps; null with fewer than four, whose scatter tells too little"
    )


class Thresholds(DocumentPart):
    """From which values on something is said."""

    sensitivity: Number = Field(description="sensitivity to prior or likelihood [1]")
    without_prior: NumberOrNull = Field(
        default=None, description="change without any prior that makes a conflict [posterior sd]"
    )
    pareto_k: Number = Field(description="Pareto k above which weights are not relied on [1]")


class SensitivityFindings(StudyFindings, DeclaredUnits):
    """What the numbers of a fit rest on."""

    schema_: Literal["sma-bayes/sensitivity/1"] = Field(alias="schema", description="name and version")
    at: Items[str] = Field(description="temperatures, as they were given; empty where none was")
    converged: bool = Field(description="whether all records did")
    thresholds: Thresholds = Field(description="from which values on something is said")
    records: Items[RecordSensitivity] = Field(description="one for each condition and branch")
    conclusion: str = Field(description="what follows, in words")


class SensitivityDocument(RunAccount, SensitivityFindings):
    """What `sensitivity.json` holds."""

    files_sha256: dict[str, str] = Field(
        default_factory=dict,
        description="SHA-256 of each file in `readings/`, by its path; a file that differs is refused",
    )


StoredSensitivity = FinishedRun[SensitivityDocument]
"""A finished study of sensitivity, as its folder holds it."""
DOCUMENTS: Final = {"sensitivity": SensitivityDocument}
