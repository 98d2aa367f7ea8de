"""Everything that the page says, typed: `paper.json`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from sma_bayes.assess.correlation_average import Scored, averages
from sma_bayes.paper.correlation import implied_average
from sma_bayes.paper.extremes import EXTREME_TABLES
from sma_bayes.report.figures.sheet import FigureFiles
from sma_bayes.runs.schema import CorrelationAverage
from sma_bayes.studies.compare.schema import OverallModel, StoredComparison
from sma_bayes.studies.conditions.effects import SettingEffect
from sma_bayes.studies.identity import all_versions
from sma_bayes.studies.paper.claims import claims
from sma_bayes.studies.paper.claims.correlation import straight_line_correlation
from sma_bayes.studies.paper.distance import distances
from sma_bayes.studies.paper.export import SOURCE
from sma_bayes.studies.paper.printed import printed_effects
from sma_bayes.studies.paper.schema import (
    AveragedR,
    AveragedR2,
    JudgedClaim,
    ModelOfTwin,
    PageFigure,
    PrintedEffect,
    ReproducedEntry,
    ReproductionDocument,
    TwinComparison,
    VerdictOnRecord,
)
from sma_bayes.studies.paper.twin_study import TwinStudy


def reproduction_document(
    study: TwinStudy, tables: Mapping[str, Sequence[ReproducedEntry]], figures: Iterable[FigureFiles]
) -> ReproductionDocument:
    """What a study of the paper found.

    Parameters
    ----------
    study : TwinStudy
        Of all conditions of the twin.
    tables : mapping of str to sequence of ReproducedEntry
        As `table_entries` gives them.
    figures : iterable of FigureFiles
    """
    return ReproductionDocument.about(
        study,
        schema="sma-bayes/reproduction/1",
        paper=SOURCE,
        campaign=study.campaign.name,
        versions=all_versions(),
        data_sha256=study.campaign.sha256,
        claims=tuple(map(JudgedClaim.about, claims(study))),
        implied_correlation=implied_average(),
        straight_line_correlation=straight_line_correlation(study),
        correlation_average=_averages(study),
        comparison=_comparison(study.comparison),
        distances=distances(),
        printed_effects={
            str(t.number): tuple(_effect(e) for e in printed_effects(t).values()) for t in EXTREME_TABLES
        },
        tables={number: tuple(entries) for number, entries in tables.items()},
        figures=tuple(map(PageFigure.about, figures)),
    )


def _averages(study: TwinStudy) -> tuple[CorrelationAverage, ...]:
    scored = [
        Scored(
            r.key, r.branch.value, "stiffness", r.quantity("stiffness"), r.units["stiffness"], r.key,
            study.stiffness[r.key].converged, study.agreements[r.key],
        )
        for r in study.campaign.records
    ]  # fmt: skip
    return tuple(CorrelationAverage(**entry) for entry in averages(scored))


def _comparison(stored: StoredComparison) -> TwinComparison:
    found = stored.found
    (overall,) = found.overall
    return TwinComparison.about(
        overall,
        models={name: _model(m) for name, m in overall.models.items()},
        records=tuple(map(VerdictOnRecord.about, found.records)),
        unavailable={n: m.unavailable for n, m in found.records[0].models.items() if m.unavailable},
    )


def _model(m: OverallModel) -> ModelOfTwin:
    """A model with its averages over both branches, which stand last."""
    inside, outside = m.correlation_average.in_sample[-1], m.correlation_average.held_out[-1]
    return ModelOfTwin.about(
        m,
        r=AveragedR(in_sample=inside.r or {}, held_out=outside.r or {}),
        r2=AveragedR2(in_sample=inside.r2 or {}, held_out=outside.r2 or {}),
    )


def _effect(e: SettingEffect) -> PrintedEffect:
    return PrintedEffect.about(e, tested=None if e.tested is None else e.tested["median"])
