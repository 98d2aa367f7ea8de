"""Draws of one sweep: its numbers, the errors of the common curve, and what it has of its own."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.studies.cycles.sweeps import Strand


@dataclass(frozen=True, slots=True, eq=False)
class SweepDraws:
    """Draws of one sweep.

    Attributes
    ----------
    strand : Strand
    place : int or None
        Which of its measured sweeps; None for one to come.
    numbers : ndarray, shape (S, 4)
        Beside the errors.
    errors : ndarray, shape (S, k), or None
        Of the common curve.
    own : ndarray, shape (S, m), or None
        Weights of what the sweep has of its own.
    rng : numpy.random.Generator
        Of how the curve goes on beyond what was measured.
    """

    strand: Strand
    place: int | None
    numbers: Floats
    errors: Floats | None
    own: Floats | None
    rng: np.random.Generator

    @staticmethod
    def of(
        strand: Strand, place: int | None, numbers: Floats, errors: Floats | None, rng: np.random.Generator
    ) -> SweepDraws:
        """From draws of the numbers (S, 4), and of the errors of the common curve beside which they are to be."""
        shape = strand.own_shape(place)
        own = None if shape is None else shape.draw(errors, len(numbers), rng)
        return SweepDraws(strand, place, strand.follow(place, numbers, errors), errors, own, rng)

    def expected(self) -> SweepDraws:
        """The sweep as it is expected, in place of draws; one to come with the numbers of the last."""
        shape = self.strand.own_shape(self.place)
        return replace(
            self,
            numbers=self.strand.numbers[None, -1 if self.place is None else self.place],
            errors=None if self.errors is None else np.zeros((1, self.errors.shape[1])),
            own=None if shape is None else shape.expected[None],
        )

    @property
    def ends(self) -> tuple[float, float]:
        """Lowest and highest temperature that was measured of it, or of the last where it is to come.

        Those of all sweeps where it has nothing of its own.
        """
        s = self.strand
        if self.own is None:
            return s.ends
        i = s.cycle.size - 1 if self.place is None else self.place
        own = s.record.temperature[s.starts[i] : s.starts[i] + s.lengths[i]]
        return float(own.min()), float(own.max())

    def carried(self, temperature: float) -> Floats:
        """Where a place (S,) goes that is at some temperature of the expected sweep, as its numbers change."""
        _, _, d, w = self.expected().numbers[0]
        s = self.strand
        away = (temperature - s.middle - d) * np.exp(self.numbers[:, 3] - w)
        return np.asarray(s.middle + self.numbers[:, 2] + away)

    def curve(self, temperature: Floats) -> Floats:
        """Curves (S, m) at temperatures (m,) or (S, m)."""
        curve = self.strand.curve(self.numbers, temperature, self.errors)
        shape = self.strand.own_shape(self.place)
        if self.own is None or shape is None:
            return curve
        return curve + shape.basis.function(self.own, temperature)

    def slope(self, temperature: Floats) -> Floats:
        """Their derivatives with respect to temperature."""
        slope = self.strand.slope(self.numbers, temperature, self.errors)
        shape = self.strand.own_shape(self.place)
        if self.own is None or shape is None:
            return slope
        return slope + shape.basis.function_slope(self.own, temperature)
