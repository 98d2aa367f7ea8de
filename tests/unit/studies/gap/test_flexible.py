"""Flexible terms against the Gaussian marginal likelihood by dense matrices."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import logsumexp

from sma_bayes.parameters.priors_file import read_priors
from sma_bayes.records.history import histories
from sma_bayes.studies.gap.fitting import fit_hypothesis, fit_with_noise
from sma_bayes.studies.gap.flexible import (
    COEFFICIENT_SD_GRID,
    Term,
    WhitenedTerms,
    beyond_shape,
    gains,
    shape_terms,
    terms_of,
)
from sma_bayes.studies.gap.hypothesis import baseline
from sma_bayes.studies.gap.splines import bspline_basis, grouped, indicators, row_tensor_product

VAGUE = (50.0, 50.0, 50.0)
"""Priors a hundred times as wide as what the measurements leave open."""


@pytest.mark.parametrize("count", [1, 4])
def test_its_bayes_factor_is_a_ratio_of_marginal_likelihoods(count: int, make_line) -> None:
    line = make_line(prior_sd=VAGUE, phi=0.6)
    fitted = fit_hypothesis(line.hypothesis, line.prior_mean, line.noise)
    columns = np.random.default_rng(2).standard_normal((line.y.size, count))
    (gain,) = gains(fitted, [Term("anything", "displacement", columns)])
    plain = line.log_evidence()
    each = [line.log_evidence(extra=s**2 * columns @ columns.T) - plain for s in COEFFICIENT_SD_GRID]
    exact = float(logsumexp(each) - np.log(COEFFICIENT_SD_GRID.size))
    assert gain.ln_bayes_factor == pytest.approx(exact, abs=2e-3)
    assert gain.of(fitted.whitened[:, None])[0] == pytest.approx(exact, abs=2e-3)


NARROW = (0.04, 0.04, 0.04)


@pytest.mark.parametrize("prior_sd", [VAGUE, NARROW])
def test_its_bayes_factor_of_what_is_there_and_half_absorbed(
    prior_sd: tuple[float, float, float], make_line
) -> None:
    """A slope, much like one of the line's; what narrow priors keep the line from taking earns the term nothing."""
    line = make_line(prior_sd=prior_sd, phi=0.0)
    y = line.y + 0.8 * line.x[:, 1]
    cut = line.hypothesis.histories[0].n
    seen = tuple(
        replace(h, observed={"displacement": v})
        for h, v in zip(line.hypothesis.histories, np.split(y, [cut]), strict=True)
    )
    line = replace(line, y=y, hypothesis=replace(line.hypothesis, histories=seen))
    fitted = fit_hypothesis(line.hypothesis, line.prior_mean, line.noise)
    columns = line.x[:, 1:2] + 0.3 * np.random.default_rng(2).standard_normal((y.size, 1))
    (gain,) = gains(fitted, [Term("anything", "displacement", columns)])
    plain = line.log_evidence()
    each = [line.log_evidence(extra=s**2 * columns @ columns.T) - plain for s in COEFFICIENT_SD_GRID]
    exact = float(logsumexp(each) - np.log(COEFFICIENT_SD_GRID.size))
    if prior_sd is NARROW:
        assert 0.0 < gain.ln_bayes_factor < exact - 10.0
    else:
        assert gain.ln_bayes_factor == pytest.approx(exact, abs=0.02)


def test_what_the_model_can_do_itself_brings_nothing(make_line) -> None:
    line = make_line(prior_sd=VAGUE)
    fitted = fit_hypothesis(line.hypothesis, line.prior_mean, line.noise)
    (gain,) = gains(fitted, [Term("temperature", "displacement", line.x[:, 1:2])])
    assert gain.ln_bayes_factor < 0.0


@pytest.fixture(scope="module")
def null(rig):
    """A fit of a campaign in which nothing is hidden."""
    campaign = rig(channels=("force", "displacement")).campaign()
    hypothesis = baseline(campaign, histories(campaign), read_priors("modified_sigmoid"), pooled=True)
    return fit_with_noise(hypothesis, hypothesis.space.prior_centre())


def test_without_a_pattern_none_is_favoured(null) -> None:
    """A Bayes factor of 20 or more has a probability of at most 1/20 where it favours what is not there (Markov)."""
    noise = np.random.default_rng(3).standard_normal((null.whitened.size, 400))
    for gain in gains(null, terms_of(null)):
        values = gain.of(noise)
        assert np.median(values) < 0.0, gain.term.covariate
        assert np.mean(values > np.log(20.0)) <= 0.05, gain.term.covariate
        assert gain.ln_bayes_factor < np.log(1000.0), gain.term.covariate


def test_terms_that_were_whitened_once_bring_the_same_in_every_model(null) -> None:
    terms = terms_of(null)
    once = WhitenedTerms(null, terms)
    fine, _ = shape_terms(null)
    for model in (null, beyond_shape(null, fine)[0]):
        one_by_one = gains(model, terms)
        together = once.gains(model)
        assert [g.term for g in together] == [g.term for g in one_by_one]
        np.testing.assert_allclose(
            [g.ln_bayes_factor for g in together],
            [g.ln_bayes_factor for g in one_by_one],
            rtol=1e-6,
            atol=1e-2,
        )


def test_a_pattern_is_found_where_it_was_planted(null) -> None:
    terms = terms_of(null)
    rng = np.random.default_rng(4)
    by_name = {}
    for term in terms:
        by_name.setdefault((term.covariate, term.channel), term)
    for name in [("cycle", "force"), ("rate", "displacement"), ("condition", "force")]:
        term = by_name[name]
        planted = null.whiten((term.columns @ rng.normal(0.0, 3.0, term.columns.shape[1]))[None])[0]
        residuals = planted + rng.standard_normal(planted.size)
        found = {id(g.term): float(g.of(residuals[:, None])[0]) for g in gains(null, terms)}
        assert found[id(term)] > 20.0
        assert found[id(term)] > max(
            found[id(t)] for t in terms if {t.channel, name[1]} == {"force", "displacement"}
        )


def test_terms_stay_in_their_channel_and_there_are_those_that_the_inputs_allow(null) -> None:
    terms = terms_of(null)
    rows = {c: np.zeros(null.whitened.size, dtype=bool) for c in ("force", "displacement")}
    for block in null.blocks:
        rows[block.channel][block.at] = True
    for term in terms:
        if term.channel in rows:
            assert not np.any(term.columns[~rows[term.channel]])
    seen = {t.covariate for t in terms}
    assert {"temperature", "condition", "cycle", "time", "rate", "force", "displacement", "load"} <= seen
    assert not seen & {"current", "ambient_temperature", "drive phase"}


def test_a_joint_shift_of_temperature_moves_every_channel_by_its_slope(null) -> None:
    """The splines of temperature add up to 1, and with them the columns of the term to the leverage itself."""
    term = next(t for t in terms_of(null) if (t.covariate, t.channel) == ("temperature", "temperature shift"))
    whole = term.columns.sum(axis=1)
    theta = dict(zip(null.hypothesis.space.names, null.theta, strict=True))
    exact = np.empty_like(whole)
    for block in null.blocks:
        v = null.hypothesis.histories[block.history].inputs
        letter = "B" if block.channel == "force" else "A"
        for sign, branch in ((1.0, "heating"), (-1.0, "cooling")):
            a, b, c = (theta[f"{letter}{i} {branch}"] for i in (1, 2, 3))
            slope = a * b / (2.0 * np.cosh(0.5 * b * (v["temperature"] - c))) ** 2
            exact[block.at] = np.where(v["branch"] == sign, slope, exact[block.at])
    np.testing.assert_allclose(whole / np.max(np.abs(whole)), exact / np.max(np.abs(exact)), atol=1e-4)


def test_splines_add_up_to_1_and_bend_at_will() -> None:
    x = np.random.default_rng(5).uniform(3.0, 9.0, 300)
    columns = bspline_basis(x, 8)
    np.testing.assert_allclose(columns.sum(axis=1), 1.0)
    assert columns.min() >= 0.0
    cubic = 1.0 - x + 0.3 * x**2 - 0.02 * x**3
    left = cubic - columns @ np.linalg.lstsq(columns, cubic, rcond=None)[0]
    np.testing.assert_allclose(left, 0.0, atol=1e-10)


def test_columns_of_labels() -> None:
    cycle = np.repeat(np.arange(1.0, 25.0), 3)
    joined = grouped(cycle)
    assert np.unique(joined).size == 8
    assert np.all(np.diff(joined) >= 0.0)
    np.testing.assert_array_equal(grouped(np.array([2.0, 2.0, 5.0])), [0.0, 0.0, 1.0])
    one = indicators(np.array([7.0, 3.0, 7.0]))
    np.testing.assert_array_equal(one, [[0.0, 1.0], [1.0, 0.0], [0.0, 1.0]])
    np.testing.assert_array_equal(
        row_tensor_product(one, np.array([[1.0], [2.0], [0.0]])), [[0.0, 1.0], [2.0, 0.0], [0.0, 0.0]]
    )
