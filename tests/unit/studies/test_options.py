"""What decides the numbers of a run is refused before anything is sampled."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import sma_bayes
from sma_bayes.errors import SmaBayesError
from sma_bayes.studies.options import FitOptions, prior_set


@pytest.mark.parametrize("seed", [-1, 1.5, "1", None])
def test_a_seed_is_a_whole_number(seed: Any) -> None:
    t = np.linspace(20.0, 90.0, 40)
    with pytest.raises(SmaBayesError, match=r"seed .*\n?expected: a whole number, 0 or greater"):
        sma_bayes.fit({"temperature_C": t, "displacement_mm": np.tanh(0.1 * (t - 55.0))}, seed=seed, jobs=1)


def test_numpy_counts_are_seeds() -> None:
    seed: Any = np.int64(3)
    assert FitOptions(prior_set(None), seed=seed).seed == 3
