"""The page that reproduces the paper is what the package writes, and its numbers are those of a fresh run."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from sma_bayes.paper.correlation import implied_average
from sma_bayes.paper.errata import PRINTED_TABLES
from sma_bayes.paper.extremes import EXTREME_TABLES
from sma_bayes.runs.schema import DocumentPart, IntervalDocument
from sma_bayes.runs.store import write_json
from sma_bayes.studies.paper.build import NUMBERS, PAGE
from sma_bayes.studies.paper.claims import claims
from sma_bayes.studies.paper.distance import distances
from sma_bayes.studies.paper.page import PICTURES, page
from sma_bayes.studies.paper.printed import printed_effects
from sma_bayes.studies.paper.schema import JudgedClaim, RecomputedValue, ReproducedEntry, ReproductionDocument
from sma_bayes.studies.paper.tables import table_entries
from sma_bayes.studies.paper.twin_study import study_twin

DOCS = Path(__file__).resolve().parents[2] / "docs"
AGAIN = "write it anew: sma-bayes paper --page docs"
CONDITION = "100g-10mHz"


@pytest.fixture(scope="module")
def found() -> ReproductionDocument:
    return ReproductionDocument.model_validate_json((DOCS / NUMBERS).read_text(encoding="utf-8"))


def test_the_page_is_what_its_numbers_give(found: ReproductionDocument) -> None:
    assert (DOCS / PAGE).read_text(encoding="utf-8") == page(found), AGAIN


def test_the_numbers_are_written_as_they_are_declared(found: ReproductionDocument, tmp_path: Path) -> None:
    write_json(tmp_path / "paper.json", found.as_json())
    assert (tmp_path / "paper.json").read_bytes() == (DOCS / NUMBERS).read_bytes(), AGAIN
    assert all(not part.model_extra for part in _parts(found)), "a key that is not declared"


def _parts(value: object) -> Iterator[DocumentPart]:
    """The document and all of its parts."""
    if isinstance(value, DocumentPart):
        yield value
        value = dict(value)
    inside = value.values() if isinstance(value, dict) else value if isinstance(value, tuple) else ()
    for one in inside:
        yield from _parts(one)


def test_units_and_negative_numbers_are_written_for_people(found: ReproductionDocument) -> None:
    text = page(found)
    assert "8.000 × 10⁻⁷ Ω · m" in text
    assert "8.327 × 10⁻⁸ m³" in text
    assert "centre is at −3.3 °C" in text
    assert "degC" not in text


def test_every_picture_is_there_and_small() -> None:
    text = (DOCS / PAGE).read_text(encoding="utf-8")
    shown = set(re.findall(rf"\({PICTURES}/(.+?\.png)\)", text))
    files = {p.name: p.stat().st_size for p in (DOCS / PICTURES).iterdir()}
    assert shown == set(files)
    assert max(files.values()) < 150_000
    assert sum(files.values()) < 2_000_000


def test_what_needs_no_fit_is_up_to_date(found: ReproductionDocument) -> None:
    assert found.implied_correlation.plain == pytest.approx(implied_average().plain), AGAIN
    for written, d in zip(found.distances, distances(), strict=True):
        assert (written.condition, written.branch) == (d.condition, d.branch)
        assert written.logistic == pytest.approx(d.logistic, rel=1e-3, abs=1e-6), AGAIN
        assert written.line == pytest.approx(d.line), AGAIN
    for table in EXTREME_TABLES:
        effects = printed_effects(table)
        for e in found.printed_effects[str(table.number)]:
            fresh = effects[e.feature]
            # 4000 draws: the standard error of a probability is at most 0.008
            assert e.probability_rises == pytest.approx(fresh.probability_rises, abs=0.04), AGAIN
    for table in PRINTED_TABLES:
        if table.number:
            entries = [e for e in found.rows(table.number) if e.line is not None]
            assert [e.line for e in entries] == [c.line for c in table.cells], AGAIN
            assert [e.printed for e in entries] == [c.entry or c.printed for c in table.cells], AGAIN


def test_circular_evidence_decides_nothing(found: ReproductionDocument) -> None:
    for c in found.claims:
        counted = [e.probability for e in c.evidence if e.counts and e.probability is not None]
        error = min(1.0 - min(counted), max(counted)) if counted else 1.0
        sure = error <= c.allowed_error and not c.confounded and not c.lost
        assert sure == (c.verdict in ("holds", "does not hold"))


def test_what_the_page_calls_lost_or_confounded_has_no_verdict(found: ReproductionDocument) -> None:
    lost = {c.id for c in found.claims if c.lost}
    assert lost == {
        "stiffness-rises-with-frequency", "temperature-matters-most", "modulus-hardly-varies-with-frequency",
    }  # fmt: skip
    confounded = {c.id for c in found.claims if c.confounded}
    assert {"stiffness-rises-with-current", "change-of-stiffness-rises-with-current"} <= confounded
    for c in found.claims:
        if c.id in lost | confounded:
            assert c.verdict == "cannot tell from these numbers"


@pytest.mark.slow
def test_its_numbers_are_those_of_fresh_fits(found: ReproductionDocument) -> None:
    """Two records of one condition, and all evidence from what is printed.

    Seeds are fixed, so that the same versions give the same numbers; medians of 2000 draws may move by a tenth of the
    posterior standard deviation with others.
    """
    study = study_twin(only=[CONDITION], jobs=1)
    fresh = table_entries(study)
    told = 0
    for number in ("3", "4", "5", "6", "7", "8", "10"):
        old = {_place(e): e for e in found.tables[number]}
        for entry in (e for e in fresh[number] if e.condition == CONDITION and e.recomputed):
            told += 1
            _agree(old[_place(entry)], entry)
    assert told == 2 * 7 + 2 * 5 + 2
    records = {(r.condition, r.branch): r for r in found.comparison.records}
    for r in study.comparison.found.records:
        old_record = records[r.condition, r.branch]
        assert r.verdict == old_record.verdict
        assert r.ln_bayes_factor == pytest.approx(old_record.ln_bayes_factor, abs=0.5)
    printed = {c.id: _printed(c) for c in found.claims}
    for c in map(JudgedClaim.about, claims(study)):
        assert _printed(c) == pytest.approx(printed[c.id], abs=0.04), c.id


def _place(entry: ReproducedEntry) -> tuple[str, str, str]:
    return entry.condition, entry.branch, entry.quantity


def _agree(one: ReproducedEntry, other: ReproducedEntry) -> None:
    old, new = one.recomputed, other.recomputed
    if isinstance(old, RecomputedValue):
        assert isinstance(new, RecomputedValue)
        assert new.value == pytest.approx(old.value, rel=1e-3)
        return
    assert old is not None
    assert isinstance(new, IntervalDocument)
    (low, median, high), found = old.quantiles, new.quantiles
    sd = (high - low) / 3.29
    assert found[1] == pytest.approx(median, abs=0.15 * sd)
    assert found[0] == pytest.approx(low, abs=0.3 * sd)


def _printed(c: JudgedClaim) -> list[float]:
    return [e.probability for e in c.evidence if e.source == "printed" and e.probability is not None]
