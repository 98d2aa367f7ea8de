"""How much a stress raises the transformation temperatures, for the effects in which it does.

Clausius-Clapeyron coefficients of NiTi lie near 5 to 10 MPa/K: Otsuka and Ren, Physical metallurgy of Ti-Ni-based
shape memory alloys, Progress in Materials Science 50 (2005) 511-678; the entropy of 0.105 J/(g K) in Resnina and
Belyaev, Thermochimica Acta 602 (2015) 30-35, gives the same. In a spring of wire d and mean coil diameter D a force
makes the shear stress ``8 D/(pi d**3)`` a newton, 20 to 60 MPa for the usual 0.5 to 1 mm wire.
"""

from __future__ import annotations

from typing import Final

from sma_bayes.effects.types import Scales
from sma_bayes.parameters.distributions import LogNormal
from sma_bayes.parameters.space import Parameter

REFERENCE: Final = (
    "Clausius-Clapeyron coefficient of NiTi, 5-10 MPa/K: Otsuka and Ren, Prog. Mater. Sci. 50 (2005) 511-678"
)


def coefficient(scales: Scales, of: str) -> Parameter:
    """Shift of the transformation by a load or force.

    Parameters
    ----------
    scales : Scales
    of : {"load", "force"}
    """
    unit = scales.units["force"] if of == "force" else ("Pa" if scales.specimen else "N")
    if unit == "Pa":
        prior, source = LogNormal(1.4e-7, 0.4), "5-10 MPa/K, 90 % between 3.7 and 14 MPa/K"
    elif unit == "N":
        prior, source = (
            LogNormal(1.0, 1.6),
            "the same with 8 D/(pi d^3) of springs, 90 % between 0.4 and 22 K/N",
        )
    else:
        prior, source = LogNormal(5.0 / scales.level[of], 1.2), "some 5 K at the greatest force"
    return Parameter("c", f"K/{unit}", f"rise of the transformation temperatures a {of}", prior, source)
