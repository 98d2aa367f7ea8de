"""Mechanisms by the shape memory law of `simcoon`, which nobody here wrote.

The law (`calibration.simulated_loop`) is integrated at the stress of each load. So that the shape of its curves is not
mixed up with what the load does to them, the shift at equal fraction and the growth of the strain are taken from it,
and act on the spring's own curves.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from calibration.simulated_loop import isobaric_cycle
from scipy.special import expit

from gap_benchmark.spring import Floats
from gap_benchmark.state import Mechanism, Stage, State, Traits

STRESS_PER_NEWTON = 40.0
"""By how much the stress in the wire rises with the load on the spring where the size is 1 [MPa/N]."""
REFERENCE, LOAD = 60.0, 1.5
"""Stress [MPa] at a load [N], beside which the law is compared."""
EXPONENT, WIDTH = 0.5, 18.0
"""Smooth hardening, and width of the transformation without stress [K]."""
RANGE = np.linspace(-23.0, 146.0, 1700)
"""Temperatures at which curves of the law are read [degC]."""


def _stress(state: State, size: float) -> float:
    """Stress of the law, to a tenth, so that the law need not be integrated at every step of a search [MPa]."""
    return float(round(REFERENCE + STRESS_PER_NEWTON * size * (state.course.setting.load - LOAD), 1))


def _transformed(stress: float, branch: str) -> tuple[Floats, float]:
    """Fraction of austenite at `RANGE`, and the strain that goes with the transformation.

    Thermal expansion and the elastic strain of either phase are taken off as straight lines through the ends.
    """
    strain = isobaric_cycle(stress, EXPONENT, WIDTH)[branch].value(RANGE)
    cold, hot = RANGE < -15.0, RANGE > 138.0
    low = np.polyval(np.polyfit(RANGE[cold], strain[cold], 1), RANGE)
    high = np.polyval(np.polyfit(RANGE[hot], strain[hot], 1), RANGE)
    return np.clip((strain - low) / (high - low), 0.0, 1.0), float(abs(low[850] - high[850]))


def _stress_shift(state: State, size: float, traits: Traits) -> State:
    """The temperature of each fraction at the stress of the load, less that at the reference."""
    z = state.z.copy()
    for branch, on in (("heating", state.course.heating), ("cooling", ~state.course.heating)):
        levels = np.linspace(0.02, 0.98, 97)
        at = [
            np.interp(levels, *_rising(_transformed(stress, branch)[0]))
            for stress in (_stress(state, size), REFERENCE)
        ]
        shift = np.interp(expit(state.z[:, on]), levels, at[0] - at[1])
        z[:, on] -= state.course.spring.rate(np.array([branch == "heating"]))[0] * shift
    return replace(state, z=z)


def _rising(fraction: Floats) -> tuple[Floats, Floats]:
    """Fractions that rise strictly, with their temperatures."""
    top = np.maximum.accumulate(fraction)
    new = np.concatenate([[True], np.diff(top) > 1e-9])
    return top[new], RANGE[new]


def _stress_stroke(state: State, size: float, traits: Traits) -> State:
    """The transformation strain at the stress of the load, over that at the reference."""
    low, span = (getattr(state.course.spring.curves["displacement", "heating"], k) for k in ("low", "span"))
    grown = _transformed(_stress(state, size), "cooling")[1] / _transformed(REFERENCE, "cooling")[1]
    return replace(state, displacement=low + span + (state.displacement - low - span) * grown)


BY_LAW = (
    Mechanism("stress_shift", Stage.KINETICS, _stress_shift, "40 MPa/N", 0.01, 2.5, limit=2.5),
    Mechanism("stress_stroke", Stage.MECHANICS, _stress_stroke, "40 MPa/N", 0.01, 2.5, limit=2.5),
)
"""What the law does as the load is changed."""
