"""Least squares with a response model, against scipy's `curve_fit` and against what can be said by hand."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import curve_fit

import sma_bayes
from sma_bayes.errors import MeasurementError, SmaBayesError
from sma_bayes.fitting.least_squares import least_squares_at
from sma_bayes.records.types import Record
from sma_bayes.response import ModifiedSigmoid

MakeRecord = Callable[..., Record]
FORCE = {"B1": 2.0, "B2": 0.3, "B3": 50.0, "B4": 0.4}


def sigmoid(t: np.ndarray, span: float, rate: float, midpoint: float, offset: float) -> np.ndarray:
    return offset + span / (1.0 + np.exp(-rate * (t - midpoint)))


@pytest.mark.parametrize("from_priors", [True, False])
def test_two_channels_are_two_fits_of_curve_fit(make_record: MakeRecord, from_priors: bool) -> None:
    """Estimates and standard errors of each channel are those of the channel alone, whatever the other's noise."""
    record = make_record(("force", "displacement"), n=60)
    noisy = record.observed["displacement"] * (1.0 + 0.05 * np.sin(7.0 * np.arange(record.n)))
    record = replace(record, observed={"force": record.observed["force"], "displacement": noisy})
    start = None if from_priors else {"A1": 0.01, "A2": 0.2, "A3": 45.0, "A4": 0.0, **FORCE}
    fit = sma_bayes.least_squares(record, start=start)
    assert fit.converged
    assert fit.rank == 8
    for channel, letter in (("displacement", "A"), ("force", "B")):
        names = [f"{letter}{k}" for k in range(1, 5)]
        begin = [fit.estimate[n] * 1.02 for n in names]
        found, covariance = curve_fit(
            sigmoid, record.temperature, record.observed[channel], p0=begin, xtol=1e-14, ftol=1e-14
        )
        assert [fit.estimate[n] for n in names] == pytest.approx(found, rel=1e-6)
        assert [fit.standard_error[n] for n in names] == pytest.approx(np.sqrt(np.diag(covariance)), rel=1e-4)
        assert fit.degrees_of_freedom[channel] == 56
        r = record.observed[channel] - sigmoid(record.temperature, *found)
        assert fit.sum_of_squares[channel] == pytest.approx(r @ r, rel=1e-9)
        assert fit.residual_sd[channel] == pytest.approx(np.sqrt(r @ r / 56), rel=1e-9)


def test_the_table_has_units(make_record: MakeRecord) -> None:
    table = sma_bayes.least_squares(make_record(("force",), n=40)).summary()
    assert list(table.columns) == ["unit", "estimate", "standard_error"]
    assert table.loc["B1", "unit"] == "N"
    assert table.loc["B3", "estimate"] == pytest.approx(52.0, abs=2.0)


def test_a_held_parameter_stays_and_has_no_error(make_record: MakeRecord) -> None:
    record = make_record(("force",), n=40)
    fit = sma_bayes.least_squares(record, start=FORCE, fixed=["B4"])
    assert fit.estimate["B4"] == FORCE["B4"]
    assert fit.standard_error["B4"] == 0.0
    assert fit.degrees_of_freedom["force"] == 37
    all_held = sma_bayes.least_squares(record, start=FORCE, fixed=list(FORCE))
    assert all_held.estimate == FORCE
    assert all_held.rank == 0


def test_a_parameter_that_the_data_leave_free_has_an_infinite_error(make_record: MakeRecord) -> None:
    """Far above the transformation the curve is its level: only the sum of span and offset is seen."""
    record = make_record(("force",), n=40)
    far = {"B1": 2.0, "B2": 10.0, "B3": -500.0, "B4": 0.4}
    fit = sma_bayes.least_squares(record, start=far, fixed=["B2", "B3"])
    assert fit.rank == 1
    assert fit.standard_error["B1"] == fit.standard_error["B4"] == np.inf
    assert fit.estimate["B1"] + fit.estimate["B4"] == pytest.approx(record.observed["force"].mean())


def test_beside_the_minimum_it_has_not_converged(make_record: MakeRecord) -> None:
    record = make_record(("force",), n=40)
    best = sma_bayes.least_squares(record)
    model, free = ModifiedSigmoid(("force",)), np.arange(4)
    theta = np.array([best.estimate[name] for name in model.parameter_names])
    assert least_squares_at([record], model, theta, free).converged
    error = np.array([best.standard_error[name] for name in model.parameter_names])
    beside = least_squares_at([record], model, theta + 0.1 * error, free)
    assert not beside.converged
    assert beside.sum_of_squares["force"] > best.sum_of_squares["force"]


def test_as_many_samples_as_parameters_leave_no_scatter() -> None:
    t = np.array([40.0, 48.0, 53.0, 60.0])
    whole = np.array([2.0, 0.3, 50.0, 0.4])
    record = sma_bayes.Record(
        sma_bayes.Condition("a"), sma_bayes.twin_campaign().records[0].branch, {"temperature": t},
        {"force": sigmoid(t, *whole)}, np.arange(4), {"temperature": "degC", "force": "N"},
    )  # fmt: skip
    fit = sma_bayes.least_squares(record, start={"B1": 2.1, "B2": 0.28, "B3": 50.5, "B4": 0.35})
    assert list(fit.estimate.values()) == pytest.approx(whole, rel=1e-8)
    assert np.isnan(fit.residual_sd["force"])
    assert np.isnan(list(fit.standard_error.values())).all()
    with pytest.raises(MeasurementError, match="3 samples can't determine 4 parameters"):
        sma_bayes.least_squares(
            replace(record, inputs={"temperature": t[:3]}, observed={"force": t[:3]}, row=np.arange(3)),
            start=FORCE,
        )


@pytest.mark.parametrize(
    ("start", "fixed", "message"),
    [
        ({"B1": 1.0}, (), "start says nothing of B2, B3, B4"),
        ({**FORCE, "B5": 1.0}, (), "no parameter 'B5'"),
        (FORCE, ("B9",), "no parameter 'B9'"),
        ({**FORCE, "B1": np.nan}, (), "not finite at the start"),
    ],
)
def test_what_cannot_be_started_from_is_refused(
    make_record: MakeRecord, start: dict[str, float], fixed: tuple[str, ...], message: str
) -> None:
    with pytest.raises(SmaBayesError, match=message):
        sma_bayes.least_squares(make_record(("force",), n=40), start=start, fixed=fixed)


def test_models_go_by_name_or_as_made(make_record: MakeRecord) -> None:
    record = make_record(("force",), n=40)
    one = sma_bayes.least_squares(record, "modified_sigmoid", start=FORCE)
    two = sma_bayes.least_squares([record], ModifiedSigmoid(("force",)), start=FORCE)
    assert one.estimate == two.estimate
    with pytest.raises(SmaBayesError, match="modified_sigmoi"):
        sma_bayes.least_squares(record, "modified_sigmoi")
