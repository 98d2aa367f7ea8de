"""Response models: what a spring does at a temperature."""

from sma_bayes.catalogue import Catalogue
from sma_bayes.response.base import Asymptote, ResponseModel
from sma_bayes.response.bounded_logistic import BoundedLogistic
from sma_bayes.response.logistic import Logistic
from sma_bayes.response.modified_sigmoid import ModifiedSigmoid
from sma_bayes.response.polynomial import Polynomial
from sma_bayes.response.tied_sigmoid import TiedSigmoid

RESPONSE_MODELS: Catalogue[type[ResponseModel]] = Catalogue(
    "response model",
    {m.name: m for m in (ModifiedSigmoid, TiedSigmoid, Logistic, BoundedLogistic, Polynomial)},
    entry_point_group="sma_bayes.response",
)

__all__ = [
    "RESPONSE_MODELS",
    "Asymptote",
    "BoundedLogistic",
    "Logistic",
    "ModifiedSigmoid",
    "Polynomial",
    "ResponseModel",
    "TiedSigmoid",
]
