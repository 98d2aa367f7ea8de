"""The guide to the next measurement: its commands, its file and its Python run on a bench of its shape."""

from __future__ import annotations

import re
import shlex
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
GUIDE = (ROOT / "docs" / "howto" / "plan_a_measurement.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory, command: Callable[..., str]) -> Path:
    """A folder with the campaign `bench`, three cycles of a spring that trains, and its fit."""
    place = tmp_path_factory.mktemp("guide")
    rng, clock = np.random.default_rng(1), 0.0
    lines = ["time_s,temperature_C,force_N,displacement_mm"]
    up = np.linspace(30.0, 70.0, 30)
    for cycle in range(3):
        for branch, middle in ((up, 52.0), (up[::-1], 46.0)):
            for t in branch:
                clock += 20.0
                phase = 1.0 / (1.0 + np.exp(-0.35 * (t - middle)))
                force = 0.5 + 2.5 * phase + 0.02 * rng.standard_normal()
                stroke = 1.0 + 20.0 / (1.0 + np.exp(-0.3 * (t - middle + 4.0))) + 0.4 * cycle
                lines.append(f"{clock:g},{t:.4f},{force:.6g},{stroke + 0.1 * rng.standard_normal():.6g}")
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
    for line in "".join(blocks("console")).splitlines():
        verb = shlex.split(line)[1]
        told = command(bench, line, *(["--no-figures"] if verb == "gap" else []))
        assert verb == "gap" or "Measure condition a" in told or "apart already" in told
    for name in ("plan.json", "candidates.csv", "report.html", "figures", "tables"):
        assert (bench / "plan" / name).exists(), name


def test_its_file_of_candidates_is_one(bench: Path, command: Callable[..., str]) -> None:
    (text,) = blocks("toml")
    (bench / "candidates.toml").write_text(text, encoding="utf-8")
    told = command(bench, "sma-bayes plan results --for parameters --candidates candidates.toml")
    assert "hotter than measured" in told
    assert "best of 5 candidates" in told


def test_its_python_runs(bench: Path, python: Callable[[Path, str], str]) -> None:
    (script,) = blocks("python")
    said = python(bench, script)
    assert said.startswith("Measure condition a from ")
    assert len(said.splitlines()) == 6


@pytest.mark.parametrize(("hours", "remarked"), [(6, True), (2, False)])
def test_many_more_cycles_than_were_measured_are_remarked(
    bench: Path, command: Callable[..., str], hours: int, remarked: bool
) -> None:
    out = f"plan-of-{hours}"
    call = f"sma-bayes plan results --for parameters --hours {hours} --out {out}"
    told = " ".join(command(bench, call).split())
    found = re.search(
        r"(\d+) cycles of condition a, after 3 that were measured: .* it may train or tire", told
    )
    assert bool(found) is remarked
    page = (bench / out / "report.html").read_text(encoding="utf-8")
    assert ("look with <code>cycles</code> or <code>watch</code>" in page) is remarked
    if found:
        assert int(found[1]) > 10
        few, of_them, all_nats = re.search(
            r"(\d+) of them would bring ([\d.]+) of ([\d.]+) nats", told
        ).groups()
        assert int(few) < int(found[1])
        assert int(few) / int(found[1]) < float(of_them) / float(all_nats) < 1.0  # the first tell most
