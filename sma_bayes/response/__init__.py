"""Response models: what a spring does at a temperature."""

from sma_bayes.catalogue import Catalogue
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
            BoundedLogistic,
            Polynomial,
        )
    },
    entry_point_group="sma_bayes.response",
)

__all__ = [
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
]
