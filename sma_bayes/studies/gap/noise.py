"""The noise that hypotheses are judged by.

Noise of each history and channel is an AR(1) series, in sample index or in time. What a model misses looks like memory
too: estimated from its residuals, the memory would absorb the very disagreement that is looked for. So it is
estimated from what is left after smooth functions of temperature on each branch, and a level of each cycle, have been
taken out, by restricted likelihood, which counts the freedom that they use up; and smooth functions of time and of
whatever else was recorded as well, where these describe more than noise does. Noise without any misfit is then
estimated without bias, and a misfit that repeats from cycle to cycle, or follows something recorded, does not pass for
noise. All hypotheses of a round share the estimate.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from sma_bayes.arrays import Floats
from sma_bayes.noise.ar1 import memory_innovations, memory_log_scale, memory_series
from sma_bayes.normal import MAD_TO_SD
from sma_bayes.records.history import History, starts
from sma_bayes.studies.gap.hypothesis import Hypothesis
from sma_bayes.studies.gap.splines import bspline_basis, grouped, indicators, row_tensor_product
from sma_bayes.studies.gap.switching import Scatter, likeliest_size

MEMORIES = np.concatenate([[-0.6, -0.3, -0.15], np.tanh(np.linspace(0.0, 2.65, 28))])
"""Correlations of neighbouring samples that are tried."""
GROWS = 5.0
"""Standard errors from which the size of innovations counts as changing with the response; such as does not, once in a
million."""
LONGEST = 1.5
"""Sweeps that may count as one sample under chance: what remembers for longer is a wave that wants an explanation."""
PROBABLE = 1e-3
"""A memory that is less likely than the likeliest one by more than this factor is left out of account."""
DEGREES = (2.0, 3.0, 5.0, 9.0)
"""Degrees of freedom of Student's t that are tried where tails are heavier than normal."""
HEAVY = 10.0
"""Gain of log likelihood from which on tails count as heavy."""
NARROWEST = 0.1
"""Least width of a t distribution over the standard deviation; narrower ones are those of readings that repeat."""
SET_ASIDE = 3
"""Greatest innovations of a record that don't make its tails heavy."""
REWEIGHTED = 4
"""How often scales of innovations and the noise are found in turn."""
TURNS = 20
"""How often weight and width of a t distribution are found in turn."""
SMOOTH = 8
"""Splines of temperature on each branch that are taken out; fewer where samples are few."""
RECORDED = {"time": 6, "order": 6, "ambient_temperature": 6, "rate": 6, "current": 5, "load": 5}
"""Splines of what else was recorded that are tried; of `order` only where time was not."""
BEYOND_NOISE = 1e-3
"""Probability that noise puts as much into these, up to which they are taken out."""
ON_CURVE = {"cycle": 5, "rate": 4, "ambient_temperature": 4, "current": 4}
"""Splines of what may change the curve itself, its stroke and its place on the axis of temperature."""
BEYOND_DOUBT = 1e-6
"""The same for these, which are many."""
REMEMBERS = 0.8
"""Memory from which on they are tried: what changes the curve passes for noise that remembers, or not for noise."""
LESS_LONG = 0.5
"""Time that noise remembers beside them over that without, up to which they are taken out: what only passed for memory
is in them then. A hum, say, has a part in so many columns, too, and its memory stays as it is."""
EACH = 40
"""Samples for each of these splines, at least."""
INDEPENDENT = 1e-6
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
    def possible(self) -> NDArray[np.bool_]:
        """Which of `MEMORIES` chance may have: at most `LONGEST` sweeps count as one sample."""
        samples = (1.0 + MEMORIES) / (1.0 - MEMORIES)
        return np.asarray(samples <= LONGEST * self.sweep)


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
        Of each innovation, over the usual one: above 1 where tails are heavy and the sample is far out.
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

    def whiten(self, x: Floats) -> Floats:
        """Series (..., n) as innovations of unit variance."""
        out = memory_innovations(x / self.sd, self.memory, self.scale)
        return np.asarray(out if self.switching is None else self.switching.whiten(out))

    def as_likely(self, innovations: Floats, rng: np.random.Generator) -> Floats:
        """Series (n, count) from innovations of unit variance, each with one of `others` drawn for it."""
        others = self.others or ((1.0, self),)
        which = rng.choice(len(others), size=innovations.shape[1], p=[p for p, _ in others])
        memory = np.stack([o.memory for _, o in others], axis=1)[:, which]
        sd = np.array([o.sd for _, o in others])[which]
        out = memory_series(innovations.T, memory.T, self.scale).T * sd
        return np.asarray(out if self.switching is None else out + self.switching.drawn(rng, out.shape[1]))

    def scale_on(self, kept: NDArray[np.bool_]) -> Floats | float:
        """Scales of the samples for which a mask is true."""
        return self.scale if np.ndim(self.scale) == 0 else np.asarray(self.scale)[kept]

    @property
    def log_scale(self) -> float:
        """Sum over samples of the logarithm of the scale of an innovation."""
        widths = np.log(np.broadcast_to(self.scale, self.memory.shape))
        own = self.memory.size * np.log(self.sd) + memory_log_scale(self.memory).sum() + widths.sum()
        return float(own) + (0.0 if self.switching is None else self.switching.log_scale)

    def on(self, kept: NDArray[np.bool_]) -> BlockNoise:
        """The same noise of samples for which a mask is true; without memory where the one before is not kept."""
        together = np.concatenate([[False], kept[:-1]])[kept]
        some = BlockNoise(self.sd, np.where(together, self.memory[kept], 0.0), self.scale_on(kept))
        if self.switching is None:
            return some
        courses = self.switching.courses[kept]
        return replace(some, switching=Scatter.of(self.switching.size, courses, some.whiten))


Noise = tuple[BlockNoise, ...]


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
    out = np.empty_like(series)
    for block, own in zip(blocks, noise, strict=True):
        out[..., block.at] = own.whiten(series[..., block.at])
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
        changed = None
        if block.channel != "temperature":
            changed = partial(_changed, hypothesis, block, theta, response, misfit, recorded)
        out.append(block_noise(own, block, misfit, lattice, recorded, response, changed))
        beside.append((smooth, courses))
    return _with_scattered_switching(blocks, out, residual, beside)


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


def slope_of(hypothesis: Hypothesis, block: ChannelBlock, theta: Floats) -> Floats:
    """Derivative of a channel as predicted by temperature, at each sample of a block, shape (n,)."""
    inputs = hypothesis.histories[block.history].inputs

    def at(by: float) -> Floats:
        moved = {**inputs, "temperature": inputs["temperature"] + by}
        return hypothesis.predict(theta, block.history, moved)[block.channel]

    return (at(0.05) - at(-0.05)) / 0.1


def smooth_columns(history: History, temperature: Floats, most: int = SMOOTH) -> Floats:
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
    return _free_of(smooth, _functions_of(inputs, RECORDED, len(smooth) // EACH))


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
    most = len(smooth) // (EACH * on_branch.shape[1])
    return _free_of(smooth, [row_tensor_product(on_branch, f) for f in _functions_of(inputs, ON_CURVE, most)])


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
    axes = axes[:, size > INDEPENDENT * size[0]]
    basis, own = _axes(columns - axes @ (axes.T @ columns))
    return np.asarray(basis[:, own > INDEPENDENT * np.linalg.norm(columns, axis=0).max()])


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
        what was recorded where
        noise that remembers is left and all of these describe more than it does beyond doubt.
    """
    noise, innovations = _likeliest(residual, block, smooth, 1.0)
    misfit, more = smooth, smooth[:, :0]
    if recorded is not None and recorded.shape[1]:
        more = recorded
        both = np.concatenate([misfit, more], axis=1)
        beside = _likeliest(residual, block, both, 1.0)
        if _by_chance(residual, beside[0], misfit, both) < BEYOND_NOISE:
            smooth, (noise, innovations) = both, beside
    remembers = changed is not None and np.median(noise.memory) >= REMEMBERS
    columns = changed() if changed is not None and remembers else smooth[:, :0]
    if columns.shape[1]:
        both = np.concatenate([misfit, more, columns], axis=1)
        beside = _likeliest(residual, block, both, 1.0)
        # the memory beside so many columns is hardly known: whatever it may be, they must describe more than noise does
        shorter = _samples_as_one(beside[0]) <= LESS_LONG * _samples_as_one(noise)
        if shorter and all(
            p * _by_chance(residual, o, misfit, both) < BEYOND_DOUBT for p, o in beside[0].others
        ):
            smooth, (noise, innovations) = both, beside
    width: Floats | float = 1.0
    if response is not None:
        found = growth(innovations, response)
        if found.is_noise:
            width = np.exp(found.slope * response / np.ptp(response))
            width = width / np.sqrt(np.mean(width**2))
            noise, innovations = _likeliest(residual, block, smooth, width)
    narrowest = noise.sd * float(np.sqrt(1.0 - np.median(noise.memory) ** 2))
    for _ in range(REWEIGHTED if lattice < narrowest else 0):
        scale = tail_scale(innovations / width)
        if scale is None:
            break
        noise, innovations = _likeliest(residual, block, smooth, width * scale)
    return noise


def tail_scale(innovations: Floats) -> Floats | None:
    """Scale of each innovation under Student's t; None where the normal distribution describes them.

    Heavy tails are those of many: the `SET_ASIDE` greatest innovations have no say, as a jump of the specimen or the
    rig makes one, and is no noise.

    Parameters
    ----------
    innovations : ndarray, shape (n,)
        Of a common scale.
    """
    usual = innovations[np.argsort(np.abs(innovations))[: max(innovations.size - SET_ASIDE, 1)]]
    width = float(np.sqrt(np.mean(usual**2))) or 1.0
    best, scale = stats.norm.logpdf(usual, scale=width).sum() + HEAVY, None
    for degrees in DEGREES:
        own = width
        for _ in range(TURNS):
            weight = (degrees + 1.0) / (degrees + (usual / own) ** 2)
            own = float(np.sqrt(np.mean(weight * usual**2))) or 1.0
        value = stats.t.logpdf(usual, degrees, scale=own).sum()
        if value > best and own > NARROWEST * width:
            best, scale = value, np.sqrt((degrees + (innovations / own) ** 2) / (degrees + 1.0))
    return scale


def _likeliest(
    residual: Floats, block: ChannelBlock, smooth: Floats, scale: Floats | float
) -> tuple[BlockNoise, Floats]:
    """Noise of greatest restricted likelihood for given scales, and the innovations without their scales."""
    follows = ~block.first
    series = np.column_stack([smooth, residual])
    width = np.broadcast_to(scale, residual.shape)[:, None]
    products = _products(series, follows, width)
    memories = [np.where(follows, phi, 0.0) for phi in MEMORIES]
    possible = block.possible
    dt = block.dt[follows]
    if dt.size > 2 and np.std(dt) > 0.05 * np.mean(dt):
        in_time = [
            np.where(follows, phi ** np.maximum(block.dt, 1e-3), 0.0) for phi in MEMORIES[MEMORIES > 0.0]
        ]
        innovations = [memory_innovations(series.T, m, width[:, 0]) for m in in_time]
        products = np.concatenate([products, [w @ w.T for w in innovations]])
        memories += in_time
        possible = np.concatenate([possible, possible[MEMORIES > 0.0]])
    value, sd = _restricted(products, np.array([memory_log_scale(m).sum() for m in memories]), residual.size)
    likeliest = int(np.argmax(value))
    shorter = np.array([m.max() for m in memories]) <= memories[likeliest].max()
    probability = np.exp(value - value.max())
    probability = np.where((possible | shorter) & (probability >= PROBABLE), probability, 0.0)
    probability = probability / probability.sum()
    others = tuple(
        (float(probability[i]), BlockNoise(float(sd[i]), memories[i], scale))
        for i in np.flatnonzero(probability).tolist()
    )
    best = BlockNoise(float(sd[likeliest]), memories[likeliest], scale, others)
    w, columns = best.whiten(residual), best.whiten(smooth.T).T
    left = w - columns @ np.linalg.solve(*_normal_equations(products[likeliest]))
    return best, np.asarray(left * scale)


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
        return abs(self.slope) > GROWS * self.error and abs(self.hump) < abs(self.slope)


def growth(innovations: Floats, response: Floats) -> Growth:
    """How the size of innovations (n,) changes with the response (n,)."""
    span = float(np.ptp(response))
    if not span > 0.0:
        return Growth(0.0, math.inf, 0.0)
    x = (response - response.min()) / span
    size = np.log(np.maximum(np.abs(innovations), 1e-3 * (np.sqrt(np.mean(innovations**2)) or 1.0)))
    columns = np.stack([np.ones(x.size), x, 4.0 * x * (1.0 - x)], axis=1)
    precision = columns.T @ columns
    if np.linalg.cond(precision) > 1e10:  # of two levels no hump can be told
        return Growth(0.0, math.inf, 0.0)
    inverse = np.linalg.inv(precision)
    _, slope, hump = (inverse @ (columns.T @ size)).tolist()
    return Growth(slope, math.pi / math.sqrt(8.0) * math.sqrt(inverse[1, 1]), hump)


def _samples_as_one(noise: BlockNoise) -> float:
    """How many samples count as one for the mean, as noise remembers."""
    memory = float(np.median(noise.memory))
    return (1.0 + memory) / (1.0 - memory)


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


def _normal_equations(products: Floats) -> tuple[Floats, Floats]:
    """Of columns (k) and, last, a series: their products among each other, hardly held, and with the series.

    Parameters
    ----------
    products : ndarray, shape (..., k + 1, k + 1)
    """
    gram = products[..., :-1, :-1].copy()
    place = np.arange(gram.shape[-1])
    gram[..., place, place] += 1e-9 * np.trace(gram, axis1=-2, axis2=-1)[..., None] / place.size
    return gram, products[..., :-1, -1]


def _products(series: Floats, follows: NDArray[np.bool_], width: Floats) -> Floats:
    """Products of the innovations of series (n, k) under each memory of `MEMORIES`, shape (m, k, k).

    An innovation ``x[i] - phi x[i-1]`` is ``(x[i] - x[i-1]) + (1 - phi) x[i-1]``, so three matrices of products serve
    all memories, without loss of digits where these are near 1.

    Parameters
    ----------
    series : ndarray, shape (n, k)
    follows : ndarray of bool, shape (n,)
        Samples that remember the one before.
    width : ndarray, shape (n, 1)
        Scales of the innovations.
    """
    later = np.flatnonzero(follows)
    first = series[~follows] / width[~follows]
    before = series[later - 1] / width[later]
    step = series[later] / width[later] - before
    crossed = step.T @ before
    forgotten = (1.0 - MEMORIES)[:, None, None]
    squares = step.T @ step + forgotten * (crossed + crossed.T) + forgotten**2 * (before.T @ before)
    return np.asarray(first.T @ first + squares / (1.0 - MEMORIES**2)[:, None, None])


def _restricted(products: Floats, log_scale: Floats, n: int) -> tuple[Floats, Floats]:
    """Restricted log likelihoods of memories, up to a constant, with the standard deviations that go with them.

    Parameters
    ----------
    products : ndarray, shape (m, k + 1, k + 1)
        Of the innovations of the smooth columns and, last, of the residuals.
    log_scale : ndarray, shape (m,)
        Sum over samples of the logarithm of the scale of an innovation at unit standard deviation.
    n : int
        Samples.
    """
    gram, pull = _normal_equations(products)
    free = max(n - gram.shape[1], 1)
    explained = np.sum(pull * np.linalg.solve(gram, pull[..., None])[..., 0], axis=1)
    sd = np.sqrt(np.maximum(products[:, -1, -1] - explained, 1e-300) / free)
    return -free * np.log(sd) - log_scale - 0.5 * np.linalg.slogdet(gram)[1], sd
