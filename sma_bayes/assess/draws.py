"""The posterior of one record as the study of conditions takes it up: density, draws, what was set and measured."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from sma_bayes.arrays import Floats, Ints
from sma_bayes.assess.bands import band_channels
from sma_bayes.assess.path import path_remark
from sma_bayes.fitting.curves import CurveDraws, Errors, calibrated_parameters, errors_of, undone
from sma_bayes.fitting.fit import Fit, calibrations_of
from sma_bayes.fitting.posterior import Posterior
from sma_bayes.parameters.distributions import Distribution
from sma_bayes.parameters.roles import Role
from sma_bayes.records.types import Branch, Condition, Record
from sma_bayes.response.base import ResponseModel
from sma_bayes.response.modified_sigmoid import channel_unit

GRID = 161
"""Temperatures at which a curve is given."""


@dataclass(frozen=True, eq=False)
class RecordDraws:
    """Posterior draws of one record.

    Attributes
    ----------
    posterior : Posterior
        Of this record alone.
    theta : ndarray, shape (S, P)
        Draws of all its parameters, those of the noise behind those of the model; errors of a calibration included.
    converged : bool
    weights : mapping of str to ndarray, shape (S, m)
        Channel to weights of what its curve misses.
    calibration : mapping
        Gain and shift of each uncertain calibration, for each draw; see `CurveDraws`.
    measured_sweeps : ndarray, shape (S, P), or None
        Where sweeps differ, all parameters as sampled, those of the curve of the measured sweeps; see
        `sma_bayes.fitting.mean_sweep`.
    """

    posterior: Posterior
    theta: Floats
    converged: bool
    weights: Mapping[str, Floats] = field(default_factory=dict)
    calibration: Errors = field(default_factory=dict)
    measured_sweeps: Floats | None = None

    @cached_property
    def before_calibration(self) -> Floats:
        """Draws (S, P) as the likelihood has them, the errors of calibrations taken out again."""
        return calibrated_parameters(self.posterior, self.theta, undone(self.calibration))

    @property
    def record(self) -> Record:
        """What was set and measured."""
        return self.posterior.records[0]

    @property
    def condition(self) -> Condition:
        """What was set on the rig."""
        return self.record.condition

    @property
    def branch(self) -> Branch:
        """Direction of the sweep."""
        return self.record.branch

    @property
    def key(self) -> str:
        """Key of the record: ``<condition>-<branch>``."""
        return self.record.key

    @property
    def channels(self) -> tuple[str, ...]:
        """Observed channels."""
        return self.record.channels

    @property
    def names(self) -> tuple[str, ...]:
        """Parameters of the model."""
        return self.posterior.model.parameter_names

    @cached_property
    def curve_theta(self) -> Floats:
        """Draws of the parameters of the model, shape (S, number of `names`)."""
        return np.asarray(self.theta[:, self.posterior.layout[0].model])

    @property
    def priors(self) -> tuple[Distribution, ...]:
        """Priors of the parameters of the model."""
        return tuple(self.posterior.space.parameters[i].prior for i in self.posterior.layout[0].model)

    @cached_property
    def quantities(self) -> Mapping[str, str]:
        """Name of the quantity behind each channel, stiffness included where force and displacement give it."""
        return {c: self.record.quantity(c) for c in band_channels(self.record)}

    @cached_property
    def units(self) -> Mapping[str, str]:
        """Unit of temperature and of each of these channels."""
        units = self.record.units
        return {
            "temperature": units["temperature"],
            **{c: channel_unit(units, c) for c in self.quantities},
        }

    @cached_property
    def path(self) -> str:
        """What dF/dX means on the rig: kind of a `PathRemark`."""
        noise = self.posterior.layout[0].noise
        return path_remark(
            self.record, {c: float(np.median(self.theta[:, at[0]])) for c, at in noise.items()}
        ).kind

    @property
    def size(self) -> int:
        """Number of draws."""
        return len(self.theta)

    @property
    def coldest(self) -> float:
        """Lowest measured temperature [unit of temperature]."""
        return float(self.record.temperature.min())

    @property
    def hottest(self) -> float:
        """Highest measured temperature [unit of temperature]."""
        return float(self.record.temperature.max())

    def with_role(self, role: Role, channel: str) -> Floats | None:
        """Draws of the parameter of a role in a channel, shape (S,); None where the model has none."""
        at = self.posterior.model.position(role, channel)
        return None if at is None else np.asarray(self.curve_theta[:, at])

    def parameter(self, name: str) -> Floats:
        """Draws of one parameter of the model, shape (S,)."""
        return np.asarray(self.curve_theta[:, self.names.index(name)])

    def grid(self) -> Floats:
        """Even temperatures over what was measured, shape (m,)."""
        return np.linspace(self.coldest, self.hottest, GRID)

    @cached_property
    def curves(self) -> CurveDraws:
        """Curves, discrepancy and calibration included."""
        return CurveDraws(self.posterior, self.theta, self.weights, self.calibration)

    def curve(self, channel: str, temperature: Floats) -> Floats:
        """Curve of a channel for each draw, shape (S, m)."""
        return self.curves.curve(channel, temperature)

    def subset(self, which: Ints | slice) -> RecordDraws:
        """Some of the draws."""
        return replace(
            self,
            theta=self.theta[which],
            weights={c: w[which] for c, w in self.weights.items()},
            calibration=errors_of(self.calibration, which),
            measured_sweeps=None if self.measured_sweeps is None else self.measured_sweeps[which],
        )


def curve_of(model: ResponseModel, theta: Floats, channel: str, temperature: Floats) -> Floats:
    """Curve of a channel, stiffness also where it follows from force and displacement.

    Parameters
    ----------
    model : ResponseModel
    theta : ndarray, shape (S, P)
    channel : str
    temperature : ndarray, shape (m,) or (S, m)

    Returns
    -------
    ndarray, shape (S, m)
    """
    if channel not in model.channels:
        return model.stiffness(theta, {"temperature": temperature})
    with np.errstate(over="ignore"):
        return model.predict(theta, {"temperature": temperature})[channel]


def with_calibration_of(curves: CurveDraws, other: CurveDraws) -> CurveDraws:
    """Curves with the errors that calibrations have in draws of another record of the same condition.

    What thermometer and sensors of a run are off by is the same for heating and cooling, so that it cancels in what
    the branches differ by. The errors are drawn for each record; draw by draw those of the other one take their place.

    Parameters
    ----------
    curves, other : CurveDraws
        Of two branches, S and T draws.

    Returns
    -------
    CurveDraws
        The first min(S, T) draws; all of `curves` as they are where none of its calibrations is uncertain, or where
        those of the other are declared otherwise.
    """
    own, others = (calibrations_of(c.posterior.records[c.record]) for c in (curves, other))
    if not curves.calibration or own != others:
        return curves
    both = slice(min(len(curves.theta), len(other.theta)))
    theta, errors = curves.theta[both], errors_of(other.calibration, both)
    for change in (undone(errors_of(curves.calibration, both)), errors):
        theta = calibrated_parameters(curves.posterior, theta, change, curves.record)
    weights = {c: w[both] for c, w in curves.weights.items()}
    return replace(curves, theta=theta, weights=weights, calibration=errors)


def sharing_calibration(draws: RecordDraws, other: RecordDraws) -> RecordDraws:
    """Draws of a record with the errors of calibration of another's, as many; see `with_calibration_of`."""
    curves = with_calibration_of(draws.curves, other.curves)
    return replace(draws, theta=curves.theta, weights=curves.weights, calibration=curves.calibration)


def of_one_rig(records: Iterable[RecordDraws]) -> Iterator[RecordDraws]:
    """Records in which calibrations that are declared alike are those of one rig: they have the errors of the first."""
    first: list[RecordDraws] = []
    for draws in records:
        own = calibrations_of(draws.record)
        other = next((f for f in first if calibrations_of(f.record) == own), None)
        if other is None:
            first.append(draws)
        yield draws if other is None else sharing_calibration(draws, other)


def as_logged(draws: RecordDraws) -> RecordDraws:
    """Draws of a record as its instruments have it: without errors of calibrations."""
    record = replace(draws.record, calibration={})
    posterior = replace(draws.posterior, records=(record,))
    return replace(draws, posterior=posterior, theta=draws.before_calibration, calibration={})


def record_draws(fit: Fit, record: int = 0) -> RecordDraws:
    """Draws of one record of a fit.

    Parameters
    ----------
    fit : Fit
    record : int
        Which of the records that share the posterior.
    """
    whole = fit.posterior
    own = Posterior(
        (whole.records[record],),
        whole.model,
        whole.noise,
        whole.space,
        (whole.layout[record],),
        (whole.discrepancy[record],),
    )
    curves = fit.curves(record)
    measured = fit.measured_sweeps
    return RecordDraws(
        own,
        curves.theta,
        fit.converged,
        curves.weights,
        curves.calibration,
        None if measured is None else measured.reshape(curves.theta.shape),
    )
