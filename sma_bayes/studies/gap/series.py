"""What a study says about every sample: measured, predicted before and after, and what each effect adds.

Figures and maps of residuals are drawn from these series, and anyone can draw others.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.fitting.curves import INTERVAL
from sma_bayes.records.types import Branch
from sma_bayes.studies.gap.fitting import added_by
from sma_bayes.studies.gap.study import GapStudy

DRAWS = 200
"""Draws from the posterior that give the band of what an effect adds."""
INPUTS = ("cycle", "segment", "temperature", "time", "rate", "current", "load", "ambient_temperature")
"""Inputs that are told beside each sample, where there are any."""


@dataclass(frozen=True, slots=True, eq=False)
class StackedSeries:
    """All channels of all histories, one after the other: N values each.

    Attributes
    ----------
    measured : ndarray, shape (N,)
        [unit of the channel].
    before, after : ndarray, shape (N,)
        Predictions at the mode of the model without effects, and of the final one.
    whitened_before, whitened_after : ndarray, shape (N,)
        Residuals as innovations of the noise of the final model, in its standard deviations.
    effects : mapping of str to mapping of str to ndarray, shape (N,)
        For each effect, quantiles over the posterior of what it adds, all else being equal.
    """

    measured: Floats
    before: Floats
    after: Floats
    whitened_before: Floats
    whitened_after: Floats
    effects: Mapping[str, Mapping[str, Floats]]


def series_of(study: GapStudy, draws: Floats) -> StackedSeries:
    """Series of a study.

    Parameters
    ----------
    study : GapStudy
    draws : ndarray, shape (S, P)
        Parameters of the final model.
    """
    first, final = study.baseline, study.final
    some = draws[:: max(1, len(draws) // DRAWS)]
    return StackedSeries(
        final.observed,
        final.observed - first.residual,
        final.observed - final.residual,
        final.whiten_residual(first.residual),
        final.whitened,
        {
            e.id: _quantiles(added_by(e, final.hypothesis, final.blocks, some))
            for e in final.hypothesis.effects
        },
    )  # fmt: skip


def _quantiles(draws: Floats) -> dict[str, Floats]:
    """Of each column of draws (S, N)."""
    return dict(zip(INTERVAL, np.nanquantile(draws, list(INTERVAL.values()), axis=0), strict=True))


def joined(parts: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Columns of several studies, one below the other; NaN where a study lacks one."""
    names = dict.fromkeys(name for part in parts for name in part)
    count = [len(part["condition"]) for part in parts]
    return {
        name: np.concatenate(
            [part.get(name, np.full(n, np.nan)) for part, n in zip(parts, count, strict=True)]
        )
        for name in names
    }


def series_columns(study: GapStudy, series: StackedSeries) -> dict[str, Any]:
    """The series as columns of equal length, with condition, branch, channel, source line and inputs beside them.

    An input that a condition does not have is NaN there; one that no condition has, has no column.
    """
    hypothesis = study.final.hypothesis
    blocks = study.final.blocks
    columns: dict[str, Any] = {"condition": [], "branch": [], "channel": [], "row": []}
    known = [n for n in INPUTS if any(n in h.inputs for h in hypothesis.histories)]
    inputs: dict[str, list[float]] = {n: [] for n in known}
    names = {1.0: Branch.HEATING.value, -1.0: Branch.COOLING.value}
    for block in blocks:
        history = hypothesis.histories[block.history]
        columns["condition"] += [history.condition.id] * history.n
        columns["branch"] += [names[b] for b in history.inputs["branch"].tolist()]
        columns["channel"] += [block.channel] * history.n
        columns["row"] += history.row.tolist()
        for name in known:
            inputs[name] += history.inputs.get(name, np.full(history.n, np.nan)).tolist()
    columns |= inputs
    for name in ("measured", "before", "after", "whitened_before", "whitened_after"):
        columns[name] = getattr(series, name)
    for effect, quantiles in series.effects.items():
        columns |= {f"{effect}_{q}": values for q, values in quantiles.items()}
    return columns
