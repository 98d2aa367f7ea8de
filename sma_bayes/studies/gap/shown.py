"""A gap study in the units in which the measurements were declared, for people."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TypeVar

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.quantities import SPECIMEN_QUANTITY
from sma_bayes.runs.declared_units import Shown, ShownUnit, shown_as, shown_product, units_of
from sma_bayes.runs.shown import INTERVAL, in_unit, shown_part
from sma_bayes.studies.gap.outputs import Samples, StoredStudy
from sma_bayes.studies.gap.schema import (
    AddedEffect,
    EffectParameter,
    GapDocument,
    GapOfModel,
    StatedDisagreement,
    StatedJump,
    StatedNoise,
    StatedPeriodicity,
)

G = TypeVar("G", bound=GapOfModel)

PREDICTED_COLUMNS = ("measured", "before", "after")
"""Columns of the series in the unit of the channel; what effects add are differences of such values."""


def units_of_study(found: GapDocument) -> Shown:
    """How each quantity and setting is shown."""
    return units_of(found, specimen=_of_specimen(found))


def _of_specimen(found: GapOfModel) -> bool:
    return bool({c.name for c in found.channels.values()} & set(SPECIMEN_QUANTITY.values()))


def in_declared_units(found: GapDocument) -> GapDocument:
    """What was found, with numbers and units as people see them.

    Numbers of single sweeps and settings of conditions, which nobody is shown, stay as they are.
    """
    units = units_of_study(found)
    if not units:
        return found
    heating = found.heating and part_in_declared_units(found.heating, units)
    return part_in_declared_units(found, units).but(heating=heating)


def part_in_declared_units(found: G, units: Shown) -> G:
    """The same of one model."""

    def of(channel: str, *, difference: bool = False) -> ShownUnit:
        facts = found.channels[channel]
        return shown_as(facts.unit, units, facts.name, difference=difference)

    def place(d: StatedDisagreement) -> StatedDisagreement:
        facts = found.channels.get(d.covariate)
        u = shown_as(d.unit, units, d.covariate if facts is None else facts.name)
        residual = of(d.channel, difference=True).value(d.mean_residual)
        return d.but(from_=u.value(d.from_), to=u.value(d.to), unit=u.shown, mean_residual=residual)

    def line(p: StatedPeriodicity) -> StatedPeriodicity:
        return p.but(amplitude=of(p.channel, difference=True).value(p.amplitude))

    def jump(j: StatedJump) -> StatedJump:
        degrees = shown_as("degC", units, "temperature")
        temperature = None if j.temperature is None else degrees.value(j.temperature)
        return j.but(by=of(j.channel, difference=True).value(j.by), temperature=temperature)

    def noise(n: StatedNoise) -> StatedNoise:
        return in_unit(n, of(n.channel, difference=True), "sd", "scatter")

    with_priors = found.but(
        effects=tuple(_effect(e, units) for e in found.effects),
        partial=tuple(_effect(e, units) for e in found.partial),
    )
    shown = shown_part(with_priors, units, specimen=_of_specimen(found))
    return shown.but(
        disagreement=tuple(map(place, found.disagreement)),
        within_chance=tuple(map(place, found.within_chance)),
        periodic=tuple(map(line, found.periodic)),
        jumps=tuple(map(jump, found.jumps)),
        units={n: shown_as(u, units, n).shown for n, u in found.units.items()}
        | {c: n.unit for c, n in shown.channels.items() if c in found.units},
        noise=tuple(map(noise, found.noise)),
    )


def _unit(p: EffectParameter, units: Shown) -> ShownUnit:
    """How a parameter is shown; one in degrees Celsius is a temperature, and no difference of two."""
    return shown_as(p.unit, units) if p.unit == "degC" else shown_product(p.unit, units)


def _effect(e: AddedEffect, units: Shown) -> AddedEffect:
    """An effect with the quantiles of its priors in the units of its parameters."""

    def of(p: EffectParameter) -> EffectParameter:
        u = _unit(p, units)
        ends = {n: u.value(float(v)) for n, v in p.prior.items() if n in INTERVAL}
        return p.but(prior=p.prior | ends)

    return e.but(parameters={n: of(p) for n, p in e.parameters.items()})


def study_in_declared_units(study: StoredStudy) -> StoredStudy:
    """A study with its series and draws as people see them."""
    units = units_of_study(study.found)
    if not units:
        return study
    found = in_declared_units(study.found)
    shown = _part(study, found, found, units)
    if study.heating is None or found.heating is None:
        return shown
    return replace(shown, heating=_part(study.heating, found, found.heating, units))


def _part(study: StoredStudy, found: GapDocument, part: GapOfModel, units: Shown) -> StoredStudy:
    own = {f"{e.id}.{n}": _unit(p, units) for e in study.effects for n, p in e.parameters.items()}

    def draws(of: Mapping[str, Floats]) -> dict[str, Floats]:
        return {name: own[name].values(values) if name in own else values for name, values in of.items()}

    return replace(
        study,
        found=found,
        part=part,
        samples=_samples(study, units),
        draws=draws(study.draws),
        prior=draws(study.prior),
    )


def _samples(study: StoredStudy, units: Shown) -> Samples:
    """Inputs in the units of the axes, and what was measured and predicted in those of the channels."""
    stored = study.part.units
    numbers = dict(study.samples.numbers)
    for name in numbers:
        if (name in stored and name not in study.part.channels) or name == "temperature":
            numbers[name] = shown_as(stored.get(name, "1"), units, name).values(numbers[name])
    added = [f"{e.id}_{q}" for e in study.effects for q in ("q05", "median", "q95")]
    for channel, facts in study.part.channels.items():
        own = study.samples.words["channel"] == channel
        for difference, names in ((False, PREDICTED_COLUMNS), (True, added)):
            u = shown_as(facts.unit, units, facts.name, difference=difference)
            for name in (n for n in names if n in numbers):
                numbers[name] = np.where(own, u.values(numbers[name]), numbers[name])
    return Samples(study.samples.words, numbers)
