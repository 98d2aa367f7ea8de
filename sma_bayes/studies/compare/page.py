"""The report of a comparison of models in plain words: who wins, by how much, and what that rests on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from sma_bayes.report.content import PAPER_CORRELATION
from sma_bayes.report.tables import Table
from sma_bayes.response import DEFAULT_MODEL
from sma_bayes.studies.compare.schema import ComparisonDocument, Overall, StoredComparison
from sma_bayes.studies.compare.tables import short
from sma_bayes.studies.compare.verdict import CANNOT_TELL


def page_words(
    stored: StoredComparison, tables: Mapping[str, Table], figures: Sequence[str]
) -> dict[str, Any]:
    """What the page of a comparison names, besides what was found and its tables; `figures` are stems."""
    return {
        "headlines": [headline(group) for group in stored.found.overall],
        "command": command(stored.found),
        "held_out": [s for s in figures if s.startswith("held-out")],
        "paper_correlation": PAPER_CORRELATION,
    }


def headline(group: Overall) -> str:
    """The verdict over all records of a channel, as a sentence."""
    counts = ", ".join(f"{n} {name}" for name, n in group.verdicts.items())
    if group.verdict == CANNOT_TELL:
        outcome = f"the data do not tell: {group.why}"
    else:
        outcome = f"the {group.verdict.replace('_', ' ')} wins ({short(group.preferred)}): {group.why}"
    count = len(group.records)
    together = f"{count} records together" if count > 1 else "one record"
    return f"{group.quantity}, {together}: {outcome}. Record by record: {counts}."


def command(found: ComparisonDocument) -> str:
    """The command that gives the same comparison again."""
    options = found.options
    more = "".join(
        f" --{name} {value}"
        for name, value, usual in (
            ("model", options.model, DEFAULT_MODEL),
            ("noise", options.noise, "auto"),
            ("pool", options.pool, "none"),
        )
        if value != usual
    )
    return f'sma-bayes compare "{found.source}" --out DIR --seed {found.seed} --priors priors.toml{more}'
