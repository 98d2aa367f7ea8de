"""The correlation factor r, R2, adjusted R2 and RMSE of curves and data: one value for each draw of the curve.

All of them follow from sums over the samples, and sums over several sets of samples add up. So the factors of a
record, of what was held out of it fold by fold, and of all records together are one calculation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import reduce
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sma_bayes.arrays import Floats
from sma_bayes.errors import MeasurementError
from sma_bayes.fitting.curves import INTERVAL, interval
from sma_bayes.fitting.fit import Fit

FACTORS: Final = ("r", "r2", "adj_r2", "rmse")
"""Names of the factors, in the order in which they are told."""
CONSTANT_TOLERANCE: Final = 1e-12
"""A series whose standard deviation is below this share of its mean does not vary beyond rounding."""


@dataclass(frozen=True, slots=True, eq=False)
class Agreement:
    """How well curves and data agree: sums over n samples, one for each of N draws.

    Attributes
    ----------
    n : int
        Samples.
    parameters : int
        Parameters of the curve that were estimated from these samples; 0 for samples that were held out.
    data_mean, curve_mean : ndarray, shape (N,)
        [unit of the channel].
    data_square, curve_square, product, error : ndarray, shape (N,)
        Sums of squared deviations of data and of curve from their means, of the product of both deviations, and of
        the squared difference of data and curve [unit of the channel squared].
    """

    n: int
    parameters: int
    data_mean: Floats
    curve_mean: Floats
    data_square: Floats
    curve_square: Floats
    product: Floats
    error: Floats

    @property
    def draws(self) -> int:
        """Number N of draws."""
        return int(self.error.size)

    @property
    def r(self) -> Floats:
        """Pearson's correlation of data and curve, shape (N,); NaN where one of the two is flat."""
        vary = self._varies(self.data_square, self.data_mean) & self._varies(
            self.curve_square, self.curve_mean
        )
        size = np.sqrt(self.data_square * self.curve_square)
        return np.asarray(np.clip(_quotient(self.product, size, vary), -1.0, 1.0))

    @property
    def r2(self) -> Floats:
        """``1 - sum (y - curve)**2 / sum (y - mean y)**2``, shape (N,); NaN where the data are flat.

        Negative where the mean of these samples predicts them better than the curve does.
        """
        return 1.0 - _quotient(self.error, self.data_square, self._varies(self.data_square, self.data_mean))

    @property
    def adj_r2(self) -> Floats:
        """``1 - (1 - R2)(n - 1)/(n - p)`` for p parameters, shape (N,); NaN without a degree of freedom."""
        left = self.n - self.parameters
        return 1.0 - (1.0 - self.r2) * ((self.n - 1) / left if left > 0 else np.nan)

    @property
    def rmse(self) -> Floats:
        """``sqrt(mean (y - curve)**2)``, shape (N,) [unit of the channel]."""
        return np.asarray(np.sqrt(self.error / self.n))

    def _varies(self, square: Floats, mean: Floats) -> NDArray[np.bool_]:
        return np.asarray(np.sqrt(square / self.n) > CONSTANT_TOLERANCE * np.abs(mean))


def _quotient(above: Floats, below: Floats, defined: NDArray[np.bool_]) -> Floats:
    out = np.full(above.shape, np.nan)
    usable = defined & (below > 0.0)
    out[usable] = above[usable] / below[usable]
    return out


def agreement(data: Floats, curve: Floats, parameters: int = 0) -> Agreement:
    """Compare data (n,) or (N, n) with curves (N, n).

    Parameters
    ----------
    data, curve : ndarray
        [unit of the channel].
    parameters : int
        Parameters of the curve that were estimated from these data.

    Examples
    --------
    >>> found = agreement(np.array([1.0, 2.0, 3.0]), np.array([[2.0, 4.0, 6.0], [2.0, 2.0, 2.0]]))
    >>> found.r.tolist(), found.r2.tolist()
    ([1.0, nan], [-6.0, 0.0])
    """
    data = np.broadcast_to(data, curve.shape)
    data_mean, curve_mean = data.mean(axis=-1), curve.mean(axis=-1)
    y, c = data - data_mean[:, None], curve - curve_mean[:, None]
    return Agreement(
        n=int(curve.shape[-1]),
        parameters=parameters,
        data_mean=data_mean,
        curve_mean=curve_mean,
        data_square=np.sum(y * y, axis=-1),
        curve_square=np.sum(c * c, axis=-1),
        product=np.sum(y * c, axis=-1),
        error=np.sum((data - curve) ** 2, axis=-1),
    )


def joined(parts: Sequence[Agreement], parameters: int | None = None) -> Agreement:
    """The agreement of all samples of several parts together; draws are paired as they come.

    Parameters
    ----------
    parts : sequence of Agreement
        At least one. Where they have different numbers of draws, as many are used as the shortest has.
    parameters : int, optional
        Parameters that were estimated from all of them; the sum of those of the parts by default.

    Raises
    ------
    MeasurementError
        If there is no part.
    """
    if not parts:
        raise MeasurementError("no samples to compare with a curve", expected="one part or more")
    draws = min(part.draws for part in parts)
    total = reduce(_add, (_first(part, draws) for part in parts))
    if parameters is None:
        return total
    return Agreement(total.n, parameters, *(getattr(total, name) for name in _SUMS))


_SUMS: Final = tuple(f.name for f in fields(Agreement) if f.name not in ("n", "parameters"))


def _first(part: Agreement, draws: int) -> Agreement:
    return Agreement(part.n, part.parameters, *(getattr(part, name)[:draws] for name in _SUMS))


def _add(one: Agreement, other: Agreement) -> Agreement:
    """Sums about the common means (T. F. Chan, G. H. Golub, R. J. LeVeque, Am. Stat. 37 (1983) 242)."""
    n = one.n + other.n
    shift_data, shift_curve = other.data_mean - one.data_mean, other.curve_mean - one.curve_mean
    share = one.n * other.n / n
    return Agreement(
        n=n,
        parameters=one.parameters + other.parameters,
        data_mean=one.data_mean + shift_data * other.n / n,
        curve_mean=one.curve_mean + shift_curve * other.n / n,
        data_square=one.data_square + other.data_square + share * shift_data**2,
        curve_square=one.curve_square + other.curve_square + share * shift_curve**2,
        product=one.product + other.product + share * shift_data * shift_curve,
        error=one.error + other.error,
    )


def quantiles(values: Floats) -> dict[str, float | None]:
    """Quantiles of the draws in which a factor is defined, and the share in which it is not.

    Parameters
    ----------
    values : ndarray, shape (N,)
        NaN where undefined.

    Returns
    -------
    dict
        ``q05``, ``median``, ``q95``, None where no draw defines them; ``undefined`` [1].
    """
    defined = values[np.isfinite(values)]
    found = interval(defined) if defined.size else dict.fromkeys(INTERVAL)
    return {**found, "undefined": 1.0 - defined.size / values.size}


def factors(found: Agreement) -> dict[str, dict[str, float | None]]:
    """Quantiles of every factor, as result files have them; no adjusted R2 for samples that were held out."""
    names = [name for name in FACTORS if name != "adj_r2" or found.parameters > 0]
    return {name: quantiles(getattr(found, name)) for name in names}


def correlation_factors(
    fit: Fit, replicated: dict[str, Floats], record: int = 0
) -> tuple[dict[str, Agreement], dict[str, Agreement]]:
    """Agreement of each observed channel with the measured data, and with data replicated from the posterior.

    The first says how well the posterior curves describe this measurement; the second how well they would
    describe a repetition of it if model and noise are right.

    Parameters
    ----------
    fit : Fit
    replicated : dict
        Channel to replicated data (N, n), one for each kept draw.
    record : int
    """
    r = fit.records[record]
    curve = fit.posterior.predict(fit.flat, r.inputs, record=record, weights=fit.discrepancy)
    p = {channel: goodness.p for channel, goodness in fit.warm_start.fit[record].items()}
    measured = {c: agreement(r.observed[c], curve[c], p[c]) for c in r.channels}
    again = {c: agreement(replicated[c], curve[c][: len(replicated[c])], p[c]) for c in r.channels}
    return measured, again
