"""Fit a hypothesis under given noise: mode, evidence, and the residuals as the noise would have them.

The mode is found by least squares (MINPACK) with a row for each prior: the signed root of twice the log density that is
missing to its mode. On campaigns of the gap benchmark that takes about as many Jacobians as steps on the normal
equations, a sixth fewer predictions, and, as MINPACK decomposes the rows themselves, some 5 % more processor time.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import least_squares

from sma_bayes.arrays import Floats
from sma_bayes.batches import batches
from sma_bayes.effects.types import Effect
from sma_bayes.normal import HALF_LN_2PI
from sma_bayes.parameters.space import ParameterSpace
from sma_bayes.studies.gap.hypothesis import Hypothesis
from sma_bayes.studies.gap.noise import (
    BlockNoise,
    ChannelBlock,
    Noise,
    blocks_of,
    whiten,
    whiten_residual,
)
from sma_bayes.studies.gap.noise_estimate import is_shorter, noise_of, remembers

MODE_TOLERANCE = 5e-3
"""Gain of the log posterior in a step below which the mode is found, where residuals are as large as the noise.

Evidence is not known better than that."""
DIFFERENCE_STEP = 1e-4
"""Step of finite differences, in standard deviations of the prior."""
ONWARD_STEP = 1e-6
"""The same of differences to one side, which are off by the first order of it. They lead a climb; where it ends the
residuals tell."""
RELATIVE_TOLERANCE = 1e-9
"""Relative step, and gradient, below which it is found too."""
LONG_MEMORY = 0.95
"""Correlation of neighbouring samples from which on noise is mostly misfit."""
MAX_NOISE_ROUNDS = 8
"""Greatest number of times that noise and parameters are fitted in turn; once or twice is the rule."""
MAX_STEPS = 60
"""Greatest number of steps to a mode."""
CHUNK_SAMPLES = 1 << 17
"""Samples times parameter vectors that are evaluated at a time."""


@dataclass(frozen=True, eq=False)
class FittedHypothesis:
    """A hypothesis at its mode.

    Attributes
    ----------
    hypothesis : Hypothesis
    z : ndarray, shape (D,)
        Mode, in sampled coordinates.
    noise : tuple of BlockNoise
    residual : ndarray, shape (N,)
        Measured minus predicted, all blocks stacked [unit of each channel].
    whitened : ndarray, shape (N,)
        The same as innovations of unit variance.
    jacobian : ndarray, shape (N, D)
        Derivative of the whitened prediction.
    precision : ndarray, shape (D, D)
        Of the posterior at the mode: Gauss-Newton with the curvature of the prior.
    log_likelihood, ln_evidence : float
        At the mode, and by Laplace's approximation.
    """

    hypothesis: Hypothesis
    blocks: tuple[ChannelBlock, ...]
    z: Floats
    noise: Noise
    residual: Floats
    whitened: Floats
    jacobian: Floats
    precision: Floats
    log_likelihood: float
    ln_evidence: float

    @property
    def theta(self) -> Floats:
        """Parameters at the mode, shape (P,)."""
        return self.hypothesis.space.constrain(self.z)

    @property
    def covariance(self) -> Floats:
        """Of the sampled coordinates, shape (D, D)."""
        return np.asarray(cho_solve(cho_factor(self.precision), np.eye(self.z.size)))

    @cached_property
    def observed(self) -> Floats:
        """What was measured (N,)."""
        return measured(self.hypothesis, self.blocks)

    @cached_property
    def left(self) -> Floats:
        """Whitened residuals (N,) less what the parameters could still absorb, were it not for their priors.

        So a term gets no credit for taking over what a prior holds the parameters back from.
        """
        return self.project_out(self.whitened[:, None])[:, 0]

    @cached_property
    def whole(self) -> Floats:
        """Whitened residuals (N,) in which heavy tails don't hide how far off readings are, see `BlockNoise.whole`."""
        out = self.whitened.copy()
        for block, noise in zip(self.blocks, self.noise, strict=True):
            if noise.heavy:
                out[block.at] = noise.whole(self.residual[block.at])
        return out

    def project_out(self, columns: Floats) -> Floats:
        """What is left of whitened series (N, k) once the parameters have adapted to them."""
        return np.asarray(
            columns - self.jacobian @ np.linalg.solve(self.precision, self.jacobian.T @ columns)
        )

    def residual_at(self, z: Floats) -> Floats:
        """Measured minus predicted (W, N) at other sampled coordinates (W, D)."""
        return self.observed - stacked(self.hypothesis, self.blocks, self.hypothesis.space.constrain(z))

    def batches(self, rows: int) -> Iterator[slice]:
        """Parts of a batch of parameter vectors of which all samples are predicted at a time."""
        return batches(rows, self.whitened.size, CHUNK_SAMPLES)

    def whiten(self, series: Floats) -> Floats:
        """Stacked series (..., N) as innovations of unit variance."""
        return whiten(self.blocks, self.noise, series)

    def whiten_residual(self, residual: Floats) -> Floats:
        """Stacked residuals (..., N) of a model as innovations of unit variance, see `BlockNoise.whiten_residual`."""
        return whiten_residual(self.blocks, self.noise, residual)


def stacked(hypothesis: Hypothesis, blocks: Sequence[ChannelBlock], theta: Floats) -> Floats:
    """Predictions of all blocks (..., N) for parameters (..., P)."""
    mu = [hypothesis.predict(theta, i) for i in range(len(hypothesis.histories))]
    return np.concatenate([mu[b.history][b.channel] for b in blocks], axis=-1)


def measured(hypothesis: Hypothesis, blocks: Sequence[ChannelBlock]) -> Floats:
    """What was observed of all blocks (N,)."""
    return np.concatenate([hypothesis.histories[b.history].observed[b.channel] for b in blocks])


def added_by(effect: Effect, hypothesis: Hypothesis, blocks: Sequence[ChannelBlock], theta: Floats) -> Floats:
    """What one of the effects adds to all blocks (..., N): predictions with it less those without, all else equal.

    Parameters
    ----------
    effect : Effect
    hypothesis : Hypothesis
        With the effect.
    blocks : sequence of ChannelBlock
    theta : ndarray, shape (..., P)
    """
    without = hypothesis.with_effects([e for e in hypothesis.effects if e.id != effect.id])
    rest = theta[..., [hypothesis.space.index(p.name) for p in without.space.parameters]]
    return stacked(hypothesis, blocks, theta) - stacked(without, blocks, rest)


def fit_hypothesis(hypothesis: Hypothesis, start: Floats, noise: Noise) -> FittedHypothesis:
    """Find the mode nearest to a start.

    Parameters
    ----------
    hypothesis : Hypothesis
    start : ndarray, shape (D,)
        Sampled coordinates.
    noise : tuple of BlockNoise
    """
    problem = _PosteriorMode(hypothesis)
    return problem.fitted(problem.climb(np.asarray(start, dtype=float), noise), noise)


def log_posterior(fitted: FittedHypothesis, z: Floats) -> Floats:
    """Log of prior times likelihood at sampled coordinates (S, D), under the noise of a fit, shape (S,)."""
    problem = _PosteriorMode(fitted.hypothesis)
    likelihood = np.array([problem.log_likelihood(one, fitted.noise) for one in z])
    return np.asarray(likelihood + fitted.hypothesis.space.log_prior(z))


def climbed(
    hypothesis: Hypothesis, start: Floats, noise: Noise, steps: int, held: int
) -> tuple[Floats, float]:
    """Where a few steps from a start lead, and the log likelihood there.

    Parameters
    ----------
    hypothesis : Hypothesis
    start : ndarray, shape (D,)
        Sampled coordinates.
    noise : tuple of BlockNoise
    steps : int
        As many again come first in which the last coordinates stay.
    held : int
        How many of them.
    """
    problem = _PosteriorMode(hypothesis)
    z = np.asarray(start, dtype=float)
    for free in (z.size - held, z.size):
        z = problem.climb(z, noise, steps, free)
    return z, problem.log_likelihood(z, noise)


def fit_held(hypothesis: Hypothesis, start: Floats, noise: Noise, held: int) -> FittedHypothesis:
    """The mode where the last coordinates stay at a start, as if they were known: nothing adapts by them.

    Parameters
    ----------
    hypothesis : Hypothesis
    start : ndarray, shape (D,)
        Sampled coordinates.
    noise : tuple of BlockNoise
    held : int
        How many of them.
    """
    problem = _PosteriorMode(hypothesis)
    count = start.size - held
    found = problem.fitted(problem.climb(np.asarray(start, dtype=float), noise, free=count), noise)
    jacobian, precision = found.jacobian.copy(), found.precision.copy()
    jacobian[:, count:] = precision[:count, count:] = precision[count:, :count] = 0.0
    return replace(found, jacobian=jacobian, precision=precision)


def fit_with_noise(hypothesis: Hypothesis, start: Floats) -> FittedHypothesis:
    """Find mode and noise in turn.

    Each fit is at the mode under its own noise, so that an effect gets no credit for bringing the other parameters
    there. Where two noises follow each other for ever, as a short and a long memory may beside a strong misfit, the one
    with the greater evidence is taken.
    """
    problem = _PosteriorMode(hypothesis)
    z = np.asarray(start, dtype=float)
    noise = problem.noise(z)
    tried = []
    for _ in range(MAX_NOISE_ROUNDS):
        z = problem.climb(z, noise)
        before, noise = noise, problem.noise(z)
        if all(
            abs(a.log_scale - b.log_scale) < 0.01 * a.memory.size for a, b in zip(before, noise, strict=True)
        ):
            return problem.fitted(problem.climb(z, noise), noise)
        tried.append((z, before))
    return max((problem.fitted(*last) for last in tried[-2:]), key=lambda f: f.ln_evidence)


def remembers_long(noise: BlockNoise) -> bool:
    """Whether noise hardly changes from sample to sample."""
    return bool(np.median(noise.memory) >= LONG_MEMORY)


def nearest(fitted: FittedHypothesis) -> FittedHypothesis:
    """The same hypothesis where it is nearest to what was measured, in the mean square.

    Noise that hardly changes from sample to sample is mostly misfit, and next to it an offset costs nothing: the mode
    follows steps and lets levels go. Levels are what predictions of another cycle or condition are about, so they are
    made from the parameters of least squares, under the same priors [1]_. Where no noise has such a memory the mode is
    that, near enough.

    References
    ----------
    .. [1] R. Tuo and C. F. J. Wu, Efficient calibration for imperfect computer models, Ann. Stat. 43 (2015) 2331.
    """
    noise = []
    for block, own in zip(fitted.blocks, fitted.noise, strict=True):
        rms = float(np.sqrt(np.mean(fitted.residual[block.at] ** 2)))
        noise.append(BlockNoise(rms, np.zeros_like(own.memory)) if remembers_long(own) else own)
    if tuple(noise) == fitted.noise:
        return fitted
    return fit_hypothesis(fitted.hypothesis, fitted.z, tuple(noise))


def held_at(hypothesis: Hypothesis, z: Floats, noise: Noise) -> FittedHypothesis:
    """A hypothesis at given parameters and noise, as it would be had they been found as its mode."""
    return _PosteriorMode(hypothesis).fitted(z, noise)


class _PriorRows:
    """Priors as rows of least squares, one for each coordinate: half its square is what is missing to its mode."""

    def __init__(self, space: ParameterSpace, width: Floats) -> None:
        self.space, self.centre, self.step = space, space.prior_centre(), 1e-3 * width
        self.mode = self.centre.copy()
        for _ in range(MAX_STEPS):
            up, here, down = (self._each(self.mode + by * self.step) for by in (1.0, 0.0, -1.0))
            curvature = np.minimum(up + down - 2.0 * here, -1e-9)
            move = np.clip(0.5 * (down - up) / curvature, -1e3, 1e3)
            self.mode = self.mode + move * self.step
            if np.all(np.abs(move) < 1e-3):
                break
        self.greatest = self._each(self.mode)

    def _each(self, z: Floats) -> Floats:
        """Log density (D,) of each coordinate, the others at their medians."""
        return self.space.log_prior(np.where(np.eye(z.size, dtype=bool), z, self.centre))

    def __call__(self, z: Floats) -> Floats:
        """The rows (D,)."""
        missing = np.maximum(self.greatest - self._each(z), 0.0)
        return np.asarray(np.sign(z - self.mode) * np.sqrt(2.0 * missing))

    def slope(self, z: Floats) -> Floats:
        """Their derivatives (D,)."""
        return np.asarray((self(z + self.step) - self(z - self.step)) / (2.0 * self.step))


class _PosteriorMode:
    """Residuals, their derivatives, and the objective that is climbed."""

    def __init__(self, hypothesis: Hypothesis) -> None:
        self.hypothesis = hypothesis
        self.space = hypothesis.space
        self.blocks = blocks_of(hypothesis)
        self.y = measured(hypothesis, self.blocks)
        self.width = self.space.prior_sd()
        position = np.full(len(self.space.parameters), -1)
        position[self.space.free_index] = np.arange(self.space.dimension)
        self.prior_rows = _PriorRows(self.space, self.width)
        self._differentiated: tuple[Floats, Floats] | None = None
        self.columns = [
            position[p][position[p] >= 0] for p in map(hypothesis.positions, range(len(hypothesis.histories)))
        ]

    def residual(self, z: Floats) -> Floats:
        """Measured minus predicted (N,); what overflows counts as very far off."""
        mu = stacked(self.hypothesis, self.blocks, self.space.constrain(z))
        return np.nan_to_num(self.y - mu, nan=1e30, posinf=1e30, neginf=-1e30)

    def noise(self, z: Floats) -> Noise:
        """Noise beside what is left at these parameters."""
        return noise_of(self.hypothesis, self.blocks, self.residual(z), self.space.constrain(z))

    def derivative(self, z: Floats) -> Floats:
        """Derivative of the prediction by each coordinate, shape (N, D), by central differences."""
        if self._differentiated is None or not np.array_equal(z, self._differentiated[0]):
            self._differentiated = z, self._differences(z)
        return self._differentiated[1]

    def _differences(self, z: Floats, *, onward: bool = False) -> Floats:
        """The same; by differences to one side, with half as many predictions, if `onward`."""
        out = np.zeros((self.y.size, z.size))
        for i, columns in enumerate(self.columns):
            h = (ONWARD_STEP if onward else DIFFERENCE_STEP) * self.width[columns]
            rows = np.arange(columns.size)
            up = np.tile(z, (columns.size, 1))
            up[rows, columns] += h
            down = np.tile(z, (1 if onward else columns.size, 1))
            if not onward:
                down[rows, columns] -= h
            between = h if onward else 2.0 * h
            mu = self.hypothesis.predict(self.space.constrain(np.concatenate([up, down])), i)
            for block in self.blocks:
                if block.history == i:
                    there, here = np.split(mu[block.channel], [columns.size])
                    slope = (there - here) / between[:, None]
                    out[block.at, columns] = np.nan_to_num(slope, nan=0.0, posinf=0.0, neginf=0.0).T
        return out

    def prior(self, z: Floats) -> tuple[float, Floats, Floats]:
        """Log prior with its gradient and the diagonal of its (never positive) curvature."""
        h = 1e-3 * self.width
        steps = np.concatenate([np.zeros((1, z.size)), np.diag(h), -np.diag(h)])
        value = self.space.log_prior(z + steps)
        up, down = np.split(value[1:], 2)
        curvature = (up + down - 2.0 * value[0]) / h**2
        return float(value[0]), (up - down) / (2.0 * h), np.minimum(curvature, -1e-3 / self.width**2)

    def log_likelihood(self, z: Floats, noise: Noise) -> float:
        w = whiten_residual(self.blocks, noise, self.residual(z))
        return float(-0.5 * w @ w - sum(n.log_scale for n in noise) - HALF_LN_2PI * w.size)

    def climb(self, z: Floats, noise: Noise, steps: int = MAX_STEPS, free: int | None = None) -> Floats:
        """Mode of the posterior at fixed noise in so many coordinates from the first on; the others stay.

        Two of the steps may fail without being counted.
        """
        count = z.size if free is None else free

        def whole(x: Floats) -> Floats:
            return np.concatenate([x, z[count:]])

        def rows(x: Floats) -> Floats:
            at = whole(x)
            return np.concatenate(
                [whiten_residual(self.blocks, noise, self.residual(at)), self.prior_rows(at)[:count]]
            )

        def slopes(x: Floats) -> Floats:
            at = whole(x)
            of_data = whiten(self.blocks, noise, self._differences(at, onward=True).T).T
            return np.concatenate([-of_data[:, :count], np.diag(self.prior_rows.slope(at)[:count])])

        found = least_squares(
            rows,
            z[:count],
            slopes,
            method="lm",
            x_scale="jac",
            ftol=2.0 * MODE_TOLERANCE / self.y.size,
            xtol=RELATIVE_TOLERANCE,
            gtol=RELATIVE_TOLERANCE,
            max_nfev=steps + 2,
        )
        return whole(np.asarray(found.x, dtype=float))

    def _jacobian(self, z: Floats, noise: Noise) -> Floats:
        return whiten(self.blocks, noise, self.derivative(z).T).T

    def fitted(self, z: Floats, noise: Noise) -> FittedHypothesis:
        residual = self.residual(z)
        w = whiten_residual(self.blocks, noise, residual)
        jacobian = self._jacobian(z, noise)
        prior, _, curvature = self.prior(z)
        precision = jacobian.T @ jacobian - np.diag(curvature)
        likelihood = self.log_likelihood(z, noise)
        volume = 0.5 * float(np.linalg.slogdet(precision)[1])
        return FittedHypothesis(
            hypothesis=self.hypothesis,
            blocks=self.blocks,
            z=z,
            noise=noise,
            residual=residual,
            whitened=w,
            jacobian=jacobian,
            precision=precision,
            log_likelihood=likelihood,
            ln_evidence=likelihood + prior + z.size * HALF_LN_2PI - volume,
        )


def in_steady_noise(fitted: FittedHypothesis) -> FittedHypothesis | None:
    """A model with noise whose memory neither one cycle unlike the others nor jumps have made.

    It is asked for where nothing is seen beside noise as it was estimated, and where jumps are held against effects. It
    would be no better in general: what a curve of another shape leaves at a few steep places is as well described by
    jumps.

    Returns
    -------
    FittedHypothesis or None
        None where that noise is not another.
    """
    mechanical = [n for b, n in zip(fitted.blocks, fitted.noise, strict=True) if b.channel != "temperature"]
    if fitted.hypothesis.steady_noise or not any(map(remembers, mechanical)):
        return None
    found = fit_with_noise(replace(fitted.hypothesis, steady_noise=True), fitted.z)
    shorter = any(is_shorter(new, old) for new, old in zip(found.noise, fitted.noise, strict=True))
    return found if shorter else None
