"""Fit one posterior: warm start, choice of the noise model, ensembles."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from sma_bayes.account import Account
from sma_bayes.arrays import Floats
from sma_bayes.errors import require_seed
from sma_bayes.fitting.fit import Fit, kept
from sma_bayes.fitting.mean_sweep import of_all_sweeps, of_measured_sweeps
from sma_bayes.fitting.model_choice import Prepared, Support, best_supported, prepare, support_of
from sma_bayes.fitting.noise_choice import noise_start, posterior_with
from sma_bayes.fitting.posterior import Posterior
from sma_bayes.fitting.warm_start import WarmStart
from sma_bayes.parameters.priors_file import PriorSet
from sma_bayes.parameters.roles import Role
from sma_bayes.progress import duration
from sma_bayes.records.types import Record
from sma_bayes.response.base import ResponseModel
from sma_bayes.response.modified_sigmoid import ModifiedSigmoid
from sma_bayes.sampling.ensembles import Plan
from sma_bayes.sampling.factors import sample_by_factors
from sma_bayes.threads import one_thread

AUTO = "auto"
"""Name of the choice of the noise model from what the warm start leaves."""
LEAST_ADJUSTED_R2 = 0.5
"""Adjusted R² of the least-squares curve below which it can't be seen for the noise; of noise alone it is some 0.3 with
the fewest samples, because the curve follows them."""
ONE_SD_QUANTILES = np.array([0.1587, 0.8413])
"""Levels of the quantiles a standard deviation from the median of a normal distribution."""
UNDETERMINED_EVALUATIONS, UNSEEN_EVALUATIONS = 30_000, 12_000
"""Evaluations after which nothing else is tried, of a posterior whose curve is not determined, or whose curve can't be
seen or is met exactly, or whose records are doubted: little follows from its draws, and to converge may take millions.
Where the first proposals do it takes some ten thousand, with a discrepancy beside the curve twice that. Of 24 records
of noise alone none converged with six times as much."""
EXACT_NOISE_SHARE = 1e-8
"""Standard deviation of the noise over the range of a channel below which readings were computed, not measured: the
rounding of a converter of 24 bits, the finest of loggers, alone makes 1.7e-8 of its range."""
UNDETERMINED_BLOCK_STEPS = 48
"""Steps of a block of other moves, of both."""


def fit_records(
    records: Sequence[Record],
    priors: PriorSet,
    *,
    model: ResponseModel | None = None,
    ladder: Sequence[tuple[ResponseModel, PriorSet]] = (),
    noise: str = AUTO,
    discrepancy: bool = True,
    seed: int = 0,
    plan: Plan | None = None,
    doubted: bool = False,
    checkpoint: Path | None = None,
    progress: Callable[[str], None] | None = None,
) -> Fit:
    """Sample the posterior of one record, or of several that share the model's parameters.

    Parameters
    ----------
    records : sequence of Record
        Of one branch.
    priors : PriorSet
    model : ResponseModel, optional
        By default the modified sigmoid that predicts the observed channels.
    ladder : sequence of tuple of ResponseModel and PriorSet
        Models to choose from, simplest first, each with its priors; instead of `model` and `priors`.
    noise : str
        Name of a noise model, or ``"auto"``.
    discrepancy : bool
        Whether a smooth function of temperature may stand beside the curve, where it earns its place.
    seed : int
        Decides every draw, together with the keys of the records; neither the other records of a campaign nor
        the number of processes matter.
    plan : Plan, optional
    doubted : bool
        Whether the records can hardly be what they were declared to be: then less is tried where draws don't converge.
    checkpoint : Path, optional
        File for the chains; an interrupted run goes on from it.
    progress : callable, optional
        Told in a few words what is going on.

    Raises
    ------
    MeasurementError, PriorError, UnknownNameError
        If the records or the call can't be used.
    """
    require_seed(seed)
    account = Account()
    with one_thread():
        with account.timed("warm_start"):
            start_seed, sample_seed, mean_seed = _seed(records, seed).spawn(3)
            models = ladder or [(model or ModifiedSigmoid(records[0].channels), priors)]
            prepared = _prepared(
                records, models, noise, start_seed, discrepancy=discrepancy, progress=progress
            )
            best, model_choice = prepared[0], None
            if len(prepared) > 1:
                if progress is not None:
                    progress(f"comparing {len(prepared)} curves by evidence and held-out samples")
                model_choice = best_supported([support_of(prepared)])
                best = next(p for p in prepared if p.posterior.model.name == model_choice.name)
            first, start, choice = best.posterior, best.start, best.noise
        name = choice.name if choice else noise
        with account.timed("sample"):
            posterior = posterior_with(name, first, start, best.priors, choice)
            z = noise_start(posterior, start, choice)
            theta = posterior.space.constrain(z)
            exact = any(exact_channels(posterior, theta, i) for i in range(len(records)))
            plan = with_what_is_worth_it(plan or Plan(), posterior, start, doubted=doubted or exact)
            sampled = of_measured_sweeps(posterior)
            draws = sample_by_factors(
                sampled,
                _starts(z, start),
                posterior.space.prior_sd(),
                sample_seed,
                plan,
                checkpoint=checkpoint and checkpoint.with_stem(f"{checkpoint.stem}-{name}"),
                fingerprint=sampled.fingerprint() if checkpoint else "",
                progress=progress,
            )
            found = of_all_sweeps(kept(draws), sampled, np.random.default_rng(mean_seed))
    return Fit(
        posterior,
        start,
        theta,
        draws,
        choice,
        seed,
        found,
        account,
        chosen=noise == AUTO,
        model_choice=model_choice,
    )


def with_what_is_worth_it(plan: Plan, posterior: Posterior, start: WarmStart, *, doubted: bool) -> Plan:
    """The plan, with less effort where little can follow from the draws."""
    if doubted or not seen(start):
        most = UNSEEN_EVALUATIONS
    elif excluded(posterior, start):
        most = UNDETERMINED_EVALUATIONS
    else:
        return plan
    return replace(
        plan,
        evaluations=min(plan.evaluations, most),
        explore_block=min(plan.explore_block, UNDETERMINED_BLOCK_STEPS),
    )


def seen(start: WarmStart) -> bool:
    """Whether each channel of the least-squares curve can be seen for the noise, in one record at least."""
    return all(any(fit[c].adj_r2 >= LEAST_ADJUSTED_R2 for fit in start.fit) for c in start.fit[0])


def exact_channels(posterior: Posterior, theta: Floats, record: int) -> tuple[str, ...]:
    """Channels of a record without noise: numbers that were computed, not measured (`EXACT_NOISE_SHARE`).

    Parameters
    ----------
    posterior : Posterior
    theta : ndarray, shape (D,)
    record : int
    """
    return tuple(
        channel
        for channel, at in posterior.layout[record].noise.items()
        if theta[at[0]] < EXACT_NOISE_SHARE * posterior.observed_range(record, channel)[1]
    )


def excluded(posterior: Posterior, start: WarmStart) -> bool:
    """Whether least squares stops at an end of the priors, and tells less than they do about where a channel changes.

    Of several stages of a channel it is enough that one is determined.
    """
    if not start.at_bound:
        return False
    model, parameters = posterior.model, posterior.space.parameters
    vague: dict[str, bool] = {}
    for i, fact in enumerate(model.facts):
        if fact.role is Role.MIDPOINT and parameters[i].fixed is None:
            low, high = parameters[i].prior.quantile(ONE_SD_QUANTILES)
            vague[fact.channel] = vague.get(fact.channel, True) and bool(start.sd[i] > 0.5 * (high - low))
    return any(vague.values())


def support_for(
    records: Sequence[Record], ladder: Sequence[tuple[ResponseModel, PriorSet]], *, noise: str, seed: int
) -> Support:
    """What records that share parameters say of each model of a ladder: what `fit_records` would choose by.

    Parameters
    ----------
    records, ladder, noise, seed
        See `fit_records`.
    """
    with one_thread():
        start_seed, _ = _seed(records, seed).spawn(2)
        return support_of(_prepared(records, ladder, noise, start_seed))


def _prepared(
    records: Sequence[Record],
    ladder: Sequence[tuple[ResponseModel, PriorSet]],
    noise: str,
    seed: np.random.SeedSequence,
    *,
    discrepancy: bool = True,
    progress: Callable[[str], None] | None = None,
) -> list[Prepared]:
    """Models with their starts, and with what stands beside them; of several each is told of, with what is to come."""
    only = None if noise == AUTO else noise
    begun, found = time.monotonic(), list[Prepared]()
    for m, p in ladder:
        if progress is not None and len(ladder) > 1:
            done = len(found)
            left = (time.monotonic() - begun) / done * (len(ladder) - done) if done else 0.0
            rest = f", some {duration(left)} for what is left of them" if done else ""
            progress(f"fitting curve {done + 1} of {len(ladder)}, {m.name}, with its noise{rest}")
        found.append(prepare(records, m, p, np.random.default_rng(seed), noise=only, discrepancy=discrepancy))
    return found


def _starts(z: Floats, start: WarmStart) -> list[Floats]:
    """The best start, and the same with the other optima of the least-squares fit in place of the model's part."""
    starts = [z]
    for other in start.optima[1:]:
        again = z.copy()
        again[: other.size] = other
        starts.append(again)
    return starts


def _seed(records: Sequence[Record], seed: int) -> np.random.SeedSequence:
    digest = hashlib.sha256("\n".join(r.key for r in records).encode()).digest()
    words = np.frombuffer(digest[:16], dtype=np.uint32).tolist()
    return np.random.SeedSequence([seed, *words])
