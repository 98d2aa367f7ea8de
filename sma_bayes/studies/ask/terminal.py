"""The answers to a question on the screen."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rich.table import Table

from sma_bayes.quantities import QUANTITIES, unit_text
from sma_bayes.report.screen import screen
from sma_bayes.studies.ask.workflow import OVERALL


def show_values_at(found: Mapping[str, Any]) -> None:
    """What temperatures give: a table for each record, a row for each temperature."""
    console = screen()
    set_to = f", temperature set to within {_error_text(found)} (sd)" if found["temperature_sd"] else ""
    console.print(
        f"{found['campaign']}: median, and in brackets the interval that holds {found['probability']:g}{set_to}",
        soft_wrap=True,
    )
    for a in found["answers"]:
        console.print()
        console.print(_values_table(a))
        if any(a["extrapolated"]):
            told = all(v is not None for q in a["quantities"].values() for v in q["median"])
            remedy = "" if told else "; --extrapolate tells values there all the same"
            console.print(f"* {_range(a)}{remedy}", soft_wrap=True)
        if not a["converged"]:
            console.print("NOT CONVERGED: these numbers must not be relied on", soft_wrap=True)
        if not a["adequate"]:
            console.print("NOT ADEQUATE: curve and noise do not describe the data", soft_wrap=True)
        if a["caution"]:
            console.print(f"caution: {a['caution']}", soft_wrap=True)


def _range(a: Mapping[str, Any]) -> str:
    low, high = a["measured"]
    return f"measured from {low:.4g} to {high:.4g} {unit_text(a['temperature_unit'])}"


def _values_table(a: Mapping[str, Any]) -> Table:
    table = Table(title=f"{a['key']}, {_range(a)}", title_justify="left")
    table.add_column(f"T [{unit_text(a['temperature_unit'])}]", justify="right")
    shown = []
    for q in a["quantities"].values():
        symbol = QUANTITIES["stiffness" if q["name"] == OVERALL else q["name"]].symbol
        unit = unit_text(q["unit"]) or "1"
        name = q["name"].replace("_", " ")
        shown.append((q, ""))
        table.add_column(f"{name} {symbol} [{unit}]", justify="right")
        if any(v is not None for v in q["pred_median"]):
            shown.append((q, "pred_"))
            table.add_column(f"a reading of {symbol} [{unit}]", justify="right")
    for i, t in enumerate(a["temperature"]):
        mark = " *" if a["extrapolated"][i] else ""
        table.add_row(f"{t:.6g}{mark}", *(_value_text(q, prefix, i) for q, prefix in shown))
    return table


def _value_text(q: Mapping[str, Any], prefix: str, i: int) -> str:
    low, median, high = (q[prefix + name][i] for name in ("low", "median", "high"))
    if median is None:
        return "-"
    low, median, high = (f"{v:.4g}" for v in (low, median, high))
    return f"({low} to {high})" if prefix else f"{median} ({low} to {high})"


def answer_text(found: Mapping[str, Any]) -> str:
    """The answers in a few lines each, for a terminal."""
    level = found["probability"]
    lines = [
        f"{found['campaign']}: {found['quantity'].replace('_', ' ')} {found['value']}, tolerance {found['tolerance']}, "
        f"probability {level:g} or more"
        + (f", temperature set to within {_error_text(found)} (sd)" if found["temperature_sd"] else "")
    ]
    for a in found["answers"]:
        lines += ["", *_answer_lines(a, level)]
    if found["without"]:
        lines.append("")
    lines += [f"{key}: no answer, {why}" for key, why in found["without"].items()]
    return "\n".join(lines)


def _error_text(found: Mapping[str, Any]) -> str:
    units = dict.fromkeys(unit_text(a["temperature_unit"]) for a in found["answers"])
    return f"{found['temperature_sd']:g} {' or '.join(units)}"


def _answer_lines(a: Mapping[str, Any], level: float) -> list[str]:
    unit, degrees = unit_text(a["unit"]), unit_text(a["temperature_unit"])
    symbol = QUANTITIES["stiffness" if a["quantity"] == OVERALL else a["quantity"]].symbol
    low, high = a["measured"]
    lines = [f"{a['key']}, measured from {low:.4g} to {high:.4g} {degrees}"]
    if not a["converged"]:
        lines.append("  NOT CONVERGED: these numbers must not be relied on")
    wanted = f"{symbol} = {a['target']:.5g} {unit}".rstrip()
    lines.append(f"  {wanted} is reached there with probability {a['reachable']:.3f}{_unreached(a)}")
    lines += [
        f"    {p['direction']} at {p['median']:.5g} {degrees} ({p['low']:.5g} to {p['high']:.5g}), "
        f"with probability {p['probability']:.3f}{_mark(p)}"
        for p in a["passages"]
    ]
    least, most = a["bounds"]
    lines += [
        f"  {least:.4g} to {most:.4g} {unit}".rstrip() + f": {_stretches(a['within'], level, degrees)}",
        f"    {_most_surely(a['within']['best'], degrees)}",
        f"  at least {a['target']:.5g} {unit}".rstrip() + f": {_stretches(a['at_least'], level, degrees)}",
        f"  at most {a['target']:.5g} {unit}".rstrip() + f": {_stretches(a['at_most'], level, degrees)}",
        f"  the whole range is {a['least']['median']:.4g} to {a['greatest']['median']:.4g} {unit}".rstrip(),
    ]
    if a["caution"]:
        lines.append(f"  caution: {a['caution']}")
    return lines


def _unreached(a: Mapping[str, Any]) -> str:
    told = [
        f"stays {where} with probability {a[f'stays_{where}']:.3f}"
        for where in ("below", "above")
        if a[f"stays_{where}"] >= 0.005
    ]
    return f"; it {' and '.join(told)}" if told else ""


def _most_surely(best: Mapping[str, Any] | None, degrees: str) -> str:
    if best is None:
        return "at no temperature in any draw"
    place = f"most surely at {best['temperature']:.5g} {degrees}"
    return f"{place}, with probability {best['probability']:.3f}{_mark(best)}"


def _stretches(found: Mapping[str, Any], level: float, degrees: str) -> str:
    if not found["intervals"]:
        return f"nowhere with probability {level:g}"
    return " and ".join(
        f"{s['low']:.5g} to {s['high']:.5g} {degrees}{_mark(s)}" for s in found["intervals"]
    )  # fmt: skip


def _mark(part: Mapping[str, Any]) -> str:
    return " [extrapolated]" if part["extrapolated"] else ""
