"""Scales of a record, in which weakly informative priors are stated."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from sma_bayes.errors import PriorError
from sma_bayes.parameters.scales import TYPICAL, RecordScales
from sma_bayes.records.types import Record


@pytest.fixture
def record(make_record: Callable[..., Record]) -> Record:
    return make_record(("force", "displacement"), n=500, A1=-0.02, noise=1e-3)


def test_scales_are_robust_ranges(record: Record) -> None:
    scales = RecordScales.of([record])
    t = record.temperature
    assert scales.low["temperature"] == pytest.approx(np.quantile(t, 0.01))
    assert scales.span["temperature"] == pytest.approx(np.ptp(np.quantile(t, (0.01, 0.99))))
    assert scales.level["force"] == pytest.approx(np.median(np.abs(record.observed["force"])))
    assert scales.trend == {"force": 1.0, "displacement": -1.0}


def test_one_spike_does_not_set_the_scale(record: Record) -> None:
    force = record.observed["force"].copy()
    before = RecordScales.of([record]).span["force"]
    force[100] = 1e6
    spiked = replace(record, observed={**record.observed, "force": force})
    assert RecordScales.of([spiked]).span["force"] == pytest.approx(before, rel=0.05)


def test_records_are_taken_together(make_record: Callable[..., Record]) -> None:
    cold, warm = make_record(span=(20.0, 50.0)), make_record(span=(45.0, 90.0))
    scales = RecordScales.of([cold, warm])
    assert scales.low["temperature"] == pytest.approx(20.0, abs=1.0)
    assert scales.span["temperature"] == pytest.approx(70.0, abs=2.0)
    longest = max(float(np.ptp(r.inputs["time"])) for r in (cold, warm))
    assert scales.span["time"] <= longest  # each record's clock starts at zero


def test_a_constant_channel_still_has_a_scale(record: Record) -> None:
    flat = replace(record, observed={"force": np.full(record.n, 3.0)})
    assert RecordScales.of([flat]).span["force"] > 0.0


@pytest.mark.parametrize(
    ("expression", "expected"),
    [
        ("span(temperature)", lambda s: (s.span["temperature"], 0.0)),
        ("1/span(temperature)", lambda s: (1.0 / s.span["temperature"], 0.0)),
        ("span(force)/level(displacement)", lambda s: (s.span["force"] / s.level["displacement"], 0.0)),
        (" span( force ) * typical(displacement) ", lambda s: (s.span["force"] * 0.01, 0.0)),
        ("position(temperature)", lambda s: (s.span["temperature"], s.low["temperature"])),
        ("span(channel)", lambda s: (s.span["force"], 0.0)),
    ],
)
def test_expressions(record: Record, expression: str, expected) -> None:
    scales = RecordScales.of([record])
    assert scales.resolve(expression, "force") == pytest.approx(expected(scales), rel=1e-14)


def test_what_was_not_observed_is_a_key_error(record: Record) -> None:
    scales = RecordScales.of([record])
    for expression in ("span(stiffness)", "level(stiffness)/span(force)", "position(stiffness)"):
        with pytest.raises(KeyError):
            scales.resolve(expression)


@pytest.mark.parametrize(
    "expression",
    [
        "spam(force)", "span", "span(force", "2*span(force)", "position(force)*span(force)", "1/position(force)",
        "span(force)*", "", "span(forse)", "span()", "trend(force)",
    ],
)  # fmt: skip
def test_nonsense_is_refused(record: Record, expression: str) -> None:
    with pytest.raises(PriorError, match="can't be understood"):
        RecordScales.of([record]).resolve(expression)


@pytest.mark.parametrize("specimen", [False, True])
def test_orders_of_magnitude_are_those_of_a_spring_or_a_specimen(record: Record, specimen: bool) -> None:
    units = {"temperature": "degC", "force": "Pa", "displacement": "1"} if specimen else record.units
    scales = RecordScales.of([replace(record, specimen=specimen, units=units)])
    assert scales.typical == TYPICAL[specimen]


def test_units_that_nobody_knows_have_no_order_of_magnitude(record: Record) -> None:
    units = {"temperature": "arbitrary", "force": "arbitrary", "displacement": "arbitrary"}
    assert set(RecordScales.of([replace(record, units=units)]).typical.values()) == {1.0}
