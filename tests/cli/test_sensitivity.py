"""`sma-bayes sensitivity` as a pipeline calls it."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import sma_bayes
from sma_bayes import fit_campaign
from sma_bayes.runs.documents import sealed


@pytest.fixture(scope="module")
def folder(make_campaign: Callable[..., Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("sensitivity")
    campaign = sma_bayes.read_campaign(make_campaign(place / "bench"))
    fit_campaign(campaign, place / "out", noise="independent", jobs=1, figures=False)
    return place / "out"


def test_a_folder_holds_what_is_promised(
    run: Callable[..., Any], folder: Path, published: Callable[[str], Any], tmp_path: Path
) -> None:
    out = tmp_path / "sensitivity"
    outcome = run("sensitivity", folder, "--out", out, "--at", "50 degC", "--jobs", "1", "--json")
    assert outcome.status == 0
    document = json.loads(outcome.out)
    assert document == json.loads((out / "sensitivity.json").read_text(encoding="utf-8"))
    published("sensitivity").validate(document)
    assert [r["key"] for r in document["records"]] == ["a-heating", "a-cooling"]
    (record, _) = document["records"]
    names = [q["name"] for q in record["quantities"]]
    assert {"A1", "B3", "force_sd", "least stiffness", "stiffness at 50 °C", "As", "Af"} <= set(names)
    with (out / "readings" / "a-heating.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 2 * record["n"]
    for quantity in record["quantities"]:
        told = max(rows, key=lambda row: abs(float(row[quantity["name"]])))
        assert int(told["row"]) == quantity["reading"]["row"]
        assert float(told[quantity["name"]]) == pytest.approx(quantity["reading"]["change"], rel=1e-6)
    assert (out / "figures" / "sensitivity-a-heating.png").is_file()
    assert (out / "tables" / "sensitivity.csv").is_file()
    assert document["conclusion"].split(".")[0] in (out / "report.html").read_text(encoding="utf-8")
    again = run("sensitivity", folder, "--out", out, "--at", "50 degC", "--resume", "--json")
    assert json.loads(again.out) == document
    assert run("report", out, "--jobs", "1").status == 0


def test_people_get_a_table_and_a_sentence(run: Callable[..., Any], folder: Path) -> None:
    outcome = run("sensitivity", folder, "--jobs", "1")
    assert outcome.status == 0
    assert "a-heating, 40 readings" in outcome.out
    assert outcome.out.rstrip().endswith("posterior standard deviations.")
    assert run("sensitivity", folder, "--jobs", "1", "--quiet").out == ""


def test_the_same_seed_gives_the_same(folder: Path) -> None:
    one, other = (sma_bayes.sensitivity(folder, seed=3, jobs=1) for _ in range(2))
    assert one["records"] == other["records"]


def test_a_fit_in_memory_tells_the_same(
    make_campaign: Callable[..., Path], folder: Path, tmp_path: Path
) -> None:
    campaign = sma_bayes.read_campaign(make_campaign(tmp_path / "bench"))
    fits = sma_bayes.fit(campaign, noise="independent", jobs=1)
    stored, held = sma_bayes.sensitivity(folder, jobs=1), fits.sensitivity(jobs=1)
    for one, other in zip(stored["records"], held["records"], strict=True):
        for a, b in zip(one["quantities"], other["quantities"], strict=True):
            assert a["name"] == b["name"]
            assert a["prior"] == pytest.approx(b["prior"], rel=1e-6, abs=1e-9)
            assert a["reading"]["row"] == b["reading"]["row"]


def test_a_fit_that_did_not_converge_ends_with_1(
    run: Callable[..., Any], folder: Path, tmp_path: Path
) -> None:
    copy = tmp_path / "copy"
    copy.mkdir()
    for name in ("posterior", "bands"):
        (copy / name).symlink_to(folder / name)
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    summary["records"][0]["converged"] = False
    (copy / "summary.json").write_text(json.dumps(sealed(summary)), encoding="utf-8")
    outcome = run("sensitivity", copy, "--jobs", "1")
    assert outcome.status == 1
    assert "NOT CONVERGED" in outcome.out


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (("--at", "60"), "has no unit"),
        (("--at", "60 N"), "wrong kind"),
        (("--at", "300 degC"), "30 to 70 degC (a-heating)"),
        (("--figures", "some"), "no choice of figures"),
    ],
)
def test_bad_calls_end_with_2_and_write_nothing(
    run: Callable[..., Any], folder: Path, tmp_path: Path, arguments: tuple[str, ...], told: str
) -> None:
    out = tmp_path / "out"
    outcome = run("sensitivity", folder, "--out", out, *arguments)
    assert outcome.status == 2
    assert told in outcome.err
    assert not out.exists()


def test_a_folder_without_a_fit_is_refused(run: Callable[..., Any], folder: Path, tmp_path: Path) -> None:
    assert "holds no run" in run("sensitivity", tmp_path).err
    out = tmp_path / "out"
    assert run("sensitivity", folder, "--out", out, "--no-figures", "--jobs", "1", "-q").status == 0
    assert "holds a study of sensitivity, no fit" in run("sensitivity", out).err
    outcome = run("sensitivity", folder, "--out", out, "--at", "50 degC")
    assert outcome.status == 2
    (out / "readings" / "a-heating.csv").write_text("row\n1\n", encoding="utf-8")
    assert "readings/a-heating.csv" in run("report", out).err
