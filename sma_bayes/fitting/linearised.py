"""The response of a posterior linearised at a point, and what it tells of the parameters."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Self

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.fitting.posterior import Posterior


@dataclass(frozen=True, eq=False)
class LinearisedResponse:
    """The response linearised in the model's sampled parameters, which come first in ``z``.

    Attributes
    ----------
    posterior : Posterior
    z : ndarray, shape (D,)
        Where it is linearised.
    theta, chain : ndarray, shape (P,) and (D,)
        Parameters there, and derivatives of the sampled ones with respect to their coordinates.
    slopes : tuple of mapping
        For each record, channel to ``d(response)/dz``, shape (n, m).
    """

    posterior: Posterior
    z: Floats
    theta: Floats
    chain: Floats
    slopes: tuple[Mapping[str, Floats], ...]

    @classmethod
    @np.errstate(all="ignore")  # what overflows is left out by who asks
    def at(cls, posterior: Posterior, z: Floats) -> Self:
        """Linearise at a point."""
        theta, chain = posterior.space.constrain(z), posterior.space.derivative(z)
        sampled = posterior.sampled_model
        slopes = []
        for record, place in zip(posterior.records, posterior.layout, strict=True):
            jacobian = posterior.model.jacobian(theta[place.model], record.inputs)
            slopes.append({c: jacobian[c][:, sampled] * chain[: sampled.size] for c in record.channels})
        return cls(posterior, z, theta, chain, tuple(slopes))

    @property
    def count(self) -> int:
        """Number m of sampled parameters of the model."""
        return int(self.posterior.sampled_model.size)

    def channels(self) -> Iterator[tuple[int, str, Floats, float]]:
        """Number of the record, channel, ``d(response)/dz`` (n, m) and sd of the noise."""
        for r, (place, slopes) in enumerate(zip(self.posterior.layout, self.slopes, strict=True)):
            for channel, slope in slopes.items():
                yield r, channel, slope, float(self.theta[place.noise[channel][0]])

    @np.errstate(all="ignore")
    def information(self) -> Floats:
        """Information that data and prior would hold if errors were independent and normal.

        Returns
        -------
        ndarray, shape (D, D)
            ``J' R**-1 J`` for the model's parameters, ``2 n`` for the logarithm of the sd of each channel's noise, and
            ``1/sd**2`` of the prior of each parameter. Its inverse is the covariance of a posterior that is normal.
        """
        posterior, m = self.posterior, self.count
        total = np.diag(posterior.space.prior_sd() ** -2.0)
        for r, channel, slope, sd in self.channels():
            total[:m, :m] += slope.T @ slope / sd**2
            # nowhere if the sd is fixed
            at = posterior.space.free_index == posterior.layout[r].noise[channel][0]
            total[at, at] += 2.0 * len(slope) * (self.chain[at] / sd) ** 2
        return np.asarray(total)
