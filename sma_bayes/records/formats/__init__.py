"""Data formats: each file of this folder reads one; `read_table` finds the one that a file has."""

from __future__ import annotations

from pathlib import Path

from sma_bayes.catalogue import Catalogue, not_a
from sma_bayes.errors import MeasurementError, ReadingError
from sma_bayes.records.formats import delimited, lvm, mat, tdms, xlsx
from sma_bayes.records.formats.table import Format, RawTable, Reading, limited

__all__ = ["FORMATS", "Format", "RawTable", "Reading", "read_table", "recognise"]

FORMATS: Catalogue[Format] = Catalogue(
    "data format",
    {
        "delimited": delimited.FORMAT,
        "lvm": lvm.FORMAT,
        "mat": mat.FORMAT,
        "tdms": tdms.FORMAT,
        "xlsx": xlsx.FORMAT,
    },
    entry_point_group="sma_bayes.formats",
    fault=not_a(Format),
)

_HEAD = 4096


def recognise(path: Path) -> str:
    """Name of the format of a file, told from its content.

    Formats with a signature are asked first; plain text is what has none.

    Raises
    ------
    MeasurementError
        If the file can't be read, is empty, or is recognised by no format or by several.
    """
    head = _head(path)
    for plain in (False, True):
        names = [n for n, form in FORMATS.items() if form.plain is plain and form.recognises(path, head)]
        if len(names) == 1:
            return names[0]
        if names:
            raise ReadingError(
                "several formats recognise the file: " + ", ".join(names),
                file=path,
                expected="one format",
                remedy="set `format` in [reading] of campaign.toml to one of them",
                elsewhere="export it as CSV",
            )
    raise ReadingError(
        "the file is of no format that is known",
        file=path,
        expected=", ".join(form.title for form in FORMATS.values()),
        remedy="export it as CSV, or set `format` and `encoding` in [reading] of campaign.toml",
        elsewhere="export it as CSV",
    )


def read_table(path: Path, reading: Reading) -> RawTable:
    """Read a data file in the format that it has.

    Parameters
    ----------
    path : Path
    reading : Reading
        ``format`` names the format; found by itself otherwise.

    Returns
    -------
    RawTable
        Rows from ``first_row`` to ``last_row``.

    Raises
    ------
    MeasurementError
        If the file is not there, empty, unreadable, of no known format, or not as its format wants it.
    UnknownNameError
        If ``format`` names no format.
    """
    form = FORMATS[reading.format if reading.format is not None else recognise(path)]
    _head(path)
    return limited(form.read(path, reading), reading, path)


def _head(path: Path) -> bytes:
    """First bytes of a file that is there, can be read and is not empty."""
    try:
        with path.open("rb") as file:
            head = file.read(_HEAD)
    except OSError as error:
        raise MeasurementError(
            f"can't be read: {error.strerror}",
            file=path,
            expected="a data file",
            remedy="correct the path or the permissions",
        ) from None
    if not head.strip():
        raise MeasurementError(
            "the file is empty" if not head else "the file has only blank lines",
            file=path,
            expected="rows of measurements",
            remedy="replace it by the measurements, or leave it out",
        )
    return head
