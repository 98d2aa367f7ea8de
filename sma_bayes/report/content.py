"""Everything that a report says about a run, as typed values with units; how they look is decided elsewhere."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Final, Protocol

from sma_bayes.arrays import Floats
from sma_bayes.assess.adequacy import Reason
from sma_bayes.assess.loops import QuantityInterval
from sma_bayes.paper.correlation import CLAIMED
from sma_bayes.paper.tables import PrintedCell
from sma_bayes.quantities import SPECIMEN_QUANTITY
from sma_bayes.report.choice import CAMPAIGN_REPORT_ABOVE
from sma_bayes.report.notation import compact
from sma_bayes.response import DEFAULT_MODEL
from sma_bayes.runs.declared_units import ShownUnit
from sma_bayes.runs.fit_document import (
    FitFindings,
    ParameterSummary,
    RecordSummary,
)
from sma_bayes.runs.schema import AverageR, CorrelationAverage, FindingDocument

LEVEL: Final = "90 %"
INTERVAL: Final = f"equal-tailed {LEVEL} credible interval"
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
    finest : float or None
        Of a share, how near to 0 and to 1 it can be told; what is nearer is said to be so.
    """

    value: float | None
    unit: str = "1"
    resolution: float | None = None
    finest: float | None = None


class WithInterval(Protocol):
    """Part of a document with median and 90 % interval."""

    @property
    def q05(self) -> float | None: ...
    @property
    def median(self) -> float | None: ...
    @property
    def q95(self) -> float | None: ...


@dataclass(frozen=True, slots=True)
class Estimate:
    """Median and equal-tailed 90 % interval of a posterior quantity [unit]."""

    median: float | None
    q05: float | None
    q95: float | None
    unit: str = "1"

    @classmethod
    def of(cls, found: WithInterval, unit: str = "1", factor: float = 1.0) -> Estimate:
        """Of a part of a document, whose numbers times `factor` are in `unit`."""
        median, low, high = (None if q is None else factor * q for q in (found.median, found.q05, found.q95))
        return cls(median, low, high, unit)

    @classmethod
    def where_told(cls, found: WithInterval | None, unit: str = "1", factor: float = 1.0) -> Estimate | None:
        """The same; None of a part that the document does not have."""
        return None if found is None else cls.of(found, unit, factor)


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


class ParameterResult(ParameterSummary):
    """What the document holds of a parameter, under its name."""

    name: str
    at_bound: bool = False
    shown: ShownUnit = ShownUnit("", "", 1.0)
    """How what is stored is shown in `unit`."""

    @property
    def estimate(self) -> Estimate:
        """Median and interval."""
        return Estimate.of(self, self.unit)

    @property
    def family(self) -> str:
        """Family of the prior."""
        return str(self.prior.get("family", ""))

    @property
    def source(self) -> str:
        """Why this prior."""
        return str(self.prior.get("source", ""))

    @property
    def numbers(self) -> dict[str, float]:
        """Numbers of the prior."""
        return {name: value for name, value in self.prior.items() if isinstance(value, float)}

    @property
    def prior_text(self) -> str:
        """The prior in words, numbers in the parameter's unit: ``lognormal, median 0.72, sigma 1``."""
        parts = ["negative" for name, value in self.numbers.items() if name == "sign" and value < 0]
        parts += [f"{name} {compact(value)}" for name, value in self.numbers.items() if name != "sign"]
        return ", ".join((self.family.replace("_", " "), *parts))


@dataclass(frozen=True, slots=True)
class RecordContent:
    """All that is said of one condition and branch.

    Attributes
    ----------
    document : RecordSummary
        What the run stored of it, numbers in the units in which people see them.
    key, condition, branch : str
    converged, adequate : bool
    model : str
        Name of the response model.
    settings : mapping of str to Number
    temperature_unit : str
    temperature_range : tuple of float
        Lowest and highest [unit of temperature].
    temperature_sd : float
        Error of a reading [unit of temperature].
    degrees : ShownUnit
        How stored temperatures are shown.
    channels : tuple of Channel
    held, calibration : tuple of str
        One sentence each.
    parameters : tuple of ParameterResult
    """

    document: RecordSummary
    key: str
    condition: str
    branch: str
    converged: bool
    adequate: bool
    model: str
    settings: Mapping[str, Number]
    temperature_unit: str
    temperature_range: tuple[float, float]
    temperature_sd: float
    degrees: ShownUnit
    channels: tuple[Channel, ...]
    held: tuple[str, ...]
    calibration: tuple[str, ...]
    parameters: tuple[ParameterResult, ...]

    @property
    def model_parameters(self) -> tuple[ParameterResult, ...]:
        """Parameters of the response, without those of the noise."""
        return tuple(p for p in self.parameters if not p.of_noise)

    @property
    def specimen(self) -> bool:
        """Whether a specimen was tested and not a spring: what was set as its load is a stress."""
        return any(q.name in SPECIMEN_QUANTITY.values() for q in self.document.quantities.values())

    @property
    def other_than_published(self) -> bool:
        """Whether the curve is another than the published one, be it by its model or by what stands beside it."""
        return self.model != DEFAULT_MODEL or bool(self.document.discrepancy)

    @property
    def stiffness_withheld(self) -> tuple[Reason, ...]:
        """Why no stiffness is given of this record: its curves are led by their priors; empty where it is given."""
        if self.channel("stiffness") is None:
            return ()
        return tuple(reason for reason in self.document.why if reason.kind == "prior")

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

    def name_of(self, channel: str) -> str:
        """What a channel is called here: strain for the displacement of a specimen."""
        found = self.channel(channel)
        return channel if found is None else found.name


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
    document : CorrelationAverage
    data : str
        ``measured`` or ``replicated``; or what was predicted, ``in sample`` or ``held out``.
    rule : str
        ``plain``, ``fisher`` or ``pooled``.
    """

    document: CorrelationAverage
    data: str
    rule: str

    @property
    def branch(self) -> str:
        """``heating``, ``cooling`` or ``both``."""
        return self.document.branch or "both"

    @property
    def factors(self) -> dict[str, Estimate]:
        """Those of r, r2, adj_r2 and rmse for which the rule makes sense."""
        d = self.document
        units = {"r": "1", "r2": "1", "adj_r2": "1", "rmse": d.unit}
        return {
            name: Estimate.of(by[self.rule], unit)
            for name, unit in units.items()
            if (by := getattr(d, name)) is not None and self.rule in by
        }

    @property
    def r(self) -> AverageR:
        """The average of r."""
        return (self.document.r or {})[self.rule]


@dataclass(frozen=True)
class Content:
    """The content of a report.

    Attributes
    ----------
    records : tuple of RecordContent
    loops : tuple of QuantityInterval
    findings : tuple of FindingDocument
    printed : tuple of PrintedComparison
        Empty but for the twin of the paper.
    averages : tuple of AverageFactor
    document : FitFindings
        What the run stored, numbers in the units in which people see them.
    priors : str
        Priors in force, as a file states them.
    command : str
        The command that gives the same run again.
    truth : tuple of KnownTruth
        Empty but for simulated measurements.
    offsets : mapping of str to float
        What the thermometer of a condition truly read too much [K]; empty where `truth` is.
    """

    records: tuple[RecordContent, ...]
    loops: tuple[QuantityInterval, ...]
    findings: tuple[FindingDocument, ...]
    printed: tuple[PrintedComparison, ...]
    averages: tuple[AverageFactor, ...]
    document: FitFindings
    priors: str
    command: str
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
        return len(self.records) > CAMPAIGN_REPORT_ABOVE

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

    def loops_of(self, condition: str) -> tuple[QuantityInterval, ...]:
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
