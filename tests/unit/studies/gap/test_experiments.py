"""Which experiment would tell effects apart: against least squares on dense matrices, and where the answer is plain."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import block_diag

from sma_bayes.arrays import Floats
from sma_bayes.effects import EFFECTS
from sma_bayes.parameters.priors_file import read_priors
from sma_bayes.records.history import histories, sweep_rate
from sma_bayes.studies.gap import experiments
from sma_bayes.studies.gap.experiments import (
    DESIGNS,
    ENOUGH_SEPARATION,
    ExperimentDesign,
    ProposedExperiment,
    next_experiment,
)
from sma_bayes.studies.gap.fitting import FittedHypothesis, fit_hypothesis, fit_with_noise
from sma_bayes.studies.gap.hypothesis import baseline

Inputs = Mapping[str, Floats]
LOAD = 1.5
SIZE = 2.5
BY_TITLE = {d.title: d for d in DESIGNS}
TWICE_THE_LOAD = BY_TITLE["repeat with twice the load"]
THIRD_OF_THE_RATE = BY_TITLE["sweep at a third of the rate"]


def cubic(v: Inputs) -> Floats:
    return ((v["temperature"] - 60.0) / 35.0) ** 3


def with_load(v: Inputs) -> Floats:
    return v["load"] * cubic(v) / LOAD


def with_rate(v: Inputs) -> Floats:
    return v["rate"] / 5.0


@pytest.fixture(scope="module")
def rivals(make_line, added) -> Callable[..., list[FittedHypothesis]]:
    """A parabola with one of several columns added, each fitted to what the first of them makes; one load for all."""

    def make(*columns: Callable[[Inputs], Floats], phi: float = 0.4) -> list[FittedHypothesis]:
        line = make_line(prior_sd=(1e4, 1e4, 1e4), phi=phi)
        seen = []
        for h in line.hypothesis.histories:
            inputs = {**h.inputs, "load": np.full(h.n, LOAD)}
            seen.append(replace(h, inputs=inputs, observed={"displacement": SIZE * columns[0](inputs)}))
        plain = replace(line.hypothesis, histories=tuple(seen))
        extended = [plain.extended(added(f"effect {i}", c, sd=1e4)) for i, c in enumerate(columns)]
        return [fit_hypothesis(h, h.space.prior_centre(), line.noise) for h in extended]

    return make


@pytest.fixture
def separation(
    monkeypatch: pytest.MonkeyPatch,
) -> Callable[[Sequence[FittedHypothesis], ExperimentDesign], float]:
    """That of the first from the others, by one design."""

    def of(fitted: Sequence[FittedHypothesis], design: ExperimentDesign) -> float:
        monkeypatch.setattr(experiments, "DESIGNS", (design,))
        proposal = next_experiment(fitted)
        monkeypatch.undo()
        assert proposal is not None
        return proposal.separation

    return of


@pytest.mark.parametrize(
    ("design", "changed"),
    [
        (TWICE_THE_LOAD, lambda v: {**v, "load": 2.0 * v["load"]}),
        (THIRD_OF_THE_RATE, lambda v: {**v, "rate": v["rate"] / 3.0}),
    ],
)
def test_the_separation_is_what_least_squares_leaves(
    design, changed, rivals, separation, covariance_of
) -> None:
    """Of what the first effect predicts, by a parabola and the second effect, on old and further samples."""
    first, second = fitted = rivals(with_rate, with_load)
    old = [h.inputs for h in first.hypothesis.histories]
    inputs = [*old, *map(changed, old)]
    t, y = (np.concatenate([f(v) for v in inputs]) for f in (lambda v: v["temperature"], with_rate))
    x = np.stack([np.ones_like(t), t, t**2, np.concatenate([with_load(v) for v in inputs])], axis=1)
    once = covariance_of(second.noise)
    root = np.linalg.cholesky(block_diag(once, once))
    y, x = np.linalg.solve(root, first.theta[3] * y), np.linalg.solve(root, x / np.abs(x).max(axis=0))
    left = float(np.linalg.norm(y - x @ np.linalg.lstsq(x, y, rcond=None)[0]))
    assert separation(fitted, design) == pytest.approx(left, rel=1e-4)


def test_the_separation_of_what_a_load_doubles_from_what_it_does_not(rivals, separation) -> None:
    """By hand: s f at first, 2 s f after; the best that one size can do is 3/2 s f, which misses both by s f / 2."""
    fitted = rivals(with_load, cubic, phi=0.0)
    chi2 = sum(
        2.0 * np.sum((0.5 * SIZE * cubic(h.inputs)) ** 2) / noise.sd**2
        for h, noise in zip(fitted[0].hypothesis.histories, fitted[0].noise, strict=True)
    )
    # the parabola is the same for old and further samples, so it helps with their mean, not with their difference
    assert separation(fitted, TWICE_THE_LOAD) == pytest.approx(np.sqrt(chi2), rel=1e-3)


def test_the_design_that_separates_is_proposed(rivals, separation) -> None:
    fitted = rivals(with_load, cubic)
    proposal = next_experiment(fitted)
    assert proposal is not None
    assert proposal.design is TWICE_THE_LOAD
    assert proposal.separation == separation(fitted, TWICE_THE_LOAD) > ENOUGH_SEPARATION
    for other in DESIGNS:
        if other is not TWICE_THE_LOAD and not {*other.needs} & {"current", "ambient_temperature"}:
            assert separation(fitted, other) < 0.05, other.title


def test_the_nearest_rival_counts(rivals, separation) -> None:
    truth, near, far = rivals(with_load, cubic, with_rate)
    alone = [separation([truth, other], THIRD_OF_THE_RATE) for other in (near, far)]
    assert alone[0] < 0.05 < ENOUGH_SEPARATION < alone[1]
    assert separation([truth, far, near], THIRD_OF_THE_RATE) == min(alone)


def test_another_rate_tells_a_lag_from_a_training_drift(rig, separation) -> None:
    """Of the catalogue, on one condition; more load does no more than to repeat what has been measured."""
    campaign = rig(lag=0.4, periods=(30.0,), loads=(1.0,)).campaign()
    plain = baseline(campaign, histories(campaign), read_priors("modified_sigmoid"), pooled=True)
    fitted = []
    for name in ("thermocouple_lag", "training_drift"):
        hypothesis = plain.extended(EFFECTS[name])
        fitted.append(fit_with_noise(hypothesis, hypothesis.space.prior_centre()))
    again = separation(fitted, ExperimentDesign("the same again", (), dict))
    assert separation(fitted, TWICE_THE_LOAD) == pytest.approx(again, rel=1e-6)
    assert separation(fitted, THIRD_OF_THE_RATE) > max(ENOUGH_SEPARATION, 10.0 * again)
    proposal = next_experiment(fitted)
    assert proposal is not None
    assert "rate" in proposal.design.needs


@pytest.mark.parametrize("design", DESIGNS, ids=lambda d: d.title)
def test_a_design_leaves_time_rate_and_temperature_consistent(design: ExperimentDesign, rig) -> None:
    for h in histories(rig().campaign()):
        inputs = {**h.inputs, "current": np.ones(h.n), "ambient_temperature": np.full(h.n, 20.0)}
        new = design.inputs(inputs)
        assert set(new) == set(inputs)
        assert all(v.shape == (h.n,) and np.all(np.isfinite(v)) for v in new.values())
        assert any(not np.array_equal(new[name], inputs[name]) for name in design.needs)
        assert np.all(np.diff(new["time"]) > 0.0)
        rate = sweep_rate(new["temperature"], new["time"], new["segment"])
        np.testing.assert_allclose(new["rate"], rate, rtol=1e-6, atol=1e-6 * np.ptp(rate))


def test_what_was_not_recorded_is_not_proposed(rivals) -> None:
    def untold(f: FittedHypothesis) -> FittedHypothesis:
        bare = tuple(
            replace(h, inputs={k: v for k, v in h.inputs.items() if k not in ("load", "time", "rate")})
            for h in f.hypothesis.histories
        )
        return replace(f, hypothesis=replace(f.hypothesis, histories=bare))

    fitted = [untold(f) for f in rivals(cubic, lambda v: v["temperature"] ** 4)]
    proposal = next_experiment(fitted)
    assert proposal is not None
    assert set(proposal.design.needs) <= {"temperature", "cycle"}
    assert next_experiment(fitted[:1]) is None  # nothing to separate


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("rate", ["a third of the rate", "three times the rate", "ten times as slowly"]),
        ("load", ["twice the load"]),
        ("cycle", ["four times as many cycles"]),
        ("temperature", ["70 % of the temperature range"]),
        ("ambient_temperature", ["10 K warmer"]),
        ("current", ["half the current"]),
    ],
)
def test_a_proposal_says_what_to_change_and_by_how_much(name: str, words: list[str]) -> None:
    titles = [str(ProposedExperiment(d, 7.04)) for d in DESIGNS if name in d.needs]
    assert len(titles) == len(words)
    for title, word in zip(titles, words, strict=True):
        assert word in title
        assert title.endswith("(expected separation 7.0 sigma)")


def test_a_weak_proposal_says_so() -> None:
    assert "4.5 sigma, which may not be enough: repeat it" in str(
        ProposedExperiment(TWICE_THE_LOAD, 0.9 * ENOUGH_SEPARATION)
    )
    assert "enough" not in str(ProposedExperiment(TWICE_THE_LOAD, ENOUGH_SEPARATION))


def test_what_separates_nothing_is_not_proposed() -> None:
    """Of Flexinol a repeat with twice the load was proposed, with a separation of 0.0 sigma."""
    told = str(ProposedExperiment(TWICE_THE_LOAD, 0.03))
    assert told == "none of the designs that were tried (the best, repeat with twice the load, by 0.0 sigma)"
