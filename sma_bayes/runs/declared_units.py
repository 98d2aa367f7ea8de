"""Results in the units in which the measurements were declared, for people; files for programs stay in SI.

`shown_units` says how each quantity and setting of a run is shown, `shown_as` the same of any unit that has them as
factors (a slope against temperature, an area), and `in_unit` converts a part of a document. A document keeps the
declared units of its run (`declared_parts`), from which its report takes them again (`units_of`).
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.assess.bands import band_channels
from sma_bayes.errors import QuantityError
from sma_bayes.quantities import (
    ARBITRARY,
    QUANTITIES,
    SPECIMEN_QUANTITY,
    TEMPERATURE,
    convert,
    unit_text,
)
from sma_bayes.records.types import SETTING_UNITS, Record, setting_unit
from sma_bayes.response.modified_sigmoid import channel_unit
from sma_bayes.runs.fit_document import (
    HeldSummary,
    Measure,
    RecordSummary,
)
from sma_bayes.runs.schema import DeclaredUnits

WEIGHT: Final = {"g": "gf", "kg": "kgf"}
"""Units of force of the weights of masses, in which loads are declared."""
SHORT: Final = {"kelvin": "K", "fahrenheit": "degF", "degree_Fahrenheit": "degF"}
"""How units of temperature are written."""


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
                yield channel_name(r, channel), part.unit, part.declared_unit
            temperature, declared = r.temperature.unit, r.temperature.declared_unit
            settings, specimen = r.settings_declared_units, _of_specimen(r)
        yield TEMPERATURE.name, temperature, declared
        for setting in SETTING_UNITS:
            if setting in settings:
                yield setting, setting_unit(setting, specimen=specimen), settings[setting]


def channel_name(r: RecordSummary, channel: str) -> str:
    """What a channel is called, be it measured, derived or held."""
    if channel in r.quantities:
        return r.quantities[channel].name
    return SPECIMEN_QUANTITY.get(channel, channel) if _of_specimen(r) else channel


def _of_specimen(r: RecordSummary) -> bool:
    return bool({m.name for m in r.quantities.values()} & set(SPECIMEN_QUANTITY.values()))


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


def declared_units(records: Sequence[RecordSummary]) -> list[str]:
    """Units in which the quantities of these records are shown, where those are not the stored ones."""
    there = {q.name for r in records for q in r.quantities.values()}
    return [u.shown for name, u in shown_units(records).items() if name in there]
