"""A card on the screen: its constants with what is not identified, its tables, and what to doubt."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rich.table import Column, Table

from sma_bayes.quantities import unit_text
from sma_bayes.report.notation import interval_text
from sma_bayes.report.screen import ENTRIES_SHOWN, NOT_CONVERGED, numbers, screen, show_end, titled
from sma_bayes.runs.shown import in_declared_units
from sma_bayes.studies.card.schema import CardFindings, ConstitutiveCard, StiffnessTable


def show_card(found: dict[str, Any], out: Path | None) -> None:
    """Tell what `card.json` says."""
    stated = CardFindings.model_validate(found)
    document = in_declared_units(stated)
    console = screen()
    console.tell(f"{document.campaign}: {headline(document)}")
    if document.constitutive is not None:
        console.print()
        console.print(_constants(document.constitutive))
        for c in document.constitutive.constants:
            if c.why:
                console.tell(f"{c.name}: {c.why}")
    else:
        console.tell(f"no constitutive card: {document.no_constitutive}")
    console.print()
    if document.stiffness:
        console.print(_tables(document.stiffness))
        if document.stiffness != stated.stiffness:
            t = stated.stiffness[0]
            console.tell(
                f"its files are in {unit_text(t.unit)} and {unit_text(t.temperature_unit)}, as they say"
            )
    else:
        console.tell(f"no stiffness table: {document.no_stiffness}")
    console.tell(*document.declared_differently)
    console.tell(*(f"caution: {text}" for text in document.cautions))
    if not document.converged:
        console.tell(f"{NOT_CONVERGED}.")
    show_end(console, found, out)


def headline(document: CardFindings) -> str:
    """What is handed on, in a sentence."""
    parts = []
    if document.constitutive is not None:
        card = document.constitutive
        told = sum(c.identified for c in card.constants)
        stresses = ", ".join(f"{s:.4g}" for s in card.stresses)
        worst = max(card.sweeps, key=lambda s: s.card)
        parts.append(
            f"constitutive card from {len(card.sweeps)} sweeps at {stresses} MPa; the data tell {told} of "
            f"{len(card.constants)} constants; the law follows the curves to {worst.card:.1%} of their range or better "
            "(root mean square)"
        )
    if document.stiffness:
        worst_table = max(document.stiffness, key=lambda t: t.relative_error)
        parts.append(
            f"{len(document.stiffness)} stiffness tables, linear interpolation errs by at most "
            f"{worst_table.relative_error:.2g} of the stiffness"
        )
    return "; ".join(parts)


def _constants(card: ConstitutiveCard) -> Table:
    table = titled(
        f"constants; C_A and C_M at {card.reference_stress:.4g} MPa, strain zero at "
        f"{card.common_temperature:.4g} K",
        Column("constant", no_wrap=True),
        *map(numbers, ("in the card", "median, 90 % interval")),
        *("unit", "identified", "meaning"),
    )
    for c in (*card.constants, *card.at_reference):
        table.add_row(
            c.name,
            f"{c.value:.5g}",
            interval_text(c.median, c.q05, c.q95) if c.sd else "-",
            unit_text(c.unit),
            "yes" if c.identified else "no",
            c.meaning,
        )
    return table


def _tables(tables: tuple[StiffnessTable, ...]) -> Table:
    columns = ("condition", "branch", "quantity", "rows", "from", "to", "largest error of interpolation")
    shown = titled("stiffness tables", *columns)
    for t in tables[:ENTRIES_SHOWN]:
        degrees = unit_text(t.temperature_unit)
        shown.add_row(
            t.condition,
            t.branch,
            f"{t.quantity} [{unit_text(t.unit)}]",
            str(t.points),
            f"{t.first:.4g} {degrees}",
            f"{t.first + (t.points - 1) * t.step:.4g} {degrees}",
            f"{t.interpolation_error:.2g} {unit_text(t.unit)} ({t.relative_error:.2g} of it)",
        )
    return shown
