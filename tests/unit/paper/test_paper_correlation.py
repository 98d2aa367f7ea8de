"""What the printed statistics imply for r, against arithmetic on the printed digits."""

from __future__ import annotations

import json

import numpy as np
import pytest

from sma_bayes.paper.correlation import implied_average, implied_correlations
from sma_bayes.studies.paper.export import render, select, sheets

R2 = np.array(
    [0.9980, 0.9973, 0.9980, 0.9987, 0.9980, 0.9978, 0.9992, 0.9989, 0.9982, 0.9986, 0.9981, 0.9950]
)
"""Printed R2 of the columns that can be read, in their order."""


def test_columns_that_can_be_read() -> None:
    found = [c for c in implied_correlations() if c.r_from_r2 is not None]
    assert len(implied_correlations()) == 18
    np.testing.assert_allclose([c.r2 for c in found], R2)
    np.testing.assert_allclose([c.r_from_r2 for c in found], R2**0.5)
    np.testing.assert_allclose([c.r_from_r2_rounded for c in found], (R2 - 0.00005) ** 0.5)


def test_adjusted_r2_and_r2_imply_the_same_where_both_are_sound() -> None:
    """1.5 A heating: 0.9979 adjusted, SSE 0.0118, RMSE 0.0133, so 67 degrees of freedom of 72."""
    column = next(c for c in implied_correlations() if (c.condition, c.branch) == ("1.5A-10mHz", "heating"))
    assert column.dof == pytest.approx(0.0118 / 0.0133**2)
    assert column.r_from_adj_r2 == pytest.approx((1 - 0.0021 * 66.71 / 71.71) ** 0.5, abs=1e-6)
    assert column.r_from_adj_r2 == pytest.approx(column.r_from_r2, abs=6e-5)


def test_the_average() -> None:
    found = implied_average()
    assert (found.columns, found.lost) == (12, 6)
    assert found.plain == pytest.approx(np.mean(R2**0.5))
    assert found.fisher == pytest.approx(np.tanh(np.mean(np.arctanh(R2**0.5))))
    assert found.least == pytest.approx(0.995**0.5)
    assert (12 * found.plain + 6 * found.lost_needed) / 18 == pytest.approx(found.claimed) == 0.95


def test_they_stand_beside_the_claim_in_every_export() -> None:
    document = json.loads(render(select(), "json"))
    columns = document["implied_correlation"]["columns"]
    assert {row["claimed"] for row in columns} == {0.95}
    assert [row["r_from_r2"] is None for row in columns] == [row["status"] == "damaged" for row in columns]
    assert document["implied_correlation"]["average"]["least"] == pytest.approx(0.995**0.5)
    (sheet,) = (s for s in sheets(select(6)) if s.name == "correlation")
    assert len(sheet.rows) == 6
    assert "0.9990" in sheet.title
    assert not [s for s in sheets(select(9)) if s.name == "correlation"]
