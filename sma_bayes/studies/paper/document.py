"""Everything that the page says, as plain numbers: `paper.json`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any, Final

from sma_bayes.assess.correlation_average import Scored, averages
from sma_bayes.paper.correlation import implied_average
from sma_bayes.paper.export import SOURCE
from sma_bayes.paper.extremes import EXTREME_TABLES
from sma_bayes.runs.store import plain
from sma_bayes.studies.compare.schema import ComparedModel, OverallAverages
from sma_bayes.studies.conditions.effects import SettingEffect
from sma_bayes.studies.identity import all_versions
from sma_bayes.studies.paper.claims import claims
from sma_bayes.studies.paper.claims.correlation import straight_line_correlation
from sma_bayes.studies.paper.distance import distances
from sma_bayes.studies.paper.printed import printed_effects
from sma_bayes.studies.paper.study import TwinStudy
from sma_bayes.studies.paper.tables import table_rows

SCHEMA: Final = "sma-bayes/reproduction/1"


def reproduction_document(study: TwinStudy) -> dict[str, Any]:
    """What a study of the paper found.

    Parameters
    ----------
    study : TwinStudy
        Of all conditions of the twin.
    """
    found: dict[str, Any] = plain({
        "schema": SCHEMA,
        "paper": SOURCE,
        "campaign": study.campaign.name,
        "seed": study.seed,
        "versions": all_versions(),
        "data_sha256": study.campaign.sha256,
        "converged": study.converged,
        "claims": [c.document() for c in claims(study)],
        "implied_correlation": asdict(implied_average()),
        "straight_line_correlation": straight_line_correlation(study),
        "correlation_average": _averages(study),
        "comparison": _comparison(study),
        "distances": [{**asdict(d), "reaches_greatest": d.reaches_greatest} for d in distances()],
        "printed_effects": {
            str(t.number): [_effect(e) for e in printed_effects(t).values()] for t in EXTREME_TABLES
        },
        "tables": table_rows(study),
    })  # fmt: skip
    return found


def _averages(study: TwinStudy) -> list[dict[str, Any]]:
    scored = [
        Scored(
            r.key, r.branch.value, "stiffness", r.quantity("stiffness"), r.units["stiffness"], r.key,
            study.stiffness[r.key].converged, study.agreements[r.key],
        )
        for r in study.campaign.records
    ]  # fmt: skip
    return averages(scored)


def _comparison(study: TwinStudy) -> dict[str, Any]:
    found = study.comparison.found
    (overall,) = found.overall
    return {
        "verdict": overall.verdict,
        "why": overall.why,
        "verdicts": overall.verdicts,
        "models": {
            name: {
                **m.model_dump(
                    mode="json",
                    include={"family", "ln_evidence", "ln_evidence_sd", "elpd_held_out", "behind_preferred"},
                ),
                "r": _of_both_branches(m.correlation_average, "r"),
                "r2": _of_both_branches(m.correlation_average, "r2"),
            }
            for name, m in overall.models.items()
        },
        "records": [
            {
                k: getattr(r, k)
                for k in ("condition", "branch", "verdict", "preferred", "rival", "ln_bayes_factor")
            }
            for r in found.records
        ],
        "unavailable": _unavailable(found.records[0].models),
    }


def _of_both_branches(averages: OverallAverages, factor: str) -> dict[str, Any]:
    """Averages of a factor over both branches, in sample and held out, as JSON."""
    stated = averages.as_json()
    return {part: entries[-1][factor] for part, entries in stated.items()}


def _unavailable(models: Mapping[str, ComparedModel]) -> dict[str, str]:
    return {name: m.unavailable for name, m in models.items() if m.unavailable}


def _effect(e: SettingEffect) -> dict[str, Any]:
    return {
        "feature": e.feature,
        "unit": e.unit,
        "setting": e.setting,
        "from": e.from_,
        "to": e.to,
        "factor": e.factor,
        "conditions": list(e.conditions),
        "tested": None if e.tested is None else e.tested["median"],
        "beyond": e.beyond,
        "probability_rises": e.probability_rises,
        "confounders": [asdict(c) | {"strong": c.strong} for c in e.confounders],
    }
