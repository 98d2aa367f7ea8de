"""Draws of both branches, paired: independent but for what thermometer and sensors of a run are off by."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from sma_bayes.assess.draws import record_draws
from sma_bayes.assess.middle import middle_temperatures
from sma_bayes.fitting.fit_records import fit_records
from sma_bayes.parameters.priors_file import read_priors
from sma_bayes.records.types import Branch, Calibration, Record
from sma_bayes.studies.simulate.spring import BothDraws

SHIFT_SD = 3.0
"""Of the thermometer [K], a hundred times what the readings leave of a midpoint."""


@pytest.fixture(scope="module")
def both(make_record: Callable[..., Record]) -> BothDraws:
    known = {"temperature": Calibration(0.0, 0.0, SHIFT_SD)}
    records = (
        make_record(branch=Branch.HEATING),
        make_record(branch=Branch.COOLING, seed=1, A3=46.0, B3=46.0),
    )
    fits = (
        fit_records([replace(r, calibration=known)], read_priors("modified_sigmoid"), noise="independent")
        for r in records
    )
    return BothDraws(*(record_draws(f) for f in fits))


@pytest.mark.parametrize("size", [500, 5000])
def test_both_branches_have_one_thermometer(both: BothDraws, size: int) -> None:
    drawn = both.drawn(size, np.random.default_rng(0))
    up, down = (middle_temperatures(d.curves, "displacement") for d in (drawn.heating, drawn.cooling))
    assert up is not None
    assert down is not None
    for each in (up, down):
        assert each.shape == (size,)
        assert each.std() == pytest.approx(SHIFT_SD, rel=0.15)  # 3 % of 500 draws
    assert (up - down).std() < 0.1 * SHIFT_SD
    for errors in zip(drawn.heating.calibration.values(), drawn.cooling.calibration.values(), strict=True):
        np.testing.assert_array_equal(*errors)


def test_the_likelihood_keeps_the_draws_that_it_has(both: BothDraws) -> None:
    """Without the errors draws are those of the cooling branch again, in the order in which they were paired."""
    drawn = both.drawn(len(both.cooling.theta), np.random.default_rng(0))
    found, own = (np.sort(d.before_calibration, axis=0) for d in (drawn.cooling, both.cooling))
    np.testing.assert_allclose(found, own, rtol=1e-9)
