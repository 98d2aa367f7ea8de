"""Tables of a card as people read them."""

from __future__ import annotations

import pytest

from sma_bayes.report.tables import cell_text
from sma_bayes.studies.card.tables import _two_digits


@pytest.mark.parametrize(
    ("error", "told"), [(4.83123e-4, "4.8 × 10⁻⁴"), (0.0039312, "0.0039"), (0.0, "0.000")]
)
def test_an_error_of_interpolation_has_two_digits(error: float, told: str) -> None:
    """It had seven: 4.831230 × 10⁻⁴ N/mm."""
    assert cell_text(_two_digits(error, "N/mm")) == told
