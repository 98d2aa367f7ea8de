"""The posterior of one record as the study of conditions takes it up: draws, the prior that they hold, what was set."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from sma_bayes.assess.bands import band_channels, path_stiffness
from sma_bayes.assess.path import path_remark
from sma_bayes.parameters.distributions import Distribution
from sma_bayes.quantities import Floats
from sma_bayes.records.types import Branch, Condition
from sma_bayes.response.modified_sigmoid import ModifiedSigmoid, channel_unit
from sma_bayes.results.fit import Fit

GRID = 161
"""Temperatures at which a curve is given."""


@dataclass(frozen=True, slots=True, eq=False)
class RecordDraws:
    """Posterior draws of one record.

    Attributes
    ----------
    condition : Condition
    branch : Branch
    channels : tuple of str
        Observed channels.
    quantities : mapping of str to str
        Name of the quantity behind each channel, stiffness included where force and displacement give it.
    units : mapping of str to str
        Unit of temperature and of each of those channels.
    specimen : bool
        Whether stress and strain stand in for force and displacement.
    theta : ndarray, shape (S, P)
        Parameters of the modified sigmoid, in the order of `model.parameter_names`.
    priors : tuple of Distribution
        Prior of each parameter.
    noise : str
        Name of the noise model.
    noise_theta : mapping of str to ndarray, shape (S, k)
        Noise parameters of each observed channel, standard deviation first.
    temperature : ndarray, shape (n,)
        Of the samples [unit of temperature].
    observed : mapping of str to ndarray, shape (n,)
        Measurements.
    path : str
        What dF/dX means on the rig: kind of a `PathRemark`.
    converged : bool
    """

    condition: Condition
    branch: Branch
    channels: tuple[str, ...]
    quantities: Mapping[str, str]
    units: Mapping[str, str]
    specimen: bool
    theta: Floats
    priors: tuple[Distribution, ...]
    noise: str
    noise_theta: Mapping[str, Floats]
    temperature: Floats
    observed: Mapping[str, Floats]
    path: str
    converged: bool

    @property
    def key(self) -> str:
        """Key of the record: ``<condition>-<branch>``."""
        return f"{self.condition.id}-{self.branch.value}"

    @property
    def model(self) -> ModifiedSigmoid:
        """Model whose parameters were drawn."""
        return ModifiedSigmoid(self.channels)

    @property
    def size(self) -> int:
        """Number of draws."""
        return len(self.theta)

    @property
    def coldest(self) -> float:
        """Lowest measured temperature [unit of temperature]."""
        return float(self.temperature.min())

    @property
    def hottest(self) -> float:
        """Highest measured temperature [unit of temperature]."""
        return float(self.temperature.max())

    def parameter(self, name: str) -> Floats:
        """Draws of one parameter, shape (S,)."""
        return np.asarray(self.theta[:, self.model.parameter_names.index(name)])

    def grid(self) -> Floats:
        """Even temperatures over what was measured, shape (m,)."""
        return np.linspace(self.coldest, self.hottest, GRID)

    def curve(self, channel: str, temperature: Floats) -> Floats:
        """Curve of a channel for each draw, shape (S, m); see `curve_of`."""
        return curve_of(self.model, self.theta, channel, temperature)


def curve_of(model: ModifiedSigmoid, theta: Floats, channel: str, temperature: Floats) -> Floats:
    """Curve of a channel, stiffness also where it follows from force and displacement.

    Parameters
    ----------
    model : ModifiedSigmoid
    theta : ndarray, shape (S, P)
    channel : str
    temperature : ndarray, shape (m,)

    Returns
    -------
    ndarray, shape (S, m)
    """
    if channel not in model.channels:
        return path_stiffness(model, theta, temperature)
    with np.errstate(over="ignore"):
        return model.predict(theta, {"temperature": temperature})[channel]


def record_draws(fit: Fit, record: int = 0) -> RecordDraws:
    """Draws of one record of a fit.

    Parameters
    ----------
    fit : Fit
    record : int
        Which of the records that share the posterior.
    """
    r, place = fit.records[record], fit.posterior.layout[record]
    theta = fit.calibrated(record)
    noise = {c: theta[:, at] for c, at in place.noise.items()}
    shown = band_channels(r)
    return RecordDraws(
        condition=r.condition,
        branch=r.branch,
        channels=r.channels,
        quantities={c: r.quantity(c) for c in shown},
        units={"temperature": r.units["temperature"], **{c: channel_unit(r.units, c) for c in shown}},
        specimen=r.specimen,
        theta=theta[:, place.model],
        priors=tuple(fit.posterior.space.parameters[i].prior for i in place.model),
        noise=fit.posterior.noise.name,
        noise_theta=noise,
        temperature=r.temperature,
        observed=r.observed,
        path=path_remark(r, {c: float(np.median(v[:, 0])) for c, v in noise.items()}).kind,
        converged=fit.converged,
    )
