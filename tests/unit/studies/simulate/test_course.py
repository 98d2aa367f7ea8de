"""Integration of a heat balance with every effect that it carries, against scipy."""

from __future__ import annotations

from dataclasses import fields
from typing import Any, cast

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from sma_bayes.records.types import Branch
from sma_bayes.studies.simulate.balance import HeatBalance
from sma_bayes.studies.simulate.course import Start, follow
from sma_bayes.studies.simulate.profile import read_profile
from sma_bayes.studies.simulate.spring import SHARE, BothDraws, CurveTable, Spring

GRID = np.linspace(0.0, 200.0, 4001)
MIDDLE = {Branch.HEATING: 62.0, Branch.COOLING: 50.0}
EFFECTS = {
    "none": {},
    "latent": {"latent": 20.0},
    "resistance": {"resistance": -0.2, "latent": 10.0},
    "convection": {"exponent": 0.2},
    "radiation": {"radiated": 0.1},
    "second mass": {"second": 0.4, "second_time": 6.0, "latent": 8.0},
    "contact": {"contact": 0.1, "latent": 8.0},
    "lag": {"lag": 2.0, "latent": 8.0},
}


def share(temperature: Any, branch: Branch) -> Any:
    return 1.0 / (1.0 + np.exp(-0.5 * (temperature - MIDDLE[branch])))


def spring(size: int = 1) -> Spring:
    tables = {b: CurveTable(0.0, float(GRID[1]), {SHARE: np.tile(share(GRID, b), (size, 1))}) for b in Branch}
    return Spring(cast(BothDraws, None), tables)


def balance(**more: float) -> HeatBalance:
    plain = {"gain": 7.0, "loss": 0.1, "room": 22.0, "usual_room": 22.0, **more}
    arrays = {f.name: np.array([plain.get(f.name, 0.0)]) for f in fields(HeatBalance) if f.name != "sd"}
    return HeatBalance(sd=0.1, **arrays)


@pytest.mark.parametrize("name", EFFECTS)
def test_heated_and_cooled_as_scipy_does(name: str) -> None:
    """Both outer branches, one after the other; the equations are written anew, in kelvin where they radiate."""
    own = {"latent": 0.0, "resistance": 0.0, "exponent": 0.0, "radiated": 0.0, "second": 0.0, "second_time": 1.0,
           "contact": 0.0, "lag": 0.0} | EFFECTS[name]  # fmt: skip
    profile = read_profile({"time_s": [0.0, 60.0, 120.0], "current_A": [1.1, 0.0, 0.0]})
    told = follow(spring(), balance(**EFFECTS[name]), profile, Start("cold"))

    def rate(_: float, y: Any, current: float, branch: Branch) -> list[float]:
        alloy, beside, late = y
        seen = (alloy + own["contact"] * 22.0) / (1.0 + own["contact"])
        read = late if own["lag"] else seen
        s = share(read, branch)
        slope = 0.5 * s * (1.0 - s)
        heat = 7.0 * current**2 * (1.0 + own["resistance"] * (s - 0.5))
        h = (max(abs(alloy - 22.0), 0.5) / 40.0) ** own["exponent"]
        hot, cold = alloy + 273.15, 22.0 + 273.15
        lost = 0.1 * (h * (alloy - 22.0) + own["radiated"] * (hot**4 - cold**4) / (4.0 * 293.15**3))
        warmed = (alloy - beside) / own["second_time"]
        net = heat - lost - own["second"] * warmed
        if own["lag"]:
            followed = (seen - late) / own["lag"]
            return [net - own["latent"] * slope * followed, warmed, followed]
        change = net / (1.0 + own["latent"] * slope / (1.0 + own["contact"]))
        return [change, warmed, 0.0]

    y, read = np.full(3, 22.0), []
    for begin, current, branch in ((0.0, 1.1, Branch.HEATING), (60.0, 0.0, Branch.COOLING)):
        here = told.time[(told.time >= begin) & (told.time <= begin + 60.0)]
        found = solve_ivp(
            rate,
            (begin, begin + 60.0),
            y,
            args=(current, branch),
            rtol=1e-8,
            atol=1e-8,
            max_step=0.2,
            t_eval=here,
        )
        seen = (found.y[0] + own["contact"] * 22.0) / (1.0 + own["contact"])
        read.append((found.y[2] if own["lag"] else seen)[int(begin > 0.0) :])
        y = found.y[:, -1]
    assert np.max(np.abs(told.temperature[0] - np.concatenate(read))) < 0.15
    assert float(told.turns[0]) == 1.0


def test_shorter_steps_give_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    profile = read_profile({"time_s": [0.0, 15.0, 25.0, 60.0], "current_A": [1.1, 0.5, 0.9, 0.9]})
    usual = follow(spring(), balance(latent=20.0), profile, Start("cold"))
    for name in ("MAX_TEMPERATURE_STEP", "MAX_STEP_OF_LOSS"):
        monkeypatch.setattr(f"sma_bayes.studies.simulate.course.{name}", 0.02)
    fine = follow(spring(), balance(latent=20.0), profile, Start("cold"))
    assert np.max(np.abs(usual.temperature - fine.temperature)) < 0.05


def test_a_steady_state_stays_on_its_branch() -> None:
    profile = read_profile({"time_s": [0.0, 500.0], "current_A": [0.75, 0.75]})
    told = follow(spring(), balance(latent=10.0, exponent=0.2), profile, Start("cold"))
    assert float(told.turns[0]) == 0.0
    assert np.all(np.diff(told.temperature[0, -100:]) < 1e-6)


@pytest.mark.parametrize("rule", ["proportional", "play"])
def test_branches_are_joined_without_a_jump(rule: Any) -> None:
    """At every turn the share goes on from where it was, stays between the outer curves, and ends on them.

    What is straight between two nodes of the table is off by up to 0.05²/8 times the curvature, 0.024 at most.
    """
    own = Spring(cast(BothDraws, None), spring().tables, rule)
    state, at = own.begin(True), np.array([30.0])
    for to in (58.0, 47.0, 60.0, 52.0, 120.0, 20.0):
        for t in np.linspace(at[0], to, 200):
            value = own.share(np.array([t]), state)
            assert share(t, Branch.HEATING) - 1e-5 <= value[0] <= share(t, Branch.COOLING) + 1e-5
        at = np.array([to])
        before = own.share(at, state)
        state = own.turned(at, state)
        assert own.share(at, state) == pytest.approx(before, abs=1e-12)
    assert before[0] < 1e-3


def test_play_keeps_the_share_until_the_other_curve_is_met() -> None:
    own = Spring(cast(BothDraws, None), spring().tables, "play")
    there = np.array([60.0])
    state = own.turned(there, own.begin(True))
    reached = share(60.0, Branch.HEATING)
    met = 50.0 + np.log(reached / (1.0 - reached)) / 0.5
    for t in (59.0, met + 0.5):
        assert own.share(np.array([t]), state)[0] == pytest.approx(reached, abs=1e-3)
    assert own.share(np.array([met - 2.0]), state)[0] == pytest.approx(
        share(met - 2.0, Branch.COOLING), abs=1e-3
    )
