"""Both branches and the heat balance along one history, against the equations sample by sample."""

from __future__ import annotations

import numpy as np
import pytest

from sma_bayes.arrays import Floats
from sma_bayes.response.both_branches import BothBranches
from sma_bayes.response.joule_heating import JouleHeating
from sma_bayes.response.modified_sigmoid import ModifiedSigmoid
from sma_bayes.response.simulation import Simulation

HEATING = (0.02, 0.30, 62.0, 0.01, 2.0, 0.25, 65.0, 1.0)
COOLING = (0.025, 0.28, 50.0, 0.012, 1.8, 0.22, 54.0, 0.8)
THERMAL = (2.0, 0.1, 22.0, 0.7)
THETA = np.array([*HEATING, *COOLING])
ALL = ("force", "displacement", "stiffness")


@pytest.fixture(scope="module")
def applied() -> dict[str, Floats]:
    up = np.linspace(30.0, 90.0, 25)
    temperature = np.concatenate([up, up[::-1], up])
    return {
        "temperature": temperature,
        "branch": np.repeat([1.0, -1.0, 1.0], 25),
        "time": np.arange(75.0),
        "current": np.repeat([2.0, 0.0, 2.0], 25),
        "stretch": np.zeros(75),
    }


def sample(channel: str, t: float, p: tuple[float, ...]) -> float:
    """Eqs. (2) and (4); the stiffness as the slope of one over the slope of the other."""
    a1, a2, a3, a4, b1, b2, b3, b4 = p

    def x(t: float) -> float:
        return a4 + a1 / (1.0 + np.exp(-a2 * (t - a3)))

    def f(t: float) -> float:
        return b4 + b1 / (1.0 + np.exp(-b2 * (t - b3)))

    h = 1e-4
    values = {"displacement": x(t), "force": f(t), "stiffness": (f(t + h) - f(t - h)) / (x(t + h) - x(t - h))}
    return values[channel]


@pytest.mark.parametrize("channel", ALL)
def test_each_sample_is_on_the_curve_of_its_branch(channel: str, applied: dict[str, Floats]) -> None:
    found = BothBranches(ModifiedSigmoid(ALL)).predict(THETA, applied)[channel]
    exact = [
        sample(channel, t, HEATING if b > 0.0 else COOLING)
        for t, b in zip(applied["temperature"], applied["branch"], strict=True)
    ]
    np.testing.assert_allclose(found, exact, rtol=1e-12 if channel != "stiffness" else 1e-5)


def test_a_batch_of_parameters_and_of_temperatures(applied: dict[str, Floats]) -> None:
    model = BothBranches(ModifiedSigmoid(ALL))
    theta = THETA * np.random.default_rng(0).uniform(0.95, 1.05, (4, 16))
    warmer = applied["temperature"] + np.arange(4.0)[:, None]
    batch = model.predict(theta, {**applied, "temperature": warmer})
    for k in range(4):
        alone = model.predict(theta[k], {**applied, "temperature": warmer[k]})
        for channel in ALL:
            np.testing.assert_allclose(batch[channel][k], alone[channel], rtol=1e-12)
    one = {name: values[applied["branch"] > 0.0] for name, values in applied.items()}
    changed = np.concatenate([theta[:, :8], 2.0 * theta[:, 8:]], axis=1)
    for channel, values in model.predict(theta, one).items():
        np.testing.assert_array_equal(values, model.predict(changed, one)[channel])


def test_all_together_are_the_parts(applied: dict[str, Floats]) -> None:
    model = Simulation((*ALL, "temperature"))
    found = model.predict(np.array([*THETA, *THERMAL]), applied)
    assert tuple(found) == (*ALL, "temperature")
    for channel, values in BothBranches(ModifiedSigmoid(ALL)).predict(THETA, applied).items():
        np.testing.assert_array_equal(found[channel], values)
    warmed = JouleHeating().predict(np.array(THERMAL), applied)["temperature"]
    np.testing.assert_array_equal(found["temperature"], warmed)


@pytest.mark.parametrize(
    ("channels", "count"),
    [
        (("force",), 8),
        (("displacement", "temperature"), 12),
        (("stiffness",), 12),
        (("temperature",), 4),
        (ALL, 16),
    ],
)
def test_only_what_the_channels_need_is_a_parameter(
    channels: tuple[str, ...], count: int, applied: dict[str, Floats]
) -> None:
    model = Simulation(channels)
    assert len(model.parameter_names) == len(set(model.parameter_names)) == count
    known = dict(zip(Simulation((*ALL, "temperature")).parameter_names, (*THETA, *THERMAL), strict=True))
    theta = np.array([known[name] for name in model.parameter_names])
    found = model.predict(theta, applied)
    whole = Simulation((*ALL, "temperature")).predict(np.array([*THETA, *THERMAL]), applied)
    assert tuple(found) == channels
    for channel in channels:
        np.testing.assert_allclose(found[channel], whole[channel], rtol=1e-12)
