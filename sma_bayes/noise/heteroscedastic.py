"""Noise whose standard deviation is not the same everywhere: it grows with the response, or follows the slope.

Both are wrapped around any noise model of a series, so that each can be had with every kind of memory and tail:
``growing`` lets the standard deviation change from the cold to the hot end of the response, ``temperature_error``
estimates an error of the thermometer that nobody declared. As an option they follow the name of the series after a
plus sign: ``ar1+growing``, ``independent+temperature_error``, ``student_t+growing+temperature_error``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.noise.base import NoiseModel, OfSeries, Steps
from sma_bayes.noise.information import Information
from sma_bayes.parameters.space import QUANTITY, ParameterSpec

MAX_DISTANCE_RANGES = 1.5
"""How far from the middle of its observed range [ranges] a response goes on changing the standard deviation."""


@dataclass(frozen=True)
class Wrapped(OfSeries):
    """A noise model of a series, and something beside it."""

    series: NoiseModel

    suffix = ""
    """What follows the name of the series."""
    clause = ""
    """What follows its title."""

    @property
    def name(self) -> str:  # type: ignore[override]
        """As an option."""
        return f"{self.series.name}+{self.suffix}"

    @property
    def title(self) -> str:  # type: ignore[override]
        """For people."""
        return f"{self.series.title}{self.clause}"

    @property
    def is_density(self) -> bool:  # type: ignore[override]
        """As the series."""
        return self.series.is_density

    @property
    def is_gaussian(self) -> bool:  # type: ignore[override]
        """As the series."""
        return self.series.is_gaussian

    @property
    def feels_temperature(self) -> bool:
        """As the series."""
        return self.series.feels_temperature

    def parameters(self, channel: str, unit: str, time_unit: str) -> tuple[ParameterSpec, ...]:
        return self.series.parameters(channel, unit, time_unit)

    def shape_of(self, values: Floats) -> Floats:
        return self.series.shape_of(values)

    def likelihood_weight(self, shape: Floats) -> Floats:
        return self.series.likelihood_weight(shape)

    def log_density(self, e: Floats, shape: Floats, steps: Steps) -> Floats:
        return self.series.log_density(e, shape, steps)

    def total_log_density(self, e: Floats, shape: Floats, steps: Steps) -> Floats:
        return self.series.total_log_density(e, shape, steps)

    def score(self, innovation: Floats, shape: Floats) -> Floats:
        return self.series.score(innovation, shape)

    def weight(self, innovation: Floats, shape: Floats) -> Floats:
        return self.series.weight(innovation, shape)

    def location_information(self, shape: Floats) -> Floats:
        return self.series.location_information(shape)

    def innovations(self, e: Floats, shape: Floats, steps: Steps) -> Floats:
        return self.series.innovations(e, shape, steps)

    def information(self, shape: Floats, steps: Steps, inverse: Floats | None = None) -> Information:
        return self.series.information(shape, steps, inverse)

    def shape_candidates(self, steps: Steps) -> Floats:
        return self.series.shape_candidates(steps)

    def estimate(self, residual: Floats, steps: Steps) -> Floats:
        return self.series.estimate(residual, steps)

    def draw(self, rng: np.random.Generator, shape: Floats, steps: Steps) -> Floats:
        return self.series.draw(rng, shape, steps)

    def readings(
        self,
        rng: np.random.Generator,
        response: Floats,
        scale: Floats,
        shape: Floats,
        steps: Steps,
        one: float,
    ) -> Floats:
        return self.series.readings(rng, response, scale, shape, steps, one)

    def relative_scale(self, shape: Floats, response: Floats) -> Floats | None:
        return self.series.relative_scale(shape, response)


@dataclass(frozen=True)
class Growing(Wrapped):
    """The standard deviation is ``sd exp(growth (x - 1/2))`` where the response is ``x`` of its observed range.

    ``sd`` is that in the middle of the range; ``exp(growth)`` is the ratio of that at the top to that at the bottom.
    """

    suffix = "growing"
    clause = " that grows with the response"

    def parameters(self, channel: str, unit: str, time_unit: str) -> tuple[ParameterSpec, ...]:
        growth = ParameterSpec(
            f"{channel}_growth",
            "1",
            f"ln of the ratio of the noise of {QUANTITY} at the top of its range to that at the bottom",
            "growth",
            channel,
            prior={
                "family": "normal",
                "mean": 0.0,
                "sd": 1.0,
                "source": "a factor of 0.2 to 5 over the range, 90 %",
            },
        )
        return (*self.series.parameters(channel, unit, time_unit), growth)

    def shape_candidates(self, steps: Steps) -> Floats:
        series = self.series.shape_candidates(steps)
        return np.concatenate([series, np.zeros((len(series), 1))], axis=1)

    def estimate(self, residual: Floats, steps: Steps) -> Floats:
        return np.append(self.series.estimate(residual, steps), 0.0)

    def relative_scale(self, shape: Floats, response: Floats) -> Floats | None:
        at = len(self.series.parameters("", "", "")) - 1
        x = np.clip(response - 0.5, -MAX_DISTANCE_RANGES, MAX_DISTANCE_RANGES)
        with np.errstate(over="ignore"):
            own = np.exp(shape[..., at, None] * x)
        inner = self.series.relative_scale(shape, response)
        return np.asarray(own if inner is None else own * inner)


@dataclass(frozen=True)
class TemperatureError(Wrapped):
    """An error of the thermometer that was not declared: its standard deviation is a parameter of the record."""

    suffix = "temperature_error"
    clause = " with an error of the thermometer"

    @property
    def feels_temperature(self) -> bool:
        """It does."""
        return True


def temperature_sd_fact(unit: str) -> ParameterSpec:
    """The standard deviation of an error of the thermometer that was not declared."""
    return ParameterSpec(
        "temperature_sd",
        unit,
        "standard deviation of the error of the thermometer",
        "temperature_sd",
        "temperature",
        positive=True,
        prior={
            "family": "lognormal",
            "median": 0.002,
            "sigma": 1.0,
            "relative_to": "span(temperature)",
            "source": "0.04 to 1 % of the sweep, 90 %: 0.03 to 0.8 K of one of 80 K, from reading to reading",
        },
    )


WRAPPERS: dict[str, type[Wrapped]] = {w.suffix: w for w in (Growing, TemperatureError)}
"""What may follow the name of a series, in this order."""
