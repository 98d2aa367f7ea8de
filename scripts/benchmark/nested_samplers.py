"""Nested sampling: dynesty and ultranest.

Both ask for one point at a time, so they are given the log-likelihood written out for one point.
"""

from __future__ import annotations

import logging
from abc import ABC, abstractmethod
from collections.abc import Callable, Generator

import numpy as np
from benchmark.gradient_posterior import Form, numbers
from benchmark.problems import Problem
from benchmark.progress import GROUPS, Progress, Settings
from scipy.special import ndtri

from sma_bayes.arrays import Floats
from sma_bayes.sampling.weighted import Weights, resampled

LIVE_POINTS = 150
"""Live points of each run at first; doubled until the target is reached."""
LOWEST = -1e300
"""Log-likelihood where there is none: neither sampler takes minus infinity."""


def cube(problem: Problem) -> Callable[[Floats], Floats]:
    """Map of the unit cube to sampled coordinates by the quantiles of the priors: (D,) to (D,), or (S, D) to (S, D)."""
    data = numbers(problem.posterior, problem.posterior.n)
    first, second = data["first_of_prior"], data["second_of_prior"]
    bounded = np.array(Form.of(problem.posterior).bounded)

    def transform(u: Floats) -> Floats:
        u = np.clip(u, 1e-300, 1.0 - 1e-16)
        return np.asarray(np.where(bounded, ndtri(u), first + second * ndtri(u)))

    return transform


def log_likelihood(problem: Problem) -> Callable[[Floats], float]:
    """Log-likelihood of one point."""
    written = problem.float_posterior
    return lambda z: max(written.log_likelihood(z), LOWEST)


class _Nested(ABC):
    """Runs that share nothing, with more live points until the target is reached."""

    def prepare(self, problem: Problem) -> None:
        """See `Sampler.prepare`."""
        likelihood = log_likelihood(problem)
        problem.check(lambda z: likelihood(z) + float(problem.posterior.log_prior(z)))

    @abstractmethod
    def one(self, problem: Problem, live: int, seed: int) -> tuple[Floats, Floats, int]:
        """Points (S, D), log weights and evaluations of a run."""

    def run(self, problem: Problem, settings: Settings, seed: int) -> Generator[Progress, float, None]:
        live = LIVE_POINTS
        while True:
            found = [self.one(problem, live, 10_000 * seed + live + g) for g in range(GROUPS)]
            rng = np.random.default_rng([seed, 7])
            drawn = [_equal_draws(z, log_weight, rng) for z, log_weight, _ in found]
            least = min(map(len, drawn))
            chains = np.stack([z[:least] for z in drawn])[:, :, None]
            yield Progress(chains, sum(spent for *_, spent in found), (0.0,), anew=True)
            live *= 2


def _equal_draws(z: Floats, log_weight: Floats, rng: np.random.Generator) -> Floats:
    """As many draws of equal weight as the weighted points `z` (S, D) are worth, in random order."""
    size = int(Weights(log_weight).efficiency * log_weight.size)
    return np.asarray(z[resampled(log_weight, size, rng)])


class Dynesty(_Nested):
    """dynesty with random slices, its other settings as they come."""

    title = "dynesty, `rslice`"
    packages = ("dynesty",)

    def one(self, problem: Problem, live: int, seed: int) -> tuple[Floats, Floats, int]:
        import dynesty

        sampler = dynesty.NestedSampler(
            log_likelihood(problem), cube(problem), problem.dimension, nlive=live, sample="rslice",
            rstate=np.random.default_rng(seed),
        )  # fmt: skip
        sampler.run_nested(print_progress=False, dlogz=0.01)
        r = sampler.results
        return np.asarray(r.samples), np.asarray(r.logwt), int(np.sum(r.ncall))


class UltraNest(_Nested):
    """ultranest's reactive sampler with slices; its regions alone don't come to an end here."""

    title = "ultranest, slices"
    packages = ("ultranest",)

    def one(self, problem: Problem, live: int, seed: int) -> tuple[Floats, Floats, int]:
        import ultranest
        from ultranest.stepsampler import SliceSampler, generate_mixture_random_direction

        logging.getLogger("ultranest").setLevel(logging.ERROR)
        np.random.seed(seed)  # noqa: NPY002 - ultranest draws from numpy's global state
        sampler = ultranest.ReactiveNestedSampler(
            list(problem.posterior.names), log_likelihood(problem), cube(problem)
        )
        sampler.stepsampler = SliceSampler(
            nsteps=2 * problem.dimension, generate_direction=generate_mixture_random_direction
        )
        r = sampler.run(
            min_num_live_points=live, show_status=False, viz_callback=False, dlogz=0.5, min_ess=0,
            cluster_num_live_points=0,
        )  # fmt: skip
        w = r["weighted_samples"]
        with np.errstate(divide="ignore"):
            return np.asarray(w["points"]), np.log(np.asarray(w["weights"])), int(r["ncall"])
