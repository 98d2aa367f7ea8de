"""Starts of a simulation, as they are written: ``cold``, ``hot``, ``heating:60 degC``."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from sma_bayes.errors import SmaBayesError
from sma_bayes.records.types import Branch
from sma_bayes.studies.ask.workflow import asked_temperature
from sma_bayes.studies.simulate.course import Start

UNIT: Final = "degC"
ROOM_STARTS: Final = (Start("cold"), Start("hot"))
"""Where it is not told from where the alloy came to the temperature of the room."""


def starts_of(asked: str | Sequence[str] | None) -> tuple[Start, ...]:
    """Starts that are asked for; both of `ROOM_STARTS` where none is.

    Raises
    ------
    SmaBayesError
        If one is not understood, or two are alike.
    QuantityError
        If a temperature has no unit or can't be.
    """
    texts = [asked] if isinstance(asked, str) else list(asked or ())
    found = tuple(map(_start, texts)) or ROOM_STARTS
    if len({s.name for s in found}) < len(found):
        raise SmaBayesError(
            f"--start {' --start '.join(texts)}", expected="starts that differ in their first word"
        )
    return found


def _start(text: str) -> Start:
    name, colon, temperature = text.partition(":")
    name = name.strip()
    if not colon and name in [s.name for s in ROOM_STARTS]:
        return Start(name)
    if name not in [b.value for b in Branch] or not temperature.strip():
        raise SmaBayesError(
            f"--start {text!r}",
            expected="cold, hot, heating:TEMPERATURE or cooling:TEMPERATURE, such as 'heating:60 degC'",
        )
    return Start(name, asked_temperature(temperature.strip(), UNIT, UNIT))
