"""`sma-bayes compare` as a pipeline sees it."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory, make_sweep: Callable[..., list[str]]) -> Path:
    place = tmp_path_factory.mktemp("compare")
    # one branch of a specimen: what is force of a spring is stress there
    rows = [",".join(line.split(",")[:3]) for line in make_sweep(branches=1)]
    text = "\n".join(rows).replace("force_N", "stress_MPa")
    (place / "run.csv").write_text(text + "\n", encoding="utf-8")
    return place


def test_a_comparison_from_a_file_to_a_verdict(run: Callable[..., object], folder: Path) -> None:
    out = folder / "out"
    call = ("compare", folder / "run.csv", "--out", out, "--jobs", 1, "--no-figures")
    first = run(*call)
    assert first.status == 0, first.err  # type: ignore[attr-defined]
    assert "\nstress, 1 record together: CANNOT TELL" in first.out  # type: ignore[attr-defined]
    assert first.out.count("are the same curve of this channel") == 1  # type: ignore[attr-defined]
    assert run("report", out).status == 0  # type: ignore[attr-defined]
    page = (out / "report.html").read_text(encoding="utf-8")
    assert page.count("are the same curve of this channel") == 1
    stored = json.loads((out / "comparison.json").read_text(encoding="utf-8"))
    again = run(*call)
    assert again.status == 2  # type: ignore[attr-defined]
    assert "holds this run already" in again.err  # type: ignore[attr-defined]
    resumed = run(*call, "--resume", "--json")
    assert resumed.status == 0  # type: ignore[attr-defined]
    assert json.loads(resumed.out) == stored  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--noise", "ar3"), "did you mean 'ar1'"),
        (("--pool", "campaign"), "no two conditions of one branch"),
        (("--pool", "rig"), "'none' or 'campaign'"),
        (("--priors", "logistics"), "no priors are called 'logistics'"),
        (("--priors", "logistic"), "no parameter is called 'K_min'"),
    ],
)
def test_a_wrong_call_is_refused_before_anything_is_written(
    run: Callable[..., object], folder: Path, tmp_path: Path, arguments: tuple[str, str], said: str
) -> None:
    found = run("compare", folder / "run.csv", "--out", tmp_path / "out", *arguments)
    assert found.status == 2  # type: ignore[attr-defined]
    assert said in found.err  # type: ignore[attr-defined]
    assert not (tmp_path / "out").exists()


def test_too_few_samples_are_refused(
    run: Callable[..., object], tmp_path: Path, make_sweep: Callable[..., list[str]]
) -> None:
    (tmp_path / "short.csv").write_text("\n".join(make_sweep(6, branches=1)) + "\n", encoding="utf-8")
    found = run("compare", tmp_path / "short.csv", "--out", tmp_path / "out")
    assert found.status == 2  # type: ignore[attr-defined]
    assert not (tmp_path / "out").exists()
