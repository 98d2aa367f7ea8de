"""What the form of effects that a model has may leave, so that it isn't given a name of its own.

No mechanism is exactly the formula of the catalogue. What a strong effect leaves for that reason is something that it
does more of here and less there, or a little earlier or later: its own signature times a smooth function of a
covariate, and the rate of change of that signature. A further effect that explains as much beside such functions as
without them is something else, however little that is beside the effect before it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from sma_bayes.arrays import Floats
from sma_bayes.effects.types import Effect
from sma_bayes.studies.gap.fitting import FittedHypothesis, added_by
from sma_bayes.studies.gap.splines import bspline_basis, grouped, indicators, row_tensor_product

FORM_SHARE_SD = 0.5
"""Standard deviation of the share by which a mechanism may differ from its formula."""
DELAY_SD = 3.0
"""Standard deviation of how much later it may act [samples]."""


@dataclass(frozen=True, eq=False)
class EffectForms:
    """Other forms of effects that a fitted model has.

    Attributes
    ----------
    fitted : FittedHypothesis
    of : sequence of Effect, optional
        The effects; all by default.
    """

    fitted: FittedHypothesis
    of: Sequence[Effect] | None = None

    @cached_property
    def columns(self) -> Floats:
        """What they may add, as columns of unit standard deviation, whitened, less what parameters absorb, (N, k)."""
        fitted = self.fitted
        modulations = _modulations(fitted)
        found = [np.empty((fitted.whitened.size, 0))]
        for effect in fitted.hypothesis.effects if self.of is None else self.of:
            added = added_by(effect, fitted.hypothesis, fitted.blocks, fitted.theta)
            later = np.concatenate([_rate_of_change(added[b.at]) for b in fitted.blocks])
            found.append(FORM_SHARE_SD * added[:, None] * modulations)
            found.append(DELAY_SD * later[:, None] * modulations)
        return fitted.project_out(fitted.whiten(np.concatenate(found, axis=1).T).T)

    @cached_property
    def _precision(self) -> tuple[Floats, bool]:
        """Factor of the precision of their coefficients (k, k), as scipy's `cho_factor` gives it."""
        factor, lower = cho_factor(np.eye(self.columns.shape[1]) + self.columns.T @ self.columns)
        return factor, bool(lower)

    def share_beyond(self, signature: Floats) -> float:
        """Share of what a signature explains that it still explains beside other forms of the effects there are.

        Parameters
        ----------
        signature : ndarray, shape (N,)
            Of a further effect, whitened, less what the parameters absorb.
        """
        plain = _explained(signature, signature, self.fitted.left)
        free = signature - self.columns @ cho_solve(self._precision, self.columns.T @ signature)
        return _explained(signature, free, self.fitted.left) / plain if plain > 0.0 else 0.0


def _explained(signature: Floats, free: Floats, left: Floats) -> float:
    """Gain in log likelihood by as much of a signature as fits best, of which only a part is free to explain."""
    information = float(signature @ free)
    return 0.5 * float(free @ left) ** 2 / information if information > 0.0 else 0.0


def _rate_of_change(series: Floats) -> Floats:
    return np.gradient(series) if series.size > 1 else np.zeros_like(series)


def _modulations(fitted: FittedHypothesis) -> Floats:
    """Smooth functions of the covariates of all samples, each for one channel, shape (N, m)."""
    histories = fitted.hypothesis.histories
    names = set.intersection(*(set(h.inputs) for h in histories))
    inputs = [histories[b.history].inputs for b in fitted.blocks]
    v = {name: np.concatenate([own[name] for own in inputs]) for name in names}
    sizes = [b.at.stop - b.at.start for b in fitted.blocks]
    channels = list(fitted.hypothesis.channels)
    channel = np.repeat([float(channels.index(b.channel)) for b in fitted.blocks], sizes)
    history = np.repeat([float(b.history) for b in fitted.blocks], sizes)
    branch = indicators(v["branch"])
    parts = [
        row_tensor_product(branch, bspline_basis(v["temperature"], 8)),
        row_tensor_product(branch, indicators(grouped(history))),
        indicators(grouped(v["cycle"])),
        bspline_basis(v["time" if "time" in v else "order"], 8),
    ]
    if "rate" in v and np.ptp(v["rate"]) > 0.0:
        parts.append(bspline_basis(v["rate"], 5))
    return row_tensor_product(indicators(channel), np.concatenate(parts, axis=1))
