"""Posterior simulation-based calibration of a record: the joint density, the ranks, files, and what is refused."""

from __future__ import annotations

import io
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import multivariate_normal

import sma_bayes
from sma_bayes.assess.draws import RecordDraws, record_draws
from sma_bayes.errors import SmaBayesError
from sma_bayes.progress import LogLines
from sma_bayes.records.types import Branch, Campaign, Condition, Record
from sma_bayes.runs.stored_draws import stored_draws
from sma_bayes.studies.fit import self_check
from sma_bayes.studies.fit.self_check import augmented, checked, read_places, replicates_asked, tasks_of
from sma_bayes.studies.fit.terminal import self_check_sentences

REPLICATES = 80


def _campaign(make_record: Callable[..., Record], **options: object) -> Campaign:
    record = make_record(n=40, channels=("force",), **options)
    return Campaign("spring", "spring", "0" * 64, (record,))


@pytest.fixture(scope="module")
def fit(make_record: Callable[..., Record]) -> sma_bayes.RecordFit:
    (found,) = sma_bayes.fit(_campaign(make_record), noise="independent", jobs=1).values()
    return found


@pytest.fixture(scope="module")
def draws(fit: sma_bayes.RecordFit) -> RecordDraws:
    return record_draws(fit)


def test_a_right_fit_passes(draws: RecordDraws) -> None:
    """At a false-alarm rate of 1 %, with a fixed seed."""
    (found,) = checked([(draws, False)], REPLICATES, 0, jobs=1)
    assert found.passed
    assert found.failed == 0
    assert {"B1", "B3", "As", "Af", "force_sd"} <= {q.name for q in found.quantities}


def test_a_sampler_that_narrows_is_seen(draws: RecordDraws, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = self_check.refitted

    def narrowed(*call: object) -> object:
        found = whole(*call)  # type: ignore[arg-type]
        middle = np.exp(found.log_weight) @ found.z
        return replace(found, z=middle + 0.6 * (found.z - middle))

    monkeypatch.setattr(self_check, "refitted", narrowed)
    (found,) = checked([(draws, False)], REPLICATES, 0, jobs=1)
    assert not found.passed
    spread = [q.spread for q in found.quantities if q.kind == "parameter"]
    assert min(spread) > 1.3


def test_what_was_written_is_read_and_not_done_again(
    draws: RecordDraws, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (first,) = checked([(draws, False)], 20, 0, tmp_path, jobs=1)
    names, u = read_places(tmp_path, draws.key)
    assert u.shape == (20, len(first.quantities))
    assert names == tuple(q.name for q in first.quantities)

    def never(task: object) -> None:
        raise AssertionError("done again")

    monkeypatch.setattr(self_check, "ranked", never)
    (again,) = checked([(draws, False)], 20, 0, tmp_path, jobs=1)
    assert again == first
    with pytest.raises(AssertionError):
        [*checked([(draws, False)], 30, 0, tmp_path, jobs=1)]


@pytest.mark.parametrize("noise", ["independent", "ar1"])
def test_joint_density_of_both_measurements(make_record: Callable[..., Record], noise: str) -> None:
    """Without discrepancy the product of both densities; nothing remembers from one measurement to the other."""
    (fit,) = sma_bayes.fit(_campaign(make_record), noise=noise, jobs=1).values()
    posterior, theta = fit.posterior, fit.flat[:5]
    other = posterior.replicate(np.random.default_rng(0), theta[:1])["force"][0]
    both = augmented(posterior, {"force": other})
    record = replace(fit.record, observed={"force": other})
    alone = posterior.on([record])
    expected = posterior.log_likelihood(theta) + alone.log_likelihood(theta)
    if not posterior.has_discrepancy:
        np.testing.assert_allclose(both.log_likelihood(theta), expected, rtol=1e-10)


def test_a_discrepancy_is_the_same_in_both_measurements(make_record: Callable[..., Record]) -> None:
    """Against the covariance of both, with what the curve misses in common."""
    record = make_record(n=40, channels=("force",))
    bent = 0.4 * np.exp(-(((record.temperature - 40.0) / 6.0) ** 2))
    record = replace(record, observed={"force": record.observed["force"] + bent})
    campaign = Campaign("spring", "spring", "0" * 64, (record,))
    (fit,) = sma_bayes.fit(campaign, noise="independent", jobs=1).values()
    posterior, theta = fit.posterior, fit.flat[:3]
    if not posterior.has_discrepancy:
        pytest.fail("the bump is not taken for a discrepancy")
    given = _first(fit.discrepancy)
    other = posterior.replicate(np.random.default_rng(0), theta[:1], weights=given)["force"][0]
    both = augmented(posterior, {"force": other})
    rows = posterior.discrepancy[0]["force"].rows
    twice = np.concatenate([rows, rows], axis=1)
    place = posterior.layout[0]
    curve = posterior.predict(theta, record.inputs)["force"]
    measured = np.concatenate([record.observed["force"], other])
    for i, one in enumerate(theta):
        sd, size = one[place.noise["force"][0]], one[place.size["force"]]
        covariance = sd**2 * np.eye(measured.size) + size**2 * twice.T @ twice
        exact = multivariate_normal.logpdf(measured, np.tile(curve[i], 2), covariance)
        assert both.log_likelihood(one[None])[0] == pytest.approx(exact, rel=1e-9)


@pytest.fixture(scope="module")
def swept() -> Campaign:
    """Five sweeps of a displacement, each with an offset and a stroke of its own."""
    rng, t = np.random.default_rng(8), np.linspace(20.0, 80.0, 30)
    x = [
        0.02 * (0.1 + 0.02 * offset + (1.0 + 0.03 * stroke) / (1.0 + np.exp(-0.25 * (t - 48.0))))
        for offset, stroke in rng.standard_normal((5, 2))
    ]
    record = Record(
        Condition("a"),
        Branch.HEATING,
        {"temperature": np.tile(t, 5), "time": np.arange(150.0), "segment": np.repeat(np.arange(5.0), 30)},
        {"displacement": np.concatenate(x) + 1e-4 * rng.standard_normal(150)},
        np.arange(150) + 2,
        {"temperature": "degC", "time": "s", "displacement": "m"},
    )
    return Campaign("sweeps", "sweeps", "0" * 64, (record,))


def test_the_same_sweeps_are_measured_again(swept: Campaign, tmp_path: Path) -> None:
    """Against the covariance of both measurements, what sweeps have of their own in common and summing to zero."""
    sma_bayes.fit_campaign(swept, tmp_path, noise="independent", figures=False, jobs=1)
    (draws,) = stored_draws(tmp_path)
    assert draws.measured_sweeps is not None
    task = tasks_of(draws, False, 25, 0)[0]
    posterior, channel = task.posterior, "displacement"
    assert np.abs(task.sweeps[channel].sum(axis=1)).max() < 1e-9 * np.abs(task.sweeps[channel]).max()
    again = posterior.replicate(
        np.random.default_rng(0), task.theta, weights=task.weights, sweeps=task.sweeps
    )
    both = augmented(posterior, {channel: again[channel][0]})
    (record,), basis = both.records, both.discrepancy[0][channel]
    own = basis.sweep_functions
    assert own is not None
    assert own.sum_to_zero
    assert len(own.parts) == 5
    q = len(own.rows) // 5
    centring = np.kron(np.eye(5) - 0.2, np.eye(q))
    place = posterior.layout[0]
    for one in task.theta[:3]:
        sd = one[place.noise[channel][0]]
        covariance = sd**2 * np.eye(record.n) + one[place.size[channel]] ** 2 * basis.rows.T @ basis.rows
        covariance += one[place.between[channel]] ** 2 * own.rows.T @ centring @ own.rows
        curve = posterior.predict(one[None], record.inputs)[channel][0]
        exact = multivariate_normal.logpdf(record.observed[channel], curve, covariance)
        assert both.log_likelihood(one[None])[0] == pytest.approx(exact, rel=1e-8)


def test_draws_of_the_measured_sweeps_are_stored(swept: Campaign, tmp_path: Path) -> None:
    (fit,) = sma_bayes.fit(swept, noise="independent", jobs=1).values()
    sma_bayes.fit_campaign(swept, tmp_path, noise="independent", figures=False, jobs=1)
    (stored,) = stored_draws(tmp_path)
    assert stored.measured_sweeps is not None
    assert fit.measured_sweeps is not None
    np.testing.assert_array_equal(
        stored.measured_sweeps, fit.measured_sweeps.reshape(stored.measured_sweeps.shape)
    )
    curve = [fit.posterior.space.names.index(name) for name in ("A1", "A2", "A3", "A4")]
    measured, every = (x[:, curve].std(axis=0) for x in (stored.measured_sweeps, stored.theta))
    assert np.all(measured < 0.9 * every)  # they are known better than all that might come
    held = [i for i in range(stored.theta.shape[1]) if i not in curve]
    np.testing.assert_array_equal(stored.measured_sweeps[:, held], stored.theta[:, held])


@pytest.mark.slow
def test_fits_of_sweeps_that_differ_pass(swept: Campaign) -> None:
    """At a false-alarm rate of 1 %, with a fixed seed; with all sweeps anew a tenth of the refits failed."""
    (fit,) = sma_bayes.fit(swept, noise="independent", jobs=1, self_check=200).values()
    assert fit.self_check is not None
    assert fit.self_check.passed
    assert fit.self_check.failed <= 2


def _first(weights: tuple[dict[str, np.ndarray], ...]) -> tuple[dict[str, np.ndarray], ...]:
    return tuple({c: w[:1] for c, w in own.items()} for own in weights)


def test_it_is_part_of_a_fit(make_record: Callable[..., Record], tmp_path: Path) -> None:
    campaign = _campaign(make_record)
    options = {"noise": "independent", "jobs": 1, "self_check": 20}
    (fit,) = sma_bayes.fit(campaign, **options).values()  # type: ignore[arg-type]
    assert fit.self_check is not None
    assert fit.document["self_check"]["replicates"] == 20
    out = tmp_path / "out"
    summary = sma_bayes.fit_campaign(campaign, out, figures=False, **options)  # type: ignore[arg-type]
    (entry,) = summary["records"]
    assert (out / "self_check" / f"{entry['key']}.csv").is_file()
    (sentence,) = self_check_sentences(sma_bayes.runs.outputs.read_run(out).summary.records)
    assert "1 of 1 record passed, 20 refits" in sentence
    again = sma_bayes.fit_campaign(campaign, out, figures=False, resume=True, **options)  # type: ignore[arg-type]
    assert again["records"][0]["self_check"] == entry["self_check"]


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"pool": "campaign"}, "--pool campaign"),
        ({"noise": "effective_samples"}, "--noise effective_samples"),
    ],
)
def test_what_tells_nothing_is_refused(
    make_record: Callable[..., Record], tmp_path: Path, options: dict[str, str], said: str
) -> None:
    with pytest.raises(SmaBayesError, match=said):
        sma_bayes.fit_campaign(_campaign(make_record), tmp_path / "out", self_check=True, **options)  # type: ignore[arg-type]
    assert not (tmp_path / "out").exists()


def test_numbers_out_of_range_are_refused() -> None:
    assert (replicates_asked(True), replicates_asked(False), replicates_asked(50)) == (1000, 0, 50)
    for wrong in (5, -1, 10**9):
        with pytest.raises(SmaBayesError, match="self_check"):
            replicates_asked(wrong)


def test_what_takes_long_is_announced_before_it_begins(
    draws: RecordDraws, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of refits that are told to take half a second each; nothing where all is read."""
    monkeypatch.setattr(self_check, "seconds_of_a_refit", lambda *_: 0.5)
    out = io.StringIO()
    progress = LogLines(file=out)
    (first,) = checked([(draws, False)], 400, 0, tmp_path, jobs=1, tell=progress)
    announced, *lines = [line for line in out.getvalue().splitlines() if "first refits" not in line]
    assert "self-check of 1 record, 400 refits: about 3 min, give or take a factor of three" in announced
    assert "give or take" not in "".join(lines)
    out.truncate(0)
    assert [*checked([(draws, False)], 400, 0, tmp_path, jobs=1, tell=progress)] == [first]
    assert out.getvalue().strip("\0") == ""


def test_a_refit_is_timed_by_those_that_are_not_counted(draws: RecordDraws) -> None:
    found = self_check.first_refits(self_check.pilot_task(draws, False, 0))
    assert found.common is not None
    assert found.seconds > 0.0


def test_a_record_of_many_readings_has_fewer_replicates(
    draws: RecordDraws, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Unless a number is asked for; each record states its own."""
    monkeypatch.setattr(self_check, "READINGS_REFITTED", 40 * draws.record.n)
    monkeypatch.setattr(self_check, "FEWEST_OF_MANY_READINGS", 20)
    (found,) = checked([(draws, False)], True, 0, jobs=1)
    (asked,) = checked([(draws, False)], 60, 0, jobs=1)
    assert (found.replicates, asked.replicates) == (40, 60)


def test_places_are_told_among_as_many_draws_as_are_ranked(
    draws: RecordDraws, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What a fit reports is made of these draws and the truth, not of all by which a refit is judged."""
    sizes = []
    whole = self_check.quantities_of

    def counted(joined: RecordDraws, *rest: object, **named: object) -> object:
        sizes.append(joined.size)
        return whole(joined, *rest, **named)  # type: ignore[arg-type]

    monkeypatch.setattr(self_check, "quantities_of", counted)
    self_check.ranked(self_check.pilot_task(draws, False, 0).first(3))
    assert sizes == 3 * [1 + self_check.RANKED_DRAWS]
