"""How numbers are written for people: as many digits as their uncertainty bears."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from sma_bayes.quantities import MINUS, unit_text

MISSING: Final = "–"
FIXED_EXPONENTS: Final = range(-3, 6)
"""Decimal exponents that are written without a power of ten."""
LEAST_SHARED_FIXED_EXPONENT: Final = -4
"""The same of the least of three numbers of which the others are written so, since they are read together."""
MAX_DIGITS: Final = 9
"""Significant digits of a number at most, however sure it is."""
SEPARATE_ENDS_RATIO: Final = 30.0
"""Ratio of the ends of an interval, both of one sign, from which each is written by itself."""
NORMAL_90_WIDTH: Final = 3.29
"""Width of the 90 % interval of a normal distribution [sd]."""

_NEGATIVE: Final = re.compile(r"(?<![^\s(\[,;±×<>])-(?=\.?\d)")
"""A hyphen in front of a number, with nothing or a blank, a bracket or a sign before it; not one inside a name."""
_PERCENT: Final = re.compile(r"(?<![=\w.−-])(\d+(?:\.\d+)?)%(?![\w-])")
"""A percentage in a sentence; not one in an option of a command or in a name."""
_SUPERSCRIPT: Final = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


@dataclass(frozen=True, slots=True)
class ScaledNumbers:
    """Numbers with a common power of ten.

    Attributes
    ----------
    digits : tuple of str
        Each number over the power of ten.
    exponent : int
        The power; 0 where there is none.
    """

    digits: tuple[str, ...]
    exponent: int

    @property
    def plain(self) -> tuple[str, ...]:
        """Each number by itself, as text."""
        power = f" × 10{power_text(self.exponent)}" if self.exponent else ""
        return tuple(_signed(d) + (power if d != MISSING else "") for d in self.digits)


def write(
    values: Sequence[float | None],
    resolution: float | None = None,
    digits: int = 4,
    *,
    exponent: int | None = None,
) -> ScaledNumbers:
    """Write numbers that belong together with the same power of ten and the same last place.

    Parameters
    ----------
    values : sequence of float or None
        None and what is not finite are written as a dash.
    resolution : float, optional
        Their uncertainty [unit of the values]; two digits of it are shown. Without it the largest number has
        `digits` significant digits.
    digits : int
    exponent : int, optional
        Power of ten to write them with; by default what suits them.

    Examples
    --------
    >>> write([0.72243, 0.00064], resolution=0.00064).plain
    ('0.72243', '0.00064')
    >>> write([4e-4]).plain
    ('4.000 × 10⁻⁴',)
    """
    sizes = [abs(v) for v in values if v is not None and math.isfinite(v)]
    largest = max(sizes, default=0.0)
    sure = resolution is not None and math.isfinite(resolution) and resolution > 0.0
    top = _place(max(largest, resolution if sure and resolution is not None else 0.0))
    last = _place(resolution) - 1 if sure and resolution is not None else top - digits + 1
    last = max(last, top - MAX_DIGITS + 1)
    if exponent is None:
        exponent = 0 if top in FIXED_EXPONENTS else top
    decimals = max(0, exponent - last)
    return ScaledNumbers(tuple(_digits(v, exponent, decimals, last) for v in values), exponent)


def write_interval(
    median: float | None, low: float | None, high: float | None, *, exponent: int | None = None
) -> ScaledNumbers:
    """Median and ends of a 90 % interval, with the digits that its width bears.

    An interval no wider than the last of `MAX_DIGITS` is one of rounding: what it holds does not depend on anything
    that is uncertain, and the three are one number.
    """
    if median is None or low is None or high is None:
        return write((median, low, high), exponent=exponent)
    width = high - low
    if width < 10.0**-MAX_DIGITS * abs(median):
        return write((median,) * 3, exponent=exponent)
    return write((median, low, high), resolution=width / NORMAL_90_WIDTH, exponent=exponent)


def interval_text(
    median: float | None, low: float | None, high: float | None, *, power: int | None = None
) -> str:
    """Median and 90 % interval on one line: ``0.722 [0.721, 0.723]``, a common power of ten behind.

    What has no width is one number. Where the ends differ `SEPARATE_ENDS_RATIO` times and the width drowns the median,
    digits that the width bears would say nothing of it, and each number has two of its own. With a `power` of ten,
    which is told elsewhere, none is written.

    Examples
    --------
    >>> interval_text(0.0004, -0.0001, 0.0009)
    '(4.0 [−1.0, 9.0]) × 10⁻⁴'
    >>> interval_text(0.25, 0.25, 0.25), interval_text(1.93, 0.0312, 102.0)
    ('0.2500', '1.9 [0.031, 100]')
    >>> interval_text(0.0028, 0.00034, 0.014)
    '0.0028 [0.00034, 0.014]'
    >>> interval_text(-0.18, -0.34, -0.0067)
    '−0.18 [−0.34, −0.01]'
    """
    if median is not None and low is not None and high is not None and low * high > 0.0:
        sizes = sorted((abs(low), abs(high)))
        drowned = sizes[1] - sizes[0] > NORMAL_90_WIDTH * abs(median)
        if drowned and math.inf > sizes[1] > SEPARATE_ENDS_RATIO * sizes[0]:
            if (
                power is None
                and _place(sizes[1]) in FIXED_EXPONENTS
                and _place(sizes[0]) >= LEAST_SHARED_FIXED_EXPONENT
            ):
                power = 0
            middle, least, most = (
                write([v], digits=2, exponent=power).plain[0] if power is None
                else _signed(write([v], digits=2, exponent=power).digits[0])
                for v in (median, low, high)
            )  # fmt: skip
            return f"{middle} [{least}, {most}]"
    written = write_interval(median, low, high, exponent=power)
    middle, least, most = (_signed(d) for d in written.digits)
    if middle == least == most:
        return written.plain[0] if power is None else middle
    text = f"{middle} [{least}, {most}]"
    if not written.exponent or power is not None:
        return text
    return f"({text}) × 10{power_text(written.exponent)}"


def power_text(exponent: int) -> str:
    """Exponent in superscript digits.

    Examples
    --------
    >>> power_text(-4)
    '⁻⁴'
    """
    return str(exponent).translate(_SUPERSCRIPT)


def compact(value: float) -> str:
    """Number of three digits without zeros behind; all digits before the point below 100,000.

    Examples
    --------
    >>> compact(1.0), compact(0.72197), compact(2.5e-7), compact(1096.2)
    ('1', '0.722', '2.5 × 10⁻⁷', '1096')
    """
    whole = 1e3 <= abs(value) < 1e5
    digits, _, power = (f"{value:.0f}" if whole else f"{value:.3g}").partition("e")
    return _signed(digits) + (f" × 10{power_text(int(power))}" if power else "")


def sentence(words: str) -> str:
    """Words as a sentence of their own.

    Examples
    --------
    >>> sentence("the data do not tell")
    'The data do not tell.'
    """
    return f"{words[:1].upper()}{words[1:]}."


def with_minus(text: str) -> str:
    """Text for people, in which negative numbers have a minus sign in place of a hyphen.

    Examples
    --------
    >>> with_minus("2A-150g: -30.1 to 50.7 °C (-0.3 to -.1), 2026-11-26, 1e-6")
    '2A-150g: −30.1 to 50.7 °C (−0.3 to −.1), 2026-11-26, 1e-6'
    """
    return _NEGATIVE.sub(MINUS, text)


def with_percent(text: str, space: str = " ") -> str:
    """Text for people, in which a percentage has a space before its sign; options and names stay as they are.

    Examples
    --------
    >>> with_percent("50%-heating, in 95% of the draws; --limit stroke=-20%")
    '50%-heating, in 95 % of the draws; --limit stroke=-20%'
    """
    return _PERCENT.sub(rf"\1{space}%", text)


def count_text(value: int) -> str:
    """Count with its thousands set apart."""
    return f"{value:,}".replace(",", "\u202f")


def unit_label(unit: str) -> str:
    """Unit as shown to people, a product with its dot; empty for a pure number.

    Examples
    --------
    >>> unit_label("N/cm degC"), unit_label("1"), unit_label("cm arbitrary")
    ('N/cm · °C', '', 'cm · arbitrary unit')
    """
    return " · ".join(unit_text(part) for part in unit.split(" ") if part) if unit != "1" else ""


def squared(unit: str) -> str:
    """Square of a unit.

    Examples
    --------
    >>> squared("N/cm"), squared("1"), squared("N")
    ('(N/cm)²', '1', 'N²')
    """
    if unit == "1":
        return unit
    return f"{unit}²" if unit.isalpha() else f"({unit})²"


def _place(size: float) -> int:
    return math.floor(math.log10(size)) if size > 0.0 else 0


def _digits(value: float | None, exponent: int, decimals: int, last: int) -> str:
    if value is None or not math.isfinite(value):
        return MISSING
    rounded = round(value, -last)
    text = f"{rounded / 10.0**exponent:.{decimals}f}"
    return text.removeprefix("-") if not text.strip("-0.") else text


def _signed(digits: str) -> str:
    return digits.replace("-", MINUS)
