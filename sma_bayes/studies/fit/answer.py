"""The answer, before anything else: how stiff, how sure, may it be believed, and what to do next."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from sma_bayes.assess.adequacy import DiscrepancySummary, remedy
from sma_bayes.errors import first_of
from sma_bayes.quantities import SPECIMEN_QUANTITY
from sma_bayes.report.content import INTERVAL, Content, Estimate, Number, RecordContent
from sma_bayes.report.notation import NORMAL_90_WIDTH, unit_label
from sma_bayes.report.tables import UNIT_OF_ROW, UNSUPPORTED, Cell, Column, Table, words
from sma_bayes.runs.fit_document import Lack
from sma_bayes.studies.fit.findings import finding_groups
from sma_bayes.studies.fit.inadequate import RECORDS_NAMED, reason_groups

ENDS_OF_STIFFNESS: Final = ("least_stiffness", "greatest_stiffness")
"""Names of the quantities of a branch that are told first."""
RIG_PATHS: Final = ("straight_path", "constant_load", "constant_displacement")
"""Paths whose slope tells of the rig and not of the alloy."""


def answer_tables(content: Content) -> tuple[Table, ...]:
    """Stiffness, transformation and hysteresis of every record, a table for each set of units."""
    return tuple(_answer_table(part, number) for number, part in enumerate(content.by_units(), 1))


def _answer_table(part: Content, number: int) -> Table:
    some = part.records[0]
    channel = next((c for r in part.records for c in [r.channel("stiffness")] if c is not None), None)
    temperature = some.temperature_unit
    stiffness = () if channel is None else (
        Column(f"least {channel.name}", "least_stiffness", channel.unit),
        Column(f"greatest {channel.name}", "greatest_stiffness", channel.unit),
    )  # fmt: skip
    transformed = any(r.document.transformation for r in part.records)
    temperatures = () if not transformed else (
        Column("start", "start", temperature),
        Column("finish", "finish", temperature),
    )  # fmt: skip
    rows = []
    for condition in part.conditions:
        for place, r in enumerate(part.branches(condition)):
            rows.append(_answer_row(part, r, bool(stiffness), transformed, first=place == 0))
    return Table(
        "answer" if number == 1 else f"answer-{number}",
        "Stiffness and transformation" if stiffness else "Transformation",
        f"Median and {INTERVAL}. {_of_stiffness(part) if stiffness else ''}Start and finish of the transformation "
        "by the tangent rule (As, Af on heating; Ms, Mf on cooling); hysteresis: temperature at which the curve is "
        "half-way, heating less cooling.",
        (
            *words("condition", "branch"),
            *stiffness,
            *temperatures,
            Column("hysteresis", "hysteresis", temperature),
            Column("may it be believed?", "believed"),
        ),
        tuple(rows),
    )


def spread_tables(content: Content) -> tuple[Table, ...]:
    """What the answers of many records span, a row for each quantity of a branch, a table for each set of units."""
    return tuple(_spread_table(answer) for answer in answer_tables(content))


def _spread_table(answer: Table) -> Table:
    keys = [c.key for c in answer.columns]
    condition, branch = keys.index("condition"), keys.index("branch")
    rows: list[tuple[Cell, ...]] = []
    for of in dict.fromkeys(row[branch] for row in answer.rows):
        for place, column in enumerate(answer.columns):
            told = [
                (c, row[condition]) for row in answer.rows if row[branch] == of and (c := _told(row[place]))
            ]
            if told:
                told.sort(key=lambda t: t[0].value or 0.0)
                (low, whose), (high, whose_high) = told[0], told[-1]
                middle = told[(len(told) - 1) // 2][0]
                unit = unit_label(low.unit) or "1"
                rows.append((of, column.name, unit, low, whose, middle, high, whose_high, len(told)))
    return Table(
        answer.name.replace("answer", "answer-spread"),
        "All records at a glance",
        "Posterior medians over the records: the lowest, the one in the middle, and the highest. Hysteresis stands "
        "with the first branch of a condition.",
        (
            *words("branch", "quantity", "unit"),
            Column("lowest", "lowest", UNIT_OF_ROW),
            Column("of", "lowest_of"),
            Column("middle", "middle", UNIT_OF_ROW),
            Column("highest", "highest", UNIT_OF_ROW),
            Column("of", "highest_of"),
            Column("records", "records"),
        ),
        tuple(rows),
    )


def _told(cell: Cell) -> Number | None:
    """Median of an estimate with the digits that its interval bears; None where there is none."""
    if not isinstance(cell, Estimate) or cell.median is None:
        return None
    width = None if cell.q05 is None or cell.q95 is None else (cell.q95 - cell.q05) / NORMAL_90_WIDTH
    sure = width is None or width < abs(cell.median)
    return Number(cell.median, cell.unit, width if sure else abs(cell.median))


def _of_stiffness(part: Content) -> str:
    """What the ends of the stiffness are, and where one that is told by its magnitude is negative."""
    told = "Least and greatest magnitude of the stiffness over the temperatures that were measured"
    below = [r for r in part.records if any(q.negative for q in r.document.quantities_of_branch)]
    if not below:
        return f"{told}. "
    where = "" if len(below) == len(part.records) else f" of {_names(below)}"
    return f"{told} (the stiffness itself{where} is negative, as the curves show it). "


MOSTLY: Final = 0.5
"""Share of the draws that must have a number for it to be an answer; the tables of section 2 give all of them."""


def _answer_row(
    part: Content, r: RecordContent, stiffness: bool, transformed: bool, *, first: bool
) -> tuple[Cell, ...]:
    found = {q.name: Estimate.of(q, q.unit) for q in r.document.quantities_of_branch}
    given = r.converged and not r.stiffness_withheld
    widths = (q for q in part.loops_of(r.condition) if q.name == "hysteresis_width" and q.defined >= MOSTLY)
    width = next((Estimate.of(q, q.unit) for q in widths), None)
    low, high = _ends(r)
    return (
        r.condition,
        r.branch,
        *((found.get(name) if given else None for name in ENDS_OF_STIFFNESS) if stiffness else ()),
        *((low, high) if transformed else ()),
        width if first else None,
        belief(r),
    )


def _ends(r: RecordContent) -> tuple[Estimate | None, Estimate | None]:
    """Temperatures of start and finish, in the order in which the branch meets them."""
    found = r.document.transformation if r.converged else {}
    low, high = (
        Estimate.of(found[name], found[name].unit)
        if name in found and found[name].defined >= MOSTLY
        else None
        for name in (("As", "Af") if r.branch == "heating" else ("Ms", "Mf"))
    )
    return low, high


def belief(r: RecordContent) -> str:
    """Whether the numbers of a record may be relied on, in a few words."""
    if not r.converged:
        return "no: not converged"
    unsupported = "".join(
        f"; {' and '.join(names)} {UNSUPPORTED[lack]}"
        for lack in LACKS
        if (names := [name for name, t in r.document.transformation.items() if t.lacks == lack])
    )
    if not r.adequate:
        return ": ".join(("with care", *(reason.message for reason in r.document.why[:1]))) + unsupported
    if r.document.path.kind in RIG_PATHS and r.channel("stiffness") is not None:
        return f"yes, but the slope is that of the rig{unsupported}"
    return f"yes{unsupported}"


LACKS: Final[dict[Lack, str]] = {
    "readings": "fewer than three readings between start and finish of the transformation; measure closer together "
    "there",
    "tangents": "tangents give no start or finish, as the curve has a further step or is not straight beside its "
    "steepest part; read them off the figure by hand",
    "plateau": "start or finish of the transformation is extrapolated; measure on to where the curve is flat",
}
"""What to do where measurements do not support a transformation temperature, by what they lack."""


def next_steps(content: Content) -> tuple[str, ...]:
    """What to do next, what matters most first; each a sentence, commands in backquotes."""
    return tuple(_next_steps(content))


def _next_steps(content: Content) -> Iterator[str]:
    if content.unconverged:
        yield f"Don't use {_names(content.unconverged)}: not converged. Section 3.1 says which parameter"
    yield from _differing_sweeps(content)  # which alone may make a fit inadequate
    options = content.document.options
    for group in reason_groups((r.document for r in content.inadequate), len(content.records)):
        yield f"{group.names}: {group.quoted}; {remedy(group.kind, options.model, options.noise)}"
    for lack, advice in LACKS.items():
        lacking = [
            r for r in content.converged if any(t.lacks == lack for t in r.document.transformation.values())
        ]
        if lacking:
            yield f"{_names(lacking)}: {advice}"
    backwards = [
        q for q in content.loops if q.name == "hysteresis_width" and q.q95 is not None and q.q95 < 0.0
    ]
    if backwards:
        names = list(dict.fromkeys(q.condition for q in backwards))
        yield (
            f"{first_of(names, RECORDS_NAMED)}: the hysteresis is negative, cooling transforms hotter than heating. An "
            "alloy does not do that; a thermometer that lags or sits elsewhere does: `sma-bayes gap` tests a lag"
        )
    for message, records in _by_message(content):
        yield f"{_names(records)}: {message}"
    for finding in finding_groups(content.findings):
        if finding.severity == "serious":
            where = f" ({', '.join(finding.conditions[:3])})" if finding.conditions else ""
            what = finding.message if finding.alike else finding.reason
            yield f"Check the measurements{where}: {what}"
    told = [
        r for r in content.converged if r.document.path.kind not in RIG_PATHS and not r.stiffness_withheld
    ]
    some = next((r for r in told if r.channel("stiffness") is not None), None)
    if some is not None:
        channel = some.channel("stiffness")
        assert channel is not None
        name = "modulus" if channel.name == SPECIMEN_QUANTITY["stiffness"] else "stiffness"
        ends = [q for q in some.document.quantities_of_branch if q.name in ENDS_OF_STIFFNESS]
        medians = [-q.median if q.negative else q.median for q in ends if q.median is not None]
        if medians:
            value = sum(medians) / len(medians)
            yield f'Which temperature gives a {name}? `sma-bayes ask DIR --{name} "{value:.2g} {channel.unit}"`'
    else:
        yield from _asked_at(content)
    if varied := _varied_settings(content):
        verb = "does" if len(varied) == 1 else "do"
        yield f"What {verb} {' and '.join(varied)} do? `sma-bayes conditions DIR --out NEW`"


def _differing_sweeps(content: Content) -> Iterator[str]:
    """That sweeps of a record do not repeat each other, in the channel in which they differ most."""
    found = [
        (m.between_sweeps, r, channel)
        for r in content.converged
        for channel, m in r.document.discrepancy.items()
        if m.between_sweeps is not None
    ]
    if not found:
        return
    size, r, channel = max(found, key=lambda x: _of_range(x[0], x[1].document.discrepancy[x[2]]))
    unit = unit_label(r.document.discrepancy[channel].unit)
    names = _names(list({r.key: r for _, r, _ in found}.values()))
    yield (
        f"{names}: sweeps do not repeat each other ({r.name_of(channel)} by {size:.2g} {unit} rms in {r.key}); the "
        "curve is their mean. What changes from cycle to cycle? `sma-bayes cycles FILE --out NEW`"
    )


def _of_range(size: float, missed: DiscrepancySummary) -> float:
    """A size over the range of the channel."""
    return size * missed.share / abs(missed.largest) if missed.largest else 0.0


def _asked_at(content: Content) -> Iterator[str]:
    """A question about the middle of a transformation, where there is no stiffness to ask for."""
    for r in content.converged:
        ends = [t.median for t in r.document.transformation.values() if t.median is not None]
        if ends and r.document.path.kind not in RIG_PATHS:
            middle = sum(ends) / len(ends)
            channel = next(iter(r.document.transformation.values())).channel
            yield (
                f"What is the {r.name_of(channel)} at a temperature, and the next reading? "
                f'`sma-bayes ask DIR --at "{middle:.3g} {r.temperature_unit}"`'
            )
            return


def _varied_settings(content: Content) -> list[str]:
    """Settings in which the conditions differ."""
    found: dict[str, set[float]] = {}
    for r in content.records:
        for name, setting in r.document.settings.items():
            found.setdefault("stress" if r.specimen and name == "load" else name, set()).add(setting)
    return [name.replace("_", " ") for name, values in found.items() if len(values) > 1]


def _by_message(content: Content) -> list[tuple[str, list[RecordContent]]]:
    """Records whose slope is that of the rig, by what is said of it; numbers are those of one record."""
    found: dict[str, list[RecordContent]] = {}
    for r in content.converged:
        if r.document.path.kind in RIG_PATHS:
            found.setdefault(r.document.path.kind, []).append(r)
    general = "the slope is that of the rig, not of the alloy (section 2.6)"
    said = {kind: {r.document.path.message for r in records} for kind, records in found.items()}
    return [(said[kind].pop() if len(said[kind]) == 1 else general, found[kind]) for kind in found]


def _names(records: list[RecordContent] | tuple[RecordContent, ...], most: int = 3) -> str:
    return first_of([r.key for r in records], most)
