"""What can't be, and what can but hardly is: values beyond what springs, wires and their rigs show.

What can't be measured at all is refused, as nothing could be made of it; what is implausible is reported, and nothing
is changed. `RANGES` holds between what values a quantity is believed without a word.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.errors import MeasurementError, ReadingError, many
from sma_bayes.limits import MAGNITUDE
from sma_bayes.quantities import ARBITRARY, CHANNELS, QUANTITIES, SPECIMEN_QUANTITY, convert, unit_text
from sma_bayes.records.decimals import misread_decimals
from sma_bayes.records.declaration import ColumnDeclaration, DeclaredCondition
from sma_bayes.records.default_names import recognised
from sma_bayes.records.run import Run
from sma_bayes.records.split import SplitSettings, split_run
from sma_bayes.records.types import Finding, Record

ABSOLUTE_ZERO: Final = -273.15
"""[degC], by definition (SI brochure, 9th ed.)."""


@dataclass(frozen=True, slots=True)
class Range:
    """Between what values a quantity is believed without a word.

    Attributes
    ----------
    low, high : float
        Of the largest magnitude in a record; of the temperature, of every value [unit].
    unit : str
        Canonical.
    source : str
    """

    low: float
    high: float
    unit: str
    source: str


RANGES: Final[dict[str, Range]] = {
    "temperature": Range(
        -200.0, 600.0, "degC",
        "NiTi transforms between -100 and 120 °C, NiTiHf and NiTiPt up to some 550 °C (Ma, Karaman and Noebe, Int. "
        "Mater. Rev. 55 (2010) 257-315)",
    ),
    "force": Range(
        1e-4, 1e5, "N",
        "springs of wire from 25 µm pull millinewtons; a rod of 10 mm at 800 MPa, more than NiTi recovers (Otsuka and "
        "Ren, Prog. Mater. Sci. 50 (2005) 511-678), pulls 63 kN",
    ),
    "displacement": Range(
        1e-7, 2.0, "m",
        "from what displacement sensors resolve to a metre-long actuator: recoverable strain of a wire is at most 8 %, "
        "springs stretch several times their length (Otsuka and Ren 2005)",
    ),
    "stiffness": Range(1e-2, 1e8, "N/m", "the softest springs to a rod of 10 mm by 100 mm at 80 GPa, 63 MN/m"),
    "stress": Range(1e3, 3e9, "Pa", "to above the strength of drawn NiTi wire, 1.9 GPa (Otsuka and Ren 2005)"),
    "strain": Range(1e-6, 0.5, "1", "from what extensometers resolve to several times the recoverable 8 %"),
    "modulus": Range(1e5, 5e11, "Pa", "NiTi has 20 to 90 GPa (Otsuka and Ren 2005); paths may be far softer"),
    "current": Range(0.0, 1e3, "A", "wires of 25 µm to 1 mm take 0.05 to 20 A"),
    "frequency": Range(
        0.0, 100.0, "Hz",
        "actuators cycle at a few Hz, as heat has to leave (Jani, Leary, Subic and Gibson, Mater. Des. 56 (2014) "
        "1078-1113)",
    ),
}  # fmt: skip
"""Wider than any measurement that is known by an order of magnitude; a wrong prefix lies three away."""

DOUBTED_SCALE_SD: Final = 0.5
"""Share of the scale above which its declared standard deviation is doubted."""
DOUBTED_TEMPERATURE_SD_OF_SWEEP: Final = 0.25
"""Share of the sweep above which the declared error of a temperature reading is doubted: the curve is all but lost in
it."""
DOUBTED_TEMPERATURE_SD_OF_TRANSITION: Final = 0.25
"""The same of the temperatures over which a channel goes from a tenth to nine tenths of its change. Of a sigmoid they
are 4.4 / B, so that the error is larger than 1 / B: its expansion in the error, of whatever order, has no meaning, and
errors that large would have smeared a jump over 2.6 of them."""
COMPARED_TEMPERATURE_SD: Final = 0.1
"""Share of the same temperatures from which on the declared error is held against the scatter of the readings about the
line between their neighbours, which an error of the temperature makes where a channel is steep."""
LEAST_VISIBLE_TEMPERATURE_SD: Final = 0.3
"""Share of the declared error that this scatter reaches at least, put down to the temperature alone."""
LEAST_STEEP_READINGS: Final = 10
"""Readings on the steep part below which their scatter tells nothing."""
DOUBTED_OFFSET_SD: Final = (10.0, 1.0)
"""Shares of the range of a channel, whose zero may be nobody's care, and of the sweep, from which on the declared
standard deviation of an offset is doubted."""
IDENTICAL_CORRELATION: Final = 1.0 - 1e-9
"""Correlation of two columns from which on they are one."""
DOUBTED_END_CLUSTERING: Final = 0.05
"""By how much more a temperature lingers at its two ends than a channel does, before the two are doubted, as variance
over the squared range: 1/12 where a column passes evenly, 1/4 where it has but two values. A transformation makes its
channel linger more than the temperature that drives it: 28 real pairs differ by -0.10 to 0.04."""
LEAST_CORRELATION: Final = 0.6
"""Correlation of a channel with the temperature from which on such a comparison says something."""


DOUBTS: Final = (
    "copied-readings",
    "implausible",
    "kelvin",
    "large-sd",
    "misread-decimals",
    "named-otherwise",
    "same-column",
    "same-file",
    "swapped",
)
"""Kinds of finding that say that a measurement can hardly be what it was declared to be."""
DEGENERATE: Final = ("same-column", "swapped")
"""Those of them after which no curve is one of a specimen. Of the others a right one may come: in other units, with a
wider uncertainty, or without the few readings that were misread."""


def require_possible(run: Run) -> None:
    """Refuse what can't have been measured.

    Raises
    ------
    MeasurementError
        Where a temperature lies below absolute zero, a value is too large to reckon with, or a column that was declared
        has no value.
    """
    for name, values in run.columns.items():
        quantity = SPECIMEN_QUANTITY.get(name, name) if run.specimen else name
        with np.errstate(invalid="ignore"):
            large = np.flatnonzero(np.isinf(values) | (np.abs(values) > MAGNITUDE.value))
        if large.size:
            raise ReadingError(
                f"{quantity} is {values[large[0]]:g} {unit_text(run.units.get(name, ''))}".rstrip(),
                file=run.file,
                row=int(run.row[large[0]]),
                column=quantity,
                expected=f"a magnitude up to {MAGNITUDE.value:g}",
                remedy="correct the cell, or unit, scale and offset in [columns]",
                elsewhere="correct the cell, or the unit",
            )
        if values.size and np.isnan(values).all():
            raise ReadingError(
                f"condition {run.condition.id!r}: {quantity} has no value in {many(values.size, 'row')}",
                file=run.file,
                column=quantity,
                expected="at least one value that is not missing",
                remedy="leave the column out of [columns], or correct `valid` and the codes of missing values",
                elsewhere="leave the column out, or name another one",
            )
    for name in ("temperature", "ambient_temperature"):
        if run.units.get(name) != "degC":
            continue
        with np.errstate(invalid="ignore"):
            cold = np.flatnonzero(run.columns[name] < ABSOLUTE_ZERO)
        if cold.size:
            raise ReadingError(
                f"{name} is {run.columns[name][cold[0]]:.6g} °C in {many(cold.size, 'row')}, below absolute "
                "zero",
                file=run.file,
                row=int(run.row[cold[0]]),
                column=name,
                expected=f"more than {ABSOLUTE_ZERO:g} °C",
                remedy="correct the unit: of kelvin, degC and degF only one can be right; or leave readings out with "
                "valid = [low, high] of the column",
                elsewhere="correct the unit: of kelvin, degC and degF only one can be right",
            )


def implausible(run: Run) -> tuple[Finding, ...]:
    """What of one run can hardly be, each with what it looks like."""
    seen = (
        Finding(kind, message, run.file, condition=run.condition.id, column=column)
        for kind, message, column in (
            *_out_of_range(run),
            *_same_columns(run),
            *_temperature_like_time(run),
            *_temperature_like_response(run),
            *_declared_spread(run),
            *_declared_offset(run),
            *_duty(run),
            *_settings(run),
        )
    )
    return (*seen, *misread_decimals(run))


def doubted_conditions(findings: Iterable[Finding]) -> frozenset[str]:
    """Ids of conditions from which little can follow.

    Their columns hold something else than a specimen's response to temperature, or the declared error of the
    temperature leaves little of it.
    """
    return frozenset(
        f.condition
        for f in findings
        if f.kind in DEGENERATE or (f.kind == "large-sd" and f.column == "temperature")
    )


def split_with_doubts(
    run: Run, settings: SplitSettings | None = None
) -> tuple[tuple[Record, ...], tuple[Finding, ...]]:
    """Split a run, and say what of it can hardly be.

    Raises
    ------
    MeasurementError
        Where the run can't be split; the message goes on with what is doubted, the likely reason.
    """
    doubts = implausible(run)
    try:
        parts, seen = split_run(run, settings)
    except MeasurementError as error:
        if not doubts:
            raise
        told = "; ".join(f.message for f in doubts)
        raise error.but(f"{error.found}; {told}") from error
    return parts, (*doubts, *unresolved(parts), *seen)


SPIKES_SET_ASIDE: Final = 2
"""Readings at either end of a column that don't tell whether it is what it is named: they may be spikes, which are kept
out and counted by themselves."""

_Seen = Iterator[tuple[str, str, str]]


def _quantity(run: Run, name: str) -> str:
    return SPECIMEN_QUANTITY.get(name, name) if run.specimen else name


def _out_of_range(run: Run) -> _Seen:
    for name, values in run.columns.items():
        quantity = _quantity(run, name)
        believed = RANGES.get("temperature" if name == "ambient_temperature" else quantity)
        if believed is None or run.units.get(name) != believed.unit:
            continue
        unit = unit_text(believed.unit)
        limits = f"{believed.low:g} to {believed.high:g} {unit}".rstrip()
        if believed.unit == "degC":
            found = [v for v in _ends(values) if not believed.low <= v <= believed.high]
            shown = f"reaches {found[0]:.4g} {unit}" if found else ""
        else:
            largest = _ends(np.abs(values))[1]
            shown = (
                ""
                if not largest or believed.low <= largest <= believed.high
                else f"reaches {largest:.3g} {unit}"
            )
        if shown:
            yield (
                "implausible",
                f"{quantity} {shown.rstrip()}, specimens show {limits} ({believed.source}): is its unit "
                "right, and the column this quantity?",
                name,
            )


def _ends(values: Floats) -> tuple[float, float]:
    """Least and greatest value but for the `SPIKES_SET_ASIDE` readings at either end."""
    known = np.sort(values[np.isfinite(values)])
    aside = min(SPIKES_SET_ASIDE, (known.size - 1) // 10)
    return float(known[aside]), float(known[-1 - aside])


def _same_columns(run: Run) -> _Seen:
    names = [n for n in ("time", "temperature", *CHANNELS) if n in run.columns]
    for i, name in enumerate(names):
        for other in names[i + 1 :]:
            if (name, other) == ("time", "temperature"):  # a ramp is as steady as a clock
                continue
            a, b = run.columns[name], run.columns[other]
            good = np.isfinite(a) & np.isfinite(b)
            if np.count_nonzero(good) > 2 and abs(_correlation(a[good], b[good])) > IDENTICAL_CORRELATION:
                yield (
                    "same-column",
                    f"{_quantity(run, name)} and {_quantity(run, other)} are one column, up to a factor and an offset: "
                    "the second says nothing",
                    other,
                )


def _correlation(a: Floats, b: Floats) -> float:
    a, b = a - a.mean(), b - b.mean()
    norm = float(np.sqrt((a @ a) * (b @ b)))
    return float(a @ b) / norm if norm > 0.0 else 0.0


def _temperature_like_time(run: Run) -> _Seen:
    """A temperature that is a clock: it rises by the same step all along, while the time does not."""
    temperature = run.columns["temperature"]
    time = run.columns.get("time")
    if time is None or temperature.size < 10:
        return
    good = np.isfinite(temperature) & np.isfinite(time)
    step, clock = np.diff(temperature[good]), np.diff(time[good])
    even = step.size > 5 and bool(np.all(step > 0) and np.ptp(step) <= 1e-6 * np.median(step))
    if even and np.count_nonzero(clock < 0) > 0.1 * clock.size:
        yield (
            "swapped",
            "temperature rises by the same step from row to row while time goes up and down: the two look swapped",
            "temperature",
        )


def _temperature_like_response(run: Run) -> _Seen:
    """A temperature that saturates while what should answer to it passes evenly, steepest at both ends."""
    for name in CHANNELS:
        if name not in run.columns:
            continue
        temperature, response = run.columns["temperature"], run.columns[name]
        good = np.isfinite(temperature) & np.isfinite(response)
        t, y = _within_range(temperature[good]), _within_range(response[good])
        if t.size < 10 or abs(_correlation(t, y)) < LEAST_CORRELATION:
            continue
        if t.var() - y.var() > DOUBTED_END_CLUSTERING and _is_steep_at_both_ends(t, y):
            quantity = _quantity(run, name)
            yield (
                "swapped",
                f"temperature lingers at both of its ends while {quantity} passes evenly, steepest there: so they run "
                "where the two are swapped",
                "temperature",
            )


def _within_range(values: Floats) -> Floats:
    """Values over their range, without the outermost hundredth."""
    if not values.size:
        return values
    low, high = np.quantile(values, (0.005, 0.995))
    return np.clip((values - low) / (high - low), 0.0, 1.0) if high > low else np.zeros_like(values)


def _is_steep_at_both_ends(x: Floats, y: Floats) -> bool:
    """Whether y changes with x at either end twice as fast as in the middle, where there may be nothing at all."""

    def slope(low: float, high: float) -> float:
        inside = (x >= low) & (x <= high)
        if np.count_nonzero(inside) < 3 or not np.ptp(x[inside]) > 0.0:
            return float("nan")
        return float(np.polyfit(x[inside], y[inside], 1)[0])

    ends, middle = np.array([slope(0.0, 0.12), slope(0.88, 1.0)]), slope(0.3, 0.7)
    if np.isnan(ends).any() or ends[0] * ends[1] <= 0.0:
        return False
    return bool(np.isnan(middle) or np.abs(ends).min() > 2.0 * abs(middle))


def _declared_spread(run: Run) -> _Seen:
    span = float(np.nanmax(run.columns["temperature"]) - np.nanmin(run.columns["temperature"]))
    if run.temperature_sd > DOUBTED_TEMPERATURE_SD_OF_SWEEP * span > 0.0:
        yield (
            "large-sd",
            f"the declared error of a temperature reading, sd = {run.temperature_sd:.3g}, is "
            f"{run.temperature_sd / span:.0%} of the sweep: little of a curve can be told from such readings",
            "temperature",
        )
    for name, calibration in run.calibration.items():
        if calibration.relative_scale_sd > DOUBTED_SCALE_SD:
            yield (
                "large-sd",
                f"the declared scale_sd of {_quantity(run, name)} is {calibration.relative_scale_sd:.0%} of its scale: "
                "not even the sign is known; is it given in the unit of the scale?",
                name,
            )


def unresolved(records: Sequence[Record]) -> Iterator[Finding]:
    """Channels that change over fewer degrees than the declared errors of the temperature would leave, in any branch.

    Parameters
    ----------
    records : sequence of Record
        Of one condition.
    """
    for channel in dict.fromkeys(c for r in records for c in r.observed):
        of = [r for r in records if channel in r.observed and r.temperature_sd > 0.0]
        steep = [s for r in of if (s := _steep_part(r.temperature, r.observed[channel])) is not None]
        if not steep or any(
            r.temperature_sd > DOUBTED_TEMPERATURE_SD_OF_SWEEP * np.ptp(r.temperature) for r in of
        ):
            continue  # there is nothing to tell by, or it is told of already
        sd, width = min(r.temperature_sd for r in of), max(s.width for s in steep)
        scatter = min(s.scatter for s in steep)
        message, unit = "", unit_text(of[0].units["temperature"])
        if sd > DOUBTED_TEMPERATURE_SD_OF_TRANSITION * width:
            message = (
                f"the declared error of a temperature reading, sd = {sd:.3g}, is more than a quarter of the "
                f"{width:.3g} {unit} over which {of[0].quantity(channel)} changes: "
                "how fast it does can't be told from such readings; is it an offset of all of them (offset_sd)?"
            )
        elif sd > COMPARED_TEMPERATURE_SD * width and scatter < LEAST_VISIBLE_TEMPERATURE_SD * sd:
            message = (
                f"the declared error of a temperature reading, sd = {sd:.3g}, would scatter {of[0].quantity(channel)} "
                f"where it is steep as {sd:.3g} {unit} do; it scatters as {scatter:.2g} {unit} at most: is it an "
                "offset of all readings (offset_sd)?"
            )
        if message:
            yield Finding(
                "large-sd", message, of[0].source, condition=of[0].condition.id, column="temperature"
            )


class _Steep(NamedTuple):
    """Degrees over which a channel goes from a tenth to nine tenths of its change, and its scatter there in degrees."""

    width: float
    scatter: float


def _steep_part(temperature: Floats, values: Floats) -> _Steep | None:
    """Steep part of the monotonic curve nearest to readings (n,); the scatter is infinite where too few lie there."""
    together = _correlation(temperature, values)
    if temperature.size < 10 or abs(together) < LEAST_CORRELATION:
        return None
    from scipy.optimize import isotonic_regression  # takes long to import, and few declare an error

    order = np.argsort(temperature, kind="stable")
    t, y = temperature[order], np.sign(together) * values[order]
    curve = isotonic_regression(y).x
    low, high = np.quantile(curve, (0.02, 0.98))
    first, last = np.searchsorted(curve, low + np.array([0.1, 0.9]) * (high - low))
    width = float(t[last] - t[first])
    if last - first < LEAST_STEEP_READINGS or not width > 0.0:
        return _Steep(width, np.inf)
    t, y = t[first:last], y[first:last]
    apart = t[2:] - t[:-2]
    share = np.divide(t[2:] - t[1:-1], apart, out=np.full(apart.size, 0.5), where=apart > 0.0)
    off = (share * y[:-2] + (1.0 - share) * y[2:] - y[1:-1]) / np.sqrt(share**2 + (1.0 - share) ** 2 + 1.0)
    return _Steep(width, float(np.sqrt(np.mean(off * off))) * width / (0.8 * float(high - low)))


def _declared_offset(run: Run) -> _Seen:
    for name, calibration in run.calibration.items():
        span = float(np.nanmax(run.columns[name]) - np.nanmin(run.columns[name]))
        if calibration.offset_sd > DOUBTED_OFFSET_SD[name == "temperature"] * span > 0.0:
            unit = unit_text(run.units.get(name, ""))
            yield (
                "large-sd",
                f"the declared offset_sd of {_quantity(run, name)}, {calibration.offset_sd:.3g} {unit}, is more than "
                f"its readings change by, {span:.3g} {unit}: is it given in the unit of the quantity?",
                name,
            )


def _duty(run: Run) -> _Seen:
    duty = run.condition.duty_cycle
    if duty is not None and duty <= 0.01:
        yield (
            "implausible",
            f"duty_cycle_pct = {100 * duty:g} is at most 1 %: it is given in percent; "
            f"{100 * duty:g} may be meant as a share, {1e4 * duty:g} %",
            "",
        )


def _settings(run: Run) -> _Seen:
    load = "stress" if run.specimen else "force"
    for setting, quantity in (("current", "current"), ("load", load), ("frequency", "frequency")):
        value, believed = getattr(run.condition, setting), RANGES[quantity]
        if value is not None and abs(value) > believed.high:
            unit = unit_text(believed.unit)
            yield (
                "implausible",
                f"the {setting} of the condition is {value:.3g} {unit}, more than {believed.high:g} {unit} "
                f"({believed.source}): is its unit right?",
                "",
            )


def named_otherwise(condition: DeclaredCondition) -> tuple[Finding, ...]:
    """Columns whose name tells another quantity, or another unit of it, than was declared."""
    return tuple(
        Finding("named-otherwise", message, condition.title, condition=condition.table.id, column=quantity)
        for quantity, columns in condition.columns.items()
        for column in columns
        if (message := _told_otherwise(quantity, column))
    )


def _told_otherwise(quantity: str, column: ColumnDeclaration) -> str:
    told = recognised(column.name or "")
    if told is None or told[0] not in QUANTITIES:  # a load may be measured as a force
        return ""
    if told[0] != quantity:
        return f"the column {column.name!r} is declared as {quantity}, its name tells {told[0]}"
    calibrated = column.scale is not None or column.offset is not None
    if calibrated or column.unit == ARBITRARY or _equal_units(told[1], column.unit or "1"):
        return ""
    return f"the column {column.name!r} is declared in {column.unit!r}, its name tells {told[1]!r}"


def _equal_units(one: str, other: str) -> bool:
    numbers = np.array([0.0, 1.0])
    return bool(np.allclose(convert(numbers, one, other), numbers, rtol=1e-9, atol=1e-12))


def repeated_files(conditions: Sequence[DeclaredCondition]) -> tuple[Finding, ...]:
    """Conditions that are the same rows of the same file as another, or of a copy of it."""
    seen: dict[tuple[object, ...], str] = {}
    found = []
    for condition in conditions:
        columns = sorted((name, repr(column)) for name, column in condition.columns.items())
        what = (
            tuple(_content(p) for p in condition.paths),
            repr(condition.reading),
            condition.window,
            tuple(columns),
        )
        other = seen.setdefault(what, condition.table.id)
        if other != condition.table.id:
            message = (
                f"the conditions {other!r} and {condition.table.id!r} are the same rows of the same file, or of a "
                "copy: their measurements count twice"
            )
            found.append(Finding("same-file", message, condition.title, condition=condition.table.id))
    return tuple(found)


def _content(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
