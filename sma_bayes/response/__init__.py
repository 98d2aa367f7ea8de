"""Response models: what a spring does at a temperature."""

from sma_bayes.catalogue import Catalogue
from sma_bayes.response.modified_sigmoid import ModifiedSigmoid

RESPONSE_MODELS: Catalogue[type[ModifiedSigmoid]] = Catalogue(
    "response model", {ModifiedSigmoid.name: ModifiedSigmoid}, entry_point_group="sma_bayes.response"
)

__all__ = ["RESPONSE_MODELS", "ModifiedSigmoid"]
