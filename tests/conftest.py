"""Fixtures shared by all tests."""

from __future__ import annotations

import json
import signal
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from sma_bayes.records.types import Branch, Condition, Record
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


@pytest.fixture(scope="session")
def published() -> Callable[[str], Any]:
    """Validator of another library with the published JSON Schema of what a verb writes or prints, by the verb."""
    from jsonschema import Draft202012Validator

    def validator(verb: str) -> Any:
        schema = ROOT / "docs" / "reference" / "schemas" / f"{verb}.schema.json"
        return Draft202012Validator(json.loads(schema.read_text(encoding="utf-8")))

    return validator


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
