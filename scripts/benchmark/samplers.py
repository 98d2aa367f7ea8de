"""The samplers that are compared: one class each, and a table.

A sampler is a generator. Each time it is asked it runs on and hands over all draws so far, and is told by what
factor to go on; the clock runs only while it works, and it is asked until its draws meet the target. So other
samplers stop at an oracle's word, at no cost, while this package pays for its own diagnosis.
"""

from __future__ import annotations

import io
from collections.abc import Generator
from contextlib import redirect_stdout
from typing import Protocol

import numpy as np
from benchmark.jax_samplers import BlackJax, NumPyro
from benchmark.nested_samplers import Dynesty, UltraNest
from benchmark.problems import Problem
from benchmark.progress import GROUPS, Progress, Settings
from benchmark.pymc_samplers import Nutpie, PyMC

from sma_bayes.arrays import Floats
from sma_bayes.sampling.ensembles import Plan

FIRST_BLOCK = 100
"""Steps before the first check."""


class Sampler(Protocol):
    """A way to sample a posterior.

    One that compiles, or that is given a target of its own, also has ``prepare(problem)``: it compares the target with
    the package's posterior, and compiles what serves all records of a case.
    """

    title: str
    packages: tuple[str, ...]

    def run(self, problem: Problem, settings: Settings, seed: int) -> Generator[Progress, float, None]:
        """Sample, hand over all draws at each stop, and go on until there are as many times more as was sent."""
        ...


class Package:
    """This package, as `sma-bayes fit` calls it: finds its proposal, diagnoses, stops by itself."""

    title = "this package"
    packages = ("sma-bayes", "emcee")

    def run(self, problem: Problem, settings: Settings, seed: int) -> Generator[Progress, float, None]:
        draws = problem.draws(seed, Plan())
        yield Progress(draws.z, draws.evaluations, (0.0,))


class ScalarEmcee:
    """emcee as it comes: stretch moves, a log-probability of one point at a time."""

    title = "emcee, one vector a call"
    packages = ("emcee",)

    def run(self, problem: Problem, settings: Settings, seed: int) -> Generator[Progress, float, None]:
        import emcee

        log_prob = problem.scalar(settings.log_prob)
        ensembles = [
            emcee.EnsembleSampler(settings.walkers, problem.dimension, log_prob) for _ in range(GROUPS)
        ]
        yield from _run_ensembles(ensembles, _states(problem, settings, seed))


class VectorisedEmcee:
    """emcee with this package's batched log-probability, which half an ensemble asks for at a time."""

    packages = ("emcee",)

    def __init__(self, title: str, moves: str) -> None:
        self.title = title
        self.moves = moves

    def run(self, problem: Problem, settings: Settings, seed: int) -> Generator[Progress, float, None]:
        import emcee

        moves = {
            "stretch": [(emcee.moves.StretchMove(), 1.0)],
            # not in the mix with DESnookerMove that emcee's documentation suggests: that samples the wrong density
            "de": [(emcee.moves.DEMove(), 0.9), (emcee.moves.DEMove(gamma0=1.0), 0.1)],
        }[self.moves]
        ensembles = [
            emcee.EnsembleSampler(
                settings.walkers, problem.dimension, problem.posterior.log_prob, moves=moves, vectorize=True
            )
            for _ in range(GROUPS)
        ]
        yield from _run_ensembles(ensembles, _states(problem, settings, seed))


class Lmfit:
    """`lmfit.Minimizer.emcee` with a user function that returns the log-posterior as a float."""

    title = "lmfit `emcee`"
    packages = ("lmfit", "emcee")

    def run(self, problem: Problem, settings: Settings, seed: int) -> Generator[Progress, float, None]:
        import lmfit

        log_prob = problem.scalar(settings.log_prob)
        names = problem.posterior.names

        def user_function(parameters: lmfit.Parameters) -> float:
            return log_prob(np.array([parameters[name].value for name in names]))

        ensembles, states = [], []
        for group, state in enumerate(_states(problem, settings, seed)):
            parameters = lmfit.Parameters()
            for name, value in zip(names, problem.start, strict=True):
                parameters.add(name, value=float(value))
            minimizer = lmfit.Minimizer(user_function, parameters, nan_policy="propagate")
            with redirect_stdout(io.StringIO()):  # it prints what it thinks of so short a chain
                minimizer.emcee(
                    steps=FIRST_BLOCK, nwalkers=settings.walkers, burn=0, pos=state.coords, progress=False,
                    float_behavior="posterior", seed=1000 * seed + group,
                )  # fmt: skip
            ensembles.append(minimizer.sampler)
            states.append(minimizer.sampler.backend.get_last_sample())
        # from here on lmfit's own sampler is run on, which spares it its summary after every block
        yield from _run_ensembles(ensembles, states)


class Zeus:
    """zeus: ensemble slice sampling with the package's batched log-probability."""

    title = "zeus, vectorised"
    packages = ("zeus-mcmc",)

    def run(self, problem: Problem, settings: Settings, seed: int) -> Generator[Progress, float, None]:
        import zeus

        np.random.seed(seed)  # noqa: NPY002 - zeus draws from numpy's global state
        rng = np.random.default_rng([seed, 7])
        walkers = max(settings.walkers // 2, 2 * problem.dimension + 2) // 2 * 2
        evaluations = 0

        def log_prob(z: Floats) -> Floats:
            nonlocal evaluations
            evaluations += len(z)
            return problem.posterior.log_prob(z)

        samplers = [
            zeus.EnsembleSampler(walkers, problem.dimension, log_prob, vectorize=True, verbose=False)
            for _ in range(GROUPS)
        ]
        starts = [problem.starts(rng, walkers, settings.start) for _ in range(GROUPS)]
        steps = FIRST_BLOCK
        while True:
            for i, sampler in enumerate(samplers):
                sampler.run_mcmc(starts[i], steps, progress=False)
                starts[i] = sampler.get_last_sample()
            chains = np.stack([s.get_chain() for s in samplers])
            growth = yield Progress(chains, evaluations)
            steps = max(10, round(chains.shape[1] * (growth - 1.0)))


def _states(problem: Problem, settings: Settings, seed: int) -> list:
    import emcee

    states = []
    for stream in np.random.SeedSequence([seed, 7]).spawn(GROUPS):
        start_seed, chain_seed = stream.spawn(2)
        coords = problem.starts(np.random.default_rng(start_seed), settings.walkers, settings.start)
        random_state = np.random.RandomState(np.random.MT19937(chain_seed)).get_state()
        states.append(emcee.State(coords, random_state=random_state))
    return states


def _run_ensembles(ensembles: list, states: list) -> Generator[Progress, float, None]:
    steps = FIRST_BLOCK
    while True:
        states = [e.run_mcmc(s, steps) for e, s in zip(ensembles, states, strict=True)]
        growth = yield _progress(ensembles)
        steps = max(5, round(ensembles[0].iteration * (growth - 1.0)))


def _progress(ensembles: list) -> Progress:
    chains = np.stack([e.get_chain() for e in ensembles])
    groups, steps, walkers, _ = chains.shape
    return Progress(chains, groups * (steps + 1) * walkers)


SAMPLERS: dict[str, Sampler] = {
    "sma_bayes": Package(),
    "blackjax": BlackJax("NUTS by hand (blackjax: whitened, vectorised)", tuned=False),
    "blackjax-tuned": BlackJax("NUTS by hand, its step tuned by dual averaging", tuned=True),
    "emcee-de": VectorisedEmcee("emcee, vectorised, differential evolution", "de"),
    "nutpie": Nutpie(),
    "emcee-vectorised": VectorisedEmcee("emcee, vectorised, stretch", "stretch"),
    "zeus": Zeus(),
    "dynesty": Dynesty(),
    "ultranest": UltraNest(),
    "pymc": PyMC(),
    "numpyro": NumPyro(),
    "emcee": ScalarEmcee(),
    "lmfit": Lmfit(),
}
"""In the order of the tables."""
ONE_BY_ONE = frozenset({"emcee", "lmfit"})
"""Samplers that ask for the log-posterior of one point at a time."""
