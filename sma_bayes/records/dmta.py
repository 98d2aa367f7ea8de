"""Exports of dynamic mechanical (thermal) analysis: storage and loss modulus against temperature, by frequency.

Columns are known by the names that instruments give them: TRIOS and Universal Analysis of TA Instruments (a row of
units below the names, or numbered signals above the data), Proteus of NETZSCH (``E'(1.000 Hz)/MPa``), Pyris of
PerkinElmer, STARe of Mettler Toledo, RheoCompass of Anton Paar. Any other name is declared. A file may hold several
steps, a workbook several sheets, a step several frequencies in turn.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from sma_bayes.arrays import Floats, Ints
from sma_bayes.document_part import DocumentPart, Number, NumberOrNull
from sma_bayes.errors import (
    MeasurementError,
    QuantityError,
    ReadingError,
    SmaBayesError,
    many,
    near_matches,
    require_known,
    without_campaign,
)
from sma_bayes.limits import SETTING
from sma_bayes.quantities import can_convert, convert
from sma_bayes.records.formats import RawTable, Reading, read_table, recognise
from sma_bayes.records.formats.delimited import text_lines
from sma_bayes.records.formats.numbers import is_blank, looks_numeric, numbers
from sma_bayes.records.formats.table import rows_finding
from sma_bayes.records.formats.xlsx import sheet_titles
from sma_bayes.records.plausibility import implausible, require_possible
from sma_bayes.records.run import Run
from sma_bayes.records.split import SplitSettings, split_run
from sma_bayes.records.types import Branch, Condition, Finding, Record

UNITS: Final = {
    "temperature": "degC", "storage_modulus": "Pa", "loss_modulus": "Pa", "tan_delta": "1", "frequency": "Hz",
    "time": "s",
}  # fmt: skip
"""Quantities of an export with the units that they are kept in."""
NAMES: Final[Mapping[str, frozenset[str]]] = {
    "temperature": frozenset({"temperature", "temp", "sampletemperature", "sampletemp"}),
    "storage_modulus": frozenset({
        "storagemodulus", "e'", "g'", "m'", "modulus'", "moduluse'", "modulusg'", "storagemoduluse'",
        "storagemodulusg'", "modulusstorage", "tensilestoragemodulus", "flexuralstoragemodulus",
        "shearstoragemodulus",
    }),
    "loss_modulus": frozenset({
        "lossmodulus", "e''", "g''", "m''", "modulus''", "moduluse''", "modulusg''", "lossmoduluse''", "lossmodulusg''",
        "modulusloss", "tensilelossmodulus", "flexurallossmodulus", "shearlossmodulus",
    }),
    "tan_delta": frozenset({"tandelta", "tan(delta)", "tand", "lossfactor", "losstangent", "dampingfactor"}),
    "frequency": frozenset({"frequency", "freq", "testfrequency", "oscillationfrequency"}),
    "time": frozenset({"time", "testtime", "elapsedtime"}),
}  # fmt: skip
"""Names of columns, in small letters without blanks, dots, hyphens and underscores."""
ANGULAR: Final = frozenset({"angularfrequency", "omega", "ω"})
LETTERS: Final = {"T": "temperature", "Ts": "temperature", "t": "time", "f": "frequency"}
"""Names of which the case matters."""
WANTED: Final = ("temperature", "storage_modulus")
EXAMPLES: Final = {
    "temperature": "'Temperature', 'Temp./°C' or 'Ts'", "storage_modulus": "'Storage modulus', \"E'\" or \"G'\"",
}  # fmt: skip
TAN_DELTA_TOLERANCE: Final = 0.01
"""Declared tan delta and E''/E' that differ by more than this share of the greatest disagree."""
FREQUENCY_DIGITS: Final = 3
"""Significant digits in which frequencies of one test agree."""
MOST_FREQUENCIES: Final = 60
FEWEST_ROWS: Final = 10
ONE_BRANCH: Final = "one-branch"
"""Finding that is told of no export: nothing is said about a hysteresis, and each ramp may be a step of its own."""
NOT_OF_A_PEAK: Final = frozenset({"no-transformation", ONE_BRANCH})
"""Findings that are not told of a loss modulus, which follows no trend."""
AS_EXPORTED: Final = frozenset({"cut", "header", "preamble", "units"})
"""Findings about a table that are told of no export: each has lines above its data, and nobody declared where a step
ends."""
LABEL_CHARACTERS: Final = 40
"""Characters of the name of a file, step or sheet that become part of the names of files."""

_SIGNS = str.maketrans(
    {"′": "'", "’": "'", "‘": "'", "`": "'", "″": "''", "”": "''", '"': "''", "δ": "delta", "Δ": "delta"}
)
_AT = re.compile(r"\(\s*(\d+(?:[.,]\d+)?(?:[eE][-+]?\d+)?)\s*(m?Hz|kHz)\s*\)")
_BRACKETED = re.compile(r"(.*?)\s*[(\[]\s*([^()\[\]]*?)\s*[)\]]\s*")
_SLASHED = re.compile(r"(.*?)\s*/\s*([^/\s]+)\s*")
_SUFFIXED = re.compile(r"(.*)_(degC|C|K|degF|[kMG]?Pa|[km]?Hz|s|min|h)")
_SPACED = re.compile(r"(.*\S)\s+(°C|ºC|℃|°F|K|[kMG]?Pa|[km]?Hz|rad/s|s|min|h)")
_SIGNAL = re.compile(r"sig(\d+)", re.IGNORECASE)
_MARKER = re.compile(r"-[1-9](\.0*)?")
_STEP = re.compile(r"\s*\[step\]\s*", re.IGNORECASE)
_INTERVAL = re.compile(r'"?Interval data:', re.IGNORECASE)
_PLAIN = {
    "°C": "degC", "C": "degC", "ºC": "degC", "℃": "degC", "deg C": "degC", "Celsius": "degC", "Cel": "degC",
    "°F": "degF", "F": "degF", "℉": "degF", "K": "kelvin", "": "1", "-": "1", "1": "1",
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class DmtaOptions:
    """What is said about exports whose columns, units or frequency can't be told from the files.

    Attributes
    ----------
    columns : mapping of str to str
        Quantity to the name of its column.
    units : mapping of str to str
        Quantity to its unit, where a file does not state one that can be read.
    frequency : str
        Frequency with its unit, ``"1 Hz"``, of files without any.
    encoding : str, optional
        Of text.
    settings : SplitSettings
        How sweeps are told apart.
    """

    columns: Mapping[str, str] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    frequency: str = ""
    encoding: str | None = None
    settings: SplitSettings = field(default_factory=lambda: SplitSettings(fit_channels=("stiffness",)))

    def __post_init__(self) -> None:
        for option, said in (("--column", self.columns), ("--unit", self.units)):
            for quantity in said:
                if quantity not in UNITS:
                    raise SmaBayesError(
                        f"{option} {quantity}={said[quantity]}",
                        expected=f"a quantity among {', '.join(UNITS)}",
                        remedy=near_matches(quantity, UNITS),
                    )
        for quantity, unit in self.units.items():
            if not can_convert(_PLAIN.get(unit, unit), UNITS[quantity]):
                raise QuantityError(
                    f"--unit {quantity}={unit}: no unit of {quantity.replace('_', ' ')}",
                    expected=f"a unit that can be turned into {UNITS[quantity]!r}",
                )


class DeclaredDamping(DocumentPart):
    """Declared tan delta beside the quotient of the declared moduli."""

    test: str = Field(description="file, with its step or sheet where it has several")
    frequency: NumberOrNull = Field(description="frequency [Hz]")
    compared: int = Field(description="rows that state all three")
    disagree: int = Field(description="rows in which they differ by more than 1 % of the greatest tan delta")
    greatest: Number = Field(description="greatest difference, as a share of the greatest tan delta [1]")
    row: int = Field(description="source line of that")


@dataclass(frozen=True, slots=True, eq=False)
class DmtaSweep:
    """One branch at one frequency.

    Attributes
    ----------
    id : str
        Unique name; becomes part of file names.
    test : str
        File, with its step or sheet where it has several.
    frequency : float or None
        [Hz]; None where nobody states it.
    branch : Branch
    storage : Record
        Storage modulus [Pa] as the one channel of a specimen.
    loss : Record or None
        Loss modulus [Pa] likewise.
    loss_from_tan_delta : bool
        Whether the loss modulus was made from tan delta and the storage modulus.
    damping : DeclaredDamping or None
        None where tan delta and both moduli are not all declared.
    """

    id: str
    test: str
    frequency: float | None
    branch: Branch
    storage: Record
    loss: Record | None
    loss_from_tan_delta: bool
    damping: DeclaredDamping | None


@dataclass(frozen=True, slots=True)
class DmtaCampaign:
    """Exports that were read.

    Attributes
    ----------
    source : tuple of str
        Files.
    sha256 : str
        Over their content.
    sweeps : tuple of DmtaSweep
    findings : tuple of Finding
    left_out : tuple of str
        What could not be used, in words.
    """

    source: tuple[str, ...]
    sha256: str
    sweeps: tuple[DmtaSweep, ...]
    findings: tuple[Finding, ...]
    left_out: tuple[str, ...]


@without_campaign()
def read_dmta(paths: Sequence[str | Path], options: DmtaOptions | None = None) -> DmtaCampaign:
    """Read exports of dynamic mechanical analysis of one material.

    Parameters
    ----------
    paths : sequence of str or Path
        Delimited text, or workbooks.
    options : DmtaOptions, optional

    Raises
    ------
    MeasurementError
        If a file can't be read, lacks temperature or storage modulus, a unit is not stated, a column is named twice, a
        value is none, or no sweep is left.
    QuantityError
        If a unit is of the wrong kind.
    """
    options = options or DmtaOptions()
    if not paths:
        raise SmaBayesError("no file was given", expected="one export or more")
    files = [Path(p) for p in paths]
    total = hashlib.sha256()
    sweeps: list[DmtaSweep] = []
    findings: list[Finding] = []
    left_out: list[str] = []
    stems = _labels(files)
    for path, stem in zip(files, stems, strict=True):
        tests = list(_tests(path, stem, options, left_out))
        if not tests:
            raise MeasurementError(
                "no step or sheet has temperature and storage modulus",
                file=path,
                expected=" and ".join(EXAMPLES[q] for q in WANTED),
                remedy='name the columns: --column "temperature=NAME" --column "storage_modulus=NAME"',
            )
        with path.open("rb") as file:
            total.update(hashlib.file_digest(file, "sha256").digest())
        for test in tests:
            found, seen, lost = _sweeps_of(test, options)
            sweeps += found
            findings += seen
            left_out += lost
    if not sweeps:
        raise MeasurementError(
            f"no sweep of temperature is left: {'; '.join(left_out)}",
            file=files[0],
            expected=f"a heating or cooling with {FEWEST_ROWS} rows or more at one frequency",
            remedy="export a temperature ramp; a sweep of the frequency at a few temperatures has no curve to fit",
        )
    return DmtaCampaign(
        tuple(map(str, files)), total.hexdigest(), tuple(_unique(sweeps)), tuple(findings), tuple(left_out)
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Column:
    quantity: str
    name: str
    unit: str
    frequency: float | None
    values: Floats


@dataclass(frozen=True, slots=True, eq=False)
class _Test:
    """A table that was understood."""

    label: str
    path: Path
    row: Ints
    columns: tuple[_Column, ...]
    findings: tuple[Finding, ...]

    @property
    def temperature(self) -> _Column:
        """The column of the temperature."""
        return next(c for c in self.columns if c.quantity == "temperature")

    def values(self, quantity: str, frequency: float | None = None) -> Floats | None:
        found = [c.values for c in self.columns if c.quantity == quantity and c.frequency == frequency]
        return found[0] if found else None


def _labels(files: Sequence[Path]) -> list[str]:
    """Names of files that differ, fit for parts of file names."""
    stems = [_safe(f.stem) for f in files]
    return [s if stems.count(s) == 1 else f"{s}-{i}" for i, s in enumerate(stems, start=1)]


def _safe(text: str) -> str:
    return re.sub(r"[^\w.+-]+", "_", text).strip("_.")[:LABEL_CHARACTERS] or "test"


def _unique(sweeps: Sequence[DmtaSweep]) -> Iterator[DmtaSweep]:
    seen: dict[str, int] = {}
    for sweep in sweeps:
        seen[sweep.id] = count = seen.get(sweep.id, 0) + 1
        yield sweep if count == 1 else replace(sweep, id=f"{sweep.id}-{count}")


# tables


def _tests(path: Path, stem: str, options: DmtaOptions, left_out: list[str]) -> Iterator[_Test]:
    """Tables of a file that have a temperature and a storage modulus."""
    parts = list(_parts(path, options))
    for label, reading, below in parts:
        name = f"{stem}-{_safe(label)}" if len(parts) > 1 else stem
        try:
            table = read_table(path, reading)
        except MeasurementError:
            if len(parts) == 1:
                raise
            left_out.append(f"{name}: no table of temperature and storage modulus")
            continue
        seen = [f for f in table.findings if f.kind not in AS_EXPORTED]
        if below.size:
            message = f"{many(below.size, 'line')} below the data, left out"
            seen.append(rows_finding("below", message, below))
        if reading.encoding == "cp1252" and not options.encoding and table.above:
            seen.append(Finding("encoding", "the text is no UTF-8 and was read as cp1252"))
        table = replace(table, findings=tuple(seen))
        if all(len(c) == table.row.size for c in table.columns):
            table = _without_markers(_without_text_below(table))
        test = _understood(name, path, table, options, alone=len(parts) == 1)
        if test is None:
            left_out.append(f"{name}: no table of temperature and storage modulus")
            continue
        yield test


def _parts(path: Path, options: DmtaOptions) -> Iterator[tuple[str, Reading, Ints]]:
    """Sheets of a workbook, tables of a text file, or the whole file, with the lines of text below its data."""
    none = np.empty(0, dtype=np.int64)
    if path.is_dir():
        raise MeasurementError(
            "is a folder", file=path, expected="an export", remedy="name the files: FOLDER/*.csv"
        )
    form = recognise(path)
    if form == "xlsx":
        for title in sheet_titles(path):
            yield title, Reading(sheet=title), none
        return
    if form != "delimited":
        yield "", Reading(), none
        return
    encoding = options.encoding or encoding_of(path)
    try:
        lines = text_lines(path, encoding)
    except ReadingError as error:
        remedy = "name the encoding of the text, for many Windows programs --encoding cp1252"
        raise error.but(remedy="save the text as UTF-8" if encoding == "cp1252" else remedy) from None
    starts = list(_starts(lines)) or [(0, 0, "")]
    for (_, begin, title), (end, *_) in zip(starts, [*starts[1:], (len(lines), 0, "")], strict=True):
        last = _end_of_data(lines, begin, end)
        below = np.array([i + 1 for i in range(last, end) if lines[i].strip()], dtype=np.int64)
        yield title, Reading(encoding=encoding, skip_rows=begin, last_row=last), below


def _starts(lines: Sequence[str]) -> Iterator[tuple[int, int, str]]:
    """Tables of a text whose program marks them: place of the mark, first line that is read, title.

    TRIOS writes ``[step]`` with a title below it, RheoCompass ``Interval data:`` in the line of the names, Proteus
    ``##`` before these.
    """
    intervals = 0
    for i, line in enumerate(lines):
        if _STEP.fullmatch(line):
            title = lines[i + 1].strip(' \t,;"') if i + 1 < len(lines) else ""
            yield i, i + 1, title or f"step-{i + 1}"
        elif _INTERVAL.match(line):
            intervals += 1
            yield i, i, f"interval-{intervals}"
        elif line.startswith("##"):
            yield i, i, f"line-{i + 1}"


def _end_of_data(lines: Sequence[str], begin: int, end: int) -> int:
    """Number of the last line, counted from 1, that begins with a number or has several."""
    for last in range(end, begin, -1):
        if _has_numbers(re.split(r"[\s;,|]+", lines[last - 1].strip())):
            return last
    return end


def _has_numbers(cells: Sequence[object]) -> bool:
    """Whether a row begins with a number or has several."""
    return looks_numeric(cells[0]) or sum(map(looks_numeric, cells)) > 1


def _without_text_below(table: RawTable) -> RawTable:
    """Without the rows of text below the data of a sheet."""
    cells = list(zip(*table.columns, strict=True))
    last = max((i for i, row in enumerate(cells) if _has_numbers(row)), default=len(cells) - 1)
    below = np.arange(len(cells)) > last
    return _without(
        table, below, "below", f"{many(int(below.sum()), 'row')} of text below the data, left out"
    )


def _without_markers(table: RawTable) -> RawTable:
    """Without the rows by which Universal Analysis marks an event: a code, -1 to -9, in place of the time or of all."""
    signals = _signals(table)
    timed = _name_of(signals.get(1, ""))[0] == "time"
    marks = np.array([
        bool(signals) and _MARKER.fullmatch(str(row[0]).strip()) is not None and (timed or len(set(row)) == 1)
        for row in zip(*table.columns, strict=True)
    ])  # fmt: skip
    return _without(table, marks, "marker", f"{many(int(marks.sum()), 'row')} that mark an event, left out")


def _without(table: RawTable, rows: NDArray[np.bool_], kind: str, message: str) -> RawTable:
    """Without some rows, which a finding names."""
    if not rows.any():
        return table
    columns = tuple([cell for cell, out in zip(c, rows, strict=True) if not out] for c in table.columns)
    findings = (*table.findings, rows_finding(kind, message, table.row[rows]))
    return replace(table, columns=columns, row=table.row[~rows], findings=findings)


def encoding_of(path: Path) -> str | None:
    """None where text is what it says or UTF-8; else that of Western Windows programs, which instruments write."""
    raw = path.read_bytes()
    if raw.startswith((b"\xff\xfe", b"\xfe\xff")):
        return None
    try:
        raw.decode("utf-8")
    except UnicodeDecodeError:
        return "cp1252"
    return None


def _understood(
    label: str, path: Path, table: RawTable, options: DmtaOptions, *, alone: bool
) -> _Test | None:
    """The columns of a table that matter; None where a sheet or step among others has none."""
    line, names, units = _header(table)
    known = _without_second([_known(name, unit, options) for name, unit in zip(names, units, strict=True)])
    missing = [q for q in WANTED if not any(k is not None and k[0] == q for k in known)]
    if missing and not alone:
        return None
    if not any(names):
        raise MeasurementError(
            "its columns have no names",
            file=path,
            expected=f"a line of names above the numbers, such as {EXAMPLES['temperature']} and "
            f"{EXAMPLES['storage_modulus']}",
            remedy="write a line of names with units above the numbers, such as "
            "'Temperature (°C),Storage modulus (MPa)', with the separator of the file",
        )
    for quantity, name in options.columns.items():
        said = f"--column {quantity}={name}: there is no such column"
        require_known(name, [n for n in names if n], said, MeasurementError, file=path)
    if missing:
        shown = ", ".join(repr(n) for n in names if n)
        raise MeasurementError(
            f"no column of {missing[0].replace('_', ' ')} among {shown}",
            file=path,
            expected=f"a column such as {EXAMPLES[missing[0]]}",
            remedy=f'name it: --column "{missing[0]}=NAME", with --unit "{missing[0]}={UNITS[missing[0]]}" where the '
            "file does not state the unit",
        )
    _refuse_misfit(line, names, table, path)
    _refuse_twice(names, known, path)
    columns: list[_Column] = []
    findings: list[Finding] = list(table.findings)
    for i, (name, found) in enumerate(zip(names, known, strict=True)):
        if found is None or i >= len(table.columns):
            continue
        quantity, unit, frequency, angular = found
        if unit is None and quantity == "time":
            continue
        if unit is None:
            raise _no_unit(quantity, name, path)
        values, seen = numbers(
            table.columns[i], table.row, file=path, column=name, decimal=table.decimal or ".",
        )  # fmt: skip
        findings += seen
        if angular:
            values = values / (2.0 * np.pi)
        else:
            unit = _readable(unit, quantity, name, options, path)
            values = convert(values, unit, UNITS[quantity], what=name)
        columns.append(_Column(quantity, name, unit, frequency, values))
    named = tuple(replace(f, file=f.file or path.name) for f in findings)
    test = _Test(label, path, table.row, tuple(columns), named)
    _refuse_impossible(test)
    return test


def _header(table: RawTable) -> tuple[int | None, list[str], list[str | None]]:
    """Line of the names, names of the columns, and units as far as a row of its own states them."""
    width = len(table.columns)
    signals = _signals(table)
    if signals:
        last = max(signals)
        return None, [signals.get(i, "") for i in range(1, last + 1)], [None] * last
    units: list[str | None] = []
    for line, above in reversed(table.above):
        row = [_text(c) for c in above]
        if not units and _are_units(row):
            units = [_bare(c) if c else None for c in row]
            continue
        while row and not row[-1]:
            row.pop()
        if len(row) > width and table.names and any(_name_of(n)[0] for n in table.names):
            row = list(table.names)  # names with blanks in them, over columns set apart by blanks
        return line, row, [*units, *[None] * len(row)][: len(row)]
    return None, [""] * width, [None] * width


def _signals(table: RawTable) -> dict[int, str]:
    """Names of the columns by their number, as Universal Analysis writes them above the data."""
    found = {}
    for _, cells in table.above:
        match = _SIGNAL.fullmatch(str(cells[0]).strip()) if cells and cells[0] is not None else None
        if match:
            found[int(match[1])] = " ".join(str(c) for c in cells[1:] if not is_blank(c))
    return found


def _refuse_misfit(line: int | None, names: Sequence[str], table: RawTable, path: Path) -> None:
    """Names that do not fit the columns: each would stand over the numbers of a neighbour."""
    filled = [not all(is_blank(cell) for cell in column) for column in table.columns]
    needed = max((i for i, some in enumerate(filled, start=1) if some), default=0)
    if needed <= len(names) <= len(filled):
        return
    raise MeasurementError(
        f"the header has {many(len(names), 'name')}, the rows have {many(needed, 'column')}",
        file=path,
        row=line,
        expected="a name for each column",
        remedy="complete the header or the rows, so that each name stands over its numbers",
    )


def _are_units(cells: Sequence[str]) -> bool:
    """Whether a row states units and no name."""
    named = any(_name_of(cell)[0] is not None for cell in cells)
    return not named and any(cells) and all(_is_unit(cell) for cell in cells)


def _text(cell: object) -> str:
    return "" if cell is None else " ".join(str(cell).split())


def _bare(cell: str) -> str:
    """A unit without its brackets."""
    inner = re.fullmatch(r"[(\[]\s*(.*?)\s*[)\]]", cell.strip())
    return inner[1] if inner else cell.strip()


def _is_unit(cell: str) -> bool:
    text = _bare(cell)
    if text in _PLAIN or text in ("%", "#", "rad/s"):
        return True
    try:
        convert(1.0, text, "Pa")
    except QuantityError as error:
        return "of the wrong kind" in error.found
    return True


# names


def _key(name: str) -> str:
    return re.sub(r"[\s._\-]+", "", name.translate(_SIGNS)).casefold()


def _name_of(header: str) -> tuple[str | None, str | None, float | None, bool]:
    """Quantity, unit, frequency and whether that is an angular one, as far as a header states them."""
    text = header.strip().lstrip("#").strip()
    at = _AT.search(text)
    frequency = None
    if at:
        value = float(at[1].replace(",", "."))
        frequency = float(convert(value, at[2], "Hz"))
        text = (text[: at.start()] + text[at.end() :]).strip()
    quantity = _quantity(text)
    if quantity is not None or _key(text) in ANGULAR:
        return quantity or "frequency", None, frequency, _key(text) in ANGULAR
    for pattern in (_BRACKETED, _SLASHED, _SUFFIXED, _SPACED):
        match = pattern.fullmatch(text)
        if not match:
            continue
        name = match[1].strip(" ,;")
        quantity = _quantity(name)
        if quantity is not None or _key(name) in ANGULAR:
            return quantity or "frequency", match[2], frequency, _key(name) in ANGULAR
    return None, None, frequency, False


def _quantity(name: str) -> str | None:
    if name.strip() in LETTERS:
        return LETTERS[name.strip()]
    key = _key(name)
    return next((q for q, names in NAMES.items() if key in names), None)


def _known(
    name: str, unit: str | None, options: DmtaOptions
) -> tuple[str, str | None, float | None, bool] | None:
    """Quantity of a column, its unit if it is stated, its frequency, and whether that is an angular one."""
    declared = {wanted: q for q, wanted in options.columns.items()}
    quantity, stated, frequency, angular = _name_of(name)
    if name in declared:
        quantity = declared[name]
    elif quantity in options.columns:
        return None
    if quantity is None:
        return None
    said = stated if stated is not None else unit
    said = options.units.get(quantity) if said is None else _PLAIN.get(said, said)
    if quantity == "tan_delta":
        said = "1"
    if quantity == "frequency" and (angular or said in ("rad/s", "1/s rad", "rad s^-1")):
        return quantity, "rad/s", frequency, True
    return quantity, said, frequency, False


def _without_second(
    known: Sequence[tuple[str, str | None, float | None, bool] | None],
) -> list[tuple[str, str | None, float | None, bool] | None]:
    """Without the angular frequency where the frequency is stated, too."""
    plain = any(found is not None and found[0] == "frequency" and not found[3] for found in known)
    return [None if plain and found is not None and found[3] else found for found in known]


def _readable(unit: str, quantity: str, name: str, options: DmtaOptions, path: Path) -> str:
    """The unit of a column, or what was said where the file states none of its kind."""
    try:
        convert(1.0, unit, UNITS[quantity], what=name)
    except QuantityError as error:
        if quantity in options.units:
            return _PLAIN.get(options.units[quantity], options.units[quantity])
        said = f'say it: --unit "{quantity}={"MPa" if UNITS[quantity] == "Pa" else UNITS[quantity]}"'
        raise QuantityError(
            error.found, file=path, column=name, expected=error.expected, remedy=f"{error.remedy}; or {said}"
        ) from None
    return unit


def _refuse_twice(
    names: Sequence[str], known: Sequence[tuple[str, str | None, float | None, bool] | None], path: Path
) -> None:
    seen: dict[tuple[str, float | None], str] = {}
    for name, found in zip(names, known, strict=True):
        if found is None or found[0] == "time":
            continue
        key = (found[0], found[2])
        if key in seen:
            raise MeasurementError(
                f"{seen[key]!r} and {name!r} are both columns of {found[0].replace('_', ' ')}",
                file=path,
                expected="one column of each quantity and frequency",
                remedy=f'say which: --column "{found[0]}={name}"',
            )
        seen[key] = name


def _no_unit(quantity: str, name: str, path: Path) -> MeasurementError:
    return MeasurementError(
        "no unit is stated",
        file=path,
        column=name,
        expected=f"a unit that can be turned into {UNITS[quantity]!r}: in the header, or in a row below",
        remedy=f'say it: --unit "{quantity}={"MPa" if UNITS[quantity] == "Pa" else UNITS[quantity]}"',
    )


def _refuse_impossible(test: _Test) -> None:
    """A storage modulus or frequency that is not positive, a temperature below absolute zero."""
    least = {"storage_modulus": 0.0, "frequency": 0.0, "temperature": -273.15}
    for column in test.columns:
        low = least.get(column.quantity, -np.inf)
        high = SETTING.value if column.quantity == "frequency" else np.inf
        with np.errstate(invalid="ignore"):
            bad = np.flatnonzero((column.values <= low) | (np.abs(column.values) > high))
        if not bad.size:
            continue
        value = column.values[bad[0]]
        if column.unit == "rad/s":
            read = 2.0 * np.pi * float(value)
        else:
            read = float(convert(value, UNITS[column.quantity], column.unit))
        above = "absolute zero" if column.quantity == "temperature" else "zero"
        raise MeasurementError(
            f"found {read:g} {column.unit}"
            + (f" (and {bad.size - 1} more in this column)" if bad.size > 1 else ""),
            file=test.path,
            row=int(test.row[bad[0]]),
            column=column.name,
            expected=f"a value above {above}"
            if value <= low
            else f"at most {high:g} {UNITS[column.quantity]}",
            remedy="correct the row, or leave it out of the export",
        )


# sweeps


def _sweeps_of(test: _Test, options: DmtaOptions) -> tuple[list[DmtaSweep], list[Finding], list[str]]:
    """Sweeps of a test, frequency by frequency, with findings and what was left out."""
    sweeps: list[DmtaSweep] = []
    findings: list[Finding] = list(test.findings)
    left_out: list[str] = []
    for frequency, rows, wide in _by_frequency(test, options):
        name = test.label if frequency is None else f"{test.label}-{frequency:g}Hz"
        moduli, from_tan_delta, damping = _moduli(test, frequency, rows, wide)
        if not np.isfinite(moduli["storage_modulus"]).any():
            left_out.append(f"{name}: no storage modulus")
            continue
        if not np.isfinite(test.temperature.values[rows]).any():
            left_out.append(f"{name}: no temperature")
            continue
        run = _run_of(test, name, frequency, rows, moduli["storage_modulus"])
        findings += implausible(run)
        try:
            storage, seen = _split(run, options)
        except MeasurementError as error:
            left_out.append(f"{name}: {error.found}")
            continue
        findings += [f for f in seen if f.kind != ONE_BRANCH]
        losses: dict[Branch, Record] = {}
        if "loss_modulus" in moduli:
            run = _run_of(test, f"{name}-loss", frequency, rows, moduli["loss_modulus"])
            try:
                found, seen = _split(run, options)
                losses = {r.branch: r for r in found}
                findings += [f for f in seen if f.kind not in NOT_OF_A_PEAK]
            except MeasurementError as error:
                left_out.append(f"{name}, loss modulus: {error.found}")
        for record in storage:
            loss = losses.get(record.branch)
            sweeps.append(
                DmtaSweep(
                    f"{name}-{record.branch.value}", test.label, frequency, record.branch, record, loss,
                    from_tan_delta and loss is not None, damping,
                )
            )  # fmt: skip
    return sweeps, findings, left_out


def _by_frequency(test: _Test, options: DmtaOptions) -> Iterator[tuple[float | None, Ints, float | None]]:
    """Frequency [Hz], its rows, and the key of its columns, None for those without a frequency of their own."""
    every = np.arange(test.row.size)
    wide = sorted({c.frequency for c in test.columns if c.frequency is not None})
    if wide:
        yield from ((f, every, f) for f in wide)
        return
    column = test.values("frequency")
    if column is None:
        yield (_stated(options.frequency) if options.frequency else None), every, None
        return
    with np.errstate(invalid="ignore"):
        rounded = np.array([float(f"{v:.{FREQUENCY_DIGITS}g}") for v in column])
    values = np.unique(rounded[np.isfinite(rounded)])
    if values.size > MOST_FREQUENCIES:
        raise MeasurementError(
            f"{values.size} frequencies in {test.row.size} rows",
            file=test.path,
            expected=f"at most {MOST_FREQUENCIES}, each with a sweep of the temperature",
            remedy="export a temperature ramp at fixed frequencies, or name another column of the frequency",
        )
    for value in values:
        yield float(value), np.flatnonzero(rounded == value), None


def _stated(text: str) -> float:
    from sma_bayes.quantities import number_and_unit

    value, unit = number_and_unit(text, what="frequency")
    if not unit or not value > 0.0:
        raise QuantityError(f"--frequency {text!r}", expected="a frequency with its unit, such as '1 Hz'")
    if unit == "rad/s":
        return value / (2.0 * float(np.pi))
    return float(convert(value, unit, "Hz", what="--frequency"))


def _moduli(
    test: _Test, frequency: float | None, rows: Ints, wide: float | None
) -> tuple[dict[str, Floats], bool, DeclaredDamping | None]:
    """Moduli [Pa] of some rows, whether the loss comes from tan delta, and what the declared tan delta says."""
    found = {}
    for quantity in ("storage_modulus", "loss_modulus", "tan_delta"):
        values = test.values(quantity, wide)
        if values is not None and (quantity == "storage_modulus" or np.isfinite(values[rows]).any()):
            found[quantity] = values[rows]
    tan = found.pop("tan_delta", None)
    if "loss_modulus" in found:
        return found, False, _damping(test, frequency, rows, found, tan)
    if tan is not None:
        found["loss_modulus"] = found["storage_modulus"] * tan
        return found, True, None
    return found, False, None


def _damping(
    test: _Test, frequency: float | None, rows: Ints, moduli: Mapping[str, Floats], tan: Floats | None
) -> DeclaredDamping | None:
    if tan is None:
        return None
    away = np.abs(tan - moduli["loss_modulus"] / moduli["storage_modulus"])
    seen = np.isfinite(away)
    if not seen.any():
        return None
    share = away / max(float(np.nanmax(np.abs(tan))), 1e-300)
    at = int(np.nanargmax(share))
    return DeclaredDamping(
        test=test.label, frequency=frequency, compared=int(seen.sum()),
        disagree=int(np.sum(share[seen] > TAN_DELTA_TOLERANCE)), greatest=float(share[at]), row=int(test.row[rows][at]),
    )  # fmt: skip


def _run_of(test: _Test, name: str, frequency: float | None, rows: Ints, modulus: Floats) -> Run:
    """One modulus of some rows.

    Raises
    ------
    MeasurementError
        If a value can't have been measured.
    """
    warm = test.temperature
    columns = {"temperature": warm.values[rows], "stiffness": modulus}
    units = {"temperature": "degC", "stiffness": "Pa"}
    time = test.values("time")
    if time is not None and np.isfinite(time).all():
        columns["time"], units["time"] = time[rows], "s"
    declared = next(c.unit for c in test.columns if c.quantity == "storage_modulus")
    run = Run(
        Condition(name, frequency=frequency), test.path.name, test.row[rows], columns, units, specimen=True,
        declared_units={"stiffness": declared, "temperature": warm.unit},
    )  # fmt: skip
    require_possible(run)
    return run


def _split(run: Run, options: DmtaOptions) -> tuple[tuple[Record, ...], tuple[Finding, ...]]:
    """Branches of a run."""
    whole = np.isfinite(run.columns["temperature"]) & np.isfinite(run.columns["stiffness"])
    if whole.sum() < FEWEST_ROWS:
        raise MeasurementError(f"{many(int(whole.sum()), 'row')} with temperature and modulus", file=run.file)
    return split_run(run, options.settings)
