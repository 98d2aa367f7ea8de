"""The log-posterior of one record in terms that JAX and PyTensor can differentiate and compile.

Written once, for a module `xp` that offers `exp`, `log`, `log1p`, `where` and arithmetic: `jax.numpy` or
`pytensor.tensor`, and for its error function. Everything that belongs to a record is handed over as an array of a shape
that is the same for all records, so that one compilation serves a whole campaign; samples beyond the end of a record
have weight zero.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.fitting.posterior import Posterior
from sma_bayes.parameters.distributions import LogNormal, Normal, Uniform

HALF_LN_2PI, ROOT_HALF = 0.5 * math.log(2.0 * math.pi), math.sqrt(0.5)


@dataclass(frozen=True, slots=True)
class Form:
    """What is compiled: everything but the numbers of a record.

    Attributes
    ----------
    names : tuple of str
        Parameters, in the order of ``z``.
    channels : tuple of str
    autocorrelated : bool
        Whether the noise is AR(1); independent otherwise.
    logarithmic : tuple of bool
        Which parameters are sampled as logarithms.
    bounded : tuple of bool
        Which are sampled as probits, with a uniform prior.
    """

    names: tuple[str, ...]
    channels: tuple[str, ...]
    autocorrelated: bool
    logarithmic: tuple[bool, ...]
    bounded: tuple[bool, ...]

    @staticmethod
    def of(posterior: Posterior) -> Form:
        """Form of the posterior of one record in one sweep; other priors or noise are refused."""
        priors = [p.prior for p in posterior.space.free]
        (record,) = posterior.records
        if posterior.noise.name not in ("independent", "ar1") or record.temperature_sd:
            raise ValueError(f"{record.key}: only independent and AR(1) noise are written out")
        if not all(isinstance(p, Normal | LogNormal | Uniform) for p in priors):
            raise ValueError(f"{record.key}: a prior is of another family")
        return Form(
            posterior.names,
            record.channels,
            posterior.noise.name == "ar1",
            tuple(isinstance(p, LogNormal) for p in priors),
            tuple(isinstance(p, Uniform) for p in priors),
        )


def length_for(posterior: Posterior) -> int:
    """Samples that arrays are filled up to: the same for all records of the twin campaign."""
    return max(128, posterior.n)


def numbers(posterior: Posterior, length: int) -> dict[str, Floats]:
    """Arrays of a record, filled up to `length` samples of weight zero: what `log_prob` takes besides ``z``."""
    (record,) = posterior.records
    n = record.n

    def filled(values: Floats) -> Floats:
        return np.concatenate([values, np.full(length - n, values[-1])])

    first, second = [], []
    for parameter in posterior.space.free:
        prior = parameter.prior
        if isinstance(prior, Normal):
            first.append(prior.mean)
            second.append(prior.sd)
        elif isinstance(prior, LogNormal):
            first.append(math.log(prior.median))
            second.append(prior.sigma)
        else:
            first.append(prior.low)
            second.append(prior.high - prior.low)
    sign = [float(getattr(p.prior, "sign", 1.0)) for p in posterior.space.free]
    last = {"last": (np.arange(length) == n - 1).astype(float)} if posterior.noise.name == "ar1" else {}
    return {
        "temperature": filled(record.temperature),
        "weight": (np.arange(length) < n).astype(float),
        **last,
        "first_of_prior": np.array(first),
        "second_of_prior": np.array(second),
        "sign": np.array(sign),
        **{channel: filled(record.observed[channel]) for channel in record.channels},
    }


def log_prob(xp: Any, erf: Any, form: Form, z: Any, data: dict[str, Any]) -> Any:
    """Log of the unnormalised posterior density at one point ``z`` (D,)."""
    theta, total = {}, 0.0
    for i, name in enumerate(form.names):
        first, second = data["first_of_prior"][i], data["second_of_prior"][i]
        if form.bounded[i]:
            theta[name] = first + 0.5 * second * (1.0 + erf(z[i] * ROOT_HALF))
            total = total - 0.5 * z[i] ** 2 - HALF_LN_2PI
        else:
            total = total - 0.5 * ((z[i] - first) / second) ** 2 - xp.log(second) - HALF_LN_2PI
            theta[name] = data["sign"][i] * xp.exp(z[i]) if form.logarithmic[i] else z[i]
    weight = data["weight"]
    n = weight.sum()
    for channel in form.channels:
        e = weight * (data[channel] - _response(xp, channel, theta, data["temperature"]))
        sd = theta[f"{channel}_sd"]
        squares = (e * e).sum()
        total = total - n * (xp.log(sd) + HALF_LN_2PI)
        if form.autocorrelated:
            phi = theta[f"{channel}_phi"]
            left = 1.0 - phi * phi
            start, end = e[0] ** 2, (data["last"] * e * e).sum()
            follow = squares - start - 2.0 * phi * (e[1:] * e[:-1]).sum() + phi * phi * (squares - end)
            squares = start + follow / left
            total = total - 0.5 * (n - 1.0) * xp.log(left)
        total = total - 0.5 * squares / (sd * sd)
    return total


def _response(xp: Any, channel: str, theta: dict[str, Any], t: Any) -> Any:
    if channel == "stiffness":
        a = _log_cosh_squared(xp, theta["A2"] * (t - theta["A3"]))
        b = _log_cosh_squared(xp, theta["B2"] * (t - theta["B3"]))
        return theta["B1"] * theta["B2"] / (theta["A1"] * theta["A2"]) * xp.exp(a - b)
    letter = "B" if channel == "force" else "A"
    size, rate, middle, offset = (theta[f"{letter}{i}"] for i in (1, 2, 3, 4))
    return offset + size / (1.0 + xp.exp(-rate * (t - middle)))


def _log_cosh_squared(xp: Any, x: Any) -> Any:
    size = xp.where(x > 0.0, x, -x)
    return size + 2.0 * xp.log1p(xp.exp(-size))
