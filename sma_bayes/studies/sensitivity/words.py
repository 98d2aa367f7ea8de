"""What a study of sensitivity found, in sentences."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

from sma_bayes.errors import first_of, many
from sma_bayes.quantities import unit_text
from sma_bayes.studies.sensitivity.schema import (
    NONE,
    QuantitySensitivity,
    RecordSensitivity,
)

NUMBERS_NAMED: Final = 3
"""Numbers that a sentence names."""
LEAST_CHANGE_SDS: Final = 1.0
"""Change without a sweep that is told as a change [posterior sd]."""
LEAST_WIDTH_RATIO: Final = 1.5
"""How much wider the bootstrap of sweeps has to be than the posterior for that to be told."""


def reported(record: RecordSensitivity) -> tuple[QuantitySensitivity, ...]:
    """Numbers of a record without those of the noise."""
    return tuple(q for q in record.quantities if q.kind != "noise")


def called(record: RecordSensitivity, channel: str) -> str:
    """Name of a channel as the record has it: the strain of a wire, where ``displacement`` is stored."""
    names = (
        q.name.partition(" at ")[0] for q in record.quantities if q.channel == channel and q.kind == "curve"
    )
    return next(names, channel)


def worst_sweep(q: QuantitySensitivity) -> tuple[int, float] | None:
    """The sweep without which a number changes most, and its change [posterior sd]; None where none is told."""
    told = [(s.sweep, s.change) for s in q.sweeps if s.change is not None]
    return max(told, key=lambda s: abs(s[1])) if told else None


def conclusion(records: Sequence[RecordSensitivity]) -> str:
    """What follows of all records together."""
    told = [(r, q) for r in records for q in reported(r)]
    return " ".join(f"{sentence}." for sentence in (
        _of_priors(told), *_of_sweeps(told), *_of_readings(told), *_of_bootstrap(told),
    ))  # fmt: skip


Told = Sequence[tuple[RecordSensitivity, QuantitySensitivity]]


def _of_priors(told: Told) -> str:
    flagged = [(r, q) for r, q in told if q.diagnosis != NONE]
    if not flagged:
        return f"The prior decides none of {many(len(told), 'number')}{_most_moved(told)}"
    flagged.sort(key=lambda x: -(x[1].prior or 0.0))
    named = [
        f"{q.name} of {r.key} ({q.diagnosis}, prior of {q.leading_prior.parameter if q.leading_prior else '-'}"
        f"{_without(q)})"
        for r, q in flagged
    ]
    return f"The prior moves {len(flagged)} of {many(len(told), 'number')}: {first_of(named, NUMBERS_NAMED)}"


def _without(q: QuantitySensitivity) -> str:
    if q.without_prior is None:
        return ""
    return f"; without priors {q.without_prior:+.2g} posterior standard deviations"


def _most_moved(told: Told) -> str:
    """How far the prior moves the number that it moves most."""
    found = [(q.without_prior, r, q) for r, q in told if q.without_prior is not None]
    if not found:
        return ""
    change, r, q = max(found, key=lambda x: abs(x[0]))
    return (
        f": without any prior, to first order, none moves by more than {abs(change):.2g} of its posterior standard "
        f"deviation ({q.name} of {r.key})"
    )


def _of_sweeps(told: Told) -> Iterator[str]:
    found = [(abs(w[1]), w, r, q) for r, q in told for w in [worst_sweep(q)] if w is not None]
    if not found:
        return
    size, (sweep, change), r, q = max(found, key=lambda x: x[0])
    if size < LEAST_CHANGE_SDS:
        yield f"No single sweep moves a number by more than {size:.2g} of its posterior standard deviation"
        return
    yield (
        f"Without sweep {sweep} {q.name} of {r.key} moves by {change:+.2g} posterior standard deviations; "
        f"{sum(x[0] >= LEAST_CHANGE_SDS for x in found)} of {many(len(found), 'number')} "
        "move by one or more without some sweep"
    )


def _of_readings(told: Told) -> Iterator[str]:
    found = [(abs(q.reading.change or 0.0), q.reading, r, q) for r, q in told if q.reading is not None]
    if not found:
        return
    _, reading, r, q = max(found, key=lambda x: x[0])
    yield (
        f"The reading that decides most is row {reading.row} of {r.key} ({called(r, reading.channel)} at "
        f"{reading.temperature:.4g} {unit_text(r.temperature_unit)}): without it {q.name} moves by "
        f"{reading.change or 0.0:+.2g} posterior standard deviations"
    )


def _of_bootstrap(told: Told) -> Iterator[str]:
    found = [
        (q.bootstrap.width, r, q)
        for r, q in told
        if q.bootstrap is not None and q.bootstrap.width is not None
    ]
    if not found:
        return
    width, r, q = max(found, key=lambda x: x[0])
    if width >= LEAST_WIDTH_RATIO:
        yield (
            f"Sweeps differ by more than the noise says: weighted at random, they make the interval of {q.name} of "
            f"{r.key} {width:.2g} times as wide as the posterior's"
        )
    else:
        yield "Sweeps weighted at random give no interval much wider than the posterior's"
