"""Documents in the units in which the measurements were declared, for people.

A schema says of each unit what it is of (`UnitOf`) and of each number in which unit it is (`In`); what says neither is
shown as it is stored, and so are words.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, Final, TypeVar, get_args

from sma_bayes.arrays import Floats
from sma_bayes.assess.loops import QuantityInterval
from sma_bayes.document_part import UNDER, DocumentPart, In, UnitOf
from sma_bayes.parameters.roles import Role
from sma_bayes.quantities import CHANNELS, TEMPERATURE, quantity_of
from sma_bayes.runs.declared_units import Shown, ShownUnit, channel_name, shown_as, shown_product, units_of
from sma_bayes.runs.finished_run import FinishedRun
from sma_bayes.runs.fit_document import FitFindings, NearestSummary, ParameterSummary, RecordSummary
from sma_bayes.runs.schema import DeclaredUnits, Factor

IN_UNIT_OF_CHANNEL: Final = frozenset(
    {Role.SPAN, Role.OFFSET, Role.LEVEL, Role.COLD_SLOPE, Role.HOT_SLOPE, Role.SLOPE, Role.EFFECT}
)
"""Roles of parameters that have the unit of their channel, alone or over that of temperature."""
SCALED: Final = frozenset({"mean", "sd", "median", "low", "high", "scale"})
"""Numbers of priors that are in the unit of the parameter."""
SPREADS: Final = frozenset({"sd", "scale"})
"""Those of them that are differences."""
INTERVAL: Final = ("q05", "median", "q95")
"""Numbers of an interval."""
WITHOUT_UNIT: Final = ("row", "fold", "cycle", "extrapolated", "_ln_density", "_loo", "_k")
"""Ends of the names of columns of a series that are in no unit."""

D = TypeVar("D", bound=DeclaredUnits)
P = TypeVar("P", bound=DocumentPart)


def in_declared_units(found: D) -> D:
    """What was found, with numbers and units as people see them."""
    specimen = getattr(found, "specimen", False)
    return shown_part(found, units_of(found, specimen=specimen), specimen=specimen)


def shown_part(part: P, units: Shown, *, specimen: bool = False) -> P:
    """The same of a part.

    Parameters
    ----------
    part : DocumentPart
    units : mapping of str to ShownUnit
        See `shown_units`.
    specimen : bool
        Whether channels are stress, strain and modulus.
    """
    return _Conversion(units, specimen).part(part) if units else part


def series_shown(stored: FinishedRun[D], file: str, quantity: str) -> dict[str, Floats]:
    """Columns of a series of a quantity as people see them.

    Parameters
    ----------
    stored : FinishedRun
    file : str
        With the column ``temperature_degC``, which is renamed, and numbers in the unit of the quantity.
    quantity : str
        The quantity, or its channel.
    """
    specimen = getattr(stored.found, "specimen", False)
    units = units_of(stored.found, specimen=specimen)
    u, degrees = units.get(quantity_of(quantity, specimen=specimen)), units.get(TEMPERATURE.name)
    temperature = f"{TEMPERATURE.name}_{TEMPERATURE.unit}"
    shown: dict[str, Floats] = {}
    for name, values in stored.columns(file).items():
        if name == temperature and degrees is not None:
            shown[f"{TEMPERATURE.name}_{degrees.shown}"] = degrees.values(values)
        elif u is None or name == temperature or name.endswith(WITHOUT_UNIT):
            shown[name] = values
        else:
            shown[name] = u.values(values)
    return shown


@cache
def _marked(kind: type[DocumentPart]) -> tuple[dict[str, UnitOf], dict[str, In | None]]:
    """Units that a part states; its numbers with a unit, and what holds parts."""
    units: dict[str, UnitOf] = {}
    within: dict[str, In | None] = {}
    for name, key in kind.model_fields.items():
        marks = {type(m): m for m in key.metadata}
        if UnitOf in marks:
            units[name] = marks[UnitOf]
        elif In in marks or _holds_parts(key.annotation):
            within[name] = marks.get(In)
    return units, within


def _holds_parts(kind: Any) -> bool:
    return any(map(_holds_parts, get_args(kind))) or (
        isinstance(kind, type) and issubclass(kind, DocumentPart)
    )


@dataclass(frozen=True, slots=True)
class _Conversion:
    units: Shown
    specimen: bool

    def part(self, part: P, under: str = "", around: ShownUnit | None = None) -> P:
        """A part that stands under a key of a mapping, in one that has a unit for it."""
        stated, within = _marked(type(part))
        own = {name: self._unit(part, getattr(part, name), of, under) for name, of in stated.items()}
        update: dict[str, Any] = {name: u.shown for name, u in own.items()}
        for name, mark in within.items():
            u = None
            if mark is not None and not (mark.unless and getattr(part, mark.unless)):
                u = own.get(mark.key) or (around if mark.key == "unit" else self._named(mark.key))
                u = replace(u, zero=0.0) if u is not None and mark.difference else u
            update[name] = self._value(getattr(part, name), u, under)
        return part.but(**update)

    def _unit(self, part: DocumentPart, unit: str, mark: UnitOf, under: str) -> ShownUnit:
        if callable(mark.of):
            of = mark.of(part)
        elif mark.of == UNDER:
            of = under
        else:
            of = mark.of and getattr(part, mark.of)
        if of is None:
            return shown_product(unit, self.units)
        difference = mark.difference(part) if callable(mark.difference) else mark.difference
        return shown_as(unit, self.units, quantity_of(of, specimen=self.specimen), difference=difference)

    def _named(self, name: str) -> ShownUnit | None:
        return self.units[name] if name in self.units else shown_as(name, self.units)

    def _value(self, value: Any, u: ShownUnit | None, under: str) -> Any:
        if isinstance(value, DocumentPart):
            return self.part(value, under, u)
        if isinstance(value, tuple):
            return tuple(self._value(v, u, under) for v in value)
        if isinstance(value, Mapping):
            return {key: self._value(v, u, key) for key, v in value.items()}
        return value if u is None or value is None else u.value(value)


def in_shown_units(summary: FitFindings, units: Shown) -> FitFindings:
    """What a fit found with its numbers in the units of `shown_units`.

    Words that a run has stored, such as those of a finding, stay as they are.
    """
    if not units:
        return summary
    names = {r.condition: r for r in summary.records}
    return summary.but(
        records=tuple(_record(r, units) for r in summary.records),
        loops=tuple(_quantity(q, names.get(q.condition), units) for q in summary.loops),
        correlation_average=tuple(shown_part(a, units) for a in summary.correlation_average),
    )


def of_parameters(r: RecordSummary, units: Shown) -> dict[str, ShownUnit]:
    """How the parameters are shown whose unit has that of a channel or of temperature as a factor."""
    found = {name: _of_parameter(name, p, r, units) for name, p in r.parameters.items()}
    return {name: u for name, u in found.items() if u.shown != u.stored}


def _of_parameter(name: str, p: ParameterSummary, r: RecordSummary, units: Shown) -> ShownUnit:
    u = _of_channel(r, p.channel, units)
    own = u is not None and (u.stored != "1" or in_unit_of_channel(name, p.channel, p.role))
    return shown_as(
        p.unit, units, channel_name(r, p.channel) if own else "", difference=p.role != Role.MIDPOINT
    )


def in_unit_of_channel(name: str, channel: str, role: str | None) -> bool:
    """Whether a parameter has the unit of its channel, alone or over that of temperature, also where that is 1."""
    sizes = (f"{channel}_sd", f"{channel}_step", f"{channel}_discrepancy", f"{channel}_between_sweeps")
    return bool(channel) and (role in IN_UNIT_OF_CHANNEL or name in sizes)


def _of_channel(r: RecordSummary, channel: str, units: Shown) -> ShownUnit | None:
    found = units.get(channel_name(r, channel))
    stored = r.quantities.get(channel)
    return None if found is None or (stored is not None and stored.unit != found.stored) else found


def _record(r: RecordSummary, units: Shown) -> RecordSummary:
    by_channel = {c: u for c in CHANNELS if (u := _of_channel(r, c, units)) is not None}
    degrees, apart = (shown_as(r.temperature.unit, units, difference=d) for d in (False, True))

    def scaled(parts: Mapping[str, P], *names: str) -> dict[str, P]:
        return {c: in_unit(p, by_channel[c], *names) if c in by_channel else p for c, p in parts.items()}

    def agreement(found: Mapping[str, Mapping[str, Factor]]) -> dict[str, dict[str, Factor]]:
        return {
            c: {
                n: in_unit(f, by_channel[c]) if n == "rmse" and c in by_channel else f
                for n, f in factors.items()
            }
            for c, factors in found.items()
        }

    def of_channel(p: NearestSummary) -> bool:
        return p.channel in by_channel and p.unit == by_channel[p.channel].stored

    fit = {
        c: g.but(sse=_product(g.sse, by_channel[c].factor ** 2), rmse=_product(g.rmse, by_channel[c].factor))
        if c in by_channel
        else g
        for c, g in r.fit.items()
    }
    return r.but(
        quantities={
            c: m.but(unit=by_channel[c].shown) if c in by_channel else m for c, m in r.quantities.items()
        },
        held=scaled(r.held, "mean", "sd"),
        temperature=in_unit(r.temperature, degrees, "lowest", "highest", sd=apart.value(r.temperature.sd)),
        calibration={
            c: k.but(offset=degrees.value(k.offset), offset_sd=apart.value(k.offset_sd))
            if c == TEMPERATURE.name
            else k
            for c, k in scaled(r.calibration, "offset", "offset_sd").items()
        },
        discrepancy={
            c: m.but(at=degrees.value(m.at))
            for c, m in scaled(r.discrepancy, "rms", "largest", "between_sweeps").items()
        },
        nearest={
            n: in_unit(p, shown_as(p.unit, units, channel_name(r, p.channel) if of_channel(p) else ""))
            for n, p in r.nearest.items()
        },
        transformation={n: in_unit(t, shown_as(t.unit, units)) for n, t in r.transformation.items()},
        parameters={n: _parameter(p, _of_parameter(n, p, r, units)) for n, p in r.parameters.items()},
        fit=fit,
        correlation=agreement(r.correlation),
        correlation_replicated=agreement(r.correlation_replicated),
        quantities_of_branch=tuple(_quantity(q, r, units) for q in r.quantities_of_branch),
    )


def _parameter(p: ParameterSummary, u: ShownUnit) -> ParameterSummary:
    if u.shown == u.stored:
        return p
    by = dict.fromkeys(SCALED, u) | dict.fromkeys(SPREADS, replace(u, zero=0.0))
    prior = {n: by[n].value(v) if n in by and isinstance(v, float) else v for n, v in p.prior.items()}
    own = in_unit(p, u, "warm_start", "mean", "q05", "median", "q95")
    spreads = {n: _product(getattr(p, n), u.factor) for n in ("warm_start_sd", "sd")}
    return own.but(prior=prior, **spreads)


def _quantity(q: QuantityInterval, r: RecordSummary | None, units: Shown) -> QuantityInterval:
    u = None if r is None else _of_channel(r, q.channel, units)
    unit, factor = q.unit, 1.0
    if u is not None and (q.name == "loop_area" or (q.unit == u.stored and u.stored != "1")):
        unit, factor = u.of(q.unit), u.factor
    degrees = {name: found for name, found in units.items() if name == TEMPERATURE.name}
    last = shown_as(unit, degrees, difference=True)  # a width, or an area
    return in_unit(q, ShownUnit(q.unit, last.shown, factor * last.factor))


def in_unit(part: P, u: ShownUnit, *names: str, **changed: object) -> P:
    """A part of a document as it is shown, and its `unit` with it where it has one; None where there is none.

    Parameters
    ----------
    part : DocumentPart or None
    u : ShownUnit
    *names : str
        Its numbers in that unit; those of an interval if there are none.
    **changed
        Keys that are shown in another way.
    """
    if part is None:
        return part
    update: dict[str, object] = {n: u.value(getattr(part, n)) for n in names or INTERVAL}
    unit = getattr(part, "unit", None)
    if unit:
        update["unit"] = u.of(unit)
    return part.but(**(update | changed))


def _product(value: float | None, factor: float) -> float | None:
    return None if value is None else value * factor
