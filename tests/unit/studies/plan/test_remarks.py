"""What a plan says of what it does not allow for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from sma_bayes.assess.draws import record_draws
from sma_bayes.fitting.fit_records import fit_records
from sma_bayes.parameters.priors_file import read_priors
from sma_bayes.records.types import Record
from sma_bayes.studies.plan.workflow import remarks_on_discrepancies


def test_a_discrepancy_beside_noise_with_a_memory_is_remarked(make_record: Callable[..., Record]) -> None:
    record = make_record(n=40, memory=0.6, channels=("force",))
    priors = read_priors("modified_sigmoid")
    draws = record_draws(fit_records([record], priors, noise="ar1", seed=0))
    assert not remarks_on_discrepancies([replace(draws, weights={})])
    beside = replace(draws, weights={"force": np.zeros((draws.size, 3))})
    (told,) = remarks_on_discrepancies([beside, beside])
    assert told.count(draws.key) == 1
    assert "0.68" in told
    assert "0.50" in told
    white = record_draws(fit_records([record], priors, noise="independent", seed=0))
    assert not remarks_on_discrepancies([replace(white, weights=beside.weights)])
