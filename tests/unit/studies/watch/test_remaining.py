"""What is said of the cycles that remain to a limit."""

from __future__ import annotations

import pytest

from sma_bayes.studies.watch.remaining import IntervalDocument, _statement


@pytest.mark.parametrize(
    ("low", "middle", "high", "said"),
    [
        (0.0, 0.0, 3.0, "reached"),
        (4.0, 9.0, 30.0, "in 9 cycles (90 %: 4 to 30)"),
        (4.0, 9.0, None, "in 9 cycles (90 %: 4 to more than 200)"),
        (None, None, None, "not within 200 cycles with a probability of 91 %"),
        (0.0, None, None, "not within 200 cycles with a probability of 91 %, reached already with 5 %"),
        (
            1.0,
            None,
            None,
            "not within 200 cycles with a probability of 91 %, reached within 1 cycle with 5 %",
        ),
        (
            7.0,
            None,
            None,
            "not within 200 cycles with a probability of 91 %, reached within 7 cycles with 5 %",
        ),
    ],
)
def test_a_limit_is_told_by_its_cycles(
    low: float | None, middle: float | None, high: float | None, said: str
) -> None:
    assert _statement(IntervalDocument(q05=low, median=middle, q95=high), 200, 0.09) == said
