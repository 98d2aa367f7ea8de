"""Physical effects that a plain modified sigmoid may miss."""

from sma_bayes.catalogue import Catalogue
from sma_bayes.effects.sensor_drift import SensorDrift
from sma_bayes.effects.thermocouple_lag import ThermocoupleLag
from sma_bayes.effects.types import Effect, EffectParameter, Scales, with_effects

_SHIPPED: tuple[Effect, ...] = (
    ThermocoupleLag(),
    SensorDrift(),
)
EFFECTS: Catalogue[Effect] = Catalogue(
    "effect", {effect.id: effect for effect in _SHIPPED}, entry_point_group="sma_bayes.effects"
)

__all__ = ["EFFECTS", "Effect", "EffectParameter", "Scales", "with_effects"]
