"""Each effect does what its equation says, checked by a route of its own."""

from collections.abc import Mapping

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.special import expit

from sma_bayes.arrays import Floats
from sma_bayes.effects import EFFECTS
from sma_bayes.effects.quantisation import steps
from sma_bayes.effects.temperature_gradient import ROOM
from sma_bayes.records.history import sweep_rate

from .conftest import COOLING, HEATING, THERMAL, THETA, response_at

A1, A2, A3, A4, B1, B2, B3, B4 = HEATING


def inputs_of(temperature: Floats, branch: float = 1.0, **more: Floats) -> dict[str, Floats]:
    """Inputs of one sweep, in a second a sample."""
    n = temperature.size
    plain = {
        "temperature": temperature,
        "branch": np.full(n, branch),
        "cycle": np.ones(n),
        "segment": np.zeros(n),
        "stretch": np.zeros(n),
        "order": np.arange(n, dtype=float),
        "time": np.arange(n, dtype=float),
        "current": np.full(n, 2.0),
    }
    plain.update(more)
    plain.setdefault("rate", sweep_rate(temperature, plain["time"], plain["segment"]))
    return plain


def applied(name: str, theta: list[float], inputs: Mapping[str, Floats]) -> dict[str, Floats]:
    return EFFECTS[name].apply(response_at(THETA), np.array(theta), inputs)


RAMP = np.linspace(20.0, 120.0, 201)
PLAIN = response_at(THETA)(inputs_of(RAMP))


def force(temperature: Floats) -> Floats:
    return B4 + B1 * expit(B2 * (temperature - B3))


def stroke(temperature: Floats) -> Floats:
    return A4 + A1 * expit(A2 * (temperature - A3))


def test_a_lagging_sensor_gives_back_the_metal() -> None:
    """The sensor is integrated in time while the heating eases off; the effect undoes its lag."""
    tau, time = 2.0, np.linspace(0.0, 60.0, 601)
    metal = 20.0 + 90.0 * (1.0 - np.exp(-time / 25.0))
    sensor = solve_ivp(
        lambda t, y: (20.0 + 90.0 * (1.0 - np.exp(-t / 25.0)) - y) / tau, (0.0, 60.0), [20.0],
        t_eval=time, rtol=1e-9,
    ).y[0]  # fmt: skip
    out = applied("thermocouple_lag", [tau, 0.0, 100.0], inputs_of(sensor, time=time))
    missed = np.max(np.abs(force(sensor) - force(metal)))
    assert np.max(np.abs(out["force"] - force(metal))[10:]) < 0.02 * missed


def test_a_lagging_sensor_delays_the_simulated_temperature() -> None:
    tau, time = 2.0, np.linspace(0.0, 60.0, 601)
    gain, loss, ambient, _ = THERMAL

    def balance(t: float, y: Floats) -> list[float]:
        return [4.0 * gain - loss * (y[0] - ambient), (y[0] - y[1]) / tau]

    metal, sensor = solve_ivp(balance, (0.0, 60.0), [22.0, 22.0], t_eval=time, rtol=1e-9).y
    plain = response_at(THETA)(inputs_of(metal, time=time))["temperature"]
    np.testing.assert_allclose(plain, metal, atol=0.01)
    inputs = inputs_of(sensor, time=time)
    inputs["rate"] = np.gradient(sensor, time, edge_order=2)
    out = applied("thermocouple_lag", [tau], inputs)["temperature"]
    np.testing.assert_allclose(out, sensor, atol=0.05)


def two_paths(tau: float, part: float, slower: float, time: Floats) -> tuple[Floats, Floats]:
    """Metal that warms and eases off, and a sensor whose junction warms a slow mount, integrated in time."""

    def metal(t: Floats) -> Floats:
        return 20.0 + 90.0 * (1.0 - np.exp(-t / 25.0))

    def flow(t: float, y: Floats) -> list[float]:
        return [float(metal(np.array(t)) - y[0]) / tau, (y[0] - y[1]) / (slower * tau)]

    junction, mount = solve_ivp(flow, time[[0, -1]], [20.0, 20.0], t_eval=time, rtol=1e-10, atol=1e-10).y
    return metal(time), (junction + part * mount) / (1.0 + part)


@pytest.mark.parametrize("slower", [10.0, 100.0])
def test_a_sensor_with_a_slow_mount_gives_back_the_metal(slower: float) -> None:
    tau, part, time = 0.5, 0.08, np.linspace(0.0, 60.0, 1201)
    metal, sensor = two_paths(tau, part, slower, time)
    inputs = inputs_of(sensor, time=time)
    out = applied("thermocouple_lag", [tau, part, slower], inputs)["force"]
    of_junction = applied("thermocouple_lag", [tau, 0.0, slower], inputs)["force"]
    missed, without = (np.max(np.abs(f - force(metal))[20:]) for f in (force(sensor), of_junction))
    assert np.max(np.abs(out - force(metal))[20:]) < 0.02 * min(missed, without)


def test_contact_error_is_undone() -> None:
    beta, ambient = 0.1, np.linspace(15.0, 30.0, RAMP.size)
    reading = RAMP - beta * (RAMP - ambient)
    inputs = inputs_of(reading, ambient_temperature=ambient)
    np.testing.assert_allclose(applied("contact_error", [beta / (1 - beta)], inputs)["force"], force(RAMP))


def test_a_load_moves_the_midpoint() -> None:
    out = applied("stress_shift", [4.0], inputs_of(RAMP, load=np.full(RAMP.size, 2.5)))
    np.testing.assert_allclose(out["force"], force(RAMP - 10.0))
    np.testing.assert_allclose(out["displacement"], stroke(RAMP - 10.0))


@pytest.mark.parametrize("c", [0.1, 2.0, 8.0, 30.0])
def test_the_path_shift_is_that_of_its_own_force(c: float) -> None:
    """``F = f(T - c F)`` holds, so the temperature of each force is that of the plain curve plus c F."""
    f = np.linspace(1.05, 2.95, 40)
    temperature = B3 + np.log((f - B4) / (B4 + B1 - f)) / B2 + c * f
    order = np.argsort(temperature)
    out = applied("path_stress_shift", [c], inputs_of(temperature[order]))
    np.testing.assert_allclose(out["force"], f[order], atol=1e-6 * B1)


def test_a_fast_transformation_comes_late_on_both_branches() -> None:
    for branch, (size, rate, middle, offset) in ((1.0, HEATING[4:]), (-1.0, COOLING[4:])):
        temperature = RAMP[:: int(branch)]
        inputs = inputs_of(
            temperature, branch, rate=np.full(RAMP.size, branch * 4.0), typical_rate=np.full(RAMP.size, 0.5)
        )
        late = temperature - branch * 1.5 * (4.0 / 0.5) ** 0.5
        out = applied("rate_dependence", [1.5, 0.5], inputs)
        np.testing.assert_allclose(out["force"], offset + size * expit(rate * (late - middle)))


def test_a_gradient_averages_along_the_spring() -> None:
    out = applied("temperature_gradient", [0.2, 1e-4], inputs_of(RAMP))
    for t, value in zip(RAMP[::25], out["force"][::25], strict=True):
        mean = quad(lambda x, t=t: float(force(np.array(t - 0.2 * (t - ROOM) * x**2))), 0.0, 1.0)[0]
        assert value == pytest.approx(mean, abs=2e-4 * B1)


def test_a_gradient_takes_its_time() -> None:
    """After a jump of the middle the ends are not cooler yet, and the curve is the plain one at first."""
    jump = inputs_of(np.r_[ROOM, np.full(200, B3)])
    late, at_once = (applied("temperature_gradient", [0.2, tau], jump)["force"] for tau in (20.0, 1e-3))
    plain = float(force(np.array(B3)))
    assert plain - late[1] < 0.1 * (plain - at_once[-1])
    assert late[-1] == pytest.approx(at_once[-1], rel=1e-3)


def test_richards_curve() -> None:
    out = applied("asymmetric_kinetics", [np.log(1.7), 0.0], inputs_of(RAMP))
    np.testing.assert_allclose(out["force"], B4 + B1 * expit(B2 * (RAMP - B3)) ** 1.7, rtol=1e-9)
    cooling = applied("asymmetric_kinetics", [np.log(1.7), 0.0], inputs_of(RAMP[::-1], -1.0))
    np.testing.assert_allclose(cooling["force"], response_at(THETA)(inputs_of(RAMP[::-1], -1.0))["force"])


def test_the_r_phase_has_its_share() -> None:
    """Between the two steps the share p of the span is done, and the whole is as before."""
    out = applied("r_phase", [0.15, 25.0, 0.5], inputs_of(np.array([-10.0, 33.0, 200.0])))
    np.testing.assert_allclose((out["displacement"] - A4) / A1, [0.0, 0.15, 1.0], atol=2e-3)


def test_the_r_phase_comes_back_a_little_colder() -> None:
    half = {}
    for branch in (1.0, -1.0):
        inputs = inputs_of(np.linspace(-10.0, 35.0, 4501), branch)
        out = applied("r_phase", [0.1, 15.0, 0.5], inputs)["displacement"]
        out = out - response_at(THETA)(inputs)["displacement"] * 0.9
        half[branch] = inputs["temperature"][np.argmin(np.abs(out - 0.5 * (out[0] + out[-1])))]
    assert half[1.0] - half[-1.0] == pytest.approx(3.0, abs=0.05)


def test_training_levels_off() -> None:
    cycle = np.array([1.0, 2.0, 11.0, 400.0])
    inputs = inputs_of(np.full(4, 80.0), cycle=cycle, last_cycle=np.full(4, 11.0))
    change = applied("training_drift", [2e-3, 10.0], inputs)["displacement"] - stroke(np.array(80.0))
    trained = 2e-3 / (1 - np.exp(-1))
    np.testing.assert_allclose(change, [0.0, trained * (1 - np.exp(-0.1)), 2e-3, trained], atol=1e-12)


@pytest.mark.parametrize(("branch", "at"), [(1.0, HEATING), (-1.0, COOLING)])
def test_training_moves_offset_stroke_and_temperature_of_each_branch_at_one_pace(
    branch: float, at: Floats
) -> None:
    span, rate, midpoint, low = at[:4]
    cycle, temperature = np.array([1.0, 3.0, 3.0, 11.0]), np.array([40.0, 52.0, 58.0, 45.0])
    inputs = inputs_of(temperature, branch, cycle=cycle, last_cycle=np.full(4, 11.0))
    drift, pace = 2e-3, 5.0
    out = applied("training", [drift, 150.0, -100.0, -4e3, 1.5e3, pace], inputs)
    drifted = drift * (1.0 - np.exp(-(cycle - 1.0) / pace)) / (1.0 - np.exp(-10.0 / pace))
    k, m = (150.0, -4e3) if branch > 0.0 else (-100.0, 1.5e3)
    transformed = span * expit(rate * (temperature - m * drifted - midpoint))
    np.testing.assert_allclose(
        out["displacement"], low + (1.0 + k * drifted) * transformed + drifted, rtol=1e-9
    )


def test_a_load_stretches_the_cold_end_and_leaves_the_hot_one() -> None:
    for load in (0.0, 2.0):
        inputs = inputs_of(np.array([-100.0, 55.0, 300.0]), load=np.full(3, load))
        out, plain = applied("stress_stroke", [0.25], inputs), response_at(THETA)(inputs)
        grown = 1.0 + 0.25 * load
        hot = A4 + A1
        np.testing.assert_allclose(
            out["displacement"], hot - grown * (hot - plain["displacement"]), rtol=1e-9
        )
        np.testing.assert_allclose(out["displacement"][[0, 2]], [hot - grown * A1, hot], rtol=1e-6)
        np.testing.assert_allclose(out["force"], plain["force"])
        np.testing.assert_allclose(out["stiffness"][1], plain["stiffness"][1] / grown)


@pytest.mark.parametrize(("load", "share", "more"), [(1.5, 1.0, 0.5), (0.5, 1.0, -0.5), (1.5, -0.4, -0.2)])
def test_a_load_that_the_cell_carries_is_in_the_force_and_in_nothing_else(
    load: float, share: float, more: float
) -> None:
    """Whatever hangs there at rest pulls as much hot as cold, so that force alone moves, and dF/dX is as before."""
    hung = {"load": np.full(RAMP.size, load), "typical_load": np.full(RAMP.size, 1.0)}
    out = applied("dead_load", [share], inputs_of(RAMP, **hung))
    np.testing.assert_allclose(out["force"], PLAIN["force"] + more)
    for channel in ("displacement", "stiffness"):
        np.testing.assert_array_equal(out[channel], PLAIN[channel])


def test_fatigue_leaves_the_cold_end() -> None:
    inputs = inputs_of(np.array([-100.0, 300.0]), cycle=np.full(2, 51.0))
    out = applied("amplitude_fatigue", [0.002], inputs)
    np.testing.assert_allclose(out["displacement"], [A4, A4 + 0.9 * A1])
    np.testing.assert_allclose(out["force"], [B4, B4 + B1])


def test_creep_at_a_constant_temperature_and_over_a_break() -> None:
    time = np.array([0.0, 10.0, 20.0, 500.0, 510.0])
    inputs = inputs_of(np.full(5, 114.0), time=time, stretch=np.array([0.0, 0.0, 0.0, 1.0, 1.0]))
    crept = applied("hot_creep", [1e-6, 14.0], inputs)["displacement"] - stroke(np.array(114.0))
    np.testing.assert_allclose(crept, 1e-6 * np.e * np.array([0.0, 10.0, 20.0, 20.0, 30.0]), rtol=1e-9)


def test_friction_turns_round_over_its_way() -> None:
    """After a reversal it goes from one side to the other as exp(-way/x0)."""
    both = inputs_of(np.concatenate([RAMP, RAMP[::-1]]))
    way = 2e-4
    friction = applied("guide_friction", [0.03, way], both)["force"] - response_at(THETA)(both)["force"]
    assert friction[RAMP.size - 1] == pytest.approx(0.03, rel=1e-3)
    back = np.abs(PLAIN["displacement"][-1] - PLAIN["displacement"][::-1])
    expected = 0.03 * (2.0 * np.exp(-back / way) - 1.0)
    np.testing.assert_allclose(friction[RAMP.size :], expected, atol=1e-3)


def test_friction_of_a_guide_has_two_limits() -> None:
    """Without a creep speed it is Dahl's law of the way; of no way it is Coulomb's, smooth near rest."""
    both = inputs_of(np.concatenate([RAMP, RAMP[::-1]]))
    plain = response_at(THETA)(both)
    by_way = applied("guide_friction", [0.03, 2e-4], both)["force"]
    np.testing.assert_allclose(
        applied("guide_friction", [0.03, 2e-4, 1e-15], both)["force"], by_way, atol=1e-9
    )
    speed = np.diff(plain["displacement"], prepend=plain["displacement"][:1])
    slow = 0.05 * float(np.abs(speed).max())
    friction = applied("guide_friction", [0.03, 1e-12, slow], both)["force"] - plain["force"]
    np.testing.assert_allclose(friction[1:], 0.03 * np.tanh(speed[1:] / slow), atol=1e-6)
    assert abs(friction[RAMP.size - 1]) < 1e-3 < np.abs(friction).max()


def test_a_load_cell_follows_a_step_of_the_ambient() -> None:
    time = np.linspace(0.0, 600.0, 601)
    ambient = np.where(time < 0.5, 20.0, 25.0)
    inputs = inputs_of(np.full(601, 30.0), time=time, ambient_temperature=ambient)
    drift = applied("load_cell_thermal_drift", [0.002, 100.0, 1e-9], inputs)["force"]
    expected = 0.01 * (1.0 - np.exp(-(time - 0.5) / 100.0))
    np.testing.assert_allclose((drift - drift[0])[2:], expected[2:], atol=1e-5)


def test_a_load_cell_without_ambient_follows_the_alloy() -> None:
    inputs = inputs_of(np.r_[30.0, np.full(400, 90.0)])
    inputs["rate"] = np.zeros(401)
    change = applied("load_cell_thermal_drift", [0.002, 50.0, 0.2], inputs)["force"][-1]
    assert change - force(np.array(90.0)) == pytest.approx(0.002 * 0.2 * (90.0 - ROOM), rel=1e-2)


def test_both_phases_expand() -> None:
    inputs = inputs_of(np.array([-210.0, -200.0, 300.0, 310.0]))
    grown = applied("thermal_expansion", [1e-6], inputs)["displacement"]
    cold, hot = grown[1] - grown[0], grown[3] - grown[2]
    assert hot == pytest.approx(1e-5, rel=1e-6)
    assert cold == pytest.approx(0.6e-5, rel=1e-6)


def test_a_rig_stretches_and_softens() -> None:
    out = applied("fixture_compliance", [1e-3], inputs_of(RAMP))
    np.testing.assert_allclose(out["displacement"], PLAIN["displacement"] + PLAIN["force"] / 1000.0)
    np.testing.assert_allclose(1.0 / out["stiffness"], 1.0 / PLAIN["stiffness"] + 1.0 / 1000.0)
    np.testing.assert_allclose(out["force"], PLAIN["force"])


def test_a_bias_spring_stands_beside() -> None:
    out = applied("bias_spring", [130.0], inputs_of(RAMP))
    np.testing.assert_allclose(out["force"] - PLAIN["force"], 130.0 * PLAIN["displacement"])
    np.testing.assert_allclose(out["stiffness"] - PLAIN["stiffness"], 130.0)


def test_saturation_cuts() -> None:
    np.testing.assert_allclose(
        applied("saturation", [1.0, 2.4], inputs_of(RAMP))["force"], np.minimum(PLAIN["force"], 2.4)
    )


@pytest.mark.parametrize("noise", [0.1, 0.25, 0.5])
def test_rounding_has_the_mean_of_rounded_draws(noise: float) -> None:
    rng = np.random.default_rng(3)
    mean = np.linspace(0.0, 0.5, 11)
    draws = mean + 0.2 * noise * rng.standard_normal((200_000, 1))
    rounded = 0.03 + 0.2 * np.round((draws - 0.03) / 0.2)
    expected = steps(mean, np.array(0.2), np.array(0.03), np.array(noise))
    np.testing.assert_allclose(expected, rounded.mean(axis=0) - mean, atol=1.5e-3)


def test_a_whole_harmonic_is_one_sine() -> None:
    inputs = inputs_of(RAMP, frequency=np.full(RAMP.size, 0.03))
    ripple = applied("drive_ripple", [0.05, 0.4, 3.0, 0.0, 0.0], inputs)["force"] - PLAIN["force"]
    np.testing.assert_allclose(ripple, 0.05 * np.sin(2 * np.pi * 3 * 0.03 * inputs["time"] + 0.4), atol=1e-12)


def test_between_whole_harmonics_they_are_mixed() -> None:
    inputs = inputs_of(RAMP, frequency=np.full(RAMP.size, 0.03))
    first, mixed, second = (
        applied("drive_ripple", [0.05, 0.0, k, 0.0, 0.0], inputs)["force"] - PLAIN["force"]
        for k in (1.0, 1.5, 2.0)
    )
    np.testing.assert_allclose(mixed, 0.5 * (first + second), atol=1e-12)


def test_the_overtone_of_a_ripple_has_its_own_phase() -> None:
    inputs = inputs_of(RAMP, frequency=np.full(RAMP.size, 0.03))
    ripple = applied("drive_ripple", [0.05, 0.4, 3.0, 0.3, -0.2], inputs)["force"] - PLAIN["force"]
    u = 2 * np.pi * 3 * 0.03 * inputs["time"] + 0.4
    overtone = np.hypot(0.3, 0.2) * np.sin(2 * u + np.arctan2(-0.2, 0.3))
    np.testing.assert_allclose(ripple, 0.05 * (np.sin(u) + overtone), atol=1e-12)


def turned_at(peak: float) -> tuple[dict[str, Floats], int]:
    up = np.linspace(0.0, peak, 300)
    temperature = np.r_[up, up[::-1]]
    branch = np.r_[np.ones(300), -np.ones(300)]
    return inputs_of(temperature, **{"branch": branch, "segment": (branch < 0) * 1.0}), 300  # type: ignore[arg-type]


def test_a_branch_starts_from_the_share_reached() -> None:
    inputs, turn = turned_at(62.0)
    out = applied("minor_loop", [1.0], inputs)
    reached = expit(A2 * (62.0 - A3))
    cold, span = COOLING[3], COOLING[0]
    assert (out["displacement"][turn] - cold) / span == pytest.approx(reached, rel=1e-9)
    major = expit(COOLING[1] * (inputs["temperature"][turn:] - COOLING[2]))
    np.testing.assert_allclose(
        (out["displacement"][turn:] - cold) / span, major * reached / major[0], rtol=1e-9
    )


def test_heating_starts_from_what_the_cooling_left() -> None:
    down = np.linspace(160.0, 50.0, 300)
    branch = np.r_[-np.ones(300), np.ones(300)]
    inputs = inputs_of(np.r_[down, down[::-1]], **{"branch": branch, "segment": (branch > 0) * 1.0})  # type: ignore[arg-type]
    share = (applied("minor_loop", [1.0], inputs)["displacement"][300:] - A4) / A1
    kept = expit(COOLING[1] * (50.0 - COOLING[2]))
    major = expit(A2 * (down[::-1] - A3))
    assert share[0] == pytest.approx(kept, rel=1e-6)
    np.testing.assert_allclose(
        1.0 - share, (1.0 - major) * (1.0 - kept) / (1.0 - major[0]), rtol=1e-4, atol=1e-9
    )


def test_a_complete_loop_is_left_alone() -> None:
    inputs, _ = turned_at(160.0)
    plain = response_at(THETA)(inputs)
    out = applied("minor_loop", [1.0], inputs)
    np.testing.assert_allclose(out["force"], plain["force"], atol=1e-8)


def test_skew_is_a_later_force_only() -> None:
    inputs = inputs_of(RAMP)
    out = applied("clock_skew", [0.8], inputs)
    np.testing.assert_allclose(out["force"], force(RAMP + 0.8 * 0.5))
    np.testing.assert_allclose(out["displacement"], PLAIN["displacement"])


def test_latent_heat_slows_the_heating() -> None:
    """The balance with the heat of transformation, integrated in time, is what the effect gives back."""
    gain, loss, ambient, _ = THERMAL
    time = np.linspace(0.0, 60.0, 1201)

    def balance(t: float, y: Floats) -> Floats:
        share = expit(A2 * (y - A3))
        return (4.0 * gain - loss * (y - ambient)) / (1.0 + 20.0 * A2 * share * (1.0 - share))

    measured = solve_ivp(balance, (0.0, 60.0), [22.0], t_eval=time, rtol=1e-9).y[0]
    inputs = inputs_of(measured, time=time, share=expit(A2 * (measured - A3)))
    plain = response_at(THETA)(inputs)["temperature"]
    assert np.max(np.abs(plain - measured)) > 5.0
    out = applied("latent_heat", [20.0 * 500.0], inputs)
    np.testing.assert_allclose(out["temperature"], measured, atol=0.1)


def test_a_draught_changes_the_cooling() -> None:
    """In the colder half of a record the loss is greater, so that the alloy settles nearer to the room."""
    gain, loss, *_ = THERMAL
    ambient = np.r_[np.full(400, 23.0), np.full(400, 21.0)]
    inputs = inputs_of(np.full(800, 60.0), time=np.linspace(0.0, 400.0, 800), ambient_temperature=ambient)
    out = applied("ambient_draught", [0.3], inputs)["temperature"]
    assert out[398] == pytest.approx(23.0 + 4.0 * gain / (loss * np.exp(-0.3)), rel=1e-3)
    assert out[-1] == pytest.approx(21.0 + 4.0 * gain / (loss * np.exp(0.3)), rel=1e-3)


def test_what_is_usual_in_a_room_need_not_be_its_median() -> None:
    """Where the loss is shared, a condition whose room is usually 1.5 K warmer than its median has more draught."""
    gain, loss, *_ = THERMAL
    inputs = inputs_of(
        np.full(800, 60.0), time=np.linspace(0.0, 400.0, 800), ambient_temperature=np.full(800, 23.0)
    )
    for run, warmer in enumerate((0.0, 1.5)):
        out = applied("ambient_draught", [0.3, 0.0, 1.5], {**inputs, "run": np.full(800, float(run))})
        settled = 23.0 + 4.0 * gain / (loss * np.exp(0.3 * warmer))
        assert out["temperature"][-1] == pytest.approx(settled, rel=1e-3)
