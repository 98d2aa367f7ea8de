"""What a response model is: a curve of the observed channels against temperature, its parameters and derivatives.

A model derives from `ResponseModel` and says at least which parameters it has and what it predicts. Everything else
has a default here: derivatives by finite differences, the start of the least-squares fit by
linear regression on the parameters that enter linearly, the stiffness by ``dF/dX = F'/X'``.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from sma_bayes.arrays import Bools, Floats
from sma_bayes.errors import MeasurementError
from sma_bayes.parameters.priors_file import PriorSet, parse_priors, read_priors
from sma_bayes.parameters.roles import Role
from sma_bayes.parameters.space import ParameterSpec
from sma_bayes.quantities import CHANNELS
from sma_bayes.records.types import Record

Curves = Callable[[Floats, Mapping[str, Floats]], dict[str, Floats]]

RELATIVE_STEP = float(np.cbrt(np.finfo(float).eps))
"""Relative step of central differences: what cancels and what is cut off are then about equal."""
LEAST_RELATIVE_SIZE = 1e-3
"""Least step for a parameter without a role, in steps for the largest of those that are looked at together."""
LEAST_START_DISTANCE = 0.5
"""Least distance of starting points, in standard deviations of the draws of a parameter of shape."""
LINEAR_PARAMETER_RANGE = (1e-3, 1e3)
"""Range in which a linear parameter of known sign is kept, in spans of its channel."""
PRIOR_WEIGHT = 0.03
"""Weight of the prior where linear parameters are solved for."""
_LEVELS = frozenset({Role.OFFSET, Role.LEVEL})
_SCALED = _LEVELS | {Role.SPAN, Role.EFFECT, Role.COLD_SLOPE, Role.HOT_SLOPE, Role.SLOPE}
_TEMPERATURES = frozenset({Role.MIDPOINT, Role.GAP, Role.WIDTH})
_RATES = frozenset({Role.RATE, Role.SECOND_RATE})
_PER_TEMPERATURE = _RATES | {Role.COLD_SLOPE, Role.HOT_SLOPE, Role.SLOPE}
_UNITS = {"temperature": "degC", "time": "s", "force": "N", "displacement": "m", "stiffness": "N/m"}


@dataclass(frozen=True, slots=True, eq=False)
class Asymptote:
    """Line that a curve approaches far from its transformation, ``value + slope (T - temperature)``.

    Attributes
    ----------
    temperature, value, slope : ndarray, shape (...)
        [unit of temperature], [unit of the channel], and their quotient.
    """

    temperature: Floats
    value: Floats
    slope: Floats

    def at(self, temperature: Floats) -> Floats:
        """Value (..., n) of the line at temperatures of shape (n,) or (..., n)."""
        middle, value, slope = (np.asarray(x)[..., None] for x in (self.temperature, self.value, self.slope))
        with np.errstate(over="ignore", invalid="ignore"):
            return np.asarray(value + slope * (temperature - middle))


@dataclass(frozen=True, slots=True)
class Variant:
    """How a model takes part in a comparison of models.

    Attributes
    ----------
    name, title : str
        In files, and in full.
    variant : str
        Such as ``published``; empty where there is only one.
    extra : bool
        Whether it stands beside the others without a vote.
    """

    name: str
    title: str
    variant: str = ""
    extra: bool = False


@dataclass(frozen=True)
class ResponseModel(ABC):
    """Response of a spring or specimen.

    Attributes
    ----------
    name, reference : str
        As an option, and where the equations stand.
    channels : tuple of str
        What is predicted.
    provides : tuple of str
        Channels that can be predicted at all.
    together : bool
        Whether several channels can be predicted by one model.
    priors : str or Path
        Its default priors: the text of a priors file, the path of one, or the name of a shipped set; empty for the
        set of the model's own name.
    rung : int
        Place on the ladder of models that contain the published curve, from 1 for that itself; 0 for a model that is
        not on it. ``--model auto`` climbs from the lowest, as far as each step is earned.
    linear : tuple of str
        Parameters that enter their channel linearly, jointly; the least-squares start solves for them.
    stages : int
        Of the transformation, each of which gives a start and a finish; `stage` is the curve of one.
    sloped : bool
        Whether phases have slopes, so that the curve is not level far from the transformation.
    family : str
        Models of one family count as one where models are compared; empty for a family of its own.
    contends : tuple of Variant, optional
        How it takes part in every comparison of models: by default as it is. An empty tuple: only where it is the
        model that was asked for.
    """

    name: ClassVar[str]
    reference: ClassVar[str] = ""
    provides: ClassVar[tuple[str, ...]] = CHANNELS
    together: ClassVar[bool] = True
    priors: ClassVar[str | Path] = ""
    rung: ClassVar[int] = 0
    linear: ClassVar[tuple[str, ...]] = ()
    stages: ClassVar[int] = 1
    sloped: ClassVar[bool] = False
    family: ClassVar[str] = ""
    contends: ClassVar[tuple[Variant, ...] | None] = None

    channels: tuple[str, ...] = CHANNELS

    def __post_init__(self) -> None:
        why = self.refusal(self.channels)
        if why:
            raise MeasurementError(
                f"the model {self.name!r} can't be fitted to {' and '.join(self.channels) or 'no channel'}: {why}",
                expected=f"a record of {self._wanted()}",
                remedy="take another model with --model, or measure what it needs",
            )

    @classmethod
    def refusal(cls, channels: Sequence[str]) -> str:
        """Why a record of these channels can't be fitted; empty where it can."""
        for channel in channels:
            if channel not in cls.provides:
                return f"it has no {channel}"
        if len(channels) > 1 and not cls.together:
            return "it is a curve of one channel"
        return "" if channels else "nothing was observed"

    @classmethod
    def made_for(cls, records: Sequence[Record]) -> Self:
        """The model for records that share its parameters.

        Parameters
        ----------
        records : sequence of Record
            With the same channels. A model that needs to know more than those takes it from here, and takes the same
            whenever it is made for the same records.

        Raises
        ------
        MeasurementError
            If it can't be fitted to these channels.
        """
        return cls(records[0].channels)

    @classmethod
    def _wanted(cls) -> str:
        """What it can be fitted to, for messages."""
        return (" or " if not cls.together else ", ").join(cls.provides)

    @property
    @abstractmethod
    def parameter_names(self) -> tuple[str, ...]:
        """In the order of ``theta``."""

    @abstractmethod
    def parameters(self, units: Mapping[str, str]) -> tuple[ParameterSpec, ...]:
        """Facts about the parameters, for the units of temperature and of the observed channels."""

    @abstractmethod
    def predict(self, theta: Floats, inputs: Mapping[str, Floats]) -> dict[str, Floats]:
        """Response of each channel.

        Parameters
        ----------
        theta : ndarray, shape (..., P)
            One parameter vector, all walkers or all draws, in the order of `parameter_names`.
        inputs : mapping of str to ndarray, shape (n,) or (..., n)
            ``temperature`` [unit of temperature], which may differ between the parameter vectors.

        Returns
        -------
        dict of str to ndarray, shape (..., n)
        """

    def slope(self, theta: Floats, inputs: Mapping[str, Floats]) -> dict[str, Floats]:
        """Derivative of each channel with respect to temperature, shape (..., n)."""
        return _by_temperature(self.predict, theta, inputs)

    def curvature(self, theta: Floats, inputs: Mapping[str, Floats]) -> dict[str, Floats]:
        """Second derivative of each channel with respect to temperature, shape (..., n)."""
        return _by_temperature(self.slope, theta, inputs)

    def jacobian(self, theta: Floats, inputs: Mapping[str, Floats]) -> dict[str, Floats]:
        """Derivative of each channel with respect to each parameter, shape (..., n, P)."""
        theta = np.asarray(theta, dtype=float)
        columns: dict[str, list[Floats]] = {c: [] for c in self.channels}
        for i, size in enumerate(self._sizes(theta, inputs["temperature"])):
            step = RELATIVE_STEP * np.maximum(np.abs(theta[..., i]), size)
            up, down = theta.copy(), theta.copy()
            up[..., i] += step
            down[..., i] -= step
            width = (up - down)[..., i, None]
            with np.errstate(over="ignore", invalid="ignore"):
                above, below = self.predict(up, inputs), self.predict(down, inputs)
                for channel in self.channels:
                    columns[channel].append((above[channel] - below[channel]) / width)
        return {channel: np.stack(found, axis=-1) for channel, found in columns.items()}

    def _sizes(self, theta: Floats, temperature: Floats) -> list[float]:
        """Magnitude of each parameter below which a step of finite differences need not go."""
        width = float(np.ptp(temperature)) or max(float(np.abs(temperature).max()), 1.0)
        largest = [float(np.abs(theta[..., i]).max(initial=0.0)) for i in range(theta.shape[-1])]
        high: dict[str, float] = {}
        for fact, size in zip(self.facts, largest, strict=True):
            if fact.role in _LEVELS or fact.role in (Role.SPAN, Role.EFFECT):
                high[fact.channel] = max(high.get(fact.channel, 0.0), size)
        out = []
        for fact, own in zip(self.facts, largest, strict=True):
            of_channel = high.get(fact.channel, 0.0) or 1.0
            if fact.role in _TEMPERATURES:
                out.append(0.1 * width)
            elif fact.role in _RATES:
                out.append(1.0 / width)
            elif fact.role in (Role.COLD_SLOPE, Role.HOT_SLOPE, Role.SLOPE):
                out.append(of_channel / width)
            elif fact.role is None:
                out.append(LEAST_RELATIVE_SIZE * own or 1.0)
            else:
                out.append(of_channel if fact.role in _SCALED else 1.0)
        return out

    def stiffness(self, theta: Floats, inputs: Mapping[str, Floats]) -> Floats:
        """Stiffness along the actuation path, ``dF/dX = (dF/dT)/(dX/dT)``.

        Parameters
        ----------
        theta : ndarray, shape (..., P)
        inputs : mapping
            As for `predict`.

        Returns
        -------
        ndarray, shape (..., n)
            [unit of force/unit of displacement]; infinite where displacement alone stands still, NaN where both do.
        """
        if "stiffness" in self.channels:
            with np.errstate(over="ignore", invalid="ignore"):
                return self.predict(theta, inputs)["stiffness"]
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            slope = self.slope(theta, inputs)
            return np.asarray(slope["force"] / slope["displacement"])

    def limits(self, theta: Floats) -> dict[str, tuple[Asymptote, Asymptote]]:
        """Lines that the curves approach far below and far above, for the channels that have them at both ends.

        Of the stiffness, where it follows from force and displacement, too.

        Parameters
        ----------
        theta : ndarray, shape (..., P)
        """
        return {}

    def stage(self, theta: Floats, channel: str, temperature: Floats, number: int) -> Floats:
        """Curve of force or displacement with one stage of the transformation alone, shape (..., n).

        The stages at lower temperature have passed, those at higher have not begun.

        Parameters
        ----------
        theta : ndarray, shape (..., P)
        channel : str
        temperature : ndarray, shape (..., n)
        number : int
            From 0, the stage at the lowest temperature, to `stages` - 1.
        """
        return self.predict(theta, {"temperature": temperature})[channel]

    def greatest_slope(self, theta: Floats, channel: str, temperature: Floats) -> tuple[Floats, str]:
        """Greatest magnitude of the slope of a channel, shape (N,), with words for where that is.

        Parameters
        ----------
        theta : ndarray, shape (N, P)
        channel : str
        temperature : ndarray, shape (m,)
            Even temperatures over the range that was measured.
        """
        with np.errstate(over="ignore", invalid="ignore"):
            slope = np.abs(self.slope(theta, {"temperature": temperature})[channel]).max(axis=-1)
        return slope, "where it is steepest over the measured temperatures"

    @property
    def facts(self) -> tuple[ParameterSpec, ...]:
        """Facts about the parameters in canonical units, for what does not depend on units: roles and channels."""
        return self.parameters(_UNITS)

    def with_role(self, role: Role, channel: str) -> str | None:
        """Name of the parameter of a role in a channel; None where there is none."""
        return next((f.name for f in self.facts if (f.role, f.channel) == (role, channel)), None)

    def position(self, role: Role, channel: str) -> int | None:
        """Position in ``theta`` of the parameter of a role in a channel; None where there is none."""
        name = self.with_role(role, channel)
        return None if name is None else self.parameter_names.index(name)

    def by_channel(self, channel: str) -> tuple[str, ...]:
        """Names of the parameters that the curve of an observed channel depends on.

        A channel whose curve has parameters of its own depends on them; any other, such as the stiffness that follows
        from force and displacement, on all but the levels that a derivative does not see.
        """
        own = tuple(f.name for f in self.facts if f.channel == channel)
        return own or tuple(f.name for f in self.facts if f.role is not Role.OFFSET)

    def spoken_of(self) -> frozenset[str]:
        """Names under which priors may speak of its parameters, those of channels that were not observed included."""
        whole = replace(self, channels=self.provides) if self.together else self
        return frozenset(f.prior_key for f in (*self.facts, *whole.facts))

    @classmethod
    def default_priors(cls) -> PriorSet:
        """Priors of its parameters and of the noise, where a user gives none."""
        said = cls.priors or cls.name
        if isinstance(said, str) and "\n" in said:
            return parse_priors(said, f"priors of the model {cls.name!r}")
        return read_priors(said)

    def calibrated(self, theta: Floats, channel: str, gain: Floats, shift: Floats) -> Floats:
        """Parameters whose curve of one channel is ``gain y + shift`` where it was ``y``.

        Parameters
        ----------
        theta : ndarray, shape (N, P)
        channel : str
            A channel that has parameters of its own.
        gain, shift : ndarray, shape (N,)

        Returns
        -------
        ndarray, shape (N, P)
            A new array; the same values where the channel has no parameters that a gain can act on.
        """
        out = np.array(theta, dtype=float)
        for i, fact in enumerate(self.facts):
            if fact.channel != channel:
                continue
            if fact.role in _SCALED:
                out[..., i] *= gain
            if fact.role in _LEVELS:
                out[..., i] += shift
        return out

    def with_thermometer(self, theta: Floats, gain: Floats, shift: Floats) -> Floats:
        """Parameters of the same curves against a temperature that is ``gain T + shift`` where ``T`` was read.

        Parameters
        ----------
        theta : ndarray, shape (N, P)
        gain, shift : ndarray, shape (N,)

        Returns
        -------
        ndarray, shape (N, P)
            A new array.
        """
        out = np.array(theta, dtype=float)
        for i, fact in enumerate(self.facts):
            if fact.role is Role.MIDPOINT:
                out[..., i] = gain * out[..., i] + shift
            elif fact.role in _TEMPERATURES:
                out[..., i] *= gain
            elif fact.role in _PER_TEMPERATURE:
                out[..., i] /= gain
        return out

    def screen(self, theta: Floats, fixed: Bools, data: Mapping[str, Floats]) -> Floats:
        """Improve draws from the prior for the start of the least-squares fit.

        Parameters
        ----------
        theta : ndarray, shape (W, P)
            Draws from the prior.
        fixed : ndarray of bool, shape (P,)
            Parameters that must not be moved.
        data : mapping of str to ndarray, shape (n,)
            ``temperature`` and the observed channels, and other inputs of the model.

        Returns
        -------
        ndarray, shape (W, P)
            Best first: for each channel apart the linear parameters are solved for, and its parameters sorted by
            their sum of squares.
        """
        theta = np.array(theta, dtype=float)
        total, apart = np.zeros(len(theta)), False
        for channel in self.channels:
            own = np.array([i for i, f in enumerate(self.facts) if f.channel == channel], dtype=np.intp)
            if own.size:
                theta, sse = self._solve_linear(theta, fixed, data, channel)
                theta = in_order(theta, own, self._shapes(own), sse)
                apart = True
            elif not apart:
                total += self._sum_of_squares(theta, data, channel) / max(
                    float(np.var(data[channel])), 1e-300
                )
        if not apart:
            every = np.arange(theta.shape[1])
            theta = in_order(theta, every, self._shapes(every), total)
        return theta

    def _shapes(self, own: NDArray[np.intp]) -> NDArray[np.intp]:
        """Of some positions those of parameters that are not linear: by them starting points must differ."""
        linear = set(self.linear)
        return np.array([i for i in own if self.parameter_names[i] not in linear], dtype=np.intp)

    def _solve_linear(
        self, theta: Floats, fixed: Bools, data: Mapping[str, Floats], channel: str
    ) -> tuple[Floats, Floats]:
        """Draws with the linear parameters of a channel solved for, and their sums of squares (W,).

        Draws of the prior say how large a parameter may be: as far as they scatter counts as much as one sample that
        is off by `PRIOR_WEIGHT` spans. A parameter of one sign keeps it.
        """
        y = data[channel]
        where = {f.name: f for f in self.facts}
        columns = [
            i for i, n in enumerate(self.parameter_names)
            if n in self.linear and where[n].channel == channel and not fixed[i]
        ]  # fmt: skip
        theta = theta.copy()
        if columns:
            j = self.jacobian(theta, data)[channel][..., columns]
            width = np.maximum(theta[:, columns].std(axis=0), 1e-300)
            centre = theta[:, columns].mean(axis=0)
            base = theta.copy()
            base[:, columns] = centre
            left = y - self.predict(base, data)[channel]
            scale = float(np.ptp(y)) or 1.0
            design = j * width
            gram = np.einsum("wni,wnj->wij", design, design) + (PRIOR_WEIGHT * scale) ** 2 * np.eye(
                len(columns)
            )
            solved = np.linalg.solve(gram, np.einsum("wni,wn->wi", design, left)[..., None])[..., 0]
            found = centre + width * np.nan_to_num(solved)
            for k, i in enumerate(columns):
                signs = np.unique(np.sign(theta[:, i]))
                if signs.size == 1 and signs[0] != 0.0:
                    low, high = (scale * s for s in LINEAR_PARAMETER_RANGE)
                    found[:, k] = signs[0] * np.clip(signs[0] * found[:, k], low, high)
            theta[:, columns] = found
        return theta, self._sum_of_squares(theta, data, channel)

    def _sum_of_squares(self, theta: Floats, data: Mapping[str, Floats], channel: str) -> Floats:
        with np.errstate(over="ignore", invalid="ignore"):
            r = data[channel] - self.predict(theta, data)[channel]
            return np.asarray(np.einsum("wn,wn->w", r, r))


def in_order(
    theta: Floats, own: NDArray[np.intp], shapes: NDArray[np.intp], sse: Floats, starts: int = 3
) -> Floats:
    """Sort draws by their sum of squares, but put draws that differ in shape first, so that starts are apart.

    Parameters
    ----------
    theta : ndarray, shape (W, P)
    own : ndarray of int
        Positions of the parameters that are sorted; the others stay where they are.
    shapes : ndarray of int
        Positions of those by which draws are told apart.
    sse : ndarray, shape (W,)
    starts : int
        How many draws must be apart.
    """
    order = np.argsort(np.where(np.isnan(sse), np.inf, sse), kind="stable")
    columns = [theta[order, i] for i in shapes]
    chosen = [0]
    if columns:
        scaled = np.stack([np.log(s) if np.all(s > 0) else s for s in columns], axis=1)
        scaled = scaled / np.maximum(scaled.std(axis=0), 1e-300)
        for i in range(1, len(order)):
            if len(chosen) == starts:
                break
            if all(np.max(np.abs(scaled[i] - scaled[k])) > LEAST_START_DISTANCE for k in chosen):
                chosen.append(i)
    rest = np.setdiff1d(np.arange(len(order)), chosen)
    order = order[np.concatenate([np.array(chosen), rest])]
    out = theta.copy()
    out[:, own] = theta[np.ix_(order, own)]
    return out


def _by_temperature(f: Curves, theta: Floats, inputs: Mapping[str, Floats]) -> dict[str, Floats]:
    """Central difference of a function of parameters and inputs with respect to temperature."""
    t = np.asarray(inputs["temperature"], dtype=float)
    step = RELATIVE_STEP * (float(np.ptp(t)) or max(float(np.abs(t).max()), 1.0))
    above, below = t + step, t - step
    with np.errstate(over="ignore", invalid="ignore"):
        up = f(theta, {**inputs, "temperature": above})
        down = f(theta, {**inputs, "temperature": below})
        return {c: (up[c] - down[c]) / (above - below) for c in up}
