"""A hypothesis predicts what its equations say, and effects of no size say nothing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.effects import EFFECTS
from sma_bayes.effects.needs import untestable
from sma_bayes.parameters.distributions import LogNormal
from sma_bayes.parameters.priors_file import read_priors
from sma_bayes.records.history import History, histories
from sma_bayes.studies.gap.hypothesis import Hypothesis, baseline

PRIORS = read_priors("modified_sigmoid")
CHANNELS = ("force", "displacement")
SYMBOLS = ("A1", "A2", "A3", "A4", "B1", "B2", "B3", "B4")
SPRING = {
    "heating": (0.02, 0.30, 64.0, 0.011, 2.1, 0.20, 61.0, 0.9),
    "cooling": (0.021, 0.26, 53.0, 0.010, 1.9, 0.24, 50.0, 1.1),
}


def model(rig, *, pooled: bool) -> Hypothesis:
    campaign = rig(channels=CHANNELS).campaign()
    return baseline(campaign, histories(campaign), PRIORS, pooled=pooled)


def theta_of(hypothesis: Hypothesis, warmer: dict[str, float] | None = None) -> Floats:
    """Parameters of the spring by name; in some conditions all midpoints are moved."""
    theta = np.empty(len(hypothesis.space.parameters))
    for i, name in enumerate(hypothesis.space.names):
        symbol, _, rest = name.partition(" ")
        branch, _, condition = rest.rstrip("]").partition("[")
        theta[i] = SPRING[branch][SYMBOLS.index(symbol)]
        if symbol[1] == "3":
            theta[i] += (warmer or {}).get(condition, 0.0)
    return theta


def direct(history: History, by: float = 0.0) -> dict[str, Floats]:
    """Eqs. (2) and (4), sample by sample."""
    out = {c: np.empty(history.n) for c in CHANNELS}
    for i in range(history.n):
        branch = "heating" if history.inputs["branch"][i] > 0.0 else "cooling"
        a1, a2, a3, a4, b1, b2, b3, b4 = SPRING[branch]
        t = history.inputs["temperature"][i]
        out["displacement"][i] = a4 + a1 / (1.0 + np.exp(-a2 * (t - a3 - by)))
        out["force"][i] = b4 + b1 / (1.0 + np.exp(-b2 * (t - b3 - by)))
    return out


def test_predictions_are_the_equations_of_each_branch(rig) -> None:
    hypothesis = model(rig, pooled=True)
    theta = theta_of(hypothesis)
    for i, h in enumerate(hypothesis.histories):
        found, exact = hypothesis.predict(theta, i), direct(h)
        for channel in CHANNELS:
            np.testing.assert_allclose(found[channel], exact[channel], rtol=1e-12)


def test_conditions_share_their_curves_or_have_their_own(rig) -> None:
    shared, own = model(rig, pooled=True), model(rig, pooled=False)
    assert len(shared.space.parameters) == 16
    assert len(own.space.parameters) == 16 * 3
    for at in shared.layout:
        np.testing.assert_array_equal(at, np.arange(16))
    np.testing.assert_array_equal(np.concatenate(own.layout), np.arange(48))
    theta = theta_of(own, {"c0": 0.0, "c1": 3.0, "c2": -2.0})
    for i, (h, by) in enumerate(zip(own.histories, (0.0, 3.0, -2.0), strict=True)):
        np.testing.assert_allclose(own.predict(theta, i)["force"], direct(h, by)["force"], rtol=1e-12)
        others = theta.copy()
        others[np.setdiff1d(np.arange(48), own.positions(i))] *= 1.3
        np.testing.assert_array_equal(
            own.predict(others, i)["displacement"], own.predict(theta, i)["displacement"]
        )
    moved = theta_of(shared)
    moved[shared.space.index("A3 heating")] += 1.0
    changed = [
        np.any(
            shared.predict(moved, i)["displacement"] != shared.predict(theta_of(shared), i)["displacement"]
        )
        for i in range(3)
    ]
    assert changed == [True, True, True]


def test_effects_of_no_size_leave_the_baseline_as_it_is(rig) -> None:
    hypothesis = model(rig, pooled=True)
    theta = theta_of(hypothesis)
    tried = [e for e in EFFECTS.values() if not untestable(e.needs, hypothesis.histories)]
    assert len(tried) > 10
    for effect in tried:
        extended = hypothesis.extended(effect)
        assert extended.space.names[:16] == hypothesis.space.names
        (at,) = extended.effect_positions.values()
        whole = np.concatenate([theta, [float(p.prior.quantile(np.array(0.5))) for p in
                                        effect.parameters(extended.scales)]])  # fmt: skip
        whole[at[0]] = 0.0
        for i in range(3):
            plain, found = hypothesis.predict(theta, i), extended.predict(whole, i)
            for channel in CHANNELS:
                np.testing.assert_allclose(found[channel], plain[channel], rtol=1e-9, err_msg=effect.id)


def test_positions_of_effects_follow_their_order(rig) -> None:
    hypothesis = model(rig, pooled=True)
    effects = [EFFECTS[name] for name in ("training_drift", "thermocouple_lag", "stress_shift")]
    both = hypothesis.with_effects(effects)
    for effect in effects:
        names = [both.space.names[i] for i in both.effect_positions[effect.id]]
        assert names == [f"{effect.id}.{p.name}" for p in effect.parameters(both.scales)]
    fewer = both.with_effects(effects[1:])
    own = ("thermocouple_lag.tau", "thermocouple_lag.q", "thermocouple_lag.m", "stress_shift.c")
    assert fewer.space.names == (*hypothesis.space.names, *own)
    assert both.with_effects([]).space.names == hypothesis.space.names
    np.testing.assert_array_equal(both.positions(1), np.arange(len(both.space.parameters)))


def test_the_last_effect_is_outermost(make_line, added) -> None:
    """An effect that doubles what comes out, before and after one that adds."""
    line = make_line()

    class Doubled(added):  # type: ignore[misc]
        def apply(self, response, theta, inputs):
            return {c: v * (1.0 + theta) for c, v in response(inputs).items()}

    one, two = added("one", lambda v: np.ones_like(v["order"])), Doubled("two", lambda v: v["order"])
    theta = np.array([*line.prior_mean, 0.5, 1.0])
    plain = line.hypothesis.predict(theta[:3], 0)["displacement"]
    inner = line.hypothesis.with_effects([one, two]).predict(theta, 0)["displacement"]
    np.testing.assert_allclose(inner, 2.0 * (plain + 0.5))
    outer = line.hypothesis.with_effects([two, one]).predict(theta[[0, 1, 2, 4, 3]], 0)["displacement"]
    np.testing.assert_allclose(outer, 2.0 * plain + 0.5)


def test_a_batch_of_parameters_and_other_inputs(rig) -> None:
    hypothesis = model(rig, pooled=True).extended(EFFECTS["thermocouple_lag"])
    rng = np.random.default_rng(0)
    theta = np.append(theta_of(model(rig, pooled=True)), [0.5, 0.05, 90.0])
    theta = theta * (1.0 + 0.02 * rng.standard_normal((4, theta.size)))
    batch = hypothesis.predict(theta, 1)["force"]
    for k in range(4):
        np.testing.assert_allclose(batch[k], hypothesis.predict(theta[k], 1)["force"], rtol=1e-12)
    h = hypothesis.histories[1]
    warmer = {**h.inputs, "temperature": h.inputs["temperature"] + 5.0}
    moved = replace(hypothesis, histories=(h, replace(h, inputs=warmer), h))
    np.testing.assert_array_equal(
        hypothesis.predict(theta, 1, warmer)["force"], moved.predict(theta, 1)["force"]
    )


def test_a_part_of_the_samples_keeps_priors_and_parameters(rig) -> None:
    whole = model(rig, pooled=False)
    masks = [h.inputs["cycle"] == 2.0 for h in whole.histories]
    masks[1][:] = False
    part = whole.on(masks)
    assert part.space is whole.space
    theta = theta_of(whole, {"c2": 4.0})
    for i, j in ((0, 0), (1, 2)):
        np.testing.assert_allclose(
            part.predict(theta, i)["force"], whole.predict(theta, j)["force"][masks[j]], rtol=1e-12
        )


def test_current_and_time_bring_a_heat_balance(rig) -> None:
    campaign = rig().campaign()
    driven = replace(
        campaign,
        records=tuple(
            replace(r, inputs={**r.inputs, "current": np.full(r.n, 2.0)}, units={**r.units, "current": "A"})
            for r in campaign.records
        ),
    )
    hypothesis = baseline(driven, histories(driven), PRIORS, pooled=False)
    assert hypothesis.channels == ("displacement", "temperature")
    tail = [p for p in hypothesis.space.parameters if p.name.startswith(("gain", "loss", "ambient"))]
    assert [p.name for p in tail[:3]] == ["gain[c0]", "loss[c0]", "ambient[c0]"]
    assert len(tail) == 9
    assert all(isinstance(p.prior, LogNormal) for p in tail if not p.name.startswith("ambient"))
    theta = hypothesis.space.constrain(hypothesis.space.prior_centre())
    assert set(hypothesis.predict(theta, 0)) == {"displacement", "temperature"}
