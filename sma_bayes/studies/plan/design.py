"""What single candidates and whole designs are expected to leave of what is asked."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Final

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.records.types import Branch
from sma_bayes.studies.plan.candidates import CandidateExperiment, Setting
from sma_bayes.studies.plan.information import ExpectedGain, PlannedSweep, PlanTarget, counts

DESIGN_PORTIONS: Final = 12
"""In about so many portions a design is put together."""


def sweep_of(candidate: CandidateExperiment, branch: Branch) -> PlannedSweep:
    """Sweep of a candidate in one direction."""
    ends = (candidate.lowest, candidate.peak)
    first, last = ends if branch is Branch.HEATING else ends[::-1]
    return PlannedSweep(first, last, candidate.samples, candidate.rate)


@dataclass(frozen=True, eq=False)
class Expectations:
    """What sweeps tell of the targets; each sweep is linearised once."""

    targets: tuple[PlanTarget, ...]
    _known: dict[tuple[str, PlannedSweep], Floats] = field(default_factory=dict)

    def followed(self, candidate: CandidateExperiment) -> list[PlanTarget]:
        """Targets on whose curves sweeps of a candidate lie."""
        return [
            t for t in self.targets
            if t.knowledge.draws.condition.id == candidate.condition
            and counts(sweep_of(candidate, t.knowledge.draws.branch).first, t.knowledge.draws.record)
        ]  # fmt: skip

    def information(self, target: PlanTarget, candidate: CandidateExperiment) -> Floats:
        """Of one sweep of a candidate about a target."""
        draws = target.knowledge.draws
        sweep = sweep_of(candidate, draws.branch)
        place = (draws.key, sweep)
        if place not in self._known:
            self._known[place] = target.knowledge.information(sweep)
        return self._known[place]

    def of(self, candidate: CandidateExperiment) -> dict[str, ExpectedGain]:
        """Expected gain of a candidate, by the key of the record."""
        return {
            t.knowledge.draws.key: t.expected(self.information(t, candidate), candidate.cycles)
            for t in self.followed(candidate)
        }

    def of_design(self, parts: Sequence[tuple[CandidateExperiment, float]]) -> dict[str, ExpectedGain]:
        """Expected gain of candidates together, each with a number of cycles, by the key of the record."""
        total: dict[str, Floats] = {}
        for candidate, cycles in parts:
            for t in self.followed(candidate):
                own = cycles * self.information(t, candidate)
                key = t.knowledge.draws.key
                total[key] = total[key] + own if key in total else own
        return {t.knowledge.draws.key: t.expected(total[t.knowledge.draws.key]) for t in self.targets
                if t.knowledge.draws.key in total}  # fmt: skip


def nats_of(gains: Mapping[str, ExpectedGain]) -> float:
    """Information about all targets together: records share nothing."""
    return float(sum(g.nats for g in gains.values()))


def even_design(
    settings: Sequence[Setting],
    tried: Sequence[CandidateExperiment],
    hours: float,
    setup: float,
    rate: float | None,
) -> list[tuple[CandidateExperiment, float]]:
    """Whole loops, the hours divided evenly among conditions; part of a loop where there is no time for one.

    The rate is the measured one, or the fastest that is tried where none was; samples are as dense as any that is
    tried, so that what a design has over it is not only the sampling.
    """
    out = []
    for s in settings:
        fastest = max((c.rate for c in tried if c.condition == s.condition), default=None)
        own = rate or s.rate or fastest
        if own is None:
            continue
        span = s.hottest - s.lowest
        dense = max(
            [c.samples / (c.peak - c.lowest) for c in tried if c.condition == s.condition], default=0.0
        )
        samples = max(s.samples, round(dense * span))
        one = CandidateExperiment(s.condition, s.lowest, s.hottest, own, s.load, 1, samples, setup)
        cycles = max(hours / len(settings) - setup, 0.0) / one.cycle_hours
        out.append((one, float(np.floor(cycles * (1.0 + 1e-9))) if cycles >= 1.0 else cycles))
    return out


def best_design(
    expectations: Expectations, candidates: Sequence[CandidateExperiment], hours: float
) -> list[tuple[CandidateExperiment, int]]:
    """Cycles of candidates that fill the hours: at each step those that tell most per hour; then cycles are exchanged.

    Parameters
    ----------
    expectations : Expectations
    candidates : sequence of CandidateExperiment
        Their numbers of cycles are not looked at.
    hours : float
        Set-up of each setting included.
    """
    settings = list({c.settings: c for c in candidates}.values())
    cycles: dict[int, int] = {}
    left = hours
    known: dict[str, float] = {}
    total: dict[str, Floats] = {}
    fresh: dict[tuple[int, int], tuple[float, dict[str, float]]] = {}
    while True:
        best, most, gained = None, 0.0, {}
        for i, c in enumerate(settings):
            setup = 0.0 if i in cycles else c.setup
            portion = _portion(c, left - setup, hours)
            if portion < 1:
                continue
            if (i, portion) not in fresh:
                fresh[i, portion] = _gained(expectations, c, portion, total, known)
            gain, after = fresh[i, portion]
            per_hour = gain / (setup + portion * c.cycle_hours)
            if per_hour > most:
                best, most, gained = (i, portion, setup), per_hour, after
        if best is None:
            return _exchanged(expectations, [(settings[i], n) for i, n in cycles.items()], left)
        i, portion, setup = best
        chosen = settings[i]
        for t in expectations.followed(chosen):
            key = t.knowledge.draws.key
            own = portion * expectations.information(t, chosen)
            total[key] = total[key] + own if key in total else own
        known.update(gained)
        cycles[i] = cycles.get(i, 0) + portion
        left -= setup + portion * chosen.cycle_hours
        fresh = {p: v for p, v in fresh.items() if not v[1].keys() & gained.keys()}


def _exchanged(
    expectations: Expectations, design: list[tuple[CandidateExperiment, int]], left: float
) -> list[tuple[CandidateExperiment, int]]:
    """A design with single cycles given from one setting to another, or into what is left of the hours, while it gains.

    Portions are coarse: they leave three equal settings with 15, 12 and 12 cycles where 13 of each tell more.
    """
    cycles = [n for _, n in design]
    hours = [c.cycle_hours for c, _ in design]
    serving = {
        t: [
            (i, expectations.information(t, c))
            for i, (c, _) in enumerate(design)
            if t in expectations.followed(c)
        ]
        for t in expectations.targets
    }

    @cache
    def told(target: PlanTarget, own: tuple[int, ...]) -> float:
        served = zip(own, serving[target], strict=True)
        return target.expected(np.sum([n * information for n, (_, information) in served], axis=0)).nats

    def total(tried: Sequence[int]) -> float:
        return sum(told(t, tuple(tried[i] for i, _ in by)) for t, by in serving.items() if by)

    known = total(cycles)
    while True:
        best, most = None, known * (1.0 + 1e-9)
        for given in (None, *(i for i, n in enumerate(cycles) if n > 1)):
            freed = left if given is None else left + hours[given]
            for taken in range(len(cycles)):
                if taken == given or hours[taken] > freed * (1.0 + 1e-9):
                    continue
                tried = [n + (i == taken) - (i == given) for i, n in enumerate(cycles)]
                if (nats := total(tried)) > most:
                    best, most = (tried, freed - hours[taken]), nats
        if best is None:
            return [(c, n) for (c, _), n in zip(design, cycles, strict=True)]
        cycles, left, known = *best, most


def _portion(candidate: CandidateExperiment, left: float, hours: float) -> int:
    """Cycles that are added at once; 0 where none fits."""
    fitting = int(np.floor(left / candidate.cycle_hours * (1.0 + 1e-9)))
    return min(fitting, max(1, int(hours / DESIGN_PORTIONS / candidate.cycle_hours)))


def _gained(
    expectations: Expectations,
    candidate: CandidateExperiment,
    portion: int,
    total: Mapping[str, Floats],
    known: Mapping[str, float],
) -> tuple[float, dict[str, float]]:
    """What cycles of a candidate add, and what is known of each record with them."""
    after, gain = {}, 0.0
    for t in expectations.followed(candidate):
        key = t.knowledge.draws.key
        own = portion * expectations.information(t, candidate)
        after[key] = t.expected(total[key] + own if key in total else own).nats
        gain += after[key] - known.get(key, 0.0)
    return gain, after
