"""A hierarchical model over conditions: what their curves have in common, learnt from the posterior of each.

In the coordinates phi (see `coordinates`) the curve of condition c, whose settings are x_c, is

    phi_c = x_c B + tau e_c,    e_c ~ N(0, I)

with level and slopes B (Q, P) and one scatter tau_p a coordinate. What the measurements of a condition say is its
posterior over its prior, l_c = posterior_c/prior_c. A Gaussian l_c makes B and phi_c integrate out in closed form, and
only tau is sampled. Then each draw of (B, tau) is weighted by

    w = product over c of mean of [likelihood_c(phi, nu) prior(nu)] / [Gaussian l_c(phi) q(nu | phi)]

over a few phi drawn from the Gaussian answer for condition c and noise parameters nu drawn from q, their posterior
given phi: the mean estimates without bias by how much the Gaussian form misjudged the condition. That makes the answer
exact but for the number of draws. Pareto exponents, of the ratios of each condition and of w, tell whether that can be
relied on; else the Gaussian answer stands, and is called so.

Priors: the level is normal about the mean of the records' own priors, the change over the tested range of a setting
about zero, both with the standard deviation of a record's own prior. The scatter is

    tau_p = g y_p h_p,    ln g ~ N(ln `scatter`, COMMON**2),    ln h_p ~ N(0, OWN**2)

with y_p what such a curve has by itself: 1 for logarithms of spans and rates, 4.4/rate (from 10 to 90 % of the
transformation) for midpoints, the span for levels. The common g lets few conditions tell whether they scatter by a
hundredth or by half, since every coordinate has a say in it.

Calibrations that are declared alike in all conditions are those of one rig. All is then learnt of curves as they were
logged, and what comes of it has one error of the rig, draw by draw.

References
----------
C. Andrieu, G. O. Roberts, "The pseudo-marginal approach for efficient Monte Carlo computations", Annals of Statistics
37 (2009) 697, doi 10.1214/07-AOS574: estimates without bias in place of an integral.

D. Lunn, J. Barrett, M. Sweeting, S. Thompson, "Fully Bayesian hierarchical modelling in two stages, with application to
meta-analysis", Journal of the Royal Statistical Society C 62 (2013) 551, doi 10.1111/rssc.12007: posteriors of the
parts as input of the whole.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.assess.draws import RecordDraws, as_logged
from sma_bayes.fitting.curves import Errors, calibrated_curve
from sma_bayes.fitting.fit import calibrations_of, drawn_calibration
from sma_bayes.records.types import Calibration
from sma_bayes.sampling.importance import WeightedDraws, importance_draws
from sma_bayes.sampling.weighted import resampled
from sma_bayes.studies.conditions.coordinates import CurveCoordinates, coordinates_for
from sma_bayes.studies.conditions.correction import corrected
from sma_bayes.studies.conditions.design import Design
from sma_bayes.studies.conditions.scatter import ScatterDensity, summary_of
from sma_bayes.studies.conditions.schema import StatedCorrection

PRIOR_MEDIAN_SCATTER: Final = 0.1
"""Median of the scatter before the data, as a share of the curve's characteristic scales."""
DRAWS: Final = 2000
"""Draws of level, slopes and scatter."""
LEAST_SPARE_CONDITIONS: Final = 3
"""Conditions beyond those that the slopes need, below which the scatter is called led by its prior."""


@dataclass(frozen=True, slots=True, eq=False)
class Population:
    """Posterior of the hierarchical model for one branch.

    Attributes
    ----------
    design : Design
    records : tuple of RecordDraws
        One for each condition of the design.
    coordinates : CurveCoordinates
    density : ScatterDensity
    coefficients : ndarray, shape (S, Q, P)
        Level and slopes.
    scatter : ndarray, shape (S, P)
    phi : ndarray, shape (C, S, P)
        Coordinates of each measured condition, partially pooled.
    sampling : WeightedDraws
        Of ``ln tau``.
    correction : StatedCorrection
    calibration : mapping
        Gain and shift of each calibration that all conditions share, for each draw; empty where they share none. In
        `coefficients` and `phi` they are not.
    """

    design: Design
    records: tuple[RecordDraws, ...]
    coordinates: CurveCoordinates
    density: ScatterDensity
    coefficients: Floats
    scatter: Floats
    phi: Floats
    sampling: WeightedDraws
    correction: StatedCorrection
    calibration: Errors

    def parameters(self, phi: Floats) -> Floats:
        """Parameters (S, P) of curves at coordinates (S, P), with the errors of calibrations that conditions share."""
        theta = self.coordinates.to_parameters(phi)
        return calibrated_curve(self.coordinates.model, theta, self.calibration)

    @property
    def level(self) -> Floats:
        """Coordinates (S, P) at the least value of each setting, with these errors."""
        return self.coordinates.to_coordinates(self.parameters(self.coefficients[:, 0]))

    @property
    def prior_led(self) -> bool:
        """Whether so few conditions are to spare that the scatter is led by its prior."""
        return self.design.spare < LEAST_SPARE_CONDITIONS


def population_of(
    design: Design,
    records: Sequence[RecordDraws],
    seed: np.random.SeedSequence,
    *,
    scatter: float = PRIOR_MEDIAN_SCATTER,
) -> Population:
    """Learn the hierarchical model.

    Parameters
    ----------
    design : Design
    records : sequence of RecordDraws
        Of one branch, one for each condition of the design, with the same channels and units.
    seed : numpy.random.SeedSequence
    scatter : float
        Median of the prior of the scatter, as a share of the curves' characteristic scales.
    """
    shared, learnt = shared_calibration(records), tuple(records)
    if shared:
        learnt = tuple(map(as_logged, records))
    coordinates = coordinates_for(learnt)
    moments = [coordinates.prior_moments(r.priors) for r in learnt]
    density = ScatterDensity(
        matrix=design.matrix,
        summaries=tuple(
            summary_of(coordinates.to_coordinates(r.curve_theta), *m)
            for r, m in zip(learnt, moments, strict=True)
        ),
        centre=np.mean([m for m, _ in moments], axis=0),
        width=np.mean([np.sqrt(np.diag(c)) for _, c in moments], axis=0),
        scale=scatter * coordinates.characteristic_scales(learnt),
        labels=coordinates.labels,
    )
    sample_seed, draw_seed, calibration_seed = seed.spawn(3)
    starts = [np.log(density.scale), np.log(0.1 * density.scale), np.log(3.0 * density.scale)]
    sampling = importance_draws(density, starts, np.full(density.scale.size, 2.0), sample_seed)
    rng = np.random.default_rng(draw_seed)
    tau = np.exp(sampling.z[resampled(sampling.log_weight, DRAWS, rng)])
    coefficients = density.coefficients(rng, tau)
    phi, kept, correction = corrected(density, coordinates, learnt, coefficients, tau, rng)
    return Population(
        design,
        tuple(records),
        coordinates,
        density,
        coefficients[kept],
        tau[kept],
        phi[:, kept],
        sampling,
        correction,
        drawn_calibration(shared, np.random.default_rng(calibration_seed), len(kept)),
    )


def shared_calibration(records: Sequence[RecordDraws]) -> dict[str, Calibration]:
    """Calibrations of records for which they are declared alike; nothing where they differ."""
    first, *others = (calibrations_of(r.record) for r in records)
    return first if all(other == first for other in others) else {}
