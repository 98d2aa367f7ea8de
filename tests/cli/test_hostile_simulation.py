"""Fits, profiles and questions that are damaged, mixed up or beyond belief: status 2 and one message."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

GOOD = "time_s,current_A\n0,1.1\n20,0.7\n60,0\n90,0\n"
QUESTIONS = (
    ("simulate", "{fit}", "--reach", "force=3 N", "--draws", 60),
    ("sensitivity", "{fit}", "--jobs", 1),
)


@pytest.fixture
def profile(tmp_path: Path) -> Path:
    path = tmp_path / "profile.csv"
    path.write_text(GOOD, encoding="utf-8")
    return path


@pytest.fixture
def copied(heated_fit: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(heated_fit, tmp_path / "fit"))


def refused(run: Callable[..., Any], *call: object) -> str:
    """The one message of a call that must be refused."""
    outcome = run(*call)
    assert (outcome.status, outcome.out) == (2, ""), outcome
    assert "Traceback" not in outcome.err
    assert outcome.err.count("error: ") + outcome.err.count("Error: ") == 1
    assert len(outcome.err) < 7000
    return str(outcome.err)


PROFILES = {
    "nan": (GOOD.replace("0.7", "nan"), "column 'current_A': found 'nan'"),
    "infinite": (GOOD.replace("0.7", "inf"), "profile.csv"),
    "no number": (GOOD.replace("0.7", "=cmd()"), "column 'current_A'"),
    "huge": (GOOD.replace("0.7", "1e308"), "at most 1e+09 A"),
    "a later time": (GOOD.replace("90,", "1e300,"), "at most 20000"),
    "the same time twice": (GOOD.replace("60,", "20,"), "rise from row to row"),
    "a unit": (GOOD.replace("current_A", "current_9**9**9**9 A"), "no current"),
    "another quantity": (GOOD.replace("current_A", "current_N"), "no current"),
    "two currents": ("time_s,current_A,current_mA\n0,1,1\n9,0,0\n", "both a current"),
    "a single row": ("time_s,current_A\n0,1\n", "a single row"),
    "a header": ("time_s,current_A\n", "profile.csv"),
    "nothing": ("", "profile.csv"),
    "null characters": ("\0" * 4000, "profile.csv"),
    "100,001 rows": ("time_s,current_A\n" + "".join(f"{i},0\n" for i in range(100_001)), "at most 100000"),
    "a cold room": ("time_s,current_A,ambient_temperature_C\n0,1,20\n9,0,-300\n", "above absolute zero"),
    "a hot room": ("time_s,current_A,ambient_temperature_C\n0,1,20\n9,0,1e300\n", "at most 1e+06 degC"),
}  # fmt: skip


@pytest.mark.parametrize("what", PROFILES)
def test_a_profile(run: Callable[..., Any], heated_fit: Path, tmp_path: Path, what: str) -> None:
    text, told = PROFILES[what]
    path, out = tmp_path / "profile.csv", tmp_path / "out"
    path.write_text(text, encoding="utf-8")
    assert told in refused(run, "simulate", heated_fit, "--current", path, "--out", out)
    assert not out.exists()


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (("--reach", "force=9**9**9**9 N"), "exponents that no unit has"),
        (("--reach", "force=1e308 N"), "1e308"),
        (("--reach", "force=nan N"), "nan"),
        (("--reach", "force=3 N", "--tolerance", "9**9**9**9 N"), "exponents that no unit has"),
        (("--reach", "force=3 N", "--tolerance", "-5 %"), "-5 %"),
        (("--reach", "force=3 N", "--tolerance", "1e400 N"), "1e400"),
        (("--reach", "force=3 N", "--probability", "nan"), "probability nan"),
        (("--reach", "force=3 N", "--ambient", "1e300 degC"), "up to 1e+50"),
        (("--reach", "force=3 N", "--ambient", "1e40 degC"), "out of range"),
        (("--reach", "force=3 N", "--ambient", "9**9**9**9 degC"), "exponents that no unit has"),
        (("--reach", "force=3 N", "--start", "heating:1e300 degC"), "up to 1e+50"),
        (("--reach", "force=3 N", "--start", "cold", "--start", "cold"), "differ"),
        (("--reach", "force=3 N", "--condition", "x" * 5000), "unknown condition"),
        (("--current", "x" * 5000), "File name too long"),
        (("--current", "/dev/null"), "/dev/null"),
        (("--current", "."), "error"),
    ],
)
def test_a_question(
    run: Callable[..., Any], heated_fit: Path, tmp_path: Path, options: tuple[str, ...], told: str
) -> None:
    assert told in refused(run, "simulate", heated_fit, "--out", tmp_path / "out", *options)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (("--at", "9**9**9**9 degC"), "exponents that no unit has"),
        (("--at", "1e300 degC"), "up to 1e+50"),
        (("--at", "nan degC"), "nan"),
        (("--seed", str(2**64)), "--seed"),
    ],
)
def test_a_question_of_sensitivity(
    run: Callable[..., Any], heated_fit: Path, tmp_path: Path, options: tuple[str, ...], told: str
) -> None:
    assert told in refused(run, "sensitivity", heated_fit, "--out", tmp_path / "out", *options)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (("--share", "nan"), "--share nan"),
        (("--share", "1e300"), "--share 1e+300"),
        (("--probability", "nan"), "--probability nan"),
        (("--ahead", "9" * 30), "ahead"),
    ],
)
def test_a_question_of_cycles(
    run: Callable[..., Any], measured: Path, tmp_path: Path, options: tuple[str, ...], told: str
) -> None:
    assert told in refused(run, "cycles", measured, "--out", tmp_path / "out", *options)
    assert not (tmp_path / "out").exists()


def swap_draws(fit: Path) -> None:
    one, other = (fit / "posterior" / f"1.0A-{branch}.nc" for branch in ("heating", "cooling"))
    held = one.read_bytes()
    one.write_bytes(other.read_bytes())
    other.write_bytes(held)


def change_summary(fit: Path) -> None:
    path = fit / "summary.json"
    summary = json.loads(path.read_text(encoding="utf-8"))
    summary["records"][0]["n"] += 1
    path.write_text(json.dumps(summary), encoding="utf-8")


def nest_summary(fit: Path) -> None:
    (fit / "summary.json").write_text("[" * 100_000 + "]" * 100_000, encoding="utf-8")


def flip_a_byte(fit: Path) -> None:
    path = fit / "posterior" / "1.2A-cooling.nc"
    held = bytearray(path.read_bytes())
    held[len(held) // 2] ^= 255
    path.write_bytes(held)


@pytest.mark.parametrize("question", QUESTIONS, ids=lambda q: q[0])
@pytest.mark.parametrize(
    ("damage", "told"),
    [
        (swap_draws, "is not the posterior that summary.json tells of"),
        (change_summary, "does not have the checksum"),
        (nest_summary, "too deep inside each other"),
        (flip_a_byte, "1.2A-cooling.nc"),
    ],
    ids=lambda d: getattr(d, "__name__", ""),
)
def test_a_fit_that_was_changed(
    run: Callable[..., Any],
    copied: Path,
    tmp_path: Path,
    question: tuple[object, ...],
    damage: Callable[[Path], None],
    told: str,
) -> None:
    damage(copied)
    given = [str(a).format(fit=copied) for a in question]
    assert told in refused(run, *given, "--out", tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("question", QUESTIONS, ids=lambda q: q[0])
def test_results_that_were_changed_are_not_shown(
    run: Callable[..., Any], heated_fit: Path, tmp_path: Path, question: tuple[object, ...]
) -> None:
    out = tmp_path / "out"
    given = [str(a).format(fit=heated_fit) for a in question]
    assert run(*given, "--out", out, "--no-figures").status == 0
    document = next(p for p in out.glob("*.json") if p.name != "run.json")
    found = json.loads(document.read_text(encoding="utf-8"))
    found["seed"] = 12345
    document.write_text(json.dumps(found), encoding="utf-8")
    assert "does not have the checksum" in refused(run, "report", out)
    assert "does not have the checksum" in refused(run, *given, "--out", out, "--resume")
