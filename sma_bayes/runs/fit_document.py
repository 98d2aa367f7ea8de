"""What a fit found: `summary.json` is written from these models, read into them and described by them."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Final, Literal

from pydantic import Field

from sma_bayes.assess.adequacy import DiscrepancySummary, Reason
from sma_bayes.assess.checks import in_tail, tails_of
from sma_bayes.assess.identifiability import Direction
from sma_bayes.assess.loops import QuantityInterval
from sma_bayes.assess.path import PathRemark
from sma_bayes.assess.rank_uniformity import Coverage
from sma_bayes.assess.sweeps import LeftOutSweep
from sma_bayes.assess.transformation import LEAST_SAMPLES_OF_TRANSITION, LEAST_SHARE_OF_DRAWS
from sma_bayes.errors import OutputError
from sma_bayes.response import DEFAULT_MODEL
from sma_bayes.runs.documents import FIT
from sma_bayes.runs.schema import (
    CorrelationAverage,
    DocumentPart,
    Factor,
    FindingDocument,
    IntervalDocument,
    Items,
    ModelChoiceDocument,
    Number,
    NumberOrNull,
    RunAccount,
)
from sma_bayes.sampling.convergence import PUBLISHED_TARGET

NOISE: Final = "noise"
"""Role of the parameters of the noise."""
TARGET: Final = PUBLISHED_TARGET
"""What convergence asks for."""
CHECK_TAIL: Final = 0.01
"""A predictive check counts as failed where its p-value is below this at an end that tells something."""


Unit = Annotated[str, Field(description="unit of its numbers")]


class Measure(DocumentPart):
    """A channel under the name that it has in this campaign."""

    name: str = Field(description="what it is called: strain for the displacement of a specimen")
    unit: Unit
    declared_unit: str | None = Field(
        default=None,
        description="unit in which it was declared, and in which reports show it; null where not measured",
    )


class TemperatureSummary(DocumentPart):
    """Temperatures of a record."""

    unit: Unit
    lowest: Number = Field(description="lowest measured [unit]")
    highest: Number = Field(description="highest measured [unit]")
    sd: NumberOrNull = Field(
        default=None,
        description="standard deviation of the error of a reading [unit]",
    )
    declared_unit: str | None = Field(default=None, description="unit in which temperatures were declared")


class HeldSummary(DocumentPart):
    """A channel that the rig kept constant."""

    mean: Number = Field(description="mean [unit]")
    sd: Number = Field(description="standard deviation [unit]")
    unit: str = Field(default="", description="unit of both")
    declared_unit: str | None = Field(
        default=None, description="unit in which it was declared, and in which reports show it"
    )


class CalibrationSummary(DocumentPart):
    """What is known of the calibration of a channel or of the thermometer."""

    relative_scale_sd: Number = Field(description="standard deviation of the scale over the scale [1]")
    offset: Number = Field(
        description="value at which the error is `offset_sd` alone [that of the channel]",
    )
    offset_sd: Number = Field(description="standard deviation of the offset [that of the channel]")


class NearestSummary(IntervalDocument):
    """A parameter of the published curve nearest to the fitted one: least mean square where it was measured."""

    unit: Unit
    channel: str = Field(description="that it belongs to")
    defined: Number = Field(description="share of the draws that have one [1]")


class ParameterSummary(DocumentPart):
    """Prior and posterior of a parameter."""

    unit: Unit
    meaning: str = Field(default="", description="in words")
    channel: str = Field(description="that it belongs to, empty for none")
    role: str = Field(
        description="`span`, `rate`, `midpoint`, `offset`, `cold_slope`, `hot_slope`, `skew`, `tail`, `share`, `gap`, "
        "`second_rate`; `noise` for those of the noise"
    )
    warm_start: NumberOrNull = Field(default=None, description="least-squares fit [unit]")
    warm_start_sd: NumberOrNull = Field(default=None, description="its standard deviation [unit]")
    mean: NumberOrNull = Field(default=None, description="mean of all draws [unit]")
    sd: NumberOrNull = Field(default=None, description="standard deviation of all draws [unit]")
    q05: NumberOrNull = Field(default=None, description="5 % quantile [unit]")
    median: NumberOrNull = Field(default=None, description="median [unit]")
    q95: NumberOrNull = Field(default=None, description="95 % quantile [unit]")
    rhat: NumberOrNull = Field(default=None, description="R-hat; null where fixed [1]")
    ess_bulk: NumberOrNull = Field(
        default=None, description="bulk effective sample size; null where fixed [1]"
    )
    ess_tail: NumberOrNull = Field(
        default=None, description="tail effective sample size; null where fixed [1]"
    )
    quantile_error: NumberOrNull = Field(
        default=None,
        description="greater Monte Carlo standard error of the 2.5 and 97.5 % quantiles over the standard deviation, "
        "as sampled (logarithms of what is positive); null where fixed [1]",
    )
    sd_error: NumberOrNull = Field(
        default=None,
        description="relative Monte Carlo standard error of the standard deviation, as sampled; null where fixed [1]",
    )
    contraction: NumberOrNull = Field(
        default=None,
        description="1 less the ratio of posterior to prior variance [1]",
    )
    identified: bool = Field(default=False, description="whether the contraction is at least 0.9")
    fixed: bool = Field(default=False, description="whether it was not sampled")
    prior: dict[str, NumberOrNull | str] = Field(
        default_factory=dict, description="`family`, its numbers by name, `source`: why this prior"
    )

    @property
    def of_noise(self) -> bool:
        """Whether it is one of the noise."""
        return self.role == NOISE

    @property
    def prior_driven(self) -> bool:
        """Whether the parameter was sampled and the data moved it little."""
        return not self.fixed and not self.identified

    @property
    def ess(self) -> float | None:
        """The lesser effective sample size of bulk and tail [1]."""
        return None if self.ess_bulk is None or self.ess_tail is None else min(self.ess_bulk, self.ess_tail)

    @property
    def shortfall(self) -> str:
        """What misses the target of convergence, in words; empty where nothing does.

        Runs of earlier versions don't tell the errors of quantiles and standard deviations.
        """
        if self.fixed:
            return ""
        if self.rhat is None or self.ess is None:
            return "no R-hat"
        quantile_error, sd_error = self.quantile_error or 0.0, self.sd_error or 0.0
        told = (
            (self.rhat > TARGET.rhat, f"R-hat {self.rhat:.3f}"),
            (self.ess < TARGET.ess, f"{self.ess:.0f} effective draws"),
            (quantile_error > TARGET.quantile_error, f"outer quantiles to {quantile_error:.2g} sd"),
            (sd_error > TARGET.sd_error, f"sd to {100.0 * sd_error:.2g} %"),
        )
        return ", ".join(words for short, words in told if short)

    @property
    def short_of_target(self) -> bool:
        """Whether it misses what convergence asks for."""
        return bool(self.shortfall)


class GoodnessSummary(DocumentPart):
    """Least squares of a channel."""

    sse: NumberOrNull = Field(description="sum of squared errors [unit² of the channel]")
    rmse: NumberOrNull = Field(description="sqrt(sse/(n − p)) [that of the channel]")
    r2: NumberOrNull = Field(description="coefficient of determination [1]")
    adj_r2: NumberOrNull = Field(description="the same, adjusted for p parameters [1]")
    n: int = Field(description="samples")
    p: int = Field(description="parameters of the channel")

    @property
    def r(self) -> float | None:
        """Correlation of the data with the curve of the model alone, which least squares makes the root of R²."""
        return None if self.r2 is None or self.r2 < 0.0 else math.sqrt(self.r2)


Lack = Literal["readings", "tangents", "plateau"]
"""Why a temperature is not supported by the measurements: too few readings between start and finish, tangents that do
not cross on the curve, or an end of the sweep at which the curve is not flat yet."""


class TransformationSummary(IntervalDocument):
    """Start or finish of the transformation by the tangent rule."""

    unit: Unit
    meaning: str = Field(default="", description="in words")
    channel: str = Field(description="whose curve was used")
    within_data: bool = Field(
        description="false where the measurements do not support both tangents: the value is extrapolated"
    )
    outstanding: NumberOrNull = Field(
        default=None,
        description="share of the transformation that the sweep leaves out at that end [1]",
    )
    samples: int = Field(default=0, description="measurements between start and finish")
    defined: Number = Field(
        default=1.0,
        description="share of the draws for which the rule gives a value [1]",
    )

    @property
    def lacks(self) -> Lack | None:
        """What the measurements do not have for it; None where they support it."""
        if self.within_data:
            return None
        if self.samples < LEAST_SAMPLES_OF_TRANSITION:
            return "readings"
        return "tangents" if self.defined < LEAST_SHARE_OF_DRAWS else "plateau"


class CheckSummary(DocumentPart):
    """A posterior predictive check: a statistic of the residuals, measured and replicated."""

    channel: str = Field(description="whose residuals")
    statistic: str = Field(description="name of the statistic")
    measured: NumberOrNull = Field(description="median over the posterior [1]")
    q05: NumberOrNull = Field(description="5 % quantile of replicated data [1]")
    q95: NumberOrNull = Field(description="95 % quantile of replicated data [1]")
    p_value: Number = Field(description="share of the replications that exceed the measurement [1]")
    meaning: str = Field(default="", description="what it would show")

    @property
    def failed(self) -> bool:
        """Whether its p-value is below `CHECK_TAIL` at an end that tells something."""
        return in_tail(self.statistic, self.p_value, CHECK_TAIL)

    @property
    def by_chance(self) -> float:
        """Probability that it counts as failed by chance alone."""
        return CHECK_TAIL * tails_of(self.statistic)


class NoiseSummary(DocumentPart):
    """The noise model of a record and why it was taken."""

    name: str = Field(default="", description="name of the noise model")
    title: str = Field(default="", description="the same for people")
    chosen_by: str = Field(default="", description="`evidence` or `the user`")
    reason: str = Field(default="", description="why it was chosen, empty where it was asked for")
    lag1: dict[str, NumberOrNull] = Field(
        default_factory=dict,
        description="correlation of neighbouring residuals of the warm start, by channel [1]",
    )
    ln_evidence: dict[str, NumberOrNull] = Field(
        default_factory=dict,
        description="ln evidence by noise model that was looked at, less that of the best [1]",
    )


class SamplerSummary(DocumentPart):
    """How a record was sampled."""

    method: str = Field(default="", description="name of the sampler")
    acceptance: NumberOrNull = Field(default=None, description="share of accepted proposals [1]")
    efficiency: NumberOrNull = Field(default=None, description="importance efficiency of the proposal [1]")
    greatest_weight: NumberOrNull = Field(
        default=None, description="greatest importance weight, times the mean [1]"
    )
    modes: int = Field(default=1, description="modes that were found")
    draws: int = Field(default=0, description="draws of all ensembles")


class SamplingSummary(DocumentPart):
    """The audit of the proposal; all null where moves made the draws that do not depend on one."""

    method: str = Field(default="", description="name of the sampler")
    pareto_k: NumberOrNull = Field(default=None, description="Pareto exponent of the weights [1]")
    outside: NumberOrNull = Field(
        default=None,
        description="share of the posterior where the proposal hardly draws [1]",
    )
    outside_sd: NumberOrNull = Field(default=None, description="its standard error [1]")
    greatest_met: NumberOrNull = Field(default=None, description="greatest weight met, times the mean [1]")
    passed: bool | None = Field(
        default=None, description="whether draws of the proposal may be called converged"
    )


class RankSummary(DocumentPart):
    """Ranks of the truths of one number among the draws of the refits."""

    name: str = Field(description="as the fit reports it")
    kind: str = Field(description="`parameter`, `noise`, `curve` or `transformation`")
    channel: str = Field(description="that it belongs to, empty for none")
    shift: Number = Field(
        description="mean of the normal quantiles of the ranks: about how far truths lie above the draws, in "
        "standard deviations; 0 is right [1]"
    )
    spread: Number = Field(
        description="standard deviation of the same: about the spread of truths over that of the draws; 1 is right, "
        "more where draws are too narrow [1]"
    )
    p_location: Number = Field(description="p-value of the mean of the ranks [1]")
    p_spread: Number = Field(description="of their spread [1]")
    p_distribution: Number = Field(description="of their distribution, after Kolmogorov [1]")
    uniform: bool = Field(
        description="whether none of these is rejected by Holm's rule over all of the record"
    )
    coverage: Items[Coverage] = Field(description="of central 50 % and 90 % intervals")


class SelfCheckSummary(DocumentPart):
    """Posterior simulation-based calibration of one record (`--self-check`)."""

    replicates: int = Field(description="measurements that were simulated and fitted")
    failed: int = Field(description="refits that missed their target and are left out")
    false_alarm_rate: Number = Field(
        description="chance, at most, that a record whose ranks are uniform does not pass [1]"
    )
    passed: bool = Field(description="whether all ranks are uniform and at most 5 % of the refits failed")
    quantities: Items[RankSummary] = Field(
        default=(), description="one for each number; empty with fewer than 20 refits"
    )


class RecordSummary(DocumentPart):
    """All that is said of one condition and branch."""

    condition: str = Field(description="id of the condition")
    branch: str = Field(description="`heating`, `cooling` or `both`")
    key: str = Field(description="`<condition>-<branch>`: files are named after it")
    settings: dict[str, Number] = Field(
        default_factory=dict,
        description="what was set: `current` [A], `load` [N, of a specimen Pa], `frequency` [Hz], `duty_cycle` [1]",
    )
    settings_declared_units: dict[str, str] = Field(
        default_factory=dict,
        description="by setting: unit in which it was declared, and in which people see it; a load in g is a mass",
    )
    n: int = Field(description="samples")
    rows_averaged: int = Field(default=1, description="source rows that a sample stands for, at most")
    segments: int = Field(default=1, description="sweeps")
    channels: Items[str] = Field(description="observed channels")
    quantities: dict[str, Measure] = Field(
        description="by channel, observed or not: what it is called, and its unit"
    )
    temperature: TemperatureSummary = Field(description="temperatures")
    held: dict[str, HeldSummary] = Field(
        default_factory=dict, description="channels that the rig kept constant"
    )
    calibration: dict[str, CalibrationSummary] = Field(
        default_factory=dict,
        description="by channel, and `temperature` where that of the thermometer was declared",
    )
    converged: bool = Field(description="whether every parameter reached the target")
    adequate: bool = Field(description="whether curve and noise describe the data")
    why: Items[Reason] = Field(description="reasons why not")
    model: str = Field(description="name of the response model")
    rung: int | None = Field(
        default=None,
        description="its place on the ladder: 1 for the published curve, 0 for one beside the ladder",
    )
    model_choice: ModelChoiceDocument | None = Field(default=None, description="of `--model auto`; else null")
    nearest: dict[str, NearestSummary] = Field(
        description="A1 to A4, B1 to B4 of the published curve nearest to the fitted one"
    )
    discrepancy: dict[str, DiscrepancySummary] = Field(
        description="what the curve misses, by channel that has a [discrepancy](../explanation/discrepancy.md)"
    )
    parameters: dict[str, ParameterSummary] = Field(
        description="A1 to A4, B1 to B4 and what else the model has, then those of the noise, such as `force_sd`"
    )
    fit: dict[str, GoodnessSummary] = Field(default_factory=dict, description="least squares, by channel")
    jacobian_rank: int | None = Field(default=None, description="rank of the Jacobian of least squares")
    free_at_warm_start: Items[str] = Field(
        default=(), description="directions that least squares leaves open"
    )
    at_bound: Items[str] = Field(default=(), description="parameters at a bound of the search")
    correlation: dict[str, dict[str, Factor]] = Field(
        default_factory=dict,
        description="by channel `r`, `r2`, `adj_r2` [1] and `rmse` = sqrt(sse/n) [unit]: posterior curves against the "
        "data ([definitions](../explanation/correlation.md)); `adj_r2` counts the parameters of the model, not what a "
        "discrepancy beside it takes up",
    )
    correlation_replicated: dict[str, dict[str, Factor]] = Field(
        default_factory=dict, description="the same against data replicated from the posterior"
    )
    free_directions: Items[Direction] = Field(
        default=(), description="combinations that are left to the prior"
    )
    shape: dict[str, Number] = Field(
        default_factory=dict,
        description="posterior probability that the stiffness is a `hump`, `unbounded` or a `sigmoid` (bounded, not "
        "zero at both ends); empty where the model gives no limits of it [1]",
    )
    path: PathRemark = Field(default=PathRemark(), description="what dF/dX means on this rig")
    quantities_of_branch: Items[QuantityInterval] = Field(
        default=(), description="least and greatest stiffness and their ratio"
    )
    transformation: dict[str, TransformationSummary] = Field(
        default_factory=dict,
        description="`As` and `Af` or `Mf` and `Ms`, with two stages `Rs` and `Rf` as well ([what they mean]"
        "(../explanation/transformation_temperatures.md)); empty where only stiffness was measured",
    )
    checks: Items[CheckSummary] = Field(default=(), description="predictive checks")
    left_out_sweeps: Items[LeftOutSweep] = Field(
        default=(), description="each sweep, predicted from the others; empty with fewer than three"
    )
    noise: NoiseSummary = Field(default=NoiseSummary(), description="the noise model")
    sampler: SamplerSummary = Field(default=SamplerSummary(), description="how it was sampled")
    sampling: SamplingSummary = Field(
        default=SamplingSummary(), description="the [audit](../explanation/sampling.md#the-audit)"
    )
    self_check: SelfCheckSummary | None = Field(
        default=None,
        description="of `--self-check` ([what it tells](../explanation/calibration.md#of-your-own-record))",
    )
    ln_evidence: NumberOrNull = Field(
        default=None,
        description="log of likelihood times prior integrated; not comparable with `effective_samples` [1]",
    )
    ln_evidence_sd: NumberOrNull = Field(default=None, description="its standard error [1]")
    shares_parameters_with: Items[str] = Field(
        default=(), description="keys of records that share A and B (`--pool campaign`)"
    )
    log_likelihood_evaluations: int = Field(default=0, description="evaluations of the log likelihood")
    wall_s: NumberOrNull = Field(default=None, description="time [s]")
    stages_s: dict[str, Number] = Field(default_factory=dict, description="time by the clock, by stage [s]")
    stages_cpu_s: dict[str, Number] = Field(
        default_factory=dict, description="time of the processor, by stage [s]"
    )
    posterior_sha256: str | None = Field(
        default=None,
        description="SHA-256 of the file of its posterior, which readers compare before they open it",
    )
    band_sha256: dict[str, str] = Field(
        default_factory=dict, description="the same of the files of its bands, by channel"
    )


class BiasSpringSummary(DocumentPart):
    """A bias spring and how it is arranged."""

    arrangement: str = Field(description="`published_difference`, `parallel` or `series`")
    stiffness: Number = Field(description="stiffness K2 [N/m]")
    sd: Number = Field(description="its standard deviation [N/m]")


class OptionsSummary(DocumentPart):
    """Options that decide the numbers."""

    model: str = Field(default=DEFAULT_MODEL, description="name of the response model, or `auto`")
    noise: str = Field(default="auto", description="name of the noise model, or `auto`")
    pool: str = Field(default="none", description="`none` or `campaign`")
    sampler: str = Field(default="independence", description="name of the sampler")
    extrapolate: Number = Field(
        default=0.0, description="how far bands go beyond the observed temperatures [unit of temperature]"
    )
    priors: str = Field(default="", description="title of the priors")
    bias_spring: BiasSpringSummary | None = Field(default=None, description="of `--arrangement`; else null")


class FitFindings(DocumentPart):
    """What a fit found."""

    schema_: Literal["sma-bayes/fit/1"] = Field(alias="schema", description="name and version of this schema")
    campaign: str = Field(default="", description="name of the campaign")
    source: str = Field(default="", description="where the measurements come from")
    data_dir: str | None = Field(
        default=None, description="folder of the data, only where `--data` was given"
    )
    seed: int = Field(description="decides every draw")
    options: OptionsSummary = Field(default=OptionsSummary(), description="options that decide the numbers")
    versions: dict[str, str] = Field(
        default_factory=dict, description="versions of Python and of packages, by name"
    )
    data_sha256: str | None = Field(default=None, description="SHA-256 of the measurements")
    converged: bool = Field(description="whether all records converged")
    adequate: bool = Field(description="whether all records are adequate")
    records: Items[RecordSummary] = Field(description="one for each condition and branch")
    correlation_average: Items[CorrelationAverage] = Field(
        default=(), description="averages of the correlation factors, one a channel, branch and kind of data"
    )
    loops: Items[QuantityInterval] = Field(
        default=(), description="hysteresis width and loop area of conditions with both branches"
    )
    findings: Items[FindingDocument] = Field(default=(), description="what was found about the measurements")


class FitSummary(RunAccount, FitFindings):
    """What a fit found and what it took: `summary.json`."""


def refuse_shared_parameters(shared: bool, folder: str | Path, use: str) -> None:
    """Refuse a fit in which conditions share their parameters (``--pool campaign``).

    Parameters
    ----------
    shared : bool
        Whether they do.
    folder : str or Path
    use : str
        What parameters of their own are needed for: ``which a sweep can move``.

    Raises
    ------
    OutputError
        If they do.
    """
    if shared:
        raise OutputError(
            "holds a fit in which all conditions share A and B",
            file=folder,
            expected=f"parameters of their own for each condition, {use}",
            remedy="fit again without --pool campaign",
        )


def read_fit(folder: Path) -> FitSummary:
    """What a finished fit found.

    Raises
    ------
    OutputError
        If the run is not finished, or its document can't be read, was changed, is of another version, or holds no
        records.
    """
    found, path = FIT.read(folder), folder / FIT.file
    if not found["records"]:
        raise OutputError(
            "holds no records",
            file=path,
            expected="at least one record",
            remedy="name the output folder of a fit, made by this version of sma_bayes",
        )
    return FitSummary.read_as(found, path, FIT.as_declared, FIT.in_another_folder)
