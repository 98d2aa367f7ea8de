"""Every sweep as a common curve with four numbers: offset, stroke, shift in temperature, width.

The shape-invariant model: a sweep of a channel reads

    y(T) = L + S a + exp(g) (f(m + (T - m - d) exp(-w)) - L)

with the curve f that all sweeps of the branch have in common, its level L halfway between the ends of the measured
temperatures, its span S between them, and the temperature m at which it is at L. The four numbers of each sweep are a
(offset over span), g (ln stroke), d (shift [K]) and w (ln width). The curve is a response model, and what this misses
of all sweeps alike: a discrepancy (`sma_bayes.fitting.discrepancy`) that can't take the place of the four numbers, its
size decided by evidence. Curve and numbers are found in turn.
What is left has a memory within a sweep; standard deviations of the numbers allow for it. It is what each sweep has of
its own shape, and noise (`sma_bayes.studies.cycles.own_shape`).

References
----------
W. H. Beath, Stat. Med. 26 (2007) 2547 and T. J. Cole et al., Int. J. Epidemiol. 39 (2010) 1558: the shape-invariant
model with random effects.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np
from scipy import optimize
from scipy.signal import lfilter

from sma_bayes.arrays import Bools, Floats, Ints
from sma_bayes.errors import MeasurementError
from sma_bayes.fitting.discrepancy import DiscrepancyBasis, build_basis, nodes_of
from sma_bayes.fitting.discrepancy_weights import WeightsGivenResiduals, weights_given_residuals
from sma_bayes.fitting.fit import calibrations_of
from sma_bayes.fitting.posterior import build_posterior
from sma_bayes.fitting.warm_start import warm_start
from sma_bayes.noise import NOISE_MODELS
from sma_bayes.noise.base import lag1
from sma_bayes.records.types import Record
from sma_bayes.response import AUTO_MODEL, RESPONSE_MODELS, ladder
from sma_bayes.response.base import ResponseModel
from sma_bayes.studies.cycles.own_shape import (
    CycleScatter,
    OwnShape,
    OwnShapeToCome,
    SweepResidual,
    scatter_of,
)

NUMBERS: Final = ("offset", "stroke", "shift", "width")
PRIOR_SD: Final = np.array([0.5, 0.5, 20.0, 0.5])
"""How far the numbers may go: offset in spans, ln stroke, shift [K], ln width."""
USUAL_SCATTER: Final = np.array([0.02, 0.05, 1.0, 0.1])
"""How well one specimen in one rig usually repeats, in the same units."""
LEAST_SAMPLES: Final = 8
"""Fewest samples of a sweep that gets numbers of its own."""
MAX_ROUNDS: Final = 60
"""Most rounds of curve and numbers."""
BASES: Final = 2
"""How often functions that the common curve misses are laid over the temperatures of all sweeps moved onto it."""
MAX_EVALUATIONS: Final = 20
"""Most evaluations of the curve in one of them."""
RELATIVE_TOLERANCE: Final = 1e-3
"""Share by which what is left may still shrink in the last."""
MAX_ITERATIONS: Final = 30
EXTRA_DECAY_POWER: Final = 2
"""Power of their number by which functions that the common curve misses are smaller than those of a single fit: those
of a quintic smoothing spline, since the stiffness asks for slopes."""
GRID_POINTS: Final = 1000
"""Temperatures at which the curve is looked at, to spread these functions over it."""
LEAST_NOISE: Final = 1e-4
"""Least noise that is reckoned with [spans]."""
LEAST_SHAPE_SHARE: Final = 1e-6
"""Share of what parameters do to the curve (squares) and four numbers can't, below which it is rounding."""
GREATEST_MEMORY: Final = 0.9
MOST_SAMPLES: Final = 200
"""Samples of a sweep from which what least squares takes of the noise is told."""
TEMPERATURE_STEP: Final = 0.01
"""Step of finite differences in temperature [K]."""


@dataclass(frozen=True, slots=True, eq=False)
class Strand:
    """All sweeps of one channel of a record.

    Attributes
    ----------
    record : Record
        With the one channel, its sweeps one after the other.
    channel : str
    starts : ndarray of int, shape (n,)
        First sample of each sweep.
    cycle : ndarray, shape (n,)
    numbers, sds : ndarray, shape (n, 4)
        The numbers of each sweep by itself, and their standard deviations.
    model : ResponseModel
    theta : ndarray
        Of the common curve.
    free : ndarray of int
        Positions of the parameters that are estimated.
    level, span, middle : float
        L and S [unit of the channel], m [unit of temperature].
    noise : float
        Standard deviation of what is left [unit of the channel].
    lag1_correlation : float
        Of neighbours in a sweep.
    converged : bool
        Whether curve and numbers have settled.
    missed : DiscrepancyBasis, optional
        Of what the response model misses of all sweeps alike [unit of the channel], against temperature on the curve.
    weights : WeightsGivenResiduals, optional
        Of its functions.
    shape : ndarray, shape (free, r)
        Errors of the free parameters that change the shape of the curve, as no four numbers do: each column is one of
        one standard deviation, independent of the others.
    responses : ndarray, shape (n, 4, m + r), optional
        By how much the numbers of each sweep change with each error of the curve, see `errors`.
    scatter : CycleScatter, optional
        Of readings about the curve of their sweep, and of what sweeps have of their own.
    own : tuple of OwnShape or None
        What each sweep has of its own beside curve and numbers; None of one with too few samples. Empty where sweeps
        have nothing of their own.
    """

    record: Record
    channel: str
    starts: Ints
    cycle: Floats
    numbers: Floats
    sds: Floats
    model: ResponseModel
    theta: Floats
    free: Ints
    level: float
    span: float
    middle: float
    noise: float = 0.0
    lag1_correlation: float = 0.0
    converged: bool = False
    missed: DiscrepancyBasis | None = None
    weights: WeightsGivenResiduals | None = None
    shape: Floats = field(default_factory=lambda: np.zeros((0, 0)))
    responses: Floats | None = None
    scatter: CycleScatter | None = None
    own: tuple[OwnShape | None, ...] = ()

    @property
    def units(self) -> dict[str, str]:
        """Unit of each of the numbers of a sweep."""
        temperature = self.record.units["temperature"]
        shift = "K" if temperature == "degC" else temperature
        return dict(zip(NUMBERS, (self.unit, self.unit, shift, "1"), strict=True))

    def in_units(self, name: str, value: Floats) -> Floats:
        """One of the numbers about the common curve as it was fitted, in its unit."""
        with np.errstate(over="ignore"):
            if name == "offset":
                return np.asarray(self.level + self.span * value)
            if name == "shift":
                return value
            return np.asarray(np.exp(value) * (1.0 if name == "width" else self.span))

    @property
    def unit(self) -> str:
        """Unit of the channel."""
        return self.record.units[self.channel]

    @property
    def ends(self) -> tuple[float, float]:
        """Lowest and highest measured temperature."""
        return float(self.record.temperature.min()), float(self.record.temperature.max())

    @property
    def range(self) -> float:
        """Between the least and the greatest measured value."""
        return float(np.ptp(self.record.observed[self.channel]))

    def common(self, temperature: Floats, errors: Floats | None = None) -> Floats:
        """The common curve; with its errors in each of S draws where they are given."""
        curve = self.smooth(temperature)
        expected = np.zeros(0) if self.weights is None else self.weights.expected
        if errors is not None:
            drawn = errors + np.concatenate([expected, np.zeros(errors.shape[1] - expected.size)])
            curve = curve + np.einsum("s...m,sm->s...", self.error_functions(temperature), drawn)
        elif expected.size:
            curve = curve + self._missed_at(temperature) @ expected
        return np.asarray(curve)

    def errors(self, size: int, rng: np.random.Generator) -> Floats | None:
        """Errors of the common curve in S draws: weights of `error_functions`, (S, m + r); None where it has none."""
        found = [] if self.weights is None else [self.weights.draw(size, rng) - self.weights.expected]
        if self.shape.shape[1]:
            found.append(rng.standard_normal((size, self.shape.shape[1])))
        return np.concatenate(found, axis=1) if found else None

    def own_shape(self, sweep: int | None) -> OwnShape | OwnShapeToCome | None:
        """What one sweep has of its own, or one to come (None); None where that is nothing."""
        if sweep is not None:
            return self.own[sweep] if self.own else None
        some = [o for o in self.own if o is not None]
        return OwnShapeToCome.of(some[len(some) // 2 :]) if some else None

    def follow(self, sweep: int | None, numbers: Floats, errors: Floats | None) -> Floats:
        """Numbers (S, 4) of one sweep, or of one to come, beside errors (S, m + r) of the common curve."""
        if self.responses is None or errors is None:
            return numbers
        responses = self.responses.mean(axis=0) if sweep is None else self.responses[sweep]
        return np.asarray(numbers + errors @ responses.T)

    @property
    def reading_noise(self) -> float:
        """Standard deviation of a reading about the curve of its sweep [unit of the channel]."""
        return self.noise if self.scatter is None else self.scatter.noise

    @property
    def own_rms(self) -> float:
        """Root mean square over all samples of what sweeps have of their own [unit of the channel]."""
        squares = [np.sum((o.expected @ o.basis.rows) ** 2) for o in self.own if o is not None]
        return float(np.sqrt(sum(squares) / self.record.n))

    def error_functions(self, temperature: Floats) -> Floats:
        """What each error adds to the common curve, shape (..., m + r): of what the model misses, then of its shape."""
        found = [] if self.weights is None else [self._missed_at(temperature)]
        if self.shape.shape[1]:
            found.append(self.tangents_in_parameters(temperature) @ self.shape)
        return np.concatenate(found, axis=-1)

    def _missed_at(self, temperature: Floats) -> Floats:
        assert self.missed is not None
        return self.missed.at(np.clip(temperature, self.missed.temperature[0], self.missed.temperature[-1]))

    def tangents_in_parameters(self, temperature: Floats) -> Floats:
        """Derivatives of the curve of the response model with respect to its free parameters, shape (..., free)."""
        with np.errstate(all="ignore"):
            slopes = self.model.jacobian(self.theta, {"temperature": temperature.ravel()})[self.channel]
        return np.asarray(np.nan_to_num(slopes[:, self.free]).reshape(*temperature.shape, self.free.size))

    def smooth(self, temperature: Floats) -> Floats:
        """That of the response model alone."""
        return self._of(self.theta, temperature)

    def _of(self, theta: Floats, temperature: Floats) -> Floats:
        with np.errstate(all="ignore"):
            out = self.model.predict(theta, {"temperature": temperature.ravel()})[self.channel]
        return np.asarray(out).reshape(temperature.shape)

    def curve(self, numbers: Floats, temperature: Floats, errors: Floats | None = None) -> Floats:
        """Curves of sweeps with some numbers (..., 4) at temperatures that broadcast with (..., 1).

        Where `errors` of the common curve are given, (S, k), the numbers are of as many draws, (S, ..., 4).
        """
        a, g, d, w = (numbers[..., i, None] for i in range(4))
        at = self.middle + (temperature - self.middle - d) * np.exp(-w)
        return np.asarray(self.level + self.span * a + np.exp(g) * (self.common(at, errors) - self.level))

    def slope(self, numbers: Floats, temperature: Floats, errors: Floats | None = None) -> Floats:
        """Their derivatives with respect to temperature."""
        up, down = (
            self.curve(numbers, temperature + by, errors) for by in (TEMPERATURE_STEP, -TEMPERATURE_STEP)
        )
        return (up - down) / (2.0 * TEMPERATURE_STEP)

    def tangents_in_numbers(self, temperature: Floats) -> Floats:
        """What the four numbers do to the curve of the response model, (n, 4)."""
        rise = self.smooth(temperature) - self.level
        slope = (
            self.smooth(temperature + TEMPERATURE_STEP) - self.smooth(temperature - TEMPERATURE_STEP)
        ) / (2.0 * TEMPERATURE_STEP)
        level = np.full(temperature.size, self.span)
        return np.column_stack([level, rise, slope, slope * (temperature - self.middle)])

    def tangents_in_own_numbers(self, numbers: Floats, temperature: Floats) -> Floats:
        """What each number of a sweep does to its curve where it has numbers (n, 4), at temperatures (n,): (n, 4)."""
        t = temperature[:, None]
        slope = self.slope(numbers, t)[:, 0]
        raised = self.curve(numbers, t)[:, 0] - self.level - self.span * numbers[:, 0]
        away = temperature - self.middle - numbers[:, 2]
        return np.column_stack([np.full(t.size, self.span), raised, -slope, -slope * away])

    def part(self, kept: Bools) -> tuple[Record, Floats]:
        """Record and cycles of some of the sweeps."""
        own = np.repeat(kept, self.lengths)
        return _part(self.record, np.flatnonzero(own)), self.cycle[kept]

    def about(self, record: Record, cycle: Floats) -> Strand:
        """Other sweeps, with their numbers about the curve of these."""
        none = np.zeros((cycle.size, 4))
        other = replace(self.of_numbers(cycle, none, none), record=record, starts=_starts(record))
        return _with_sds(_with_numbers(other))

    def of_numbers(self, cycle: Floats, numbers: Floats, sds: Floats) -> Strand:
        """Other sweeps of which no more is known than their numbers about the curve of these."""
        return replace(self, cycle=cycle, numbers=numbers, sds=sds, responses=None, scatter=None, own=())

    @property
    def lengths(self) -> Ints:
        """Samples of each sweep."""
        return np.diff(np.append(self.starts, self.record.n))


def sweeps_of(record: Record, channel: str) -> tuple[Record, Floats, list[str]]:
    """The sweeps of a channel that can have numbers of their own.

    Returns
    -------
    record : Record
        With these sweeps one after the other and the one channel.
    cycle : ndarray, shape (n,)
        Cycle of each.
    left_out : list of str
        What was left out, in words.
    """
    cycles = record.inputs.get("cycle", np.ones(record.n))
    found: dict[float, Ints] = {}
    short: list[str] = []
    double: list[str] = []
    segment = record.inputs["segment"]
    for number, cycle in sorted(set(zip(segment.tolist(), cycles.tolist(), strict=True))):
        own = np.flatnonzero((segment == number) & (cycles == cycle))
        if own.size < LEAST_SAMPLES:
            short.append(f"{cycle:g}")
            continue
        if cycle in found:
            double.append(f"{cycle:g}")
            if own.size <= found[cycle].size:
                continue
        found[cycle] = own
    told = []
    if short:
        told.append(
            f"{record.key}: sweeps of fewer than {LEAST_SAMPLES} samples have no numbers of their own: "
            f"cycle {', '.join(short)}"
        )
    if double:
        told.append(
            f"{record.key}: of two sweeps of a cycle the one with more samples is taken: cycle {', '.join(double)}"
        )
    order = sorted(found)
    rows = np.concatenate([found[c] for c in order]) if order else np.zeros(0, dtype=np.int64)
    alone = replace(record, observed={channel: record.observed[channel]})
    return _part(alone, rows) if order else alone, np.array(order), told


def calibration_remarks(records: Iterable[Record]) -> list[str]:
    """What is said of declared errors of calibrations: they are the same in all sweeps, and in no number of one."""
    uncertain = dict.fromkeys(
        name if name == "temperature" else r.quantity(name)
        for r in records
        for name, c in calibrations_of(r).items()
        if c.is_uncertain
    )
    if not uncertain:
        return []
    return [
        f"what the calibration of {' and '.join(uncertain)} is off by is the same in all sweeps: no change from cycle "
        "to cycle has it, and no interval here; those of the fit do"
    ]


def _part(record: Record, rows: Ints) -> Record:
    """Some rows of a record; a sweep has a cycle of its own, also where nothing lies between it and the next."""
    inputs = {name: values[rows] for name, values in record.inputs.items()}
    observed = {c: values[rows] for c, values in record.observed.items()}
    return replace(record, inputs=inputs, observed=observed, row=record.row[rows])


def fit_strand(record: Record, channel: str, cycle: Floats, model: str, seed: int) -> Strand:
    """Find the common curve and the numbers of each sweep.

    Parameters
    ----------
    record : Record
        Sweeps one after the other, see `sweeps_of`.
    channel : str
    cycle : ndarray, shape (n,)
    model : str
        Name of a response model, or ``auto``: that of the ladder with the least information criterion (BIC) of what is
        left once the memory is taken out.
    seed : int

    Raises
    ------
    MeasurementError
        If the model can't be fitted to the channel, or there are too few samples.
    """
    types = ladder((channel,)) if model == AUTO_MODEL else (RESPONSE_MODELS[model],)
    found = [
        _alternate(record, channel, cycle, t.made_for((record,)), seed)
        for t in types
        if len(types) == 1 or 3 * len(t.made_for((record,)).parameter_names) <= record.n
    ]
    return min(found, key=_criterion)


def _criterion(strand: Strand) -> float:
    innovation = strand.noise**2 * (1.0 - strand.lag1_correlation**2)
    n = strand.record.n
    return n * float(np.log(max(innovation, 1e-300))) + len(strand.model.parameter_names) * float(np.log(n))


def _alternate(record: Record, channel: str, cycle: Floats, model: ResponseModel, seed: int) -> Strand:
    theta, free = _start(record, model, seed)
    none = np.zeros((cycle.size, 4))
    strand = _centred(
        Strand(record, channel, _starts(record), cycle, none, none, model, theta, free, 0.0, 0.0, 0.0)
    )
    strand, first = _settled(_with_numbers(strand), _with_curve)
    second = True
    for _ in range(BASES):
        strand = replace(strand, missed=_missed_basis(strand), weights=None)
        strand, second = _settled(strand, _with_missed)
    strand = _with_numbers(_centred(strand))
    return _with_errors(_with_sds(replace(strand, converged=first and second)))


def _settled(strand: Strand, with_curve: Callable[[Strand], Strand]) -> tuple[Strand, bool]:
    """Curve and numbers in turn, until both leave no less than before, and whether they came to that."""
    left = np.inf
    for _ in range(MAX_ROUNDS):
        strand = _with_numbers(with_curve(strand))
        if strand.noise >= (1.0 - RELATIVE_TOLERANCE) * left:
            return strand, True
        left = strand.noise
    return strand, False


def _with_missed(strand: Strand) -> Strand:
    """With what the response model misses of all sweeps alike, where there are samples enough for it."""
    if strand.missed is None:
        return strand
    return replace(strand, weights=_weights(strand, max(strand.noise, LEAST_NOISE * strand.span)))


def _onto_curve(strand: Strand) -> tuple[Floats, Floats, Floats]:
    """Temperatures and values of all samples moved onto the common curve, and by what their noise grows there."""
    a, g, d, w = _sample_numbers(strand, strand.numbers).T
    y = strand.record.observed[strand.channel]
    at = strand.middle + (strand.record.temperature - strand.middle - d) * np.exp(-w)
    return at, strand.level + (y - strand.level - strand.span * a) * np.exp(-g), np.exp(-g)


def _missed_basis(strand: Strand) -> DiscrepancyBasis | None:
    """Basis of a discrepancy of the common curve that can't take the place of the numbers, nor of its parameters."""
    at = _onto_curve(strand)[0]
    fine = np.linspace(at.min(), at.max(), GRID_POINTS)
    nodes = nodes_of(at.min(), at.max(), fine, strand.smooth(fine))

    shape = _shape_directions(strand, at)

    def tangents(t: Floats) -> Floats:
        return np.column_stack([strand.tangents_in_numbers(t), strand.tangents_in_parameters(t) @ shape])

    basis = build_basis(at, nodes, strand.smooth(nodes), tangents(at), tangents(nodes))
    return None if basis is None else basis.smoother(EXTRA_DECAY_POWER)


def _weights(strand: Strand, noise: float) -> WeightsGivenResiduals:
    """Of the functions that the common curve misses, under independent noise and beside the numbers of each sweep."""
    assert strand.missed is not None
    at, there, grows = _onto_curve(strand)
    design = strand.missed.at(at) / grows[:, None]
    design = _beside_numbers(strand, _rows(strand, strand.numbers), design)
    left = (there - strand.smooth(at)) / grows
    return weights_given_residuals(design.T / noise, left / noise, strand.span)


def _beside_numbers(strand: Strand, rows: Floats, design: Floats) -> Floats:
    """Columns for all samples, less what the numbers of each sweep account for of them."""
    out = np.empty_like(design)
    for own in np.split(np.arange(len(design)), strand.starts[1:]):
        q = np.linalg.qr(rows[own] / np.linalg.norm(rows[own], axis=0))[0]
        out[own] = design[own] - q @ (q.T @ design[own])
    return out


def _start(record: Record, model: ResponseModel, seed: int) -> tuple[Floats, Ints]:
    """Parameters to start from, and positions of those that are not held fixed."""
    posterior = build_posterior((record,), NOISE_MODELS["independent"], model.default_priors(), model=model)
    size = len(model.parameter_names)
    free = [i for i, p in enumerate(posterior.space.parameters[:size]) if p.fixed is None]
    start = warm_start(posterior, np.random.default_rng(seed))
    return np.array(start.theta[:size]), np.array(free, dtype=np.int64)


def _starts(record: Record) -> Ints:
    """First sample of each sweep."""
    segment, cycle = record.inputs["segment"], record.inputs.get("cycle", np.ones(record.n))
    changes = (np.diff(segment, prepend=segment[0] - 1.0) != 0) | (np.diff(cycle, prepend=cycle[0]) != 0)
    return np.flatnonzero(changes)


def _centred(strand: Strand) -> Strand:
    """Level, span and middle of the curve as it is."""
    t = np.linspace(*strand.ends, 400)
    y = strand.common(t)
    level, span = 0.5 * float(y[0] + y[-1]), abs(float(y[-1] - y[0]))
    if not np.isfinite(y).all() or span <= 0.0:
        raise MeasurementError(
            f"{strand.record.key}: {strand.channel} has no curve that sweeps could have in common",
            expected="a transformation that shows in it",
            remedy="choose another --model, or leave the condition out",
        )
    return replace(strand, level=level, span=span, middle=float(t[np.argmin(np.abs(y - level))]))


def _with_curve(strand: Strand) -> Strand:
    """The curve fitted anew to all sweeps, each moved onto it."""
    at, there, _ = _onto_curve(strand)
    moved = replace(
        strand.record, inputs={**strand.record.inputs, "temperature": at}, observed={strand.channel: there}
    )
    model, channel, free = strand.model, strand.channel, strand.free

    def whole(x: Floats) -> Floats:
        theta = strand.theta.copy()
        theta[free] = x
        return theta

    def left(x: Floats) -> Floats:
        with np.errstate(all="ignore"):
            curve = model.predict(whole(x), moved.inputs)[channel]
        return np.asarray(np.nan_to_num((curve - there) / strand.span, nan=1e30, posinf=1e30, neginf=-1e30))

    def jacobian(x: Floats) -> Floats:
        with np.errstate(all="ignore"):
            slopes = model.jacobian(whole(x), moved.inputs)[channel]
        return np.asarray(np.nan_to_num(slopes[:, free] / strand.span))

    if not free.size:
        return strand
    found = optimize.least_squares(
        left, strand.theta[free], jac=jacobian, x_scale="jac", xtol=1e-6, ftol=1e-6, max_nfev=MAX_EVALUATIONS
    )
    return replace(strand, theta=whole(found.x))


def _with_numbers(strand: Strand) -> Strand:
    """The numbers of all sweeps by Levenberg and Marquardt's steps, each held back as `PRIOR_SD` says."""
    noise = max(strand.noise, 0.005 * strand.span if strand.noise == 0.0 else LEAST_NOISE * strand.span)
    hold, p = np.diag(PRIOR_SD**-2), strand.numbers
    damping, eye = np.full(len(p), 1e-3), np.eye(4)
    left, rows = _left(strand, p), _rows(strand, p)
    cost = _cost(strand, left, p, noise)
    for _ in range(MAX_ITERATIONS):
        normal = _sums(rows[:, :, None] * rows[:, None, :], strand) / noise**2 + hold
        uphill = _sums(rows * left[:, None], strand) / noise**2 - p @ hold
        damped = normal + damping[:, None, None] * eye * np.einsum("nii->ni", normal)[:, None, :]
        step = np.linalg.solve(damped, uphill[:, :, None])[:, :, 0]
        tried = p + step
        new = _cost(strand, _left(strand, tried), tried, noise)
        better = new < cost
        damping = np.where(better, damping / 5.0, damping * 5.0)
        gained = np.max(np.where(better, cost - new, 0.0))
        p, cost = np.where(better[:, None], tried, p), np.where(better, new, cost)
        left, rows = _left(strand, p), _rows(strand, p)
        if gained < 1e-6 and not np.any(damping < 1e-1 * ~better):
            break
    return replace(strand, numbers=p, noise=float(np.sqrt(np.mean(left**2))))


def _sample_numbers(strand: Strand, numbers: Floats) -> Floats:
    return np.repeat(numbers, strand.lengths, axis=0)


def _left(strand: Strand, numbers: Floats) -> Floats:
    t = strand.record.temperature[:, None]
    curve = strand.curve(_sample_numbers(strand, numbers), t)[:, 0]
    return np.asarray(strand.record.observed[strand.channel] - curve)


def _rows(strand: Strand, numbers: Floats) -> Floats:
    """What each number does to each sample, (N, 4)."""
    return strand.tangents_in_own_numbers(_sample_numbers(strand, numbers), strand.record.temperature)


def _cost(strand: Strand, left: Floats, p: Floats, noise: float) -> Floats:
    squares = _sums(np.nan_to_num(left, nan=1e150) ** 2, strand) / noise**2
    return np.asarray(squares + np.sum((p / PRIOR_SD) ** 2, axis=1))


def _sums(values: Floats, strand: Strand) -> Floats:
    """Sums over the samples of each sweep."""
    return np.asarray(np.add.reduceat(values, strand.starts, axis=0))


def _with_sds(strand: Strand) -> Strand:
    """Standard deviations of the numbers under noise with a memory (AR(1)) of which least squares knows nothing."""
    left, rows = _left(strand, strand.numbers), _rows(strand, strand.numbers)
    memory, spared = _memory(strand, left, rows)
    noise = max(float(np.sqrt(np.mean(left**2) / spared)), LEAST_NOISE * strand.span)
    hold, sds = np.diag(PRIOR_SD**-2), np.empty_like(strand.numbers)
    for i, own in enumerate(np.split(rows, strand.starts[1:])):
        normal = own.T @ own / noise**2 + hold
        middle = own.T @ _correlated(own, memory) / noise**2 + hold
        inverse = np.linalg.inv(normal)
        sds[i] = np.sqrt(np.diag(inverse @ middle @ inverse))
    return replace(strand, sds=sds, noise=noise, lag1_correlation=memory)


def _with_errors(strand: Strand) -> Strand:
    """With errors of the common curve, how numbers follow them, and what sweeps have of their own."""
    rows, memory = _rows(strand, strand.numbers), strand.lag1_correlation
    correlated = strand.noise * np.sqrt((1.0 + memory) / (1.0 - memory))
    if strand.missed is not None:
        strand = replace(strand, weights=_weights(strand, correlated))
    strand = replace(strand, shape=_shape(strand, rows, correlated))
    common = np.zeros((strand.record.n, 0))
    if strand.missed is not None or strand.shape.shape[1]:
        at, _, grows = _onto_curve(strand)
        common = strand.error_functions(at) / grows[:, None]
        strand = replace(strand, responses=_responses(strand, rows, common))
    sweeps = _residuals(strand, rows, common)
    some = [s for s in sweeps if s is not None]
    if not some:
        return strand
    missed = 0 if strand.missed is None else strand.missed.count
    scatter = scatter_of(some, missed, strand.span, strand.noise)
    expected = np.zeros(some[0].common.shape[1])
    if strand.weights is not None:
        expected[:missed] = strand.weights.expected
    own = iter(scatter.own(some, expected))
    return replace(strand, scatter=scatter, own=tuple(None if s is None else next(own) for s in sweeps))


def _residuals(strand: Strand, rows: Floats, common: Floats) -> list[SweepResidual | None]:
    """What the response model leaves of each sweep beside its numbers, and what errors of the common curve do (N, k).

    None of sweeps of too few samples.
    """
    at, there, grows = _onto_curve(strand)
    beside = _beside_numbers(strand, rows, np.column_stack([common, (there - strand.smooth(at)) / grows]))
    common, left = beside[:, :-1], beside[:, -1]
    return [
        None if basis is None else SweepResidual(left[own], common[own], basis)
        for own, basis in (
            (own, _own_basis(strand, i, strand.record.temperature[own], rows[own]))
            for i, own in enumerate(np.split(np.arange(left.size), strand.starts[1:]))
        )
    ]


def _own_basis(strand: Strand, sweep: int, temperature: Floats, rows: Floats) -> DiscrepancyBasis | None:
    """Of what a sweep may have of its own, orthogonal to what its numbers do to its samples, see `_rows`."""
    numbers = strand.numbers[sweep]
    fine = np.linspace(temperature.min(), temperature.max(), GRID_POINTS)
    nodes = nodes_of(fine[0], fine[-1], fine, strand.curve(numbers, fine))
    tangents = strand.tangents_in_own_numbers(np.broadcast_to(numbers, (nodes.size, 4)), nodes)
    return build_basis(temperature, nodes, strand.curve(numbers, nodes), rows, tangents)


def _shape(strand: Strand, rows: Floats, noise: float) -> Floats:
    """Errors of the parameters that change the shape of the curve, beside the numbers of each sweep, see `Strand`."""
    at, _, grows = _onto_curve(strand)
    directions = _shape_directions(strand, at)
    left = _beside_numbers(strand, rows, strand.tangents_in_parameters(at) @ directions / grows[:, None])
    information, axes = np.linalg.eigh(left.T @ left / noise**2)
    return np.asarray(directions @ axes / np.sqrt(information))


def _shape_directions(strand: Strand, at: Floats) -> Floats:
    """Directions of the free parameters in which they do what four numbers can't, (free, r)."""
    design, numbers = strand.tangents_in_parameters(at), strand.tangents_in_numbers(at)
    size = np.linalg.norm(design, axis=0)
    usable = size > 0.0
    scale = 1.0 / size[usable]
    q = np.linalg.qr(numbers / np.linalg.norm(numbers, axis=0))[0]
    alone = design[:, usable] * scale
    alone = alone - q @ (q.T @ alone)
    power, axes = np.linalg.eigh(alone.T @ alone)
    directions = np.zeros((strand.free.size, int(np.sum(power > LEAST_SHAPE_SHARE))))
    directions[usable] = scale[:, None] * axes[:, power > LEAST_SHAPE_SHARE]
    return directions


def _responses(strand: Strand, rows: Floats, common: Floats) -> Floats:
    """By how much the numbers of each sweep change with errors of the common curve that do `common`: (n, 4, m + r)."""
    hold = strand.noise**2 * np.diag(PRIOR_SD**-2)
    sweeps = zip(np.split(rows, strand.starts[1:]), np.split(common, strand.starts[1:]), strict=True)
    return np.array([-np.linalg.solve(own.T @ own + hold, own.T @ there) for own, there in sweeps])


def _memory(strand: Strand, left: Floats, rows: Floats) -> tuple[float, float]:
    """Correlation of neighbours, and the share of the variance of the noise that is left once numbers are estimated.

    Least squares takes some of both away; how much, a sweep of median length tells.
    """
    first = np.zeros(left.size, dtype=bool)
    first[strand.starts] = True
    ratio = float(lag1(left, first))
    typical = int(np.argsort(strand.lengths)[strand.cycle.size // 2])
    own = rows[strand.starts[typical] :][: min(strand.lengths[typical], MOST_SAMPLES)]
    q = np.linalg.qr(own / np.linalg.norm(own, axis=0))[0]
    lag = np.abs(np.subtract.outer(np.arange(len(own)), np.arange(len(own))))
    memories = np.linspace(0.0, GREATEST_MEMORY, 50)
    expected, spared = np.empty(memories.size), np.empty(memories.size)
    for i, memory in enumerate(memories):
        r = memory**lag
        r -= q @ (q.T @ r)
        r -= (r @ q) @ q.T
        spared[i] = np.trace(r) / len(own)
        expected[i] = np.trace(r, offset=1) / np.trace(r)
    memory = float(np.interp(ratio, np.maximum.accumulate(expected), memories))
    return memory, float(np.interp(memory, memories, spared))


def _correlated(rows: Floats, memory: float) -> Floats:
    """Rows multiplied by the correlation matrix of AR(1) noise."""
    ahead = lfilter([1.0], [1.0, -memory], rows, axis=0)
    behind = lfilter([1.0], [1.0, -memory], rows[::-1], axis=0)[::-1]
    return np.asarray(ahead + behind - rows)
