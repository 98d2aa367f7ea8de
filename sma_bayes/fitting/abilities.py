"""What a posterior knows of itself about a point, for the sampler."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.fitting.first_proposals import PriorOfCurve, first_mixture
from sma_bayes.fitting.linearised import LinearisedResponse
from sma_bayes.fitting.posterior_coordinates import NoiseScaledCoordinates, PredictiveCoordinates
from sma_bayes.sampling.density import Linearised
from sma_bayes.sampling.proposals import Coordinates, FactorisedMixture, PlainCoordinates

LEAST_SHARE_INVERTED = 0.99
"""Least share of draws to which predictive coordinates must lead back."""


class LinearisedPosterior(LinearisedResponse, Linearised):
    """A posterior about a point, its response linearised there."""

    def proposals(
        self, covariance: Floats, rng: np.random.Generator
    ) -> Iterator[tuple[Coordinates, FactorisedMixture]]:
        """In the model's parameters, then in what the model predicts, both relative to their spread given the noise."""
        mixture = None
        for inner in self._coordinates_of_the_model():
            try:
                coordinates = NoiseScaledCoordinates.about(self, inner)
                # what is linear tells of the noise the same in all coordinates
                mixture = mixture or first_mixture(coordinates, self.z, covariance, rng)
            except np.linalg.LinAlgError:
                continue
            yield coordinates, mixture

    def _coordinates_of_the_model(self) -> Iterator[Coordinates]:
        """Each built when those before did not do."""
        if self.count == 0:
            return
        yield PlainCoordinates()
        predictive = PredictiveCoordinates.at(self)
        if predictive is not None:
            yield predictive

    def coordinates_over(self, z: Floats) -> Coordinates | None:
        """What the model predicts in as many samples as lead back to nearly all draws (N, D).

        Where a transition fell between two samples, the curve at the mode may bend at one of them, which then seems to
        tell as much as any, while over the draws little but the two levels is told.
        """
        most = self.z.size
        while most > 0:
            coordinates = PredictiveCoordinates.at(self, most)
            if coordinates is None:
                return None
            if coordinates.forward(z)[2].mean() > LEAST_SHARE_INVERTED:
                return coordinates
            most = coordinates.scale.size - 1
        return None

    def prior_proposal(self, covariance: Floats) -> PriorOfCurve:
        return PriorOfCurve.of(self.posterior, self.z, covariance)
