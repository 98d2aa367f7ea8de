"""Recovery and simulation-based calibration: parameters are drawn from the priors, records from the model, and fitted.

If sampler, likelihood and priors are right, then for every parameter an interval of 90 % probability holds the true
value in 90 % of the records, and the rank of the true value among the draws is uniform. No record is left out, also
where the transition lies so that the curve is nearly flat over the sweep. A parameter counts as identified in a record
where the data shrink its variance to a tenth of the prior's or less, as in the reports. Which records those are is
seen in the data alone, so intervals must cover there as they do everywhere.

The cases follow from the catalogues: each response model with independent noise, each noise with the published model,
and that model with a discrepancy. Priors are those that ship with a model, on the scales of one reference record
whatever is drawn; those that `PRIORS` names are narrower, so that most records have something to tell.

False alarms, were the seed drawn anew. Three cases are drawn so often that shares of 85 to 95 % can be asked for:
with 200 records the share covered has a standard deviation of 2.1 %; a parameter whose true coverage is 90 % leaves
that band in one file of 77, and in one of 16 where it is identified in 100 records only, the fewest that are judged;
with ten parameters or more in a case, some one does in one file of 8 for each case. Of stiffness alone 400 records
are drawn, a false alarm in one file of 1000 for a parameter: with 200 of this seed A2 and B2, which the data tie
together, covered 85.5 and 84.8 %, with another seed 92.7 and 91.8 %. In the other cases the counts are held against
those that a binomial of 90 % leaves with a probability of 1 % over their number, and in all cases so is the least of
the Kolmogorov-Smirnov probabilities of the ranks: at most one false alarm in 100 for each case and check. The seed is
fixed, so that none comes and goes.

Beside the parameters the log-likelihood is ranked, which sees what parameters one by one do not: draws that ignore the
data have uniform ranks too (M. Modrák et al., "Simulation-based calibration checking for Bayesian computation: the
choice of test quantities shapes sensitivity", Bayesian Analysis 20 (2025) 461, doi 10.1214/23-BA1404).
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from scipy.stats import binom, kstest

from sma_bayes.arrays import Floats
from sma_bayes.assess.identifiability import IDENTIFIED, contraction
from sma_bayes.fitting.fit import Fit, kept
from sma_bayes.fitting.noise_choice import discrepancy_bases, noise_start
from sma_bayes.fitting.posterior import Posterior, build_posterior
from sma_bayes.fitting.warm_start import warm_start
from sma_bayes.noise import NOISE_MODELS
from sma_bayes.noise.heteroscedastic import WRAPPERS
from sma_bayes.parameters.priors_file import parse_priors
from sma_bayes.parameters.space import ParameterSpace
from sma_bayes.records.types import Branch, Condition, Record
from sma_bayes.response import RESPONSE_MODELS, ModifiedSigmoid, ResponseModel
from sma_bayes.sampling.convergence import Target
from sma_bayes.sampling.ensembles import Plan
from sma_bayes.sampling.factors import sample_by_factors

pytestmark = pytest.mark.slow

FEWEST = 100
"""Records in which a parameter must be identified for its share of 85 to 95 % to be judged."""
FEWEST_COUNTED = 20
"""Records in which it must be identified for a count to be held against a binomial."""
SAMPLES = 80
FALSE_ALARM = 0.01
"""Of the ranks of a case, all quantities together; and of its counts."""
PLAN = Plan(target=Target(rhat=1.02, ess=500.0), evaluations=150_000)
SKEWED = ("sinh_arcsinh", "sinh_arcsinh_slopes")
"""Models whose records have the effort of `fit`: where the transition is hardly seen, skew and tails of the curve have
a posterior so bent that one record in six takes more than that of `PLAN`, and five of 120 take 0.9 to 3.6 million."""
BOTH = ("force", "displacement")
MOST = 12
"""Parameters from which on the channels of a model are not drawn together; they don't share any."""
TYPICAL = {"force": 2.0, "displacement": 0.02, "stiffness": 100.0}
"""Span [N, m, N/m] of each channel of the reference record."""
NOISE = 0.02
"""Noise over the span that scales the priors which `PRIORS` does not name."""


@dataclass(frozen=True)
class Case:
    """What is drawn and fitted.

    Attributes
    ----------
    channels : tuple of str
    records : int
    model, noise : str
    discrepancy : bool
        Whether a smooth function is drawn beside the curve and fitted.
    evaluations : int
        Greatest effort for a record.
    """

    channels: tuple[str, ...] = BOTH
    records: int = 60
    model: str = ModifiedSigmoid.name
    noise: str = "independent"
    discrepancy: bool = False
    evaluations: int = PLAN.evaluations


def channels_of(kind: type[ResponseModel]) -> tuple[str, ...]:
    """Force and displacement; one channel where that would be more than `MOST` parameters, or the model has but one."""
    if kind.refusal(BOTH):
        return ("stiffness",)
    return BOTH if len(kind(BOTH).parameter_names) <= MOST else ("displacement",)


def cases() -> dict[str, Case]:
    """Cases by name: the three that are drawn often, and what else the catalogues hold."""
    found = {
        "independent": Case(records=200),
        "AR(1)": Case(records=200, noise="ar1"),
        "stiffness only": Case(("stiffness",), 400),
        "discrepancy": Case(discrepancy=True),
    }
    for name, kind in RESPONSE_MODELS.items():
        if name != ModifiedSigmoid.name:
            effort = Plan() if name in SKEWED else PLAN
            found[f"model {name}"] = Case(channels_of(kind), model=name, evaluations=effort.evaluations)
    noises = [n for n, noise in NOISE_MODELS.items() if noise.is_density and n not in ("independent", "ar1")]
    for name in (*noises, *(f"independent+{suffix}" for suffix in WRAPPERS)):
        found[f"noise {name}"] = Case(noise=name)
    return found


CASES = cases()
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


def blank(channels: tuple[str, ...], key: str) -> Record:
    """Record of a sweep of which nothing has been measured yet; what stands for it sets the scales of the priors."""
    units = {"force": "N", "displacement": "m", "stiffness": "N/m"}
    observed = {c: TYPICAL[c] * np.linspace(0.5, 1.5, SAMPLES) for c in channels}
    return Record(
        Condition(key),
        Branch.HEATING,
        # uneven steps, so that noise in time is no other than noise by the sample
        {
            "temperature": np.linspace(25.0, 75.0, SAMPLES),
            "time": np.cumsum(1.0 + 0.5 * np.cos(np.arange(SAMPLES))),
        },
        observed,
        np.arange(SAMPLES) + 2,
        {"temperature": "degC", "time": "s", **{c: units[c] for c in channels}},
    )


def prior_of(case: Case, key: str) -> Posterior:
    """Priors, curve and noise of a case, on scales that what is drawn does not change."""
    record, noise = blank(case.channels, key), NOISE_MODELS[case.noise]
    model = RESPONSE_MODELS[case.model].made_for([record])
    left = [{c: NOISE * TYPICAL[c] for c in case.channels}]
    shipped = build_posterior([record], noise, model.default_priors(), model=model, residual=left)
    if case.discrepancy:
        centre = shipped.space.constrain(shipped.space.prior_centre())[: len(model.parameter_names)]
        bases = discrepancy_bases(shipped, centre)
        shipped = build_posterior(
            [record], noise, model.default_priors(), model=model, residual=left, discrepancy=bases
        )
    narrow = build_posterior([record], NOISE_MODELS["ar1"], parse_priors(PRIORS, "calibration.toml"))
    own = {p.name: p for p in narrow.space.parameters}
    space = ParameterSpace(tuple(own.get(p.name, p) for p in shipped.space.parameters))
    return replace(shipped, space=space)


def drawn(prior: Posterior, rng: np.random.Generator) -> tuple[Floats, Record]:
    """Parameters from the prior, in sampled coordinates, and a record from the model with them."""
    (record,) = prior.records
    z = prior.space.draw(rng, 1)[0]
    theta = prior.space.constrain(z)[None]
    size = prior.layout[0].size
    weights = (
        {c: theta[:, at] * rng.standard_normal((1, prior.discrepancy[0][c].count)) for c, at in size.items()},
    )
    # noise that grows does so over the observed range, which is that of the curve but for the noise
    clean = {c: y[0] for c, y in prior.predict(theta, record.inputs, weights=weights).items()}
    seen = replace(prior, records=(replace(record, observed={c: clean[c] for c in record.channels}),))
    series = seen.replicate(rng, theta, weights=weights)
    return z, replace(record, observed={c: y[0] for c, y in series.items()})


def fitted(prior: Posterior, record: Record, seed: int, evaluations: int) -> Fit:
    """Fit of a record under the same priors, sampled as the package does it."""
    posterior = replace(prior, records=(record,))
    first, second = np.random.SeedSequence([seed, *record.key.encode()]).spawn(2)
    start = warm_start(posterior, np.random.default_rng(first))
    z = noise_start(posterior, start)
    starts = [z]
    for other in start.optima[1:]:
        starts.append(z.copy())
        starts[-1][: other.size] = other
    draws = sample_by_factors(
        posterior, starts, posterior.space.prior_sd(), second, replace(PLAN, evaluations=evaluations)
    )
    return Fit(posterior, start, posterior.space.constrain(z), draws, None, seed, kept(draws))


@dataclass(frozen=True, eq=False)
class Outcomes:
    """What became of the records of a case.

    `rank` holds, for every quantity, the share of draws below the true value; `covered`, for every parameter, whether
    the 90 % interval held it in the records where the parameter was identified.
    """

    case: Case
    rank: dict[str, list[float]] = field(default_factory=lambda: defaultdict(list))
    covered: dict[str, list[bool]] = field(default_factory=lambda: defaultdict(list))
    unconverged: list[int] = field(default_factory=list)


def outcomes(case: Case, seed: int) -> Outcomes:
    found = Outcomes(case)
    for i, stream in enumerate(np.random.SeedSequence(seed).spawn(case.records)):
        prior = prior_of(case, f"record {i}")
        truth, record = drawn(prior, np.random.default_rng(stream))
        fit = fitted(prior, record, seed, case.evaluations)
        if not fit.converged:
            found.unconverged.append(i)
        for name, below, identified in zip(
            prior.names, np.mean(fit.draws.z < truth, axis=(0, 1, 2)), contraction(fit) >= IDENTIFIED,
            strict=True,
        ):  # fmt: skip
            found.rank[name].append(below)
            if identified:
                found.covered[name].append(0.05 < below < 0.95)
        found.rank["log-likelihood"].append(share_below(fit, truth))
    return found


def share_below(fit: Fit, truth: Floats) -> float:
    """Share of draws of less likelihood than the truth."""
    posterior = fit.posterior
    at_truth = posterior.log_likelihood(posterior.space.constrain(truth)[None])[0]
    return float(np.mean(posterior.log_likelihood(fit.flat) < at_truth))


OFTEN = ("AR(1)", "discrepancy")
"""Cases for which CI has the time."""


@pytest.fixture(
    scope="module",
    params=[c if c in OFTEN else pytest.param(c, marks=pytest.mark.thorough) for c in CASES],
    ids=lambda name: name.replace(" ", "-"),
)
def found(request: pytest.FixtureRequest) -> Outcomes:
    return outcomes(CASES[request.param], seed=1)


def test_fits_converge(found: Outcomes) -> None:
    """Up to one in twenty may not within the effort of the case; the ranks count them like the others."""
    assert len(found.unconverged) <= found.case.records // 20, found.unconverged


def test_intervals_cover_what_is_identified(found: Outcomes) -> None:
    often = {name: inside for name, inside in found.covered.items() if len(inside) >= FEWEST_COUNTED}
    if found.case.records >= 2 * FEWEST:
        often = {name: inside for name, inside in often.items() if len(inside) >= FEWEST}
        shares = {name: (np.mean(inside), len(inside)) for name, inside in often.items()}
        assert all(0.85 <= share <= 0.95 for share, _ in shares.values()), shares
    assert often
    p = {name: chance(sum(inside), len(inside)) for name, inside in often.items()}
    assert min(p.values()) > FALSE_ALARM / len(p), p


def chance(covered: int, of: int) -> float:
    """Probability that an interval of 90 % covers as seldom or as often as that, both sides counted."""
    return 2.0 * float(min(binom.cdf(covered, of, 0.9), binom.sf(covered - 1, of, 0.9)))


def test_ranks_are_uniform(found: Outcomes) -> None:
    p = {name: kstest(rank, "uniform").pvalue for name, rank in found.rank.items()}
    assert min(p.values()) > FALSE_ALARM / len(p), p


def test_every_model_and_noise_of_the_catalogues_is_a_case() -> None:
    assert {c.model for c in CASES.values()} == set(RESPONSE_MODELS)
    densities = {name for name, noise in NOISE_MODELS.items() if noise.is_density}
    extended = {f"independent+{suffix}" for suffix in WRAPPERS}
    assert {c.noise for c in CASES.values()} == densities | extended


def test_the_check_sees_intervals_that_are_too_narrow() -> None:
    """Ranks of posteriors of half the width that they should have are told from uniform ones."""
    rng = np.random.default_rng(2)
    truth, error = rng.standard_normal((2, 200))
    mean, sd = 0.5 * (truth + error), np.sqrt(0.5)
    draws = mean[:, None] + 0.5 * sd * rng.standard_normal((200, 1000))
    rank = np.mean(draws < truth[:, None], axis=1)
    assert np.mean((rank > 0.05) & (rank < 0.95)) < 0.85
    assert kstest(rank, "uniform").pvalue < FALSE_ALARM / 20
