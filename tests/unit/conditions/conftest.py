"""Posterior draws of made-up records."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from sma_bayes.conditions.draws import RecordDraws
from sma_bayes.parameters.distributions import LogNormal, Normal
from sma_bayes.records.types import Branch, Condition
from sma_bayes.response.modified_sigmoid import ModifiedSigmoid

SPRING = {"A1": 0.02, "A2": 0.30, "A3": 48.0, "A4": 0.001, "B1": 2.5, "B2": 0.35, "B3": 52.0, "B4": 0.5}
UNITS = {"temperature": "degC", "force": "N", "displacement": "m", "stiffness": "N/m"}
WIDTH = {"1": 1.0, "2": 1.2, "3": 20.0, "4": 2.0}
"""Standard deviation of the prior, by the number in the name of a parameter."""


@pytest.fixture(scope="session")
def make_draws() -> Callable[..., RecordDraws]:
    """Draws about given parameters, `error` wide relative to the prior."""

    def make(
        condition: Condition,
        branch: Branch = Branch.HEATING,
        *,
        channels: tuple[str, ...] = ("force", "displacement"),
        error: float = 1e-3,
        size: int = 400,
        seed: int = 0,
        span: tuple[float, float] = (30.0, 70.0),
        **changes: float,
    ) -> RecordDraws:
        rng = np.random.default_rng([seed, *condition.id.encode(), *branch.value.encode()])
        centre = SPRING | changes
        columns, priors = [], []
        for name in ModifiedSigmoid(channels).parameter_names:
            step = error * WIDTH[name[1]] * rng.standard_normal(size)
            log = name[1] in "12"
            columns.append(centre[name] * np.exp(step) if log else centre[name] + step)
            priors.append(
                LogNormal(SPRING[name], WIDTH[name[1]]) if log else Normal(SPRING[name], WIDTH[name[1]])
            )
        shown = (
            (*channels, "stiffness")
            if {"force", "displacement"} <= set(channels) and "stiffness" not in channels
            else channels
        )
        temperature = np.linspace(*span, 50)
        theta = np.stack(columns, axis=-1)
        mean = ModifiedSigmoid(channels).predict(theta.mean(axis=0), {"temperature": temperature})
        return RecordDraws(
            condition, branch, channels, {c: c for c in shown}, {n: UNITS[n] for n in ("temperature", *shown)},
            False, theta, tuple(priors), "independent",
            {c: np.full((size, 1), 1e-3 * np.ptp(mean[c])) for c in channels}, temperature, mean, "path_slope", True,
        )  # fmt: skip

    return make
