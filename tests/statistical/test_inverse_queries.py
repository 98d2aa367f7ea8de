"""Inverse queries keep their promise: over many springs, what is stated with 90 % comes true in nine cases of ten."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.stats import binom

from sma_bayes.assess.draws import record_draws
from sma_bayes.assess.inverse import finer, met, passages, search_grid
from sma_bayes.assess.transformation import transformation_temperatures
from sma_bayes.fitting.fit_records import fit_records
from sma_bayes.parameters.priors_file import read_priors
from sma_bayes.records.types import Record
from sma_bayes.response.modified_sigmoid import ModifiedSigmoid

SPRINGS = 60
STATED = 0.9
ANSWERED = 0.95
"""Share of springs at least for which a stretch with that probability is found at all, of those whose curve stands by
itself: chance gives one in twelve a discrepancy, whose slope leaves the stiffness less sure."""
FALSE_ALARM = 1e-3
"""Probability that one of the counts falls outside by chance, were each promise kept exactly."""


@pytest.mark.slow
def test_stated_probabilities_come_true(make_record: Callable[..., Record]) -> None:
    priors = read_priors("modified_sigmoid")
    rng = np.random.default_rng(11)
    model = ModifiedSigmoid()
    kept = {"passage": 0, "edge": 0, "start": 0, "finish": 0}
    stated = dict.fromkeys(kept, 0)
    plain = answered = 0
    for seed in range(SPRINGS):
        truth = {
            "A1": rng.uniform(0.015, 0.03), "A2": rng.uniform(0.22, 0.35), "A3": rng.uniform(46.0, 50.0), "A4": 0.001,
            "B1": rng.uniform(2.0, 3.0), "B2": rng.uniform(0.35, 0.5), "B3": rng.uniform(50.0, 53.0), "B4": 0.5,
        }  # fmt: skip
        theta = np.array([truth[name] for name in model.parameter_names])
        fit = fit_records(
            [make_record(n=60, noise=0.02, seed=1000 + seed, **truth)], priors, noise="independent", seed=seed
        )
        draws = record_draws(fit)

        def curve(t: np.ndarray, draws=draws) -> np.ndarray:
            return draws.curve("stiffness", t)

        def true_stiffness(t: float, theta=theta) -> float:
            return float(model.predict(theta, {"temperature": np.array([t])})["stiffness"][0])

        place = float(rng.uniform(44.0, 50.0))  # where the stiffness of all these springs still rises
        wanted = true_stiffness(place)
        t = search_grid(draws.coldest, draws.hottest)
        rising = next(p for p in passages(curve, t, wanted) if p.direction == "rising")
        low, high = np.nanquantile(rising.draws, (0.05, 0.95))
        kept["passage"] += low < place < high

        grid = finer(t, rising.draws[np.isfinite(rising.draws)])
        bounds = (0.8 * wanted, 1.2 * wanted)
        stretches = met(grid, curve(grid), bounds).at_least(STATED)
        if stretches:  # at no temperature are some springs known well enough
            kept["edge"] += bounds[0] <= true_stiffness(stretches[0].low) <= bounds[1]
            stated["edge"] += 1
        plain += not fit.posterior.has_discrepancy
        answered += bool(stretches) and not fit.posterior.has_discrepancy

        start, finish = transformation_temperatures(fit)
        half = 2.0 / truth["A2"]
        kept["start"] += start.interval["q05"] < truth["A3"] - half < start.interval["q95"]
        kept["finish"] += finish.interval["q05"] < truth["A3"] + half < finish.interval["q95"]
        for name in ("passage", "start", "finish"):
            stated[name] += 1
    assert plain >= 0.85 * SPRINGS
    assert answered >= ANSWERED * plain
    tail = FALSE_ALARM / (2 * len(kept))
    wrong = {}
    for name, count in kept.items():
        least, most = binom.ppf((tail, 1.0 - tail), stated[name], STATED)
        if not least <= count <= most:
            wrong[name] = (count, stated[name])
    assert wrong == {}, kept
