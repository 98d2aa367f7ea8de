"""Stress and strain of a record at constant load."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.errors import QuantityError, SmaBayesError
from sma_bayes.quantities import convert, number_and_unit
from sma_bayes.runs.fit_document import RecordSummary

STEADY: Final = 0.1
"""Standard deviation of a stress over its mean up to which it counts as constant [1]."""


class Size(NamedTuple):
    """Cross-section [m2] and length [m] of a wire whose force and displacement were measured; None where not given."""

    area: float | None
    length: float | None


class Loaded(NamedTuple):
    """Stress [MPa] and what turns the displacement channel into strain [1]."""

    stress: float
    per: float


def loaded(record: RecordSummary, size: Size) -> Loaded | str:
    """Stress and strain of a record, or why it has none."""
    measure = record.quantities.get("displacement")
    if "displacement" not in record.channels or measure is None:
        return "neither strain nor displacement was measured"
    if "force" in record.channels:
        return "the force was not constant"
    if record.temperature.unit not in ("degC", "K"):
        return "its temperatures are in a unit that is not known"
    strained = measure.name == "strain"
    held = record.held.get("force")
    load = held.mean if held is not None else record.settings.get("load")
    unit = (held.unit if held is not None else "") or ("Pa" if strained else "N")
    if load is None:
        return "neither stress nor load was declared"
    if held is not None and held.sd > STEADY * abs(held.mean):
        return (
            f"its load was not constant: {held.mean:.4g} {unit}, with a standard deviation of {held.sd:.2g}"
        )
    if load <= 0.0:
        return f"its load, {load:g} {unit}, is none in tension"
    if strained:
        return Loaded(
            float(convert(np.asarray(load), unit, "MPa")), float(convert(np.asarray(1.0), measure.unit, "1"))
        )
    if size.area is None or size.length is None:
        return "force and displacement of a wire need --area and --length to be stress and strain"
    newton = float(convert(np.asarray(load), unit, "N"))
    metre = float(convert(np.asarray(1.0), measure.unit, "m"))
    return Loaded(1e-6 * newton / size.area, metre / size.length)


def size_of(area: str | None, length: str | None) -> Size:
    """Read ``"0.98 mm^2"`` and ``"50 mm"``.

    Raises
    ------
    QuantityError
        If a unit is missing or wrong.
    SmaBayesError
        If a value is not positive.
    """
    return Size(
        *(
            _positive(text, unit, name)
            for text, unit, name in ((area, "m^2", "area"), (length, "m", "length"))
        )
    )


def modulus_of(text: str | None, name: str) -> float | None:
    """Read ``"70 GPa"`` as MPa; errors as `size_of`."""
    return _positive(text, "MPa", name)


def _positive(text: str | None, unit: str, name: str) -> float | None:
    if text is None:
        return None
    number, given = number_and_unit(text, what=name)
    if not given:
        raise QuantityError(
            f"--{name} {text!r} has no unit", expected=f"a value with its unit, such as '{number:g} {unit}'"
        )
    value = float(convert(number, given, unit, what=f"--{name}"))
    if not value > 0.0:
        raise SmaBayesError(
            f"--{name} {text!r}", expected=f"a positive value with its unit, such as '1 {unit}'"
        )
    return value


def kelvin(temperature: Floats | float, unit: str) -> Floats:
    """Temperatures in kelvin."""
    return np.asarray(convert(temperature, unit, "K"))
