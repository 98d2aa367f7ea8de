"""From the columns of a file to a run: found by name or number, calibrated, in canonical units."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np

from sma_bayes.arrays import Floats, Ints
from sma_bayes.errors import CampaignError, MeasurementError, QuantityError, many, near_matches
from sma_bayes.quantities import (
    ARBITRARY,
    CHANNELS,
    QUANTITIES,
    STANDARD_GRAVITY,
    can_convert,
    convert,
    unit_text,
)
from sma_bayes.records.clock import clock_seconds, is_clock
from sma_bayes.records.declaration import (
    CHANNEL_OF,
    SETTING_COLUMNS,
    ColumnDeclaration,
    DeclaredCondition,
    require_channels,
)
from sma_bayes.records.default_names import EXAMPLES, described, lacks_unit, not_recognised, recognised
from sma_bayes.records.formats import RawTable, read_table
from sma_bayes.records.formats.numbers import numbers
from sma_bayes.records.formats.table import Cells, rows_finding
from sma_bayes.records.guesses import near_quantity
from sma_bayes.records.joining import FileColumns, joined
from sma_bayes.records.quality import levels
from sma_bayes.records.run import Run
from sma_bayes.records.types import Branch, Calibration, Condition, Finding, setting_unit

_BRANCH_SIGN = {Branch.HEATING.value: 1.0, Branch.COOLING.value: -1.0}
CLOCKS: Final = frozenset(
    {"time", "timestamp", "clock", "clock time", "datetime", "date time", "date_time", "date/time"}
)
"""Headers, in small letters, of a column of clock times that is known by its name."""

SETTING_TOLERANCE: Final = 0.05
"""A setting that varies by less than this share of itself is one setting."""

ROWS_SHOWN, COLUMNS_SHOWN = 3, 8
"""Rows and columns of a file without a header that a message shows."""

_BRANCHES = "heating or cooling, or 1 or -1"


def read_run(declared: DeclaredCondition) -> tuple[Run, tuple[Finding, ...]]:
    """Read the run of one condition.

    Returns
    -------
    run : Run
        In canonical units, NaN where a value is missing.
    findings : tuple of Finding
        What was left out, and what was taken as missing.

    Raises
    ------
    MeasurementError
        If the file or a value in it can't be used.
    CampaignError
        If a declared column is not there, or the load is not of the kind that was measured.
    QuantityError
        If a unit is unknown or of the wrong kind.
    """
    return run_of_tables(declared, [read_table(path, declared.reading) for path in declared.paths])


def run_of_tables(declared: DeclaredCondition, tables: Sequence[RawTable]) -> tuple[Run, tuple[Finding, ...]]:
    """The same from what the files hold, one table for each; see `read_run`."""
    parts = zip(declared.of_each_file(), tables, strict=True)
    files = [_file_columns(part, table, alone=len(tables) == 1) for part, table in parts]
    _require_all(files, declared)
    whole, how = joined(files)
    values = dict(whole.values)
    settings = {q: values.pop(q) for q in SETTING_COLUMNS if q in values}
    columns = {q: c for q, c in whole.columns.items() if q in values}
    if whole.clock:
        values["time"] = values["time"] - np.nanmin(values["time"])
    specimen = not CHANNEL_OF.keys().isdisjoint(columns)
    unfit = () if declared.columns else _without_unfit_load(settings, whole.columns, specimen)
    condition, told = _with_columns(_condition(declared, specimen=specimen), settings, whole.row, specimen)
    run = Run(
        condition=condition,
        file=declared.title,
        row=whole.row,
        columns={CHANNEL_OF.get(quantity, quantity): v for quantity, v in values.items()},
        units={CHANNEL_OF.get(q, q): canonical_unit(q, column) for q, column in columns.items()},
        declared_units={
            channel: column.calibrated_unit
            for q, column in columns.items()
            if (channel := CHANNEL_OF.get(q, q)) in (*CHANNELS, "temperature")
        }
        | {q: whole.columns[q].calibrated_unit for q in settings}
        | declared.table.declared_units,
        specimen=specimen,
        temperature_sd=(columns["temperature"].sd or 0.0) * _affine("temperature", columns["temperature"])[0],
        calibration={
            CHANNEL_OF.get(quantity, quantity): calibration
            for quantity, column in columns.items()
            if (calibration := _calibration(quantity, column)) is not None
        },
    )
    run, cut = _within_window(run, declared)
    seen = [replace(f, file=file.name) for file in files for f in file.findings]
    seen += [replace(f, file=declared.title) for f in (*how, *unfit, *told, *cut)]
    return run, tuple(replace(finding, condition=declared.table.id) for finding in seen)


def _file_columns(declared: DeclaredCondition, table: RawTable, *, alone: bool) -> FileColumns:
    """Columns of one file of a condition; where there are others it need not have all."""
    findings = list(table.findings)
    columns: Mapping[str, ColumnDeclaration] = {q: entries[0] for q, entries in declared.columns.items()}
    if not columns:
        columns, seen = _by_default_names(table, declared, alone=alone)
        findings += (seen, *_nearly_named(columns, table))
    elif not alone:
        columns = {q: c for q, c in columns.items() if _has_column(c, table)}
    values: dict[str, Floats] = {}
    clock = False
    for quantity, column in columns.items():
        is_time = quantity == "time" and column.row_interval is None
        if is_time and is_clock(table.columns[_index(quantity, column, table, declared)]):
            values[quantity], clock = _clock(column, table, declared), True
            continue
        if is_time and column.unit is None:
            raise CampaignError(
                "no unit",
                file=declared.declared_in,
                column=_place(quantity, declared),
                expected='unit = "s" or another unit of time; only a clock such as 12:34:56 needs none',
            )
        values[quantity], seen_here = _canonical(quantity, column, table, declared)
        findings += seen_here
    row = table.row[: _common_length(values, declared)] if values else table.row
    return FileColumns(declared.path, declared.names[0], row, columns, values, clock, tuple(findings))


def _has_column(column: ColumnDeclaration, table: RawTable) -> bool:
    """Whether a file has a column."""
    if column.name is not None:
        return " ".join(column.name.split()) in (table.names or ())
    return column.column is None or column.column <= len(table.columns)


def _require_all(files: Sequence[FileColumns], declared: DeclaredCondition) -> None:
    """Check that together the files of a condition have what was declared, or by their names what a record needs."""
    there = {q for f in files for q in f.values}
    for quantity, entries in declared.columns.items():
        if quantity not in there:
            raise CampaignError(
                f"none of {many(len(files), 'file')} has a column {entries[0].name or entries[0].column!r}",
                file=declared.declared_in,
                column=_place(quantity, declared),
                expected="a column of one of " + ", ".join(f.name for f in files),
            )
    if not declared.columns and len(files) > 1:
        require_channels(there, file=declared.declared_in, where=f"{declared.where}.file")


def _clock(column: ColumnDeclaration, table: RawTable, declared: DeclaredCondition) -> Floats:
    """Time by the clock, shifted by the declared offset [s]."""
    index = _index("time", column, table, declared)
    cells = table.columns[index]
    seconds = clock_seconds(
        list(cells), table.row[: len(cells)], file=declared.path, column=table.shown_names[index]
    )
    return seconds + float(convert(column.offset or 0.0, column.to or column.unit or "s", "s", what="time"))


def _nearly_named(columns: Mapping[str, ColumnDeclaration], table: RawTable) -> tuple[Finding, ...]:
    """Finding about columns that are not used, although they are nearly called as a quantity that is not there."""
    specimen = not CHANNEL_OF.keys().isdisjoint(columns)
    absent = (
        {*QUANTITIES, *SETTING_COLUMNS} - set(columns) - set(CHANNELS if specimen else CHANNEL_OF) - {"drive"}
    )
    used = {c.name for c in columns.values()}
    near = [(name, near_quantity(name)) for name in table.names or () if name and name not in used]
    found = [(name, quantity) for name, quantity in near if quantity in absent]
    if not found:
        return ()
    what = ", ".join(f"{name!r} (a {quantity}?)" for name, quantity in found)
    message = (
        f"not used, although the name is nearly that of a quantity: {what}; rename the column, or name it under "
        "[columns] in a campaign.toml"
    )
    return (Finding("unused-column", message, column=found[0][0]),)


def _without_unfit_load(
    settings: dict[str, Floats], columns: Mapping[str, ColumnDeclaration], specimen: bool
) -> tuple[Finding, ...]:
    """Take away a load, known by its name, that is a force or mass beside a specimen or a stress beside a spring."""
    if "load" not in settings or can_convert(columns["load"].calibrated_unit, "Pa") == specimen:
        return ()
    del settings["load"]
    name = columns["load"].name or "load"
    expected = (
        "the load of a specimen is a stress" if specimen else "the load of a spring is a force or a mass"
    )
    message = f"not used: {name!r} [{unit_text(columns['load'].calibrated_unit)}]; {expected}"
    return (Finding("unused-column", message, column=name),)


def _with_columns(
    condition: Condition,
    settings: Mapping[str, Floats],
    row: Ints,
    specimen: bool,
) -> tuple[Condition, tuple[Finding, ...]]:
    """Condition with settings that stand in columns, as far as it does not state them itself."""
    findings: list[Finding] = []
    for setting, values in settings.items():
        usual = float(np.nanmedian(values))
        stated = getattr(condition, setting)
        unit = unit_text(setting_unit(setting, specimen=specimen))
        low, high = float(np.nanmin(values)), float(np.nanmax(values))
        if high - low > SETTING_TOLERANCE * abs(usual):
            steps = levels(values)
            course = (
                ", ".join(f"{s.value:.4g} {unit} in rows {row[s.start]} to {row[s.stop - 1]}" for s in steps)
                or f"from {low:.4g} to {high:.4g} {unit}"
            )
            how = "changes in steps" if steps else "varies"
            message = (
                f"{setting.replace('_', ' ')} {how} within one condition: {course}; its "
                f"median {usual:.4g} {unit} is taken; make a condition of each stretch by first_row and last_row"
            )
            findings.append(Finding("load-steps" if steps else "setting-varies", message, column=setting))
        if stated is None:
            changes: dict[str, Any] = {setting: usual}
            condition = replace(condition, **changes)
        elif abs(stated - usual) > SETTING_TOLERANCE * abs(usual):
            message = f"{setting} is declared as {stated:.4g} {unit} and is taken so; its column has {usual:.4g} {unit}"
            findings.append(Finding("setting-contradicted", message, column=setting))
    return condition, tuple(findings)


def canonical_unit(quantity: str, column: ColumnDeclaration) -> str:
    """Unit in which a quantity is kept: canonical, or as declared where there is nothing to convert."""
    unit = column.calibrated_unit
    if quantity in SETTING_COLUMNS:
        return SETTING_COLUMNS[quantity]
    return unit if unit == ARBITRARY or quantity == "drive" else QUANTITIES[quantity].unit


def _by_default_names(
    table: RawTable, declared: DeclaredCondition, *, alone: bool
) -> tuple[dict[str, ColumnDeclaration], Finding]:
    """Columns known by their default names, and a finding that says which."""
    columns: dict[str, ColumnDeclaration] = {}
    found: list[tuple[str, str, str]] = []
    names = table.names or ()
    for header, whole, cells in zip(names, table.headers, table.columns, strict=bool(names)):
        known = (
            recognised(header)
            or recognised(whole)
            or (("time", "s") if header.strip().lower() in CLOCKS and is_clock(cells) else None)
        )
        if known is None:
            continue
        quantity, unit = known
        if quantity in columns:
            raise CampaignError(
                f"the columns {columns[quantity].name!r} and {header!r} are both a {quantity}",
                file=declared.path,
                expected=f"one {quantity}",
                remedy="rename one of them, or write a campaign.toml that says which to take",
            )
        columns[quantity] = ColumnDeclaration(name=header, unit=unit)
        found.append((header, quantity, unit))
    if alone:
        _require_named(columns, table, declared)
    unused = [name for name in table.names or () if name and name not in {header for header, _, _ in found}]
    return columns, Finding("recognised", described(found, unused))


def _require_named(
    columns: Mapping[str, ColumnDeclaration], table: RawTable, declared: DeclaredCondition
) -> None:
    """Check that the columns that are known by their names make a record."""
    try:
        require_channels(columns, file=declared.path, where="header")
    except CampaignError as error:
        taken = {c.name for c in columns.values()}
        headers = list(zip(table.headers, table.names or (), strict=True))
        there = ", ".join(repr(h) if name in taken else not_recognised(h) for h, name in headers)
        what = f"has {there}" if there else _headless(table)
        remedy = "rename the columns, or let `sma-bayes init` write a campaign.toml with [columns]"
        if bare := [h for h, name in headers if name not in taken and lacks_unit(h)]:
            named = ", ".join(map(repr, bare))
            remedy = f"write the unit behind the name, as in force_N or strain_percent ({named}); or {remedy}"
        if not there and _split_decimals(table):
            remedy = (
                "every second column looks like the decimals of the one before: write points for decimal commas, or "
                f"semicolons between columns; else {remedy}"
            )
        if "temperature" not in columns:
            remedy += "; data without a temperature can't be used: the curves are functions of temperature"
        raise CampaignError(
            error.found.replace("declared", "among the columns"),
            file=declared.path,
            expected=f"column names such as {', '.join(EXAMPLES)}; the file {what}",
            remedy=remedy,
        ) from None


def _split_decimals(table: RawTable) -> bool:
    """Whether every second column has digits alone, as many in all rows, as decimal commas between commas leave it."""
    parts = [[str(cell).strip() for cell in cells] for cells in table.columns[1::2]]
    return (
        len(table.columns) % 2 == 0
        and bool(parts)
        and all(all(cell.isdigit() for cell in cells) and len(set(map(len, cells))) == 1 for cells in parts)
        and any(len(cells[0]) > 1 for cells in parts)
    )


def _headless(table: RawTable) -> str:
    """What a file without a header has: how many columns, and its first rows."""
    width = len(table.columns)
    rows = [
        " ".join(str(cells[i]).strip() if i < len(cells) else "" for cells in table.columns[:COLUMNS_SHOWN])
        + (" ..." if width > COLUMNS_SHOWN else "")
        for i in range(min(ROWS_SHOWN, table.row.size))
    ]
    return f"has no header but {many(width, 'column')}, which begin: {' | '.join(rows)}"


def _canonical(
    quantity: str, column: ColumnDeclaration, table: RawTable, declared: DeclaredCondition
) -> tuple[Floats, tuple[Finding, ...]]:
    """Values of one quantity in canonical unit, shape (n,)."""
    findings: tuple[Finding, ...] = ()
    if column.row_interval is not None:
        reading = column.row_interval * np.arange(table.row.size, dtype=np.float64)
    else:
        index = _index(quantity, column, table, declared)
        title = table.shown_names[index]
        cells = table.columns[index]
        row = table.row[: len(cells)]
        is_branch = quantity == "branch"
        reading, findings = numbers(
            _signs(cells) if is_branch else cells,
            row,
            file=declared.path,
            column=title,
            missing=(*declared.reading.missing, *column.missing),
            decimal=table.decimal or declared.reading.decimal,
            expected=_BRANCHES if is_branch else "a number",
        )
        if is_branch:
            _require_signs(reading, row, declared, title)
        reading, outside = _within_limits(reading, row, column, title)
        findings += outside
    with np.errstate(over="ignore"):  # refused as soon as the run is read
        value = (1.0 if column.scale is None else column.scale) * reading + (column.offset or 0.0)
    unit = canonical_unit(quantity, column)
    try:
        if quantity == "load":
            return _weight(value, column.calibrated_unit, declared), findings
        return convert(value, column.calibrated_unit, unit, what=quantity), findings
    except QuantityError as error:
        place = f"{_place(quantity, declared)}.{'to' if column.to else 'unit'}"
        raise error.but(file=declared.declared_in, column=place) from None


def _weight(value: Floats, unit: str, declared: DeclaredCondition) -> Floats:
    """Load [N] of a mass, which is turned into its weight, or of a force; of a specimen a stress [Pa].

    Without declared columns the unit tells which; see `_without_unfit_load`.
    """
    specimen = not CHANNEL_OF.keys().isdisjoint(declared.columns)
    if specimen or (not declared.columns and can_convert(unit, "Pa")):
        return convert(value, unit, "Pa", what="load")
    try:
        return STANDARD_GRAVITY * convert(value, unit, "kg", what="load")
    except QuantityError:
        return convert(value, unit, "N", what="load")


def _index(quantity: str, column: ColumnDeclaration, table: RawTable, declared: DeclaredCondition) -> int:
    """Which column of the file a declared column is, from 0."""
    there = ", ".join(repr(name) for name in table.shown_names)
    where = _place(quantity, declared)
    if column.column is not None:
        if column.column <= len(table.columns):
            return column.column - 1
        raise CampaignError(
            f"{declared.names[0]!r} has no column {column.column}",
            file=declared.declared_in,
            column=where,
            expected=f"a number from 1 to {len(table.columns)}: {there}",
        )
    name = " ".join((column.name or "").split())
    found = [i for i, title in enumerate(table.names or ()) if title == name]
    if len(found) == 1:
        return found[0]
    if table.names is None:
        raise CampaignError(
            f"{declared.names[0]!r} has no header, so no column {name!r}",
            file=declared.declared_in,
            column=where,
            expected=f"a number from 1 to {len(table.columns)}; the file {_headless(table)}",
            remedy="give the column by its number, { column = 2, unit = ... }; if there is a header, set "
            "header = true and perhaps skip_rows in [reading] of campaign.toml",
        )
    if found:
        numbers_there = " and ".join(str(i + 1) for i in found)
        raise CampaignError(
            f"{declared.names[0]!r} has {len(found)} columns called {name!r}",
            file=declared.declared_in,
            column=where,
            expected="a name that occurs once",
            remedy=f"give the column by its number: {numbers_there}",
        )
    raise CampaignError(
        f"{declared.names[0]!r} has no column {name!r}",
        file=declared.declared_in,
        column=where,
        expected=near_matches(name, [title for title in table.names if title]),
        remedy=f"correct the name; the columns are {there}",
    )


def _signs(cells: Cells) -> Cells:
    """Column of branches with heating as +1 and cooling as -1; other cells as they are."""
    if isinstance(cells, np.ndarray):
        return cells
    return [_BRANCH_SIGN.get(cell.strip().lower(), cell) if isinstance(cell, str) else cell for cell in cells]


def _require_signs(values: Floats, row: Ints, declared: DeclaredCondition, title: str) -> None:
    wrong = np.flatnonzero(np.isfinite(values) & (np.abs(values) != 1))
    if wrong.size:
        raise MeasurementError(
            f"found {values[wrong[0]]:g}",
            file=declared.path,
            row=int(row[wrong[0]]),
            column=title,
            expected=_BRANCHES,
            remedy="correct the cell; leave it empty where the branch isn't known",
        )


def _within_limits(
    reading: Floats, row: Ints, column: ColumnDeclaration, title: str
) -> tuple[Floats, tuple[Finding, ...]]:
    """Readings, NaN where outside the declared limits."""
    if column.valid is None:
        return reading, ()
    low, high = column.valid
    outside = (reading < low) | (reading > high)
    if not outside.any():
        return reading, ()
    message = (
        f"{many(int(outside.sum()), 'reading')} of {title!r} outside {low:g} to {high:g}, taken as missing"
    )
    return np.where(outside, np.nan, reading), (
        rows_finding("out-of-range", message, row[outside], column=title),
    )


def _affine(quantity: str, column: ColumnDeclaration) -> tuple[float, float]:
    """Slope and intercept of the conversion from the calibrated to the canonical unit."""
    unit, to = column.calibrated_unit, canonical_unit(quantity, column)
    zero, one = (float(v) for v in convert(np.array([0.0, 1.0]), unit, to, what=quantity))
    return one - zero, zero


def _calibration(quantity: str, column: ColumnDeclaration) -> Calibration | None:
    """Uncertainty of a calibration line, in canonical unit.

    The line is F = offset + scale r for a reading r. At the reference reading r0 the errors of scale and
    offset are independent: dF = d(offset) + d(scale) (r - r0) = d(offset) + (d(scale) / scale) (F - F(r0)).
    """
    if column.scale_sd is None and column.offset_sd is None:
        return None
    slope, zero = _affine(quantity, column)
    scale = 1.0 if column.scale is None else column.scale
    at_reference = scale * column.reference + (column.offset or 0.0)
    return Calibration(
        relative_scale_sd=(column.scale_sd or 0.0) / abs(scale),
        offset=slope * at_reference + zero,
        offset_sd=slope * (column.offset_sd or 0.0),
    )


def _condition(declared: DeclaredCondition, *, specimen: bool) -> Condition:
    try:
        return declared.table.condition(specimen=specimen)
    except ValueError as error:
        raise CampaignError(
            "the load is not of the kind that was measured",
            file=declared.declared_in,
            column=declared.where,
            expected=str(error),
            remedy="give the load in that form, or leave it out",
        ) from None


def _place(quantity: str, declared: DeclaredCondition) -> str:
    """Where a column was declared, for messages."""
    own = quantity in declared.table.columns
    return f"{declared.where}.columns.{quantity}" if own else f"columns.{quantity}"


def _common_length(values: Mapping[str, Floats], declared: DeclaredCondition) -> int:
    lengths = {quantity: len(v) for quantity, v in values.items()}
    if len(set(lengths.values())) > 1:
        raise MeasurementError(
            "columns of different lengths: " + ", ".join(f"{q} {n}" for q, n in lengths.items()),
            file=declared.path,
            expected="one value of each quantity a sample",
            remedy="map columns that were recorded together",
        )
    return next(iter(lengths.values()))


def _within_window(run: Run, declared: DeclaredCondition) -> tuple[Run, tuple[Finding, ...]]:
    """Run between ``time_from`` and ``time_to``; rows without a time stay."""
    low, high = declared.window.time_from, declared.window.time_to
    if low is None and high is None:
        return run, ()
    limits = f"time_from = {low or 0:g} s, time_to = {'the end' if high is None else f'{high:g} s'}"
    time = run.columns.get("time")
    if time is None:
        raise CampaignError(
            f"{limits} without a time",
            file=declared.declared_in,
            column=f"{declared.where}.segmentation",
            expected="a column of time",
            remedy='declare time under [columns], for example { row_interval = 0.1, unit = "s" }, or use '
            "first_row and last_row in [reading] of campaign.toml",
        )
    out = np.zeros(run.n, dtype=bool)
    if low is not None:
        out |= time < low
    if high is not None:
        out |= time > high
    if not out.any():
        return run, ()
    if out.all():
        raise MeasurementError(
            f"no row is left by {limits}",
            file=declared.path,
            expected=f"limits within {np.nanmin(time):g} s to {np.nanmax(time):g} s",
            remedy="correct time_from and time_to in [segmentation]",
        )
    message = f"{many(int(out.sum()), 'row')} outside {limits}, left out as declared"
    return run.take(~out), (rows_finding("cut", message, run.row[out], dropped=int(out.sum())),)
