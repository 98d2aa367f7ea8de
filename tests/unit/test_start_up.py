"""What is imported before it is needed: start-up is felt at every command. Modules are counted, not seconds."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
import typer

from sma_bayes.cli import VerbGroup, command_line
from sma_bayes.studies.registry import VERBS

HEAVY = ("arviz", "arviz_stats", "corner", "dask", "distributed", "emcee", "h5py", "joblib", "matplotlib", "numpy",
         "pandas", "pint", "pydantic", "scipy", "xarray")  # fmt: skip


def imported(code: str, *arguments: str) -> set[str]:
    """Packages that are there after some code has run."""
    told = subprocess.run(
        [sys.executable, "-c", f"{code}\nimport sys\nprint('', *sys.modules, sep='\\n@')", *arguments],
        capture_output=True, text=True, timeout=300, check=True,
    )  # fmt: skip
    return {line[1:].partition(".")[0] for line in told.stdout.splitlines() if line.startswith("@")}


def test_help_and_the_package_itself_import_nothing_heavy() -> None:
    assert not imported("import sma_bayes") & set(HEAVY)
    command = (
        "from typer.testing import CliRunner; from sma_bayes.cli import command_line; "
        "CliRunner().invoke(command_line(), ['--help'])"
    )
    assert not imported(command) & set(HEAVY)


def test_help_makes_no_verb_and_a_verb_makes_only_itself() -> None:
    group = typer.main.get_command(command_line())
    assert isinstance(group, VerbGroup)
    with group.make_context("sma-bayes", ["-h"], resilient_parsing=True) as context:
        shown = group.get_help(context)
        assert all(f"  {verb} " in shown for verb in VERBS)
        assert not group.commands
        assert group.get_command(context, "fit").name == "fit"
        assert set(group.commands) == {"fit"}


def test_what_is_left_at_the_end_is_not_looked_through() -> None:
    code = "import atexit, gc, sys; atexit.register(lambda: print(f'frozen {gc.get_freeze_count()}'))"
    run = f"{code}; sys.argv = ['sma-bayes', '--version']; from sma_bayes.__main__ import main; main()"
    told = subprocess.run(
        [sys.executable, "-c", run], capture_output=True, text=True, timeout=300, check=True
    )
    assert int(told.stdout.partition("frozen")[2]) > 10_000


@pytest.mark.parametrize(
    ("figures", "without"),
    [  # arviz-stats, which diagnoses the draws, brings pandas and xarray with it
        ("none", ("arviz", "corner", "distributed", "joblib", "matplotlib")),
        ("report", ("arviz", "corner", "distributed", "joblib")),
    ],
)
def test_a_fit_imports_only_what_it_uses(
    measured: Path, tmp_path: Path, figures: str, without: tuple[str, ...]
) -> None:
    code = (
        "import sys; from sma_bayes.records.campaign import read_campaign; from sma_bayes import fit_campaign;"
        "fit_campaign(read_campaign(sys.argv[1]), sys.argv[2], figures=sys.argv[3])"
    )
    found = imported(code, str(measured), str(tmp_path / "out"), figures)
    assert {"numpy", "emcee", "h5py"} <= found
    assert not found & set(without)


@pytest.fixture
def measured(tmp_path: Path) -> Path:
    """A file with one heating and one cooling of displacement under a dead weight."""
    import numpy as np

    rng = np.random.default_rng(0)
    up = np.linspace(25.0, 95.0, 60)
    t = np.concatenate([up, up[::-1]])
    middle = np.concatenate([np.full(60, 66.0), np.full(60, 52.0)])
    x = 14.0 + 26.0 / (1.0 + np.exp((t - middle) / 4.0)) + rng.normal(0.0, 0.2, t.size)
    rows = "".join(f"{i * 0.5},{a:.4f},{b:.4f}\n" for i, (a, b) in enumerate(zip(t, x, strict=True)))
    path = tmp_path / "run.csv"
    path.write_text(f"time_s,temperature_C,displacement_mm\n{rows}", encoding="utf-8")
    return path
