"""The report of a gap study in plain words: the verdict first, what it means and what it does not."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from sma_bayes.report.html import select
from sma_bayes.report.tables import Table
from sma_bayes.response import AUTO_MODEL, DEFAULT_MODEL
from sma_bayes.studies.gap.outcome import HEATING
from sma_bayes.studies.gap.outputs import StoredStudy
from sma_bayes.studies.gap.schema import GapFindings, GapOfModel, StatedGap
from sma_bayes.studies.gap.words import (
    channel_text,
    covariate_text,
    jump_text,
    p_text,
    periodic_text,
    remainder_text,
    shape_text,
)


def page_words(study: StoredStudy, tables: Mapping[str, Table]) -> dict[str, Any]:
    """What the page of a gap study names, besides what was found and its tables."""
    found, priors = study.found, study.folder / "priors.toml"
    return {
        **_of_model(study, found),
        "p_text": p_text,
        "parameters": lambda name: _parameters(tables["effects"], name),
        "tested": _tested(tables["candidates"]),
        "heating": None if study.heating is None else _heating(study.heating, tables),
        "needs": by_single_need(tables["untestable"]),
        "command": command(found),
        "priors": priors.read_text(encoding="utf-8") if priors.is_file() else "",
    }


def _of_model(study: StoredStudy, found: GapOfModel) -> dict[str, Any]:
    """What it tells alike of the response and of the heat balance."""
    return {
        "effects": study.effects,
        "way": way_text(found.gap),
        "share": share_text(found.gap),
        "place": place_text(found),
        "remainder": remainder_text(found),
        "shape": shape_text(found),
        "folds": fold_texts(found.gap),
        "periodic": [periodic_text(found.channels, line) for line in found.periodic],
        "jumps": [jump_text(found.channels, jump) for jump in found.jumps],
    }


def _heating(study: StoredStudy, tables: Mapping[str, Table]) -> dict[str, Any]:
    """What the page tells of the heat balance."""
    return {
        **_of_model(study, study.part),
        "found": study.part,
        "parameters": {e.id: _parameters(tables[f"{HEATING}-effects"], e.id) for e in study.effects},
        "tested": _tested(tables[f"{HEATING}-candidates"]),
    }


def _tested(candidates: Table) -> Table:
    """The candidates that could be tested; those that could not have a table of their own."""
    at = [c.key for c in candidates.columns].index("status")
    rows = tuple(row for row in candidates.rows if row[at] != "untestable")
    return select(replace(candidates, rows=rows), drop=("title",))


def _parameters(effects: Table, name: str) -> Table:
    """Parameters of one effect; what tells of the sampling is left to the file."""
    table = select(
        effects,
        drop=("effect", "status", "class", "probability", "ln_bayes_factor", "rhat", "ess"),
        effect=name,
    )
    return replace(table, title=f"Parameters of {name}")


def way_text(gap: StatedGap) -> str:
    """Share of the way to the noise, as a percentage; a dash where there was no more than noise."""
    return f"{100.0 * gap.way_to_noise:.0f} %".replace("-", "−") if gap.before > 1.0 else "–"


def share_text(gap: StatedGap) -> str:
    """Closed share of what can be explained, as a percentage; a dash where there was nothing to explain."""
    if gap.before <= gap.floor:
        return "–"
    return f"{100.0 * gap.shrink:.0f} %".replace("-", "−")


def place_text(found: GapOfModel) -> str:
    """Channel and covariate in which the baseline disagrees most, by the flexible term that brings most."""
    if found.periodic:
        return periodic_text(found.channels, found.periodic[0])
    flexible = found.rounds[0].flexible
    if not flexible:
        return "no covariate"
    first = flexible[0]
    covariate = covariate_text(found.channels, first.covariate)
    return f"{channel_text(found.channels, first.channel)}, as a function of {covariate}"


def fold_texts(gap: StatedGap) -> list[str]:
    """How often which effects were chosen without a part of the measurements: ``2 of 3: stress_shift``."""
    chosen = Counter(tuple(c) for c in gap.chosen_without)
    total = sum(chosen.values())
    return [f"{n} of {total}: {', '.join(c) or 'nothing'}" for c, n in chosen.most_common()]


def by_single_need(untestable: Table) -> list[tuple[str, list[str]]]:
    """What to record, with the effects for which nothing else is lacking; the most fruitful first."""
    at = [c.key for c in untestable.columns].index("remedy")
    found: dict[str, list[str]] = {}
    for row in untestable.rows:
        advice = str(row[at])
        if "; " not in advice and not advice.startswith("nothing"):
            found.setdefault(advice, []).append(str(row[0]))
    return sorted(found.items(), key=lambda item: -len(item[1]))


def command(found: GapFindings) -> str:
    """The command that gives the same study again."""
    model = AUTO_MODEL if found.model_choice else found.model
    more = "" if model == DEFAULT_MODEL else f" --model {model}"
    more += "" if found.pool == "none" else f" --pool {found.pool}"
    return f'sma-bayes gap "{found.source}" --out DIR --seed {found.seed} --priors priors.toml{more}'
