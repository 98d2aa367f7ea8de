"""A difference of two runs on the screen."""

from __future__ import annotations

import pytest

from sma_bayes.studies.diff.terminal import _short, _signed


@pytest.mark.parametrize(
    ("difference", "told"),
    [
        (-1.0, "−1.00"),
        (-0.08, "−0.0800"),
        (0.0047312, "+0.00473"),
        (1148.02, "+1150"),
        (-2.5e-6, "−2.50 × 10⁻⁶"),
    ],
)
def test_a_difference_has_its_sign_and_three_digits(difference: float, told: str) -> None:
    """−1.00 was written as −1, a count, and −0.0800 as −0.08 between others of three digits."""
    assert _signed(difference) == told


@pytest.mark.parametrize("nothing", [None, {}])
def test_what_is_not_there_is_no_minus_sign(nothing: object) -> None:
    assert _short(nothing) == "none"
