"""Noise models: how observations scatter about the response."""

from __future__ import annotations

from sma_bayes.catalogue import Catalogue, not_a
from sma_bayes.errors import UnknownNameError, near_matches
from sma_bayes.noise.ar1 import AR1
from sma_bayes.noise.ar1_time import AR1Time
from sma_bayes.noise.base import NoiseModel, Steps
from sma_bayes.noise.effective_samples import EffectiveSamples
from sma_bayes.noise.heteroscedastic import WRAPPERS
from sma_bayes.noise.independent import Independent
from sma_bayes.noise.rounded import Rounded
from sma_bayes.noise.student_t import StudentTNoise


class NoiseCatalogue(Catalogue[NoiseModel]):
    """Noise models by name; a name may go on with ``+growing`` and ``+temperature_error``."""

    def __getitem__(self, name: str) -> NoiseModel:
        series, *others = name.split("+")
        model = super().__getitem__(series)
        if others and model.stands_alone:
            raise UnknownNameError(
                f"no noise model is called {name!r}", expected=f"{series}, to which nothing can be added"
            )
        for suffix, wrapper in WRAPPERS.items():
            if suffix in others:
                model = wrapper(model)
        unknown = [o for o in others if o not in WRAPPERS]
        if unknown or len(set(others)) < len(others):
            raise UnknownNameError(
                f"no noise model is called {name!r}",
                expected=f"a series with any of +{', +'.join(WRAPPERS)}, each once; "
                + near_matches((unknown or others)[0], WRAPPERS),
            )
        return model

    def __contains__(self, name: object) -> bool:
        try:
            return isinstance(name, str) and bool(self[name])
        except UnknownNameError:
            return False


NOISE_MODELS = NoiseCatalogue(
    "noise model",
    {
        model.name: model
        for model in (
            Independent(),
            AR1(),
            AR1Time(),
            StudentTNoise(),
            StudentTNoise(AR1()),
            StudentTNoise(AR1Time()),
            Rounded(),
            EffectiveSamples(),
        )
    },
    entry_point_group="sma_bayes.noise",
    fault=not_a(NoiseModel, "name"),
)

__all__ = ["NOISE_MODELS", "NoiseModel", "Steps"]
