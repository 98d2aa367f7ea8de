"""The guide to cycles: its command and its Python run on the campaign that it speaks of."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
GUIDE = ROOT / "docs" / "howto" / "follow_cycles.md"


@pytest.fixture
def bench(tmp_path: Path, training_spring: ModuleType) -> Path:
    """Folder that holds the campaign `bench`: six cycles of one spring."""
    truth = training_spring.draw_truth(np.random.default_rng(2), 6)
    records = training_spring.measured(truth, np.random.default_rng(3), ("force", "displacement"))
    lines, time = ["time_s,temperature_C,force_N,displacement_mm"], 0
    for cycle in range(1, 7):
        for record in records:
            for i in np.flatnonzero(record.inputs["cycle"] == cycle):
                time += 1
                force, stroke = (record.observed[c][i] for c in ("force", "displacement"))
                lines.append(f"{time},{record.temperature[i]:.4f},{force:.6g},{1000.0 * stroke:.6g}")
    folder = tmp_path / "bench"
    folder.mkdir()
    (folder / "2A.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    (folder / "campaign.toml").write_text('[[condition]]\nid = "2A"\nfile = "2A.csv"\n', encoding="utf-8")
    return tmp_path


def test_command_and_python_say_what_they_promise(
    bench: Path, command: Callable[..., str], python: Callable[[Path, str], str]
) -> None:
    blocks = dict(
        re.findall(r"^```(\w+)\n(.*?)^```", GUIDE.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)
    )
    command(bench, blocks["console"])
    (one,) = json.loads((bench / "cycles" / "cycles.json").read_text(encoding="utf-8"))["conditions"]
    assert one["measured"] == [1, 2, 3, 4, 5, 6]
    assert one["law"]["chosen"] != "none"
    assert {q["at"] for q in one["quantities"] if q["name"] == "stiffness"} == {60.0}
    assert (bench / "cycles" / "report.html").is_file()
    assert python(bench, blocks["python"]).splitlines() == [
        f"2A {one['law']['reason']}",
        one["stable"]["statement"],
    ]
