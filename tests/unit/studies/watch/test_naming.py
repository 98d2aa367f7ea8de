"""Causes of a change that are nearly alike: what is told of their amounts stays a number."""

from __future__ import annotations

import numpy as np
import pytest

from sma_bayes.studies.watch.naming import Cause, Change, named


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
