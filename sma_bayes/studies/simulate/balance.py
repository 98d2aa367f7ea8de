"""The heat balance of a fitted campaign: what heats and cools the alloy, as draws, from the study of its temperatures.

The study is that of `gap`: gain and loss of the Joule-heating balance, and those effects of the catalogue that the
measured temperatures support, latent heat and a resistance that depends on the phase among them. The share of austenite
along the measured history comes from the fitted curves.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any, Final

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.effects import EFFECTS
from sma_bayes.effects.latent_heat import SPECIFIC_HEAT
from sma_bayes.errors import MeasurementError
from sma_bayes.parameters.priors_file import PriorSet
from sma_bayes.records.history import BRANCH_SIGN, History, histories
from sma_bayes.records.types import Branch, Campaign, Record
from sma_bayes.response.joule_heating import loss_law
from sma_bayes.studies.gap.heating import study_balance
from sma_bayes.studies.gap.study import GapStudy, Progress
from sma_bayes.studies.simulate.spring import BothDraws, share_of

SIMULATED_EFFECTS: Final = (
    "latent_heat",
    "phase_resistance",
    "convective_loss",
    "radiative_loss",
    "second_mass",
    "ambient_draught",
    "thermocouple_lag",
    "contact_error",
)
"""Effects of the catalogue that a simulation follows in time; no other one is looked for."""


@dataclass(frozen=True, slots=True, eq=False)
class HeatBalance:
    """Draws of the heat balance of one condition; all arrays (S,), zero where an effect is not there.

        (1 + latent ds/dT) dT/dt = gain I^2 (1 + r (s - 1/2)) - loss h(T) (T - Ta) - q dT2/dt,  tau2 dT2/dt = T - T2

    Attributes
    ----------
    gain : ndarray
        [K/(s A^2)]
    loss : ndarray
        [1/s]
    room : ndarray
        Ambient temperature, fitted, or as it was recorded [degC].
    sd : float
        Of measured temperatures about the balance, noise and misfit together [K].
    latent : ndarray
        Latent over specific heat [K].
    resistance : ndarray
        r: resistance of austenite less that of martensite, over the mean.
    exponent, radiated : ndarray
        Of the loss; see `loss_law`.
    second, second_time : ndarray
        q, and tau2 [s].
    draught, usual_room : ndarray
        Growth of ln h for each kelvin that the room is below its usual temperature [1/K], and that [degC].
    contact : ndarray
        Error of the thermometer over the excess of its reading.
    lag : ndarray
        Time constant of the thermometer [s].
    """

    gain: Floats
    loss: Floats
    room: Floats
    sd: float
    latent: Floats
    resistance: Floats
    exponent: Floats
    radiated: Floats
    second: Floats
    second_time: Floats
    draught: Floats
    usual_room: Floats
    contact: Floats
    lag: Floats

    @property
    def size(self) -> int:
        """Number of draws."""
        return self.gain.size

    def part(self, draws: slice) -> HeatBalance:
        """Some of the draws."""
        arrays: dict[str, Any] = {
            f.name: getattr(self, f.name)[draws] for f in fields(self) if f.name != "sd"
        }
        return HeatBalance(sd=self.sd, **arrays)

    def heating(self, current: float | Floats, share: Floats) -> Floats:
        """Rate at which a current heats, without losses [K/s]."""
        return np.asarray(self.gain * current**2 * self.resistance_factor(share))

    def resistance_factor(self, share: Floats) -> Floats:
        """Resistance at a share of austenite over that half way."""
        return np.maximum(1.0 + self.resistance * (share - 0.5), 0.01)

    def loss_rate(self, temperature: Floats, room: Floats) -> Floats:
        """Loss at a temperature of the alloy [1/s]."""
        law = loss_law(
            {"temperature": temperature, "loss_exponent": self.exponent, "radiated": self.radiated}, room
        )
        return np.asarray(
            self.loss * law * np.exp(np.clip(self.draught * (self.usual_room - room), -5.0, 5.0))
        )

    def read(self, temperature: Floats, room: Floats) -> Floats:
        """What the thermometer of the campaign says at a steady temperature of the alloy [degC]."""
        return np.asarray((temperature + self.contact * room) / (1.0 + self.contact))

    def of_alloy(self, read: Floats, room: Floats) -> Floats:
        """Steady temperature of the alloy at which the thermometer says so [degC]."""
        return np.asarray(read + self.contact * (read - room))


@dataclass(frozen=True, slots=True, eq=False)
class FittedBalance:
    """The heat balances of a campaign.

    Attributes
    ----------
    study : GapStudy
        Of its temperatures.
    draws : ndarray, shape (S, P)
        Of the parameters of its final model.
    histories : tuple of History
    pooled : bool
        Whether one gain and one loss serve all of them.
    remarks : tuple of str
    """

    study: GapStudy
    draws: Floats
    histories: tuple[History, ...]
    pooled: bool
    remarks: tuple[str, ...] = field(default=())

    def of(self, condition: str, rng: np.random.Generator) -> HeatBalance:
        """The balance of one condition."""
        final = self.study.final
        hypothesis = final.hypothesis
        i = self._number(condition)
        gain, loss, room, _ = self.draws[:, hypothesis.layout[i]].T
        usual = room
        recorded = self.histories[i].inputs.get("ambient_temperature")
        if recorded is not None:
            room, usual = rng.choice(recorded, room.size), np.full(room.size, np.median(recorded))
        at = hypothesis.effect_positions

        def effect(name: str, number: int = 0) -> Floats:
            if name not in at or number >= len(at[name]):
                return np.zeros(len(self.draws))
            return np.asarray(self.draws[:, at[name][number]])

        return HeatBalance(
            gain=gain,
            loss=loss,
            room=room,
            sd=self.sd(condition),
            latent=effect("latent_heat") / SPECIFIC_HEAT,
            resistance=effect("phase_resistance"),
            exponent=effect("convective_loss"),
            radiated=effect("radiative_loss"),
            second=effect("second_mass"),
            second_time=effect("second_mass", 1),
            draught=effect("ambient_draught"),
            usual_room=usual + effect("ambient_draught", 1 + i),
            contact=effect("contact_error"),
            lag=effect("thermocouple_lag"),
        )

    def _number(self, condition: str) -> int:
        return next(n for n, h in enumerate(self.histories) if h.condition.id == condition)

    def sd(self, condition: str) -> float:
        """Noise or misfit of measured temperatures [K], the larger one: of a condition, or of all that share all."""
        final, history = self.study.final, self._number(condition)
        mine = [
            (float(np.mean(final.residual[b.at] ** 2)), n.sd**2)
            for b, n in zip(final.blocks, final.noise, strict=True)
            if self.pooled or b.history == history
        ]
        misfit, noise = np.mean(mine, axis=0)
        return float(np.sqrt(max(misfit, noise)))

    @property
    def greatest_current(self) -> float:
        """That was measured [A]."""
        return max(float(np.max(np.abs(h.inputs["current"]))) for h in self.histories)


def fitted_balance(
    campaign: Campaign,
    springs: Sequence[BothDraws],
    priors: PriorSet,
    *,
    pooled: bool,
    draws: int,
    seed: int,
    tell: Progress,
) -> FittedBalance:
    """Fit the heat balance to the temperatures of a campaign.

    Parameters
    ----------
    campaign : Campaign
        Records of the conditions below only.
    springs : sequence of BothDraws
        Posterior of either branch of each condition, in the order of the campaign.
    priors : PriorSet
        Of the fit.
    pooled : bool
        Whether one gain and one loss serve all conditions.
    draws : int
        From the normal approximation of the posterior at its mode.
    seed : int
    tell : callable

    Raises
    ------
    MeasurementError
        If branches of a condition overlap in time, so that there is no history to follow.
    """
    whole = histories(campaign)
    for h in whole:
        _require_a_history(h, [r for r in campaign.records if r.condition.id == h.condition.id])
    known = {name: EFFECTS[name] for name in SIMULATED_EFFECTS if name in EFFECTS}
    study = study_balance(
        campaign, lambda i: _share_along(whole[i], springs[i]), priors, pooled=pooled, effects=known, seed=seed,
        progress=tell,
    )  # fmt: skip
    assert study is not None  # the conditions have time and current
    final = study.final
    rng = np.random.default_rng(np.random.SeedSequence([seed, 23]))
    theta = final.hypothesis.space.constrain(rng.multivariate_normal(final.z, final.covariance, draws))
    remarks = []
    if any("resistance" in h.inputs for h in whole):
        remarks.append(
            "The resistance was recorded and is in the fitted balance; simulated currents meet its usual value."
        )
    return FittedBalance(study, theta, whole, pooled, tuple(remarks))


def _require_a_history(history: History, records: Sequence[Record]) -> None:
    """Refuse branches that take turns in time far more often than they were swept."""
    sweeps = sum(np.unique(r.inputs["segment"]).size for r in records)
    if np.unique(history.inputs["segment"]).size > sweeps:
        raise MeasurementError(
            f"heating and cooling of {history.condition.id!r} overlap in time",
            expected="branches that follow each other, so that the temperature has one history",
            remedy="give their files one clock, or leave the condition out with --condition",
        )


def _share_along(history: History, spring: BothDraws) -> Mapping[str, Floats]:
    """Share of austenite along a measured history, on the median curve of the branch that was swept."""
    temperature, branch = history.inputs["temperature"], history.inputs["branch"]
    shares = {b: share_of(spring.of(b), temperature, median=True) for b in Branch}
    return {
        "share": np.where(
            branch == BRANCH_SIGN[Branch.HEATING], shares[Branch.HEATING], shares[Branch.COOLING]
        )
    }
