"""A bounded logistic curve with four free parameters: what the field would take for a stiffness.

    K = cold + direction span/(1 + exp(-rate (T - midpoint)))

It stays between two asymptotes, which Eq. (7) does only where A2 equals B2. Refitted, Eqs. (9) and (10) are the
same curve in other parameters (``rate = 6.2/width``). For force it is Eq. (2), for displacement Eq. (4), parameter by
parameter: there the modified sigmoid *is* this curve, and no measurement can prefer one to the other.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from scipy.special import expit

from sma_bayes.arrays import Floats
from sma_bayes.parameters.roles import Role
from sma_bayes.parameters.scales import RecordScales
from sma_bayes.parameters.space import QUANTITY, ParameterSpec
from sma_bayes.quantities import per
from sma_bayes.records.types import Record
from sma_bayes.response.base import ResponseModel, Variant


@dataclass(frozen=True)
class BoundedLogistic(ResponseModel):
    """Four-parameter logistic curve of one channel.

    Attributes
    ----------
    channels : tuple of str
        One channel.
    direction : float
        1 where the channel rises with temperature, -1 where it falls.
    """

    channels: tuple[str, ...] = ("stiffness",)
    direction: float = 1.0
    name = "bounded_logistic"
    reference = "four-parameter logistic curve"
    together = False
    family = "logistic"
    contends = (Variant("bounded_logistic", "bounded four-parameter logistic"),)
    parameter_names = ("cold", "span", "rate", "midpoint")

    @classmethod
    def made_for(cls, records: Sequence[Record]) -> Self:
        """The curve of the one channel of some records, in the direction in which it goes."""
        channels = records[0].channels
        return cls(channels, RecordScales.of(records).trend.get(next(iter(channels), ""), 1.0))

    def parameters(self, units: Mapping[str, str]) -> tuple[ParameterSpec, ...]:
        """Facts about the parameters, for the units of temperature and of the channel."""
        (channel,) = self.channels
        rows = (
            ("cold", units[channel], f"{QUANTITY} far below the midpoint", Role.OFFSET),
            ("span", units[channel], f"distance of the asymptotes of {QUANTITY}", Role.SPAN),
            ("rate", per(units["temperature"]), "rate of the transition", Role.RATE),
            ("midpoint", units["temperature"], "temperature of the midpoint", Role.MIDPOINT),
        )
        return tuple(ParameterSpec(n, u, m, prior_key=n, channel=channel, role=r) for n, u, m, r in rows)

    def _share(self, theta: Floats, inputs: Mapping[str, Floats]) -> tuple[Floats, Floats, Floats]:
        """Parameters (P, ..., 1), distance from the midpoint, and the share of the span that has passed."""
        p = np.moveaxis(np.asarray(theta, dtype=float), -1, 0)[..., None]
        away = inputs["temperature"] - p[3]
        return p, away, expit(p[2] * away)

    def predict(self, theta: Floats, inputs: Mapping[str, Floats]) -> dict[str, Floats]:
        """Response of the channel, shape (..., n)."""
        p, _, share = self._share(theta, inputs)
        return {self.channels[0]: p[0] + self.direction * p[1] * share}

    def slope(self, theta: Floats, inputs: Mapping[str, Floats]) -> dict[str, Floats]:
        """Derivative with respect to temperature, shape (..., n)."""
        p, _, share = self._share(theta, inputs)
        return {self.channels[0]: self.direction * p[1] * p[2] * share * (1.0 - share)}

    def jacobian(self, theta: Floats, inputs: Mapping[str, Floats]) -> dict[str, Floats]:
        """Derivative with respect to each parameter, shape (..., n, P)."""
        p, away, share = self._share(theta, inputs)
        steep = self.direction * p[1] * share * (1.0 - share)
        columns = (np.ones_like(share), self.direction * share, steep * away, -steep * p[2])
        return {self.channels[0]: np.stack(columns, axis=-1)}
