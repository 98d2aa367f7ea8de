"""Numbers of sweeps, laws of the cycle told from chance, and records that are unlike the others."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sma_bayes.parameters.priors_file import read_priors
from sma_bayes.records.history import histories
from sma_bayes.records.types import Branch, Campaign
from sma_bayes.studies.gap.cautions import cautions
from sma_bayes.studies.gap.document import gap_of_model
from sma_bayes.studies.gap.fitting import fit_hypothesis, fit_with_noise, nearest
from sma_bayes.studies.gap.hypothesis import baseline
from sma_bayes.studies.gap.outcome import gap_outcome
from sma_bayes.studies.gap.study import baseline_start
from sma_bayes.studies.gap.sweeps import SweepNumbers, cycle_law, suspects, sweep_numbers

PRIORS = read_priors("modified_sigmoid")
LOW, SPAN, RATE = 0.01, 0.02, 0.28
FOUR = {"periods": (60.0,) * 4, "loads": (1.0,) * 4, "peaks": (95.0,) * 4, "cycles": 2, "samples": 30}


def affine(rig, numbers, *, seed: int = 1, **of) -> Campaign:
    """A campaign whose sweeps have an offset [spans], stroke, shift [K] and width each: of condition and cycle."""
    rng, records = np.random.default_rng(seed), []
    plain = rig(**{"periods": (60.0,), "loads": (1.0,), "peaks": (95.0,), "samples": 60} | of).campaign()
    for r in plain.records:
        cycle, temperature = r.inputs["cycle"], r.inputs["temperature"]
        x = np.empty(r.n)
        for c in np.unique(cycle).tolist():
            on = cycle == c
            offset, stroke, shift, width = numbers(r.condition.id, c)
            middle = (62.0 if r.branch is Branch.HEATING else 51.0) + shift
            share = 1.0 / (1.0 + np.exp(-RATE * (temperature[on] - middle) / width))
            x[on] = LOW + SPAN * (offset + stroke * share + 0.004 * rng.standard_normal(int(on.sum())))
        records.append(replace(r, observed={"displacement": x}))
    return replace(plain, records=tuple(records))


def fitted_to(campaign: Campaign):
    hypothesis = baseline(campaign, histories(campaign), PRIORS, pooled=False)
    start = baseline_start(hypothesis, campaign, PRIORS, pooled=False, rng=np.random.default_rng(0))
    return fit_with_noise(hypothesis, start)


def test_numbers_of_sweeps_are_those_that_made_them(rig) -> None:
    """Up to what is common to all sweeps of a branch, which the curve takes."""
    made = {1.0: (0.0, 1.0, 0.0, 1.0), 2.0: (0.03, 0.9, -3.0, 1.2), 3.0: (0.06, 0.85, -5.0, 1.3)}
    found = sweep_numbers(nearest(fitted_to(affine(rig, lambda _, cycle: made[cycle]))))
    assert len(found) == 6
    for branch in ("heating", "cooling"):
        own = sorted((s for s in found if s.branch == branch), key=lambda s: s.cycle)
        values, truth = np.array([s.values for s in own]), np.array([made[s.cycle] for s in own])
        values[:, 0] /= SPAN
        for numbers in (values, truth):
            numbers[:, [1, 3]] = np.log(numbers[:, [1, 3]])
            numbers -= numbers[0].copy()
        np.testing.assert_allclose(values, truth, atol=0.06, rtol=0.1)
        sd = np.array([s.sds for s in own])
        assert np.all(sd > 0.0)
        assert np.max(sd[:, 2]) < 1.0


def table(law, cycles: int, seed: int = 0, scatter: float = 0.1) -> list[SweepNumbers]:
    """Sweeps whose offset, stroke and shift follow a law, and scatter by a part of it."""
    rng = np.random.default_rng(seed)
    out = []
    for n in range(1, cycles + 1):
        for branch, sign in (("heating", -1.0), ("cooling", 0.6)):
            e, y = scatter * rng.standard_normal(4), law(n)
            stroke, width = np.exp(-0.1 * (y + e[1])), np.exp(0.1 * e[3])
            values = (0.01 * (y + e[0]), float(stroke), sign * (y + e[2]), float(width))
            out.append(SweepNumbers("c", branch, "displacement", float(n), values, (1e-4, 0.01, 0.1, 0.01)))
    return out


def exponential(n: float) -> float:
    return float(1.0 - np.exp(-(n - 1.0) / 2.0))


@pytest.mark.parametrize(
    ("form", "law", "pace"),
    [("exponential", exponential, 2.0), ("logarithmic", lambda n: np.log1p(n - 1.0), 1.0)],
)
def test_the_form_of_a_law_is_that_of_the_data(form: str, law, pace: float) -> None:
    found = cycle_law(table(law, 20, scatter=0.02), np.random.default_rng(1))
    assert (found.form, found.cycles) == (form, pace)
    assert found.ln_ratio > 3.0
    assert found.p_value == pytest.approx(1.0 / 2001.0)


@pytest.mark.slow
@pytest.mark.thorough
def test_the_order_of_cycles_without_a_law_is_chance() -> None:
    """Of 60 p-values under nothing more than 8 are up to 0.05 with a probability of 0.3 %."""
    p = [cycle_law(table(lambda n: 0.0, 6, seed=s), np.random.default_rng(s)).p_value for s in range(60)]
    assert sum(v <= 0.05 for v in p) <= 8
    assert 0.35 < np.mean(p) < 0.65


def test_five_cycles_in_order_are_the_best_of_120_orders() -> None:
    found = cycle_law(table(exponential, 5, scatter=0.01), np.random.default_rng(0))
    assert found.p_value == pytest.approx(1.0 / 120.0)


@pytest.mark.parametrize(("cycles", "said"), [(1, "one sweep"), (2, "2 cycles"), (4, "at least 5")])
def test_what_too_few_cycles_cannot_tell(cycles: int, said: str) -> None:
    found = cycle_law(table(exponential, cycles), np.random.default_rng(0))
    assert said in found.untestable
    assert found.p_value is None


def test_a_run_that_is_unlike_its_repeats_is_suspect_by_name(rig) -> None:
    usual = (0.0, 1.0, 0.0, 1.0)
    odd = affine(rig, lambda c, _: (0.0, 0.7, 6.0, 1.0) if c == "c2" else usual, **FOUR)
    found = gap_of_model(gap_outcome(odd, PRIORS, pooled=False))
    assert {s.condition for s in found.suspects} == {"c2"}
    assert found.suspects[0].p_value < 0.05
    stroke = next(s for s in found.suspects if s.quantity.startswith("stroke"))
    assert stroke.value == pytest.approx(0.7, rel=0.05)
    text = " ".join(cautions(found))
    assert "c2 is a suspect record" in text
    assert "not what was applied, or the specimen changed" in text


def test_runs_that_repeat_as_usual_are_not(rig) -> None:
    """Five campaigns with `USUAL_SCATTER`: at 5 % false alarms at most, 2 have a probability of 2.3 %."""
    alarms = 0
    for seed in range(5):
        rng = np.random.default_rng([seed, 3])
        strokes, shifts = np.exp(0.05 * rng.standard_normal(4)), rng.standard_normal(4)
        own = {f"c{i}": (0.0, float(strokes[i]), float(shifts[i]), 1.0) for i in range(4)}
        alarms += bool(suspects(fitted_to(affine(rig, lambda c, _, own=own: own[c], seed=seed, **FOUR))))
    assert alarms <= 1


def test_other_settings_are_another_group(rig) -> None:
    assert (
        suspects(fitted_to(rig(loads=(1.0, 1.5, 2.0), shift=8.0, peaks=(95.0, 105.0, 115.0)).campaign()))
        == []
    )


def test_least_squares_stand_in_where_noise_never_forgets(rig) -> None:
    """With a memory of 0.99 the mode lets levels go; the nearest curve does not. Without memory nothing changes."""
    plain = fitted_to(affine(rig, lambda _, cycle: (0.02 * cycle, 1.0, 0.0, 1.0)))
    assert nearest(plain) is plain
    slow = tuple(
        replace(n, memory=np.where(b.first, 0.0, 0.99), others=())
        for b, n in zip(plain.blocks, plain.noise, strict=True)
    )
    mode = fit_hypothesis(plain.hypothesis, plain.z, slow)
    rms = [float(np.sqrt(np.mean(f.residual**2))) for f in (mode, nearest(mode), plain)]
    assert rms[1] <= rms[0]
    assert rms[1] == pytest.approx(rms[2], rel=0.02)
