"""Repeats of the calibration: make data of a truth, fit them as a user would, score the fit."""

from __future__ import annotations

import json
import time
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

import sma_bayes
from calibration.scoring import scores
from calibration.simulated_loop import is_installed
from calibration.truths import TRUTHS, seed_of
from sma_bayes.errors import SmaBayesError


@dataclass(frozen=True, slots=True)
class Trial:
    """One repeat.

    Attributes
    ----------
    truth : str
    repeat : int
    model : str
        As `sma_bayes.fit` takes it; empty for its default.
    noise : str
    """

    truth: str
    repeat: int
    model: str = ""
    noise: str = "auto"


def attempt(trial: Trial, data: Path) -> dict[str, Any]:
    """Make, fit and score; what the package refuses is noted with its message.

    Returns
    -------
    dict
        JSON: the trial, `n`, `level`, `branch`, `source`, `seconds` of processor time, and the scores or ``failed``.
    """
    root = seed_of(trial.truth, trial.repeat)
    making, reading = (np.random.default_rng(s) for s in root.spawn(2))
    case = TRUTHS[trial.truth].make(trial.repeat, making, data)
    record = case.record
    about = {
        **asdict(trial),
        "n": record.n,
        "level": case.level,
        "branch": record.branch.value,
        "source": case.campaign.source,
    }
    chosen_model = {"model": trial.model} if trial.model else {}
    began = time.process_time()
    try:
        with threadpool_limits(limits=1):
            (fit,) = sma_bayes.fit(
                case.campaign, seed=trial.repeat, noise=trial.noise, jobs=1, **chosen_model
            ).values()
            seconds = time.process_time() - began
            found = scores(fit, case, reading)
    except SmaBayesError as error:
        return about | {"failed": str(error), "seconds": time.process_time() - began}
    return about | {"seconds": seconds} | found


def missing(truth: str, data: Path) -> str:
    """Why a truth can't be had here; empty where it can."""
    needs = TRUTHS[truth].needs
    if needs == "simcoon" and not is_installed():
        return "simcoon is not installed (extra `simcoon`)"
    if needs == "data" and not data.is_dir():
        return f"no real measurements at {data}"
    return ""


def to_do(trials: Iterable[Trial], out: Path) -> list[Trial]:
    """Trials that a file of JSON lines does not hold yet."""
    done = {_trial(line) for line in read(out)}
    return [t for t in trials if t not in done]


def read(path: Path) -> Iterator[dict[str, Any]]:
    """Lines of a file of results; none where there is no file. A last line that was cut off is left out."""
    if not path.exists():
        return
    for line in path.read_text(encoding="utf-8").splitlines():
        try:
            yield json.loads(line)
        except json.JSONDecodeError:
            continue


def _trial(line: dict[str, Any]) -> Trial:
    return Trial(line["truth"], line["repeat"], line["model"], line["noise"])
