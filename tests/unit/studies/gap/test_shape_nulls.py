"""Curves of another shape with nothing hidden: none of them may get a name.

At a false-alarm rate of 1 % a campaign one name in these would come by chance with a probability of 7 %.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from sma_bayes.parameters.priors_file import read_priors
from sma_bayes.studies.gap.name import LEAST_LN_BAYES_FACTOR, MISFIT_LN_BAYES_FACTOR, MOST_SHARE_OF_FORM
from sma_bayes.studies.gap.outcome import judgement
from sma_bayes.studies.gap.study import study_campaign


def logistic(x):
    return 1.0 / (1.0 + np.exp(-x))


def skewed(x, rising):
    return logistic(np.sinh(0.8 * np.arcsinh(x) + 0.5))


def skewed_each_way(x, rising):
    return logistic(np.sinh(1.1 * np.arcsinh(x) + np.where(rising, 0.4, -0.4)))


def sloped(x, rising):
    s = logistic(np.sinh(1.1 * np.arcsinh(x)))
    return s + x * (0.006 + 0.004 * s)


def in_two_stages(x, rising):
    return 0.82 * logistic(x) + 0.18 * logistic(2.0 * (x - 3.5))


@pytest.fixture(scope="module")
def studied(rig):
    """Study a curve of another shape in three conditions; each once."""

    @cache
    def study(shape, seed):
        campaign = rig(shape=shape, sd=0.005, seed=seed).campaign()
        return study_campaign(campaign, read_priors("modified_sigmoid"), pooled=True)

    return study


@pytest.mark.parametrize(
    ("shape", "seed"),
    [
        (skewed, 1),
        pytest.param(skewed, 2, marks=pytest.mark.thorough),
        (skewed_each_way, 3),
        pytest.param(skewed_each_way, 4, marks=pytest.mark.thorough),
        (sloped, 4),
        pytest.param(sloped, 5, marks=pytest.mark.thorough),
        pytest.param(in_two_stages, 6, marks=pytest.mark.thorough),
    ],
)
def test_a_curve_of_another_shape_gets_no_name(shape, seed, studied) -> None:
    found = studied(shape, seed)
    assert found.verdict == "unnamed"
    assert found.effects == ()
    terms = found.steps[-1].flexible
    assert terms is not None
    assert terms.shape > MISFIT_LN_BAYES_FACTOR
    assert terms.shape > 10.0 * max(0.0, terms.beyond.ln_bayes_factor if terms.beyond else 0.0)


def test_the_shape_itself_explains_more_by_the_noise_beside_a_law_that_comes_near_it(studied) -> None:
    """By the noise of the model without either the law is worth more than the shape that was simulated."""
    found = studied(skewed_each_way, 3)
    (near,) = [c for c in found.steps[0].candidates if c.effect.id == "asymmetric_kinetics"]
    assert near.ln_bayes_factor > near.one_stage + LEAST_LN_BAYES_FACTOR
    assert near.behind_shape > MOST_SHARE_OF_FORM
    assert not near.beats_shape
    status, why = judgement(found, near)
    assert status == "rejected"
    assert f"one stage of another shape explains {100.0 * near.behind_shape:.1f} % more than it does" in why


def test_what_differs_between_conditions_is_named_beside_such_a_curve(rig) -> None:
    """The effect is worth less than the shape, and has its name from what no shape explains."""
    found = study_campaign(
        rig(shape=skewed_each_way, sd=0.005, shift=3.0, seed=7).campaign(),
        read_priors("modified_sigmoid"),
        pooled=True,
    )
    assert found.verdict == "named"
    assert found.effects[0].id in ("stress_shift", "branch_stress_shift")
    chosen = found.steps[0].chosen
    assert chosen is not None
    assert chosen.beside is not None
    assert chosen.beyond_shape
