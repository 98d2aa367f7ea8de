"""Heating and cooling branch of a response model together, along a history."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.response.base import ResponseModel


@dataclass(frozen=True)
class BothBranches:
    """A response model with parameters of its own on each branch.

    ``theta`` (..., 2 P): first the parameters of the heating branch, then those of the cooling branch.

    Attributes
    ----------
    model : ResponseModel
        Of either branch.
    """

    model: ResponseModel

    @property
    def name(self) -> str:
        """Name of the model."""
        return self.model.name

    @property
    def channels(self) -> tuple[str, ...]:
        """What is predicted."""
        return self.model.channels

    def predict(self, theta: Floats, inputs: Mapping[str, Floats]) -> dict[str, Floats]:
        """Response along a history.

        Parameters
        ----------
        theta : ndarray, shape (..., 2 P)
        inputs : mapping of str to ndarray, shape (n,) or (..., n)
            ``temperature`` [degC] and ``branch`` (1 heating, -1 cooling; of shape (n,)).

        Returns
        -------
        dict of str to ndarray, shape (..., n)
        """
        theta = np.asarray(theta, dtype=float)
        half = theta.shape[-1] // 2
        temperature = inputs["temperature"]
        shape = np.broadcast_shapes((*theta.shape[:-1], 1), temperature.shape)
        out = {channel: np.empty(shape) for channel in self.channels}
        for sign, part in ((1.0, theta[..., :half]), (-1.0, theta[..., half:])):
            on = inputs["branch"] == sign
            if not on.any():
                continue
            for channel, values in self.model.predict(part, {"temperature": temperature[..., on]}).items():
                out[channel][..., on] = values
        return out
