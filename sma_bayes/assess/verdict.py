"""Which model is preferred, and whether that is more than chance; weights for predicting with all of them.

A model is *preferred* by its evidence. The preference is *decisive* if, against every model of another family, the
Bayes factor is at least 20 beyond its own Monte Carlo error and measurements that were held out do not speak against
it. Otherwise the verdict is `CANNOT_TELL`. Two models that are the same curve are never told apart, whatever their
names: their evidences differ by their priors at most.

With equal odds before the data and a model among those compared that made them, at most one decisive verdict in 21 is
wrong against a given rival.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.stats import t as student_t

from sma_bayes.quantities import Floats

CANNOT_TELL: Final = "cannot tell"
DECISIVE: Final = float(np.log(20.0))
"""Least ln Bayes factor of a decisive preference."""
ERRORS: Final = 2.0
"""Standard errors by which the Bayes factor must exceed it."""
LEVEL: Final = 0.95
"""Of the interval of a held-out difference."""


@dataclass(frozen=True, slots=True, eq=False)
class Standing:
    """What is known of a model.

    Attributes
    ----------
    name, family, curve : str
    ln_evidence, ln_evidence_sd : float
    folds : ndarray, shape (B,)
        Log density of each held-out fold.
    """

    name: str
    family: str
    curve: str
    ln_evidence: float
    ln_evidence_sd: float
    folds: Floats


@dataclass(frozen=True, slots=True)
class Difference:
    """Held-out log density of one model over that of another.

    Attributes
    ----------
    value, se, low, high : float
        Sum over the folds, its standard error from their scatter, and its interval by Student's t.
    """

    value: float
    se: float
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class Verdict:
    """Outcome of a comparison.

    Attributes
    ----------
    preferred : str
        Model of greatest evidence.
    verdict : str
        Its family if the preference is decisive, else `CANNOT_TELL`.
    decisive : bool
    probability : float
        Of the preferred model's family, with equal odds for the best model of each family.
    rival : str
        Best model of another family; empty where there is none.
    ln_bayes_factor : float
        Of the preferred model over the rival.
    why : str
    """

    preferred: str
    verdict: str
    decisive: bool
    probability: float
    rival: str
    ln_bayes_factor: float
    why: str


def difference(one: Floats, other: Floats) -> Difference:
    """Held-out difference of two models (B,), each."""
    d = one - other
    value, b = float(d.sum()), d.size
    if b < 2:
        return Difference(value, np.inf, -np.inf, np.inf)
    se = float(np.sqrt(b) * d.std(ddof=1))
    reach = float(student_t.ppf(0.5 + 0.5 * LEVEL, b - 1)) * se
    return Difference(value, se, value - reach, value + reach)


def judge(standings: Sequence[Standing]) -> Verdict:
    """Compare models.

    Parameters
    ----------
    standings : sequence of Standing
        At least one.
    """
    best = max(standings, key=lambda s: s.ln_evidence)
    twins = [s for s in standings if s.curve == best.curve]
    families = sorted({s.family for s in twins})
    if len(families) > 1:
        return _same_curve(best, twins, standings)
    others = [s for s in standings if s.family != best.family]
    if not others:
        return Verdict(best.name, best.family, False, 1.0, "", 0.0, "there is no model of another family")
    rival = max(others, key=lambda s: s.ln_evidence)
    factor, sd = _factor(best, rival)
    champions = [
        max(s.ln_evidence for s in standings if s.family == f) for f in {s.family for s in standings}
    ]
    probability = float(1.0 / np.sum(np.exp(np.array(champions) - best.ln_evidence)))
    against = [o for o in others if difference(best.folds, o.folds).high < 0.0]
    if factor < DECISIVE + ERRORS * sd:
        why = f"ln Bayes factor over {rival.name} is {factor:.1f}, less than {DECISIVE:.1f} beyond its error"
        return Verdict(best.name, CANNOT_TELL, False, probability, rival.name, factor, why)
    if against:
        worst = min(against, key=lambda o: difference(best.folds, o.folds).value)
        why = f"the evidence prefers {best.name}, but {worst.name} predicts what was held out better"
        return Verdict(best.name, CANNOT_TELL, False, probability, rival.name, factor, why)
    gained = difference(best.folds, rival.folds)
    why = (
        f"ln Bayes factor over {rival.name} is {factor:.1f}; held out, the log density differs by "
        f"{gained.value:.1f} ({gained.low:.1f} to {gained.high:.1f})"
    )
    return Verdict(best.name, best.family, True, probability, rival.name, factor, why)


def _same_curve(best: Standing, twins: Sequence[Standing], standings: Sequence[Standing]) -> Verdict:
    names = " and ".join(sorted(t.name for t in twins))
    rivals = [s for s in standings if s.curve != best.curve]
    if not rivals:
        return Verdict(best.name, CANNOT_TELL, False, 0.5, "", 0.0, f"{names} are the same curve")
    rival = max(rivals, key=lambda s: s.ln_evidence)
    factor, sd = _factor(best, rival)
    ahead = "ahead of" if factor >= DECISIVE + ERRORS * sd else "not told from"
    why = f"{names} are the same curve of this channel; together they are {ahead} {rival.name} by ln {factor:.1f}"
    share = 1.0 / len({t.family for t in twins})
    probability = float(share / (1.0 + np.exp(min(-factor, 500.0))))
    return Verdict(best.name, CANNOT_TELL, False, probability, rival.name, factor, why)


def _factor(one: Standing, other: Standing) -> tuple[float, float]:
    return one.ln_evidence - other.ln_evidence, float(np.hypot(one.ln_evidence_sd, other.ln_evidence_sd))


def stacking_weights(log_density: Mapping[str, Floats], *, rounds: int = 2000) -> dict[str, float]:
    """Weights with which a mixture of the models predicts held-out samples best.

    Maximises the mean of ``ln sum of w p`` by expectation-maximisation, which never leaves the simplex.

    Parameters
    ----------
    log_density : mapping of str to ndarray, shape (n,)
        Held-out log density of each sample under each model.
    rounds : int

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
    for _ in range(rounds):
        share = weight[:, None] * p
        new = (share / share.sum(axis=0)).mean(axis=1)
        if np.max(np.abs(new - weight)) < 1e-9:
            weight = new
            break
        weight = new
    return {n: float(w) for n, w in zip(names, weight, strict=True)}
