"""Campaigns with a mechanism hidden in them, of a stated size in sigma.

The size is the norm of the whitened residuals that the expected readings with the mechanism leave once the plain
model has been refitted to them: what no choice of its parameters absorbs. The mechanism is scaled to it; where that
would take it out of its physical range, the noise is scaled if up to eight times more or less of it is enough, and
the mechanism all the same if not.
"""

from __future__ import annotations

import hashlib
import math
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gap_benchmark.absorb import leftover, size_in_sigma
from gap_benchmark.designs import DESIGNS, Course, Design, courses
from gap_benchmark.kinetics import KINETICS
from gap_benchmark.material_law import BY_LAW
from gap_benchmark.noise import NOISES, Noise
from gap_benchmark.rig import RIG
from gap_benchmark.second_laws import SECOND
from gap_benchmark.spring import CHANNELS, SIGMOID, Floats, Spring, shaped
from gap_benchmark.state import Hidden, Mechanism, Readings, Stage, Traits, simulate
from sma_bayes.records.types import Branch, Campaign, Condition, Record

MECHANISMS: Mapping[str, Mechanism] = {m.id: m for m in (*KINETICS, *RIG)}
LAWS: Mapping[str, Mapping[str, Mechanism]] = {
    "first": MECHANISMS,
    "second": {m.id: m for m in SECOND},
    "simcoon": {m.id: m for m in BY_LAW},
}
"""Mechanisms by law and effect. What a law lacks follows the first one."""
OUTSIDE = (
    "detent", "step_in_the_middle", "odd_even_cycles", "fan", "slips", "backlash", "bad_cycle",
)  # fmt: skip
"""Mechanisms that no catalogue of effects has."""
NEUTRAL = ("none", "wrong_calibration")
"""Where nothing is to be named."""
INSIDE = tuple(sorted(set(MECHANISMS) - {*OUTSIDE, *NEUTRAL}))
"""Mechanisms of the catalogue of effects."""

NOISE_FACTOR = 8.0
"""How much more or less noise than usual there may be."""
LIKELY = 400
"""Equally likely values of the noise over which what a digitiser does is averaged."""
PRECISION = 1e-4
"""Relative precision with which the size in sigma is met."""
UNITS = {
    "temperature": "degC", "time": "s", "current": "A", "ambient_temperature": "degC", "cycle": "1", "force": "N",
    "displacement": "m",
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Answer:
    """What was hidden.

    Attributes
    ----------
    effect : str
    size : float
        Of the mechanism, in `unit`; 0 for ``none``.
    unit : str
    traits : mapping of str to float
        Its other properties.
    sigma : float
        Norm of the whitened residuals after the refit, of this mechanism alone.
    in_range : bool
        Whether the size is in its physical range.
    """

    effect: str
    size: float
    unit: str
    traits: Traits
    sigma: float
    in_range: bool


@dataclass(frozen=True, slots=True, eq=False)
class Case:
    """A campaign and the truth about it.

    Attributes
    ----------
    campaign : Campaign
    answers : tuple of Answer
        One for each mechanism that was hidden.
    design, noise : str
    seed : int
    pooled : bool
        Whether the plain model was refitted with parameters common to all conditions.
    noise_factor : float
        Noise over the usual noise of the design.
    noise_sd : mapping of str to float
        Standard deviation of the noise of each outcome, in its unit.
    sigma : float
        As of an answer, of all mechanisms together.
    clean : tuple of Readings
        Readings without noise and digitisers.
    """

    campaign: Campaign
    answers: tuple[Answer, ...]
    design: str
    noise: str
    seed: int
    pooled: bool
    noise_factor: float
    noise_sd: Mapping[str, float]
    sigma: float
    clean: tuple[Readings, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Bench:
    """A campaign that is about to be measured.

    Attributes
    ----------
    courses : tuple of Course
    noise : Noise
    sd : mapping of str to float
        Usual noise of each outcome.
    errors : tuple of mapping
        Noise of unit variance of each condition and outcome.
    pooled : bool
    design, noise_name : str
    seed : int
    curve, law : str
        Kind of the spring's curves, and which law mechanisms follow.
    """

    courses: tuple[Course, ...]
    noise: Noise
    sd: Mapping[str, float]
    errors: tuple[Mapping[str, Floats], ...]
    pooled: bool
    design: str
    noise_name: str
    seed: int
    curve: str = "sigmoid"
    law: str = "first"

    def readings(self, hidden: Sequence[Hidden]) -> tuple[Readings, ...]:
        """Without noise and digitisers."""
        return tuple(simulate(course, _in_order(hidden)) for course in self.courses)

    def measured(
        self, clean: Sequence[Readings], hidden: Sequence[Hidden], factor: float
    ) -> tuple[Readings, ...]:
        """With noise and digitisers."""
        return tuple(
            self._digitised(_with(r, {c: x + factor * self.sd[c] * self.noise.grown(e[c], x)
                                      for c, x in r.channels.items() if c in self.sd}), hidden, factor)
            for r, e in zip(clean, self.errors, strict=True)
        )  # fmt: skip

    def _digitised(self, readings: Readings, hidden: Sequence[Hidden], factor: float) -> Readings:
        """Force as the converter gives it: cut off at its upper end, or in steps."""
        force = readings.channels["force"]
        for h in _in_order(hidden):
            if h.mechanism.stage is Stage.DIGITISER:
                force = DIGITISERS[h.mechanism.id, self._law_of(h)](
                    force, readings.course.spring, h.size, factor * self.sd["force"]
                )
        return _with(readings, {"force": force})

    def _law_of(self, h: Hidden) -> str:
        return (
            "second"
            if self.law == "second" and h.mechanism is LAWS["second"].get(h.mechanism.id)
            else "first"
        )

    def expected(
        self, clean: Sequence[Readings], hidden: Sequence[Hidden], factor: float
    ) -> tuple[tuple[Readings, ...], dict[str, float]]:
        """Mean of the readings over the noise, and standard deviation about it.

        Without digitisers these are the clean ones and the noise. What a digitiser does to the mean depends on the
        noise that carries readings over its steps; the rest of what it does is more noise.
        """
        sd = {c: factor * s for c, s in self.sd.items()}
        if not any(h.mechanism.stage is Stage.DIGITISER for h in hidden):
            return tuple(clean), sd
        drawn = np.sort(np.concatenate([e["force"] for e in self.errors]))
        some = drawn[np.linspace(0, drawn.size - 1, LIKELY).round().astype(int)]
        out, variances = [], []
        for r in clean:
            noisy = r.channels["force"] + sd["force"] * some[:, None]
            read = _with(r, {"force": noisy})
            force = self._digitised(read, hidden, factor).channels["force"]
            out.append(_with(r, {"force": force.mean(axis=0)}))
            variances.append(force.var(axis=0))
        return tuple(out), {**sd, "force": float(np.sqrt(np.mean(variances)))}

    def sigma(self, hidden: Sequence[Hidden], factor: float = 1.0) -> float:
        """Size of what is hidden after the refit; beyond what the shape of the curves leaves, where they are richer."""
        expected, sd = self.expected(self.readings(hidden), hidden, factor)
        left = leftover(expected, self.noise, sd, pooled=self.pooled)
        if self.courses[0].spring.shape == SIGMOID:
            return size_in_sigma(left)
        plain = leftover(self.readings(()), self.noise, sd, pooled=self.pooled)
        return size_in_sigma({c: [a - b for a, b in zip(left[c], plain[c], strict=True)] for c in left})

    def bent(self) -> float:
        """Size of what the shape of the curves leaves by itself, with the usual noise."""
        return size_in_sigma(leftover(self.readings(()), self.noise, self.sd, pooled=self.pooled))


def hide(
    effect: str,
    sigma: float,
    noise: str = "white",
    design: str = "standard",
    seed: int = 0,
    *,
    pooled: bool | None = None,
    law: str = "first",
    curve: str = "sigmoid",
) -> Case:
    """Make a campaign with one mechanism hidden in it; see `hide_several`."""
    return hide_several([effect], sigma, noise, design, seed, pooled=pooled, law=law, curve=curve)


def hide_several(
    effects: Sequence[str],
    sigma: float,
    noise: str = "white",
    design: str = "standard",
    seed: int = 0,
    *,
    pooled: bool | None = None,
    law: str = "first",
    curve: str = "sigmoid",
) -> Case:
    """Make a campaign with several mechanisms hidden in it, each of the stated size when alone.

    Parameters
    ----------
    effects : sequence of str
        Names in `MECHANISMS`, or ``none``.
    sigma : float
        Norm of the whitened residuals of each after the refit. With ``none`` and ``wrong_calibration``, which the refit
        absorbs, what the shape of the curves leaves is so large; at 0, and of sigmoids, the noise is as usual.
    noise : str
        Name in `NOISES`.
    design : str
        Name in `DESIGNS`.
    seed : int
        Of the spring, the room, the properties of mechanisms, and the noise.
    pooled : bool, optional
        Whether the refitted plain model shares its parameters between conditions; as in the design by default.
    law : str
        Name in `LAWS`.
    curve : str
        Name in `CURVES`: the shape of the spring's curves.

    Returns
    -------
    Case

    Raises
    ------
    ValueError
        If a mechanism can't leave that much in this design.
    """
    bench = _bench(design, noise, seed, pooled, law, curve)
    drawn = [_hidden(e, 1.0, seed, law) for e in effects if e != "none"]
    neutral = all(h.mechanism.id in NEUTRAL for h in drawn)
    bent = neutral and curve != "sigmoid" and sigma > 0.0
    factor = bench.bent() / sigma if bent else _noise_factor(bench, drawn, sigma)
    return _case(bench, [_scaled(bench, h, sigma, factor) for h in drawn], factor)


def plant(
    sizes: Mapping[str, float],
    noise: str = "white",
    design: str = "standard",
    seed: int = 0,
    *,
    noise_factor: float = 1.0,
    pooled: bool | None = None,
) -> Case:
    """Make a campaign with mechanisms of given sizes, whatever that is in sigma.

    Parameters
    ----------
    sizes : mapping of str to float
        Size of each mechanism, in its unit.
    noise, design, seed, pooled
        See `hide_several`.
    noise_factor : float
        Noise over the usual noise of the design.
    """
    bench = _bench(design, noise, seed, pooled)
    return _case(bench, [_hidden(e, size, seed) for e, size in sizes.items()], noise_factor)


def noiseless(case: Case) -> Campaign:
    """The campaign of a case as it would be without noise and digitisers."""
    return _campaign(case.clean, DESIGNS[case.design], case.noise_factor)


# --- sizes --------------------------------------------------------------------------------------------


def _hidden(effect: str, size: float, seed: int, law: str = "first") -> Hidden:
    mechanism = LAWS[law].get(effect) or MECHANISMS[effect]
    rng = np.random.default_rng([seed, 2, zlib.crc32(effect.encode())])
    return Hidden(mechanism, size, mechanism.traits(rng))


def _in_order(hidden: Sequence[Hidden]) -> list[Hidden]:
    """Mechanisms as they act one after the other, whatever the order of their names."""
    order = [*MECHANISMS]
    return sorted(hidden, key=lambda h: order.index(h.mechanism.id))


def _noise_factor(bench: Bench, drawn: Sequence[Hidden], sigma: float) -> float:
    """Factor on the noise that brings the first mechanism that needs it into its physical range."""
    for h in drawn:
        m = h.mechanism
        if m.id in NEUTRAL:
            continue
        weak, strong = (bench.sigma([replace(h, size=size)]) for size in (m.low, m.high))
        needed = weak / sigma if weak > sigma else strong / sigma if strong < sigma else 1.0
        if needed != 1.0 and 1.0 / NOISE_FACTOR <= needed <= NOISE_FACTOR:
            return needed
    return 1.0


def _scaled(bench: Bench, h: Hidden, sigma: float, factor: float) -> Hidden:
    m = h.mechanism
    if m.id in NEUTRAL:
        return replace(h, size=m.high)

    def reached(size: float) -> float:
        return bench.sigma([replace(h, size=size)], factor)

    return replace(
        h, size=_solve(reached, sigma, math.sqrt(m.low * m.high), min(m.limit, 10.0 * m.high), m.id)
    )


def _solve(reached: Callable[[float], float], sigma: float, start: float, limit: float, name: str) -> float:
    """Size at which the size in sigma is met, by the secant rule in logarithms within a bracket.

    The search ends too where the size in sigma jumps across what was asked for, because a turn of the reading moves
    from one sample to the next.

    Raises
    ------
    ValueError
        If it is not met at the limit of what makes sense.
    """
    low, high, slope, size = 0.0, limit, 1.0, start
    before: tuple[float, float] | None = None
    for _ in range(40):
        got = reached(size)
        if abs(got / sigma - 1.0) < PRECISION or high - low < 1e-9 * size:
            break
        if size >= limit and got < sigma:
            raise ValueError(
                f"{name} is {got:.2g} sigma at most, not {sigma:g}: "
                "the design lacks what shows it, or the plain model absorbs it"
            )
        low, high = (size, high) if got < sigma else (low, size)
        if before is not None and min(got, before[1]) > 0.0 and size != before[0]:
            slope = float(np.clip(math.log(got / before[1]) / math.log(size / before[0]), 0.3, 5.0))
        before = (size, got)
        guess = size * float(np.clip((sigma / max(got, 1e-12)) ** (1.0 / slope), 1.0 / 30.0, 30.0))
        if not low < guess < high:
            guess = limit if high == limit and guess >= limit else 0.5 * (low + high)
        size = guess
    return size


def _answer(bench: Bench, h: Hidden, factor: float) -> Answer:
    m = h.mechanism
    return Answer(
        m.id, h.size, m.unit, dict(h.traits), bench.sigma([h], factor),
        bool(m.low * (1 - 1e-3) <= h.size <= m.high * (1 + 1e-3)),
    )  # fmt: skip


# --- measuring ----------------------------------------------------------------------------------------


def _bench(
    design: str, noise: str, seed: int, pooled: bool | None, law: str = "first", curve: str = "sigmoid"
) -> Bench:
    plan, kind = DESIGNS[design], NOISES[noise]
    if curve != "sigmoid":
        spring = plan.spring
        plan = replace(plan, spring=lambda rng: shaped(spring(rng), curve, np.random.default_rng([seed, 4])))
    runs = courses(plan, seed)
    rng = np.random.default_rng([seed, 3])
    sd = {c: plan.noise * runs[0].spring.span(c) for c in CHANNELS}
    if plan.sampled:
        sd["temperature"] = plan.temperature_noise
    errors = tuple({c: kind.draw(rng, run.samples.size) for c in sd} for run in runs)
    shared = plan.pooled if pooled is None else pooled
    return Bench(runs, kind, sd, errors, shared, design, noise, seed, curve, law)


def _case(bench: Bench, hidden: Sequence[Hidden], factor: float) -> Case:
    clean = bench.readings(hidden)
    return Case(
        campaign=_campaign(bench.measured(clean, hidden, factor), DESIGNS[bench.design], factor),
        answers=tuple(_answer(bench, h, factor) for h in hidden),
        design=bench.design, noise=bench.noise_name, seed=bench.seed, pooled=bench.pooled, noise_factor=factor,
        noise_sd={c: factor * s for c, s in bench.sd.items()},
        sigma=bench.sigma(hidden, factor), clean=clean,
    )  # fmt: skip


def _with(readings: Readings, channels: Mapping[str, Floats]) -> Readings:
    return replace(readings, channels={**readings.channels, **channels})


def _cut(force: Floats, spring: Spring, size: float, sd: float) -> Floats:
    curve = spring.curves["force", "heating"]
    return np.minimum(force, curve.low + curve.span - size)


def _cut_and_noisy(force: Floats, spring: Spring, size: float, sd: float) -> Floats:
    """The amplifier ends, and what comes after it adds a tenth of the noise: no two readings there are equal."""
    after = np.random.default_rng(force.size).standard_normal(force.shape)
    return _cut(force, spring, size, sd) + 0.1 * sd * after


def _rounded(force: Floats, spring: Spring, size: float, sd: float) -> Floats:
    return size * np.round(force / size)


def _unevenly_cut_off(force: Floats, spring: Spring, size: float, sd: float) -> Floats:
    """Down to the next code, whose widths differ by a sixth."""
    codes = np.floor(force / size).astype(int)
    edge = 0.15 * np.random.default_rng(7).standard_normal(int(np.ptp(codes)) + 3)
    start = edge[codes - codes.min()]
    off = force / size - codes
    return size * (codes - (off < start) + (off - 1.0 >= edge[codes - codes.min() + 1]))


DIGITISERS = {
    ("saturation", "first"): _cut, ("saturation", "second"): _cut_and_noisy,
    ("quantisation", "first"): _rounded, ("quantisation", "second"): _unevenly_cut_off,
}  # fmt: skip
"""Force with noise, the spring, size, and standard deviation of the noise, to what is written down."""


def _campaign(measured: Sequence[Readings], plan: Design, factor: float) -> Campaign:
    digest = hashlib.sha256()
    for r in measured:
        for values in (r.course.time, *r.channels.values()):
            digest.update(np.ascontiguousarray(values).tobytes())
    records = tuple(_record(r, branch, plan, factor) for r in measured for branch in Branch)
    return Campaign("bench rig", "simulated", digest.hexdigest(), records)


def _record(r: Readings, branch: Branch, plan: Design, factor: float) -> Record:
    c, at = r.course, r.course.samples
    own = r.heating if branch is Branch.HEATING else ~r.heating
    inputs = {
        "temperature": r.channels["temperature"], "time": c.time[at], "ambient_temperature": c.ambient[at],
        "cycle": 1.0 + r.sweep // 2, "segment": (r.sweep // 2).astype(float),
    }  # fmt: skip
    if plan.sampled:
        inputs["current"] = c.current[at]
    names = (*inputs, *CHANNELS)
    setting = c.setting
    return Record(
        Condition(setting.id, float(c.current.max()), setting.load, setting.frequency, setting.duty),
        branch,
        {name: values[own] for name, values in inputs.items()},
        {channel: r.channels[channel][own] for channel in CHANNELS},
        np.flatnonzero(own) + 2,
        {name: UNITS[name] for name in names if name in UNITS},
        temperature_sd=factor * plan.temperature_noise,
        source=f"{setting.id}.csv",
    )
