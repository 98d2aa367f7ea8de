"""The study of the heat balance, on wires that are integrated in small steps and switched between samples.

Nothing is shared with the package: a fourth-order Runge-Kutta integrator, laws of its own, and files that are read as
those of users are, so that long records are averaged on the way.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from sma_bayes import read_campaign
from sma_bayes.arrays import Floats
from sma_bayes.parameters.priors_file import read_priors
from sma_bayes.records.types import Campaign
from sma_bayes.studies.gap.heating import heat_parameters, study_heating
from sma_bayes.studies.gap.study import GapStudy, study_campaign

PRIORS = read_priors("modified_sigmoid")
GAIN, LOSS, ROOM = 7.0, 0.1, 22.0
"""Of the wire: [K/(s A^2)], [1/s], [degC]."""
MIDDLE = {True: 62.0, False: 50.0}
WIDTH = 4.0
SUB = 25
"""Steps of the integrator for each sample."""
RISE = 4.5
"""By how much a step of the record heats the wire at the greatest current [K]."""

Law = Callable[[float, float], float]


def share_at(temperature: float, rising: bool) -> float:
    return 0.5 * (1.0 + np.tanh((temperature - MIDDLE[rising]) / WIDTH))


@dataclass(frozen=True)
class Wire:
    """A wire and its logger.

    Attributes
    ----------
    logged : str
        Which current a reading gives: that of the step which begins (``start``), which ends (``end``), or at an instant
        while the drive knows nothing of the logger (``apart``).
    loses : callable
        Rate of cooling [K/s] at a temperature, given the room.
    resists : callable
        Resistance over its usual one at a temperature and share of austenite.
    chain : tuple of float
        Heat capacities of a chain of bodies beside the wire, over its own.
    latent : float
        Heat of the transformation over the heat capacity of the wire [K].
    samples, cycles : int
        Of a cycle of 40 s; of a record.
    """

    logged: str = "start"
    loses: Law = lambda t, room: LOSS * (t - room)
    resists: Law = lambda t, s: 1.0
    chain: tuple[float, ...] = ()
    latent: float = 0.0
    samples: int = 110
    cycles: int = 4
    noise: float = 0.05

    def record(self, current: float, rng: np.random.Generator) -> Floats:
        """Time, temperature, displacement and current, as columns."""
        step = 40.0 / self.samples
        late = (
            rng.uniform(0.0, step, 2 * self.cycles) if self.logged == "apart" else np.zeros(2 * self.cycles)
        )
        turned = 20.0 * np.arange(2 * self.cycles) + late
        h = step / SUB
        at = np.arange(self.cycles * self.samples * SUB) * h
        passed = np.concatenate([turned, [np.inf]])
        on = sum(
            np.clip(np.minimum(at + h, passed[k + 1]) - np.maximum(at, passed[k]), 0.0, h) / h
            for k in range(0, 2 * self.cycles, 2)
        )
        y = np.full(1 + len(self.chain), ROOM + 2.0)
        share, out = 0.0, np.empty((at.size, 2))

        def rate(y: Floats, power: float, rising: bool) -> Floats:
            t, beside = y[0], y[1:]
            path = np.concatenate([[t], beside])
            flow = 0.15 * np.diff(path) * -1.0  # K/s of the wire, from each body to the next
            taken = flow[0] if beside.size else 0.0
            capacity = 1.0 + self.latent * (share_at(t + 0.01, rising) - share_at(t - 0.01, rising)) / 0.02
            own = GAIN * power * self.resists(t, share) - self.loses(t, ROOM) - taken
            onward = np.concatenate([flow[1:], [0.0]])[: beside.size]
            return np.concatenate([[own / capacity], (flow - onward) / np.array(self.chain)])

        for i, power in enumerate((current**2 * on).tolist()):
            out[i] = y[0], share
            rising = power > 0.0
            k1 = rate(y, power, rising)
            k2 = rate(y + 0.5 * h * k1, power, rising)
            k3 = rate(y + 0.5 * h * k2, power, rising)
            k4 = rate(y + h * k3, power, rising)
            y = y + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
            share = share_at(float(y[0]), rising)
        time, (temperature, s) = at[::SUB], out[::SUB].T
        asked = time + {"start": 0.5 * step, "end": -0.5 * step, "apart": 0.0}[self.logged]
        odd = np.searchsorted(turned, asked, side="right") % 2
        read = temperature + self.noise * rng.standard_normal(time.size)
        stroke = 10.0 + 20.0 * s + 0.3 * rng.standard_normal(time.size)
        return np.column_stack([time, read, stroke, current * odd])

    def campaign(
        self, folder: Path, currents: tuple[float, ...] = (1.2, 1.4), spoil: float = 0.0
    ) -> Campaign:
        """Read back from files; `spoil` is added to the displacement of the later half of each record [mm]."""
        rng = np.random.default_rng(5)
        names = {"time": "s", "temperature": "degC", "displacement": "mm", "current": "A"}
        columns = "".join(f'{n} = {{ name = "{n}", unit = "{u}" }}\n' for n, u in names.items())
        text = f'[campaign]\nname = "wire"\n[columns]\n{columns}'
        for current in currents:
            rows = self.record(current, rng)
            rows[len(rows) // 2 :, 2] += spoil
            np.savetxt(folder / f"{current}.csv", rows, delimiter=",", header=",".join(names), comments="")
            text += f'[[condition]]\nid = "{current}A"\nfile = "{current}.csv"\ncurrent_A = {current}\n'
        (folder / "campaign.toml").write_text(text, encoding="utf-8")
        return read_campaign(folder)


def studied(campaign: Campaign) -> tuple[GapStudy, GapStudy]:
    response = study_campaign(campaign, PRIORS, pooled=True, effects={})
    heating = study_heating(campaign, response, PRIORS, pooled=True)
    assert heating is not None
    return response, heating


def told(study: GapStudy) -> dict[str, dict[str, float]]:
    return {name: p.as_json() for name, p in heat_parameters(study, np.empty((0, 1)), 0).items()}


@pytest.mark.parametrize(
    ("logged", "samples", "switching"),
    [("start", 110, 1.0), ("end", 110, 0.0), ("apart", 110, None), ("start", 240, 1.0), ("apart", 240, None)],
    ids=["start of the step", "end of the step", "apart", "averaged", "apart and averaged"],
)
def test_a_heating_that_is_exact_but_for_the_log_is_none(
    logged: str, samples: int, switching: float | None, tmp_path: Path
) -> None:
    """Of a record of 240 samples a cycle more than 400 a branch are averaged, unequally many at a time."""
    campaign = Wire(logged=logged, samples=samples).campaign(tmp_path)
    assert (max(r.rows_averaged for r in campaign.records) > 1) == (samples > 200)
    _, heating = studied(campaign)
    assert heating.verdict == "none", heating.p_value
    found = told(heating)
    for name, true in {"gain": GAIN, "loss": LOSS, "time_constant": 1.0 / LOSS, "ambient": ROOM}.items():
        half = 0.5 * (found[name]["q95"] - found[name]["q05"])
        assert abs(found[name]["median"] - true) < max(2.5 * half, 1e-3 * true), (name, found[name])
    if switching is not None:
        assert found["switching"]["median"] == pytest.approx(switching, abs=0.03)
        assert found["switching"]["scatter"] <= 0.02
    else:
        assert 0.2 < found["switching"]["median"] < 0.8
        assert 0.1 < found["switching"]["scatter"] < 0.5


def test_what_is_wrong_with_one_part_hides_nothing_of_the_other(tmp_path: Path) -> None:
    response, heating = studied(Wire().campaign(tmp_path, spoil=3.0))
    assert (response.verdict, heating.verdict) == ("unnamed", "none")
    assert all(d.channel == "displacement" for d in response.disagreements)
    (tmp_path / "hot").mkdir()
    hot = Wire(latent=20.0, logged="apart").campaign(tmp_path / "hot")
    response, heating = studied(hot)
    assert response.verdict == "none", response.p_value
    assert [e.id for e in heating.effects] == ["latent_heat"]
    assert heating.final.theta[-1] == pytest.approx(20.0 * 500.0, rel=0.05)


def churchill_chu(t: float, room: float) -> float:
    """Free convection around a horizontal cylinder, Churchill and Chu 1975; of a thin wire in air Ra = 0.4 at 40 K."""

    def nusselt(excess: float) -> float:
        rayleigh = 0.4 * abs(excess) / 40.0
        return (0.6 + 0.387 * rayleigh ** (1 / 6) / (1.0 + (0.559 / 0.7) ** (9 / 16)) ** (8 / 27)) ** 2

    return LOSS * (t - room) * nusselt(t - room) / nusselt(40.0)


def radiating(t: float, room: float) -> float:
    """Stefan and Boltzmann's law, a third of what convection takes at room temperature."""
    hot, cold = t + 273.15, room + 273.15
    return 0.75 * LOSS * ((t - room) + (hot**4 - cold**4) / (4.0 * cold**3) / 3.0)


def of_phases(t: float, s: float) -> float:
    """Resistivities of the phases with temperature coefficients of their own."""
    martensite, austenite = 1.0 + 1e-4 * (t - 20.0), 0.86 + 2e-4 * (t - 20.0)
    return (1.0 - s) * martensite + s * austenite


@pytest.mark.slow
@pytest.mark.thorough
@pytest.mark.parametrize(
    ("wire", "named"),
    [
        (Wire(loses=churchill_chu, logged="apart"), "convective_loss"),
        (Wire(loses=radiating, logged="apart"), "radiative_loss"),
        (Wire(resists=of_phases, logged="apart"), "phase_resistance"),
        (Wire(chain=(0.15, 0.1), logged="apart"), "second_mass"),
    ],
    ids=["Churchill and Chu", "Stefan and Boltzmann", "mixture", "chain of two bodies"],
)
def test_a_mechanism_of_another_form_gets_its_name_or_its_class(
    wire: Wire, named: str, tmp_path: Path
) -> None:
    """Losses by convection and radiation bend alike: each may stand in the class of the other, not out of it."""
    _, heating = studied(wire.campaign(tmp_path, (1.0, 1.2, 1.4)))
    assert heating.verdict == "named", (heating.verdict, heating.carried)
    first = heating.classes[heating.effects[0].id]
    alike = {"convective_loss", "radiative_loss"}
    assert named in first or (named in alike and first[0] in alike), heating.classes


def test_voltage_or_resistance_that_was_logged_is_used(tmp_path: Path) -> None:
    """The wire whose resistance depends on the phase again, with the voltage beside its current."""
    wire = Wire(resists=of_phases)
    wire.campaign(tmp_path)
    text = (tmp_path / "campaign.toml").read_text(encoding="utf-8")
    extra = '[columns]\nvoltage = { name = "voltage", unit = "V" }\n'
    (tmp_path / "campaign.toml").write_text(text.replace("[columns]\n", extra), encoding="utf-8")
    for path in tmp_path.glob("*.csv"):
        header, *_ = path.read_text(encoding="utf-8").splitlines()
        rows = np.loadtxt(path, delimiter=",", skiprows=1)
        t, stroke, current = rows[:, 1], rows[:, 2], rows[:, 3]
        exact = [of_phases(a, share_at(a, c > 0.0)) for a, c in zip(t, current, strict=True)]
        volts = 1.7 * current * np.array(exact)
        np.savetxt(
            path, np.column_stack([rows, volts]), delimiter=",", header=f"{header},voltage", comments=""
        )
        assert stroke.size
    campaign = read_campaign(tmp_path)
    _, heating = studied(campaign)
    assert heating.verdict == "none", (heating.p_value, [e.id for e in heating.effects])
    untested = {c.effect.id: c.untestable for c in heating.steps[0].candidates if c.untestable}
    assert "is used" in untested["phase_resistance"]


def test_without_current_there_is_no_heat_balance(rig) -> None:
    campaign = rig().campaign()
    response = study_campaign(campaign, PRIORS, pooled=True, effects={})
    assert study_heating(campaign, response, PRIORS, pooled=True) is None
