"""Tables for a paper: their numbers, and that LaTeX sets them within its page."""

from __future__ import annotations

import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import pytest

from sma_bayes.assess.adequacy import DiscrepancySummary
from sma_bayes.latex import tex_symbol, tex_unit
from sma_bayes.report.content import Content, ParameterResult, RecordContent
from sma_bayes.report.tables import WRAPPED_COLUMN_SHARES, Column, Table, tex, words
from sma_bayes.studies.fit.publication import publication_tex, supplement_tex
from sma_bayes.studies.report.build import build_report

CELL = re.compile(r"\$(-?[\d.]+)_\{-([\d.]+)\}\^\{\+([\d.]+)\}")
PAPER = r"""\documentclass[a4paper]{article}
\usepackage{array,booktabs,longtable,siunitx,textcomp}
\begin{document}
\input{publication}
\end{document}
"""

LONG_NAMES = Table(
    "findings", "Findings about the measurements", "Rows are lines of the file.",
    (
        *words("kind", "severity", "file", "rows", "condition", "branch", "column"),
        Column("rows concerned", "count", "1"), Column("kept out", "dropped", "1"), *words("finding"),
    ),
    tuple(
        (kind, "serious", "raw_100MPa_second_specimen.csv", "1379-1381, 1388-1390, 1412-1414, 1441 ...", "100MPa",
         "heating", "temperature_chamber_C", 1297, 22, "rows kept out, as nothing is known of their temperature " * 3)
        for kind in ("load-not-constant", "missing-code")
    ),
)  # fmt: skip
"""As a rig's files give it: names that can't be broken, and sentences that can."""


def _numbers(text: str) -> list[tuple[float, ...]]:
    return [tuple(map(float, found)) for found in CELL.findall(text)]


def test_cells_lead_from_the_median_to_the_ends_of_the_interval(content: Content) -> None:
    text = publication_tex(content)
    told = [n for line in text.splitlines() if line.startswith("100g") for n in _numbers(line)]
    estimates = [
        p.estimate
        for channel in ("displacement", "force")
        for r in content.records
        for p in r.model_parameters
        if p.channel == channel and not p.fixed
    ]
    assert len(told) == len(estimates) > 10
    for (median, down, up), e in zip(told, estimates, strict=True):
        assert e.median is not None
        assert e.q05 is not None
        assert e.q95 is not None
        fine = 0.02 * (e.q95 - e.q05)
        assert median == pytest.approx(e.median, abs=fine)
        assert median - down == pytest.approx(e.q05, abs=2 * fine)
        assert median + up == pytest.approx(e.q95, abs=2 * fine)


def test_heads_have_symbols_and_units_and_records_that_failed_are_left_out(content: Content) -> None:
    text = publication_tex(content)
    assert r"\textbf{\shortstack[l]{$A_{1}$\\{}\mdseries[\unit{\centi\metre}]}}" in text
    assert "heating" in text
    only = replace(content, records=(content.records[0], replace(content.records[1], converged=False)))
    left_out = publication_tex(only)
    assert not [line for line in left_out.splitlines() if " & cooling & " in line]
    assert f"Left out, as not converged: {content.records[1].condition} cooling." in left_out
    assert "Left out" not in text
    nothing = replace(content, records=tuple(replace(r, converged=False) for r in content.records))
    assert publication_tex(nothing).startswith("% no record")


def test_it_is_said_where_something_stands_beside_the_curve(content: Content) -> None:
    """Its parameters alone do not make the curve then."""
    assert "discrepancy" not in publication_tex(content)
    first = content.records[0]
    beside = DiscrepancySummary(
        unit="N", rms=0.1, largest=0.2, at=50.0, share=0.05, ln_bayes_factor=30.0, between_sweeps=None
    )
    document = first.document.model_copy(update={"discrepancy": {"force": beside}})
    text = publication_tex(
        replace(content, records=(replace(first, document=document), *content.records[1:]))
    )
    (caption,) = re.findall(r"\\caption\{(.*discrepancy.*)\}\\label", text)
    assert caption.startswith("Parameters of force")
    assert "Beside 1 of 2 curves stands a smooth discrepancy" in caption


def test_zeros_of_small_numbers_go_into_the_head(content: Content) -> None:
    """A strain of 0.0384849 with an interval of 0.0000160 made a table wider than its page."""

    def smaller(r: RecordContent) -> RecordContent:
        return replace(r, parameters=tuple(small(p) if p.name == "A1" else p for p in r.parameters))

    def small(p: ParameterResult) -> ParameterResult:
        told = {k: 1e-3 * getattr(p, k) for k in ("median", "q05", "q95")}
        return p.model_copy(update=told)

    changed = tuple(smaller(r) for r in content.records)
    text = publication_tex(replace(content, records=changed))
    assert text.count(r"$10^{-6}$ \unit{\centi\metre}") == 2
    (first,) = (p.median for p in changed[0].parameters if p.name == "A1")
    assert first is not None
    cells = (line for line in text.splitlines() if line.startswith(f"{changed[0].condition} & "))
    assert _numbers(next(cells))[0][0] == pytest.approx(1e6 * first, rel=0.01)


def test_a_model_of_many_parameters_is_parted_and_what_is_not_identified_marked(content: Content) -> None:
    def richer(r: RecordContent) -> RecordContent:
        more = [
            p.model_copy(update={"name": f"{p.name}b", "identified": False})
            for p in r.parameters
            if p.channel == "force"
        ]
        return replace(r, parameters=(*r.parameters, *more))

    text = publication_tex(replace(content, records=tuple(richer(r) for r in content.records)))
    heads = [line for line in text.splitlines() if line.startswith(r"\textbf{Condition}")]
    assert max(line.count("&") for line in heads) == 6
    assert r"\dagger" in text
    assert "Dagger: not identified" in text


def test_units_that_siunitx_does_not_know_stay_words() -> None:
    assert tex_unit("percent degC") == r"\unit{\percent\degreeCelsius}"
    assert tex_unit("N/arbitrary") == "N/arbitrary"
    assert tex_symbol("temperature_sd") == r"temperature\_sd"


def _latex(folder: Path, name: str) -> str:
    """Log of the second run over a document."""
    command = ["pdflatex", "-interaction=nonstopmode", "-halt-on-error", name]
    for _ in range(2):
        done = subprocess.run(command, cwd=folder, capture_output=True, timeout=120, check=False)
        assert done.returncode == 0, done.stdout.decode("latin-1")[-2000:]
    return (folder / name).with_suffix(".log").read_text(encoding="latin-1")


def _has_latex() -> bool:
    if shutil.which("pdflatex") is None or shutil.which("kpsewhich") is None:
        return False
    found = subprocess.run(["kpsewhich", "siunitx.sty", "booktabs.sty"], capture_output=True, check=False)
    return found.stdout.count(b".sty") == 2


@pytest.mark.skipif(not _has_latex(), reason="needs pdflatex with siunitx and booktabs (texlive-science)")
def test_all_tables_fit_their_pages(run_copy: Path) -> None:
    build_report(run_copy, figures="none", jobs=1)
    tables = run_copy / "tables"
    (tables / "paper.tex").write_text(PAPER, encoding="utf-8")
    for name in ("paper.tex", "supplement.tex"):
        log = _latex(tables, name)
        assert "Overfull" not in log
        assert "undefined" not in log.lower()


@pytest.mark.skipif(not _has_latex(), reason="needs pdflatex with siunitx and booktabs (texlive-science)")
def test_a_table_of_long_names_fits_its_page(tmp_path: Path) -> None:
    (tmp_path / "findings.tex").write_text(tex(LONG_NAMES), encoding="utf-8")
    (tmp_path / "supplement.tex").write_text(supplement_tex(["findings"]), encoding="utf-8")
    assert "Overfull" not in _latex(tmp_path, "supplement.tex")


def test_words_that_may_be_broken_take_the_room_that_long_names_leave() -> None:
    """File names and columns of a logger made the table of findings wider than its page."""
    short = replace(
        LONG_NAMES,
        rows=tuple(
            ("kind", "note", "a.csv", "2", "100g", "heating", "force", *row[7:]) for row in LONG_NAMES.rows
        ),
    )
    shares = [
        [float(s) for s in re.findall(r"p\{([\d.]+)\\linewidth\}", tex(t))] for t in (LONG_NAMES, short)
    ]
    assert sum(shares[0]) < sum(shares[1])
    assert shares[1] == pytest.approx([WRAPPED_COLUMN_SHARES[key] for key in ("rows", "finding")])
