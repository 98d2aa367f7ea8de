"""Parts of a batch cover it once."""

from __future__ import annotations

import numpy as np
import pytest

from sma_bayes.batches import LEAST_ROWS, batches


@pytest.mark.parametrize(
    ("rows", "width", "most"), [(0, 5, 100), (1, 5, 100), (97, 5, 100), (64, 10**9, 100), (40, 0, 64)]
)
def test_every_row_is_in_one_part(rows: int, width: int, most: int) -> None:
    parts = list(batches(rows, width, most))
    found = [i for part in parts for i in np.arange(rows)[part].tolist()]
    assert found == list(range(rows))
    sizes = [part.stop - part.start for part in parts]
    assert all(size <= LEAST_ROWS or size * width <= most for size in sizes)
    assert all(size >= LEAST_ROWS for size in sizes[:-1])
