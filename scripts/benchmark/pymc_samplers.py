"""Samplers of a PyMC model: PyMC's own NUTS, and nutpie.

The record is the model's data, so that one compilation serves all records of a case.
"""

from __future__ import annotations

import logging
from collections.abc import Generator
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
from benchmark.gradient_posterior import Form, length_for, log_prob, numbers
from benchmark.problems import Problem
from benchmark.progress import GROUPS, Progress, Settings

from sma_bayes.arrays import Floats


class PyMC:
    """PyMC's own NUTS with a diagonal mass matrix, chains one after the other; its gradient is compiled once."""

    title = "PyMC NUTS"
    packages = ("pymc", "pytensor")

    def prepare(self, problem: Problem) -> None:
        """See `Sampler.prepare`."""
        _check(problem)
        _gradient(*_shape(problem))

    def run(self, problem: Problem, settings: Settings, seed: int) -> Generator[Progress, float, None]:
        import pymc
        from pymc.step_methods.hmc.quadpotential import QuadPotentialDiagAdapt

        logging.getLogger("pymc").setLevel(logging.ERROR)
        draws, tune = 500, 1000
        z = problem.starts(np.random.default_rng([seed, 7]), GROUPS, "laplace")
        dimension = z.shape[1]
        with _with_data(problem) as model:
            while True:
                # what `pymc.sample` does for "adapt_diag", but for compiling the gradient each time
                mass = QuadPotentialDiagAdapt(dimension, z.mean(axis=0), np.ones(dimension), 10, rng=seed + 1)
                step = pymc.NUTS(model=model, potential=mass, logp_dlogp_func=_gradient(*_shape(problem)))
                found = pymc.sample(
                    draws, tune=tune, chains=GROUPS, cores=1, initvals=[{"z": x} for x in z], step=step,
                    random_seed=seed + 1, progressbar=False, compute_convergence_checks=False,
                )  # fmt: skip
                growth = yield _progress(found, draws, tune)
                draws = round(draws * max(growth, 1.5))


class Nutpie:
    """nutpie on the PyMC model, compiled by numba once for all records of a case."""

    title = "nutpie"
    packages = ("nutpie", "pymc", "numba")

    def prepare(self, problem: Problem) -> None:
        """See `Sampler.prepare`."""
        _check(problem)
        _nutpie(*_shape(problem))

    def run(self, problem: Problem, settings: Settings, seed: int) -> Generator[Progress, float, None]:
        import nutpie

        def start(of_chain: int) -> Floats:
            # left to itself it would start within 1 of zero in every coordinate, wherever the posterior is
            return np.asarray(problem.starts(np.random.default_rng([seed, of_chain]), 1, "laplace")[0])

        data = numbers(problem.posterior, length_for(problem.posterior))
        compiled = replace(_nutpie(*_shape(problem)).with_data(**data), initial_point_func=start)
        draws, tune = 500, 300
        while True:
            found = nutpie.sample(
                compiled, draws=draws, tune=tune, chains=GROUPS, cores=1, seed=seed + 1, progress_bar=False
            )
            growth = yield _progress(found, draws, tune)
            draws = round(draws * max(growth, 1.5))


def _progress(found: Any, draws: int, tune: int) -> Progress:
    steps = int(found.sample_stats["n_steps"].sum()) * (draws + tune) // draws
    return Progress(found.posterior["z"].values[:, :, None], steps, (0.0,), anew=True)


def _check(problem: Problem) -> None:
    _with_data(problem)
    logp = _density(*_shape(problem))
    problem.check(lambda z: float(logp({"z": z})))


def _shape(problem: Problem) -> tuple[Form, int]:
    """What is compiled depends on this only."""
    return Form.of(problem.posterior), length_for(problem.posterior)


def _with_data(problem: Problem) -> Any:
    """The model, with the numbers of a record for data."""
    model = _model(*_shape(problem))
    for name, values in numbers(problem.posterior, length_for(problem.posterior)).items():
        model.set_data(name, values)
    return model


@cache
def _model(form: Form, length: int) -> Any:
    """A PyMC model of the same density: flat coordinates with a potential."""
    import pymc
    import pytensor.tensor as pt

    last = ("last",) if form.autocorrelated else ()
    dimension = len(form.names)
    shapes = dict.fromkeys(("temperature", "weight", *last, *form.channels), length)
    shapes |= dict.fromkeys(("first_of_prior", "second_of_prior", "sign"), dimension)
    with pymc.Model() as model:
        data = {name: pymc.Data(name, np.ones(size)) for name, size in shapes.items()}
        z = pymc.Flat("z", shape=dimension)
        pymc.Potential("log_prob", log_prob(pt, pt.erf, form, z, data))
    return model


@cache
def _density(form: Form, length: int) -> Any:
    return _model(form, length).compile_logp()


@cache
def _gradient(form: Form, length: int) -> Any:
    gradient = _model(form, length).logp_dlogp_function(ravel_inputs=True)
    gradient.trust_input = True
    return gradient


@cache
def _nutpie(form: Form, length: int) -> Any:
    import nutpie

    return nutpie.compile_pymc_model(_model(form, length))
