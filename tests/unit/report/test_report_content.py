"""From the summary of a run to the content of its report."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from sma_bayes.paper.twin import truth
from sma_bayes.report.content import Content, Estimate, Number
from sma_bayes.report.tables import report_tables
from sma_bayes.runs.fit_document import read_fit
from sma_bayes.runs.outputs import read_run
from sma_bayes.studies.fit.answer import answer_tables
from sma_bayes.studies.fit.report_content import is_twin, report_content

Edit = Callable[[Path, Callable[[dict[str, Any]], None]], Path]


def test_every_number_keeps_its_value_and_unit(content: Content, finished: Path) -> None:
    summary = json.loads((finished / "summary.json").read_text(encoding="utf-8"))
    for record, raw in zip(content.records, summary["records"], strict=True):
        for p in record.parameters:
            assert p.unit == raw["parameters"][p.name]["unit"]
            assert (p.mean, p.rhat) == (raw["parameters"][p.name]["mean"], raw["parameters"][p.name]["rhat"])
        assert {c.name: c.unit for c in record.channels} == {
            "force": "N", "displacement": "cm", "stiffness": "N/cm"
        }  # fmt: skip
        assert [c.name for c in record.channels if not c.observed] == ["stiffness"]
    assert content.document.seed == summary["seed"]
    assert content.document.data_sha256 == summary["data_sha256"]


def test_noise_parameters_are_told_from_those_of_the_response(content: Content) -> None:
    names = [p.name for p in content.records[0].model_parameters]
    assert names == ["A1", "A2", "A3", "A4", "B1", "B2", "B3", "B4"]
    assert all(
        p.name.startswith(("force_", "displacement_")) for p in content.records[0].parameters if p.of_noise
    )


def test_settings_have_units(content: Content) -> None:
    assert content.records[0].settings["load"] == Number(pytest.approx(0.980665), "N")
    assert content.records[0].settings["frequency"].unit == "Hz"


def test_a_specimen_is_called_what_it_is(run_copy: Path, edit_summary: Edit) -> None:
    def change(summary: dict[str, Any]) -> None:
        summary["source"] = "wire.toml"
        for record in summary["records"]:
            record["quantities"] = {
                "force": {"name": "stress", "unit": "Pa"},
                "displacement": {"name": "strain", "unit": "1"},
                "stiffness": {"name": "modulus", "unit": "Pa"},
            }
            record["held"] = {"force": {"mean": 1.5e8, "sd": 1e5, "unit": "Pa"}}

    found = report_content(read_run(edit_summary(run_copy, change)))
    record = found.records[0]
    assert [c.symbol for c in record.channels] == ["σ", "ε", "E"]
    assert record.settings["load"].unit == "MPa"  # as stress_MPa declares it
    assert record.held == ("stress held at 1.5 × 10⁸ Pa (sd 1 × 10⁵ Pa)",)
    table = report_tables(found)["loops"]
    keys = [c.key for c in table.columns]
    assert {row[keys.index("channel")] for row in table.rows} == {"stress", "strain", "modulus"}
    assert {"hysteresis width", "modulus ratio"} < {row[keys.index("quantity")] for row in table.rows}
    assert [c.name for c in answer_tables(found)[0].columns[2:4]] == ["least modulus", "greatest modulus"]
    assert all(isinstance(cell, Estimate) for row in answer_tables(found)[0].rows for cell in row[2:4])


def test_what_may_be_missing_is_not_missed(run_copy: Path, edit_summary: Edit) -> None:
    def change(summary: dict[str, Any]) -> None:
        for key in ("loops", "findings", "options", "versions"):
            summary.pop(key)
        for record in summary["records"]:
            for key in (
                "checks",
                "noise",
                "sampler",
                "path",
                "shape",
                "free_directions",
                "settings",
                "correlation",
            ):
                record.pop(key)
        summary.pop("correlation_average")

    found = report_content(read_run(edit_summary(run_copy, change)))
    assert found.loops == ()
    assert found.averages == ()
    assert found.records[0].document.checks == ()


def test_a_record_that_did_not_converge_supports_no_conclusion(run_copy: Path, edit_summary: Edit) -> None:
    def change(summary: dict[str, Any]) -> None:
        summary["records"][0]["converged"] = False
        summary["records"][0]["parameters"]["A1"] |= {"rhat": 1.2, "ess_bulk": 30.0}
        summary["records"][0]["parameters"]["A2"] |= {"rhat": None, "ess_bulk": None}

    found = report_content(read_run(edit_summary(run_copy, change)))
    assert [r.branch for r in found.converged] == ["cooling"]
    assert [p.name for p in found.records[0].parameters if p.short_of_target] == ["A1", "A2"]
    assert found.loops
    assert found.loops_of("100g-10mHz") == ()
    assert found.records[0].worst_rhat is not None
    assert found.records[0].worst_rhat.name == "A1"


def test_averages_are_told_for_every_rule_and_branch(content: Content) -> None:
    force = [a for a in content.averages if (a.document.channel, a.data) == ("force", "measured")]
    assert {(a.branch, a.rule) for a in force} == {
        (branch, rule) for branch in ("heating", "cooling", "both") for rule in ("plain", "fisher", "pooled")
    }
    heating, cooling, both = (
        next(a for a in force if (a.branch, a.rule) == (branch, "plain")).factors["r"].median or 0.0
        for branch in ("heating", "cooling", "both")
    )
    measured = [c.measured["r"].median for r in content.records for c in r.channels if c.channel == "force"]
    assert [heating, cooling] == measured
    assert both == pytest.approx((heating + cooling) / 2, abs=1e-5)
    assert all(a.r.above == 1.0 for a in force)


def test_the_twin_is_set_against_the_printed_values(content: Content, finished: Path) -> None:
    assert is_twin(read_run(finished).summary)
    assert len(content.printed) == 12
    for c in content.printed:
        assert c.cell.value == truth(c.record)[c.parameter]
        assert c.inside == (abs(c.distance) < 1.645 if abs(abs(c.distance) - 1.645) > 0.3 else c.inside)


def test_other_campaigns_are_not(run_copy: Path, edit_summary: Edit) -> None:
    elsewhere = edit_summary(run_copy, lambda s: s.update(source="my rig/campaign.toml"))
    assert report_content(read_run(elsewhere)).printed == ()

    def rename(summary: dict[str, Any]) -> None:
        summary["source"] = "Tables 3 to 8 as printed"
        summary["records"][0]["key"] = "x"

    stranger = edit_summary(run_copy, rename)
    assert not is_twin(read_fit(stranger))


def test_the_command_gives_the_same_run_again(run_copy: Path, edit_summary: Edit) -> None:
    assert (
        report_content(read_run(run_copy)).command == "sma-bayes demo --paper --out NEW --seed 0 --noise auto"
    )
    options = {"noise": "ar1", "pool": "campaign", "extrapolate": 5.0}
    other = edit_summary(run_copy, lambda s: s.update(source="my rig", seed=7, options=options))
    assert report_content(read_run(other)).command == (
        'sma-bayes fit "my rig" --out NEW --seed 7 --noise ar1 --extrapolate 5.0 --pool campaign --priors priors.toml'
    )
    apart = edit_summary(other, lambda s: s.update(data_dir="raw data"))
    assert report_content(read_run(apart)).command.startswith(
        'sma-bayes fit "my rig" --out NEW --data "raw data" --seed 7'
    )


def test_a_prior_is_put_into_words(content: Content) -> None:
    p = content.records[0].parameters[0]
    lognormal = {"family": "lognormal", "median": 0.5, "sigma": 1.0, "sign": -1.0, "source": "made up"}
    half_normal = {"family": "half_normal", "sd": 2e-5}
    assert p.model_copy(update={"prior": lognormal}).prior_text == "lognormal, negative, median 0.5, sigma 1"
    assert p.model_copy(update={"prior": half_normal}).prior_text == "half normal, sd 2 × 10⁻⁵"


@pytest.mark.parametrize(
    ("changes", "driven", "short"),
    [
        ({}, False, False),
        ({"identified": False}, True, False),
        ({"identified": False, "fixed": True, "rhat": None}, False, False),
        ({"rhat": 1.02}, False, True),
        ({"ess_tail": 900.0}, False, True),
        ({"sd_error": 0.024}, False, True),
        ({"quantile_error": 0.07}, False, True),
        ({"rhat": None}, False, True),
    ],
)
def test_verdicts_on_a_parameter(
    content: Content, changes: dict[str, Any], driven: bool, short: bool
) -> None:
    p = content.records[0].parameters[0].model_copy(update=changes)
    assert (p.prior_driven, p.short_of_target) == (driven, short)


def test_conditions_with_other_units_are_kept_apart(content: Content) -> None:
    first, second = content.records
    meters = tuple(replace(c, unit="m") if c.channel == "displacement" else c for c in second.channels)
    other = replace(second, condition="other", channels=meters)
    assert [len(part.records) for part in content.by_units()] == [2]
    parts = replace(content, records=(first, other)).by_units()
    assert [[r.condition for r in part.records] for part in parts] == [[first.condition], ["other"]]
