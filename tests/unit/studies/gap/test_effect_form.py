"""What the form of an effect may leave is told from what is something else."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from sma_bayes.arrays import Floats
from sma_bayes.effects import EFFECTS
from sma_bayes.parameters.priors_file import read_priors
from sma_bayes.studies.gap.effect_form import EffectForms
from sma_bayes.studies.gap.fitting import FittedHypothesis, added_by
from sma_bayes.studies.gap.study import study_campaign

STRONG = 30.0
"""Size of what is left beside a shift [standard deviations of the noise]."""


@pytest.fixture(scope="module")
def shifted(rig: Callable[..., Any]) -> FittedHypothesis:
    """A model that has a shift by the load, and only noise left beside it."""
    only = {"stress_shift": EFFECTS["stress_shift"]}
    found = study_campaign(
        rig(shift=4.0).campaign(), read_priors("modified_sigmoid"), pooled=True, effects=only
    )
    assert [e.id for e in found.effects] == ["stress_shift"]
    return found.final


def inputs(fitted: FittedHypothesis, name: str) -> Floats:
    return np.concatenate([fitted.hypothesis.histories[b.history].inputs[name] for b in fitted.blocks])


def beyond(fitted: FittedHypothesis, added: Floats) -> float:
    """Share beyond the forms of the shift, of something that is left, `STRONG` standard deviations large."""
    white = fitted.whiten(added)
    white *= STRONG / np.sqrt(np.mean(white**2))
    signature = fitted.project_out(white[:, None])[:, 0]
    return EffectForms(replace(fitted, whitened=fitted.whitened + white)).share_beyond(signature)


@pytest.mark.parametrize(
    "form", ["more at high temperature", "other powers of the load", "later", "by cycle"]
)
def test_other_forms_of_an_effect_are_not_beyond_it(form: str, shifted: FittedHypothesis) -> None:
    (effect,) = shifted.hypothesis.effects
    own = added_by(effect, shifted.hypothesis, shifted.blocks, shifted.theta)
    load = np.concatenate(
        [
            np.full(b.at.stop - b.at.start, shifted.hypothesis.histories[b.history].condition.load)
            for b in shifted.blocks
        ]
    )
    left = {
        "more at high temperature": own * (inputs(shifted, "temperature") / 60.0) ** 2,
        "other powers of the load": own * load**1.5,
        "later": np.roll(own, 2) - own,
        "by cycle": own * np.exp(-inputs(shifted, "cycle")),
    }
    assert beyond(shifted, left[form]) < 0.05


@pytest.mark.parametrize("what", ["plateau", "ripple", "offset"])
def test_what_does_not_look_like_it_is(what: str, shifted: FittedHypothesis) -> None:
    """A plateau that depends on the run, a hum, a zero that differs between two runs."""
    condition = np.concatenate([np.full(b.at.stop - b.at.start, float(b.history)) for b in shifted.blocks])
    temperature, time = inputs(shifted, "temperature"), inputs(shifted, "time")
    left = {
        "plateau": np.where(temperature < 45.0, condition, 0.0),
        "ripple": np.sin(2.0 * np.pi * 0.37 * time),
        "offset": (condition == 1.0).astype(float),
    }
    assert beyond(shifted, left[what]) > 0.5


def test_a_model_without_effects_leaves_everything_open(
    shifted: FittedHypothesis, rig: Callable[..., Any]
) -> None:
    bare = study_campaign(
        rig(shift=4.0).campaign(), read_priors("modified_sigmoid"), pooled=True, effects={}
    ).final
    assert EffectForms(bare).columns.shape == (bare.whitened.size, 0)
    assert beyond(bare, inputs(bare, "time")) == pytest.approx(1.0)
