"""A watch in the units in which the measurements were declared, for people."""

from __future__ import annotations

from sma_bayes.quantities import quantity_of
from sma_bayes.runs.declared_units import Shown, in_unit, shown_as, shown_product, units_of
from sma_bayes.studies.cycles.shown import RATIO
from sma_bayes.studies.watch.schema import AmountDocument, LimitDocument, WatchDocument, WatchedNumber


def in_declared_units(found: WatchDocument) -> WatchDocument:
    """What was found, with numbers and units as people see them."""
    specimen = found.specimen
    units = units_of(found, specimen=specimen)
    if not units:
        return found
    causes = tuple(
        c.but(amounts=tuple(amount_shown(a, units, specimen) for a in c.amounts)) for c in found.change.causes
    )
    limits = tuple(_limit(r, found.temperature_unit, units, specimen) for r in found.limits)
    return found.but(
        temperature_unit=shown_as(found.temperature_unit, units).shown,
        numbers=tuple(_number(n, units, specimen) for n in found.numbers),
        change=found.change.but(causes=causes),
        limits=limits,
    )


def amount_shown(a: AmountDocument, units: Shown, specimen: bool) -> AmountDocument:
    """How much something has changed; an offset without a unit is one of strain."""
    if a.name == "offset" and a.unit == "1":
        return in_unit(a, shown_as(a.unit, units, quantity_of("displacement", specimen=specimen)))
    return in_unit(a, shown_product(a.unit, units))


def _number(n: WatchedNumber, units: Shown, specimen: bool) -> WatchedNumber:
    quantity = "" if n.number == RATIO else quantity_of(n.channel, specimen=specimen)
    u = shown_as(n.unit, units, quantity, difference=True)
    sides = {k: tuple(map(u.value, getattr(n, k))) for k in ("value", "normal_low", "normal_high")}
    return n.but(unit=u.shown, **sides)


def _limit(r: LimitDocument, temperature_unit: str, units: Shown, specimen: bool) -> LimitDocument:
    channel = "stiffness" if r.quantity == "stiffness" else r.channel
    quantity = "" if r.quantity == RATIO else quantity_of(channel, specimen=specimen)
    u = shown_as(r.unit, units, quantity, difference=r.quantity == "shift")
    return in_unit(
        r, u, "fitted", "target", now=in_unit(r.now, u), at=shown_as(temperature_unit, units).value(r.at)
    )
