"""Numbers that a formula made: what a newcomer tries first is told as such, in words and without a warning."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.special import expit

UP = np.linspace(25.0, 95.0, 40)


def sigmoid(midpoint: float, low: float, high: float) -> np.ndarray:
    return low + (high - low) * expit(0.15 * (UP - midpoint))


def table(path: Path, columns: dict[str, np.ndarray]) -> Path:
    rows = zip(*columns.values(), strict=True)
    lines = [",".join(columns), *(",".join(repr(float(v)) for v in row) for row in rows)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


@pytest.mark.parametrize("kind", ["sigmoid", "step"])
def test_a_computed_curve_is_told_as_such_with_all_figures(run: Callable, kind: str, tmp_path: Path) -> None:
    force = sigmoid(65.0, 2.0, 7.0) if kind == "sigmoid" else np.where(UP < 60.0, 2.0, 7.0)
    source = table(tmp_path / "curve.csv", {"temperature (degC)": UP, "force (N)": force})
    found = run("fit", source, "--out", tmp_path / "out", "--jobs", "1", "--figures", "all")
    assert found.status == 1  # least squares tells all: draws at the rounding of the arithmetic need not mix
    assert "it was computed, not measured" in " ".join(found.err.split() + found.out.split())
    (record,) = json.loads((tmp_path / "out" / "summary.json").read_text())["records"]
    assert record["why"][0]["kind"] == "exact"
    assert not record["adequate"]
    assert record["log_likelihood_evaluations"] < 60_000  # millions, before
