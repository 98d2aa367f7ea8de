"""The polynomial of Eq. (11): the other model that the paper compares itself with.

    K = a1 + a2 f + a3 f**2 + a4 T

f is the frequency of the drive [mHz]. It is linear in its coefficients. At a single frequency the first three columns
are multiples of one another and the data determine two combinations, ``a1 + a2 f + a3 f**2`` and ``a4``; two
frequencies determine three, three or more all four. Here only what is determined is a parameter:

    K = level + a4 (T - T0) + linear g + square g**2,      g = (f - f0)/(greatest f - least f)

where T0 is the middle of the temperatures and f0 the mean of the frequencies.

References
----------
Raczka et al. (2011) as cited by the paper, where f is an excitation of vibration; the paper, line 375.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final, Self

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.parameters.roles import Role
from sma_bayes.parameters.space import QUANTITY, ParameterSpec
from sma_bayes.quantities import quotient
from sma_bayes.records.types import Record
from sma_bayes.response.base import ResponseModel, Variant

FREQUENCY: Final = "frequency"
"""Input that Eq. (11) reads: frequency of the drive [mHz]."""

_NAMES: Final = ("level", "a4", "linear", "square")


@dataclass(frozen=True)
class Polynomial(ResponseModel):
    """Eq. (11) for one channel, with as many parameters as the frequencies determine.

    Attributes
    ----------
    channels : tuple of str
        One channel.
    temperature : float
        T0 [unit of temperature].
    frequencies : tuple of float
        Frequencies of the records that share the parameters [mHz]; with fewer than two different ones the
        frequency does not enter, and none need be known.
    """

    channels: tuple[str, ...] = ("stiffness",)
    temperature: float = 0.0
    frequencies: tuple[float, ...] = ()
    name = "polynomial"
    reference = "Eq. (11)"
    together = False
    contends = (
        Variant("polynomial_published", "polynomial, Eq. (11) as printed", "published"),
        Variant("polynomial_corrected", "polynomial, what the data determine of it", "corrected"),
        Variant("polynomial_refitted", "polynomial, across frequencies where there are", "refitted"),
    )

    @classmethod
    def made_for(cls, records: Sequence[Record]) -> Self:
        """Eq. (11) about the middle of the temperatures of some records, with the frequencies that are their input."""
        temperature = np.concatenate([r.temperature for r in records])
        middle = 0.5 * float(temperature.min() + temperature.max())
        known = [r.inputs[FREQUENCY] for r in records if FREQUENCY in r.inputs]
        frequencies = np.unique(np.concatenate(known)).tolist() if known else []
        return cls(records[0].channels, middle, tuple(frequencies))

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """``level`` and ``a4``; ``linear`` from two different frequencies, ``square`` from three."""
        different = len(set(self.frequencies))
        return _NAMES[: 2 + min(max(different - 1, 0), 2)]

    def spoken_of(self) -> frozenset[str]:
        """All coefficients, also where too few frequencies determine them."""
        return frozenset(_NAMES)

    def parameters(self, units: Mapping[str, str]) -> tuple[ParameterSpec, ...]:
        """Facts about the parameters, for the units of temperature and of the channel."""
        (channel,) = self.channels
        unit, kelvin = units[channel], units["temperature"]
        steep = quotient(unit, kelvin)
        rows = {
            "level": (Role.LEVEL, unit, f"{QUANTITY} at the middle temperature and the mean frequency"),
            "a4": (Role.SLOPE, steep, f"slope of {QUANTITY} with temperature"),
            "linear": (
                Role.EFFECT,
                unit,
                f"change of {QUANTITY} from the least to the greatest frequency, linear part",
            ),
            "square": (Role.EFFECT, unit, f"curvature of {QUANTITY} over the range of frequencies"),
        }
        return tuple(
            ParameterSpec(name, *rows[name][1:], prior_key=name, channel=channel, role=rows[name][0])
            for name in self.parameter_names
        )

    def design(self, inputs: Mapping[str, Floats]) -> Floats:
        """Columns by which the parameters are multiplied, shape (..., n, P).

        Parameters
        ----------
        inputs : mapping of str to ndarray, shape (n,) or (..., n)
            ``temperature``, and ``frequency`` [mHz] where there are several.
        """
        away = inputs["temperature"] - self.temperature
        columns = [np.ones_like(away), away]
        if len(self.parameter_names) > 2:
            f = np.unique(self.frequencies)
            g = (inputs[FREQUENCY] - f.mean()) / np.ptp(f)
            columns += [g, g * g][: len(self.parameter_names) - 2]
        return np.stack(np.broadcast_arrays(*columns), axis=-1)

    def predict(self, theta: Floats, inputs: Mapping[str, Floats]) -> dict[str, Floats]:
        """Response of the channel, shape (..., n)."""
        theta = np.asarray(theta, dtype=float)[..., None]
        return {self.channels[0]: (self.design(inputs) @ theta)[..., 0]}

    def slope(self, theta: Floats, inputs: Mapping[str, Floats]) -> dict[str, Floats]:
        """Derivative with respect to temperature, shape (..., n)."""
        a4 = np.asarray(theta, dtype=float)[..., 1, None]
        return {self.channels[0]: a4 * np.ones_like(inputs["temperature"])}

    def jacobian(self, theta: Floats, inputs: Mapping[str, Floats]) -> dict[str, Floats]:
        """Derivative with respect to each parameter, shape (..., n, P)."""
        design = self.design(inputs)
        leading = np.broadcast_shapes(np.shape(theta)[:-1], design.shape[:-2])
        return {self.channels[0]: np.broadcast_to(design, (*leading, *design.shape[-2:])).copy()}


@dataclass(frozen=True, slots=True)
class PolynomialFit:
    """Eq. (11) by least squares.

    Attributes
    ----------
    coefficients : tuple of float
        a1 to a4; of all that fit equally well those of least norm.
    rank : int
        How many combinations of them the data determine.
    """

    coefficients: tuple[float, float, float, float]
    rank: int


def least_squares(temperature: Floats, frequency: Floats, values: Floats) -> PolynomialFit:
    """Solve Eq. (11) by least squares, exactly, by singular values.

    Parameters
    ----------
    temperature, frequency, values : ndarray, shape (n,)
        [degC], [mHz], and the channel.

    Examples
    --------
    >>> t = np.array([20.0, 40.0, 60.0, 80.0])
    >>> least_squares(t, np.full(4, 10.0), 5.0 + 0.5 * t).rank
    2
    """
    design = np.stack([np.ones_like(temperature), frequency, frequency**2, temperature], axis=1)
    size = np.linalg.norm(design, axis=0)
    size[size == 0.0] = 1.0  # a drive of zero frequency
    solution, _, rank, _ = np.linalg.lstsq(design / size, values, rcond=1e-10)
    a1, a2, a3, a4 = (float(x) for x in solution / size)
    return PolynomialFit((a1, a2, a3, a4), int(rank))


def frequencies_of(frequencies: Sequence[float | None]) -> tuple[float, ...]:
    """Frequencies [mHz] of records, from those of their conditions [Hz]; none where one is not known."""
    known = [f for f in frequencies if f is not None]
    return tuple(1e3 * f for f in known) if len(known) == len(frequencies) else ()
