"""What the samplers of the benchmark are given: records of the twin campaign, and one posterior for all samplers."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from benchmark.float_posterior import FloatPosterior
from benchmark.judgement import Reference

from sma_bayes.arrays import Floats
from sma_bayes.fitting.noise_choice import noise_start
from sma_bayes.fitting.posterior import Posterior, build_posterior
from sma_bayes.fitting.warm_start import warm_start
from sma_bayes.noise import NOISE_MODELS, Steps
from sma_bayes.paper.twin import Recipe, curves, recipes, twin_campaign
from sma_bayes.parameters.priors_file import parse_priors, read_priors
from sma_bayes.records.types import Record
from sma_bayes.sampling.convergence import Target
from sma_bayes.sampling.ensembles import Draws, Plan, sample
from sma_bayes.sampling.laplace import Mode, find_mode

CHANNEL_SETS = {
    "S": ("stiffness",),
    "FX": ("force", "displacement"),
    "FXS": ("force", "displacement", "stiffness"),
}
MEMORY = 0.8
"""Lag-1 correlation of the noise that is drawn where the noise model is AR(1) [1]."""
BALL = 1e-4
"""Standard deviation of the starts of emcee's tutorial, in sampled coordinates."""


@dataclass(frozen=True, slots=True)
class Case:
    """A kind of measurement.

    Attributes
    ----------
    channels : str
        A key of `CHANNEL_SETS`.
    noise : str
        Noise model; with ``ar1`` the noise of the data has a memory, too.
    points : int or None
        Samples of each record; None for as many as the demo campaign has.
    """

    channels: str
    noise: str
    points: int | None = None

    def records(self, seed: int = 0) -> tuple[Record, ...]:
        """The 18 records, drawn from the published parameters."""
        demo = twin_campaign(seed, CHANNEL_SETS[self.channels]).records
        if self.noise == "independent" and self.points is None:
            return demo
        return tuple(
            self._redrawn(record, recipe, seed, i)
            for i, (record, recipe) in enumerate(zip(demo, recipes(), strict=True))
        )

    def _redrawn(self, record: Record, recipe: Recipe, seed: int, index: int) -> Record:
        rng = np.random.default_rng([seed, index])
        n = self.points or record.n
        temperature = np.linspace(record.temperature[0], record.temperature[-1], n)
        clean = curves(temperature, {name: cell.value for name, cell in recipe.parameters.items()})
        steps = Steps(np.arange(n) == 0, np.ones(n), False)
        shape = np.array([[MEMORY]]) if self.noise == "ar1" else np.empty((1, 0))
        observed = {
            channel: clean[channel]
            + recipe.noise_sd[channel] * NOISE_MODELS[self.noise].draw(rng, shape, steps)[0]
            for channel in record.channels
        }
        return Record(
            condition=record.condition,
            branch=record.branch,
            inputs={"temperature": temperature},
            observed=observed,
            row=np.arange(1, n + 1),
            units=record.units,
            source=f"drawn with {n} points and {self.noise} noise",
        )


EVEN_MEMORY = """
schema = "sma-bayes/priors/1"
title = "memories of the benchmark"
source = "any memory alike"
model = "modified_sigmoid"
[noise.phi]
family = "uniform"
low = -1.0
high = 1.0
source = "that of the package until November 2026, by which the stored rows were measured"
"""
"""Prior of the noise's memory that all samplers of the benchmark are given."""


@dataclass(frozen=True, eq=False)
class Problem:
    """One posterior, and where sampling starts.

    Attributes
    ----------
    posterior : Posterior
    start : ndarray, shape (D,)
        Least-squares optimum with the noise estimated from its residuals, in sampled coordinates.
    warm_s : float
        Seconds that it took to find.
    """

    posterior: Posterior
    start: Floats
    warm_s: float

    @staticmethod
    def of(record: Record, noise: str) -> Problem:
        """Posterior of one record under the default priors, but for that of a memory (`EVEN_MEMORY`)."""
        priors = read_priors("modified_sigmoid").overridden_by(parse_priors(EVEN_MEMORY, "benchmark"))
        posterior = build_posterior([record], NOISE_MODELS[noise], priors)
        began = time.perf_counter()
        start = noise_start(posterior, warm_start(posterior, np.random.default_rng(0)))
        return Problem(posterior, start, time.perf_counter() - began)

    @property
    def dimension(self) -> int:
        """Number of sampled parameters."""
        return self.start.size

    @cached_property
    def mode(self) -> Mode:
        """Mode and Laplace covariance: where the walkers of other samplers start."""
        mode = find_mode(self.posterior, self.start, self.posterior.space.prior_sd())
        if mode is None:
            raise ValueError(f"{self.posterior.records[0].key}: the density is zero at the warm start")
        return mode

    @cached_property
    def float_posterior(self) -> FloatPosterior:
        """The log-posterior for samplers that ask for one point at a time."""
        return FloatPosterior(self.posterior, self.mode.z)

    def scalar(self, how: str) -> Callable[[Floats], float]:
        """A log-posterior of one point: ``written`` out, or the ``package``'s with a batch of one."""
        if how == "written":
            return self.float_posterior
        batched = self.posterior.log_prob
        return lambda z: float(batched(z[None])[0])

    def starts(self, rng: np.random.Generator, walkers: int, how: str) -> Floats:
        """Starts (walkers, D): ``laplace`` from the Laplace approximation, ``ball`` from a tiny ball at the optimum."""
        noise = rng.standard_normal((walkers, self.dimension))
        if how == "ball":
            return np.asarray(self.start + BALL * noise)
        return np.asarray(self.mode.z + noise @ np.linalg.cholesky(self.mode.covariance).T)

    def draws(self, seed: int, plan: Plan | None = None) -> Draws:
        """Draws of this package."""
        width = self.posterior.space.prior_sd()
        return sample(self.posterior, [self.start], width, np.random.SeedSequence(seed), plan)

    @cached_property
    def reference(self) -> Reference:
        """A longer run of this package, not timed, which the draws of all samplers are compared with."""
        plan = Plan(target=Target(1.005, 20_000.0), walkers=256, evaluations=20_000_000)
        draws = self.draws(seed=12345, plan=plan)
        if not draws.convergence.converged:
            raise ValueError(f"{self.posterior.records[0].key}: the run to compare with did not converge")
        found = draws.convergence
        least = float(np.min(np.minimum(found.ess_bulk, found.ess_tail)))
        return Reference.of(draws.z.reshape(-1, self.dimension), least)

    def check(self, density: Callable[[Floats], float]) -> None:
        """Compare log-densities at 20 random points about the mode: differences must agree to 1e-8.

        Raises
        ------
        ValueError
            If they don't.
        """
        z = self.starts(np.random.default_rng(1), 20, "laplace")
        own = self.posterior.log_prob(z)
        difference = np.array([float(density(x)) for x in z]) - own
        if not np.ptp(difference) <= 1e-8 * max(1.0, float(np.max(np.abs(own)))):
            raise ValueError(
                f"{self.posterior.records[0].key}: another target, off by {np.ptp(difference):.3g}"
            )
