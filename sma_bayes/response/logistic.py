"""The logistic curve of Eqs. (9) and (10): one of the two models that the paper compares itself with.

    K = K_min + (K_max - K_min)/(1 + exp(-(6.2/width) (T - centre)))

This is Eq. (9) with its first and third term joined. On heating ``width = Af - As``, on cooling ``Ms - Mf``; at the
two temperatures 4.3 % and 95.7 % of the rise have passed. The centre is half their sum; Eq. (9) prints half their
difference, Eq. (10) the sum. With all four parameters free this is the same curve as `BoundedLogistic`.

References
----------
Holanda et al. (2014) as cited by the paper; the paper, lines 334 to 341, where the constants are printed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from scipy.special import expit

from sma_bayes.arrays import Floats
from sma_bayes.paper.specifications import TEXT_VALUES, specification
from sma_bayes.parameters.roles import Role
from sma_bayes.parameters.scales import RecordScales
from sma_bayes.parameters.space import QUANTITY, ParameterSpec
from sma_bayes.records.types import Branch, Record
from sma_bayes.response.base import ResponseModel, Variant

STEEPNESS = 6.2
"""Rate times width, as printed."""
_ENDS = {Branch.HEATING: ("As", "Af"), Branch.COOLING: ("Mf", "Ms")}


@dataclass(frozen=True)
class Logistic(ResponseModel):
    """The logistic curve of Eqs. (9) and (10) for one channel.

    Attributes
    ----------
    channels : tuple of str
        One channel. The paper has it for stiffness; for force and displacement the same form is taken.
    direction : float
        1 where the channel rises with temperature, -1 where it falls.
    """

    channels: tuple[str, ...] = ("stiffness",)
    direction: float = 1.0
    name = "logistic"
    reference = "Eqs. (9) and (10)"
    together = False
    contends = (
        Variant("logistic_published", "logistic, Eqs. (9) and (10) as printed", "published"),
        Variant("logistic_corrected", "logistic, centre (As + Af)/2", "corrected"),
        Variant("logistic_refitted", "logistic, all four parameters inferred", "refitted"),
    )
    parameter_names = ("K_min", "K_max", "centre", "width")

    @classmethod
    def made_for(cls, records: Sequence[Record]) -> Self:
        """The curve of the one channel of some records, in the direction in which it goes."""
        channels = records[0].channels
        return cls(channels, RecordScales.of(records).trend.get(next(iter(channels), ""), 1.0))

    def parameters(self, units: Mapping[str, str]) -> tuple[ParameterSpec, ...]:
        """Facts about the parameters, for the units of temperature and of the channel."""
        (channel,) = self.channels
        meaning = (
            f"least {QUANTITY}, K_min",
            f"greatest {QUANTITY}, K_max",
            "centre of the transformation, half the sum of its start and finish temperatures",
            "distance of start and finish of the transformation",
        )
        unit = (units[channel], units[channel], units["temperature"], units["temperature"])
        role = (Role.LEVEL, Role.LEVEL, Role.MIDPOINT, Role.WIDTH)
        return tuple(
            ParameterSpec(name, u, m, prior_key=name, channel=channel, role=r)
            for name, u, m, r in zip(self.parameter_names, unit, meaning, role, strict=True)
        )

    def _share(self, theta: Floats, inputs: Mapping[str, Floats]) -> tuple[Floats, Floats, Floats]:
        """Parameters (P, ..., 1), share of the rise that has passed, and the argument of the exponential."""
        p = np.moveaxis(np.asarray(theta, dtype=float), -1, 0)[..., None]
        argument = self.direction * STEEPNESS * (inputs["temperature"] - p[2]) / p[3]
        return p, expit(argument), argument

    def predict(self, theta: Floats, inputs: Mapping[str, Floats]) -> dict[str, Floats]:
        """Response of the channel, shape (..., n)."""
        p, share, _ = self._share(theta, inputs)
        return {self.channels[0]: p[0] + (p[1] - p[0]) * share}

    def slope(self, theta: Floats, inputs: Mapping[str, Floats]) -> dict[str, Floats]:
        """Derivative with respect to temperature, shape (..., n)."""
        p, share, _ = self._share(theta, inputs)
        steep = self.direction * STEEPNESS / p[3]
        return {self.channels[0]: (p[1] - p[0]) * share * (1.0 - share) * steep}

    def jacobian(self, theta: Floats, inputs: Mapping[str, Floats]) -> dict[str, Floats]:
        """Derivative with respect to each parameter, shape (..., n, P)."""
        p, share, argument = self._share(theta, inputs)
        steep = (p[1] - p[0]) * share * (1.0 - share)
        columns = (
            1.0 - share,
            share,
            -steep * self.direction * STEEPNESS / p[3],
            -steep * argument / p[3],
        )
        return {self.channels[0]: np.stack(columns, axis=-1)}


def printed_constants(branch: Branch, *, corrected: bool) -> dict[str, float]:
    """Centre and width [degC] that follow from the printed transformation temperatures.

    Parameters
    ----------
    branch : Branch
    corrected : bool
        Whether Eq. (9) gets the plus that Eq. (10) has.

    Examples
    --------
    >>> {k: round(v, 3) for k, v in printed_constants(Branch.HEATING, corrected=False).items()}
    {'centre': -3.285, 'width': 6.57}
    >>> {k: round(v, 3) for k, v in printed_constants(Branch.HEATING, corrected=True).items()}
    {'centre': 77.115, 'width': 6.57}
    """
    low, high = (specification(TEXT_VALUES, name, "degC") for name in _ENDS[branch])
    minus = branch is Branch.HEATING and not corrected
    return {"centre": 0.5 * (low - high) if minus else 0.5 * (low + high), "width": high - low}
