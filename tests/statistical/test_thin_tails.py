"""A posterior with a tail that a first proposal hardly draws is sampled by independence moves, with the right tails."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.stats import multivariate_t

import sma_bayes
from sma_bayes.simulated.campaign import measurement_files

TAILS = (0.025, 0.975)


@pytest.mark.slow
def test_a_log_without_a_campaign_converges_with_the_right_tails(tmp_path: Path) -> None:
    """The demo's first file by itself: a memory up to its bound, a discrepancy that may be nothing.

    Weighted draws of a wide t distribution, which share nothing with the proposals of the run, put as much beyond the
    2.5 and 97.5 % quantiles of each parameter: within four standard errors of both (of 26 shares one is not in one run
    of 600), and these are small enough to see twice as much.
    """
    path = tmp_path / "one.csv"
    path.write_text(measurement_files(0)["100g.csv"], encoding="utf-8")
    fit = sma_bayes.fit(sma_bayes.read_campaign(path), jobs=1)["one-cooling"]
    draws = fit.draws
    assert draws.convergence.converged
    assert draws.method.startswith("independence")
    assert draws.audit is not None
    assert draws.audit.passed
    assert draws.evaluations < 400_000

    z = draws.z.reshape(-1, draws.z.shape[-1])
    wide = multivariate_t(z.mean(axis=0), 1.5 * np.cov(z.T), df=5)
    far = wide.rvs(160_000, random_state=np.random.default_rng(0))
    log_weight = fit.posterior.log_prob(far) - wide.logpdf(far)
    weight = np.exp(log_weight - log_weight.max())
    weight /= weight.sum()
    assert 1.0 / (weight @ weight) > 5000.0
    effective = draws.convergence.ess_tail.min()
    for i in range(z.shape[1]):
        for q in TAILS:
            at = np.quantile(z[:, i], q)
            beyond = far[:, i] > at if q > 0.5 else far[:, i] < at
            share = float(weight @ beyond)
            wanted = min(q, 1.0 - q)
            error = np.sqrt(weight**2 @ (beyond - share) ** 2 + wanted / effective)
            assert abs(share - wanted) < 4.0 * error, (fit.posterior.space.names[i], q)
            assert error < wanted / 4.0
