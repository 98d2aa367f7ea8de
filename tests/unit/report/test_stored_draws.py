"""Draws read back from a folder are those of the fit that wrote it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest

from sma_bayes import fit, fit_campaign
from sma_bayes.assess.draws import record_draws
from sma_bayes.errors import OutputError
from sma_bayes.records.types import Campaign, Condition, Record
from sma_bayes.runs.stored_draws import stored_draws


@pytest.fixture(scope="module")
def campaign(make_record: Callable[..., Record]) -> Campaign:
    record = replace(make_record(n=40), condition=Condition("c", current=1.5, load=2.0))
    return Campaign("made up", "made up", "0", (record,))


def test_stored_draws_are_those_of_the_fit(campaign: Campaign, tmp_path: Path) -> None:
    fit_campaign(campaign, tmp_path / "out", noise="student_t", jobs=1, figures=False)
    (stored,) = stored_draws(tmp_path / "out")
    found = record_draws(fit(campaign, noise="student_t", jobs=1)["c-heating"])
    np.testing.assert_array_equal(stored.theta, found.theta)
    np.testing.assert_allclose(  # a discrepancy is read back from its table, whose spline is good to six digits
        stored.posterior.log_prob(stored.posterior.space.unconstrain(stored.theta[::100])),
        found.posterior.log_prob(found.posterior.space.unconstrain(found.theta[::100])),
        rtol=0.0 if not found.posterior.has_discrepancy else 1e-6,
    )
    same = (
        "condition",
        "branch",
        "channels",
        "quantities",
        "units",
        "names",
        "path",
        "converged",
        "coldest",
        "hottest",
    )
    assert {n: getattr(stored, n) for n in same} == {n: getattr(found, n) for n in same}
    assert asdict(stored.condition) == asdict(campaign.records[0].condition)


def test_a_fit_in_which_all_share_parameters_is_refused(campaign: Campaign, tmp_path: Path) -> None:
    fit_campaign(campaign, tmp_path / "out", pool="campaign", jobs=1, figures=False)
    with pytest.raises(OutputError, match="all conditions share A and B"):
        stored_draws(tmp_path / "out")
