"""Explanations of a finished gap study, fitted again, and which of them are to be told apart."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.effects import EFFECTS
from sma_bayes.errors import MeasurementError, OutputError, SmaBayesError
from sma_bayes.parameters.priors_file import parse_priors
from sma_bayes.quantities import CHANNELS
from sma_bayes.records.campaign import read_campaign
from sma_bayes.records.history import histories
from sma_bayes.records.types import Campaign
from sma_bayes.response import RESPONSE_MODELS
from sma_bayes.runs.documents import GAP
from sma_bayes.runs.schema import read_document
from sma_bayes.studies.gap.check import comparable
from sma_bayes.studies.gap.fitting import FittedHypothesis, fit_hypothesis, fit_with_noise
from sma_bayes.studies.gap.hypothesis import Hypothesis, baseline
from sma_bayes.studies.gap.name import screen
from sma_bayes.studies.gap.noise import Noise
from sma_bayes.studies.gap.scatter import members_of
from sma_bayes.studies.gap.schema import AddedEffect, GapDocument
from sma_bayes.studies.gap.study import LN_BAYES_FACTOR_TOLD_APART, baseline_start
from sma_bayes.studies.plan.apart import Explanation

MAX_RIVALS: Final = 2
"""Rivals of an explanation, at most; all members of its class besides."""
THRESHOLD: Final = LN_BAYES_FACTOR_TOLD_APART
"""Least difference of ln Bayes factors by which explanations are told apart."""


@dataclass(frozen=True, eq=False)
class RivalExplanations:
    """Explanations of a gap.

    Attributes
    ----------
    found : GapDocument
    campaign : Campaign
        What it was made from.
    explanations : tuple of Explanation
        The favourite first.
    pairs : tuple of (int, int)
        Which are to be told apart.
    remarks : tuple of str
    """

    found: GapDocument
    campaign: Campaign
    explanations: tuple[Explanation, ...]
    pairs: tuple[tuple[int, int], ...]
    remarks: tuple[str, ...]

    def ln_bayes_factor(self, first: int, second: int) -> float:
        """Of one explanation over another, from the measurements there are."""
        a, b = self.explanations[first].fitted, self.explanations[second].fitted
        return a.ln_evidence - b.ln_evidence

    def told_apart(self, pair: tuple[int, int]) -> bool:
        """Whether the measurements there are tell a pair apart, which they don't within a class of the gap study."""
        names = {self.explanations[i].name for i in pair}
        alike = any(names <= set(e.class_) for e in self.found.added)
        return not alike and abs(self.ln_bayes_factor(*pair)) >= THRESHOLD

    def known(self, pair: tuple[int, int]) -> float:
        """Ln Bayes factor that new measurements add to: none beyond the threshold, which is to be reached anew."""
        known = self.ln_bayes_factor(*pair)
        return 0.0 if abs(known) >= THRESHOLD else known


def read_gap(folder: Path, data: Path | None = None) -> tuple[GapDocument, Campaign]:
    """A finished gap study and the campaign that it was made from, whose data are where `data` or the study says.

    Raises
    ------
    OutputError
        If the folder holds none, or the campaign is not where it was or not as it was.
    """
    if not GAP.is_in(folder):
        raise OutputError(
            "holds no gap study, whose explanations could be told apart",
            file=folder,
            expected="a folder that gap has written",
            remedy="run `sma-bayes gap CAMPAIGN --out DIR` and plan from DIR",
        )
    found = read_document(GAP, GapDocument, folder)
    remedy = "put the campaign back where it was; where its data lie elsewhere name their folder with --data"
    try:
        campaign = read_campaign(found.source, data_dir=data or found.data_dir)
    except SmaBayesError as error:
        raise OutputError(
            f"was made from {found.source or 'a campaign in memory'}, which can't be read: {error.found}",
            file=folder,
            expected="the campaign where it was",
            remedy=f"run it where gap was run, as {found.source} is a path from there; or {remedy}"
            if found.source and not Path(found.source).is_absolute()
            else remedy,
        ) from None
    if campaign.sha256 != found.data_sha256:
        raise OutputError(
            f"was made from other measurements than {found.source} holds now",
            file=folder,
            expected="the same campaign, unchanged",
            remedy=f"{remedy}; or make the gap study anew",
        )
    return found, comparable(campaign).campaign


def fitted_rivals(found: GapDocument, campaign: Campaign, priors_file: Path, seed: int) -> RivalExplanations:
    """Fit the explanations of a gap study again.

    Parameters
    ----------
    found : GapDocument
    campaign : Campaign
    priors_file : Path
        The priors that it was made with.
    seed : int
        For the draws.

    Raises
    ------
    MeasurementError
        If there are no two explanations.
    """
    base = _base(found, campaign, priors_file)
    favourite, others, before = _named(found)
    for name in before:
        base = fit_with_noise(*_started(base, name))
    first = base if favourite == "" else _with(base, favourite, base.noise)
    noise = fit_with_noise(first.hypothesis, first.z).noise
    rng = np.random.default_rng(np.random.SeedSequence([seed, 41]))
    explanations, remarks = [], []
    stated = {
        c.id: c.ln_bayes_factor for r in found.rounds for c in r.candidates if c.ln_bayes_factor is not None
    }
    bare = fit_hypothesis(base.hypothesis, base.z, noise)
    for name in (favourite, *others):
        fitted = bare if name == "" else _with(base, name, noise)
        explanations.append(Explanation.of(name, fitted, rng))
        worth = fitted.ln_evidence - bare.ln_evidence
        if name and name in stated and worth < stated[name] - max(THRESHOLD, 0.2 * abs(stated[name])):
            remarks.append(
                f"{name} is worth a ln Bayes factor of {worth:.1f} here and of {stated[name]:.1f} in the gap study: "
                "it is seen at a lesser mode"
            )
    pairs = tuple((0, i) for i in range(1, len(explanations)))
    return RivalExplanations(found, campaign, tuple(explanations), pairs, tuple(remarks))


def _base(found: GapDocument, campaign: Campaign, priors_file: Path) -> FittedHypothesis:
    """The model without effects."""
    try:
        priors = parse_priors(priors_file.read_text(encoding="utf-8"), str(priors_file))
    except OSError as error:
        raise OutputError(
            f"can't be read: {error.strerror}", file=priors_file, expected="the priors that gap wrote",
            remedy=GAP.anew(priors_file.parent),
        ) from None  # fmt: skip
    pooled = found.pool == "campaign"
    own = [h.of(CHANNELS) for h in histories(campaign)]
    hypothesis = baseline(campaign, own, priors, model=RESPONSE_MODELS[found.model], pooled=pooled)
    rng = np.random.default_rng(np.random.SeedSequence([found.seed, 7]))
    return fit_with_noise(hypothesis, baseline_start(hypothesis, campaign, priors, pooled=pooled, rng=rng))


def _started(base: FittedHypothesis, name: str) -> tuple[Hypothesis, Floats]:
    """Hypothesis with an effect more, and where to start its fit."""
    found = screen(base, EFFECTS[name])
    return base.hypothesis.extended(EFFECTS[name]), found.start


def _with(base: FittedHypothesis, name: str, noise: Noise) -> FittedHypothesis:
    hypothesis, start = _started(base, name)
    return fit_hypothesis(hypothesis, start, noise)


def _usable(name: str) -> bool:
    """Whether an effect says something of a further record, which a random one does not."""
    return name in EFFECTS and not members_of(EFFECTS[name])


def _named(found: GapDocument) -> tuple[str, list[str], list[str]]:
    """The favourite, its rivals, and effects that were added before."""
    added = [e for e in found.added if _usable(e.id)]
    if added:
        chosen = next((e for e in added if len(e.class_) > 1), added[0])
        before = [e.id for e in found.added if e.round < chosen.round and _usable(e.id)]
        return chosen.id, _rivals(found, chosen), before
    tried = _ranked(found, 1)
    if found.verdict == "none" or len(tried) < 2:
        if not tried:
            raise MeasurementError(
                "the gap study has no explanation that could be told from another: its verdict is "
                f"{found.verdict!r}, and no effect was fitted",
                expected="a gap study that has named effects or fitted candidates",
                remedy="plan for stiffness@... or parameters from the folder of a fit instead",
            )
        return tried[0], [""], []
    return tried[0], [*tried[1 : 1 + MAX_RIVALS], ""], []


def _rivals(found: GapDocument, chosen: AddedEffect) -> list[str]:
    """Members of the class, then the closest of the others that were fitted in the same round."""
    members = [n for n in chosen.rivals if _usable(n)]
    others = [n for n in _ranked(found, chosen.round) if n != chosen.id and n not in members]
    return (members + others[: max(MAX_RIVALS - len(members), 0)]) or [""]


def _ranked(found: GapDocument, number: int) -> list[str]:
    """Effects that were fitted in a round, the best first."""
    tried = found.rounds[number - 1].candidates if number <= len(found.rounds) else ()
    usable = [c for c in tried if _usable(c.id) and c.ln_bayes_factor is not None]
    return [c.id for c in sorted(usable, key=lambda c: -(c.ln_bayes_factor or 0.0))]


def conditions_of(rivals: RivalExplanations) -> Sequence[str]:
    """Ids of the conditions, in the order of the histories."""
    return [h.condition.id for h in rivals.explanations[0].fitted.hypothesis.histories]
