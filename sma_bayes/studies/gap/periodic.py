"""Disturbances that repeat in time, out of step with the temperature: a fan, a pump, another drive.

No covariate shows them, and to noise with a memory they look like memory. So the spectrum of the innovations is
searched for single lines, each beside the level of the spectrum around it, as noise of another colour than was assumed
lifts whole bands and not a line. What smooth functions of temperature on each branch and levels of cycles describe has
been taken out before, since what is in step with the drive is theirs.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp
from scipy.stats import chi2

from sma_bayes.arrays import Floats
from sma_bayes.records.history import History, starts
from sma_bayes.studies.gap.fitting import FittedHypothesis
from sma_bayes.studies.gap.flexible import COEFFICIENT_SD_GRID
from sma_bayes.studies.gap.noise import ChannelBlock
from sma_bayes.studies.gap.noise_columns import smooth_columns
from sma_bayes.studies.gap.schema import StatedBand, StatedPeriodicity

TEMPERATURE_SPLINES = 20
"""Splines of temperature on each branch that are taken out."""
LEAST_PERIODS = 4
"""Periods that have to fit into a record; slower ones are drifts."""
BACKGROUND_STEPS = (3, 12)
"""Nearest and farthest frequencies, in steps, by which the level around a line is found."""
UNEVEN_STEP_SPREAD = 0.05
"""Spread of the steps of time, over their median, from which on they don't count as equal."""
LEAST_LN_BAYES_FACTOR = 5.0
"""Least ln Bayes factor of a line that is told."""
SPECTRUM_BANDS = 8
"""Parts of a spectrum that are compared with the model of the noise."""
MAX_FREQUENCIES = 512
"""Greatest number of frequencies that are tried where steps of time are unequal."""


@dataclass(frozen=True, eq=False)
class Spectra:
    """The spectra of all channels of all conditions, as a pattern that residuals are tested for."""

    fitted: FittedHypothesis

    @cached_property
    def _parts(self) -> tuple[_Spectrum, ...]:
        histories = self.fitted.hypothesis.histories
        parts = []
        for block, noise in zip(self.fitted.blocks, self.fitted.noise, strict=True):
            history = histories[block.history]
            smooth = smooth_columns(history, history.inputs["temperature"], TEMPERATURE_SPLINES)
            parts.append(_Spectrum(block, *_clock(history), np.linalg.qr(noise.whiten(smooth.T).T)[0]))
        return tuple(p for p in parts if p.frequencies.size > 2 * BACKGROUND_STEPS[1])

    @cached_property
    def ln_bayes_factor(self) -> float:
        """For one line somewhere, given the residuals of the fit."""
        return float(self.of(self.fitted.left[:, None])[0]) if self._parts else -np.inf

    def of(self, residuals: Floats) -> Floats:
        """The same for other whitened residuals (N, S), shape (S,)."""
        found = [p.ln_bayes_factor(residuals[p.block.at]) for p in self._parts]
        if not found:
            return np.full(residuals.shape[1], -np.inf)
        return np.asarray(logsumexp(np.stack(found), axis=0) - np.log(len(found)))

    def bands(self) -> list[StatedBand | None]:
        """For each block of the fit the band that is least like the model of the noise; None for short records."""
        found = {p.block: p.band(self.fitted.whitened[p.block.at][:, None]) for p in self._parts}
        return [found.get(b) for b in self.fitted.blocks]

    def lines(self) -> tuple[StatedPeriodicity, ...]:
        """Strongest line of each channel and condition, where worth more than `LEAST_LN_BAYES_FACTOR`; best first."""
        left = self.fitted.left[:, None]
        found = []
        for part in self._parts:
            value = float(part.ln_bayes_factor(left[part.block.at])[0])
            if value < LEAST_LN_BAYES_FACTOR:
                continue
            (at,), (power,) = part.greatest(left[part.block.at])
            history = self.fitted.hypothesis.histories[part.block.history]
            line = StatedPeriodicity(
                condition=history.condition.id,
                channel=part.block.channel,
                frequency=float(part.frequencies[at]),
                width=part.width,
                unit=part.unit,
                amplitude=part.amplitude(self.fitted.residual[part.block.at], int(at)),
                size_sigma=float(np.sqrt(power)),
                ln_bayes_factor=value,
            )
            found.append(line)
        return tuple(sorted(found, key=lambda line: -line.ln_bayes_factor))


@dataclass(frozen=True, eq=False)
class _Spectrum:
    """Spectrum of one channel of one history.

    Attributes
    ----------
    block : ChannelBlock
    clock : ndarray, shape (n,)
        Time [s], or place in the record; never falls.
    unit : str
        Of frequencies.
    smooth : ndarray, shape (n, k)
        Orthonormal whitened columns of what is taken out.
    """

    block: ChannelBlock
    clock: Floats
    unit: str
    smooth: Floats

    @cached_property
    def _step(self) -> float:
        return float(np.median(np.diff(self.clock)))

    @cached_property
    def _even(self) -> bool:
        steps = np.diff(self.clock)
        return bool(np.all(np.abs(steps - self._step) <= UNEVEN_STEP_SPREAD * self._step))

    @cached_property
    def _taper(self) -> Floats:
        """Hann's window, which keeps a line from leaking into the level around it."""
        passed = (np.arange(self.clock.size) + 0.5) / self.clock.size
        return np.asarray(np.sin(np.pi * passed) ** 2)

    @property
    def width(self) -> float:
        """Step of the frequencies."""
        return 1.0 / (self.clock.size * self._step if self._even else float(np.ptp(self.clock)) or 1.0)

    @cached_property
    def frequencies(self) -> Floats:
        """From `LEAST_PERIODS` periods a record up to half a period a sample, shape (F,)."""
        if self._step <= 0.0 or self.clock.size < 4 * LEAST_PERIODS:
            return np.empty(0)
        highest = (self.clock.size - 1) // 2
        tried = np.arange(LEAST_PERIODS, (highest if self._even else min(highest, MAX_FREQUENCIES)) + 1)
        return np.asarray(self.width * tried.astype(float))

    @cached_property
    def _waves(self) -> NDArray[np.complex128]:
        return np.asarray(np.exp(-2j * np.pi * self.frequencies[:, None] * (self.clock - self.clock[0])))

    def power(self, residuals: Floats) -> Floats:
        """Power at each frequency of whitened residuals (n, S), over the level around it, shape (F, S).

        A chi-squared of two degrees of freedom for white noise. A level below that of white noise counts as that.
        """
        power = self._power(residuals)
        return np.asarray(power / np.maximum(_level(power) / 2.0, 1.0))

    def _power(self, residuals: Floats) -> Floats:
        left = (residuals - self.smooth @ (self.smooth.T @ residuals)) * self._taper[:, None]
        return np.asarray(np.abs(self._transform(left)) ** 2 / (0.5 * np.sum(self._taper**2)))

    def _transform(self, series: Floats) -> NDArray[np.complex128]:
        if self._even:
            return np.asarray(
                np.fft.rfft(series, axis=0)[LEAST_PERIODS : LEAST_PERIODS + self.frequencies.size]
            )
        return np.asarray(self._waves @ series)

    def greatest(self, residuals: Floats) -> tuple[NDArray[np.intp], Floats]:
        """Place among the frequencies and power of the strongest line of each series (n, S)."""
        power = self.power(residuals)
        at = np.argmax(power, axis=0)
        return at, np.take_along_axis(power, at[None], axis=0)[0]

    def ln_bayes_factor(self, residuals: Floats) -> Floats:
        """For a line at one of the frequencies, each as likely as the next, shape (S,).

        A sine and a cosine of unknown size at the strongest one; the others add little to the mean over all.
        """
        _, power = self.greatest(residuals)
        size = COEFFICIENT_SD_GRID[:, None] ** 2 * (np.sum(self._taper) ** 2 / (2.0 * np.sum(self._taper**2)))
        each = 0.5 * power * size / (1.0 + size) - np.log1p(size)
        return np.asarray(logsumexp(each, axis=0) - np.log(COEFFICIENT_SD_GRID.size * self.frequencies.size))

    def band(self, residuals: Floats) -> StatedBand:
        """The one of `SPECTRUM_BANDS` equal bands whose mean power deviates most, in standard errors.

        Under the taper neighbouring frequencies are not independent; half as many as there are stand for them.
        """
        power = 0.5 * self._power(residuals)[:, 0]
        parts = np.array_split(np.arange(power.size), SPECTRUM_BANDS)
        ratio = np.array([power[p].mean() for p in parts])
        free = np.array([p.size for p in parts], dtype=float)  # twice a half
        p_each = 2.0 * np.minimum(chi2.sf(ratio * free, free), chi2.cdf(ratio * free, free))
        worst = int(np.argmin(p_each))
        low, high = parts[worst][0], parts[worst][-1]
        p_value = float(-np.expm1(SPECTRUM_BANDS * np.log1p(-min(float(p_each[worst]), 1.0 - 1e-16))))
        return StatedBand(
            start=float(self.frequencies[low]),
            stop=float(self.frequencies[high]),
            unit=self.unit,
            ratio=float(ratio[worst]),
            p_value=p_value,
        )

    def amplitude(self, residual: Floats, at: int) -> float:
        """Of the sine of a frequency in residuals (n,) in their own unit, by least squares under the taper."""
        turn = 2.0 * np.pi * self.frequencies[at] * (self.clock - self.clock[0])
        root = np.sqrt(self._taper)
        columns = np.stack([np.ones_like(turn), np.sin(turn), np.cos(turn)], axis=1)
        found = np.linalg.lstsq(columns * root[:, None], residual * root, rcond=None)[0]
        return float(np.hypot(found[1], found[2]))


def _clock(history: History) -> tuple[Floats, str]:
    """Time of each sample, and the unit of frequencies.

    Equal steps are taken on across interruptions. Where steps are unequal and there are interruptions, or time was not
    recorded, the place in the record stands for it.
    """
    if "time" in history.inputs:
        time = history.inputs["time"]
        steps = np.diff(time)
        within = steps[~starts(history.inputs)[1:]]
        usual = float(np.median(within)) if within.size else 0.0
        if usual > 0.0 and np.all(np.abs(within - usual) <= UNEVEN_STEP_SPREAD * usual):
            return np.asarray(usual * np.arange(float(time.size))), "Hz"
        if usual > 0.0 and within.size == steps.size and np.all(steps >= 0.0):
            return time - time[0], "Hz"
    return history.inputs["order"], "1/sample"


def _level(power: Floats) -> Floats:
    """Mean power (F, S) of the frequencies beside each, itself and its neighbours left out."""
    near, far = BACKGROUND_STEPS
    total = np.cumsum(np.concatenate([np.zeros((1, power.shape[1])), power]), axis=0)
    i = np.arange(len(power))

    def between(low: NDArray[np.intp], high: NDArray[np.intp]) -> tuple[Floats, Floats]:
        low, high = np.clip(low, 0, len(power)), np.clip(high, 0, len(power))
        return total[high] - total[low], (high - low).astype(float)

    below, n_below = between(i - far, i - near + 1)
    above, n_above = between(i + near, i + far + 1)
    return np.asarray((below + above) / (n_below + n_above)[:, None])
