"""A fit: draws as parameters, and the uncertainty of a calibration on top."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from sma_bayes.fitting.fit import DRAWS_PER_ENSEMBLE, Fit
from sma_bayes.fitting.fit_records import (
    UNDETERMINED_BLOCK_STEPS,
    UNDETERMINED_EVALUATIONS,
    UNSEEN_EVALUATIONS,
    exact_channels,
    excluded,
    fit_records,
    seen,
    with_what_is_worth_it,
)
from sma_bayes.parameters.priors_file import read_priors
from sma_bayes.records.types import Calibration, Record
from sma_bayes.sampling.ensembles import Plan

DEFAULT = read_priors("modified_sigmoid")


@pytest.fixture(scope="module")
def record(make_record: Callable[..., Record]) -> Record:
    calibration = {"force": Calibration(0.03, 0.2, 0.05), "displacement": Calibration(0.0, 0.0, 0.0)}
    return replace(make_record(n=60), calibration=calibration)


@pytest.fixture(scope="module")
def fit(record: Record) -> Fit:
    return fit_records([record], DEFAULT, noise="independent", seed=3)


def test_draws_are_kept_evenly_from_every_ensemble(fit: Fit) -> None:
    groups, steps, walkers, d = fit.draws.z.shape
    assert fit.converged
    assert fit.z.shape == (groups, min(DRAWS_PER_ENSEMBLE, steps * walkers), d)
    assert fit.theta.shape == (*fit.z.shape[:2], len(fit.posterior.space.names))
    assert fit.flat.shape == (fit.z.shape[0] * fit.z.shape[1], fit.theta.shape[-1])
    np.testing.assert_array_equal(fit.theta, fit.posterior.space.constrain(fit.z))
    for g in range(groups):
        mine = fit.draws.z[g].reshape(-1, d)
        assert np.all(np.isin(fit.z[g, :, 0], mine[:, 0]))
    spread = fit.z.reshape(-1, d).std(axis=0) / fit.draws.z.reshape(-1, d).std(axis=0)
    np.testing.assert_allclose(spread, 1.0, atol=0.1)


def test_the_same_seed_gives_the_same_fit(fit: Fit, record: Record) -> None:
    again = fit_records([record], DEFAULT, noise="independent", seed=3)
    np.testing.assert_array_equal(again.draws.z, fit.draws.z)
    other = fit_records([record], DEFAULT, noise="independent", seed=4)
    assert not np.array_equal(other.draws.z, fit.draws.z)


def test_the_posterior_covers_what_was_planted(fit: Fit) -> None:
    """Five posterior standard deviations for each of 8 parameters; the seed is fixed."""
    truth = {"A1": 0.02, "A2": 0.30, "A3": 48.0, "A4": 0.001, "B1": 2.5, "B2": 0.35, "B3": 52.0, "B4": 0.5}
    for name, value in truth.items():
        x = fit.flat[:, fit.posterior.space.index(name)]
        assert abs(x.mean() - value) < 5.0 * x.std(), name


def test_a_calibration_widens_spans_and_offsets_by_what_was_declared(fit: Fit) -> None:
    """gain = 1 + 3 %; shift = offset error - offset times gain error; 2000 draws, within 10 %."""
    errors = fit.calibration_draws()
    assert list(errors) == ["force"]
    gain, shift = errors["force"]
    assert gain.shape == shift.shape == (len(fit.flat),)
    assert np.std(gain) == pytest.approx(0.03, rel=0.1)
    assert np.std(shift) == pytest.approx(np.hypot(0.05, 0.2 * 0.03), rel=0.1)
    space = fit.posterior.space
    plain, wide = fit.flat, fit.calibrated()
    for name in ("A1", "A4", "A3", "B2", "B3", "force_sd"):
        np.testing.assert_array_equal(plain[:, space.index(name)], wide[:, space.index(name)])
    np.testing.assert_allclose(wide[:, space.index("B1")], plain[:, space.index("B1")] * gain)
    np.testing.assert_allclose(wide[:, space.index("B4")], plain[:, space.index("B4")] * gain + shift)
    for channel, (again_gain, again_shift) in fit.calibration_draws().items():
        assert channel == "force"
        np.testing.assert_array_equal(again_gain, gain)
        np.testing.assert_array_equal(again_shift, shift)


def test_without_a_calibration_nothing_is_added(make_record: Callable[..., Record], fit: Fit) -> None:
    bare = Fit(
        replace(fit.posterior, records=(make_record(n=60),)),
        fit.warm_start,
        *(getattr(fit, name) for name in _rest(fit)),
    )
    assert bare.calibration_draws() == {}
    np.testing.assert_array_equal(bare.calibrated(), bare.flat)


def _rest(fit: Fit) -> list[str]:
    from dataclasses import fields

    given = [f.name for f in fields(fit) if f.init]
    return given[2:]


def hopeless(kind: str, record: Record) -> Record:
    """What was measured with a mistake that leaves no curve to be seen, or none that the priors allow."""
    rng = np.random.default_rng(5)
    observed = dict(record.observed)
    if kind == "noise":
        observed = {c: y.mean() + 0.1 * np.ptp(y) * rng.standard_normal(y.size) for c, y in observed.items()}
    elif kind == "misread":
        observed["force"] = (
            np.where(rng.random(record.temperature.size) < 1.0 / 3.0, 1000.0, 1.0) * observed["force"]
        )
    elif kind == "quantised":
        step = np.round(rng.normal(0.0, 0.4, record.temperature.size))
        observed = {c: y.mean() * (1.0 + 0.01 * step) for c, y in observed.items()}
    elif kind == "swapped":
        inputs = {**record.inputs, "temperature": 10.0 * observed["force"]}
        return replace(record, inputs=inputs, observed={**observed, "force": record.temperature})
    return replace(record, observed=observed)


def whole_evaluations(fit: Fit) -> float:
    """Evaluations of the density of all channels: one of a channel alone is its share of those."""
    return fit.draws.evaluations / max(1, len(fit.posterior.factors()))


@pytest.mark.parametrize("kind", ["noise", "misread", "quantised", "swapped"])
def test_a_curve_that_nobody_can_see_takes_bounded_work(
    make_record: Callable[..., Record], kind: str
) -> None:
    """First proposals, and two blocks of 4 times 64 walkers at most: a tenth of what it took to find nothing more."""
    found = fit_records([hopeless(kind, make_record(n=40, noise=0.02))], DEFAULT)
    start = found.warm_start
    assert not seen(start) or excluded(found.posterior, start)
    block = UNDETERMINED_BLOCK_STEPS * 4 * 64
    assert whole_evaluations(found) < UNDETERMINED_EVALUATIONS + 2 * block + UNDETERMINED_EVALUATIONS // 4


@pytest.mark.parametrize("n", [40, 400])
def test_a_curve_that_was_computed_is_told_and_takes_bounded_work(
    make_record: Callable[..., Record], n: int
) -> None:
    """It took 368,000 evaluations and more; the mode is found all the same, to the digits of the numbers."""
    record = make_record(n=n, noise=0.0)
    found = fit_records([record], DEFAULT)
    assert exact_channels(found.posterior, found.start, 0) == record.channels
    assert all(found.warm_start.fit[0][c].rmse < 1e-12 * np.ptp(y) for c, y in record.observed.items())
    assert whole_evaluations(found) < UNDETERMINED_EVALUATIONS + UNDETERMINED_BLOCK_STEPS * 4 * 64


def test_a_logger_of_24_bits_measures_and_does_not_compute(make_record: Callable[..., Record]) -> None:
    """Readings whose noise is half a step of the finest converter, read at half its range."""
    record = make_record(n=80, noise=0.0)
    rng = np.random.default_rng(4)
    finest = {c: np.ptp(y) * 2.0**-23 for c, y in record.observed.items()}
    read = {
        c: np.round((y + 0.5 * finest[c] * rng.standard_normal(80)) / finest[c]) * finest[c]
        for c, y in record.observed.items()
    }
    found = fit_records([replace(record, observed=read)], DEFAULT)
    assert exact_channels(found.posterior, found.start, 0) == ()


def test_a_response_that_can_be_seen_is_given_all_evaluations(make_record: Callable[..., Record]) -> None:
    record = make_record(n=40, noise=0.1)
    found = fit_records([record], DEFAULT, noise="independent")
    assert seen(found.warm_start)
    assert not excluded(found.posterior, found.warm_start)


def test_doubted_records_are_given_few_evaluations_and_the_same_draws_where_those_do(
    fit: Fit, record: Record
) -> None:
    plan = with_what_is_worth_it(Plan(), fit.posterior, fit.warm_start, doubted=True)
    assert plan.evaluations == UNSEEN_EVALUATIONS
    assert with_what_is_worth_it(Plan(), fit.posterior, fit.warm_start, doubted=False) == Plan()
    again = fit_records([record], DEFAULT, noise="independent", seed=3, doubted=True)
    np.testing.assert_array_equal(again.draws.z, fit.draws.z)
