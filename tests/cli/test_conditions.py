"""`sma-bayes conditions` as a pipeline sees it."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from jsonschema import Draft202012Validator

from sma_bayes import fit_campaign
from sma_bayes.records.types import Campaign, Condition, Record
from sma_bayes.studies.conditions.schema import ConditionsDocument


@pytest.fixture(scope="module")
def fitted(tmp_path_factory: pytest.TempPathFactory, make_record: Callable[..., Record]) -> Path:
    """A finished fit of four conditions whose midpoint follows the load; one of them stands apart."""
    loads = (1.0, 2.0, 3.0, 4.0)
    records = [
        replace(
            make_record(("displacement",), n=40, seed=i, A3=44.0 + 2.0 * w),
            condition=Condition(f"{w:g}N", load=w),
        )
        for i, w in enumerate(loads)
    ]
    alone = replace(make_record(("displacement",), n=40), condition=Condition("odd", current=2.0))
    folder = tmp_path_factory.mktemp("conditions") / "fit"
    fit_campaign(
        Campaign("bench", "made up", "0", (*records, alone)),
        folder,
        noise="independent",
        jobs=1,
        figures="none",
    )
    return folder


@pytest.fixture(scope="module")
def done(fitted: Path) -> tuple[Path, dict[str, Any]]:
    """A study of it, with a report."""
    from sma_bayes import study_conditions

    out = fitted.parent / "out"
    found = study_conditions(fitted, out, at=["load_N=2.5", "load_N=5"], leave_out=["2N", "4N"], jobs=1)
    return out, found


def test_from_a_fit_to_predictions(done: tuple[Path, dict[str, Any]]) -> None:
    out, found = done
    stored = json.loads((out / "conditions.json").read_text(encoding="utf-8"))
    assert stored == json.loads(json.dumps(found))
    assert stored["schema"] == "sma-bayes/conditions/1"
    assert [g["conditions"] for g in stored["groups"]] == [["1N", "2N", "3N", "4N"], ["odd"]]
    inside, outside = stored["predictions"]
    assert (inside["condition"], inside["extrapolates"], inside["prior_led"]) == ("2.5N", [], True)
    assert outside["extrapolates"] == ["load"]
    (midpoint,) = inside["features"]
    assert midpoint["q05"] < 49.0 < midpoint["q95"]
    wide, narrow = (p["features"][0]["q95"] - p["features"][0]["q05"] for p in (outside, inside))
    assert wide > narrow
    assert [(h["condition"], h["extrapolates"], sorted(h["ways"])) for h in stored["held_out"]] == [
        ("2N", [], ["curves by hand", "hierarchical", "parameters by hand"]),
        ("4N", ["load"], ["hierarchical"]),
    ]
    assert stored["held_out"][0]["ways"]["hierarchical"]["covers_curve"] > 0.9
    effect = next(e for e in stored["effects"] if e["feature"] == "midpoint")
    assert effect["tested"]["median"] == pytest.approx(6.0, abs=0.3)
    assert effect["beyond"]["q05"] > 0.0
    assert any("odd" in text and "no other condition to be" in text for text in stored["remarks"])
    assert any("an extrapolation (load beyond" in text for text in stored["cautions"])


def test_the_published_schema_takes_it(
    done: tuple[Path, dict[str, Any]], published: Callable[[str], Draft202012Validator]
) -> None:
    stored = json.loads((done[0] / "conditions.json").read_text(encoding="utf-8"))
    published("conditions").validate(stored)
    assert ConditionsDocument.model_validate(stored).as_json() == stored
    del stored["effects"][0]["from"]
    assert not published("conditions").is_valid(stored)


def test_files_hold_what_the_reference_says(done: tuple[Path, dict[str, Any]]) -> None:
    out, _ = done
    with (out / "bands" / "2.5N-heating-displacement.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 161
    assert all(float(r["q05"]) <= float(r["q50"]) <= float(r["q95"]) for r in rows)
    with (out / "held_out" / "2N-heating-displacement.csv").open(encoding="utf-8") as file:
        columns = csv.DictReader(file).fieldnames or []
    for name in (
        "own_median",
        "hierarchical_q05",
        "curves_by_hand_q50",
        "parameters_by_hand_q95",
        "new_measurement_q95",
    ):
        assert name in columns
    with (out / "held_out" / "2N-heating-displacement-samples.csv").open(encoding="utf-8") as file:
        assert len(list(csv.DictReader(file))) == 40
    for stem in ("measured", "effects-load", "predicted-2.5N", "predicted-5N", "held-out-2N", "held-out-4N"):
        for suffix in (".png", ".pdf", ".csv"):
            assert (out / "figures" / f"{stem}{suffix}").is_file(), stem
    for name in ("design", "features", "effects", "scatter", "predictions", "held_out", "pooled"):
        assert (out / "tables" / f"{name}.tex").is_file(), name
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "extrapolates: load" in page
    assert "--at &#34;load_N=2.5&#34;" in page


def test_shares_of_a_transformation_that_is_over_are_not_in_the_table(
    done: tuple[Path, dict[str, Any]],
) -> None:
    out, found = done
    shares = [f["median"] for f in found["features"] if f["name"] == "share_left"]
    assert shares
    assert max(shares) < 0.01
    with (out / "tables" / "features.csv").open(encoding="utf-8") as file:
        told = {row["feature"] for row in csv.DictReader(file)}
    assert "midpoint" in told
    assert "share left at the hottest" not in told


def test_the_same_call_resumes_and_another_is_refused(
    run: Callable[..., Any], fitted: Path, done: tuple[Path, dict[str, Any]]
) -> None:
    out, found = done
    call = ("conditions", fitted, "--out", out, "--at", "load_N=2.5", "--at", "load_N=5", "--leave-out", "2N",
            "--leave-out", "4N", "--jobs", 1)  # fmt: skip
    again = run(*call)
    assert again.status == 2
    assert "holds this run already" in again.err
    resumed = run(*call, "--resume", "--json")
    assert resumed.status == 0, resumed.err
    assert json.loads(resumed.out)["predictions"] == json.loads(json.dumps(found["predictions"]))
    other = run(*call, "--resume", "--scatter", 0.3)
    assert other.status == 2
    assert "differs in scatter" in other.err


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--at", "lod_N=2"), "did you mean 'load_N'"),
        (("--at", "load_N"), "is no setting"),
        (("--at", "load_N=two"), "'two' is no number"),
        (("--at", "load_N=1,load_N=2"), "load_N is given twice"),
        (("--at", "load_N=-1"), "greater than or equal to 0"),
        (("--at", "load_N=1,load_g=100"), "one of load_g, load_N"),
        (("--at", "stress_MPa=100"), "load_g or load_N"),
        (("--at", "current_A=2"), "state current in campaign.toml"),
        (("--at", "load_N=2,current_A=2"), "no value of it is stated"),
        (("--leave-out", "2 N"), "did you mean '2N'"),
        (("--leave-out", "odd"), "no condition 'odd' that others could predict"),
        (("--scatter", "0"), "a positive number"),
    ],
)
def test_a_wrong_call_is_refused_before_anything_is_written(
    run: Callable[..., Any], fitted: Path, tmp_path: Path, arguments: tuple[str, str], said: str
) -> None:
    found = run("conditions", fitted, "--out", tmp_path / "out", *arguments)
    assert found.status == 2
    assert said in found.err
    assert not (tmp_path / "out").exists()


def test_a_folder_without_a_fit_is_refused(
    run: Callable[..., Any], done: tuple[Path, dict[str, Any]], tmp_path: Path
) -> None:
    out, _ = done
    found = run("conditions", out, "--out", tmp_path / "out")
    assert found.status == 2
    assert "holds a study of conditions, no fit" in found.err
    missing = run("conditions", tmp_path / "nowhere", "--out", tmp_path / "out")
    assert missing.status == 2
    assert "is not a folder" in missing.err


def test_a_damaged_series_is_named(
    fitted: Path, done: tuple[Path, dict[str, Any]], run: Callable[..., Any]
) -> None:
    out, _ = done
    path = out / "curves" / "1N-heating-displacement.csv"
    whole = path.read_text(encoding="utf-8")
    path.write_text(whole.replace(whole.splitlines()[1], "cold,1,2,3"), encoding="utf-8")
    found = run("report", out, "--jobs", 1)
    path.write_text(whole, encoding="utf-8")
    assert found.status == 2
    assert "1N-heating-displacement.csv" in found.err


def test_draws_of_a_prediction_are_those_of_a_new_run(fitted: Path) -> None:
    from sma_bayes import study_conditions

    one, two = (study_conditions(fitted, at=["load_N=2.5"], jobs=1, seed=s) for s in (0, 1))
    medians = [f["predictions"][0]["features"][0]["median"] for f in (one, two)]
    assert medians[0] != medians[1]
    assert np.isclose(*medians, atol=0.2)
