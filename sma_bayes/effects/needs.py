"""What must have been recorded or varied before an effect can show."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Final

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.catalogue import Catalogue
from sma_bayes.effects.types import Effect, Scales
from sma_bayes.normal import MAD_TO_SD
from sma_bayes.quantities import CHANNELS
from sma_bayes.records.history import History

OF_HEATING: Final = frozenset({"temperature_response", "outcome"})
"""Needs of effects that act in the heat balance, where temperature is an outcome."""

Test = Callable[[Sequence[History]], str]
"""Why a need is not met; empty where it is."""

LEAST_CYCLES = 3
LEAST_RUNS = 3
MAX_RANDOM_EFFECTS = 24
"""Greatest number of runs, or of cycles of all conditions, that get numbers of their own."""
LEAST_RELATIVE_VARIATION = 0.1
"""Least relative difference by which something counts as varied."""
LEAST_REVERSALS = 2
LONG_RECORD = 300.0
"""Length of record from which on the heat of the alloy can have reached a load cell [s]."""
LEAST_CUT_OFF_READINGS = 10
"""Readings at the end of a range by which it is seen."""
MAX_CUT_OFF_RANGE = 0.3
"""Range of these, over the noise from reading to reading, up to which they count as cut off."""
MAX_PLATEAU_CHANGE = 0.05
"""Greatest change over a tenth of the temperatures on a plateau, in spans."""


def untestable(needs: Sequence[str], histories: Sequence[History]) -> str:
    """Why an effect with these needs can't be tested on histories; empty if it can.

    Raises
    ------
    UnknownNameError
        If no need has that name.
    """
    return "; ".join(dict.fromkeys(filter(None, (NEEDS[need](histories) for need in needs))))


def of_response(effects: Mapping[str, Effect]) -> dict[str, Effect]:
    """Effects that act on force, displacement and stiffness at a given temperature."""
    return {name: e for name, e in effects.items() if "temperature_response" not in e.needs}


def of_heating(effects: Mapping[str, Effect]) -> dict[str, Effect]:
    """Effects that act on the temperature that a current makes; those of the thermometer are among both."""
    return {name: e for name, e in effects.items() if OF_HEATING & set(e.needs)}


def _input(name: str, what: str) -> Test:
    return lambda histories: "" if all(name in h.inputs for h in histories) else f"{what} was not recorded"


def _channel(name: str) -> Test:
    def test(histories: Sequence[History]) -> str:
        if all(name in h.observed for h in histories):
            return ""
        held = any(name in h.held for h in histories)
        return f"{name} was kept constant by the rig" if held else f"{name} was not observed"

    return test


def _any_channel(histories: Sequence[History]) -> str:
    return (
        ""
        if all(set(CHANNELS) & set(h.observed) for h in histories)
        else "no mechanical channel was observed"
    )


def _any_outcome(histories: Sequence[History]) -> str:
    """What a thermometer does shows in mechanical channels, and in the temperature itself where it is an outcome."""
    return "" if all("temperature" in h.observed for h in histories) else _any_channel(histories)


def _share(histories: Sequence[History]) -> str:
    return (
        "" if all("share" in h.inputs for h in histories) else "neither force nor displacement was observed"
    )


def _curve(histories: Sequence[History]) -> str:
    seen = all({"force", "displacement"} & set(h.observed) for h in histories)
    return "" if seen else "neither force nor displacement was observed"


def _cycles(histories: Sequence[History]) -> str:
    most = max(np.unique(h.inputs["cycle"]).size for h in histories)
    return "" if most >= LEAST_CYCLES else f"{most} cycle(s) a condition; at least {LEAST_CYCLES} are needed"


def _members(group: str, what: str, least: int) -> Test:
    """Enough members to scatter, and not more than can have numbers of their own."""

    def test(histories: Sequence[History]) -> str:
        count = np.unique(np.concatenate([h.inputs[group] for h in histories])).size
        if count < least:
            return f"{count} {what}(s); at least {least} are needed"
        return (
            ""
            if count <= MAX_RANDOM_EFFECTS
            else f"{count} {what}s; no more than {MAX_RANDOM_EFFECTS} get numbers of their own"
        )

    return test


def _several(name: str, what: str) -> Test:
    def test(histories: Sequence[History]) -> str:
        if not all(name in h.inputs for h in histories):
            return f"{what} is not known"
        levels = np.array([np.median(h.inputs[name]) for h in histories])
        varied = np.ptp(levels) > LEAST_RELATIVE_VARIATION * max(float(np.max(np.abs(levels))), 1e-300)
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
    return "" if np.ptp(peaks) > LEAST_RELATIVE_VARIATION * span else "the peak temperature was not varied"


def _both_branches(histories: Sequence[History]) -> str:
    both = any(np.ptp(h.inputs["branch"]) > 0.0 for h in histories)
    return "" if both else "only one branch was measured"


def _ambient_varies(histories: Sequence[History]) -> str:
    if not all("ambient_temperature" in h.inputs for h in histories):
        return "the ambient temperature was not recorded"
    ambient = np.concatenate([h.inputs["ambient_temperature"] for h in histories])
    return "" if np.ptp(ambient) > 0.2 else "the ambient temperature did not vary"


def _lattice(histories: Sequence[History]) -> str:
    """Of the channel that a converter's steps act on: force, or displacement where there is no force."""
    step = Scales.of(histories).step
    channel = next((c for c in ("force", "displacement") if c in step), None)
    return "" if channel and step[channel] else "neither force nor displacement has values on a lattice"


def _reversals(histories: Sequence[History]) -> str:
    turns = sum(
        np.count_nonzero((np.diff(h.inputs["branch"]) != 0) & (np.diff(h.inputs["stretch"]) == 0))
        for h in histories
    )
    return (
        ""
        if turns >= LEAST_REVERSALS
        else f"{turns} reversal(s) without a break; {LEAST_REVERSALS} are needed"
    )


def _warming_cell(histories: Sequence[History]) -> str:
    """Heat takes minutes to reach a load cell, unless the room itself warms."""
    if not _ambient_varies(histories):
        return ""
    if not all("time" in h.inputs for h in histories):
        return "neither time nor a changing ambient temperature was recorded"
    longest = max(float(np.ptp(h.inputs["time"])) for h in histories)
    return "" if longest >= LONG_RECORD else f"ambient did not vary and the record is short ({longest:.3g} s)"


def _ends(history: History, branch: float) -> Iterator[tuple[Floats, Floats]]:
    """Displacement in the outermost part of a branch and beside it, cold end first."""
    temperature = history.inputs["temperature"]
    low, span = float(temperature.min()), float(np.ptp(temperature))
    place = (temperature - low) / max(span, 1e-300)
    on, x = history.inputs["branch"] == branch, history.observed["displacement"]
    for depth in (place, 1.0 - place):
        yield x[on & (depth < 0.05)], x[on & (depth >= 0.1) & (depth < 0.15)]


def _plateaus(histories: Sequence[History]) -> str:
    """At one end of the temperatures at least, the displacement no longer transforms."""
    if why := _channel("displacement")(histories):
        return why
    for h in histories:
        span = float(np.ptp(h.observed["displacement"]))
        for branch in (1.0, -1.0):
            for outer, inner in _ends(h, branch):
                flat = (
                    outer.size
                    and inner.size
                    and abs(np.median(outer) - np.median(inner)) < MAX_PLATEAU_CHANGE * span
                )
                if flat:
                    return ""
    return "no plateau of the displacement was reached"


def _flat_tops(histories: Sequence[History]) -> str:
    """The greatest force, of whichever sign, occurs again and again, or nearly so, as noise after the limit makes it.

    Of the highest hundredth of all readings noise would leave the lowest about a standard deviation below the highest.
    """
    if why := _channel("force")(histories):
        return why
    pull = Scales.of(histories).direction("force")
    force = pull * np.concatenate([h.observed["force"] for h in histories])
    _, count = np.unique(force, return_counts=True)
    usual = float(np.quantile(count[:-1], 0.99)) if count.size > 1 else 0.0
    below = force < 0.5 * (force.min() + force.max())
    bends = np.diff(force, 2)[below[1:-1] & below[2:] & below[:-2]]
    noise = MAD_TO_SD * float(np.median(np.abs(bends))) / np.sqrt(6.0) if bends.size else 0.0
    # a curve bends the same way for a while, noise does not; the median, as few samples of a steep curve bend most
    if bends.size > 1 and np.median(bends[1:] * bends[:-1]) >= 0.0:
        noise = 0.0
    highest = np.sort(force)[-max(LEAST_CUT_OFF_READINGS, force.size // 100) :]
    again = count[-1] >= max(5.0, 3.0 * usual)
    return "" if again or np.ptp(highest) < MAX_CUT_OFF_RANGE * noise else "the greatest force is not cut off"


NEEDS: Final[Catalogue[Test]] = Catalogue(
    "need of an effect",
    {
        "channel": _any_channel,
        "outcome": _any_outcome,
        "share": _share,
        "resistance_unknown": lambda histories: (
            "resistance or voltage was recorded, and is used"
            if any("resistance" in h.inputs for h in histories)
            else ""
        ),
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
        "several_runs": _members("run", "run", LEAST_RUNS),
        "several_cycles": lambda histories: (
            _cycles(histories) or _members("cycle_of_all", "cycle", LEAST_CYCLES)(histories)
        ),
        "several_loads": _several("load", "the load"),
        "several_rates": _several_rates,
        "several_peaks": _several_peaks,
        "both_branches": _both_branches,
        "lattice": _lattice,
        "reversals": _reversals,
        "warming_cell": _warming_cell,
        "plateaus": _plateaus,
        "flat_tops": _flat_tops,
    },
)
"""Needs that effects may name, each with its test."""
