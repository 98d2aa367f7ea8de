"""The page: what the paper prints beside what comes out, as Markdown, from `paper.json` alone."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from typing import Any, Final

from jinja2 import Environment, PackageLoader, StrictUndefined

from sma_bayes.paper.tables import CellStatus
from sma_bayes.records.types import setting_unit
from sma_bayes.report.notation import MISSING, interval_text, unit_label, write
from sma_bayes.studies.compare.tables import SHORT
from sma_bayes.studies.paper.claims.types import FAILS, HOLDS, OPEN, SURE

TEMPLATE: Final = "page.md.j2"
ERRATA: Final = "reference/errata.md"
PICTURES: Final = "images/paper"
"""Folder of the pictures, beside the page."""
CLEAR: Final = 0.005
"""Probabilities nearer to 0 or 1 than this are not told apart from them."""
IMPLIED: Final = "implied"
"""Status of a number that follows from several printed ones."""

Found = Mapping[str, Any]


def page(found: Found) -> str:
    """The page of a finished reproduction.

    Parameters
    ----------
    found : mapping
        What `paper.json` holds.

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
    verdicts = [c["verdict"] for c in found["claims"]]
    words = {
        "sure": SURE,
        "holds": HOLDS,
        "fails": FAILS,
        "open": OPEN,
        "tested": sum(_error(c) is not None for c in found["claims"]),
        "before": _before(found),
        "count": {verdict: verdicts.count(verdict) for verdict in (HOLDS, FAILS, OPEN)},
        "probability": probability,
        "errata": errata_links,
        "figure": partial(_figure, found),
    }
    return environment.get_template(TEMPLATE).render(
        found=found,
        claim_table=_claim_table(found),
        correlation_table=_correlation_table(found),
        distance_table=_distance_table(found),
        model_table=_model_table(found),
        specification_table=_specification_table(found),
        trend_table=_trend_table(found),
        **words,
        **_comparison_words(found),
        **_parameters(found),
        **_statistics(found),
        **_extremes(found),
    )


# --- cells --------------------------------------------------------------------------------------------


def pipes(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table in Markdown."""
    lines = [header, ["---"] * len(header), *rows]
    return "".join("| " + " | ".join(c.replace("|", r"\|") for c in line) + " |\n" for line in lines)


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


def _figure(found: Found, stem: str) -> str:
    chosen = next(f for f in found["figures"] if f["stem"] == stem)
    return f"![{chosen['alt']}]({PICTURES}/{stem}.png)\n\n*{chosen['caption']}*\n"


def _unit(unit: str) -> str:
    """Unit for people; a difference of temperatures is told as a temperature."""
    return unit_label(unit.replace("delta_degC", "degC"))


def _interval(found: Found) -> str:
    """Median and interval; the median alone where rounding is all that makes a difference."""
    if found["q95"] - found["q05"] < 1e-9 * abs(found["median"]):
        return write([found["median"]], digits=5).plain[0]
    return interval_text(found["median"], found["q05"], found["q95"])


def _pivot(rows: Sequence[Found], quantities: Sequence[str]) -> list[list[str]]:
    """A line for each condition and branch, a column for each quantity, errata last."""
    by_place: dict[tuple[str, ...], dict[str, Found]] = {}
    for r in rows:
        by_place.setdefault((str(r["table"]), r["condition"], r["branch"]), {})[r["quantity"]] = r
    return [
        [
            *(word for word in place if word),
            *(_cell(cells.get(q)) for q in quantities),
            errata_links(list(dict.fromkeys(i for r in cells.values() for i in r["errata"].split()))),
        ]
        for place, cells in by_place.items()
    ]


def _cell(row: Found | None) -> str:
    """Printed value over recomputed."""
    if row is None:
        return MISSING
    lost = row["published"] is None
    doubted = not lost and row["status"] not in (CellStatus.OK, IMPLIED)
    printed = "lost" if lost else f"{row['printed']}{'†' if doubted else ''}"
    found = row["recomputed"]
    return printed if found is None else f"{printed}<br>{_value(found)}"


def _value(found: Found) -> str:
    return write([found["value"]]).plain[0] if "value" in found else _interval(found)


# --- tables -------------------------------------------------------------------------------------------


def _error(claim: Found) -> float | None:
    """Probability that the verdict which the evidence points to is wrong."""
    found = [e["probability"] for e in claim["evidence"] if e["counts"] and e["probability"] is not None]
    return min(1.0 - min(found), max(found)) if found else None


def _before(found: Found) -> str:
    """How many open claims would have a verdict if each were looked at alone, and what keeps them from it."""
    alone = [
        c for c in found["claims"]
        if c["verdict"] == OPEN and (error := _error(c)) is not None and error <= 1.0 - SURE
    ]  # fmt: skip
    if not alone:
        return ""
    unsure = sum((_error(c) or 0.0) > c["allowed_error"] for c in alone)
    confounded, lost = (sum(bool(c[key]) for c in alone) for key in ("confounded", "lost"))
    return (
        f"Looked at one by one, {len(alone)} more would be sure: {unsure} are not by Holm's rule, {confounded} speak "
        f"of a setting that can't be told from another one, {lost} of numbers that are lost."
    )


def _claim_table(found: Found) -> str:
    rows = [
        (
            f"[{c['claim']}](#{anchor(c['claim'])})",
            ", ".join(map(str, c["lines"])),
            f"**{c['verdict']}**",
            ", ".join(_probabilities(c)) or MISSING,
            errata_links(c["errata"]),
        )
        for c in found["claims"]
    ]
    return pipes(("claim", "lines", "verdict", "probability", "errata"), rows)


def _probabilities(claim: Found) -> list[str]:
    return [
        probability(e["probability"]) if e["counts"] else f"*twin {probability(e['probability'])}*"
        for e in claim["evidence"]
        if e["probability"] is not None
    ]


def _correlation_table(found: Found) -> str:
    rules = ("plain", "fisher", "pooled")
    rows = [
        (
            SHORT[name],
            part.replace("_", " "),
            *(_interval(m["r"][part][rule]) for rule in rules),
            probability(m["r"][part]["plain"]["above"]),
            _interval(m["r2"][part]["plain"]),
        )
        for name, m in found["comparison"]["models"].items()
        for part in ("in_sample", "held_out")
    ]
    header = ("model", "data", "plain mean of r", "Fisher mean", "pooled", "P(plain > 0.95)", "mean of R²")
    return pipes(header, rows)


def _distance_table(found: Found) -> str:
    rows = [
        (
            d["condition"],
            d["branch"],
            f"{d['least']:.3f} to {d['greatest']:.3f}",
            MISSING if d["rmse"] is None else f"{d['rmse']:.4f}",
            *(
                text
                for rival in ("logistic", "line")
                for text in (
                    f"{d[rival]:.4f}",
                    MISSING if d["rmse"] is None else f"{d[rival] / d['rmse']:.2f}",
                )
            ),
        )
        for d in found["distances"]
    ]
    header = ("condition", "branch", "stiffness", "RMSE", "to logistic", "ratio", "to line", "ratio")
    return pipes(header, rows)


def _model_table(found: Found) -> str:
    ranked = sorted(found["comparison"]["models"].items(), key=lambda item: -item[1]["ln_evidence"])
    rows = [
        (SHORT[name], f"{m['ln_evidence']:.0f}", f"{m['elpd_held_out']:.0f}", _behind(m["behind_preferred"]))
        for name, m in ranked
    ]
    header = ("model", "ln evidence", "held-out log density", "held out, behind the best (95 %)")
    return pipes(header, rows)


def _behind(d: Found) -> str:
    if not d["value"]:
        return MISSING
    return f"{d['value']:.0f} ({d['low']:.0f} to {d['high']:.0f})".replace("-", "−")


def _comparison_words(found: Found) -> dict[str, str]:
    c = found["comparison"]
    why = c["why"]
    for name in sorted(SHORT, key=len, reverse=True):
        why = why.replace(name, f"the {SHORT[name]}")
    by_reason: dict[str, list[str]] = {}
    for name, reason in c["unavailable"].items():
        by_reason.setdefault(reason, []).append(f"{SHORT[name]}")
    missing = [f"{' and '.join(names)} ({reason})" for reason, names in by_reason.items()]
    return {
        "why": why,
        "verdicts": ", ".join(f"{n} {v.replace('_', ' ')}" for v, n in c["verdicts"].items()),
        "unavailable": f"Not taking part: {', '.join(missing)}." if missing else "",
    }


def _specification_table(found: Found) -> str:
    rows = [
        (
            str(r["table"]),
            r["quantity"].replace("_", " "),
            _untypeset(r["printed"]),
            MISSING if r["recomputed"] is None else f"{_value(r['recomputed'])} {_unit(r['unit'])}",
            "" if r["status"] == CellStatus.OK else r["status"],
            errata_links(r["errata"]),
        )
        for n in ("1", "2")
        for r in found["tables"][n]
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


def _parameters(found: Found) -> dict[str, Any]:
    rows = [r for n in ("3", "4", "5") for r in found["tables"][n]]
    told = [r for r in rows if r["status"] != IMPLIED]
    header = ("table", "condition", "branch", "A1 [cm]", "A2", "A3", "B1 [N]", "B2", "B3", "B1/A1 [N/cm]")
    return {
        "parameters": len(told),
        "inside": sum(r["recomputed"]["q05"] <= r["published"] <= r["recomputed"]["q95"] for r in told),
        "parameter_table": pipes(
            (*header, "errata"), _pivot(rows, ("A1", "A2", "A3", "B1", "B2", "B3", "B1/A1"))
        ),
    }


def _statistics(found: Found) -> dict[str, Any]:
    rows = [r for n in ("6", "7", "8") for r in found["tables"][n]]
    known = [r for r in rows if r["quantity"] == "spread" and r["published"] is not None]
    header = ("table", "condition", "branch", "SSE [N²/cm²]", "R²", "RMSE [N/cm]", "adjusted R²")
    quantities = ("sse", "r2", "rmse", "adj_r2", "spread")
    return {
        "spreads": len(known),
        "narrower": sum(r["published"] < r["recomputed"]["value"] for r in known),
        "statistics_table": pipes((*header, "spread [N/cm]", "errata"), _pivot(rows, quantities)),
    }


def _extremes(found: Found) -> dict[str, Any]:
    rows = [r for n in ("9", "10", "11", "12") for r in found["tables"][n]]
    header = ("table", "condition", "least T [°C]", "greatest T [°C]", "least K [N/m]", "greatest K [N/m]")
    quantities = ("temperature_min", "temperature_max", "stiffness_min", "stiffness_max")
    reached: dict[str, bool] = {}
    for d in found["distances"]:
        reached[d["condition"]] = reached.get(d["condition"], False) or d["reaches_greatest"]
    short = [name for name, ever in reached.items() if not ever]
    return {
        "unreached": f"in {' and '.join(short)}" if short else "in no condition",
        "extreme_table": pipes((*header, "errata"), _pivot(rows, quantities)),
    }


def _trend_table(found: Found) -> str:
    header = ("table", "setting", "quantity", "in these tests", "in general", "P(rises)", "varies along")
    return pipes(header, [_trend(n, e) for n, group in found["printed_effects"].items() for e in group])


def _setting(e: Found) -> str:
    unit = unit_label(setting_unit(e["setting"], specimen=False))
    return f"{e['setting'].replace('_', ' ')}, {e['from']:.3g} to {e['to']:.3g} {unit}".strip()


def _trend(number: str, e: Found) -> tuple[str, ...]:
    sign, unit = ("× ", "") if e["factor"] else ("", f" {_unit(e['unit'])}")
    tested = MISSING if e["tested"] is None else f"{sign}{write([e['tested']], digits=3).plain[0]}{unit}"
    general = MISSING if e["beyond"] is None else f"{sign}{_interval(e['beyond'])}{unit}"
    along = [
        f"{c['other'].replace('_', ' ')} (r = {c['correlation']:.2f})"
        for c in e["confounders"]
        if c["strong"]
    ]
    return (
        number,
        _setting(e),
        e["feature"].replace("_", " "),
        tested,
        general,
        probability(e["probability_rises"]),
        ", ".join(along),
    )
