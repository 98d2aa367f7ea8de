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

from sma_bayes.arrays import Floats
from sma_bayes.assess.draws import RecordDraws
from sma_bayes.errors import MeasurementError
from sma_bayes.parameters.distributions import Distribution
from sma_bayes.parameters.roles import Role
from sma_bayes.parameters.space import ParameterSpec
from sma_bayes.response.base import ResponseModel

LOGARITHMIC_ROLES = frozenset({Role.SPAN, Role.RATE, Role.SECOND_RATE, Role.WIDTH, Role.TAIL, Role.GAP})
"""Roles that are taken as logarithms: what differs between conditions multiplies them."""
JOINED_ROLES = (Role.SPAN, Role.RATE, Role.MIDPOINT)
"""Roles whose mean and difference over displacement and force are taken, in place of both."""
TEN_TO_NINETY_WIDTH = 2.0 * float(np.log(9.0))
"""Width of a sigmoid of rate 1 from 10 to 90 %: 4.39."""
PRIOR_DRAWS = 4000


@dataclass(frozen=True, eq=False)
class CurveCoordinates:
    """Map between parameters ``theta`` (..., P) and coordinates ``phi`` (..., P); volumes are kept but for logarithms.

    Attributes
    ----------
    names : tuple of str
        Parameters, in the order of ``theta``.
    signs : ndarray, shape (P,)
        Sign of those that are taken as logarithms (spans and rates), 0 for the others.
    hot : tuple of str
        Levels that are taken far above the midpoint: any of A4, B4.
    model : ResponseModel
        Whose parameters they are.
    """

    names: tuple[str, ...]
    signs: Floats
    hot: tuple[str, ...]
    model: ResponseModel
    mixing: Floats = field(init=False, repr=False)

    def __post_init__(self) -> None:
        mixing = np.eye(len(self.names))
        for i, j in _joined(self.model):
            mixing[i, [i, j]] = 0.5, 0.5
            mixing[j, [i, j]] = -1.0, 1.0
        object.__setattr__(self, "mixing", mixing)

    @property
    def labels(self) -> tuple[str, ...]:
        """What each coordinate is."""
        single = [f"ln {n}" if self.signs[i] else n for i, n in enumerate(self.names)]
        spans = _levels(self.model)
        single = [f"{n} + {spans[n]}" if n in self.hot else n for n in single]
        out = list(single)
        for i, j in _joined(self.model):
            out[i], out[j] = f"({single[i]} + {single[j]})/2", f"{single[j]} - {single[i]}"
        return tuple(out)

    def to_coordinates(self, theta: Floats) -> Floats:
        """Coordinates (..., P) of parameters (..., P)."""
        x = np.array(theta, dtype=float)
        spans = _levels(self.model)
        for name in self.hot:
            x[..., self._at(name)] += x[..., self._at(spans[name])]
        logs = self.signs != 0.0
        x[..., logs] = np.log(x[..., logs] * self.signs[logs])
        return np.asarray(x @ self.mixing.T)

    def to_parameters(self, phi: Floats) -> Floats:
        """Parameters (..., P) at coordinates (..., P)."""
        x = np.asarray(phi) @ np.linalg.inv(self.mixing).T
        logs = self.signs != 0.0
        with np.errstate(over="ignore"):
            x[..., logs] = self.signs[logs] * np.exp(x[..., logs])
        spans = _levels(self.model)
        for name in self.hot:
            x[..., self._at(name)] -= x[..., self._at(spans[name])]
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

    def characteristic_scales(self, records: Sequence[RecordDraws]) -> Floats:
        """Scales of a curve in which differences are measured, in each coordinate, shape (P,).

        1 for logarithms, 4.4/rate (from 10 to 90 % of the transformation) for midpoints, the span for levels; medians
        over the conditions, and of A and B the geometric mean where they are joined.
        """
        single = np.array([self._characteristic_scale(fact, records) for fact in self.model.facts])
        out = single.copy()
        for i, j in _joined(self.model):
            out[i] = out[j] = np.sqrt(single[i] * single[j])
        return out

    def _characteristic_scale(self, fact: ParameterSpec, records: Sequence[RecordDraws]) -> float:
        def size(role: Role) -> float | None:
            name = self.model.with_role(role, fact.channel)
            return None if name is None else _typical(records, name)

        width, span, rate = size(Role.WIDTH), size(Role.SPAN), size(Role.RATE)
        if width is None and rate:
            width = TEN_TO_NINETY_WIDTH / rate
        if fact.role in LOGARITHMIC_ROLES:
            return 1.0
        if fact.role is Role.MIDPOINT and width:
            return width
        if fact.role in (Role.OFFSET, Role.LEVEL, Role.EFFECT) and span:
            return span
        if fact.role in (Role.COLD_SLOPE, Role.HOT_SLOPE, Role.SLOPE) and span and width:
            return span / width
        if fact.role in (Role.SKEW, Role.SHARE):
            return 1.0
        return _typical(records, fact.name) or 1.0

    def _at(self, name: str) -> int:
        return self.names.index(name)


def _typical(records: Sequence[RecordDraws], name: str) -> float:
    """Magnitude of a parameter: median over the conditions of its median."""
    return float(np.median([np.median(np.abs(r.parameter(name))) for r in records]))


def _joined(model: ResponseModel) -> tuple[tuple[int, int], ...]:
    """Positions of the parameters of displacement and force that are joined."""
    pairs = [[model.position(role, c) for c in ("displacement", "force")] for role in JOINED_ROLES]
    return tuple((i, j) for i, j in pairs if i is not None and j is not None)


def _levels(model: ResponseModel) -> dict[str, str]:
    """Levels far below the midpoint, with the span that leads to the level far above it."""
    out = {}
    for fact in model.facts:
        span = model.with_role(Role.SPAN, fact.channel)
        if fact.role is Role.OFFSET and span is not None:
            out[fact.name] = span
    return out


def coordinates_for(records: Sequence[RecordDraws]) -> CurveCoordinates:
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
    names, model = records[0].names, records[0].posterior.model
    signs = np.zeros(len(names))
    for i, fact in enumerate(model.facts):
        name = fact.name
        if fact.role in LOGARITHMIC_ROLES:
            found = {float(s) for r in records for s in np.unique(np.sign(r.theta[:, i]))}
            if len(found) > 1 or 0.0 in found:
                raise MeasurementError(
                    f"{name} is positive in some and negative in others of {', '.join(r.key for r in records)}",
                    expected="curves that all rise or all fall with temperature",
                    remedy="leave conditions of another kind out of the campaign",
                )
            signs[i] = found.pop()
    spans = _levels(model)
    hot = tuple(n for n, span in spans.items() if _spread(records, n, span) < _spread(records, n))
    return CurveCoordinates(names, signs, hot, model)


def _spread(records: Sequence[RecordDraws], *names: str) -> float:
    """Standard deviation, between conditions, of the average of a sum of parameters."""
    return float(np.std([sum(float(r.parameter(n).mean()) for n in names) for r in records]))
