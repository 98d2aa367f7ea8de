"""Units in square brackets must reach the reader, not be taken for markup."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from typer.testing import CliRunner

from sma_bayes.cli import command_line


def test_inspect_shows_units(tmp_path: Path, published: Callable[[str], Any]) -> None:
    t = np.linspace(20.0, 80.0, 40)
    force = 1.0 / (1.0 + np.exp(-0.4 * (t - 50.0))) + 0.01 * np.sin(7.0 * t)
    rows = "\n".join(f"{a:.3f},{b:.5f}" for a, b in zip(t, force, strict=True))
    data = tmp_path / "run.csv"
    data.write_text(f"temperature_C,force_N\n{rows}\n", encoding="utf-8")
    shown = CliRunner().invoke(command_line(), ["inspect", str(data)])
    assert shown.exit_code == 0
    assert "force [N]" in shown.stdout
    told = CliRunner().invoke(command_line(), ["inspect", str(data), "--json"])
    published("inspect").validate(json.loads(told.stdout))
