"""The first screen: how stiff, how sure, may it be believed, and what to do next."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from sma_bayes.assess.adequacy import DiscrepancySummary, Reason
from sma_bayes.assess.path import PathRemark
from sma_bayes.report.content import Content, Estimate, RecordContent
from sma_bayes.runs.schema import FindingDocument
from sma_bayes.studies.fit.answer import answer_tables, belief, next_steps
from sma_bayes.studies.fit.findings import finding_groups, severity


def told(r: RecordContent, **changes: Any) -> RecordContent:
    """A record whose document says something else."""
    return replace(r, document=r.document.model_copy(update=changes))


def finding(kind: str, condition: str, dropped: int = 0) -> FindingDocument:
    return FindingDocument(
        kind=kind, message=f"what {kind} means", file="run.csv", rows=(), count=dropped, dropped=dropped,
        condition=condition, branch="", column="", severity=severity(kind),
    )  # fmt: skip


def test_the_table_has_a_row_a_record_with_the_numbers_of_the_run(content: Content) -> None:
    (table,) = answer_tables(content)
    keys = [c.key for c in table.columns]
    assert [c.unit for c in table.columns if c.key.endswith("stiffness")] == ["N/cm", "N/cm"]
    for row, r in zip(table.rows, content.records, strict=True):
        cells = dict(zip(keys, row, strict=True))
        assert (cells["condition"], cells["branch"]) == (r.condition, r.branch)
        estimates = {q.name: Estimate.of(q, q.unit) for q in r.document.quantities_of_branch}
        assert cells["least_stiffness"] == estimates["least_stiffness"]
        assert cells["greatest_stiffness"] == estimates["greatest_stiffness"]
        ends = {n: Estimate.of(t, t.unit) for n, t in r.document.transformation.items()}
        widths = [Estimate.of(q, q.unit) for q in content.loops if q.name == "hysteresis_width"]
        assert len(widths) == 2
        assert cells["hysteresis"] == (widths[0] if r is content.records[0] else None)
        names = ("As", "Af") if r.branch == "heating" else ("Ms", "Mf")
        assert (cells["start"], cells["finish"]) == tuple(ends[n] for n in names)


def test_a_negative_stiffness_is_told_by_magnitude_and_asked_for_with_its_sign(content: Content) -> None:
    """The twin's stiffness is positive; where it is negative the table says so, and `ask` is told the signed value."""

    def signed(r: RecordContent) -> RecordContent:
        own = (
            q.model_copy(update={"negative": "stiffness" in q.name}) for q in r.document.quantities_of_branch
        )
        return told(r, quantities_of_branch=tuple(own))

    (plain,) = answer_tables(content)
    assert "negative" not in plain.note
    first, *others = content.records
    (some,) = answer_tables(replace(content, records=(signed(first), *others)))
    assert f"(the stiffness itself of {first.key} is negative, as the curves show it)" in some.note
    below = replace(content, records=tuple(signed(r) for r in content.records))
    (every,) = answer_tables(below)
    assert "(the stiffness itself is negative, as the curves show it)" in every.note
    assert every.rows == plain.rows
    (ask,) = (s for s in next_steps(below) if "sma-bayes ask" in s)
    (before,) = (s for s in next_steps(content) if "sma-bayes ask" in s)
    assert ask == before.replace('--stiffness "', '--stiffness "-')


def test_no_number_is_given_of_what_did_not_converge(content: Content) -> None:
    bad = replace(content, records=tuple(replace(r, converged=False) for r in content.records))
    (table,) = answer_tables(bad)
    assert all(cell is None for row in table.rows for cell in row[2:-1])
    assert all(row[-1] == "no: not converged" for row in table.rows)
    assert "not converged" in next_steps(bad)[0]


def test_an_inadequate_record_is_named_with_its_reason_and_a_remedy(content: Content) -> None:
    first, *others = content.records
    reason = Reason(kind="curve", channel="force", message="the curve misses 9 % of the range of force")
    bad = replace(content, records=(replace(told(first, why=(reason,)), adequate=False), *others))
    assert belief(bad.records[0]) == f"with care: {reason.message}"
    cut = {
        name: t.model_copy(update={"within_data": name != "Af"})
        for name, t in first.document.transformation.items()
    }
    short = told(bad.records[0], transformation=cut)
    assert belief(short) == f"with care: {reason.message}; Af extrapolated"
    (step,) = (s for s in next_steps(bad) if reason.message in s)
    assert step.startswith(first.key)
    assert "`sma-bayes gap`" in step


@pytest.mark.parametrize(
    ("update", "said", "advice"),
    [
        ({"samples": 2}, "As and Af from too few readings", "measure closer together"),
        ({"samples": 9, "defined": 0.3}, "As and Af without tangents", "a further step"),
        ({"samples": 9, "defined": 1.0}, "As and Af extrapolated", "measure on to where"),
    ],
)
def test_what_a_transformation_temperature_lacks_is_said(
    content: Content, update: dict[str, float], said: str, advice: str
) -> None:
    first, *others = content.records
    temperatures = {
        name: t.model_copy(update={"within_data": False, **update})
        for name, t in first.document.transformation.items()
    }
    bad = replace(content, records=(told(first, transformation=temperatures), *others))
    assert belief(bad.records[0]) == f"yes; {said}"
    (step,) = (s for s in next_steps(bad) if s.startswith(f"{first.key}: "))
    assert advice in step


def test_a_number_that_few_draws_have_is_no_answer(content: Content) -> None:
    def with_share(share: float) -> Content:
        temperatures = {
            name: t.model_copy(update={"defined": share if name == "Af" else 1.0})
            for name, t in content.records[0].document.transformation.items()
        }
        first = told(content.records[0], transformation=temperatures)
        loops = tuple(
            q.model_copy(update={"defined": share}) if q.name == "hysteresis_width" else q
            for q in content.loops
        )
        return replace(content, records=(first, *content.records[1:]), loops=loops)

    def row(share: float) -> dict[str, Any]:
        (table,) = answer_tables(with_share(share))
        return dict(zip([c.key for c in table.columns], table.rows[0], strict=True))

    rare, usual = row(0.3), row(0.9)
    changed = {name for name, cell in usual.items() if cell is not None and rare[name] is None}
    assert len(changed) == 2, changed


def test_what_is_asked_next_lies_within_what_the_spring_does(content: Content) -> None:
    """The greatest stiffness is reached with a probability of a half, and so no temperature is found for it."""
    (ask,) = (s for s in next_steps(content) if "sma-bayes ask" in s)
    value = float(ask.split('"')[1].split()[0])
    ends = sorted(
        q.median for r in content.converged[:1] for q in r.document.quantities_of_branch
        if q.name in ("least_stiffness", "greatest_stiffness") and q.median is not None
    )  # fmt: skip
    assert ends[0] < value < ends[1]


def test_only_settings_that_vary_are_asked_about(content: Content) -> None:
    def with_settings(*settings: dict[str, float]) -> Content:
        own = tuple(told(r, settings=s) for r, s in zip(content.records, settings, strict=True))
        return replace(content, records=own)

    loads = with_settings({"load": 1.0, "current": 2.0}, {"load": 2.0, "current": 2.0})
    assert [s for s in next_steps(loads) if s.startswith("What does load do? `sma-bayes conditions")]
    same = with_settings(*({"load": 1.0, "current": 2.0},) * 2)
    assert not [s for s in next_steps(same) if "sma-bayes conditions" in s]


def test_sweeps_that_differ_are_told_where_they_differ_most_and_followed_by_cycles(content: Content) -> None:
    def missed(between: float | None) -> DiscrepancySummary:
        return DiscrepancySummary(
            unit="mm", rms=0.1, largest=0.2, at=50.0, share=0.02, ln_bayes_factor=9.0, between_sweeps=between
        )

    def with_sweeps(*between: float | None) -> Content:
        own = (
            told(r, discrepancy={r.channels[0].channel: missed(b)})
            for r, b in zip(content.records, between, strict=True)
        )
        return replace(content, records=tuple(own))

    first, second = (r.key for r in content.records[:2])
    rest = (None,) * (len(content.records) - 2)
    (step,) = (s for s in next_steps(with_sweeps(0.3, 0.812, *rest)) if "sma-bayes cycles" in s)
    assert step.startswith(f"{first}, {second}: ")
    assert f"by 0.81 mm rms in {second}" in step
    assert not [s for s in next_steps(with_sweeps(None, None, *rest)) if "sma-bayes cycles" in s]
    differ = with_sweeps(0.3, 0.812, *rest)
    reason = Reason(kind="check", channel="force", message="neighbouring residuals are alike")
    bad = replace(
        differ, records=tuple(replace(told(r, why=(reason,)), adequate=False) for r in differ.records)
    )
    assert next_steps(bad)[0] == step  # what may make a fit inadequate stands before what else may


def test_without_a_stiffness_the_channel_is_asked_for(content: Content) -> None:
    bare = replace(content, records=tuple(replace(r, channels=r.channels[:1]) for r in content.records))
    ends = [t.median for t in bare.records[0].document.transformation.values() if t.median is not None]
    (ask,) = (s for s in next_steps(bare) if "sma-bayes ask" in s)
    assert float(ask.split('"')[1].split()[0]) == pytest.approx(sum(ends) / 2, rel=0.01)


def test_a_negative_hysteresis_is_the_thermometers(content: Content) -> None:
    def wide(low: float, high: float) -> Content:
        ends = {"q05": low, "median": 0.5 * (low + high), "q95": high}
        own = (q.model_copy(update=ends if q.name == "hysteresis_width" else {}) for q in content.loops)
        return replace(content, loops=tuple(own))

    (step,) = (s for s in next_steps(wide(-2.1, -1.2)) if "hysteresis is negative" in s)
    assert step.startswith(content.conditions[0])
    assert "`sma-bayes gap`" in step
    assert not [s for s in next_steps(wide(-2.1, 0.3)) if "hysteresis is negative" in s]


def test_numbers_of_one_path_are_not_told_of_others(content: Content) -> None:
    straight = tuple(
        replace(
            told(r, path=PathRemark(kind="straight_path", message=f"a bias spring of {i} N/mm")),
            adequate=True,
        )
        for i, r in enumerate(content.records)
    )
    steps = next_steps(replace(content, records=straight))
    assert not [s for s in steps if "N/mm" in s]
    assert [s for s in steps if "the slope is that of the rig" in s]


def test_a_slope_that_is_the_rigs_is_said_to_be_and_no_temperature_is_looked_for(content: Content) -> None:
    straight = tuple(
        replace(told(r, path=PathRemark(kind="straight_path", message="a bias spring")), adequate=True)
        for r in content.records
    )
    flat = replace(content, records=straight)
    assert all(belief(r) == "yes, but the slope is that of the rig" for r in straight)
    held = [
        replace(r, channels=tuple(c for c in r.channels if c.channel == "displacement")) for r in straight
    ]
    assert {belief(r) for r in held} == {"yes"}, "no slope is told of them"
    assert not [s for s in next_steps(flat) if "sma-bayes ask" in s]
    assert [s for s in next_steps(content) if "sma-bayes ask" in s]


def test_findings_are_grouped_and_the_serious_come_first(content: Content) -> None:
    findings = [finding("reduced", f"c{i}") for i in range(14)]
    findings += [finding("spike", "c1", 3), finding("clipped", "c2")]
    groups = finding_groups(findings)
    assert [(g.kind, g.severity, g.count) for g in groups] == [
        ("clipped", "serious", 1), ("spike", "look", 1), ("reduced", "note", 14),
    ]  # fmt: skip
    assert groups[1].dropped == 3
    first = finding("hold", "c1", 44).model_copy(update={"message": "44 rows kept out: it stands still"})
    (both,) = finding_groups([first, finding("hold", "c2", 20)])
    assert (both.dropped, both.reason) == (64, "it stands still"), "rows of one are not those of the group"
    assert groups[0].reason == "what clipped means"
    loads = [
        finding("load-not-constant", c, 0).model_copy(update={"message": f"mean {n} N"})
        for c, n in (("c1", 78.7), ("c2", 98.4))
    ]
    (both,) = finding_groups(loads)
    assert both.reason == "for one, c1: mean 78.7 N", "numbers of one are not those of the group"
    (step,) = (s for s in next_steps(replace(content, findings=tuple(loads))) if "78.7" in s)
    assert step == "Check the measurements (c1, c2): for one, c1: mean 78.7 N"
    assert severity("a kind of tomorrow") == "look"
    steps = next_steps(replace(content, findings=tuple(findings)))
    assert [s for s in steps if "what clipped means" in s]
    assert not [s for s in steps if "reduced" in s]


def test_a_table_without_stiffness_does_not_speak_of_it(content: Content) -> None:
    strain = tuple(
        replace(r, channels=tuple(c for c in r.channels if c.channel == "displacement"))
        for r in content.records
    )
    (with_stiffness,) = answer_tables(content)
    assert (with_stiffness.title, "tiffness" in with_stiffness.note) == ("Stiffness and transformation", True)
    (without,) = answer_tables(replace(content, records=strain))
    assert (without.title, "tiffness" in without.note) == ("Transformation", False)
