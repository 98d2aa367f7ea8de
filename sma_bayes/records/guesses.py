"""What names and numbers of a file let one guess: which quantity a column holds, in which unit, at which setting."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from typing import Final

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.quantities import ARBITRARY, CHANNELS, QUANTITIES, can_convert
from sma_bayes.records.declaration import CHANNEL_OF

_NO_READING = r"derivative|\brate\b|set ?point|target|reference"

_WORDS: Final[tuple[tuple[str, str], ...]] = (
    ("ambient_temperature", r"(?=.*\b(ambient\w*|room|air|surround\w*)\b).*(\btemp|\bt\b)|\bt ?(a|amb|air|room)\b"),
    ("", _NO_READING),
    ("temperature", r"\btemp|\bt\b|thermo|\btc ?\d*\b|\bpt ?100+\b"),
    ("time", r"\btime|\bt\b|\bzeit\b|elapsed|timestamp|\bclock\b"),
    ("stiffness", r"stiffness|spring (rate|constant)|\bk\b"),
    ("modulus", r"modulus|\be\b"),
    ("stress", r"stress|spannung|\bsigma\b|σ"),
    ("strain", r"strain|dehnung|elongation|\beps(ilon)?\b|ε"),
    ("force", r"force|\bload|kraft|\bf\b|tension"),
    ("displacement", r"displacement|stroke|\bdisp|extension|position|crosshead|\bpos\b|deflection|laser|lvdt|\bweg\b"
                     r"|travel|length|\bx\b"),
    ("current", r"current|strom|\bamp(s|ere)?\b|\bi\b"),
    ("drive", r"control|drive|\bduty|\bpwm\b|heater|power"),
    ("cycle", r"^cycle( (no|nr|number|count|index))?$|^cycles?$"),
    ("branch", r"^branch$|^direction$"),
)  # fmt: skip
"""Words by which a header is known, the first that fits counts; those without a quantity are no reading."""

_PREFERRED: Final = {
    "temperature": ("sma", "wire", "spring", "sample", "specimen", "alloy"),
    "displacement": ("displacement", "stroke", "disp", "extension", "laser", "lvdt", "position"),
}
"""Of two columns that may be the same quantity the one with an earlier of these words is taken."""

_SPELT: Final = {
    "c": "degC", "°c": "degC", "degc": "degC", "deg c": "degC", "celsius": "degC", "k": "kelvin", "f": "degF",
    "°f": "degF", "g": "gf", "kg": "kgf", "in": "inch", "h": "hour", "pct": "percent", "%": "percent", "sec": "s",
    "n": "N",
}  # fmt: skip
"""Units as headers write them, where pint writes or reads them otherwise."""

_SETTINGS: Final = {
    "A": ("current_A", 1.0), "mA": ("current_A", 1e-3), "g": ("load_g", 1.0), "kg": ("load_g", 1e3),
    "N": ("load_N", 1.0), "MPa": ("stress_MPa", 1.0), "mHz": ("frequency_mHz", 1.0), "Hz": ("frequency_Hz", 1.0),
    "pct": ("duty_cycle_pct", 1.0), "%": ("duty_cycle_pct", 1.0),
}  # fmt: skip
_UNIT = "|".join(sorted(_SETTINGS, key=len, reverse=True))
_SETTING = re.compile(rf"(?<![A-Za-z\d.])(\d+(?:\.\d+)?)[ _]?({_UNIT})(?![A-Za-z])")
_DUTY = re.compile(r"duty[ _]?(?:cycle)?[ _]?(\d+(?:\.\d+)?)", re.IGNORECASE)

RAW_UNITS: Final = frozenset({"V", "mV", "counts", "count", "bit", "bits", "ADC", "LSB"})
"""Units of readings that only a calibration turns into a quantity."""

MAX_STRAIN_RATIO: Final = 0.3
"""A strain that stays below is a ratio, another is in percent [1]."""

SMOOTH_CORRELATION: Final = 0.8
"""A column whose neighbouring rows are correlated by more runs smoothly [1]."""

COLDEST, HOTTEST, LEAST_SPAN = -150.0, 500.0, 10.0
"""Temperatures of a shape memory alloy lie between the first two [degC], and vary by more than the third in a sweep."""


@dataclass(frozen=True, slots=True)
class Guess:
    """What one column seems to hold.

    Attributes
    ----------
    quantity, unit : str
    doubts : tuple of str
        What of it is a guess; empty where the header says both.
    """

    quantity: str
    unit: str
    doubts: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Guesses:
    """What the columns of a file seem to hold.

    Attributes
    ----------
    columns : mapping of str to tuple of (int, Guess)
        By quantity: number of the column, from 0, and what it seems to be.
    unused : tuple of int
        Columns that are none of them.
    """

    columns: Mapping[str, tuple[int, Guess]] = field(default_factory=dict)
    unused: tuple[int, ...] = ()


def settings_in(name: str) -> dict[str, float]:
    """Settings that a file name tells, by the keys of a ``[[condition]]``.

    Examples
    --------
    >>> settings_in("2A-150g-10mHz"), settings_in("isobaric 50 MPa"), settings_in("AB0")
    ({'current_A': 2.0, 'load_g': 150.0, 'frequency_mHz': 10.0}, {'stress_MPa': 50.0}, {})
    """
    found: dict[str, float] = {}
    for number, unit in _SETTING.findall(name):
        key, scale = _SETTINGS[unit]
        found.setdefault(key, float(number) * scale)
    duty = _DUTY.search(name)
    if duty:
        found.setdefault("duty_cycle_pct", float(duty[1]))
    return found


def guess_header(header: str) -> Guess | None:
    """Quantity and unit that a header tells, the unit empty where it doesn't.

    Examples
    --------
    >>> guess_header("Temperature Chamber (C)"), guess_header("load_N")
    (Guess(quantity='temperature', unit='degC', doubts=()), Guess(quantity='force', unit='N', doubts=()))
    >>> guess_header("SMA temperature"), guess_header("note")
    (Guess(quantity='temperature', unit='', doubts=()), None)
    """
    text = " ".join(header.replace("_per_", "/").replace("_", " ").split())
    bracketed = re.fullmatch(r"(.*?)\s*[(\[]([^)\]]*)[)\]]\s*", text)
    if bracketed:
        parts = [(bracketed[1], bracketed[2])]
    else:
        words = re.split(r"[ ,]+", text)
        parts = [(" ".join(words[:i]), " ".join(words[i:])) for i in range(len(words) - 1, 0, -1)]
    for name, written in parts:
        unit = _SPELT.get(written.strip().lower(), written.strip())
        quantity = _quantity(name, unit)
        if quantity:
            return Guess(quantity, "" if quantity == "drive" else unit)
    quantity = _quantity(bracketed[1] if bracketed else text, "")
    if quantity and bracketed and bracketed[2].strip() in RAW_UNITS:
        return Guess(
            quantity, ARBITRARY, (f"a raw reading in {bracketed[2].strip()}: give scale, offset and to",)
        )
    return Guess(quantity, "") if quantity else None


def near_quantity(header: str) -> str:
    """Quantity that a header names or nearly names; empty for none.

    Examples
    --------
    >>> near_quantity("Kraft (N)"), near_quantity("displacment mm"), near_quantity("note")
    ('force', 'displacement', '')
    """
    guess = guess_header(header)
    if guess is not None:
        return guess.quantity
    word = re.split(r"[ _(\[]", header.strip().lower())[0]
    near = get_close_matches(word, QUANTITIES, n=1, cutoff=0.8)
    return near[0] if near and not re.search(_NO_READING, header.lower()) else ""


def _quantity(name: str, unit: str) -> str:
    """First quantity that the words name and the unit suits; empty for none."""
    for quantity, pattern in _WORDS:
        if re.search(pattern, name.lower()):
            if not quantity:
                return ""
            if not unit or quantity == "drive" or can_convert(unit, QUANTITIES[quantity].unit):
                return quantity
    return ""


def guess_named(
    names: Sequence[str],
    values: Mapping[int, Floats],
    clocks: Collection[int] = (),
    with_units: Sequence[str] = (),
) -> Guesses:
    """What columns with headers hold.

    Parameters
    ----------
    names : sequence of str
    values : mapping of int to ndarray
        Columns of numbers, by their position.
    clocks : collection of int
        Columns of clock times; one of them is the time where no header says so, be it called ``Date``.
    with_units : sequence of str
        The same names with the units that stand in another line, where there is one.
    """
    found: dict[str, tuple[int, Guess]] = {}
    for i, header in enumerate(names):
        guess = guess_header(header) if header else None
        if with_units and (guess is None or not guess.unit) and header:
            guess = guess_header(with_units[i]) or guess
        readable = i in values or guess is None or guess.quantity == "branch"
        if guess is None or not (readable or (guess.quantity == "time" and i in clocks)):
            continue
        other = found.get(guess.quantity)
        if other is None or _rank(header, guess.quantity) < _rank(names[other[0]], guess.quantity):
            found[guess.quantity] = (i, guess)
    if "time" not in found and (
        unknown := [i for i in sorted(clocks) if names[i] and guess_header(names[i]) is None]
    ):
        found["time"] = (unknown[0], Guess("time", "", ("clock times",)))
    sure = {q: (i, _with_unit(g, values[i]) if i in values else g) for q, (i, g) in found.items()}
    taken = {i for i, _ in sure.values()}
    return Guesses(sure, tuple(i for i in range(len(names)) if i not in taken))


def _rank(header: str, quantity: str) -> tuple[int, int]:
    words = _PREFERRED.get(quantity, ())
    place = next((k for k, word in enumerate(words) if word in header.lower()), len(words))
    return place, len(header)


def _with_unit(guess: Guess, values: Floats) -> Guess:
    """The same with a unit guessed from the numbers, where the header has none."""
    if guess.unit or guess.quantity in ("drive", "cycle", "branch"):
        return guess
    largest = float(np.nanmax(np.abs(values)))
    if guess.quantity == "temperature":
        unit = "kelvin" if float(np.nanmin(values)) > 200.0 else "degC"
    elif guess.quantity == "ambient_temperature":
        unit = "kelvin" if largest > 200.0 else "degC"
    elif guess.quantity == "strain":
        unit = "1" if largest < MAX_STRAIN_RATIO else "percent"
    elif guess.quantity in CHANNELS and largest > 50.0 and bool(np.all(values == np.round(values))):
        unit = ARBITRARY
    else:
        unit = {"displacement": "mm", "stress": "MPa", "modulus": "MPa", "stiffness": "N/mm"}.get(
            guess.quantity, QUANTITIES[guess.quantity].unit
        )
    doubt = "whole numbers without a unit, counts of a converter?" if unit == ARBITRARY else "unit"
    return replace(guess, unit=unit, doubts=(doubt,))


def guess_unnamed(
    files: Sequence[Mapping[int, Floats]], width: int, stresses: Sequence[float | None]
) -> Guesses:
    """What columns without headers hold, by how their numbers run, in files of the same layout.

    Parameters
    ----------
    files : sequence of mapping of int to ndarray
        Of each file the columns of numbers, by their position.
    width : int
        Columns of a file.
    stresses : sequence of float or None
        Stress that the name of each file tells [MPa]: then strain and stress of a specimen are expected.

    Notes
    -----
    The temperature runs smoothly over at least 10 degrees and does not begin near zero; of several such columns those
    that span half of the widest are thermometers, and the smoothest of these is taken. A channel runs smoothly too, a
    held stress does not. Means over the files decide.
    """
    shared = set.intersection(*(set(f) for f in files))
    columns = {i: [f[i] for f in files] for i in sorted(shared)}
    lag1 = {i: float(np.mean([_lag1(v) for v in vs])) for i, vs in columns.items()}
    smooth = {i: vs for i, vs in columns.items() if lag1[i] > SMOOTH_CORRELATION}
    found: dict[str, tuple[int, str]] = {}
    for i in list(smooth):
        if all(_is_clock(v) for v in smooth[i]):
            found.setdefault("time", (i, "s"))
            del smooth[i]
    warm = _thermometers(smooth)
    if warm:
        i = max(warm, key=lambda k: lag1[k])
        found["temperature"] = (i, "degC")
        rest = {k: v for k, v in smooth.items() if k not in warm}
        found |= _unnamed_channels(columns, rest, i, stresses)
    taken = {i for i, _ in found.values()}
    doubts = dict.fromkeys(found, ("quantity and unit, from how the numbers run",))
    others = ", ".join(str(k + 1) for k in warm if k not in taken)
    more = {"temperature": f"column {others} looks like a temperature, too"} if others else {}
    return Guesses(
        {
            q: (i, Guess(q, unit, (*doubts[q], *filter(None, [more.get(q)]))))
            for q, (i, unit) in found.items()
        },
        tuple(k for k in range(width) if k not in taken),
    )


def _is_clock(values: Floats) -> bool:
    step = np.diff(values)
    return bool(np.all(step > 0) and np.ptp(step) < 0.5 * np.mean(step))


def _thermometers(smooth: Mapping[int, Sequence[Floats]]) -> list[int]:
    span = {
        i: float(np.median([_span(v) for v in vs]))
        for i, vs in smooth.items()
        if all(COLDEST < np.median(v) < HOTTEST for v in vs)
        and np.median([abs(v[0]) / max(_span(v), 1e-300) for v in vs]) > 0.05
    }
    widest = max(span.values(), default=0.0)
    return [i for i, s in span.items() if s >= max(LEAST_SPAN, 0.5 * widest)]


def _unnamed_channels(
    columns: Mapping[int, Sequence[Floats]],
    rest: dict[int, list[Floats]],
    thermometer: int,
    stresses: Sequence[float | None],
) -> dict[str, tuple[int, str]]:
    """Strain and stress where stresses are told or two columns look like them, else a displacement."""
    found: dict[str, tuple[int, str]] = {}
    for i, vs in columns.items():
        told = [abs(np.median(v) / s - 1.0) < 0.15 for v, s in zip(vs, stresses, strict=True) if s]
        if told and all(told) and i != thermometer and "stress" not in found:
            found["stress"] = (i, "MPa")
            rest.pop(i, None)
    largest = {i: max(float(np.max(np.abs(v))) for v in vs) for i, vs in rest.items()}
    ranked = sorted(largest, key=lambda i: largest[i])
    if any(stresses) and ranked:
        found["strain"] = (ranked[0], "1" if largest[ranked[0]] < MAX_STRAIN_RATIO else "percent")
    elif len(ranked) >= 2 and largest[ranked[0]] < MAX_STRAIN_RATIO and largest[ranked[-1]] > 20.0:
        found |= {"strain": (ranked[0], "1"), "stress": (ranked[-1], "MPa")}
    elif ranked:
        found["displacement"] = (ranked[0], "mm")
    return found


def _lag1(values: Floats) -> float:
    """One less half of von Neumann's ratio: near 1 for what runs smoothly, 0 for noise, -1 for what alternates."""
    around = values - values.mean()
    total = float(around @ around)
    return 1.0 - 0.5 * float(np.sum(np.diff(values) ** 2)) / total if total > 0.0 else 0.0


def _span(values: Floats) -> float:
    low, high = np.percentile(values, [1.0, 99.0])
    return float(high - low)


def one_kind(guesses: Sequence[Guesses]) -> tuple[Guesses, ...]:
    """The same for spring or specimen alone: the kind that every file has, a spring where all have both."""
    spring = all(set(CHANNELS) & set(g.columns) for g in guesses)
    return tuple(_without(g, CHANNEL_OF if spring else CHANNELS) for g in guesses)


def _without(guesses: Guesses, kind: Iterable[str]) -> Guesses:
    """The same without channels of that kind, unless there are no others."""
    others = {q for q in guesses.columns if q in kind}
    if not set((*CHANNELS, *CHANNEL_OF)) & (set(guesses.columns) - others):
        return guesses
    unused = (*guesses.unused, *(guesses.columns[q][0] for q in others))
    return Guesses({q: c for q, c in guesses.columns.items() if q not in others}, tuple(sorted(unused)))
