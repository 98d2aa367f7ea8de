"""The study of the conditions of a campaign: what they do, what they have in common, what they predict."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from sma_bayes.account import Account
from sma_bayes.assess.bands import Band
from sma_bayes.assess.draws import RecordDraws
from sma_bayes.errors import MeasurementError, SmaBayesError, UnknownNameError, near_matches
from sma_bayes.parameters.roles import Role
from sma_bayes.progress import Progress
from sma_bayes.records.types import Branch, Condition
from sma_bayes.runs.jobs import run
from sma_bayes.studies.conditions.design import SETTINGS, Design, designs
from sma_bayes.studies.conditions.effects import SettingEffect, operating_effects
from sma_bayes.studies.conditions.features import CHANNELS, Feature, condition_features
from sma_bayes.studies.conditions.leave_out import LeftOutChannel, leave_out
from sma_bayes.studies.conditions.population import PRIOR_MEDIAN_SCATTER, Population, population_of
from sma_bayes.studies.conditions.prediction import Prediction, predict

EACH_CONDITION: Final = "each"
"""Leave every condition out in turn."""
LEAST_CONDITIONS: Final = 2
"""Conditions from which something in common can be learnt."""


@dataclass(frozen=True, slots=True, eq=False)
class ComparableRecords:
    """Records of one branch whose conditions can be compared.

    Attributes
    ----------
    design : Design
    branch : Branch
    records : tuple of RecordDraws
        One for each condition of the design.
    """

    design: Design
    branch: Branch
    records: tuple[RecordDraws, ...]


@dataclass(frozen=True, slots=True, eq=False)
class ConditionStudy:
    """What was found.

    Attributes
    ----------
    designs : tuple of Design
    features : tuple of Feature
    effects : tuple of SettingEffect
    populations : tuple of Population
        One for each group.
    predictions : tuple of Prediction
        For each asked condition, one for each branch.
    held_out : tuple of LeftOutChannel
    remarks : tuple of str
        What could not be done, and why.
    """

    designs: tuple[Design, ...]
    features: tuple[Feature, ...]
    effects: tuple[SettingEffect, ...]
    populations: tuple[Population, ...]
    predictions: tuple[Prediction, ...]
    held_out: tuple[LeftOutChannel, ...]
    remarks: tuple[str, ...]

    @property
    def converged(self) -> bool:
        """Whether all posteriors and the sampling of every scatter reached their targets."""
        held = [h.population for h in self.held_out]
        populations = (*self.populations, *held)
        fits = all(r.converged for p in self.populations for r in p.records)
        return fits and all(p.sampling.converged for p in populations)


def study(
    records: Sequence[RecordDraws],
    asked: Sequence[Condition] = (),
    left_out: Sequence[str] = (),
    *,
    seed: int = 0,
    scatter: float = PRIOR_MEDIAN_SCATTER,
    jobs: int | None = None,
    tell: Progress | None = None,
    account: Account | None = None,
) -> ConditionStudy:
    """Study conditions.

    Parameters
    ----------
    records : sequence of RecordDraws
    asked : sequence of Condition
        Conditions to predict.
    left_out : sequence of str
        Conditions to leave out in turn, or ``each``.
    seed : int
    scatter : float
        Median of the prior of the scatter between conditions, see `population_of`.
    jobs : int, optional
        Processes.
    tell : callable, optional
        Told how many tasks are done, how many there are, and what is going on.
    account : Account, optional
        Told how long it took.

    Raises
    ------
    MeasurementError
        If nothing can be compared, or no group can predict what was asked.
    UnknownNameError
        If a condition that is to be left out is not there.
    SmaBayesError
        If `scatter` is no positive number.
    """
    if not (np.isfinite(scatter) and scatter > 0.0):
        raise SmaBayesError(f"--scatter {scatter:g}", expected="a positive number, such as 0.1")
    groups, remarks = _groups(records)
    targets = [(g, complete(g.design, c)) for c in asked for g in _able(groups, c)]
    names = _left_out(groups, left_out)
    tasks = [_PopulationTask(g, None, seed, scatter) for g in groups]
    tasks += [
        _PopulationTask(g, g.design.ids.index(n), seed, scatter)
        for n in names
        for g in groups
        if n in g.design.ids
    ]
    features = condition_features(records)
    found: list[Population | tuple[LeftOutChannel, ...]] = []
    for result in run(_do, tasks, jobs, account=account, stage="conditions"):
        found.append(result)
        if tell is not None:
            tell(len(found), len(tasks), tasks[len(found) - 1].title)
    populations = tuple(p for p in found if isinstance(p, Population))
    held = [(t, h) for t, h in zip(tasks, found, strict=True) if isinstance(h, tuple)]
    remarks += [_not_left_out(t) for t, h in held if not h]
    of_group = {id(g): p for g, p in zip(groups, populations, strict=True)}
    return ConditionStudy(
        designs=designs(tuple(dict.fromkeys(r.condition for r in records))),
        features=features,
        effects=operating_effects(features, seed=seed),
        populations=populations,
        predictions=tuple(
            predict(of_group[id(g)], c, _rng(seed, 21, f"{c.id} {g.branch.value}")) for g, c in targets
        ),
        held_out=tuple(one for _, h in held for one in h),
        remarks=tuple(remarks),
    )


def complete(design: Design, condition: Condition) -> Condition:
    """Add what was the same in all conditions of a design to a condition."""
    usual = {s: getattr(design.conditions[0], s) for s in design.stated if s not in design.varied}
    return replace(condition, **{s: v for s, v in usual.items() if getattr(condition, s) is None})


def _groups(records: Sequence[RecordDraws]) -> tuple[list[ComparableRecords], list[str]]:
    kinds: dict[tuple[object, ...], list[RecordDraws]] = {}
    for r in records:
        spans = [r.with_role(Role.SPAN, channel) for channel in CHANNELS]
        rises = tuple(float(np.sign(np.median(s))) for s in spans if s is not None)
        kind = (r.posterior.model.name, r.branch, r.channels, tuple(sorted(r.units.items())), rises)
        kinds.setdefault(kind, []).append(r)
    groups: list[ComparableRecords] = []
    remarks = []
    for members in kinds.values():
        by_condition = {r.condition: r for r in members}
        for design in designs(tuple(by_condition)):
            own = tuple(by_condition[c] for c in design.conditions)
            if len(own) < LEAST_CONDITIONS:
                stated = ", ".join(design.stated) or "no setting"
                remarks.append(
                    f"{own[0].key} ({own[0].posterior.model.name}: {', '.join(own[0].channels)}; stated: {stated}) has "
                    "no other condition to be compared with, of the same model, channels and settings and whose curves "
                    "rise or fall as its own do"
                )
                continue
            groups.append(ComparableRecords(design, own[0].branch, own))
    if not groups:
        raise MeasurementError(
            "no two conditions can be compared",
            expected="two or more conditions with the same channels that state the same settings "
            f"({', '.join(SETTINGS)})",
            remedy="state in campaign.toml what was set on the rig, and fit again",
        )
    return groups, remarks


def _able(groups: Sequence[ComparableRecords], condition: Condition) -> list[ComparableRecords]:
    """Groups that can predict a condition.

    Raises
    ------
    MeasurementError
        If none can, with the reason of the one that has most in common with it.
    """
    able: list[ComparableRecords] = []
    reasons: list[tuple[int, MeasurementError]] = []
    for group in groups:
        try:
            group.design.check(condition)
        except MeasurementError as error:
            shared = sum(getattr(condition, v) is not None for v in group.design.varied)
            reasons.append((shared, error))
        else:
            able.append(group)
    if not able:
        why = max(reasons, key=lambda reason: reason[0])[1]
        raise MeasurementError(
            f"{condition.id} can't be predicted: {why.found}", expected=why.expected, remedy=why.remedy
        )
    return able


def _left_out(groups: Sequence[ComparableRecords], names: Sequence[str]) -> list[str]:
    known = list(dict.fromkeys(i for g in groups for i in g.design.ids))
    if list(names) == [EACH_CONDITION] and EACH_CONDITION not in known:
        return known
    for name in names:
        if name not in known:
            raise UnknownNameError(
                f"no condition {name!r} that others could predict",
                expected=f"{near_matches(name, known)}, or {EACH_CONDITION!r}",
            )
    return list(dict.fromkeys(names))


@dataclass(frozen=True, slots=True, eq=False)
class _PopulationTask:
    """A population, or one condition left out of it."""

    group: ComparableRecords
    place: int | None
    seed: int
    scatter: float

    @property
    def title(self) -> str:
        design, branch = self.group.design, self.group.branch.value
        if self.place is None:
            return f"learnt from {len(design.ids)} conditions, {branch}"
        return f"predicted {design.ids[self.place]} from the others, {branch}"


def _do(task: _PopulationTask) -> Population | tuple[LeftOutChannel, ...]:
    group = task.group
    words = f"{group.branch.value} {' '.join(group.design.ids)} {task.place}"
    seed = np.random.SeedSequence([task.seed, 20, *words.encode()])
    if task.place is None:
        return population_of(group.design, group.records, seed, scatter=task.scatter)
    return leave_out(group.design, group.records, task.place, seed, scatter=task.scatter)


def _not_left_out(task: _PopulationTask) -> str:
    design = task.group.design
    name = design.ids[task.place or 0]
    return (
        f"{name}, {task.group.branch.value}, can't be predicted from the others: without it nothing tells the effect "
        "of what was set differently there"
    )


def _rng(seed: int, stage: int, words: str) -> np.random.Generator:
    return np.random.default_rng(np.random.SeedSequence([seed, stage, *words.encode()]))


def bands_of(prediction: Prediction, seed: int) -> dict[str, Band]:
    """Band of each channel of a prediction, over all temperatures that were measured in any condition."""
    words = f"{prediction.condition.id} {prediction.reference.branch.value}"
    return {
        channel: prediction.band(channel, prediction.grid(), _rng(seed, 22, f"{words} {channel}"))
        for channel in prediction.reference.quantities
    }
