"""Whether sweeps of a record are alike: each is predicted from the others, and its place in that looked at.

Draws of the posterior are weighted by one over the likelihood of the sweep that is left out (PSIS); where the weights
can't be relied on the others are fitted again. What is looked at is the part of the sweep along the tangents of its
curve, in which parameters of its own would show. Its innovations there, ``d``, are predicted with mean nought and
covariance ``1 + C``, the noise and what the others leave open of the curve, what a sweep has of its own by chance
(`sma_bayes.fitting.discrepancy`) included, so that

    d' (1 + C)^-1 d / r

has an F distribution with ``r``, the number of tangents, and as many degrees of freedom as tell the noise. The noise is
that of the median draw, since the distribution says how well it is known: draws of the noise would count that in ``C``
once more, and a memory, which a sweep tells little of, made distances a fifth too small. The place in the distribution,
the probability integral transform, is uniform where all sweeps have the same curve and noise, as far as the posterior
is normal along the tangents.

References
----------
A. Vehtari, A. Gelman, J. Gabry, Statistics and Computing 27 (2017) 1413 (weights), and A. P. Dawid, J. R. Stat. Soc. A
147 (1984) 278 (predictions judged by their place in what was predicted).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from pydantic import Field
from scipy.special import fdtr, fdtrc, fdtri, logsumexp

from sma_bayes.arrays import Floats, Ints
from sma_bayes.assess.checks import Check
from sma_bayes.assess.held_out import evaluated_on, missed_by, of_samples, part
from sma_bayes.document_part import DocumentPart, NumberOrNull
from sma_bayes.fitting.fit import Fit, kept
from sma_bayes.fitting.mean_sweep import of_all_sweeps, of_measured_sweeps
from sma_bayes.fitting.posterior import Posterior, Weights
from sma_bayes.records.types import Record
from sma_bayes.sampling.pareto import MAX_RELIABLE_K, smoothed_weights

if TYPE_CHECKING:
    from sma_bayes.sampling.importance import WeightedDraws

FEWEST_SWEEPS = 3
MAX_REFITS = 4
"""Fits made anew for one record, at most: of the sweeps that the draws can be relied on least without."""
NEGLIGIBLE_WEIGHT = 1e-12
"""Share of all weight from which a draw counts: one that is far out has none, and need not have a finite response."""
STATISTIC = "left_out_sweeps"
MEANING = (
    "greatest distance of a sweep from what the others predict, along what parameters of its own would do"
)


class LeftOutSweep(DocumentPart):
    """A sweep, predicted from the others."""

    sweep: int = Field(description="its number, from 1")
    channel: str = Field(description="whose samples")
    distance: NumberOrNull = Field(
        description="squared distance of the sweep from its prediction, along the tangents of the curve and over "
        "`r`; about 1 where it is like the others, null where it can't be told [1]",
    )
    pit: NumberOrNull = Field(
        description="probability integral transform: share of such distances that are smaller, uniform where the "
        "sweep is like the others; null where it can't be told [1]",
    )
    r: int = Field(description="degrees of freedom of the numerator of their F distribution")
    spare: int = Field(description="degrees of freedom of its denominator")
    pareto_k: NumberOrNull = Field(description="Pareto k of the weights of the draws [1]")
    refitted: bool = Field(description="whether the others were fitted again")


@dataclass(frozen=True, slots=True, eq=False)
class _Drawn:
    """Draws that know nothing of a sweep.

    Attributes
    ----------
    innovations : mapping of str to ndarray, shape (S, n)
        Of the whole record, by channel.
    theta : ndarray, shape (S, P)
    log_weight : ndarray, shape (S,)
    """

    innovations: Mapping[str, Floats]
    theta: Floats
    log_weight: Floats

    def root_mean_square(self, position: int) -> float:
        """Of one of the parameters."""
        w = np.exp(self.log_weight - logsumexp(self.log_weight))
        return float(np.sqrt(w @ self.theta[:, position] ** 2))


def samples_of_sweeps(record: Record) -> list[Ints]:
    """Positions of the samples of each sweep, in order."""
    number = record.inputs.get("segment", np.zeros(record.n))
    return [np.flatnonzero(number == s) for s in np.unique(number)]


def weights_without(
    readings: Mapping[str, Floats], sweeps: Sequence[Ints], refits: int
) -> tuple[Floats, Floats, set[int]]:
    """Weights of draws without each sweep, by one over its likelihood.

    Parameters
    ----------
    readings : mapping of str to ndarray, shape (S, n)
        Log density of each reading, by channel.
    sweeps : sequence of ndarray
        As `samples_of_sweeps` gives them.
    refits : int
        Of how many sweeps the others may be fitted anew.

    Returns
    -------
    log_weight : ndarray, shape (S, sweeps)
        Smoothed by Pareto's distribution.
    pareto_k : ndarray, shape (sweeps,)
    anew : set of int
        The sweeps without which the draws can be relied on least.
    """
    each = np.sum(list(readings.values()), axis=0)
    log_weight, k = smoothed_weights(-np.stack([each[:, s].sum(axis=1) for s in sweeps], axis=1))
    return log_weight, k, set(np.argsort(-k, kind="stable")[:refits].tolist())


def fitted_without(
    posterior: Posterior, left_out: Ints, start: Floats, seed: np.random.SeedSequence
) -> tuple[Posterior, WeightedDraws] | None:
    """The posterior of a record without some samples, and its draws; None where they missed their target.

    Parameters
    ----------
    posterior : Posterior
        Of one record.
    left_out : ndarray
        Positions of these samples.
    start : ndarray, shape (D,)
        A point of the posterior with them, in the sampled coordinates.
    seed : numpy.random.SeedSequence
    """
    from sma_bayes.sampling.importance import importance_draws

    (record,) = posterior.records
    kept = np.ones(record.n, dtype=bool)
    kept[left_out] = False
    rest = of_samples(posterior, part(record, kept))
    sampled = of_measured_sweeps(rest)
    draws = importance_draws(sampled, [start], rest.space.prior_sd(), seed)
    if not draws.converged:
        return None
    (mean_seed,) = seed.spawn(1)
    z = of_all_sweeps(draws.z, sampled, np.random.default_rng(mean_seed), one_size=True)
    return rest, replace(draws, z=z)


def left_out_sweeps(fit: Fit, record: int = 0) -> list[LeftOutSweep]:
    """Predict each sweep of a record from all others; empty where it has fewer than `FEWEST_SWEEPS`.

    Parameters
    ----------
    fit : Fit
    record : int
        Which of the records that share the posterior; where there are several no fits are made anew.
    """
    r, posterior = fit.records[record], fit.posterior
    sweeps = samples_of_sweeps(r)
    if len(sweeps) < FEWEST_SWEEPS or not posterior.noise.is_density:
        return []
    theta, weights = _of_the_density(fit)
    with np.errstate(all="ignore"):
        pointwise = posterior.pointwise_log_likelihood(theta, weights)[record]
    log_weight, k, again = weights_without(pointwise, sweeps, MAX_REFITS if len(fit.records) == 1 else 0)
    tangents = _tangents(fit, record)
    of_its_own = _of_its_own(fit, record)
    innovations = _innovations(posterior, _of_median_noise(posterior, theta, record), weights, record)
    out = []
    for i, sweep in enumerate(sweeps):
        drawn: _Drawn | None = _Drawn(innovations, theta, log_weight[:, i])
        if not k[i] <= MAX_RELIABLE_K:
            drawn = _without(fit, sweep) if i in again else None
        for channel in r.channels:
            rows = _orthonormal(tangents[channel][:, sweep])
            spare = max(sum(x.n for x in fit.records) - sweep.size - rows.shape[0], 1)
            distance = None
            if drawn is not None:
                own = None
                if channel in of_its_own:
                    size = drawn.root_mean_square(posterior.layout[record].between[channel])
                    own = size * of_its_own[channel][:, sweep] @ rows.T
                distance = _distance(drawn.innovations[channel][:, sweep], drawn.log_weight, rows, own)
            pit = None if distance is None else float(fdtr(rows.shape[0], spare, distance))
            refitted = drawn is not None and not k[i] <= MAX_RELIABLE_K
            out.append(
                LeftOutSweep(
                    sweep=i + 1, channel=channel, distance=distance, pit=pit, r=rows.shape[0], spare=spare,
                    pareto_k=float(k[i]), refitted=refitted,
                )
            )  # fmt: skip
    return out


def sweep_checks(sweeps: Sequence[LeftOutSweep]) -> list[Check]:
    """Check of each channel: the least probability of a distance as great, all sweeps that were left out paid for.

    A channel of which no sweep could be told has none.
    """
    out = []
    for channel in dict.fromkeys(s.channel for s in sweeps):
        own = [s for s in sweeps if s.channel == channel]
        told = [(float(fdtrc(s.r, s.spare, s.distance)), s) for s in own if s.distance is not None]
        if not told:
            continue
        least, worst = min(told, key=lambda x: x[0])
        p = float(-np.expm1(len(own) * np.log1p(-least))) if least < 1.0 else 1.0
        low, high = (float(fdtri(worst.r, worst.spare, q ** (1.0 / len(own)))) for q in (0.05, 0.95))
        meaning = f"{MEANING}: here of sweep {worst.sweep}"
        if len(told) < len(own):
            meaning += f"; {len(own) - len(told)} of {len(own)} sweeps can't be judged"
        out.append(
            Check(channel, STATISTIC, float(worst.distance or 0.0), low, high, p, meaning, worst.sweep)
        )
    return out


def _of_the_density(fit: Fit) -> tuple[Floats, Weights]:
    """Draws of the parameters and of what stands beside the curve, as the density of the posterior has them."""
    sampled = of_measured_sweeps(fit.posterior)
    if sampled is fit.posterior:
        return fit.flat, fit.discrepancy
    rng = np.random.default_rng(np.random.SeedSequence([fit.seed, 9]))
    space = fit.posterior.space
    z = of_all_sweeps(kept(fit.draws), sampled, rng, one_size=True)
    theta = space.constrain(z).reshape(-1, fit.theta.shape[-1])
    return theta, fit.posterior.draw_discrepancy(rng, theta)


def _of_median_noise(posterior: Posterior, theta: Floats, record: int) -> Floats:
    """Draws of all parameters (S, P) with the noise of each channel as it is at the median."""
    out = theta.copy()
    for at in posterior.layout[record].noise.values():
        out[:, at] = np.median(theta[:, at], axis=0)
    return out


def _innovations(posterior: Posterior, theta: Floats, weights: Weights, record: int) -> dict[str, Floats]:
    with np.errstate(all="ignore"):
        return posterior.residuals(theta, weights, of_sweeps=True)[record]


def _tangents(fit: Fit, record: int) -> dict[str, Floats]:
    """What a change of each free parameter of the curve does to innovations, at the median: channel to (p, n)."""
    posterior, r = fit.posterior, fit.records[record]
    theta, free = np.median(fit.flat, axis=0), posterior.sampled_model
    with np.errstate(all="ignore"):
        slopes = posterior.model.jacobian(theta[posterior.layout[record].model], r.inputs)
    return _as_innovations(fit, record, {c: slopes[c][:, free].T for c in posterior.layout[record].noise})


def _of_its_own(fit: Fit, record: int) -> dict[str, Floats]:
    """What functions of a sweep alone, of unit size, do to innovations at the median: channel to (q, n)."""
    bases = fit.posterior.discrepancy[record]
    rows = {
        c: basis.sweep_functions.samples for c, basis in bases.items() if basis.sweep_functions is not None
    }
    return _as_innovations(fit, record, rows) if rows else {}


def _as_innovations(fit: Fit, record: int, rows: Mapping[str, Floats]) -> dict[str, Floats]:
    """Series (k, n) of channels as the noise at the median has them: over its scale, without its memory."""
    posterior = fit.posterior
    place, steps = posterior.layout[record], posterior.steps[record]
    theta = np.median(fit.flat, axis=0)
    out = {}
    with np.errstate(all="ignore"):
        _, relative = posterior.moments_of_noise(theta, record)
        for channel, own in rows.items():
            scaled = own / (theta[place.noise[channel][0]] * relative[channel])
            shape = np.repeat(posterior.noise_shape(theta[None], record, channel), len(own), axis=0)
            out[channel] = posterior.noise.decorrelate(scaled, shape, steps)
    return out


def _orthonormal(rows: Floats) -> Floats:
    """Orthonormal rows (r, n) that span what is finite of some rows (p, n)."""
    usable = rows[np.isfinite(rows).all(axis=1)]
    size = np.linalg.norm(usable, axis=1)
    usable = usable[size > 0.0] / size[size > 0.0, None]
    _, singular, axes = np.linalg.svd(usable, full_matrices=False)
    return np.asarray(axes[singular > 1e-6 * singular.max(initial=0.0)])


def _distance(e: Floats, log_weight: Floats, rows: Floats, own: Floats | None = None) -> float | None:
    """``d' (1 + C)^-1 d / r`` of weighted draws of innovations (S, n) along orthonormal rows (r, n), if finite.

    What the sweep has of its own scatters along them, too, by `own` (q, r), if there is such a thing.
    """
    w = np.exp(log_weight - logsumexp(log_weight))
    kept = w > NEGLIGIBLE_WEIGHT
    if not len(rows) or not np.isfinite(e[kept]).all():
        return None
    along = e[kept] @ rows.T
    mean = w[kept] @ along
    apart = along - mean
    covariance = np.eye(len(rows)) + (apart * w[kept, None]).T @ apart
    if own is not None:
        covariance = covariance + own.T @ own
    value = float(mean @ np.linalg.solve(covariance, mean)) / len(rows)
    return value if np.isfinite(value) else None


def _without(fit: Fit, sweep: Ints) -> _Drawn | None:
    """Innovations of the whole record under a fit without a sweep; None where it missed its target."""
    (record,) = fit.records
    seed, missed_seed = np.random.SeedSequence([fit.seed, 7, int(sweep[0]), *record.key.encode()]).spawn(2)
    found = fitted_without(fit.posterior, sweep, np.median(fit.z.reshape(-1, fit.z.shape[-1]), axis=0), seed)
    if found is None:
        return None
    rest, draws = found
    theta = rest.space.constrain(draws.z)
    weights = missed_by(rest, theta, missed_seed)
    of_noise = _of_median_noise(rest, theta, 0)
    return _Drawn(_innovations(evaluated_on(rest, record), of_noise, weights, 0), theta, draws.log_weight)
