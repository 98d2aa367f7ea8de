"""Claims about the shape of the stiffness against temperature."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from typing import Final

import numpy as np

from sma_bayes.assess.bands import curve_draws, temperature_grid
from sma_bayes.fitting.fit import Fit
from sma_bayes.paper.extremes import TABLE_9, TABLE_10, TABLE_11, extremes
from sma_bayes.response.modified_sigmoid import shape_of
from sma_bayes.studies.paper.claims.claim import Claim, from_print, from_twin
from sma_bayes.studies.paper.printed import probability_positive, second_run
from sma_bayes.studies.paper.twin_study import TwinStudy

AUSTENITE: Final = 5.0
"""Least ratio of austenite to martensite stiffness that the conclusions claim."""


def shape_claims(study: TwinStudy) -> Iterator[Claim]:
    """Eq. (7) is an S curve; it rises by more than five."""
    kinds: Counter[str] = Counter()
    for fitted in study.stiffness.values():
        kinds.update(_shapes(fitted))
    rising = sum(_monotone(fitted) for fitted in study.stiffness.values())
    count = len(study.stiffness)
    yield Claim(
        "stiffness-is-an-s-curve",
        "Stiffness against temperature, Eq. (7), is an S curve",
        (85, 150, 433, 449),
        (
            from_print(
                "Eq. (7) is bounded only at A2 = B2, which no printed row has; the others return to zero or grow "
                "without bound",
                0.0,
            ),
            from_twin(
                f"expected among {count} records: {kinds['hump']:.1f} humps, {kinds['unbounded']:.1f} unbounded, "
                f"{kinds['sigmoid']:.1f} sigmoids; over the twin's temperatures the stiffness rises throughout in "
                f"{rising:.1f}",
                kinds["sigmoid"] / count,
            ),
        ),
        "Where it rises it looks like one. It must not be used beyond the measured temperatures.",
        ("E07",),
    )  # fmt: skip
    yield _ratio_claim()


def _shapes(fitted: Fit) -> dict[str, float]:
    names = fitted.posterior.model.parameter_names
    found = shape_of(fitted.flat[:, names.index("A2")], fitted.flat[:, names.index("B2")])
    return {kind: found.count(kind) / len(found) for kind in ("hump", "unbounded", "sigmoid")}


def _monotone(fitted: Fit) -> float:
    """Probability that the stiffness rises over all of the record's temperatures."""
    curve = curve_draws(fitted, "stiffness", temperature_grid(fitted.records[0]))
    return float(np.mean(np.all(np.diff(curve, axis=1) > 0.0, axis=1)))


def _ratio_claim() -> Claim:
    ratios = {n: _ratio(row) for t in (TABLE_9, TABLE_10) for n, row in extremes(t).items()}
    least = min(ratios, key=lambda n: ratios[n])
    duty = [_ratio(row) for row in extremes(TABLE_11).values()]
    scatter = abs(float(np.log(ratios["2A-10mHz-table3"] / _ratio(second_run())))) / float(np.sqrt(2.0))
    return Claim(
        "austenite-5-times-stiffer",
        "The stiffness in austenite is more than 5 to 6 times that in martensite",
        (500,),
        (
            from_print(
                f"Tables 9 and 10 print ratios of {min(ratios.values()):.1f} to {max(ratios.values()):.1f}; "
                f"the least is that of {least}",
                probability_positive(float(np.log(ratios[least] / AUSTENITE)), (1.0,), scatter),
            ),
        ),
        f"Probability that the least ratio exceeds {AUSTENITE:g}, with the scatter of the repeated test. Elsewhere the "
        f"paper says 3 to 4 times (lines 23, 133), and Table 11 prints {min(duty):.0f} to {max(duty):.0f}.",
        ("E44", "E38"),
    )


def _ratio(row: Mapping[str, float]) -> float:
    return row["stiffness_max"] / row["stiffness_min"]
