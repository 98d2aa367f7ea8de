"""The published curve nearest to any curve: in the norm that is stated, and found wherever there is one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.special import expit

from sma_bayes.arrays import Floats
from sma_bayes.assess.nearest import (
    MAX_COMPARED_TEMPERATURES,
    compared_temperatures,
    nearest_of,
    nearest_sigmoids,
)
from sma_bayes.fitting.fit_records import fit_records
from sma_bayes.parameters.priors_file import read_priors
from sma_bayes.records.types import Record


def by_scipy(temperature: Floats, curve: Floats, start: Floats) -> Floats:
    """Span, rate, midpoint and offset of the least sum of squares over samples."""

    def missed(p: Floats) -> Floats:
        return np.asarray(p[3] + p[0] * expit(p[1] * (temperature - p[2])) - curve)

    found = least_squares(missed, start, x_scale=np.abs(start), xtol=1e-12, ftol=1e-15, gtol=1e-15)
    return np.asarray(found.x)


def few_within(n: int) -> Floats:
    """Temperatures of a sweep that sees a narrow transformation at 50 in one sample of ten."""
    plateaus = np.linspace(20.0, 80.0, n - n // 10)
    return np.sort(np.append(plateaus[np.abs(plateaus - 50.0) > 3.0], np.linspace(47.0, 53.0, n // 10)))


def steep_with_a_second_step(t: Floats) -> Floats:
    """No published curve: of its step, which is steep, a tenth comes later and slowly."""
    return np.asarray(1.0 - 0.9 * expit(1.5 * (t - 50.0)) - 0.1 * expit(0.3 * (t - 56.0)))


@pytest.mark.parametrize("n", [60, 166, 332])
def test_every_sample_counts_in_the_norm(n: int) -> None:
    t = few_within(n)
    curve = steep_with_a_second_step(t)
    compared, count = compared_temperatures(t)
    found = nearest_sigmoids(compared, steep_with_a_second_step(compared)[None], count)[0]
    assert found == pytest.approx(by_scipy(t, curve, found), rel=1e-6)
    assert count.sum() == t.size


def test_samples_at_one_temperature_count_each() -> None:
    t = np.repeat(few_within(80), 3)
    t[: t.size // 2] = t[0]  # half of the record was taken before heating began
    compared, count = compared_temperatures(t)
    found = nearest_sigmoids(compared, steep_with_a_second_step(compared)[None], count)[0]
    assert found == pytest.approx(by_scipy(t, steep_with_a_second_step(t), found), rel=1e-6)


def test_of_many_samples_neighbours_are_taken_together() -> None:
    rng = np.random.default_rng(5)
    t = np.sort(np.append(rng.uniform(20.0, 80.0, 1500), rng.normal(52.0, 3.0, 400)))
    compared, count = compared_temperatures(t)
    assert compared.size == MAX_COMPARED_TEMPERATURES
    found = nearest_sigmoids(compared, steep_with_a_second_step(compared)[None], count)[0]
    assert found == pytest.approx(by_scipy(t, steep_with_a_second_step(t), found), rel=5e-5)


def test_found_where_much_is_missed() -> None:
    """A jump, then a slow rise: each step of Gauss and Newton comes closer by a constant factor only."""
    t = np.linspace(25.0, 58.0, 190)
    jump = (
        0.4 * expit(20.0 * (t - 43.6))[None]
        + 0.6 * expit(0.35 * (t - 47.0)) * np.linspace(0.5, 1.5, 40)[:, None]
    )
    found = nearest_sigmoids(t, jump)
    assert np.isfinite(found).all()
    for own, curve in zip(found[::13], jump[::13], strict=True):
        assert own == pytest.approx(by_scipy(t, curve, own), rel=1e-4)


def test_those_of_a_fit_are_nearest_over_all_its_samples(make_record: Callable[..., Record]) -> None:
    t = few_within(170)
    made = make_record(n=t.size)
    noise = np.random.default_rng(3).normal(0.0, 0.002, t.size)
    record = replace(
        made,
        inputs=dict(made.inputs) | {"temperature": t},
        observed={"displacement": 0.01 * (steep_with_a_second_step(t) + noise)},
        units={name: made.units[name] for name in ("temperature", "time", "displacement")},
    )
    curves = fit_records([record], read_priors("modified_sigmoid"), noise="independent").curves()
    draws = np.stack([p.draws for p in nearest_of(curves)], axis=1)
    whole = curves.curve("displacement", t)
    assert curves.weights["displacement"].size  # the curve is not a published one
    for own, curve in list(zip(draws, whole, strict=True))[::400]:
        assert own == pytest.approx(by_scipy(t, curve, own), rel=1e-5)
