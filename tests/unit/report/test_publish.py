"""What authors take over: the paragraph of methods with its references, the workbook, and formats of figures."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest
from openpyxl import load_workbook

from sma_bayes.assess.adequacy import Reason
from sma_bayes.report.content import Content
from sma_bayes.report.tables import csv_columns, report_tables
from sma_bayes.report.workbook import write_workbook
from sma_bayes.runs.fit_document import CalibrationSummary, Measure
from sma_bayes.sampling.ensembles import METHODS
from sma_bayes.studies.fit.inadequate import KINDS
from sma_bayes.studies.fit.methods import FITTED, MOVES, bibliography, methods_text
from sma_bayes.studies.fit.report_content import calibration_text
from sma_bayes.studies.report.build import build_report


def test_the_paragraph_says_what_was_done(content: Content) -> None:
    text = methods_text(content)
    samples = sum(r.document.n for r in content.records)
    assert f"{samples} samples" in text
    assert "the modified sigmoid of Sul and Dhanalakshmi" in text
    assert "2 of 2 records converged" in text
    assert content.document.data_sha256 in text
    assert f"seed {content.document.seed}" in text
    assert "equal-tailed 90 % credible interval" in text


def test_the_paragraph_says_what_moves_made_the_draws(content: Content) -> None:
    """Of emcee only, a reader takes its stretch moves for granted."""
    assert set(MOVES) == {*METHODS, "differential evolution", "stretch"}
    assert f"emcee 3.1.6 [@foremanmackey2013] by {FITTED}; 2 of 2" in re.sub(
        r"emcee [\d.]+", "emcee 3.1.6", methods_text(content)
    )
    first, *others = content.records
    told = first.document.sampler.model_copy(update={"method": "stretch"})
    mixed = replace(first, document=first.document.model_copy(update={"sampler": told}))
    text = methods_text(replace(content, records=(mixed, *others)))
    assert "in 1 by stretch moves" in text
    assert f"in 1 by {FITTED}" in text


def test_the_paragraph_says_what_was_done_to_the_measurements(content: Content) -> None:
    plain = methods_text(content)
    assert not any(words in plain for words in ("means of up to", "single reading", "calibration"))
    known = (
        CalibrationSummary(relative_scale_sd=0.02, offset=0.0, offset_sd=0.0),
        Measure(name="force", unit="N"),
    )
    records = tuple(
        replace(
            r,
            document=r.document.model_copy(update={"rows_averaged": 4}),
            temperature_sd=0.2,
            temperature_unit="degC",
            calibration=(calibration_text(*known),),
        )
        for r in content.records
    )
    text = methods_text(replace(content, records=records))
    assert " samples, means of up to 4 rows)" in text
    assert "The error of a single reading of temperature (sd 0.2 °C) is part of the likelihood." in text
    assert "were added to the draws of the posterior (force: scale known to 2 % (sd))." in text


def test_what_was_not_done_is_not_claimed(content: Content) -> None:
    nothing = {"transformation": {}, "discrepancy": {}}
    plain = tuple(replace(r, document=r.document.model_copy(update=nothing)) for r in content.records)
    text = methods_text(replace(content, records=plain))
    assert "ASTM" not in text
    assert "discrepancy" not in text
    bad = replace(
        content, records=tuple(replace(r, converged=False, adequate=False) for r in content.records)
    )
    assert "0 of 2 records converged" in methods_text(bad)
    assert "describe 0 of 2 records" in methods_text(bad)


def test_a_misfit_of_the_curve_is_not_put_down_to_predictive_checks(content: Content) -> None:
    missed = Reason(kind="curve", channel="force", message="the curve misses force by up to 9.8 %")
    bad = tuple(
        replace(r, adequate=False, document=r.document.model_copy(update={"why": (missed,)}))
        for r in content.records
    )
    text = methods_text(replace(content, records=bad))
    assert "describe 0 of 2 records: in 2 the curve without a discrepancy misses more than 2 % of the" in text
    assert "predictive check" not in text


def test_every_kind_of_reason_has_words() -> None:
    kinds = re.findall(r"`([a-z]+)` \(", Reason.model_fields["kind"].description or "")
    assert set(kinds) == set(KINDS)


def test_every_citation_has_an_entry_and_every_entry_is_cited(content: Content) -> None:
    cited = set(re.findall(r"\[@(\w+)\]", methods_text(content)))
    entries = bibliography(content)
    assert set(re.findall(r"^@\w+\{(\w+),", entries, re.MULTILINE)) == cited
    assert entries.count("{") == entries.count("}")


def test_entries_are_of_types_that_plain_bibtex_knows_and_have_what_it_wants(content: Content) -> None:
    """BibTeX knows no @software, and warned of a report without a year."""
    wanted = {"article": {"author", "title", "journal", "year"}, "misc": {"author", "title", "note"},
              "techreport": {"author", "title", "institution", "year"}}  # fmt: skip
    for entry in bibliography(content).strip().split("\n\n"):
        kind = entry[1 : entry.index("{")]
        assert wanted[kind] <= set(re.findall(r"(\w+) = \{", entry))


def test_the_workbook_has_the_numbers_of_the_tables(content: Content, tmp_path: Path) -> None:
    tables = report_tables(content)
    write_workbook(tables, tmp_path / "results.xlsx")
    book = load_workbook(tmp_path / "results.xlsx")
    assert set(book.sheetnames) == {name for name, t in tables.items() if t.rows}
    rows = list(book["parameters"].iter_rows(values_only=True))
    columns = csv_columns(tables["parameters"])
    assert list(rows[0]) == list(columns)
    place = list(columns).index("median [unit]")
    assert [row[place] for row in rows[1:]] == pytest.approx(columns["median [unit]"])


def test_a_name_that_looks_like_a_formula_stays_text(content: Content, tmp_path: Path) -> None:
    evil = "=1+1"
    named = replace(content, records=tuple(replace(r, condition=evil) for r in content.records))
    write_workbook({"parameters": report_tables(named)["parameters"]}, tmp_path / "results.xlsx")
    cell = load_workbook(tmp_path / "results.xlsx")["parameters"].cell(2, 1)
    assert (cell.value, cell.data_type) == (evil, "s")


def test_formats_and_workbook_are_written_when_asked_for(run_copy: Path) -> None:
    build_report(run_copy, jobs=1, formats=["svg"], workbook=True)
    endings = {p.suffix for p in (run_copy / "figures").iterdir()}
    assert endings == {".svg", ".png", ".csv"}
    assert (run_copy / "tables" / "results.xlsx").is_file()
    assert (run_copy / "methods.md").read_text(encoding="utf-8").count("[@") >= 3
    with pytest.raises(Exception, match="no format of figures 'eps'"):
        build_report(run_copy, formats=["eps"])
