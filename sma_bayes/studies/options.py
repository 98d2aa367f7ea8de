"""What decides the numbers of a run, by the names that users give, and refused before anything is sampled."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final, Literal

from sma_bayes.errors import SmaBayesError, near_matches, require_known, require_seed
from sma_bayes.fitting.fit_records import AUTO
from sma_bayes.fitting.posterior import build_posterior
from sma_bayes.limits import DEGREES
from sma_bayes.noise import NOISE_MODELS
from sma_bayes.parameters.priors_file import PriorSet
from sma_bayes.records.types import Branch, Campaign, Record
from sma_bayes.response import AUTO_MODEL, DEFAULT_MODEL, RESPONSE_MODELS, ladder, priors_named
from sma_bayes.response.arrangement import BIAS_STIFFNESS, BIAS_STIFFNESS_SD, ArrangedSpring, Arrangement
from sma_bayes.response.base import ResponseModel
from sma_bayes.sampling.ensembles import Plan
from sma_bayes.sampling.moves import SAMPLERS

DEFAULT_SAMPLER: Final = "independence"
AFFORDED: Final = 100_000_000
"""Samples times evaluations that a record is given before it is called not converged, but `LEAST` evaluations at least
and those of a `Plan` at most; a cross-check has as many as it takes."""
LEAST: Final = 300_000
Pool = Literal["none", "campaign"]


@dataclass(frozen=True, slots=True)
class FitOptions:
    """What decides the numbers of a run.

    Attributes
    ----------
    seed : int
    model : str
        Name of a response model, or ``auto``: the best supported of the ladder.
    noise : str
        Name of a noise model, or ``auto``.
    priors : PriorSet
    pool : str
        ``none``: each condition and branch has its own A and B; ``campaign``: one set a branch for all.
    extrapolate : float
        How far bands go beyond the observed temperatures [unit of temperature].
    plan : Plan
    bias : ArrangedSpring, optional
        Bias spring whose arrangement with the alloy spring gets bands of its own, Eq. (8).
    """

    priors: PriorSet
    seed: int = 0
    noise: str = AUTO
    pool: Pool = "none"
    extrapolate: float = 0.0
    plan: Plan = field(default_factory=Plan)
    bias: ArrangedSpring | None = None
    model: str = DEFAULT_MODEL

    def __post_init__(self) -> None:
        pool_named(self.pool)
        require_seed(self.seed)


def prior_set(priors: str | Path | PriorSet | None, model: str = DEFAULT_MODEL) -> PriorSet:
    """Priors by the name of a shipped set or of a model, by their file, or as they are; None for those of a model.

    Raises
    ------
    UnknownNameError
        If no response model has that name.
    PriorError
        If there are no such priors; see `read_priors`.
    """
    own = RESPONSE_MODELS[DEFAULT_MODEL if model_named(model) == AUTO_MODEL else model]
    if priors is None:
        return own.default_priors()
    found = priors if isinstance(priors, PriorSet) else priors_named(priors)
    return found if found.model else replace(found, model=model)


def model_named(name: str) -> str:
    """Check the name of a response model.

    Raises
    ------
    UnknownNameError
        If there is none of that name.
    """
    require_known(name, [AUTO_MODEL, *RESPONSE_MODELS], f"no response model is called {name!r}")
    return name


def pool_named(name: str) -> Pool:
    """Check the name of a way to pool.

    Raises
    ------
    SmaBayesError
        If it is none of them.
    """
    if name == "none":
        return "none"
    if name == "campaign":
        return "campaign"
    raise SmaBayesError(f"--pool {name!r}", expected="'none' or 'campaign'")


def plan_with(sampler: str) -> Plan:
    """Plan of ensembles with a sampler of `SAMPLERS`, by its name.

    Raises
    ------
    UnknownNameError
        If there is no such sampler.
    """
    require_known(sampler, SAMPLERS, f"--sampler {sampler!r}", remedy=f"choose one of {', '.join(SAMPLERS)}")
    return Plan(sampler=SAMPLERS[sampler])


def plan_for(options: FitOptions, records: Sequence[Record]) -> Plan:
    """Plan for records that share a posterior: the more samples an evaluation takes, the fewer are afforded."""
    plan = options.plan
    if plan.sampler != SAMPLERS[DEFAULT_SAMPLER]:
        return plan
    afforded = max(LEAST, AFFORDED // sum(r.n for r in records))
    return replace(plan, evaluations=min(plan.evaluations, afforded))


def bias_spring(
    arrangement: str | None, stiffness: float | None = None, sd: float | None = None
) -> ArrangedSpring | None:
    """Bias spring by the name of its arrangement; None for none.

    Parameters
    ----------
    arrangement : str, optional
    stiffness, sd : float, optional
        Stiffness and its standard deviation [N/m]; those of the paper's bias spring by default.

    Raises
    ------
    SmaBayesError
        If there is no such arrangement, or a stiffness without one.
    """
    if arrangement is None:
        if stiffness is not None or sd is not None:
            raise SmaBayesError(
                "--bias or --bias-sd without --arrangement",
                expected=f"--arrangement {', '.join(Arrangement)}: how the bias spring is joined to the other",
                remedy="name the arrangement, or leave the bias spring out",
            )
        return None
    known = [a.value for a in Arrangement]
    if arrangement not in known:
        raise SmaBayesError(f"--arrangement {arrangement!r}", expected=near_matches(arrangement, known))
    return ArrangedSpring(
        Arrangement(arrangement),
        BIAS_STIFFNESS if stiffness is None else stiffness,
        BIAS_STIFFNESS_SD if sd is None else sd,
    )


def models_of(records: Sequence[Record], options: FitOptions) -> list[tuple[ResponseModel, PriorSet]]:
    """Response models to choose from for records that share a posterior, simplest first, each with its priors.

    One unless the model is ``auto``; then those of the ladder that can be fitted to the channels, each with the user's
    priors of the parameters that it has.
    """
    if options.model != AUTO_MODEL:
        return [(RESPONSE_MODELS[options.model].made_for(records), options.priors)]
    models = [m.made_for(records) for m in ladder(records[0].channels)]
    known = frozenset[str]().union(*(m.spoken_of() for m in models))
    return [
        (m, m.default_priors().overridden_by(options.priors.without(known - m.spoken_of()))) for m in models
    ]


def check_model_and_noise(model: str, noise: str) -> None:
    """Refuse a choice of the model by evidence under a noise that gives none.

    Raises
    ------
    SmaBayesError
        If both are named together.
    """
    if model == AUTO_MODEL and noise != AUTO and not NOISE_MODELS[noise].is_density:
        raise SmaBayesError(
            f"--model {AUTO_MODEL} with --noise {noise}",
            expected=f"a noise that is a density of the data: the model is chosen by evidence, which {noise} has not",
            remedy="leave --noise out, or name the model",
        )


def check_call(groups: Sequence[Sequence[Record]], options: FitOptions) -> None:
    """Refuse, before anything is written or sampled, what no record could be fitted with.

    Parameters
    ----------
    groups : sequence of sequence of Record
        Records that share a posterior.
    options : FitOptions

    Raises
    ------
    UnknownNameError
        If no noise model has that name.
    MeasurementError
        If a record has channels that the model can't be fitted to.
    PriorError
        If a prior is missing, has no parameter, or is wrong, or records can't share parameters.
    SmaBayesError
        If bands are to go on for ever, the noise needs time and a record has none, or gives no evidence by which a
        model is to be chosen.
    """
    if not 0.0 <= options.extrapolate <= DEGREES.value:
        raise SmaBayesError(
            f"--extrapolate {options.extrapolate}",
            expected=f"a finite number of degrees, at least 0 and at most {DEGREES.value:g}",
        )
    noise = NOISE_MODELS["independent" if options.noise == AUTO else options.noise]
    check_model_and_noise(options.model, options.noise)
    timeless = [record.key for group in groups for record in group if "time" not in record.inputs]
    if noise.needs_time and timeless:
        raise SmaBayesError(
            f"--noise {options.noise}: {timeless[0]} has no time",
            expected="recorded time in every record",
            remedy="map a column of time, or choose another noise model, such as ar1",
        )
    for group in groups:
        one = [dict.fromkeys(record.channels, 1.0) for record in group]  # stands for residual and memory
        for model, priors in models_of(group, options):
            build_posterior(group, NOISE_MODELS["independent"], priors, model=model)
            build_posterior(group, noise, priors, model=model, residual=one, memory=one)


def groups_of(campaign: Campaign, pool: Pool) -> list[tuple[Record, ...]]:
    """Records that share a posterior: one each, or all of a branch."""
    if pool == "none":
        return [(r,) for r in campaign.records]
    branches = (tuple(r for r in campaign.records if r.branch is b) for b in Branch)
    return [g for g in branches if g]
