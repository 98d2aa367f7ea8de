"""The same effects by another law: two to each effect of the catalogue, none of which is its formula.

Where `kinetics` and `rig` have one law of a mechanism, here is one that as good a textbook gives: a logarithm for an
exponential, two time constants for one, a hard-to-soft limit, a profile from conduction instead of convection.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from scipy.special import expit, logit

from gap_benchmark.heating import follow, warm
from gap_benchmark.kinetics import SPECIFIC_HEAT, TINY
from gap_benchmark.spring import Floats
from gap_benchmark.state import Mechanism, Stage, State, Traits

HOT = 100.0
"""Temperature [degC] for which the speed of creep is stated."""
ACTIVATION = 2.0e4
"""Activation energy of creep over the gas constant [K]: 166 kJ/mol."""
ZERO = 273.15
LOAD = 1.5
"""Load [N] for which the compliance of contacts is stated."""


# --- the transformation, and the heat it takes part in ----------------------------------------------


def _latent_heat(state: State, size: float, traits: Traits) -> State:
    """Latent heat taken up between a start and a finish, by the law of the cosine, as a jump of calorimetry shows."""
    c = state.course
    lag = c.wire.capacity / c.wire.loss
    goal = (c.ambient + c.power / c.wire.loss).tolist()
    ends = {
        up: (curve.midpoint - traits["width"] / curve.rate, curve.midpoint + traits["width"] / curve.rate)
        for up, curve in (
            (True, c.spring.curves["force", "heating"]),
            (False, c.spring.curves["force", "cooling"]),
        )
    }
    temperature, out = float(c.temperature[0]), [float(c.temperature[0])]
    for u, dt, heating in zip(goal, np.diff(c.time).tolist(), c.heating[:-1].tolist(), strict=False):
        left, pieces = dt, 0
        while left > 1e-12 and pieces < 16:  # so that a step does not pass a start or a finish unseen
            step = left / max(1, 4 - pieces)
            capacity = 1.0 + size / SPECIFIC_HEAT * _released(temperature, *ends[heating])
            temperature += (u - temperature) * -math.expm1(-step / (lag * capacity))
            left, pieces = left - step, pieces + 1
        out.append(temperature)
    return replace(state, course=replace(c, temperature=np.array(out)))


def _released(temperature: float, start: float, finish: float) -> float:
    """``dxi/dT`` of ``xi = (1 - cos(pi (T - start)/(finish - start)))/2`` [1/K]."""
    place = (temperature - start) / (finish - start)
    return 0.5 * math.pi / (finish - start) * math.sin(math.pi * place) if 0.0 < place < 1.0 else 0.0


def _ambient_draught(state: State, size: float, traits: Traits) -> State:
    """A ventilator that a thermostat switches: on while the room is colder than usual, and gently so."""
    c = state.course
    on = expit((c.setting.ambient - c.ambient) / traits["band"])
    loss = c.wire.loss * (1.0 + size * (on - 0.5))
    temperature = warm(c.wire, c.power, c.ambient, c.time, float(c.temperature[0]), held=c.held, loss=loss)
    return replace(state, course=replace(c, temperature=temperature))


def _stress_shift(state: State, size: float, traits: Traits) -> State:
    """Clausius and Clapeyron with a slope of each phase boundary, that of cooling another than that of heating."""
    c = state.course
    slope = size * np.where(c.heating, 1.0, traits["cooling over heating"])
    return replace(state, z=state.z - c.spring.rate(c.heating) * slope * c.setting.load)


def _path_stress_shift(state: State, size: float, traits: Traits) -> State:
    """The transformation temperature rises with the force, ever less so: ``c F0 ln(1 + F/F0)``."""
    c = state.course
    rate, span = c.spring.rate(c.heating), c.spring.span("force")
    z = state.z
    for _ in range(200):  # halved steps of a fixed point; the map falls with z, so that there is one
        shift = size * traits["bend"] * np.log1p(span * expit(z) / traits["bend"])
        new = 0.7 * z + 0.3 * (state.z - rate * shift)
        if float(np.max(np.abs(new - z))) < 1e-11:
            break
        z = new
    return replace(state, z=z)


def _rate_dependence(state: State, size: float, traits: Traits) -> State:
    """Thermally activated: the shift is proportional to the logarithm of the rate over a slow one."""
    c = state.course
    shift = size * np.log1p(np.abs(c.rate) / traits["slow"])
    sign = np.where(c.heating, 1.0, -1.0)
    return replace(state, z=state.z - c.spring.rate(c.heating) * sign * shift)


def _temperature_gradient(state: State, size: float, traits: Traits) -> State:
    """A wire that conducts to clamps at room temperature: ``T - Ta`` falls as ``1 - cosh(m x)/cosh(m)`` says."""
    c = state.course
    place, share = np.polynomial.legendre.leggauss(8)
    place, share = 0.5 * (place + 1.0), 0.5 * share
    profile = (np.cosh(traits["fin"] * place) - 1.0) / (math.cosh(traits["fin"]) - 1.0)
    cold = size / (100.0 - c.setting.ambient) * profile  # share of the excess that is missing
    own = c.temperature - cold[:, None] * (c.temperature - c.ambient)
    return replace(state, z=np.array([c.spring.logit(t, c.heating) for t in own]), weights=share)


def _asymmetric_kinetics(state: State, size: float, traits: Traits) -> State:
    """One end comes more slowly than the other: ``z -> sinh(asinh(z) + e)``, e another one while cooling."""
    skew = size * np.where(state.course.heating, traits["sign"], traits["sign"] * traits["cooling"])
    return replace(state, z=np.sinh(np.arcsinh(state.z) + skew))


def _r_phase(state: State, size: float, traits: Traits) -> State:
    """The R-phase between a start and a finish, by the law of the cosine."""
    c = state.course
    middle = traits["midpoint"] + np.where(c.heating, 0.5, -0.5) * traits["hysteresis"]
    place = np.clip((c.temperature - middle) / traits["width"] + 0.5, 0.0, 1.0)
    x = np.clip(0.5 - 0.5 * np.cos(np.pi * place), TINY, 1.0 - TINY)
    return replace(
        state,
        z=np.concatenate([state.z, logit(x)[None]]),
        weights=np.concatenate([(1.0 - size) * state.weights, [size]]),
    )


def _minor_loop(state: State, size: float, traits: Traits) -> State:
    """A branch starts from the fraction reached, and at first holds it: what is left of the curve to a power."""
    c = state.course
    equilibrium = expit(state.z)
    starts = np.flatnonzero(np.diff(c.heating.astype(int), prepend=-1))
    stops = [*starts[1:].tolist(), c.time.size]
    reached, parts = equilibrium[:, 0], []
    for start, stop in zip(starts.tolist(), stops, strict=True):
        own = equilibrium[:, start:stop]
        first = own[:, :1]
        if c.heating[start]:
            x = 1.0 - (1.0 - reached[:, None]) * ((1.0 - own) / (1.0 - first)) ** traits["power"]
        else:
            x = reached[:, None] * (own / first) ** traits["power"]
        parts.append(x)
        reached = x[:, -1]
    full = logit(np.clip(np.concatenate(parts, axis=1), TINY, 1.0 - TINY))
    remembered = expit(full)
    return replace(state, z=logit(np.clip((1.0 - size) * equilibrium + size * remembered, TINY, 1.0 - TINY)))


# --- the spring and what it pulls on -----------------------------------------------------------------


def _cycles(state: State) -> Floats:
    """Number of the cycle less 1, and how many there are less 1, at least 1."""
    return np.asarray(state.course.cycle - 1.0)


def _training_drift(state: State, size: float, traits: Traits) -> State:
    """Residual strain grows with the logarithm of the cycles."""
    drift = size * np.log1p(_cycles(state) / traits["cycles"])
    return replace(state, displacement=state.displacement + drift)


def _training(state: State, size: float, traits: Traits) -> State:
    """Offset, stroke and transformation settle by a stretched exponential."""
    c = state.course
    share = -np.expm1(-((_cycles(state) / traits["cycles"]) ** traits["stretched"]))
    z = state.z - c.spring.rate(c.heating) * traits["shift"] * size * share
    shifted = c.spring.read("displacement", z[0], c.heating)
    low = c.spring.curves["displacement", "heating"].low
    stroke = 1.0 + traits["stroke per drift"] * size * share
    return replace(state, displacement=low + (shifted - low) * stroke + size * share)


def _stress_stroke(state: State, size: float, traits: Traits) -> State:
    """Martensite is oriented by the load above a critical one only."""
    c = state.course
    low, span = (getattr(c.spring.curves["displacement", "heating"], k) for k in ("low", "span"))
    grown = size * max(c.setting.load - traits["critical"], 0.0)
    return replace(state, displacement=low + span + (state.displacement - low - span) * (1.0 + grown))


def _amplitude_fatigue(state: State, size: float, traits: Traits) -> State:
    """Damage that speeds up: the stroke lost goes with a power of the cycles."""
    low = state.course.spring.curves["displacement", "heating"].low
    left = 1.0 - size * _cycles(state) ** traits["power"]
    return replace(state, displacement=low + (state.displacement - low) * left)


def _hot_creep(state: State, size: float, traits: Traits) -> State:
    """Arrhenius, and ever slower as it goes on: primary creep."""
    c = state.course
    speed = size * np.exp(ACTIVATION * (1.0 / (HOT + ZERO) - 1.0 / (c.temperature + ZERO)))
    done = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(c.time))])
    limit = traits["limit"] * max(float(done[-1]), 1e-300)
    return replace(state, displacement=state.displacement - limit * np.expm1(-done / limit))


def _guide_friction(state: State, size: float, traits: Traits) -> State:
    """Coulomb's friction, smooth near rest and greater there."""
    c = state.course
    speed = np.gradient(state.displacement, c.time)
    slow = traits["rest"] * float(np.max(np.abs(speed)))
    friction = size * np.tanh(speed / slow) * (1.0 + 0.2 * np.exp(-((speed / (5.0 * slow)) ** 2)))
    return replace(state, force=state.force + friction)


def _thermal_expansion(state: State, size: float, traits: Traits) -> State:
    """Of the rod that the displacement is measured with: one metal, a little more the warmer it is."""
    c = state.course
    warmer = c.temperature - c.temperature[0]
    strain = 11e-6 * warmer * (1.0 + traits["growth"] * warmer)
    return replace(state, displacement=state.displacement + size * strain)


def _fixture_compliance(state: State, size: float, traits: Traits) -> State:
    """A rig that bears on contacts: it gives way by ``F**(2/3)``, as Hertz's theory says."""
    give = size * LOAD ** (1.0 / 3.0) * np.maximum(state.force, 0.0) ** (2.0 / 3.0)
    stiffness = 25.0 + 125.0 * state.fraction
    return replace(state, force=state.force - stiffness * give, displacement=state.displacement + give)


def _bias_spring(state: State, size: float, traits: Traits) -> State:
    """A bias spring that stiffens as it is stretched."""
    stretched = state.displacement + traits["preload"]
    return replace(state, force=state.force + size * stretched * (1.0 + traits["progression"] * stretched))


def _dead_load(state: State, size: float, traits: Traits) -> State:
    """The weight hangs on a lever, whose arm shortens as it tilts with the stroke and whose bearing rubs under load."""
    c = state.course
    low, span = (getattr(c.spring.curves["displacement", "heating"], k) for k in ("low", "span"))
    arm = np.cos(traits["tilt"] * (state.displacement - low) / span)
    speed = np.gradient(state.displacement, c.time)
    rubbing = traits["friction"] * np.tanh(speed / (0.01 * float(np.max(np.abs(speed)))))
    return replace(state, force=state.force + size * c.setting.load * (arm + rubbing))


# --- instruments --------------------------------------------------------------------------------------


def _thermocouple_lag(state: State, size: float, traits: Traits) -> State:
    """A sensor with two time constants: its junction, and a part of the heat that goes by way of its mount."""
    c = state.course
    quick, slow = (
        follow(state.reading, c.time, tau, float(state.reading[0]))
        for tau in (size, max(traits["slow"] * size, 1e-6))
    )
    return replace(state, reading=(1.0 - traits["part"]) * quick + traits["part"] * slow)


def _contact_error(state: State, size: float, traits: Traits) -> State:
    """What the junction loses goes with a power of its excess, as natural convection does."""
    c = state.course
    excess = np.maximum(state.reading - c.ambient, 0.0)
    return replace(state, reading=state.reading - size * 50.0 * (excess / 50.0) ** traits["convection"])


def _sensor_drift(state: State, size: float, traits: Traits) -> State:
    """An amplifier that warms up: fast at first, slower later."""
    passed = state.course.time - state.course.time[0]
    settle = traits["records"] * float(passed[-1])
    return replace(state, force=state.force - size * settle * np.expm1(-passed / settle))


def _load_cell_thermal_drift(state: State, size: float, traits: Traits) -> State:
    """The gauges follow the body, which follows the room; none of the spring's heat gets there."""
    c = state.course
    body = follow(c.ambient, c.time, traits["body"], float(c.ambient[0]))
    gauges = follow(body, c.time, traits["gauges"], float(body[0]))
    return replace(state, force=state.force + size * (gauges - c.zero))


def _drive_ripple(state: State, size: float, traits: Traits) -> State:
    """Pick-up of the drive with an overtone, the stronger the more current flows."""
    c = state.course
    angle = 2.0 * np.pi * traits["harmonic"] * c.setting.frequency * c.time + traits["phase"]
    wave = np.sin(angle) + traits["overtone"] * np.sin(2.0 * angle)
    return replace(state, force=state.force + size * wave * (0.7 + 0.3 * c.current / c.current.max()))


def _clock_skew(state: State, size: float, traits: Traits) -> State:
    """A filter before the converter of the force, which delays it."""
    c = state.course
    return replace(state, force=follow(state.force, c.time, size, float(state.force[0])))


def _unchanged(state: State, size: float, traits: Traits) -> State:
    return state


SECOND = (
    Mechanism(
        "latent_heat", Stage.HEAT, _latent_heat, "J/kg", 4e3, 25e3,
        lambda rng: {"width": rng.uniform(2.5, 3.5)},
    ),
    Mechanism(
        "ambient_draught", Stage.HEAT, _ambient_draught, "1", 5e-4, 0.6,
        lambda rng: {"band": rng.uniform(0.3, 0.8)}, 1.6,
    ),
    Mechanism(
        "temperature_gradient", Stage.KINETICS, _temperature_gradient, "K", 2.0, 20.0,
        lambda rng: {"fin": rng.uniform(1.0, 4.0)}, 40.0,
    ),
    Mechanism(
        "stress_shift", Stage.KINETICS, _stress_shift, "K/N", 0.05, 12.0,
        lambda rng: {"cooling over heating": rng.choice([rng.uniform(0.8, 0.92), rng.uniform(1.08, 1.2)])}, 12.0,
    ),
    Mechanism(
        "path_stress_shift", Stage.KINETICS, _path_stress_shift, "K/N", 0.05, 12.0,
        lambda rng: {"bend": rng.uniform(3.0, 8.0)}, 12.0,
    ),
    Mechanism(
        "rate_dependence", Stage.KINETICS, _rate_dependence, "K", 0.05, 3.0,
        lambda rng: {"slow": rng.uniform(0.02, 0.1)}, 10.0,
    ),
    Mechanism(
        "asymmetric_kinetics", Stage.KINETICS, _asymmetric_kinetics, "1", 0.02, 0.8,
        lambda rng: {"sign": rng.choice([-1.0, 1.0]), "cooling": rng.uniform(0.6, 1.4)}, 1.5,
    ),
    Mechanism(
        "r_phase", Stage.KINETICS, _r_phase, "1", 0.03, 0.2,
        lambda rng: {
            "midpoint": rng.uniform(62.0, 68.0), "hysteresis": rng.uniform(1.0, 5.0), "width": rng.uniform(4.0, 10.0)
        },
        0.5,
    ),
    Mechanism(
        "minor_loop", Stage.KINETICS, _minor_loop, "1", 0.02, 1.0,
        lambda rng: {"power": rng.uniform(1.1, 1.3)}, 1.0,
    ),
    Mechanism(
        "training_drift", Stage.MECHANICS, _training_drift, "m", 1e-5, 2e-3,
        lambda rng: {"cycles": rng.uniform(0.5, 3.0)},
    ),
    Mechanism(
        "training", Stage.MECHANICS, _training, "m", 1e-5, 2e-3,
        lambda rng: {
            "cycles": rng.uniform(1.0, 3.0), "stretched": rng.uniform(0.5, 0.8),
            "stroke per drift": rng.uniform(-120.0, -60.0), "shift": rng.uniform(-3000.0, -1500.0),
        },
    ),
    Mechanism(
        "stress_stroke", Stage.MECHANICS, _stress_stroke, "1/N", 1e-3, 1.0,
        lambda rng: {"critical": rng.uniform(1.05, 1.3)},
    ),
    Mechanism(
        "amplitude_fatigue", Stage.MECHANICS, _amplitude_fatigue, "1", 1e-4, 1e-2,
        lambda rng: {"power": rng.uniform(1.2, 1.8)}, 0.5,
    ),
    Mechanism(
        "hot_creep", Stage.MECHANICS, _hot_creep, "m/s at 100 degC", 1e-10, 1e-5,
        lambda rng: {"limit": rng.uniform(1.0, 3.0)},
    ),
    Mechanism(
        "thermal_expansion", Stage.MECHANICS, _thermal_expansion, "m", 0.02, 0.5,
        lambda rng: {"growth": rng.uniform(5e-4, 2e-3)},
    ),
    Mechanism("fixture_compliance", Stage.MECHANICS, _fixture_compliance, "m/N", 2e-5, 1e-3),
    Mechanism(
        "guide_friction", Stage.MECHANICS, _guide_friction, "N", 0.005, 0.05,
        lambda rng: {"rest": rng.uniform(0.003, 0.03)},
    ),
    Mechanism(
        "bias_spring", Stage.MECHANICS, _bias_spring, "N/m", 1.0, 150.0,
        lambda rng: {"preload": 5e-3, "progression": rng.uniform(3.0, 10.0)},
    ),
    Mechanism(
        "dead_load", Stage.MECHANICS, _dead_load, "1", 0.01, 3.0,
        lambda rng: {"tilt": rng.uniform(0.1, 0.3), "friction": rng.uniform(0.01, 0.03)},
    ),
    Mechanism(
        "thermocouple_lag", Stage.INSTRUMENT, _thermocouple_lag, "s", 0.05, 5.0,
        lambda rng: {"slow": rng.uniform(100.0, 300.0), "part": rng.uniform(0.03, 0.1)},
    ),
    Mechanism(
        "contact_error", Stage.INSTRUMENT, _contact_error, "1", 0.01, 0.3,
        lambda rng: {"convection": rng.uniform(1.1, 1.3)}, 0.5,
    ),
    Mechanism(
        "sensor_drift", Stage.INSTRUMENT, _sensor_drift, "N/s", 1e-8, 1e-3,
        lambda rng: {"records": rng.uniform(1.0, 3.0)},
    ),
    Mechanism(
        "load_cell_thermal_drift", Stage.INSTRUMENT, _load_cell_thermal_drift, "N/K", 1e-3, 5e-3,
        lambda rng: {"body": rng.uniform(100.0, 400.0), "gauges": rng.uniform(10.0, 60.0)},
    ),
    Mechanism(
        "drive_ripple", Stage.INSTRUMENT, _drive_ripple, "N", 1e-4, 0.1,
        lambda rng: {
            "harmonic": float(rng.integers(2, 5)), "phase": rng.uniform(0.0, 2.0 * np.pi),
            "overtone": rng.uniform(0.1, 0.4),
        },
    ),
    Mechanism("clock_skew", Stage.INSTRUMENT, _clock_skew, "s", 1e-3, 0.1),
    Mechanism("saturation", Stage.DIGITISER, _unchanged, "N below the top", 1e-3, 0.5),
    Mechanism("quantisation", Stage.DIGITISER, _unchanged, "N", 1.2e-3, 0.05),
)  # fmt: skip
"""In the order in which they are applied within their stage. Digitisers act on readings with noise, see `hide`."""
