"""Whether a fit is adequate: each reason why not, and none for data that follow the model."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.special import expit

from sma_bayes import fit
from sma_bayes.assess import adequacy
from sma_bayes.assess.adequacy import (
    LARGEST_MISFIT_SHARE,
    PRIOR_LED_CONTRACTION,
    DiscrepancySummary,
    led_by_prior,
    missed,
    reasons,
)
from sma_bayes.assess.checks import FALSE_ALARM_RATE, STATISTICS, Check, predictive_checks
from sma_bayes.assess.conflict import contradicted
from sma_bayes.assess.loops import branch_quantities
from sma_bayes.assess.nearest import nearest_sigmoids
from sma_bayes.errors import PriorError
from sma_bayes.fitting.fit import Fit
from sma_bayes.fitting.fit_records import fit_records
from sma_bayes.parameters.priors_file import PriorSet, parse_priors, read_priors
from sma_bayes.parameters.roles import Role
from sma_bayes.records.types import Campaign, Condition, Record
from sma_bayes.runs.fit_document import CheckSummary


def fitted(record: Record, noise: str = "independent") -> Fit:
    return fit(Campaign("made up", "made up", "0", (record,)), noise=noise, jobs=1)[record.key]


def kinds(found: Fit) -> list[tuple[str, str]]:
    why = reasons(found, 0, predictive_checks(found), missed(found))
    return [(reason.kind, reason.channel) for reason in why]


@pytest.fixture(scope="module")
def good(make_record: Callable[..., Record]) -> Fit:
    """A fit of data that follow the model, with white noise."""
    return fitted(make_record(n=80))


def test_white_noise_on_the_model_is_adequate(good: Fit) -> None:
    assert good.converged
    assert kinds(good) == []
    assert led_by_prior(good) == ()
    assert len(branch_quantities(good)) == 3


@pytest.mark.parametrize("p_value", [0.0, 0.5 * FALSE_ALARM_RATE, 1.0 - 0.5 * FALSE_ALARM_RATE])
def test_a_check_that_fails_is_a_reason(good: Fit, p_value: float) -> None:
    check = Check("force", "lag1", 0.9, -0.2, 0.2, p_value, "memory")
    (why,) = reasons(good, 0, [check, replace(check, p_value=0.01)], {})
    assert (why.kind, why.channel) == ("check", "force")
    said = "are alike, more" if p_value < 0.5 else "alternate more"
    assert why.message.startswith(f"force: neighbouring residuals {said} than the noise model allows (p ")


def test_a_p_value_of_nought_is_less_than_the_replications_resolve(good: Fit) -> None:
    """No replication was as far out as the measurement: that is no probability of nought."""
    check = Check("force", "sweep_means", 90.0, 1.0, 9.0, 0.0, "the statistic in words")
    (why,) = reasons(good, 0, [check], {})
    assert why.message == "force: its sweeps differ by more than the noise (p < 0.002)"
    far = replace(check, statistic="left_out_sweeps", p_value=4.5e-18, sweep=3)
    (why,) = reasons(good, 0, [far], {})
    assert why.message == "force: sweep 3 is not what the other sweeps predict (p < 0.002)"


@pytest.mark.parametrize("statistic", STATISTICS)
def test_every_check_that_fails_is_told_in_words_of_its_own(good: Fit, statistic: str) -> None:
    sides = (0.0, 1.0) if STATISTICS[statistic].two_sided else (0.0,)
    said = [
        reasons(good, 0, [Check("force", statistic, 1.0, 0.0, 1.0, p, "raw")], {})[0].message for p in sides
    ]
    assert len(set(said)) == len(sides)
    assert not any("raw" in message or ":  (" in message for message in said)


def test_sweeps_that_differ_come_before_other_checks(good: Fit) -> None:
    """Sweeps that differ leave a memory and misfit, too, of which one curve of any shape or noise can't be rid."""
    checks = [
        Check("force", "lag1", 0.9, -0.2, 0.2, 0.0, "memory"),
        Check("force", "sweep_means", 90.0, 1.0, 9.0, 0.0, "sweeps that differ"),
    ]
    first, second = reasons(good, 0, checks, {})
    assert (first.kind, second.kind) == ("sweeps", "check")
    assert "its sweeps differ" in first.message


def test_a_misfit_smaller_than_chance_is_no_reason(good: Fit) -> None:
    """Parameters were fitted: means by temperature that are nearer nought than those of replications are no sign."""
    assert reasons(good, 0, [Check("force", "block_means", 1.0, 3.0, 20.0, 1.0, "misfit")], {}) == ()


def test_what_nobody_would_see_or_is_small_is_no_reason(good: Fit) -> None:
    """Both must be: a good share of the range, and several standard deviations of the noise."""
    sd = float(np.median(good.flat[:, good.posterior.layout[0].noise["force"][0]]))
    seen = DiscrepancySummary(
        unit="N", rms=1.0, largest=10.0 * sd, at=50.0, share=2.0 * LARGEST_MISFIT_SHARE, ln_bayes_factor=20.0
    )
    (why,) = reasons(good, 0, (), {"force": seen})
    assert (why.kind, why.channel) == ("curve", "force")
    assert "by up to 4.0 % of its range, at 50 °C" in why.message
    assert reasons(good, 0, (), {"force": seen.but(share=0.5 * LARGEST_MISFIT_SHARE)}) == ()
    assert reasons(good, 0, (), {"force": seen.but(largest=-2.0 * sd)}) == ()


def test_a_second_step_is_missed_by_the_curve(make_record: Callable[..., Record]) -> None:
    r = make_record(n=80, noise=0.004)
    x = r.observed["displacement"]
    step = 0.15 * np.ptp(x) / (1.0 + np.exp(-1.2 * (r.temperature - 40.0)))
    found = fitted(replace(r, observed={**r.observed, "displacement": x + step}))
    assert kinds(found) == [("curve", "displacement")]
    m = missed(found)["displacement"]
    assert m.share > LARGEST_MISFIT_SHARE
    assert m.ln_bayes_factor > 3.0
    assert abs(m.largest) >= m.rms > 0.0
    assert r.temperature.min() <= m.at <= r.temperature.max()


def test_numbers_without_noise_were_computed(make_record: Callable[..., Record]) -> None:
    found = fitted(make_record(n=40, noise=0.0))
    first = reasons(found, 0, predictive_checks(found), missed(found))[0]
    assert first.kind == "exact"
    assert (
        first.message
        == f"{first.channel} has no noise: it was computed, not measured, and no interval follows from it"
    )


def test_samples_that_count_as_fewer_are_no_density(make_record: Callable[..., Record]) -> None:
    found = fitted(make_record(n=80), "effective_samples")
    assert ("tempered", "") in kinds(found)
    assert missed(found) == {}


def test_noise_that_swallows_the_response_is_a_reason(make_record: Callable[..., Record]) -> None:
    """Measured against the curve: the range of the measurements grows with the noise and would hide it."""
    found = fitted(make_record(("force",), n=120, noise=0.4))
    (why,) = reasons(found, 0, (), {})
    assert (why.kind, why.channel) == ("noise", "force")
    share = float(re.findall(r"(\d+) % of what force changes by", why.message)[0])
    assert share == pytest.approx(40.0, rel=0.3)


def test_a_memory_as_long_as_the_sweep_is_what_the_curve_misses(make_record: Callable[..., Record]) -> None:
    """Two loads under one curve: the difference is followed by noise that hardly forgets, and is no noise."""
    one, other = (
        replace(r, inputs={**r.inputs, "time": np.arange(r.n, dtype=float)}, condition=Condition(name))
        for r, name in (
            (make_record(("force",), n=80), "a"),
            (make_record(("force",), n=80, B4=0.9, seed=1), "b"),
        )
    )
    found = fit_records([one, other], read_priors("modified_sigmoid"), noise="ar1", discrepancy=False)
    told = [why for i in (0, 1) for why in reasons(found, i, (), {}) if why.kind == "memory"]
    assert told
    samples = int(re.findall(r"force remembers over (\d+) samples of a sweep of 80", told[0].message)[0])
    assert samples > 40


def test_a_real_memory_is_no_reason(make_record: Callable[..., Record]) -> None:
    """Six records with a memory of 0.8, nine samples: of 80 none would reach half a sweep by chance (p < 0.001)."""
    for seed in range(6):
        found = fitted(make_record(("force",), n=80, memory=0.8, seed=seed), "ar1")
        assert "memory" not in {kind for kind, _ in kinds(found)}


@pytest.mark.parametrize(
    ("moved", "led"), [(1.02 * PRIOR_LED_CONTRACTION, False), (0.98 * PRIOR_LED_CONTRACTION, True)]
)
def test_a_curve_that_its_prior_leads_gives_no_stiffness(
    good: Fit, monkeypatch: pytest.MonkeyPatch, moved: float, led: bool
) -> None:
    """The midpoint of the force decides, and the rate; a span or an offset does not."""
    space, model = good.posterior.space, good.posterior.model
    left = {name: np.ones(space.dimension) for name in ("midpoint", "span")}
    for name, role in (("midpoint", Role.MIDPOINT), ("span", Role.SPAN)):
        at = model.position(role, "force")
        left[name][np.flatnonzero(space.free_index == at)] = moved
    monkeypatch.setattr(adequacy, "contraction", lambda _: left["span"])
    assert led_by_prior(good) == ()
    monkeypatch.setattr(adequacy, "contraction", lambda _: left["midpoint"])
    assert led_by_prior(good) == (("force",) if led else ())
    why = reasons(good, 0, (), {})
    assert [(r.kind, r.channel) for r in why] == ([("prior", "force")] if led else [])
    assert (branch_quantities(good) == []) is led


def with_prior(name: str, table: str) -> PriorSet:
    """The priors that ship with another of one parameter."""
    text = read_priors("modified_sigmoid").text
    begin = text.index(f"[both.{name}]")
    return parse_priors(
        f"{text[:begin]}[both.{name}]\n{table}{text[text.index(chr(10) + '[', begin) :]}", "wrong.toml"
    )


def test_a_prior_that_excludes_the_data_is_named(make_record: Callable[..., Record]) -> None:
    wrong = with_prior("B3", 'family = "uniform"\nlow = 10.0\nhigh = 20.0\nunit = "degC"\n')
    record = make_record(seed=1)
    found = fit_records([record], wrong, noise="independent")
    assert any(what.startswith("B3 (") for what in contradicted(found))
    assert [r.kind for r in reasons(found, 0, (), {})].count("conflict") == 1
    assert contradicted(fit_records([record], read_priors("modified_sigmoid"), noise="independent")) == ()


@pytest.mark.parametrize(("mean", "sd"), [(100.0, 1.0), (1e4, 1.0), (1e6, 1e-3), (1e12, 1.0)])
def test_a_prior_is_named_however_far_it_is_from_the_data(
    make_record: Callable[..., Record], mean: float, sd: float
) -> None:
    """The curve is level there: no likelihood says so, and the noise takes all that was measured."""
    priors = with_prior("B3", f'family = "normal"\nmean = {mean}\nsd = {sd}\nunit = "degC"\n')
    found = fit_records([make_record(seed=1)], priors)
    conflict = reasons(found, 0, (), {})[0]
    assert conflict.kind == "conflict"
    at = re.search(r"B3 \((\S+) °C by the data alone, the prior says", conflict.message)
    assert at is not None, conflict.message
    assert float(at[1]) == pytest.approx(52.0, abs=1.0)


def test_a_sharp_prior_at_the_truth_contradicts_nothing(make_record: Callable[..., Record]) -> None:
    priors = with_prior("B3", 'family = "normal"\nmean = 52.0\nsd = 1e-3\nunit = "degC"\n')
    assert contradicted(fit_records([make_record(seed=1)], priors, noise="independent")) == ()


@pytest.mark.parametrize("rate", [0.01, 0.3, 30.0, 300.0])
@pytest.mark.parametrize("midpoint", [30.0, 31.0, 50.0, 69.0])
def test_of_curves_that_do_not_determine_a_sigmoid_none_or_a_right_one_is_told(
    rate: float, midpoint: float
) -> None:
    """All but straight, or with the step at an end, beside one that is level and one that is a sigmoid."""
    t = np.linspace(30.0, 70.0, 161)
    curve = np.stack([expit(rate * (t - midpoint)), np.ones_like(t), 1.0 + 2.0 * expit(0.3 * (t - 50.0))])
    for own, (span, found_rate, middle, offset) in zip(curve, nearest_sigmoids(t, curve), strict=True):
        told = offset + span * expit(found_rate * (t - middle))
        assert np.isnan(span) or told == pytest.approx(own, abs=0.01 * np.ptp(own) + 1e-9)


def test_a_model_without_priors_of_its_own_is_judged_by_its_fit(
    good: Fit, monkeypatch: pytest.MonkeyPatch
) -> None:
    def none(_: object) -> None:
        raise PriorError("no such priors")

    monkeypatch.setattr(type(good.posterior.model), "default_priors", classmethod(none))
    assert contradicted(good) == ()


@pytest.mark.parametrize(
    ("statistic", "p_value", "failed"),
    [
        ("lag1", 0.999, True),
        ("lag1", 0.001, True),
        ("block_means", 0.001, True),
        ("block_means", 0.9999, False),
    ],
)
def test_a_check_fails_in_the_page_at_the_ends_that_tell_as_it_does_in_adequacy(
    statistic: str, p_value: float, failed: bool
) -> None:
    """Mean residuals that are smaller than the noise makes them are no misfit of the curve."""
    told = CheckSummary(channel="force", statistic=statistic, measured=1.0, q05=0.0, q95=2.0, p_value=p_value)
    assert told.failed is failed
    assert Check("force", statistic, 1.0, 0.0, 2.0, p_value, "").failed is failed
    assert told.by_chance == (0.02 if statistic == "lag1" else 0.01)
