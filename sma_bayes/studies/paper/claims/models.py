"""Claims about the baselines."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from sma_bayes.paper.extremes import TABLE_9, TABLE_10, extremes
from sma_bayes.paper.specifications import TEXT_VALUES, specification
from sma_bayes.studies.paper.claims.claim import Claim, from_print, from_twin
from sma_bayes.studies.paper.distance import distances
from sma_bayes.studies.paper.twin_study import TwinStudy


def model_claims(study: TwinStudy) -> Iterator[Claim]:
    """The modified sigmoid is superior to the logistic and to the polynomial; the logistic is abrupt."""
    known = [d for d in distances() if d.rmse is not None]
    near = sum(d.logistic < (d.rmse or 0.0) for d in known)
    far = sum(d.logistic > 2.0 * (d.rmse or 0.0) for d in known)
    least = min(d.line / (d.rmse or np.inf) for d in known)
    yield Claim(
        "beats-logistic",
        "The modified sigmoid is superior to the logistic curve",
        (3, 366, 368, 500),
        (
            from_print(
                "over the range of stiffness that Tables 9 and 10 print, the published curve is nearer to some "
                f"logistic curve than its own printed RMSE in {near} of {len(known)} columns, and more than twice as "
                f"far in {far}",
                None,
            ),
            from_twin(_twin_comparison(study, "logistic"), _twin_probability(study, "logistic")),
        ),
        "The paper plugged calorimetric temperatures and the extremes of the data into the logistic, and fitted six "
        "parameters of its own. In most columns a fitted logistic could hardly be told from Eq. (7) on the stiffness "
        "that was measured. The twin is drawn from Eq. (7), so its preference is circular.",
        ("E11", "E12", "E49"),
    )
    yield Claim(
        "beats-polynomial",
        "The modified sigmoid is superior to the polynomial",
        (3, 377, 500),
        (
            from_print(
                "over the range of stiffness that Tables 9 and 10 print, the published curve is at least "
                f"{least:.1f} times its printed RMSE away from every straight line, which Eq. (11) is at one "
                "frequency; beyond 2 times no residuals could make up for it",
                float(all(d.line > 2.0 * (d.rmse or np.inf) for d in known)),
            ),
            from_twin(_twin_comparison(study, "polynomial"), _twin_probability(study, "polynomial")),
        ),
        "In sample, and if the printed RMSE are right.",
        ("E14", "E49"),
    )  # fmt: skip
    start, end = (specification(TEXT_VALUES, name, "degC") for name in ("As", "Af"))
    steep = 2.0 * np.log(9.0) * (end - start) / 6.2
    sweeps = [
        row["temperature_max"] - row["temperature_min"]
        for t in (TABLE_9, TABLE_10)
        for row in extremes(t).values()
    ]
    yield Claim(
        "logistic-is-abrupt",
        "The logistic model appears as straight lines with abrupt changes",
        (368,),
        (
            from_print(
                f"with the printed As and Af, Eq. (9) climbs from 10 to 90 % within {steep:.1f} K, of sweeps of "
                f"{min(sweeps):.0f} to {max(sweeps):.0f} K; as printed its centre is at {(start - end) / 2:.1f} °C, "
                "so that it is flat over the whole sweep",
                1.0,
            ),
        ),
        "True of the constants that were plugged in, not of the logistic curve.",
        ("E11", "E12"),
    )


def _twin_comparison(study: TwinStudy, family: str) -> str:
    records = study.comparison.found.records
    wins = sum(r.verdict == "modified_sigmoid" for r in records)
    loses = sum(r.verdict == family for r in records)
    (overall,) = study.comparison.found.overall
    factor = overall.lead("modified_sigmoid", family)
    return (
        f"the modified sigmoid wins decisively on {wins} of {len(records)} records and the {family} on {loses}; all "
        f"records together the ln Bayes factor over the best {family} is {factor:.0f}"
    )


def _twin_probability(study: TwinStudy, family: str) -> float:
    (overall,) = study.comparison.found.overall
    behind = -overall.lead("modified_sigmoid", family)
    return float(1.0 / (1.0 + np.exp(np.clip(behind, -700.0, 700.0))))
