"""Least-squares warm start: several starts, bounded, with the analytic Jacobian.

This is what the paper stops at. Here it seeds the ensembles, gives the classic goodness of fit, and tells which
directions of the parameter space the data leave free.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from sma_bayes.arrays import Floats
from sma_bayes.errors import MeasurementError
from sma_bayes.fitting.posterior import Posterior

SCREENED_DRAWS = 512
"""Prior draws that are screened, what the model can solve for solved for."""
REFINED_STARTS = 3
"""Best screened draws that are refined."""
SCREEN_SAMPLES = 128
"""Samples of a record that the screening looks at, evenly spaced; refinement uses all."""
OVERFLOW_VALUE = 1e30
"""Stands for a residual or derivative that overflowed; the solver takes sixth powers of it."""
BOUND_SD = 10.0
"""Bounds of the refinement, in standard deviations of the prior about its centre."""


@dataclass(frozen=True, slots=True)
class GoodnessOfFit:
    """Classic statistics of one channel at the least-squares estimate.

    Attributes
    ----------
    sse : float
        Sum of squared residuals [unit of the channel squared].
    rmse : float
        ``sqrt(sse/(n - p))``, the residual standard error that the paper's tables call RMSE [unit of channel].
    r2, adj_r2 : float
        ``1 - sse/sst`` and ``1 - (sse/(n - p))/(sst/(n - 1))``.
    n, p : int
        Samples, and parameters of this channel's curve that were estimated.
    """

    sse: float
    rmse: float
    r2: float
    adj_r2: float
    n: int
    p: int


@dataclass(frozen=True, eq=False)
class WarmStart:
    """Least-squares estimate of the model's parameters.

    Attributes
    ----------
    theta : ndarray, shape (P,)
        Estimate of all model parameters, fixed ones included.
    sd : ndarray, shape (P,)
        Standard errors from the Jacobian and the residual variance; 0 where fixed, infinite where the data
        leave a parameter free.
    fit : tuple of dict
        For each record, channel to `GoodnessOfFit`.
    residual : tuple of dict
        For each record, channel to residuals (n,).
    optima : tuple of ndarray
        Distinct local optima, best first, as sampled coordinates of the model's free parameters.
    rank : int
        Numerical rank of the Jacobian.
    free_directions : tuple of str
        Combinations of parameters about which the data say less than the prior.
    at_bound : tuple of str
        Parameters that ended at a bound of the search.
    """

    theta: Floats
    sd: Floats
    fit: tuple[Mapping[str, GoodnessOfFit], ...]
    residual: tuple[Mapping[str, Floats], ...]
    optima: tuple[Floats, ...]
    rank: int
    free_directions: tuple[str, ...]
    at_bound: tuple[str, ...]


def warm_start(posterior: Posterior, rng: np.random.Generator) -> WarmStart:
    """Fit the model by least squares, ignoring priors and noise model.

    Parameters
    ----------
    posterior : Posterior
        Priors only supply the starting points, the bounds and which parameters are fixed.
    rng : numpy.random.Generator
        For the starting points.

    Raises
    ------
    MeasurementError
        If there are fewer samples than parameters.
    """
    problem = SumOfSquares(posterior)
    if problem.free.size > problem.samples:
        raise MeasurementError(
            f"{problem.samples} samples can't determine {problem.free.size} parameters",
            file=posterior.records[0].source or None,
            expected=f"more than {problem.free.size} samples of {posterior.records[0].key}",
            remedy="record more samples, or fix parameters in a priors file",
        )
    starts = [problem.inside(z) for z in _screen(posterior, rng)]
    weights = {c: 1.0 / problem.spread[c] for c in problem.channels}
    found = [problem.solve(z, weights) for z in starts]
    if len(problem.channels) > 1 and "stiffness" in problem.channels:
        # channels share parameters, so their weights matter: once more with those that the residuals ask for
        best = min(found, key=lambda f: f[1])[0]
        weights = problem.weights(best)
        found = [problem.solve(z, weights) for z, _ in found]
    found.sort(key=lambda f: f[1])
    z, cost = found[0]
    theta = problem.theta(z)
    residual = problem.residuals(theta)
    sd, rank, free_directions = problem.covariance(z, weights, cost)
    return WarmStart(
        theta=theta,
        sd=sd,
        fit=tuple(problem.goodness(i, residual[i]) for i in range(len(posterior.records))),
        residual=residual,
        optima=problem.distinct([f[0] for f in found]),
        rank=rank,
        free_directions=free_directions,
        at_bound=problem.at_bound(z),
    )


class SumOfSquares:
    """The sum of squares and its Jacobian in sampled coordinates of the model's free parameters."""

    def __init__(self, posterior: Posterior) -> None:
        self.posterior = posterior
        self.model = posterior.model
        space = posterior.space
        self.free = posterior.sampled_model
        self.position = np.arange(self.free.size)  # model parameters come first in z as in theta
        self.prior_sd = space.prior_sd()[: self.free.size]
        self.centre = space.prior_centre()
        self.low = self.centre[: self.free.size] - BOUND_SD * self.prior_sd
        self.high = self.centre[: self.free.size] + BOUND_SD * self.prior_sd
        self.channels = posterior.records[0].channels
        self.samples = posterior.n * len(self.channels)
        self.spread = {
            c: float(np.std(np.concatenate([r.observed[c] for r in posterior.records]))) or 1.0
            for c in self.channels
        }

    def inside(self, z: Floats) -> Floats:
        margin = 1e-6 * (self.high - self.low)
        return np.clip(z, self.low + margin, self.high - margin)

    def _full(self, z: Floats) -> Floats:
        full = self.centre.copy()
        full[: self.free.size] = z
        return full

    def theta(self, z: Floats) -> Floats:
        return np.asarray(self.posterior.space.constrain(self._full(z))[: len(self.model.parameter_names)])

    def residuals(self, theta: Floats) -> tuple[dict[str, Floats], ...]:
        """Measured less predicted (n,), for each record and channel."""
        out = []
        for record in self.posterior.records:
            mu = self.model.predict(theta, record.inputs)
            out.append({c: record.observed[c] - mu[c] for c in record.channels})
        return tuple(out)

    def jacobians(self, theta: Floats) -> tuple[dict[str, Floats], ...]:
        """Derivatives (n, P) of what is predicted, for each record and channel."""
        return tuple(self.model.jacobian(theta, record.inputs) for record in self.posterior.records)

    def weights(self, z: Floats) -> dict[str, float]:
        residual = self.residuals(self.theta(z))
        joined = {c: np.concatenate([r[c] for r in residual]) for c in self.channels}
        return {c: 1.0 / max(float(np.std(joined[c])), 1e-9 * self.spread[c]) for c in self.channels}

    def _vector(self, z: Floats, weights: Mapping[str, float]) -> Floats:
        with np.errstate(over="ignore", invalid="ignore"):
            residual = self.residuals(self.theta(z))
        vector = np.concatenate([r[c] * weights[c] for r in residual for c in self.channels])
        vector = np.clip(vector, -OVERFLOW_VALUE, OVERFLOW_VALUE)
        return np.asarray(
            np.nan_to_num(vector, nan=OVERFLOW_VALUE, posinf=OVERFLOW_VALUE, neginf=-OVERFLOW_VALUE)
        )

    def _jacobian(self, z: Floats, weights: Mapping[str, float]) -> Floats:
        chain = self.posterior.space.derivative(self._full(z))[: self.free.size]
        theta = self.theta(z)
        blocks = []
        with np.errstate(over="ignore", invalid="ignore"):
            for j in self.jacobians(theta):
                blocks += [-weights[c] * j[c][:, self.free] * chain for c in self.channels]
        jacobian = np.clip(np.concatenate(blocks), -OVERFLOW_VALUE, OVERFLOW_VALUE)
        return np.asarray(np.nan_to_num(jacobian, nan=0.0))

    def solve(self, z: Floats, weights: Mapping[str, float]) -> tuple[Floats, float]:
        if self.free.size == 0:
            return z, float(0.5 * np.sum(self._vector(z, weights) ** 2))
        result = least_squares(
            self._vector,
            z,
            jac=self._jacobian,
            bounds=(self.low, self.high),
            method="trf",
            x_scale=self.prior_sd,
            ftol=1e-12,
            xtol=1e-12,
            gtol=1e-12,
            max_nfev=200,
            args=(weights,),
        )
        return np.asarray(result.x, dtype=float), float(result.cost)

    def covariance(
        self, z: Floats, weights: Mapping[str, float], cost: float
    ) -> tuple[Floats, int, tuple[str, ...]]:
        """Standard errors of all model parameters, rank of the Jacobian and the directions left free."""
        sd = np.zeros(len(self.model.parameter_names))
        if self.free.size == 0:
            return sd, 0, ()
        jacobian = self._jacobian(z, weights) * self.prior_sd
        variance = 2.0 * cost / max(self.samples - self.free.size, 1)
        _, singular, vt = np.linalg.svd(jacobian, full_matrices=False)
        solid = singular > singular[0] * max(jacobian.shape) * 1e-12
        inverse = np.where(solid, 1.0 / np.where(solid, singular, 1.0), np.inf)
        chain = np.abs(self.posterior.space.derivative(self._full(z))[: self.free.size]) * self.prior_sd
        with np.errstate(invalid="ignore"):
            spread = np.where(np.abs(vt.T) > 1e-8, (vt.T * inverse) ** 2, 0.0).sum(axis=1)
        sd[self.free] = np.sqrt(variance * spread) * chain
        weak = singular < np.sqrt(variance)  # less information than the prior, of unit variance here
        names = self.posterior.names
        free_directions = tuple(_direction(vt[i], names, self.posterior) for i in np.flatnonzero(weak))
        return sd, int(solid.sum()), free_directions

    def goodness(self, record: int, residual: Mapping[str, Floats]) -> dict[str, GoodnessOfFit]:
        fit = {}
        names = self.model.parameter_names
        estimated = {names[i] for i in self.free}
        for channel, r in residual.items():
            p = len(estimated & set(self.model.by_channel(channel)))
            y = self.posterior.records[record].observed[channel]
            sse, sst, n = float(r @ r), float(np.sum((y - y.mean()) ** 2)), r.size
            varies = sst > 0.0  # a constant channel has no variance to explain
            fit[channel] = GoodnessOfFit(
                sse=sse,
                rmse=float(np.sqrt(sse / max(n - p, 1))),
                r2=1.0 - sse / sst if varies else float("nan"),
                adj_r2=1.0 - (sse / max(n - p, 1)) / (sst / (n - 1)) if varies else float("nan"),
                n=n,
                p=p,
            )
        return fit

    def distinct(self, candidates: list[Floats]) -> tuple[Floats, ...]:
        """Candidates whose curves differ by more than a hundredth of the best residual's spread."""
        weights = self.weights(candidates[0])
        kept: list[tuple[Floats, Floats]] = []
        for z in candidates:
            vector = self._vector(z, weights)
            if all(np.sqrt(np.mean((vector - other) ** 2)) > 1e-2 for _, other in kept):
                kept.append((z, vector))
        return tuple(z for z, _ in kept)

    def at_bound(self, z: Floats) -> tuple[str, ...]:
        near = 1e-3 * self.prior_sd
        touching = (z - self.low < near) | (self.high - z < near)
        return tuple(self.posterior.names[i] for i in np.flatnonzero(touching))


def _direction(vector: Floats, names: tuple[str, ...], posterior: Posterior) -> str:
    """Readable combination of parameters: ``0.71 ln A1 + 0.71 ln B1``."""
    vector = vector * np.sign(vector[np.argmax(np.abs(vector))])
    terms = []
    for value, name, parameter in zip(vector, names, posterior.space.free, strict=False):
        if abs(value) >= 0.1:
            terms.append(
                f"{'-' if value < 0 else '+'} {abs(value):.2f} {parameter.prior.transform.label(name)}"
            )
    return " ".join(terms).removeprefix("+ ")


def _screen(posterior: Posterior, rng: np.random.Generator) -> list[Floats]:
    """Starting points: the best of many prior draws, once the model has improved them."""
    model, space = posterior.model, posterior.space
    count = len(model.parameter_names)
    theta = space.constrain(space.draw(rng, SCREENED_DRAWS))[:, :count]
    fixed = np.array([p.fixed is not None for p in space.parameters[:count]], dtype=bool)
    records = posterior.records
    shared = [name for name in records[0].inputs if all(name in r.inputs for r in records)]
    series = {name: np.concatenate([r.inputs[name] for r in records]) for name in shared}
    for channel in records[0].channels:
        series[channel] = np.concatenate([r.observed[channel] for r in records])
    stride = max(1, series["temperature"].size // SCREEN_SAMPLES)
    series = {k: v[::stride] for k, v in series.items()}
    start = np.tile(space.constrain(space.prior_centre()), (REFINED_STARTS, 1))
    start[:, :count] = model.screen(theta, fixed, series)[:REFINED_STARTS]
    return list(space.unconstrain(start)[:, : posterior.sampled_model.size])
