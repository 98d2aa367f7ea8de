"""The report of a study of moduli: its figures, and what its page says in words."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

from sma_bayes.report.assembly import assemble
from sma_bayes.report.choice import CAMPAIGN_REPORT_ABOVE, REPORT, Drawn, ReportOptions
from sma_bayes.report.figures.sheet import Drawing
from sma_bayes.response import AUTO_MODEL
from sma_bayes.runs.documents import MODULUS
from sma_bayes.runs.finished_run import read_finished
from sma_bayes.runs.shown import in_declared_units
from sma_bayes.studies.modulus.figures.modulus import moduli_figure, shift_figure
from sma_bayes.studies.modulus.schema import ModulusDocument, StoredModulus
from sma_bayes.studies.modulus.tables import modulus_tables


def build_report(folder: Path, wanted: ReportOptions) -> None:
    """Write the report of a study of moduli; see `sma_bayes.report.choice.ReportBuilder`."""
    stored = read_finished(MODULUS, ModulusDocument, folder, in_declared_units)
    assemble(
        __package__,
        stored,
        wanted,
        _drawings(stored, wanted.drawn),
        modulus_tables,
        command=command(stored.found),
    )


def _drawings(stored: StoredModulus, drawn: Drawn) -> list[Callable[[StoredModulus], Drawing]]:
    tests = list(dict.fromkeys(s.test for s in stored.found.sweeps))
    if not (drawn == "all" or (drawn == REPORT and len(tests) <= CAMPAIGN_REPORT_ABOVE)):
        return []
    drawings: list[Callable[[StoredModulus], Drawing]] = [
        partial(moduli_figure, number=n) for n in range(1, len(tests) + 1)
    ]
    if any(s.shift is not None for s in stored.found.shifts):
        drawings.append(shift_figure)
    return drawings


def command(found: ModulusDocument) -> str:
    """The command that gives the same study again."""
    o = found.options
    files = " ".join(f'"{name}"' for name in found.source)
    more = "".join(f' --at "{t:g} degC"' for t in o.at)
    more += "".join(f' --column "{q}={name}"' for q, name in o.columns.items())
    more += "".join(f' --unit "{q}={unit}"' for q, unit in o.units.items())
    more += f' --frequency "{o.frequency}"' if o.frequency else ""
    more += f" --model {o.model}" if o.model != AUTO_MODEL else ""
    more += f" --loss-model {o.loss_model}" if o.loss_model != AUTO_MODEL else ""
    return f"sma-bayes modulus {files} --out DIR --seed {found.seed}{more}"
