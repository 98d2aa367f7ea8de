"""`comparison.json` as tools outside the project read it: names and kinds are fixed."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import sma_bayes
from sma_bayes.records.types import Branch, Campaign, Record
from sma_bayes.studies.compare.contenders import contenders
from sma_bayes.studies.report.build import build_report

NUMBERS = (
    "elpd", "elpd_se", "p_eff", "ln_evidence", "ln_evidence_sd", "weight", "rmse_held_out", "r_held_out",
    "pareto_k_max",
)  # fmt: skip


@pytest.fixture(scope="module")
def folder(make_record: Callable[..., Record], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A comparison of two branches of stiffness, written with its report."""
    records = tuple(
        make_record(("stiffness",), n=40, noise=0.03, seed=i, branch=branch, A2=0.25, B2=0.45)
        for i, branch in enumerate(Branch)
    )
    out = tmp_path_factory.mktemp("comparison") / "out"
    sma_bayes.compare(Campaign("spring", "spring", "0" * 64, records), out, jobs=1, noise="independent")
    return out


@pytest.fixture
def found(folder: Path) -> Any:
    def refuse(word: str) -> None:
        raise AssertionError(f"{word} is not JSON")

    return json.loads((folder / "comparison.json").read_text(encoding="utf-8"), parse_constant=refuse)


def test_names_and_kinds_are_those_of_the_contract(found: Any) -> None:
    assert found["schema"] == "sma-bayes/comparison/1"
    assert [r["branch"] for r in found["records"]] == ["heating", "cooling"]
    for record in found["records"]:
        assert set(record["models"]) == {c.name for c in contenders()}
        assert record["preferred"] in record["models"]
        assert isinstance(record["decisive"], bool)
        assert (record["verdict"] == "cannot tell") == (not record["decisive"])
        for model in record["models"].values():
            assert model["unavailable"] is None
            for name in NUMBERS:
                assert isinstance(model[name], float | int), name
        assert sum(m["weight"] for m in record["models"].values()) == pytest.approx(1.0)


def test_the_published_schema_takes_it(found: Any, published: Callable[[str], Any]) -> None:
    published("compare").validate(found)
    del found["records"][0]["models"]["modified_sigmoid"]["elpd"]
    assert not published("compare").is_valid(found)


def test_each_baseline_is_there_in_each_variant(found: Any) -> None:
    for record in found["records"]:
        variants = {(m["family"], m["variant"]) for m in record["models"].values()}
        for family in ("logistic", "polynomial"):
            assert {(family, v) for v in ("published", "corrected", "refitted")} <= variants


def test_the_parts_agree_with_each_other(found: Any, folder: Path) -> None:
    for record in found["records"]:
        models = record["models"]
        voting = [n for n in models if n != "modified_sigmoid_tied"]
        assert models[record["preferred"]]["ln_evidence"] == max(models[n]["ln_evidence"] for n in voting)
        samples = np.genfromtxt(folder / "samples" / f"{record['key']}.csv", delimiter=",", names=True)
        for name, m in models.items():
            assert m["evidences_agree"]
            assert sum(m["elpd_by_fold"]) == pytest.approx(m["elpd_held_out"])
            if m["same_as"]:
                assert m["ln_evidence"] == models[m["same_as"]]["ln_evidence"]
                assert m["weight"] == 0.0
                continue
            left = samples["measured"] - samples[f"{name}_held_out"]
            assert np.sqrt(np.mean(left**2)) == pytest.approx(m["rmse_held_out"], rel=1e-6)
            assert samples[f"{name}_loo"].sum() / record["memory"] == pytest.approx(m["elpd"], rel=1e-6)
        assert {"logistic_refitted", "bounded_logistic"} in [set(c) for c in record["same_curve"]]


def test_correlation_factors_are_told_in_sample_and_held_out(found: Any) -> None:
    for record in found["records"]:
        for name, m in record["models"].items():
            c = m["correlation"]
            # with the centre as printed the logistic is flat, at its upper level, wherever springs are heated
            flat = name == "logistic_published" and record["branch"] == "heating"
            for part in ("in_sample", "held_out"):
                for factor in ("r", "r2", "rmse"):
                    q = c[part][factor]
                    assert q["undefined"] == (1.0 if flat and (part, factor) == ("in_sample", "r") else 0.0)
                    if q["undefined"] == 1.0:
                        assert q["median"] is None
                        continue
                    assert q["q05"] <= q["median"] <= q["q95"]
            assert "adj_r2" in c["in_sample"]
            assert "adj_r2" not in c["held_out"]
            assert len(c["by_fold"]) == len(record["held_out"]["folds"])
            negative = sum(f["r2"]["median"] < 0.0 for f in c["by_fold"])
            assert c["folds_worse_than_their_mean"] == negative
            # draws scatter about their mean, so the greater part of them misses by more than the mean does
            assert c["held_out"]["rmse"]["q95"] >= m["rmse_held_out"] * (1.0 - 1e-12)
    average = found["overall"][0]["models"]["modified_sigmoid"]["correlation_average"]
    assert [e["branch"] for e in average["held_out"]] == ["heating", "cooling", ""]
    for rule in ("plain", "fisher", "pooled"):
        assert average["in_sample"][-1]["r"][rule]["above"] == 1.0


def test_the_modified_sigmoid_wins_on_data_that_it_made(found: Any) -> None:
    assert found["overall"][0]["verdict"] == "modified_sigmoid"
    assert found["overall"][0]["preferred"] == "modified_sigmoid"


def test_figures_tables_and_report_are_there_and_can_be_made_again(folder: Path) -> None:
    names = {p.name for p in folder.rglob("*") if p.is_file()}
    assert {
        "held-out.pdf",
        "held-out.csv",
        "models.tex",
        "models.csv",
        "verdicts.csv",
        "correlation.csv",
        "correlation_average.tex",
        "correlation-average.pdf",
        "report.html",
    } <= names
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert "the modified sigmoid wins" in page
    (folder / "report.html").unlink()
    build_report(folder, jobs=1)
    assert (folder / "report.html").read_text(encoding="utf-8") == page
