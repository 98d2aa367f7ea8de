"""What a study of conditions says in `conditions.json` and in the series beside it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.assess.draws import RecordDraws
from sma_bayes.fitting.curves import quantiles
from sma_bayes.parameters.roles import Role
from sma_bayes.parameters.space import ParameterSpec
from sma_bayes.records.types import Condition, setting_unit
from sma_bayes.runs.schema import interval_document
from sma_bayes.runs.shown import in_unit_of_channel
from sma_bayes.studies.conditions.design import SETTINGS, Design
from sma_bayes.studies.conditions.effects import SettingEffect
from sma_bayes.studies.conditions.leave_out import HIERARCHICAL, LeftOutChannel
from sma_bayes.studies.conditions.population import Population
from sma_bayes.studies.conditions.prediction import Prediction, predicted_features
from sma_bayes.studies.conditions.schema import (
    LeftOutCurve,
    PooledParameter,
    PopulationSampling,
    PredictedChannel,
    PredictedCondition,
    PredictedFeature,
    StatedConfounder,
    StatedCoordinate,
    StatedEffect,
    StatedFeature,
    StatedGroup,
    StatedPopulation,
    TemperaturesCovered,
    VariedSetting,
)
from sma_bayes.studies.conditions.study import ConditionStudy


def study_parts(study: ConditionStudy, *, specimen: bool) -> dict[str, Any]:
    """What a study found, as the keys of `ConditionsFindings`.

    Parameters
    ----------
    study : ConditionStudy
    specimen : bool
        Whether loads are stresses.
    """
    return {
        "converged": study.converged,
        "groups": tuple(_group(d, specimen) for d in study.designs),
        "features": tuple(
            StatedFeature.about(f, condition=f.condition.id, **f.quantiles()) for f in study.features
        ),
        "effects": tuple(_effect(e, study, specimen) for e in study.effects),
        "populations": tuple(_population(p) for p in study.populations),
        "predictions": tuple(_prediction(p) for p in study.predictions),
        "held_out": tuple(_held_out(h) for h in study.held_out),
        "remarks": study.remarks,
        "cautions": tuple(cautions(study)),
    }


def stem(condition: Condition, branch: str, channel: str) -> str:
    """Name of the files of one channel of one branch."""
    return f"{condition.id}-{branch}-{channel}"


def settings_of(condition: Condition) -> dict[str, float]:
    """What is stated of a condition, in canonical units."""
    return {s: float(getattr(condition, s)) for s in SETTINGS if getattr(condition, s) is not None}


def _group(design: Design, specimen: bool) -> StatedGroup:
    return StatedGroup.about(
        design,
        conditions=design.ids,
        varied={
            v: VariedSetting(unit=setting_unit(v, specimen=specimen), values=tuple(design.values(v).tolist()))
            for v in design.varied
        },
        columns=1 + len(design.varied),
        aliased={v: design.aliased(v) for v in design.varied if design.aliased(v)},
    )


def _effect(effect: SettingEffect, study: ConditionStudy, specimen: bool) -> StatedEffect:
    (design,) = [d for d in study.designs if d.ids == effect.conditions]
    return StatedEffect.about(
        effect,
        unit="1" if effect.factor else effect.unit,
        kind="factor" if effect.factor else "difference",
        setting_unit=setting_unit(effect.setting, specimen=specimen),
        spare=design.spare,
        confounded_with=tuple(
            StatedConfounder(name=c.other, correlation=c.correlation, strong=c.strong)
            for c in effect.confounders
        ),
    )


def _population(population: Population) -> StatedPopulation:
    prior = np.exp(population.density.draw_prior(np.random.default_rng(0), 4000))
    first = population.records[0]
    facts = first.posterior.model.parameters(first.units)
    logarithms = population.coordinates.signs != 0.0
    level = population.level
    return StatedPopulation.about(
        population,
        conditions=population.design.ids,
        branch=population.records[0].branch.value,
        channels=tuple(population.records[0].channels),
        spare=population.design.spare,
        sampling=PopulationSampling.about(population.sampling),
        coordinates=tuple(
            StatedCoordinate(
                name=label,
                unit="1" if logarithms[i] else facts[i].unit,
                channel="" if logarithms[i] else _channel_of_unit(facts[i]),
                level=interval_document(level[:, i]),
                changes={
                    v: interval_document(population.coefficients[:, k, i])
                    for k, v in enumerate(population.design.varied, 1)
                },
                scatter=interval_document(population.scatter[:, i]),
                scatter_prior=interval_document(prior[:, i]),
            )
            for i, label in enumerate(population.coordinates.labels)
        ),
        parameters={
            r.condition.id: {
                name: PooledParameter(
                    unit=facts[i].unit,
                    channel=_channel_of_unit(facts[i]),
                    difference=facts[i].role is not Role.MIDPOINT,
                    own=interval_document(r.curve_theta[:, i]),
                    pooled=interval_document(pooled[:, i]),
                )
                for i, name in enumerate(r.names)
            }
            for r, pooled in zip(population.records, map(population.parameters, population.phi), strict=True)
        },
    )


def _channel_of_unit(fact: ParameterSpec) -> str:
    return fact.channel if in_unit_of_channel(fact.name, fact.channel, fact.role) else ""


def _predicted_from(population: Population) -> dict[str, Any]:
    return {"from": population.design.ids, "prior_led": population.prior_led}


def _prediction(prediction: Prediction) -> PredictedCondition:
    low, high = prediction.covered()
    reference, branch = prediction.reference, prediction.reference.branch.value
    return PredictedCondition(
        condition=prediction.condition.id,
        settings=settings_of(prediction.condition),
        branch=branch,
        **_predicted_from(prediction.population),
        extrapolates=prediction.population.design.beyond(prediction.condition),
        temperature=TemperaturesCovered(
            unit=reference.units["temperature"], covered_from=low, covered_to=high
        ),
        features=tuple(PredictedFeature.about(f, **f.quantiles()) for f in predicted_features(prediction)),
        channels={
            c: PredictedChannel(
                quantity=q,
                unit=reference.units[c],
                band=f"bands/{stem(prediction.condition, branch, c)}.csv",
            )
            for c, q in reference.quantities.items()
        },
    )


def _held_out(held: LeftOutChannel) -> LeftOutCurve:
    record = held.record
    return LeftOutCurve(
        condition=record.condition.id,
        settings=settings_of(record.condition),
        branch=record.branch.value,
        channel=held.channel,
        quantity=record.quantities[held.channel],
        unit=record.units[held.channel],
        temperature_unit=record.units["temperature"],
        span=float(np.ptp(held.own)),
        **_predicted_from(held.population),
        extrapolates=held.beyond,
        correction_applied=held.population.correction.applied,
        on_log=held.channel == "stiffness",
        ways=dict(held.scores),
        file=f"held_out/{stem(record.condition, record.branch.value, held.channel)}.csv",
    )


def curve_columns(record: RecordDraws, channel: str) -> dict[str, Any]:
    """Columns of the curve that was fitted to a condition itself."""
    t = record.grid()
    own = quantiles(record.curve(channel, t), (0.05, 0.5, 0.95), axis=0)
    columns: dict[str, Any] = {f"temperature_{record.units['temperature']}": t}
    return columns | _quantiles("own", own)


def held_out_columns(held: LeftOutChannel) -> dict[str, Any]:
    """Columns of the series of a condition that was left out."""
    columns: dict[str, Any] = {
        f"temperature_{held.record.units['temperature']}": held.temperature,
        "own_median": held.own,
    }
    for name, band in held.bands.items():
        columns |= _quantiles(name.replace(" ", "_"), band)
    return columns | _quantiles("new_measurement", held.new)


def _quantiles(name: str, values: Floats) -> dict[str, Floats]:
    return {f"{name}_{q}": v for q, v in zip(("q05", "q50", "q95"), values, strict=True)}


def sample_columns(held: LeftOutChannel) -> Mapping[str, Any]:
    """Measured samples of a condition that was left out; none of a channel that was derived."""
    record = held.record.record
    if held.channel not in record.observed:
        return {}
    return {
        "row": record.row,
        f"temperature_{record.units['temperature']}": record.temperature,
        "measured": record.observed[held.channel],
    }


def cautions(study: ConditionStudy) -> list[str]:
    """What speaks against relying on the numbers; what holds for both branches is said once."""
    branches: dict[tuple[str, str], list[str]] = {}
    for p in study.populations:
        for text in _population_cautions(p):
            branches.setdefault((", ".join(p.design.ids), text), []).append(p.records[0].branch.value)
    for prediction in study.predictions:
        beyond = prediction.population.design.beyond(prediction.condition)
        if beyond:
            text = f"an extrapolation ({_beyond_text(beyond)}); the band assumes that straight lines go on"
            branches.setdefault((prediction.condition.id, text), []).append(prediction.reference.branch.value)
    for h in study.held_out:
        if h.scores[HIERARCHICAL].holds_whole is False and h.channel in h.record.channels:
            text = (
                f"when it was left out, its {h.record.quantities[h.channel]} left the simultaneous 90 % band"
            )
            branches.setdefault((h.record.condition.id, text), []).append(h.record.branch.value)
    return [f"{ids}, {' and '.join(names)}: {text}" for (ids, text), names in branches.items()]


def _population_cautions(p: Population) -> Iterator[str]:
    if p.prior_led:
        count = {0: "no condition is", 1: "one condition is"}.get(
            p.design.spare, f"{p.design.spare} conditions are"
        )
        yield (
            f"{count} left to estimate the scatter beside level and effects: its prior decides how wide the bands are"
        )
    if not p.correction.applied:
        yield f"the Gaussian form of the posteriors was not corrected: {p.correction.why_not}"
    for setting in p.design.varied:
        if p.design.aliased(setting):
            yield f"{setting} varied only together with {', '.join(p.design.aliased(setting))}"
    if "stiffness" in p.records[0].quantities:
        yield (
            "stiffness is the slope along the actuation path, on which temperature changes; it is not that of the "
            "spring at constant temperature"
        )
    straight = [r.condition.id for r in p.records if r.path == "straight_path"]
    if straight:
        yield f"of {', '.join(straight)} the path is a straight line, as a bias spring imposes"


def _beyond_text(beyond: tuple[str, ...]) -> str:
    if beyond == ("combination",):
        return "each setting is in its range, but this combination lies outside of those that were measured"
    return f"{', '.join(beyond)} beyond the measured range"
