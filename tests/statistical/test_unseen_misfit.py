"""Stiffness of springs whose curves miss the published one by less than their readings show."""

from __future__ import annotations

import numpy as np
import pytest

from sma_bayes.assess.draws import record_draws
from sma_bayes.assess.unseen_misfit import with_unseen_misfit
from sma_bayes.fitting.fit_records import fit_records
from sma_bayes.parameters.priors_file import read_priors
from sma_bayes.records.types import Branch, Condition, Record

SPRINGS = 40
UNITS = {"temperature": "degC", "segment": "1", "force": "N", "displacement": "m"}


@pytest.mark.slow
def test_bands_of_the_stiffness_hold_it() -> None:
    """The force runs ahead of the displacement, by a parabola of which no curve of the package is one.

    Share of 13 temperatures within the middle of the transformation at which the 90 % band holds the true slope. That
    of one spring scatters by some 0.2, the mean of 40 by 0.032; 0.8 is three of these below 0.9, a false alarm once in
    740 runs were the bands right, and the seeds are fixed. No choice was made by these springs. Bands of the curve
    alone hold 0.86.
    """
    rng, priors = np.random.default_rng(1000), read_priors("modified_sigmoid")
    covered: dict[str, list[float]] = {"alone": [], "beside": []}
    wider = []
    for seed in range(SPRINGS):
        middle, width, bend = rng.uniform(48.0, 64.0), rng.uniform(3.5, 4.5), rng.uniform(0.5, 1.5)
        t = np.linspace(middle - 30.0, middle + 30.0, 150)

        def share(at: np.ndarray, middle: float = middle, width: float = width) -> np.ndarray:
            return np.asarray(0.5 * (1.0 + np.tanh((at - middle) / width)))

        s = share(t)
        observed = {
            "force": 1.0 + 5.0 * s - bend * s**2 + 0.02 * rng.standard_normal(t.size),
            "displacement": 0.01 + 0.02 * s + 1e-4 * rng.standard_normal(t.size),
        }
        inputs = {"temperature": t, "segment": np.zeros(t.size)}
        record = Record(Condition("wire"), Branch.HEATING, inputs, observed, np.arange(t.size) + 2, UNITS)
        draws = record_draws(fit_records([record], priors, noise="independent", seed=seed))
        at = np.linspace(middle - 1.5 * width, middle + 1.5 * width, 13)
        true = (5.0 - 2.0 * bend * share(at)) / 0.02
        found = {"alone": draws, "beside": with_unseen_misfit(draws, np.random.default_rng(seed))}
        widths = []
        for name, own in found.items():
            low, high = np.quantile(own.curve("stiffness", at), [0.05, 0.95], axis=0)
            covered[name].append(float(np.mean((low <= true) & (true <= high))))
            widths.append(float(np.mean(high - low)))
        wider.append(widths[1] / widths[0])
    assert np.mean(covered["beside"]) > 0.8
    assert np.mean(covered["beside"]) > np.mean(covered["alone"]) + 0.05
    assert np.median(wider) < 2.5
