"""Fit a proposal to a density: Laplace approximation, then importance draws that refine it."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import emcee
import numpy as np
from emcee.state import State

from sma_bayes.arrays import Bools, Floats, Ints
from sma_bayes.posterior import Posterior
from sma_bayes.sampling.coordinates import NoiseScaledCoordinates, PredictiveCoordinates
from sma_bayes.sampling.laplace import Density, Mode
from sma_bayes.sampling.linearised import Linearised
from sma_bayes.sampling.moves import differential_evolution
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
from sma_bayes.sampling.shape import one_component, shape_of
from sma_bayes.sampling.weighted import LEAST, Weighed, Weights, tempered

DRAWS = 500
"""Importance draws of one round."""
SHELVED = 4 * DRAWS
"""Those beside a discrepancy under noise that is not normal, of whose parameters linearising tells little."""
FIRST = 256
"""Those of a first look at a proposal as linearising gives it."""
LINEAR, EVEN = 0.92, 2.0
"""Efficiency of a first look at which no other coordinates are looked at, or the greatest weight, in mean weights.

Where the response is linear the efficiency is 0.94, but 0.90 to 0.95 by how many draws happen to be wide; the greatest
weight is 1.3 to 2.1. Where the response is bent and a look is as efficient, the greatest weight is 2.3 and more."""
FAIR, LED = 0.8, 0.5
"""Efficiency that does, too, where no parameter is led by the prior, that is, has more than so much of the prior's sd:
one that is lies on a ridge, which may bend far beyond what a few draws show."""
BETTER = 1.02
"""Gain in efficiency, with the same draws, for which other coordinates are taken, whose draws cost more."""
GRID = np.linspace(-5.0, 5.0, 41)
"""Where the marginal of a single noise parameter is looked at, in standard deviations of the Laplace approximation."""
POINTS = 441
"""Points of such a grid for several noise parameters of a channel."""
ON_A_GRID = 2
"""Noise parameters of a channel, at most, for which there is a grid."""
NEARLY_NORMAL = 30.0
"""Degrees of freedom of what is normal where the response is linear."""
HELD = 100.0
"""Draws for which the covariance that linearising gave counts beside those of a round."""
ROUNDS = 6
"""Greatest number of rounds for one set of coordinates."""
GOOD = 0.7
"""Efficiency at which refining stops. At 0.6 a mild banana still passes, whose tail has weights that end a run."""
AROUND = (64, 60)
"""Walkers and steps that look for what a proposal does not reach."""
USABLE = 0.3
"""Efficiency below which a proposal does not carry a run alone."""
GREATEST_SHARE = 30.0
"""Greatest importance weight, as a multiple of the mean weight, of a proposal that carries a run alone."""


@dataclass(frozen=True, slots=True, eq=False)
class Adapted:
    """A fitted proposal and what its own draws say of it.

    Attributes
    ----------
    proposal : Proposal or MixedProposal
    last : Weighed
        The last round of draws.
    evaluations : int
    greatest_seen : float
        Greatest weight, as a multiple of the mean weight, at draws of another move that were not used in the fit:
        what the proposal would hardly ever draw shows there, not in its own draws. Zero where there are none.
    acceptance : float
        Share of independence moves from such draws that would be accepted; not a number where there are none.
    own : bool
        Whether the last round was drawn from this proposal, not from one before it was fitted once more.
    spare : int
        Draws at the end of the last round that were made so that a run may have them as its first proposals.
    """

    proposal: AnyProposal
    last: Weighed
    evaluations: int
    greatest_seen: float = 0.0
    acceptance: float = math.nan
    own: bool = True
    spare: int = 0

    @property
    def weights(self) -> Weights:
        """Those of the last round."""
        return self.last.weights

    @property
    def misses(self) -> bool:
        """Whether another move met what this proposal hardly ever draws: of that, its own draws know nothing."""
        return self.greatest_seen > GREATEST_SHARE

    @property
    def carries(self) -> bool:
        """Whether an independence move with this proposal is enough by itself."""
        weights = self.weights
        return weights.efficiency >= USABLE and weights.greatest <= GREATEST_SHARE and not self.misses

    @property
    def good(self) -> bool:
        """Whether it carries a run, and fitting it again would hardly make it better."""
        return self.weights.efficiency >= GOOD and self.carries

    def judged(self, z: Floats, log_prob: Floats) -> Adapted:
        """The same, as draws (n, D) of another move see it; `log_prob` (n,) is what the density is there."""
        log_seen = log_prob - self.proposal.log_density(z) - self.weights.log_evidence()[0]
        seen = np.exp(np.clip(log_seen, -700.0, 700.0))  # a proposal may miss a draw by any factor
        own = np.sort(self.weights.normalised) * self.weights.log_weight.size
        below = np.searchsorted(own, seen)
        total = np.concatenate([np.zeros(1), np.cumsum(own)])[below]
        accepted = (total / seen + (own.size - below)) / own.size  # mean of min(1, own/seen) over own
        return replace(self, greatest_seen=float(seen.max()), acceptance=float(accepted.mean()))


def adapt(density: Density, modes: Sequence[Mode], rng: np.random.Generator) -> Adapted:
    """Fit a proposal to a density whose modes are known.

    Parameters
    ----------
    density : Density
        A `Posterior`, for which coordinates are built, or any other density, taken as it is.
    modes : sequence of Mode
        Best first.
    rng : numpy.random.Generator
    """
    fitted = [_adapt_mode(density, mode, rng) for mode in modes]
    found = fitted[0] if len(fitted) == 1 else _mixed(density, fitted, rng)
    # in its own coordinates a posterior is not bent
    return found if isinstance(density, Posterior) else _looked_around(density, found, rng)


@np.errstate(all="ignore")  # where the density is zero nothing of this is a number, and it is not good
def at_a_look(linearised: Linearised, mode: Mode, rng: np.random.Generator, ahead: int = 0) -> Adapted | None:
    """Proposal as linearising at a mode, or near one, gives it, and draws that tell how good it is.

    Where it is all but sure to be good, `ahead` more draws are made at once, for a run that begins with it. None where
    nothing can be linearised.
    """
    return _looked_at(linearised, mode, rng, ahead)[1]


def _mixed(density: Density, fitted: Sequence[Adapted], rng: np.random.Generator) -> Adapted:
    """One proposal of several, each with the share of its evidence."""
    evidence = np.array([f.weights.log_evidence()[0] for f in fitted])
    share = np.exp(evidence - evidence.max())
    share = np.maximum(share / share.sum(), 0.02)
    parts = tuple(f.proposal for f in fitted if isinstance(f.proposal, Proposal))
    proposal = MixedProposal(share / share.sum(), parts)
    last = weigh(density, proposal, rng, 4 * DRAWS)
    return Adapted(proposal, last, sum(f.evaluations for f in fitted) + 4 * DRAWS)


def with_wide_share(adapted: Adapted, share: float = 0.2) -> Adapted:
    """The same proposal with more of its wide component, which bounds the weights in the tails."""
    wider: AnyProposal
    if isinstance(adapted.proposal, MixedProposal):
        parts = tuple(replace(p, share=share) for p in adapted.proposal.parts)
        wider = replace(adapted.proposal, parts=parts)
    else:
        wider = replace(adapted.proposal, share=share)
    return replace(adapted, proposal=wider, own=False, spare=0)


def _adapt_mode(density: Density, mode: Mode, rng: np.random.Generator) -> Adapted:
    if not isinstance(density, Posterior):
        return _adapt_plain(density, mode, rng)
    proposals, best = _looked_at(Linearised.at(density, mode.z), mode, rng)
    if best is None:
        return _adapt_plain(density, mode, rng)
    if best.good:
        # what a fit to draws would learn of the density is less than what it would lose by chance
        return best
    evaluations = best.evaluations
    fitted: list[Adapted] = []
    # the size of a discrepancy goes down to where it does nothing: of that shelf a few draws tell nothing
    shelved = density.has_discrepancy and not density.noise.is_gaussian
    draws = SHELVED if shelved else DRAWS
    for proposal in proposals:
        fitted.append(_refine(density, proposal, rng, draws, HELD))
        best = max(fitted, key=lambda f: f.weights.efficiency)
        if best.good:
            break
    return replace(best, evaluations=evaluations + sum(f.evaluations for f in fitted))


def _wide(mode: Mode) -> StudentMixture:
    """Component about a mode with twice its standard deviations, and heavy tails."""
    return StudentMixture.from_covariances(np.ones(1), mode.z[None], 4.0 * mode.covariance[None], 4.0)


def _looked_at(
    linearised: Linearised, mode: Mode, rng: np.random.Generator, ahead: int = 0
) -> tuple[list[Proposal], Adapted | None]:
    """Proposals as linearising gives them, best first, and a few draws of the best; None where there is no proposal.

    Other coordinates are looked at where those before do not do. What is drawn is the same in all of them, so that
    they can be compared.
    """
    wide, posterior = _wide(mode), linearised.posterior
    sd = np.sqrt(np.diag(mode.covariance)) / posterior.space.prior_sd()
    determined = bool(np.all(sd[: linearised.count] <= LED))
    enough = FAIR if determined else LINEAR
    spare = ahead if determined and len(posterior.records) == 1 else 0
    size = FIRST + spare
    seed = rng.integers(2**63)
    narrow: Mixture | None = None
    best: Adapted | None = None
    proposals: list[Proposal] = []
    for inner in _inner_coordinates(linearised):
        try:
            coordinates = NoiseScaledCoordinates.about(linearised, inner)
            # what is linear tells of the noise the same in all coordinates
            narrow = narrow or _start(coordinates, mode, posterior, rng)
        except np.linalg.LinAlgError:
            continue
        proposal = Proposal(coordinates, narrow, wide)
        last = weigh(posterior, proposal, np.random.default_rng(seed), size)
        better = best is None or last.weights.efficiency > BETTER * best.weights.efficiency
        proposals.insert(0 if better else len(proposals), proposal)
        if better:
            best = Adapted(proposal, last, size, spare=spare)
            weights = best.weights
            if best.carries and (weights.efficiency >= enough or weights.greatest <= EVEN):
                break
    return proposals, None if best is None else replace(best, evaluations=size * len(proposals))


def _inner_coordinates(linearised: Linearised) -> Iterator[Coordinates]:
    """Coordinates to try for the model's parameters, each built when those before did not do."""
    if linearised.count == 0:
        return
    yield PlainCoordinates()
    predictive = PredictiveCoordinates.at(linearised)
    if predictive is not None:
        yield predictive


def _adapt_plain(density: Density, mode: Mode, rng: np.random.Generator) -> Adapted:
    """One component in the coordinates of the density, and several for what is bent where one does not fit."""
    wide = _wide(mode)
    shape = shape_of(density, mode)
    centre = shape.coordinates.forward(mode.z[None])[0][0]
    bent = shape.blocks()[-1]
    bend = one_component(centre[bent], shape.covariance[np.ix_(bent, bent)])
    found = _refine(
        density, Proposal(shape.coordinates, shape.mixture(centre, [bend]), wide), rng, draws=2 * DRAWS
    )
    if found.weights.efficiency >= GOOD:
        return found
    several = shape.mixture(centre, [_spread(bend, rng, 6)])
    more = _refine(density, Proposal(shape.coordinates, several, wide), rng, draws=8 * DRAWS)
    better = more if more.weights.efficiency > found.weights.efficiency else found
    return replace(better, evaluations=found.evaluations + more.evaluations)


def _looked_around(density: Density, adapted: Adapted, rng: np.random.Generator) -> Adapted:
    """The same with the greatest weight that walkers meet who set out from its draws by differential evolution.

    A proposal fitted to its own draws can be blind to the end of a bend: no draw gets there, and weights look even.
    """
    own = weigh(density, adapted.proposal, rng, DRAWS)
    dimension = own.z.shape[1]
    walkers = max(AROUND[0], 2 * dimension + 2)
    if np.count_nonzero(own.weights.normalised) < walkers:
        return adapted
    start = own.z[rng.choice(len(own.z), size=walkers, replace=False, p=own.weights.normalised)]
    moves = differential_evolution(dimension)
    sampler = emcee.EnsembleSampler(walkers, dimension, density.log_prob, moves=moves, vectorize=True)
    stream = np.random.RandomState(np.random.MT19937(rng.integers(2**63)))
    state = State(start, random_state=stream.get_state())
    sampler.run_mcmc(state, AROUND[1], skip_initial_state_check=True)
    evaluations = adapted.evaluations + DRAWS + walkers * (AROUND[1] + 1)
    met = Adapted(adapted.proposal, own, 0).judged(
        sampler.get_chain(flat=True), sampler.get_log_prob(flat=True)
    )
    return replace(adapted, evaluations=evaluations, greatest_seen=met.greatest_seen)


def _start(
    coordinates: NoiseScaledCoordinates, mode: Mode, posterior: Posterior, rng: np.random.Generator
) -> Mixture:
    """Unit normal in the scaled coordinates of the model; for each channel's noise a fit to its marginal."""
    m = coordinates.count
    place = {int(f): i for i, f in enumerate(posterior.space.free_index)}
    centre = mode.z[m:]
    channels = [at for record_place in posterior.layout for at in record_place.blocks()]
    noise = [np.array([place[int(i)] for i in at if int(i) in place], dtype=np.int64) for at in channels]
    noise = [block for block in noise if block.size]
    alone = [int(block[0]) for block in noise if block.size == 1]
    fits = iter(_fit_alone(coordinates, centre, np.array(alone) - m, np.diag(mode.covariance)[alone]))
    parts = [StudentMixture(np.ones(1), np.zeros((1, m)), _standard(m), NEARLY_NORMAL)]
    for block in noise:
        if block.size == 1:
            parts.append(next(fits))
            continue
        covariance = mode.covariance[np.ix_(block, block)]
        marginal = coordinates.log_noise_marginal
        if block.size > ON_A_GRID and not posterior.noise.is_gaussian:
            # what is linear and normal tells little of the noise
            marginal = partial(_marginal_along_the_ridge, posterior, coordinates)
        parts.append(_fit_together(marginal, centre, block - m, covariance, rng))
    return FactorisedMixture((np.arange(m), *noise), tuple(parts))


def _standard(m: int) -> Floats:
    """Root (1, m, m) of the scale matrix with which what is nearly normal has unit variance."""
    return math.sqrt((NEARLY_NORMAL - 2.0) / NEARLY_NORMAL) * np.eye(m)[None]


def _fit_alone(
    coordinates: NoiseScaledCoordinates, centre: Floats, at: Ints, variance: Floats
) -> list[StudentMixture]:
    """Noise parameters that are the only ones of their channels: mean and variance of their linearised marginals.

    Each is looked at on a grid, with all others at the mode.
    """
    if at.size == 0:
        return []
    x = centre[at, None] + np.sqrt(variance)[:, None] * GRID
    noise_z = np.tile(centre, (at.size, GRID.size, 1))
    noise_z[np.arange(at.size), :, at] = x
    log_marginal = coordinates.log_noise_marginal(noise_z.reshape(-1, centre.size)).reshape(x.shape)
    fits = []
    for values, log_weight, least in zip(x, log_marginal, variance * (GRID[1] - GRID[0]) ** 2, strict=True):
        weight = Weights(log_weight).normalised
        mean = float(weight @ values)
        sd = math.sqrt(max(float(weight @ (values - mean) ** 2), least))
        fits.append(StudentMixture(np.ones(1), np.full((1, 1), mean), sd * _standard(1), NEARLY_NORMAL))
    return fits


def _marginal_along_the_ridge(
    posterior: Posterior, coordinates: NoiseScaledCoordinates, noise_z: Floats
) -> Floats:
    """Log posterior of the noise parameters (W,), up to a constant.

    The model's are taken as normal: it is the density itself at the centre of their coordinates, times their volume.
    """
    u = np.concatenate([np.zeros((len(noise_z), coordinates.count)), noise_z], axis=1)
    z, log_jacobian, found = coordinates.inverse(u)
    value = np.full(len(u), -np.inf)
    value[found] = posterior.log_prob(z[found]) - log_jacobian[found]
    return value


def _fit_together(
    marginal: Callable[[Floats], Floats],
    centre: Floats,
    block: Ints,
    covariance: Floats,
    rng: np.random.Generator,
) -> StudentMixture:
    """Several noise parameters of one channel: a mixture fitted to their linearised marginal, all others at the mode.

    The marginal is looked at on a grid along the axes of its covariance, which is that of the Laplace approximation
    at first, then that of the grid before.
    """
    if block.size <= ON_A_GRID:
        axis = np.linspace(GRID[0], GRID[-1], round(POINTS ** (1.0 / block.size)))
        grid = np.stack(np.meshgrid(*[axis] * block.size), axis=-1).reshape(-1, block.size)
        log_q = np.zeros(len(grid))
    else:  # a grid would be too coarse: points drawn from heavy tails, each by its weight
        heavy = StudentMixture(np.ones(1), np.zeros((1, block.size)), np.eye(block.size)[None], 4.0)
        grid = heavy.draw(rng, POINTS)
        log_q = heavy.log_density(grid)
    mean = centre[block]
    for _ in range(3):
        x = mean + grid @ np.linalg.cholesky(covariance).T
        noise_z = np.tile(centre, (len(x), 1))
        noise_z[:, block] = x
        weights = Weights(marginal(noise_z) - log_q)
        weight = weights.normalised if block.size <= ON_A_GRID else tempered(weights)
        mean = weight @ x
        covariance = ((x - mean) * weight[:, None]).T @ (x - mean) + 1e-3 * covariance
    first = StudentMixture.from_covariances(np.ones(1), mean[None], covariance[None], 5.0)
    fitted = _spread(first, rng, 4).refitted(x, weight, rounds=15)
    return StudentMixture(
        np.append(0.9 * fitted.weight, 0.1),
        np.concatenate([fitted.mean, mean[None]]),
        np.concatenate([fitted.root, 3.0 * first.root]),
        first.df,
    )


def _refine(
    density: Density, proposal: Proposal, rng: np.random.Generator, draws: int, held: float = 0.0
) -> Adapted:
    """Rounds of importance draws until the efficiency is good or stays, each fitting the proposal anew.

    A single component that is good is fitted once more, to all draws so far, which costs no evaluation. Several
    are not, and stand on their last round alone: the better they fit draws of their own, the more they lose of a
    bent density that they hardly reach.
    """
    nothing = Weighed(proposal.wide.mean, np.full(1, -np.inf), np.zeros(1))
    best = Adapted(proposal, nothing, 0)
    evaluations = worse = 0
    rounds = _Rounds()
    several = proposal.narrow.components > 1
    for _ in range(ROUNDS):
        z, log_q, u, back = proposal.draw_with_coordinates(rng, draws)
        last = Weighed.of(density.log_prob, z, log_q)
        weights = last.weights
        evaluations += draws
        worse = 0 if weights.efficiency > 1.1 * best.weights.efficiency else worse + 1
        good = weights.efficiency >= GOOD
        if weights.efficiency > best.weights.efficiency:
            best = Adapted(proposal, last, evaluations)
        if (worse >= 2 and not good) or (good and several):
            break
        rounds.add(last, u, back, alone=several)
        fitted = rounds.fit(proposal, held)
        if fitted is None:
            break
        if good:
            return Adapted(fitted, last, evaluations, own=False)
        proposal = fitted
    return replace(best, evaluations=evaluations)


class _Rounds:
    """Weighted draws of several proposals in the same coordinates, for one density."""

    def __init__(self) -> None:
        self.z: list[Floats] = []
        self.u: list[Floats] = []
        self.weight: list[Floats] = []

    def add(self, drawn: Weighed, u: Floats, back: Bools, alone: bool) -> None:
        """Add a round with its coordinates; if it is to stand alone, or needs tempering, those before are forgotten."""
        weights = drawn.weights
        if alone or weights.efficiency < LEAST:
            self.z, self.u, self.weight = [], [], []
        usable = np.isfinite(weights.log_weight)
        if not usable.any():
            return
        weight = tempered(Weights(weights.log_weight[usable]))
        self.z.append(drawn.z[usable])
        self.u.append(u[usable])
        # draws of a good proposal count for more
        self.weight.append(back[usable] * weight / np.sum(weight**2))

    def fit(self, proposal: Proposal, held: float) -> Proposal | None:
        """The proposal fitted to all draws; None where they are too few."""
        if sum(map(len, self.z)) < 2 * proposal.wide.dimension:
            return None
        z, u, weight = np.concatenate(self.z), np.concatenate(self.u), np.concatenate(self.weight)
        if weight.sum() <= 0:
            return None
        weight = weight / weight.sum()
        narrow = proposal.narrow.refitted(u, weight, rounds=3, held=held)
        return replace(proposal, narrow=narrow, wide=_widened(proposal.wide, z, weight))


def _widened(wide: StudentMixture, z: Floats, weight: Floats) -> StudentMixture:
    """Wide component with the covariance that it had or four times that of weighted draws, whichever is larger."""
    mean = weight @ z
    centred = z - mean
    covariance = 4.0 * (centred * weight[:, None]).T @ centred
    before = wide.root[0] @ wide.root[0].T * wide.df / (wide.df - 2.0)
    if np.linalg.slogdet(covariance)[1] < np.linalg.slogdet(before)[1]:
        return wide
    return StudentMixture.from_covariances(np.ones(1), mean[None], covariance[None], wide.df)


def weigh(density: Density, proposal: AnyProposal, rng: np.random.Generator, size: int) -> Weighed:
    """Draw from a proposal, and weigh the draws."""
    return Weighed.of(density.log_prob, *proposal.draw(rng, size))


def _spread(mixture: StudentMixture, rng: np.random.Generator, count: int) -> StudentMixture:
    """Several components drawn from one, so that a fit can bend around a curved density."""
    means = mixture.draw(rng, count)
    return StudentMixture(
        np.full(count, 1.0 / count), means, np.repeat(mixture.root[:1], count, axis=0), mixture.df
    )
