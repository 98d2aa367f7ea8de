"""The posterior: records, model, discrepancy, noise and priors joined into one density.

    log p(z | data) = log prior(z) + sum over records and channels of log density(measured - response)

One posterior serves one record (each condition and branch its own A and B), or several that share A and B.
What is shared is a layout of positions in the parameter vector; the sampler never knows the difference.

An error of the thermometer, declared or estimated, moves all channels of a sample together. Where noise has no memory
the true temperature of each sample is integrated out by Laplace's method. With a memory, or beside a discrepancy, it is
normal about the reading with standard deviation ``s_T``; mean and covariance of the response under it are found by
Gauss-Hermite quadrature, which holds to any order of ``s_T`` times the slope. Residuals are whitened channel by
channel by conditioning on those before. What is left has unit variance and is handed to the noise model, so that a
memory in the noise extends to the error of temperature as well.

Where a discrepancy stands beside the curve (`sma_bayes.fitting.discrepancy`) its weights are integrated out of the
density. Curves, residuals and replicated data are those of given weights, which `draw_discrepancy` draws. What sweeps
have of their own is integrated out with them; it is noise that the readings of a sweep share: replicated sweeps have it
anew, and residuals are less what is likeliest of it.
"""

from __future__ import annotations

import hashlib
import platform
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from importlib.metadata import version
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from sma_bayes.arrays import Floats
from sma_bayes.batches import batches
from sma_bayes.errors import PriorError
from sma_bayes.fitting.discrepancy import DiscrepancyBasis, between_sweeps_fact, size_fact
from sma_bayes.fitting.discrepancy_weights import NormalWeights, Whitened
from sma_bayes.fitting.sweep_functions import SweepFunctions
from sma_bayes.noise import NOISE_MODELS, NoiseModel, Steps
from sma_bayes.noise.heteroscedastic import temperature_sd_fact
from sma_bayes.parameters.priors_file import PriorSet
from sma_bayes.parameters.scales import RecordScales
from sma_bayes.parameters.space import Parameter, ParameterSpace, ParameterSpec
from sma_bayes.records.types import Record
from sma_bayes.response.base import ResponseModel
from sma_bayes.response.modified_sigmoid import ModifiedSigmoid
from sma_bayes.sampling.density import DensityFactor

if TYPE_CHECKING:
    from sma_bayes.fitting.abilities import LinearisedPosterior

GREATEST_PARAMETER = 1e60
"""Magnitude of a parameter, in the units of the package, that nothing measured comes near: products of five are finite.
Where a computed step tells no upper end of its rate, draws would go on to where they are infinite."""
CHUNK_SAMPLES = 1 << 15
"""Samples times parameter vectors that are evaluated at a time, so that intermediate arrays stay in cache."""


QUADRATURE = np.polynomial.hermite_e.hermegauss(7)
"""Nodes and weights under a standard normal (up to a factor); exact for polynomials of degree 13."""

LATENT_STEPS = 4
"""Steps of reweighted least squares to the likeliest true temperature of each sample."""
LATENT_NODES = tuple(np.roll(x, -2) for x in np.polynomial.hermite_e.hermegauss(5))
"""Nodes about the likeliest true temperature, in its standard deviations, and their weights; zero comes first."""

Weights = tuple[Mapping[str, Floats], ...]
"""For each record, channel to weights (W, m) of its discrepancy; channels without one are left out."""


@dataclass(frozen=True, slots=True, eq=False)
class ParameterIndex:
    """Where the parameters of one record stand in the parameter vector.

    Attributes
    ----------
    model : ndarray of int
        Positions of the model's parameters.
    noise : mapping of str to ndarray of int
        Positions of each channel's noise parameters.
    size : mapping of str to int
        Position of the size of each channel's discrepancy, where it has one.
    between : mapping of str to int
        Position of the size of what sweeps of each channel have of their own, where they have anything.
    temperature_sd : int or None
        Position of the standard deviation of an error of the thermometer, where it is estimated.
    """

    model: NDArray[np.intp]
    noise: Mapping[str, NDArray[np.intp]]
    size: Mapping[str, int] = field(default_factory=dict)
    temperature_sd: int | None = None
    between: Mapping[str, int] = field(default_factory=dict)

    def blocks(self) -> list[NDArray[np.intp]]:
        """Positions that belong together beside the model's: noise and discrepancy of each channel, the thermometer."""
        beside = (self.size, self.between)
        found = [
            np.append(at, [s[c] for s in beside if c in s]).astype(np.intp) for c, at in self.noise.items()
        ]
        return found if self.temperature_sd is None else [*found, np.array([self.temperature_sd])]


@dataclass(frozen=True, eq=False)
class Posterior:
    """Log-probability of batches of parameter vectors, given measurements.

    Attributes
    ----------
    records : tuple of Record
    model : ResponseModel
    noise : NoiseModel
    space : ParameterSpace
    layout : tuple of ParameterIndex
        One for each record.
    discrepancy : tuple of mapping
        For each record, channel to the basis of what the curve misses; empty where nothing stands beside the curve.
    steps : tuple of Steps
        How the samples of each record follow each other.
    """

    records: tuple[Record, ...]
    model: ResponseModel
    noise: NoiseModel
    space: ParameterSpace
    layout: tuple[ParameterIndex, ...]
    discrepancy: tuple[Mapping[str, DiscrepancyBasis], ...] = ()
    steps: tuple[Steps, ...] = field(init=False, repr=False)
    _range: tuple[Mapping[str, tuple[float, float]], ...] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "steps", tuple(Steps.of(r) for r in self.records))
        if not self.discrepancy:
            object.__setattr__(self, "discrepancy", tuple({} for _ in self.records))
        ranges = tuple({c: observed_range(r.observed[c]) for c in r.channels} for r in self.records)
        object.__setattr__(self, "_range", ranges)

    def on(
        self,
        records: Sequence[Record],
        *,
        discrepancy: Sequence[Mapping[str, DiscrepancyBasis]] = (),
        space: ParameterSpace | None = None,
    ) -> Posterior:
        """The posterior of other samples under the same priors; noise that grows does so over the range seen here.

        Parameters
        ----------
        records : sequence of Record
            As many as there are, each of other samples.
        discrepancy : sequence of mapping
            For each record, channel to the basis for these samples; none by default.
        space : ParameterSpace, optional
            In place of its own, with some parameters held.
        """
        other = replace(
            self, records=tuple(records), discrepancy=tuple(discrepancy), space=space or self.space
        )
        object.__setattr__(other, "_range", self._range)
        return other

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the sampled parameters, in the order of ``z``."""
        return tuple(p.name for p in self.space.free)

    @property
    def n(self) -> int:
        """Number of samples over all records."""
        return sum(r.n for r in self.records)

    @property
    def has_discrepancy(self) -> bool:
        """Whether anything stands beside the curve."""
        return any(self.discrepancy)

    def observed_range(self, record: int, channel: str) -> tuple[float, float]:
        """Bottom of the observed range of a channel of a record, and its width [unit of the channel]."""
        return self._range[record][channel]

    def linearised(self, z: Floats) -> LinearisedPosterior:
        """The posterior about a point (D,), its response linearised there."""
        from sma_bayes.fitting.abilities import LinearisedPosterior  # which stands on this module

        return LinearisedPosterior.at(self, z)

    def factors(self) -> tuple[DensityFactor, ...]:
        """Posteriors of its channels alone, whose product it is; none where channels have anything in common."""
        from sma_bayes.fitting.channel_factors import channel_factors  # which stands on this module

        return channel_factors(self)

    @property
    def sampled_model(self) -> NDArray[np.intp]:
        """Positions in ``theta`` of the sampled parameters of the model, which come first in ``z``."""
        free = self.space.free_index
        return free[free < len(self.model.parameter_names)]

    def log_prior(self, z: Floats) -> Floats:
        """Log density of the prior in the sampled coordinates, shape (...)."""
        return self.space.log_prior(z)

    def draw_prior(self, rng: np.random.Generator, size: int) -> Floats:
        """Draws from the prior in sampled coordinates, shape (size, D)."""
        return self.space.draw(rng, size)

    def log_prob(self, z: Floats) -> Floats:
        """Log of the unnormalised posterior density.

        Parameters
        ----------
        z : ndarray, shape (W, D)
            Sampled coordinates of W parameter vectors.

        Returns
        -------
        ndarray, shape (W,)
            Never NaN: what can't be evaluated, and parameters beyond `GREATEST_PARAMETER`, have probability zero.
        """
        z = np.atleast_2d(z)
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            theta = self.space.constrain(z)
            value = self.log_prior(z) + self.log_likelihood(theta)
            usable = (np.abs(theta) < GREATEST_PARAMETER).all(axis=1) & ~np.isnan(value)
        return np.where(usable, value, -np.inf)

    def log_likelihood(self, theta: Floats) -> Floats:
        """Log likelihood of parameter vectors ``theta`` (W, P), shape (W,); weights of discrepancies integrated out."""
        theta = np.atleast_2d(theta)
        total = np.zeros(len(theta))
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            for i, record in enumerate(self.records):
                for part in batches(len(theta), record.n, CHUNK_SAMPLES):
                    if self._is_latent(i):
                        total[part] += self._latent_log_density(theta[part], i)[0].sum(axis=1)
                        continue
                    for channel, e, scale in self._standardised(theta[part], i):
                        shape = self.noise_shape(theta[part], i, channel)
                        if channel in self.discrepancy[i]:
                            whitened = self._whitened(theta[part], i, channel, e, scale)
                            total[part] += whitened.marginal_log_density()
                            continue
                        density = self.noise.total_log_density(e, shape, self.steps[i])
                        total[part] += self.noise.likelihood_weight(shape) * (
                            density - _log_sum(scale, record.n)
                        )
        return np.where(np.isnan(total), -np.inf, total)

    def pointwise_log_likelihood(self, theta: Floats, weights: Weights = ()) -> tuple[dict[str, Floats], ...]:
        """Log density of each observation given those before it and the discrepancy.

        Parameters
        ----------
        theta : ndarray, shape (W, P)
        weights : tuple of mapping
            Of the discrepancies.

        Returns
        -------
        tuple of dict
            For each record, channel to array of shape (W, n). Without discrepancies their sum is `log_likelihood`; what
            an error of the thermometer adds stands with the first channel. What sweeps have of their own is integrated
            out, which the readings of a sweep share evenly.
        """
        theta = np.atleast_2d(theta)
        out = []
        for i, record in enumerate(self.records):
            found: dict[str, Floats] = {c: np.empty((len(theta), record.n)) for c in record.channels}
            for part in batches(len(theta), record.n, CHUNK_SAMPLES):
                own = _part(weights, part)
                if self._is_latent(i):
                    first, *others = record.channels
                    whole, by_channel = self._latent_log_density(theta[part], i)
                    for channel in others:
                        found[channel][part] = by_channel[channel]
                    found[first][part] = whole - _products(
                        [by_channel[c] for c in others], [np.ones(1)] * len(others)
                    )
                    continue
                for channel, e, scale in self._standardised(theta[part], i, own):
                    shape = self.noise_shape(theta[part], i, channel)
                    if channel in _of(own, i) and self._sweeps_differ(i, channel):
                        found[channel][part] = self._density_in_sweeps(theta[part], i, channel, e, scale)
                        continue
                    density = self.noise.log_density(e, shape, self.steps[i]) - np.log(scale)
                    found[channel][part] = self.noise.likelihood_weight(shape)[:, None] * density
            out.append(found)
        return tuple(out)

    def residuals(
        self, theta: Floats, weights: Weights = (), *, of_sweeps: bool = False
    ) -> tuple[dict[str, Floats], ...]:
        """Whitened residuals with the memory of the noise taken out, for each record: channel to (W, n).

        If model and noise are right they are independent and of unit variance. They are less what is likeliest of what
        sweeps have of their own, unless this is left in (`of_sweeps`).
        """
        theta = np.atleast_2d(theta)
        out = []
        for i in range(len(self.records)):
            found = {}
            for channel, e, scale in self._standardised(theta, i, weights):
                shape = self.noise_shape(theta, i, channel)
                if channel in _of(weights, i) and self._sweeps_differ(i, channel) and not of_sweeps:
                    e = e - self._of_sweeps(theta, i, channel, e, scale)
                found[channel] = self.noise.innovations(e, shape, self.steps[i])
            out.append(found)
        return tuple(out)

    def draw_discrepancy(self, rng: np.random.Generator, theta: Floats) -> Weights:
        """Weights of the discrepancies, drawn given the measurements and everything else.

        Parameters
        ----------
        rng : numpy.random.Generator
        theta : ndarray, shape (W, P)

        Returns
        -------
        tuple of dict
            For each record, channel to array of shape (W, m) [unit of the channel].
        """
        theta = np.atleast_2d(theta)
        out = []
        for i, record in enumerate(self.records):
            found: dict[str, Floats] = {
                c: np.zeros((len(theta), basis.count)) for c, basis in self.discrepancy[i].items()
            }
            if found:
                for part in batches(len(theta), record.n, CHUNK_SAMPLES):
                    for channel, e, scale in self._standardised(theta[part], i):
                        if channel in found:
                            whitened = self._whitened(theta[part], i, channel, e, scale)
                            count = self.discrepancy[i][channel].count
                            found[channel][part] = whitened.draw_weights(rng)[:, :count]
            out.append(found)
        return tuple(out)

    def has_normal_weights(self, channel: str, record: int = 0) -> bool:
        """Whether a discrepancy has weights that are normal given all else, and sweeps have nothing of their own."""
        found = channel in self.discrepancy[record] and self.noise.is_gaussian and self.noise.is_density
        return found and not self._sweeps_differ(record, channel)

    def normal_weights(self, theta: Floats, channel: str, record: int = 0) -> NormalWeights:
        """Weights of a discrepancy given the measurements and each of some parameter vectors (W, P)."""
        found = [w.normal_weights() for w in self._whitened_in_parts(theta, channel, record)]
        return NormalWeights(np.concatenate([f.mean for f in found]), np.concatenate([f.root for f in found]))

    def predictive_log_density(
        self, theta: Floats, weights: NormalWeights, channel: str, record: int = 0
    ) -> Floats:
        """Log density (W, n) of measurements that had no part in what is known of the weights, these integrated out.

        Densities that `pointwise_log_likelihood` gives for drawn weights have this one as their mean. Where the
        discrepancy is known far less well than the noise is small it takes many draws to come near it.
        """
        start, found = 0, []
        for whitened in self._whitened_in_parts(theta, channel, record):
            own = slice(start, start := start + len(whitened.e))
            found.append(whitened.predictive_log_density(NormalWeights(weights.mean[own], weights.root[own])))
        return np.concatenate(found)

    def left_out_log_density(self, theta: Floats, channel: str, record: int = 0) -> Floats:
        """Log density (W, n) of each measurement given all others, the weights of the discrepancy integrated out."""
        parts = self._whitened_in_parts(theta, channel, record)
        return np.concatenate([w.left_out_log_density() for w in parts])

    def _whitened_in_parts(self, theta: Floats, channel: str, record: int) -> Iterator[Whitened]:
        """Standardised residuals with a discrepancy, for some parameter vectors at a time."""
        for part in batches(len(theta), self.records[record].n, CHUNK_SAMPLES):
            for name, e, scale in self._standardised(theta[part], record):
                if name == channel:
                    yield self._whitened(theta[part], record, channel, e, scale)

    def draw_sweeps(
        self, rng: np.random.Generator, theta: Floats, record: int, channel: str, weights: Weights = ()
    ) -> Floats:
        """Weights of what each sweep has of its own, drawn given the measurements and everything else.

        Parameters
        ----------
        rng : numpy.random.Generator
        theta : ndarray, shape (W, P)
        record : int
        channel : str
            One whose sweeps have something of their own.
        weights : tuple of mapping
            Of the discrepancies; drawn as well, and forgotten, by default.

        Returns
        -------
        ndarray, shape (W, S, q)
            [unit of the channel]
        """
        found = []
        for part in batches(len(theta), self.records[record].n, CHUNK_SAMPLES):
            own = _part(weights, part)
            standardised = {c: (e, scale) for c, e, scale in self._standardised(theta[part], record, own)}
            whitened = (self._whitened_sweeps if channel in _of(own, record) else self._whitened)(
                theta[part], record, channel, *standardised[channel]
            )
            found.append(whitened.draw_weights_of_sweeps(rng))
        return np.concatenate(found)

    def predict(
        self, theta: Floats, inputs: Mapping[str, Floats], *, record: int = 0, weights: Weights = ()
    ) -> dict[str, Floats]:
        """Response of each channel at other inputs, shape (..., n), discrepancy of given weights included."""
        with np.errstate(over="ignore", invalid="ignore"):
            out = self.model.predict(np.asarray(theta)[..., self.layout[record].model], inputs)
        for channel, own in _of(weights, record).items():
            out[channel] = out[channel] + self.discrepancy[record][channel].function(
                own, inputs["temperature"]
            )
        return out

    def slope(
        self, theta: Floats, inputs: Mapping[str, Floats], *, record: int = 0, weights: Weights = ()
    ) -> dict[str, Floats]:
        """Derivative of `predict` with respect to temperature, shape (..., n)."""
        with np.errstate(over="ignore", invalid="ignore"):
            out = self.model.slope(np.asarray(theta)[..., self.layout[record].model], inputs)
        for channel, own in _of(weights, record).items():
            basis = self.discrepancy[record][channel]
            out[channel] = out[channel] + basis.function_slope(own, inputs["temperature"])
        return out

    def replicate(
        self,
        rng: np.random.Generator,
        theta: Floats,
        *,
        record: int = 0,
        weights: Weights = (),
        sweeps: Mapping[str, Floats] | None = None,
    ) -> dict[str, Floats]:
        """New measurements at the record's own inputs, one for each parameter vector: channel to (W, n).

        They have the density of the likelihood: where it integrates true temperatures out these are drawn, elsewhere
        errors of the thermometer have its mean and covariance, and the memory that it gives them.

        Parameters
        ----------
        rng : numpy.random.Generator
        theta : ndarray, shape (W, P)
        record : int
        weights : tuple of mapping
            Of the discrepancies.
        sweeps : mapping of str to ndarray, shape (W, S, q), optional
            Channel to weights of what each sweep has of its own. By default other sweeps are drawn.
        """
        theta = np.atleast_2d(theta)
        if self._is_latent(record):
            return self._replicate_latent(rng, theta, record)
        mean, parts = self._moments(theta, record)
        given = _of(weights, record)
        before: list[_Channel] = []
        out = {}
        for channel in self.records[record].channels:
            centre = mean[channel]
            if channel in given:
                centre = centre + given[channel] @ self.discrepancy[record][channel].rows
            if self._sweeps_differ(record, channel):
                size, own = self._between(theta, record, channel)
                if sweeps is None:
                    drawn = size[:, None] * rng.standard_normal((len(theta), len(own.rows)))
                else:
                    drawn = sweeps[channel].reshape(len(theta), -1)
                centre = centre + drawn @ own.rows
            if not parts:
                sd = self.noise_scale(theta, record, channel, mean[channel])
                out[channel] = self.readings(rng, theta, record, channel, centre, sd, self.steps[record])
                continue
            shape = self.noise_shape(theta, record, channel)
            series = self.noise.draw(rng, shape, self.steps[record])
            sd = self.noise_scale(theta, record, channel, mean[channel])
            row, scale = _conditioned(parts[channel], sd, before)
            out[channel] = centre + _products(row, [c.whitened for c in before]) + scale * series
            if not self.discrepancy[record]:
                before.append(_Channel(parts[channel], row, series, scale))
        return out

    def _replicate_latent(self, rng: np.random.Generator, theta: Floats, record: int) -> dict[str, Floats]:
        """New measurements at true temperatures that are drawn about the readings."""
        r = self.records[record]
        spread = self.temperature_sd(theta, record)
        assert spread is not None  # `_is_latent` has seen to it
        true = r.temperature + spread[:, None] * rng.standard_normal((len(theta), r.n))
        clean = self.predict(theta, {**r.inputs, "temperature": true}, record=record)
        out = {}
        for channel in r.channels:
            sd = self.noise_scale(theta, record, channel, clean[channel])
            out[channel] = self.readings(rng, theta, record, channel, clean[channel], sd, self.steps[record])
        return out

    def temperature_sd(self, theta: Floats, record: int = 0) -> Floats | None:
        """Standard deviation (W,) of the error of the thermometer; None where there is none."""
        at, declared = self.layout[record].temperature_sd, self.records[record].temperature_sd
        if at is not None:
            return np.asarray(np.hypot(theta[:, at], declared))
        return np.full(len(theta), declared) if declared > 0.0 else None

    def of_new_sweeps(
        self, rng: np.random.Generator, theta: Floats, record: int, channel: str, temperature: Floats
    ) -> Floats:
        """What new sweeps have of their own at temperatures (g,) or (W, g), each reading of another; shape (W, g).

        They scatter as the sweeps of the record do.
        """
        if not self._sweeps_differ(record, channel):
            return np.zeros((1, 1))
        size, own = self._between(theta, record, channel)
        return own.of_new_sweep(rng, self.draw_sweeps(rng, theta, record, channel), size, temperature)

    def _sweeps_differ(self, record: int, channel: str) -> bool:
        """Whether sweeps have anything of their own."""
        basis = self.discrepancy[record].get(channel)
        return (
            basis is not None and basis.sweep_functions is not None and channel in self.layout[record].between
        )

    def _between(self, theta: Floats, record: int, channel: str) -> tuple[Floats, SweepFunctions]:
        """Size (W,) of what sweeps have of their own, and the functions of which it is made."""
        own = self.discrepancy[record][channel].sweep_functions
        assert own is not None  # a size stands for it
        return theta[:, self.layout[record].between[channel]], own

    def readings(
        self,
        rng: np.random.Generator,
        theta: Floats,
        record: int,
        channel: str,
        response: Floats,
        scale: Floats,
        steps: Steps,
    ) -> Floats:
        """Readings (W, n) of a channel about its response (W, n), the noise of standard deviation `scale`."""
        shape = self.noise_shape(theta, record, channel)
        return self.noise.readings(
            rng, response, scale, shape, steps, float(self.records[record].observed[channel][0])
        )

    def noise_shape(self, theta: Floats, record: int, channel: str) -> Floats:
        """What shapes the standardised noise of a channel, shape (..., k), at parameters (..., P)."""
        return self.noise.shape_of(theta[..., self.layout[record].noise[channel]])

    def noise_scale(self, theta: Floats, record: int, channel: str, response: Floats) -> Floats:
        """Standard deviation of the noise of a channel where it responds so, shape (W, n) or (W, 1)."""
        at = self.layout[record].noise[channel]
        sd = theta[:, at[0], None]
        low, span = self._range[record][channel]
        relative = self.noise.relative_scale(
            self.noise_shape(theta, record, channel), (response - low) / span
        )
        return np.asarray(sd if relative is None else sd * relative)

    def expected(self, theta: Floats, record: int = 0) -> tuple[dict[str, Floats], dict[str, Floats]]:
        """Mean response and its standard deviation at the samples of a record, under errors of the thermometer.

        Parameters
        ----------
        theta : ndarray, shape (W, P)

        Returns
        -------
        mean, sd : dict of str to ndarray, shape (W, n)
            `sd` is empty where the thermometer has no error.
        """
        mean, root = self._moments(theta, record)
        return mean, {c: np.sqrt(_products(rows, rows)) for c, rows in root.items()}

    def moments_of_noise(self, theta: Floats, record: int) -> tuple[dict[str, Floats], dict[str, Floats]]:
        """Mean response at the samples of a record, and how much wider than ``sd`` measurements scatter there.

        Parameters
        ----------
        theta : ndarray, shape (P,)

        Returns
        -------
        mean, relative : dict of str to ndarray, shape (n,) or (1,)
            [unit of the channel] and [1].
        """
        mean, spread = self.expected(theta[None], record)
        relative = {}
        for channel, response in mean.items():
            sd = theta[self.layout[record].noise[channel][0]]
            scale = self.noise_scale(theta[None], record, channel, response)
            relative[channel] = np.hypot(scale, spread.get(channel, 0.0))[0] / sd
        return {c: y[0] for c, y in mean.items()}, relative

    def working_residual(
        self, theta: Floats, record: int, channel: str, residual: Floats, relative: Floats
    ) -> Floats:
        """Residual that would pull normal noise as hard as this one pulls noise of heavy tails.

        Parameters
        ----------
        theta : ndarray, shape (P,)
        record : int
        channel : str
        residual : ndarray, shape (n,)
            [unit of the channel]
        relative : ndarray, shape (n,) or (1,)
            How much wider than ``sd`` measurements scatter.

        Returns
        -------
        ndarray, shape (n,)
            ``score/information`` of each innovation, the memory put back, and the likeliest discrepancy.
        """
        at, noise, steps = self.layout[record].noise[channel], self.noise, self.steps[record]
        shape, scale = self.noise_shape(theta[None], record, channel), theta[at[0]] * relative[None]
        e = residual / scale
        missed: Floats = np.zeros(1)
        if channel in self.discrepancy[record]:
            whitened = self._whitened(theta[None], record, channel, e, scale)
            missed = whitened.likeliest_series() * scale
        left = noise.decorrelate(e - missed / scale, shape, steps)
        pull = noise.score(left, shape) / noise.location_information(shape)[:, None]
        return np.asarray((noise.correlate(pull, shape, steps) * scale + missed)[0])

    def _moments(self, theta: Floats, record: int) -> tuple[dict[str, Floats], dict[str, list[Floats]]]:
        """Mean response, and for each channel the parts of its deviation at each node of the quadrature."""
        r, model_theta = self.records[record], theta[:, self.layout[record].model]
        spread = self.temperature_sd(theta, record)
        if spread is None:
            return self.model.predict(model_theta, r.inputs), {}
        nodes, weights = QUADRATURE
        weights = weights / weights.sum()
        at_nodes = [
            self.model.predict(
                model_theta, {**r.inputs, "temperature": r.temperature + (x * spread)[:, None]}
            )
            for x in nodes
        ]
        mean, parts = {}, {}
        for channel in r.channels:
            mean[channel] = _products(weights, [y[channel] for y in at_nodes])
            parts[channel] = [
                np.sqrt(w) * (y[channel] - mean[channel]) for w, y in zip(weights, at_nodes, strict=True)
            ]
        return mean, parts

    def _is_latent(self, record: int) -> bool:
        """Whether each sample has a true temperature of its own to be integrated out: no memory joins the samples."""
        felt = self.layout[record].temperature_sd is not None or self.records[record].temperature_sd > 0.0
        return (
            felt and not self.noise.autocorrelated and self.noise.is_density and not self.discrepancy[record]
        )

    def _latent_log_density(self, theta: Floats, record: int) -> tuple[Floats, dict[str, Floats]]:
        """Log density of the samples of a record with their true temperatures integrated out.

        By Gauss-Hermite quadrature about the likeliest temperature of each sample. The middle node alone would be
        Laplace's method, which moves parameters by half a standard deviation and more where the error is as wide as the
        transformation.

        Parameters
        ----------
        theta : ndarray, shape (W, P)

        Returns
        -------
        ndarray, shape (W, n)
            All channels of each sample together.
        dict of str to ndarray, shape (W, n)
            Density of each channel at the likeliest temperature.
        """
        r, place, steps = self.records[record], self.layout[record], self.steps[record]
        model_theta = theta[:, place.model]
        spread = self.temperature_sd(theta, record)
        assert spread is not None  # `_is_latent` has seen to it
        shapes = {c: self.noise_shape(theta, record, c) for c in r.channels}
        information = {c: self.noise.location_information(shapes[c])[:, None] for c in r.channels}
        xi = np.zeros((len(theta), r.n))  # error of the thermometer in its standard deviations
        for step in range(LATENT_STEPS + 1):
            inputs = {**r.inputs, "temperature": r.temperature + spread[:, None] * xi}
            mean, slope = self.model.predict(model_theta, inputs), self.model.slope(model_theta, inputs)
            pull, firm, held = -xi, np.ones_like(xi), np.ones_like(xi)
            densities = {}
            for channel in r.channels:
                scale = self.noise_scale(theta, record, channel, mean[channel])
                e = (r.observed[channel] - mean[channel]) / scale
                gain = spread[:, None] * slope[channel] / scale
                if step < LATENT_STEPS:
                    # iteratively reweighted: an outlying sample of a heavy-tailed noise hardly holds its temperature
                    weight = self.noise.weight(e, shapes[channel])
                    pull = pull + gain * weight * e
                    firm = firm + np.maximum(weight, 0.0) * gain * gain
                else:
                    held = held + information[channel] * gain * gain
                    densities[channel] = self.noise.log_density(e, shapes[channel], steps) - np.log(scale)
            if step < LATENT_STEPS:
                xi = xi + np.clip(pull / firm, -1.0, 1.0)
        at_nodes = [sum(densities.values(), start=-0.5 * xi * xi)]
        for x in LATENT_NODES[0][1:]:
            at = xi + x / np.sqrt(held)
            inputs = {**r.inputs, "temperature": r.temperature + spread[:, None] * at}
            mean = self.model.predict(model_theta, inputs)
            integrand: Floats = 0.5 * (x * x - at * at)
            for channel in r.channels:
                scale = self.noise_scale(theta, record, channel, mean[channel])
                e = (r.observed[channel] - mean[channel]) / scale
                integrand = integrand + self.noise.log_density(e, shapes[channel], steps) - np.log(scale)
            at_nodes.append(integrand)
        highest = np.maximum.reduce(at_nodes)
        whole = _products(list(LATENT_NODES[1]), [np.exp(y - highest) for y in at_nodes])
        return highest + np.log(whole) - 0.5 * np.log(2.0 * np.pi * held), densities

    def _standardised(
        self, theta: Floats, record: int, weights: Weights = ()
    ) -> Iterator[tuple[str, Floats, Floats]]:
        """Channel, whitened residual (W, n), and the scale (W, n) or (W, 1) by which it was divided."""
        r = self.records[record]
        mean, parts = self._moments(theta, record)
        given = _of(weights, record)
        before: list[_Channel] = []
        for channel in r.channels:
            residual = r.observed[channel] - mean[channel]
            if channel in given:
                residual = residual - given[channel] @ self.discrepancy[record][channel].rows
            sd = self.noise_scale(theta, record, channel, mean[channel])
            if not parts:
                residual *= 1.0 / sd
                yield channel, residual, sd
                continue
            row, scale = _conditioned(parts[channel], sd, before)
            whitened = (residual - _products(row, [c.whitened for c in before])) / scale
            # with a discrepancy the residuals before still hold it: each stands for itself
            if not self.discrepancy[record]:
                before.append(_Channel(parts[channel], row, whitened, scale))
            yield channel, whitened, scale

    def _whitened(self, theta: Floats, record: int, channel: str, e: Floats, scale: Floats) -> Whitened:
        place, basis = self.layout[record], self.discrepancy[record][channel]
        shape = self.noise_shape(theta, record, channel)
        apart = self._sweeps_differ(record, channel)
        own, between = (basis.sweep_functions, theta[:, place.between[channel]]) if apart else (None, None)
        size = theta[:, place.size[channel], None]
        return Whitened(self.noise, shape, self.steps[record], e, scale, basis.rows, size, own, between)

    def _of_sweeps(self, theta: Floats, record: int, channel: str, e: Floats, scale: Floats) -> Floats:
        """Likeliest part (W, n) of standardised residuals that sweeps have of their own."""
        return self._whitened_sweeps(theta, record, channel, e, scale).likeliest_series()

    def _whitened_sweeps(
        self, theta: Floats, record: int, channel: str, e: Floats, scale: Floats
    ) -> Whitened:
        """Standardised residuals (W, n) less the discrepancy, with what sweeps have of their own alone."""
        size, own = self._between(theta, record, channel)
        shape, steps = self.noise_shape(theta, record, channel), self.steps[record]
        nothing = np.empty((0, e.shape[1])), np.empty((len(e), 0))
        return Whitened(self.noise, shape, steps, e, scale, *nothing, own, size)

    def _density_in_sweeps(
        self, theta: Floats, record: int, channel: str, e: Floats, scale: Floats
    ) -> Floats:
        """Log density (W, n) of readings, what each sweep has of its own integrated out of those of that sweep."""
        size, own = self._between(theta, record, channel)
        shape, density = self.noise_shape(theta, record, channel), np.empty_like(e)
        scale = np.broadcast_to(scale, e.shape)
        for part in own.parts:
            steps, n = self.steps[record].part(part), part.stop - part.start
            nothing = np.empty((0, n)), np.empty((len(e), 0))
            sweep = Whitened(
                self.noise, shape, steps, e[:, part], scale[:, part], *nothing, own.part(part), size
            )
            together, of_sweep = sweep.marginal_with_likeliest_series()
            each = self.noise.log_density(e[:, part] - of_sweep, shape, steps) - np.log(scale[:, part])
            shared = (together - each.sum(axis=1)) / n
            density[:, part] = each + shared[:, None]
        return density

    def fingerprint(self) -> str:
        """Digest of data, priors, model, noise and versions: what must agree for a run to be resumed."""
        digest = hashlib.sha256()
        for record in self.records:
            digest.update(f"{record.key} {record.temperature_sd} {sorted(record.units.items())}".encode())
            for name, values in (*sorted(record.inputs.items()), *sorted(record.observed.items())):
                digest.update(name.encode())
                digest.update(np.ascontiguousarray(values).tobytes())
        digest.update(repr(self.space.parameters).encode())
        for bases in self.discrepancy:
            for channel, basis in sorted(bases.items()):
                digest.update(channel.encode())
                digest.update(np.ascontiguousarray(basis.rows_with_sweeps).tobytes())
        digest.update(f"{self.model.name} {self.model.channels} {self.noise.name}".encode())
        digest.update(repr(sorted(versions().items())).encode())
        return digest.hexdigest()


def versions() -> dict[str, str]:
    """Versions of everything that decides a draw."""
    return dict(_versions())


@cache
def _versions() -> tuple[tuple[str, str], ...]:
    """Looked up once a process: the files of the installation take longer to read than a record's bands to write."""
    packages = ("sma-bayes", "emcee", "numpy", "scipy")
    return (("python", platform.python_version()), *((name, version(name)) for name in packages))


def observed_range(values: Floats) -> tuple[float, float]:
    """Bottom of the range of a channel and its width, which is never zero."""
    low, high = (float(v) for v in np.quantile(values, (0.01, 0.99)))
    return low, (high - low) or float(np.ptp(values)) or max(abs(low), 1.0)


def _log_sum(scale: Floats, n: int) -> Floats:
    """Sum over the samples of the logarithm of their scales (W, n), or of one scale for all (W, 1)."""
    if scale.shape[1] == 1:
        return np.asarray(n * np.log(scale[:, 0]))
    return np.asarray(np.log(scale).sum(axis=-1))


@dataclass(frozen=True, slots=True, eq=False)
class _Channel:
    """A channel that others are conditioned on.

    Attributes
    ----------
    parts : list of ndarray
        Deviations of its response that an error of the thermometer makes.
    row : list of ndarray
        Its row of the Cholesky factor of the covariance of the channels, less the diagonal.
    whitened : ndarray, shape (W, n)
    scale : ndarray, shape (W, n)
        The diagonal.
    """

    parts: list[Floats]
    row: list[Floats]
    whitened: Floats
    scale: Floats


def _conditioned(parts: list[Floats], sd: Floats, before: Sequence[_Channel]) -> tuple[list[Floats], Floats]:
    """Row of the Cholesky factor of the covariance of the channels, and its diagonal, for one channel more."""
    row: list[Floats] = []
    for other in before:
        row.append((_products(parts, other.parts) - _products(row, other.row)) / other.scale)
    return row, np.sqrt(sd * sd + _products(parts, parts) - _products(row, row))


def _products(one: Sequence[Floats], other: Sequence[Floats]) -> Floats:
    """Sum of products of arrays, as far as both have them; zero of none."""
    products = (x * y for x, y in zip(one, other, strict=False))
    total = next(products, np.zeros(1))
    for product in products:
        total += product
    return total


def _of(weights: Weights, record: int) -> Mapping[str, Floats]:
    """Weights of the discrepancies of one record; none where none are given."""
    return weights[record] if weights else {}


def _part(weights: Weights, part: slice) -> Weights:
    """Weights of some of the parameter vectors."""
    return tuple({channel: w[part] for channel, w in own.items()} for own in weights)


def build_posterior(
    records: Sequence[Record],
    noise: NoiseModel,
    priors: PriorSet,
    *,
    model: ResponseModel | None = None,
    residual: Sequence[Mapping[str, float]] | None = None,
    memory: Sequence[Mapping[str, float]] | None = None,
    longest_memory: Sequence[Mapping[str, float]] | None = None,
    discrepancy: Sequence[Mapping[str, DiscrepancyBasis]] | None = None,
) -> Posterior:
    """Join records of one branch with a noise model and priors.

    Parameters
    ----------
    records : sequence of Record
        One, or several that share the parameters of the model. All must have the same channels and units.
        Each record keeps noise parameters of its own.
    noise : NoiseModel
    priors : PriorSet
    model : ResponseModel, optional
        By default the modified sigmoid that predicts the observed channels.
    residual : sequence of mapping, optional
        For each record, residual standard error of each channel at the least-squares fit: the scale of the
        noise. Without it the noise is measured by the span of the channel.
    memory : sequence of mapping, optional
        For each record, how many samples of each channel count as one; needed by `EffectiveSamples`.
    longest_memory : sequence of mapping, optional
        For each record, channel to how many samples may count as one at most; any number where there is none.
    discrepancy : sequence of mapping, optional
        For each record, channel to the basis of what the curve misses; none by default.

    Raises
    ------
    PriorError
        If a parameter has no prior, or a prior has no parameter.
    """
    first = records[0]
    model = model or ModifiedSigmoid(first.channels)
    for record in records[1:]:
        if (record.channels, record.units, record.branch) != (first.channels, first.units, first.branch):
            raise PriorError(
                f"records {first.key!r} and {record.key!r} can't share parameters",
                expected="the same branch, channels and units",
                remedy="fit them without --pool campaign",
            )
    scales = RecordScales.of(records)
    facts = model.parameters(first.units)
    noise_keys = {"growth", "temperature_sd", "discrepancy", "between_sweeps"}
    noise_keys |= {f.prior_key for n in NOISE_MODELS.values() for f in n.parameters("force", "N", "s")}
    priors.check_names(model.spoken_of(), noise_keys)
    parameters: list[Parameter] = [
        priors.parameter(f.in_record(first.quantity), first.branch, scales) for f in facts
    ]
    shared = np.arange(len(parameters))
    layout = []
    for i, record in enumerate(records):
        own = RecordScales.of([record]) if len(records) > 1 else scales
        own = own.with_residual(residual[i]) if residual is not None else own
        own = own.with_memory(memory[i]) if memory is not None else own
        if longest_memory is not None:
            own = own.with_longest_memory(longest_memory[i], Steps.of(record).typical)
        bases = discrepancy[i] if discrepancy is not None else {}
        places, sizes, between = {}, {}, {}

        def add(fact: ParameterSpec, record: Record = record, own: RecordScales = own) -> int:
            parameter = priors.parameter(fact.in_record(record.quantity), record.branch, own, noise=True)
            name = f"{fact.name}[{record.condition.id}]" if len(records) > 1 else fact.name
            parameters.append(replace(parameter, name=name))
            return len(parameters) - 1

        for channel in record.channels:
            facts_of_noise = noise.parameters(channel, record.units[channel], record.units.get("time", "s"))
            places[channel] = np.array([add(fact) for fact in facts_of_noise], dtype=np.intp)
            if channel in bases:
                sizes[channel] = add(size_fact(channel, record.units[channel]))
                if bases[channel].sweep_functions is not None:
                    between[channel] = add(between_sweeps_fact(channel, record.units[channel]))
        felt = add(temperature_sd_fact(record.units["temperature"])) if noise.feels_temperature else None
        layout.append(ParameterIndex(shared, places, sizes, felt, between))
    own_bases = tuple(dict(b) for b in discrepancy) if discrepancy is not None else ()
    return Posterior(
        tuple(records), model, noise, ParameterSpace(tuple(parameters)), tuple(layout), own_bases
    )
