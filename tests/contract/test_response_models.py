"""What every response model promises: shapes, derivatives, pickling, parameters that a priors file can speak of."""

from __future__ import annotations

import pickle
from collections.abc import Callable

import numpy as np
import pytest

from sma_bayes.assess.contenders import model_priors
from sma_bayes.errors import MeasurementError, PriorError
from sma_bayes.noise import NOISE_MODELS
from sma_bayes.parameters.priors_file import read_priors
from sma_bayes.posterior import build_posterior
from sma_bayes.records.types import Record
from sma_bayes.response import RESPONSE_MODELS
from sma_bayes.response.base import ResponseModel
from sma_bayes.response.polynomial import Polynomial

UNITS = {"temperature": "degC", "force": "N", "displacement": "m", "stiffness": "N/m"}
TYPICAL = {
    "A1": 0.02, "A2": 0.3, "A3": 48.0, "A4": 0.001, "B1": 2.5, "B2": 0.35, "B3": 52.0, "B4": 0.5,
    "K_min": 20.0, "K_max": 150.0, "centre": 50.0, "width": 15.0, "cold": 20.0, "span": 130.0, "rate": 0.3,
    "midpoint": 50.0, "level": 80.0, "a4": 1.5, "linear": 10.0, "square": -4.0,
}  # fmt: skip
INPUTS = {"temperature": np.linspace(25.0, 75.0, 23), "frequency": np.resize([10.0, 30.0, 50.0], 23)}

MODELS: dict[str, ResponseModel] = {name: make(("stiffness",)) for name, make in RESPONSE_MODELS.items()}
MODELS["polynomial of three frequencies"] = Polynomial(("stiffness",), 50.0, (10.0, 30.0, 50.0))

models = pytest.mark.parametrize("model", MODELS.values(), ids=MODELS)


def typical(model: ResponseModel) -> np.ndarray:
    return np.array([TYPICAL[name] for name in model.parameter_names])


@models
def test_one_vector_all_walkers_and_all_draws_use_one_code_path(model: ResponseModel) -> None:
    theta = typical(model) * (
        1.0 + 0.01 * np.random.default_rng(0).standard_normal((4, 5, typical(model).size))
    )
    curve, slope, jacobian = (
        f(theta, INPUTS)["stiffness"] for f in (model.predict, model.slope, model.jacobian)
    )
    assert curve.shape == slope.shape == (4, 5, 23)
    assert jacobian.shape == (4, 5, 23, theta.shape[-1])
    np.testing.assert_allclose(curve[2, 3], model.predict(theta[2, 3], INPUTS)["stiffness"], rtol=1e-14)
    np.testing.assert_allclose(jacobian[2, 3], model.jacobian(theta[2, 3], INPUTS)["stiffness"], rtol=1e-13)


@models
def test_derivatives_are_those_of_the_prediction(model: ResponseModel) -> None:
    theta = typical(model)

    def at(theta: np.ndarray, shift: float = 0.0) -> np.ndarray:
        inputs = INPUTS | {"temperature": INPUTS["temperature"] + shift}
        return model.predict(theta, inputs)["stiffness"]

    slope = (at(theta, 1e-4) - at(theta, -1e-4)) / 2e-4
    np.testing.assert_allclose(model.slope(theta, INPUTS)["stiffness"], slope, rtol=1e-5, atol=1e-7)
    step = 1e-5 * theta
    for i, h in enumerate(step):
        up, down = (at(theta + s * h * np.eye(theta.size)[i]) for s in (1.0, -1.0))
        found = model.jacobian(theta, INPUTS)["stiffness"][:, i]
        np.testing.assert_allclose(found, (up - down) / (2.0 * h), rtol=1e-5, atol=1e-6)


@models
def test_it_pickles_and_its_facts_are_in_the_order_of_its_parameters(model: ResponseModel) -> None:
    again = pickle.loads(pickle.dumps(model))
    np.testing.assert_array_equal(
        again.predict(typical(model), INPUTS)["stiffness"], model.predict(typical(model), INPUTS)["stiffness"]
    )
    facts = model.parameters(UNITS)
    assert tuple(f.name for f in facts) == model.parameter_names
    assert all(f.unit and f.meaning and f.prior_key for f in facts)


@models
def test_shipped_priors_cover_its_parameters(
    model: ResponseModel, make_record: Callable[..., Record]
) -> None:
    both = model_priors(model, read_priors("modified_sigmoid"))
    posterior = build_posterior([make_record(("stiffness",))], NOISE_MODELS["independent"], both, model=model)
    assert posterior.names == (*model.parameter_names, "stiffness_sd")


def test_a_prior_of_another_model_is_refused(make_record: Callable[..., Record]) -> None:
    with pytest.raises(PriorError, match="no parameter is called 'K_min'"):
        build_posterior([make_record(("force",))], NOISE_MODELS["independent"], read_priors("logistic"))


@models
def test_each_parameter_vector_may_have_temperatures_of_its_own(model: ResponseModel) -> None:
    rng = np.random.default_rng(1)
    theta = typical(model) * (1.0 + 0.01 * rng.standard_normal((3, 1)))
    inputs = INPUTS | {"temperature": INPUTS["temperature"] + rng.standard_normal((3, 23))}
    found = [
        f(theta, inputs)["stiffness"] for f in (model.predict, model.slope, model.curvature, model.jacobian)
    ]
    assert [f.shape[:2] for f in found] == [(3, 23)] * 4
    for i in range(3):
        own = inputs | {"temperature": inputs["temperature"][i]}
        alone = (model.predict, model.slope, model.curvature, model.jacobian)
        for one, f in zip(found, alone, strict=True):
            np.testing.assert_allclose(one[i], f(theta[i], own)["stiffness"], rtol=1e-6, atol=1e-9)


@models
def test_its_curvature_is_the_derivative_of_its_slope(model: ResponseModel) -> None:
    up, down = (
        model.slope(typical(model), INPUTS | {"temperature": INPUTS["temperature"] + s})["stiffness"]
        for s in (1e-4, -1e-4)
    )
    np.testing.assert_allclose(
        model.curvature(typical(model), INPUTS)["stiffness"], (up - down) / 2e-4, rtol=1e-5, atol=1e-5
    )


@models
def test_derivatives_by_differences_serve_where_a_model_has_none_by_hand(model: ResponseModel) -> None:
    theta = typical(model)
    for by_hand, by_differences in (
        (model.slope, ResponseModel.slope),
        (model.jacobian, ResponseModel.jacobian),
    ):
        found = by_differences(model, theta, INPUTS)["stiffness"]
        wanted = by_hand(theta, INPUTS)["stiffness"]
        scale = np.abs(wanted).max(axis=0)
        np.testing.assert_allclose(found / scale, wanted / scale, atol=1e-7)


@models
def test_every_parameter_has_a_role_and_a_channel(model: ResponseModel) -> None:
    assert all(f.role is not None and f.channel for f in model.facts)
    for fact in model.facts:
        assert model.with_role(fact.role, fact.channel) in model.parameter_names


@models
def test_it_refuses_channels_that_it_does_not_have(model: ResponseModel) -> None:
    with pytest.raises(MeasurementError, match="has no temperature"):
        type(model)(("temperature",))
