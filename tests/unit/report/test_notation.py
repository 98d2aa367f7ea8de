"""Numbers as people read them."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, strategies as st

from sma_bayes.report.notation import (
    MISSING,
    compact,
    count_text,
    interval_text,
    squared,
    unit_label,
    write,
    write_interval,
)


@pytest.mark.parametrize(
    ("value", "resolution", "text"),
    [
        (0.7224291, 0.00064, "0.72243"),
        (152.114, 1.0, "152.1"),
        (-9.8e-05, 2.7e-4, "(see below)"),
        (2.5e8, 3e6, "2.500 × 10⁸"),
        (-0.00001, 0.3, "0.00"),
        (0.0, None, "0.000"),
        (123456.0, 5000.0, "123500"),
        (1.0, 1e-30, "1.00000000"),
    ],
)
def test_a_number_has_the_digits_that_its_uncertainty_bears(
    value: float, resolution: float | None, text: str
) -> None:
    expected = "−1.0 × 10⁻⁴" if text == "(see below)" else text
    assert write([value], resolution).plain == (expected,)


@pytest.mark.parametrize("value", [None, math.nan, math.inf])
def test_what_is_not_a_number_is_a_dash(value: float | None) -> None:
    assert write([value]).plain == (MISSING,)
    assert write([value, 1.0]).plain == (MISSING, "1.000")


def test_numbers_that_belong_together_share_the_last_place_and_the_power() -> None:
    written = write_interval(0.0004, -0.0001, 0.0009)
    assert interval_text(0.0004, -0.0001, 0.0009) == "(4.0 [−1.0, 9.0]) × 10⁻⁴"
    assert written.plain == ("4.0 × 10⁻⁴", "−1.0 × 10⁻⁴", "9.0 × 10⁻⁴")
    assert interval_text(1.5, 1.25, 1.75) == "1.50 [1.25, 1.75]"


def test_what_is_certain_is_one_number() -> None:
    r = 0.931429478123
    assert interval_text(r, r - 1e-16, r + 1e-16) == "0.9314"
    assert interval_text(2e-7, 2e-7, 2e-7) == "2.000 × 10⁻⁷"
    assert interval_text(0.0, 0.0, 0.0) == "0.000"


def test_ends_that_differ_by_decades_have_digits_of_their_own() -> None:
    assert interval_text(0.42, 1.3e-5, 12600.0) == "0.42 [1.3 × 10⁻⁵, 13000]"
    assert interval_text(-5.87, -40.2, -0.91) == "−5.9 [−40, −0.91]"
    assert interval_text(3.0, 1.0, 9.4) == "3.0 [1.0, 9.4]"
    assert interval_text(1.0, 0.001, math.inf) == "1.000 [0.001, –]"


@given(
    st.floats(1e-12, 1e12, allow_nan=False), st.sampled_from([-1.0, 1.0]), st.floats(1e-6, 1.0, allow_nan=False)
)  # fmt: skip
def test_rounding_stays_well_below_the_uncertainty(size: float, sign: float, share: float) -> None:
    value, resolution = sign * size, share * size
    (digits,), power = write([value], resolution).digits, write([value], resolution).exponent
    assert abs(float(digits) * 10.0**power - value) <= 0.06 * resolution + 1e-8 * size


def test_units_are_shown_as_people_write_them() -> None:
    assert unit_label("N/m degC") == "N/m · °C"
    assert unit_label("1/arbitrary") == "1/arbitrary unit"
    assert unit_label("1") == ""
    assert (squared("N"), squared("N/cm"), squared("1")) == ("N²", "(N/cm)²", "1")


def test_counts_and_short_numbers() -> None:
    assert count_text(8349123) == "8\u202f349\u202f123"
    assert (compact(1.0), compact(-0.72197), compact(2.5e-7)) == ("1", "−0.722", "2.5 × 10⁻⁷")
