r"""What has changed, by name: the change of all numbers together, beside what each cause would do to them.

A cause changes the numbers of the sweeps along directions B that follow from the fitted curves: a thermometer whose
zero moves shifts all sweeps alike, a load cell whose gain changes stretches the force of both branches about zero. The
change :math:`\hat\delta` since the onset is estimated by least squares, number by number, with the covariance C of
sweeps that scatter together, shrunk towards independence. A cause is supported if what it leaves is scatter,

.. math:: \min_a (\hat\delta - B a)' C^{-1} (\hat\delta - B a) \sim (K - r) F(K - r, \nu),

and it carries most of the change. Of supported causes those with the fewest directions that fit as well are named; the
data can't tell these apart. Where none is supported, pairs are tried; where none of these is, the change has no name.

References
----------
F. Auricchio et al., Comput. Struct. 81 (2003) 2301 (training); G. Eggeler et al., Mater. Sci. Eng. A 378 (2004) 24,
doi:10.1016/j.msea.2003.10.327 (functional fatigue); O. Ledoit, M. Wolf, J. Multivar. Anal. 88 (2004) 365,
doi:10.1016/S0047-259X(03)00096-4 (covariances shrunk).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import combinations
from typing import Final

import numpy as np
from scipy.stats import f as f_distribution, t as t_distribution

from sma_bayes.arrays import Floats
from sma_bayes.studies.cycles.sweeps import NUMBERS, USUAL_SCATTER, Strand
from sma_bayes.studies.watch.evidence import Watched, course
from sma_bayes.studies.watch.schema import OnsetDocument
from sma_bayes.studies.watch.state import WATCHED

LEAST_P: Final = 0.01
"""Probability of what a cause leaves, below which it is not supported."""
LEAST_SHARE: Final = 0.8
"""Share of the change that it has to carry."""
CHI_SQUARE_MARGIN: Final = 4.0
"""How much more causes may leave that are named beside the best one [chi square]."""
OFFSET, STROKE, SHIFT, WIDTH = range(4)


@dataclass(frozen=True, slots=True, eq=False)
class Cause:
    """Something that changes the numbers of the sweeps.

    Attributes
    ----------
    id : str
    title : str
    of : str
        ``sensor``, ``specimen`` or ``either``.
    effect : str
        Effect of the catalogue of `sma-bayes gap` that says the same; empty where none does.
    directions : ndarray, shape (K, r)
        By strand and number, what a unit of each amount does.
    amounts : tuple of (str, str)
        Name and unit of each.
    """

    id: str
    title: str
    of: str
    effect: str
    directions: Floats
    amounts: tuple[tuple[str, str], ...]


@dataclass(frozen=True, slots=True, eq=False)
class NamedCause:
    """A cause beside the change.

    Attributes
    ----------
    causes : tuple of Cause
        One, or two together.
    left, p, share : float
        Chi square that is left, its probability, and the share of the change that is carried.
    amount, sd : ndarray, shape (r,)
        At the last cycle.
    """

    causes: tuple[Cause, ...]
    left: float
    p: float
    share: float
    amount: Floats
    sd: Floats

    @property
    def supported(self) -> bool:
        """Whether the change may be this alone."""
        return self.p >= LEAST_P and self.share >= LEAST_SHARE


@dataclass(frozen=True, slots=True, eq=False)
class Change:
    """Change of the four numbers of all strands, from before the onset to the last cycle.

    Attributes
    ----------
    value : ndarray, shape (K,)
    covariance : ndarray, shape (K, K)
    spare : int
        Degrees of freedom.
    """

    value: Floats
    covariance: Floats
    spare: int


def watched_together(strands: Sequence[Strand]) -> Iterator[tuple[Cause, Floats]]:
    """Causes that move several numbers by one amount, with weights (K,) of the sum of all numbers that tells it best.

    Weights are those of least squares where numbers scatter independently and as they usually do: what the cause does
    over the variance. The scatter of the fitted sweeps is not asked, so that the sum of a sweep that nothing has
    changed is distributed as its numbers are.
    """
    usual = np.tile(USUAL_SCATTER, len(strands))
    for cause in causes_of(strands):
        if cause.directions.shape[1] == 1 and np.count_nonzero(cause.directions) > 1:
            weights = np.zeros((len(strands), len(WATCHED)))
            weights[:, : len(NUMBERS)] = (cause.directions[:, 0] / usual**2).reshape(-1, len(NUMBERS))
            yield cause, weights.ravel()


def change_of(numbers: Watched, began: OnsetDocument) -> Change | None:
    """Estimate the change; None where too few cycles tell of it."""
    strands = numbers.value.shape[1] // len(WATCHED)
    four = [s * len(WATCHED) + i for s in range(strands) for i in range(len(NUMBERS))]
    g = course(began.shape, began.median, numbers.fitted, numbers.watched)
    design = numbers.designs[len(numbers.designs) // 2]
    x = np.column_stack([design, g]) * np.sqrt(numbers.weight)[:, None]
    y = numbers.value[:, four] * np.sqrt(numbers.weight)[:, None]
    spare = len(y) - x.shape[1]
    if spare < 1 or np.linalg.matrix_rank(x) < x.shape[1]:
        return None
    beta = np.linalg.lstsq(x, y, rcond=None)[0]
    residual = y - x @ beta
    scatter = _shrunk(residual.T @ residual / spare, spare)
    return Change(beta[-1], float(np.linalg.inv(x.T @ x)[-1, -1]) * scatter, spare)


def _shrunk(covariance: Floats, spare: int) -> Floats:
    """Towards independence, the more so the fewer degrees of freedom there are."""
    sd = np.sqrt(np.diag(covariance))
    kept = spare / (spare + len(sd) + 1.0)
    return np.asarray(kept * covariance + (1.0 - kept) * np.diag(sd**2))


def named(change: Change, causes: Sequence[Cause]) -> list[NamedCause]:
    """Causes that account for a change as well as the best one, best first; empty where it has no name."""
    for together in (1, 2):
        tried = [_beside(change, group) for group in combinations(causes, together)]
        supported = [n for n in tried if n is not None and n.supported]
        if supported:
            fewest = min(n.amount.size for n in supported)
            few = sorted((n for n in supported if n.amount.size == fewest), key=lambda n: n.left)
            return [n for n in few if n.left <= few[0].left + CHI_SQUARE_MARGIN]
    return []


def _beside(change: Change, causes: tuple[Cause, ...]) -> NamedCause | None:
    b = np.column_stack([c.directions for c in causes])
    root = np.linalg.cholesky(change.covariance)
    y, x = np.linalg.solve(root, change.value), np.linalg.solve(root, b)
    if np.linalg.matrix_rank(x) < x.shape[1] or x.shape[1] >= y.size:
        return None
    q, r = np.linalg.qr(x)
    inverse = np.linalg.inv(r)
    amount = inverse @ (q.T @ y)
    left, total = float(np.sum((y - x @ amount) ** 2)), float(y @ y)
    spare = y.size - x.shape[1]
    p = float(f_distribution.sf(left / spare, spare, change.spare))
    return NamedCause(causes, left, p, 1.0 - left / total, amount, np.linalg.norm(inverse, axis=1))


def interval(n: NamedCause, spare: int) -> tuple[Floats, Floats]:
    """90 % interval of the amounts."""
    by = t_distribution.ppf(0.95, spare) * n.sd
    return n.amount - by, n.amount + by


def causes_of(strands: Sequence[Strand], change: Change | None = None) -> list[Cause]:
    """What may happen to a spring and to the sensors that follow it, as far as the measured channels show it.

    Curves stretched about a level by exp(g) move by exp(g) - 1, of which g is the beginning. Beside a `change` the
    moves are those of its stretches.
    """
    stretched = np.zeros(len(strands)) if change is None else change.value[STROKE :: len(NUMBERS)]
    table = _Table(strands, tuple(float(np.expm1(g) / g) if g else 1.0 for g in stretched))
    out = []
    for channel in dict.fromkeys(s.channel for s in strands):
        own = [i for i, s in enumerate(strands) if s.channel == channel]
        out += _of_channel(table, channel, own)
    every = list(range(len(strands)))
    out.append(table.cause(
        "temperature_shift", "all transformations have moved alike, or the zero of the thermometer", "either",
        "stress_shift", [("shift", "K", {(i, SHIFT): 1.0 for i in every})],
    ))  # fmt: skip
    out.append(table.cause(
        "thermometer_gain", "the scale of the thermometer", "sensor", "",
        [("gain", "1", {**{(i, SHIFT): strands[i].middle for i in every}, **{(i, WIDTH): 1.0 for i in every}})],
    ))  # fmt: skip
    branches = [s.record.branch.value for s in strands]
    if len(set(branches)) == 2:
        out.append(table.cause(
            "hysteresis", "the hysteresis between heating and cooling", "specimen", "asymmetric_kinetics",
            [("change", "K", {(i, SHIFT): 0.5 if b == "heating" else -0.5 for i, b in enumerate(branches)})],
        ))  # fmt: skip
        out.append(table.cause(
            "branch_shift", "the transformations of both branches have moved by themselves", "specimen",
            "branch_stress_shift",
            [
                (f"shift_{b}", "K", {(i, SHIFT): 1.0 for i in every if branches[i] == b})
                for b in dict.fromkeys(branches)
            ],
        ))  # fmt: skip
    out.append(table.cause(
        "width", "the transformation takes a wider or narrower range of temperatures", "specimen",
        "temperature_gradient", [("width", "1", {(i, WIDTH): 1.0 for i in every})],
    ))  # fmt: skip
    return out


def _of_channel(table: _Table, channel: str, own: list[int]) -> list[Cause]:
    strands = [table.strands[i] for i in own]
    unit = strands[0].unit
    name = strands[0].record.quantity(channel)
    moves = {(i, OFFSET): 1.0 / s.span for i, s in zip(own, strands, strict=True)}

    def about(level: Callable[[Strand], float]) -> dict[tuple[int, int], float]:
        """Stretched by a unit of ln about a level."""
        return {
            **{(i, STROKE): 1.0 for i in own},
            **{
                (i, OFFSET): table.moved[i] * (s.level - level(s)) / s.span
                for i, s in zip(own, strands, strict=True)
            },
        }

    moved = "the spring has set, or the zero of the sensor has moved" if channel == "displacement" else (
        "the zero of the sensor has moved, or a constant part of what is measured"
    )  # fmt: skip
    scaled = (
        (f"the {name} has another scale: that of its sensor, or another stiffness", "either")
        if channel in ("force", "stiffness")
        else (f"the scale of the {name} sensor", "sensor")
    )
    return [
        table.cause(
            f"{channel}_offset", f"{name}: {moved}", "either", "training_drift" if channel == "displacement" else
            "sensor_drift", [("offset", unit, moves)],
        ),
        table.cause(
            f"{channel}_gain", *scaled, "", [("gain", "1", about(lambda s: 0.0))]
        ),
        table.cause(
            f"{channel}_stroke_cold", f"the stroke of {name}, the cold end fixed", "specimen", "amplitude_fatigue",
            [("stroke", "1", about(partial(_at_end, end=0)))],
        ),
        table.cause(
            f"{channel}_stroke_hot", f"the stroke of {name}, the hot end fixed", "specimen", "amplitude_fatigue",
            [("stroke", "1", about(partial(_at_end, end=1)))],
        ),
        table.cause(
            f"{channel}_set_and_stroke", f"offset and stroke of {name} together", "specimen", "training",
            [("offset", unit, moves), ("stroke", "1", {(i, STROKE): 1.0 for i in own})],
        ),
    ]  # fmt: skip


def _at_end(strand: Strand, end: int) -> float:
    return float(strand.common(np.array([strand.ends[end]]))[0])


@dataclass(frozen=True, slots=True, eq=False)
class _Table:
    strands: Sequence[Strand]
    moved: tuple[float, ...]
    """By strand, how much a stretched curve moves for a unit of the logarithm."""

    def cause(
        self,
        id: str,
        title: str,
        of: str,
        effect: str,
        amounts: Sequence[tuple[str, str, dict[tuple[int, int], float]]],
    ) -> Cause:
        """From what a unit of each amount does to strand and number."""
        directions = np.zeros((len(self.strands) * len(NUMBERS), len(amounts)))
        for column, (_, _, does) in enumerate(amounts):
            for (strand, number), by in does.items():
                directions[strand * len(NUMBERS) + number, column] = by
        return Cause(id, title, of, effect, directions, tuple((name, unit) for name, unit, _ in amounts))
