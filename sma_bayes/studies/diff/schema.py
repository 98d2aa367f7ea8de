"""What `diff --json` prints."""

from __future__ import annotations

from typing import Any, Final, Literal

from pydantic import Field

from sma_bayes.runs.schema import DeclaredUnits, DocumentPart, Items, Number, NumberOrNull


class ParameterOfRun(DocumentPart):
    """A parameter in one of the runs, in its unit."""

    median: NumberOrNull = Field(description="median")
    q05: NumberOrNull = Field(description="lower end of the 90 % interval; null where it is fixed")
    q95: NumberOrNull = Field(description="upper end")
    sd: NumberOrNull = Field(description="standard deviation")


class ComparedParameter(DocumentPart):
    """A parameter in both runs."""

    unit: str = Field(description="its unit")
    a: ParameterOfRun | None = Field(description="in a; null where it has no such parameter")
    b: ParameterOfRun | None = Field(description="in b; null where it has no such parameter")
    shift: NumberOrNull = Field(
        description="b less a, in standard deviations of the wider posterior; null where it can't be told"
    )


class ComparedBand(DocumentPart):
    """Where the medians of two bands are furthest apart, in standard deviations of the wider one."""

    name: str = Field(description="what the channel is called")
    unit: str = Field(description="its unit")
    shift: NumberOrNull = Field(description="b less a there [sd]")
    at: Number = Field(description="temperature there [`temperature_unit`]")
    temperature_unit: str = Field(description="unit of temperatures")
    medians: Items[Number] = Field(description="of the bands there, in a, in b [`unit`]")
    difference: Number = Field(description="b less a there [`unit`]")
    width_ratio: NumberOrNull = Field(description="how many times as wide b is [1]")
    compared: Items[Number] = Field(description="lowest and highest temperature that both have")


class ComparedRecords(DocumentPart):
    """A record in both runs; where one has none, all after `same` is missing."""

    key: str = Field(description="key of the record")
    in_: Literal["a", "b", "both"] = Field(
        validation_alias="in",
        serialization_alias="in",
        description="which has it: `both`, or `a` or `b` where the other has none",
    )
    same: bool = Field(
        description="converged, adequate, model and channels as in the other, all shifts within the tolerance"
    )
    converged: Items[bool] = Field(default=(), description="in a, in b")
    adequate: Items[bool] = Field(default=(), description="in a, in b")
    why: Items[Items[str]] = Field(default=(), description="reasons of inadequacy in a, in b")
    changed: dict[str, Items[Any]] = Field(
        default={},
        description="what of samples, temperatures, settings, noise, model and so on differs: in a, in b",
    )
    priors: Items[str] = Field(default=(), description="parameters whose priors differ")
    parameters: dict[str, ComparedParameter] = Field(
        default={},
        description="parameters, by name; where models differ, A1 to B4 of the published curve nearest to either, and "
        "parameters of the noise",
    )
    transformation: dict[str, ComparedParameter] = Field(
        default={},
        description="transformation temperatures, by name; they follow from the curves and have no say in `same`",
    )
    bands: dict[str, ComparedBand | None] = Field(
        default={}, description="bands, by channel; null where they share no temperature"
    )


class DifferenceDocument(DeclaredUnits):
    """What `sma-bayes diff A B --json` prints; it writes nothing."""

    schema_: Literal["sma-bayes/diff/1"] = Field(alias="schema", description="name and version")
    a: str = Field(description="folder of the one fit")
    b: str = Field(description="folder of the other")
    tolerance: Number = Field(description="up to how many standard deviations results are the same [sd]")
    same: bool = Field(description="whether all records agree")
    inputs: dict[str, Items[Any]] = Field(
        description="what of campaign, data, seed, options and versions differs: in a, in b"
    )
    converged: Items[bool] = Field(description="all records, in a, in b")
    adequate: Items[bool] = Field(description="all records, in a, in b")
    records: Items[ComparedRecords] = Field(description="one for each record of either")


DOCUMENTS: Final = {"diff": DifferenceDocument}
