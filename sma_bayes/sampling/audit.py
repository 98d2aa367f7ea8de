"""Audit of a proposal: what it hardly draws is looked for before its draws may be called converged.

Walkers of independence moves share their proposal. What that never draws none of them visits, so neither R-hat nor an
effective sample size can tell: they compare walkers with each other. Importance weights tell only of what was drawn.
Three looks come from outside:

1. the Pareto exponent of the weights of all proposals, which says how heavy their tail is beyond what was drawn;
2. draws of a second, wider proposal, weighed by the density over its own density: they estimate, whatever the first
   one does, the share of the posterior that lies where the first hardly draws, that is where the posterior is more
   than `UNDERSAMPLED_WEIGHT` times its density;
3. differential evolution, begun at the outermost draws of every parameter: walkers walk off along a tail whose
   direction nobody has foreseen.

The wider proposal is a mixture of needles. Made wider in all of ten directions at once, hardly any draw would have a
density to speak of (a factor of 1.5 in each is one of 57 in volume). So each component is the posterior's own
covariance, stretched in one direction alone: that in which the others follow one coordinate. Every coordinate is pushed
out beyond its marginal tail, once in the coordinates of the first proposal and once in those of the parameters, where
what the data hardly determine is stretched to the width of the prior. Of its draws 25 to 60 % count.

How seldom is too seldom depends on how much is drawn: where a proposal draws fifteen times too rarely, half as long a
run again goes as often as the run goes where it draws ten times too rarely. So the audit also says how much longer a
run of the same proposal would have to be (`Audited.longer`).

What fails by more is mended: a mixture is fitted to the draws of the run, which know the tails that its weights tell
of, and the needles, drawn about what the audit met as well, become a part of the proposal.

References
----------
A. Vehtari, D. Simpson, A. Gelman, Y. Yao, J. Gabry, "Pareto smoothed importance sampling", Journal of Machine Learning
Research 25 (2024) 72.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.sampling.adaptation import Adapted, weigh
from sma_bayes.sampling.bridge import Evidence
from sma_bayes.sampling.density import Density
from sma_bayes.sampling.pareto import smoothed_weights
from sma_bayes.sampling.proposals import (
    AnyProposal,
    Coordinates,
    FactorisedMixture,
    MixedProposal,
    Mixture,
    PlainCoordinates,
    Proposal,
    StudentMixture,
)
from sma_bayes.sampling.weighted import Weights, tempered

UNDERSAMPLED_WEIGHT: Final = 10.0
"""Posterior over proposal, in mean weights, from which the proposal counts as hardly drawing there, in a run that is
just long enough for the target."""
MAX_UNDERSAMPLED_SHARE: Final = 0.003
"""Greatest share of the posterior that may lie where the proposal hardly draws. So much more beyond a 97.5 % quantile
moves that of a normal distribution by 0.05 standard deviations. The first proposals of the twin campaign leave none; a
false alarm costs one more set of proposals."""
MAX_PARETO_K: Final = 0.5
"""Greatest Pareto exponent of the weights: beyond, their variance is infinite, and with it that of the evidence."""
MAX_MET_WEIGHT: Final = 30.0
"""Greatest weight, in mean weights, that walkers of differential evolution may meet, in such a run."""
STRETCH_FACTOR: Final = 3.0
"""Factor by which a component of the wider proposal is stretched in its direction."""
WEAK_CONTRACTION, MAX_STRETCH = 0.2, 5.0
"""Posterior over prior sd from which the data count as hardly determining a coordinate, which is then stretched to the
prior's width, but by so much at most."""
MAX_KERNELS, KERNEL_SDS = 16, 0.7
"""Points met where the proposal hardly draws about which a mended one has components, at most, and the size of these in
standard deviations of the posterior."""
TAIL_DF: Final = 5.0
"""Degrees of freedom of the wider proposal."""
WIDER_DRAWS: Final = 512
"""Draws of the wider proposal."""
MAX_SHAPE_DRAWS: Final = 768
"""Draws of the run, at most, from which the shape of the posterior is taken."""
WALKERS, STEPS = 96, 6
"""Of differential evolution from the outermost draws."""
MENDED_COMPONENTS, MENDED_ROUNDS, MAX_FITTED_DRAWS = 8, 20, 8000
"""Of the mixture that mends a proposal: components, rounds of fitting, draws of the run it is fitted to, at most."""
MENDED_DRAWS: Final = 2048
"""By which a mended proposal is judged, and where its run begins; to as many one that reaches further is fitted."""
MENDED_SHARES: Final = np.array([0.8, 0.2])
"""Of the mixture and of the needles in a mended proposal."""
FURTHER_SHARES: Final = np.array([0.45, 0.35, 0.2])
"""Of the proposal before, of a mixture fitted to weighted draws, and of the needles, in one that reaches further."""
FITTED_ROUNDS: Final = 6
"""Of fitting that mixture."""


@dataclass(frozen=True, slots=True)
class Audit:
    """What an audit found.

    Attributes
    ----------
    pareto_k : float
        Pareto exponent of the importance weights of all proposals of the run.
    outside, outside_sd : float
        Share of the posterior where the proposal hardly draws, as a wider proposal finds it, and its standard error.
    greatest_met : float
        Greatest weight, in mean weights, that walkers of differential evolution met.
    passed : bool
        Whether draws of the proposal may be called converged.
    """

    pareto_k: float
    outside: float
    outside_sd: float
    greatest_met: float
    passed: bool


@dataclass(frozen=True, slots=True, eq=False)
class Audited:
    """An audit with the evidence as it corrects it, and the wider proposal.

    Attributes
    ----------
    audit : Audit
    evidence : Evidence
    wider : Proposal
        Needles about the draws of the run and about what was met beyond them.
    z : ndarray, shape (S, D)
        Draws of the run, `MAX_FITTED_DRAWS` at most.
    longer : float
        By what factor longer the run must be for its proposal to pass as it is: 1 where it does, infinite where no
        length of run does.
    evaluations : int
        Evaluations of the density that it took.
    """

    audit: Audit
    evidence: Evidence
    wider: Proposal
    z: Floats
    longer: float
    evaluations: int

    def mended(self, density: Density, proposal: AnyProposal, rng: np.random.Generator) -> Adapted:
        """A mixture fitted to the draws of the run, joined with the needles; its own draws judge it.

        Where the proposal before takes blocks of coordinates as independent, one that does so is fitted as well, and
        the better is taken.
        """
        first = _first(proposal)
        u, _, back = first.coordinates.forward(self.z)
        count = np.count_nonzero(back)
        if count < max(0.5 * len(u), 4 * u.shape[1]):
            return _joined(density, proposal, self.wider, rng)
        u = u[back]
        narrow: list[Mixture] = [_fitted(u, rng)]
        if isinstance(first.narrow, FactorisedMixture):
            parts = tuple(
                part.refitted(u[:, block], np.full(count, 1.0 / count), rounds=MENDED_ROUNDS)
                if part.components == 1
                else _fitted(u[:, block], rng)
                for block, part in zip(first.narrow.blocks, first.narrow.parts, strict=True)
            )
            narrow.append(FactorisedMixture(first.narrow.blocks, parts))
        joined = [MixedProposal(MENDED_SHARES, (replace(first, narrow=each), self.wider)) for each in narrow]
        last = [weigh(density, each, rng, MENDED_DRAWS) for each in joined]
        best = int(np.argmax([each.weights.efficiency for each in last]))
        return Adapted(joined[best], last[best], MENDED_DRAWS * len(joined))


def _fitted(u: Floats, rng: np.random.Generator) -> StudentMixture:
    """Mixture fitted to draws (S, D)."""
    covariance = np.cov(u.T).reshape(u.shape[1], -1)
    start = StudentMixture.about(u, MENDED_COMPONENTS, covariance, TAIL_DF, rng)
    return start.refitted(u, np.full(len(u), 1.0 / len(u)), rounds=MENDED_ROUNDS)


def _first(proposal: AnyProposal) -> Proposal:
    return proposal.parts[0] if isinstance(proposal, MixedProposal) else proposal


def reaching_further(density: Density, adapted: Adapted, width: Floats, rng: np.random.Generator) -> Adapted:
    """Mend a proposal by its own weighted draws alone, as one that did not pass an audit is mended.

    Parameters
    ----------
    density : Density
    adapted : Adapted
    width : ndarray, shape (D,)
        Standard deviation of the prior of each coordinate.
    rng : numpy.random.Generator
    """
    usable = np.isfinite(adapted.last.log_weight)
    if np.count_nonzero(usable) <= 4 * width.size:
        return replace(adapted, evaluations=0)
    weight = tempered(Weights(adapted.last.log_weight[usable]))
    few = adapted.last.z[usable][rng.choice(weight.size, MAX_SHAPE_DRAWS, p=weight)]
    return _joined(density, adapted.proposal, _needles(adapted.proposal, few, width), rng)


def _joined(density: Density, proposal: AnyProposal, wider: Proposal, rng: np.random.Generator) -> Adapted:
    """A proposal joined with needles and with a mixture fitted to draws of both; its own draws judge it."""
    parts = proposal.parts if isinstance(proposal, MixedProposal) else (proposal,)
    share = proposal.weight if isinstance(proposal, MixedProposal) else np.ones(1)
    joined = MixedProposal(np.append(0.5 * share, 0.5), (*parts, wider))
    drawn = weigh(density, joined, rng, MENDED_DRAWS)
    usable = np.isfinite(drawn.log_weight)
    weight = tempered(Weights(drawn.log_weight[usable]))
    u, _, back = wider.coordinates.forward(drawn.z[usable])
    weight = np.where(back, weight, 0.0)
    if np.count_nonzero(weight) >= MENDED_DRAWS // 4 and isinstance(wider.narrow, StudentMixture):
        narrow = wider.narrow.refitted(u[back], weight[back] / weight.sum(), rounds=FITTED_ROUNDS)
        fitted = replace(wider, narrow=narrow, share=0.05)
        joined = MixedProposal(
            np.concatenate([FURTHER_SHARES[0] * share, FURTHER_SHARES[1:]]), (*parts, fitted, wider)
        )
    return Adapted(joined, weigh(density, joined, rng, MENDED_DRAWS), 2 * MENDED_DRAWS)


def audited(
    density: Density,
    proposal: AnyProposal,
    log_weight: Floats,
    z: Floats,
    width: Floats,
    rng: np.random.Generator,
    times: float = 1.0,
) -> Audited:
    """Audit the proposal of a run.

    Parameters
    ----------
    density : Density
    proposal : Proposal or MixedProposal
    log_weight : ndarray, shape (N,)
        Log of density over proposal, of all proposals of the run.
    z : ndarray, shape (S, D)
        Draws of the run.
    width : ndarray, shape (D,)
        Standard deviation of the prior of each coordinate.
    rng : numpy.random.Generator
    times : float
        How many times as long the run is as it would have to be for its target alone.
    """
    weights = Weights(log_weight)
    ln_evidence, _ = weights.log_evidence()
    k = float(smoothed_weights(log_weight[np.isfinite(log_weight), None])[1][0])
    few = z[np.linspace(0, len(z) - 1, min(len(z), MAX_SHAPE_DRAWS)).astype(int)]
    wider = _needles(proposal, few, width)
    drawn = weigh(density, wider, rng, WIDER_DRAWS)
    over = _over(proposal, drawn.z, drawn.log_prob) - ln_evidence
    rarely = UNDERSAMPLED_WEIGHT * times
    rare = over > math.log(rarely)
    share = np.exp(np.clip(drawn.log_weight - ln_evidence, -700.0, 700.0))
    outside = float((share * rare).mean())
    outside_sd = float((share * rare).std() / math.sqrt(share.size))

    walked, log_prob = _walked(density, z, rng)
    met = _over(proposal, walked, log_prob) - ln_evidence
    greatest = math.exp(min(float(met.max(initial=0.0)), 700.0))
    longer = (
        max(1.0, greatest / (MAX_MET_WEIGHT * times), _reach(over, share) / rarely)
        if k <= MAX_PARETO_K
        else math.inf
    )
    passed = longer == 1.0
    if not passed:
        own = _over(proposal, few, density.log_prob(few)) - ln_evidence
        found = np.concatenate([few[own > math.log(rarely)], drawn.z[rare], walked[met > math.log(rarely)]])
        wider = _needles(proposal, few, width, found[rng.permutation(len(found))[:MAX_KERNELS]])
    evidence = _evidence(weights, ln_evidence, rarely, outside, outside_sd)
    evaluations = WIDER_DRAWS + WALKERS * (STEPS + 1) + (0 if passed else len(few))
    fit_to = z[rng.permutation(len(z))[:MAX_FITTED_DRAWS]]
    return Audited(
        Audit(k, outside, outside_sd, greatest, passed), evidence, wider, fit_to, longer, evaluations
    )


def _reach(over: Floats, share: Floats) -> float:
    """Posterior over proposal, in mean weights, beyond which at most `MAX_UNDERSAMPLED_SHARE` of the posterior lies."""
    order = np.argsort(-over)
    beyond = np.cumsum(share[order]) > MAX_UNDERSAMPLED_SHARE * share.size
    return float(np.exp(min(over[order][np.argmax(beyond)], 700.0))) if beyond.any() else 0.0


def _evidence(
    weights: Weights, ln_evidence: float, rarely: float, outside: float, outside_sd: float
) -> Evidence:
    """Log evidence and its standard error: where the proposal draws by its own weights, elsewhere by the wider one's.

    Where the two disagree about the rest, half of the difference is part of the error.
    """
    relative = weights.normalised * weights.log_weight.size
    rest = np.where(relative > rarely, relative, 0.0)
    inside = relative - rest
    value = float(inside.mean()) + outside
    variance = float(inside.var()) / inside.size + outside_sd**2
    variance += (0.5 * (float(rest.mean()) - outside)) ** 2
    return Evidence(ln_evidence + math.log(value), math.sqrt(variance) / value)


def _over(proposal: AnyProposal, z: Floats, log_prob: Floats) -> Floats:
    """Log of density over proposal (n,); minus infinity where the density is zero."""
    value = np.full(len(z), -np.inf)
    usable = np.isfinite(log_prob)
    value[usable] = log_prob[usable] - proposal.log_density(z[usable])
    return value


def _needles(proposal: AnyProposal, z: Floats, width: Floats, met: Floats | None = None) -> Proposal:
    """Wider proposal about draws (S, D): each coordinate pushed beyond its tail, the others following it.

    About points (K, D) that were met where the proposal hardly draws there are components of their own.
    """
    d = z.shape[1]
    met = np.empty((0, d)) if met is None else met
    coordinates: Coordinates = _first(proposal).coordinates
    u, _, back = coordinates.forward(z)
    if np.count_nonzero(back) < max(0.5 * len(z), 4 * d):
        coordinates, u, back = PlainCoordinates(), z, np.ones(len(z), dtype=bool)
    u_met, _, back_met = coordinates.forward(met)
    sd = z.std(axis=0) / width
    weak = np.where(
        sd > WEAK_CONTRACTION,
        np.clip(1.0 / np.maximum(sd, 1e-300), STRETCH_FACTOR, MAX_STRETCH),
        STRETCH_FACTOR,
    )
    inner = _stretched(u[back], np.full(d, STRETCH_FACTOR), u_met[back_met])
    return Proposal(coordinates, inner, _stretched(z, weak, met), share=0.5)


def _stretched(x: Floats, stretch: Floats, met: Floats) -> StudentMixture:
    """Mixture with the covariance of draws (S, D), stretched along each coordinate in turn, and about points (K, D)."""
    count, d = x.shape
    mean = x.mean(axis=0)
    covariance = (x - mean).T @ (x - mean) / count
    along = covariance / np.sqrt(np.maximum(np.diag(covariance), 1e-300))[:, None]
    grown = covariance + (stretch**2 - 1.0)[:, None, None] * along[:, :, None] * along[:, None, :]
    about = np.repeat(KERNEL_SDS**2 * covariance[None], len(met), axis=0)
    weight = np.full(d, 1.0 / d)
    if len(met):
        weight = np.concatenate([0.5 * weight, np.full(len(met), 0.5 / len(met))])
    means = np.concatenate([np.repeat(mean[None], d, axis=0), met])
    return StudentMixture.from_covariances(weight, means, np.concatenate([grown, about]), TAIL_DF)


def _walked(density: Density, z: Floats, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Steps (n, D) of differential evolution from the outermost draws and some others, and their log density.

    Differences are those of draws of the run (C. J. F. ter Braak, J. A. Vrugt, Statistics and Computing 18 (2008) 435),
    so that each step of all walkers is one batch.
    """
    count, d = z.shape
    order = np.argsort(z, axis=0)
    outermost = rng.permutation(np.unique(order[[0, 1, -2, -1]]))
    here = z[np.concatenate([outermost, rng.integers(count, size=WALKERS)])[:WALKERS]]
    log_here = density.log_prob(here)
    points, values = [], []
    for step in range(STEPS):
        one, other = rng.integers(count, size=(2, WALKERS))
        length = 2.38 / math.sqrt(2.0 * d) if step % 3 else 1.0
        there = here + length * (z[one] - z[other])
        log_there = density.log_prob(there)
        taken = np.log(rng.random(WALKERS)) < log_there - log_here
        here, log_here = np.where(taken[:, None], there, here), np.where(taken, log_there, log_here)
        points.append(here[taken])
        values.append(log_here[taken])
    return np.concatenate(points), np.concatenate(values)
