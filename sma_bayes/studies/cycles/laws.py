"""Laws of training: how the numbers of sweeps go with the cycle, pooled over cycles, in closed form.

A number of sweep ``i``, such as its shift, was found to be ``y_i`` with the standard deviation ``sqrt(v_i)``:

    y_i = a + b x(N_i; n_0) + w(N_i) + u_i + e_i

with a law ``x``, which all numbers of a condition share, and its pace ``n_0``, which each has about that of the
condition, ``N0`` (ln n_0 is normal: what settles by one process is not seen in every number at one time), a random walk
``w`` whose first step has the standard deviation ``omega``, a random effect ``u_i`` of the sweep with ``tau``, and the
error ``e_i``. The walk goes with the cycle, or with its logarithm, so that what a law misses early is not expected
again later. Without a law the rest is free to change with every sweep, by chance or along a walk, and a law has to beat
that.

A law acts on some numbers and leaves the others as they are (``b = 0``). Training may be seen in one kind of number
alone, such as the stroke: how many kinds move is integrated out (`movers`). Numbers of one kind, those of heating and
cooling, are no independent witnesses, as a spring that wanders does so in both: the evidence of a kind is the mean of
theirs, which holds however they depend on each other. Nor is it known how large changes are: ``b`` is normal, and its
standard deviation on a grid that goes from all that a spring can change by to a thirtieth of that, since a width that
is far too great takes evidence from what is small and clear (Bartlett).

How well a spring repeats in its rig is told by all numbers together: half-Cauchy priors of ``tau`` and ``omega`` have
a scale in common, and the share of numbers that walk is one for all, both on grids.

Given ``n_0``, ``tau``, ``omega`` and the size of ``b`` all else is normal and is integrated exactly; these are on
grids. So the evidence of each law is a sum, and draws, given the kinds that move, are exact up to the grids.

References
----------
A. Gelman et al., Bayesian Data Analysis, 3rd ed. (2013), ch. 5 (partial pooling); A. Gelman, Bayesian Anal. 1 (2006)
515 (half-Cauchy priors of standard deviations of effects); J. G. Scott and J. O. Berger, Ann. Stat. 38 (2010) 2587
(which ones move, where there are many); V. Vovk and R. Wang, Ann. Stat. 49 (2021) 1736 (means of evidence that is not
independent); M. S. Bartlett, Biometrika 44 (1957) 533 (evidence and the width of a prior); F. Liang et al., J. Am.
Stat. Assoc. 103 (2008) 410 (mixtures of widths); G. Williams and D. C. Watts, Trans. Faraday Soc. 66 (1970) 80
(stretched exponential); A. G. Journel and C. J. Huijbregts, Mining Geostatistics (1978), ch. VII (draws of a normal
process made conditional by a correction of unconditional ones).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Final

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.special import logsumexp

from sma_bayes.arrays import Bools, Floats, Ints
from sma_bayes.studies.cycles.movers import Movers
from sma_bayes.studies.cycles.schema import Law

NONE: Final = "none"
LAW_POWERS: Final[Mapping[Law, tuple[float, ...]]] = {
    "exponential": (1.0,),
    "stretched": (0.75, 0.5, 0.35),
    "logarithmic": (0.0,),
}
"""Laws with their powers on the grid: 1 - exp(-(N/N0)^power), and for the power 0 its limit ln(1 + N/N0)."""
LAWS: Final = tuple(LAW_POWERS)
N0_GRID: Final = np.geomspace(0.3, 300.0, 33)
"""Cycles N0 on the grid, of a condition and of its numbers."""
LN_OWN_N0_SD: Final = 0.3
"""Standard deviation of ln N0 of single numbers about that of their condition: 90 % within a factor of 1.6."""
USUAL_N0: Final = 5.0
LN_N0_SD: Final = 1.2
"""Standard deviation of the prior of ln N0 about that of `USUAL_N0`: 90 % between 0.7 and 36 cycles."""
CHANGE_SD_GRID: Final = np.array([1.0, 0.3, 0.1, 0.03])
"""Standard deviations of the change by a law on the grid [usual changes], equally probable."""
SCATTER_SD_GRID: Final = np.geomspace(0.002, 50.0, 20)
"""Standard deviations of the effect of a sweep on the grid [usual ones]; the least are below what any rig tells."""
WALK_SD_GRID: Final = np.geomspace(0.003, 10.0, 8)
"""First steps of the walk on the grid [usual scatter], by either clock."""
SCALE_GRID: Final = (1.0, 0.3, 0.1, 0.03, 0.01)
"""About which scatter and steps of all numbers are [usual ones]."""
WALKING_SHARE_GRID: Final = (0.1, 0.5, 0.9)
"""Shares of the numbers that walk; each clock has half of these."""
REPEATABILITY_GRID: Final = tuple(product(SCALE_GRID, WALKING_SHARE_GRID))
"""How well a spring repeats in its rig: the scale and the share on the grid, all equally probable."""
USUAL_STEP: Final = 1.0 / 3.0
LEVEL_SD: Final = 3.0
"""Standard deviation of the level about the mean of the data [usual changes]."""
LEAST_LN_EVIDENCE_GAIN: Final = 3.0
"""What a law must gain in ln evidence over free changes of each sweep: odds of 20 to 1."""
FEWEST_CYCLES: Final = 3
"""Cycles from which a law can be told from anything."""


@dataclass(frozen=True, slots=True, eq=False)
class Series:
    """One of the numbers of the sweeps of a curve.

    Attributes
    ----------
    cycle, value, variance : ndarray, shape (n,)
        Cycle, counted from the first of the condition as 0; the number; the square of its standard deviation.
    change, scatter : float
        By how much such a number may change until the last measured cycle, and scatter that is usual.
    kind : str
        Numbers of one kind, such as the strokes on heating and cooling, move or wander together.
    """

    cycle: Floats
    value: Floats
    variance: Floats
    change: float
    scatter: float
    kind: str


@dataclass(frozen=True, slots=True, eq=False)
class NumberDraws:
    """NumberDraws of one number of all cycles of a condition.

    Attributes
    ----------
    state : ndarray, shape (S, G)
        Level, law and walk: what the sweeps of a cycle scatter about.
    sweep : ndarray, shape (S, G)
        The number of the sweep itself; where none was measured, that of one to come.
    law : ndarray, shape (S, G)
        Level and law alone.
    moving : ndarray of bool, shape (S,)
        Whether the law acts on the number.
    scatter, step : ndarray, shape (S,)
        ``tau`` and ``omega``.
    """

    state: Floats
    sweep: Floats
    law: Floats
    moving: np.ndarray[tuple[int], np.dtype[np.bool_]]
    scatter: Floats
    step: Floats


def approach(power: float, pace: float, cycle: Floats, last: float) -> Floats:
    """A law of training, 0 at cycle 0 and 1 at the last measured one.

    Parameters
    ----------
    power : float
        Of `LAW_POWERS`: ``1 - exp(-(N/N0)^power)``, or for 0 ``ln(1 + N/N0)``, each over its value at `last`.
    pace : float
        N0.
    cycle : ndarray
        N, counted from 0.
    last : float
        Last measured cycle, greater than 0.
    """
    if power == 0.0:
        return np.asarray(np.log1p(cycle / pace) / np.log1p(last / pace))
    return np.asarray(np.expm1(-((cycle / pace) ** power)) / np.expm1(-((last / pace) ** power)))


def _clock(logarithmic: bool, cycle: Floats) -> Floats:
    """By which the variance of a walk grows, 1 in the first cycle."""
    return np.log2(1.0 + cycle) if logarithmic else cycle


class LawPosterior:
    """Posterior of laws over the numbers of one condition.

    Parameters
    ----------
    series : sequence of Series
    forms : sequence of str
        Laws that are considered beside none.
    """

    def __init__(self, series: Sequence[Series], forms: Sequence[Law] = LAWS) -> None:
        self.last = max(float(s.cycle.max()) for s in series)
        tested = len({c for s in series for c in s.cycle.tolist()}) >= FEWEST_CYCLES
        self.forms = tuple(forms) if tested else ()
        self.laws = [
            (power, float(pace)) for form in self.forms for power in LAW_POWERS[form] for pace in N0_GRID
        ]
        self.testable = tested
        self._series = [_Marginal(s, self.laws, self.last) for s in series]
        kinds = [s.kind for s in series]
        self._of_kind = [
            np.array([i for i, k in enumerate(kinds) if k == kind]) for kind in dict.fromkeys(kinds)
        ]

    @cached_property
    def _movers(self) -> tuple[Movers, list[Movers]]:
        """Which kinds of numbers a law moves, and of each kind which numbers."""
        odds = np.array([s.log_odds.ravel() for s in self._series])
        means = [logsumexp(odds[own], axis=0) - np.log(own.size) for own in self._of_kind]
        return Movers(np.array(means)), [Movers(odds[own]) for own in self._of_kind]

    @cached_property
    def _log_joint(self) -> Floats:
        """Log of prior times likelihood: of no law, and of each law and N0, in each rig, shape (R, 1 + K)."""
        none = np.sum([s.log_still for s in self._series], axis=0)[:, None] - np.log(len(REPEATABILITY_GRID))
        each = none + self._movers[0].log_odds.reshape(len(REPEATABILITY_GRID), -1)
        prior = -0.5 * (np.log(N0_GRID / USUAL_N0) / LN_N0_SD) ** 2
        prior -= logsumexp(prior)
        each += np.concatenate([
            prior - np.log(len(LAW_POWERS[form])) for form in self.forms for _ in LAW_POWERS[form]
        ] or [[]])  # fmt: skip
        return np.concatenate([none, each], axis=1)

    @cached_property
    def _log_of_law(self) -> Floats:
        """The same over all rigs, shape (1 + K,)."""
        return np.asarray(logsumexp(self._log_joint, axis=0))

    def _of(self, form: Law) -> Floats:
        """Log of prior times likelihood of a law, by power and N0, shape (powers, N0)."""
        before = [len(LAW_POWERS[f]) for f in self.forms[: self.forms.index(form)]]
        first = 1 + N0_GRID.size * sum(before)
        return self._log_of_law[first : first + N0_GRID.size * len(LAW_POWERS[form])].reshape(
            -1, N0_GRID.size
        )

    @cached_property
    def ln_evidence(self) -> dict[Law, float]:
        """Of none and of each law, less that of none."""
        none = self._log_of_law[0]
        return {NONE: 0.0, **{form: float(logsumexp(self._of(form)) - none) for form in self.forms}}

    @cached_property
    def probability(self) -> dict[Law, float]:
        """Of each law, all as probable beforehand."""
        logs = np.array(list(self.ln_evidence.values()))
        return dict(zip(self.ln_evidence, np.exp(logs - logsumexp(logs)).tolist(), strict=True))

    @property
    def chosen(self) -> Law:
        """The law with the greatest evidence, if it gains `LEAST_LN_EVIDENCE_GAIN` over none; else none."""
        best = max(self.ln_evidence, key=lambda law: self.ln_evidence[law])
        return best if self.ln_evidence[best] >= LEAST_LN_EVIDENCE_GAIN else NONE

    def pace_weights(self, form: Law) -> Floats:
        """Posterior of N0 of the condition under a law, on `N0_GRID`."""
        logs = logsumexp(self._of(form), axis=0)
        return np.asarray(np.exp(logs - logsumexp(logs)))

    def own_pace_weights(self, form: Law) -> Floats:
        """The same of a number of the condition that was not looked at."""
        return np.asarray(self.pace_weights(form) @ np.exp(_LOG_OWN_N0))

    def draw(self, grid: Floats, size: int, rng: np.random.Generator) -> tuple[Ints, list[NumberDraws]]:
        """Draw laws, and with them the numbers of measured and later cycles.

        Parameters
        ----------
        grid : ndarray, shape (G,)
            Cycles, counted from 0, rising; all measured ones are among them.
        size : int
            S.
        rng : numpy.random.Generator

        Returns
        -------
        law : ndarray of int, shape (S,)
            0 for none, else 1 more than the place in `laws`.
        draws : list of NumberDraws
            One for each series.
        """
        weight = np.exp(self._log_joint - logsumexp(self._log_joint))
        place = rng.choice(weight.size, size=size, p=weight.ravel() / weight.sum())
        rig, law = np.divmod(place, weight.shape[1])
        shapes = np.array([np.zeros_like(grid), *(approach(f, p, grid, self.last) for f, p in self.laws)])
        moving = self._moving(rig, law, rng)
        return law, [
            s.draw(rig, law, m, shapes, grid, rng) for s, m in zip(self._series, moving, strict=True)
        ]

    def _moving(self, rig: Ints, law: Ints, rng: np.random.Generator) -> Bools:
        """Which numbers the law of each draw moves, shape (series, S)."""
        moving = np.zeros((len(self._series), law.size), dtype=bool)
        acts = np.flatnonzero(law)
        if acts.size:
            among, within = self._movers
            place = len(self.laws) * rig[acts] + law[acts] - 1
            kinds = among.draw(place, rng)
            for own, of_kind, moved in zip(self._of_kind, within, kinds, strict=True):
                moving[np.ix_(own, acts)] = of_kind.draw(place, rng) & moved
        return moving


class _Marginal:
    """One series with level and change integrated out, at each place (tau, omega) of the grid.

    Attributes
    ----------
    of_rig : ndarray, shape (R, C)
        Log prior of the places in each rig.
    still : ndarray, shape (C,)
        Log likelihood where no law acts.
    moving : ndarray, shape (C, K, W)
        With each law and size of the change, N0 being that of the number; the prior of the sizes is in it.
    log_still : ndarray, shape (R,)
        Log likelihood in each rig, where no law acts.
    own_odds, log_odds : ndarray, shape (R, K)
        That where a law acts, less this, by the N0 of the number, and by that of the condition.
    """

    def __init__(self, series: Series, laws: Sequence[tuple[float, float]], last: float) -> None:
        self.series, n = series, series.cycle.size
        self.centre = float(series.value.mean())
        self.y = series.value - self.centre
        steps = np.concatenate([[0.0], WALK_SD_GRID, WALK_SD_GRID]) * series.scatter
        self.tau = np.repeat(SCATTER_SD_GRID * series.scatter, steps.size)
        self.omega = np.tile(steps, SCATTER_SD_GRID.size)
        self.logarithmic = np.tile(np.arange(steps.size) > WALK_SD_GRID.size, SCATTER_SD_GRID.size)
        design = [np.ones(n), *(approach(power, pace, series.cycle, last) for power, pace in laws)]
        self.design = np.array(design).T
        self.factors = [cho_factor(self._covariance(c), lower=True) for c in range(self.tau.size)]
        columns = np.column_stack([self.y, self.design])
        solved = [cho_solve(f, columns) for f in self.factors]
        gram = np.array([columns.T @ s[:, :2] for s in solved])  # with y and with the level
        own = np.array([np.einsum("ij,ij->j", columns, s) for s in solved])
        log_det = np.array([2.0 * np.log(np.diag(f[0])).sum() for f in self.factors])
        self.of_rig = self._log_prior()
        base = -0.5 * (log_det + own[:, 0] + n * np.log(2.0 * np.pi))
        level = (LEVEL_SD * series.change) ** -2
        self.change = (CHANGE_SD_GRID * series.change) ** -2
        self.m11, self.h1 = gram[:, 1, 1] + level, gram[:, 1, 0]
        self.m1k, self.mkk, self.hk = gram[:, 2:, 1], own[:, 2:], gram[:, 2:, 0]
        self.still = base + 0.5 * (self.h1**2 / self.m11 - np.log(self.m11 / level))
        rest = (self.mkk - self.m1k**2 / self.m11[:, None])[..., None] + self.change
        explained = (self.hk - self.m1k * (self.h1 / self.m11)[:, None])[..., None] ** 2 / rest
        self.moving = self.still[:, None, None] + 0.5 * (explained - np.log(rest / self.change))
        self.moving -= np.log(CHANGE_SD_GRID.size)
        self.log_still = logsumexp(self.of_rig + self.still, axis=1)
        best = self.moving.max(axis=(0, 2), initial=-np.inf)
        moving = np.exp(self.moving - best[:, None]).sum(axis=2)
        self.own_odds = np.log(np.exp(self.of_rig) @ moving) + best - self.log_still[:, None]
        by_own = self.own_odds.reshape(len(self.of_rig), len(laws) // N0_GRID.size, 1, N0_GRID.size)
        self.log_odds = logsumexp(by_own + _LOG_OWN_N0, axis=3).reshape(self.own_odds.shape)

    def _covariance(self, c: int) -> Floats:
        s = self.series
        walk = self._of_walk(c, s.cycle)
        return np.asarray(walk + np.diag(self.tau[c] ** 2 + s.variance))

    def _of_walk(self, c: int, cycle: Floats) -> Floats:
        """Covariance of the walk at some cycles with that at the measured ones."""
        logarithmic = bool(self.logarithmic[c])
        seen, there = _clock(logarithmic, self.series.cycle), _clock(logarithmic, cycle)
        return np.asarray(self.omega[c] ** 2 * np.minimum.outer(there, seen))

    def _log_prior(self) -> Floats:
        """Half-Cauchy priors on grids that are even in the logarithm, shape (R, C)."""
        return np.array([
            np.log(
                np.outer(
                    _half_cauchy(SCATTER_SD_GRID / scale),
                    np.concatenate(
                        [[1.0 - share], *2 * [0.5 * share * _half_cauchy(WALK_SD_GRID / (USUAL_STEP * scale))]]
                    ),
                )
            ).ravel()
            for scale, share in REPEATABILITY_GRID
        ])  # fmt: skip

    def draw(
        self, rig: Ints, law: Ints, moving: Bools, shapes: Floats, grid: Floats, rng: np.random.Generator
    ) -> NumberDraws:
        """NumberDraws along a grid, given the rig and the law of each, and whether it acts on the number."""
        law = self._own_law(rig, law, moving, rng)
        at, size = np.zeros((2, law.size), dtype=np.int64)
        laws = 1 + self.moving.shape[1]
        for place, mine in _groups(laws * rig + law):
            r, k = divmod(place, laws)
            logs = self.of_rig[r][:, None] + (self.moving[:, k - 1] if k else self.still[:, None])
            weight = np.exp(logs - logsumexp(logs)).ravel()
            drawn = rng.choice(weight.size, size=mine.size, p=weight / weight.sum())
            at[mine], size[mine] = np.divmod(drawn, logs.shape[1])
        b = self._coefficients(law, moving, at, size, rng)
        mean = self.centre + b[:, :1] + b[:, 1:] * shapes[law]
        walk, effect = np.zeros_like(mean), rng.standard_normal(mean.shape) * self.tau[at, None]
        seen = np.searchsorted(grid, self.series.cycle)
        for c, own in _groups(at):
            left = self.series.value - mean[np.ix_(own, seen)]
            walk[own] = self._walk(c, left, grid, seen, rng)
            left -= walk[np.ix_(own, seen)]
            kept = self.tau[c] ** 2 / (self.tau[c] ** 2 + self.series.variance)
            noise = rng.standard_normal(left.shape) * np.sqrt(kept * self.series.variance)
            effect[np.ix_(own, seen)] = kept * left + noise
        state = mean + walk
        return NumberDraws(state, state + effect, mean, moving, self.tau[at], self.omega[at])

    def _own_law(self, rig: Ints, law: Ints, moving: Bools, rng: np.random.Generator) -> Ints:
        """The law of each draw with the N0 that the number has; 0 where none acts on it."""
        own, laws = np.zeros_like(law), 1 + self.moving.shape[1]
        for place, mine in _groups(laws * rig + np.where(moving, law, 0)):
            r, k = divmod(place, laws)
            if k:
                of_power, pace = divmod(k - 1, N0_GRID.size)
                first = of_power * N0_GRID.size
                logs = self.own_odds[r, first : first + N0_GRID.size] + _LOG_OWN_N0[pace]
                p = np.exp(logs - logsumexp(logs))
                own[mine] = 1 + first + rng.choice(N0_GRID.size, size=mine.size, p=p)
        return own

    def _coefficients(
        self, law: Ints, moving: Bools, at: Ints, size: Ints, rng: np.random.Generator
    ) -> Floats:
        """Level and change of each draw, (S, 2)."""
        change, m1k = np.zeros((2, law.size))
        own, k, i = at[moving], law[moving] - 1, np.flatnonzero(moving)
        m1k[i] = self.m1k[own, k]
        rest = self.mkk[own, k] - m1k[i] ** 2 / self.m11[own] + self.change[size[i]]
        expected = (self.hk[own, k] - m1k[i] * self.h1[own] / self.m11[own]) / rest
        change[i] = expected + rng.standard_normal(i.size) / np.sqrt(rest)
        m11 = self.m11[at]
        level = (self.h1[at] - m1k * change) / m11 + rng.standard_normal(law.size) / np.sqrt(m11)
        return np.column_stack([level, change])

    def _walk(self, c: int, left: Floats, grid: Floats, seen: Ints, rng: np.random.Generator) -> Floats:
        """Walks given what they and scatter leave together: unconditional ones, corrected by what they miss."""
        omega = float(self.omega[c])
        if omega == 0.0:
            return np.zeros((len(left), grid.size))
        steps = np.sqrt(np.diff(_clock(bool(self.logarithmic[c]), grid), prepend=0.0))
        free = np.cumsum(omega * steps * rng.standard_normal((len(left), grid.size)), axis=1)
        noise = rng.standard_normal(left.shape) * np.sqrt(self.tau[c] ** 2 + self.series.variance)
        missed = cho_solve(self.factors[c], (left - free[:, seen] - noise).T)
        return np.asarray(free + (self._of_walk(c, grid) @ missed).T)


def _log_own_n0() -> Floats:
    """Log probability of each N0 of a number, given that of its condition, shape (N0 of the condition, N0)."""
    logs = -0.5 * (np.subtract.outer(np.log(N0_GRID), np.log(N0_GRID)) / LN_OWN_N0_SD) ** 2
    return np.asarray(logs - logsumexp(logs, axis=1, keepdims=True))


_LOG_OWN_N0: Final = _log_own_n0()


def _half_cauchy(ratio: Floats) -> Floats:
    """Probabilities on a grid that is even in the logarithm."""
    density = ratio / (1.0 + ratio**2)
    return np.asarray(density / density.sum())


def _groups(places: Ints) -> Iterator[tuple[int, Ints]]:
    """Each place with the draws that are there."""
    for c in np.unique(places):
        yield int(c), np.flatnonzero(places == c)
