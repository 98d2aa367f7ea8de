"""Scores of a fit against a truth, the table of many, and the page that is made of it."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from calibration import page
from calibration.curves import Curve, logistic, two_steps
from calibration.scoring import curve_scores, thirds, true_temperatures
from calibration.summary import QUANTITIES, least_expected, quantities, read_csv, share, table, write_csv
from calibration.trials import Trial, attempt, collected, read, to_do
from calibration.truths import TRUTHS
from scipy.stats import binom
from typer.testing import CliRunner

from sma_bayes.assess.bands import Band

NOWHERE = Path("no such folder")


@pytest.fixture(scope="module")
def line() -> dict[str, Any]:
    return attempt(Trial("white", 3), NOWHERE)


def band(low: float, high: float) -> Band:
    """A band of constant ends over 0 to 3 degC, the last temperature extrapolated."""
    t = np.linspace(0.0, 3.0, 31)
    flat = {
        name: np.full(t.size, value)
        for name, value in (("q05", low), ("q50", 0.5 * (low + high)), ("q95", high))
    }
    whole = {"sim90_low": np.full(t.size, low - 0.1), "sim90_high": np.full(t.size, high + 0.1)}
    return Band("force", "N", t, flat, whole, {}, t > 2.95, False)


def test_coverage_is_the_share_of_the_range_inside() -> None:
    """T runs from 0 to 2.9 where measured; a band of 0.95 to 2.05 holds 11 of 30 values, most of the middle third."""
    found = curve_scores(band(0.95, 2.05), Curve(lambda t: t, np.ones_like))
    assert found["pointwise"] == pytest.approx(11 / 30)
    assert found["cold"] == pytest.approx(0.0)
    assert found["middle"] == pytest.approx(1.0)
    assert found["hot"] == pytest.approx(1 / 10)
    assert found["simultaneous"] is False
    assert found["width"] == pytest.approx(1.1 / 2.9)


def test_a_band_that_holds_the_whole_curve_is_told() -> None:
    found = curve_scores(band(0.05, 2.85), Curve(lambda t: t, np.ones_like))
    assert found["simultaneous"] is True
    assert found["pointwise"] == pytest.approx(28 / 30)


def test_thirds_are_of_the_range_not_of_the_samples() -> None:
    t = np.array([0.0, 0.1, 0.2, 0.9, 1.1, 2.1, 3.0])
    assert [int(at.sum()) for at in thirds(t).values()] == [4, 1, 2]


def test_an_attempt_scores_everything_that_is_asked(line: dict[str, Any]) -> None:
    assert set(line["curve"]) == {"force", "displacement", "stiffness"}
    assert set(line["readings"]) == {"force", "displacement"}
    assert set(line["temperatures"]) in ({"As", "Af"}, {"Ms", "Mf"})
    assert {"A1", "A2", "A3", "A4", "B1", "B2", "B3", "B4"} <= set(line["nearest"])
    assert all(v is not None for v in quantities(line).values())
    json.dumps(line)


def test_an_attempt_is_the_same_again(line: dict[str, Any]) -> None:
    again = attempt(Trial("white", 3), NOWHERE)
    assert {**again, "seconds": 0} == {**line, "seconds": 0}


def test_stiffness_that_follows_is_not_counted_with_what_was_measured(line: dict[str, Any]) -> None:
    wrong = json.loads(json.dumps(line))
    wrong["curve"]["stiffness"]["pointwise"] = 0.0
    assert quantities(wrong)["pointwise"] == quantities(line)["pointwise"]
    assert quantities(wrong)["stiffness"] == 0.0


def test_the_standard_error_is_that_of_the_scatter() -> None:
    rng = np.random.default_rng(0)
    x = rng.binomial(1, 0.9, (2000, 50)).astype(float)
    means, errors = np.array([share(list(r)) for r in x]).T
    assert means.std() == pytest.approx(np.mean(errors), rel=0.1)
    assert share([1.0] * 50)[1] == pytest.approx(0.3 / np.sqrt(50))


def test_least_expected_is_undershot_as_rarely_as_stated() -> None:
    for n, p in ((20, 0.01), (24, 0.00125), (200, 0.05)):
        assert binom.cdf(least_expected(n, p) - 1, n, 0.9) < p


def test_a_table_survives_its_file(line: dict[str, Any], tmp_path: Path) -> None:
    failed = {k: line[k] for k in ("truth", "repeat", "model", "noise", "seconds")} | {"failed": "no"}
    rows = table([line, line, failed])
    assert rows[0]["repeats"] == 3
    assert rows[0]["failed"] == 1
    write_csv(rows, tmp_path / "table.csv")
    (again,) = read_csv(tmp_path / "table.csv")
    assert all(again[q] == pytest.approx(rows[0][q], rel=1e-3) for q in QUANTITIES)
    assert again["noises"] == rows[0]["noises"]


def test_the_page_marks_what_is_not_reached(line: dict[str, Any], tmp_path: Path) -> None:
    row = table([line])[0]
    row |= (
        {q: 0.9 for q in QUANTITIES} | {f"{q}_se": 0.02 for q in QUANTITIES} | {"start": 0.5, "finish": 0.84}
    )
    text = page.generated([row])
    assert "**50 ± 2**" in text
    assert "**84 ± 2**" in text
    assert "- published curve, white noise: As or Mf 50 %" in text  # 84 % may be chance
    assert "8 of 10 shares" in text


def test_the_page_is_replaced_between_its_marks(line: dict[str, Any], tmp_path: Path) -> None:
    for folder in ("data", "explanation"):
        (tmp_path / folder).mkdir()
    written = tmp_path / "explanation" / "calibration.md"
    written.write_text(f"before\n{page.BEGIN}\nwhat was there\n{page.END}\nafter\n", encoding="utf-8")
    page.write_page([line], tmp_path)
    first = written.read_text(encoding="utf-8")
    page.write_page([line], tmp_path)
    assert written.read_text(encoding="utf-8") == first
    assert "what was there" not in first
    assert first.startswith("before")
    assert first.endswith("after\n")
    with pytest.raises(ValueError, match="begin: measured"):
        page.replaced("no marks", "part")


def test_a_run_goes_on_where_it_stopped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import measure_calibration

    monkeypatch.setattr(measure_calibration, "KEPT", tmp_path / "kept.jsonl.gz")
    out = tmp_path / "lines.jsonl"
    arguments = ["run", "--out", str(out), "--truths", "white", "--jobs", "1"]
    assert CliRunner().invoke(measure_calibration.app, [*arguments, "--repeats", "1"]).exit_code == 0
    with out.open("a") as file:
        file.write('{"truth": "white", "rep')  # cut off
    assert to_do([Trial("white", 0), Trial("white", 1)], read(out)) == [Trial("white", 1)]
    result = CliRunner().invoke(measure_calibration.app, [*arguments, "--repeats", "2"])
    assert result.exit_code == 0
    assert "1 of 2 to do" in result.output
    assert [r["repeat"] for r in read(out)] == [0, 1]
    shown = CliRunner().invoke(measure_calibration.app, ["show", str(out)])
    assert "white" in shown.output


def test_what_the_page_kept_is_taken_up_by_a_later_run(
    line: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import measure_calibration

    docs = tmp_path / "docs"
    for folder in ("data", "explanation"):
        (docs / folder).mkdir(parents=True)
    (docs / "explanation" / "calibration.md").write_text(f"{page.BEGIN}\n{page.END}\n", encoding="utf-8")
    kept, first, second = docs / "data" / "calibration.jsonl.gz", tmp_path / "1.jsonl", tmp_path / "2.jsonl"
    monkeypatch.setattr(measure_calibration, "ROOT", tmp_path)
    monkeypatch.setattr(measure_calibration, "KEPT", kept)
    first.write_text(json.dumps(line) + "\n", encoding="utf-8")
    assert CliRunner().invoke(measure_calibration.app, ["page", str(first)]).exit_code == 0
    assert list(read(kept)) == [line]
    run = ["run", "--truths", "white", "--jobs", "1", "--repeats", "4", "--out", str(second)]
    other = line | {"repeat": 2, "code": "0123456789ab"}
    second.write_text(
        "".join(json.dumps(x) + "\n" for x in (line | {"repeat": 0}, line | {"repeat": 1}, other)),
        encoding="utf-8",
    )
    accepted = CliRunner().invoke(measure_calibration.app, [*run, "--accept", "0123456789ab"])
    assert "0 of 4 to do" in accepted.output
    plain = CliRunner().invoke(measure_calibration.app, run)
    assert "1 results of code 0123456789ab don't count" in plain.output
    assert "1 of 4 to do" in plain.output
    assert CliRunner().invoke(measure_calibration.app, ["page", str(second)]).exit_code == 0
    assert [x["repeat"] for x in read(kept)] == [0, 1, 2, 3]
    assert {x["code"] for x in read(kept)} == {line["code"]}
    before = kept.read_bytes()
    assert CliRunner().invoke(measure_calibration.app, ["page", str(second)]).exit_code == 0
    assert kept.read_bytes() == before


def test_the_present_code_counts_before_what_is_accepted(line: dict[str, Any], tmp_path: Path) -> None:
    old = line | {"code": "0123456789ab", "seconds": 0.0}
    files = [tmp_path / "old.jsonl", tmp_path / "new.jsonl"]
    for file, content in zip(files, (old, line), strict=True):
        file.write_text(json.dumps(content) + "\n", encoding="utf-8")
    assert collected(files, ["0123456789ab"]) == ([line], {})
    assert collected(files) == ([line], {"0123456789ab": 1})
    assert collected(files[:1], ["0123456789ab"]) == ([old], {})


@pytest.mark.parametrize("truths", ["whit", "white,", ""])
def test_an_unknown_truth_is_refused_before_anything_is_done(truths: str, tmp_path: Path) -> None:
    import measure_calibration

    out = tmp_path / "lines.jsonl"
    result = CliRunner().invoke(measure_calibration.app, ["run", "--out", str(out), "--truths", truths])
    assert result.exit_code == 2
    assert not out.exists()


def test_temperatures_that_depend_on_what_nobody_measured_are_not_judged() -> None:
    """A sweep that ends in a second step: as a phase with a slope, or level from there, the finish lies elsewhere."""
    case = TRUTHS["white"].make(0, np.random.default_rng(0), Path("no real data"))
    record = case.record
    middle, width = float(np.median(record.temperature)), float(np.ptp(record.temperature))
    last = two_steps(0.02, 0.4, middle, 0.001, 0.15, 0.48 * width, 1.0)
    whole = logistic(0.02, 0.4, middle, 0.001)
    for curve, told in ((last, (True, False)), (whole, (True, True))):
        real = replace(case, curves={"displacement": curve}, beyond=False)
        assert tuple(np.isfinite(true_temperatures(real, "displacement"))) == told
        known = replace(real, beyond=True)
        assert np.isfinite(true_temperatures(known, "displacement")).all()
    seen = true_temperatures(replace(case, curves={"displacement": whole}, beyond=False), "displacement")
    np.testing.assert_allclose(seen, (middle - 2.0 / 0.4, middle + 2.0 / 0.4), atol=0.05)
