"""The noise model that the residuals ask for, and the start that goes with it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from sma_bayes.fitting import noise_choice
from sma_bayes.fitting.discrepancy import DiscrepancyBasis
from sma_bayes.fitting.noise_choice import (
    ALLOWED_LN_EVIDENCE_LOSS,
    LEAST_LN_EVIDENCE_GAIN,
    LEAST_LN_EVIDENCE_GAIN_OF_VARIANCE,
    MAX_MEMORY_SAMPLES,
    NoiseChoice,
    choose_noise,
    noise_start,
    posterior_with,
)
from sma_bayes.fitting.posterior import build_posterior
from sma_bayes.fitting.warm_start import warm_start
from sma_bayes.noise import NOISE_MODELS, NoiseModel
from sma_bayes.parameters.priors_file import parse_priors, read_priors
from sma_bayes.records.types import Record

DEFAULT = read_priors("modified_sigmoid")


def choice_for(record: Record, *, noise: str | None = None, discrepancy: bool = True) -> NoiseChoice:
    posterior = build_posterior([record], NOISE_MODELS["independent"], DEFAULT)
    start = warm_start(posterior, np.random.default_rng(0))
    return choose_noise(posterior, start, DEFAULT, noise=noise, discrepancy=discrepancy)


def with_even_time(record: Record) -> Record:
    return replace(record, inputs={**record.inputs, "time": np.arange(record.n, dtype=float)})


def with_outliers(record: Record) -> Record:
    rng = np.random.default_rng(3)
    observed = {}
    for channel, y in record.observed.items():
        hit = rng.random(record.n) < 0.08
        observed[channel] = y + hit * 0.1 * np.ptp(y) * rng.standard_normal(record.n)
    return replace(record, observed=observed)


def test_white_residuals_are_independent_without_a_discrepancy(make_record: Callable[..., Record]) -> None:
    """Of 60 other records 58 were, and none got a discrepancy (95 %: fewer than 1 in 20).

    At 56 of 60 fewer than 8 of 12 happen once in 1,500 runs, and at 1 in 20 more than 3 of 12 once in 450; seeds are
    fixed.
    """
    choices = [choice_for(make_record(n=150, seed=100 + seed)) for seed in range(12)]
    assert sum(c.name == "independent" for c in choices) >= 8
    assert sum(bool(c.bases[0]) for c in choices) <= 3
    assert all(abs(r) < 0.35 for c in choices for r in c.lag1.values())


def test_a_specimen_has_stress_and_strain(make_record: Callable[..., Record]) -> None:
    record = make_record(n=60)
    specimen = replace(record, specimen=True, units={**record.units, "displacement": "1", "force": "Pa"})
    parameters = build_posterior([specimen], NOISE_MODELS["ar1"], DEFAULT).space.parameters
    told = " ".join([*(p.meaning for p in parameters), choice_for(specimen, discrepancy=False).reason])
    assert "rate of the strain sigmoid" in told
    assert "correlation of neighbouring noise of stress" in told
    assert not {"{quantity}", "displacement", "force"} & set(told.replace("(", " ").replace(")", " ").split())


@pytest.mark.parametrize("seed", range(3))
def test_residuals_with_a_memory_get_one(make_record: Callable[..., Record], seed: int) -> None:
    choice = choice_for(with_even_time(make_record(n=300, seed=seed, memory=0.8)))
    assert choice.name == "ar1"
    assert all(r > 0.5 for r in choice.lag1.values())
    assert "ar1_time" not in choice.ln_evidence
    without = {n: v for n, v in choice.ln_evidence.items() if not n.endswith("+temperature_error")}
    assert choice.ln_evidence["ar1"] == max(without.values())
    assert (
        choice.ln_evidence["ar1"] > -LEAST_LN_EVIDENCE_GAIN_OF_VARIANCE
    )  # which an error of the thermometer lacks
    assert choice.ln_evidence["independent"] < -10.0


def test_a_real_memory_seldom_passes_for_misfit(make_record: Callable[..., Record]) -> None:
    """Of 25 other records 1 of 50 channels got a discrepancy; more than 3 of 16 would once in 3,000 runs."""
    choices = [
        choice_for(with_even_time(make_record(n=300, seed=50 + seed, memory=0.8))) for seed in range(8)
    ]
    assert sum(c.name.startswith("ar1") for c in choices) == 8
    assert sum(len(c.bases[0]) for c in choices) <= 3
    for c in choices:
        assert all(gain < 5.0 for gain in c.discrepancy.values())


def test_a_discrepancy_is_not_cheaper_than_a_memory(make_record: Callable[..., Record]) -> None:
    """A short record with a memory is not called white noise about a curve that fails.

    Seeds are fixed; 3 of these 60 records get a discrepancy, 8 got one when a memory alone had to earn its place.
    """
    records = [with_even_time(make_record(n=60, seed=500 + seed, memory=0.6)) for seed in range(60)]
    assert sum(bool(choice_for(record).bases[0]) for record in records) <= 4


def rounded(record: Record, steps_of_noise: float, sd: float = 0.01) -> Record:
    """Readings rounded to so many standard deviations of the noise, which is a share `sd` of the range."""
    observed = {}
    for channel, y in record.observed.items():
        step = steps_of_noise * sd * np.ptp(y)
        observed[channel] = step * np.round(y / step)
    return replace(record, observed=observed)


@pytest.mark.parametrize("n", [60, 200])
def test_readings_in_coarse_steps_are_taken_as_intervals(make_record: Callable[..., Record], n: int) -> None:
    record = make_record(n=n, seed=4)
    choice = choice_for(rounded(record, 5.0))
    assert choice.name == "rounded"
    assert "in steps that are large beside the residuals" in choice.reason
    assert list(choice.ln_evidence) == ["rounded"]
    assert not choice.bases[0]
    fine = choice_for(rounded(record, 0.5))
    assert fine.name == choice_for(record).name
    assert "steps" not in fine.reason


def test_misfit_is_told_apart_from_coarse_steps(make_record: Callable[..., Record]) -> None:
    choice = choice_for(rounded(with_a_second_step(make_record(n=200, seed=5)), 3.0))
    assert choice.name == "rounded"
    assert set(choice.bases[0]) == {"force", "displacement"}
    for channel, values in choice.estimate[0].items():
        assert values.size == 3, channel


def test_a_declared_error_of_the_thermometer_stands_beside_rounding_without_a_discrepancy(
    make_record: Callable[..., Record],
) -> None:
    record = replace(rounded(make_record(n=100, seed=6), 5.0), temperature_sd=0.3)
    assert choice_for(record).name != "rounded"
    assert not choice_for(record, noise="rounded").bases[0]


def with_a_second_step(record: Record) -> Record:
    t = record.temperature
    observed = {
        c: y + 0.15 * np.ptp(y) / (1.0 + np.exp(-0.8 * (t - 58.0))) for c, y in record.observed.items()
    }
    return replace(record, observed=observed)


def test_misfit_is_given_a_discrepancy_and_the_noise_is_not_blamed(
    make_record: Callable[..., Record],
) -> None:
    record = with_a_second_step(make_record(("force",), n=200, noise=0.002))
    assert choice_for(record, noise="independent").discrepancy["force"] > 50.0
    choice = choice_for(record)
    assert set(choice.bases[0]) == {"force"}
    # a memory, which may stay beside it, would explain a part of the misfit by itself
    assert choice.discrepancy["force"] > 20.0 * LEAST_LN_EVIDENCE_GAIN
    assert choice.lag1["force"] > 0.7
    sd, size = choice.estimate[0]["force"][0], choice.estimate[0]["force"][-1]
    assert sd == pytest.approx(0.002 * np.ptp(record.observed["force"]), rel=0.3)
    assert size > 2.0 * sd
    assert "a smooth discrepancy beside the curve gains" in choice.reason


@pytest.mark.parametrize("seed", range(4))
def test_a_memory_stays_beside_a_discrepancy_unless_the_evidence_is_against_it(
    make_record: Callable[..., Record], seed: int
) -> None:
    """Of white noise about a curve that fails, whose memory no evidence is for; without misfit it must be earned."""
    record = with_a_second_step(make_record(("force",), n=80, noise=0.004, seed=seed))
    choice = choice_for(record)
    apart = {name: choice_for(record, noise=name) for name in ("independent", "ar1")}
    assert all(c.bases[0] for c in apart.values())
    against = choice.ln_evidence["independent"] - choice.ln_evidence["ar1"]
    assert choice.name == ("ar1" if against < ALLOWED_LN_EVIDENCE_LOSS else "independent")
    assert ("beside it a memory stays" in choice.reason) == (
        choice.name == "ar1" and against > -LEAST_LN_EVIDENCE_GAIN
    )
    plain = choice_for(make_record(("force",), n=80, noise=0.004, seed=seed))
    assert not plain.bases[0]
    assert plain.name == "independent"


def test_a_memory_beside_a_discrepancy_is_dropped_where_the_evidence_is_against_it(
    make_record: Callable[..., Record], monkeypatch: pytest.MonkeyPatch
) -> None:
    record = with_a_second_step(make_record(("force",), n=80, noise=0.004))
    assert choice_for(record).name == "ar1"
    monkeypatch.setattr(noise_choice, "ALLOWED_LN_EVIDENCE_LOSS", -100.0)
    choice = choice_for(record)
    assert choice.name == "independent"
    assert choice.bases[0]


@pytest.mark.parametrize(
    ("gains", "expected"),
    [
        ({"ar1+temperature_error": 0.1}, "ar1+temperature_error"),
        ({"ar1+temperature_error": -0.1}, "ar1"),
    ],
)
def test_an_error_of_the_thermometer_beside_a_discrepancy_must_gain_anything(
    gains: dict[str, float], expected: str
) -> None:
    assert noise_choice._with_temperature_error("ar1", described_with({"ar1": 0.0, **gains})) == expected


@pytest.mark.parametrize(("gain_with_growth", "grows"), [(1.0, False), (3.0, True)])
def test_growth_goes_where_an_error_of_the_thermometer_makes_it_needless(
    gain_with_growth: float, grows: bool
) -> None:
    gains = {"ar1+growing": 0.0, "ar1+temperature_error": 0.5}
    gains["ar1+growing+temperature_error"] = 0.5 + gain_with_growth
    expected = f"ar1{'+growing' if grows else ''}+temperature_error"
    assert noise_choice._with_temperature_error("ar1+growing", described_with(gains)) == expected


@pytest.mark.parametrize("size", [1e-90, 1.0, 1e90])
def test_growth_is_seen_whatever_the_size_of_the_innovations(size: float) -> None:
    """A computed curve that a model misses leaves innovations of any size."""
    e = np.random.default_rng(0).standard_normal(60)
    response = np.linspace(0.0, 1.0, 60)
    growing = noise_choice._following(size * e * np.exp(2.0 * response), response)
    assert growing == pytest.approx(noise_choice._following(e * np.exp(2.0 * response), response))
    assert growing > noise_choice._following(size * e, response)


def described_with(ln_evidence: dict[str, float]) -> Callable[[str], Any]:
    """Descriptions with a discrepancy, which gains 10, and this ln evidence."""
    basis = DiscrepancyBasis(np.zeros(1), np.zeros((1, 1)), np.zeros((1, 1)))

    def look(name: str) -> Any:
        gain = {"force": 10.0}
        return noise_choice._Description(ln_evidence[name], gain, ({"force": basis},), (), (), (), ())

    return look


def test_only_a_free_choice_has_an_error_of_the_thermometer_without_a_sign(
    make_record: Callable[..., Record], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Not where the noise is named, nor beside a declared error, nor where no discrepancy may lack in evidence."""
    asked = []
    monkeypatch.setattr(
        noise_choice, "_with_temperature_error", lambda name, look: asked.append(name) or name
    )
    record = with_a_second_step(make_record(("force",), n=80, noise=0.004))
    assert choice_for(record, noise="ar1").bases[0]
    choice_for(replace(record, temperature_sd=0.1))
    posterior = build_posterior([record], NOISE_MODELS["independent"], DEFAULT)
    start = warm_start(posterior, np.random.default_rng(0))
    assert choose_noise(posterior, start, DEFAULT, allowed_loss=0.0).bases[0]
    assert not asked
    assert choice_for(record).name == asked[0]


def in_bursts(record: Record, seed: int) -> Record:
    """Twelve jumps, 2.5 to 7.5 % of the range up or down, which no smooth function follows."""
    rng = np.random.default_rng(seed)
    at = rng.uniform(38.0, 66.0, 12)
    jumps = rng.choice([-1.0, 1.0], 12) * rng.uniform(0.025, 0.075, 12)
    left = (record.temperature[:, None] > at) @ jumps
    observed = {c: y + np.ptp(y) * left for c, y in record.observed.items()}
    return with_even_time(replace(record, observed=observed))


@pytest.mark.parametrize(("n", "expected"), [(90, MAX_MEMORY_SAMPLES), (900, 30.0)])
def test_noise_beside_a_discrepancy_remembers_what_it_has_samples_a_function(
    make_record: Callable[..., Record], n: int, expected: float
) -> None:
    record = with_a_second_step(make_record(("force",), n=n, noise=0.002))
    choice = choice_for(record, noise="ar1")
    assert choice.longest_memory[0]["force"] == expected
    assert not choice_for(record, noise="independent").longest_memory[0]
    assert not choice_for(record, noise="ar1", discrepancy=False).longest_memory[0]


@pytest.mark.parametrize("seed", range(4))
def test_a_memory_without_end_is_bounded_and_not_given_up(
    make_record: Callable[..., Record], seed: int
) -> None:
    """Without bound the likeliest memory is half the sweep and more: misfit, though noise without any is far worse."""
    record = in_bursts(make_record(("force",), n=360, noise=0.002, seed=seed), seed)
    auto = choice_for(record)
    assert NOISE_MODELS[auto.name].autocorrelated
    assert auto.ln_evidence["independent"] < -50.0
    choice = choice_for(record, noise="ar1_student_t")
    bound = choice.longest_memory[0]["force"]
    assert bound == MAX_MEMORY_SAMPLES
    posterior = build_posterior([record], NOISE_MODELS["independent"], DEFAULT)
    start = warm_start(posterior, np.random.default_rng(0))
    chosen = posterior_with(choice.name, posterior, start, DEFAULT, choice)
    phi = next(p for p in chosen.space.parameters if p.name == "force_phi")
    assert phi.prior.quantile(np.array(1.0)) == pytest.approx((bound - 1.0) / (bound + 1.0))
    assert np.isfinite(chosen.log_prob(noise_start(chosen, start, choice)[None])).all()


def test_a_prior_of_ones_own_knows_no_bound(make_record: Callable[..., Record]) -> None:
    uniform = '[noise.phi]\nfamily = "uniform"\nlow = 0.0\nhigh = 1.0\n'
    own = parse_priors(f'schema = "sma-bayes/priors/1"\nextends = "modified_sigmoid"\n{uniform}', "own.toml")
    record = make_record(("force",), n=60)
    for priors, low, high in ((DEFAULT, -0.6, 0.6), (own, 0.0, 1.0)):
        built = build_posterior(
            [record], NOISE_MODELS["ar1"], priors, longest_memory=[{"force": 4.0}], residual=[{"force": 0.1}]
        )
        phi = next(p for p in built.space.parameters if p.name == "force_phi")
        assert phi.prior.quantile(np.array([0.0, 1.0])) == pytest.approx([low, high])


def test_the_bound_of_a_memory_in_time_is_that_of_one_in_samples(make_record: Callable[..., Record]) -> None:
    record = make_record(("force",), n=60)
    record = replace(record, inputs={**record.inputs, "time": 2.5 * np.arange(60.0)})
    built = build_posterior([record], NOISE_MODELS["ar1_time"], DEFAULT, longest_memory=[{"force": 4.0}])
    tau = next(p for p in built.space.parameters if p.name == "force_tau")
    assert np.exp(-2.5 / tau.prior.quantile(np.array(1.0))) == pytest.approx(0.6)


def test_without_a_discrepancy_misfit_passes_for_memory(make_record: Callable[..., Record]) -> None:
    record = with_a_second_step(make_record(("force",), n=200, noise=0.002))
    choice = choice_for(record, discrepancy=False)
    assert not any(choice.bases)
    assert NOISE_MODELS[choice.name].autocorrelated
    assert choice.ln_evidence["independent"] < -50.0


@pytest.mark.parametrize("name", ["student_t", "ar1+growing", "independent+temperature_error"])
def test_a_noise_model_that_was_asked_for_is_the_only_one(
    make_record: Callable[..., Record], name: str
) -> None:
    choice = choice_for(make_record(n=80), noise=name)
    assert choice.name == name
    assert dict(choice.ln_evidence) == {name: 0.0}
    assert len(choice.estimate[0]["force"]) == len(NOISE_MODELS[name].parameters("force", "N", "s")) + (
        "force" in choice.bases[0]
    )


def test_noise_that_grows_with_the_response_is_seen(make_record: Callable[..., Record]) -> None:
    record = make_record(("force",), n=300, noise=0.0)
    y = record.observed["force"]
    sd = 0.01 * np.ptp(y) * np.exp(2.0 * ((y - y.min()) / np.ptp(y) - 0.5))
    noisy = replace(record, observed={"force": y + sd * np.random.default_rng(0).standard_normal(300)})
    choice = choice_for(noisy)
    assert choice.name == "independent+growing"
    assert choice.estimate[0]["force"][1] == pytest.approx(2.0, abs=0.6)


def test_growth_is_seldom_looked_at_where_noise_has_a_memory_alone(
    make_record: Callable[..., Record],
) -> None:
    """Residuals with a memory follow the response by chance, in five of six records; innovations do in one of six."""
    records = [make_record(n=100, seed=seed, memory=0.6) for seed in range(12)]
    looked_at = [any("growing" in name for name in choice_for(r).ln_evidence) for r in records]
    assert sum(looked_at) <= 5


@pytest.mark.parametrize("memory", [0.0, 0.9])
def test_growth_is_found_whether_or_not_noise_has_a_memory(
    make_record: Callable[..., Record], memory: float
) -> None:
    """Where the memory is long, the residuals show it and innovations hardly do."""
    record = make_record(n=150, seed=1, memory=memory)
    quiet = make_record(n=150, seed=1, memory=memory, noise=1e-9)
    observed = {}
    for channel, y in record.observed.items():
        curve = quiet.observed[channel]
        share = (curve - curve.min()) / np.ptp(curve)
        observed[channel] = curve + (y - curve) * (0.2 + 1.8 * share)
    assert "growing" in choice_for(replace(record, observed=observed)).name


def test_a_great_declared_error_of_the_thermometer_is_no_memory_and_no_misfit(
    make_record: Callable[..., Record],
) -> None:
    """As wide as the transformation: of 40 other records one got a memory and one a discrepancy (95 %: up to 1 in 8).

    At 1 in 8 more than 4 of 12 happen once in 90 runs each; seeds are fixed. Moments by the slope of the plain
    least-squares curve gave 12 of the 40 growth, a memory or a discrepancy.
    """
    choices = [
        choice_for(make_record(n=100, noise=0.005, temperature_sd=3.5, span=(10.0, 90.0), seed=seed))
        for seed in range(12)
    ]
    assert sum(c.name.startswith("ar1") for c in choices) <= 4
    assert sum(bool(c.bases[0]) for c in choices) <= 4


def test_where_the_curve_fails_in_one_channel_the_other_is_not_trusted(
    make_record: Callable[..., Record],
) -> None:
    """Slopes of both phases, seen in one channel and hidden by six times the noise in the other."""
    for noisy in ("force", "displacement"):
        record = make_record(n=150, noise=0.0025)
        rng = np.random.default_rng(8)
        tilt = 0.08 * (record.temperature - 50.0) / 40.0
        observed = {}
        for channel, y in record.observed.items():
            more = np.sqrt(35.0) * 0.0025 * rng.standard_normal(record.n) * (channel == noisy)
            observed[channel] = y + np.ptp(y) * (tilt * (record.temperature > 52.0) + more)
        choice = choice_for(replace(record, observed=observed))
        assert set(choice.bases[0]) == {"force", "displacement"}
        assert set(choice.discrepancy) == {"force", "displacement"}
    alone = choice_for(replace(record, observed={"force": observed["force"]}))
    assert set(alone.bases[0]) == {"force"}


@pytest.mark.parametrize("seed", [0, 1])
def test_an_undeclared_error_of_the_thermometer_is_seen_and_a_declared_one_is_not_sought(
    make_record: Callable[..., Record], seed: int
) -> None:
    record = make_record(n=300, noise=0.003, temperature_sd=0.4, seed=seed)
    choice = choice_for(replace(record, temperature_sd=0.0))
    assert choice.name.endswith("temperature_error")
    assert "growing" not in choice.name
    assert choice.temperature_sd[0] == pytest.approx(0.4, rel=0.2)
    assert "temperature_error" not in choice_for(record).name


def test_a_memory_in_time_is_told_from_one_in_samples(make_record: Callable[..., Record]) -> None:
    record = make_record(("force",), n=600, noise=1e-6)
    rng = np.random.default_rng(5)
    dt = rng.choice([0.1, 5.0], record.n)
    e = rng.standard_normal(record.n)
    for i in range(1, record.n):
        phi = np.exp(-dt[i] / 3.0)
        e[i] = phi * e[i - 1] + np.sqrt(1.0 - phi**2) * e[i]
    force = record.observed["force"]
    timed = replace(
        record,
        inputs={**record.inputs, "time": np.cumsum(dt)},
        observed={"force": force + 0.01 * np.ptp(force) * e},
    )
    assert choice_for(timed).name == "ar1_time"


def test_the_reason_names_model_rival_and_correlations(make_record: Callable[..., Record]) -> None:
    choice = choice_for(make_record(n=200))
    assert choice.reason.startswith(NOISE_MODELS[choice.name].title)
    for channel, value in choice.lag1.items():
        assert f"{value:.2f} ({channel})" in choice.reason
    assert sum(v == 0.0 for v in choice.ln_evidence.values()) == 1


def test_what_is_no_density_of_the_data_is_not_compared(make_record: Callable[..., Record]) -> None:
    assert all(NOISE_MODELS[name].is_density for name in choice_for(make_record(n=50)).ln_evidence)


@pytest.mark.parametrize("name", list(NOISE_MODELS))
def test_a_start_has_the_curve_and_the_noise_of_the_warm_start(
    make_record: Callable[..., Record], name: str
) -> None:
    record = make_record(n=400, memory=0.6)
    first = build_posterior([record], NOISE_MODELS["independent"], DEFAULT)
    start = warm_start(first, np.random.default_rng(0))
    posterior = posterior_with(name, first, start, DEFAULT)
    z = noise_start(posterior, start)
    theta = posterior.space.constrain(z)
    np.testing.assert_allclose(theta[: start.theta.size], start.theta, rtol=1e-10)
    for channel in record.channels:
        sd = theta[posterior.space.index(f"{channel}_sd")]
        assert 0.3 < sd / np.std(start.residual[0][channel]) < 1.5
    if name == "ar1":
        assert theta[posterior.space.index("force_phi")] == pytest.approx(0.6, abs=0.15)
    assert np.isfinite(posterior.log_prob(z)[0])


def test_an_exact_curve_still_has_a_start(make_record: Callable[..., Record]) -> None:
    record = make_record(("force",), noise=0.0)
    posterior = build_posterior([record], NOISE_MODELS["independent"], DEFAULT)
    start = warm_start(posterior, np.random.default_rng(0))
    flat = replace(start, residual=({"force": np.zeros(record.n)},))
    assert np.isfinite(noise_start(posterior, flat)).all()


def test_a_start_has_what_the_choice_found_beside_the_curve(make_record: Callable[..., Record]) -> None:
    record = with_a_second_step(make_record(("force",), n=200, noise=0.002))
    first = build_posterior([record], NOISE_MODELS["independent"], DEFAULT)
    start = warm_start(first, np.random.default_rng(0))
    choice = choose_noise(first, start, DEFAULT)
    posterior = posterior_with(choice.name, first, start, DEFAULT, choice)
    assert posterior.has_discrepancy
    assert posterior.names[-1] == "force_discrepancy"
    z = noise_start(posterior, start, choice)
    theta = posterior.space.constrain(z)
    np.testing.assert_allclose(theta[start.theta.size :], choice.estimate[0]["force"], rtol=1e-9)
    alone = posterior_with(choice.name, first, start, DEFAULT)
    assert posterior.log_likelihood(theta[None])[0] > alone.log_likelihood(theta[None, :-1])[0] + 50.0


def test_no_heavy_tails_beside_a_discrepancy_unless_asked_for(make_record: Callable[..., Record]) -> None:
    """Readings of Student's t with three degrees about a curve with a second step."""
    record = with_a_second_step(make_record(("force",), n=200, noise=0.0, seed=5))
    noise = 0.005 * np.ptp(record.observed["force"]) * np.random.default_rng(1).standard_t(3.0, record.n)
    record = replace(record, observed={"force": record.observed["force"] + noise})
    choice = choice_for(record)
    assert NOISE_MODELS[choice.name].is_gaussian
    assert choice.bases[0]
    asked = choice_for(record, noise="student_t")
    assert asked.name == "student_t"
    assert asked.bases[0]


@pytest.mark.parametrize("step", [True, False])
def test_a_discrepancy_is_fitted_under_heavy_tails_only_where_it_decides(
    make_record: Callable[..., Record], monkeypatch: pytest.MonkeyPatch, step: bool
) -> None:
    """Most of the time of a choice went there. Where the curve fails tails alone don't do, and that is all."""
    record = make_record(("force",), n=200, noise=0.0, seed=5)
    record = with_a_second_step(record) if step else record
    noise = 0.0003 * np.ptp(record.observed["force"]) * np.random.default_rng(1).standard_t(3.0, record.n)
    seen = []
    look = noise_choice._Residuals._look

    def counted(self: Any, model: NoiseModel, i: int, channel: str, basis: Any, *bound: Any) -> Any:
        if not model.is_gaussian:
            seen.append((model.name, basis is not None))
        return look(self, model, i, channel, basis, *bound)

    monkeypatch.setattr(noise_choice._Residuals, "_look", counted)
    choice = choice_for(replace(record, observed={"force": record.observed["force"] + noise}))
    assert seen
    assert NOISE_MODELS[choice.name].is_gaussian == step
    assert any(beside for _, beside in seen) != step
