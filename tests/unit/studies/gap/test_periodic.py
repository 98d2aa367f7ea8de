"""Lines and bands of the spectrum of residuals, for disturbances that no covariate shows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import binom

from sma_bayes.arrays import Floats
from sma_bayes.effects import EFFECTS
from sma_bayes.parameters.priors_file import read_priors
from sma_bayes.records.history import History, histories
from sma_bayes.studies.gap.fitting import FittedHypothesis, fit_with_noise
from sma_bayes.studies.gap.hypothesis import baseline
from sma_bayes.studies.gap.locate import look
from sma_bayes.studies.gap.noise import scatter
from sma_bayes.studies.gap.periodic import Spectra
from sma_bayes.studies.gap.study import study_campaign

PRIORS = read_priors("modified_sigmoid")
SPAN = 0.02
SD = 0.004 * SPAN


@pytest.fixture(scope="module")
def fit(rig) -> Callable[..., FittedHypothesis]:
    """Fit the model without effects to a rig; `noise` makes the noise of a history anew, `keep` thins it out."""
    start: list[Floats] = []

    def of(
        noise: Callable[[int], Floats] | None = None, keep: Callable[[History], Floats] | None = None, **rest
    ) -> FittedHypothesis:
        given = rest if noise is None else {**rest, "sd": 1e-9}
        campaign = rig(samples=60, cycles=4, **given).campaign()
        found = histories(campaign)
        if noise is not None:
            found = tuple(
                replace(h, observed={"displacement": h.observed["displacement"] + SD * noise(h.n)})
                for h in found
            )
        if keep is not None:
            found = tuple(h.part(keep(h)) for h in found)
            found = tuple(replace(h, inputs={**h.inputs, "stretch": np.zeros(h.n)}) for h in found)
        hypothesis = baseline(campaign, found, PRIORS, pooled=True)
        fitted = fit_with_noise(hypothesis, start[0] if start else hypothesis.space.prior_centre())
        start[:] = [fitted.z]
        return fitted

    return of


@pytest.mark.parametrize("memory", [0.0, 0.8])
def test_a_line_out_of_step_is_found_where_no_covariate_shows_it(memory: float, fit) -> None:
    """A sine of 2 standard deviations of the noise."""
    fitted = fit(hum=0.008, memory=memory)
    seen = look(fitted, [], np.random.default_rng(0))
    assert seen.p_value < 1e-6
    assert len(seen.periodic) >= 2
    assert seen.best.ln_bayes_factor < Spectra(fitted).ln_bayes_factor
    for line in seen.periodic:
        assert line.channel == "displacement"
        assert line.unit == "Hz"
        assert line.frequency == pytest.approx(0.37, abs=line.width)
    factors = [line.ln_bayes_factor for line in seen.periodic]
    assert factors == sorted(factors, reverse=True)
    # a sine between two frequencies that are tried looks smaller, by up to a fifth under this taper
    assert seen.periodic[0].amplitude == pytest.approx(0.008 * SPAN, rel=0.25)


def test_a_line_is_found_where_times_are_unequal(fit) -> None:
    rng = np.random.default_rng(1)
    fitted = fit(hum=0.008, keep=lambda h: rng.random(h.n) < 0.7)
    assert fitted.hypothesis.histories[0].n < 400
    lines = Spectra(fitted).lines()
    assert lines
    for line in lines:
        assert line.frequency == pytest.approx(0.37, abs=line.width)


def test_chance_makes_no_lines(fit) -> None:
    """Forty campaigns, memory of 0 and 0.9: by its Bayes factor alone a line is told in less than one of 100."""
    told = [Spectra(fit(seed=seed, memory=0.9 * (seed % 2))).lines() for seed in range(40)]
    assert sum(bool(t) for t in told) <= binom.ppf(0.999, 40, 0.01)


def test_what_is_in_step_with_the_drive_is_no_line(fit) -> None:
    """A step of ten standard deviations at the same temperature of every sweep."""
    fitted = fit()
    there = np.concatenate([h.inputs["temperature"] > 80.0 for h in fitted.hypothesis.histories])
    changed = replace(
        fitted,
        hypothesis=replace(
            fitted.hypothesis,
            histories=tuple(
                replace(
                    h,
                    observed={
                        "displacement": h.observed["displacement"]
                        + 10.0 * SD * (h.inputs["temperature"] > 80.0)
                    },
                )
                for h in fitted.hypothesis.histories
            ),
        ),
    )
    again = fit_with_noise(changed.hypothesis, fitted.z)
    seen = look(again, [], np.random.default_rng(0))
    assert there.any()
    assert seen.p_value < 1e-6
    assert seen.periodic == ()
    assert "temperature" in seen.best.term.covariate


def test_bands_tell_noise_that_is_not_its_model(fit) -> None:
    """White noise and AR(1) are; a resonance and a mean of three neighbours are not.

    Ten campaigns of three conditions each: for their own model more than one of 30 bands below a p-value of 1e-3 has a
    probability below 1e-3.
    """

    def p_values(noise: Callable[[int], Floats] | None, **rest) -> list[float]:
        found = [Spectra(fit(noise, seed=seed, **rest)).bands() for seed in range(10)]
        return [band.p_value for bands in found for band in bands if band is not None]

    rng = np.random.default_rng(2)

    def resonance(n: int) -> Floats:
        return lfilter([1.0], [1.0, -1.8 * np.cos(0.2 * np.pi), 0.81], rng.standard_normal(n + 200))[200:]

    def smoothed(n: int) -> Floats:
        return np.convolve(rng.standard_normal(n + 2), np.ones(3), "valid")

    for memory in (0.0, 0.9):
        own = p_values(None, memory=memory)
        assert len(own) == 30
        assert sum(p < 1e-3 for p in own) <= 1
    for noise in (resonance, smoothed):
        assert max(p_values(noise)) < 1e-6


def test_scatter_is_of_neighbours(fit) -> None:
    fitted = fit()
    for block, noise in zip(fitted.blocks, fitted.noise, strict=True):
        own = fitted.residual[block.at]
        assert scatter(own, block) == pytest.approx(noise.sd, rel=0.15)
        slow = own + 100.0 * SD * np.linspace(0.0, 1.0, own.size)
        assert scatter(slow, block) == pytest.approx(scatter(own, block), rel=0.05)


def test_a_study_tells_a_line_and_gives_it_no_name(rig) -> None:
    """Once it was `none`, with p = 0.93: the noise had taken it for memory."""
    few = {name: EFFECTS[name] for name in ("thermocouple_lag", "training_drift")}
    found = study_campaign(rig(hum=0.0168, samples=60).campaign(), PRIORS, pooled=True, effects=few)
    assert found.verdict == "unnamed"
    assert found.p_value < 1e-6
    assert found.effects == ()
    assert len(found.periodic) >= 2
    assert all(line.frequency == pytest.approx(0.37, abs=line.width) for line in found.periodic)
    quiet = study_campaign(rig(samples=60).campaign(), PRIORS, pooled=True, effects=few)
    assert quiet.verdict == "none"
    assert quiet.periodic == ()


def test_a_line_beside_an_effect_stays_when_that_is_named(rig) -> None:
    few = {name: EFFECTS[name] for name in ("thermocouple_lag", "stress_shift")}
    found = study_campaign(rig(hum=0.008, samples=60, shift=2.0).campaign(), PRIORS, pooled=True, effects=few)
    assert found.verdict == "named"
    assert [e.id for e in found.effects] == ["stress_shift"]
    assert all(line.frequency == pytest.approx(0.37, abs=line.width) for line in found.periodic)
    assert found.periodic
