"""A study of moduli on the screen: temperatures of every sweep, shifts, and what to doubt."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rich.table import Column, Table

from sma_bayes.errors import many
from sma_bayes.quantities import unit_text
from sma_bayes.report.notation import interval_text
from sma_bayes.report.screen import ENTRIES_SHOWN, numbers, screen, show_end, titled
from sma_bayes.runs.shown import in_declared_units
from sma_bayes.studies.modulus.schema import ModulusDocument, ModulusSweep


def show_modulus(told: Mapping[str, Any], out: Path) -> None:
    """Tell what was found of each sweep and of the shift with frequency."""
    found = in_declared_units(ModulusDocument.model_validate(told))
    console = screen()
    console.tell(f"{many(len(found.sweeps), 'sweep')}, seed {found.seed}")
    for branch in dict.fromkeys(s.branch for s in found.sweeps):
        console.print(_table(found, branch))
    for text in dict.fromkeys(s.statement for s in found.shifts if s.shift is not None):
        shifted = next(s.branch for s in found.shifts if s.statement == text)
        console.tell(f"{shifted}, {text}")
    if found.of_energies:
        console.tell(found.of_energies)
    for b in found.by_frequency:
        f = b.factor
        console.tell(
            f"{b.branch}, storage modulus at {b.at:.6g} {unit_text(found.temperature_unit)}: times "
            f"{interval_text(f.median, f.q05, f.q95)} per decade of frequency"
        )
    console.tell(
        *(
            f"{'SERIOUS: ' if severity == 'serious' else ''}{text}"
            for severity, text in found.doubts[:ENTRIES_SHOWN]
        )
    )
    console.tell(*(*found.declared_differently, *found.remarks, *(f"left out {t}" for t in found.left_out)))
    if not found.converged:
        console.tell("NOT CONVERGED: the numbers must not be relied on; another `--seed` may help.")
    show_end(console, told, out)


def _table(found: ModulusDocument, branch: str) -> Table:
    sweeps = [s for s in found.sweeps if s.branch == branch]
    names = list(dict.fromkeys(t.name for s in sweeps for t in s.temperatures if t.identified))
    title = f"{branch}, temperatures [{unit_text(found.temperature_unit)}]: median (90 %)"
    table = titled(title, Column("sweep", no_wrap=True), *(numbers(name.replace("_", " ")) for name in names))
    for s in sweeps[:ENTRIES_SHOWN]:
        table.add_row(s.id, *(_cell(s, name) for name in names))
    if len(sweeps) > ENTRIES_SHOWN:
        table.add_row(f"and {len(sweeps) - ENTRIES_SHOWN} more", *("" for _ in names))
    return table


def _cell(s: ModulusSweep, name: str) -> str:
    found = next((t for t in s.temperatures if t.name == name and t.identified), None)
    if found is None or found.median is None or found.q05 is None or found.q95 is None:
        return "–"
    return interval_text(found.median, found.q05, found.q95)
