"""A transformation between the straight lines of two phases: what the rungs above the published curve share.

    u = T - midpoint
    y = (1 - s) (offset + cold_slope u) + s (offset + span + hot_slope u)

``s`` is the share of the transformation that has passed; it is all by which the rungs differ. With ``s`` a logistic
curve and no slopes this is Eq. (2) or (4). Force and displacement have such a curve each, and the stiffness along the
path is ``K = F'/X'``. Where both phases have slopes it tends to the finite ratio of those at both ends.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np
from scipy.special import expit

from sma_bayes.arrays import Floats
from sma_bayes.parameters.roles import Role
from sma_bayes.parameters.space import QUANTITY, ParameterSpec
from sma_bayes.quantities import per, quotient
from sma_bayes.response.base import Asymptote, ResponseModel
from sma_bayes.response.modified_sigmoid import channel_unit, log_cosh_squared

LETTERS = {"displacement": "A", "force": "B"}
"""Letter of the paper for each channel; the four parameters of the published curve keep their names."""
PUBLISHED = {"1": Role.SPAN, "2": Role.RATE, "3": Role.MIDPOINT, "4": Role.OFFSET}
ENDS = {Role.SECOND_RATE: "rate_2", Role.EFFECT: "peak"}
"""Ends of names that are not those of the role."""
SLOPES = (Role.COLD_SLOPE, Role.HOT_SLOPE)

Parameters = Mapping[str, Floats]
"""Parameters of one channel by role, each of shape (..., 1)."""


@dataclass(frozen=True, slots=True, eq=False)
class Share:
    """Share of the transformation that has passed, with its derivatives; arrays of shape (..., n).

    Attributes
    ----------
    value, first, second : ndarray
        The share, and its first and second derivative with respect to temperature.
    by : mapping of str to tuple of ndarray
        By role: derivative of `value` and of `first` with respect to each parameter but the midpoint.
    """

    value: Floats
    first: Floats
    second: Floats
    by: Mapping[str, tuple[Floats, Floats]]


@dataclass(frozen=True, slots=True, eq=False)
class Argument:
    """Argument ``a`` of a logistic share, with its derivatives; arrays of shape (..., n).

    Attributes
    ----------
    value, first, second : ndarray
    by : mapping of str to tuple of ndarray
        As those of `Share`.
    """

    value: Floats
    first: Floats
    second: Floats
    by: Mapping[str, tuple[Floats, Floats]]

    def share(self) -> Share:
        """The logistic curve of the argument."""
        s, rest = expit(self.value), expit(-self.value)
        steep, bend = s * rest, rest - s
        by = {role: (steep * a, steep * (bend * a * self.first + da)) for role, (a, da) in self.by.items()}
        second = steep * (bend * self.first**2 + self.second)
        return Share(s, steep * self.first, second, by)


def between(p: Parameters, u: Floats, share: Floats) -> Floats:
    """Curve between the lines of the two phases where a share of the transformation has passed."""
    apart = p[Role.SPAN] + (p[Role.HOT_SLOPE] - p[Role.COLD_SLOPE]) * u
    return np.asarray(p[Role.OFFSET] + p[Role.COLD_SLOPE] * u + share * apart)


@dataclass(frozen=True)
class PhaseLines(ResponseModel):
    """Two phases with straight lines and a transformation between them.

    Attributes
    ----------
    channels : tuple of str
        Force, displacement or both, and stiffness where both are there.
    sloped : bool
        Whether the phases have slopes.
    letters : mapping of str to str
        Channels that have a curve of their own, each with what its parameters' names begin with. The stiffness follows
        from those of force and displacement where it is not among them.
    own : mapping of str to Role
        Ends of the names of the parameters that every curve has.
    shape : tuple of Role
        Parameters of the share besides rate and midpoint.
    meanings : mapping of str to str
        What those are, by role.
    """

    contends = ()
    sloped: ClassVar[bool] = True
    letters: ClassVar[Mapping[str, str]] = LETTERS
    own: ClassVar[Mapping[str, Role]] = PUBLISHED
    shape: ClassVar[tuple[Role, ...]] = ()
    meanings: ClassVar[Mapping[str, str]] = {}

    @classmethod
    def refusal(cls, channels: Sequence[str]) -> str:
        """Stiffness alone is refused."""
        if "stiffness" in channels and not set(LETTERS) <= set(channels):
            return (
                "a stiffness without both force and displacement does not tell their slopes and shapes apart"
            )
        return super().refusal(channels)

    @classmethod
    def _wanted(cls) -> str:
        return "force, displacement, or both, with or without stiffness"

    @cached_property
    def _roles(self) -> tuple[tuple[str, Role], ...]:
        """End of each name, and role, of the parameters of one channel."""
        extra = (*(SLOPES if self.sloped else ()), *self.shape)
        return (*self.own.items(), *((f"_{ENDS.get(r, r)}", r) for r in extra))

    def _names(self, channel: str) -> tuple[str, ...]:
        """Names of the parameters of one channel."""
        return tuple(f"{self.letters[channel]}{end}".lstrip("_") for end, _ in self._roles)

    @property
    def linear(self) -> tuple[str, ...]:  # type: ignore[override]
        """Span, offset, slopes and height of a peak."""
        of = {Role.SPAN, Role.OFFSET, Role.EFFECT, *SLOPES}
        return tuple(
            name
            for channel in self.letters
            for name, (_, role) in zip(self._names(channel), self._roles, strict=True)
            if role in of
        )

    @cached_property
    def parameter_names(self) -> tuple[str, ...]:
        """Those of displacement, then those of force."""
        return tuple(
            name for channel in self.letters if channel in self.channels for name in self._names(channel)
        )

    def parameters(self, units: Mapping[str, str]) -> tuple[ParameterSpec, ...]:
        """Facts about the parameters."""
        degrees = units["temperature"]
        facts = []
        for channel in self.letters:
            if channel not in self.channels:
                continue
            unit = channel_unit(units, channel)
            known = {
                Role.SPAN: (unit, f"distance of the lines of the two phases of {QUANTITY}, at the midpoint"),
                Role.RATE: (per(degrees), f"rate of the transformation of {QUANTITY}"),
                Role.MIDPOINT: (degrees, f"temperature of the midpoint of {QUANTITY}"),
                Role.OFFSET: (unit, f"line of the cold phase of {QUANTITY}, at the midpoint"),
                Role.COLD_SLOPE: (quotient(unit, degrees), f"slope of {QUANTITY} in the cold phase"),
                Role.HOT_SLOPE: (quotient(unit, degrees), f"slope of {QUANTITY} in the hot phase"),
            }
            of_shape = {Role.GAP: degrees, Role.SECOND_RATE: per(degrees), Role.EFFECT: unit}
            for name, (_, role) in zip(self._names(channel), self._roles, strict=True):
                its_unit, meaning = known.get(role) or (
                    of_shape.get(role, "1"), f"{self.meanings[role]} of {QUANTITY}"
                )  # fmt: skip
                facts.append(
                    ParameterSpec(name, its_unit, meaning, prior_key=name, channel=channel, role=role)
                )
        return tuple(facts)

    @abstractmethod
    def share(self, p: Parameters, u: Floats) -> Share:
        """Share of the transformation at distances ``u`` (..., n) from the midpoint."""

    @abstractmethod
    def passed(self, p: Parameters, u: Floats) -> Floats:
        """The value of `share` alone, by the shortest way."""

    def value(self, p: Parameters, u: Floats) -> Floats:
        """Curve of a channel at distances ``u`` (..., n) from its midpoint."""
        return between(p, u, self.passed(p, u))

    def _of(self, channel: str, theta: Floats, t: Floats) -> tuple[dict[str, Floats], Floats]:
        """Parameters of one channel by role, and distances from its midpoint."""
        theta = np.asarray(theta, dtype=float)
        first = self._columns(channel)[0]
        p = {str(role): theta[..., first + i, None] for i, (_, role) in enumerate(self._roles)}
        if not self.sloped:
            p |= {str(role): np.zeros(1) for role in SLOPES}
        return p, t - p[Role.MIDPOINT]

    def predict(self, theta: Floats, inputs: Mapping[str, Floats]) -> dict[str, Floats]:
        """Response of each channel, shape (..., n)."""
        out = {}
        for channel in self.channels:
            if channel not in self.letters:
                out[channel] = self.stiffness(theta, inputs)
                continue
            p, u = self._of(channel, theta, inputs["temperature"])
            out[channel] = self.value(p, u)
        return out

    def slope(self, theta: Floats, inputs: Mapping[str, Floats]) -> dict[str, Floats]:
        """Derivative of each channel with respect to temperature, shape (..., n)."""
        parts = self._lines(theta, inputs)
        out = {}
        for channel in self.channels:
            if channel not in self.letters:
                k, relative = self._path(parts)
                with np.errstate(over="ignore", invalid="ignore"):
                    out[channel] = k * (relative["force"].bend - relative["displacement"].bend)
            else:
                out[channel] = parts[channel].first
        return out

    def curvature(self, theta: Floats, inputs: Mapping[str, Floats]) -> dict[str, Floats]:
        """Second derivative with respect to temperature, shape (..., n); of stiffness by differences."""
        lines = self._lines(theta, inputs)
        derived = not set(self.channels) <= set(self.letters)
        path = super().curvature(theta, inputs) if derived else {}
        return {c: lines[c].second if c in self.letters else path[c] for c in self.channels}

    def jacobian(self, theta: Floats, inputs: Mapping[str, Floats]) -> dict[str, Floats]:
        """Derivative of each channel with respect to each parameter, shape (..., n, P), in closed form."""
        parts = self._lines(theta, inputs)
        shape = np.broadcast_shapes((*np.shape(theta)[:-1], 1), inputs["temperature"].shape)
        out = {}
        for channel in self.channels:
            j = np.zeros((*shape, len(self.parameter_names)))
            if channel in self.letters:
                for i, (value, _) in zip(self._columns(channel), parts[channel].by, strict=True):
                    j[..., i] = value
            else:
                k, relative = self._path(parts)
                for side, own in ((1.0, "force"), (-1.0, "displacement")):
                    for i, change in zip(self._columns(own), relative[own].by, strict=True):
                        with np.errstate(over="ignore", invalid="ignore"):
                            j[..., i] = side * k * change
            out[channel] = j
        return out

    def _columns(self, channel: str) -> range:
        first = self.parameter_names.index(self._names(channel)[0])
        return range(first, first + len(self._roles))

    def stiffness(self, theta: Floats, inputs: Mapping[str, Floats]) -> Floats:
        """Stiffness along the path, ``F'/X'``, shape (..., n); where it has a curve of its own, that."""
        if "stiffness" in self.letters:
            return super().stiffness(theta, inputs)
        return self._path(self._lines(theta, inputs))[0]

    def limits(self, theta: Floats) -> dict[str, tuple[Asymptote, Asymptote]]:
        """The lines of the two phases; of stiffness the ratios of their slopes, where they have any."""
        out = {}
        slopes = {}
        for channel in self.letters:
            if channel not in self.channels:
                continue
            p = {role: np.broadcast_to(x, (*np.shape(theta)[:-1], 1))[..., 0]
                 for role, x in self._of(channel, theta, np.zeros(1))[0].items()}  # fmt: skip
            falls = p[Role.RATE] < 0.0
            ends = ((p[Role.OFFSET], p[Role.COLD_SLOPE]), (p[Role.OFFSET] + p[Role.SPAN], p[Role.HOT_SLOPE]))
            cold, hot = (
                [np.where(falls, there, here) for here, there in zip(mine, other, strict=True)]
                for mine, other in (ends, ends[::-1])
            )
            out[channel] = (Asymptote(p[Role.MIDPOINT], *cold), Asymptote(p[Role.MIDPOINT], *hot))
            slopes[channel] = (cold[1], hot[1], p[Role.MIDPOINT])
        if self.sloped and set(LETTERS) <= set(slopes):
            x, f = slopes["displacement"], slopes["force"]
            with np.errstate(divide="ignore", invalid="ignore"):
                low, high = (Asymptote(f[2], f[i] / x[i], np.zeros_like(f[2])) for i in (0, 1))
            out["stiffness"] = (low, high)
        return out

    def _lines(self, theta: Floats, inputs: Mapping[str, Floats]) -> dict[str, LineDerivatives]:
        """Curves of force and displacement, those that are there, with all their derivatives."""
        out = {}
        for channel in self.letters:
            if channel in self.channels:
                p, u = self._of(channel, theta, inputs["temperature"])
                out[channel] = self._line(p, u)
        return out

    def _line(self, p: Parameters, u: Floats) -> LineDerivatives:
        return self._between(p, u, self.share(p, u))

    def _between(self, p: Parameters, u: Floats, share: Share) -> LineDerivatives:
        turn = p[Role.HOT_SLOPE] - p[Role.COLD_SLOPE]
        apart = p[Role.SPAN] + turn * u
        s, ds, dds = share.value, share.first, share.second
        first = p[Role.COLD_SLOPE] + turn * s + apart * ds
        second = 2.0 * turn * ds + apart * dds
        by: list[tuple[Floats, Floats]] = []
        for _, role in self._roles:
            if role is Role.SPAN:
                by.append((s, ds))
            elif role is Role.MIDPOINT:
                by.append((-first, -second))
            elif role is Role.OFFSET:
                by.append((np.ones_like(s), np.zeros_like(s)))
            elif role is Role.COLD_SLOPE:
                by.append((u * (1.0 - s), (1.0 - s) - u * ds))
            elif role is Role.HOT_SLOPE:
                by.append((u * s, s + u * ds))
            elif role is Role.EFFECT:
                by.append((np.zeros_like(s), np.zeros_like(s)))
            else:
                value, change = share.by[role]
                by.append((apart * value, apart * change + turn * value))
        return LineDerivatives(first, second, tuple(by), p, u)

    def _path(self, parts: Mapping[str, LineDerivatives]) -> tuple[Floats, dict[str, _Relative]]:
        """Stiffness, and of force and displacement their slopes' derivatives relative to the slopes."""
        f, x = parts["force"], parts["displacement"]
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            k = np.asarray(f.first / x.first)
            return k, {c: line.relative() for c, line in parts.items()}


@dataclass(frozen=True, slots=True, eq=False)
class _Relative:
    """Derivatives of the logarithm of a slope: with respect to temperature, and to each parameter of the channel."""

    bend: Floats
    by: tuple[Floats, ...]


@dataclass(frozen=True, slots=True, eq=False)
class LineDerivatives:
    """Slope and curvature of one channel, and the derivatives of its value and slope by each of its parameters."""

    first: Floats
    second: Floats
    by: tuple[tuple[Floats, Floats], ...]
    p: Parameters
    u: Floats

    def relative(self) -> _Relative:
        return _Relative(self.second / self.first, tuple(change / self.first for _, change in self.by))


@dataclass(frozen=True)
class LogisticArgument(PhaseLines):
    """Phases whose share is a logistic curve of some argument.

    Without slopes both F' and X' vanish far from the midpoints, faster than floating-point numbers can follow. So the
    stiffness is taken from their logarithms then.
    """

    @abstractmethod
    def argument(self, p: Parameters, u: Floats) -> Argument:
        """Argument of the logistic curve at distances ``u`` (..., n) from the midpoint."""

    def share(self, p: Parameters, u: Floats) -> Share:
        """See `PhaseLines.share`."""
        return self.argument(p, u).share()

    def _path(self, parts: Mapping[str, LineDerivatives]) -> tuple[Floats, dict[str, _Relative]]:
        if self.sloped:
            return super()._path(parts)
        log, sign, relative = {}, {}, {}
        for channel, line in parts.items():
            a = self.argument(line.p, line.u)
            sign[channel] = np.sign(line.p[Role.SPAN]) * np.sign(a.first)
            with np.errstate(divide="ignore"):
                size = np.log(np.abs(line.p[Role.SPAN])) + np.log(np.abs(a.first))
            log[channel] = size - log_cosh_squared(a.value)
            bend = -np.tanh(0.5 * a.value)
            change = bend * a.first + a.second / a.first
            by = []
            for _, role in self._roles:
                if role is Role.SPAN:
                    by.append(1.0 / line.p[Role.SPAN] + np.zeros_like(change))
                elif role is Role.MIDPOINT:
                    by.append(-change)
                elif role is Role.OFFSET:
                    by.append(np.zeros_like(change))
                else:
                    value, first = a.by[role]
                    by.append(bend * value + first / a.first)
            relative[channel] = _Relative(change, tuple(by))
        with np.errstate(over="ignore"):
            k = sign["force"] * sign["displacement"] * np.exp(log["force"] - log["displacement"])
        return np.asarray(k), relative
