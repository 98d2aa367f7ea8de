"""What every effect of the catalogue has to keep.

Effects of other installed packages are tried like those that ship; ``-k NAME`` tries one of them.
"""

from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from pint import UnitRegistry

import sma_bayes.effects as package
from sma_bayes.arrays import Floats
from sma_bayes.effects import EFFECTS, Effect, Scales, with_effects
from sma_bayes.effects.needs import NEEDS, untestable
from sma_bayes.parameters.distributions import LogNormal
from sma_bayes.records.history import History
from sma_bayes.studies.gap.scatter import members_of

from .conftest import THETA, response_at

IDS = (
    "thermocouple_lag", "contact_error", "stress_shift", "branch_stress_shift", "stress_stroke",
    "dead_load", "path_stress_shift", "rate_dependence",
    "temperature_gradient", "asymmetric_kinetics", "r_phase", "training_drift", "training", "amplitude_fatigue",
    "hot_creep", "guide_friction", "sensor_drift", "load_cell_thermal_drift", "thermal_expansion", "fixture_compliance",
    "bias_spring", "saturation", "quantisation", "drive_ripple", "minor_loop", "clock_skew", "latent_heat",
    "ambient_draught", "convective_loss", "radiative_loss", "phase_resistance", "second_mass",
    "run_offset", "cycle_offset",
)  # fmt: skip
SHARED = {"__init__", "needs", "types", "transformation", "memory", "stress", "scatter"}
REGISTRY = UnitRegistry(cache_folder=None)

SHIPPED = tuple(n for n, effect in EFFECTS.items() if type(effect).__module__.startswith("sma_bayes."))

each = pytest.mark.parametrize("name", EFFECTS)


def scales_for(name: str, measured: tuple[History, ...], suited: Mapping[str, tuple[History, ...]]) -> Scales:
    return Scales.of(suited.get(name, measured))


def quantiles(effect: Effect, scales: Scales, p: Floats) -> Floats:
    """Parameters at quantiles of their priors, p (..., P) to theta (..., P)."""
    priors = [q.prior for q in effect.parameters(scales)]
    return np.stack([prior.quantile(p[..., i]) for i, prior in enumerate(priors)], axis=-1)


def count(effect: Effect, scales: Scales) -> int:
    return len(effect.parameters(scales))


def test_the_catalogue_is_whole_and_in_order() -> None:
    assert SHIPPED == IDS


def test_every_file_is_listed() -> None:
    folder = Path(package.__file__).parent
    assert {p.stem for p in folder.glob("*.py")} - SHARED == set(IDS)


@pytest.mark.parametrize("name", IDS)
def test_an_effect_lives_in_the_file_of_its_name(name: str) -> None:
    kind = type(EFFECTS[name])
    assert kind.__module__ == f"sma_bayes.effects.{name}"
    assert kind.__name__ == "".join(word.capitalize() for word in name.split("_"))
    assert find_spec(kind.__module__) is not None


@each
def test_what_it_says_of_itself(name: str, measured, suited) -> None:
    effect = EFFECTS[name]
    assert effect.title
    assert effect.equation
    assert len(effect.reference) > 20
    assert set(effect.needs) <= set(NEEDS)
    parameters = effect.parameters(scales_for(name, measured, suited))
    random = members_of(effect)
    assert 1 <= len(parameters) <= (100 if random else 6)
    for p in parameters:
        assert p.meaning
        assert p.source
        assert (
            random
            or p.name in effect.equation
            or f"{p.name.rstrip('0123456789')}_i" in effect.equation
            or name
            in (
                "quantisation",
                "fixture_compliance",
                "load_cell_thermal_drift",
            )
        )
        assert p.unit == "1" or REGISTRY.Unit(p.unit) is not None


@each
def test_its_needs_are_met_where_everything_was_varied(name: str, measured, suited) -> None:
    assert untestable(EFFECTS[name].needs, suited.get(name, measured)) == ""


@each
def test_nothing_happens_at_size_0(name: str, measured, suited) -> None:
    effect, scales = EFFECTS[name], scales_for(name, measured, suited)
    theta = quantiles(effect, scales, np.full(count(effect, scales), 0.3))
    theta[0] = 0.0
    response, inputs = response_at(THETA), measured[1].inputs
    plain, out = response(inputs), effect.apply(response, theta, inputs)
    assert set(out) == set(plain)
    for channel, values in plain.items():
        size = float(np.max(np.abs(values)))
        if name in ("thermocouple_lag", "contact_error") and channel == "temperature":
            size *= 1e3  # begins at the reading, which is read back through the lag
        np.testing.assert_allclose(out[channel], values, rtol=0.0, atol=1e-12 * size)


@pytest.mark.parametrize("inner", ["load_cell_thermal_drift", "bias_spring", "asymmetric_kinetics"])
def test_a_range_ends_after_all_else_whatever_was_found_first(inner: str, measured, suited) -> None:
    """The load cell cuts off what the drift of its zero has added."""
    inputs, response = measured[1].inputs, response_at(THETA)
    effect, scales = EFFECTS[inner], scales_for(inner, measured, suited)
    one = effect, quantiles(effect, scales, np.full(count(effect, scales), 0.7))
    changed = with_effects(response, [one])(inputs)["force"]
    end = float(np.median(changed))
    cut = EFFECTS["saturation"], np.array([0.9, end])
    expected = changed - 0.9 * np.maximum(changed - end, 0.0)
    for order in ([one, cut], [cut, one]):
        np.testing.assert_allclose(with_effects(response, order)(inputs)["force"], expected)


@each
def test_it_fades_with_its_size(name: str, measured, suited) -> None:
    effect, scales = EFFECTS[name], scales_for(name, measured, suited)
    theta = quantiles(effect, scales, np.full(count(effect, scales), 0.3))
    small = np.array([1e-6 * theta[0], *theta[1:]])
    response, inputs = response_at(THETA), measured[1].inputs
    plain, out, full = response(inputs), *(effect.apply(response, t, inputs) for t in (small, theta))
    for channel, values in plain.items():
        limit = 1e-3 * np.max(np.abs(full[channel] - values)) + 1e-9 * np.max(np.abs(values))
        assert np.max(np.abs(out[channel] - values)) <= limit


@each
def test_a_batch_is_its_members_and_all_is_finite(name: str, measured, suited) -> None:
    effect, scales = EFFECTS[name], scales_for(name, measured, suited)
    n = count(effect, scales)
    rng = np.random.default_rng(5)
    corners = np.where(rng.random((8, n)) < 0.5, 1e-6, 1.0 - 1e-6)
    p = np.concatenate([rng.random((4, n)), np.full((1, n), 1e-6), np.full((1, n), 1.0 - 1e-6), corners])
    theta = quantiles(effect, scales, p)
    base = THETA * rng.uniform(0.95, 1.05, (len(theta), THETA.size))
    inputs = measured[2].inputs
    together = effect.apply(response_at(base), theta, inputs)
    for channel, values in together.items():
        assert values.shape == (len(theta), measured[2].n), channel
        assert np.all(np.isfinite(values)), channel
    for i in range(len(theta)):
        alone = effect.apply(response_at(base[i]), theta[i], inputs)
        for channel, values in alone.items():
            size = max(float(np.max(np.abs(values))), 1e-12)
            np.testing.assert_allclose(together[channel][i], values, rtol=1e-9, atol=1e-9 * size)


@each
def test_it_takes_inputs_with_a_leading_shape(name: str, measured, suited) -> None:
    effect, scales = EFFECTS[name], scales_for(name, measured, suited)
    theta = quantiles(effect, scales, np.full((3, count(effect, scales)), 0.6))
    inputs = dict(measured[0].inputs)
    many = {**inputs, "temperature": inputs["temperature"] + np.zeros((3, 1))}
    base = np.tile(THETA, (3, 1))
    one = effect.apply(response_at(base), theta, inputs)
    other = effect.apply(response_at(base), theta, many)
    for channel, values in one.items():
        np.testing.assert_allclose(other[channel], values, rtol=1e-9)


@each
def test_it_is_smooth_in_its_parameters(name: str, measured, suited) -> None:
    """A second difference shrinks with the square of the step, up to rare kinks."""
    effect, scales = EFFECTS[name], scales_for(name, measured, suited)
    n = count(effect, scales)
    priors = [p.prior for p in effect.parameters(scales)]
    middle = np.array([float(q.transform.unconstrain(q.quantile(np.array(0.6)))) for q in priors])
    spread = np.array(
        [
            abs(float(q.transform.unconstrain(q.quantile(np.array(0.84)))) - m)
            for q, m in zip(priors, middle, strict=True)
        ]
    )
    response, inputs = response_at(THETA), measured[0].inputs

    def at(z: Floats) -> Floats:
        theta = np.array([float(q.transform.constrain(np.array(v))) for q, v in zip(priors, z, strict=True)])
        out = effect.apply(response, theta, inputs)
        return np.concatenate([out[c] / np.ptp(response(inputs)[c]) for c in out])

    for i in range(n):
        step = np.zeros(n)
        step[i] = 1e-3 * spread[i]
        up, here, down = at(middle + step), at(middle), at(middle - step)
        bend = np.abs(up - 2.0 * here + down)
        slope = np.max(np.abs(up - down))
        assert np.quantile(bend, 0.98) <= 0.05 * slope + 1e-9


@each
def test_its_signature_is_seen(name: str, measured, suited) -> None:
    effect, scales = EFFECTS[name], scales_for(name, measured, suited)
    theta = quantiles(effect, scales, np.full(count(effect, scales), 0.7))
    changes = []
    for h in measured:
        plain, out = response_at(THETA)(h.inputs), effect.apply(response_at(THETA), theta, h.inputs)
        changes += [np.max(np.abs(out[c] - plain[c])) / np.ptp(plain[c]) for c in plain]
    assert max(changes) > 1e-5


def test_effects_nest_in_any_order(measured, suited) -> None:
    """Neither plateaus far away nor finite differences upset an effect inside."""
    effects = [EFFECTS[name] for name in IDS]
    values = []
    for effect in effects:
        scales = scales_for(effect.id, measured, suited)
        values.append(quantiles(effect, scales, np.full(count(effect, scales), 0.6)))
    inputs = measured[0].inputs
    plain = response_at(THETA)(inputs)
    for inner in (EFFECTS["thermal_expansion"], EFFECTS["hot_creep"], EFFECTS["load_cell_thermal_drift"]):
        theta = values[IDS.index(inner.id)]
        for outer, outer_theta in zip(effects, values, strict=True):
            if outer is inner:
                continue
            out = with_effects(response_at(THETA), [(inner, theta), (outer, outer_theta)])(inputs)
            alone = outer.apply(response_at(THETA), outer_theta, inputs)
            first = inner.apply(response_at(THETA), theta, inputs)
            for c in ("force", "displacement"):
                expected = alone[c] + first[c] - plain[c]
                assert np.max(np.abs(out[c] - expected)) < 0.25 * np.ptp(plain[c]), (inner.id, outer.id)


def test_sizes_are_positive_or_of_either_sign(measured, suited) -> None:
    for name in IDS:
        size = EFFECTS[name].parameters(scales_for(name, measured, suited))[0].prior
        assert isinstance(size, LogNormal) or abs(float(size.quantile(np.array(0.5)))) <= 0.7
