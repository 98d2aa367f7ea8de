"""What a plan says in words."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from sma_bayes.errors import first_of, many
from sma_bayes.quantities import unit_text
from sma_bayes.report.notation import write
from sma_bayes.studies.plan.schema import (
    DesignStep,
    ExpectedQuantity,
    KnownQuantity,
    PlanFindings,
    PlannedCandidate,
    PlannedDesign,
    RivalPair,
)
from sma_bayes.studies.plan.shown import load_unit

HALF_WIDTH_90: Final = 1.6449
"""Half of a 90 % interval [sd]."""
LEAST_SHRINKAGE: Final = 0.02
"""Least shrinkage of a variance that is worth the rig time [1]."""
PARTS_TOLD: Final = 3
"""Parts of a design that are told in a sentence."""


def quantity_name(known: KnownQuantity | ExpectedQuantity, found: PlanFindings) -> str:
    """Name of a quantity, with its record where there are several."""
    several = len({k.key for k in found.quantities}) > 1
    return f"{known.name}, {known.key}" if several else known.name


def asked_words(found: PlanFindings) -> str:
    """What a plan is for, in words; `asked` is what was typed."""
    if found.kind == "quantity" and found.quantities:
        return found.quantities[0].name
    return {"parameters": "the parameters", "tell-apart": "telling explanations apart"}.get(
        found.kind, found.asked
    )


def pair_name(pair: RivalPair) -> str:
    """Two explanations."""
    return f"{pair.first or 'no effect'} or {pair.second or 'no effect'}"


def rate_text(rate: float, unit: str) -> str:
    """A rate per minute.

    Examples
    --------
    >>> rate_text(0.05, "degC")
    '3 K/min'
    """
    return f"{60.0 * rate:.3g} {rate_unit(unit)}"


def rate_unit(unit: str) -> str:
    """Unit of a rate per minute, of temperatures in a unit."""
    return f"{'K' if unit == 'degC' else unit_text(unit)}/min"


def hours_text(hours: float) -> str:
    """A time on the rig.

    Examples
    --------
    >>> hours_text(0.05), hours_text(2.5)
    ('3 min', '2.5 h')
    """
    return f"{60.0 * hours:.2g} min" if hours < 1.0 else f"{hours:.3g} h"


def range_text(step: PlannedCandidate | DesignStep, unit: str) -> str:
    """From where to where the temperature goes."""
    return f"{step.lowest:g} to {step.peak:g} {unit_text(unit)}"


def step_text(step: PlannedCandidate | DesignStep, found: PlanFindings) -> str:
    """What to measure, in words."""
    unit = found.temperature_unit
    return (
        f"condition {step.condition} from {range_text(step, unit)}{_load(step, found)}, {many(step.cycles, 'cycle')} "
        f"at {rate_text(step.rate, unit)} with {step.samples} samples a sweep"
    )


def _load(step: PlannedCandidate | DesignStep, found: PlanFindings) -> str:
    load = other_load(step, found) if isinstance(step, PlannedCandidate) else ""
    return f" under a load of {load}" if load else ""


def other_load(c: PlannedCandidate, found: PlanFindings) -> str:
    """The load, where it is another than that of the condition; else nothing."""
    return f"{c.load:.4g} {unit_text(load_unit(found))}" if c.other_load and c.load is not None else ""


def known_of(expected: ExpectedQuantity, found: PlanFindings) -> KnownQuantity:
    """How a quantity is known now."""
    return next(k for k in found.quantities if (k.key, k.name) == (expected.key, expected.name))


def half_width(sd: float, known: KnownQuantity, beside: float = 0.0) -> str:
    """Half of a 90 % interval, without its unit, with as many decimals as that of the standard deviation `beside`."""
    half, other = (HALF_WIDTH_90 * v * known.shown_factor for v in (sd, beside))
    return f"±{write([half, other], digits=3).plain[0]}"


def narrowed(expected: Sequence[ExpectedQuantity], found: PlanFindings) -> str:
    """What is expected of the quantities, in words."""
    if not expected:
        return "expected to tell nothing of it"
    if found.kind == "parameters":
        least, most = min(e.shrinkage for e in expected), max(e.shrinkage for e in expected)
        return (
            f"expected to narrow {many(len(expected), 'parameter')} by {_share(least)} to {_share(most)} of their "
            "standard deviations"
        )
    told = []
    for e in sorted(expected, key=lambda e: -e.shrinkage):
        k = known_of(e, found)
        unit = f" {unit_text(k.shown_unit)}".rstrip()
        told.append(f"{quantity_name(e, found)} from {half_width(k.sd, k)} to {half_width(e.sd, k)}{unit}")
    return f"expected to narrow {first_of(told, PARTS_TOLD, '; ')} (half of the 90 % interval)"


def _share(shrinkage: float) -> str:
    return f"{100.0 * (1.0 - max(1.0 - shrinkage, 0.0) ** 0.5):.0f} %"


def has_even(design: PlannedDesign) -> bool:
    """Whether the hours suffice for a whole loop of each condition, with which a design can be compared."""
    return design.even_cycles is None or design.even_cycles >= 1.0


def advice(found: PlanFindings) -> str:
    """What to measure, in a sentence."""
    if found.kind == "tell-apart":
        return _advice_apart(found)
    fitting = [c for c in found.candidates if c.fits]
    if not fitting:
        shortest = min(found.candidates, key=lambda c: c.hours)
        there = hours_text(found.available or 0.0)
        return f"No candidate fits into {there}: the shortest takes {hours_text(shortest.hours)}."
    design = found.design
    if design is not None:
        parts = "; then ".join(step_text(s, found) for s in design.steps[:PARTS_TOLD])
        more = f"; and {len(design.steps) - PARTS_TOLD} more" if len(design.steps) > PARTS_TOLD else ""
        told = f"Measure {parts}{more}: {narrowed(design.expected, found)} in {hours_text(design.hours)}"
        if not has_even(design):
            return f"{told}; there is no time for a whole loop of each condition that is asked about."
        even, planned = f"{design.even.nats:.2g}", f"{design.nats:.2g}"
        brings = "as much" if even == planned else f"{even} instead of {planned} nats"
        return f"{told}; whole loops, divided evenly, would bring {brings}."
    best = fitting[0]
    marked = f" ({', '.join(best.beyond)})" if best.beyond else ""
    if max((e.shrinkage for e in best.expected), default=0.0) < LEAST_SHRINKAGE:
        return (
            f"No candidate narrows what is asked by more than {LEAST_SHRINKAGE:.0%} of its variance per experiment; "
            f"the best, {step_text(best, found)}{marked}, is {narrowed(best.expected, found)} in "
            f"{hours_text(best.hours)}."
        )
    return f"Measure {step_text(best, found)}{marked}: {narrowed(best.expected, found)} in {hours_text(best.hours)}."


def _advice_apart(found: PlanFindings) -> str:
    fitting = [c for c in found.candidates if c.fits and c.probability is not None]
    if not fitting:
        shortest = min((c.hours for c in found.candidates), default=0.0)
        there = hours_text(found.available or 0.0)
        return f"No candidate fits into {there}: the shortest takes {hours_text(shortest)}."
    best = fitting[0]
    open_pairs = [(p, c) for p, c in zip(found.rivals, best.pairs, strict=True) if not p.told_apart]
    if not open_pairs:
        return (
            f"{pair_name(found.rivals[0])}: the measurements tell them apart already, by a ln Bayes factor of "
            f"{found.rivals[0].ln_bayes_factor:.1f}."
        )
    told = "; ".join(f"{pair_name(p)} with probability {c.probability:.2f}" for p, c in open_pairs)
    marked = f" ({', '.join(best.beyond)})" if best.beyond else ""
    return f"Measure {step_text(best, found)}{marked}: expected to tell apart {told} in {hours_text(best.hours)}."
