"""A thermometer that is off as a whole: declared in the campaign, carried into temperatures, bands, files and back."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sma_bayes.runs.stored_draws import stored_draws

OFFSET_SD = 1.5
CAMPAIGN = """
[campaign]
name = "rig"

[columns]
time = {{ name = "time_s", unit = "s" }}
temperature = {{ name = "temperature_C", unit = "degC"{more} }}
force = {{ name = "force_N", unit = "N" }}
displacement = {{ name = "displacement_mm", unit = "mm" }}

[[condition]]
id = "a"
file = "a.csv"
"""


def band(folder: Path, channel: str) -> tuple[np.ndarray, np.ndarray]:
    with (folder / "bands" / f"a-heating-{channel}.csv").open() as file:
        rows = list(csv.DictReader(file))
    width = [float(row["q95"]) - float(row["q05"]) for row in rows]
    return np.array([float(row["temperature_degC"]) for row in rows]), np.array(width)


@pytest.fixture
def fitted(
    run: Callable[..., Any], make_sweep: Callable[..., list[str]], tmp_path: Path
) -> Callable[[str, str], tuple[Path, dict[str, Any]]]:
    def fit(name: str, more: str) -> tuple[Path, dict[str, Any]]:
        rig = tmp_path / name
        rig.mkdir()
        (rig / "a.csv").write_text("\n".join(make_sweep(branches=1)), encoding="utf-8")
        (rig / "campaign.toml").write_text(CAMPAIGN.format(more=more), encoding="utf-8")
        out = tmp_path / f"{name}-out"
        outcome = run("fit", rig, "--out", out, "--no-figures", "--quiet", "--jobs", 1)
        assert outcome.status == 0, outcome.err
        return out, json.loads((out / "summary.json").read_text(encoding="utf-8"))["records"][0]

    return fit


def test_an_offset_of_the_thermometer_widens_temperatures_and_what_is_steep(
    fitted: Callable[[str, str], tuple[Path, dict[str, Any]]],
) -> None:
    """Standard deviations of 2,000 draws and their 90 % ranges: within a tenth."""
    exact_folder, exact = fitted("exact", "")
    folder, off = fitted("off", f", offset_sd = {OFFSET_SD}")
    assert exact["calibration"] == {}
    assert off["calibration"] == {
        "temperature": {"relative_scale_sd": 0.0, "offset": 0.0, "offset_sd": OFFSET_SD}
    }
    for name in ("A3", "B3"):
        before, after = (r["parameters"][name]["sd"] for r in (exact, off))
        assert after == pytest.approx(np.hypot(before, OFFSET_SD), rel=0.1)
        assert before < 0.2 * after
    for name in ("A1", "A2", "B1", "B2"):
        assert off["parameters"][name]["sd"] == pytest.approx(exact["parameters"][name]["sd"], rel=1e-6)
    for name in ("As", "Af"):
        before, after = (
            r["transformation"][name]["q95"] - r["transformation"][name]["q05"] for r in (exact, off)
        )
        assert after == pytest.approx(np.hypot(before, 2 * 1.645 * OFFSET_SD), rel=0.15)
    for channel, steepest, slope in (
        ("force", 52.0, 2.5 * 0.35 / 4),
        ("displacement", 48.0, 0.02 * 0.30 / 4),
    ):
        t, before = band(exact_folder, channel)
        _, after = band(folder, channel)
        at = np.argmin(np.abs(t - steepest))
        assert after[at] == pytest.approx(2 * 1.645 * OFFSET_SD * slope, rel=0.2)
        assert after[at] > 5.0 * before[at]
        assert after[0] < 3.0 * before[0]


def test_the_errors_are_read_back_from_the_files(
    fitted: Callable[[str, str], tuple[Path, dict[str, Any]]],
) -> None:
    """Stored parameters hold the same errors of scale and offset as the curves that are drawn again."""
    folder, record = fitted("off", ", offset_sd = 0.7, scale_sd = 0.01")
    (stored,) = stored_draws(folder)
    gain, shift = stored.calibration["temperature"]
    assert gain.std() == pytest.approx(0.01, rel=0.1)
    assert shift.std() == pytest.approx(0.7, rel=0.1)
    assert record["parameters"]["B3"]["sd"] == pytest.approx(np.hypot(0.7, 0.52), rel=0.1)
    assert np.corrcoef(stored.theta[:, 2], 48.0 * gain + shift)[0, 1] > 0.95
    t, width = band(folder, "force")
    again = np.subtract(*np.quantile(stored.curve("force", t), (0.95, 0.05), axis=0))
    np.testing.assert_allclose(again, width, rtol=1e-6)


def test_what_has_no_calibration_is_refused(
    run: Callable[..., Any], make_sweep: Callable[..., list[str]], tmp_path: Path
) -> None:
    (tmp_path / "a.csv").write_text("\n".join(make_sweep()), encoding="utf-8")
    text = CAMPAIGN.format(more="").replace('unit = "s"', 'unit = "s", offset_sd = 1')
    (tmp_path / "campaign.toml").write_text(text, encoding="utf-8")
    outcome = run("inspect", tmp_path)
    assert outcome.status == 2
    assert "scale_sd or offset_sd" in outcome.err
    assert "temperature" in outcome.err
