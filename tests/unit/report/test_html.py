"""The report as a page: whole by itself, safe, and careful with what did not converge."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from html.parser import HTMLParser
from typing import Any

import pytest

from sma_bayes.assess.identifiability import Direction
from sma_bayes.report.content import Content, RecordContent
from sma_bayes.report.html import Picture, anchor, select
from sma_bayes.report.notation import interval_text
from sma_bayes.report.tables import Column, Table, report_tables, without_empty, without_same
from sma_bayes.runs.schema import FindingDocument
from sma_bayes.studies.fit.page import _narrow, noise_groups, parameter_overview, render

Page = Callable[[Content], "Reader"]
VOID = {"meta", "wbr", "img", "br", "hr"}


class Reader(HTMLParser):
    """Tags, links and words of a page."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.words: list[str] = []
        self.open: list[str] = []
        self.source = text
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag, f"</{tag}> closes something else"

    def handle_data(self, data: str) -> None:
        self.words.append(data)

    @property
    def text(self) -> str:
        return re.sub(r"\s+", " ", " ".join(self.words))

    def section(self, start: str, end: str) -> str:
        return self.source[self.source.index(f'id="{start}"') : self.source.index(f'id="{end}"')]


def told(r: RecordContent, **changes: Any) -> RecordContent:
    """A record whose document says something else."""
    return replace(r, document=r.document.model_copy(update=changes))


def page_of(content: Content) -> Reader:
    stems = ["diagnostics", "correlation", "parameters", "printed", "overview-force"]
    stems += [f"loop-{c}" for c in content.conditions]
    stems += [
        f"{kind}-{r.key}" for r in content.records for kind in ("corner", "trace", "predictive", "residuals")
    ]
    pictures = {
        s: Picture(s, f"Caption of {s}.", f"picture {s}", "data:image/png;base64,AA==", 10, 20) for s in stems
    }
    return Reader(render(content, report_tables(content), pictures))


@pytest.fixture(scope="module")
def page(content: Content) -> Reader:
    return page_of(content)


def unconverged(content: Content, *branches: str) -> Content:
    records = []
    for r in content.records:
        bad = r.branch in branches
        parameters = tuple(
            p.model_copy(update={"rhat": 1.3}) if bad and p.name == "A1" else p for p in r.parameters
        )
        records.append(replace(r, converged=not bad, parameters=parameters))
    averages = tuple(a for a in content.averages if a.branch not in (*branches, "both"))
    return replace(content, records=tuple(records), averages=averages)


def test_the_page_is_well_formed(page: Reader) -> None:
    assert page.open == []
    ids = [a["id"] for _, a in page.tags if "id" in a]
    assert len(ids) == len(set(ids))


def test_the_page_needs_nothing_else(page: Reader) -> None:
    assert not [t for t, _ in page.tags if t in ("script", "link", "iframe", "object", "base", "form")]
    for tag, attributes in page.tags:
        for name in ("src", "href", "srcset", "action", "data"):
            value = attributes.get(name)
            assert value is None or value.startswith(("#", "data:image/png;base64,")), f"{tag} {name}={value}"
        assert not [name for name in attributes if name.startswith("on")]
    assert "url(" not in page.source
    assert "@import" not in page.source


def test_every_link_has_a_target_and_every_picture_words(page: Reader) -> None:
    ids = {a["id"] for _, a in page.tags if "id" in a}
    links = {a["href"] for _, a in page.tags if a.get("href")}
    assert links
    assert {str(link)[1:] for link in links} <= ids
    assert all(a.get("alt") for t, a in page.tags if t == "img")
    assert [a.get("lang") for t, a in page.tags if t == "html"] == ["en"]


def test_the_answer_comes_first_with_whether_to_believe_it_and_provenance_last(
    page: Reader, content: Content
) -> None:
    order = [
        page.source.index(f'id="{name}"')
        for name in ("answer", "next", "conclusions", "diagnostics", "records", "provenance")
    ]
    assert order == sorted(order)
    answer = re.sub(r"\s+", " ", re.sub(r"<[^>]+>", " ", page.section("answer", "next")))
    assert "may it be believed?" in answer
    for r in content.records:
        least = next(q for q in r.document.quantities_of_branch if q.name == "least_stiffness")
        assert interval_text(least.median, least.q05, least.q95) in answer.replace("\u00a0", " ")


def test_the_interval_is_named_with_kind_and_level(page: Reader) -> None:
    assert "equal-tailed 90 % credible interval" in page.text


def test_the_noise_model_is_said_aloud_with_its_reason(page: Reader, content: Content) -> None:
    noise = page.section("noise", "measurements")
    for record in content.records:
        assert record.document.noise.title in noise
        assert record.document.noise.reason.split(":")[0] in noise
    assert "ln evidence of this model less that of the best other one" in re.sub(r"\s+", " ", noise)


def test_provenance_is_complete(page: Reader, content: Content) -> None:
    p = content.document
    assert p.data_sha256 in page.text
    assert content.command in page.text
    assert f"numpy {p.versions['numpy']}" in page.text
    assert "seed" in page.text
    assert "[[both.A1]]" in page.text  # the priors in force


def test_a_converged_run_has_no_banner(page: Reader) -> None:
    assert "Not converged" not in page.text
    assert not [a for _, a in page.tags if a.get("class") == "banner"]


def test_one_bad_branch_is_announced_and_left_out_of_the_conclusions(content: Content) -> None:
    reader = page_of(unconverged(content, "heating"))
    assert "Not converged: 1 of 2 records." in reader.text
    assert "A1 (R-hat 1.300" in reader.text
    conclusions = reader.section("conclusions", "diagnostics")
    assert "Left out of this chapter" in conclusions
    curves = re.sub(
        r"<[^>]+>", "", conclusions[conclusions.index('id="curves"') : conclusions.index('id="parameters"')]
    )
    assert "heating did not converge. The other branch is in the chart above" in curves
    table = re.sub(r"<[^>]+>", " ", conclusions[conclusions.index('id="parameters"') :])
    assert "cooling" in table
    assert "hysteresis width" not in table.split("Loop and stiffness quantities")[-1].split("2.5")[0]
    heating = [row for row in re.findall(r"<tr>.*?</tr>", conclusions, re.S) if ">heating<" in row]
    assert heating == []


def test_with_no_record_left_there_are_no_conclusions(content: Content) -> None:
    reader = page_of(unconverged(content, "heating", "cooling"))
    conclusions = reader.section("conclusions", "diagnostics")
    assert "there are no conclusions" in conclusions
    assert "<table" not in conclusions
    assert "<img" not in conclusions


def test_findings_name_file_and_rows(content: Content) -> None:
    finding = FindingDocument(
        kind="drop-out", message="reads 0", file="w.csv", rows=(4, 5, 6, 9), count=4, dropped=4, condition="c",
        branch="heating", column="force_N", severity="look",
    )  # fmt: skip
    text = page_of(replace(content, findings=(finding,))).text
    assert "w.csv" in text
    assert "4–6, 9" in text
    assert "4 rows of data kept out" in re.sub(r"\s+", " ", text)


def test_what_users_write_stays_text(content: Content) -> None:
    evil = '<script>alert("x")</script> & <b>'
    finding = FindingDocument(
        kind="spike", message=evil, file=evil, rows=(), count=0, dropped=0, condition=evil, branch="", column=evil,
        severity="look",
    )  # fmt: skip
    document = content.document.but(campaign=evil, source=evil)
    reader = page_of(replace(content, document=document, findings=(finding,)))
    assert not [t for t, _ in reader.tags if t in ("script", "b") and t == "script"]
    assert evil in reader.text


def test_prior_driven_and_bound_parameters_are_listed(content: Content) -> None:
    record = content.records[0]
    parameters = tuple(
        p.model_copy(update={"identified": p.name != "B1", "contraction": 0.31, "at_bound": p.name == "A2"})
        for p in record.parameters
    )
    free = Direction(text="0.71 ln A1 + 0.71 ln B1", contraction=0.02)
    changed = replace(told(record, free_directions=(free,)), parameters=parameters)
    reader = page_of(replace(content, records=(changed, *content.records[1:])))
    identified = re.sub(r"<[^>]+>|\s+", " ", reader.section("identified", "checks"))
    assert "B1 (contraction 0.31)" in identified
    assert "0.71 ln A1 + 0.71 ln B1" in identified
    assert re.search(r"ended at a bound .* A2", identified)


def test_checks_that_fail_are_shown_with_the_number_that_chance_gives(content: Content) -> None:
    record = content.records[0]
    checks = tuple(
        c.model_copy(update={"p_value": 0.5 if i else 0.0}) for i, c in enumerate(record.document.checks)
    )
    rest = tuple(told(r, checks=()) for r in content.records[1:])
    reader = page_of(replace(content, records=(told(record, checks=checks), *rest)))
    assert f"1 of {len(checks)} predictive checks failed" in reader.text
    assert "1 is further out than 99 % of them; by chance alone about" in reader.text
    assert "&lt; 0.002" in reader.section("checks", "records")


def test_probabilities_of_shapes_have_three_decimals(content: Content) -> None:
    shapes = {"hump": 0.95, "unbounded": 0.041}
    reader = page_of(replace(content, records=tuple(told(r, shape=shapes) for r in content.records)))
    assert "with probability 0.950" in reader.text
    assert "with probability 0.041" in reader.text
    sure = page_of(replace(content, records=tuple(told(r, shape={"hump": 1.0}) for r in content.records)))
    assert "with probability > 0.999" in sure.text


def test_a_campaign_without_twin_has_no_printed_values(content: Content) -> None:
    assert "Printed values of the paper" in page_of(content).text
    assert "Printed values of the paper" not in page_of(replace(content, printed=())).text


def test_the_overview_marks_what_is_not_identified(content: Content) -> None:
    record = content.records[0]
    parameters = tuple(
        p.model_copy(update={"identified": p.name != "A1", "fixed": p.name == "A4"})
        for p in record.parameters
    )
    table = parameter_overview(replace(content, records=(replace(record, parameters=parameters),)))[0]
    assert [c.header for c in table.columns][2:4] == ["A1 [cm]", "A2 [1/arbitrary unit]"]
    cells = table.rows[0]
    assert str(cells[2]).endswith("(not identified)")
    assert str(cells[5]).endswith("fixed")
    assert not str(cells[3]).endswith("(not identified)")


def test_noise_models_are_grouped(content: Content) -> None:
    a, b = content.records
    chosen = told(
        b,
        noise=b.document.noise.model_copy(
            update={"title": "AR(1)", "chosen_by": "the user", "lag1": {}, "ln_evidence": {}}
        ),
    )
    mixed = replace(content, records=(a, chosen))
    groups = noise_groups(mixed)
    assert [(g.title, len(g.records)) for g in groups] == [(a.document.noise.title, 1), ("AR(1)", 1)]
    assert groups[1].lag1 is groups[1].margin is None


def test_tables_are_cut_to_what_matters() -> None:
    columns = (Column("a", "a"), Column("b", "b"), Column("c", "c"))
    table = Table("t", "T", "", columns, (("x", "", 1), ("y", None, 2)), grouped=1)
    assert select(table, a="x", drop=("a",)) == Table("t", "T", "", columns[1:], (("", 1),), grouped=0)
    assert without_empty(table) == Table(
        "t", "T", "", (columns[0], columns[2]), (("x", 1), ("y", 2)), grouped=1
    )


def test_evidences_of_many_noise_models_are_left_to_the_file() -> None:
    columns = [
        Column("noise model", "noise"),
        *(Column(f"ln evidence, {i}", f"ln_evidence_{i}", "1") for i in range(7)),
    ]
    wide = Table("noise", "Noise models", "Why.", tuple(columns), (("ar1", *range(7)),))
    narrow = _narrow(wide)
    assert [c.key for c in narrow.columns] == ["noise"]
    assert narrow.note == "Why. Evidences of 7 models: tables/noise.csv."
    few = Table("noise", "Noise models", "Why.", tuple(columns[:4]), (("ar1", 1, 2, 3),))
    assert _narrow(few) is few


def test_what_all_rows_say_alike_is_told_once() -> None:
    columns = (Column("model", "model"), Column("noise", "noise"), Column("held out", "held_out"))
    table = Table("t", "T", "Who wins.", columns, (("a", "ar1", "x"), ("b", "ar1", "y")))
    assert without_same(table, ("noise", "held_out")) == Table(
        "t", "T", "Who wins. Noise in all rows: ar1.", (columns[0], columns[2]), (("a", "x"), ("b", "y"))
    )
    one = Table("t", "T", "Who wins.", columns, table.rows[:1])
    assert without_same(one, ("noise",)) == one


def test_anchors_have_no_blanks() -> None:
    assert anchor("2 A, 10 mHz/heating") == "2-A-10-mHz-heating"
