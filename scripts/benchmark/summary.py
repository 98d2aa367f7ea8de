"""Medians, ranges and ratios of the benchmark's rows."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass

import numpy as np
from benchmark.rows import OWN, Row


@dataclass(frozen=True, slots=True)
class Line:
    """One sampler on one case, over its records and repeats.

    Attributes
    ----------
    records, reached, runs : int
        Different records; runs that reached the target, of how many.
    median_s, low_s, high_s : float
        Processor time of one record: median and range over the records of the medians over repeats.
    total_s : float
        Sum over the records of the medians; runs that did not reach the target count with their limit, so that
        the sum is a lower bound.
    ratio, ratio_low, ratio_high : float
        `total_s` over this package's on the same records: of the medians, and range over repeats. Lower bounds
        where the target was not reached.
    wall_ratio : float
        The same by the clock, which other load on the machine disturbs more.
    evaluations : float
        Median of the evaluations of the log-posterior.
    ess_per_s : float
        Median of the least effective sample size over the processor time.
    early : int
        Runs whose R-hat and effective sample size met the target while the draws were of another posterior.
    mean_shift, sd_off : float
        Of the runs that reached the target, greatest shift of a mean [sd] and error of a standard deviation [1].
    """

    kind: str
    channels: str
    noise: str
    length: str
    sampler: str
    walkers: int
    start: str
    log_prob: str
    records: int
    reached: int
    runs: int
    median_s: float
    low_s: float
    high_s: float
    total_s: float
    ratio: float
    ratio_low: float
    ratio_high: float
    wall_ratio: float
    evaluations: float
    ess_per_s: float
    early: int
    mean_shift: float
    sd_off: float

    @property
    def case(self) -> Key:
        """What is measured."""
        return (self.kind, self.channels, self.noise, self.length)

    @property
    def bound(self) -> str:
        """What to write before a time that is only a lower bound."""
        return "" if self.reached == self.runs else "> "


Key = tuple[str, ...]


def summarise(rows: Iterable[Row]) -> list[Line]:
    """Summarise runs, a line for each case and sampler, in the order in which they first occur."""
    cases: dict[Key, dict[Key, list[Row]]] = defaultdict(lambda: defaultdict(list))
    for row in rows:
        way = (row.sampler, str(row.walkers) if row.sampler != OWN else "", row.start, row.log_prob)
        cases[row.case][way].append(row)
    lines = []
    for case in cases.values():
        own = [row for way, found in case.items() if way[0] == OWN for row in found]
        lines += [_line(found, own) for found in case.values()]
    return lines


def _line(rows: Sequence[Row], own: Sequence[Row]) -> Line:
    first = rows[0]
    times = _by_record(rows, "cpu_s")
    typical = np.array([np.median(list(t.values())) for t in times.values()])
    reached = [row for row in rows if row.reached]
    ratio, ratio_low, ratio_high = _ratio(times, _by_record(own, "cpu_s"))
    wall_ratio, *_ = _ratio(_by_record(rows, "wall_s"), _by_record(own, "wall_s"))
    return Line(
        kind=first.kind,
        channels=first.channels,
        noise=first.noise,
        length=first.length,
        sampler=first.sampler,
        walkers=first.walkers,
        start=first.start,
        log_prob=first.log_prob,
        records=len(times),
        reached=len(reached),
        runs=len(rows),
        median_s=float(np.median(typical)),
        low_s=float(typical.min()),
        high_s=float(typical.max()),
        total_s=float(typical.sum()),
        ratio=ratio,
        ratio_low=ratio_low,
        ratio_high=ratio_high,
        wall_ratio=wall_ratio,
        evaluations=float(np.median([row.evaluations for row in rows])),
        ess_per_s=float(np.median([min(row.ess_bulk, row.ess_tail) / row.cpu_s for row in rows])),
        early=sum(row.claimed_s < row.wall_s for row in rows),
        mean_shift=max((row.mean_shift for row in reached), default=float("nan")),
        sd_off=max((max(1 - row.sd_low, row.sd_high - 1) for row in reached), default=float("nan")),
    )


Times = dict[str, dict[tuple[str, int], float]]


def _by_record(rows: Iterable[Row], what: str) -> Times:
    """Time of each repeat of each session, by record."""
    times: Times = defaultdict(dict)
    for row in rows:
        times[row.record][(row.session, row.repeat)] = getattr(row, what)
    return times


def _ratio(times: Times, own: Times) -> tuple[float, float, float]:
    """Ratio of the sums over the records of medians, and its range over repeats; pairs of one session only."""
    pairs = {record: times[record].keys() & own.get(record, {}).keys() for record in times}
    if not pairs or not all(pairs.values()):
        return float("nan"), float("nan"), float("nan")

    def total(of: Times) -> float:
        return sum(float(np.median([of[record][r] for r in common])) for record, common in pairs.items())

    repeats = set.intersection(*pairs.values())
    each = [sum(times[k][r] for k in pairs) / sum(own[k][r] for k in pairs) for r in repeats]
    ratio = total(times) / total(own)
    return ratio, min(each, default=ratio), max(each, default=ratio)


def as_json(item: Line | Row) -> dict[str, object]:
    """Fields for JSON, where what is not a number becomes null."""
    return {
        name: None if isinstance(value, float) and not np.isfinite(value) else value
        for name, value in asdict(item).items()
    }
