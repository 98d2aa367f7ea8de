"""Response models: what a spring does at a temperature."""

from collections.abc import Sequence
from pathlib import Path

from sma_bayes.catalogue import Catalogue, not_a
from sma_bayes.parameters.priors_file import PriorSet, read_priors, shipped_priors
from sma_bayes.response.base import Asymptote, ResponseModel
from sma_bayes.response.bounded_logistic import BoundedLogistic
from sma_bayes.response.logistic import Logistic
from sma_bayes.response.modified_sigmoid import ModifiedSigmoid
from sma_bayes.response.modulus import (
    ModulusPeak,
    ModulusPeakSkew,
    ModulusPeakSlopes,
    ModulusSkew,
    ModulusSlopes,
    ModulusTwoStage,
)
from sma_bayes.response.phase_slopes import PhaseSlopes
from sma_bayes.response.polynomial import Polynomial
from sma_bayes.response.sinh_arcsinh import SinhArcsinh, SinhArcsinhSlopes
from sma_bayes.response.tied_sigmoid import TiedSigmoid
from sma_bayes.response.two_stage import TwoStage

RESPONSE_MODELS: Catalogue[type[ResponseModel]] = Catalogue(
    "response model",
    {
        m.name: m
        for m in (
            ModifiedSigmoid,
            PhaseSlopes,
            SinhArcsinh,
            SinhArcsinhSlopes,
            TwoStage,
            TiedSigmoid,
            Logistic,
            Polynomial,
            BoundedLogistic,
            ModulusSlopes,
            ModulusSkew,
            ModulusTwoStage,
            ModulusPeak,
            ModulusPeakSlopes,
            ModulusPeakSkew,
        )
    },
    entry_point_group="sma_bayes.response",
    fault=not_a(type, "name"),
)

DEFAULT_MODEL = ModifiedSigmoid.name
"""Model that is fitted where none is named."""


AUTO_MODEL = "auto"
"""Name of the choice among the models of the ladder."""


STORAGE_LADDER: tuple[type[ResponseModel], ...] = (
    BoundedLogistic,
    ModulusSlopes,
    ModulusSkew,
    ModulusPeakSlopes,
    ModulusTwoStage,
)
"""Models of a storage modulus, simplest first."""
LOSS_LADDER: tuple[type[ResponseModel], ...] = (ModulusPeak, ModulusPeakSlopes, ModulusPeakSkew)
"""Models of a loss modulus, simplest first."""


def ladder(channels: Sequence[str]) -> tuple[type[ResponseModel], ...]:
    """Models that contain the published curve and can be fitted to these channels, simplest first."""
    found = [m for m in RESPONSE_MODELS.values() if m.rung > 0 and not m.refusal(channels)]
    return tuple(sorted(found, key=lambda m: m.rung))


def priors_named(name: str | Path) -> PriorSet:
    """Priors by the name of a shipped set, or of a response model that brings its own, or by their file.

    Raises
    ------
    PriorError
        If there are none of that name.
    """
    if name not in shipped_priors() and name in RESPONSE_MODELS:
        return RESPONSE_MODELS[str(name)].default_priors()
    return read_priors(name)


__all__ = [
    "AUTO_MODEL",
    "DEFAULT_MODEL",
    "LOSS_LADDER",
    "RESPONSE_MODELS",
    "STORAGE_LADDER",
    "Asymptote",
    "BoundedLogistic",
    "Logistic",
    "ModifiedSigmoid",
    "ModulusPeak",
    "ModulusPeakSkew",
    "ModulusPeakSlopes",
    "ModulusSkew",
    "ModulusSlopes",
    "ModulusTwoStage",
    "PhaseSlopes",
    "Polynomial",
    "ResponseModel",
    "SinhArcsinh",
    "SinhArcsinhSlopes",
    "TiedSigmoid",
    "TwoStage",
    "ladder",
    "priors_named",
]
