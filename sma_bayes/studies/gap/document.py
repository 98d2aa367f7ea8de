"""What a gap study says in `gap.json`."""

from __future__ import annotations

from dataclasses import asdict, replace
from typing import Final

import numpy as np

from sma_bayes.effects import Effect
from sma_bayes.effects.needs import untestable
from sma_bayes.fitting.curves import INTERVAL, as_interval, interval
from sma_bayes.parameters.distributions import family_name, numbers
from sma_bayes.records.history import History
from sma_bayes.runs.declared_units import Shown
from sma_bayes.studies.gap.cautions import cautions
from sma_bayes.studies.gap.close import NOISE_ONLY_RMS, Gap
from sma_bayes.studies.gap.fitting import FittedHypothesis, nearest
from sma_bayes.studies.gap.flexible import FlexibleTerms, TermWorth, worth_of
from sma_bayes.studies.gap.heating import heat_parameters
from sma_bayes.studies.gap.innovations import growth
from sma_bayes.studies.gap.jumps import Jump
from sma_bayes.studies.gap.locate import Disagreement
from sma_bayes.studies.gap.name import (
    LEAST_LN_BAYES_FACTOR,
    LEAST_SHARE_BESIDE_FLEXIBLE,
    LEAST_SHARE_BEYOND_SHAPE,
    MISFIT_LN_BAYES_FACTOR,
    MOST_SHARE_OF_FORM,
    Candidate,
    EvidenceBeside,
    share_of,
)
from sma_bayes.studies.gap.noise import BlockNoise, ChannelBlock, scatter
from sma_bayes.studies.gap.outcome import GapOutcome, added, judgement, named_channels, probability
from sma_bayes.studies.gap.periodic import Spectra
from sma_bayes.studies.gap.schema import (
    AddedEffect,
    EffectParameter,
    FlexibleEvidence,
    FollowedCovariate,
    GapOfModel,
    GapThresholds,
    HeatingFindings,
    JudgedCandidate,
    RefittedCandidate,
    RemainderBeside,
    ShapeEvidence,
    StatedBand,
    StatedChannelGap,
    StatedDisagreement,
    StatedGap,
    StatedJump,
    StatedNoise,
    StatedRemaining,
    StatedRound,
    StatedSweep,
    StatedSweeps,
    StudiedCondition,
)
from sma_bayes.studies.gap.shown import part_in_declared_units
from sma_bayes.studies.gap.study import (
    LEAST_FURTHER_SHARE,
    LEAST_SHARE_CARRIED,
    LN_BAYES_FACTOR_TOLD_APART,
    SIGNIFICANT_P,
    GapStudy,
    Step,
)
from sma_bayes.studies.gap.sweeps import NUMBERS, cycle_law, suspects, sweep_numbers

METRIC: Final = (
    "root mean square of held-out residuals, as innovations of the noise, in its standard deviations; "
    "1 where only noise is left"
)
THRESHOLDS: Final = GapThresholds(
    p_value=SIGNIFICANT_P,
    ln_bayes_factor=LEAST_LN_BAYES_FACTOR,
    ln_bayes_factor_apart=LN_BAYES_FACTOR_TOLD_APART,
    unexplained_share=round(1.0 - LEAST_SHARE_CARRIED, 6),
    share_beside=LEAST_SHARE_BESIDE_FLEXIBLE,
    share_of_form=MOST_SHARE_OF_FORM,
    share_beyond_shape=LEAST_SHARE_BEYOND_SHAPE,
    ln_bayes_factor_shape=MISFIT_LN_BAYES_FACTOR,
    further_share=LEAST_FURTHER_SHARE,
)


def gap_of_model(outcome: GapOutcome) -> GapOfModel:
    """What was found of one model.

    Without a disagreement beyond chance ``disagreement`` is empty, and the stretches of the greatest mean residual are
    under ``within_chance``. Under ``effects`` are names; what else was added is under ``partial``.
    """
    study = outcome.study
    found = tuple(_disagreement(d) for d in study.disagreements)
    names = {e.id for e in study.named}
    effects = [_effect(outcome, e) for e in study.effects]
    none = study.verdict == "none"
    judged = study.steps[0].candidates
    order = [*added(study), *(c.effect.id for c in judged)]  # what was added comes first
    return GapOfModel.about(
        study,
        p_value_extrapolated=study.steps[0].look.extrapolated,
        steady_noise=study.baseline.hypothesis.steady_noise,
        converged=outcome.converged,
        disagreement=() if none else found,
        within_chance=found if none else (),
        jumps=tuple(_jump(study.final, j) for j in study.jumps),
        effects=tuple(e for e in effects if e.id in names),
        partial=tuple(e for e in effects if e.id not in names),
        readings_as_one=outcome.readings_as_one,
        candidates=tuple(
            _candidate(outcome, c) for c in sorted(judged, key=lambda c: order.index(c.effect.id))
        ),
        rounds=tuple(_round(s) for s in study.steps),
        remaining=StatedRemaining.about(
            study.left.best.term,
            p_value=study.left.p_value,
            ln_bayes_factor=study.left.best.ln_bayes_factor,
            share=study.remainder if study.effects else None,
            share_without_shape=1.0 - study.carried if study.effects else None,
        ),
        gap=_gap(outcome.gap, study.final),
        thresholds=THRESHOLDS,
        sweeps=_sweeps(study),
        suspects=tuple(suspects(nearest(study.baseline))),
        channels=named_channels(study.final),
        units=dict(study.final.hypothesis.histories[0].units),
        conditions=tuple(_condition(h) for h in study.final.hypothesis.histories),
        noise=tuple(
            _noise(study.final, block, noise, band)
            for block, noise, band in zip(
                study.final.blocks, study.final.noise, Spectra(study.final).bands(), strict=True
            )
        ),
    )


def heat_balance(outcome: GapOutcome, units: Shown) -> HeatingFindings:
    """What was found of the heat balance, with its parameters; cautions are told in declared units."""
    found = gap_of_model(outcome)
    parameters = heat_parameters(outcome.study, outcome.flat, outcome.seed)
    told = cautions(part_in_declared_units(found, units))
    return HeatingFindings(**dict(found), parameters=parameters, cautions=tuple(told))


def _gap(gap: Gap, fitted: FittedHypothesis) -> StatedGap:
    units = fitted.hypothesis.histories[0].units
    return StatedGap.about(
        gap,
        metric=METRIC,
        noise=NOISE_ONLY_RMS,
        channels={c: StatedChannelGap.about(of, unit=units[c]) for c, of in gap.channels.items()},
        chosen_without=tuple(tuple(c) for c in gap.chosen),
    )


def _sweeps(study: GapStudy) -> StatedSweeps:
    """Numbers of each sweep about the common curve, and their law of the cycle where there is something to explain."""
    found = sweep_numbers(nearest(study.baseline))
    law = None
    if study.verdict != "none":
        law = cycle_law(found, np.random.default_rng(0))
    numbers = tuple(
        StatedSweep.about(
            s,
            **dict(zip(NUMBERS, s.values, strict=True)),
            **{f"{name}_sd": sd for name, sd in zip(NUMBERS, s.sds, strict=True)},
        )
        for s in found
    )
    return StatedSweeps(law=law, numbers=numbers)


def _disagreement(d: Disagreement) -> StatedDisagreement:
    return StatedDisagreement.about(d, from_=d.start, to=d.stop, mean_residual=d.mean)


def _jump(fitted: FittedHypothesis, jump: Jump) -> StatedJump:
    history = fitted.hypothesis.histories[jump.block.history]

    def at(name: str) -> float | None:
        values = history.inputs.get(name, history.observed.get(name))
        return None if values is None else float(values[jump.sample])

    return StatedJump(
        condition=history.condition.id,
        channel=jump.block.channel,
        by=jump.by,
        sample=jump.sample,
        time=at("time"),
        cycle=float(history.inputs["cycle"][jump.sample]),
        branch="heating" if history.inputs["branch"][jump.sample] > 0.0 else "cooling",
        temperature=at("temperature"),
    )


def _condition(history: History) -> StudiedCondition:
    settings = {k: v for k, v in asdict(history.condition).items() if k != "id" and v is not None}
    return StudiedCondition.about(
        history,
        id=history.condition.id,
        settings=settings,
        cycles=int(np.unique(history.inputs["cycle"]).size),
        rows_averaged=history.averaged,
    )


def _noise(
    fitted: FittedHypothesis, block: ChannelBlock, noise: BlockNoise, band: StatedBand | None
) -> StatedNoise:
    follows = ~block.first
    response = (fitted.observed - fitted.residual)[block.at]
    grows = growth(replace(noise, scale=1.0).whiten(fitted.residual[block.at]), response)
    return StatedNoise(
        condition=fitted.hypothesis.histories[block.history].condition.id,
        channel=block.channel,
        sd=noise.sd,
        lag1=float(np.median(noise.memory[follows])) if follows.any() else 0.0,
        scatter=scatter(fitted.residual[block.at], block),
        growth=grows.slope,
        growth_sd=grows.error,
        spectrum=band,
    )


def _effect(outcome: GapOutcome, effect: Effect) -> AddedEffect:
    place, step, chosen = added(outcome.study)[effect.id]
    experiment = outcome.experiments.get(effect.id)
    followed = outcome.study.followed.get(effect.id)
    beside = chosen.beside
    return AddedEffect.about(
        effect,
        **dict(_refitted(chosen)),
        round=place,
        class_=step.class_,
        follows=None if followed is None else FollowedCovariate.about(followed),
        probability=probability(step, chosen),
        shape_apart=beside is not None and beside.shape_apart,
        remainder=None if beside is None else _remainder(beside),
        parameters=_parameters(outcome, effect),
        next_experiment=None if experiment is None else str(experiment),
    )


def _refitted(c: Candidate) -> RefittedCandidate:
    again = None if c.in_own_noise is None else c.in_own_noise.beside
    return RefittedCandidate.about(
        c,
        id=c.effect.id,
        ln_bayes_factor_beside=None if c.beside is None else c.beside.over,
        share=None if c.beside is None else c.beside.carried,
        share_in_own_noise=None if again is None else again.carried,
        ln_bayes_factor_beyond_shape=None if c.beside is None else c.beside.beyond_shape,
    )


def _remainder(beside: EvidenceBeside) -> RemainderBeside | None:
    """The best flexible term on top of an effect, in the round in which that was judged."""
    left = beside.remainder
    if left is None:
        return None
    return RemainderBeside(**dict(_flexible(left)), share=1.0 - beside.carried)


def _flexible(found: TermWorth) -> FlexibleEvidence:
    return FlexibleEvidence.about(found.term, ln_bayes_factor=found.ln_bayes_factor)


def _parameters(outcome: GapOutcome, effect: Effect) -> dict[str, EffectParameter]:
    hypothesis = outcome.study.final.hypothesis
    free = hypothesis.space.free_index.tolist()
    if outcome.draws is None:
        return {}
    convergence = outcome.draws.convergence
    out = {}
    at = hypothesis.effect_positions[effect.id].tolist()
    for i, p in zip(at, effect.parameters(hypothesis.scales), strict=True):
        z = free.index(i)
        out[p.name] = EffectParameter.about(
            p,
            **interval(outcome.flat[:, i]),
            rhat=convergence.rhat[z],
            ess_bulk=convergence.ess_bulk[z],
            ess_tail=convergence.ess_tail[z],
            prior={
                "family": family_name(p.prior),
                **numbers(p.prior),
                "source": p.source,
                **as_interval(p.prior.quantile(np.array(list(INTERVAL.values())))),
            },
        )
    return out


def _candidate(outcome: GapOutcome, candidate: Candidate) -> JudgedCandidate:
    """As judged in the first round; what was added in a later one, as judged then."""
    study = outcome.study
    place, _, candidate = added(study).get(candidate.effect.id, (1, study.steps[0], candidate))
    score = outcome.scores.get(candidate.effect.id)
    status, why = judgement(study, candidate)
    there = study.baseline.hypothesis.histories
    return JudgedCandidate.about(
        candidate.effect,
        round=place,
        refitted=candidate.fitted is not None,
        ln_bayes_factor=None if candidate.untestable else candidate.ln_bayes_factor,
        delta_elpd_held_out=None if score is None else score.delta,
        delta_elpd_se=None if score is None else score.se,
        status=status,
        why=why,
        unmet=tuple(n for n in candidate.effect.needs if candidate.untestable and untestable((n,), there)),
    )


def _round(step: Step) -> StatedRound:
    return StatedRound.about(
        step,
        p_value=step.look.p_value,
        flexible=tuple(_flexible(g) for g in step.look.gains[:5]),
        added=None if step.chosen is None else step.chosen.effect.id,
        candidates=tuple(_refitted(c) for c in step.candidates if c.fitted is not None),
        shape=_shape(step.flexible),
    )


def _shape(found: FlexibleTerms | None) -> ShapeEvidence | None:
    """What the shape of the curve is worth, where there was something to explain and a curve."""
    if found is None or not found.curved:
        return None
    return ShapeEvidence(
        ln_bayes_factor=found.shape,
        share=share_of(found.shape, worth_of(found.beyond)),
        beyond=None if found.beyond is None else _flexible(found.beyond),
    )
