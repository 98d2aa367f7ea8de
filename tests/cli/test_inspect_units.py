"""Units in square brackets must reach the reader, not be taken for markup."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
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


def test_inspect_shows_declared_units_and_stores_si(tmp_path: Path) -> None:
    t = np.linspace(68.0, 176.0, 40)
    x = 23.0 / (1.0 + np.exp(-0.2 * (t - 120.0))) + 0.1 * np.sin(7.0 * t)
    rows = "\n".join(f"{a:.3f},{b:.5f},1.96" for a, b in zip(t, x, strict=True))
    (tmp_path / "run.csv").write_text(f"T,X,F\n{rows}\n", encoding="utf-8")
    (tmp_path / "campaign.toml").write_text(
        "[columns]\n"
        'temperature = { name = "T", unit = "degF" }\n'
        'displacement = { name = "X", unit = "mm" }\n'
        'force = { name = "F", unit = "N" }\n'
        '[[condition]]\nid = "1A"\nfile = "run.csv"\n',
        encoding="utf-8",
    )
    call = ["inspect", str(tmp_path / "campaign.toml")]
    shown = CliRunner().invoke(command_line(), call, env={"COLUMNS": "200"}).stdout
    assert "68 to 176 °F" in shown
    assert "displacement [mm]" in shown
    (record,) = json.loads(CliRunner().invoke(command_line(), [*call, "--json"]).stdout)["records"]
    assert record["temperature"]["highest"] == pytest.approx(80.0)
    assert record["channels"]["displacement"]["unit"] == "m"


def test_what_is_serious_comes_first_and_notes_last(tmp_path: Path) -> None:
    """Of 13 records of a wire in water, what made the numbers worthless stood below 40 lines about rows."""
    t = np.concatenate([np.linspace(293.15, 353.15, 40), np.linspace(353.15, 293.15, 40)])
    force = 1.0 / (1.0 + np.exp(-0.4 * (t - 323.15))) + 0.01 * np.sin(7.0 * np.arange(80))
    rows = [f"{a:.3f},{b:.5f}" for a, b in zip(t, force, strict=True)]
    data = tmp_path / "run.csv"
    data.write_text(
        "\n".join(["temperature_C,force_N", *rows[:10], rows[9], *rows[10:]]) + "\n", encoding="utf-8"
    )
    shown = CliRunner().invoke(command_line(), ["inspect", str(data)]).stdout
    assert shown.index("SERIOUS: kelvin") < shown.index("duplicate") < shown.index("recognised")
