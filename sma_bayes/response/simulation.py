"""The simulation: everything that was observed, from what was applied, along a measured history."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.response.base import ResponseModel
from sma_bayes.response.both_branches import BothBranches
from sma_bayes.response.joule_heating import JouleHeating
from sma_bayes.response.modified_sigmoid import ModifiedSigmoid


@dataclass(frozen=True)
class Simulation:
    """Force, displacement and stiffness from temperature and branch; temperature from current.

    ``theta`` (..., P): parameters of the heating branch, of the cooling branch, and, where temperature is among the
    channels, those of the Joule-heating balance.

    Attributes
    ----------
    channels : tuple of str
        Any of force, displacement, stiffness, temperature.
    model : ResponseModel, optional
        Of the mechanical channels among them, on either branch; the modified sigmoid by default.
    """

    channels: tuple[str, ...]
    model: ResponseModel | None = None
    mechanical: BothBranches | None = field(init=False)
    thermal: JouleHeating | None = field(init=False)

    def __post_init__(self) -> None:
        mechanical = tuple(c for c in self.channels if c != "temperature")
        response = BothBranches(self.model or ModifiedSigmoid(mechanical)) if mechanical else None
        object.__setattr__(self, "mechanical", response)
        object.__setattr__(self, "thermal", JouleHeating() if "temperature" in self.channels else None)

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names in the order of ``theta``; those of a branch carry its name: ``B3 heating``."""
        names: list[str] = []
        if self.mechanical is not None:
            for branch in ("heating", "cooling"):
                names += [f"{name} {branch}" for name in self.mechanical.model.parameter_names]
        if self.thermal is not None:
            names += self.thermal.parameter_names
        return tuple(names)

    @property
    def sloped(self) -> bool:
        """Whether the phases of the mechanical model have slopes, so that they are not level far away."""
        return self.mechanical is not None and self.mechanical.model.sloped

    def predict(self, theta: Floats, inputs: Mapping[str, Floats]) -> dict[str, Floats]:
        """Response of each channel, shape (..., n); see `BothBranches.predict` and `JouleHeating.predict`."""
        theta = np.asarray(theta, dtype=float)
        out: dict[str, Floats] = {}
        if self.mechanical is not None:
            count = 2 * len(self.mechanical.model.parameter_names)
            out |= self.mechanical.predict(theta[..., :count], inputs)
        if self.thermal is not None:
            out |= self.thermal.predict(theta[..., -len(self.thermal.parameter_names) :], inputs)
        return out

    def curves(self, theta: Floats, temperature: Floats, branch: float) -> dict[str, Floats]:
        """Mechanical channels on a branch, 1 heating or -1 cooling, at given temperatures (n,); shape (..., n)."""
        if self.mechanical is None:
            return {}
        count = 2 * len(self.mechanical.model.parameter_names)
        inputs = {"temperature": temperature, "branch": np.full(temperature.shape, branch)}
        return self.mechanical.predict(np.asarray(theta, dtype=float)[..., :count], inputs)
