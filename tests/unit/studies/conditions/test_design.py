"""Which settings vary, which only together, and where a condition lies among those that were measured."""

from __future__ import annotations

import numpy as np
import pytest

from sma_bayes.errors import MeasurementError
from sma_bayes.records.types import Condition
from sma_bayes.studies.conditions.design import confounders, designs, heating_power


def crossed() -> tuple[Condition, ...]:
    return (
        Condition("a", current=1.0, load=1.0, frequency=0.01),
        Condition("b", current=2.0, load=1.0, frequency=0.01),
        Condition("c", current=1.0, load=3.0, frequency=0.01),
    )


def test_only_conditions_that_state_the_same_settings_are_compared() -> None:
    found = designs([*crossed(), Condition("d", load=2.0), Condition("e", load=4.0), Condition("f")])
    assert [d.ids for d in found] == [("a", "b", "c"), ("d", "e"), ("f",)]
    assert [d.varied for d in found] == [("current", "load"), ("load",), ()]


def test_regressors_run_over_one_from_least_to_greatest() -> None:
    (design,) = designs(crossed())
    np.testing.assert_allclose(design.matrix, [[1, -0.5, -0.5], [1, 0.5, -0.5], [1, -0.5, 0.5]])
    assert (design.rank, design.spare) == (3, 0)


def test_settings_that_vary_together_can_not_be_told_apart() -> None:
    (design,) = designs(
        [Condition(n, current=i, load=2.0 * i) for n, i in zip("abc", (1.0, 2.0, 4.0), strict=True)]
    )
    assert design.rank == 2
    assert design.aliased("current") == ("load",)
    assert design.aliased("load") == ("current",)
    (apart,) = designs(crossed())
    assert apart.aliased("current") == ()


def test_a_setting_outside_the_aliased_pair_is_told() -> None:
    rows = [(1.0, 1.0, 0.01), (2.0, 2.0, 0.01), (1.0, 1.0, 0.03), (2.0, 2.0, 0.03)]
    (design,) = designs(
        [Condition(f"c{k}", current=i, load=w, frequency=f) for k, (i, w, f) in enumerate(rows)]
    )
    assert design.aliased("frequency") == ()
    assert design.aliased("current") == ("load",)


@pytest.mark.parametrize(
    ("current", "load", "why"),
    [
        (1.2, 1.5, ()),
        (1.0, 1.0, ()),
        (2.1, 1.0, ("current",)),
        (0.5, 4.0, ("current", "load")),
        (1.9, 2.9, ("combination",)),  # beyond the line from b to c
    ],
)
def test_extrapolation_is_told_by_range_and_by_convex_hull(
    current: float, load: float, why: tuple[str, ...]
) -> None:
    (design,) = designs(crossed())
    assert design.beyond(Condition("new", current=current, load=load)) == why


def test_a_condition_that_these_say_nothing_about_is_refused() -> None:
    (design,) = designs(crossed())
    with pytest.raises(MeasurementError, match="load is not given"):
        design.check(Condition("new", current=1.0))
    with pytest.raises(MeasurementError, match=r"frequency = 0\.02: it was 0\.01 in all conditions"):
        design.check(Condition("new", current=1.0, load=2.0, frequency=0.02))
    with pytest.raises(MeasurementError, match=r"duty_cycle = 0\.5: no value of it is stated"):
        design.check(Condition("new", current=1.0, load=2.0, duty_cycle=0.5))
    design.check(Condition("new", current=1.0, load=2.0, frequency=0.01))


def test_what_varies_along_with_a_setting_is_named() -> None:
    conditions = [Condition(n, current=i) for n, i in zip("abc", (1.0, 1.5, 2.0), strict=True)]
    (design,) = designs(conditions)
    found = confounders(design, {"peak_temperature": np.array([70.0, 60.0, 71.0])})
    assert [(c.setting, c.other, c.strong) for c in found] == [
        ("current", "peak_temperature", False),
        ("current", "mean_power", True),
    ]
    assert found[1].correlation == pytest.approx(np.corrcoef([1.0, 1.5, 2.0], [1.0, 2.25, 4.0])[0, 1])


def test_mean_power_counts_the_duty_cycle() -> None:
    (design,) = designs(
        [Condition("a", current=2.0, duty_cycle=0.4), Condition("b", current=2.0, duty_cycle=0.8)]
    )
    power = heating_power(design)
    assert power is not None
    np.testing.assert_allclose(power, [1.6, 3.2])
    (without,) = designs([Condition("a", load=1.0), Condition("b", load=2.0)])
    assert heating_power(without) is None
