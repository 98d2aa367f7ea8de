"""Ensembles: independent groups of walkers, run until the draws reach a stated target.

The plan of a run, each stage only where the one before does not suffice:

1. linearise the response at the least-squares optimum for a proposal; where that is not good, climb to the modes from
   the optima and fit a proposal to each (`adaptation`);
2. independence moves with that proposal from its own weighted draws, in at least four groups that share nothing
   but the proposal;
3. an audit of the proposal, which looks for what it hardly draws (`audit`); what fails is mended by what was met, and
   run and audited again;
4. where the proposal does not carry (low efficiency, a single weight too large), does not pass or misses the target,
   the same with one that is made to reach further;
5. where that does not do either, explore with differential evolution from dispersed starts and fit again to what was
   found;
6. independence moves with that, audited too, or, where it does not carry either, both kinds of move together.

A run stops when every parameter has reached the target on R-hat, effective sample size and the errors of its outer
quantiles and standard deviation, never on a count of steps. If the greatest allowed effort is spent first, the draws
are returned and called not converged. To cross-check by hand a run can be made with differential evolution or stretch
moves alone (`SAMPLERS`).
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from emcee.moves import Move
from emcee.state import State

from sma_bayes.arrays import Floats
from sma_bayes.sampling.adaptation import (
    GREATEST_WEIGHT,
    USABLE_EFFICIENCY,
    Adapted,
    adapt,
    with_wide_share,
)
from sma_bayes.sampling.audit import Audit, Audited, audited, reaching_further
from sma_bayes.sampling.bridge import Evidence, bridge_evidence
from sma_bayes.sampling.checkpoint import Checkpoint, StepBlock
from sma_bayes.sampling.convergence import PUBLISHED_TARGET, Convergence, Target, assess
from sma_bayes.sampling.density import Density, Linearisable
from sma_bayes.sampling.ensemble_sampler import EnsembleSampler
from sma_bayes.sampling.laplace import Mode, distinct_modes, find_mode
from sma_bayes.sampling.moves import (
    SAMPLERS,
    IndependenceMove,
    MultipleProposalMove,
    Sampler,
    differential_evolution_of,
)
from sma_bayes.sampling.refitting import adapt_to_draws
from sma_bayes.sampling.weighted import Weights


@dataclass(frozen=True, slots=True)
class Plan:
    """How ensembles are run.

    Attributes
    ----------
    target : Target
    groups : int
        Independent ensembles, at least 4.
    walkers : int
        Walkers of a group; raised to twice the dimension where that is more.
    block : int
        Steps of the first block of independence moves, at least.
    explore_block : int
        Steps of a block with differential evolution.
    evaluations : int
        Greatest number of evaluations of the density.
    greatest_weight : float
        Greatest importance weight, as a multiple of the mean weight, with which independence moves go on.
    sampler : Sampler
        One of `SAMPLERS`.
    """

    target: Target = PUBLISHED_TARGET
    groups: int = 4
    walkers: int = 64
    block: int = 6
    explore_block: int = 250
    evaluations: int = 6_000_000
    greatest_weight: float = GREATEST_WEIGHT
    sampler: Sampler = SAMPLERS["independence"]

    def __post_init__(self) -> None:
        if self.groups < 4:
            raise ValueError(f"{self.groups} groups: at least 4 independent ensembles are needed for R-hat")


@dataclass(frozen=True, eq=False)
class Draws:
    """What ensembles give.

    Attributes
    ----------
    z : ndarray, shape (G, S, W, D)
        Ensembles, steps, walkers, sampled coordinates; burn-in removed.
    log_prob : ndarray, shape (G, S, W)
    convergence : Convergence
    acceptance : float
        Share of accepted proposals.
    evaluations : int
        Evaluations of the density, all stages together.
    method : str
        One of `METHODS`, or, where the plan asks for it, ``differential evolution`` or ``stretch``.
    modes : tuple of Mode
    efficiency, greatest_weight : float
        Of the importance weights of all proposals (see `Weights`).
        Not numbers where there were no such proposals.
    ln_evidence, ln_evidence_sd : float
        Log of the integral of likelihood times prior, and its standard error: by importance sampling with the
        proposals of the run, and with those of the audit where the run hardly draws; by bridge sampling from the
        draws where moves of another kind made them.
    audit : Audit or None
        Of the proposal; None where differential evolution or stretch moves had a part in the draws, which don't depend
        on what a proposal draws.
    """

    z: Floats
    log_prob: Floats
    convergence: Convergence
    acceptance: float
    evaluations: int
    method: str
    modes: tuple[Mode, ...]
    efficiency: float
    greatest_weight: float
    ln_evidence: float
    ln_evidence_sd: float
    audit: Audit | None


INDEPENDENCE, MENDED, REFITTED, MIXED = METHODS = (
    "independence",
    "independence after an audit",
    "independence after differential evolution",
    "independence and differential evolution",
)
"""Moves that made the draws, in the order in which they are tried: those of a first proposal, of one that an audit
found wanting and that was mended, of one fitted to what differential evolution had found, and both together."""

PREDRAWN_STEPS = 16
"""Steps of independence moves whose proposals are drawn and evaluated at once, where other moves are made between."""

TRIES = ("independence", "wider")
"""Tries with independence moves alone, before walkers are sent out."""
WIDENINGS, WIDE_ENOUGH = 6, 0.5
"""How often, at most, a posterior's proposal is made to reach further before the second try, and the efficiency at
which it reaches far enough."""

MAX_MENDINGS = 3
"""How often a proposal that does not pass its audit is mended."""
MAX_BRIDGE_DRAWS, LEAST_BRIDGE_DRAWS = 8000, 500
"""Draws, at most and at least, from which the evidence is bridged."""
MAX_EXPLORATION_BLOCKS = 4
"""Blocks of steps that explore, at most."""
EXPLORED_RHAT = 1.05
"""R-hat at which walkers have explored."""
EXPLORED_TIMES, SEEN_TIMES, MIXED_TIMES = 10.0, 1.0, 20.0
"""Autocorrelation times that each walker must have moved for, to have explored, to have seen and to have converged.

Walkers that start near a mode and creep along a bent ridge agree with each other long before they have come to its
ends, and the more walkers there are the sooner they add up to the target: of 20 runs on a narrow banana all had
reached it, with standard deviations a fifth too small. What can be linearised need but be seen for a proposal to be
fitted: in its own coordinates it is hardly bent, an audit looks beyond, and where that is not passed it is explored
further."""

MAX_INDEPENDENCE_STEPS, MAX_SD_STEPS = 384, 1536
"""Steps of independence moves, at most, for all but standard deviations, and for these, once the rest is told and the
proposal has passed its audit. Of skewed parameters the outer quantiles take some thirty thousand draws, of heavy tails
the standard deviation some three hundred thousand, which other moves would take a hundred times as long to make."""
MAX_SD_EXTENSION = 4
"""How many times as long a run of other moves may become for the sake of standard deviations alone."""
MAX_SET_STEPS = 256
"""Steps that share one set of proposals, at most: choosing among them takes a time that grows with the square."""
MAX_EXTENSION, MAX_EXTENSION_MENDED = 1.5, 3.0
"""How many times as long a run may become for the sake of its audit, before its proposal is mended instead: one that
was mended already is hardly made better by mending it again."""
DRAWS_PER_EFFECTIVE = 1.37
"""Draws that must count for each effective one that is asked for, so that the first block of steps mostly does: each of
some thirty effective sample sizes is an estimate, and the least of them decides."""
SPARE_DRAWS = 1.15
"""What is asked for beyond the effective draws that lack, whose number is itself an estimate."""
MAX_BLOCKS = 3
"""Blocks at once, at most."""
LEAST_STEPS = 4
"""Steps at least of a further block of independence moves: of few proposals a walker has little to choose from."""

ASSESSMENT_GROWTH = 1.2
"""By how much a chain must have grown to be assessed again."""
MAX_ASSESSED_STEPS = 500
"""Steps of a chain, evenly spaced, by which it is assessed, at most. Where each walker has moved for `MIXED_TIMES`
autocorrelation times one of these is 25 steps long and more, and nothing is lost; assessing all steps of long chains
takes several times as long as making them."""

Progress = Callable[[str], None]


def sample(
    density: Density,
    starts: Sequence[Floats] | Sequence[Mode],
    width: Floats,
    seed: np.random.SeedSequence,
    plan: Plan | None = None,
    *,
    checkpoint: Path | None = None,
    fingerprint: str = "",
    progress: Progress | None = None,
) -> Draws:
    """Sample a density with independent ensembles.

    Parameters
    ----------
    density : Density
    starts : sequence of ndarray, shape (D,), or of Mode
        Points from which modes are climbed to, or modes where they are known.
    width : ndarray, shape (D,)
        Greatest plausible standard deviation of each coordinate: that of the prior.
    seed : numpy.random.SeedSequence
        Seed of all random draws.
    plan : Plan, optional
    checkpoint : Path, optional
        File to which blocks of steps are written and from which an interrupted run goes on. The draws are the
        same to the bit as those of a run that was not interrupted.
    fingerprint : str
        Of the density, for the checkpoint.
    progress : callable, optional
        Told in a few words what is going on.
    """
    return _Run(density, width, seed, plan or Plan(), checkpoint, fingerprint, progress).go(starts)


def _steps_hoped(efficiency: float, chains: int, plan: Plan) -> int:
    """Steps with which a block should reach the target, where so large a share of the proposals count.

    `MAX_BLOCKS` times the least number at most: what is lost with a run that is killed is the block that it is at.
    """
    hoped = math.ceil(DRAWS_PER_EFFECTIVE * plan.target.draws / (chains * efficiency))
    return min(MAX_BLOCKS * plan.block, max(plan.block, hoped))


def _steps_lacking(convergence: Convergence, length: int, target: Target, block: int) -> int:
    """Steps to go on for, after so many: by what lacks in effective draws, as many again at most."""
    least = float(np.minimum(convergence.ess_bulk, convergence.ess_tail).min())
    short = max(
        target.ess / least,
        float(np.max(convergence.quantile_error / target.quantile_error)) ** 2,
        float(np.max(convergence.sd_error / target.sd_error)) ** 2,
    )
    if not (least > 0.0 and short > 1.0):  # it is R-hat that lacks, or there is no telling
        return block
    lacking = length * (SPARE_DRAWS * short - 1.0)
    return min(length, max(LEAST_STEPS, math.ceil(lacking)))


class _Run:
    """One call of `sample`: the stages, and what they share."""

    def __init__(
        self,
        density: Density,
        width: Floats,
        seed: np.random.SeedSequence,
        plan: Plan,
        checkpoint: Path | None,
        fingerprint: str,
        progress: Progress | None,
    ) -> None:
        self.density = density
        self.width = width
        self.plan = plan
        self.walkers = max(plan.walkers, 2 * width.size + 2)
        self.seed = seed
        self.tell = progress or (lambda _: None)
        self.evaluations = 0
        self.checkpoint = None
        if checkpoint is not None:
            whole = hashlib.sha256(
                f"{fingerprint} {seed.entropy} {seed.spawn_key} {plan}".encode()
            ).hexdigest()
            self.checkpoint = Checkpoint(checkpoint, whole)

    # what is counted is what the density is asked, whoever asks
    @property
    def names(self) -> tuple[str, ...]:
        return self.density.names

    def log_prob(self, z: Floats) -> Floats:
        self.evaluations += len(z)
        return self.density.log_prob(z)

    @property
    def spent(self) -> bool:
        """Whether the greatest effort was made: what is under way comes to its end, and nothing else is tried."""
        return self.evaluations >= self.plan.evaluations

    def go(self, starts: Sequence[Floats] | Sequence[Mode]) -> Draws:
        first, explore_seed, run_first, run_second, groups_seed, second, *_, self.audit_seed = (
            self.seed.spawn(9)
        )
        by_hand = self.plan.sampler
        modes, adapted = self._at_the_modes(starts, first)
        if by_hand.moves is not None:
            moves = by_hand.moves(self.width.size)
            return self._by_moves(by_hand.title, moves, adapted, modes, groups_seed)
        if adapted.carries:
            draws = self._audited_independence("independence", adapted, modes, run_first)
            if draws is not None:
                return draws
        if adapted.carries or isinstance(self.density, Linearisable):
            adapted = self._second_try(adapted, modes, np.random.default_rng(second))
        if adapted.carries:
            draws = self._audited_independence("wider", adapted, modes, run_second)
            if draws is not None:
                return draws
        return self._explore(adapted, modes, np.random.default_rng(explore_seed), groups_seed)

    def _at_the_modes(
        self, starts: Sequence[Floats] | Sequence[Mode], seed: np.random.SeedSequence
    ) -> tuple[tuple[Mode, ...], Adapted]:
        """The modes that are climbed to from the starts, and a proposal fitted there."""
        self.tell("finding the modes")
        modes = self._modes(starts)
        adapted = adapt(self.density, modes, np.random.default_rng(seed))
        self.evaluations += adapted.evaluations
        return modes, adapted

    def _modes(self, starts: Sequence[Floats] | Sequence[Mode]) -> tuple[Mode, ...]:
        found = []
        for start in starts:
            mode = start if isinstance(start, Mode) else find_mode(self.density, start, self.width)
            if mode is not None:
                found.append(mode)
                self.evaluations += mode.evaluations
        if not found:
            raise ValueError("the density is zero at every start")
        return distinct_modes(found)

    def _second_try(self, adapted: Adapted, modes: tuple[Mode, ...], rng: np.random.Generator) -> Adapted:
        """A proposal after one that did not carry a run, or seemed to.

        Of a density that can be linearised the same one, made to reach further until it is good or has been tried
        often enough. Another has no coordinates of its own to do so in: it is fitted once more, to other draws, with a
        wide share.
        """
        if not isinstance(self.density, Linearisable):
            again = adapt(self.density, modes, rng)
            self.evaluations += again.evaluations
            return with_wide_share(again)
        best = None
        for _ in range(WIDENINGS):
            self.tell("widening a proposal that is too narrow")
            adapted = reaching_further(self.density, adapted, self.width, rng)
            self.evaluations += adapted.evaluations
            if best is None or adapted.weights.efficiency > best.weights.efficiency:
                best = adapted
            if adapted.weights.efficiency >= WIDE_ENOUGH or self.spent:
                break
        return best or adapted

    def _audited_independence(
        self, name: str, adapted: Adapted, modes: tuple[Mode, ...], seed: np.random.SeedSequence
    ) -> Draws | None:
        """Independence moves that pass their audit, if need be with the proposal mended; None if they don't suffice."""
        method = INDEPENDENCE if name in TRIES else REFITTED
        draws = self._independence(name, adapted, modes, seed, method)
        if not isinstance(draws, Audited):
            return draws
        for again, (mend_seed, run_seed) in enumerate(
            (s.spawn(2) for s in seed.spawn(MAX_MENDINGS)), start=1
        ):
            self.tell("improving a proposal that failed its audit")
            adapted = draws.mended(self.density, adapted.proposal, np.random.default_rng(mend_seed))
            self.evaluations += adapted.evaluations
            if not adapted.carries or self.spent:
                return None
            method = method if name not in TRIES else MENDED
            draws = self._independence(
                f"{name}-mended-{again}", adapted, modes, run_seed, method, longest=MAX_EXTENSION_MENDED
            )
            if not isinstance(draws, Audited):
                return draws
        return None

    def _independence(
        self,
        name: str,
        adapted: Adapted,
        modes: tuple[Mode, ...],
        seed: np.random.SeedSequence,
        method: str,
        longest: float = MAX_EXTENSION,
    ) -> Draws | Audited | None:
        """Independence moves alone; their audit if they don't pass it, None if they don't get so far.

        For the sake of its audit a run becomes `longest` times as long as its target asks, at most. What standard
        deviations ask for beyond is drawn after that; where they are not told by `MAX_SD_STEPS`, no other proposal is
        tried, and the draws are not converged.

        No walker's move looks at another walker, so that any of them are independent of the rest: all groups are
        run as one ensemble and told apart afterwards, which spares the work of a step for each of them.
        """
        plan = self.plan
        more = _steps_hoped(adapted.weights.efficiency, plan.groups * self.walkers, plan)
        group = _Ensemble(self, name, adapted, seed, None, more, copies=plan.groups)
        let_pass = plan.greatest_weight
        but_sd, passed = replace(plan.target, sd_error=math.inf), False
        asked = 0  # steps that an audit asks for
        reached = 0  # steps after which all but standard deviations are told
        # a great weight, or few that count, call for an audit at once; after one that is passed they go on
        most = MAX_INDEPENDENCE_STEPS
        while group.length < max(most, asked) and not (group.length and self.spent):
            self.tell(f"independence moves, from step {group.length + 1}")
            group.advance(more)
            weights = Weights(group.log_weight)
            convergence = assess(group.chains, plan.target)
            last = convergence.converged or group.length >= MAX_SD_STEPS or self.spent
            doubtful = weights.greatest > let_pass or weights.efficiency < USABLE_EFFICIENCY
            told = convergence.reaches(but_sd)
            if group.length >= asked and (doubtful or (told and (last or not passed))):
                if told:
                    reached = reached or group.length
                enough = reached or group.length
                z = group.chain.reshape(-1, self.width.size)
                rng = np.random.default_rng(self.audit_seed)
                times = group.length / enough
                found = audited(self.density, adapted.proposal, group.log_weight, z, self.width, rng, times)
                self.evaluations += found.evaluations
                asked = math.ceil(min(found.longer, longest + 1.0) * group.length)
                if found.longer > 1.0 and asked > longest * enough:
                    return found
                let_pass = max(let_pass, 2.0 * weights.greatest)
                passed = found.audit.passed and told
                if passed and last:
                    return self._draws([group], 0, convergence, modes, method, found.evidence, found.audit)
            most = MAX_SD_STEPS if passed else MAX_INDEPENDENCE_STEPS
            more = _steps_lacking(convergence, group.length, plan.target if passed else but_sd, plan.block)
            if passed:
                more = min(more, MAX_SD_STEPS - group.length)
            more = max(more, min(asked - group.length, group.length))
        return None

    def _by_moves(
        self,
        method: str,
        moves: list[tuple[Move, float]],
        adapted: Adapted,
        modes: tuple[Mode, ...],
        seed: np.random.SeedSequence,
    ) -> Draws:
        """Moves that look at other walkers alone, from starts dispersed about the modes."""
        plan = self.plan
        *seeds, evidence_seed = seed.spawn(plan.groups + 1)
        groups = [
            _Ensemble(self, f"{plan.sampler.name}-{g}", adapted, s, moves, plan.explore_block, modes=modes)
            for g, s in enumerate(seeds)
        ]
        return self._until_mixed(groups, modes, method, np.random.default_rng(evidence_seed))

    def _explore(
        self,
        adapted: Adapted,
        modes: tuple[Mode, ...],
        rng: np.random.Generator,
        seed: np.random.SeedSequence,
    ) -> Draws:
        """Differential evolution from dispersed starts, then both kinds of move with a proposal fitted to it."""
        plan = self.plan
        explore_seed, mixed_seed, tries_seed = seed.spawn(3)
        if self.spent:
            return self._mixed(adapted, modes, rng, mixed_seed)
        evolution = differential_evolution_of(plan.groups, self.width.size)
        group = _Ensemble(
            self, "explore", adapted, explore_seed, evolution, plan.explore_block,
            copies=plan.groups, modes=modes,
        )  # fmt: skip
        times = SEEN_TIMES if isinstance(self.density, Linearisable) else EXPLORED_TIMES
        enough = Target(EXPLORED_RHAT, times * plan.groups * self.walkers)
        tries = tries_seed.spawn(MAX_EXPLORATION_BLOCKS)
        fits: list[Adapted] = []
        for block in range(1, MAX_EXPLORATION_BLOCKS + 1):
            self.tell(f"exploring with differential evolution, block {block}")
            group.advance()
            late = group.chains[:, group.length // 2 :]
            z = late.reshape(-1, self.width.size)
            if self.spent:
                break
            explored = assess(late, enough).converged
            if not explored and block < MAX_EXPLORATION_BLOCKS:
                continue
            fitted = adapt_to_draws(self.density, z, modes, rng)
            self.evaluations += fitted.evaluations
            if isinstance(self.density, Linearisable) and not fitted.carries:
                fitted = reaching_further(self.density, fitted, self.width, rng)
                self.evaluations += fitted.evaluations
            fits = [fitted]
            if explored and fitted.carries and not self.spent:
                draws = self._audited_independence(f"refitted-{block}", fitted, modes, tries[block - 1])
                if draws is not None:
                    return draws
            if self.spent or (explored and times == EXPLORED_TIMES):
                break
        thin = math.ceil(len(z) / 4000)
        log_prob = group.log_probs[:, group.length // 2 :].ravel()
        adapted = max([*fits, adapted.judged(z[::thin], log_prob[::thin])], key=lambda a: a.acceptance)
        return self._mixed(adapted, modes, rng, mixed_seed, group.chain[-1])

    def _mixed(
        self,
        adapted: Adapted,
        modes: tuple[Mode, ...],
        rng: np.random.Generator,
        seed: np.random.SeedSequence,
        start: Floats | None = None,
    ) -> Draws:
        """Both kinds of move together, from where walkers are, or from starts dispersed about the modes."""
        accepted = adapted.weights.efficiency if start is None else adapted.acceptance
        share = 0.5 if accepted > 0.1 else 0.1
        adapted = with_wide_share(adapted)  # a walker far out in a tail is to come back
        group = _Ensemble(
            self, "mixed", adapted, seed, differential_evolution_of(self.plan.groups, self.width.size),
            self.plan.explore_block, copies=self.plan.groups, independence=share, start=start,
            modes=modes if start is None else (),
        )  # fmt: skip
        return self._until_mixed([group], modes, MIXED, rng)

    def _until_mixed(
        self, groups: Sequence[_Ensemble], modes: tuple[Mode, ...], method: str, rng: np.random.Generator
    ) -> Draws:
        """Blocks of steps until each walker has moved for many autocorrelation times, or the effort is spent.

        For the sake of standard deviations alone a run becomes `MAX_SD_EXTENSION` times as long, at most.
        """
        plan = self.plan
        block, look, most = 0, 1, math.inf
        while True:
            block += 1
            self.tell(f"{method}, block {block}")
            for group in groups:
                group.advance()
            if block < look and not self.spent:
                continue
            look = math.ceil(ASSESSMENT_GROWTH * block)
            burn = groups[0].length // 4
            thin = math.ceil((groups[0].length - burn) / MAX_ASSESSED_STEPS)
            ess = max(plan.target.ess, MIXED_TIMES * plan.groups * self.walkers)
            target = replace(plan.target, ess=ess)
            convergence = assess(np.concatenate([g.chains[:, burn::thin] for g in groups]), target)
            if convergence.reaches(replace(target, sd_error=math.inf)):
                most = min(most, MAX_SD_EXTENSION * block)
            if convergence.converged or self.spent or block >= most:
                z = np.concatenate([g.chains[:, burn:] for g in groups]).reshape(-1, self.width.size)
                # of draws that hang together so many count as the least effective sample size says
                count = int(
                    np.clip(
                        np.nan_to_num(convergence.ess_bulk.min()),
                        min(len(z), LEAST_BRIDGE_DRAWS),
                        MAX_BRIDGE_DRAWS,
                    )
                )
                few = z[np.linspace(0, len(z) - 1, min(len(z), count)).astype(int)]
                evidence = bridge_evidence(self.density, few, np.zeros(len(few)), rng)
                return self._draws(groups, burn, convergence, modes, method, evidence)

    def _draws(
        self,
        groups: Sequence[_Ensemble],
        burn: int,
        convergence: Convergence,
        modes: tuple[Mode, ...],
        method: str,
        evidence: Evidence,
        audit: Audit | None = None,
    ) -> Draws:
        log_weight = np.concatenate([g.log_weight for g in groups])
        weights = Weights(log_weight) if log_weight.size else None
        return Draws(
            z=np.concatenate([g.chains[:, burn:] for g in groups]),
            log_prob=np.concatenate([g.log_probs[:, burn:] for g in groups]),
            convergence=convergence,
            acceptance=float(np.mean([g.acceptance for g in groups])),
            evaluations=self.evaluations,
            method=method,
            modes=modes,
            efficiency=math.nan if weights is None else weights.efficiency,
            greatest_weight=math.nan if weights is None else weights.greatest,
            ln_evidence=evidence.value,
            ln_evidence_sd=evidence.sd,
            audit=audit,
        )


class _Ensemble:
    """One ensemble, run a block at a time; blocks that a checkpoint holds are read instead of run.

    With `copies`, as many ensembles side by side, for moves that never look at another walker.
    """

    def __init__(
        self,
        run: _Run,
        name: str,
        adapted: Adapted,
        seed: np.random.SeedSequence,
        moves: list[tuple[Move, float]] | None,
        steps: int,
        *,
        copies: int = 1,
        independence: float = 0.0,
        start: Floats | None = None,
        modes: Sequence[Mode] = (),
    ) -> None:
        self.run = run
        self.copies = copies
        self.walkers = copies * run.walkers
        self.name = name
        self.steps = steps
        self.move: MultipleProposalMove | IndependenceMove
        if moves is None:
            self.move = MultipleProposalMove(adapted.proposal, steps)
            chosen: list[tuple[Move, float]] = [(self.move, 1.0)]
        else:
            self.move = IndependenceMove(adapted.proposal, PREDRAWN_STEPS)
            chosen = [(move, share * (1.0 - independence)) for move, share in moves]
            if independence > 0.0:
                chosen.append((self.move, independence))
        self.sampler = EnsembleSampler(self.walkers, run.width.size, run.log_prob, chosen)
        start_seed, chain_seed = seed.spawn(2)
        self.sampler.seed_stream(chain_seed)
        if modes:
            coords, log_prob = self._dispersed(adapted, np.random.default_rng(start_seed), modes)
        elif start is None:
            chosen_starts = adapted.last.chosen(copies, run.walkers, np.random.default_rng(start_seed))
            coords, log_prob = (np.concatenate(each) for each in chosen_starts)
        else:
            coords, log_prob = start, run.log_prob(start)
        # without a state of random numbers those of the sampler go on
        self.state = State(coords, log_prob=log_prob)
        self._blocks: list[StepBlock] = []
        self._stored = iter(()) if run.checkpoint is None else run.checkpoint.blocks(name)

    def _dispersed(
        self, adapted: Adapted, rng: np.random.Generator, modes: Sequence[Mode]
    ) -> tuple[Floats, Floats]:
        """Starts of positive density about modes and from the proposal, and its log."""
        run = self.run
        centre = np.stack([m.z for m in modes])
        root = np.stack([np.linalg.cholesky(m.covariance) for m in modes])
        found: list[Floats] = []
        values: list[Floats] = []
        count = 0
        while count < self.walkers:
            z = adapted.proposal.draw(rng, self.walkers + self.walkers // 8)[0]
            which = rng.integers(len(modes), size=len(z))
            near = centre[which] + 2.0 * np.einsum("wij,wj->wi", root[which], rng.standard_normal(z.shape))
            z = np.where(rng.random(len(z))[:, None] < 0.5, z, near)
            z = z[np.isfinite(z).all(axis=1)]
            if not len(z):
                continue
            log_prob = run.log_prob(z)
            usable = np.isfinite(log_prob)
            found.append(z[usable])
            values.append(log_prob[usable])
            count += int(usable.sum())
        return np.concatenate(found)[: self.walkers], np.concatenate(values)[: self.walkers]

    def advance(self, steps: int | None = None) -> None:
        """Run one more block, or read it; with moves of independence alone, one of so many `steps` at least."""
        block = next(self._stored, None)
        if block is None:
            if steps is not None:
                sets = math.ceil(steps / MAX_SET_STEPS)
                self.move.steps = math.ceil(steps / sets)
                self.steps = sets * self.move.steps
            block = self._sample(self.steps)
            if self.run.checkpoint is not None:
                self.run.checkpoint.append(self.name, block)
        else:  # the budget must not depend on whether the run was interrupted
            self.run.evaluations += block.evaluations
        self._blocks.append(block)
        self.state = State(block.chain[-1], log_prob=block.log_prob[-1], random_state=block.random_state)

    def _sample(self, steps: int) -> StepBlock:
        self.move.start_block()
        self.move.log_weights.clear()
        self.sampler.reset()
        before = self.run.evaluations
        for _ in self.sampler.sample(self.state, iterations=steps, skip_initial_state_check=True):
            pass
        weights = self.move.log_weights
        return StepBlock(
            np.asarray(self.sampler.get_chain(), dtype=float),
            np.asarray(self.sampler.get_log_prob(), dtype=float),
            np.asarray(self.sampler.backend.accepted, dtype=float),
            np.concatenate(weights) if weights else np.empty(0),
            self.sampler.stream_state(),
            self.run.evaluations - before,
        )

    @property
    def length(self) -> int:
        """Steps so far."""
        return sum(len(b.chain) for b in self._blocks)

    @property
    def chain(self) -> Floats:
        """Steps so far, shape (S, W, D)."""
        return np.concatenate([b.chain for b in self._blocks])

    @property
    def chains(self) -> Floats:
        """Steps so far, the ensembles apart, shape (copies, S, W, D)."""
        return self._apart(self.chain)

    @property
    def log_probs(self) -> Floats:
        """Log-probability of the steps so far, shape (copies, S, W)."""
        return self._apart(np.concatenate([b.log_prob for b in self._blocks]))

    def _apart(self, values: Floats) -> Floats:
        steps, walkers, *rest = values.shape
        return np.moveaxis(values.reshape(steps, self.copies, walkers // self.copies, *rest), 1, 0)

    @property
    def log_weight(self) -> Floats:
        """Importance weights of all independence proposals so far."""
        return np.concatenate([b.log_weight for b in self._blocks])

    @property
    def acceptance(self) -> float:
        """Share of accepted proposals."""
        return float(np.mean(sum(b.accepted for b in self._blocks)) / self.length)
