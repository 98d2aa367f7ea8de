"""Posteriors of moduli: against least squares of scipy, peaks against a fine grid."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import curve_fit
from scipy.special import expit

from sma_bayes.records.dmta import DmtaSweep
from sma_bayes.records.types import Branch, Condition, Record
from sma_bayes.studies.modulus.sweep import LOSS, STORAGE, peak_of, study_sweep

T = np.linspace(0.0, 110.0, 90)


def storage(t: np.ndarray, cold: float, span: float, rate: float, midpoint: float) -> np.ndarray:
    return np.asarray(cold + span * expit(rate * (t - midpoint)))


def peak(t: np.ndarray, cold: float, span: float, rate: float, midpoint: float, height: float) -> np.ndarray:
    s = expit(rate * (t - midpoint))
    return np.asarray(cold + span * s + 4.0 * height * s * (1.0 - s))


def record(name: str, y: np.ndarray) -> Record:
    return Record(
        Condition(name, frequency=1.0), Branch.HEATING, {"temperature": T}, {"stiffness": y}, np.arange(1, T.size + 1),
        {"temperature": "degC", "stiffness": "Pa"}, specimen=True,
    )  # fmt: skip


@pytest.fixture(scope="module")
def sweep() -> DmtaSweep:
    rng = np.random.default_rng(5)
    e = storage(T, 28e9, 38e9, 0.25, 62.0) + 0.25e9 * rng.standard_normal(T.size)
    loss = peak(T, 0.7e9, -0.3e9, 0.22, 60.0, 1.5e9) + 0.03e9 * rng.standard_normal(T.size)
    return DmtaSweep(
        "a-1Hz-heating",
        "a",
        1.0,
        Branch.HEATING,
        record("a-1Hz", e),
        record("a-1Hz-loss", loss),
        False,
        None,
    )


def test_medians_are_least_squares_and_intervals_as_wide_as_its_errors(sweep: DmtaSweep) -> None:
    """Weak priors and 90 samples: medians within 0.3 standard errors of scipy's, widths within 20 %."""
    models = {STORAGE: "bounded_logistic", LOSS: "modulus_peak"}
    found = study_sweep(sweep, models, (20.0, 62.0), 0).document
    assert all(c.converged for c in found.curves)
    by_channel = {c.channel: c for c in found.curves}
    assert sweep.loss is not None
    cases = (
        (STORAGE, storage, sweep.storage, [3e10, 3e10, 0.2, 60.0], ("cold", "span", "rate", "midpoint")),
        (LOSS, peak, sweep.loss, [6e8, -1e8, 0.2, 58.0, 1e9], ("cold", "span", "rate", "midpoint", "peak")),
    )
    for channel, curve, own, start, names in cases:
        best, covariance = curve_fit(
            curve, T, own.observed["stiffness"], p0=start, x_scale=np.abs(start), method="trf"
        )
        error = np.sqrt(np.diag(covariance))
        told = by_channel[channel].parameters
        for value, sd, name in zip(best, error, names, strict=True):
            assert abs(told[name].median - value) < 0.3 * sd, (channel, name)
            assert told[name].q95 - told[name].q05 == pytest.approx(3.29 * sd, rel=0.2), (channel, name)
    temperatures = {t.name: t for t in found.temperatures}
    rate, midpoint = (by_channel[STORAGE].parameters[k].median for k in ("rate", "midpoint"))
    assert temperatures["midpoint"].median == pytest.approx(midpoint, abs=0.05)
    assert temperatures["As"].median == pytest.approx(midpoint - 2.0 / rate, abs=0.1)
    assert temperatures["Af"].median == pytest.approx(midpoint + 2.0 / rate, abs=0.1)
    fine = np.linspace(0.0, 110.0, 200001)
    wanted = [by_channel[c].parameters for c in (STORAGE, LOSS)]
    e, loss = (
        f(fine, *(p[n].median for n in names)) for (_, f, _, _, names), p in zip(cases, wanted, strict=True)
    )
    assert temperatures["loss_peak"].median == pytest.approx(fine[np.argmax(loss)], abs=0.1)
    assert temperatures["tan_delta_peak"].median == pytest.approx(fine[np.argmax(loss / e)], abs=0.1)
    assert temperatures["tan_delta_peak"].median < temperatures["loss_peak"].median
    value = next(v for v in found.values if v.channel == "tan_delta" and v.at == 62.0)
    at = np.argmin(np.abs(fine - 62.0))
    assert value.median == pytest.approx(loss[at] / e[at], rel=0.01)


def test_a_peak_at_an_end_is_none() -> None:
    t = np.linspace(0.0, 10.0, 401)
    y = np.stack([np.exp(-((t - 4.21) ** 2)), t, -t])
    found = peak_of(t, y)
    assert found[0] == pytest.approx(4.21, abs=1e-3)
    assert np.isnan(found[1:]).all()
