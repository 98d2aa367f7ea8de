"""What `plan.json` holds."""

from __future__ import annotations

from typing import Annotated, Final, Literal

from pydantic import Field

from sma_bayes.document_part import In, Kelvins, Temperature, TemperatureUnit
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
    StudyFindings,
)


class KnownQuantity(IntervalDocument):
    """A quantity that is asked about, as it is known now."""

    key: str = Field(description="the record")
    name: str = Field(description="what it is")
    unit: str = Field(description="unit of its numbers")
    sd: Number = Field(
        description="standard deviation of the normal distribution whose 90 % interval is as wide as that of the "
        "quantity [`unit`]"
    )
    shown_unit: str = Field(description="unit in which people see it")
    shown_factor: Number = Field(description="shown units in one of `unit` [1]")
    shown_zero: Number = Field(
        default=0.0, description="what 0 is shown as, other than 0 only of temperatures [`shown_unit`]"
    )
    at: Temperature[NumberOrNull] = Field(
        default=None, description="temperature at which it is [`temperature_unit`]; null for a parameter"
    )


class ExpectedQuantity(DocumentPart):
    """What a quantity is expected to be known to."""

    key: str = Field(description="the record")
    name: str = Field(description="what it is")
    sd: Number = Field(description="the same, expected after the experiment [`unit` under `quantities`]")
    shrinkage: Number = Field(description="1 less expected posterior variance over that of now [1]")


class TellingApart(DocumentPart):
    """How well a candidate tells two explanations apart."""

    first: str = Field(description="an explanation")
    second: str = Field(description="its rival")
    separation: Number = Field(
        description="expected separation of the two, what either may still adapt to taken out [sd of the noise]"
    )
    probability: Number = Field(
        description="that the ln Bayes factor of old and new measurements together (of new ones alone where they are "
        "told apart already) reaches the threshold for the true one, averaged over both by their odds now, and over "
        "their posteriors [1]"
    )
    if_first: Number = Field(description="the same if the first is true [1]")
    if_second: Number = Field(description="the same if the second is [1]")


class PlannedCandidate(DocumentPart):
    """A candidate experiment, and what is expected of it."""

    rank: int = Field(
        description="from 1, by what it tells per hour; where explanations are to be told apart, those that do with a "
        "probability of 0.95 or more come first, the shortest at the top, and then the likeliest"
    )
    name: str = Field(description="as declared; empty in a grid")
    condition: str = Field(description="id of the condition whose settings it has")
    lowest: Temperature[Number] = Field(
        description="lowest temperature, at which it begins and turns round [`temperature_unit`]"
    )
    peak: Temperature[Number] = Field(
        description="peak temperature, at which it turns round [`temperature_unit`]"
    )
    rate: Kelvins[Number] = Field(description="magnitude of dT/dt [`temperature_unit` per s]")
    load: Annotated[NumberOrNull, In("load")] = Field(
        description="load [N, of a specimen Pa]; null where none is known"
    )
    other_load: bool = Field(description="whether that is another load than that of the condition")
    cycles: int = Field(description="number of cycles, up and down")
    samples: int = Field(description="readings of each channel in a sweep")
    setup: Number = Field(description="time before the first cycle [h]")
    hours: Number = Field(description="time on the rig [h]")
    branches: Items[str] = Field(description="branches whose curves it follows; of others it says nothing")
    beyond: Items[str] = Field(description="what of it lies beyond what the campaign measured")
    fits: bool = Field(description="whether it fits into the hours that there are")
    nats: NumberOrNull = Field(
        description="expected information about what is asked [nats]; null where explanations are to be told apart"
    )
    nats_per_hour: NumberOrNull = Field(description="the same per hour on the rig [1/h]")
    probability: NumberOrNull = Field(
        description="least probability over the pairs that are not told apart already (over all, where all are); "
        "null where a quantity is asked [1]"
    )
    expected: Items[ExpectedQuantity] = Field(description="what it leaves of the quantities that it tells of")
    pairs: Items[TellingApart] = Field(description="what it does to each pair of rivals")


class DesignStep(DocumentPart):
    """A part of a design."""

    condition: str = Field(description="id of the condition")
    lowest: Temperature[Number] = Field(description="lowest temperature [`temperature_unit`]")
    peak: Temperature[Number] = Field(description="peak temperature [`temperature_unit`]")
    rate: Kelvins[Number] = Field(description="magnitude of dT/dt [`temperature_unit` per s]")
    cycles: int = Field(description="number of cycles")
    samples: int = Field(description="readings of each channel in a sweep")
    hours: Number = Field(description="time on the rig, set-up included [h]")


class DesignOutcome(DocumentPart):
    """What a design is expected to leave."""

    hours: Number = Field(description="time on the rig [h]")
    nats: Number = Field(description="expected information about what is asked [nats]")
    expected: Items[ExpectedQuantity] = Field(description="what it leaves of each quantity")


class PlannedDesign(DesignOutcome):
    """Candidates together that fill the hours, the most telling first."""

    steps: Items[DesignStep] = Field(description="its parts")
    even: DesignOutcome = Field(
        description="the same hours divided evenly among the conditions that are asked about, in whole loops"
    )
    even_cycles: NumberOrNull = Field(
        default=None,
        description="loops of the condition of which there are fewest in `even`; below 1 there is no time for a whole "
        "one of each, and `even` counts a part of a loop, which can't be made [1]",
    )


class ScatterOfSweeps(DocumentPart):
    """By how much sweeps of a channel differ, beyond noise."""

    key: str = Field(description="the record")
    channel: str = Field(description="the channel")
    sweeps: int = Field(description="from how many sweeps it was learnt; 0 where it is assumed")
    offset: Number = Field(description="standard deviation of the offset [unit of the channel]")
    stroke: Number = Field(description="standard deviation of the logarithm of the stroke [1]")
    shift: Kelvins[Number] = Field(
        description="standard deviation of the shift of temperature [`temperature_unit`]"
    )
    width: Number = Field(description="standard deviation of the logarithm of the width [1]")


class RivalPair(DocumentPart):
    """Two explanations that are to be told apart."""

    first: str = Field(description="an explanation; empty for no effect at all")
    second: str = Field(description="its rival")
    ln_bayes_factor: Number = Field(
        description="of the first over the second, from the measurements there are [1]"
    )
    told_apart: bool = Field(description="whether these tell them apart already")


class PlanFindings(StudyFindings, DeclaredUnits):
    """What is asked, what is known, and what each candidate is expected to tell."""

    schema_: Literal["sma-bayes/plan/1"] = Field(alias="schema", description="name and version")
    asked: str = Field(description="what was asked for")
    kind: Literal["quantity", "parameters", "tell-apart"] = Field(description="what kind of question it is")
    converged: bool = Field(description="whether the fits that it stands on did")
    temperature_unit: TemperatureUnit = Field(description="unit of temperatures")
    available: NumberOrNull = Field(description="hours that there are; null where they were not told [h]")
    assumed_scatter: Literal["none", "usual"] = Field(
        description="scatter that is assumed where there is one sweep only"
    )
    threshold: NumberOrNull = Field(
        description="ln Bayes factor from which explanations are told apart; null where a quantity is asked [1]"
    )
    quantities: Items[KnownQuantity] = Field(description="what is known now")
    scatter: Items[ScatterOfSweeps] = Field(description="by how much sweeps differ")
    rivals: Items[RivalPair] = Field(description="pairs of explanations; empty where a quantity is asked")
    candidates: Items[PlannedCandidate] = Field(description="by `rank`")
    design: PlannedDesign | None = Field(
        description="what to do with the hours that there are; null where they were not told"
    )
    advice: str = Field(description="what to measure, in a sentence")
    remarks: Items[str] = Field(description="what is assumed, and what to doubt")


class PlanDocument(PlanFindings, RunAccount, FilesBeside):
    """What `plan.json` holds."""


StoredPlan = FinishedRun[PlanDocument]
"""A finished plan, as its folder holds it."""
DOCUMENTS: Final = {"plan": PlanDocument}
