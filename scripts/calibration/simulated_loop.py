"""Strain against temperature at constant stress, by the shape memory law of `simcoon`.

`simcoon` (https://github.com/3MAH/simcoon, extra ``simcoon``) integrates the law ``SMADI`` of Y. Chemisky, A. Duval,
E. Patoor, T. Ben Zineb, "Constitutive model for shape memory alloys including phase transformation, martensitic
reorientation and twins accommodation", Mech. Mater. 43 (2011) 361, and D. Lagoudas et al., Int. J. Plasticity 32-33
(2012) 155: thermal expansion, two moduli, smooth hardening, a saturating transformation strain.
"""

from __future__ import annotations

from functools import cache
from importlib.util import find_spec

import numpy as np

from calibration.curves import Curve, tabulated

ZERO = 273.15
HOT, COLD = 420.0, 250.0
"""Ends of the simulated cycle [K]."""
_INCREMENTS = 500
_STATES = 50


def is_installed() -> bool:
    """Whether `simcoon` can be imported."""
    return find_spec("simcoon") is not None


@cache
def isobaric_cycle(stress: float, n: float, width: float) -> dict[str, Curve]:
    """Strain [1] of a wire that is cooled and heated at constant stress, against temperature [degC].

    Parameters
    ----------
    stress : float
        Axial stress [MPa].
    n : float
        Exponent of the smooth hardening in (0, 1], the same at the four ends.
    width : float
        From start to finish of either transformation without stress [K].

    Returns
    -------
    dict of str to Curve
        ``cooling`` and ``heating``.
    """
    from simcoon import solver

    law = {
        "flag": 0.0, "E_A": 67.5e3, "E_M": 42.0e3, "nu_A": 0.35, "nu_M": 0.35, "alpha_A": 1.1e-5, "alpha_M": 6.6e-6,
        "H_min": 0.0, "H_max": 0.045, "k": 0.021, "sigma_crit": 0.0, "C_A": 8.0, "C_M": 7.0,
        "Ms": 300.0, "Mf": 300.0 - width, "As": 308.0, "Af": 308.0 + width, "n1": n, "n2": n, "n3": n, "n4": n,
        "sigma_calibration": 150.0, "b_Prager": 0.0, "n_Prager": 2.0,
        "c_lambda": 1e-6, "p0_lambda": 1e-3, "n_lambda": 1.0, "alpha_lambda": 1e8,
    }  # fmt: skip

    def step(temperature: float, increments: int) -> solver.StepMeca:
        return solver.StepMeca(
            control=["stress"] * 6,
            value=[stress, 0.0, 0.0, 0.0, 0.0, 0.0],
            time=1.0,
            ninc=increments,
            T_final=temperature,
            Dn_mini=0.01,
        )

    steps = [step(HOT, 50), step(COLD, _INCREMENTS), step(HOT, _INCREMENTS)]
    found = solver.solve(
        [solver.Block(steps=steps)], "SMADI", np.array(list(law.values())), _STATES, T_init=HOT, corate=3
    )
    time, temperature, strain = found["Time"], found["Temp"] - ZERO, found["Strain"][0]
    cooling, heating = (time > 1.0 + 1e-9) & (time <= 2.0 + 1e-9), time > 2.0 + 1e-9
    return {
        "cooling": tabulated(temperature[cooling][::-1], strain[cooling][::-1]),
        "heating": tabulated(temperature[heating], strain[heating]),
    }
