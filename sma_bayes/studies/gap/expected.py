"""What a gap study is expected to take, so that it can be told before it begins."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from sma_bayes.records.types import Record
from sma_bayes.runs.jobs import by_the_clock, processes
from sma_bayes.studies.gap.close import FOLDS
from sma_bayes.studies.options import FitOptions, models_of

STUDY_S, VALUE_S, CELL_S = 4.0, 2.5e-3, 2.7e-5
"""Processor time of a study: a constant, that of each measured value, and of each value and parameter of the curves
[s]. Chosen on 14 studies of real and simulated campaigns of up to 81 s, nine of which a test holds to a factor of 3.3.
Of two simulated ones of 16 records it is four to five times too much. Draws with effects may add a minute."""
CURVE_S, SAMPLE_S = 1.0, 6e-3
"""Of choosing a curve for all records: of each curve tried on records that share parameters, and of each of their
samples beside it [s]. Two real campaigns, 28 and 81 s, took this within a factor of 1.2."""
HELD_OUT_SHARE: Final = 0.75
"""Share of a study that goes into predicting each third of the measurements without it; thirds are tasks."""


def study_s(values: int, parameters: int) -> float:
    """Processor time of a study in one process [s].

    Parameters
    ----------
    values : int
        Measured ones, of all channels.
    parameters : int
        Of all curves.
    """
    return STUDY_S + (VALUE_S + CELL_S * parameters) * values


def choice_s(curves: int, samples: int) -> float:
    """Processor time of choosing among curves for records that share parameters [s]; none where there is but one."""
    return curves * (CURVE_S + SAMPLE_S * samples) if curves > 1 else 0.0


def expected_s(groups: Sequence[tuple[Record, ...]], options: FitOptions, jobs: int | None) -> float:
    """What a study is expected to take by the clock, within a factor of three or a little more [s].

    Parameters
    ----------
    groups : sequence of tuple of Record
        Records that share parameters of a curve.
    options : FitOptions
    jobs : int, optional
        See `run`.
    """
    values = sum(r.n * len(r.channels) for group in groups for r in group)
    curves = [models_of(group, options) for group in groups]
    parameters = sum(len(tried[0][0].parameter_names) for tried in curves)
    at_once = 1.0 - HELD_OUT_SHARE + HELD_OUT_SHARE / processes(jobs, FOLDS)
    choices = [choice_s(len(c), sum(r.n for r in group)) for c, group in zip(curves, groups, strict=True)]
    return by_the_clock(choices, jobs) + at_once * study_s(values, parameters)
