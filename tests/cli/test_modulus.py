"""`sma-bayes modulus`: an export from the command line, files, resuming, and input that can't be used."""

from __future__ import annotations

import csv
import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import sma_bayes
from sma_bayes.report.notation import interval_text, write_interval
from sma_bayes.runs.documents import sealed
from sma_bayes.studies.modulus.terminal import show_modulus

MODELS = ("--model", "bounded_logistic", "--loss-model", "modulus_peak")
PEAK = {0.1: 46.0, 1.0: 50.0, 10.0: 54.0}
"""Midpoints by frequency [degC]."""


def write_export(path: Path, *, tan: float = 1.0, header: str = "") -> Path:
    """One heating of an alloy at three frequencies; `tan` falsifies the declared tan delta."""
    rng = np.random.default_rng(3)
    lines = (
        [header]
        if header
        else ["Temperature,Storage modulus,Loss modulus,Tan(delta),Frequency", "°C,MPa,MPa,,Hz"]
    )
    for t in np.linspace(0.0, 110.0, 60):
        for f, middle in PEAK.items():
            s = 1.0 / (1.0 + np.exp(-0.25 * (t - middle)))
            storage = 28e3 + 38e3 * s + 250.0 * rng.standard_normal()
            loss = 700.0 - 300.0 * s + 6000.0 * s * (1.0 - s) + 25.0 * rng.standard_normal()
            lines.append(f"{t:.3f},{storage:.6g},{loss:.6g},{tan * loss / storage:.6g},{f:g}")
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def export(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_export(tmp_path_factory.mktemp("dmta") / "strip.csv")


@pytest.fixture(scope="module")
def out(export: Path) -> Path:
    folder = export.parent / "out"
    sma_bayes.modulus(export, folder, at=["20 degC"], model=MODELS[1], loss_model=MODELS[3], jobs=1)
    return folder


def found_in(folder: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((folder / "modulus.json").read_text(encoding="utf-8"))
    return found


def test_the_document_is_as_published_and_every_file_is_there(
    out: Path, published: Callable[[str], Any]
) -> None:
    found = found_in(out)
    published("modulus").validate(found)
    assert found["converged"]
    assert [s["id"] for s in found["sweeps"]] == [f"strip-{f:g}Hz-heating" for f in PEAK]
    page = (out / "report.html").read_text(encoding="utf-8")
    for shift in found["shifts"]:
        assert shift["statement"] in page
    for name in ("moduli", "shift"):
        assert (out / "figures" / f"{name}.png").is_file()
    with (out / "bands" / "strip-1Hz-heating.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    at = min(rows, key=lambda r: abs(float(r["temperature_degC"]) - 50.0))
    low, high, t = (float(at[k]) for k in ("storage_modulus_q05", "storage_modulus_q95", "temperature_degC"))
    true = 28e9 + 38e9 / (1.0 + np.exp(-0.25 * (t - 50.0)))
    assert low - (high - low) < true < high + (high - low)
    assert not (out / "parts").exists()


def test_findings_about_the_measurements_are_told(
    run: Callable[..., Any], out: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    found = found_in(out)
    blank = {"file": "strip.csv", "rows": [], "count": 1, "dropped": 0}
    blank |= dict.fromkeys(("condition", "branch", "column"), "")
    found["findings"] = [
        {"kind": "implausible", "message": "a modulus of 30 kPa", "severity": "serious", **blank},
        {"kind": "encoding", "message": "was read as cp1252", "severity": "look", **blank},
        {
            "kind": "encoding",
            "message": "was read as cp1252",
            "severity": "look",
            **blank,
            "condition": "other",
        },
        {"kind": "quantised", "message": "steps of 0.1", "severity": "note", **blank},
    ]
    show_modulus(found, out)
    shown = capfd.readouterr().out
    assert "SERIOUS: strip.csv: a modulus of 30 kPa\nstrip.csv: was read as cp1252\n" in shown
    assert shown.count("was read as cp1252") == 1, "what is true of several sweeps is told once"
    assert "steps of 0.1" not in shown
    folder = tmp_path / "again"
    shutil.copytree(out, folder)
    (folder / "modulus.json").write_text(json.dumps(sealed(found)), encoding="utf-8")
    assert run("report", folder, "--quiet").status == 0
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert "strip.csv: a modulus of 30 kPa" in page
    assert page.count("strip.csv: was read as cp1252") == 1


@pytest.mark.parametrize("columns", ["80", "160"])
def test_no_sweep_is_shortened_on_the_terminal(
    out: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, columns: str
) -> None:
    monkeypatch.setattr("sys.stdout.isatty", lambda: columns == "80")
    monkeypatch.setenv("COLUMNS", columns)
    found = found_in(out)
    show_modulus(found, out)
    shown = capsys.readouterr().out
    for s in found["sweeps"]:
        lines = [t for t in shown.splitlines() if s["id"] in t]
        assert len(lines) == 1 or columns == "80"  # one in each part of a table that is too wide
        (middle,) = (t for t in s["temperatures"] if t["name"] == "midpoint")
        told = interval_text(middle["median"], middle["q05"], middle["q95"])
        assert sum(told in t for t in lines) == 1


def test_temperatures_and_shift_are_those_of_the_alloy(out: Path) -> None:
    """Midpoints within 4 standard deviations; 4 K per decade within the interval of each shift."""
    found = found_in(out)
    for s in found["sweeps"]:
        middle = next(t for t in s["temperatures"] if t["name"] == "midpoint")
        assert middle["identified"]
        assert abs(middle["mean"] - PEAK[s["frequency"]]) < 4.0 * middle["sd"]
        (cold,) = (v for v in s["values"] if v["channel"] == "storage_modulus")
        assert abs(cold["median"] - 28.01e9) < 0.3e9
    assert {s["temperature"] for s in found["shifts"]} >= {"midpoint", "loss_peak", "tan_delta_peak"}
    for shift in found["shifts"]:
        if shift["temperature"] in ("midpoint", "loss_peak", "tan_delta_peak"):
            assert shift["shift"]["q05"] < 4.0 < shift["shift"]["q95"]
            assert shift["identified"]
            low, high = shift["activation_energy"]["q05"], shift["activation_energy"]["q95"]
            assert low < 8.314 * 323.15**2 * np.log(10.0) / 4.0 < high
    (by_frequency,) = found["by_frequency"]
    assert by_frequency["factor"]["q05"] < 1.0 < by_frequency["factor"]["q95"]


def test_what_an_activation_energy_is_stands_where_it_is_told(
    out: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    page = " ".join((out / "report.html").read_text(encoding="utf-8").split())
    before, of_shift = page.split('<h2 id="shift">')
    of_shift, after = of_shift.split('<h2 id="curves">')
    assert ("apparent number" in before, "apparent number" in of_shift, "apparent number" in after) == (
        False,
        True,
        False,
    )
    show_modulus(found_in(out), out)
    assert "apparent number" in " ".join(capsys.readouterr().out.split())


def test_moduli_that_are_declared_in_megapascals_stay_so(out: Path) -> None:
    found = found_in(out)
    assert found["modulus_unit"] == "Pa"
    assert found["declared_units"] == {"modulus": "MPa"}
    stored = {(s["frequency"], v["channel"]): v for s in found["sweeps"] for v in s["values"]}
    with (out / "tables" / "values.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    for row in rows:
        v = stored[float(row["frequency"].removesuffix(" Hz")), row["quantity"].replace(" ", "_")]
        factor = 1e-6 if v["unit"] == "Pa" else 1.0
        assert row["unit"] == ("MPa" if v["unit"] == "Pa" else "1")
        assert float(row["value_median [unit]"]) == pytest.approx(factor * v["median"], rel=1e-8)
    with (out / "tables" / "parameters.csv").open(encoding="utf-8") as file:
        units = {r["unit"] for r in csv.DictReader(file)}
    assert "MPa" in units
    assert not any(re.search(r"\bG?Pa\b", unit) for unit in units)
    with (out / "figures" / "moduli.csv").open(encoding="utf-8") as file:
        drawn = [float(r["q50"]) for r in csv.DictReader(file) if r["channel"] == "storage_modulus"]
    assert 27e3 < min(drawn) < max(drawn) < 67e3


@pytest.mark.parametrize(
    ("unit", "shown", "factor", "zero"), [("°F", "°F", 1.8, 32.0), ("K", "K", 1.0, 273.15)]
)
def test_temperatures_are_shown_as_they_are_declared(
    run: Callable[..., Any],
    export: Path,
    out: Path,
    tmp_path: Path,
    unit: str,
    shown: str,
    factor: float,
    zero: float,
) -> None:
    """The same export in another unit of temperature: people read that unit, the document is in degC."""
    names, _, *rows = export.read_text(encoding="utf-8").splitlines()
    lines = [names, f"{unit},MPa,MPa,,Hz"]
    for row in rows:
        t, rest = row.split(",", 1)
        lines.append(f"{factor * float(t) + zero:.6f},{rest}")
    path = tmp_path / "strip.csv"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    place = tmp_path / "out"
    outcome = run("modulus", path, "--out", place, "--at", "20 degC", *MODELS, "--jobs", "1")
    assert outcome.status == 0, outcome.err
    found, before = found_in(place), found_in(out)
    assert found["temperature_unit"] == "degC"
    page = (place / "report.html").read_text(encoding="utf-8")
    for text in (outcome.out, page):
        assert "°C" not in text
    (pages,) = (s for s in found["shifts"] if s["temperature"] == "midpoint")
    quantiles = (factor * pages["shift"][q] for q in ("median", "q05", "q95"))
    middle, low, high = (f"+{text}" for text in write_interval(*quantiles).plain)
    assert low < middle < high, "the digits bear the width of the interval"
    for text in (outcome.out, page):
        assert f"midpoint: shift of {middle} {shown} per decade of frequency ({low} to {high})" in text
    assert f"storage modulus at {factor * 20.0 + zero:.6g} {shown}: times" in outcome.out
    stored = {(s["frequency"], t["name"]): t for s in found["sweeps"] for t in s["temperatures"]}
    original = {(s["frequency"], t["name"]): t for s in before["sweeps"] for t in s["temperatures"]}
    with (place / "tables" / "temperatures.csv").open(encoding="utf-8") as file:
        for row in csv.DictReader(file):
            key = float(row["frequency"].removesuffix(" Hz")), row["temperature"].replace(" ", "_")
            told = float(row[f"value_median [{shown}]"])
            assert told == pytest.approx(factor * stored[key]["median"] + zero, rel=1e-8)
            assert stored[key]["median"] == pytest.approx(original[key]["median"], abs=0.3)
    parameters = {
        (s["frequency"], c["channel"], n): p
        for s in found["sweeps"] for c in s["curves"] for n, p in c["parameters"].items()
    }  # fmt: skip
    with (place / "tables" / "parameters.csv").open(encoding="utf-8") as file:
        for row in csv.DictReader(file):
            key = (
                float(row["frequency"].removesuffix(" Hz")),
                row["curve"].replace(" ", "_"),
                row["parameter"],
            )
            expected = {"midpoint": (shown, factor, zero), "rate": (f"1/{shown}", 1.0 / factor, 0.0)}
            if row["parameter"] in expected:
                name, times, plus = expected[row["parameter"]]
                assert row["unit"] == name
                assert float(row["value_median [unit]"]) == pytest.approx(
                    times * parameters[key]["median"] + plus, rel=1e-8
                )
    with (place / "figures" / "shift.csv").open(encoding="utf-8") as file:
        drawn = {(float(r["frequency"]), r["temperature"]): float(r["value"]) for r in csv.DictReader(file)}
    assert drawn[1.0, "midpoint"] == pytest.approx(factor * stored[1.0, "midpoint"]["mean"] + zero, rel=1e-8)


def test_resuming_and_reporting_change_nothing(run: Callable[..., Any], export: Path, out: Path) -> None:
    before = found_in(out)
    (out / "report.html").unlink()
    options = (*MODELS, "--at", "20 degC", "--jobs", "1")
    assert run("modulus", export, "--out", out, *options, "--resume", "--quiet").status == 0
    assert (out / "report.html").is_file()
    assert run("report", out, "--quiet").status == 0
    assert found_in(out) == before
    refused = run("modulus", export, "--out", out, *options)
    assert refused.status == 2
    assert "--resume" in refused.err
    other = run("modulus", export, "--out", out, *MODELS, "--at", "30 degC", "--resume")
    assert other.status == 2
    assert "differs in" in other.err


def test_a_run_that_was_interrupted_goes_on_where_it_was(
    run: Callable[..., Any], export: Path, out: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from sma_bayes.studies.modulus import workflow

    whole, fitted = workflow.study_sweep, []

    def until_killed(sweep: Any, **options: Any) -> Any:
        if len(fitted) == 1:
            raise KeyboardInterrupt
        fitted.append(sweep.id)
        return whole(sweep, **options)

    place = tmp_path / "again"
    options = {"at": ["20 degC"], "model": MODELS[1], "loss_model": MODELS[3], "jobs": 1, "figures": "none"}
    monkeypatch.setattr(workflow, "study_sweep", until_killed)
    with pytest.raises(KeyboardInterrupt):
        sma_bayes.modulus(export, place, **options)
    assert [p.stem for p in (place / "parts").iterdir()] == fitted
    later: list[str] = []

    def counted(sweep: Any, **options: Any) -> Any:
        later.append(sweep.id)
        return whole(sweep, **options)

    monkeypatch.setattr(workflow, "study_sweep", counted)
    found = sma_bayes.modulus(export, place, resume=True, **options)
    assert len(later) == 2
    assert fitted[0] not in later
    assert found["sweeps"] == found_in(out)["sweeps"]


def test_a_declared_tan_delta_that_is_wrong_is_told_at_the_terminal(
    run: Callable[..., Any], tmp_path: Path
) -> None:
    path = write_export(tmp_path / "wrong.csv", tan=1.3)
    outcome = run(
        "modulus", path, "--out", tmp_path / "out", *MODELS, "--jobs", "1", "--no-figures", "--at", "20 degC"
    )
    assert outcome.status == 0, outcome.err
    assert "declared tan delta and E''/E' disagree in" in " ".join(outcome.out.split())
    assert "midpoint: shift of" in outcome.out


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (("--at", "warm"), "temperature 'warm'"),
        (("--model", "modified_sigmoid"), "not a bounded curve of this modulus"),
        (("--loss-model", "modulus_slope"), "modulus_peak_slopes"),
        (("--column", "stiff"), "QUANTITY=VALUE"),
        (("--column", "storage_modulus=stiff"), "there is no such column"),
        (("--unit", "storage_modulus=N"), "no unit of storage modulus"),
    ],
)
def test_what_can_not_be_is_refused_before_anything_is_written(
    run: Callable[..., Any], export: Path, tmp_path: Path, options: tuple[str, ...], told: str
) -> None:
    outcome = run("modulus", export, "--out", tmp_path / "out", *options)
    assert outcome.status == 2
    assert told in outcome.err
    assert not (tmp_path / "out").exists()


def test_a_missing_unit_and_an_unknown_column_have_status_2(run: Callable[..., Any], tmp_path: Path) -> None:
    path = write_export(
        tmp_path / "bare.csv", header="Temperature,Storage modulus,Loss modulus,Tan(delta),Frequency"
    )
    outcome = run("modulus", path, "--out", tmp_path / "out")
    assert outcome.status == 2
    assert "column 'Temperature': no unit is stated" in outcome.err
    assert '--unit "temperature=degC"' in outcome.err
    path = write_export(tmp_path / "other.csv", header="oven,E,L,D,f")
    outcome = run("modulus", path, "--out", tmp_path / "out")
    assert outcome.status == 2
    assert "no column of temperature among 'oven'" in outcome.err
    assert not (tmp_path / "out").exists()


def test_computed_moduli_are_told_as_such(run: Callable[..., Any], tmp_path: Path) -> None:
    """Two minutes and more went by before nothing was said of them."""
    t = np.linspace(0.0, 110.0, 60)
    share = 1.0 / (1.0 + np.exp(-0.25 * (t - 50.0)))
    loss = 700.0 + 6000.0 * share * (1.0 - share)
    rows = [
        f"{a!r},{b!r},{c!r}"
        for a, b, c in zip(t.tolist(), (28e3 + 38e3 * share).tolist(), loss.tolist(), strict=True)
    ]
    path = tmp_path / "computed.csv"
    path.write_text(
        "\n".join(["Temperature,Storage modulus,Loss modulus", "°C,MPa,MPa", *rows]), encoding="utf-8"
    )
    told = run("modulus", path, "--frequency", "1 Hz", "--out", tmp_path / "out", "--no-figures", "--jobs", 1)
    assert told.status == 1
    assert [c["computed"] for c in found_in(tmp_path / "out")["sweeps"][0]["curves"]] == [True, True]
    assert "storage modulus: it has no noise: it was computed, not measured" in " ".join(told.out.split())


def test_sweeps_that_state_no_frequency_have_a_report(run: Callable[..., Any], tmp_path: Path) -> None:
    """Their figure ended in a traceback, and so did a call with the defaults."""
    t = np.linspace(0.0, 110.0, 40)
    noise = np.random.default_rng(2).standard_normal(t.size)
    storage = 28e3 + 38e3 / (1.0 + np.exp(-0.25 * (t - 50.0))) + 250.0 * noise
    rows = [f"{a:.6g},{b:.6g}" for a, b in zip(t, storage, strict=True)]
    path = tmp_path / "strip.csv"
    path.write_text("\n".join(["Temperature,Storage modulus", "°C,MPa", *rows]), encoding="utf-8")
    told = run("modulus", path, "--out", tmp_path / "out", "--model", "bounded_logistic", "--jobs", 1)
    assert told.status == 0, told.err
    assert "1 sweep, seed 0" in told.out
    assert (tmp_path / "out" / "report.html").exists()
    assert (tmp_path / "out" / "figures" / "moduli.png").exists()
    assert "apparent number" not in told.out + (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
