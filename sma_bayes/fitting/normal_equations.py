"""The normal distribution that a linearised response gives the model's parameters, for many values of the noise.

With the response linear in the coordinates ``w`` of the model, and the parameters of the noise given, ``w - w0`` is
normal with precision ``H = J' R**-1 J + P`` and mean ``H**-1 b``, ``b = J' R**-1 r + p``, where J is the derivative
of the response, r the residual at ``w0``, R the covariance of the noise, and P, p the prior's part.

A discrepancy beside the curve is integrated out: what the samples tell of its weights is eliminated from the equations.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from sma_bayes.arrays import Bools, Floats, Ints
from sma_bayes.fitting.discrepancy_weights import WithoutSweeps, safe_cholesky
from sma_bayes.fitting.posterior import Posterior
from sma_bayes.fitting.sweep_functions import SweepFunctions
from sma_bayes.noise import Steps


@dataclass(frozen=True, eq=False)
class NormalEquations:
    """What the linearised response says of the model's parameters, given those of the noise.

    Attributes
    ----------
    posterior : Posterior
    count : int
        Number m of sampled parameters of the model.
    rows : tuple of dict
        For each record, channel to rows of ``J'`` with the residual as the last row, (m + 1, n), each divided
        by the scale of the whitened residual at the mode relative to the sd of its noise.
    bases : tuple of dict
        For each record, channel to the basis of its discrepancy (k, n), divided likewise, and after it functions of the
        sweep that each sample is of, where sweeps have anything of their own; channels without one are left out.
    precision, pull : ndarray, shape (m, m) and (m,)
        P and p of the prior.
    """

    posterior: Posterior
    count: int
    rows: tuple[Mapping[str, Floats], ...]
    bases: tuple[Mapping[str, Floats], ...]
    precision: Floats
    pull: Floats

    def solved(self, theta: Floats) -> tuple[Systems, Floats, Floats]:
        """Solve for values of the noise.

        Parameters
        ----------
        theta : ndarray, shape (W, P)
            Parameter vectors, of which only those of the noise are looked at.

        Returns
        -------
        Systems
        squares : ndarray, shape (W,)
            ``r' R**-1 r``, with the covariance of discrepancies in R.
        log_volume : ndarray, shape (W,)
            Half the logarithm of the determinant by which discrepancies increase that of R.
        """
        with np.errstate(all="ignore"):
            total, log_volume = self._bordered(theta)
            return *Systems.of(total), log_volume

    def channels(self) -> Iterator[tuple[Floats, Ints, Steps]]:
        """Rows, positions of the noise and steps of each channel of each record."""
        for blocks, place, steps in zip(self.rows, self.posterior.layout, self.posterior.steps, strict=True):
            for channel, rows in blocks.items():
                yield rows, place.noise[channel], steps

    def _bordered(self, theta: Floats) -> tuple[Floats, Floats]:
        """Precision, pull and sum of squares of each value of the noise, and the volume of discrepancies.

        Returns
        -------
        ndarray, shape (m + 1, m + 1, W)
            Lower triangle of the precision bordered by the pull; the sum of squares in the corner. The rows of
            `theta` come last, so that what is done to one entry is done to all of them at once.
        ndarray, shape (W,)
        """
        prior = np.block([[self.precision, self.pull[:, None]], [self.pull, np.zeros(1)]])
        total = np.repeat(prior[..., None], len(theta), axis=2)
        log_volume = np.zeros(len(theta))
        for record, blocks in enumerate(self.rows):
            place, steps = self.posterior.layout[record], self.posterior.steps[record]
            for channel, rows in blocks.items():
                at = place.noise[channel]
                per_variance = 1.0 / theta[:, at[0]] ** 2
                shape = self.posterior.noise.shape_of(theta[:, at])
                basis = self.bases[record].get(channel)
                if basis is None:
                    gram = self.posterior.noise.information(shape, steps).gram(rows)
                elif channel in place.between:
                    sizes = (theta[:, places[channel]] for places in (place.size, place.between))
                    ratios = (per_variance * size**2 for size in sizes)
                    own = self.posterior.discrepancy[record][channel].sweep_functions
                    assert own is not None  # a size stands for it
                    gram, volume = self._without_sweeps(rows, basis, shape, steps, own, *ratios)
                    log_volume += volume
                else:
                    ratio = per_variance * theta[:, place.size[channel]] ** 2
                    gram, volume = self._without_weights(rows, basis, shape, steps, ratio)
                    log_volume += volume
                gram = np.moveaxis(gram, 0, -1)
                for i in range(self.count + 1):  # by rows, which stay in the processor's cache
                    total[i, : i + 1] += gram[i, : i + 1] * per_variance
        return total, log_volume

    def _without_sweeps(
        self,
        rows: Floats,
        basis: Floats,
        shape: Floats,
        steps: Steps,
        own: SweepFunctions,
        ratio: Floats,
        of_sweeps: Floats,
    ) -> tuple[Floats, Floats]:
        """The same as `_without_weights` where each sweep has something of its own, of another ratio (W,)."""
        among, apart = np.split(basis, [len(basis) - len(own.samples)])
        information = self.posterior.noise.information(shape, steps)
        sweeps = WithoutSweeps(
            information, np.concatenate([rows, among]), replace(own, samples=apart), np.sqrt(of_sweeps)
        )
        gram, volume = _eliminated(sweeps.left, len(rows), ratio)
        return gram, sweeps.half_log_determinant + volume

    def _without_weights(
        self, rows: Floats, basis: Floats, shape: Floats, steps: Steps, ratio: Floats
    ) -> tuple[Floats, Floats]:
        """Inner products (W, m + 1, m + 1) of rows with the weights of a basis integrated out; see `_eliminated`."""
        noise = self.posterior.noise
        if noise.autocorrelated:
            gram = noise.information(shape, steps).gram(np.concatenate([rows, basis]))
            return _eliminated(gram, len(rows), ratio)
        # without memory one set of axes serves all values of the noise
        power, axes = np.linalg.eigh(basis @ basis.T)
        across = axes.T @ (basis @ rows.T)
        share = noise.location_information(shape)[:, None]
        held = 1.0 + (share * ratio[:, None]) * np.maximum(power, 0.0)
        products = np.einsum("ki,kj->kij", across, across).reshape(len(power), -1)
        taken = (share * ratio[:, None] / held) @ products
        gram = share[:, :, None] * ((rows @ rows.T) - taken.reshape(-1, len(rows), len(rows)))
        return np.asarray(gram), np.asarray(0.5 * np.log(held).sum(axis=1))


def _eliminated(gram: Floats, kept: int, ratio: Floats) -> tuple[Floats, Floats]:
    """Inner products of the first rows with the weights of the last ones integrated out.

    Parameters
    ----------
    gram : ndarray, shape (W, kept + k, kept + k)
    kept : int
    ratio : ndarray, shape (W,)
        Variance of the weights over that of the noise.

    Returns
    -------
    ndarray, shape (W, kept, kept)
    half_log_determinant : ndarray, shape (W,)
        Of ``1 + ratio * gram`` of the last rows.
    """
    first, across, last = gram[:, :kept, :kept], gram[:, kept:, :kept], gram[:, kept:, kept:]
    with np.errstate(invalid="ignore"):
        factor, usable = safe_cholesky(ratio[:, None, None] * last)
    root = np.sqrt(np.where(usable, ratio, 0.0))[:, None, None]
    shared = np.linalg.solve(factor, root * across)
    log_volume = np.log(np.einsum("wkk->wk", factor)).sum(axis=1)
    return first - np.swapaxes(shared, 1, 2) @ shared, np.where(usable, log_volume, np.nan)


# There are thousands of small systems. A loop over their rows, each step for all systems at once, is several times
# as fast as LAPACK one system after the other.
class Systems:
    """Normal distributions of ``w - w0``, one for each of W values of the noise.

    Parameters
    ----------
    factor : ndarray, shape (m + 1, m, W)
        Lower ``L`` with ``H = L L'``, and ``L**-1 b`` as its last row; that of the identity where it is not usable.
    usable : ndarray of bool, shape (W,)
        Whether there is one; where not, `whiten` and `colour` leave finite numbers as they may be.

    Attributes
    ----------
    log_volume : ndarray, shape (W,)
        ``ln |H|/2``.
    pull_squared : ndarray, shape (W,)
        ``b' H**-1 b``.
    """

    def __init__(self, factor: Floats, usable: Bools) -> None:
        self.factor = factor
        self.usable = usable
        self.log_volume = np.log(np.einsum("iiw->iw", factor[:-1])).sum(axis=0)
        self.pull_squared = np.einsum("iw,iw->w", factor[-1], factor[-1])

    @staticmethod
    def of(total: Floats) -> tuple[Systems, Floats]:
        """Factor bordered systems (m + 1, m + 1, W): lower triangles of H, b as the last row, sums of squares.

        What is not finite, or positive definite by no more than rounding, is not usable.
        """
        m = len(total) - 1
        factor = np.zeros((m + 1, m, total.shape[2]))
        usable = np.ones(total.shape[2], dtype=bool)
        for k in range(m):
            column = total[k:, k] - np.einsum("ijw,jw->iw", factor[k:, :k], factor[k, :k])
            usable &= column[0] > 1e-12 * total[k, k]
            np.divide(column, np.sqrt(column[0]), out=factor[k:, k])
        usable &= np.isfinite(factor[m]).all(axis=0) & np.isfinite(np.einsum("iiw->iw", factor[:m])).all(
            axis=0
        )
        if not usable.all():
            factor[:, :, ~usable] = np.eye(m + 1, m)[..., None]
        return Systems(factor, usable), total[-1, -1]

    def whiten(self, x: Floats) -> Floats:
        """Standard normal coordinates of points ``w - w0``, shape (W, m)."""
        return np.asarray(np.einsum("jiw,jw->wi", self.factor[:-1], x.T) - self.factor[-1].T)

    def colour(self, v: Floats) -> Floats:
        """Points ``w - w0`` at standard normal coordinates, shape (W, m)."""
        x = v.T + self.factor[-1]
        for i in reversed(range(len(x))):
            x[i] /= self.factor[i, i]
            x[:i] -= self.factor[i, :i] * x[i]
        return np.asarray(x.T)
