"""Residuals of a stored fit, divided by their scale and with the memory of the noise taken out."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.fitting.posterior import observed_range
from sma_bayes.noise import NOISE_MODELS, Steps
from sma_bayes.records.types import Branch, Condition, Record
from sma_bayes.report.content import RecordContent
from sma_bayes.response import RESPONSE_MODELS, ResponseModel
from sma_bayes.runs.outputs import StoredRecord

CURVES: Final = 400
"""Draws whose curves are looked at."""


def median_curves(stored: StoredRecord) -> dict[str, Floats]:
    """Median over the posterior of each observed channel at each sample, shape (n,) [unit of the channel]."""
    model = _model(stored)
    flat = np.stack([stored.draws[name].ravel() for name in model.parameter_names], axis=-1)
    every = max(1, len(flat) // CURVES)
    with np.errstate(over="ignore", invalid="ignore"):
        curves = model.predict(flat[::every], stored.inputs)
    for channel, basis in stored.bases().items():
        curves[channel] = curves[channel] + stored.discrepancy[channel][2][::every] @ basis.rows
    return {channel: np.median(values, axis=0) for channel, values in curves.items()}


def standardised_residuals(
    record: RecordContent, stored: StoredRecord, curves: Mapping[str, Floats]
) -> dict[str, Floats]:
    """Residuals from the median curve, made independent and of unit variance as far as the noise model goes.

    Each is divided by ``sqrt(sd**2 + (slope s_T)**2)`` with the posterior medians of `sd` and of the slope of
    the response, and the temperature error ``s_T``; then the noise model takes its memory out. Errors that the
    temperature shares between channels are left in.

    Parameters
    ----------
    record : RecordContent
    stored : StoredRecord
    curves : mapping of str to ndarray, shape (n,)
        As `median_curves` gives them.

    Returns
    -------
    dict of str to ndarray, shape (n,)
        By observed channel [1].
    """
    noise = NOISE_MODELS[stored.noise]
    steps = Steps.of(_as_record(stored))
    estimated = float(np.median(stored.draws["temperature_sd"])) if noise.feels_temperature else 0.0
    spread = float(np.hypot(record.temperature_sd, estimated))
    slope = _median_slope(stored) if spread > 0 else {}
    out = {}
    for channel, curve in curves.items():
        facts = noise.parameters(channel, "1", "s")
        values = np.array([float(np.median(stored.draws[fact.name])) for fact in facts])
        sd, shape = float(values[0]), noise.shape_of(values)
        low, span = observed_range(stored.observed[channel])
        relative = noise.relative_scale(shape, (curve - low) / span)
        scale = sd * (np.ones(1) if relative is None else relative)
        if slope:
            scale = np.hypot(scale, slope[channel] * spread)
        e = (stored.observed[channel] - curve) / scale
        out[channel] = noise.innovations(e, shape, steps)
    return out


def _median_slope(stored: StoredRecord) -> dict[str, Floats]:
    model = _model(stored)
    middle = np.array([np.median(stored.draws[name]) for name in model.parameter_names])
    return model.slope(middle, stored.inputs)


def _model(stored: StoredRecord) -> ResponseModel:
    return RESPONSE_MODELS[stored.model].made_for([_as_record(stored)])


def _as_record(stored: StoredRecord) -> Record:
    """What was measured, for what depends neither on condition and branch nor on units."""
    return Record(
        condition=Condition("stored"),
        branch=Branch.HEATING,
        inputs=stored.inputs,
        observed=stored.observed,
        row=stored.row,
        units={},
    )
