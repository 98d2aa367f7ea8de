"""A hypothesis: the simulation, perhaps with effects around it, and what is believed about its parameters."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from sma_bayes.arrays import Floats
from sma_bayes.effects.transformation import SLOPED
from sma_bayes.effects.types import Effect, Scales, with_effects
from sma_bayes.parameters.distributions import LogNormal, Normal
from sma_bayes.parameters.priors_file import PriorSet
from sma_bayes.parameters.scales import RecordScales
from sma_bayes.parameters.space import Parameter, ParameterSpace
from sma_bayes.records.drive import switched_at
from sma_bayes.records.history import History
from sma_bayes.records.types import Branch, Campaign, Record
from sma_bayes.response.base import ResponseModel
from sma_bayes.response.modified_sigmoid import ModifiedSigmoid
from sma_bayes.response.simulation import Simulation

Positions = NDArray[np.intp]
Bend = Callable[[Mapping[str, Floats], Mapping[str, Floats]], dict[str, Floats]]
"""Channels of a simulation and the inputs that they were predicted for, to channels of other curves."""

SWITCHING_SHIFT = 0.2
"""Shift of a switching by which what it moves is found, in steps of the record."""


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """What may have made the measurements, up to noise.

    Attributes
    ----------
    histories : tuple of History
        All with the same channels.
    simulation : Simulation
    effects : tuple of Effect
        Around the simulation, see `with_effects`; their parameters serve all histories, in this order.
    space : ParameterSpace
        Those of the simulation first, then those of each effect.
    layout : tuple of ndarray of int
        For each history, positions of the simulation's parameters.
    scales : Scales
    steady_noise : bool
        Whether neither one cycle unlike the others nor a jump may have made noise remember; see `block_noise`.
    """

    histories: tuple[History, ...]
    simulation: Simulation
    effects: tuple[Effect, ...]
    space: ParameterSpace
    layout: tuple[Positions, ...]
    scales: Scales
    _base: int = field(default=0)
    steady_noise: bool = False

    @property
    def channels(self) -> tuple[str, ...]:
        """Channels that are predicted."""
        return self.simulation.channels

    @property
    def effect_positions(self) -> dict[str, Positions]:
        """Positions of each effect's parameters, by its id."""
        out, at = {}, self._base
        for effect in self.effects:
            count = len(effect.parameters(self.scales))
            out[effect.id] = np.arange(at, at + count)
            at += count
        return out

    def positions(self, history: int) -> Positions:
        """Positions of all parameters on which a history depends."""
        return np.concatenate([self.layout[history], np.arange(self._base, len(self.space.parameters))])

    def predict(
        self,
        theta: Floats,
        history: int,
        inputs: Mapping[str, Floats] | None = None,
        bend: Bend | None = None,
    ) -> dict[str, Floats]:
        """Response of each channel along a history.

        Parameters
        ----------
        theta : ndarray, shape (..., P)
        history : int
        inputs : mapping of str to ndarray, optional
            In place of those of the history.
        bend : callable, optional
            Alters the curves of the simulation; the effects act on what comes of it.

        Returns
        -------
        dict of str to ndarray, shape (..., n)
        """
        applied = self.histories[history].inputs if inputs is None else inputs
        if self.simulation.sloped:
            applied = {**applied, SLOPED: np.ones(1)}
        base = theta[..., self.layout[history]]

        def response(given: Mapping[str, Floats]) -> dict[str, Floats]:
            out = self.simulation.predict(base, given)
            return out if bend is None else bend(out, given)

        at = self.effect_positions
        whole = with_effects(response, [(e, theta[..., at[e.id]]) for e in self.effects])
        with np.errstate(over="ignore", invalid="ignore"):
            return whole(applied)

    def switchings(self, theta: Floats, history: int) -> Floats:
        """By how much each switching of the current moves the temperature, for a whole step of the record, (n, K).

        Empty where the current is not switched, or too often for its instants to be told one by one. Two for each
        where earlier and later instants fall into different steps.
        """
        inputs = self.histories[history].inputs
        at = switched_at(inputs)
        if "temperature" not in self.channels or not at.size:
            return np.empty((self.histories[history].n, 0))
        near = np.abs(np.arange(self.histories[history].n) - at[:, None]) <= 1
        plain, later, earlier = (
            self.predict(theta, history, {**inputs, "switching_shift": by * near})["temperature"]
            for by in (np.zeros(1), SWITCHING_SHIFT, -SWITCHING_SHIFT)
        )
        forth, back = (later - plain) / SWITCHING_SHIFT, (plain - earlier) / SWITCHING_SHIFT
        unlike = np.any(np.abs(forth - back) > 1e-3 * np.abs(forth).max(), axis=1)
        return np.concatenate([forth, back[unlike]]).T

    def extended(self, effect: Effect) -> Hypothesis:
        """The same with one more effect around it."""
        return self.with_effects((*self.effects, effect))

    def with_effects(self, effects: Sequence[Effect]) -> Hypothesis:
        """The same simulation with these effects."""
        parameters = list(self.space.parameters[: self._base])
        for effect in effects:
            for p in effect.parameters(self.scales):
                parameters.append(replace(p, name=f"{effect.id}.{p.name}"))
        return replace(self, effects=tuple(effects), space=ParameterSpace(tuple(parameters)))

    def on(self, kept: Sequence[NDArray[np.bool_]]) -> Hypothesis:
        """The same hypothesis about a part of the samples; a history of which nothing is left goes.

        Priors stay as they are.
        """
        some = [i for i, k in enumerate(kept) if k.any()]
        parts = tuple(self.histories[i].part(kept[i]) for i in some)
        return replace(self, histories=parts, layout=tuple(self.layout[i] for i in some))


def baseline(
    campaign: Campaign,
    histories: Sequence[History],
    priors: PriorSet,
    *,
    pooled: bool,
    model: type[ResponseModel] = ModifiedSigmoid,
) -> Hypothesis:
    """The simulation without any effect.

    Parameters
    ----------
    campaign : Campaign
        What the histories were made of; its records give the scales of the priors.
    histories : sequence of History
    priors : PriorSet
    pooled : bool
        Whether one set of parameters a branch serves all conditions, or each condition has its own.
    model : type of ResponseModel
        Of the response of either branch.

    Raises
    ------
    PriorError
        If a parameter has no prior.
    """
    channels = tuple(c for c in histories[0].channels if all(c in h.channels for h in histories))
    mechanical = tuple(c for c in channels if c != "temperature")
    shared = [
        replace(r, observed={c: r.observed[c] for c in mechanical or r.channels}) for r in campaign.records
    ]
    simulation = Simulation(channels, model.made_for(shared) if mechanical else None)
    scales = Scales.of(histories)
    parameters: list[Parameter] = []
    layout = []
    groups = [None] if pooled else [h.condition.id for h in histories]
    for group in groups:
        tag = "" if group is None else f"[{group}]"
        at = len(parameters)
        if simulation.mechanical is not None:
            facts = simulation.mechanical.model.parameters(histories[0].units)
            for branch in Branch:
                records = _records(campaign, group, branch)
                own = RecordScales.of(records)
                for fact in facts:
                    p = priors.parameter(fact.in_record(records[0].quantity), branch, own)
                    parameters.append(replace(p, name=f"{fact.name} {branch.value}{tag}"))
        if simulation.thermal is not None:
            parameters += _thermal(scales, tag)
        layout.append(np.arange(at, len(parameters)))
    if simulation.thermal is not None:  # how the rig switches and logs is the same in all conditions
        layout = [np.append(own, len(parameters)) for own in layout]
        parameters.append(_switching())
    if pooled:
        layout = layout * len(histories)
    return Hypothesis(
        tuple(histories),
        simulation,
        (),
        ParameterSpace(tuple(parameters)),
        tuple(layout),
        scales,
        len(parameters),
    )


def _records(campaign: Campaign, condition: str | None, branch: Branch) -> list[Record]:
    """Records of a branch; where there are none, those of the other one set the scales just as well."""
    mine = [r for r in campaign.records if condition in (None, r.condition.id)]
    return [r for r in mine if r.branch is branch] or mine


def _thermal(scales: Scales, tag: str) -> list[Parameter]:
    heating = max(scales.level["rate"], 1e-9)
    gain = heating / max(scales.level["current"], 1e-9) ** 2
    source = "the greatest rate seen, to an order of magnitude"
    return [
        Parameter(f"gain{tag}", "K/(s A^2)", "heating rate of 1 A, R/(m c)", LogNormal(gain, 1.5), source),
        Parameter(
            f"loss{tag}",
            "1/s",
            "rate of cooling, h A/(m c)",
            LogNormal(heating / max(scales.span["temperature"], 1e-9), 1.5),
            source,
        ),
        Parameter(
            f"ambient{tag}",
            "degC",
            "temperature of the surroundings",
            Normal(scales.low["temperature"], 0.2 * scales.span["temperature"]),
            "near the coldest reading",
        ),
    ]


def _switching() -> Parameter:
    """Of `JouleHeating`."""
    return Parameter(
        "switching",
        "1",
        "share of a step of the record before the current changes",
        Normal(0.5, 0.4),
        "1: each reading holds until the next, 0: since the last; beyond, where it is an average or late",
    )
