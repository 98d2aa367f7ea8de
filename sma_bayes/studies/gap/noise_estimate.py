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
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from sma_bayes.arrays import Floats
from sma_bayes.noise.ar1 import memory_series
from sma_bayes.records.quality import clipped
from sma_bayes.studies.gap.hypothesis import Hypothesis
from sma_bayes.studies.gap.innovations import HeavyTails, growth, heavy_tails, remember_size
from sma_bayes.studies.gap.memory_likelihood import CURVE_CHANGE_P, beyond_noise, by_chance, likeliest_noise
from sma_bayes.studies.gap.noise import BlockNoise, ChannelBlock, Noise, samples_as_one
from sma_bayes.studies.gap.noise_columns import (
    curve_changes,
    curve_columns,
    cycle_columns,
    free_of,
    jump_columns,
    recorded_columns,
    slope_of,
    smooth_columns,
)
from sma_bayes.studies.gap.switching import Scatter, likeliest_size

COVARIATE_P = 1e-3
"""Probability that noise puts as much into these, up to which they are taken out."""
LONG_CORRELATION = 0.8
"""Memory from which on they are tried: what changes the curve passes for noise that remembers, or not for noise."""
LEAST_CORRELATION = 0.5
"""Memory from which on it is tried what one cycle has of its own, and jumps: white noise beside a bump in one cycle of
five seems to have one of 0.7 to 0.8."""
MAX_MEMORY_RATIO = 0.5
"""Time that noise remembers beside them over that without, up to which they are taken out: what only passed for memory
is in them then. A hum, say, has a part in so many columns, too, and its memory stays as it is."""
REWEIGHTING_ROUNDS = 4
"""How often scales of innovations and the noise are found in turn."""


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
    own = free_of(known, [own])
    return [
        own,
        *cycle_columns(inputs, np.concatenate([smooth, own], axis=1), np.concatenate([known, own], axis=1)),
    ]


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
    likeliest = partial(likeliest_noise, residual, block, noisy=noisy)
    with_random = partial(_shorter_with_random, residual, block, noisy)
    noise, innovations = likeliest(smooth)
    misfit, more = smooth, smooth[:, :0]
    if recorded is not None and recorded.shape[1]:
        more = recorded
        both = np.concatenate([misfit, more], axis=1)
        beside = likeliest(both)
        if by_chance(residual, beside[0], misfit, both) < COVARIATE_P:
            smooth, (noise, innovations) = both, beside
    long = np.median(noise.memory) >= LONG_CORRELATION
    columns = changed() if changed is not None and long else smooth[:, :0]
    random: Floats | None = None
    if columns.shape[1]:
        both = np.concatenate([misfit, more, columns], axis=1)
        beside = likeliest(both)
        # the memory beside so many columns is hardly known: whatever it may be, they must describe more than noise does
        if is_shorter(beside[0], noise) and all(
            p * by_chance(residual, o, misfit, both) < CURVE_CHANGE_P for p, o in beside[0].others
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
    if remember_size(u):
        return replace(noise, tails=tails.scale)
    return _without_excess(noise, u - tails.counted(u), width, tails.information)


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
    """Random columns with those of `beyond_noise`, and what `likeliest_noise` gives beside them.

    None where there are no such columns, or where they leave a memory that is not much shorter than that of `noise`.
    """
    found = beyond_noise(residual, block, smooth, sets, log_prior)
    if found is None:
        return None
    columns = found if random is None else np.concatenate([random, found], axis=1)
    beside, innovations = likeliest_noise(residual, block, smooth, 1.0, columns, noisy)
    return (columns, beside, innovations) if is_shorter(beside, noise) else None


def remembers(noise: BlockNoise) -> bool:
    """Whether one cycle unlike the others, or a jump, may be what made noise remember."""
    return bool(np.median(noise.memory) >= LEAST_CORRELATION)


def is_shorter(beside: BlockNoise, noise: BlockNoise) -> bool:
    """Whether noise remembers for at most `MAX_MEMORY_RATIO` of what it did before columns were taken out."""
    of_beside, of_noise = (float(np.median(samples_as_one(n.memory))) for n in (beside, noise))
    return of_beside <= MAX_MEMORY_RATIO * of_noise
