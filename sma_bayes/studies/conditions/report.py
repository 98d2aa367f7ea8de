"""The report of a study of conditions: its figures, and what its page says in words."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from sma_bayes.report.assembly import assemble
from sma_bayes.report.choice import Drawn, ReportOptions
from sma_bayes.report.figures.sheet import Drawing
from sma_bayes.runs.documents import CONDITIONS
from sma_bayes.runs.finished_run import read_finished
from sma_bayes.runs.shown import in_declared_units
from sma_bayes.studies.conditions.figures.conditions import (
    effects_figure,
    held_out_figure,
    measured_figure,
    predicted_figure,
)
from sma_bayes.studies.conditions.schema import ConditionsDocument, StatedScore, StoredConditions
from sma_bayes.studies.conditions.tables import conditions_tables, preferred_way, share_text


def build_report(folder: Path, wanted: ReportOptions) -> None:
    """Write the report of a study of conditions; see `sma_bayes.report.choice.ReportBuilder`."""
    stored = read_finished(CONDITIONS, ConditionsDocument, folder, in_declared_units)
    assemble(
        __package__,
        stored,
        wanted,
        _drawings(stored, wanted.drawn),
        conditions_tables,
        coverage=coverage(stored.found),
        advised=preferred_way(stored.found),
        share_text=share_text,
        command=command(stored.found),
    )


def _drawings(stored: StoredConditions, drawn: Drawn) -> list[Callable[[StoredConditions], Drawing]]:
    found = stored.found
    drawings: list[Callable[[StoredConditions], Drawing]] = []
    for number, group in enumerate(found.groups, 1):
        drawings.append(partial(measured_figure, number=number))
        told = {e.setting for e in found.effects if e.conditions == group.conditions and e.tested}
        drawings += [partial(effects_figure, number=number, setting=s) for s in group.varied if s in told]
    if drawn != "none":
        asked = dict.fromkeys(p.condition for p in found.predictions)
        drawings += [partial(predicted_figure, condition=c) for c in asked]
        left_out = dict.fromkeys(h.condition for h in found.held_out)
        drawings += [partial(held_out_figure, condition=c) for c in left_out]
    return drawings


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
