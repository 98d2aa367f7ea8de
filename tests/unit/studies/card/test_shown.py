"""A card as people see it."""

from __future__ import annotations

import pytest

from sma_bayes.runs.shown import in_declared_units
from sma_bayes.studies.card.schema import CardFindings, StiffnessTable


def test_a_table_is_shown_in_the_declared_units_and_stored_as_it_is() -> None:
    """N/mm where force was declared in N and displacement in mm, and degF: N/m stood on the terminal."""
    table = StiffnessTable(
        condition="c", branch="heating", quantity="stiffness", unit="N/m", temperature_unit="degC", first=25.0,
        step=1.0, points=65, interpolation_error=0.5, relative_error=1e-3, caution="",
    )  # fmt: skip
    found = CardFindings(
        schema="sma-bayes/card/1", campaign="", source="", seed=0, versions={}, data_sha256=None, converged=True,
        adequate=True, constitutive=None, no_constitutive="", stiffness=(table,), no_stiffness="", cautions=(),
        declared_units={"displacement": "mm", "stiffness": "N/mm", "temperature": "degF"},
    )  # fmt: skip
    (shown,) = in_declared_units(found).stiffness
    assert (shown.unit, shown.temperature_unit) == ("N/mm", "degF")
    assert shown.interpolation_error == pytest.approx(5e-4)
    assert (shown.first, shown.step) == (pytest.approx(77.0), pytest.approx(1.8))
    assert found.stiffness == (table,)
