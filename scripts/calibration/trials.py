"""Repeats of the calibration: make data of a truth, fit them as a user would, score the fit."""

from __future__ import annotations

import gzip
import hashlib
import json
import time
from collections import Counter
from collections.abc import Collection, Iterable, Iterator
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

import sma_bayes
from calibration.scoring import scores
from calibration.simulated_loop import is_installed
from calibration.truths import TRUTHS, seed_of
from sma_bayes.errors import SmaBayesError
from sma_bayes.parameters.priors_file import priors_folder

DECIDES = ("response", "noise", "sampling", "fitting", "parameters", "assess")
"""Parts of the package that decide what an interval is."""
DIGITS = 5
"""To which results are kept."""


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
        "code": code_version(),
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
        return about | {"failed": str(error), "seconds": _short(time.process_time() - began)}
    return about | {"seconds": _short(seconds)} | _short(found)


def missing(truth: str, data: Path) -> str:
    """Why a truth can't be had here; empty where it can."""
    needs = TRUTHS[truth].needs
    if needs == "simcoon" and not is_installed():
        return "simcoon is not installed (extra `simcoon`)"
    if needs == "data" and not data.is_dir():
        return f"no real measurements at {data}"
    return ""


@cache
def code_version() -> str:
    """Digest of the sources that decide what an interval is, and of the priors that ship; twelve digits."""
    package = Path(sma_bayes.__file__).parent
    parts = [package / part for part in DECIDES]
    files = [f for part in parts for f in part.rglob("*.py")]
    files += priors_folder().glob("*.toml")
    digest = hashlib.sha256()
    for file in sorted(files):
        digest.update(file.name.encode() + file.read_bytes())
    return digest.hexdigest()[:12]


def collected(
    paths: Iterable[Path], accepted: Collection[str] = ()
) -> tuple[list[dict[str, Any]], Counter[str]]:
    """Results in files, one for each trial, and how many of which other code were left out.

    Parameters
    ----------
    paths : iterable of Path
        As `read` takes them; of a trial that is there several times the first counts, that of the present code before
        all others.
    accepted : collection of str
        Versions of the code that count beside the present one.
    """
    present = code_version()
    found: dict[Trial, dict[str, Any]] = {}
    others: Counter[str] = Counter()
    for line in sorted((x for path in paths for x in read(path)), key=lambda x: _code(x) != present):
        if _code(line) in (present, *accepted):
            found.setdefault(_trial(line), line)
        else:
            others[_code(line)] += 1
    return list(found.values()), others


def to_do(trials: Iterable[Trial], lines: Iterable[dict[str, Any]]) -> list[Trial]:
    """Trials that are not among results yet."""
    done = {_trial(line) for line in lines}
    return [t for t in trials if t not in done]


def read(path: Path) -> Iterator[dict[str, Any]]:
    """Lines of a file of results, which may end in ``.gz``; none where there is no file.

    A last line that was cut off is left out.
    """
    if not path.exists():
        return
    raw = path.read_bytes()
    text = (gzip.decompress(raw) if path.suffix == ".gz" else raw).decode("utf-8")
    for line in text.splitlines():
        try:
            yield json.loads(line)
        except json.JSONDecodeError:
            continue


def keep(lines: Iterable[dict[str, Any]], path: Path) -> None:
    """Write results to a compressed file that a later run takes up; the same results give the same bytes."""
    ordered = sorted(lines, key=lambda x: (x["truth"], x["repeat"], x["model"], x["noise"]))
    text = "".join(json.dumps(line) + "\n" for line in ordered)
    path.write_bytes(gzip.compress(text.encode("utf-8"), mtime=0))


def _code(line: dict[str, Any]) -> str:
    return str(line.get("code", "unknown"))


def _short(value: Any) -> Any:
    """Numbers, in whatever they stand, to `DIGITS` digits."""
    if isinstance(value, dict):
        return {k: _short(v) for k, v in value.items()}
    return float(f"{value:.{DIGITS}g}") if isinstance(value, float) else value


def _trial(line: dict[str, Any]) -> Trial:
    return Trial(line["truth"], line["repeat"], line["model"], line["noise"])
