"""What `modulus.json` holds."""

from __future__ import annotations

from typing import Annotated, Final, Literal

from pydantic import Field

from sma_bayes.document_part import In, Kelvins, Temperature, TemperatureUnit
from sma_bayes.records.dmta import DeclaredDamping
from sma_bayes.runs.finished_run import FinishedRun
from sma_bayes.runs.schema import (
    DeclaredUnits,
    DocumentPart,
    FilesBeside,
    FindingDocument,
    IntervalDocument,
    Items,
    Number,
    NumberOrNull,
    RunAccount,
)


class ModulusOptions(DocumentPart):
    """What was asked for."""

    model: str = Field(description="response model of the storage modulus, or `auto`")
    loss_model: str = Field(description="response model of the loss modulus, or `auto`")
    at: Items[Number] = Field(description="temperatures at which moduli are told [degC]")
    columns: dict[str, str] = Field(description="columns that were named, by quantity")
    units: dict[str, str] = Field(description="units that were stated, by quantity")
    frequency: str = Field(description="stated frequency of files without any; empty where none was")


Modulus = Literal["storage_modulus", "loss_modulus"]
ARRHENIUS: Final = (
    "an activation energy here is that of an Arrhenius law, R = 8.314 J/(mol K), that would give the same shift: an "
    "apparent number for a martensitic transformation, which is athermal"
)
"""What a shift is told with."""


class CurveParameter(IntervalDocument):
    """A parameter of a curve."""

    unit: str = Field(description="its unit")
    meaning: str = Field(description="what it does")


class ModulusCurve(DocumentPart):
    """The curve of a modulus."""

    channel: Modulus = Field(description="which modulus")
    source: Literal["measured", "tan_delta"] = Field(
        description="`tan_delta` where the loss modulus is the declared tan delta times the storage modulus"
    )
    model: str = Field(description="name of its response model")
    reason: str = Field(description="why that one, where it was chosen; else empty")
    noise: str = Field(description="name of its noise model")
    discrepancy: bool = Field(description="whether a smooth function of temperature stands beside the curve")
    n: int = Field(description="samples")
    missed: Number = Field(description="what the median curve misses, root mean square over the range [1]")
    converged: bool = Field(description="whether its draws have converged")
    computed: bool = Field(
        description="whether its readings have no noise (less than 1e-8 of their range): they were computed, not "
        "measured, and no interval follows from them"
    )
    parameters: dict[str, CurveParameter] = Field(description="parameters by name")


class TransitionTemperature(DocumentPart):
    """A temperature of the transition, as far as the draws have one."""

    name: str = Field(
        description="`As`, `Af`, `Ms`, `Mf` (and `Rs`, `Rf` of another stage) by the tangent rule on the storage "
        "modulus; `midpoint` halfway between start and finish; `loss_peak`; "
        "`tan_delta_peak`"
    )
    meaning: str = Field(description="the same in words")
    channel: str = Field(description="`storage_modulus`, `loss_modulus` or `tan_delta`")
    q05: Temperature[NumberOrNull] = Field(
        description="lower end of the 90 % interval [degC]; null where no draw has it"
    )
    median: Temperature[NumberOrNull] = Field(description="median [degC]")
    q95: Temperature[NumberOrNull] = Field(description="upper end [degC]")
    mean: Temperature[NumberOrNull] = Field(description="mean [degC]")
    sd: Kelvins[NumberOrNull] = Field(description="standard deviation [K]")
    defined: Number = Field(description="share of the draws that have it [1]")
    identified: bool = Field(
        description="whether 95 % of the draws have it, and the measurements go beyond it on both sides"
    )


class ModulusValue(IntervalDocument):
    """A modulus or tan delta at a temperature."""

    channel: str = Field(description="`storage_modulus`, `loss_modulus` or `tan_delta`")
    at: Temperature[Number] = Field(description="temperature [degC]")
    unit: str = Field(description="its unit")
    log_mean: NumberOrNull = Field(description="mean of its logarithm; null where draws are not positive")
    log_sd: NumberOrNull = Field(description="standard deviation of that [1]")


class ModulusSweep(DocumentPart):
    """One branch at one frequency."""

    id: str = Field(description="unique name; its band is `bands/<id>.csv`")
    test: str = Field(description="file, with its step or sheet where it has several")
    frequency: NumberOrNull = Field(description="frequency [Hz]; null where none is stated")
    branch: Literal["heating", "cooling"] = Field(description="direction of the sweep")
    temperature_from: Temperature[Number] = Field(description="least measured temperature [degC]")
    temperature_to: Temperature[Number] = Field(description="greatest measured temperature [degC]")
    curves: Items[ModulusCurve] = Field(
        description="of the storage modulus, and of the loss modulus if there is one"
    )
    temperatures: Items[TransitionTemperature] = Field(description="temperatures of the transition")
    values: Items[ModulusValue] = Field(
        description="moduli and tan delta at the temperatures that were asked"
    )


class ShiftPoint(DocumentPart):
    """A temperature at one frequency."""

    sweep: str = Field(description="id of the sweep")
    frequency: Number = Field(description="frequency [Hz]")
    temperature: Temperature[Number] = Field(description="mean [degC]")
    sd: Kelvins[Number] = Field(description="standard deviation [K]")


class FrequencyShift(DocumentPart):
    """Shift of a temperature with frequency, and the apparent activation energy that would give it."""

    branch: str = Field(description="`heating` or `cooling`")
    temperature: str = Field(description="name of the temperature")
    points: Items[ShiftPoint] = Field(description="one for each sweep that has it")
    shift: Annotated[IntervalDocument | None, In("K")] = Field(
        description="shift per decade of frequency [K]; null with fewer than two frequencies"
    )
    probability_rises: NumberOrNull = Field(
        description="posterior probability that it rises with frequency [1]"
    )
    scatter: Annotated[IntervalDocument | None, In("K")] = Field(
        description="standard deviation of the scatter between sweeps beyond their own errors [K]"
    )
    activation_energy: IntervalDocument | None = Field(
        description="apparent activation energy [J/mol]; null where it is not identified"
    )
    least_energy: NumberOrNull = Field(
        description="apparent energy that a positive one exceeds with a probability of 95 % [J/mol]"
    )
    identified: bool = Field(description="whether the 90 % interval of the shift is without zero")
    statement: str = Field(description="the same in a sentence")


class ModulusByFrequency(DocumentPart):
    """Change of the storage modulus with frequency at one temperature."""

    branch: str = Field(description="`heating` or `cooling`")
    at: Temperature[Number] = Field(description="temperature [degC]")
    sweeps: Items[str] = Field(description="ids of the sweeps, by rising frequency")
    factor: IntervalDocument = Field(description="of the storage modulus per decade of frequency [1]")
    probability_rises: Number = Field(description="posterior probability that it rises with frequency [1]")


class ModulusFindings(DeclaredUnits):
    """What a study of moduli found."""

    schema_: Literal["sma-bayes/modulus/1"] = Field(alias="schema", description="name and version")
    source: Items[str] = Field(description="files that were read")
    seed: int = Field(description="decides every draw")
    options: ModulusOptions = Field(description="what was asked for")
    temperature_unit: TemperatureUnit = Field(description="unit of temperatures, `degC`")
    modulus_unit: str = Field(description="unit of moduli, `Pa`")
    versions: dict[str, str] = Field(description="of what computed it")
    data_sha256: str = Field(description="checksum of the files")
    converged: bool = Field(description="whether all posteriors have converged")
    sweeps: Items[ModulusSweep] = Field(description="one for each test, frequency and branch")
    damping: Items[DeclaredDamping] = Field(description="where tan delta and both moduli are declared")
    shifts: Items[FrequencyShift] = Field(description="one for each branch and temperature")
    by_frequency: Items[ModulusByFrequency] = Field(description="one for each branch and asked temperature")
    remarks: Items[str] = Field(description="what can't be told, and why")
    left_out: Items[str] = Field(
        description="tables, frequencies and channels that could not be used, in words"
    )
    findings: Items[FindingDocument] = Field(description="about the measurements")

    @property
    def doubts(self) -> tuple[tuple[str, str], ...]:
        """Severity and words of what is more than a note, each once, however many sweeps of a file it is true of."""
        told = ((f.severity, f"{f.file}: {f.message}") for f in self.findings if f.severity != "note")
        return tuple(dict.fromkeys(told))

    @property
    def of_energies(self) -> str:
        """What the activation energies of its shifts are; empty where no shift is told."""
        return ARRHENIUS if any(s.shift is not None for s in self.shifts) else ""


class ModulusDocument(RunAccount, FilesBeside, ModulusFindings):
    """What `sma-bayes modulus` writes: `modulus.json`."""


StoredModulus = FinishedRun[ModulusDocument]
"""A finished study of moduli, as its folder holds it."""
DOCUMENTS: Final = {"modulus": ModulusDocument}
