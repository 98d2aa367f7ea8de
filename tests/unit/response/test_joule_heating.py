"""Temperature from current against scipy's integrator, step by step of a stepwise current."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from sma_bayes.arrays import Floats
from sma_bayes.records.drive import DELIVERED, delivered
from sma_bayes.response.joule_heating import JouleHeating

GAIN, LOSS, AMBIENT = 3.0, 0.15, 21.0
THETA = np.array([GAIN, LOSS, AMBIENT, 1.0])
N = 120


def integrated(v: Mapping[str, Floats], theta: Floats) -> Floats:
    """``m c dT/dt = I**2 R - h A (T - Ta)`` by solve_ivp, step by step; anew with every stretch.

    What else is applied changes from sample to sample by half of it at either end.
    """
    gain, loss, ambient, switching = theta
    out = np.empty(N)
    for i in range(N):
        if i == 0 or v["stretch"][i] != v["stretch"][i - 1]:
            out[i] = v["temperature"][i]
            continue

        def mean(name: str, other: float, i=i) -> float:
            return 0.5 * (v[name][i - 1] + v[name][i]) if name in v else other

        room, capacity = mean("ambient_temperature", ambient), mean("heat_capacity_factor", 1.0)
        lost, resistance = loss * mean("loss_factor", 1.0), gain * mean("resistance_factor", 1.0)
        dt = v["time"][i] - v["time"][i - 1]
        taken = (v["heat_taken"][i] - v["heat_taken"][i - 1]) / dt if "heat_taken" in v else 0.0
        power = switching * v["current"][i - 1] ** 2 + (1.0 - switching) * v["current"][i] ** 2

        def rate(
            t, y, power=power, room=room, capacity=capacity, lost=lost, resistance=resistance, taken=taken
        ):
            return (resistance * power - taken - lost * (y - room)) / capacity

        solved = solve_ivp(rate, (0.0, dt), [out[i - 1]], method="DOP853", rtol=1e-11, atol=1e-10)
        out[i] = solved.y[0, -1]
    return out


@pytest.fixture(scope="module")
def applied() -> dict[str, Floats]:
    """A current that is switched at irregular times, and a break of half an hour."""
    rng = np.random.default_rng(0)
    time = np.cumsum(rng.uniform(0.1, 2.0, N))
    time[70:] += 1800.0
    reading = 40.0 + 5.0 * rng.standard_normal(N)
    return {
        "time": time,
        "current": np.repeat([0.0, 2.0, 0.5, 3.0, 0.0, 1.0], 20),
        "stretch": (np.arange(N) >= 70).astype(float),
        "temperature": reading,
    }


@pytest.mark.parametrize("switching", [0.0, 0.3, 1.0])
@pytest.mark.parametrize(
    "more",
    [
        (),
        ("ambient_temperature",),
        ("heat_capacity_factor", "loss_factor"),
        ("resistance_factor", "heat_taken"),
    ],
)
def test_it_is_the_solution_of_the_heat_balance(
    more: tuple[str, ...], switching: float, applied: dict[str, Floats]
) -> None:
    rng = np.random.default_rng(1)
    whole = {
        "ambient_temperature": 21.0 + 3.0 * np.sin(applied["time"] / 20.0),
        "heat_capacity_factor": rng.uniform(0.8, 3.0, N),
        "loss_factor": rng.uniform(0.5, 2.0, N),
        "resistance_factor": rng.uniform(0.8, 1.2, N),
        "heat_taken": np.cumsum(rng.uniform(-1.0, 2.0, N)),
    }
    v = applied | {name: whole[name] for name in more}
    theta = np.array([GAIN, LOSS, AMBIENT, switching])
    exact = integrated(v, theta)
    found = JouleHeating().predict(theta, {**v, "temperature": exact})["temperature"]
    np.testing.assert_allclose(found, exact, atol=1e-6)


def least_missed(dt: float) -> float:
    """What a heat that comes in the later half of a step is off by at its end where it is spread over all of it, K."""
    return GAIN * 4.0 * dt * LOSS * dt / 8.0


@pytest.mark.parametrize("share", [-0.4, 0.0, 0.25, 0.8, 1.0, 1.3])
def test_a_current_that_is_switched_between_two_samples(share: float) -> None:
    """Integrated from switching to switching; the balance spreads the heat of a step over it, so to second order."""
    time = np.arange(0.0, 60.0, 0.5)
    at = np.array([10, 50, 90])
    logged = 2.0 * (np.searchsorted(at, np.arange(time.size), side="right") % 2)
    turned = time[at] + 0.5 * (share - 1.0)  # a share of the step before the reading that shows it

    def rate(t, y, power):
        return GAIN * power - LOSS * (y - AMBIENT)

    exact, edges = np.empty(time.size), [0.0, *turned, time[-1]]
    start = [AMBIENT]
    for k, (low, high) in enumerate(pairwise(edges)):
        on = (time >= low) & (time <= high)
        solved = solve_ivp(
            rate, (low, high), start, t_eval=time[on], args=(4.0 * (k % 2),), rtol=1e-11, atol=1e-10
        )
        exact[on] = solved.y[0]
        start = [solve_ivp(rate, (low, high), start, args=(4.0 * (k % 2),), rtol=1e-11, atol=1e-10).y[0, -1]]
    v = {"time": time, "current": logged, "stretch": np.zeros(time.size), "temperature": exact}
    found = JouleHeating().predict(np.array([GAIN, LOSS, AMBIENT, share]), v)["temperature"]
    assert np.max(np.abs(found - exact)) < 1.01 * least_missed(0.5)
    other = JouleHeating().predict(np.array([GAIN, LOSS, AMBIENT, share - 0.1]), v)["temperature"]
    assert np.max(np.abs(other - exact)) > 0.3


@pytest.mark.parametrize("size", [2, 3, 5])
def test_averages_over_rows_keep_what_the_current_delivered(size: int) -> None:
    """A switching within a block of rows that are averaged: the integral is averaged, not the current."""
    time = np.arange(0.0, 60.0, 0.1)
    current = np.where((time >= 10.1) & (time < 32.3), 2.0, 0.0)
    v = {
        "time": time,
        "current": current,
        "stretch": np.zeros(time.size),
        "temperature": np.full(time.size, AMBIENT),
    }
    fine = JouleHeating().predict(THETA, v)["temperature"]

    def averaged(x: Floats) -> Floats:
        return x.reshape(-1, size).mean(axis=1)

    blocks = {
        name: averaged(x) for name, x in {**v, **delivered(time, current**2), "temperature": fine}.items()
    }
    found = JouleHeating().predict(THETA, blocks)["temperature"]
    np.testing.assert_allclose(found, averaged(fine), atol=1.01 * least_missed(0.1 * size))
    lost = {name: x for name, x in blocks.items() if name not in DELIVERED}
    without = JouleHeating().predict(THETA, lost)["temperature"]
    assert np.max(np.abs(without - averaged(fine))) > 0.4


def test_a_stretch_starts_where_least_squares_put_it(applied: dict[str, Floats]) -> None:
    """Against a regression of each stretch on the decay of its start, which is a straight line in it."""
    found = JouleHeating().predict(THETA, applied)["temperature"]
    zero = np.zeros(N)
    zero[[0, 70]] = 100.0
    exact = integrated({**applied, "temperature": zero}, THETA)
    for part in (slice(0, 70), slice(70, N)):
        time = applied["time"][part]
        decay = np.exp(-LOSS * (time - time[0]))
        left = applied["temperature"][part] - exact[part]
        start = 100.0 + np.linalg.lstsq(decay[:, None], left, rcond=None)[0][0]
        np.testing.assert_allclose(found[part], exact[part] + decay * (start - 100.0), atol=1e-6)


def _pulses(tau: float, hold: bool) -> tuple[dict[str, Floats], Floats]:
    """Ten heatings and coolings, each a stretch; what a sensor with a time constant reads, by solve_ivp.

    The sensor has settled before each of them, or follows at its distance (`hold` false) from a start 60 s before.
    """
    time, current, stretch, read = [], [], [], []
    for k in range(20):
        power = 4.0 * GAIN if k % 2 == 0 else 0.0
        begin = AMBIENT if k % 2 == 0 else AMBIENT + 4.0 * GAIN / LOSS
        end = AMBIENT + power / LOSS

        t = np.arange(20.0) + 0.5 * k
        if hold:

            def both(t: float, y: Floats, power: float = power) -> list[float]:
                return [power - LOSS * (y[0] - AMBIENT), (y[0] - y[1]) / tau]

            solved = solve_ivp(both, (0.0, 20.0), [begin, begin], t_eval=t - t[0], rtol=1e-10, atol=1e-9)
            read.append(solved.y[1])
        else:  # without what fades with the sensor
            read.append(end + (begin - end) * np.exp(-LOSS * t) / (1.0 - LOSS * tau))
        time.append(t + 100.0 * k)
        current.append(np.full(t.size, np.sqrt(power / GAIN)))
        stretch.append(np.full(t.size, float(k)))
    names = {"time": time, "current": current, "stretch": stretch}
    return {name: np.concatenate(v) for name, v in names.items()}, np.concatenate(read)


@pytest.mark.parametrize("hold", [True, False])
@pytest.mark.parametrize("tau", [0.4, 1.5, 4.0])
def test_a_sensor_that_lags_has_settled_at_the_start_of_a_stretch_or_follows(tau: float, hold: bool) -> None:
    inputs, read = _pulses(tau, hold)
    lagging = {**inputs, "temperature": read, "sensor_lag": np.array([tau])}
    np.testing.assert_allclose(JouleHeating().predict(THETA, lagging)["temperature"], read, atol=2e-4)


def test_what_a_sensor_lags_at_the_starts_is_two_free_numbers_and_not_twenty() -> None:
    """Of a sensor that does not lag a time constant of 5 s takes noise of two degrees of freedom, one-sided, in 400.

    Twenty free starts would take 20. The mean of 60 repeats has a standard error below 0.3.
    """
    inputs, read = _pulses(1e-6, hold=False)
    rng, taken = np.random.default_rng(1), []
    for _ in range(60):
        noisy = {**inputs, "temperature": read + 0.05 * rng.standard_normal(read.size)}
        plain, lagging = (
            np.sum((JouleHeating().predict(THETA, v)["temperature"] - noisy["temperature"]) ** 2) / 0.05**2
            for v in (noisy, {**noisy, "sensor_lag": np.array([5.0])})
        )
        taken.append(plain - lagging)
    assert np.mean(taken) < 2.0


def test_a_stretch_says_nothing_of_another(applied: dict[str, Floats]) -> None:
    plain = JouleHeating().predict(THETA, applied)["temperature"]
    other = applied["temperature"].copy()
    other[70:] += 10.0
    moved = JouleHeating().predict(THETA, {**applied, "temperature": other})["temperature"] - plain
    np.testing.assert_array_equal(moved[:70], 0.0)
    assert moved[70] > 1.0


def test_at_rest_it_is_where_heat_and_loss_balance(applied: dict[str, Floats]) -> None:
    v = {**applied, "time": 1e3 * np.arange(N), "current": np.full(N, 2.0), "stretch": np.zeros(N)}
    found = JouleHeating().predict(THETA, v)["temperature"]
    np.testing.assert_allclose(found[1:], AMBIENT + GAIN * 4.0 / LOSS, rtol=1e-12)


def test_a_wire_that_loses_nothing_warms_evenly(applied: dict[str, Floats]) -> None:
    theta = np.array([GAIN, 1e-9, AMBIENT, 1.0])
    v = {**applied, "stretch": np.zeros(N), "current": np.full(N, 2.0)}
    found = JouleHeating().predict(theta, v)["temperature"]
    np.testing.assert_allclose(found - found[0], GAIN * 4.0 * (v["time"] - v["time"][0]), rtol=1e-5)
    assert found.mean() == pytest.approx(v["temperature"].mean(), abs=0.05)


def test_a_batch_is_its_members(applied: dict[str, Floats]) -> None:
    rng = np.random.default_rng(2)
    theta = THETA * rng.uniform(0.5, 1.0, (3, 2, 4))
    batch = JouleHeating().predict(theta, applied)["temperature"]
    assert batch.shape == (3, 2, N)
    for at in np.ndindex(3, 2):
        alone = JouleHeating().predict(theta[at], applied)["temperature"]
        np.testing.assert_allclose(batch[at], alone, rtol=1e-13)
    currents = {**applied, "current": applied["current"] * np.array([[1.0], [0.7]])}
    many = JouleHeating().predict(theta[0], currents)["temperature"]
    one = JouleHeating().predict(theta[0, 1], {**applied, "current": 0.7 * applied["current"]})["temperature"]
    np.testing.assert_allclose(many[1], one, rtol=1e-13)


def test_parameters_have_names_and_units() -> None:
    model = JouleHeating()
    assert tuple(p.name for p in model.parameters()) == model.parameter_names
    assert [p.unit for p in model.parameters()] == ["K/(s A^2)", "1/s", "degC", "1"]
