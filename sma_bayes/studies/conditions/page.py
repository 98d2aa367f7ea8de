"""The report of a study of conditions in plain words: what settings do, what was predicted, and what to doubt."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from sma_bayes.report.tables import Table
from sma_bayes.studies.conditions.schema import ConditionsDocument, StatedScore, StoredConditions
from sma_bayes.studies.conditions.tables import preferred_way, share_text


def page_words(
    stored: StoredConditions, tables: Mapping[str, Table], figures: Sequence[str]
) -> dict[str, Any]:
    """What the page of a study of conditions names, besides what was found and its tables; `figures` are stems."""
    return {
        "coverage": coverage(stored.found),
        "advised": preferred_way(stored.found),
        "share_text": share_text,
        "command": command(stored.found),
        "stems": {
            part: [s for s in figures if s.startswith(part)]
            for part in ("measured", "effects", "predicted", "held-out")
        },
    }


def coverage(found: ConditionsDocument) -> list[dict[str, Any]]:
    """Averages over what was left out, for each way to predict, extrapolations apart; stiffness not counted."""
    rows: dict[tuple[bool, str], list[tuple[float, StatedScore]]] = {}
    for h in found.held_out:
        for name, score in h.ways.items():
            if not h.on_log:
                rows.setdefault((bool(h.extrapolates), name), []).append((h.span, score))
    return [
        {
            "way": name,
            "where": "beyond the measured settings" if outside else "between measured settings",
            "count": len(parts),
            "covers": sum(s.covers_curve for _, s in parts) / len(parts),
            "width": sum(s.width / span for span, s in parts) / len(parts),
            "error": sum(s.error / span for span, s in parts) / len(parts),
        }
        for (outside, name), parts in sorted(rows.items(), key=lambda item: item[0][0])
    ]


def command(found: ConditionsDocument) -> str:
    """The command that gives the same study again."""
    options = found.options
    more = "".join(f' --at "{text}"' for text in options.at)
    more += "".join(f' --leave-out "{name}"' for name in options.leave_out)
    more += f" --model {options.model}" if options.model else ""
    fixed = f"--out DIR --seed {found.seed} --scatter {options.scatter:g}"
    return f'sma-bayes conditions "{found.source}" {fixed}{more}'
