"""Predicting what had no part in the fit: single samples, cycles, conditions, stretches of temperature.

Leaving out a sample is done by Pareto-smoothed weights of the draws (PSIS-LOO), and by a fit without it where the
weights can't be relied on. Neighbouring samples of a sweep tell nearly the same, so whole folds are left out as well,
always by a fit without them. Where ``memory`` samples count as one, every log density counts by that share.

References
----------
A. Vehtari, A. Gelman, J. Gabry, "Practical Bayesian model evaluation using leave-one-out cross-validation and WAIC",
Statistics and Computing 27 (2017) 1413, doi 10.1007/s11222-016-9696-4.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from sma_bayes.arrays import Floats
from sma_bayes.assess.correlation import Agreement, agreement
from sma_bayes.fitting.discrepancy import DiscrepancyBasis, turned
from sma_bayes.fitting.posterior import Posterior, Weights
from sma_bayes.fitting.sweep_functions import SWEEP, SweepFunctions, sweeps_of
from sma_bayes.records.types import Record
from sma_bayes.sampling.pareto import MAX_RELIABLE_K, smoothed_weights
from sma_bayes.sampling.weighted import resampled, weighted_quantiles

if TYPE_CHECKING:
    from sma_bayes.sampling.importance import WeightedDraws

Mask = NDArray[np.bool_]
CONDITION: Final = "condition"
"""Input that is added where conditions are joined: their number."""
FEWEST_CYCLES: Final = 3
MOST_FOLDS: Final = 10
"""Greatest number of folds; with more cycles every tenth cycle is left out together."""
BLOCK: Final = 4
"""Least number of samples of a temperature block."""
DRAWS_WITHOUT: Final = 2000
"""Draws of a fit without some samples, which predict these; enough where a tenth of them count."""


@dataclass(frozen=True, slots=True, eq=False)
class Folds:
    """What is left out in turn.

    Attributes
    ----------
    kind : str
        ``cycles``, ``conditions`` or ``temperature blocks``.
    number : ndarray of int, shape (n,)
        Fold of each sample, from 0.
    labels : tuple of str
    """

    kind: str
    number: NDArray[np.int64]
    labels: tuple[str, ...]

    @property
    def count(self) -> int:
        """Number of folds."""
        return len(self.labels)


def folds_of(record: Record) -> Folds:
    """Folds of a record: conditions where some were joined, else cycles, else blocks of temperature."""
    unit = record.units["temperature"]
    for kind, name in (("conditions", CONDITION), ("cycles", "cycle")):
        values, number = np.unique(record.inputs.get(name, np.empty(0)), return_inverse=True)
        if values.size >= (2 if kind == "conditions" else FEWEST_CYCLES):
            groups = [values[i::MOST_FOLDS] for i in range(min(values.size, MOST_FOLDS))]
            labels = tuple(", ".join(f"{v:g}" for v in g) for g in groups)
            return Folds(kind, number.astype(np.int64) % MOST_FOLDS, labels)
    count = max(2, min(MOST_FOLDS, record.n // BLOCK))
    rank = np.argsort(np.argsort(record.temperature, kind="stable"), kind="stable")
    block = rank * count // record.n
    ends = [record.temperature[block == b] for b in range(count)]
    labels = tuple(f"{e.min():.4g} to {e.max():.4g} {unit}" for e in ends)
    return Folds("temperature blocks", block.astype(np.int64), labels)


def part(record: Record, kept: Mask) -> Record:
    """Some samples of a record; across a gap nothing is remembered."""
    segment = record.inputs["segment"]
    starts = np.ones(record.n, dtype=bool)
    starts[1:] = (np.diff(segment) != 0) | ~kept[:-1]
    inputs = {k: v[kept] for k, v in record.inputs.items()}
    if np.unique(record.inputs["segment"]).size > 1:
        inputs[SWEEP] = sweeps_of(record.inputs)[kept].astype(float)
    inputs["segment"] = np.cumsum(starts[kept]).astype(float)
    observed = {k: v[kept] for k, v in record.observed.items()}
    return replace(record, inputs=inputs, observed=observed, row=record.row[kept])


def of_samples(posterior: Posterior, record: Record) -> Posterior:
    """The posterior of other samples of its record, its discrepancy included.

    The functions of the discrepancy are turned so that they are orthogonal over these samples; a priori that changes
    nothing.
    """
    bases = {}
    for channel, basis in posterior.discrepancy[0].items():
        rows = basis.at(record.temperature).T
        power, axes = np.linalg.eigh(rows @ rows.T)
        bases[channel] = DiscrepancyBasis(
            basis.temperature, basis.values @ axes, turned(rows, axes, power), own_of(basis, record)
        )
    return posterior.on([record], discrepancy=[bases])


def evaluated_on(posterior: Posterior, record: Record) -> Posterior:
    """The same at other samples, for given weights: the functions of the discrepancy stay as they are."""
    bases = {
        c: replace(
            DiscrepancyBasis.tabulated(b.temperature, b.values, record.temperature),
            sweep_functions=own_of(b, record),
        )
        for c, b in posterior.discrepancy[0].items()
    }
    return posterior.on([record], discrepancy=[bases])


def own_of(basis: DiscrepancyBasis, record: Record) -> SweepFunctions | None:
    """What sweeps of other samples have of their own, where those of the basis have anything."""
    if basis.sweep_functions is None:
        return None
    own = basis.sweep_functions
    tabulated = SweepFunctions.tabulated(own.temperature, own.values, record.inputs)
    return replace(tabulated, change=own.change, sum_to_zero=own.sum_to_zero)


def density_of(
    posterior: Posterior, theta: Floats, weights: Weights, record: Record
) -> tuple[Floats, Floats]:
    """Full log density (S, n) of each sample of a record, and the share by which it counts (S,).

    Parameters
    ----------
    posterior : Posterior
        With the discrepancy whose weights are given.
    theta : ndarray, shape (S, P)
    weights : tuple of mapping
    record : Record
        Of other samples of one channel.
    """
    (channel,) = record.channels
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):  # far tails of a prior
        (pointwise,) = evaluated_on(posterior, record).pointwise_log_likelihood(theta, weights)
    share = posterior.noise.likelihood_weight(posterior.noise_shape(theta, 0, channel))
    return _impossible_where_undefined(pointwise[channel] / share[:, None]), share


def _impossible_where_undefined(log_density: Floats) -> Floats:
    """Log densities, minus infinity where one is not a number: in the far tails of a prior curves overflow."""
    return np.where(np.isnan(log_density), -np.inf, log_density)


def density_without(
    posterior: Posterior, theta: Floats, record: Record, seed: np.random.SeedSequence
) -> Floats:
    """Full log density (S, n) of samples that had no part in a posterior.

    The weights of a discrepancy are integrated out where they are normal given all else, and drawn otherwise. Where a
    stretch is left out little is known of the discrepancy there: against noise of a hundredth of that only one drawn
    curve in a hundred comes near the samples.

    Parameters
    ----------
    posterior : Posterior
        Of the other samples.
    theta : ndarray, shape (S, P)
    record : Record
        The samples, of one channel.
    seed : numpy.random.SeedSequence
        For weights that are drawn.
    """
    (channel,) = record.channels
    if not posterior.has_normal_weights(channel):
        density, _ = density_of(posterior, theta, missed_by(posterior, theta, seed), record)
        return density
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):  # far tails of a prior
        weights = posterior.normal_weights(theta, channel)
        density = evaluated_on(posterior, record).predictive_log_density(theta, weights, channel)
    return _impossible_where_undefined(density)


def missed_by(posterior: Posterior, theta: Floats, seed: np.random.SeedSequence) -> Weights:
    """Weights of the discrepancy, one set for each of the parameter vectors (S, P)."""
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        return posterior.draw_discrepancy(np.random.default_rng(seed), theta)


@dataclass(frozen=True, slots=True, eq=False)
class HeldOutPredictions:
    """Predictions of samples that had no part in the fit.

    Attributes
    ----------
    log_density : ndarray, shape (n,)
        Of each sample.
    median : ndarray, shape (n,)
        Predicted value [unit of the channel]: median of the curve. A mean it may not have: Eq. (7) is a ratio, and
        beyond the samples at hand a draw in ten thousand may be larger than all others together.
    k : ndarray, shape (targets,)
        Pareto exponent of each sample or fold before fits were made anew.
    k_anew : ndarray, shape (refits,)
        Pareto exponent of the draws of each fit that was made anew.
    not_converged : int
        How many of those did not reach the target.
    agreements : tuple of Agreement
        Of each target with draws of the curve; empty unless asked for.
    """

    log_density: Floats
    median: Floats
    k: Floats
    k_anew: Floats
    not_converged: int
    agreements: tuple[Agreement, ...] = ()

    @property
    def refits(self) -> int:
        """How many fits were made anew."""
        return self.k_anew.size


@dataclass(frozen=True, eq=False)
class Predictor:
    """A fitted contender that can be fitted again without some samples.

    Attributes
    ----------
    posterior : Posterior
        Of one record of one channel.
    draws : WeightedDraws
    weights : tuple of mapping
        Weights of the discrepancy beside each draw.
    without : callable
        Posterior of a part of the record; constants that were plugged in come from that part.
    plugged_in : bool
        Whether there are any: weights of the draws then don't know of what leaving out changes.
    """

    posterior: Posterior
    draws: WeightedDraws
    weights: Weights
    without: Callable[[Record], Posterior]
    plugged_in: bool

    @property
    def record(self) -> Record:
        """The record."""
        return self.posterior.records[0]

    def mean_curve(self, theta: Floats, record: Record) -> Floats:
        """The curves (S, n), without a discrepancy."""
        return self.posterior.predict(theta, record.inputs)[record.channels[0]]

    def leave_out(
        self,
        targets: Sequence[Mask],
        seed: np.random.SeedSequence,
        trust: float = MAX_RELIABLE_K,
        *,
        curves: int = 0,
        progress: Callable[[str], None] | None = None,
    ) -> HeldOutPredictions:
        """Predict each of several parts of the record from the rest.

        Parameters
        ----------
        targets : sequence of ndarray of bool, shape (n,)
            Parts; no sample is in two of them.
        seed : numpy.random.SeedSequence
            For the fits that have to be made anew.
        trust : float
            Greatest Pareto exponent at which weights of the draws take the place of a fit without the part; minus
            infinity for a fit without each.
        curves : int
            Draws of the curve that are compared with each part; none by default. Those of one part are independent
            of those of another.
        progress : callable, optional
            Told of each fit that is made anew, before it is.
        """
        record = self.record
        theta = self.posterior.space.constrain(self.draws.z)
        full, share = self._left_out_density(theta, single=all(t.sum() == 1 for t in targets))
        left = np.stack([(full[:, t] * share[:, None]).sum(axis=1) for t in targets], axis=1)
        log_weight, k = smoothed_weights(self.draws.log_weight[:, None] - left)
        curve = self.mean_curve(theta, record)
        density, median = np.full(record.n, np.nan), np.full(record.n, np.nan)
        anew = self._anew(targets, k, trust)
        fits: list[WeightedDraws] = []
        agreements: list[Agreement] = []
        for i, (target, own_seed) in enumerate(zip(targets, seed.spawn(len(targets)), strict=True)):
            if anew[i]:
                if progress is not None:
                    progress(f"fit {len(fits) + 1} of {anew.sum()} without the samples that it predicts")
                draws, at_target, of_target = self._predicted(target, own_seed)
                w = draws.log_weight
                fits.append(draws)
            else:
                w, at_target, of_target = log_weight[:, i], full[:, target], curve[:, target]
            density[target] = logsumexp(w[:, None] + at_target, axis=0)
            median[target] = weighted_quantiles(of_target, w, (0.5,))[0]
            if curves:
                rng = np.random.default_rng(own_seed.spawn(1)[0])
                data = record.observed[record.channels[0]][target]
                agreements.append(agreement(data, of_target[resampled(w, curves, rng)]))
        k_anew = np.array([f.k for f in fits])
        return HeldOutPredictions(
            density, median, k, k_anew, sum(not f.converged for f in fits), tuple(agreements)
        )

    def _left_out_density(self, theta: Floats, *, single: bool) -> tuple[Floats, Floats]:
        """Full log density (S, n) of each sample, and the share by which it counts (S,).

        Of `single` samples, each given all others where the weights of a discrepancy can be integrated out. Otherwise
        given drawn weights, which have followed the very sample.
        """
        (channel,) = self.record.channels
        if not (single and self.posterior.has_normal_weights(channel)):
            return density_of(self.posterior, theta, self.weights, self.record)
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):  # far tails of a prior
            density = self.posterior.left_out_log_density(theta, channel)
        return _impossible_where_undefined(density), np.ones(len(theta))

    def _anew(self, targets: Sequence[Mask], k: Floats, trust: float) -> Mask:
        anew = ~np.asarray(k <= trust)
        if self.plugged_in:  # the constants are the extremes: only leaving one of them out changes anything
            (values,) = self.record.observed.values()
            extreme = (values == values.min()) | (values == values.max())
            anew |= np.array([bool(np.any(extreme[t])) for t in targets])
        return anew

    def _predicted(self, target: Mask, seed: np.random.SeedSequence) -> tuple[WeightedDraws, Floats, Floats]:
        """Draws of a fit without a part, and their log densities and curves (S, part) there."""
        from sma_bayes.sampling.importance import few_draws

        posterior = self.without(part(self.record, ~target))
        starts = [m.z for m in self.draws.modes]
        width = posterior.space.prior_sd()
        draws = few_draws(posterior, starts, width, seed, DRAWS_WITHOUT, others=[self.draws.proposal])
        theta = posterior.space.constrain(draws.z)
        test = part(self.record, target)
        density = density_without(posterior, theta, test, seed.spawn(1)[0])
        return draws, density, self.mean_curve(theta, test)
