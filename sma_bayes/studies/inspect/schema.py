"""What `inspect --json` prints."""

from __future__ import annotations

from typing import Final, Literal

from pydantic import Field

from sma_bayes.runs.fit_document import GoodnessSummary
from sma_bayes.runs.schema import DocumentPart, FindingDocument, Items, Number, NumberOrNull


class TemperatureRange(DocumentPart):
    """Temperatures of a record."""

    unit: str = Field(description="their unit")
    lowest: Number = Field(description="the lowest [`unit`]")
    highest: Number = Field(description="the highest [`unit`]")


class InspectedChannel(DocumentPart):
    """An observed channel."""

    name: str = Field(description="what it is called")
    unit: str = Field(description="its unit")
    noise_sd: NumberOrNull = Field(description="scatter about the least-squares curve [`unit`]")


class HeldChannelDocument(DocumentPart):
    """A channel that the rig kept constant."""

    name: str = Field(description="what it is called")
    unit: str = Field(description="its unit")
    mean: Number = Field(description="mean [`unit`]")
    sd: NumberOrNull = Field(description="standard deviation [`unit`]")


class InspectedNoise(DocumentPart):
    """The noise that a fit would choose."""

    name: str = Field(description="noise model")
    reason: str = Field(description="why, in one sentence")
    lag1: dict[str, NumberOrNull] = Field(description="correlation of neighbouring residuals, by channel [1]")


class InspectedRecord(DocumentPart):
    """What was read of one condition and branch."""

    key: str = Field(description="`<condition>-<branch>`")
    condition: str = Field(description="id of the condition")
    branch: str = Field(description="`heating` or `cooling`")
    source: str = Field(description="data file")
    n: int = Field(description="samples")
    rows: Items[int] = Field(description="first and last row of the file")
    rows_averaged: int = Field(description="source rows that one sample stands for, at most")
    segments: int = Field(description="sweeps")
    temperature: TemperatureRange = Field(description="temperatures")
    channels: dict[str, InspectedChannel] = Field(description="observed channels, by name")
    held: dict[str, HeldChannelDocument] = Field(description="channels that the rig kept constant, by name")
    noise: InspectedNoise = Field(description="the noise that a fit would choose")
    fit: dict[str, GoodnessSummary] = Field(description="least squares, by channel")


class InspectionDocument(DocumentPart):
    """What `sma-bayes inspect PATH --json` prints: what was read, and the noise about least squares."""

    schema_: Literal["sma-bayes/inspect/1"] = Field(alias="schema", description="name and version")
    campaign: str = Field(description="name of the campaign")
    source: str = Field(description="where its measurements come from")
    data_sha256: str = Field(description="SHA-256 of the measurements")
    records: Items[InspectedRecord] = Field(description="one for each condition and branch")
    findings: Items[FindingDocument] = Field(description="what was found about the measurements")


DOCUMENTS: Final = {"inspect": InspectionDocument}
