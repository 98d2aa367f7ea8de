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

from sma_bayes.inference.proposals import Bools, Coordinates
from sma_bayes.posterior import Posterior
from sma_bayes.quantities import Floats
from sma_bayes.records.types import Ints

ITERATIONS = 12
TOLERANCE = 1e-10


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
    def at(posterior: Posterior, centre: Floats, most: int | None = None) -> PredictiveCoordinates | None:
        """Choose coordinates about a point, such as a mode, with so many predictions at most.

        None where the model has no sampled parameter.
        """
        space, model = posterior.space, posterior.model
        count = int(np.sum(space.free_index < len(model.parameter_names)))
        if count == 0:
            return None
        theta = space.to_physical(centre)
        chain = space.derivative(centre)[:count] * space.prior_sd()[:count]
        free = space.free_index[:count]
        rows, labels, scales = [], [], []
        for r, (record, place) in enumerate(zip(posterior.records, posterior.layout, strict=True)):
            jacobian = model.jacobian(theta[place.model], record.inputs)
            for channel in record.channels:
                sd = float(theta[place.noise[channel][0]])
                rows.append(jacobian[channel][:, free] * chain / sd)
                labels += [(r, channel, i) for i in range(record.n)]
                scales += [sd] * record.n
        whitened = np.nan_to_num(np.concatenate(rows))
        _, singular, vt = np.linalg.svd(whitened, full_matrices=False)
        rank = int(np.sum(singular > 1.0))  # directions that the data determine better than the prior
        rank = rank if most is None else min(rank, most)
        _, _, pivot = qr(whitened.T, mode="economic", pivoting=True, check_finite=False)
        chosen = sorted(pivot[:rank].tolist())
        points: list[dict[str, Ints]] = [{} for _ in posterior.records]
        for index in chosen:
            r, channel, i = labels[index]
            points[r][channel] = np.append(points[r].get(channel, np.empty(0, dtype=np.int64)), i)
        ordered = [
            labels.index((r, c, int(i))) for r, p in enumerate(points) for c, at in p.items() for i in at
        ]
        rest = vt[rank:] / space.prior_sd()[:count] if rank < count else np.empty((0, count))
        try:
            return PredictiveCoordinates(posterior, centre, tuple(points), np.array(scales)[ordered], rest)
        except np.linalg.LinAlgError:
            return None

    @np.errstate(all="ignore")  # what overflows is left out by who asks
    def _evaluate(self, model_z: Floats) -> tuple[Floats, Floats]:
        """Coordinates (W, m) of the model's parameters, and their derivative (W, m, m)."""
        space, model = self.posterior.space, self.posterior.model
        z = np.tile(self.centre, (len(model_z), 1))
        z[:, : self.count] = model_z
        theta = space.to_physical(z)
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
    def model_derivative(self) -> Floats:
        """Derivative of the model's coordinates ``z`` with respect to those of this map, at the centre (m, m)."""
        return self._slope

    def forward(self, z: Floats) -> tuple[Floats, Floats, Bools]:
        """Coordinates, log Jacobian, and whether `inverse` leads back to the same point."""
        value, slope = self._evaluate(z[:, : self.count])
        u = np.concatenate([value, z[:, self.count :]], axis=1)
        usable = np.isfinite(u).all(axis=1)
        log_jacobian = np.full(len(z), -np.inf)
        log_jacobian[usable] = _log_determinant(slope[usable])
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
        for _ in range(ITERATIONS):
            value, slope = self._evaluate(x[active])
            usable = np.isfinite(value).all(axis=1) & np.isfinite(slope).all(axis=(1, 2))
            log_determinant = np.full(len(active), -np.inf)
            log_determinant[usable] = _log_determinant(slope[usable])
            usable &= np.isfinite(log_determinant)
            active, value, slope = active[usable], value[usable], slope[usable]
            if active.size == 0:
                break
            with np.errstate(all="ignore"):
                step = np.linalg.solve(slope, (u[active, :m] - value)[..., None])[..., 0]
                length = np.abs(step / self._width).max(axis=1)
            done = length < TOLERANCE
            found[active[done]] = True
            log_jacobian[active[done]] = log_determinant[usable][done]
            with np.errstate(invalid="ignore"):
                x[active] += step * np.minimum(1.0, 0.5 / np.maximum(length, 1e-300))[:, None]
            active = active[~done]
            if active.size == 0:
                break
        z[:, :m] = x
        return z, log_jacobian, found


@np.errstate(all="ignore")
def _log_determinant(slope: Floats) -> Floats:
    _, value = np.linalg.slogdet(slope)
    return np.asarray(value)


@dataclass(frozen=True, eq=False)
class NoiseScaledCoordinates:
    """Coordinates of the model's parameters, relative to their spread given those of the noise.

    With the response linearised about the mode, the coordinates ``w`` of the model are normal given the noise:
    precision ``H = J' R**-1 J + P`` and mean ``w0 + H**-1 (J' R**-1 r + p)``, where J is the derivative of the
    response, r the residual at the mode, R the covariance of the noise, and P, p the prior's part. The new
    coordinates are ``L' (w - mean)`` with ``H = L L'``; those of the noise are kept.

    Attributes
    ----------
    inner : Coordinates
        Map of the model's parameters, such as `PredictiveCoordinates`.
    posterior : Posterior
    count : int
        Number m of sampled parameters of the model.
    start : ndarray, shape (m,)
        ``w`` at the mode.
    jacobian : tuple of dict
        For each record, channel to rows of ``J'`` with the residual as the last row, (m + 1, n), each divided
        by the scale of the whitened residual at the mode relative to the sd of its noise.
    prior_precision, prior_pull : ndarray, shape (m, m) and (m,)
    """

    inner: Coordinates
    posterior: Posterior
    count: int
    start: Floats
    jacobian: tuple[Mapping[str, Floats], ...]
    prior_precision: Floats
    prior_pull: Floats

    @staticmethod
    def about(posterior: Posterior, centre: Floats, inner: Coordinates, count: int) -> NoiseScaledCoordinates:
        """Linearise about a mode; `count` is the number of sampled parameters of the model."""
        space, model = posterior.space, posterior.model
        slope = inner.model_derivative if isinstance(inner, PredictiveCoordinates) else np.eye(count)
        start = inner.forward(centre[None])[0][0, :count]
        theta = space.to_physical(centre)
        chain = space.derivative(centre)[:count]
        rows = []
        for record, place in zip(posterior.records, posterior.layout, strict=True):
            j = model.jacobian(theta[place.model], record.inputs)
            mu = model.predict(theta[place.model], record.inputs)
            steep = model.slope(theta[place.model], record.inputs)
            blocks = {}
            for channel in record.channels:
                sd = theta[place.noise[channel][0]]
                relative = np.sqrt(1.0 + (steep[channel] * record.temperature_sd / sd) ** 2)
                down = (j[channel][:, space.free_index[:count]] * chain) @ slope
                residual = record.observed[channel] - mu[channel]
                blocks[channel] = np.concatenate([down.T, residual[None]]) / relative
            rows.append(blocks)
        sd = space.prior_sd()[:count]
        precision = slope.T @ (slope / sd[:, None] ** 2)
        pull = slope.T @ ((space.prior_centre()[:count] - centre[:count]) / sd**2)
        return NoiseScaledCoordinates(inner, posterior, count, start, tuple(rows), precision, pull)

    def _normal_equations(self, noise_z: Floats) -> Floats:
        """Precision, pull and weighted sum of squares at the mode, given the noise.

        Returns
        -------
        ndarray, shape (m + 1, m + 1, W)
            Lower triangle of the precision bordered by the pull; the sum of squares in the corner. The rows of
            `noise_z` come last, so that what is done to one entry is done to all of them at once.
        """
        m = self.count
        z = np.concatenate([np.zeros((len(noise_z), m)), noise_z], axis=1)
        theta = self.posterior.space.to_physical(z)
        prior = np.block([[self.prior_precision, self.prior_pull[:, None]], [self.prior_pull, np.zeros(1)]])
        total = np.repeat(prior[..., None], len(z), axis=2)
        noise = self.posterior.noise
        for blocks, place, steps in zip(
            self.jacobian, self.posterior.layout, self.posterior.steps, strict=True
        ):
            for channel, rows in blocks.items():
                at = place.noise[channel]
                gram = np.moveaxis(noise.weighted_gram(rows, theta[:, at[1:]], steps), 0, -1)
                per_variance = 1.0 / theta[:, at[0]] ** 2
                for i in range(m + 1):  # by rows, which stay in the processor's cache
                    total[i, : i + 1] += gram[i, : i + 1] * per_variance
        return total

    def log_noise_marginal(self, noise_z: Floats) -> Floats:
        """Log posterior of the noise parameters (W,), the model's integrated out of the linearised posterior.

        Up to a constant: ``prior - (ln |R| + ln |H| + r' R**-1 r - b' H**-1 b)/2``.
        """
        with np.errstate(all="ignore"):
            total = self._normal_equations(noise_z)
            factor, usable = _factor(total)
            z = np.concatenate([np.zeros((len(noise_z), self.count)), noise_z], axis=1)
            theta = self.posterior.space.to_physical(z)
            value = self.posterior.log_prior(z) - 0.5 * total[-1, -1]
            noise = self.posterior.noise
            for record, place, steps in zip(
                self.posterior.records, self.posterior.layout, self.posterior.steps, strict=True
            ):
                none = np.zeros((len(z), record.n))
                for at in place.noise.values():
                    shape = theta[:, at[1:]]
                    density = noise.total_log_density(none, shape, steps) - record.n * np.log(theta[:, at[0]])
                    value += noise.information(shape) * density
            value += 0.5 * np.einsum("iw,iw->w", factor[-1], factor[-1]) - _log_volume(factor)
        return np.where(usable & np.isfinite(value), value, -np.inf)

    def _conditional(self, noise_z: Floats) -> tuple[Floats, Bools]:
        """`_factor` of the normal equations given the noise."""
        with np.errstate(all="ignore"):
            return _factor(self._normal_equations(noise_z))

    def forward(self, z: Floats) -> tuple[Floats, Floats, Bools]:
        """Coordinates, log Jacobian, and whether `inverse` leads back to the same point."""
        m = self.count
        w, log_jacobian, back = self.inner.forward(z)
        factor, usable = self._conditional(z[:, m:])
        v = np.einsum("jiw,jw->wi", factor[:m], (w[:, :m] - self.start).T) - factor[m].T
        return (
            np.concatenate([v, z[:, m:]], axis=1),
            log_jacobian + _log_volume(factor),
            back & usable,
        )

    def inverse(self, u: Floats) -> tuple[Floats, Floats, Bools]:
        """Points, log Jacobian there, and which were found."""
        m = self.count
        factor, usable = self._conditional(u[:, m:])
        w = self.start + _solve_transposed(factor[:m], u[:, :m].T + factor[m]).T
        z, log_jacobian, found = self.inner.inverse(np.concatenate([w, u[:, m:]], axis=1))
        reached = found & usable & np.isfinite(z).all(axis=1)
        return z, log_jacobian + _log_volume(factor), reached


# There are thousands of small systems. A loop over their rows, each step for all systems at once, is several times
# as fast as LAPACK one system after the other.
def _factor(total: Floats) -> tuple[Floats, Bools]:
    """Cholesky factors of bordered systems.

    Parameters
    ----------
    total : ndarray, shape (m + 1, m + 1, W)
        For each of W systems, the lower triangle of ``H`` (m, m), with the vector ``b`` as its last row.

    Returns
    -------
    factor : ndarray, shape (m + 1, m, W)
        Lower ``L`` with ``H = L L'``, and ``L**-1 b`` as its last row; that of the identity where it is not usable.
    usable : ndarray of bool, shape (W,)
        Whether all is finite and H positive definite, by more than rounding.
    """
    m = len(total) - 1
    factor = np.zeros((m + 1, m, total.shape[2]))
    usable = np.ones(total.shape[2], dtype=bool)
    with np.errstate(all="ignore"):
        for k in range(m):
            column = total[k:, k] - np.einsum("ijw,jw->iw", factor[k:, :k], factor[k, :k])
            usable &= column[0] > 1e-12 * total[k, k]
            np.divide(column, np.sqrt(column[0]), out=factor[k:, k])
    usable &= np.isfinite(factor[m]).all(axis=0) & np.isfinite(np.einsum("iiw->iw", factor[:m])).all(axis=0)
    if not usable.all():
        factor[:, :, ~usable] = np.eye(m + 1, m)[..., None]
    return factor, usable


def _log_volume(factor: Floats) -> Floats:
    """Logarithm of the determinant of ``L``, shape (W,)."""
    return np.asarray(np.log(np.einsum("iiw->iw", factor[:-1])).sum(axis=0))


def _solve_transposed(lower: Floats, b: Floats) -> Floats:
    """``x`` (m, W) with ``L' x = b``, for factors ``lower`` (m, m, W)."""
    x = b.copy()
    for i in reversed(range(len(x))):
        x[i] /= lower[i, i]
        x[:i] -= lower[i, :i] * x[i]
    return x
