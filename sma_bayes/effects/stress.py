"""How much a stress raises the transformation temperatures, for the effects in which it does.

Clausius-Clapeyron coefficients of NiTi lie near 5 to 10 MPa/K: Otsuka and Ren, Physical metallurgy of Ti-Ni-based
shape memory alloys, Progress in Materials Science 50 (2005) 511-678; the entropy of 0.105 J/(g K) in Resnina and
Belyaev, Thermochimica Acta 602 (2015) 30-35, gives the same. In a spring of wire d and mean coil diameter D a force
makes the shear stress ``8 D/(pi d**3)`` a newton, which acts like a pull of sqrt(3) times as much (von Mises). A wire
of 0.4 to 1.2 mm, coiled to 4 to 10 times its diameter, has 2 to 32 K/N, the published spring 15; a straight wire of
1 mm 0.2. A load that is declared or logged as negative raises the temperatures by its magnitude.
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
    sign = scales.direction(of)
    if unit == "Pa":
        prior, source = LogNormal(1.4e-7, 0.4, sign), "5-10 MPa/K: 90 % between 3.7 and 14 MPa/K"
    elif unit == "N":
        prior = LogNormal(4.0, 1.3, sign)
        source = "2-32 K/N with sqrt(3) 8 D/(pi d^3) of springs, less for wires: 90 % between 0.47 and 34 K/N"
    else:
        prior = LogNormal(5.0 / scales.level[of], 1.2, sign)
        source = "90 % between 0.69 and 36 K at the greatest force"
    return Parameter("c", f"K/{unit}", f"rise of the transformation temperatures a {of}", prior, source)
