"""What a sweep is expected to tell, against dense linear algebra, planted scatter and posteriors sampled anew."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sma_bayes import fit_campaign
from sma_bayes.assess.draws import RecordDraws
from sma_bayes.records.types import Branch, Campaign, Record
from sma_bayes.runs.outputs import read_run
from sma_bayes.runs.stored_draws import draws_of
from sma_bayes.studies.cycles.sweeps import USUAL_SCATTER
from sma_bayes.studies.plan.candidates import CandidateExperiment, Setting, default_grid
from sma_bayes.studies.plan.design import Expectations, best_design, even_design, nats_of
from sma_bayes.studies.plan.information import (
    Knowledge,
    PlannedSweep,
    PlanTarget,
    beside_scatter,
    counts,
    mean_step,
    with_memory_of,
)
from sma_bayes.studies.plan.scatter import Deviations, SweepScatter, scatter_of
from sma_bayes.studies.plan.workflow import remarks_on_scatter
from sma_bayes.studies.sensitivity.quantities import QuantityDraws

sys.path.append(str(Path(__file__).resolve().parents[4] / "scripts"))
from measure_plan import refitted

AT = 45.0


def _fitted(record: Record, noise: str, place: Path) -> RecordDraws:
    campaign = Campaign("spring", "spring", "0" * 64, (record,))
    fit_campaign(campaign, place, noise=noise, jobs=1, figures=False)
    run = read_run(place)
    return draws_of(place, run.summary.records[0], run.summary.seed)


@pytest.fixture(scope="module")
def remembering(make_record: Callable[..., Record], tmp_path_factory: pytest.TempPathFactory) -> RecordDraws:
    record = make_record(n=80, memory=0.6, noise=0.02)
    return _fitted(record, "ar1", tmp_path_factory.mktemp("plan") / "ar1")


@pytest.fixture(scope="module")
def plain(make_record: Callable[..., Record], tmp_path_factory: pytest.TempPathFactory) -> RecordDraws:
    return _fitted(make_record(n=60, noise=0.02), "independent", tmp_path_factory.mktemp("plan") / "plain")


def _stiffness(known: Knowledge) -> PlanTarget:
    values = known.draws.curve("stiffness", np.array([AT]))[:, 0]
    quantity = QuantityDraws("stiffness", "curve", "stiffness", "N/m", "", values, AT)
    return PlanTarget(known, (quantity,), known.gradient("stiffness", AT))


def test_information_is_that_of_dense_matrices(remembering: RecordDraws) -> None:
    """J' (R + U W U')^-1 J with R of AR(1) noise written out, and J by differences of the curve itself."""
    scatter = {
        c: SweepScatter(Deviations.of(remembering, c), np.array([0.01, 0.02, 0.4, 0.05]), 4)
        for c in remembering.channels
    }
    known = Knowledge.of(remembering, scatter, 0, size=2)
    sweep = PlannedSweep(30.0, 60.0, 31, 0.1)
    found = known.information(sweep)
    t = np.linspace(30.0, 60.0, 31)
    ratio = sweep.step / mean_step(remembering.record.inputs)
    space, model = remembering.posterior.space, remembering.posterior.model
    lag = np.abs(np.subtract.outer(np.arange(31), np.arange(31)))
    for k, draw in enumerate(known.chosen):
        theta = known.theta[draw]
        size = known.x.shape[1]
        total = np.zeros((size, size))
        for channel in remembering.channels:
            columns = []
            for j in range(known.count):
                ends = []
                for sign in (1.0, -1.0):
                    z = space.unconstrain(theta)
                    z[j] += sign * 1e-5 * known.sd[j]
                    moved = space.constrain(z)[: len(model.parameter_names)]
                    ends.append(model.predict(moved, {"temperature": t})[channel])
                columns.append((ends[0] - ends[1]) / 2e-5)
            j = np.zeros((31, size))
            j[:, : known.count] = np.stack(columns, axis=1)
            start = known.count
            for other in known.missing:
                basis = remembering.posterior.discrepancy[0][other]
                if other == channel:
                    j[:, start : start + basis.count] = basis.at(t) * known.sd[start : start + basis.count]
                start += basis.count
            sd, phi = (theta[i] for i in remembering.posterior.layout[0].noise[channel])
            u = scatter[channel].rows(t)
            covariance = sd**2 * (np.sign(phi) * abs(phi) ** ratio) ** lag + u.T @ u
            total += j.T @ np.linalg.solve(covariance, j)
        expected = known.root.T @ total @ known.root
        np.testing.assert_allclose(found[k], expected, rtol=2e-4, atol=2e-4 * np.abs(expected).max())


def test_expected_variance_is_that_of_joined_normals(plain: RecordDraws) -> None:
    known = Knowledge.of(plain, scatter_of(plain, "none"), 0, size=3)
    target = _stiffness(known)
    information = known.information(PlannedSweep(30.0, 70.0, 40, 0.1))
    gain = target.expected(information, 3.0)
    covariance = np.cov(known.x.T, bias=True)
    left = []
    for k in range(3):
        back = np.linalg.inv(known.root)  # information in the coordinates themselves
        own = np.diag(1 / known.sd) @ (back.T @ information[k] @ back) @ np.diag(1 / known.sd)
        g = target.gradients[k, 0] / known.sd
        after = np.linalg.inv(np.linalg.inv(covariance) + 3.0 * own)
        left.append((g @ after @ g) / (g @ covariance @ g))
    assert gain.left[0] == pytest.approx(np.mean(left), rel=1e-6)
    assert gain.nats == pytest.approx(np.mean(-0.5 * np.log(left)), rel=1e-6)
    # about the draws the quantity varies as its gradient says
    spread = np.einsum(
        "kd,de,ke->k", target.gradients[:, 0] / known.sd, covariance, target.gradients[:, 0] / known.sd
    )
    assert np.sqrt(np.mean(spread)) == pytest.approx(target.sd[0], rel=0.15)


def test_the_variance_that_is_left_is_that_of_posteriors_sampled_anew(plain: RecordDraws) -> None:
    """Mean over 8 simulated experiments; it scatters by 2 %, so that 10 % off is a false alarm of 1 in 10^6."""
    known = Knowledge.of(plain, scatter_of(plain, "none"), 0)
    sweep = PlannedSweep(plain.coldest, plain.hottest, plain.record.n, 0.05)
    target = _stiffness(known)
    expected = target.expected(known.information(sweep), 2.0).left[0]
    found = [refitted(known, [(sweep, 2)], "stiffness", AT, 80 * i, i) for i in range(8)]
    assert all(f.converged for f in found)
    assert np.mean([f.spread**2 for f in found]) / target.sd[0] ** 2 == pytest.approx(expected, rel=0.1)


def test_denser_samples_of_noise_with_a_memory_tell_hardly_more(remembering: RecordDraws) -> None:
    known = Knowledge.of(remembering, scatter_of(remembering, "none"), 0, size=8)
    nats = [
        _stiffness(known).expected(known.information(PlannedSweep(30.0, 70.0, n, 0.05))).nats
        for n in (80, 320, 1280)
    ]
    assert nats[0] < nats[1] < 1.5 * nats[0]
    assert nats[2] < 1.05 * nats[1]


def test_a_memory_at_other_steps_is_one_in_temperature(remembering: RecordDraws) -> None:
    posterior = remembering.posterior
    theta = np.array(remembering.theta[:3])
    at = posterior.layout[0].noise["force"]
    theta[:, at[1]] = (0.5, -0.25, 0.0)
    found = with_memory_of(posterior, theta, 2.0)
    assert found[:, at[1]] == pytest.approx([0.25, -0.0625, 0.0])
    np.testing.assert_array_equal(found[:, at[0]], theta[:, at[0]])


def test_scatter_bounds_what_many_samples_tell() -> None:
    """Of a level read with an offset of sd s from sweep to sweep no sweep tells more than 1/s**2."""
    n, sd, offset = 10_000, 0.3, 0.5
    row = np.ones((1, n)) / sd
    gram = np.concatenate([row, offset * row]) @ np.concatenate([row, offset * row]).T
    assert beside_scatter(gram, 1)[0, 0] == pytest.approx(1.0 / (offset**2 + sd**2 / n))


def test_planted_scatter_is_found_and_none_where_there_is_none(
    make_record: Callable[..., Record], tmp_path: Path
) -> None:
    base = make_record(("force",), n=480, segments=12, noise=0.005)
    n = base.n // 12
    t = np.tile(np.linspace(30.0, 70.0, n), 12)
    inputs = {**base.inputs, "temperature": t, "segment": np.repeat(np.arange(12.0), n)}
    rng = np.random.default_rng(3)
    noise = 0.0125 * rng.standard_normal(base.n)
    shift = np.repeat(0.8 * rng.standard_normal(12), n)
    offset = np.repeat(0.05 * rng.standard_normal(12), n)
    for name, moved, up in (("alike", 0.0, 0.0), ("apart", shift, offset)):
        force = 0.5 + 2.5 / (1.0 + np.exp(-0.35 * (t - 52.0 - moved))) + up + noise
        record = replace(base, inputs=inputs, observed={"force": force})
        draws = _fitted(record, "independent", tmp_path / name)
        found = scatter_of(draws, "usual")["force"]
        assert found.sweeps == 12
        told = found.told()
        if name == "apart":
            assert told["shift"] == pytest.approx(np.std(shift), rel=0.35)
            assert told["offset"] == pytest.approx(np.std(offset), rel=0.35)
        else:
            assert told["shift"] < 0.15
            assert told["offset"] < 0.01
    one = replace(base, inputs={**inputs, "segment": np.zeros(base.n)}, observed={"force": force})
    alone = replace(draws, posterior=draws.posterior.on([one]), weights={})
    assert scatter_of(alone, "none")["force"].sd.max() == 0.0
    np.testing.assert_array_equal(scatter_of(alone, "usual")["force"].sd, USUAL_SCATTER)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_beside_two_sweeps_that_agree_a_third_leaves_two_thirds(
    make_record: Callable[..., Record], tmp_path: Path, seed: int
) -> None:
    """Two sweeps that agree to 0.02 K were said to scatter by 0.4 K, and a third to leave 0.97 of a variance."""
    base = make_record(("force",), n=160, segments=2, noise=0.005)
    t = np.tile(np.linspace(30.0, 70.0, 80), 2)
    inputs = {**base.inputs, "temperature": t, "segment": np.repeat([0.0, 1.0], 80)}
    noise = 0.0125 * np.random.default_rng(seed).standard_normal(base.n)
    force = 0.5 + 2.5 / (1.0 + np.exp(-0.35 * (t - 52.0))) + noise
    draws = _fitted(replace(base, inputs=inputs, observed={"force": force}), "independent", tmp_path / "two")
    known = Knowledge.of(draws, scatter_of(draws, "none"), 0, size=200)
    values = draws.curve("force", np.array([50.0]))[:, 0]
    asked = QuantityDraws("force", "curve", "force", "N", "", values, 50.0)
    target = PlanTarget(known, (asked,), known.gradient("force", 50.0))
    assert 0.6 < target.expected(known.information(PlannedSweep(30.0, 70.0, 80, 0.1))).left[0] < 0.85


def test_of_sweeps_that_differ_one_more_is_one_more_of_so_many(
    make_record: Callable[..., Record], plain: RecordDraws, tmp_path: Path
) -> None:
    """The mean curve is known as five sweeps make it, so that a sixth leaves 5/6 of its variance.

    Somewhat less where its discrepancy is a part of that, of which each reading tells: 0.68 to 0.80 here. Functions
    other than those of the fit for what the sixth has of its own left 0.33 to 0.71.
    """
    sweeps = 5
    base = make_record(("force",), n=40 * sweeps, segments=sweeps, noise=0.005)
    t = np.tile(np.linspace(30.0, 70.0, 40), sweeps)
    inputs = {**base.inputs, "temperature": t, "segment": np.repeat(np.arange(float(sweeps)), 40)}
    rng = np.random.default_rng(3)
    offset, stroke, shift = (np.repeat(x, 40) for x in rng.standard_normal((3, sweeps)))
    risen = np.tanh(0.17 * (t - 52.0 - 0.8 * shift)) + 0.1 * np.tanh(0.4 * (t - 44.0))
    force = 2.0 + 0.05 * offset + (1.1 + 0.05 * stroke) * risen + 0.0125 * rng.standard_normal(base.n)
    draws = _fitted(
        replace(base, inputs=inputs, observed={"force": force}), "independent", tmp_path / "apart"
    )
    scatter = scatter_of(draws, "none")
    assert scatter["force"].functions is not None
    (told,) = remarks_on_scatter([draws, draws])
    assert told.count(draws.key) == 1
    assert not remarks_on_scatter([plain])
    known = Knowledge.of(draws, scatter, 0, size=200)
    sweep = known.information(PlannedSweep(30.0, 70.0, 40, 0.1))
    for at in (35.0, 50.0, 52.0, 65.0):
        values = draws.curve("force", np.array([at]))[:, 0]
        asked = QuantityDraws("force", "curve", "force", "N", "", values, at)
        left = PlanTarget(known, (asked,), known.gradient("force", at)).expected(sweep).left
        assert 0.65 < left[0] < 0.9


def test_only_sweeps_that_begin_where_measured_ones_did_count(make_record: Callable[..., Record]) -> None:
    heating = make_record(n=20)
    cooling = replace(heating, branch=Branch.COOLING)
    assert counts(30.5, heating)
    assert counts(20.0, heating)
    assert not counts(33.0, heating)
    assert counts(70.0, cooling)
    assert not counts(60.0, cooling)


def test_a_design_fills_its_hours_and_beats_whole_loops(plain: RecordDraws) -> None:
    """Of a record of heating alone, what lies above the asked temperature is best left out."""
    known = Knowledge.of(plain, scatter_of(plain, "none"), 0)
    expectations = Expectations((_stiffness(known),))
    setting = Setting.of([plain.record])
    grid = default_grid([setting], AT, 0.1, 0.02)
    parts = best_design(expectations, grid, 8.0)
    used = sum(c.setup + n * c.cycle_hours for c, n in parts)
    assert 8.0 - min(c.cycle_hours for c in grid) < used <= 8.0
    whole = CandidateExperiment("c", 30.0, 70.0, 0.02, None, 1, max(c.samples for c in grid), 0.1)
    cycles = (8.0 - 0.1) / whole.cycle_hours
    advised, even = (nats_of(expectations.of_design(p)) for p in (parts, [(whole, cycles)]))
    assert advised > even
    # no single setting that fills the hours does better
    best = max(nats_of(expectations.of_design([(c, np.floor((8.0 - 0.1) / c.cycle_hours))])) for c in grid)
    assert advised >= 0.99 * best


@pytest.mark.parametrize("hours", [12.0, 15.5, 19.0, 24.0])
def test_no_single_cycle_is_better_spent_elsewhere(plain: RecordDraws, hours: float) -> None:
    """Three springs alike: an even division in whole cycles is not better, nor is any exchange."""
    targets, settings = [], []
    for name in "abc":
        record = replace(plain.record, condition=replace(plain.condition, id=name))
        own = replace(plain, posterior=plain.posterior.on([record]))
        targets.append(_stiffness(Knowledge.of(own, scatter_of(own, "none"), 0)))
        settings.append(Setting.of([record]))
    expectations = Expectations(tuple(targets))
    grid = default_grid(settings, AT, 0.1, 0.02)
    parts = best_design(expectations, grid, hours)
    nats = nats_of(expectations.of_design(parts))
    assert nats >= nats_of(expectations.of_design(even_design(settings, grid, hours, 0.1, 0.02)))
    assert sum(c.setup + n * c.cycle_hours for c, n in parts) <= hours
    left = hours - sum(c.setup + n * c.cycle_hours for c, n in parts)
    for i, (given, n) in enumerate(parts):
        for j, (taken, _) in enumerate(parts):
            if i != j and n > 1 and taken.cycle_hours <= left + given.cycle_hours:
                tried = [(c, m + (k == j) - (k == i)) for k, (c, m) in enumerate(parts)]
                assert nats_of(expectations.of_design(tried)) <= nats * (1.0 + 1e-9)
