"""Standardised residuals of a stored fit."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from sma_bayes.report.content import Content, RecordContent
from sma_bayes.report.figures.sheet import BranchData
from sma_bayes.runs.outputs import StoredRecord
from sma_bayes.studies.fit.residuals import median_curves, standardised_residuals

THETA = {"B1": 2.5, "B2": 0.35, "B3": 52.0, "B4": 0.5}


def stored_series(noise: str, e: np.ndarray, sd: float, **shape: float) -> StoredRecord:
    """Force of a known sigmoid with the noise series `e`, and draws that sit on the truth."""
    n = e.size
    temperature = np.linspace(30.0, 70.0, n)
    force = 0.5 + 2.5 / (1.0 + np.exp(-0.35 * (temperature - 52.0))) + sd * e
    draws = THETA | {"force_sd": sd} | {f"force_{k}": v for k, v in shape.items()}
    return StoredRecord(
        key="c-heating",
        model="modified_sigmoid",
        noise=noise,
        observed={"force": force},
        inputs={"temperature": temperature, "segment": np.repeat([0.0, 1.0], n // 2)},
        row=np.arange(n),
        draws={name: np.full((4, 10), value) for name, value in draws.items()},
        prior_curves={},
        prior_temperature=temperature,
    )


def test_the_median_curve_is_that_of_the_draws() -> None:
    stored = stored_series("independent", np.zeros(40), 0.1)
    assert median_curves(stored)["force"] == pytest.approx(stored.observed["force"], abs=1e-12)


def test_independent_noise_comes_back(content: Content) -> None:
    e = np.random.default_rng(1).standard_normal(60)
    stored = stored_series("independent", e, 0.1)
    found = standardised_residuals(content.records[0], stored, median_curves(stored))
    assert found["force"] == pytest.approx(e, abs=1e-9)


def test_memory_is_taken_out_within_sweeps_only(content: Content) -> None:
    rng = np.random.default_rng(2)
    fresh = rng.standard_normal(80)
    phi, e = 0.8, fresh.copy()
    for i in range(1, 80):
        if i != 40:
            e[i] = phi * e[i - 1] + np.sqrt(1 - phi**2) * fresh[i]
    stored = stored_series("ar1", e, 0.1, phi=phi)
    found = standardised_residuals(content.records[0], stored, median_curves(stored))
    assert found["force"] == pytest.approx(fresh, abs=1e-8)


def test_a_temperature_error_widens_the_scale_where_the_curve_is_steep(content: Content) -> None:
    stored = stored_series("independent", np.ones(40), 0.01)
    record = replace(content.records[0], temperature_sd=1.0)
    e = standardised_residuals(record, stored, median_curves(stored))["force"]
    slope = 2.5 * 0.35 / 4.0  # at the midpoint
    middle = int(np.argmin(np.abs(stored.inputs["temperature"] - 52.0)))
    assert e[middle] == pytest.approx(0.01 / np.hypot(0.01, slope), rel=0.02)
    assert e[0] == pytest.approx(1.0, rel=0.1)


def test_residuals_of_a_right_model_have_unit_variance(
    content: Content, branch_of: Callable[[RecordContent], BranchData]
) -> None:
    branch = branch_of(content.records[1])
    for e in standardised_residuals(branch.content, branch.stored, branch.curve).values():
        assert 0.6 < float(np.std(e)) < 1.3
