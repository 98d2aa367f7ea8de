"""A whole study: the loop, the posterior of what was added, the gap on held-out measurements, and all of it as JSON."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from sma_bayes.account import Account
from sma_bayes.arrays import Floats
from sma_bayes.effects import EFFECTS, Effect
from sma_bayes.effects.needs import of_heating, untestable
from sma_bayes.parameters.distributions import family_name, numbers
from sma_bayes.parameters.priors_file import PriorSet
from sma_bayes.quantities import QUANTITIES, SPECIMEN_QUANTITY
from sma_bayes.records.history import History
from sma_bayes.records.types import Campaign
from sma_bayes.response.base import ResponseModel
from sma_bayes.response.modified_sigmoid import ModifiedSigmoid
from sma_bayes.runs.documents import GAP
from sma_bayes.sampling.ensembles import Draws
from sma_bayes.studies.gap.close import NOISE_ALONE, ChannelGap, Gap, HeldOutScore, close, held_out_scores
from sma_bayes.studies.gap.density import sample_hypothesis
from sma_bayes.studies.gap.experiments import ProposedExperiment, next_experiment
from sma_bayes.studies.gap.fitting import FittedHypothesis, nearest
from sma_bayes.studies.gap.heating import heat_parameters, study_heating
from sma_bayes.studies.gap.locate import Disagreement
from sma_bayes.studies.gap.name import MISSHAPEN, WORTH, Candidate, EvidenceBeside
from sma_bayes.studies.gap.noise import BlockNoise, ChannelBlock, scatter
from sma_bayes.studies.gap.periodic import FrequencyBand, Spectra
from sma_bayes.studies.gap.study import (
    APART,
    CARRIED,
    CARRIED_BESIDE,
    FURTHER,
    MOST,
    SIGNIFICANT,
    GapStudy,
    Step,
    is_worthy,
    study_campaign,
)
from sma_bayes.studies.gap.sweeps import NUMBERS, cycle_law, suspects, sweep_numbers
from sma_bayes.studies.gap.words import covariate_text

METRIC = (
    "root mean square of held-out residuals, as innovations of the noise, in its standard deviations; "
    "1 where only noise is left"
)
HEATING = "heating"
"""What the study of the heat balance is called in names of files and figures."""
STAGES = MOST + 9
"""Stages that progress counts: the first fit, at most so many looks, held-out data twice, sampling; and for the heat
balance one for fit and looks, and the others again."""
Progress = Callable[[int, str], None]
"""Told how many of `STAGES` are done, and what is going on."""

QUANTILES = np.array([0.05, 0.5, 0.95])
HALF = 0.5
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
    looks = iter(range(MOST + 2))
    with account.timed("study"):
        study = study_campaign(
            campaign,
            priors,
            model=model,
            pooled=pooled,
            effects=effects,
            seed=seed,
            progress=lambda message: tell(next(looks, MOST + 1), message),
        )
    judge = partial(_judged, pooled=pooled, seed=seed, jobs=jobs, account=account)
    judged = judge(study, effects, lambda i, m: tell(MOST + 2 + i, m), checkpoint=checkpoint)
    with account.timed("study"):
        of_heat = study_heating(
            campaign,
            study,
            priors,
            pooled=pooled,
            effects=effects,
            seed=seed,
            progress=lambda message: tell(MOST + 5, f"the heat balance: {message}"),
        )
    if of_heat is None:
        return judged
    beside = checkpoint and checkpoint.with_stem(f"{checkpoint.stem}_{HEATING}")
    heating = judge(
        of_heat,
        of_heating(effects),
        lambda i, m: tell(MOST + 6 + i, f"the heat balance: {m}"),
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
        draws = None
        if study.effects:
            seeds = np.random.SeedSequence([seed, 13])
            draws = sample_hypothesis(study.final, seeds, checkpoint=checkpoint)
    with account.timed("next_experiment"):
        experiments = _experiments(study)
    return GapOutcome(study, draws, gap, scores, experiments, pooled, seed)


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


def outcome_json(outcome: GapOutcome) -> dict[str, Any]:
    """What `gap.json` holds, apart from what every run records (seed, versions, times).

    Without a disagreement beyond chance ``disagreement`` is empty, and the stretches that lean most are under
    ``within_chance``. Without a name ``effects`` is empty, and what was added on the way is under ``partial``.
    """
    study = outcome.study
    found = [_disagreement_json(d) for d in study.disagreements]
    effects = [_effect_json(outcome, e) for e in study.effects]
    none, named = study.verdict == "none", study.verdict == "named"
    return {
        "schema": GAP.schema,
        "verdict": study.verdict,
        "p_value": study.p_value,
        "p_value_extrapolated": study.steps[0].look.extrapolated,
        "converged": outcome.converged,
        "disagreement": [] if none else found,
        "within_chance": found if none else [],
        "periodic": [asdict(line) for line in study.periodic],
        "effects": effects if named else [],
        "partial": [] if named else effects,
        "candidates": [
            _candidate_json(outcome, c)
            for c in sorted(study.steps[0].candidates, key=lambda c: _order(study, c.effect.id))
        ],
        "rounds": [_round_json(s) for s in study.steps],
        "remaining": {
            "p_value": study.left.p_value,
            "covariate": study.left.best.term.covariate,
            "channel": study.left.best.term.channel,
            "ln_bayes_factor": study.left.best.ln_bayes_factor,
            "share": study.remainder if study.effects else None,
            "share_without_shape": 1.0 - study.carried if study.effects else None,
        },
        "gap": {
            "metric": METRIC,
            "before": outcome.gap.before,
            "after": outcome.gap.after,
            "floor": outcome.gap.floor,
            "shrink": outcome.gap.shrink,
            "noise": NOISE_ALONE,
            "way_to_noise": outcome.gap.way_to_noise,
            "channels": {c: _channel_gap_json(g, study.final, c) for c, g in outcome.gap.channels.items()},
            "held_out": outcome.gap.held_out,
            "chosen_without": [list(c) for c in outcome.gap.chosen],
        },
        "thresholds": {
            "p_value": SIGNIFICANT,
            "ln_bayes_factor": WORTH,
            "ln_bayes_factor_apart": APART,
            "unexplained_share": round(1.0 - CARRIED, 6),
            "share_beside": CARRIED_BESIDE,
            "ln_bayes_factor_shape": MISSHAPEN,
            "further_share": FURTHER,
        },
        "sweeps": _sweeps_json(study),
        "suspects": [asdict(s) for s in suspects(nearest(study.baseline))],
        "channels": _channels(study.final),
        "units": dict(study.final.hypothesis.histories[0].units),
        "conditions": [_condition_json(h) for h in study.final.hypothesis.histories],
        "noise": [
            _noise_json(study.final, block, noise, band)
            for block, noise, band in zip(
                study.final.blocks, study.final.noise, Spectra(study.final).bands(), strict=True
            )
        ],
        "heating": None if outcome.heating is None else _heating_json(outcome.heating),
    }


def _heating_json(outcome: GapOutcome) -> dict[str, Any]:
    """What ``heating`` of `gap.json` holds: the same keys, and the parameters of the heat balance."""
    stated = outcome_json(outcome)
    del stated["schema"], stated["heating"]
    return {**stated, "parameters": heat_parameters(outcome.study, outcome.flat, outcome.seed)}


def _channel_gap_json(gap: ChannelGap, fitted: FittedHypothesis, channel: str) -> dict[str, Any]:
    unit = fitted.hypothesis.histories[0].units[channel]
    return {"unit": unit, **asdict(gap), "way_to_noise": gap.way_to_noise}


def _sweeps_json(study: GapStudy) -> dict[str, Any]:
    """Numbers of each sweep about the common curve, and their law of the cycle where there is something to explain."""
    found = sweep_numbers(nearest(study.baseline))
    law = None
    if study.verdict != "none":
        law = asdict(cycle_law(found, np.random.default_rng(0)))
    numbers = [
        {
            "condition": s.condition, "branch": s.branch, "channel": s.channel, "cycle": s.cycle,
            **dict(zip(NUMBERS, s.values, strict=True)),
            **{f"{name}_sd": sd for name, sd in zip(NUMBERS, s.sds, strict=True)},
        }
        for s in found
    ]  # fmt: skip
    return {"law": law, "numbers": numbers}


def _disagreement_json(d: Disagreement) -> dict[str, Any]:
    return {
        "condition": d.condition,
        "branch": d.branch,
        "channel": d.channel,
        "covariate": d.covariate,
        "from": d.start,
        "to": d.stop,
        "unit": d.unit,
        "size_sigma": d.size_sigma,
        "mean_residual": d.mean,
    }


def _channels(fitted: FittedHypothesis) -> dict[str, dict[str, str]]:
    """Name, symbol and unit of each channel, as this campaign calls it."""
    first = fitted.hypothesis.histories[0]
    names = {c: SPECIMEN_QUANTITY.get(c, c) if first.specimen else c for c in fitted.hypothesis.channels}
    return {c: {"name": n, "symbol": QUANTITIES[n].symbol, "unit": first.units[c]} for c, n in names.items()}


def _condition_json(history: History) -> dict[str, Any]:
    settings = {k: v for k, v in asdict(history.condition).items() if k != "id" and v is not None}
    return {
        "id": history.condition.id,
        "settings": settings,
        "n": history.n,
        "cycles": int(np.unique(history.inputs["cycle"]).size),
        "rows_averaged": history.averaged,
    }


def _noise_json(
    fitted: FittedHypothesis, block: ChannelBlock, noise: BlockNoise, band: FrequencyBand | None
) -> dict[str, Any]:
    follows = ~block.first
    return {
        "condition": fitted.hypothesis.histories[block.history].condition.id,
        "channel": block.channel,
        "sd": noise.sd,
        "lag1": float(np.median(noise.memory[follows])) if follows.any() else 0.0,
        "scatter": scatter(fitted.residual[block.at], block),
        "spectrum": None if band is None else asdict(band),
    }


def _effect_json(outcome: GapOutcome, effect: Effect) -> dict[str, Any]:
    study = outcome.study
    place, step, chosen = _added(study)[effect.id]
    experiment = outcome.experiments.get(effect.id)
    return {
        "id": effect.id,
        "title": effect.title,
        "equation": effect.equation,
        "reference": effect.reference,
        "round": place,
        "class": list(step.class_),
        "probability": probability(step, chosen),
        "ln_bayes_factor": chosen.ln_bayes_factor,
        "guard": _finite(chosen.guard),
        "guard_covariate": chosen.guard_covariate,
        **_beside_json(chosen.beside),
        "parameters": _parameters_json(outcome, effect),
        "next_experiment": None if experiment is None else str(experiment),
    }


def _beside_json(beside: EvidenceBeside | None) -> dict[str, Any]:
    """What an effect was worth beside flexible terms, in the round in which it was judged."""
    left = None if beside is None else beside.remainder
    return {
        "ln_bayes_factor_beside": None if beside is None else beside.over,
        "share": None if beside is None else beside.carried,
        "shape_apart": beside is not None and beside.shape_apart,
        "remainder": None if beside is None or left is None else {
            "covariate": left.term.covariate, "channel": left.term.channel, "ln_bayes_factor": left.ln_bayes_factor,
            "share": 1.0 - beside.carried,
        },
    }  # fmt: skip


def _added(study: GapStudy) -> dict[str, tuple[int, Step, Candidate]]:
    """For each effect that was ever added, the round, counted from 1, the step, and what was found about it then."""
    return {
        s.chosen.effect.id: (i, s, s.chosen) for i, s in enumerate(study.steps, 1) if s.chosen is not None
    }


def _order(study: GapStudy, name: str) -> int:
    """Effects that were added come first, in that order; the others stay as they were ranked."""
    added = list(_added(study))
    return added.index(name) if name in added else len(added)


def _parameters_json(outcome: GapOutcome, effect: Effect) -> dict[str, Any]:
    hypothesis = outcome.study.final.hypothesis
    free = hypothesis.space.free_index.tolist()
    if outcome.draws is None:
        return {}
    convergence = outcome.draws.convergence
    out = {}
    at = hypothesis.effect_positions[effect.id].tolist()
    for i, p in zip(at, effect.parameters(hypothesis.scales), strict=True):
        z = free.index(i)
        out[p.name] = {
            "unit": p.unit,
            "meaning": p.meaning,
            **_quantiles(outcome.flat[:, i]),
            "rhat": float(convergence.rhat[z]),
            "ess_bulk": float(convergence.ess_bulk[z]),
            "ess_tail": float(convergence.ess_tail[z]),
            "prior": {
                "family": family_name(p.prior), **numbers(p.prior), "source": p.source,
                **dict(zip(("q05", "median", "q95"), p.prior.quantile(QUANTILES).tolist(), strict=True)),
            },
        }  # fmt: skip
    return out


def _quantiles(draws: Floats) -> dict[str, float]:
    return dict(zip(("q05", "median", "q95"), np.quantile(draws, QUANTILES).tolist(), strict=True))


def probability(step: Step, candidate: Candidate) -> float:
    """Probability of an effect among all testable effects, the flexible terms, and nothing.

    Half of the prior probability is on nothing; the other half is shared equally by the effects that could be tested
    and by the flexible terms as one more. Half of what an effect gets is for the effect with a flexible term on top.
    """
    tested = [c.weight for c in step.candidates if not c.untestable]
    share = np.log((1.0 - HALF) / (len(tested) + 1))
    rivals = np.array([np.log(HALF), share + step.look.best.ln_bayes_factor, *(share + b for b in tested)])
    return float(np.exp(share + candidate.weight - np.logaddexp.reduce(rivals)))


def _candidate_json(outcome: GapOutcome, candidate: Candidate) -> dict[str, Any]:
    """As judged in the first round; what was added in a later one, as judged then."""
    study = outcome.study
    place, _, candidate = _added(study).get(candidate.effect.id, (1, study.steps[0], candidate))
    score = outcome.scores.get(candidate.effect.id)
    status, why = judgement(study, candidate)
    return {
        "id": candidate.effect.id,
        "title": candidate.effect.title,
        "round": place,
        "refitted": candidate.fitted is not None,
        "ln_bayes_factor": None if candidate.untestable else candidate.ln_bayes_factor,
        "delta_elpd_held_out": None if score is None else score.delta,
        "delta_elpd_se": None if score is None else score.se,
        "status": status,
        "why": why,
        "unmet": _unmet(study, candidate) if candidate.untestable else [],
    }


def _unmet(study: GapStudy, candidate: Candidate) -> list[str]:
    """Needs of an effect that the measurements do not meet."""
    found = study.baseline.hypothesis.histories
    return [need for need in candidate.effect.needs if untestable((need,), found)]


def judgement(study: GapStudy, candidate: Candidate) -> tuple[str, str]:
    """Status of a candidate, and why, in words."""
    name = candidate.effect.id
    if candidate.untestable:
        return "untestable", "; ".join(dict.fromkeys(candidate.untestable.split("; ")))
    if name in _added(study):
        return _judgement_of_added(study, candidate)
    for leader, members in study.classes.items():
        if name in members:
            return "rejected", f"these data cannot tell it from {leader}, within {APART:g} of ln Bayes factor"
    if study.p_value > SIGNIFICANT:
        return "rejected", f"there is no disagreement to explain (p = {study.p_value:.2g})"
    if candidate.fitted is None:
        return "rejected", "its signature explains far less of the residuals than the best one's"
    if candidate.ln_bayes_factor < WORTH:
        return "rejected", f"ln Bayes factor {candidate.ln_bayes_factor:.1f}, below {WORTH:g}"
    if not candidate.plausible:
        return "rejected", "it fits only with numbers that the mechanism cannot have"
    if candidate.ln_bayes_factor < candidate.one_stage + WORTH:
        return "rejected", (
            f"one stage of another shape explains as much (ln Bayes factor {candidate.one_stage:.1f} against "
            f"{candidate.ln_bayes_factor:.1f}); --model offers richer ones"
        )
    if not is_worthy(candidate):
        return "rejected", (
            f"a meaningless smooth function of {_called(study, candidate.guard_covariate)} explains more "
            f"(ln Bayes factor {candidate.guard:.1f} against {candidate.ln_bayes_factor:.1f}), "
            f"{_beside_text(study, candidate)}"
        )
    return "rejected", "another effect explains more, and once that is added this one is not needed"


def _beside_text(study: GapStudy, candidate: Candidate) -> str:
    """Why an effect isn't worth more beside a flexible term than that term is alone."""
    beside = candidate.beside
    if beside is None or beside.over < WORTH or beside.remainder is None:
        return "and as much without the effect as with it"
    return (
        f"and the effect carries no more than {100.0 * beside.carried:.0f} % of what it explains together with a "
        f"function of {_called(study, beside.remainder.term.covariate)}"
    )


def _called(study: GapStudy, covariate: str) -> str:
    return covariate_text({"channels": _channels(study.final)}, covariate)


def _judgement_of_added(study: GapStudy, candidate: Candidate) -> tuple[str, str]:
    place = _added(study)[candidate.effect.id][0]
    if all(e.id != candidate.effect.id for e in study.effects):
        return "rejected", f"added in round {place}, and made needless by what was added later"
    if study.verdict != "named":
        return (
            "rejected",
            f"added in round {place}, but too much of the disagreement remains for it to be the cause",
        )
    if candidate.ln_bayes_factor > candidate.guard:
        why = "worth more than its price, and than a flexible term in its place"
    elif is_worthy(candidate) and candidate.beside is not None:
        why = (
            "with a flexible term on top it explains more than the best such term alone, and it carries "
            f"{100.0 * candidate.beside.carried:.0f} % of that"
            f"{', the shape of the curve apart' if candidate.beside.shape_apart else ''}"
        )
    else:
        why = "beside the effect of the next round it beats what is flexible"
    return "named", f"added in round {place}: {why}"


def _round_json(step: Step) -> dict[str, Any]:
    return {
        "p_value": step.look.p_value,
        "flexible": [
            {"covariate": g.term.covariate, "channel": g.term.channel, "ln_bayes_factor": g.ln_bayes_factor}
            for g in step.look.gains[:5]
        ],
        "added": None if step.chosen is None else step.chosen.effect.id,
        "class": list(step.class_),
        "candidates": [
            {
                "id": c.effect.id, "ln_bayes_factor": c.ln_bayes_factor, "guard": _finite(c.guard),
                "guard_covariate": c.guard_covariate,
                "ln_bayes_factor_beside": None if c.beside is None else c.beside.over,
                "share": None if c.beside is None else c.beside.carried,
            }
            for c in step.candidates if c.fitted is not None
        ],
    }  # fmt: skip


def _finite(value: float) -> float | None:
    return value if np.isfinite(value) else None
