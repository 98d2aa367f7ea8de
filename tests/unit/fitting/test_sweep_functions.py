"""What each sweep has of its own beside curve and discrepancy."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal, t as student_t

from sma_bayes.arrays import Floats
from sma_bayes.assess.bands import credible_band
from sma_bayes.assess.held_out import own_of, part
from sma_bayes.fitting.discrepancy import DiscrepancyBasis
from sma_bayes.fitting.discrepancy_weights import Whitened
from sma_bayes.fitting.fit import Fit
from sma_bayes.fitting.fit_records import fit_records
from sma_bayes.fitting.noise_choice import choose_noise
from sma_bayes.fitting.normal_equations import NormalEquations
from sma_bayes.fitting.posterior import build_posterior
from sma_bayes.fitting.sweep_functions import MAX_SWEEPS, SweepFunctions, sweeps_of
from sma_bayes.fitting.warm_start import warm_start
from sma_bayes.noise import NOISE_MODELS, Steps
from sma_bayes.parameters.priors_file import read_priors
from sma_bayes.records.types import Branch, Condition, Record

DEFAULT = read_priors("modified_sigmoid")
SWEEPS, SAMPLES = 5, 40


def measured(seed: int, apart: float = 1.0, sweeps: int = SWEEPS) -> Record:
    """Sweeps of a hyperbolic tangent; each has an offset, a stroke and a place of its own."""
    rng = np.random.default_rng([seed, 77])
    t = np.linspace(20.0, 80.0, SAMPLES)
    own = apart * rng.standard_normal((sweeps, 3))
    x = np.concatenate([curve(t, *each) for each in own]) + 1e-4 * rng.standard_normal(sweeps * SAMPLES)
    segment = np.repeat(np.arange(float(sweeps)), SAMPLES)
    inputs = {"temperature": np.tile(t, sweeps), "time": np.arange(float(x.size)), "segment": segment}
    units = {"temperature": "degC", "displacement": "m", "time": "s"}
    return Record(Condition("a"), Branch.HEATING, inputs, {"displacement": x}, np.arange(x.size) + 2, units)


def curve(t: Floats, offset: float = 0.0, stroke: float = 0.0, place: float = 0.0) -> Floats:
    """Displacement [m], and what standard normal numbers do to it: 0.3 mm, 0.6 mm of 18, 0.8 K."""
    return 1e-3 * (
        2.0 + 0.3 * offset + (9.0 + 0.3 * stroke) * (1.0 + np.tanh(0.13 * (t - 48.0 - 0.8 * place)))
    )


@pytest.fixture(scope="module")
def fit() -> Fit:
    return fit_records([measured(1, apart=2.0)], DEFAULT)


def basis_of(record: Record, sum_to_zero: bool = False) -> DiscrepancyBasis:
    nodes = np.linspace(20.0, 80.0, 31)
    values = np.stack([np.sin(0.1 * k * nodes) for k in (1, 2, 3)], axis=1)
    own = SweepFunctions.of(record.inputs, nodes, tangents(record.temperature), tangents(nodes))
    assert own is not None
    own = replace(own, sum_to_zero=sum_to_zero)
    return replace(DiscrepancyBasis.tabulated(nodes, values, record.temperature), sweep_functions=own)


def weights_of_sweeps(own: SweepFunctions) -> Floats:
    """Covariance of the weights of all sweeps relative to their variance, shape (S q, S q)."""
    sweeps = len(own.parts)
    apart = np.eye(sweeps) - (1.0 / sweeps if own.sum_to_zero else 0.0)
    return np.kron(apart, np.eye(len(own.samples)))


SUM_TO_ZERO = pytest.mark.parametrize(
    "sum_to_zero", [False, True], ids=["of all sweeps", "of those measured"]
)


@SUM_TO_ZERO
@pytest.mark.parametrize("even", [True, False], ids=["even", "growing"])
@pytest.mark.parametrize(("name", "shape"), [("independent", []), ("ar1", [0.7])])
def test_the_density_is_that_of_the_whole_covariance(
    name: str, shape: list[float], even: bool, sum_to_zero: bool
) -> None:
    """Sweep by sweep, against SciPy's density of all samples at once, and its conditional mean."""
    record = measured(1, sweeps=3)
    basis, rng = basis_of(record, sum_to_zero), np.random.default_rng(2)
    assert basis.sweep_functions is not None
    noise, steps, n = NOISE_MODELS[name], Steps.of(record), record.n
    scale = np.full((1, 1), 0.4) if even else rng.uniform(0.2, 0.6, (1, n))
    residual = rng.standard_normal((1, n))
    size, between = np.array([[0.3]]), np.array([0.8])
    whitened = Whitened(
        noise,
        np.array([shape]),
        steps,
        residual / scale,
        scale,
        basis.rows,
        size,
        basis.sweep_functions,
        between,
    )
    same = sweeps_of(record.inputs)[:, None] == sweeps_of(record.inputs)
    lag = np.abs(np.subtract.outer(np.arange(n), np.arange(n)))
    noisy = (
        same * (shape[0] ** lag if shape else np.eye(n)) * np.outer(*(np.broadcast_to(scale, (1, n))[0],) * 2)
    )
    own = basis.sweep_functions
    beside = (
        size[0, 0] ** 2 * basis.rows.T @ basis.rows
        + between[0] ** 2 * own.rows.T @ weights_of_sweeps(own) @ own.rows
    )
    expected = multivariate_normal(cov=noisy + beside).logpdf(residual[0])
    assert whitened.marginal_log_density()[0] == pytest.approx(expected, rel=1e-10)
    likeliest = beside @ np.linalg.solve(noisy + beside, residual[0])
    assert (whitened.likeliest_series() * scale)[0] == pytest.approx(likeliest, abs=1e-9)


@SUM_TO_ZERO
def test_weights_are_drawn_from_their_posterior(sum_to_zero: bool) -> None:
    """Means and standard deviations of 20,000 draws, each within 4.5 standard errors: one of 100,000 false."""
    record = measured(3, sweeps=3)
    basis, rng, count = basis_of(record, sum_to_zero), np.random.default_rng(4), 20_000
    assert basis.sweep_functions is not None
    e = np.tile(rng.standard_normal(record.n), (count, 1))
    whitened = Whitened(
        NOISE_MODELS["independent"], np.empty((count, 0)), Steps.of(record), e, np.ones((count, 1)),
        basis.rows, np.full((count, 1), 0.3), basis.sweep_functions, np.full(count, 0.8),
    )  # fmt: skip
    drawn = whitened.draw_weights(rng)
    own, m = basis.sweep_functions, len(basis.rows)
    every = np.concatenate([basis.rows, own.rows])
    prior = np.zeros((len(every), len(every)))
    prior[:m, :m], prior[m:, m:] = 0.3**2 * np.eye(m), 0.8**2 * weights_of_sweeps(own)
    gain = prior @ every @ np.linalg.inv(every.T @ prior @ every + np.eye(record.n))
    covariance = prior - gain @ every.T @ prior
    mean, sd = (gain @ e[0])[:m], np.sqrt(np.diag(covariance))[:m]
    assert np.abs(drawn.mean(axis=0) - mean).max() < 4.5 * sd.max() / np.sqrt(count)
    assert drawn.std(axis=0) / sd == pytest.approx(np.ones(3), abs=4.5 / np.sqrt(2.0 * count))


@SUM_TO_ZERO
def test_normal_equations_eliminate_sweeps_as_the_whole_covariance_does(sum_to_zero: bool) -> None:
    """Inner products of rows under noise and all that stands beside the curve, and the volume of that."""
    record = measured(5, sweeps=3)
    basis, rng = basis_of(record, sum_to_zero), np.random.default_rng(6)
    assert basis.sweep_functions is not None
    posterior = build_posterior([record], NOISE_MODELS["ar1"], DEFAULT)
    rows = rng.standard_normal((4, record.n))
    equations = NormalEquations(posterior, 3, (), (), np.eye(3), np.zeros(3))
    steps = Steps.of(record)
    gram, volume = equations._without_sweeps(
        rows,
        basis.rows_with_sweeps,
        np.array([[0.6]]),
        steps,
        basis.sweep_functions,
        np.array([0.5]),
        np.array([2.0]),
    )
    same = sweeps_of(record.inputs)[:, None] == sweeps_of(record.inputs)
    noisy = same * 0.6 ** np.abs(np.subtract.outer(np.arange(record.n), np.arange(record.n)))
    own = basis.sweep_functions
    whole = noisy + 0.5 * basis.rows.T @ basis.rows + 2.0 * own.rows.T @ weights_of_sweeps(own) @ own.rows
    assert gram[0] == pytest.approx(rows @ np.linalg.solve(whole, rows.T), rel=1e-8)
    more = np.linalg.slogdet(whole)[1] - np.linalg.slogdet(noisy)[1]
    assert volume[0] == pytest.approx(0.5 * more, rel=1e-9)


def test_sweeps_that_differ_are_described_as_such(fit: Fit) -> None:
    choice = fit.noise_choice
    assert choice is not None
    assert "what each sweep has of its own" in choice.reason
    assert fit.converged
    assert "displacement_between_sweeps" in fit.posterior.names
    found = np.median(fit.flat[:, fit.posterior.layout[0].between["displacement"]])
    assert 4e-4 < found < 2.4e-3  # an offset of 0.6 mm, 1.2 mm of stroke and 1.9 mm where it is steepest


@pytest.mark.parametrize("apart", [0.0, 2.0])
def test_heavy_tails_are_sought_only_where_sweeps_are_alike(apart: float) -> None:
    """Student's t with two degrees of freedom, of a tenth of what sweeps differ by."""
    record = measured(1, apart=apart)
    x = record.observed["displacement"] + 1e-4 * np.random.default_rng(5).standard_t(2.0, record.n)
    choice = fit_records([replace(record, observed={"displacement": x})], DEFAULT).noise_choice
    assert choice is not None
    assert NOISE_MODELS[choice.name].is_gaussian == (apart > 0.0)
    assert ("what each sweep has of its own" in choice.reason) == (apart > 0.0)


def test_readings_of_a_sweep_have_the_density_of_the_sweep(fit: Fit) -> None:
    """Where nothing else stands beside the curve the densities of readings add up to the likelihood."""
    posterior, theta = fit.posterior, fit.flat[::2000]
    (basis,) = posterior.discrepancy[0].values()
    nothing = replace(basis, values=basis.values * 0.0, rows=basis.rows * 0.0)
    bare = posterior.on(posterior.records, discrepancy=[{"displacement": nothing}])
    weights = ({"displacement": np.zeros((len(theta), basis.count))},)
    (each,) = bare.pointwise_log_likelihood(theta, weights)
    assert each["displacement"].sum(axis=1) == pytest.approx(bare.log_likelihood(theta), rel=1e-9)


def test_residuals_are_less_what_a_sweep_has_of_its_own(fit: Fit) -> None:
    theta, weights = fit.flat[::50], ({c: w[::50] for c, w in fit.discrepancy[0].items()},)
    (left,) = fit.posterior.residuals(theta, weights)
    (whole,) = fit.posterior.residuals(theta, weights, of_sweeps=True)
    assert np.std(left["displacement"]) < 1.2
    assert np.std(whole["displacement"]) > 1.3 * np.std(left["displacement"])


def test_replicated_sweeps_differ_as_those_that_were_measured(fit: Fit) -> None:
    theta, weights = fit.flat[::20], ({c: w[::20] for c, w in fit.discrepancy[0].items()},)
    again = fit.posterior.replicate(np.random.default_rng(0), theta, weights=weights)["displacement"]
    by_sweep = again.reshape(len(theta), SWEEPS, SAMPLES)
    seen = fit.records[0].observed["displacement"].reshape(SWEEPS, SAMPLES).std(axis=0).mean()
    assert 0.6 * seen < np.median(by_sweep.std(axis=1).mean(axis=1)) < 1.7 * seen


def test_a_posterior_that_is_made_for_other_samples_keeps_its_sweeps(fit: Fit) -> None:
    """A stretch that is left out of the middle of a sweep makes no two sweeps of it."""
    record = fit.records[0]
    kept = np.ones(record.n, dtype=bool)
    kept[50:60] = False
    rest = part(record, kept)
    assert np.unique(rest.inputs["segment"]).size == SWEEPS + 1
    (basis,) = fit.posterior.discrepancy[0].values()
    own = own_of(basis, rest)
    assert own is not None
    assert len(own.parts) == SWEEPS
    assert basis.sweep_functions is not None
    assert own.samples == pytest.approx(basis.sweep_functions.samples[:, kept])


def tangents(t: Floats) -> Floats:
    """Derivatives (n, 4) of the curve: with respect to offset, stroke, midpoint and rate."""
    share, at = 0.5 * (1.0 + np.tanh(0.13 * (t - 48.0))), t - 48.0
    return np.stack([np.ones_like(t), share, share * (1.0 - share), share * (1.0 - share) * at], axis=1)


@pytest.mark.parametrize(("sweeps", "functions"), [(1, 0), (2, 4), (MAX_SWEEPS, 4), (MAX_SWEEPS + 1, 0)])
def test_some_sweeps_have_something_of_their_own(sweeps: int, functions: int) -> None:
    """As many functions as the curve has parameters, of a mean square of one over the samples, all together."""
    inputs, nodes = measured(0, sweeps=sweeps).inputs, np.linspace(20.0, 80.0, 161)
    own = SweepFunctions.of(inputs, nodes, tangents(inputs["temperature"]), tangents(nodes))
    assert (0 if own is None else len(own.samples)) == functions
    if own is not None:
        n = own.sweep.size
        assert own.samples @ own.samples.T / n == pytest.approx(np.eye(functions) / functions, abs=1e-4)


def test_a_parameter_without_effect_and_one_with_that_of_another_make_no_function() -> None:
    inputs, nodes = measured(0).inputs, np.linspace(20.0, 80.0, 161)
    t = inputs["temperature"]
    at_samples, at_nodes = (
        np.concatenate([tangents(x), 3.0 * tangents(x)[:, :1], np.zeros((x.size, 1))], axis=1)
        for x in (t, nodes)
    )
    own = SweepFunctions.of(inputs, nodes, at_samples, at_nodes)
    assert own is not None
    assert len(own.samples) == 4
    assert SweepFunctions.of(inputs, nodes, np.zeros((t.size, 2)), np.zeros((161, 2))) is None


@pytest.mark.parametrize("seed", range(6))
def test_sweeps_that_are_alike_are_not_said_to_differ(seed: int) -> None:
    """Of sweeps that are alike it may be said in one of a hundred: all six pass but once in seventeen sets of seeds."""
    found = fit_records([measured(seed, apart=0.0)], DEFAULT)
    assert all(basis.sweep_functions is None for basis in found.posterior.discrepancy[0].values())


def of_two_channels(seed: int, apart: float, growth: float = 0.0, temperature_sd: float = 0.0) -> Record:
    """Four sweeps of force and displacement with a second step; place, width and second step are of both channels."""
    rng, t = np.random.default_rng([seed, 78]), np.linspace(20.0, 80.0, 25)
    observed: dict[str, list[Floats]] = {"force": [], "displacement": []}
    for sweep in apart * rng.standard_normal((4, 3)):
        there = t + temperature_sd * rng.standard_normal(t.size)
        for found, at, size in zip(observed.values(), (52.0, 50.0), (2.5, 0.02), strict=True):
            offset, stroke = apart * rng.standard_normal(2)
            u, share = 0.25 * np.exp(0.04 * sweep[1]) * (there - at - 0.3 * sweep[0]), 0.15 + 0.015 * sweep[2]
            x = (1.0 - share) / (1.0 + np.exp(-u)) + share / (1.0 + np.exp(-1.5 * (u + 5.0)))
            noise = 0.0025 * np.exp(growth * (x - 0.5)) * rng.standard_normal(t.size)
            found.append(size * (0.2 + 0.0075 * offset + (1.0 + 0.015 * stroke) * x + noise))
    inputs = {
        "temperature": np.tile(t, 4),
        "time": np.arange(100.0),
        "segment": np.repeat(np.arange(4.0), t.size),
    }
    units = {"temperature": "degC", "time": "s", "force": "N", "displacement": "m"}
    joined = {channel: np.concatenate(found) for channel, found in observed.items()}
    return Record(Condition("a"), Branch.HEATING, inputs, joined, np.arange(100) + 2, units)


def described_as(record: Record) -> tuple[str, bool]:
    """The noise that is chosen for a record, and whether sweeps have something of their own beside it."""
    posterior = build_posterior([record], NOISE_MODELS["independent"], DEFAULT)
    start = warm_start(posterior, np.random.default_rng(0))
    choice = choose_noise(posterior, start, DEFAULT, sweeps=True)
    bases = [basis for own in choice.bases for basis in own.values()]
    return choice.name, bool(bases) and all(basis.sweep_functions is not None for basis in bases)


def test_sweeps_that_differ_a_little_are_seldom_taken_for_noise_that_grows() -> None:
    """Shifted by 0.3 K they scatter most where the curve is steep, though no reading of a sweep does.

    Of 30 such records 25 are described as sweeps that differ: fewer than three of six once in a hundred sets of seeds.
    """
    found = [described_as(of_two_channels(seed, apart=1.0)) for seed in range(6)]
    assert sum(apart and "+" not in name for name, apart in found) >= 3


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    ("suffix", "kind"), [("growing", {"growth": 1.5}), ("temperature_error", {"temperature_sd": 0.5})]
)
def test_noise_that_grows_is_not_taken_for_sweeps_that_differ(
    seed: int, suffix: str, kind: dict[str, float]
) -> None:
    name, apart = described_as(of_two_channels(seed, apart=0.0, **kind))
    assert suffix in name
    assert not apart


def test_new_sweeps_scatter_as_the_measured_ones() -> None:
    """Weights that are exact: Student's t at each temperature, three more sweeps of the one size among them.

    Of 60,000 draws with seven degrees of freedom the ends of 90 % are known to 1 %.
    """
    own = basis_of(measured(1)).sweep_functions
    assert own is not None
    rng, count = np.random.default_rng(6), 60_000
    weights = np.array([2.0, 0.1, 0.5, 0.0])[: own.values.shape[1]] * rng.standard_normal(
        (SWEEPS, own.values.shape[1])
    )
    places = np.array([22.0, 48.0, 79.0])
    drawn = own.of_new_sweep(rng, np.tile(weights + 3.0, (count, 1, 1)), np.full(count, 0.5), places)
    apart = (weights - weights.mean(axis=0)) @ own.at(places).T
    variance = (np.sum(apart**2, axis=0) + 3.0 * 0.25 * np.sum(own.at(places) ** 2, axis=1)) / (SWEEPS + 2.0)
    for level in (0.05, 0.95):
        ends = np.sqrt(variance) * student_t.ppf(level, SWEEPS + 2.0)
        assert np.quantile(drawn, level, axis=0) == pytest.approx(ends, rel=0.04)
    assert np.corrcoef(drawn.T)[0, 1] == pytest.approx(0.0, abs=0.02)  # each reading is of another sweep


def test_new_readings_scatter_where_sweeps_do() -> None:
    """Sweeps that differ in their stroke alone agree at the cold end, where one size for all had them differ, too."""
    rng, record = np.random.default_rng(3), measured(0)
    t = record.temperature[:SAMPLES]
    strokes = 2.0 * rng.standard_normal(8)
    x = np.concatenate([curve(t, stroke=s) for s in strokes]) + 1e-5 * rng.standard_normal(8 * SAMPLES)
    segment = np.repeat(np.arange(8.0), SAMPLES)
    inputs = {"temperature": np.tile(t, 8), "time": np.arange(float(x.size)), "segment": segment}
    swept = replace(record, inputs=inputs, observed={"displacement": x}, row=np.arange(x.size) + 2)
    band = credible_band(fit_records([swept], DEFAULT, noise="independent"), "displacement")
    width = band.predictive["pred_q95"] - band.predictive["pred_q05"]
    hot = 2.0 * 1.645 * np.std([curve(t, stroke=s)[-1] for s in strokes], ddof=1)
    assert 0.7 < width[-1] / hot < 1.6
    assert width[0] < 0.5 * width[-1]


@pytest.mark.slow
def test_intervals_hold_where_sweeps_differ() -> None:
    """Of 24 records the 90 % intervals of the mean curve and of new sweeps hold 78 and 80 % and more, at the mean.

    Without what sweeps have of their own they held 46 and 63 %.
    """
    t, of_curve, of_new = np.linspace(20.0, 80.0, SAMPLES), [], []
    for seed in range(24):
        found = fit_records([measured(seed)], DEFAULT)
        band = credible_band(found, "displacement")
        truth = curve(band.temperature)
        of_curve.append(np.mean((band.curve["q05"] <= truth) & (truth <= band.curve["q95"])))
        low, high = (np.interp(t, band.temperature, band.predictive[q]) for q in ("pred_q05", "pred_q95"))
        rng = np.random.default_rng([seed, 78])
        new = np.stack([curve(t, *rng.standard_normal(3)) for _ in range(50)])
        new += 1e-4 * rng.standard_normal(new.shape)
        of_new.append(np.mean((low <= new) & (new <= high)))
    assert np.mean(of_curve) > 0.78
    assert np.mean(of_new) > 0.80
