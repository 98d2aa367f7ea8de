"""The report of a study of moduli in plain words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from sma_bayes.report.tables import Table
from sma_bayes.response import AUTO_MODEL
from sma_bayes.studies.modulus.schema import ModulusDocument, StoredModulus


def page_words(stored: StoredModulus, tables: Mapping[str, Table], figures: Sequence[str]) -> dict[str, Any]:
    """What the page of a study of moduli names, besides what was found and its tables; `figures` are stems."""
    return {
        "command": command(stored.found),
        "stems": {part: [s for s in figures if s.startswith(part)] for part in ("moduli", "shift")},
    }


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
