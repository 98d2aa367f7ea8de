"""Everything that a report says about a run, as typed values with units; how they look is decided elsewhere."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Final

from sma_bayes.arrays import Floats
from sma_bayes.assess.adequacy import Missed
from sma_bayes.paper.correlation import CLAIMED
from sma_bayes.paper.tables import PrintedCell
from sma_bayes.report.choice import MANY
from sma_bayes.report.notation import compact
from sma_bayes.response import DEFAULT_MODEL
from sma_bayes.runs.fit_document import NoiseSummary, ReasonSummary, RecordSummary, SampledParameter
from sma_bayes.runs.schema import FindingDocument

LEVEL: Final = "90 %"
INTERVAL: Final = f"equal-tailed {LEVEL} credible interval"
CHECK_TAIL: Final = 0.01
"""A predictive check counts as failed where its p-value is below this, or above one less this."""
PAPER_CORRELATION: Final = CLAIMED
"""Average correlation factor that the paper states (its abstract and conclusions)."""
SHAPES: Final = {
    "hump": "falls to zero at both ends (A2 < B2)",
    "unbounded": "grows without bound at both ends (A2 > B2)",
    "sigmoid": "stays between two bounds (A2 = B2)",
}
"""What Eq. (7) does far from the midpoints."""


@dataclass(frozen=True, slots=True)
class Number:
    """A value with its unit.

    Attributes
    ----------
    value : float or None
        None where it is not defined.
    unit : str
    resolution : float or None
        Size of its uncertainty, which decides how many digits are shown [unit].
    """

    value: float | None
    unit: str = "1"
    resolution: float | None = None


@dataclass(frozen=True, slots=True)
class Estimate:
    """Median and equal-tailed 90 % interval of a posterior quantity [unit]."""

    median: float | None
    q05: float | None
    q95: float | None
    unit: str = "1"


@dataclass(frozen=True, slots=True)
class Channel:
    """A channel under the name it has in this campaign.

    Attributes
    ----------
    channel, name, symbol, unit : str
    observed : bool
        False where it follows from others.
    fit : mapping of str to float
        sse, rmse, r2, adj_r2, n, p at the warm start; empty where it was not observed.
    measured, replicated : mapping of str to Estimate
        r, r2, rmse against the measured data and against data replicated from the posterior.
    scale : float
        Of its `unit` in one of the unit of what is stored [1].
    """

    channel: str
    name: str
    symbol: str
    unit: str
    observed: bool
    fit: Mapping[str, float]
    measured: Mapping[str, Estimate]
    replicated: Mapping[str, Estimate]
    scale: float = 1.0


@dataclass(frozen=True, slots=True)
class ParameterResult(SampledParameter):
    """Prior and posterior of a parameter; numbers in `unit` where nothing else is said.

    Attributes
    ----------
    name, meaning, unit : str
    channel : str
        Channel that it belongs to, empty for none.
    of_noise : bool
        True for the parameters of the noise.
    warm_start, warm_start_sd, mean, sd : float or None
    estimate : Estimate
    rhat, ess_bulk, ess_tail : float or None
        [1].
    contraction : float or None
        One less the ratio of posterior to prior variance [1].
    identified, fixed, at_bound : bool
    family : str
    numbers : mapping of str to float
        Of the prior.
    source : str
        Why this prior.
    """

    name: str
    meaning: str
    unit: str
    channel: str
    of_noise: bool
    warm_start: float | None
    warm_start_sd: float | None
    mean: float | None
    sd: float | None
    estimate: Estimate
    rhat: float | None
    ess_bulk: float | None
    ess_tail: float | None
    contraction: float | None
    identified: bool
    fixed: bool
    at_bound: bool
    family: str
    numbers: Mapping[str, float]
    source: str
    scale: float = 1.0

    @property
    def prior(self) -> str:
        """The prior in words, numbers in the parameter's unit: ``lognormal, median 0.72, sigma 1``."""
        parts = ["negative" for name, value in self.numbers.items() if name == "sign" and value < 0]
        parts += [f"{name} {compact(value)}" for name, value in self.numbers.items() if name != "sign"]
        return ", ".join((self.family.replace("_", " "), *parts))


@dataclass(frozen=True, slots=True)
class QuantityRow:
    """A quantity of a branch or of a loop.

    Attributes
    ----------
    name, condition, branch, channel, meaning : str
        `branch` is empty where both make it.
    estimate : Estimate
    """

    name: str
    condition: str
    branch: str
    channel: str
    meaning: str
    estimate: Estimate


@dataclass(frozen=True, slots=True)
class TransformationTemperature:
    """Start or finish of the transformation by the tangent rule.

    Attributes
    ----------
    name, meaning, channel : str
        As, Af, Ms or Mf; in words; channel whose curve was used.
    estimate : Estimate
    within_data : bool
        False where the measurements do not support both tangents, so that the value is extrapolated.
    outstanding : float or None
        Share of the transformation that the sweep leaves out at that end [1].
    samples : int
        Measurements between start and finish.
    defined : float
        Share of the draws for which the rule gives a value [1].
    """

    name: str
    meaning: str
    channel: str
    estimate: Estimate
    within_data: bool
    outstanding: float | None
    samples: int
    defined: float


@dataclass(frozen=True, slots=True)
class NearestParameter:
    """A parameter of the published curve that is nearest to a curve.

    Attributes
    ----------
    name, channel : str
    estimate : Estimate
    defined : float
        Share of the draws that have one [1].
    """

    name: str
    channel: str
    estimate: Estimate
    defined: float


@dataclass(frozen=True, slots=True)
class PredictiveCheck:
    """A statistic of the residuals, measured and replicated [1].

    Attributes
    ----------
    channel, statistic, meaning : str
    measured : float
    replicated : tuple of float
        5 % and 95 % quantile for replicated data.
    p_value : float
        Share of replications that exceed the measurement.
    """

    channel: str
    statistic: str
    meaning: str
    measured: float
    replicated: tuple[float, float]
    p_value: float

    @property
    def failed(self) -> bool:
        """Whether chance hardly ever gives this."""
        return not CHECK_TAIL <= self.p_value <= 1.0 - CHECK_TAIL


@dataclass(frozen=True, slots=True)
class RecordContent:
    """All that is said of one condition and branch.

    Attributes
    ----------
    document : RecordSummary
        What the run stored of it, numbers in the units in which people see them.
    key, condition, branch : str
    converged, adequate : bool
    reasons : tuple of ReasonSummary
        Why it is not adequate; empty where it is.
    model, model_reason : str
        Name of the response model; why it was taken, empty where it was asked for.
    nearest : tuple of NearestParameter
    missed : tuple of Missed
        What the curves miss, by channel; empty where nothing stands beside them.
    settings : mapping of str to Number
    temperature_unit : str
    temperature_range : tuple of float
        Lowest and highest [unit of temperature].
    temperature_sd : float
        Error of a reading [unit of temperature].
    channels : tuple of Channel
    held, calibration : tuple of str
        One sentence each.
    parameters : tuple of ParameterResult
    free_directions : tuple of tuple of str and float
        Combinations that the data leave to the prior, with their contraction [1].
    path_kind, path_message : str
    quantities : tuple of QuantityRow
    transformation : tuple of TransformationTemperature
        The lower temperature first; empty where neither displacement nor force was measured.
    checks : tuple of PredictiveCheck
    noise : NoiseSummary
    """

    document: RecordSummary
    key: str
    condition: str
    branch: str
    converged: bool
    adequate: bool
    reasons: tuple[ReasonSummary, ...]
    model: str
    model_reason: str
    nearest: tuple[NearestParameter, ...]
    missed: tuple[Missed, ...]
    settings: Mapping[str, Number]
    temperature_unit: str
    temperature_range: tuple[float, float]
    temperature_sd: float
    channels: tuple[Channel, ...]
    held: tuple[str, ...]
    calibration: tuple[str, ...]
    parameters: tuple[ParameterResult, ...]
    free_directions: tuple[tuple[str, float], ...]
    path_kind: str
    path_message: str
    quantities: tuple[QuantityRow, ...]
    transformation: tuple[TransformationTemperature, ...]
    checks: tuple[PredictiveCheck, ...]
    noise: NoiseSummary

    @property
    def model_parameters(self) -> tuple[ParameterResult, ...]:
        """Parameters of the response, without those of the noise."""
        return tuple(p for p in self.parameters if not p.of_noise)

    @property
    def other_than_published(self) -> bool:
        """Whether the curve is another than the published one, be it by its model or by what stands beside it."""
        return self.model != DEFAULT_MODEL or bool(self.missed)

    @property
    def stiffness_withheld(self) -> tuple[ReasonSummary, ...]:
        """Why no stiffness is given of this record: its curves are led by their priors; empty where it is given."""
        if self.channel("stiffness") is None:
            return ()
        return tuple(reason for reason in self.reasons if reason.kind == "prior")

    @property
    def worst_rhat(self) -> ParameterResult | None:
        """The sampled parameter with the greatest R-hat."""
        known = [p for p in self.parameters if p.rhat is not None]
        return max(known, key=lambda p: p.rhat or 0.0, default=None)

    @property
    def least_ess(self) -> ParameterResult | None:
        """The sampled parameter with the least effective sample size, bulk or tail."""
        known = [p for p in self.parameters if p.ess is not None]
        return min(known, key=lambda p: p.ess or 0.0, default=None)

    def channel(self, channel: str) -> Channel | None:
        """The channel of that name, if this record has it."""
        return next((c for c in self.channels if c.channel == channel), None)


@dataclass(frozen=True, slots=True)
class PrintedComparison:
    """A printed parameter of the paper beside its posterior.

    Attributes
    ----------
    record : str
        Key.
    condition, branch, parameter : str
    cell : PrintedCell
    estimate : Estimate
    mean, sd : float
    """

    record: str
    condition: str
    branch: str
    parameter: str
    cell: PrintedCell
    estimate: Estimate
    mean: float
    sd: float

    @property
    def distance(self) -> float:
        """Printed value less posterior mean [posterior sd]."""
        return (self.cell.value - self.mean) / self.sd if self.sd > 0 else float("nan")

    @property
    def inside(self) -> bool:
        """Whether the printed value lies in the 90 % interval."""
        low, high = self.estimate.q05, self.estimate.q95
        return low is not None and high is not None and low <= self.cell.value <= high


@dataclass(frozen=True, slots=True, eq=False)
class KnownTruth:
    """The true curve of a channel of simulated measurements, beside its band.

    Attributes
    ----------
    record, condition, branch, channel : str
    name, unit, temperature_unit : str
    temperature, curve : ndarray, shape (m,)
        [`temperature_unit`] and [`unit`].
    within : float
        Share of these temperatures at which the 90 % band holds the curve [1].
    middle : float
        Where the true displacement has gone half of its way [`temperature_unit`].
    true : float
        The curve there [`unit`].
    estimate : Estimate
        What the fit says there.
    """

    record: str
    condition: str
    branch: str
    channel: str
    name: str
    unit: str
    temperature: Floats
    temperature_unit: str
    curve: Floats
    within: float
    middle: float
    true: float
    estimate: Estimate


@dataclass(frozen=True, slots=True)
class AverageFactor:
    """Averages of the correlation factors of a channel over records, by one rule.

    Attributes
    ----------
    channel, name, unit : str
        Of the channel.
    branch : str
        ``heating``, ``cooling`` or ``both``.
    data : str
        ``measured`` or ``replicated``; or what was predicted, ``in sample`` or ``held out``.
    rule : str
        One of `RULES`.
    factors : mapping of str to Estimate
        Those of r, r2, adj_r2 and rmse for which the rule makes sense.
    above : float or None
        Posterior probability that the average of r exceeds `PAPER_CORRELATION`.
    undefined : float
        Share of the draws in which the average of r is not defined [1].
    records, left_out : tuple of str
        Keys of those averaged, and of those that did not converge.
    draws : int
    """

    channel: str
    name: str
    unit: str
    branch: str
    data: str
    rule: str
    factors: Mapping[str, Estimate]
    above: float | None
    undefined: float
    records: tuple[str, ...]
    left_out: tuple[str, ...]
    draws: int


@dataclass(frozen=True, slots=True)
class Provenance:
    """Where the numbers come from.

    Attributes
    ----------
    seed : int
    options, versions : mapping of str to str
    data_sha256, priors, command : str
    """

    seed: int
    options: Mapping[str, str]
    versions: Mapping[str, str]
    data_sha256: str
    priors: str
    command: str


@dataclass(frozen=True)
class Content:
    """The content of a report.

    Attributes
    ----------
    campaign, source : str
    records : tuple of RecordContent
    loops : tuple of QuantityRow
    findings : tuple of FindingDocument
    printed : tuple of PrintedComparison
        Empty but for the twin of the paper.
    averages : tuple of AverageFactor
    provenance : Provenance
    truth : tuple of KnownTruth
        Empty but for simulated measurements.
    offsets : mapping of str to float
        What the thermometer of a condition truly read too much [K]; empty where `truth` is.
    """

    campaign: str
    source: str
    records: tuple[RecordContent, ...]
    loops: tuple[QuantityRow, ...]
    findings: tuple[FindingDocument, ...]
    printed: tuple[PrintedComparison, ...]
    averages: tuple[AverageFactor, ...]
    provenance: Provenance
    truth: tuple[KnownTruth, ...] = ()
    offsets: Mapping[str, float] = field(default_factory=dict)

    @property
    def converged(self) -> tuple[RecordContent, ...]:
        """Records of which conclusions may be drawn."""
        return tuple(r for r in self.records if r.converged)

    @property
    def unconverged(self) -> tuple[RecordContent, ...]:
        """Records of which none may be drawn."""
        return tuple(r for r in self.records if not r.converged)

    @property
    def inadequate(self) -> tuple[RecordContent, ...]:
        """Records that curve and noise do not describe, or whose data do not determine the curve."""
        return tuple(r for r in self.records if not r.adequate)

    @property
    def conditions(self) -> tuple[str, ...]:
        """Ids of the conditions, in order."""
        return tuple(dict.fromkeys(r.condition for r in self.records))

    @property
    def channels(self) -> tuple[Channel, ...]:
        """One channel of each kind that any record has, in order."""
        found = {c.channel: c for r in self.records for c in r.channels}
        return tuple(found[c] for c in ("force", "displacement", "stiffness") if c in found)

    def by_units(self) -> tuple[Content, ...]:
        """The same, parted by conditions whose channels and temperature have the same names and units.

        Only within a part can values share an axis.
        """
        parts: dict[tuple[object, ...], list[RecordContent]] = {}
        for condition in self.conditions:
            records = self.branches(condition)
            units = {(c.channel, c.name, c.unit) for r in records for c in r.channels}
            kind = (tuple(sorted(units)), *sorted({r.temperature_unit for r in records}))
            parts.setdefault(kind, []).extend(records)
        return tuple(replace(self, records=tuple(records)) for records in parts.values())

    @property
    def paged(self) -> bool:
        """Whether there are so many records that each has a page of its own, and only the campaign is reported here."""
        return len(self.records) > MANY

    @cached_property
    def _by_condition(self) -> dict[str, tuple[RecordContent, ...]]:
        found: dict[str, list[RecordContent]] = {}
        for r in self.records:
            found.setdefault(r.condition, []).append(r)
        return {condition: tuple(records) for condition, records in found.items()}

    def branches(self, condition: str) -> tuple[RecordContent, ...]:
        """Records of a condition."""
        return self._by_condition.get(condition, ())

    def only(self, r: RecordContent) -> Content:
        """The same with one record, and nothing about the others."""
        return replace(
            self,
            records=(r,),
            loops=self.loops_of(r.condition),
            findings=(),
            printed=(),
            averages=(),
            truth=(),
            offsets={},
        )

    def loops_of(self, condition: str) -> tuple[QuantityRow, ...]:
        """Loop quantities of a condition, where all of its branches converged."""
        if not all(r.converged for r in self.branches(condition)):
            return ()
        return tuple(q for q in self.loops if q.condition == condition)


def parameters_by_channel(records: Iterable[RecordContent]) -> dict[str, tuple[str, ...]]:
    """Names of the parameters of the response in any of the records, by channel, in the order of the model."""
    found: dict[str, dict[str, None]] = {}
    for record in records:
        for p in record.model_parameters:
            found.setdefault(p.channel, {})[p.name] = None
    return {channel: tuple(found[channel]) for channel in sorted(found)}
