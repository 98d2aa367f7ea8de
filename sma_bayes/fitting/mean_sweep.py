"""Sample the curve of the sweeps that were measured; give back that of all sweeps.

Where each sweep has something of its own, the curve of all sweeps is known no better than so few of them tell, and the
more they may differ the less: curve and what the sweeps have in common can change places, along ridges that bend where
the curve is not linear in its parameters. The mean of the measured sweeps is known well whatever they have of their
own. So that is sampled, with what sweeps have of their own summing to zero, and what the mean of ``S`` sweeps has of
its own, ``N(0, between**2/S)``, is drawn and taken off its parameters afterwards: hierarchical centring (A. E. Gelfand,
S. K. Sahu and B. P. Carlin, Biometrika 82 (1995) 479). Where the curve is linear in its parameters the one posterior is
the other. The prior of the curve is that of the measured sweeps' mean.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from sma_bayes.arrays import Bools, Floats
from sma_bayes.fitting.posterior import Posterior
from sma_bayes.fitting.sweep_functions import SweepFunctions
from sma_bayes.sampling.ensembles import Draws


def of_measured_sweeps(posterior: Posterior) -> Posterior:
    """The same posterior with the curve that of the mean over the measured sweeps; itself where they do not differ.

    Itself as well where several records share the curve, or channels a parameter that sweeps change: then no mean over
    the sweeps of one channel of one record is the curve of all.
    """
    moved = [_moved(own) for _, own in _sweep_functions(posterior)]
    if not moved or len(posterior.records) > 1 or np.sum(moved, axis=0).max() > 1:
        return posterior
    bases = {
        channel: basis
        if basis.sweep_functions is None
        else replace(basis, sweep_functions=replace(basis.sweep_functions, sum_to_zero=True))
        for channel, basis in posterior.discrepancy[0].items()
    }
    return replace(posterior, discrepancy=(bases,))


def of_all_sweeps(draws: Draws, sampled: Posterior, start: Floats, rng: np.random.Generator) -> Draws:
    """Draws of the curve of all sweeps from those of the measured ones.

    Parameters
    ----------
    draws : Draws
        Of the `sampled` posterior.
    sampled : Posterior
        As `of_measured_sweeps` gives it.
    start : ndarray, shape (D,)
        Point in sampled coordinates at which the functions of sweeps are tangents of the curve.
    rng : numpy.random.Generator
    """
    found = [(channel, own) for channel, own in _sweep_functions(sampled) if own.sum_to_zero]
    if not found:
        return draws
    space, count = sampled.space, sampled.sampled_model.size
    z = draws.z.reshape(-1, space.dimension).copy()
    every = space.constrain(z)
    slope = space.derivative(start)[:count]
    for channel, own in found:
        assert own.change is not None  # `_moved` has looked at it
        size = every[:, sampled.layout[0].between[channel]] / np.sqrt(len(own.parts))
        weights = size[:, None] * rng.standard_normal((len(z), own.change.shape[1]))
        z[:, :count] -= weights @ (own.change / slope[:, None]).T
    return replace(draws, z=z.reshape(draws.z.shape))


def _sweep_functions(posterior: Posterior) -> Iterator[tuple[str, SweepFunctions]]:
    """Channels whose sweeps have something of their own, and what it is made of."""
    for bases, place in zip(posterior.discrepancy, posterior.layout, strict=True):
        for channel, basis in bases.items():
            if basis.sweep_functions is not None and channel in place.between:
                yield channel, basis.sweep_functions


def _moved(own: SweepFunctions) -> Bools:
    """Which parameters of the curve sweeps change."""
    assert own.change is not None
    return np.asarray(np.any(own.change != 0.0, axis=1))
