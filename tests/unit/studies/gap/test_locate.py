"""Where a disagreement is, and how often there seems to be one where there is none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom, kstest, norm

from sma_bayes.arrays import Floats
from sma_bayes.parameters.priors_file import read_priors
from sma_bayes.records.history import histories
from sma_bayes.studies.gap.fitting import FittedHypothesis, fit_with_noise
from sma_bayes.studies.gap.hypothesis import baseline
from sma_bayes.studies.gap.locate import Disagreement, disagreements, look, shuffled, tail_probability

CHANNELS = ("force", "displacement")
SPAN = {"force": 2.0, "displacement": 0.02}


@pytest.fixture(scope="module")
def fit_rig(rig):
    """Fit the model without effects to a rig whose readings are changed before."""

    def fit(change=None, start: Floats | None = None, **of) -> FittedHypothesis:
        campaign = rig(**of).campaign()
        hypothesis = baseline(campaign, histories(campaign), read_priors("modified_sigmoid"), pooled=True)
        if change is not None:
            seen = tuple(replace(h, observed=change(h)) for h in hypothesis.histories)
            hypothesis = replace(hypothesis, histories=seen)
        return fit_with_noise(hypothesis, hypothesis.space.prior_centre() if start is None else start)

    return fit


def bump(condition: str, sign: float, channel: str, size: float):
    """Add a bump between 46 and 62 degC to one branch of one condition, in spans of the channel."""

    def change(h):
        if h.condition.id != condition:
            return h.observed
        there = np.abs(h.inputs["temperature"] - 54.0) < 8.0
        extra = size * SPAN[channel] * there * (h.inputs["branch"] == sign)
        return {**h.observed, channel: h.observed[channel] + extra}

    return change


@pytest.mark.parametrize("memory", [0.0, 0.6])
def test_p_values_of_nothing_are_uniform(memory: float, fit_rig) -> None:
    """A hundred campaigns of one condition with nothing hidden, no effect among the patterns.

    At the nominal 10 % there are at most 20 false alarms with a probability of 0.999; Kolmogorov's distance
    from the uniform distribution is one that chance exceeds in more than one case in a thousand.
    """
    p, start = [], None
    for seed in range(100):
        fitted = fit_rig(start=start, memory=memory, seed=seed, periods=(60.0,), loads=(1.0,), samples=30)
        start = fitted.z if start is None else start
        p.append(look(fitted, [], np.random.default_rng(seed), shuffles=150).p_value)
    assert sum(v <= 0.1 for v in p) <= 20
    assert kstest(p, "uniform").pvalue > 1e-3


def heavy_tails(seed: int):
    """Add noise with the tails of Student's t with three degrees of freedom, 2 % of the span wide."""

    def change(h):
        rng = np.random.default_rng([seed, 3])
        return {c: v + 0.02 * SPAN[c] * rng.standard_t(3.0, v.size) for c, v in h.observed.items()}

    return change


def test_p_values_in_noise_with_heavy_tails_are_uniform(fit_rig) -> None:
    """As above; in nearly all of the campaigns the noise is told to have heavy tails."""
    p, start, heavy = [], None, 0
    for seed in range(100):
        fitted = fit_rig(heavy_tails(seed), start, seed=seed, periods=(60.0,), loads=(1.0,), samples=60)
        start = fitted.z if start is None else start
        heavy += fitted.noise[0].heavy
        p.append(look(fitted, [], np.random.default_rng(seed), shuffles=150).p_value)
    assert heavy > 50
    assert sum(v <= 0.1 for v in p) <= 20
    assert kstest(p, "uniform").pvalue > 1e-3


@pytest.mark.parametrize("size", [0.1, 0.3, 1.0])
def test_a_misfit_of_few_readings_that_passes_for_heavy_tails_is_seen(size: float, fit_rig) -> None:
    """A notch in a guide. The deeper it is, the less of it counts in heavy tails: at 0.3 spans p was 0.0005."""

    def notch(h):
        x = h.observed["displacement"]
        away = (x - 0.5 * (x.min() + x.max())) / (0.03 * SPAN["displacement"])
        return {**h.observed, "force": h.observed["force"] + size * SPAN["force"] * np.exp(-0.5 * away**2)}

    fitted = fit_rig(notch, sd=0.01, samples=60, channels=CHANNELS, cycles=5)
    assert any(n.heavy for n in fitted.noise)
    assert look(fitted, [], np.random.default_rng(0)).p_value < 1e-20
    assert disagreements(fitted, ["temperature", "time", "cycle"])[0].channel == "force"


@pytest.mark.thorough
@pytest.mark.parametrize("memory", [0.0, 0.5, 0.9])
def test_p_values_of_three_pooled_conditions(memory: float, fit_rig) -> None:
    """150 campaigns with nothing hidden; with a probability of 0.999 at most 27 alarms at 10 %, at most 9 at 2 %."""
    p, start = [], None
    for seed in range(150):
        fitted = fit_rig(start=start, memory=memory, seed=seed, samples=30)
        start = fitted.z
        p.append(look(fitted, [], np.random.default_rng(seed), shuffles=200).p_value)
    for level in (0.1, 0.02):
        assert np.sum(np.array(p) <= level) <= binom.ppf(0.999, len(p), level), level


def test_a_planted_disagreement_has_a_small_p_value(fit_rig) -> None:
    for channel in CHANNELS:
        fitted = fit_rig(bump("c1", 1.0, channel, 0.03), channels=CHANNELS)
        seen = look(fitted, [], np.random.default_rng(0))
        assert seen.p_value < 1e-4
        assert seen.extrapolated
        assert "temperature" in seen.best.term.covariate
        values = [g.ln_bayes_factor for g in seen.gains]
        assert values == sorted(values, reverse=True)


def overlap(d: Disagreement, low: float, high: float) -> float:
    """Length that two intervals share, over that which they cover together."""
    return max(min(d.stop, high) - max(d.start, low), 0.0) / (max(d.stop, high) - min(d.start, low))


@pytest.mark.parametrize(
    ("condition", "sign", "channel", "size"),
    [("c1", 1.0, "force", 0.03), ("c0", -1.0, "displacement", 0.03), ("c2", 1.0, "displacement", -0.03)],
)
def test_the_place_of_a_disagreement(condition: str, sign: float, channel: str, size: float, fit_rig) -> None:
    fitted = fit_rig(bump(condition, sign, channel, size), channels=CHANNELS)
    found = disagreements(fitted, ["temperature", "time", "cycle"])
    first = found[0]
    assert (first.condition, first.channel) == (condition, channel)
    assert first.branch == ("heating" if sign > 0.0 else "cooling")
    assert (first.covariate, first.unit) == ("temperature", "degC")
    assert overlap(first, 46.0, 62.0) > 0.5
    assert first.size_sigma * size > 0.0
    assert abs(first.size_sigma) > 5.0
    # the curves, which other conditions share, give way by a part of it
    assert 0.4 < first.mean / (size * SPAN[channel]) < 1.1
    sizes = [abs(d.size_sigma) for d in found]
    assert sizes == sorted(sizes, reverse=True)


def test_a_disagreement_of_one_cycle_is_placed_in_time(fit_rig) -> None:
    def change(h):
        late = (h.inputs["cycle"] == 3.0) & (h.condition.id == "c2")
        return {"displacement": h.observed["displacement"] + 4e-4 * late}

    fitted = fit_rig(change)
    first = disagreements(fitted, ["temperature", "time"])[0]
    assert (first.condition, first.covariate, first.unit) == ("c2", "time", "s")
    assert first.size_sigma > 5.0
    sweep = (300.0, 375.0) if first.branch == "heating" else (375.0, 450.0)
    assert overlap(first, *sweep) > 0.5


def test_a_stretch_ends_at_its_own_samples(fit_rig) -> None:
    """Quantiles between samples were told, of sample numbers as well: "place in the record 41 to 43.6"."""
    fitted = fit_rig(bump("c1", 1.0, "force", 0.05), channels=CHANNELS)
    inputs = {h.condition.id: h.inputs for h in fitted.hypothesis.histories}
    found = disagreements(fitted, ["order"])
    assert found
    for d in found:
        assert {d.start, d.stop} <= set(inputs[d.condition]["order"].tolist())
        assert min(inputs[d.condition]["order"]) == 1.0


def test_no_sample_is_in_two_disagreements(fit_rig) -> None:
    fitted = fit_rig(bump("c1", 1.0, "force", 0.05), channels=CHANNELS)
    taken: set[tuple[str, str, int]] = set()
    for d in disagreements(fitted, ["temperature", "time", "cycle"]):
        h = next(h for h in fitted.hypothesis.histories if h.condition.id == d.condition)
        x, on = h.inputs[d.covariate], h.inputs["branch"] == (1.0 if d.branch == "heating" else -1.0)
        # a bin holds its lower edge but not its upper one, save for the last
        top = x <= d.stop if d.stop == x[on].max() else x < d.stop
        rows = {(d.condition, d.channel, int(r)) for r in h.row[on & (x >= d.start) & top]}
        assert rows
        assert not rows & taken
        taken |= rows


def test_the_null_has_no_order_but_the_scale_and_tails_of_each_block(fit_rig) -> None:
    fitted = fit_rig(channels=CHANNELS)
    rng = np.random.default_rng(0)
    heavy = np.concatenate(
        [rng.standard_t(2.5, b.first.size) * (1.0 + i) for i, b in enumerate(fitted.blocks)]
    )
    slow = heavy + 3.0 * np.sin(np.arange(heavy.size) / 9.0)
    sure = tuple(replace(n, others=()) for n in fitted.noise)
    drawn = shuffled(replace(fitted, whitened=slow, noise=sure), rng, 200)[0]
    for block in fitted.blocks:
        x = drawn[block.at]
        np.testing.assert_allclose(np.mean(x**2), 1.0, atol=0.02)
        assert abs(np.mean(x[1:] * x[:-1])) < 0.02
        own = slow[block.at] / np.sqrt(np.mean(slow[block.at] ** 2))
        assert np.mean(x**4) == pytest.approx(np.mean(own**4), rel=0.25)
    assert not np.array_equal(drawn[:, 0], drawn[:, 1])


def test_means_of_blocks_scatter_in_the_null(fit_rig) -> None:
    """As much as those of noise, by 1/sqrt(n); in another order alone, residuals would keep the mean they have."""
    fitted = fit_rig()
    drawn = shuffled(fitted, np.random.default_rng(0), 400)[0]
    for block in fitted.blocks:
        means = drawn[block.at].mean(axis=0)
        assert np.std(means) * np.sqrt(block.first.size) == pytest.approx(1.0, abs=0.15)


def test_tail_probabilities() -> None:
    null = norm.ppf((np.arange(400) + 0.5) / 400.0)
    p, beyond = tail_probability(null, float(np.median(null)))
    assert (p, beyond) == (201 / 401, False)
    values = np.linspace(-3.0, 12.0, 61)
    found = [tail_probability(null, float(v))[0] for v in values]
    assert np.all(np.diff(found) <= 0.05)  # a little up where counting gives way to the tail
    exact = -np.log(np.random.default_rng(0).random((200, 400)))
    far = [tail_probability(row, 9.0)[0] for row in exact]
    assert np.median(far) == pytest.approx(np.exp(-9.0), rel=0.3)
