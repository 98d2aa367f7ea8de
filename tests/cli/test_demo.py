"""The demo from the command line: a known truth beside the fit, and the paper's twin on request."""

from __future__ import annotations

import csv
import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sma_bayes import read_campaign
from sma_bayes.records.types import Branch
from sma_bayes.runs.outputs import band_path, read_band, read_run
from sma_bayes.simulated.campaign import truth_of
from sma_bayes.studies.fit.report_content import report_content


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    folder = tmp_path_factory.mktemp("demo") / "out"
    command = [sys.executable, "-m", "sma_bayes", "demo", "--out", str(folder), "--jobs", "1"]
    done = subprocess.run(command, capture_output=True, text=True, encoding="utf-8", check=False)
    assert done.returncode == 0, done.stderr
    return folder, done.stdout


def test_its_fits_are_adequate_and_in_declared_units(demo: tuple[Path, str]) -> None:
    summary = json.loads((demo[0] / "summary.json").read_text(encoding="utf-8"))
    assert summary["converged"]
    assert summary["adequate"]
    content = report_content(read_run(demo[0]))
    assert {c.unit for r in content.records for c in r.channels} == {"N", "mm", "N/mm"}
    assert content.command == "sma-bayes demo --out NEW --seed 0 --noise auto"


def test_no_curve_is_drawn_twice(demo: tuple[Path, str]) -> None:
    """The loops of three conditions show force and displacement; only the first explains its marks."""
    stems = {p.stem for p in (demo[0] / "figures").iterdir()}
    loops = {f"loop-{load}" for load in ("100g", "150g", "200g")}
    assert stems == loops | {"overview-stiffness", "parameters", "truth"}
    page = (demo[0] / "report.html").read_text(encoding="utf-8")
    assert page.count("Dotted lines: 90 % predictive interval of a new measurement") == 1
    assert page.count("Lines, bands and bars as for 100g.") == 2
    assert "average r of" not in page
    assert "tables/correlation_average.csv" in page


def test_its_measurements_can_be_fitted_by_anybody(demo: tuple[Path, str]) -> None:
    summary = json.loads((demo[0] / "summary.json").read_text(encoding="utf-8"))
    assert read_campaign(demo[0] / "measurements").sha256 == summary["data_sha256"]


def test_the_report_compares_with_the_truth(demo: tuple[Path, str]) -> None:
    folder, screen = demo
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert 'id="truth"' in page
    assert "figures/truth.pdf" in page
    assert (folder / "report.html").stat().st_size < 3e6
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    leaning = [p["role"] for r in summary["records"] for p in r["parameters"].values() if not p["identified"]]
    assert leaning
    assert set(leaning) == {"noise"}
    assert "<b>0</b> parameters of a curve that the data do not identify" in page
    assert f"{len(leaning)} parameters of noise or discrepancy are identified less well" in page
    assert "truth known" in screen
    assert "--paper" in screen
    with (folder / "tables" / "truth.csv").open(encoding="utf-8") as file:
        rows = {(r["condition"], r["branch"], r["channel"]): r for r in csv.DictReader(file)}
    assert len(rows) == 18
    for known in report_content(read_run(folder)).truth:
        band = read_band(band_path(folder, known.record, known.channel))
        scale = {"force": 1.0, "displacement": 1e3, "stiffness": 1e-3}[known.channel]
        true = truth_of(known.condition, Branch(known.branch), band.temperature)[known.channel]
        held = (band.quantiles["q05"] <= true) & (true <= band.quantiles["q95"])
        assert known.within == pytest.approx(held[~band.extrapolated].mean())
        np.testing.assert_allclose(known.curve, scale * true[~band.extrapolated])
        assert float(rows[known.condition, known.branch, known.name]["within [1]"]) == pytest.approx(
            known.within
        )


def test_the_bands_hold_most_of_the_truth(demo: tuple[Path, str]) -> None:
    """Pointwise bands of 90 % hold 90 % of many truths; of these six records and one seed, at least three quarters."""
    known = report_content(read_run(demo[0])).truth
    for name in ("force", "displacement", "stiffness"):
        assert np.mean([k.within for k in known if k.name == name]) > 0.75


def test_the_same_command_goes_on_and_another_seed_is_refused(
    run: Callable[..., Any], demo: tuple[Path, str]
) -> None:
    before = (demo[0] / "posterior" / "100g-heating.nc").read_bytes()
    again = run("demo", "--out", demo[0], "--jobs", 1, "--quiet", "--no-figures")
    assert again.status == 0, again.err
    assert (demo[0] / "posterior" / "100g-heating.nc").read_bytes() == before
    other = run("demo", "--out", demo[0], "--jobs", 1, "--quiet", "--seed", 1)
    assert other.status == 2
    assert "another run" in other.err
