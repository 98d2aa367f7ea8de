"""Coordinates in which the posterior of a model with effects is nearly normal.

What an effect does bends with its own few parameters, and the curves of the model give way to it. Where they go is
taken out: the model's parameters are measured from the place that is best for them, given those of the effects, by one
Gauss-Newton step from the mode.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from sma_bayes.arrays import Bools, Floats
from sma_bayes.studies.gap.fitting import FittedHypothesis


@dataclass(frozen=True, eq=False)
class FollowingCoordinates:
    """Map ``u(z)``: the parameters of effects as they are, the others less what they are moved by those.

    The map is a shear: its Jacobian determinant is 1.

    Attributes
    ----------
    fitted : FittedHypothesis
        A hypothesis at its mode; without effects nothing moves.
    """

    fitted: FittedHypothesis
    count: int = field(init=False)
    _pull: Floats = field(init=False, repr=False)

    def __post_init__(self) -> None:
        hypothesis = self.fitted.hypothesis
        starts = [int(at[0]) for at in hypothesis.effect_positions.values()]
        count = int(
            np.sum(hypothesis.space.free_index < min(starts, default=len(hypothesis.space.parameters)))
        )
        own = self.fitted.jacobian[:, :count]
        precision = self.fitted.precision[:count, :count]
        object.__setattr__(self, "count", count)
        object.__setattr__(self, "_pull", np.linalg.solve(precision, own.T))

    @property
    def covariance(self) -> Floats:
        """Of ``u`` at the mode, shape (D, D): nothing is left between the two kinds of parameters."""
        out = self.fitted.covariance
        n = self.count
        out[:n, n:] = out[n:, :n] = 0.0
        out[:n, :n] = np.linalg.inv(self.fitted.precision[:n, :n])
        return out

    def forward(self, z: Floats) -> tuple[Floats, Floats, Bools]:
        """See `Coordinates.forward`."""
        return self._sheared(z, -1.0)

    def inverse(self, u: Floats) -> tuple[Floats, Floats, Bools]:
        """See `Coordinates.inverse`."""
        return self._sheared(u, 1.0)

    def _sheared(self, x: Floats, sign: float) -> tuple[Floats, Floats, Bools]:
        out = np.array(x, dtype=float)
        out[:, : self.count] += sign * self.moved(out[:, self.count :])
        fine = np.isfinite(out).all(axis=1)
        return np.where(fine[:, None], out, 0.0), np.zeros(len(out)), fine

    def moved(self, effects: Floats) -> Floats:
        """How far the model's parameters go (W, count) for sampled coordinates of those of the effects."""
        out = np.empty((len(effects), self.count))
        for part in self.fitted.batches(len(effects)):
            out[part] = self._moved(effects[part])
        return out

    @np.errstate(over="ignore", invalid="ignore", divide="ignore")
    def _moved(self, effects: Floats) -> Floats:
        z = np.concatenate([np.tile(self.fitted.z[: self.count], (len(effects), 1)), effects], axis=1)
        change = self.fitted.whiten(self.fitted.residual_at(z)) - self.fitted.whitened
        return np.asarray(change @ self._pull.T)
