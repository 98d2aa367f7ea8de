"""What a fit is: the posterior, how it was started, its draws, and what they say in the parameters' own units."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from sma_bayes.account import Account
from sma_bayes.arrays import Floats
from sma_bayes.fitting.curves import CurveDraws, calibrated_parameters
from sma_bayes.fitting.model_choice import ModelChoice
from sma_bayes.fitting.noise_choice import NoiseChoice
from sma_bayes.fitting.posterior import Posterior, Weights
from sma_bayes.fitting.warm_start import WarmStart
from sma_bayes.records.types import Calibration, Record

if TYPE_CHECKING:
    from sma_bayes.sampling.ensembles import Draws

DRAWS_PER_ENSEMBLE = 500
"""Draws that are kept of each ensemble."""


@dataclass(frozen=True, eq=False)
class Fit:
    """A sampled posterior.

    Attributes
    ----------
    posterior : Posterior
    warm_start : WarmStart
    start : ndarray, shape (P,)
        Parameters at the warm start, those of the noise estimated from its residuals.
    draws : Draws
        Of what was sampled; where sweeps differ the curve is that of the measured ones (`mean_sweep`).
    noise_choice : NoiseChoice or None
        What stands beside the curve and why; None where the noise is no density of the data.
    seed : int
    z : ndarray, shape (G, N, D)
        Kept draws in sampled coordinates; see `kept`.
    account : Account
        Time that warm start and sampling took.
    chosen : bool
        Whether the noise model was chosen from the data rather than named by the user.
    model_choice : ModelChoice or None
        The response model and why, where it was chosen from the ladder.
    theta : ndarray, shape (G, N, P)
        Kept draws as parameters, before the uncertainty of calibrations is added.
    """

    posterior: Posterior
    warm_start: WarmStart
    start: Floats
    draws: Draws
    noise_choice: NoiseChoice | None
    seed: int
    z: Floats
    account: Account = field(default_factory=Account)
    chosen: bool = True
    model_choice: ModelChoice | None = None
    theta: Floats = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "theta", self.posterior.space.constrain(self.z))

    @property
    def records(self) -> tuple[Record, ...]:
        """Records that share this posterior."""
        return self.posterior.records

    @property
    def converged(self) -> bool:
        """Whether every parameter reached the target."""
        return self.draws.convergence.converged

    @property
    def flat(self) -> Floats:
        """Kept draws of all parameters, shape (G N, P)."""
        return self.theta.reshape(-1, self.theta.shape[-1])

    @cached_property
    def measured_sweeps(self) -> Floats | None:
        """Kept draws (G, N, P) of the curve of the measured sweeps, as sampled; None where sweeps do not differ."""
        as_sampled = kept(self.draws)
        return None if np.array_equal(as_sampled, self.z) else self.posterior.space.constrain(as_sampled)

    @cached_property
    def discrepancy(self) -> Weights:
        """Weights of what the curve misses, one set for each kept draw: for each record, channel to (G N, m)."""
        if not self.posterior.has_discrepancy:
            return ()
        keys = "\n".join(r.key for r in self.records)
        rng = np.random.default_rng(np.random.SeedSequence([self.seed, 6, *keys.encode()]))
        return self.posterior.draw_discrepancy(rng, self.flat)

    @property
    def every(self) -> Floats:
        """All draws of all parameters, shape (N, P); those kept where sweeps differ, as no others are of all sweeps."""
        if self.measured_sweeps is not None:
            return self.flat
        return self.posterior.space.constrain(self.draws.z.reshape(-1, self.draws.z.shape[-1]))

    def calibration_draws(self, record: int = 0) -> dict[str, tuple[Floats, Floats]]:
        """Gain and shift of each channel whose calibration is uncertain, one for each kept draw.

        A true value is ``gain * value + shift``. The errors of scale and offset are the same for all samples of
        a record, so they are not seen by the fit; they are drawn from what was declared and added to it.

        Returns
        -------
        dict
            Channel to two arrays of shape (G N,).
        """
        r = self.records[record]
        return calibration_errors(calibrations_of(r), self.seed, r.key, len(self.flat))

    def calibrated(self, record: int = 0) -> Floats:
        """Kept draws (G N, P) with the uncertainty of the calibration carried into the parameters that stand for it."""
        return calibrated_parameters(self.posterior, self.flat, self.calibration_draws(record), record)

    def every_calibrated(self, record: int = 0) -> Floats:
        """The same of all draws (N, P): of the few that are kept, moments of heavy tails are not told well."""
        r, theta = self.records[record], self.every
        errors = calibration_errors(calibrations_of(r), self.seed, r.key, len(theta))
        return calibrated_parameters(self.posterior, theta, errors, record)

    def curves(self, record: int = 0) -> CurveDraws:
        """Curves of one record, one for each kept draw: model, discrepancy and calibration together."""
        weights = self.discrepancy[record] if self.discrepancy else {}
        calibration = self.calibration_draws(record)
        return CurveDraws(self.posterior, self.calibrated(record), weights, calibration, record)


def kept(draws: Draws) -> Floats:
    """Draws (G, N, D) in sampled coordinates, evenly thinned to `DRAWS_PER_ENSEMBLE` of each ensemble at most."""
    groups, steps, walkers, d = draws.z.shape
    joined = np.swapaxes(draws.z, 1, 2).reshape(groups, walkers * steps, d)
    at = np.linspace(0, joined.shape[1] - 1, min(DRAWS_PER_ENSEMBLE, joined.shape[1])).round().astype(int)
    return np.asarray(joined[:, at])


def calibrations_of(record: Record) -> dict[str, Calibration]:
    """Calibrations that matter for the curves of a record: of its channels and of the thermometer."""
    return {c: k for c, k in record.calibration.items() if c in record.channels or c == "temperature"}


def calibration_errors(
    calibration: Mapping[str, Calibration], seed: int, key: str, size: int
) -> dict[str, tuple[Floats, Floats]]:
    """Gain and shift of each channel whose calibration is uncertain, `size` of each; see `Fit.calibration_draws`.

    Parameters
    ----------
    calibration : mapping of str to Calibration
        Of the observed channels.
    seed : int
    key : str
        Of the record.
    size : int
    """
    return drawn_calibration(
        calibration, np.random.default_rng(np.random.SeedSequence([seed, *key.encode()])), size
    )


def drawn_calibration(
    calibration: Mapping[str, Calibration], rng: np.random.Generator, size: int
) -> dict[str, tuple[Floats, Floats]]:
    """Gain and shift of each channel whose calibration is uncertain, `size` of each."""
    return {channel: _calibration_error(c, rng, size) for channel, c in calibration.items() if c.is_uncertain}


def _calibration_error(c: Calibration, rng: np.random.Generator, size: int) -> tuple[Floats, Floats]:
    relative = c.relative_scale_sd * rng.standard_normal(size)
    offset = c.offset_sd * rng.standard_normal(size)
    return 1.0 + relative, offset - c.offset * relative
