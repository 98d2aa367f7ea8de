"""What `ask --json` prints."""

from __future__ import annotations

from typing import Final, Literal

from pydantic import Field

from sma_bayes.runs.schema import DocumentPart, Items, Number, NumberOrNull


class CredibleInterval(DocumentPart):
    """An equal-tailed interval of the probability that was asked for, and the median."""

    low: NumberOrNull = Field(description="lower end")
    median: NumberOrNull = Field(description="median")
    high: NumberOrNull = Field(description="upper end")


class StatedPassage(CredibleInterval):
    """A temperature at which curves pass the value [`temperature_unit`]."""

    direction: Literal["rising", "falling"] = Field(description="`rising` or `falling`")
    probability: Number = Field(description="share of the curves that do [1]")
    extrapolated: bool = Field(description="whether the interval leaves the measured temperatures")


class StatedStretch(DocumentPart):
    """Temperatures from one to another [`temperature_unit`]."""

    low: Number = Field(description="the lowest")
    high: Number = Field(description="the highest")
    low_error: Number = Field(description="standard error of the lowest, by the chance of the draws")
    high_error: Number = Field(description="standard error of the highest, by the chance of the draws")
    extrapolated: bool = Field(description="whether they leave the measured temperatures")


class BestTemperature(DocumentPart):
    """The temperature at which the value is met most surely."""

    temperature: Number = Field(description="the temperature [`temperature_unit`]")
    probability: Number = Field(description="with which it is met there [1]")
    extrapolated: bool = Field(description="whether it lies beyond the measured temperatures")


class MetAt(DocumentPart):
    """Where the value is met."""

    intervals: Items[StatedStretch] = Field(description="where it is with the probability or more")
    best: BestTemperature | None = Field(description="where most surely; null where no curve is there")


class StatedAnswer(DocumentPart):
    """What one record answers."""

    key: str = Field(description="key of the record")
    condition: str = Field(description="id of its condition")
    branch: str = Field(description="`heating` or `cooling`")
    converged: bool = Field(description="whether its fit reached the target")
    quantity: str = Field(description="what its quantity is called")
    unit: str = Field(description="the unit of the wanted value, in which values are")
    temperature_unit: str = Field(
        description="the unit that was asked for, or else that of the fit, in which temperatures are"
    )
    measured: Items[Number] = Field(
        description="lowest and highest measured temperature [`temperature_unit`]"
    )
    searched: Items[Number] = Field(description="the same, wider by `extrapolate`")
    target: Number = Field(description="the wanted value [`unit`]")
    bounds: Items[Number] = Field(description="least and greatest value that the tolerance allows [`unit`]")
    least: CredibleInterval = Field(description="least value over the measured temperatures [`unit`]")
    greatest: CredibleInterval = Field(description="greatest value over the measured temperatures [`unit`]")
    reachable: Number = Field(description="share of the curves that pass the target within `measured` [1]")
    stays_below: Number = Field(
        description="share that does not pass it within `searched` and lies below [1]"
    )
    stays_above: Number = Field(
        description="share that does not pass it within `searched` and lies above [1]"
    )
    passages: Items[StatedPassage] = Field(description="where curves pass it")
    within: MetAt = Field(description="where the value is within `bounds`")
    at_least: MetAt = Field(description="where it is not below the target")
    at_most: MetAt = Field(description="where it is not above the target")
    caution: str | None = Field(
        description="what the slope means on this rig, where it does not tell of the spring; else null"
    )


class AnswersDocument(DocumentPart):
    """What `sma-bayes ask DIR ... --json` prints; it writes nothing."""

    schema_: Literal["sma-bayes/ask/1"] = Field(alias="schema", description="name and version")
    campaign: str = Field(description="name of the campaign")
    seed: int = Field(description="that of the fit")
    data_sha256: str | None = Field(description="SHA-256 of the measurements; null of a fit in memory")
    quantity: str = Field(description="what was asked for")
    value: str = Field(description="the wanted value, as it was given")
    tolerance: str = Field(description="the tolerance, as it was given")
    probability: Number = Field(description="the probability that was asked for [1]")
    extrapolate: Number = Field(description="how far beyond what was measured [`temperature_unit`]")
    temperature_sd: Number = Field(
        description="how far a setting of the temperature may be off [`temperature_unit`]"
    )
    converged: bool = Field(description="whether all that answer did")
    answers: Items[StatedAnswer] = Field(description="one for each record that can tell")
    without: dict[str, str] = Field(description="why others can't, by the key of the record")


class ValuesAt(DocumentPart):
    """A quantity at each of the temperatures; `null` where nothing is told.

    `low`, `median` and `high` are of the curve, the others of a new reading.
    """

    name: str = Field(description="what it is called")
    unit: str = Field(description="its unit, in which values are")
    low: Items[NumberOrNull] = Field(description="lower end of the interval")
    median: Items[NumberOrNull] = Field(description="median")
    high: Items[NumberOrNull] = Field(description="upper end of the interval")
    pred_low: Items[NumberOrNull] = Field(description="lower end of the interval of a new reading")
    pred_median: Items[NumberOrNull] = Field(description="its median")
    pred_high: Items[NumberOrNull] = Field(description="upper end of its interval")


class ValuesOfRecord(DocumentPart):
    """What one record gives at the temperatures."""

    key: str = Field(description="key of the record")
    condition: str = Field(description="id of its condition")
    branch: str = Field(description="`heating` or `cooling`")
    converged: bool = Field(description="whether its fit reached the target")
    adequate: bool = Field(description="whether curve and noise describe the data")
    temperature_unit: str = Field(description="unit of temperatures")
    temperature: Items[Number] = Field(description="temperatures that were asked for [`temperature_unit`]")
    measured: Items[Number] = Field(
        description="lowest and highest measured temperature [`temperature_unit`]"
    )
    extrapolated: Items[bool] = Field(description="for each temperature, whether it lies beyond")
    quantities: dict[str, ValuesAt] = Field(description="by channel")
    caution: str | None = Field(description="where stiffness is not that of the alloy spring; else null")


class ValuesDocument(DocumentPart):
    """What `sma-bayes ask DIR --at ... --json` prints; it writes nothing."""

    schema_: Literal["sma-bayes/ask-at/1"] = Field(alias="schema", description="name and version")
    campaign: str = Field(description="name of the campaign")
    seed: int = Field(description="that of the fit")
    data_sha256: str | None = Field(description="SHA-256 of the measurements; null of a fit in memory")
    at: Items[str] = Field(description="temperatures, as they were given")
    probability: Number = Field(description="that intervals hold [1]")
    extrapolate: Number = Field(description="how far beyond what was measured [`temperature_unit`]")
    temperature_sd: Number = Field(
        description="how far a setting of the temperature may be off [`temperature_unit`]"
    )
    converged: bool = Field(description="whether all that answer did")
    answers: Items[ValuesOfRecord] = Field(description="one for each record")


DOCUMENTS: Final = {"ask": AnswersDocument, "ask-at": ValuesDocument}
