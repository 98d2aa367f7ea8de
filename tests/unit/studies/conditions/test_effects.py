"""Effects of settings, against polyfit, quadrature, and what a design can't tell."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from sma_bayes.assess.draws import RecordDraws
from sma_bayes.records.types import Condition
from sma_bayes.studies.conditions.effects import SettingEffect, operating_effects, regression
from sma_bayes.studies.conditions.features import Feature, condition_features


def named(effects: tuple[SettingEffect, ...], feature: str, channel: str, setting: str) -> SettingEffect:
    (found,) = [e for e in effects if (e.feature, e.channel, e.setting) == (feature, channel, setting)]
    return found


def test_regression_agrees_with_quadrature() -> None:
    matrix = np.array([[1.0, -0.5], [1.0, -0.2], [1.0, 0.1], [1.0, 0.5]])
    mean, sd = np.array([1.0, 1.9, 2.1, 3.2]), np.array([0.1, 0.3, 0.1, 0.2])
    rng = np.random.default_rng(0)
    draws = rng.standard_normal((4, 4000))
    draws = (draws - draws.mean(axis=1, keepdims=True)) / draws.std(axis=1, keepdims=True)
    y = mean[:, None] + sd[:, None] * draws
    found = regression(matrix, y, rng, size=40_000)
    scale = np.std(mean, ddof=1)
    a, b, ln = np.meshgrid(
        np.linspace(-6, 10, 161), np.linspace(-12, 16, 161), np.linspace(np.log(1e-3), np.log(20), 81),
        indexing="ij",
    )  # fmt: skip
    tau = np.exp(ln)
    log_p = ln - 2.5 * np.log1p((tau / scale) ** 2 / 4.0)
    for row, m, s in zip(matrix, mean, sd, strict=True):
        total = s**2 + tau**2
        log_p = log_p - 0.5 * np.log(total) - 0.5 * (m - row[0] * a - row[1] * b) ** 2 / total
    p = np.exp(log_p - log_p.max())
    p /= p.sum()
    slope, scatter = float((p * b).sum()), float((p * tau).sum())
    sd_slope = float(np.sqrt((p * (b - slope) ** 2).sum()))
    assert found.slopes[:, 1].mean() == pytest.approx(slope, abs=0.02)
    assert found.slopes[:, 1].std() == pytest.approx(sd_slope, rel=0.03)
    assert found.scatter.mean() == pytest.approx(scatter, rel=0.03)


def test_tested_effect_is_least_squares_on_each_draw(make_draws: Callable[..., RecordDraws]) -> None:
    load = np.array([1.0, 2.0, 3.0, 4.0])
    middle = np.array([50.0, 51.0, 53.0, 53.5])
    records = [
        make_draws(Condition(f"c{i}", load=w), B3=m)
        for i, (w, m) in enumerate(zip(load, middle, strict=True))
    ]
    effect = named(operating_effects(condition_features(records)), "midpoint", "force", "load")
    slope = np.polyfit(load, np.stack([r.parameter("B3") for r in records]), 1)[0]
    assert not effect.factor
    assert effect.tested is not None
    assert effect.tested["median"] == pytest.approx(3.0 * np.median(slope), rel=1e-9)
    assert effect.beyond is not None
    assert effect.beyond["q95"] - effect.beyond["q05"] > 10 * (effect.tested["q95"] - effect.tested["q05"])
    assert effect.probability_rises is not None
    assert effect.probability_rises > 0.9
    assert effect.scatter is not None
    assert 0.1 < effect.scatter["median"] < 1.5


def test_a_positive_feature_changes_by_a_factor(make_draws: Callable[..., RecordDraws]) -> None:
    records = [make_draws(Condition(n, current=i), B1=b) for n, i, b in (("a", 1.0, 2.0), ("b", 2.0, 6.0))]
    effect = named(
        operating_effects(condition_features(records)), "greatest_stiffness", "stiffness", "current"
    )
    assert effect.factor
    assert effect.tested is not None
    assert effect.tested["median"] == pytest.approx(3.0, rel=0.01)
    assert effect.beyond is None, "two conditions tell nothing of the scatter"


def test_what_varied_together_has_no_effect_of_its_own(make_draws: Callable[..., RecordDraws]) -> None:
    records = [
        make_draws(Condition(n, current=i, load=2 * i), B3=50 + i)
        for n, i in zip("abcd", range(1, 5), strict=True)
    ]
    effects = operating_effects(condition_features(records))
    assert effects
    for effect in effects:
        assert effect.tested is None
        assert effect.beyond is None
        assert effect.aliased_with == (("load",) if effect.setting == "current" else ("current",))


def test_peak_temperature_is_named_where_it_rose_with_the_setting(
    make_draws: Callable[..., RecordDraws],
) -> None:
    def confounders(step: float) -> set[str]:
        records = [
            make_draws(Condition(n, load=i), span=(30.0, 60.0 + step * i))
            for n, i in zip("abc", (1.0, 2.0, 3.0), strict=True)
        ]
        effect = named(
            operating_effects(condition_features(records)), "greatest_stiffness", "stiffness", "load"
        )
        return {c.other for c in effect.confounders if c.strong}

    assert confounders(5.0) == {"peak_temperature"}
    assert confounders(0.1) == set(), "a difference of 0.2 degC in 30 is none"


def test_an_error_that_conditions_share_is_in_no_effect(make_draws: Callable[..., RecordDraws]) -> None:
    """Also where a few draws lack the feature in one of them."""
    records = [
        make_draws(Condition(f"c{i}", load=w), B3=50.0 + w) for i, w in enumerate((1.0, 2.0, 3.0, 5.0))
    ]
    features = condition_features(records)
    error = 5.0 * np.random.default_rng(0).standard_normal(features[0].draws.size)

    def off(f: Feature) -> Feature:
        if f.name != "midpoint":
            return f
        lacking = 8 if f.condition.id == "c1" else 0
        return replace(f, draws=np.where(np.arange(error.size) < lacking, np.nan, f.draws + error))

    before = named(operating_effects(features), "midpoint", "force", "load")
    found = named(operating_effects([off(f) for f in features]), "midpoint", "force", "load")
    for one, other in ((found.tested, before.tested), (found.beyond, before.beyond)):
        assert one is not None
        assert other is not None
        assert one["q95"] - one["q05"] == pytest.approx(other["q95"] - other["q05"], rel=0.1)


def test_a_regression_of_what_differs_by_nothing_but_a_shared_error() -> None:
    matrix = np.array([[1.0, 0.0], [1.0, 0.5], [1.0, 1.0]])
    error = 5.0 * np.random.default_rng(0).standard_normal(400)
    found = regression(matrix, 50.0 + error + np.zeros((3, 1)), np.random.default_rng(1))
    assert np.abs(found.slopes[:, 1]).max() < 1e-3
    assert np.std(found.slopes[:, 0]) == pytest.approx(np.std(error), rel=0.1)


@pytest.mark.parametrize(("lacking", "why"), [(8, ""), (400, "of the curves of c1 have none")])
def test_a_few_curves_without_a_feature_do_not_hide_its_effect(
    lacking: int, why: str, make_draws: Callable[..., RecordDraws]
) -> None:
    """One draw without a start of the transformation left dashes in place of an effect of stress, and no reason."""
    records = [
        make_draws(Condition(f"c{i}", load=w), B3=50.0 + w) for i, w in enumerate((1.0, 2.0, 3.0, 4.0))
    ]
    features = list(condition_features(records))
    at = next(
        i
        for i, f in enumerate(features)
        if (f.name, f.channel, f.condition.id) == ("midpoint", "force", "c1")
    )
    draws = features[at].draws.copy()
    lacking = min(lacking, draws.size // 2)
    draws[:lacking] = np.nan
    features[at] = replace(features[at], draws=draws)
    effect = named(operating_effects(features), "midpoint", "force", "load")
    assert effect.why.endswith(why)
    assert effect.defined == pytest.approx(1.0 - lacking / draws.size)
    assert features[at].defined == effect.defined
    assert (effect.tested is None) is bool(why)
    if effect.tested is not None:
        assert not effect.why
        assert effect.tested["median"] == pytest.approx(3.0, abs=0.5)
