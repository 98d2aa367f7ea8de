"""`simulate.json` and its bands as tools outside the project read them: names and kinds are fixed."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import sma_bayes


@pytest.fixture(scope="module")
def folder(heated_fit: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("simulation") / "out"
    profile = {"time_s": [0.0, 12.0, 24.0, 60.0], "current_A": [1.1, 0.6, 0.9, 0.0]}
    sma_bayes.simulate(heated_fit, profile, out, reach="stiffness=180 N/m", draws=60, figures=False)
    return out


@pytest.fixture(scope="module")
def found(folder: Path) -> Any:
    def refuse(word: str) -> None:
        raise AssertionError(f"{word} is not JSON")

    return json.loads((folder / "simulate.json").read_text(encoding="utf-8"), parse_constant=refuse)


def test_the_published_schema_takes_it(found: Any, published: Callable[[str], Any]) -> None:
    published("simulate").validate(found)
    assert found["schema"] == "sma-bayes/simulation/1"


def test_there_is_a_run_for_each_condition_and_start_with_its_bands(found: Any, folder: Path) -> None:
    assert [(r["condition"], r["start"]) for r in found["runs"]] == [
        (c, s) for c in ("1.0A", "1.2A") for s in ("cold", "hot")
    ]
    assert set(found["files_sha256"]) == {r["file"] for r in found["runs"]}
    quantiles = ("q05", "q50", "q95", "pred_q05", "pred_q95")
    for r in found["runs"]:
        assert set(r["end"]) == {"temperature", "force", "displacement", "stiffness"}
        with (folder / r["file"]).open(encoding="utf-8") as file:
            header, *rows = csv.reader(file)
        assert r["declared_units"] == {
            "temperature": "degC", "force": "N", "displacement": "mm", "stiffness": "N/mm"
        }  # fmt: skip
        told = [f"{c}_{q} [{r['units'][c]}]" for c in r["units"] for q in quantiles]
        assert header == ["time_s", "current_A", *told, "on_heating_branch", "share_extrapolated"]
        assert (float(rows[0][0]), float(rows[-1][0])) == (0.0, 60.0)
        assert float(rows[-1][header.index("force_q50 [N]")]) == pytest.approx(
            r["end"]["force"]["median"], rel=1e-6
        )


def test_intervals_are_ordered_and_shares_are_shares(found: Any) -> None:
    for p in found["balance"]["parameters"].values():
        assert p["q05"] <= p["median"] <= p["q95"]
    for c in found["reach"]["conditions"]:
        assert 0.0 <= c["reachable"] <= 1.0
        assert c["bounds"] == pytest.approx([171.0, 189.0])
        for p in c["passages"]:
            assert 0.0 < p["q05"] <= p["median"] <= p["q95"] <= c["searched"]
