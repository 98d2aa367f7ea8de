"""Column names that need no declaration."""

from __future__ import annotations

import pytest

from sma_bayes.quantities import QUANTITIES
from sma_bayes.records.default_names import EXAMPLES, recognised


def test_the_documented_names_are_understood() -> None:
    assert [recognised(name) for name in EXAMPLES] == [
        ("time", "s"),
        ("temperature", "degC"),
        ("force", "N"),
        ("displacement", "mm"),
        ("stiffness", "N/m"),
        ("current", "A"),
        ("ambient_temperature", "degC"),
        ("cycle", "1"),
        ("branch", "1"),
    ]


@pytest.mark.parametrize(
    ("header", "expected"),
    [
        ("temperature_K", ("temperature", "kelvin")),
        ("Temperature (°C)", ("temperature", "degC")),
        ("Temperature[degF]", ("temperature", "degF")),
        ("AMBIENT_TEMPERATURE_C", ("ambient_temperature", "degC")),
        ("stiffness_N_per_mm", ("stiffness", "N/mm")),
        ("time_ms", ("time", "ms")),
        ("current mA", ("current", "mA")),
        ("strain_pct", ("strain", "percent")),
        ("strain [%]", ("strain", "percent")),
        ("strain [-]", ("strain", "1")),
        ("stress_MPa", ("stress", "MPa")),
        ("drive", ("drive", "1")),
    ],
)
def test_other_units_and_spellings(header: str, expected: tuple[str, str]) -> None:
    assert recognised(header) == expected


@pytest.mark.parametrize(
    "header",
    [
        "",
        "force",
        "strain",
        "temperature_derivative",
        "force_raw",
        "force_mm",
        "time_stamp",
        "cycle_2",
        "T_C",
        "forces_N",
    ],
)
def test_what_is_not_certain_is_not_taken(header: str) -> None:
    assert recognised(header) is None


def test_no_name_of_a_quantity_hides_another() -> None:
    for name, quantity in QUANTITIES.items():
        if name not in ("cycle", "branch", "drive"):
            assert recognised(f"{name}_{quantity.unit}") == (name, quantity.unit)
