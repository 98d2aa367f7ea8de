"""Readings whose decimal mark was lost: 1.234 read as 1234, 100 times its neighbours or more."""

from __future__ import annotations

from typing import Final

import numpy as np

from sma_bayes.arrays import Floats, Ints
from sma_bayes.errors import many
from sma_bayes.quantities import CHANNELS
from sma_bayes.records.ledger import ROWS_SHOWN, Ledger
from sma_bayes.records.run import Run
from sma_bayes.records.types import Finding

LEAST_READINGS: Final = 10
"""Readings other than zero from which on a column is looked at."""
DECIMALS: Final = (2, 6)
"""Digits that may have stood behind the mark. With one alone a reading is 10 times its neighbours, as many are."""
LEAST_SEPARATION: Final = np.log10(2.0)
"""Least ratio, in powers of ten, of the least reading without its mark to the greatest one that has it."""
LEAST_SHARE_WITH_MARK: Final = 0.25
"""Least share of readings that have their mark: what neighbours say is taken from them."""
TOLERANCE_RANGE: Final = (0.02, 0.2)
"""Least and greatest difference, in powers of ten, of what is taken for one reading with and without its mark. Between
them it is three times what neighbours that have it scatter by."""
LEAST_SHARE_OF_AGREEMENT: Final = 0.9
"""Share of the large readings that must be their neighbours' times a power of ten; by chance it is at most 2/5 of
them."""
SCATTER_RATIO: Final = 5.0
"""By how much less large readings may scatter about each other, over their size, than those that have their mark: a
channel that leaves zero by a step has the same noise before and after."""


def misread_decimals(run: Run) -> tuple[Finding, ...]:
    """Channels of which some readings are their neighbours' times a power of ten, from 100 on.

    Parameters
    ----------
    run : Run
        As it was read, before anything is kept out.

    Returns
    -------
    tuple of Finding
        One for each column, with its first rows and how many there are; nothing is changed.
    """
    ledger = Ledger(run)
    for name in ("temperature", *CHANNELS):
        if name not in run.columns:
            continue
        index = next((i for zero in _zeros(name) if (i := without_mark(run.columns[name] + zero)).size), None)
        if index is not None:
            shown = ", ".join(map(str, run.row[index[:ROWS_SHOWN]])) + (
                " ..." if index.size > ROWS_SHOWN else ""
            )
            message = (
                f"{many(index.size, 'reading')} of {ledger.quantity(name)}, of {run.n}, "
                f"{'is' if index.size == 1 else 'are'} 100 times or more what the readings beside say, by a power of "
                f"ten (row{'s' if index.size > 1 else ''} {shown}): decimal marks may have been lost (1.234 read as "
                "1234)"
            )
            ledger.note(index, "misread-decimals", message, column=name)
    return tuple(ledger.findings)


def _zeros(name: str) -> tuple[float, ...]:
    """What is added to readings so that their zero is that of the file: 22 °C was 295.15 K, or 71.6 °F."""
    return (0.0, 273.15, 160.0 / 9.0) if name == "temperature" else (0.0,)


def without_mark(values: Floats) -> Ints:
    """Places of readings whose decimal mark was lost.

    Readings are parted by their magnitude, at one of the widest steps between them in order of size. The large ones
    are held to a line through the small ones beside them, on a logarithmic scale.

    Parameters
    ----------
    values : ndarray, shape (n,)
        In the order of the file; NaN and zero are passed over.

    Examples
    --------
    >>> values = np.linspace(1.0, 3.0, 20)
    >>> values[[4, 11]] *= 1000.0
    >>> without_mark(values).tolist()
    [4, 11]
    """
    at = np.flatnonzero(np.isfinite(values) & (values != 0.0))
    size = np.log10(np.abs(values[at]))
    if at.size < LEAST_READINGS:
        return at[:0]
    ordered = np.sort(size)
    steps = np.diff(ordered)
    found = at[:0]
    for step in np.argsort(-steps, kind="stable")[:3]:
        if steps[step] < LEAST_SEPARATION or step + 1 < LEAST_SHARE_WITH_MARK * at.size:
            continue
        large = size > ordered[step]
        if np.count_nonzero(large) > found.size and _are_small_ones_without_mark(
            size, np.sign(values[at]), large
        ):
            found = at[large]
    return np.asarray(found)


def _are_small_ones_without_mark(size: Floats, sign: Floats, large: np.ndarray) -> bool:
    there, small = np.flatnonzero(large), np.flatnonzero(~large)
    after = np.searchsorted(small, there)
    before = np.clip(after - 1, 0, small.size - 1)
    after = np.clip(after, 0, small.size - 1)
    sides = size[small[before]], size[small[after]]
    said = np.interp(there, small, size[small])
    decimals = np.round(size[there] - said)
    missed = size[there] - said - decimals
    scatter = _scatter(size[small])
    allowed = np.clip(
        TOLERANCE_RANGE[0] + 3.0 * scatter + 0.5 * np.abs(sides[1] - sides[0]), None, TOLERANCE_RANGE[1]
    )
    agree = (
        (np.abs(missed) <= allowed)
        & (decimals >= DECIMALS[0])
        & (decimals <= DECIMALS[1])
        & (sign[there] == sign[small[before]])
    )
    if np.mean(agree) < LEAST_SHARE_OF_AGREEMENT:
        return False
    return there.size < LEAST_READINGS or _scatter(size[there] - decimals) * SCATTER_RATIO >= scatter


def _scatter(size: Floats) -> float:
    """What neighbours differ by from the mean of those beside them; a median."""
    return float(np.median(np.abs(np.diff(size, 2)))) if size.size > 2 else 0.0
