"""What a name in the data can do: nothing, be it in a table, on a page, or in a study."""

from __future__ import annotations

import base64
import csv
import hashlib
import re
from collections.abc import Callable
from pathlib import Path

import pytest

from sma_bayes.report.html import with_policy
from sma_bayes.runs.outputs import read_cells
from sma_bayes.runs.store import FORMULA, guarded_text, unguarded_text, write_csv

Run = Callable[..., object]


TEXTS = ("=cmd()", "+1+cmd", "-2+3", "@SUM(A1)", "\tx", "'=cmd()", "''=x", "2A-150g", "'quoted'", "")


@pytest.mark.parametrize("text", TEXTS)
def test_no_cell_is_a_formula_and_every_one_is_read_as_it_was(tmp_path: Path, text: str) -> None:
    assert unguarded_text(guarded_text(text)) == text
    write_csv(tmp_path / "t.csv", {"=head": [text, "x"], "number": [-1.5, 2.0]})
    with (tmp_path / "t.csv").open(encoding="utf-8", newline="") as file:
        cells = list(csv.reader(file))
    assert not any(cell.startswith(FORMULA) for cell in (cells[0][0], cells[1][0]))
    assert cells[1][1] == "-1.5", "numbers stay numbers"
    assert read_cells(tmp_path / "t.csv") == {"=head": (text, "x"), "number": ("-1.5", "2")}


def test_a_condition_that_is_a_formula_and_one_that_is_a_script(
    run: Run, make_campaign: Callable[..., Path], tmp_path: Path
) -> None:
    changes = ('id = "a"', 'id = "=cmd()"'), ('name = "bench"', "name = '<script>x</script>'")
    folder = make_campaign(tmp_path / "c", *changes)
    out = tmp_path / "out"
    outcome = run("fit", folder, "--out", out, "--noise", "independent", "--jobs", 1, "--quiet")
    assert outcome.status == 0, outcome.err
    tables = list((out / "tables").glob("*.csv"))
    assert tables
    for table in tables:
        with table.open(encoding="utf-8", newline="") as file:
            texts = [cell for row in csv.reader(file) for cell in row]
        assert [t for t in texts if t.startswith(("=", "@", "+", "\t"))] == [], table
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "<script>x" not in page
    (policy,) = re.findall(r'Content-Security-Policy" content="([^"]*)"', page)
    assert "default-src 'none'" in policy
    styles = re.findall(r"<style>(.*?)</style>", page, flags=re.DOTALL)
    digests = [base64.b64encode(hashlib.sha256(s.encode()).digest()).decode() for s in styles]
    assert digests
    assert all(f"'sha256-{digest}'" in policy for digest in digests)
    assert "style=" not in re.sub(r"<style>.*?</style>", "", page, flags=re.DOTALL)


def test_a_script_of_the_page_itself_may_run() -> None:
    page = with_policy('<meta charset="utf-8"><script>let a = 1</script>')
    digest = base64.b64encode(hashlib.sha256(b"let a = 1").digest()).decode()
    assert f"script-src 'sha256-{digest}'" in page


@pytest.mark.parametrize(
    ("at", "told"),
    [
        ("curent_A=2", "did you mean 'current_A'?"),
        ("current_A=two", "'two' is no number"),
        ("current_A=2,current_A=3", "given twice"),
        ("current_A=-2", "greater than or equal to 0"),
        ("current_A=inf", "finite"),
        ("current_A=1e308", "less than or equal to 1000000000"),
    ],
)
def test_a_study_with_a_condition_that_is_none_is_refused_before_anything_runs(
    run: Run, make_campaign: Callable[..., Path], tmp_path: Path, at: str, told: str
) -> None:
    folder = make_campaign(tmp_path / "c")
    study = f'[study]\ncampaign = "campaign.toml"\nout = "out"\n[fit]\n[conditions]\nat = ["{at}"]\n'
    (folder / "study.toml").write_text(study, encoding="utf-8")
    outcome = run("run", folder / "study.toml")
    assert outcome.status == 2
    assert told in outcome.err
    assert "conditions.at, entry 1" in outcome.err
    assert not (folder / "out").exists()
