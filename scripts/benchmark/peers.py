"""Samplers of other packages, beside emcee and lmfit: gradients, slices, nested sampling.

Gradient samplers get chains that start from the Laplace approximation and a compilation that serves all records of
a case. Each target is compared with the package's own log-posterior before it is sampled.
"""

from __future__ import annotations

import tempfile
from abc import ABC, abstractmethod
from collections.abc import Callable, Generator
from functools import cache
from typing import Any

import numpy as np
from benchmark.gradient_posterior import Form, log_prob, numbers
from benchmark.problems import Problem
from benchmark.progress import GROUPS, Progress, Settings

from sma_bayes.quantities import Floats

CHAINS = 8
"""Chains of each group of samplers that run many side by side."""
BLOCK = 100
"""Draws of a chain between checks."""
TUNING = 400
"""Draws of a chain that NUTS is tuned with and that are dropped."""
LIVE_POINTS = 150
"""Live points of each nested-sampling run at first; doubled until the target is reached."""


def length_for(problem: Problem) -> int:
    """Samples that arrays are filled up to: the same for all records of a campaign."""
    return max(128, problem.posterior.n)


def check(problem: Problem, density: Callable[[Floats], float]) -> None:
    """Compare log-densities at random points about the mode: differences must agree to 1e-8.

    Raises
    ------
    ValueError
        If they don't.
    """
    z = problem.starts(np.random.default_rng(1), 20, "laplace")
    difference = np.array([float(density(x)) for x in z]) - problem.posterior.log_prob(z)
    scale = max(1.0, float(np.max(np.abs(problem.posterior.log_prob(z)))))
    if not np.ptp(difference) <= 1e-8 * scale:
        raise ValueError(
            f"{problem.posterior.records[0].key}: another target, off by {np.ptp(difference):.3g}"
        )


def _jax() -> Any:
    import jax

    jax.config.update("jax_enable_x64", True)
    if jax.config.jax_compilation_cache_dir is None:  # what is compiled for one run serves the next
        jax.config.update("jax_compilation_cache_dir", tempfile.mkdtemp())
        jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
        jax.config.update("jax_persistent_cache_min_entry_size_bytes", -1)
    return jax


def _same_target_in_jax(problem: Problem) -> None:
    form, data = Form.of(problem.posterior), numbers(problem.posterior, length_for(problem))
    compiled = _compiled(form)
    check(problem, lambda z: float(compiled(z, data)))


class NumPyro:
    """NumPyro's NUTS with a dense mass matrix, its chains vectorised."""

    check = staticmethod(_same_target_in_jax)

    title = "NumPyro NUTS, dense mass"
    packages = ("numpyro", "jax")

    def run(self, problem: Problem, settings: Settings, seed: int) -> Generator[Progress, float, None]:
        jax = _jax()
        form, data = Form.of(problem.posterior), numbers(problem.posterior, length_for(problem))
        mcmc = _numpyro(form)
        z = problem.starts(np.random.default_rng([seed, 7]), GROUPS, "laplace")
        key = jax.random.PRNGKey(seed)
        wanted = ("num_steps",)
        mcmc.post_warmup_state = None
        mcmc.warmup(
            key, data, init_params={"z": jax.numpy.asarray(z)}, extra_fields=wanted, collect_warmup=True
        )
        evaluations = int(np.sum(mcmc.get_extra_fields()["num_steps"]))
        chains: list[Floats] = []
        while True:
            mcmc.post_warmup_state = mcmc.last_state
            mcmc.run(mcmc.last_state.rng_key, data, extra_fields=wanted)
            chains.append(np.asarray(mcmc.get_samples(group_by_chain=True)["z"]))
            evaluations += int(np.sum(mcmc.get_extra_fields()["num_steps"]))
            yield Progress(np.concatenate(chains, axis=1)[:, :, None], evaluations, (0.0,))


@cache
def _numpyro(form: Form) -> Any:
    import numpyro
    from numpyro.distributions import ImproperUniform, constraints
    from numpyro.infer import MCMC, NUTS

    jax = _jax()

    def model(data: dict[str, Any]) -> None:
        z = numpyro.sample("z", ImproperUniform(constraints.real, (), (len(form.names),)))
        numpyro.factor("log_prob", log_prob(jax.numpy, form, z, data))

    kernel = NUTS(model, dense_mass=True)
    return MCMC(
        kernel, num_warmup=TUNING, num_samples=250, num_chains=GROUPS, chain_method="vectorized",
        progress_bar=False, jit_model_args=True,
    )  # fmt: skip


@cache
def _compiled(form: Form) -> Any:
    jax = _jax()
    return jax.jit(lambda z, data: log_prob(jax.numpy, form, z, data))


class BlackJax:
    """NUTS by hand: many chains side by side in one compiled loop, in coordinates whitened by Laplace's covariance.

    No tuning: the whitened posterior has unit scale, and the step size is that of a unit normal.
    """

    check = staticmethod(_same_target_in_jax)
    title = "blackjax NUTS, by hand: whitened, vectorised"
    packages = ("blackjax", "jax")

    def run(self, problem: Problem, settings: Settings, seed: int) -> Generator[Progress, float, None]:
        jax = _jax()
        form, data = Form.of(problem.posterior), numbers(problem.posterior, length_for(problem))
        begin, go = _blackjax(form)
        root = np.linalg.cholesky(problem.mode.covariance)
        centre = problem.mode.z
        chains = GROUPS * CHAINS
        states = begin(
            np.random.default_rng([seed, 7]).standard_normal((chains, centre.size)), centre, root, data
        )
        key = jax.random.PRNGKey(seed)
        drawn: list[Floats] = []
        evaluations = 0
        while True:
            key, own = jax.random.split(key)
            states, positions, counts = go(own, states, centre, root, data)
            evaluations += int(counts.sum())
            drawn.append(centre + np.asarray(positions) @ root.T)  # (BLOCK, chains, D)
            z = np.concatenate(drawn)
            yield Progress(np.moveaxis(z.reshape(len(z), GROUPS, CHAINS, -1), 1, 0), evaluations, (0.1, 0.25))


HAND_STEP = 0.6
"""Leapfrog step in units of the standard deviation; not tuned."""


@cache
def _blackjax(form: Form) -> Any:
    import blackjax

    jax = _jax()

    def density(x: Any, centre: Any, root: Any, data: dict[str, Any]) -> Any:
        return log_prob(jax.numpy, form, centre + root @ x, data)

    @jax.jit
    def begin(x: Any, centre: Any, root: Any, data: dict[str, Any]) -> Any:
        return jax.vmap(lambda p: blackjax.nuts.init(p, lambda q: density(q, centre, root, data)))(x)

    @jax.jit
    def go(key: Any, states: Any, centre: Any, root: Any, data: dict[str, Any]) -> Any:
        kernel = blackjax.nuts.build_kernel()
        unit = jax.numpy.ones(centre.size)

        def target(x: Any) -> Any:
            return density(x, centre, root, data)

        def step(now: Any, own: Any) -> Any:
            keys = jax.random.split(own, now.position.shape[0])
            then, info = jax.vmap(
                lambda k, s: kernel(k, s, target, step_size=HAND_STEP, inverse_mass_matrix=unit)
            )(keys, now)
            return then, (then.position, info.num_integration_steps)

        states, (positions, counts) = jax.lax.scan(step, states, jax.random.split(key, HAND_BLOCK))
        return states, positions, counts

    return begin, go


HAND_BLOCK = 25
"""Steps between checks."""


class _PyMC:
    """A PyMC model of the same density: flat coordinates with a potential, data shared."""

    packages = ("pymc", "pytensor")

    def model(self, problem: Problem) -> Any:
        form, data = Form.of(problem.posterior), numbers(problem.posterior, length_for(problem))
        model = _pymc(form, length_for(problem), len(form.names))
        for name, values in data.items():
            model.set_data(name, values)
        return model

    def check(self, problem: Problem) -> None:
        """See `check`."""
        form = Form.of(problem.posterior)
        self.model(problem)
        logp = _pymc_density(form, length_for(problem), len(form.names))
        check(problem, lambda z: float(logp({"z": z})))


@cache
def _pymc(form: Form, length: int, dimension: int) -> Any:
    import pymc
    import pytensor.tensor as pt

    last = ("last",) if form.remembers else ()
    shapes = dict.fromkeys(("temperature", "weight", *last, *form.channels), length)
    shapes |= dict.fromkeys(("first_of_prior", "second_of_prior", "sign"), dimension)
    with pymc.Model() as model:
        data = {name: pymc.Data(name, np.ones(size)) for name, size in shapes.items()}
        z = pymc.Flat("z", shape=dimension)
        pymc.Potential("log_prob", log_prob(pt, form, z, data))
    return model


@cache
def _pymc_density(form: Form, length: int, dimension: int) -> Any:
    return _pymc(form, length, dimension).compile_logp()


class PyMC(_PyMC):
    """PyMC's own NUTS, chains one after the other."""

    title = "PyMC NUTS"

    def run(self, problem: Problem, settings: Settings, seed: int) -> Generator[Progress, float, None]:
        import pymc

        draws, tune = 500, 1000
        z = problem.starts(np.random.default_rng([seed, 7]), GROUPS, "laplace")
        with self.model(problem):
            while True:
                found = pymc.sample(
                    draws, tune=tune, chains=GROUPS, cores=1, initvals=[{"z": x} for x in z],
                    random_seed=seed + 1, progressbar=False, compute_convergence_checks=False,
                )  # fmt: skip
                steps = int(found.sample_stats["n_steps"].sum()) * (draws + tune) // draws
                growth = yield Progress(found.posterior["z"].values[:, :, None], steps, (0.0,))
                draws = round(draws * max(growth, 1.5))


class Nutpie(_PyMC):
    """nutpie on the PyMC model, compiled by numba once for all records of a case."""

    title = "nutpie"
    packages = ("nutpie", "pymc", "numba")

    def run(self, problem: Problem, settings: Settings, seed: int) -> Generator[Progress, float, None]:
        import nutpie

        form, data = Form.of(problem.posterior), numbers(problem.posterior, length_for(problem))
        compiled = _nutpie(form, length_for(problem), len(form.names)).with_data(**data)
        draws, tune = 500, 300
        while True:
            found = nutpie.sample(
                compiled, draws=draws, tune=tune, chains=GROUPS, cores=1, seed=seed + 1, progress_bar=False
            )
            steps = int(found.sample_stats["n_steps"].sum()) * (draws + tune) // draws
            growth = yield Progress(found.posterior["z"].values[:, :, None], steps, (0.0,))
            draws = round(draws * max(growth, 1.5))


@cache
def _nutpie(form: Form, length: int, dimension: int) -> Any:
    import nutpie

    return nutpie.compile_pymc_model(_pymc(form, length, dimension))


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
        steps = BLOCK
        while True:
            for i, sampler in enumerate(samplers):
                sampler.run_mcmc(starts[i], steps, progress=False)
                starts[i] = sampler.get_last_sample()
            chains = np.stack([s.get_chain() for s in samplers])
            growth = yield Progress(chains, evaluations)
            steps = max(10, round(chains.shape[1] * (growth - 1.0)))


class _Nested(ABC):
    """Nested sampling: runs that share nothing, with more live points until the target is reached."""

    def check(self, problem: Problem) -> None:
        """See `check`: the log-likelihood with the log-prior that the quantiles stand for."""
        _, log_likelihood = _cube(problem)
        check(problem, lambda z: float(log_likelihood(z)[0] + problem.posterior.log_prior(z)))

    @abstractmethod
    def one(self, problem: Problem, live: int, seed: int) -> tuple[Floats, Floats, int]:
        """Points (S, D), log weights and evaluations of a run."""

    def run(self, problem: Problem, settings: Settings, seed: int) -> Generator[Progress, float, None]:
        live, evaluations = LIVE_POINTS, 0
        while True:
            found = [self.one(problem, live, 10_000 * seed + live + g) for g in range(GROUPS)]
            rng = np.random.default_rng([seed, 7])
            drawn = []
            for z, log_weight, spent in found:
                weight = np.exp(log_weight - log_weight.max())
                weight /= weight.sum()
                size = int(1.0 / np.sum(weight**2))  # as many equal draws as the weights are worth
                at = (np.arange(size) + rng.random()) / size
                pick = np.searchsorted(np.cumsum(weight), at).clip(max=len(z) - 1)
                drawn.append(z[rng.permutation(pick)])
                evaluations += spent
            least = min(map(len, drawn))
            yield Progress(np.stack([z[:least] for z in drawn])[:, :, None], evaluations, (0.0,))
            live *= 2


def _cube(problem: Problem) -> tuple[Callable[[Floats], Floats], Callable[[Floats], Floats]]:
    """Map of the unit cube (S, D) by the quantiles of the priors, and the log-likelihood (S,) of its points."""
    posterior = problem.posterior
    priors = [p.prior for p in posterior.space.free]

    def transform(u: Floats) -> Floats:
        u = np.clip(np.atleast_2d(u), 1e-300, 1.0 - 1e-16)
        return np.stack([p.transform.to_sampled(p.quantile(u[:, i])) for i, p in enumerate(priors)], axis=1)

    def log_likelihood(z: Floats) -> Floats:
        return np.maximum(posterior.log_likelihood(posterior.space.to_physical(np.atleast_2d(z))), -1e300)

    return transform, log_likelihood


class Dynesty(_Nested):
    """dynesty with random slices; its log-likelihood is written out for one point."""

    title = "dynesty, rslice"
    packages = ("dynesty",)

    def one(self, problem: Problem, live: int, seed: int) -> tuple[Floats, Floats, int]:
        import dynesty

        transform, _ = _cube(problem)
        written, log_prior = problem.float_posterior, problem.posterior.log_prior

        def log_likelihood(z: Floats) -> float:
            return max(written(z) - float(log_prior(z)), -1e300)

        sampler = dynesty.NestedSampler(
            log_likelihood, lambda u: transform(u)[0], problem.dimension, nlive=live, sample="rslice",
            rstate=np.random.default_rng(seed),
        )  # fmt: skip
        sampler.run_nested(print_progress=False, dlogz=0.01)
        r = sampler.results
        return np.asarray(r.samples), np.asarray(r.logwt), int(np.sum(r.ncall))


class UltraNest(_Nested):
    """ultranest's reactive sampler with slices, vectorised; its regions alone don't come to an end here."""

    title = "ultranest, slices"
    packages = ("ultranest",)

    def one(self, problem: Problem, live: int, seed: int) -> tuple[Floats, Floats, int]:
        import logging

        import ultranest
        from ultranest.stepsampler import SliceSampler, generate_mixture_random_direction

        logging.getLogger("ultranest").setLevel(logging.ERROR)
        np.random.seed(seed)  # noqa: NPY002 - ultranest draws from numpy's global state
        transform, log_likelihood = _cube(problem)
        sampler = ultranest.ReactiveNestedSampler(
            list(problem.posterior.names), log_likelihood, transform, vectorized=True
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
