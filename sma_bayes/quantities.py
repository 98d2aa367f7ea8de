"""What is measured: names, symbols, canonical units, and the one place where units are converted.

Inside the package every array is in its canonical unit. A specimen (stress, strain, modulus) uses the same
three channels as a spring (force, displacement, stiffness): the model is the same, only name and unit differ.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import lru_cache
from tokenize import TokenError
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.errors import QuantityError, near_matches
from sma_bayes.limits import MAGNITUDE, UNIT_CHARACTERS, UNIT_EXPONENT, UNIT_NESTING

if TYPE_CHECKING:
    from pint import UnitRegistry

ARBITRARY: Final = "arbitrary"
"""Unit of a quantity whose unit nobody knows any more; it is carried through and shown, never converted."""

STANDARD_GRAVITY: Final = 9.80665
"""Weight of a mass of 1 kg [N]; loads given in gram are masses hung on the spring (ISO 80000-3)."""


@dataclass(frozen=True, slots=True)
class Quantity:
    """A measured quantity.

    Attributes
    ----------
    name, symbol, unit : str
        Name in files and messages, symbol on axes, canonical unit.
    meaning : str
        One line for humans.
    """

    name: str
    symbol: str
    unit: str
    meaning: str


TEMPERATURE: Final = Quantity("temperature", "T", "degC", "temperature of the alloy")

QUANTITIES: Final[dict[str, Quantity]] = {
    q.name: q
    for q in (
        TEMPERATURE,
        Quantity("time", "t", "s", "time since the start of the record"),
        Quantity("force", "F", "N", "force of the spring"),
        Quantity("displacement", "X", "m", "displacement of the moving end"),
        Quantity("stiffness", "K", "N/m", "slope dF/dX along the actuation path"),
        Quantity("stress", "σ", "Pa", "stress in the specimen"),
        Quantity("strain", "ε", "1", "strain of the specimen"),
        Quantity("modulus", "E", "Pa", "slope of stress over strain along the actuation path"),
        Quantity("current", "I", "A", "heating current"),
        Quantity("voltage", "U", "V", "voltage over the alloy while it is heated"),
        Quantity("resistance", "R", "ohm", "resistance of the alloy"),
        Quantity("ambient_temperature", "Ta", "degC", "temperature of the surroundings"),
        Quantity("drive", "u", "1", "drive signal; positive while the alloy is heated"),
        Quantity("cycle", "N", "1", "number of the thermal cycle, from 1"),
        Quantity("branch", "", "1", "heating or cooling"),
    )
}

CHANNELS: Final = ("force", "displacement", "stiffness")
"""Response channels, in the order in which they are stored and reported."""

SPECIMEN_QUANTITY: Final = {"force": "stress", "displacement": "strain", "stiffness": "modulus"}
"""What a channel is called where a specimen was tested instead of a spring."""


def quantity_of(channel: str, *, specimen: bool) -> str:
    """Name of the quantity behind a channel.

    Examples
    --------
    >>> quantity_of("displacement", specimen=True), quantity_of("displacement", specimen=False)
    ('strain', 'displacement')
    """
    return SPECIMEN_QUANTITY.get(channel, channel) if specimen else channel


_NOT_A_UNIT: Final = (
    AttributeError, ValueError, TypeError, AssertionError, KeyError, ArithmeticError, SyntaxError, TokenError
)  # fmt: skip
"""What pint lets through, besides its own error, where a text is no unit: ``N/0``, ``N/(m``, ``kg**0``."""


_MEANT: Final = {
    ("c", "degC"): "degC", ("celsius", "degC"): "degC", ("deg c", "degC"): "degC", ("f", "degC"): "degF",
    ("℃", "degC"): "degC", ("ºc", "degC"): "degC", ("newton", "N"): "N", ("kpa", "Pa"): "kPa", ("mpa", "Pa"): "MPa",
    ("gpa", "Pa"): "GPa", ("g", "N"): "gf", ("gram", "N"): "gf", ("kg", "N"): "kgf",
}  # fmt: skip
"""What is meant by a unit that is another quantity's (C is the coulomb, F the farad, g a mass and no weight), or
spelt as it often is."""


@lru_cache(maxsize=1)
def _registry() -> UnitRegistry[Any]:
    from pint import UnitRegistry

    return UnitRegistry(cache_folder=None)


def convert(values: Floats | float, unit: str, to: str, *, what: str = "value") -> Floats:
    """Convert values from one unit to another.

    Parameters
    ----------
    values : float or ndarray
        Values in `unit`.
    unit, to : str
        Units that pint knows, or ``"arbitrary"`` for both.
    what : str
        Name for messages.

    Returns
    -------
    ndarray
        Values in `to`.

    Raises
    ------
    QuantityError
        If a unit is unknown or of another kind.

    Examples
    --------
    >>> float(convert(25.0, "mm", "m"))
    0.025
    >>> float(convert(273.15, "kelvin", "degC"))
    0.0
    """
    array = np.asarray(values, dtype=float)
    if unit == to:
        return array.copy()
    _require_unit_text(unit, what)
    _require_unit_text(to, what)
    if ARBITRARY in unit or ARBITRARY in to:  # also its reciprocal and the like
        raise QuantityError(
            f"{what} is in {unit!r}, which can't be turned into {to!r}",
            expected="a unit, or 'arbitrary' on both sides",
            remedy="declare the same kind of unit everywhere this quantity is given",
        )
    import pint

    ureg = _registry()
    meant = _MEANT.get((unit.lower(), to))
    source = _known_unit(unit, what, meant, (to,))
    target = _known_unit(to, what, None, (unit,))
    try:
        with np.errstate(over="ignore"):
            return np.asarray(ureg.Quantity(array, source).to(target).magnitude, dtype=float)
    except (
        pint.errors.DimensionalityError,
        AssertionError,
        KeyError,
    ):  # the last two: logarithmic units, kg**0
        raise QuantityError(
            f"unit {unit!r} of {what} is of the wrong kind",
            expected=f"a unit that can be turned into {to!r}",
            remedy=f"did you mean {meant!r}?"
            if meant
            else "correct the unit or map the column to another quantity",
        ) from None


def can_convert(unit: str, to: str) -> bool:
    """Whether values in one unit can be converted to another.

    Examples
    --------
    >>> can_convert("N/mm", "N/m"), can_convert("N/mm", "N")
    (True, False)
    """
    try:
        convert(1.0, unit, to)
    except QuantityError:
        return False
    return True


def _known_unit(unit: str, what: str, meant: str | None, like: tuple[str, ...]) -> Any:
    """A unit of the registry; `meant` and `like` are for the message."""
    import pint

    try:
        return _registry().Unit(unit)
    except (pint.errors.UndefinedUnitError, *_NOT_A_UNIT):
        meant = meant or _with_exponent(unit, like)
        raise QuantityError(
            f"unit {unit!r} of {what} is not known",
            expected=f"a unit such as {like[0]!r}, or 'arbitrary'",
            remedy=f"did you mean {meant!r}?"
            if meant
            else near_matches(unit, ("degC", "kelvin", "degF", "N", "mm", "percent", *like)),
        ) from None


def _with_exponent(unit: str, like: tuple[str, ...]) -> str | None:
    """``mm^2`` for ``mm2``, where that can be turned into another unit; None where it can't."""
    raised = re.sub(r"(?<=[A-Za-z])(?=\d)", "^", unit)
    return raised if raised != unit and any(can_convert(raised, to) for to in like) else None


_SUPERSCRIPTS = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-")
_RAISED = re.compile("[⁰¹²³⁴⁵⁶⁷⁸⁹⁻]+")
_POWER = re.compile(r"\s*(?:\*\*|\^)\s*")
_EXPONENT = re.compile(r"[-+]?\d{1,2}(?:\.\d{1,6})?(?![\w.])")  # up to UNIT_EXPONENT
_FRACTION = re.compile(r"\(\s*[-+]?\d(?:\.\d{1,6})?\s*(?:/\s*\d\s*)?\)")
_UNREAD = re.compile(r"[^\w.*/^()+\-\s°%]")  # what a reader of expressions passes over: 2?**2 is 2**2 to it
_POWER_WORDS = re.compile(r"\b(?:squared?|cubed?|cubic|sq|cu)\b")


def _require_unit_text(unit: str, what: str) -> None:
    """Refuse a text whose value would take for ever to work out, such as ``9**9**9**9``: pint computes with it.

    Raises
    ------
    QuantityError
    """
    shown = unit if len(unit) <= UNIT_CHARACTERS.value else f"{unit[:40]}..."
    raised = _RAISED.sub(lambda m: "**" + m[0].translate(_SUPERSCRIPTS), unit)
    depth = deepest = 0
    for character in unit:
        depth += (character == "(") - (character == ")")
        deepest = max(deepest, depth)
    if len(unit) > UNIT_CHARACTERS.value:
        found = f"has {len(unit)} characters"
    elif deepest > UNIT_NESTING.value:
        found = f"has {deepest} brackets inside each other"
    elif not all(map(_powers_are_small, (raised, _UNREAD.sub("", raised)))):
        found = "has exponents that no unit has"
    else:
        return
    raise QuantityError(
        f"unit {shown!r} of {what} {found}",
        expected=f"at most {UNIT_CHARACTERS.value} characters and {UNIT_NESTING.value} brackets inside each other, and "
        f"exponents up to {UNIT_EXPONENT.value} of a name or a bracket, one for each",
        remedy="write the unit as a product of names, such as 'N/mm**2'",
    )


def _powers_are_small(unit: str) -> bool:
    """Whether each exponent is a small number and belongs to a name, or to a bracket, of which two may have one."""
    powers = list(_POWER.finditer(unit))
    words = len(_POWER_WORDS.findall(unit))
    if words > 2 or (words and powers):
        return False
    brackets = 0
    for power in powers:
        before = unit[: power.start()]
        exponent = _EXPONENT.match(unit, power.end()) or _FRACTION.match(unit, power.end())
        if exponent is None or _POWER.match(unit, exponent.end()):
            return False
        if before.endswith(")"):
            brackets += 1
        elif re.search(r"(?:^|[^\w.])[\d.]+$", before) or not before:  # a number, or nothing at all
            return False
    return brackets <= 2


MINUS: Final = "−"
"""Minus sign, with which numbers are shown."""
_NUMBER = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(.*?)\s*", re.DOTALL)


def number_and_unit(text: str, *, what: str = "value") -> tuple[float, str]:
    """Take a number with its unit apart; the unit is empty where none is given. A minus sign is as good as a hyphen.

    Raises
    ------
    QuantityError
        If it does not begin with a finite number.

    Examples
    --------
    >>> number_and_unit("130 N/m"), number_and_unit("1.3N/cm"), number_and_unit("-2e-3"), number_and_unit("−5 degC")
    ((130.0, 'N/m'), (1.3, 'N/cm'), (-0.002, ''), (-5.0, 'degC'))
    """
    found = _NUMBER.fullmatch(text.replace(MINUS, "-")[: 2 * int(UNIT_CHARACTERS.value)])
    if found is None or not abs(float(found[1])) <= MAGNITUDE.value:
        raise QuantityError(
            f"{what} {text[:60]!r}",
            expected=f"a number with its unit, such as '130 N/m', up to {MAGNITUDE.value:g}",
        )
    return float(found[1]), found[2]


def unit_text(unit: str) -> str:
    """Unit as shown to people: ``degC`` becomes ``°C``, ``percent`` ``%``, ``A^2`` ``A²``, ``arbitrary`` stays a word.

    Examples
    --------
    >>> unit_text("1/degC"), unit_text("percent"), unit_text("K/(s A^2)"), unit_text("1"), unit_text("arbitrary")
    ('1/°C', '%', 'K/(s A²)', '', 'arbitrary unit')
    """
    if unit == "1":
        return ""
    return (
        unit.replace("degC", "°C")
        .replace("degF", "°F")
        .replace("percent", "%")
        .replace("^2", "²")
        .replace(ARBITRARY, "arbitrary unit")
    )


def per(unit: str) -> str:
    """Reciprocal of a unit.

    Examples
    --------
    >>> per("degC"), per("1")
    ('1/degC', '1')
    """
    return "1" if unit == "1" else f"1/{unit}"


def quotient(unit: str, below: str) -> str:
    """Unit of a quantity over another, such as that of a slope against temperature.

    Examples
    --------
    >>> quotient("N", "degC"), quotient("1", "degC"), quotient("m", "arbitrary")
    ('N/degC', '1/degC', 'arbitrary')
    """
    return ARBITRARY if ARBITRARY in (unit, below) else f"{unit}/{below}"
