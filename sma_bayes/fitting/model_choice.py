"""Choose among response models that contain the published curve: each step up must be earned.

A richer curve is taken where its evidence is greater and it predicts better what was held out, of one record or of all
records of a study together, whose evidences add up. Evidence is found by
Laplace's method at the mode of the whole posterior, what stands beside the curve included
(`sma_bayes.fitting.noise_choice`), so that a curve need not be richer than what a discrepancy leaves to it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from sma_bayes.arrays import Floats
from sma_bayes.errors import nats
from sma_bayes.fitting.noise_choice import NoiseChoice, choose_noise, noise_start, posterior_with
from sma_bayes.fitting.posterior import Posterior, build_posterior
from sma_bayes.fitting.warm_start import WarmStart, warm_start
from sma_bayes.noise import NOISE_MODELS
from sma_bayes.parameters.priors_file import PriorSet
from sma_bayes.records.types import Record
from sma_bayes.response.base import ResponseModel
from sma_bayes.sampling.laplace import find_mode

LEAST_LN_EVIDENCE_GAIN = 3.0
"""What a richer curve must gain in ln evidence: odds of 20 to 1."""
FOLDS, BLOCKS = 4, 24
"""Folds of held-out samples, and stretches of temperature that are dealt out to them in turn."""


@dataclass(frozen=True, slots=True, eq=False)
class Prepared:
    """A response model with its least-squares start and what stands beside it.

    Attributes
    ----------
    posterior : Posterior
        With independent noise, for what depends on records, model and priors alone.
    priors : PriorSet
    start : WarmStart
    noise : NoiseChoice or None
        None where the noise is no density of the data.
    """

    posterior: Posterior
    priors: PriorSet
    start: WarmStart
    noise: NoiseChoice | None


@dataclass(frozen=True, slots=True)
class Support:
    """What records that share parameters say of each model of a ladder, the simplest first.

    Attributes
    ----------
    ln_evidence : mapping of str to float
        Minus infinity where there is none.
    held_out : mapping of str to float
        See `held_out`.
    """

    ln_evidence: Mapping[str, float]
    held_out: Mapping[str, float]


@dataclass(frozen=True, slots=True)
class ModelChoice:
    """A response model and why it was taken.

    Attributes
    ----------
    name : str
    reason : str
        One sentence for people.
    ln_evidence : mapping of str to float
        Of each model that was looked at, less that of the chosen one.
    held_out : mapping of str to float
        Root mean square of what each model's least-squares curve misses of samples held out, as a share of the range of
        the channel; the mean over channels and records.
    """

    name: str
    reason: str
    ln_evidence: Mapping[str, float]
    held_out: Mapping[str, float]


def prepare(
    records: Sequence[Record],
    model: ResponseModel | None,
    priors: PriorSet,
    rng: np.random.Generator,
    *,
    noise: str | None = None,
    discrepancy: bool = True,
) -> Prepared:
    """Start a response model by least squares, and choose what stands beside it.

    Parameters
    ----------
    records : sequence of Record
        That share the model's parameters.
    model : ResponseModel, optional
        By default the modified sigmoid that predicts the observed channels.
    priors : PriorSet
    rng : numpy.random.Generator
        For the starting points.
    noise : str, optional
        The only noise model to consider.
    discrepancy : bool
        Whether discrepancies are considered.
    """
    posterior = build_posterior(records, NOISE_MODELS["independent"], priors, model=model)
    start = warm_start(posterior, rng)
    choice = None
    if noise is None or NOISE_MODELS[noise].is_density:
        choice = choose_noise(
            posterior, start, priors, noise=noise, discrepancy=discrepancy, sweeps=discrepancy
        )
    return Prepared(posterior, priors, start, choice)


def log_evidence(prepared: Prepared) -> float:
    """Log evidence of a prepared model, by Laplace's method; minus infinity where there is none.

    A discrepancy that is taken although the evidence is a little against it does not count against the model: the
    curve alone has that much more.
    """
    choice = prepared.noise
    if choice is None:
        return -np.inf
    posterior = posterior_with(choice.name, prepared.posterior, prepared.start, prepared.priors, choice)
    mode = find_mode(posterior, noise_start(posterior, prepared.start, choice), posterior.space.prior_sd())
    if mode is None:
        return -np.inf
    gained = sum(choice.discrepancy[c] for c in {c for bases in choice.bases for c in bases})
    return mode.ln_integral - min(gained, 0.0)


def support_of(prepared: Sequence[Prepared]) -> Support:
    """What the records of prepared models, the simplest first, say of each."""
    names = [p.posterior.model.name for p in prepared]
    return Support(
        dict(zip(names, map(log_evidence, prepared), strict=True)),
        dict(zip(names, map(held_out, prepared), strict=True)),
    )


def best_supported(support: Sequence[Support]) -> ModelChoice:
    """Choose one model for all records.

    A model takes the place of the one chosen so far if its evidence is greater by `LEAST_LN_EVIDENCE_GAIN` and its
    least-squares curve misses less of what is held out (stretches of temperature, each fold fitted without them).
    Evidences are added up, what is missed is averaged. Models that can't be fitted to all records are left out.

    Parameters
    ----------
    support : sequence of Support
        One for each set of records that share parameters.
    """
    names = [n for n in support[0].ln_evidence if all(n in s.ln_evidence for s in support)]
    evidence = {n: float(sum(s.ln_evidence[n] for s in support)) for n in names}
    missed = {n: float(np.mean([s.held_out[n] for s in support])) for n in names}
    best = names[0]
    for name in names[1:]:
        if evidence[name] > evidence[best] + LEAST_LN_EVIDENCE_GAIN and missed[name] < missed[best]:
            best = name
    top = evidence[best] if np.isfinite(evidence[best]) else 0.0
    relative = {n: e - top for n, e in evidence.items()}
    return ModelChoice(best, _reason(best, relative, missed, len(support)), relative, missed)


def _reason(best: str, relative: Mapping[str, float], missed: Mapping[str, float], count: int) -> str:
    together = f" of all {count} together" if count > 1 else ""
    rivals = sorted(((v, n) for n, v in relative.items() if n != best and np.isfinite(v)), reverse=True)
    if not rivals:
        return f"{best}: no other model of the ladder can be fitted to these channels"
    value, second = rivals[0]
    more = "less" if value <= 0 else "more, but it does not predict better or is too close to prefer it"
    return (
        f"{best}: {second} has an ln evidence{together} {nats(abs(value))} {more}; of what is held out their "
        f"least-squares curves miss {missed[best]:.2%} and {missed[second]:.2%} of the range"
    )


def held_out(prepared: Prepared) -> float:
    """What the least-squares curve misses of samples held out, mean over channels and records [share of the range]."""
    posterior, start = prepared.posterior, prepared.start
    space, free = posterior.space, posterior.sampled_model
    if not free.size:
        return float(np.mean([np.mean(np.abs(r[c])) for r in start.residual for c in r]))
    centre = space.unconstrain(_with_model(posterior, start.theta))
    width = space.prior_sd()[: free.size]
    folds = [_folds(r.temperature) for r in posterior.records]
    squares = [{c: np.zeros(r.n) for c in r.channels} for r in posterior.records]
    for fold in range(FOLDS):
        z = _refitted(posterior, centre, width, [f != fold for f in folds])
        theta = space.constrain(z)[: start.theta.size]
        for i, record in enumerate(posterior.records):
            with np.errstate(all="ignore"):
                curve = posterior.model.predict(theta, record.inputs)
            left = folds[i] == fold
            for channel in record.channels:
                squares[i][channel][left] = (record.observed[channel] - curve[channel])[left] ** 2
    shares = [
        np.sqrt(np.mean(s)) / posterior.observed_range(i, c)[1]
        for i, own in enumerate(squares)
        for c, s in own.items()
    ]
    return float(np.mean(shares))


def _with_model(posterior: Posterior, theta: Floats) -> Floats:
    """All parameters (P,): those of the model as given, the others at the centre of their priors."""
    whole = posterior.space.constrain(posterior.space.prior_centre())
    whole[: theta.size] = theta
    return whole


def _folds(temperature: Floats) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    """Fold of each sample: stretches of temperature dealt out in turn."""
    rank = np.argsort(np.argsort(temperature, kind="stable"), kind="stable")
    blocks = min(BLOCKS, temperature.size)
    return np.asarray(rank * blocks // temperature.size % FOLDS, dtype=np.int64)


def _refitted(
    posterior: Posterior,
    centre: Floats,
    width: Floats,
    kept: Sequence[np.ndarray[tuple[int], np.dtype[np.bool_]]],
) -> Floats:
    """Least-squares optimum (D,) of some samples near a known one; priors hold what they leave free."""
    space, model, m = posterior.space, posterior.model, width.size
    free, size = posterior.sampled_model, len(posterior.model.parameter_names)
    scale = [
        {c: posterior.observed_range(i, c)[1] for c in r.channels} for i, r in enumerate(posterior.records)
    ]
    hold = 1e-3 / width

    def full(x: Floats) -> Floats:
        z = centre.copy()
        z[:m] = x
        return z

    def residual(x: Floats) -> Floats:
        theta = space.constrain(full(x))[:size]
        parts = [hold * (x - centre[:m])]
        for i, record in enumerate(posterior.records):
            with np.errstate(all="ignore"):
                curve = model.predict(theta, record.inputs)
            parts += [((curve[c] - record.observed[c]) / scale[i][c])[kept[i]] for c in record.channels]
        return np.nan_to_num(np.clip(np.concatenate(parts), -1e30, 1e30))

    def jacobian(x: Floats) -> Floats:
        z = full(x)
        theta, chain = space.constrain(z)[:size], space.derivative(z)[:m]
        parts = [np.diag(hold)]
        for i, record in enumerate(posterior.records):
            with np.errstate(all="ignore"):
                slopes = model.jacobian(theta, record.inputs)
            parts += [(slopes[c][:, free] * chain / scale[i][c])[kept[i]] for c in record.channels]
        return np.nan_to_num(np.clip(np.concatenate(parts), -1e30, 1e30))

    found = least_squares(residual, centre[:m], jac=jacobian, x_scale=width, max_nfev=30)
    return full(np.asarray(found.x, dtype=float))
