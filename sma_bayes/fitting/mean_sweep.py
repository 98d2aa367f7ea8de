"""Sample the curve of the sweeps that were measured; give back that of all sweeps.

Where each sweep has something of its own, the curve of all sweeps is known no better than so few of them tell, and the
more they may differ the less: curve and what the sweeps have in common can change places, along ridges that bend where
the curve is not linear in its parameters. The mean of the measured sweeps is known well whatever they have of their
own. So that is sampled, with what sweeps have of their own summing to zero, and what the mean of all sweeps differs by
is drawn and taken off its parameters afterwards: hierarchical centring (A. E. Gelfand, S. K. Sahu and B. P. Carlin,
Biometrika 82 (1995) 479). The prior of the curve is that of the measured sweeps' mean.

While sampling, what sweeps have of their own is of one size in all its q functions, which suits what readings say of
each. How the mean of S sweeps scatters is another question, and sweeps need not scatter alike in offset, stroke,
midpoint and rate. It is drawn as new sweeps are (`sma_bayes.fitting.sweep_functions`), given the sweeps' own weights,

    mean ~ t_v(0, (n between**2 + sum of w w')/(S v)),    v = S - 1 + n.

What the mean differs by is a change of the curve along its tangents. The parameters that go with it are those of the
model's curve that is nearest to the changed one where the record has readings, by least squares. Along the tangents
alone sweeps that differ by half a stroke would take them anywhere: the rate to its own 1e24 times.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from sma_bayes.arrays import Bools, Floats
from sma_bayes.fitting.curves import evenly_chosen
from sma_bayes.fitting.posterior import Posterior
from sma_bayes.fitting.sweep_functions import SweepFunctions, degrees_of_freedom, sums_of_squares

_MAX_TEMPERATURES = 48
"""Temperatures of readings, at most, at which a changed curve and that of the model are compared."""
_DRAWS_AT_ONCE = 1000
"""Whose curves are in memory together."""
_ITERATIONS = 30
"""Steps towards the nearest curve, at most."""
_FIRST_DAMPING, _LESS, _MORE = 1e-4, 0.2, 4.0
"""Damping of the first step [mean squared change of the curve by a standard deviation of the prior], and what becomes
of it where a step brings the curves nearer to each other or does not."""
_RIDGE = 1e-4
"""Share of the squared change of a curve that it has to gain for a parameter to change by one standard deviation of its
prior, by two four times as much."""
_IMPROVEMENT = 1e-4
"""Relative decrease of the squared distance below which the nearest curve is found."""


def of_measured_sweeps(posterior: Posterior) -> Posterior:
    """The same posterior with the curve that of the mean over the measured sweeps; itself where they do not differ.

    Itself as well where several records share the curve, or channels a parameter that sweeps change: then no mean over
    the sweeps of one channel of one record is the curve of all; and where there is but one sweep, or what sweeps change
    is known by its values alone.
    """
    every = [own for _, own in _sweep_functions(posterior)]
    moved = [
        np.any(own.change != 0.0, axis=1) for own in every if own.change is not None and len(own.parts) > 1
    ]
    if not moved or len(moved) < len(every) or len(posterior.records) > 1:
        return posterior
    if np.sum(moved, axis=0).max() > 1:
        return posterior
    return summing_to_zero(posterior)


def summing_to_zero(posterior: Posterior) -> Posterior:
    """The posterior of one record with what its sweeps have of their own summing to zero."""
    bases = {
        channel: basis
        if basis.sweep_functions is None
        else replace(basis, sweep_functions=replace(basis.sweep_functions, sum_to_zero=True))
        for channel, basis in posterior.discrepancy[0].items()
    }
    return posterior.on(posterior.records, discrepancy=(bases,))


def of_all_sweeps(
    z: Floats, sampled: Posterior, rng: np.random.Generator, *, one_size: bool = False
) -> Floats:
    """Draws of the curve of all sweeps from those of the measured ones.

    Parameters
    ----------
    z : ndarray, shape (..., D)
        Draws of the `sampled` posterior.
    sampled : Posterior
        As `of_measured_sweeps` gives it.
    rng : numpy.random.Generator
    one_size : bool
        Whether sweeps scatter by one size in all functions, as the density of the posterior has it.

    Returns
    -------
    ndarray, shape (..., D)
    """
    found = [(channel, own) for channel, own in _sweep_functions(sampled) if own.sum_to_zero]
    if not found:
        return z
    space, count = sampled.space, sampled.sampled_model.size
    out = z.reshape(-1, space.dimension).copy()
    theta = space.constrain(out)
    temperature = evenly_chosen(sampled.records[0].temperature, _MAX_TEMPERATURES)
    for channel, own in found:
        assert own.change is not None  # `of_measured_sweeps` has looked at it
        size = theta[:, sampled.layout[0].between[channel]]
        if one_size:
            normal = rng.standard_normal((len(theta), own.change.shape[1]))
            mean = size[:, None] / np.sqrt(len(own.parts)) * normal
        else:
            mean = mean_of_all(rng, sampled.draw_sweeps(rng, theta, 0, channel), size)
        moving = np.any(own.change != 0.0, axis=1)
        for part in (slice(i, i + _DRAWS_AT_ONCE) for i in range(0, len(out), _DRAWS_AT_ONCE)):
            curve = _Curve(sampled, channel, temperature, out[part], moving)
            # draws whose curve is not finite stay as they are
            with np.errstate(over="ignore", invalid="ignore"):
                out[part, :count] += _nearest(curve, -mean[part] @ own.at(temperature).T)
    return out.reshape(z.shape)


@dataclass(frozen=True, eq=False)
class _Curve:
    """The model's curve of a channel as a function of changes of its sampled parameters, for each of N draws.

    Attributes
    ----------
    posterior : Posterior
    channel : str
    temperature : ndarray, shape (g,)
    z : ndarray, shape (N, D)
        Sampled coordinates of the draws.
    moving : ndarray of bool, shape (p,)
        Parameters of the curve that may change.
    """

    posterior: Posterior
    channel: str
    temperature: Floats
    z: Floats
    moving: Bools

    def at(self, change: Floats) -> Floats:
        """Curves (N, g) after changes (N, p)."""
        theta, inputs = self._theta(change), {"temperature": self.temperature}
        return np.asarray(self.posterior.model.predict(theta, inputs)[self.channel])

    def derivative(self, change: Floats) -> Floats:
        """Of the curves with respect to the parameters that may change, shape (N, g, number of them)."""
        theta, inputs = self._theta(change), {"temperature": self.temperature}
        free = self.posterior.sampled_model
        slopes = self.posterior.model.jacobian(theta, inputs)[self.channel][..., free]
        slopes = slopes * self.posterior.space.derivative(self._moved(change))[:, None, : free.size]
        return np.asarray(slopes[..., self.moving])

    def _moved(self, change: Floats) -> Floats:
        z = self.z.copy()
        z[:, : change.shape[1]] += change
        return z

    def _theta(self, change: Floats) -> Floats:
        theta = self.posterior.space.constrain(self._moved(change))
        return np.asarray(theta[:, self.posterior.layout[0].model])


def _nearest(curve: _Curve, by: Floats) -> Floats:
    """Changes (N, p) of parameters that bring curves nearest to what they are with something (N, g) added to them.

    Levenberg's method, all draws at once. Changes are counted in standard deviations of the prior: what curves hardly
    see stays where it is (`_RIDGE`).
    """
    scale = curve.posterior.space.prior_sd()[: curve.moving.size][curve.moving]
    change, eye = np.zeros((len(by), curve.moving.size)), np.eye(scale.size)
    start = curve.at(change)
    wanted = start + by
    to_go = wanted - start
    distance = _mean_square(to_go)
    damping, going = np.full(len(wanted), _FIRST_DAMPING), np.isfinite(distance) & (distance > 0.0)
    ridge = _RIDGE * np.where(going, distance, 1.0)
    for _ in range(_ITERATIONS):
        if not going.any():
            break
        slopes = curve.derivative(change) * scale
        away = change[:, curve.moving] / scale
        square = np.swapaxes(slopes, 1, 2) @ slopes / wanted.shape[1]
        downhill = np.einsum("ngp,ng->np", slopes, to_go) / wanted.shape[1] - ridge[:, None] * away
        size = np.trace(square, axis1=1, axis2=2) / scale.size
        going &= np.isfinite(size) & np.isfinite(downhill).all(axis=1)
        square[~going], downhill[~going] = 0.0, 0.0
        square += np.where(going, damping * size + ridge, 1.0)[:, None, None] * eye
        trial = change.copy()
        trial[:, curve.moving] += scale * np.linalg.solve(square, downhill[..., None])[..., 0]
        left = wanted - curve.at(trial)
        after = _mean_square(left) + ridge * np.sum((trial[:, curve.moving] / scale) ** 2, axis=1)
        nearer = going & (after < distance)
        going &= ~(nearer & (distance - after < _IMPROVEMENT * distance))
        change[nearer], distance[nearer], to_go[nearer] = trial[nearer], after[nearer], left[nearer]
        damping = np.where(nearer, _LESS * damping, _MORE * damping)
    return change


def _mean_square(curve: Floats) -> Floats:
    """Of N curves; infinite where one is not finite."""
    square = np.mean(curve**2, axis=1)
    return np.where(np.isnan(square), np.inf, square)


def mean_of_all(rng: np.random.Generator, weights: Floats, size: Floats) -> Floats:
    """Mean over the measured sweeps less that over all, drawn given what the measured ones have of their own.

    Parameters
    ----------
    rng : numpy.random.Generator
    weights : ndarray, shape (W, S, q)
        Of the measured sweeps; they sum to zero.
    size : ndarray, shape (W,)
        Their standard deviation in all functions together.

    Returns
    -------
    ndarray, shape (W, q)
    """
    count, sweeps, functions = weights.shape
    root, degrees = np.linalg.cholesky(sums_of_squares(weights, size)), degrees_of_freedom(sweeps)
    normal = np.einsum("wij,wj->wi", root, rng.standard_normal((count, functions)))
    return np.asarray(normal / np.sqrt(sweeps * rng.chisquare(degrees, count))[:, None])


def _sweep_functions(posterior: Posterior) -> Iterator[tuple[str, SweepFunctions]]:
    """Channels whose sweeps have something of their own, and what it is made of."""
    for bases, place in zip(posterior.discrepancy, posterior.layout, strict=True):
        for channel, basis in bases.items():
            if basis.sweep_functions is not None and channel in place.between:
                yield channel, basis.sweep_functions
