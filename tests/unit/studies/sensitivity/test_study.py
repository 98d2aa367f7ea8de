"""What moves the numbers of a record, against fits without the sweep or the reading, and against arviz."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.stats import t

import sma_bayes
from sma_bayes import fit_campaign
from sma_bayes.assess.draws import RecordDraws
from sma_bayes.assess.sweeps import samples_of_sweeps
from sma_bayes.errors import OutputError, QuantityError
from sma_bayes.records.types import Calibration, Campaign, Record
from sma_bayes.runs.outputs import read_run
from sma_bayes.runs.stored_draws import draws_of
from sma_bayes.studies.sensitivity.bootstrap import bootstrap_sweeps
from sma_bayes.studies.sensitivity.influence import (
    mean_without,
    reading_influence,
    without_readings,
)
from sma_bayes.studies.sensitivity.quantities import (
    densities_of,
    quantities_of,
    stated_temperatures,
)
from sma_bayes.studies.sensitivity.study import studied

DRIFT = np.array([-0.08, -0.05, -0.02, 0.01, 0.02, 0.04, 0.03, 0.05])
"""What the offset of the force is off in each sweep [N]."""


@pytest.fixture(scope="module")
def folder(make_record: Callable[..., Record], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Fits of one sweep with calibrations that are uncertain, of alike sweeps, and of sweeps that drift."""
    one = make_record(n=60, condition="one")
    loose = {
        "temperature": Calibration(0.02, 0.5, 40.0),
        "force": Calibration(0.05, 0.1, 1.0),
        "displacement": Calibration(0.03, 0.0, 0.0),
    }
    alike = make_record(("force",), n=240, segments=8, condition="alike")
    interleaved = replace(alike, inputs={**alike.inputs, "temperature": _swept(alike)})
    curve = 2.5 / (1.0 + np.exp(-0.35 * (interleaved.temperature - 52.0))) + 0.5
    noise = 0.05 * np.random.default_rng(5).standard_normal(alike.n)
    drift = DRIFT[alike.inputs["segment"].astype(int)]
    records = (
        replace(one, calibration=loose),
        replace(interleaved, observed={"force": curve + noise}),
        replace(
            interleaved,
            condition=replace(alike.condition, id="drifting"),
            observed={"force": curve + drift + 0.01 * noise / 0.05},
        ),
    )
    out = tmp_path_factory.mktemp("sensitivity") / "fit"
    campaign = Campaign("spring", "spring", "0" * 64, records)
    fit_campaign(campaign, out, noise="independent", jobs=1, figures=False)
    return out


def _swept(record: Record) -> np.ndarray:
    """The same temperatures in every sweep."""
    number = record.inputs["segment"]
    return np.concatenate([np.linspace(30.0, 70.0, int(np.sum(number == s))) for s in np.unique(number)])


@pytest.fixture(scope="module")
def drawn(folder: Path) -> Callable[[str], RecordDraws]:
    run = read_run(folder)
    entries = {r.key: r for r in run.summary.records}
    return lambda key: draws_of(folder, entries[key], run.summary.seed)


@pytest.mark.parametrize("key", ["one-heating", "alike-heating"])
def test_densities_are_those_that_were_sampled(
    folder: Path, drawn: Callable[[str], RecordDraws], key: str
) -> None:
    """Also where errors of calibrations were carried into the draws."""
    found = densities_of(drawn(key))
    with h5py.File(folder / "posterior" / f"{key}.nc") as file:
        stats = file["sample_stats"]
        np.testing.assert_allclose(found.log_prior, stats["log_prior"][:].ravel(), atol=1e-9)
        np.testing.assert_allclose(found.log_likelihood, stats["log_likelihood"][:].ravel(), atol=1e-7)


def test_sensitivities_are_those_of_arviz_on_the_stored_draws(
    folder: Path, arviz_psens: Callable[..., Any]
) -> None:
    key = "one-heating"
    with h5py.File(folder / "posterior" / f"{key}.nc") as file:
        stats = {name: file["sample_stats"][f"log_{name}"][:] for name in ("prior", "likelihood")}
        draws = {n: v[:] for n, v in file["posterior"].items() if n not in ("chain", "draw")}
    found = sma_bayes.sensitivity(folder, figures=False, jobs=1)
    (record,) = (r for r in found["records"] if r["key"] == key)
    told = {q["name"]: q for q in record["quantities"]}
    for group, density in stats.items():
        other = arviz_psens(draws, density)
        for name in draws:
            assert told[name][group] == pytest.approx(float(other[name]), rel=0.03, abs=1e-5), (name, group)


def test_a_reading_moves_the_mean_as_a_fit_without_it_does(drawn: Callable[[str], RecordDraws]) -> None:
    draws = drawn("alike-heating")
    at = stated_temperatures(draws)
    quantities = quantities_of(draws, at, stiffness=False)
    values = np.stack([q.tamed for q in quantities], axis=1)
    sd = values.std(axis=0)
    densities = densities_of(draws)
    change = reading_influence(values, densities.readings)["force"] / sd[:, None]
    reading = int(np.argmax(np.abs(change[[q.name for q in quantities].index("B3")])))
    anew = mean_without(draws, quantities, np.array([reading]), at, seed=1)
    assert anew is not None
    by_weights, k = without_readings(values, densities.readings["force"][:, [reading]])
    assert k[0] < 0.7
    refitted = (anew - values.mean(axis=0)) / sd
    # means of 2000 draws each, from independent fits: 0.032 sd, five of them
    np.testing.assert_allclose((by_weights[0] - values.mean(axis=0)) / sd, refitted, atol=0.16)
    np.testing.assert_allclose(change[:, reading], refitted, atol=0.16)
    assert np.abs(refitted).max() > 0.2, "the reading must move something for this to test anything"


def test_a_sweep_is_left_out_as_a_fit_without_it_does(drawn: Callable[[str], RecordDraws]) -> None:
    draws = drawn("alike-heating")
    at = stated_temperatures(draws)
    found = studied(draws, at, False, 0).found
    for s in found.left_out_sweeps:
        assert s.pareto_k is not None
        assert s.refitted is (s.pareto_k > 0.7)
    number = min(found.left_out_sweeps, key=lambda s: s.pareto_k or 0.0).sweep
    quantities = quantities_of(draws, at, stiffness=False)
    sweep = samples_of_sweeps(draws.record)[number - 1]
    anew = mean_without(draws, quantities, sweep, at, seed=1)
    assert anew is not None
    told = np.array([q.sweeps[number - 1].change for q in found.quantities], dtype=float)
    values = np.stack([q.tamed for q in quantities], axis=1)
    np.testing.assert_allclose(told, (anew - values.mean(axis=0)) / values.std(axis=0), atol=0.2)


def test_the_bootstrap_has_the_scatter_of_the_sweeps(drawn: Callable[[str], RecordDraws]) -> None:
    """The offset of J sweeps that drift: a mean of their offsets, of standard deviation sd/sqrt(J + 1)."""
    draws = drawn("drifting-heating")
    found = bootstrap_sweeps(draws, (40.0,), 0, stiffness=False, replicates=1000)
    assert found is not None
    assert found.failed == 0
    (offset,) = (q for q in found.quantities if q.name == "B4")
    expected = DRIFT.std() / np.sqrt(DRIFT.size + 1)
    # standard error of a standard deviation of 1000: 2.2 %, four of them and what noise adds
    assert offset.draws.std() == pytest.approx(expected, rel=0.1)
    assert offset.draws.mean() == pytest.approx(
        0.5 + DRIFT.mean(), abs=4.0 * expected / np.sqrt(1000) + 0.003
    )


def test_under_heavy_tails_the_bootstrap_is_that_of_the_weighted_likelihood(
    make_record: Callable[..., Record], tmp_path: Path
) -> None:
    """Against the greatest weighted likelihood found by scipy for as many weights of its own.

    Of 300 replicates each the ratio of two standard deviations has a standard error of 5.8 %; readings that keep
    their weights whichever sweeps count give two thirds of it (three degrees of freedom).
    """
    record = make_record(("force",), n=240, segments=12, condition="tails")
    record = replace(record, inputs={**record.inputs, "temperature": _swept(record)})
    curve = 2.5 / (1.0 + np.exp(-0.35 * (record.temperature - 52.0))) + 0.5
    noise = 0.05 * np.random.default_rng(8).standard_t(2.0, record.n)
    record = replace(record, observed={"force": curve + noise})
    campaign = Campaign("spring", "spring", "0" * 64, (record,))
    fit_campaign(campaign, tmp_path / "fit", noise="student_t", jobs=1, figures=False)
    run = read_run(tmp_path / "fit")
    draws = draws_of(tmp_path / "fit", run.summary.records[0], run.summary.seed)
    found = bootstrap_sweeps(draws, (40.0,), 0, stiffness=False)
    assert found is not None
    (offset,) = (q for q in found.quantities if q.name == "B4")
    middle = dict(zip(draws.posterior.names, np.median(draws.before_calibration, axis=0), strict=True))
    start = np.array([middle[f"B{i}"] for i in range(1, 5)])
    scale, tails = middle["force_sd"], middle["force_nu"]

    def misfit(x: np.ndarray, weight: np.ndarray) -> float:
        level = x[0] / (1.0 + np.exp(-x[1] * (record.temperature - x[2]))) + x[3]
        return float(-weight @ t.logpdf((record.observed["force"] - level) / scale, tails))

    own = np.random.default_rng(1)
    number = record.inputs["segment"].astype(int)
    best = [
        minimize(misfit, start, args=(12.0 * own.dirichlet(np.ones(12))[number],), method="BFGS").x[3]
        for _ in range(300)
    ]
    assert offset.draws.std() == pytest.approx(np.std(best), rel=0.2)


def test_sweeps_that_drift_are_told(folder: Path) -> None:
    found = sma_bayes.sensitivity(folder, figures=False, jobs=1)
    by_key = {r["key"]: r for r in found["records"]}
    (offset,) = (q for q in by_key["drifting-heating"]["quantities"] if q["name"] == "B4")
    worst = max(offset["sweeps"], key=lambda s: abs(s["change"] or 0.0))
    assert worst["sweep"] == 1  # the one that is farthest off
    assert worst["change"] > 0.0
    (alike,) = (q for q in by_key["alike-heating"]["quantities"] if q["name"] == "B4")
    assert 0.5 < alike["bootstrap"]["width"] < 1.6
    one = by_key["one-heating"]
    assert one["bootstrap"] is None
    assert one["left_out_sweeps"] == []
    assert {q["name"] for q in one["quantities"]} >= {
        "A2",
        "B2",
        "least stiffness",
        "greatest stiffness",
        "As",
        "Af",
    }


def test_temperatures_are_those_that_were_asked_for(folder: Path) -> None:
    found = sma_bayes.sensitivity(folder, at="113 degF", figures=False, jobs=1)
    names = {q["name"] for r in found["records"] for q in r["quantities"] if q["temperature"] is not None}
    assert names == {"stiffness at 45 °C", "force at 45 °C"}


@pytest.mark.parametrize(
    ("at", "told"), [("60", "no unit"), ("60 N", "wrong kind"), ("200 degC", "measured by no record")]
)
def test_a_temperature_that_can_not_be_told_is_refused(folder: Path, at: str, told: str) -> None:
    with pytest.raises(QuantityError, match=told):
        sma_bayes.sensitivity(folder, at=at)


def test_shared_parameters_are_refused(make_record: Callable[..., Record], tmp_path: Path) -> None:
    records = tuple(make_record(("force",), n=30, seed=i, condition=c) for i, c in enumerate("ab"))
    campaign = Campaign("spring", "spring", "0" * 64, records)
    fit_campaign(campaign, tmp_path / "fit", noise="independent", pool="campaign", jobs=1, figures=False)
    with pytest.raises(OutputError, match="share A and B"):
        sma_bayes.sensitivity(tmp_path / "fit")
