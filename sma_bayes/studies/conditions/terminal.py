"""A study of conditions on the screen: effects, predictions, what was left out, and what to doubt."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from sma_bayes.quantities import quantity_of
from sma_bayes.report.notation import interval_text, unit_label
from sma_bayes.report.screen import FIT_AGAIN, show_text
from sma_bayes.runs.schema import IntervalDocument
from sma_bayes.runs.shown import in_declared_units
from sma_bayes.studies.conditions.schema import (
    ConditionsDocument,
    LeftOutCurve,
    PredictedFeature,
    StatedEffect,
    StatedScore,
)
from sma_bayes.studies.conditions.tables import (
    named,
    preferred_way,
    setting_name,
    setting_text,
    share_text,
)

HEADLINES: Final = (
    "least_stiffness", "greatest_stiffness", "stiffness_ratio", "hysteresis_width", "midpoint",
    "As", "Af", "Ms", "Mf", "Rs", "Rf", "peak_temperature",
)  # fmt: skip
"""Features of which a terminal tells how tested conditions differ where no direction can be sure."""


def show_conditions(found: dict[str, Any], out: Path) -> None:
    """Tell what `conditions.json` says."""
    show_text(conditions_text(found), found, out)


def conditions_text(stated: Mapping[str, Any]) -> str:
    """What `conditions.json` says, in a few lines for a terminal, in declared units."""
    found = in_declared_units(ConditionsDocument.model_validate(stated))
    lines, specimen = [f"{found.campaign}, seed {found.seed}"], found.specimen
    if found.model_choice is not None:
        again = f"; fitted again with it: {', '.join(found.refitted)}" if found.refitted else ""
        lines.append(f"model {found.model_choice.reason}{again}")
    for group in found.groups:
        ranges = [
            _range_text(n, min(v.values), max(v.values), v.unit, specimen) for n, v in group.varied.items()
        ]
        lines.append(f"{', '.join(group.conditions)}: {', '.join(ranges) or 'nothing varied'}")
    lines += [_effect_text(e, e.beyond, specimen) for e in found.told_effects if e.sure and e.beyond]
    if found.told_effects:
        lines.append(f"  {found.sure_directions}; the report has all of them")
    lines += _tested_text(found, specimen)
    for p in found.predictions:
        note = (
            f"; EXTRAPOLATES in {', '.join(setting_name(s, specimen) for s in p.extrapolates)}"
            if p.extrapolates
            else ""
        )
        lines.append(f"predicted {p.condition}, {p.branch}, from {len(p.from_)} conditions{note}")
        lines += [f"  {_estimate_text(f, specimen)}" for f in p.features]
    for h in found.held_out:
        ways = "; ".join(_score_text(n, s, h) for n, s in h.ways.items())
        lines.append(f"left out {h.condition}, {h.branch}, {h.quantity}: {ways}")
    advised = preferred_way(found)
    lines += [advised] if advised else []
    lines += [f"caution: {c}" for c in found.cautions]
    lines += [f"remark: {r}" for r in (*found.declared_differently, *found.remarks)]
    if not found.converged:
        lines.append(f"NOT CONVERGED: the numbers must not be relied on; {FIT_AGAIN}.")
    return "\n".join(lines)


def _tested_text(found: ConditionsDocument, specimen: bool) -> list[str]:
    """How the tested conditions differ, where their scatter about an effect can't be told."""
    tested = [e for e in found.effects if e.tested and not e.beyond and e.feature in HEADLINES]
    lines = [_effect_text(e, e.tested, specimen) for e in tested if e.tested]
    for why in dict.fromkeys(e.why for e in tested):
        lines.append(f"  so the tested conditions differ, and no more is known: {why}")
    return lines


def _effect_text(e: StatedEffect, b: IntervalDocument, specimen: bool) -> str:
    sign = "×" if e.kind == "factor" else ""
    unit = "" if e.kind == "factor" else f" {unit_label(e.unit)}"
    along = ", ".join(named(c.name) for c in e.confounded_with if c.strong)
    branch = "" if e.branch == "both" else f", {e.branch}"
    reach = _range_text(e.setting, e.from_, e.to, e.setting_unit, specimen)
    what = f"{_feature_text(e.feature, e.channel, specimen)}{branch}"
    return f"  {reach}: {what} {sign}{interval_text(b.median, b.q05, b.q95)}{unit}" + (
        f"; or {along}" if along else ""
    )


def _range_text(setting: str, low: float, high: float, unit: str, specimen: bool) -> str:
    ends = f"{setting_text(setting, low, unit)} to {setting_text(setting, high, unit)}"
    return f"{setting_name(setting, specimen)} {ends}"


def _feature_text(name: str, channel: str, specimen: bool) -> str:
    of = f" of {quantity_of(channel, specimen=specimen)}" if channel and channel not in name else ""
    return f"{named(name)}{of}"


def _estimate_text(f: PredictedFeature, specimen: bool) -> str:
    value = interval_text(f.median, f.q05, f.q95)
    return f"{_feature_text(f.name, f.channel, specimen)}: {value} {unit_label(f.unit)}".rstrip()


def _score_text(name: str, score: StatedScore, held: LeftOutCurve) -> str:
    width, error = score.width / held.scale, score.error / held.scale
    of = "in ln" if held.on_log else "of the span"
    return (
        f"{name} covers {score.covers_curve:.0%}, width {share_text(width)}, error {share_text(error)} {of}"
    )
