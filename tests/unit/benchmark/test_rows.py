"""Rows are added to what was measured before, or take its place."""

from __future__ import annotations

from dataclasses import fields, replace
from pathlib import Path

from benchmark.rows import Row, add_row, read_rows

BLANK = {"str": "", "int": 0, "float": 0.5, "bool": True}


def row(session: str, sampler: str, repeat: int = 0) -> Row:
    blank = Row(**{f.name: BLANK[str(f.type)] for f in fields(Row)})
    return replace(blank, session=session, sampler=sampler, repeat=repeat, record="1A-10mHz-heating")


def test_rows_are_added_and_read_back(tmp_path: Path) -> None:
    path = tmp_path / "rows.csv"
    rows = [row("first", "emcee"), row("first", "zeus"), row("second", "zeus")]
    for each in rows:
        add_row(path, each, replace=False)
    assert read_rows(path) == rows
    assert list(tmp_path.iterdir()) == [path]


def test_a_sampler_measured_again_takes_the_place_of_its_own_earlier_rows_only(tmp_path: Path) -> None:
    path = tmp_path / "rows.csv"
    kept = [
        row("first", "emcee"),
        replace(row("first", "zeus"), kind="cold"),
        replace(row("first", "zeus"), record="x"),
    ]
    for each in [row("first", "zeus"), *kept]:
        add_row(path, each, replace=False)
    again = [row("second", "zeus", repeat) for repeat in range(2)]
    for each in again:
        add_row(path, each, replace=True)
    assert read_rows(path) == [*kept, *again]
