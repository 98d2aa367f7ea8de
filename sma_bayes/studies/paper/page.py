"""The page: what the paper prints beside what comes out, as Markdown, from `paper.json` alone."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any, Final

from jinja2 import Environment, PackageLoader, StrictUndefined

from sma_bayes.paper.tables import CellStatus
from sma_bayes.records.types import setting_unit
from sma_bayes.report.notation import MISSING, interval_text, unit_label, with_minus, write
from sma_bayes.runs.schema import IntervalDocument
from sma_bayes.studies.compare.schema import StatedDifference
from sma_bayes.studies.compare.words import short
from sma_bayes.studies.paper.claims.claim import FAILS, HOLDS, OPEN, SURE
from sma_bayes.studies.paper.distance import PublishedDistance
from sma_bayes.studies.paper.export import pipes
from sma_bayes.studies.paper.schema import (
    JudgedClaim,
    ModelOfTwin,
    PageFigure,
    PrintedEffect,
    RecomputedValue,
    ReproducedEntry,
    ReproductionDocument,
    TwinComparison,
)
from sma_bayes.studies.paper.tables import IMPLIED

TEMPLATE: Final = "page.md.j2"
ERRATA: Final = "reference/errata.md"
PICTURES: Final = "images/paper"
"""Folder of the pictures, beside the page."""
CLEAR: Final = 0.005
"""Probabilities nearer to 0 or 1 than this are not told apart from them."""


def page(found: ReproductionDocument) -> str:
    """The page of a finished reproduction.

    Returns
    -------
    str
        Markdown, to be put beside the folder ``images``.
    """
    environment = Environment(
        loader=PackageLoader("sma_bayes.studies.paper", ""),
        autoescape=False,  # Markdown of our own numbers
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    verdicts = [c.verdict for c in found.claims]
    words = {
        "sure": SURE,
        "holds": HOLDS,
        "fails": FAILS,
        "open": OPEN,
        "tested": sum(c.error is not None for c in found.claims),
        "before": _before(found.claims),
        "count": {verdict: verdicts.count(verdict) for verdict in (HOLDS, FAILS, OPEN)},
        "probability": probability,
        "errata": errata_links,
        "figure": partial(_figure, found.figures),
    }
    text = environment.get_template(TEMPLATE).render(
        found=found,
        claim_table=_claim_table(found.claims),
        correlation_table=_correlation_table(found.comparison.models),
        distance_table=_distance_table(found.distances),
        model_table=_model_table(found.comparison.models),
        specification_table=_specification_table(found.rows(1, 2)),
        trend_table=_trend_table(found.printed_effects),
        why=_why(found.comparison),
        verdicts=", ".join(f"{n} {v.replace('_', ' ')}" for v, n in found.comparison.verdicts.items()),
        unavailable=_unavailable(found.comparison.unavailable),
        **words,
        **_parameters(found),
        **_statistics(found),
        **_extremes(found),
    )
    return with_minus(text)


# --- cells --------------------------------------------------------------------------------------------


def probability(value: float | None) -> str:
    """A probability with two digits, and not surer than draws can be.

    Examples
    --------
    >>> probability(0.983), probability(1.0), probability(0.0), probability(None)
    ('0.98', '> 0.99', '< 0.01', '–')
    """
    if value is None:
        return MISSING
    if value > 1.0 - CLEAR:
        return "> 0.99"
    return "< 0.01" if value < CLEAR else f"{value:.2f}"


def errata_links(ids: str | Sequence[str]) -> str:
    """Links to errata.

    Examples
    --------
    >>> errata_links("E28")
    '[E28](reference/errata.md#e28)'
    """
    names = ids.split() if isinstance(ids, str) else ids
    return " ".join(f"[{i}]({ERRATA}#{i.lower()})" for i in names)


def anchor(heading: str) -> str:
    """Anchor that a heading gets: lower case, punctuation dropped, blanks as hyphens.

    Examples
    --------
    >>> anchor("Stiffness against temperature, Eq. (7), is an S curve")
    'stiffness-against-temperature-eq-7-is-an-s-curve'
    """
    return re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")


def _figure(figures: Sequence[PageFigure], stem: str) -> str:
    chosen = next(f for f in figures if f.stem == stem)
    return f"![{chosen.alt}]({PICTURES}/{stem}.png)\n\n*{chosen.caption}*\n"


def _unit(unit: str) -> str:
    """Unit for people; a difference of temperatures is told as a temperature."""
    told = unit.replace("delta_degC", "degC").replace("ohm*m", "Ω m").replace("**", "^")
    return unit_label(re.sub(r"\^3\b", "³", told))


def _interval(found: IntervalDocument) -> str:
    """Median and interval; the median alone where rounding is all that makes a difference."""
    low, median, high = found.quantiles
    if high - low < 1e-9 * abs(median):
        return write([median], digits=5).plain[0]
    return interval_text(median, low, high)


def _pivot(entries: Sequence[ReproducedEntry], quantities: Sequence[str]) -> list[list[str]]:
    """A line for each condition and branch, a column for each quantity, errata last."""
    by_place: dict[tuple[str, ...], dict[str, ReproducedEntry]] = {}
    for e in entries:
        by_place.setdefault((str(e.table), e.condition, e.branch), {})[e.quantity] = e
    return [
        [
            *(word for word in place if word),
            *(_cell(cells.get(q)) for q in quantities),
            errata_links(list(dict.fromkeys(i for e in cells.values() for i in e.errata.split()))),
        ]
        for place, cells in by_place.items()
    ]


def _cell(entry: ReproducedEntry | None) -> str:
    """Printed value over recomputed."""
    if entry is None:
        return MISSING
    lost = entry.published is None
    doubted = not lost and entry.status not in (CellStatus.OK, IMPLIED)
    printed = "lost" if lost else f"{entry.printed}{'†' if doubted else ''}"
    found = entry.recomputed
    return printed if found is None else f"{printed}<br>{_value(found)}"


def _value(found: RecomputedValue | IntervalDocument) -> str:
    return write([found.value]).plain[0] if isinstance(found, RecomputedValue) else _interval(found)


# --- tables -------------------------------------------------------------------------------------------


def _before(claims: Sequence[JudgedClaim]) -> str:
    """How many open claims would have a verdict if each were looked at alone, and what keeps them from it."""
    alone = [
        (c, c.error) for c in claims if c.verdict == OPEN and c.error is not None and c.error <= 1.0 - SURE
    ]
    if not alone:
        return ""
    unsure = sum(error > c.allowed_error for c, error in alone)
    confounded, lost = sum(bool(c.confounded) for c, _ in alone), sum(bool(c.lost) for c, _ in alone)
    return (
        f"Looked at one by one, {len(alone)} more would be sure: {unsure} are not by Holm's rule, {confounded} speak "
        f"of a setting that can't be told from another one, {lost} of numbers that are lost."
    )


def _claim_table(claims: Sequence[JudgedClaim]) -> str:
    rows = [
        (
            f"[{c.claim}](#{anchor(c.claim)})",
            ", ".join(map(str, c.lines)),
            f"**{c.verdict}**",
            ", ".join(_probabilities(c)) or MISSING,
            errata_links(c.errata),
        )
        for c in claims
    ]
    return pipes(("claim", "lines", "verdict", "probability", "errata"), rows)


def _probabilities(claim: JudgedClaim) -> list[str]:
    return [
        probability(e.probability) if e.counts else f"*twin {probability(e.probability)}*"
        for e in claim.evidence
        if e.probability is not None
    ]


def _correlation_table(models: Mapping[str, ModelOfTwin]) -> str:
    rows = [
        (
            short(name),
            data,
            *(_interval(r[rule]) for rule in ("plain", "fisher", "pooled")),
            probability(r["plain"].above),
            _interval(r2["plain"]),
        )
        for name, m in models.items()
        for data, r, r2 in (
            ("in sample", m.r.in_sample, m.r2.in_sample),
            ("held out", m.r.held_out, m.r2.held_out),
        )
    ]
    header = ("model", "data", "plain mean of r", "Fisher mean", "pooled", "P(plain > 0.95)", "mean of R²")
    return pipes(header, rows)


def _distance_table(distances: Sequence[PublishedDistance]) -> str:
    rows = [
        (
            d.condition,
            d.branch,
            f"{d.least:.3f} to {d.greatest:.3f}",
            MISSING if d.rmse is None else f"{d.rmse:.4f}",
            *(
                text
                for distance in (d.logistic, d.line)
                for text in (f"{distance:.4f}", MISSING if d.rmse is None else f"{distance / d.rmse:.2f}")
            ),
        )
        for d in distances
    ]
    header = ("condition", "branch", "stiffness", "RMSE", "to logistic", "ratio", "to line", "ratio")
    return pipes(header, rows)


def _model_table(models: Mapping[str, ModelOfTwin]) -> str:
    def evidence(item: tuple[str, ModelOfTwin]) -> float:
        return -math.inf if item[1].ln_evidence is None else item[1].ln_evidence

    rows = [
        (short(name), _whole(m.ln_evidence), _whole(m.elpd_held_out), _behind(m.behind_preferred))
        for name, m in sorted(models.items(), key=evidence, reverse=True)
    ]
    header = ("model", "ln evidence", "held-out log density", "held out, behind the best (95 %)")
    return pipes(header, rows)


def _whole(value: float | None) -> str:
    return MISSING if value is None else f"{value:.0f}".replace("-", "−")


def _behind(d: StatedDifference) -> str:
    if not d.value:
        return MISSING
    interval = "" if d.low is None or d.high is None else f" ({d.low:.0f} to {d.high:.0f})"
    return f"{d.value:.0f}{interval}".replace("-", "−")


def _why(c: TwinComparison) -> str:
    """Evidence and held-out density of the preferred model beside those of its rival."""
    if c.ln_bayes_factor is None or not c.rival:
        return f"there is no model but the {short(c.preferred)}"
    told = f"ln Bayes factor of the {short(c.preferred)} over the {short(c.rival)} is {c.ln_bayes_factor:.1f}"
    d = c.models[c.rival].behind_preferred
    interval = "" if d.low is None or d.high is None else f" ({-d.high:.1f} to {-d.low:.1f})"
    gain = f"{-d.value:.1f}{interval}".replace("-", "−")
    return f"{told}; held out, its log density is greater by {gain}"


def _unavailable(reasons: Mapping[str, str]) -> str:
    by_reason: dict[str, list[str]] = {}
    for name, reason in reasons.items():
        by_reason.setdefault(reason, []).append(short(name))
    missing = [f"{' and '.join(names)} ({reason})" for reason, names in by_reason.items()]
    return f"Not taking part: {', '.join(missing)}." if missing else ""


def _specification_table(entries: Sequence[ReproducedEntry]) -> str:
    rows = [
        (
            str(e.table),
            e.quantity.replace("_", " "),
            _untypeset(e.printed),
            MISSING if e.recomputed is None else f"{_value(e.recomputed)} {_unit(e.unit)}",
            "" if e.status == CellStatus.OK else e.status,
            errata_links(e.errata),
        )
        for e in entries
    ]
    return pipes(("table", "quantity", "printed", "recomputed", "status", "errata"), rows)


_RAISED: Final = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_SIGNS: Final = {r"\times": "×", r"\geq": "≥", r"\leq": "≤", r"\circ": "°", "x10": "× 10"}


def _untypeset(text: str) -> str:
    r"""A printed entry without the marks of typesetting that the text was read with.

    Examples
    --------
    >>> _untypeset(r"$81.67 \times 10^{-8} \text{ m}^2$"), _untypeset("76 x10 ⁻⁵ ohm-m")
    ('81.67 × 10⁻⁸ m²', '76 × 10⁻⁵ ohm-m')
    """
    for mark, sign in _SIGNS.items():
        text = text.replace(mark, sign)
    text = re.sub(r"\^\{?(-?\d|°)\}?", lambda m: m[1].translate(_RAISED), text)
    text = re.sub(r"[${}\\]|text|(?<=10) (?=⁻)", "", text)
    return re.sub(r"\s+", " ", text).replace("° C", "°C").strip()


def _parameters(found: ReproductionDocument) -> dict[str, Any]:
    entries = found.rows(3, 4, 5)
    told = [e for e in entries if e.status != IMPLIED]
    header = ("table", "condition", "branch", "A1 [cm]", "A2", "A3", "B1 [N]", "B2", "B3", "B1/A1 [N/cm]")
    return {
        "parameters": len(told),
        "inside": sum(_holds(e) for e in told),
        "parameter_table": pipes(
            (*header, "errata"), _pivot(entries, ("A1", "A2", "A3", "B1", "B2", "B3", "B1/A1"))
        ),
    }


def _holds(e: ReproducedEntry) -> bool:
    """Whether the interval holds the printed value."""
    if e.published is None or not isinstance(e.recomputed, IntervalDocument):
        return False
    low, _, high = e.recomputed.quantiles
    return low <= e.published <= high


def _statistics(found: ReproductionDocument) -> dict[str, Any]:
    entries = found.rows(6, 7, 8)
    known = [
        (e.published, e.recomputed.value)
        for e in entries
        if e.quantity == "spread" and e.published is not None and isinstance(e.recomputed, RecomputedValue)
    ]
    header = ("table", "condition", "branch", "SSE [N²/cm²]", "R²", "RMSE [N/cm]", "adjusted R²")
    quantities = ("sse", "r2", "rmse", "adj_r2", "spread")
    return {
        "spreads": len(known),
        "narrower": sum(printed < recomputed for printed, recomputed in known),
        "statistics_table": pipes((*header, "spread [N/cm]", "errata"), _pivot(entries, quantities)),
    }


def _extremes(found: ReproductionDocument) -> dict[str, Any]:
    header = ("table", "condition", "least T [°C]", "greatest T [°C]", "least K [N/m]", "greatest K [N/m]")
    quantities = ("temperature_min", "temperature_max", "stiffness_min", "stiffness_max")
    reached: dict[str, bool] = {}
    for d in found.distances:
        reached[d.condition] = reached.get(d.condition, False) or d.reaches_greatest
    unreached = [name for name, ever in reached.items() if not ever]
    return {
        "unreached": f"in {' and '.join(unreached)}" if unreached else "in no condition",
        "extreme_table": pipes((*header, "errata"), _pivot(found.rows(9, 10, 11, 12), quantities)),
    }


def _trend_table(effects: Mapping[str, Sequence[PrintedEffect]]) -> str:
    header = ("table", "setting", "quantity", "in these tests", "in general", "P(rises)", "varies along")
    return pipes(header, [_trend(n, e) for n, group in effects.items() for e in group])


def _setting(e: PrintedEffect) -> str:
    unit = unit_label(setting_unit(e.setting, specimen=False))
    return f"{e.setting.replace('_', ' ')}, {e.from_:.3g} to {e.to:.3g} {unit}".strip()


def _trend(number: str, e: PrintedEffect) -> tuple[str, ...]:
    sign, unit = ("× ", "") if e.factor else ("", f" {_unit(e.unit)}")
    tested = MISSING if e.tested is None else f"{sign}{write([e.tested], digits=3).plain[0]}{unit}"
    general = MISSING if e.beyond is None else f"{sign}{_interval(e.beyond)}{unit}"
    along = [f"{c.other.replace('_', ' ')} (r = {c.correlation:.2f})" for c in e.confounders if c.strong]
    return (
        number,
        _setting(e),
        e.feature.replace("_", " "),
        tested,
        general,
        probability(e.probability_rises),
        ", ".join(along),
    )
