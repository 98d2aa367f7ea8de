"""Of a wire or a rod the screen speaks of strain, not of displacement, and findings are told without false digits."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from sma_bayes import fit_campaign, sensitivity
from sma_bayes.checksum import KEY
from sma_bayes.records.campaign import read_campaign
from sma_bayes.report.choice import ReportOptions
from sma_bayes.runs.documents import COMPARISON, SENSITIVITY, sealed
from sma_bayes.runs.finished_run import read_finished
from sma_bayes.runs.store import write_json
from sma_bayes.studies.compare.report import build_report
from sma_bayes.studies.compare.terminal import comparison_text
from sma_bayes.studies.compare.workflow import compare
from sma_bayes.studies.inspect.terminal import show_inspection
from sma_bayes.studies.inspect.workflow import inspect_campaign
from sma_bayes.studies.sensitivity.figures.sensitivity import readings_figure
from sma_bayes.studies.sensitivity.schema import SensitivityDocument
from sma_bayes.studies.sensitivity.shown import in_declared_units


@pytest.fixture(scope="module")
def wire(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Strain of a wire at a stress that wanders a little, with one spike."""
    folder = tmp_path_factory.mktemp("wire")
    rng = np.random.default_rng(3)
    t = np.r_[np.linspace(20.0, 90.0, 120), np.linspace(90.0, 20.0, 120)]
    middle = np.where(np.arange(240) < 120, 60.0, 45.0)
    strain = 4.0 / (1.0 + np.exp(0.3 * (t - middle))) + rng.normal(0.0, 0.01, 240)
    strain[60] += 1.5
    stress = 100.0 + rng.normal(0.0, 0.3, 240)
    table = np.column_stack([t, strain, stress])
    np.savetxt(
        folder / "100MPa.csv",
        table,
        fmt="%.4f",
        delimiter=",",
        header="T_degC,strain_%,stress_MPa",
        comments="",
    )
    (folder / "campaign.toml").write_text(
        '[columns]\ntemperature = { name = "T_degC", unit = "degC" }\n'
        'strain = { name = "strain_%", unit = "percent" }\n'
        'stress = { name = "stress_MPa", unit = "MPa" }\n'
        '[[condition]]\nid = "a"\nfile = "100MPa.csv"\nstress_MPa = 100\n'
    )
    return folder


def test_findings_are_about_strain_and_stress(wire: Path, capsys: pytest.CaptureFixture[str]) -> None:
    campaign = read_campaign(wire)
    show_inspection(inspect_campaign(campaign), campaign)
    shown = capsys.readouterr().out
    assert "a strain" in shown
    assert "a stress" in shown
    assert "displacement" not in shown
    assert "force" not in shown
    told = next(f.message for f in campaign.findings if f.kind == "constant-load")
    assert all(len(word.replace(".", "")) <= 4 for word in told.split() if word[0].isdigit())


def test_readings_that_decide_are_readings_of_the_strain(wire: Path, tmp_path: Path) -> None:
    fit_campaign(read_campaign(wire), tmp_path / "fit", noise="independent", jobs=1, figures="none")
    sensitivity(tmp_path / "fit", tmp_path / "out", jobs=1)
    table = (tmp_path / "out" / "tables" / "readings.csv").read_text(encoding="utf-8")
    assert ",strain," in table
    assert ",displacement," not in table
    stored = read_finished(SENSITIVITY, SensitivityDocument, tmp_path / "out", in_declared_units)
    figure = readings_figure(stored, stored.found.records[0]).figure
    assert [text.get_text() for text in figure.legends[0].texts] == ["strain", "decides most"]


def test_a_comparison_names_the_strain(wire: Path, tmp_path: Path) -> None:
    found = compare(read_campaign(wire), tmp_path / "out", jobs=1, figures="none")
    text = comparison_text(found)
    assert "a-heating strain" in text
    row = next(line for line in text.splitlines() if "a-heating strain" in line)
    assert "cannot tell" in row
    assert "one curve by 3 names, ahead of the " in row, "why it can't is told beside it"
    assert text.count("are the same curve of this channel") == 1, "what all records share is told once"
    assert "displacement" not in text
    fail = {**found, "converged": False, "records": [{**r, "converged": False} for r in found["records"]]}
    write_json(tmp_path / "out" / COMPARISON.file, sealed({k: v for k, v in fail.items() if k != KEY}))
    build_report(tmp_path / "out", ReportOptions("report"))
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "<strong>Not converged:</strong> a-heating strain" in page
    assert "one curve by 3 names, ahead of the " in page, "as on the screen"
