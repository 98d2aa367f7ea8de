"""A modulus against temperature as dynamic mechanical analysis measures it: one bounded curve, never Eq. (7).

    u = T - midpoint
    E = (1 - s) (cold + cold_slope u) + s (cold + span + hot_slope u) + 4 peak s (1 - s)

``s`` is the share of the transformation that has passed: logistic, skewed or in two stages. Without slopes and peak
this is `BoundedLogistic`. The last term is proportional to ``ds/dT`` where ``s`` is logistic. A storage modulus softens
there: that of NiTi has a minimum in the transformation [1]_, [2]_, so its peak is negative. The damping of a
martensitic transformation has a maximum there whose height follows the rate of the transformation, and each phase has a
damping of its own, greater in martensite [1]_, [3]_: a peak above a step. The loss peak of a glass transition has that
shape as far as its share is logistic.

References
----------
.. [1] H. C. Lin, S. K. Wu, M. T. Yeh, Damping characteristics of TiNi shape memory alloys, Metallurgical Transactions A
   24 (1993) 2189.
.. [2] S. H. Chang, S. K. Wu, Damping characteristics of cold-rolled and annealed equiatomic TiNi shape memory alloy,
   Key Engineering Materials 319 (2006) 9, doi:10.4028/www.scientific.net/KEM.319.9.
.. [3] C. Remillat, M. R. Hassan, F. Scarpa, Small amplitude dynamic properties of Ni48Ti46Cu6 SMA ribbons: experimental
   results and modelling, Journal of Engineering Materials and Technology 128 (2006) 260, doi:10.1115/1.2204949.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.parameters.roles import Role
from sma_bayes.response.phase_lines import LineDerivatives, Parameters, PhaseLines, Share
from sma_bayes.response.phase_slopes import PhaseSlopes
from sma_bayes.response.sinh_arcsinh import SinhArcsinhSlopes
from sma_bayes.response.two_stage import TwoStage


@dataclass(frozen=True)
class _Modulus(PhaseLines):
    """A modulus that was measured itself."""

    channels: tuple[str, ...] = ("stiffness",)
    provides = ("stiffness",)
    rung = 0
    letters: ClassVar[Mapping[str, str]] = {"stiffness": ""}
    own: ClassVar[Mapping[str, Role]] = {
        "cold": Role.OFFSET,
        "span": Role.SPAN,
        "rate": Role.RATE,
        "midpoint": Role.MIDPOINT,
    }

    @classmethod
    def refusal(cls, channels: Sequence[str]) -> str:
        """What is no modulus or stiffness is refused."""
        return super(PhaseLines, cls).refusal(channels)

    @classmethod
    def _wanted(cls) -> str:
        return "a modulus or stiffness alone"


@dataclass(frozen=True)
class ModulusSlopes(_Modulus, PhaseSlopes):
    """Logistic transformation between the sloped lines of two phases."""

    name = "modulus_slopes"
    reference = "logistic between sloped phases"


@dataclass(frozen=True)
class ModulusSkew(_Modulus, SinhArcsinhSlopes):
    """Asymmetric transformation with free tails between the sloped lines of two phases."""

    name = "modulus_skew"
    reference = "sinh-arcsinh transformation between sloped phases"


@dataclass(frozen=True)
class ModulusTwoStage(_Modulus, TwoStage):
    """Two stages, as through the R-phase, between the sloped lines of two phases."""

    name = "modulus_two_stage"
    reference = "two logistic stages between sloped phases"


@dataclass(frozen=True)
class _Peaked(_Modulus):
    """With a peak, or where its height is negative a minimum, in the transformation."""

    def value(self, p: Parameters, u: Floats) -> Floats:
        """See `PhaseLines.value`."""
        s = self.passed(p, u)
        return np.asarray(super().value(p, u) + 4.0 * p[Role.EFFECT] * s * (1.0 - s))

    def _between(self, p: Parameters, u: Floats, share: Share) -> LineDerivatives:
        line = super()._between(p, u, share)
        s, ds, dds, height = share.value, share.first, share.second, p[Role.EFFECT]
        bend = 4.0 * (1.0 - 2.0 * s)
        first = line.first + height * bend * ds
        second = line.second + height * (bend * dds - 8.0 * ds * ds)
        by = []
        for (value, change), (_, role) in zip(line.by, self._roles, strict=True):
            if role is Role.MIDPOINT:
                by.append((-first, -second))
            elif role is Role.EFFECT:
                by.append((4.0 * s * (1.0 - s), bend * ds))
            elif role in share.by:
                own, of_slope = share.by[role]
                moved = height * (bend * of_slope - 8.0 * own * ds)
                by.append((value + height * bend * own, change + moved))
            else:
                by.append((value, change))
        return LineDerivatives(first, second, tuple(by), p, u)


_PEAK: Mapping[str, str] = {Role.EFFECT: "height of the peak"}


@dataclass(frozen=True)
class ModulusPeakSlopes(_Peaked, PhaseSlopes):
    """Peak above a logistic step between the sloped lines of two phases."""

    name = "modulus_peak_slopes"
    reference = "logistic between sloped phases, and a peak in the transformation"
    shape: ClassVar[tuple[Role, ...]] = (Role.EFFECT,)
    meanings = _PEAK


@dataclass(frozen=True)
class ModulusPeak(ModulusPeakSlopes):
    """Peak above a logistic step between two level phases."""

    name = "modulus_peak"
    reference = "logistic between level phases, and a peak in the transformation"
    sloped = False


@dataclass(frozen=True)
class ModulusPeakSkew(_Peaked, SinhArcsinhSlopes):
    """Peak above an asymmetric step between the sloped lines of two phases."""

    name = "modulus_peak_skew"
    reference = "sinh-arcsinh transformation between sloped phases, and a peak in it"
    shape: ClassVar[tuple[Role, ...]] = (*SinhArcsinhSlopes.shape, Role.EFFECT)
    meanings = {**SinhArcsinhSlopes.meanings, **_PEAK}  # noqa: RUF012
