"""What a response model is: a curve of the observed channels against temperature, and its derivatives."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

from sma_bayes.parameters.space import ParameterFact
from sma_bayes.quantities import Floats


class ResponseModel(Protocol):
    """Response of a spring or specimen.

    Attributes
    ----------
    name, reference : str
        As an option, and where the equations stand.
    channels : tuple of str
        What is predicted.
    parameter_names : tuple of str
        In the order of ``theta``.
    """

    @property
    def name(self) -> str: ...

    @property
    def reference(self) -> str: ...

    @property
    def channels(self) -> tuple[str, ...]: ...

    @property
    def parameter_names(self) -> tuple[str, ...]: ...

    def parameters(self, units: Mapping[str, str]) -> tuple[ParameterFact, ...]:
        """Facts about the parameters, for the units of temperature and of the observed channels."""
        ...

    def predict(self, theta: Floats, inputs: Mapping[str, Floats]) -> dict[str, Floats]:
        """Response of each channel, shape (..., n), at parameters ``theta`` (..., P)."""
        ...

    def slope(self, theta: Floats, inputs: Mapping[str, Floats]) -> dict[str, Floats]:
        """Derivative of each channel with respect to temperature, shape (..., n)."""
        ...

    def jacobian(self, theta: Floats, inputs: Mapping[str, Floats]) -> dict[str, Floats]:
        """Derivative of each channel with respect to each parameter, shape (..., n, P)."""
        ...
