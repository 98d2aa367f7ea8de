"""A small part of the hidden-effect benchmark, `scripts/benchmark_gap.py`: what is named, with seeds that are fixed.

The rates are those that the gap workflow is to reach. More failures than are allowed would have a probability below
0.1 % each time if failures were just as frequent as stated, and campaigns were drawn anew. Few campaigns bound a rate
only loosely: of the few that are always run, four of five may not be missed where one in 20 should. All of them, marked
`thorough`, take half an hour, and bound it better (five of 20 may fail); the whole benchmark, which takes hours, is for
the rates themselves.

- One effect hidden at 10 sigma: its name or its class in 95 %. Every effect of the catalogue that shows in the usual
  design, by turns under white and AR(1) noise; those that need current and temperature, or a ladder of peaks, are
  left to the whole benchmark. Where all are run, the 90 % interval of its size holds the true one in 90 % of those
  named, where mechanism and catalogue mean the same by it.
- One at 100 sigma, by another law than the catalogue's: the same. What no catalogue has is not named then, either.
- Nothing hidden: nothing is named in 99 %, whatever the noise, the sampling, the calibration; and small p-values are no
  more frequent than they say. Curves are sigmoids here; other shapes are those of
  `tests/unit/studies/gap/test_shape_nulls.py`, and, in records of one cycle, where nothing repeats, those of a test
  of their own.
- Something hidden that no catalogue has, or that was taken out of it: no name in 90 %, and a wrong name without any
  rival in at most 2 %.
- Two effects: both named in 85 %; three: all in 70 %. Only where all are run.

The held-out gap costs several times as much as all else and is left out; it has
`tests/unit/studies/gap/test_close.py`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import cycle

import pytest
from benchmark_gap import OTHER_SIZE
from gap_benchmark.hide import INSIDE, OUTSIDE
from gap_benchmark.trials import Row, Trial, attempt, design_of, trials
from scipy.stats import binom, kstest

pytestmark = pytest.mark.slow

FALSE_ALARM = 1e-3
SATURATED = ("clock_skew", "fixture_compliance", "quantisation")
"""What can't become that strong: the model absorbs the rest."""
USUAL = [e for e in INSIDE if design_of([e]) == "standard"]


def tried(some: Sequence[Trial]) -> list[Row]:
    """Make campaigns and study them."""
    found = [row for row in map(attempt, some) if row is not None]
    assert len(found) == len(some), "a mechanism left no trace"
    return found


def at_most(rate: float, rows: Sequence[Row], fails: Callable[[Row], bool]) -> None:
    """Fail where there are so many failures that in fewer than one file of a thousand there would be as many."""
    failures = [(r.suite, r.effects, r.noise, r.design, r.outcome, r.classes) for r in rows if fails(r)]
    assert len(failures) <= binom.ppf(1.0 - FALSE_ALARM, len(rows), rate), failures


def is_told(row: Row) -> bool:
    return row.outcome in ("right", "class", "shape")


few_or_all = pytest.mark.parametrize("whole", [False, pytest.param(True, marks=pytest.mark.thorough)])
"""Whether all campaigns are run, or the few for which there is always time."""


@few_or_all
def test_a_hidden_effect_is_named_with_its_size(whole: bool) -> None:
    noises = cycle(["white", "ar1_0.5"])
    rows = tried(
        [Trial("hidden", e, 10.0, next(noises), "standard", 0) for e in (USUAL if whole else USUAL[::5])]
    )
    at_most(0.05, rows, lambda r: not is_told(r))
    if whole:
        sized = [r for r in rows if r.outcome == "right" and r.in_range and r.effects not in OTHER_SIZE]
        assert len(sized) >= 10
        at_most(0.10, sized, lambda r: not r.q05 <= r.true_size <= r.q95)


@few_or_all
def test_a_strong_effect_is_named_though_its_form_is_not_the_catalogues(whole: bool) -> None:
    strong = [e for e in USUAL if e not in SATURATED]
    chosen = strong if whole else strong[::5]
    rows = tried([Trial("hidden", e, 100.0, "white", "standard", 0, "second") for e in chosen])
    at_most(0.05, rows, lambda r: not is_told(r))


@pytest.mark.parametrize(
    ("effect", "sigma", "law"),
    [
        ("saturation", 100.0, "first"),
        ("path_stress_shift", 300.0, "first"),
        pytest.param("saturation", 300.0, "first", marks=pytest.mark.thorough),
        pytest.param("temperature_gradient", 100.0, "second", marks=pytest.mark.thorough),
    ],
)
def test_an_effect_is_not_lost_as_it_grows(effect: str, sigma: float, law: str) -> None:
    """Each was `unnamed`: noise with the corner of a limit in it, a shift half solved, a wire that warms at once."""
    (row,) = tried([Trial("hidden", effect, sigma, "white", design_of([effect]), 0, law)])
    assert row.outcome == "right"


@pytest.mark.parametrize("seed", [31, 5109, pytest.param(30, marks=pytest.mark.thorough)])
def test_two_stages_under_noise_that_remembers_are_no_effect(seed: int) -> None:
    """Each was a `path_stress_shift`: two by the noise beside it, when that had to carry no more than by the other.

    One, as all that was left beside a curve of any shape, 2 % of what it explained, was its own.
    """
    (row,) = tried([*trials("null", 1, first=seed)])
    assert row.curve == "two_stages"
    assert row.verdict == "unnamed"


def test_a_bent_curve_is_no_two_effects() -> None:
    """A skew of 100 sigma was itself and the 7 % that its form left: a compliance."""
    (row,) = tried([Trial("hidden", "asymmetric_kinetics", 100.0, "white", "standard", 0)])
    assert row.outcome == "shape"


def test_what_no_effect_can_be_has_no_name() -> None:
    """A compliance far beyond its range: a `bias_spring` of five times the measured force was named for it."""
    (row,) = tried([Trial("hidden", "fixture_compliance", 100.0, "white", "standard", 0, "second")])
    assert not row.in_range
    assert row.outcome not in ("wrong", "confident")


@pytest.mark.parametrize(
    ("suite", "effects", "sigma", "law", "seed"),
    [
        # many numbers, which a coarse grid misses: two effects stood in for it
        ("hidden", "training", 10.0, "first", 0),
        # passed for noise with a memory of 0.999, which left 142 of 36,600 nats
        ("hidden", "training", 300.0, "second", 0),
        # the second one explains 17 % of what the first does, and all that is left
        ("pairs", "bias_spring+contact_error", 100.0, "first", 16),
        pytest.param(
            "pairs", "bias_spring+thermocouple_lag", 100.0, "second", 11, marks=pytest.mark.thorough
        ),
        # what drifts before a limit was put around it
        ("pairs", "load_cell_thermal_drift+saturation", 10.0, "first", 12),
        # training stood in for fading while the creep was missing
        pytest.param("pairs", "amplitude_fatigue+hot_creep", 30.0, "first", 8, marks=pytest.mark.thorough),
        # two that only bend the curve, and a third one beside two sets of two
        pytest.param(
            "pairs", "path_stress_shift+thermal_expansion", 30.0, "first", 2, marks=pytest.mark.thorough
        ),
        pytest.param(
            "triples",
            "amplitude_fatigue+hot_creep+thermal_expansion",
            30.0,
            "second",
            1,
            marks=pytest.mark.thorough,
        ),
        # what is left is the form of the first: 9 and 1 % of what that explains
        pytest.param("hidden", "temperature_gradient", 30.0, "first", 0, marks=pytest.mark.thorough),
        pytest.param("hidden", "amplitude_fatigue", 300.0, "second", 0, marks=pytest.mark.thorough),
    ],
)
def test_what_was_missed_once_is_named(suite: str, effects: str, sigma: float, law: str, seed: int) -> None:
    (row,) = tried([Trial(suite, effects, sigma, "white", design_of(effects.split("+")), seed, law)])
    assert row.outcome == "right"


@few_or_all
def test_what_no_catalogue_has_is_not_named_though_it_is_strong(whole: bool) -> None:
    seeds = range(2) if whole else range(1)
    chosen = OUTSIDE if whole else OUTSIDE[::2]
    rows = tried([Trial("outside", e, 100.0, "white", "standard", seed) for e in chosen for seed in seeds])
    at_most(0.02, rows, lambda r: r.verdict != "unnamed")


@few_or_all
def test_where_nothing_is_hidden_nothing_is_named(whole: bool) -> None:
    plain = tried([t for t in trials("null", 120) if t.curve == "sigmoid"][:: 1 if whole else 4])
    assert len(plain) >= (36 if whole else 9)
    at_most(0.01, plain, lambda r: r.verdict == "named")
    for level in (0.02, 0.2):
        at_most(level, plain, lambda r, level=level: r.p_value <= level)


@few_or_all
def test_curves_of_another_shape_in_records_of_one_cycle_get_no_name(whole: bool) -> None:
    """Phases with slopes under AR(1) noise of 0.8 are three campaigns in which effects had names once."""
    known = [Trial("null", "none", 0.0, "ar1_0.8", "one_cycle", s, curve="slopes") for s in (20, 1022, 1122)]
    others = [t for t in trials("null", 360) if t.design == "one_cycle" and t.curve != "sigmoid"]
    rows = tried([*known, *(others if whole else others[::15])])
    at_most(0.01, rows, lambda r: r.verdict == "named")


@few_or_all
@pytest.mark.parametrize(("noise", "design"), [("white", "one_cycle"), ("ar1_0.95", "standard")])
def test_p_values_of_nothing_are_uniform(noise: str, design: str, whole: bool) -> None:
    """They are not too small: by Kolmogorov's distance upwards, which chance exceeds in one case of a thousand."""
    rows = tried([Trial("null", "none", 0.0, noise, design, seed) for seed in range(40 if whole else 8)])
    assert kstest([r.p_value for r in rows], "uniform", alternative="greater").pvalue > FALSE_ALARM


@pytest.mark.thorough
@few_or_all
def test_what_is_in_no_catalogue_gets_no_name(whole: bool) -> None:
    left_out = [Trial("left_out", e, 10.0, "white", "standard", 0) for e in USUAL[::5]]
    foreign = [*trials("outside", 1, sigmas=[10.0])]
    rows = tried([*left_out, *foreign] if whole else [*left_out[::2], *foreign[::3]])
    at_most(0.10, rows, lambda r: r.verdict != "unnamed")
    at_most(0.02, rows, lambda r: r.outcome == "confident")


@pytest.mark.thorough
def test_several_effects_are_all_named() -> None:
    at_most(0.15, tried([*trials("pairs", 6, sigmas=[30.0])]), lambda r: not is_told(r))
    at_most(0.30, tried([*trials("triples", 8, sigmas=[30.0])]), lambda r: not is_told(r))


@few_or_all
def test_noise_that_grows_with_the_response_is_no_disagreement(whole: bool) -> None:
    """As even noise 15 of 24 were `unnamed` and one was named; counts beyond what once in 1,000 runs is."""
    seeds = range(3000, 3024 if whole else 3006)
    rows = tried([Trial("null", "none", 0.0, "growing", "standard", s, curve="sigmoid") for s in seeds])
    at_most(0.01, rows, lambda r: r.verdict == "named")
    for level in (0.02, 0.2):
        at_most(level, rows, lambda r, level=level: r.p_value <= level)
