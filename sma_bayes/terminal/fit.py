"""A fit on the screen: a row a record, and what not to rely on."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rich.table import Table

from sma_bayes.errors import many
from sma_bayes.report.choice import MANY
from sma_bayes.terminal.screen import SHOWN, screen, show_end


def show_fit(summary: dict[str, Any], out: Path) -> None:
    """Tell what `summary.json` says."""
    table = Table(title=f"{summary['campaign']}, seed {summary['seed']}", title_justify="left")
    for name in ("record", "n", "noise", "converged", "worst R-hat", "least ESS", "r", "not identified"):
        table.add_column(
            name, justify="left" if name in ("record", "noise", "not identified", "r") else "right"
        )
    for r in _worth_a_row(summary["records"]):
        sampled = [p for p in r["parameters"].values() if p["rhat"] is not None]
        prior_driven = [n for n, p in r["parameters"].items() if not p["identified"] and not p["fixed"]]
        factors = ", ".join(
            f"{r['quantities'][c]['name']} {f['r']['median']:.4f}" for c, f in r["correlation"].items()
        )
        table.add_row(
            r["key"],
            str(r["n"]),
            r["noise"]["name"],
            "yes" if r["converged"] else "NO",
            f"{max((p['rhat'] for p in sampled), default=float('nan')):.4f}",
            f"{min((min(p['ess_bulk'], p['ess_tail']) for p in sampled), default=float('nan')):.0f}",
            factors,
            ", ".join(prior_driven) or "-",
        )
    console = screen()
    console.print(table)
    if len(summary["records"]) > table.row_count:
        converged = sum(r["converged"] for r in summary["records"])
        console.print(
            f"{len(summary['records'])} records, {converged} converged; above are the worst by R-hat"
        )
    alone = [f for f in summary["findings"] if f["kind"] == "one-branch"]
    for finding in alone[:SHOWN]:
        console.print(f"{finding['condition']}: {finding['message']}", soft_wrap=True)
    dropped = sum(f["dropped"] for f in summary["findings"])
    if summary["findings"]:
        findings, rows = many(len(summary["findings"]), "finding"), many(dropped, "row")
        console.print(f"{findings} about the data, {rows} kept out: see the report or `sma-bayes inspect`")
    if not summary["converged"]:
        names = [r["key"] for r in summary["records"] if not r["converged"]]
        more = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
        console.print(
            f"NOT CONVERGED: {', '.join(names[:SHOWN])}{more}. Their numbers must not be relied on."
        )
    show_end(console, summary, out)


def _worth_a_row(records: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """All records, or of very many those that converged worst."""

    def worst_rhat(r: dict[str, Any]) -> float:
        return max((p["rhat"] or 0.0 for p in r["parameters"].values()), default=0.0)

    if len(records) <= MANY:
        return records
    return sorted(records, key=lambda r: (r["converged"], -worst_rhat(r)))[:SHOWN]
