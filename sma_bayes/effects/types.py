"""What a missing physical effect is.

An effect receives the response as a function of the inputs, so it can change what goes in (a lagging sensor: call it
at another temperature) or what comes out (friction: add to the force), for any response model. It knows nothing of
noise, priors of the model, or other effects; several are applied one around the other.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Protocol

import numpy as np
from scipy.special import stdtrit

from sma_bayes.arrays import Floats
from sma_bayes.parameters.distributions import StudentT
from sma_bayes.parameters.space import Parameter
from sma_bayes.records.history import History

Inputs = Mapping[str, Floats]
Response = Callable[[Inputs], dict[str, Floats]]


@dataclass(frozen=True, slots=True)
class Scales:
    """What an effect may know of the measurements to state its priors: sizes and units, never residuals.

    Attributes
    ----------
    span : mapping of str to float
        Range of each input and channel over all histories (1 % to 99 % quantile); a channel that was held has none.
    level : mapping of str to float
        Greatest magnitude of each input and channel.
    low, high : mapping of str to float
        Ends of that range.
    step : mapping of str to float
        Distance of neighbouring values of a channel if all lie on a lattice, else 0.
    units : mapping of str to str
    specimen : bool
    on_lattice : mapping of str to float
        The middle one of each channel's values, which lies on its lattice where there is one.
    """

    span: Mapping[str, float]
    level: Mapping[str, float]
    low: Mapping[str, float]
    high: Mapping[str, float]
    step: Mapping[str, float]
    units: Mapping[str, str]
    specimen: bool
    on_lattice: Mapping[str, float] = field(default_factory=dict)

    def direction(self, name: str) -> float:
        """-1 for an input or channel whose sign is turned round, so that it is mostly negative; else 1."""
        return -1.0 if -self.low[name] > self.high[name] else 1.0

    @staticmethod
    def of(histories: Sequence[History]) -> Scales:
        """Scales of histories, taken together."""
        names = set.intersection(*({*h.inputs, *h.observed} for h in histories))
        joined = {
            name: np.concatenate(
                [h.observed[name] if name in h.observed else h.inputs[name] for h in histories]
            )
            for name in sorted(names)
        }
        low, high = ({k: float(np.quantile(v, q)) for k, v in joined.items()} for q in (0.01, 0.99))
        first = histories[0]
        return Scales(
            span={k: high[k] - low[k] for k in joined},
            level={k: float(np.max(np.abs(v))) for k, v in joined.items()},
            low=low,
            high=high,
            step={k: lattice_step(joined[k]) for k in first.channels if k in joined},
            units=dict(first.units),
            specimen=first.specimen,
            on_lattice={
                k: float(np.sort(joined[k])[joined[k].size // 2]) for k in first.channels if k in joined
            },
        )


class Place(IntEnum):
    """Where on the way from the alloy to the file an effect acts; see `with_effects`."""

    ALLOY = 0
    RIG = 1
    SENSOR = 2
    RANGE = 3
    CONVERTER = 4


class Effect(Protocol):
    """A physical effect that a model may miss.

    One that does not act in the alloy says where it does by ``place``, a `Place`.

    Attributes
    ----------
    id : str
        Fixed name in files.
    title : str
        For people: ``sensor lags behind the metal``.
    equation : str
        In plain text, with the names of the parameters.
    reference : str
        Where form and range come from.
    """

    id: str
    title: str
    equation: str
    reference: str

    @property
    def needs(self) -> tuple[str, ...]:
        """What must have been recorded or varied: names in `sma_bayes.effects.needs.NEEDS`."""
        ...

    def parameters(self, scales: Scales) -> tuple[Parameter, ...]:
        """Parameters, the size first: where it is 0 there is no effect."""
        ...

    def apply(self, response: Response, theta: Floats, inputs: Inputs) -> dict[str, Floats]:
        """Response with the effect.

        Parameters
        ----------
        response : callable
            Inputs to channels, each (n,) or (..., n); its own parameters are already in it, and have the same leading
            shape as `theta`. Inputs may be handed on with a leading shape.
        theta : ndarray, shape (..., P)
            Parameters of the effect.
        inputs : mapping of str to ndarray, shape (n,) or (..., n)
            See `History`.

        Returns
        -------
        dict of str to ndarray, shape (..., n)
        """
        ...


def either_sign(within: float) -> StudentT:
    """Prior of a size that may have either sign and of which only the order of magnitude is known.

    Student's t with 2 degrees of freedom: 90 % of it is within a size, half within 28 % of that, and one in a hundred
    beyond three times as much, so that an effect far smaller or larger than usual is not ruled out.

    Parameters
    ----------
    within : float
        Magnitude below which 90 % lie [unit of the parameter].
    """
    return StudentT(2.0, 0.0, within / float(stdtrit(2.0, 0.95)))


def place_of(effect: Effect) -> Place:
    """Where an effect acts; in the alloy, unless it says otherwise."""
    return Place(getattr(effect, "place", Place.ALLOY))


def with_effects(response: Response, effects: Sequence[tuple[Effect, Floats]]) -> Response:
    """Response with effects around it.

    They go around each other as they do on the way from the alloy to the file, whatever the order in which they were
    found: a load cell cuts off what the drift of its zero has added. Of those in one place the last one is outermost.

    Parameters
    ----------
    response : callable
    effects : sequence of (Effect, ndarray)
        Each with its parameters (..., P).
    """
    for effect, theta in sorted(effects, key=lambda e: place_of(e[0])):
        response = _around(response, effect, theta)
    return response


def _around(response: Response, effect: Effect, theta: Floats) -> Response:
    return lambda inputs: effect.apply(response, theta, inputs)


def lattice_step(values: Floats) -> float:
    """Distance of neighbouring values if they all lie on a lattice of far fewer values than samples, else 0.

    Examples
    --------
    >>> import numpy as np
    >>> round(lattice_step(np.round(np.sin(np.arange(500.0)), 1)), 6)
    0.1
    >>> lattice_step(np.sin(np.arange(500.0)))
    0.0
    """
    distinct = np.unique(values)
    if distinct.size < 3 or distinct.size > values.size // 3:
        return 0.0
    steps = np.diff(distinct)
    step = float(np.min(steps[steps > 1e-9 * np.ptp(distinct)], initial=np.inf))
    if not np.isfinite(step):
        return 0.0
    off = np.abs(steps / step - np.round(steps / step))
    return step if float(np.max(off)) < 0.05 else 0.0
