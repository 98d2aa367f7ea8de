"""Mechanisms of the spring as a machine element, of the rig and of its instruments."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from scipy.interpolate import PchipInterpolator

from gap_benchmark.heating import follow, scan
from gap_benchmark.spring import Floats
from gap_benchmark.state import Mechanism, Stage, State, Traits

AIR_CONTACT = 2e-3
"""Time constant [s] of a junction to the metal it touches, for what is not lag but a standing error."""
SOAK = 0.03
"""How much of the spring's warmth reaches the load cell."""
EXPANSION = {"martensite": 6.6e-6, "austenite": 11.0e-6}
"""Linear expansion [1/K] (paper, Table 1)."""
STIFFNESS = {"martensite": 25.0, "austenite": 150.0}
"""Of the spring at constant temperature [N/m], the extremes of the paper's Table 9."""
HOT = 100.0
"""Temperature [degC] for which the speed of creep is stated."""


# --- the sensor of temperature ------------------------------------------------------------------------


def _thermocouple_lag(state: State, size: float, traits: Traits) -> State:
    """``tau dTm/dt = T - Tm``."""
    c = state.course
    return replace(state, reading=follow(state.reading, c.time, size, float(state.reading[0])))


def _contact_error(state: State, size: float, traits: Traits) -> State:
    """The junction exchanges heat with metal and air: ``dTm/dt = (T - Tm)/t1 - (Tm - Ta)/t2``, size t1/(t1 + t2)."""
    c = state.course
    goal = (1.0 - size) * state.reading + size * c.ambient
    return replace(state, reading=follow(goal, c.time, AIR_CONTACT * (1.0 - size), float(goal[0])))


# --- the spring and what it pulls on ------------------------------------------------------------------


def _training_drift(state: State, size: float, traits: Traits) -> State:
    """With each cycle residual strain comes a constant share nearer to where it settles."""
    share = -math.expm1(-1.0 / traits["cycles"])
    residual = [0.0]
    for _ in range(int(state.course.cycle.max())):
        residual.append(residual[-1] + share * (size - residual[-1]))
    return replace(
        state, displacement=state.displacement + np.array(residual)[state.course.cycle.astype(int) - 1]
    )


def _training(state: State, size: float, traits: Traits) -> State:
    """Residual strain and stroke change together with the logarithm of the cycles."""
    cycle = state.course.cycle
    share = np.log1p((cycle - 1.0) / traits["cycles"]) / math.log1p((cycle.max() - 1.0) / traits["cycles"])
    low = state.course.spring.curves["displacement", "heating"].low
    stroke = 1.0 + traits["stroke per drift"] * size * share
    return replace(state, displacement=low + (state.displacement - low) * stroke + size * share)


def _stress_stroke(state: State, size: float, traits: Traits) -> State:
    """Cold martensite yields under the load, ever less further as more of it is oriented; what is hot does not."""
    c = state.course
    low, span = (getattr(c.spring.curves["displacement", "heating"], k) for k in ("low", "span"))
    yielded = size * traits["saturation"] * math.tanh(c.setting.load / traits["saturation"])
    return replace(state, displacement=low + span + (state.displacement - low - span) * (1.0 + yielded))


def _amplitude_fatigue(state: State, size: float, traits: Traits) -> State:
    """Each cycle leaves a little less of the stroke."""
    low = state.course.spring.curves["displacement", "heating"].low
    left = [1.0]
    for _ in range(int(state.course.cycle.max())):
        left.append(left[-1] * (1.0 - size))
    share = np.array(left)[state.course.cycle.astype(int) - 1]
    return replace(state, displacement=low + (state.displacement - low) * share)


def _hot_creep(state: State, size: float, traits: Traits) -> State:
    """``dX/dt = c exp((T - Tr)/w)``."""
    c = state.course
    speed = size * np.exp((c.temperature - HOT) / traits["width"])
    return replace(state, displacement=state.displacement + _integral(speed, c.time))


def _guide_friction(state: State, size: float, traits: Traits) -> State:
    """Dahl's friction: ``dFf/dx = (sign(v) Fc - Ff)/x0`` along the guide, at rest at first."""
    dx = np.diff(state.displacement)
    kept = np.exp(-np.abs(dx) / traits["presliding"])
    friction = scan(kept, (1.0 - kept) * size * np.sign(dx), 0.0)
    return replace(state, force=state.force + friction)


def _thermal_expansion(state: State, size: float, traits: Traits) -> State:
    """``X += L alpha(xi) (T - T0)`` with the expansion of the mixture, T0 the first temperature."""
    c = state.course
    m, a = EXPANSION["martensite"], EXPANSION["austenite"]
    strain = (m + (a - m) * state.fraction) * (c.temperature - c.temperature[0])
    return replace(state, displacement=state.displacement + size * strain)


def _fixture_compliance(state: State, size: float, traits: Traits) -> State:
    """Rig in series: it gives way by F/Kf, and by that the spring is let off: ``F = Fs - Ks(xi) F/Kf``."""
    m, a = STIFFNESS["martensite"], STIFFNESS["austenite"]
    stiffness = m + (a - m) * state.fraction
    force = state.force / (1.0 + stiffness * size)
    return replace(state, force=force, displacement=state.displacement + size * force)


def _bias_spring(state: State, size: float, traits: Traits) -> State:
    """The load cell carries the bias spring too."""
    return replace(state, force=state.force + size * (state.displacement + traits["preload"]))


def _dead_load(state: State, size: float, traits: Traits) -> State:
    """The load cell bears what hangs on the spring, or a share of it."""
    return replace(state, force=state.force + size * state.course.setting.load)


def _detent(state: State, size: float, traits: Traits) -> State:
    """A notch in the guide: force needed to pass one place."""
    spring = state.course.spring
    low, span = spring.curves["displacement", "heating"].low, spring.span("displacement")
    away = (state.displacement - low - traits["place"] * span) / (0.03 * span)
    return replace(state, force=state.force + size * np.exp(-0.5 * away**2))


# --- the load cell and its wiring ---------------------------------------------------------------------


def _sensor_drift(state: State, size: float, traits: Traits) -> State:
    """The zero moves in time; it was set at the start of the condition."""
    return replace(state, force=state.force + size * (state.course.time - state.course.time[0]))


def _load_cell_thermal_drift(state: State, size: float, traits: Traits) -> State:
    """The zero follows the body of the cell, which follows the room and a little of the spring's heat, late."""
    c = state.course
    goal = c.ambient + SOAK * (c.temperature - c.ambient)
    body = follow(goal, c.time, traits["lag"], float(c.ambient[0]))
    return replace(state, force=state.force + size * (body - c.zero))


def _drive_ripple(state: State, size: float, traits: Traits) -> State:
    """Pick-up at a harmonic of the drive."""
    c = state.course
    angle = 2.0 * np.pi * traits["harmonic"] * c.setting.frequency * c.time + traits["phase"]
    return replace(state, force=state.force + size * np.sin(angle))


def _clock_skew(state: State, size: float, traits: Traits) -> State:
    """Force is sampled later than the rest."""
    c = state.course
    later = np.minimum(c.time + size, c.time[-1])
    return replace(state, force=PchipInterpolator(c.time, state.force)(later))


def _step_in_the_middle(state: State, size: float, traits: Traits) -> State:
    """The zero of the force jumps half way through."""
    c = state.course
    return replace(state, force=state.force + size * (c.time > 0.5 * (c.time[0] + c.time[-1])))


def _odd_even_cycles(state: State, size: float, traits: Traits) -> State:
    """Force differs between odd and even cycles."""
    return replace(state, force=state.force + 0.5 * size * np.where(state.course.cycle % 2 == 1, 1.0, -1.0))


def _fan(state: State, size: float, traits: Traits) -> State:
    """A fan nearby shakes the displacement, out of step with the drive."""
    c = state.course
    turns = traits["per cycle"] * c.setting.frequency * c.time
    return replace(
        state, displacement=state.displacement + size * np.sin(2.0 * np.pi * turns + traits["phase"])
    )


def _slips(state: State, size: float, traits: Traits) -> State:
    """The grip slips three times, each time by another distance."""
    c = state.course
    passed = (c.time - c.time[0]) / (c.time[-1] - c.time[0])
    moved = sum(traits[f"by {i}"] * (passed > traits[f"at {i}"]) for i in range(3))
    return replace(state, displacement=state.displacement + size * moved)


def _backlash(state: State, size: float, traits: Traits) -> State:
    """Play between the spring and the sensor of its displacement."""
    read, out = float(state.displacement[0]), []
    for x in state.displacement.tolist():
        read = min(max(read, x - size), x + size)
        out.append(read)
    return replace(state, displacement=np.array(out))


def _bad_cycle(state: State, size: float, traits: Traits) -> State:
    """In one cycle of each condition the spring is out of its seat: it pulls less while it is half transformed."""
    x = state.fraction
    off = state.course.cycle == 2.0 + (round(traits["cycle"]) + round(state.course.setting.load * 10)) % 3
    return replace(state, force=state.force - size * 4.0 * x * (1.0 - x) * off)


def _wrong_calibration(state: State, size: float, traits: Traits) -> State:
    """The factor of the load cell is wrong, all the time."""
    return replace(state, force=state.force * (1.0 + size))


def _unchanged(state: State, size: float, traits: Traits) -> State:
    return state


def _integral(values: Floats, time: Floats) -> Floats:
    return np.concatenate([[0.0], np.cumsum(0.5 * (values[1:] + values[:-1]) * np.diff(time))])


RIG = (
    Mechanism(
        "training_drift", Stage.MECHANICS, _training_drift, "m", 1e-5, 2e-3,
        lambda rng: {"cycles": rng.uniform(3.0, 10.0)},
    ),
    Mechanism(
        "training", Stage.MECHANICS, _training, "m", 1e-5, 2e-3,
        lambda rng: {"cycles": rng.uniform(1.0, 3.0), "stroke per drift": rng.uniform(-120.0, -60.0)},
    ),
    Mechanism(
        "stress_stroke", Stage.MECHANICS, _stress_stroke, "1/N", 1e-3, 1.0,
        lambda rng: {"saturation": rng.uniform(3.0, 8.0)},
    ),
    Mechanism("amplitude_fatigue", Stage.MECHANICS, _amplitude_fatigue, "1/cycle", 1e-4, 1e-2, limit=0.5),
    Mechanism(
        "hot_creep", Stage.MECHANICS, _hot_creep, "m/s at 100 degC", 1e-10, 1e-5,
        lambda rng: {"width": rng.uniform(10.0, 20.0)},
    ),
    Mechanism(
        "thermal_expansion", Stage.MECHANICS, _thermal_expansion, "m", 0.02, 0.5,
    ),
    Mechanism("fixture_compliance", Stage.MECHANICS, _fixture_compliance, "m/N", 2e-5, 1e-3),
    Mechanism(
        "guide_friction", Stage.MECHANICS, _guide_friction, "N", 0.005, 0.05,
        lambda rng: {"presliding": rng.uniform(5e-5, 3e-4)},
    ),
    Mechanism(
        "bias_spring", Stage.MECHANICS, _bias_spring, "N/m", 1.0, 150.0, lambda rng: {"preload": 5e-3}
    ),
    Mechanism("dead_load", Stage.MECHANICS, _dead_load, "1", 0.01, 3.0),
    Mechanism(
        "detent", Stage.MECHANICS, _detent, "N", 1e-3, 1.0, lambda rng: {"place": rng.uniform(0.3, 0.7)}
    ),
    Mechanism("thermocouple_lag", Stage.INSTRUMENT, _thermocouple_lag, "s", 0.05, 5.0),
    Mechanism("contact_error", Stage.INSTRUMENT, _contact_error, "1", 0.01, 0.3, limit=0.9),
    Mechanism("sensor_drift", Stage.INSTRUMENT, _sensor_drift, "N/s", 1e-8, 1e-3),
    Mechanism(
        "load_cell_thermal_drift", Stage.INSTRUMENT, _load_cell_thermal_drift, "N/K", 1e-3, 5e-3,
        lambda rng: {"lag": rng.uniform(60.0, 240.0)},
    ),
    Mechanism(
        "drive_ripple", Stage.INSTRUMENT, _drive_ripple, "N", 1e-4, 0.1,
        lambda rng: {"harmonic": float(rng.integers(2, 8)), "phase": rng.uniform(0.0, 2.0 * np.pi)},
    ),
    Mechanism("clock_skew", Stage.INSTRUMENT, _clock_skew, "s", 1e-3, 0.1),
    Mechanism("step_in_the_middle", Stage.INSTRUMENT, _step_in_the_middle, "N", 1e-3, 1.0),
    Mechanism("odd_even_cycles", Stage.INSTRUMENT, _odd_even_cycles, "N", 1e-3, 1.0),
    Mechanism(
        "fan", Stage.INSTRUMENT, _fan, "m", 1e-6, 5e-3,
        lambda rng: {"per cycle": rng.uniform(6.3, 6.7), "phase": rng.uniform(0.0, 2.0 * np.pi)},
    ),
    Mechanism(
        "slips", Stage.INSTRUMENT, _slips, "m", 1e-6, 5e-3,
        lambda rng: {
            **{f"at {i}": rng.uniform(0.1, 0.9) for i in range(3)}, **{f"by {i}": rng.normal() for i in range(3)}
        },
    ),
    Mechanism("backlash", Stage.INSTRUMENT, _backlash, "m", 1e-6, 2e-3),
    Mechanism(
        "bad_cycle", Stage.MECHANICS, _bad_cycle, "N", 1e-3, 1.0, lambda rng: {"cycle": float(rng.integers(3))}
    ),
    Mechanism("wrong_calibration", Stage.INSTRUMENT, _wrong_calibration, "1", 0.03, 0.03),
    Mechanism("saturation", Stage.DIGITISER, _unchanged, "N below the top", 1e-3, 0.5),
    Mechanism("quantisation", Stage.DIGITISER, _unchanged, "N", 1.2e-3, 0.05),
)  # fmt: skip
"""In the order in which they are applied within their stage. Digitisers act on readings with noise, see `hide`."""
