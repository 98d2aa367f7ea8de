"""The posterior: records, model, noise and priors joined into one density.

    log p(z | data) = log prior(z) + sum over records, channels and samples of log density(residual)

One posterior serves one record (each condition and branch its own A and B), or several that share A and B.
What is shared is a layout of positions in the parameter vector; the sampler never knows the difference.

A temperature error of standard deviation ``s_T`` moves all channels of a sample together. To first order each
residual has the covariance ``diag(sd**2) + s_T**2 g g'`` with ``g = d(response)/dT``; residuals are whitened
channel by channel by conditioning on what the channels before say about the temperature error. What is left
has unit variance and is handed to the noise model, so that a memory in the noise extends to the temperature
error as well.
"""

from __future__ import annotations

import hashlib
import platform
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from importlib.metadata import version

import numpy as np
from numpy.typing import NDArray

from sma_bayes.batches import batches
from sma_bayes.errors import PriorError
from sma_bayes.noise import NOISE_MODELS, NoiseModel, Steps
from sma_bayes.parameters.priors_file import PriorSet
from sma_bayes.parameters.scales import RecordScales
from sma_bayes.parameters.space import Parameter, ParameterSpace
from sma_bayes.quantities import Floats
from sma_bayes.records.types import Record
from sma_bayes.response.base import ResponseModel
from sma_bayes.response.modified_sigmoid import ModifiedSigmoid

CHUNK = 1 << 15
"""Samples times parameter vectors that are evaluated at a time, so that intermediate arrays stay in cache."""


@dataclass(frozen=True, slots=True, eq=False)
class Place:
    """Where the parameters of one record stand in the parameter vector.

    Attributes
    ----------
    model : ndarray of int
        Positions of the model's parameters.
    noise : mapping of str to ndarray of int
        Positions of each channel's noise parameters.
    """

    model: NDArray[np.intp]
    noise: Mapping[str, NDArray[np.intp]]


@dataclass(frozen=True, eq=False)
class Posterior:
    """Log-probability of batches of parameter vectors, given measurements.

    Attributes
    ----------
    records : tuple of Record
    model : ResponseModel
    noise : NoiseModel
    space : ParameterSpace
    layout : tuple of Place
        One for each record.
    steps : tuple of Steps
        How the samples of each record follow each other.
    """

    records: tuple[Record, ...]
    model: ResponseModel
    noise: NoiseModel
    space: ParameterSpace
    layout: tuple[Place, ...]
    steps: tuple[Steps, ...] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "steps", tuple(Steps.of(r) for r in self.records))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the sampled parameters, in the order of ``z``."""
        return tuple(p.name for p in self.space.free)

    @property
    def n(self) -> int:
        """Number of samples over all records."""
        return sum(r.n for r in self.records)

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
            Never NaN: what can't be evaluated has probability zero.
        """
        z = np.atleast_2d(z)
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            value = self.log_prior(z) + self.log_likelihood(self.space.to_physical(z))
        return np.where(np.isnan(value), -np.inf, value)

    def log_likelihood(self, theta: Floats) -> Floats:
        """Log likelihood of parameter vectors ``theta`` (W, P), shape (W,)."""
        theta = np.atleast_2d(theta)
        total = np.zeros(len(theta))
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            for record, place, steps in zip(self.records, self.layout, self.steps, strict=True):
                for part in batches(len(theta), record.n, CHUNK):
                    for channel, e, log_scale in self._whitened(theta[part], record, place):
                        shape = theta[part][:, place.noise[channel][1:]]
                        counts = self.noise.information(shape)
                        total[part] += counts * (self.noise.total_log_density(e, shape, steps) - log_scale)
        return np.where(np.isnan(total), -np.inf, total)

    def pointwise_log_likelihood(self, theta: Floats) -> tuple[dict[str, Floats], ...]:
        """Log density of each observation given those before it.

        Returns
        -------
        tuple of dict
            For each record, channel to array of shape (W, n). Their sum is `log_likelihood`.
        """
        theta = np.atleast_2d(theta)
        out = []
        for record, place, steps in zip(self.records, self.layout, self.steps, strict=True):
            found: dict[str, Floats] = {c: np.empty((len(theta), record.n)) for c in record.channels}
            for part in batches(len(theta), record.n, CHUNK):
                for channel, e, _, scale in self._whitening(theta[part], record, place):
                    shape = theta[part][:, place.noise[channel][1:]]
                    density = self.noise.log_density(e, shape, steps) - np.log(scale)
                    found[channel][part] = self.noise.information(shape)[:, None] * density
            out.append(found)
        return tuple(out)

    def residuals(self, theta: Floats) -> tuple[dict[str, Floats], ...]:
        """Whitened residuals with the memory of the noise taken out, for each record: channel to (W, n).

        If model and noise are right they are independent and of unit variance.
        """
        theta = np.atleast_2d(theta)
        out = []
        for record, place, steps in zip(self.records, self.layout, self.steps, strict=True):
            out.append({
                channel: self.noise.innovations(e, theta[:, place.noise[channel][1:]], steps)
                for channel, e, _, _ in self._whitening(theta, record, place)
            })  # fmt: skip
        return tuple(out)

    def predict(self, theta: Floats, inputs: Mapping[str, Floats], *, record: int = 0) -> dict[str, Floats]:
        """Response of each channel at other inputs, shape (..., n)."""
        with np.errstate(over="ignore", invalid="ignore"):
            return self.model.predict(np.asarray(theta)[..., self.layout[record].model], inputs)

    def replicate(self, rng: np.random.Generator, theta: Floats, *, record: int = 0) -> dict[str, Floats]:
        """New measurements at the record's own inputs, one for each parameter vector: channel to (W, n)."""
        theta = np.atleast_2d(theta)
        r, place = self.records[record], self.layout[record]
        clean = self.predict(theta, r.inputs, record=record)
        out = {}
        slope = self.model.slope(theta[..., place.model], r.inputs) if r.temperature_sd > 0 else {}
        mean: Floats = np.zeros(1)  # of the temperature error, given the channels so far, as in `_whitening`
        variance: Floats = np.ones(1)
        for channel in r.channels:
            at = place.noise[channel]
            sd = theta[:, at[0], None]
            series = self.noise.draw(rng, theta[:, at[1:]], self.steps[record])
            if not slope:
                out[channel] = clean[channel] + sd * series
                continue
            gain = slope[channel] * r.temperature_sd
            total = sd * sd + gain * gain * variance
            residual = np.sqrt(total) * series
            out[channel] = clean[channel] + gain * mean + residual
            share = gain * variance / total
            mean = mean + share * residual
            variance = variance * (1.0 - share * gain)
        return out

    def _whitened(self, theta: Floats, record: Record, place: Place) -> Iterator[tuple[str, Floats, Floats]]:
        """Channel, whitened residual (W, n) and the sum of the logarithms of their scales (W,)."""
        for channel, e, log_scale, _ in self._whitening(theta, record, place):
            yield channel, e, log_scale

    def _whitening(
        self, theta: Floats, record: Record, place: Place
    ) -> Iterator[tuple[str, Floats, Floats, Floats]]:
        mu = self.model.predict(theta[:, place.model], record.inputs)
        if record.temperature_sd == 0.0:
            for channel in record.channels:
                sd = theta[:, place.noise[channel][0], None]
                e = record.observed[channel] - mu[channel]
                e *= 1.0 / sd
                yield channel, e, record.n * np.log(sd[:, 0]), sd
            return
        slope = self.model.slope(theta[:, place.model], record.inputs)
        mean: Floats = np.zeros(1)  # of the temperature error, given the channels so far [sd of the error]
        variance: Floats = np.ones(1)
        for channel in record.channels:
            sd = theta[:, place.noise[channel][0], None]
            gain = slope[channel] * record.temperature_sd
            residual = record.observed[channel] - mu[channel] - gain * mean
            total = sd * sd + gain * gain * variance
            share = gain * variance / total
            mean = mean + share * residual
            variance = variance * (1.0 - share * gain)
            scale = np.sqrt(total)
            yield channel, residual / scale, np.log(scale).sum(axis=-1), scale

    def fingerprint(self) -> str:
        """Digest of data, priors, model, noise and versions: what must agree for a run to be resumed."""
        digest = hashlib.sha256()
        for record in self.records:
            digest.update(f"{record.key} {record.temperature_sd} {sorted(record.units.items())}".encode())
            for name, values in (*sorted(record.inputs.items()), *sorted(record.observed.items())):
                digest.update(name.encode())
                digest.update(np.ascontiguousarray(values).tobytes())
        digest.update(repr(self.space.parameters).encode())
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


def build_posterior(
    records: Sequence[Record],
    noise: NoiseModel,
    priors: PriorSet,
    *,
    model: ResponseModel | None = None,
    residual: Sequence[Mapping[str, float]] | None = None,
    memory: Sequence[Mapping[str, float]] | None = None,
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
        For each record, residual standard error of each channel at the least-squares fit: the yardstick of the
        noise. Without it the noise is measured by the span of the channel.
    memory : sequence of mapping, optional
        For each record, how many samples of each channel count as one; needed by `EffectiveSamples`.

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
    noise_keys = {f.prior_key for n in NOISE_MODELS.values() for f in n.parameters("force", "N", "s")}
    priors.check_names(model.spoken_of(), noise_keys)
    parameters: list[Parameter] = [priors.parameter(f, first.branch, scales) for f in facts]
    shared = np.arange(len(parameters))
    layout = []
    for i, record in enumerate(records):
        own = RecordScales.of([record]) if len(records) > 1 else scales
        own = own.with_residual(residual[i]) if residual is not None else own
        own = own.with_memory(memory[i]) if memory is not None else own
        places = {}
        for channel in record.channels:
            noise_facts = noise.parameters(channel, record.units[channel], record.units.get("time", "s"))
            at = len(parameters) + np.arange(len(noise_facts))
            for fact in noise_facts:
                parameter = priors.parameter(fact, record.branch, own, noise=True)
                name = f"{fact.name}[{record.condition.id}]" if len(records) > 1 else fact.name
                parameters.append(
                    Parameter(
                        name,
                        parameter.unit,
                        parameter.meaning,
                        parameter.prior,
                        parameter.source,
                        parameter.fixed,
                    )
                )
            places[channel] = at
        layout.append(Place(shared, places))
    return Posterior(tuple(records), model, noise, ParameterSpace(tuple(parameters)), tuple(layout))
