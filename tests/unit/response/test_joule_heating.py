"""Temperature from current against scipy's integrator, step by step of a stepwise current."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from sma_bayes.quantities import Floats
from sma_bayes.response.joule_heating import JouleHeating

GAIN, LOSS, AMBIENT = 3.0, 0.15, 21.0
THETA = np.array([GAIN, LOSS, AMBIENT])
N = 120


def integrated(v: Mapping[str, Floats], theta: Floats) -> Floats:
    """``m c dT/dt = I**2 R - h A (T - Ta)``, what is applied held over each step; anew with every stretch."""
    gain, loss, ambient = theta
    out = np.empty(N)
    for i in range(N):
        if i == 0 or v["stretch"][i] != v["stretch"][i - 1]:
            out[i] = v["temperature"][i]
            continue
        k = i - 1
        room = v["ambient_temperature"][k] if "ambient_temperature" in v else ambient
        capacity = v["heat_capacity_factor"][k] if "heat_capacity_factor" in v else 1.0
        loses = loss * (v["loss_factor"][k] if "loss_factor" in v else 1.0)

        def rate(t, y, k=k, room=room, capacity=capacity, loses=loses):
            return (gain * v["current"][k] ** 2 - loses * (y - room)) / capacity

        solved = solve_ivp(
            rate, (v["time"][k], v["time"][i]), [out[k]], method="DOP853", rtol=1e-11, atol=1e-10
        )
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


@pytest.mark.parametrize("more", [(), ("ambient_temperature",), ("heat_capacity_factor", "loss_factor")])
def test_it_is_the_solution_of_the_heat_balance(more: tuple[str, ...], applied: dict[str, Floats]) -> None:
    rng = np.random.default_rng(1)
    whole = {
        "ambient_temperature": 21.0 + 3.0 * np.sin(applied["time"] / 20.0),
        "heat_capacity_factor": rng.uniform(0.8, 3.0, N),
        "loss_factor": rng.uniform(0.5, 2.0, N),
    }
    v = applied | {name: whole[name] for name in more}
    exact = integrated(v, THETA)
    found = JouleHeating().predict(THETA, {**v, "temperature": exact})["temperature"]
    np.testing.assert_allclose(found, exact, atol=1e-6)


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
    theta = np.array([GAIN, 1e-9, AMBIENT])
    v = {**applied, "stretch": np.zeros(N), "current": np.full(N, 2.0)}
    found = JouleHeating().predict(theta, v)["temperature"]
    np.testing.assert_allclose(found - found[0], GAIN * 4.0 * (v["time"] - v["time"][0]), rtol=1e-5)
    assert found.mean() == pytest.approx(v["temperature"].mean(), abs=0.05)


def test_a_batch_is_its_members(applied: dict[str, Floats]) -> None:
    rng = np.random.default_rng(2)
    theta = THETA * rng.uniform(0.5, 1.5, (3, 2, 3))
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
    assert [p.unit for p in model.parameters()] == ["K/(s A^2)", "1/s", "degC"]
