"""The curve under conditions that were not measured: by the hierarchical model, and by hand for comparison."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.assess.bands import PREDICTIVE, QUANTILES, Band, new_samples, simultaneous_band
from sma_bayes.assess.draws import GRID, RecordDraws, curve_of
from sma_bayes.fitting.curves import CurveDraws, quantiles
from sma_bayes.parameters.roles import Role
from sma_bayes.records.types import Condition
from sma_bayes.studies.conditions.design import Design
from sma_bayes.studies.conditions.features import CHANNELS, Feature, ratio
from sma_bayes.studies.conditions.population import Population


@dataclass(frozen=True, slots=True, eq=False)
class Prediction:
    """Draws of the curve of one branch under one condition.

    Attributes
    ----------
    condition : Condition
    population : Population
    theta : ndarray, shape (S, P)
        Parameters of the model.
    """

    condition: Condition
    population: Population
    theta: Floats

    @property
    def reference(self) -> RecordDraws:
        """A measured record, for channels, units and branch, which all share."""
        return self.population.records[0]

    def curve(self, channel: str, temperature: Floats) -> Floats:
        """Curves (S, m) of a channel [its unit] at temperatures (m,)."""
        return curve_of(self.reference.posterior.model, self.theta, channel, temperature)

    def covered(self) -> tuple[float, float]:
        """Temperatures between which every condition was measured [unit of temperature]; may be empty."""
        records = self.population.records
        return max(r.coldest for r in records), min(r.hottest for r in records)

    def grid(self) -> Floats:
        """Even temperatures over all that was measured in any condition, shape (m,)."""
        records = self.population.records
        return np.linspace(min(r.coldest for r in records), max(r.hottest for r in records), GRID)

    def band(self, channel: str, temperature: Floats, rng: np.random.Generator) -> Band:
        """Bands of a channel; the noise of a new measurement is that of a measured condition, any alike."""
        curve = self.curve(channel, temperature)
        low, high = self.covered()
        measured = channel in self.reference.channels
        noise = (
            _noise(self, channel, temperature, rng) if measured else np.full((1, temperature.size), np.nan)
        )
        predictive = quantiles(curve + noise, list(PREDICTIVE.values()), axis=0)
        return Band(
            channel=channel,
            unit=self.reference.units[channel],
            temperature=temperature,
            curve=dict(zip(QUANTILES, quantiles(curve, list(QUANTILES.values()), axis=0), strict=True)),
            simultaneous=simultaneous_band(curve),
            predictive=dict(zip(PREDICTIVE, predictive, strict=True)),
            extrapolated=(temperature < low - 1e-12) | (temperature > high + 1e-12),
            derived=not measured,
        )


def predict(population: Population, condition: Condition, rng: np.random.Generator) -> Prediction:
    """Draw curves of a condition from what the measured ones have in common.

    Raises
    ------
    MeasurementError
        If the measured conditions say nothing about it.
    """
    population.design.check(condition)
    mean = np.einsum("q,sqp->sp", population.design.row(condition), population.coefficients)
    phi = mean + population.scatter * rng.standard_normal(mean.shape)
    return Prediction(condition, population, population.parameters(phi))


def _noise(prediction: Prediction, channel: str, temperature: Floats, rng: np.random.Generator) -> Floats:
    """Noise of single samples (S, m), each draw with the noise parameters of some measured condition."""
    records, size = prediction.population.records, len(prediction.theta)
    whose = rng.integers(len(records), size=size)
    noise = np.empty((size, temperature.size))
    for i, record in enumerate(records):
        rows = np.flatnonzero(whose == i)
        theta = record.theta[rng.integers(record.size, size=rows.size)]
        theta[:, record.posterior.layout[0].model] = prediction.theta[rows]
        curves = CurveDraws(record.posterior, theta)
        noise[rows] = new_samples(curves, channel, temperature, rng) - curves.curve(channel, temperature)
    return noise


@dataclass(frozen=True, slots=True)
class Neighbours:
    """Two measured conditions between which another one lies, alike in all settings but one.

    Attributes
    ----------
    below, above : int
        Positions in the design.
    share : float
        How far from the one to the other, 0 to 1.
    """

    below: int
    above: int
    share: float


def neighbours(design: Design, condition: Condition) -> Neighbours | None:
    """Nearest conditions on either side in one setting; None where there are none that agree in all others."""
    x, matrix = design.row(condition)[1:], design.matrix[:, 1:]
    for v in range(x.size):
        alike = np.flatnonzero(np.isclose(np.delete(matrix, v, axis=1), np.delete(x, v)).all(axis=1))
        below = [int(i) for i in alike if matrix[i, v] <= x[v]]
        above = [int(i) for i in alike if matrix[i, v] > x[v]]
        if below and above:
            a = max(below, key=lambda i: float(matrix[i, v]))
            b = min(above, key=lambda i: float(matrix[i, v]))
            return Neighbours(a, b, float((x[v] - matrix[a, v]) / (matrix[b, v] - matrix[a, v])))
    return None


def curve_by_hand(
    records: Sequence[RecordDraws], between: Neighbours, channel: str, temperature: Floats
) -> Floats:
    """Straight line between the curves of two conditions, at each temperature; shape (S, m)."""
    a, b = (records[i].curve(channel, temperature) for i in (between.below, between.above))
    size = min(len(a), len(b))
    return (1.0 - between.share) * a[:size] + between.share * b[:size]


def parameters_by_hand(
    records: Sequence[RecordDraws], between: Neighbours, channel: str, temperature: Floats
) -> Floats:
    """Curve of the parameters A and B on a straight line between those of two conditions; shape (S, m)."""
    a, b = (records[i].curve_theta for i in (between.below, between.above))
    size = min(len(a), len(b))
    theta = (1.0 - between.share) * a[:size] + between.share * b[:size]
    return curve_of(records[0].posterior.model, theta, channel, temperature)


def predicted_features(prediction: Prediction) -> tuple[Feature, ...]:
    """Midpoints, and least and greatest stiffness over the temperatures at which every condition was measured."""
    reference, condition = prediction.reference, prediction.condition
    branch, model = reference.branch.value, reference.posterior.model
    midpoints = {c: model.with_role(Role.MIDPOINT, c) for c in CHANNELS}
    out = [
        Feature(
            "midpoint", condition, branch, channel, reference.units["temperature"],
            prediction.theta[:, reference.names.index(name)],
            f"temperature of the midpoint of {reference.quantities.get(channel, channel)}, {name}",
        )
        for channel, name in midpoints.items() if name is not None
    ]  # fmt: skip
    low, high = prediction.covered()
    if "stiffness" not in reference.quantities or not low < high:
        return tuple(out)
    curve = np.abs(prediction.curve("stiffness", np.linspace(low, high, GRID)))
    what, unit = reference.quantities["stiffness"], reference.units["stiffness"]
    where = "over the temperatures at which every condition was measured"
    least, greatest = curve.min(axis=1), curve.max(axis=1)
    out += [
        Feature(name, condition, branch, "stiffness", its_unit, draws, f"{words} {what} {where}", True)
        for name, its_unit, draws, words in (
            ("least_stiffness", unit, least, "least"),
            ("greatest_stiffness", unit, greatest, "greatest"),
            ("stiffness_ratio", "1", ratio(greatest, least), "greatest over least"),
        )
    ]
    return tuple(out)
