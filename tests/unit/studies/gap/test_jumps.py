"""Jumps are found where they are, and nothing that they explain gets the name of a law."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from sma_bayes.effects import EFFECTS
from sma_bayes.parameters.priors_file import read_priors
from sma_bayes.records.types import Campaign
from sma_bayes.studies.gap.document import _jump
from sma_bayes.studies.gap.fitting import FittedHypothesis, fit_hypothesis
from sma_bayes.studies.gap.flexible import COEFFICIENT_SD_GRID, channel_sd
from sma_bayes.studies.gap.jumps import Jumps
from sma_bayes.studies.gap.outcome import named_channels
from sma_bayes.studies.gap.study import GapStudy, study_campaign
from sma_bayes.studies.gap.words import jump_text

PRIORS = read_priors("modified_sigmoid")
SPAN = 0.02
SLIPS = ((0.27, 0.04), (0.52, 0.055), (0.81, 0.03))
"""When the grip slips, as a share of a condition, and by how much of the span."""


def slipped(campaign: Campaign, slips: tuple[tuple[float, float], ...] = SLIPS) -> Campaign:
    """The same campaign with a grip that slips in each condition."""
    records = []
    for r in campaign.records:
        of = [s for s in campaign.records if s.condition.id == r.condition.id]
        begin = min(float(s.inputs["time"][0]) for s in of)
        passed = (r.inputs["time"] - begin) / (max(float(s.inputs["time"][-1]) for s in of) - begin)
        moved = sum(SPAN * by * (passed > at) for at, by in slips)
        records.append(
            replace(r, observed={**r.observed, "displacement": r.observed["displacement"] + moved})
        )
    return replace(campaign, records=tuple(records))


def fitted_line(line) -> FittedHypothesis:
    return fit_hypothesis(line.hypothesis, line.prior_mean, line.noise)


def some(*names: str) -> Mapping[str, object]:
    return {n: EFFECTS[n] for n in names}


@pytest.fixture(scope="module")
def slips(rig) -> GapStudy:
    """What is made of slips by laws of the cycle and time, and by cycles that each have numbers of their own."""
    plain = rig(cycles=5, samples=40, periods=(60.0,) * 2, loads=(1.0,) * 2, peaks=(95.0,) * 2, seed=3)
    laws = some("training_drift", "training", "hot_creep", "cycle_offset", "sensor_drift")
    return study_campaign(slipped(plain.campaign()), PRIORS, pooled=True, effects=laws)


def test_slips_are_no_law_of_the_cycle(slips: GapStudy) -> None:
    assert (slips.verdict, slips.effects) == ("unnamed", ())
    best = max((c for c in slips.steps[0].candidates if c.fitted), key=lambda c: c.ln_bayes_factor)
    assert best.ln_bayes_factor > 100.0
    assert Jumps(slips.final).evidence_over(best.fitted, best.beside.beyond_shape) < -100.0


def test_slips_are_told_where_they_are_and_how_great(slips: GapStudy) -> None:
    assert len(slips.jumps) == 2 * len(SLIPS)
    for history in (0, 1):
        own = [j for j in slips.jumps if j.block.history == history]
        time = slips.final.hypothesis.histories[history].inputs["time"]
        assert {j.block.channel for j in own} == {"displacement"}
        for jump, (at, by) in zip(own, SLIPS, strict=True):
            assert abs((time[jump.sample] - time[0]) / (time[-1] - time[0]) - at) < 2.0 / time.size
            assert jump.by == pytest.approx(by * SPAN, rel=0.1)


def test_slips_beside_an_effect_are_no_law_either(rig) -> None:
    """A shift by the load is there as well, so that noise is great as long as one of the two is missing."""
    plain = rig(
        shift=2.0, cycles=5, samples=40, periods=(60.0,) * 2, loads=(1.0, 2.0), peaks=(95.0,) * 2, seed=3
    )
    laws = some("stress_shift", "hot_creep", "training_drift", "training", "cycle_offset")
    found = study_campaign(slipped(plain.campaign()), PRIORS, pooled=True, effects=laws)
    assert {e.id for e in found.named} <= {"stress_shift"}
    time = found.final.hypothesis.histories[0].inputs["time"]
    told = [(time[j.sample] - time[0]) / (time[-1] - time[0]) for j in found.jumps]
    assert all(min(abs(t - at) for t in told) < 3.0 / time.size for at, _ in SLIPS)


def test_where_cycles_drift_there_is_a_law_and_no_jump(rig) -> None:
    """A displacement that creeps with the cycle, more slowly each time."""
    plain = rig(cycles=5, samples=40, periods=(60.0,) * 2, loads=(1.0,) * 2, peaks=(95.0,) * 2, seed=3)
    records = []
    for r in plain.campaign().records:
        crept = 0.15 * SPAN * (1.0 - np.exp(-r.inputs["cycle"] / 2.0))
        records.append(
            replace(r, observed={**r.observed, "displacement": r.observed["displacement"] + crept})
        )
    crept_campaign = replace(plain.campaign(), records=tuple(records))
    laws = some("training_drift", "cycle_offset")
    found = study_campaign(crept_campaign, PRIORS, pooled=True, effects=laws)
    assert [e.id for e in found.named] == ["training_drift"]
    assert (
        found.steps[0].chosen.over_jumps > 20.0
    )  # two times four jumps cost as much as to know where they are
    assert found.jumps == ()


def test_noise_has_no_jumps(make_line) -> None:
    """One of forty records of noise may: a jump has to pay for not knowing where it is."""
    found = [Jumps(fitted_line(make_line(seed=seed))) for seed in range(40)]
    assert sum(f.worth > 0.0 for f in found) <= 1
    assert all(f.found == () for f in found if f.worth == 0.0)


def test_worth_is_what_dense_matrices_say(make_line) -> None:
    """The evidence of the jumps that were found, from columns made whole, averaged over their sizes."""
    fitted = fitted_line(make_line(seed=1, n=40))
    block = fitted.blocks[1]
    jump = np.zeros(fitted.whitened.size)
    jump[block.at.start + 50 : block.at.stop] = 8.0 * channel_sd(fitted, block.channel)
    moved = replace(fitted, whitened=fitted.whitened + fitted.whiten(jump))
    jumps = Jumps(moved)
    (found,) = jumps.found
    assert (found.block, found.sample) == (block, 50)
    column = jumps._free.project_out(fitted.whiten(jump / 8.0)[:, None])[:, 0]
    length, along = float(fitted.whiten(jump / 8.0) @ column), float(column @ moved.whitened)
    variance = COEFFICIENT_SD_GRID**2
    each = 0.5 * along**2 / (length + 1.0 / variance) - 0.5 * np.log1p(variance * length)
    known = np.log(np.mean(np.exp(each - each.max()))) + each.max()
    assert jumps.worth == pytest.approx(known - np.log(fitted.whitened.size), rel=1e-6)
    assert found.by == pytest.approx(along / length * channel_sd(fitted, block.channel), rel=1e-6)


def test_a_jump_in_words(slips: GapStudy) -> None:
    text = jump_text(named_channels(slips.final), _jump(slips.final, slips.jumps[0]))
    assert text.startswith("c0: displacement jumps by ")
    assert text.endswith((" while heating", " while cooling"))
