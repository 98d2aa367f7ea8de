"""Response models: what a spring does at a temperature."""

from pathlib import Path

from sma_bayes.catalogue import Catalogue
from sma_bayes.parameters.priors_file import PriorSet, read_priors, shipped_priors
from sma_bayes.response.base import Asymptote, ResponseModel
from sma_bayes.response.bounded_logistic import BoundedLogistic
from sma_bayes.response.logistic import Logistic
from sma_bayes.response.modified_sigmoid import ModifiedSigmoid
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
        )
    },
    entry_point_group="sma_bayes.response",
)

DEFAULT_MODEL = ModifiedSigmoid.name
"""Model that is fitted where none is named."""


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
    "DEFAULT_MODEL",
    "RESPONSE_MODELS",
    "Asymptote",
    "BoundedLogistic",
    "Logistic",
    "ModifiedSigmoid",
    "PhaseSlopes",
    "Polynomial",
    "ResponseModel",
    "SinhArcsinh",
    "SinhArcsinhSlopes",
    "TiedSigmoid",
    "TwoStage",
    "priors_named",
]
