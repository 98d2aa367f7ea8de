"""Coordinates in which a posterior of this package is nearly normal.

Two maps are joined. `PredictiveCoordinates` put the response at a few chosen samples in place of the parameters
behind it: measurements have nearly normal errors, so the posterior is nearly normal in what the model predicts
even where it is a banana in the parameters (A2 close to B2). As many samples are chosen, by pivoted QR of the
whitened Jacobian at a mode, as there are directions that the data determine.

`NoiseScaledCoordinates` measure these, or the parameters themselves, in units of the spread that they have
given the parameters of the noise. With a long memory a curve is uncertain in proportion to the noise, and the
posterior is a funnel; in these coordinates it is not.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from scipy.linalg import qr

from sma_bayes.arrays import Bools, Floats, Ints
from sma_bayes.fitting.linearised import LinearisedResponse
from sma_bayes.fitting.normal_equations import NormalEquations
from sma_bayes.fitting.posterior import Posterior
from sma_bayes.sampling.proposals import Coordinates

MAX_NEWTON_STEPS = 8
"""Of Newton's method for the parameters behind predictions, at most."""
NEWTON_TOLERANCE = 1e-8
"""Step of Newton's method, in prior sds, after which no other is made; the next would be about its square."""


@dataclass(frozen=True, eq=False)
class PredictiveCoordinates:
    """Map ``u(z)``: chosen predictions, directions left to the prior, noise parameters.

    Attributes
    ----------
    posterior : Posterior
    centre : ndarray, shape (D,)
        Mode about which the samples were chosen.
    points : tuple
        For each record, channel to the chosen sample numbers.
    scale : ndarray, shape (r,)
        By which each chosen prediction is divided: the sd of its noise at the mode.
    rest : ndarray, shape (m - r, m)
        Rows: combinations of the model's m sampled parameters that are kept as they are.
    """

    posterior: Posterior
    centre: Floats
    points: tuple[Mapping[str, Ints], ...]
    scale: Floats
    rest: Floats
    _width: Floats = field(init=False, repr=False)
    _start: Floats = field(init=False, repr=False)
    _slope: Floats = field(init=False, repr=False)

    def __post_init__(self) -> None:
        set_ = object.__setattr__
        set_(self, "_width", self.posterior.space.prior_sd()[: self.count])
        value, jacobian = self._evaluate(self.centre[None, : self.count])
        set_(self, "_start", value[0])
        set_(self, "_slope", np.linalg.inv(jacobian[0]))

    @property
    def count(self) -> int:
        """Number m of sampled parameters of the model; they come first in ``z``."""
        return int(self.rest.shape[1])

    @staticmethod
    def at(linearised: LinearisedResponse, most: int | None = None) -> PredictiveCoordinates | None:
        """Choose coordinates about a point, such as a mode, with so many predictions at most.

        None where the model has no sampled parameter, or the data determine none better than the prior.
        """
        posterior, count = linearised.posterior, linearised.count
        if count == 0:
            return None
        width = posterior.space.prior_sd()[:count]
        rows, labels, scales = [], [], []
        for r, channel, slope, sd in linearised.channels():
            rows.append(slope * (width / sd))
            labels += [(r, channel, i) for i in range(len(slope))]
            scales += [sd] * len(slope)
        whitened = np.nan_to_num(np.concatenate(rows))
        _, singular, vt = np.linalg.svd(whitened, full_matrices=False)
        rank = int(np.sum(singular > 1.0))  # directions that the data determine better than the prior
        rank = rank if most is None else min(rank, most)
        if rank == 0:
            return None
        _, _, pivot = qr(whitened.T, mode="economic", pivoting=True, check_finite=False)
        chosen = sorted(pivot[:rank].tolist())
        points: list[dict[str, Ints]] = [{} for _ in posterior.records]
        for index in chosen:
            r, channel, i = labels[index]
            points[r][channel] = np.append(points[r].get(channel, np.empty(0, dtype=np.int64)), i)
        ordered = [
            labels.index((r, c, int(i))) for r, p in enumerate(points) for c, at in p.items() for i in at
        ]
        rest = vt[rank:] / width if rank < count else np.empty((0, count))
        try:
            return PredictiveCoordinates(
                posterior, linearised.z, tuple(points), np.array(scales)[ordered], rest
            )
        except np.linalg.LinAlgError:
            return None

    @np.errstate(all="ignore")  # what overflows is left out by who asks
    def _evaluate(self, model_z: Floats) -> tuple[Floats, Floats]:
        """Coordinates (W, m) of the model's parameters, and their derivative (W, m, m)."""
        space, model = self.posterior.space, self.posterior.model
        z = np.tile(self.centre, (len(model_z), 1))
        z[:, : self.count] = model_z
        theta = space.constrain(z)
        chain = space.derivative(z)[:, None, : self.count]
        free = space.free_index[: self.count]
        values, slopes = [], []
        for record, place, points in zip(
            self.posterior.records, self.posterior.layout, self.points, strict=True
        ):
            for channel, at in points.items():
                inputs = {name: values[at] for name, values in record.inputs.items()}
                values.append(model.predict(theta[:, place.model], inputs)[channel])
                slopes.append(model.jacobian(theta[:, place.model], inputs)[channel][..., free] * chain)
        value = np.concatenate([*values], axis=1) / self.scale
        slope = np.concatenate([*slopes], axis=1) / self.scale[:, None]
        kept = np.broadcast_to(self.rest, (len(z), *self.rest.shape))
        return (
            np.concatenate([value, model_z @ self.rest.T], axis=1),
            np.concatenate([slope, kept], axis=1),
        )

    @property
    def model_start(self) -> Floats:
        """Coordinates of the model's parameters at the centre (m,)."""
        return self._start

    @property
    def model_derivative(self) -> Floats:
        """Derivative of the model's coordinates ``z`` with respect to those of this map, at the centre (m, m)."""
        return self._slope

    def _solve(self, slope: Floats, right: Floats) -> tuple[Floats, Floats]:
        """Solutions (W, m) of systems with derivatives (W, m, m) on the left, and ``ln |det|`` of these (W,)."""
        with np.errstate(all="ignore"):  # what can't be solved is left out by who asks
            log_determinant = np.linalg.slogdet(slope)[1]
        usable = np.isfinite(log_determinant)
        x = np.full_like(right, np.nan)
        x[usable] = np.linalg.solve(slope[usable], right[usable, :, None])[..., 0]
        return x, log_determinant

    def forward(self, z: Floats) -> tuple[Floats, Floats, Bools]:
        """Coordinates, log Jacobian, and whether `inverse` leads back to the same point."""
        value, slope = self._evaluate(z[:, : self.count])
        u = np.concatenate([value, z[:, self.count :]], axis=1)
        usable = np.isfinite(u).all(axis=1)
        log_jacobian = np.full(len(z), -np.inf)
        log_jacobian[usable] = self._solve(slope[usable], u[usable, : self.count])[1]
        usable &= np.isfinite(log_jacobian)
        again, _, found = self.inverse(np.where(usable[:, None], u, 0.0))
        with np.errstate(invalid="ignore"):
            close = np.abs(again - z)[:, : self.count] <= 1e-6 * self._width
        return np.where(usable[:, None], u, 0.0), log_jacobian, usable & found & close.all(axis=1)

    def inverse(self, u: Floats) -> tuple[Floats, Floats, Bools]:
        """Points by Newton's method from the mode, their log Jacobian, and which were found."""
        m = self.count
        z = np.concatenate([np.empty((len(u), m)), u[:, m:]], axis=1)
        x = self.centre[:m] + (u[:, :m] - self._start) @ self._slope.T
        x = np.clip(x, self.centre[:m] - 6.0 * self._width, self.centre[:m] + 6.0 * self._width)
        log_jacobian = np.full(len(u), -np.inf)
        found = np.zeros(len(u), dtype=bool)
        active = np.arange(len(u))
        for _ in range(MAX_NEWTON_STEPS):
            value, slope = self._evaluate(x[active])
            step, log_determinant = self._solve(slope, u[active, :m] - value)
            with np.errstate(all="ignore"):
                length = np.abs(step / self._width).max(axis=1)
                step *= np.minimum(1.0, 0.5 / np.maximum(length, 1e-300))[:, None]
            usable = np.isfinite(length) & np.isfinite(log_determinant)
            done = usable & (length < NEWTON_TOLERANCE)
            found[active[done]] = True
            log_jacobian[active[done]] = log_determinant[done]
            x[active[usable]] += step[usable]
            active = active[usable & ~done]
            if active.size == 0:
                break
        z[:, :m] = x
        return z, log_jacobian, found


@dataclass(frozen=True, eq=False)
class NoiseScaledCoordinates:
    """Coordinates of the model's parameters, relative to their spread given those of the noise.

    With the response linearised about the mode, the coordinates ``w`` of the model are normal given the noise
    (see `normal_equations`). The new coordinates are those in which that normal distribution is standard; those
    of the noise are kept.

    Attributes
    ----------
    inner : Coordinates
        Map of the model's parameters, such as `PredictiveCoordinates`.
    equations : NormalEquations
    start : ndarray, shape (m,)
        ``w`` at the mode.
    """

    inner: Coordinates
    equations: NormalEquations
    start: Floats

    @property
    def count(self) -> int:
        """Number m of sampled parameters of the model; they come first in ``z``."""
        return self.equations.count

    @staticmethod
    def about(linearised: LinearisedResponse, inner: Coordinates) -> NoiseScaledCoordinates:
        """About the point of a linearised response, such as a mode; `inner` about the same."""
        posterior, count, theta = linearised.posterior, linearised.count, linearised.theta
        space = posterior.space
        centre = linearised.z[:count]
        slope, start = np.eye(count), centre
        if isinstance(inner, PredictiveCoordinates):
            slope, start = inner.model_derivative, inner.model_start
        rows: list[dict[str, Floats]] = []
        bases: list[dict[str, Floats]] = []
        for r, (record, by_channel) in enumerate(zip(posterior.records, linearised.slopes, strict=True)):
            blocks, own = {}, {}
            mean, scales = posterior.moments_of_noise(theta, r)
            for channel, down in by_channel.items():
                residual = record.observed[channel] - mean[channel]
                if not posterior.noise.is_gaussian:
                    residual = posterior.working_residual(theta, r, channel, residual, scales[channel])
                blocks[channel] = np.concatenate([(down @ slope).T, residual[None]]) / scales[channel]
                if channel in posterior.discrepancy[r]:
                    own[channel] = posterior.discrepancy[r][channel].rows_with_sweeps / scales[channel]
            rows.append(blocks)
            bases.append(own)
        sd = space.prior_sd()[:count]
        precision = slope.T @ (slope / sd[:, None] ** 2)
        pull = slope.T @ ((space.prior_centre()[:count] - centre) / sd**2)
        return NoiseScaledCoordinates(
            inner, NormalEquations(posterior, count, tuple(rows), tuple(bases), precision, pull), start
        )

    def _physical(self, noise_z: Floats) -> tuple[Floats, Floats]:
        """Points with the model's coordinates at zero, sampled (W, D) and as parameters (W, P)."""
        z = np.concatenate([np.zeros((len(noise_z), self.count)), noise_z], axis=1)
        return z, self.equations.posterior.space.constrain(z)

    def log_noise_marginal(self, noise_z: Floats) -> Floats:
        """Log posterior of the noise parameters (W,), the model's integrated out of the linearised posterior.

        Up to a constant: ``prior - (ln |R| + ln |H| + r' R**-1 r - b' H**-1 b)/2``.
        """
        with np.errstate(all="ignore"):
            z, theta = self._physical(noise_z)
            normal, squares, log_volume = self.equations.solved(theta)
            posterior = self.equations.posterior
            value = posterior.log_prior(z) - 0.5 * squares - log_volume
            for rows, at, steps in self.equations.channels():
                shape, n = posterior.noise.shape_of(theta[:, at]), rows.shape[1]
                density = posterior.noise.total_log_density(np.zeros((len(z), n)), shape, steps)
                value += posterior.noise.likelihood_weight(shape) * (density - n * np.log(theta[:, at[0]]))
            value += 0.5 * normal.pull_squared - normal.log_volume
        return np.where(normal.usable & np.isfinite(value), value, -np.inf)

    def forward(self, z: Floats) -> tuple[Floats, Floats, Bools]:
        """Coordinates, log Jacobian, and whether `inverse` leads back to the same point."""
        m = self.count
        w, log_jacobian, back = self.inner.forward(z)
        normal, *_ = self.equations.solved(self._physical(z[:, m:])[1])
        v = normal.whiten(w[:, :m] - self.start)
        return np.concatenate([v, z[:, m:]], axis=1), log_jacobian + normal.log_volume, back & normal.usable

    def inverse(self, u: Floats) -> tuple[Floats, Floats, Bools]:
        """Points, log Jacobian there, and which were found."""
        m = self.count
        normal, *_ = self.equations.solved(self._physical(u[:, m:])[1])
        w = self.start + normal.colour(u[:, :m])
        z, log_jacobian, found = self.inner.inverse(np.concatenate([w, u[:, m:]], axis=1))
        reached = found & normal.usable & np.isfinite(z).all(axis=1)
        return z, log_jacobian + normal.log_volume, reached
