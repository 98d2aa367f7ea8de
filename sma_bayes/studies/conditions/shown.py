"""A study of conditions in the units in which the measurements were declared, for people."""

from __future__ import annotations

from typing import TypeVar

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.quantities import quantity_of
from sma_bayes.runs.declared_units import Shown, in_unit, shown_as, shown_columns, units_of
from sma_bayes.studies.conditions.schema import (
    ConditionsDocument,
    LeftOutCurve,
    PooledParameter,
    PredictedCondition,
    PredictedFeature,
    StatedEffect,
    StatedFeature,
    StatedGroup,
    StatedPopulation,
    StoredConditions,
)

F = TypeVar("F", StatedFeature, PredictedFeature)


def in_declared_units(found: ConditionsDocument) -> ConditionsDocument:
    """What a study found, with numbers and units as people see them.

    Words that are stored stay as they are, and so do settings of single conditions and levels of coordinates, which
    nobody is shown.
    """
    units = units_of(found, specimen=found.specimen)
    if not units:
        return found
    specimen = found.specimen
    return found.but(
        groups=tuple(_group(g, units) for g in found.groups),
        features=tuple(_feature(f, units, specimen) for f in found.features),
        effects=tuple(_effect(e, units, specimen) for e in found.effects),
        populations=tuple(_population(p, units, specimen) for p in found.populations),
        predictions=tuple(_prediction(p, units, specimen) for p in found.predictions),
        held_out=tuple(_held_out(h, units) for h in found.held_out),
    )


def series_columns(stored: StoredConditions, file: str, channel: str) -> dict[str, Floats]:
    """Columns of a series of a channel, as people see them."""
    specimen = stored.found.specimen
    units = units_of(stored.found, specimen=specimen)
    quantity = quantity_of(channel, specimen=specimen)
    return shown_columns(stored.columns(file), units, quantity, kept=("row", "extrapolated"))


def _group(g: StatedGroup, units: Shown) -> StatedGroup:
    varied = {}
    for setting, v in g.varied.items():
        u = shown_as(v.unit, units, setting)
        values = tuple(u.values(np.array(v.values)).tolist())
        varied[setting] = v.but(unit=u.shown, values=values)
    return g.but(varied=varied)


def _feature(f: F, units: Shown, specimen: bool) -> F:
    name = "" if f.unit == "1" else quantity_of(f.channel, specimen=specimen)  # 1: shares and ratios
    return in_unit(f, shown_as(f.unit, units, name, difference=f.name == "hysteresis_width"))


def _effect(e: StatedEffect, units: Shown, specimen: bool) -> StatedEffect:
    setting = shown_as(e.setting_unit, units, e.setting)
    name = "" if e.unit == "1" else quantity_of(e.channel, specimen=specimen)
    u = shown_as(e.unit, units, name, difference=True)
    return e.but(
        setting_unit=setting.shown,
        from_=setting.value(e.from_),
        to=setting.value(e.to),
        unit=u.shown,
        tested=in_unit(e.tested, u),
        beyond=in_unit(e.beyond, u),
        scatter=in_unit(e.scatter, u),
    )


def _population(p: StatedPopulation, units: Shown, specimen: bool) -> StatedPopulation:
    coordinates = []
    for c in p.coordinates:
        u = shown_as(c.unit, units, quantity_of(c.channel, specimen=specimen), difference=True)
        coordinates.append(
            c.but(
                unit=u.shown,
                changes={n: in_unit(v, u) for n, v in c.changes.items()},
                scatter=in_unit(c.scatter, u),
                scatter_prior=in_unit(c.scatter_prior, u),
            )
        )
    parameters = {
        condition: {n: _pooled(v, units, specimen) for n, v in of.items()}
        for condition, of in p.parameters.items()
    }
    return p.but(coordinates=tuple(coordinates), parameters=parameters)


def _pooled(v: PooledParameter, units: Shown, specimen: bool) -> PooledParameter:
    u = shown_as(v.unit, units, quantity_of(v.channel, specimen=specimen), difference=v.difference)
    return v.but(unit=u.shown, own=in_unit(v.own, u), pooled=in_unit(v.pooled, u))


def _prediction(p: PredictedCondition, units: Shown, specimen: bool) -> PredictedCondition:
    u = shown_as(p.temperature.unit, units)
    channels = {c: of.but(unit=shown_as(of.unit, units, of.quantity).shown) for c, of in p.channels.items()}
    return p.but(
        temperature=in_unit(p.temperature, u, "covered_from", "covered_to"),
        features=tuple(_feature(f, units, specimen) for f in p.features),
        channels=channels,
    )


def _held_out(h: LeftOutCurve, units: Shown) -> LeftOutCurve:
    u = shown_as(h.unit, units, h.quantity)
    ways = h.ways if h.on_log else {n: in_unit(s, u, "width", "error") for n, s in h.ways.items()}
    return in_unit(h, u, "span", ways=ways, temperature_unit=shown_as(h.temperature_unit, units).shown)
