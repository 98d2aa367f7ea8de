"""What the law says of one sweep: its curve nearest to each draw of the posterior."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.optimize import least_squares
from scipy.special import expit, logit

from sma_bayes.arrays import Floats
from sma_bayes.studies.card.law import share

GRID: Final = 81
"""Temperatures at which law and posterior are compared, evenly over what was measured."""
LEAST: Final = 0.05
"""Least exponent: the law nears a logistic curve there, and solvers still follow it."""
_RIDGE: Final = 1e-3
"""Pull of the logits of the exponents to zero, as a share of the range of the curve: it decides where nothing else."""
_PASSES: Final = 8
_STEP: Final = 1e-4
_CLOSE: Final = 0.02
"""Chord steps have converged where the last one is below this share of the spread of the draws."""
NAMES: Final = ("middle", "width", "p", "q", "offset", "alpha_A", "strain", "alpha_difference")
"""Numbers of a sweep: middle and width of the transformation [K], exponents at no and at all martensite [1], strain at
the common temperature [1], slope of the austenite [1/K], change of strain [1], difference of the slopes [1/K]."""


@dataclass(frozen=True, slots=True, eq=False)
class SweepFeatures:
    """Numbers of the law for one sweep.

    Attributes
    ----------
    point : ndarray, shape (8,)
        Of the mean curve, in the order of `NAMES`.
    draws : ndarray, shape (S, 8)
    miss : float
        Root mean square by which the law misses the mean curve, as a share of its range [1].
    finished : bool
        Whether less than a twentieth of the transformation lies outside the measured temperatures.
    """

    point: Floats
    draws: Floats
    miss: float
    finished: bool


def curve_of(numbers: Floats, temperature: Floats, common: float) -> Floats:
    """Strain of the law at temperatures (m,) [K].

    Parameters
    ----------
    numbers : ndarray, shape (8,)
        In the order of `NAMES`.
    temperature : ndarray, shape (m,)
    common : float
        Temperature to which the strain refers [K].
    """
    middle, width, p, q, *lines = numbers
    x = share(temperature, middle + 0.5 * width, middle - 0.5 * width, p, q)
    return np.asarray(_columns(x, temperature - common) @ np.asarray(lines))


def _columns(x: Floats, u: Floats) -> Floats:
    return np.stack([np.ones_like(u), u, x, x * u], axis=1)


def nearest_law(temperature: Floats, curves: Floats, common: float) -> SweepFeatures:
    """Numbers of the law whose curve is nearest to each curve, in the mean square.

    Parameters
    ----------
    temperature : ndarray, shape (m,)
        [K].
    curves : ndarray, shape (S, m)
        Strain, more of it with more martensite [1].
    common : float
        See `curve_of`.
    """
    mean = curves.mean(axis=0)
    scale = float(np.ptp(mean))
    work = _Nearest(temperature, common, scale)
    z = min(
        (work.fitted(mean, start) for start in work.starts(mean)), key=lambda found: work.cost(found, mean)
    )
    point = work.all_of(z, mean)
    draws, z_draws = np.empty((len(curves), 8)), work.near(z, curves, mean)
    for i, (own, y) in enumerate(zip(z_draws, curves, strict=True)):
        draws[i] = work.all_of(own, y)
    x = share(temperature[[0, -1]], point[0] + 0.5 * point[1], point[0] - 0.5 * point[1], *point[2:4])
    miss = float(np.sqrt(np.mean((curve_of(point, temperature, common) - mean) ** 2)) / scale)
    return SweepFeatures(point, draws, miss, bool(x[0] > 0.95 and x[1] < 0.05))


def with_calibration_errors(
    found: SweepFeatures,
    thermometer: tuple[Floats, Floats],
    strain: tuple[Floats, Floats],
    common: float,
) -> SweepFeatures:
    """Numbers of a sweep whose instruments are off: by ``gain * reading + shift``, draw by draw.

    Errors that move the whole curve by more than it is wide would lead the search for the nearest law astray.

    Parameters
    ----------
    found : SweepFeatures
        Of the curves as they were logged.
    thermometer, strain : tuple of ndarray, shape (S,)
        Gain [1] and shift [K, 1] of temperatures and strains.
    common : float
        See `curve_of`.
    """
    (gain, shift), (stretch, up) = thermometer, strain
    middle, width, p, q, offset, austenite, change, difference = found.draws.T
    read = (common - shift) / gain - common  # how far from the common temperature the thermometer showed it
    numbers = (
        gain * middle + shift,
        gain * width,
        p,
        q,
        stretch * (offset + austenite * read) + up,
        stretch * austenite / gain,
        stretch * (change + difference * read),
        stretch * difference / gain,
    )
    return replace(found, draws=np.stack(numbers, axis=1))


@dataclass(frozen=True, slots=True, eq=False)
class _Nearest:
    """Least squares over middle, log width and logits of the exponents; the lines follow for each."""

    temperature: Floats
    common: float
    scale: float

    def starts(self, y: Floats) -> list[Floats]:
        """From where the curve is half way, for sharp and for round corners."""
        t = self.temperature
        half = float(t[np.argmin(np.abs(y - 0.5 * (y.min() + y.max())))])
        width = np.log(0.25 * (t[-1] - t[0]))
        return [np.array([half, width, n, n]) for n in (-1.0, 1.5)]

    def share(self, z: Floats) -> Floats:
        width = np.exp(np.clip(z[1], -3.0, 7.0))
        p, q = _exponents(z[2:])
        return share(self.temperature, z[0] + 0.5 * width, z[0] - 0.5 * width, float(p), float(q))

    def residuals(self, z: Floats, y: Floats) -> Floats:
        columns = _columns(self.share(z), self.temperature - self.common)
        lines = np.linalg.lstsq(columns, y, rcond=None)[0]
        return np.concatenate([(y - columns @ lines) / self.scale, _RIDGE * z[2:]])

    def cost(self, z: Floats, y: Floats) -> float:
        r = self.residuals(z, y)
        return float(r @ r)

    def fitted(self, y: Floats, start: Floats) -> Floats:
        found = least_squares(
            self.residuals, start, method="lm", x_scale=[1.0, 0.1, 0.3, 0.3], args=(y,), max_nfev=400
        )
        return np.asarray(found.x)

    def near(self, z: Floats, curves: Floats, mean: Floats) -> Floats:
        """Coordinates (S, 4) for curves near the mean: chord steps, of which the nearest law is kept."""
        steps = np.array([_STEP * np.exp(z[1]), _STEP, _STEP, _STEP])
        slopes = np.stack(
            [
                (self.residuals(z + h * e, mean) - self.residuals(z - h * e, mean)) / (2.0 * h)
                for h, e in zip(steps, np.eye(4), strict=True)
            ],
            axis=1,
        )
        back = np.linalg.pinv(slopes)
        out, best = np.repeat(z[None], len(curves), axis=0), np.full(len(curves), np.inf)
        found = out.copy()
        for _ in range(_PASSES):
            left = np.stack([self.residuals(o, y) for o, y in zip(out, curves, strict=True)])
            cost = (left**2).sum(axis=1)
            better = cost < best
            found[better], best[better] = out[better], cost[better]
            step = left @ back.T
            if (np.abs(step) <= _CLOSE * (out.std(axis=0) + 1e-6)).all():
                break
            out = found - np.clip(np.where(better[:, None], 1.0, 0.5) * step, -1.0, 1.0)
        return found

    def all_of(self, z: Floats, y: Floats) -> Floats:
        """Numbers (8,) in the order of `NAMES`."""
        columns = _columns(self.share(z), self.temperature - self.common)
        lines = np.linalg.lstsq(columns, y, rcond=None)[0]
        width = np.exp(np.clip(z[1], -3.0, 7.0))
        return np.concatenate([[z[0], width], _exponents(z[2:]), lines])


def _exponents(z: Floats) -> Floats:
    return np.asarray(LEAST + (1.0 - LEAST) * expit(np.clip(z, -40.0, 40.0)))


def logits(exponents: Floats) -> Floats:
    """Exponents in (0, 1) on the whole line."""
    return np.asarray(logit(np.clip(exponents, 1e-4, 1.0 - 1e-4)))
