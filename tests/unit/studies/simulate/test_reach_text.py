"""What is said of steady currents that give a value."""

from __future__ import annotations

import pytest

from sma_bayes.studies.simulate.schema import CurrentPassage, ReachDocument, ReachOfCondition
from sma_bayes.studies.simulate.terminal import reach_texts


@pytest.mark.parametrize(
    ("count", "told"),
    [
        (
            2,
            "1.000 [0.900, 1.100] A (rising, in 100% of the draws); "
            "2.000 [1.900, 2.100] A (falling, in 100% of the draws); ",
        ),
        (6, "up and down, 6 times a draw, between 0.9 and 6.1 A: they wind about the value there; "),
    ],
)  # fmt: skip
def test_draws_that_pass_a_value_many_times_are_one_sentence(count: int, told: str) -> None:
    passages = tuple(
        CurrentPassage(
            q05=i - 0.1, median=float(i), q95=i + 0.1, direction="rising" if i % 2 else "falling", probability=1.0,
            beyond_measured=False,
        )
        for i in range(1, count + 1)
    )  # fmt: skip
    condition = ReachOfCondition(
        condition="a", quantity="stiffness", unit="N/m", target=1.0, bounds=(0.9, 1.1), reachable=1.0,
        passages=passages, intervals=(), best=None, searched=7.0, caution=None,
    )  # fmt: skip
    reach = ReachDocument(asked="stiffness=1 N/m", tolerance="10 %", probability=0.9, conditions=(condition,))
    ((first, _),) = reach_texts(reach)
    assert first.startswith(f"a: {told}")
