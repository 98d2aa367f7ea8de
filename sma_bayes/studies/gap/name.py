"""Which effect explains a disagreement.

Every effect of the catalogue that the data can test is first screened: its signature over a grid of its parameters,
less what the model's parameters absorb, is laid over the residuals. Those that come near the best are refitted in
full, with all parameters and the noise anew, and judged by the evidence.

Four guards stand against false names. An effect must be worth more than flexible terms that contain most of its
signature, were their size as surprising as its own, or, with a flexible term on top of it, more than flexible terms are
without it (`EvidenceBeside`). It must be worth more than the shapes that the curve of one stage can have, or explain
what no curve of any shape does, the same in every sweep and condition: no specimen is a sigmoid, and an effect that
only bends its curve is no cause. It must be worth as much as a few jumps (`Jumps`). And the noise keeps its memory
throughout, so slow residuals do not count as often as they were sampled.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product

import numpy as np
from scipy.special import logsumexp

from sma_bayes.arrays import Floats
from sma_bayes.effects.needs import untestable
from sma_bayes.effects.types import Effect
from sma_bayes.parameters.distributions import LogNormal
from sma_bayes.parameters.space import Parameter
from sma_bayes.studies.gap.effect_form import EffectForms
from sma_bayes.studies.gap.finite import STRONG_LN_BAYES_FACTOR, gained_in_steps
from sma_bayes.studies.gap.fitting import (
    FittedHypothesis,
    added_by,
    fit_held,
    fit_hypothesis,
    fit_with_noise,
    stacked,
)
from sma_bayes.studies.gap.flexible import (
    FlexibleTerms,
    TermEvidence,
    TermWorth,
    gains,
    log_density_of_size,
    offer,
    terms_of,
    worth_of,
)
from sma_bayes.studies.gap.hypothesis import Hypothesis
from sma_bayes.studies.gap.jumps import Jumps
from sma_bayes.studies.gap.one_stage import OneStageShapes, claims_a_stage
from sma_bayes.studies.gap.scatter import lay_together, members_of

SCREENED_QUANTILES = {True: (0.001, 0.1, 0.5, 0.9), False: (0.25, 0.75)}
"""Quantiles of the prior at which sizes are screened: those that are positive, those of either sign."""
PARAMETER_SLICES = {0: 0, 1: 16, 2: 8, 3: 5}
"""Into how many equal slices of probability each other parameter is cut, by their number; their middles are tried."""
SCREENED_SCALES = (0.1, 0.3, 1.0, 3.0)
"""Sizes over those of the grid that are averaged over when an effect is screened."""
REFIT_GAIN_MARGIN, REFIT_GAIN_SHARE = 12.0, 0.5
"""Screened gain below the best up to which candidates are refitted: so much, or such a share of it if that is more."""
NEGLIGIBLE_GAIN_SHARE = 0.02
"""Share of the best screened gain below which an effect is not worth the steps of a fit."""
LEAST_LN_BAYES_FACTOR = 3.0
"""Least ln Bayes factor of an effect that is added, and of one that is kept."""
LEAST_SHARE_BESIDE_FLEXIBLE = 0.85
"""Share that an effect must carry of what it and a flexible term on top of it explain, to get in beside such a term."""
LEAST_SHARE_IN_OWN_NOISE = 0.95
"""The same by the noise that is left beside the effect, which has a part of what its form leaves; shape counted."""
MOST_SHARE_OF_FORM = 0.01
"""Share of what an effect explains by which a flexible term may explain more, where the effect carries nearly all of
what both do. The stronger an effect, the more of its form shows that its law lacks; a term that has every form must not
win by that alone."""
LEAST_SHARE_BEYOND_SHAPE = 0.2
"""Share of what an effect explains that must lie beyond any shape of the curve: less may be the form of a shape."""
MISFIT_LN_BAYES_FACTOR = 20.0
"""Log Bayes factor from which on a curve surely has another shape than the model's."""
BELIEVABLE_PRIOR_MASS = 0.999
"""Share of the prior of a parameter within which an effect is what its name says; its size may lie anywhere."""
MAX_LOSS_IN_BELIEVABLE_RANGE = 0.01
"""Share of what an effect explains that it may lose with numbers that can be believed: no form is exact, and what is
plain to see tells its numbers from the next ones by far more than `LEAST_LN_BAYES_FACTOR`."""
LEAST_SHARE_FOR_OWN_NOISE = 0.5
"""Share that an effect must carry to be judged by the noise beside it as well."""
CANCELLING_SIZE = 2.0
"""What an effect adds to a channel over all that was measured of it, beyond which it can only cancel something else."""
MAX_REFITS = 6
"""Greatest number of candidates that are refitted at a step."""
CONTAINED_SHARE = 0.5
"""Share of a signature from which on a flexible term stands for it."""
IDENTICAL_SHARE = 0.99
"""Share of every signature of an effect from which on a flexible term of a single column is that effect."""


@dataclass(frozen=True, slots=True, eq=False)
class Screened:
    """An effect laid over the residuals.

    Attributes
    ----------
    effect : Effect
    gain : float
        By how much the log likelihood would rise at the best point of the grid.
    start : ndarray, shape (D,)
        Where to begin the full fit, in the coordinates of the extended hypothesis.
    ln_bayes_factor : float
        For the effect, by the same reckoning as for flexible terms: normal sizes, averaged over the grid.
    signatures : ndarray, shape (N, G)
        Over the grid, whitened, less what the model absorbs.
    information : ndarray, shape (G,)
        Squared lengths of the signatures.
    together : TermEvidence or None
        Of a random effect, whose signatures go together.
    """

    effect: Effect
    gain: float
    start: Floats
    ln_bayes_factor: float
    signatures: Floats
    information: Floats
    together: TermEvidence | None = None

    def of(self, residuals: Floats) -> Floats:
        """Log Bayes factor for other whitened residuals (N, S), shape (S,)."""
        if self.together is not None:
            return self.together.of(residuals)
        return _averaged(self.signatures.T @ residuals, self.information)


@dataclass(frozen=True, slots=True)
class EvidenceBeside:
    """What an effect is worth beside flexible terms.

    A mechanism is never exactly the formula of the catalogue. Where it is strong, the remainder of form is far beyond
    the noise, and a function that bends at will explains the whole better than the formula does. So what counts is
    whether formula and function together explain it better than the function does by itself.

    Attributes
    ----------
    over : float
        Log Bayes factor of the effect with the best flexible term on top of it, over the best flexible term alone; the
        greater one of with the shape of the curve and beside it, where that is told apart.
    carried : float
        Share that the effect has in what the two explain together.
    remainder : TermWorth or None
        That term on top of the effect.
    on_top : float
        Log Bayes factor of the best term on top of it, the shape of the curve included; 0 where none pays for itself.
    shape_apart : bool
        Whether the share is that beside a curve that is free to have any shape, the same in every cycle and condition.
        That takes an effect of which a share of `LEAST_SHARE_BEYOND_SHAPE` lies beyond any shape: where it only bends
        the curve, little is left there to be shared.
    beyond_shape : float
        Log Bayes factor of the effect where the curve is free to have any shape, with the effect as without.
    carried_beyond : float
        Share that the effect has in what it and the best flexible term on top of it explain beside such a curve.
    rest_beyond_shape : float
        Log Bayes factor of that term.
    """

    over: float
    carried: float
    remainder: TermWorth | None
    on_top: float
    shape_apart: bool
    beyond_shape: float = np.inf
    carried_beyond: float = 1.0
    rest_beyond_shape: float = 0.0

    @staticmethod
    def of(gained: float, with_it: FlexibleTerms, without: FlexibleTerms) -> EvidenceBeside:
        """Weigh an effect.

        Parameters
        ----------
        gained : float
            Log Bayes factor of the effect.
        with_it, without : FlexibleTerms
            What flexible terms bring to the model with it and without.
        """
        on_top = worth_of(with_it.best)
        own, rest = with_it.free - without.free, worth_of(with_it.beyond)
        over, share = own + rest - worth_of(without.beyond), share_of(own, rest)
        over_plain, share_plain = gained + on_top - worth_of(without.best), share_of(gained, on_top)
        misshapen = with_it.shape >= MISFIT_LN_BAYES_FACTOR and is_beyond_shape(own, gained)
        if misshapen and max(over, over_plain) >= LEAST_LN_BAYES_FACTOR and share > share_plain:
            return EvidenceBeside(
                max(over, over_plain), share, with_it.beyond, on_top, True, own, share, rest
            )
        return EvidenceBeside(over_plain, share_plain, with_it.best, on_top, False, own, share, rest)


def is_beyond_shape(beyond: float, explained: float) -> bool:
    """Whether enough of what effects explain lies beyond any shape of the curve for shares to be counted there."""
    return beyond >= max(LEAST_LN_BAYES_FACTOR, LEAST_SHARE_BEYOND_SHAPE * explained)


def share_of(explained: float, rest: float) -> float:
    """Share of what effects explain in that and the rest, both logarithms of Bayes factors."""
    return explained / (explained + max(rest, 0.0)) if explained > 0.0 else 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Rivals:
    """What an effect has to be worth more than, in a model as it is.

    Attributes
    ----------
    terms : FlexibleTerms
    shapes : OneStageShapes
    forms : EffectForms
        Of the effects that the model has.
    jumps, jumps_within_cycles : Jumps
    """

    terms: FlexibleTerms
    shapes: OneStageShapes
    forms: EffectForms
    jumps: Jumps
    jumps_within_cycles: Jumps

    @staticmethod
    def of(fitted: FittedHypothesis, flexible: Sequence[TermEvidence] = ()) -> Rivals:
        """Rivals in a fitted model; `flexible`, if what such terms bring is known already."""
        return Rivals(
            offer(fitted, flexible),
            OneStageShapes(fitted),
            EffectForms(fitted),
            Jumps(fitted),
            Jumps(fitted, within_cycles=True),
        )


@dataclass(frozen=True, eq=False)
class Candidate:
    """What was found about an effect at a step.

    Attributes
    ----------
    effect : Effect
    fitted : FittedHypothesis or None
        None where it was not refitted.
    ln_bayes_factor : float
        For the effect, over the model as it was: from the full fit, or as screened where there was none.
    guard : float
        Log Bayes factor of flexible terms that contain most of its signature, were their size as surprising as its own.
    guard_covariate : str
        Of that term; empty where there is none.
    beside : EvidenceBeside or None
        What it is worth beside flexible terms, if that was looked at.
    beyond_form : float
        Share of what it explains that no other form of the effects before it does; see `EffectForms`.
    untestable : str
        Why the data can't test it; empty where they can.
    one_stage : float
        Log Bayes factor of the best shape that a curve of one stage can have, for an effect that hangs on it; -inf for
        others.
    behind_shape : float
        By how much more such a shape explains by the noise that is left beside the effect, as a share of what the
        effect does; -inf where that noise is not smaller, or it fails by something else.
    over_jumps : float
        Log Bayes factor of the effect, with the best flexible term on top of it, over a few jumps, where the curve is
        free to have any shape; infinite where these explain less than `LEAST_SHARE_OF_JUMPS` of what it does, or it
        fails by something else.
    in_own_noise : Candidate or None
        The same, with the noise that is left beside it, if it was judged by that, too; see `in_own_noise`.
    """

    effect: Effect
    fitted: FittedHypothesis | None
    ln_bayes_factor: float
    guard: float = -np.inf
    guard_covariate: str = ""
    beside: EvidenceBeside | None = None
    beyond_form: float = 0.0
    untestable: str = ""
    one_stage: float = -np.inf
    behind_shape: float = -np.inf
    over_jumps: float = np.inf
    in_own_noise: Candidate | None = None

    @cached_property
    def plausible(self) -> bool:
        """Whether its numbers, but for its size, are those of the mechanism, and it does not cancel something else."""
        found = self.fitted
        return found is None or (is_plausible(found.hypothesis, found.z) and not cancels(found))

    @property
    def worthy(self) -> bool:
        """Whether it is worth more than functions without meaning and the shape of the curve, in one of both noises."""
        own = self.in_own_noise
        passes = self.plausible and self.beats_flexible and self.beats_shape and self.beats_jumps
        return passes or (own is not None and own.worthy and own.carries_nearly_all)

    @property
    def worthy_outright(self) -> bool:
        """Whether it is `worthy` without `MOST_SHARE_OF_FORM`: such a law comes before one that needs it."""
        own = self.in_own_noise
        passes = self.plausible and self.beats_flexible_outright and self.beats_shape and self.beats_jumps
        return passes or (own is not None and own.worthy_outright and own.carries_nearly_all)

    @property
    def leaves_nothing(self) -> bool:
        """Whether it is surely there, and nothing without meaning pays for itself on top of it, the shape included."""
        found = self.beside
        return (
            self.ln_bayes_factor >= MISFIT_LN_BAYES_FACTOR
            and found is not None
            and found.on_top < LEAST_LN_BAYES_FACTOR
        )

    def evidence_like(self, other: Candidate) -> float:
        """Its log Bayes factor as it is to be compared with that of another: beside a free shape if that one is so.

        Where the curve surely has another shape, what an effect gains without one is in part what it bends.
        """
        apart = other.beside is not None and other.beside.shape_apart
        return self.beside.beyond_shape if apart and self.beside is not None else self.ln_bayes_factor

    def odds_by_form(self, less: float) -> float:
        """Log odds for its law over one that explains less, were both errors of form.

        A flexible term of k columns on top of the law explains R, the log of a Bayes factor, and R + `less` on top of
        the other. If errors of form have k independent normal parts of a size that nobody knows, the odds of two with
        these squared lengths are ``(1 + less/R)**(k/2)``; infinite where nothing is left.
        """
        left = None if self.beside is None else self.beside.remainder
        if left is None or worth_of(left) == 0.0:
            return np.inf if less > 0.0 else 0.0
        return float(0.5 * left.term.columns.shape[1] * np.log1p(max(less, 0.0) / left.ln_bayes_factor))

    @property
    def carries_nearly_all(self) -> bool:
        """Whether it carries `LEAST_SHARE_IN_OWN_NOISE` of what it and a flexible term explain, the shape being one."""
        found = self.beside
        return found is not None and share_of(self.ln_bayes_factor, found.on_top) >= LEAST_SHARE_IN_OWN_NOISE

    @property
    def beats_flexible(self) -> bool:
        """Whether it is worth more than flexible terms, but for `MOST_SHARE_OF_FORM` where it carries nearly all."""
        found, gained = self.beside, self.ln_bayes_factor
        but_for_form = (
            gained >= LEAST_LN_BAYES_FACTOR
            and found is not None
            and found.over >= -MOST_SHARE_OF_FORM * gained
            and self.carries_nearly_all
        )
        return but_for_form or self.beats_flexible_outright

    @property
    def beats_flexible_outright(self) -> bool:
        """Whether it is worth more than flexible terms in its place, or beside them and carries most by itself."""
        found = self.beside
        beside = (
            found is not None
            and found.over >= LEAST_LN_BAYES_FACTOR
            and found.carried >= LEAST_SHARE_BESIDE_FLEXIBLE
        )
        return self.ln_bayes_factor >= LEAST_LN_BAYES_FACTOR and (self.ln_bayes_factor > self.guard or beside)

    @property
    def beyond_shape(self) -> bool:
        """Whether it explains what no curve does that is the same in every sweep and condition, and most of that."""
        found = self.beside
        return found is None or (
            is_beyond_shape(found.beyond_shape, self.ln_bayes_factor)
            and found.carried_beyond >= LEAST_SHARE_BESIDE_FLEXIBLE
        )

    @property
    def beats_shape(self) -> bool:
        """Whether it is worth more than the shapes of one stage, or explains what lies beyond any shape.

        By the noise that is left beside it, too, but for `MOST_SHARE_OF_FORM`: what both leave out passes for noise
        without them, in which the better of two shapes may be worth less. An effect that claims a stage of its own has
        to be worth more than those of one.
        """
        more = (
            self.ln_bayes_factor >= self.one_stage + LEAST_LN_BAYES_FACTOR
            and self.behind_shape <= MOST_SHARE_OF_FORM
        )
        return more or (self.beyond_shape and not claims_a_stage(self.effect))

    @property
    def beats_jumps(self) -> bool:
        """Whether a few jumps, at moments that nobody knew beforehand, don't surely explain more."""
        return self.over_jumps > -LEAST_LN_BAYES_FACTOR

    @property
    def weight(self) -> float:
        """Log Bayes factor of the effect, half of its prior probability with a flexible term on top of it."""
        on_top = 0.0 if self.beside is None else self.beside.on_top
        return self.ln_bayes_factor + float(np.logaddexp(0.0, on_top) - np.log(2.0))


def screen_all(fitted: FittedHypothesis, effects: Iterable[Effect]) -> tuple[list[Screened], list[Candidate]]:
    """Screen every effect that the model does not have yet; what can't be tested comes as a judged candidate."""
    present = {e.id for e in fitted.hypothesis.effects}
    screened, untested = [], []
    for effect in effects:
        if effect.id in present:
            continue
        why = untestable(effect.needs, fitted.hypothesis.histories)
        if why:
            untested.append(Candidate(effect, None, -np.inf, untestable=why))
        else:
            screened.append(screen(fitted, effect))
    return sorted(screened, key=lambda s: -s.gain), untested


def candidates(
    fitted: FittedHypothesis,
    screened: Sequence[Screened],
    flexible: Sequence[TermEvidence],
    rivals: Rivals | None,
    *,
    most: int = MAX_REFITS,
    steps: bool = True,
) -> list[Candidate]:
    """Judge effects, and refit those that come near the best.

    Parameters
    ----------
    fitted : FittedHypothesis
        The model as it is.
    screened : sequence of Screened
        Greatest gain first.
    flexible : sequence of TermEvidence
        What flexible terms would bring to the same model.
    rivals : Rivals or None
        Without them effects are judged by the screening alone, which is enough where there is nothing to explain.
    most : int
        How many are refitted, at most.
    steps : bool
        Whether strong effects, and those of many numbers, are screened by steps of a fit, too.

    Returns
    -------
    list of Candidate
        Best first.
    """
    if rivals is not None and steps:
        strong = bool(flexible) and flexible[0].ln_bayes_factor >= STRONG_LN_BAYES_FACTOR
        screened = _in_steps(fitted, screened, every=strong)
    out: list[Candidate] = []
    best = _best_law(fitted, screened)
    for place, s in enumerate(screened):
        if rivals is None or place >= most or s.gain < best - max(REFIT_GAIN_MARGIN, REFIT_GAIN_SHARE * best):
            out.append(Candidate(s.effect, None, s.ln_bayes_factor))
            continue
        found = fit_hypothesis(fitted.hypothesis.extended(s.effect), s.start, fitted.noise)
        out.append(judged(fitted, found, s, flexible, rivals))
    out.sort(key=lambda c: -c.ln_bayes_factor)
    if (
        steps
        and flexible
        and flexible[0].ln_bayes_factor >= STRONG_LN_BAYES_FACTOR
        and not any(c.fitted and c.worthy for c in out)
    ):
        return _best_again(fitted, out)
    return out


def _best_again(fitted: FittedHypothesis, found: Sequence[Candidate]) -> list[Candidate]:
    """Candidates with the best law among them judged by the noise that is left beside it as well."""
    laws = [c for c in found if c.beside is not None and c.plausible and not members_of(c.effect)]
    if (
        not laws
        or laws[0].fitted is None
        or laws[0].beside is None
        or laws[0].beside.carried < LEAST_SHARE_FOR_OWN_NOISE
    ):
        return list(found)
    again = in_own_noise(fitted, laws[0].fitted)
    return [replace(c, in_own_noise=again) if c is laws[0] else c for c in found]


def in_own_noise(fitted: FittedHypothesis, extended: FittedHypothesis) -> Candidate | None:
    """Judge an effect by the noise that is left beside it.

    The noise of the model without the effect is estimated beside smooth functions. What a strong effect has that is not
    smooth, such as the corner of a limit, passes for noise then, with a memory in which most of the effect counts for
    little, and the little that its form leaves for much.

    Parameters
    ----------
    fitted, extended : FittedHypothesis
        The model, and the same with the effect around it.

    Returns
    -------
    Candidate or None
        None where that noise is not smaller, by `STRONG_LN_BAYES_FACTOR` in log likelihood, so that nothing would
        change.
    """
    both = _in_noise_beside(fitted, extended)
    if both is None:
        return None
    bare, found = both
    flexible = gains(bare, terms_of(bare))
    effect = extended.hypothesis.effects[-1]
    return judged(bare, found, screen(bare, effect), flexible, Rivals.of(bare, flexible))


def _in_noise_beside(
    fitted: FittedHypothesis, extended: FittedHypothesis
) -> tuple[FittedHypothesis, FittedHypothesis] | None:
    """A model and the same with an effect, both with the noise that is left beside it; None where it is not smaller."""
    found = fit_with_noise(extended.hypothesis, extended.z)
    smaller = sum(a.log_scale - b.log_scale for a, b in zip(fitted.noise, found.noise, strict=True))
    if smaller < STRONG_LN_BAYES_FACTOR:
        return None
    return fit_hypothesis(fitted.hypothesis, fitted.z, found.noise), found


def _best_law(fitted: FittedHypothesis, screened: Sequence[Screened]) -> float:
    """Greatest gain of an effect that fits with plausible numbers, and is not a random effect, which always gains."""
    laws = (
        s.gain
        for s in screened
        if not members_of(s.effect) and is_plausible(fitted.hypothesis.extended(s.effect), s.start)
    )
    return next(laws, screened[0].gain if screened else 0.0)


def _in_steps(fitted: FittedHypothesis, screened: Sequence[Screened], *, every: bool) -> list[Screened]:
    """Screened effects with what they gain in a few steps of a fit, greatest gain first.

    The least of them stay as they are; and if not every one is tried, all that have not more numbers than
    `PARAMETER_SLICES` counts, whose grid is fine enough.
    """
    out, best = [], _best_law(fitted, screened)
    for s in screened:
        many = _shaping(s.effect.parameters(fitted.hypothesis.scales)) > max(PARAMETER_SLICES)
        if s.gain < NEGLIGIBLE_GAIN_SHARE * best or not (every or (many and not members_of(s.effect))):
            out.append(s)
            continue
        gain, start = gained_in_steps(fitted, s.effect, s.start)
        # a Bayes factor is no greater than the gain of likelihood; that of the signature may be, far from the model
        out.append(replace(s, gain=gain, start=start, ln_bayes_factor=min(s.ln_bayes_factor, max(gain, 0.0))))
    return sorted(out, key=lambda s: -s.gain)


def judged(
    fitted: FittedHypothesis,
    extended: FittedHypothesis,
    screened: Screened,
    flexible: Sequence[TermEvidence],
    rivals: Rivals,
) -> Candidate:
    """Weigh an effect against flexible terms and shapes of the curve, and beside them.

    Parameters
    ----------
    fitted, extended : FittedHypothesis
        The model, and the same with the effect around it.
    screened : Screened
        The effect over the grid of its parameters.
    flexible : sequence of TermEvidence
        What flexible terms bring to the model.
    rivals : Rivals
        The best of that, and shapes.
    """
    extended = within_range(extended, extended.ln_evidence - fitted.ln_evidence)
    signature = signature_at_mode(fitted, extended)
    guard, covariate = flexible_alternative(signature, flexible, screened)
    guard -= surprise_of_size(fitted, extended)
    gained = extended.ln_evidence - fitted.ln_evidence
    beside = (
        EvidenceBeside.of(gained, offer(extended), rivals.terms) if gained >= LEAST_LN_BAYES_FACTOR else None
    )
    beyond_form = rivals.forms.share_beyond(signature)
    found = Candidate(screened.effect, extended, gained, guard, covariate, beside, beyond_form)
    if beside is None or not (found.plausible and found.beats_flexible):
        return found
    if claims_a_stage(screened.effect) or not found.beyond_shape:
        found = replace(found, one_stage=rivals.shapes.worth(gained - LEAST_LN_BAYES_FACTOR))
        if found.beats_shape and np.isfinite(found.one_stage):
            found = replace(found, behind_shape=_behind_shape(fitted, extended))
    if not found.beats_shape:
        return found
    jumps = rivals.jumps_within_cycles if members_of(screened.effect) else rivals.jumps
    if not jumps.are_rivals_of(gained):
        return found
    explained = beside.beyond_shape + beside.rest_beyond_shape
    return replace(found, over_jumps=jumps.evidence_over(extended, explained))


def _behind_shape(fitted: FittedHypothesis, extended: FittedHypothesis) -> float:
    """How far an effect is behind the shapes of one stage by the noise beside it; see `Candidate.behind_shape`."""
    both = _in_noise_beside(fitted, extended)
    if both is None:
        return -np.inf
    bare, found = both
    gained = found.ln_evidence - bare.ln_evidence
    shape = OneStageShapes(bare).worth((1.0 + MOST_SHARE_OF_FORM) * gained)
    return (shape - gained) / max(gained, LEAST_LN_BAYES_FACTOR)


def screen(fitted: FittedHypothesis, effect: Effect) -> Screened:
    """Lay the signature of an effect over the residuals of a fit."""
    if members_of(effect):
        return _screened_together(fitted, effect)
    extended = fitted.hypothesis.extended(effect)
    space = extended.space
    parameters = effect.parameters(extended.scales)
    grid = _grid(parameters)
    theta = np.concatenate([np.tile(fitted.theta, (len(grid), 1)), grid], axis=1)
    change = stacked(extended, fitted.blocks, theta) - stacked(fitted.hypothesis, fitted.blocks, fitted.theta)
    signature = fitted.whiten(np.nan_to_num(change)).T
    left = fitted.project_out(signature)
    a = np.einsum("ij,ij->j", signature, left)
    b = signature.T @ fitted.left
    ends = parameters[0].prior.quantile(np.array([1e-3, 1.0 - 1e-3]))
    with np.errstate(divide="ignore", invalid="ignore"):
        size = np.clip(np.where(a > 0.0, grid[:, 0] * b / a, grid[:, 0]), *ends)
        factor = size / grid[:, 0]
    gain = np.where(a > 0.0, factor * b - 0.5 * factor**2 * a, -np.inf)
    best = int(np.argmax(gain))
    point = grid[best].copy()
    point[0] = size[best]
    start = space.unconstrain(np.concatenate([fitted.theta, point]))
    # the model's own parameters make room for what the effect takes over
    pull = fitted.jacobian.T @ (fitted.whitened - factor[best] * signature[:, best])
    start[: fitted.z.size] += np.linalg.solve(fitted.precision, pull)
    shown = a > 1e-12
    value = float(_averaged(b[shown, None], a[shown])[0]) if shown.any() else -np.inf
    return Screened(effect, float(gain[best]), start, value, left[:, shown], a[shown])


def _screened_together(fitted: FittedHypothesis, effect: Effect) -> Screened:
    """A random effect, of which all members are laid over the residuals at once."""
    found = lay_together(fitted, effect)
    if found.term is None:
        nothing = np.empty((fitted.whitened.size, 0))
        return Screened(effect, -np.inf, found.start, -np.inf, nothing, np.empty(0))
    term = found.term
    return Screened(
        effect, found.gain, found.start, term.ln_bayes_factor, term.directions, term.information, term
    )


def _averaged(b: Floats, information: Floats) -> Floats:
    """Log Bayes factor of a single column with a normal coefficient, averaged over columns and sizes, shape (S,)."""
    if not information.size:
        return np.full(b.shape[1], -np.inf)
    each = []
    for scale in SCREENED_SCALES:
        each.append(0.5 * b**2 / (information + scale**-2.0)[:, None])
        each[-1] -= 0.5 * np.log1p(scale**2 * information)[:, None]
    return np.asarray(logsumexp(each, axis=(0, 1)) - np.log(len(SCREENED_SCALES) * information.size))


def _grid(parameters: Sequence[Parameter]) -> Floats:
    """Values of an effect's parameters that are tried, shape (G, P): sizes by slices of the others that shape it."""
    sizes = SCREENED_QUANTILES[isinstance(parameters[0].prior, LogNormal)]
    count = PARAMETER_SLICES.get(_shaping(parameters), 3)
    shapes = [(i + 0.5) / count for i in range(count)]
    levels = [sizes, *((0.5,) if p.refines else shapes for p in parameters[1:])]
    tried = [p.prior.quantile(np.array(level)) for p, level in zip(parameters, levels, strict=True)]
    return np.array([*product(*tried)])


def _shaping(parameters: Sequence[Parameter]) -> int:
    """How many parameters beside the size are tried at more than one value."""
    return sum(not p.refines for p in parameters[1:])


def is_plausible(hypothesis: Hypothesis, z: Floats) -> bool:
    """Whether the last effect has numbers that its mechanism can have.

    How large an effect is may surprise. But a time constant, a width or a ratio beyond what `BELIEVABLE_PRIOR_MASS` of
    its prior holds, a range from the literature, is that of something else.
    """
    return np.array_equal(_nearest_believable(hypothesis, z), z)


def within_range(fitted: FittedHypothesis, gained: float = 0.0) -> FittedHypothesis:
    """A fit as it is if its last effect has numbers that its mechanism can have, or with the nearest ones that it can.

    A time constant that is shorter than the data resolve has its mode anywhere below. What counts is whether the effect
    explains as much, within `LEAST_LN_BAYES_FACTOR`, or `MAX_LOSS_IN_BELIEVABLE_RANGE` of it, with numbers that can be
    believed; where it does not, it fits only with others.

    Parameters
    ----------
    fitted : FittedHypothesis
    gained : float
        Log Bayes factor of the effect.
    """
    nearest = _nearest_believable(fitted.hypothesis, fitted.z)
    if np.array_equal(nearest, fitted.z):
        return fitted
    held = fitted.hypothesis.effect_positions[fitted.hypothesis.effects[-1].id].size - 1
    believable = fit_held(fitted.hypothesis, nearest, fitted.noise, held)
    enough = fitted.ln_evidence - max(LEAST_LN_BAYES_FACTOR, MAX_LOSS_IN_BELIEVABLE_RANGE * gained)
    return believable if believable.ln_evidence > enough else fitted


def _nearest_believable(hypothesis: Hypothesis, z: Floats) -> Floats:
    """Sampled coordinates with the numbers of the last effect, but for its size, moved into their ranges."""
    effect = hypothesis.effects[-1]
    tails = np.array([0.5 - 0.5 * BELIEVABLE_PRIOR_MASS, 0.5 + 0.5 * BELIEVABLE_PRIOR_MASS])
    out, numbers = z.copy(), effect.parameters(hypothesis.scales)[1:]
    for i, parameter in enumerate(numbers, z.size - len(numbers)):
        ends = parameter.prior.transform.unconstrain(parameter.prior.quantile(tails))
        out[i] = np.clip(z[i], *np.sort(ends))
    return out


def cancels(fitted: FittedHypothesis) -> bool:
    """Whether the last effect adds several times as much to a channel as was measured of it in all.

    Then the model has to take that away again, and what was measured is the small difference of two large things that
    nobody has seen: the shape of the one is made of the other. A heat balance takes a part of every loss into its own,
    so its temperature does not count.
    """
    effect = fitted.hypothesis.effects[-1]
    change = added_by(effect, fitted.hypothesis, fitted.blocks, fitted.theta)
    for channel in fitted.hypothesis.channels:
        own = [b.at for b in fitted.blocks if b.channel == channel]
        added, seen = (np.concatenate([x[at] for at in own]) for x in (change, fitted.observed))
        if channel != "temperature" and np.ptp(added) > CANCELLING_SIZE * np.ptp(seen):
            return True
    return False


def signature_at_mode(fitted: FittedHypothesis, extended: FittedHypothesis) -> Floats:
    """What the last effect adds at its mode, whitened as before and less what the model absorbs, shape (N,)."""
    effect = extended.hypothesis.effects[-1]
    change = added_by(effect, extended.hypothesis, fitted.blocks, extended.theta)
    return fitted.project_out(fitted.whiten(change)[:, None])[:, 0]


def flexible_alternative(
    signature: Floats, flexible: Sequence[TermEvidence], screened: Screened
) -> tuple[float, str]:
    """Bayes factor of a flexible term that contains most of a signature, and the covariate of the best one.

    Which of the terms that do is not known beforehand, so it is averaged over them. A line or a step is no guard
    against an effect that can have no other form: it is the effect itself, without its name. Nor is a level of each
    member against a random effect.

    Parameters
    ----------
    signature : ndarray, shape (N,)
        Of the effect at its mode, as of `signature_at_mode`.
    flexible : sequence of TermEvidence
    screened : Screened
        The effect over the grid of its parameters.
    """
    found = []
    for gain in flexible:
        if gain.term.covariate in members_of(screened.effect):
            continue
        if float(_contained(gain, signature[:, None])[0]) < CONTAINED_SHARE:
            continue
        if gain.information.size > 1 or np.any(_contained(gain, screened.signatures) < IDENTICAL_SHARE):
            found.append((gain.ln_bayes_factor, gain.term.covariate))
    if not found:
        return -np.inf, ""
    return float(logsumexp([f[0] for f in found]) - np.log(len(found))), max(found)[1]


def surprise_of_size(fitted: FittedHypothesis, extended: FittedHypothesis) -> float:
    """How much less likely the size of the last effect was by its prior than as the coefficient of a flexible term.

    How large an effect is may surprise. A function without meaning has any size, so that what a small size of the one
    costs says nothing for the other. As a difference of log densities, at least 0; 0 for a random effect, whose size is
    a scatter.

    Parameters
    ----------
    fitted, extended : FittedHypothesis
        The model, and the same with the effect around it.
    """
    hypothesis = extended.hypothesis
    effect = hypothesis.effects[-1]
    at = int(hypothesis.effect_positions[effect.id][0])
    size = float(extended.theta[at])
    change = added_by(effect, hypothesis, extended.blocks, extended.theta)
    if members_of(effect) or size == 0.0 or not np.any(change):
        return 0.0
    own = hypothesis.space.parameters[at].prior.log_density(np.array(size)) + np.log(abs(size))
    return max(0.0, log_density_of_size(fitted, change) - float(own))


def _contained(gain: TermEvidence, signatures: Floats) -> Floats:
    """Share of each signature (N, G) that a flexible term contains."""
    parts = (gain.directions.T @ signatures) ** 2 / gain.information[:, None]
    return np.asarray(parts.sum(axis=0) / np.maximum(np.einsum("ij,ij->j", signatures, signatures), 1e-300))
