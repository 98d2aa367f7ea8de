"""What was read of a campaign, on the screen."""

from __future__ import annotations

from typing import Any

from sma_bayes.quantities import unit_text
from sma_bayes.records.severity import SEVERITIES
from sma_bayes.records.types import Campaign
from sma_bayes.report.screen import screen, titled
from sma_bayes.runs.declared_units import shown_as, shown_units
from sma_bayes.studies.inspect.schema import InspectionDocument


def show_inspection(report: dict[str, Any], campaign: Campaign) -> None:
    """Tell what `inspect_campaign` found, in the units that the campaign declares."""
    found, units = InspectionDocument.model_validate(report), shown_units(campaign.records)
    console = screen()
    columns = ("record", "file", "samples", "cycles", "temperature", "channels", "held constant", "noise")
    table = titled(found.campaign, *columns)
    for r in found.records:
        t = r.temperature
        degrees = shown_as(t.unit, units)
        channels = {c.name: shown_as(c.unit, units, c.name) for c in r.channels.values()}
        held = {h.name: (h.mean, shown_as(h.unit, units, h.name)) for h in r.held.values()}
        table.add_row(
            r.key,
            r.source,
            str(r.n) + (f" (means of up to {r.rows_averaged} rows)" if r.rows_averaged > 1 else ""),
            str(r.segments),
            f"{degrees.value(t.lowest):.4g} to {degrees.value(t.highest):.4g} {unit_text(degrees.shown)}",
            ", ".join(f"{name} [{unit_text(u.shown) or '1'}]" for name, u in channels.items()),
            ", ".join(f"{name} {u.value(mean):.4g} {unit_text(u.shown)}" for name, (mean, u) in held.items())
            or "-",
            f"{r.noise.name} (lag 1: {', '.join(f'{v:.2f}' for v in r.noise.lag1.values())})",
        )
    console.print(table)
    names = {(r.condition, key): c.name for r in found.records for key, c in r.channels.items()}
    names |= {(r.condition, key): h.name for r in found.records for key, h in r.held.items()}
    if found.findings:
        findings = titled("findings", "kind", "where", "rows", "kept out", "what")
        for f in sorted(found.findings, key=lambda f: SEVERITIES.index(f.severity)):
            rows = ", ".join(str(r) for r in f.rows[:5]) + (" ..." if f.count > 5 else "")
            column = names.get((f.condition, f.column), f.column)
            where = " ".join(x for x in (f.condition, f.branch, column) if x)
            kind = f"SERIOUS: {f.kind}" if f.severity == "serious" else f.kind
            findings.add_row(kind, where, rows, str(f.dropped), f.message)
        console.print(findings)
