"""The spring as it was fitted: the curve that its sweeps have in common, and their numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.errors import MeasurementError
from sma_bayes.records.types import Branch, Record
from sma_bayes.studies.cycles.laws import LAW_POWERS, LAWS, N0_GRID, NONE, LawPosterior, Series, approach
from sma_bayes.studies.cycles.sweeps import (
    NUMBERS,
    PRIOR_SD,
    USUAL_SCATTER,
    Strand,
    calibration_remarks,
    fit_strand,
    sweeps_of,
)
from sma_bayes.studies.watch.evidence import Watched
from sma_bayes.studies.watch.naming import Cause, watched_together
from sma_bayes.studies.watch.state import WATCHED, StrandNumbers

N0_MASS: Final = 0.95
"""Share of the posterior of the N0 of a number whose values count as possible while nothing changes."""
MAX_N0: Final = 7


@dataclass(frozen=True, slots=True, eq=False)
class Reference:
    """The spring as it was fitted, in one condition.

    Attributes
    ----------
    strands : tuple of Strand
        One for each branch and channel.
    cycle : ndarray, shape (m,)
        Cycles of which all sweeps were fitted.
    numbers : tuple of tuple of StrandNumbers
        Of each strand, by cycle.
    law : str
        Law of training that the fitted sweeps follow, or ``none``.
    paces : tuple of (float, float)
        Its possible powers and N0.
    remarks : tuple of str
    causes : tuple of Cause
        Those whose numbers are watched together.
    together : ndarray, shape (C, K)
        Weights of the numbers of each.
    """

    strands: tuple[Strand, ...]
    cycle: Floats
    numbers: tuple[tuple[StrandNumbers, ...], ...]
    law: str
    paces: tuple[tuple[float, float], ...]
    remarks: tuple[str, ...]
    causes: tuple[Cause, ...]
    together: Floats

    @property
    def fitted(self) -> int:
        """How many cycles were fitted."""
        return int(self.cycle.size)

    @property
    def keys(self) -> list[tuple[int, int]]:
        """Strand and number of each number that is watched."""
        return [(s, n) for s in range(len(self.strands)) for n in range(len(WATCHED))]

    @property
    def series(self) -> int:
        """How many e-processes there are: of all numbers, and of those together."""
        return len(self.keys) + len(self.causes)

    def measure(self, sweeps: Mapping[str, Record]) -> list[StrandNumbers]:
        """Numbers of the sweeps of a new cycle, by strand."""
        out = []
        for strand in self.strands:
            record = sweeps[strand.record.branch.value]
            own = replace(record, observed={strand.channel: record.observed[strand.channel]})
            out.append(_numbers(strand, own))
        return out

    def watched(self, later: Sequence[Sequence[StrandNumbers]]) -> Watched:
        """All numbers, cycle by cycle.

        Parameters
        ----------
        later : sequence of sequence of StrandNumbers
            Of watched cycles, by strand.
        """
        rows = [[self.numbers[s][i] for s in range(len(self.strands))] for i in range(self.fitted)]
        rows += [list(cycle) for cycle in later]
        value = np.array([[sweep.value for sweep in row] for row in rows]).reshape(len(rows), -1)
        usual = [float(np.median([n.samples for n in own])) for own in self.numbers]
        weight = [min(1.0, *(n.samples / u for n, u in zip(row, usual, strict=True))) for row in rows]
        return Watched(value, np.array(weight), self.fitted, self._designs(len(later)), self.together)

    def _designs(self, later: int) -> tuple[Floats, ...]:
        since = np.concatenate(
            [self.cycle - self.cycle[0], self.cycle[-1] - self.cycle[0] + 1.0 + np.arange(later)]
        )
        ones = np.ones(since.size)
        if self.law == NONE:
            return (ones[:, None],)
        last = float(self.cycle[-1] - self.cycle[0])
        return tuple(np.column_stack([ones, approach(p, n0, since, last)]) for p, n0 in self.paces)


def reference_of(records: Sequence[Record], model: Mapping[str, str], seed: int) -> Reference:
    """Find common curves and numbers of the sweeps that were fitted.

    Parameters
    ----------
    records : sequence of Record
        Of one condition.
    model : mapping of str to str
        Response model of each, by its key.
    seed : int

    Raises
    ------
    MeasurementError
        If a branch has no sweep, or its curve can't be found.
    """
    found: list[tuple[Record, str, Floats]] = []
    remarks: list[str] = []
    for record in sorted(records, key=lambda r: list(Branch).index(r.branch)):
        for channel in record.channels:
            sweeps, cycle, told = sweeps_of(record, channel)
            remarks += [text for text in told if text not in remarks]
            if not cycle.size:
                raise MeasurementError(
                    f"{record.key} has no sweep of 8 samples or more",
                    expected="sweeps of which numbers can be told",
                    remedy="fit denser measurements",
                )
            found.append((sweeps, channel, cycle))
    common = sorted(set.intersection(*({float(c) for c in cycle} for _, _, cycle in found)))
    if not common:
        raise MeasurementError(
            "no cycle of the fit has a sweep of every branch", expected="at least one whole cycle"
        )
    remarks += calibration_remarks(r for r, _, _ in found)
    strands = [fit_strand(r, channel, cycle, model[r.key], seed) for r, channel, cycle in found]
    numbers = tuple(tuple(_numbers(s, s.part(s.cycle == c)[0], fitted=True) for c in common) for s in strands)
    law, paces = _law(strands, np.array(common), numbers)
    causes, together = zip(*watched_together(strands), strict=True)
    return Reference(
        tuple(strands), np.array(common), numbers, law, paces, (*remarks, *_told(len(common), law)), causes,
        np.array(together),
    )  # fmt: skip


def _told(fitted: int, law: str) -> list[str]:
    if fitted == 1:
        return [
            "the fit has one cycle: how much sweeps scatter is not known from it and is estimated from the watched "
            "cycles alone; no change is told before the third of them, and small ones take many"
        ]
    few = ["the fit has two cycles: how much sweeps scatter rests on few"] if fitted == 2 else []
    trained = (
        [f"the fitted cycles train ({law}): that this goes on counts as no change"] if law != NONE else []
    )
    return few + trained


def _numbers(strand: Strand, sweep: Record, *, fitted: bool = False) -> StrandNumbers:
    """Numbers of one sweep about the common curve."""
    own = strand.about(sweep, np.ones(1))
    left = sweep.observed[strand.channel] - strand.curve(own.numbers[0], sweep.temperature)
    noise = float(np.log(max(float(np.sqrt(np.mean(left**2))) / strand.span, 1e-12)))
    if fitted:  # the common curve has taken some of it
        n = strand.record.n
        taken = strand.free.size + (0.0 if strand.weights is None else strand.weights.degrees_of_freedom)
        noise += 0.5 * float(np.log(n / max(n - taken, 1.0)))
    return StrandNumbers(
        value=(*own.numbers[0].tolist(), noise), sd=tuple(own.sds[0].tolist()), samples=sweep.n
    )


def _law(
    strands: Sequence[Strand], cycle: Floats, numbers: Sequence[Sequence[StrandNumbers]]
) -> tuple[str, tuple[tuple[float, float], ...]]:
    """The law of training of the fitted cycles, if one is supported, and what of it is possible."""
    series = [
        Series(
            cycle - cycle[0],
            np.array([n.value[i] for n in numbers[s]]),
            np.array([n.sd[i] for n in numbers[s]]) ** 2,
            float(PRIOR_SD[i]),
            float(USUAL_SCATTER[i]),
            name,
        )
        for s in range(len(strands))
        for i, name in enumerate(NUMBERS)
    ]
    posterior = LawPosterior(series)
    if posterior.chosen == NONE:
        return NONE, ()
    paces: list[tuple[float, float]] = []
    for form in LAWS:
        if posterior.probability[form] >= 1.0 - N0_MASS:
            reached = np.cumsum(posterior.own_pace_weights(form))
            tail = 0.5 * (1.0 - N0_MASS)
            low, high = (int(np.searchsorted(reached, q)) for q in (tail, 1.0 - tail))
            some = np.unique(np.linspace(low, min(high, N0_GRID.size - 1), MAX_N0).round().astype(int))
            paces += [(power, float(N0_GRID[i])) for power in LAW_POWERS[form] for i in some]
    return posterior.chosen, tuple(paces)
