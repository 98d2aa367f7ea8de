"""A test rig of which everything is known: a heated spring that pulls a conical bias spring, and its instruments.

Nothing here is a sigmoid of temperature. The share m of martensite follows Ivshin and Pence [1]_,

    m = 1 / (1 + exp((T - shift F - T0) / spread)),

with a mean temperature T0 of each branch that the force F raises (Clausius-Clapeyron). The spring is as stiff as its
phases are mixed, and its martensite is longer by a stroke; balance with a bias spring that stiffens as it is stretched
makes force and displacement follow from the share, and the share from them. The heat balance of the heated wire, latent
heat included, gives temperature in time. Thermocouple, load cell and laser add their errors.

The numbers are round ones in the range of actuator springs of 0.5 to 1.5 mm wire; they describe no particular specimen.

References
----------
.. [1] Y. Ivshin and T. J. Pence, A thermomechanical model for a one variant shape memory material, J. Intell. Mater.
   Syst. Struct. 5 (1994) 455-473.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.special import expit

from sma_bayes.arrays import Floats
from sma_bayes.records.types import Branch

GRAVITY: Final = 9.80665
"""Standard acceleration of free fall [m/s2]."""
STEPS: Final = 10
"""Steps of the heat balance between two readings."""
BISECTIONS: Final = 50
"""Halvings of a share of martensite between 0 and 1."""


@dataclass(frozen=True, slots=True)
class Alloy:
    """The spring.

    Attributes
    ----------
    austenite, martensite : float
        Stiffness of the spring in either phase at constant temperature [N/m].
    stroke : float
        Deflection that comes with detwinned martensite [m].
    heating, cooling, spread : float
        Temperatures at which half of the unloaded alloy has turned, and scale of what lies about them [degC].
    shift : float
        By how much these rise with force [K/N].
    """

    austenite: float = 250.0
    martensite: float = 150.0
    stroke: float = 0.030
    heating: float = 57.0
    cooling: float = 44.0
    spread: float = 2.6
    shift: float = 0.7


@dataclass(frozen=True, slots=True)
class Rig:
    """What holds, heats and watches the spring.

    Attributes
    ----------
    bias, bias_growth : float
        Stiffness of the conical bias spring at rest [N/m], and half its increase with displacement [N/m2].
    ambient : float
        [degC].
    capacity, latent, loss : float
        Heat capacity [J/K], latent heat [J] and heat loss [W/K] of the spring.
    resistance : float
        [ohm].
    current : float
        At the top of the ramp [A].
    period, rest, interval : float
        A ramp of the heating power up and down, what follows without heating, and the time between readings [s].
    lag : float
        Time constant of the thermocouple [s].
    calibration_sd, temperature_sd : float
        What all readings of the thermocouple may be off by together, and error of one reading [K].
    force_sd, displacement_sd : float
        Standard deviation of the noise of load cell [N] and laser [m].
    memory : float
        Time in which their noise falls to 1/e of itself [s].
    """

    bias: float = 60.0
    bias_growth: float = 2000.0
    ambient: float = 22.0
    capacity: float = 1.1
    latent: float = 12.0
    loss: float = 0.030
    resistance: float = 0.62
    current: float = 2.0
    period: float = 480.0
    rest: float = 60.0
    interval: float = 4.0
    lag: float = 0.3
    calibration_sd: float = 0.3
    temperature_sd: float = 0.05
    force_sd: float = 0.02
    displacement_sd: float = 2e-4
    memory: float = 8.0


DEFAULT_ALLOY: Final = Alloy()
DEFAULT_RIG: Final = Rig()


@dataclass(frozen=True, slots=True, eq=False)
class Setup:
    """A spring in the rig, under a preload.

    Attributes
    ----------
    preload : float
        Force on the cold spring [N].
    alloy : Alloy
    rig : Rig
    """

    preload: float
    alloy: Alloy = DEFAULT_ALLOY
    rig: Rig = DEFAULT_RIG

    def displacement(self, share: Floats) -> Floats:
        """Displacement x at which spring and bias spring pull alike, at shares of martensite [m].

        It solves ``k (u - x) = preload + bias x + bias_growth x**2``, where k is the stiffness of the spring at that
        share and u its deflection, were it not for x.
        """
        alloy, rig = self.alloy, self.rig
        k = alloy.austenite + share * (alloy.martensite - alloy.austenite)
        u = self.preload / alloy.martensite + alloy.stroke * (1.0 - share)
        slope, pull = k + rig.bias, k * u - self.preload
        return np.asarray(2.0 * pull / (slope + np.sqrt(slope**2 + 4.0 * rig.bias_growth * pull)))

    def force(self, displacement: Floats) -> Floats:
        """Force of the bias spring, and so of the spring [N]."""
        return self.preload + self.rig.bias * displacement + self.rig.bias_growth * displacement**2

    def share(self, temperature: Floats, branch: Branch, left: float = 0.0) -> Floats:
        """Share of martensite at temperatures, shape (n,) [1].

        It decides the force, and the force shifts the temperatures that decide it. It is found by bisection: the share
        that follows from a share falls as that rises.

        Parameters
        ----------
        temperature : ndarray, shape (n,)
            [degC].
        branch : Branch
        left : float
            Of cooling: share that was left at the hottest.
        """
        alloy = self.alloy
        mean, least = (alloy.heating, 0.0) if branch is Branch.HEATING else (alloy.cooling, left)
        low, high = np.zeros(temperature.size), np.ones(temperature.size)
        for _ in range(BISECTIONS):
            middle = 0.5 * (low + high)
            shifted = temperature - alloy.shift * self.force(self.displacement(middle))
            more = least + (1.0 - least) * expit((mean - shifted) / alloy.spread) > middle
            low, high = np.where(more, middle, low), np.where(more, high, middle)
        return low

    def curves(self, temperature: Floats, branch: Branch, left: float = 0.0) -> dict[str, Floats]:
        """Force [N], displacement [m] and stiffness dF/dX along the path [N/m] at temperatures of a branch.

        Along the path the force is that of the bias spring, and so is the slope, ``bias + 2 bias_growth x``.
        """
        x = self.displacement(self.share(temperature, branch, left))
        return {
            "force": self.force(x),
            "displacement": x,
            "stiffness": self.rig.bias + 2.0 * self.rig.bias_growth * x,
        }


@dataclass(frozen=True, slots=True, eq=False)
class HeatingRamp:
    """What happens in one ramp of the heating power, up and down, without any error of an instrument.

    Attributes
    ----------
    setup : Setup
    time, temperature : ndarray, shape (n,)
        [s] and [degC].
    hottest : int
        Which of the readings is the last of heating.
    left : float
        Share of martensite at the hottest [1].
    """

    setup: Setup
    time: Floats
    temperature: Floats
    hottest: int
    left: float

    def channels(self) -> dict[str, Floats]:
        """Force, displacement and stiffness at all times, see `Setup.curves`."""
        up, down = self.temperature[: self.hottest + 1], self.temperature[self.hottest + 1 :]
        heating = self.setup.curves(up, Branch.HEATING)
        cooling = self.setup.curves(down, Branch.COOLING, self.left)
        return {c: np.concatenate([heating[c], cooling[c]]) for c in heating}


def ramp(setup: Setup) -> HeatingRamp:
    """Take the heating power from zero to its top and back.

    The heat balance ``(capacity - latent dm/dT) dT/dt = power - loss (T - ambient)`` is integrated by Euler's steps of
    a tenth of the time between two readings.

    Returns
    -------
    HeatingRamp
        A reading every `Rig.interval`.
    """
    rig = setup.rig
    top = rig.ambient + rig.resistance * rig.current**2 / rig.loss
    grid = np.linspace(rig.ambient - 1.0, top, 1500)
    step = rig.interval / STEPS
    time = np.arange(0.0, rig.period + rig.rest, step)
    power = rig.resistance * rig.current**2 * np.maximum(1.0 - np.abs(2.0 * time / rig.period - 1.0), 0.0)

    def capacity(share: Floats) -> Floats:
        return rig.capacity - rig.latent * np.gradient(share, grid)

    def next_temperature(now: float, heated: float, capacities: Floats) -> float:
        return now + step * (heated - rig.loss * (now - rig.ambient)) / float(
            np.interp(now, grid, capacities)
        )

    course = [rig.ambient]
    capacities = capacity(setup.share(grid, Branch.HEATING))
    while (after := next_temperature(course[-1], power[len(course) - 1], capacities)) >= course[-1]:
        course.append(after)
    hottest = len(course) - 1
    left = float(setup.share(np.array(course[-1:]), Branch.HEATING)[0])
    capacities = capacity(setup.share(grid, Branch.COOLING, left))
    while len(course) < time.size:
        course.append(next_temperature(course[-1], power[len(course) - 1], capacities))
    return HeatingRamp(setup, time[::STEPS], np.array(course[::STEPS]), hottest // STEPS, left)


@dataclass(frozen=True, slots=True, eq=False)
class LoggedRamp:
    """What the instruments make of a course, as a logger writes it down.

    Attributes
    ----------
    course : HeatingRamp
    temperature, force, displacement : ndarray, shape (n,)
        [degC], [N] and [m], rounded to 0.01 degC, 1 mN and 0.01 mm.
    offset : float
        What the thermocouple reads too much, always [K].
    """

    course: HeatingRamp
    temperature: Floats
    force: Floats
    displacement: Floats
    offset: float


def logged(course: HeatingRamp, rng: np.random.Generator) -> LoggedRamp:
    """Read the instruments.

    The thermocouple follows with its lag, is off by what its calibration left, and each reading by something of its
    own. Load cell and laser have Gaussian noise with a memory, AR(1).
    """
    from scipy.signal import lfilter  # takes long to import, and reports of measurements know this room, too

    rig, n = course.setup.rig, course.time.size
    keep = float(np.exp(-rig.interval / rig.lag))
    start = [keep * course.temperature[0]]
    lagging = lfilter([1.0 - keep], [1.0, -keep], course.temperature, zi=start)[0]
    offset = rig.calibration_sd * float(rng.standard_normal())
    rho = float(np.exp(-rig.interval / rig.memory))

    def noise(sd: float) -> Floats:
        first = [rho * float(rng.standard_normal())]
        shocks = np.sqrt(1.0 - rho**2) * rng.standard_normal(n)
        return np.asarray(sd * lfilter([1.0], [1.0, -rho], shocks, zi=first)[0])

    true = course.channels()
    return LoggedRamp(
        course,
        np.round(lagging + offset + rig.temperature_sd * rng.standard_normal(n), 2),
        np.round(true["force"] + noise(rig.force_sd), 3),
        np.round(true["displacement"] + noise(rig.displacement_sd), 5),
        offset,
    )
