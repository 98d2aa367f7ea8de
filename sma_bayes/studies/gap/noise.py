"""The noise that hypotheses are judged by.

Noise of each history and channel is an AR(1) series, in sample index or in time. What a model misses looks like memory
too: estimated from its residuals, the memory would absorb the very disagreement that is looked for. So it is estimated
from what is left after smooth functions of temperature on each branch, and a level of each cycle, have been taken out,
by restricted likelihood, which counts the freedom that they use up; and smooth functions of time and of whatever else
was recorded as well, where these describe more than noise does. Where noise that remembers is left, what changes the
curve with something recorded is taken out, too, where it describes more than such noise does; of a short record the
stroke, place and width of its own; and for a hypothesis of steady noise what one cycle alone has, and jumps, where
these leave a much shorter memory. Noise without any misfit is then estimated without bias, and a misfit that repeats
from cycle to cycle, or follows something recorded, does not pass for noise. All hypotheses of a round share the
estimate.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy import stats
from scipy.linalg import solve_banded
from scipy.special import gammaln, logsumexp, ndtri

from sma_bayes.arrays import Floats
from sma_bayes.noise.ar1 import memory_innovations, memory_log_scale, memory_series
from sma_bayes.normal import MAD_TO_SD
from sma_bayes.records.history import History, starts
from sma_bayes.records.quality import clipped
from sma_bayes.studies.gap.hypothesis import Hypothesis
from sma_bayes.studies.gap.splines import bspline_basis, grouped, indicators, row_tensor_product
from sma_bayes.studies.gap.switching import Scatter, likeliest_size

CORRELATION_GRID = np.concatenate([[-0.6, -0.3, -0.15], np.tanh(np.linspace(0.0, 2.65, 28))])
"""Correlations of neighbouring samples that are tried."""
GROWTH_STANDARD_ERRORS = 5.0
"""Standard errors from which the size of innovations counts as changing with the response; such as does not, once in a
million."""
MAX_MEMORY_SWEEPS, MAX_MEMORY_SHARE_OF_RECORD = 1.5, 0.75
"""Sweeps, and share of an uninterrupted record, that may count as one sample under chance: what remembers for longer is
a wave that wants an explanation. Of one cycle they are the same; several cycles tell by their likelihood how long noise
remembers."""
LEAST_RELATIVE_LIKELIHOOD = 1e-3
"""A memory that is less likely than the likeliest one by more than this factor is left out of account."""
DEGREES_OF_FREEDOM = (2.0, 3.0, 5.0, 9.0)
"""Degrees of freedom of Student's t that are tried where tails are heavier than normal."""
HEAVY_TAILS_GAIN = 10.0
"""Gain of log likelihood from which on tails count as heavy."""
LEAST_WIDTH = 0.1
"""Least width of a t distribution over the standard deviation; narrower ones are those of readings that repeat."""
OUTLIERS_SET_ASIDE = 3
"""Greatest innovations of a record that don't make its tails heavy."""
SIZE_STANDARD_ERRORS = 3.0
"""Standard errors from which on the size of innovations remembers that of the sample before: then tails are those of
noise that comes and goes, or of a misfit, and no distribution of single readings."""
REWEIGHTING_ROUNDS = 4
"""How often scales of innovations and the noise are found in turn."""
EM_ROUNDS = 20
"""How often weight and width of a t distribution are found in turn."""
TEMPERATURE_SPLINES = 8
"""Splines of temperature on each branch that are taken out; fewer where samples are few."""
COVARIATE_SPLINES = {"time": 6, "order": 6, "ambient_temperature": 6, "rate": 6, "current": 5, "load": 5}
"""Splines of what else was recorded that are tried; of `order` only where time was not."""
COVARIATE_P = 1e-3
"""Probability that noise puts as much into these, up to which they are taken out."""
CURVE_CHANGE_SPLINES = {"cycle": 5, "rate": 4, "ambient_temperature": 4, "current": 4}
"""Splines of what may change the curve itself, its stroke and its place on the axis of temperature."""
CHANGE_SD_GRID = np.geomspace(0.03, 1000.0, 13)
"""Sizes of changes of the curve that are tried, in standard deviations of the noise."""
CURVE_CHANGE_P = 1e-6
"""The same for these, which are many; where they are weighed by their evidence, its inverse is the Bayes factor."""
LONG_CORRELATION = 0.8
"""Memory from which on they are tried: what changes the curve passes for noise that remembers, or not for noise."""
LEAST_CORRELATION = 0.5
"""Memory from which on it is tried what one cycle has of its own, and jumps: white noise beside a bump in one cycle of
five seems to have one of 0.7 to 0.8."""
MAX_MEMORY_RATIO = 0.5
"""Time that noise remembers beside them over that without, up to which they are taken out: what only passed for memory
is in them then. A hum, say, has a part in so many columns, too, and its memory stays as it is."""
MOST_JUMPS = 6
"""Jumps of a record that are tried."""
FEWEST_CYCLES = 3
"""Cycles of a record from which on one of them may be unlike the others."""
LEAST_SAMPLES_PER_SPLINE = 40
"""Samples for each spline of what else was recorded, at least."""
RELATIVE_PRECISION = 1e-9
"""Precision by which coefficients of which nothing is known are held, over the mean information on them."""
LEAST_SINGULAR_VALUE = 1e-6
"""Least singular value, over the greatest, of columns that count as different."""


@dataclass(frozen=True, slots=True, eq=False)
class ChannelBlock:
    """One channel of one history: where it is in the stacked vectors, and how its samples follow each other.

    Attributes
    ----------
    history : int
    channel : str
    at : slice
        Place in vectors over all samples of all blocks.
    first : ndarray of bool, shape (n,)
        Samples that remember nothing.
    dt : ndarray, shape (n,)
        Time since the sample before, in medians; 1 where time was not recorded.
    sweep : float
        Samples of its usual sweep.
    """

    history: int
    channel: str
    at: slice
    first: NDArray[np.bool_]
    dt: Floats
    sweep: float = np.inf

    @property
    def uneven(self) -> bool:
        """Whether steps of time differ, so that memory may be one in time or by sample."""
        steps = self.dt[~self.first]
        return bool(steps.size > 2 and np.std(steps) > 0.05 * np.mean(steps))

    @property
    def possible(self) -> NDArray[np.bool_]:
        """Which of `CORRELATION_GRID` chance may have.

        At most `MAX_MEMORY_SWEEPS` sweeps or `MAX_MEMORY_SHARE_OF_RECORD` count as one sample.
        """
        whole = self.first.size / max(int(self.first.sum()), 1)
        return np.asarray(
            _samples_as_one(CORRELATION_GRID)
            <= max(MAX_MEMORY_SWEEPS * self.sweep, MAX_MEMORY_SHARE_OF_RECORD * whole)
        )


@dataclass(frozen=True, slots=True, eq=False)
class BlockNoise:
    """Noise of a block.

    Attributes
    ----------
    sd : float
        Of the series [unit of the channel].
    memory : ndarray, shape (n,)
        Correlation with the sample before; 0 where nothing precedes.
    scale : ndarray, shape (n,), or float
        Of each innovation, over the usual one: where their size grows with the response, and where what passes for
        heavy tails is a misfit.
    excess : ndarray, shape (n,), or float
        What heavy tails leave out of account of each residual [unit of the channel]; see `HeavyTails`.
    tails : ndarray, shape (n,), or float
        What of `scale` stands for heavy tails that may be a misfit.
    others : tuple of (float, BlockNoise)
        What it may be by chance, with probabilities from the restricted likelihood that add up to 1; itself included
        unless it remembers for too long, see `ChannelBlock.possible`.
    switching : Scatter or None
        Scatter of the instants at which a current was switched, on top of it.
    """

    sd: float
    memory: Floats
    scale: Floats | float = 1.0
    others: tuple[tuple[float, BlockNoise], ...] = ()
    switching: Scatter | None = None
    excess: Floats | float = 0.0
    tails: Floats | float = 1.0

    def whiten(self, x: Floats) -> Floats:
        """Series (..., n) as innovations of unit variance."""
        out = memory_innovations(x / self.sd, self.memory, self.scale)
        return np.asarray(out if self.switching is None else self.switching.whiten(out))

    def whiten_residual(self, residual: Floats) -> Floats:
        """Residuals (..., n) of a model as innovations of unit variance, without their excess."""
        return self.whiten(residual - self.excess)

    @property
    def heavy(self) -> bool:
        """Whether it has heavy tails."""
        return bool(np.any(self.excess) or np.any(np.asarray(self.tails) != 1.0))

    def whole(self, residual: Floats) -> Floats:
        """Residuals (n,) of a model as innovations whose size says how far off each is, however heavy the tails.

        What counts of an innovation in heavy tails falls again with its size, so that a misfit of few readings counts
        the less the greater it is. Of the size of these only the rank is taken: as a normal deviate, whose sign is that
        of the innovation [1]_.

        References
        ----------
        .. [1] Normal scores: B. L. van der Waerden, Indag. Math. 14 (1952) 453.
        """
        u = self.whiten(residual) * self.tails
        return np.asarray(np.sign(u) * ndtri(0.5 + 0.5 * stats.rankdata(np.abs(u)) / (u.size + 1.0)))

    def as_likely(self, innovations: Floats, rng: np.random.Generator) -> Floats:
        """Series (n, count) from innovations of unit variance, each with one of `others` drawn for it."""
        others = self.others or ((1.0, self),)
        which = rng.choice(len(others), size=innovations.shape[1], p=[p for p, _ in others])
        memory = np.stack([o.memory for _, o in others], axis=1)[:, which]
        sd = np.array([o.sd for _, o in others])[which]
        out = memory_series(innovations.T, memory.T, self.scale).T * sd
        return np.asarray(out if self.switching is None else out + self.switching.drawn(rng, out.shape[1]))

    def spread(self, columns: Floats) -> Floats:
        """Columns (n, k) so that products of what is returned are those with the covariance in between, shape (n, k).

        Of scales of innovations and of switching nothing is seen.
        """
        ahead = np.zeros((2, self.memory.size))
        ahead[0, 1:], ahead[1] = -self.memory[1:], 1.0
        size = self.sd * np.sqrt(1.0 - self.memory**2)
        return np.asarray(size[:, None] * solve_banded((0, 1), ahead, columns))

    @property
    def log_scale(self) -> float:
        """Sum over samples of the logarithm of the scale of an innovation."""
        widths = np.log(np.broadcast_to(self.scale, self.memory.shape))
        own = self.memory.size * np.log(self.sd) + memory_log_scale(self.memory).sum() + widths.sum()
        return float(own) + (0.0 if self.switching is None else self.switching.log_scale)

    def on(self, kept: NDArray[np.bool_]) -> BlockNoise:
        """The same noise of samples for which a mask is true; without memory where the one before is not kept."""
        together = np.concatenate([[False], kept[:-1]])[kept]
        some = BlockNoise(
            self.sd,
            np.where(together, self.memory[kept], 0.0),
            _on(self.scale, kept),
            excess=_on(self.excess, kept),
            tails=_on(self.tails, kept),
        )
        if self.switching is None:
            return some
        courses = self.switching.courses[kept]
        return replace(some, switching=Scatter.of(self.switching.size, courses, some.whiten))


Noise = tuple[BlockNoise, ...]


def _on(values: Floats | float, kept: NDArray[np.bool_]) -> Floats | float:
    """Those of the samples for which a mask is true, of values of each sample or of all."""
    return values if np.ndim(values) == 0 else np.asarray(values)[kept]


def blocks_of(hypothesis: Hypothesis) -> tuple[ChannelBlock, ...]:
    """Every channel of every history, stacked."""
    out, at = [], 0
    for i, history in enumerate(hypothesis.histories):
        first = starts(history.inputs)
        dt = np.ones(history.n)
        if "time" in history.inputs:
            dt[1:] = np.maximum(np.diff(history.inputs["time"]), 0.0)
            usual = float(np.median(dt[~first])) if (~first).any() else 1.0
            dt = dt / max(usual, 1e-300)
        sweep = float(np.median(np.unique(history.inputs["segment"], return_counts=True)[1]))
        for channel in hypothesis.channels:
            out.append(ChannelBlock(i, channel, slice(at, at + history.n), first, dt, sweep))
            at += history.n
    return tuple(out)


def whiten(blocks: Sequence[ChannelBlock], noise: Noise, series: Floats) -> Floats:
    """Stacked series (..., N) as innovations of unit variance."""
    return _by_block(BlockNoise.whiten, blocks, noise, series)


def whiten_residual(blocks: Sequence[ChannelBlock], noise: Noise, residual: Floats) -> Floats:
    """Stacked residuals (..., N) of a model as innovations of unit variance, without their excess."""
    return _by_block(BlockNoise.whiten_residual, blocks, noise, residual)


def _by_block(
    whitened: Callable[[BlockNoise, Floats], Floats],
    blocks: Sequence[ChannelBlock],
    noise: Noise,
    series: Floats,
) -> Floats:
    out = np.empty_like(series)
    for block, own in zip(blocks, noise, strict=True):
        out[..., block.at] = whitened(own, series[..., block.at])
    return out


def noise_of(
    hypothesis: Hypothesis, blocks: Sequence[ChannelBlock], residual: Floats, theta: Floats
) -> Noise:
    """Noise of every block, from stacked residuals (N,) at some parameters (P,)."""
    out, beside = [], []
    for block in blocks:
        history, own = hypothesis.histories[block.history], residual[block.at]
        inputs = history.inputs
        if (
            block.channel == "temperature"
        ):  # as simulated: what was measured carries the very noise that is estimated
            inputs = {k: v for k, v in inputs.items() if k != "rate"}
            inputs = {**inputs, "temperature": history.observed["temperature"] - own}
        lattice = hypothesis.scales.step.get(block.channel, 0.0)
        smooth = smooth_columns(history, inputs["temperature"])
        courses = (
            hypothesis.switchings(theta, block.history) if block.channel == "temperature" else smooth[:, :0]
        )
        misfit = np.concatenate([smooth, courses / np.maximum(np.abs(courses).max(axis=0), 1e-300)], axis=1)
        response = history.observed[block.channel] - own
        recorded = recorded_columns(inputs, misfit)
        changed = changes = of_cycles = None
        if block.channel != "temperature":
            if hypothesis.steady_noise:
                of_cycles = partial(_of_cycles, hypothesis, block, theta, response, smooth)
            changed = partial(_changed, hypothesis, block, theta, response, misfit, recorded)
            changes = partial(_changes, hypothesis, block, theta, response)
        cut = _cut_off(history.observed[block.channel])
        out.append(
            block_noise(own, block, misfit, lattice, recorded, response, changed, changes, cut, of_cycles)
        )
        beside.append((smooth, courses))
    return _with_scattered_switching(blocks, out, residual, beside)


def _cut_off(readings: Floats) -> NDArray[np.bool_]:
    """Which readings (n,) are at the end of a range, the same to the last digit in a long run."""
    return np.isin(readings, [top.value for top in clipped(readings)])


def _with_scattered_switching(
    blocks: Sequence[ChannelBlock],
    noise: Sequence[BlockNoise],
    residual: Floats,
    beside: Sequence[tuple[Floats, Floats]],
) -> Noise:
    """The noise with the scatter of instants of switching on top: one size for the campaign, where there is any."""
    parts = [
        (own.whiten(residual[block.at]), own.whiten(smooth.T).T, own.whiten(courses.T).T)
        for block, own, (smooth, courses) in zip(blocks, noise, beside, strict=True)
        if courses.size
    ]
    size = likeliest_size(parts)
    return tuple(
        replace(own, switching=Scatter.of(size, size * courses, own.whiten)) if size and courses.size else own
        for own, (_, courses) in zip(noise, beside, strict=True)
    )


def _changed(
    hypothesis: Hypothesis,
    block: ChannelBlock,
    theta: Floats,
    response: Floats,
    misfit: Floats,
    recorded: Floats,
) -> Floats:
    """See `curve_columns`; made where noise that remembers is left, as most of it does not."""
    curve = (response, slope_of(hypothesis, block, theta))
    inputs = hypothesis.histories[block.history].inputs
    return curve_columns(inputs, curve, np.concatenate([misfit, recorded], axis=1))


def _changes(hypothesis: Hypothesis, block: ChannelBlock, theta: Floats, response: Floats) -> list[Floats]:
    """See `curve_changes`; made where noise that remembers is left, as most of it does not."""
    inputs = hypothesis.histories[block.history].inputs
    return curve_changes(inputs, response, slope_of(hypothesis, block, theta))


def _of_cycles(
    hypothesis: Hypothesis,
    block: ChannelBlock,
    theta: Floats,
    response: Floats,
    smooth: Floats,
    known: Floats,
) -> list[Floats]:
    """See `cycle_columns`; made where noise that remembers is left, as most of it does not."""
    inputs = hypothesis.histories[block.history].inputs
    own, *_ = curve_changes(inputs, response, slope_of(hypothesis, block, theta))
    own = _free_of(known, [own])
    return [
        own,
        *cycle_columns(inputs, np.concatenate([smooth, own], axis=1), np.concatenate([known, own], axis=1)),
    ]


def slope_of(hypothesis: Hypothesis, block: ChannelBlock, theta: Floats) -> Floats:
    """Derivative of a channel as predicted by temperature, at each sample of a block, shape (n,)."""
    inputs = hypothesis.histories[block.history].inputs

    def at(by: float) -> Floats:
        moved = {**inputs, "temperature": inputs["temperature"] + by}
        return hypothesis.predict(theta, block.history, moved)[block.channel]

    return (at(0.05) - at(-0.05)) / 0.1


def smooth_columns(history: History, temperature: Floats, most: int = TEMPERATURE_SPLINES) -> Floats:
    """What a model may miss without it being noise, shape (n, k); at most so many splines on each branch."""
    v = history.inputs
    branch = indicators(v["branch"])
    count = int(np.clip(history.n // (12 * branch.shape[1]), 4, most))
    cycle = indicators(grouped(v["cycle"]))
    parts = [row_tensor_product(branch, bspline_basis(temperature, count))]
    if cycle.shape[1] > 1:
        parts.append(cycle[:, 1:])
    return np.concatenate(parts, axis=1)


def recorded_columns(inputs: Mapping[str, Floats], smooth: Floats) -> Floats:
    """Smooth functions of what else was recorded, orthonormal and free of the columns `smooth` (n, k), shape (n, j).

    Parameters
    ----------
    inputs : mapping of str to ndarray, shape (n,)
        Of a history.
    smooth : ndarray, shape (n, k)
    """
    return _free_of(smooth, _functions_of(inputs, COVARIATE_SPLINES, len(smooth) // LEAST_SAMPLES_PER_SPLINE))


def curve_columns(inputs: Mapping[str, Floats], curve: Sequence[Floats], smooth: Floats) -> Floats:
    """What changes the curve with something recorded, orthonormal and free of the columns `smooth` (n, k), (n, j).

    A sweep is a common shape with an offset, a stroke and a shift in temperature, on either branch. What changes these
    with the cycle or the rate, as training and a lagging sensor do, is a product of the curve or its slope with a
    function of what was recorded.

    Parameters
    ----------
    inputs : mapping of str to ndarray, shape (n,)
        Of a history.
    curve : sequence of ndarray, shape (n,)
        The response as predicted, and its slope against temperature.
    smooth : ndarray, shape (n, k)
    """
    parts = [(x - x.mean()) / max(float(np.std(x)), 1e-300) for x in curve]
    on_branch = row_tensor_product(indicators(inputs["branch"]), np.stack(parts, axis=1))
    most = len(smooth) // (LEAST_SAMPLES_PER_SPLINE * on_branch.shape[1])
    return _free_of(
        smooth, [row_tensor_product(on_branch, f) for f in _functions_of(inputs, CURVE_CHANGE_SPLINES, most)]
    )


def curve_changes(inputs: Mapping[str, Floats], response: Floats, slope: Floats) -> list[Floats]:
    """What may be wrong with the curve of a record, and change it with something recorded: sets of columns (n, k).

    A sweep is a common shape with an offset, a stroke, a shift in temperature and a width, on either branch. A record
    may have a stroke, a place and a width of its own, as under another load where one curve serves all; and what
    changes stroke and place with the cycle or the rate, as training and a lagging sensor do, is a product of the curve
    or its slope with a function of what was recorded. The first set has the former, each further one what changes with
    one thing recorded, and the last, where there are several, all of these.

    Parameters
    ----------
    inputs : mapping of str to ndarray, shape (n,)
        Of a history.
    response, slope : ndarray, shape (n,)
        The response as predicted, and its derivative by temperature.
    """
    branch = indicators(inputs["branch"])
    weight = branch * np.maximum(np.abs(slope), 1e-300)[:, None]
    middle = branch @ (inputs["temperature"] @ weight / weight.sum(axis=0))
    parts = [_unit(x) for x in (response, slope, slope * (inputs["temperature"] - middle))]
    own = row_tensor_product(branch, np.stack(parts, axis=1))
    moved = row_tensor_product(branch, np.stack(parts[:2], axis=1))
    functions = _functions_of(inputs, CURVE_CHANGE_SPLINES, len(response))
    changed = [row_tensor_product(moved, f) for f in functions]
    every = [np.concatenate(changed, axis=1)] if len(changed) > 1 else []
    return [own, *changed, *every]


def cycle_columns(inputs: Mapping[str, Floats], courses: Floats, known: Floats) -> list[Floats]:
    """What one cycle alone may miss, as where a specimen was out of its seat: a set of columns (n, k) for each cycle.

    None of a record of fewer than `FEWEST_CYCLES`.

    Parameters
    ----------
    inputs : mapping of str to ndarray, shape (n,)
        Of a history.
    courses : ndarray, shape (n, k)
        What it may miss while it lasts, see `smooth_columns` and `curve_changes`.
    known : ndarray, shape (n, j)
        Columns of which the sets are to be free.
    """
    cycle = indicators(grouped(inputs["cycle"]))
    if cycle.shape[1] < FEWEST_CYCLES:
        return []
    return [_free_of(known, [courses * on[:, None]]) for on in cycle.T]


def jump_columns(innovations: Floats, block: ChannelBlock, known: Floats) -> tuple[list[Floats], Floats]:
    """Levels that change for good, as where a grip slips: at the greatest innovation, at the two greatest, and so on.

    Parameters
    ----------
    innovations : ndarray, shape (n,)
    block : ChannelBlock
    known : ndarray, shape (n, k)
        Columns of which the sets are to be free.

    Returns
    -------
    sets : list of ndarray, shape (n, j)
    log_prior : ndarray, shape (sets,)
        Each set is one of all that there are of so many samples.
    """
    within = np.flatnonzero(~block.first)
    many = min(MOST_JUMPS, within.size)
    at = within[np.argsort(-np.abs(innovations[within]), kind="stable")[:many]]
    after = (np.arange(innovations.size)[:, None] >= at).astype(float)
    counts = np.arange(1, many + 1)
    ln_sets = gammaln(within.size + 1) - gammaln(counts + 1) - gammaln(within.size - counts + 1)
    return [_free_of(known, [after[:, :count]]) for count in counts], -ln_sets - np.log(max(many, 1))


def _unit(x: Floats) -> Floats:
    """A series less its mean, of unit spread."""
    return np.asarray((x - x.mean()) / max(float(np.std(x)), 1e-300))


def _functions_of(inputs: Mapping[str, Floats], named: Mapping[str, int], most: int) -> list[Floats]:
    """Splines of what was recorded and varies, as many as are named for each and `most` at most."""
    out = []
    for name, few in named.items():
        x = inputs.get(name)
        if x is None or (name == "order" and "time" in inputs) or np.ptp(x) <= 1e-9 * np.max(np.abs(x)):
            continue
        count = min(few, most, np.unique(x).size)
        if count > 1:
            out.append(bspline_basis(x, count))
    return out


def _free_of(smooth: Floats, parts: Sequence[Floats]) -> Floats:
    """Columns as an orthonormal basis of what they have that the columns `smooth` (n, k) do not."""
    if not parts:
        return np.empty((len(smooth), 0))
    columns = np.concatenate(parts, axis=1)
    axes, size = _axes(smooth)
    axes = axes[:, size > LEAST_SINGULAR_VALUE * size[0]]
    basis, own = _axes(columns - axes @ (axes.T @ columns))
    return np.asarray(basis[:, own > LEAST_SINGULAR_VALUE * np.linalg.norm(columns, axis=0).max()])


def _axes(columns: Floats) -> tuple[Floats, Floats]:
    """Left singular vectors (n, k) and singular values (k,) of columns, by way of QR, as n is many times k."""
    q, r = np.linalg.qr(columns)
    u, size, _ = np.linalg.svd(r)
    return q @ u[:, : size.size], size


def block_noise(
    residual: Floats,
    block: ChannelBlock,
    smooth: Floats,
    lattice: float = 0.0,
    recorded: Floats | None = None,
    response: Floats | None = None,
    changed: Callable[[], Floats] | None = None,
    changes: Callable[[], Sequence[Floats]] | None = None,
    cut_off: NDArray[np.bool_] | None = None,
    of_cycles: Callable[[Floats], Sequence[Floats]] | None = None,
) -> BlockNoise:
    """Standard deviation and memory of greatest restricted likelihood.

    The memory is either one number a sample or falls exponentially in time, whichever is likelier.

    Parameters
    ----------
    residual : ndarray, shape (n,)
    block : ChannelBlock
    smooth : ndarray, shape (n, k)
        Columns that are taken out of the residuals.
    lattice : float
        Distance of neighbouring readings. Where it is wider than the innovations, these are 0 or a step, which no
        distribution with heavy tails describes.
    recorded : ndarray, shape (n, j), optional
        More such columns (see `recorded_columns`), taken out where they describe more than noise does. A long memory is
        known by what is slow; with all that is slow taken out of every record it would be known far less well.
    response : ndarray, shape (n,), optional
        What the model predicts. Where the size of innovations changes with it beyond doubt they get a width that does:
        in the shuffled series of chance, and as heavy tails, it would be even.
    changed : callable, optional
        Makes columns (n, l) of changes of the curve (see `curve_columns`), which are taken out together with those of
        what was recorded where noise that remembers is left and all of these describe more than it does beyond doubt.
    changes : callable, optional
        Makes sets of columns of changes of the curve (see `curve_changes`), in place of those where samples are too few
        for any. The first set is taken out then, the others where they describe more than noise does beyond doubt and
        leave it a much shorter memory.
    cut_off : ndarray of bool, shape (n,), optional
        Readings at the end of a range (see `_cut_off`). They have no noise, and no say in how large it is elsewhere.
    of_cycles : callable, optional
        Makes sets of columns of what one cycle alone misses (see `cycle_columns`). They are taken out where noise that
        remembers is left after all others, as those of `changes` are, and then jumps (see `jump_columns`); without it
        neither is.
    """
    noisy = slice(None) if cut_off is None else ~cut_off
    likeliest = partial(_likeliest, residual, block, noisy=noisy)
    with_random = partial(_shorter_with_random, residual, block, noisy)
    noise, innovations = likeliest(smooth)
    misfit, more = smooth, smooth[:, :0]
    if recorded is not None and recorded.shape[1]:
        more = recorded
        both = np.concatenate([misfit, more], axis=1)
        beside = likeliest(both)
        if _by_chance(residual, beside[0], misfit, both) < COVARIATE_P:
            smooth, (noise, innovations) = both, beside
    long = np.median(noise.memory) >= LONG_CORRELATION
    columns = changed() if changed is not None and long else smooth[:, :0]
    random: Floats | None = None
    if columns.shape[1]:
        both = np.concatenate([misfit, more, columns], axis=1)
        beside = likeliest(both)
        # the memory beside so many columns is hardly known: whatever it may be, they must describe more than noise does
        if is_shorter(beside[0], noise) and all(
            p * _by_chance(residual, o, misfit, both) < CURVE_CHANGE_P for p, o in beside[0].others
        ):
            smooth, (noise, innovations) = both, beside
    elif changes is not None and long:
        own, *sets = changes()
        smooth = np.concatenate([smooth, own], axis=1)
        noise, innovations = likeliest(smooth)
        if (shorter := with_random(noise, smooth, sets)) is not None:
            random, noise, innovations = shorter
    if of_cycles is not None and remembers(noise):
        own, *sets = of_cycles(smooth)
        wider = np.concatenate([smooth, own], axis=1)
        if (shorter := with_random(noise, wider, sets, random)) is not None:
            smooth, (random, noise, innovations) = wider, shorter
    if of_cycles is not None and remembers(noise):
        sets, log_prior = jump_columns(innovations, block, smooth)
        if (shorter := with_random(noise, smooth, sets, random, log_prior)) is not None:
            random, noise, innovations = shorter
    width: Floats | float = 1.0
    if response is not None:
        grown = growth(innovations[noisy], response[noisy])
        if grown.is_noise:
            low, high = response[noisy].min(), response[noisy].max()
            width = np.exp(grown.slope * (np.clip(response, low, high) - low) / (high - low))
            width = width / np.sqrt(np.mean(width**2))
            noise, innovations = likeliest(smooth, width, random)
    narrowest = noise.sd * float(np.sqrt(1.0 - np.median(noise.memory) ** 2))
    tails: HeavyTails | None = None
    for _ in range(REWEIGHTING_ROUNDS if lattice < narrowest else 0):
        heavy = heavy_tails(innovations / width, noisy)
        if heavy is None:
            break
        tails = heavy
        noise, innovations = likeliest(smooth, width * tails.scale, random)
    if tails is None:
        return noise
    u = innovations / width
    # in noise that comes and goes, or a misfit that passes for tails, readings would be moved by what is no noise
    if _remembers_size(u):
        return replace(noise, tails=tails.scale)
    return _without_excess(noise, u - tails.counted(u), width, tails.information)


def _remembers_size(innovations: Floats) -> bool:
    """Whether an innovation is large or small as the one before is, by more than chance leaves."""
    size = _ln_size(innovations)
    size = size - size.mean()
    correlation = float(size[1:] @ size[:-1]) / max(float(size @ size), 1e-300)
    return correlation * math.sqrt(size.size) > SIZE_STANDARD_ERRORS


def _ln_size(innovations: Floats) -> Floats:
    """Logarithm of the magnitude of each innovation, those of nearly nothing held at a thousandth of the usual one."""
    return np.log(np.maximum(np.abs(innovations), 1e-3 * (np.sqrt(np.mean(innovations**2)) or 1.0)))


def _without_excess(
    noise: BlockNoise, excess: Floats, width: Floats | float, information: float
) -> BlockNoise:
    """Noise with the tails of Student's t, as normal noise of what counts of each innovation.

    Parameters
    ----------
    noise : BlockNoise
        With scales of each innovation.
    excess : ndarray, shape (n,)
        What does not count, over the width of each innovation.
    width : ndarray, shape (n,), or float
        Of innovations, where their size grows with the response, over the standard deviation of `noise`.
    information : float
        See `HeavyTails`.
    """
    wider = 1.0 / math.sqrt(information)
    return BlockNoise(
        wider * noise.sd,
        noise.memory,
        width,
        tuple((p, BlockNoise(wider * o.sd, o.memory, width)) for p, o in noise.others),
        excess=noise.sd * memory_series(excess, noise.memory, width),
    )


def _changes_beyond_noise(
    residual: Floats,
    block: ChannelBlock,
    smooth: Floats,
    sets: Sequence[Floats],
    log_prior: Floats | None = None,
) -> Floats | None:
    """The likeliest of some sets of columns at its likeliest size, if they describe more than noise does beyond doubt.

    Coefficients are normal, of a common size; sets, sizes and memories are averaged over. That average is compared with
    the likeliest memory of noise alone, whatever it is. So noise that is AR(1) is taken for columns with a probability
    of `CURVE_CHANGE_P` at most, however many columns there are and however little is known of its memory (by
    Markov's inequality, as the expected Bayes factor against the truth is 1).

    Parameters
    ----------
    residual : ndarray, shape (n,)
    block : ChannelBlock
    smooth : ndarray, shape (n, k)
    sets : sequence of ndarray, shape (n, j)
    log_prior : ndarray, shape (sets,), optional
        Logarithms of their probabilities a priori; all the same by default.

    Returns
    -------
    ndarray, shape (n, j), or None
        For coefficients of the size of the noise.
    """
    if not sets:
        return None
    memories, _ = _memories(block)
    log_scale = np.array([memory_log_scale(m).sum() for m in memories])
    alone = _restricted(_products(np.column_stack([smooth, residual]), block), log_scale, residual.size)[0]
    found = np.stack([_with_random(residual, block, smooth, columns, log_scale) for columns in sets])
    prior = np.full(len(sets), -np.log(len(sets))) if log_prior is None else log_prior
    found = found + prior[:, None, None]
    average = logsumexp(found) - np.log(found[0].size)
    if average < alone.max() - math.log(CURVE_CHANGE_P):
        return None
    which, size = divmod(int(np.argmax(logsumexp(found, axis=2))), CHANGE_SD_GRID.size)
    return np.asarray(sets[which] * CHANGE_SD_GRID[size])


def _shorter_with_random(
    residual: Floats,
    block: ChannelBlock,
    noisy: NDArray[np.bool_] | slice,
    noise: BlockNoise,
    smooth: Floats,
    sets: Sequence[Floats],
    random: Floats | None = None,
    log_prior: Floats | None = None,
) -> tuple[Floats, BlockNoise, Floats] | None:
    """Random columns with those of `_changes_beyond_noise`, and what `_likeliest` gives beside them.

    None where there are no such columns, or where they leave a memory that is not much shorter than that of `noise`.
    """
    found = _changes_beyond_noise(residual, block, smooth, sets, log_prior)
    if found is None:
        return None
    columns = found if random is None else np.concatenate([random, found], axis=1)
    beside, innovations = _likeliest(residual, block, smooth, 1.0, columns, noisy)
    return (columns, beside, innovations) if is_shorter(beside, noise) else None


def _with_random(
    residual: Floats, block: ChannelBlock, smooth: Floats, random: Floats, log_scale: Floats
) -> Floats:
    """Restricted log likelihoods beside columns with normal coefficients, by `CHANGE_SD_GRID` and memory, (S, m)."""
    k, j = smooth.shape[1], random.shape[1]
    products = _products(np.column_stack([smooth, random, residual]), block)
    fixed, across, own = products[:, :k, :k].copy(), products[:, :k, k:], products[:, k:, k:]
    place = np.arange(k)
    fixed[:, place, place] += RELATIVE_PRECISION * np.trace(fixed, axis1=1, axis2=2)[:, None] / k
    left = own - np.swapaxes(across, 1, 2) @ np.linalg.solve(fixed, across)
    information, axes = np.linalg.eigh(left[:, :j, :j])
    information = np.maximum(information, 0.0)
    pull = np.einsum("mij,mi->mj", axes, left[:, :j, j]) ** 2
    precision = CHANGE_SD_GRID[:, None, None] ** -2.0
    squares = left[:, j, j] - np.sum(pull / (information + precision), axis=2)
    free = max(residual.size - k, 1)
    volume = np.linalg.slogdet(fixed)[1] + np.log1p(information / precision).sum(axis=2)
    variance = np.maximum(squares, 1e-300) / free
    return np.asarray(-0.5 * free * np.log(variance) - log_scale - 0.5 * volume)


@dataclass(frozen=True, slots=True)
class HeavyTails:
    """Student's t of some innovations u, with k degrees of freedom and unit width.

    A change d of them has the score ``psi(u) d`` with ``psi(u) = (k + 1) u/(k + u**2)``, and the information ``i d**2``
    with ``i = (k + 1)/(k + 3)``. Normal innovations ``psi(u)/i`` of variance ``1/i`` have both. Scales of each
    innovation, ``sqrt(u/psi(u))``, have the same score and an information of 1: what is estimated with them scatters
    more than they say, by ``sqrt(1/i)``. What is left out, ``u - psi(u)/i``, is uncorrelated with ``psi(u)``. Such
    pseudo-observations: P. J. Huber, Robust Statistics (Wiley, 1981), section 7.8; the information: K. L. Lange, R. J.
    A. Little and J. M. G. Taylor, J. Am. Stat. Assoc. 84 (1989) 881-896.

    Attributes
    ----------
    degrees : float
        Of freedom, k.
    scale : ndarray, shape (n,)
        Of each innovation.
    """

    degrees: float
    scale: Floats

    @property
    def information(self) -> float:
        """On a change of an innovation, i; 1 for normal ones."""
        return (self.degrees + 1.0) / (self.degrees + 3.0)

    def counted(self, u: Floats) -> Floats:
        """What counts of innovations of unit width, ``psi(u)/i``, shape (n,)."""
        return (self.degrees + 1.0) * u / (self.degrees + u**2) / self.information


def heavy_tails(innovations: Floats, noisy: NDArray[np.bool_] | slice = slice(None)) -> HeavyTails | None:
    """The likeliest of Student's t distributions; None where the normal distribution describes innovations.

    Heavy tails are those of many: the `OUTLIERS_SET_ASIDE` greatest innovations have no say, as a jump of the specimen
    or the rig makes one, and is no noise.

    Parameters
    ----------
    innovations : ndarray, shape (n,)
        Of a common scale.
    noisy : ndarray of bool, shape (n,), optional
        Those whose distribution is asked for.
    """
    usual = innovations[noisy]
    usual = usual[np.argsort(np.abs(usual))[: max(usual.size - OUTLIERS_SET_ASIDE, 1)]]
    width = float(np.sqrt(np.mean(usual**2))) or 1.0
    best, found = stats.norm.logpdf(usual, scale=width).sum() + HEAVY_TAILS_GAIN, None
    for degrees in DEGREES_OF_FREEDOM:
        own = width
        for _ in range(EM_ROUNDS):
            weight = (degrees + 1.0) / (degrees + (usual / own) ** 2)
            own = float(np.sqrt(np.mean(weight * usual**2))) or 1.0
        value = stats.t.logpdf(usual, degrees, scale=own).sum()
        if value > best and own > LEAST_WIDTH * width:
            scale = np.sqrt((degrees + (innovations / own) ** 2) / (degrees + 1.0))
            best, found = value, HeavyTails(degrees, scale)
    return found


def noise_as_it_is(residual: Floats, block: ChannelBlock) -> BlockNoise:
    """AR(1) noise of greatest likelihood of a series with nothing taken out: what a model misses is in it.

    Parameters
    ----------
    residual : ndarray, shape (n,)
    block : ChannelBlock
    """
    memories, _ = _memories(block)
    sds = [float(np.sqrt(np.mean(memory_innovations(residual, m) ** 2))) for m in memories]
    value = [
        -residual.size * math.log(max(sd, 1e-300)) - memory_log_scale(m).sum()
        for sd, m in zip(sds, memories, strict=True)
    ]
    likeliest = int(np.argmax(value))
    return BlockNoise(sds[likeliest], memories[likeliest])


def _memories(block: ChannelBlock) -> tuple[list[Floats], NDArray[np.bool_]]:
    """Memories of a block that are tried, each (n,), and which of them chance may have: by sample, and in time."""
    follows = ~block.first
    memories = [np.where(follows, phi, 0.0) for phi in CORRELATION_GRID]
    possible = block.possible
    if block.uneven:
        memories += [
            np.where(follows, phi ** np.maximum(block.dt, 1e-3), 0.0)
            for phi in CORRELATION_GRID[CORRELATION_GRID > 0.0]
        ]
        possible = np.concatenate([possible, possible[CORRELATION_GRID > 0.0]])
    return memories, possible


def _likeliest(
    residual: Floats,
    block: ChannelBlock,
    smooth: Floats,
    scale: Floats | float = 1.0,
    random: Floats | None = None,
    noisy: NDArray[np.bool_] | slice = slice(None),
) -> tuple[BlockNoise, Floats]:
    """Noise of greatest restricted likelihood for given scales, and the innovations without their scales.

    Parameters
    ----------
    residual : ndarray, shape (n,)
    block : ChannelBlock
    smooth : ndarray, shape (n, k)
    scale : ndarray, shape (n,), or float
    random : ndarray, shape (n, j), optional
        Columns with normal coefficients of the standard deviation of the noise.
    noisy : ndarray of bool, shape (n,), optional
        Innovations that have noise; by these its size is told.
    """
    held = np.zeros(smooth.shape[1])
    if random is not None:
        smooth = np.concatenate([smooth, random], axis=1)
        held = np.concatenate([held, np.ones(random.shape[1])])
    width = np.broadcast_to(scale, residual.shape)[:, None]
    products = _products(np.column_stack([smooth, residual]), block, width)
    memories, possible = _memories(block)
    log_scale = np.array([memory_log_scale(m).sum() for m in memories])
    value, sd = _restricted(products, log_scale, residual.size, held)
    likeliest = int(np.argmax(value))
    shorter = np.array([m.max() for m in memories]) <= memories[likeliest].max()
    probability = np.exp(value - value.max())
    probability = np.where(
        (possible | shorter) & (probability >= LEAST_RELATIVE_LIKELIHOOD), probability, 0.0
    )
    probability = probability / probability.sum()
    best = BlockNoise(float(sd[likeliest]), memories[likeliest], scale)
    w, columns = best.whiten(residual), best.whiten(smooth.T).T
    left = w - columns @ np.linalg.solve(*_normal_equations(products[likeliest], held))
    whole = float(np.mean(left**2))
    size = math.sqrt(float(np.mean(left[noisy] ** 2)) / whole) if whole else 1.0
    others = tuple(
        (float(probability[i]), BlockNoise(size * float(sd[i]), memories[i], scale))
        for i in np.flatnonzero(probability).tolist()
    )
    return replace(best, sd=size * best.sd, others=others), np.asarray(left / size * scale)


def scatter(residual: Floats, block: ChannelBlock) -> float:
    """Standard deviation from reading to reading: of differences of neighbours over the square root of 2.

    By the median, so that jumps and outliers don't count. For white noise it is the standard deviation; what changes
    slowly isn't in it.

    Parameters
    ----------
    residual : ndarray, shape (n,)
    block : ChannelBlock
    """
    steps = np.diff(residual)[~block.first[1:]]
    return float(MAD_TO_SD * np.median(np.abs(steps)) / np.sqrt(2.0)) if steps.size else 0.0


@dataclass(frozen=True, slots=True)
class Growth:
    """How the size of innovations changes with the response, by regression of the logarithm of their magnitude.

    Attributes
    ----------
    slope : float
        From the least response to the greatest: ln of the ratio.
    error : float
        Standard error of it, of normal innovations of one size, whose ln magnitude has a standard deviation of
        pi/sqrt(8); infinite where the response is constant.
    hump : float
        By how much the ln size halfway is above the line. What a model misses is largest where the curve is steep.
    """

    slope: float
    error: float
    hump: float

    @property
    def is_noise(self) -> bool:
        """Whether it is beyond doubt, and more a change with the response than one where the curve is steep."""
        return abs(self.slope) > GROWTH_STANDARD_ERRORS * self.error and abs(self.hump) < abs(self.slope)


def growth(innovations: Floats, response: Floats) -> Growth:
    """How the size of innovations (n,) changes with the response (n,)."""
    span = float(np.ptp(response))
    if not span > 0.0:
        return Growth(0.0, math.inf, 0.0)
    x = (response - response.min()) / span
    size = _ln_size(innovations)
    columns = np.stack([np.ones(x.size), x, 4.0 * x * (1.0 - x)], axis=1)
    precision = columns.T @ columns
    if np.linalg.cond(precision) > 1e10:  # of two levels no hump can be told
        return Growth(0.0, math.inf, 0.0)
    inverse = np.linalg.inv(precision)
    _, slope, hump = (inverse @ (columns.T @ size)).tolist()
    return Growth(slope, math.pi / math.sqrt(8.0) * math.sqrt(inverse[1, 1]), hump)


def remembers(noise: BlockNoise) -> bool:
    """Whether one cycle unlike the others, or a jump, may be what made noise remember."""
    return bool(np.median(noise.memory) >= LEAST_CORRELATION)


def is_shorter(beside: BlockNoise, noise: BlockNoise) -> bool:
    """Whether noise remembers for at most `MAX_MEMORY_RATIO` of what it did before columns were taken out."""
    of_beside, of_noise = (float(np.median(_samples_as_one(n.memory))) for n in (beside, noise))
    return of_beside <= MAX_MEMORY_RATIO * of_noise


def _samples_as_one(memory: Floats) -> Floats:
    """How many samples count as one for the mean, as noise remembers."""
    return np.asarray((1.0 + memory) / (1.0 - memory))


def _by_chance(residual: Floats, noise: BlockNoise, fewer: Floats, columns: Floats) -> float:
    """Probability that noise puts as much into columns beyond the first of them as was found there."""
    described = _squares(residual, noise, fewer) - _squares(residual, noise, columns)
    return float(stats.chi2.sf(described, columns.shape[1] - fewer.shape[1]))


def _squares(residual: Floats, noise: BlockNoise, columns: Floats) -> float:
    """Sum of squared innovations that columns leave."""
    w = noise.whiten(np.column_stack([columns, residual]).T)
    products = w @ w.T
    gram, pull = _normal_equations(products)
    return float(products[-1, -1] - pull @ np.linalg.solve(gram, pull))


def _normal_equations(products: Floats, held: Floats | float = 0.0) -> tuple[Floats, Floats]:
    """Of columns (k) and, last, a series: their products among each other, hardly held, and with the series.

    Parameters
    ----------
    products : ndarray, shape (..., k + 1, k + 1)
    held : ndarray, shape (k,), or float
        Precisions of the coefficients, over that of the innovations.
    """
    gram = products[..., :-1, :-1].copy()
    place = np.arange(gram.shape[-1])
    gram[..., place, place] += (
        RELATIVE_PRECISION * np.trace(gram, axis1=-2, axis2=-1)[..., None] / place.size + held
    )
    return gram, products[..., :-1, -1]


def _products(series: Floats, block: ChannelBlock, width: Floats | None = None) -> Floats:
    """Products of the innovations of series (n, k) under each memory that is tried, shape (m, k, k).

    An innovation ``x[i] - phi x[i-1]`` is ``(x[i] - x[i-1]) + (1 - phi) x[i-1]``, so three matrices of products serve
    all memories by sample, without loss of digits where these are near 1.

    Parameters
    ----------
    series : ndarray, shape (n, k)
    block : ChannelBlock
    width : ndarray, shape (n, 1), optional
        Scales of the innovations; 1 if not given.
    """
    scales = np.ones((len(series), 1)) if width is None else width
    later = np.flatnonzero(~block.first)
    first = series[block.first] / scales[block.first]
    before = series[later - 1] / scales[later]
    step = series[later] / scales[later] - before
    crossed = step.T @ before
    forgotten = (1.0 - CORRELATION_GRID)[:, None, None]
    squares = step.T @ step + forgotten * (crossed + crossed.T) + forgotten**2 * (before.T @ before)
    products = np.asarray(first.T @ first + squares / (1.0 - CORRELATION_GRID**2)[:, None, None])
    in_time = _memories(block)[0][CORRELATION_GRID.size :]
    if not in_time:
        return products
    innovations = [memory_innovations(series.T, m, scales[:, 0]) for m in in_time]
    return np.concatenate([products, [w @ w.T for w in innovations]])


def _restricted(
    products: Floats, log_scale: Floats, n: int, held: Floats | None = None
) -> tuple[Floats, Floats]:
    """Restricted log likelihoods of memories, up to a constant, with the standard deviations that go with them.

    Parameters
    ----------
    products : ndarray, shape (m, k + 1, k + 1)
        Of the innovations of the columns and, last, of the residuals.
    log_scale : ndarray, shape (m,)
        Sum over samples of the logarithm of the scale of an innovation at unit standard deviation.
    n : int
        Samples.
    held : ndarray, shape (k,), optional
        Precisions of the coefficients, over that of the innovations; 0, of what nothing is known of, if not given.
    """
    held = np.zeros(products.shape[-1] - 1) if held is None else held
    gram, pull = _normal_equations(products, held)
    free = max(n - int(np.sum(held == 0.0)), 1)
    explained = np.sum(pull * np.linalg.solve(gram, pull[..., None])[..., 0], axis=1)
    sd = np.sqrt(np.maximum(products[:, -1, -1] - explained, 1e-300) / free)
    return -free * np.log(sd) - log_scale - 0.5 * np.linalg.slogdet(gram)[1], sd
