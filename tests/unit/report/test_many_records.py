"""The report of a campaign of many records: short itself, with a page for each record."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest

from sma_bayes.report import content as content_module
from sma_bayes.report.choice import figures_for
from sma_bayes.report.content import Content, RecordContent
from sma_bayes.report.tables import report_tables
from sma_bayes.studies.fit.answer import spread_tables
from sma_bayes.studies.fit.page import ENTRIES_SHOWN, render, render_index
from sma_bayes.studies.report.build import build_report

LINK = re.compile(r'(?:href|src)="([^"#:]+)"')


@pytest.fixture
def two_are_many(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let a run of two records count as one of many."""
    monkeypatch.setattr(content_module, "CAMPAIGN_REPORT_ABOVE", 1)


def many(content: Content, times: int) -> Content:
    """The same records again and again, each under a name of its own."""
    return replace(
        content,
        printed=(),
        records=tuple(
            replace(r, condition=f"{r.condition}-{i}", key=f"{r.condition}-{i}-{r.branch}")
            for i in range(times)
            for r in content.records
        ),
    )


@pytest.mark.usefixtures("two_are_many")
@pytest.mark.parametrize(("figures", "drawn"), [("all", 5 + 9), ("report", 5)])
def test_each_record_has_a_page_and_every_link_leads_somewhere(
    run_copy: Path, content: Content, figures: str, drawn: int
) -> None:
    build_report(run_copy, figures=figures, jobs=1)
    missed = {r.key: bool(r.document.discrepancy) for r in content.records} if figures == "all" else {}
    assert len(list((run_copy / "figures").glob("*.png"))) == drawn + sum(missed.values())
    pages = [run_copy / "report.html", *(run_copy / "records").iterdir()]
    assert len(pages) == 1 + 1 + 2
    for page in pages:
        links = LINK.findall(page.read_text(encoding="utf-8"))
        assert links
        assert all((page.parent / link).is_file() for link in links), page
    own = (run_copy / "records" / "100g-10mHz-heating.html").read_text(encoding="utf-8")
    assert own.count("<img") == (5 + missed["100g-10mHz-heating"] if figures == "all" else 0)
    assert (run_copy / "report.html").read_text(encoding="utf-8").count("<img") == 5


def test_the_page_of_a_campaign_does_not_grow_with_its_records(content: Content) -> None:
    sizes = []
    for times in (60, 240):
        long = many(content, times)
        assert long.paged
        page = render(long, report_tables(long), {})
        assert f"{ENTRIES_SHOWN} of {2 * times} rows" in page.replace("\u202f", "").replace("\u2009", "")
        sizes.append(len(page))
        assert render_index(long).count("<tr>") == 2 * times + 1
    assert sizes[1] < 1.02 * sizes[0]


def test_worst_records_are_shown_first(content: Content) -> None:
    long = many(content, 60)
    bad = replace(
        long.records[77], parameters=(long.records[77].parameters[0].model_copy(update={"rhat": 1.7}),)
    )
    long = replace(long, records=(*long.records[:77], bad, *long.records[78:]))
    page = render(long, report_tables(long), {})
    head = page[page.index('<h3 id="convergence">') : page.index('<h3 id="noise">')]
    assert bad.condition in head
    assert head.index("1.7") < head.index("1.00")


def test_figures_are_those_of_the_report_unless_all_or_none_are_asked_for() -> None:
    assert [figures_for(c) for c in ("report", True, "all")] == ["report", "report", "all"]
    assert [figures_for(c) for c in (False, "none")] == ["none", "none"]
    with pytest.raises(Exception, match=r"no choice of figures 'al'\n.*'all'"):
        figures_for("al")


def test_the_first_screen_answers_for_all_records(content: Content) -> None:
    """It had the first twenty of two hundred, and nobody knew where the others are."""
    long = many(content, 60)
    page = render(long, report_tables(long), {})
    first = page[page.index('<h2 id="answer">') : page.index('<h3 id="next">')]
    assert first.index("All records at a glance") < first.index("Stiffness and transformation")
    (table,) = spread_tables(long)
    keys = [c.key for c in table.columns]
    rows = [dict(zip(keys, row, strict=True)) for row in table.rows]
    assert {row["records"] for row in rows} == {60}
    assert {row["branch"] for row in rows} == {"heating", "cooling"}
    for row in rows:
        low, middle, high = (row[k] for k in ("lowest", "middle", "highest"))
        assert low.value <= middle.value <= high.value


def test_the_lowest_and_the_highest_are_named(content: Content) -> None:
    def shifted(r: RecordContent, by: float) -> RecordContent:
        moved = {
            name: t.model_copy(update={"median": t.median + by, "q05": t.q05 + by, "q95": t.q95 + by})
            for name, t in r.document.transformation.items()
        }
        return replace(r, document=r.document.model_copy(update={"transformation": moved}))

    long = many(content, 9)
    long = replace(long, records=tuple(shifted(r, float((5 * i) % 7)) for i, r in enumerate(long.records)))
    (table,) = spread_tables(long)
    keys = [c.key for c in table.columns]
    rows = [dict(zip(keys, row, strict=True)) for row in table.rows]
    (start,) = (row for row in rows if (row["branch"], row["quantity"]) == ("heating", "start"))
    answers = {
        r.condition: r.document.transformation["As"].median for r in long.records if r.branch == "heating"
    }
    assert start["lowest_of"] == min(answers, key=answers.__getitem__)
    assert start["lowest"].value == min(answers.values())
    assert start["highest"].value == max(answers.values()) == answers[start["highest_of"]]
    assert start["middle"].value == sorted(answers.values())[4]
