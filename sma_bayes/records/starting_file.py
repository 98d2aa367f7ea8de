"""A first campaign file for a folder of data files: what can be guessed, marked as guessed, and tried out."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.disk import quoted, writing
from sma_bayes.errors import CampaignError, MeasurementError, OutputError, SmaBayesError, first_of, many
from sma_bayes.records.clock import is_clock
from sma_bayes.records.declaration import (
    CAMPAIGN_FILE,
    CHANNEL_OF,
    FILES_NAMED,
    FILES_SHOWN,
    parse_declaration,
)
from sma_bayes.records.formats import RawTable, Reading, read_table, recognise
from sma_bayes.records.formats.numbers import is_blank, looks_numeric, numbers
from sma_bayes.records.formats.xlsx import sheet_titles
from sma_bayes.records.guesses import Guess, Guesses, guess_named, guess_unnamed, one_kind, settings_in
from sma_bayes.records.mapping import read_run
from sma_bayes.records.quality import zero_dropouts
from sma_bayes.records.split import SplitSettings, split_run

NOT_DATA: Final = frozenset((
    ".toml", ".md", ".rst", ".py", ".ipynb", ".m", ".pdf", ".png", ".jpg", ".jpeg", ".svg", ".gif", ".html", ".json",
    ".zip", ".gz", ".doc", ".docx", ".ppt", ".pptx", ".log", ".bib", ".tex",
))  # fmt: skip
"""Suffixes of files that are not looked at."""

READINGS: Final[tuple[dict[str, Any], ...]] = ({}, {"quoted_rows": True}, {"encoding": "cp1252"})
"""Ways to read a file, tried in turn."""

MAX_MISSING_CODES, MAX_SHARE_OF_CODES = 5, 0.1
"""Texts in a column of numbers are codes of missing values if there are so few kinds of them, in so small a share of
the rows."""

NO_TEMPERATURE: Final = "no column seems to be a temperature"

_HEATING, _COOLING = r"heat(?:ing)?|up", r"cool(?:ing)?|down"
_BRANCH = re.compile(rf"[ _-]*(?<![a-z])(?:({_HEATING})|{_COOLING})(?![a-z])", re.IGNORECASE)
"""How names of files tell heating from cooling, with what joins it to the rest."""

HELD_LOAD_SPREAD: Final = 0.1
"""A force or stress whose quartiles differ by less than this share of its median was held, and is the load."""


@dataclass(frozen=True, slots=True, eq=False)
class _Source:
    """A file, or a sheet of a workbook, with what its columns seem to hold; `cooling` is the file of the way back."""

    file: str
    reading: Mapping[str, Any]
    names: tuple[str, ...] | None
    width: int
    values: Mapping[int, Floats]
    codes: Mapping[int, tuple[str, ...]]
    guesses: Guesses
    settings: Mapping[str, float]
    cooling: str = ""

    @property
    def stem(self) -> str:
        stem = Path(self.file).stem
        return _BRANCH.sub("", stem).strip(" _-") if self.cooling else stem

    @property
    def title(self) -> str:
        return self.file + (f" (sheet {self.reading['sheet']!r})" if "sheet" in self.reading else "")


@dataclass(frozen=True, slots=True)
class StartingFile:
    """A campaign file that was written.

    Attributes
    ----------
    path : Path
    conditions : tuple of str
        Their ids.
    guesses : tuple of str
        One sentence each.
    left_out : mapping of str to str
        Why, by file.
    """

    path: Path
    conditions: tuple[str, ...]
    guesses: tuple[str, ...]
    left_out: Mapping[str, str]


def write_starting_file(folder: str | Path) -> StartingFile:
    """Write a commented ``campaign.toml`` for the data files of a folder, with all guesses marked as such.

    See `sma_bayes.start_campaign`.
    """
    folder = Path(folder)
    path = folder / CAMPAIGN_FILE
    if not folder.is_dir():
        raise CampaignError("there is no such folder", file=folder, expected="a folder with data files")
    if path.exists():
        raise OutputError(
            "is there already",
            file=path,
            expected=f"a folder without {CAMPAIGN_FILE}",
            remedy="edit it, or move it away first; it is not overwritten",
        )
    sources, left_out = _usable(folder)
    ids = _ids(sources)
    text = _Writer(folder, sources, ids, {}).text()
    failed = _tried(text, path)
    left_out |= {s.title: failed[i] for s, i in zip(sources, ids, strict=True) if i in failed}
    if len(failed) == len(sources):
        raise _nothing(folder, left_out)
    writer = _Writer(folder, sources, ids, failed)
    with writing(path):
        path.write_text(writer.text() + _left_out_text(left_out, failed, sources), encoding="utf-8")
    return StartingFile(path, tuple(i for i in ids if i not in failed), tuple(writer.guesses), left_out)


def _usable(folder: Path) -> tuple[list[_Source], dict[str, str]]:
    """Sources with a temperature and a channel, and why the others can't be used."""
    left_out: dict[str, str] = {}
    for depth in ("*", "*/*", "*/*/*"):
        found: list[_Source] = []
        for path in sorted(folder.glob(depth), key=_natural):
            if (
                path.is_file()
                and path.suffix.lower() not in NOT_DATA
                and not path.name.startswith((".", "~"))
            ):
                found += _sources(path, path.relative_to(folder).as_posix(), left_out)
        found = _unnamed_together(found)
        left_out |= {s.title: why for s in found if (why := _lacking(s.guesses))}
        usable = [s for s in found if s.title not in left_out]
        if usable:
            alike = zip(usable, one_kind([s.guesses for s in usable]), strict=True)
            return _without_copies(
                _with_way_back([replace(s, guesses=g) for s, g in alike]), left_out
            ), left_out
    raise _nothing(folder, left_out)


def _natural(path: Path) -> list[tuple[bool, float, str]]:
    """Key by which numbers in names sort by value."""
    parts = re.split(r"(\d+)", str(path))
    return [(not p.isdigit(), float(p) if p.isdigit() else 0.0, p) for p in parts]


def _unnamed_together(sources: Sequence[_Source]) -> list[_Source]:
    """The same with guesses for files without a header, from all that have as many columns."""
    layouts: dict[int, list[_Source]] = {}
    for source in sources:
        if source.names is None:
            layouts.setdefault(source.width, []).append(source)
    guesses = {
        width: guess_unnamed([s.values for s in alike], width, [s.settings.get("stress_MPa") for s in alike])
        for width, alike in layouts.items()
    }
    return [replace(s, guesses=guesses[s.width]) if s.names is None else s for s in sources]


def _lacking(guesses: Guesses) -> str:
    if "temperature" not in guesses.columns:
        return NO_TEMPERATURE
    if not {"force", "displacement", "stiffness", *CHANNEL_OF} & set(guesses.columns):
        return "no column seems to be a force, displacement, stiffness, stress, strain or modulus"
    return ""


def _nothing(folder: Path, left_out: Mapping[str, str]) -> MeasurementError:
    why: dict[str, list[str]] = {}
    for name, reason in left_out.items():
        why.setdefault(reason, []).append(name)
    told = [f"{first_of(names, FILES_NAMED)}: {reason}" for reason, names in list(why.items())[:FILES_SHOWN]]
    remedy = (
        f"where a column is one under another name, write {CAMPAIGN_FILE} by hand and name it under [columns]"
    )
    if NO_TEMPERATURE in why:
        remedy = (
            f"data without a temperature can't be used: the curves are functions of temperature; {remedy}"
        )
    return MeasurementError(
        f"no file can be used ({'; '.join(told)})" if told else "the folder has no data files",
        file=folder,
        expected="files with the temperature of the alloy beside its force, displacement or stiffness",
        remedy=remedy,
    )


def _sources(path: Path, file: str, left_out: dict[str, str]) -> Iterator[_Source]:
    """What can be read of a file: one source, or one for each sheet of a workbook."""
    try:
        sheets = sheet_titles(path) if recognise(path) == "xlsx" else ()
        ways: Iterable[Sequence[dict[str, Any]]] = (
            [[{"sheet": s}] for s in sheets] if len(sheets) > 1 else [READINGS]
        )
        for attempts in ways:
            reading, table = _first_readable(path, attempts)
            yield _source(path, file, reading, table)
    except SmaBayesError as error:
        left_out[file] = error.found


def _first_readable(path: Path, attempts: Sequence[dict[str, Any]]) -> tuple[dict[str, Any], RawTable]:
    error: SmaBayesError | None = None
    for reading in attempts:
        try:
            return reading, read_table(path, Reading(**reading))
        except SmaBayesError as wrong:
            error = error or wrong
    raise error or MeasurementError("can't be read", file=path)


def _source(path: Path, file: str, reading: Mapping[str, Any], table: RawTable) -> _Source:
    values: dict[int, Floats] = {}
    codes: dict[int, tuple[str, ...]] = {}
    for i, cells in enumerate(table.columns):
        texts = [c.strip() for c in cells if isinstance(c, str) and not is_blank(c) and not looks_numeric(c)]
        if len(set(texts)) > MAX_MISSING_CODES or len(texts) > MAX_SHARE_OF_CODES * len(cells):
            continue
        texts += [c.strip() for c in cells if isinstance(c, str) and c.strip().casefold() == "nan"]
        try:
            found, _ = numbers(
                cells,
                table.row[: len(cells)],
                file=path,
                column="",
                missing=sorted(set(texts)),
                decimal=table.decimal or ".",
            )
        except SmaBayesError:
            continue
        values[i] = found[np.isfinite(found)]
        codes[i] = tuple(sorted(set(texts)))
    settings = settings_in(file.rsplit(".", 1)[0] + " " + str(reading.get("sheet", "")))
    clocks = {i for i, cells in enumerate(table.columns) if is_clock(cells)}
    guesses = Guesses() if table.names is None else guess_named(table.names, values, clocks, table.headers)
    width = max((i + 1 for i, cells in enumerate(table.columns) if not all(map(is_blank, cells))), default=0)
    return _Source(file, reading, table.names, width, values, codes, guesses, settings)


def _without_copies(sources: Sequence[_Source], left_out: dict[str, str]) -> list[_Source]:
    """Of files of the same name in several folders or formats the one with the most rows."""

    def rows(source: _Source) -> int:
        return max(v.size for v in source.values.values())

    def name(source: _Source) -> tuple[str, object]:
        return Path(source.file).stem, source.reading.get("sheet")

    longest: dict[tuple[str, object], _Source] = {}
    for source in sources:
        if name(source) not in longest or rows(source) > rows(longest[name(source)]):
            longest[name(source)] = source
    for source in sources:
        kept = longest[name(source)]
        if kept is not source:
            more = "more" if rows(kept) > rows(source) else "as many"
            left_out[source.title] = f"{kept.title} has the same name and {more} rows"
    return list(longest.values())


def _with_way_back(sources: Sequence[_Source]) -> list[_Source]:
    """Sources in which two files of the same columns, heating and cooling of one name, are one."""
    alike: dict[object, dict[bool, list[_Source]]] = {}
    for source in sources:
        told = _BRANCH.findall(source.file)
        if len(told) == 1:
            key = _BRANCH.sub("", source.file).casefold(), source.names, str(source.reading)
            alike.setdefault(key, {}).setdefault(bool(told[0]), []).append(source)
    pairs = [
        (b[True][0], b[False][0])
        for b in alike.values()
        if len(b.get(True, ())) == len(b.get(False, ())) == 1
    ]
    back = {up.title: down.file for up, down in pairs}
    gone = {down.title for _, down in pairs}
    return [replace(s, cooling=back.get(s.title, "")) for s in sources if s.title not in gone]


def _ids(sources: Sequence[_Source]) -> list[str]:
    """Ids that can stand in file names: the stem of each file, with folder and sheet where that is not enough."""
    stems = [s.stem + (f" {s.reading['sheet']}" if "sheet" in s.reading else "") for s in sources]
    whole = [
        re.sub(r"\.\w+$", "", s.file) + (f" {s.reading['sheet']}" if "sheet" in s.reading else "")
        for s in sources
    ]
    names = stems if len({s.casefold() for s in stems}) == len(stems) else whole
    clean = [re.sub(r'[\x00-\x1f<>:"/\\|?*]+', "-", n).strip(" .")[:72] or "condition" for n in names]
    seen = [c.casefold() for c in clean]
    return [
        c if seen.count(k) == 1 else f"{c}-{i}"
        for i, (c, k) in enumerate(zip(clean, seen, strict=True), start=1)
    ]


def _tried(text: str, path: Path) -> dict[str, str]:
    """Conditions that can't be read or split, with the reason."""
    failed = {}
    settings = SplitSettings()
    for condition in parse_declaration(text.encode(), path, path.parent, settings).conditions:
        try:
            _, findings = split_run(read_run(condition)[0], condition.settings)
        except SmaBayesError as error:
            failed[condition.table.id] = error.found.removeprefix(f"condition {condition.table.id!r}: ")
        else:
            narrow = next((f.message for f in findings if f.kind == "narrow-sweep"), None)
            if narrow:
                failed[condition.table.id] = narrow
    return failed


def _left_out_text(left_out: Mapping[str, str], failed: Mapping[str, str], sources: Sequence[_Source]) -> str:
    declared = {s.title for s in sources}
    rest = [f"#   {name}: {why}" for name, why in left_out.items() if name not in declared]
    return "\n".join(["", "# Not declared:", *rest, ""]) if rest else ""


def _not_used(sources: Sequence[_Source]) -> list[str]:
    """A comment with the columns of any of these files that are not declared; none where all are."""
    named = dict.fromkeys(
        repr(s.names[i]) if s.names else str(i + 1)
        for s in sources
        for i in s.guesses.unused
        if not s.names or s.names[i]
    )
    return [f"# columns not used: {', '.join(named)}"] if named else []


class _Writer:
    """Text of the campaign file; conditions that failed stand in it as comments.

    Attributes
    ----------
    guesses : list of str
        What was guessed, one sentence each, once `text` was called.
    """

    def __init__(
        self, folder: Path, sources: Sequence[_Source], ids: Sequence[str], failed: Mapping[str, str]
    ) -> None:
        self.folder, self.sources, self.ids, self.failed = folder, sources, ids, failed
        self.guesses: list[str] = []

    def text(self) -> str:
        """The whole file."""
        columns = [self._columns(s) for s in self.sources]
        readings = [[f"{key} = {_toml(value)}" for key, value in s.reading.items()] for s in self.sources]
        common = all(_bare(c) == _bare(columns[0]) for c in columns)
        same_reading = all(r == readings[0] for r in readings)
        lines = [
            "# Campaign file for the measurements beside it. What is marked GUESS comes from names and numbers: check",
            "# it, correct it, and remove the mark. Then see what is read:",
            "#",
            f"#   sma-bayes inspect {quoted(self.folder)}",
            "",
            "[campaign]",
            f"name = {_quoted(self.folder.resolve().name or 'campaign')}",
        ]
        if common:
            lines += ["", "[columns]", *columns[0], *_not_used(self.sources)]
            self._note(columns[0], "")
        if same_reading and readings[0]:
            lines += ["", "[reading]", *readings[0]]
        for source, name, own, reading in zip(self.sources, self.ids, columns, readings, strict=True):
            part = [
                "[[condition]]",
                f"id = {_quoted(name)}",
                _file_line(source),
                *self._settings(source),
            ]
            if not common:
                part += ["[condition.columns]", *own, *_not_used([source])]
            if reading and not same_reading:
                part += ["[condition.reading]", *reading]
            if name in self.failed:
                part = [f"# {self.failed[name]}", *(f"# {line}" for line in part)]
            else:
                self._note(part, f"{name}: ")
            lines += ["", *part]
        return "\n".join(lines) + "\n"

    def _note(self, lines: Iterable[str], where: str) -> None:
        self.guesses += [
            where + line.replace("  # GUESS: ", "    ", 1) for line in lines if "# GUESS" in line
        ]

    def _columns(self, source: _Source) -> list[str]:
        order = sorted(source.guesses.columns.items(), key=lambda entry: list(_ORDER).index(entry[0]))
        return [_column_line(quantity, i, guess, source) for quantity, (i, guess) in order]

    def _settings(self, source: _Source) -> list[str]:
        """What was set on the rig: told by the name, or a load that the file shows to be held."""
        specimen = bool(set(CHANNEL_OF) & set(source.guesses.columns))
        suits = {
            key: value
            for key, value in source.settings.items()
            if not (key.startswith("load_") if specimen else key == "stress_MPa")
        }
        lines = [f"{key} = {value:g}  # GUESS: from the file name" for key, value in suits.items()]
        held = "stress" if specimen else "force"
        if not any(key.startswith(("load", "stress")) for key in suits) and held in source.guesses.columns:
            i, guess = source.guesses.columns[held]
            key = {"N": "load_N", "MPa": "stress_MPa"}.get(guess.unit)
            low, middle, high = np.percentile(source.values[i], [25.0, 50.0, 75.0])
            if key and middle > 0.0 and high - low < HELD_LOAD_SPREAD * middle:
                lines.append(f"{key} = {middle:.3g}  # GUESS: median of a {held} that hardly varies")
        return lines


def _file_line(source: _Source) -> str:
    if not source.cooling:
        return f"file = {_quoted(source.file)}"
    files = ", ".join(map(_quoted, (source.file, source.cooling)))
    return f"file = [{files}]  # GUESS: heating and cooling of one condition, from the file names"


def _bare(lines: Iterable[str]) -> list[str]:
    """Lines without their comments."""
    return [line.split("  # GUESS")[0] for line in lines if not line.startswith("#")]


_ORDER: Final = (
    "time", "temperature", "ambient_temperature", "force", "displacement", "stiffness", "stress", "strain", "modulus",
    "current", "drive", "cycle", "branch",
)  # fmt: skip


def _column_line(quantity: str, i: int, guess: Guess, source: _Source) -> str:
    header = source.names[i] if source.names else ""
    once = bool(header) and source.names is not None and source.names.count(header) == 1
    keys = [f"name = {_quoted(header)}" if once else f"column = {i + 1}"]
    if guess.unit:
        keys.append(f"unit = {_quoted(guess.unit)}")
    doubts = list(guess.doubts)
    codes: list[Any] = list(source.codes.get(i, ()))
    if codes:
        doubts.append("texts among the numbers are missing values")
    values = source.values.get(i)
    if (
        quantity == "temperature"
        and values is not None
        and guess.unit == "degC"
        and zero_dropouts(values).any()
    ):
        codes.append(0.0)
        doubts.append(
            f"{many(int(np.sum(values == 0.0)), 'reading')} of 0, far from the neighbours, are drop-outs"
        )
    if codes:
        keys.append(f"missing = [{', '.join(map(_toml, codes))}]")
    line = f"{quantity} = {{ {', '.join(keys)} }}"
    return line + (f"  # GUESS: {'; '.join(doubts)}" if doubts else "")


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)


def _toml(value: object) -> str:
    return _quoted(value) if isinstance(value, str) else str(value).lower()
