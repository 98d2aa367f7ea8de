"""What the self-check of a fit found, as tables of its report."""

from __future__ import annotations

from sma_bayes.report.content import Number
from sma_bayes.report.tables import Cell, Column, Table, words
from sma_bayes.runs.fit_document import FitSummary, RankSummary, RecordSummary, SelfCheckSummary

ONE = "1"


def self_check_tables(summary: FitSummary) -> dict[str, Table]:
    """A row for each record, and one for each of its numbers; none where nothing was checked."""
    found = [(r, r.self_check) for r in summary.records if r.self_check is not None]
    if not found:
        return {}
    overview = Table(
        "self_check",
        "Self-check",
        "Spread of truths over that of the draws is 1 where intervals are as wide as they should be, more where they "
        "are too narrow; shift is in standard deviations. Both are those of the number that is farthest off.",
        (
            *words("condition", "branch"),
            Column("refits", "refits", ONE),
            Column("failed", "failed", ONE),
            Column("largest shift", "largest_shift", ONE),
            Column("quantity shifted most", "shift_of"),
            Column("spread farthest from 1", "spread", ONE),
            Column("quantity spread worst", "spread_of"),
            Column("least p-value", "least_p", ONE),
            Column("passed", "passed"),
        ),
        tuple(_row(r, check) for r, check in found),
    )
    ranks = Table(
        "self_check_ranks",
        "Self-check, number by number",
        "Shares of truths in central 50 % and 90 % intervals, with their exact binomial 95 % intervals.",
        (
            *words("condition", "branch", "number"),
            Column("shift", "shift", ONE),
            Column("spread", "spread", ONE),
            Column("p-value of location", "p_location", ONE),
            Column("p-value of spread", "p_spread", ONE),
            Column("p-value of distribution", "p_distribution", ONE),
            Column("share in 50 %", "in_50", ONE),
            Column("from", "in_50_low", ONE),
            Column("to", "in_50_high", ONE),
            Column("share in 90 %", "in_90", ONE),
            Column("from", "in_90_low", ONE),
            Column("to", "in_90_high", ONE),
            Column("uniform", "uniform"),
        ),
        tuple((r.condition, r.branch, *_numbers(q)) for r, check in found for q in check.quantities),
        grouped=2,
    )
    return {table.name: table for table in (overview, ranks)}


def _row(r: RecordSummary, check: SelfCheckSummary) -> tuple[Cell, ...]:
    shifted = max(check.quantities, key=lambda q: abs(q.shift), default=None)
    spread = max(check.quantities, key=lambda q: abs(q.spread - 1.0), default=None)
    least = min(
        (p for q in check.quantities for p in (q.p_location, q.p_spread, q.p_distribution)), default=None
    )
    return (
        r.condition,
        r.branch,
        check.replicates,
        check.failed,
        None if shifted is None else _plain(shifted.shift),
        None if shifted is None else shifted.name,
        None if spread is None else _plain(spread.spread),
        None if spread is None else spread.name,
        None if least is None else _p(least),
        check.passed,
    )


def _numbers(q: RankSummary) -> tuple[Cell, ...]:
    ends = tuple(_plain(v) for c in q.coverage for v in (c.share, c.low, c.high))
    p_values = (q.p_location, q.p_spread, q.p_distribution)
    return (q.name, _plain(q.shift), _plain(q.spread), *(_p(p) for p in p_values), *ends, q.uniform)


def _plain(value: float) -> Number:
    return Number(value, ONE, 0.01)


def _p(value: float) -> Number:
    return Number(value, ONE, max(0.1 * value, 1e-300))
