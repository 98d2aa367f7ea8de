"""The fits of the twin on which the recomputed side of the page rests."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from sma_bayes.arrays import Floats
from sma_bayes.assess.bands import Band, credible_band
from sma_bayes.assess.correlation import Agreement, agreement
from sma_bayes.assess.draws import record_draws
from sma_bayes.errors import MeasurementError
from sma_bayes.fitting.fit import Fit
from sma_bayes.paper.twin import twin_campaign
from sma_bayes.progress import Progress, silent
from sma_bayes.records.types import Campaign
from sma_bayes.runs.documents import COMPARISON
from sma_bayes.runs.finished_run import read_finished
from sma_bayes.studies.compare.schema import ComparisonDocument, StoredComparison
from sma_bayes.studies.compare.workflow import compare
from sma_bayes.studies.conditions.features import Feature, condition_features
from sma_bayes.studies.fit.workflow import fit

STIFFNESS = ("stiffness",)
PARTS = ("force", "displacement")


@dataclass(frozen=True, eq=False)
class TwinStudy:
    """Fits of the twin of the paper's campaign.

    Attributes
    ----------
    seed : int
    campaign : Campaign
        The twin, of stiffness: what the paper fitted.
    stiffness, parts : mapping of str to Fit
        Fits of the stiffness, and of force with displacement, by the key of the record.
    agreements : mapping of str to Agreement
        Of the stiffness fits with their data.
    bands : mapping of str to Band
        Of the stiffness.
    features : tuple of Feature
        Of each condition, from the stiffness fits.
    comparison : StoredComparison
        Of the models on the same stiffness; its folder is gone.
    compared_curves : mapping of str to mapping of str to ndarray
        Columns of the curves of the models, by the key of the record and channel.
    """

    seed: int
    campaign: Campaign
    stiffness: Mapping[str, Fit]
    parts: Mapping[str, Fit]
    agreements: Mapping[str, Agreement]
    bands: Mapping[str, Band]
    features: tuple[Feature, ...]
    comparison: StoredComparison
    compared_curves: Mapping[str, Mapping[str, Floats]]

    @property
    def converged(self) -> bool:
        """Whether every fit and every model of the comparison converged."""
        fits = (*self.stiffness.values(), *self.parts.values())
        return all(f.converged for f in fits) and self.comparison.found.converged


def study_twin(
    *,
    seed: int = 0,
    only: Sequence[str] = (),
    jobs: int | None = None,
    progress: Progress | None = None,
) -> TwinStudy:
    """Draw the twin and fit it.

    Parameters
    ----------
    seed : int
        Decides the twin's noise and every draw.
    only : sequence of str
        Ids of the conditions to study; all by default.
    jobs : int, optional
        Processes; by default one for each core.
    progress : callable, optional

    Raises
    ------
    MeasurementError
        If no condition is left.
    """
    tell = progress or silent
    tell(0, 3, "fitting the twin")
    campaign = _chosen(twin_campaign(seed, STIFFNESS), only)
    stiffness = fit(campaign, seed=seed, jobs=jobs)
    parts = fit(_chosen(twin_campaign(seed, PARTS), only), seed=seed, jobs=jobs)
    tell(1, 3, "comparing models on the twin")
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "comparison"
        compare(campaign, out, seed=seed, jobs=jobs, figures=False)
        comparison = read_finished(COMPARISON, ComparisonDocument, out)
        curves = {r.key: comparison.columns(f"curves/{r.key}.csv") for r in comparison.found.records}
    tell(2, 3, "summing up")
    return TwinStudy(
        seed=seed,
        campaign=campaign,
        stiffness=stiffness,
        parts=parts,
        agreements={key: _agreement(f) for key, f in stiffness.items()},
        bands={key: credible_band(f, "stiffness") for key, f in stiffness.items()},
        features=condition_features([record_draws(f) for f in stiffness.values()]),
        comparison=comparison,
        compared_curves=curves,
    )


def _chosen(campaign: Campaign, only: Sequence[str]) -> Campaign:
    records = tuple(r for r in campaign.records if not only or r.condition.id in only)
    if not records:
        known = ", ".join(dict.fromkeys(r.condition.id for r in campaign.records))
        raise MeasurementError(f"the twin has no condition {', '.join(only)}", expected=known)
    return replace(campaign, records=records)


def _agreement(found: Fit) -> Agreement:
    (record,) = found.records
    curve = found.posterior.predict(found.flat, record.inputs)["stiffness"]
    return agreement(record.observed["stiffness"], curve, found.warm_start.fit[0]["stiffness"].p)
