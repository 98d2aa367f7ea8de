"""What is said of the histories before they are compared; the rest is tried from the command line."""

from __future__ import annotations

import numpy as np

from sma_bayes.records.history import History
from sma_bayes.records.types import Condition
from sma_bayes.studies.gap.check import smoothing_remarks


def history(read: np.ndarray | None) -> History:
    zeros = np.zeros(4)
    observed = {"force": zeros} | ({} if read is None else {"temperature": read})
    return History(Condition("c"), {"temperature": zeros}, observed, np.arange(4), {"force": "N"})


def test_the_remark_tells_the_root_mean_square_of_what_was_smoothed_away() -> None:
    (text,) = smoothing_remarks([history(np.array([0.3, -0.3, 0.3, 0.3])), history(None)])
    assert "differ by 0.3 K (rms)" in text
    assert smoothing_remarks([history(None)]) == []
