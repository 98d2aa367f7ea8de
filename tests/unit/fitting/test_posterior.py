"""The posterior: records, model, noise and priors as one density."""

from __future__ import annotations

import pickle
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy import stats
from scipy.special import logsumexp

import sma_bayes.fitting.posterior as posterior_module
from sma_bayes.errors import PriorError
from sma_bayes.fitting.posterior import GREATEST_PARAMETER, Posterior, build_posterior
from sma_bayes.noise import NOISE_MODELS
from sma_bayes.parameters.priors_file import parse_priors, read_priors
from sma_bayes.records.types import Branch, Condition, Record
from sma_bayes.response.modified_sigmoid import ModifiedSigmoid

DEFAULT = read_priors("modified_sigmoid")
ALL = ("force", "displacement", "stiffness")


def build(record: Record, noise: str = "independent") -> Posterior:
    memory = [dict.fromkeys(record.channels, 5.0)]
    return build_posterior([record], NOISE_MODELS[noise], DEFAULT, memory=memory)


def near_truth(posterior: Posterior, size: int, seed: int = 0) -> np.ndarray:
    """Parameter vectors near the prior's centre, all within reach of doubles."""
    rng = np.random.default_rng(seed)
    step = rng.standard_normal((size, len(posterior.names)))
    return posterior.space.prior_centre() + 0.3 * posterior.space.prior_sd() * step


# --- the likelihood -----------------------------------------------------------------------------------


def moments_under_errors(
    p: Posterior, row: np.ndarray, channels: tuple[str, ...], spread: float
) -> tuple[np.ndarray, np.ndarray]:
    """Mean (C, n) and covariance (C, C, n) of the channels under errors of the thermometer, by a fine sum over them."""
    error = np.linspace(-8.0, 8.0, 4001)
    weight = stats.norm.pdf(error) / stats.norm.pdf(error).sum()
    t = p.records[0].temperature + spread * error[:, None]
    model_theta = np.tile(row[p.layout[0].model], (error.size, 1))
    found = p.model.predict(model_theta, {"temperature": t})
    y = np.stack([found[c] for c in channels])
    mean = np.einsum("e,cen->cn", weight, y)
    apart = y - mean[:, None]
    return mean, np.einsum("e,cen,den->cdn", weight, apart, apart)


@pytest.mark.parametrize("channels", [("force",), ("force", "displacement"), ALL])
@pytest.mark.parametrize("temperature_sd", [0.0, 0.7])
def test_the_likelihood_is_the_dense_normal_over_channels_and_samples(
    make_record: Callable[..., Record], channels: tuple[str, ...], temperature_sd: float
) -> None:
    """A sample's channels share its error of temperature, to any order of it: the moments are those of a fine sum.

    That is the likelihood of a noise with a memory, here of no length.
    """
    record = make_record(channels, n=15, temperature_sd=temperature_sd)
    p = build(record, "ar1")
    theta = p.space.constrain(near_truth(p, 5))
    for channel in channels:
        theta[:, p.space.index(f"{channel}_phi")] = 0.0
    for name, value in {"A2": 0.3, "B2": 0.35}.items():  # curves that seven nodes resolve
        if name in p.space.names:
            theta[:, p.space.index(name)] = value
    found = p.log_likelihood(theta)
    place = p.layout[0]
    for row, value in zip(theta, found, strict=True):
        mean, shared = moments_under_errors(p, row, channels, temperature_sd)
        blocks = [[np.diag(shared[i, j]) for j in range(len(channels))] for i in range(len(channels))]
        variances = np.concatenate([np.full(15, row[place.noise[c][0]] ** 2) for c in channels])
        covariance = np.diag(variances) + np.block(blocks)
        residual = np.concatenate([record.observed[c] for c in channels]) - mean.ravel()
        assert value == pytest.approx(dense_log_density(residual, covariance), rel=1e-5)


@pytest.mark.parametrize("noise", ["independent", "student_t", "independent+growing"])
@pytest.mark.parametrize(("spread", "apart"), [(0.3, 1e-4), (0.9, 3e-4), (2.0, 0.005), (3.5, 0.02)])
def test_true_temperatures_are_integrated_out(
    make_record: Callable[..., Record], noise: str, spread: float, apart: float
) -> None:
    """Against a fine sum over the error of each sample: s_T B2 from 0.1 to 1.2, mean error in ln of a sample.

    The nodes lie where expected information puts them, which is further off under heavy tails.
    """
    apart += 0.02 * (not NOISE_MODELS[noise].is_gaussian)
    record = make_record(n=60, noise=0.02, temperature_sd=spread)
    p = build(record, noise)
    theta = p.space.constrain(_shaped(p))
    for channel, span in (("force", 2.5), ("displacement", 0.02)):
        theta[p.space.index(f"{channel}_sd")] = 0.02 * span
    error = np.linspace(-8.0, 8.0, 4001)
    joint = stats.norm.logpdf(error)[:, None] + np.log(error[1] - error[0])
    t = record.temperature + spread * error[:, None]
    every = np.tile(theta, (error.size, 1))
    y = p.predict(every, {"temperature": t})
    for channel in record.channels:
        scale = p.noise_scale(every, 0, channel, y[channel])
        shape = every[:, p.layout[0].noise[channel][1:]]
        e = (record.observed[channel] - y[channel]) / scale
        joint = joint + p.noise.log_density(e, shape, p.steps[0]) - np.log(scale)
    expected = logsumexp(joint, axis=0)
    (found,) = p.pointwise_log_likelihood(theta[None])
    found = sum(v[0] for v in found.values())
    assert p.log_likelihood(theta[None])[0] == pytest.approx(found.sum(), rel=1e-12)
    assert np.abs(found - expected).mean() < apart
    assert abs(found.sum() - expected.sum()) < apart * record.n


def test_a_small_error_of_temperature_is_the_slope_times_it(make_record: Callable[..., Record]) -> None:
    record = make_record(n=15, temperature_sd=1e-3)
    p = build(record)
    theta = p.space.constrain(_shaped(p))[None]
    mean, sd = p.expected(theta)
    slope = p.model.slope(theta, record.inputs)
    clean = p.predict(theta, record.inputs)
    for channel in record.channels:
        np.testing.assert_allclose(sd[channel], 1e-3 * np.abs(slope[channel]), rtol=1e-5)
        np.testing.assert_allclose(mean[channel], clean[channel], rtol=1e-6)
    assert p.expected(theta)[1].keys() == set(record.channels)
    assert build(make_record(n=15)).expected(theta)[1] == {}


@pytest.mark.parametrize("spread", [0.9, 2.0, 3.5])
def test_moments_under_errors_of_temperature_are_those_of_a_simulation(
    make_record: Callable[..., Record], spread: float
) -> None:
    """s_T B2 from 0.3 to 1.2; 400,000 errors; five standard errors and what seven nodes leave."""
    record = make_record(n=9, temperature_sd=spread)
    p = build(record)
    theta = p.space.constrain(_shaped(p))
    mean, sd = p.expected(theta[None])
    parts = p._moments(theta[None], 0)[1]
    size = 400_000
    t = record.temperature + spread * np.random.default_rng(0).standard_normal((size, 9))
    y = p.model.predict(np.tile(theta[p.layout[0].model], (1, 1)), {"temperature": t})
    for channel in record.channels:
        leeway = 0.004 * np.ptp(mean[channel])
        expected = y[channel].std(axis=0)
        assert np.all(
            np.abs(mean[channel][0] - y[channel].mean(axis=0)) < 5.0 * expected / np.sqrt(size) + leeway
        )
        assert np.all(np.abs(sd[channel][0] - expected) < 5.0 * expected / np.sqrt(size) + leeway)
    force, displacement = (y[c] - y[c].mean(axis=0) for c in ("force", "displacement"))
    shared = sum(a * b for a, b in zip(parts["force"], parts["displacement"], strict=True))[0]
    scale = force.std(axis=0) * displacement.std(axis=0)
    steep = scale > 0.05 * scale.max()
    np.testing.assert_allclose(
        (shared / scale)[steep], (np.mean(force * displacement, axis=0) / scale)[steep], atol=0.02
    )


@pytest.mark.parametrize("declared", [0.0, 0.4])
def test_an_estimated_error_of_temperature_adds_to_what_was_declared(
    make_record: Callable[..., Record], declared: float
) -> None:
    p = build(make_record(n=20, temperature_sd=declared), "independent+temperature_error")
    assert p.names[-1] == "temperature_sd"
    theta = np.tile(p.space.constrain(_shaped(p)), (3, 1))
    theta[:, -1] = [0.0, 0.3, 1.0]
    np.testing.assert_allclose(p.temperature_sd(theta), np.hypot([0.0, 0.3, 1.0], declared))
    for row, value in zip(theta, p.log_likelihood(theta), strict=True):
        same = build(replace(p.records[0], temperature_sd=float(np.hypot(row[-1], declared))))
        assert value == pytest.approx(same.log_likelihood(row[None, :-1])[0], rel=1e-12)


def test_growing_noise_is_wider_where_the_response_is_larger(make_record: Callable[..., Record]) -> None:
    record = make_record(("force",), n=30)
    p = build(record, "independent+growing")
    theta = p.space.constrain(_shaped(p))
    theta[p.space.index("force_growth")] = 1.2
    mean = p.predict(theta, record.inputs)["force"]
    low, high = np.quantile(record.observed["force"], (0.01, 0.99))
    scale = theta[p.space.index("force_sd")] * np.exp(1.2 * ((mean - low) / (high - low) - 0.5))
    expected = stats.norm(mean, scale).logpdf(record.observed["force"]).sum()
    assert p.log_likelihood(theta[None])[0] == pytest.approx(expected, rel=1e-10)


def dense_log_density(x: np.ndarray, covariance: np.ndarray) -> float:
    """Multivariate normal with very different scales on the diagonal."""
    scale = np.sqrt(np.diag(covariance))
    unit = covariance / np.outer(scale, scale)
    return float(stats.multivariate_normal(np.zeros(x.size), unit).logpdf(x / scale) - np.log(scale).sum())


def test_memory_and_channels_factorise(make_record: Callable[..., Record]) -> None:
    record = make_record(("force", "displacement"), n=20, segments=2)
    p = build(record, "ar1")
    theta = p.space.constrain(near_truth(p, 3))
    for row, value in zip(theta, p.log_likelihood(theta), strict=True):
        expected = 0.0
        mean = p.predict(row, record.inputs)
        for channel in record.channels:
            sd, phi = row[p.layout[0].noise[channel]]
            lag = np.abs(np.arange(20)[:, None] - np.arange(20))
            sweep = record.inputs["segment"]
            covariance = sd**2 * np.where(sweep[:, None] == sweep, phi**lag, 0.0)
            expected += stats.multivariate_normal(mean[channel], covariance).logpdf(record.observed[channel])
        assert value == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("noise", list(NOISE_MODELS))
@pytest.mark.parametrize("temperature_sd", [0.0, 0.7])
def test_single_observations_sum_to_the_likelihood(
    make_record: Callable[..., Record], noise: str, temperature_sd: float
) -> None:
    record = make_record(ALL, n=30, segments=2, temperature_sd=temperature_sd)
    p = build(record, noise)
    theta = p.space.constrain(near_truth(p, 6))
    (pointwise,) = p.pointwise_log_likelihood(theta)
    assert {c: v.shape for c, v in pointwise.items()} == dict.fromkeys(ALL, (6, 30))
    total = sum(v.sum(axis=1) for v in pointwise.values())
    np.testing.assert_allclose(total, p.log_likelihood(theta), rtol=1e-10)


@pytest.mark.parametrize("noise", list(NOISE_MODELS))
def test_log_prob_is_prior_plus_likelihood_whatever_the_chunks(
    make_record: Callable[..., Record], monkeypatch: pytest.MonkeyPatch, noise: str
) -> None:
    p = build(make_record(n=40, temperature_sd=0.3), noise)
    z = near_truth(p, 100)
    whole = p.log_prob(z)
    np.testing.assert_allclose(whole, p.log_prior(z) + p.log_likelihood(p.space.constrain(z)), rtol=1e-14)
    monkeypatch.setattr(posterior_module, "CHUNK_SAMPLES", 40 * 17)
    np.testing.assert_allclose(p.log_prob(z), whole, rtol=1e-13)
    np.testing.assert_allclose([p.log_prob(row)[0] for row in z[:5]], whole[:5], rtol=1e-13)


@pytest.mark.parametrize("noise", list(NOISE_MODELS))
@pytest.mark.parametrize("channels", [ALL, ("stiffness",)])
def test_log_prob_is_never_nan_nor_plus_infinity(
    make_record: Callable[..., Record], noise: str, channels: tuple[str, ...]
) -> None:
    p = build(make_record(channels, n=10, temperature_sd=0.2), noise)
    d = len(p.names)
    rng = np.random.default_rng(0)
    z = np.concatenate([size * rng.standard_normal((200, d)) for size in (1.0, 30.0, 300.0, 1e4, 1e200)])
    z = np.concatenate([z, np.full((1, d), np.nan), np.full((1, d), np.inf), np.full((1, d), -np.inf)])
    value = p.log_prob(z)
    assert not np.isnan(value).any()
    assert not np.isposinf(value).any()
    assert np.all(value[-3:] == -np.inf)


def test_parameters_that_nothing_measured_comes_near_are_impossible(
    make_record: Callable[..., Record],
) -> None:
    """A step between two readings is as likely at any rate that is fast enough, and moments of its draws must exist."""
    p = build(make_record(("force",), n=20))
    fast, faster = (np.array(p.space.prior_centre()) for _ in range(2))
    rate = p.names.index("B2")
    fast[rate], faster[rate] = np.log(GREATEST_PARAMETER) - 1.0, np.log(GREATEST_PARAMETER) + 1.0
    assert np.isfinite(p.log_prob(fast)[0])
    assert p.log_prob(faster)[0] == -np.inf


def test_an_exact_curve_has_no_infinite_density(make_record: Callable[..., Record]) -> None:
    record = make_record(("force",), n=20, noise=0.0)
    p = build(record)
    z = p.space.prior_centre()
    z[:4] = p.space.unconstrain(np.array([2.5, 0.35, 52.0, 0.5, 1.0]))[:4]
    every = np.tile(z, (5, 1))
    every[:, 4] = [0.0, -50.0, -300.0, -700.0, -800.0]
    assert not np.isposinf(p.log_prob(every)).any()


# --- residuals and replicates -------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("noise", "temperature_sd"),
    [
        *((n, 0.0) for n in (*NOISE_MODELS, "ar1+growing")),
        *((n, 0.8) for n in (*NOISE_MODELS, "ar1+temperature_error") if NOISE_MODELS[n].autocorrelated),
        ("independent", 0.05),
    ],
)
def test_replicates_are_what_the_likelihood_expects(
    make_record: Callable[..., Record], noise: str, temperature_sd: float
) -> None:
    """Their residuals, with the memory taken out, are unit normal and white in and across channels.

    Where true temperatures are integrated out that holds as far as the curve is straight over an error of temperature.
    15,000 numbers a channel: Kolmogorov-Smirnov at 1e-5, correlations at 5 standard errors; the seed is fixed.
    """
    record = make_record(n=50, segments=2, temperature_sd=temperature_sd, memory=0.8)
    p = build(record, noise)
    theta = np.tile(p.space.constrain(_shaped(p)), (300, 1))
    replicas = p.replicate(np.random.default_rng(1), theta)
    white = {c: [] for c in record.channels}
    for i in range(300):
        again = replace(record, observed={c: replicas[c][i] for c in record.channels})
        residual = replace(p, records=(again,)).residuals(theta[:1])[0]
        for channel in record.channels:
            white[channel].append(residual[channel][0])
    joined = {c: np.array(v) for c, v in white.items()}
    for u in joined.values():
        assert stats.kstest(u.ravel(), "norm").pvalue > 1e-5
        assert abs(np.mean(u[:, 1:] * u[:, :-1])) < 5.0 / np.sqrt(u.size)
    assert abs(np.mean(joined["force"] * joined["displacement"])) < 5.0 / np.sqrt(u.size)


def _shaped(p: Posterior) -> np.ndarray:
    """Coordinates of a clean curve with small noise and a strong memory."""
    theta = p.space.constrain(p.space.prior_centre())
    truth = {"A1": 0.02, "A2": 0.30, "A3": 48.0, "A4": 0.001, "B1": 2.5, "B2": 0.35, "B3": 52.0, "B4": 0.5}
    shape = {"sd": 0.01, "phi": 0.8, "tau": 4.0, "nu": 5.0, "growth": 0.7}
    if "temperature_sd" in p.space.names:
        theta[p.space.index("temperature_sd")] = 0.4
    for name, value in truth.items():
        if name in p.space.names:
            theta[p.space.index(name)] = value
    for channel, span in (("displacement", 0.02), ("force", 2.5)):
        for kind, value in shape.items():
            if f"{channel}_{kind}" in p.space.names:
                theta[p.space.index(f"{channel}_{kind}")] = value * (span if kind == "sd" else 1.0)
    return p.space.unconstrain(theta)


def test_replicates_scatter_about_the_curve_with_the_noise(make_record: Callable[..., Record]) -> None:
    """Means within 5 standard errors and variances within 5 % of 20,000 replicas; the seed is fixed."""
    record = make_record(n=12, temperature_sd=0.5)
    p = build(record)
    theta = p.space.constrain(_shaped(p))
    size = 20_000
    replicas = p.replicate(np.random.default_rng(2), np.tile(theta, (size, 1)))
    mean, shared = moments_under_errors(p, theta, record.channels, 0.5)
    for i, (channel, y) in enumerate(replicas.items()):
        variance = theta[p.layout[0].noise[channel][0]] ** 2 + shared[i, i]
        assert np.all(np.abs(y.mean(axis=0) - mean[i]) < 5.0 * np.sqrt(variance / size))
        np.testing.assert_allclose(y.var(axis=0), variance, rtol=0.05)
    apart = [y - m for y, m in zip(replicas.values(), mean, strict=True)]
    steep = np.abs(shared[0, 1]) > 0.1 * np.abs(shared[0, 1]).max()
    np.testing.assert_allclose(np.mean(apart[0] * apart[1], axis=0)[steep], shared[0, 1][steep], rtol=0.1)


@dataclass(frozen=True)
class Straight(ModifiedSigmoid):
    """Straight lines: the response to an error of temperature is linear, its moments are exact."""

    def predict(self, theta: np.ndarray, inputs: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        t = inputs["temperature"] - 50.0
        return {"force": theta[..., 4, None] * t, "displacement": theta[..., 0, None] * t}

    def slope(self, theta: np.ndarray, inputs: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        level = np.ones(inputs["temperature"].shape)
        return {"force": theta[..., 4, None] * level, "displacement": theta[..., 0, None] * level}


@pytest.mark.parametrize(
    ("noise", "temperature_sd"),
    [
        *((n, 0.0) for n in NOISE_MODELS if NOISE_MODELS[n].is_density),
        *((n, 0.3) for n in NOISE_MODELS if NOISE_MODELS[n].autocorrelated and NOISE_MODELS[n].is_density),
        ("independent", 0.3),
    ],
)
def test_replicates_have_the_density_of_the_likelihood(
    make_record: Callable[..., Record], noise: str, temperature_sd: float
) -> None:
    """The mean of p(y; other)/p(y; own) over 1,000 replicas is one: five standard errors; the seed is fixed."""
    record = make_record(n=6, segments=2, temperature_sd=temperature_sd)
    model = Straight(record.channels)
    p = build_posterior([record], NOISE_MODELS[noise], DEFAULT, model=model)
    theta = p.space.constrain(_shaped(p))
    size = 1_000
    replicas = p.replicate(np.random.default_rng(3), np.tile(theta, (size, 1)))
    changed = {"force_sd": 1.06, "displacement_sd": 0.95, "A1": 1.0 + 1e-4, "B1": 1.0 - 1e-4}
    other = theta.copy()
    for name, factor in changed.items():
        other[p.space.index(name)] *= factor
    ratio = np.empty(size)
    both = np.stack([theta, other])
    for i in range(size):
        again = replace(record, observed={c: y[i] for c, y in replicas.items()})
        own, others = replace(p, records=(again,)).log_likelihood(both)
        ratio[i] = np.exp(others - own)
    assert 0.05 < ratio.std() < 1.5
    assert abs(ratio.mean() - 1.0) < 5.0 * ratio.std() / np.sqrt(size)


# --- several records, fixed parameters ----------------------------------------------------------------


def test_pooled_records_share_the_model_and_keep_their_noise(make_record: Callable[..., Record]) -> None:
    records = [make_record(("force",), n=20 + 10 * i, seed=i, condition=f"c{i}") for i in range(3)]
    p = build_posterior(records, NOISE_MODELS["ar1"], DEFAULT)
    assert p.names == (
        "B1", "B2", "B3", "B4",
        "force_sd[c0]", "force_phi[c0]", "force_sd[c1]", "force_phi[c1]", "force_sd[c2]", "force_phi[c2]",
    )  # fmt: skip
    assert p.n == 90
    theta = p.space.constrain(near_truth(p, 4))
    expected = np.zeros(4)
    for i, record in enumerate(records):
        alone = build_posterior([record], NOISE_MODELS["ar1"], DEFAULT)
        own = theta[:, [0, 1, 2, 3, 4 + 2 * i, 5 + 2 * i]]
        expected += alone.log_likelihood(own)
        np.testing.assert_array_equal(
            p.predict(theta, record.inputs, record=i)["force"], alone.predict(own, record.inputs)["force"]
        )
    np.testing.assert_allclose(p.log_likelihood(theta), expected, rtol=1e-12)
    assert len(p.pointwise_log_likelihood(theta)) == len(p.residuals(theta)) == 3
    assert p.replicate(np.random.default_rng(0), theta, record=2)["force"].shape == (4, 40)


@pytest.mark.parametrize("change", ["branch", "channels", "units"])
def test_records_that_differ_can_not_be_pooled(make_record: Callable[..., Record], change: str) -> None:
    first = make_record(("force",), condition="a")
    other = {
        "branch": lambda: make_record(("force",), condition="b", branch=Branch.COOLING),
        "channels": lambda: make_record(condition="b"),
        "units": lambda: replace(
            make_record(("force",), condition="b"), units={"temperature": "degC", "time": "s", "force": "kN"}
        ),
    }[change]()
    with pytest.raises(PriorError, match="can't share parameters"):
        build_posterior([first, other], NOISE_MODELS["independent"], DEFAULT)


def test_a_fixed_parameter_is_held_and_not_sampled(make_record: Callable[..., Record]) -> None:
    free = build(make_record(("force",)))
    text = DEFAULT.text.replace("[both.B4]", "[both.B4_old]") + '\n[both.B4]\nfixed = 0.5\nunit = "N"\n'
    start = text.index("[both.B4_old]")
    text = text[:start] + text[text.index("[[", start) :] if "[[" in text[start:] else text
    p = build_posterior([make_record(("force",))], NOISE_MODELS["independent"], parse_priors(text, "x.toml"))
    assert p.names == ("B1", "B2", "B3", "force_sd")
    z = near_truth(p, 5)
    theta = p.space.constrain(z)
    np.testing.assert_array_equal(theta[:, 3], 0.5)
    np.testing.assert_allclose(p.log_likelihood(theta), free.log_likelihood(theta), rtol=1e-14)
    np.testing.assert_allclose(p.log_prob(z), p.log_prior(z) + p.log_likelihood(theta), rtol=1e-14)


def test_a_posterior_pickles(make_record: Callable[..., Record]) -> None:
    p = build(make_record(n=20), "ar1_time")
    again = pickle.loads(pickle.dumps(p))
    z = near_truth(p, 7)
    np.testing.assert_array_equal(again.log_prob(z), p.log_prob(z))
    assert again.fingerprint() == p.fingerprint()


def test_draws_from_the_prior_have_a_density(make_record: Callable[..., Record]) -> None:
    p = build(make_record(), "ar1")
    z = p.draw_prior(np.random.default_rng(0), 500)
    assert z.shape == (500, len(p.names))
    assert np.isfinite(p.log_prior(z)).all()


# --- the fingerprint ----------------------------------------------------------------------------------


def _changes(record: Record) -> dict[str, Callable[[], Posterior]]:
    def build_with(r: Record, noise: str = "independent", text: str = DEFAULT.text) -> Posterior:
        return build_posterior([r], NOISE_MODELS[noise], parse_priors(text, "p.toml"))

    def nudged(values: np.ndarray) -> np.ndarray:
        values = values.copy()
        values[3] = np.nextafter(values[3], np.inf)
        return values

    observed = dict(record.observed)
    inputs = dict(record.inputs)
    return {
        "nothing": lambda: build_with(record),
        "one observation by one digit": lambda: build_with(
            replace(record, observed=observed | {"force": nudged(observed["force"])})
        ),
        "one temperature by one digit": lambda: build_with(
            replace(record, inputs=inputs | {"temperature": nudged(inputs["temperature"])})
        ),
        "a sweep": lambda: build_with(
            replace(record, inputs=inputs | {"segment": np.repeat([0.0, 1.0], 50)})
        ),
        "a channel less": lambda: build_with(replace(record, observed={"force": observed["force"]})),
        "channels swapped": lambda: build_with(
            replace(record, observed={"force": observed["displacement"], "displacement": observed["force"]})
        ),
        "the temperature error": lambda: build_with(replace(record, temperature_sd=0.1)),
        "the condition": lambda: build_with(replace(record, condition=Condition("d"))),
        "the branch": lambda: build_with(replace(record, branch=Branch.COOLING)),
        "the noise": lambda: build_with(record, "ar1"),
        "a prior": lambda: build_with(record, text=DEFAULT.text.replace("median = 20.0", "median = 21.0")),
    }


def test_the_fingerprint_changes_with_whatever_decides_a_draw(make_record: Callable[..., Record]) -> None:
    found = {what: make().fingerprint() for what, make in _changes(make_record()).items()}
    assert found["nothing"] == build(make_record()).fingerprint()
    assert len(set(found.values())) == len(found)


def test_the_fingerprint_changes_with_versions(
    make_record: Callable[..., Record], monkeypatch: pytest.MonkeyPatch
) -> None:
    p = build(make_record())
    before = p.fingerprint()
    monkeypatch.setattr(posterior_module, "versions", lambda: {"numpy": "0.0.0"})
    assert p.fingerprint() != before
