"""Correlation factors and their averages, against numpy, least squares and brute force."""

from __future__ import annotations

import numpy as np
import pytest

from sma_bayes.arrays import Floats
from sma_bayes.assess.correlation import Agreement, agreement, factors, joined, quantiles
from sma_bayes.assess.correlation_average import (
    Scored,
    average_draws,
    averages,
    probability_above,
)
from sma_bayes.errors import MeasurementError
from sma_bayes.paper.correlation import CLAIMED

N = 7
"""Draws."""


def series(n: int, seed: int, level: float = 0.0) -> tuple[Floats, Floats]:
    """Data (n,) and curves (N, n) near them."""
    rng = np.random.default_rng(seed)
    y = level + rng.standard_normal(n)
    return y, y + 0.4 * rng.standard_normal((N, n))


def test_adjusted_r2_is_that_of_least_squares() -> None:
    """One less the unbiased residual variance over the unbiased variance of the data."""
    rng = np.random.default_rng(0)
    design = np.column_stack([np.ones(30), rng.standard_normal((30, 3))])
    y = design @ [1.0, 0.5, -2.0, 0.0] + rng.standard_normal(30)
    fitted = design @ np.linalg.lstsq(design, y, rcond=None)[0]
    found = agreement(y, fitted[None], parameters=4)
    residual_variance = np.sum((y - fitted) ** 2) / 26
    assert found.adj_r2[0] == pytest.approx(1.0 - residual_variance / y.var(ddof=1))
    assert found.r[0] ** 2 == pytest.approx(found.r2[0])  # as of every least-squares line with an intercept
    assert np.isnan(agreement(y[:4], fitted[None, :4], parameters=4).adj_r2).all()


def test_r_bounds_r2_from_above() -> None:
    """No scale and offset of the curve is better than the best: r squared is at least R2."""
    y, curve = series(40, 1)
    found = agreement(y, 1.7 * curve - 3.0)
    assert np.all(found.r**2 >= found.r2)
    assert np.all(found.r2 < 0.0)
    np.testing.assert_allclose(found.r, agreement(y, curve).r)


def test_parts_join_to_the_whole() -> None:
    """Whatever the order and the number of parts; means far from zero lose nothing."""
    parts = [series(n, n, level) for n, level in ((5, 1e6), (1, 1e6), (9, 1e6 + 3.0))]
    whole = agreement(
        np.concatenate([y for y, _ in parts]), np.concatenate([c for _, c in parts], axis=1), parameters=6
    )
    for order in ((0, 1, 2), (2, 0, 1)):
        got = joined([agreement(*parts[i], parameters=2) for i in order])
        assert (got.n, got.parameters) == (15, 6)
        for name in ("r", "r2", "adj_r2", "rmse"):
            np.testing.assert_allclose(getattr(got, name), getattr(whole, name), rtol=1e-9)
    with pytest.raises(MeasurementError):
        joined([])


def test_a_flat_curve_has_no_r_and_flat_data_have_no_r2() -> None:
    y, curve = series(20, 2)
    curve[2] = 0.1 + 0.2  # not a number that is kept exactly
    found = agreement(y, curve)
    assert np.flatnonzero(np.isnan(found.r)).tolist() == [2]
    assert found.r2[2] < 0.0
    flat = agreement(np.full(20, 0.3), curve)
    assert np.isnan(flat.r).all()
    assert np.isnan(flat.r2).all()
    assert np.isfinite(flat.rmse).all()


def test_quantiles_are_of_the_draws_that_define_them() -> None:
    values = np.array([0.2, np.nan, 0.4, 0.6, np.nan])
    found = quantiles(values)
    assert found["median"] == pytest.approx(0.4)
    assert found["undefined"] == pytest.approx(0.4)
    assert quantiles(np.full(3, np.nan)) == {"q05": None, "median": None, "q95": None, "undefined": 1.0}
    assert probability_above(values, 0.3) == pytest.approx(0.4)  # an undefined draw is not above


def test_what_was_held_out_has_no_adjusted_r2() -> None:
    assert set(factors(agreement(*series(9, 3)))) == {"r", "r2", "rmse"}
    assert set(factors(agreement(*series(9, 3), parameters=2))) == {"r", "r2", "adj_r2", "rmse"}


def test_averages_by_every_rule() -> None:
    sizes = (6, 20, 11)
    told = [series(n, n) for n in sizes]
    found = average_draws([agreement(*s, parameters=2) for s in told])
    for k in range(N):
        r = np.array([np.corrcoef(y, c[k])[0, 1] for y, c in told])
        z = 0.5 * np.log((1.0 + r) / (1.0 - r))
        y, c = np.concatenate([y for y, _ in told]), np.concatenate([c[k] for _, c in told])
        error, spread = np.sum((y - c) ** 2), np.sum((y - y.mean()) ** 2)
        mse = [np.mean((y - c[k]) ** 2) for y, c in told]
        assert found["r"]["plain"][k] == pytest.approx(r.mean())
        assert found["r"]["fisher"][k] == pytest.approx(np.tanh(z.mean()))
        assert found["r"]["pooled"][k] == pytest.approx(np.corrcoef(y, c)[0, 1])
        assert found["r2"]["pooled"][k] == pytest.approx(1.0 - error / spread)
        assert found["adj_r2"]["pooled"][k] == pytest.approx(1.0 - (error / 31.0) / (spread / 36.0))
        assert found["rmse"]["plain"][k] == pytest.approx(np.mean(np.sqrt(mse)))
        assert found["rmse"]["pooled"][k] == pytest.approx(np.sqrt(np.average(mse, weights=sizes)))


def test_a_perfect_record_makes_a_perfect_fisher_average() -> None:
    y, curve = series(10, 4)
    found = average_draws([agreement(y, np.tile(y, (N, 1))), agreement(y, curve)])
    np.testing.assert_allclose(found["r"]["fisher"], 1.0)
    assert np.all(found["r"]["plain"] < 1.0)


def scored(key: str, branch: str, found: Agreement, **changes: object) -> Scored:
    given: dict[str, object] = {
        "key": key, "branch": branch, "channel": "force", "quantity": "force", "unit": "N", "posterior": key,
        "converged": True, "agreement": found,
    }  # fmt: skip
    return Scored(**(given | changes))  # type: ignore[arg-type]


def test_averages_are_of_like_with_like() -> None:
    a, b, c = (agreement(*series(12, i), parameters=3) for i in (5, 6, 7))
    found = averages(
        [
            scored("x", "heating", a),
            scored("y", "cooling", b),
            scored("z", "cooling", c, converged=False),
            scored("x", "heating", c, unit="Pa", quantity="stress"),
        ]
    )
    assert [(e["unit"], e["branch"]) for e in found] == [
        ("N", "heating"), ("N", "cooling"), ("N", ""), ("Pa", "heating"),
    ]  # fmt: skip
    both = found[2]
    assert (both["records"], both["left_out"], both["n"], both["draws"]) == (["x", "y"], ["z"], 24, N)
    assert both["threshold"] == CLAIMED == 0.95
    assert both["r"]["plain"]["median"] == pytest.approx(np.median((a.r + b.r) / 2))
    assert both["r"]["plain"]["above"] == np.mean((a.r + b.r) / 2 > 0.95)
    nothing = averages([scored("z", "cooling", c, converged=False)])
    assert nothing[0]["n"] == 0
    assert "r" not in nothing[0]


def test_shared_parameters_are_counted_once() -> None:
    a, b = (agreement(*series(12, i), parameters=3) for i in (5, 6))
    (found,) = averages([scored("x", "heating", a, posterior="p"), scored("y", "heating", b, posterior="p")])
    expected = 1.0 - (1.0 - joined([a, b]).r2) * 23 / 21
    assert found["adj_r2"]["pooled"]["median"] == pytest.approx(np.median(expected))
