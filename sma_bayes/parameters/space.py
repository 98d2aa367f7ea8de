"""Parameters and the space that they span."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from sma_bayes.arrays import Floats
from sma_bayes.errors import PriorError, require_known
from sma_bayes.normal import HALF_LN_2PI
from sma_bayes.parameters.distributions import Distribution, LogNormal, Normal
from sma_bayes.parameters.roles import Role

QUANTITY: Final = "{quantity}"
"""What a meaning has in the place of the parameter's channel, which is strain or displacement, as it was measured."""


@dataclass(frozen=True, slots=True)
class ParameterSpec:
    """What a model states about one of its parameters; belief about it is a prior's business.

    Attributes
    ----------
    name : str
        Symbol in the equations: ``B3``.
    unit : str
    meaning : str
        One line for humans, with `QUANTITY` in the place of the channel.
    prior_key : str
        Name under which a priors file speaks of it; ``B3``, or ``sd`` for ``force_sd``.
    channel : str
        Channel that the parameter belongs to, empty for none.
    role : Role, optional
        What it does to the curve of that channel.
    prior : mapping of str to object, optional
        Belief in force where a priors file does not speak of the parameter, written as in such a file.
    positive : bool
        Whether it must be more than zero.
    """

    name: str
    unit: str
    meaning: str
    prior_key: str = ""
    channel: str = ""
    role: Role | None = None
    prior: Mapping[str, Any] | None = None
    positive: bool = False

    def in_record(self, quantity: Callable[[str], str]) -> ParameterSpec:
        """The same with a meaning that says what is measured.

        Parameters
        ----------
        quantity : callable
            What a channel is called in the measurements.

        Examples
        --------
        >>> spec = ParameterSpec("A2", "1/degC", f"rate of {QUANTITY}", channel="displacement")
        >>> spec.in_record({"displacement": "strain"}.__getitem__).meaning
        'rate of strain'
        """
        if QUANTITY not in self.meaning:
            return self
        return replace(self, meaning=self.meaning.replace(QUANTITY, quantity(self.channel)))


@dataclass(frozen=True, slots=True)
class Parameter:
    """A parameter with what is believed about it before the data.

    Attributes
    ----------
    name, unit, meaning : str
    prior : Distribution
        In `unit`.
    source : str
        Where the prior comes from.
    fixed : float or None
        Value at which the parameter is held; it is then not sampled.
    refines : bool
        Whether it refines the form of an effect that the others give, such as an overtone: a search for a start that
        tries several values of each parameter takes the median of this one.
    """

    name: str
    unit: str
    meaning: str
    prior: Distribution
    source: str = ""
    fixed: float | None = None
    refines: bool = False


@dataclass(frozen=True, eq=False)
class ParameterSpace:
    """Ordered parameters, with the map between sampled coordinates ``z`` and parameters ``theta``.

    ``theta`` (..., P) holds all parameters, ``z`` (..., D) only those that are not fixed.
    """

    parameters: tuple[Parameter, ...]
    _free: NDArray[np.intp] = field(init=False, repr=False)
    _gaussian: NDArray[np.intp] = field(init=False, repr=False)
    _other: NDArray[np.intp] = field(init=False, repr=False)
    _mean: Floats = field(init=False, repr=False)
    _sd: Floats = field(init=False, repr=False)
    _log_norm: float = field(init=False, repr=False)
    _log_plus: NDArray[np.intp] = field(init=False, repr=False)
    _log_minus: NDArray[np.intp] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        names = [p.name for p in self.parameters]
        if len(set(names)) != len(names):
            raise PriorError(f"a parameter is named twice among {names}")
        set_ = object.__setattr__
        set_(
            self,
            "_free",
            np.array([i for i, p in enumerate(self.parameters) if p.fixed is None], dtype=np.intp),
        )
        priors = [p.prior for p in self.free]
        gaussian = [i for i, d in enumerate(priors) if isinstance(d, Normal | LogNormal)]
        set_(self, "_gaussian", np.array(gaussian, dtype=np.intp))
        set_(self, "_other", np.array([i for i in range(len(priors)) if i not in gaussian], dtype=np.intp))
        moments = [(d.mean, d.sd) if isinstance(d, Normal) else (np.log(d.median), d.sigma)
                   for d in priors if isinstance(d, Normal | LogNormal)]  # fmt: skip
        set_(self, "_mean", np.array([m for m, _ in moments]))
        set_(self, "_sd", np.array([s for _, s in moments]))
        set_(self, "_log_norm", float(np.log(self._sd).sum()) + HALF_LN_2PI * self._sd.size)
        signs = {i: d.sign for i, d in enumerate(priors) if isinstance(d, LogNormal)}
        set_(self, "_log_plus", np.array([i for i, s in signs.items() if s > 0], dtype=np.intp))
        set_(self, "_log_minus", np.array([i for i, s in signs.items() if s < 0], dtype=np.intp))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all parameters, fixed ones included."""
        return tuple(p.name for p in self.parameters)

    @property
    def free(self) -> tuple[Parameter, ...]:
        """Parameters that are sampled, in the order of ``z``."""
        return tuple(self.parameters[i] for i in self._free)

    @property
    def free_index(self) -> NDArray[np.intp]:
        """Positions of the sampled parameters in ``theta``."""
        return self._free

    @property
    def dimension(self) -> int:
        """Number of sampled parameters D."""
        return int(self._free.size)

    def index(self, name: str) -> int:
        """Position of a parameter in ``theta``."""
        require_known(name, self.names, f"no parameter {name!r}", PriorError)
        return self.names.index(name)

    def constrain(self, z: Floats) -> Floats:
        """Parameters ``theta`` (..., P) at the sampled coordinates ``z`` (..., D)."""
        z = np.asarray(z, dtype=float)
        x = z.copy()
        with np.errstate(over="ignore"):
            self._set_exponentials(x, z)
            for i in self._other:
                x[..., i] = self.free[i].prior.transform.constrain(z[..., i])
        if self._free.size == len(self.parameters):
            return x
        theta = np.empty((*z.shape[:-1], len(self.parameters)))
        for at, p in enumerate(self.parameters):
            if p.fixed is not None:
                theta[..., at] = p.fixed
        theta[..., self._free] = x
        return theta

    def _set_exponentials(self, x: Floats, z: Floats) -> None:
        """What has its logarithm sampled, and its derivative."""
        if self._log_plus.size:
            x[..., self._log_plus] = np.exp(z[..., self._log_plus])
        if self._log_minus.size:
            x[..., self._log_minus] = -np.exp(z[..., self._log_minus])

    def unconstrain(self, theta: Floats) -> Floats:
        """Sampled coordinates (..., D) of the parameters ``theta`` (..., P)."""
        theta = np.asarray(theta, dtype=float)
        return np.stack(
            [
                p.prior.transform.unconstrain(theta[..., i])
                for i, p in zip(self._free, self.free, strict=True)
            ],
            axis=-1,
        )

    def derivative(self, z: Floats) -> Floats:
        """Derivative of each sampled parameter with respect to its coordinate, shape (..., D)."""
        z = np.asarray(z, dtype=float)
        slope = np.ones_like(z)
        self._set_exponentials(slope, z)
        for i in self._other:
            slope[..., i] = np.exp(self.free[i].prior.transform.log_jacobian(z[..., i]))
        return slope

    def log_prior(self, z: Floats) -> Floats:
        """Log density of the prior in the sampled coordinates, shape (...); Jacobian included."""
        z = np.asarray(z, dtype=float)
        u = ((z[..., self._gaussian] if self._other.size else z) - self._mean) / self._sd
        value = -0.5 * np.einsum("...i,...i->...", u, u) - self._log_norm
        for i in self._other:
            prior = self.free[i].prior
            transform = prior.transform
            value = (
                value + prior.log_density(transform.constrain(z[..., i])) + transform.log_jacobian(z[..., i])
            )
        return np.asarray(value)

    def draw(self, rng: np.random.Generator, size: int) -> Floats:
        """Draws from the prior in sampled coordinates, shape (size, D)."""
        p = rng.random((size, self.dimension))
        columns = [d.prior.transform.unconstrain(d.prior.quantile(p[:, i])) for i, d in enumerate(self.free)]
        return np.stack(columns, axis=-1) if columns else np.empty((size, 0))

    def prior_sd(self) -> Floats:
        """Standard deviation of the prior in each sampled coordinate, shape (D,).

        For families that are not normal in their coordinate it is taken from the quantiles at the midpoints
        of 2000 equal slices of probability.
        """
        p = (np.arange(2000) + 0.5) / 2000
        sd = np.empty(self.dimension)
        sd[self._gaussian] = self._sd
        for i in self._other:
            prior = self.free[i].prior
            sd[i] = np.std(prior.transform.unconstrain(prior.quantile(p)))
        return sd

    def prior_centre(self) -> Floats:
        """Median of the prior in each sampled coordinate, shape (D,)."""
        centre = np.empty(self.dimension)
        centre[self._gaussian] = self._mean
        for i in self._other:
            prior = self.free[i].prior
            centre[i] = prior.transform.unconstrain(prior.quantile(np.array(0.5)))
        return centre
