"""Trials of the benchmark: make a campaign with something hidden in it, study it blind, compare."""

from __future__ import annotations

import ast
import hashlib
import itertools
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cache
from pathlib import Path

import numpy as np
from scipy.special import ndtri
from threadpoolctl import threadpool_limits

import sma_bayes
from gap_benchmark.hide import INSIDE, LAWS, OUTSIDE, hide_several
from gap_benchmark.noise import NOISES
from gap_benchmark.spring import CURVES
from sma_bayes.effects import EFFECTS
from sma_bayes.effects.needs import of_heating, of_response
from sma_bayes.parameters.priors_file import read_priors
from sma_bayes.studies.gap.close import close
from sma_bayes.studies.gap.heating import study_heating
from sma_bayes.studies.gap.study import GapStudy, study_campaign

SUITES = ("null", "hidden", "left_out", "outside", "pairs", "triples")
SIGMAS: Mapping[str, tuple[float, ...]] = {
    "null": (0.0,),
    "hidden": (5.0, 10.0, 30.0, 100.0, 300.0),
    "left_out": (10.0, 100.0),
    "outside": (10.0, 30.0, 100.0, 300.0),
    "pairs": (10.0, 30.0, 100.0),
    "triples": (30.0, 100.0),
}
"""Sizes of what is hidden [standard deviations of the noise], unless others are asked for."""

THERMAL = ("latent_heat", "ambient_draught")
"""Effects on the temperature response, which has a design of its own."""
CONTAINED_BY = {
    "training_drift": ("training",), "amplitude_fatigue": ("training",),
    "training": ("training_drift", "amplitude_fatigue"), "stress_shift": ("branch_stress_shift",),
}  # fmt: skip
"""What describes the same, wholly or in part, and is left out together with it."""
LADDER = ("minor_loop", "temperature_gradient")
"""Effects that need peaks of different temperature."""
DESIGNS_OF_NOTHING = ("standard", "standard", "one_cycle", "unequal_sampling", "ladder", "unpooled")
"""Designs of campaigns in which nothing is hidden, by turns."""
ENGINE = (
    *(f"studies/gap/{name}.py" for name in (
        "effect_form", "finite", "fitting", "flexible", "free_shape", "heating", "hypothesis", "jumps", "locate",
        "name", "noise", "one_stage", "periodic", "scatter", "splines", "study", "switching",
    )),
    "effects", "response", "records/history.py", "noise",
)  # fmt: skip
"""Modules that decide what a study finds."""
BEND = "asymmetric_kinetics"
"""The effect that is a bend of the curve and no more: data can't tell it from a curve that is bent by itself."""
NAMES_OF = {
    ("stress_shift", "second"): ("branch_stress_shift",),
    ("stress_shift", "simcoon"): ("stress_shift", "branch_stress_shift"),
}
"""Names of mechanisms that have others than that of the effect: with a slope of each branch it is they that are to be
named; those of the law of `simcoon` are 8 and 7 MPa/K, which strong signals tell apart and weak ones don't."""


@dataclass(frozen=True)
class Trial:
    """One campaign to be made and studied."""

    suite: str
    effects: str
    sigma: float
    noise: str
    design: str
    seed: int
    law: str = "first"
    curve: str = "sigmoid"


@dataclass(frozen=True)
class Row(Trial):
    """What came of a trial.

    Attributes
    ----------
    engine : str
        Digest of the modules by which it was studied.
    sigma_reached : float
        Size of the hidden effects once the model has absorbed what it can; below what was asked for where the
        mechanism saturates. What the shape of the curves leaves apart.
    true_size, q05, q95 : float
        Size of the (first) hidden effect, and its 90 % interval where it was named.
    gap_before, gap_after, gap_floor : float
        Held out, where that was asked for and the right name was found; NaN elsewhere, since folds take longer than
        the study.
    seconds : float
        Of processor time, the making of the campaign and the folds apart.
    """

    engine: str = field(kw_only=True)
    sigma_reached: float = field(kw_only=True)
    in_range: bool = field(kw_only=True)
    verdict: str = field(kw_only=True)
    named: str = field(kw_only=True)
    classes: str = field(kw_only=True)
    outcome: str = field(kw_only=True)
    p_value: float = field(kw_only=True)
    unexplained: float = field(kw_only=True)
    true_size: float = field(kw_only=True)
    q05: float = field(kw_only=True)
    q95: float = field(kw_only=True)
    gap_before: float = field(kw_only=True)
    gap_after: float = field(kw_only=True)
    gap_floor: float = field(kw_only=True)
    seconds: float = field(kw_only=True)


@cache
def engine() -> str:
    """Digest of the modules of `ENGINE` as they are run: comments, docstrings and layout don't count."""
    digest = hashlib.sha256()
    root = Path(sma_bayes.__file__).parent
    for name in ENGINE:
        place = root / name
        for path in sorted(place.rglob("*.py")) if place.is_dir() else [place]:
            digest.update(ast.dump(_undocumented(path)).encode())
    return digest.hexdigest()[:8]


def _undocumented(path: Path) -> ast.Module:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        if isinstance(body, list):
            node.body = [  # type: ignore[attr-defined]
                s for s in body if not (isinstance(s, ast.Expr) and isinstance(s.value, ast.Constant))
            ]
    return tree


def design_of(effects: Sequence[str]) -> str:
    """The design in which effects can show."""
    if "latent_heat" in effects:
        return "thermal_slow"
    if any(e in THERMAL for e in effects):
        return "thermal"
    return "ladder" if any(e in LADDER for e in effects) else "standard"


def trials(
    suite: str,
    count: int,
    *,
    first: int = 0,
    sigmas: Sequence[float] = (),
    laws: Sequence[str] = ("first", "second"),
    effects: Sequence[str] = (),
) -> Iterator[Trial]:
    """All trials of a suite, `count` of each kind.

    Parameters
    ----------
    suite : str
        Name in `SUITES`.
    count : int
        Seeds; in ``null`` and the suites of several effects, campaigns in all.
    first : int
        The first seed.
    sigmas : sequence of float
        Sizes; those of `SIGMAS` by default. In ``null`` of what the shape of the curves leaves, if not 0.
    laws : sequence of str
        Names in `LAWS`. Of ``simcoon`` only the mechanisms that it has.
    effects : sequence of str
        To be hidden; all by default.
    """
    if suite not in SUITES:
        raise ValueError(f"no suite {suite!r}; there are {', '.join(SUITES)}")
    seeds = range(first, first + count)
    sizes = sigmas or SIGMAS[suite]
    if suite == "null":
        some = (replace(_nothing(seed), sigma=s) for seed in seeds for s in sizes)
        yield from (t for t in some if t.sigma == 0.0 or t.curve != "sigmoid")
        return
    if suite in ("pairs", "triples"):
        yield from _several(2 if suite == "pairs" else 3, seeds, sizes, laws)
        return
    noises = [n for n in NOISES if NOISES[n].memory < 0.9]
    curves = [*CURVES] if suite == "outside" else ["sigmoid"]
    for seed, law in itertools.product(seeds, laws if suite != "outside" else ("first",)):
        of_law = OUTSIDE if suite == "outside" else [e for e in INSIDE if e in LAWS[law]]
        for i, (e, s) in enumerate(itertools.product(of_law, sizes)):
            if not effects or e in effects:
                noise = "white" if seed == 0 and suite != "outside" else noises[(i + seed) % len(noises)]
                curve = curves[(i // len(sizes) + seed) % len(curves)]
                yield Trial(suite, e, s, noise, design_of([e]), seed, law, curve)


def _nothing(seed: int) -> Trial:
    """Noises, designs and curves by turns, so that each meets each other."""
    noise, design = [*NOISES][seed % len(NOISES)], DESIGNS_OF_NOTHING[seed % len(DESIGNS_OF_NOTHING)]
    curve = [*CURVES][(seed // len(NOISES)) % len(CURVES)]
    effect = "wrong_calibration" if seed % 10 == 9 else "none"
    return Trial("null", effect, 0.0, noise, design, seed, "first", curve)


def _several(many: int, seeds: Sequence[int], sizes: Sequence[float], laws: Sequence[str]) -> Iterator[Trial]:
    """As many different effects at once, drawn for each seed, that show in the usual design and are not the same."""
    usual = [e for e in INSIDE if design_of([e]) == "standard"]
    for seed in seeds:
        rng = np.random.default_rng([seed, many])
        while True:
            drawn = sorted(rng.choice(usual, many, replace=False).tolist())
            if not any(b in CONTAINED_BY.get(a, ()) for a in drawn for b in drawn):
                break
        law = laws[seed % len(laws)]
        yield Trial(
            "pairs" if many == 2 else "triples",
            "+".join(drawn), sizes[(seed // len(laws)) % len(sizes)], "white", "standard", seed, law,
        )  # fmt: skip


def attempt(trial: Trial, *, folds: bool = False) -> Row | None:
    """Make a campaign, study it, and compare; None where the mechanism leaves no trace in the design."""
    hidden = trial.effects.split("+")
    try:
        case = hide_several(
            hidden,
            trial.sigma,
            trial.noise,
            trial.design,
            seed=trial.seed,
            law=trial.law,
            curve=trial.curve,
        )
    except ValueError:
        return None
    left_out = (
        {x for h in hidden for x in (h, *CONTAINED_BY.get(h, ()))} if trial.suite == "left_out" else set()
    )
    catalogue = {k: v for k, v in EFFECTS.items() if k not in left_out}
    began = time.process_time()
    with threadpool_limits(limits=1):
        study = study_campaign(
            case.campaign,
            read_priors("modified_sigmoid"),
            pooled=case.pooled,
            effects=catalogue,
            seed=trial.seed,
        )
        if set(hidden) & set(of_heating(EFFECTS)) - set(of_response(EFFECTS)):
            of_heat = study_heating(
                case.campaign,
                study,
                read_priors("modified_sigmoid"),
                pooled=case.pooled,
                effects=catalogue,
                seed=trial.seed,
            )
            study = study if of_heat is None else of_heat
    seconds = time.process_time() - began
    names = [NAMES_OF.get((e, trial.law), (e,)) for e in hidden if e in catalogue]
    outcomes = [outcome_of(study, wanted) for wanted in itertools.product(*names)]
    low, high = interval(study, NAMES_OF.get((hidden[0], trial.law), hidden)[0])
    row = Row(
        **asdict(trial),
        engine=engine(),
        sigma_reached=case.sigma,
        in_range=all(a.in_range for a in case.answers),
        verdict=study.verdict,
        named="+".join(e.id for e in study.effects),
        classes=";".join("/".join(c) for c in study.classes.values()),
        outcome="right" if "right" in outcomes else outcomes[0],
        p_value=study.p_value,
        unexplained=1.0 - study.carried if study.effects else float("nan"),
        true_size=case.answers[0].size if case.answers else 0.0,
        q05=low,
        q95=high,
        gap_before=float("nan"),
        gap_after=float("nan"),
        gap_floor=float("nan"),
        seconds=seconds,
    )
    if folds and row.outcome in ("right", "class"):
        gap = close(study, catalogue, pooled=case.pooled, seed=trial.seed)
        row = replace(row, gap_before=gap.before, gap_after=gap.after, gap_floor=gap.floor)
    return row


def outcome_of(study: GapStudy, wanted: Sequence[str]) -> str:
    """``right``: named itself; ``class``: in the class of a name; ``part``: only some of several; ``wrong``: another
    name; ``confident``: another name with no rival; or ``none`` or ``unnamed``.

    ``shape``: told as the shape of the curve, where that is what was hidden; what was hidden beside it is named.
    """
    if study.verdict == "unnamed" and list(wanted) == [BEND] and study.steps[-1].only_shape:
        return "shape"
    if study.verdict != "named":
        return study.verdict
    classes = [study.classes[e.id] for e in study.named]
    strangers = [c for c in classes if not set(c) & set(wanted)]
    if strangers:
        return "confident" if any(len(c) == 1 for c in strangers) else "wrong"
    found = [w for w in wanted if any(w in c for c in classes)]
    if len(found) < len(wanted):
        return "shape" if {*wanted} - {*found} == {BEND} and study.steps[-1].only_shape else "part"
    return "right" if {e.id for e in study.named} == set(wanted) else "class"


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
        space.free[i].prior.transform.constrain(np.array(final.z[i] + q * sd)) for q in ndtri((0.05, 0.95))
    ]
    return float(min(ends)), float(max(ends))
