"""The modified sigmoid: force, displacement and stiffness against temperature, Eqs. (2), (4) and (7).

    F = B4 + B1/(1 + exp(-B2 (T - B3)))        X = A4 + A1/(1 + exp(-A2 (T - A3)))

    K = dF/dX = (B1 B2)/(A1 A2) * [cosh(A2 (T - A3)/2) / cosh(B2 (T - B3)/2)]**2

The last line is Eq. (7) with the exponentials gathered into hyperbolic cosines, which neither overflow nor
cancel when their logarithms are taken.

References
----------
"Modified sigmoid based model and experimental analysis of shape memory alloy spring as variable stiffness
actuator", Smart Structures and Systems (Techno-Press, 2019), Eqs. (1)-(8). The paper calls A2 and B2 rates in
m/degC and N/degC, A3 and B3 initial temperatures; in the equations A2 and B2 are in 1/degC, A3 and B3 are
the temperatures of the midpoints, and A4, B4 the values far below them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.special import expit

from sma_bayes.arrays import Bools, Floats
from sma_bayes.parameters.roles import Role
from sma_bayes.parameters.space import QUANTITY, ParameterSpec
from sma_bayes.quantities import ARBITRARY, CHANNELS, per
from sma_bayes.response.base import Asymptote, ResponseModel, Variant, in_order


def sigmoid(temperature: Floats, amplitude: Floats, rate: Floats, midpoint: Floats, offset: Floats) -> Floats:
    """Sigmoid of Eqs. (2) and (4).

    Parameters
    ----------
    temperature : ndarray
        T [degC]. All arguments broadcast.
    amplitude, rate, midpoint, offset : ndarray
        A1, A2 [1/degC], A3 [degC], A4, or B1 to B4.

    Returns
    -------
    ndarray
        ``offset + amplitude/(1 + exp(-rate (temperature - midpoint)))``.

    Examples
    --------
    >>> import numpy as np
    >>> float(sigmoid(np.array(50.0), 2.0, 0.3, 50.0, 1.0))
    2.0
    """
    x = np.empty(np.broadcast(temperature, amplitude, rate, midpoint, offset).shape)
    np.subtract(temperature, midpoint, out=x)  # all in place: memory traffic is most of the time of a batch
    x *= -rate
    with np.errstate(over="ignore"):  # infinite where the sigmoid is zero; three times as fast as expit
        np.exp(x, out=x)
    x += 1.0
    np.divide(amplitude, x, out=x)
    x += offset
    return x


def sigmoid_slope(temperature: Floats, amplitude: Floats, rate: Floats, midpoint: Floats) -> Floats:
    """Derivative of `sigmoid` with respect to temperature."""
    fade = np.abs(rate * (temperature - midpoint))
    np.negative(fade, out=fade)  # in place, and twice as fast as expit, as in `sigmoid`
    np.exp(fade, out=fade)
    share = fade + 1.0
    share *= share
    np.divide(fade, share, out=share)
    share *= amplitude * rate
    return share


def log_cosh_squared(x: Floats) -> Floats:
    """Natural logarithm of ``4 cosh(x/2)**2``, exact for any size of `x`.

    Examples
    --------
    >>> import numpy as np
    >>> float(log_cosh_squared(np.array(-1e4)))
    10000.0
    """
    size = np.abs(x)
    rest = np.negative(size, out=np.empty_like(size))  # in place, as in `sigmoid`
    np.exp(rest, out=rest)
    np.log1p(rest, out=rest)
    rest *= 2.0
    rest += size
    return rest


def log_stiffness_shape(temperature: Floats, a2: Floats, a3: Floats, b2: Floats, b3: Floats) -> Floats:
    """Logarithm of the part of Eq. (7) that changes with temperature, ``[cosh(A2 (T-A3)/2)/cosh(B2 (T-B3)/2)]**2``."""
    return log_cosh_squared(a2 * (temperature - a3)) - log_cosh_squared(b2 * (temperature - b3))


def log_stiffness(
    temperature: Floats, a1: Floats, a2: Floats, a3: Floats, b1: Floats, b2: Floats, b3: Floats
) -> Floats:
    """Natural logarithm of the magnitude of the stiffness, Eq. (7).

    Parameters
    ----------
    temperature : ndarray
        T [degC]. All arguments broadcast.
    a1, a2, a3, b1, b2, b3 : ndarray
        A1 [m], A2 [1/degC], A3 [degC], B1 [N], B2 [1/degC], B3 [degC]; A1, A2, B1, B2 not zero.

    Returns
    -------
    ndarray
        ``ln abs(K)`` with K in N/m. It is finite where K itself would overflow.
    """
    scale = np.log(np.abs(b1 * b2)) - np.log(np.abs(a1 * a2))
    return np.asarray(scale + log_stiffness_shape(temperature, a2, a3, b2, b3))


def stiffness(
    temperature: Floats, a1: Floats, a2: Floats, a3: Floats, b1: Floats, b2: Floats, b3: Floats
) -> Floats:
    """Stiffness of Eq. (7): the slope dF/dX along the actuation path [N/m]; see `log_stiffness`."""
    sign = np.sign(b1) * np.sign(b2) * np.sign(a1) * np.sign(a2)
    k = log_stiffness(temperature, a1, a2, a3, b1, b2, b3)
    with np.errstate(over="ignore"):  # one exponential of everything: its parts may overflow where K does not
        np.exp(k, out=k)
    return np.asarray(sign * k)


EQUAL_RATE_TOLERANCE = 1e-6
"""Rates that differ by a smaller share count as equal: Eq. (7) is then bounded at every temperature that matters."""
_MEANING = {
    "A1": f"span of the {QUANTITY} sigmoid",
    "A2": f"rate of the {QUANTITY} sigmoid",
    "A3": f"temperature of the midpoint of the {QUANTITY} sigmoid",
    "A4": f"{QUANTITY} far below A3",
    "B1": f"span of the {QUANTITY} sigmoid",
    "B2": f"rate of the {QUANTITY} sigmoid",
    "B3": f"temperature of the midpoint of the {QUANTITY} sigmoid",
    "B4": f"{QUANTITY} far below B3",
}
_ROLE = {
    "1": Role.SPAN,
    "2": Role.RATE,
    "3": Role.MIDPOINT,
    "4": Role.OFFSET,
}
_LETTER = {"displacement": "A", "force": "B"}
_NEEDS = {
    "displacement": ("A1", "A2", "A3", "A4"),
    "force": ("B1", "B2", "B3", "B4"),
    "stiffness": ("A1", "A2", "A3", "B1", "B2", "B3"),
}


@dataclass(frozen=True)
class ModifiedSigmoid(ResponseModel):
    """The modified sigmoid for a given set of channels.

    Attributes
    ----------
    channels : tuple of str
        What is predicted: any of force, displacement, stiffness. Displacement needs A1 to A4, force B1 to B4,
        stiffness A1 to A3 and B1 to B3.
    """

    channels: tuple[str, ...] = CHANNELS
    name = "modified_sigmoid"
    rung = 1
    reference = "Eqs. (2), (4) and (7) of the published model"
    linear = ("A1", "A4", "B1", "B4")
    contends = (Variant("modified_sigmoid", "modified sigmoid, Eqs. (2), (4) and (7)"),)

    @cached_property
    def parameter_names(self) -> tuple[str, ...]:
        """Parameters that the channels need, in the order of ``theta``."""
        needed = {name for channel in self.channels for name in _NEEDS[channel]}
        return tuple(name for name in _MEANING if name in needed)

    def parameters(self, units: Mapping[str, str]) -> tuple[ParameterSpec, ...]:
        """Facts about the parameters.

        Parameters
        ----------
        units : mapping of str to str
            Unit of temperature and of the observed channels; where only stiffness was observed the units of
            force and displacement are taken from its own.
        """
        per_kelvin = per(units["temperature"])
        of = {
            "1": lambda letter: channel_unit(units, "displacement" if letter == "A" else "force"),
            "2": lambda letter: per_kelvin,
            "3": lambda letter: units["temperature"],
            "4": lambda letter: channel_unit(units, "displacement" if letter == "A" else "force"),
        }
        return tuple(
            ParameterSpec(
                name,
                of[name[1]](name[0]),
                _MEANING[name],
                prior_key=name,
                channel="displacement" if name[0] == "A" else "force",
                role=_ROLE[name[1]],
            )
            for name in self.parameter_names
        )

    def _get(self, theta: Floats) -> dict[str, Floats]:
        theta = np.asarray(theta)
        return {name: theta[..., i, None] for i, name in enumerate(self.parameter_names)}

    def predict(self, theta: Floats, inputs: Mapping[str, Floats]) -> dict[str, Floats]:
        """Response of each channel.

        Parameters
        ----------
        theta : ndarray, shape (..., P)
            One parameter vector, all walkers or all draws, in the order of `parameter_names`.
        inputs : mapping of str to ndarray, shape (n,)
            ``temperature`` is used.

        Returns
        -------
        dict of str to ndarray, shape (..., n)
        """
        t = inputs["temperature"]
        p = self._get(theta)
        out = {}
        for channel in self.channels:
            if channel == "force":
                out[channel] = sigmoid(t, p["B1"], p["B2"], p["B3"], p["B4"])
            elif channel == "displacement":
                out[channel] = sigmoid(t, p["A1"], p["A2"], p["A3"], p["A4"])
            else:
                out[channel] = stiffness(t, p["A1"], p["A2"], p["A3"], p["B1"], p["B2"], p["B3"])
        return out

    def slope(self, theta: Floats, inputs: Mapping[str, Floats]) -> dict[str, Floats]:
        """Derivative of each channel with respect to temperature, shape (..., n)."""
        t = inputs["temperature"]
        p = self._get(theta)
        out = {}
        for channel in self.channels:
            if channel == "force":
                out[channel] = sigmoid_slope(t, p["B1"], p["B2"], p["B3"])
            elif channel == "displacement":
                out[channel] = sigmoid_slope(t, p["A1"], p["A2"], p["A3"])
            else:
                k = stiffness(t, p["A1"], p["A2"], p["A3"], p["B1"], p["B2"], p["B3"])
                rise = p["A2"] * np.tanh(0.5 * p["A2"] * (t - p["A3"]))
                fall = p["B2"] * np.tanh(0.5 * p["B2"] * (t - p["B3"]))
                out[channel] = k * (rise - fall)
        return out

    def jacobian(self, theta: Floats, inputs: Mapping[str, Floats]) -> dict[str, Floats]:
        """Derivative of each channel with respect to each parameter, shape (..., n, P), in closed form."""
        t = inputs["temperature"]
        p = self._get(theta)
        at = {name: i for i, name in enumerate(self.parameter_names)}
        shape = (*np.broadcast_shapes(p[self.parameter_names[0]].shape, t.shape), len(at))
        out = {}
        for channel in self.channels:
            j = np.zeros(shape)
            if channel == "stiffness":
                k = stiffness(t, p["A1"], p["A2"], p["A3"], p["B1"], p["B2"], p["B3"])
                for letter, side in (("A", 1.0), ("B", -1.0)):
                    size, rate, middle = (p[f"{letter}{i}"] for i in (1, 2, 3))
                    slope = np.tanh(0.5 * rate * (t - middle))
                    j[..., at[f"{letter}1"]] = -side * k / size
                    j[..., at[f"{letter}2"]] = side * k * ((t - middle) * slope - 1.0 / rate)
                    j[..., at[f"{letter}3"]] = -side * k * rate * slope
            else:
                letter = "B" if channel == "force" else "A"
                size, rate, middle = (p[f"{letter}{i}"] for i in (1, 2, 3))
                s = expit(rate * (t - middle))
                steep = size * s * (1.0 - s)
                j[..., at[f"{letter}1"]] = s
                j[..., at[f"{letter}2"]] = steep * (t - middle)
                j[..., at[f"{letter}3"]] = -steep * rate
                j[..., at[f"{letter}4"]] = 1.0
            out[channel] = j
        return out

    def stiffness(self, theta: Floats, inputs: Mapping[str, Floats]) -> Floats:
        """Stiffness of Eq. (7), shape (..., n), also where force and displacement gave its parameters."""
        p = self._get(theta)
        return stiffness(inputs["temperature"], p["A1"], p["A2"], p["A3"], p["B1"], p["B2"], p["B3"])

    def curvature(self, theta: Floats, inputs: Mapping[str, Floats]) -> dict[str, Floats]:
        """Second derivative of each channel with respect to temperature, shape (..., n)."""
        t = inputs["temperature"]
        p = self._get(theta)
        out = {}
        for channel in self.channels:
            if channel == "stiffness":
                k = stiffness(t, p["A1"], p["A2"], p["A3"], p["B1"], p["B2"], p["B3"])
                a, b = (np.tanh(0.5 * p[f"{x}2"] * (t - p[f"{x}3"])) for x in "AB")
                first = p["A2"] * a - p["B2"] * b
                second = 0.5 * (p["A2"] ** 2 * (1.0 - a * a) - p["B2"] ** 2 * (1.0 - b * b))
                out[channel] = k * (first * first + second)
            else:
                size, rate, middle = (p[f"{_LETTER[channel]}{i}"] for i in (1, 2, 3))
                s = expit(rate * (t - middle))
                out[channel] = size * rate * rate * s * (1.0 - s) * (1.0 - 2.0 * s)
        return out

    def limits(self, theta: Floats) -> dict[str, tuple[Asymptote, Asymptote]]:
        """Level lines of force and displacement; of stiffness what Eq. (7) tends to: zero, infinite, or between."""
        p = {name: x[..., 0] for name, x in self._get(theta).items()}
        out = {}
        for channel, letter in _LETTER.items():
            if channel in self.channels:
                size, rate, middle, offset = (p[f"{letter}{i}"] for i in (1, 2, 3, 4))
                level, falls = np.zeros_like(size), rate < 0.0
                ends = (np.where(falls, offset + size, offset), np.where(falls, offset, offset + size))
                out[channel] = (Asymptote(middle, ends[0], level), Asymptote(middle, ends[1], level))
        if set(_NEEDS["stiffness"]) <= set(p):
            out["stiffness"] = _stiffness_limits(p)
        return out

    def greatest_slope(self, theta: Floats, channel: str, temperature: Floats) -> tuple[Floats, str]:
        """Slope of a sigmoid at its midpoint, a quarter of span times rate; of the stiffness, that of the curve."""
        if channel not in _LETTER:
            return super().greatest_slope(theta, channel, temperature)
        size, rate = (f"{_LETTER[channel]}{i}" for i in (1, 2))
        p = self._get(theta)
        return np.abs(p[size] * p[rate])[..., 0] / 4.0, f"at its midpoint, |{size} {rate}|/4"

    def screen(self, theta: Floats, fixed: Bools, data: Mapping[str, Floats]) -> Floats:
        """Spans and offsets, and the scale of Eq. (7), in closed form; see `ResponseModel.screen`."""
        theta = np.array(theta, dtype=float)
        at = {name: i for i, name in enumerate(self.parameter_names)}
        held = {name for name, i in at.items() if fixed[i]}
        for channel, letter in _LETTER.items():
            if channel in self.channels:
                theta = _solve_sigmoid(theta, at, letter, data["temperature"], data[channel], held)
        if "stiffness" in self.channels and not set(_LETTER) <= set(self.channels):
            settled = {letter for channel, letter in _LETTER.items() if channel in self.channels}
            theta = _solve_scale(theta, at, data["temperature"], data["stiffness"], held, settled)
        return theta


def _stiffness_limits(p: Mapping[str, Floats]) -> tuple[Asymptote, Asymptote]:
    scale = np.log(np.abs(p["B1"] * p["B2"])) - np.log(np.abs(p["A1"] * p["A2"]))
    sign = np.sign(p["B1"]) * np.sign(p["B2"]) * np.sign(p["A1"]) * np.sign(p["A2"])
    a2, b2 = np.abs(p["A2"]), np.abs(p["B2"])
    apart = np.where(np.abs(a2 - b2) <= EQUAL_RATE_TOLERANCE * np.maximum(a2, b2), 0.0, a2 - b2)
    lines = []
    for side in (-1.0, 1.0):
        end = scale + side * (b2 * p["B3"] - a2 * p["A3"])
        end = np.where(apart == 0.0, end, np.copysign(np.inf, apart))
        with np.errstate(over="ignore"):
            lines.append(Asymptote(p["B3"], sign * np.exp(end), np.zeros_like(end)))
    return lines[0], lines[1]


def _solve_sigmoid(
    theta: Floats, at: Mapping[str, int], letter: str, t: Floats, y: Floats, held: set[str]
) -> Floats:
    """Solve span and offset of one sigmoid for every draw, and sort the draws by their sum of squares."""
    size, rate, middle, offset = (at[f"{letter}{i}"] for i in (1, 2, 3, 4))
    free_size, free_offset = (f"{letter}{i}" not in held for i in (1, 4))
    s = expit(theta[:, rate][:, None] * (t - theta[:, middle][:, None]))
    sign = np.sign(theta[0, size])
    if free_offset:
        deviation = s - s.mean(axis=1, keepdims=True)
        span = (deviation @ (y - y.mean())) / np.maximum(np.einsum("ij,ij->i", deviation, deviation), 1e-300)
    else:
        span = (s @ (y - theta[0, offset])) / np.einsum("ij,ij->i", s, s)
    spread = float(np.ptp(y))
    if free_size:
        theta[:, size] = sign * np.clip(sign * span, 1e-3 * spread, 1e3 * spread)
    span = theta[:, size]
    if free_offset:
        theta[:, offset] = y.mean() - span * s.mean(axis=1)
    r = y - theta[:, offset, None] - span[:, None] * s
    return in_order(theta, np.array([size, rate, middle, offset]), np.array([rate, middle]),
                    np.einsum("ij,ij->i", r, r))  # fmt: skip


def _solve_scale(
    theta: Floats, at: Mapping[str, int], t: Floats, k: Floats, held: set[str], settled: set[str]
) -> Floats:
    """Solve the scale of Eq. (7) for every draw; force or displacement, where observed, are settled already."""
    for letter in settled:  # the best of them, for every draw of the other sigmoid
        for i in (1, 2, 3):
            theta[:, at[f"{letter}{i}"]] = theta[0, at[f"{letter}{i}"]]
    column = {name: theta[:, i] for name, i in at.items()}
    log_shape = log_stiffness_shape(t, *(column[name][:, None] for name in ("A2", "A3", "B2", "B3")))
    peak = log_shape.max(axis=1, keepdims=True)
    shape = np.exp(log_shape - peak)
    sign = np.sign(column["B1"] * column["B2"]) * np.sign(column["A1"] * column["A2"])
    ratio = np.maximum(sign * (shape @ k) / np.einsum("ij,ij->i", shape, shape), 1e-6 * np.abs(k).max())
    r = k - (sign * ratio)[:, None] * shape
    with np.errstate(over="ignore", under="ignore"):
        wanted = ratio * np.exp(-peak[:, 0]) * np.abs(column["A2"] / column["B2"])  # |B1/A1|
        wanted = np.clip(wanted, 1e-200, 1e200)
    now = np.abs(column["B1"] / column["A1"])
    movable = [n for n in ("A1", "B1") if n[0] not in settled and n not in held]
    for name in movable:
        power = (1.0 if name == "B1" else -1.0) / len(movable)
        theta[:, at[name]] = column[name] * (wanted / now) ** power
    own = np.array([at[f"{letter}{i}"] for letter in "AB" for i in (1, 2, 3)])
    shapes = np.array([at[name] for name in ("A2", "A3", "B2", "B3")])
    return in_order(theta, own, shapes, np.einsum("ij,ij->i", r, r))


def channel_unit(units: Mapping[str, str], channel: str) -> str:
    """Unit of a channel, worked out from the unit of stiffness where it was not observed itself.

    Examples
    --------
    >>> channel_unit({"stiffness": "N/cm"}, "displacement")
    'cm'
    >>> channel_unit({"force": "N", "displacement": "m"}, "stiffness")
    'N/m'
    """
    if channel in units:
        return units[channel]
    if "stiffness" in units:
        whole = units["stiffness"]
        if whole == ARBITRARY:
            return ARBITRARY
        over, _, under = whole.partition("/")
        return over if channel == "force" else (under or "1")
    force, displacement = units.get("force", "N"), units.get("displacement", "m")
    if channel == "stiffness":
        if ARBITRARY in (force, displacement):
            return ARBITRARY
        return force if displacement == "1" else f"{force}/{displacement}"
    return {"force": force, "displacement": displacement}[channel]


def shape_of(a2: Floats, b2: Floats, tolerance: float = EQUAL_RATE_TOLERANCE) -> Sequence[str]:
    """What Eq. (7) does far from the midpoints: a bounded sigmoid only where A2 equals B2.

    Returns
    -------
    list of str
        ``hump`` where A2 < B2 (K falls to zero at both ends), ``unbounded`` where A2 > B2, else ``sigmoid``.
    """
    difference = (np.abs(a2) - np.abs(b2)) / np.maximum(np.abs(a2), np.abs(b2))
    return [
        "sigmoid" if abs(d) <= tolerance else ("unbounded" if d > 0 else "hump")
        for d in np.atleast_1d(difference).tolist()
    ]
