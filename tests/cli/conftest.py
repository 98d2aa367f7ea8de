"""The command line as a pipeline sees it: exit status, standard output, standard error, what is left on the disk."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sma_bayes import cli

HEADER = "time_s,temperature_C,force_N,displacement_mm"


@dataclass(frozen=True)
class Outcome:
    """What a call of the command line gave."""

    status: int
    out: str
    err: str


def call(capture: pytest.CaptureFixture[str], patch: pytest.MonkeyPatch, *arguments: object) -> Outcome:
    """Call the command line as the installed program does."""
    patch.setattr(sys, "argv", ["sma-bayes", *map(str, arguments)])
    capture.readouterr()
    status: object = 0
    try:
        cli.main()
    except SystemExit as end:
        status = end.code or 0
    assert isinstance(status, int)
    return Outcome(status, *capture.readouterr())


@pytest.fixture
def run(
    capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, declared: Callable[[Any], None]
) -> Callable[..., Outcome]:
    """Call the command line in this process; workers' output is seen, too.

    Whatever a verb prints as JSON, and every document in the folder that it names with --out, must be as declared.
    """

    def called(*arguments: object) -> Outcome:
        outcome = call(capfd, monkeypatch, *arguments)
        if "--json" in arguments and outcome.status in (0, 1):
            declared(json.loads(outcome.out))
        if "--out" in arguments and outcome.status in (0, 1):
            _check_folder(Path(str(arguments[arguments.index("--out") + 1])), declared)
        return outcome

    return called


MARK = "sma-bayes/run/1"
"""Schema of the mark of a folder: what a run was asked, which no program reads but the same verb."""


def _check_folder(folder: Path, declared: Callable[[Any], None]) -> None:
    for path in folder.rglob("*.json"):
        found = json.loads(path.read_text(encoding="utf-8"))
        if path.name not in OTHER_PROGRAMS and found.get("schema") != MARK:
            declared(found)


OTHER_PROGRAMS = {"simcoon.json", "sma_react.json"}
"""Written in the formats of the programs that read them."""


def sweep(n: int = 40, *, branches: int = 2, seed: int = 0) -> list[str]:
    """Lines of a CSV: a spring that is heated and cooled."""
    rng = np.random.default_rng(seed)
    up = np.linspace(30.0, 70.0, n)
    temperature = np.concatenate([up, up[::-1]])[: branches * n]
    force = 0.5 + 2.5 / (1.0 + np.exp(-0.35 * (temperature - 52.0)))
    stroke = 1.0 + 20.0 / (1.0 + np.exp(-0.30 * (temperature - 48.0)))
    rows = zip(
        np.arange(temperature.size),
        temperature,
        force + 0.02 * rng.standard_normal(force.size),
        stroke + 0.1 * rng.standard_normal(stroke.size),
        strict=True,
    )
    return [HEADER, *(",".join(f"{v:.6g}" for v in row) for row in rows)]


def write(path: Path, lines: Sequence[str]) -> Path:
    """Write lines to a file, its folder included."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


CAMPAIGN = """\
[campaign]
name = "bench"
[columns]
time = { name = "time_s", unit = "s" }
temperature = { name = "temperature_C", unit = "degC" }
force = { name = "force_N", unit = "N" }
displacement = { name = "displacement_mm", unit = "mm" }
[[condition]]
id = "a"
file = "a.csv"
"""


@pytest.fixture
def measured(tmp_path: Path) -> Path:
    """A good data file."""
    return write(tmp_path / "run.csv", sweep())


@pytest.fixture(scope="session")
def make_campaign() -> Callable[..., Path]:
    """Write a campaign folder, with changes to its declaration."""

    def make(folder: Path, *changes: tuple[str, str], text: str = CAMPAIGN) -> Path:
        for old, new in changes:
            assert old in text, "the change must change something"
            text = text.replace(old, new)
        write(folder / "a.csv", sweep())
        (folder / "campaign.toml").write_text(text, encoding="utf-8")
        return folder

    return make


@pytest.fixture(scope="session")
def make_sweep() -> Callable[..., list[str]]:
    """Lines of a good data file, see `sweep`."""
    return sweep
