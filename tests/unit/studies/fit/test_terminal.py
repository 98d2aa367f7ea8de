"""What the screen says of fits that are not adequate."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from sma_bayes.assess.adequacy import SENTENCES, DiscrepancySummary, Reason, remedy
from sma_bayes.report.screen import Screen
from sma_bayes.runs.fit_document import (
    FitSummary,
    GoodnessSummary,
    Measure,
    NoiseSummary,
    OptionsSummary,
    ParameterSummary,
    RecordSummary,
    TemperatureSummary,
)
from sma_bayes.runs.schema import Factor, Workers
from sma_bayes.studies.fit import terminal as fit
from sma_bayes.studies.fit.inadequate import KINDS
from sma_bayes.studies.fit.terminal import adequacy_sentences, factor_of

PLAIN = OptionsSummary(model="modified_sigmoid", noise="independent")


def record(key: str, *why: tuple[str, str], **more: Any) -> RecordSummary:
    condition, _, branch = key.partition("-")
    return RecordSummary(
        condition=condition,
        branch=branch,
        key=key,
        n=140,
        channels=("displacement",),
        quantities={"displacement": Measure(name="strain", unit="1")},
        temperature=TemperatureSummary(unit="degC", lowest=20.0, highest=90.0),
        converged=True,
        adequate=not why,
        why=tuple(Reason(kind=kind, channel="", message=text) for kind, text in why),
        model="modified_sigmoid",
        nearest={},
        discrepancy=more.pop("discrepancy", {}),
        parameters=more.pop("parameters", {}),
        **more,
    )


def test_an_adequate_run_says_nothing() -> None:
    assert adequacy_sentences([record("a-heating"), record("a-cooling")], PLAIN) == []


def test_the_sentence_names_record_reason_and_what_to_try() -> None:
    why = ("curve", "the curve misses strain by up to 5.0 % of its range, at 60 °C")
    (sentence,) = adequacy_sentences([record("a-heating", why), record("a-cooling")], PLAIN)
    assert sentence == (
        "The curve does not describe a-heating: the curve misses strain by up to 5.0 % of its range, at 60 °C; "
        "try `--model auto` or `sma-bayes gap`."
    )


def test_what_was_tried_already_is_not_advised() -> None:
    for kind in ("curve", "check"):
        (sentence,) = adequacy_sentences([record("a-heating", (kind, "x"))], OptionsSummary(model="auto"))
        assert "--model auto" not in sentence
        assert "--noise auto" not in sentence
        assert sentence.endswith("`sma-bayes gap`.")


def test_sweeps_that_differ_are_followed_cycle_by_cycle() -> None:
    (sentence,) = adequacy_sentences([record("a-heating", ("sweeps", "sweeps that differ"))], PLAIN)
    assert sentence.startswith("One curve does not describe all sweeps of a-heating")
    assert "`sma-bayes cycles`" in sentence


def test_many_records_are_counted_and_the_reason_quoted_is_that_of_the_worst() -> None:
    """What the first of them misses would be taken for what all miss."""
    records = [
        record(
            f"{i}-heating", ("curve", f"reason {i}"), ("check", "another"),
            discrepancy={"displacement": {"unit": "1", "rms": 0.1, "largest": 0.2, "at": 50.0, "share": share,
                                          "ln_bayes_factor": 9.0}},
        )
        for i, share in enumerate((0.03, 0.05, 0.25, 0.08, 0.04))
    ]  # fmt: skip
    (sentence,) = adequacy_sentences([*records, record("5-heating")], PLAIN)
    assert sentence.startswith(
        "The curve does not describe 0-heating, 1-heating, 2-heating and 2 more: most of all 2-heating: reason 2;"
    )
    (sentence,) = adequacy_sentences(records, PLAIN)
    assert sentence.startswith("The curve does not describe all 5 records: most of all 2-heating: reason 2;")


def test_a_reason_of_several_records_names_the_one_it_is_quoted_from() -> None:
    records = [record(f"{i}-heating", ("noise", f"reason {i}")) for i in range(2)]
    (sentence,) = adequacy_sentences(records, PLAIN)
    assert "0-heating, 1-heating: for one, 0-heating: reason 0;" in sentence
    (sentence,) = adequacy_sentences(
        [record(f"{i}-heating", ("noise", "one reason")) for i in range(2)], PLAIN
    )
    assert "0-heating, 1-heating: one reason;" in sentence


def test_kinds_are_told_apart() -> None:
    records = [record("a", ("noise", "x")), record("b", ("prior", "y")), record("c", ("tempered", "z"))]
    found = adequacy_sentences(records, PLAIN)
    assert [s.partition(":")[0].split()[-1] for s in found] == ["a", "b", "c"]
    assert len(set(found)) == 3


def test_a_correlation_is_that_of_the_model_where_a_discrepancy_stands_beside_it() -> None:
    factor = {"displacement": {"r": Factor(q05=0.9, median=0.9999963, q95=1.0, undefined=0.0)}}
    alone = {"displacement": GoodnessSummary(sse=1.0, rmse=1.0, r2=0.64, adj_r2=0.6, n=9, p=4)}
    beside = DiscrepancySummary(unit="1", rms=0.1, largest=0.2, at=50.0, share=0.1, ln_bayes_factor=9.0)
    plain = record("100MPa-heating", correlation=factor, fit=alone)
    assert factor_of(plain, "displacement") == 0.9999963
    missed = record("100MPa-heating", correlation=factor, fit=alone, discrepancy={"displacement": beside})
    assert factor_of(missed, "displacement") == pytest.approx(0.8)


@pytest.mark.parametrize("width", [80, 160])
def test_a_narrow_screen_cuts_no_word_off(
    width: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(fit, "screen", lambda: Screen(width=width, markup=False, emoji=False))
    why = ("curve", "the curve misses displacement by up to 5.0 % of its range, at 60 °C")
    parameter = ParameterSummary(
        unit="degC",
        channel="displacement",
        role="noise",
        median=0.2,
        rhat=1.0012,
        ess_bulk=4000.0,
        ess_tail=3500.0,
    )
    told: dict[str, Any] = {
        "noise": NoiseSummary(name="independent+temperature_error"),
        "parameters": {"displacement_sd": parameter, "temperature_sd": parameter},
        "correlation": {
            "displacement": {"r": Factor(q05=0.9998, median=0.999963, q95=0.9999, undefined=0.0)}
        },
    }
    summary = FitSummary(
        schema="sma-bayes/fit/1", campaign="wire", seed=0,
        records=(record("100MPa-cooling", **told), record("100MPa-heating", why, **told)),
        converged=True, adequate=False, figures="none", stages_s={}, stages_cpu_s={},
        workers=Workers(where="", lost=()), wall_s=1.0,
    ).as_json()  # fmt: skip
    fit.show_fit(summary, Path("out"))
    shown = capsys.readouterr().out
    assert "…" not in shown
    rows = [line for line in shown.splitlines() if "100MPa-" in line][:2]
    assert [("yes" in line, "NO" in line) for line in rows] == [(True, False), (True, True)]
    assert ("strain 0.999963 " in shown) is (width == 160)
    assert "displacement_sd" not in shown, "of the noise the prior may tell as much as it likes"
    assert all(
        len(line) <= width for line in shown.splitlines() if not line.startswith(("The curve", "The scatter"))
    )


@pytest.mark.parametrize("kind", SENTENCES)
def test_every_kind_of_reason_has_its_words(kind: str) -> None:
    assert "{records}" in KINDS[kind].subject
    assert remedy(kind, "modified_sigmoid", "independent")
    done = remedy(kind, "auto", "auto")
    assert "auto" not in done, "what was done is not advised"


@pytest.mark.parametrize("length", [10, 30, 45, 60])
def test_the_name_of_a_record_is_never_shortened(length: int) -> None:
    names = fit._columns_beside(["x" * length], 80)
    assert {"record", "converged", "adequate"} <= set(names)
    assert length + fit.OTHER_COLUMN_CHARACTERS * (len(names) - 1) <= 80 or len(names) == 3
    assert fit._columns_beside(["x" * length], 160) == list(fit.COLUMNS)


def drawn(rhat: float, ess: float) -> ParameterSummary:
    return ParameterSummary(unit="N", channel="force", role="span", rhat=rhat, ess_bulk=ess, ess_tail=ess)


def test_the_parameter_that_is_drawn_worst_is_named_among_those_short_of_the_target() -> None:
    """One that has reached it is no reason: R-hat 1.000 and 5286 draws were told of a real record."""
    reached, short = drawn(1.0, 5286.0), drawn(1.03, 400.0)
    assert fit._slowest([record("a-heating", parameters={"A1": reached})]) == ""
    told = fit._slowest([record("a-heating", parameters={"A1": reached, "A2": short})])
    assert told == "worst is A2 of a-heating (R-hat 1.030, 400 effective draws); "
    wide = reached.model_copy(update={"sd_error": 0.057, "quantile_error": 0.04})
    told = fit._slowest([record("a-heating", parameters={"A1": reached, "A3": wide})])
    assert told == "worst is A3 of a-heating (sd to 5.7 %); "
