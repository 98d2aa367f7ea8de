"""One response model for all records of a study, where it is to be chosen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

from sma_bayes.account import Account
from sma_bayes.fitting.fit_records import support_for
from sma_bayes.fitting.model_choice import ModelChoice, Support, best_supported
from sma_bayes.records.types import Record
from sma_bayes.response import AUTO_MODEL
from sma_bayes.runs.jobs import run
from sma_bayes.studies.options import FitOptions, models_of


def _support(records: tuple[Record, ...], options: FitOptions) -> Support:
    return support_for(records, models_of(records, options), noise=options.noise, seed=options.seed)


def with_shared_model(
    groups: Sequence[tuple[Record, ...]], options: FitOptions, jobs: int | None, account: Account
) -> tuple[FitOptions, ModelChoice | None]:
    """Options that name the model which all records together support best, and why; as they are where one is named.

    Parameters
    ----------
    groups : sequence of tuple of Record
        Records that share parameters.
    options : FitOptions
        Of the model ``auto``, or another.
    jobs : int, optional
        See `run`.
    account : Account
    """
    if options.model != AUTO_MODEL:
        return options, None
    task = partial(_support, options=options)
    support = list(run(task, groups, jobs, account=account, stage="choose_model"))
    choice = best_supported(support)
    priors = next(p for m, p in models_of(groups[0], options) if m.name == choice.name)
    return replace(options, model=choice.name, priors=priors), choice
