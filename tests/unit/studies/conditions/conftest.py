"""Posterior draws of made-up records."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest

from sma_bayes.assess.draws import RecordDraws
from sma_bayes.fitting.curves import calibrated_parameters
from sma_bayes.fitting.fit import calibration_errors
from sma_bayes.fitting.posterior import ParameterIndex, Posterior
from sma_bayes.noise import NOISE_MODELS
from sma_bayes.parameters.distributions import LogNormal, Normal
from sma_bayes.parameters.space import Parameter, ParameterSpace
from sma_bayes.records.types import Branch, Calibration, Condition, Record
from sma_bayes.response.modified_sigmoid import ModifiedSigmoid

SPRING = {"A1": 0.02, "A2": 0.30, "A3": 48.0, "A4": 0.001, "B1": 2.5, "B2": 0.35, "B3": 52.0, "B4": 0.5}
UNITS = {"temperature": "degC", "force": "N", "displacement": "m", "stiffness": "N/m"}
WIDTH = {"A4": 0.02, "B4": 1.0} | {f"{a}{n}": w for a in "AB" for n, w in ((1, 1.0), (2, 1.0), (3, 15.0))}
"""Standard deviation of the prior; of spans and rates, of the logarithm."""


def made_posterior(record: Record) -> Posterior:
    """Posterior of a record under priors that don't depend on it."""
    model = ModifiedSigmoid(record.channels)
    parameters = [
        Parameter(
            n,
            "",
            "",
            LogNormal(SPRING[n], WIDTH[n]) if n[1] in "12" else Normal(SPRING[n], WIDTH[n]),
        )
        for n in model.parameter_names
    ]
    at = {}
    for channel in record.channels:
        at[channel] = np.array([len(parameters)])
        prior = LogNormal(0.01 * float(np.ptp(record.observed[channel])), 1.0)
        parameters.append(Parameter(f"{channel}_sd", "", "", prior))
    place = ParameterIndex(np.arange(len(model.parameter_names)), at)
    space = ParameterSpace(tuple(parameters))
    return Posterior((record,), model, NOISE_MODELS["independent"], space, (place,))


@pytest.fixture(scope="session")
def make_posterior() -> Callable[[Record], Posterior]:
    """See `made_posterior`."""
    return made_posterior


@pytest.fixture(scope="session")
def make_draws() -> Callable[..., RecordDraws]:
    """Draws about given parameters, `error` wide relative to the prior: not those of a posterior, but like them."""

    def make(
        condition: Condition,
        branch: Branch = Branch.HEATING,
        *,
        channels: Sequence[str] = ("force", "displacement"),
        error: float = 1e-3,
        size: int = 400,
        seed: int = 0,
        span: tuple[float, float] = (30.0, 70.0),
        **changes: float,
    ) -> RecordDraws:
        rng = np.random.default_rng([seed, *condition.id.encode(), *branch.value.encode()])
        model, centre = ModifiedSigmoid(tuple(channels)), SPRING | changes
        t = np.linspace(*span, 50)
        clean = model.predict(np.array([centre[n] for n in model.parameter_names]), {"temperature": t})
        noise = {c: 0.01 * float(np.ptp(v)) for c, v in clean.items()}
        observed = {c: v + noise[c] * rng.standard_normal(t.size) for c, v in clean.items()}
        units = {n: UNITS[n] for n in ("temperature", *channels)}
        record = Record(condition, branch, {"temperature": t}, observed, np.arange(t.size) + 2, units)
        columns = []
        for name in model.parameter_names:
            step = error * WIDTH[name] * rng.standard_normal(size)
            columns.append(centre[name] * np.exp(step) if name[1] in "12" else centre[name] + step)
        columns += [noise[c] * np.exp(0.1 * rng.standard_normal(size)) for c in record.channels]
        return RecordDraws(made_posterior(record), np.stack(columns, axis=-1), True)

    return make


@pytest.fixture(scope="session")
def calibrated() -> Callable[[RecordDraws, dict[str, Calibration]], RecordDraws]:
    """Draws of a record whose calibrations are known so well, with errors of its own, as a fit has them."""

    def with_errors(draws: RecordDraws, known: dict[str, Calibration]) -> RecordDraws:
        posterior = replace(draws.posterior, records=(replace(draws.record, calibration=known),))
        errors = calibration_errors(known, 0, draws.key, draws.size)
        theta = calibrated_parameters(posterior, draws.theta, errors)
        return replace(draws, posterior=posterior, theta=theta, calibration=errors)

    return with_errors
