"""Tables of a study of conditions."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Final

from sma_bayes.quantities import quantity_of
from sma_bayes.report.content import Estimate, Number
from sma_bayes.report.notation import interval_text, unit_label
from sma_bayes.report.tables import UNIT_OF_ROW, Cell, Column, Table, table_of, words
from sma_bayes.runs.schema import IntervalDocument
from sma_bayes.studies.conditions.features import plateau_unmeasured
from sma_bayes.studies.conditions.schema import (
    ConditionsDocument,
    LeftOutCurve,
    PredictedCondition,
    StatedEffect,
    StatedFeature,
    StatedGroup,
    StoredConditions,
)

NAMES: Final[Mapping[str, str]] = {
    "midpoint": "midpoint",
    "greatest_slope": "greatest slope",
    "share_left": "share left at the hottest",
    "least_stiffness": "least stiffness",
    "greatest_stiffness": "greatest stiffness",
    "stiffness_ratio": "stiffness ratio",
    "steepest_stiffness": "steepest slope of stiffness",
    "hysteresis_width": "hysteresis width",
    "least_temperature": "least temperature",
    "peak_temperature": "peak temperature",
    "mean_power": "mean power",
    "duty_cycle": "duty cycle",
}
"""Features and settings, for people."""
UNINFORMATIVE_SPANS: Final = 100.0
"""Spans of a curve from which a width or an error says no more than that nothing is known."""
LEAST_COVERAGE: Final = 0.8
"""Share of left-out curves that a 90 % band has to hold for its way of predicting to be advised."""
NOMINAL_COVERAGE: Final = 0.9
"""Share that such a band should hold."""
NEGLIGIBLE_SHARE: Final = 0.01
"""Share of a transformation below which it is over; a factor between such shares says nothing."""
EDGE_PROBABILITY: Final = 0.5
"""Probability from which an extreme is said to lie at an end of the measured temperatures."""


def conditions_tables(stored: StoredConditions) -> dict[str, Table]:
    """All tables of a study of conditions, by name."""
    tables = (
        design_table(stored),
        extremes_table(stored),
        feature_table(stored),
        effect_table(stored),
        scatter_table(stored),
        prediction_table(stored),
        held_out_table(stored),
        pooled_table(stored),
    )
    return {table.name: table for table in tables if table.rows}


def named(feature: str) -> str:
    """Name of a feature or setting, for people."""
    return NAMES.get(feature, feature)


def setting_name(setting: str, specimen: bool) -> str:
    """Name of a setting; the load of a specimen is a stress."""
    return "stress" if setting == "load" and specimen else named(setting)


def setting_text(name: str, value: float, unit: str) -> str:
    """A setting with its unit: ``150 MPa`` rather than ``1.5e8 Pa``."""
    if unit == "Pa":
        return f"{value * 1e-6:g} MPa"
    if unit == "Hz" and value < 1.0:
        return f"{value * 1e3:g} mHz"
    return f"{value:.4g} {unit_label(unit)}".strip()


def share_text(share: float) -> str:
    """A width or an error as a share of the span; words where it is so large that it says nothing.

    Examples
    --------
    >>> share_text(0.1234), share_text(3.2e22)
    ('0.12', 'no limit')
    """
    return f"{share:.2g}" if share < UNINFORMATIVE_SPANS else "no limit"


def preferred_way(found: ConditionsDocument) -> str:
    """Which way of predicting to use where they disagree, by what was left out; empty where nothing was.

    It is the narrowest of those whose 90 % band held at least `LEAST_COVERAGE` of the curves; extrapolations and
    stiffness, whose width is one of logarithms, do not count. Curves are few as a rule, so that their least and
    greatest share are told with the mean, and that it falls short of the 90 % that it should be.
    """
    rows: dict[str, list[tuple[float, float]]] = {}
    for h in found.held_out:
        if not h.on_log and not h.extrapolates:
            for name, score in h.ways.items():
                rows.setdefault(name, []).append((score.covers_curve, score.width / h.span))
    if not rows:
        return ""
    means = {
        name: tuple(sum(v) / len(parts) for v in zip(*parts, strict=True)) for name, parts in rows.items()
    }
    good = {name: m for name, m in means.items() if m[0] >= LEAST_COVERAGE}
    best = min(good, key=lambda n: good[n][1]) if good else max(means, key=lambda n: means[n][0])
    held, width = means[best]
    shares = [share for share, _ in rows[best]]
    each = (
        f"of {len(shares)}: {100 * min(shares):.0f} to {100 * max(shares):.0f} % each"
        if shares[1:]
        else "one"
    )
    told = (
        f"its 90 % band, {share_text(width)} of the span wide, held {100 * held:.0f} % of the curves that were left "
        f"out ({each})"
    )
    if held < NOMINAL_COVERAGE:
        told += ", which is less than it should: what is predicted is less sure than its band says"
    if good:
        return f"where predictions disagree use {best}: {told}"
    return f"no method of prediction covers what was left out; the best is {best}: {told}"


def design_table(stored: StoredConditions) -> Table:
    """What was set in each condition."""
    specimen = stored.found.specimen
    return Table(
        "design",
        "Conditions",
        "What is stated of each condition. Only conditions that state the same settings can be compared.",
        (Column("group", "group"), Column("condition", "condition"), Column("settings", "settings")),
        tuple(_design_rows(stored.found.groups, specimen)),
    )


def _design_rows(groups: Sequence[StatedGroup], specimen: bool) -> Iterator[tuple[Cell, ...]]:
    for number, group in enumerate(groups, 1):
        for place, condition in enumerate(group.conditions):
            settings = ", ".join(
                f"{setting_name(n, specimen)} {setting_text(n, v.values[place], v.unit)}"
                for n, v in group.varied.items()
            )
            yield (number, condition, settings or "nothing that differs")


def extremes_table(stored: StoredConditions) -> Table:
    """Temperatures and stiffness of each condition: the form of Tables 9 to 12 of the paper."""
    found: dict[str, dict[str, StatedFeature]] = {}
    for f in stored.found.features:
        if f.branch == "both" and f.name != "hysteresis_width":
            found.setdefault(f.condition, {})[f.name] = f
    rows = [
        (
            condition,
            *(Number(f[n].median, f[n].unit) for n in ("least_temperature", "peak_temperature")),
            unit_label(f["peak_temperature"].unit),
            *(Estimate.where_told(f[n], f[n].unit) for n in ("least_stiffness", "greatest_stiffness")),
            unit_label(f["least_stiffness"].unit),
            Estimate.where_told(f["stiffness_ratio"], "1"),
        )
        for condition, f in found.items()
        if "least_stiffness" in f
    ]
    return Table(
        "extremes",
        "Least and greatest stiffness",
        "Over the measured temperatures of both branches, as Tables 9 to 12 of the paper have them; 90 % intervals.",
        (
            Column("condition", "condition"),
            Column("least temperature", "least_temperature", UNIT_OF_ROW),
            Column("peak temperature", "peak_temperature", UNIT_OF_ROW),
            Column("unit", "temperature_unit"),
            Column("least stiffness", "least_stiffness", UNIT_OF_ROW),
            Column("greatest stiffness", "greatest_stiffness", UNIT_OF_ROW),
            Column("unit", "stiffness_unit"),
            Column("ratio", "stiffness_ratio", "1"),
        ),
        tuple(rows),
    )


def feature_table(stored: StoredConditions) -> Table:
    """Every feature of every condition."""
    rows, specimen = [], stored.found.specimen
    features = stored.found.features
    shares = [f for f in features if f.name == "share_left"]
    left = {(f.branch, f.channel) for f in shares if (f.median or 0.0) >= NEGLIGIBLE_SHARE}
    for f in features:
        if f.name == "share_left" and (f.branch, f.channel) not in left:
            continue
        value = Number(f.median, f.unit) if f.measured or f.median is None else Estimate.where_told(f, f.unit)
        edge = f.at_edge is not None and f.at_edge > EDGE_PROBABILITY
        rows.append(
            (f.condition, f.branch, named(f.name), quantity_of(f.channel, specimen=specimen), value,
             unit_label(f.unit) or "1", _remark(_doubt(f, edge), f.defined))
        )  # fmt: skip
    return Table(
        "features",
        "Features of each condition",
        "Median and 90 % interval; conditions.json says what each means, and has shares left of a "
        "transformation that is over in all conditions. An extreme at an end of the sweep tells how "
        "far the temperature went.",
        (
            *words("condition", "branch", "feature"),
            Column("of", "channel"),
            Column("value", "value", UNIT_OF_ROW),
            *words("unit", "remark"),
        ),
        tuple(rows),
        grouped=2,
    )


def _remark(said: str, defined: float) -> str:
    """What is said of a number, and how many draws are left out of it because they have none.

    Examples
    --------
    >>> _remark("", 0.9975), _remark("at an end of the sweep", 1.0)
    ('none in 0.25 % of the draws', 'at an end of the sweep')
    """
    left_out = f"none in {100 * (1.0 - defined):.2g} % of the draws" if defined < 1.0 else ""
    return "; ".join(filter(None, (said, left_out)))


def effect_table(stored: StoredConditions) -> Table:
    """Effect of every setting on every feature."""
    return Table(
        "effects",
        "Effects",
        "Change of a feature from the least to the greatest value of a setting, the other settings being equal: a "
        "factor (×) or a difference. Tested: how the tested conditions differ, without scatter. With scatter: what "
        "the setting does, conditions scattering about a straight line. Of many effects that are not there, one in "
        "ten has an interval without 1 (×) or 0 all the same. Shares left of a transformation that is over in all "
        "conditions are left out; conditions.json has them.",
        (
            *words("group", "setting", "from", "to", "feature", "branch"),
            Column("of", "channel"),
            Column("kind", "kind"),
            Column("tested", "tested", UNIT_OF_ROW),
            Column("including scatter", "with_scatter", UNIT_OF_ROW),
            Column("unit", "unit"),
            Column("P(rises)", "probability_rises", "1"),
            Column("scatter of a condition", "scatter", UNIT_OF_ROW, brief=False),
            Column("remark", "remark"),
            Column("can't be told from", "confounded_with", brief=False),
        ),
        tuple(_effect_rows(stored.found)),
        grouped=4,
    )


def _effect_rows(found: ConditionsDocument) -> Iterator[tuple[Cell, ...]]:
    groups = [g.conditions for g in found.groups]
    told = [e for e in found.effects if not _nothing_is_left(found, e)]
    for e in sorted(told, key=lambda e: (groups.index(e.conditions), e.setting)):
        specimen = found.specimen
        along = [c.name for c in e.confounded_with if c.strong]
        yield (
            f"group {groups.index(e.conditions) + 1}", setting_name(e.setting, specimen),
            *(setting_text(e.setting, end, e.setting_unit) for end in (e.from_, e.to)),
            named(e.feature), e.branch, quantity_of(e.channel, specimen=specimen),
            "×" if e.kind == "factor" else "difference",
            Estimate.where_told(e.tested, e.unit), Estimate.where_told(e.beyond, e.unit), unit_label(e.unit) or "1",
            Number(e.probability_rises, "1", 0.01), Estimate.where_told(e.scatter, e.unit),
            e.why or _remark("", e.defined),
            ", ".join(setting_name(n, specimen) for n in [*e.aliased_with, *along]),
        )  # fmt: skip


def _doubt(feature: StatedFeature, edge: bool) -> str:
    """Why a feature says less than its interval, if so."""
    if feature.name == "share_left" and plateau_unmeasured(feature.median or 0.0):
        return "its plateau was not measured"
    return "at an end of the sweep" if edge else ""


def _nothing_is_left(found: ConditionsDocument, e: StatedEffect) -> bool:
    """Whether an effect is one of shares of the transformation of which less than a hundredth is left everywhere."""
    shares = [
        f.median or 0.0
        for f in found.features
        if f.condition in e.conditions
        and (f.name, f.branch, f.channel) == ("share_left", e.branch, e.channel)
    ]
    return e.feature == "share_left" and max(shares, default=0.0) < NEGLIGIBLE_SHARE


def scatter_table(stored: StoredConditions) -> Table:
    """Scatter between conditions, before and after the data."""
    rows = [
        (
            ", ".join(p.conditions), p.branch, c.name,
            Estimate.where_told(c.scatter_prior, c.unit), Estimate.where_told(c.scatter, c.unit),
            unit_label(c.unit) or "1",
            "; ".join(f"{setting_name(n, stored.found.specimen)} {_brief(v)}" for n, v in c.changes.items()),
        )
        for p in stored.found.populations
        for c in p.coordinates
    ]  # fmt: skip
    return Table(
        "scatter",
        "What conditions have in common",
        "Standard deviation of the scatter of conditions about level and straight lines, in each coordinate and its "
        "unit, before and after the data; and the change over the tested range of each setting.",
        (
            *words("conditions", "branch", "coordinate"),
            Column("scatter before", "scatter_prior", UNIT_OF_ROW),
            Column("scatter", "scatter", UNIT_OF_ROW),
            Column("unit", "unit"),
            Column("change with", "change"),
        ),
        tuple(rows),
        grouped=2,
    )


def _brief(found: IntervalDocument) -> str:
    return interval_text(found.median, found.q05, found.q95)


def prediction_table(stored: StoredConditions) -> Table:
    """Features of the conditions that were asked for."""
    specimen = stored.found.specimen
    rows = [
        (
            p.condition, p.branch, named(f.name),
            quantity_of(f.channel, specimen=specimen), Estimate.where_told(f, f.unit),
            unit_label(f.unit) or "1", _warning(p, specimen), f.meaning,
        )
        for p in stored.found.predictions
        for f in p.features
    ]  # fmt: skip
    return Table(
        "predictions",
        "Conditions that were not measured",
        "Median and 90 % interval of what a run under these conditions would give.",
        (
            *words("condition", "branch", "feature"),
            Column("of", "channel"),
            Column("value", "value", UNIT_OF_ROW),
            *words("unit", "warning"),
            Column("meaning", "meaning", brief=False),
        ),
        tuple(rows),
        grouped=2,
    )


def _warning(p: PredictedCondition | LeftOutCurve, specimen: bool) -> str:
    said = []
    if p.extrapolates:
        said.append("extrapolates: " + ", ".join(setting_name(s, specimen) for s in p.extrapolates))
    if p.prior_led:
        said.append("width dominated by the prior")
    return "; ".join(said)


def held_out_table(stored: StoredConditions) -> Table:
    """How well left-out conditions were predicted, each way."""
    return Table(
        "held_out",
        "Conditions that were left out",
        "Each was predicted from the others. Covered: share of its temperatures at which the 90 % band holds the "
        "curve fitted to the condition itself, and share of its samples within the 90 % band of a new measurement. "
        "Whole curve covered: whether the simultaneous band holds the curve everywhere. Width of the band and error of "
        "its median over the span of the curve; of stiffness, of its natural logarithm. Temperatures of one curve go "
        "together: one condition is about one trial.",
        (
            *words("condition", "branch", "quantity"),
            Column("method", "way"),
            Column("curve covered", "covers_curve", "1"),
            Column("samples covered", "covers_samples", "1"),
            Column("whole curve covered", "holds_whole"),
            Column("width", "width", "1"),
            Column("error", "error", "1"),
            Column("remark", "remark"),
        ),
        tuple(_held_out_rows(stored.found)),
        grouped=3,
    )


def _held_out_rows(found: ConditionsDocument) -> Iterator[tuple[Cell, ...]]:
    specimen = found.specimen
    for h in found.held_out:
        for name, score in h.ways.items():
            yield (
                h.condition, h.branch, h.quantity, name,
                *(Number(n, "1", 0.01) for n in (score.covers_curve, score.covers_samples)), score.holds_whole,
                *(_share(n / h.scale) for n in (score.width, score.error)),
                _warning(h, specimen) if name == "hierarchical" else "",
            )  # fmt: skip


def _share(share: float) -> Cell:
    return Number(share, "1", 0.01) if share < UNINFORMATIVE_SPANS else share_text(share)


def pooled_table(stored: StoredConditions) -> Table:
    """A and B of each condition by itself, and with what the others say about it."""
    return table_of(
        "pooled",
        "Parameters, of each condition by itself and partially pooled",
        "Where a condition tells its parameters well, pooling changes nothing.",
        [
            (condition, p.branch, name, v)
            for p in stored.found.populations
            for condition, parameters in p.parameters.items()
            for name, v in parameters.items()
        ],
        (Column("condition", "condition"), lambda condition, branch, name, v: condition),
        (Column("branch", "branch"), lambda condition, branch, name, v: branch),
        (Column("parameter", "parameter"), lambda condition, branch, name, v: name),
        (
            Column("by itself", "alone", UNIT_OF_ROW),
            lambda condition, branch, name, v: Estimate.where_told(v.own, v.unit),
        ),
        (
            Column("partially pooled", "pooled", UNIT_OF_ROW),
            lambda condition, branch, name, v: Estimate.where_told(v.pooled, v.unit),
        ),
        (Column("unit", "unit"), lambda condition, branch, name, v: unit_label(v.unit) or "1"),
        grouped=2,
    )
