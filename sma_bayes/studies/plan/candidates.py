"""Candidate experiments: a grid made from the campaign, or a declared file."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Annotated, Final, TypeVar

import numpy as np
from pydantic import Field

from sma_bayes.errors import MeasurementError, QuantityError, StudyError, require_known
from sma_bayes.quantities import ARBITRARY, STANDARD_GRAVITY, convert, number_and_unit, unit_text
from sma_bayes.records.toml_table import StrictTable, checked, declared_bytes, parsed_toml
from sma_bayes.records.types import Record, setting_unit
from sma_bayes.studies.ask.workflow import asked_temperature

CYCLES: Final = (1, 3, 10)
SWEEP_SHARES: Final = (0.7, 0.85)
"""How much of the range of temperature a shorter sweep passes."""
TURN_MARGIN: Final = 0.05
"""How far beyond the asked temperature a sweep that turns round there goes [range of temperature]."""
RATE_TOLERANCE: Final = 0.1
"""Rates nearer than this share count as one."""
SAMPLES_FACTOR: Final = 2
"""How many times as many samples are tried."""
EXTRAPOLATION_TOLERANCE: Final = 0.02
"""How far beyond what was measured does not count as extrapolation, as a share."""
MAX_CANDIDATES: Final = 2000
"""Most candidates."""


@dataclass(frozen=True, slots=True)
class Setting:
    """What was measured of a condition, from which its candidates are made.

    Attributes
    ----------
    condition : str
    lowest, hottest : float
        Of both branches together [unit of temperature].
    rate : float or None
        Mean magnitude of dT/dt of its sweeps [unit of temperature per s]; None where no time was recorded.
    samples : int
        Of a sweep.
    load : float or None
        [N, of a specimen Pa]
    temperature_unit : str
    specimen : bool
    """

    condition: str
    lowest: float
    hottest: float
    rate: float | None
    samples: int
    load: float | None
    temperature_unit: str
    specimen: bool

    @staticmethod
    def of(records: Sequence[Record]) -> Setting:
        """Of the records of a condition."""
        rates, samples = [], []
        for r in records:
            segment = r.inputs["segment"]
            for s in np.unique(segment):
                own = segment == s
                samples.append(int(own.sum()))
                if "time" in r.inputs:
                    passed = float(np.ptp(r.inputs["time"][own]))
                    if passed > 0.0 and np.ptp(r.temperature[own]) > 0.0:
                        rates.append(float(np.ptp(r.temperature[own])) / passed)
        first = records[0]
        return Setting(
            first.condition.id,
            min(float(r.temperature.min()) for r in records),
            max(float(r.temperature.max()) for r in records),
            float(np.median(rates)) if rates else None,
            max(int(np.median(samples)), 2),
            first.condition.load,
            first.units["temperature"],
            first.specimen,
        )


@dataclass(frozen=True, slots=True)
class CandidateExperiment:
    """An experiment that might be made next.

    Attributes
    ----------
    condition : str
        Whose settings it has, but for what follows.
    lowest, peak : float
        Between which the temperature goes up and down [unit of temperature].
    rate : float
        Magnitude of dT/dt [unit of temperature per s].
    load : float or None
        [N, of a specimen Pa]
    cycles : int
    samples : int
        Of each sweep.
    setup : float
        Time before the first cycle [h].
    name : str
        As declared; empty in a grid.
    beyond : tuple of str
        What of it lies beyond what was measured, in words.
    """

    condition: str
    lowest: float
    peak: float
    rate: float
    load: float | None
    cycles: int
    samples: int
    setup: float
    name: str = ""
    beyond: tuple[str, ...] = ()

    @property
    def cycle_hours(self) -> float:
        """Time of a cycle, up and down [h]."""
        return 2.0 * (self.peak - self.lowest) / self.rate / 3600.0

    @property
    def hours(self) -> float:
        """Time on the rig [h]."""
        return self.setup + self.cycles * self.cycle_hours

    @property
    def settings(self) -> tuple[object, ...]:
        """All but the number of cycles."""
        return (self.condition, self.lowest, self.peak, self.rate, self.load, self.samples, self.setup)


def rate_of(text: str, stored: str) -> float:
    """A rate of temperature, ``"2 K/min"`` [stored unit of temperature per s].

    Raises
    ------
    QuantityError
        If it is none, or not positive.
    """
    number, unit = number_and_unit(text, what="rate")
    above, slash, below = unit.rpartition("/")
    expected = f"a positive rate such as '2 {'K' if stored == 'degC' else stored}/min'"
    if not slash or number <= 0.0:
        raise QuantityError(f"rate {text!r}", expected=expected)
    try:
        seconds = float(convert(1.0, below.strip(), "s", what="time of a rate"))
    except QuantityError:
        raise QuantityError(f"rate {text!r}", expected=expected) from None
    above = above.strip()
    if stored == ARBITRARY:
        if above != ARBITRARY:
            raise QuantityError(
                f"rate {text!r}", expected=f"a rate in the unit of the fit, '2 {ARBITRARY}/min'"
            )
        return number / seconds
    try:
        ends = convert(
            np.array([0.0, 1.0]), {"K": "kelvin", "°C": "degC", "C": "degC"}.get(above, above), stored
        )
    except QuantityError:
        raise QuantityError(f"rate {text!r}", expected=expected) from None
    return number * float(ends[1] - ends[0]) / seconds


def hours_of(text: str, what: str) -> float:
    """A time, ``"20 min"`` [h].

    Raises
    ------
    QuantityError
        If it is none.
    """
    number, unit = number_and_unit(text, what=what)
    if not unit or number < 0.0:
        raise QuantityError(f"{what} {text!r}", expected="a time with its unit, such as '20 min' or '2 h'")
    return float(convert(number, unit, "hour", what=what))


def default_grid(
    settings: Sequence[Setting],
    at: float | None,
    setup: float,
    rate: float | None,
    cycles: Sequence[int] = CYCLES,
) -> list[CandidateExperiment]:
    """Candidates within the range of a campaign.

    Parameters
    ----------
    settings : sequence of Setting
        Of the conditions that are asked about.
    at : float or None
        Temperature that is asked about, beyond which a sweep may turn round.
    setup : float
        Time before each experiment [h].
    rate : float or None
        In place of the measured rates.
    cycles : sequence of int
    """
    measured = [s.rate for s in settings if s.rate is not None]
    out = []
    for s in settings:
        rates = [rate] if rate is not None else _distinct([s.rate, *_ends(measured)])
        span = s.hottest - s.lowest
        ranges = [(s.lowest, s.hottest)]
        for share in SWEEP_SHARES:
            ranges += [(s.lowest, s.lowest + share * span), (s.hottest - share * span, s.hottest)]
        if at is not None:
            near = TURN_MARGIN * span
            ranges += [(s.lowest, at + near), (at - near, s.hottest)]
        kept = [
            (low, peak)
            for low, peak in dict.fromkeys((rounded(a, span), rounded(b, span)) for a, b in ranges)
            if low >= s.lowest - EXTRAPOLATION_TOLERANCE * span
            and peak <= s.hottest + EXTRAPOLATION_TOLERANCE * span
            and peak > low
        ]
        for (low, peak), r, times, n in product(kept, rates, (1, SAMPLES_FACTOR), cycles):
            samples = max(round(times * s.samples * (peak - low) / span), 2)
            out.append(CandidateExperiment(s.condition, low, peak, r, s.load, n, samples, setup))
    return out


def rounded(value: float, span: float) -> float:
    """To a thousandth of the range, as nobody sets a rig more finely."""
    digits = max(0, 3 - math.ceil(math.log10(max(span, 1e-12))))
    return round(value, digits)


def _ends(rates: Sequence[float]) -> list[float]:
    return [min(rates), max(rates)] if rates else []


def _distinct(rates: Sequence[float | None]) -> list[float]:
    kept: list[float] = []
    for r in rates:
        if r is not None and all(abs(r - k) > RATE_TOLERANCE * k for k in kept):
            kept.append(float(f"{r:.3g}"))
    return kept


T = TypeVar("T")
Texts = str | list[str]
Counts = Annotated[int, Field(ge=1, le=100_000)] | list[Annotated[int, Field(ge=1, le=100_000)]]


class CandidateTable(StrictTable):
    """``[[candidate]]``: a value or a list of values for each setting; all combinations are candidates.

    Attributes
    ----------
    name : str, optional
        What it is called in tables.
    condition : str or list of str, optional
        Whose settings it has; by default those that are asked about.
    lowest, peak : str or list of str, optional
        Temperatures with their unit, ``"40 degC"``; by default as measured.
    rate : str or list of str, optional
        ``"2 K/min"``; by default as measured.
    load : str or list of str, optional
        ``"150 g"`` or ``"1.5 N"``; by default that of the condition.
    cycles, samples : int or list of int, optional
        Number of cycles, 1 by default, and samples of each sweep, by default as measured.
    setup : str, optional
        Time before the first cycle, ``"20 min"``; that of the command by default.
    """

    name: str = ""
    condition: Texts | None = None
    lowest: Texts | None = None
    peak: Texts | None = None
    rate: Texts | None = None
    load: Texts | None = None
    cycles: Counts = 1
    samples: Counts | None = None
    setup: str | None = None


class CandidatesFile(StrictTable):
    """A file of candidates."""

    candidate: Annotated[list[dict[str, object]], Field(min_length=1)]


def candidate_tables(path: Path) -> list[CandidateTable]:
    """Tables of a file of candidates, whatever has been fitted.

    Raises
    ------
    StudyError
        If the file can't be read or says something else, with the key.
    """
    try:
        content = declared_bytes(path)
    except OSError as error:
        raise StudyError(
            f"can't be read: {error.strerror}", file=path, expected="a file of candidates"
        ) from None
    whole = checked(
        CandidatesFile, parsed_toml(content, path, StudyError), file=path, where="", kind=StudyError
    )
    return [
        checked(CandidateTable, values, file=path, where=f"candidate {number}", kind=StudyError)
        for number, values in enumerate(whole.candidate, 1)
    ]


def declared(
    path: Path, settings: Mapping[str, Setting], asked: Sequence[str], setup: float, rate: float | None
) -> list[CandidateExperiment]:
    """Candidates of a file.

    Parameters
    ----------
    path : Path
    settings : mapping of str to Setting
        Of all conditions.
    asked : sequence of str
        Conditions that are asked about.
    setup, rate
        See `default_grid`; what a file leaves out.

    Raises
    ------
    StudyError
        If the file can't be used, with the key.
    """
    out: list[CandidateExperiment] = []
    for number, table in enumerate(candidate_tables(path), 1):
        where = f"candidate {number}"
        for condition in _list(table.condition) or list(asked):
            told, column = f"unknown condition {condition!r}", f"{where}.condition"
            require_known(condition, settings, told, StudyError, file=path, column=column)
            if len(out) + _combinations(table) > MAX_CANDIDATES:
                raise StudyError(
                    f"more than {MAX_CANDIDATES} candidates",
                    file=path,
                    column=where,
                    expected=f"at most {MAX_CANDIDATES} combinations",
                    remedy="shorten the lists",
                )
            try:
                out += _of_table(table, settings[condition], setup, rate)
            except QuantityError as error:
                raise StudyError(error.found, file=path, column=where, expected=error.expected) from None
    return out


def _combinations(table: CandidateTable) -> int:
    lists = (table.lowest, table.peak, table.rate, table.load, table.cycles, table.samples)
    return math.prod(max(len(values), 1) for values in lists if isinstance(values, list))


def _of_table(
    table: CandidateTable, s: Setting, setup: float, rate: float | None
) -> Iterator[CandidateExperiment]:
    degrees = s.temperature_unit
    lows = [asked_temperature(t, degrees, degrees) for t in _list(table.lowest)] or [s.lowest]
    peaks = [asked_temperature(t, degrees, degrees) for t in _list(table.peak)] or [s.hottest]
    usual = rate if rate is not None else s.rate
    rates = [rate_of(t, degrees) for t in _list(table.rate)] or ([] if usual is None else [usual])
    loads: list[float | None] = [_load(t, s) for t in _list(table.load)]
    loads = loads or [s.load]
    own = setup if table.setup is None else hours_of(table.setup, "setup")
    for low, peak, r, load, n in product(lows, peaks, rates, loads, _list(table.cycles)):
        if not peak > low:
            raise QuantityError(
                f"a peak of {peak:g} {unit_text(degrees)} that is not above the lowest of {low:g}",
                expected="lowest below peak",
            )
        usual_samples = max(round(s.samples * (peak - low) / (s.hottest - s.lowest)), 2)
        for samples in _list(table.samples) or [usual_samples]:
            yield (CandidateExperiment(s.condition, low, peak, r, load, n, max(samples, 2), own, table.name))


def _load(text: str, s: Setting) -> float:
    number, unit = number_and_unit(text, what="load")
    if not s.specimen and unit in ("g", "kg"):  # a mass that hangs
        return float(convert(number, unit, "kg")) * STANDARD_GRAVITY
    return float(convert(number, unit, setting_unit("load", specimen=s.specimen), what="load"))


def _list(values: T | list[T] | None) -> list[T]:
    return [] if values is None else values if isinstance(values, list) else [values]


def marked(
    candidates: Sequence[CandidateExperiment], settings: Mapping[str, Setting]
) -> list[CandidateExperiment]:
    """Candidates with what of them lies beyond what the campaign measured."""
    rates = [s.rate for s in settings.values() if s.rate is not None]
    loads = [s.load for s in settings.values() if s.load is not None]
    out = []
    for c in candidates:
        s = settings[c.condition]
        slack = EXTRAPOLATION_TOLERANCE * (s.hottest - s.lowest)
        beyond = []
        if c.lowest < s.lowest - slack:
            beyond.append("colder than measured")
        if c.peak > s.hottest + slack:
            beyond.append("hotter than measured")
        if rates and not _within(c.rate, rates):
            beyond.append("faster than measured" if c.rate > max(rates) else "slower than measured")
        if c.load is not None and loads and not _within(c.load, loads):
            beyond.append("load beyond those measured")
        out.append(replace(c, beyond=tuple(beyond)))
    return out


def _within(value: float, measured: Sequence[float]) -> bool:
    return (
        min(measured) * (1.0 - EXTRAPOLATION_TOLERANCE)
        <= value
        <= max(measured) * (1.0 + EXTRAPOLATION_TOLERANCE)
    )


def settings_of(records: Iterable[Record]) -> dict[str, Setting]:
    """What was measured of each condition, by its id."""
    by_id: dict[str, list[Record]] = {}
    for r in records:
        by_id.setdefault(r.condition.id, []).append(r)
    return {name: Setting.of(own) for name, own in by_id.items()}


def require_rate(found: Sequence[CandidateExperiment], source: Path) -> None:
    """Refuse to plan without candidates: there are none where nothing tells how fast the temperature changes.

    Raises
    ------
    MeasurementError
    """
    if not found:
        raise MeasurementError(
            "no time was recorded, so that nothing tells how long a sweep takes",
            file=source,
            expected="the rate of temperature of the rig",
            remedy="give --rate '2 K/min', or a rate in the file of candidates",
        )
