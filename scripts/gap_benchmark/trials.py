"""Trials of the benchmark: make a campaign with something hidden in it, study it blind, compare."""

from __future__ import annotations

import itertools
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass

import numpy as np
from scipy.special import ndtri
from threadpoolctl import threadpool_limits

from gap_benchmark.hide import INSIDE, OUTSIDE, hide_several
from sma_bayes.effects import EFFECTS
from sma_bayes.gap.close import close
from sma_bayes.gap.study import GapStudy, study_campaign
from sma_bayes.parameters.priors_file import read_priors

SUITES = ("null", "hidden", "left_out", "outside", "pairs", "strong", "strong_outside")
STRONG = (30.0, 100.0, 300.0)
"""Sizes at which it shows that a mechanism is not the formula of the catalogue [standard deviations of the noise]."""

THERMAL = ("latent_heat", "ambient_draught")
"""Effects on the temperature response, which has a design of its own."""
CONTAINED_BY = {
    "training_drift": ("training",), "amplitude_fatigue": ("training",),
    "training": ("training_drift", "amplitude_fatigue"),
}  # fmt: skip
"""What describes the same, wholly or in part, and is left out together with it."""
LADDER = ("minor_loop", "temperature_gradient")
"""Effects that need peaks of different temperature."""


@dataclass(frozen=True)
class Trial:
    """One campaign to be made and studied."""

    suite: str
    effects: str
    sigma: float
    noise: str
    design: str
    seed: int


@dataclass(frozen=True)
class Row(Trial):
    """What came of a trial.

    Attributes
    ----------
    sigma_reached : float
        Size of the hidden effects once the model has absorbed what it can; below what was asked for where the
        mechanism saturates.
    true_size, q05, q95 : float
        Size of the (first) hidden effect, and its 90 % interval where it was named.
    gap_before, gap_after, gap_floor : float
        Held out, where the right name was found in the first campaign of its kind; NaN elsewhere, since folds take
        longer than the study.
    """

    sigma_reached: float
    in_range: bool
    verdict: str
    named: str
    classes: str
    outcome: str
    p_value: float
    unexplained: float
    true_size: float
    q05: float
    q95: float
    gap_before: float
    gap_after: float
    gap_floor: float
    seconds: float


def design_of(effects: Sequence[str]) -> str:
    """The design in which effects can show."""
    if "latent_heat" in effects:
        return "thermal_slow"
    if any(e in THERMAL for e in effects):
        return "thermal"
    return "ladder" if any(e in LADDER for e in effects) else "standard"


def trials(suite: str, count: int) -> Iterator[Trial]:
    """All trials of a suite, `count` of each kind."""
    if suite == "null":
        kinds = [("none", n, "standard") for n in ("white", "ar1_0.5", "ar1_0.9", "student_t")]
        kinds += [("none", n, "unequal_sampling") for n in ("white", "ar1_0.5")]
        kinds += [("none", n, "unpooled") for n in ("white", "ar1_0.9")]
        kinds += [("none", "white", d) for d in ("ladder", "thermal")]
        kinds.append(("wrong_calibration", "white", "standard"))
        cells = [(e, 10.0, n, d) for e, n, d in kinds]
    elif suite == "hidden":
        cells = [(e, s, n, design_of([e])) for e in INSIDE for s in (10.0, 5.0) for n in ("white", "ar1_0.5")]
    elif suite == "left_out":
        cells = [(e, 10.0, "white", design_of([e])) for e in INSIDE]
    elif suite == "outside":
        cells = [(e, 10.0, n, "standard") for e in OUTSIDE for n in ("white", "ar1_0.5")]
    elif suite == "strong":
        cells = [(e, s, "white", design_of([e])) for s in STRONG for e in INSIDE]
    elif suite == "strong_outside":
        cells = [(e, s, "white", "standard") for s in STRONG for e in OUTSIDE]
    elif suite == "pairs":
        plain = [e for e in INSIDE if design_of([e]) == "standard"]
        cells = [(f"{a}+{b}", 10.0, "white", "standard") for a, b in itertools.combinations(plain, 2)]
        step = max(1, len(cells) // max(count, 1))
        for i, (e, s, n, d) in enumerate(cells[::step]):
            yield Trial(suite, e, s, n, d, i)
        return
    else:
        raise ValueError(f"no suite {suite!r}; there are {', '.join(SUITES)}")
    for seed in range(count):
        for e, s, n, d in cells:
            yield Trial(suite, e, s, n, d, seed)


def attempt(trial: Trial) -> Row | None:
    """Make a campaign, study it, and compare; None where the mechanism leaves no trace in the design."""
    began = time.perf_counter()
    hidden = trial.effects.split("+")
    try:
        case = hide_several(hidden, trial.sigma, trial.noise, trial.design, seed=trial.seed)
    except ValueError:
        return None
    left_out = (
        {x for h in hidden for x in (h, *CONTAINED_BY.get(h, ()))} if trial.suite == "left_out" else set()
    )
    catalogue = {k: v for k, v in EFFECTS.items() if k not in left_out}
    with threadpool_limits(limits=1):
        study = study_campaign(
            case.campaign,
            read_priors("modified_sigmoid"),
            pooled=case.pooled,
            effects=catalogue,
            seed=trial.seed,
        )
    wanted = [e for e in hidden if e in catalogue]
    low, high = interval(study, hidden[0])
    outcome = outcome_of(study, wanted)
    seconds = time.perf_counter() - began
    before = after = floor = float("nan")
    if trial.suite == "hidden" and trial.seed == 0 and outcome in ("right", "class"):
        gap = close(study, catalogue, pooled=case.pooled, seed=trial.seed)
        before, after, floor = gap.before, gap.after, gap.floor
    return Row(
        **asdict(trial),
        sigma_reached=case.sigma,
        in_range=all(a.in_range for a in case.answers),
        verdict=study.verdict,
        named="+".join(e.id for e in study.effects),
        classes=";".join("/".join(c) for c in study.classes.values()),
        outcome=outcome,
        p_value=study.p_value,
        unexplained=1.0 - study.carried if study.effects else float("nan"),
        true_size=case.answers[0].size if case.answers else 0.0,
        q05=low,
        q95=high,
        gap_before=before,
        gap_after=after,
        gap_floor=floor,
        seconds=seconds,
    )


def outcome_of(study: GapStudy, wanted: Sequence[str]) -> str:
    """``right``: named itself; ``class``: in the class of a name; ``part``: only some of several; ``wrong``: another
    name; ``confident``: another name with no rival; or ``none`` or ``unnamed``."""
    if study.verdict != "named":
        return study.verdict
    strangers = [c for c in study.classes.values() if not set(c) & set(wanted)]
    if strangers:
        return "confident" if any(len(c) == 1 for c in strangers) else "wrong"
    found = [w for w in wanted if any(w in c for c in study.classes.values())]
    if len(found) < len(wanted):
        return "part"
    return "right" if {e.id for e in study.effects} == set(wanted) else "class"


def interval(study: GapStudy, effect: str) -> tuple[float, float]:
    """90 % interval of an effect's size, by Laplace's approximation in its sampled coordinate."""
    final = study.final
    if effect not in final.hypothesis.effect_positions:
        return float("nan"), float("nan")
    at = int(final.hypothesis.effect_positions[effect][0])
    space = final.hypothesis.space
    i = list(space.free_index).index(at)
    sd = float(np.sqrt(final.covariance[i, i]))
    ends = [
        space.free[i].prior.transform.to_physical(np.array(final.z[i] + q * sd)) for q in ndtri((0.05, 0.95))
    ]
    return float(min(ends)), float(max(ends))
