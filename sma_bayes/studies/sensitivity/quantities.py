"""What a fit reports of a record, as draws: parameters, stiffness, transformation temperatures."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Final, Literal

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.assess.draws import RecordDraws
from sma_bayes.assess.transformation import temperatures_of_draws, transformation_channel
from sma_bayes.fitting.curves import calibrated_parameters, errors_of
from sma_bayes.fitting.posterior import Posterior, Weights
from sma_bayes.parameters.roles import Role
from sma_bayes.quantities import unit_text
from sma_bayes.runs.shown import in_unit_of_channel

Kind = Literal["parameter", "noise", "curve", "transformation"]
"""Parameters of the curve, those of the noise, values of curves, start and finish of the transformation."""
DEFAULT_TEMPERATURES: Final = 3
"""Temperatures at which a curve is told where none are asked for."""
TRIMMED_QUANTILES: Final = (0.005, 0.995)
"""Draws beyond these quantities' quantiles count as lying there where a mean or a standard deviation is told: a
stiffness that is a ratio may have neither."""


@dataclass(frozen=True, slots=True, eq=False)
class QuantityDraws:
    """Draws of one number that a fit reports.

    Attributes
    ----------
    name, channel, unit, meaning : str
    kind : str
        See `Kind`.
    draws : ndarray, shape (S,)
        [unit]; not finite where it is not defined.
    temperature : float or None
        Of a value of a curve [unit of temperature].
    quantity : str
        Quantity whose unit is a factor of `unit`; empty where none is.
    difference : bool
        Of a temperature: whether it is the difference of two.
    """

    name: str
    kind: Kind
    channel: str
    unit: str
    meaning: str
    draws: Floats
    temperature: float | None = None
    quantity: str = ""
    difference: bool = True

    @property
    def tamed(self) -> Floats:
        """Draws (S,) with those far out at `TRIMMED_QUANTILES`, and those that are not finite at the median."""
        finite = np.isfinite(self.draws)
        if not finite.any():
            return np.zeros(self.draws.size)
        low, middle, high = np.quantile(self.draws[finite], (TRIMMED_QUANTILES[0], 0.5, TRIMMED_QUANTILES[1]))
        return np.clip(np.where(finite, self.draws, middle), low, high)


def quantities_of(draws: RecordDraws, at: Sequence[float], *, stiffness: bool) -> tuple[QuantityDraws, ...]:
    """All numbers of a record.

    Parameters
    ----------
    draws : RecordDraws
    at : sequence of float
        Temperatures at which stiffness is told, or what was measured where none follows [unit of temperature].
    stiffness : bool
        Whether the fit gives a stiffness.
    """
    found = [*_parameters(draws), *_extremes(draws, stiffness), *_values(draws, at, stiffness)]
    channel = transformation_channel(draws.record)
    if channel is not None:
        found += [
            QuantityDraws(t.name, "transformation", channel, t.unit, t.meaning, t.draws, difference=False)
            for t in temperatures_of_draws(draws.curves, channel)
        ]
    return tuple(found)


def stated_temperatures(draws: RecordDraws) -> tuple[float, ...]:
    """Temperatures that are told unasked: even ones between the measured ends, to four digits."""
    inner = np.linspace(draws.coldest, draws.hottest, DEFAULT_TEMPERATURES + 2)[1:-1]
    return tuple(float(f"{t:.4g}") for t in inner)


def _parameters(draws: RecordDraws) -> Iterator[QuantityDraws]:
    posterior = draws.posterior
    facts = {f.name: f for f in posterior.model.facts}
    noise = {int(i): c for c, at in posterior.layout[0].noise.items() for i in at}
    for sizes in (posterior.layout[0].size, posterior.layout[0].between):
        noise |= {i: c for c, i in sizes.items()}
    curve = set(posterior.layout[0].model.tolist())
    for i, p in enumerate(posterior.space.parameters):
        if p.fixed is not None:
            continue
        fact = facts.get(p.name)
        channel = noise.get(i, "") if fact is None else fact.channel
        role = None if fact is None else fact.role
        yield QuantityDraws(
            p.name,
            "parameter" if i in curve else "noise",
            channel,
            p.unit,
            p.meaning,
            np.asarray(draws.theta[:, i]),
            quantity=draws.quantities.get(channel, "") if in_unit_of_channel(p.name, channel, role) else "",
            difference=role is not Role.MIDPOINT,
        )


def _extremes(draws: RecordDraws, stiffness: bool) -> list[QuantityDraws]:
    if not stiffness:
        return []
    curve, where = np.abs(draws.curve("stiffness", draws.grid())), "over the measured temperatures"
    name = draws.quantities["stiffness"]
    return [
        QuantityDraws(
            f"{word} {name}",
            "curve",
            "stiffness",
            draws.units["stiffness"],
            f"{word} {name} {where}",
            values,
            quantity=name,
        )
        for word, values in (("least", curve.min(axis=1)), ("greatest", curve.max(axis=1)))
    ]


def _values(draws: RecordDraws, at: Sequence[float], stiffness: bool) -> Iterator[QuantityDraws]:
    channels = ["stiffness"] if stiffness else [c for c in draws.channels if c != "stiffness"]
    degrees = unit_text(draws.units["temperature"])
    for channel in channels:
        values = draws.curve(channel, np.asarray(at, dtype=float))
        name, unit = draws.quantities[channel], draws.units[channel]
        yield from [
            QuantityDraws(
                f"{name} at {t:g} {degrees}", "curve", channel, unit, f"{name} of the curve at {t:g} {degrees}",
                values[:, i], t, name,
            )
            for i, t in enumerate(at)
        ]  # fmt: skip


@dataclass(frozen=True, eq=False)
class Densities:
    """Log densities of the draws of a record, taken apart.

    Attributes
    ----------
    prior : ndarray, shape (S, D)
        Of each sampled parameter, in the sampled coordinates.
    readings : mapping of str to ndarray, shape (S, n)
        Of each reading given those before it and the discrepancy, by channel.
    """

    prior: Floats
    readings: Mapping[str, Floats] = field(default_factory=dict)

    @property
    def log_prior(self) -> Floats:
        """Of all parameters together, shape (S,)."""
        return np.asarray(self.prior.sum(axis=1))

    @property
    def log_likelihood(self) -> Floats:
        """Of all readings together, shape (S,)."""
        return np.asarray(np.sum([r.sum(axis=1) for r in self.readings.values()], axis=0))


def densities_of(draws: RecordDraws) -> Densities:
    """Prior and likelihood at the draws of a record."""
    posterior, theta = draws.posterior, draws.before_calibration
    z = posterior.space.unconstrain(theta)
    prior = [
        p.prior.log_density(theta[:, i]) + p.prior.transform.log_jacobian(z[:, k])
        for k, (i, p) in enumerate(zip(posterior.space.free_index, posterior.space.free, strict=True))
    ]
    weights: Weights = (draws.weights,) if draws.weights else ()
    with np.errstate(all="ignore"):
        (readings,) = posterior.pointwise_log_likelihood(theta, weights)
    return Densities(np.stack(prior, axis=1), readings)


def of_other_draws(
    draws: RecordDraws, theta: Floats, weights: Mapping[str, Floats], posterior: Posterior | None = None
) -> RecordDraws:
    """Other draws (S', P) of the record, of its posterior or another one, with the same errors of its calibrations."""
    errors = errors_of(draws.calibration, slice(len(theta)))
    carried = calibrated_parameters(draws.posterior, theta, errors)
    return replace(
        draws, posterior=posterior or draws.posterior, theta=carried, weights=weights, calibration=errors
    )
