"""Least squares with a response model: estimates, standard errors, and what is left.

No prior counts and nothing bounds the search. It goes down twice from where it starts, by Levenberg and Marquardt's
steps: in all parameters together, and, where the model names parameters that enter linearly, in the others alone with
those solved for at each step (variable projection: Golub and Pereyra 1973, SIAM J. Numer. Anal. 10, 413; with the
Jacobian of Kaufman 1975, BIT 15, 49). The lower end is taken.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy import optimize

from sma_bayes.arrays import Floats
from sma_bayes.errors import MeasurementError, SmaBayesError, require_known, require_seed
from sma_bayes.fitting.posterior import build_posterior
from sma_bayes.fitting.warm_start import OVERFLOW_VALUE, warm_start
from sma_bayes.noise import NOISE_MODELS
from sma_bayes.records.types import Record
from sma_bayes.response import DEFAULT_MODEL, RESPONSE_MODELS
from sma_bayes.response.base import ResponseModel

if TYPE_CHECKING:
    import pandas as pd

RELATIVE_TOLERANCE = 1e-15
"""Relative changes of the sum of squares and of the parameters below which a search ends."""
MAX_EVALUATIONS = 20_000
"""Most evaluations of the residuals in a search."""
MAX_GAUSS_NEWTON_STEPS = 100
"""Most Gauss-Newton steps at the end."""
STEP_RATIO = 0.95
"""Each of them is shorter than the one before by this, or more."""
EQUAL_SUM_RATIO = 1.0 + 1e-10
"""Sums of squares whose ratio is less are the same but for rounding."""
MAX_TANGENT_SHARE = 1e-3
"""Share of the residuals that the tangent plane may still explain (Bates and Watts 1981, Technometrics 23, 179)."""
ROUNDING_ULPS = 4.0
"""Relative errors of a response, in units of the last place, below which nothing is left to explain."""
REWEIGHTING_ROUNDS = 10
"""Rounds in which the weights of several channels follow their residuals."""


@dataclass(frozen=True, slots=True)
class LeastSquares:
    """A least-squares fit.

    Attributes
    ----------
    estimate : mapping of str to float
        Parameter to its least-squares estimate [unit of the parameter].
    standard_error : mapping of str to float
        Parameter to its standard error, ``sqrt(diag(inv(J.T W J)))`` with the residual variance of each channel in
        ``W`` [unit of the parameter]; 0 where it was held fixed, infinite where the data leave it free.
    residual_sd : mapping of str to float
        Channel to ``sqrt(sse/(n - p))``, ``p`` the estimated parameters of its curve [unit of the channel]; NaN
        where as many were estimated as there are samples.
    sum_of_squares : mapping of str to float
        Channel to its sum of squared residuals [unit of the channel squared].
    degrees_of_freedom : mapping of str to int
        Channel to ``n - p``.
    unit : mapping of str to str
        Parameter to its unit.
    rank : int
        Numerical rank of the Jacobian; less than the number of estimated parameters where the data leave some free.
    converged : bool
        Whether the residuals are orthogonal to the tangent plane of the curve, as at a minimum.
    """

    estimate: Mapping[str, float]
    standard_error: Mapping[str, float]
    residual_sd: Mapping[str, float]
    sum_of_squares: Mapping[str, float]
    degrees_of_freedom: Mapping[str, int]
    unit: Mapping[str, str]
    rank: int
    converged: bool

    def summary(self) -> pd.DataFrame:
        """Parameters with ``unit``, ``estimate`` and ``standard_error``, one a row."""
        import pandas as pd

        columns = {"unit": self.unit, "estimate": self.estimate, "standard_error": self.standard_error}
        frame = pd.DataFrame({name: pd.Series(dict(values)) for name, values in columns.items()})
        return frame.rename_axis(index="parameter")


def least_squares(
    record: Record | Sequence[Record],
    model: str | ResponseModel = DEFAULT_MODEL,
    *,
    start: Mapping[str, float] | None = None,
    fixed: Collection[str] = (),
    seed: int = 0,
) -> LeastSquares:
    """Fit a response model to a record by least squares, without priors or bounds.

    Parameters
    ----------
    record : Record or sequence of Record
        One, or several that share the parameters. Where several channels were observed, each counts by the inverse
        of its residual variance, which is estimated along.
    model : str or ResponseModel
        Name of a response model, or one that was made.
    start : mapping of str to float, optional
        Where to start: a value for each parameter, in the units of ``model.parameters(record.units)``. By default
        the search starts at the best of many draws from the model's own priors, and holds what these hold fixed.
    fixed : collection of str
        Parameters that stay where they start.
    seed : int
        For the draws from the priors.

    Returns
    -------
    LeastSquares

    Raises
    ------
    MeasurementError
        If there are fewer samples than parameters, or the curve is not finite where the search starts.
    SmaBayesError
        If `start` lacks a parameter or names one that the model does not have.

    Notes
    -----
    Against NIST's certified values, estimates and standard errors have nine digits or more where the `jacobian` of the
    model is exact, seven or more with the default finite differences (docs/reference/nist.md).
    """
    require_seed(seed)
    records = (record,) if isinstance(record, Record) else tuple(record)
    if isinstance(model, str):
        model = RESPONSE_MODELS[model].made_for(records)
    theta, free = _start(records, model, start, fixed, seed)
    problem = _Squares(records, model, free)
    if problem.samples < free.size:
        raise MeasurementError(
            f"{problem.samples} samples can't determine {free.size} parameters",
            file=records[0].source or None,
            expected=f"at least {free.size} samples of {records[0].key}",
            remedy="record more samples, or hold parameters fixed",
        )
    if not np.all(np.isfinite(problem.joined(theta))):
        raise MeasurementError(
            f"the curve of {records[0].key} is not finite at the start",
            expected=f"parameters at which the model {model.name!r} can be evaluated",
            remedy="start elsewhere",
        )
    return problem.at(problem.solve(theta))


def least_squares_at(
    records: Sequence[Record], model: ResponseModel, theta: Floats, free: NDArray[np.intp]
) -> LeastSquares:
    """Standard errors and residual statistics at an estimate that was found elsewhere.

    Parameters
    ----------
    records : sequence of Record
    model : ResponseModel
    theta : ndarray, shape (P,)
        All parameters of the model.
    free : ndarray of int
        Positions of those that were estimated.
    """
    return _Squares(tuple(records), model, free).at(theta)


def _start(
    records: tuple[Record, ...],
    model: ResponseModel,
    start: Mapping[str, float] | None,
    fixed: Collection[str],
    seed: int,
) -> tuple[Floats, NDArray[np.intp]]:
    """Parameters to start from, and positions of those to estimate."""
    names = model.parameter_names
    for name in (*(start or ()), *fixed):
        require_known(name, names, f"no parameter {name!r}", SmaBayesError)
    held = {names.index(name) for name in fixed}
    if start is None:
        priors = model.default_priors()
        posterior = build_posterior(records, NOISE_MODELS["independent"], priors, model=model)
        held |= {i for i, p in enumerate(posterior.space.parameters[: len(names)]) if p.fixed is not None}
        theta = warm_start(posterior, np.random.default_rng(seed)).theta
    else:
        missing = [name for name in names if name not in start]
        if missing:
            raise SmaBayesError(
                f"start says nothing of {', '.join(missing)}",
                expected=f"a value for each of {', '.join(names)}",
            )
        theta = np.array([float(start[name]) for name in names])
    return np.array(theta), np.array([i for i in range(len(names)) if i not in held], dtype=np.intp)


class _Squares:
    """Weighted squares of the residuals of a model, as a function of its free parameters."""

    def __init__(self, records: tuple[Record, ...], model: ResponseModel, free: NDArray[np.intp]) -> None:
        self.records, self.model, self.free = records, model, free
        self.channels = records[0].channels
        self.samples = sum(r.n for r in records) * len(self.channels)
        names = model.parameter_names
        self.linear = np.array([names[i] in model.linear for i in free], dtype=bool)
        self.weights = {c: 1.0 for c in self.channels}

    def residuals(self, theta: Floats, channel: str) -> Floats:
        with np.errstate(all="ignore"):
            parts = [r.observed[channel] - self.model.predict(theta, r.inputs)[channel] for r in self.records]
        return np.concatenate(parts)

    def joined(self, theta: Floats) -> Floats:
        return np.concatenate([self.weights[c] * self.residuals(theta, c) for c in self.channels])

    def observed(self) -> Floats:
        """What was measured, weighted as the residuals are."""
        return np.concatenate([self.weights[c] * r.observed[c] for c in self.channels for r in self.records])

    def jacobian(self, theta: Floats) -> Floats:
        """Derivative of the weighted response with respect to the free parameters, shape (samples, free)."""
        with np.errstate(all="ignore"):
            found = [self.model.jacobian(theta, r.inputs) for r in self.records]
        blocks = [self.weights[c] * j[c][:, self.free] for c in self.channels for j in found]
        return np.asarray(np.nan_to_num(np.clip(np.concatenate(blocks), -OVERFLOW_VALUE, OVERFLOW_VALUE)))

    def cost(self, theta: Floats) -> float:
        vector = _tame(self.joined(theta))
        return float(vector @ vector)

    def solve(self, theta: Floats) -> Floats:
        """Estimate of all parameters; where there are several channels, their weights follow the residuals."""
        self._weigh(None)
        theta = self._lowest(theta)
        for _ in range(REWEIGHTING_ROUNDS if len(self.channels) > 1 else 0):
            before = dict(self.weights)
            self._weigh(theta)
            theta = self._lowest(theta)
            if all(abs(self.weights[c] / before[c] - 1.0) < 1e-9 for c in self.channels):
                break
        return theta

    def _weigh(self, theta: Floats | None) -> None:
        """Weights that make the channels alike: in residuals, or before there are any in spread."""
        for channel in self.channels:
            observed = np.concatenate([r.observed[channel] for r in self.records])
            spread = float(np.std(observed)) or 1.0
            if theta is not None:
                scatter = float(np.sqrt(np.mean(self.residuals(theta, channel) ** 2)))
                spread = max(scatter, 1e-12 * spread)
            self.weights[channel] = 1.0 / spread

    def _lowest(self, theta: Floats) -> Floats:
        if self.free.size == 0:
            return theta
        end = self._descend(theta)
        if self.linear.any():
            other = self._descend(self._project(theta))
            if EQUAL_SUM_RATIO * self.cost(other) < self.cost(end):
                end = other
        return self._polish(end)

    def _with(self, theta: Floats, positions: NDArray[np.intp], values: Floats) -> Floats:
        out = theta.copy()
        out[positions] = values
        return out

    def _descend(self, theta: Floats) -> Floats:
        """Levenberg-Marquardt in all free parameters together."""
        found = _levenberg_marquardt(
            lambda x: _tame(self.joined(self._with(theta, self.free, x))),
            lambda x: -self.jacobian(self._with(theta, self.free, x)),
            theta[self.free],
        )
        return self._with(theta, self.free, found)

    def _project(self, theta: Floats) -> Floats:
        """Levenberg-Marquardt in those that are not linear, with the linear ones solved for at each step."""
        other = self.free[~self.linear]
        if other.size == 0:
            return self._solved(theta)

        def jacobian(x: Floats) -> Floats:
            j = self.jacobian(self._solved(self._with(theta, other, x)))
            q = np.linalg.qr(j[:, self.linear])[0]
            return -(j[:, ~self.linear] - q @ (q.T @ j[:, ~self.linear]))

        found = _levenberg_marquardt(
            lambda x: _tame(self.joined(self._solved(self._with(theta, other, x)))), jacobian, theta[other]
        )
        return self._solved(self._with(theta, other, found))

    def _solved(self, theta: Floats) -> Floats:
        """The same with the linear parameters at their best."""
        linear = self.free[self.linear]
        base = self._with(theta, linear, np.zeros(linear.size))
        design, left = self.jacobian(base)[:, self.linear], _tame(self.joined(base))
        size = np.linalg.norm(design, axis=0)
        size[size == 0.0] = 1.0
        return self._with(theta, linear, np.linalg.lstsq(design / size, left, rcond=None)[0] / size)

    def _polish(self, theta: Floats) -> Floats:
        """Undamped steps while they get shorter: the way that the sum of squares, flat at its least, does not show."""
        last = np.inf
        for _ in range(MAX_GAUSS_NEWTON_STEPS):
            j = self.jacobian(theta)
            size = np.linalg.norm(j, axis=0)
            size[size == 0.0] = 1.0
            step = np.linalg.lstsq(j / size, _tame(self.joined(theta)), rcond=None)[0]
            length = float(np.linalg.norm(step))
            better = self._with(theta, self.free, theta[self.free] + step / size)
            if not (length < STEP_RATIO * last and self.cost(better) <= EQUAL_SUM_RATIO * self.cost(theta)):
                break
            theta, last = better, length
        return theta

    def at(self, theta: Floats) -> LeastSquares:
        names, unit = self.model.parameter_names, self.records[0].units
        facts = self.model.parameters(unit)
        estimated = {names[i] for i in self.free}
        sse, freedom, residual_sd = {}, {}, {}
        for channel in self.channels:
            r = self.residuals(theta, channel)
            sse[channel] = float(r @ r)
            freedom[channel] = r.size - len(estimated & set(self.model.by_channel(channel)))
            variance = sse[channel] / freedom[channel] if freedom[channel] > 0 else float("nan")
            residual_sd[channel] = float(np.sqrt(variance))
        error, rank, converged = self._errors(theta, residual_sd)
        return LeastSquares(
            estimate=dict(zip(names, map(float, theta), strict=True)),
            standard_error=dict(zip(names, map(float, error), strict=True)),
            residual_sd=residual_sd,
            sum_of_squares=sse,
            degrees_of_freedom=freedom,
            unit={f.name: f.unit for f in facts},
            rank=rank,
            converged=converged,
        )

    def _errors(self, theta: Floats, residual_sd: Mapping[str, float]) -> tuple[Floats, int, bool]:
        """Standard errors (P,), rank of the Jacobian, and whether the residuals are orthogonal to its columns."""
        error = np.zeros(theta.size)
        if self.free.size == 0:
            return error, 0, True
        known = all(np.isfinite(sd) for sd in residual_sd.values())
        if known:
            self.weights = {c: 1.0 / sd if sd > 0.0 else 1.0 for c, sd in residual_sd.items()}
        j, r = self.jacobian(theta), self.joined(theta)
        size = np.linalg.norm(j, axis=0)
        scale = np.where(size > 0.0, size, 1.0)
        u, singular, vt = np.linalg.svd(j / scale, full_matrices=False)
        solid = singular > singular[0] * max(j.shape) * np.finfo(float).eps
        inverse = np.where(solid, 1.0 / np.where(solid, singular, 1.0), np.inf)
        with np.errstate(invalid="ignore"):
            spread = np.where(np.abs(vt.T) > 1e-8, (vt.T * inverse) ** 2, 0.0).sum(axis=1)
        scatter = 1.0 if known else np.nan
        error[self.free] = scatter * np.sqrt(spread) / scale
        rank = int(solid.sum())
        explained = float(np.linalg.norm(u[:, solid].T @ r))
        left = float(np.linalg.norm(r)) * np.sqrt(rank / max(r.size - rank, 1))
        rounding = ROUNDING_ULPS * np.finfo(float).eps * float(np.linalg.norm(self.observed()))
        return error, rank, bool(explained < MAX_TANGENT_SHARE * left or explained <= rounding)


def _tame(vector: Floats) -> Floats:
    """Residuals with what overflowed at a size whose square does not."""
    return np.asarray(np.nan_to_num(np.clip(vector, -OVERFLOW_VALUE, OVERFLOW_VALUE), nan=OVERFLOW_VALUE))


def _levenberg_marquardt(
    residual: Callable[[Floats], Floats], jacobian: Callable[[Floats], Floats], start: Floats
) -> Floats:
    found = optimize.least_squares(
        residual,
        start,
        jac=jacobian,
        method="lm",
        x_scale="jac",
        ftol=RELATIVE_TOLERANCE,
        xtol=RELATIVE_TOLERANCE,
        gtol=RELATIVE_TOLERANCE,
        max_nfev=MAX_EVALUATIONS,
    )
    return np.asarray(found.x, dtype=float)
