"""Samplers that JAX compiles: NumPyro's NUTS, and NUTS put together by hand from blackjax.

What is compiled takes the record as an argument, so that one compilation serves all records of a case.
"""

from __future__ import annotations

from collections.abc import Generator
from functools import cache
from typing import Any

import numpy as np
from benchmark.gradient_posterior import Form, length_for, log_prob, numbers
from benchmark.problems import Problem
from benchmark.progress import GROUPS, Progress, Settings

from sma_bayes.arrays import Floats

TUNING = 400
"""Draws of a chain that NumPyro is tuned with and that are dropped."""
BLOCK = 50
"""Draws of a chain of NumPyro in one call."""
CHAINS = 8
"""Chains of each group of NUTS by hand."""
HAND_BLOCK = 25
"""Steps of NUTS by hand in one call."""
HAND_STEP = 0.6
"""Its leapfrog step in units of the standard deviation, where it is known beforehand."""
HAND_TUNING = 50
"""Steps in which it is found otherwise, all chains together; blackjax and Stan take 1000 of each chain by default."""
ACCEPTED = 0.9
"""Mean acceptance that such tuning aims at. At 0.8, the default of blackjax and Stan, it ends near a step of 0.9, with
which trajectories of a normal density often miss their turn: three times as long."""


def _jax() -> Any:
    import jax

    jax.config.update("jax_enable_x64", True)
    return jax


def _check(problem: Problem) -> None:
    form, data = _given(problem)
    compiled = _compiled(form)
    problem.check(lambda z: float(compiled(z, data)))


def _given(problem: Problem) -> tuple[Form, dict[str, Floats]]:
    return Form.of(problem.posterior), numbers(problem.posterior, length_for(problem.posterior))


@cache
def _compiled(form: Form) -> Any:
    jax = _jax()
    return jax.jit(lambda z, data: log_prob(jax.numpy, jax.lax.erf, form, z, data))


class NumPyro:
    """NumPyro's NUTS as it comes, with a dense mass matrix, its chains vectorised.

    `numpyro.infer.MCMC` compiles anew in every run; its kernel, which this calls, need not.
    """

    title = "NumPyro NUTS, dense mass"
    packages = ("numpyro", "jax")

    def prepare(self, problem: Problem) -> None:
        """See `Sampler.prepare`."""
        _check(problem)
        form, data = _given(problem)
        begin, go = _numpyro(form)
        keys = _jax().random.split(_jax().random.PRNGKey(0), GROUPS)
        go(begin(keys, problem.starts(np.random.default_rng(0), GROUPS, "laplace"), data), data)

    def run(self, problem: Problem, settings: Settings, seed: int) -> Generator[Progress, float, None]:
        jax = _jax()
        form, data = _given(problem)
        begin, go = _numpyro(form)
        z = problem.starts(np.random.default_rng([seed, 7]), GROUPS, "laplace")
        states = begin(jax.random.split(jax.random.PRNGKey(seed), GROUPS), z, data)
        evaluations, tuning = 0, TUNING // BLOCK
        blocks: list[Floats] = []
        wanted = tuning + 1
        while True:
            while len(blocks) < wanted:
                states, positions, counts = go(states, data)
                evaluations += int(counts.sum())
                blocks.append(np.asarray(positions))  # (BLOCK, chains, D)
            z = np.concatenate(blocks[tuning:])
            growth = yield Progress(np.moveaxis(z, 1, 0)[:, :, None], evaluations, (0.0,))
            wanted = tuning + max(wanted - tuning + 1, round((wanted - tuning) * growth))


@cache
def _numpyro(form: Form) -> Any:
    from numpyro.infer.hmc import hmc

    jax = _jax()

    def potential(data: dict[str, Any]) -> Any:
        return lambda z: -log_prob(jax.numpy, jax.lax.erf, form, z, data)

    init, kernel = hmc(potential_fn_gen=potential, algo="NUTS")

    @jax.jit
    def begin(keys: Any, z: Any, data: dict[str, Any]) -> Any:
        return jax.vmap(
            lambda key, x: init(x, TUNING, dense_mass=True, model_args=(data,), rng_key=key)
        )(keys, z)  # fmt: skip

    @jax.jit
    def go(states: Any, data: dict[str, Any]) -> Any:
        def step(now: Any, _: None) -> Any:
            then = jax.vmap(lambda state: kernel(state, (data,)))(now)
            return then, (then.z, then.num_steps)

        states, (positions, counts) = jax.lax.scan(step, states, None, length=BLOCK)
        return states, positions, counts

    return begin, go


class BlackJax:
    """NUTS by hand: many chains side by side in one compiled loop, in coordinates whitened by Laplace's covariance.

    The whitened posterior has unit scale. So the step size is that of a unit normal, `HAND_STEP`, for who knows it
    beforehand; who does not tunes it by dual averaging, in steps that are dropped.
    """

    packages = ("blackjax", "jax")

    def __init__(self, title: str, *, tuned: bool) -> None:
        self.title = title
        self.tuned = tuned

    def prepare(self, problem: Problem) -> None:
        """See `Sampler.prepare`."""
        _check(problem)
        next(self.run(problem, Settings(), 1000))

    def run(self, problem: Problem, settings: Settings, seed: int) -> Generator[Progress, float, None]:
        jax = _jax()
        form, data = _given(problem)
        begin, tune, go = _blackjax(form)
        root = np.linalg.cholesky(problem.mode.covariance)
        centre = problem.mode.z
        chains = GROUPS * CHAINS
        states = begin(
            np.random.default_rng([seed, 7]).standard_normal((chains, centre.size)), centre, root, data
        )
        key = jax.random.PRNGKey(seed)
        blocks: list[Floats] = []
        evaluations, wanted, step_size = 0, 1, HAND_STEP
        if self.tuned:
            key, own = jax.random.split(key)
            states, step_size, counts = tune(own, states, centre, root, data)
            evaluations += int(counts.sum())
        while True:
            while len(blocks) < wanted:
                key, own = jax.random.split(key)
                states, positions, counts = go(own, states, step_size, centre, root, data)
                evaluations += int(counts.sum())
                blocks.append(centre + np.asarray(positions) @ root.T)  # (HAND_BLOCK, chains, D)
            z = np.concatenate(blocks).reshape(len(blocks) * HAND_BLOCK, GROUPS, CHAINS, -1)
            growth = yield Progress(np.moveaxis(z, 1, 0), evaluations, (0.1, 0.25))
            wanted = max(wanted + 1, round(wanted * growth))


@cache
def _blackjax(form: Form) -> Any:
    import blackjax
    from blackjax.adaptation.step_size import dual_averaging_adaptation

    jax = _jax()

    def density(x: Any, centre: Any, root: Any, data: dict[str, Any]) -> Any:
        return log_prob(jax.numpy, jax.lax.erf, form, centre + root @ x, data)

    @jax.jit
    def begin(x: Any, centre: Any, root: Any, data: dict[str, Any]) -> Any:
        return jax.vmap(lambda p: blackjax.nuts.init(p, lambda q: density(q, centre, root, data)))(x)

    kernel = blackjax.nuts.build_kernel()

    def all_chains(
        key: Any, states: Any, step_size: Any, centre: Any, root: Any, data: dict[str, Any]
    ) -> Any:
        unit = jax.numpy.ones(centre.size)

        def target(x: Any) -> Any:
            return density(x, centre, root, data)

        keys = jax.random.split(key, states.position.shape[0])
        return jax.vmap(lambda k, s: kernel(k, s, target, step_size=step_size, inverse_mass_matrix=unit))(
            keys, states
        )

    @jax.jit
    def tune(key: Any, states: Any, centre: Any, root: Any, data: dict[str, Any]) -> Any:
        start, update, final = dual_averaging_adaptation(ACCEPTED)

        def step(now: Any, own: Any) -> Any:
            states, averaging = now
            then, info = all_chains(own, states, jax.numpy.exp(averaging.log_step_size), centre, root, data)
            return (then, update(averaging, info.acceptance_rate.mean())), info.num_integration_steps

        begun = jax.tree.map(jax.numpy.asarray, start(1.0))
        (states, averaging), counts = jax.lax.scan(step, (states, begun), jax.random.split(key, HAND_TUNING))
        return states, final(averaging), counts

    @jax.jit
    def go(key: Any, states: Any, step_size: Any, centre: Any, root: Any, data: dict[str, Any]) -> Any:
        def step(now: Any, own: Any) -> Any:
            then, info = all_chains(own, now, step_size, centre, root, data)
            return then, (then.position, info.num_integration_steps)

        states, (positions, counts) = jax.lax.scan(step, states, jax.random.split(key, HAND_BLOCK))
        return states, positions, counts

    return begin, tune, go
