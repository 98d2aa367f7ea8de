"""The average of correlation factors over records, by every rule that may be meant, and where 0.95 falls in it.

The paper states an average correlation factor of 0.95 and not how it was taken. Each draw of the posterior gives a
factor to every record, hence an average; so an average has a posterior too.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.assess.correlation import FACTORS, Agreement, joined, quantiles
from sma_bayes.paper.correlation import CLAIMED


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
    data : str
        ``measured`` or ``replicated``, where both are told.
    """

    key: str
    branch: str
    channel: str
    quantity: str
    unit: str
    posterior: str
    converged: bool
    agreement: Agreement
    data: str = "measured"


def averages(scored: Iterable[Scored]) -> list[dict[str, Any]]:
    """Averages of each channel, over each branch and over both.

    Records that did not converge are left out, and named. Channels are not averaged with each other: high factors
    of one would hide low ones of another.

    Returns
    -------
    list of dict
        ``channel``, ``quantity``, ``unit``, ``branch`` (empty for both), ``records``, ``left_out``, ``n``, ``draws``,
        ``threshold``; by factor (``r``, ``r2``, ``adj_r2``, ``rmse``) and rule ``q05``, ``median``, ``q95``,
        ``undefined`` and, of r, ``above``: the posterior probability that the average exceeds the threshold.
    """
    found = Averages()
    for s in scored:
        found.add(s)
    return found.entries()


class Averages:
    """Averages to which records are added one by one, so that nobody has to keep the draws of all of them."""

    def __init__(self) -> None:
        self._groups: dict[tuple[str, str, str], dict[str, _RecordsOfAverage]] = {}

    def add(self, s: Scored) -> None:
        """Add a record to the averages of its branch and of both."""
        group = self._groups.setdefault((s.channel, s.quantity, s.unit), {"": _RecordsOfAverage()})
        for branch in ("", s.branch):
            group.setdefault(branch, _RecordsOfAverage()).add(s)

    def entries(self) -> list[dict[str, Any]]:
        """What `averages` gives."""
        out = []
        for (channel, quantity, unit), group in self._groups.items():
            branches = [branch for branch in group if branch]
            for branch in (*branches, "") if len(branches) > 1 else branches:
                head = {"channel": channel, "quantity": quantity, "unit": unit, "branch": branch}
                out.append(head | group[branch].entry())
        return out


class _RecordsOfAverage:
    """Records that are averaged with each other."""

    def __init__(self) -> None:
        self.kept: list[str] = []
        self.left_out: list[str] = []
        self.counted: dict[str, int] = {}
        self.draws = AverageDraws()

    def add(self, s: Scored) -> None:
        if not s.converged:
            self.left_out.append(s.key)
            return
        self.kept.append(s.key)
        self.counted[s.posterior] = s.agreement.parameters
        self.draws.add(s.agreement)

    def entry(self) -> dict[str, Any]:
        head = {"records": self.kept, "left_out": self.left_out, "threshold": CLAIMED}
        if not self.kept:
            return {**head, "n": 0, "draws": 0}
        draws = self.draws.by_rule(sum(self.counted.values()))
        stated = {
            factor: {rule: _stated(values, factor) for rule, values in rules.items()}
            for factor, rules in draws.items()
        }
        return {**head, "n": self.draws.joined.n, "draws": self.draws.joined.draws, **stated}


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
    found = AverageDraws()
    for part in parts:
        found.add(part)
    return found.by_rule(parameters)


class AverageDraws:
    """Sums over records of each factor's draws; where records differ in draws, as many are used as the shortest has."""

    def __init__(self) -> None:
        self._joined: Agreement | None = None
        self._count = 0
        self._sums: dict[str, Floats] = {}

    @property
    def joined(self) -> Agreement:
        """The agreement of all samples together.

        Raises
        ------
        MeasurementError
            If no record was added.
        """
        return joined([] if self._joined is None else [self._joined])

    def add(self, part: Agreement) -> None:
        """Add a record."""
        self._joined = part if self._joined is None else joined([self._joined, part])
        self._count += 1
        size = self._joined.draws
        with np.errstate(
            divide="ignore"
        ):  # r = 1 is infinite by Fisher's transformation, and 1 again after it
            new = {**{name: getattr(part, name) for name in FACTORS}, "fisher": np.arctanh(part.r)}
        before = self._sums or dict.fromkeys(new, np.zeros(size))
        self._sums = {name: before[name][:size] + values[:size] for name, values in new.items()}

    def by_rule(self, parameters: int | None = None) -> dict[str, dict[str, Floats]]:
        """What `average_draws` gives."""
        whole = joined([self.joined], parameters)
        return {
            name: {
                "plain": self._sums[name] / self._count,
                **({"fisher": np.tanh(self._sums["fisher"] / self._count)} if name == "r" else {}),
                "pooled": getattr(whole, name),
            }
            for name in FACTORS
            if name != "adj_r2" or whole.parameters > 0
        }
