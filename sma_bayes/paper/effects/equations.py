"""Effects of the errata about the equations: what Eqs. (1) to (11) give, and what they were meant to give.

Parameters are those of Tables 3 to 5, in N, cm and a temperature of unknown unit. A4 and B4 are not printed and
taken as zero where a curve needs them.
"""

from __future__ import annotations

from functools import cache
from typing import Final

import numpy as np
from scipy.optimize import minimize
from scipy.special import expit, logit

from sma_bayes.arrays import Floats
from sma_bayes.paper.effects.amount import Amount, Effect
from sma_bayes.paper.extremes import TABLE_9, TABLE_10, extremes
from sma_bayes.paper.physics import biased_path
from sma_bayes.paper.specifications import TABLE_2, TEXT_VALUES, specification
from sma_bayes.paper.tables import PARAMETER_UNITS
from sma_bayes.paper.twin import RECIPROCAL_RATES, curves, recipes
from sma_bayes.quantities import STANDARD_GRAVITY, convert
from sma_bayes.records.types import Branch

DEGREES_PER_UNIT: Final = 25.0
"""Guess at the unit of temperature of Tables 3 to 5 that the list of errata uses [°C]."""

LOGISTIC_CONSTANT: Final = 6.2
"""Constant of Eqs. (9) and (10) [1]."""


@cache
def parameter_rows() -> dict[str, dict[str, float]]:
    """Printed parameters of the 18 rows of Tables 3 to 5, by ``<condition>-<branch>``."""
    return {r.key: {name: cell.value for name, cell in r.parameters.items()} for r in recipes()}


def columns() -> dict[str, Floats]:
    """The same by parameter, each of shape (18,)."""
    rows = parameter_rows().values()
    return {name: np.array([row[name] for row in rows]) for name in PARAMETER_UNITS}


def stiffness(key: str, temperature: Floats | float) -> Floats:
    """Eq. (7) at the printed parameters of a row [N/m]."""
    k = curves(np.asarray(temperature, dtype=float), parameter_rows()[key])["stiffness"]
    return convert(k, "N/cm", "N/m")


def between(
    name: str, values: Floats, unit: str = "1", claimed: tuple[str, str] = ("", "")
) -> tuple[Amount, ...]:
    """Two amounts: the least and the greatest of some values."""
    return (
        Amount(f"{name}, least", float(np.min(values)), unit, claimed[0]),
        Amount(f"{name}, greatest", float(np.max(values)), unit, claimed[1]),
    )


def differential_equation() -> tuple[Amount, ...]:
    """Slope at the midpoint: Eq. (1) has ``B2 (1 - 1/2)``, the derivative of Eq. (2) ``B1 B2/4``."""
    p = columns()
    printed, derived = p["B2"] * (1 - 0.5), p["B1"] * p["B2"] / 4
    return between("slope at the midpoint by Eq. (1) over that of Eq. (2)", printed / derived)


def rate_as_slope() -> tuple[Amount, ...]:
    """Largest slope of Eqs. (2) and (4) over the rate that the text calls the slope."""
    p = columns()
    return between("largest slope of Eq. (2) over B2", p["B1"] / 4) + between(
        "largest slope of Eq. (4) over A2", p["A1"] / 4
    )


def lower_asymptote() -> tuple[Amount, ...]:
    """Rows in which the printed lower asymptote A3 lies above the printed upper one, A1."""
    p = columns()
    return (Amount("rows in which A3 exceeds A1, of 18", float(np.sum(p["A3"] > p["A1"]))),)


def initial_temperature() -> tuple[Amount, ...]:
    """Share of the span that is passed at the "initial" temperature B3."""
    p = parameter_rows()["1A-10mHz-heating"]
    share = curves(np.array([p["B3"]]), p)["force"][0] / p["B1"]
    return (Amount("share of the span passed at T = B3", float(share)),)


def _log_jacobian(temperature: Floats, p: dict[str, float]) -> Floats:
    """Derivatives of ln K of Eq. (7) to A1, A2, A3, B1, B2, B3, shape (n, 6)."""
    out = []
    for letter, side in (("A", 1.0), ("B", -1.0)):
        size, rate, middle = (p[f"{letter}{i}"] for i in (1, 2, 3))
        t = temperature - middle
        tanh = np.tanh(0.5 * rate * t)
        out += [np.full_like(t, -side / size), side * (t * tanh - 1 / rate), -side * rate * tanh]
    return np.stack(out, axis=-1)


def identified() -> tuple[Amount, ...]:
    """Rank of the sensitivities of Eq. (7), and whether two rates of the other sign give the same curve."""
    ranks, same = [], 0
    for recipe in recipes():
        p = parameter_rows()[recipe.key]
        jacobian = _log_jacobian(recipe.temperature, p)
        ranks.append(np.linalg.matrix_rank(jacobian / np.linalg.norm(jacobian, axis=0), tol=1e-9))
        mirrored = curves(recipe.temperature, p | {"A2": -p["A2"], "B2": -p["B2"]})["stiffness"]
        same += np.allclose(mirrored, recipe.curves["stiffness"], rtol=1e-9, atol=0.0)
    return (
        *between("combinations of the 6 parameters that Eq. (7) identifies", np.array(ranks, dtype=float)),
        Amount("rows unchanged by (A2, B2) -> (-A2, -B2), of 18", float(same)),
    )


def rate_correlation(reach: float) -> Floats:
    """Correlation of A2 and B2 in the least-squares covariance of a fit of the stiffness, for each row.

    Parameters
    ----------
    reach : float
        The fit spans the temperatures up to this many reciprocal rates from either midpoint [1]; the range of
        the measurements is not printed in the unit of the parameters.

    Returns
    -------
    ndarray, shape (18,)
        From ``J`` of the 5 identified combinations at 100 equally spaced temperatures: ``(J'J)**-1``.
    """
    found = []
    for p in parameter_rows().values():
        low = min(p["A3"] - reach / p["A2"], p["B3"] - reach / p["B2"])
        high = max(p["A3"] + reach / p["A2"], p["B3"] + reach / p["B2"])
        temperature = np.linspace(low, high, 100)
        sensitivity = curves(temperature, p)["stiffness"][:, None] * _log_jacobian(temperature, p)
        reduced = np.delete(sensitivity, 3, axis=1)  # B1 goes with A1
        reduced = reduced / np.linalg.norm(reduced, axis=0)
        covariance = np.linalg.inv(reduced.T @ reduced)
        found.append(covariance[1, 3] / np.sqrt(covariance[1, 1] * covariance[3, 3]))
    return np.array(found)


def shapes() -> tuple[Amount, ...]:
    """Shapes of Eq. (7) in the printed rows, and the correlation of the two rates in a fit of the stiffness."""
    p = columns()
    twin, wide = rate_correlation(RECIPROCAL_RATES), rate_correlation(4 * RECIPROCAL_RATES)
    return (
        Amount("humps, rows with A2 < B2", float(np.sum(p["A2"] < p["B2"])), claimed="15"),
        Amount("unbounded, rows with A2 > B2", float(np.sum(p["A2"] > p["B2"])), claimed="3"),
        *between("correlation of A2 and B2, 5 reciprocal rates either side", twin, claimed=("", "1.0000")),
        *between("correlation of A2 and B2, 20 reciprocal rates either side", wide, claimed=("", "1.0000")),
    )


def path_slope() -> tuple[Amount, ...]:
    """Slope dF/dX along the path of a spring that a bias spring holds, at the stiffness of Table 9, 1 A."""
    row, bias = extremes(TABLE_9)["1A-10mHz"], specification(TABLE_2, "spring_rate", "N/m")
    k = np.linspace(row["stiffness_min"], row["stiffness_max"], 201)
    force, elongation = biased_path(k, bias, 0.01)
    slope = np.diff(force) / np.diff(elongation)
    return (
        *between("stiffness of the spring along the path", k, "N/m"),
        Amount("size of dF/dX along the path, least", float(np.abs(slope).min()), "N/m", "130"),
        Amount("size of dF/dX along the path, greatest", float(np.abs(slope).max()), "N/m", "130"),
    )


def constant_load() -> tuple[Amount, ...]:
    """Stiffness where the load is said to be constant, and the force that then must not change."""
    rows = extremes(TABLE_10).values()
    span = [
        parameter_rows()[f"{mass}g-10mHz-{branch.value}"]["B1"] / (mass * 1e-3 * STANDARD_GRAVITY)
        for mass in (100, 150, 200)
        for branch in Branch
    ]
    return (
        Amount("least stiffness of Table 10", min(r["stiffness_min"] for r in rows), "N/m", "23"),
        Amount("greatest stiffness of Table 10", max(r["stiffness_max"] for r in rows), "N/m", "190"),
        *between("span B1 of the force over the hung weight", np.array(span)),
    )


def arrangements() -> tuple[Amount, ...]:
    """Eq. (8) and the two arrangements that the text names, over the stiffness of Table 9."""
    rows, k2 = extremes(TABLE_9).values(), specification(TABLE_2, "spring_rate", "N/m")
    low, high = min(r["stiffness_min"] for r in rows), max(r["stiffness_max"] for r in rows)
    ends = np.array([low, high])
    return (
        *between("K1 - K2 as printed", ends - k2, "N/m"),
        *between("K1 + K2, parallel", ends + k2, "N/m"),
        *between("K1 K2/(K1 + K2), series", ends * k2 / (ends + k2), "N/m"),
        Amount("share of the range of K1 in which K1 - K2 is negative", (k2 - low) / (high - low)),
    )


def _transformation(name: str) -> float:
    return specification(TEXT_VALUES, name, "degC")


def logistic_rates() -> tuple[float, float]:
    """Rates of Eqs. (9) and (10) at the printed transformation temperatures [1/°C]."""
    a_s, a_f, m_s, m_f = (_transformation(name) for name in ("As", "Af", "Ms", "Mf"))
    return LOGISTIC_CONSTANT / (a_f - a_s), LOGISTIC_CONSTANT / (m_s - m_f)


def logistic_centre() -> tuple[Amount, ...]:
    """Centre of Eq. (9) as printed, as meant, and the share of the rise that the printed one leaves out."""
    a_s, a_f = _transformation("As"), _transformation("Af")
    rate, _ = logistic_rates()
    printed = (a_s - a_f) / 2
    coldest = min(r["temperature_min"] for r in extremes(TABLE_9).values())
    return (
        Amount("centre of Eq. (9) as printed", printed, "degC", "-3.3"),
        Amount("centre with the plus of Eq. (10)", (a_s + a_f) / 2, "degC", "77.1"),
        Amount("share of the rise passed at 0 °C, as printed", float(expit(-rate * printed)), claimed="1.00"),
        Amount("the same at the least temperature of Table 9", float(expit(rate * (coldest - printed)))),
    )


def logistic_steps() -> tuple[Amount, ...]:
    """Rates of Eqs. (9) and (10), and how narrow they are beside the sweep of Table 9."""
    heating, cooling = logistic_rates()
    row = extremes(TABLE_9)["1.5A-10mHz"]
    sweep = row["temperature_max"] - row["temperature_min"]
    width = 2 * float(logit(0.9)) / np.array([heating, cooling])
    return (
        Amount("rate of Eq. (9)", heating, "1/degC", "0.94"),
        Amount("rate of Eq. (10)", cooling, "1/degC", "2.25"),
        Amount("10 to 90 % of the rise, heating, over the sweep of 1.5 A", float(width[0] / sweep)),
        Amount("10 to 90 % of the rise, cooling, over the sweep of 1.5 A", float(width[1] / sweep)),
    )


def logistic_ends() -> tuple[Amount, ...]:
    """Share of the rise that Eqs. (9) and (10) have passed at As and at Af."""
    half = LOGISTIC_CONSTANT / 2
    return (
        Amount("share of the rise at As", 100 * float(expit(-half)), "percent", "4.3"),
        Amount("share of the rise at Af", 100 * float(expit(half)), "percent", "95.7"),
    )


def polynomial_rank() -> tuple[Amount, ...]:
    """Rank of the design matrix 1, f, f², T of Eq. (11), at one frequency and at the three of Table 12."""
    temperature = np.linspace(0.0, 1.0, 20)

    def rank(*frequencies: float) -> float:
        f, t = (a.ravel() for a in np.meshgrid(np.array(frequencies) / 50.0, temperature))
        return float(np.linalg.matrix_rank(np.stack([np.ones_like(f), f, f * f, t], axis=1)))

    return (
        Amount("rank of the 4 terms at one frequency", rank(10.0), claimed="2"),
        Amount("rank of the 4 terms over 10, 30 and 50 mHz", rank(10.0, 30.0, 50.0)),
    )


def _miss(scale: float, offset: float) -> float:
    """Root mean square of ln(Eq. (7)/printed) over both extremes of the 6 rows of Tables 9 and 10."""
    logs = []
    for condition, row in {**extremes(TABLE_9), **extremes(TABLE_10)}.items():
        t = np.linspace(row["temperature_min"], row["temperature_max"], 60) / scale + offset
        k = np.concatenate([stiffness(f"{condition}-{branch.value}", t) for branch in Branch])
        logs += [np.log(k.min() / row["stiffness_min"]), np.log(k.max() / row["stiffness_max"])]
    return float(np.sqrt(np.mean(np.square(logs))))


@cache
def _best_map() -> tuple[float, float, float]:
    """Degrees per unit, offset and miss of the linear map of temperature that misses least."""
    starts = [(s, o) for s in (20.0, 30.0, 45.0, 70.0) for o in (-1.0, 0.0, 1.0, 2.0)]
    start = min(starts, key=lambda x: _miss(*x))

    def miss(x: Floats) -> float:
        return _miss(float(x[0]), float(x[1]))

    best = minimize(miss, start, method="Nelder-Mead", options={"xatol": 1e-8, "fatol": 1e-12})
    return float(best.x[0]), float(best.x[1]), float(best.fun)


def units_of_parameters() -> tuple[Amount, ...]:
    """How far Eq. (7) in N/cm stays from Tables 9 and 10 under the best linear map of temperature."""
    scale, offset, miss = _best_map()
    return (
        Amount("N/m for one unit of Eq. (7)", float(convert(1.0, "N/cm", "N/m"))),
        Amount("best linear map of temperature, degrees for a unit", scale, "delta_degC"),
        Amount("best linear map of temperature, value at 0 °C", offset, "arbitrary"),
        Amount("typical factor by which it misses the printed extremes", float(np.exp(miss)), claimed="1.5"),
        Amount("the same at 25 °C for a unit, no offset", float(np.exp(_miss(DEGREES_PER_UNIT, 0.0)))),
    )


def repeated_run() -> tuple[Amount, ...]:
    """Parameters of 2 A, 10 mHz in Table 5 and Table 3: the larger over the smaller."""
    ratio: dict[str, list[float]] = {"1": [], "2": [], "3": []}
    for branch in Branch:
        one, other = (parameter_rows()[f"2A-10mHz-{name}-{branch.value}"] for name in ("table3", "table5"))
        for name in PARAMETER_UNITS:
            ratio[name[1]].append(max(one[name] / other[name], other[name] / one[name]))
    at = 3.0
    return (
        *between("ratio of A1, A2, B1, B2", np.array(ratio["1"] + ratio["2"]), claimed=("2", "3")),
        *between("ratio of A3, B3", np.array(ratio["3"])),
        Amount("K cooling at T = 3, Table 3", float(stiffness("2A-10mHz-table3-cooling", at)), "N/m", "199"),
        Amount("K cooling at T = 3, Table 5", float(stiffness("2A-10mHz-table5-cooling", at)), "N/m", "80"),
    )


def open_loop() -> tuple[Amount, ...]:
    """Stiffness of both branches at the turning point, where they should meet: 2 A, Table 3, 25 °C for a unit."""
    top = extremes(TABLE_9)["2A-10mHz-table3"]["temperature_max"] / DEGREES_PER_UNIT
    heating, cooling = (float(stiffness(f"2A-10mHz-table3-{branch.value}", top)) for branch in Branch)
    return (
        Amount("K heating at the greatest temperature of Table 9", heating, "N/m"),
        Amount("K cooling there", cooling, "N/m"),
        Amount("ratio of the branches there", cooling / heating, claimed="2"),
    )


def _rise(key: str) -> float:
    """Kmax/Kmin of a bounded curve with the common rate ``a = (A2 + B2)/2``: ``exp(2 a (B3 - A3))``."""
    p = parameter_rows()[key]
    return float(np.exp((p["A2"] + p["B2"]) * (p["B3"] - p["A3"])))


def near_degenerate() -> tuple[Amount, ...]:
    """Rise of the two rows whose rates are large and nearly equal, beside Table 9."""
    row = extremes(TABLE_9)["1A-10mHz"]
    return (
        Amount(
            "Kmax/Kmin, 1 A cooling, by Eq. (7) with one common rate",
            _rise("1A-10mHz-cooling"),
            claimed="1.8",
        ),
        Amount("Kmax/Kmin, 1 A, Table 9", row["stiffness_max"] / row["stiffness_min"], claimed="6"),
        Amount("Kmax/Kmin, 30 mHz heating, by Eq. (7) with one common rate", _rise("2A-30mHz-heating")),
    )


def ratio_of_spans() -> tuple[Amount, ...]:
    """B1/A1 of heating against cooling, beside A1 and B1 themselves."""
    p = {name: values.reshape(-1, 2) for name, values in columns().items()}

    def spread(values: Floats) -> float:
        return float(np.exp(np.abs(np.log(values[:, 0] / values[:, 1])).max()))

    return (
        Amount(
            "heating over cooling, B1/A1: farthest from 1, in percent",
            100 * (spread(p["B1"] / p["A1"]) - 1),
            "percent",
            "8",
        ),
        Amount("heating over cooling, A1: farthest from 1", spread(p["A1"]), claimed="6.7"),
        Amount("heating over cooling, B1: farthest from 1", spread(p["B1"]), claimed="6.7"),
    )


def order_of_midpoints() -> tuple[Amount, ...]:
    """Rows in which the force's midpoint lies above that of the displacement."""
    p = columns()
    return (Amount("rows with B3 > A3, of 18", float(np.sum(p["B3"] > p["A3"])), claimed="18"),)


EFFECTS: Final[dict[str, Effect]] = {
    "E01": differential_equation,
    "E02": rate_as_slope,
    "E04": lower_asymptote,
    "E05": initial_temperature,
    "E06": identified,
    "E07": shapes,
    "E08": path_slope,
    "E09": constant_load,
    "E10": arrangements,
    "E11": logistic_centre,
    "E12": logistic_steps,
    "E13": logistic_ends,
    "E14": polynomial_rank,
    "E15": units_of_parameters,
    "E16": repeated_run,
    "E17": open_loop,
    "E18": near_degenerate,
    "N01": ratio_of_spans,
    "N02": order_of_midpoints,
}
"""Effects by id of the erratum."""
