"""Springs that train by two processes, which no law of the package is: what is forecast, and 'stable from'."""

from __future__ import annotations

from types import ModuleType
from typing import Any

import numpy as np
import pytest

from sma_bayes.assess.transformation import NAMES
from sma_bayes.records.types import Branch
from sma_bayes.studies.cycles.laws import N0_GRID, LawPosterior, Series
from sma_bayes.studies.cycles.study import changes, pool, probability_stable, quantities
from sma_bayes.studies.cycles.sweeps import NUMBERS, PRIOR_SD, USUAL_SCATTER, fit_strand, sweeps_of

REPEATS = 12
CYCLES, SEEN = 100, 30
SHARE, PROBABILITY = 0.01, 0.9
CHANNEL = "displacement"


@pytest.fixture(scope="module")
def outcome(training_spring: ModuleType) -> dict[str, Any]:
    """Thirty cycles measured, seventy forecast: whether curves are covered, and claims of stability true."""
    t = np.linspace(20.0, 95.0, 60)
    covered: dict[int, list[float]] = {SEEN: [], SEEN + 9: [], CYCLES - 1: []}
    claims, laws = [], []
    for seed in range(REPEATS):
        rng = np.random.default_rng(seed)
        truth = training_spring.draw_truth(rng, CYCLES)
        seen = training_spring.Truth(truth.state, {b: v[:SEEN] for b, v in truth.sweep.items()})
        strands = []
        for record in training_spring.measured(seen, rng):
            sweeps, cycle, _ = sweeps_of(record, CHANNEL)
            strands.append(fit_strand(sweeps, CHANNEL, cycle, "modified_sigmoid", 0))
        pooled = pool(strands, CYCLES - SEEN, seed, 1000)
        laws.append(pooled.posterior.chosen)
        for place, strand in enumerate(strands):
            for k, found in covered.items():
                curve = pooled.sweep(place, k).curve(t)
                low, high = np.quantile(curve, [0.05, 0.95], axis=0)
                true = training_spring.curve(
                    truth.sweep[strand.record.branch][k], t, strand.record.branch, CHANNEL
                )
                found.append(float(np.mean((low <= true) & (true <= high))))
        stable = np.flatnonzero(probability_stable(changes(pooled), SHARE) >= PROBABILITY)
        if stable.size:
            claims.append(bool(true_changes(training_spring, truth)[stable[0] :].max() <= SHARE))
    return {"covered": covered, "claims": claims, "laws": laws}


def true_changes(spring: ModuleType, truth: Any) -> np.ndarray:
    """Greatest change of either curve to the next cycle, over the stroke."""
    t = np.linspace(20.0, 95.0, 60)
    each = [
        np.abs(np.diff(spring.curve(truth.state[b], t, b, CHANNEL), axis=0)).max(axis=1)
        / spring.STROKE[CHANNEL]
        for b in Branch
    ]
    return np.asarray(np.max(each, axis=0))


@pytest.mark.slow
def test_forecasts_cover(outcome: dict[str, Any]) -> None:
    """Mean share of 24 curves that is within 90 % intervals.

    That of one curve scatters by some 0.2 (its points go together), the mean by 0.04. For the next ten cycles 0.8 is
    two and a half of these below 0.9, a false alarm once in 160 runs; the seeds are fixed. Seventy cycles on, where the
    laws are not the truth, the intervals hold less than they say; docs/howto/follow_cycles.md states it, and 0.65 is
    what must hold.
    """
    near, later, far = (np.mean(values) for values in outcome["covered"].values())
    assert near > 0.8
    assert later > 0.8
    assert far > 0.65


@pytest.mark.slow
def test_springs_that_are_called_stable_are(outcome: dict[str, Any]) -> None:
    """Each claim is wrong with a probability of 0.1: more than 4 of 12 once in 230 runs."""
    claims = outcome["claims"]
    assert len(claims) >= 4
    assert sum(not right for right in claims) <= 4
    assert set(outcome["laws"]) <= {"exponential", "stretched", "logarithmic"}


@pytest.mark.slow
def test_springs_that_wander_are_given_no_law() -> None:
    """Sixty springs whose four numbers wander, on heating and cooling alike, over five and seven cycles.

    A law is said of 3 of 120 such springs. At that rate more than 4 of 60 would be once in 57 runs, were the seed not
    fixed; where heating and cooling count as two witnesses it is 20 %, and 4 and fewer are once in 250.
    """
    rng = np.random.default_rng(31)
    found = 0
    for _ in range(60):
        cycle = np.arange(float(rng.choice([5, 7])))
        step = rng.choice([0.03, 0.1, 0.3, 1.0]) * USUAL_SCATTER
        error = 0.05 * step
        walks = np.cumsum(step[:, None] * rng.standard_normal((4, cycle.size)), axis=1)
        series = [
            Series(
                cycle,
                walk + error[i] * rng.standard_normal(cycle.size),
                np.full(cycle.size, error[i] ** 2),
                float(PRIOR_SD[i]),
                float(USUAL_SCATTER[i]),
                NUMBERS[i],
            )
            for i, walk in enumerate(walks)
            for _ in Branch
        ]
        found += LawPosterior(series).chosen != "none"
    assert found <= 4


SPRINGS = 16
PLACES = np.array([0.08, 0.17, 0.33, 0.5, 0.67, 0.83])
"""Shares of the stroke that are behind."""


@pytest.mark.slow
def test_stiffness_is_covered_from_start_to_finish(training_spring: ModuleType) -> None:
    """Share of 32 branches whose stiffness in the last of seven cycles is within the 90 % interval, place by place.

    The curve bends more sharply at the start than at the end, as none of the package does, and what the model misses is
    found beside it. Of 32 branches whose intervals were right 23 and fewer would be within once in 300 times, so at any
    of the six places at most once in 50; the seeds are fixed and decided nothing.
    """
    within = []
    for seed in range(300, 300 + SPRINGS):
        rng = np.random.default_rng(seed)
        truth = training_spring.draw_truth(rng, 7)
        strands = []
        for record in training_spring.measured(truth, rng, ("force", "displacement")):
            for channel in ("force", "displacement"):
                sweeps, cycle, _ = sweeps_of(record, channel)
                strands.append(fit_strand(sweeps, channel, cycle, "modified_sigmoid", 0))
        pooled = pool(strands, 1, seed, 1000)
        for branch in Branch:
            numbers, t = truth.sweep[branch][6], np.linspace(10.0, 110.0, 4001)
            force, displacement = (
                training_spring.curve(numbers, t, branch, c) for c in ("force", "displacement")
            )
            behind = (displacement - displacement[0]) / (displacement[-1] - displacement[0])
            at = np.searchsorted(behind, PLACES)
            true = np.gradient(force, t)[at] / np.gradient(displacement, t)[at]
            found = [
                s.draws[:, 6]
                for s in quantities(pooled, t[at].tolist())
                if s.branch == branch.value and s.name == "stiffness"
            ]
            low, high = np.nanquantile(np.array(found), [0.05, 0.95], axis=1)
            within.append((low <= true) & (true <= high))
    assert np.sum(within, axis=0).min() >= 24


@pytest.mark.slow
@pytest.mark.parametrize("ends", [(20.0, 95.0), (38.0, 80.0)], ids=["plateaus", "plateaus cut off"])
def test_numbers_of_sweeps_are_covered(training_spring: ModuleType, ends: tuple[float, float]) -> None:
    """Mean share of the twelve sweeps of 40 branches whose number is within its 90 % interval, alone and pooled.

    The curve is none of the package's. The share of one branch scatters by 0.1 to 0.12, errors of the common curve
    included that its sweeps have in common, and the mean of 40 by 0.018: 0.83 is almost four of these below 0.9, a
    false alarm for one of the eight shares once in 2,000 runs; the seeds are fixed.
    """
    within: dict[tuple[str, str], list[float]] = {}
    for seed in range(500, 520):
        rng = np.random.default_rng(seed)
        truth = training_spring.draw_truth(rng, 12)
        strands = []
        for record in training_spring.measured(truth, rng, ends=ends):
            sweeps, cycle, _ = sweeps_of(record, CHANNEL)
            strands.append(fit_strand(sweeps, CHANNEL, cycle, "modified_sigmoid", 0))
        numbers = {
            s.record.branch.value: training_spring.about_mean(
                truth.sweep[s.record.branch], s.ends, s.record.branch, CHANNEL
            )
            for s in strands
        }
        for q in quantities(pool(strands, 1, seed, 1000), ()):
            if q.name not in NUMBERS:
                continue
            true = numbers[q.branch][q.name]
            low, high = np.quantile(q.draws[:, :12], [0.05, 0.95], axis=0)
            within.setdefault((q.name, "pooled"), []).append(float(np.mean((low <= true) & (true <= high))))
            alone = np.abs(q.own[:12] - true) <= 1.645 * q.own_sd[:12]
            within.setdefault((q.name, "alone"), []).append(float(np.mean(alone)))
    assert len(within) == 8
    shares = {key: float(np.mean(found)) for key, found in within.items()}
    assert min(shares.values()) > 0.83, shares
    assert np.mean(list(shares.values())) < 0.95, shares


@pytest.mark.slow
def test_start_and_finish_are_covered_where_the_curve_has_a_shape_of_its_own(
    training_spring: ModuleType,
) -> None:
    """As to Mf of the skew curve that is nearest to the truth, of 20 branches of twelve cycles, plateaus cut off.

    That curve is fitted to the same readings with a fortieth of the noise. The shares of single branches scatter by up
    to 0.26, as skew and tails have one error for all sweeps of a branch, and the mean of ten by 0.08: 0.65 is three of
    these below 0.9, a false alarm for one of four once in 180 runs; the seeds are fixed.
    """
    within: dict[str, list[float]] = {}
    for seed in range(600, 610):
        truth = training_spring.draw_truth(np.random.default_rng(seed), 12)
        found = []
        for noise in (training_spring.NOISE, training_spring.NOISE / 40.0):
            strands = []
            for record in training_spring.measured(
                truth, np.random.default_rng(seed), noise=noise, ends=(38.0, 80.0)
            ):
                sweeps, cycle, _ = sweeps_of(record, CHANNEL)
                strands.append(fit_strand(sweeps, CHANNEL, cycle, "sinh_arcsinh", 0))
            four = quantities(pool(strands, 1, seed, 1000), ())
            found.append({q.name: q for q in four if q.name in ("As", "Af", "Ms", "Mf")})
        for name, q in found[0].items():
            low, high = np.quantile(q.draws[:, :12], [0.05, 0.95], axis=0)
            true = found[1][name].own[:12]
            within.setdefault(name, []).append(float(np.mean((low <= true) & (true <= high))))
    assert len(within) == 4
    assert min(np.mean(shares) for shares in within.values()) > 0.65


@pytest.mark.slow
def test_a_simulated_hundred(training_spring: ModuleType) -> None:
    """All 100 cycles measured, exponential training: law and its pace, claim of stability, curves of cycles.

    N0 is the next one of its grid, a quarter apart. The claim is true, and comes at most eight cycles late. Points of a
    curve go together: of the 200 curves a mean share of 0.8 within their 90 % intervals is five standard errors (0.02)
    below what is stated.
    """
    rng, cycle, pace = np.random.default_rng(21), np.arange(100.0), 9.0
    state, sweep = {}, {}
    for branch in Branch:
        size = np.array([0.15, -0.12, -7.0, 0.2])
        state[branch] = size * (1.0 - np.exp(-cycle[:, None] / pace))
        sweep[branch] = state[branch] + np.array([0.003, 0.004, 0.15, 0.01]) * rng.standard_normal((100, 4))
    truth = training_spring.Truth(state, sweep)
    strands = []
    for record in training_spring.measured(truth, rng):
        sweeps, number, _ = sweeps_of(record, CHANNEL)
        strands.append(fit_strand(sweeps, CHANNEL, number, "modified_sigmoid", 0))
    pooled = pool(strands, 10, 0, 1000)
    assert pooled.posterior.chosen == "exponential"
    found_pace = N0_GRID[int(pooled.posterior.pace_weights("exponential").argmax())]
    assert abs(np.log(found_pace / pace)) < np.log(N0_GRID[1] / N0_GRID[0])
    true = 1 + int(np.flatnonzero(true_changes(training_spring, truth) > 0.02).max() + 1)
    said = 1 + int(np.flatnonzero(probability_stable(changes(pooled), 0.02) >= PROBABILITY)[0])
    assert true <= said <= true + 8
    t, covered = np.linspace(20.0, 95.0, 60), []
    for place, strand in enumerate(strands):
        branch = strand.record.branch
        for k in range(100):
            found = pooled.sweep(place, k).curve(t)
            low, high = np.quantile(found, [0.05, 0.95], axis=0)
            real = training_spring.curve(sweep[branch][k], t, branch, CHANNEL)
            covered.append(float(np.mean((low <= real) & (real <= high))))
    assert np.mean(covered) > 0.8


@pytest.mark.slow
@pytest.mark.parametrize("turns", [False, True], ids=["one shape", "a shape that changes"])
def test_start_and_finish_are_those_of_the_curve_of_each_sweep(
    training_spring: ModuleType, turns: bool
) -> None:
    """Mean shares of seven sweeps whose start, finish (12 branches each) and displacement half-way (24) are covered.

    By the defaults, truth by tangents to the true curve, which is none of the package's: one shape for all sweeps, or
    one that turns from cycle to cycle by up to 0.8 of the way to its mirror image, most in the first. Sweeps
    of one shape share the error of their common curve, so that the share of one branch scatters by 0.3, and the mean
    of 12 by 0.09: 0.65 is almost three of these below 0.9, a false alarm for one of ten shares once in 40 runs; the
    seeds are fixed.
    """
    within: dict[str, list[float]] = {}
    for seed in range(700, 712):
        rng = np.random.default_rng(seed)
        truth = training_spring.draw_truth(rng, 7)
        turned = 0.8 * (1.0 - np.exp(-np.arange(7.0) / rng.uniform(0.5, 3.0))) * turns
        strands = []
        for record in training_spring.measured(truth, rng, turned=turned):
            sweeps, cycle, _ = sweeps_of(record, CHANNEL)
            strands.append(fit_strand(sweeps, CHANNEL, cycle, "modified_sigmoid", 0))
        at = 55.0
        found = {
            (q.branch, q.name): np.quantile(q.draws[:, :7], [0.05, 0.95], axis=0)
            for q in quantities(pool(strands, 1, seed, 1000), (at,))
        }
        for branch in Branch:
            sweep = truth.sweep[branch]
            true = dict(zip(
                NAMES[branch],
                np.array([
                    training_spring.start_and_finish(n, branch, s) for n, s in zip(sweep, turned, strict=True)
                ]).T,
                strict=True,
            ))  # fmt: skip
            true[CHANNEL] = training_spring.curve(sweep, np.full((7, 1), at), branch, CHANNEL, turned)[:, 0]
            for name, values in true.items():
                low, high = found[branch.value, name]
                within.setdefault(name, []).append(float(np.mean((low <= values) & (values <= high))))
    shares = {name: float(np.mean(found)) for name, found in within.items()}
    assert len(shares) == 5
    assert min(shares.values()) > 0.65, shares
    assert np.mean(list(shares.values())) > 0.8, shares


@pytest.mark.slow
def test_a_cycle_to_come_has_the_shape_that_the_last_ones_have(training_spring: ModuleType) -> None:
    """The ninth cycle of 12 branches whose shape is another one from the fifth cycle on, and stays so.

    Its median curve misses by a root mean square of 0.8 % of the stroke; where the size alone of what later sweeps have
    of their own goes on, it is 1.3 %, and 90 % bands are 4.8 % wide in place of 3.7.
    """
    t, last = np.linspace(22.0, 93.0, 60), 8
    turned = np.where(np.arange(last + 1) < 4, 0.0, 0.8)
    missed, within, width = [], [], []
    for seed in range(40, 46):
        rng = np.random.default_rng(seed)
        whole = training_spring.draw_truth(rng, last + 1, 0.3)
        sweep = {b: 0.3 * v for b, v in whole.sweep.items()}
        seen = training_spring.Truth(whole.state, {b: v[:last] for b, v in sweep.items()})
        strands = []
        for record in training_spring.measured(seen, rng, turned=turned[:last]):
            sweeps, cycle, _ = sweeps_of(record, CHANNEL)
            strands.append(fit_strand(sweeps, CHANNEL, cycle, "modified_sigmoid", 0))
        pooled = pool(strands, 1, seed, 1000)
        for place, strand in enumerate(strands):
            branch = strand.record.branch
            true = training_spring.curve(sweep[branch][last], t, branch, CHANNEL, 0.8)
            low, middle, high = np.quantile(pooled.sweep(place, last).curve(t), [0.05, 0.5, 0.95], axis=0)
            size = training_spring.STROKE[CHANNEL]
            missed.append(np.sqrt(np.mean((middle - true) ** 2)) / size)
            within.append(np.mean((low <= true) & (true <= high)))
            width.append(np.mean(high - low) / size)
    assert np.mean(missed) < 0.01
    assert np.mean(width) < 0.042
    assert np.mean(within) > 0.85
