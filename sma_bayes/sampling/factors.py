"""Sample a product of densities factor by factor, and join the draws.

Coordinates of different factors are independent, so that draws of one may stand beside any draws of another. What is
known of the factors carries over to the product: it has converged where all of them have, and its evidence is the
product of theirs.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from sma_bayes.arrays import Floats, Ints
from sma_bayes.sampling.audit import Audit
from sma_bayes.sampling.convergence import Convergence
from sma_bayes.sampling.density import Density, DensityFactor, Factorisable
from sma_bayes.sampling.ensembles import METHODS, Draws, Plan, Progress, sample
from sma_bayes.sampling.laplace import Mode


def sample_by_factors(
    density: Density,
    starts: Sequence[Floats],
    width: Floats,
    seed: np.random.SeedSequence,
    plan: Plan | None = None,
    *,
    checkpoint: Path | None = None,
    fingerprint: str = "",
    progress: Progress | None = None,
) -> Draws:
    """Sample a density as `sample` does; where it is a product, its factors apart.

    A sampler that was asked for by name samples it as a whole, and so checks the product, too.

    Parameters
    ----------
    density, starts, width, seed, plan, checkpoint, fingerprint, progress
        See `sample`. Each factor has a checkpoint of its own, with the factor's name, and an even share of the
        evaluations and of the steps that explore.

    Returns
    -------
    Draws
        The coordinates in the order of the density. Of factors that took more steps than others as many are kept,
        evenly spaced; diagnostics are of all of them.
    """
    plan = plan or Plan()
    factors = density.factors() if isinstance(density, Factorisable) else ()
    if len(factors) < 2 or plan.sampler.moves is not None:
        return sample(
            density, starts, width, seed, plan,
            checkpoint=checkpoint, fingerprint=fingerprint, progress=progress,
        )  # fmt: skip
    # walkers of fewer coordinates need fewer steps to forget where they were, in proportion
    own_plan = replace(
        plan,
        evaluations=plan.evaluations // len(factors),
        explore_block=max(1, plan.explore_block // len(factors)),
    )
    found = [
        sample(
            factor.density,
            [start[factor.at] for start in starts],
            width[factor.at],
            own_seed,
            own_plan,
            checkpoint=checkpoint and checkpoint.with_stem(f"{checkpoint.stem}-{factor.name}"),
            fingerprint=fingerprint,
            progress=_named(progress, factor.name),
        )
        for factor, own_seed in zip(factors, seed.spawn(len(factors)), strict=True)
    ]
    return _joined(factors, found)


def _named(progress: Progress | None, name: str) -> Progress | None:
    return progress and (lambda message: progress(f"{name}: {message}"))


def _joined(factors: Sequence[DensityFactor], found: Sequence[Draws]) -> Draws:
    """Draws of a product from those of its factors."""
    at = [factor.at for factor in factors]
    # walkers of more coordinates may be more
    walkers = min(d.z.shape[2] for d in found)
    steps = min(d.z.shape[1] for d in found)
    kept = [np.linspace(0, d.z.shape[1] - 1, steps).round().astype(int) for d in found]
    z = [d.z[:, k, :walkers] for d, k in zip(found, kept, strict=True)]
    log_prob = np.sum([d.log_prob[:, k, :walkers] for d, k in zip(found, kept, strict=True)], axis=0)
    convergence = [d.convergence for d in found]
    audits = [d.audit for d in found if d.audit is not None]
    return Draws(
        z=_side_by_side(at, z),
        log_prob=log_prob,
        convergence=Convergence(
            _side_by_side(at, [c.rhat for c in convergence]),
            _side_by_side(at, [c.ess_bulk for c in convergence]),
            _side_by_side(at, [c.ess_tail for c in convergence]),
            all(c.converged for c in convergence),
            _side_by_side(at, [c.quantile_error for c in convergence]),
            _side_by_side(at, [c.sd_error for c in convergence]),
        ),
        acceptance=float(np.mean([d.acceptance for d in found])),
        evaluations=sum(d.evaluations for d in found),
        method=max((d.method for d in found), key=METHODS.index),
        modes=tuple(_joined_mode(at, modes) for modes in itertools.product(*(d.modes for d in found))),
        efficiency=float(np.fmin.reduce([d.efficiency for d in found])),
        greatest_weight=float(np.fmax.reduce([d.greatest_weight for d in found])),
        ln_evidence=sum(d.ln_evidence for d in found),
        ln_evidence_sd=math.hypot(*(d.ln_evidence_sd for d in found)),
        audit=_joined_audit(audits) if len(audits) == len(found) else None,
    )


def _side_by_side(at: Sequence[Ints], parts: Sequence[Floats]) -> Floats:
    """Arrays (..., D_i), joined along the last axis at positions each."""
    out = np.empty((*parts[0].shape[:-1], sum(p.shape[-1] for p in parts)))
    for where, part in zip(at, parts, strict=True):
        out[..., where] = part
    return out


def _joined_mode(at: Sequence[Ints], modes: Sequence[Mode]) -> Mode:
    """The mode of a product at modes of its factors."""
    z = _side_by_side(at, [m.z for m in modes])
    covariance = np.zeros((z.size, z.size))
    for where, mode in zip(at, modes, strict=True):
        covariance[np.ix_(where, where)] = mode.covariance
    return Mode(z, sum(m.log_prob for m in modes), covariance, sum(m.evaluations for m in modes))


def _joined_audit(audits: Sequence[Audit]) -> Audit:
    """What audits of the factors say of the product: a share outside of any of them is outside."""
    return Audit(
        pareto_k=max(a.pareto_k for a in audits),
        outside=sum(a.outside for a in audits),
        outside_sd=math.hypot(*(a.outside_sd for a in audits)),
        greatest_met=max(a.greatest_met for a in audits),
        passed=all(a.passed for a in audits),
    )
