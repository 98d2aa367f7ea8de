"""What must have been recorded or varied before an effect can show."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from typing import Final

import numpy as np

from sma_bayes.quantities import CHANNELS
from sma_bayes.records.history import History

Test = Callable[[Sequence[History]], str]
"""Why a need is not met; empty where it is."""

LEAST_CYCLES = 3
VARIES = 0.1
"""Least relative difference by which something counts as varied."""


def untestable(needs: Sequence[str], histories: Sequence[History]) -> str:
    """Why an effect with these needs can't be tested on histories; empty if it can.

    Raises
    ------
    UnknownNameError
        If no need has that name.
    """
    return "; ".join(filter(None, (NEEDS[need](histories) for need in needs)))


def _input(name: str, what: str) -> Test:
    return lambda histories: "" if all(name in h.inputs for h in histories) else f"{what} was not recorded"


def _channel(name: str) -> Test:
    return lambda histories: "" if all(name in h.observed for h in histories) else f"{name} was not observed"


def _any_channel(histories: Sequence[History]) -> str:
    return (
        ""
        if all(set(CHANNELS) & set(h.observed) for h in histories)
        else "no mechanical channel was observed"
    )


def _curve(histories: Sequence[History]) -> str:
    seen = all({"force", "displacement"} & set(h.observed) for h in histories)
    return "" if seen else "neither force nor displacement was observed"


def _cycles(histories: Sequence[History]) -> str:
    most = max(np.unique(h.inputs["cycle"]).size for h in histories)
    return "" if most >= LEAST_CYCLES else f"{most} cycle(s) a condition; at least {LEAST_CYCLES} are needed"


def _several(name: str, what: str) -> Test:
    def test(histories: Sequence[History]) -> str:
        if not all(name in h.inputs for h in histories):
            return f"{what} is not known"
        levels = np.array([np.median(h.inputs[name]) for h in histories])
        varied = np.ptp(levels) > VARIES * max(float(np.max(np.abs(levels))), 1e-300)
        return "" if varied else f"{what} was not varied"

    return test


def _several_rates(histories: Sequence[History]) -> str:
    """Rates must differ at the same temperature and on the same branch."""
    if not all("rate" in h.inputs for h in histories):
        return "time was not recorded"
    temperature, rate, branch = (
        np.concatenate([h.inputs[k] for h in histories]) for k in ("temperature", "rate", "branch")
    )
    edges = np.quantile(temperature, np.linspace(0.1, 0.9, 7))
    for sign in (1.0, -1.0):
        for low, high in pairwise(edges.tolist()):
            size = np.abs(rate[(branch == sign) & (temperature >= low) & (temperature <= high)])
            if size.size >= 6:
                slow, fast = np.quantile(size, (0.1, 0.9))
                if fast > 1.3 * slow > 0.0:
                    return ""
    return "the rate dT/dt did not vary at any given temperature"


def _several_peaks(histories: Sequence[History]) -> str:
    peaks = []
    for h in histories:
        for cycle in np.unique(h.inputs["cycle"]):
            peaks.append(float(h.inputs["temperature"][h.inputs["cycle"] == cycle].max()))
    temperature = np.concatenate([h.inputs["temperature"] for h in histories])
    span = float(np.ptp(temperature))
    return "" if np.ptp(peaks) > VARIES * span else "the peak temperature was not varied"


def _both_branches(histories: Sequence[History]) -> str:
    both = all(np.ptp(h.inputs["branch"]) > 0.0 for h in histories)
    return "" if both else "only one branch was measured"


def _ambient_varies(histories: Sequence[History]) -> str:
    if not all("ambient_temperature" in h.inputs for h in histories):
        return "the ambient temperature was not recorded"
    ambient = np.concatenate([h.inputs["ambient_temperature"] for h in histories])
    return "" if np.ptp(ambient) > 0.2 else "the ambient temperature did not vary"


def _lattice(histories: Sequence[History]) -> str:
    from sma_bayes.effects.types import Scales

    return "" if any(Scales.of(histories).step.values()) else "no channel has values on a lattice"


NEEDS: Final[Mapping[str, Test]] = {
    "channel": _any_channel,
    "curve": _curve,
    "force": _channel("force"),
    "displacement": _channel("displacement"),
    "stiffness": _channel("stiffness"),
    "temperature_response": lambda histories: (
        ""
        if all("temperature" in h.observed for h in histories)
        else "current and time were not both recorded"
    ),
    "time": _input("time", "time"),
    "current": _input("current", "current"),
    "load": _input("load", "the load"),
    "frequency": _input("frequency", "the frequency of the drive"),
    "ambient": _input("ambient_temperature", "the ambient temperature"),
    "ambient_varies": _ambient_varies,
    "cycles": _cycles,
    "several_loads": _several("load", "the load"),
    "several_rates": _several_rates,
    "several_peaks": _several_peaks,
    "both_branches": _both_branches,
    "lattice": _lattice,
}
"""Needs that effects may name, each with its test."""
