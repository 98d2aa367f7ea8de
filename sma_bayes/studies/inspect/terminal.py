"""What was read of a campaign, on the screen."""

from __future__ import annotations

from typing import Any

from rich.table import Table

from sma_bayes.quantities import unit_text
from sma_bayes.report.screen import screen
from sma_bayes.studies.inspect.schema import InspectionDocument


def show_inspection(report: dict[str, Any]) -> None:
    """Tell what `inspect_campaign` found."""
    found = InspectionDocument.model_validate(report)
    console = screen()
    table = Table(title=found.campaign, title_justify="left")
    for name in ("record", "file", "samples", "cycles", "temperature", "channels", "held constant", "noise"):
        table.add_column(name)
    for r in found.records:
        t = r.temperature
        table.add_row(
            r.key,
            r.source,
            str(r.n) + (f" (means of up to {r.rows_averaged} rows)" if r.rows_averaged > 1 else ""),
            str(r.segments),
            f"{t.lowest:.4g} to {t.highest:.4g} {unit_text(t.unit)}",
            ", ".join(f"{c.name} [{unit_text(c.unit) or '1'}]" for c in r.channels.values()),
            ", ".join(f"{h.name} {h.mean:.4g} {unit_text(h.unit)}" for h in r.held.values()) or "-",
            f"{r.noise.name} (lag 1: {', '.join(f'{v:.2f}' for v in r.noise.lag1.values())})",
        )
    console.print(table)
    if found.findings:
        findings = Table(title="findings", title_justify="left")
        for name in ("kind", "where", "rows", "kept out", "what"):
            findings.add_column(name)
        for f in found.findings:
            rows = ", ".join(str(r) for r in f.rows[:5]) + (" ..." if f.count > 5 else "")
            where = " ".join(x for x in (f.condition, f.branch, f.column) if x)
            kind = f"SERIOUS: {f.kind}" if f.severity == "serious" else f.kind
            findings.add_row(kind, where, rows, str(f.dropped), f.message)
        console.print(findings)
