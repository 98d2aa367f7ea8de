"""Mechanisms of the transformation itself, and of the heat that it takes part in."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.special import expit, logit

from gap_benchmark.heating import follow, warm
from gap_benchmark.spring import Floats
from gap_benchmark.state import Mechanism, Stage, State, Traits

TINY = 1e-9
"""Fractions are kept this far from 0 and 1."""
SLOWEST = 0.01
"""Rate [K/s] below which a transformation lags no longer the more the slower it is."""
SPECIFIC_HEAT = 460.0
"""[J/(kg K)]; the wire's heat capacity over its mass."""


def _logit(fraction: Floats) -> Floats:
    z: Floats = logit(np.clip(fraction, TINY, 1.0 - TINY))
    return z


def _latent_heat(state: State, size: float, traits: Traits) -> State:
    """``C dT/dt = I^2 R - hA (T - Ta) - m L dxi/dt``, xi the fraction in equilibrium: Heun's rule on each step."""
    c = state.course
    lag = c.wire.capacity / c.wire.loss
    goal = (c.ambient + c.power / c.wire.loss).tolist()
    curves = {True: c.spring.curves["force", "heating"], False: c.spring.curves["force", "cooling"]}
    temperature, out = float(c.temperature[0]), [float(c.temperature[0])]
    for u, dt, heating in zip(goal, np.diff(c.time).tolist(), c.heating[:-1].tolist(), strict=False):
        rate, middle = curves[heating].rate, curves[heating].midpoint
        first = (u - temperature) / lag / _capacity(temperature, rate, middle, size)
        ahead = temperature + dt * first
        second = (u - ahead) / lag / _capacity(ahead, rate, middle, size)
        plain = (u - temperature) * (1.0 - math.exp(-dt / lag))
        # where there is no latent heat the step is exact; the ratio carries what the latent heat takes
        straight = (
            0.5 * dt * ((u - temperature) / lag + (u - temperature - dt * (u - temperature) / lag) / lag)
        )
        temperature += plain * (0.5 * dt * (first + second) / straight if straight else 1.0)
        out.append(temperature)
    return replace(state, course=replace(c, temperature=np.array(out)))


def _capacity(temperature: float, rate: float, middle: float, latent: float) -> float:
    """Heat capacity with the latent heat in it, over that without."""
    x = 1.0 / (1.0 + math.exp(-min(max(rate * (temperature - middle), -60.0), 60.0)))
    return 1.0 + latent / SPECIFIC_HEAT * rate * x * (1.0 - x)


def _ambient_draught(state: State, size: float, traits: Traits) -> State:
    """A door lets cool air in: the colder the room, the stronger the draught over the spring."""
    c = state.course
    gust = (c.setting.ambient - c.ambient) / traits["swing"]
    temperature = warm(
        c.wire,
        c.power,
        c.ambient,
        c.time,
        float(c.temperature[0]),
        held=c.held,
        loss=c.wire.loss * (1.0 + size * gust),
    )
    return replace(state, course=replace(c, temperature=temperature))


def _stress_shift(state: State, size: float, traits: Traits) -> State:
    """The load raises both transformation temperatures."""
    c = state.course
    return replace(state, z=state.z - c.spring.rate(c.heating) * size * c.setting.load)


def _path_stress_shift(state: State, size: float, traits: Traits) -> State:
    """The force raises the temperature at which the transformation that raises the force goes on.

    ``z + r c (F(z) - F0) = z0`` is solved by Newton's rule; its left side rises with z, so that there is one solution,
    between z0 - r c span and z0.
    """
    c = state.course
    pull = c.spring.rate(c.heating) * size * c.spring.span("force")
    low, high = state.z - pull, state.z
    z = high - pull * expit(high)
    for _ in range(60):
        x = expit(z)
        wrong = z + pull * x - state.z
        low, high = np.where(wrong < 0.0, z, low), np.where(wrong > 0.0, z, high)
        step = z - wrong / (1.0 + pull * x * (1.0 - x))
        z = np.where((step >= low) & (step <= high), step, 0.5 * (low + high))
        if float(np.max(np.abs(wrong))) < 1e-12:
            break
    return replace(state, z=z)


def _rate_dependence(state: State, size: float, traits: Traits) -> State:
    """The fraction relaxes towards equilibrium, ``dxi/dt = (xi_eq - xi)/tau``, the more slowly the slower the sweep.

    With ``tau = k abs(dT/dt)**(m - 1)`` the curve comes late by k abs(dT/dt)**m.
    """
    c = state.course
    tau = size * np.maximum(np.abs(c.rate), SLOWEST) ** (traits["exponent"] - 1.0)
    goal = expit(state.z)
    late = [follow(x, c.time, 0.5 * (tau[1:] + tau[:-1]), float(x[0])) for x in goal]
    return replace(state, z=_logit(np.array(late)))


def _temperature_gradient(state: State, size: float, traits: Traits) -> State:
    """The spring in slices, each with a heat balance of its own; the nearer to a clamp the more heat is lost."""
    c = state.course
    place, share = np.polynomial.legendre.leggauss(6)
    place, share = 0.5 * (place + 1.0), 0.5 * share  # of half the spring, from its middle to its end
    extra = size / (100.0 - c.setting.ambient - size)  # so that the end is `size` below a middle at 100 degC
    parts = []
    for s in place.tolist():
        wire = replace(c.wire, loss=c.wire.loss * (1.0 + extra * s ** traits["power"]))
        own = warm(wire, c.power, c.ambient, c.time, float(c.temperature[0]), held=c.held)
        parts.append(c.spring.logit(own, c.heating))
    return replace(state, z=np.array(parts), weights=share)


def _asymmetric_kinetics(state: State, size: float, traits: Traits) -> State:
    """``dxi/dz = nu xi (1 - xi**(1/nu))`` instead of ``xi (1 - xi)``, integrated by Runge and Kutta's rule."""
    nu = math.exp(size * traits["sign"])
    step, start = 0.05, -40.0
    y = nu * start  # of ln xi, far out in the tail where xi = exp(nu z)
    grid = np.arange(start, 40.0, step)
    table = [y]

    def slope(v: float) -> float:
        return -nu * math.expm1(v / nu)

    for _ in grid[1:]:
        a = slope(y)
        b = slope(y + 0.5 * step * a)
        c = slope(y + 0.5 * step * b)
        y += step / 6.0 * (a + 2.0 * b + 2.0 * c + slope(y + step * c))
        table.append(y)
    ln_x = CubicSpline(grid, table)(np.clip(state.z, -39.0, 39.0))
    ln_x = np.minimum(ln_x, -1e-15)
    return replace(state, z=ln_x - np.log(-np.expm1(ln_x)))


def _r_phase(state: State, size: float, traits: Traits) -> State:
    """A share of the response goes by the R-phase: sharper, with little hysteresis, above the rest on cooling."""
    c = state.course
    middle = traits["midpoint"] + np.where(c.heating, 0.5, -0.5) * traits["hysteresis"]
    other = traits["rate"] * (c.temperature - middle)
    return replace(
        state,
        z=np.concatenate([state.z, other[None]]),
        weights=np.concatenate([(1.0 - size) * state.weights, [size]]),
    )


def _minor_loop(state: State, size: float, traits: Traits) -> State:
    """A branch starts from the fraction that the one before it reached, in a share `size` of the spring."""
    c = state.course
    equilibrium = expit(state.z)
    starts = np.flatnonzero(np.diff(c.heating.astype(int), prepend=-1))
    stops = [*starts[1:].tolist(), c.time.size]
    reached = equilibrium[:, 0]
    parts = []
    for start, stop in zip(starts.tolist(), stops, strict=True):
        own = equilibrium[:, start:stop]
        first = own[:, :1]
        if c.heating[start]:  # what is still martensite transforms
            x = 1.0 - (1.0 - reached[:, None]) * (1.0 - own) / (1.0 - first)
        else:
            x = reached[:, None] * own / first
        parts.append(x)
        reached = x[:, -1]
    x = np.concatenate(parts, axis=1)
    return replace(state, z=_logit((1.0 - size) * equilibrium + size * x))


KINETICS = (
    Mechanism("latent_heat", Stage.HEAT, _latent_heat, "J/kg", 4e3, 25e3),
    Mechanism("ambient_draught", Stage.HEAT, _ambient_draught, "1", 5e-4, 0.6, lambda rng: {"swing": 1.5}, 0.9),
    Mechanism(
        "temperature_gradient", Stage.KINETICS, _temperature_gradient, "K", 2.0, 20.0,
        lambda rng: {"power": rng.uniform(2.0, 4.0)}, 40.0,
    ),
    Mechanism("stress_shift", Stage.KINETICS, _stress_shift, "K/N", 0.05, 12.0, limit=12.0),
    Mechanism("path_stress_shift", Stage.KINETICS, _path_stress_shift, "K/N", 0.05, 12.0, limit=12.0),
    Mechanism(
        "rate_dependence", Stage.KINETICS, _rate_dependence, "K at 1 K/s", 0.1, 3.0,
        lambda rng: {"exponent": rng.uniform(0.3, 1.0)}, 10.0,
    ),
    Mechanism(
        "asymmetric_kinetics", Stage.KINETICS, _asymmetric_kinetics, "ln(nu)", 0.02, math.log(2.0),
        lambda rng: {"sign": rng.choice([-1.0, 1.0])}, 2.0,
    ),
    Mechanism(
        "r_phase", Stage.KINETICS, _r_phase, "1", 0.03, 0.2,
        lambda rng: {
            "midpoint": rng.uniform(62.0, 68.0), "hysteresis": rng.uniform(1.0, 5.0), "rate": rng.uniform(0.5, 1.0)
        },
        0.5,
    ),
    Mechanism("minor_loop", Stage.KINETICS, _minor_loop, "1", 0.02, 1.0, limit=1.0),
)  # fmt: skip
"""In the order in which they are applied; the slices of a gradient come before what shifts or splits them."""
