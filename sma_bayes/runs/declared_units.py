"""Results of a fit in the units in which the measurements were declared, for people; files for programs stay in SI."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final, TypeVar

import numpy as np

from sma_bayes.errors import QuantityError
from sma_bayes.parameters.roles import Role
from sma_bayes.quantities import ARBITRARY, CHANNELS, SPECIMEN_QUANTITY, convert
from sma_bayes.runs.fit_document import (
    FitFindings,
    HeldSummary,
    Measure,
    ParameterSummary,
    QuantitySummary,
    RecordSummary,
)
from sma_bayes.runs.schema import DocumentPart, Factor

IN_UNIT_OF_CHANNEL: Final = frozenset(
    {Role.SPAN, Role.OFFSET, Role.LEVEL, Role.COLD_SLOPE, Role.HOT_SLOPE, Role.SLOPE, Role.EFFECT}
)
"""Roles of parameters that have the unit of their channel, alone or over that of temperature."""
SCALED: Final = frozenset({"mean", "sd", "median", "low", "high", "scale"})
"""Numbers of priors that are in the unit of the parameter."""

P = TypeVar("P", bound=DocumentPart)


@dataclass(frozen=True, slots=True)
class ShownUnit:
    """The unit in which people see a channel.

    Attributes
    ----------
    stored, shown : str
        Unit of the stored numbers, and that of the declaration.
    factor : float
        Shown units in a stored one [1].
    """

    stored: str
    shown: str
    factor: float

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
    (ShownUnit(stored='m', shown='mm', factor=1000.0), None)
    """
    if declared == stored or not declared or ARBITRARY in (stored, declared):
        return None
    try:
        zero, one = (float(v) for v in convert(np.array([0.0, 1.0]), stored, declared))
    except QuantityError:
        return None
    if zero != 0.0 or one <= 0.0 or not math.isfinite(one):
        return None
    return ShownUnit(stored, declared, float(f"{one:.15g}"))


def shown_units(records: Iterable[RecordSummary]) -> Shown:
    """How each quantity of a run is shown: as first declared, so that records share their axes and columns.

    A stiffness that was not measured is in the unit of force over that of displacement, a modulus in that of stress.
    """
    declared: dict[str, str] = {}
    stored: dict[str, str] = {}
    for r in records:
        measures: dict[str, Measure | HeldSummary] = {**r.held, **r.quantities}
        for channel, part in measures.items():
            name = _name(r, channel)
            stored.setdefault(name, part.unit)
            if part.declared_unit is not None:
                declared.setdefault(name, part.declared_unit)
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
    averages = []
    for a in summary.correlation_average:
        u = units.get(a.quantity)
        if u is not None and u.stored == a.unit:
            rmse = None if a.rmse is None else {rule: _times(f, u.factor) for rule, f in a.rmse.items()}
            a = a.model_copy(update={"unit": u.shown, "rmse": rmse})
        averages.append(a)
    return summary.model_copy(
        update={
            "records": tuple(_record(r, units) for r in summary.records),
            "loops": tuple(_quantity(q, names.get(q.condition), units) for q in summary.loops),
            "correlation_average": tuple(averages),
        }
    )


def of_parameters(r: RecordSummary, units: Shown) -> dict[str, float]:
    """Shown units in one of the stored parameters, for those that have the unit of a channel [1]."""
    found = {name: _of_parameter(name, p, r, units) for name, p in r.parameters.items()}
    return {name: u.factor for name, u in found.items() if u is not None}


def _of_parameter(name: str, p: ParameterSummary, r: RecordSummary, units: Shown) -> ShownUnit | None:
    u = _of_channel(r, p.channel, units)
    if u is None:
        return None
    if u.stored != "1":
        return u if u.begins(p.unit) else None
    return (
        u
        if p.role in IN_UNIT_OF_CHANNEL
        or name in (f"{p.channel}_sd", f"{p.channel}_step", f"{p.channel}_discrepancy")
        else None
    )


def _name(r: RecordSummary, channel: str) -> str:
    """What a channel is called, be it measured, derived or held."""
    if channel in r.quantities:
        return r.quantities[channel].name
    specimen = {m.name for m in r.quantities.values()} & set(SPECIMEN_QUANTITY.values())
    return SPECIMEN_QUANTITY.get(channel, channel) if specimen else channel


def _of_channel(r: RecordSummary, channel: str, units: Shown) -> ShownUnit | None:
    found = units.get(_name(r, channel))
    stored = r.quantities.get(channel)
    return None if found is None or (stored is not None and stored.unit != found.stored) else found


def _record(r: RecordSummary, units: Shown) -> RecordSummary:
    by_channel = {c: u for c in CHANNELS if (u := _of_channel(r, c, units)) is not None}

    def measure(c: str, m: Measure) -> Measure:
        return m.model_copy(update={"unit": by_channel[c].shown}) if c in by_channel else m

    def scaled(parts: Mapping[str, P], *names: str) -> dict[str, P]:
        return {
            c: _scaled(p, by_channel[c], *names) if c in by_channel else p for c, p in parts.items()
        }  # fmt: skip

    def agreement(found: Mapping[str, Mapping[str, Factor]]) -> dict[str, dict[str, Factor]]:
        return {
            c: {
                n: _times(f, by_channel[c].factor) if n == "rmse" and c in by_channel else f
                for n, f in factors.items()
            }
            for c, factors in found.items()
        }

    fit = {
        c: g.model_copy(
            update={"sse": _product(g.sse, by_channel[c].factor ** 2), "rmse": _product(g.rmse, by_channel[c].factor)}
        )
        if c in by_channel
        else g
        for c, g in r.fit.items()
    }  # fmt: skip
    return r.model_copy(
        update={
            "quantities": {c: measure(c, m) for c, m in r.quantities.items()},
            "held": scaled(r.held, "mean", "sd"),
            "calibration": scaled(r.calibration, "offset", "offset_sd"),
            "discrepancy": scaled(r.discrepancy, "rms", "largest"),
            "nearest": {
                n: _scaled(p, by_channel[p.channel], "q05", "median", "q95")
                if p.channel in by_channel and p.unit == by_channel[p.channel].stored
                else p
                for n, p in r.nearest.items()
            },
            "parameters": {n: _parameter(p, _of_parameter(n, p, r, units)) for n, p in r.parameters.items()},
            "fit": fit,
            "correlation": agreement(r.correlation),
            "correlation_replicated": agreement(r.correlation_replicated),
            "quantities_of_branch": tuple(_quantity(q, r, units) for q in r.quantities_of_branch),
        }
    )  # fmt: skip


def _parameter(p: ParameterSummary, u: ShownUnit | None) -> ParameterSummary:
    if u is None:
        return p
    prior = {
        n: v * u.factor if n in SCALED and isinstance(v, float) else v for n, v in p.prior.items()
    }  # fmt: skip
    own = _scaled(p, u, "warm_start", "warm_start_sd", "mean", "sd", "q05", "median", "q95")
    return own.model_copy(update={"prior": prior})


def _quantity(q: QuantitySummary, r: RecordSummary | None, units: Shown) -> QuantitySummary:
    u = None if r is None else _of_channel(r, q.channel, units)
    if u is None:
        return q
    of_channel = q.name == "loop_area" or q.unit == u.stored
    if u.stored == "1" and q.name != "loop_area":
        of_channel = False
    return _scaled(q, u, "q05", "median", "q95") if of_channel else q


def _scaled(part: P, u: ShownUnit, *names: str) -> P:
    update: dict[str, object] = {n: _product(getattr(part, n), u.factor) for n in names}
    unit = getattr(part, "unit", None)
    if unit:
        update["unit"] = u.of(unit)
    return part.model_copy(update=update)


def _times(f: Factor, factor: float) -> Factor:
    return f.model_copy(update={n: _product(getattr(f, n), factor) for n in ("q05", "median", "q95")})


def _product(value: float | None, factor: float) -> float | None:
    return None if value is None else value * factor
