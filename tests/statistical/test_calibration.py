"""Recovery and simulation-based calibration: parameters are drawn from the priors, records from the model, and fitted.

If sampler, likelihood and priors are right, then for every parameter an interval of 90 % probability holds the true
value in 90 % of the records, and the rank of the true value among the draws is uniform. No record is left out, also
where the transition lies so that the curve is nearly flat over the sweep. A parameter counts as identified in a record
where the data shrink its variance to a tenth of the prior's or less, as in the reports. Which records those are is
seen in the data alone, so intervals must cover there as they do everywhere.

False alarms, were the seed drawn anew. With 200 records the share covered has a standard deviation of 2.1 %; a
parameter whose true coverage is 90 % leaves the band of 85 to 95 % in one file of 77, and in one of 16 where it is
identified in 100 records only, the fewest that are judged; with ten parameters or more in a case, some one does in one
file of 8 for each case. Of stiffness alone 400 records are drawn, a false alarm in one file of 1000 for a parameter:
with 200 of this seed A2 and B2, which the data tie together, covered 85.5 and 84.8 %, with another seed 92.7 and
91.8 %. Ranks: the least of the Kolmogorov-Smirnov probabilities is held against 1 % over their number, at most one
false alarm in 100 for each case. The seed is fixed, so that none comes and goes.

Beside the parameters the log-likelihood is ranked, which sees what parameters one by one do not: draws that ignore the
data have uniform ranks too (M. Modrák et al., "Simulation-based calibration checking for Bayesian computation: the
choice of test quantities shapes sensitivity", Bayesian Analysis 20 (2025) 461, doi 10.1214/23-BA1404).
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy.stats import kstest

from sma_bayes.assess.identifiability import IDENTIFIED, contraction
from sma_bayes.inference.convergence import Target
from sma_bayes.inference.ensembles import Plan
from sma_bayes.noise import NOISE_MODELS
from sma_bayes.parameters.priors_file import PriorSet, parse_priors
from sma_bayes.posterior import Posterior, build_posterior
from sma_bayes.quantities import Floats
from sma_bayes.records.types import Branch, Condition, Record
from sma_bayes.results.fit import Fit
from sma_bayes.results.fitting import fit_records

pytestmark = pytest.mark.slow

FEWEST = 100
"""Records in which a parameter must be identified for its coverage to be judged."""
SAMPLES = 80
FALSE_ALARM = 0.01
"""Of the ranks of a case, all quantities together."""
PLAN = Plan(target=Target(rhat=1.02, ess=500.0), evaluations=150_000)
CASES = {
    "independent": (("force", "displacement"), "independent", 200),
    "AR(1)": (("force", "displacement"), "ar1", 200),
    "stiffness only": (("stiffness",), "independent", 400),
}
PRIORS = """
schema = "sma-bayes/priors/1"
model = "modified_sigmoid"
title = "springs of fixed numbers, none scaled to a record"
[both]
A1 = { family = "lognormal", median = 0.02, sigma = 0.5, unit = "m" }
A2 = { family = "lognormal", median = 0.3, sigma = 0.4, unit = "1/K" }
A3 = { family = "normal", mean = 48.0, sd = 6.0, unit = "degC" }
A4 = { family = "normal", mean = 0.0, sd = 0.01, unit = "m" }
B1 = { family = "lognormal", median = 2.0, sigma = 0.5, unit = "N" }
B2 = { family = "lognormal", median = 0.3, sigma = 0.4, unit = "1/K" }
B3 = { family = "normal", mean = 52.0, sd = 6.0, unit = "degC" }
B4 = { family = "normal", mean = 0.0, sd = 1.0, unit = "N" }
[noise]
phi = { family = "uniform", low = -0.5, high = 0.95 }
[[noise.sd]]
family = "lognormal"
median = 0.02
sigma = 0.7
relative_to = "typical(channel)"  # 1 cm or 1 N whatever the record
[[noise.sd]]
family = "lognormal"
median = 0.02
sigma = 0.7
relative_to = "typical(force) / typical(displacement)"
"""


def priors() -> PriorSet:
    return parse_priors(PRIORS, "calibration.toml")


def blank(channels: tuple[str, ...], key: str) -> Record:
    """Record of a sweep of which nothing has been measured yet."""
    units = {"force": "N", "displacement": "m", "stiffness": "N/m"}
    # what is observed must not matter for the priors; a slope keeps the ranks of the record defined
    observed = {c: np.linspace(0.0, 1.0, SAMPLES) for c in channels}
    return Record(
        Condition(key),
        Branch.HEATING,
        {"temperature": np.linspace(25.0, 75.0, SAMPLES)},
        observed,
        np.arange(SAMPLES) + 2,
        {"temperature": "degC", **{c: units[c] for c in channels}},
    )


def drawn(posterior: Posterior, rng: np.random.Generator) -> tuple[Floats, Record]:
    """Parameters from the prior, in sampled coordinates, and a record from the model with them."""
    z = posterior.space.draw(rng, 1)[0]
    series = posterior.replicate(rng, posterior.space.to_physical(z))
    return z, replace(posterior.records[0], observed={c: y[0] for c, y in series.items()})


@dataclass(frozen=True, eq=False)
class Outcomes:
    """What became of the records of a case.

    `rank` holds, for every quantity, the share of draws below the true value; `covered`, for every parameter, whether
    the 90 % interval held it in the records where the parameter was identified.
    """

    rank: dict[str, list[float]]
    covered: dict[str, list[bool]]
    unconverged: int


def outcomes(channels: tuple[str, ...], noise: str, records: int, seed: int) -> Outcomes:
    rank, covered = defaultdict(list), defaultdict(list)
    unconverged = 0
    for i, stream in enumerate(np.random.SeedSequence(seed).spawn(records)):
        template = build_posterior([blank(channels, f"record {i}")], NOISE_MODELS[noise], priors())
        truth, record = drawn(template, np.random.default_rng(stream))
        fit = fit_records([record], priors(), noise=noise, seed=seed, plan=PLAN)
        unconverged += not fit.converged
        for name, below, identified in zip(
            template.names, np.mean(fit.draws.z < truth, axis=(0, 1, 2)), contraction(fit) >= IDENTIFIED,
            strict=True,
        ):  # fmt: skip
            rank[name].append(below)
            if identified:
                covered[name].append(0.05 < below < 0.95)
        rank["log-likelihood"].append(share_below(fit, truth))
    return Outcomes(rank, covered, unconverged)


def share_below(fit: Fit, truth: Floats) -> float:
    """Share of draws of less likelihood than the truth."""
    posterior = fit.posterior
    at_truth = posterior.log_likelihood(posterior.space.to_physical(truth)[None])[0]
    return float(np.mean(posterior.log_likelihood(fit.flat) < at_truth))


@pytest.fixture(scope="module", params=CASES, ids=lambda name: name.replace(" ", "-"))
def found(request: pytest.FixtureRequest) -> Outcomes:
    return outcomes(*CASES[request.param], seed=1)


def test_fits_converge(found: Outcomes) -> None:
    """Up to one in twenty may not within the small effort of `PLAN`; the ranks count them like the others."""
    assert found.unconverged <= len(found.rank["log-likelihood"]) // 20


def test_intervals_cover_what_is_identified(found: Outcomes) -> None:
    often = {name: inside for name, inside in found.covered.items() if len(inside) >= FEWEST}
    shares = {name: (np.mean(inside), len(inside)) for name, inside in often.items()}
    assert shares
    assert all(0.85 <= share <= 0.95 for share, _ in shares.values()), shares


def test_ranks_are_uniform(found: Outcomes) -> None:
    p = {name: kstest(rank, "uniform").pvalue for name, rank in found.rank.items()}
    assert min(p.values()) > FALSE_ALARM / len(p), p


def test_the_check_sees_intervals_that_are_too_narrow() -> None:
    """Ranks of posteriors of half the width that they should have are told from uniform ones."""
    rng = np.random.default_rng(2)
    truth, error = rng.standard_normal((2, 200))
    mean, sd = 0.5 * (truth + error), np.sqrt(0.5)
    draws = mean[:, None] + 0.5 * sd * rng.standard_normal((200, 1000))
    rank = np.mean(draws < truth[:, None], axis=1)
    assert np.mean((rank > 0.05) & (rank < 0.95)) < 0.85
    assert kstest(rank, "uniform").pvalue < FALSE_ALARM / 20
