"""A gap study as people see it."""

from __future__ import annotations

import pytest

from sma_bayes.runs.declared_units import ShownUnit
from sma_bayes.runs.shown import shown_part
from sma_bayes.studies.gap.schema import AddedEffect, EffectParameter
from sma_bayes.studies.gap.shown import _effect

UNITS = {"temperature": ShownUnit("degC", "degF", 1.8, 32.0)}


@pytest.mark.parametrize(("unit", "ends"), [("degC", (104.0, 113.0, 122.0)), ("K", (72.0, 81.0, 90.0))])
def test_a_temperature_is_shown_as_one_and_a_width_as_a_difference(
    unit: str, ends: tuple[float, float, float]
) -> None:
    """The R-phase at 45 degC stood at 81 degF."""
    interval = {"q05": 40.0, "median": 45.0, "q95": 50.0}
    told = EffectParameter(
        unit=unit,
        meaning="",
        rhat=1.0,
        ess_bulk=1e3,
        ess_tail=1e3,
        prior={"family": "uniform", **interval},
        **interval,
    )
    effect = _effect(AddedEffect.model_construct(parameters={"TR": told}), UNITS)
    shown = shown_part(effect.parameters["TR"], UNITS)
    assert shown.unit == "degF"
    assert shown.quantiles == pytest.approx(ends)
    assert [shown.prior[n] for n in interval] == pytest.approx(list(ends))
