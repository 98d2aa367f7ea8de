"""A whole study: the loop, the posterior of what was added, the gap on held-out measurements, and all of it as JSON."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from sma_bayes.effects import EFFECTS, Effect
from sma_bayes.gap.close import Gap, HeldOutScore, close, held_out_scores
from sma_bayes.gap.density import sample_hypothesis
from sma_bayes.gap.experiments import Proposal, next_experiment
from sma_bayes.gap.name import Candidate
from sma_bayes.gap.study import APART, SIGNIFICANT, WORTH, GapStudy, Progress, Step, study_campaign
from sma_bayes.inference.ensembles import Draws
from sma_bayes.parameters.priors_file import PriorSet
from sma_bayes.quantities import Floats
from sma_bayes.records.types import Campaign

METRIC = (
    "root mean square of held-out residuals, as innovations of the noise, in its standard deviations; "
    "1 where only noise is left"
)
HALF = 0.5
"""Prior probability that nothing is missing; what is left is shared by the testable effects and the flexible terms."""


@dataclass(frozen=True, slots=True, eq=False)
class GapOutcome:
    """What a gap study gives.

    Attributes
    ----------
    study : GapStudy
    draws : Draws
        Posterior of the final model.
    gap : Gap
        On held-out measurements.
    scores : mapping of str to HeldOutScore
        Of the candidates of the first round.
    experiments : mapping of str to Proposal
        For each effect with rivals, what would separate them.
    pooled : bool
    """

    study: GapStudy
    draws: Draws
    gap: Gap
    scores: Mapping[str, HeldOutScore]
    experiments: Mapping[str, Proposal]
    pooled: bool

    @property
    def flat(self) -> Floats:
        """Draws of all parameters of the final model, shape (S, P)."""
        z = self.draws.z.reshape(-1, self.draws.z.shape[-1])
        return self.study.final.hypothesis.space.to_physical(z)


def gap_outcome(
    campaign: Campaign,
    priors: PriorSet,
    *,
    pooled: bool = False,
    effects: Mapping[str, Effect] = EFFECTS,
    seed: int = 0,
    jobs: int | None = 1,
    progress: Progress | None = None,
) -> GapOutcome:
    """Study a campaign from end to end; see `study_campaign` for the parameters."""
    tell = progress or (lambda _: None)
    study = study_campaign(campaign, priors, pooled=pooled, effects=effects, seed=seed, progress=tell)
    tell("choosing and predicting without each third of the measurements")
    gap = close(study, effects, pooled=pooled, seed=seed, jobs=jobs)
    first = study.steps[0]
    scores = held_out_scores(first.before, first.candidates, pooled=pooled)
    tell("sampling the final model")
    draws = sample_hypothesis(study.final, np.random.SeedSequence([seed, 13]))
    experiments = {}
    for step in study.steps:
        if step.chosen is not None and len(step.class_) > 1:
            rivals = [
                c.fitted for c in step.candidates if c.effect.id in step.class_ and c.fitted is not None
            ]
            proposal = next_experiment(rivals)
            if proposal is not None:
                experiments[step.chosen.effect.id] = proposal
    return GapOutcome(study, draws, gap, scores, experiments, pooled)


def outcome_json(outcome: GapOutcome) -> dict[str, Any]:
    """What `gap.json` holds, apart from what every run records (seed, versions, times)."""
    study = outcome.study
    return {
        "schema": "sma-bayes/gap/1",
        "verdict": study.verdict,
        "p_value": study.p_value,
        "p_value_extrapolated": study.steps[0].look.extrapolated,
        "converged": outcome.draws.convergence.converged,
        "pooled": outcome.pooled,
        "disagreement": [
            {
                "condition": d.condition, "branch": d.branch, "channel": d.channel, "covariate": d.covariate,
                "from": d.start, "to": d.stop, "unit": d.unit, "size_sigma": d.size_sigma, "mean_residual": d.mean,
            }
            for d in study.disagreements
        ],
        "effects": [_effect_json(outcome, e) for e in study.effects],
        "candidates": [_candidate_json(outcome, c) for c in study.steps[0].candidates],
        "rounds": [_round_json(s) for s in study.steps],
        "remaining": {
            "p_value": study.left.p_value,
            "covariate": study.left.best.term.covariate,
            "channel": study.left.best.term.channel,
            "ln_bayes_factor": study.left.best.ln_bayes_factor,
        },
        "gap": {
            "metric": METRIC, "before": outcome.gap.before, "after": outcome.gap.after, "floor": outcome.gap.floor,
            "shrink": outcome.gap.shrink, "held_out": outcome.gap.held_out,
            "chosen_without": [list(c) for c in outcome.gap.chosen],
        },
        "noise": [
            {
                "condition": study.final.hypothesis.histories[b.history].condition.id, "channel": b.channel,
                "sd": n.sd, "lag1": float(np.median(n.memory[~b.first])) if (~b.first).any() else 0.0,
            }
            for b, n in zip(study.final.blocks, study.final.noise, strict=True)
        ],
    }  # fmt: skip


def _effect_json(outcome: GapOutcome, effect: Effect) -> dict[str, Any]:
    study = outcome.study
    step = next(s for s in study.steps if s.chosen is not None and s.chosen.effect.id == effect.id)
    assert step.chosen is not None
    at = study.final.hypothesis.effect_positions[effect.id]
    experiment = outcome.experiments.get(effect.id)
    return {
        "id": effect.id,
        "title": effect.title,
        "equation": effect.equation,
        "reference": effect.reference,
        "class": list(step.class_),
        "probability": probability(step, step.chosen),
        "ln_bayes_factor": step.chosen.ln_bayes_factor,
        "parameters": {
            p.name: {
                "unit": p.unit,
                "meaning": p.meaning,
                "source": p.source,
                **_quantiles(outcome.flat[:, i]),
            }
            for i, p in zip(at, effect.parameters(study.final.hypothesis.scales), strict=True)
        },
        "next_experiment": None if experiment is None else str(experiment),
    }  # fmt: skip


def _quantiles(draws: Floats) -> dict[str, float]:
    return dict(zip(("q05", "median", "q95"), np.quantile(draws, (0.05, 0.5, 0.95)).tolist(), strict=True))


def probability(step: Step, candidate: Candidate) -> float:
    """Probability of an effect among all testable effects, the flexible terms, and nothing.

    Half of the prior probability is on nothing; the other half is shared equally by the effects that could be tested
    and by the flexible terms as one more.
    """
    tested = [c.ln_bayes_factor for c in step.candidates if not c.untestable]
    share = np.log((1.0 - HALF) / (len(tested) + 1))
    rivals = np.array([np.log(HALF), share + step.look.best.ln_bayes_factor, *(share + b for b in tested)])
    return float(np.exp(share + candidate.ln_bayes_factor - np.logaddexp.reduce(rivals)))


def _candidate_json(outcome: GapOutcome, candidate: Candidate) -> dict[str, Any]:
    score = outcome.scores.get(candidate.effect.id)
    status, why = judgement(outcome.study, candidate)
    return {
        "id": candidate.effect.id,
        "ln_bayes_factor": None if candidate.untestable else candidate.ln_bayes_factor,
        "delta_elpd_held_out": None if score is None else score.delta,
        "delta_elpd_se": None if score is None else score.se,
        "status": status,
        "why": why,
    }


def judgement(study: GapStudy, candidate: Candidate) -> tuple[str, str]:
    """Status of a candidate of the first round, and why, in words."""
    name = candidate.effect.id
    if candidate.untestable:
        return "untestable", candidate.untestable
    if any(e.id == name for e in study.effects):
        return "named", "worth more than its price, and than a flexible term in its place"
    for leader, members in study.classes.items():
        if name in members:
            return "rejected", f"these data cannot tell it from {leader}, within {APART:g} of ln Bayes factor"
    if study.p_value > SIGNIFICANT:
        return "rejected", f"there is no disagreement to explain (p = {study.p_value:.2g})"
    if candidate.fitted is None:
        return "rejected", "its signature explains far less of the residuals than the best one's"
    if candidate.ln_bayes_factor < WORTH:
        return "rejected", f"ln Bayes factor {candidate.ln_bayes_factor:.1f}, below {WORTH:g}"
    if candidate.ln_bayes_factor <= candidate.guard:
        return "rejected", (
            f"a meaningless smooth function of {candidate.guard_covariate} explains more "
            f"(ln Bayes factor {candidate.guard:.1f} against {candidate.ln_bayes_factor:.1f})"
        )
    return "rejected", "another effect explains more, and once that is added this one is not needed"


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
            }
            for c in step.candidates if c.fitted is not None
        ],
    }  # fmt: skip


def _finite(value: float) -> float | None:
    return value if np.isfinite(value) else None
