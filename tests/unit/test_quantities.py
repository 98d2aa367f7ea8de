"""Quantities: names, canonical units, and conversion."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, strategies as st

from sma_bayes.errors import QuantityError
from sma_bayes.quantities import (
    ARBITRARY,
    CHANNELS,
    QUANTITIES,
    SPECIMEN_QUANTITY,
    STANDARD_GRAVITY,
    TEMPERATURE,
    convert,
    per,
    unit_text,
)


def test_canonical_units_are_those_of_the_contract() -> None:
    assert {name: QUANTITIES[name].unit for name in QUANTITIES} == {
        "temperature": "degC",
        "time": "s",
        "force": "N",
        "displacement": "m",
        "stiffness": "N/m",
        "stress": "Pa",
        "strain": "1",
        "modulus": "Pa",
        "current": "A",
        "voltage": "V",
        "resistance": "ohm",
        "ambient_temperature": "degC",
        "drive": "1",
        "cycle": "1",
        "branch": "1",
    }
    assert QUANTITIES["temperature"] is TEMPERATURE


def test_every_channel_has_a_specimen_counterpart() -> None:
    assert tuple(SPECIMEN_QUANTITY) == CHANNELS
    assert set(SPECIMEN_QUANTITY.values()) <= set(QUANTITIES)


def test_stiffness_is_force_over_displacement_for_springs_and_specimens() -> None:
    for force, displacement, stiffness in (
        ("force", "displacement", "stiffness"),
        ("stress", "strain", "modulus"),
    ):
        unit = f"({QUANTITIES[force].unit})/({QUANTITIES[displacement].unit})"
        assert convert(1.0, unit, QUANTITIES[stiffness].unit) == 1.0


@pytest.mark.parametrize(
    ("value", "unit", "to", "expected"),
    [
        (25.0, "mm", "m", 0.025),
        (0.0, "degF", "degC", -160.0 / 9.0),
        (300.0, "kelvin", "degC", 26.85),
        (1.0, "kgf", "N", STANDARD_GRAVITY),
        (1.3, "N/cm", "N/m", 130.0),
        (56.0, "MPa", "Pa", 56e6),
        (80.0, "percent", "1", 0.8),
        (10.0, "mHz", "Hz", 0.01),
        (2.0, "1/delta_degF", "1/delta_degC", 3.6),
    ],
)
def test_conversion(value: float, unit: str, to: str, expected: float) -> None:
    assert convert(value, unit, to) == pytest.approx(expected, rel=1e-12)


@given(
    st.lists(st.floats(-1e6, 1e6), min_size=1),
    st.sampled_from([("mm", "m"), ("degF", "degC"), ("lbf", "N"), ("minute", "s"), ("ksi", "Pa")]),
)
def test_there_and_back_is_the_same(values: list[float], units: tuple[str, str]) -> None:
    unit, to = units
    back = convert(convert(np.array(values), unit, to), to, unit)
    np.testing.assert_allclose(back, values, rtol=1e-12, atol=1e-9)


def test_conversion_keeps_shape_and_missing_values_and_gives_a_new_array() -> None:
    values = np.array([[1.0, np.nan], [3.0, 4.0]])
    for to in ("mm", "m"):
        result = convert(values, "m", to)
        assert result.shape == values.shape
        assert np.isnan(result[0, 1])
        result[0, 0] = -1.0
        assert values[0, 0] == 1.0


def test_integers_become_floats() -> None:
    assert convert(np.array([1, 2]), "N", "N").dtype == np.float64


def test_an_unknown_unit_is_named_with_the_nearest() -> None:
    with pytest.raises(QuantityError) as caught:
        convert(1.0, "degc_", "degC", what="column 'T'")
    message = str(caught.value)
    assert "unit 'degc_' of column 'T' is not known" in message
    assert "'degC'" in message


@pytest.mark.parametrize(
    "unit", ["", "N m/", "2..3 N", "??", "N/(m", "N)", "N/0", "kg**0", "1/dB", "dBm~N", "N*10**9999"]
)
def test_text_that_is_no_unit_is_refused(unit: str) -> None:
    with pytest.raises(QuantityError):
        convert(1.0, unit, "N")


@pytest.mark.parametrize(
    ("unit", "to", "meant"),
    [
        ("Newton", "N", "N"),
        ("Mpa", "Pa", "MPa"),
        ("GPA", "Pa", "GPa"),
        ("℃", "degC", "degC"),
        ("ºC", "degC", "degC"),
        ("mm2", "m^2", "mm^2"),
    ],
)
def test_a_unit_as_people_write_it_is_told_as_it_has_to_be(unit: str, to: str, meant: str) -> None:
    with pytest.raises(QuantityError) as error:
        convert(1.0, unit, to)
    assert error.value.remedy == f"did you mean '{meant}'?"


@pytest.mark.parametrize(("unit", "to"), [("s", "N"), ("m", "N/m"), ("N", "Pa"), ("degC", "s")])
def test_a_unit_of_the_wrong_kind_is_refused(unit: str, to: str) -> None:
    with pytest.raises(QuantityError, match=f"unit '{unit}' of the load is of the wrong kind"):
        convert(1.0, unit, to, what="the load")


def test_arbitrary_units_pass_through_but_are_never_converted() -> None:
    assert convert(4.142, ARBITRARY, ARBITRARY) == 4.142
    for unit, to in ((ARBITRARY, "degC"), ("degC", ARBITRARY), (f"1/{ARBITRARY}", "1/degC")):
        with pytest.raises(QuantityError, match="'arbitrary' on both sides"):
            convert(1.0, unit, to)


def test_units_as_people_read_them() -> None:
    assert unit_text("degC") == "°C"
    assert unit_text("1/degC") == "1/°C"
    assert unit_text("1/arbitrary") == "1/arbitrary unit"
    assert unit_text("N/m") == "N/m"
    assert unit_text("1") == ""


def test_per() -> None:
    assert per("1") == "1"
    assert per(ARBITRARY) == "1/arbitrary"
    assert convert(1.0, per("s"), "Hz") == 1.0
