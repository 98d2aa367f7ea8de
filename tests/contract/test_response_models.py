"""What every response model promises: shapes, derivatives, pickling, parameters that a priors file can speak of.

The cases come from the catalogue, each for every set of channels that the model takes, at the medians of its priors.
Models of other installed packages are tried like those that ship; ``-k NAME`` tries one of them.
"""

from __future__ import annotations

import pickle
import warnings
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from sma_bayes.arrays import Floats
from sma_bayes.errors import MeasurementError, PriorError
from sma_bayes.fitting.posterior import build_posterior
from sma_bayes.noise import NOISE_MODELS
from sma_bayes.parameters.priors_file import read_priors
from sma_bayes.parameters.roles import Role
from sma_bayes.records.types import Record
from sma_bayes.response import RESPONSE_MODELS
from sma_bayes.response.base import ResponseModel
from sma_bayes.response.polynomial import FREQUENCY

CHANNELS = (
    ("displacement",),
    ("force",),
    ("stiffness",),
    ("force", "displacement"),
    ("force", "displacement", "stiffness"),
)
BY_DIFFERENCES = 1e-5
"""Of its scale: how far a derivative by differences depends on what else is in a batch, which sets its steps."""


def exact(model: ResponseModel, method: str) -> bool:
    """Whether a model promises all digits: those that ship do, others of what they give by hand."""
    own = getattr(type(model), method) is not getattr(ResponseModel, method)
    return own or type(model).__module__.startswith("sma_bayes.")


def cases() -> Iterator[tuple[str, tuple[str, ...]]]:
    for name, make in RESPONSE_MODELS.items():
        for channels in CHANNELS:
            if not make.refusal(channels):
                yield name, channels
    yield "polynomial of three frequencies", ("stiffness",)


each = pytest.mark.parametrize("case", list(cases()), ids=lambda case: f"{case[0]}-{'+'.join(case[1])}")


class Case:
    """A model with its record, parameters at the medians of its priors, and inputs."""

    def __init__(self, case: tuple[str, tuple[str, ...]], make_record: Callable[..., Record]) -> None:
        name, self.channels = case
        self.record = make_record(self.channels)
        if "frequencies" in name:
            frequency = np.resize([10.0, 30.0, 50.0], self.record.n)
            self.record = replace(self.record, inputs={**self.record.inputs, FREQUENCY: frequency})
        self.model = RESPONSE_MODELS[name.partition(" ")[0]].made_for([self.record])
        self.posterior = build_posterior(
            [self.record], NOISE_MODELS["independent"], self.model.default_priors(), model=self.model
        )
        space = self.posterior.space
        medians = [float(p.prior.quantile(np.array(0.5))) for p in space.parameters]
        self.theta = np.array(medians[: len(self.model.parameter_names)])
        scatter = [float(np.ptp(p.prior.quantile(np.array([0.25, 0.75])))) for p in space.parameters]
        self.scatter = np.array(scatter[: self.theta.size])
        # medians of zero would hide what depends on them, and equal ones of force and displacement cancel
        self.theta = self.theta + self.scatter * np.random.default_rng(3).uniform(0.1, 0.4, self.theta.size)
        self.inputs = {name: values[::5] for name, values in self.record.inputs.items()}

    def draws(self, *shape: int) -> Floats:
        """Parameters near those of the case, shape (*shape, P)."""
        rng = np.random.default_rng(0)
        return self.theta + 0.05 * self.scatter * rng.standard_normal((*shape, self.theta.size))


@pytest.fixture
def it(case: tuple[str, tuple[str, ...]], make_record: Callable[..., Record]) -> Case:
    return Case(case, make_record)


@each
def test_one_vector_all_walkers_and_all_draws_use_one_code_path(it: Case) -> None:
    theta, n = it.draws(4, 5), it.inputs["temperature"].size
    for f in (it.model.predict, it.model.slope, it.model.curvature, it.model.jacobian):
        found, alone = f(theta, it.inputs), f(theta[2, 3], it.inputs)
        near = 1e-12 if exact(it.model, f.__name__) else BY_DIFFERENCES
        assert tuple(found) == it.channels
        for channel in it.channels:
            tail = (theta.shape[-1],) if f == it.model.jacobian else ()
            assert found[channel].shape == (4, 5, n, *tail)
            scale = np.abs(alone[channel]).max() + 1e-300
            np.testing.assert_allclose(
                found[channel][2, 3] / scale, alone[channel] / scale, rtol=1e-12, atol=near
            )


@each
def test_no_parameter_vectors_give_no_curves(it: Case) -> None:
    """A sampler may ask for the derivatives of a batch that turned out empty."""
    nothing, n = it.draws(0), it.inputs["temperature"].size
    for jacobian in (it.model.jacobian, partial(ResponseModel.jacobian, it.model)):
        found = jacobian(nothing, it.inputs)
        for channel in it.channels:
            assert found[channel].shape == (0, n, nothing.shape[-1])


@each
def test_each_parameter_vector_may_have_temperatures_of_its_own(it: Case) -> None:
    theta = it.draws(3)
    off = np.random.default_rng(1).standard_normal((3, 1))
    inputs = it.inputs | {"temperature": it.inputs["temperature"] + off}
    for f in (it.model.predict, it.model.slope, it.model.curvature, it.model.jacobian):
        found = f(theta, inputs)
        near = 1e-9 if exact(it.model, f.__name__) else BY_DIFFERENCES
        for i in range(3):
            alone = f(theta[i], inputs | {"temperature": inputs["temperature"][i]})
            for channel in it.channels:
                scale = np.abs(alone[channel]).max() + 1e-300
                np.testing.assert_allclose(
                    found[channel][i] / scale, alone[channel] / scale, rtol=1e-9, atol=near
                )


@each
def test_derivatives_are_those_of_the_prediction(it: Case) -> None:
    """By differences: as a model would have them that brings none of its own."""
    for by_hand, by_differences, tolerance in (
        (it.model.slope, ResponseModel.slope, 1e-7),
        (it.model.curvature, ResponseModel.curvature, 1e-7),
        (it.model.jacobian, ResponseModel.jacobian, 1e-7),
    ):
        found, wanted = by_hand(it.theta, it.inputs), by_differences(it.model, it.theta, it.inputs)
        for channel in it.channels:
            scale = np.abs(wanted[channel]).max(axis=0) + 1e-300
            np.testing.assert_allclose(found[channel] / scale, wanted[channel] / scale, atol=tolerance)


@each
def test_stiffness_is_the_slope_of_force_over_that_of_displacement(it: Case) -> None:
    if set(it.channels) < {"force", "displacement"}:
        pytest.skip("no path without both force and displacement")
    if "force" not in it.channels:
        found, wanted = (
            it.model.stiffness(it.theta, it.inputs),
            it.model.predict(it.theta, it.inputs)["stiffness"],
        )
    else:
        slope = it.model.slope(it.theta, it.inputs)
        with np.errstate(invalid="warn" if exact(it.model, "stiffness") else "ignore"):  # both may vanish
            found, wanted = it.model.stiffness(it.theta, it.inputs), slope["force"] / slope["displacement"]
    np.testing.assert_allclose(found, wanted, rtol=1e-9)


@each
def test_nothing_overflows_or_warns_far_away(it: Case) -> None:
    inputs = {name: np.full(8, values[0]) for name, values in it.inputs.items()}
    inputs["temperature"] = np.array([-1e6, -1e4, -300.0, 0.0, 50.0, 300.0, 1e4, 1e6])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for f in (it.model.predict, it.model.slope, it.model.jacobian):
            for channel, values in f(it.draws(20), inputs).items():
                if channel != "stiffness":
                    assert np.isfinite(values).all(), (f, channel)
        if set(it.channels) >= {"force", "displacement"} and exact(it.model, "stiffness"):
            assert not np.isnan(it.model.stiffness(it.draws(20), inputs)).any()


@each
def test_its_limits_are_what_it_tends_to(it: Case) -> None:
    theta = it.draws(5)
    far = np.array([-1e6, 1e6])
    inputs = {name: np.full(2, values[0]) for name, values in it.inputs.items()} | {"temperature": far}
    predicted = it.model.predict(theta, inputs)
    for channel, ends in it.model.limits(theta).items():
        curve = it.model.stiffness(theta, inputs) if channel == "stiffness" else predicted[channel]
        for i, line in enumerate(ends):
            wanted, found = line.at(far[i : i + 1])[:, 0], curve[:, i]
            solid = np.isfinite(wanted)
            np.testing.assert_allclose(found[solid], wanted[solid], rtol=1e-6, atol=1e-200)
            assert (np.abs(found[~solid]) > 1e100).all()


@each
def test_it_pickles_and_its_facts_are_in_the_order_of_its_parameters(it: Case) -> None:
    again = pickle.loads(pickle.dumps(it.model))
    assert again == it.model
    for channel, values in it.model.predict(it.theta, it.inputs).items():
        np.testing.assert_array_equal(again.predict(it.theta, it.inputs)[channel], values)
    facts = it.model.parameters(it.record.units)
    assert tuple(f.name for f in facts) == it.model.parameter_names
    assert all(f.unit and f.meaning and f.prior_key for f in facts)


@each
def test_every_parameter_has_a_role_and_a_channel(it: Case) -> None:
    for fact in it.model.facts:
        assert isinstance(fact.role, Role)
        assert it.model.with_role(fact.role, fact.channel) in it.model.parameter_names


@each
def test_its_priors_cover_its_parameters_and_those_of_channels_that_were_not_observed(it: Case) -> None:
    own = tuple(n for n in it.posterior.names if n not in {f"{c}_sd" for c in it.channels})
    assert own == it.model.parameter_names
    assert {f.prior_key for f in it.model.facts} <= it.model.spoken_of()


@each
def test_linear_parameters_enter_their_channel_linearly_and_are_solved_for(it: Case) -> None:
    at = [i for i, n in enumerate(it.model.parameter_names) if n in it.model.linear]
    own = [c for c in it.channels if any(f.channel == c for f in it.model.facts)]
    j, moved = it.theta.copy(), it.theta.copy()
    moved[at] += 0.7 * it.scatter[at]
    first, second = (it.model.jacobian(x, it.inputs) for x in (j, moved))
    for channel in own:
        scale = np.abs(first[channel]).max(axis=0) + 1e-300
        np.testing.assert_allclose(
            first[channel][:, at] / scale[at], second[channel][:, at] / scale[at], atol=1e-9
        )
    clean = it.model.predict(it.theta, it.inputs)
    theta = np.tile(it.theta, (12, 1))
    theta[:, at] += it.scatter[at] * np.abs(np.random.default_rng(2).standard_normal((12, len(at))))
    fixed = np.zeros(it.theta.size, dtype=bool)
    best = it.model.screen(theta, fixed, it.inputs | clean)[0]
    if at and own:
        for channel in own:
            left = it.model.predict(best, it.inputs)[channel] - clean[channel]
            assert np.abs(left).max() < 0.1 * np.ptp(clean[channel])


@pytest.mark.parametrize("make", RESPONSE_MODELS.values(), ids=RESPONSE_MODELS)
def test_it_refuses_channels_that_it_does_not_have(make: type[ResponseModel]) -> None:
    with pytest.raises(MeasurementError, match="has no temperature"):
        make(("temperature",))


def test_a_prior_of_another_model_is_refused(make_record: Callable[..., Record]) -> None:
    with pytest.raises(PriorError, match="no parameter is called 'K_min'"):
        build_posterior([make_record(("force",))], NOISE_MODELS["independent"], read_priors("logistic"))
