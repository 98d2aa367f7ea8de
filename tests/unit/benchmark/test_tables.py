"""The tables of the page on performance are those of the rows beside it."""

from __future__ import annotations

from pathlib import Path

import pytest
from benchmark_tables import cell, main

DOCS = Path(__file__).resolve().parents[3] / "docs"


def run(seconds: float, ended: str, claimed: float = float("nan")) -> dict[str, str]:
    return {
        "cpu_s": str(seconds),
        "reached": str(ended == "target"),
        "ended": ended,
        "claimed_s": str(claimed),
    }


def test_a_cell_says_what_became_of_the_runs() -> None:
    done = run(2.0, "target", 2.0)
    assert cell([]) == "not measured"
    assert cell([done, run(4.0, "target", 4.0)]) == "3"
    assert cell([run(30.0, "time")]) == "> 30"
    assert cell([run(30.0, "time", 3.0)]) == "> 30 †"
    assert cell([run(41.0, "killed")]) == "> 41 ‡"
    assert cell([done, done, run(30.0, "time")]) == "> 2 (2 of 3)"


def test_the_page_shows_the_tables_of_its_rows(capsys: pytest.CaptureFixture[str]) -> None:
    main(DOCS / "data")
    printed = [line for line in capsys.readouterr().out.splitlines() if line]
    page = (DOCS / "performance.md").read_text(encoding="utf-8").splitlines()
    assert not set(printed) - set(page), "print them anew: python scripts/benchmark_tables.py docs/data"
