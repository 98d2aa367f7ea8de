"""The guide to moduli: its command and its Python run on the export that it speaks of."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
GUIDE = ROOT / "docs" / "howto" / "fit_a_modulus.md"


@pytest.fixture
def bench(tmp_path: Path) -> Path:
    """Folder with the export: one heating at 1 and at 10 Hz, the transition 4 K later at the latter."""
    rng = np.random.default_rng(6)
    lines = ["Temperature,Storage modulus,Loss modulus,Frequency", "°C,MPa,MPa,Hz"]
    for t in np.linspace(0.0, 110.0, 56):
        for f, middle in ((1.0, 50.0), (10.0, 54.0)):
            s = 1.0 / (1.0 + np.exp(-0.25 * (t - middle)))
            storage = 28e3 + 38e3 * s + 250.0 * rng.standard_normal()
            loss = 700.0 - 300.0 * s + 6000.0 * s * (1.0 - s) + 25.0 * rng.standard_normal()
            lines.append(f"{t:.3f},{storage:.6g},{loss:.6g},{f:g}")
    (tmp_path / "strip.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return tmp_path


def test_command_and_python_say_what_they_promise(
    bench: Path, command: Callable[..., str], python: Callable[[Path, str], str]
) -> None:
    blocks = dict(
        re.findall(r"^```(\w+)\n(.*?)^```", GUIDE.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)
    )
    command(bench, blocks["console"])
    found = json.loads((bench / "moduli" / "modulus.json").read_text(encoding="utf-8"))
    assert [s["frequency"] for s in found["sweeps"]] == [1.0, 10.0]
    shift = next(s for s in found["shifts"] if s["temperature"] == "midpoint")
    assert shift["shift"]["q05"] < 4.0 < shift["shift"]["q95"]
    assert {v["at"] for s in found["sweeps"] for v in s["values"]} == {20.0, 80.0}
    assert (bench / "moduli" / "report.html").is_file()
    assert python(bench, blocks["python"]).splitlines() == [
        f"{s['branch']} {s['statement']}" for s in found["shifts"]
    ]
