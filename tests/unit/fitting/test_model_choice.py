"""The choice of a response model: each step up must be earned by evidence and by what was held out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from sma_bayes.fitting.fit_records import AUTO, support_for
from sma_bayes.fitting.model_choice import LEAST_LN_EVIDENCE_GAIN, Support, best_supported
from sma_bayes.records.types import Record
from sma_bayes.response import ladder

PLAIN, RICH, RICHER = "modified_sigmoid", "phase_slopes", "two_stage"


def support(evidence: dict[str, float], missed: dict[str, float]) -> Support:
    return Support(evidence, missed)


def test_a_richer_curve_needs_both_evidence_and_prediction() -> None:
    better = {PLAIN: 0.02, RICH: 0.01}
    assert best_supported([support({PLAIN: 0.0, RICH: LEAST_LN_EVIDENCE_GAIN + 0.1}, better)]).name == RICH
    assert best_supported([support({PLAIN: 0.0, RICH: LEAST_LN_EVIDENCE_GAIN - 0.1}, better)]).name == PLAIN
    worse = {PLAIN: 0.01, RICH: 0.02}
    choice = best_supported([support({PLAIN: 0.0, RICH: 50.0}, worse)])
    assert choice.name == PLAIN
    assert "50.0 more, but it does not predict better" in choice.reason


def test_evidences_of_all_records_add_up() -> None:
    """No record alone earns the step; together they do, and one that speaks against it is outvoted by evidence."""
    each = support({PLAIN: 0.0, RICH: 2.0}, {PLAIN: 0.02, RICH: 0.01})
    assert best_supported([each]).name == PLAIN
    choice = best_supported([each, each])
    assert choice.name == RICH
    assert choice.ln_evidence == {PLAIN: -4.0, RICH: 0.0}
    assert "of all 2 together" in choice.reason
    against = support({PLAIN: 0.0, RICH: -3.0}, {PLAIN: 0.02, RICH: 0.01})
    assert best_supported([each, each, against]).name == PLAIN


def test_a_model_that_cannot_be_fitted_to_every_record_is_left_out() -> None:
    force = support({PLAIN: 0.0, RICH: 90.0, RICHER: 95.0}, {PLAIN: 0.2, RICH: 0.1, RICHER: 0.05})
    stiffness = support({PLAIN: 0.0}, {PLAIN: 0.1})
    choice = best_supported([force, stiffness])
    assert choice.name == PLAIN
    assert "no other model" in choice.reason


def test_evidence_that_can_not_be_found_never_wins() -> None:
    none = support({PLAIN: -np.inf, RICH: -np.inf}, {PLAIN: 0.2, RICH: 0.1})
    choice = best_supported([none])
    assert choice.name == PLAIN
    assert not np.isnan(list(choice.ln_evidence.values())).any()


def test_records_with_slopes_support_the_rung_with_slopes(make_record: Callable[..., Record]) -> None:
    plain = make_record(("displacement",), n=120, noise=0.01)
    t, x = plain.temperature, plain.observed["displacement"]
    sloped = replace(plain, observed={"displacement": x + 0.15 * np.ptp(x) * (t - t[0]) / np.ptp(t)})
    rungs = [m for m in ladder(("displacement",)) if m.name in (PLAIN, RICH)]
    models = [(m(("displacement",)), m.default_priors()) for m in rungs]
    for record, expected in ((plain, PLAIN), (sloped, RICH)):
        found = support_for([record], models, noise=AUTO, seed=0)
        assert best_supported([found]).name == expected, found


@pytest.mark.parametrize("channels", [("stiffness",), ("stiffness", "force")])
def test_stiffness_alone_stays_on_the_rung_that_it_identifies(channels: tuple[str, ...]) -> None:
    assert [m.name for m in ladder(channels)] == [PLAIN]
