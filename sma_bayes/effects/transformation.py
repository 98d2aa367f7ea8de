"""What an effect can ask of a response: the same at another temperature, plateaus, share transformed, slope.

All of it only calls the response, so effects work around any model and around each other.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.effects.types import Inputs, Response

FAR = 500.0
"""Distance from the measured temperatures at which a transformation is over [K]."""
SLOPED = "sloped"
"""Input that is there where the phases of the model have slopes."""
FARTHEST = 2000.0
"""Greatest shift that a law or a random effect can make, beyond any that could be measured [K]."""
STEP = 0.05
"""Step of finite differences in temperature [K]."""


def at(inputs: Inputs, temperature: Floats) -> dict[str, Floats]:
    """Inputs with the alloy at another temperature; the measured one stays known as ``measured_temperature``."""
    return {**inputs, "temperature": temperature, "measured_temperature": measured(inputs)}


def measured(inputs: Inputs) -> Floats:
    """Temperature that was measured, also where an outer effect has moved that of the alloy."""
    return inputs.get("measured_temperature", inputs["temperature"])


def moved(response: Response, inputs: Inputs, by: Floats) -> dict[str, Floats]:
    """Response of an alloy that transforms as if it were hotter by some kelvins.

    Parameters
    ----------
    by : ndarray, shape (..., n)
        [K]. The temperature channel, where there is one, knows nothing of it.
    """
    out = response(at(inputs, inputs["temperature"] + by))
    return {**out, "temperature": response(inputs)["temperature"]} if "temperature" in out else out


@dataclass(frozen=True, slots=True)
class ChannelCurve:
    """A channel along a history, and what it would be if the transformation were not under way.

    Attributes
    ----------
    value : ndarray, shape (..., n)
    cold : ndarray, shape (..., n)
        Cold phase, at the same temperatures: the channel far below the transformation, along its line to there.
    span : ndarray, shape (..., n)
        From there to the hot phase.
    """

    value: Floats
    cold: Floats
    span: Floats

    @property
    def share(self) -> Floats:
        """Share transformed to austenite, from 0 to 1; 0 where the channel has no span."""
        span = np.where(self.span == 0.0, np.inf, self.span)
        return np.clip((self.value - self.cold) / span, 0.0, 1.0)


def curves(response: Response, inputs: Inputs) -> tuple[dict[str, Floats], dict[str, ChannelCurve]]:
    """Response, and the curves of force and displacement in it.

    Stiffness has no curve: it is the ratio of the slopes of the two, and what alters their shapes or spans alike
    leaves it as it is.
    """
    out = response(inputs)
    cold, hot = (_phase(response, inputs, by) for by in (-FAR, FAR))
    names = [c for c in ("force", "displacement") if c in out]
    return out, {c: ChannelCurve(out[c], cold[c], hot[c] - cold[c]) for c in names}


def _phase(response: Response, inputs: Inputs, by: float) -> dict[str, Floats]:
    """Channels of the phase that is alone at a distance in temperature, here; along its line where it has a slope."""
    there = response(at(inputs, inputs["temperature"] + by))
    if SLOPED not in inputs:
        return there
    beyond = response(at(inputs, inputs["temperature"] + 2.0 * by))
    return {c: 2.0 * there[c] - beyond[c] for c in there}


def stretched(out: Mapping[str, Floats], curve: ChannelCurve, fixed: Floats, by: Floats) -> dict[str, Floats]:
    """Response with a longer stroke; the stiffness, dF/dX, falls by the same factor.

    Parameters
    ----------
    out : mapping of str to ndarray, shape (..., n)
    curve : ChannelCurve
        Of the displacement.
    fixed : ndarray, shape (..., n)
        The plateau that stays.
    by : ndarray, shape (..., n)
        Factor.
    """
    longer = {**out, "displacement": fixed + by * (curve.value - fixed)}
    return {**longer, "stiffness": out["stiffness"] / by} if "stiffness" in out else longer


def slope(response: Response, inputs: Inputs, channel: str) -> Floats:
    """Derivative of a channel with respect to the temperature of the alloy, by central differences."""
    up, down = (response(at(inputs, inputs["temperature"] + by))[channel] for by in (STEP, -STEP))
    return np.asarray((up - down) / (2.0 * STEP))
