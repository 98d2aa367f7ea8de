"""The report of a study of conditions in plain words: what settings do, what was predicted, and what to doubt."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from sma_bayes.report.figures.sheet import FigureFiles
from sma_bayes.report.html import write_page
from sma_bayes.report.tables import Table
from sma_bayes.studies.conditions.outputs import StoredConditions
from sma_bayes.studies.conditions.schema import ConditionsDocument, StatedScore
from sma_bayes.studies.conditions.tables import preferred_way, share_text


def write_conditions_report(
    stored: StoredConditions, tables: Mapping[str, Table], figures: Mapping[str, FigureFiles]
) -> None:
    """Write ``report.html`` of a study of conditions.

    Parameters
    ----------
    stored : StoredConditions
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
        "sma_bayes.studies.conditions",
        figures,
        found=stored.found,
        coverage=coverage(stored.found),
        advised=preferred_way(stored.found),
        share_text=share_text,
        command=command(stored.found),
        tables=tables,
        stems={
            part: [s for s in figures if s.startswith(part)]
            for part in ("measured", "effects", "predicted", "held-out")
        },
    )


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
