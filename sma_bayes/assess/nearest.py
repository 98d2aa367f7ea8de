"""The published parameters of any curve: those of the published sigmoid that is nearest to it.

Whatever model was fitted, and whatever stands beside it, force and displacement have a nearest curve of Eqs. (2)
and (4),

    A1 to A4 = argmin of the mean over the samples of (X(T) - A4 - A1/(1 + exp(-A2 (T - A3))))**2,

and B1 to B4 likewise for the force. The norm is the mean square over the temperatures that were measured. Its
parameters are a property of the true curve, not of a model for it, and each draw of the curve has its own: their
intervals hold also where the published curve does not describe the specimen (R. Tuo and C. F. J. Wu, Ann. Stat. 43
(2015) 2331).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares
from scipy.special import expit

from sma_bayes.arrays import Bools, Floats
from sma_bayes.fitting.curves import INTERVAL, CurveDraws, interval_where_defined
from sma_bayes.fitting.fit import Fit
from sma_bayes.parameters.roles import Role
from sma_bayes.response.modified_sigmoid import ModifiedSigmoid

MAX_COMPARED_TEMPERATURES = 400
"""Temperatures, at most, at which curves are compared, each for the samples that are closest to it. Every sample
counts: in a transformation that few of them see each changes the nearest curve by more than it is uncertain by."""
STEPS, CLOSE = 150, 1e-6
"""Steps of Gauss and Newton at most, and the relative step that ends them. Where much is missed each brings the
parameters closer by a constant factor only."""
LEAST_DAMPING = 1e-12
"""Share of the diagonal that stays added to it: of a curve that is all but straight, or has its step at an end, two
columns are one, and what is solved would be singular to the last bit."""
TINY = 1e-16
"""Added to the diagonal of mean squares, where a column is nothing."""
LEAST_SHARE_OF_DRAWS = 0.95
"""Share of the draws that must have a nearest curve for intervals to be given."""


@dataclass(frozen=True, slots=True, eq=False)
class NearestPublished:
    """A parameter of the nearest published curve of one channel.

    Attributes
    ----------
    name, unit, channel : str
    draws : ndarray, shape (N,)
        One for each draw of the curve; NaN where there is none, as for a straight line.
    """

    name: str
    unit: str
    channel: str
    draws: Floats

    @property
    def defined(self) -> float:
        """Share of the draws that have one [1]."""
        return float(np.mean(np.isfinite(self.draws)))

    @property
    def interval(self) -> dict[str, float]:
        """``q05``, ``median`` and ``q95``; NaN where too few draws have one."""
        return (
            interval_where_defined(self.draws)
            if self.defined >= LEAST_SHARE_OF_DRAWS
            else dict.fromkeys(INTERVAL, np.nan)
        )


def nearest_parameters(fit: Fit, record: int = 0) -> tuple[NearestPublished, ...]:
    """Parameters of the nearest published curves of one record, for force and displacement where they were measured.

    Parameters
    ----------
    fit : Fit
    record : int
        Which of the records that share the posterior.
    """
    return nearest_of(fit.curves(record))


def nearest_of(curves: CurveDraws) -> tuple[NearestPublished, ...]:
    """Parameters of the nearest published curves of the draws of a record; see `nearest_parameters`."""
    record = curves.posterior.records[curves.record]
    out = []
    for channel in ("displacement", "force"):
        if channel not in record.channels:
            continue
        published = ModifiedSigmoid((channel,))
        theta = _own(curves, channel)
        if theta is None or curves.weights.get(channel, np.zeros(0)).size:
            t, count = compared_temperatures(record.temperature)
            theta = nearest_sigmoids(t, curves.curve(channel, t), count)
        facts = published.parameters(record.units)
        order = [Role.SPAN, Role.RATE, Role.MIDPOINT, Role.OFFSET]
        for fact in facts:
            if fact.role in order:
                out.append(NearestPublished(fact.name, fact.unit, channel, theta[:, order.index(fact.role)]))
    return tuple(out)


def _own(curves: CurveDraws, channel: str) -> Floats | None:
    """Span, rate, midpoint and offset (N, 4) of curves that are published sigmoids themselves; None for others."""
    model = curves.posterior.model
    if not isinstance(model, ModifiedSigmoid):
        return None
    at = [model.position(role, channel) for role in (Role.SPAN, Role.RATE, Role.MIDPOINT, Role.OFFSET)]
    return None if None in at else np.asarray(curves.model_theta[:, [i for i in at if i is not None]])


def compared_temperatures(temperature: Floats) -> tuple[Floats, Floats]:
    """Temperatures (m,) that stand for those of samples (n,), ascending, and how many samples each stands for.

    Where there are more than `MAX_COMPARED_TEMPERATURES` distinct ones, neighbours are taken together: as many samples
    in each group, their mean for all of them.

    Examples
    --------
    >>> compared_temperatures(np.array([40.0, 30.0, 40.0]))
    (array([30., 40.]), array([1., 2.]))
    """
    distinct, count = np.unique(temperature, return_counts=True)
    if distinct.size <= MAX_COMPARED_TEMPERATURES:
        return distinct, count.astype(float)
    groups = np.array_split(np.sort(temperature), MAX_COMPARED_TEMPERATURES)
    return np.array([g.mean() for g in groups]), np.array([float(g.size) for g in groups])


def nearest_sigmoids(temperature: Floats, curve: Floats, count: Floats | None = None) -> Floats:
    """Published sigmoids nearest to curves in the mean square.

    Parameters
    ----------
    temperature : ndarray, shape (n,)
        Ascending.
    curve : ndarray, shape (N, n)
    count : ndarray, shape (n,), optional
        Samples that each temperature stands for; one by default.

    Returns
    -------
    ndarray, shape (N, 4)
        Span, rate, midpoint and offset; NaN where no sigmoid is nearest, only ever flatter or steeper ones.

    Examples
    --------
    >>> t = np.linspace(20.0, 80.0, 50)
    >>> nearest_sigmoids(t, (1.0 + 2.0 * expit(0.3 * (t - 50.0)))[None]).round(6)
    array([[ 2. ,  0.3, 50. ,  1. ]])
    """
    low, width = float(temperature[0]), float(np.ptp(temperature))
    x = (temperature - low) / width
    share = np.full(x.size, 1.0 / x.size) if count is None else count / count.sum()
    level = (curve @ share)[:, None]
    scale = np.maximum(np.ptp(curve, axis=1, keepdims=True), 1e-300)
    with np.errstate(invalid="ignore", over="ignore"):
        y = (curve - level) / scale
    usable = np.isfinite(y).all(axis=1)
    out = np.full((len(curve), 4), np.nan)
    if not usable.any():
        return out
    p = np.tile(_start(x, np.median(y[usable], axis=0), share), (int(usable.sum()), 1))
    found, settled = _descended(x, y[usable], share, p)
    # rate is known by its logarithm; the sign of a falling curve is in the span
    inside = (
        settled
        & (np.abs(found[:, 2] - 0.5) < 1.5)
        & (np.abs(found[:, 1]) < np.log(1e4))
        & (found[:, 1] > 0.0)
    )
    span, rate, middle, offset = (
        found[:, 0],
        np.exp(found[:, 1]) / width,
        low + found[:, 2] * width,
        found[:, 3],
    )
    whole = np.stack(
        [span * scale[usable, 0], rate, middle, level[usable, 0] + offset * scale[usable, 0]], axis=1
    )
    out[usable] = np.where(inside[:, None], whole, np.nan)
    return out


def _start(x: Floats, y: Floats, share: Floats) -> Floats:
    """Nearest sigmoid of one curve on [0, 1]: span, ln rate, midpoint, offset; from several rates, the best."""
    sign = 1.0 if y[-1] >= y[0] else -1.0
    middle = float(np.clip(x[np.argmin(np.abs(y - 0.5 * (y[0] + y[-1])))], 0.1, 0.9))

    def missed(p: Floats) -> Floats:
        return np.asarray(np.sqrt(share) * (_sigmoid(x, p[None])[0] - y))

    best = None
    for rate in (5.0, 15.0, 50.0):
        p = np.array([sign, np.log(rate), middle, y[0]])
        found = least_squares(missed, p, max_nfev=200)
        if best is None or found.cost < best.cost:
            best = found
    assert best is not None  # there are three starts
    return np.asarray(best.x, dtype=float)


def _sigmoid(x: Floats, p: Floats) -> Floats:
    with np.errstate(over="ignore"):
        return np.asarray(p[:, 3:4] + p[:, 0:1] * expit(np.exp(p[:, 1:2]) * (x - p[:, 2:3])))


def _descended(x: Floats, y: Floats, share: Floats, p: Floats) -> tuple[Floats, Bools]:
    """Least-squares sigmoids (N, 4) by damped Gauss-Newton steps, all at once, and which have settled (N,)."""
    p, damping = p.copy(), np.full(len(p), 1e-6)
    cost = _missed(x, y, share, p)
    settled = np.zeros(len(p), dtype=bool)
    for _ in range(STEPS):
        going = np.flatnonzero(~settled)
        if not going.size:
            break
        trial, step = _stepped(x, y[going], share, p[going], damping[going])
        new = _missed(x, y[going], share, trial)
        better = new <= cost[going] * (1.0 + 1e-12)
        settled[going] = better & (np.abs(step).max(axis=1) < CLOSE)
        p[going] = np.where(better[:, None], trial, p[going])
        cost[going] = np.where(better, new, cost[going])
        damping[going] = np.where(
            better, np.maximum(damping[going] * 0.1, LEAST_DAMPING), damping[going] * 10.0 + 1e-8
        )
    return p, settled


def _missed(x: Floats, y: Floats, share: Floats, p: Floats) -> Floats:
    """Mean squares (N,)."""
    with np.errstate(over="ignore", invalid="ignore"):
        return np.asarray((y - _sigmoid(x, p)) ** 2 @ share)


def _stepped(x: Floats, y: Floats, share: Floats, p: Floats, damping: Floats) -> tuple[Floats, Floats]:
    """Parameters (N, 4) after a damped step, and the step before it is cut to one at most."""
    with np.errstate(over="ignore", invalid="ignore"):
        rate = np.exp(p[:, 1:2])
        away = x - p[:, 2:3]
        s = expit(rate * away)
        steep = p[:, 0:1] * s * (1.0 - s)
        j = np.stack([s, steep * rate * away, -steep * rate, np.ones_like(s)], axis=-1)
    r = y - (p[:, 3:4] + p[:, 0:1] * s)
    weighted = np.swapaxes(j * share[:, None], 1, 2)
    gram, pull = weighted @ j, weighted @ r[..., None]
    held = (damping[:, None] * np.einsum("wii->wi", gram) + TINY)[:, :, None] * np.eye(4)
    step = np.linalg.solve(np.nan_to_num(gram + held), np.nan_to_num(pull))[..., 0]
    return p + np.clip(step, -1.0, 1.0), step
