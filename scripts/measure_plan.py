"""Measure whether a plan keeps what it promises: advised experiments are simulated, and everything is fitted again.

    scripts/measure_plan.py shrinkage FIT --for stiffness@50degC --trials 100
    scripts/measure_plan.py apart GAP --trials 40
    scripts/measure_plan.py advised GAP --trials 40

`shrinkage`: truths are drawn from the posterior of a fit, sweeps of each simulated with its noise and joined with the
old ones, and the posterior sampled anew. Expected and achieved variance, the squared error of the new mean, and how
often the 90 % interval holds the truth. `apart`: for each candidate either explanation in turn is the truth; new
measurements are simulated, both are fitted to old and new ones together, and it is counted how often ln Bayes factors
of the new ones reach the threshold for the true one: Brier score, and what it would be were every probability right.
`advised`: the same of the experiments that `plan` puts first, with the probabilities that it prints, and of whole loops
as they were measured for as many hours, at least one.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.special import ndtri

import sma_bayes
from sma_bayes.arrays import Floats
from sma_bayes.assess.held_out import evaluated_on, missed_by, of_samples
from sma_bayes.fitting.curves import CurveDraws
from sma_bayes.records.types import Record
from sma_bayes.runs.outputs import read_run
from sma_bayes.runs.stored_draws import draws_of
from sma_bayes.sampling.importance import importance_draws
from sma_bayes.sampling.weighted import resampled
from sma_bayes.studies.gap.fitting import FittedHypothesis, fit_hypothesis
from sma_bayes.studies.gap.noise import blocks_of
from sma_bayes.studies.plan.apart import Explanation, Prospect, alone_with, chances, further, noise_there
from sma_bayes.studies.plan.asked import TELL_APART, parse_asked
from sma_bayes.studies.plan.candidates import CandidateExperiment, settings_of
from sma_bayes.studies.plan.information import Knowledge, PlannedSweep, PlanTarget
from sma_bayes.studies.plan.rivals import THRESHOLD, RivalExplanations, conditions_of, fitted_rivals, read_gap
from sma_bayes.studies.plan.scatter import scatter_of
from sma_bayes.studies.plan.telling_apart import SURE
from sma_bayes.studies.sensitivity.quantities import QuantityDraws

DRAWN = 1000
CURVES = 16


@dataclass(frozen=True)
class Refit:
    """What a simulated experiment left.

    Attributes
    ----------
    spread : float
        Width of the 90 % interval of the quantity over that of a standard normal.
    error : float
        Its new median less the truth.
    below : float
        Share of the new draws below the truth.
    converged : bool
    """

    spread: float
    error: float
    below: float
    converged: bool


def joined(old: Record, new: Record) -> Record:
    """Old and new sweeps in one record."""
    inputs = {}
    for name in old.inputs.keys() & new.inputs.keys():
        later = new.inputs[name]
        if name in ("segment", "time"):
            later = later + old.inputs[name].max() + 1.0
        inputs[name] = np.concatenate([old.inputs[name], later])
    observed = {c: np.concatenate([old.observed[c], new.observed[c]]) for c in old.channels}
    return replace(old, inputs=inputs, observed=observed, row=np.arange(old.n + new.n))


def spread_of(values: Floats) -> float:
    """Width of the 90 % interval of draws over that of a standard normal."""
    low, high = np.quantile(values, (0.05, 0.95))
    return float((high - low) / (2.0 * ndtri(0.95)))


def refitted(
    known: Knowledge,
    parts: Sequence[tuple[PlannedSweep, int]],
    channel: str,
    at: float,
    truth: int,
    seed: int,
) -> Refit:
    """Simulate sweeps of one draw of the posterior, and sample the posterior of old and new ones together."""
    draws, posterior = known.draws, known.posterior
    rng = np.random.default_rng([seed, truth])
    weights = ({c: w[truth : truth + 1] for c, w in draws.weights.items()},) if draws.weights else ()
    whole = draws.record
    for sweep, repeats in parts:
        record = sweep.record(draws.record, repeats)
        there = evaluated_on(posterior, record)
        observed = there.replicate(rng, known.theta[truth : truth + 1], weights=weights)
        whole = joined(whole, replace(record, observed={c: v[0] for c, v in observed.items()}))
    new = of_samples(posterior, whole)
    start = posterior.space.unconstrain(known.theta[truth])
    found = importance_draws(new, [start], new.space.prior_sd(), np.random.SeedSequence([seed, truth, 1]))
    theta = new.space.constrain(found.z[resampled(found.log_weight, DRAWN, rng)])
    missed = missed_by(new, theta, np.random.SeedSequence([seed, truth, 2]))
    place = np.array([at])
    values = CurveDraws(new, theta, dict(missed[0]) if missed else {}).curve(channel, place)[:, 0]
    true = draws.curve(channel, place)[truth, 0]
    below = float(np.mean(values < true))
    return Refit(spread_of(values), float(np.median(values) - true), below, found.converged)


def target_of(
    folder: Path, key: str | None, asked: str, seed: int
) -> tuple[Knowledge, PlanTarget, str, float]:
    """What is asked of a record of a fit, the first by default."""
    question = parse_asked(asked)
    run = read_run(folder)
    entry = next(r for r in run.summary.records if key in (None, r.key))
    draws = draws_of(run.folder, entry, run.summary.seed)
    known = Knowledge.of(draws, scatter_of(draws, "none"), seed)
    at = question.at(entry)
    values = draws.curve(question.channel, np.array([at]))[:, 0]
    quantity = QuantityDraws(asked, "curve", question.channel, "", asked, values, at)
    return known, PlanTarget(known, (quantity,), known.gradient(question.channel, at)), question.channel, at


@dataclass(frozen=True)
class Trial:
    """A simulated experiment to tell two explanations apart.

    Attributes
    ----------
    probability : float
        That was said, for this truth.
    reached : bool
        Whether the new measurements told them apart.
    """

    probability: float
    reached: bool


def with_new(
    fitted: FittedHypothesis, history: int, observed: Floats, candidate: CandidateExperiment
) -> FittedHypothesis:
    """An explanation fitted to old and new measurements."""
    whole = fitted.hypothesis
    new = further(candidate, whole.histories[history])
    blocks = blocks_of(alone_with(whole, history, new))
    filled = replace(new, observed={b.channel: observed[b.at] for b in blocks})
    both = replace(whole, histories=(*whole.histories, filled), layout=(*whole.layout, whole.layout[history]))
    return fit_hypothesis(both, fitted.z, (*fitted.noise, *noise_there(fitted, history, new, blocks)))


def trial(
    rivals: RivalExplanations, pair: tuple[int, int], candidate: CandidateExperiment, seed: int
) -> Trial:
    """Draw a truth from the first of a pair, simulate, and fit both again."""
    rng = np.random.default_rng(seed)
    true, rival = (rivals.explanations[i] for i in pair)
    history = list(conditions_of(rivals)).index(candidate.condition)
    new = further(candidate, true.fitted.hypothesis.histories[history])
    one = Explanation.of(true.name, true.fitted, rng, 1)
    alone = alone_with(true.fitted.hypothesis, history, new)
    blocks = blocks_of(alone)
    mean = alone.predict(alone.space.constrain(one.draws[0]), 0)
    noise = noise_there(true.fitted, history, new, blocks)
    observed = np.concatenate(
        [
            mean[b.channel] + n.as_likely(rng.standard_normal((new.n, 1)), rng)[:, 0]
            for b, n in zip(blocks, noise, strict=True)
        ]
    )
    gained = [
        with_new(e.fitted, history, observed, candidate).ln_evidence - e.fitted.ln_evidence
        for e in (true, rival)
    ]
    said = chances(Prospect.of(true, history, new), Prospect.of(rival, history, new), THRESHOLD)[0]
    return Trial(float(np.mean(said)), gained[0] - gained[1] >= THRESHOLD)


def brier(trials: Sequence[Trial]) -> tuple[float, float]:
    """Brier score, and what it is expected to be if every probability is right."""
    p = np.array([t.probability for t in trials])
    reached = np.array([float(t.reached) for t in trials])
    return float(np.mean((p - reached) ** 2)), float(np.mean(p * (1.0 - p)))


def experiments_of(
    rivals: RivalExplanations, rng: np.random.Generator, count: int
) -> list[CandidateExperiment]:
    """Experiments drawn at random about what the campaign did: rates, peaks, loads, cycles, samples."""
    settings = settings_of(rivals.campaign.records)
    out = []
    for _ in range(count):
        s = settings[str(rng.choice(list(settings)))]
        times, load = float(rng.choice([1.0 / 3.0, 1.0, 3.0])), float(rng.choice([0.5, 1.0, 2.0]))
        peak = s.lowest + float(rng.choice([0.7, 1.0])) * (s.hottest - s.lowest)
        cycles, samples = int(rng.choice([1, 2, 4, 8])), int(rng.choice([s.samples // 2, s.samples]))
        out.append(
            CandidateExperiment(
                s.condition, s.lowest, peak, times * (s.rate or 1.0), None if s.load is None else load * s.load,
                cycles, max(samples, 4), 0.0,
            )
        )  # fmt: skip
    return out


def measure_shrinkage(arguments: argparse.Namespace) -> None:
    known, target, channel, at = target_of(arguments.folder, arguments.record, arguments.asked, 0)
    draws, record = known.draws, known.draws.record
    samples = record.n // np.unique(record.inputs["segment"]).size
    sweep = PlannedSweep(draws.coldest, draws.hottest, samples, arguments.rate)
    gain = target.expected(known.information(sweep), arguments.cycles)
    now = float(target.sd[0]) ** 2
    rng = np.random.default_rng(0)
    found = [
        refitted(known, [(sweep, arguments.cycles)], channel, at, int(rng.integers(draws.size)), i)
        for i in range(arguments.trials)
    ]
    variance = np.array([f.spread**2 for f in found]) / now
    squared = np.array([f.error**2 for f in found]) / now
    inside = np.mean([0.05 < f.below < 0.95 for f in found])
    root = np.sqrt(len(found))
    print(
        f"{draws.key}, {draws.posterior.noise.name}: expected {gain.left[0]:.4f} of the variance, achieved "
        f"{variance.mean():.4f} ± {variance.std() / root:.4f}; squared error {squared.mean():.4f} ± "
        f"{squared.std() / root:.4f}; truth within 90 %: {inside:.2f}; {len(found)} simulations, "
        f"{sum(not f.converged for f in found)} not converged"
    )


def measure_apart(arguments: argparse.Namespace) -> None:
    gap, campaign = read_gap(arguments.folder, arguments.data)
    rivals = fitted_rivals(gap, campaign, arguments.folder / "priors.toml", 0)
    rng = np.random.default_rng(arguments.seed)
    found = []
    for i, candidate in enumerate(experiments_of(rivals, rng, arguments.trials)):
        pair = rivals.pairs[i % len(rivals.pairs)]
        pair = pair if rng.uniform() < 0.5 else pair[::-1]
        found.append(trial(rivals, pair, candidate, 1000 + i))
        print(f"{rivals.explanations[pair[0]].name or 'none'} against {rivals.explanations[pair[1]].name or 'none'}: "
              f"{found[-1].probability:.3f} {found[-1].reached}", flush=True)  # fmt: skip
    score, right = brier(found)
    p, reached = np.array([t.probability for t in found]), np.array([t.reached for t in found])
    print(
        f"Brier score {score:.4f}, {right:.4f} were all probabilities right; {reached.mean():.3f} reached, "
        f"{p.mean():.3f} said; {len(found)} simulations"
    )


def as_measured(rivals: RivalExplanations, like: CandidateExperiment) -> CandidateExperiment:
    """Whole loops as they were measured, for as many hours as another experiment, at least one."""
    s = settings_of(rivals.campaign.records)[like.condition]
    one = replace(
        like,
        lowest=s.lowest,
        peak=s.hottest,
        rate=s.rate or like.rate,
        load=s.load,
        cycles=1,
        samples=s.samples,
    )
    return replace(one, cycles=max(round(like.hours / one.cycle_hours), 1))


def measure_advised(arguments: argparse.Namespace) -> None:
    """Truths and measurements of an even design have the seeds of the advised one beside it."""
    gap, campaign = read_gap(arguments.folder, arguments.data)
    rivals = fitted_rivals(gap, campaign, arguments.folder / "priors.toml", 0)
    found = sma_bayes.plan(arguments.folder, TELL_APART, data=arguments.data)
    best = [c for c in found["candidates"] if c["probability"] >= SURE][: arguments.first] or found[
        "candidates"
    ][:1]
    rng = np.random.default_rng(arguments.seed)
    advised, even = [], []
    for i in range(arguments.trials):
        c = best[i % len(best)]
        candidate = CandidateExperiment(
            c["condition"], c["lowest"], c["peak"], c["rate"], c["load"], c["cycles"], c["samples"], 0.0
        )
        n = int(rng.integers(len(rivals.pairs)))
        turned = bool(rng.uniform() < 0.5)
        pair = rivals.pairs[n][::-1] if turned else rivals.pairs[n]
        said = c["pairs"][n]["if_second" if turned else "if_first"]
        reached = trial(rivals, pair, candidate, 5000 + i).reached
        advised.append(Trial(said, reached))
        even.append(trial(rivals, pair, as_measured(rivals, candidate), 5000 + i))
        print(f"{candidate.cycles} x {candidate.peak:.4g}, {candidate.rate:.3g}/s: {said:.3f} {reached}; "
              f"as measured {even[-1].reached}", flush=True)  # fmt: skip
    for name, trials in (("advised", advised), ("as measured", even)):
        score, right = brier(trials)
        p, reached = ([getattr(t, what) for t in trials] for what in ("probability", "reached"))
        print(f"{name}: said {np.mean(p):.3f}, reached {np.mean(reached):.3f}; Brier score {score:.4f}, {right:.4f} "
              f"were all probabilities right; {len(trials)} simulations")  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    kinds = parser.add_subparsers(required=True)
    shrinkage = kinds.add_parser("shrinkage")
    shrinkage.add_argument("folder", type=Path)
    shrinkage.add_argument("--for", dest="asked", required=True)
    shrinkage.add_argument("--record")
    shrinkage.add_argument("--cycles", type=int, default=2)
    shrinkage.add_argument("--rate", type=float, default=0.05)
    shrinkage.add_argument("--trials", type=int, default=100)
    shrinkage.set_defaults(measure=measure_shrinkage)
    apart = kinds.add_parser("apart")
    apart.add_argument("folder", type=Path)
    apart.add_argument("--data", type=Path)
    apart.add_argument("--trials", type=int, default=40)
    apart.add_argument("--seed", type=int, default=0)
    apart.set_defaults(measure=measure_apart)
    advised = kinds.add_parser("advised")
    advised.add_argument("folder", type=Path)
    advised.add_argument("--data", type=Path)
    advised.add_argument("--trials", type=int, default=40)
    advised.add_argument("--first", type=int, default=5)
    advised.add_argument("--seed", type=int, default=0)
    advised.set_defaults(measure=measure_advised)
    arguments = parser.parse_args()
    arguments.measure(arguments)


if __name__ == "__main__":
    main()
