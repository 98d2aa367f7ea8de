"""Claims about the average correlation factor."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np

from sma_bayes.assess.correlation_average import average_draws
from sma_bayes.paper.correlation import implied_average
from sma_bayes.studies.paper.claims.claim import Claim, from_print, from_twin
from sma_bayes.studies.paper.twin_study import TwinStudy

ROUNDED: Final = 0.005
"""Half a unit of the last digit of the claimed correlation factor."""


def correlation_claims(study: TwinStudy) -> Iterator[Claim]:
    """The average is 0.95; it is 0.95 or more."""
    implied = implied_average()
    r = average_draws(list(study.agreements.values()))["r"]["plain"]
    line = straight_line_correlation(study)
    inside = float(np.mean(np.abs(r - implied.claimed) <= ROUNDED))
    told = (
        f"the {implied.columns} printed R² that can be read imply r of {implied.least:.4f} or more each and "
        f"{implied.plain:.4f} on average; the {implied.lost} lost columns would have to average "
        f"{implied.lost_needed:.2f} or less"
    )
    low, middle, high = np.quantile(r, (0.05, 0.5, 0.95))
    twin = f"plain mean of r over {len(study.agreements)} records {middle:.5f} [{low:.5f}, {high:.5f}]"
    yield Claim(
        "correlation-is-0.95",
        f"The average correlation factor is {implied.claimed:g}",
        (3, 500),
        (
            from_print(told, 0.0),
            from_twin(f"{twin}; the twin's noise is the printed RMSE", inside),
            from_twin(f"a straight line in temperature has a plain mean of r of {line:.3f}", None),
        ),
        "The claim contradicts the paper's own R², which are far better. Which average it was is not said; a straight "
        "line would nearly reach it.",
        ("E28",),
    )  # fmt: skip
    yield Claim(
        "correlation-exceeds-0.95",
        f"The average correlation factor is {implied.claimed:g} or more, on the data that were fitted",
        (3, 320, 500),
        (
            from_print(told, 1.0),
            from_twin(twin, float(np.mean(r > implied.claimed))),
        ),
        "True, and weak: the factor is of the data to which the curves were fitted, and a straight line has "
        f"{line:.3f}.",
        ("E28", "E29"),
    )


def straight_line_correlation(study: TwinStudy) -> float:
    """Plain mean over the twin's records of the correlation of stiffness and temperature [1]."""
    found = [abs(np.corrcoef(r.temperature, r.observed["stiffness"])[0, 1]) for r in study.campaign.records]
    return float(np.mean(found))
