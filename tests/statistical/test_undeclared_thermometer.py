"""A thermometer whose readings err by 0.5 K, which nobody declared: it is named with its size, and intervals count it.

Intervals of a true coverage of 90 % fail with a probability of `FALSE_ALARM` over both counts, were the records drawn
anew; the seeds are fixed. Of 100 records each with 60 and 150 readings and with s_T B2 of 0.3 and 0.6 those of A3 held
84 to 94 % of the truths, those of B3 87 to 92 %, and the error was named in all 400, with a median of 0.47 to 0.50 K.
"""

from __future__ import annotations

import numpy as np
import pytest
from calibration.summary import least_expected

import sma_bayes
from sma_bayes.response.modified_sigmoid import ModifiedSigmoid
from sma_bayes.studies.fit.terminal import thermometer_sentences

pytestmark = [pytest.mark.slow, pytest.mark.thorough]

RECORDS, READINGS = 24, 60
ERROR_K, RATE = 0.5, 0.6
FALSE_ALARM = 0.01
TO_MM = {"force_N": ("force", 1.0), "displacement_mm": ("displacement", 1e3)}


def test_it_is_named_and_counted() -> None:
    held, sizes = {"A3": 0, "B3": 0}, []
    for seed in range(RECORDS):
        rng = np.random.default_rng([20, seed])
        middle = rng.uniform(46.0, 54.0)
        truth = {"A1": 0.02, "A2": 0.9 * RATE, "A3": middle - 1.5, "A4": 0.001, "B1": 2.5, "B2": RATE, "B3": middle,
                 "B4": 0.5}  # fmt: skip
        model = ModifiedSigmoid()
        true = np.linspace(30.0, 70.0, READINGS)
        time = np.arange(float(READINGS))
        theta = np.array([truth[name] for name in model.parameter_names])
        clean = model.predict(theta, {"temperature": true, "time": time, "segment": np.zeros(READINGS)})
        data = {"temperature_C": true + ERROR_K * rng.standard_normal(READINGS), "time_s": time}
        for column, (channel, factor) in TO_MM.items():
            noise = 0.01 * np.ptp(clean[channel]) * rng.standard_normal(READINGS)
            data[column] = factor * (clean[channel] + noise)
        (fit,) = sma_bayes.fit(data, seed=seed, jobs=1).values()
        parameters = fit.summarised.parameters
        for name in held:
            found = parameters[name]
            held[name] += found.q05 <= truth[name] <= found.q95
        if thermometer_sentences([fit.summarised]):
            sizes.append(parameters["temperature_sd"].median)
    assert min(held.values()) >= least_expected(RECORDS, FALSE_ALARM / len(held)), held
    assert len(sizes) == RECORDS
    assert np.median(sizes) == pytest.approx(ERROR_K, rel=0.2)
