"""Random effects among the candidates: how they are screened, and when a law is preferred to them.

Runs or cycles that each have numbers of their own explain whatever differs between them, so a random effect says least
and is named last. A law of the load, of the cycle, of time, is preferred where it explains at least half as much and
makes the measurements more likely beside the random effect: then what members have of their own scatters less.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.effects.scatter import MEMBER
from sma_bayes.effects.types import Effect
from sma_bayes.studies.gap.fitting import FittedHypothesis, fit_hypothesis, stacked
from sma_bayes.studies.gap.flexible import COEFFICIENT_SD_GRID, Term, TermEvidence, gains

LEAST_SHARE_OF_LAW: Final = 0.5
"""Share of the log Bayes factor of a random effect that a law must have to be preferred to it."""


def members_of(effect: Effect) -> tuple[str, ...]:
    """Covariates that number the members of a random effect; empty for any other effect."""
    return tuple(getattr(effect, "members", ()))


@dataclass(frozen=True, slots=True)
class StackedColumns:
    """A random effect laid over the residuals: columns of all its members at once.

    Attributes
    ----------
    gain : float
        By how much the log likelihood would rise with members of the likeliest scatter.
    start : ndarray, shape (D,)
        Where to begin the full fit.
    term : TermEvidence or None
        What the columns would bring as a term; None where the parameters absorb them all.
    """

    gain: float
    start: Floats
    term: TermEvidence | None


def lay_together(fitted: FittedHypothesis, effect: Effect) -> StackedColumns:
    """Screen a random effect: all of its members together, as they are linear where they scatter little.

    Parameters
    ----------
    fitted : FittedHypothesis
        The model without it.
    effect : Effect
    """
    extended = fitted.hypothesis.extended(effect)
    priors = [p.prior for p in effect.parameters(extended.scales)]
    middle = np.array([float(p.quantile(np.array(0.5))) for p in priors])
    own = np.flatnonzero([p == MEMBER for p in priors])
    theta = np.tile(np.concatenate([fitted.theta, middle]), (own.size, 1))
    theta[np.arange(own.size), fitted.theta.size + own] = 1.0
    change = stacked(extended, fitted.blocks, theta) - stacked(fitted.hypothesis, fitted.blocks, fitted.theta)
    columns = np.nan_to_num(change).T
    found = gains(fitted, [Term(effect.id, "", columns)])
    start = extended.space.unconstrain(np.concatenate([fitted.theta, middle]))
    if not found:
        return StackedColumns(-np.inf, start, None)
    whitened = fitted.whiten(columns.T).T
    a, b = whitened.T @ fitted.project_out(whitened), whitened.T @ fitted.left
    best = max((_members(a, b, size) for size in COEFFICIENT_SD_GRID), key=lambda m: m[0])
    _, size, weight = best
    place = fitted.z.size
    start[place] += np.log(size)
    start[place + own] = weight / size
    start[:place] += np.linalg.solve(
        fitted.precision, fitted.jacobian.T @ (fitted.whitened - whitened @ weight)
    )
    return StackedColumns(float(weight @ b - 0.5 * weight @ a @ weight), start, found[0])


def _members(a: Floats, b: Floats, size: float) -> tuple[float, float, Floats]:
    """Evidence of members that scatter by a size, the size, and the members."""
    precision = a + np.eye(b.size) / size**2
    weight = np.asarray(np.linalg.solve(precision, b), dtype=float)
    value = 0.5 * float(b @ weight) - 0.5 * float(np.linalg.slogdet(np.eye(b.size) + size**2 * a)[1])
    return value, float(size), weight


def holds_beside(law: Effect, beside: FittedHypothesis, alone: FittedHypothesis | None = None) -> bool:
    """Whether a law makes the measurements more likely where a random effect is in the model already.

    The fit of both is begun from the members as they are without the law, and from the law without members: what either
    explains the other may have taken already, and from there it does not give it back.

    Parameters
    ----------
    law : Effect
    beside : FittedHypothesis
        The model with the random effect.
    alone : FittedHypothesis, optional
        The model with the law in its place.
    """
    extended = beside.hypothesis.extended(law)
    prior = [p.prior for p in law.parameters(extended.scales)]
    middle = [float(p.transform.unconstrain(p.quantile(np.array(0.6)))) for p in prior]
    starts = [np.concatenate([beside.z, middle])]
    if alone is not None:
        own = alone.z.size - len(middle)
        none = extended.space.prior_centre()[own : beside.z.size]
        starts.append(np.concatenate([alone.z[:own], none, alone.z[own:]]))
    fits = (fit_hypothesis(extended, z, beside.noise) for z in starts)
    return any(both.ln_evidence > beside.ln_evidence for both in fits)
