"""Where a normal range can be told, and where not."""

from __future__ import annotations

import numpy as np
import pytest

from sma_bayes.studies.watch.evidence import Watched
from sma_bayes.studies.watch.verdict import normal_range


def watched(values: list[float]) -> Watched:
    n = len(values)
    return Watched(np.array(values)[:, None], np.ones(n), 1, (np.ones((n, 1)),))


@pytest.mark.parametrize("values", [[1.0], [1.0, 1.1], [0.3, 0.3 + 1e-15, 0.3 - 1e-15]])
def test_a_range_of_no_width_or_of_any_width_is_not_told(values: list[float]) -> None:
    """One fitted cycle with one watched told "0 to 10.7", or, where they were copies, a range of no width."""
    low, high = normal_range(watched(values), len(values))
    assert np.isnan(low).all()
    assert np.isnan(high).all()


def test_three_sweeps_tell_a_range() -> None:
    """By Student's t with two degrees of freedom: 0.1 sqrt(1 + 1/3) 4.3027 on either side of the mean."""
    low, high = normal_range(watched([0.9, 1.0, 1.1]), 3)
    assert low[0, 0] == pytest.approx(1.0 - 0.1 * np.sqrt(4.0 / 3.0) * 4.302653, rel=1e-6)
    assert high[0, 0] == pytest.approx(1.0 + 0.1 * np.sqrt(4.0 / 3.0) * 4.302653, rel=1e-6)
