"""What `comparison.json` holds."""

from __future__ import annotations

import math
from typing import Final, Literal

from pydantic import Field

from sma_bayes.document_part import InUnit, TemperatureUnit, UnitOfQuantity
from sma_bayes.runs.finished_run import FinishedRun
from sma_bayes.runs.schema import (
    CorrelationAverage,
    CorrelationFactors,
    DeclaredUnits,
    DocumentPart,
    FilesBeside,
    FindingDocument,
    IntervalDocument,
    Items,
    ModelChoiceDocument,
    Number,
    NumberOrNull,
    RunAccount,
    StudyFindings,
)


def _or(value: float | None, otherwise: float) -> float:
    return otherwise if value is None else value


class StatedDifference(DocumentPart):
    """Held-out log density of a model less that of the preferred one."""

    value: Number = Field(description="sum over the folds [1]")
    se: NumberOrNull = Field(description="its standard error, from their scatter; null with one fold")
    low: NumberOrNull = Field(description="lower end of its 95 % interval")
    high: NumberOrNull = Field(description="upper end")


class StatedVerdict(DocumentPart):
    """Which model is preferred, and whether that is more than chance."""

    preferred: str = Field(description="model of greatest evidence")
    verdict: str = Field(description="its family if the preference is decisive, else `cannot tell`")
    decisive: bool = Field(description="whether the preference is decisive")
    probability: NumberOrNull = Field(
        description="of that family, with equal odds for the best model of each family [1]"
    )
    rival: str = Field(description="best model of another family; empty where there is none")
    ln_bayes_factor: NumberOrNull = Field(description="of the preferred model over the rival [1]")
    not_told_from: Items[str] = Field(description="models that are not decisively lower")
    twins: Items[str] = Field(
        default=(),
        description="models of several families that are the preferred curve; the reason begins with them",
    )
    why: str = Field(description="the reason in words")
    why_alone: str = Field(default="", description="the same without `twins`")


class ModelFactors(DocumentPart):
    """Correlation factors of a model over draws of its curve."""

    in_sample: InUnit[CorrelationFactors] = Field(description="with the data to which it was fitted")
    held_out: InUnit[CorrelationFactors] = Field(description="with all folds, each predicted without itself")
    by_fold: InUnit[Items[CorrelationFactors]] = Field(description="with each fold by itself")
    folds_worse_than_their_mean: int = Field(description="folds whose median R² is negative")
    folds_without_r: int = Field(description="folds in which a draw leaves r undefined")


class FitsAnew(DocumentPart):
    """Fits that were made without a part of the data."""

    samples: int = Field(description="without a single sample")
    folds: int = Field(description="without a fold")


class StatedEvidence(DocumentPart):
    """A log evidence."""

    value: NumberOrNull = Field(
        description="log evidence; null where draws and proposal have nothing in common"
    )
    sd: NumberOrNull = Field(description="its Monte Carlo error")


class EvidenceByMethod(DocumentPart):
    """The log evidence by each method."""

    importance: StatedEvidence = Field(description="by importance sampling")
    bridge: StatedEvidence = Field(description="by bridge sampling")


class StatedDraws(DocumentPart):
    """The draws of a model."""

    method: str = Field(description="how they were made")
    effective: NumberOrNull = Field(description="effective number of draws")
    pareto_k: NumberOrNull = Field(description="Pareto k of their weights")


class StatedParameter(IntervalDocument):
    """A parameter of a model, in its unit."""

    unit: str = Field(description="its unit")
    meaning: str = Field(description="what it is")
    fixed: bool = Field(description="whether it is not estimated")


class ComparedModel(DocumentPart):
    """A model on a record; its numbers are null where it could not take part, and the rest is missing."""

    family: str = Field(description="family of models")
    variant: str = Field(description="`published`, `corrected`, `refitted` or empty")
    title: str = Field(description="the model in words")
    same_as: str | None = Field(description="model whose numbers these are, where it is the same curve")
    unavailable: str | None = Field(description="why there are no numbers")
    elpd: NumberOrNull = Field(
        description="log density of single samples left out, each counted as 1/`memory`: by weights of the draws "
        "(PSIS-LOO), or, where these can't be relied on, by a fit without the sample"
    )
    elpd_se: NumberOrNull = Field(description="its standard error")
    p_eff: NumberOrNull = Field(description="effective parameters")
    ln_evidence: NumberOrNull = Field(description="log evidence by the method of smaller error")
    ln_evidence_sd: NumberOrNull = Field(description="its Monte Carlo error")
    weight: NumberOrNull = Field(
        description="stacking weight, by held-out densities, shared evenly by models that are one curve; 0 for one "
        "with the numbers of another [1]"
    )
    rmse_held_out: InUnit[NumberOrNull] = Field(
        description="root mean square error of the median curve, predicted for held-out folds [`unit`]"
    )
    r_held_out: NumberOrNull = Field(description="Pearson's r of the same [1]")
    correlation: InUnit[ModelFactors | None] = Field(
        default=None, description="factors over draws of the curve"
    )
    pareto_k_max: NumberOrNull = Field(description="greatest Pareto k of single samples left out")
    pareto_k_above: int | None = Field(
        default=None, description="how many of them exceed 0.7, which were left out by fits without them"
    )
    pareto_k_anew_max: NumberOrNull = Field(
        default=None, description="greatest Pareto k of the draws of fits made anew"
    )
    refits: FitsAnew | None = Field(default=None, description="fits made anew")
    refits_not_converged: FitsAnew | None = Field(
        default=None, description="how many of them did not reach the target"
    )
    evidence_by: EvidenceByMethod | None = Field(default=None, description="log evidence by each method")
    evidences_agree: bool | None = Field(
        default=None, description="whether the two agree within their errors"
    )
    elpd_held_out: NumberOrNull = Field(default=None, description="log density of held-out folds")
    elpd_by_fold: Items[Number] | None = Field(default=None, description="the same of each fold")
    behind_preferred: StatedDifference | None = Field(
        default=None, description="the same less that of the preferred model"
    )
    draws: StatedDraws | None = Field(default=None, description="the draws of the model")
    parameters: dict[str, StatedParameter] | None = Field(default=None, description="its parameters, by name")
    converged: bool | None = Field(
        description="whether all reached the target, without what was held out too, and both evidences agree"
    )
    coefficients: int | None = Field(default=None, description="of Eq. (11): how many are printed")
    rank: int | None = Field(
        default=None, description="of Eq. (11): how many combinations of them the data determine"
    )


class StatedNoiseChoice(DocumentPart):
    """Why the noise is as it is."""

    reason: str = Field(description="one sentence")
    ln_evidence: dict[str, NumberOrNull] = Field(
        description="ln evidence by noise model, less that of the best [1]"
    )


class StatedFolds(DocumentPart):
    """What was held out."""

    kind: str = Field(description="`cycles`, `conditions` or `temperature blocks`")
    folds: Items[str] = Field(description="each in words")


class ComparedRecord(StatedVerdict):
    """A comparison on one record of one channel."""

    condition: str = Field(description="id of the condition; `all` with `--pool campaign`")
    branch: str = Field(description="`heating` or `cooling`")
    key: str = Field(description="`<condition>-<branch>-<channel>`, as files are named")
    channel: str = Field(description="stiffness where it was measured; else an entry for each channel")
    quantity: str = Field(description="what the channel is called")
    unit: UnitOfQuantity = Field(description="its unit")
    temperature_unit: TemperatureUnit = Field(description="unit of temperatures")
    n: int = Field(description="samples")
    noise: str = Field(description="noise model of all models")
    noise_choice: StatedNoiseChoice | None = Field(description="why, where it was chosen; else null")
    discrepancy: bool = Field(description="whether a discrepancy stands beside all models")
    memory: Number = Field(description="samples that count as one under `effective_samples`, else 1 [1]")
    held_out: StatedFolds = Field(description="what was held out")
    same_curve: Items[Items[str]] = Field(
        description="lists of models that are one curve under several names"
    )
    models: InUnit[dict[str, ComparedModel]] = Field(description="the models, by name")
    converged: bool = Field(description="whether every model converged")
    wall_s: Number = Field(description="time that it took [s]")

    @property
    def name(self) -> str:
        """What it is called for people."""
        return f"{self.condition}-{self.branch} {self.quantity}"


class OverallAverages(DocumentPart):
    """Averages of the correlation factors of a model, over each branch and over both."""

    in_sample: Items[CorrelationAverage] = Field(description="with the data to which it was fitted")
    held_out: Items[CorrelationAverage] = Field(description="with what was held out")


class OverallModel(DocumentPart):
    """A model over all records of a channel in which it could take part; copies are left out."""

    family: str = Field(description="family of models")
    ln_evidence: NumberOrNull = Field(description="sum of the log evidences")
    ln_evidence_sd: NumberOrNull = Field(description="its Monte Carlo error")
    elpd_held_out: NumberOrNull = Field(description="log density of all held-out folds")
    behind_preferred: StatedDifference = Field(description="the same less that of the preferred model")
    correlation_average: OverallAverages = Field(description="average correlation factors")


class Overall(StatedVerdict):
    """The verdict over all records of a channel, each with parameters of its own."""

    channel: str = Field(description="the channel")
    quantity: str = Field(description="what it is called")
    unit: UnitOfQuantity = Field(description="its unit")
    records: Items[str] = Field(description="keys of the records")
    models: dict[str, OverallModel] = Field(description="the models, by name")
    verdicts: dict[str, int] = Field(description="how many records had which verdict")

    def lead(self, name: str, family: str) -> float:
        """Log Bayes factor of a model over the best one of a family."""
        rival = next(m for _, m in self.ranked if m.family == family)
        return _or(self.models[name].ln_evidence, math.nan) - _or(rival.ln_evidence, math.nan)

    @property
    def ranked(self) -> list[tuple[str, OverallModel]]:
        """The models with their names, greatest evidence first; those without one last."""
        return sorted(self.models.items(), key=lambda item: -_or(item[1].ln_evidence, -math.inf))


class ComparisonOptions(DocumentPart):
    """With what models were compared."""

    model: str = Field(description="response model that takes part beside those of the paper, or `auto`")
    noise: str = Field(description="noise model of all, or `auto`")
    pool: str = Field(description="`none` or `campaign`")
    priors: str = Field(description="title of the priors")


class ComparisonFindings(StudyFindings, DeclaredUnits):
    """What a comparison found."""

    schema_: Literal["sma-bayes/comparison/1"] = Field(alias="schema", description="name and version")
    options: ComparisonOptions = Field(description="with what models were compared")
    model_choice: ModelChoiceDocument | None = Field(
        description="of `--model auto`: why the model; else null"
    )
    converged: bool = Field(description="whether every model converged on every record")
    overall: Items[Overall] = Field(description="one for each channel and unit")
    records: Items[ComparedRecord] = Field(description="one for each record and channel")
    findings: Items[FindingDocument] = Field(description="what was found about the measurements")

    def reason(self, record: ComparedRecord) -> str:
        """Why a record has its verdict; models that are one curve are counted where all records together name them."""
        told = any(g.twins == record.twins and g.quantity == record.quantity for g in self.overall)
        if not told or not record.why_alone:
            return record.why
        return f"one curve by {len(record.twins)} names, {record.why_alone}"


class ComparisonDocument(RunAccount, FilesBeside, ComparisonFindings):
    """What `comparison.json` holds."""


StoredComparison = FinishedRun[ComparisonDocument]
"""A finished comparison, as its folder holds it."""
DOCUMENTS: Final = {"compare": ComparisonDocument}
