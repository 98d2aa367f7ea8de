"""The noise of a study against dense matrices: restricted likelihood, whitening, and what was planted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize_scalar
from scipy.signal import lfilter
from scipy.special import logsumexp

from sma_bayes.arrays import Floats
from sma_bayes.noise.ar1 import memory_log_scale
from sma_bayes.parameters.priors_file import read_priors
from sma_bayes.records.history import History, histories
from sma_bayes.records.types import Condition
from sma_bayes.studies.gap import memory_likelihood as module
from sma_bayes.studies.gap.hypothesis import baseline
from sma_bayes.studies.gap.innovations import DEGREES_OF_FREEDOM, growth, heavy_tails
from sma_bayes.studies.gap.noise import CORRELATION_GRID, BlockNoise, ChannelBlock, blocks_of, whiten
from sma_bayes.studies.gap.noise_columns import (
    curve_changes,
    curve_columns,
    cycle_columns,
    recorded_columns,
    smooth_columns,
)
from sma_bayes.studies.gap.noise_estimate import block_noise
from sma_bayes.studies.gap.splines import bspline_basis

GRID = float(np.max(np.diff(np.arctanh(CORRELATION_GRID))))
"""Coarsest step of the memories that are tried, in the coordinate in which they are about equally likely."""


@pytest.fixture(scope="module")
def history(rig) -> History:
    """Three cycles, six sweeps of forty samples."""
    return histories(rig(periods=(60.0,), loads=(1.0,)).campaign())[0]


@pytest.fixture(scope="module")
def smooth(history: History) -> Floats:
    return smooth_columns(history, history.inputs["temperature"])


def correlation(phi: float, clock: Floats, segment: Floats) -> Floats:
    """Dense correlation of noise that forgets with each sweep."""
    apart = np.abs(clock[:, None] - clock)
    whole = np.sign(phi) ** apart * np.abs(phi) ** apart if phi < 0 else phi**apart
    return np.where(segment[:, None] == segment, whole, 0.0)


def restricted(e: Floats, x: Floats, r: Floats) -> tuple[float, float]:
    """Restricted log likelihood of a correlation matrix, its variance profiled out, and that variance's root.

    Harville (1974): the likelihood of contrasts of `e` that are free of the columns `x`.
    """
    inverse = np.linalg.inv(r)
    gram = x.T @ inverse @ x
    p = inverse - inverse @ x @ np.linalg.solve(gram, x.T @ inverse)
    free = e.size - x.shape[1]
    variance = float(e @ p @ e) / free
    value = -0.5 * (free * np.log(variance) + np.linalg.slogdet(r)[1] + np.linalg.slogdet(gram)[1])
    return float(value), float(np.sqrt(variance))


def block_of(history: History, dt: Floats) -> ChannelBlock:
    first = np.diff(history.inputs["segment"], prepend=-1.0) != 0
    return ChannelBlock(0, "displacement", slice(0, history.n), first, dt)


@pytest.mark.parametrize("planted", [-0.3, 0.0, 0.5, 0.9])
def test_it_maximises_the_restricted_likelihood(planted: float, history: History, smooth: Floats) -> None:
    segment, clock = history.inputs["segment"], history.inputs["order"]
    rng = np.random.default_rng([8, int(10 * planted + 10)])
    e = 0.2 * np.linalg.cholesky(correlation(planted, clock, segment)) @ rng.standard_normal(history.n)
    found = block_noise(e, block_of(history, np.ones(history.n)), smooth)
    follows = found.memory != 0.0
    phi = float(np.median(found.memory[follows])) if follows.any() else 0.0

    def loss(u: float) -> float:
        return -restricted(e, smooth, correlation(float(np.tanh(u)), clock, segment))[0]

    best = minimize_scalar(loss, bounds=(np.arctanh(-0.6), 2.6), method="bounded")
    value, sd = restricted(e, smooth, correlation(phi, clock, segment))
    # half a step of the grid away from the maximum, whose curvature is at most that of n independent pairs
    assert value >= -best.fun - 0.5 * history.n * (GRID / 2.0) ** 2
    assert abs(np.arctanh(phi) - best.x) <= GRID
    assert found.sd == pytest.approx(sd, rel=1e-4)


def test_probabilities_of_memories_are_those_of_the_restricted_likelihood(
    history: History, smooth: Floats
) -> None:
    segment, clock = history.inputs["segment"], history.inputs["order"]
    rng = np.random.default_rng(21)
    e = 0.2 * np.linalg.cholesky(correlation(0.97, clock, segment)) @ rng.standard_normal(history.n)
    found = block_noise(e, block_of(history, np.ones(history.n)), smooth)
    value, sd = np.transpose(
        [restricted(e, smooth, correlation(n.memory.max(), clock, segment)) for _, n in found.others]
    )
    likely = np.exp(value - value.max())
    assert len(found.others) > 3
    np.testing.assert_allclose([p for p, _ in found.others], likely / likely.sum(), rtol=1e-3)
    np.testing.assert_allclose([n.sd for _, n in found.others], sd, rtol=1e-4)


def test_memory_in_time_is_told_from_memory_in_samples(history: History, smooth: Floats) -> None:
    segment = history.inputs["segment"]
    rng = np.random.default_rng(3)
    dt = rng.choice([0.2, 1.0, 5.0], history.n)
    clock = np.cumsum(dt)
    block = block_of(history, dt / np.median(dt))
    draw = rng.standard_normal(history.n)
    for by in (clock, history.inputs["order"]):
        e = np.linalg.cholesky(correlation(0.8, by, segment)) @ draw
        found = block_noise(e, block, smooth)
        follows = ~block.first
        short, long = (np.mean(found.memory[follows & (dt == d)]) for d in (0.2, 5.0))
        if by is clock:
            per_unit = found.memory[follows] ** (1.0 / dt[follows])
            np.testing.assert_allclose(per_unit, per_unit[0], rtol=1e-9)
            assert abs(per_unit[0] - 0.8) < 0.12
        else:
            assert short == long
            assert abs(short - 0.8) < 0.12


@pytest.mark.parametrize(
    ("cycles", "samples", "longest"),
    [(1, 4, 0.71), (1, 40, 0.967), (1, 67, 0.980), (1, 4000, 0.991), (2, 4, 0.846), (5, 4, 0.9355)],
)
def test_chance_remembers_no_longer_than_three_quarters_of_a_record(
    cycles: int, samples: int, longest: float, rig
) -> None:
    """(1 + phi)/(1 - phi) = 1.5 n in one cycle at the bound; 0.99 is the longest memory that is tried at all."""
    campaign = rig(periods=(60.0,), loads=(1.0,), cycles=cycles, samples=samples).campaign()
    hypothesis = baseline(campaign, histories(campaign), read_priors("modified_sigmoid"), pooled=True)
    (block,) = blocks_of(hypothesis)
    assert longest - 0.1 < CORRELATION_GRID[block.possible].max() <= longest
    assert all(
        (1.0 + phi) / (1.0 - phi) > 1.5 * cycles * samples for phi in CORRELATION_GRID[~block.possible]
    )


def test_chance_forgets_where_a_record_is_interrupted() -> None:
    first = np.tile(np.arange(30) == 0, 4)
    block = ChannelBlock(0, "displacement", slice(0, 120), first, np.ones(120), sweep=15.0)
    whole = replace(block, first=np.arange(120) == 0)
    assert np.count_nonzero(block.possible) < np.count_nonzero(whole.possible)
    np.testing.assert_array_equal(block.possible, replace(block, sweep=0.0).possible)


@pytest.mark.parametrize(("phi", "seems_longer"), [(0.5, False), (0.999, True)])
def test_chance_remembers_as_long_as_noise_seems_to(
    phi: float, seems_longer: bool, history: History, smooth: Floats
) -> None:
    segment, clock = history.inputs["segment"], history.inputs["order"]
    rng = np.random.default_rng(5)
    e = np.linalg.cholesky(correlation(phi, clock, segment)) @ rng.standard_normal(history.n)
    block = replace(block_of(history, np.ones(history.n)), sweep=10.0)  # interrupted after every sweep of 40
    found, free = block_noise(e, block, smooth), block_noise(e, replace(block, sweep=np.inf), smooth)
    longest = CORRELATION_GRID[block.possible].max()
    seems = found.memory.max()
    assert (seems > longest) == seems_longer
    np.testing.assert_array_equal(found.memory, free.memory)
    assert max(n.memory.max() for _, n in found.others) <= max(longest, seems)
    assert sum(p for p, _ in found.others) == pytest.approx(1.0)
    assert max(n.memory.max() for _, n in free.others) >= seems


def test_what_was_planted_is_recovered_without_bias(history: History, smooth: Floats) -> None:
    """Means over 40 series; standard errors are 0.008 and 1.2 %, half a step of the grid 0.025 of the memory."""
    planted, sd = 0.7, 0.05
    root = np.linalg.cholesky(correlation(planted, history.inputs["order"], history.inputs["segment"]))
    block = block_of(history, np.ones(history.n))
    rng = np.random.default_rng(11)
    found = [block_noise(sd * root @ rng.standard_normal(history.n), block, smooth) for _ in range(40)]
    assert abs(np.mean([np.median(f.memory[~block.first]) for f in found]) - planted) < 0.04
    assert abs(np.mean([f.sd for f in found]) / sd - 1.0) < 0.05


def test_wild_readings_do_not_widen_the_noise_of_all_others(history: History, smooth: Floats) -> None:
    """Every tenth innovation is eight times as wide; of normal ones, and of a single jump, none has an excess."""
    block = block_of(history, np.ones(history.n))
    rng = np.random.default_rng(14)
    root = np.linalg.cholesky(correlation(0.7, history.inputs["order"], history.inputs["segment"]))
    normal = rng.standard_normal(history.n)
    wild = np.arange(history.n) % 10 == 5
    heavy = block_noise(root @ np.where(wild, 8.0 * normal, normal), block, smooth)
    plain = block_noise(root @ normal, block, smooth)
    assert np.ndim(plain.excess) == 0
    assert np.ndim(heavy.excess) == 1
    left_out = np.abs(heavy.whiten(np.asarray(heavy.excess)))
    assert np.median(left_out[wild]) > 2.0 * np.median(left_out[~wild])
    assert heavy.sd < 1.5 * plain.sd
    whitened = heavy.whiten_residual(root @ np.where(wild, 8.0 * normal, normal))
    assert np.max(np.abs(whitened)) < 6.0
    jump = root @ np.where(np.arange(history.n) == 40, 30.0, normal)
    assert np.ndim(block_noise(jump, block, smooth).excess) == 0


def test_readings_that_repeat_have_no_heavy_tails(history: History, smooth: Floats) -> None:
    """Noise of a tenth of the step of a digitiser: readings stand still, and jump by a step now and then."""
    block = block_of(history, np.ones(history.n))
    rng = np.random.default_rng(15)
    slow = np.cumsum(0.05 * rng.standard_normal(history.n))
    rounded = np.round(slow + 0.02 * rng.standard_normal(history.n), 0)
    assert np.ndim(block_noise(rounded, block, smooth, lattice=1.0).excess) == 0
    innovations = np.concatenate([np.zeros(90), np.ones(10)])
    assert heavy_tails(innovations) is None


@pytest.mark.parametrize("degrees", [2.0, 5.0])
def test_scales_are_those_of_student_t(degrees: float) -> None:
    """A normal variable of that scale, with the scale drawn as t has it, is at its most likely there."""
    u = np.random.default_rng(16).standard_t(degrees, 4000)
    heavy = heavy_tails(u)
    assert heavy is not None
    scale = heavy.scale
    far = np.abs(u) > 20.0
    for nu in DEGREES_OF_FREEDOM:
        width = np.abs(u[~far]) / np.sqrt(np.maximum(scale[~far] ** 2 * (nu + 1.0) - nu, 1e-12))
        if np.ptp(np.quantile(width[np.abs(u[~far]) > 0.5], [0.1, 0.9])) < 1e-6:
            break
    else:
        pytest.fail("no degrees of freedom explain the scales")
    assert 0.5 * degrees <= nu <= 2.0 * degrees


@pytest.mark.parametrize("inside", [True, False], ids=["taken out before", "not taken out"])
def test_what_is_estimated_beside_heavy_tails_scatters_as_it_says(inside: bool) -> None:
    """One column beside t with 3 degrees of freedom: squares of estimates over their errors have the mean 1.

    Of 400 records with the column among those that noise is estimated beside, and of 400 with one that is not. The mean
    of 400 squares of normal numbers is off by 0.18 once in a hundred, by 0.2 once in two hundred.
    """
    n = 800
    block = ChannelBlock(0, "force", slice(0, n), np.arange(n) % 100 == 0, np.ones(n), 100.0)
    smooth = bspline_basis(np.tile(np.linspace(0.0, 1.0, 100), n // 100), 8)
    rng = np.random.default_rng(31)
    column = smooth[:, 3] if inside else np.sign(rng.standard_normal(n))
    squares, spread = [], []
    for _ in range(400):
        e = rng.standard_t(3, n)
        noise = block_noise(e, block, smooth)
        if np.ndim(noise.excess) == 0:  # sizes remember by chance, once or twice in a thousand
            continue
        w, c = noise.whiten_residual(e), noise.whiten(column)
        squares.append((c @ w) ** 2 / (c @ c))
        spread.append(np.mean(w**2))
    assert len(squares) >= 395
    assert np.mean(squares) == pytest.approx(1.0, abs=0.2)
    assert np.mean(spread) == pytest.approx(1.0, abs=0.05)


def test_a_misfit_that_passes_for_heavy_tails_stays_in_the_readings() -> None:
    """A hum in a sixteenth of the readings: an effect that explains it must find it there."""
    n = 800
    block = ChannelBlock(0, "force", slice(0, n), np.arange(n) % 100 == 0, np.ones(n), 100.0)
    smooth = bspline_basis(np.tile(np.linspace(0.0, 1.0, 100), n // 100), 8)
    e = np.random.default_rng(33).standard_normal(n)
    hum = np.where(np.arange(n) < n // 16, 12.0 * np.sin(0.7 * np.arange(n)), 0.0)
    noise = block_noise(e + hum, block, smooth)
    assert np.ndim(noise.scale) == 1
    assert np.ndim(noise.excess) == 0


def test_the_excess_of_heavy_tails_is_uncorrelated_with_what_counts(history: History, smooth: Floats) -> None:
    """So the variances of both add up to that of the noise, which simulated readings need."""
    block = block_of(history, np.ones(history.n))
    rng = np.random.default_rng(32)
    both, whole = 0.0, 0.0
    for _ in range(100):
        e = rng.standard_t(5, history.n)
        excess = block_noise(e, block, smooth).excess
        both += np.mean((e - excess) ** 2) + np.mean(np.square(excess))
        whole += np.mean(e**2)
    assert both == pytest.approx(whole, rel=0.05)


def test_a_misfit_that_repeats_does_not_pass_for_noise(history: History, smooth: Floats) -> None:
    block = block_of(history, np.ones(history.n))
    rng = np.random.default_rng(12)
    e = rng.standard_normal(history.n)
    plain = block_noise(e, block, smooth)
    bent = block_noise(e + smooth @ rng.normal(0.0, 20.0, smooth.shape[1]), block, smooth)
    np.testing.assert_array_equal(bent.memory, plain.memory)
    assert bent.sd == pytest.approx(plain.sd, rel=1e-4)
    bump = np.exp(-0.5 * ((history.inputs["temperature"] - 60.0) / 12.0) ** 2)
    there = block_noise(e + 10.0 * bump * (history.inputs["branch"] > 0.0), block, smooth)
    assert abs(np.median(there.memory) - np.median(plain.memory)) < 0.15
    assert there.sd == pytest.approx(plain.sd, rel=0.15)


def test_what_follows_something_recorded_does_not_pass_for_memory(history: History, smooth: Floats) -> None:
    """A load cell that follows the room: three times as much as white noise, and as slow."""
    time = history.inputs["time"]
    room = 22.0 + np.sin(2.0 * np.pi * 1.4 * time / np.ptp(time))
    series = 4.0 * (room - 22.0) + np.random.default_rng(4).standard_normal(time.size)
    block = block_of(history, np.ones(time.size))
    more = recorded_columns({**history.inputs, "ambient_temperature": room}, smooth)
    assert np.median(block_noise(series, block, smooth).memory) > 0.5
    found = block_noise(series, block, smooth, recorded=more)
    assert abs(float(np.median(found.memory))) < 0.3
    assert found.sd == pytest.approx(1.0, abs=0.2)  # three standard errors


def test_recorded_columns_are_orthonormal_and_new(history: History, smooth: Floats) -> None:
    more = recorded_columns(history.inputs, smooth)
    assert more.shape[1] > 4
    np.testing.assert_allclose(more.T @ more, np.eye(more.shape[1]), atol=1e-9)
    np.testing.assert_allclose(smooth.T @ more, 0.0, atol=1e-9)


def cycled(cycles: int, samples: int) -> tuple[History, Floats, Floats]:
    """Cycles with so many samples a sweep, a sigmoid on them, and its slope."""
    up = np.linspace(25.0, 95.0, samples)
    temperature = np.tile([*up, *up[::-1]], cycles)
    branch = np.tile(np.repeat([1.0, -1.0], samples), cycles)
    at = np.arange(temperature.size, dtype=float)
    inputs = {
        "temperature": temperature, "branch": branch, "cycle": np.floor(at / (2.0 * samples)),
        "segment": np.floor(at / samples), "time": at, "order": at,
    }  # fmt: skip
    curve = 100.0 / (1.0 + np.exp(-0.2 * (temperature - np.where(branch > 0.0, 65.0, 50.0))))
    slope = 0.2 * curve * (1.0 - curve / 100.0)
    return History(Condition("c"), inputs, {"displacement": curve}, at.astype(int), {}), curve, slope


def without_a_break(history: History) -> ChannelBlock:
    """A block that remembers from sweep to sweep."""
    first = np.zeros(history.n, dtype=bool)
    first[0] = True
    return ChannelBlock(0, "displacement", slice(0, history.n), first, np.ones(history.n))


def remembering(phi: float, n: int, count: int, rng: np.random.Generator) -> Floats:
    """Series (count, n) of unit variance."""
    at = np.arange(n, dtype=float)
    root = np.linalg.cholesky(correlation(phi, at, np.zeros(n)))
    return (root @ rng.standard_normal((n, count))).T


@pytest.mark.parametrize("samples", [15, 100])
def test_what_changes_the_curve_with_the_cycle_does_not_pass_for_memory(samples: int) -> None:
    """A stroke and a place that settle, to 30 times as much as white noise: without changes a memory of 0.9 and more.

    In 150 samples as in 1,000: a short record has fewer of them than of columns that could be taken out for good.
    """
    history, curve, slope = cycled(5, samples)
    trained = 1.0 - np.exp(-history.inputs["cycle"] / 1.5)
    series = trained * (0.3 * curve + 4.0 * slope) + np.random.default_rng(8).standard_normal(history.n)
    smooth = smooth_columns(history, history.inputs["temperature"])
    recorded = recorded_columns(history.inputs, smooth)
    block = without_a_break(history)
    assert np.median(block_noise(series, block, smooth, recorded=recorded).memory) > 0.9
    beside = np.concatenate([smooth, recorded], axis=1)
    found = block_noise(
        series,
        block,
        smooth,
        recorded=recorded,
        changed=lambda: curve_columns(history.inputs, (curve, slope), beside),
        changes=lambda: curve_changes(history.inputs, curve, slope),
    )
    assert (curve_columns(history.inputs, (curve, slope), beside).shape[1] > 0) == (samples == 100)
    error = 1.0 / np.sqrt(history.n)
    assert abs(float(np.median(found.memory))) < 3.0 * error + GRID
    assert found.sd == pytest.approx(1.0, abs=3.0 * error)


def test_what_a_record_has_of_its_own_does_not_pass_for_memory() -> None:
    """Another stroke, place and width than the common curve, as in the force of the demo's third load.

    Twenty series of two sweeps of 68 samples with a memory of 0.6. The mean beside few splines alone is beyond 0.9; the
    standard error of the mean beside the changes is 0.05, as beside them a memory is known by 0.2.
    """
    history, curve, slope = cycled(1, 68)
    smooth = smooth_columns(history, history.inputs["temperature"])
    block = without_a_break(history)
    temperature, heating = history.inputs["temperature"], history.inputs["branch"] > 0.0
    wider = slope * (temperature - np.where(heating, 65.0, 50.0))
    own = np.where(heating, 0.1 * curve + 1.5 * slope, -0.1 * curve + slope) + 0.4 * wider
    series = own + remembering(0.6, history.n, 20, np.random.default_rng(18))
    beside = [
        block_noise(x, block, smooth, changes=lambda: curve_changes(history.inputs, curve, slope))
        for x in series
    ]
    alone = [block_noise(x, block, smooth) for x in series]
    assert np.mean([np.median(n.memory) for n in alone]) > 0.9
    assert np.mean([np.median(n.memory) for n in beside]) == pytest.approx(0.6, abs=0.15)


@pytest.mark.parametrize("phi", [0.0, 0.8])
def test_what_one_cycle_alone_has_does_not_pass_for_memory(phi: float) -> None:
    """A bump in the third of five cycles: of ten series the memory is that of the noise, within the grid and chance.

    Chance is 0.03 a series (one standard deviation, 1,000 samples).
    """
    history, curve, slope = cycled(5, 100)
    smooth = smooth_columns(history, history.inputs["temperature"])
    block = without_a_break(history)
    bump = (history.inputs["cycle"] == 3.0) * np.abs(slope) / np.abs(slope).max()
    own = curve_changes(history.inputs, curve, slope)[0]

    def of_cycles(known: Floats) -> list[Floats]:
        courses, free_of = (np.concatenate([x, own], axis=1) for x in (smooth, known))
        return [own, *cycle_columns(history.inputs, courses, free_of)]

    for series in 20.0 * bump + remembering(phi, history.n, 10, np.random.default_rng(21)):
        found = block_noise(series, block, smooth, of_cycles=of_cycles)
        assert np.median(found.memory) == pytest.approx(phi, abs=0.12)
        assert found.sd == pytest.approx(1.0, abs=0.25)
        assert np.median(block_noise(series, block, smooth).memory) > max(phi + 0.05, 0.5)


def test_jumps_do_not_pass_for_memory() -> None:
    """Three slips of six standard deviations within cycles, in noise with a memory of 0.8; ten series."""
    history, _, _ = cycled(5, 100)
    smooth = smooth_columns(history, history.inputs["temperature"])
    block = without_a_break(history)
    order = np.arange(history.n)
    slipped = 6.0 * ((order > 230) + 0.0 + (order > 480)) - 9.0 * (order > 770)
    for series in slipped + remembering(0.8, history.n, 10, np.random.default_rng(22)):
        found = block_noise(series, block, smooth, of_cycles=lambda known: [known[:, :0]])
        assert np.median(found.memory) == pytest.approx(0.8, abs=0.09)
        assert found.sd == pytest.approx(1.0, abs=0.3)
        assert np.median(block_noise(series, block, smooth).memory) > 0.95


@pytest.mark.parametrize("phi", [0.5, 0.8, 0.95, 0.98])
@pytest.mark.parametrize("tails", [False, True], ids=["normal", "heavy tails"])
def test_noise_that_remembers_is_not_taken_for_jumps_or_bad_cycles(phi: float, tails: bool) -> None:
    """Forty series each. Heavy tails have great innovations, which fade where jumps stay."""
    history, _, _ = cycled(5, 100)
    smooth = smooth_columns(history, history.inputs["temperature"])
    block = without_a_break(history)
    rng = np.random.default_rng([23, round(100 * phi), tails])

    def of_cycles(known: Floats) -> list[Floats]:
        return [known[:, :0], *cycle_columns(history.inputs, smooth, known)]

    shorter = 0
    for normal in remembering(phi, history.n, 40, rng):
        series = normal
        if tails:
            e = rng.standard_t(3.0, history.n) / np.sqrt(3.0)
            series = lfilter([np.sqrt(1.0 - phi**2)], [1.0, -phi], e)
        plain, _ = module.likeliest_noise(series, block, smooth)
        found = block_noise(series, block, smooth, of_cycles=of_cycles)
        shorter += bool(np.median(found.memory) < np.median(plain.memory) - 0.1 * (1.0 - phi) - 0.06)
    assert shorter == 0


@pytest.mark.parametrize(
    ("phi", "cycles", "samples"), [(0.95, 5, 100), (0.99, 5, 100), (0.95, 5, 15), (0.9, 1, 68)]
)
def test_noise_that_remembers_is_not_taken_for_changes_with_the_cycle(
    phi: float, cycles: int, samples: int
) -> None:
    """Fifty series each: what a record has of its own is taken out of all, and of a million one may lose more."""
    history, curve, slope = cycled(cycles, samples)
    smooth = smooth_columns(history, history.inputs["temperature"])
    own, *sets = curve_changes(history.inputs, curve, slope)
    assert sets or cycles == 1
    block = without_a_break(history)
    for series in remembering(phi, history.n, 50, np.random.default_rng(9)):
        beside_own = block_noise(series, block, smooth, changes=lambda: [own])
        assert block_noise(series, block, smooth, changes=lambda: [own, *sets]).sd == beside_own.sd


def test_noise_that_remembers_keeps_its_memory_beside_changes_of_the_curve() -> None:
    """Fifty long series with a memory of 0.95; one of a million may be taken for a change of the curve."""
    history, curve, slope = cycled(5, 100)
    smooth = smooth_columns(history, history.inputs["temperature"])
    recorded = recorded_columns(history.inputs, smooth)
    changed = curve_columns(history.inputs, (curve, slope), np.concatenate([smooth, recorded], axis=1))
    block = without_a_break(history)
    for series in remembering(0.95, history.n, 50, np.random.default_rng(9)):
        plain = block_noise(series, block, smooth, recorded=recorded)
        assert block_noise(series, block, smooth, recorded=recorded, changed=lambda: changed).sd == plain.sd


def test_a_long_memory_is_found_without_bias_beside_the_curve() -> None:
    """Means over 40 series of 1,000 samples: the standard error of the mean is 0.0015, the memory is known by 0.01."""
    history, curve, slope = cycled(5, 100)
    smooth = smooth_columns(history, history.inputs["temperature"])
    block = without_a_break(history)
    found = [
        block_noise(x, block, smooth, changes=lambda: curve_changes(history.inputs, curve, slope))
        for x in remembering(0.95, history.n, 40, np.random.default_rng(10))
    ]
    assert np.mean([np.median(f.memory) for f in found]) == pytest.approx(0.95, abs=0.01)


def test_changes_of_the_curve_are_on_either_branch_with_what_was_recorded() -> None:
    history, curve, slope = cycled(5, 15)
    own, cycle, *more = curve_changes(history.inputs, curve, slope)
    assert (own.shape[1], cycle.shape[1], len(more)) == (6, 20, 0)
    heating = history.inputs["branch"] > 0.0
    for columns in (own, cycle):
        assert np.all(np.any(columns[heating] != 0.0, axis=0) != np.any(columns[~heating] != 0.0, axis=0))
    other = {**history.inputs, "rate": np.gradient(history.inputs["temperature"])}
    assert [s.shape[1] for s in curve_changes(other, curve, slope)] == [6, 20, 16, 36]


def test_columns_of_a_known_size_are_part_of_the_covariance(history: History, smooth: Floats) -> None:
    """Evidence and noise beside columns with normal coefficients, against dense matrices."""
    rng = np.random.default_rng(22)
    random = rng.standard_normal((history.n, 5))
    segment, clock = history.inputs["segment"], history.inputs["order"]
    e = rng.standard_normal(history.n) + random @ rng.normal(0.0, 3.0, 5)
    block = block_of(history, np.ones(history.n))
    scales = np.array([memory_log_scale(np.where(block.first, 0.0, phi)).sum() for phi in CORRELATION_GRID])
    values = module._with_random(e, block, smooth, random, scales)
    for size, phi in ((4, 10), (6, 20), (9, 5)):
        plain = correlation(float(CORRELATION_GRID[phi]), clock, segment)
        dense = restricted(e, smooth, plain + module.CHANGE_SD_GRID[size] ** 2 * random @ random.T)[0]
        flat = restricted(e, smooth, plain)[0]
        at_nothing = module._restricted(
            module._products(np.column_stack([smooth, e]), block), scales, history.n
        )[0][phi]
        assert values[size, phi] - at_nothing == pytest.approx(dense - flat, abs=1e-3)
    size = int(np.argmax(logsumexp(values, axis=1)))
    found, _ = module.likeliest_noise(e, block, smooth, 1.0, random * module.CHANGE_SD_GRID[size])
    best = int(np.argmax(values[size]))
    assert float(np.median(found.memory[~block.first])) == CORRELATION_GRID[best]
    covariance = (
        correlation(float(CORRELATION_GRID[best]), clock, segment)
        + module.CHANGE_SD_GRID[size] ** 2 * random @ random.T
    )
    assert found.sd == pytest.approx(restricted(e, smooth, covariance)[1], rel=1e-4)


@pytest.mark.parametrize("phi", [-0.4, 0.0, 0.85])
def test_whitening_whitens(phi: float, history: History) -> None:
    segment, clock = history.inputs["segment"], history.inputs["order"]
    covariance = 0.3**2 * correlation(phi, clock, segment)
    noise = BlockNoise(0.3, np.where(np.diff(segment, prepend=-1.0) != 0, 0.0, phi))
    w = noise.whiten(np.eye(history.n)).T
    np.testing.assert_allclose(w @ covariance @ w.T, np.eye(history.n), atol=1e-10)
    assert noise.log_scale == pytest.approx(0.5 * np.linalg.slogdet(covariance)[1], rel=1e-10)


def test_blocks_stack_history_by_history_and_forget_where_something_was_left_out(make_line) -> None:
    line = make_line(phi=0.6)
    blocks = blocks_of(line.hypothesis)
    assert [(b.history, b.channel) for b in blocks] == [(0, "displacement"), (1, "displacement")]
    assert [b.at.start for b in blocks] == [0, blocks[0].at.stop]
    assert [int(b.first.sum()) for b in blocks] == [1, 1]
    for b in blocks:
        inner = b.dt[~b.first]
        assert np.median(inner) == pytest.approx(1.0)
    rng = np.random.default_rng(0)
    batch = rng.standard_normal((2, line.y.size))
    w = whiten(blocks, line.noise, batch)
    exact = np.linalg.solve(np.linalg.cholesky(line.covariance), batch.T).T
    np.testing.assert_allclose(w, exact, atol=1e-9)


def test_growth_is_that_of_the_size_of_innovations_with_its_error():
    """Of 400 series the mean is right within five of its errors, and the scatter of the means is the stated error."""
    rng = np.random.default_rng(5)
    response = 3.0 + 2.0 / (1.0 + np.exp(-rng.uniform(-6.0, 6.0, 250)))
    share = (response - response.min()) / np.ptp(response)
    for true in (0.0, 1.5, -2.0):
        found = [growth(7.0 * np.exp(true * share) * rng.standard_normal(250), response) for _ in range(400)]
        slopes, error = np.array([f.slope for f in found]), found[0].error
        assert slopes.mean() == pytest.approx(true, abs=5.0 * error / 20.0)
        assert slopes.std() == pytest.approx(error, rel=0.15)
        assert np.mean([f.is_noise for f in found]) == (0.0 if true == 0.0 else pytest.approx(1.0, abs=0.02))
    steep = np.exp(1.0 * share + 6.0 * share * (1.0 - share)) * rng.standard_normal(250)
    assert not growth(steep, response).is_noise
    assert growth(np.ones(4), np.ones(4)).error == np.inf


@pytest.mark.parametrize(("true", "tails"), [(1.2, False), (-1.2, False), (1.2, True), (0.0, False)])
def test_noise_that_grows_gets_a_width_and_even_noise_none(true, tails):
    """A width within a quarter of the true one at both ends, under normal and heavy-tailed innovations."""
    rng = np.random.default_rng(11)
    n = 2000
    response = np.linspace(1.0, 3.0, n)
    width = np.exp(true * (response - 2.0) / 2.0)
    e = rng.standard_t(3.0, n) / np.sqrt(3.0) if tails else rng.standard_normal(n)
    block = ChannelBlock(0, "force", slice(0, n), np.arange(n) == 0, np.ones(n))
    smooth = np.stack([np.ones(n), response], axis=1)
    found = block_noise(0.01 * width * e, block, smooth, response=response)
    if true == 0.0:
        assert np.ndim(found.scale) == 0
        return
    ends = found.sd * np.broadcast_to(found.scale, n)
    for part in (slice(0, n // 5), slice(-n // 5, None)):
        usual = np.median(ends[part]) if not tails else np.median(ends[part] / np.median(ends)) * 0.01
        assert usual == pytest.approx(0.01 * np.median(width[part]), rel=0.25)
    even = np.std(found.whiten(0.01 * width * e)[: n // 3]) / np.std(
        found.whiten(0.01 * width * e)[-n // 3 :]
    )
    assert even == pytest.approx(1.0, abs=0.15)


@pytest.mark.parametrize("grows", [0.0, 1.1], ids=["even", "growing"])
def test_readings_that_are_cut_off_say_nothing_of_the_noise(grows: float) -> None:
    """Half of the readings are at the end of the range: the size of the noise elsewhere is found, within a tenth.

    Chance would move it by 2 % (one standard deviation, 1,000 readings with noise).
    """
    rng = np.random.default_rng(3)
    n = 2000
    response = np.abs(np.linspace(-2.0, 2.0, n))[::-1]  # the upper half of it is out of range
    cut = response > 1.0
    sd = 0.01 * np.exp(grows * response)
    residual = np.where(cut, 0.0, sd * rng.standard_normal(n))
    block = ChannelBlock(0, "force", slice(0, n), np.arange(n) == 0, np.ones(n))
    smooth = np.stack([np.ones(n), response], axis=1)
    found = block_noise(residual, block, smooth, response=response, cut_off=cut)
    own = found.sd * np.broadcast_to(found.scale, n)
    low = response < 0.2
    assert np.median(own[low]) == pytest.approx(np.median(sd[low]), rel=0.1 if grows == 0.0 else 0.25)
    assert np.std(found.whiten(residual)[~cut]) == pytest.approx(1.0, abs=0.1)
    counted = block_noise(residual, block, smooth, response=response)
    assert np.std(counted.whiten(residual)[~cut]) != pytest.approx(1.0, abs=0.1)
