"""Curves of draws: model, discrepancy and the errors of calibrations, against evaluation by hand."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from sma_bayes.fitting.curves import CurveDraws, Errors, calibrated_parameters, quantiles
from sma_bayes.fitting.noise_choice import discrepancy_bases
from sma_bayes.fitting.posterior import Posterior, build_posterior
from sma_bayes.noise import NOISE_MODELS
from sma_bayes.parameters.priors_file import read_priors
from sma_bayes.records.types import Record

SIZE = 6
T = np.linspace(25.0, 75.0, 41)
TRUTH = {"A1": 0.02, "A2": 0.30, "A3": 48.0, "A4": 0.001, "B1": 2.5, "B2": 0.35, "B3": 52.0, "B4": 0.5}


def posterior_of(record: Record, *, missed: bool) -> Posterior:
    first = build_posterior([record], NOISE_MODELS["independent"], read_priors("modified_sigmoid"))
    if not missed:
        return first
    theta = first.space.constrain(first.space.prior_centre())
    for name, value in TRUTH.items():
        theta[first.space.index(name)] = value
    bases = discrepancy_bases(first, theta[first.layout[0].model])
    return build_posterior([record], first.noise, read_priors("modified_sigmoid"), discrepancy=bases)


def draws_of(posterior: Posterior) -> np.ndarray:
    rng = np.random.default_rng(0)
    theta = np.tile(posterior.space.constrain(posterior.space.prior_centre()), (SIZE, 1))
    for name, value in TRUTH.items():
        if name in posterior.space.names:
            theta[:, posterior.space.index(name)] = value * (1.0 + 0.01 * rng.standard_normal(SIZE))
    return theta


def errors(*names: str) -> Errors:
    rng = np.random.default_rng(1)
    return {
        n: (1.0 + 0.03 * rng.standard_normal(SIZE), s * rng.standard_normal(SIZE))
        for n, s in {"force": 0.1, "displacement": 0.001, "stiffness": 5.0, "temperature": 0.8}.items()
        if n in names
    }


def made(record: Record, calibration: Errors, *, missed: bool) -> tuple[CurveDraws, np.ndarray]:
    posterior = posterior_of(record, missed=missed)
    theta = draws_of(posterior)
    rng = np.random.default_rng(2)
    weights = {
        c: 0.02 * np.ptp(record.observed[c]) * rng.standard_normal((SIZE, b.count))
        for c, b in posterior.discrepancy[0].items()
    }
    return CurveDraws(
        posterior, calibrated_parameters(posterior, theta, calibration), weights, calibration
    ), theta


def by_hand(curves: CurveDraws, theta: np.ndarray, channel: str, t: np.ndarray) -> np.ndarray:
    """What was read at each true temperature, brought to true values of the channel."""
    out = np.empty((SIZE, t.size))
    for i in range(SIZE):
        gain_t, shift_t = (
            x[i] for x in curves.calibration.get("temperature", (np.ones(SIZE), np.zeros(SIZE)))
        )
        gain, shift = (x[i] for x in curves.calibration.get(channel, (np.ones(SIZE), np.zeros(SIZE))))
        read = (t - shift_t) / gain_t
        y = curves.posterior.model.predict(theta[i, curves.posterior.layout[0].model], {"temperature": read})[
            channel
        ]
        if channel in curves.weights:
            y = y + curves.posterior.discrepancy[0][channel].at(read) @ curves.weights[channel][i]
        out[i] = gain * y + shift
    return out


CALIBRATED = pytest.mark.parametrize(
    "names", [(), ("force",), ("temperature",), ("force", "displacement", "temperature")], ids="-".join
)


@CALIBRATED
@pytest.mark.parametrize("missed", [False, True])
def test_curves_are_those_worked_out_by_hand(
    make_record: Callable[..., Record], names: tuple[str, ...], missed: bool
) -> None:
    curves, theta = made(make_record(n=60), errors(*names), missed=missed)
    assert bool(curves.weights) == missed
    for channel in ("force", "displacement"):
        expected = by_hand(curves, theta, channel, T)
        np.testing.assert_allclose(
            curves.curve(channel, T), expected, rtol=1e-9, atol=1e-9 * np.ptp(expected)
        )
        h = 1e-4
        slope = (by_hand(curves, theta, channel, T + h) - by_hand(curves, theta, channel, T - h)) / (2 * h)
        np.testing.assert_allclose(curves.slope(channel, T), slope, atol=1e-5 * np.abs(slope).max())


@CALIBRATED
@pytest.mark.parametrize("missed", [False, True])
def test_the_stiffness_of_the_path_is_the_quotient_of_the_slopes(
    make_record: Callable[..., Record], names: tuple[str, ...], missed: bool
) -> None:
    curves, theta = made(make_record(n=60), errors(*names), missed=missed)
    t, h = np.linspace(42.0, 58.0, 17), 1e-4
    up, down = ([by_hand(curves, theta, c, t + s) for c in ("force", "displacement")] for s in (h, -h))
    expected = (up[0] - down[0]) / (up[1] - down[1])
    usable = np.abs(curves.slope("displacement", t)) > 0.2 * np.abs(curves.slope("displacement", t)).max()
    np.testing.assert_allclose(curves.curve("stiffness", t)[usable], expected[usable], rtol=1e-4)


@pytest.mark.parametrize("missed", [False, True])
def test_a_measured_stiffness_has_a_calibration_of_its_own(
    make_record: Callable[..., Record], missed: bool
) -> None:
    record = make_record(("force", "displacement", "stiffness"), n=60)
    curves, theta = made(record, errors("stiffness", "temperature"), missed=missed)
    expected = by_hand(curves, theta, "stiffness", T)
    h = 1e-4
    rise = by_hand(curves, theta, "stiffness", T + h) - by_hand(curves, theta, "stiffness", T - h)
    np.testing.assert_allclose(
        curves.slope("stiffness", T), rise / (2 * h), atol=1e-5 * np.abs(rise).max() / h
    )
    np.testing.assert_allclose(
        curves.curve("stiffness", T), expected, rtol=1e-7, atol=1e-9 * np.abs(expected).max()
    )


def test_each_draw_may_have_temperatures_of_its_own(make_record: Callable[..., Record]) -> None:
    curves, _ = made(make_record(n=60), errors("force", "temperature"), missed=True)
    t = np.random.default_rng(3).uniform(30.0, 70.0, (SIZE, 5))
    for i in range(SIZE):
        np.testing.assert_allclose(curves.curve("force", t)[i], curves.curve("force", t[i])[i], rtol=1e-10)


def test_what_the_curve_misses_is_the_difference_from_the_model(make_record: Callable[..., Record]) -> None:
    curves, _ = made(make_record(n=60), errors("force", "temperature"), missed=True)
    alone = replace(curves, weights={})
    np.testing.assert_allclose(
        curves.discrepancy("force", T), curves.curve("force", T) - alone.curve("force", T), atol=1e-12
    )
    np.testing.assert_array_equal(alone.discrepancy("force", T), np.zeros((SIZE, T.size)))
    mean = curves.with_mean_discrepancy()
    np.testing.assert_allclose(
        mean.weights["force"], np.tile(curves.weights["force"].mean(axis=0), (SIZE, 1)), rtol=1e-12
    )


@pytest.mark.parametrize("axis", [0, 1])
def test_quantiles_of_finite_draws_are_those_of_numpy(axis: int) -> None:
    draws = np.random.default_rng(0).standard_normal((40, 41))
    levels = (0.05, 0.3, 0.5, 0.95)
    np.testing.assert_array_equal(quantiles(draws, levels, axis), np.quantile(draws, levels, axis=axis))


def test_quantiles_of_infinite_draws_are_the_limits_of_huge_ones() -> None:
    """Every pattern of six draws: finite draws in the place of infinite ones, grown without bound, give the same."""
    levels = np.linspace(0.0, 1.0, 21)
    for below in range(6):
        for above in range(6 - below):
            middle = np.arange(1.0, 7.0 - below - above)
            draws = np.concatenate([np.full(below, -np.inf), middle, np.full(above, np.inf)])
            found = quantiles(draws, levels)
            with_huge = np.quantile(np.clip(draws, -1e200, 1e200), levels)
            expected = np.where(np.abs(with_huge) > 1e100, np.sign(with_huge) * np.inf, with_huge)
            np.testing.assert_array_equal(found, expected)
    between = quantiles(np.array([-np.inf, np.inf]), (0.2, 0.8))
    assert between.tolist() == [-np.inf, np.inf]
    assert np.isnan(quantiles(np.array([np.inf, np.nan, 1.0]), (0.5,))).all()
