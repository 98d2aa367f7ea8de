"""What each erratum amounts to, recomputed from the printed tables and equations."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from sma_bayes.paper.effects import equations, fits, rig
from sma_bayes.paper.effects.amount import Amount, Effect

EFFECTS: Final[Mapping[str, Effect]] = MappingProxyType({**equations.EFFECTS, **fits.EFFECTS, **rig.EFFECTS})
"""Effects by id of the erratum; those without one are notes."""

__all__ = ["EFFECTS", "Amount", "Effect"]
