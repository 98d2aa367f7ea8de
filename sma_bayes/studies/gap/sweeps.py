"""Every sweep as a common shape with four numbers: offset, stroke, shift in temperature, width.

The shape-invariant model: a sweep of force or displacement reads

    y(T) = cold + a + g (f(m + (T - m - d)/w) - cold)

with the curve f of its branch as it was fitted to all sweeps, its cold phase, and its midpoint m. The four numbers of
each sweep (a, ln g, d, ln w) are found by least squares, apart from the noise of the study: noise with a long memory
hardly looks at levels. They are what laws of the cycle act on, and what tells records apart that should be alike.

References
----------
W. H. Beath, Stat. Med. 26 (2007) 2547 and T. J. Cole et al., Int. J. Epidemiol. 39 (2010) 1558: the shape-invariant
model with random effects. G. K. Smyth, Stat. Appl. Genet. Mol. Biol. 3 (2004) 3: the moderated t statistic.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import permutations
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import stats
from scipy.optimize import least_squares

from sma_bayes.arrays import Floats
from sma_bayes.effects.transformation import SLOPED, curves
from sma_bayes.effects.types import Inputs, Response
from sma_bayes.records.history import History
from sma_bayes.studies.gap.fitting import FittedHypothesis
from sma_bayes.studies.gap.schema import StatedLaw, StatedSuspect
from sma_bayes.studies.gap.study import heat_balance

NUMBERS: Final = ("offset", "stroke", "shift", "width")
LEAST_SAMPLES: Final = 8
"""Fewest samples of a sweep that gets numbers of its own."""
MAX_SWEEPS: Final = 400
"""Greatest number of sweeps that are looked at one by one."""
MAX_SAMPLES: Final = 200
"""Samples of a sweep that are used, evenly spread; four numbers need no more."""
LEAST_CYCLES: Final = 5
"""Fewest cycles whose exchange tells chance: of 120 orders one is the one that was measured."""
MAX_EXCHANGES: Final = 2000
"""Orders that are tried where there are more."""
N0_GRID: Final = (0.3, 1.0, 2.0, 3.0, 5.0, 8.0, 13.0, 20.0, 50.0)
"""Cycles N0 that are tried in either law."""
LEAST_NOISE: Final = 0.02
"""Least scatter about an affine curve that is reckoned with [spans]."""
PRIOR_SD: Final = (0.5, 0.5, 20.0, 0.5)
"""How far numbers may go: offset in spans, ln stroke, shift [K], ln width."""
USUAL_SCATTER: Final = {"stroke": 0.05, "shift": 1.0, "width": 0.1, "gain": 0.1, "loss": 0.2}
"""How well one specimen in one rig usually repeats: a shift in kelvins, the others as logarithms. An offset is that of
the zero, which is set anew for every run."""
USUAL_SCATTER_DF: Final = 4.0
"""Degrees of freedom that this is worth beside what the records themselves show."""
LEAST_CONDITIONS: Final = 3
"""Fewest conditions of which one can be unlike the others."""
SUSPECT_P: Final = 0.05
"""Probability, over all numbers and conditions of a group, up to which a record counts as unlike the others."""


Four = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class SweepNumbers:
    """A sweep and its numbers.

    Attributes
    ----------
    condition, branch, channel : str
    cycle : float
    values : tuple of float
        Offset [unit of the channel], stroke and width over those of the common curve, shift [K].
    sds : tuple of float
        Standard deviations: of the offset [unit], of ln stroke, of the shift [K], of ln width.
    """

    condition: str
    branch: str
    channel: str
    cycle: float
    values: Four
    sds: Four


def sweep_numbers(fitted: FittedHypothesis, *, reference: int | None = None) -> list[SweepNumbers]:
    """Numbers of all sweeps of displacement, or of force where there is none, about the curve of their condition.

    Parameters
    ----------
    fitted : FittedHypothesis
        Without effects.
    reference : int, optional
        History whose curve serves all.

    Returns
    -------
    list of SweepNumbers
        Empty where neither was observed, or there are more sweeps than `MAX_SWEEPS`.
    """
    hypothesis = fitted.hypothesis
    count = sum(np.unique(h.inputs["segment"]).size for h in hypothesis.histories)
    channel = next((c for c in ("displacement", "force") if c in hypothesis.channels), None)
    if channel is None or count > MAX_SWEEPS:
        return []
    out = []
    for i, h in enumerate(hypothesis.histories):
        theta = fitted.theta[hypothesis.layout[i if reference is None else reference]]
        for on in _sweeps(h):
            inputs = {k: v[on] for k, v in h.inputs.items()}
            if hypothesis.simulation.sloped:
                inputs[SLOPED] = np.ones(1)
            values, sds = _affine(
                partial(hypothesis.simulation.predict, theta), inputs, h.observed[channel][on], channel
            )
            branch = "heating" if inputs["branch"][0] > 0.0 else "cooling"
            cycle = float(np.median(inputs["cycle"]))
            out.append(SweepNumbers(h.condition.id, branch, channel, cycle, values, sds))
    return out


def _sweeps(history: History) -> Iterator[NDArray[np.intp]]:
    """Places of the samples of each sweep."""
    for segment in np.unique(history.inputs["segment"]):
        on = np.flatnonzero(history.inputs["segment"] == segment)
        if on.size >= LEAST_SAMPLES:
            yield on[:: -(-on.size // MAX_SAMPLES)]


def _affine(response: Response, inputs: Inputs, y: Floats, channel: str) -> tuple[Four, Four]:
    """Offset, stroke, shift and width of a sweep by least squares, held back as `PRIOR_SD` says, with their sds."""
    temperature = inputs["temperature"]
    plain = curves(response, inputs)[1][channel]
    span = float(np.max(np.abs(plain.span))) or 1.0
    middle, width_of = float(temperature[np.argmin(np.abs(plain.share - 0.5))]), np.array(PRIOR_SD)

    def left(p: Floats) -> Floats:
        offset, stroke, shift, width = p * width_of
        there = middle + (temperature - middle - shift) / np.exp(width)
        curve = response({**inputs, "temperature": there})[channel]
        read = plain.cold + offset * span + np.exp(stroke) * (curve - plain.cold)
        return np.concatenate([(y - read) / (LEAST_NOISE * span), p])

    found = least_squares(left, np.zeros(4), method="lm", max_nfev=200)
    p = found.x * width_of
    more = max(float(np.sqrt(np.mean(found.fun[: y.size] ** 2))), 1.0)
    jacobian = np.asarray(found.jac, dtype=float)
    sd = more * width_of * np.sqrt(np.diag(np.linalg.inv(jacobian.T @ jacobian)))
    values = (float(p[0] * span), float(np.exp(p[1])), float(p[2]), float(np.exp(p[3])))
    return values, (float(sd[0] * span), float(sd[1]), float(sd[2]), float(sd[3]))


def cycle_law(sweeps: Sequence[SweepNumbers], rng: np.random.Generator) -> StatedLaw:
    """Which law of the cycle the numbers follow, and whether their order is chance.

    All numbers of both branches share form and N0, each with a size of its own. Chance is told by exchanging whole
    cycles within each condition.

    Parameters
    ----------
    sweeps : sequence of SweepNumbers
    rng : numpy.random.Generator
    """
    tables = _tables(sweeps)
    most = max((len(cycles) for cycles, _ in tables), default=0)
    if most < 2:
        return _no_law("not testable: one sweep of each branch")
    if most < 3:
        return _no_law(f"not testable: {most} cycles")
    (form, pace), best, other = _best_law(tables)
    values = sum(v.size for _, v in tables)
    law = StatedLaw(
        form=form,
        cycles=pace,
        share=1.0 - best,
        ln_ratio=0.5 * values * float(np.log(max(other, 1e-12) / max(best, 1e-12))),
        p_value=None,
        untestable="",
    )
    enough = [t for t in tables if len(t[0]) >= LEAST_CYCLES]
    if not enough:
        why = f"{most} cycles; at least {LEAST_CYCLES} are needed to tell the order from chance"
        return law.model_copy(update={"untestable": why})
    measured = _best_law(enough)[1]
    as_well = [_best_law(t)[1] <= measured * (1.0 + 1e-9) for t in _exchanged(enough, rng)]
    p = (1.0 + sum(as_well)) / (1.0 + len(as_well))
    return law.model_copy(update={"p_value": p})


def _no_law(why: str) -> StatedLaw:
    return StatedLaw(form="", cycles=None, share=0.0, ln_ratio=0.0, p_value=None, untestable=why)


Table = tuple[Floats, Floats]
"""Cycles (c,) of a condition, and the numbers of their sweeps (c, k), of unit spread about their means."""


def _tables(sweeps: Sequence[SweepNumbers]) -> list[Table]:
    out = []
    for condition in dict.fromkeys(s.condition for s in sweeps):
        own = [s for s in sweeps if s.condition == condition]
        branches = sorted({s.branch for s in own})
        found: dict[float, dict[str, SweepNumbers]] = {}
        for s in own:
            found.setdefault(s.cycle, {}).setdefault(s.branch, s)
        cycles = sorted(c for c, of in found.items() if set(of) == set(branches))
        if not cycles:
            continue
        span = max(abs(s.values[0]) for s in own) or 1.0
        rows = [[x for b in branches for x in _plain_numbers(found[c][b].values, span)] for c in cycles]
        values = np.array(rows)
        values = values - values.mean(axis=0)
        spread = np.sqrt(np.mean(values**2, axis=0))
        kept = spread > 1e-9
        out.append((np.array(cycles), values[:, kept] / spread[kept]))
    return out


def _plain_numbers(values: Four, span: float) -> Four:
    """Offset over a span, and logarithms of the factors."""
    offset, stroke, shift, width = values
    return offset / span, float(np.log(stroke)), shift, float(np.log(width))


def _best_law(tables: Sequence[Table]) -> tuple[tuple[str, float], float, float]:
    """Form and N0 that leave least, the share that they leave, and that which the other form leaves."""
    left = {
        (form, pace): _share_left(tables, form, pace)
        for form in ("exponential", "logarithmic")
        for pace in N0_GRID
    }
    best = min(left, key=lambda k: left[k])
    return best, left[best], min(v for k, v in left.items() if k[0] != best[0])


def _share_left(tables: Sequence[Table], form: str, pace: float) -> float:
    rest = whole = 0.0
    for cycles, values in tables:
        n = (cycles - 1.0) / pace
        x = -np.expm1(-n) if form == "exponential" else np.log1p(n)
        x = x - x.mean()
        size = float(x @ x)
        whole += float(np.sum(values**2))
        rest += float(np.sum(values**2) - (np.sum((x @ values) ** 2) / size if size > 0.0 else 0.0))
    return rest / whole if whole > 0.0 else 1.0


def _exchanged(tables: Sequence[Table], rng: np.random.Generator) -> Iterator[list[Table]]:
    """The same numbers with whole cycles in other orders: all of them where they are few."""
    if len(tables) == 1 and len(tables[0][0]) <= LEAST_CYCLES + 1:
        cycles, values = tables[0]
        for order in permutations(range(len(cycles))):
            if order != tuple(range(len(cycles))):
                yield [(cycles, values[list(order)])]
        return
    for _ in range(MAX_EXCHANGES):
        yield [(cycles, rng.permutation(values)) for cycles, values in tables]


def suspects(fitted: FittedHypothesis) -> list[StatedSuspect]:
    """Conditions that are unlike the others of the same settings, or answer the recorded current unlike all others.

    Parameters
    ----------
    fitted : FittedHypothesis
        Without effects.
    """
    histories = fitted.hypothesis.histories
    found = []
    if all("temperature" in h.observed for h in histories):
        balances = {h.condition.id: heat_balance([h]) for h in histories}
        units = {"gain": "K/(s A^2)", "loss": "1/s"}
        found += _unlike({c: {q: (b[q], 0.0) for q in units} for c, b in balances.items()}, units)
    for group in _alike(histories):
        found += _unlike(*_means(fitted, group))
    return sorted(found, key=lambda s: s.p_value)


def _alike(histories: Sequence[History]) -> list[list[int]]:
    """Conditions of the same settings, where there are `LEAST_CONDITIONS`."""
    groups: dict[tuple[object, ...], list[int]] = {}
    for i, h in enumerate(histories):
        c = h.condition
        groups.setdefault((c.load, c.current, c.frequency, c.duty_cycle), []).append(i)
    return [g for g in groups.values() if len(g) >= LEAST_CONDITIONS]


Quantities = Mapping[str, Mapping[str, tuple[float, float]]]
"""For each condition its quantities: value, and standard deviation of what is compared."""


def _means(fitted: FittedHypothesis, group: Sequence[int]) -> tuple[Quantities, dict[str, str]]:
    """Means of the numbers of each condition's sweeps but for offsets, about the curve of the first, and units."""
    names = [fitted.hypothesis.histories[i].condition.id for i in group]
    found: dict[str, dict[str, list[tuple[float, float]]]] = {name: {} for name in names}
    units: dict[str, str] = {}
    for s in sweep_numbers(fitted, reference=group[0]):
        if s.condition not in found:
            continue
        for name, value, sd in zip(NUMBERS[1:], s.values[1:], s.sds[1:], strict=True):
            quantity = f"{name} of {s.channel} while {s.branch}"
            found[s.condition].setdefault(quantity, []).append((value, sd))
            units[quantity] = "K" if name == "shift" else "1"
    shared = set.intersection(*(set(of) for of in found.values()))
    means = {
        c: {
            q: (float(np.mean([v for v, _ in of[q]])), float(np.mean([sd for _, sd in of[q]])))
            for q in sorted(shared)
        }
        for c, of in found.items()
    }
    return means, units


def _unlike(values: Quantities, units: Mapping[str, str]) -> list[StatedSuspect]:
    """Conditions whose quantity lies apart from the others' by a moderated t statistic."""
    if len(values) < LEAST_CONDITIONS:
        return []
    found = []
    names = list(next(iter(values.values())))
    for name in names:
        kind = name.partition(" ")[0]
        logs = kind in ("stroke", "width", "gain", "loss")
        x = {c: float(np.log(max(v[name][0], 1e-12))) if logs else v[name][0] for c, v in values.items()}
        for condition, value in x.items():
            others = np.array([v for c, v in x.items() if c != condition])
            dof = USUAL_SCATTER_DF + others.size - 1
            own = values[condition][name][1]
            spread = (
                USUAL_SCATTER_DF * USUAL_SCATTER[kind] ** 2 + np.sum((others - others.mean()) ** 2)
            ) / dof
            t = abs(value - others.mean()) / np.sqrt(spread * (1.0 + 1.0 / others.size) + own**2)
            p = float(min(2.0 * stats.t.sf(t, dof) * len(names) * len(values), 1.0))
            if p <= SUSPECT_P:
                mean = float(np.exp(others.mean()) if logs else others.mean())
                found.append(
                    StatedSuspect(
                        condition=condition,
                        quantity=name,
                        value=values[condition][name][0],
                        others=mean,
                        unit=units[name],
                        p_value=p,
                    )
                )
    return found
