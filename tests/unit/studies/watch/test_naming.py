"""Causes of a change that are nearly alike: what is told of their amounts stays a number."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from sma_bayes.studies.watch.naming import Cause, Change, causes_of, named


@pytest.mark.parametrize("apart", [1e-3, 1e-7, 3e-9, 1e-9])
def test_amounts_of_causes_that_are_nearly_alike(apart: float) -> None:
    """Orthogonal `a` and `b` and causes `a` and `a + apart b`: the amounts of `a` and `b` are known to 1 each."""
    rng = np.random.default_rng(0)
    a, b, *_ = np.linalg.qr(rng.standard_normal((8, 8)))[0].T
    causes = [
        Cause(name, name, "sensor", "", direction[:, None], ((name, "1"),))
        for name, direction in (("one", a), ("other", a + apart * b))
    ]
    change = Change(30.0 * a + 40.0 * b + 1e-3 * rng.standard_normal(8), np.eye(8), 20)
    (found,) = named(change, causes)
    assert found.amount == pytest.approx([30.0 - 40.0 / apart, 40.0 / apart], rel=1e-3)
    assert found.sd == pytest.approx(np.full(2, 1.0 / apart), rel=1e-3)


@pytest.mark.parametrize("factor", [0.6, 0.75, 0.98, 1.3])
@pytest.mark.parametrize(("fixed", "name"), [(13.0, "stroke_hot"), (1.0, "stroke_cold"), (0.0, "gain")])
def test_a_stroke_that_has_changed_much_keeps_its_name(fixed: float, name: str, factor: float) -> None:
    """Level 7 mm and span 12 mm of both branches, stretched about a level: offset and stroke follow exactly."""
    strands: Any = [
        SimpleNamespace(
            channel="displacement", unit="m", level=7.0, span=12.0, middle=50.0, ends=(25.0, 85.0),
            common=lambda t: np.where(t > 50.0, 13.0, 1.0),
            record=SimpleNamespace(branch=SimpleNamespace(value=b), quantity=lambda channel: channel),
        )
        for b in ("heating", "cooling")
    ]  # fmt: skip
    moved = np.tile([(7.0 - fixed) * (factor - 1.0) / 12.0, np.log(factor), 0.0, 0.0], 2)
    change = Change(moved, 1e-6 * np.eye(8), 20)
    found = named(change, causes_of(strands, change))
    assert [c.id for n in found for c in n.causes] == [f"displacement_{name}"]
    assert found[0].amount == pytest.approx([np.log(factor)])
