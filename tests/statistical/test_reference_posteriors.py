"""Posteriors whose moments and quantiles are known: growth curves by quadrature, others by posteriordb's draws.

How the references were made stands in `scripts/reference_posteriors.py` and beside the data, in
tests/data/reference_posteriors.md. Of each parameter are compared

- the mean and the probabilities below five quantiles, within 5 standard errors. These are of both sides: of
  posteriordb's draws from their effective sizes, of the package's from the scatter of the means of its 512 walkers,
  which sees it where walkers stay in a tail for long;
- the standard deviation, to 5 %. Its own standard error is known poorly where tails are heavy: the posterior of the
  logistic curve has a kurtosis of 5 to 10, and draws of far tails are rare.

False alarms: with normal errors one in 8000 runs of this file (198 comparisons of means and quantiles; standard
deviations of the growth curves scatter by 0.4 to 1.0 %, so that 5 % is 5 standard errors or more). With 12 seeds for
two growth curves standard errors were right (root mean squares of 0.6 to 1.4), and the largest of 576 was 3.1.

Seeds are fixed; the rates say what to expect when a dependency draws anew.
"""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
from reference_posteriors import CASES, GRIDS, QUANTILES, STORED, grid_of

import sma_bayes
from sma_bayes.arrays import Floats
from sma_bayes.fitting.fit import Fit
from sma_bayes.parameters.priors_file import parse_priors
from sma_bayes.sampling.convergence import Target
from sma_bayes.sampling.ensembles import Plan

REFERENCES: dict[str, Any] = json.loads(STORED.read_text(encoding="utf-8"))
GROWTH = [name for name, case in CASES.items() if not case.reference]
WITHIN = 5.0
"""Standard errors."""
SD_RATIO = 0.05
ENOUGH = {True: 30_000.0, False: 10_000.0}
"""Effective draws where the reference is exact, and where it has 10,000 draws itself."""


def fit_of(name: str, seed: int = 0) -> Fit:
    case = CASES[name]
    priors = parse_priors(case.priors_text, f"priors of {name}")
    plan = Plan(Target(rhat=1.01, ess=ENOUGH[name in GROWTH]), walkers=128)
    record = case.record(REFERENCES[name]["data"])
    return sma_bayes.fit_records(
        [record], priors, model=case.model(), noise="independent", discrepancy=False, seed=seed, plan=plan
    )


def error_of_mean(x: Floats) -> float:
    """Standard error of the mean of draws (groups, steps, walkers), from the means of the walkers."""
    means = x.mean(axis=1)
    return float(means.std(ddof=1) / np.sqrt(means.size))


def standard_errors(x: Floats, reference: dict[str, float]) -> dict[str, float]:
    """How far mean and quantiles of draws (groups, steps, walkers) are from the reference, in standard errors."""
    theirs = 1.0 / reference["ess"] if "ess" in reference else 0.0
    off = float(x.mean()) - reference["mean"]
    found = {"mean": off / np.hypot(error_of_mean(x), reference["sd"] * np.sqrt(theirs))}
    for p in QUANTILES:
        key = f"q{round(100 * p):02d}"
        below = (x < reference[key]).astype(float)
        error = np.hypot(error_of_mean(below), np.sqrt(p * (1.0 - p) * theirs))
        found[key] = (float(below.mean()) - p) / error
    return found


def check(name: str) -> Fit:
    fit = fit_of(name)
    assert fit.converged
    theta = fit.posterior.space.constrain(fit.draws.z)
    far = {}
    for k, parameter in enumerate(fit.posterior.space.names):
        x, reference = theta[..., k], REFERENCES[name]["parameters"][parameter]
        off = standard_errors(x, reference)
        far |= {f"{parameter} {what}": value for what, value in off.items() if not abs(value) < WITHIN}
        ratio = float(x.std()) / reference["sd"]
        far |= {} if abs(ratio - 1.0) < SD_RATIO else {f"{parameter} sd": ratio}
    assert not far, far
    return fit


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=pytest.mark.slow if n == "richards" else ()) for n in GROWTH]
)
def test_a_growth_curve_has_its_posterior_and_evidence(name: str) -> None:
    fit = check(name)
    off = fit.draws.ln_evidence - REFERENCES[name]["ln_evidence"]
    assert abs(off) < max(WITHIN * fit.draws.ln_evidence_sd, 0.01)


@pytest.mark.parametrize("name", ["sblri", "sblrc"])
def test_a_regression_of_posteriordb_has_its_posterior(name: str) -> None:
    check(name)


@pytest.mark.slow
def test_predators_and_prey_of_posteriordb_have_their_posterior() -> None:
    check("lynx_hare")


@pytest.mark.slow
@pytest.mark.parametrize("name", GROWTH[:2])
def test_the_quadrature_gives_what_is_stored(name: str) -> None:
    quadrature = grid_of(CASES[name])
    again = quadrature.result(*GRIDS[len(quadrature.others)][0])
    assert again["ln_evidence"] == pytest.approx(REFERENCES[name]["ln_evidence"], abs=1e-4)
    for parameter, told in REFERENCES[name]["parameters"].items():
        for key, value in told.items():
            assert again["parameters"][parameter][key] == pytest.approx(value, abs=2e-3 * told["sd"])


def test_the_quadratures_span_is_that_of_a_plain_integral() -> None:
    """The span integrated out in closed form against a sum over the span itself."""
    quadrature = grid_of(CASES["logistic"])
    z = np.array([np.log(0.07), 38.0, np.log(1.5)])
    given = quadrature.given(z)
    rate, midpoint, sd = quadrature.physical(z)
    spans = np.linspace(given.mean - 12 * given.sd, given.mean + 12 * given.sd, 4001)
    curve = spans[:, None] / (1.0 + np.exp(-rate * (quadrature.x - midpoint)))
    prior = CASES["logistic"].priors
    log = -0.5 * np.sum(((quadrature.y - curve) / sd) ** 2, axis=1) - quadrature.y.size * np.log(sd)
    log -= 0.5 * ((spans - prior["span"]["mean"]) / prior["span"]["sd"]) ** 2 + np.log(prior["span"]["sd"])
    log -= 0.5 * ((z[0] - np.log(0.07)) / 0.7) ** 2 + np.log(0.7)
    log -= 0.5 * ((z[1] - 40.0) / 20.0) ** 2 + np.log(20.0) + 0.5 * z[2] ** 2
    log -= 0.5 * (quadrature.y.size + 4) * np.log(2.0 * np.pi)
    w = np.exp(log - log.max())
    whole = float(np.log(w.sum() * (spans[1] - spans[0])) + log.max())
    assert float(given.log_density) == pytest.approx(whole, abs=1e-8)
    assert float(given.mean) == pytest.approx(float(w @ spans / w.sum()), rel=1e-10)


def test_a_wrong_posterior_is_noticed() -> None:
    """Draws of another posterior are refused: the test can fail."""
    rng = np.random.default_rng(0)
    right = {"mean": 0.0, "sd": 1.0, "q05": -1.645, "q25": -0.674, "q50": 0.0, "q75": 0.674, "q95": 1.645}
    x = rng.standard_normal((4, 24, 128))
    assert max(map(abs, standard_errors(x, right).values())) < WITHIN
    assert max(map(abs, standard_errors(x + 0.1, right).values())) > WITHIN
    assert max(map(abs, standard_errors(1.1 * x, right).values())) > WITHIN
