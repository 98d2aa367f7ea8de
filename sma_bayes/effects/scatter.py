"""What differs from run to run or cycle to cycle without a recorded cause: a random effect.

Each member of a group (a run, a cycle) has an offset ``s u`` of its own, and on each branch a shift of its
transformation ``s w v``, where u and v are standard normal: so s and w are how much the members scatter, estimated
together with each of them. A law of the load or of the cycle that explains how they differ needs fewer numbers and is
preferred to it.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.effects.transformation import FARTHEST, moved
from sma_bayes.effects.types import Inputs, Response, Scales
from sma_bayes.parameters.distributions import LogNormal, Normal
from sma_bayes.parameters.space import Parameter

MEMBER: Final = Normal(0.0, 1.0)
"""Prior of what a member has of its own, over how much members scatter."""
FACTOR: Final = 1.2
"""Standard deviation of the logarithm of how much they scatter."""
REFERENCE: Final = (
    "random effects: Pinheiro and Bates, Mixed-Effects Models in S and S-PLUS (Springer, 2000); four runs of a spring "
    "differ by 4 % of the span of force and 1 to 2 K, recomputed from Guarneros-Sandoval et al., Results in "
    "Engineering (2025)"
)


def numbers_of_members(theta: Floats) -> tuple[Floats, Floats]:
    """Offset, shift while heating and shift while cooling of each member, and how they change with the parameters.

    Parameters
    ----------
    theta : ndarray, shape (2 + 3 n,)
        Parameters of a random effect of n members, as of `scatter_parameters`.

    Returns
    -------
    numbers : ndarray, shape (3 n,)
        In units of the channel, then in kelvin.
    jacobian : ndarray, shape (3 n, 2 + 3 n)
        By the logarithms of s and w, and what members have of their own over them.
    """
    n = (theta.size - 2) // 3
    size = np.repeat([theta[0], theta[0] * theta[1], theta[0] * theta[1]], n)
    numbers = size * theta[2:]
    of_ease = np.where(np.arange(3 * n) < n, 0.0, numbers)
    return numbers, np.column_stack([numbers, of_ease, np.diag(size)])


def channel_of(names: object) -> str:
    """Channel whose offset scatters: the displacement, or the force where there is no displacement."""
    return "displacement" if "displacement" in names else "force"  # type: ignore[operator]


def scatter_parameters(scales: Scales, group: str, what: str) -> tuple[Parameter, ...]:
    """How much the members of a group scatter, and what each of them has of its own.

    Parameters
    ----------
    scales : Scales
    group : str
        Input that numbers the members, from 0.
    what : str
        What a member is, in words.
    """
    channel = channel_of(scales.step)
    unit, span = scales.units[channel], scales.span[channel]
    count = int(scales.level[group]) + 1
    size, ease = LogNormal(0.02 * span, FACTOR), LogNormal(50.0 / span, FACTOR)
    per = "K" if unit == "1" else f"K/{unit}"
    own = "the others scatter by 1: 90 % within 1.64"
    return (
        Parameter(
            "s", unit, f"standard deviation of the offset of a {what}", size, "90 % between 0.28 and 14 % of the span"
        ),
        Parameter(
            "w", per, "that of the transformation temperature over it", ease,
            "90 % between 0.14 and 7.2 K where the offset scatters by 2 % of the span",
        ),
        *(Parameter(f"u{i + 1}", "1", f"offset of {what} {i + 1}, over s", MEMBER, own) for i in range(count)),
        *(
            Parameter(f"v{i + 1}_{branch}", "1", f"shift of {what} {i + 1} while {branch}, over s w", MEMBER, own)
            for branch in ("heating", "cooling") for i in range(count)
        ),
    )  # fmt: skip


def scattered(response: Response, theta: Floats, inputs: Inputs, group: str) -> dict[str, Floats]:
    """Response with an offset and shifts of each member."""
    size, ease, own = theta[..., :1], theta[..., 1:2], theta[..., 2:]
    at = inputs[group].astype(np.intp)
    offset, heating, cooling = (part[..., at] for part in np.split(own, 3, axis=-1))
    shift = size * ease * np.where(inputs["branch"] > 0.0, heating, cooling)
    out = moved(response, inputs, -np.clip(shift, -FARTHEST, FARTHEST))
    channel = channel_of(out)
    return {**out, channel: out[channel] + size * offset}
