"""The loop: locate, name, add, look again."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.effects import EFFECTS, Effect
from sma_bayes.effects.needs import of_response
from sma_bayes.fitting.posterior import build_posterior
from sma_bayes.fitting.warm_start import warm_start
from sma_bayes.noise import NOISE_MODELS
from sma_bayes.parameters.priors_file import PriorSet
from sma_bayes.quantities import CHANNELS
from sma_bayes.records.history import History, histories
from sma_bayes.records.types import Branch, Campaign
from sma_bayes.response.base import ResponseModel
from sma_bayes.response.modified_sigmoid import ModifiedSigmoid
from sma_bayes.studies.gap.effect_form import EffectForms
from sma_bayes.studies.gap.fitting import (
    FittedHypothesis,
    added_by,
    fit_hypothesis,
    fit_with_noise,
    in_steady_noise,
    remembers_long,
)
from sma_bayes.studies.gap.flexible import FlexibleTerms, gains, offer, terms_of, worth_of
from sma_bayes.studies.gap.hypothesis import Hypothesis, baseline
from sma_bayes.studies.gap.jumps import Jump, Jumps
from sma_bayes.studies.gap.locate import SHUFFLES, Disagreement, DisagreementTest, disagreements, look
from sma_bayes.studies.gap.name import (
    LEAST_LN_BAYES_FACTOR,
    MAX_REFITS,
    MISFIT_LN_BAYES_FACTOR,
    MOST_SHARE_OF_FORM,
    Candidate,
    Rivals,
    candidates,
    is_beyond_shape,
    judged,
    screen,
    screen_all,
    share_of,
    signature_at_mode,
)
from sma_bayes.studies.gap.one_stage import OneStageShapes
from sma_bayes.studies.gap.scatter import (
    LEAST_SHARE_OF_LAW,
    FollowedSetting,
    followed_setting,
    holds_beside,
    members_of,
)
from sma_bayes.studies.gap.schema import StatedPeriodicity, Verdict

SIGNIFICANT_P = 0.02
"""Global p-value up to which a disagreement counts as more than chance."""
LN_BAYES_FACTOR_TOLD_APART = 3.0
"""Least difference of ln Bayes factors by which data tell two effects apart."""
LEAST_SHARE_CARRIED = 0.85
"""Share that all effects together must carry of what they and flexible terms on top of them explain, shape apart."""
LEAST_FURTHER_SHARE = 0.2
"""Share of what the effects before it explain that a further one must bring: less may be the form of these."""
LEAST_FURTHER_SHARE_OF_LAST = 0.5
"""Share of that which is enough where nothing is left to explain afterwards: what a form leaves has no such end."""
LEAST_SHARE_BESIDE_FORMS = 0.03
"""Share of what a further effect explains that it must explain beside other forms of those before it, in any case. What
the second laws of the gap benchmark leave of their effects has 0.025 at most, and 0.013 where it would get a name;
another effect 0.05 to 1."""
ENOUGH_SHARE_BESIDE_FORMS = 0.2
"""That share from which on a law is enough however little it explains beside those before it."""
MAX_FIRST_EFFECTS = 3
"""How many effects, best first, are tried as the first of several where no single one is added."""
MAX_EFFECTS_AT_ONCE = 3
"""How many effects are added at once, at most."""
LEAST_SHARE_OF_TWO = 0.5
"""What two effects must explain of what the best flexible term does, for a third to be tried beside them."""
MAX_PAIRS = 2
"""Sets of two effects, best first, beside which a third is tried."""
SHUFFLES_OF_SEVERAL = 100
"""Shuffles of the looks between several effects that are added at once."""
MAX_EFFECTS = 4
"""Greatest number of effects that are added."""


@dataclass(frozen=True, slots=True, eq=False)
class Step:
    """One round of the loop.

    Attributes
    ----------
    before : FittedHypothesis
        The model at the start of the round; without an effect that is looked for anew.
    look : DisagreementTest
        Where it disagreed.
    candidates : tuple of Candidate
        Best first.
    chosen : Candidate or None
        What was added, if anything.
    class_ : tuple of str
        Effects that the data cannot tell from the chosen one, itself first.
    flexible : FlexibleTerms or None
        What flexible terms and the shape of the curve bring to that model; None where no effect was refitted.
    """

    before: FittedHypothesis
    look: DisagreementTest
    candidates: tuple[Candidate, ...]
    chosen: Candidate | None
    class_: tuple[str, ...]
    flexible: FlexibleTerms | None = None

    @property
    def only_shape(self) -> bool:
        """Whether a curve of another shape, the same in every sweep and condition, leaves nothing to explain."""
        found = self.flexible
        return (
            found is not None
            and found.shape >= MISFIT_LN_BAYES_FACTOR
            and worth_of(found.beyond) < LEAST_LN_BAYES_FACTOR
        )


@dataclass(frozen=True, slots=True, eq=False)
class GapStudy:
    """What a study found.

    Attributes
    ----------
    verdict : str
        ``none``, ``named`` or ``unnamed``.
    baseline, final : FittedHypothesis
        Without any effect, and with all that were added and kept.
    steps : tuple of Step
    disagreements : tuple of Disagreement
        Of the baseline.
    explained : float
        Log Bayes factor of all effects over the baseline, with the noise of the final model.
    carried : float
        Share that the effects carry of what they and the best flexible term on top of them explain; beside a curve that
        is free to have any shape, the same in every cycle and condition, where that share is greater and
        `LEAST_SHARE_BEYOND_SHAPE` of what they explain lies there.
    followed : mapping of str to FollowedSetting
        For each random effect among the effects that follows a recorded setting, which. It is no name.
    jumped : mapping of str to tuple of Jump
        For each effect that a few jumps in its place explain more than, beside all others, these. It is no name.
    left_jumps : tuple of Jump
        Jumps that the final model leaves, where they explain more than the best flexible term, curves free with both.
    """

    verdict: Verdict
    baseline: FittedHypothesis
    final: FittedHypothesis
    steps: tuple[Step, ...]
    disagreements: tuple[Disagreement, ...]
    explained: float
    carried: float
    followed: Mapping[str, FollowedSetting] = field(default_factory=dict)
    jumped: Mapping[str, tuple[Jump, ...]] = field(default_factory=dict)
    left_jumps: tuple[Jump, ...] = ()

    @property
    def jumps(self) -> tuple[Jump, ...]:
        """Jumps that explain more than an effect in whose place they are, or that the final model leaves."""
        return next(iter(self.jumped.values()), self.left_jumps)

    @property
    def p_value(self) -> float:
        """Global p-value of the disagreement of the baseline."""
        return self.steps[0].look.p_value

    @property
    def left(self) -> DisagreementTest:
        """Where the final model still disagrees."""
        return self.steps[-1].look

    @property
    def periodic(self) -> tuple[StatedPeriodicity, ...]:
        """Lines of spectra that the final model leaves."""
        return self.left.periodic if self.left.p_value <= SIGNIFICANT_P else ()

    @property
    def misses_something(self) -> bool:
        """Whether the final model still disagrees, or may do so where noise hardly changes from sample to sample."""
        return self.left.p_value <= SIGNIFICANT_P or any(remembers_long(n) for n in self.final.noise)

    @property
    def remainder(self) -> float:
        """Share of what can be explained that is left to the best flexible term, be it the shape of the curve."""
        rest = self.left.best.ln_bayes_factor if self.left.p_value <= SIGNIFICANT_P else 0.0
        return 1.0 - share_of(self.explained, rest)

    @property
    def effects(self) -> tuple[Effect, ...]:
        """Effects that were added and kept, in that order."""
        return self.final.hypothesis.effects

    @property
    def named(self) -> tuple[Effect, ...]:
        """Those of them that are names; none without that verdict."""
        return _names(self.effects, {*self.followed, *self.jumped}) if self.verdict == "named" else ()

    @property
    def classes(self) -> dict[str, tuple[str, ...]]:
        """For each of these effects, those that the data cannot tell from it."""
        found = {s.chosen.effect.id: s.class_ for s in self.steps if s.chosen is not None}
        return {e.id: found[e.id] for e in self.effects}


Progress = Callable[[str], None]


def study_campaign(
    campaign: Campaign,
    priors: PriorSet,
    *,
    model: type[ResponseModel] = ModifiedSigmoid,
    pooled: bool = False,
    effects: Mapping[str, Effect] = EFFECTS,
    seed: int = 0,
    progress: Progress | None = None,
) -> GapStudy:
    """Find where force, displacement and stiffness of a campaign disagree with the model and what is missing.

    The temperature that a current makes is studied apart, see `study_heating`.

    Parameters
    ----------
    campaign : Campaign
    priors : PriorSet
    model : type of ResponseModel
        Of the response of either branch.
    pooled : bool
        Whether one set of A and B a branch serves all conditions.
    effects : mapping of str to Effect
        Catalogue to choose from.
    seed : int
    progress : callable, optional
        Told in a few words what is going on.
    """
    tell = progress or (lambda _: None)
    rng = np.random.default_rng(np.random.SeedSequence([seed, 7]))
    tell("fitting the model without effects")
    whole = histories(campaign)
    heated = all("temperature" in h.observed for h in whole)
    own = [h.of(CHANNELS) for h in whole]
    hypothesis = baseline(campaign, own, priors, model=model, pooled=pooled)
    first = fit_with_noise(hypothesis, baseline_start(hypothesis, campaign, priors, pooled=pooled, rng=rng))
    return study_from(first, of_response(effects) if heated else effects, rng, tell)


def study_from(
    first: FittedHypothesis, effects: Mapping[str, Effect], rng: np.random.Generator, tell: Progress
) -> GapStudy:
    """The loop from a fitted baseline; see `study_campaign`."""
    current, bare, explained = first, first, 0.0
    steps: list[Step] = []
    exchanges = 0
    while True:
        tell(f"looking for disagreements, round {len(steps) + 1}")
        least = _least_after(explained)
        apart = least_by_channel(current, steps)
        full = len(current.hypothesis.effects) == MAX_EFFECTS
        found = [one_round(current, effects, rng, last=full, explained=explained, apart=apart)]
        steady = in_steady_noise(first) if not steps and found[0].look.p_value > SIGNIFICANT_P else None
        if steady is not None:
            seen = one_round(steady, effects, rng, apart=apart)
            if seen.look.p_value <= SIGNIFICANT_P:
                first = current = bare = steady
                found = [seen]
        one = found[0].chosen
        alone = one is not None and not members_of(one.effect)
        missing = not alone and len(current.hypothesis.effects) <= MAX_EFFECTS - 2
        lacking = _lacking(found[0], bare, current, explained)
        if missing and (lacking or (steps and _something_else(found[0]))):
            tell(f"trying several effects at once, round {len(steps) + 1}")
            laws = effects if one is None else {k: e for k, e in effects.items() if not members_of(e)}
            over = LEAST_LN_BAYES_FACTOR if one is None else LEAST_SHARE_OF_LAW * one.ln_bayes_factor
            most = MAX_EFFECTS - len(current.hypothesis.effects)
            found = several_rounds(found[0], laws, rng, least, over, most=most) or found
        if found[-1].chosen is None and exchanges < MAX_EFFECTS:
            tell("looking at each effect beside the others")
            exchanges += 1
            again, better = beside_the_others(current, steps, effects, rng)
            steps += again
            found += better
        steps += found
        chosen = steps[-1].chosen
        if chosen is None or chosen.fitted is None:
            break
        kept = without_needless(chosen.fitted)
        current = fit_with_noise(kept.hypothesis, kept.z)
        bare = without_effects(first, current)
        explained = current.ln_evidence - bare.ln_evidence
    where = disagreements(first, _covariates(first))
    carried = _carried(steps[-1].look, bare, current, explained)
    settings = {e.id: followed_setting(current, e) for e in current.hypothesis.effects}
    followed = {name: f for name, f in settings.items() if f is not None}
    jumped = _jumps_instead_of(current)
    verdict: Verdict = (
        "none"
        if steps[0].look.p_value > SIGNIFICANT_P
        else "named"
        if carried >= LEAST_SHARE_CARRIED and _names(current.hypothesis.effects, {*followed, *jumped})
        else "unnamed"
    )
    left = _jumps_left(steps[-1])
    return GapStudy(
        verdict, first, current, tuple(steps), tuple(where), explained, carried, followed, jumped, left
    )


def _jumps_instead_of(current: FittedHypothesis) -> dict[str, tuple[Jump, ...]]:
    """Jumps that surely explain more than an effect does beside all others of a model, by the effect.

    When it was added others were missing, which made the noise greater and jumps less sure.
    """
    out: dict[str, tuple[Jump, ...]] = {}
    for effect in current.hypothesis.effects:
        rest = _without(current, effect)
        jumps = Jumps(rest, within_cycles=bool(members_of(effect)))
        if not jumps.are_rivals_of(current.ln_evidence - rest.ln_evidence):
            continue
        over = jumps.evidence_over(current, offer(current).explained_beyond_shape(offer(rest)))
        if over <= -LEAST_LN_BAYES_FACTOR:
            out[effect.id] = jumps.told
    return out


def _jumps_left(last: Step) -> tuple[Jump, ...]:
    """Jumps that a model leaves, if they surely explain more than flexible terms."""
    if last.look.p_value > SIGNIFICANT_P:
        return ()
    jumps = Jumps(last.before)
    flexible = last.flexible or offer(last.before, last.look.gains)
    if jumps.worth < worth_of(flexible.beyond) + LEAST_LN_BAYES_FACTOR:
        return ()
    return jumps.told


def _names(effects: Sequence[Effect], described: Collection[str]) -> tuple[Effect, ...]:
    return tuple(e for e in effects if e.id not in described)


def one_round(
    current: FittedHypothesis,
    effects: Mapping[str, Effect],
    rng: np.random.Generator,
    *,
    last: bool = False,
    explained: float = 0.0,
    apart: Mapping[str, float] = MappingProxyType({}),
    refitted: int = MAX_REFITS,
    steps: bool = True,
    shuffles: int = SHUFFLES,
) -> Step:
    """Look, try the effects that the model does not have, and choose the one to add, if any deserves it.

    Parameters
    ----------
    current : FittedHypothesis
    effects : mapping of str to Effect
    rng : numpy.random.Generator
    last : bool
        Whether to look only.
    explained : float
        Log Bayes factor of the effects that the model has.
    apart : mapping of str to float
        What is enough in one channel by itself; see `least_by_channel`.
    refitted : int
        How many effects are refitted, at most.
    steps : bool
        Whether strong effects are screened by steps of a fit, too.
    shuffles : int
        By which chance is told.
    """
    screened, untested = screen_all(current, effects.values())
    seen = look(current, screened, rng, shuffles)
    refit = not last and seen.p_value <= SIGNIFICANT_P
    rivals = Rivals.of(current, seen.gains) if refit else None
    tried = candidates(current, screened, seen.gains, rivals, most=refitted, steps=steps)
    terms = None if rivals is None else rivals.terms
    fitted = [c for c in tried if c.fitted is not None]
    enough = [c for c in fitted if _is_enough(c, current, explained, apart)]
    passed = [c for c in enough if is_worthy(c)]
    worthy = _laws_first([c for c in passed if c.worthy_outright] or passed)
    if not worthy:
        return Step(current, seen, (*tried, *untested), None, (), terms)
    chosen = _preferred(worthy)
    return Step(current, seen, (*tried, *untested), chosen, _like(chosen, fitted), terms)


def beside_the_others(
    current: FittedHypothesis, steps: Sequence[Step], effects: Mapping[str, Effect], rng: np.random.Generator
) -> tuple[list[Step], list[Step]]:
    """Look again at each effect of a model but the last, as if it came last.

    The first effects were chosen while others were still missing, and what was missing was a part of what they had to
    explain. Beside the others another effect may explain more, and others may be those that can't be told from it.

    Returns
    -------
    classes : list of Step
        Rounds in which an effect keeps its place, and others than before are like it.
    exchange : list of Step
        The round in which another effect surely explains more, and takes the place of one; empty where there is none.
    """
    classes: list[Step] = []
    seen = {s.chosen.effect.id: s.class_ for s in steps if s.chosen is not None}
    for effect in current.hypothesis.effects[:-1]:
        rest = _without(current, effect)
        worth = current.ln_evidence - rest.ln_evidence
        step = one_round(
            rest, effects, rng, refitted=MAX_FIRST_EFFECTS, steps=False, shuffles=SHUFFLES_OF_SEVERAL
        )
        fitted = [c for c in step.candidates if c.fitted is not None]
        better = [
            c
            for c in fitted
            if _is_worthy_beside_others(c)
            and not members_of(c.effect)
            and c.ln_bayes_factor >= worth + LN_BAYES_FACTOR_TOLD_APART
        ]
        own = [c for c in fitted if c.effect.id == effect.id]
        for chosen in (better or own)[:1]:
            found = replace(step, chosen=chosen, class_=_like(chosen, fitted))
            if chosen.effect.id != effect.id:
                return classes, [found]
            if set(found.class_) != set(seen.get(effect.id, ())):
                classes.append(found)
    return classes, []


def least_by_channel(current: FittedHypothesis, steps: Sequence[Step]) -> dict[str, float]:
    """Log Bayes factor by one channel alone that is enough for a further effect, by channel.

    What the form of an effect leaves is in the channels that it changes. So in each channel a further effect is held to
    what those effects explain that change it, wherever they do.

    Parameters
    ----------
    current : FittedHypothesis
    steps : sequence of Step
        Those in which its effects were added.
    """
    brought = {s.chosen.effect.id: s.chosen.ln_bayes_factor for s in steps if s.chosen is not None}
    before = dict.fromkeys(current.hypothesis.channels, 0.0)
    for effect in current.hypothesis.effects:
        added = added_by(effect, current.hypothesis, current.blocks, current.theta)
        for channel in {b.channel for b in current.blocks if np.any(added[b.at])}:
            before[channel] += brought.get(effect.id, 0.0)  # 0 of what the loop began with
    return {
        channel: max(MISFIT_LN_BAYES_FACTOR, LEAST_FURTHER_SHARE * much) for channel, much in before.items()
    }


def _is_apart(candidate: Candidate, current: FittedHypothesis, least: Mapping[str, float]) -> bool:
    """Whether it is worth enough in one channel by itself, and as great a share of all that it is worth.

    Its log Bayes factor is shared out among the channels as the gain of log likelihood is. What each run or cycle has
    of its own explains a part of anything, so that it has to carry most of what there is.
    """
    found, beside = candidate.fitted, candidate.beside
    if found is None or (
        members_of(candidate.effect) and (beside is None or beside.carried < LEAST_SHARE_CARRIED)
    ):
        return False
    gained = current.whitened**2 - found.whitened**2
    own = {c: sum(float(gained[b.at].sum()) for b in current.blocks if b.channel == c) for c in least}
    whole = sum(max(g, 0.0) for g in own.values())
    needed = LEAST_FURTHER_SHARE * candidate.ln_bayes_factor
    return any(candidate.ln_bayes_factor * g >= max(least[c], needed) * whole > 0.0 for c, g in own.items())


def _least_after(explained: float) -> float:
    """Log Bayes factor that an effect has to bring after others that explain so much."""
    return max(LEAST_LN_BAYES_FACTOR, LEAST_FURTHER_SHARE * explained)


def _is_enough(
    candidate: Candidate, current: FittedHypothesis, explained: float, apart: Mapping[str, float]
) -> bool:
    """Whether an effect explains so much, or something so different, that it is not the form of those before.

    What it only bends, the same in every sweep and condition, may be such a form up to `MOST_SHARE_OF_FORM`.
    """
    least = _least_after(explained)
    if _ends_it(candidate):
        least *= LEAST_FURTHER_SHARE_OF_LAST
    if candidate.ln_bayes_factor >= least or _is_apart(candidate, current, apart):
        return candidate.beyond_form >= LEAST_SHARE_BESIDE_FORMS
    carries = candidate.beside is not None and candidate.beside.carried >= LEAST_SHARE_CARRIED
    bends = not candidate.beyond_shape and candidate.ln_bayes_factor < MOST_SHARE_OF_FORM * explained
    return carries and not bends and _is_surely_another(candidate)


def _is_surely_another(candidate: Candidate) -> bool:
    """Whether a law surely explains something else than what the form of the effects before it may leave."""
    law = not members_of(candidate.effect)
    return (
        law
        and candidate.ln_bayes_factor >= MISFIT_LN_BAYES_FACTOR
        and candidate.beyond_form >= ENOUGH_SHARE_BESIDE_FORMS
    )


def _ends_it(candidate: Candidate) -> bool:
    """Whether a law leaves nothing to explain; what each run or cycle has of its own always may."""
    return candidate.leaves_nothing and not members_of(candidate.effect)


def _preferred(worthy: Sequence[Candidate]) -> Candidate:
    """The first of the candidates, unless another surely explains more beside a free shape that is told apart."""
    first = worthy[0]
    if first.beside is None or not first.beside.shape_apart or members_of(first.effect):
        return first
    laws = [c for c in worthy if c.beside and c.beside.shape_apart and not members_of(c.effect)]
    other = max(laws, key=lambda c: c.evidence_like(first))
    return (
        other
        if other.evidence_like(first) >= first.evidence_like(first) + LN_BAYES_FACTOR_TOLD_APART
        else first
    )


def _laws_first(worthy: Sequence[Candidate]) -> list[Candidate]:
    """Candidates in the order in which they are preferred: random effects come after laws that hold beside them."""
    random = [c for c in worthy if members_of(c.effect)]
    if not random or random[0].fitted is None:
        return list(worthy)
    free = random[0]
    laws = [
        c
        for c in worthy
        if not members_of(c.effect)
        and (
            c.ln_bayes_factor >= free.ln_bayes_factor
            or (
                c.ln_bayes_factor >= LEAST_SHARE_OF_LAW * free.ln_bayes_factor
                and holds_beside(c.effect, random[0].fitted, c.fitted)
            )
        )
    ]
    return [*laws, *random]


def is_worthy(candidate: Candidate) -> bool:
    """Whether an effect explains more than functions without meaning do, and than the shape of the curve.

    In the place of such functions it must be worth more than the flexible terms that contain its signature
    (`flexible_alternative`), were their size as surprising as its own (`surprise_of_size`). Beside them, the effect
    with the best flexible term on top must be worth more than such a term alone, by `LEAST_LN_BAYES_FACTOR`, and the
    effect must carry `LEAST_SHARE_BESIDE_FLEXIBLE` of what the two explain.

    The shape of the curve is a rival in the same two ways. In its place the effect must be worth more than every shape
    that one stage can have, by `LEAST_LN_BAYES_FACTOR`. Beside a curve of any shape, the same in every sweep and
    condition, it must still be worth `LEAST_LN_BAYES_FACTOR`, and `LEAST_SHARE_BEYOND_SHAPE` of what it is
    worth without one, and carry `LEAST_SHARE_BESIDE_FLEXIBLE` of what can be explained. A further stage of the
    transformation has to be worth more than the shapes of one. And the numbers of the effect must be those of the
    mechanism.

    An effect that carries nearly all may be worth less than the flexible term, by `MOST_SHARE_OF_FORM` of what it is
    worth: so much of the form of a strong effect its law may lack.
    """
    return candidate.worthy


def _like(best: Candidate, fitted: Sequence[Candidate]) -> tuple[str, ...]:
    """Names of the effects that the data can't tell from one, itself first."""
    return (best.effect.id, *(c.effect.id for c in fitted if c is not best and are_alike(best, c)))


def are_alike(best: Candidate, rival: Candidate) -> bool:
    """Whether the data can't tell a rival from the effect that explains most.

    Within `LN_BAYES_FACTOR_TOLD_APART` they can't. A law that leaves something to flexible terms is not quite that of
    the rig, nor need the right one be: a rival that would have a name by itself is told apart only if what it leaves is
    so much more that the odds by that reach the same threshold (`Candidate.odds_by_form`).
    """
    if members_of(rival.effect) or not rival.plausible:
        return False
    less = best.evidence_like(best) - rival.evidence_like(best)
    return less <= LN_BAYES_FACTOR_TOLD_APART or (
        best.odds_by_form(less) <= LN_BAYES_FACTOR_TOLD_APART and is_worthy(rival)
    )


def several_rounds(
    first: Step,
    effects: Mapping[str, Effect],
    rng: np.random.Generator,
    least: float = LEAST_LN_BAYES_FACTOR,
    over: float = LEAST_LN_BAYES_FACTOR,
    most: int = MAX_EFFECTS_AT_ONCE,
) -> list[Step]:
    """Two effects at once, or three, where no single one deserves to be added; empty where these don't either.

    With others still missing, a flexible term that takes part of all can beat each of them. So each is judged anew
    beside the others, by the same rules, and may not be what the form of greater ones leaves; and since there are many
    such sets, some of which mimic an effect that is not in the catalogue, all together have to be worth more than the
    best flexible term, by `LEAST_LN_BAYES_FACTOR`, at least `over`, and at least `least` unless each explains something
    else than the form of those before it may leave. Sets begin with one of the best laws, of random effects only where
    there are none, and grow by the best on top of them; three are tried where no two do.

    Where another shape of the curve would explain all there is, only two laws are tried, each of which explains half of
    that, and together they have to be worth more than every shape that one stage can have and a free one.
    """
    promising = [c for c in _promising(first) if c.effect.id in effects]
    best = first.look.best.ln_bayes_factor
    needed, share = max(over, best + LEAST_LN_BAYES_FACTOR), LEAST_FURTHER_SHARE
    begin = [c for c in promising if not members_of(c.effect)]
    if first.only_shape:
        effects = {name: e for name, e in effects.items() if not members_of(e)}
        needed, share, most = max(needed, shape_of(first) + LEAST_LN_BAYES_FACTOR), LEAST_SHARE_OF_TWO, 2
    elif not begin:
        begin = promising
    chains = [
        [_added(first, one, promising)]
        for one in begin[:MAX_FIRST_EFFECTS]
        if one.ln_bayes_factor >= share * best
    ]
    for _ in range(1, min(MAX_EFFECTS_AT_ONCE, most)):
        grown = _different([longer for chain in chains if (longer := _grown(chain, effects, rng))])
        for chain in grown:
            enough = _together(chain) >= least or _each_is_another(chain)
            if _together(chain) >= needed and enough and _are_worthy_together(chain):
                return chain
        chains = [c for c in grown if _together(c) >= LEAST_SHARE_OF_TWO * best][:MAX_PAIRS]
    return []


def shape_of(step: Step) -> float:
    """Log Bayes factor of the best shape that the curve may have: of one stage, or free."""
    free = 0.0 if step.flexible is None else step.flexible.shape
    return max(free, OneStageShapes(step.before).worth())


def _different(chains: Sequence[list[Step]]) -> list[list[Step]]:
    """One chain for each set of effects, best first."""
    ordered = sorted(chains, key=_together, reverse=True)
    sets = {frozenset(s.chosen.effect.id for s in c if s.chosen is not None): c for c in reversed(ordered)}
    return sorted(sets.values(), key=_together, reverse=True)


def _promising(step: Step) -> list[Candidate]:
    """What was refitted and is worth something, best first."""
    return [
        c
        for c in step.candidates
        if c.fitted is not None and c.plausible and c.ln_bayes_factor >= LEAST_LN_BAYES_FACTOR
    ]


def _added(step: Step, one: Candidate, promising: Sequence[Candidate]) -> Step:
    return replace(step, chosen=one, class_=_like(one, promising))


def _grown(chain: Sequence[Step], effects: Mapping[str, Effect], rng: np.random.Generator) -> list[Step]:
    """A chain of effects with the best one on top of it, one that is worthy if there is any; empty without one."""
    last = chain[-1].chosen
    if last is None or last.fitted is None:
        return []
    step = one_round(
        fit_with_noise(last.fitted.hypothesis, last.fitted.z),
        effects,
        rng,
        refitted=MAX_FIRST_EFFECTS,
        steps=False,
        shuffles=SHUFFLES_OF_SEVERAL,
    )
    promising = _promising(step)
    chosen = step.chosen or next(iter(promising), None)
    return [*chain, _added(step, chosen, promising)] if chosen else []


def _together(chain: Sequence[Step]) -> float:
    return sum(s.chosen.ln_bayes_factor for s in chain if s.chosen is not None)


def _something_else(step: Step) -> bool:
    """Whether a law explains something that no other form of the effects before it does, though not all of it."""
    return step.look.p_value <= SIGNIFICANT_P and any(map(_is_surely_another, _promising(step)))


def _each_is_another(chain: Sequence[Step]) -> bool:
    return all(_is_surely_another(s.chosen) for s in chain if s.chosen is not None)


def _are_worthy_together(chain: Sequence[Step]) -> bool:
    """Whether each of several effects would be added to a model that has the others already."""
    last = chain[-1].chosen
    if last is None or last.fitted is None or not _is_worthy_beside_others(last):
        return False
    return all(
        _is_worthy_beside_others(_beside_the_others(last.fitted, e))
        for e in last.fitted.hypothesis.effects[:-1]
    )


def _is_worthy_beside_others(candidate: Candidate) -> bool:
    """Whether an effect beside others is worthy and not what the form of greater ones leaves."""
    return is_worthy(candidate) and not _may_be_left_by_form(candidate)


def _may_be_left_by_form(candidate: Candidate) -> bool:
    """Whether an effect may be what the form of greater ones beside it leaves.

    That is less than `LEAST_FURTHER_SHARE` of each of these. More than that is left by no effect that would
    have a name by itself.
    """
    whole = candidate.fitted
    if whole is None or candidate.beyond_form >= LEAST_SHARE_BESIDE_FORMS:
        return False
    rest = _without(whole, candidate.effect)
    worth = {e: rest.ln_evidence - _without(rest, e).ln_evidence for e in rest.hypothesis.effects}
    greater = [e for e, much in worth.items() if candidate.ln_bayes_factor < LEAST_FURTHER_SHARE * much]
    return EffectForms(rest, greater).share_beyond(signature_at_mode(rest, whole)) < LEAST_SHARE_BESIDE_FORMS


def _beside_the_others(whole: FittedHypothesis, effect: Effect) -> Candidate:
    """One of the effects of a model, judged as if it came last."""
    rest = _without(whole, effect)
    with_it = rest.hypothesis.extended(effect)
    again = fit_hypothesis(with_it, _start_from(whole, with_it), whole.noise)
    flexible = gains(rest, terms_of(rest))
    return judged(rest, again, screen(rest, effect), flexible, Rivals.of(rest, flexible))


def without_needless(fitted: FittedHypothesis) -> FittedHypothesis:
    """The model less every effect that a later one has made needless."""
    while len(fitted.hypothesis.effects) > 1:
        reduced = [_without(fitted, e) for e in fitted.hypothesis.effects[:-1]]
        best = max(reduced, key=lambda r: r.ln_evidence)
        if best.ln_evidence < fitted.ln_evidence - LEAST_LN_BAYES_FACTOR:
            return fitted
        fitted = best
    return fitted


def without_effects(first: FittedHypothesis, final: FittedHypothesis) -> FittedHypothesis:
    """The baseline with the noise of the final model, for its effects to be compared with.

    The noise of the baseline has a part of what effects explain in it, as memory or scatter.
    """
    return fit_hypothesis(first.hypothesis, first.z, final.noise)


def _without(fitted: FittedHypothesis, effect: Effect) -> FittedHypothesis:
    hypothesis = fitted.hypothesis
    kept = [e for e in hypothesis.effects if e.id != effect.id]
    smaller = hypothesis.with_effects(kept)
    return fit_hypothesis(smaller, _start_from(fitted, smaller), fitted.noise)


def _start_from(fitted: FittedHypothesis, hypothesis: Hypothesis) -> Floats:
    """Mode of a fit, in the order of a hypothesis with the same parameters or fewer."""
    z = dict(zip([p.name for p in fitted.hypothesis.space.free], fitted.z.tolist(), strict=True))
    return np.array([z[p.name] for p in hypothesis.space.free])


def _lacking(last: Step, bare: FittedHypothesis, current: FittedHypothesis, explained: float) -> bool:
    """Whether the effects that there are carry too little for a name."""
    return (
        last.look.p_value <= SIGNIFICANT_P
        and _carried(last.look, bare, current, explained) < LEAST_SHARE_CARRIED
    )


def _carried(
    left: DisagreementTest, bare: FittedHypothesis, final: FittedHypothesis, explained: float
) -> float:
    """See `GapStudy.carried`: the greater share, with the shape of the curve or beside it."""
    if left.p_value > SIGNIFICANT_P or explained <= 0.0:
        return share_of(explained, 0.0)
    before, after = offer(bare), offer(final, left.gains)
    plain = share_of(explained, worth_of(after.best))
    own = after.free - before.free
    if after.shape < MISFIT_LN_BAYES_FACTOR or not is_beyond_shape(own, explained):
        return plain
    return max(plain, share_of(own, worth_of(after.beyond)))


def _covariates(fitted: FittedHypothesis) -> list[str]:
    names = set().union(*(h.inputs for h in fitted.hypothesis.histories))
    return [
        n
        for n in ("temperature", "time", "order", "cycle", "rate", "current", "ambient_temperature")
        if n in names
    ]


def baseline_start(
    hypothesis: Hypothesis, campaign: Campaign, priors: PriorSet, *, pooled: bool, rng: np.random.Generator
) -> Floats:
    """Sampled coordinates of the least-squares fits of each branch; where there is none, the centre of the prior."""
    space = hypothesis.space
    theta = space.constrain(space.prior_centre())
    mechanical = hypothesis.simulation.mechanical
    names = () if mechanical is None else mechanical.model.parameter_names
    groups = [None] if pooled else list(dict.fromkeys(h.condition.id for h in hypothesis.histories))
    for group in groups:
        tag = "" if group is None else f"[{group}]"
        if hypothesis.simulation.thermal is not None:
            mine = [h for h in hypothesis.histories if group in (None, h.condition.id)]
            for name, value in heat_balance(mine).items():
                theta[space.index(f"{name}{tag}")] = value
        if mechanical is None:
            continue
        for branch in Branch:
            records = [r for r in campaign.records if r.branch is branch and group in (None, r.condition.id)]
            if records:
                own = type(mechanical.model).made_for(records)
                posterior = build_posterior(records, NOISE_MODELS["independent"], priors, model=own)
                start = warm_start(posterior, rng)
                for name, value in zip(names, start.theta, strict=True):
                    theta[space.index(f"{name} {branch.value}{tag}")] = value
    z = space.unconstrain(theta)
    return np.where(np.isfinite(z), z, space.prior_centre())


def heat_balance(histories: Sequence[History]) -> dict[str, float]:
    """Gain and loss of the Joule-heating balance, and the ambient temperature where none was recorded.

    Integrated over time the balance is linear in them: the rise since the start of a stretch is ``gain`` times the
    integral of the squared current less ``loss`` times that of the excess. Least squares on the integrals is a start
    that noise of the readings hardly moves.
    """
    known = all("ambient_temperature" in h.inputs for h in histories)
    rows, rises = [], []
    for h in histories:
        v = h.inputs
        for stretch in np.unique(v["stretch"]):
            on = v["stretch"] == stretch
            dt = np.diff(v["time"][on], prepend=v["time"][on][:1])
            room = v["ambient_temperature"][on] if known else np.zeros(int(on.sum()))
            parts = [v["current"][on] ** 2, room - v["temperature"][on], np.ones(int(on.sum()))]
            held = [np.concatenate([p[:1], p[:-1]]) for p in parts]
            rows.append(np.cumsum(np.stack(held[: 2 if known else 3], axis=1) * dt[:, None], axis=0))
            rises.append(v["temperature"][on] - v["temperature"][on][0])
    found = np.linalg.lstsq(np.concatenate(rows), np.concatenate(rises), rcond=None)[0]
    gain, loss = (max(float(x), 1e-9) for x in found[:2])
    return {"gain": gain, "loss": loss} | ({} if known else {"ambient": float(found[2]) / loss})
