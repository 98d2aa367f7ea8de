"""One record by one method: held-out scores, and for the package's own fit what the whole record leaves."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from real_records.baselines import BASELINES
from real_records.ours import Ours, described, without_calibration
from real_records.prediction import Prediction, Predictor
from real_records.records import Mask, Measured, held_out_blocks, held_out_ends, held_out_sweeps
from sma_bayes.assess.held_out import part
from sma_bayes.errors import SmaBayesError

OURS = "ours"
METHODS = (OURS, *BASELINES)
SCHEMES = {"blocks": held_out_blocks, "ends": held_out_ends, "sweeps": held_out_sweeps}
"""What is held out, by name."""


def attempt(measured: Measured, method: str, model: str = "") -> dict[str, Any]:
    """Scores of one method on one record.

    Returns
    -------
    dict
        JSON: ``key``, ``example``, ``record``, ``branch``, ``n``, ``sweeps``, ``method``, ``model_asked``;
        ``held_out``, with `held_out_scores` or None for each of `SCHEMES`; ``held_out_seconds``; for the package's own
        fit the keys of `described`. What the package refuses leaves its message under ``failed``.
    """
    record = measured.record
    about = {
        "key": measured.key, "example": measured.example, "record": record.key, "branch": record.branch.value,
        "n": record.n, "sweeps": measured.sweeps, "method": method, "model_asked": model,
    }  # fmt: skip
    predictor: Predictor = Ours(model) if method == OURS else BASELINES[method]
    try:
        with threadpool_limits(limits=1):
            whole = described(measured, Ours(model)) if method == OURS else {}
            began = time.process_time()
            held_out = {k: held_out_scores(measured, of(record), predictor) for k, of in SCHEMES.items()}
            seconds = time.process_time() - began
    except SmaBayesError as error:
        return about | {"failed": str(error)}
    return about | whole | {"held_out": held_out, "held_out_seconds": seconds}


def held_out_scores(
    measured: Measured, targets: Sequence[Mask], predictor: Predictor
) -> dict[str, float] | None:
    """Coverage and log score over all readings that are held out in turn; None where there is nothing to hold out.

    Returns
    -------
    dict
        ``coverage`` of the 90 % interval; ``log_score``, mean log predictive density of a reading in units of the range
        of the record; ``width`` of the interval, median, over the range.
    """
    if not targets:
        return None
    record = without_calibration(measured.record)
    found = [_scored(measured, part(record, ~t), part(record, t), predictor) for t in targets]
    inside, density, width = (np.concatenate(x) for x in zip(*found, strict=True))
    return {
        "coverage": float(np.mean(inside)),
        "log_score": float(np.mean(density)),
        "width": float(np.median(width)),
    }


def _scored(measured: Measured, train: Any, test: Any, predictor: Predictor) -> tuple[Any, Any, Any]:
    p: Prediction = predictor(train, test)
    y = test.observed[measured.channel]
    inside = (p.low <= y) & (y <= p.high)
    return inside, p.log_density + np.log(measured.size), (p.high - p.low) / measured.size
