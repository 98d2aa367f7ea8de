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
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.fitting.posterior import Posterior
from sma_bayes.fitting.sweep_functions import SweepFunctions, degrees_of_freedom, sums_of_squares


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
    z: Floats, sampled: Posterior, start: Floats, rng: np.random.Generator, *, one_size: bool = False
) -> Floats:
    """Draws of the curve of all sweeps from those of the measured ones.

    Parameters
    ----------
    z : ndarray, shape (..., D)
        Draws of the `sampled` posterior.
    sampled : Posterior
        As `of_measured_sweeps` gives it.
    start : ndarray, shape (D,)
        Point in sampled coordinates at which the functions of sweeps are tangents of the curve.
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
    slope = space.derivative(start)[:count]
    for channel, own in found:
        assert own.change is not None  # `of_measured_sweeps` has looked at it
        size = theta[:, sampled.layout[0].between[channel]]
        if one_size:
            normal = rng.standard_normal((len(theta), own.change.shape[1]))
            mean = size[:, None] / np.sqrt(len(own.parts)) * normal
        else:
            mean = mean_of_all(rng, sampled.draw_sweeps(rng, theta, 0, channel), size)
        out[:, :count] -= mean @ (own.change / slope[:, None]).T
    return out.reshape(z.shape)


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
