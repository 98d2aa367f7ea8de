"""What a comparison says in `comparison.json` and in the series beside it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.assess.correlation import Agreement, factors, joined
from sma_bayes.assess.correlation_average import Scored, averages
from sma_bayes.runs.schema import CorrelationAverage, CorrelationFactors
from sma_bayes.sampling.pareto import MAX_RELIABLE_K
from sma_bayes.sampling.weighted import weighted_quantiles
from sma_bayes.studies.compare.comparison import Comparison, FittedContender
from sma_bayes.studies.compare.contenders import Contender, by_curve, curve_of
from sma_bayes.studies.compare.schema import (
    ComparedModel,
    ComparedRecord,
    EvidenceByMethod,
    FitsAnew,
    ModelFactors,
    Overall,
    OverallAverages,
    OverallModel,
    StatedDraws,
    StatedFolds,
    StatedParameter,
)
from sma_bayes.studies.compare.verdict import Standing, difference, judge

NUMBERS: Final = (
    "elpd", "elpd_se", "p_eff", "ln_evidence", "ln_evidence_sd", "weight", "rmse_held_out", "r_held_out",
    "pareto_k_max",
)  # fmt: skip
"""Numbers of a model; null where it could not take part."""


def record_document(comparison: Comparison) -> ComparedRecord:
    """A comparison on one record, as `comparison.json` has it."""
    record = comparison.record
    return ComparedRecord.about(
        comparison,
        condition=record.condition.id,
        branch=record.branch.value,
        key=stem_of(comparison),
        quantity=record.quantity(comparison.channel),
        unit=record.units[comparison.channel],
        temperature_unit=record.units["temperature"],
        n=record.n,
        noise=comparison.noise.name,
        discrepancy=comparison.has_discrepancy,
        held_out=StatedFolds(kind=comparison.folds.kind, folds=tuple(comparison.folds.labels)),
        **dict(comparison.verdict),
        same_curve=_classes(comparison),
        models={c.name: _model(comparison, c) for c in comparison.entrants if _takes_part(comparison, c)},
    )


def stem_of(comparison: Comparison) -> str:
    """Beginning of the names of the files of a comparison."""
    return f"{comparison.record.key}-{comparison.channel}"


def _takes_part(comparison: Comparison, contender: Contender) -> bool:
    return any(
        contender.name in named for named in (comparison.fitted, comparison.copies, comparison.unavailable)
    )


def _resolved(comparison: Comparison, contender: Contender) -> FittedContender | None:
    return comparison.fitted.get(comparison.copies.get(contender.name, contender.name))


def _classes(comparison: Comparison) -> tuple[tuple[str, ...], ...]:
    """Models that are the same curve, where there is more than one."""
    found = (
        c for c in comparison.entrants if _takes_part(comparison, c) and c.name not in comparison.unavailable
    )
    return tuple(names for names in by_curve(found, comparison.record) if len(names) > 1)


def _model(comparison: Comparison, contender: Contender) -> ComparedModel:
    name = contender.name
    head = {"same_as": comparison.copies.get(name), "unavailable": comparison.unavailable.get(name)}
    found = _resolved(comparison, contender)
    if found is None:
        nothing: dict[str, Any] = dict.fromkeys(NUMBERS)
        return ComparedModel.about(contender, **head, **nothing, converged=None)
    weight = comparison.weights[name] if name in comparison.fitted else 0.0
    extra: dict[str, Any] = (
        {"coefficients": 4, "rank": comparison.rank} if contender.family == "polynomial" else {}
    )
    return ComparedModel.about(contender, **head, weight=weight, **_numbers(comparison, found), **extra)


def _numbers(comparison: Comparison, found: FittedContender) -> dict[str, Any]:
    (y,) = comparison.record.observed.values()
    predicted = found.folds.median
    name, n, memory = found.contender.name, y.size, comparison.memory
    loo, out = found.loo, found.folds
    folds = comparison.fold_density(name)
    preferred = comparison.fold_density(comparison.verdict.preferred)
    return {
        "elpd": float(loo.log_density.sum()) / memory,
        "elpd_se": float(np.sqrt(n / memory) * loo.log_density.std(ddof=1)),
        "p_eff": float((found.in_sample - loo.log_density).sum()),
        "ln_evidence": found.evidence.value,
        "ln_evidence_sd": found.evidence.sd,
        "rmse_held_out": float(np.sqrt(np.mean((y - predicted) ** 2))),
        "r_held_out": correlation(y, predicted),
        "correlation": _correlation(found),
        "pareto_k_max": float(loo.k.max()),
        "pareto_k_above": int(np.sum(loo.k > MAX_RELIABLE_K)),
        "pareto_k_anew_max": float(np.max([*loo.k_anew, *out.k_anew])),
        "refits": FitsAnew(samples=loo.refits, folds=out.refits),
        "refits_not_converged": FitsAnew(samples=loo.not_converged, folds=out.not_converged),
        "evidence_by": EvidenceByMethod.about(found),
        "evidences_agree": found.evidences_agree,
        "elpd_held_out": float(folds.sum()),
        "elpd_by_fold": folds.tolist(),
        "behind_preferred": difference(folds, preferred),
        "draws": StatedDraws(
            method=found.draws.method, effective=found.draws.effective, pareto_k=found.draws.k
        ),
        "parameters": _parameters(found),
        "converged": found.converged,
    }


def _correlation(found: FittedContender) -> ModelFactors:
    """Posteriors of the correlation factors, in sample and held out, and of each fold by itself."""
    folds = tuple(_factors(f) for f in found.folds.agreements)
    medians = [f.r2.median for f in folds]
    return ModelFactors(
        in_sample=_factors(found.agreement),
        held_out=_factors(joined(found.folds.agreements)),
        by_fold=folds,
        folds_worse_than_their_mean=sum(m is not None and m < 0.0 for m in medians),
        folds_without_r=sum(f.r.undefined > 0.0 for f in folds),
    )


def _factors(found: Agreement) -> CorrelationFactors:
    return CorrelationFactors.model_validate(factors(found))


def correlation(y: Floats, predicted: Floats) -> float | None:
    """Pearson's r; None where one of the two does not vary."""
    if np.ptp(y) == 0.0 or np.ptp(predicted) <= 1e-12 * max(float(np.abs(predicted).max()), 1e-300):
        return None
    return float(np.corrcoef(y, predicted)[0, 1])


def _parameters(found: FittedContender) -> dict[str, StatedParameter]:
    theta = found.posterior.space.constrain(found.draws.z)
    low, median, high = weighted_quantiles(theta, found.draws.log_weight, (0.05, 0.5, 0.95))
    return {
        p.name: StatedParameter.about(p, fixed=p.fixed is not None, q05=low[i], median=median[i], q95=high[i])
        for i, p in enumerate(found.posterior.space.parameters)
    }


def overall(comparisons: Sequence[Comparison]) -> tuple[Overall, ...]:
    """Verdict over all records of a channel, each with parameters of its own: evidences and folds are added up.

    Returns
    -------
    tuple of Overall
        One for each channel and unit, with the models that could take part in all its records, copies left out.
    """
    groups: dict[tuple[str, str], list[Comparison]] = {}
    for c in comparisons:
        groups.setdefault((c.channel, c.record.units[c.channel]), []).append(c)
    return tuple(_overall(channel, unit, group) for (channel, unit), group in groups.items())


def _overall(channel: str, unit: str, group: Sequence[Comparison]) -> Overall:
    standings = [s for c in group[0].entrants if (s := _summed(c, group)) is not None]
    verdict = judge(standings)
    best = next(s for s in standings if s.name == verdict.preferred)
    return Overall(
        channel=channel,
        quantity=group[0].record.quantity(channel),
        unit=unit,
        records=tuple(stem_of(c) for c in group),
        **dict(verdict),
        models={
            s.name: OverallModel.about(
                s,
                elpd_held_out=float(s.folds.sum()),
                behind_preferred=difference(s.folds, best.folds),
                correlation_average=_averages(s.name, group),
            )
            for s in standings
        },
        verdicts=dict(Counter(c.verdict.verdict for c in group)),
    )


def _averages(name: str, group: Sequence[Comparison]) -> OverallAverages:
    """Averages of the correlation factors of one model over the records of a channel."""
    (contender,) = (c for c in group[0].entrants if c.name == name)
    found = [(c, f) for c in group if (f := _resolved(c, contender)) is not None]
    in_sample = averages([_scored(c, f, f.agreement) for c, f in found])
    held_out = averages([_scored(c, f, joined(f.folds.agreements)) for c, f in found])
    return OverallAverages(
        in_sample=tuple(CorrelationAverage(**average) for average in in_sample),
        held_out=tuple(CorrelationAverage(**average) for average in held_out),
    )


def _scored(comparison: Comparison, fitted: FittedContender, agreement: Agreement) -> Scored:
    record, channel = comparison.record, comparison.channel
    return Scored(
        record.key, record.branch.value, channel, record.quantity(channel), record.units[channel], record.key,
        fitted.converged, agreement,
    )  # fmt: skip


def _summed(contender: Contender, group: Sequence[Comparison]) -> Standing | None:
    found = [_resolved(c, contender) for c in group]
    fits = [f for f in found if f is not None]
    if len(fits) < len(found) or not any(contender.name in c.fitted for c in group):
        return None
    return Standing(
        contender.name,
        contender.family,
        " ".join(dict.fromkeys(curve_of(contender, c.record) for c in group)),
        contender.extra,
        sum(f.evidence.value for f in fits),
        float(np.sqrt(sum(f.evidence.sd**2 for f in fits))),
        np.concatenate([c.fold_density(f.contender.name) for c, f in zip(group, fits, strict=True)]),
    )


def curve_columns(comparison: Comparison) -> dict[str, Floats]:
    """Curves of all models on a grid of temperatures, as columns of a file."""
    columns = {f"temperature_{comparison.record.units['temperature']}": comparison.temperature}
    for name, found in comparison.fitted.items():
        columns |= {f"{name}_{level}": values for level, values in found.curve.items()}
    return columns


def sample_columns(comparison: Comparison) -> Mapping[str, Any]:
    """Every sample with what each model predicted of it when its fold was held out, as columns of a file."""
    record = comparison.record
    columns: dict[str, Any] = {
        "row": record.row,
        f"temperature_{record.units['temperature']}": record.temperature,
        "measured": record.observed[comparison.channel],
        "fold": comparison.folds.number,
    }
    for name, found in comparison.fitted.items():
        columns[f"{name}_held_out"] = found.folds.median
        columns[f"{name}_ln_density"] = found.folds.log_density
        columns[f"{name}_loo"] = found.loo.log_density
        columns[f"{name}_k"] = found.loo.k
    return columns
