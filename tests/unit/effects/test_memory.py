"""First-order lags along a history."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from sma_bayes.effects.memory import MEMORY_TIME_CONSTANTS, elapsed, lagged


@pytest.mark.parametrize("tau", [0.01, 0.7, 20.0, 5000.0])
def test_it_is_the_solution_of_its_differential_equation(tau: float) -> None:
    rng = np.random.default_rng(1)
    time = np.cumsum(rng.uniform(0.1, 2.0, 150))
    source = np.sin(time / 5.0)
    found = lagged(source, np.diff(time, prepend=time[0]) / tau)
    y, expected = source[0], [source[0]]
    for i in range(1, time.size):
        span = (time[i - 1], time[i])
        y = solve_ivp(
            lambda t, v, i=i: (np.interp(t, time, source) - v) / tau, span, [y], rtol=1e-9, atol=1e-11,
            method="Radau",
        ).y[0, -1]  # fmt: skip
        expected.append(y)
    np.testing.assert_allclose(found, expected, atol=1e-6)


def test_breaks_hold_or_forget() -> None:
    source = np.array([0.0, 1.0, 1.0, 5.0, 5.0])
    held = lagged(source, np.array([0.0, 1.0, 1.0, 0.0, 1.0]))
    assert held[3] == pytest.approx(held[2])
    assert lagged(source, np.array([0.0, 1.0, 1.0, MEMORY_TIME_CONSTANTS, 1.0]))[3] == pytest.approx(
        5.0, abs=1e-5
    )


def test_a_batch_of_time_constants() -> None:
    source, steps = np.cos(np.arange(3000.0) / 40.0), np.ones(3000)
    tau = np.array([[0.05], [3.0], [900.0]])
    together = lagged(source, steps / tau)
    for row, t in zip(together, tau[:, 0], strict=True):
        np.testing.assert_allclose(row, lagged(source, steps / t), atol=1e-12)


def test_elapsed_starts_anew_with_each_stretch() -> None:
    inputs = {"time": np.array([0.0, 2.0, 50.0, 51.0]), "stretch": np.array([0.0, 0.0, 1.0, 1.0])}
    np.testing.assert_allclose(elapsed(inputs), [0.0, 2.0, 0.0, 1.0])
