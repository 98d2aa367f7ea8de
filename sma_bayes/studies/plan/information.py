"""What a further sweep is expected to tell: normal approximations about posterior draws, in closed form.

With ``x`` the sampled parameters of the curve and the weights of what it misses, the posterior draws have the
covariance ``S``. About a draw, a sweep of n samples reads ``J x + U u + e``: J is the derivative of the curve, e the
noise of the fit with its memory, of covariance R, and u what one sweep differs from another by (offset, stroke, shift,
width along the columns of U), of covariance W. It brings the information

    I = J' (R + U W U')^-1 J

about the curve that all sweeps have in common, and c sweeps bring c I. A quantity with gradient g has the variance
``g' S g`` now and is expected to have ``g' (S^-1 + c I)^-1 g``; the information about it, half the logarithm of their
ratio, is in nats. Both are averaged over draws, each with its own J, R and g.

References
----------
K. Chaloner, I. Verdinelli, "Bayesian experimental design: a review", Statistical Science 10 (1995) 273, doi
10.1214/ss/1177009939; D. V. Lindley, Ann. Math. Stat. 27 (1956) 986, doi 10.1214/aoms/1177728069 (information).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np
from scipy.special import ndtri

from sma_bayes.arrays import Floats, Ints
from sma_bayes.assess.draws import RecordDraws
from sma_bayes.assess.held_out import evaluated_on
from sma_bayes.fitting.curves import CurveDraws
from sma_bayes.fitting.posterior import Posterior
from sma_bayes.records.types import Branch, Record
from sma_bayes.studies.plan.scatter import SweepScatter
from sma_bayes.studies.sensitivity.quantities import QuantityDraws

DRAWS: Final = 48
"""Posterior draws about which the curve is linearised."""
DIFFERENCE_STEP: Final = 1e-2
"""Step of finite differences of a quantity [posterior sd]."""
EIGENVALUE_TOLERANCE: Final = 1e-12
"""Eigenvalue of a covariance, over the greatest, below which it is rounding."""


@dataclass(frozen=True, slots=True)
class PlannedSweep:
    """One sweep of a candidate.

    Attributes
    ----------
    first, last : float
        Temperatures at which it begins and ends [unit of temperature].
    samples : int
        Evenly spaced.
    rate : float
        Magnitude of dT/dt [unit of temperature per s].
    """

    first: float
    last: float
    samples: int
    rate: float

    @property
    def step(self) -> float:
        """Between samples [unit of temperature]."""
        return abs(self.last - self.first) / max(self.samples - 1, 1)

    def record(self, like: Record, repeats: int = 1) -> Record:
        """A record of so many such sweeps, with nothing observed yet."""
        n = self.samples * repeats
        temperature = np.tile(np.linspace(self.first, self.last, self.samples), repeats)
        inputs: dict[str, Floats] = {
            "temperature": temperature,
            "segment": np.repeat(np.arange(repeats, dtype=float), self.samples),
        }
        if "time" in like.inputs:
            inputs["time"] = self.step / self.rate * np.arange(n, dtype=float)
        return replace(
            like,
            inputs=inputs,
            observed={c: np.zeros(n) for c in like.channels},
            row=np.arange(n),
        )


def mean_step(inputs: Mapping[str, Floats]) -> float:
    """Mean step of temperature from sample to sample of a sweep [unit of temperature]."""
    steps = np.abs(np.diff(inputs["temperature"]))[np.diff(inputs["segment"]) == 0]
    return float(np.mean(steps)) if steps.size and np.mean(steps) > 0.0 else 1.0


def with_memory_of(posterior: Posterior, theta: Floats, ratio: float) -> Floats:
    """Parameters (..., P) with the memory of noise as it is at other steps of temperature.

    A correlation r of neighbours becomes ``r**ratio``, as if the noise forgot along the temperature: more samples of
    the same sweep do not tell more than there is. Memories in time stay as they are.

    Parameters
    ----------
    posterior : Posterior
    theta : ndarray, shape (..., P)
    ratio : float
        New step of temperature over the measured one.
    """
    out = np.array(theta, dtype=float)
    for record, place in zip(posterior.records, posterior.layout, strict=True):
        for channel, at in place.noise.items():
            facts = posterior.noise.parameters(channel, record.units[channel], record.units.get("time", "s"))
            for i, fact in zip(at, facts, strict=True):
                if fact.prior_key == "phi":
                    out[..., i] = np.sign(out[..., i]) * np.abs(out[..., i]) ** ratio
                elif fact.prior_key == "memory":
                    r = ((out[..., i] - 1.0) / (out[..., i] + 1.0)) ** ratio
                    out[..., i] = (1.0 + r) / (1.0 - r)
    return out


@dataclass(frozen=True, eq=False)
class Knowledge:
    """What is known of the curve of one record.

    Attributes
    ----------
    draws : RecordDraws
    scatter : mapping of str to SweepScatter
        By channel, what one sweep differs from another by.
    chosen : ndarray of int, shape (K,)
        Draws about which the curve is linearised.
    """

    draws: RecordDraws
    scatter: Mapping[str, SweepScatter]
    chosen: Ints

    @staticmethod
    def of(
        draws: RecordDraws, scatter: Mapping[str, SweepScatter], seed: int, size: int = DRAWS
    ) -> Knowledge:
        """With draws chosen at random."""
        rng = np.random.default_rng(np.random.SeedSequence([seed, 37, *draws.key.encode()]))
        return Knowledge(draws, scatter, rng.choice(draws.size, min(size, draws.size), replace=False))

    @property
    def posterior(self) -> Posterior:
        """Of the record."""
        return self.draws.posterior

    @cached_property
    def theta(self) -> Floats:
        """Draws (S, P) as the likelihood has them, without errors of calibrations."""
        return self.draws.before_calibration

    @cached_property
    def missing(self) -> tuple[str, ...]:
        """Channels with a discrepancy."""
        return tuple(c for c in self.draws.channels if c in self.draws.weights)

    @cached_property
    def count(self) -> int:
        """Number m of sampled parameters of the curve, the first coordinates of x."""
        return int(self.posterior.sampled_model.size)

    @cached_property
    def x(self) -> Floats:
        """Coordinates (S, D): sampled parameters of the curve, then weights of discrepancies."""
        z = self.posterior.space.unconstrain(self.theta)[:, : self.count]
        return np.concatenate([z, *(self.draws.weights[c] for c in self.missing)], axis=1)

    @cached_property
    def sd(self) -> Floats:
        """Their posterior standard deviations (D,); 1 of what does not vary."""
        sd = self.x.std(axis=0)
        return np.where(sd > 0.0, sd, 1.0)

    @cached_property
    def root(self) -> Floats:
        """L (D, r) with ``L L'`` the covariance of the coordinates over their standard deviations."""
        apart = (self.x - self.x.mean(axis=0)) / self.sd
        size, axes = np.linalg.eigh(apart.T @ apart / len(apart))
        kept = size > EIGENVALUE_TOLERANCE * size.max()
        return np.asarray(axes[:, kept] * np.sqrt(size[kept]))

    def at(self, x: Floats, theta: Floats) -> CurveDraws:
        """Curves at coordinates (W, D); parameters of the noise are those of `theta` (W, P)."""
        z = self.posterior.space.unconstrain(theta)
        z[:, : self.count] = x[:, : self.count]
        weights, start = {}, self.count
        for channel in self.missing:
            size = self.draws.weights[channel].shape[1]
            weights[channel] = x[:, start : start + size]
            start += size
        return CurveDraws(self.posterior, self.posterior.space.constrain(z), weights)

    def gradient(self, channel: str, temperature: float) -> Floats:
        """Derivatives (K, 1, D) of a curve at a temperature, by coordinates in posterior standard deviations."""
        x, theta = self.x[self.chosen], self.theta[self.chosen]
        size, dimension = x.shape
        steps = DIFFERENCE_STEP * np.diag(self.sd)
        moved = np.concatenate([(x[:, None] + sign * steps).reshape(-1, dimension) for sign in (1.0, -1.0)])
        again = np.tile(np.repeat(theta, dimension, axis=0), (2, 1))
        values = self.at(moved, again).curve(channel, np.array([temperature]))[:, 0]
        up, down = values.reshape(2, size, 1, dimension)
        return np.asarray((up - down) / (2.0 * DIFFERENCE_STEP))

    def unit_gradients(self) -> Floats:
        """Derivatives (K, m, D) of the sampled parameters themselves."""
        rows = np.eye(self.count, self.x.shape[1])
        return np.broadcast_to(rows, (self.chosen.size, *rows.shape))

    def information(self, sweep: PlannedSweep) -> Floats:
        """Information (K, r, r) of one sweep, in coordinates in which the posterior is standard normal."""
        record = sweep.record(self.draws.record)
        ratio = sweep.step / mean_step(self.draws.record.inputs)
        posterior = evaluated_on(self.posterior, record)
        theta = with_memory_of(posterior, self.theta[self.chosen], ratio)
        place, steps, noise = posterior.layout[0], posterior.steps[0], posterior.noise
        chain = posterior.space.derivative(posterior.space.unconstrain(theta))[:, : self.count]
        dimension = self.x.shape[1]
        total = np.zeros((self.chosen.size, dimension, dimension))
        with np.errstate(all="ignore"):
            slopes = posterior.model.jacobian(theta[:, place.model], record.inputs)
            relative = [posterior.moments_of_noise(one, 0)[1] for one in theta]
        for channel in record.channels:
            rows = np.zeros((dimension, record.n))
            at = self.count
            for other in self.missing:
                size = self.draws.weights[other].shape[1]
                if other == channel:
                    rows[at : at + size] = posterior.discrepancy[0][channel].at(record.temperature).T
                at += size
            scatter = self.scatter.get(channel)
            apart = np.zeros((0, record.n)) if scatter is None else scatter.rows(record.temperature)
            shape = posterior.noise_shape(theta, 0, channel)
            for k in range(len(theta)):
                own = rows.copy()
                own[: self.count] = (slopes[channel][k][:, posterior.sampled_model] * chain[k]).T
                scale = theta[k, place.noise[channel][0]] * relative[k][channel]
                whole = np.concatenate([own * self.sd[:, None], apart]) / scale
                gram = noise.information(shape[k : k + 1], steps).gram(np.nan_to_num(whole))[0]
                total[k] += beside_scatter(gram, dimension)
        return np.asarray(self.root.T @ total @ self.root)


def beside_scatter(gram: Floats, count: int) -> Floats:
    """Information about the first coordinates, the others being standard normal from sweep to sweep.

    Parameters
    ----------
    gram : ndarray, shape (D + s, D + s)
        Inner products of whitened rows: of the coordinates, and of what sweeps differ by, each times its sd.
    count : int
        D.
    """
    along, across, own = gram[:count, :count], gram[:count, count:], gram[count:, count:]
    if not own.size:
        return along
    return np.asarray(along - across @ np.linalg.solve(np.eye(len(own)) + own, across.T))


@dataclass(frozen=True, eq=False)
class PlanTarget:
    """What is asked of one record.

    Attributes
    ----------
    knowledge : Knowledge
    quantities : tuple of QuantityDraws
    gradients : ndarray, shape (K, q, D)
        Of each quantity, by coordinates in posterior standard deviations.
    """

    knowledge: Knowledge
    quantities: tuple[QuantityDraws, ...]
    gradients: Floats

    @cached_property
    def heads(self) -> Floats:
        """Gradients (K, q, r) in coordinates in which the posterior is standard normal."""
        return np.asarray(self.gradients @ self.knowledge.root)

    @cached_property
    def sd(self) -> Floats:
        """Widths (q,) of 90 % intervals over that of a standard normal [unit of each]: a ratio may have no variance."""
        ends = np.array([np.quantile(q.tamed, (0.05, 0.95)) for q in self.quantities])
        return np.asarray((ends[:, 1] - ends[:, 0]) / (2.0 * ndtri(0.95)))

    @cached_property
    def fixed(self) -> Floats:
        """Share (q,) of each variance that no sweep changes: that of the calibration."""
        own = self.knowledge
        if not own.draws.calibration:
            return np.zeros(len(self.quantities))
        now = np.array([float(np.var(q.tamed)) for q in self.quantities])
        apart = np.einsum("kqr,kqr->kq", self.heads, self.heads).mean(axis=0)
        units = np.array([self.per_unit(i) for i in range(len(self.quantities))])
        with np.errstate(invalid="ignore", divide="ignore"):
            share = 1.0 - apart * units**2 / now
        return np.asarray(np.clip(np.nan_to_num(share), 0.0, 1.0))

    def per_unit(self, number: int) -> float:
        """Unit of a quantity in one of its gradient: parameters are told in their own unit, not as sampled."""
        quantity = self.quantities[number]
        if quantity.kind != "parameter":
            return 1.0
        own = self.knowledge
        spread = float(own.theta[:, own.posterior.space.free_index[number]].std())
        return spread / float(own.sd[number])

    def expected(self, information: Floats, times: float = 1.0) -> ExpectedGain:
        """What information (K, r, r), so many times, is expected to leave.

        Parameters
        ----------
        information : ndarray, shape (K, r, r)
            In coordinates in which the posterior is standard normal.
        times : float
            How often.
        """
        heads = self.heads
        whole = times * information
        whole = np.eye(whole.shape[-1]) + whole
        solved = np.linalg.solve(whole, np.swapaxes(heads, 1, 2))
        after = heads @ solved
        before = heads @ np.swapaxes(heads, 1, 2)
        left = np.einsum("kqq->kq", after) / np.maximum(np.einsum("kqq->kq", before), 1e-300)
        left = left * (1.0 - self.fixed) + self.fixed
        if len(self.quantities) == 1:
            nats = -0.5 * np.log(np.maximum(left[:, 0], 1e-300))
        else:
            nats = 0.5 * (np.linalg.slogdet(before)[1] - np.linalg.slogdet(after)[1])
        return ExpectedGain(float(np.mean(nats)), left.mean(axis=0))


@dataclass(frozen=True, slots=True, eq=False)
class ExpectedGain:
    """What is expected of measurements.

    Attributes
    ----------
    nats : float
        Information about the quantities together.
    left : ndarray, shape (q,)
        Expected posterior variance of each over that of now [1].
    """

    nats: float
    left: Floats


def counts(sweep_from: float, record: Record, tolerance: float = 0.02) -> bool:
    """Whether a sweep that begins there follows the curve of the record.

    Heating follows it from where the measured sweeps began or colder, cooling from where they began or hotter; what
    turns round before lies on a minor loop.

    Parameters
    ----------
    sweep_from : float
        [unit of temperature]
    record : Record
    tolerance : float
        Share of the measured range by which it may fall short.
    """
    low, high = float(record.temperature.min()), float(record.temperature.max())
    slack = tolerance * (high - low)
    return bool(sweep_from <= low + slack if record.branch is Branch.HEATING else sweep_from >= high - slack)
