"""Sweeps left out: places in what the others predict are uniform where sweeps are alike; one that differs is found.

False alarms, were the seed drawn anew: each test of uniformity fails in one file of 100 at most, by its own limit.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.stats import chi2, kstest

from sma_bayes.assess.checks import FALSE_ALARM_RATE
from sma_bayes.assess.sweeps import LeftOutSweep, _distance, left_out_sweeps, sweep_checks
from sma_bayes.fitting.fit import Fit
from sma_bayes.fitting.fit_records import fit_records
from sma_bayes.noise import NOISE_MODELS, Steps
from sma_bayes.parameters.priors_file import read_priors
from sma_bayes.records.types import Branch, Condition, Record
from sma_bayes.studies.fit.summary import record_summary

PRIORS = read_priors("modified_sigmoid")
SAMPLES = 40
ALARM = 0.01


def swept(
    seed: int, sweeps: int = 4, *, shift: float = 0.0, noise: str = "independent", bend: float = 0.0
) -> Record:
    """Sweeps of one curve under some noise; the midpoint of the last is `shift` kelvin further on."""
    rng = np.random.default_rng([seed, 5])
    t = np.tile(np.linspace(30.0, 70.0, SAMPLES), sweeps)
    segment = np.repeat(np.arange(float(sweeps)), SAMPLES)
    inputs = {"temperature": t, "time": np.arange(float(t.size)), "segment": segment}
    x = 1.0 + 20.0 / (1.0 + np.exp(-0.3 * (t - 48.0 - shift * (segment == sweeps - 1.0))))
    x = x + bend * np.sin(t / 3.0)
    shape = {"independent": [], "ar1": [0.6], "student_t": [4.0]}[noise]
    units = {"temperature": "degC", "displacement": "m", "time": "s"}
    record = Record(
        Condition(f"{seed}"), Branch.HEATING, inputs, {"displacement": x}, np.arange(t.size) + 2, units
    )
    e = NOISE_MODELS[noise].draw(rng, np.array([shape]), Steps.of(record))[0]
    return Record(record.condition, record.branch, inputs, {"displacement": x + 0.4 * e}, record.row, units)


@cache
def fitted_alone(seed: int, sweeps: int, noise: str) -> Fit:
    """A fit of curve and noise as they are: with room for a discrepancy that is not there predictions are wider."""
    return fit_records([swept(seed, sweeps, noise=noise)], PRIORS, noise=noise, discrepancy=False)


@cache
def fitted(
    seed: int, sweeps: int = 4, shift: float = 0.0, noise: str = "independent", bend: float = 0.0
) -> Fit:
    return fit_records([swept(seed, sweeps, shift=shift, noise=noise, bend=bend)], PRIORS, noise=noise)


def places(noise: str, sweeps: int, count: int) -> tuple[list[float], list[float]]:
    """Places of one sweep of each of some records, and p-values of the checks, under the truth."""
    found = [left_out_sweeps(fitted_alone(seed, sweeps, noise)) for seed in range(count)]
    told = [s[seed % sweeps].pit for seed, s in enumerate(found)]
    assert all(p is not None for p in told)
    return [p for p in told if p is not None], [c.p_value for s in found for c in sweep_checks(s)]


def test_places_are_uniform_under_the_truth() -> None:
    pit, p = places("independent", 3, 30)
    assert kstest(pit, "uniform").pvalue > ALARM
    assert kstest(p, "uniform").pvalue > ALARM


@pytest.mark.slow
@pytest.mark.parametrize(
    ("noise", "sweeps"),
    [
        ("independent", 4),
        *(pytest.param(*case, marks=pytest.mark.thorough) for case in (("ar1", 3), ("student_t", 4))),
    ],
)
def test_places_are_uniform_under_the_truth_of_more_records(noise: str, sweeps: int) -> None:
    """Of 60 records the check may fail in one: a false alarm of the check in 500 makes that one file of 150."""
    pit, p = places(noise, sweeps, 60)
    assert kstest(pit, "uniform").pvalue > ALARM / 3.0
    assert kstest(p, "uniform").pvalue > ALARM / 3.0
    assert np.sum(np.array(p) < FALSE_ALARM_RATE) <= 1


@pytest.mark.parametrize("noise", ["independent", "ar1"])
def test_a_sweep_that_differs_is_found_and_named(noise: str) -> None:
    """Two kelvin of 40, the noise 2 % of the span."""
    found = left_out_sweeps(fitted(1, 4, 2.0, noise))
    (check,) = sweep_checks(found)
    assert check.failed
    assert check.p_value < FALSE_ALARM_RATE
    assert check.meaning.endswith("sweep 4")
    assert max(found, key=lambda s: s.distance or 0.0).sweep == 4
    assert check.measured > check.q95
    assert found[3].refitted  # weights can't tell of a sweep that differs


def test_a_common_misfit_is_no_difference_between_sweeps() -> None:
    """What all sweeps have, and a discrepancy describes, is foreseen."""
    fit = fitted(2, 4, bend=2.0)
    assert fit.posterior.has_discrepancy
    (check,) = sweep_checks(left_out_sweeps(fit))
    assert not check.failed


def test_two_sweeps_are_not_judged() -> None:
    assert left_out_sweeps(fitted(0, 2)) == []
    assert sweep_checks([]) == []


def test_what_cannot_be_told_is_said_and_paid_for() -> None:
    """The least of four probabilities counts four times, also where one sweep could not be told."""
    told = LeftOutSweep(
        sweep=1, channel="force", distance=5.0, pit=0.99, r=4, spare=100, pareto_k=0.3, refitted=False
    )
    unknown = LeftOutSweep(
        sweep=2, channel="force", distance=None, pit=None, r=4, spare=100, pareto_k=1.2, refitted=False
    )
    (check,) = sweep_checks([told, unknown, unknown, unknown])
    (alone,) = sweep_checks([told])
    assert check.p_value == pytest.approx(1.0 - (1.0 - alone.p_value) ** 4)
    assert "3 of 4 sweeps can't be judged" in check.meaning
    assert sweep_checks([unknown]) == []


def test_the_distance_is_that_of_the_predictive_distribution() -> None:
    """Normal draws of known covariance: against Mahalanobis, and with unequal weights against resampling by hand."""
    rng = np.random.default_rng(3)
    rows = np.linalg.qr(rng.standard_normal((12, 3)))[0].T
    spread = np.diag([0.5, 1.0, 2.0])
    draws = rng.standard_normal((200_000, 3)) @ spread
    off = np.array([1.0, -2.0, 0.5])
    e = (off + draws) @ rows
    expected = off @ np.linalg.solve(np.eye(3) + spread**2, off) / 3.0
    got = _distance(e, np.zeros(len(e)), rows)
    assert got == pytest.approx(expected, rel=0.02)
    tilted = _distance(e, draws[:, 0], rows)  # weights exp(z) of a normal shift its mean by its variance
    moved = off + np.array([0.25, 0.0, 0.0])
    assert tilted == pytest.approx(moved @ np.linalg.solve(np.eye(3) + spread**2, moved) / 3.0, rel=0.03)
    assert chi2.sf(3.0 * expected, 3) > 0.1


def test_the_summary_has_every_sweep() -> None:
    fit = fitted(0, 3)
    found = record_summary(fit, 0, {}, {})
    assert [s.sweep for s in found.left_out_sweeps] == [1, 2, 3]
    assert "left_out_sweeps" in [c.statistic for c in found.checks]


def test_draws_whose_innovations_are_not_finite_have_no_distance() -> None:
    rows, e = np.eye(3)[:2], np.zeros((5, 3))
    e[2] = np.inf, np.nan, 0.0
    assert _distance(e, np.zeros(5), rows) is None
    assert _distance(e, np.where(np.arange(5) == 2, -np.inf, 0.0), rows) == 0.0
