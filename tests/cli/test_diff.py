"""`sma-bayes diff`: two fits of the same data agree, whatever the seed; others are told apart, with what went in."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import sma_bayes
from sma_bayes import fit_campaign
from sma_bayes.runs.documents import sealed


@pytest.fixture(scope="module")
def folders(make_campaign: Callable[..., Path], tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    place = tmp_path_factory.mktemp("diff")
    bench = make_campaign(place / "bench")
    campaign = sma_bayes.read_campaign(bench)
    for name, seed in (("a", 0), ("b", 1)):
        fit_campaign(campaign, place / name, seed=seed, noise="independent", jobs=1, figures="none")
    fit_campaign(
        campaign, place / "skewed", model="sinh_arcsinh", noise="independent", jobs=1, figures="none"
    )
    lines = (bench / "a.csv").read_text(encoding="utf-8").splitlines()
    warmer = [lines[0]]
    for line in lines[1:]:
        time, temperature, *rest = line.split(",")
        warmer.append(",".join([time, f"{float(temperature) + 1.0:.6g}", *rest]))
    (bench / "a.csv").write_text("\n".join(warmer) + "\n", encoding="utf-8")
    fit_campaign(
        sma_bayes.read_campaign(bench), place / "warmer", noise="independent", jobs=1, figures="none"
    )
    return {name: place / name for name in ("a", "b", "skewed", "warmer")}


def test_another_seed_gives_the_same(
    run: Callable[..., Any], folders: dict[str, Path], published: Callable[[str], Any]
) -> None:
    outcome = run("diff", folders["a"], folders["b"], "--json")
    assert (outcome.status, outcome.err) == (0, "")
    found = json.loads(outcome.out)
    assert found["schema"] == "sma-bayes/diff/1"
    assert found == sma_bayes.diff(folders["a"], folders["b"])
    published("diff").validate(found)
    assert found["same"]
    assert found["inputs"] == {"seed": [0, 1]}
    assert all(0.0 < abs(p["shift"]) < 0.25 for r in found["records"] for p in r["parameters"].values())


def test_of_two_models_the_nearest_published_curves_are_compared(
    run: Callable[..., Any], folders: dict[str, Path]
) -> None:
    """Data follow the published model: what both have in common agrees, and skew and tails stand beside nothing."""
    found = sma_bayes.diff(folders["a"], folders["skewed"])
    for r in found["records"]:
        curve = {n: p for n, p in r["parameters"].items() if "_" not in n}
        assert {n[0] for n in curve} <= {"A", "B"}
        assert all(p["a"] and p["b"] and abs(p["shift"]) < 1.5 for p in curve.values())
    outcome = run("diff", folders["a"], folders["skewed"])
    assert "published curve nearest to either" in outcome.out


def test_a_run_is_the_same_as_itself(folders: dict[str, Path]) -> None:
    found = sma_bayes.diff(folders["a"], folders["a"])
    assert found["same"]
    assert found["inputs"] == {}
    assert {p["shift"] for r in found["records"] for p in r["parameters"].values()} == {0.0}


def test_a_thermometer_that_is_off_shows_where_it_should(
    run: Callable[..., Any], folders: dict[str, Path]
) -> None:
    outcome = run("diff", folders["a"], folders["warmer"])
    assert outcome.status == 1
    assert "data sha256" in outcome.out
    assert "DIFFERENT: 0 of 2 records agree" in outcome.out
    assert "  temperature: lowest 30 °C, highest 70 °C in a, lowest 31 °C, highest 71 °C in b" in outcome.out
    heating = sma_bayes.diff(folders["a"], folders["warmer"])["records"][0]
    for name in ("A3", "B3"):
        p = heating["parameters"][name]
        assert p["b"]["median"] - p["a"]["median"] == pytest.approx(1.0, abs=0.02)
        assert p["shift"] == pytest.approx(
            (p["b"]["median"] - p["a"]["median"]) / max(p["a"]["sd"], p["b"]["sd"])
        )
    assert abs(heating["parameters"]["B1"]["shift"]) < 0.25, "the span is what it was"
    assert abs(heating["bands"]["force"]["shift"]) > 3.0
    assert heating["changed"]["temperature"][1]["lowest"] == 31.0
    for name in ("As", "Af"):
        t = heating["transformation"][name]
        assert t["b"]["median"] - t["a"]["median"] == pytest.approx(1.0, abs=0.05)
        assert t["shift"] > 3.0
        assert f"{name} [°C]" in outcome.out
    force = heating["bands"]["force"]
    assert force["medians"][1] - force["medians"][0] == pytest.approx(force["difference"])


def test_a_record_that_is_in_one_only_is_a_difference(
    run: Callable[..., Any], folders: dict[str, Path], tmp_path: Path
) -> None:
    copy = Path(shutil.copytree(folders["a"], tmp_path / "copy"))
    summary = json.loads((copy / "summary.json").read_text(encoding="utf-8"))
    del summary["records"][1]
    summary["records"][0]["settings"] = {"load": 1.5}
    summary["records"][0]["adequate"] = not summary["records"][0]["adequate"]
    (copy / "summary.json").write_text(json.dumps(sealed(summary)), encoding="utf-8")
    outcome = run("diff", folders["a"], copy)
    assert outcome.status == 1
    assert "only in a: a-cooling" in outcome.out
    told = "b, not in a" if summary["records"][0]["adequate"] else "a, not in b"
    assert f"  adequate in {told}" in outcome.out
    assert "settings: none in a, load 1.5 N in b" in outcome.out
    assert run("diff", folders["a"], copy, "--quiet").out == ""


def changed_copy(folder: Path, to: Path, change: Callable[[dict[str, Any]], None]) -> Path:
    """Copy of a fit whose summary says something else."""
    copy = Path(shutil.copytree(folder, to))
    summary = json.loads((copy / "summary.json").read_text(encoding="utf-8"))
    change(summary)
    (copy / "summary.json").write_text(json.dumps(sealed(summary)), encoding="utf-8")
    return copy


def test_priors_that_change_no_result_are_told(
    run: Callable[..., Any], folders: dict[str, Path], tmp_path: Path
) -> None:
    """Of a file with other priors and the same title it was said that data, options and versions are the same."""

    def narrower(summary: dict[str, Any]) -> None:
        summary["records"][0]["parameters"]["A3"]["prior"]["sd"] *= 0.1

    outcome = run("diff", folders["a"], changed_copy(folders["a"], tmp_path / "narrower", narrower))
    assert outcome.status == 0
    assert "other priors of A3" in outcome.out
    assert "the same data" not in outcome.out
    assert "the same: 2 of 2 records agree" in outcome.out


def test_the_last_digits_of_a_scale_are_no_other_prior(
    run: Callable[..., Any], folders: dict[str, Path], tmp_path: Path
) -> None:
    """Priors of the noise are scaled by a least-squares fit, which ends within a ten-millionth."""

    def nearly(summary: dict[str, Any]) -> None:
        summary["records"][0]["parameters"]["force_sd"]["prior"]["median"] *= 1.0 + 1e-7

    outcome = run("diff", folders["a"], changed_copy(folders["a"], tmp_path / "nearly", nearly))
    assert "the same data, options, priors and versions" in outcome.out


def test_bands_that_are_wider_are_told_where_their_medians_agree(
    run: Callable[..., Any], folders: dict[str, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    both = sma_bayes.diff(folders["a"], folders["b"])
    both["records"][0]["bands"]["force"]["width_ratio"] = 1.6
    monkeypatch.setattr("sma_bayes.studies.diff.workflow.diff", lambda *a, **k: both)
    outcome = run("diff", folders["a"], folders["b"])
    assert outcome.status == 0
    assert "  bands in b: force 1.6 times as wide" in outcome.out


@pytest.mark.parametrize("arguments", [("--tolerance", "0"), ("--tolerance", "nan")])
def test_a_tolerance_that_makes_no_sense(
    run: Callable[..., Any], folders: dict[str, Path], arguments: tuple[str, ...]
) -> None:
    outcome = run("diff", folders["a"], folders["b"], *arguments)
    assert (outcome.status, outcome.out) == (2, "")
    assert "a positive number" in outcome.err


def test_a_folder_without_a_fit(run: Callable[..., Any], folders: dict[str, Path], tmp_path: Path) -> None:
    outcome = run("diff", folders["a"], tmp_path)
    assert (outcome.status, outcome.out) == (2, "")
    assert outcome.err.count("error: ") == 1


@pytest.fixture(scope="module")
def two_units(make_campaign: Callable[..., Path], tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Two fits of a spring whose thermometer is in °F, scale in mm and load in g; the second says mm as cm."""
    place = tmp_path_factory.mktemp("declared")
    for name, load, length in (("a", 100, "mm"), ("b", 150, "cm")):
        changes = (
            ("degC", "degF"),
            ('unit = "mm"', f'unit = "{length}"'),
            ("[[condition]]", f"[[condition]]\nload_g = {load}"),
        )
        bench = make_campaign(place / name, *changes)
        fit_campaign(
            sma_bayes.read_campaign(bench), place / f"out-{name}", noise="independent", jobs=1, figures="none"
        )
    return [place / f"out-{name}" for name in "ab"]


def test_people_see_declared_units_and_programs_canonical_ones(
    run: Callable[..., Any], two_units: list[Path]
) -> None:
    shown = run("diff", *two_units).out
    assert "settings: load 100 g in a, load 150 g in b" in shown
    assert "displacement is declared in mm and cm: shown in mm, which is the first" in shown
    assert "[mm]" in shown
    assert "°C" not in shown
    assert "[m]" not in shown
    stored = json.loads(run("diff", *two_units, "--json").out)
    assert stored == sma_bayes.diff(*two_units)
    assert (
        stored["declared_units"] | {"temperature": "degF", "displacement": "mm", "load": "g"}
        == stored["declared_units"]
    )
    told = sma_bayes.diff(*two_units, declared=True)
    for r, t in zip(stored["records"], told["records"], strict=True):
        assert t["changed"]["settings"] == [{"load": pytest.approx(100)}, {"load": pytest.approx(150)}]
        for name, p in r["parameters"].items():
            assert t["parameters"][name]["shift"] == pytest.approx(p["shift"], rel=1e-9)
        a1, shown_a1 = (d["parameters"]["A1"] for d in (r, t))
        assert (a1["unit"], shown_a1["unit"]) == ("m", "mm")
        assert shown_a1["b"]["median"] == pytest.approx(1000.0 * a1["b"]["median"])
        band, shown_band = (d["bands"]["displacement"] for d in (r, t))
        assert (band["temperature_unit"], shown_band["temperature_unit"]) == ("degC", "degF")
        assert shown_band["at"] == pytest.approx(1.8 * band["at"] + 32.0)
        assert shown_band["difference"] == pytest.approx(1000.0 * band["difference"])
