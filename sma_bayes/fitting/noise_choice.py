"""Choose what stands beside the curve: the noise model, and where the curve misses the data a discrepancy.

Both are chosen together, since a misfit that is given no place passes for noise with a memory. What the least-squares
curve leaves is described, channel by channel, by each noise model with and without a discrepancy; what a small change
of the parameters could describe is integrated out. The evidence of each description is found by Laplace's method over
the few parameters that it has.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from sma_bayes.arrays import Bools, Floats
from sma_bayes.errors import nats
from sma_bayes.fitting.discrepancy import (
    DiscrepancyBasis,
    between_sweeps_fact,
    build_basis,
    nodes_of,
    size_fact,
)
from sma_bayes.fitting.discrepancy_weights import Whitened
from sma_bayes.fitting.expected_response import fitted_moments, quiet
from sma_bayes.fitting.posterior import Posterior, build_posterior
from sma_bayes.fitting.sweep_functions import SweepFunctions
from sma_bayes.fitting.warm_start import WarmStart
from sma_bayes.noise import NOISE_MODELS, NoiseModel, Steps
from sma_bayes.noise.base import lag1
from sma_bayes.noise.effective_samples import memory_of
from sma_bayes.noise.heteroscedastic import temperature_sd_fact
from sma_bayes.normal import MAD_TO_SD
from sma_bayes.parameters.distributions import LogNormal
from sma_bayes.parameters.priors_file import PriorSet
from sma_bayes.parameters.scales import RecordScales
from sma_bayes.parameters.space import ParameterSpace
from sma_bayes.records.types import Record
from sma_bayes.sampling.laplace import find_modes

EVEN_STEP_TOLERANCE = 0.05
"""Relative spread of the time steps below which samples count as evenly spaced."""
LEAST_STANDARD_ERRORS = 1.3
"""Standard errors from which a sign counts: one false sign in five, so that hardly any true one is overlooked."""
GROWTH_STANDARD_ERRORS = 3.0
"""Standard errors, as of noise without a memory, from which growth of the residuals counts though they may have one."""
LEAST_LN_EVIDENCE_GAIN = 1.5
"""What a memory, heavy tails, and a discrepancy beside or instead of a memory must each gain in ln evidence."""
LEAST_LN_EVIDENCE_GAIN_OF_VARIANCE = 2.0
"""What growth and an error of the thermometer must gain: they are looked at last, beside the best of the others."""
ALLOWED_LN_EVIDENCE_LOSS = 2.0
"""ln evidence that the more careful reading must lack to be dropped: a discrepancy beside noise without a memory, since
a misfit that a record hardly shows takes starts and finishes out of intervals that don't know of it; and a memory
beside a discrepancy, since one sweep hardly tells it from what the discrepancy does not resolve."""
CHANGE_SD_RANGES = 10.0
"""Standard deviation, in ranges of the channel, of what a change of the parameters may do to the curve."""
BASIS_GRID_POINTS = 2001
"""Temperatures at which a curve is looked at to lay out the basis of its discrepancy."""
MAX_MEMORY_SWEEPS = 0.5
"""Samples that count as one under a noise model, as a share of a sweep, from which its memory is no noise."""
MAX_MEMORY_SAMPLES = 12.0
"""Samples that may count as one beside a discrepancy, however many functions it has."""
LEAST_LN_EVIDENCE_GAIN_OVER = {"growing": LEAST_LN_EVIDENCE_GAIN, "temperature_error": 15.0}
"""What a series other than the simplest must gain beside growth or an error of the thermometer."""
LN_NOISE_SD = 2.0
"""Standard deviation of ln sd a priori where descriptions are compared: how much of the residuals is noise is open."""
SIMPLEST = "independent"
ROUNDED = "rounded"
VISIBLE_ROUNDING_STEP = 2.0
"""Step of the readings, in standard deviations of the noise before rounding, from which rounding is described."""

Bases = tuple[Mapping[str, DiscrepancyBasis], ...]


@dataclass(frozen=True, slots=True)
class NoiseChoice:
    """A noise model, where a discrepancy stands beside the curve, and the reason.

    Attributes
    ----------
    name : str
    reason : str
        One sentence for people.
    lag1 : mapping of str to float
        Correlation of neighbouring residuals of the warm start, by channel.
    ln_evidence : mapping of str to float
        Of each noise model that was looked at, with discrepancies where they earn their place, less that of the best.
    discrepancy : mapping of str to float
        What a discrepancy gains in ln evidence, by channel (the sum over records), under the chosen noise model;
        they are taken where all channels together gain.
    bases : tuple of mapping
        For each record, channel to the basis of its discrepancy, where one is taken.
    estimate : tuple of mapping
        For each record, channel to the likeliest parameters of its noise, then the size of its discrepancy and of what
        sweeps have of their own.
    temperature_sd : tuple of float
        For each record, likeliest standard deviation of an error of the thermometer; zero where none is estimated.
    longest_memory : tuple of mapping
        For each record, channel to how many samples may count as one at most, where there is a bound.
    """

    name: str
    reason: str
    lag1: Mapping[str, float]
    ln_evidence: Mapping[str, float]
    discrepancy: Mapping[str, float] = field(default_factory=dict)
    bases: Bases = ()
    estimate: tuple[Mapping[str, Floats], ...] = ()
    temperature_sd: tuple[float, ...] = ()
    longest_memory: tuple[Mapping[str, float], ...] = ()


def choose_noise(
    posterior: Posterior,
    start: WarmStart,
    priors: PriorSet,
    *,
    noise: str | None = None,
    discrepancy: bool = True,
    sweeps: bool = False,
    allowed_loss: float = ALLOWED_LN_EVIDENCE_LOSS,
) -> NoiseChoice:
    """Choose a noise model, and whether discrepancies stand beside the curves.

    Noise models that are a density of the data compete; those that need time are left out where time was not recorded
    or its steps are even. Independent normal noise is looked at first. Models with a memory, with heavy tails, growth
    with the response and an error of the thermometer are looked at only where what it leaves shows a sign of such a
    thing (`LEAST_STANDARD_ERRORS`), and taken where they gain `LEAST_LN_EVIDENCE_GAIN`, or
    `LEAST_LN_EVIDENCE_GAIN_OF_VARIANCE`, over what is simpler; beside growth or an error of the thermometer only what
    still earns its place stays, but for a memory beside a discrepancy, which stays unless it lacks
    `ALLOWED_LN_EVIDENCE_LOSS`, and an error of the thermometer beside normal noise with a discrepancy, which is
    looked at without a sign of it and taken where it gains anything at all: a discrepancy follows what the few
    readings in a transformation scatter if nothing else is there for it. Discrepancies are taken where the evidence
    of all channels together is greater with them: by `LEAST_LN_EVIDENCE_GAIN` beside a memory, which a smooth
    misfit resembles, and beside normal noise without one also where it is less by no more than `allowed_loss`. They
    are taken together: force and displacement are of one specimen, and where the curve fails in one of them the
    other, in more noise, is no better known. Before another series a discrepancy counts as a memory does. Heavy
    tails are not taken beside a discrepancy: under them what a smooth function does not resolve passes for
    outliers, and the curve for better known than it is. So they are looked at without one, and taken where that
    describes the residuals better than normal noise with or without a discrepancy, unless a discrepancy beside them
    would gain more still.
    Where records have several sweeps all of this is done once more with what each sweep has of its own beside the
    discrepancy, which is taken where it gains `LEAST_LN_EVIDENCE_GAIN`. Heavy tails, growth and an error of the
    thermometer take no part in that, on neither side. Under heavy tails the readings of a sweep that differs pass
    for outliers, or those of the others do, and each way is a mode that Laplace's method does not see beyond. The
    others follow the common curve, would tell where it lies by how the noise of sweeps changes that lie elsewhere,
    and sweeps that are shifted scatter most where the curve is steep, which is what an error of the thermometer
    does to readings.

    Parameters
    ----------
    posterior : Posterior
        With any noise model; its records count.
    start : WarmStart
    priors : PriorSet
    noise : str, optional
        The only noise model to consider.
    discrepancy : bool
        Whether discrepancies are considered.
    sweeps : bool
        Whether what sweeps have of their own is considered.
    allowed_loss : float
        ln evidence that a discrepancy beside normal noise without a memory may lack and still be taken; where it may
        lack none, neither may an error of the thermometer beside a discrepancy. None where the noise is not chosen, nor
        where an error of the thermometer was declared, which is integrated out better without.
    """
    if noise is not None or any(r.temperature_sd > 0.0 for r in posterior.records):
        allowed_loss = 0.0
    residuals = _Residuals(posterior, start, priors, discrepancy, allowed_loss)
    choice, supported = _best(residuals, noise, tails=False)
    if choice.name == ROUNDED:
        return choice
    if sweeps and "+" not in (noise or ""):
        apart = residuals.with_sweeps_apart()
        if apart is not None:
            other, of_other = _best(apart, noise, tails=False)
            if _sweeps_apart(other.bases) and of_other > supported + LEAST_LN_EVIDENCE_GAIN:
                return other
    return choice if noise is not None else _or_with_tails(residuals, choice)


def _or_with_tails(residuals: _Residuals, normal: NoiseChoice) -> NoiseChoice:
    """The choice of normal noise, or one with heavy tails where that is better; see `choose_noise`."""
    if not residuals.signs_of_simplest.tails:
        return normal
    alone = residuals.without_discrepancy()
    tailed, _ = _best(alone, None, tails=True)
    model = NOISE_MODELS[tailed.name]
    if model.is_gaussian or _worth(alone, tailed.name) <= _worth(residuals, normal.name):
        return normal
    if not any(residuals.described(model).bases):
        choice, _ = _best(residuals, None, tails=True)
        if not any(choice.bases):
            return choice
    why = f"{model.title} is not taken, since what a discrepancy does not resolve passes for outliers beside one"
    return replace(normal, reason=f"{normal.reason}; {why}")


def _worth(residuals: _Residuals, name: str) -> float:
    """How well a noise model describes residuals, less what memory and heavy tails must each gain."""
    model = NOISE_MODELS[name]
    features = int(model.autocorrelated) + int(not model.is_gaussian)
    return residuals.described(model).supported - LEAST_LN_EVIDENCE_GAIN * features


def _best(residuals: _Residuals, noise: str | None, *, tails: bool) -> tuple[NoiseChoice, float]:
    """What describes residuals best, of one noise model or all, those with heavy `tails` or not; see `choose_noise`.

    Returns
    -------
    NoiseChoice
    supported : float
        How well the best normal series alone does, without growth or an error of the thermometer; the chosen model
        where it was not chosen among all.
    """
    posterior = residuals.posterior
    found: dict[str, _Description] = {}
    coarse: dict[str, float] = {}
    series_alone: float | None = None

    def look(name: str) -> _Description:
        found[name] = residuals.described(NOISE_MODELS[name])
        return found[name]

    if noise is not None:
        best = noise
        look(noise)
    else:
        coarse = residuals.coarse(look(SIMPLEST))
    if noise is None and coarse:
        best = ROUNDED
        look(best)
        found = {best: found[best]}  # a density that need not be finite where readings repeat is no rival
    elif noise is None:
        names = [n for n in _series(residuals) if tails or NOISE_MODELS[n].is_gaussian]
        for name in names:
            look(name)
        best = max(names, key=lambda n: _worth(residuals, n))
        series_alone = max(look(n).supported for n in names if NOISE_MODELS[n].is_gaussian)
        errs = residuals.signs_of_simplest.joined(residuals.signs(look(best))).slope
        for suffix, may in (("growing", residuals.may_grow(look(best))), ("temperature_error", errs)):
            if not may or _sweeps_apart(residuals.bases):
                continue
            series, *others = best.split("+")
            extended = "+".join([series, *others, suffix])
            # what the slope explains is not to be explained by tails or a memory besides; in the moments that are
            # looked at here a large error of the thermometer leaves tails of its own
            enough = look(extended).supported - LEAST_LN_EVIDENCE_GAIN_OVER[suffix]
            simpler = ("+".join([s, *others, suffix]) for s in (SIMPLEST, *_without_tails(series, names)))
            extended = next((s for s in simpler if look(s).supported > enough), extended)
            if look(extended).supported > look(best).supported + LEAST_LN_EVIDENCE_GAIN_OF_VARIANCE:
                best = extended
        best = _without_what_is_not_needed(best, names, lambda name: look(name).supported)
        if any(look(best).bases):
            enough = max(look(best).ln_evidence, look(best).supported) - ALLOWED_LN_EVIDENCE_LOSS
            allowed = (n for n in _with_memory(best) if any(look(n).bases) and look(n).ln_evidence > enough)
            best = next(allowed, best)
            if residuals.allowed_loss > 0.0 and not _sweeps_apart(residuals.bases):
                best = _with_temperature_error(best, look)
    chosen = found[best]
    top = max(d.ln_evidence for d in found.values())
    rivals = {name: d.ln_evidence - top for name, d in found.items() if np.isfinite(d.ln_evidence)} or {
        best: 0.0
    }
    neighbours = neighbour_correlation(posterior, residuals.start)
    choice = NoiseChoice(
        best,
        _reason(best, rivals, neighbours, chosen, coarse, posterior.records[0].quantity),
        neighbours,
        rivals,
        chosen.gain,
        chosen.bases,
        chosen.estimate,
        chosen.temperature_sd,
        chosen.longest_memory,
    )
    return choice, chosen.supported if series_alone is None else series_alone


def _series(residuals: _Residuals) -> list[str]:
    """Names of the noise models to begin with: all that go with what is known of the time, and with signs of memory."""
    remembers, uneven = residuals.signs_of_simplest.memory, all(map(_uneven, residuals.posterior.steps))
    return [
        name
        for name, model in NOISE_MODELS.items()
        if model.is_density
        and not model.stands_alone
        and (uneven or not model.needs_time)
        and (remembers or not model.autocorrelated)
    ]


def _without_tails(name: str, series: Sequence[str]) -> list[str]:
    """Those of some series that are normal and remember as one with heavy tails does; none for a normal one."""
    model = NOISE_MODELS[name]
    others = [NOISE_MODELS[n] for n in series if not model.is_gaussian]
    return [n.name for n in others if n.is_gaussian and n.autocorrelated == model.autocorrelated]


def _with_memory(name: str) -> list[str]:
    """Noise models that remember from sample to sample, and differ in that alone from one that doesn't."""
    series, *suffixes = name.split("+")
    model = NOISE_MODELS[series]
    if model.autocorrelated:
        return []
    return [
        "+".join([other.name, *suffixes])
        for other in NOISE_MODELS.values()
        if other.autocorrelated
        and other.is_density
        and not (other.stands_alone or other.needs_time)
        and other.is_gaussian == model.is_gaussian
    ]


def _with_temperature_error(name: str, look: Callable[[str], _Description]) -> str:
    """A noise model beside a discrepancy, with an error of the thermometer where that gains anything in ln evidence.

    Growth goes where the error makes it needless. A noise model with heavy tails, or that has such an error, is
    returned as it is.
    """
    if NOISE_MODELS[name].feels_temperature or not NOISE_MODELS[name].is_gaussian:
        return name
    enough = max(look(name).ln_evidence, look(name).supported)
    series, *_ = name.split("+")
    margins = {
        f"{series}+temperature_error": LEAST_LN_EVIDENCE_GAIN_OF_VARIANCE,
        f"{name}+temperature_error": 0.0,
    }
    felt = {n: look(n) for n in margins}
    allowed = [n for n, d in felt.items() if any(d.bases) and d.ln_evidence > enough]
    return max(allowed, key=lambda n: felt[n].ln_evidence + margins[n], default=name)


def _without_what_is_not_needed(name: str, series: Sequence[str], supported: Callable[[str], float]) -> str:
    """An extended noise model, less what it no longer earns: growth and errors of temperature look like heavy tails."""
    while "+" in name:
        first, *suffixes = name.split("+")
        simpler = {
            "+".join([first, *(x for x in suffixes if x != s)]): LEAST_LN_EVIDENCE_GAIN_OF_VARIANCE
            for s in suffixes
        }
        for other in series:
            lighter = NOISE_MODELS[other].is_gaussian and not NOISE_MODELS[first].is_gaussian
            if other != first and (lighter or other == SIMPLEST):
                simpler["+".join([other, *suffixes])] = LEAST_LN_EVIDENCE_GAIN
        kept = max(simpler, key=lambda s: supported(s) + simpler[s])
        if supported(kept) + simpler[kept] < supported(name):
            break
        name = kept
    return name


def _reason(
    name: str,
    rivals: Mapping[str, float],
    neighbours: Mapping[str, float],
    description: _Description,
    coarse: Mapping[str, float],
    quantity: Callable[[str], str],
) -> str:
    title = NOISE_MODELS[name].title
    parts = []
    correlations = ", ".join(f"{value:.2f} ({quantity(channel)})" for channel, value in neighbours.items())
    parts.append(f"neighbouring residuals of the least-squares fit are correlated by {correlations}")
    if coarse:
        steps = ", ".join(f"{value:.2g} ({quantity(channel)})" for channel, value in coarse.items())
        parts.append(f"readings come in steps that are large beside the residuals, {steps} times as large")
    others = sorted(((v, k) for k, v in rivals.items() if k != name), reverse=True)
    if others:
        ahead = rivals[name] - others[0][0]
        less = "less" if ahead >= 0 else "more, which is too little to prefer it"
        parts.append(
            f"{NOISE_MODELS[others[0][1]].title} comes second, ln evidence {nats(abs(ahead))} {less}"
        )
    elif name == SIMPLEST and not coarse:
        parts.append(
            "the residuals show neither autocorrelation, heavy tails, growth with the response nor an error of the "
            "thermometer"
        )
    taken = sorted({channel for bases in description.bases for channel in bases})
    if taken:
        beside = "a smooth discrepancy beside the curve"
        if _sweeps_apart(description.bases):
            beside += ", and what each sweep has of its own,"
        parts.append(f"{beside} {_gained({c: description.gain[c] for c in taken}, quantity)}")
        if (
            NOISE_MODELS[name].autocorrelated
            and others
            and rivals[name] - others[0][0] < LEAST_LN_EVIDENCE_GAIN
        ):
            parts.append("beside it a memory stays unless the evidence is against it")
        if name.endswith("+temperature_error") and gained_by_temperature_error(name, rivals) < (
            LEAST_LN_EVIDENCE_GAIN_OF_VARIANCE
        ):
            parts.append("beside it an error of the thermometer is taken where it gains anything")
    return f"{title}: {'; '.join(parts)}"


def gained_by_temperature_error(name: str, ln_evidence: Mapping[str, float | None]) -> float:
    """What a noise model with an error of the thermometer gains in ln evidence over the best that knows of none.

    Parameters
    ----------
    name : str
        Of the noise model.
    ln_evidence : mapping of str to float or None
        As in `NoiseChoice`. Where none without the error was looked at the gain is infinite.
    """
    others = [v for n, v in ln_evidence.items() if v is not None and not n.endswith("+temperature_error")]
    return (ln_evidence.get(name) or 0.0) - max(others, default=-np.inf)


def _gained(gain: Mapping[str, float], quantity: Callable[[str], str]) -> str:
    """What a discrepancy gains in ln evidence, channel by channel; where it does not, why it is taken."""
    total = sum(gain.values())
    if total < 0.0:
        return f"lacks {nats(-total)} in ln evidence, too little to count on the curve alone"
    return f"gains {', '.join(f'{nats(g)} ({quantity(c)})' for c, g in gain.items())} in ln evidence"


@dataclass(frozen=True, slots=True, eq=False)
class _Description:
    """What a noise model, with or without discrepancies, makes of the residuals."""

    ln_evidence: float
    gain: Mapping[str, float]
    bases: Bases
    estimate: tuple[Mapping[str, Floats], ...]
    temperature_sd: tuple[float, ...]
    innovations: tuple[Mapping[str, Floats], ...]
    longest_memory: tuple[Mapping[str, float], ...]

    @property
    def supported(self) -> float:
        """The evidence less what a discrepancy must earn before another noise model: as much as a memory."""
        gained = sum(g for g in self.gain.values() if np.isfinite(g)) if any(self.bases) else 0.0
        return self.ln_evidence - min(LEAST_LN_EVIDENCE_GAIN, gained)


def _sweeps_apart(bases: Sequence[Mapping[str, DiscrepancyBasis]]) -> bool:
    """Whether sweeps have something of their own beside any discrepancy."""
    return any(basis.sweep_functions is not None for own in bases for basis in own.values())


@dataclass(frozen=True, slots=True)
class _Signs:
    """What series of innovations show."""

    memory: bool = False
    tails: bool = False
    slope: bool = False

    def joined(self, other: _Signs) -> _Signs:
        """What either shows."""
        return _Signs(self.memory or other.memory, self.tails or other.tails, self.slope or other.slope)

    @staticmethod
    def of(e: Floats, steps: Steps, slope: Floats, at: Bools) -> _Signs:
        """Signs in one series (n,): neighbours alike in the readings `at` (n,), tails, sizes like the squared slope."""
        n, square = e.size, float(np.mean(e**2))
        if not (np.isfinite(square) and square > 0.0 and n > 3):
            return _Signs()
        spread, root = float(np.std(e)), np.sqrt(at.sum())
        kurtosis = float(np.mean(((e - e.mean()) / spread) ** 4)) - 3.0 if spread > 0.0 else 0.0
        return _Signs(
            abs(float(lag1(np.where(at, e, 0.0), steps.first))) * root > LEAST_STANDARD_ERRORS,
            kurtosis > LEAST_STANDARD_ERRORS * float(np.sqrt(24.0 / n)),
            _correlation(_log_size(e), slope**2) * np.sqrt(n) > LEAST_STANDARD_ERRORS,
        )


def _log_size(e: Floats) -> Floats:
    """Logarithm of the size of a series (n,), which outliers hardly move."""
    return np.asarray(np.log(np.maximum(np.abs(e), 1e-3 * np.sqrt(np.mean(e**2)))))


def _following(e: Floats, x: Floats) -> float:
    """How far the size of a series (n,) follows another, in standard errors.

    By its squares, whose score that is where the noise is normal, or by its logarithm: whichever shows more.
    """
    largest = float(np.max(np.abs(e), initial=0.0))
    if not (np.isfinite(largest) and largest > 0.0 and e.size > 3):
        return 0.0
    relative = e / largest  # whose fourth powers are finite whatever the noise
    return max(abs(_correlation(y, x)) for y in (relative**2, _log_size(relative))) * float(np.sqrt(e.size))


def _correlation(x: Floats, y: Floats) -> float:
    """Pearson's correlation; zero of none, and where one of the two does not vary or is not finite."""
    if not x.size:
        return 0.0
    a, b = x - x.mean(), y - y.mean()
    size = float(np.sqrt((a @ a) * (b @ b)))
    return float(a @ b) / size if np.isfinite(size) and size > 0.0 else 0.0


class _Residuals:
    """Residuals of the warm start, to be described by noise models and discrepancies."""

    def __init__(
        self,
        posterior: Posterior,
        start: WarmStart,
        priors: PriorSet,
        discrepancy: bool,
        allowed_loss: float,
    ) -> None:
        self.posterior = posterior
        self.start = start
        self.priors = priors
        self.allowed_loss = allowed_loss
        self.descriptions: dict[str, _Description] = {}
        self.curves_alone = False
        self.alone: dict[tuple[str, int, str, float | None], _FittedNoise] = {}
        theta = start.theta
        with np.errstate(all="ignore"):
            self.slope = [posterior.model.slope(theta, r.inputs) for r in posterior.records]
        self.moments = fitted_moments(posterior, start)
        self.residual = [
            {c: r.observed[c] - m.mean[c] for c in r.channels}
            for r, m in zip(posterior.records, self.moments, strict=True)
        ]
        self.scales = [RecordScales.of([r]) for r in posterior.records]
        self.quiet = [quiet(r, m) for r, m in zip(posterior.records, self.moments, strict=True)]
        self.bases: Bases = tuple({} for _ in posterior.records)
        if discrepancy:
            self.bases = discrepancy_bases(posterior, theta)
            smooth = self._smooth()
            if any(smooth):
                self.bases = discrepancy_bases(posterior, theta, smooth)

    def with_sweeps_apart(self) -> _Residuals | None:
        """The same with what each sweep has of its own beside discrepancies; None where no record has such sweeps."""
        theta, model, free = self.start.theta, self.posterior.model, self.posterior.sampled_model
        bases = []
        for record, own in zip(self.posterior.records, self.bases, strict=True):
            found = {}
            for channel, basis in own.items():
                at_nodes = {**_constant(record), "temperature": basis.temperature}
                with np.errstate(all="ignore"):
                    tangents = [model.jacobian(theta, x)[channel][:, free] for x in (record.inputs, at_nodes)]
                found[channel] = replace(
                    basis, sweep_functions=SweepFunctions.of(record.inputs, basis.temperature, *tangents)
                )
            bases.append(found)
        if not _sweeps_apart(bases):
            return None
        other = copy(self)
        other.bases, other.descriptions = tuple(bases), {}
        return other

    @property
    def signs_of_simplest(self) -> _Signs:
        """What independent normal noise leaves."""
        return self.signs(self.described(NOISE_MODELS[SIMPLEST]))

    def signs(self, description: _Description) -> _Signs:
        """What the innovations of a description, and the plain residuals, show."""
        found = _Signs()
        for i, record in enumerate(self.posterior.records):
            for channel in record.channels:
                steps, slope, at = self.steps(i, channel), self.slope[i][channel], self.quiet[i][channel]
                for e in (description.innovations[i][channel], self.residual[i][channel]):
                    found = found.joined(_Signs.of(e, steps, slope, at))
        return found if not self.bent else replace(found, tails=False, slope=False)

    def may_grow(self, description: _Description) -> bool:
        """Whether noise that grows with the response may gain what it must.

        Twice what is gained in ln likelihood is to first order the squared score in standard errors, of all channels
        together, and the evidence gains less. That holds for the innovations of a description. What independent noise
        leaves may have a memory, with which standard errors are greater, and has to show `GROWTH_STANDARD_ERRORS`.
        """
        squared = 0.0
        for i, record in enumerate(self.posterior.records):
            for channel in record.channels:
                at = self.quiet[i][channel]  # in the others an error of the thermometer shows
                response = self.response(i, channel)[at]
                simplest = self.described(NOISE_MODELS[SIMPLEST]).innovations[i][channel]
                if any(
                    _following(e[at], response) > GROWTH_STANDARD_ERRORS
                    for e in (simplest, self.residual[i][channel])
                ):
                    return True
                squared += _following(description.innovations[i][channel][at], response) ** 2
        return squared > 2.0 * LEAST_LN_EVIDENCE_GAIN_OF_VARIANCE

    def steps(self, i: int, channel: str) -> Steps:
        """How samples follow each other: none remembers a loud one, in which the error of the thermometer shows.

        That error is skewed there, and in a steady sweep its mean at one instant is not its mean at one reading.
        """
        steps, loud = self.posterior.steps[i], ~self.quiet[i][channel]
        return replace(steps, first=steps.first | loud | np.concatenate([[False], loud[:-1]]))

    def coarse(self, description: _Description) -> dict[str, float]:
        """Channels with readings in steps of more than `VISIBLE_ROUNDING_STEP` standard deviations of their noise.

        Returns
        -------
        dict of str to float
            The step over the standard deviation of what is left, in which rounding has its share of ``q**2/12``.
        """
        found: dict[str, float] = {}
        if self.bent:
            return found
        least = VISIBLE_ROUNDING_STEP / np.sqrt(1.0 + VISIBLE_ROUNDING_STEP**2 / 12.0)
        for scales, own in zip(self.scales, description.estimate, strict=True):
            for channel, values in own.items():
                ratio = scales.step[channel] / float(values[0])
                if ratio > max(least, found.get(channel, 0.0)):
                    found[channel] = ratio
        return found

    @property
    def bent(self) -> bool:
        """Whether the thermometer is known to err: to the moments that are looked at here that seems like tails."""
        return any(r.temperature_sd > 0.0 for r in self.posterior.records)

    def response(self, i: int, channel: str) -> Floats:
        """Response of the curve as a share of its observed range, shape (n,)."""
        low, span = self.posterior.observed_range(i, channel)
        return np.asarray((self.moments[i].mean[channel] - low) / span)

    def _smooth(self) -> tuple[Mapping[str, Curve], ...]:
        """What the first bases find the curves to miss: the second lie closer where it changes."""
        found = []
        for i, own in enumerate(self.bases):
            curves: dict[str, Curve] = {}
            for channel, basis in own.items():
                look = self._look(NOISE_MODELS[SIMPLEST], i, channel, basis)
                if look.weights is not None:
                    curves[channel] = partial(basis.function, look.weights[None])
            found.append(curves)
        return tuple(found)

    def without_discrepancy(self) -> _Residuals:
        """The same where no discrepancy stands beside the curves; a memory is no longer than where one may."""
        other = copy(self)
        other.curves_alone, other.descriptions = True, {}
        return other

    def described(self, noise: NoiseModel) -> _Description:
        """What a noise model makes of the residuals; looked at once."""
        if noise.name not in self.descriptions:
            self.descriptions[noise.name] = self._described(noise)
        return self.descriptions[noise.name]

    def _described(self, noise: NoiseModel) -> _Description:
        total, gain = 0.0, dict.fromkeys(self.posterior.records[0].channels, 0.0)
        found: dict[tuple[int, str], tuple[_FittedNoise, _FittedNoise | None]] = {}
        for i, record in enumerate(self.posterior.records):
            for channel in record.channels:
                alone = self._look_alone(noise, i, channel)
                usable = noise.is_density and not (noise.stands_alone and self.bent)
                basis = self.bases[i].get(channel) if usable else None
                bound = self._longest_beside(noise, i, basis)
                beside = None
                if basis is not None and not self.curves_alone:
                    beside = self._look(noise, i, channel, basis, bound)
                if bound is not None and not self._is_noise(noise, i, alone):
                    alone = self._look_alone(noise, i, channel, bound)
                found[i, channel] = (alone, beside)
                gain[channel] += -np.inf if beside is None else beside.ln_evidence - alone.ln_evidence
        # beside a memory, which a smooth misfit resembles, it has to earn its place as the memory has
        enough = LEAST_LN_EVIDENCE_GAIN if noise.autocorrelated else 0.0
        if noise.is_gaussian and not noise.autocorrelated:
            enough = -self.allowed_loss
        stands = sum(g for g in gain.values() if np.isfinite(g)) > enough
        bases: list[dict[str, DiscrepancyBasis]] = []
        estimate: list[dict[str, Floats]] = []
        innovations: list[dict[str, Floats]] = []
        spread, longest = [], []
        for i, record in enumerate(self.posterior.records):
            own, values, series, bounds, errors = {}, {}, {}, {}, [0.0]
            for channel in record.channels:
                alone, beside = found[i, channel]
                taken = alone
                if beside is not None and stands and np.isfinite(gain[channel]):
                    taken = beside
                    own[channel] = self.bases[i][channel]
                total += taken.ln_evidence if self._is_noise(noise, i, taken) else -np.inf
                values[channel] = taken.theta
                series[channel] = taken.innovations
                if taken.longest_memory is not None:
                    bounds[channel] = taken.longest_memory
                errors.append(taken.temperature_sd)
            bases.append(own)
            estimate.append(values)
            innovations.append(series)
            spread.append(max(errors))
            longest.append(bounds)
        return _Description(
            total, gain, tuple(bases), tuple(estimate), tuple(spread), tuple(innovations), tuple(longest)
        )

    def _longest_beside(self, noise: NoiseModel, i: int, basis: DiscrepancyBasis | None) -> float | None:
        """Samples that may count as one beside a discrepancy: as many as there are for each of its functions."""
        if basis is None or not noise.autocorrelated:
            return None
        return max(MAX_MEMORY_SAMPLES, self.posterior.steps[i].longest / basis.count)

    def _is_noise(self, noise: NoiseModel, i: int, found: _FittedNoise) -> bool:
        """Whether a memory is shorter than half a sweep; one as long as the sweep is misfit, whatever it is called."""
        if not noise.autocorrelated:
            return True
        steps = self.posterior.steps[i]
        return noise.memory(noise.shape_of(found.theta), steps) < MAX_MEMORY_SWEEPS * steps.longest

    def _look_alone(
        self, noise: NoiseModel, i: int, channel: str, longest_memory: float | None = None
    ) -> _FittedNoise:
        """Without a discrepancy; looked at once, whatever else may stand beside the curves."""
        key = (noise.name, i, channel, longest_memory)
        if key not in self.alone:
            self.alone[key] = self._look(noise, i, channel, None, longest_memory)
        return self.alone[key]

    def _look(
        self,
        noise: NoiseModel,
        i: int,
        channel: str,
        basis: DiscrepancyBasis | None,
        longest_memory: float | None = None,
    ) -> _FittedNoise:
        record = self.posterior.records[i]
        scales = self.scales[i].with_residual({channel: self.start.fit[i][channel].rmse})
        if longest_memory is not None:
            scales = scales.with_longest_memory({channel: longest_memory}, self.posterior.steps[i].typical)
        space, slots = _space(self.priors, noise, record, channel, basis, scales)
        _, span = self.posterior.observed_range(i, channel)
        residual = _solid(self.residual[i][channel], record.observed[channel])
        tangents = self.moments[i].jacobian[channel][:, self.posterior.sampled_model]
        density = _ResidualDensity(
            space, noise, self.steps(i, channel), residual, _orthonormal(tangents), basis, slots,
            self.slope[i][channel], self.moments[i].variance[channel], self.response(i, channel),
            CHANGE_SD_RANGES * span * np.sqrt(record.n),
        )  # fmt: skip
        climbed = find_modes(density, density.starts(), space.prior_sd())
        modes = [m for m in climbed if m is not None]
        if not modes:
            centre = space.constrain(space.prior_centre())
            return _FittedNoise(-np.inf, centre, 0.0, None, residual, longest_memory)
        best = max(modes, key=lambda m: m.mass)
        theta = space.constrain(best.z)
        felt_at = slots.temperature_sd
        own = theta if felt_at is None else np.delete(theta, felt_at)
        felt = 0.0 if felt_at is None else float(theta[felt_at])
        return _FittedNoise(best.ln_integral, own, felt, *density.explained(best.z), longest_memory)


@dataclass(frozen=True, slots=True, eq=False)
class _FittedNoise:
    ln_evidence: float
    theta: Floats
    temperature_sd: float
    weights: Floats | None
    innovations: Floats
    longest_memory: float | None


@dataclass(frozen=True, slots=True)
class _Slots:
    """Positions among the parameters of one channel: sizes of a discrepancy and between sweeps, thermometer's sd."""

    size: int | None
    between: int | None
    temperature_sd: int | None


def _space(
    priors: PriorSet,
    noise: NoiseModel,
    record: Record,
    channel: str,
    basis: DiscrepancyBasis | None,
    scales: RecordScales,
) -> tuple[ParameterSpace, _Slots]:
    """Parameters of the noise of one channel of one record with their priors; that of ``sd`` is wide."""
    facts = list(noise.parameters(channel, record.units[channel], record.units.get("time", "s")))
    size = between = felt = None
    if basis is not None:
        size = len(facts)
        facts.append(size_fact(channel, record.units[channel]))
        if basis.sweep_functions is not None:
            between = len(facts)
            facts.append(between_sweeps_fact(channel, record.units[channel]))
    if noise.feels_temperature:
        felt = len(facts)
        facts.append(temperature_sd_fact(record.units["temperature"]))
    parameters = [priors.parameter(fact, record.branch, scales, noise=True) for fact in facts]
    wide = LogNormal(0.5 * scales.residual[channel], LN_NOISE_SD)
    parameters[0] = replace(parameters[0], prior=wide, fixed=None)
    return ParameterSpace(tuple(parameters)), _Slots(size, between, felt)


@dataclass(frozen=True, slots=True, eq=False)
class _ResidualDensity:
    """Density of the noise of one channel of one record, given what the least-squares curve leaves.

    Changes of the curve along its tangents, and the weights of a discrepancy, are integrated out.

    Attributes
    ----------
    space : ParameterSpace
    noise : NoiseModel
    steps : Steps
    residual : ndarray, shape (n,)
        [unit of the channel]
    tangents : ndarray, shape (p, n)
        Orthonormal.
    basis : DiscrepancyBasis or None
    slots : _Slots
    slope : ndarray, shape (n,)
        Of the response with respect to temperature.
    declared : ndarray, shape (n,)
        Variance that the declared error of the thermometer makes.
    response : ndarray, shape (n,)
        Response as a share of its observed range.
    reach : float
        Standard deviation of the amount of each tangent [unit of the channel].
    """

    space: ParameterSpace
    noise: NoiseModel
    steps: Steps
    residual: Floats
    tangents: Floats
    basis: DiscrepancyBasis | None
    slots: _Slots
    slope: Floats
    declared: Floats
    response: Floats
    reach: float

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the coordinates."""
        return tuple(p.name for p in self.space.free)

    def draw_prior(self, rng: np.random.Generator, size: int) -> Floats:
        """Draws from the prior (size, D)."""
        return self.space.draw(rng, size)

    def log_prob(self, z: Floats) -> Floats:
        """Log of the density (W,); never NaN."""
        theta = self.space.constrain(np.atleast_2d(z))
        with np.errstate(all="ignore"):
            value = self.space.log_prior(z) + self._whitened(theta).marginal_log_density()
        return np.where(np.isnan(value), -np.inf, value)

    def explained(self, z: Floats) -> tuple[Floats | None, Floats]:
        """Likeliest weights (m,) of the discrepancy at a point (D,), if there is one, and innovations (n,)."""
        theta = self.space.constrain(z[None])
        with np.errstate(all="ignore"):
            whitened = self._whitened(theta)
            found = whitened.likeliest_weights()
            e = whitened.e - whitened.likeliest_series()
            innovations = np.nan_to_num(self.noise.innovations(e, whitened.shape, self.steps)[0])
        if self.basis is None or not np.isfinite(found).all():
            return None, innovations
        return found[0, : self.basis.count], innovations

    def _whitened(self, theta: Floats) -> Whitened:
        scale = theta[:, :1]
        shape = self.noise.shape_of(theta)
        relative = self.noise.relative_scale(shape, self.response)
        if relative is not None:
            scale = scale * relative
        felt = self.slots.temperature_sd
        if felt is not None:
            scale = np.sqrt(scale * scale + (theta[:, felt, None] * self.slope) ** 2)
        elif self.declared.any():
            scale = np.sqrt(scale * scale + self.declared)
        rows, sizes = self.tangents, np.full((len(theta), len(self.tangents)), self.reach)
        own = between = None
        if self.basis is not None and self.slots.size is not None:
            rows = np.concatenate([self.basis.rows, rows])
            size = np.repeat(theta[:, self.slots.size, None], self.basis.count, axis=1)
            if self.slots.between is not None:
                own, between = self.basis.sweep_functions, theta[:, self.slots.between]
            sizes = np.concatenate([size, sizes], axis=1)
        e = self.residual / scale
        return Whitened(self.noise, shape, self.steps, e, scale, rows, sizes, own, between)

    def starts(self) -> list[Floats]:
        """Where to climb from: what is left is noise of one kind, or mostly smooth with a little noise."""
        own = self.noise.estimate(self.residual, self.steps)
        small = min(max(_scatter(self.residual, self.steps), 1e-3 * float(own[0])), float(own[0]))
        smooth = max(float(np.mean(self.residual**2)) - small**2, (0.1 * small) ** 2) ** 0.5
        found = []
        for sd, size, felt in ((float(own[0]), 0.2 * float(own[0]), 0.1), (small, smooth, 1.0)):
            theta = self.space.constrain(self.space.prior_centre())
            theta[: own.size] = own
            if size == smooth and self.noise.autocorrelated:  # the memory was that of what is smooth
                theta[1 : own.size] = _forgetful(self.noise, self.steps, own)
            theta[0] = sd
            if self.slots.size is not None:
                theta[self.slots.size] = size
            if self.slots.between is not None:
                theta[self.slots.between] = size
            if self.slots.temperature_sd is not None:
                steepest = float(np.max(np.abs(self.slope))) or 1.0
                theta[self.slots.temperature_sd] = felt * own[0] / steepest
            z = self.space.unconstrain(theta)
            found.append(np.asarray(np.where(np.isfinite(z), z, self.space.prior_centre())))
            if z.size == 1 and self.noise.is_gaussian:  # of a standard deviation alone there is one mode
                break
        return found


def _forgetful(noise: NoiseModel, steps: Steps, own: Floats) -> Floats:
    """Parameters after ``sd`` of a noise model, estimated from a series without memory of the same scale."""
    white = own[0] * np.random.default_rng(0).standard_normal(steps.first.size)
    return noise.estimate(white, steps)[1:]


def _scatter(residual: Floats, steps: Steps) -> float:
    """Scatter from reading to reading: robust standard deviation of second differences within sweeps, over sqrt 6."""
    inner = ~steps.first
    usable = inner[1:-1] & inner[2:]
    second = (residual[2:] - 2.0 * residual[1:-1] + residual[:-2])[usable]
    if second.size < 4:
        return float(np.std(residual))
    return float(MAD_TO_SD * np.median(np.abs(second)) / np.sqrt(6.0))


def _orthonormal(tangents: Floats) -> Floats:
    """Orthonormal rows (r, n) that span the tangents (n, p)."""
    usable = np.isfinite(tangents).all(axis=0)
    scaled = tangents[:, usable] / np.maximum(np.abs(tangents[:, usable]).max(axis=0), 1e-300)
    u, singular, _ = np.linalg.svd(scaled, full_matrices=False)
    return np.asarray(u[:, singular > 1e-10 * max(float(singular.max(initial=0.0)), 1e-300)].T)


Curve = Callable[[Floats], Floats]
"""Temperatures (g,) to values (1, g)."""


def discrepancy_bases(
    posterior: Posterior,
    theta: Floats,
    beside: Sequence[Mapping[str, Curve]] | None = None,
    *,
    with_response: bool = False,
) -> Bases:
    """Basis of a discrepancy for each channel of each record, kept off the tangents of the curve at parameters (P,).

    Channels with too few samples for one are left out.

    Parameters
    ----------
    posterior : Posterior
    theta : ndarray, shape (P,)
    beside : sequence of mapping, optional
        For each record, channel to what is known already of its discrepancy: the basis lies closer where curve and
        discrepancy together change faster.
    with_response : bool
        Whether it changes only where the curve does; see `build_basis`.
    """
    model, free = posterior.model, posterior.sampled_model
    found = []
    for i, record in enumerate(posterior.records):
        low, high = float(record.temperature.min()), float(record.temperature.max())
        own: dict[str, DiscrepancyBasis] = {}
        if high > low:
            fine = np.linspace(low, high, BASIS_GRID_POINTS)
            with np.errstate(all="ignore"):
                curve = model.predict(theta, {**_constant(record), "temperature": fine})
                tangents = model.jacobian(theta, record.inputs)
            for channel in record.channels:
                known = (beside or [{}] * (i + 1))[i].get(channel)
                whole = curve[channel] if known is None else curve[channel] + known(fine)[0]
                nodes = nodes_of(low, high, fine, whole)
                at_nodes = {**_constant(record), "temperature": nodes}
                with np.errstate(all="ignore"):
                    basis = build_basis(
                        record.temperature,
                        nodes,
                        np.interp(nodes, fine, whole),
                        tangents[channel][:, free],
                        model.jacobian(theta, at_nodes)[channel][:, free],
                        with_response=with_response,
                    )
                if basis is not None:
                    own[channel] = basis
        found.append(own)
    return tuple(found)


def _constant(record: Record) -> dict[str, Floats]:
    """Inputs of a record that are the same for all its samples."""
    return {name: values[:1] for name, values in record.inputs.items() if np.ptp(values) == 0.0}


def posterior_with(
    name: str, posterior: Posterior, start: WarmStart, priors: PriorSet, choice: NoiseChoice | None = None
) -> Posterior:
    """The posterior of the same records with another noise model, its priors scaled to the residuals.

    With a `choice` also with its discrepancies, and with priors scaled to the noise that it found beside them.
    """
    left = [{channel: g.rmse for channel, g in fit.items()} for fit in start.fit]
    if choice is not None and choice.estimate:
        left = [{c: float(values[0]) for c, values in own.items()} for own in choice.estimate]
    memory = [
        {c: memory_of(r[c], s) for c in r} for r, s in zip(start.residual, posterior.steps, strict=True)
    ]
    return build_posterior(
        posterior.records,
        NOISE_MODELS[name],
        priors,
        model=posterior.model,
        residual=left,
        memory=memory,
        longest_memory=choice.longest_memory if choice is not None and choice.longest_memory else None,
        discrepancy=choice.bases if choice is not None and any(choice.bases) else None,
    )


def neighbour_correlation(posterior: Posterior, start: WarmStart) -> dict[str, float]:
    """Correlation of neighbouring residuals of the warm start, by channel; the median over records."""
    pairs = list(zip(start.residual, posterior.steps, strict=True))
    return {
        c: float(np.median([lag1(r[c], s.first) for r, s in pairs])) for c in posterior.records[0].channels
    }


def noise_start(posterior: Posterior, start: WarmStart, choice: NoiseChoice | None = None) -> Floats:
    """Sampled coordinates (D,) of the warm start, with what stands beside the curve as estimated from its residuals."""
    space = posterior.space
    theta = space.constrain(space.prior_centre())
    theta[: start.theta.size] = start.theta
    for i, (record, place, steps, residual) in enumerate(
        zip(posterior.records, posterior.layout, posterior.steps, start.residual, strict=True)
    ):
        known = choice.estimate[i] if choice is not None and choice.estimate else {}
        for channel, at in place.noise.items():
            if channel in known:
                theta[at] = known[channel][: at.size]
                if channel in place.size:
                    theta[place.size[channel]] = known[channel][at.size]
                if channel in place.between:
                    theta[place.between[channel]] = known[channel][at.size + 1]
            else:
                theta[at] = posterior.noise.estimate(
                    _solid(residual[channel], record.observed[channel]), steps
                )
        if place.temperature_sd is not None and choice is not None and choice.temperature_sd:
            theta[place.temperature_sd] = choice.temperature_sd[i]
    z = space.unconstrain(theta)
    return np.where(np.isfinite(z), z, space.prior_centre())


def _solid(residual: Floats, observed: Floats) -> Floats:
    """Residuals, or where the fit is exact, of a size that rounding would leave."""
    if float(np.max(np.abs(residual))) > 0.0:
        return residual
    return np.full_like(residual, 1e-12 * max(float(np.max(np.abs(observed))), 1e-300))


def _uneven(steps: Steps) -> bool:
    if not steps.timed:
        return False
    dt = steps.dt[~steps.first]
    return dt.size > 2 and float(np.std(dt)) > EVEN_STEP_TOLERANCE * float(np.mean(dt))
