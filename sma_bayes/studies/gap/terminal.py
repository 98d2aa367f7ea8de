"""A gap study on the screen: the verdict, where, what, and by how much the gap closed."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

from rich.console import Console
from rich.table import Table

from sma_bayes.quantities import unit_text
from sma_bayes.report.screen import screen, show_end
from sma_bayes.studies.gap.words import (
    channel_text,
    closed_text,
    covariate_text,
    p_text,
    periodic_text,
    remainder_text,
)

VERDICTS: Final = {
    "named": "NAMED: the model misses something, and the catalogue has a name for it",
    "unnamed": "UNNAMED: the model misses something, and nothing in the catalogue accounts for it",
    "none": "NONE: no disagreement beyond what chance explains",
}


def show_gap(found: dict[str, Any], out: Path) -> None:
    """Tell what `gap.json` says."""
    console = screen()
    _show_part(console, found, str(found["campaign"]))
    if found["heating"]:
        _show_part(console, found["heating"], f"{found['campaign']}, heating (temperature from current)")
        console.print(f"heat balance: {_numbers(found['heating']['parameters'])}", soft_wrap=True)
    for text in found["remarks"]:
        console.print(f"note: {text}", soft_wrap=True)
    if not found["converged"]:
        console.print(
            "NOT CONVERGED: draws and intervals must not be relied on; the verdict does not come from them.",
            soft_wrap=True,
        )
    show_end(console, found, out)


def _show_part(console: Console, found: dict[str, Any], title: str) -> None:
    """The response, or the heat balance."""
    chance = p_text(found["p_value"])
    verdict = VERDICTS[found["verdict"]]
    if found["verdict"] == "named" and remainder_text(found):
        verdict = f"{verdict}, {remainder_text(found)}"
    console.print(f"{title}: {verdict} ({chance})", soft_wrap=True)
    if choice := found.get("model_choice"):
        console.print(f"  model {choice['reason']}", soft_wrap=True)
    for line in found["periodic"][:3]:
        console.print(f"  {periodic_text(found, line)} ({line['size_sigma']:.1f} sigma)", soft_wrap=True)
    for d in found["disagreement"][:3]:
        console.print(
            f"  {d['condition']} {d['branch']}: {channel_text(found, d['channel'])} "
            f"{'above' if d['mean_residual'] > 0.0 else 'below'} the model, {covariate_text(found, d['covariate'])} "
            f"{d['from']:.4g} to {d['to']:.4g} {unit_text(d['unit'])} ({abs(d['size_sigma']):.1f} sigma)",
            soft_wrap=True,
        )
    for e in (*found["effects"], *found["partial"]):
        console.print(_effect_text(e, partial=found["verdict"] != "named"), soft_wrap=True)
    if found["verdict"] == "none":
        factors = [c["ln_bayes_factor"] for c in found["candidates"] if c["ln_bayes_factor"] is not None]
        if factors:
            console.print(f"no candidate stands out; the greatest ln Bayes factor is {max(factors):.1f}")
    else:
        console.print(_candidate_rows(found["candidates"]))
    untested = [c["id"] for c in found["candidates"] if c["status"] == "untestable"]
    if untested:
        console.print(f"these data cannot test {', '.join(untested)}; the report says why", soft_wrap=True)
    added = bool(found["effects"] or found["partial"])
    console.print(_gap_text(found, added=added), soft_wrap=True)
    for text in found["cautions"]:
        console.print(f"caution: {text}", soft_wrap=True)


def _effect_text(e: dict[str, Any], *, partial: bool) -> str:
    lines = [f"{'helps: ' if partial else ''}{e['id']} ({e['title']}): {_numbers(e['parameters'])}"]
    others = [name for name in e["class"] if name != e["id"]]
    if others:
        lines.append(f"  these data cannot tell it from {', '.join(others)}")
    if e["next_experiment"]:
        lines.append(f"  what would: {e['next_experiment']}")
    return "\n".join(lines)


def _numbers(parameters: dict[str, Any]) -> str:
    """Parameters with their medians and 90 % intervals."""
    return ", ".join(
        f"{name} {p['median']:.4g} ({p['q05']:.4g} to {p['q95']:.4g}) {unit_text(p['unit'])}".rstrip()
        for name, p in parameters.items()
    )


def _candidate_rows(candidates: list[dict[str, Any]]) -> Table:
    tested = [c for c in candidates if c["status"] != "untestable"]
    scored = any(c["delta_elpd_held_out"] is not None for c in tested)
    table = Table(title="candidates that could be tested", title_justify="left")
    table.add_column("effect", no_wrap=True)
    table.add_column("ln BF", justify="right", no_wrap=True)
    if scored:
        table.add_column("held-out score", justify="right")
    table.add_column("status", no_wrap=True)
    table.add_column("why")
    for c in tested:
        factor, score = c["ln_bayes_factor"], c["delta_elpd_held_out"]
        told = "-" if score is None else f"{score:.1f} +- {c['delta_elpd_se']:.1f}"
        cells = [c["id"], "-" if factor is None else f"{factor:.1f}", told, c["status"], c["why"]]
        table.add_row(*(cells if scored else cells[:2] + cells[3:]))
    return table


def _gap_text(found: dict[str, Any], *, added: bool) -> str:
    gap = found["gap"]
    start = f"held-out gap ({gap['held_out']}; 1 is noise alone)"
    if not added:
        return f"{start}: {gap['before']:.3f}; nothing was added"
    explainable = (
        f"{100.0 * gap['shrink']:.0f} % of what can be explained (floor {gap['floor']:.3f})"
        if gap["before"] > gap["floor"]
        else "nothing to explain"
    )
    return f"{start}: {closed_text(found)}; {explainable}"
