"""The modified sigmoid with A2 = B2: the only case in which Eq. (7) is a bounded S.

    K = (B1/A1) [cosh(A2 (T - A3)/2)/cosh(A2 (T - B3)/2)]**2,      K_max/K_min = exp(2 A2 (B3 - A3))

The square root of this K is a logistic curve.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from sma_bayes.arrays import Floats
from sma_bayes.parameters.space import ParameterSpec
from sma_bayes.quantities import CHANNELS
from sma_bayes.response.base import Asymptote, ResponseModel, Variant
from sma_bayes.response.modified_sigmoid import ModifiedSigmoid


@dataclass(frozen=True)
class TiedSigmoid(ResponseModel):
    """The modified sigmoid with one rate for force and displacement, called A2.

    Attributes
    ----------
    channels : tuple of str
        See `ModifiedSigmoid`; with stiffness, or with force and displacement, there are two rates to tie.
    """

    channels: tuple[str, ...] = CHANNELS
    free: ModifiedSigmoid = field(init=False, repr=False)
    _source: NDArray[np.intp] = field(init=False, repr=False, compare=False)
    name = "modified_sigmoid_tied"
    reference = "Eqs. (2), (4) and (7) with A2 = B2"
    priors = family = ModifiedSigmoid.name
    contends = (Variant("modified_sigmoid_tied", "modified sigmoid with A2 = B2", extra=True),)

    def __post_init__(self) -> None:
        super().__post_init__()
        free = ModifiedSigmoid(self.channels)
        object.__setattr__(self, "free", free)
        kept = self.parameter_names
        source = [
            kept.index("A2" if name == "B2" and "A2" in kept else name) for name in free.parameter_names
        ]
        object.__setattr__(self, "_source", np.array(source, dtype=np.intp))

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Parameters of `ModifiedSigmoid` without B2, where A2 is there to stand in for it."""
        names = self.free.parameter_names
        return tuple(n for n in names if n != "B2" or "A2" not in names)

    def parameters(self, units: Mapping[str, str]) -> tuple[ParameterSpec, ...]:
        """Facts about the parameters; see `ModifiedSigmoid.parameters`."""
        return tuple(f for f in self.free.parameters(units) if f.name in self.parameter_names)

    def predict(self, theta: Floats, inputs: Mapping[str, Floats]) -> dict[str, Floats]:
        """Response of each channel, shape (..., n)."""
        return self.free.predict(np.asarray(theta)[..., self._source], inputs)

    def slope(self, theta: Floats, inputs: Mapping[str, Floats]) -> dict[str, Floats]:
        """Derivative of each channel with respect to temperature, shape (..., n)."""
        return self.free.slope(np.asarray(theta)[..., self._source], inputs)

    def jacobian(self, theta: Floats, inputs: Mapping[str, Floats]) -> dict[str, Floats]:
        """Derivative with respect to each parameter, shape (..., n, P): that of A2 is the sum of both rates'."""
        out = {}
        for channel, j in self.free.jacobian(np.asarray(theta)[..., self._source], inputs).items():
            tied = np.zeros((*j.shape[:-1], len(self.parameter_names)))
            for column, target in enumerate(self._source):
                tied[..., target] += j[..., column]
            out[channel] = tied
        return out

    def stiffness(self, theta: Floats, inputs: Mapping[str, Floats]) -> Floats:
        """Stiffness of Eq. (7), shape (..., n); see `ModifiedSigmoid.stiffness`."""
        return self.free.stiffness(np.asarray(theta)[..., self._source], inputs)

    def curvature(self, theta: Floats, inputs: Mapping[str, Floats]) -> dict[str, Floats]:
        """Second derivative of each channel with respect to temperature, shape (..., n)."""
        return self.free.curvature(np.asarray(theta)[..., self._source], inputs)

    def limits(self, theta: Floats) -> dict[str, tuple[Asymptote, Asymptote]]:
        """Lines that the curves approach; the stiffness is bounded."""
        return self.free.limits(np.asarray(theta)[..., self._source])

    def spoken_of(self) -> frozenset[str]:
        """The parameters of `ModifiedSigmoid`, whose priors it shares."""
        return self.free.spoken_of()
