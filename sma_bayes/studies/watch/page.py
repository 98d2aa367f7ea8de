"""The report of a watch in plain words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from sma_bayes.report.tables import Table
from sma_bayes.studies.watch.schema import StoredWatch, WatchDocument


def page_words(stored: StoredWatch, tables: Mapping[str, Table], figures: Sequence[str]) -> dict[str, Any]:
    """What the page of a watch names, besides what was found and its tables; `figures` are stems."""
    return {
        "command": command(stored.found),
    }


def command(found: WatchDocument) -> str:
    """The command that counts further cycles."""
    limits = "".join(f' --limit "{text}"' for text in dict.fromkeys(r.limit for r in found.limits))
    fixed = f"--out DIR --condition {found.condition} --alpha {found.alpha:g} --seed {found.seed}"
    return f'sma-bayes watch "{found.fit}" NEW.csv {fixed}{limits}'
