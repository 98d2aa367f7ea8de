"""The baselines against the equations as the paper prints them, and against each other."""

from __future__ import annotations

import numpy as np
import pytest

from sma_bayes.paper.specifications import TEXT_VALUES, specification
from sma_bayes.records.types import Branch
from sma_bayes.response.bounded_logistic import BoundedLogistic
from sma_bayes.response.logistic import Logistic, printed_constants
from sma_bayes.response.modified_sigmoid import ModifiedSigmoid
from sma_bayes.response.polynomial import Polynomial, frequencies_of, least_squares
from sma_bayes.response.tied_sigmoid import TiedSigmoid

T = {"temperature": np.linspace(20.0, 120.0, 51)}
A_S, A_F, M_S, M_F = (specification(TEXT_VALUES, name, "degC") for name in ("As", "Af", "Ms", "Mf"))
K_MIN, K_MAX = 21.78, 159.07


def printed(start: float, finish: float, centre: float) -> np.ndarray:
    """Eqs. (9) and (10), term by term as printed."""
    rise = K_MAX - K_MIN
    return K_MIN + rise - rise / (1.0 + np.exp(6.2 / (finish - start) * (T["temperature"] - centre)))


@pytest.mark.parametrize(
    ("branch", "corrected", "expected"),
    [
        (Branch.HEATING, False, printed(A_S, A_F, (A_S - A_F) / 2)),
        (Branch.HEATING, True, printed(A_S, A_F, (A_S + A_F) / 2)),
        (Branch.COOLING, False, printed(M_F, M_S, (M_S + M_F) / 2)),
        (Branch.COOLING, True, printed(M_F, M_S, (M_S + M_F) / 2)),
    ],
)
def test_the_logistic_is_the_printed_equation(branch: Branch, corrected: bool, expected: np.ndarray) -> None:
    constants = printed_constants(branch, corrected=corrected)
    found = Logistic().predict(np.array([K_MIN, K_MAX, constants["centre"], constants["width"]]), T)
    np.testing.assert_allclose(found["stiffness"], expected, rtol=1e-12)


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_the_bounded_logistic_is_the_logistic_in_other_parameters(direction: float) -> None:
    level = (K_MIN, K_MAX) if direction > 0 else (K_MAX, K_MIN)
    one = Logistic(direction=direction).predict(np.array([K_MIN, K_MAX, 60.0, 12.0]), T)["stiffness"]
    other = BoundedLogistic(direction=direction).predict(
        np.array([level[0], K_MAX - K_MIN, 6.2 / 12.0, 60.0]), T
    )["stiffness"]
    np.testing.assert_allclose(one, other, rtol=1e-12)


def test_of_displacement_the_bounded_logistic_is_the_modified_sigmoid() -> None:
    one = ModifiedSigmoid(("displacement",)).predict(np.array([-0.02, 0.3, 48.0, 0.03]), T)["displacement"]
    bounded = BoundedLogistic(("displacement",), -1.0)
    other = bounded.predict(np.array([0.03, 0.02, 0.3, 48.0]), T)["displacement"]
    np.testing.assert_allclose(one, other, rtol=1e-12)


def test_tying_the_rates_makes_the_root_of_the_stiffness_logistic() -> None:
    tied = TiedSigmoid(("stiffness",))
    assert tied.parameter_names == ("A1", "A2", "A3", "B1", "B3")
    a1, a2, a3, b1, b3 = 0.02, 0.3, 58.0, 2.5, 62.0
    k = tied.predict(np.array([a1, a2, a3, b1, b3]), T)["stiffness"]
    free = ModifiedSigmoid(("stiffness",)).predict(np.array([a1, a2, a3, b1, a2, b3]), T)["stiffness"]
    np.testing.assert_allclose(k, free, rtol=1e-13)
    half = 0.5 * a2 * (b3 - a3)
    low, high = (np.sqrt(b1 / a1) * np.exp(s * half) for s in (-1.0, 1.0))
    share = 1.0 / (1.0 + np.exp(-a2 * (T["temperature"] - b3)))  # a logistic about B3, of the same rate
    np.testing.assert_allclose(np.sqrt(k), low + (high - low) * share, rtol=1e-12)


@pytest.mark.parametrize(
    ("frequencies", "rank"),
    [([10.0], 2), ([10.0, 30.0], 3), ([10.0, 30.0, 50.0], 4), ([10.0, 20.0, 30.0, 50.0], 4)],
)
def test_the_polynomial_has_as_many_parameters_as_frequencies_determine(
    frequencies: list[float], rank: int
) -> None:
    f = np.resize(frequencies, T["temperature"].size)
    y = 20.0 + 0.3 * f - 0.004 * f**2 + 1.5 * T["temperature"]
    solved = least_squares(T["temperature"], f, y)
    a1, a2, a3, a4 = solved.coefficients
    model = Polynomial(("stiffness",), 60.0, tuple(frequencies))
    assert solved.rank == rank == len(model.parameter_names)
    np.testing.assert_allclose(a1 + a2 * f + a3 * f**2 + a4 * T["temperature"], y, rtol=1e-9)
    design = model.design(T | {"frequency": f})
    assert np.linalg.matrix_rank(design) == rank
    np.testing.assert_allclose(design @ np.linalg.lstsq(design, y, rcond=None)[0], y, rtol=1e-9)


def test_a_frequency_that_is_not_known_takes_no_part() -> None:
    assert frequencies_of([0.01, None]) == ()
    assert frequencies_of([0.01, 0.03]) == pytest.approx((10.0, 30.0))
