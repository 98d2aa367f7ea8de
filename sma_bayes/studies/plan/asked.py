"""What is asked for: `--for stiffness@60degC`, `parameters` or `tell-apart`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from sma_bayes.errors import MeasurementError, QuantityError, SmaBayesError, near_matches
from sma_bayes.records.declaration import CHANNEL_OF
from sma_bayes.runs.fit_document import RecordSummary
from sma_bayes.studies.ask.workflow import asked_temperature

PARAMETERS: Final = "parameters"
TELL_APART: Final = "tell-apart"
FORMS: Final = (
    "stiffness@60degC (or force@..., displacement@..., of a specimen modulus@..., stress@..., strain@...), "
    f"{PARAMETERS}, or {TELL_APART}"
)
NAMES: Final = ("stiffness", "force", "displacement", *CHANNEL_OF)


@dataclass(frozen=True, slots=True)
class Asked:
    """What is asked for.

    Attributes
    ----------
    text : str
        As it was given.
    name : str
        Of the quantity, `PARAMETERS` or `TELL_APART`.
    temperature : str
        With its unit; empty where none belongs to it.
    """

    text: str
    name: str
    temperature: str = ""

    @property
    def channel(self) -> str:
        """Channel of the quantity."""
        return CHANNEL_OF.get(self.name, self.name)

    def at(self, record: RecordSummary) -> float:
        """The temperature in the unit of a record."""
        unit = record.temperature.unit
        return asked_temperature(self.temperature, unit, unit)


def parse_asked(text: str) -> Asked:
    """Read what is asked for.

    Raises
    ------
    SmaBayesError
        If it has none of the forms, which the message lists.

    Examples
    --------
    >>> parse_asked("stiffness@60degC").temperature, parse_asked("parameters").name
    ('60degC', 'parameters')
    """
    name, at, temperature = (part.strip() for part in text.partition("@"))
    if not at and name in (PARAMETERS, TELL_APART):
        return Asked(text, name)
    if at and name in NAMES and temperature:
        return Asked(text, name, temperature)
    near = (
        near_matches(name, (*NAMES, PARAMETERS, TELL_APART)) if name not in NAMES else "a temperature after @"
    )
    raise SmaBayesError(f"--for {text!r}", expected=FORMS, remedy=f"give one of these forms; {near}")


def able(asked: Asked, records: Sequence[RecordSummary], folder: object) -> list[RecordSummary]:
    """Records that have what is asked for.

    Raises
    ------
    MeasurementError
        If none has the quantity.
    QuantityError
        If none has measured the temperature.
    """
    if asked.name == PARAMETERS:
        return list(records)
    having = [
        r for r in records
        if asked.channel in r.quantities and r.quantities[asked.channel].name == asked.name
    ]  # fmt: skip
    if not having:
        known = dict.fromkeys(q.name for r in records for q in r.quantities.values())
        raise MeasurementError(
            f"no {asked.name} follows from these records",
            file=str(folder),
            expected=f"--for one of {', '.join(f'{n}@...' for n in known)}, {PARAMETERS}",
        )
    found = [r for r in having if r.temperature.lowest <= asked.at(r) <= r.temperature.highest]
    if not found:
        ranges = ", ".join(
            f"{r.temperature.lowest:.4g} to {r.temperature.highest:.4g} {r.temperature.unit} ({r.key})"
            for r in having[:3]
        )
        raise QuantityError(
            f"temperature {asked.temperature!r} was measured by no record that tells the {asked.name}",
            file=str(folder),
            expected=f"a temperature that was measured: {ranges}{', ...' if len(having) > 3 else ''}",
            remedy="ask within that range, over which the curves were fitted",
        )
    return found
