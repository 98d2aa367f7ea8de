"""From one run to its records: one a branch, with everything that was kept out counted.

The steps, in order; each keeps rows out by a rule that a finding names, and no value is ever changed:

1. Rows without a credible temperature, repeated rows, rows out of order in time, and temperature readings
that
   are drop-outs or spikes (`cleaning`).
2. Sweeps, by an explicit ``branch`` column, else by the drive, else by the temperature itself; part cycles
and
   the holds at the ends of sweeps (`segmentation`).
3. Channels that the rig held are set aside, for all branches of the condition alike (`held`).
4. Rows in which a channel to fit is missing, a drop-out or a spike (`cleaning`).
5. Long branches are averaged in blocks (`reduction`).

The accounts close: the rows of all records, before averaging, and ``dropped`` of all findings add up to the
rows of the run.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final

import numpy as np

from sma_bayes.arrays import Floats, Ints
from sma_bayes.errors import MeasurementError, many, near_matches
from sma_bayes.quantities import CHANNELS
from sma_bayes.records.cleaning import MAX_SHARE_MISSING, clean_channel, clean_rows, note_digits
from sma_bayes.records.drive import delivered
from sma_bayes.records.held import (
    Leg,
    choose_channels,
    held_channels,
    keep_out_load_off,
    note_held,
    note_no_transformation,
    rows_of,
)
from sma_bayes.records.ledger import Ledger
from sma_bayes.records.quality import are_row_numbers, gaps, levels, looks_like_kelvin, stuck
from sma_bayes.records.reduction import Blocks, average, blocks_of
from sma_bayes.records.run import Run
from sma_bayes.records.segmentation import (
    Mask,
    Smoothed,
    Sweep,
    drive_is_on,
    smooth,
    span,
    sweeps_of_column,
    sweeps_of_drive,
    sweeps_of_temperature,
    threshold_of_a_turn,
    with_quiet_ends,
    without_holds,
)
from sma_bayes.records.types import Branch, Finding, Record

FEWEST_ROWS_OF_A_SWEEP: Final = 4
"""A sweep of fewer rows is a jump between two states, not a sweep."""

PART_CYCLE_SHARE: Final = 0.8
"""A sweep that covers less than this share of the widest one is reported as a part cycle."""

DRIVE_OFF_SHARE: Final = 0.05
"""A current is a drive if it falls below this share of its largest value."""

MAX_DRIFT: Final = 5.0
"""A temperature that varies by less in all drifts, and does not sweep over a transformation [degC]."""

OPTIONAL_INPUTS: Final = ("time", "current", "ambient_temperature")
"""Inputs that a record carries where the run has them."""


@dataclass(frozen=True, slots=True)
class SplitSettings:
    """How a run is split into branches, cleaned and reduced. The defaults suit most rigs.

    Attributes
    ----------
    fit_channels : tuple of str or None
        Channels to fit, among force, displacement and stiffness. None leaves it to the data: a channel that
        the rig kept constant becomes a held channel and is not fitted.
    max_samples : int
        Samples that a branch has at most; longer ones are averaged in blocks.
    block_span : float
        Largest move of the temperature within a block over the range of the branch [1]. Has precedence over
        `max_samples`.
    min_samples : int
        A branch with fewer samples is left out.
    turn_fraction : float
        Smallest return of the temperature that ends a sweep, over the range of the run [1].
    min_span : float
        A sweep that covers a smaller share of the widest sweep of the run is left out [1].
    hold_tolerance, hold_share : float
        Rows within this share of the span of a sweep from its ends are a hold where they are more than this
        share of the other rows of the sweep [1]; the excess is left out.
    min_change : float
        A force or stiffness that changes with temperature by less than this share of its mean counts as held
        constant [1].
    """

    fit_channels: tuple[str, ...] | None = None
    max_samples: int = 400
    block_span: float = 0.02
    min_samples: int = 10
    turn_fraction: float = 0.2
    min_span: float = 1.0 / 3.0
    hold_tolerance: float = 0.05
    hold_share: float = 0.2
    min_change: float = 0.05

    def __post_init__(self) -> None:
        for channel in self.fit_channels or ():
            if channel not in CHANNELS:
                raise MeasurementError(
                    f"unknown channel {channel!r} to fit",
                    expected=", ".join(CHANNELS),
                    remedy=near_matches(channel, CHANNELS),
                )
        if self.fit_channels == ():
            raise MeasurementError(
                "fit_channels is empty", expected=f"some of {', '.join(CHANNELS)}, or None"
            )
        for name, least in (("max_samples", 10), ("min_samples", 4)):
            if getattr(self, name) < least:
                raise MeasurementError(f"{name} is {getattr(self, name)}", expected=f"{least} or more")
        for name in ("block_span", "turn_fraction", "min_span", "hold_tolerance", "hold_share", "min_change"):
            if not 0.0 < getattr(self, name) < 1.0:
                raise MeasurementError(
                    f"{name} is {getattr(self, name)}", expected="a number between 0 and 1"
                )


def split_run(
    run: Run, settings: SplitSettings | None = None
) -> tuple[tuple[Record, ...], tuple[Finding, ...]]:
    """Split one run into records, one a branch.

    Parameters
    ----------
    run : Run
        One condition, in the order of its file.
    settings : SplitSettings, optional

    Returns
    -------
    records : tuple of Record
        Heating before cooling; one or two. All cycles of a branch are in one record.
    findings : tuple of Finding
        All that was kept out, averaged, or noticed.

    Raises
    ------
    MeasurementError
        If there is no temperature or no channel to fit, the temperature or every channel is constant, or no branch
        has enough samples.
    """
    settings = settings or SplitSettings()
    _require_columns(run, settings)
    ledger = Ledger(run)
    clean_rows(ledger)
    legs = _find_legs(ledger, settings)
    channels = choose_channels(ledger, legs, settings.fit_channels, settings.min_change)
    if not channels:
        raise ledger.error(
            "no channel has values in most rows of the sweeps",
            expected="force, displacement or stiffness",
            remedy="check the columns of the channels and their codes for missing values",
        )
    _set_aside(ledger, legs, channels, settings)
    for channel in channels:
        clean_channel(ledger, channel)
    inputs = _choose_inputs(ledger)
    legs = _long_enough(ledger, legs, settings.min_samples)
    _refuse_constant(ledger, rows_of(legs), channels)
    _note_quality(ledger, legs, channels)
    records = tuple(
        _record(ledger, branch, [leg for leg in legs if leg.branch is branch], channels, inputs, settings)
        for branch in Branch
        if any(leg.branch is branch for leg in legs)
    )
    return records, tuple(ledger.findings)


def _refuse_constant(ledger: Ledger, rows: Ints, channels: tuple[str, ...]) -> None:
    """Refuse channels that are one number throughout: no curve follows from them, however long one samples."""
    values = {channel: ledger.run.columns[channel][rows] for channel in channels}
    if any(np.ptp(v) > 0.0 for v in values.values()):
        return
    what = " and ".join(f"{ledger.quantity(c)} is {ledger.amount(c, float(v[0]))}" for c, v in values.items())
    raise ledger.error(
        f"{what} in all {rows.size} rows of the sweeps",
        expected="a channel that changes with the temperature",
        remedy="map the column of another channel, or leave the condition out",
    )


def _require_columns(run: Run, settings: SplitSettings) -> None:
    wanted = ("temperature", *(settings.fit_channels or ()))
    absent = [column for column in wanted if column not in run.columns]
    if not absent and any(channel in run.columns for channel in CHANNELS):
        return
    raise MeasurementError(
        f"condition {run.condition.id!r} has the columns {', '.join(run.columns) or 'none'}",
        file=run.file,
        column=absent[0] if absent else None,
        expected="temperature, and the channels to fit: force, displacement, stiffness or those chosen",
        remedy="map the missing column, or choose other channels to fit",
    )


# sweeps


def _find_legs(ledger: Ledger, settings: SplitSettings) -> list[Leg]:
    rows, temperature = ledger.rows, ledger.column("temperature")
    if rows.size < settings.min_samples:
        raise ledger.error(
            f"only {many(rows.size, 'row')} with a usable temperature", column="temperature",
            expected=f"{settings.min_samples} rows or more",
            remedy="check the column and its codes for missing values",
        )  # fmt: skip
    smoothed = smooth(temperature, settings.turn_fraction)
    if "branch" in ledger.run.columns:
        sweeps = sweeps_of_column(ledger.column("branch"))
        why = "the branch column says neither heating nor cooling"
        _keep_out_unswept(ledger, rows, sweeps, "no-branch", why)
        _note_contradictions(ledger, rows, sweeps, smoothed, settings.turn_fraction)
    else:
        sweeps = _sweeps_by_signal(ledger, rows, smoothed, settings)
    sweeps = tuple(s for s in sweeps if s.n >= FEWEST_ROWS_OF_A_SWEEP)
    why = f"sweeps of fewer than {FEWEST_ROWS_OF_A_SWEEP} rows"
    _keep_out_unswept(ledger, rows, sweeps, "few-samples", why)
    if not sweeps:
        raise _no_branch(ledger, settings.min_samples)
    return _numbered(ledger.run, rows, sweeps)


def _sweeps_by_signal(
    ledger: Ledger, rows: Ints, smoothed: Smoothed, settings: SplitSettings
) -> tuple[Sweep, ...]:
    sweeps = _sweeps_between_restarts(ledger, smoothed, settings)
    if not sweeps:
        low, high = float(smoothed.values.min()), float(smoothed.values.max())
        raise ledger.error(
            f"the temperature is constant but for noise, from {ledger.amount('temperature', low)} to "
            f"{ledger.amount('temperature', high)}", column="temperature",
            expected="a heating or a cooling sweep",
            remedy="check that the column is the temperature of the alloy, or leave this condition out",
        )  # fmt: skip
    _keep_out_ends(ledger, rows, sweeps, smoothed, settings.turn_fraction)
    widest = max(span(s, smoothed) for s in sweeps)
    whole = [s for s in sweeps if span(s, smoothed) >= settings.min_span * widest]
    short = len(sweeps) - len(whole)
    why = f"part cycles ({short} in number) that span less than {settings.min_span:.0%} of the widest sweep"
    _keep_out_unswept(ledger, rows, whole, "part-cycle", why)
    for s in whole:
        share = span(s, smoothed) / widest
        if share < PART_CYCLE_SHARE:
            message = f"a {_branch(s).value} sweep spans {share:.0%} of the widest one; it stays in"
            ledger.note(rows[s.start : s.stop], "part-cycle", message, branch=_branch(s).value)
    trimmed = [without_holds(s, smoothed, settings.hold_tolerance, settings.hold_share) for s in whole]
    _keep_out_unswept(ledger, rows, trimmed, "hold", "the temperature stands still before or after a sweep")
    return tuple(trimmed)


def _sweeps_between_restarts(
    ledger: Ledger, smoothed: Smoothed, settings: SplitSettings
) -> tuple[Sweep, ...]:
    """Sweeps of each stretch between restarts of the clock, by the drive where that explains them."""
    time, on = ledger.run.columns.get("time"), _heated(ledger)
    restart = np.flatnonzero(np.diff(time[ledger.kept]) < 0) + 1 if time is not None else ()
    sweeps: list[Sweep] = []
    ignored = 0
    for a, b in pairwise([0, *(int(r) for r in restart), smoothed.values.size]):
        part = replace(smoothed, values=smoothed.values[a:b])
        found = sweeps_of_drive(part, on[a:b], settings.turn_fraction) if on is not None else ()
        if not found:
            found = sweeps_of_temperature(part, settings.turn_fraction)
            ignored += on is not None and bool(found)
            found = with_quiet_ends(found, part, settings.hold_tolerance)
        sweeps += [replace(s, start=s.start + a, stop=s.stop + a) for s in found]
    if ignored and "drive" in ledger.run.columns:
        message = "the drive does not explain the temperature: sweeps are found from the temperature alone"
        ledger.note(ledger.rows[:0], "drive-ignored", message, column="drive")
    return tuple(sweeps)


def _heated(ledger: Ledger) -> Mask | None:
    """When the drive is on, or a current that is switched off and on."""
    column = "drive" if "drive" in ledger.run.columns else "current"
    if column not in ledger.run.columns:
        return None
    values = ledger.column(column)
    if column == "current":
        values = np.abs(np.nan_to_num(values))
        if values.min() >= DRIVE_OFF_SHARE * values.max():
            return None
    on, stray = drive_is_on(values)
    if stray.any():
        message = (
            f"{many(int(stray.sum()), 'row')} in which {column} differs from its neighbours, which outvote it"
        )
        ledger.note(ledger.rows[stray], "stray-drive", message, column=column)
    return on


def _branch(sweep: Sweep) -> Branch:
    return Branch.HEATING if sweep.heating else Branch.COOLING


def _covered(size: int, sweeps: Iterable[Sweep]) -> Mask:
    covered = np.zeros(size, dtype=bool)
    for s in sweeps:
        covered[s.start : s.stop] = True
    return covered


def _keep_out_unswept(ledger: Ledger, rows: Ints, sweeps: Iterable[Sweep], kind: str, why: str) -> None:
    ledger.keep_out(rows[~_covered(rows.size, sweeps)], kind, why)


def _keep_out_ends(
    ledger: Ledger, rows: Ints, sweeps: tuple[Sweep, ...], smoothed: Smoothed, turn_fraction: float
) -> None:
    """Keep out what no turning point bounds: a hold, or the rest of a sweep."""
    switch = np.diff((~_covered(rows.size, sweeps)).astype(np.int8), prepend=0, append=0)
    moving = 0.5 * turn_fraction * float(np.ptp(smoothed.values))
    for a, b in zip(np.flatnonzero(switch > 0), np.flatnonzero(switch < 0), strict=True):
        if abs(smoothed.values[b - 1] - smoothed.values[a]) > moving:
            why = "the beginning or end of a sweep of which the rest was not recorded"
            ledger.keep_out(rows[a:b], "part-cycle", why)
        else:
            ledger.keep_out(rows[a:b], "hold", "the temperature stands still before or after a sweep")


def _note_contradictions(
    ledger: Ledger, rows: Ints, sweeps: tuple[Sweep, ...], smoothed: Smoothed, turn_fraction: float
) -> None:
    least = threshold_of_a_turn(smoothed, turn_fraction)
    for s in sweeps:
        onwards = smoothed.values[s.start : s.stop] * (1.0 if s.heating else -1.0)
        back = float(np.max(np.maximum.accumulate(onwards) - onwards))
        if back > least:
            name, against = _branch(s).value, "falls" if s.heating else "rises"
            message = (
                f"branch says {name}, but the temperature {against} by "
                f"{ledger.amount('temperature', back, difference=True, digits=4)}"
            )
            message += "; the column is believed"
            ledger.note(rows[s.start : s.stop], "branch-contradicted", message, column="branch", branch=name)


def _numbered(run: Run, rows: Ints, sweeps: tuple[Sweep, ...]) -> list[Leg]:
    """Number the sweeps, and the cycles by their column, else by the sweeps that go the way of the first."""
    cycle, legs = 0, []
    column = run.columns.get("cycle")
    for number, s in enumerate(sweeps, start=1):
        cycle += s.heating == sweeps[0].heating
        index = rows[s.start : s.stop]
        told = column[index][np.isfinite(column[index])] if column is not None else index[:0]
        legs.append(Leg(_branch(s), index, int(np.median(told)) if told.size else cycle, number))
    return legs


# channels and inputs


def _set_aside(ledger: Ledger, legs: list[Leg], channels: tuple[str, ...], settings: SplitSettings) -> None:
    told = settings.fit_channels is not None
    for channel in held_channels(ledger.run, rows_of(legs), channels):
        note_held(ledger, legs, channel, told=told, min_change=settings.min_change)
        if channel == "force" and not told:
            keep_out_load_off(ledger, legs)


def _choose_inputs(ledger: Ledger) -> tuple[str, ...]:
    """Inputs that records carry: a row that lacks one is kept out, one that most rows lack is left out."""
    chosen = []
    for name in OPTIONAL_INPUTS:
        if name not in ledger.run.columns or not ledger.rows.size:
            continue
        missing = ~np.isfinite(ledger.column(name))
        if missing.mean() > 1.0 - MAX_SHARE_MISSING:
            message = f"{name} is missing in {missing.mean():.0%} of the rows and is left out"
            ledger.note(ledger.rows[:0], "sparse-input", message, column=name)
        else:
            ledger.keep_out(ledger.rows[missing], "missing", f"no {name}", column=name)
            chosen.append(name)
    return tuple(chosen)


def _long_enough(ledger: Ledger, legs: list[Leg], least: int) -> list[Leg]:
    """Legs without the rows that were kept out since, of branches with enough rows."""
    legs = [replace(leg, rows=leg.rows[ledger.kept[leg.rows]]) for leg in legs]
    for branch in Branch:
        rows = rows_of(legs, branch)
        if rows.size < least:
            why = f"the {branch.value} branch has fewer than {least} rows"
            ledger.keep_out(rows, "few-samples", why, branch=branch.value)
    legs = [leg for leg in legs if leg.rows.size and ledger.kept[leg.rows].all()]
    if not legs:
        raise _no_branch(ledger, least)
    found = {leg.branch for leg in legs}
    if len(found) == 1:
        (only,) = found
        ends = ledger.run.columns["temperature"][legs[0].rows[[0, -1]]]
        course = " to ".join(ledger.amount("temperature", float(t), digits=4) for t in ends)
        message = (
            f"there is a {only.value} branch only, from {course}; it is fitted alone, and nothing follows about "
            "hysteresis, for which the way back has to be recorded too; where that stands in another file, declare "
            "both as one condition: file = [..., ...]"
        )
        ledger.note(ledger.rows[:0], "one-branch", message)
    return legs


def _no_branch(ledger: Ledger, least: int) -> MeasurementError:
    return ledger.error(
        f"no branch has {least} usable rows",
        expected="a heating or cooling sweep with more samples than the model has parameters",
        remedy="check the columns of this condition, or leave it out",
    )


def _note_quality(ledger: Ledger, legs: list[Leg], channels: tuple[str, ...]) -> None:
    run = ledger.run
    rows = np.sort(rows_of(legs))
    for column in ("temperature", *channels):
        note_digits(ledger, column, rows)
    for channel in channels:
        note_no_transformation(ledger, legs, channel)
    _note_temperature(ledger, rows)
    _note_stuck(ledger, legs)
    _note_steps(ledger, rows)
    swept = float(np.ptp(run.columns["temperature"][rows]))
    if run.units.get("temperature") == "degC" and swept < MAX_DRIFT:
        by = ledger.amount("temperature", swept, difference=True, digits=4)
        message = f"the temperature hardly varies, by {by} in all: a drift, no sweep"
        ledger.note(rows[:0], "narrow-sweep", message, column="temperature")
    time = run.columns.get("time")
    for branch in Branch:
        after = [
            leg.rows[gaps(None if time is None else time[leg.rows], run.columns["temperature"][leg.rows])]
            for leg in legs
            if leg.branch is branch
        ]
        index = np.concatenate(after) if after else rows[:0]
        if index.size:
            message = "gaps in time or temperature; the rows listed are the first after them"
            ledger.note(index, "gap", message, branch=branch.value)


def _note_stuck(ledger: Ledger, legs: Sequence[Leg]) -> None:
    """Report where the thermometer stood still and caught up by a jump: these temperatures are wrong."""
    temperature = ledger.run.columns["temperature"]
    for leg in legs:
        for still in stuck(temperature[leg.rows]):
            rows = leg.rows[still.start : still.stop]
            jump = abs(float(temperature[leg.rows[still.stop]]) - still.value)
            by = ledger.amount("temperature", jump, difference=True, digits=3)
            message = (
                f"temperature reads {ledger.amount('temperature', still.value)} in {still.count} rows in sequence, "
                f"then jumps by {by}, as a thermometer that is "
                "stuck does; the rows stay in, and their temperatures are wrong: declare that reading as `missing`"
            )
            ledger.note(rows, "stuck", message, column="temperature", branch=leg.branch.value)


def _note_steps(ledger: Ledger, rows: Ints) -> None:
    """Report a force that stands still during each sweep and is another in the next."""
    run = ledger.run
    if "force" not in run.columns:
        return
    steps = levels(run.columns["force"][rows], run.columns["temperature"][rows])
    if not steps:
        return
    course = ", ".join(
        f"{ledger.amount('force', s.value)} in rows {run.row[rows[s.start]]} to {run.row[rows[s.stop - 1]]}"
        for s in steps
    )
    message = (
        f"{ledger.quantity('force')} changes in steps: {course}; if that is the load, each is a condition of its own: "
        "cut them apart by first_row and last_row"
    )
    ledger.note(rows[[s.start for s in steps]], "load-steps", message, column="force")


def _note_temperature(ledger: Ledger, rows: Ints) -> None:
    """Report a temperature that is more likely in kelvin, or the number of the row."""
    temperature = ledger.run.columns["temperature"]
    swept = temperature[rows]
    if ledger.run.units.get("temperature") == "degC" and looks_like_kelvin(swept):
        low, high = (ledger.amount("temperature", float(t), digits=4) for t in (swept.min(), swept.max()))
        message = f'temperatures from {low} to {high} look like kelvin; if so, declare unit = "kelvin"'
        ledger.note(rows[:0], "kelvin", message, column="temperature")
    if are_row_numbers(temperature):
        message = (
            "the temperature counts the rows, 1 more in each: the column is no thermometer's, and nothing that follows "
            "means anything; map another column"
        )
        ledger.note(rows[:0], "row-numbers", message, column="temperature")


# records


def _record(
    ledger: Ledger,
    branch: Branch,
    legs: Sequence[Leg],
    channels: tuple[str, ...],
    optional: tuple[str, ...],
    settings: SplitSettings,
) -> Record:
    run, rows = ledger.run, rows_of(legs)
    length = [leg.rows.size for leg in legs]
    segment = np.repeat([float(leg.segment) for leg in legs], length)
    blocks = blocks_of(run.columns["temperature"][rows], segment, settings.max_samples, settings.block_span)
    _note_reduction(ledger, branch, blocks, rows, settings)
    inputs = {name: average(run.columns[name][rows], blocks) for name in ("temperature", *optional)}
    sums = _delivered(run, optional)
    inputs |= {name: average(values[rows], blocks) for name, values in sums.items()}
    inputs["cycle"] = np.repeat([float(leg.cycle) for leg in legs], length)[blocks.first]
    inputs["segment"] = segment[blocks.first]
    held = held_channels(run, rows, channels)
    return Record(
        condition=run.condition,
        branch=branch,
        inputs=inputs,
        observed={name: average(run.columns[name][rows], blocks) for name in channels},
        row=run.row[rows[blocks.first]],
        units={
            **{n: run.units[n] for n in (*inputs, *channels, *held) if n in run.units},
            **_COUNTED,
            **dict.fromkeys(sums, "A^2 s"),
            **({"resistance": "ohm"} if "resistance" in sums else {}),
        },
        specimen=run.specimen,
        temperature_sd=run.temperature_sd,
        calibration=run.calibration,
        held=held,
        rows_averaged=blocks.largest,
        source=run.file,
        declared_units=run.declared_units,
    )


_COUNTED: Final = {"cycle": "1", "segment": "1"}


def _delivered(run: Run, optional: tuple[str, ...]) -> dict[str, Floats]:
    """What the current has delivered by each row of a run, NaN where a row lacks time or current.

    Where resistance or voltage were recorded, the resistance beside it.
    """
    if not {"time", "current"} <= set(optional):
        return {}
    time, current = run.columns["time"], run.columns["current"]
    known = np.flatnonzero(np.isfinite(time) & np.isfinite(current))
    out = _resistance(run, current)
    for name, values in delivered(time[known], current[known] ** 2).items():
        out[name] = np.full(time.size, np.nan)
        out[name][known] = values
    return out


def _resistance(run: Run, current: Floats) -> dict[str, Floats]:
    """Resistance at each row [ohm]; where it is not known, as without a current, that of the nearest rows."""
    if "resistance" in run.columns:
        found = run.columns["resistance"]
    elif "voltage" in run.columns:
        on = np.abs(current) > DRIVE_OFF_SHARE * np.nanmax(np.abs(current), initial=0.0)
        found = np.where(on, run.columns["voltage"] / np.where(on, current, 1.0), np.nan)
    else:
        return {}
    known = np.flatnonzero(np.isfinite(found) & (found > 0.0))
    return {"resistance": np.interp(np.arange(found.size), known, found[known])} if known.size else {}


def _note_reduction(
    ledger: Ledger, branch: Branch, blocks: Blocks, rows: Ints, settings: SplitSettings
) -> None:
    too_many = f"more than {settings.max_samples}, as none may span over {settings.block_span:g} of the sweep"
    if blocks.largest > 1:
        message = (
            f"{many(blocks.rows, 'row')} are averaged to {blocks.n} samples of up to {blocks.largest} rows in "
            "sequence; noise and correlation are those of the averages"
        )
        message += f"; {too_many}" if blocks.n > settings.max_samples else ""
        ledger.note(rows, "reduced", message, branch=branch.value)
    elif blocks.n > settings.max_samples:
        ledger.note(rows, "not-reduced", f"{blocks.n} samples, {too_many}", branch=branch.value)
