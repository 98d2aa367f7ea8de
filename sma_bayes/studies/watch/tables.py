"""Tables of a watch."""

from __future__ import annotations

from typing import Final

from sma_bayes.document_part import IntervalDocument
from sma_bayes.report.content import Estimate, Number
from sma_bayes.report.notation import NORMAL_90_WIDTH, unit_label
from sma_bayes.report.tables import UNIT_OF_ROW, Cell, Column, Table
from sma_bayes.studies.watch.schema import LimitDocument, StoredWatch, WatchDocument, WatchedNumber

CURVE = (Column("branch", "branch"), Column("channel", "channel"))


def watch_tables(stored: StoredWatch) -> dict[str, Table]:
    """All tables of a watch, by name."""
    found = stored.found
    tables = (
        _numbers(found),
        _together(found),
        _causes(found),
        _limits(found),
        _cycles(found),
        _files(found),
    )
    return {t.name: t for t in tables}


def _numbers(found: WatchDocument) -> Table:
    columns = (
        *CURVE, Column("number", "number"), Column("unit", "unit"), Column("fitted, mean", "fitted", UNIT_OF_ROW),
        Column("last value", "last", UNIT_OF_ROW), Column("normal range from", "low", UNIT_OF_ROW),
        Column("to", "high", UNIT_OF_ROW),
        Column("greatest log10 e-value", "log10_e", "1"), Column("alarm", "alarm"),
    )  # fmt: skip
    count = len(found.fitted)
    rows = tuple(
        (
            n.branch, n.channel, n.number, unit_label(n.unit) or "1",
            *(
                _value(value, n.unit, scatter_of(n))
                for value in (sum(n.value[:count]) / count, n.value[-1], n.normal_low[-1], n.normal_high[-1])
            ),
            Number(max(n.log10_e), "1", 0.01) if n.log10_e else None, "yes" if n.alarm else "no",
        )
        for n in found.numbers
    )  # fmt: skip
    note = (
        "Normal range: 95 % of the sweeps while nothing changes. An alarm of one of all "
        f"{len(rows) + len(found.together)} e-processes needs as many times the evidence that a single one would."
    )
    return Table("numbers", "What is watched", note, columns, rows, 2)


def _together(found: WatchDocument) -> Table:
    columns = (
        Column("cause", "cause"), Column("kind", "of"), Column("greatest log10 e-value", "log10_e", "1"),
        Column("alarm", "alarm"),
    )  # fmt: skip
    rows = tuple(
        (c.title, c.of, Number(max(c.log10_e), "1", 0.01) if c.log10_e else None, "yes" if c.alarm else "no")
        for c in found.together
    )
    note = (
        "Numbers that a cause moves, added up by what it does to each over the variance that sweeps usually have: what "
        "no number tells by itself they may tell together."
    )
    return Table("together", "Numbers that are watched together", note, columns, rows)


UNTIL_KNOWN: Final = {"shift": 0.1, "width": 0.01}
"""Standard deviations by which shifts [K] and widths [1] are written while the scatter of sweeps is not known."""


def scatter_of(n: WatchedNumber) -> float | None:
    """Standard deviation of a sweep while nothing changes, roughly, from its last normal range; None if not known."""
    low, high = n.normal_low[-1], n.normal_high[-1]
    return UNTIL_KNOWN.get(n.number) if low is None or high is None else 0.25 * (high - low)


def _value(value: float | None, unit: str, sd: float | None = None) -> Cell:
    """A value with the digits that a standard deviation bears, one in ten thousand of it where there is none."""
    return None if value is None else Number(value, unit, sd or abs(value) * 1e-4 or 1e-4)


def _causes(found: WatchDocument) -> Table:
    columns = (
        Column("cause", "cause"), Column("kind", "of"), Column("effects of gap", "effects"),
        Column("share of the change", "share", "1"), Column("p-value of the residual", "p_value", "1"),
        Column("amount", "amount"), Column("unit", "unit"), Column("at the last cycle", "value", UNIT_OF_ROW),
    )  # fmt: skip
    rows = tuple(
        (
            c.title, c.of, ", ".join(c.effects).replace("_", " ") or "none", Number(c.share, "1", 0.01),
            Number(c.p_value, "1", 0.01), a.name.replace("_", " "), unit_label(a.unit) or "1",
            Estimate.of(a, a.unit),
        )
        for c in found.change.causes for a in c.amounts
    )  # fmt: skip
    note = (
        "Each may be the whole change; the data can't tell them apart. 90 % intervals; of gain, stroke and width the "
        "change of the logarithm."
    )
    return Table("causes", "What may have changed", note, columns, rows)


def _limits(found: WatchDocument) -> Table:
    curves = list(dict.fromkeys((r.branch, r.channel) for r in found.limits))
    columns = (
        *CURVE, Column("limit", "limit"), Column("unit", "unit"), Column("fitted", "fitted", UNIT_OF_ROW),
        Column("now", "now", UNIT_OF_ROW), Column("limit at", "target", UNIT_OF_ROW),
        Column("cycles that remain", "remaining"), Column("reached in time", "probability", "1"),
    )  # fmt: skip
    rows = tuple(
        (
            r.branch, r.channel, r.limit, unit_label(r.unit) or "1", _value(r.fitted, r.unit, _sd(r.now)),
            Estimate.of(r.now, r.unit), _value(r.target, r.unit, _sd(r.now)),
            remaining_text(r), Number(r.probability, "1", 0.01),
        )
        for r in sorted(found.limits, key=lambda r: curves.index((r.branch, r.channel)))
    )  # fmt: skip
    horizon = max((r.horizon for r in found.limits), default=0)
    note = (
        f"Median and 90 % interval; looked for over {horizon} cycles, by the laws and the random walk of sma-bayes "
        "cycles."
    )
    return Table("limits", "Cycles that remain", note, columns, rows, 2)


def _sd(now: IntervalDocument) -> float | None:
    return None if now.q05 is None or now.q95 is None else (now.q95 - now.q05) / NORMAL_90_WIDTH


def remaining_text(r: LimitDocument) -> str:
    """Cycles that remain, in words."""
    low, middle, high = (_count(v, r.horizon) for v in (r.remaining.q05, r.remaining.median, r.remaining.q95))
    return middle if low == middle == high else f"{middle} [{low}, {high}]"


def _count(cycles: float | None, horizon: int) -> str:
    return f"> {horizon}" if cycles is None else f"{cycles:.0f}"


def _cycles(found: WatchDocument) -> Table:
    columns = (
        Column("cycle", "cycle"), Column("file", "file"), Column("cycle in the file", "cycle_in_file"),
        Column("log10 e-value", "log10_e", "1"),
    )  # fmt: skip
    rows = tuple(
        (c.cycle, c.file, f"{c.cycle_in_file:g}", Number(c.log10_e, "1", 0.01)) for c in found.cycles
    )
    note = "Greatest e-process of all numbers and of those together, over how many there are."
    return Table("cycles", "Watched cycles", note, columns, rows)


def _files(found: WatchDocument) -> Table:
    columns = (
        Column("file", "file"), Column("counted", "counted"), Column("read before", "repeated"),
        Column("incomplete", "partial", brief=False), Column("SHA-256", "sha256", brief=False),
    )  # fmt: skip
    rows = tuple(
        (f.name, f.counted, f.repeated, "; ".join(f.partial) or "none", f.sha256) for f in found.files
    )
    return Table("files", "Files", "In the order in which they were read.", columns, rows)
