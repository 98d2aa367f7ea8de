"""What `card.json` holds."""

from __future__ import annotations

from typing import Annotated, Final, Literal

from pydantic import Field

from sma_bayes.document_part import In, InUnit, Kelvins, Temperature, TemperatureUnit, UnitOfQuantity
from sma_bayes.runs.finished_run import FinishedRun
from sma_bayes.runs.schema import (
    DeclaredUnits,
    DocumentPart,
    FilesBeside,
    IntervalDocument,
    Items,
    Number,
    NumberOrNull,
    RunAccount,
    StudyFindings,
)


class CardConstant(IntervalDocument):
    """A constant of the law."""

    name: str = Field(description="its symbol")
    unit: str = Field(description="its unit")
    meaning: str = Field(description="in words")
    value: Number = Field(description="of the card: that of the least-squares law")
    sd: NumberOrNull = Field(description="standard deviation of its draws")
    identified: bool = Field(description="whether the measurements tell it")
    why: str = Field(description="why they do not; empty where they do")


class CardSweep(DocumentPart):
    """One sweep and how the law of the card follows it."""

    key: str = Field(description="key of the record")
    condition: str = Field(description="id of the condition")
    branch: str = Field(description="`heating` or `cooling`")
    stress: Number = Field(description="stress [MPa]")
    middle: IntervalDocument = Field(description="middle of the transformation [K]")
    start: IntervalDocument = Field(description="As or Ms at that stress [K]")
    finish: IntervalDocument = Field(description="Af or Mf at that stress [K]")
    strain: IntervalDocument = Field(
        description="transformation strain: change of strain in the middle, less the elastic part and expansion [1]"
    )
    offset: Number = Field(description="strain of the card less that of the measurements at the hot end [1]")
    finished: bool = Field(
        description="whether the transformation lies within the measured temperatures to 5 %"
    )
    alone: Number = Field(
        description="root mean square misfit of the law fitted to this sweep alone, over the range of its curve [1]"
    )
    card: Number = Field(description="the same of the law with the constants of the card [1]")
    largest: Number = Field(description="largest misfit of that law, over the range of the curve [1]")


class ConstitutiveCard(DocumentPart):
    """Constants of the law with smooth hardening."""

    constants: Items[CardConstant] = Field(
        description="in the order of the columns of `constitutive-draws.csv`"
    )
    at_reference: Items[CardConstant] = Field(description="Ms, Mf, As, Af and Hcur at the reference stress")
    reference_stress: Number = Field(description="stress at which C_A and C_M are the slopes [MPa]")
    common_temperature: Number = Field(description="temperature to which the strain refers [K]")
    stresses: Items[Number] = Field(description="of the sweeps, different ones [MPa]")
    sweeps: Items[CardSweep] = Field(description="one for each record that was used")
    left_out: dict[str, str] = Field(description="records that were not, and why")
    draws: int = Field(description="rows of `constitutive-draws.csv`")
    crossed: NumberOrNull = Field(
        default=None,
        description="greatest share of a phase below which heating and cooling cross at a stress of the sweeps; above "
        "0.001 simcoon does not give the card back [1]",
    )
    simcoon: str = Field(description="file for simcoon")
    sma_react: str = Field(description="file for SMA-REACT")


class StiffnessTable(DocumentPart):
    """Stiffness of one branch at evenly spaced temperatures."""

    condition: str = Field(description="id of the condition")
    branch: str = Field(description="`heating` or `cooling`")
    quantity: str = Field(description="what it is called")
    unit: UnitOfQuantity = Field(description="its unit")
    temperature_unit: TemperatureUnit = Field(description="unit of temperature")
    first: Temperature[Number] = Field(description="first temperature [unit of temperature]")
    step: Kelvins[Number] = Field(description="from one to the next [unit of temperature]")
    points: int = Field(description="number of temperatures")
    interpolation_error: Annotated[Number, In(difference=True)] = Field(
        description="largest error of linear interpolation of the three quantiles [unit]"
    )
    relative_error: Number = Field(description="the same over the stiffness there, largest [1]")
    caution: str = Field(description="what the slope means on this rig; empty where it is that of the spring")


class TabulatedQuantiles(StiffnessTable):
    """The same with its numbers."""

    temperature: Temperature[Items[Number]] = Field(description="evenly spaced [`temperature_unit`]")
    q05: InUnit[Items[Number]] = Field(description="lower end of the 90 % interval at each [`unit`]")
    median: InUnit[Items[Number]] = Field(description="median at each [`unit`]")
    q95: InUnit[Items[Number]] = Field(description="upper end of the 90 % interval at each [`unit`]")


class StiffnessTables(DocumentPart):
    """What `stiffness.json` holds."""

    schema_: Literal["sma-bayes/stiffness-table/1"] = Field(alias="schema", description="name and version")
    campaign: str = Field(description="name of the campaign")
    fit_sha256: str = Field(description="checksum that the summary of the fit states of itself")
    interpolation: Literal["linear"] = Field(
        description="how values between two temperatures are interpolated"
    )
    tables: Items[TabulatedQuantiles] = Field(description="one for each condition and branch")


class CardFindings(StudyFindings, DeclaredUnits):
    """What is handed on."""

    schema_: Literal["sma-bayes/card/1"] = Field(alias="schema", description="name and version")
    converged: bool = Field(description="whether the fits that were used did")
    adequate: bool = Field(description="whether their curves and noise describe the data")
    constitutive: ConstitutiveCard | None = Field(description="null where the campaign gives none")
    no_constitutive: str = Field(description="why there is none; empty where there is")
    stiffness: Items[StiffnessTable] = Field(
        description="one for each condition and branch that has a stiffness"
    )
    no_stiffness: str = Field(description="why there is none; empty where there is")
    cautions: Items[str] = Field(description="what to doubt")


class CardDocument(RunAccount, CardFindings, FilesBeside):
    """What `card.json` holds."""


StoredCard = FinishedRun[CardDocument]
"""A finished card, as its folder holds it."""
DOCUMENTS: Final = {"card": CardDocument, "stiffness-table": StiffnessTables}
