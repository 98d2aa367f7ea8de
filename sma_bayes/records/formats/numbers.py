"""From the cells of a column to numbers: missing values are counted, anything else is refused.

What spreadsheets and loggers write where a value is not available (`NOT_AVAILABLE`) is missing without being declared.
NaN or infinity written in a text file is refused, unless declared as a code: nobody but its author knows whether
it stands for a missing value, a division by zero or a broken sensor.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sma_bayes.arrays import Floats, Ints
from sma_bayes.errors import MeasurementError, ReadingError, many
from sma_bayes.records.formats.table import Cells, rows_finding
from sma_bayes.records.types import Finding

NOT_AVAILABLE: Final = frozenset({"#N/A", "#N/A N/A", "N/A", "n/a", "#NA", "NA"})
"""Texts that say that a value is not available, and nothing else."""

_COMMA_NUMBER = re.compile(r"[+-]?\d+,\d+([eE][+-]?\d+)?")

_THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2},\d{3}")

# float() accepts 1_000, a Python habit that no instrument has; with a decimal comma a point can only group
# thousands, which would be read a thousand times too small. Both become a character that float() refuses.
_STRICT = {".": str.maketrans({"_": "?"}), ",": str.maketrans({"_": "?", ",": ".", ".": "?"})}


def numbers(
    cells: Cells,
    row: Ints,
    *,
    file: Path,
    column: str,
    missing: Sequence[float | str] = (),
    decimal: str = ".",
    expected: str = "a number",
) -> tuple[Floats, tuple[Finding, ...]]:
    """Numbers of one column; NaN where a value is missing.

    Parameters
    ----------
    cells : Cells, length n
        Cells as a format gave them.
    row : ndarray of int, shape (n,)
        Source line of each cell.
    file : Path
        For messages.
    column : str
        For messages.
    missing : sequence of float or str
        Codes of a missing value.
    decimal : str
        Decimal mark.
    expected : str
        What a cell should hold, for messages.

    Returns
    -------
    values : ndarray, shape (n,)
    findings : tuple of Finding
        Counts of empty cells and of missing-value codes. NaN in a format that stores numbers is its empty cell.

    Raises
    ------
    MeasurementError
        If a cell holds text that is neither a number nor a code, NaN written out or infinity that is no code, or
        if no number is left.

    Examples
    --------
    >>> values, seen = numbers(["1.5", "", "ERR"], np.array([2, 3, 4]), file=Path("a.csv"), column="F",
    ...                        missing=["ERR"])
    >>> values.tolist(), [f.kind for f in seen]
    ([1.5, nan, nan], ['empty', 'missing-code'])
    """
    values, empty, unread = _parse(cells, missing, decimal)
    absent = {text for i in np.flatnonzero(unread) if (text := str(cells[int(i)]).strip()) in NOT_AVAILABLE}
    if absent:
        missing = (*missing, *sorted(absent))
        values, empty, unread = _parse(cells, missing, decimal)
    coded = _coded(cells, values, empty, missing)
    if isinstance(cells, np.ndarray):
        empty = np.isnan(values)
    odd = ~np.isfinite(values) & ~empty & ~coded
    wrong = np.flatnonzero(unread if unread.any() else odd)
    if wrong.size:
        raise _not_a_number(str(cells[wrong[0]]).strip(), row[wrong], file, column, decimal, expected)
    told = (
        ("empty", empty & ~coded, "empty" if not isinstance(cells, np.ndarray) else "without a number (NaN)"),
        ("missing-code", coded, f"with a missing-value code ({', '.join(map(str, missing))})"),
    )
    findings = tuple(
        rows_finding(
            kind,
            f"{many(int(mask.sum()), 'cell')} {what} in {column!r}, taken as missing",
            row[mask],
            column=column,
        )
        for kind, mask, what in told
        if mask.any()
    )
    values[coded] = np.nan
    if not np.isfinite(values).any():
        raise ReadingError(
            f"no number in {len(row)} rows",
            file=file,
            column=column,
            expected="at least one value that is not missing",
            remedy="map another column, or correct the missing-value codes and the limits of the rows",
            elsewhere="fill the column, or name another one",
        )
    return values, findings


def looks_numeric(cell: object) -> bool:
    """Whether a cell can be read as a number under one decimal mark or the other.

    Examples
    --------
    >>> [looks_numeric(c) for c in ("1.5", "1,5", "1e3", "heating", "", None)]
    [True, True, True, False, False, False]
    """
    if not isinstance(cell, str):
        return isinstance(cell, int | float)
    try:
        float(cell.translate(_STRICT["."]))
    except ValueError:
        return _COMMA_NUMBER.fullmatch(cell.strip()) is not None
    return True


def has_decimal_commas(cells: Iterable[object]) -> bool:
    """Whether cells are written with a decimal comma, and can't be whole numbers with commas between thousands.

    Examples
    --------
    >>> has_decimal_commas(["12,5", "7", "0,125"]), has_decimal_commas(["1,250", "2,500"])
    (True, False)
    """
    texts = [cell.strip() for cell in cells if isinstance(cell, str) and ("," in cell or "." in cell)]
    commas = [text for text in texts if _COMMA_NUMBER.fullmatch(text)]
    points = any(looks_numeric(text) for text in texts if "." in text)
    return bool(commas) and not points and not all(_THOUSANDS.fullmatch(text) for text in commas)


def is_blank(cell: object) -> bool:
    """Whether a cell is empty."""
    return cell is None or (isinstance(cell, str) and not cell.strip())


def _parse(
    cells: Cells, missing: Sequence[float | str], decimal: str
) -> tuple[Floats, NDArray[np.bool_], NDArray[np.bool_]]:
    """Values of the cells, which of them are empty, and which can't be read; codes that are texts become NaN."""
    nowhere = np.zeros(len(cells), dtype=bool)
    if isinstance(cells, np.ndarray):
        return np.array(cells, dtype=float), nowhere, nowhere
    plain = decimal == "." and not any("_" in c for c in cells if isinstance(c, str))
    strict = cells if plain else [_strict(c, decimal) for c in cells]
    try:
        values = np.fromiter(map(float, strict), np.float64, len(cells))  # type: ignore[arg-type]
    except (ValueError, TypeError):
        return _parse_each(cells, missing, decimal)
    return values, nowhere, nowhere


def _strict(cell: object, decimal: str) -> object:
    return cell.translate(_STRICT[decimal]) if isinstance(cell, str) else cell


def _parse_each(
    cells: Sequence[object], missing: Sequence[float | str], decimal: str
) -> tuple[Floats, NDArray[np.bool_], NDArray[np.bool_]]:
    values = np.full(len(cells), np.nan)
    empty, unread = np.zeros((2, len(cells)), dtype=bool)
    codes = {code for code in missing if isinstance(code, str)}
    for i, cell in enumerate(cells):
        try:
            values[i] = float(_strict(cell, decimal))  # type: ignore[arg-type]
        except (ValueError, TypeError):
            if is_blank(cell):
                empty[i] = True
            elif str(cell).strip() not in codes:
                unread[i] = True
    return values, empty, unread


def _coded(
    cells: Cells, values: Floats, empty: NDArray[np.bool_], missing: Sequence[float | str]
) -> NDArray[np.bool_]:
    codes = np.array([code for code in missing if not isinstance(code, str)], dtype=float)
    mask = np.isin(values, codes)
    if np.isnan(codes).any():  # no NaN equals another
        mask |= np.isnan(values) & ~empty
    texts = {code for code in missing if isinstance(code, str)}
    if texts and not isinstance(cells, np.ndarray):
        mask |= np.fromiter((isinstance(c, str) and c.strip() in texts for c in cells), bool, len(cells))
    return mask


def _not_a_number(
    text: str, rows: Ints, file: Path, column: str, decimal: str, expected: str
) -> MeasurementError:
    more = ", the name of the column again, as where a log was begun anew" if text == column else ""
    more += f" (and {rows.size - 1} more in this column)" if rows.size > 1 else ""
    if decimal == "." and _COMMA_NUMBER.fullmatch(text):
        remedy = 'if the comma is a decimal mark, set decimal = "," in [reading] of campaign.toml'
        elsewhere = "write all numbers of the file with one decimal mark"
    else:
        elsewhere = "correct the cell, leave it empty where the value is missing, or remove the row"
        remedy = (
            f"correct the cell, map another column, or in [reading] of campaign.toml list {text!r} under `missing`, or "
            "leave the line out with `skip_rows`, `first_row` or `last_row`"
        )
    return ReadingError(
        f"found {text!r}{more}",
        file=file,
        row=int(rows[0]),
        column=column,
        expected=expected,
        remedy=remedy,
        elsewhere=elsewhere,
    )
