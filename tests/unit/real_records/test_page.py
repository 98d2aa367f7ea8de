"""What is asked of fits of real measurements, and the page that says what was reached."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import pytest
from calibration.page import BEGIN, END
from real_records.page import targets, write_page
from typer.testing import CliRunner


def line(key: int = 0, method: str = "ours", **changed: Any) -> dict[str, Any]:
    score = {"coverage": 0.9, "log_score": 3.0, "width": 0.02}
    held_out = {"blocks": score | changed.pop("blocks", {}), "ends": score, "sweeps": None}
    return {
        "key": f"flexinol_isobaric/{key}", "example": "flexinol_isobaric", "record": f"{key}-heating",
        "branch": "heating",
        "n": 100, "sweeps": 1, "method": method, "model_asked": "", "model": "modified_sigmoid", "noise": "independent",
        "discrepancy": None, "converged": True, "rmse": 0.005, "lag1": 0.1, "width": 1.2, "scatter": 0.001,
        "seconds": 0.5, "held_out": held_out, "held_out_seconds": 2.0, **changed,
    }  # fmt: skip


def reached(lines: list[dict[str, Any]]) -> dict[str, bool]:
    return {t.asked: t.is_reached for t in targets(lines)}


def test_nine_branches_of_ten_must_be_close() -> None:
    key = "rmse at most 1 % of range and correlation of innovations within ±0.5 on nine branches of ten"
    good = [line(i) for i in range(9)]
    assert reached([*good, line(9, rmse=0.02)])[key]
    assert not reached([*good[:8], line(8, lag1=-0.6), line(9, rmse=0.02)])[key]


def test_records_of_several_sweeps_are_not_counted() -> None:
    (first, *_) = targets([line(0), line(1, sweeps=7, rmse=0.1)])
    assert first.found == "1 of 1"


@pytest.mark.parametrize(("coverage", "met"), [(0.9, True), (0.8, False), (0.97, False)])
def test_held_out_coverage_is_over_all_readings(coverage: float, met: bool) -> None:
    found = reached([line(0, blocks={"coverage": coverage}, n=10_000), line(1)])
    assert found["held-out coverage of 90 % bands between 85 and 95 %"] is met


def test_the_gaussian_process_must_be_beaten_on_four_of_five() -> None:
    ours = [line(i) for i in range(5)]
    theirs = [line(i, "gaussian_process", blocks={"log_score": 2.0}) for i in range(5)]
    key = next(k for k in reached(ours + theirs) if "scikit-learn" in k)
    assert reached(ours + theirs)[key]
    theirs[0]["held_out"]["blocks"]["log_score"] = 4.0
    assert reached(ours + theirs)[key]
    theirs[1]["held_out"]["blocks"]["log_score"] = 4.0
    assert not reached(ours + theirs)[key]


def test_the_widest_band_decides() -> None:
    key = "predictive bands at most twice as wide as the readings' own scatter on Flexinol"
    assert reached([line(0), line(1, width=1.9)])[key]
    assert not reached([line(0), line(1, width=2.1)])[key]


def test_what_was_not_measured_is_not_reached() -> None:
    assert not any(t.is_reached for t in targets([]))
    assert {t.found for t in targets([])} == {"not measured"}


def test_the_page_and_its_numbers(tmp_path: Path) -> None:
    (tmp_path / "data").mkdir()
    page = tmp_path / "real_measurements.md"
    page.write_text(f"before\n{BEGIN}\n{END}\nafter\n", encoding="utf-8")
    refused = {
        k: line(2)[k] for k in ("key", "example", "record", "branch", "n", "sweeps", "method", "model_asked")
    }
    lines = [line(0, "celerite", blocks={"log_score": 9.0}), line(0), refused | {"failed": "too few samples"}]
    write_page(lines, tmp_path)
    text = page.read_text(encoding="utf-8")
    assert "**9.00**, 90 %" in text
    assert "too few samples" in text
    assert text.startswith("before")
    with (tmp_path / "data" / "real_measurements.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [r["method"] for r in rows] == ["ours", "celerite", "ours"]
    assert rows[1]["blocks_log_score"] == "9"
    assert rows[0]["sweeps_coverage"] == ""


def test_what_was_not_measured_anew_stays(tmp_path: Path) -> None:
    (tmp_path / "data").mkdir()
    page = tmp_path / "real_measurements.md"
    page.write_text(f"{BEGIN}\n{END}\n", encoding="utf-8")
    refused = {k: line(2)[k] for k in ("key", "example", "record", "branch", "n", "sweeps", "method")}
    lines = [line(0), line(0, "celerite"), line(1), refused | {"failed": "too few samples"}]
    lines = [x | {"key": f"{x['example']}/{x['record']}"} for x in lines]
    write_page(lines, tmp_path)
    before = page.read_text(encoding="utf-8")
    write_page([], tmp_path)
    assert page.read_text(encoding="utf-8") == before
    write_page([lines[0] | {"rmse": 0.0071}], tmp_path)
    after = page.read_text(encoding="utf-8")
    assert after.replace("| 0.71 |", "| 0.50 |") == before != after


@pytest.mark.parametrize(
    "options", [["--methods", "magic"], ["--sets", "no set"], ["--data", "no such folder"]]
)
def test_a_wrong_call_is_refused_before_anything_is_done(options: list[str], tmp_path: Path) -> None:
    import real_measurements

    out = tmp_path / "lines.jsonl"
    arguments = ["run", "--out", str(out), "--data", str(tmp_path), *options]
    assert CliRunner().invoke(real_measurements.app, arguments).exit_code == 2
    assert not out.exists()
