"""A whole study: the loop, the posterior of what was added, and the gap on held-out measurements."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from sma_bayes.account import Account
from sma_bayes.arrays import Floats
from sma_bayes.effects import EFFECTS, Effect
from sma_bayes.effects.needs import of_heating
from sma_bayes.parameters.priors_file import PriorSet
from sma_bayes.quantities import QUANTITIES, SPECIMEN_QUANTITY
from sma_bayes.records.types import Campaign
from sma_bayes.response.base import ResponseModel
from sma_bayes.response.modified_sigmoid import ModifiedSigmoid
from sma_bayes.sampling.ensembles import Draws
from sma_bayes.studies.gap.close import Gap, HeldOutScore, close, held_out_scores
from sma_bayes.studies.gap.density import sample_hypothesis
from sma_bayes.studies.gap.experiments import ProposedExperiment, next_experiment
from sma_bayes.studies.gap.fitting import FittedHypothesis
from sma_bayes.studies.gap.heating import study_heating
from sma_bayes.studies.gap.least_squares import least_squares_of
from sma_bayes.studies.gap.name import (
    CANCELLING_SIZE,
    LEAST_LN_BAYES_FACTOR,
    LEAST_SHARE_BESIDE_FLEXIBLE,
    Candidate,
    cancels,
)
from sma_bayes.studies.gap.schema import NamedChannel, Status
from sma_bayes.studies.gap.study import (
    LN_BAYES_FACTOR_TOLD_APART,
    MAX_EFFECTS,
    SIGNIFICANT_P,
    GapStudy,
    Step,
    is_worthy,
    study_campaign,
)
from sma_bayes.studies.gap.words import covariate_text

HEATING = "heating"
"""What the study of the heat balance is called in names of files and figures."""
STAGES = MAX_EFFECTS + 9
"""Stages that progress counts: the first fit, at most so many looks, held-out data twice, sampling; and for the heat
balance one for fit and looks, and the others again."""
Progress = Callable[[int, str], None]
"""Told how many of `STAGES` are done, and what is going on."""

PRIOR_OF_NOTHING = 0.5
"""Prior probability that nothing is missing; what is left is shared by the testable effects and the flexible terms."""


@dataclass(frozen=True, slots=True, eq=False)
class GapOutcome:
    """What a gap study gives.

    Attributes
    ----------
    study : GapStudy
    draws : Draws or None
        Posterior of the final model; None where no effect was added, as then it is the one that `fit` samples.
    gap : Gap
        On held-out measurements.
    scores : mapping of str to HeldOutScore
        Of the candidates of the first round, and of effects that were added later, over the model of their round.
    experiments : mapping of str to ProposedExperiment
        For each effect with rivals, what would separate them.
    pooled : bool
    seed : int
    readings_as_one : float or None
        Where the final model misses something, so that the draws are those of `least_squares_of`: how many readings
        count as one.
    heating : GapOutcome or None
        Where temperature is an outcome: the same for the heat balance.
    """

    study: GapStudy
    draws: Draws | None
    gap: Gap
    scores: Mapping[str, HeldOutScore]
    experiments: Mapping[str, ProposedExperiment]
    pooled: bool
    seed: int
    readings_as_one: float | None = None
    heating: GapOutcome | None = None

    @property
    def converged(self) -> bool:
        """Whether the draws of the final model reached their target, those of the heat balance included."""
        own = self.draws is None or self.draws.convergence.converged
        return own and (self.heating is None or self.heating.converged)

    @property
    def flat(self) -> Floats:
        """Draws of all parameters of the final model, shape (S, P); S is 0 where there are none."""
        if self.draws is None:
            return np.empty((0, len(self.study.final.hypothesis.space.parameters)))
        z = self.draws.z.reshape(-1, self.draws.z.shape[-1])
        return self.study.final.hypothesis.space.constrain(z)


def gap_outcome(
    campaign: Campaign,
    priors: PriorSet,
    *,
    model: type[ResponseModel] = ModifiedSigmoid,
    pooled: bool = False,
    effects: Mapping[str, Effect] = EFFECTS,
    seed: int = 0,
    jobs: int | None = 1,
    progress: Progress | None = None,
    account: Account | None = None,
    checkpoint: Path | None = None,
) -> GapOutcome:
    """Study a campaign from end to end.

    Parameters
    ----------
    campaign, priors, model, pooled, effects, seed
        See `study_campaign`.
    jobs : int, optional
        Processes; by default one for each core.
    progress : callable, optional
    account : Account, optional
        Told how long each part took.
    checkpoint : Path, optional
        File from which sampling goes on where it was interrupted; the study itself takes seconds and is repeated.
    """
    tell = progress or (lambda done, message: None)
    account = account if account is not None else Account()
    looks = iter(range(MAX_EFFECTS + 2))
    with account.timed("study"):
        study = study_campaign(
            campaign,
            priors,
            model=model,
            pooled=pooled,
            effects=effects,
            seed=seed,
            progress=lambda message: tell(next(looks, MAX_EFFECTS + 1), message),
        )
    judge = partial(_judged, pooled=pooled, seed=seed, jobs=jobs, account=account)
    judged = judge(study, effects, lambda i, m: tell(MAX_EFFECTS + 2 + i, m), checkpoint=checkpoint)
    with account.timed("study"):
        of_heat = study_heating(
            campaign,
            study,
            priors,
            pooled=pooled,
            effects=effects,
            seed=seed,
            progress=lambda message: tell(MAX_EFFECTS + 5, f"the heat balance: {message}"),
        )
    if of_heat is None:
        return judged
    beside = checkpoint and checkpoint.with_stem(f"{checkpoint.stem}_{HEATING}")
    heating = judge(
        of_heat,
        of_heating(effects),
        lambda i, m: tell(MAX_EFFECTS + 6 + i, f"the heat balance: {m}"),
        checkpoint=beside,
    )
    return replace(judged, heating=heating)


def _judged(
    study: GapStudy,
    effects: Mapping[str, Effect],
    tell: Progress,
    *,
    pooled: bool,
    seed: int,
    jobs: int | None,
    account: Account,
    checkpoint: Path | None,
) -> GapOutcome:
    """A study with what held-out measurements, draws and experiments say of it."""
    tell(0, "choosing and predicting without each third of the measurements")
    gap = close(study, effects, pooled=pooled, seed=seed, jobs=jobs, account=account)
    tell(1, "scoring candidates on held-out measurements")
    with account.timed("score"):
        scores = _scores(study, pooled=pooled)
    tell(2, "sampling the final model")
    with account.timed("sample"):
        draws, alike = None, None
        if study.effects:
            fitted = study.final
            if study.misses_something:
                fitted, alike = least_squares_of(fitted)
            draws = sample_hypothesis(
                fitted,
                np.random.SeedSequence([seed, 13]),
                readings_as_one=alike or 1.0,
                checkpoint=checkpoint,
            )
    with account.timed("next_experiment"):
        experiments = _experiments(study)
    return GapOutcome(study, draws, gap, scores, experiments, pooled, seed, alike)


def _scores(study: GapStudy, *, pooled: bool) -> dict[str, HeldOutScore]:
    """Of all candidates that were refitted in the first round, and of what was added in a later one."""
    first, *later = study.steps
    scores = held_out_scores(first.before, first.candidates, pooled=pooled)
    for step in later:
        if step.chosen is not None:
            scores |= held_out_scores(step.before, [step.chosen], pooled=pooled)
    return scores


def _experiments(study: GapStudy) -> dict[str, ProposedExperiment]:
    """For each effect that has rivals, what would separate them."""
    out = {}
    for step in study.steps:
        if step.chosen is not None and len(step.class_) > 1:
            fitted = {c.effect.id: c.fitted for c in step.candidates}
            rivals = [f for f in (fitted[name] for name in step.class_) if f is not None]
            proposal = next_experiment(rivals)
            if proposal is not None:
                out[step.chosen.effect.id] = proposal
    return out


def added(study: GapStudy) -> dict[str, tuple[int, Step, Candidate]]:
    """For each effect that was ever added, the round, counted from 1, the step, and what was found about it then."""
    return {
        s.chosen.effect.id: (i, s, s.chosen) for i, s in enumerate(study.steps, 1) if s.chosen is not None
    }


def named_channels(fitted: FittedHypothesis) -> dict[str, NamedChannel]:
    """Name, symbol and unit of each channel, as this campaign calls it."""
    first = fitted.hypothesis.histories[0]
    names = {c: SPECIMEN_QUANTITY.get(c, c) if first.specimen else c for c in fitted.hypothesis.channels}
    return {
        c: NamedChannel(name=n, symbol=QUANTITIES[n].symbol, unit=first.units[c]) for c, n in names.items()
    }


def probability(step: Step, candidate: Candidate) -> float:
    """Probability of an effect among all testable effects, the flexible terms, and nothing.

    Half of the prior probability is on nothing; the other half is shared equally by the effects that could be tested
    and by the flexible terms as one more. Half of what an effect gets is for the effect with a flexible term on top.
    """
    tested = [c.weight for c in step.candidates if not c.untestable]
    share = np.log((1.0 - PRIOR_OF_NOTHING) / (len(tested) + 1))
    rivals = np.array(
        [np.log(PRIOR_OF_NOTHING), share + step.look.best.ln_bayes_factor, *(share + b for b in tested)]
    )
    return float(np.exp(share + candidate.weight - np.logaddexp.reduce(rivals)))


def judgement(study: GapStudy, candidate: Candidate) -> tuple[Status, str]:
    """Status of a candidate, and why, in words."""
    name = candidate.effect.id
    if candidate.untestable:
        return "untestable", "; ".join(dict.fromkeys(candidate.untestable.split("; ")))
    if name in added(study):
        return _judgement_of_added(study, candidate)
    for leader, members in study.classes.items():
        if name in members:
            return "rejected", f"these data cannot tell it from {leader}, {_why_alike(study, leader, name)}"
    if study.p_value > SIGNIFICANT_P:
        return "rejected", f"there is no disagreement to explain (p = {study.p_value:.2g})"
    if candidate.fitted is None:
        return "rejected", (
            "not fitted in full: in the screening, by its signature or by steps of a fit, others explained far more"
        )
    if candidate.ln_bayes_factor < LEAST_LN_BAYES_FACTOR:
        return "rejected", f"ln Bayes factor {candidate.ln_bayes_factor:.1f}, below {LEAST_LN_BAYES_FACTOR:g}"
    if not candidate.plausible:
        if candidate.fitted is not None and cancels(candidate.fitted):
            return "rejected", (
                f"it would have to add more than {CANCELLING_SIZE:g} times what was measured of a channel, which the "
                "model would have to take away again"
            )
        return "rejected", "it fits only with numbers that the mechanism cannot have"
    if not candidate.beats_flexible:
        return "rejected", (
            f"a smooth function of {_called(study, candidate.guard_covariate)}, without a mechanism, explains more "
            f"(ln Bayes factor {candidate.guard:.1f} against {candidate.ln_bayes_factor:.1f}), "
            f"{_beside_text(study, candidate)}"
        )
    if not candidate.beats_shape:
        if np.isfinite(candidate.behind_shape):
            return "rejected", (
                "by the noise that is left beside it, which that of the model without it exceeds, one stage of another "
                f"shape explains {100.0 * candidate.behind_shape:.1f} % more than it does{_beyond_text(candidate)}; "
                "--model offers richer ones"
            )
        return "rejected", (
            f"one stage of another shape explains as much (ln Bayes factor {candidate.one_stage:.1f} against "
            f"{candidate.ln_bayes_factor:.1f}){_beyond_text(candidate)}; --model offers richer ones"
        )
    if not candidate.beats_jumps:
        return "rejected", (
            f"a few jumps explain more, by a ln Bayes factor of {-candidate.over_jumps:.1f}, than it does with a "
            "function without a mechanism on top of it"
        )
    return "rejected", "another effect explains more, and once that is added this one is not needed"


def _why_alike(study: GapStudy, leader: str, rival: str) -> str:
    """Why an effect is in the class of another."""
    _, step, chosen = added(study)[leader]
    less = chosen.evidence_like(chosen) - next(
        c.evidence_like(chosen) for c in step.candidates if c.effect.id == rival
    )
    if less <= LN_BAYES_FACTOR_TOLD_APART:
        return f"within {LN_BAYES_FACTOR_TOLD_APART:g} of ln Bayes factor"
    return (
        f"which explains more by a ln Bayes factor of {less:.0f}, but neither law is quite what was measured: by what "
        f"both leave to functions without a mechanism the log odds are {chosen.odds_by_form(less):.1f}"
    )


def _beside_text(study: GapStudy, candidate: Candidate) -> str:
    """Why an effect isn't worth more beside a flexible term than that term is alone."""
    beside = candidate.beside
    if beside is None or beside.over < LEAST_LN_BAYES_FACTOR or beside.remainder is None:
        return "and as much without the effect as with it"
    return (
        f"and the effect carries no more than {100.0 * beside.carried:.0f} % of what it explains together with a "
        f"function of {_called(study, beside.remainder.term.covariate)}"
    )


def _beyond_text(candidate: Candidate) -> str:
    """What an effect explains beside a curve of any shape."""
    beside = candidate.beside
    if beside is None or candidate.beyond_shape:
        return ""
    if beside.carried_beyond >= LEAST_SHARE_BESIDE_FLEXIBLE or beside.beyond_shape < LEAST_LN_BAYES_FACTOR:
        return (
            ", and of that only a ln Bayes factor of "
            f"{beside.beyond_shape:.1f} lies beyond a curve of any shape, the same in every sweep and condition"
        )
    return (
        ", and beside a curve of any shape it carries no more than "
        f"{100.0 * beside.carried_beyond:.0f} % of what can be explained"
    )


def _called(study: GapStudy, covariate: str) -> str:
    return covariate_text(named_channels(study.final), covariate)


def _judgement_of_added(study: GapStudy, candidate: Candidate) -> tuple[Status, str]:
    place = added(study)[candidate.effect.id][0]
    if all(e.id != candidate.effect.id for e in study.effects):
        return "rejected", f"added in round {place}, and made needless by what was added later"
    followed = study.followed.get(candidate.effect.id)
    if followed is not None and followed.member is not None:
        return (
            "rejected",
            f"added in round {place}, but {100.0 * followed.share:.0f} % of how its members differ is "
            f"{followed.member} alone: something happened there, and the others are alike",
        )
    if followed is not None and followed.alternates:
        return (
            "rejected",
            f"added in round {place}, but {100.0 * followed.share:.0f} % of what its members have of their own is how "
            "odd cycles differ from even ones: anything done for every second cycle explains as much",
        )
    if followed is not None:
        return (
            "rejected",
            f"added in round {place}, but {100.0 * followed.share:.0f} % of what its members have of their own goes "
            f"with their {_called(study, followed.covariate)}: a law of that explains as much",
        )
    if candidate.effect.id in study.jumped:
        return (
            "rejected",
            f"added in round {place}, but beside the other effects a few jumps explain more than it does",
        )
    if study.verdict != "named":
        return (
            "rejected",
            f"added in round {place}, but too much of the disagreement remains for it to be the cause",
        )
    own = candidate.in_own_noise
    if own is not None and own.worthy and own.carries_nearly_all and own.beside is not None:
        why = (
            "by the noise that is left beside it, which that of the model without it exceeds, it carries "
            f"{100.0 * own.beside.carried:.0f} % of what it and a flexible term on top explain"
        )
    elif candidate.ln_bayes_factor > candidate.guard:
        why = "worth more than its price, and than a flexible term in its place"
    elif candidate.worthy_outright and candidate.beside is not None:
        why = (
            "with a flexible term on top it explains more than the best such term alone, and it carries "
            f"{100.0 * candidate.beside.carried:.0f} % of that"
            f"{', the shape of the curve apart' if candidate.beside.shape_apart else ''}"
        )
    elif is_worthy(candidate) and candidate.beside is not None:
        why = (
            f"it carries {100.0 * candidate.beside.carried:.0f} % of what it and a flexible term on top explain; such "
            "a term alone, which can have any form, explains more by a hundredth at most"
        )
    else:
        why = "beside the effect of the next round it beats what is flexible"
    return "named", f"added in round {place}: {why}"
