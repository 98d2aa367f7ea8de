"""A study of sensitivity on the screen."""

from __future__ import annotations

import pytest

from sma_bayes.studies.sensitivity.terminal import _moved


@pytest.mark.parametrize(
    ("sds", "told"), [(-0.0004, "0.00"), (0.0, "0.00"), (0.005, "+0.01"), (-0.71, "-0.71")]
)
def test_what_does_not_move_has_no_sign(sds: float, told: str) -> None:
    """Columns were full of −0.00 and +0.00."""
    assert _moved(sds) == told
