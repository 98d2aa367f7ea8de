"""The answers to a question on the screen."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

from rich.table import Table

from sma_bayes.assess.inverse import FEW_PASSAGES
from sma_bayes.errors import many
from sma_bayes.quantities import QUANTITIES, unit_text
from sma_bayes.report.notation import write, write_interval
from sma_bayes.report.screen import FIT_AGAIN, NOT_CONVERGED, Screen, numbers, screen, titled
from sma_bayes.studies.ask.schema import (
    AnswersDocument,
    BestTemperature,
    MetAt,
    StatedAnswer,
    StatedPassage,
    StatedStretch,
    ValuesDocument,
    ValuesOfRecord,
)
from sma_bayes.studies.ask.workflow import OVERALL

SLOPES: Final = {
    "stiffness": "force falls where displacement grows",
    "modulus": "stress falls where strain grows",
}
"""What a negative slope says, by its name."""
RARE: Final = 0.05
"""Probability below which a passage is counted and not listed: a wavy band is passed up and down in few draws."""


def show_values_at(found: Mapping[str, Any]) -> None:
    """What temperatures give: a table for each record, a row for each temperature."""
    document = ValuesDocument.model_validate(found)
    console = screen()
    console.tell(
        f"{document.campaign}: median and {100.0 * document.probability:g} % credible interval{_set_to(document)}"
    )
    if _alike(document.answers):
        _show_together(console, document.answers)
        return
    for a in document.answers:
        console.print()
        console.print(_values_table(a))
        if any(a.extrapolated):
            told = all(v is not None for q in a.quantities.values() for v in q.median)
            remedy = "" if told else "; --extrapolate tells values there all the same"
            console.tell(f"* {_range(a)}{remedy}")
        if not a.converged:
            console.tell(NOT_CONVERGED)
        if not a.adequate:
            console.tell("NOT ADEQUATE: curve and noise do not describe the data")
        if a.caution:
            console.tell(f"caution: {a.caution}")


def _range(a: StatedAnswer | ValuesOfRecord) -> str:
    low, high = a.measured
    return f"measured from {low:.4g} to {high:.4g} {unit_text(a.temperature_unit)}"


def _alike(answers: Sequence[ValuesOfRecord]) -> bool:
    """Whether several records tell the same quantities at one temperature, so that a table holds them all."""
    asked = {
        (a.temperature, a.temperature_unit, tuple((q.name, q.unit) for q in a.quantities.values()))
        for a in answers
    }
    return len(answers) > 1 and len(asked) == 1 and len(answers[0].temperature) == 1


def _show_together(console: Screen, answers: Sequence[ValuesOfRecord]) -> None:
    """A row for each record, and what is to be said of some of them below."""
    degrees = unit_text(answers[0].temperature_unit)
    columns = [_columns(a) for a in answers]
    names = [name for name, _ in max(columns, key=len)]
    table = titled(
        f"at {answers[0].temperature[0]:.6g} {degrees}",
        "record",
        *map(numbers, [f"measured [{degrees}]", *names]),
    )
    for a, own in zip(answers, columns, strict=True):
        told = dict(own)
        cells = (told.get(name, ["-"])[0] for name in names)
        low, high = a.measured
        table.add_row(f"{a.key}{' *' if a.extrapolated[0] else ''}", f"{low:.4g} to {high:.4g}", *cells)
    console.print(table)
    beyond = [a for a in answers if a.extrapolated[0]]
    if beyond:
        told_all = all(v is not None for a in beyond for q in a.quantities.values() for v in q.median)
        console.tell(
            "* not measured there" + ("" if told_all else "; --extrapolate tells values there all the same")
        )
    for found, text in (
        (
            [a.key for a in answers if not a.converged],
            f"NOT CONVERGED, these numbers must not be relied on ({FIT_AGAIN})",
        ),
        (
            [a.key for a in answers if not a.adequate],
            "NOT ADEQUATE, curve and noise do not describe the data",
        ),
    ):
        if found:
            console.tell(f"{text}: {', '.join(found)}")
    cautions: dict[str, list[str]] = {}
    for a in answers:
        if a.caution:
            cautions.setdefault(a.caution, []).append(a.key)
    console.tell(*(f"caution: {', '.join(keys)}: {text}" for text, keys in cautions.items()))


def _values_table(a: ValuesOfRecord) -> Table:
    columns = _columns(a)
    heads = [f"T [{unit_text(a.temperature_unit)}]", *(name for name, _ in columns)]
    table = titled(f"{a.key}, {_range(a)}", *map(numbers, heads))
    told = (cells for _, cells in columns)
    for t, beyond, *values in zip(a.temperature, a.extrapolated, *told, strict=True):
        table.add_row(f"{t:.6g}{' *' if beyond else ''}", *values)
    return table


def _columns(a: ValuesOfRecord) -> list[tuple[str, list[str]]]:
    """Heads of the columns, and what stands below at each temperature."""
    columns = []
    for q in a.quantities.values():
        symbol = QUANTITIES["stiffness" if q.name == OVERALL else q.name].symbol
        unit = unit_text(q.unit) or "1"
        cells = [
            "-" if m is None else "{} ({} to {})".format(*write_interval(m, *ends).plain)
            for m, *ends in zip(q.median, q.low, q.high, strict=True)
        ]
        columns.append((f"{q.name.replace('_', ' ')} {symbol} [{unit}]", cells))
        if any(v is not None for v in q.pred_median):
            readings = [_between(*ends) for ends in zip(q.pred_low, q.pred_high, strict=True)]
            columns.append((f"a reading of {symbol} [{unit}]", readings))
    return columns


def _between(low: float | None, high: float | None) -> str:
    """Ends of an interval with the digits that its width bears."""
    if low is None or high is None:
        return "-"
    _, least, most = write_interval(0.5 * (low + high), low, high).plain
    return f"({least} to {most})"


def answer_text(found: Mapping[str, Any]) -> str:
    """The answers in a few lines each, for a terminal."""
    document = AnswersDocument.model_validate(found)
    level = document.probability
    lines = [
        f"{document.campaign}: {document.quantity.replace('_', ' ')} {document.value}, "
        f"tolerance {document.tolerance}, probability {level:g} or more{_set_to(document)}"
    ]
    for a in document.answers:
        lines += ["", *_answer_lines(a, level)]
    if document.without:
        lines.append("")
    lines += [f"{key}: no answer, {why}" for key, why in document.without.items()]
    return "\n".join(lines)


def _set_to(found: AnswersDocument | ValuesDocument) -> str:
    """How far the temperature may be off, where it may."""
    if not found.temperature_sd:
        return ""
    units = dict.fromkeys(unit_text(a.temperature_unit) for a in found.answers)
    return f", temperature set to within {found.temperature_sd:g} {' or '.join(units)} (sd)"


def _answer_lines(a: StatedAnswer, level: float) -> list[str]:
    unit, degrees = unit_text(a.unit), unit_text(a.temperature_unit)
    symbol = QUANTITIES["stiffness" if a.quantity == OVERALL else a.quantity].symbol
    lines = [f"{a.key}, {_range(a)}"]
    if not a.converged:
        lines.append(f"  {NOT_CONVERGED}")
    wanted = f"{symbol} = {a.target:.5g} {unit}".rstrip()
    lines.append(f"  {wanted} is reached there with probability {a.reachable:.3f}{_unreached(a)}")
    often = [p for p in a.passages if p.probability >= RARE]
    if len(often) > FEW_PASSAGES:
        lines.append(f"    {_wound_text(often, degrees)}")
    else:
        lines += [
            f"    {p.direction} at {_passage_text(p, degrees)}, with probability {p.probability:.3f}{_mark(p)}"
            for p in often
        ]
    if rare := sum(p.probability < RARE for p in a.passages):
        each = "each " if rare > 1 else ""
        lines.append(
            f"    and {many(rare, 'passage')} with a probability {each}below {RARE:g}; --json lists all"
        )
    least, most = a.bounds
    lines += [
        f"  {least:.4g} to {most:.4g} {unit}".rstrip() + f": {_stretches(a.within, level, degrees)}",
        f"    {_most_surely(a.within.best, degrees)}",
        f"  at least {a.target:.5g} {unit}".rstrip() + f": {_stretches(a.at_least, level, degrees)}",
        f"  at most {a.target:.5g} {unit}".rstrip() + f": {_stretches(a.at_most, level, degrees)}",
        f"  the whole range is {a.least.median:.4g} to {a.greatest.median:.4g} {unit}".rstrip(),
    ]
    if a.quantity in SLOPES and a.greatest.high is not None and a.greatest.high < 0.0 < a.target:
        lines.append(
            f"  the {a.quantity} is negative, {SLOPES[a.quantity]}: ask for {-a.target:.5g} {unit} (the report of the "
            "fit states magnitudes)"
        )
    if a.caution:
        lines.append(f"  caution: {a.caution}")
    return lines


def _wound_text(passages: Sequence[StatedPassage], degrees: str) -> str:
    """Where curves wind about a value, which each passes many times."""
    times = sum(p.probability for p in passages)
    low = min(p.low for p in passages if p.low is not None)
    high = max(p.high for p in passages if p.high is not None)
    mark = next((_mark(p) for p in passages if p.extrapolated), "")
    return (
        f"up and down, {times:.0f} times a curve, between {low:.4g} and {high:.4g} {degrees}{mark}: they "
        "wind about the value there"
    )


def _passage_text(p: StatedPassage, degrees: str) -> str:
    """Where a value is passed, with the digits that its interval bears."""
    median, low, high = write_interval(p.median, p.low, p.high).plain
    return f"{median} {degrees} ({low} to {high})"


def _unreached(a: StatedAnswer) -> str:
    told = [
        f"stays {where} with probability {share:.3f}"
        for where, share in (("below", a.stays_below), ("above", a.stays_above))
        if share >= 0.005
    ]
    return f"; it {' and '.join(told)}" if told else ""


def _most_surely(best: BestTemperature | None, degrees: str) -> str:
    if best is None:
        return "at no temperature in any draw"
    place = f"most surely at {best.temperature:.4g} {degrees}"
    return f"{place}, with probability {best.probability:.3f}{_mark(best)}"


def _stretches(found: MetAt, level: float, degrees: str) -> str:
    if not found.intervals:
        return f"nowhere with probability {level:g}"
    return " and ".join(f"{_stretch_text(s)} {degrees}{_mark(s)}" for s in found.intervals)


def _stretch_text(s: StatedStretch) -> str:
    """Both ends, with the digits that the draws tell; their middle where these do not tell them apart."""
    blurred = s.low_error + s.high_error
    if s.high - s.low < blurred:
        return f"about {write([0.5 * (s.low + s.high)], resolution=10.0 * blurred).plain[0]}"
    low, high = (
        write([end], resolution=10.0 * error or None).plain[0]  # one digit of the error
        for end, error in ((s.low, s.low_error), (s.high, s.high_error))
    )
    return f"{low} to {high}"


def _mark(part: StatedPassage | StatedStretch | BestTemperature) -> str:
    return " [extrapolated]" if part.extrapolated else ""
