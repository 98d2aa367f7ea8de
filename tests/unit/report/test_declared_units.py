"""The units of the measurements in report, tables and figures, from a run that is stored in others."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sma_bayes.report.tables import csv_columns, report_tables
from sma_bayes.runs.declared_units import (
    ShownUnit,
    declared_units,
    shown_as,
    shown_product,
    shown_unit,
    shown_units,
)
from sma_bayes.runs.outputs import read_columns, read_run
from sma_bayes.studies.fit.report import branch_data
from sma_bayes.studies.fit.report_content import report_content
from sma_bayes.studies.report.build import build_report

EditSummary = Callable[[Path, Callable[[dict[str, Any]], None]], Path]

FACTORS = {"N": ("mN", 1e3), "cm": ("mm", 10.0), "N/cm": ("mN/mm", 100.0)}
"""Stored units of the twin, with the declared ones of these tests, and how many of them make a stored one."""


def _measured(summary: dict[str, Any]) -> None:
    summary["source"] = "bench"  # the twin is beside the printed values of the paper, in their units


def _declare(summary: dict[str, Any]) -> None:
    _measured(summary)
    for record in summary["records"]:
        for channel, unit in (("force", "mN"), ("displacement", "mm")):
            record["quantities"][channel]["declared_unit"] = unit


@pytest.fixture
def declared(run_copy: Path, edit_summary: EditSummary) -> Path:
    return edit_summary(run_copy, _declare)


def test_every_number_of_every_table_is_that_of_the_run_in_the_declared_unit(
    run_copy: Path, edit_summary: EditSummary
) -> None:
    edits = (_measured, _declare)
    stored, shown = (report_tables(report_content(read_run(edit_summary(run_copy, e)))) for e in edits)
    scaled = 0
    for name, table in stored.items():
        was, now = csv_columns(table), csv_columns(shown[name])
        units = was.get("unit", [""] * len(table.rows))
        for (before, column), (after, other) in zip(was.items(), now.items(), strict=True):
            assert before == after
            for unit, old, new in zip(units, column, other, strict=True):
                first = str(unit).partition(" · ")[0]
                head = first.removesuffix("/arbitrary unit")
                if before == "unit" and head in FACTORS:
                    assert str(new).startswith(FACTORS[head][0])
                elif isinstance(old, float) and ("[unit" in before) and head in FACTORS:
                    power = 2 if "unit²" in before else 1
                    assert new == pytest.approx(FACTORS[head][1] ** power * old, rel=1e-12, nan_ok=True)
                    scaled += 1
                elif isinstance(old, float):
                    assert new == old or (math.isnan(old) and math.isnan(float(new)))  # type: ignore[arg-type]
    assert scaled > 100


def test_priors_in_words_are_in_the_unit_of_their_parameter(finished: Path, declared: Path) -> None:
    stored, shown = (report_content(read_run(f)).records[0] for f in (finished, declared))
    before, after = ({p.name: p for p in r.parameters} for r in (stored, shown))
    assert after["A1"].numbers["median"] == pytest.approx(10.0 * before["A1"].numbers["median"])
    assert after["A1"].numbers["sigma"] == before["A1"].numbers["sigma"]
    assert after["A2"].numbers == before["A2"].numbers


def test_curves_draws_and_measurements_of_figures_are_in_the_declared_units(
    finished: Path, declared: Path
) -> None:
    was, now = (
        branch_data(folder, report_content(read_run(folder)).records[0]) for folder in (finished, declared)
    )
    for channel, factor in (("force", 1e3), ("displacement", 10.0), ("stiffness", 100.0)):
        np.testing.assert_allclose(
            now.bands[channel].quantiles["q50"], factor * was.bands[channel].quantiles["q50"]
        )
    np.testing.assert_allclose(now.stored.observed["force"], 1e3 * was.stored.observed["force"])
    np.testing.assert_allclose(now.curve["displacement"], 10.0 * was.curve["displacement"])
    for name, factor in (("A1", 10.0), ("A2", 1.0), ("B4", 1e3), ("force_sd", 1e3)):
        np.testing.assert_allclose(now.stored.draws[name], factor * was.stored.draws[name])


def test_the_page_and_its_figures_are_in_the_declared_units_and_the_summary_in_its_own(
    declared: Path,
) -> None:
    before = (declared / "summary.json").read_bytes()
    build_report(declared, formats=["png"], jobs=1)
    page = (declared / "report.html").read_text(encoding="utf-8")
    assert "greatest stiffness [mN/mm]" in page
    assert "[N/cm]" not in page
    assert "mN/mm" in (declared / "figures" / "loop-100g-10mHz.csv").read_text()
    assert (declared / "summary.json").read_bytes() == before
    record = json.loads(before)["records"][0]
    assert record["quantities"]["force"] == {"name": "force", "unit": "N", "declared_unit": "mN"}
    assert record["parameters"]["A1"]["unit"] == "cm"
    bands = read_columns(declared / "bands" / f"{record['key']}-force.csv", "")
    assert np.nanmax(bands["q50"]) < 100.0


def test_units_that_are_no_factor_apart_stay_as_they_are() -> None:
    assert shown_unit("degC", "celsius") is None
    assert shown_unit("arbitrary", "mm") is None
    assert shown_unit("N", "mm") is None
    assert shown_unit("1", "percent") == ShownUnit("1", "percent", 100.0)


def test_temperatures_have_a_zero_of_their_own_and_differences_have_none() -> None:
    units = {
        n: u
        for n, of in (("temperature", "kelvin"), ("force", "mN"))
        if (u := shown_unit({"temperature": "degC", "force": "N"}[n], of))
    }
    assert shown_as("degC", units) == ShownUnit("degC", "K", 1.0, 273.15)
    assert shown_as("degC", units, difference=True) == ShownUnit("degC", "K", 1.0)
    assert shown_as("N/degC", units, "force") == ShownUnit("N/degC", "mN/K", 1e3)
    assert shown_as("N 1/degC", units, "force") == ShownUnit("N 1/degC", "mN 1/K", 1e3)
    assert shown_as("1", units, "force") == ShownUnit("1", "1", 1.0)


@pytest.mark.parametrize("unit", ["N/degC", "1/degC", "N degC", "degC", "N 1/degC"])
def test_units_are_converted_as_pint_does(unit: str) -> None:
    pint = pytest.importorskip("pint").UnitRegistry()
    units = {"force": ShownUnit("N", "mN", 1e3), "temperature": ShownUnit("degC", "degF", 1.8, 32.0)}
    u = shown_as(unit, units, "force", difference=True)
    stored, shown = (text.replace("deg", "delta_deg") for text in (unit, u.shown))
    assert u.value(3.0) == pytest.approx(pint.Quantity(3.0, stored).to(shown).magnitude, rel=1e-12)


@pytest.mark.parametrize("unit", ["K/N", "N/K", "K/(s A^2)", "m/s", "1/N", "J/kg", "N/m", "K/s"])
def test_products_are_converted_as_pint_does(unit: str) -> None:
    pint = pytest.importorskip("pint").UnitRegistry()
    units = {"force": ShownUnit("N", "mN", 1e3), "displacement": ShownUnit("m", "mm", 1e3),
             "temperature": ShownUnit("degC", "degF", 1.8, 32.0)}  # fmt: skip
    u = shown_product(unit, units)
    assert not {"N", "m", "K"} & set(re.findall(r"\w+", u.shown))
    shown = pint.Quantity(3.0, unit).to(u.shown.replace("degF", "delta_degF")).magnitude
    assert u.value(3.0) == pytest.approx(shown, rel=1e-11)


def test_products_with_stress_are_in_the_unit_of_loads_where_stress_was_not_measured() -> None:
    """The shift of a transformation with stress, in a campaign that declares its stresses in MPa alone."""
    load = ShownUnit("Pa", "MPa", 1e-6)
    u = shown_product("K/Pa", {"load": load})
    assert (u.shown, u.factor) == ("K/MPa", 1e6)
    assert shown_product("K/Pa", {"load": load, "stress": ShownUnit("Pa", "GPa", 1e-9)}).shown == "K/GPa"
    assert shown_product("K/N", {"load": ShownUnit("N", "gf", 101.97)}).shown == "K/N"


def test_ask_names_only_units_of_what_was_measured(declared: Path) -> None:
    records = read_run(declared).summary.records
    assert sorted(declared_units(records)) == ["mN", "mN/mm", "mm"]
    assert set(shown_units(records)) == {"force", "displacement", "stiffness"}


def test_a_strain_in_per_cent_is_told_from_the_pure_numbers_beside_it(
    run_copy: Path, edit_summary: EditSummary
) -> None:
    """Of a specimen the unit of strain is 1, as is that of a correlation, a skew and a share."""

    def as_specimen(summary: dict[str, Any]) -> None:
        for record in summary["records"]:
            quantities = record["quantities"]
            quantities["force"] = {"name": "stress", "unit": "Pa", "declared_unit": "MPa"}
            quantities["displacement"] = {"name": "strain", "unit": "1", "declared_unit": "percent"}
            quantities["stiffness"] = {"name": "modulus", "unit": "Pa"}
            for p in record["parameters"].values():
                p["unit"] = p["unit"].replace("cm", "1").replace("N", "Pa")
        for q in summary["loops"]:
            q["unit"] = q["unit"].replace("cm ", "").replace("N", "Pa")

    stored = {p.name: p for p in report_content(read_run(run_copy)).records[0].parameters}
    record = report_content(read_run(edit_summary(run_copy, as_specimen))).records[0]
    shown = {p.name: p for p in record.parameters}
    assert (shown["A1"].unit, shown["B1"].unit) == ("percent", "MPa")
    assert shown["A1"].mean == pytest.approx(100.0 * (stored["A1"].mean or 0.0))
    assert shown["A2"].mean == stored["A2"].mean
    assert shown["displacement_sd"].unit == "percent"
    assert [c.unit for c in record.channels] == ["MPa", "percent", "MPa"]
    assert record.settings["load"].unit == "MPa"
