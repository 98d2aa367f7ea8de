"""The guide to what a number rests on: its commands and its Python run on a bench of its shape."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pytest

from sma_bayes.records.types import Record

ROOT = Path(__file__).resolve().parents[2]
GUIDE = (ROOT / "docs" / "howto" / "find_what_a_number_rests_on.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def bench(
    make_record: Callable[..., Record], tmp_path_factory: pytest.TempPathFactory, command: Callable[..., str]
) -> Path:
    """A folder with the campaign `bench` and its fit."""
    place = tmp_path_factory.mktemp("guide")
    lines = ["time_s,temperature_C,force_N,displacement_mm"]
    for seed, order in ((0, 1), (1, -1)):
        record = make_record(n=60, seed=seed)
        columns = (record.temperature, record.observed["force"], 1e3 * record.observed["displacement"])
        for t, force, path in zip(*(c[::order] for c in columns), strict=True):
            lines.append(f"{len(lines)},{t:.4f},{force:.6g},{path:.6g}")
    (place / "bench").mkdir()
    (place / "bench" / "campaign.toml").write_text(
        '[[condition]]\nid = "a"\nfile = "a.csv"\n', encoding="utf-8"
    )
    (place / "bench" / "a.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    command(place, "sma-bayes fit bench --out results --no-figures --jobs 1 -q")
    return place


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", GUIDE, re.DOTALL | re.MULTILINE)


def test_its_commands_run_and_leave_what_they_promise(bench: Path, command: Callable[..., str]) -> None:
    (commands,) = blocks("console")
    for line in commands.splitlines():
        assert "posterior standard deviations" in command(bench, line)
    for name in ("sensitivity.json", "readings", "report.html", "figures", "tables"):
        assert (bench / "sensitivity" / name).exists(), name


def test_its_python_runs(bench: Path, python: Callable[[Path, str], str]) -> None:
    (script,) = blocks("python")
    assert "The prior decides none of" in python(bench, script).splitlines()[0]
