"""Intervals of correlation factors hold what they say: the truth's own r, and the r of a repetition.

The twin's truth is known. Where prior, model and noise are right, the curve that made the data is a draw from the
posterior, so that its r lies in the 90 % interval in nine records of ten; and data drawn once more from the same truth
have an r with the posterior's curves in the interval for replicated data as often. Of 18 records at least 12 must do
so: were the true rate 0.9, fewer would happen with probability 0.0012. Seeds are fixed, so that it does not come and
go.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import binom

from sma_bayes import fit
from sma_bayes.assess.correlation import agreement, correlation_factors
from sma_bayes.assess.correlation_average import average_draws
from sma_bayes.fitting.fit import Fit
from sma_bayes.paper.twin import recipes, twin_campaign

pytestmark = pytest.mark.slow

LEAST = 12
CURVES = {recipe.key: recipe.curves["stiffness"] for recipe in recipes()}


@pytest.fixture(scope="module")
def fits() -> dict[str, Fit]:
    return fit(twin_campaign(seed=3, channels=("stiffness",)), seed=3, noise="independent", jobs=1)


def test_the_limit_is_passed_by_chance_as_rarely_as_said() -> None:
    assert binom.cdf(LEAST - 1, 18, 0.9) < 0.0013


def test_the_truth_has_an_r_inside_the_interval(fits: dict[str, Fit]) -> None:
    inside = 0
    for key, fitted in fits.items():
        y = fitted.records[0].observed["stiffness"]
        truth = float(agreement(y, CURVES[key][None]).r[0])
        measured, _ = correlation_factors(fitted, {"stiffness": np.empty((0, y.size))})
        low, high = np.quantile(measured["stiffness"].r, (0.05, 0.95))
        inside += low <= truth <= high
    assert inside >= LEAST


def test_a_repetition_has_an_r_inside_the_interval_for_replicated_data(fits: dict[str, Fit]) -> None:
    again = twin_campaign(seed=4, channels=("stiffness",))
    inside, told = 0, []
    for number, (key, fitted) in enumerate(fits.items()):
        rng = np.random.default_rng([5, number])
        _, replicated = correlation_factors(fitted, fitted.posterior.replicate(rng, fitted.flat))
        low, high = np.quantile(replicated["stiffness"].r, (0.05, 0.95))
        new = again.record(key).observed["stiffness"]
        curve = fitted.posterior.predict(fitted.flat, fitted.records[0].inputs)["stiffness"]
        inside += low <= np.median(agreement(new, curve).r) <= high
        told.append((replicated["stiffness"], agreement(new, curve)))
    assert inside >= LEAST
    # the plain mean over all records likewise; beyond a 99.9 % interval once in a thousand
    expected = average_draws([r for r, _ in told])["r"]["plain"]
    found = average_draws([n for _, n in told])["r"]["plain"]
    low, high = np.quantile(expected, (0.0005, 0.9995))
    assert low <= np.median(found) <= high
