"""Fixtures shared by all tests."""

from __future__ import annotations

import importlib.util
import json
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from threadpoolctl import threadpool_limits

import sma_bayes
from sma_bayes.records.types import Branch, Campaign, Condition, Record
from sma_bayes.response.modified_sigmoid import ModifiedSigmoid

ROOT = Path(__file__).resolve().parents[1]

UNITS = {
    "temperature": "degC", "time": "s", "force": "N", "displacement": "m", "stiffness": "N/m"
}  # fmt: skip
SPRING = {
    "A1": 0.02, "A2": 0.30, "A3": 48.0, "A4": 0.001, "B1": 2.5, "B2": 0.35, "B3": 52.0, "B4": 0.5
}  # fmt: skip
"""A plausible spring, in canonical units."""


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Real measurements by other people, kept beside the checkout, never inside it."""
    folder = ROOT.parent / "shared" / "data"
    if not folder.is_dir():
        pytest.skip("real measurements are not at ../shared/data beside the checkout")
    return folder


SCHEMAS = ROOT / "docs" / "reference" / "schemas"


@pytest.fixture(scope="session")
def published() -> Callable[[str], Any]:
    """Validator of another library with the published JSON Schema of a document, by its name.

    Readers take keys of later versions; what this version writes must have no key that is not declared.
    """
    from jsonschema import Draft202012Validator

    def validator(name: str) -> Any:
        schema = json.loads((SCHEMAS / f"{name}.schema.json").read_text(encoding="utf-8"))
        for part in (schema, *schema.get("$defs", {}).values()):
            part["additionalProperties"] = False
        return Draft202012Validator(schema)

    return validator


@pytest.fixture(scope="session")
def declared(published: Callable[[str], Any]) -> Callable[[Any], None]:
    """Check a document by the published schema that it names."""
    names = [path.name.removesuffix(".schema.json") for path in sorted(SCHEMAS.iterdir())]
    validators = {v.schema["properties"]["schema"]["const"]: v for v in map(published, names)}

    def check(document: Any) -> None:
        assert document.get("schema") in validators, f"{document.get('schema')!r} is declared by no verb"
        validators[document["schema"]].validate(document)

    return check


@pytest.fixture(scope="session", autouse=True)
def _one_thread() -> Iterator[None]:
    """Linear algebra on one thread, as in a fit: matrices are small, and threads in each other's way cost 10 times."""
    with threadpool_limits(limits=1):
        yield


@pytest.fixture(scope="session", autouse=True)
def _heed_signals() -> None:
    """Let programs that tests start heed signals, also where the tests themselves were started to ignore them."""
    for name in ("SIGINT", "SIGTERM", "SIGHUP"):
        number = getattr(signal, name, None)
        if number is not None and signal.getsignal(number) is signal.SIG_IGN:
            signal.signal(number, signal.SIG_DFL)


@pytest.fixture(scope="session")
def arviz_psens() -> Callable[..., Any]:
    """Sensitivity of draws (chain, draw) by name to the power of a log density (chain, draw), by arviz itself."""
    from sma_bayes.arviz_bridge import arviz

    def psens(draws: dict[str, Any], log_density: Any) -> Any:
        az = arviz()
        density = {"y": np.asarray(log_density)[..., None]}
        if hasattr(az, "psens"):  # 0.23
            return az.psens(az.from_dict(posterior=draws, log_likelihood=density), component="likelihood")
        return az.psense(az.from_dict({"posterior": draws, "log_likelihood": density}), group="likelihood")

    return psens


def _generator(name: str) -> ModuleType:
    """A module beside this file, known to none of the tests' packages."""
    spec = importlib.util.spec_from_file_location(name, ROOT / "tests" / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # dataclasses look themselves up there
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="session")
def training_spring() -> ModuleType:
    """Generator of the cycles of a spring that trains, which shares nothing with the package but the record."""
    return _generator("training_spring")


@pytest.fixture(scope="session")
def watched_spring() -> ModuleType:
    """Generator of the cycles of a spring, quiet or with a fault, which shares nothing with the package."""
    return _generator("watched_spring")


@pytest.fixture(scope="session")
def make_record() -> Callable[..., Record]:
    """Build a record drawn from the modified sigmoid with AR(1) noise."""
    return _draw_record


def _draw_record(
    channels: Sequence[str] = ("force", "displacement"),
    *,
    n: int = 100,
    seed: int = 0,
    noise: float = 0.01,
    memory: float = 0.0,
    temperature_sd: float = 0.0,
    segments: int = 1,
    condition: str = "c",
    branch: Branch = Branch.HEATING,
    span: tuple[float, float] = (30.0, 70.0),
    **theta: float,
) -> Record:
    """Record with noise of `noise` times each channel's span, of lag-1 correlation `memory`."""
    rng = np.random.default_rng(seed)
    model = ModifiedSigmoid()
    inputs = {
        "temperature": np.linspace(*span, n),
        "time": np.cumsum(rng.uniform(0.5, 1.5, n)),
        "segment": np.sort(np.arange(n) % segments).astype(float),
    }
    value = np.array([(SPRING | theta)[name] for name in model.parameter_names])
    sensed = inputs | {"temperature": inputs["temperature"] + temperature_sd * rng.standard_normal(n)}
    clean = model.predict(value, sensed)
    observed = {}
    for channel in channels:
        e = rng.standard_normal(n)
        for i in range(1, n):
            e[i] = memory * e[i - 1] + np.sqrt(1.0 - memory**2) * e[i]
        observed[channel] = clean[channel] + noise * np.ptp(clean[channel]) * e
    units = {name: UNITS[name] for name in ("temperature", "time", *channels)}
    return Record(
        Condition(condition), branch, inputs, observed, np.arange(n) + 2, units, temperature_sd=temperature_sd
    )


@dataclass(frozen=True)
class HeatedWire:
    """A wire that a current heats, integrated by scipy; it shares nothing with the package.

    Inside the loop the share of austenite follows the Duhem equation of Ivshin and Pence (1994).
    """

    gain: float = 7.0
    loss: float = 0.1
    room: float = 22.0
    latent: float = 12.0
    resistance: float = 0.0
    width: float = 4.0
    middle: tuple[float, float] = (62.0, 50.0)

    def share(self, temperature: float, heating: bool) -> float:
        """Share of austenite on the outer loop."""
        return float(0.5 * (1.0 + np.tanh((temperature - self.middle[not heating]) / self.width)))

    def grows(self, temperature: float, heating: bool) -> float:
        """Its derivative."""
        there = (temperature - self.middle[not heating]) / self.width
        return float(0.5 / self.width / np.cosh(there) ** 2)

    def course(
        self, edges: Sequence[float], currents: Sequence[float], told: Any, *, heating: bool = True
    ) -> tuple[Any, Any]:
        """Temperature and share of austenite at instants; a current holds from each edge to the next."""
        at = np.array([self.room, self.share(self.room, heating)])
        out = np.full((2, len(told)), np.nan)
        for begin, end, current in zip(edges[:-1], edges[1:], currents, strict=True):
            power = self.gain * current**2
            if power - self.loss * (at[0] - self.room) != 0.0:
                heating = bool(power > self.loss * (at[0] - self.room))

            def rate(_: float, y: Any, power: float = power, heating: bool = heating) -> list[float]:
                t, s = y
                whole = self.share(t, heating)
                left = (1.0 - s) / max(1.0 - whole, 1e-12) if heating else s / max(whole, 1e-12)
                grown = left * self.grows(t, heating)
                net = power * (1.0 + self.resistance * (s - 0.5)) - self.loss * (t - self.room)
                return [net / (1.0 + self.latent * grown), grown * net / (1.0 + self.latent * grown)]

            found = solve_ivp(rate, (begin, end), at, rtol=1e-9, atol=1e-9, max_step=0.5, dense_output=True)
            here = (told >= begin) & (told <= end)
            out[:, here] = found.sol(told[here])
            at = found.y[:, -1]
        return out[0], out[1]

    @staticmethod
    def force(share: Any) -> Any:
        """Of the spring [N]; it runs ahead of the displacement, so that the slope between them changes."""
        return 1.0 + 5.0 * share - share**2

    @staticmethod
    def displacement(share: Any) -> Any:
        """Of the spring [m]."""
        return 0.01 + 0.02 * share


@pytest.fixture(scope="session")
def heated_wire() -> HeatedWire:
    """The wire of `heated_fit`."""
    return HeatedWire()


@pytest.fixture(scope="session")
def heated_fit(heated_wire: HeatedWire, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Fit of two square waves of the current, 1.0 A and 1.2 A."""
    place = tmp_path_factory.mktemp("heated")
    rng = np.random.default_rng(3)
    time = np.arange(0.0, 240.0, 0.8)
    frames, edges = {}, [40.0 * k for k in range(7)]
    for current in (1.0, 1.2):
        on = [current, 0.0] * 3
        temperature, share = heated_wire.course(edges, on, time)
        noise = rng.standard_normal((3, time.size))
        frames[f"{current}A"] = {
            "time_s": time,
            "temperature_C": temperature + 0.1 * noise[0],
            "force_N": heated_wire.force(share) + 0.02 * noise[1],
            "displacement_mm": 1e3 * heated_wire.displacement(share) + 0.1 * noise[2],
            "current_A": np.array(on)[(time // 40.0).astype(int)],
        }
    campaign = sma_bayes.campaign_of(frames, name="wire")
    sma_bayes.fit_campaign(campaign, place / "fit", noise="independent", jobs=1, figures=False)
    return place / "fit"


class LoadedWire:
    """A wire at constant stress by the phase transformation law of Lagoudas et al. (2012), from its energies.

    The share at which the criterion of transformation is met is looked for numerically at each temperature; nothing of
    the package is used. Stresses in MPa, temperatures in K.
    """

    e_a, e_m, alpha_a, alpha_m = 65e3, 45e3, 1.1e-5, 8e-6
    h_min, h_max, k = 0.002, 0.05, 0.016
    c_a, c_m, calibration = 8.0, 7.0, 150.0
    exponents = (0.4, 0.3, 0.35, 0.25)
    hot = 390.0

    def __init__(self) -> None:
        self.zero_stress = {"Ms": 310.0, "Mf": 296.0, "As": 316.0, "Af": 332.0}  # ends of the law itself

    def strain_of_transformation(self, stress: float) -> float:
        return self.h_min + (self.h_max - self.h_min) * (1.0 - np.exp(-self.k * stress))

    def strain(self, temperature: Any, stress: float, branch: str) -> Any:
        """Strain at temperatures of one branch."""
        from scipy.optimize import brentq

        z, (n1, n2, n3, n4) = self.zero_stress, self.exponents
        softer = 1.0 / self.e_m - 1.0 / self.e_a
        slope = (self.h_max - self.h_min) * self.k * np.exp(-self.k * self.calibration)
        rise = self.strain_of_transformation(self.calibration) + self.calibration * slope
        whole = rise + self.calibration * softer
        entropy = -2.0 * self.c_m * self.c_a * whole / (self.c_m + self.c_a)
        d = (self.c_m - self.c_a) * whole / ((self.c_m + self.c_a) * rise)
        a1, a2 = entropy * (z["Mf"] - z["Ms"]), entropy * (z["As"] - z["Af"])
        a3 = -0.25 * a1 * (1 + 1 / (n1 + 1) - 1 / (n2 + 1)) + 0.25 * a2 * (1 + 1 / (n3 + 1) - 1 / (n4 + 1))
        energy = 0.5 * entropy * (z["Ms"] + z["Af"])
        yielding = 0.5 * entropy * (z["Ms"] - z["Af"]) - a3
        h = self.strain_of_transformation(stress)

        def criterion(x: float, t: float) -> float:
            elastic = 0.5 * softer * stress**2
            if branch == "cooling":
                hard = 0.5 * a1 * (1 + x**n1 - (1 - x) ** n2) + a3
                return (1 - d) * stress * h + elastic + entropy * t - energy - hard - yielding
            hard = 0.5 * a2 * (1 + x**n3 - (1 - x) ** n4) - a3
            return -((1 + d) * stress * h + elastic + entropy * t - energy) + hard - yielding

        def share(t: float) -> float:
            low, high = criterion(0.0, t), criterion(1.0, t)
            if low * high > 0.0:
                warm = low < 0.0 if branch == "cooling" else low > 0.0
                return 0.0 if warm else 1.0
            return float(brentq(criterion, 0.0, 1.0, args=(t,), xtol=1e-12))

        x = np.array([share(float(t)) for t in temperature])
        lines = (self.alpha_a + x * (self.alpha_m - self.alpha_a)) * (np.asarray(temperature) - self.hot)
        return stress / self.e_a + x * (h + stress * softer) + lines


@pytest.fixture(scope="session")
def loaded_wire() -> LoadedWire:
    """The wire of `loaded_fit`."""
    return LoadedWire()


@pytest.fixture(scope="session")
def loaded_campaign(loaded_wire: LoadedWire) -> Campaign:
    """Strain against temperature of a wire at three stresses."""
    rng = np.random.default_rng(5)
    down = np.linspace(390.0, 280.0, 70)
    frames = {}
    for stress in (80.0, 140.0, 200.0):
        strain = np.concatenate([
            loaded_wire.strain(down, stress, "cooling"), loaded_wire.strain(down[::-1], stress, "heating")
        ])  # fmt: skip
        frames[f"{stress:.0f}MPa"] = {
            "temperature_K": np.concatenate([down, down[::-1]]),
            "strain_1": strain + 5e-5 * rng.standard_normal(strain.size),
            "stress_MPa": stress + 0.2 * rng.standard_normal(strain.size),
        }
    return sma_bayes.campaign_of(frames, name="wire at constant stress")


@pytest.fixture(scope="session")
def loaded_fit(loaded_campaign: Campaign, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Fit of that."""
    place = tmp_path_factory.mktemp("loaded")
    sma_bayes.fit_campaign(
        loaded_campaign, place / "fit", model="sinh_arcsinh", noise="independent", jobs=1, figures=False
    )
    return place / "fit"
