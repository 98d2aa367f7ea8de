"""The page that reproduces the paper is what the package writes, and its numbers are those of a fresh run."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from sma_bayes.paper.correlation import implied_average
from sma_bayes.paper.errata import PRINTED_TABLES
from sma_bayes.paper.extremes import EXTREME_TABLES
from sma_bayes.studies.paper.build import NUMBERS, PAGE
from sma_bayes.studies.paper.claims import claims
from sma_bayes.studies.paper.distance import distances
from sma_bayes.studies.paper.document import SCHEMA
from sma_bayes.studies.paper.page import PICTURES, page
from sma_bayes.studies.paper.printed import printed_effects
from sma_bayes.studies.paper.study import study_twin
from sma_bayes.studies.paper.tables import table_rows

DOCS = Path(__file__).resolve().parents[2] / "docs"
AGAIN = "write it anew: sma-bayes paper --page docs"
CONDITION = "100g-10mHz"


@pytest.fixture(scope="module")
def found() -> Any:
    return json.loads((DOCS / NUMBERS).read_text(encoding="utf-8"))


def test_the_page_is_what_its_numbers_give(found: Any) -> None:
    assert (DOCS / PAGE).read_text(encoding="utf-8") == page(found), AGAIN


def test_every_picture_is_there_and_small() -> None:
    text = (DOCS / PAGE).read_text(encoding="utf-8")
    shown = set(re.findall(rf"\({PICTURES}/(.+?\.png)\)", text))
    files = {p.name: p.stat().st_size for p in (DOCS / PICTURES).iterdir()}
    assert shown == set(files)
    assert max(files.values()) < 150_000
    assert sum(files.values()) < 2_000_000


def test_what_needs_no_fit_is_up_to_date(found: Any) -> None:
    assert found["schema"] == SCHEMA
    assert found["implied_correlation"]["plain"] == pytest.approx(implied_average().plain), AGAIN
    for written, d in zip(found["distances"], distances(), strict=True):
        assert (written["condition"], written["branch"]) == (d.condition, d.branch)
        assert written["logistic"] == pytest.approx(d.logistic, rel=1e-3, abs=1e-6), AGAIN
        assert written["line"] == pytest.approx(d.line), AGAIN
    for table in EXTREME_TABLES:
        effects = printed_effects(table)
        for e in found["printed_effects"][str(table.number)]:
            fresh = effects[e["feature"]]
            # 4000 draws: the standard error of a probability is at most 0.008
            assert e["probability_rises"] == pytest.approx(fresh.probability_rises, abs=0.04), AGAIN
    for table in PRINTED_TABLES:
        if table.number:
            rows = [r for r in found["tables"][str(table.number)] if r["line"] is not None]
            assert [r["line"] for r in rows] == [c.line for c in table.cells], AGAIN
            assert [r["printed"] for r in rows] == [c.entry or c.printed for c in table.cells], AGAIN


def test_circular_evidence_decides_nothing(found: Any) -> None:
    for c in found["claims"]:
        counted = [e["probability"] for e in c["evidence"] if e["counts"] and e["probability"] is not None]
        error = min(1.0 - min(counted), max(counted)) if counted else 1.0
        sure = error <= c["allowed_error"] and not c["confounded"] and not c["lost"]
        assert sure == (c["verdict"] in ("holds", "does not hold"))


def test_what_the_page_calls_lost_or_confounded_has_no_verdict(found: Any) -> None:
    lost = {c["id"] for c in found["claims"] if c["lost"]}
    assert lost == {
        "stiffness-rises-with-frequency", "temperature-matters-most", "modulus-hardly-varies-with-frequency",
    }  # fmt: skip
    confounded = {c["id"] for c in found["claims"] if c["confounded"]}
    assert {"stiffness-rises-with-current", "change-of-stiffness-rises-with-current"} <= confounded
    for c in found["claims"]:
        if c["id"] in lost | confounded:
            assert c["verdict"] == "cannot tell from these numbers"


@pytest.mark.slow
def test_its_numbers_are_those_of_fresh_fits(found: Any) -> None:
    """Two records of one condition, and all evidence from what is printed.

    Seeds are fixed, so that the same versions give the same numbers; medians of 2000 draws may move by a tenth of the
    posterior standard deviation with others.
    """
    study = study_twin(only=[CONDITION], jobs=1)
    fresh = table_rows(study)
    told = 0
    for number in ("3", "4", "5", "6", "7", "8", "10"):
        old = {_place(r): r for r in found["tables"][number]}
        for row in (r for r in fresh[number] if r["condition"] == CONDITION and r["recomputed"]):
            told += 1
            _agree(old[_place(row)]["recomputed"], row["recomputed"])
    assert told == 2 * 7 + 2 * 5 + 2
    records = {(r["condition"], r["branch"]): r for r in found["comparison"]["records"]}
    for r in study.comparison.found.records:
        old_record = records[r.condition, r.branch]
        assert r.verdict == old_record["verdict"]
        assert r.ln_bayes_factor == pytest.approx(old_record["ln_bayes_factor"], abs=0.5)
    printed = {c["id"]: _printed(c) for c in found["claims"]}
    for c in (c.document() for c in claims(study)):
        assert _printed(c) == pytest.approx(printed[c["id"]], abs=0.04), c["id"]


def _place(row: Mapping[str, Any]) -> tuple[str, str, str]:
    return row["condition"], row["branch"], row["quantity"]


def _agree(old: Mapping[str, float], new: Mapping[str, float]) -> None:
    if "value" in old:
        assert new["value"] == pytest.approx(old["value"], rel=1e-3)
        return
    sd = (old["q95"] - old["q05"]) / 3.29
    assert new["median"] == pytest.approx(old["median"], abs=0.15 * sd)
    assert new["q05"] == pytest.approx(old["q05"], abs=0.3 * sd)


def _printed(c: Mapping[str, Any]) -> list[float]:
    return [
        e["probability"] for e in c["evidence"] if e["source"] == "printed" and e["probability"] is not None
    ]
