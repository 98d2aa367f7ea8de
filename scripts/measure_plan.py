"""Measure whether a plan keeps what it promises: advised experiments are simulated, and everything is fitted again.

    scripts/measure_plan.py shrinkage FIT --for stiffness@50degC --trials 100
    scripts/measure_plan.py sweeps displacement --repeats 24 --keep displacement.jsonl
    scripts/measure_plan.py apart GAP --trials 40
    scripts/measure_plan.py advised --springs 12 --trials 200
    scripts/measure_plan.py foreign --springs 20 --keep foreign.jsonl

`shrinkage`: truths are drawn from the posterior of a fit, sweeps of each simulated with its noise and joined with the
old ones, and the posterior sampled anew. Expected and achieved variance, the squared error of the new mean, and how
often the 90 % interval holds the truth. `sweeps`: springs are simulated whose sweeps differ, and not as the model would
have it; they are fitted and planned for as users do, further sweeps of the same spring are simulated, and all are
fitted again. Printed are standard deviations that were said and found. `apart`: for each candidate either explanation
in turn is the truth; new measurements are simulated, both are fitted to old and new ones together, and it is counted
how often ln Bayes factors of the new ones reach the threshold for the true one: Brier score, and what it would be were
every probability right. `advised`: the same of the experiments that `plan` puts first, with the probabilities that it
prints, and of whole loops as they were measured for as many hours, at least one; of several simulated springs together,
of which the measurements leave explanations open. Of others `plan` advises nothing; `--decided` takes what it puts
first there. The score is divided into reliability, what is said wrongly, and refinement, what chance decides.
`foreign`: the truth is none of the explanations. Three cycles are made of springs that change by the mechanisms of
`foreign_mechanisms.py`, studied and planned for; the experiments that come first go on with the mechanism, and old and
new measurements together tell the explanations apart, or not, the noise being estimated anew.

References
----------
A. H. Murphy, "A new vector partition of the probability score", J. Appl. Meteorol. 12 (1973) 595,
doi 10.1175/1520-0450(1973)012<0595:ANVPOT>2.0.CO;2.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import count
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from calibration.curves import Curve, mean_of, ratio, two_steps
from calibration.truths import POPULATION, TRUTHS, UNITS, Case, Design, seed_of
from foreign_mechanisms import MECHANISMS, Size, displacement, measured_first
from scipy.special import expit, ndtri

import sma_bayes
from sma_bayes.arrays import Floats
from sma_bayes.assess.held_out import evaluated_on, missed_by, of_samples
from sma_bayes.errors import MeasurementError
from sma_bayes.fitting.curves import CurveDraws
from sma_bayes.records.types import Branch, Campaign, Condition, Record
from sma_bayes.runs.outputs import read_run
from sma_bayes.runs.stored_draws import draws_of
from sma_bayes.sampling.importance import importance_draws
from sma_bayes.sampling.weighted import resampled
from sma_bayes.studies.gap.fitting import FittedHypothesis, fit_hypothesis, fit_with_noise
from sma_bayes.studies.gap.noise import BlockNoise, blocks_of
from sma_bayes.studies.plan.apart import (
    Explanation,
    Prospect,
    alone_with,
    chances,
    expected,
    further,
    gone_on,
    noise_there,
)
from sma_bayes.studies.plan.asked import TELL_APART, parse_asked
from sma_bayes.studies.plan.candidates import CandidateExperiment, settings_of
from sma_bayes.studies.plan.information import Knowledge, PlannedSweep, PlanTarget
from sma_bayes.studies.plan.rivals import THRESHOLD, RivalExplanations, conditions_of, fitted_rivals, read_gap
from sma_bayes.studies.plan.scatter import scatter_of
from sma_bayes.studies.plan.telling_apart import discriminations
from sma_bayes.studies.sensitivity.quantities import QuantityDraws

DRAWN = 1000
BINS = 10
KEPT = "JSON lines of what was found; springs there are not done again"
PLACES = (0.3, 0.5, 0.7)
"""Shares of the way of a curve at which it is asked about."""


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
    pair : str
        Truth and rival.
    """

    probability: float
    reached: bool
    pair: str = ""


@dataclass(frozen=True)
class Divided:
    """A Brier score, divided by bins of the probability; what probabilities of a bin differ by is left out.

    Attributes
    ----------
    reliability : float
        Mean square of what was said less what happened, of the bins.
    chance : float
        What that would be on average were every probability right.
    refinement : float
        Variance of what happened in the bins: nothing that is said of a bin alone has a lower score.
    """

    reliability: float
    chance: float
    refinement: float

    @staticmethod
    def of(trials: Sequence[Trial], bins: int = BINS) -> Divided:
        """By so many bins of equal width."""
        p, reached = numbers_of(trials)
        own = np.minimum((bins * p).astype(int), bins - 1)
        n = np.bincount(own, minlength=bins)
        said, happened, uncertain = (
            np.bincount(own, x, bins)[n > 0] / n[n > 0] for x in (p, reached, p * (1.0 - p))
        )
        n = n[n > 0] / len(p)
        return Divided(
            float(n @ (said - happened) ** 2),
            float(uncertain.sum() / len(p)),
            float(n @ (happened * (1.0 - happened))),
        )


def with_new(
    fitted: FittedHypothesis, history: int, observed: Floats, candidate: CandidateExperiment
) -> FittedHypothesis:
    """An explanation fitted to old and new measurements."""
    whole = fitted.hypothesis
    new = further(candidate, whole.histories[history])
    blocks = blocks_of(alone_with(whole, history, new))
    filled = replace(new, observed={b.channel: observed[b.at] for b in blocks})
    longer = [gone_on(h, filled) if n == history else h for n, h in enumerate(whole.histories)]
    later = iter(noise_there(fitted, history, new, blocks))
    noise = [n if b.history != history else gone_on_noise(n, next(later), b.first.size, new.n)
             for b, n in zip(fitted.blocks, fitted.noise, strict=True)]  # fmt: skip
    return fit_hypothesis(replace(whole, histories=tuple(longer)), fitted.z, tuple(noise))


def gone_on_noise(old: BlockNoise, new: BlockNoise, before: int, after: int) -> BlockNoise:
    """Noise of a block that was measured on, by so many samples."""
    scale = [np.broadcast_to(n.scale, count) for n, count in ((old, before), (new, after))]
    return BlockNoise(old.sd, np.concatenate([old.memory, new.memory]), np.concatenate(scale))


def trial(
    rivals: RivalExplanations, pair: tuple[int, int], candidate: CandidateExperiment, seed: int
) -> Trial:
    """Draw a truth from the first of a pair, simulate, and fit both again."""
    rng = np.random.default_rng(seed)
    true, rival = (rivals.explanations[i] for i in pair)
    history = list(conditions_of(rivals)).index(candidate.condition)
    new = further(candidate, true.fitted.hypothesis.histories[history])
    one = Explanation.of(true.name, true.fitted, rng, 1)
    hypothesis = true.fitted.hypothesis
    blocks = blocks_of(alone_with(hypothesis, history, new))
    mean = expected(hypothesis, history, new, hypothesis.space.constrain(one.draws[0]))
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
    needed = THRESHOLD - rivals.known(pair)
    said = chances(Prospect.of(true, history, new), Prospect.of(rival, history, new), needed)[0]
    name = f"{true.name or 'none'} against {rival.name or 'none'}"
    return Trial(float(np.mean(said)), bool(gained[0] - gained[1] >= needed), name)


def brier(trials: Sequence[Trial]) -> tuple[float, float]:
    """Brier score, and what it is expected to be if every probability is right."""
    p, reached = numbers_of(trials)
    return float(np.mean((p - reached) ** 2)), float(np.mean(p * (1.0 - p)))


def numbers_of(trials: Sequence[Trial]) -> tuple[Floats, Floats]:
    """Probabilities, and 1 of those that told apart."""
    return np.array([t.probability for t in trials]), np.array([float(t.reached) for t in trials])


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
        print(f"{found[-1].pair}: {found[-1].probability:.3f} {found[-1].reached}", flush=True)
    score, right = brier(found)
    p, reached = numbers_of(found)
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
    return gap_of(lines, folder / f"bench-{number}", folder / f"gap-{number}")


def gap_of(lines: Sequence[str], bench: Path, out: Path) -> Path:
    """A gap study of a campaign of one file."""
    bench.mkdir(parents=True)
    (bench / "a.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    (bench / "campaign.toml").write_text('[[condition]]\nid = "a"\nfile = "a.csv"\n', encoding="utf-8")
    sma_bayes.study_gap(sma_bayes.read_campaign(bench), out, jobs=1, figures=False)
    return out


def candidate_of(c: Mapping[str, Any]) -> CandidateExperiment:
    """A candidate of a plan."""
    return CandidateExperiment(
        c["condition"], c["lowest"], c["peak"], c["rate"], c["load"], c["cycles"], c["samples"], 0.0
    )


def foreign_trials(mechanism: str, number: int, folder: Path, first: int) -> list[Trial]:
    """What a plan puts first for a spring, carried out, for each pair of explanations that is open."""
    rng = np.random.default_rng([78, list(MECHANISMS).index(mechanism), number])
    size, old = Size.drawn(rng), measured_first()
    x = displacement(mechanism, old, size) + size.noise * rng.standard_normal(old["time"].size)
    rows = zip(old["time"], old["temperature"], x, old["cycle"], strict=True)
    lines = [
        "time_s,temperature_C,displacement_mm,cycle",
        *(f"{t:g},{c:.4f},{d:.5g},{n:g}" for t, c, d, n in rows),
    ]
    name = f"{mechanism}-{number}"
    out = gap_of(lines, folder / name, folder / f"{name}-gap")
    try:
        found = sma_bayes.plan(out, TELL_APART)
    except MeasurementError:
        return []  # nothing was named, and nothing came near
    gap, campaign = read_gap(out)
    rivals = fitted_rivals(gap, campaign, out / "priors.toml", 0)
    trials = []
    for c in found["candidates"][:first]:
        for n, rival in enumerate(found["rivals"]):
            if not rival["told_apart"]:
                new = further(candidate_of(c), rivals.explanations[0].fitted.hypothesis.histories[0])
                both = {k: np.concatenate([old[k], new.inputs[k]]) for k in old}
                goes_on = displacement(mechanism, both, size)[old["time"].size :]
                observed = 1e-3 * (goes_on + size.noise * rng.standard_normal(new.n))
                apart = told_apart_by_all(rivals, rivals.pairs[n], candidate_of(c), observed)
                pair = f"{mechanism}: {rival['first'] or 'none'} against {rival['second'] or 'none'}"
                trials.append(Trial(c["pairs"][n]["probability"], apart, pair))
    return trials


def told_apart_by_all(
    rivals: RivalExplanations, pair: tuple[int, int], candidate: CandidateExperiment, observed: Floats
) -> bool:
    """Whether old and new measurements tell a pair apart, under the noise that the best explanation leaves.

    As `gap` judges: not both are within the threshold of the best.
    """
    whole = [with_new(e.fitted, 0, observed, candidate) for e in rivals.explanations]
    best = max(whole, key=lambda f: f.ln_evidence)
    noise = fit_with_noise(best.hypothesis, best.z).noise
    evidence = [fit_hypothesis(f.hypothesis, f.z, noise).ln_evidence for f in whole]
    return min(evidence[i] for i in pair) <= max(evidence) - THRESHOLD


def carried_out(
    folder: Path, data: Path | None, trials: int, first: int, seed: int, decided: bool = False
) -> tuple[list[Trial], list[Trial]]:
    """Experiments that a plan puts first, and whole loops as they were measured, about pairs that are still open.

    Truths are drawn by the odds that they have; both have the same, as far as chance goes the same seeds. None where no
    pair is open, of which a plan advises nothing; or, where `decided`, of all pairs then.
    """
    gap, campaign = read_gap(folder, data)
    found = sma_bayes.plan(folder, TELL_APART, data=data)
    open_pairs = [n for n, r in enumerate(found["rivals"]) if not r["told_apart"]]
    if not open_pairs and not decided:
        return [], []
    open_pairs = open_pairs or list(range(len(found["rivals"])))
    rivals = fitted_rivals(gap, campaign, folder / "priors.toml", 0)
    rng = np.random.default_rng(seed)
    advised, even = [], []
    for i in range(trials):
        c = found["candidates"][i % min(first, len(found["candidates"]))]
        candidate = candidate_of(c)
        n = int(rng.choice(open_pairs))
        turned = bool(rng.uniform() >= expit(rivals.known(rivals.pairs[n])))
        pair = rivals.pairs[n][::-1] if turned else rivals.pairs[n]
        side = "if_second" if turned else "if_first"
        one = trial(rivals, pair, candidate, 5000 + i)
        advised.append(replace(one, probability=c["pairs"][n][side]))
        other = as_measured(rivals, candidate)
        told = discriminations(rivals, other)[n]
        even.append(replace(trial(rivals, pair, other, 5000 + i), probability=getattr(told, side)))
    return advised, even


def kept(path: Path | None) -> list[dict[str, Any]]:
    """JSON lines of a file that may not be there yet."""
    lines = path.read_text(encoding="utf-8").splitlines() if path and path.exists() else []
    return [json.loads(line) for line in lines]


def keep(path: Path | None, lines: Iterable[dict[str, Any]]) -> None:
    """Append JSON lines to a file, if there is one."""
    if path:
        with path.open("a", encoding="utf-8") as file:
            file.writelines(json.dumps(line) + "\n" for line in lines)


def measure_advised(arguments: argparse.Namespace) -> None:
    found = kept(arguments.keep)
    with TemporaryDirectory() as place:
        for number in count():
            if sum(bool(f["advised"]) for f in found) >= arguments.springs:
                break
            if number in {f["spring"] for f in found}:
                continue
            folder = gap_of_spring(number, Path(place))
            both = carried_out(folder, None, arguments.trials, arguments.first, number, arguments.decided)
            one = {"spring": number} | {
                name: [asdict(t) for t in trials]
                for name, trials in zip(("advised", "even"), both, strict=True)
            }
            found.append(one)
            keep(arguments.keep, [one])
            told = "; as measured: ".join(score_of(trials) for trials in both if trials)
            print(f"spring {number}: {told or 'told apart already'}", flush=True)
    advised, even = ([Trial(**t) for f in found for t in f[name]] for name in ("advised", "even"))
    print(f"{len(found)} springs, experiments of {sum(bool(f['advised']) for f in found)} of them")
    for name, trials in (("advised", advised), ("as measured", even)):
        divided = Divided.of(trials)
        print(f"{name}: {score_of(trials)}; reliability {divided.reliability:.4f}, {divided.chance:.4f} by chance, "
              f"refinement {divided.refinement:.4f}")  # fmt: skip
        for low in np.linspace(0.0, 0.8, 5):
            own = [t for t in trials if low <= t.probability < low + 0.2 or t.probability == low + 0.2 == 1.0]
            if own:
                print(f"    said {low:.1f} to {low + 0.2:.1f}: {score_of(own)}")
        for pair in dict.fromkeys(t.pair for t in trials):
            print(f"    {pair}: {score_of([t for t in trials if t.pair == pair])}")


def measure_foreign(arguments: argparse.Namespace) -> None:
    found = kept(arguments.keep)
    done = {(f["mechanism"], f["spring"]) for f in found}
    with TemporaryDirectory() as place:
        for number in range(arguments.springs):
            for mechanism in arguments.mechanisms:
                if (mechanism, number) not in done:
                    trials = foreign_trials(mechanism, number, Path(place), arguments.first)
                    found.append(
                        {"mechanism": mechanism, "spring": number, "trials": [asdict(t) for t in trials]}
                    )
                    keep(arguments.keep, found[-1:])
    for mechanism in arguments.mechanisms:
        own = [[Trial(**t) for t in f["trials"]] for f in found if f["mechanism"] == mechanism]
        trials = [t for spring in own for t in spring]
        print(f"{mechanism}: {len(own)} springs, {sum(map(bool, own))} with open pairs")
        for low, high in ((0.0, 0.8), (0.8, 0.95), (0.95, 1.1)):
            some = [t for t in trials if low <= t.probability < high]
            if some:
                print(f"    said {low:.1f} and more: {score_of(some)}")


def score_of(trials: Sequence[Trial]) -> str:
    """Mean probability, how often it happened, and the Brier score, in words."""
    score, right = brier(trials)
    p, reached = numbers_of(trials)
    return (
        f"{len(trials)} experiments, said {p.mean():.3f}, reached {reached.mean():.3f}; Brier score {score:.4f}, "
        f"{right:.4f} were all probabilities right"
    )


def differing_pair(repeat: int, rng: np.random.Generator, data: Path) -> Case:
    """Four or five sweeps of force and displacement that differ as those of `differing_sweeps` do.

    Place, width and second step of a sweep are those of both channels, offsets and strokes of each.
    """
    design = Design.of(repeat, rng)
    apart = rng.choice((-1.0, 1.0)) * rng.uniform(4.0, 6.0) / design.rate
    # standard deviations: 1.5 % of the span, 3 %, 0.15/rate, 8 % of the rate, 3 % of the span
    moves = rng.uniform(0.5, 1.5) * np.array([0.015, 0.03, 0.15 / design.rate, 0.08, 0.03])
    temperature = np.linspace(design.low, design.high, 25)
    if design.branch is Branch.COOLING:
        temperature = temperature[::-1]
    span = {"force": 2.5, "displacement": 0.02}
    before = {"force": 0.0, "displacement": 0.5 / design.rate}

    def drawn(rng: np.random.Generator) -> dict[str, Curve]:
        place, width, second = moves[2:] * rng.standard_normal(3)
        out = {}
        for channel, size in span.items():
            offset, stroke = moves[:2] * rng.standard_normal(2)
            out[channel] = two_steps(
                size * (1.0 + stroke), design.rate * np.exp(width), design.middle - before[channel] + place,
                size * (0.2 + offset), 0.15 + second, apart, 1.5,
            )  # fmt: skip
        return out

    def read(rng: np.random.Generator) -> dict[str, Floats]:
        return {
            c: curve.value(temperature) + design.level * span[c] * rng.standard_normal(temperature.size)
            for c, curve in drawn(rng).items()
        }

    def again(rng: np.random.Generator) -> tuple[Floats, dict[str, Floats]]:
        return temperature, read(rng)

    population = [drawn(rng) for _ in range(POPULATION)]
    curves = {c: mean_of([one[c] for one in population]) for c in span}
    inputs, observed = sweeps_in_turn(again, (4, 5)[repeat % 2], rng)
    name = "differing sweeps of force and displacement"
    record = Record(
        Condition("truth"), design.branch, inputs, observed, np.arange(inputs["time"].size),
        {k: UNITS[k] for k in ("temperature", "time", *span)},
    )  # fmt: skip
    stiffness = ratio(curves["force"], curves["displacement"])
    return Case(Campaign(name, name, "", (record,)), curves, stiffness, again, design.level)


def sweeps_in_turn(
    again: Callable[[np.random.Generator], tuple[Floats, dict[str, Floats]]],
    number: int,
    rng: np.random.Generator,
) -> tuple[dict[str, Floats], dict[str, Floats]]:
    """Inputs and readings of so many further sweeps."""
    temperatures, readings = zip(*(again(rng) for _ in range(number)), strict=True)
    n = temperatures[0].size
    inputs = {
        "temperature": np.concatenate(temperatures),
        "time": np.arange(float(number * n)),
        "segment": np.repeat(np.arange(float(number)), n),
    }
    return inputs, {c: np.concatenate([r[c] for r in readings]) for c in readings[0]}


@dataclass(frozen=True)
class Narrowed:
    """What further sweeps left of a quantity, which was planned for.

    Attributes
    ----------
    repeat, sweeps : int
        Number of the spring, and of its sweeps before.
    name : str
        Of the quantity.
    now, said, found : float
        Standard deviations: before, expected, and of the fit of all sweeps.
    inside : bool or None
        Whether its new 90 % interval holds the truth; None where that is no number of the model's.
    apart : bool
        Whether both fits give sweeps something of their own.
    seconds : float
        Processor time of both.
    """

    repeat: int
    sweeps: int
    name: str
    now: float
    said: float
    found: float
    inside: bool | None
    apart: bool
    seconds: float


def narrowed(repeat: int, channel: str, cycles: int) -> Iterator[Narrowed]:
    """Fit sweeps of a spring, plan so many cycles more, measure those, and fit everything again.

    Fits and plans are those of a user who names no option.
    """
    making, reading = (np.random.default_rng(s) for s in seed_of("differing_sweeps", repeat).spawn(2))
    make = differing_pair if channel == "stiffness" else TRUTHS["differing_sweeps"].make
    case = make(repeat, making, Path())
    old = case.record
    curve = case.stiffness if channel == "stiffness" else case.curves[channel]
    assert curve is not None
    inputs, observed = sweeps_in_turn(case.again, cycles, reading)
    new = replace(old, inputs=inputs, observed=observed, row=np.arange(inputs["time"].size))
    whole = joined(old, new)
    sweeps = np.unique(old.inputs["segment"]).size
    low, high = float(old.temperature.min()), float(old.temperature.max())
    t = np.linspace(low, high, 801)
    way = case.curves["displacement"].value(t)
    places = np.interp(PLACES, (way - way[0]) / (way[-1] - way[0]), t).tolist()
    with TemporaryDirectory() as place:
        folder, fits = Path(place), {}
        began = time.process_time()
        for name, record in (("before", old), ("after", whole)):
            fits[name] = folder / name
            campaign = replace(case.campaign, records=(record,))
            sma_bayes.fit_campaign(campaign, fits[name], seed=repeat, jobs=1, figures=False)
        seconds = time.process_time() - began
        apart = all(
            any(
                d.between_sweeps is not None
                for r in read_run(f).summary.records
                for d in r.discrepancy.values()
            )
            for f in fits.values()
        )
        file = folder / "candidates.toml"
        file.write_text(
            f'[[candidate]]\nlowest = "{low} degC"\npeak = "{high} degC"\nrate = "1 K/min"\ncycles = {cycles}\n'
            f"samples = {old.n // sweeps}\n",
            encoding="utf-8",
        )
        for asked, share in (*((f"{channel}@{at:.6f} degC", s) for at, s in zip(places, PLACES, strict=True)),
                             ("parameters", None)):  # fmt: skip
            before, after = (sma_bayes.plan(f, asked, candidates=file) for f in fits.values())
            expected = before["candidates"][0]["expected"]
            for one, then, e in zip(before["quantities"], after["quantities"], expected, strict=True):
                inside = None
                if share is not None:
                    inside = then["q05"] <= float(curve.value(np.array([one["at"]]))[0]) <= then["q95"]
                name = one["name"] if share is None else f"{channel} at {share:g} of the way"
                yield Narrowed(
                    repeat, sweeps, name, one["sd"], e["sd"], then["sd"], inside, apart, round(seconds, 1)
                )


def measure_sweeps(arguments: argparse.Namespace) -> None:
    found = [Narrowed(**line) for line in kept(arguments.keep)]
    for repeat in sorted(set(range(arguments.repeats)) - {f.repeat for f in found}):
        new = list(narrowed(repeat, arguments.channel, arguments.cycles))
        found += new
        keep(arguments.keep, map(asdict, new))
        print(f"spring {repeat}, {new[0].sweeps} sweeps, {new[0].seconds:.0f} s: "
              f"{', '.join(f'{f.found / f.said:.2f}' for f in new)}", flush=True)  # fmt: skip
    print("standard deviations over that of now (medians), and found over said (with quartiles):")
    for name in dict.fromkeys(f.name for f in found):
        own = [f for f in found if f.name == name]
        said, happened, miss = (
            np.quantile(r, (0.25, 0.5, 0.75))
            for r in (
                [f.said / f.now for f in own],
                [f.found / f.now for f in own],
                [f.found / f.said for f in own],
            )
        )
        held = [f.inside for f in own if f.inside is not None]
        text = f"; 90 % intervals hold {np.mean(held):.2f}" if held else ""
        print(f"{name}: {len(own)} springs, said {said[1]:.2f}, found {happened[1]:.2f}; "
              f"{miss[1]:.2f} ({miss[0]:.2f} to {miss[2]:.2f}){text}")  # fmt: skip


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
    sweeps = kinds.add_parser("sweeps")
    sweeps.add_argument("channel", choices=("displacement", "stiffness"))
    sweeps.add_argument("--repeats", type=int, default=24)
    sweeps.add_argument("--cycles", type=int, default=4)
    sweeps.add_argument(
        "--keep", type=Path, help="JSON lines of what was found; springs there are not done again"
    )
    sweeps.set_defaults(measure=measure_sweeps)
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
    advised.add_argument(
        "--decided", action="store_true", help="also what is put first where the measurements tell all apart"
    )
    advised.add_argument("--keep", type=Path, help=KEPT)
    advised.set_defaults(measure=measure_advised)
    foreign = kinds.add_parser("foreign")
    foreign.add_argument("--mechanisms", nargs="+", choices=MECHANISMS, default=list(MECHANISMS))
    foreign.add_argument("--springs", type=int, default=20)
    foreign.add_argument("--first", type=int, default=3)
    foreign.add_argument("--keep", type=Path, help=KEPT)
    foreign.set_defaults(measure=measure_foreign)
    arguments = parser.parse_args()
    arguments.measure(arguments)


if __name__ == "__main__":
    main()
