"""Ensembles: what a run promises whatever the density; how well it samples is tried in tests/statistical."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import emcee
import numpy as np
import pytest
from scipy.stats import norm, t as student_t
from threadpoolctl import threadpool_limits

from sma_bayes.errors import ResumeError
from sma_bayes.fitting.noise_choice import noise_start, posterior_with
from sma_bayes.fitting.posterior import build_posterior
from sma_bayes.fitting.warm_start import warm_start
from sma_bayes.noise import NOISE_MODELS
from sma_bayes.parameters.priors_file import parse_priors, read_priors
from sma_bayes.records.types import Branch, Condition, Record
from sma_bayes.sampling import audit, ensembles
from sma_bayes.sampling.adaptation import Adapted, adapt
from sma_bayes.sampling.convergence import Target, assess
from sma_bayes.sampling.ensembles import Draws, Plan, sample
from sma_bayes.sampling.moves import SAMPLERS


class Interrupted(Exception):
    """The power went."""


@dataclass
class Density:
    """A planted density that can be made to fail after a number of calls."""

    function: Callable[[np.ndarray], np.ndarray]
    d: int
    calls_left: float = np.inf
    calls: int = field(default=0, init=False)

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(f"x{i}" for i in range(self.d))

    def log_prob(self, z: np.ndarray) -> np.ndarray:
        self.calls += 1
        self.calls_left -= 1
        if self.calls_left < 0:
            raise Interrupted
        return self.function(np.atleast_2d(z))

    def draw_prior(self, rng: np.random.Generator, size: int) -> np.ndarray:
        return rng.normal(0.0, 4.0, (size, self.d))


def gaussian(d: int = 3) -> Density:
    return Density(lambda z: -0.5 * np.einsum("ij,ij->i", z, z), d)


def banana() -> Density:
    """Bent enough that a proposal alone does not carry."""
    return Density(lambda z: -0.5 * z[:, 0] ** 2 - 0.5 * ((z[:, 1] - z[:, 0] ** 2) / 0.3) ** 2, 2)


def funnel(d: int = 6) -> Density:
    """Width from e**-6 to e**6 of that at the middle: out of reach of a small effort."""

    def log_prob(z: np.ndarray) -> np.ndarray:
        v = z[:, 0]
        return -0.5 * (v / 3.0) ** 2 - 0.5 * (z[:, 1:] ** 2).sum(axis=1) * np.exp(-v) - 0.5 * (d - 1) * v

    return Density(log_prob, d)


def two_lumps(d: int = 2) -> Density:
    """Equal unit normals 8 apart in the first coordinate."""

    def log_prob(z: np.ndarray) -> np.ndarray:
        rest = -0.5 * np.einsum("ij,ij->i", z[:, 1:], z[:, 1:])
        left, right = (-0.5 * (z[:, 0] - c) ** 2 for c in (-4.0, 4.0))
        return rest + np.logaddexp(left, right) + np.log(0.5)

    return Density(log_prob, d)


EITHER_SIGN = """
schema = "sma-bayes/priors/1"
model = "modified_sigmoid"
[both]
A1 = { family = "lognormal", median = 0.02, sigma = 0.3, unit = "m" }
A2 = { family = "normal", mean = 0.0, sd = 0.4, unit = "1/K" }
A3 = { family = "normal", mean = 50.0, sd = 6.0, unit = "degC" }
B1 = { family = "lognormal", median = 2.5, sigma = 0.3, unit = "N" }
B2 = { family = "normal", mean = 0.0, sd = 0.4, unit = "1/K" }
B3 = { family = "normal", mean = 50.0, sd = 6.0, unit = "degC" }
[noise]
phi = { family = "uniform", low = -1.0, high = 1.0 }
sd = { family = "lognormal", median = 0.02, sigma = 1.0, relative_to = "span(channel)" }
"""

QUICK = Plan(target=Target(1.05, 200.0), explore_block=40, walkers=32)


def dispersed_starts(
    density: Density, rng: np.random.Generator, width: np.ndarray, count: int = 12
) -> list[np.ndarray]:
    """Best of many draws from the prior that are at least a fifth of the prior's width from one another."""
    z = density.draw_prior(rng, 2000)
    z = z[np.argsort(-density.log_prob(z), kind="stable")]
    chosen: list[np.ndarray] = []
    for point in z:
        if all(np.max(np.abs(point - other) / width) > 0.2 for other in chosen):
            chosen.append(point)
        if len(chosen) == count:
            break
    return chosen


def run(density: Density, seed: int = 0, plan: Plan | None = None, **options) -> Draws:
    width = np.full(density.d, 4.0)
    starts = dispersed_starts(density, np.random.default_rng(seed), width)
    return sample(density, starts, width, np.random.SeedSequence(seed), plan, **options)


def same(first: Draws, second: Draws) -> None:
    np.testing.assert_array_equal(first.z, second.z)
    np.testing.assert_array_equal(first.log_prob, second.log_prob)
    assert first.evaluations == second.evaluations
    assert first.ln_evidence == second.ln_evidence
    assert first.method == second.method


# --- what a run gives ---------------------------------------------------------------------------------


@pytest.mark.parametrize("make", [gaussian, two_lumps])
def test_easy_densities_are_sampled_by_independence_moves(make: Callable[[], Density]) -> None:
    density = make()
    draws = run(density)
    assert draws.method == "independence"
    assert draws.convergence.converged
    groups, steps, walkers, d = draws.z.shape
    assert groups >= 4
    assert (walkers, d) == (64, density.d)
    assert draws.log_prob.shape == (groups, steps, walkers)
    np.testing.assert_allclose(draws.log_prob.ravel(), density.function(draws.z.reshape(-1, d)))
    assert draws.convergence.rhat.max() <= 1.01
    assert min(draws.convergence.ess_bulk.min(), draws.convergence.ess_tail.min()) >= 1000.0
    assert 0.3 < draws.acceptance <= 1.0
    assert 0.3 < draws.efficiency <= 1.0
    expected = 0.5 * density.d * np.log(2.0 * np.pi)
    assert abs(draws.ln_evidence - expected) < 5.0 * draws.ln_evidence_sd + 1e-3
    assert draws.ln_evidence_sd < 0.02


def test_two_lumps_are_two_modes_with_their_shares() -> None:
    """About 4,000 effective draws: the share of each within 4 standard errors, 0.03; the seed is fixed."""
    draws = run(two_lumps())
    assert len(draws.modes) == 2
    assert np.mean(draws.z[..., 0] < 0.0) == pytest.approx(0.5, abs=0.03)


def test_what_is_not_covered_is_explored() -> None:
    draws = run(
        banana(), seed=3, plan=QUICK
    )  # of another seed the weights may pass: the bend is at the limit
    assert draws.method != "independence"
    assert draws.convergence.converged


def test_a_second_proposal_that_misses_what_walkers_met_is_not_run(monkeypatch: pytest.MonkeyPatch) -> None:
    fitted: list[Adapted] = []

    def blind(*given) -> Adapted:
        fitted.append(adapt(*given))
        return fitted[-1] if len(fitted) == 1 else replace(fitted[-1], greatest_seen=1e5)

    monkeypatch.setattr(ensembles, "adapt", blind)
    monkeypatch.setattr(audit, "MAX_PARETO_K", -np.inf)  # no audit is passed
    draws = run(gaussian(), plan=QUICK)
    assert len(fitted) == 2
    assert draws.method == "independence and differential evolution"


def test_evaluations_are_those_that_the_density_saw() -> None:
    for density, plan in ((gaussian(), None), (banana(), QUICK)):
        rows = 0
        inner = density.function

        def counted(z: np.ndarray, inner=inner) -> np.ndarray:
            nonlocal rows
            rows += len(z)
            return inner(z)

        width = np.full(density.d, 4.0)
        starts = dispersed_starts(density, np.random.default_rng(0), width)
        density.function = counted
        draws = sample(density, starts, width, np.random.SeedSequence(0), plan)
        assert draws.evaluations == pytest.approx(rows, rel=0.05)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["de", pytest.param("stretch", marks=pytest.mark.thorough)])
def test_other_samplers_cross_check_the_default(name: str) -> None:
    """Shares of a bent density below three quantiles of the default's draws: 1,000 effective draws on either side, so
    that 4.5 standard errors are 0.1; the seeds are fixed."""
    density, target = banana(), Target(1.01, 1000.0)
    found = run(density, 1, Plan(target=target, sampler=SAMPLERS[name], explore_block=100))
    assert found.method == SAMPLERS[name].title
    assert found.convergence.converged
    assert found.audit is None  # nothing was proposed that could hide a tail
    z = found.z.reshape(-1, 2)
    levels = np.array([0.05, 0.5, 0.95])
    shares = (z[:, 0][:, None] <= norm.ppf(levels)).mean(axis=0)
    np.testing.assert_allclose(shares, levels, atol=4.5 * np.sqrt(0.25 / 1000.0))
    expected = np.log(2.0 * np.pi * 0.3)
    assert abs(found.ln_evidence - expected) < 5.0 * found.ln_evidence_sd


def test_samplers_are_part_of_what_a_checkpoint_is_of(tmp_path: Path) -> None:
    path = tmp_path / "chain.h5"
    run(gaussian(), 0, replace(QUICK, sampler=SAMPLERS["de"]), checkpoint=path)
    again = run(gaussian(), 0, replace(QUICK, sampler=SAMPLERS["de"]), checkpoint=path)
    same(run(gaussian(), 0, replace(QUICK, sampler=SAMPLERS["de"])), again)
    with pytest.raises(ResumeError):
        run(gaussian(), 0, QUICK, checkpoint=path)


# --- planted shapes: never converged and wrong --------------------------------------------------------
#
# At least 1000 effective draws: means have standard errors of 0.03 sd and sds of 2 % (heavier tails: 4 %), shares
# below a quantile of 0.016. Tolerances of 0.12 sd, 12 % and 0.06 are more than 3 of these, for a dozen coordinates.


def right_moments(draws: Draws, mean: np.ndarray, sd: np.ndarray) -> None:
    z = draws.z.reshape(-1, mean.size)
    np.testing.assert_allclose((z.mean(axis=0) - mean) / sd, 0.0, atol=0.12, err_msg="means [sd]")
    np.testing.assert_allclose(z.std(axis=0) / sd, 1.0, atol=0.12, err_msg="ratios of sds")


def right_shares(draws: Draws, quantile: Callable[[float], float]) -> None:
    """Of every coordinate, below quantiles of its marginal; for tails whose variance is hardly ever right."""
    z = draws.z.reshape(-1, draws.z.shape[-1])
    for p in (0.05, 0.25, 0.5, 0.75, 0.95):
        np.testing.assert_allclose(np.mean(z < quantile(p), axis=0), p, atol=0.06)


def test_a_nearly_singular_gaussian_in_twelve_dimensions() -> None:
    """Widths from 1e-5 to 1 along axes that no coordinate follows."""
    axes, _ = np.linalg.qr(np.random.default_rng(0).standard_normal((12, 12)))
    width = np.geomspace(1e-5, 1.0, 12)
    draws = run(Density(lambda z: -0.5 * (((z @ axes) / width) ** 2).sum(axis=1), 12))
    assert draws.convergence.converged
    right_moments(draws, np.zeros(12), np.sqrt((axes**2) @ width**2))
    along = (draws.z.reshape(-1, 12) @ axes).std(axis=0)
    np.testing.assert_allclose(along / width, 1.0, atol=0.12)


@pytest.mark.parametrize("seed", [0, 1])
def test_two_modes_of_unequal_weight_in_ten_dimensions(seed: int) -> None:
    """One to four, ten standard deviations apart."""

    def log_prob(z: np.ndarray) -> np.ndarray:
        rest = -0.5 * (z[:, 1:] ** 2).sum(axis=1)
        return rest + np.logaddexp(
            np.log(0.8) - 0.5 * (z[:, 0] + 5) ** 2, np.log(0.2) - 0.5 * (z[:, 0] - 5) ** 2
        )

    draws = run(Density(log_prob, 10), seed)
    assert draws.convergence.converged
    assert len(draws.modes) == 2
    right_moments(draws, np.array([-3.0, *np.zeros(9)]), np.array([np.sqrt(17.0), *np.ones(9)]))


@pytest.mark.slow
@pytest.mark.thorough
@pytest.mark.parametrize("joint", [True, False], ids=["multivariate", "independent"])
def test_heavy_tails_in_ten_dimensions(joint: bool) -> None:
    """Student's t with 3 degrees of freedom: one radius for all coordinates, or each its own.

    Its kurtosis is infinite: standard deviations may stay unknown whatever is drawn, and shares are right then, too.
    """

    def log_prob(z: np.ndarray) -> np.ndarray:
        if joint:
            return -6.5 * np.log1p((z**2).sum(axis=1) / 3.0)
        return -2.0 * np.log1p(z**2 / 3.0).sum(axis=1)

    draws = run(Density(log_prob, 10), plan=Plan(evaluations=600_000))
    found, target = draws.convergence, Plan().target
    if not found.converged and draws.evaluations < 600_000:
        assert found.sd_error.max() > target.sd_error
        assert replace(found, sd_error=np.zeros(10)).reaches(target)
    if found.converged or draws.evaluations < 600_000:
        right_shares(draws, student_t(3).ppf)


def funnel_of(width: float) -> Density:
    """Of widths from exp(-width) to exp(width) of that in the middle, in nine directions."""

    def log_prob(z: np.ndarray) -> np.ndarray:
        v = z[:, 0]
        return -0.5 * (v / width) ** 2 - 0.5 * (z[:, 1:] ** 2).sum(axis=1) * np.exp(-v) - 4.5 * v

    return Density(log_prob, 10)


@pytest.mark.slow
@pytest.mark.thorough
def test_a_funnel_in_ten_dimensions() -> None:
    """Most runs reach it within 440,000 to 1,100,000 evaluations, one in twelve not within 2,000,000.

    Which ones is a matter of rounding, which differs between processors: by chance fewer than two of four do so once in
    500 times.
    """
    runs = [run(funnel_of(1.0), seed, plan=Plan(evaluations=2_000_000)) for seed in range(4)]
    reached = [draws for draws in runs if draws.convergence.converged]
    assert len(reached) >= 2
    for draws in reached:
        right_moments(draws, np.zeros(10), np.array([1.0, *np.full(9, np.exp(0.25))]))


@pytest.mark.slow
@pytest.mark.thorough
def test_a_wide_funnel_is_out_of_reach() -> None:
    assert not run(funnel_of(3.0), plan=Plan(evaluations=600_000)).convergence.converged


@pytest.mark.slow
def test_a_banana_in_twelve_dimensions() -> None:
    """Bent by as much as it is wide: ``x1 = x0**2 + N(0, 1)``."""

    def log_prob(z: np.ndarray) -> np.ndarray:
        bent = -0.5 * (z[:, 1] - z[:, 0] ** 2) ** 2
        return bent - 0.5 * z[:, 0] ** 2 - 0.5 * (z[:, 2:] ** 2).sum(axis=1)

    draws = run(Density(log_prob, 12), plan=Plan(evaluations=600_000))
    if draws.convergence.converged:
        right_moments(draws, np.array([0.0, 1.0, *np.zeros(10)]), np.array([1.0, np.sqrt(3.0), *np.ones(10)]))
    else:
        assert draws.evaluations >= 600_000


def test_two_modes_of_a_record_with_memory(make_record: Callable[..., Record]) -> None:
    """Stiffness does not tell the common sign of A2 and B2; with priors that do not either, both modes count alike."""
    priors = parse_priors(EITHER_SIGN, "either_sign.toml")
    record = make_record(("stiffness",), seed=1, noise=0.02, memory=0.6)
    posterior = build_posterior([record], NOISE_MODELS["ar1"], priors)
    z = noise_start(posterior, warm_start(posterior, np.random.default_rng(0)))
    signs = np.array([-1.0 if name in ("A2", "B2") else 1.0 for name in posterior.names])
    draws = sample(posterior, [z, signs * z], posterior.space.prior_sd(), np.random.SeedSequence(3))
    assert draws.convergence.converged
    assert len(draws.modes) == 2
    positive = draws.z[..., posterior.names.index("A2")] > 0
    assert np.mean(positive) == pytest.approx(0.5, abs=0.06)


@pytest.mark.slow
@pytest.mark.thorough
@pytest.mark.parametrize("seed", [0, 1])
def test_a_transition_that_fell_between_two_samples(seed: int) -> None:
    """Two levels are known, and of the transition that it was in between; the slower, the farther apart the levels end.

    A1 and A4 have a long tail on one side, with A2 and A3 as wide as the gap. Ten seconds, a quarter of the effort.
    """
    rng = np.random.default_rng(4)
    t = np.concatenate([rng.normal(26.6, 0.07, 11), [53.6], rng.normal(57.3, 0.4, 6)])
    x = 0.0144 / (1.0 + np.exp(-0.6 * (t - 42.0))) + 1.5e-4 * rng.standard_t(3.0, t.size)
    units = {"temperature": "degC", "displacement": "m"}
    record = Record(
        Condition("c"), Branch.HEATING, {"temperature": t}, {"displacement": x}, np.arange(18) + 1, units
    )
    first = build_posterior([record], NOISE_MODELS["independent"], read_priors("modified_sigmoid"))
    start = warm_start(first, np.random.default_rng(seed))
    posterior = posterior_with("student_t", first, start, read_priors("modified_sigmoid"))
    z = noise_start(posterior, start)
    plan = Plan(target=Target(), evaluations=1_500_000)
    draws = sample(posterior, [z], posterior.space.prior_sd(), np.random.SeedSequence(seed), plan)
    assert draws.convergence.converged


# --- honesty ------------------------------------------------------------------------------------------


def test_what_is_spent_before_the_target_is_called_not_converged() -> None:
    plan = Plan(evaluations=20_000, explore_block=40, walkers=32)
    draws = run(funnel(), plan=plan)
    assert not draws.convergence.converged
    assert draws.evaluations < 200_000  # adapting and one block of each stage come before the count
    assert np.isfinite(draws.log_prob).all()


def test_a_target_out_of_reach_is_never_reached() -> None:
    plan = Plan(target=Target(1.0, 1e9), evaluations=100_000, explore_block=40, walkers=32)
    assert not run(gaussian(), plan=plan).convergence.converged


@pytest.mark.parametrize("make", [gaussian, two_lumps, banana])
def test_the_verdict_is_no_better_than_the_draws(make: Callable[[], Density]) -> None:
    """Where walkers interact more may be asked than the target, never less."""
    draws = run(make(), plan=QUICK)
    again = assess(draws.z, QUICK.target)
    np.testing.assert_allclose(again.rhat, draws.convergence.rhat)
    assert again.converged >= draws.convergence.converged


def test_walkers_that_interact_move_for_many_autocorrelation_times() -> None:
    """Before they are called converged; else they would agree before they have come to the ends of a ridge."""
    draws = run(banana(), seed=3, plan=QUICK)
    if draws.method == "independence and differential evolution":
        groups, _, walkers, _ = draws.z.shape
        assert draws.convergence.ess_bulk.min() >= 20 * groups * walkers


@pytest.mark.parametrize(("noise", "off"), [("independent", 0.0), ("independent", 1.0), ("ar1", 0.0)])
def test_draws_do_not_depend_on_where_a_climb_begins(
    noise: str, off: float, make_record: Callable[..., Record]
) -> None:
    """A start at the least-squares optimum, one a prior sd away, and noise with a memory: the draws are the same."""
    posterior = build_posterior([make_record()], NOISE_MODELS[noise], read_priors("modified_sigmoid"))
    width = posterior.space.prior_sd()
    start = noise_start(posterior, warm_start(posterior, np.random.default_rng(0)))
    wanted = sample(
        posterior, [ensembles.find_mode(posterior, start, width)], width, np.random.SeedSequence(1)
    )
    found = sample(posterior, [start + off * width], width, np.random.SeedSequence(2))
    assert found.convergence.converged
    assert len(found.modes) == 1
    means, sds = (
        [each(d.z.reshape(-1, width.size), axis=0) for d in (wanted, found)] for each in (np.mean, np.std)
    )
    assert np.abs((means[0] - means[1]) / sds[0]).max() < 4.5 * np.sqrt(2.0 / 1000.0)


def test_the_first_block_is_as_long_as_target_and_proposal_ask() -> None:
    steps = [
        ensembles._steps_hoped(efficiency, 256, Plan(target=Target())) for efficiency in (0.94, 0.7, 0.5)
    ]
    assert steps[0] == Plan().block
    assert steps == sorted(steps)
    assert 256 * 0.5 * (steps[2] - 1) < ensembles.DRAWS_PER_EFFECTIVE * 1000.0 <= 256 * 0.5 * steps[2]
    most = ensembles.MAX_BLOCKS * Plan().block
    assert ensembles._steps_hoped(0.94, 256, Plan(target=Target(1.01, 1e9))) == most
    assert Plan().target.draws > 3000.0  # so many tell the outer quantiles, not 1,000


def test_draws_are_made_until_standard_deviations_are_told() -> None:
    wanted = Target(sd_error=0.005)
    draws, before = run(gaussian(), plan=Plan(target=wanted)), run(gaussian(), plan=Plan(target=Target()))
    assert draws.convergence.converged
    assert draws.convergence.sd_error.max() <= wanted.sd_error < before.convergence.sd_error.min()


def test_what_is_not_told_by_the_greatest_length_is_not_converged() -> None:
    draws = run(gaussian(), plan=Plan(target=Target(sd_error=1e-4)))
    assert not draws.convergence.converged
    assert draws.convergence.reaches(Target())  # for this reason alone
    assert (draws.method, draws.z.shape[1]) == (ensembles.INDEPENDENCE, ensembles.MAX_SD_STEPS)


def test_fewer_than_four_ensembles_are_refused() -> None:
    with pytest.raises(ValueError, match="at least 4"):
        Plan(groups=3)


@pytest.mark.parametrize("channels", [("force", "displacement"), ("stiffness",)])
@pytest.mark.parametrize(("parameter", "at"), [(-1, -800.0), (slice(None), np.nan), (slice(None), 1e3)])
def test_a_start_of_no_density_is_an_error(
    parameter: int | slice, at: float, channels: tuple[str, ...], make_record: Callable[..., Record]
) -> None:
    """No noise at all, no number, everything far beyond what the prior can bear."""
    posterior = build_posterior(
        [make_record(channels)], NOISE_MODELS["independent"], read_priors("modified_sigmoid")
    )
    start = noise_start(posterior, warm_start(posterior, np.random.default_rng(0)))
    start[parameter] = at
    with pytest.raises(ValueError, match="zero at every start"):
        sample(posterior, [start], posterior.space.prior_sd(), np.random.SeedSequence(0))


def test_nothing_to_start_from_is_an_error() -> None:
    density = Density(lambda z: np.full(len(z), -np.inf), 2)
    with pytest.raises(ValueError, match="zero at every start"):
        sample(density, [np.zeros(2)], np.ones(2), np.random.SeedSequence(0))


def test_no_start_at_all_is_the_same_error(make_record: Callable[..., Record]) -> None:
    posterior = build_posterior([make_record()], NOISE_MODELS["independent"], read_priors("modified_sigmoid"))
    with pytest.raises(ValueError, match="zero at every start"):
        sample(posterior, [], posterior.space.prior_sd(), np.random.SeedSequence(0))


def test_progress_is_told() -> None:
    said: list[str] = []
    run(banana(), seed=3, plan=QUICK, progress=said.append)
    assert said[0] == "finding the modes"
    assert any("exploring" in s for s in said)


# --- seeds --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("make", [gaussian, banana])
def test_the_seed_decides_every_draw(make: Callable[[], Density]) -> None:
    np.random.seed(1)  # noqa: NPY002 - numpy's global state must not matter
    first = run(make(), 3, QUICK)
    np.random.seed(2)  # noqa: NPY002
    same(first, run(make(), 3, QUICK))
    assert not np.array_equal(first.z, run(make(), 4, QUICK).z)


def test_ensembles_do_not_repeat_each_other() -> None:
    for make in (gaussian, banana):
        z = run(make(), plan=QUICK).z
        for g in range(1, len(z)):
            assert not np.any(z[g, -1] == z[0, -1])


def test_threads_of_linear_algebra_do_not_matter(make_record: Callable[..., Record]) -> None:
    posterior = build_posterior([make_record(n=60)], NOISE_MODELS["ar1"], read_priors("modified_sigmoid"))
    results = []
    for threads in (1, 2):
        with threadpool_limits(limits=threads):
            start = warm_start(posterior, np.random.default_rng(0))
            z = noise_start(posterior, start)
            results.append(sample(posterior, [z], posterior.space.prior_sd(), np.random.SeedSequence(1)))
    same(*results)


# --- interruption -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("make", "share"), [(gaussian, 0.5), (gaussian, 0.9), (banana, 0.1), (banana, 0.5), (banana, 0.95)]
)
def test_an_interrupted_run_goes_on_to_the_same_draws(
    make: Callable[[], Density], share: float, tmp_path: Path
) -> None:
    density = make()
    width = np.full(density.d, 4.0)
    starts = dispersed_starts(density, np.random.default_rng(0), width)
    density.calls = 0
    whole = sample(density, starts, width, np.random.SeedSequence(5), QUICK)
    total = density.calls
    options = {"checkpoint": tmp_path / "chains.h5", "fingerprint": "this one"}
    broken = make()
    broken.calls_left = int(share * total)
    with pytest.raises(Interrupted):
        sample(broken, starts, width, np.random.SeedSequence(5), QUICK, **options)
    resumed = make()
    same(whole, sample(resumed, starts, width, np.random.SeedSequence(5), QUICK, **options))
    finished = make()
    same(whole, sample(finished, starts, width, np.random.SeedSequence(5), QUICK, **options))
    assert finished.calls <= resumed.calls


@pytest.mark.parametrize("change", ["fingerprint", "seed", "plan"])
def test_another_run_is_not_resumed(change: str, tmp_path: Path) -> None:
    path = tmp_path / "chains.h5"
    run(gaussian(), 1, QUICK, checkpoint=path, fingerprint="one")
    with pytest.raises(ResumeError):
        run(
            gaussian(),
            2 if change == "seed" else 1,
            Plan() if change == "plan" else QUICK,
            checkpoint=path,
            fingerprint="two" if change == "fingerprint" else "one",
        )


def test_emcee_opens_what_a_run_leaves(tmp_path: Path) -> None:
    path = tmp_path / "chains.h5"
    draws = run(gaussian(), 1, QUICK, checkpoint=path, fingerprint="one")
    chain = emcee.backends.HDFBackend(str(path), name="independence", read_only=True).get_chain()
    np.testing.assert_array_equal(chain, np.concatenate(draws.z, axis=1))  # groups side by side
