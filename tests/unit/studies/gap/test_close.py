"""What is held out plays no part in what it is predicted with, and the gap is what its definition says."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sma_bayes.effects import EFFECTS
from sma_bayes.parameters.priors_file import read_priors
from sma_bayes.records.history import histories
from sma_bayes.studies.gap import close as module
from sma_bayes.studies.gap.close import (
    FOLDS,
    Fold,
    Gap,
    by_noise_alone,
    close,
    folds_of,
    held_out_scores,
    predict_fold,
)
from sma_bayes.studies.gap.fitting import fit_hypothesis
from sma_bayes.studies.gap.study import GapStudy, study_campaign

PRIORS = read_priors("modified_sigmoid")
FEW = {name: EFFECTS[name] for name in ("thermocouple_lag", "stress_shift", "training_drift")}


@pytest.fixture(scope="module")
def lagging(rig) -> GapStudy:
    return study_campaign(rig(lag=0.4).campaign(), PRIORS, pooled=True, effects=FEW)


@pytest.mark.parametrize(
    ("of", "pooled", "named"),
    [
        ({"cycles": 4}, True, "cycle"),
        ({"cycles": 2}, True, "condition"),
        ({"cycles": 2}, False, "stretches"),
        ({"cycles": 1, "periods": (60.0,)}, True, "stretches"),
    ],
)
def test_every_sample_is_held_out_once(of, pooled: bool, named: str, rig) -> None:
    found = histories(rig(**of).campaign())
    folds, what = folds_of(found, pooled=pooled)
    assert named in what
    assert len(folds) == FOLDS
    for i, h in enumerate(found):
        np.testing.assert_array_equal(np.sum([f[i] for f in folds], axis=0), np.ones(h.n))
    for fold in folds:
        assert any(m.any() for m in fold)
        assert any((~m).any() for m in fold)
        for h, m in zip(found, fold, strict=True):
            if named == "cycle":
                cycle = h.inputs["cycle"]
                assert not set(cycle[m].tolist()) & set(cycle[~m].tolist())
            elif named == "condition":
                assert m.all() or not m.any()
            else:  # whole stretches: far fewer changes than samples
                assert 0 < np.count_nonzero(np.diff(m)) <= 12 * np.unique(h.inputs["segment"]).size


def test_noise_alone_leaves_what_dense_matrices_say(make_line, monkeypatch) -> None:
    """Of a linear model, with noise that the parameters follow: less than its standard deviation."""
    monkeypatch.setattr(module, "NOISE_DRAWS", 40_000)
    line = make_line(phi=0.99, n=40)
    whole = fit_hypothesis(line.hypothesis, line.prior_mean, line.noise)
    histories_of = line.hypothesis.histories
    out = [np.arange(h.n) % 20 < 5 for h in histories_of]
    held = np.concatenate(out)
    kept = [~m for m in out]
    train = fit_hypothesis(
        line.hypothesis.on(kept),
        line.prior_mean,
        tuple(n.on(k) for n, k in zip(line.noise, kept, strict=True)),
    )
    test, rows = line.hypothesis.on(out), (np.flatnonzero(~held), np.flatnonzero(held))
    found = by_noise_alone(train, test, whole, *rows, np.random.default_rng(0))
    shape = _covariance_without_gaps(train)
    x = line.x[~held]
    gain = np.linalg.solve(
        x.T @ np.linalg.solve(shape, x) + np.diag(line.prior_sd**-2.0), np.linalg.solve(shape, x).T
    )
    to_left = np.zeros((held.sum(), held.size))
    to_left[:, held] = np.eye(held.sum())
    to_left[:, ~held] = -line.x[held] @ gain
    exact = np.diag(to_left @ line.covariance @ to_left.T)
    np.testing.assert_allclose(found, exact, rtol=0.05)
    assert found.mean() == pytest.approx(exact.mean(), rel=0.02)
    assert exact.mean() < 0.8 * np.diag(line.covariance)[held].mean()


def _covariance_without_gaps(fitted) -> np.ndarray:
    """Covariance of noise as the fit takes it, which begins anew after what is held out."""
    rows = fitted.whiten(np.eye(fitted.whitened.size))
    return np.linalg.inv(rows @ rows.T)


@pytest.fixture
def looks(monkeypatch: pytest.MonkeyPatch) -> list[GapStudy]:
    """What the loop finds without each fold."""
    seen: list[GapStudy] = []
    loop = module.study_from

    def spy(*args, **kwargs):
        seen.append(loop(*args, **kwargs))
        return seen[-1]

    monkeypatch.setattr(module, "study_from", spy)
    return seen


def test_held_out_values_do_not_move_the_fit_of_their_fold(lagging: GapStudy, looks: list[GapStudy]) -> None:
    folds, _ = folds_of(lagging.baseline.hypothesis.histories, pooled=True)
    rng = np.random.default_rng(0)
    for i, out in enumerate(folds):
        first = lagging.baseline
        spoilt = tuple(
            replace(
                h,
                observed={
                    c: np.where(m, v + 0.01 * rng.standard_normal(h.n), v) for c, v in h.observed.items()
                },
            )
            for h, m in zip(first.hypothesis.histories, out, strict=True)
        )
        other = replace(
            lagging, baseline=replace(first, hypothesis=replace(first.hypothesis, histories=spoilt))
        )
        plain, changed = (predict_fold(Fold(s, FEW, out, (0, 11, i))) for s in (lagging, other))
        assert plain.chosen == changed.chosen
        one, two = (found.final for found in looks[-2:])
        np.testing.assert_array_equal(one.z, two.z)
        assert one.ln_evidence == two.ln_evidence
        assert changed.squares[0] > 10.0 * plain.squares[0]
        assert plain.channels["displacement"][0] == sum(int(m.sum()) for m in out)


@pytest.mark.parametrize("of", [{}, {"cycles": 1, "memory": 0.6}], ids=["cycles", "stretches"])
def test_what_is_left_is_the_held_out_residual_in_sds_of_the_noise(of, rig, looks: list[GapStudy]) -> None:
    """By hand: predictions of the fold with the fold's own fit, as innovations; after a sample left out anew."""
    study = study_campaign(rig(lag=0.4, **of).campaign(), PRIORS, pooled=False, effects=FEW)
    folds, _ = folds_of(study.baseline.hypothesis.histories, pooled=False)
    found = predict_fold(Fold(study, FEW, folds[1], (0, 11, 1)))
    final, whole = looks[-1].final, study.final
    total = 0.0
    for block, noise in zip(whole.blocks, whole.noise, strict=True):
        h, m = whole.hypothesis.histories[block.history], folds[1][block.history]
        predicted = final.hypothesis.predict(final.theta, block.history, h.inputs)[block.channel]
        u = (h.observed[block.channel] - predicted) / noise.sd
        for i in np.flatnonzero(m):
            phi = noise.memory[i] if i > 0 and m[i - 1] else 0.0
            total += (u[i] - phi * u[i - 1]) ** 2 / (1.0 - phi**2)
    assert found.squares[1] == pytest.approx(total, rel=1e-6)
    assert found.channels["displacement"][0] == sum(int(m.sum()) for m in folds[1])
    assert found.channels["displacement"][2] == pytest.approx(total, rel=1e-6)


def test_a_fold_repeats_itself(lagging: GapStudy, looks: list[GapStudy]) -> None:
    folds, _ = folds_of(lagging.baseline.hypothesis.histories, pooled=True)
    for seed in (1, 1, 2):
        predict_fold(Fold(lagging, FEW, folds[0], (seed, 11, 0)))
    one, again, other = ([s.look.p_value for s in found.steps] for found in looks)
    assert one == again
    assert one != other


def test_the_gap_closes_where_the_cause_was_named(lagging: GapStudy) -> None:
    gap = close(lagging, FEW, pooled=True, seed=0)
    assert gap.chosen == (("thermocouple_lag",),) * FOLDS
    assert gap.before > 2.0
    assert gap.after == pytest.approx(1.0, abs=0.1)
    assert gap.floor <= gap.after
    assert gap.shrink > 0.9
    assert gap.way_to_noise == pytest.approx((gap.before - gap.after) / (gap.before - 1.0))


def test_the_gap_of_each_channel_is_told_in_its_unit(rig) -> None:
    """Two channels: squares add up to the whole, and the noise is what was put in."""
    hidden = rig(channels=("displacement", "force"), lag=0.4)
    study = study_campaign(hidden.campaign(), PRIORS, pooled=True, effects=FEW)
    gap = close(study, FEW, pooled=True, seed=0)
    assert set(gap.channels) == {"displacement", "force"}
    for name in ("before_sigma", "after_sigma"):
        both = [getattr(c, name) for c in gap.channels.values()]
        assert np.sqrt(np.mean(np.square(both))) == pytest.approx(getattr(gap, name.removesuffix("_sigma")))
    span = {"displacement": 0.02, "force": 2.0}
    for channel, found in gap.channels.items():
        assert found.noise == pytest.approx(hidden.sd * span[channel], rel=0.1)
        assert found.after == pytest.approx(found.noise, rel=0.15)
        assert found.before > 2.0 * found.after


def test_without_a_gap_nothing_is_closed(rig) -> None:
    study = study_campaign(rig(seed=1).campaign(), PRIORS, pooled=True, effects=FEW)
    gap = close(study, FEW, pooled=True, seed=0)
    assert gap.before == pytest.approx(1.0, abs=0.1)
    assert gap.after == pytest.approx(gap.before, abs=0.05)


@pytest.mark.parametrize(
    ("before", "after", "floor", "shrink"),
    [
        (3.0, 1.5, 1.0, 0.75),
        (3.0, 1.0, 1.0, 1.0),
        (3.0, 3.5, 1.0, -0.25),
        (1.0, 1.0, 1.0, 0.0),
        (0.9, 1.0, 1.0, 0.0),
    ],
)
def test_the_share_that_is_closed(before: float, after: float, floor: float, shrink: float) -> None:
    assert Gap(before, after, floor, "", (), {}).shrink == pytest.approx(shrink)


def test_scores_of_candidates_tell_the_cause_from_another_effect(lagging: GapStudy) -> None:
    first = lagging.steps[0]
    scores = held_out_scores(first.before, first.candidates, pooled=True)
    assert set(scores) == {c.effect.id for c in first.candidates if c.fitted is not None}
    cause = scores["thermocouple_lag"]
    assert cause.delta > 5.0 * cause.se > 0.0
    assert all(cause.delta > s.delta for name, s in scores.items() if name != "thermocouple_lag")
