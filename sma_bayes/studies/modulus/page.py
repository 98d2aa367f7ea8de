"""The report of a study of moduli in plain words."""

from __future__ import annotations

from collections.abc import Mapping

from sma_bayes.report.figures.sheet import FigureFiles
from sma_bayes.report.html import write_page
from sma_bayes.report.tables import Table
from sma_bayes.response import AUTO_MODEL
from sma_bayes.studies.modulus.outputs import StoredModulus
from sma_bayes.studies.modulus.schema import ModulusDocument


def write_modulus_report(
    stored: StoredModulus, tables: Mapping[str, Table], figures: Mapping[str, FigureFiles]
) -> None:
    """Write ``report.html`` of a study of moduli.

    Parameters
    ----------
    stored : StoredModulus
    tables : mapping of str to Table
    figures : mapping of str to FigureFiles
        By stem; their PNG files are in ``figures/``.

    Raises
    ------
    OutputError
        If it can't be written, or a figure can't be read.
    """
    write_page(
        stored.folder,
        "sma_bayes.studies.modulus",
        figures,
        found=stored.found,
        command=command(stored.found),
        tables=tables,
        stems={part: [s for s in figures if s.startswith(part)] for part in ("moduli", "shift")},
    )


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
