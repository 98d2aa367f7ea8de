"""What `gap.json` holds."""

from __future__ import annotations

from typing import Annotated, Final, Literal

from pydantic import Field

from sma_bayes.document_part import UNDER, InUnit, UnitOf
from sma_bayes.runs.schema import (
    DeclaredUnits,
    DocumentPart,
    FilesBeside,
    FindingDocument,
    IntervalDocument,
    Items,
    ModelChoiceDocument,
    Number,
    NumberOrNull,
    RunAccount,
    StudyFindings,
)

Status = Literal["named", "rejected", "untestable"]
Verdict = Literal["named", "none", "unnamed"]


class StatedDisagreement(DocumentPart):
    """A stretch over which residuals lie to one side."""

    condition: str = Field(description="id of the condition")
    branch: str = Field(description="`heating` or `cooling`")
    channel: str = Field(description="the channel")
    covariate: str = Field(description="covariate along which they do")
    from_: Number = Field(alias="from", description="where the stretch begins [`unit`]")
    to: Number = Field(description="where it ends [`unit`]")
    unit: str = Field(description="unit of the covariate")
    size_sigma: Number = Field(
        description="mean residual there in standard errors, once parameters have adapted and the "
        "autocorrelation of the noise has been taken out [1]"
    )
    mean_residual: Number = Field(
        description="measured less predicted, as it is [unit of the channel]; its sign may differ from that of "
        "`size_sigma` where neighbouring samples are much alike"
    )

    @property
    def side(self) -> str:
        """On which side of the model it was measured."""
        return "above" if self.mean_residual > 0.0 else "below"


class StatedPeriodicity(DocumentPart):
    """A line of a spectrum that no covariate explains."""

    condition: str = Field(description="id of the condition")
    channel: str = Field(description="the channel")
    frequency: Number = Field(description="frequency of the line [`unit`]")
    width: Number = Field(description="frequencies nearer than this the record can't tell apart [`unit`]")
    unit: str = Field(description="`Hz`, or `1/sample` where time was not recorded")
    amplitude: Number = Field(description="amplitude of the sine in the residuals [unit of the channel]")
    size_sigma: Number = Field(description="the same amplitude in standard errors [1]")
    ln_bayes_factor: Number = Field(description="of a model with the line over one without [1]")


class StatedJump(DocumentPart):
    """A jump of a channel that stays to the end of its condition."""

    condition: str = Field(description="id of the condition")
    channel: str = Field(description="the channel")
    by: Number = Field(description="how far it jumps [unit of the channel]")
    sample: int = Field(description="first sample of the condition after it, from 0")
    time: NumberOrNull = Field(description="time of that sample; null where none was recorded [s]")
    cycle: Number = Field(description="cycle of that sample")
    branch: str = Field(description="`heating` or `cooling`")
    temperature: NumberOrNull = Field(
        description="temperature of that sample; null where none was recorded [degC]"
    )


class FlexibleEvidence(DocumentPart):
    """What a flexible term without meaning is worth."""

    covariate: str = Field(description="covariate of which the term is a smooth function")
    channel: str = Field(description="channel that it changes, or what it does to all")
    ln_bayes_factor: Number = Field(description="of the model with the term over that without [1]")


class ShapeEvidence(DocumentPart):
    """What the shape of the curve is worth, the same in every sweep and condition that it serves."""

    ln_bayes_factor: Number = Field(
        description="of a free smooth function of temperature on each branch over none [1]"
    )
    share: Number = Field(
        description="share of the shape in what it and the best flexible term on top of it explain [1]"
    )
    beyond: FlexibleEvidence | None = Field(
        description="the best flexible term on top of a curve of any shape; null where there is none"
    )


class RemainderBeside(FlexibleEvidence):
    """The best flexible term on top of an effect."""

    share: Number = Field(description="share of the term in what the two explain [1]")


class QuantityInWords(DocumentPart):
    """Which quantity it is."""

    unit: Annotated[str, UnitOf(lambda p: "" if p.unit == "degC" else None)] = Field(description="its unit")
    meaning: str = Field(description="what it is")


class EffectParameter(IntervalDocument, QuantityInWords):
    """A parameter of an effect."""

    rhat: NumberOrNull = Field(description="rank-normalised split R-hat [1]")
    ess_bulk: NumberOrNull = Field(description="effective sample size of the bulk")
    ess_tail: NumberOrNull = Field(description="effective sample size of the tails")
    prior: dict[str, Number | str] = Field(
        description="`family`, the numbers of that family, `source`, and `q05`, `median`, `q95` [unit]"
    )

    @property
    def least_ess(self) -> float | None:
        """Lesser of the two effective sample sizes."""
        found = [ess for ess in (self.ess_bulk, self.ess_tail) if ess is not None]
        return min(found, default=None)

    @property
    def prior_range(self) -> tuple[float, float]:
        """Ends of the 90 % range of the prior, which is what the literature gives."""
        return float(self.prior["q05"]), float(self.prior["q95"])

    @property
    def outside_prior(self) -> bool:
        """Whether the 90 % intervals of posterior and prior do not meet."""
        low, _, high = self.quantiles
        least, greatest = self.prior_range
        return low > greatest or high < least


class RefittedCandidate(DocumentPart):
    """A candidate that was refitted in a round."""

    id: str = Field(description="id in the catalogue")
    ln_bayes_factor: Number = Field(
        description="of the model with it over that without, in the round in which it was judged [1]"
    )
    guard: NumberOrNull = Field(
        description="ln Bayes factor of the best flexible term in its place, less what the size of the effect costs by "
        "its prior beyond what it would as the coefficient of that term; null where none contains its signature"
    )
    guard_covariate: str = Field(description="covariate of which that term is a function")
    ln_bayes_factor_beside: NumberOrNull = Field(
        description="of the effect with the best flexible term on top of it over the best one alone; null where it "
        "was not looked for [1]"
    )
    share: NumberOrNull = Field(description="share of the effect in what it and that term explain [1]")
    share_in_own_noise: NumberOrNull = Field(
        description="the same share with the noise that is left beside the effect; null where it was not judged by "
        "that [1]"
    )
    ln_bayes_factor_beyond_shape: NumberOrNull = Field(
        description="of the effect where the curve is free to have any shape, with the effect as without [1]"
    )
    one_stage: NumberOrNull = Field(
        description="ln Bayes factor of the best shape of a curve of one stage in its place; null where the effect "
        "does not hang on it [1]"
    )


class FollowedCovariate(DocumentPart):
    """A recorded setting with which goes what runs or cycles have of their own, or the one that differs."""

    covariate: str = Field(
        description="the setting; of the temperature, its peak; `condition` or `cycle` where one of these differs"
    )
    share: Number = Field(
        description="what a straight line in it, a course with the cycle, or those explain of how they differ"
    )
    member: str | None = Field(
        description="the one or few that differ from all others; null where a setting is followed"
    )
    settles: bool = Field(
        default=False,
        description="whether it is the cycle within each condition, and the line one in its logarithm or in what dies "
        "away with it",
    )
    alternates: bool = Field(default=False, description="whether odd cycles differ from even ones")


class AddedEffect(RefittedCandidate):
    """An effect that was added."""

    title: str = Field(description="what it is")
    equation: str = Field(description="its equation")
    reference: str = Field(description="where form and range come from")
    round: int = Field(description="round in which it was added, from 1")
    class_: Items[str] = Field(
        alias="class", description="effects that these data cannot tell from it, itself first"
    )
    follows: FollowedCovariate | None = Field(
        default=None,
        description="of a random effect, the recorded setting that its runs or cycles follow, or the one or few of "
        "them that differ, which makes it no name; only where there is one",
    )
    probability: Number = Field(
        description="posterior probability among the effects that could be tested, flexible terms and nothing, when "
        "it was added [1]"
    )
    shape_apart: bool = Field(description="whether both are beside a curve that is free to have any shape")
    remainder: RemainderBeside | None = Field(
        description="the best flexible term on top of the effect; null where there is none"
    )
    parameters: dict[str, EffectParameter] = Field(description="its parameters, by name")
    next_experiment: str | None = Field(
        description="what would separate the class; null where it has one member"
    )

    @property
    def rivals(self) -> list[str]:
        """Effects that these data cannot tell from it."""
        return [name for name in self.class_ if name != self.id]


class JudgedCandidate(DocumentPart):
    """What became of an effect of the catalogue."""

    id: str = Field(description="id in the catalogue")
    title: str = Field(description="what it is")
    round: int = Field(description="in which it was judged")
    refitted: bool = Field(description="whether everything was fitted with it; else it was screened only")
    ln_bayes_factor: NumberOrNull = Field(
        description="of the effect over the model of that round; null where untestable or where the effect changes "
        "nothing [1]"
    )
    delta_elpd_held_out: NumberOrNull = Field(
        description="gain in log density of held-out measurements; null where not refitted [1]"
    )
    delta_elpd_se: NumberOrNull = Field(description="its standard error")
    status: Status = Field(description="`named`, `rejected` or `untestable`")
    why: str = Field(description="the reason in words")
    unmet: Items[str] = Field(description="needs of the effect that are not met")


class StatedRound(DocumentPart):
    """What was seen and tried in a round."""

    p_value: Number = Field(description="p-value of the greatest disagreement [1]")
    flexible: Items[FlexibleEvidence] = Field(
        description="the five best flexible terms: smooth functions of a covariate that stand for no mechanism"
    )
    added: str | None = Field(description="effect that was added; null where nothing was")
    class_: Items[str] = Field(alias="class", description="effects that cannot be told from it, itself first")
    candidates: Items[RefittedCandidate] = Field(description="those that were refitted")
    shape: ShapeEvidence | None = Field(
        description="what the shape of the curve is worth; null where there was nothing to explain"
    )


class StatedRemaining(DocumentPart):
    """What the final model still misses, by the best flexible term."""

    p_value: Number = Field(description="p-value of the greatest disagreement [1]")
    covariate: str = Field(description="covariate of which the term is a smooth function")
    channel: str = Field(description="channel that it changes, or what it does to all")
    ln_bayes_factor: Number = Field(description="of the model with the term over that without [1]")
    share: NumberOrNull = Field(
        description="share of the term in all that effects and term explain, 0 where it is within chance, null "
        "without effects [1]"
    )
    share_without_shape: NumberOrNull = Field(
        description="the same beside a curve that is free to have any shape, where that is less; the verdict goes by "
        "it [1]"
    )


class StatedChannelGap(DocumentPart):
    """Held-out residuals of a channel."""

    unit: Annotated[str, UnitOf(UNDER, difference=True)] = Field(description="unit of the channel")
    before_sigma: Number = Field(
        description="root mean square without effects, as innovations in standard deviations of the noise [1]"
    )
    after_sigma: Number = Field(description="the same with what was chosen [1]")
    before: InUnit[Number] = Field(description="root mean square without effects [`unit`]")
    after: InUnit[Number] = Field(description="the same with what was chosen [`unit`]")
    noise: InUnit[Number] = Field(
        description="what noise alone would leave, with the parameters as they would follow it [`unit`]"
    )
    way_to_noise: Number = Field(description="(before − after)/(before − 1) of the innovations [1]")


class StatedGap(DocumentPart):
    """The gap on held-out measurements."""

    metric: str = Field(description="what is measured, in words")
    before: Number = Field(description="without effects [standard deviations of the noise]")
    after: Number = Field(description="with what was chosen [the same]")
    floor: Number = Field(description="with the most helpful flexible term besides [the same]")
    shrink: Number = Field(
        description="(before − after)/(before − floor), the share of what can be explained; 0 where there was no "
        "gap [1]"
    )
    noise: Number = Field(description="1, what noise alone leaves")
    way_to_noise: Number = Field(
        description="(before − after)/(before − 1), 0 where there was no more than noise [1]"
    )
    channels: dict[str, StatedChannelGap] = Field(description="the same of each channel")
    held_out: str = Field(description="what was held out")
    chosen_without: Items[Items[str]] = Field(description="effects that were chosen without each fold")


class GapThresholds(DocumentPart):
    """What decided."""

    p_value: Number = Field(
        description="greatest p-value of a disagreement that counts as more than chance [1]"
    )
    ln_bayes_factor: Number = Field(description="least ln Bayes factor with which an effect is added [1]")
    ln_bayes_factor_apart: Number = Field(
        description="least ln Bayes factor by which two effects are told apart; and by what both leave to flexible "
        "terms, where the lesser one would have a name by itself [1]"
    )
    unexplained_share: Number = Field(
        description="greatest unexplained share with which what was added is named as the cause [1]"
    )
    share_beside: Number = Field(
        description="least share that an effect has to explain beside a flexible term [1]"
    )
    share_of_form: Number = Field(
        description="share of what an effect explains by which a flexible term alone may explain more, where the "
        "effect carries nearly all of what both do [1]"
    )
    share_beyond_shape: Number = Field(
        description="least share of what an effect explains that must lie beyond any shape of the curve, where it "
        "does not beat the shapes of one stage [1]"
    )
    ln_bayes_factor_shape: Number = Field(
        description="least ln Bayes factor by which the shape of the curve is told apart [1]"
    )
    further_share: Number = Field(
        description="least share of what is explained with which a further effect is added [1]"
    )


class StatedLaw(DocumentPart):
    """How the numbers of sweeps go with the cycle."""

    form: str = Field(description="`exponential`, 1 − exp(−(N − 1)/N0), or `logarithmic`, ln(1 + (N − 1)/N0)")
    cycles: NumberOrNull = Field(description="N0; null where there are too few cycles")
    share: Number = Field(description="share of the variation that it explains [1]")
    ln_ratio: Number = Field(
        description="half the number of values times the logarithm of what the other form leaves over what this one "
        "does"
    )
    p_value: NumberOrNull = Field(
        description="share of other orders of whole cycles that a law explains as well [1]"
    )
    untestable: str = Field(description="why there is no p-value; else empty")


class StatedSweep(DocumentPart):
    """A sweep as the common curve of its condition, moved and stretched, by least squares."""

    condition: str = Field(description="id of the condition")
    branch: str = Field(description="`heating` or `cooling`")
    channel: str = Field(description="displacement, or force where there is none")
    cycle: Number = Field(description="number of its cycle")
    offset: Number = Field(description="added to the curve [unit of the channel]")
    stroke: Number = Field(description="stroke over that of the curve [1]")
    shift: Number = Field(description="shift of temperature [K]")
    width: Number = Field(description="width over that of the curve [1]")
    offset_sd: Number = Field(description="standard deviation of `offset` [unit of the channel]")
    stroke_sd: Number = Field(description="standard deviation of the logarithm of `stroke` [1]")
    shift_sd: Number = Field(description="standard deviation of `shift` [K]")
    width_sd: Number = Field(description="standard deviation of the logarithm of `width` [1]")


class StatedSweeps(DocumentPart):
    """Sweeps one by one."""

    law: StatedLaw | None = Field(description="of the cycle; null with the verdict `none`")
    numbers: Items[StatedSweep] = Field(description="each sweep")


class StatedSuspect(DocumentPart):
    """A condition unlike the others of the same settings, or that answers the recorded current unlike all others."""

    condition: str = Field(description="its id")
    quantity: str = Field(description="quantity that is unlike")
    value: InUnit[Number] = Field(description="its value in this condition [`unit`]")
    others: InUnit[Number] = Field(description="mean of the others [`unit`]")
    unit: Annotated[str, UnitOf(lambda s: None)] = Field(description="its unit")
    p_value: Number = Field(description="over all that was compared (moderated t) [1]")


class NamedChannel(DocumentPart):
    """A channel as this campaign calls it."""

    name: str = Field(description="its name")
    symbol: str = Field(description="its symbol")
    unit: Annotated[str, UnitOf("name")] = Field(description="its unit")


class StudiedCondition(DocumentPart):
    """A condition that was studied."""

    id: str = Field(description="its id")
    settings: dict[str, Number] = Field(
        description="`current` [A], `load` [N, of a specimen Pa], `frequency` [Hz], `duty_cycle` [1]"
    )
    n: int = Field(description="samples")
    cycles: int = Field(description="cycles")
    rows_averaged: int = Field(description="rows of the file that a sample is the mean of")


class StatedBand(DocumentPart):
    """The band of frequencies in which innovations are least like white noise."""

    start: Number = Field(description="lower end [`unit`]")
    stop: Number = Field(description="upper end [`unit`]")
    unit: str = Field(description="`Hz`, or `1/sample` where time was not recorded")
    ratio: Number = Field(description="its power over that of the model of the noise [1]")
    p_value: Number = Field(description="p-value of so great a deviation, in this band or another [1]")


class StatedNoise(DocumentPart):
    """The noise of a channel of a condition."""

    condition: str = Field(description="id of the condition")
    channel: str = Field(description="the channel")
    sd: Number = Field(description="standard deviation [unit of the channel]")
    lag1: Number = Field(description="correlation of neighbouring samples [1]")
    scatter: NumberOrNull = Field(
        description="standard deviation from reading to reading [unit of the channel]"
    )
    growth: Number = Field(
        description="ln of the ratio of the size of its innovations at the greatest response to that at the least [1]"
    )
    growth_sd: NumberOrNull = Field(
        description="standard error of `growth`, were they normal and alike [1]; null where the response is constant"
    )
    spectrum: StatedBand | None = Field(
        description="band of frequencies in which it is least like its model; null for short records"
    )


class GapOfModel(DocumentPart):
    """What was found of one model: the response, or the heat balance."""

    verdict: Verdict = Field(description="`named`, `none` or `unnamed`")
    p_value: Number = Field(
        description="p-value of the greatest disagreement without effects, over all covariates and signatures [1]"
    )
    p_value_extrapolated: bool = Field(
        description="whether it lies beyond all shuffles, so that only its order of magnitude counts"
    )
    steady_noise: bool = Field(
        description="whether a disagreement was seen only once the memory of the noise was freed of what one cycle "
        "unlike the others, or jumps, had made of it"
    )
    converged: bool = Field(
        description="whether the sampling of the final model reached the target, that of the heat balance included"
    )
    disagreement: Items[StatedDisagreement] = Field(
        description="places, strongest first; empty with the verdict `none`"
    )
    within_chance: Items[StatedDisagreement] = Field(
        description="with `none`: the stretches of the greatest mean residual all the same"
    )
    periodic: Items[StatedPeriodicity] = Field(
        description="lines of spectra that no covariate explains, strongest first"
    )
    jumps: Items[StatedJump] = Field(
        default=(),
        description="jumps that explain more than an effect under `partial` in whose place they are, or that the "
        "final model leaves, where they explain more than any smooth function of a covariate does",
    )
    effects: Items[AddedEffect] = Field(
        description="in the order in which they were added; empty unless `named`"
    )
    partial: Items[AddedEffect] = Field(
        description="effects that were added and are no names: all where no name is given, and random effects "
        "that follow a recorded setting"
    )
    readings_as_one: NumberOrNull = Field(
        default=None,
        description="where the final model misses something, and numbers of effects are those of least squares: how "
        "many readings count as one in their intervals; null where these come from the likelihood of the noise [1]",
    )
    candidates: Items[JudgedCandidate] = Field(
        description="one for each effect of the catalogue, what was added first"
    )
    rounds: Items[StatedRound] = Field(
        description="what was seen and tried in each round; one that looks for an effect anew begins without it"
    )
    remaining: StatedRemaining = Field(description="what the final model still misses")
    gap: StatedGap = Field(description="the gap on held-out measurements")
    thresholds: GapThresholds = Field(description="thresholds that decide")
    sweeps: StatedSweeps = Field(description="sweeps one by one")
    suspects: Items[StatedSuspect] = Field(description="conditions that are unlike the others")
    channels: dict[str, NamedChannel] = Field(description="channels, by name")
    units: dict[str, str] = Field(description="unit of each input and channel")
    conditions: Items[StudiedCondition] = Field(description="conditions that were studied")
    noise: Items[StatedNoise] = Field(description="noise of each condition and channel")

    @property
    def added(self) -> tuple[AddedEffect, ...]:
        """Effects in the final model, whether they are named as the cause or not."""
        return (*self.effects, *self.partial)


class HeatParameter(IntervalDocument, QuantityInWords):
    """A parameter of the heat balance; its interval comes from draws, or from the normal approximation at the mode."""

    scatter: NumberOrNull = Field(
        default=None,
        description="of `switching`: standard deviation from switching to switching [steps of the record]",
    )


class HeatingFindings(GapOfModel):
    """The same of the heat balance: temperature given current."""

    parameters: dict[str, HeatParameter] = Field(
        description="`gain` [K/(s A^2)], `loss` [1/s], `time_constant` [s], `ambient` [degC] where it was not "
        "recorded, and `switching`, the share of a step of the record that passes before the current changes (1: each "
        "reading holds until the next, 0: since the last) [1]; `gain[CONDITION]` and so "
        "on where conditions are not pooled"
    )
    cautions: Items[str] = Field(description="sentences: what speaks against the verdict")


class GapFindings(GapOfModel, StudyFindings, DeclaredUnits):
    """What a gap study found: of the response (force, displacement, stiffness given temperature) at the top."""

    schema_: Literal["sma-bayes/gap/1"] = Field(alias="schema", description="name and version")
    heating: HeatingFindings | None = Field(
        description="findings of the heat balance; null where temperature is no outcome"
    )
    data_dir: str | None = Field(
        default=None, description="folder of the data, only where `--data` was given"
    )
    model: str = Field(description="response model")
    model_choice: ModelChoiceDocument | None = Field(
        description="of `--model auto`: why the model, over all records; else null"
    )
    pool: str = Field(description="`none` or `campaign`")
    priors: str = Field(description="title of the priors")
    cautions: Items[str] = Field(description="sentences: what speaks against the verdict")
    remarks: Items[str] = Field(
        description="sentences: what was left out of the study, and why; by how much temperatures were smoothed"
    )
    findings: Items[FindingDocument] = Field(description="what was found about the measurements")


class GapDocument(RunAccount, FilesBeside, GapFindings):
    """What `gap.json` holds."""


DOCUMENTS: Final = {"gap": GapDocument}
