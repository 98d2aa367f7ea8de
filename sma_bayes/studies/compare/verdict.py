"""Which model is preferred, and whether that is more than chance; weights for predicting with all of them.

A model is *preferred* by its evidence. The preference is *decisive* if, against every model of another family, the
Bayes factor is at least 20 beyond its own Monte Carlo error and measurements that were held out do not speak against
it. Otherwise the verdict is `CANNOT_TELL`. Two models that are the same curve are never told apart, whatever their
names: their evidences differ by their priors at most.

With equal odds before the data and a model among those compared that made them, at most one decisive verdict in 21 is
wrong against a given rival.

The verdict is about the models that the paper compares. One that only stands beside them (an *extra*: the modified
sigmoid with A2 = B2) has no vote, for at the paper's ratios of stiffness it is within 0.2 % of a logistic curve, and no
measurement would ever be decided; but it is named where it is not told from the preferred model.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.stats import t as student_t

from sma_bayes.arrays import Floats
from sma_bayes.errors import nats
from sma_bayes.studies.compare.schema import StatedDifference, StatedVerdict
from sma_bayes.studies.compare.words import listed, same_curve, spoken

CANNOT_TELL: Final = "cannot tell"
LN_BAYES_FACTOR_DECISIVE: Final = float(np.log(20.0))
"""Least ln Bayes factor of a decisive preference."""
DECISIVE_STANDARD_ERRORS: Final = 2.0
"""Standard errors by which the Bayes factor must exceed it."""
OPPOSING_STANDARD_ERRORS: Final = 1.5
"""Standard errors by which held-out measurements may lean to another family without speaking against."""
BOOTSTRAP_ROUNDS: Final = 2000
LEVEL: Final = 0.95
"""Of the interval of a held-out difference."""


@dataclass(frozen=True, slots=True, eq=False)
class Standing:
    """What is known of a model.

    Attributes
    ----------
    name, family, curve : str
    extra : bool
        Whether it has no vote.
    ln_evidence, ln_evidence_sd : float
    folds : ndarray, shape (B,)
        Log density of each held-out fold.
    """

    name: str
    family: str
    curve: str
    extra: bool
    ln_evidence: float
    ln_evidence_sd: float
    folds: Floats


def difference(one: Floats, other: Floats) -> StatedDifference:
    """Held-out difference of two models (B,), each; its error from the scatter of the folds, by Student's t."""
    d = one - other
    value, b = float(d.sum()), d.size
    if b < 2:
        return StatedDifference(value=value, se=None, low=None, high=None)
    se = float(np.sqrt(b) * d.std(ddof=1))
    reach = float(student_t.ppf(0.5 + 0.5 * LEVEL, b - 1)) * se
    return StatedDifference(value=value, se=se, low=value - reach, high=value + reach)


def judge(standings: Sequence[Standing]) -> StatedVerdict:
    """Compare models.

    Parameters
    ----------
    standings : sequence of Standing
        At least one that has a vote.
    """
    voting = [s for s in standings if not s.extra]
    best = max(voting, key=lambda s: s.ln_evidence)
    near = tuple(s.name for s in standings if s is not best and not _ahead(best, s))
    families = {s.family for s in voting if s.curve == best.curve}
    rivals = [s for s in voting if s.curve != best.curve and s.family not in families]
    rival = max(rivals, key=lambda s: s.ln_evidence) if rivals else None
    factor = best.ln_evidence - rival.ln_evidence if rival else 0.0
    lead, decisive = _reason(best, voting, families, rival)
    same = sorted(s.name for s in voting if s.curve == best.curve)
    twins = tuple(same) if rival is not None and len(families) > 1 else ()
    return StatedVerdict(
        preferred=best.name,
        verdict=best.family if decisive else CANNOT_TELL,
        decisive=decisive,
        probability=_probability(best, voting),
        rival=rival.name if rival else "",
        ln_bayes_factor=factor,
        not_told_from=near,
        twins=twins,
        why=f"{same_curve(twins)}, {lead}" if twins else lead,
        why_alone=lead,
    )


def _reason(
    best: Standing, voting: Sequence[Standing], families: Collection[str], rival: Standing | None
) -> tuple[str, bool]:
    """Why, the models that are one curve apart, and whether the preference is decisive."""
    if rival is None:
        return (
            f"there is no model but {listed(sorted(s.name for s in voting if s.curve == best.curve))}",
            False,
        )
    factor = best.ln_evidence - rival.ln_evidence
    first, second = f"the {spoken(best.name)}", f"the {spoken(rival.name)}"
    if len(families) > 1:
        enough = "" if _ahead(best, rival) else ", which is too little to tell"
        return f"ahead of {second} by {nats(factor)} in ln evidence{enough}", False
    ratio = f"ln Bayes factor of {first} over {second} is {nats(factor)}"
    if not _ahead(best, rival):
        return f"{ratio}, less than {LN_BAYES_FACTOR_DECISIVE:.1f} beyond its error", False
    others = [s for s in voting if s.family != best.family]
    worst = min(others, key=lambda o: _lead(best, o))
    if _lead(best, worst) < -OPPOSING_STANDARD_ERRORS:
        lost = nats(-difference(best.folds, worst.folds).value)
        preferred = f"the evidence prefers {first} by {nats(factor)} (logarithm)"
        return (
            f"{preferred}, but the {spoken(worst.name)} predicts better what was held out, by {lost}",
            False,
        )
    gained = difference(best.folds, rival.folds)
    low, high = (-np.inf, np.inf) if gained.low is None or gained.high is None else (gained.low, gained.high)
    interval = f"{nats(gained.value)} ({nats(low)} to {nats(high)})"
    return f"{ratio}; held out, its log density is greater by {interval}", True


def _ahead(one: Standing, other: Standing) -> bool:
    """Whether one model's evidence is decisively greater."""
    error = float(np.hypot(one.ln_evidence_sd, other.ln_evidence_sd))
    return one.ln_evidence - other.ln_evidence >= LN_BAYES_FACTOR_DECISIVE + DECISIVE_STANDARD_ERRORS * error


def _lead(one: Standing, other: Standing) -> float:
    """Held-out difference in its standard errors; nought where there are too few folds for one."""
    d = difference(one.folds, other.folds)
    return d.value / d.se if d.se else 0.0


def _probability(best: Standing, voting: Sequence[Standing]) -> float:
    champions = [max(s.ln_evidence for s in voting if s.family == f) for f in {s.family for s in voting}]
    return float(1.0 / np.sum(np.exp(np.array(champions) - best.ln_evidence)))


def stacking_weights(log_density: Mapping[str, Floats]) -> dict[str, float]:
    """Weights with which a mixture of the models predicts held-out samples best.

    Maximises the mean of ``ln sum of w p`` by expectation-maximisation, which never leaves the simplex.

    Parameters
    ----------
    log_density : mapping of str to ndarray, shape (n,)
        Held-out log density of each sample under each model.

    References
    ----------
    Y. Yao, A. Vehtari, D. Simpson, A. Gelman, "Using stacking to average Bayesian predictive distributions", Bayesian
    Analysis 13 (2018) 917, doi 10.1214/17-BA1091.

    Examples
    --------
    >>> stacking_weights({"good": np.zeros(9), "bad": np.full(9, -5.0)})["good"] > 0.999
    True
    """
    names = list(log_density)
    values = np.stack([log_density[n] for n in names])
    p = np.exp(values - values.max(axis=0))
    weight = np.full(len(names), 1.0 / len(names))
    for _ in range(BOOTSTRAP_ROUNDS):
        share = weight[:, None] * p
        new = (share / share.sum(axis=0)).mean(axis=1)
        if np.max(np.abs(new - weight)) < 1e-9:
            weight = new
            break
        weight = new
    return {n: float(w) for n, w in zip(names, weight, strict=True)}
