"""Measure whether a plan keeps what it promises: advised experiments are simulated, and everything is fitted again.

    scripts/measure_plan.py shrinkage FIT --for stiffness@50degC --trials 100
    scripts/measure_plan.py apart GAP --trials 40
    scripts/measure_plan.py advised --springs 12 --trials 200

`shrinkage`: truths are drawn from the posterior of a fit, sweeps of each simulated with its noise and joined with the
old ones, and the posterior sampled anew. Expected and achieved variance, the squared error of the new mean, and how
often the 90 % interval holds the truth. `apart`: for each candidate either explanation in turn is the truth; new
measurements are simulated, both are fitted to old and new ones together, and it is counted how often ln Bayes factors
of the new ones reach the threshold for the true one: Brier score, and what it would be were every probability right.
`advised`: the same of the experiments that `plan` puts first, with the probabilities that it prints, and of whole loops
as they were measured for as many hours, at least one; of several simulated springs together.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

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
from sma_bayes.studies.plan.telling_apart import discriminations
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


def gap_of_spring(number: int, folder: Path) -> Path:
    """A gap study of a spring that changes from cycle to cycle, in turn its level, its stroke and its zero by time."""
    rng, clock = np.random.default_rng([77, number]), 0.0
    size, pace, noise = rng.uniform(0.3, 1.5), rng.uniform(0.7, 3.0), rng.choice([0.1, 0.2])
    lines = ["time_s,temperature_C,displacement_mm,cycle"]
    up = np.linspace(25.0, 75.0, 25)
    for cycle in range(1, 6):
        grown = size * (1.0 - np.exp((1.0 - cycle) / pace))
        for branch, middle in ((up, 52.0), (up[::-1], 46.0)):
            for t in branch:
                clock += 2.0 if cycle % 2 else 4.0
                share = 1.0 / (1.0 + np.exp(-0.32 * (t - middle)))
                change = (grown, 1.6 * grown * share, 0.02 * size * np.sqrt(clock))[number % 3]
                x = 10.0 + 20.0 * share + change + noise * rng.standard_normal()
                lines.append(f"{clock:g},{t:.4f},{x:.5g},{cycle}")
    bench, out = folder / f"bench-{number}", folder / f"gap-{number}"
    bench.mkdir(parents=True)
    (bench / "a.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    (bench / "campaign.toml").write_text('[[condition]]\nid = "a"\nfile = "a.csv"\n', encoding="utf-8")
    sma_bayes.study_gap(sma_bayes.read_campaign(bench), out, jobs=1, figures=False)
    return out


def carried_out(
    folder: Path, data: Path | None, trials: int, first: int, seed: int
) -> tuple[list[Trial], list[Trial]]:
    """Experiments that a plan puts first, and whole loops as they were measured, about pairs that are still open.

    Both have the same truths, as far as chance goes the same seeds.
    """
    gap, campaign = read_gap(folder, data)
    rivals = fitted_rivals(gap, campaign, folder / "priors.toml", 0)
    found = sma_bayes.plan(folder, TELL_APART, data=data)
    open_pairs = [n for n, r in enumerate(found["rivals"]) if not r["told_apart"]] or range(len(rivals.pairs))
    rng = np.random.default_rng(seed)
    advised, even = [], []
    for i in range(trials):
        c = found["candidates"][i % min(first, len(found["candidates"]))]
        candidate = CandidateExperiment(
            c["condition"], c["lowest"], c["peak"], c["rate"], c["load"], c["cycles"], c["samples"], 0.0
        )
        n = int(rng.choice(open_pairs))
        turned = bool(rng.uniform() < 0.5)
        pair = rivals.pairs[n][::-1] if turned else rivals.pairs[n]
        side = "if_second" if turned else "if_first"
        advised.append(Trial(c["pairs"][n][side], trial(rivals, pair, candidate, 5000 + i).reached))
        other = as_measured(rivals, candidate)
        told = discriminations(rivals, other)[n]
        even.append(Trial(getattr(told, side), trial(rivals, pair, other, 5000 + i).reached))
    return advised, even


def measure_advised(arguments: argparse.Namespace) -> None:
    everything: dict[str, list[Trial]] = {"advised": [], "as measured": []}
    with TemporaryDirectory() as place:
        for number in range(arguments.springs):
            folder = gap_of_spring(number, Path(place))
            both = carried_out(folder, None, arguments.trials, arguments.first, arguments.seed)
            for own, new in zip(everything.values(), both, strict=True):
                own += new
            text = ", ".join(f"{np.mean([t.reached for t in own]):.2f}" for own in both)
            print(f"spring {number}: told apart, advised and as measured: {text}", flush=True)
    for name, trials in everything.items():
        score, right = brier(trials)
        p, reached = (np.array([getattr(t, what) for t in trials]) for what in ("probability", "reached"))
        print(f"{name}: said {p.mean():.3f}, reached {reached.mean():.3f}; Brier score {score:.4f}, {right:.4f} were "
              f"all probabilities right; {len(trials)} simulations")  # fmt: skip
        for low, high in ((0.0, 0.2), (0.2, 0.8), (0.8, 1.01)):
            own = (low <= p) & (p < high)
            if own.any():
                miss = float(np.mean((p[own] - reached[own]) ** 2))
                print(f"    said {low:g} to {min(high, 1.0):g}: {own.sum()}, {p[own].mean():.3f} on average, "
                      f"{reached[own].mean():.3f} reached; Brier score {miss:.4f}")  # fmt: skip


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
    advised.add_argument("--springs", type=int, default=12)
    advised.add_argument("--trials", type=int, default=200)
    advised.add_argument("--first", type=int, default=3)
    advised.add_argument("--seed", type=int, default=0)
    advised.set_defaults(measure=measure_advised)
    arguments = parser.parse_args()
    arguments.measure(arguments)


if __name__ == "__main__":
    main()
