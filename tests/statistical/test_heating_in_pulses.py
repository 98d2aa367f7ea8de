"""The study of the heat balance on the commonest test: on and off, again and again, holds left out."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import sma_bayes

pytestmark = pytest.mark.slow

GAIN, LOSS, ROOM = 2.2, 0.118, 22.0
NOISE = 0.05


def _pulsed(place: Path, lag: float, seed: int) -> Path:
    """Two conditions of five pulses, 35 s on and 45 s off; the metal and its sensor, exact for steps of 1 s."""
    rng = np.random.default_rng(seed)
    place.mkdir()
    toml = []
    for j, current in enumerate((2.0, 1.9)):
        steps = np.arange(400)
        power = np.where(steps % 80 < 35, current, 0.0)
        metal, sensor, lines = ROOM, ROOM, ["time_s,current_A,temperature_C,displacement_mm"]
        for t, amps in zip(steps, power, strict=True):
            read = sensor + NOISE * rng.standard_normal()
            moved = 18.0 / (1.0 + np.exp(-0.33 * (metal - (61.0 if amps else 49.0))))
            lines.append(f"{t},{amps},{read:.3f},{moved + 0.02 * rng.standard_normal():.3f}")
            end = ROOM + GAIN * amps**2 / LOSS
            fades, follows = np.exp(-LOSS), np.exp(-1.0 / lag) if lag else 0.0
            apart = (metal - end) / (1.0 - LOSS * lag)  # of the sensor, what fades as slowly as the metal
            sensor = end + apart * fades + (sensor - end - apart) * follows
            metal = end + (metal - end) * fades
        (place / f"r{j}.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
        toml.append(f'[[condition]]\nid = "r{j}"\nfile = "r{j}.csv"\n')
    (place / "campaign.toml").write_text("\n".join(toml), encoding="utf-8")
    return place


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_heating_without_fault_is_none(seed: int, tmp_path: Path) -> None:
    """Each has a false alarm in 2 %, by the limit of the p-value."""
    found = sma_bayes.study_gap(
        sma_bayes.read_campaign(_pulsed(tmp_path / "bench", 0.0, seed)),
        pool="campaign",
        jobs=1,
        figures=False,
    )["heating"]
    assert found["verdict"] == "none"
    assert not found["effects"]
    assert found["gap"]["before"] < 1.3


@pytest.mark.parametrize("lag", [0.4, 1.5])
def test_a_sensor_that_lags_is_named_with_its_time_constant(lag: float, tmp_path: Path) -> None:
    """Its 98 % interval, widened from the 90 % one as that of a normal distribution, holds the truth."""
    found = sma_bayes.study_gap(
        sma_bayes.read_campaign(_pulsed(tmp_path / "bench", lag, 4)), pool="campaign", jobs=1, figures=False
    )["heating"]
    assert [e["id"] for e in found["effects"]] == ["thermocouple_lag"]
    assert found["converged"]
    tau = found["effects"][0]["parameters"]["tau"]
    assert abs(tau["median"] - lag) < 2.33 / 3.29 * (tau["q95"] - tau["q05"])
    assert found["gap"]["after"] < 1.3
