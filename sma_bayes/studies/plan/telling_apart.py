"""Planning to tell the explanations of a gap apart, from a gap study to what `plan.json` says."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Final

import numpy as np

from sma_bayes.errors import SmaBayesError, require_known
from sma_bayes.records.types import Campaign
from sma_bayes.runs.declared_units import declared_parts
from sma_bayes.studies.gap.schema import GapDocument
from sma_bayes.studies.identity import of_fit
from sma_bayes.studies.plan.apart import Prospect, further, told_apart
from sma_bayes.studies.plan.asked import TELL_APART
from sma_bayes.studies.plan.candidates import (
    CandidateExperiment,
    Setting,
    declared,
    marked,
    rate_of,
    require_rate,
    rounded,
    settings_of,
)
from sma_bayes.studies.plan.listing import planned, with_advice
from sma_bayes.studies.plan.options import Options
from sma_bayes.studies.plan.rivals import THRESHOLD, RivalExplanations, conditions_of, fitted_rivals
from sma_bayes.studies.plan.schema import PlanFindings, PlannedCandidate, RivalPair, TellingApart
from sma_bayes.studies.run_context import RunContext
from sma_bayes.threads import one_thread

RATE_FACTORS: Final = (1.0 / 3.0, 1.0, 3.0)
LOAD_FACTORS: Final = (1.0, 0.5, 2.0)
PEAK_FACTORS: Final = (1.0, 0.7)
CYCLES: Final = (1, 3, 10, 30)
LEAST_PROBABILITY: Final = 0.95
"""Probability from which on a candidate counts as telling explanations apart; of these the shortest is the best.

Were it right, the Brier score of such candidates is 0.05 at most."""
PROBABILITY_STEP: Final = 0.02
"""Candidates whose probabilities are less than that apart count as equally likely to tell, below it."""
LEAST_PROBABILITY_GAIN: Final = 0.02
"""Least gain of probability for which it is worth going beyond what was measured."""
MAX_CONDITIONS: Final = 3
"""Conditions of which candidates are made, at most, where none is named."""

Judged = tuple[CandidateExperiment, Sequence[TellingApart]]


def planned_apart(
    gap: GapDocument, campaign: Campaign, source: Path, o: Options, folder: Path | None, work: RunContext
) -> PlanFindings:
    """Judge candidates by how surely they tell explanations apart; write all of them to a folder, if there is one.

    Parameters
    ----------
    gap : GapDocument
    campaign : Campaign
        That it was made from.
    source : Path
        Its folder.
    o : Options
    folder : Path or None
    work : RunContext
    """
    if o.branch is not None:
        raise SmaBayesError(
            f"--branch {o.branch} with --for {TELL_APART}",
            expected="no branch: explanations are of whole histories",
        )
    settings = settings_of(campaign.records)
    require_known(o.condition, settings, f"unknown condition {o.condition!r}", file=source)
    tried = _candidates(settings, campaign, o, source)
    work.tell(0, 2, "fitting the explanations again")
    with work.account.timed("fit"), one_thread():
        rivals = fitted_rivals(gap, campaign, source / "priors.toml", o.seed)
    judged: list[Judged] = []
    with work.account.timed("judge"), one_thread():
        for n, candidate in enumerate(tried):
            work.tell(n, len(tried), "judging candidates")
            judged.append((candidate, discriminations(rivals, candidate)))
    undecided = [i for i, pair in enumerate(rivals.pairs) if not rivals.told_apart(pair)]
    looked_at = undecided or list(range(len(rivals.pairs)))

    def likely(found: Sequence[TellingApart]) -> float:
        return min(found[i].probability for i in looked_at)

    if o.candidates is None:
        judged = without_needless(judged, settings)
    judged.sort(key=lambda x: _place(x[0], likely(x[1])))
    found = PlanFindings(
        schema="sma-bayes/plan/1",
        asked=TELL_APART,
        kind="tell-apart",
        **of_fit(gap, source, o.seed),
        converged=gap.converged,
        temperature_unit=campaign.records[0].units["temperature"],
        available=o.hours,
        assumed_scatter=o.scatter,
        threshold=THRESHOLD,
        quantities=(),
        scatter=(),
        rivals=tuple(
            RivalPair(
                first=rivals.explanations[a].name,
                second=rivals.explanations[b].name,
                ln_bayes_factor=rivals.ln_bayes_factor(a, b),
                told_apart=rivals.told_apart((a, b)),
            )
            for a, b in rivals.pairs
        ),
        candidates=tuple(
            _candidate(n, c, told, likely(told), o.hours, settings) for n, (c, told) in enumerate(judged, 1)
        ),
        design=None,
        advice="",
        remarks=(*rivals.remarks, *_remarks(settings, tried, gap)),
        **declared_parts(campaign.records),
    )
    return with_advice(found, folder)


def discriminations(rivals: RivalExplanations, candidate: CandidateExperiment) -> list[TellingApart]:
    """How well a candidate tells each pair apart."""
    history = list(conditions_of(rivals)).index(candidate.condition)
    like = rivals.explanations[0].fitted.hypothesis.histories[history]
    new = further(candidate, like)
    with np.errstate(all="ignore"):
        prospects = [Prospect.of(e, history, new) for e in rivals.explanations]
        return [
            TellingApart(
                first=rivals.explanations[a].name,
                second=rivals.explanations[b].name,
                **told_apart(prospects[a], prospects[b], THRESHOLD, rivals.known((a, b))),
            )
            for a, b in rivals.pairs
        ]


def _place(candidate: CandidateExperiment, probability: float) -> tuple[float, float, int]:
    """Where a candidate stands in the ranking: the sure ones first, the shortest at the top, then the likeliest."""
    missing = max(LEAST_PROBABILITY - probability, 0.0)
    return float(np.ceil(missing / PROBABILITY_STEP)), candidate.hours, len(candidate.beyond)


def without_needless(judged: Sequence[Judged], settings: Mapping[str, Setting]) -> list[Judged]:
    """Candidates less those under another load, or beyond what was measured, where others tell as much."""

    def plain(c: CandidateExperiment) -> bool:
        return not c.beyond and c.load == settings[c.condition].load

    def same(c: CandidateExperiment) -> tuple[object, ...]:
        return c.condition, c.lowest, c.peak, c.cycles, c.samples

    usual: dict[tuple[object, ...], list[Sequence[TellingApart]]] = {}
    for candidate, found in judged:
        if plain(candidate):
            usual.setdefault(same(candidate), []).append(found)
    return [
        (candidate, found)
        for candidate, found in judged
        if plain(candidate)
        or not any(
            max(a.probability - b.probability for a, b in zip(found, other, strict=True))
            < LEAST_PROBABILITY_GAIN
            for other in usual.get(same(candidate), [])
        )
    ]


def _candidates(
    settings: Mapping[str, Setting], campaign: Campaign, o: Options, source: Path
) -> list[CandidateExperiment]:
    unit = campaign.records[0].units["temperature"]
    rate = None if o.rate is None else rate_of(o.rate, unit)
    asked = [o.condition] if o.condition is not None else list(settings)[:MAX_CONDITIONS]
    if o.candidates is not None:
        found = declared(Path(o.candidates), settings, asked, o.setup, rate)
    else:
        found = [c for name in asked for c in _grid(settings[name], o.setup, rate)]
    require_rate(found, source)
    return marked(found, settings)


def _grid(s: Setting, setup: float, rate: float | None) -> list[CandidateExperiment]:
    """Whole loops and shorter ones, slower and faster, under less and more load, of one cycle and of more."""
    usual = rate if rate is not None else s.rate
    if usual is None:
        return []
    rates = (1.0,) if rate is not None else RATE_FACTORS
    loads = (None,) if s.load is None else LOAD_FACTORS
    span = s.hottest - s.lowest
    low = rounded(s.lowest, span)
    whole = CandidateExperiment(s.condition, low, s.hottest, usual, s.load, 1, s.samples, setup)
    return [
        replace(
            whole,
            peak=rounded(s.lowest + peak * span, span),
            rate=float(f"{times * usual:.3g}"),
            load=None if load is None or s.load is None else load * s.load,
            cycles=cycles,
            samples=max(round(peak * s.samples), 2),
        )
        for times, load, peak, cycles in product(rates, loads, PEAK_FACTORS, CYCLES)
    ]


def _candidate(
    rank: int,
    c: CandidateExperiment,
    told: Sequence[TellingApart],
    probability: float,
    hours: float | None,
    settings: Mapping[str, Setting],
) -> PlannedCandidate:
    return planned(
        rank,
        c,
        hours,
        branches=("heating", "cooling"),
        other_load=c.load != settings[c.condition].load,
        probability=probability,
        pairs=told,
    )


def _remarks(
    settings: Mapping[str, Setting], tried: Sequence[CandidateExperiment], gap: GapDocument
) -> list[str]:
    out = [
        "one of the explanations is taken to be true: no probability here allows for both being wrong",
        "inputs that a candidate does not state (ambient temperature, current) are taken to be as they were measured",
    ]
    if gap.verdict == "unnamed":
        out.insert(0, "the gap study named nothing: what is compared are the explanations that came nearest")
    elif gap.verdict == "none":
        out.insert(
            0,
            "the gap study found no disagreement beyond chance: what came nearest is compared with no effect",
        )
    if any(c.beyond for c in tried):
        out.append(
            "candidates that go beyond what the campaign measured are marked: effects are extrapolated there"
        )
    if any(c.peak < settings[c.condition].hottest - 0.02 * (c.peak - c.lowest) for c in tried):
        out.append("loops that turn round before the transformation ends are predicted from the curves of whole "
                   "loops, unless an explanation says otherwise")  # fmt: skip
    return out
