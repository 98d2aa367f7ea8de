"""What decides the numbers of a run is refused before anything is sampled."""

from __future__ import annotations

import inspect
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import sma_bayes
from sma_bayes.errors import SmaBayesError
from sma_bayes.records.types import Campaign
from sma_bayes.studies.options import FitOptions, prior_set


@pytest.mark.parametrize("seed", [-1, 1.5, "1", None])
def test_a_seed_is_a_whole_number(seed: Any) -> None:
    t = np.linspace(20.0, 90.0, 40)
    with pytest.raises(SmaBayesError, match=r"seed .*\n?expected: a whole number, 0 or greater"):
        sma_bayes.fit({"temperature_C": t, "displacement_mm": np.tanh(0.1 * (t - 55.0))}, seed=seed, jobs=1)


SEEDED = [
    name
    for name in sma_bayes.__all__
    if inspect.isfunction(found := getattr(sma_bayes, name)) and "seed" in inspect.signature(found).parameters
]
"""All that draws."""


@pytest.fixture(scope="module")
def campaign() -> Campaign:
    """One that can be studied."""
    return sma_bayes.simulated_campaign()


@pytest.mark.parametrize("name", SEEDED)
@pytest.mark.parametrize("seed", [-1, "a"])
def test_whatever_draws_refuses_what_is_no_seed(
    campaign: Campaign, name: str, seed: Any, tmp_path: Path
) -> None:
    function = getattr(sma_bayes, name)
    known = {"campaign": campaign, "data": campaign, "folder": tmp_path, "out": tmp_path, "asked": "Af"}
    given = {
        p.name: known.get(p.name, campaign.records)
        for p in inspect.signature(function).parameters.values()
        if p.default is inspect.Parameter.empty
    }
    with pytest.raises(SmaBayesError, match=r"seed .*\n?expected: a whole number, 0 or greater"):
        function(**given, seed=seed)
    assert not any(p.is_file() for p in tmp_path.rglob("*"))


def test_numpy_counts_are_seeds() -> None:
    seed: Any = np.int64(3)
    assert FitOptions(prior_set(None), seed=seed).seed == 3
