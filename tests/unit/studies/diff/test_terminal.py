"""A difference of two runs on the screen."""

from __future__ import annotations

import pytest

from sma_bayes.studies.diff.schema import ComparedBand, ComparedRecords
from sma_bayes.studies.diff.terminal import _short, _shown_name, _signed


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


@pytest.mark.parametrize(
    ("parameter", "shown"),
    [("displacement_sd", "strain_sd"), ("A1", "A1"), ("temperature_sd", "temperature_sd")],
)
def test_noise_is_called_after_its_channel(parameter: str, shown: str) -> None:
    """The strain of a wire had a displacement_sd."""
    band = ComparedBand(
        name="strain",
        unit="%",
        shift=0.0,
        at=40.0,
        temperature_unit="degC",
        medians=(1.0, 1.0),
        difference=0.0,
        width_ratio=1.0,
        compared=(20.0, 80.0),
    )
    record = ComparedRecords(key="wire-heating", in_="both", same=True, bands={"displacement": band})
    assert _shown_name(parameter, record) == shown
