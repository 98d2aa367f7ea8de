"""By how much one sweep differs from another, beyond noise: offset, stroke, shift and width of each sweep.

Each sweep of a record deviates from the curve that all have in common by ``U u``, u ~ N(0, W) with a diagonal W. From
the innovations of a sweep along the columns of U come its numbers with their covariance, and from all sweeps the
restricted likelihood of W: what all sweeps do alike is the curve's. Standard deviations have half-normal priors of the
size by which one specimen in one rig usually repeats.

Where the fit gives each sweep something of its own (`sma_bayes.fitting.sweep_functions`) a new sweep has what the fit
would give it: another description of the same scatter would promise what no fit of the new measurements keeps.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy import optimize

from sma_bayes.arrays import Floats
from sma_bayes.assess.draws import RecordDraws
from sma_bayes.assess.sweeps import samples_of_sweeps
from sma_bayes.fitting.sweep_functions import SweepFunctions, covariance_of_sweeps
from sma_bayes.studies.cycles.sweeps import LEAST_SAMPLES, NUMBERS, USUAL_SCATTER

LEAST_SWEEPS: Final = 2
"""Fewest sweeps that tell of scatter."""
RELATIVE_TOLERANCE: Final = 1e-9


@dataclass(frozen=True, eq=False)
class Deviations:
    """What a sweep of a channel may differ by.

    Attributes
    ----------
    temperature, curve, slope : ndarray, shape (m,)
        Grid over what was measured, and there the mean curve and its slope.
    level, span, middle : float
        Halfway between the ends of the curve, between them, and the temperature at the level.
    """

    temperature: Floats
    curve: Floats
    slope: Floats
    level: float
    span: float
    middle: float

    @staticmethod
    def of(draws: RecordDraws, channel: str) -> Deviations:
        """About the mean curve of a record."""
        t = draws.grid()
        mean = np.median(draws.curve(channel, t), axis=0)
        level, span = 0.5 * float(mean[0] + mean[-1]), abs(float(mean[-1] - mean[0]))
        middle = float(t[np.argmin(np.abs(mean - level))])
        return Deviations(t, mean, np.gradient(mean, t), level, span or float(np.ptp(mean)), middle)

    def rows(self, temperature: Floats) -> Floats:
        """What a unit of each number does, (4, n): offset [spans], ln stroke, shift [K], ln width."""
        curve = np.interp(temperature, self.temperature, self.curve)
        slope = np.interp(temperature, self.temperature, self.slope)
        away = temperature - self.middle
        return np.stack([np.full(temperature.shape, self.span), curve - self.level, -slope, -slope * away])


@dataclass(frozen=True, eq=False)
class SweepScatter:
    """By how much sweeps of a channel differ.

    Attributes
    ----------
    deviations : Deviations
    sd : ndarray, shape (4,)
        Standard deviation of each number, in the order of `NUMBERS`.
    sweeps : int
        From how many sweeps it was learnt; 0 where it is assumed.
    functions : SweepFunctions or None
        What the fit gives each sweep, if it does.
    root : ndarray, shape (q, q), or None
        Cholesky factor of the covariance of their weights [unit of the channel].
    """

    deviations: Deviations
    sd: Floats
    sweeps: int
    functions: SweepFunctions | None = None
    root: Floats | None = None

    def rows(self, temperature: Floats) -> Floats:
        """What a standard deviation of each number, or of each function, does, (k, n) [unit of the channel]."""
        if self.functions is not None and self.root is not None:
            return np.asarray((self.functions.at(temperature) @ self.root).T)
        return np.asarray(self.sd[:, None] * self.deviations.rows(temperature))

    def told(self) -> dict[str, float]:
        """Standard deviations by name; the offset in the unit of the channel."""
        scale = np.array([self.deviations.span, 1.0, 1.0, 1.0])
        return dict(zip(NUMBERS, (self.sd * scale).tolist(), strict=True))


def scatter_of(draws: RecordDraws, assumed: str) -> dict[str, SweepScatter]:
    """Scatter of the sweeps of a record, by channel.

    Parameters
    ----------
    draws : RecordDraws
    assumed : str
        Where there are too few sweeps to tell: ``none``, or ``usual``, that of one specimen in one rig.
    """
    usable = [s for s in samples_of_sweeps(draws.record) if s.size >= LEAST_SAMPLES]
    out = {}
    for channel in draws.channels:
        deviations = Deviations.of(draws, channel)
        if len(usable) >= LEAST_SWEEPS:
            learnt = _learnt(draws, channel, deviations)
            out[channel] = SweepScatter(deviations, learnt, len(usable), *_of_the_fit(draws, channel))
        else:
            sd = USUAL_SCATTER if assumed == "usual" else np.zeros(4)
            out[channel] = SweepScatter(deviations, np.array(sd), 0)
    return out


def _of_the_fit(draws: RecordDraws, channel: str) -> tuple[SweepFunctions | None, Floats | None]:
    """What the fit gives each sweep, and the root of the covariance with which sweeps were found to scatter."""
    posterior = draws.posterior
    basis = posterior.discrepancy[0].get(channel)
    if basis is None or basis.sweep_functions is None:
        return None, None
    theta = draws.before_calibration
    size = theta[:, posterior.layout[0].between[channel]]
    weights = posterior.draw_sweeps(np.random.default_rng(0), theta, 0, channel)
    root = np.linalg.cholesky(covariance_of_sweeps(weights, size))
    return basis.sweep_functions, np.asarray(root)


def _learnt(draws: RecordDraws, channel: str, deviations: Deviations) -> Floats:
    """Likeliest standard deviations.

    Of two sweeps that agree the mean square of one under its posterior would be the prior's, not theirs, and a further
    sweep would hardly tell anything.
    """
    posterior, record = draws.posterior, draws.record
    theta = np.median(draws.before_calibration, axis=0)[None]
    weights = ({c: w.mean(axis=0)[None] for c, w in draws.weights.items()},) if draws.weights else ()
    with np.errstate(all="ignore"):
        innovation = posterior.residuals(theta, weights, of_sweeps=True)[0][channel][0]
        relative = posterior.moments_of_noise(theta[0], 0)[1][channel]
    scale = theta[0, posterior.layout[0].noise[channel][0]] * relative
    rows = USUAL_SCATTER[:, None] * deviations.rows(record.temperature) / scale
    shape = np.repeat(posterior.noise_shape(theta, 0, channel), len(rows), axis=0)
    rows = posterior.noise.decorrelate(rows, shape, posterior.steps[0])
    parts = [(rows[:, s], innovation[s]) for s in samples_of_sweeps(record) if s.size >= LEAST_SAMPLES]
    numbers = [(a @ a.T, a @ e) for a, e in parts]

    def cost(size: Floats) -> float:
        return 0.5 * float(size @ size) - _restricted(numbers, size)

    best = optimize.minimize(cost, np.full(4, 0.5), bounds=[(0.0, 10.0)] * 4, method="L-BFGS-B").x
    return np.asarray(best * USUAL_SCATTER)


def _restricted(numbers: list[tuple[Floats, Floats]], size: Floats) -> float:
    """Restricted log likelihood of standard deviations (4,), up to a constant.

    The innovations of each sweep along the rows A are ``A' (b + u) + e`` with u of that size and a b that all sweeps
    have in common, of which nothing is known.
    """
    precision, pull, value = np.zeros((4, 4)), np.zeros(4), 0.0
    for gram, along in numbers:
        inner = np.eye(4) + size[:, None] * gram * size
        across = gram * size
        solved = np.linalg.solve(inner, np.column_stack([across.T, size * along]))
        precision += gram - across @ solved[:, :4]
        pull += along - across @ solved[:, 4]
        value += 0.5 * float((size * along) @ solved[:, 4]) - 0.5 * float(np.linalg.slogdet(inner)[1])
    precision = precision + RELATIVE_TOLERANCE * np.eye(4)
    explained = 0.5 * float(pull @ np.linalg.solve(precision, pull))
    return value + explained - 0.5 * float(np.linalg.slogdet(precision)[1])
