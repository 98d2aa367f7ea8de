"""What `simulate.json` holds."""

from __future__ import annotations

from typing import Final, Literal

from pydantic import Field

from sma_bayes.quantities import convert
from sma_bayes.runs.finished_run import FinishedRun
from sma_bayes.runs.schema import (
    DeclaredUnits,
    DocumentPart,
    IntervalDocument,
    Items,
    Number,
    NumberOrNull,
    RunAccount,
    StudyFindings,
)
from sma_bayes.studies.gap.schema import HeatParameter


class StatedBalance(DocumentPart):
    """The heat balance that was fitted to the temperatures of the campaign."""

    parameters: dict[str, HeatParameter] = Field(
        description="gain, loss, time constant, ambient temperature where it was fitted, `effect.parameter`; of a "
        "condition `gain[id]`"
    )
    effects: Items[str] = Field(
        description="ids of the effects that the measured temperatures support and a simulation can include"
    )
    verdict: str = Field(
        description="`none`: nothing is missing beyond chance; `named`: the effects are; `unnamed`: something else is"
    )
    p_value: Number = Field(description="p-value of what the balance without effects misses [1]")
    pool: str = Field(description="`campaign`: one gain and loss for all conditions; `none`: own ones")
    sd: dict[str, Number] = Field(
        description="by condition: standard deviation of measured temperatures about the balance, noise and misfit "
        "together [K]"
    )
    greatest_current: Number = Field(description="greatest measured current [A]")


class ValueAtEnd(IntervalDocument):
    """A quantity when the profile ends, or where it was greatest."""

    name: str = Field(description="what it is called")
    unit: str = Field(description="its unit")
    pred_q05: NumberOrNull = Field(description="5 % quantile of another run [unit]")
    pred_q95: NumberOrNull = Field(description="95 % quantile of another run [unit]")

    def shown_in(self, unit: str) -> ValueAtEnd:
        """The same in another unit."""
        told = {n: v for n, v in self if isinstance(v, float)}
        return self.but(unit=unit, **{n: float(convert(v, self.unit, unit)) for n, v in told.items()})


class OtherRule(DocumentPart):
    """What another rule for minor loops would give."""

    rule: str = Field(description="its name")
    difference: dict[str, Number] = Field(
        description="by channel: greatest difference of the medians, over time [unit of the channel]"
    )


class SimulatedRun(DocumentPart):
    """The course of one condition from one start."""

    condition: str = Field(description="id of the condition whose curves and heat balance were used")
    start: str = Field(description="`cold`, `hot`, `heating` or `cooling`")
    start_temperature: NumberOrNull = Field(description="as given [°C]; null: that of the room")
    file: str = Field(description="bands in time, a CSV in the folder")
    units: dict[str, str] = Field(description="unit of temperature and of each channel")
    declared_units: dict[str, str] = Field(
        description="the units that the campaign declares, in which people see these numbers"
    )
    names: dict[str, str] = Field(description="what each channel is called")
    measured: Items[Number] = Field(description="lowest and highest measured temperature [°C]")
    hottest: ValueAtEnd = Field(description="hottest temperature")
    end: dict[str, ValueAtEnd] = Field(description="temperature and each channel at the end of the profile")
    extrapolated: Number = Field(
        description="greatest share of the draws that are beyond the measured temperatures, by more than 2 % of their "
        "range, at an instant [1]"
    )
    extrapolated_from: NumberOrNull = Field(
        description="first instant at which that is more than one in twenty [s]; null where it never is"
    )
    turns: Number = Field(description="how often the temperature turned, mean over the draws")
    inside: Number = Field(
        description="how often with 5 to 95 % of the transformation done, so that a minor loop began"
    )
    other_rule: OtherRule | None = Field(description="null where no such loop began")
    caution: str | None = Field(
        description="what the slope means on this rig, where it does not tell of the spring"
    )

    @property
    def shown(self) -> dict[str, ValueAtEnd]:
        """What is at the end, by channel, in the declared units."""
        return {c: v.shown_in(self.declared_units.get(c, v.unit)) for c, v in self.end.items()}

    @property
    def temperature_unit(self) -> str:
        """Unit in which people see temperatures."""
        return self.declared_units.get("temperature", self.units["temperature"])

    def shown_temperature(self, stored: float) -> float:
        """A temperature in that unit."""
        return float(convert(stored, self.units["temperature"], self.temperature_unit))


class CurrentPassage(IntervalDocument):
    """Steady currents at which draws pass the value [A]."""

    direction: Literal["rising", "falling"] = Field(
        description="`rising` or `falling`: of the value with the current"
    )
    probability: Number = Field(description="share of the draws that do [1]")
    beyond_measured: bool = Field(description="whether the interval leaves the measured currents")


class CurrentStretch(DocumentPart):
    """Currents from one to another."""

    low: Number = Field(description="the least [A]")
    high: Number = Field(description="the greatest [A]")


class BestCurrent(DocumentPart):
    """The current that meets the value most surely."""

    current: Number = Field(description="the current [A]")
    probability: Number = Field(description="with which the value is met within the tolerance there [1]")


class ReachOfCondition(DocumentPart):
    """What one condition says."""

    condition: str = Field(description="its id")
    quantity: str = Field(description="what is asked for")
    unit: str = Field(description="unit of target and bounds")
    target: Number = Field(description="the wanted value [`unit`]")
    bounds: Items[Number] = Field(description="least and greatest value that the tolerance allows [`unit`]")
    reachable: Number = Field(
        description="probability that a steady current gives it within the measured temperatures [1]"
    )
    passages: Items[CurrentPassage] = Field(description="where draws pass it")
    intervals: Items[CurrentStretch] = Field(description="currents that meet it with the probability or more")
    best: BestCurrent | None = Field(description="null where no current meets it in any draw")
    searched: Number = Field(description="greatest current that was searched [A]")
    caution: str | None = Field(
        description="what the slope means on this rig, where it does not tell of the spring"
    )


class ReachDocument(DocumentPart):
    """Which steady current gives a wanted value, heated from cold."""

    asked: str = Field(description="as given")
    tolerance: str = Field(description="as given")
    probability: Number = Field(description="as given [1]")
    conditions: Items[ReachOfCondition] = Field(description="one for each condition that has the quantity")


class StatedProfile(DocumentPart):
    """The current that was given."""

    file: str = Field(description="its name")
    rows: int = Field(description="how many")
    duration_s: Number = Field(description="from the first to the last [s]")
    greatest_current: Number = Field(description="greatest magnitude [A]")
    ambient: str = Field(description="where the temperature of the room comes from")
    sha256: str = Field(description="SHA-256 of its values")


class SimulationFindings(StudyFindings, DeclaredUnits):
    """What a simulation found."""

    schema_: Literal["sma-bayes/simulation/1"] = Field(alias="schema", description="name and version")
    draws: int = Field(description="number of draws")
    rule: str = Field(description="of minor loops: `proportional` or `play`")
    converged: bool = Field(description="whether the fits that were used did")
    adequate: bool = Field(description="whether their curves and noise describe the data")
    balance: StatedBalance = Field(description="the heat balance")
    profile: StatedProfile | None = Field(description="the current; null where only a value is to be reached")
    runs: Items[SimulatedRun] = Field(description="one for each condition and start")
    reach: ReachDocument | None = Field(
        description="the steady current of a wanted value; null where none was asked for"
    )
    cautions: Items[str] = Field(description="what to doubt")


class SimulationDocument(RunAccount, SimulationFindings):
    """What `simulate.json` holds."""

    files_sha256: dict[str, str] = Field(
        default_factory=dict,
        description="SHA-256 of each file in `bands/`, by its path; a file that differs is refused",
    )


StoredSimulation = FinishedRun[SimulationDocument]
"""A finished simulation, as its folder holds it."""
DOCUMENTS: Final = {"simulate": SimulationDocument}
