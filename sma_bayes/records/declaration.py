"""What a campaign file declares, checked: files, columns, units, conditions."""

from __future__ import annotations

import errno
import re
import unicodedata
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from fnmatch import fnmatch
from glob import glob
from pathlib import Path
from typing import Annotated, Any, Final, get_type_hints

from pydantic import (
    Field,
    create_model,
    field_validator,
    model_validator,
)

from sma_bayes.disk import quoted
from sma_bayes.errors import CampaignError, SmaBayesError, first_of, many, near_matches, require_known
from sma_bayes.limits import DEGREES, ID_BYTES, ID_CHARACTERS, MAGNITUDE, SETTING
from sma_bayes.quantities import CHANNELS, QUANTITIES, SPECIMEN_QUANTITY, STANDARD_GRAVITY
from sma_bayes.records.formats import Reading
from sma_bayes.records.split import SplitSettings
from sma_bayes.records.toml_table import StrictTable, as_toml, checked, declared_bytes, parsed_toml
from sma_bayes.records.types import Condition

CAMPAIGN_FILE: Final = "campaign.toml"
WRITTEN_BY_A_RUN: Final = "run.json"
"""Stands in every folder that a run has written, often beside a copy of the campaign file."""

FILES_SHOWN, FILES_NAMED = 10, 3
"""So many files of a folder are listed in a message, and so many of a condition."""

UNITLESS: Final = ("time", "cycle", "branch", "drive")
"""Quantities whose column needs no unit: time does not where it is a clock."""

SETTING_COLUMNS: Final = {"load": "N", "frequency": "Hz", "duty_cycle": "1"}
"""What was set on the rig and may stand in a column as well, with its unit; the load of a specimen is a stress [Pa]."""

CHANNEL_OF: Final = {quantity: channel for channel, quantity in SPECIMEN_QUANTITY.items()}
"""Channel in which stress, strain and modulus are kept."""

_NOT_IN_FILE_NAMES = re.compile(r'[\x00-\x1f<>:"/\\|?*]|^[ .]|[ .]$')
_DEVICE_NAMES = re.compile(r"(con|prn|aux|nul|com\d|lpt\d)(\..*)?", re.IGNORECASE)


class ColumnDeclaration(StrictTable):
    """One entry of ``[columns]``: where a quantity stands in the file and how it becomes a quantity.

    A reading becomes ``offset + scale * reading`` in the unit `to`; without scale and offset it is in `unit`.

    Attributes
    ----------
    name : str, optional
        Header of the column.
    column : int, optional
        Number of the column, from 1.
    row_interval : float, optional
        Time between two rows, for a file without a time column.
    unit : str, optional
        Unit of the reading, or ``"arbitrary"``.
    scale, offset : float, optional
        Calibration line.
    to : str, optional
        Unit after the calibration.
    scale_sd, offset_sd : float, optional
        Standard deviations of scale [to / unit] and of the line at `reference` [to].
    reference : float
        Reading at which the errors of scale and offset are independent [unit]: 0 where they were found one by
        one, the mean of the calibration readings where a line was fitted to them by least squares.
    sd : float, optional
        Standard deviation of the error of one temperature reading [to, or unit].
    missing : tuple of float or str
        Codes of a missing value in this column.
    valid : tuple of (float, float), optional
        Readings outside these limits are missing [unit].
    file : str, optional
        Which of the files of a condition this is about: a name, or a pattern such as ``*_force.csv``.
    """

    name: str | None = None
    column: int | None = Field(default=None, ge=1)
    row_interval: float | None = Field(default=None, gt=0)
    unit: str | None = None
    scale: float | None = None
    offset: float | None = None
    to: str | None = None
    scale_sd: float | None = Field(default=None, ge=0)
    offset_sd: float | None = Field(default=None, ge=0)
    reference: float = 0.0
    sd: float | None = Field(default=None, ge=0)
    missing: Annotated[tuple[float | str, ...], Field(strict=False)] = ()
    valid: Annotated[tuple[float, float], Field(strict=False)] | None = None
    file: str | None = None

    @model_validator(mode="after")
    def _consistent(self) -> ColumnDeclaration:
        if sum(value is not None for value in (self.name, self.column, self.row_interval)) != 1:
            raise ValueError("exactly one of name, column, row_interval")
        if self.scale == 0:
            raise ValueError("a scale other than 0")
        if self.to is not None and self.scale is None and self.offset is None:
            raise ValueError("a scale or an offset beside `to`")
        if any((sd or 0.0) > MAGNITUDE.value for sd in (self.scale_sd, self.offset_sd, self.sd)):
            raise ValueError(f"standard deviations up to {MAGNITUDE.value:g}")
        if (self.sd or 0.0) > DEGREES.value:
            raise ValueError(f"sd, the error of a temperature reading, up to {DEGREES.value:g}")
        if self.reference and self.scale_sd is None:
            raise ValueError("a scale_sd beside `reference`")
        if self.valid and self.valid[0] >= self.valid[1]:
            raise ValueError("valid = [low, high] with low below high")
        return self

    @property
    def calibrated_unit(self) -> str:
        """Unit after the calibration line."""
        return self.to or self.unit or "1"


class TimeWindow(StrictTable):
    """Limits of time in ``[segmentation]`` [s]."""

    time_from: float | None = None
    time_to: float | None = None


# one key for each setting of the splitting, whichever there are, with the settings' own types
_SETTINGS: Final[dict[str, Any]] = {
    name: (hint, None) for name, hint in get_type_hints(SplitSettings).items()
}
_SegmentationTable = create_model("_SegmentationTable", __base__=TimeWindow, **_SETTINGS)


_Level = Annotated[float, Field(ge=0, le=SETTING.value)]
_Frequency = Annotated[float, Field(gt=0, le=SETTING.value)]


class ConditionTable(StrictTable):
    """One ``[[condition]]``: its file, what was set on the rig, and what it has of its own."""

    id: str
    file: str | Annotated[tuple[str, ...], Field(strict=False, min_length=1)]
    current_A: _Level | None = None
    load_g: _Level | None = None
    load_N: _Level | None = None
    stress_MPa: _Level | None = None
    frequency_mHz: _Frequency | None = None
    frequency_Hz: _Frequency | None = None
    duty_cycle_pct: float | None = Field(default=None, gt=0, le=100)
    columns: dict[str, Any] = Field(default_factory=dict)
    reading: dict[str, Any] = Field(default_factory=dict)
    segmentation: dict[str, Any] = Field(default_factory=dict)

    @property
    def files(self) -> tuple[str, ...]:
        """Names and patterns of the data files."""
        return (self.file,) if isinstance(self.file, str) else self.file

    @field_validator("id")
    @classmethod
    def _names_files(cls, name: str) -> str:
        too_long = len(name) > ID_CHARACTERS.value or len(name.encode()) > ID_BYTES.value
        if not name or too_long or _NOT_IN_FILE_NAMES.search(name) or _DEVICE_NAMES.fullmatch(name):
            raise ValueError(
                f"an id that can stand in a file name: 1 to {ID_CHARACTERS.value} characters, at most {ID_BYTES.value} "
                'bytes in UTF-8, none of < > : " / \\ | ? *, no blank or point at either end, no name of a device'
            )
        return name

    @model_validator(mode="after")
    def _consistent(self) -> ConditionTable:
        if sum(load is not None for load in (self.load_g, self.load_N, self.stress_MPa)) > 1:
            raise ValueError("one of load_g, load_N, stress_MPa")
        if self.frequency_mHz is not None and self.frequency_Hz is not None:
            raise ValueError("one of frequency_mHz, frequency_Hz")
        return self

    @property
    def declared_units(self) -> dict[str, str]:
        """Unit of each setting as it is declared here; grams are those of a mass that was hung on the spring."""
        declared = {
            ("current", "A"): self.current_A,
            ("load", "g"): self.load_g,
            ("load", "N"): self.load_N,
            ("load", "MPa"): self.stress_MPa,
            ("frequency", "mHz"): self.frequency_mHz,
            ("frequency", "Hz"): self.frequency_Hz,
            ("duty_cycle", "percent"): self.duty_cycle_pct,
        }
        return {setting: unit for (setting, unit), value in declared.items() if value is not None}

    def condition(self, *, specimen: bool) -> Condition:
        """What was set on the rig, in canonical units.

        Raises
        ------
        ValueError
            If the load is not of the kind that the measured quantities need.
        """
        if specimen and (self.load_g is not None or self.load_N is not None):
            raise ValueError("stress_MPa, because stress, strain or modulus of a specimen were measured")
        if not specimen and self.stress_MPa is not None:
            raise ValueError("load_g or load_N, because force, displacement or stiffness were measured")
        loads = (
            None if self.load_g is None else self.load_g * 1e-3 * STANDARD_GRAVITY,
            self.load_N,
            None if self.stress_MPa is None else self.stress_MPa * 1e6,
        )
        return Condition(
            id=self.id,
            current=self.current_A,
            load=next((load for load in loads if load is not None), None),
            frequency=self.frequency_Hz if self.frequency_mHz is None else self.frequency_mHz * 1e-3,
            duty_cycle=None if self.duty_cycle_pct is None else self.duty_cycle_pct / 100,
        )


class _CampaignTable(StrictTable):
    name: str | None = None
    data: str | None = None


class _Document(StrictTable):
    campaign: dict[str, Any] = Field(default_factory=dict)
    columns: dict[str, Any] = Field(default_factory=dict)
    reading: dict[str, Any] = Field(default_factory=dict)
    segmentation: dict[str, Any] = Field(default_factory=dict)
    condition: list[dict[str, Any]] = Field(default_factory=list)


@dataclass(frozen=True, slots=True)
class DeclaredCondition:
    """One condition with everything that concerns it, what the whole campaign declares included.

    Attributes
    ----------
    table : ConditionTable
    declared_in : Path
        File to name in messages about the declaration.
    where : str
        Place in that file, for messages.
    paths : tuple of Path
        Data files.
    names : tuple of str
        The same as the campaign names them.
    columns : mapping of str to tuple of ColumnDeclaration
        Empty where the columns are to be known by their default names. A quantity has several entries where the files
        call it differently.
    reading : Reading
    window : TimeWindow
    settings : SplitSettings
    """

    table: ConditionTable
    declared_in: Path
    where: str
    paths: tuple[Path, ...]
    names: tuple[str, ...]
    columns: Mapping[str, tuple[ColumnDeclaration, ...]]
    reading: Reading
    window: TimeWindow
    settings: SplitSettings

    @property
    def path(self) -> Path:
        """The data file, or the first of several."""
        return self.paths[0]

    @property
    def title(self) -> str:
        """Names of the files, for messages and records."""
        return first_of(self.names, FILES_NAMED)

    def of_each_file(self) -> tuple[DeclaredCondition, ...]:
        """The same for each file by itself, with the entries of columns that are about it."""
        return tuple(
            replace(
                self,
                paths=(path,),
                names=(name,),
                columns={
                    quantity: own
                    for quantity, entries in self.columns.items()
                    if (
                        own := tuple(
                            c for c in entries if c.file is None or fnmatch(path.name, Path(c.file).name)
                        )
                    )
                },
            )
            for path, name in zip(self.paths, self.names, strict=True)
        )


@dataclass(frozen=True, slots=True)
class Declaration:
    """A campaign as declared.

    Attributes
    ----------
    name : str
    source : Path
        Campaign file, or the single data file.
    content : bytes
        Content of the campaign file; empty for a single data file.
    conditions : tuple of DeclaredCondition
    """

    name: str
    source: Path
    content: bytes
    conditions: tuple[DeclaredCondition, ...]


def read_declaration(path: Path, data_dir: Path | None, settings: SplitSettings) -> Declaration:
    """Read and check the declaration of a campaign, without opening its data files.

    Parameters
    ----------
    path : Path
        Folder with a ``campaign.toml``, a campaign file, or a single data file with default column names.
    data_dir : Path or None
        Folder of the data files, in place of the one that the campaign declares.
    settings : SplitSettings
        Settings for what the campaign leaves open.

    Raises
    ------
    CampaignError
        If the declaration is not there or wrong.
    """
    if path.is_dir():
        path = _campaign_in(path)
    if not path.is_file():
        raise CampaignError(
            "there is no such file or folder",
            file=path,
            expected=f"a folder with {CAMPAIGN_FILE}, a campaign file, or a data file",
            remedy=_similar(path),
        )
    if path.suffix.lower() != ".toml":
        if data_dir is not None:
            raise CampaignError(
                f"--data {data_dir} beside a data file",
                file=path,
                expected="--data with a campaign file that names data files",
                remedy="leave --data out",
            )
        return _single_file(path, settings)
    return parse_declaration(declared_bytes(path), path, data_dir, settings)


def parse_declaration(
    content: bytes, path: Path, data_dir: Path | None, settings: SplitSettings
) -> Declaration:
    """Check the content of a campaign file, which need not be on the disk; see `read_declaration`."""
    document = checked(_Document, parsed_toml(content, path), file=path, where="")
    campaign = checked(_CampaignTable, document.campaign, file=path, where="campaign")
    folder = data_dir if data_dir is not None else path.parent / (campaign.data or "")
    if not document.condition:
        raise CampaignError(
            "no condition is declared",
            file=path,
            expected="at least one [[condition]] with id and file",
            remedy="add a [[condition]] for each data file",
        )
    conditions = tuple(_conditions(document, path, folder, settings))
    _refuse_equal_ids(conditions, path)
    name = campaign.name or (path.parent.resolve().name if path.name == CAMPAIGN_FILE else path.stem)
    return Declaration(name, path, content, conditions)


def declared_for_file(
    content: bytes, declared_in: Path, condition: str, path: Path, settings: SplitSettings
) -> DeclaredCondition:
    """Declaration of a condition for another file of it.

    Limits of rows and time are about its own file and are left out.

    Parameters
    ----------
    content : bytes
        Of the campaign file; empty for columns with default names.
    declared_in : Path
        Its name, for messages.
    condition : str
        Id of the condition.
    path : Path
        The other file.
    settings : SplitSettings

    Raises
    ------
    CampaignError
        If the condition is not declared, or is declared with several files.
    """
    if not content:
        (found,) = _single_file(path, settings).conditions
        table = checked(ConditionTable, {"id": condition, "file": path.name}, file=path, where="condition")
        return replace(found, table=table)
    document = checked(_Document, parsed_toml(content, declared_in), file=declared_in, where="")
    values = next((v for v in document.condition if v.get("id") == condition), None)
    if values is None:
        ids = [str(v.get("id")) for v in document.condition]
        raise CampaignError(
            f"no condition {condition!r}",
            file=declared_in,
            column="condition.id",
            expected=near_matches(condition, ids),
        )
    if not isinstance(values.get("file"), str):
        raise CampaignError(
            f"condition {condition!r} has several files",
            file=declared_in,
            column="condition.file",
            expected="one file with all columns of a cycle",
            remedy="join the columns into one file, and declare the campaign of such files",
        )
    alone = document.model_copy(update={"condition": [{**values, "file": path.name}]})
    (found,) = _conditions(alone, declared_in, path.parent, settings)
    reading = found.reading.model_copy(update={"first_row": None, "last_row": None})
    return replace(found, reading=reading, window=TimeWindow())


def declared_condition(
    table: Mapping[str, Any], columns: Mapping[str, Any], declared_in: Path, settings: SplitSettings
) -> DeclaredCondition:
    """Check one condition whose measurements are in no file.

    Parameters
    ----------
    table : mapping
        As a ``[[condition]]``; `file` is how messages call the measurements.
    columns : mapping
        As ``[columns]``.
    declared_in : Path
        How messages call the declaration.
    settings : SplitSettings

    Raises
    ------
    CampaignError
        If a key, a quantity or a value is wrong.
    """
    where = f"condition {table.get('id')!r}"
    condition = checked(ConditionTable, table, file=declared_in, where=where)
    declared = _columns(columns, declared_in, "columns")
    if declared:
        require_channels(declared, file=declared_in, where="columns")
    names = condition.files
    return DeclaredCondition(
        condition,
        declared_in,
        where,
        tuple(map(Path, names)),
        names,
        declared,
        Reading(),
        TimeWindow(),
        settings,
    )


def require_channels(names: Mapping[str, object] | set[str], *, file: Path, where: str) -> None:
    """Check that the quantities make a record.

    Raises
    ------
    CampaignError
        If there is no temperature or no channel, or if a spring's and a specimen's quantities are mixed.
    """
    spring, specimen = set(names) & set(CHANNELS), set(names) & set(CHANNEL_OF)
    if spring and specimen:
        raise CampaignError(
            f"{', '.join(sorted(spring | specimen))} are declared together",
            file=file,
            column=where,
            expected="force, displacement, stiffness of a spring, or stress, strain, modulus of a specimen",
            remedy="keep one kind; `scale` and `to` turn a force into a stress by the area of the wire",
        )
    if "temperature" not in names or not spring | specimen:
        lacking = "a channel" if "temperature" in names else "the temperature"
        remedy = "declare its column under [columns]"
        if "temperature" not in names:
            remedy += "; data without a temperature can't be used: the curves are functions of temperature"
        raise CampaignError(
            f"{lacking} is not declared",
            file=file,
            column=where,
            expected=f"temperature and at least one of {', '.join((*CHANNELS, *CHANNEL_OF))}",
            remedy=remedy,
        )


def _campaign_in(folder: Path) -> Path:
    path = folder / CAMPAIGN_FILE
    if path.is_file():
        return path
    there = sorted(p.name for p in folder.iterdir() if p.is_file())
    below = sorted(p.parent.name for p in folder.glob(f"*/{CAMPAIGN_FILE}"))
    if below:
        remedy = f"there is one in {str(folder / below[0])!r}: name that folder"
    elif there:
        remedy = (
            f"`sma-bayes init {quoted(folder)}` writes one; or name a single data file with default column names; "
            f"the folder holds {first_of(there, FILES_SHOWN)}"
        )
    else:
        remedy = "the folder holds no files: name the folder of the measurements"
    raise CampaignError(
        f"the folder has no {CAMPAIGN_FILE}",
        file=folder,
        expected=f"{CAMPAIGN_FILE} beside the data files",
        remedy=remedy,
    )


def _single_file(path: Path, settings: SplitSettings) -> Declaration:
    table = checked(ConditionTable, {"id": path.stem, "file": path.name}, file=path, where="file name")
    condition = DeclaredCondition(
        table, path, "", (path,), (path.name,), {}, Reading(), TimeWindow(), settings
    )
    return Declaration(path.stem, path, b"", (condition,))


def _conditions(
    document: _Document, path: Path, folder: Path, settings: SplitSettings
) -> Iterator[DeclaredCondition]:
    for number, values in enumerate(document.condition, start=1):
        where = f"condition {values.get('id', number)!r}"
        table = checked(ConditionTable, values, file=path, where=where)
        columns = {
            **_columns(document.columns, path, "columns"),
            **_columns(table.columns, path, f"{where}.columns"),
        }
        if columns:
            require_channels(columns, file=path, where=f"{where}.columns" if table.columns else "columns")
        reading = {**document.reading, **table.reading}
        window, split = _segmentation(
            {**document.segmentation, **table.segmentation},
            settings,
            path,
            _place("segmentation", table.segmentation, where),
        )
        paths = _data_files(table, folder, path, where)
        yield DeclaredCondition(
            table=table,
            declared_in=path,
            where=where,
            paths=tuple(paths.values()),
            names=tuple(paths),
            columns=columns,
            reading=checked(Reading, reading, file=path, where=_place("reading", table.reading, where)),
            window=window,
            settings=split,
        )


def _data_files(table: ConditionTable, folder: Path, declared_in: Path, where: str) -> dict[str, Path]:
    """Data files of a condition by their names; a pattern stands for all files that match it, in alphabetical order."""
    found: dict[str, Path] = {}
    for name in table.files:
        path = folder / name
        there = _is_file(path)
        matching = [] if there else _matching(name, folder)
        if not there and not matching:
            raise CampaignError(
                f"there is no file {str(path)!r}",
                file=declared_in,
                column=f"{where}.file",
                expected="a data file" + (" in the data folder" if folder != declared_in.parent else ""),
                remedy=_similar(path),
            )
        found |= {Path(m).as_posix(): folder / m for m in matching} if matching else {name: path}
    return found


def _is_file(path: Path) -> bool:
    """Whether a file is there; none is where its name is longer than the system takes."""
    try:
        return path.is_file()
    except OSError as error:
        if error.errno == errno.ENAMETOOLONG:
            return False
        raise


def _matching(pattern: str, folder: Path) -> list[str]:
    """Files that match a pattern, sorted; the pattern counts from the folder unless it is absolute."""
    found = glob(pattern, root_dir=folder, recursive=True, include_hidden=True)
    return sorted({name for name in found if (folder / name).is_file()}, key=Path)


def _place(table: str, own: Mapping[str, object], where: str) -> str:
    """Name of a table for messages: the condition's own where it has one."""
    return f"{where}.{table}" if own else table


def _columns(tables: Mapping[str, Any], path: Path, where: str) -> dict[str, tuple[ColumnDeclaration, ...]]:
    found = {}
    for name, values in tables.items():
        entries = values if isinstance(values, list) else [values]
        found[name] = tuple(_column(name, entry, path, f"{where}.{name}") for entry in entries)
        if len(entries) != 1 and not (entries and all(c.file for c in found[name])):
            raise CampaignError(
                f"{many(len(entries), 'table')} for {name}",
                file=path,
                column=f"{where}.{name}",
                expected="one table, or a list of tables each with the `file` that it is about",
            )
    return found


def _column(name: str, values: Any, path: Path, where: str) -> ColumnDeclaration:
    known = (*QUANTITIES, *SETTING_COLUMNS)
    require_known(name, known, f"unknown quantity {name!r}", CampaignError, file=path, column=where)
    if not isinstance(values, Mapping):
        raise CampaignError(
            f"found {as_toml(values)}",
            file=path,
            column=where,
            expected='a table such as { name = "header in the file", unit = "N" }',
        )
    column = checked(ColumnDeclaration, values, file=path, where=where)
    wrong = _misplaced(name, column)
    if wrong:
        raise CampaignError(wrong[0], file=path, column=where, expected=wrong[1])
    return column


def _misplaced(name: str, column: ColumnDeclaration) -> tuple[str, str] | None:
    """What in a column's table doesn't suit its quantity: what was found, what was expected."""
    uncertain = column.scale_sd is not None or column.offset_sd is not None
    if column.unit is None and name not in UNITLESS:
        usual = SETTING_COLUMNS.get(name) or QUANTITIES[name].unit
        return "no unit", f'unit = "{usual}" or another unit of {name}, or "arbitrary"'
    if column.row_interval is not None and column.unit is None:
        return "no unit", 'unit = "s" or another unit of time beside row_interval'
    if column.row_interval is not None and name != "time":
        return "row_interval", "row_interval for time only; other columns have a name or a number"
    if column.sd is not None and name != "temperature":
        return "sd", "sd for temperature only; noise of the channels is found in the data"
    if uncertain and name not in {"temperature", *CHANNELS, *CHANNEL_OF}:
        return (
            "scale_sd or offset_sd",
            "these for temperature, force, displacement, stiffness, or stress, strain, modulus",
        )
    return None


def _segmentation(
    values: Mapping[str, Any], settings: SplitSettings, path: Path, where: str
) -> tuple[TimeWindow, SplitSettings]:
    """Limits of time, and the given settings with those that a campaign declares laid over them."""
    declared = {key: tuple(value) if isinstance(value, list) else value for key, value in values.items()}
    table = checked(_SegmentationTable, declared, file=path, where=where)
    window = TimeWindow.model_validate(table.model_dump(include=set(TimeWindow.model_fields)))
    changes = table.model_dump(exclude_unset=True, exclude=set(TimeWindow.model_fields))
    if changes.get("fit_channels"):
        changes["fit_channels"] = tuple(CHANNEL_OF.get(c, c) for c in changes["fit_channels"])
    try:
        return window, replace(settings, **changes)
    except SmaBayesError as error:
        raise CampaignError(
            error.found, file=path, column=where, expected=error.expected, remedy=error.remedy
        ) from None


def _refuse_equal_ids(conditions: tuple[DeclaredCondition, ...], path: Path) -> None:
    seen: dict[str, str] = {}
    for condition in conditions:
        name = condition.table.id
        form = _as_seen(name)
        other = seen.get(form)
        if other is not None:
            only = "by case" if other.casefold() == name.casefold() else "by how Unicode writes it"
            how = "" if other == name else f", which differs from {other!r} only {only}"
            raise CampaignError(
                f"two conditions have the id {name!r}{how}",
                file=path,
                column="condition.id",
                expected="ids that differ, because they name files",
                remedy="rename one of them",
            )
        seen[form] = name


def _as_seen(name: str) -> str:
    """A name in the one form that all its ways of being written share, without characters that nobody sees."""
    plain = unicodedata.normalize("NFKC", name)
    return "".join(c for c in plain if unicodedata.category(c) != "Cf").casefold()


def _similar(path: Path) -> str:
    """What stands in the folder instead of a file that isn't there."""
    if not path.parent.is_dir():
        return f"there is no folder {str(path.parent)!r} either; correct it, or name the folder of the data"
    there = sorted(p.name for p in path.parent.iterdir())
    if not there:
        return f"{_folder(path)} is empty; name the folder of the data"
    if WRITTEN_BY_A_RUN in there:
        return f"{_folder(path)} is what a run has written; name the folder of the measurements, or give it as --data"
    below = [name for name in there if (path.parent / name / path.name).is_file()]
    if below:
        where = str(path.parent / below[0])
        return f"a file of that name is in {where!r}; name that folder as the data folder (--data)"
    near = near_matches(path.name, there)
    if near.startswith("did you mean"):
        return near
    return f"{_folder(path)} holds {first_of(there, FILES_SHOWN)}"


def _folder(path: Path) -> str:
    """The folder of a file, as a message calls it."""
    return "this folder" if path.parent == Path() else f"the folder {str(path.parent)!r}"
