"""What `conditions.json` holds."""

from __future__ import annotations

from typing import Annotated, Final, Literal

from pydantic import Field

from sma_bayes.document_part import UNDER, In, InUnit, TemperatureUnit, UnitOf, UnitOfQuantity
from sma_bayes.runs.finished_run import FinishedRun
from sma_bayes.runs.schema import (
    DeclaredUnits,
    DocumentPart,
    FilesBeside,
    IntervalDocument,
    Items,
    ModelChoiceDocument,
    Number,
    NumberOrNull,
    RunAccount,
    StudyFindings,
)


class ConditionsOptions(DocumentPart):
    """What was asked."""

    scatter: Number = Field(
        description="median of the prior of the scatter between conditions, as a share [1]"
    )
    at: Items[str] = Field(description="conditions that were to be predicted, as `--at` takes them")
    leave_out: Items[str] = Field(description="conditions that were to be left out, or `each`")
    model: str | None = Field(description="`auto`, else null")


class VariedSetting(DocumentPart):
    """A setting that differs between conditions."""

    unit: Annotated[str, UnitOf(UNDER)] = Field(description="its unit")
    values: InUnit[Items[Number]] = Field(description="in each of `conditions` [unit]")


class StatedGroup(DocumentPart):
    """Conditions that state the same settings, and so can be compared."""

    conditions: Items[str] = Field(description="their ids")
    stated: Items[str] = Field(description="the settings that they state")
    varied: dict[str, VariedSetting] = Field(description="those that differ, by name")
    rank: int = Field(description="rank of the design matrix")
    columns: int = Field(
        description="columns of the design matrix: a level, and one for each setting that differs"
    )
    spare: int = Field(description="conditions beyond those that tell level and effects")
    aliased: dict[str, Items[str]] = Field(
        description="settings that vary only together with others, by name"
    )


def _channel_of_unit(feature: NamedFeature | StatedEffect) -> str:
    """Channel whose unit is a factor of that of a feature; none of shares and ratios."""
    return "" if feature.unit == "1" else feature.channel


class NamedFeature(DocumentPart):
    """Which number sums up a curve."""

    name: str = Field(description="which number it is, such as `midpoint`")
    channel: str = Field(description="channel whose curve it sums up; empty where it is not of one channel")
    unit: Annotated[str, UnitOf(_channel_of_unit, difference=lambda f: f.name == "hysteresis_width")] = Field(
        description="its unit"
    )


class StatedFeature(IntervalDocument, NamedFeature):
    """A number that sums up a curve."""

    condition: str = Field(description="id of the condition")
    branch: str = Field(description="`heating` or `cooling`; `both` for the loop")
    measured: bool = Field(description="whether it was measured, and has no posterior")
    defined: Number = Field(description="share of the draws that have it; the interval is theirs [1]")
    at_edge: NumberOrNull = Field(
        description="of an extreme: probability that it lies at an end of the measured temperatures [1]"
    )
    meaning: str = Field(description="what it is, in words")


class StatedConfounder(DocumentPart):
    """What went along with a setting."""

    name: str = Field(description="setting or feature")
    correlation: Number = Field(description="correlation over the conditions [1]")
    strong: bool = Field(description="whether the two can't be told apart")


class StatedEffect(DocumentPart):
    """What a setting does to a feature, from its least to its greatest value."""

    feature: str = Field(description="name of the feature")
    branch: str = Field(description="`heating`, `cooling` or `both`")
    channel: str = Field(description="its channel")
    unit: Annotated[str, UnitOf(_channel_of_unit, difference=True)] = Field(description="unit of the change")
    kind: Literal["factor", "difference"] = Field(description="`factor` or `difference`")
    setting: str = Field(description="name of the setting")
    setting_unit: Annotated[str, UnitOf("setting")] = Field(description="its unit")
    from_: Annotated[Number, In("setting_unit")] = Field(
        alias="from", description="its least value [`setting_unit`]"
    )
    to: Annotated[Number, In("setting_unit")] = Field(description="its greatest value [`setting_unit`]")
    conditions: Items[str] = Field(description="ids of the conditions")
    tested: InUnit[IntervalDocument | None] = Field(
        description="how the tested conditions differ, without scatter; null where not told"
    )
    beyond: InUnit[IntervalDocument | None] = Field(
        description="what the setting does, conditions scattering about a straight line; null where not told"
    )
    probability_rises: NumberOrNull = Field(description="posterior probability that the feature rises [1]")
    scatter: InUnit[IntervalDocument | None] = Field(
        description="standard deviation of the scatter between conditions [`unit`, of a factor of the logarithm]"
    )
    why: str = Field(default="", description="why `tested` or `beyond` is not told; empty where both are")
    defined: Number = Field(
        description="share of the draws that have the feature, in the condition where it is least [1]"
    )
    spare: int = Field(description="conditions beyond those that tell level and effects")
    aliased_with: Items[str] = Field(description="settings that vary only together with this one")
    confounded_with: Items[StatedConfounder] = Field(description="what else went along with it")

    @property
    def sure(self) -> bool:
        """Whether its direction is, by 95 %."""
        p = self.probability_rises
        return p is not None and (p < 0.05 or p > 0.95)


class PopulationSampling(DocumentPart):
    """How the model over conditions was sampled."""

    method: str = Field(description="how its draws were made")
    k: NumberOrNull = Field(description="Pareto k of their weights")
    effective: NumberOrNull = Field(description="effective number of draws")
    converged: bool = Field(description="whether they reached the target")


class StatedCorrection(DocumentPart):
    """How far the Gaussian form of what each condition says was corrected by its likelihood."""

    applied: bool = Field(description="whether it was corrected")
    k: NumberOrNull = Field(description="Pareto k of the weights of all conditions")
    k_of: dict[str, NumberOrNull] = Field(description="Pareto k of the weights of each, by id")
    effective: NumberOrNull = Field(description="effective number of draws")
    why_not: str = Field(description="why it was not applied; else empty")


class StatedCoordinate(DocumentPart):
    """A coordinate in which settings act on straight lines."""

    name: str = Field(description="which it is")
    unit: Annotated[str, UnitOf("channel", difference=True)] = Field(
        default="", description="its unit; 1 of a logarithm"
    )
    channel: str = Field(
        default="", description="channel whose unit is a factor of that; empty where none is"
    )
    level: IntervalDocument = Field(description="its level at the least value of each setting")
    changes: InUnit[dict[str, IntervalDocument]] = Field(
        description="its change over the range of each setting, by name"
    )
    scatter: InUnit[IntervalDocument] = Field(description="standard deviation between conditions")
    scatter_prior: InUnit[IntervalDocument] = Field(description="the same under the prior")


class PooledParameter(DocumentPart):
    """A parameter of the curve of a condition, in the unit of the fit."""

    unit: Annotated[str, UnitOf("channel", difference=lambda p: p.difference)] = Field(
        default="", description="its unit"
    )
    channel: str = Field(
        default="", description="channel whose unit is a factor of that; empty where none is"
    )
    difference: bool = Field(
        default=True, description="of a temperature: whether it is the difference of two"
    )
    own: InUnit[IntervalDocument] = Field(description="by the condition itself")
    pooled: InUnit[IntervalDocument] = Field(description="with what the others say about it")


class StatedPopulation(DocumentPart):
    """The hierarchical model of a group and branch."""

    conditions: Items[str] = Field(description="ids of the conditions")
    branch: str = Field(description="`heating` or `cooling`")
    channels: Items[str] = Field(description="channels of the records")
    spare: int = Field(description="conditions beyond those that tell level and effects")
    prior_led: bool = Field(description="whether the prior of the scatter decides how wide bands are")
    sampling: PopulationSampling = Field(description="how it was sampled")
    correction: StatedCorrection = Field(description="correction by the likelihoods")
    coordinates: Items[StatedCoordinate] = Field(description="its coordinates")
    parameters: dict[str, dict[str, PooledParameter]] = Field(
        description="A and B of each condition, by its id and their names"
    )


class PredictedFeature(IntervalDocument, NamedFeature):
    """A number that sums up a predicted curve."""

    meaning: str = Field(description="what it is, in words")


class TemperaturesCovered(DocumentPart):
    """Temperatures that all conditions cover."""

    unit: TemperatureUnit = Field(description="unit of temperatures")
    covered_from: InUnit[Number] = Field(description="lowest [unit]")
    covered_to: InUnit[Number] = Field(description="highest [unit]")


class PredictedChannel(DocumentPart):
    """The predicted curve of a channel."""

    quantity: str = Field(description="what the channel is called")
    unit: UnitOfQuantity = Field(description="its unit")
    band: str = Field(description="file of the band, by its path in the folder")


class SettingsOfCondition(DocumentPart):
    """Which condition it is."""

    condition: str = Field(description="its id")
    settings: dict[str, Number] = Field(description="what is set, in canonical units")
    branch: str = Field(description="`heating` or `cooling`")


class PredictedCondition(SettingsOfCondition):
    """A condition that was asked for, on a branch."""

    from_: Items[str] = Field(alias="from", description="ids of the conditions from which it was predicted")
    extrapolates: Items[str] = Field(description="settings beyond the measured range, or `combination`")
    prior_led: bool = Field(description="whether the prior of the scatter decides how wide bands are")
    temperature: TemperaturesCovered = Field(description="temperatures that all conditions cover")
    features: Items[PredictedFeature] = Field(description="numbers that sum up its curves")
    channels: dict[str, PredictedChannel] = Field(description="its curves, by channel")


class StatedScore(DocumentPart):
    """How well one way of predicting one channel did; where `on_log`, width and error are of natural logarithms."""

    covers_curve: Number = Field(
        description="share of the temperatures at which the 90 % band holds the curve of the condition itself [1]"
    )
    covers_samples: NumberOrNull = Field(
        description="share of its samples within the 90 % band of a new measurement [1]"
    )
    holds_whole: bool | None = Field(
        description="whether the simultaneous 90 % band holds the curve everywhere; null where there is none"
    )
    width: InUnit[Number] = Field(description="mean width of the 90 % band [unit of the channel]")
    error: InUnit[Number] = Field(description="mean error of its median [unit of the channel]")


class LeftOutCurve(SettingsOfCondition):
    """A channel of a condition that was left out and predicted from the others."""

    channel: str = Field(description="the channel")
    quantity: str = Field(description="what it is called")
    unit: UnitOfQuantity = Field(description="its unit")
    temperature_unit: TemperatureUnit = Field(description="unit of temperatures")
    span: InUnit[Number] = Field(description="range of its own curve [unit]")
    from_: Items[str] = Field(alias="from", description="ids of the conditions from which it was predicted")
    extrapolates: Items[str] = Field(description="settings beyond the measured range, or `combination`")
    prior_led: bool = Field(description="whether the prior of the scatter decides how wide bands are")
    correction_applied: bool = Field(description="whether the likelihoods corrected the Gaussian form")
    on_log: bool = Field(description="whether width and error are of natural logarithms, as of stiffness")
    ways: Annotated[dict[str, StatedScore], In(unless="on_log")] = Field(
        description="how well it was predicted: `hierarchical`, `curves by hand`, `parameters by hand`"
    )
    file: str = Field(description="file of the series, by its path in the folder")

    @property
    def scale(self) -> float:
        """What width and error are divided by, to be told as shares."""
        return 1.0 if self.on_log else self.span


class ConditionsFindings(StudyFindings, DeclaredUnits):
    """What a study of conditions found."""

    schema_: Literal["sma-bayes/conditions/1"] = Field(alias="schema", description="name and version")
    options: ConditionsOptions = Field(description="what was asked")
    model_choice: ModelChoiceDocument | None = Field(
        description="of `--model auto`: why the model; else null"
    )
    refitted: Items[str] = Field(description="keys of the records that were fitted again with that model")
    specimen: bool = Field(description="whether loads are stresses")
    converged: bool = Field(description="whether all draws reached their target")
    groups: Items[StatedGroup] = Field(description="conditions that can be compared")
    features: Items[StatedFeature] = Field(description="of each condition and branch")
    effects: Items[StatedEffect] = Field(description="of each setting on each feature")
    populations: Items[StatedPopulation] = Field(description="models over conditions")
    predictions: Items[PredictedCondition] = Field(description="of each asked condition and branch")
    held_out: Items[LeftOutCurve] = Field(description="of each condition that was left out")
    remarks: Items[str] = Field(description="sentences: what could not be done")
    cautions: Items[str] = Field(description="sentences: what speaks against relying on the numbers")


class ConditionsDocument(RunAccount, FilesBeside, ConditionsFindings):
    """What `conditions.json` holds."""

    @property
    def told_effects(self) -> tuple[StatedEffect, ...]:
        """What settings do, where it is known: those whose directions are counted."""
        return tuple(e for e in self.effects if e.beyond and e.feature != "share_left")

    @property
    def sure_directions(self) -> str:
        """How many of these directions are sure, in words."""
        told = self.told_effects
        return f"{sum(e.sure for e in told)} of {len(told)} effects have a 95 % sure direction"


StoredConditions = FinishedRun[ConditionsDocument]
"""A finished study of conditions, as its folder holds it."""
DOCUMENTS: Final = {"conditions": ConditionsDocument}
