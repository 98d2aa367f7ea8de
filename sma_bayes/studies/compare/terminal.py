"""A comparison of models on the screen: who wins where."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from sma_bayes.errors import many, nats
from sma_bayes.report.screen import show_text
from sma_bayes.studies.compare.schema import ComparisonDocument
from sma_bayes.studies.compare.verdict import CANNOT_TELL
from sma_bayes.studies.compare.words import spoken


def show_comparison(found: dict[str, Any], out: Path) -> None:
    """Tell what `comparison.json` says."""
    show_text(comparison_text(found), found, out)


def comparison_text(found: dict[str, Any]) -> str:
    """What `comparison.json` says, in a few lines."""
    document = ComparisonDocument.model_validate(found)
    lines = [f"{document.campaign}, seed {document.seed}"]
    if document.model_choice is not None:
        lines.append(f"  model {document.model_choice.reason}")
    width = max(len(r.name) for r in document.records)
    for r in document.records:
        factor = r.ln_bayes_factor
        beaten = "" if factor is None else f", ln Bayes factor {nats(factor)} over the {spoken(r.rival)}"
        rival = beaten if r.rival else ""
        outcome = document.reason(r) if r.verdict == CANNOT_TELL else f"the {spoken(r.preferred)}{rival}"
        lines.append(f"  {r.name:<{width}}  {spoken(r.verdict):<16}  {outcome}")
    for group in document.overall:
        counted = f"{group.quantity}, {many(len(group.records), 'record')} together"
        lines.append(f"{counted}: {spoken(group.verdict).upper()}. {group.why}")
    lines += [f"remark: {text}" for text in document.declared_differently]
    if not document.converged:
        failed = ", ".join(r.name for r in document.records if not r.converged)
        lines.append(f"NOT CONVERGED: {failed}. The report says which models.")
    return "\n".join(lines)
