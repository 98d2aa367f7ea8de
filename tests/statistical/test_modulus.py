"""Moduli of an alloy that none of the models describes: cosine kinetics, phases in series, a loss of its own.

The transformation follows the cosine of Liang and Rogers, which has corners at both ends; both phases carry the same
stress (Reuss); the loss is that of the phases and a part that follows the rate of the transformation.
"""

from __future__ import annotations

import numpy as np
import pytest

from sma_bayes.assess.transformation import tangents
from sma_bayes.records.dmta import DmtaSweep
from sma_bayes.records.types import Branch, Condition, Record
from sma_bayes.studies.modulus.sweep import LOSS, STORAGE, study_sweep

pytestmark = [pytest.mark.slow, pytest.mark.thorough]

HALF, AT = 14.0, (-10.0, 44.0, 50.0, 56.0, 110.0)
SWEEPS = 6


def moduli(t: np.ndarray, middle: float) -> tuple[np.ndarray, np.ndarray]:
    """Storage and loss modulus [Pa]."""
    x = np.clip((t - middle + HALF) / (2.0 * HALF), 0.0, 1.0)
    share, rate = 0.5 * (1.0 - np.cos(np.pi * x)), 0.25 * np.pi / HALF * np.sin(np.pi * x)
    martensite, austenite = 28e9 - 20e6 * t, 68e9 - 30e6 * t
    storage = 1.0 / ((1.0 - share) / martensite + share / austenite)
    return storage, storage * (0.025 * (1.0 - share) + 0.006 * share + 0.9 * rate)


def measured(number: int, middle: float, rng: np.random.Generator) -> DmtaSweep:
    t = np.arange(-20.0, 120.0, 1.0)
    clean = moduli(t, middle)
    noisy = [y * (1.0 + s * rng.standard_normal(t.size)) for y, s in zip(clean, (0.004, 0.02), strict=True)]
    storage, loss = (
        Record(
            Condition(f"{number}{kind}", frequency=1.0), Branch.HEATING, {"temperature": t}, {"stiffness": y},
            np.arange(1, t.size + 1), {"temperature": "degC", "stiffness": "Pa"}, specimen=True,
        )
        for kind, y in zip(("", "-loss"), noisy, strict=True)
    )  # fmt: skip
    return DmtaSweep(f"{number}-heating", str(number), 1.0, Branch.HEATING, storage, loss, False, None)


def test_intervals_hold_what_another_mechanism_has() -> None:
    """Of 90 values at temperatures at most 18 miss their 90 % intervals, of 24 temperatures at most 8.

    Intervals of one curve are not independent: as if each sweep told one value in three, a false alarm in 100 runs.
    """
    rng = np.random.default_rng(17)
    fine = np.linspace(-20.0, 120.0, 20001)
    values, temperatures = [], []
    for number in range(SWEEPS):
        middle = float(rng.uniform(45.0, 60.0))
        sweep = measured(number, middle, rng)
        found = study_sweep(sweep, {STORAGE: "auto", LOSS: "auto"}, AT, number).document
        assert all(c.converged for c in found.curves)
        storage, loss = moduli(fine, middle)
        rule = tangents(lambda t, m=middle: moduli(np.atleast_2d(t), m)[0], -20.0, 120.0)  # type: ignore[misc]
        truth = {
            "As": rule.lower[0], "Af": rule.upper[0], "loss_peak": fine[np.argmax(loss)],
            "tan_delta_peak": fine[np.argmax(loss / storage)],
        }  # fmt: skip
        for told in found.temperatures:
            if told.name in truth:
                temperatures.append(told.q05 <= truth[told.name] <= told.q95)
        for value in found.values:
            e, f = (float(y[0]) for y in moduli(np.array([value.at]), middle))
            true = {STORAGE: e, LOSS: f, "tan_delta": f / e}[value.channel]
            values.append(value.q05 <= true <= value.q95)
    assert len(values) == 90
    assert len(temperatures) == 24
    assert 90 - sum(values) <= 18
    assert 24 - sum(temperatures) <= 8
