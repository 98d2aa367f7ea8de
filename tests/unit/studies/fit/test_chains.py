"""Chains go once all is told, but for those that cost much."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from sma_bayes.records.types import Branch, Condition, Record
from sma_bayes.studies.fit.chains import COSTLY_EVALUATIONS, chain_path, remove_chains


def record(condition: str, branch: Branch = Branch.HEATING) -> Record:
    t = np.linspace(20.0, 90.0, 5)
    return Record(
        Condition(condition), branch, {"temperature": t}, {"force": t}, np.arange(5), {"force": "N"}
    )


def chains(folder: Path, *records: Record) -> Path:
    """An empty file where a sampler puts chains: names of the noise model and of a factor are added."""
    path = chain_path(folder, records)
    path.parent.mkdir(exist_ok=True)
    path.with_stem(f"{path.stem}-ar1-force").touch()
    return path.with_stem(f"{path.stem}-ar1-force")


def test_chains_that_are_soon_made_again_go_with_their_folder(tmp_path: Path) -> None:
    one, other = record("a"), record("a", Branch.COOLING)
    chains(tmp_path, one)
    chains(tmp_path, other)
    remove_chains(tmp_path, [(one,), (other,)], {"a-heating": COSTLY_EVALUATIONS, "a-cooling": 1})
    assert list(tmp_path.iterdir()) == []


def test_costly_chains_stay_and_those_of_another_name_that_begins_alike_go(tmp_path: Path) -> None:
    cheap, costly = record("a-heating-b"), record("a")
    chains(tmp_path, cheap)
    kept = chains(tmp_path, costly)
    remove_chains(
        tmp_path, [(costly,), (cheap,)], {"a-heating": COSTLY_EVALUATIONS + 1, "a-heating-b-heating": 1}
    )
    assert list(kept.parent.iterdir()) == [kept]


def test_cheap_chains_go_and_costly_ones_of_another_name_that_begins_alike_stay(tmp_path: Path) -> None:
    cheap, costly = record("a"), record("a-heating-b")
    chains(tmp_path, cheap)
    kept = chains(tmp_path, costly)
    remove_chains(
        tmp_path, [(cheap,), (costly,)], {"a-heating": 1, "a-heating-b-heating": COSTLY_EVALUATIONS + 1}
    )
    assert list(kept.parent.iterdir()) == [kept]


def test_chains_that_records_share(tmp_path: Path) -> None:
    heating, cooling = ([record(c, b) for c in "ab"] for b in (Branch.HEATING, Branch.COOLING))
    chains(tmp_path, *heating)
    kept = chains(tmp_path, *cooling)
    taken = {r.key: 1 for r in heating} | {r.key: COSTLY_EVALUATIONS + 1 for r in cooling}
    remove_chains(tmp_path, [heating, cooling], taken)
    assert list(kept.parent.iterdir()) == [kept]


def test_files_of_others_stay(tmp_path: Path) -> None:
    chains(tmp_path, record("a"))
    note = tmp_path / "checkpoints" / "note.txt"
    note.touch()
    remove_chains(tmp_path, [(record("a"),)], {"a-heating": 1})
    assert list(note.parent.iterdir()) == [note]
