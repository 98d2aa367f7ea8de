"""The 27 nonlinear regressions of NIST's Statistical Reference Datasets, by the package's own door for models.

Each regression is a response model (see docs/howto/add_a_model.md): its predictor is the abscissa, its response the
force, in whatever units. `sma_bayes.least_squares` fits it from both starts of NIST; digits are those of
McCullough 1998, Am. Stat. 52, 358: ``-log10(|estimate - certified|/|certified|)``, of the worst parameter.

    python scripts/nist_strd.py                # the table
    python scripts/nist_strd.py --write        # into docs/reference/nist.md
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import sma_bayes
from sma_bayes.arrays import Floats
from sma_bayes.parameters.space import ParameterSpec
from sma_bayes.records.types import Branch
from sma_bayes.response import ResponseModel

ROOT = Path(__file__).resolve().parents[1]
DATA = ROOT / "tests" / "data" / "nist_strd.json"
PAGE = ROOT / "docs" / "reference" / "nist.md"
MARK = "<!-- table made by scripts/nist_strd.py -->"
TINY = 1e-30
"""Step into the complex plane: the derivative is then exact to rounding."""
MOST = 11.0
"""Digits to which values are certified."""

Curve = Callable[..., Any]


def _peaks(x: Any, b: Any) -> Any:
    def peak(k: int) -> Any:
        return b[k] * np.exp(-((x - b[k + 1]) ** 2) / b[k + 2] ** 2)

    return b[0] * np.exp(-b[1] * x) + peak(2) + peak(5)


def _exponentials(x: Any, b: Any) -> Any:
    return sum(b[k] * np.exp(-b[k + 1] * x) for k in (0, 2, 4))


def _waves(x: Any, b: Any) -> Any:
    def wave(cosine: Any, sine: Any, period: Any) -> Any:
        return cosine * np.cos(2 * np.pi * x / period) + sine * np.sin(2 * np.pi * x / period)

    return b[0] + wave(b[1], b[2], 12.0) + wave(b[4], b[5], b[3]) + wave(b[7], b[8], b[6])


def _chwirut(x: Any, b: Any) -> Any:
    return np.exp(-b[0] * x) / (b[1] + b[2] * x)


def _cubics(x: Any, b: Any) -> Any:
    return (b[0] + x * (b[1] + x * (b[2] + x * b[3]))) / (1 + x * (b[4] + x * (b[5] + x * b[6])))


CURVES: dict[str, tuple[Curve, tuple[int, ...]]] = {
    "Bennett5": (lambda x, b: b[0] * (b[1] + x) ** (-1 / b[2]), (1,)),
    "BoxBOD": (lambda x, b: b[0] * (1 - np.exp(-b[1] * x)), (1,)),
    "Chwirut1": (_chwirut, ()),
    "Chwirut2": (_chwirut, ()),
    "DanWood": (lambda x, b: b[0] * x ** b[1], (1,)),
    "ENSO": (_waves, (1, 2, 3, 5, 6, 8, 9)),
    "Eckerle4": (lambda x, b: b[0] / b[1] * np.exp(-0.5 * ((x - b[2]) / b[1]) ** 2), (1,)),
    "Gauss1": (_peaks, (1, 3, 6)),
    "Gauss2": (_peaks, (1, 3, 6)),
    "Gauss3": (_peaks, (1, 3, 6)),
    "Hahn1": (_cubics, (1, 2, 3, 4)),
    "Kirby2": (lambda x, b: (b[0] + x * (b[1] + x * b[2])) / (1 + x * (b[3] + x * b[4])), (1, 2, 3)),
    "Lanczos1": (_exponentials, (1, 3, 5)),
    "Lanczos2": (_exponentials, (1, 3, 5)),
    "Lanczos3": (_exponentials, (1, 3, 5)),
    "MGH09": (lambda x, b: b[0] * (x**2 + x * b[1]) / (x**2 + x * b[2] + b[3]), (1,)),
    "MGH10": (lambda x, b: b[0] * np.exp(b[1] / (x + b[2])), (1,)),
    "MGH17": (lambda x, b: b[0] + b[1] * np.exp(-x * b[3]) + b[2] * np.exp(-x * b[4]), (1, 2, 3)),
    "Misra1a": (lambda x, b: b[0] * (1 - np.exp(-b[1] * x)), (1,)),
    "Misra1b": (lambda x, b: b[0] * (1 - (1 + b[1] * x / 2) ** -2), (1,)),
    "Misra1c": (lambda x, b: b[0] * (1 - (1 + 2 * b[1] * x) ** -0.5), (1,)),
    "Misra1d": (lambda x, b: b[0] * b[1] * x / (1 + b[1] * x), (1,)),
    "Nelson": (lambda x, b, x2: b[0] - b[1] * x * np.exp(-b[2] * x2), (1, 2)),
    "Rat42": (lambda x, b: b[0] / (1 + np.exp(b[1] - b[2] * x)), (1,)),
    "Rat43": (lambda x, b: b[0] / (1 + np.exp(b[1] - b[2] * x)) ** (1 / b[3]), (1,)),
    "Roszman1": (lambda x, b: b[0] - b[1] * x - np.arctan(b[2] / (x - b[3])) / np.pi, (1, 2)),
    "Thurber": (_cubics, (1, 2, 3, 4)),
}
"""Name to the curve of predictor and parameters, and the numbers of the parameters that are linear together."""


@dataclass(frozen=True)
class Regression(ResponseModel):
    """A regression of one response on one or two predictors."""

    name = "nist_strd"
    provides = ("force",)
    channels: tuple[str, ...] = ("force",)
    dataset: str = ""
    count: int = 0

    @property
    def linear(self) -> tuple[str, ...]:  # type: ignore[override]
        return tuple(f"b{k}" for k in CURVES[self.dataset][1])

    @property
    def parameter_names(self) -> tuple[str, ...]:
        return tuple(f"b{k + 1}" for k in range(self.count))

    def parameters(self, units: Mapping[str, str]) -> tuple[ParameterSpec, ...]:
        return tuple(ParameterSpec(name, "1", name, name, "force") for name in self.parameter_names)

    def predict(self, theta: Floats, inputs: Mapping[str, Floats]) -> dict[str, Floats]:
        b = [np.asarray(theta)[..., k, None] for k in range(self.count)]
        with np.errstate(all="ignore"):
            return {"force": np.asarray(self._curve(inputs, b))}

    def jacobian(self, theta: Floats, inputs: Mapping[str, Floats]) -> dict[str, Floats]:
        """By the complex step of Squire and Trapp 1998, SIAM Rev. 40, 110: exact, since nothing is subtracted."""
        columns = []
        for k in range(self.count):
            b = [np.asarray(theta)[..., i, None] + (1j * TINY if i == k else 0.0) for i in range(self.count)]
            with np.errstate(all="ignore"):
                columns.append(np.imag(self._curve(inputs, b)) / TINY)
        return {"force": np.stack(columns, axis=-1)}

    def _curve(self, inputs: Mapping[str, Floats], b: list[Any]) -> Any:
        curve = CURVES[self.dataset][0]
        if self.dataset == "Nelson":  # time in weeks, and temperature
            return curve(inputs["time"], b, inputs["temperature"])
        return curve(inputs["temperature"], b)


def datasets() -> dict[str, dict[str, Any]]:
    """Data, starts and certified values by the names of the sets."""
    found: dict[str, dict[str, Any]] = json.loads(DATA.read_text(encoding="utf-8"))
    return found


def record_of(name: str, given: Mapping[str, Any]) -> sma_bayes.Record:
    """A set as a record: the predictor as temperature, the response as force."""
    inputs, y = {"temperature": np.array(given["x"])}, np.array(given["y"])
    if name == "Nelson":
        inputs, y = {"time": np.array(given["x"]), "temperature": np.array(given["x2"])}, np.log(y)
    return sma_bayes.Record(
        sma_bayes.Condition(name),
        Branch.HEATING,
        inputs,
        {"force": y},
        np.arange(1, y.size + 1),
        dict.fromkeys((*inputs, "force"), "1"),
        source=name,
    )


def model_of(name: str, given: Mapping[str, Any]) -> Regression:
    return Regression(dataset=name, count=len(given["certified"]))


def digits(found: Floats, certified: Floats) -> float:
    """Digits that agree, of the worst number; at most those that are certified."""
    off = np.abs((np.asarray(found) - certified) / certified)
    return float(min(MOST, -np.log10(max(off.max(), 1e-16)))) if np.isfinite(off).all() else 0.0


@dataclass(frozen=True)
class Reached:
    """Digits reached from one start: of parameters, their standard deviations, and the residual one."""

    estimate: float
    sd: float
    residual_sd: float
    converged: bool


def reached(name: str, given: Mapping[str, Any], start: int, model: ResponseModel | None = None) -> Reached:
    model = model or model_of(name, given)
    begin = dict(zip(model.parameter_names, given["starts"][start], strict=True))
    fit = sma_bayes.least_squares(record_of(name, given), model, start=begin)
    return Reached(
        digits(np.array(list(fit.estimate.values())), np.array(given["certified"])),
        digits(np.array(list(fit.standard_error.values())), np.array(given["sd"])),
        digits(np.array([fit.residual_sd["force"]]), np.array([given["residual_sd"]])),
        fit.converged,
    )


class ByDifferences(Regression):
    """The same, with the derivatives that every model has by default."""

    jacobian = ResponseModel.jacobian


HEAD = (
    "set", "difficulty", "samples", "parameters", "estimate, start 1", "start 2", "sd, start 1", "start 2",
    "residual sd", "estimate by differences", "sd by differences",
)  # fmt: skip


def numbers(name: str, given: Mapping[str, Any]) -> list[float]:
    """Digits of a set, in the order of the table."""
    one, two = (reached(name, given, start) for start in (0, 1))
    plain = ByDifferences(dataset=name, count=len(given["certified"]))
    third, fourth = (reached(name, given, start, plain) for start in (0, 1))
    by_differences = (min(third.estimate, fourth.estimate), min(third.sd, fourth.sd))
    residual_sd = min(one.residual_sd, two.residual_sd)
    return [one.estimate, two.estimate, one.sd, two.sd, residual_sd, *by_differences]


def table() -> str:
    rows: list[Sequence[str]] = [HEAD, ["---"] * len(HEAD)]
    for name, given in sorted(datasets().items(), key=lambda item: item[0].lower()):
        facts = [name, given["difficulty"], len(given["y"]), len(given["certified"])]
        rows.append([*map(str, facts), *(f"{n:.1f}" for n in numbers(name, given))])
    return "\n".join("| " + " | ".join(row) + " |" for row in rows)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--write", action="store_true", help="put the table at the end of docs/reference/nist.md"
    )
    if parser.parse_args().write:
        text = PAGE.read_text(encoding="utf-8").partition(MARK)[0]
        PAGE.write_text(f"{text}{MARK}\n\n{table()}\n", encoding="utf-8")
    else:
        print(table())


if __name__ == "__main__":
    main()
