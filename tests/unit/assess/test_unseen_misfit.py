"""What a curve may miss: drawn from the residuals, nothing where a discrepancy is there already."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from sma_bayes.assess.draws import RecordDraws, record_draws
from sma_bayes.assess.unseen_misfit import with_unseen_misfit
from sma_bayes.fitting.fit_records import fit_records
from sma_bayes.parameters.priors_file import read_priors
from sma_bayes.records.types import Record


@pytest.fixture(scope="module")
def draws(make_record: Callable[..., Record]) -> RecordDraws:
    record = make_record(n=120, noise=0.01, seed=3)
    return record_draws(fit_records([record], read_priors("modified_sigmoid"), noise="independent", seed=0))


def test_it_is_small_and_seen_in_the_stiffness_most(draws: RecordDraws) -> None:
    assert not draws.weights
    wider = with_unseen_misfit(draws, np.random.default_rng(0))
    at = np.linspace(44.0, 56.0, 9)
    ratio = {c: float(np.median(wider.curve(c, at).std(axis=0) / draws.curve(c, at).std(axis=0)))
             for c in ("force", "displacement", "stiffness")}  # fmt: skip
    assert 1.1 < ratio["stiffness"] < 3.0
    assert max(ratio["force"], ratio["displacement"]) < ratio["stiffness"]
    off = np.median(wider.curve("force", at), axis=0) - np.median(draws.curve("force", at), axis=0)
    assert np.all(np.abs(off) < 2.0 * draws.curve("force", at).std(axis=0))


def test_a_plateau_says_what_the_curve_says(draws: RecordDraws) -> None:
    """Where nothing transforms the stiffness keeps its sign and its size: a misfit has no slope there of its own."""
    wider = with_unseen_misfit(draws, np.random.default_rng(0))
    at = np.array([31.0, 34.0, 66.0, 69.0])
    alone, beside = draws.curve("stiffness", at), wider.curve("stiffness", at)
    assert np.all(np.quantile(beside, 0.05, axis=0) > 0.0)
    width = [np.subtract(*np.quantile(k, [0.95, 0.05], axis=0)) for k in (alone, beside)]
    assert np.all(width[1] < 4.0 * width[0])


def test_a_misfit_that_the_readings_show_is_found(draws: RecordDraws) -> None:
    """A wave of 1.5 noises on the force, of which no parameter knows: the curve follows it to a noise."""
    record, noise = draws.record, 0.025
    wave = 1.5 * noise * np.sin(2.0 * np.pi * (record.temperature - 50.0) / 14.0)
    bent = replace(record, observed={**record.observed, "force": record.observed["force"] + wave})
    moved = replace(draws, posterior=draws.posterior.on([bent], discrepancy=draws.posterior.discrepancy))
    found = with_unseen_misfit(moved, np.random.default_rng(0))
    missed = np.mean(found.curves.discrepancy("force", record.temperature), axis=0)
    inside = (record.temperature > 42.0) & (record.temperature < 58.0)
    assert np.corrcoef(missed[inside], wave[inside])[0, 1] > 0.8
    assert np.abs(missed - wave)[inside].max() < 1.5 * noise


def test_a_channel_with_a_discrepancy_is_left_as_it_is(draws: RecordDraws) -> None:
    once = with_unseen_misfit(draws, np.random.default_rng(0))
    twice = with_unseen_misfit(once, np.random.default_rng(1))
    assert twice is once
