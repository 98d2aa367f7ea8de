"""Eqs. (2), (4) and (7): to the last digits, without overflow, for one vector or for all walkers."""

from __future__ import annotations

from decimal import Context, Decimal, localcontext

import numpy as np
import pytest
from hypothesis import example, given, settings, strategies as st

from sma_bayes.quantities import ARBITRARY
from sma_bayes.response import RESPONSE_MODELS
from sma_bayes.response.modified_sigmoid import (
    ModifiedSigmoid,
    channel_unit,
    log_cosh_squared,
    log_stiffness,
    shape_of,
    sigmoid,
    sigmoid_slope,
    stiffness,
)

DIGITS = Context(prec=60, Emax=999_999, Emin=-999_999)
LARGEST = Decimal(float(np.finfo(float).max))
SMALLEST = Decimal(float(np.finfo(float).tiny))

exponents = st.floats(-1e4, 1e4)
rates = st.floats(1e-3, 1e2).flatmap(lambda size: st.sampled_from([size, -size]))
amplitudes = st.floats(1e-6, 1e9).flatmap(lambda size: st.sampled_from([size, -size]))


def slope(amplitude: float, rate: float, midpoint: float, temperature: float) -> Decimal:
    """Derivative of a sigmoid in 60 digits, as one gets by differentiating Eq. (2) on paper."""
    a, r, m, t = (Decimal(v) for v in (amplitude, rate, midpoint, temperature))
    e = (-r * (t - m)).exp()
    return a * r * e / (1 + e) ** 2


def ratio_of_derivatives(
    t: float, a1: float, a2: float, a3: float, b1: float, b2: float, b3: float
) -> Decimal:
    return slope(b1, b2, b3, t) / slope(a1, a2, a3, t)


@settings(max_examples=150, deadline=None)
@given(x=exponents, y=exponents, a2=rates, b2=rates, a1=amplitudes, b1=amplitudes)
@example(x=1e4, y=-1e4, a2=100.0, b2=100.0, a1=0.02, b1=2.5)
@example(x=1e4, y=1e4, a2=0.3, b2=0.3000001, a1=0.02, b1=2.5)
@example(x=0.0, y=0.0, a2=0.3, b2=0.35, a1=0.02, b1=2.5)
@example(x=720.0, y=0.0, a2=0.3, b2=0.3, a1=1e8, b1=1e-5)  # the shape overflows, the stiffness does not
@example(x=0.0, y=755.0, a2=0.3, b2=0.3, a1=1e-6, b1=1e9)  # the shape underflows, the stiffness does not
def test_eq_7_is_the_ratio_of_the_derivatives(x, y, a2, b2, a1, b1) -> None:
    with localcontext(DIGITS):
        t = 50.0
        a3, b3 = t - x / a2, t - y / b2  # so that A2 (T - A3) = x and B2 (T - B3) = y, up to rounding
        exact = ratio_of_derivatives(t, a1, a2, a3, b1, b2, b3)
        arguments = [np.array(v) for v in (t, a1, a2, a3, b1, b2, b3)]
        log_k = float(log_stiffness(*arguments))
        assert abs(Decimal(log_k) - abs(exact).ln()) < Decimal("1e-10")
        if SMALLEST < abs(exact) < LARGEST:
            assert abs(Decimal(float(stiffness(*arguments))) / exact - 1) < Decimal("1e-10")


def test_eq_7_keeps_its_digits_over_a_whole_sweep() -> None:
    theta = (0.02, 250.0, 48.0, 2.5, 260.0, 52.0)
    sweep = np.linspace(10.0, 88.0, 53)  # A2 (T - A3) from -9500 to 10000
    found = log_stiffness(sweep, *(np.array(v) for v in theta))
    with localcontext(DIGITS):
        exact = [ratio_of_derivatives(float(t), *theta).ln() for t in sweep]
        worst = max(abs(Decimal(float(f)) - e) for f, e in zip(found, exact, strict=True))
    assert worst < Decimal("1e-10")
    assert np.abs(250.0 * (sweep - 48.0)).max() == pytest.approx(1e4)


@pytest.mark.parametrize("x", [0.0, 1e-9, 1.0, 36.0, 700.0, 1e4, -1e4])
def test_the_logarithm_of_the_squared_cosine_is_exact(x: float) -> None:
    with localcontext(DIGITS):
        half = Decimal(x) / 2
        exact = float(((half.exp() + (-half).exp()) ** 2).ln())
    assert float(log_cosh_squared(np.array(x))) == pytest.approx(exact, rel=1e-15)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_sigmoids_reach_their_ends_without_overflow(sign: float) -> None:
    t = np.array([-1e6, 1e6])
    with np.errstate(all="raise", under="ignore"):
        np.testing.assert_array_equal(sigmoid(t, 2.0 * sign, 0.3, 50.0, 1.0), [1.0, 1.0 + 2.0 * sign])
        np.testing.assert_array_equal(sigmoid_slope(t, 2.0 * sign, 0.3, 50.0), [0.0, 0.0])


@pytest.fixture(scope="module")
def draws() -> np.ndarray:
    """Parameter vectors of all shapes: A2 above and below B2, falling and rising branches."""
    rng = np.random.default_rng(3)
    theta = np.empty((3, 7, 8))
    for i, name in enumerate(ModifiedSigmoid().parameter_names):
        if name[1] in "12":
            theta[..., i] = rng.uniform(0.1, 2.0, (3, 7)) * rng.choice([-1.0, 1.0], (3, 7))
        else:
            theta[..., i] = rng.uniform(-1.0, 1.0, (3, 7)) + (5.0 if name[1] == "3" else 0.0)
    return theta


INPUTS = {"temperature": np.linspace(0.0, 10.0, 23)}


@pytest.mark.parametrize("method", ["predict", "slope", "jacobian"])
def test_one_vector_walkers_and_draws_give_identical_rows(method: str, draws: np.ndarray) -> None:
    model = ModifiedSigmoid()
    call = getattr(model, method)
    every = call(draws, INPUTS)
    walkers = call(draws[1], INPUTS)
    one = call(draws[1, 4], INPUTS)
    for channel in model.channels:
        tail = (23, 8) if method == "jacobian" else (23,)
        assert every[channel].shape == (3, 7, *tail)
        assert one[channel].shape == tail
        np.testing.assert_array_equal(every[channel][1], walkers[channel])
        np.testing.assert_array_equal(walkers[channel][4], one[channel])


def exact_response(theta: dict[str, Decimal], t: Decimal) -> dict[str, Decimal]:
    ea, eb = (-theta["A2"] * (t - theta["A3"])).exp(), (-theta["B2"] * (t - theta["B3"])).exp()
    return {
        "force": theta["B4"] + theta["B1"] / (1 + eb),
        "displacement": theta["A4"] + theta["A1"] / (1 + ea),
        "stiffness": (theta["B1"] * theta["B2"] * eb * (1 + ea) ** 2)
        / (theta["A1"] * theta["A2"] * ea * (1 + eb) ** 2),
    }


def exact_derivative(theta: np.ndarray, t: float, direction: str) -> dict[str, float]:
    """Central difference in 60 digits with a step of 1e-20: good to 1e-38."""
    names = ModifiedSigmoid().parameter_names
    with localcontext(DIGITS):
        step = Decimal("1e-20")
        ends = []
        for side in (step, -step):
            at = {name: Decimal(float(v)) for name, v in zip(names, theta, strict=True)}
            temperature = Decimal(t)
            if direction == "temperature":
                temperature += side
            else:
                at[direction] += side
            ends.append(exact_response(at, temperature))
        return {channel: float((ends[0][channel] - ends[1][channel]) / (2 * step)) for channel in ends[0]}


def test_the_jacobian_is_the_derivative(draws: np.ndarray) -> None:
    model = ModifiedSigmoid()
    theta = draws[0, 2]
    for name_index, name in enumerate(model.parameter_names):
        for j in (0, 9, 22):
            t = float(INPUTS["temperature"][j])
            exact = exact_derivative(theta, t, name)
            for channel, value in model.jacobian(theta, INPUTS).items():
                assert value[j, name_index] == pytest.approx(exact[channel], rel=1e-11, abs=1e-14), (
                    channel,
                    name,
                )


def test_the_slope_is_the_derivative_with_respect_to_temperature(draws: np.ndarray) -> None:
    model = ModifiedSigmoid()
    for theta in draws[2]:
        found = model.slope(theta, INPUTS)
        for j in (0, 11, 22):
            exact = exact_derivative(theta, float(INPUTS["temperature"][j]), "temperature")
            for channel, value in found.items():
                assert value[j] == pytest.approx(exact[channel], rel=1e-10, abs=1e-14), channel


def test_stiffness_predicted_is_the_slope_of_the_predicted_path(draws: np.ndarray) -> None:
    model = ModifiedSigmoid()
    slope_ = model.slope(draws, INPUTS)
    predicted = model.predict(draws, INPUTS)["stiffness"]
    np.testing.assert_allclose(predicted, slope_["force"] / slope_["displacement"], rtol=1e-11)


@pytest.mark.parametrize(
    ("channels", "names"),
    [
        (("force",), "B1 B2 B3 B4"),
        (("displacement",), "A1 A2 A3 A4"),
        (("stiffness",), "A1 A2 A3 B1 B2 B3"),
        (("force", "stiffness"), "A1 A2 A3 B1 B2 B3 B4"),
        (("force", "displacement", "stiffness"), "A1 A2 A3 A4 B1 B2 B3 B4"),
    ],
)
def test_a_model_has_the_parameters_that_its_channels_need(channels: tuple[str, ...], names: str) -> None:
    model = ModifiedSigmoid(channels)
    assert model.parameter_names == tuple(names.split())
    theta = np.ones(len(model.parameter_names))
    assert set(model.predict(theta, INPUTS)) == set(channels)


def test_parameters_carry_the_units_of_the_record() -> None:
    units = {"temperature": "degC", "force": "N", "displacement": "m", "time": "s"}
    facts = {f.name: f for f in ModifiedSigmoid(("force", "displacement")).parameters(units)}
    assert {n: f.unit for n, f in facts.items()} == {
        "A1": "m", "A2": "1/degC", "A3": "degC", "A4": "m",
        "B1": "N", "B2": "1/degC", "B3": "degC", "B4": "N",
    }  # fmt: skip
    assert facts["A3"].channel == "displacement"
    assert facts["B3"].channel == "force"
    assert all(f.prior_key == f.name and f.meaning for f in facts.values())


@pytest.mark.parametrize(
    ("units", "channel", "expected"),
    [
        ({"force": "N"}, "force", "N"),
        ({"stiffness": "N/m"}, "force", "N"),
        ({"stiffness": "N/m"}, "displacement", "m"),
        ({"stiffness": "Pa"}, "force", "Pa"),
        ({"stiffness": "Pa"}, "displacement", "1"),
        ({"stiffness": ARBITRARY}, "displacement", ARBITRARY),
        ({"force": "Pa", "displacement": "1"}, "stiffness", "Pa"),
        ({"force": ARBITRARY, "displacement": "m"}, "stiffness", ARBITRARY),
        ({"force": "N"}, "displacement", "m"),
        ({}, "force", "N"),
    ],
)
def test_units_of_channels_that_were_not_observed(units: dict[str, str], channel: str, expected: str) -> None:
    assert channel_unit(units, channel) == expected


def test_eq_7_is_a_sigmoid_only_where_the_rates_agree() -> None:
    a2 = np.array([0.3, 0.30, 0.35, -0.3])
    b2 = np.array([0.3, 0.35, 0.30, 0.3])
    assert list(shape_of(a2, b2)) == ["sigmoid", "hump", "unbounded", "sigmoid"]
    far = np.array([-1e5, 1e5])
    for a, b, expected in zip(a2, b2, shape_of(a2, b2), strict=True):
        ends = stiffness(far, 0.02, a, 48.0, 2.5, b, 52.0)
        if expected == "sigmoid":
            assert np.isfinite(ends).all()
            assert (ends != 0.0).all()
        else:
            np.testing.assert_array_equal(ends, [0.0, 0.0] if expected == "hump" else [np.inf, np.inf])


def test_the_catalogue_holds_the_model_under_its_name() -> None:
    assert RESPONSE_MODELS["modified_sigmoid"] is ModifiedSigmoid
