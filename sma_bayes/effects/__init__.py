"""Physical effects that a plain modified sigmoid may miss."""

from sma_bayes.catalogue import Catalogue, not_a
from sma_bayes.effects.ambient_draught import AmbientDraught
from sma_bayes.effects.amplitude_fatigue import AmplitudeFatigue
from sma_bayes.effects.asymmetric_kinetics import AsymmetricKinetics
from sma_bayes.effects.bias_spring import BiasSpring
from sma_bayes.effects.branch_stress_shift import BranchStressShift
from sma_bayes.effects.clock_skew import ClockSkew
from sma_bayes.effects.contact_error import ContactError
from sma_bayes.effects.convective_loss import ConvectiveLoss
from sma_bayes.effects.cycle_offset import CycleOffset
from sma_bayes.effects.dead_load import DeadLoad
from sma_bayes.effects.drive_ripple import DriveRipple
from sma_bayes.effects.fixture_compliance import FixtureCompliance
from sma_bayes.effects.guide_friction import GuideFriction
from sma_bayes.effects.hot_creep import HotCreep
from sma_bayes.effects.latent_heat import LatentHeat
from sma_bayes.effects.load_cell_thermal_drift import LoadCellThermalDrift
from sma_bayes.effects.minor_loop import MinorLoop
from sma_bayes.effects.path_stress_shift import PathStressShift
from sma_bayes.effects.phase_resistance import PhaseResistance
from sma_bayes.effects.quantisation import Quantisation
from sma_bayes.effects.r_phase import RPhase
from sma_bayes.effects.radiative_loss import RadiativeLoss
from sma_bayes.effects.rate_dependence import RateDependence
from sma_bayes.effects.run_offset import RunOffset
from sma_bayes.effects.saturation import Saturation
from sma_bayes.effects.second_mass import SecondMass
from sma_bayes.effects.sensor_drift import SensorDrift
from sma_bayes.effects.stress_shift import StressShift
from sma_bayes.effects.stress_stroke import StressStroke
from sma_bayes.effects.temperature_gradient import TemperatureGradient
from sma_bayes.effects.thermal_expansion import ThermalExpansion
from sma_bayes.effects.thermocouple_lag import ThermocoupleLag
from sma_bayes.effects.training import Training
from sma_bayes.effects.training_drift import TrainingDrift
from sma_bayes.effects.types import Effect, Scales, with_effects
from sma_bayes.parameters.space import Parameter

_SHIPPED: tuple[Effect, ...] = (
    ThermocoupleLag(),
    ContactError(),
    StressShift(),
    BranchStressShift(),
    StressStroke(),
    DeadLoad(),
    PathStressShift(),
    RateDependence(),
    TemperatureGradient(),
    AsymmetricKinetics(),
    RPhase(),
    TrainingDrift(),
    Training(),
    AmplitudeFatigue(),
    HotCreep(),
    GuideFriction(),
    SensorDrift(),
    LoadCellThermalDrift(),
    ThermalExpansion(),
    FixtureCompliance(),
    BiasSpring(),
    Saturation(),
    Quantisation(),
    DriveRipple(),
    MinorLoop(),
    ClockSkew(),
    LatentHeat(),
    AmbientDraught(),
    ConvectiveLoss(),
    RadiativeLoss(),
    PhaseResistance(),
    SecondMass(),
    RunOffset(),
    CycleOffset(),
)
EFFECTS: Catalogue[Effect] = Catalogue(
    "effect",
    {effect.id: effect for effect in _SHIPPED},
    entry_point_group="sma_bayes.effects",
    fault=not_a(object, "id"),
)

__all__ = ["EFFECTS", "Effect", "Parameter", "Scales", "with_effects"]
