"""What a run says and leaves: exit status, silence, JSON, schemas, whole files."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from sma_bayes import cli
from sma_bayes.sampling.convergence import Target
from sma_bayes.sampling.ensembles import Plan
from sma_bayes.studies.fit import tasks as fit_tasks, workflow as campaign_fit

Run = Callable[..., Any]


def process(*arguments: object, cwd: Path) -> subprocess.CompletedProcess[str]:
    """Call the command line in a process of its own, as a pipeline does."""
    command = [sys.executable, "-m", "sma_bayes", *map(str, arguments)]
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, timeout=240, check=False)


def hidden(folder: Path) -> list[str]:
    return [str(p) for p in folder.rglob(".*")]


def test_json_is_all_that_is_printed_and_what_the_summary_holds(
    run: Run, measured: Path, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    outcome = run("fit", measured, "--out", out, "--no-figures", "--json", "--jobs", 1)
    assert (outcome.status, outcome.err) == (0, "")
    document = json.loads(outcome.out)
    assert document == json.loads((out / "summary.json").read_text(encoding="utf-8"))
    assert document["schema"] == "sma-bayes/fit/1"
    assert document["converged"] is True
    assert [r["key"] for r in document["records"]] == ["run-heating", "run-cooling"]
    for path in out.rglob("*.json"):
        assert re.fullmatch(r"sma-bayes/\w+/\d+", json.loads(path.read_text(encoding="utf-8"))["schema"])
    assert hidden(out) == []


def test_inspect_prints_one_json_document(run: Run, measured: Path) -> None:
    outcome = run("inspect", measured, "--json")
    assert (outcome.status, outcome.err) == (0, "")
    assert json.loads(outcome.out)["schema"] == "sma-bayes/inspect/1"
    assert run("inspect", measured, "--quiet").out == ""


def test_a_run_that_does_not_converge_ends_with_1_and_says_so(
    run: Run, measured: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    hopeless = Plan(target=Target(1.0 + 1e-9, 1e9), evaluations=1, explore_block=20)
    monkeypatch.setattr(campaign_fit, "plan_with", lambda _: hopeless)
    out = tmp_path / "out"
    outcome = run("fit", measured, "--out", out, "--no-figures", "--jobs", 1)
    assert outcome.status == 1
    assert "error" not in outcome.err  # lines of progress only, where it takes half a minute
    assert "NOT CONVERGED: run-heating, run-cooling" in outcome.out
    assert re.search(
        r"worst is \w+ of run-\w+ \(R-hat [\d.]+, \d+ effective draws, .*sd to [\d.]+ %\); what helps: ",
        outcome.out,
    )
    summary = json.loads((out / "summary.json").read_text(encoding="utf-8"))
    assert summary["converged"] is False
    assert [r["converged"] for r in summary["records"]] == [False, False]


def test_strict_makes_an_inadequate_fit_the_exit_status(run: Run, measured: Path, tmp_path: Path) -> None:
    """Samples that are counted as fewer than they are give no density of the data: converged, never adequate."""
    call = (
        "fit",
        measured,
        "--out",
        tmp_path / "out",
        "--noise",
        "effective_samples",
        "--no-figures",
        "--jobs",
        1,
    )
    outcome = run(*call, "--strict")
    assert (outcome.status, outcome.err) == (1, "")
    assert "The fit does not describe the data of run-heating, run-cooling" in " ".join(outcome.out.split())
    assert "leave out `--noise effective_samples`" in outcome.out
    summary = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))
    assert (summary["converged"], summary["adequate"]) == (True, False)
    assert run(*call, "--resume").status == 0, (
        "without --strict only convergence counts, and it is the same run"
    )


def test_strict_lets_an_adequate_fit_pass(run: Run, measured: Path, tmp_path: Path) -> None:
    outcome = run("fit", measured, "--out", tmp_path / "out", "--no-figures", "--strict", "--jobs", 1)
    assert outcome.status == 0
    assert "does not describe" not in outcome.out
    assert "adequate" in outcome.out


def test_one_branch_is_fitted_and_said(
    run: Run, make_sweep: Callable[..., list[str]], tmp_path: Path
) -> None:
    path = tmp_path / "up.csv"
    path.write_text("\n".join(make_sweep(branches=1)) + "\n", encoding="utf-8")
    outcome = run("fit", path, "--out", tmp_path / "out", "--no-figures", "--jobs", 1)
    assert outcome.status == 0
    assert "up: there is a heating branch only" in outcome.out
    assert [p.name for p in (tmp_path / "out" / "posterior").iterdir()] == ["up-heating.nc"]


def test_quiet_is_silent_and_a_pipe_gets_no_escape_codes(
    make_sweep: Callable[..., list[str]], tmp_path: Path
) -> None:
    """From another folder, by relative paths with blanks in them, on two processes."""
    folder = tmp_path / "a folder"
    folder.mkdir()
    (folder / "run 1.csv").write_text("\n".join(make_sweep()) + "\n", encoding="utf-8")
    quiet = process("fit", "run 1.csv", "--out", "the results", "--no-figures", "--quiet", cwd=folder)
    assert (quiet.returncode, quiet.stdout, quiet.stderr) == (0, "", "")
    assert {p.name for p in (folder / "the results" / "posterior").iterdir()} == {
        "run 1-heating.nc", "run 1-cooling.nc"
    }  # fmt: skip
    told = process("fit", "run 1.csv", "--out", "the results", "--no-figures", "--resume", cwd=folder)
    assert (told.returncode, told.stderr) == (0, "")
    assert "run 1-heating" in told.stdout
    assert "\x1b" not in told.stdout
    assert "\r" not in told.stdout


def test_priors_go_through_a_pipe_and_back(measured: Path, tmp_path: Path) -> None:
    printed = process("priors", cwd=tmp_path)
    assert (printed.returncode, printed.stderr) == (0, "")
    (tmp_path / "p.toml").write_text(printed.stdout, encoding="utf-8")
    done = process(
        "fit", measured, "--out", "o", "--priors", "p.toml", "--no-figures", "--quiet", cwd=tmp_path
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert (tmp_path / "o" / "priors.toml").read_text(encoding="utf-8") == printed.stdout


@pytest.mark.parametrize(
    ("verb", "work", "advice"),
    [
        ("fit", "sma_bayes.studies.fit.tasks.fit_records", "with --resume goes on from here"),
        (
            "gap",
            "sma_bayes.studies.gap.workflow.gap_outcome",
            "with --resume begins the study anew, or draws",
        ),
        (
            "compare",
            "sma_bayes.studies.compare.workflow.finished_comparison",
            "with --resume begins anew, or draws",
        ),
    ],
)
def test_an_interruption_ends_with_130_and_says_how_to_go_on(
    measured: Path, tmp_path: Path, verb: str, work: str, advice: str
) -> None:
    module, _, name = work.rpartition(".")
    program = (
        "import os, signal\nfrom sma_bayes.__main__ import main\n"
        f"import {module} as module\n"
        f"module.{name} = lambda *_, **__: os.kill(os.getpid(), signal.SIGINT)\nmain()"
    )
    given = [verb, str(measured), "--out", str(tmp_path / "out"), "--jobs", "1"]
    outcome = subprocess.run(
        [sys.executable, "-c", program, *given], capture_output=True, text=True, timeout=240, check=False
    )
    assert (outcome.returncode, outcome.stdout) == (130, "")
    assert outcome.stderr.startswith("interrupted; the same command")
    assert advice in outcome.stderr
    assert not (tmp_path / "out").exists(), "nothing was done, so nothing is left"


def test_a_mistake_of_the_package_is_not_taken_for_a_run_that_did_not_converge(
    run: Run, measured: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object, **__: object) -> None:
        raise ZeroDivisionError("planted")

    monkeypatch.setattr(fit_tasks, "fit_records", fail)
    outcome = run("fit", measured, "--out", tmp_path / "out", "--jobs", 1)
    assert outcome.status == cli.MISTAKE == 70
    assert "ZeroDivisionError: planted" in outcome.err
    assert outcome.err.splitlines()[-1].startswith("error: this is a mistake in sma_bayes, please")


def test_a_campaign_folder_by_a_relative_path(
    make_campaign: Callable[..., Path], tmp_path: Path, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    make_campaign(tmp_path / "bench 7")
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    by_folder = run("inspect", Path("..") / "bench 7", "--json")
    by_file = run("inspect", os.path.join("..", "bench 7", "campaign.toml"), "--json")
    assert by_folder.status == by_file.status == 0
    assert by_folder.out == by_file.out
    assert json.loads(by_folder.out)["campaign"] == "bench"
