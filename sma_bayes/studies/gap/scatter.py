"""Random effects among the candidates: how they are screened, and when a law is preferred to them.

Runs or cycles that each have numbers of their own explain whatever differs between them, so a random effect says least
and is named last. A law of the load, of the cycle, of time, is preferred where it explains at least half as much and
makes the measurements more likely beside the random effect: then what members have of their own scatters less.

What members have of their own may still go with a setting that was recorded: then a law of it that is not in the
catalogue explains as much, and the random effect is a description, not a name. So it is where one member alone differs
or a few do, where the cycles of each condition settle, and where every second one differs.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.stats import chi2

from sma_bayes.arrays import Floats
from sma_bayes.effects.needs import LEAST_RELATIVE_VARIATION
from sma_bayes.effects.scatter import MEMBER, numbers_of_members
from sma_bayes.effects.types import Effect
from sma_bayes.records.history import History
from sma_bayes.studies.gap.fitting import FittedHypothesis, fit_hypothesis, stacked
from sma_bayes.studies.gap.flexible import COEFFICIENT_SD_GRID, Term, TermEvidence, gains

LEAST_SHARE_OF_LAW: Final = 0.5
"""Share of the log Bayes factor of a random effect that a law must have to be preferred to it."""


NUMBERED_BY: Final = {"condition": "run", "cycle": "cycle_of_all"}
"""Input that numbers the members of a random effect, by their covariate."""
LEAST_SHARE_FOLLOWED: Final = 0.9
"""Share of how members differ that a straight line in a setting explains where they follow it, or one of them alone."""
LEAST_MEMBERS_FOR_LINE: Final = 3
"""Members from which on a straight line says something."""
LEAST_CYCLES_TO_SETTLE: Final = 5
"""Cycles of each condition, from which on it is asked whether they settle: five that scatter do in 2 % of cases."""
LEAST_MEMBERS_FOR_ONE: Final = 5
"""Members from which on one of them can be told from scatter: of five that scatter, one holds 90 % in 7 % of cases."""
LEAST_SHARE_OF_FEW: Final = 0.95
"""Share of how members differ that a few of them must have where more than one alone differ from the others."""
LEAST_SHARE_BESIDE_ALIKE: Final = 0.8
"""The same where the others differ no more than numbers that are not known better do."""
ALIKE_P: Final = 0.05
"""Probability up to which numbers that differ as much are not alike."""
MEMBERS_FOR_EACH_OF_FEW: Final = 4
"""Members for each of these, at least: of those that scatter, a quarter holds 95 % in 1 % of cases at most."""
SETTINGS: Final = (
    "load", "current", "frequency", "duty_cycle", "rate", "ambient_temperature", "temperature", "cycle", "time",
)  # fmt: skip
"""What members may follow: of the temperature, its peak; of the others, the median over the member."""


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


@dataclass(frozen=True, slots=True)
class FollowedSetting:
    """What members of a random effect follow: a setting, a course in each condition, or one or few that are alone.

    Attributes
    ----------
    covariate : str
        Of `SETTINGS`; what a member is, where one is alone.
    share : float
        What a straight line in it explains of how members differ, or a course, or those members.
    member : str or None
        The one or few that differ from all others; None where a setting is followed.
    settles : bool
        Whether it is the cycle within each condition, and the line one in its logarithm or in what dies away by a
        factor of e a cycle.
    alternates : bool
        Whether it is the cycle, of which every second one is like the others that are odd, or even.
    """

    covariate: str
    share: float
    member: str | None = None
    settles: bool = False
    alternates: bool = False


def followed_setting(fitted: FittedHypothesis, effect: Effect) -> FollowedSetting | None:
    """The recorded setting that members of a random effect follow, or those of them that differ from all others.

    Cycles may also settle in each condition, as those of a specimen that is trained do, or of a rig that warms up: then
    the line is one in the logarithm of their number, or in what dies away with it, with a level and a slope for each
    condition. And odd cycles may differ from even ones.

    None where there is neither, for a law, and with fewer than three members, which are always on a line.

    How members differ is weighed by how well it is known: a line of each number (offset, shift while heating, shift
    while cooling) in the setting is fitted to the numbers of all members by generalised least squares, with their
    covariance about the mode, and compared with their mean.

    Parameters
    ----------
    fitted : FittedHypothesis
        The model with the effect.
    effect : Effect
    """
    members = members_of(effect)
    if not members:
        return None
    hypothesis = fitted.hypothesis
    at = hypothesis.effect_positions[effect.id]
    free = hypothesis.space.free_index.tolist()
    own = [free.index(i) for i in at.tolist()]
    numbers, jacobian = numbers_of_members(fitted.theta[at])
    labels = _labels(hypothesis.histories, NUMBERED_BY[members[0]])
    there = list(labels)  # a part of the measurements may lack some
    if len(there) < LEAST_MEMBERS_FOR_LINE:
        return None
    kept = (np.arange(3)[:, None] * (numbers.size // 3) + np.array(there)).ravel()
    numbers, jacobian = numbers[kept], jacobian[kept]
    covariance = jacobian @ fitted.covariance[np.ix_(own, own)] @ jacobian.T
    whitening = np.linalg.inv(np.linalg.cholesky(covariance))
    settings = _settings(hypothesis.histories, NUMBERED_BY[members[0]], there)
    level = np.ones(len(there))
    differ = _left(whitening, numbers, level[:, None])

    def share(values: Floats) -> float:
        return 1.0 - _left(whitening, numbers, np.column_stack([level, values])) / differ

    found = [FollowedSetting(name, share(values)) for name, values in settings.items()]
    if members[0] == "cycle":
        run, number = _cycles(hypothesis.histories, there)
        found += [FollowedSetting("cycle", share(c), settles=True) for c in _settling(run, number)]
        found += [FollowedSetting("cycle", share(number % 2), alternates=True)]
    best = max(found, key=lambda f: f.share, default=None)
    if best is not None and best.share >= LEAST_SHARE_FOLLOWED:
        return best
    alone = _alone(
        lambda i: _left(whitening, numbers, np.column_stack([level, np.eye(level.size)[:, i]])), level.size
    )
    if alone is None:
        return None
    names = [*labels.values()]
    return FollowedSetting(
        members[0], share(np.eye(level.size)[:, alone]), ", ".join(names[i] for i in alone)
    )


def _alone(left: Callable[[list[int]], float], members: int) -> list[int] | None:
    """The one member that differs from all others, or the few that do; None where there are none.

    Parameters
    ----------
    left : callable
        Sum of squares that is left of the three numbers of all members where some have levels of their own, which
        chance alone makes as large as their number.
    members : int
    """
    if members < LEAST_MEMBERS_FOR_ONE:
        return None
    chosen: list[int] = []
    differ = left([])
    for many in range(1, max(members // MEMBERS_FOR_EACH_OF_FEW, 1) + 1):
        others = [i for i in range(members) if i not in chosen]
        rest = [left([*chosen, i]) for i in others]
        chosen.append(others[int(np.argmin(rest))])
        share = 1.0 - min(rest) / differ
        alike = chi2.sf(min(rest), 3 * (members - 1 - many)) > ALIKE_P
        least = LEAST_SHARE_FOLLOWED if many == 1 else LEAST_SHARE_OF_FEW
        if share >= (LEAST_SHARE_BESIDE_ALIKE if alike else least):
            return sorted(chosen)
    return None


def _cycles(histories: Sequence[History], members: Sequence[int]) -> tuple[Floats, Floats]:
    """Condition of each cycle, by its place, and which of its cycles it is, from 0."""
    run, number = np.full(len(members), -1.0), np.zeros(len(members))
    for i, h in enumerate(histories):
        own = np.isin(members, h.inputs[NUMBERED_BY["cycle"]])
        run[own], number[own] = i, np.arange(np.count_nonzero(own))
    return run, number


def _settling(run: Floats, number: Floats) -> tuple[Floats, ...]:
    """Columns (members, k) that settle with the cycles of each condition, beside its level; none if these are few."""
    level = (run[:, None] == np.unique(run)).astype(float)
    if level.sum(axis=0).min() < LEAST_CYCLES_TO_SETTLE:
        return ()
    courses = (np.log1p(number), np.exp(-number))
    return tuple(np.hstack([level[:, 1:], level * course[:, None]]) for course in courses)


def _left(whitening: Floats, numbers: Floats, columns: Floats) -> float:
    """Sum of squares that the same columns for each of three numbers of members leave of these."""
    design = whitening @ np.kron(np.eye(3), columns)
    target = whitening @ numbers
    return float(np.sum((target - design @ np.linalg.lstsq(design, target, rcond=None)[0]) ** 2))


def _labels(histories: Sequence[History], numbered_by: str) -> dict[int, str]:
    """What each member is called, by its number: by its condition, and by its cycle where it is one."""
    out = {}
    for h in histories:
        numbers, first = np.unique(h.inputs[numbered_by], return_index=True)
        for number, cycle in zip(numbers.tolist(), h.inputs["cycle"][first].tolist(), strict=True):
            cycle_text = f"cycle {cycle:g} of " if numbered_by == NUMBERED_BY["cycle"] else ""
            out[int(number)] = f"{cycle_text}{h.condition.id}"
    return dict(sorted(out.items()))


def _settings(histories: Sequence[History], numbered_by: str, members: Sequence[int]) -> dict[str, Floats]:
    """Settings that differ between members, about their mean and over their scatter."""
    member = np.concatenate([h.inputs[numbered_by] for h in histories]).astype(np.intp)
    kelvins = float(np.ptp(np.concatenate([h.inputs["temperature"] for h in histories])))
    out = {}
    for name in SETTINGS:
        if all(name in h.inputs for h in histories):
            values = np.concatenate([h.inputs[name] for h in histories])
            values = np.abs(values) if name == "rate" else values
            of_member = np.max if name == "temperature" else np.median
            each = np.array([of_member(values[member == i]) for i in members])
            whole = kelvins if "temperature" in name else float(np.mean(np.abs(each)))
            if np.ptp(each) > LEAST_RELATIVE_VARIATION * whole:
                out[name] = (each - each.mean()) / each.std()
    return out
