"""Start and finish of sweeps against tangents laid to each drawn curve."""

from __future__ import annotations

from types import ModuleType

import numpy as np
import pytest

from sma_bayes.studies.cycles.start_and_finish import start_and_finish
from sma_bayes.studies.cycles.study import pool
from sma_bayes.studies.cycles.sweeps import fit_strand, sweeps_of


@pytest.mark.parametrize("model", ["modified_sigmoid", "sinh_arcsinh"])
@pytest.mark.parametrize("place", [0, 6], ids=["measured", "to come"])
def test_crossings_are_those_of_each_curve(training_spring: ModuleType, model: str, place: int) -> None:
    """Lines along the ends of long plateaus, the slope of each curve where the expected one is steepest.

    Median and ends of the 90 % interval within a fifth of its width.
    """
    truth = training_spring.draw_truth(np.random.default_rng(3), 6)
    record = training_spring.measured(truth, np.random.default_rng(4), ends=(0.0, 140.0))[0]
    sweeps, cycle, _ = sweeps_of(record, "displacement")
    strand = fit_strand(sweeps, "displacement", cycle, model, 0)
    sweep = pool([strand], 1, 0, 400).sweep(0, place)
    found = start_and_finish(sweep)
    t = np.linspace(0.0, 140.0, 2801)
    curve = sweep.curve(t)
    steepest = np.argmax(np.abs(np.diff(sweep.expected().curve(t)[0])))
    slope = (curve[:, steepest + 10] - curve[:, steepest - 10]) / (t[steepest + 10] - t[steepest - 10])
    by_hand = []
    for end, inside in ((0, 40), (-1, -41)):
        along = (curve[:, end] - curve[:, inside]) / (t[end] - t[inside])
        above = curve[:, end] + along * (t[steepest] - t[end]) - curve[:, steepest]
        by_hand.append(t[steepest] + above / (slope - along))
    here, there = (np.nanquantile(x, [0.05, 0.5, 0.95], axis=0) for x in (found, np.array(by_hand).T))
    assert np.abs(here - there).max() < 0.2 * (there[2] - there[0]).max()
