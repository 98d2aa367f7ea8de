"""How often a right prior is called a conflict: parameters drawn from informative priors, records from them, fitted."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import sma_bayes
from sma_bayes import fit_campaign
from sma_bayes.parameters.priors_file import parse_priors
from sma_bayes.records.types import Campaign, Record
from sma_bayes.studies.sensitivity.schema import CONFLICT

pytestmark = pytest.mark.slow

RECORDS = 40
PRIORS = """
schema = "sma-bayes/priors/1"
model = "modified_sigmoid"
extends = "modified_sigmoid"
title = "as sure as the record"

[both.B3]
family = "normal"
mean = {middle}
sd = 0.5
unit = "degC"
source = "test"

[both.B4]
family = "normal"
mean = 0.5
sd = 0.06
unit = "N"
source = "test"
"""


def _told(record: Record, middle: float, place: Path) -> list[str]:
    """What is said of B3 and B4 of one record."""
    campaign = Campaign("spring", "spring", "0" * 64, (record,))
    priors = parse_priors(PRIORS.format(middle=middle), "priors.toml")
    fit_campaign(campaign, place, noise="independent", priors=priors, jobs=1, figures=False)
    (found,) = sma_bayes.sensitivity(place, jobs=1)["records"]
    return [q["diagnosis"] for q in found["quantities"] if q["name"] in ("B3", "B4")]


def test_a_right_prior_is_seldom_called_a_conflict(
    make_record: Callable[..., Record], tmp_path: Path
) -> None:
    """Of 80 numbers 4.6 % where every prior is as sure as its data: more than 11 in less than 1 of 10^3 files."""
    rng = np.random.default_rng(7)
    told: list[str] = []
    for i in range(RECORDS):
        middle, offset = rng.normal(52.0, 0.5), rng.normal(0.5, 0.06)
        record = make_record(("force",), n=30, noise=0.1, seed=i, B3=middle, B4=offset)
        told += _told(record, 52.0, tmp_path / str(i))
    assert sum(t == CONFLICT for t in told) <= 11


def test_a_wrong_prior_is_called_one(make_record: Callable[..., Record], tmp_path: Path) -> None:
    """The midpoint lies five standard deviations of its prior off."""
    record = make_record(("force",), n=60, noise=0.1, B3=52.0, B4=0.5)
    assert _told(record, 49.5, tmp_path)[0] == CONFLICT
