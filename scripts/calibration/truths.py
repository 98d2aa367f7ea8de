"""The truths of the calibration, one function each, and the measurements that are made of them.

Every repeat draws its own spring, sweep and number of samples: rates of 0.2 to 0.45 /K, midpoints of 45 to 60 degC, a
sweep that sees both plateaus, 60, 100 or 200 samples, heating or cooling in turn, and noise of 0.25 or 1.5 % of the
range of the channel in turn.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from calibration import noises
from calibration.curves import (
    Curve,
    Floats,
    hardening,
    logistic,
    mean_of,
    phase_slopes,
    ratio,
    richards,
    span_over,
    two_steps,
)
from calibration.real_residuals import Sweep, moved, sweep, turned
from calibration.simulated_loop import isobaric_cycle
from sma_bayes.records.types import Branch, Campaign, Condition, Record

LEVELS = (0.0025, 0.015)
"""Standard deviations of the noise over the range of the channel."""
SAMPLES = (60, 100, 200)
SWEEPS = (4, 5, 8)
"""Sweeps of a record in which they differ."""
IN_A_SWEEP = 40
POPULATION = 400
"""Sweeps over which the mean curve of all that might come is taken."""
UNITS = {"temperature": "degC", "time": "s", "force": "N", "displacement": "m", "stiffness": "N/m"}
READINGS = 5
"""Fresh sweeps of readings that a predictive band is held against."""


@dataclass(frozen=True, slots=True, eq=False)
class Case:
    """Measurements of a known truth.

    Attributes
    ----------
    campaign : Campaign
        Of one record.
    curves : mapping of str to Curve
        True curve of each measured channel.
    stiffness : Curve or None
        True K where force and displacement were measured.
    again : callable
        Generator -> temperatures (m,) as they would be logged and the readings (m,) of each channel, anew.
    level : float
        Standard deviation of the noise over the range of the channel.
    beyond : bool
        Whether the truth says how curves go on beyond the sweep; of a real sweep nobody knows.
    """

    campaign: Campaign
    curves: Mapping[str, Curve]
    stiffness: Curve | None
    again: Callable[[np.random.Generator], tuple[Floats, dict[str, Floats]]]
    level: float
    beyond: bool = True

    @property
    def record(self) -> Record:
        """The one record."""
        return self.campaign.records[0]


@dataclass(frozen=True, slots=True)
class Design:
    """What a repeat draws before there is a curve.

    Attributes
    ----------
    n : int
    level : float
    branch : Branch
    middle : float
        Temperature [degC] about which the channels transform.
    rate : float
        Of the force [1/K].
    low, high : float
        Ends of the sweep [degC].
    """

    n: int
    level: float
    branch: Branch
    middle: float
    rate: float
    low: float
    high: float

    @staticmethod
    def of(repeat: int, rng: np.random.Generator, reach: tuple[float, float] = (6.0, 10.0)) -> Design:
        """Design of a repeat; `reach` is how far the sweep goes beyond the middle at both ends [1/rate]."""
        rate = float(np.exp(rng.uniform(np.log(0.2), np.log(0.45))))
        middle = float(rng.uniform(45.0, 60.0))
        below, above = (rng.uniform(*reach, 2) / rate).tolist()
        branch = Branch.HEATING if repeat // 2 % 2 == 0 else Branch.COOLING
        return Design(
            SAMPLES[repeat % 3], LEVELS[repeat % 2], branch, middle, rate, middle - below, middle + above
        )


@dataclass(frozen=True, slots=True)
class Instrument:
    """What happens to a true value on its way into the file.

    Attributes
    ----------
    noise : Noise
    temperature_error : float
        Standard deviation of the error of a logged temperature [1/rate of the force], or [K] where it isn't declared.
    declared : bool
        Whether the campaign says so.
    rounded_to : float
        Step of the converter [standard deviations of the noise]; 0 for none.
    """

    noise: noises.Noise = noises.white
    temperature_error: float = 0.0
    declared: bool = True
    rounded_to: float = 0.0


Make = Callable[[int, np.random.Generator, Path], Case]


@dataclass(frozen=True, slots=True)
class Truth:
    """A kind of truth.

    Attributes
    ----------
    title : str
    make : callable
        Number of the repeat, generator and folder of real data -> Case.
    needs : str
        ``""``, ``simcoon`` or ``data``.
    """

    title: str
    make: Make
    needs: str = field(default="")


def pair(design: Design, rng: np.random.Generator, shape: Callable[..., Curve]) -> dict[str, Curve]:
    """Force and displacement of the same shape, not quite at the same place nor of the same rate.

    Parameters
    ----------
    shape : callable
        Of span, rate, midpoint and offset.
    """
    force = shape(2.5 * np.exp(0.3 * rng.standard_normal()), design.rate, design.middle, 0.5)
    displacement = shape(
        0.02 * np.exp(0.3 * rng.standard_normal()),
        design.rate * rng.uniform(0.85, 1.15),
        design.middle + rng.uniform(-0.8, 0.8) / design.rate,
        0.001,
    )
    return {"force": force, "displacement": displacement}


def measured(
    design: Design, curves: Mapping[str, Curve], instrument: Instrument, rng: np.random.Generator, name: str
) -> Case:
    """Measure curves along an even sweep."""
    span = span_over(curves, design.low, design.high)
    error = instrument.temperature_error / (design.rate if instrument.declared else 1.0)
    true = np.linspace(design.low, design.high, design.n)
    if design.branch is Branch.COOLING:
        true = true[::-1]

    def again(rng: np.random.Generator) -> tuple[Floats, dict[str, Floats]]:
        logged = true + error * rng.standard_normal(design.n)
        out = {}
        for channel, curve in curves.items():
            clean = curve.value(true)
            passed = (clean - clean.min()) / np.ptp(clean)
            sd = design.level * span[channel]
            y = clean + sd * instrument.noise(rng, passed)
            out[channel] = noises.rounded(y, instrument.rounded_to * sd) if instrument.rounded_to else y
        return logged, out

    logged, observed = again(rng)
    record = Record(
        Condition("truth"),
        design.branch,
        {"temperature": logged, "time": np.arange(design.n, dtype=float)},
        observed,
        np.arange(design.n) + 2,
        {k: UNITS[k] for k in ("temperature", "time", *observed)},
        temperature_sd=error if instrument.declared else 0.0,
    )
    whole = {"force", "displacement"} <= set(curves)
    stiffness = ratio(curves["force"], curves["displacement"]) if whole else None
    return Case(Campaign(name, name, "", (record,)), curves, stiffness, again, design.level)


def published(instrument: Instrument) -> Make:
    """The published curve, seen through an instrument."""

    def make(repeat: int, rng: np.random.Generator, data: Path) -> Case:
        design = Design.of(repeat, rng)
        return measured(design, pair(design, rng, logistic), instrument, rng, "published curve")

    return make


def stiffness_only(repeat: int, rng: np.random.Generator, data: Path) -> Case:
    """Stiffness alone was measured."""
    design = Design.of(repeat, rng, (3.0, 6.0))
    both = pair(design, rng, logistic)
    k = {"stiffness": ratio(both["force"], both["displacement"])}
    return measured(design, k, Instrument(), rng, "stiffness only")


def shaped(
    shape: Callable[[Design, np.random.Generator], Callable[..., Curve]], instrument: Instrument | None = None
) -> Make:
    """Another curve than the published one, white noise unless an instrument has another."""

    def make(repeat: int, rng: np.random.Generator, data: Path) -> Case:
        design = Design.of(repeat, rng)
        return measured(
            design, pair(design, rng, shape(design, rng)), instrument or Instrument(), rng, "shape"
        )

    return make


def differing_sweeps(repeat: int, rng: np.random.Generator, data: Path) -> Case:
    """Several sweeps of the displacement, each with an offset, stroke, place, width and second step of its own.

    The truth is the mean of all sweeps that might come; readings anew are of other sweeps.
    """
    design = Design.of(repeat, rng)
    span = 0.02 * np.exp(0.3 * rng.standard_normal())
    apart = rng.choice((-1.0, 1.0)) * rng.uniform(4.0, 6.0) / design.rate
    # standard deviations: 1.5 % and 3 % of the span, 0.15/rate, 8 % of the rate, 3 % of the span
    moves = rng.uniform(0.5, 1.5) * np.array([0.015 * span, 0.03, 0.15 / design.rate, 0.08, 0.03])
    temperature = np.linspace(design.low, design.high, IN_A_SWEEP)
    if design.branch is Branch.COOLING:
        temperature = temperature[::-1]

    def drawn(rng: np.random.Generator) -> Curve:
        offset, stroke, place, width, second = moves * rng.standard_normal(5)
        return two_steps(
            span * (1.0 + stroke), design.rate * np.exp(width), design.middle + place, 0.001 + offset,
            0.15 + second, apart, 1.5,
        )  # fmt: skip

    def read(rng: np.random.Generator) -> Floats:
        noise = noises.white(rng, np.zeros(IN_A_SWEEP))
        return np.asarray(drawn(rng).value(temperature) + design.level * span * noise)

    sweeps = SWEEPS[repeat % len(SWEEPS)]
    record = Record(
        Condition("truth"),
        design.branch,
        {
            "temperature": np.tile(temperature, sweeps),
            "time": np.arange(float(sweeps * IN_A_SWEEP)),
            "segment": np.repeat(np.arange(float(sweeps)), IN_A_SWEEP),
        },
        {"displacement": np.concatenate([read(rng) for _ in range(sweeps)])},
        np.arange(sweeps * IN_A_SWEEP) + 2,
        {k: UNITS[k] for k in ("temperature", "time", "displacement")},
    )
    mean = mean_of([drawn(rng) for _ in range(POPULATION)])
    name = "differing sweeps"
    return Case(
        Campaign(name, name, "", (record,)),
        {"displacement": mean},
        None,
        lambda rng: (temperature, {"displacement": read(rng)}),
        design.level,
    )


def _phase_slopes(design: Design, rng: np.random.Generator) -> Callable[..., Curve]:
    """Over the sweep each phase moves by 3 to 10 % of the span, either way."""
    cold, hot = rng.choice((-1.0, 1.0), 2) * rng.uniform(0.03, 0.1, 2) / (design.high - design.low)
    return lambda span, rate, midpoint, offset: phase_slopes(
        span, rate, midpoint, offset, cold * span, hot * span
    )


def _second_step(design: Design, rng: np.random.Generator) -> Callable[..., Curve]:
    """15 % of the span, four to six widths 1/rate above the first or below it, half as fast again."""
    apart = rng.choice((-1.0, 1.0)) * rng.uniform(4.0, 6.0) / design.rate
    return lambda span, rate, midpoint, offset: two_steps(span, rate, midpoint, offset, 0.15, apart, 1.5)


def _richards(design: Design, rng: np.random.Generator) -> Callable[..., Curve]:
    return lambda span, rate, midpoint, offset: richards(span, rate, midpoint, offset, 0.4)


def _hardening(design: Design, rng: np.random.Generator) -> Callable[..., Curve]:
    """From 3.5 widths 1/rate below the middle to as far above, exponents of 0.25 to 0.6."""
    n1, n2 = rng.uniform(0.25, 0.6, 2)
    return lambda span, rate, midpoint, offset: hardening(
        span, midpoint - 3.5 / rate, midpoint + 3.5 / rate, offset, n1, n2
    )


def simulated_loop(repeat: int, rng: np.random.Generator, data: Path) -> Case:
    """Strain of a wire at constant stress by `simcoon`, white noise."""
    design = Design.of(repeat, rng)
    stress, n, width = (
        rng.choice((80.0, 120.0, 160.0)),
        rng.choice((0.2, 0.35, 0.5)),
        rng.choice((15.0, 25.0)),
    )
    curve = isobaric_cycle(float(stress), float(n), float(width))[design.branch.value]
    t = np.linspace(-20.0, 140.0, 1601)
    strain = curve.value(t)
    inner = t[np.abs(strain - 0.5 * (strain.max() + strain.min())) < 0.45 * np.ptp(strain)]
    low, high = float(inner.min() - rng.uniform(15.0, 30.0)), float(inner.max() + rng.uniform(15.0, 30.0))
    design = replace(design, low=low, high=high)
    return measured(design, {"displacement": curve}, Instrument(), rng, "simulated loop")


def real_scatter(repeat: int, rng: np.random.Generator, data: Path) -> Case:
    """Scatter of a real sweep about a smooth curve through it, block by block of random sign; the sweeps in turn."""
    return _put_back(sweep(data, repeat, smooth=True), turned, rng)


def real_residuals(repeat: int, rng: np.random.Generator, data: Path) -> Case:
    """All that two logistics leave of a real sweep, moved along it; the sweeps in turn."""
    return _put_back(sweep(data, repeat, smooth=False), moved, rng)


def _put_back(
    found: Sweep, again: Callable[[Floats, np.random.Generator], Floats], rng: np.random.Generator
) -> Case:
    """Measurements of the curve of a real sweep, with its residuals in another order or sign."""
    (channel,) = found.record.channels
    t = found.record.temperature

    def measured_again(rng: np.random.Generator) -> tuple[Floats, dict[str, Floats]]:
        return t, {channel: found.curve.value(t) + again(found.residual, rng)}

    record = replace(found.record, observed=measured_again(rng)[1])
    spread = float(np.std(found.residual) / np.ptp(found.curve.value(t)))
    return Case(
        Campaign(found.source, found.source, "", (record,)),
        {channel: found.curve},
        None,
        measured_again,
        spread,
        beyond=False,
    )


TRUTHS: dict[str, Truth] = {
    "white": Truth("published curve, white noise", published(Instrument())),
    "stiffness_only": Truth("stiffness only, white noise", stiffness_only),
    "ar1_0.5": Truth("AR(1) noise, φ = 0.5", published(Instrument(noises.autoregressive(0.5)))),
    "ar1_0.9": Truth("AR(1) noise, φ = 0.9", published(Instrument(noises.autoregressive(0.9)))),
    "student_t": Truth("noise of Student's t, 3 degrees", published(Instrument(noises.student(3.0)))),
    "growing": Truth("noise that grows fourfold with the response", published(Instrument(noises.growing()))),
    "temperature_0.3": Truth(
        "temperature error declared, s_T B2 = 0.3", published(Instrument(temperature_error=0.3))
    ),
    "temperature_0.6": Truth(
        "temperature error declared, s_T B2 = 0.6", published(Instrument(temperature_error=0.6))
    ),
    "temperature_1.2": Truth(
        "temperature error declared, s_T B2 = 1.2", published(Instrument(temperature_error=1.2))
    ),
    "temperature_undeclared": Truth(
        "temperature error of 0.5 K, not declared",
        published(Instrument(temperature_error=0.5, declared=False)),
    ),
    "rounded": Truth("rounded to steps of 5 standard deviations", published(Instrument(rounded_to=5.0))),
    "phase_slopes": Truth("slopes of the phases", shaped(_phase_slopes)),
    "second_step": Truth("a second step of 15 %", shaped(_second_step)),
    "second_step_student_t": Truth(
        "a second step of 15 %, noise of Student's t, 3 degrees",
        shaped(_second_step, Instrument(noises.student(3.0))),
    ),
    "richards": Truth("Richards' curve, ν = 0.4", shaped(_richards)),
    "hardening": Truth("smooth hardening (Lagoudas et al. 2012)", shaped(_hardening)),
    "differing_sweeps": Truth("4, 5 or 8 sweeps that differ, second steps of some 15 %", differing_sweeps),
    "simulated_loop": Truth("a loop of `simcoon`'s law", simulated_loop, "simcoon"),
    "real_scatter": Truth("scatter of real sweeps on the smooth curves through them", real_scatter, "data"),
    "real_residuals": Truth(
        "all that two logistics leave of real sweeps, moved along them", real_residuals, "data"
    ),
}
"""Truths by name; each repeat of each has a seed of its own, `seed_of`."""


def seed_of(truth: str, repeat: int) -> np.random.SeedSequence:
    """Seed of a repeat: the same whatever else is run."""
    return np.random.SeedSequence([repeat, *truth.encode()])
