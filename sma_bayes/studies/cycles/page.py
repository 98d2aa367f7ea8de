"""The report of a study of cycles in plain words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from sma_bayes.report.tables import Table
from sma_bayes.response import DEFAULT_MODEL
from sma_bayes.studies.cycles.schema import CyclesDocument, StoredCycles


def page_words(stored: StoredCycles, tables: Mapping[str, Table], figures: Sequence[str]) -> dict[str, Any]:
    """What the page of a study of cycles names, besides what was found and its tables; `figures` are stems."""
    return {
        "command": command(stored.found),
        "stems": {
            part: [s for s in figures if s.startswith(part)] for part in ("curves", "numbers", "values")
        },
    }


def command(found: CyclesDocument) -> str:
    """The command that gives the same study again."""
    o = found.options
    more = "".join(f' --at "{text}"' for text in o.at)
    more += f" --model {o.model}" if o.model != DEFAULT_MODEL else ""
    fixed = f"--share {o.share:g} --probability {o.probability:g} --ahead {o.ahead}"
    return f'sma-bayes cycles "{found.source}" --out DIR --seed {found.seed} {fixed}{more}'
