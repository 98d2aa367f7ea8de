"""Fits, evidences and held-out predictions of contenders, against closed forms and brute force."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import multivariate_normal, norm

from sma_bayes.assess import held_out
from sma_bayes.assess.correlation import joined
from sma_bayes.assess.held_out import folds_of, part
from sma_bayes.errors import MeasurementError
from sma_bayes.fitting.noise_choice import LEAST_LN_EVIDENCE_GAIN, discrepancy_bases
from sma_bayes.noise import NOISE_MODELS
from sma_bayes.parameters.priors_file import PriorSet, read_priors
from sma_bayes.records.types import Branch, Condition, Record
from sma_bayes.sampling import importance
from sma_bayes.sampling.importance import WeightedDraws
from sma_bayes.studies.compare.comparison import (
    Comparison,
    FittedContender,
    finished_comparison,
    start_comparison,
)
from sma_bayes.studies.compare.contenders import (
    contenders,
    joined as joined_records,
    observables,
    of_channel,
    posterior_of,
)
from sma_bayes.studies.compare.document import record_document

PRIORS = read_priors("modified_sigmoid")
LINE = next(c for c in contenders() if c.name == "polynomial_corrected")


def compare_record(
    record: Record, priors: PriorSet, progress: Callable[[str], None] | None = None, **options: Any
) -> Comparison:
    """A comparison from start to end."""
    return finished_comparison(start_comparison(record, priors, **options), progress)


def noisy_line(n: int, seed: int) -> Record:
    """Stiffness on a straight line with Gaussian noise."""
    t = np.linspace(30.0, 70.0, n)
    k = 40.0 + 1.5 * t + 3.0 * np.random.default_rng(seed).standard_normal(n)
    units = {"temperature": "degC", "stiffness": "N/m"}
    inputs, observed = {"temperature": t}, {"stiffness": k}
    return of_channel(
        Record(Condition("c"), Branch.HEATING, inputs, observed, np.arange(n) + 1, units), "stiffness"
    )


@pytest.fixture(scope="module")
def record() -> Record:
    return noisy_line(30, 3)


@pytest.fixture(scope="module")
def line(record: Record) -> Comparison:
    return compare_record(record, PRIORS, noise="independent", only=["polynomial_corrected"])


def exact(record: Record) -> Callable[[float], float]:
    """Prior predictive of the line at given noise: normal, with the coefficients integrated out."""
    posterior = posterior_of(LINE, record, NOISE_MODELS["independent"], PRIORS)
    priors = [p.prior for p in posterior.space.parameters[:2]]
    design = posterior.model.jacobian(np.zeros(2), record.inputs)["stiffness"]
    mean = design @ np.array([p.mean for p in priors])
    covariance = (design * np.array([p.sd for p in priors]) ** 2) @ design.T

    def density(sd: float) -> float:
        whole = covariance + sd**2 * np.eye(len(mean))
        return float(multivariate_normal(mean, whole).logpdf(record.observed["stiffness"]))

    return density


def test_both_evidences_are_the_integral(record: Record, line: Comparison) -> None:
    """The linear coefficients in closed form, the noise by quadrature."""
    posterior = posterior_of(LINE, record, NOISE_MODELS["independent"], PRIORS)
    prior = posterior.space.parameters[2].prior
    density = exact(record)
    peak = density(3.0)

    def integrand(ln_sd: float) -> float:
        sd = np.exp(ln_sd)
        return float(np.exp(density(sd) - peak + prior.log_density(np.array(sd)) + ln_sd))

    value = np.log(quad(integrand, np.log(0.3), np.log(60.0), epsabs=0.0, epsrel=1e-9, limit=400)[0]) + peak
    found = line.fitted["polynomial_corrected"]
    for evidence in (found.importance, found.bridge):
        assert evidence.sd < 0.02
        assert evidence.value == pytest.approx(value, abs=4.0 * evidence.sd)


def test_leaving_out_is_what_a_fit_without_gives(record: Record, line: Comparison) -> None:
    """PSIS-LOO of some samples, and a fold, against posteriors computed on a grid without them."""
    found = line.fitted["polynomial_corrected"]
    posterior = found.posterior
    y, t = record.observed["stiffness"], record.temperature
    axes = [np.linspace(m - 5.0 * s, m + 5.0 * s, 41) for m, s in _spread(found)]
    z = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    theta = posterior.space.constrain(z)
    mu = theta[:, 0, None] + theta[:, 1, None] * (t - 50.0)
    pointwise = (
        -0.5 * ((y - mu) / theta[:, 2, None]) ** 2 - np.log(theta[:, 2, None]) - 0.5 * np.log(2.0 * np.pi)
    )
    prior = posterior.log_prior(z)
    targets = [np.arange(30) == i for i in (0, 14, 29)] + [line.folds.number == 0]
    for target in targets:
        log_post = prior + pointwise[:, ~target].sum(axis=1)
        weight = np.exp(log_post - log_post.max())
        expected = np.log(weight @ np.exp(pointwise[:, target]) / weight.sum())
        got = (found.folds if target.sum() > 1 else found.loo).log_density[target]
        np.testing.assert_allclose(got, expected, atol=0.06)


def test_the_predicted_value_is_the_median_of_a_fit_without(record: Record, line: Comparison) -> None:
    """Of a line under Gaussian noise, without a fold: the least-squares line, as priors are wide.

    The error of the median of 3000 draws is about 2 % of the standard deviation of the line, 0.5 to 2 N/m here.
    """
    found = line.fitted["polynomial_corrected"].folds
    y, t = record.observed["stiffness"], record.temperature
    assert found.refits == line.folds.count
    assert found.not_converged == 0
    assert np.all(found.k_anew <= 0.7)
    for fold in range(line.folds.count):
        out = line.folds.number == fold
        expected = np.polyval(np.polyfit(t[~out], y[~out], 1), t[out])
        np.testing.assert_allclose(found.median[out], expected, atol=0.2)


def bump(n: int, seed: int) -> Record:
    """A dozen noisy samples of a hump, which leave the tails of Eq. (7) open."""
    t = np.linspace(30.0, 70.0, n)
    share = [1.0 / (1.0 + np.exp(-rate * (t - middle))) for rate, middle in ((0.3, 50.0), (0.25, 48.0))]
    force, displacement = 0.6 * share[0] * (1.0 - share[0]), 0.003 * share[1] * (1.0 - share[1])
    k = force / displacement
    k = k + 0.02 * np.ptp(k) * np.random.default_rng(seed).standard_normal(n)
    units = {"temperature": "degC", "stiffness": "N/m"}
    inputs, observed = {"temperature": t}, {"stiffness": k}
    return of_channel(
        Record(Condition("c"), Branch.HEATING, inputs, observed, np.arange(n) + 1, units), "stiffness"
    )


def test_no_single_draw_carries_a_prediction() -> None:
    """Beyond the samples at hand the mean of Eq. (7) does not exist: the largest of these draws is 1e90 and more."""
    few = bump(12, 0)
    told: list[str] = []
    names = ["modified_sigmoid_tied", "polynomial_corrected"]
    found = compare_record(few, PRIORS, only=names, progress=told.append)
    models = [f"{name}, model {i} of 2" for i, name in enumerate(found.fitted, 1)]
    assert list(dict.fromkeys(step.partition(": ")[0] for step in told)) == models
    assert told[0] == f"{models[0]}: fit to all samples"
    folds = [f"fit {i} of 3 without the samples that it predicts" for i in (1, 2, 3)]
    assert told[-3:] == [f"{models[1]}: {fold}" for fold in folds]
    y = few.observed["stiffness"]
    numbers = record_document(found).models
    for name in found.fitted:
        assert numbers[name].rmse_held_out < 3.0 * np.ptp(y)


def test_a_fit_without_a_fold_that_fails_is_told(
    record: Record, line: Comparison, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert line.converged
    whole = importance.few_draws
    failing = iter([True, False])

    def seldom(*arguments: Any, **named: Any) -> WeightedDraws:
        draws = whole(*arguments, **named)
        return replace(draws, k=1.5, converged=False) if next(failing, False) else draws

    monkeypatch.setattr(importance, "few_draws", seldom)
    found = compare_record(record, PRIORS, noise="independent", only=["polynomial_corrected"])
    assert not found.converged
    model = record_document(found).as_json()["models"]["polynomial_corrected"]
    assert model["converged"] is False
    assert sum(model["refits_not_converged"].values()) == 1
    assert model["pareto_k_anew_max"] == 1.5


def test_correlation_factors_of_a_fold_are_those_of_a_fit_without_it(
    record: Record, line: Comparison
) -> None:
    """Mean squared error of curves on a fold left out, against its expectation on a grid.

    With 1000 draws its standard error is about 3 %.
    """
    found = line.fitted["polynomial_corrected"]
    y, t = record.observed["stiffness"], record.temperature
    axes = [np.linspace(m - 6.0 * s, m + 6.0 * s, 41) for m, s in _spread(found)]
    z = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    theta = found.posterior.space.constrain(z)
    mu = theta[:, 0, None] + theta[:, 1, None] * (t - 50.0)
    pointwise = -0.5 * ((y - mu) / theta[:, 2, None]) ** 2 - np.log(theta[:, 2, None])
    for fold, got in enumerate(found.folds.agreements):
        target = line.folds.number == fold
        log_post = found.posterior.log_prior(z) + pointwise[:, ~target].sum(axis=1)
        weight = np.exp(log_post - log_post.max())
        error = np.sum((y - mu)[:, target] ** 2, axis=1)
        assert got.n == target.sum()
        assert got.error.mean() == pytest.approx(weight @ error / weight.sum(), rel=0.15)
    together = joined(found.folds.agreements)
    assert together.n == record.n
    np.testing.assert_allclose(together.data_mean, y.mean())
    assert found.agreement.parameters == 2
    assert np.median(found.agreement.r2) > np.median(together.r2)  # in sample looks better than held out


def _spread(found: FittedContender) -> list[tuple[float, float]]:
    draws = found.draws
    weight = np.exp(draws.log_weight)
    mean = weight @ draws.z
    return list(zip(mean, np.sqrt(weight @ (draws.z - mean) ** 2), strict=True))


def test_effective_parameters_are_counted_by_what_the_data_determine() -> None:
    many = noisy_line(400, 1)
    found = compare_record(many, PRIORS, noise="independent", only=["polynomial_corrected"])
    line = found.fitted["polynomial_corrected"]
    p_eff = float((line.in_sample - line.loo.log_density).sum())
    assert p_eff == pytest.approx(3.0, abs=0.5)  # level, slope, noise; Eq. (11) prints four coefficients
    assert found.rank == 2


def test_counting_samples_as_fewer_widens_all_alike(record: Record) -> None:
    wave = replace(
        record, observed={"stiffness": record.observed["stiffness"] + 20.0 * np.sin(record.temperature / 3.0)}
    )
    names = ["polynomial_corrected", "logistic_refitted"]
    found = compare_record(wave, PRIORS, noise="effective_samples", only=names)
    assert found.memory > 1.5
    assert found.noise_choice is None
    plain = compare_record(wave, PRIORS, noise="independent", only=["polynomial_corrected"])
    factor = [c.fitted["polynomial_corrected"].draws for c in (found, plain)]
    sd = [np.sqrt(np.exp(d.log_weight) @ (d.z - np.exp(d.log_weight) @ d.z) ** 2)[1] for d in factor]
    assert sd[0] / sd[1] == pytest.approx(np.sqrt(found.memory), rel=0.15)


def wavy_line(n: int, seed: int) -> Record:
    """A line that every contender misses smoothly, by ten times the noise."""
    record = noisy_line(n, seed)
    missed = 30.0 * np.sin(record.temperature / 4.0)
    return replace(record, observed={"stiffness": record.observed["stiffness"] + missed})


def test_where_the_best_contender_misses_a_discrepancy_stands_beside_all() -> None:
    found = compare_record(wavy_line(90, 4), PRIORS, only=["polynomial_corrected", "logistic_refitted"])
    assert found.noise.name == "ar1"  # a memory stays beside it unless the evidence is against that
    assert found.noise_choice is not None
    assert (
        found.noise_choice.ln_evidence["independent"] > -LEAST_LN_EVIDENCE_GAIN
    )  # it is not what the misfit is taken for
    assert found.has_discrepancy
    assert found.memory == 1.0
    assert found.converged
    for fitted in found.fitted.values():
        names = [p.name for p in fitted.posterior.space.parameters]
        theta = fitted.posterior.space.constrain(fitted.draws.z)
        mean = dict(zip(names, np.exp(fitted.draws.log_weight) @ theta, strict=True))
        assert mean["stiffness_sd"] == pytest.approx(
            3.0, rel=0.3
        )  # that of a reading, whatever the curve misses
        assert mean["stiffness_discrepancy"] > 10.0


def test_a_curve_that_describes_the_data_gets_no_discrepancy(record: Record) -> None:
    found = compare_record(record, PRIORS, only=["polynomial_corrected", "logistic_refitted"])
    assert not found.has_discrepancy
    assert record_document(found).noise_choice.reason


@pytest.mark.parametrize("off", [1.0, 8.0])
def test_the_density_of_a_fold_is_normal_with_the_discrepancy_conditioned_on_the_rest(off: float) -> None:
    """At given parameters curve, discrepancy and noise are jointly normal: a fold's density against the closed form.

    However many standard deviations off the samples are: no curve that is drawn comes near such samples.
    """
    record = wavy_line(90, 4)
    left = folds_of(record).number == 4
    theta = np.array([115.0, 1.5, 3.0, 20.0])
    level, slope, sd, size = theta
    alone = posterior_of(LINE, record, NOISE_MODELS["independent"], PRIORS)
    bases = discrepancy_bases(alone, np.array([level, slope]))
    posterior = posterior_of(LINE, record, NOISE_MODELS["independent"], PRIORS, discrepancy=bases)
    rows = bases[0]["stiffness"].rows
    y = record.observed["stiffness"] - posterior.predict(theta, record.inputs)["stiffness"]
    covariance = size**2 * rows.T @ rows + sd**2 * np.eye(record.n)
    gain = np.linalg.solve(covariance[np.ix_(~left, ~left)], covariance[np.ix_(~left, left)]).T
    mean = gain @ y[~left]
    variance = np.diag(covariance[np.ix_(left, left)] - gain @ covariance[np.ix_(~left, left)])
    observed = record.observed["stiffness"].copy()
    observed[left] += mean + off * np.sqrt(variance) - y[left]
    record = replace(record, observed={"stiffness": observed})
    expected = norm.logpdf(off) - 0.5 * np.log(variance)
    rest = held_out.of_samples(posterior, part(record, ~left))
    whole = multivariate_normal(np.zeros(int(np.sum(~left))), covariance[np.ix_(~left, ~left)])
    assert rest.log_likelihood(theta)[0] == pytest.approx(whole.logpdf(y[~left]), abs=1e-6)
    found = held_out.density_without(rest, theta[None], part(record, left), np.random.SeedSequence(1))
    np.testing.assert_allclose(found[0], expected, rtol=1e-6)


def test_a_sample_left_out_is_predicted_from_all_others_at_given_parameters() -> None:
    """Against the closed form; the weights of drawn curves would follow the very sample."""
    record = wavy_line(60, 4)
    theta = np.array([115.0, 1.5, 3.0, 20.0])
    alone = posterior_of(LINE, record, NOISE_MODELS["independent"], PRIORS)
    bases = discrepancy_bases(alone, theta[:2])
    posterior = posterior_of(LINE, record, NOISE_MODELS["independent"], PRIORS, discrepancy=bases)
    rows = bases[0]["stiffness"].rows
    y = record.observed["stiffness"] - posterior.predict(theta, record.inputs)["stiffness"]
    precision = np.linalg.inv(theta[3] ** 2 * rows.T @ rows + theta[2] ** 2 * np.eye(record.n))
    variance = 1.0 / np.diag(precision)
    expected = norm.logpdf(variance * (precision @ y), scale=np.sqrt(variance))
    found = posterior.left_out_log_density(np.tile(theta, (3, 1)), "stiffness")
    np.testing.assert_allclose(found, np.tile(expected, (3, 1)), rtol=1e-6)


@pytest.mark.parametrize("kept", [12, 20])
def test_what_the_rest_does_not_see_of_a_discrepancy_is_zero_there(kept: int) -> None:
    """The functions of the discrepancy are orthogonal over what is left, so that none explains what another does."""
    record = wavy_line(90, 4)
    alone = posterior_of(LINE, record, NOISE_MODELS["independent"], PRIORS)
    bases = discrepancy_bases(alone, np.array([115.0, 1.5]))
    posterior = posterior_of(LINE, record, NOISE_MODELS["independent"], PRIORS, discrepancy=bases)
    cold = np.arange(90) < kept
    rows = held_out.of_samples(posterior, part(record, cold)).discrepancy[0]["stiffness"].rows
    power = np.einsum("mn,mn->m", rows, rows)
    seen = power > 0.0
    assert 3 <= seen.sum() < len(rows)
    unit = rows[seen] / np.sqrt(power[seen])[:, None]
    assert np.linalg.eigvalsh(unit @ unit.T)[-1] < 1.1


def test_noise_that_grows_does_so_over_the_range_of_the_whole_record() -> None:
    """What is held out is judged by the scale that was fitted, not by one of its own range."""
    record = noisy_line(40, 2)
    posterior = posterior_of(LINE, record, NOISE_MODELS["independent+growing"], PRIORS)
    theta = posterior.space.constrain(posterior.space.prior_centre())[None]
    (whole,) = posterior.pointwise_log_likelihood(theta)
    hot = np.arange(40) >= 30
    (own,) = held_out.of_samples(posterior, part(record, hot)).pointwise_log_likelihood(theta)
    np.testing.assert_allclose(own["stiffness"], whole["stiffness"][:, hot])


def test_of_a_displacement_modified_sigmoid_and_bounded_logistic_have_one_evidence(
    make_record: Callable[..., Record],
) -> None:
    record = of_channel(make_record(("displacement",), n=60, noise=0.03), "displacement")
    names = ["modified_sigmoid", "bounded_logistic", "logistic_refitted", "polynomial_corrected"]
    found = compare_record(record, PRIORS, only=names)
    one, other = (found.fitted[n].evidence for n in names[:2])
    assert one.value == pytest.approx(other.value, abs=4.0 * float(np.hypot(one.sd, other.sd)))
    assert found.verdict.verdict == "cannot tell"
    assert found.verdict.ln_bayes_factor > 20.0


def test_folds_are_cycles_conditions_or_blocks_of_temperature(make_record: Callable[..., Record]) -> None:
    plain = of_channel(make_record(("force",), n=50), "force")
    blocks = folds_of(plain)
    assert (blocks.kind, blocks.count) == ("temperature blocks", 10)
    assert np.all(np.diff(blocks.number[np.argsort(plain.temperature)]) >= 0)
    cycled = replace(plain, inputs={**plain.inputs, "cycle": np.repeat(np.arange(5.0), 10)})
    assert (folds_of(cycled).kind, folds_of(cycled).count) == ("cycles", 5)
    both = joined_records([plain, replace(plain, condition=Condition("d"))], "force")
    assert (folds_of(both).kind, folds_of(both).count, both.n) == ("conditions", 2, 100)
    assert np.unique(both.inputs["segment"]).size == 2 * np.unique(plain.inputs["segment"]).size


def test_a_part_remembers_nothing_across_what_was_left_out(make_record: Callable[..., Record]) -> None:
    record = of_channel(make_record(("force",), n=20), "force")
    kept = part(record, ~np.isin(np.arange(20), [7, 8, 9]))
    assert kept.n == 17
    assert np.diff(kept.inputs["segment"]).nonzero()[0].tolist() == [6]


def test_records_of_other_units_are_not_joined(make_record: Callable[..., Record]) -> None:
    one = make_record(("force",), n=20)
    other = replace(one, units={**one.units, "force": "kN"})
    with pytest.raises(MeasurementError, match="can't be compared together"):
        joined_records([one, other], "force")


def test_stiffness_is_what_models_are_compared_on_where_there_is_any(
    make_record: Callable[..., Record],
) -> None:
    assert observables(make_record(("force", "displacement", "stiffness"), n=20)) == ("stiffness",)
    assert observables(make_record(("force", "displacement"), n=20)) == ("force", "displacement")
