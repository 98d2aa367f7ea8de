"""A Bayesian bootstrap of sweeps: what their scatter says of the numbers, whatever the noise model says.

The curve, with its discrepancy, is fitted by penalised least squares to sweeps that are weighted at random: weights of
J sweeps are J times a draw of a flat Dirichlet distribution. Noise is held at its posterior median: it tells how
readings within a sweep count, and the priors how far they bend the curve; how far sweeps differ is told by themselves.
Where noise has heavy tails a reading counts the less the farther it is from the curve that is fitted, so that least
squares are repeated until what each counts has settled: the curve has the greatest weighted likelihood then.

A sum that is weighted so has a variance of ``(J - 1)/(J + 1)`` times that of a mean of J sweeps.

References
----------
D. B. Rubin, "The Bayesian bootstrap", Annals of Statistics 9 (1981) 130; M. A. Newton, A. E. Raftery, "Approximate
Bayesian inference with the weighted likelihood bootstrap", Journal of the Royal Statistical Society B 56 (1994) 3.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.optimize import least_squares

from sma_bayes.arrays import Floats
from sma_bayes.assess.draws import RecordDraws
from sma_bayes.assess.sweeps import samples_of_sweeps
from sma_bayes.studies.sensitivity.quantities import (
    QuantityDraws,
    of_other_draws,
    quantities_of,
)

FEWEST_SWEEPS: Final = 4
"""Sweeps from which their scatter tells anything."""
REPLICATES: Final = 300
MAX_EVALUATIONS: Final = 60
"""Evaluations of the curve in one fit, at most."""
MAX_ROUNDS: Final = 30
"""Fits after which what readings count is taken as it is."""
WEIGHT_TOLERANCE: Final = 0.01
"""Change of the root of what a reading counts that is none [1]."""


@dataclass(frozen=True, slots=True, eq=False)
class SweepBootstrap:
    """Quantities under sweeps weighted at random.

    Attributes
    ----------
    quantities : tuple of QuantityDraws
        Those that the curve gives, without those of the noise.
    failed : int
        Fits that did not come to an end, which are left out.
    """

    quantities: tuple[QuantityDraws, ...]
    failed: int


def bootstrap_sweeps(
    draws: RecordDraws, at: Sequence[float], seed: int, *, stiffness: bool, replicates: int = REPLICATES
) -> SweepBootstrap | None:
    """Weight the sweeps of a record at random and fit its curve to them; None with fewer than `FEWEST_SWEEPS`.

    Parameters
    ----------
    draws : RecordDraws
    at : sequence of float
        See `quantities_of`.
    seed : int
    stiffness : bool
        See `quantities_of`.
    replicates : int
    """
    sweeps = samples_of_sweeps(draws.record)
    if len(sweeps) < FEWEST_SWEEPS:
        return None
    rng = np.random.default_rng(np.random.SeedSequence([seed, 9, *draws.key.encode()]))
    squares = _PenalisedSquares.of(draws)
    weight = np.empty(draws.record.n)
    found, failed = [], 0
    start = squares.settled(squares.start, np.ones(draws.record.n))
    start = squares.start if start is None else start
    for share in rng.dirichlet(np.ones(len(sweeps)), min(replicates, draws.size)) * len(sweeps):
        for s, w in zip(sweeps, share, strict=True):
            weight[s] = w
        x = squares.settled(start, weight)
        if x is None:
            failed += 1
        else:
            found.append(x)
    if not found:
        return None
    theta, weights = squares.parameters(np.stack(found))
    again = quantities_of(of_other_draws(draws, theta, weights), at, stiffness=stiffness)
    return SweepBootstrap(tuple(q for q in again if q.kind != "noise"), failed)


@dataclass(frozen=True, eq=False)
class _PenalisedSquares:
    """Sum of squares of a record's curve and discrepancy, the noise held.

    Attributes
    ----------
    draws : RecordDraws
    z : ndarray, shape (D,)
        Sampled coordinates, those of the model first; the others stay.
    start : ndarray, shape (m + functions,)
        Coordinates of the model, then weights of the discrepancies.
    sd, centre : ndarray
        Of the normal prior of each of these.
    scale, firm : dict of str to ndarray
        Channel to standard deviation of the noise and to the root of what each innovation counts.
    """

    draws: RecordDraws
    z: Floats
    start: Floats
    centre: Floats
    sd: Floats
    scale: dict[str, Floats]
    firm: dict[str, Floats]

    @classmethod
    def of(cls, draws: RecordDraws) -> _PenalisedSquares:
        """About the posterior median."""
        posterior, place = draws.posterior, draws.posterior.layout[0]
        theta = np.median(draws.before_calibration, axis=0)
        z = posterior.space.unconstrain(theta)
        m = posterior.sampled_model.size
        start, centre, sd = [z[:m]], [posterior.space.prior_centre()[:m]], [posterior.space.prior_sd()[:m]]
        scale: dict[str, Floats] = {}
        with np.errstate(all="ignore"):
            _, relative = posterior.moments_of_noise(theta, 0)
        missed = {c: np.median(w, axis=0) for c, w in draws.weights.items()}
        for channel in draws.record.observed:
            scale[channel] = theta[place.noise[channel][0]] * relative[channel]
            if channel in missed:
                basis = posterior.discrepancy[0][channel]
                start.append(missed[channel])
                centre.append(np.zeros(basis.count))
                sd.append(np.full(basis.count, theta[place.size[channel]]))
        at = np.concatenate(start)
        even = cls(draws, z, at, np.concatenate(centre), np.concatenate(sd), scale, {})
        return replace(even, firm=even.counts(at))

    def counts(self, x: Floats) -> dict[str, Floats]:
        """Root of what each innovation counts beside a curve, of a likelihood whose tails are heavy, by channel."""
        noise = self.draws.posterior.noise
        found = {}
        for channel, e in replace(self, firm=self._ones).innovations_of(x).items():
            shape = self._shape(channel)
            counts = noise.weight(e, shape)
            found[channel] = np.sqrt(np.maximum(counts, 0.0) * noise.likelihood_weight(shape)[:, None])[0]
        return found

    def settled(self, start: Floats, weight: Floats) -> Floats | None:
        """Coordinates of the greatest weighted likelihood, see `fitted`; what readings count is found on the way."""
        squares, x = self, self.fitted(start, weight)
        for _ in range(0 if self.draws.posterior.noise.is_gaussian else MAX_ROUNDS):
            if x is None:
                return None
            firm = self.counts(x)
            change = max(np.abs(firm[c] - squares.firm[c]).max() for c in firm)
            if change < WEIGHT_TOLERANCE:
                break
            squares = replace(squares, firm=firm)
            x = squares.fitted(x, weight)
        return x

    @property
    def _model(self) -> int:
        return int(self.draws.posterior.sampled_model.size)

    def parameters(self, x: Floats) -> tuple[Floats, dict[str, Floats]]:
        """All parameters (B, P) and weights of the discrepancies by channel, at points (B, m + functions)."""
        z = np.repeat(self.z[None], len(x), axis=0)
        z[:, : self._model] = x[:, : self._model]
        weights, first = {}, self._model
        for channel, w in self.draws.weights.items():
            weights[channel] = x[:, first : first + w.shape[1]]
            first += w.shape[1]
        return self.draws.posterior.space.constrain(z), weights

    def fitted(self, start: Floats, weight: Floats) -> Floats | None:
        """Least squares with a weight of each reading (n,); None where the search did not end."""
        root = np.sqrt(weight)
        with np.errstate(all="ignore"):
            found = least_squares(
                self._residuals,
                start,
                jac=self._jacobian,
                method="lm",
                x_scale=self.sd,
                max_nfev=MAX_EVALUATIONS,
                args=(root,),
            )
        return np.asarray(found.x) if found.status > 0 and np.isfinite(found.x).all() else None

    def innovations_of(self, x: Floats) -> dict[str, Floats]:
        """Channel to what the curve misses, shape (1, n), see `_innovations`."""
        posterior, record = self.draws.posterior, self.draws.record
        theta, weights = self.parameters(x[None])
        curves = posterior.predict(theta, record.inputs)
        found = {}
        for channel, observed in record.observed.items():
            e = observed - curves[channel][0]
            if channel in weights:
                e = e - weights[channel][0] @ posterior.discrepancy[0][channel].rows
            found[channel] = self._innovations(channel, e[None])
        return found

    def _residuals(self, x: Floats, root: Floats) -> Floats:
        parts = [(x - self.centre) / self.sd]
        parts += [root * e[0] for e in self.innovations_of(x).values()]
        found = np.concatenate(parts)
        return np.where(np.isfinite(found), found, 1e100)

    def _jacobian(self, x: Floats, root: Floats) -> Floats:
        posterior, record = self.draws.posterior, self.draws.record
        m, (theta, weights) = self._model, self.parameters(x[None])
        z = self.z.copy()
        z[:m] = x[:m]
        chain = posterior.space.derivative(z)[:m]
        slopes = posterior.model.jacobian(theta[0, posterior.layout[0].model], record.inputs)
        parts, first = [np.diag(1.0 / self.sd)], m
        places = {}
        for channel, w in weights.items():
            places[channel] = slice(first, first + w.shape[1])
            first += w.shape[1]
        for channel in record.observed:
            rows = np.zeros((x.size, record.n))
            rows[:m] = (slopes[channel][:, posterior.sampled_model] * chain).T
            if channel in places:
                rows[places[channel]] = posterior.discrepancy[0][channel].rows
            parts.append(-root[:, None] * self._innovations(channel, rows).T)
        found = np.concatenate(parts)
        return np.where(np.isfinite(found), found, 0.0)

    def _innovations(self, channel: str, series: Floats) -> Floats:
        """Series (k, n) in standard deviations of the noise, without its memory, each reading as it counts."""
        posterior = self.draws.posterior
        shape = np.repeat(self._shape(channel), len(series), axis=0)
        return np.asarray(
            self.firm[channel]
            * posterior.noise.decorrelate(series / self.scale[channel], shape, posterior.steps[0])
        )

    def _shape(self, channel: str) -> Floats:
        """Shape of the noise at the posterior median, shape (1, k)."""
        posterior = self.draws.posterior
        return np.asarray(posterior.noise_shape(posterior.space.constrain(self.z)[None], 0, channel))

    @property
    def _ones(self) -> dict[str, Floats]:
        return {channel: np.ones(self.draws.record.n) for channel in self.scale}
