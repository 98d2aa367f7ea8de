"""What one temperature gives: all records in one table, and what is to be said of some of them once below it."""

from __future__ import annotations

from typing import Any

import pytest

from sma_bayes.report.screen import Screen
from sma_bayes.studies.ask import terminal
from sma_bayes.studies.ask.terminal import show_values_at


def answer(key: str, temperatures: tuple[float, ...] = (60.0,), **more: Any) -> dict[str, Any]:
    condition, _, branch = key.rpartition("-")
    nothing: list[float | None] = [None] * len(temperatures)
    beyond = more.get("extrapolated", [False])[0]
    told: list[float | None] = nothing if beyond else [2.5] * len(temperatures)
    force = {
        "name": "force", "unit": "N", "median": told, "low": told, "high": told,
        "pred_median": told, "pred_low": told, "pred_high": told,
    }  # fmt: skip
    return {
        "key": key, "condition": condition, "branch": branch, "converged": True, "adequate": True,
        "temperature_unit": "degC", "temperature": list(temperatures), "measured": [20.0, 90.0],
        "extrapolated": [False] * len(temperatures), "quantities": {"force": force}, "caution": None, **more,
    }  # fmt: skip


def document(*answers: dict[str, Any]) -> dict[str, Any]:
    return {
        "schema": "sma-bayes/ask-at/1", "campaign": "bench", "at": ["60 degC"], "probability": 0.9,
        "temperature_sd": 0.0, "extrapolate": 0.0, "converged": True, "seed": 0, "data_sha256": None,
        "answers": list(answers),
    }  # fmt: skip


@pytest.fixture(autouse=True)
def wide(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(terminal, "screen", lambda: Screen(width=160, markup=False, emoji=False))


def test_records_at_one_temperature_share_a_table(capsys: pytest.CaptureFixture[str]) -> None:
    slope = "stiffness is the slope along the path"
    show_values_at(
        document(
            answer("a-heating", caution=slope),
            answer("a-cooling", adequate=False, caution=slope),
            answer("b-heating", converged=False, extrapolated=[True]),
        )
    )
    shown = capsys.readouterr().out
    assert "bench: median and 90 % credible interval" in shown
    assert shown.count("force F [N]") == 1
    assert "at 60 °C" in shown
    rows = [line for line in shown.splitlines() if "20 to 90" in line]
    assert len(rows) == 3
    assert "b-heating *" in rows[2]
    assert "2.5" not in rows[2]
    assert "NOT CONVERGED, these numbers must not be relied on (fit again; what helps: " in shown
    assert "another `--seed`): b-heating" in shown
    assert "NOT ADEQUATE, curve and noise do not describe the data: a-cooling" in shown
    assert f"caution: a-heating, a-cooling: {slope}" in shown
    assert "* not measured there; --extrapolate" in shown


def test_several_temperatures_have_a_table_for_each_record(capsys: pytest.CaptureFixture[str]) -> None:
    show_values_at(document(answer("a-heating", (50.0, 60.0)), answer("a-cooling", (50.0, 60.0))))
    shown = capsys.readouterr().out
    assert shown.count("force F [N]") == 2
    assert "a-cooling, measured from 20 to 90 °C" in shown


def test_median_and_interval_have_the_same_decimals(capsys: pytest.CaptureFixture[str]) -> None:
    """Four digits each gave "15.11 (14.17 to 16)" and "0.107 (0.08604 to 0.1311)"."""
    told = {"median": [15.11], "low": [14.17], "high": [16.001]}
    force = {"name": "force", "unit": "N", **told, **{f"pred_{name}": v for name, v in told.items()}}
    show_values_at(document(answer("a-heating", quantities={"force": force})))
    shown = capsys.readouterr().out
    assert "15.11 (14.17 to 16.00)" in shown
    assert "  (14.17 to 16.00)" in shown
