"""The command that measures: a row for each run, and mistakes told before anything is measured."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from benchmark.rows import read_rows
from typer.testing import CliRunner, Result

Measure = Callable[..., Result]


@pytest.fixture
def measure(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Measure:
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "XLA_FLAGS"):
        monkeypatch.setenv(name, "")  # importing the script sets them; they are put back
    import benchmark_samplers

    def run(*options: str) -> Result:
        out = ["run", "--out", str(tmp_path / "rows.csv")]
        return CliRunner().invoke(benchmark_samplers.app, [*out, *options])

    return run


def test_a_run_is_a_row(measure: Measure, tmp_path: Path) -> None:
    options = ("--records", "1A-10mHz-heating", "--points", "40", "--samplers", "sma_bayes", "--limit", "20")
    result = measure(*options)
    assert result.exit_code == 0, result.output
    (row,) = read_rows(tmp_path / "rows.csv")
    assert (row.sampler, row.ended, row.reached, row.points) == ("sma_bayes", "target", True, 40)
    assert row.share_errors < 4.0
    assert (tmp_path / "rows-machine.json").exists()


@pytest.mark.parametrize(
    ("option", "wrong"), [("--samplers", "sma_bays"), ("--records", "9A-heating")], ids=["sampler", "record"]
)
def test_what_is_not_there_is_named(measure: Measure, option: str, wrong: str, tmp_path: Path) -> None:
    result = measure(option, wrong, *(("--samplers", "sma_bayes") if option == "--records" else ()))
    assert result.exit_code == 2
    assert wrong in result.output
    assert not (tmp_path / "rows.csv").exists()


def test_a_cold_run_is_not_unaided(measure: Measure, tmp_path: Path) -> None:
    result = measure("--samplers", "sma_bayes", "--cold", "--unaided")
    assert result.exit_code == 2
    assert "choose one" in result.output
    assert not (tmp_path / "rows.csv").exists()
