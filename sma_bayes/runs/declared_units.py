"""Results in the units in which the measurements were declared, for people; files for programs stay in SI.

`shown_units` says how each quantity and setting of a run is shown, `shown_as` the same of any unit that has them as
factors (a slope against temperature, an area), and `in_unit` converts a part of a document. A document keeps the
declared units of its run (`declared_parts`), from which its report takes them again (`units_of`).
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final, TypeVar

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.assess.bands import band_channels
from sma_bayes.assess.loops import QuantityInterval
from sma_bayes.errors import QuantityError
from sma_bayes.parameters.roles import Role
from sma_bayes.quantities import (
    ARBITRARY,
    CHANNELS,
    QUANTITIES,
    SPECIMEN_QUANTITY,
    TEMPERATURE,
    convert,
    unit_text,
)
from sma_bayes.records.types import SETTING_UNITS, Record, setting_unit
from sma_bayes.response.modified_sigmoid import channel_unit
from sma_bayes.runs.fit_document import (
    FitFindings,
    HeldSummary,
    Measure,
    NearestSummary,
    ParameterSummary,
    RecordSummary,
)
from sma_bayes.runs.schema import CorrelationAverage, DeclaredUnits, DocumentPart, Factor

IN_UNIT_OF_CHANNEL: Final = frozenset(
    {Role.SPAN, Role.OFFSET, Role.LEVEL, Role.COLD_SLOPE, Role.HOT_SLOPE, Role.SLOPE, Role.EFFECT}
)
"""Roles of parameters that have the unit of their channel, alone or over that of temperature."""
SCALED: Final = frozenset({"mean", "sd", "median", "low", "high", "scale"})
"""Numbers of priors that are in the unit of the parameter."""
SPREADS: Final = frozenset({"sd", "scale"})
"""Those of them that are differences."""
WEIGHT: Final = {"g": "gf", "kg": "kgf"}
"""Units of force of the weights of masses, in which loads are declared."""
SHORT: Final = {"kelvin": "K", "fahrenheit": "degF", "degree_Fahrenheit": "degF"}
"""How units of temperature are written."""
INTERVAL: Final = ("q05", "median", "q95")
"""Numbers of an interval."""

P = TypeVar("P", bound=DocumentPart | None)


@dataclass(frozen=True, slots=True)
class ShownUnit:
    """The unit in which people see a channel.

    Attributes
    ----------
    stored, shown : str
        Unit of the stored numbers, and that of the declaration.
    factor : float
        Shown units in a stored one [1].
    zero : float
        What a stored 0 is shown as: other than 0 only of temperatures that are no differences.
    """

    stored: str
    shown: str
    factor: float
    zero: float = 0.0

    def value(self, stored: float | None) -> float | None:
        """A number as it is shown."""
        return None if stored is None else stored * self.factor + self.zero

    def values(self, stored: Floats) -> Floats:
        """Numbers as they are shown."""
        return stored * self.factor + self.zero

    def of(self, unit: str) -> str:
        """Unit of a quantity that has the channel's as its first factor: of a slope, or of an area.

        Examples
        --------
        >>> ShownUnit("N", "mN", 1e3).of("N/degC"), ShownUnit("1", "percent", 100.0).of("degC")
        ('mN/degC', 'percent degC')
        """
        if unit == self.stored:
            return self.shown
        if self.stored == "1":
            return self.shown + unit.removeprefix("1") if unit.startswith("1/") else f"{self.shown} {unit}"
        return self.shown + unit.removeprefix(self.stored) if self.begins(unit) else unit

    def begins(self, unit: str) -> bool:
        """Whether a unit is that of the channel, alone or with something behind it."""
        return unit == self.stored or unit.startswith((f"{self.stored}/", f"{self.stored} "))


Shown = Mapping[str, ShownUnit]
"""By name of a quantity: force and stress are different ones."""


def shown_unit(stored: str, declared: str) -> ShownUnit | None:
    """How a channel is shown; None where nothing is to be converted, or not by a factor alone.

    Examples
    --------
    >>> shown_unit("m", "mm"), shown_unit("m", "m")
    (ShownUnit(stored='m', shown='mm', factor=1000.0, zero=0.0), None)
    >>> shown_unit("degC", "degF")
    ShownUnit(stored='degC', shown='degF', factor=1.8, zero=32.0)
    >>> round(shown_unit("N", "g").value(0.980665), 9)
    100.0
    """
    if declared == stored or not declared or ARBITRARY in (stored, declared):
        return None
    to = WEIGHT.get(declared, declared) if stored == "N" else declared
    try:
        zero, one = (float(v) for v in convert(np.array([0.0, 1.0]), stored, to))
    except QuantityError:
        return None
    factor = float(f"{one - zero:.12g}")
    if (zero != 0.0 and stored != TEMPERATURE.unit) or factor <= 0.0 or not math.isfinite(factor):
        return None
    if stored == TEMPERATURE.unit and (factor, zero) == (1.0, 0.0):
        return None
    return ShownUnit(stored, SHORT.get(declared, declared), factor, float(f"{zero:.12g}"))


def shown_units(records: Iterable[RecordSummary | Record]) -> Shown:
    """How each quantity and setting of a run is shown: as first declared, so that records share axes and columns.

    A stiffness that was not measured is in the unit of force over that of displacement, a modulus in that of stress.
    """
    declared: dict[str, str] = {}
    stored: dict[str, str] = {}
    for name, unit, as_declared in _declared(records):
        stored.setdefault(name, unit)
        if as_declared is not None:
            declared.setdefault(name, as_declared)
    of = {**stored, **declared}
    over, _, below = declared.get("stiffness", "").partition("/")
    derived = {
        "modulus": of.get("stress", "Pa"),
        "stiffness": f"{of.get('force', 'N')}/{of.get('displacement', 'm')}",
        **({"force": over, "displacement": below} if below else {}),
    }
    usual = {"force": "N", "displacement": "m"}
    found = {
        name: shown_unit(unit, declared.get(name, derived.get(name, unit)))
        for name, unit in {**usual, **stored}.items()
    }
    return {name: shown for name, shown in found.items() if shown is not None}


def _declared(records: Iterable[RecordSummary | Record]) -> Iterator[tuple[str, str, str | None]]:
    """Name, stored and declared unit of each quantity and setting of each record."""
    for r in records:
        settings: Mapping[str, str]
        if isinstance(r, Record):
            for channel in (*band_channels(r), *r.held):
                yield r.quantity(channel), channel_unit(r.units, channel), r.declared_units.get(channel)
            temperature, settings, specimen = r.units["temperature"], r.declared_units, r.specimen
            declared = r.declared_units.get("temperature")
        else:
            measures: dict[str, Measure | HeldSummary] = {**r.held, **r.quantities}
            for channel, part in measures.items():
                yield _name(r, channel), part.unit, part.declared_unit
            temperature, declared = r.temperature.unit, r.temperature.declared_unit
            settings, specimen = r.settings_declared_units, _of_specimen(r)
        yield TEMPERATURE.name, temperature, declared
        for setting in SETTING_UNITS:
            if setting in settings:
                yield setting, setting_unit(setting, specimen=specimen), settings[setting]


def declared_parts(records: Sequence[RecordSummary | Record]) -> dict[str, Any]:
    """The keys of `DeclaredUnits`, which a document keeps for its report.

    Parameters
    ----------
    records : sequence of RecordSummary or Record
        Of the fit, or of the measurements.
    """
    units = shown_units(records)
    found: dict[str, dict[str, None]] = {}
    for name, unit, as_declared in _declared(records):
        found.setdefault(name, {})[unit_text(SHORT.get(as_declared or unit, as_declared or unit)) or "1"] = (
            None
        )
    return {
        "declared_units": {name: u.shown for name, u in units.items()},
        "declared_differently": tuple(
            f"{name.replace('_', ' ')} is declared in {' and '.join(declared)}: shown in {next(iter(declared))}, "
            "which is the first"
            for name, declared in found.items()
            if len(declared) > 1
        ),
    }


def units_of(found: DeclaredUnits, *, specimen: bool = False) -> Shown:
    """How each quantity and setting of a document is shown.

    Parameters
    ----------
    found : DeclaredUnits
    specimen : bool
        Whether loads are stresses.
    """
    stored = {q.name: q.unit for q in QUANTITIES.values()}
    stored |= {s: setting_unit(s, specimen=specimen) for s in SETTING_UNITS}
    shown = {n: shown_unit(stored[n], u) for n, u in found.declared_units.items() if n in stored}
    return {name: u for name, u in shown.items() if u is not None}


_TEMPERATURE = re.compile(rf"(/ ?)?\b(?:{TEMPERATURE.unit}|K)\b")


def shown_as(unit: str, units: Shown, quantity: str = "", *, difference: bool = False) -> ShownUnit:
    """How numbers are shown whose unit is made of that of a quantity and of that of temperature, or has neither.

    Parameters
    ----------
    unit : str
        Unit in which they are stored.
    units : mapping of str to ShownUnit
        See `shown_units`.
    quantity : str
        Quantity or setting whose unit is the first factor; none for pure numbers, such as ratios.
    difference : bool
        Whether a temperature is the difference of two; what is stored in kelvins always is.

    Examples
    --------
    >>> units = {"force": ShownUnit("N", "mN", 1e3), "temperature": ShownUnit("degC", "degF", 1.8, 32.0)}
    >>> shown_as("N/degC", units, "force").shown, shown_as("degC", units).value(100.0)
    ('mN/degF', 212.0)
    >>> shown_as("degC", units, "force", difference=True).value(100.0)
    180.0
    """
    text, factor = unit, 1.0
    u, degrees = units.get(quantity), units.get(TEMPERATURE.name)
    if degrees is not None and unit in (degrees.stored, "K"):
        difference = difference or unit == "K"
        return ShownUnit(unit, degrees.shown, degrees.factor, 0.0 if difference else degrees.zero)
    if u is not None and quantity != TEMPERATURE.name and u.begins(unit):
        text, factor = u.of(unit), u.factor
    if degrees is not None:
        for found in _TEMPERATURE.finditer(text):
            factor *= 1.0 / degrees.factor if found[1] else degrees.factor
        text = _TEMPERATURE.sub(lambda m: (m[1] or "") + degrees.shown, text)
    return ShownUnit(unit, text, factor)


_NAMES: Final = re.compile(r"[A-Za-z_]\w*")


def shown_product(unit: str, units: Shown) -> ShownUnit:
    """How numbers are shown whose unit is any product of units of force, displacement, stress and temperature.

    Temperatures are differences. Where only loads of a specimen were declared, stresses are shown in their unit.

    Examples
    --------
    >>> units = {"force": ShownUnit("N", "mN", 1e3), "temperature": ShownUnit("degC", "degF", 1.8, 32.0)}
    >>> shown_product("K/N", units)
    ShownUnit(stored='K/N', shown='degF/mN', factor=0.0018, zero=0.0)
    """
    known = [units[n] for n in ("force", "displacement", "stress") if n in units]
    load = units.get("load")
    if load is not None and load.stored == QUANTITIES["stress"].unit and "stress" not in units:
        known.append(load)
    names = {u.stored: u.shown for u in known if u.stored != "1"}
    if TEMPERATURE.name in units:
        names |= dict.fromkeys(("K", TEMPERATURE.unit), units[TEMPERATURE.name].shown)
    text = _NAMES.sub(lambda m: names.get(m[0], m[0]), unit)
    if text == unit:
        return ShownUnit(unit, unit, 1.0)
    stored, shown = (re.sub(r"\bdeg(?=[CF]\b)", "delta_deg", of) for of in (unit, text))
    try:
        factor = float(f"{float(convert(1.0, stored, shown)):.12g}")
    except QuantityError:
        return ShownUnit(unit, unit, 1.0)
    return ShownUnit(unit, text, factor)


def shown_columns(
    columns: Mapping[str, Floats], units: Shown, quantity: str, kept: Iterable[str] = ()
) -> dict[str, Floats]:
    """Columns of a series of a quantity as they are shown.

    Parameters
    ----------
    columns : mapping of str to ndarray
        ``temperature_degC``, which is renamed, and numbers in the unit of the quantity.
    units : mapping of str to ShownUnit
        See `shown_units`.
    quantity : str
    kept : iterable of str
        Columns in none of these units.
    """
    u, degrees = units.get(quantity), units.get(TEMPERATURE.name)
    temperature = f"{TEMPERATURE.name}_{TEMPERATURE.unit}"
    shown: dict[str, Floats] = {}
    for name, values in columns.items():
        if name == temperature and degrees is not None:
            shown[f"{TEMPERATURE.name}_{degrees.shown}"] = degrees.values(values)
        elif u is None or name == temperature or name in kept:
            shown[name] = values
        else:
            shown[name] = u.values(values)
    return shown


def shown_average(a: CorrelationAverage, units: Shown) -> CorrelationAverage:
    """Averages of correlation factors as they are shown."""
    u = units.get(a.quantity)
    if u is None or u.stored != a.unit:
        return a
    rmse = None if a.rmse is None else {rule: in_unit(f, u) for rule, f in a.rmse.items()}
    return a.but(unit=u.shown, rmse=rmse)


def declared_units(records: Sequence[RecordSummary]) -> list[str]:
    """Units in which the quantities of these records are shown, where those are not the stored ones."""
    there = {q.name for r in records for q in r.quantities.values()}
    return [u.shown for name, u in shown_units(records).items() if name in there]


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
        correlation_average=tuple(shown_average(a, units) for a in summary.correlation_average),
    )


def of_parameters(r: RecordSummary, units: Shown) -> dict[str, ShownUnit]:
    """How the parameters are shown whose unit has that of a channel or of temperature as a factor."""
    found = {name: _of_parameter(name, p, r, units) for name, p in r.parameters.items()}
    return {name: u for name, u in found.items() if u.shown != u.stored}


def _of_parameter(name: str, p: ParameterSummary, r: RecordSummary, units: Shown) -> ShownUnit:
    u = _of_channel(r, p.channel, units)
    own = u is not None and (u.stored != "1" or in_unit_of_channel(name, p.channel, p.role))
    return shown_as(p.unit, units, _name(r, p.channel) if own else "", difference=p.role != Role.MIDPOINT)


def in_unit_of_channel(name: str, channel: str, role: str | None) -> bool:
    """Whether a parameter has the unit of its channel, alone or over that of temperature, also where that is 1."""
    sizes = (f"{channel}_sd", f"{channel}_step", f"{channel}_discrepancy")
    return bool(channel) and (role in IN_UNIT_OF_CHANNEL or name in sizes)


def _name(r: RecordSummary, channel: str) -> str:
    """What a channel is called, be it measured, derived or held."""
    if channel in r.quantities:
        return r.quantities[channel].name
    return SPECIMEN_QUANTITY.get(channel, channel) if _of_specimen(r) else channel


def _of_specimen(r: RecordSummary) -> bool:
    return bool({m.name for m in r.quantities.values()} & set(SPECIMEN_QUANTITY.values()))


def _of_channel(r: RecordSummary, channel: str, units: Shown) -> ShownUnit | None:
    found = units.get(_name(r, channel))
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
            c: m.but(at=degrees.value(m.at)) for c, m in scaled(r.discrepancy, "rms", "largest").items()
        },
        nearest={
            n: in_unit(p, shown_as(p.unit, units, _name(r, p.channel) if of_channel(p) else ""))
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
