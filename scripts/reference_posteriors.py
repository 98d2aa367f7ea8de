"""Posteriors whose moments and quantiles are known, as models of one's own (see docs/howto/add_a_model.md).

Growth curves by quadrature, which shares nothing with the package's sampler: the span, normal a priori, is integrated
out in closed form, the other parameters and the logarithm of the noise's sd on a grid along the principal axes of the
posterior, by the trapezoidal rule. That is exact but for what a finer and wider grid changes, which is told. Two
regressions and a model of predators and prey are posteriordb's, with its reference draws.

    python scripts/reference_posteriors.py grid                   # shows the quadrature, and what a finer grid changes
    python scripts/reference_posteriors.py write DRAWS            # tests/data/reference_posteriors.json

DRAWS is a folder with the unpacked data and reference draws of posteriordb: sblri.json, sblri-blr.json,
sblri-blr.info.json and so on.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from scipy.integrate import cumulative_simpson, simpson
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq, minimize
from scipy.special import expit, ndtr

import sma_bayes
from sma_bayes.arrays import Floats
from sma_bayes.parameters.space import ParameterSpec
from sma_bayes.records.types import Branch
from sma_bayes.response import ResponseModel

ROOT = Path(__file__).resolve().parents[1]
STORED = ROOT / "tests" / "data" / "reference_posteriors.json"
STRD = ROOT / "tests" / "data" / "nist_strd.json"
QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)
FINE = 20_001
"""Points at which a marginal density is interpolated."""
GRIDS = {3: ((101, 13.0), (141, 19.0)), 4: ((41, 8.0), (61, 11.0))}
"""By the number of axes: points along each and how far they reach in sds, of a grid and of a finer and wider one."""
YEAR_STEPS = 20
"""Steps of the Runge-Kutta method in a year."""

Predict = Callable[[list[Any], Mapping[str, Floats]], dict[str, Floats]]


# the models


def _logistic(theta: list[Any], inputs: Mapping[str, Floats]) -> dict[str, Floats]:
    span, rate, midpoint = theta
    return {"force": span * expit(rate * (inputs["temperature"] - midpoint))}


def _gompertz(theta: list[Any], inputs: Mapping[str, Floats]) -> dict[str, Floats]:
    span, rate, midpoint = theta
    with np.errstate(over="ignore"):
        return {"force": span * np.exp(-np.exp(-rate * (inputs["temperature"] - midpoint)))}


def _richards(theta: list[Any], inputs: Mapping[str, Floats]) -> dict[str, Floats]:
    span, rate, midpoint, shape = theta
    return {"force": span * expit(rate * (inputs["temperature"] - midpoint)) ** (1.0 / shape)}


def _regression(theta: list[Any], inputs: Mapping[str, Floats]) -> dict[str, Floats]:
    predictors = [inputs["temperature"], *(inputs[f"x{k}"] for k in range(2, 6))]
    return {"force": np.asarray(sum(b * x for b, x in zip(theta, predictors, strict=True)))}


def _predators(theta: list[Any], inputs: Mapping[str, Floats]) -> dict[str, Floats]:
    """Logarithms of prey and predators after Lotka and Volterra, at whole years from 0."""
    alpha, beta, gamma, delta, prey, predators = np.broadcast_arrays(*theta)
    years = np.asarray(inputs["temperature"]).astype(int)
    state = np.stack([np.log(prey), np.log(predators)])
    found = [state]
    h = 1.0 / YEAR_STEPS

    def change(s: Floats) -> Floats:
        return np.stack([alpha - beta * np.exp(s[1]), delta * np.exp(s[0]) - gamma])

    with np.errstate(all="ignore"):
        for step in range(1, int(years.max()) * YEAR_STEPS + 1):
            k1 = change(state)
            k2 = change(state + 0.5 * h * k1)
            k3 = change(state + 0.5 * h * k2)
            k4 = change(state + h * k3)
            state = state + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
            if step % YEAR_STEPS == 0:
                found.append(state)
    curves = np.stack(found, axis=-1)[..., 0, :]
    return {"force": curves[0][..., years], "displacement": curves[1][..., years]}


@dataclass(frozen=True)
class Growth(ResponseModel):
    """A curve of which the priors of all parameters are told in numbers."""

    name = "reference"
    provides = ("force", "displacement")
    channels: tuple[str, ...] = ("force",)
    curve: Predict = _logistic
    names: tuple[str, ...] = ()

    @property
    def parameter_names(self) -> tuple[str, ...]:
        return self.names

    def parameters(self, units: Mapping[str, str]) -> tuple[ParameterSpec, ...]:
        return tuple(
            ParameterSpec(n, "1", n, n, "" if len(self.channels) > 1 else "force") for n in self.names
        )

    def predict(self, theta: Floats, inputs: Mapping[str, Floats]) -> dict[str, Floats]:
        theta = np.asarray(theta, dtype=float)
        return self.curve([theta[..., k, None] for k in range(theta.shape[-1])], inputs)


@dataclass(frozen=True)
class Case:
    """A posterior of this file.

    Attributes
    ----------
    curve : callable
    priors : mapping of str to mapping
        Of the parameters of the curve, and ``sd`` of the noise, as in a priors file.
    linear : tuple of str
    channels : tuple of str
    source : str
        Name of the data: a set of NIST's, or one of posteriordb's.
    reference : str
        Name of the posterior in posteriordb; empty for quadrature.
    renamed : tuple of str
        Names of the parameters there, the noise's last.
    """

    curve: Predict
    priors: Mapping[str, Mapping[str, Any]]
    source: str
    channels: tuple[str, ...] = ("force",)
    reference: str = ""
    renamed: tuple[str, ...] = ()
    linear: tuple[str, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Parameters of the curve."""
        return tuple(n for n in self.priors if n != "sd")

    @property
    def parameters(self) -> tuple[str, ...]:
        """All parameters, as the package names them."""
        return (*self.names, *(f"{c}_sd" for c in self.channels))

    @property
    def priors_text(self) -> str:
        """The priors as a priors file."""
        lines = ['schema = "sma-bayes/priors/1"', 'title = "priors of the reference"']
        for name, prior in self.priors.items():
            lines.append(f"[{'noise' if name == 'sd' else 'both'}.{name}]")
            lines += [f"{key} = {json.dumps(value)}" for key, value in prior.items()]
            lines.append('unit = "1"')
        return "\n".join(lines)

    def model(self) -> Growth:
        return Growth(self.channels, self.curve, self.names)

    def record(self, data: Mapping[str, Any]) -> sma_bayes.Record:
        """The data as a record: the first predictor as temperature."""
        inputs = {"temperature" if k == "x" else k: np.array(v) for k, v in data.items() if k.startswith("x")}
        observed = {c: np.array(data[c]) for c in self.channels}
        n = len(data["x"])
        units = dict.fromkeys((*inputs, *observed), "1")
        return sma_bayes.Record(
            sma_bayes.Condition(self.source), Branch.HEATING, inputs, observed, np.arange(1, n + 1), units
        )


def normal(mean: float, sd: float) -> dict[str, Any]:
    return {"family": "normal", "mean": mean, "sd": sd}


def lognormal(median: float, sigma: float) -> dict[str, Any]:
    return {"family": "lognormal", "median": median, "sigma": sigma}


def positive(mean: float, sd: float, high: float) -> dict[str, Any]:
    """A normal that is cut off at zero; `high` is so far out that it cuts nothing."""
    return {"family": "truncated_normal", "mean": mean, "sd": sd, "low": 0.0, "high": high}


BLR = {f"beta{k}": normal(0.0, 10.0) for k in range(1, 6)} | {"sd": {"family": "half_normal", "sd": 10.0}}
BLR_NAMES = (*(f"beta[{k}]" for k in range(1, 6)), "sigma")
CASES = {
    "logistic": Case(
        _logistic,
        {
            "span": normal(75.0, 30.0), "rate": lognormal(0.07, 0.7), "midpoint": normal(40.0, 20.0),
            "sd": lognormal(1.0, 1.0),
        },
        "Rat42",
    ),
    "gompertz": Case(
        _gompertz,
        {
            "span": normal(75.0, 30.0), "rate": lognormal(0.05, 0.7), "midpoint": normal(35.0, 20.0),
            "sd": lognormal(1.0, 1.0),
        },
        "Rat42",
    ),
    "richards": Case(
        _richards,
        {
            "span": normal(700.0, 200.0), "rate": lognormal(0.8, 0.7), "midpoint": normal(7.0, 4.0),
            "shape": lognormal(1.0, 0.7), "sd": lognormal(30.0, 1.0),
        },
        "Rat43",
    ),
    "sblri": Case(_regression, BLR, "sblri", reference="sblri-blr", renamed=BLR_NAMES),
    "sblrc": Case(_regression, BLR, "sblrc", reference="sblrc-blr", renamed=BLR_NAMES),
    "lynx_hare": Case(
        _predators,
        {
            "alpha": positive(1.0, 0.5, 50.0), "beta": positive(0.05, 0.05, 5.0),
            "gamma": positive(1.0, 0.5, 50.0), "delta": positive(0.05, 0.05, 5.0),
            "prey": lognormal(10.0, 1.0), "predators": lognormal(10.0, 1.0),
            "sd": lognormal(float(np.exp(-1.0)), 1.0),
        },
        "hudson_lynx_hare",
        channels=("force", "displacement"),
        reference="hudson_lynx_hare-lotka_volterra",
        renamed=(*(f"theta[{k}]" for k in range(1, 5)), "z_init[1]", "z_init[2]", "sigma[1]", "sigma[2]"),
    ),
}  # fmt: skip


# quadrature


@dataclass(frozen=True, eq=False)
class Conditional:
    """Posterior of the span given the other parameters, and what they have once it is integrated out.

    Attributes
    ----------
    log_density : ndarray
        Of the others in their coordinates, prior and likelihood.
    mean, sd : ndarray
        Of the span.
    """

    log_density: Floats
    mean: Floats
    sd: Floats


@dataclass(frozen=True, eq=False)
class Quadrature:
    """Integrals over a posterior of a growth curve."""

    case: Case
    x: Floats
    y: Floats
    others: tuple[str, ...] = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "others", tuple(n for n in self.case.priors if n != "span"))

    def physical(self, z: Floats) -> Floats:
        """Parameters without the span (..., K) at their coordinates: logarithms where the prior is lognormal."""
        logs = [self.case.priors[n]["family"] == "lognormal" for n in self.others]
        with np.errstate(over="ignore"):
            return np.where(logs, np.exp(z), z)

    def given(self, z: Floats) -> Conditional:
        """The span given the others: ``y = span g + e`` with a normal prior is a conjugate regression."""
        theta = self.physical(z)
        one = np.ones(theta.shape[:-1])
        shape = self.case.curve([one[..., None], *(theta[..., k, None] for k in range(len(self.others) - 1))],
                                {"temperature": self.x})["force"]  # fmt: skip
        sd, prior = theta[..., -1], self.case.priors["span"]
        m, s = prior["mean"], prior["sd"]
        left = self.y - m * shape
        precision = s**-2 + np.einsum("...i,...i->...", shape, shape) / sd**2
        pull = np.einsum("...i,...i->...", shape, left) / sd**2
        quadratic = np.einsum("...i,...i->...", left, left) / sd**2 - pull**2 / precision
        log_density = -0.5 * (quadratic + np.log(precision * s**2))
        log_density -= self.y.size * (np.log(sd) + 0.5 * np.log(2.0 * np.pi))
        for k, name in enumerate(self.others):
            p = self.case.priors[name]
            centre, width = (
                (p["mean"], p["sd"]) if p["family"] == "normal" else (np.log(p["median"]), p["sigma"])
            )
            log_density = log_density - 0.5 * ((z[..., k] - centre) / width) ** 2
            log_density -= np.log(width) + 0.5 * np.log(2.0 * np.pi)
        return Conditional(log_density, m + pull / precision, precision**-0.5)

    def axes(self) -> tuple[Floats, Floats]:
        """Mean and covariance of the others, by coarse grids that begin at the mode, to lay out finer ones."""
        start = [p["mean"] if p["family"] == "normal" else np.log(p["median"])
                 for p in (self.case.priors[n] for n in self.others)]  # fmt: skip

        def f(z: Floats) -> float:
            return -float(self.given(z).log_density)

        options = {"maxiter": 20_000, "maxfev": 20_000, "xatol": 1e-9, "fatol": 1e-11}
        mode = np.asarray(minimize(f, start, method="Nelder-Mead", options=options).x)
        step = 1e-3 * np.eye(mode.size)
        curvature = np.empty((mode.size, mode.size))
        for i, one in enumerate(step):
            for j, two in enumerate(step):
                signs = [(a, b, a * b) for a in (1.0, -1.0) for b in (1.0, -1.0)]
                curvature[i, j] = sum(c * f(mode + a * one + b * two) for a, b, c in signs) / 4e-6
        mean, covariance = mode, np.linalg.inv(curvature)
        u = self._even(15, 7.0, mode.size)
        for _ in range(3):
            z = mean + u @ np.linalg.cholesky(covariance).T
            log_density = self.given(z).log_density
            w = np.exp(log_density - log_density.max())
            w /= w.sum()
            mean = w @ z
            covariance = np.einsum("n,ni,nj->ij", w, z - mean, z - mean)
        return mean, covariance

    @staticmethod
    def _even(points: int, reach: float, dimension: int) -> Floats:
        """Even grid from `-reach` to `reach` along each axis, shape (points**dimension, dimension)."""
        line = np.linspace(-reach, reach, points)
        return np.stack(np.meshgrid(*[line] * dimension, indexing="ij"), axis=-1).reshape(-1, dimension)

    def result(self, points: int, reach: float) -> dict[str, Any]:
        """Moments, quantiles and evidence from grids of `points` along each axis, `reach` sds to either side.

        There is a grid for each parameter, of which one axis moves that parameter and no other does: the sums along the
        others are its marginal density.
        """
        centre, covariance = self.axes()
        line = np.linspace(-reach, reach, points)
        u = self._even(points, reach, centre.size)
        told, evidence, edge = {}, 0.0, 0.0
        for k, name in enumerate(self.others):
            order = [k, *(i for i in range(centre.size) if i != k)]
            back = np.argsort(order)
            axes = np.linalg.cholesky(covariance[np.ix_(order, order)])
            z = (centre[order] + u @ axes.T)[:, back]
            parts = [self.given(part) for part in np.array_split(z, max(1, len(z) // 100_000))]
            log_density, mean, sd = (
                np.concatenate([getattr(p, a) for p in parts]) for a in ("log_density", "mean", "sd")
            )
            top = log_density.max()
            mass = np.exp(log_density - top)
            marginal = mass.reshape(points, -1).sum(axis=1)
            physical = self._physical_of(name)
            told["force_sd" if name == "sd" else name] = _marginal(
                centre[k] + axes[0, 0] * line, marginal, physical
            )
            cell = (line[1] - line[0]) ** centre.size * np.prod(np.diag(axes))
            evidence = float(top + np.log(mass.sum() * cell))
            edge = max(edge, float(mass[(np.abs(u) == reach).any(axis=1)].sum() / mass.sum()))
        keep = mass > 1e-13
        told["span"] = _mixture(mass[keep] / mass[keep].sum(), mean[keep], sd[keep])
        return {
            "parameters": {n: told[n] for n in self.case.parameters},
            "ln_evidence": evidence,
            "edge": edge,
        }

    def _physical_of(self, name: str) -> Callable[[Floats], Floats]:
        return np.exp if self.case.priors[name]["family"] == "lognormal" else np.asarray


def _marginal(z: Floats, density: Floats, physical: Callable[[Floats], Floats]) -> dict[str, float]:
    """Moments and quantiles of a density that is known at even points; its logarithm is interpolated by a spline."""
    some = density > 1e-280
    fine = np.linspace(z[some][0], z[some][-1], FINE)
    p = np.exp(CubicSpline(z[some], np.log(density[some] / density.max()))(fine))
    below = cumulative_simpson(p, x=fine, initial=0.0)
    x = physical(fine)
    mean = float(simpson(p * x, x=fine) / below[-1])
    sd = float(np.sqrt(simpson(p * (x - mean) ** 2, x=fine) / below[-1]))
    at = physical(np.interp(np.array(QUANTILES) * below[-1], below, fine))
    return _told(mean, sd, at.tolist())


def _mixture(w: Floats, mean: Floats, sd: Floats) -> dict[str, float]:
    """Moments and quantiles of a mixture of normals."""
    m = float(w @ mean)
    s = float(np.sqrt(w @ (sd**2 + (mean - m) ** 2)))
    found = [
        brentq(lambda v, p=p: w @ ndtr((v - mean) / sd) - p, m - 20.0 * s, m + 20.0 * s) for p in QUANTILES
    ]
    return _told(m, s, found)


def _told(mean: float, sd: float, quantiles: Sequence[float]) -> dict[str, float]:
    return {"mean": mean, "sd": sd} | {
        f"q{round(100 * p):02d}": float(q) for p, q in zip(QUANTILES, quantiles, strict=True)
    }


def grid_of(case: Case) -> Quadrature:
    given = json.loads(STRD.read_text(encoding="utf-8"))[case.source]
    return Quadrature(case, np.array(given["x"]), np.array(given["y"]))


def settled(case: Case) -> dict[str, Any]:
    """The quadrature, and by how much the next finer and wider grid differs, in sds of the posterior."""
    quadrature = grid_of(case)
    coarse, fine = (quadrature.result(*grid) for grid in GRIDS[len(quadrature.others)])
    change = max(
        abs(c[key] - f[key]) / f["sd"]
        for c, f in zip(coarse["parameters"].values(), fine["parameters"].values(), strict=True)
        for key in f
    )
    points, reach = GRIDS[len(quadrature.others)][1]
    data = {"x": quadrature.x.tolist(), "force": quadrature.y.tolist()}
    how = f"quadrature, {points} points to {reach:g} sd along each of {len(quadrature.others)} axes"
    return {"data": data, "how": how, "change": change, **fine}


# posteriordb


def read_reference(case: Case, folder: Path) -> dict[str, Any]:
    """Data and a summary of the reference draws of posteriordb."""

    def read(name: str) -> Any:
        return json.loads((folder / name).read_text(encoding="utf-8"))

    given, chains = read(f"{case.source}.json"), read(f"{case.reference}.json")
    info = read(f"{case.reference}.info.json")["diagnostics"]
    if "X" in given:
        columns = np.array(given["X"]).T.tolist()
        data = {"x": columns[0], **{f"x{k + 2}": c for k, c in enumerate(columns[1:])}, "force": given["y"]}
    else:
        counts = np.log(np.array([given["y_init"], *given["y"]])).T.tolist()
        data = {"x": [0, *given["ts"]], "force": counts[0], "displacement": counts[1]}
    told = {}
    for name, there in zip(case.parameters, case.renamed, strict=True):
        draws = np.concatenate([chain[there] for chain in chains])
        k = info["diagnostic_information"]["names"].index(there)
        told[name] = _told(
            float(draws.mean()), float(draws.std(ddof=1)), np.quantile(draws, QUANTILES).tolist()
        )
        told[name]["ess"] = min(
            info["effective_sample_size_bulk"][k], info["effective_sample_size_tail"][k], draws.size
        )
    return {"data": data, "how": f"reference draws of posteriordb, {case.reference}", "parameters": told}


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("do", choices=["grid", "write"])
    parser.add_argument("draws", nargs="?", type=Path, help="folder of posteriordb's data and draws")
    given = parser.parse_args()
    found = {}
    for name, case in CASES.items():
        if not case.reference:
            found[name] = settled(case)
            told = {k: v for k, v in found[name].items() if k != "data"}
            print(name, json.dumps(told, indent=1))
        elif given.do == "write":
            found[name] = read_reference(case, given.draws)
    if given.do == "write":
        lines = [f'"{name}": {json.dumps(entry)}' for name, entry in found.items()]
        STORED.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")


if __name__ == "__main__":
    main()
