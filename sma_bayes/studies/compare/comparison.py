"""Compare the modified sigmoid with the baselines on one record of one channel.

All contenders see the same samples under the same noise. By default evidence chooses it, as for a fit
(`sma_bayes.fitting.noise_choice`), from what the contender leaves that fits best; its parameters are estimated with
each curve anew. Where that contender misses the data smoothly a discrepancy stands beside every curve, kept off the
tangents of its own (`sma_bayes.fitting.discrepancy`): else thousands of samples would be taken for so many witnesses
against whichever curve misses a little more. What a curve needs of it costs evidence, the more the larger it is.
Densities of what was held out are those of curve and discrepancy, as far as it is known without; predicted values,
correlation factors and curves are those of the contender alone.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Final

import numpy as np
from scipy.special import logsumexp

from sma_bayes.arrays import Floats
from sma_bayes.assess.correlation import Agreement, agreement
from sma_bayes.assess.held_out import (
    Folds,
    HeldOutPredictions,
    Predictor,
    density_of,
    folds_of,
    missed_by,
    of_samples,
)
from sma_bayes.fitting.noise_choice import SIMPLEST, Bases, NoiseChoice, choose_noise, discrepancy_bases
from sma_bayes.fitting.posterior import Posterior
from sma_bayes.fitting.warm_start import warm_start
from sma_bayes.noise import NOISE_MODELS, NoiseModel
from sma_bayes.noise.base import lag1
from sma_bayes.noise.effective_samples import EffectiveSamples, memory_of
from sma_bayes.parameters.priors_file import PriorSet
from sma_bayes.records.types import Record
from sma_bayes.response import DEFAULT_MODEL
from sma_bayes.response.polynomial import FREQUENCY, least_squares
from sma_bayes.sampling.bridge import Evidence, bridge_evidence
from sma_bayes.sampling.importance import MAX_MODES, WeightedDraws, importance_draws
from sma_bayes.sampling.laplace import Mode, find_mode
from sma_bayes.sampling.weighted import resampled, weighted_quantiles
from sma_bayes.studies.compare.contenders import (
    PLUG_IN_MODELS,
    Contender,
    by_curve,
    contenders,
    copy_of,
    curve_of,
    model_of,
    model_priors,
    posterior_of,
    unavailable,
    with_constants,
)
from sma_bayes.studies.compare.schema import StatedVerdict
from sma_bayes.studies.compare.verdict import Standing, judge, stacking_weights
from sma_bayes.threads import one_thread

AUTO: Final = "auto"
SCREENED_DRAWS: Final = 3000
"""Draws from the prior among which starting points are looked for."""
STARTS: Final = 4
LEAST_START_DISTANCE: Final = 0.3
"""Least distance of starting points [sd of the prior]."""
GRID: Final = 121
EVIDENCE_STANDARD_ERRORS: Final = 4.0
"""Standard errors within which both evidences must agree, or 0.05."""
CURVE_DRAWS: Final = 1000
"""Draws of the curve that are compared with the data, for the correlation factors."""
TIMED_EVALUATIONS: Final = 200
"""Evaluations of a density by which its time is told."""
EVALUATIONS_PER_FIT: Final = 25000
"""Evaluations of the density that one fit and its share of what is predicted take, by their time: some 20,000 of two
records of NiTiCo at 200 MPa, all models together."""
LEVELS_READ: Final = ("K_min", "K_max")
"""Parameters of the published and corrected logistic that are the extremes of the data."""
LEVELS: Final = {"q05": 0.05, "q50": 0.50, "q95": 0.95}


@dataclass(frozen=True, eq=False)
class FittedContender:
    """A contender that was fitted and asked about what was held out.

    Attributes
    ----------
    contender : Contender
    posterior : Posterior
    draws : WeightedDraws
    loo, folds : HeldOutPredictions
        Leaving out single samples, and whole folds.
    in_sample : ndarray, shape (n,)
        Log density of each sample with nothing left out.
    bridge : Evidence
        Log evidence by bridge sampling.
    curve : mapping of str to ndarray, shape (m,)
        Quantiles of the curve on a grid of temperatures.
    agreement : Agreement
        Of draws of the curve with the data to which it was fitted.
    """

    contender: Contender
    posterior: Posterior
    draws: WeightedDraws
    loo: HeldOutPredictions
    folds: HeldOutPredictions
    in_sample: Floats
    bridge: Evidence
    curve: Mapping[str, Floats]
    agreement: Agreement

    @property
    def converged(self) -> bool:
        """Whether the draws reached the target, also those of fits made anew, and both evidences agree."""
        anew = self.loo.not_converged + self.folds.not_converged
        return self.draws.converged and self.evidences_agree and not anew

    @property
    def importance(self) -> Evidence:
        """Log evidence by importance sampling."""
        return self.draws.evidence

    @property
    def evidences_agree(self) -> bool:
        """Whether the two evidences agree within their errors."""
        apart = abs(self.importance.value - self.bridge.value)
        return apart <= max(
            EVIDENCE_STANDARD_ERRORS * float(np.hypot(self.importance.sd, self.bridge.sd)), 0.05
        )

    @property
    def evidence(self) -> Evidence:
        """The evidence of smaller error."""
        return min(self.importance, self.bridge, key=lambda e: e.sd)


@dataclass(frozen=True, eq=False)
class Comparison:
    """Contenders on one record of one channel.

    Attributes
    ----------
    record : Record
    noise : NoiseModel
    noise_choice : NoiseChoice or None
        Why, where it was chosen.
    memory : float
        Samples that count as one, under `EffectiveSamples`; else one.
    folds : Folds
    fitted : mapping of str to FittedContender
        Those that were fitted; `copies` have the numbers of another, `unavailable` none.
    copies, unavailable : mapping of str to str
        Name of the other; why.
    weights : mapping of str to float
        Stacking weights of those fitted; contenders that are the same curve share its weight evenly.
    verdict : StatedVerdict
    temperature : ndarray, shape (m,)
        Grid of the curves.
    wall_s : float
    entrants : tuple of Contender
        All that were asked for.
    rank : int
        Of Eq. (11) on the record.
    """

    record: Record
    noise: NoiseModel
    noise_choice: NoiseChoice | None
    memory: float
    folds: Folds
    fitted: Mapping[str, FittedContender]
    copies: Mapping[str, str]
    unavailable: Mapping[str, str]
    weights: Mapping[str, float]
    verdict: StatedVerdict
    temperature: Floats
    wall_s: float
    entrants: tuple[Contender, ...]
    rank: int = field(default=2)

    @property
    def channel(self) -> str:
        """The channel."""
        return self.record.channels[0]

    @property
    def has_discrepancy(self) -> bool:
        """Whether one stands beside every curve."""
        return self.noise_choice is not None and any(self.noise_choice.bases)

    @property
    def converged(self) -> bool:
        """Whether every contender converged."""
        return all(f.converged for f in self.fitted.values())

    def fold_density(self, name: str) -> Floats:
        """Log density of each held-out fold (B,), each sample counted by its share."""
        density = self.fitted[name].folds.log_density / self.memory
        return np.asarray(np.bincount(self.folds.number, density, self.folds.count), dtype=float)

    def standings(self) -> tuple[Standing, ...]:
        """What the verdict rests on."""
        return tuple(_standing(f, self) for f in self.fitted.values())


@dataclass(frozen=True, eq=False)
class StartedComparison:
    """A record whose noise is chosen, before contenders are sampled.

    Attributes
    ----------
    setting : _ComparisonSetting
        What they share.
    entrants : tuple of Contender
        All that were asked for.
    copies, unavailable : mapping of str to str
        See `Comparison`.
    running : tuple of Contender
        Those that are fitted.
    modes : mapping of str to tuple of Mode
    choice : NoiseChoice or None
    seeds : tuple of numpy.random.SeedSequence
        One for each that is fitted.
    expected_s : float
        What the rest is expected to take, within a factor of three [s].
    wall_s : float
        What it took so far.
    """

    setting: _ComparisonSetting
    entrants: tuple[Contender, ...]
    copies: Mapping[str, str]
    unavailable: Mapping[str, str]
    running: tuple[Contender, ...]
    modes: Mapping[str, tuple[Mode, ...]]
    choice: NoiseChoice | None
    seeds: tuple[np.random.SeedSequence, ...]
    expected_s: float
    wall_s: float


def start_comparison(
    record: Record,
    priors: PriorSet,
    *,
    noise: str = AUTO,
    seed: int = 0,
    only: Sequence[str] = (),
    model: str = DEFAULT_MODEL,
) -> StartedComparison:
    """Find the modes of all contenders and the noise of a record.

    Parameters
    ----------
    record : Record
        Of one channel; see `sma_bayes.studies.compare.contenders.of_channel`.
    priors : PriorSet
        Of the modified sigmoid and of the noise.
    noise : str
        Name of a noise model, the same for all contenders; ``auto``: see the module.
    seed : int
    only : sequence of str
        Names of contenders to compare; all by default.
    model : str
        Name of the response model that was asked for; it takes part in any case.

    Raises
    ------
    UnknownNameError
        If there is no such noise model.
    PriorError
        If a prior is missing or wrong.
    """
    clock = time.perf_counter()
    (channel,) = record.channels
    root = np.random.SeedSequence([seed, 17, *f"{record.key} {channel}".encode()])
    entrants = tuple(c for c in contenders(model) if not only or c.name in only)
    missing = {c.name: why for c in entrants if (why := unavailable(c, record))}
    copies = {c.name: other for c in entrants if c.name not in missing and (other := copy_of(c, record))}
    running = tuple(c for c in entrants if c.name not in missing and c.name not in copies)
    with one_thread():
        scatter = NOISE_MODELS[SIMPLEST if noise == AUTO else noise]
        start_seed, *seeds = root.spawn(len(running) + 1)
        rng = np.random.default_rng(start_seed)
        modes = {c.name: _modes(posterior_of(c, record, scatter, priors), rng) for c in running}
        memory = _memory(record, scatter, running, priors, modes)
        choice, bases = None, {}
        if noise == AUTO:
            choice = _noise_choice(record, running, priors, modes, rng)
            scatter = NOISE_MODELS[choice.name]
            bases = {c.name: _bases(c, record, priors, modes[c.name]) for c in running if any(choice.bases)}
            modes = {
                c.name: _modes_beside(
                    posterior_of(
                        c,
                        record,
                        scatter,
                        priors,
                        discrepancy=bases.get(c.name),
                        longest_memory=choice.longest_memory,
                    ),
                    modes[c.name],
                    choice,
                )
                for c in running
            }
        longest = choice.longest_memory if choice is not None else ()
        setting = _ComparisonSetting(record, scatter, priors, memory, folds_of(record), bases, longest)
        expected = sum(setting.expected_s(c, modes[c.name]) for c in running)
    return StartedComparison(
        setting, entrants, copies, missing, running, modes, choice, tuple(seeds), expected,
        time.perf_counter() - clock,
    )  # fmt: skip


def finished_comparison(
    begun: StartedComparison, progress: Callable[[str], None] | None = None
) -> Comparison:
    """Fit what was started, predict what was held out, and judge; `progress` is told of each fit."""
    clock = time.perf_counter()
    setting, running = begun.setting, begun.running
    fitted: dict[str, FittedContender] = {}
    with one_thread():
        for c, own in zip(running, begun.seeds, strict=True):
            name = f"{c.name}, model {len(fitted) + 1} of {len(running)}"
            tell = partial(_tell, progress, name)
            fitted[c.name] = setting.fit(c, begun.modes[c.name], own, tell)
    curves = by_curve(running, setting.record)
    fitted = _predicted_as_one(fitted, curves)
    first = Comparison(
        setting.record, setting.noise, begun.choice, setting.memory, setting.folds, fitted, begun.copies,
        begun.unavailable, {}, _UNDECIDED, setting.grid, 0.0, begun.entrants, _rank(setting.record),
    )  # fmt: skip
    of_curves = stacking_weights({names[0]: fitted[names[0]].folds.log_density for names in curves})
    weights = {name: of_curves[names[0]] / len(names) for names in curves for name in names}
    verdict = judge(first.standings())
    took = begun.wall_s + time.perf_counter() - clock
    return replace(first, weights=weights, verdict=verdict, wall_s=took)


def _predicted_as_one(
    fitted: Mapping[str, FittedContender], curves: Sequence[Sequence[str]]
) -> dict[str, FittedContender]:
    """Contenders with the mean log density of held-out folds of all that are the same curve.

    They differ in priors at most, which tell next to nothing of a fold; of one that is hard to predict draws alone make
    them differ, by 5 to 20 in a record.
    """
    out = dict(fitted)
    for names in curves:
        density = np.mean([fitted[name].folds.log_density for name in names], axis=0)
        for name in names:
            out[name] = replace(fitted[name], folds=replace(fitted[name].folds, log_density=density))
    return out


def _tell(progress: Callable[[str], None] | None, name: str, step: str) -> None:
    if progress is not None:
        progress(f"{name}: {step}")


_UNDECIDED: Final = StatedVerdict(
    preferred="",
    verdict="",
    decisive=False,
    probability=0.0,
    rival="",
    ln_bayes_factor=0.0,
    not_told_from=(),
    why="",
)


def _standing(f: FittedContender, comparison: Comparison) -> Standing:
    c = f.contender
    folds = comparison.fold_density(c.name)
    curve = curve_of(c, comparison.record)
    return Standing(c.name, c.family, curve, c.extra, f.evidence.value, f.evidence.sd, folds)


def _modes(posterior: Posterior, rng: np.random.Generator) -> tuple[Mode, ...]:
    """Modes of a posterior, best first: from draws of the prior, each with the noise that its residuals ask for."""
    space, place = posterior.space, posterior.layout[0]
    record, model = posterior.records[0], posterior.model
    (channel,) = record.channels
    sd = int(place.noise[channel][0])
    width = space.prior_sd()

    def with_noise(theta: Floats) -> Floats:
        with np.errstate(over="ignore", invalid="ignore"):
            residual = record.observed[channel] - model.predict(theta[:, place.model], record.inputs)[channel]
            spread = np.sqrt(np.mean(residual**2, axis=1))
        theta[:, sd] = np.where(np.isfinite(spread), np.maximum(spread, 1e-300), 1e300)
        return space.unconstrain(theta)

    z = with_noise(space.constrain(space.draw(rng, SCREENED_DRAWS)))
    z = z[np.isfinite(z).all(axis=1)]
    z = z[np.argsort(-posterior.log_prob(z), kind="stable")]
    starts: list[Floats] = []
    if model.linear:  # what is solved for leads to optima that no draw of the prior need come near
        found = warm_start(posterior, rng)
        for optimum in found.optima:
            centre = space.prior_centre()
            centre[: optimum.size] = optimum
            starts.append(with_noise(space.constrain(centre)[None])[0])
    for point in z[:200]:
        if len(starts) >= STARTS:
            break
        if all(np.max(np.abs(point - other) / width) > LEAST_START_DISTANCE for other in starts):
            starts.append(point)
    modes = [m for m in (find_mode(posterior, s, width) for s in starts) if m is not None]
    return tuple(sorted(modes, key=lambda m: -m.log_prob))


def _bases(contender: Contender, record: Record, priors: PriorSet, modes: Sequence[Mode]) -> Bases:
    """Basis of the discrepancy of a contender, kept off the tangents of its curve at its best mode."""
    if FREQUENCY in record.inputs:  # where conditions were joined, at their mean frequency
        mean = float(record.inputs[FREQUENCY].mean())
        record = replace(record, inputs={**record.inputs, FREQUENCY: np.full(record.n, mean)})
    posterior = posterior_of(contender, record, NOISE_MODELS[SIMPLEST], priors)
    theta = posterior.space.constrain(modes[0].z)[posterior.layout[0].model]
    return discrepancy_bases(posterior, theta)


def _modes_beside(posterior: Posterior, alone: Sequence[Mode], choice: NoiseChoice) -> tuple[Mode, ...]:
    """Modes of a posterior with chosen noise, best first, from those of the same curve in plain noise.

    Either all that the curve misses is noise, or the noise is as chosen and what exceeds it is smooth.
    """
    space, place, record = posterior.space, posterior.layout[0], posterior.records[0]
    (channel,) = record.channels
    at, known, width = place.noise[channel], choice.estimate[0][channel], space.prior_sd()
    starts = []
    for mode in alone[:MAX_MODES]:
        z = space.prior_centre()
        z[: posterior.sampled_model.size] = mode.z[: posterior.sampled_model.size]
        theta = space.constrain(z)
        left = record.observed[channel] - posterior.predict(theta, record.inputs)[channel]
        spread = max(float(np.sqrt(np.mean(left**2))), float(known[0]))
        theta[at] = known[: at.size]
        if place.temperature_sd is not None:
            theta[place.temperature_sd] = choice.temperature_sd[0]
        for sd, size in ((float(known[0]), spread), (spread, 0.2 * spread)):
            theta[at[0]] = sd
            if channel in place.size:
                theta[place.size[channel]] = size
            start = space.unconstrain(theta)
            starts.append(np.where(np.isfinite(start), start, z))
    modes = [m for m in (find_mode(posterior, s, width) for s in starts) if m is not None]
    return tuple(sorted(modes, key=lambda m: -m.log_prob))


def _memory(
    record: Record,
    noise: NoiseModel,
    contenders: Sequence[Contender],
    priors: PriorSet,
    modes: Mapping[str, Sequence[Mode]],
) -> float:
    """Samples that count as one, from the residuals of the contender that fits best."""
    if noise.name != EffectiveSamples.name:
        return 1.0
    best, residual = _best_fitting(record, noise, contenders, priors, modes)
    steps = posterior_of(best, record, noise, priors).steps[0]
    if lag1(residual, steps.first) < 2.0 / np.sqrt(record.n):  # within what independent samples show
        return 1.0
    return memory_of(residual, steps)


def _best_fitting(
    record: Record,
    noise: NoiseModel,
    contenders: Sequence[Contender],
    priors: PriorSet,
    modes: Mapping[str, Sequence[Mode]],
) -> tuple[Contender, Floats]:
    """The contender that fits best, and its residuals (n,)."""
    (channel,) = record.channels
    found = []
    for c in contenders:
        posterior = posterior_of(c, record, noise, priors)
        theta = posterior.space.constrain(modes[c.name][0].z)
        residual = record.observed[channel] - posterior.predict(theta, record.inputs)[channel]
        # as many parameters as were fitted are paid for, or the richest curve would always be taken
        spread = float(residual @ residual) / max(record.n - posterior.space.dimension, 1)
        found.append((spread, c, residual))
    _, best, left = min(found, key=lambda f: f[0])
    return best, left


def _noise_choice(
    record: Record,
    contenders: Sequence[Contender],
    priors: PriorSet,
    modes: Mapping[str, Sequence[Mode]],
    rng: np.random.Generator,
) -> NoiseChoice:
    """Noise that the evidence prefers for what the contender leaves that fits best."""
    noise = NOISE_MODELS[SIMPLEST]
    best, _ = _best_fitting(record, noise, contenders, priors, modes)
    posterior = posterior_of(best, record, noise, priors)
    own = model_priors(model_of(best, record), priors)
    # a discrepancy that nothing speaks for would hide what one curve misses and another does not
    return choose_noise(posterior, warm_start(posterior, rng), own, allowed_loss=0.0)


@dataclass(frozen=True, eq=False)
class _ComparisonSetting:
    """What all contenders share."""

    record: Record
    noise: NoiseModel
    priors: PriorSet
    memory: float
    folds: Folds
    bases: Mapping[str, Bases]
    longest_memory: Sequence[Mapping[str, float]] = ()

    @property
    def grid(self) -> Floats:
        t = self.record.temperature
        return np.linspace(t.min(), t.max(), GRID)

    def _posterior(self, contender: Contender) -> Posterior:
        return posterior_of(
            contender,
            self.record,
            self.noise,
            self.priors,
            self.memory,
            discrepancy=self.bases.get(contender.name),
            longest_memory=self.longest_memory or None,
        )

    def expected_s(self, contender: Contender, modes: Sequence[Mode]) -> float:
        """What `fit` is expected to take, within a factor of three [s]: fits of all samples and without each fold."""
        points = np.repeat(modes[0].z[None], TIMED_EVALUATIONS, axis=0)
        posterior = self._posterior(contender)
        posterior.log_prob(points[:1])  # what is worked out once is no part of it
        clock = time.perf_counter()
        posterior.log_prob(points)
        return (
            (time.perf_counter() - clock) / TIMED_EVALUATIONS * EVALUATIONS_PER_FIT * (1 + self.folds.count)
        )

    def fit(
        self,
        contender: Contender,
        modes: Sequence[Mode],
        seed: np.random.SeedSequence,
        tell: Callable[[str], None],
    ) -> FittedContender:
        sample_seed, bridge_seed, loo_seed, fold_seed, curve_seed, missed_seed = seed.spawn(6)
        posterior = self._posterior(contender)
        width = posterior.space.prior_sd()
        tell("fit to all samples")
        draws = importance_draws(posterior, [m.z for m in modes], width, sample_seed)
        theta = posterior.space.constrain(draws.z)

        def without(part: Record) -> Posterior:
            if contender.name not in PLUG_IN_MODELS:
                return of_samples(posterior, part)
            fresh = {k: v for k, v in _plugged_in(part).items() if k in posterior.model.parameter_names}
            return with_constants(of_samples(posterior, part), fresh)

        weights = missed_by(posterior, theta, missed_seed)
        predictor = Predictor(posterior, draws, weights, without, contender.name in PLUG_IN_MODELS)
        full, _ = density_of(posterior, theta, weights, self.record)
        n, folds = self.record.n, self.folds
        loo = predictor.leave_out(list(np.eye(n, dtype=bool)), loo_seed, progress=tell)
        blocks = [folds.number == b for b in range(folds.count)]
        left = predictor.leave_out(blocks, fold_seed, -np.inf, curves=CURVE_DRAWS, progress=tell)
        pick = resampled(draws.log_weight, CURVE_DRAWS, np.random.default_rng(curve_seed))
        fitted = predictor.mean_curve(theta[pick], self.record)
        (data,) = self.record.observed.values()
        return FittedContender(
            contender,
            posterior,
            draws,
            loo,
            left,
            np.asarray(logsumexp(draws.log_weight[:, None] + full, axis=0)),
            bridge_evidence(posterior, draws.z, draws.log_weight, np.random.default_rng(bridge_seed)),
            self._curve(posterior, draws),
            agreement(data, fitted, _estimated(posterior, contender)),
        )

    def _curve(self, posterior: Posterior, draws: WeightedDraws) -> dict[str, Floats]:
        """Quantiles of the curve; where conditions were joined, at their mean frequency."""
        inputs = {"temperature": self.grid}
        if FREQUENCY in self.record.inputs:
            inputs[FREQUENCY] = np.full(GRID, self.record.inputs[FREQUENCY].mean())
        curve = posterior.predict(posterior.space.constrain(draws.z), inputs)[self.record.channels[0]]
        values = weighted_quantiles(curve, draws.log_weight, tuple(LEVELS.values()))
        return dict(zip(LEVELS, values, strict=True))


def _estimated(posterior: Posterior, contender: Contender) -> int:
    """Parameters of the curve that were estimated from the data, levels that were read off them included."""
    curve = posterior.space.parameters[: len(posterior.model.parameter_names)]
    return sum(p.fixed is None for p in curve) + (len(LEVELS_READ) if contender.name in PLUG_IN_MODELS else 0)


def _plugged_in(record: Record) -> dict[str, float]:
    (values,) = record.observed.values()
    return dict(zip(LEVELS_READ, (float(values.min()), float(values.max())), strict=True))


def _rank(record: Record) -> int:
    """Rank of Eq. (11) on a record."""
    (values,) = record.observed.values()
    return least_squares(record.temperature, record.inputs.get(FREQUENCY, np.ones(record.n)), values).rank
