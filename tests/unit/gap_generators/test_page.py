"""The page on the benchmark says what its rows say."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from benchmark_gap import measured, read, with_tables
from gap_benchmark.trials import outcome_of

DOCS = Path(__file__).resolve().parents[3] / "docs"


def test_the_tables_of_the_page_are_made_from_the_rows() -> None:
    text = (DOCS / "gap_benchmark.md").read_text(encoding="utf-8")
    rows = read(DOCS / "data" / "gap.csv")
    assert rows
    assert with_tables(text, rows) == text


def test_a_campaign_counts_once_by_the_newest_engine(tmp_path: Path) -> None:
    header, *lines = (DOCS / "data" / "gap.csv").read_text(encoding="utf-8").splitlines()
    (engine,) = {r["engine"] for r in read(DOCS / "data" / "gap.csv")[:1]}
    again = lines[0].replace(f",{engine},", ",newest,")
    (tmp_path / "gap.csv").write_text("\n".join([header, *lines, again]) + "\n", encoding="utf-8")
    found = read(tmp_path / "gap.csv")
    assert len(found) == len(lines)
    assert [r["engine"] for r in found].count("newest") == 1


def test_a_rate_is_reached_or_missed_only_where_there_are_enough_campaigns() -> None:
    def met(named: int, n: int) -> str:
        rows = [
            {"suite": "null", "curve": "sigmoid", "outcome": "confident" if i < named else "none"}
            for i in range(n)
        ]
        return next(iter(measured(rows)))[3]

    assert met(0, 20) == "open"  # the interval reaches up to 17 %
    assert met(0, 1000) == met(8, 1000) == "yes"
    assert met(3, 20) == met(30, 1000) == "**no**"


@pytest.mark.parametrize(
    ("verdict", "only_shape", "hidden", "outcome"),
    [
        ("unnamed", True, "asymmetric_kinetics", "shape"),
        ("unnamed", False, "asymmetric_kinetics", "unnamed"),
        ("none", True, "asymmetric_kinetics", "none"),
        ("unnamed", True, "bias_spring", "unnamed"),
    ],
)
def test_a_shape_is_the_answer_only_where_a_bent_curve_was_hidden(
    verdict: str, only_shape: bool, hidden: str, outcome: str
) -> None:
    study: Any = SimpleNamespace(verdict=verdict, steps=[SimpleNamespace(only_shape=only_shape)])
    assert outcome_of(study, [hidden]) == outcome
    assert outcome_of(study, [hidden, "r_phase"]) == verdict


@pytest.mark.parametrize(
    ("named", "only_shape", "beside", "outcome"),
    [
        ("dead_load", True, "dead_load", "shape"),
        ("dead_load", False, "dead_load", "part"),
        ("dead_load", True, "r_phase", "confident"),
    ],
)
def test_a_bent_curve_beside_a_name_may_be_told_as_a_shape(
    named: str, only_shape: bool, beside: str, outcome: str
) -> None:
    steps = [SimpleNamespace(only_shape=only_shape)]
    study: Any = SimpleNamespace(
        verdict="named",
        steps=steps,
        classes={named: (named,)},
        effects=(),
        named=(SimpleNamespace(id=named),),
    )
    assert outcome_of(study, ["asymmetric_kinetics", beside]) == outcome
    assert outcome_of(study, [beside, "bias_spring"]) == ("confident" if named != beside else "part")
