"""The average of correlation factors over records, by every rule that may be meant, and where 0.95 falls in it.

The paper states an average correlation factor of 0.95 and not how it was taken. Each draw of the posterior gives a
factor to every record, hence an average; so an average has a posterior too.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from sma_bayes.assess.correlation import FACTORS, Agreement, joined, quantiles
from sma_bayes.paper.correlation import CLAIMED
from sma_bayes.quantities import Floats

RULES: Final[Mapping[str, str]] = MappingProxyType(
    {
        "plain": "mean of the records' factors",
        "fisher": "tanh of the mean of artanh r",
        "pooled": "one factor over all samples of all records",
    }
)
"""How to average."""


@dataclass(frozen=True, slots=True, eq=False)
class Scored:
    """Agreement of one record of one channel, and what it is to be averaged with.

    Attributes
    ----------
    key, branch, channel, quantity, unit : str
    posterior : str
        Records with the same name here share their parameters, which are counted once.
    converged : bool
    agreement : Agreement
    """

    key: str
    branch: str
    channel: str
    quantity: str
    unit: str
    posterior: str
    converged: bool
    agreement: Agreement


def averages(scored: Sequence[Scored]) -> list[dict[str, Any]]:
    """Averages of each channel, over each branch and over both.

    Records that did not converge are left out, and named. Channels are not averaged with each other: high factors
    of one would hide low ones of another.

    Parameters
    ----------
    scored : sequence of Scored

    Returns
    -------
    list of dict
        ``channel``, ``quantity``, ``unit``, ``branch`` (empty for both), ``records``, ``left_out``, ``n``, ``draws``,
        ``threshold``; by factor (``r``, ``r2``, ``adj_r2``, ``rmse``) and rule ``q05``, ``median``, ``q95``,
        ``undefined`` and, of r, ``above``: the posterior probability that the average exceeds the threshold.
    """
    groups: dict[tuple[str, str, str], list[Scored]] = {}
    for s in scored:
        groups.setdefault((s.channel, s.quantity, s.unit), []).append(s)
    out = []
    for group in groups.values():
        branches = list(dict.fromkeys(s.branch for s in group))
        for branch in (*branches, "") if len(branches) > 1 else branches:
            out.append(_entry([s for s in group if branch in ("", s.branch)], branch))
    return out


def _entry(group: Sequence[Scored], branch: str) -> dict[str, Any]:
    first, kept = group[0], [s for s in group if s.converged]
    head = {
        "channel": first.channel,
        "quantity": first.quantity,
        "unit": first.unit,
        "branch": branch,
        "records": [s.key for s in kept],
        "left_out": [s.key for s in group if not s.converged],
        "threshold": CLAIMED,
    }
    if not kept:
        return {**head, "n": 0, "draws": 0}
    parts = [s.agreement for s in kept]
    counted = {s.posterior: s.agreement.parameters for s in kept}
    draws = average_draws(parts, sum(counted.values()))
    stated = {
        factor: {rule: _stated(values, factor) for rule, values in rules.items()}
        for factor, rules in draws.items()
    }
    count = min(part.draws for part in parts)
    return {**head, "n": sum(part.n for part in parts), "draws": count, **stated}


def _stated(values: Floats, factor: str) -> dict[str, float | None]:
    found = quantiles(values)
    return {**found, "above": probability_above(values)} if factor == "r" else found


def probability_above(values: Floats, threshold: float = CLAIMED) -> float:
    """Share of the draws (N,) that exceed a threshold; one in which the factor is undefined does not."""
    return float(np.mean(values > threshold))  # comparing with NaN is false


def average_draws(parts: Sequence[Agreement], parameters: int | None = None) -> dict[str, dict[str, Floats]]:
    """Draws (N,) of each factor's average by each rule that makes sense of it.

    Where a draw leaves the factor of one record undefined, its plain and Fisher averages are undefined too; the
    pooled one need not be.

    Parameters
    ----------
    parts : sequence of Agreement
        One for each record. Draws are paired as they come: independent where the posteriors are.
    parameters : int, optional
        Parameters of all records together; the sum by default.
    """
    whole = joined(parts, parameters)
    each = {factor: np.stack([getattr(p, factor)[: whole.draws] for p in parts]) for factor in FACTORS}
    with np.errstate(divide="ignore"):  # r = 1 is infinite by Fisher's transformation, and 1 again after it
        fisher = np.tanh(np.mean(np.arctanh(each["r"]), axis=0))
    return {
        name: {
            "plain": each[name].mean(axis=0),
            **({"fisher": fisher} if name == "r" else {}),
            "pooled": getattr(whole, name),
        }
        for name in FACTORS
        if name != "adj_r2" or whole.parameters > 0
    }
