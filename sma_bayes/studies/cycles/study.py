"""The cycles of one condition: numbers of every sweep, the law that they follow, when they are stable, what comes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from sma_bayes.arrays import Bools, Floats, Ints
from sma_bayes.assess.transformation import NAMES
from sma_bayes.quantities import quotient
from sma_bayes.records.types import Branch, Record
from sma_bayes.studies.cycles.laws import LawPosterior, NumberDraws, Series
from sma_bayes.studies.cycles.mean_sweep import about_mean_sweep
from sma_bayes.studies.cycles.schema import HeldOutCycles
from sma_bayes.studies.cycles.start_and_finish import start_and_finish
from sma_bayes.studies.cycles.sweep_draws import SweepDraws
from sma_bayes.studies.cycles.sweeps import NUMBERS, PRIOR_SD, USUAL_SCATTER, Strand, fit_strand

DRAWS: Final = 2000
CHANGE_GRID_POINTS: Final = 31
"""Temperatures at which the change of a curve is looked at, from the lowest to the highest that was measured."""
HELD_OUT_SHARE: Final = 0.3
"""Share of the cycles, the last ones, that are forecast from the others."""
FEWEST_TO_HOLD_OUT: Final = 5
"""Cycles from which that is done."""
OWN_DRAWS: Final = 1000
"""Draws of curve and numbers that tell how uncertain a single sweep by itself is."""
FLAT_SLOPE_SHARE: Final = 1e-3
"""Slope below which a displacement is level and has no stiffness [greatest slope of the common curve]."""


@dataclass(frozen=True, slots=True, eq=False)
class Pooled:
    """The cycles of one condition.

    Attributes
    ----------
    strands : tuple of Strand
    posterior : LawPosterior
    cycle : ndarray, shape (G,)
        Every cycle from the first that was measured to the last that is forecast.
    last : int
        Last measured cycle.
    draws : tuple of NumberDraws
        Of each number of each strand, strand by strand.
    errors : tuple of ndarray or None
        Of the common curve of each strand, in as many draws.
    seed : int
        Of what sweeps have of their own in these draws.
    """

    strands: tuple[Strand, ...]
    posterior: LawPosterior
    cycle: Floats
    last: float
    draws: tuple[NumberDraws, ...]
    errors: tuple[Floats | None, ...]
    seed: int

    def measured(self, strand: int) -> Ints:
        """Places of the measured sweeps of a strand among the cycles."""
        return np.searchsorted(self.cycle, self.strands[strand].cycle)

    def numbers(self, strand: int, what: str = "sweep") -> Floats:
        """Draws of the four numbers of a strand beside its common curve as it was fitted, shape (S, G, 4)."""
        own = self.draws[4 * strand : 4 * strand + 4]
        return np.stack([getattr(d, what) for d in own], axis=-1)

    def numbers_beside_errors(self, strand: int) -> Floats:
        """Those of the sweeps beside its common curve with the `errors` of each draw."""
        drawn, errors = self.numbers(strand), self.errors[strand]
        if errors is None:
            return drawn
        follow = self.strands[strand].follow
        each = [follow(self._place(strand, n), drawn[:, n], errors) for n in range(self.cycle.size)]
        return np.stack(each, axis=1)

    def sweeps(self, strand: int) -> Iterator[SweepDraws]:
        """Sweeps of a strand, cycle by cycle."""
        for n in range(self.cycle.size):
            yield self.sweep(strand, n)

    def sweep(self, strand: int, n: int) -> SweepDraws:
        """The sweep of a strand in the n-th of the cycles."""
        own = self.draws[4 * strand : 4 * strand + 4]
        return SweepDraws.of(
            self.strands[strand],
            self._place(strand, n),
            np.stack([d.sweep[:, n] for d in own], axis=-1),
            self.errors[strand],
            np.random.default_rng([self.seed, 2, strand, n]),
        )

    def _place(self, strand: int, n: int) -> int | None:
        """Which measured sweep of a strand is in the n-th of the cycles."""
        found = np.flatnonzero(self.measured(strand) == n)
        return int(found[0]) if found.size else None


@dataclass(frozen=True, slots=True, eq=False)
class CycleSeries:
    """A quantity cycle by cycle.

    Attributes
    ----------
    branch, channel, name, unit : str
        `name` is one of the four numbers, a transformation temperature, or a channel or the stiffness at `at`.
    at : float or None
        Temperature [unit of temperature].
    own, own_sd : ndarray, shape (G,)
        Of each sweep by itself; NaN where there is none.
    draws : ndarray, shape (S, G)
        Pooled over cycles.
    """

    branch: str
    channel: str
    name: str
    unit: str
    at: float | None
    own: Floats
    own_sd: Floats
    draws: Floats


def pool(strands: Sequence[Strand], ahead: int, seed: int, size: int = DRAWS) -> Pooled:
    """Pool the numbers of the sweeps of one condition over its cycles.

    Parameters
    ----------
    strands : sequence of Strand
    ahead : int
        Cycles to forecast.
    seed, size : int
        Of the draws.
    """
    first = min(float(s.cycle.min()) for s in strands)
    last = max(float(s.cycle.max()) for s in strands)
    series = [
        Series(
            s.cycle - first,
            s.numbers[:, i],
            s.sds[:, i] ** 2,
            float(PRIOR_SD[i]),
            float(USUAL_SCATTER[i]),
            name,
        )
        for s in strands
        for i, name in enumerate(NUMBERS)
    ]
    posterior = LawPosterior(series)
    grid = np.arange(last - first + ahead + 1.0)
    rng = np.random.default_rng(seed)
    _, draws = posterior.draw(grid, size, rng)
    errors = tuple(s.errors(size, rng) for s in strands)
    return Pooled(tuple(strands), posterior, grid + first, last, tuple(draws), errors, seed)


def changes(pooled: Pooled) -> Floats:
    """Greatest change of any curve from each cycle to the next, over its span, shape (S, G - 1).

    It is that of level, law and walk; the scatter from sweep to sweep is no change that lasts.
    """
    found = np.zeros((pooled.draws[0].state.shape[0], pooled.cycle.size - 1))
    for place, strand in enumerate(pooled.strands):
        t = np.linspace(*strand.ends, CHANGE_GRID_POINTS)
        state = pooled.numbers(place, "state")
        before = strand.curve(state[:, 0], t)
        for n in range(found.shape[1]):
            after = strand.curve(state[:, n + 1], t)
            change = np.max(np.abs(after - before), axis=1) / strand.span
            found[:, n] = np.maximum(found[:, n], change)
            before = after
    return found


def probability_stable(change: Floats, share: float) -> Floats:
    """Probability that from each cycle on no change exceeds a share of the stroke, as far as is forecast: (G - 1,)."""
    to_come = np.maximum.accumulate(change[:, ::-1], axis=1)[:, ::-1]
    return np.asarray(np.mean(to_come <= share, axis=0))


def quantities(pooled: Pooled, at: Sequence[float]) -> Iterator[CycleSeries]:
    """Numbers of the sweeps, transformation temperatures, and channels and stiffness at some temperatures."""
    for place in range(len(pooled.strands)):
        yield from _four(pooled, place)
    for branch in Branch:
        own = {s.channel: i for i, s in enumerate(pooled.strands) if s.record.branch is branch}
        main = next((c for c in ("displacement", "force", "stiffness") if c in own), None)
        if main is None:
            continue
        yield from _temperatures(pooled, own[main])
        for temperature in at:
            for place in own.values():
                yield _value(pooled, place, temperature)
            if "stiffness" not in own and {"force", "displacement"} <= set(own):
                yield _stiffness(pooled, own["force"], own["displacement"], temperature)


def _series(
    pooled: Pooled, place: int, name: str, unit: str, at: float | None, own: Floats, sd: Floats, draws: Floats
) -> CycleSeries:
    """With the values of single sweeps at their cycles."""
    strand = pooled.strands[place]
    seen = np.searchsorted(pooled.cycle, strand.cycle)
    values, sds = np.full(pooled.cycle.size, np.nan), np.full(pooled.cycle.size, np.nan)
    values[seen], sds[seen] = own, sd
    return CycleSeries(strand.record.branch.value, strand.channel, name, unit, at, values, sds, draws)


def _four(pooled: Pooled, place: int) -> Iterator[CycleSeries]:
    strand, errors = pooled.strands[place], pooled.errors[place]
    drawn = about_mean_sweep(strand, pooled.numbers_beside_errors(place), errors, pooled.measured(place))
    every = np.arange(strand.cycle.size)
    own = about_mean_sweep(strand, strand.numbers[None], None, every)[0]
    alone, moved = _drawn_alone(strand)
    if moved is not None:
        alone = np.stack([strand.follow(i, alone[:, i], moved) for i in range(every.size)], axis=1)
    sds = np.std(about_mean_sweep(strand, alone, moved, every), axis=0)
    for i, name in enumerate(NUMBERS):
        yield _series(pooled, place, name, strand.units[name], None, own[:, i], sds[:, i], drawn[..., i])


def _drawn_alone(strand: Strand) -> tuple[Floats, Floats | None]:
    """Draws of the numbers of single sweeps (S, n, 4), and of the errors of the common curve."""
    rng = np.random.default_rng(0)
    numbers = strand.numbers + strand.sds * rng.standard_normal((OWN_DRAWS, *strand.numbers.shape))
    return numbers, strand.errors(OWN_DRAWS, rng)


def _alone(strand: Strand) -> Iterator[SweepDraws]:
    """Draws of each measured sweep by itself."""
    numbers, errors = _drawn_alone(strand)
    for i in range(strand.cycle.size):
        yield SweepDraws.of(strand, i, numbers[:, i], errors, np.random.default_rng([1, i]))


def _temperatures(pooled: Pooled, place: int) -> Iterator[CycleSeries]:
    """Start and finish of each sweep."""
    strand = pooled.strands[place]
    unit = strand.record.units["temperature"]
    alone = np.array([start_and_finish(s) for s in _alone(strand)])
    drawn = np.array([start_and_finish(s) for s in pooled.sweeps(place)])
    for i, name in enumerate(NAMES[strand.record.branch]):
        own, sd = alone[..., i].mean(axis=1), alone[..., i].std(axis=1)
        yield _series(pooled, place, name, unit, None, own, sd, drawn[..., i].T)


def _value(pooled: Pooled, place: int, temperature: float) -> CycleSeries:
    strand, t = pooled.strands[place], np.array([temperature])
    value, sd = _values_alone(strand, lambda s: s.curve(t)[:, 0])
    drawn = np.column_stack([s.curve(t)[:, 0] for s in pooled.sweeps(place)])
    return _series(pooled, place, strand.channel, strand.unit, temperature, value, sd, drawn)


def _values_alone(strand: Strand, value_of: Callable[[SweepDraws], Floats]) -> tuple[Floats, Floats]:
    """Values of single sweeps as they are expected, and standard deviations."""
    found = [(value_of(s.expected())[0], np.std(value_of(s))) for s in _alone(strand)]
    values, sds = np.array(found).T
    return values, sds


def _stiffness(pooled: Pooled, force: int, displacement: int, temperature: float) -> CycleSeries:
    """K = F'/X' along the path."""
    f, x = pooled.strands[force], pooled.strands[displacement]
    t = np.array([temperature])
    steepest = float(np.max(np.abs(x.slope(np.zeros(4), np.linspace(*x.ends, 200)))))

    def ratio(of_force: Floats, of_displacement: Floats) -> Floats:
        with np.errstate(all="ignore"):
            k = of_force / of_displacement
        return np.asarray(np.where(np.abs(of_displacement) > FLAT_SLOPE_SHARE * steepest, k, np.nan))

    drawn = ratio(*(
        np.column_stack([s.slope(t)[:, 0] for s in pooled.sweeps(i)]) for i in (force, displacement)
    ))  # fmt: skip
    both, of_f, of_x = np.intersect1d(f.cycle, x.cycle, return_indices=True)
    fs, sd_f = _values_alone(f, lambda s: s.slope(t)[:, 0])
    xs, sd_x = _values_alone(x, lambda s: s.slope(t)[:, 0])
    k = ratio(fs[of_f], xs[of_x])
    with np.errstate(all="ignore"):
        sd = np.abs(k) * np.hypot(sd_f[of_f] / fs[of_f], sd_x[of_x] / xs[of_x])
    seen = np.searchsorted(pooled.cycle, both)
    own, own_sd = np.full(pooled.cycle.size, np.nan), np.full(pooled.cycle.size, np.nan)
    own[seen], own_sd[seen] = k, sd
    unit = stiffness_unit(f.unit, x.unit)
    return CycleSeries(f.record.branch.value, "stiffness", "stiffness", unit, temperature, own, own_sd, drawn)


def stiffness_unit(force: str, displacement: str) -> str:
    """Unit of the slope of one channel over the other; a strain has none."""
    return quotient(force, displacement) if displacement != "1" else force


def held_out(strands: Sequence[Strand], seed: int) -> list[HeldOutCycles]:
    """HeldOutCycles the last cycles from the others; empty where there are fewer than `FEWEST_TO_HOLD_OUT`."""
    cycles = sorted({float(c) for s in strands for c in s.cycle})
    if len(cycles) < FEWEST_TO_HOLD_OUT:
        return []
    kept = cycles[: len(cycles) - max(int(HELD_OUT_SHARE * len(cycles)), 1)]
    last = kept[-1]
    if any(np.sum(s.cycle <= last) < 2 or np.all(s.cycle <= last) for s in strands):
        return []
    trained = []
    for s in strands:
        record, cycle = s.part(s.cycle <= last)
        trained.append(fit_strand(record, s.channel, cycle, s.model.name, seed))
    pooled = pool(trained, int(cycles[-1] - last), seed)
    return [_forecast(pooled, i, s, last, seed) for i, s in enumerate(strands)]


def _forecast(pooled: Pooled, place: int, strand: Strand, last: float, seed: int) -> HeldOutCycles:
    trained, later = pooled.strands[place], strand.cycle > last
    record, cycle = strand.part(later)
    grid = np.searchsorted(pooled.cycle, cycle)
    rng = np.random.default_rng([seed, 1])
    measured = record.observed[strand.channel]
    missed, missed_last, covered, start = [], [], [], 0
    before = trained.numbers[-1]
    for n, length in zip(grid, strand.lengths[later], strict=True):
        own = slice(start, start + int(length))
        start += int(length)
        t, y = record.temperature[own], measured[own]
        curve = pooled.sweep(place, int(n)).curve(t)
        missed.append(y - np.median(curve, axis=0))
        missed_last.append(y - trained.curve(before, t))
        reading = curve + trained.reading_noise * rng.standard_normal(curve.shape)
        low, high = np.quantile(reading, [0.05, 0.95], axis=0)
        covered.append((low <= y) & (y <= high))
    size = strand.range
    return HeldOutCycles(
        branch=strand.record.branch.value,
        channel=strand.channel,
        trained=tuple(trained.cycle.tolist()),
        held_out=tuple(cycle.tolist()),
        rmse=float(np.sqrt(np.mean(np.concatenate(missed) ** 2)) / size),
        rmse_last=float(np.sqrt(np.mean(np.concatenate(missed_last) ** 2)) / size),
        covered=float(np.mean(np.concatenate(covered))),
        numbers_covered=float(
            np.mean(_numbers_covered(trained, record, cycle, pooled.numbers(place)[:, grid], rng))
        ),
    )


def _numbers_covered(
    trained: Strand, record: Record, cycle: Floats, numbers: Floats, rng: np.random.Generator
) -> Bools:
    """Which numbers of later sweeps, about the curve of the earlier ones, are within their 90 % intervals, (n, 4)."""
    own = trained.about(record, cycle)
    read = numbers + own.sds * rng.standard_normal(numbers.shape)
    low, high = np.quantile(read, [0.05, 0.95], axis=0)
    return np.asarray((low <= own.numbers) & (own.numbers <= high))


def measured_cycles(strands: Sequence[Strand]) -> Ints:
    """All cycles of which a sweep was measured."""
    return np.unique(np.concatenate([s.cycle for s in strands])).astype(np.int64)
