"""What `paper --format json` prints, and what `paper --page` writes as `paper.json`."""

from __future__ import annotations

from typing import Final, Literal

from pydantic import Field

from sma_bayes.paper.correlation import ImpliedAverage, ImpliedCorrelationRow
from sma_bayes.runs.schema import (
    AverageR,
    CorrelationAverage,
    DocumentPart,
    Factor,
    IntervalDocument,
    Items,
    Number,
    NumberOrNull,
)
from sma_bayes.studies.compare.schema import StatedDifference
from sma_bayes.studies.conditions.design import Confounder
from sma_bayes.studies.paper.claims.claim import FAILS, HOLDS, OPEN, EvidenceForClaim
from sma_bayes.studies.paper.distance import PublishedDistance


class PrintedEntry(DocumentPart):
    """A number as it is printed, and whether it can be believed."""

    table: int = Field(description="number of the table; 0 is the running text")
    line: int | None = Field(description="of the source text; null where the number follows from several")
    condition: str = Field(description="id of the condition; empty where there is none")
    branch: str = Field(description="`heating` or `cooling`; empty where there is none")
    quantity: str = Field(description="what it is called")
    unit: str = Field(description="its unit")
    printed: str = Field(description="as it is printed")
    published: NumberOrNull = Field(
        description="the printed number; null where something else is printed in its place [`unit`]"
    )
    status: str = Field(
        description="`ok`, `reconstructed`, `implausible`, `damaged`; or `implied`, where it follows from several"
    )
    corrected: NumberOrNull = Field(description="what other cells say that it should have been [`unit`]")
    reason: str = Field(description="why it is doubted; empty where it is not")
    errata: str = Field(description="ids of the errata that touch it, with blanks between")


class PrintedTableDocument(DocumentPart):
    """A printed table."""

    number: int = Field(description="its number; 0 is the running text")
    title: str = Field(description="its title")
    cells: Items[PrintedEntry] = Field(description="its cells, in the order in which they are printed")


class ImpliedCorrelations(DocumentPart):
    """What the printed R² imply for the correlation factor."""

    columns: Items[ImpliedCorrelationRow] = Field(description="each column of the tables that were asked for")
    average: ImpliedAverage = Field(description="all columns together")


class RecomputedAmount(DocumentPart):
    """A number that was recomputed."""

    what: str = Field(description="what it is")
    value: Number = Field(description="the number [`unit`]")
    unit: str = Field(description="its unit")
    claimed: str | None = Field(description="what the list of errata states; null where it states none")
    agrees: bool | None = Field(description="whether the number rounds to it; null where there is none")


class ErratumEntry(DocumentPart):
    """Something that can't be taken as printed."""

    id: str = Field(description="`E..` of the list that goes with the text; `N..` found beyond it")
    lines: Items[int] = Field(description="of the source text")
    tables: Items[int] = Field(description="tables that it touches")
    confidence: str = Field(description="`certain`, `likely` or `possible`")
    printed: str = Field(description="what is printed")
    problem: str = Field(description="what is wrong with it")
    correction: str = Field(description="what to use instead")
    cells: Items[str] = Field(description="addresses of the cells that it casts doubt on")
    effect: Items[RecomputedAmount] = Field(description="what it amounts to; empty for a note")


class PaperTablesDocument(DocumentPart):
    """What `sma-bayes paper --format json` prints."""

    schema_: Literal["sma-bayes/paper/1"] = Field(alias="schema", description="name and version")
    source: str = Field(description="the paper")
    tables: Items[PrintedTableDocument] = Field(description="the tables that were asked for")
    implied_correlation: ImpliedCorrelations = Field(description="what the printed R² imply")
    errata: Items[ErratumEntry] = Field(description="the errata that touch them")


class JudgedClaim(DocumentPart):
    """A claim of the paper, and what is left of it."""

    id: str = Field(description="its name")
    claim: str = Field(description="the claim")
    lines: Items[int] = Field(description="of the source text")
    verdict: str = Field(description=f"`{HOLDS}`, `{FAILS}` or `{OPEN}`")
    why: str = Field(description="what the verdict means, and what to doubt")
    errata: Items[str] = Field(description="ids of the errata that concern it")
    confounded: Items[str] = Field(description="settings from which the one of the claim can't be told")
    lost: str = Field(description="numbers of which it speaks and which are lost; empty for none")
    allowed_error: Number = Field(
        description="error that its verdict may have, by Holm's rule over all claims [1]"
    )
    evidence: Items[EvidenceForClaim] = Field(description="what speaks for or against it")

    @property
    def error(self) -> float | None:
        """Probability that the verdict which the evidence points to is wrong; None without a probability [1]."""
        found = [e.probability for e in self.evidence if e.counts and e.probability is not None]
        return min(1.0 - min(found), max(found)) if found else None


class AveragedR(DocumentPart):
    """Averages of r over all records, by rule: `plain`, `fisher`, `pooled` [1]."""

    in_sample: dict[str, AverageR] = Field(description="with the data to which the model was fitted")
    held_out: dict[str, AverageR] = Field(description="with what was held out")


class AveragedR2(DocumentPart):
    """Averages of R² over all records, by rule: `plain`, `pooled` [1]."""

    in_sample: dict[str, Factor] = Field(description="with the data to which the model was fitted")
    held_out: dict[str, Factor] = Field(description="with what was held out")


class ModelOfTwin(DocumentPart):
    """A model over all records of the twin."""

    family: str = Field(description="family of models")
    ln_evidence: NumberOrNull = Field(description="sum of the log evidences")
    ln_evidence_sd: NumberOrNull = Field(description="its Monte Carlo error")
    elpd_held_out: NumberOrNull = Field(description="log density of all held-out folds")
    behind_preferred: StatedDifference = Field(description="the same less that of the preferred model")
    r: AveragedR = Field(description="averages of r")
    r2: AveragedR2 = Field(description="averages of R²")


class VerdictOnRecord(DocumentPart):
    """The verdict on one record of the twin."""

    condition: str = Field(description="id of the condition")
    branch: str = Field(description="`heating` or `cooling`")
    verdict: str = Field(description="family of the preferred model if that is decisive, else `cannot tell`")
    preferred: str = Field(description="model of greatest evidence")
    rival: str = Field(description="best model of another family; empty where there is none")
    ln_bayes_factor: NumberOrNull = Field(description="the former's evidence over that of the latter")


class TwinComparison(DocumentPart):
    """Models on the twin, all records together."""

    verdict: str = Field(description="family of the preferred model if that is decisive, else `cannot tell`")
    preferred: str = Field(description="model of greatest evidence")
    rival: str = Field(description="best model of another family; empty where there is none")
    ln_bayes_factor: NumberOrNull = Field(description="the former's evidence over that of the latter")
    why: str = Field(description="the reason in words")
    verdicts: dict[str, int] = Field(description="how many records had which verdict")
    models: dict[str, ModelOfTwin] = Field(description="the models, by name")
    records: Items[VerdictOnRecord] = Field(description="record by record")
    unavailable: dict[str, str] = Field(description="why others could not take part, by name")


class PrintedEffect(DocumentPart):
    """What a setting does to a printed quantity, from its least to its greatest value."""

    feature: str = Field(description="name of the quantity")
    unit: str = Field(description="its unit")
    setting: str = Field(description="name of the setting")
    from_: Number = Field(alias="from", description="its least value, in its canonical unit")
    to: Number = Field(description="its greatest value")
    factor: bool = Field(description="whether the change is a factor [1] rather than a difference [`unit`]")
    conditions: Items[str] = Field(description="ids of the conditions")
    tested: NumberOrNull = Field(description="change in these tests; null where not told")
    beyond: IntervalDocument | None = Field(
        description="change in general, with scatter between tests; null where not told"
    )
    probability_rises: NumberOrNull = Field(description="that the quantity rises with the setting [1]")
    confounders: Items[Confounder] = Field(description="what varied along with the setting")


class RecomputedValue(DocumentPart):
    """A number that was recomputed."""

    value: Number = Field(description="the number [`unit`]")


class ReproducedEntry(PrintedEntry):
    """A printed number beside what is recomputed."""

    recomputed: RecomputedValue | IntervalDocument | None = Field(
        description="from other cells or from fits of the twin; null where nothing is [`unit`]"
    )


class PageFigure(DocumentPart):
    """A figure of the page."""

    stem: str = Field(description="name of its file, without `.png`")
    caption: str = Field(description="its caption")
    alt: str = Field(description="what it shows, for those who can't see it")


class ReproductionDocument(DocumentPart):
    """What `sma-bayes paper --page` writes as `data/paper.json`."""

    schema_: Literal["sma-bayes/reproduction/1"] = Field(alias="schema", description="name and version")
    paper: str = Field(description="the paper")
    campaign: str = Field(description="name of the twin")
    seed: int = Field(description="decides the twin's noise and every draw")
    versions: dict[str, str] = Field(description="versions of Python and of packages, by name")
    data_sha256: str = Field(description="SHA-256 of the twin's measurements")
    converged: bool = Field(description="whether every fit and every model of the comparison converged")
    claims: Items[JudgedClaim] = Field(description="the claims of the paper")
    implied_correlation: ImpliedAverage = Field(description="what the printed R² imply")
    straight_line_correlation: Number = Field(
        description="mean r over the twin's records of stiffness and temperature [1]"
    )
    correlation_average: Items[CorrelationAverage] = Field(
        description="averages of the correlation factors of the fits of the twin"
    )
    comparison: TwinComparison = Field(description="of models on the twin")
    distances: Items[PublishedDistance] = Field(description="of published curves from their rivals")
    printed_effects: dict[str, Items[PrintedEffect]] = Field(
        description="trends of the printed numbers, by number of the table"
    )
    tables: dict[str, Items[ReproducedEntry]] = Field(
        description="every printed cell beside what is recomputed, by number of the table"
    )
    figures: Items[PageFigure] = Field(description="the figures of the page")

    def rows(self, *tables: int) -> list[ReproducedEntry]:
        """Entries of several tables, one after the other."""
        return [entry for number in tables for entry in self.tables[str(number)]]


DOCUMENTS: Final = {"paper": PaperTablesDocument, "reproduction": ReproductionDocument}
