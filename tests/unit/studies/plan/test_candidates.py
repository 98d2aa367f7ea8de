"""Candidate experiments: grids, files, and what is refused."""

from __future__ import annotations

from pathlib import Path

import pytest

from sma_bayes.errors import QuantityError, SmaBayesError, StudyError
from sma_bayes.studies.plan.asked import parse_asked
from sma_bayes.studies.plan.candidates import (
    MAX_CANDIDATES,
    CandidateExperiment,
    Setting,
    declared,
    default_grid,
    hours_of,
    marked,
    rate_of,
)

BENCH = Setting("a", 30.0, 70.0, 0.05, 60, 1.5, "degC", False)
FAST = Setting("b", 30.0, 80.0, 0.2, 50, 3.0, "degC", False)
SETTINGS = {"a": BENCH, "b": FAST}


def test_a_grid_stays_within_what_was_measured() -> None:
    grid = marked(default_grid([BENCH, FAST], 50.0, 0.5, None), SETTINGS)
    assert not any(c.beyond for c in grid)
    assert {c.rate for c in grid if c.condition == "a"} == {0.05, 0.2}
    assert (30.0, 52.0) in {(c.lowest, c.peak) for c in grid if c.condition == "a"}
    assert all(
        c.hours == pytest.approx(0.5 + c.cycles * 2 * (c.peak - c.lowest) / c.rate / 3600) for c in grid
    )


def test_what_lies_beyond_is_marked() -> None:
    def of(**changed: float) -> tuple[str, ...]:
        values = {"lowest": 30.0, "peak": 70.0, "rate": 0.05, "load": 1.5} | changed
        c = CandidateExperiment(condition="a", cycles=1, samples=10, setup=0.0, **values)
        return marked([c], SETTINGS)[0].beyond

    assert of() == ()
    assert of(peak=75.0) == ("hotter than measured",)
    assert of(lowest=20.0, rate=0.01) == ("colder than measured", "slower than measured")
    assert of(load=6.0, rate=0.5) == ("faster than measured", "load beyond those measured")


@pytest.mark.parametrize(
    ("text", "rate"), [("3 K/min", 0.05), ("3 degC/min", 0.05), ("5.4 degF/min", 0.05), ("0.1K/s", 0.1)]
)
def test_rates_are_read(text: str, rate: float) -> None:
    assert rate_of(text, "degC") == pytest.approx(rate)


@pytest.mark.parametrize("text", ["3", "3 K", "-1 K/min", "3 K/m", "3 N/min"])
def test_what_is_no_rate_is_refused(text: str) -> None:
    with pytest.raises(QuantityError) as caught:
        rate_of(text, "degC")
    assert "2 K/min" in str(caught.value)


def test_times_are_read() -> None:
    assert hours_of("90 min", "setup") == pytest.approx(1.5)
    with pytest.raises(QuantityError):
        hours_of("90", "setup")


def _file(place: Path, text: str) -> Path:
    path = place / "candidates.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_file_gives_all_combinations(tmp_path: Path) -> None:
    path = _file(
        tmp_path,
        '[[candidate]]\nname = "upper"\ncondition = ["a", "b"]\nlowest = "40 degC"\npeak = ["60 degC", "158 degF"]\n'
        'cycles = [1, 5]\nsetup = "30 min"\n[[candidate]]\nrate = "1 K/min"\nsamples = 30\nload = "153 g"\n',
    )
    found = declared(path, SETTINGS, ["a"], 0.25, None)
    assert len(found) == 9
    assert sorted({round(c.peak, 6) for c in found[:8]}) == [60.0, 70.0]
    assert {c.setup for c in found[:8]} == {0.5}
    last = found[-1]
    assert (last.condition, last.lowest, last.peak, last.samples, last.setup) == ("a", 30.0, 70.0, 30, 0.25)
    assert last.load == pytest.approx(1.5004, rel=1e-4)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("", "candidate"),
        ('[[candidate]]\npeek = "60 degC"\n', "did you mean 'peak'"),
        ("[[candidate]]\npeak = 60\n", "candidate 1.peak"),
        ('[[candidate]]\npeak = "60"\n', "has no unit"),
        ('[[candidate]]\nlowest = "65 degC"\npeak = "60 degC"\n', "lowest below peak"),
        ('[[candidate]]\ncondition = "c"\n', "unknown condition 'c'"),
        ("[[candidate]]\ncycles = 0\n", "greater than or equal to 1"),
        (
            f"[[candidate]]\ncycles = {list(range(1, MAX_CANDIDATES + 3))}\n",
            f"more than {MAX_CANDIDATES} candidates",
        ),
        ("[[candidate\n", "not valid TOML"),
    ],
)
def test_a_file_that_is_wrong_is_refused_with_its_key(tmp_path: Path, text: str, told: str) -> None:
    path = _file(tmp_path, text)
    with pytest.raises(StudyError) as caught:
        declared(path, SETTINGS, ["a"], 0.0, None)
    assert str(path) in str(caught.value)
    assert told in str(caught.value)


@pytest.mark.parametrize(
    "text", ["stiffness", "stiffness@", "stifness@60degC", "tell apart", "parameters@60degC", ""]
)
def test_what_has_no_form_is_refused_with_the_forms(text: str) -> None:
    with pytest.raises(SmaBayesError) as caught:
        parse_asked(text)
    for form in ("stiffness@60degC", "parameters", "tell-apart"):
        assert form in str(caught.value)
