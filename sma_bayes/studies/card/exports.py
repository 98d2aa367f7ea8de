"""The constitutive card as other programs read it.

`simcoon` takes the law as ``SMADI`` (``SMAUT`` of older versions), 28 constants in the order of `SIMCOON`, stresses in
MPa: `simcoon.solver.io.load_material_json` reads the file. With the first of them, ``flagT``, zero, its temperatures
are those of the tangent at half the transformation. Its driving force counts the work of the stress on the difference
of the expansions, which a card keeps apart: the slopes and temperatures of the file are those with which its curves are
the card's. It starts at the temperature to which the strain refers, ``T_init``. Its default tangent takes that work at
the absolute temperature and fails where slopes of the phases differ by more than expansions do; ``tangent_mode`` names
one that does not. SMA-REACT (https://github.com/maestrolab/SMA-REACT)
takes the ends of the law itself, stresses in Pa and one expansion; the file has the keys with which it exports a
solution, its bounds are the 90 % intervals.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from scipy.optimize import least_squares

from sma_bayes.arrays import Floats
from sma_bayes.studies.card.law import Moduli, beside_expansions, ends, entropy, shift
from sma_bayes.studies.card.pooling import Constant, PooledConstants

POISSON: Final = 0.33
"""Poisson's ratio of both phases: one-dimensional measurements do not tell it [1]."""
SIMCOON: Final = (
    "flagT", "E_A", "E_M", "nu_A", "nu_M", "alpha_A", "alpha_M", "H_min", "H_max", "k", "sigma_crit", "C_A", "C_M",
    "Ms", "Mf", "As", "Af", "n1", "n2", "n3", "n4", "sigma_calibration", "b_Prager", "n_Prager",
    "c_lambda", "p0_lambda", "n_lambda", "alpha_lambda",
)  # fmt: skip
"""Order of the constants of ``SMADI``."""
MOVED: Final = ("Ms", "Mf", "As", "Af")
"""Constants that the work on expansions moves, with C_A and C_M."""
NEAR: Final = 0.01
"""Share of the reference stress on either side of it from which slopes are told."""
STATES: Final = 17
"""Its internal variables."""
_NUMERICAL: Final = {
    "flagT": 0.0, "nu_A": POISSON, "nu_M": POISSON, "b_Prager": 0.0, "n_Prager": 2.0,
    "c_lambda": 1e-6, "p0_lambda": 1e-3, "n_lambda": 1.0, "alpha_lambda": 1e8,
}  # fmt: skip
"""Poisson's ratios, no asymmetry of tension and compression, and the penalties of the examples of simcoon."""


def simcoon_material(card: PooledConstants, common: float, cautions: Sequence[str] = ()) -> dict[str, Any]:
    """Material of `simcoon`: name, constants, states and orientation; how to call it is told too.

    Parameters
    ----------
    card : PooledConstants
    common : float
        Temperature to which the strain refers [K].
    cautions : sequence of str
        What to doubt of it, kept in the file.
    """
    values = _beside_expansions(card, common)
    values |= _NUMERICAL | {"sigma_calibration": card.reference}
    return {
        "name": "SMADI",
        "props": [float(values[name]) for name in SIMCOON],
        "nstatev": STATES,
        "orientation": {"psi": 0.0, "theta": 0.0, "phi": 0.0},
        "symbols": list(SIMCOON),
        "units": "MPa, K, 1/K, 1/MPa, MPa/K",
        "T_init": common,
        "tangent_mode": "closest_point",
        **({"cautions": list(cautions)} if cautions else {}),
    }


def _beside_expansions(card: PooledConstants, common: float) -> dict[str, float]:
    """Constants whose driving force counts the work on expansions: the same transformations, the same slopes there."""
    values = {name: c.value for name, c in card.constants.items()}
    difference = values["alpha_M"] - values["alpha_A"]
    if difference == 0.0:
        return values
    moduli = Moduli(values["E_A"], values["E_M"])
    strain = (np.asarray(values["H_min"]), np.asarray(values["H_max"]), np.asarray(values["k"]))
    stresses = card.reference * np.array([1.0 - NEAR, 1.0, 1.0 + NEAR])

    def transformations(x: Floats, difference: float) -> Floats:
        """Four temperatures at the reference stress, and rises of both transformations about it [K]."""
        temperatures, slopes = x[:4], (np.exp(x[4]), np.exp(x[5]))
        change = entropy(card.reference, strain, slopes, moduli)
        at = np.array([
            beside_expansions(
                temperatures + np.repeat([
                    shift(float(s), card.reference, strain, slopes, moduli, cooling=cooling)
                    for cooling in (True, False)
                ], 2), float(s), change, difference, common,
            )
            for s in stresses
        ])  # fmt: skip
        rise = (at[2] - at[0]) / (2.0 * NEAR)
        return np.concatenate([at[1], rise.reshape(2, 2).mean(axis=1)])

    start = np.array([*(values[n] for n in MOVED), np.log(values["C_A"]), np.log(values["C_M"])])
    wanted = transformations(start, 0.0)

    def missed(x: Floats) -> Floats:
        return transformations(x, difference) - wanted

    found = least_squares(missed, start, x_scale=[1.0, 1.0, 1.0, 1.0, 0.1, 0.1])
    moved = dict(zip(MOVED, found.x[:4].tolist(), strict=True))
    return values | moved | {"C_A": float(np.exp(found.x[4])), "C_M": float(np.exp(found.x[5]))}


def sma_react_solution(card: PooledConstants) -> dict[str, Any]:
    """Solution of SMA-REACT: Pa, K, and the ends of the law itself."""
    point = _of_react({name: np.asarray([c.value]) for name, c in card.constants.items()})
    drawn = _of_react({name: c.draws for name, c in card.constants.items()})
    return {
        "final_solution": {name: float(v[0]) for name, v in point.items()},
        "bounds": [[float(x) for x in np.quantile(v, (0.05, 0.95))] for v in drawn.values()],
        "sigma_cal": 1e6 * card.reference,
        "delta": 1e-6,
        "MVF_tol": 1e-4,
        "units": "Pa, K, 1/K, 1/Pa, Pa/K",
    }


def _of_react(c: Mapping[str, Floats]) -> dict[str, Floats]:
    first, last = ends(c["Ms"], c["Mf"], c["n1"], c["n2"])
    finish, start = ends(c["Af"], c["As"], c["n3"], c["n4"])
    return {
        "E_M": 1e6 * c["E_M"], "E_A": 1e6 * c["E_A"], "M_s": first, "M_s-M_f": first - last, "A_s": start,
        "A_f - A_s": finish - start, "C_M": 1e6 * c["C_M"], "C_A": 1e6 * c["C_A"], "H_min": c["H_min"],
        "H_max - H_min": c["H_max"] - c["H_min"], "k": 1e-6 * c["k"], "n_1": c["n1"], "n_2": c["n2"], "n_3": c["n3"],
        "n_4": c["n4"], "sig_crit": 1e6 * c["sigma_crit"], "alpha": 0.5 * (c["alpha_A"] + c["alpha_M"]),
    }  # fmt: skip


def covariance_text(constants: Mapping[str, Constant]) -> str:
    """Covariance of the draws as CSV, names in the first row and column."""
    names = list(constants)
    matrix = np.cov(np.stack([constants[n].draws for n in names]))
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(["", *names])
    for name, row in zip(names, matrix, strict=True):
        writer.writerow([name, *(f"{v:.9g}" for v in row)])
    return out.getvalue()
