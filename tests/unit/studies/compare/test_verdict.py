"""The rule of the verdict, and stacking weights, on numbers made up for them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sma_bayes.studies.compare.verdict import CANNOT_TELL, Standing, difference, judge, stacking_weights

FLAT = np.zeros(10)


def standing(
    name: str, ln_evidence: float, *, curve: str = "", extra: bool = False, sd: float = 0.01
) -> Standing:
    family = name.partition("-")[0]
    return Standing(name, family, curve or name, extra, ln_evidence, sd, FLAT)


def test_twenty_to_one_is_decisive_and_less_is_not() -> None:
    sure = judge([standing("a", 0.0), standing("b", -3.1), standing("c", -9.0)])
    assert (sure.verdict, sure.preferred, sure.rival, sure.decisive) == ("a", "a", "b", True)
    assert sure.probability == pytest.approx(1.0 / (1.0 + np.exp(-3.1) + np.exp(-9.0)))
    unsure = judge([standing("a", 0.0), standing("b", -2.9)])
    assert (unsure.verdict, unsure.preferred, unsure.decisive) == (CANNOT_TELL, "a", False)
    assert unsure.not_told_from == ("b",)


def test_the_error_of_the_evidence_counts() -> None:
    assert judge([standing("a", 0.0, sd=1.0), standing("b", -3.1)]).verdict == CANNOT_TELL


def test_variants_of_a_family_are_no_rivals() -> None:
    found = judge([standing("a-1", 0.0), standing("a-2", -0.1), standing("b", -8.0)])
    assert (found.verdict, found.rival, found.not_told_from) == ("a", "b", ("a-2",))


def test_the_same_curve_under_two_names_is_never_told_apart() -> None:
    found = judge([standing("a", 0.0, curve="s"), standing("b", -20.0, curve="s"), standing("c", -50.0)])
    assert (found.verdict, found.rival, found.ln_bayes_factor) == (CANNOT_TELL, "c", 50.0)
    assert "a and b are the same curve" in found.why


def test_an_extra_has_no_vote_and_is_named() -> None:
    found = judge([standing("a", 0.0), standing("b", -8.0), standing("x", 1.0, extra=True)])
    assert (found.verdict, found.not_told_from) == ("a", ("x",))


def test_what_was_held_out_can_speak_against() -> None:
    against = replace(standing("b", -8.0), folds=np.linspace(0.5, 1.5, 10))
    found = judge([standing("a", 0.0), against])
    assert found.verdict == CANNOT_TELL
    assert "b predicts better" in found.why
    scattered = replace(standing("b", -8.0), folds=np.resize([9.0, -8.9], 10))
    assert judge([standing("a", 0.0), scattered]).verdict == "a"


def test_the_interval_of_a_difference_covers() -> None:
    rng = np.random.default_rng(0)
    found = [difference(rng.normal(0.3, 1.0, 10), np.zeros(10)) for _ in range(2000)]
    inside = np.mean([(d.low or 0.0) <= 3.0 <= (d.high or 0.0) for d in found])
    assert inside == pytest.approx(0.95, abs=0.02)  # four standard errors
    assert difference(np.ones(1), np.zeros(1)).se is None


def test_stacking_finds_the_mixture_that_made_the_data() -> None:
    rng = np.random.default_rng(1)
    y = np.where(rng.random(20000) < 0.3, rng.normal(-2.0, 1.0, 20000), rng.normal(2.0, 1.0, 20000))
    weights = stacking_weights(
        {"left": -0.5 * (y + 2.0) ** 2, "right": -0.5 * (y - 2.0) ** 2, "far": -0.5 * (y - 9.0) ** 2}
    )
    assert weights["left"] == pytest.approx(0.3, abs=0.02)
    assert weights["far"] < 0.01
    assert sum(weights.values()) == pytest.approx(1.0)


def test_a_verdict_speaks_of_models_in_words() -> None:
    """Keys such as `modified_sigmoid` are what programs read; sentences had them, and tenths of hundreds."""
    refitted = standing("logistic_refitted", 0.0, curve="s")
    same = judge(
        [refitted, standing("modified_sigmoid", -0.1, curve="s"), standing("polynomial_corrected", -1148.02)]
    )
    assert same.preferred == "logistic_refitted"
    assert same.why == (
        "refitted logistic and modified sigmoid are the same curve of this channel, ahead of the corrected polynomial "
        "by 1148 in ln evidence"
    )
    assert same.why_alone == "ahead of the corrected polynomial by 1148 in ln evidence"
    won = judge([standing("modified_sigmoid", 0.0), standing("polynomial_published", -8.0)])
    assert won.why.startswith(
        "ln Bayes factor of the modified sigmoid over the published polynomial is 8.0; held out"
    )
    assert "_" not in won.why
    assert won.why_alone == won.why
