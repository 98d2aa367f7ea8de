"""Models that are compared: the modified sigmoid, and the baselines in their variants.

Every contender is asked about the same samples of one channel, under the same noise with the same prior. Where a
stiffness was observed it is the stiffness, of which alone the baselines speak; otherwise force or displacement, whose
curve the paper calls the model of the stiffness in those modes of operation (line 280), and for which the forms of Eqs.
(9) to (11) are taken over.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from sma_bayes.assess.held_out import CONDITION
from sma_bayes.errors import MeasurementError
from sma_bayes.fitting.discrepancy import DiscrepancyBasis
from sma_bayes.fitting.posterior import Posterior, build_posterior
from sma_bayes.noise import NoiseModel
from sma_bayes.parameters.distributions import Normal
from sma_bayes.parameters.priors_file import PriorEntry, PriorSet
from sma_bayes.parameters.space import ParameterSpace
from sma_bayes.quantities import unit_text
from sma_bayes.records.types import Branch, Condition, Record
from sma_bayes.response import DEFAULT_MODEL, RESPONSE_MODELS
from sma_bayes.response.base import ResponseModel, Variant
from sma_bayes.response.logistic import printed_constants
from sma_bayes.response.polynomial import FREQUENCY, frequencies_of

ALL_CONDITIONS: Final = "all"
"""Condition of joined records."""


@dataclass(frozen=True, slots=True)
class Contender:
    """A model in a variant.

    Attributes
    ----------
    name, family, variant, title : str
        The variant is empty where there is only one.
    model : str
        Name of its response model.
    extra : bool
        Whether it stands beside the models that the paper compares, without a vote.
    """

    name: str
    family: str
    variant: str
    title: str
    model: str
    extra: bool = False


def contenders(model: str = DEFAULT_MODEL) -> tuple[Contender, ...]:
    """All that take part in a comparison, in the order of the catalogue.

    Parameters
    ----------
    model : str
        Name of the response model that was asked for; it takes part, too, if it does not always.

    Raises
    ------
    UnknownNameError
        If no response model has that name.
    """
    asked = RESPONSE_MODELS[model]
    out: list[Contender] = []
    last: list[Contender] = []
    for name, kind in RESPONSE_MODELS.items():
        own = (Variant(name, kind.reference or name),)
        variants = own if kind.contends is None or (kind is asked and not kind.contends) else kind.contends
        found = [Contender(v.name, kind.family or name, v.variant, v.title, name, v.extra) for v in variants]
        (out if kind.contends else last).extend(found)
    return (*out, *last)


PLUG_IN_MODELS: Final = ("logistic_published", "logistic_corrected")
"""Contenders whose levels are the extremes of the data, as in the paper, rather than inferred."""


def observables(record: Record) -> tuple[str, ...]:
    """Channels on which models are compared: the stiffness where it was observed, else all."""
    return ("stiffness",) if "stiffness" in record.channels else record.channels


def of_channel(record: Record, channel: str) -> Record:
    """The record of one channel, with the frequency of the drive as an input where it is known."""
    inputs = dict(record.inputs)
    for frequency in frequencies_of([record.condition.frequency]):
        inputs[FREQUENCY] = np.full(record.n, frequency)
    return replace(record, inputs=inputs, observed={channel: record.observed[channel]})


def joined(records: Sequence[Record], channel: str) -> Record:
    """Records of one branch as one, with the number of the condition as an input.

    Raises
    ------
    MeasurementError
        If they differ in units, so that no curve can serve all.
    """
    parts = [of_channel(r, channel) for r in records]
    first = parts[0]
    for part in parts[1:]:
        needed = ("temperature", channel)
        if any(part.units.get(name) != first.units.get(name) for name in needed):
            raise MeasurementError(
                f"{part.key!r} and {first.key!r} can't be compared together",
                expected=f"the same units of temperature and {channel}",
                remedy="compare them without --pool campaign",
            )
    shared = [name for name in first.inputs if all(name in p.inputs for p in parts) and name != "segment"]
    inputs = {name: np.concatenate([p.inputs[name] for p in parts]) for name in shared}
    sweeps = [np.unique(p.inputs["segment"], return_inverse=True)[1] for p in parts]
    offset = np.cumsum([0, *(s.max() + 1 for s in sweeps[:-1])])
    inputs["segment"] = np.concatenate([s + o for s, o in zip(sweeps, offset, strict=True)]).astype(float)
    inputs[CONDITION] = np.repeat(np.arange(len(parts), dtype=float), [p.n for p in parts])
    return Record(
        Condition(ALL_CONDITIONS),
        first.branch,
        inputs,
        {channel: np.concatenate([p.observed[channel] for p in parts])},
        np.concatenate([p.row for p in parts]),
        first.units,
        specimen=first.specimen,
        temperature_sd=max(p.temperature_sd for p in parts),
        source=", ".join(dict.fromkeys(p.source for p in parts if p.source)),
    )


def unavailable(contender: Contender, record: Record) -> str:
    """Why a contender can't take part; empty where it can."""
    unit = record.units["temperature"]
    if contender.name in PLUG_IN_MODELS and unit != "degC":
        return (
            f"its transformation temperatures are printed in °C, those of the record are in {unit_text(unit)}"
        )
    return RESPONSE_MODELS[contender.model].refusal(record.channels)


def copy_of(contender: Contender, record: Record) -> str:
    """Name of the contender whose numbers are this one's too, since nothing distinguishes them here; else empty."""
    (channel,) = record.channels
    if contender.name == "modified_sigmoid_tied" and channel != "stiffness":
        return "modified_sigmoid"  # only one of the rates takes part
    if contender.name == "logistic_corrected" and record.branch is Branch.COOLING:
        return "logistic_published"  # Eq. (10) is right as printed
    if contender.name in ("polynomial_published", "polynomial_refitted"):
        return "polynomial_corrected"  # no coefficient is printed, and redundant ones change no prediction
    return ""


def curve_of(contender: Contender, record: Record) -> str:
    """Name of the curve; contenders of the same curve differ in their priors at most."""
    (channel,) = record.channels
    logistic = ["logistic_refitted", "bounded_logistic"]
    if channel != "stiffness":
        logistic += ["modified_sigmoid", "modified_sigmoid_tied"]
    if contender.name in logistic:
        return "four-parameter logistic"
    return copy_of(contender, record) or contender.name


def by_curve(found: Iterable[Contender], record: Record) -> tuple[tuple[str, ...], ...]:
    """Names of contenders, those that are the same curve together."""
    names: dict[str, list[str]] = {}
    for c in found:
        names.setdefault(curve_of(c, record), []).append(c.name)
    return tuple(map(tuple, names.values()))


def model_of(contender: Contender, record: Record) -> ResponseModel:
    """The response model of a contender, for a record of one channel."""
    return RESPONSE_MODELS[contender.model].made_for([record])


def constants_of(contender: Contender, record: Record) -> dict[str, float]:
    """Parameters that a contender takes as given: printed, or plugged in from the data of the record."""
    if contender.name not in PLUG_IN_MODELS:
        return {}
    (values,) = record.observed.values()
    levels = {"K_min": float(values.min()), "K_max": float(values.max())}
    return levels | printed_constants(record.branch, corrected=contender.variant == "corrected")


def model_priors(model: ResponseModel, base: PriorSet) -> PriorSet:
    """Priors of a model: those in force where they are of this model, else its own; the noise's are shared.

    Parameters
    ----------
    model : ResponseModel
    base : PriorSet
        In force; without the name of a model they are those of the modified sigmoid.
    """
    own = model.default_priors()
    if own.model == (base.model or DEFAULT_MODEL):
        return base
    entries: dict[str, Mapping[str, tuple[PriorEntry, ...]]] = {
        table: {k: v for k, v in beliefs.items() if k in model.spoken_of()}
        for table, beliefs in own.entries.items()
    }
    return replace(own, entries={**entries, "noise": base.entries["noise"]})


def posterior_of(
    contender: Contender,
    record: Record,
    noise: NoiseModel,
    priors: PriorSet,
    memory: float = 1.0,
    *,
    discrepancy: Sequence[Mapping[str, DiscrepancyBasis]] | None = None,
    longest_memory: Sequence[Mapping[str, float]] | None = None,
) -> Posterior:
    """Posterior of a contender.

    Parameters
    ----------
    contender : Contender
    record : Record
        Of one channel.
    noise : NoiseModel
        Its standard deviation is measured by the span of the channel, for every contender alike.
    priors : PriorSet
        In force, see `model_priors`.
    memory : float
        Samples that count as one, for `EffectiveSamples`.
    discrepancy : sequence of mapping, optional
        Channel to the basis of what the curve misses; none by default.
    longest_memory : sequence of mapping, optional
        Channel to how many samples may count as one at most; any number by default.
    """
    model = model_of(contender, record)
    told = [dict.fromkeys(record.channels, memory)]
    posterior = build_posterior(
        [record],
        noise,
        model_priors(model, priors),
        model=model,
        memory=told,
        longest_memory=longest_memory,
        discrepancy=discrepancy,
    )
    return with_constants(posterior, constants_of(contender, record))


def with_constants(posterior: Posterior, constants: Mapping[str, float]) -> Posterior:
    """The posterior with some parameters held at given values."""
    if not constants:
        return posterior
    parameters = tuple(
        replace(p, prior=Normal(constants[p.name], 1.0), fixed=constants[p.name])
        if p.name in constants
        else p
        for p in posterior.space.parameters
    )
    return posterior.on(
        posterior.records, discrepancy=posterior.discrepancy, space=ParameterSpace(parameters)
    )
