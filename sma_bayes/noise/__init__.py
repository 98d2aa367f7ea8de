"""Noise models: how observations scatter about the response."""

from sma_bayes.catalogue import Catalogue
from sma_bayes.noise.ar1 import AR1
from sma_bayes.noise.ar1_time import AR1Time
from sma_bayes.noise.effective_samples import EffectiveSamples
from sma_bayes.noise.independent import Independent
from sma_bayes.noise.student_t import StudentT
from sma_bayes.noise.types import NoiseModel, Steps

NOISE_MODELS: Catalogue[NoiseModel] = Catalogue(
    "noise model",
    {model.name: model for model in (Independent(), AR1(), AR1Time(), StudentT(), EffectiveSamples())},
    entry_point_group="sma_bayes.noise",
)

__all__ = ["NOISE_MODELS", "NoiseModel", "Steps"]
