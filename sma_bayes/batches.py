"""Long batches in parts, so that intermediate arrays do not grow with them."""

from __future__ import annotations

from collections.abc import Iterator

LEAST_ROWS = 16
"""Rows of a part, at least: fewer would not be worth the call."""


def batches(rows: int, width: int, most: int) -> Iterator[slice]:
    """Cut a batch into parts.

    Parameters
    ----------
    rows : int
        Of the batch.
    width : int
        Numbers that each row takes.
    most : int
        Numbers that a part should take at most; it has `LEAST_ROWS` rows even where that is more.

    Examples
    --------
    >>> list(batches(40, 10, 200))
    [slice(0, 20, None), slice(20, 40, None)]
    >>> list(batches(0, 10, 200))
    []
    """
    size = max(LEAST_ROWS, most // max(width, 1))
    for start in range(0, rows, size):
        yield slice(start, min(start + size, rows))
