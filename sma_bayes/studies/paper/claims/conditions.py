"""Claims about what current, load, frequency and duty cycle do."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from sma_bayes.paper.extremes import EXTREME_CONDITIONS, TABLE_9, TABLE_10, TABLE_11, extremes
from sma_bayes.paper.physics import PUBLISHED_HELIX, apparent_shear_modulus
from sma_bayes.paper.tables import TABLE_6
from sma_bayes.quantities import convert
from sma_bayes.records.types import Branch
from sma_bayes.report.notation import unit_label
from sma_bayes.studies.conditions.effects import SettingEffect, operating_effects
from sma_bayes.studies.conditions.features import BOTH, Feature
from sma_bayes.studies.paper.claims.claim import Claim, EvidenceForClaim, from_print, from_twin
from sma_bayes.studies.paper.printed import (
    printed_effects,
    probability_positive,
    repeat_scatter,
    second_run,
)
from sma_bayes.studies.paper.twin_study import TwinStudy

ASSUMED = "depends on the temperatures that the twin assumes"
TREND = "slope over the tests, with scatter between them"


def condition_claims(study: TwinStudy) -> Iterator[Claim]:
    """Every trend that sections 7.1 and 5 state, in their order."""
    twin = {
        (e.feature, e.channel, e.setting): e
        for e in operating_effects((*study.features, *gaps(study.features)), seed=study.seed)
        if e.branch == BOTH
    }
    yield from _current(twin.get(("greatest_stiffness", "stiffness", "current")))
    yield from _load(twin.get(("greatest_stiffness", "stiffness", "load")))
    yield from _hysteresis(twin, study.features)
    yield from _frequency(twin.get(("greatest_stiffness", "stiffness", "frequency")))
    yield from _duty_cycle()
    yield _range_of_change()
    yield _quality()


def gaps(features: Sequence[Feature]) -> tuple[Feature, ...]:
    """Hysteresis gaps, whichever branch is the warmer one: printed rows have both signs."""
    return tuple(
        replace(f, name="hysteresis_gap", draws=np.abs(f.draws))
        for f in features
        if f.name == "hysteresis_width"
    )


def _rises(effect: SettingEffect) -> float | None:
    return effect.probability_rises


def _falls(effect: SettingEffect) -> float | None:
    return None if effect.probability_rises is None else 1.0 - effect.probability_rises


def _change(effect: SettingEffect) -> str:
    if effect.tested is None:
        return "no change can be told"
    if effect.factor:
        return f"{effect.tested['median']:.2f}-fold"
    return f"{effect.tested['median']:+.3g} {unit_label(effect.unit)}".replace("-", "−")


def _strong(effect: SettingEffect) -> tuple[str, ...]:
    """What varied along with a setting so closely that the two can't be told apart."""
    return tuple(c.other.replace("_", " ") for c in effect.confounders if c.strong)


def _confounded(effect: SettingEffect) -> str:
    found = [f"{c.other.replace('_', ' ')} (r = {c.correlation:.2f})" for c in effect.confounders if c.strong]
    return f" It can't be told from {' and '.join(found)}." if found else ""


def _of_twin(effect: SettingEffect | None) -> tuple[EvidenceForClaim, ...]:
    if effect is None:
        return ()
    told = f"{_change(effect)} in the greatest stiffness; {ASSUMED}"
    return (from_twin(told, _rises(effect)),)


def _current(twin: SettingEffect | None) -> Iterator[Claim]:
    effects = printed_effects(TABLE_9)
    greatest, rise = effects["greatest_stiffness"], effects["stiffness_rise"]
    yield Claim(
        "stiffness-rises-with-current",
        "Stiffness rises with current",
        (419, 421),
        (
            from_print(
                f"greatest stiffness {_change(greatest)} from 1 to 2 A; {TREND} (Table 9, and the second run at 2 A of "
                "line 339)",
                _rises(greatest),
            ),
            *_of_twin(twin),
        ),
        "An association of three tests." + _confounded(greatest),
        ("E27", "E41"),
        _strong(greatest),
    )  # fmt: skip
    yield Claim(
        "change-of-stiffness-rises-with-current",
        "The change from least to greatest stiffness rises with current",
        (421,),
        (from_print(f"{_change(rise)} from 1 to 2 A; {TREND}", _rises(rise)),),
        "An association of the same three tests." + _confounded(rise),
        ("E27", "E41"),
        _strong(rise),
    )
    row = {name: r["stiffness_max"] for name, r in extremes(TABLE_9).items()}
    one, middle, two = row["1A-10mHz"], row["1.5A-10mHz"], row["2A-10mHz-table3"]
    other = second_run()["stiffness_max"]
    contrast = (two + other) / 2.0 - 2.0 * middle + one
    yield Claim(
        "change-greater-above-1.5A",
        "The greatest stiffness changes more from 1.5 to 2 A than from 1 to 1.5 A",
        (421,),
        (
            from_print(
                f"{two - middle:.1f} against {middle - one:.1f} N/m by Table 9, {other - middle:.1f} N/m by the second "
                "run at 2 A",
                probability_positive(contrast, (0.5, 0.5, -2.0, 1.0), repeat_scatter("stiffness_max")),
            ),
        ),
        "The two runs at 2 A disagree about it.",
        ("E27",),
    )  # fmt: skip


def _load(twin: SettingEffect | None) -> Iterator[Claim]:
    greatest = printed_effects(TABLE_10)["greatest_stiffness"]
    yield Claim(
        "stiffness-rises-with-load",
        "Stiffness rises with load",
        (427,),
        (
            from_print(f"greatest stiffness {_change(greatest)} from 100 to 200 g; {TREND}", _rises(greatest)),
            *_of_twin(twin),
        ),
        "Three tests, and the greatest temperature is not the same in them.",
        ("E41", "E42"),
    )  # fmt: skip
    row = {name: r["stiffness_max"] for name, r in extremes(TABLE_10).items()}
    low, middle, high = row["100g-10mHz"], row["150g-10mHz"], row["200g-10mHz"]
    yield Claim(
        "change-greater-below-150g",
        "The stiffness changes more from 100 to 150 g than from 150 to 200 g",
        (427,),
        (
            from_print(
                f"{middle - low:.1f} against {high - middle:.1f} N/m, with the scatter of the repeated test at 2 A",
                probability_positive(2.0 * middle - low - high, (2.0, -1.0, -1.0), repeat_scatter("stiffness_max")),
            ),
        ),
        "The same sentence calls the change linear, which would be the opposite.",
        ("E45",),
    )  # fmt: skip


_HYSTERESIS = (
    ("force", "load", True, "The hysteresis gap of the force rises with load", (425,)),
    ("displacement", "load", False, "The hysteresis band of the displacement falls with load", (425,)),
    ("force", "frequency", False, "The hysteresis band of the force falls with frequency", (433, 435)),
    ("displacement", "frequency", False, "The hysteresis band of the displacement falls with frequency", (433, 435)),
)  # fmt: skip
"""Channel, setting, whether it is said to rise, and the claim."""


def _hysteresis(
    twin: dict[tuple[str, str, str], SettingEffect], features: Sequence[Feature]
) -> Iterator[Claim]:
    for channel, setting, rising, text, lines in _HYSTERESIS:
        effect = twin.get(("hysteresis_gap", channel, setting))
        if effect is None:
            continue
        widths = [f for f in features if (f.name, f.channel) == ("hysteresis_width", channel)]
        crossed = sum(float(np.median(f.draws)) < 0.0 for f in widths)
        yield Claim(
            f"hysteresis-of-{channel}-by-{setting}",
            text,
            lines,
            (
                from_twin(
                    f"distance of the midpoints of both branches, {_change(effect)} from least to greatest {setting}; "
                    f"{TREND}",
                    _rises(effect) if rising else _falls(effect),
                    counts=True,
                ),
            ),
            "From the printed midpoints, which the twin's assumptions hardly touch, in a unit of temperature that "
            f"nobody knows. In {crossed} of {len(widths)} conditions the cooling branch is the warmer one.",
            ("E15", "E16", "E17"),
        )  # fmt: skip


def _frequency(twin: SettingEffect | None) -> Iterator[Claim]:
    yield Claim(
        "stiffness-rises-with-frequency",
        "Stiffness rises slightly with frequency",
        (433, 435),
        (from_print("the stiffness of Table 12 is lost", None), *_of_twin(twin)),
        "The table that would show it holds copies of other columns.",
        ("E26", "E40", "E45"),
        lost="stiffness by frequency (Table 12)",
    )
    yield Claim(
        "modulus-hardly-varies-with-frequency",
        "The storage modulus varies little with frequency in martensite and austenite",
        (484,),
        (from_print("no number of Figs. 19 and 20 is printed", None),),
        "It is the modulus of the material, not the stiffness of the spring. Of measurements `sma-bayes modulus` "
        "would tell by how much, with an interval.",
        ("E48",),
        lost="storage modulus (Figs. 19 and 20)",
    )


def _duty_cycle() -> Iterator[Claim]:
    effects = printed_effects(TABLE_11)
    highest = max(row["stiffness_max"] for row in extremes(TABLE_11).values())
    modulus = apparent_shear_modulus(highest, PUBLISHED_HELIX)
    greatest, slope = effects["greatest_stiffness"], effects["mean_slope"]
    yield Claim(
        "stiffness-rises-with-duty-cycle",
        "Stiffness rises consistently with duty cycle",
        (449,),
        (from_print(f"greatest stiffness {_change(greatest)} from 40 to 80 %; {TREND}", _rises(greatest)),),
        f"The printed stiffnesses need a shear modulus of up to {modulus / 1e9:.0f} GPa, which the alloy does not have."
        + _confounded(greatest),
        ("E38", "E39", "E43"),
        _strong(greatest),
    )
    yield Claim(
        "slope-falls-with-duty-cycle",
        "The slope of the stiffness falls with duty cycle",
        (451,),
        (
            from_print(
                f"mean slope between the printed extremes {_change(slope)} from 40 to 80 %; {TREND}",
                _falls(slope),
            ),
        ),
        "The printed extremes point the other way." + _confounded(slope),
        ("E38", "E45"),
        _strong(slope),
    )


def _range_of_change() -> Claim:
    rows = {**extremes(TABLE_9), **extremes(TABLE_10)}
    by_temperature = min(row["stiffness_max"] / row["stiffness_min"] for row in rows.values())
    by_load = [row["stiffness_max"] for row in extremes(TABLE_10).values()]
    by_load_ratio = max(by_load) / min(by_load)
    runs = extremes(TABLE_9)["2A-10mHz-table3"], second_run()
    apart = [np.log(r["stiffness_max"] / r["stiffness_min"]) for r in runs]
    scatter = abs(float(apart[0] - apart[1])) / float(np.sqrt(2.0))
    return Claim(
        "temperature-matters-most",
        "Stiffness changes most with temperature, less with frequency and stress",
        (437,),
        (
            from_print(
                f"{by_temperature:.1f}-fold or more with temperature, {by_load_ratio:.2f}-fold with load",
                probability_positive(
                    float(np.log(by_temperature / by_load_ratio)), (1.0, 1.0, -1.0), scatter
                ),
            ),
        ),
        "It speaks of frequency, of which the stiffness is lost: the evidence is of load alone, in three tests.",
        ("E26",),
        lost="stiffness by frequency (Table 12)",
    )


def _quality() -> Claim:
    features = []
    for name, row in extremes(TABLE_9).items():
        cell = TABLE_6.select(name, Branch.HEATING)["rmse"]
        rmse = float(convert(cell.value, cell.unit, "N/m", what="RMSE"))
        share = rmse / (row["stiffness_max"] - row["stiffness_min"])
        features += [
            Feature("relative_rmse", EXTREME_CONDITIONS[name], BOTH, "", "1", np.full(8, share), "", True),
            *(
                Feature(f"{end}_temperature", EXTREME_CONDITIONS[name], BOTH, "", "degC", np.full(8, row[key]), "")
                for end, key in (("least", "temperature_min"), ("peak", "temperature_max"))
            ),
        ]  # fmt: skip
    (effect,) = (e for e in operating_effects(features) if e.feature == "relative_rmse")
    r2 = [TABLE_6.select(name, Branch.HEATING)["r2"].printed for name in extremes(TABLE_9)]
    return Claim(
        "fit-improves-with-current",
        "The quality of the fit improves with current",
        (320,),
        (
            from_print(
                f"RMSE over the range of stiffness, heating, {_change(effect)} from 1 to 2 A, not steadily; R² "
                f"{', '.join(r2)}; {TREND}",
                _falls(effect),
            ),
        ),
        "R² does not change in four digits.",
        ("E30",),
    )  # fmt: skip
