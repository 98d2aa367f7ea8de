"""Two fits side by side on the screen."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

from rich.table import Table

from sma_bayes.errors import first_of, many
from sma_bayes.quantities import SPECIMEN_QUANTITY, unit_text
from sma_bayes.records.types import setting_unit
from sma_bayes.report.notation import write, write_interval
from sma_bayes.report.screen import ENTRIES_SHOWN, Screen, numbers, screen
from sma_bayes.studies.diff.schema import (
    ComparedParameter,
    ComparedRecords,
    DifferenceDocument,
    ParameterOfRun,
)

ALIKE_WIDTHS: Final = 1.25
"""Ratio of the widths of two bands up to which nothing is said of it."""


def show_diff(told: Mapping[str, Any]) -> None:
    """Tell what went in differently, which records differ, and by how much."""
    found = DifferenceDocument.model_validate(told)
    console = screen()
    console.tell(f"a: {found.a}\nb: {found.b}")
    if found.inputs:
        table = Table(title="what went in differently", title_justify="left")
        for name in ("", "a", "b"):
            table.add_column(name, overflow="fold")
        for key, (a, b) in found.inputs.items():
            table.add_row(key.replace("_", " "), _short(a), _short(b))
        console.print(table)
    other = list(dict.fromkeys(_shown_name(name, r) for r in found.records for name in r.priors))
    if other:
        console.tell(f"other priors of {', '.join(other)}")
    elif not found.inputs:
        console.print("the same data, options, priors and versions")
    console.tell(*found.declared_differently)
    for side in "ab":
        alone = [r.key for r in found.records if r.in_ == side]
        if alone:
            console.tell(f"only in {side}: {first_of(alone, ENTRIES_SHOWN)}")
    differing = [r for r in found.records if r.in_ == "both" and (not r.same or r.changed or _widths(r))]
    for r in differing[:ENTRIES_SHOWN]:
        _show_record(console, r, found)
    if len(differing) > ENTRIES_SHOWN:
        console.print(f"and {len(differing) - ENTRIES_SHOWN} more records that differ")
    verdict = "the same" if found.same else "DIFFERENT"
    alike = f"{sum(r.same for r in found.records)} of {many(len(found.records), 'record')} agree"
    console.tell(
        f"{verdict}: {alike}, with medians of parameters and bands within {found.tolerance:g} standard deviations"
    )


def _widths(r: ComparedRecords) -> list[str]:
    """Bands that are wider or narrower in b, in words."""
    return [
        f"{band.name} {band.width_ratio:.2g} times as wide"
        for band in r.bands.values()
        if band is not None
        and band.width_ratio is not None
        and not 1.0 / ALIKE_WIDTHS <= band.width_ratio <= ALIKE_WIDTHS
    ]


def _differing(value: object, other: object) -> object:
    """Of a mapping beside another, what differs."""
    if not (isinstance(value, Mapping) and isinstance(other, Mapping)):
        return value
    return {k: v for k, v in value.items() if k not in other or other[k] != v}


def _with_units(part: object, units: Mapping[str, str]) -> object:
    """Numbers of a part of a record with their units."""
    if not isinstance(part, Mapping):
        return part
    return {
        k: f"{v:.6g} {units[k]}".rstrip() if k in units and isinstance(v, float) else v
        for k, v in part.items()
    }


def _units_of(
    name: str, parts: Sequence[Any], r: ComparedRecords, declared: Mapping[str, str]
) -> Mapping[str, str]:
    """Units of the numbers of a part of a record."""
    if name == "settings":
        specimen = any(
            band is not None and band.name in SPECIMEN_QUANTITY.values() for band in r.bands.values()
        )
        return {
            s: unit_text(declared.get(s, setting_unit(s, specimen=specimen))) for part in parts for s in part
        }
    if name == "temperature":
        unit = unit_text(declared.get(name, parts[0]["unit"]))
        return {"lowest": unit, "highest": unit, "sd": unit}
    return {}


def _short(value: object) -> str:
    if value is None or (isinstance(value, Mapping) and not value):
        return "none"
    if isinstance(value, Mapping):
        return ", ".join(f"{k} {_short(v)}" for k, v in value.items())
    if isinstance(value, list | tuple):
        return ", ".join(map(_short, value))
    text = f"{value:.6g}" if isinstance(value, float) else str(value)
    return text if len(text) <= 60 else text[:12] + "..."


def _show_record(console: Screen, r: ComparedRecords, found: DifferenceDocument) -> None:
    console.print()
    console.print(f"{r.key}:")
    for name, (a, b) in r.changed.items():
        if isinstance(a, bool) and isinstance(b, bool):
            console.tell(f"  {name} in {'a' if a else 'b'}, not in {'b' if a else 'a'}")
            continue
        units = _units_of(name, (a, b), r, found.declared_units)
        a, b = (_with_units(_differing(one, other), units) for one, other in ((a, b), (b, a)))
        console.tell(f"  {name.replace('_', ' ')}: {_short(a)} in a, {_short(b)} in b")
    for side, why in zip("ab", r.why, strict=True):
        console.tell(
            *(
                f"  not adequate in {side}: {message}"
                for message in (why if r.adequate[0] != r.adequate[1] else ())
            )
        )
    if "model" in r.changed:
        console.tell("  parameters of the curve: those of the published curve nearest to either")
    widths = _widths(r)
    if widths:
        console.tell(f"  bands in b: {', '.join(widths)}")
    table = Table("", *map(numbers, ("a: median (90 %)", "b: median (90 %)", "b − a", "b − a [sd]")))
    for name, p in (*r.transformation.items(), *r.parameters.items()):
        if p.shift is None or abs(p.shift) > found.tolerance:
            title = f"{_shown_name(name, r)} [{unit_text(p.unit) or '1'}]"
            table.add_row(title, _interval(p.a), _interval(p.b), _apart(p), _sds(p.shift))
    for band in (band for band in r.bands.values() if band is not None):
        if band.shift is None or abs(band.shift) > found.tolerance:
            title = f"{band.name} at {band.at:.4g} {unit_text(band.temperature_unit)} [{unit_text(band.unit) or '1'}]"
            medians = (write([median]).plain[0] for median in band.medians)
            table.add_row(title, *medians, _signed(band.difference), _sds(band.shift))
    if table.row_count:
        console.print(table)


def _shown_name(parameter: str, r: ComparedRecords) -> str:
    """Name of a parameter, which begins with what its channel is called where it is one of the noise."""
    channel, _, rest = parameter.partition("_")
    band = r.bands.get(channel)
    return parameter if band is None or not rest else f"{band.name}_{rest}"


def _interval(p: ParameterOfRun | None) -> str:
    if p is None:
        return "-"
    if p.q05 is None or p.q95 is None:
        return write([p.median]).plain[0]
    median, low, high = write_interval(p.median, p.q05, p.q95).plain
    return f"{median} ({low} to {high})"


def _apart(p: ComparedParameter) -> str:
    """Difference of the medians."""
    if p.a is None or p.b is None or p.a.median is None or p.b.median is None:
        return "-"
    return _signed(p.b.median - p.a.median)


def _signed(difference: float) -> str:
    """Difference with its sign and three digits, of which a nought at the end is one."""
    return ("" if difference < 0.0 else "+") + write([difference], digits=3).plain[0]


def _sds(shift: float | None) -> str:
    return "-" if shift is None else f"{shift:+.2f}"
