"""A campaign in which everything that an effect may need was recorded and varied."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import pytest
from scipy.special import expit

from sma_bayes.arrays import Floats
from sma_bayes.effects.types import Response
from sma_bayes.records.history import History, histories
from sma_bayes.records.types import Branch, Campaign, Condition, Record
from sma_bayes.response.simulation import Simulation

CHANNELS = ("force", "displacement", "stiffness", "temperature")
HEATING = (0.03, 0.25, 60.0, 0.01, 2.0, 0.22, 64.0, 1.0)
COOLING = (0.03, 0.30, 48.0, 0.01, 2.0, 0.27, 52.0, 1.0)
THERMAL = (2.0, 0.1, 22.0, 1.0)
THETA = np.array([*HEATING, *COOLING, *THERMAL])
"""A1 to A4, B1 to B4 of both branches; gain, loss, ambient and switching of the Joule-heating balance."""
SAMPLES = 40
UNITS = {
    "temperature": "degC",
    "time": "s",
    "current": "A",
    "ambient_temperature": "degC",
    "cycle": "1",
    "force": "N",
    "displacement": "m",
    "stiffness": "N/m",
}


def response_at(theta: Floats) -> Response:
    """Response of the simulation at fixed parameters."""
    simulation = Simulation(CHANNELS)
    return lambda inputs: simulation.predict(theta, inputs)


def sweep(peak: float, seconds: float, rising: bool) -> tuple[Floats, Floats]:
    """Time and temperature of a sweep that slows towards its end."""
    t = np.linspace(0.0, 1.0, SAMPLES, endpoint=False)
    rise = 1.0 - (1.0 - t) ** 2
    return seconds * t, 25.0 + (peak - 25.0) * (rise if rising else 1.0 - rise)


def condition(number: int, cycles: int = 3) -> list[Record]:
    """Records of both branches of a condition."""
    loads, peaks = (1.0, 1.5, 2.0), (110.0, 95.0, 75.0)
    parts: dict[Branch, list[dict[str, Floats]]] = {b: [] for b in Branch}
    clock, row = 0.0, 1
    for cycle in range(cycles):
        for branch in Branch:
            heating = branch is Branch.HEATING
            seconds = (20.0 + 15.0 * number) * (1.0 + 0.4 * cycle)
            t, temperature = sweep(peaks[cycle % 3], seconds, heating)
            time = clock + t
            parts[branch].append(
                {
                    "time": time,
                    "temperature": temperature,
                    "current": np.full(SAMPLES, 2.0 if heating else 0.0),
                    "ambient_temperature": 22.0 + 2.0 * np.sin(time / 90.0),
                    "cycle": np.full(SAMPLES, cycle + 1.0),
                    "segment": np.full(SAMPLES, float(cycle)),
                    "row": np.arange(row, row + SAMPLES, dtype=float),
                }
            )
            clock, row = clock + seconds, row + SAMPLES
    what = Condition(f"load-{number}", load=loads[number], frequency=1.0 / 40.0)
    return [_record(what, branch, parts[branch], 0.02 * number) for branch in Branch]


def _record(what: Condition, branch: Branch, parts: Sequence[Mapping[str, Floats]], pull: float) -> Record:
    inputs = {name: np.concatenate([p[name] for p in parts]) for name in parts[0]}
    row = inputs.pop("row").astype(np.int64)
    sign = np.full(row.size, 1.0 if branch is Branch.HEATING else -1.0)
    out = Simulation(CHANNELS[:3]).predict(THETA[:16], {**inputs, "branch": sign})
    observed = {**out, "displacement": out["displacement"] + pull}
    return Record(what, branch, inputs, observed, row, UNITS, source=what.id)


@pytest.fixture(scope="session")
def measured() -> tuple[History, ...]:
    """Three conditions of three cycles each: loads, rates, peaks and ambient temperature vary."""
    records = tuple(r for number in range(3) for r in condition(number))
    found = histories(Campaign("synthetic", "", "", records))
    return tuple(h.of(CHANNELS, share=share_of(h)) for h in found)


def share_of(history: History) -> Floats:
    """Share of austenite along a history."""
    (_, a2, a3, *_), (_, c2, c3, *_) = HEATING, COOLING
    t = history.inputs["temperature"]
    return expit(np.where(history.inputs["branch"] > 0.0, a2 * (t - a3), c2 * (t - c3)))


def with_force(measured: Sequence[History], change: object) -> tuple[History, ...]:
    """The same with another force."""
    return tuple(
        replace(h, observed={**h.observed, "force": change(h.observed["force"])})  # type: ignore[operator]
        for h in measured
    )


@pytest.fixture(scope="session")
def suited(measured: tuple[History, ...]) -> Mapping[str, tuple[History, ...]]:
    """Histories on which each effect can be tested, by its id where `measured` does not do."""
    return {
        "saturation": with_force(measured, lambda f: np.minimum(f, 2.6)),
        "quantisation": with_force(measured, lambda f: 0.1 * np.round(f / 0.1)),
    }
