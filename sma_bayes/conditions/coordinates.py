"""Coordinates in which conditions are compared: those in which what differs between conditions is least entangled.

Eq. (7) depends on B1/A1 alone, midpoints of force and displacement move together, and so do their rates. So spans and
rates are taken as logarithms, and where a record has both A and B, as their mean and their difference:

    ln(B1/A1), ln(A1 B1)/2;   ln(B2/A2), ln(A2 B2)/2;   B3 - A3, (A3 + B3)/2

The level is that far below the midpoint (A4, B4) or far above it (A4 + A1, B4 + B1), whichever differs less between
the conditions: a reading that is zeroed at one end is constant there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from sma_bayes.conditions.draws import RecordDraws
from sma_bayes.errors import MeasurementError
from sma_bayes.parameters.distributions import Distribution
from sma_bayes.quantities import Floats

LEVELS = {"A4": "A1", "B4": "B1"}
"""Levels far below the midpoint, with the span that leads to the level far above it."""
TEN_TO_NINETY = 2.0 * float(np.log(9.0))
"""Width of a sigmoid of rate 1 from 10 to 90 %: 4.39."""
PRIOR_DRAWS = 4000


@dataclass(frozen=True, eq=False)
class Coordinates:
    """Map between parameters ``theta`` (..., P) and coordinates ``phi`` (..., P); volumes are kept but for logarithms.

    Attributes
    ----------
    names : tuple of str
        Parameters, in the order of ``theta``.
    signs : ndarray, shape (P,)
        Sign of those that are taken as logarithms (spans and rates), 0 for the others.
    hot : tuple of str
        Levels that are taken far above the midpoint: any of A4, B4.
    """

    names: tuple[str, ...]
    signs: Floats
    hot: tuple[str, ...]
    mixing: Floats = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "mixing", _mixing(self.names))

    @property
    def labels(self) -> tuple[str, ...]:
        """What each coordinate is."""
        single = [f"ln {n}" if self.signs[i] else n for i, n in enumerate(self.names)]
        single = [f"{n} + {LEVELS[n]}" if n in self.hot else n for n in single]
        out = list(single)
        for i, name in enumerate(self.names):
            twin = _twin(name)
            if name[0] == "A" and twin in self.names and name[1] != "4":
                a, b = single[i], single[self.names.index(twin)]
                out[i], out[self.names.index(twin)] = f"({a} + {b})/2", f"{b} - {a}"
        return tuple(out)

    def to_coordinates(self, theta: Floats) -> Floats:
        """Coordinates (..., P) of parameters (..., P)."""
        x = np.array(theta, dtype=float)
        for name in self.hot:
            x[..., self._at(name)] += x[..., self._at(LEVELS[name])]
        logs = self.signs != 0.0
        x[..., logs] = np.log(x[..., logs] * self.signs[logs])
        return np.asarray(x @ self.mixing.T)

    def to_parameters(self, phi: Floats) -> Floats:
        """Parameters (..., P) at coordinates (..., P)."""
        x = np.asarray(phi) @ np.linalg.inv(self.mixing).T
        logs = self.signs != 0.0
        with np.errstate(over="ignore"):
            x[..., logs] = self.signs[logs] * np.exp(x[..., logs])
        for name in self.hot:
            x[..., self._at(name)] -= x[..., self._at(LEVELS[name])]
        return np.asarray(x)

    def log_prior(self, priors: Sequence[Distribution], theta: Floats) -> Floats:
        """Log density, in the coordinates, of independent priors of the parameters ``theta`` (..., P); shape (...)."""
        total = np.zeros(np.shape(theta)[:-1])
        for i, prior in enumerate(priors):
            total = total + prior.log_density(theta[..., i])
            if self.signs[i]:
                total = total + np.log(np.abs(theta[..., i]))
        return np.asarray(total)

    def prior_moments(self, priors: Sequence[Distribution]) -> tuple[Floats, Floats]:
        """Mean (P,) and covariance (P, P) of the prior in the coordinates, by draws of a fixed seed."""
        rng = np.random.default_rng(0)
        p = (np.arange(PRIOR_DRAWS) + 0.5) / PRIOR_DRAWS
        theta = np.stack([prior.quantile(rng.permutation(p)) for prior in priors], axis=-1)
        phi = self.to_coordinates(theta)
        return phi.mean(axis=0), np.cov(phi.T).reshape(phi.shape[1], phi.shape[1])

    def yardsticks(self, records: Sequence[RecordDraws]) -> Floats:
        """What a curve has by itself to measure differences by, in each coordinate, shape (P,).

        1 for logarithms, 4.4/rate (from 10 to 90 % of the transformation) for midpoints, the span for levels; medians
        over the conditions, and of A and B the geometric mean where they are joined.
        """
        size = {n: float(np.median([np.median(np.abs(r.parameter(n))) for r in records])) for n in self.names}
        own = {"1": lambda a: 1.0, "2": lambda a: 1.0, "3": lambda a: TEN_TO_NINETY / size[f"{a}2"],
               "4": lambda a: size[f"{a}1"]}  # fmt: skip
        single = {n: own[n[1]](n[0]) for n in self.names}
        return np.array([
            single[n] if n[1] == "4" else np.sqrt(single[n] * single.get(_twin(n), single[n])) for n in self.names
        ])  # fmt: skip

    def _at(self, name: str) -> int:
        return self.names.index(name)


def _twin(name: str) -> str:
    return ("B" if name[0] == "A" else "A") + name[1]


def _mixing(names: tuple[str, ...]) -> Floats:
    """Matrix that turns A and B into mean and difference; of determinant 1 in magnitude."""
    mixing = np.eye(len(names))
    for i, name in enumerate(names):
        twin = _twin(name)
        if name[0] == "A" and twin in names and name[1] != "4":
            j = names.index(twin)
            mixing[i, [i, j]] = 0.5, 0.5
            mixing[j, [i, j]] = -1.0, 1.0
    return mixing


def coordinates_for(records: Sequence[RecordDraws]) -> Coordinates:
    """Coordinates for records of several conditions.

    Parameters
    ----------
    records : sequence of RecordDraws
        Of one branch, with the same channels.

    Raises
    ------
    MeasurementError
        If a span or rate is positive in one record and negative in another.
    """
    names = records[0].names
    signs = np.zeros(len(names))
    for i, name in enumerate(names):
        if name[1] in "12":
            found = {float(s) for r in records for s in np.unique(np.sign(r.theta[:, i]))}
            if len(found) > 1 or 0.0 in found:
                raise MeasurementError(
                    f"{name} is positive in some and negative in others of {', '.join(r.key for r in records)}",
                    expected="curves that all rise or all fall with temperature",
                    remedy="leave conditions of another kind out of the campaign",
                )
            signs[i] = found.pop()
    hot = tuple(n for n in LEVELS if n in names and _spread(records, n, LEVELS[n]) < _spread(records, n))
    return Coordinates(names, signs, hot)


def _spread(records: Sequence[RecordDraws], *names: str) -> float:
    """Standard deviation, between conditions, of the average of a sum of parameters."""
    return float(np.std([sum(float(r.parameter(n).mean()) for n in names) for r in records]))
