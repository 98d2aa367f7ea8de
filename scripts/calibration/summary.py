"""Shares covered, with standard errors, from many repeats."""

from __future__ import annotations

import csv
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from scipy.stats import binom

from calibration.truths import TRUTHS
from sma_bayes.assess.transformation import NAMES

NOMINAL: Final = 0.9
WANTED: Final = (0.85, 0.95)
"""Share of nominal 90 % intervals that is wanted to hold the truth."""
LOWER: Final = tuple(lower for lower, _ in NAMES.values())
"""What the lower transformation temperature of either branch is called."""
QUANTITIES: Final = {
    "pointwise": "curve, pointwise",
    "simultaneous": "curve, simultaneous",
    "stiffness": "stiffness K, pointwise",
    "readings": "new readings",
    "readings_cold": "cold third",
    "readings_middle": "middle third",
    "readings_hot": "hot third",
    "start": "As or Mf",
    "finish": "Af or Ms",
    "nearest": "nearest published parameters",
}
"""What is counted, by the name of its column."""


def quantities(line: Mapping[str, Any]) -> dict[str, float | None]:
    """Share covered of each quantity in one repeat, channels and parameters averaged; None where there is none.

    Stiffness that follows from force and displacement is kept apart from the measured channels.
    """
    derived = {"stiffness"} - set(line["readings"])
    curves = [v for c, v in line["curve"].items() if c not in derived]
    stiffness = [v["pointwise"] for c, v in line["curve"].items() if c == "stiffness"]
    readings = line["readings"].values()
    temperatures = line["temperatures"]
    return {
        "pointwise": _average(c["pointwise"] for c in curves),
        "simultaneous": _average(c["simultaneous"] for c in curves),
        "stiffness": _average(stiffness),
        "readings": _average(r["all"] for r in readings),
        "readings_cold": _average(r["cold"] for r in readings),
        "readings_middle": _average(r["middle"] for r in readings),
        "readings_hot": _average(r["hot"] for r in readings),
        "start": _average([t["covered"] for name, t in temperatures.items() if name in LOWER]),
        "finish": _average([t["covered"] for name, t in temperatures.items() if name not in LOWER]),
        "nearest": _average(n["covered"] for n in line["nearest"].values()),
    }


def share(values: Sequence[float]) -> tuple[float, float]:
    """Mean of the shares of repeats and its standard error, from their scatter.

    Where all repeats agree, or there is but one, the scatter says nothing, and the error is that of a binomial at the
    nominal 90 %.
    """
    x = np.asarray(values, dtype=float)
    scatter = float(np.std(x, ddof=1)) if x.size > 1 else 0.0
    if scatter == 0.0:
        scatter = float(np.sqrt(NOMINAL * (1.0 - NOMINAL)))
    return float(x.mean()), scatter / float(np.sqrt(x.size))


def table(lines: Iterable[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """One row a truth, in the order of the registry: repeats, shares and errors, widths, what was chosen.

    Returns
    -------
    list of dict
        Keys: ``truth``, ``repeats``, ``failed``, ``converged``; each of `QUANTITIES` and the same with ``_se``;
        ``width`` of the curve's band and ``reading_width``, medians over the range of the curve; ``noises``,
        ``models``, ``discrepancy``; ``seconds``, the median.
    """
    by_truth: dict[str, list[Mapping[str, Any]]] = {}
    for line in lines:
        by_truth.setdefault(line["truth"], []).append(line)
    return [_row(name, by_truth[name]) for name in TRUTHS if name in by_truth]


def _row(name: str, lines: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    good = [line for line in lines if "failed" not in line]
    row: dict[str, Any] = {"truth": name, "repeats": len(lines), "failed": len(lines) - len(good)}
    row["converged"] = _average(line["converged"] for line in good)
    counted = [quantities(line) for line in good]
    for quantity in QUANTITIES:
        values = [q[quantity] for q in counted if q[quantity] is not None]
        row[quantity], row[f"{quantity}_se"] = share([float(v) for v in values if v is not None]) if values else (
            None, None
        )  # fmt: skip
    row["width"] = _median(v["width"] for q in good for c, v in q["curve"].items() if c in q["readings"])
    row["reading_width"] = _median(v["width"] for q in good for v in q["readings"].values())
    for key, plural in (("noise", "noises"), ("model", "models"), ("discrepancy", "discrepancy")):
        found = Counter(str(line["chosen"][key] or "none") for line in good)
        row[plural] = ", ".join(f"{k} {v}" for k, v in found.most_common())
    row["seconds"] = _median(line["seconds"] for line in lines)
    return row


def write_csv(rows: Sequence[Mapping[str, Any]], path: Path) -> None:
    """Write the table, numbers to four digits."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        for row in rows:
            writer.writerow(
                {k: f"{v:.4g}" if isinstance(v, float) else ("" if v is None else v) for k, v in row.items()}
            )


def read_csv(path: Path) -> list[dict[str, Any]]:
    """The table as it was written; empty cells are None."""
    text = {"truth", "noises", "models", "discrepancy"}
    with path.open(newline="", encoding="utf-8") as file:
        return [
            {k: v if k in text else (float(v) if v else None) for k, v in row.items()}
            for row in csv.DictReader(file)
        ]


def is_reached(row: Mapping[str, Any], quantity: str) -> bool | None:
    """Whether a share lies in the wanted range; None where it was not measured."""
    value = row[quantity]
    return None if value is None else WANTED[0] <= value <= WANTED[1]


def least_expected(repeats: int, false_alarm: float, nominal: float = NOMINAL) -> int:
    """Least count of covered among independent repeats that chance leaves with probability `1 - false_alarm`.

    Examples
    --------
    >>> least_expected(20, 0.01)
    14
    """
    return int(binom.ppf(false_alarm, repeats, nominal))


def _average(values: Iterable[float | bool | None]) -> float | None:
    known = [float(v) for v in values if v is not None]
    return float(np.mean(known)) if known else None


def _median(values: Iterable[float]) -> float | None:
    known = [v for v in values if np.isfinite(v)]
    return float(np.median(known)) if known else None
