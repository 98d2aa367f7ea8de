"""Effects of what was set on what came out: the posterior of each change, with and without scatter between conditions.

Each feature y of condition c is regressed on the settings that vary, a positive one through its logarithm:

    y_c = x_c beta + tau e_c,    e_c ~ N(0, 1),    y_c known up to its posterior, N(m_c, s_c**2)

beta has a flat prior, tau a half Student t with 4 degrees of freedom whose scale is the spread of the feature over the
conditions. Two answers are given: how the tested conditions differ (least squares on each posterior draw, no scatter),
and what the setting does beyond them (with the scatter, of which few conditions tell little).

References
----------
A. Gelman, "Prior distributions for variance parameters in hierarchical models", Bayesian Analysis 1 (2006) 515,
doi 10.1214/06-BA117A: half Student t for the scatter between few groups.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp

from sma_bayes.arrays import Floats
from sma_bayes.errors import require_seed
from sma_bayes.fitting.curves import interval_where_defined
from sma_bayes.studies.conditions.design import Confounder, Design, confounders, designs
from sma_bayes.studies.conditions.features import BOTH, Feature

SCATTER_PRIOR_DF = 4.0
"""Degrees of freedom of the prior of the scatter."""
SCATTER_GRID = np.geomspace(1e-3, 1e2, 301)
"""Scatters at which its posterior is worked out, in units of the scale of its prior."""
DRAWS = 4000
MEASURED_SETTINGS = ("least_temperature", "peak_temperature")
"""Features that were measured rather than set, and vary along with the settings."""

MAX_SHARE_LACKING = 0.1
"""Share of the draws of a condition that may lack a feature, such as a start that the tangent puts beyond what was
measured: an effect is then that of the others."""
MATERIAL_END_SHIFT = 0.02
"""Share of a temperature sweep by which an end of it must differ between conditions to matter."""


@dataclass(frozen=True, slots=True, eq=False)
class SettingEffect:
    """What a setting does to a feature.

    Attributes
    ----------
    feature, branch, channel, unit : str
        See `Feature`.
    setting : str
    from_, to : float
        Least and greatest value of the setting [canonical unit].
    conditions : tuple of str
    factor : bool
        Whether the change is a factor [1] rather than a difference [`unit`].
    tested : mapping of str to float or None
        ``q05``, ``median``, ``q95`` of the change from `from_` to `to` in the tested conditions; None where the setting
        varied only together with others.
    beyond : mapping of str to float or None
        The same with scatter between conditions: of the setting itself. None as above, and where no condition is left
        to tell the scatter.
    probability_rises : float or None
        That the feature rises with the setting, scatter allowed for [1].
    scatter : mapping of str to float or None
        Scatter between conditions: standard deviation of the feature [`unit`], or of its logarithm [1].
    why : str
        Why one of these is None; empty where all are told.
    defined : float
        Share of the draws that have the feature, in the condition where it is least [1]; the others are left out.
    aliased_with : tuple of str
        Settings that varied together with this one.
    confounders : tuple of Confounder
        What else varied along with it.
    """

    feature: str
    branch: str
    channel: str
    unit: str
    setting: str
    from_: float
    to: float
    conditions: tuple[str, ...]
    factor: bool
    tested: Mapping[str, float] | None
    beyond: Mapping[str, float] | None
    probability_rises: float | None
    scatter: Mapping[str, float] | None
    why: str
    defined: float
    aliased_with: tuple[str, ...]
    confounders: tuple[Confounder, ...]


def operating_effects(features: Sequence[Feature], *, seed: int = 0) -> tuple[SettingEffect, ...]:
    """Effects of all settings on all features.

    Parameters
    ----------
    features : sequence of Feature
        As `condition_features` gives them.
    seed : int
        Decides the draws.

    Returns
    -------
    tuple of SettingEffect
        By group of conditions that state the same settings, feature, and setting that varies among them.
    """
    require_seed(seed)
    conditions = tuple(dict.fromkeys(f.condition for f in features))
    out: list[SettingEffect] = []
    for design in designs(conditions):
        if not design.varied:
            continue
        came_about = _came_about(design, features)
        along = confounders(design, came_about)
        for name, branch, channel in dict.fromkeys((f.name, f.branch, f.channel) for f in features):
            if name in MEASURED_SETTINGS and name not in came_about:
                continue
            members = {
                f.condition: f for f in features if (f.name, f.branch, f.channel) == (name, branch, channel)
            }
            if all(c in members for c in design.conditions):
                words = f"{name} {branch} {channel} {' '.join(design.ids)}"
                rng = np.random.default_rng(np.random.SeedSequence([seed, 11, *words.encode()]))
                out += _effects(design, [members[c] for c in design.conditions], along, rng)
    return tuple(out)


def _came_about(design: Design, features: Sequence[Feature]) -> dict[str, Floats]:
    found = {(f.name, f.condition): float(f.draws[0]) for f in features if f.branch == BOTH and f.measured}
    by_name = {name: np.array([found[name, c] for c in design.conditions]) for name in MEASURED_SETTINGS}
    least, peak = (by_name[name] for name in MEASURED_SETTINGS)
    sweep = float(np.median(peak - least))
    return {name: values for name, values in by_name.items() if np.ptp(values) > MATERIAL_END_SHIFT * sweep}


def _effects(
    design: Design, members: Sequence[Feature], along: Sequence[Confounder], rng: np.random.Generator
) -> Iterator[SettingEffect]:
    first = members[0]
    size = min(f.draws.size for f in members)
    y = np.stack([f.draws[:size] for f in members])  # draw by draw: conditions share errors of calibrations
    has = np.isfinite(y) & ((y > 0.0) | (not first.on_log))
    lacking = {f.condition.id: 1.0 - float(own.mean()) for f, own in zip(members, has, strict=True)}
    together = has.all(axis=0)
    usable = max(lacking.values()) <= MAX_SHARE_LACKING and bool(together.any())
    y = y[:, together]
    y = np.log(y) if first.on_log and usable else y
    tested = np.linalg.pinv(design.matrix) @ y if usable else None
    general = regression(design.matrix, y, rng) if usable and design.spare > 0 else None
    for place, setting in enumerate(design.varied, 1):
        aliased = design.aliased(setting)
        told = not aliased
        slope = general.slopes[:, place] if general is not None and told else None
        yield (SettingEffect(
            feature=first.name, branch=first.branch, channel=first.channel, unit=first.unit,
            setting=setting, from_=float(design.low[place - 1]),
            to=float(design.low[place - 1] + design.range[place - 1]),
            conditions=design.ids, factor=first.on_log,
            tested=_change(tested[place], first.on_log) if tested is not None and told else None,
            beyond=None if slope is None else _change(slope, first.on_log),
            probability_rises=None if slope is None else float(np.mean(slope > 0.0)),
            scatter=None if general is None else interval_where_defined(general.scatter),
            why=_why(aliased, lacking if not usable else {}, design.spare),
            defined=1.0 - max(lacking.values()),
            aliased_with=aliased,
            confounders=tuple(c for c in along if c.setting == setting and c.other != first.name),
        ))  # fmt: skip


def _why(aliased: Sequence[str], lacking: Mapping[str, float], spare: int) -> str:
    """Why an effect is not told, or not with scatter; empty where it is."""
    if aliased:
        return f"varies only together with {', '.join(aliased)}"
    if lacking:
        worst = max(lacking, key=lambda c: lacking[c])
        return f"{lacking[worst]:.0%} of the curves of {worst} have none"
    return "" if spare > 0 else "no condition is left to tell the scatter"


def _change(slope: Floats, factor: bool) -> dict[str, float]:
    """Change over the range of the setting; regressors run over 1 from least to greatest."""
    return interval_where_defined(np.exp(slope) if factor else slope)


@dataclass(frozen=True, slots=True, eq=False)
class Regression:
    """Posterior of a regression over conditions.

    Attributes
    ----------
    slopes : ndarray, shape (S, 1 + V)
        Draws of beta, level first.
    scatter : ndarray, shape (S,)
        Draws of tau.
    """

    slopes: Floats
    scatter: Floats


def regression(matrix: Floats, y: Floats, rng: np.random.Generator, size: int = DRAWS) -> Regression:
    """Draw level, slopes and scatter: the scatter from its marginal posterior on a grid, the rest given it.

    Parameters
    ----------
    matrix : ndarray, shape (C, Q)
        Regressors, of rank below C.
    y : ndarray, shape (C, S)
        Posterior draws of the feature in each condition; what conditions share, such as the error of a calibration, is
        in their covariance.
    rng : Generator
    size : int
        Draws.
    """
    mean, known = y.mean(axis=1), np.cov(y, bias=True)
    apart = (y - y.mean(axis=0)).var(axis=1)  # less what all have in common
    widest = float(np.sqrt(apart.max() * mean.size / (mean.size - 1)))
    scale = max(float(np.std(mean, ddof=1)), widest, 1e-12 * float(np.abs(mean).max()))
    if not scale > 0.0:
        return Regression(np.zeros((size, matrix.shape[1])), np.zeros(size))
    grid = scale * SCATTER_GRID
    basis, _, turn = _full_rank(matrix)
    known += 1e-12 * known.max() * np.eye(mean.size)  # so that an error which all share can be divided by
    fits = [_given_scatter(basis, mean, known + tau**2 * np.eye(mean.size)) for tau in grid]
    log_mass = np.array([f[2] for f in fits]) - 0.5 * (SCATTER_PRIOR_DF + 1.0) * np.log1p(
        SCATTER_GRID**2 / SCATTER_PRIOR_DF
    )
    log_mass += np.log(grid)  # equal steps of the logarithm
    place = rng.choice(grid.size, size, p=np.exp(log_mass - logsumexp(log_mass)))
    coefficient = np.stack([f[0] for f in fits])[place]
    root = np.stack([f[1] for f in fits])[place]
    coefficient = coefficient + np.einsum("sij,sj->si", root, rng.standard_normal(coefficient.shape))
    return Regression(coefficient @ turn.T, grid[place])


def _full_rank(matrix: Floats) -> tuple[Floats, int, Floats]:
    """Orthonormal columns (C, R) that span the regressors, R, and what turns their coefficients into slopes (Q, R)."""
    u, s, vt = np.linalg.svd(matrix, full_matrices=False)
    rank = int(np.sum(s > 1e-9 * s[0]))
    return u[:, :rank], rank, vt[:rank].T / s[:rank]


def _given_scatter(basis: Floats, mean: Floats, covariance: Floats) -> tuple[Floats, Floats, float]:
    """Coefficients, a root of their covariance, and the log marginal likelihood under a flat prior."""
    root = np.linalg.cholesky(covariance)
    q, r = np.linalg.qr(np.linalg.solve(root, basis))
    white = np.linalg.solve(root, mean)
    along = q.T @ white
    left = white - q @ along
    turn = np.linalg.inv(r)
    log_likelihood = -np.sum(np.log(np.diag(root))) - np.sum(np.log(np.abs(np.diag(r)))) - 0.5 * left @ left
    return turn @ along, turn, float(log_likelihood)
