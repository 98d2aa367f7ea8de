"""The rungs above the published curve: they contain it, their limits hold, and their stiffness is bounded."""

from __future__ import annotations

import numpy as np
import pytest

from sma_bayes.errors import MeasurementError
from sma_bayes.parameters.roles import Role
from sma_bayes.response import RESPONSE_MODELS
from sma_bayes.response.base import ResponseModel
from sma_bayes.response.modified_sigmoid import ModifiedSigmoid

ALL = ("force", "displacement", "stiffness")
RUNGS = ("phase_slopes", "sinh_arcsinh", "sinh_arcsinh_slopes", "two_stage")
PUBLISHED = {"A1": 0.02, "A2": 0.3, "A3": 48.0, "A4": 0.001, "B1": 2.5, "B2": 0.35, "B3": 52.0, "B4": 0.5}
NEUTRAL = {
    Role.COLD_SLOPE: 0.0, Role.HOT_SLOPE: 0.0, Role.SKEW: 0.0, Role.TAIL: 1.0, Role.SHARE: 1.0, Role.GAP: 7.0,
    Role.SECOND_RATE: 0.4,
}  # fmt: skip
TYPICAL = NEUTRAL | {Role.SKEW: 0.4, Role.TAIL: 0.8, Role.SHARE: 0.6}
T = np.linspace(20.0, 80.0, 61)


def theta(model: ResponseModel, values: dict[Role, float], **slopes: float) -> np.ndarray:
    return np.array([(PUBLISHED | slopes).get(f.name, values.get(f.role)) for f in model.facts], dtype=float)


def sloped(model: ResponseModel) -> np.ndarray:
    return theta(model, TYPICAL, A_cold_slope=2e-5, A_hot_slope=5e-5, B_cold_slope=4e-3, B_hot_slope=2e-3)


@pytest.mark.parametrize("name", RUNGS)
def test_it_contains_the_published_curve(name: str) -> None:
    rung, published = RESPONSE_MODELS[name](ALL), ModifiedSigmoid(ALL)
    own, plain = theta(rung, NEUTRAL), np.array([PUBLISHED[n] for n in published.parameter_names])
    inputs = {"temperature": T}
    for f, g in (
        (rung.predict, published.predict),
        (rung.slope, published.slope),
        (rung.curvature, published.curvature),
    ):
        found, wanted = f(own, inputs), g(plain, inputs)
        for channel in ALL:
            tolerance = 1e-6 if f == rung.curvature and channel == "stiffness" else 1e-10
            scale = np.abs(wanted[channel]).max()
            np.testing.assert_allclose(found[channel] / scale, wanted[channel] / scale, atol=tolerance)
    j, wanted = rung.jacobian(own, inputs), published.jacobian(plain, inputs)
    at = [rung.parameter_names.index(n) for n in published.parameter_names]
    for channel in ALL:
        np.testing.assert_allclose(j[channel][:, at], wanted[channel], rtol=1e-8, atol=1e-12)


@pytest.mark.parametrize("name", ["phase_slopes", "sinh_arcsinh_slopes", "two_stage"])
def test_with_slopes_the_stiffness_is_bounded_and_tends_to_their_ratio(name: str) -> None:
    model = RESPONSE_MODELS[name](("force", "displacement"))
    far = {"temperature": np.array([-1e5, -1e3, 1e3, 1e5])}
    k = model.stiffness(sloped(model), far)
    np.testing.assert_allclose(k, [200.0, 200.0, 40.0, 40.0], rtol=1e-9)
    between = model.stiffness(sloped(model), {"temperature": np.linspace(-200.0, 300.0, 2001)})
    slopes = model.slope(sloped(model), {"temperature": np.linspace(-200.0, 300.0, 2001)})
    assert between.max() < slopes["force"].max() / 2e-5
    assert between.min() > 0.0
    cold, hot = model.limits(sloped(model))["stiffness"]
    assert (float(cold.value), float(hot.value)) == pytest.approx((200.0, 40.0))


def test_without_slopes_the_stiffness_holds_where_both_slopes_have_vanished() -> None:
    """F' and X' are below the least number that floats can hold; their ratio is not."""
    model = RESPONSE_MODELS["sinh_arcsinh"](("force", "displacement"))
    own = theta(model, NEUTRAL, A2=0.3, B2=0.3)
    k = model.stiffness(own, {"temperature": np.array([-4000.0, 4000.0])})
    ends = ModifiedSigmoid().limits(np.array([*(PUBLISHED | {"B2": 0.3}).values()]))["stiffness"]
    np.testing.assert_allclose(k, [float(e.value) for e in ends], rtol=1e-9)


def test_a_positive_skew_brings_the_transformation_forward_and_a_light_tail_ends_it_early() -> None:
    model = RESPONSE_MODELS["sinh_arcsinh"](("force",))

    def share(skew: float, tail: float, at: float) -> float:
        own = theta(model, NEUTRAL | {Role.SKEW: skew, Role.TAIL: tail})
        return float(model.predict(own, {"temperature": np.array([at])})["force"][0] - 0.5) / 2.5

    assert share(0.5, 1.0, 52.0) == pytest.approx(1.0 / (1.0 + np.exp(-np.sinh(0.5))))
    assert share(0.0, 1.5, 70.0) > share(0.0, 1.0, 70.0) > share(0.0, 0.6, 70.0) > 0.5


@pytest.mark.parametrize("name", RUNGS)
@pytest.mark.parametrize("channels", [("stiffness",), ("force", "stiffness")])
def test_a_stiffness_that_does_not_identify_it_is_refused(name: str, channels: tuple[str, ...]) -> None:
    with pytest.raises(MeasurementError, match="a stiffness without both force and displacement") as refused:
        RESPONSE_MODELS[name](channels)
    assert "--model" in str(refused.value)
    assert name in str(refused.value)


def test_the_stages_of_a_transformation_add_up_and_meet_at_their_plateau() -> None:
    model = RESPONSE_MODELS["two_stage"](("force",))
    own = sloped(model)
    whole = model.predict(own, {"temperature": T})["force"]
    first, second = (model.stage(own, "force", T, number) for number in range(model.stages))
    u = T - PUBLISHED["B3"]
    plateau = 0.5 + 4e-3 * u + 0.6 * (2.5 + (2e-3 - 4e-3) * u)
    np.testing.assert_allclose(first + second - plateau, whole, rtol=1e-12)
    apart = theta(model, TYPICAL | {Role.GAP: 400.0})  # between them both are there
    between = np.array([250.0])
    for number in range(2):
        assert model.stage(apart, "force", between, number) == pytest.approx(0.5 + 0.6 * 2.5)


@pytest.mark.parametrize("name", [n for n in RUNGS if n != "two_stage"])
def test_a_transformation_in_one_stage_is_that_stage(name: str) -> None:
    model = RESPONSE_MODELS[name](("force", "displacement"))
    assert model.stages == 1
    np.testing.assert_array_equal(
        model.stage(sloped(model), "force", T, 0), model.predict(sloped(model), {"temperature": T})["force"]
    )
