"""Simulated campaigns: what is hidden in them, how large it is, and that without it there is nothing to find."""

from __future__ import annotations

import ast
from pathlib import Path

import numpy as np
import pytest
from gap_benchmark import hide as module
from gap_benchmark.absorb import leftover, size_in_sigma
from gap_benchmark.designs import DESIGNS, courses
from gap_benchmark.heating import follow
from gap_benchmark.hide import INSIDE, LAWS, MECHANISMS, OUTSIDE, Case, hide, hide_several, plant
from gap_benchmark.noise import NOISES
from gap_benchmark.spring import CURVES
from gap_benchmark.state import Readings, State, at_rest, simulate, with_channels
from scipy.optimize import least_squares

from sma_bayes.records.history import histories

THERMAL = ("latent_heat", "ambient_draught")


def design_of(effect: str) -> str:
    return "thermal_slow" if effect in THERMAL else "standard"


# --- nothing hidden -----------------------------------------------------------------------------------


@pytest.mark.parametrize("design", DESIGNS)
def test_without_a_mechanism_readings_are_modified_sigmoids_of_temperature(design: str) -> None:
    for readings in hide("none", 10.0, design=design, seed=4).clean:
        temperature, spring = readings.channels["temperature"], readings.course.spring
        for branch, own in (("heating", readings.heating), ("cooling", ~readings.heating)):
            for channel in ("force", "displacement"):
                c = spring.curves[channel, branch]
                plain = c.low + c.span / (1.0 + np.exp(-c.rate * (temperature[own] - c.midpoint)))
                assert np.max(np.abs(readings.channels[channel][own] - plain)) < 1e-10 * c.span


@pytest.mark.parametrize(("design", "noise"), [("thermal", 0.15), ("thermal_slow", 0.3)])
def test_without_a_mechanism_temperature_is_the_heat_balance_of_the_recorded_current(
    design: str, noise: float
) -> None:
    case = hide("none", 10.0, design=design)
    for clean, history in zip(case.clean, histories(case.campaign), strict=True):
        wire, time = clean.course.wire, history.inputs["time"]
        expected = [clean.channels["temperature"][0]]
        for i in range(time.size - 1):
            goal = (
                history.inputs["ambient_temperature"][i]
                + history.inputs["current"][i] ** 2 * wire.resistance / wire.loss
            )
            kept = np.exp(-(time[i + 1] - time[i]) * wire.loss / wire.capacity)
            expected.append(goal + kept * (expected[-1] - goal))
        np.testing.assert_allclose(clean.channels["temperature"], expected, atol=1e-9)
        assert abs(np.std(history.observed["temperature"] - expected) / noise - 1.0) < 0.1


@pytest.mark.parametrize("design", DESIGNS)
def test_histories_are_reassembled_in_order_without_interruption(design: str) -> None:
    case = hide("none", 10.0, design=design)
    cycles = 1 if design == "one_cycle" else 5
    for clean, history in zip(case.clean, histories(case.campaign), strict=True):
        assert history.n == 200 * cycles
        np.testing.assert_array_equal(history.row, np.arange(200 * cycles) + 2)
        assert np.all(np.diff(history.inputs["time"]) > 0.0)
        assert np.unique(history.inputs["stretch"]).size == 1
        assert np.unique(history.inputs["segment"]).size == 2 * cycles
        np.testing.assert_array_equal(np.unique(history.inputs["cycle"]), np.arange(cycles) + 1)
        np.testing.assert_array_equal(history.inputs["branch"] > 0, clean.heating)
        assert ("temperature" in history.observed) == design.startswith("thermal")


def test_the_standard_design_has_a_hundred_samples_a_branch_and_varied_rates() -> None:
    campaign = hide("none", 10.0).campaign
    assert [r.n for r in campaign.records] == [500] * 6
    near = [(h.inputs["rate"][np.abs(h.inputs["temperature"] - 60.0) < 5.0]) for h in histories(campaign)]
    heating = [np.median(r[r > 0.0]) for r in near]
    assert heating[2] > 2.0 * heating[0] > 0.0


# --- something hidden ---------------------------------------------------------------------------------


@pytest.mark.parametrize("effect", [*INSIDE, *OUTSIDE])
def test_the_size_in_sigma_is_what_was_asked_for(effect: str) -> None:
    case = hide(effect, 8.0, design=design_of(effect), seed=2)
    assert case.answers[0].sigma == pytest.approx(8.0, rel=1e-3)
    assert case.sigma == pytest.approx(8.0, rel=1e-3)
    assert 0.125 <= case.noise_factor <= 8.0
    if effect in ("saturation", "quantisation"):  # they act on readings with noise; see below
        return
    plain = hide("none", 8.0, design=design_of(effect), seed=2)
    changed = [
        np.max(np.abs(a.channels[c] - b.channels[c])) / np.ptp(b.channels[c])
        for a, b in zip(case.clean, plain.clean, strict=True)
        for c in a.channels
    ]
    assert max(changed) > 1e-4


@pytest.mark.parametrize(
    "effect", ["thermocouple_lag", "asymmetric_kinetics", "training_drift", "sensor_drift"]
)
@pytest.mark.parametrize(("noise", "memory"), [("white", 0.0), ("ar1_0.9", 0.9)])
def test_an_independent_fit_leaves_what_was_asked_for(effect: str, noise: str, memory: float) -> None:
    case = hide(effect, 10.0, noise, seed=3)
    assert independent_sigma(case, memory) == pytest.approx(10.0, rel=1e-3)


def independent_sigma(case: Case, memory: float) -> float:
    """Norm after a fit by another algorithm, with the covariance matrix of the noise written out."""
    total = 0.0
    n = case.clean[0].heating.size
    lag = np.abs(np.subtract.outer(np.arange(n), np.arange(n)))
    root = np.linalg.inv(np.linalg.cholesky(np.where(lag == 0, 1.0, memory ** np.maximum(lag, 1))))
    for channel in ("force", "displacement"):
        scale = case.noise_sd[channel]

        def residual(theta: np.ndarray, channel: str = channel, scale: float = scale) -> np.ndarray:
            parts = []
            for r in case.clean:
                heat, cool = (
                    low + span * (0.5 + 0.5 * np.tanh(0.5 * rate * (r.channels["temperature"] - 10.0 * mid)))
                    for low, span, rate, mid in (theta[:4], theta[4:])
                )
                data = r.channels[channel] / (200.0 * scale)
                parts.append(200.0 * root @ (data - np.where(r.heating, heat, cool)))
            return np.concatenate(parts)

        start = np.array([0.2, 1.0, 0.25, 6.0, 0.2, 1.0, 0.25, 4.7])
        fit = least_squares(residual, start, method="lm", xtol=1e-13, ftol=1e-13)
        total += 2.0 * float(fit.cost)
    return float(np.sqrt(total))


def test_a_wrong_calibration_factor_leaves_nothing() -> None:
    case = hide("wrong_calibration", 10.0)
    assert case.answers[0].size == pytest.approx(0.03)
    assert case.sigma < 1e-6
    plain = hide("none", 10.0)
    np.testing.assert_allclose(
        case.clean[0].channels["force"], 1.03 * plain.clean[0].channels["force"], rtol=1e-12
    )


def test_where_nothing_is_hidden_the_shape_of_the_curves_has_the_size_asked_for() -> None:
    """The noise makes it so; sigmoids leave nothing, whatever the noise."""
    few, many = (hide("none", sigma, "ar1_0.8", seed=3, curve="two_stages") for sigma in (10.0, 40.0))
    assert few.noise_factor == pytest.approx(4.0 * many.noise_factor)
    assert independent_sigma(few, 0.8) == pytest.approx(10.0, rel=1e-3)
    assert hide("none", 0.0, seed=3, curve="two_stages").noise_factor == 1.0
    assert hide("none", 10.0, seed=3).noise_factor == 1.0


def test_a_load_that_does_not_vary_shows_no_stress_shift() -> None:
    with pytest.raises(ValueError, match=r"stress_shift is .* sigma at most"):
        hide("stress_shift", 10.0, design="single_condition")


def test_conditions_of_their_own_absorb_a_stress_shift() -> None:
    with pytest.raises(ValueError, match=r"stress_shift is .* sigma at most"):
        hide("stress_shift", 10.0, pooled=False)


def test_two_mechanisms_are_each_of_the_size_asked_for() -> None:
    case = hide_several(["guide_friction", "thermocouple_lag"], 10.0, seed=5)
    assert [a.effect for a in case.answers] == ["guide_friction", "thermocouple_lag"]
    assert [a.sigma for a in case.answers] == pytest.approx([10.0, 10.0], rel=1e-3)
    assert 5.0 < case.sigma < 20.0


def test_a_mechanism_can_be_planted_by_its_size() -> None:
    asked = hide("thermocouple_lag", 10.0, seed=7)
    planted = plant({"thermocouple_lag": asked.answers[0].size}, seed=7)
    assert planted.campaign.sha256 == asked.campaign.sha256
    assert plant({"thermocouple_lag": 2.0}, seed=7).sigma > 100.0


def test_a_size_of_no_mechanism_is_beyond_its_limit() -> None:
    for seed in range(3):
        for effect in ("minor_loop", "contact_error", "amplitude_fatigue"):
            assert hide(effect, 10.0, "ar1_0.9", seed=seed).answers[0].size <= MECHANISMS[effect].limit


def test_readings_are_clipped_and_stepped_after_the_noise() -> None:
    saturated = hide("saturation", 10.0)
    top = max(r.observed["force"].max() for r in saturated.campaign.records)
    assert sum(np.count_nonzero(r.observed["force"] == top) for r in saturated.campaign.records) > 100
    stepped = hide("quantisation", 10.0)
    steps = np.concatenate([r.observed["force"] for r in stepped.campaign.records]) / stepped.answers[0].size
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-6)


# --- mechanisms -----------------------------------------------------------------------------------------


def fine(effect: str, size: float, design: str = "standard", **traits: float) -> tuple[State, State]:
    """State of the first condition without and with a mechanism."""
    (course, *_) = courses(DESIGNS[design], 0)
    plain = with_channels(at_rest(course))
    return plain, MECHANISMS[effect].act(plain, size, traits)


def test_latent_heat_holds_the_temperature_back_as_the_heat_balance_says() -> None:
    """Against Euler's rule in steps a hundred times finer."""
    plain, with_heat = fine("latent_heat", 8e3, "thermal")
    c = plain.course
    curve = c.spring.curves["force", "heating"]
    temperature, worst = c.temperature[0], 0.0
    for i in range(4 * 60):  # within the first heating
        dt = (c.time[i + 1] - c.time[i]) / 100.0
        for _ in range(100):
            x = 1.0 / (1.0 + np.exp(-curve.rate * (temperature - curve.midpoint)))
            capacity = c.wire.capacity + c.wire.mass * 8e3 * curve.rate * x * (1.0 - x)
            temperature += dt * (c.power[i] - c.wire.loss * (temperature - c.ambient[i])) / capacity
        worst = max(worst, abs(with_heat.course.temperature[i + 1] - temperature))
    assert worst < 0.05
    assert np.max(c.temperature - with_heat.course.temperature) > 2.0


def test_asymmetric_kinetics_is_a_power_of_the_logistic_curve() -> None:
    plain, skewed = fine("asymmetric_kinetics", np.log(1.7), sign=1.0)
    np.testing.assert_allclose(skewed.fraction, plain.fraction**1.7, atol=1e-6)


def test_late_transformation_trails_by_the_stated_temperature() -> None:
    plain, late = fine("rate_dependence", 2.0, exponent=0.5)
    c = plain.course
    at = int(np.argmin(np.abs(c.temperature[:400] - c.spring.curves["force", "heating"].midpoint)))
    behind = (plain.z[0, at] - late.z[0, at]) / c.spring.curves["force", "heating"].rate
    assert behind == pytest.approx(2.0 * np.sqrt(c.rate[at]), rel=0.1)


def test_the_path_shift_solves_its_own_equation() -> None:
    plain, shifted = fine("path_stress_shift", 6.0)
    spring, heating = plain.course.spring, plain.course.heating
    force = spring.read("force", shifted.z[0], heating) - spring.curves["force", "heating"].low
    moved = plain.course.temperature - 6.0 * force
    np.testing.assert_allclose(shifted.z[0], spring.logit(moved, heating), atol=1e-6)


def test_friction_opposes_motion_and_is_bounded() -> None:
    plain, rubbed = fine("guide_friction", 0.02, presliding=1e-4)
    friction = rubbed.force - plain.force
    assert np.max(np.abs(friction)) < 0.02 + 1e-12
    moving = np.abs(np.gradient(plain.displacement, plain.course.time)) > 2e-5
    up = plain.course.heating[moving]
    assert np.mean(friction[moving][up]) > 0.019
    assert np.mean(friction[moving][~up]) < -0.019


def test_a_minor_loop_is_continuous_where_the_sweep_turns() -> None:
    plain, remembered = fine("minor_loop", 1.0, "ladder")
    turns = np.flatnonzero(np.diff(plain.course.sweep))
    jump = np.abs(np.diff(plain.fraction))[turns]
    assert np.max(jump) > 0.1
    assert np.max(np.abs(np.diff(remembered.fraction))[turns]) < 0.02 * np.max(jump)


def test_ends_of_a_spring_with_a_gradient_are_cooler_by_the_stated_amount() -> None:
    plain, graded = fine("temperature_gradient", 10.0, power=2.0)
    assert graded.weights.sum() == pytest.approx(1.0)
    c = plain.course
    hot = int(np.argmax(c.temperature))
    cooler = (plain.z[0, hot] - graded.z[:, hot]) / c.spring.rate(c.heating)[hot]
    assert np.all(np.diff(cooler) > 0.0)
    warm, room = c.temperature[hot], c.ambient[hot]
    assert cooler[-1] == pytest.approx(10.0 * (warm - room) / (100.0 - room), rel=0.1)  # close to the end


def left_by(effect: str, law: str) -> np.ndarray:
    """What the plain model does not absorb of a mechanism, as a vector of length 1."""
    design = "ladder" if effect in ("minor_loop", "temperature_gradient") else design_of(effect)
    sigma = 2.5 if effect == "fixture_compliance" else 30.0  # curves of their own take up more of it
    case = hide(effect, sigma, "white", design, seed=3, law=law)
    assert case.sigma == pytest.approx(sigma, rel=0.02)
    left = leftover(case.clean, NOISES["white"], case.noise_sd, pooled=True)
    whole = np.concatenate([part for parts in left.values() for part in parts])
    return np.asarray(whole / np.linalg.norm(whole))


@pytest.mark.parametrize("effect", sorted(set(LAWS["second"]) - {"saturation", "quantisation"}))
def test_the_second_law_is_the_same_effect_by_another_form(effect: str) -> None:
    """They point the same way or the opposite one, where the sign is free; but not quite."""
    alike = abs(float(left_by(effect, "first") @ left_by(effect, "second")))
    assert 0.1 < alike < 0.99999


def test_every_effect_of_the_catalogue_has_two_laws() -> None:
    assert set(LAWS["second"]) == set(INSIDE)


@pytest.mark.parametrize("effect", sorted(LAWS["simcoon"]))
def test_the_material_law_moves_the_spring_with_the_load(effect: str) -> None:
    pytest.importorskip("simcoon")
    case = hide(effect, 30.0, law="simcoon")
    assert case.sigma == pytest.approx(30.0, rel=0.1)
    loads = [r.course.setting.load for r in case.clean]
    if effect == "stress_stroke":  # the more stress, the more martensite is oriented
        strokes = [float(np.ptp(r.channels["displacement"])) for r in case.clean]
        assert np.argsort(strokes).tolist() == np.argsort(loads).tolist()


@pytest.mark.parametrize("curve", sorted(set(CURVES) - {"sigmoid"}))
def test_richer_curves_are_no_sigmoids_and_hide_effects_of_the_stated_size(curve: str) -> None:
    case = hide("training_drift", 30.0, curve=curve)
    assert case.sigma == pytest.approx(30.0, rel=1e-3)
    plain = hide("none", 0.0, curve=curve)
    left = leftover(plain.clean, NOISES["white"], plain.noise_sd, pooled=True)
    assert size_in_sigma(left) > 10.0


# --- noise, seeds, independence -----------------------------------------------------------------------


@pytest.mark.parametrize("name", NOISES)
def test_noise_has_unit_variance_and_its_stated_memory(name: str) -> None:
    noise = NOISES[name]
    draws = noise.draw(np.random.default_rng(0), 400_000)
    assert np.var(draws) == pytest.approx(1.0, abs=0.06)
    assert np.corrcoef(draws[1:], draws[:-1])[0, 1] == pytest.approx(noise.memory, abs=0.01)
    white = noise.whiten(draws)
    assert np.corrcoef(white[1:], white[:-1])[0, 1] == pytest.approx(0.0, abs=0.01)
    assert np.var(white) == pytest.approx(1.0, abs=0.06)


@pytest.mark.parametrize("name", ["white", "ar1_0.5"])
def test_noise_of_a_campaign_is_half_a_per_cent_of_the_span(name: str) -> None:
    case = hide("none", 10.0, name, seed=6)
    for channel in ("force", "displacement"):
        off = np.concatenate(
            [
                h.observed[channel] - r.channels[channel]
                for h, r in zip(histories(case.campaign), case.clean, strict=True)
            ]
        )
        span = case.clean[0].course.spring.span(channel)
        assert np.std(off) / span == pytest.approx(0.005, rel=0.06)


def test_a_seed_gives_the_same_campaign_and_another_seed_another() -> None:
    first, again, other = (hide("hot_creep", 10.0, seed=s).campaign for s in (1, 1, 2))
    assert first.sha256 == again.sha256 != other.sha256
    np.testing.assert_array_equal(first.records[0].observed["force"], again.records[0].observed["force"])


def test_a_follower_answers_a_ramp_as_the_equation_says() -> None:
    time = np.array([0.0, 0.3, 1.0, 2.0, 5.0])
    exact = 2.0 * (time - 0.7 + 0.7 * np.exp(-time / 0.7))
    np.testing.assert_allclose(follow(2.0 * time, time, 0.7, 0.0), exact, atol=1e-12)


def test_refitting_finds_other_curves_again() -> None:
    """Readings of another spring are absorbed completely."""
    (course,) = courses(DESIGNS["single_condition"], 0)
    (other,) = courses(DESIGNS["single_condition"], 8)
    foreign = simulate(other)
    mixed = Readings(course, foreign.heating, foreign.sweep, foreign.channels)
    left = leftover([mixed], NOISES["white"], {"force": 0.01, "displacement": 1e-4}, pooled=True)
    assert size_in_sigma(left) < 1e-6


ANALYSES = ("trials.py", "attainable.py")
"""Run the workflow on what the others make, and tell how often it can name an effect at best."""


def test_generators_share_no_code_with_the_catalogue() -> None:
    folder = Path(module.__file__).parent
    imported = {
        node.module
        for path in folder.glob("*.py")
        if path.name not in ANALYSES
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.ImportFrom) and node.module
    }
    assert {m for m in imported if m.startswith("sma_bayes")} == {"sma_bayes.records.types"}
    assert not {m for m in imported if f"{m.rpartition('.')[2]}.py" in ANALYSES}


@pytest.mark.parametrize(
    ("names", "law"),
    [(("thermal_expansion", "training"), "second"), (("quantisation", "saturation"), "first")],
)
def test_mechanisms_act_in_their_own_order_whatever_that_of_their_names(
    names: tuple[str, str], law: str
) -> None:
    """By the order of their names training forgot what had expanded, and a limit cut between two steps."""
    case, other = (hide_several(order, 30.0, seed=2, law=law) for order in (names, names[::-1]))
    for one, again in zip(case.campaign.records, other.campaign.records, strict=True):
        for channel, values in one.observed.items():
            np.testing.assert_array_equal(values, again.observed[channel])
    assert all(answer.sigma == pytest.approx(30.0, rel=1e-3) for answer in case.answers)
    assert case.sigma > 35.0, "one of them has undone the other"
