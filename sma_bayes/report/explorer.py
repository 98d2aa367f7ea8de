"""A chart that readers can question: curves and their bands as data of the page, drawn by a script that stands in it.

The script is ``templates/explorer.js``. It asks no network and no server; where scripts are off, or on paper, the still
figure is seen instead.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from sma_bayes.arrays import Floats

SIGNIFICANT_DIGITS: Final = 5
"""Significant digits of the numbers in a page: four are shown, and half a pixel is a thousandth of an axis."""
MAX_POINTS: Final = 600
"""Measurements of a curve that a page holds; of more, evenly spaced ones."""


@dataclass(frozen=True, slots=True, eq=False)
class Trace:
    """A curve with its bands, and what was measured of it.

    Attributes
    ----------
    condition, branch, channel : str
    quantity, along : str
        Labels of the axes, with units.
    x : ndarray, shape (m,)
        Where the curve is known.
    quantiles : mapping of str to ndarray, shape (m,)
        ``q50`` and, where there is a band, ``q05``, ``q95``, ``pred_q05``, ``pred_q95``; empty where what
        was measured is all that is told.
    inside : tuple of float
        Ends of what was measured along `x`; beyond them the curve is extrapolated.
    measured : tuple of ndarray, shape (n,), or None
        Places and values.
    """

    condition: str
    branch: str
    channel: str
    quantity: str
    along: str
    x: Floats
    quantiles: Mapping[str, Floats]
    inside: tuple[float, float]
    measured: tuple[Floats, Floats] | None = None


def chart_data(traces: Iterable[Trace]) -> list[dict[str, Any]]:
    """Traces as the script takes them, one of each curve; empty where there are none."""
    found: dict[tuple[str, str, str], dict[str, Any]] = {}
    for t in traces:
        found.setdefault((t.quantity, t.condition, t.branch), _plain(t))
    return list(found.values())


def _plain(trace: Trace) -> dict[str, Any]:
    plain: dict[str, Any] = {
        "condition": trace.condition,
        "branch": trace.branch,
        "quantity": trace.quantity,
        "along": trace.along,
        "x": _numbers(trace.x),
        "inside": [float(v) for v in trace.inside],
    }
    plain["q50"] = [None] * trace.x.size
    plain |= {name: _numbers(q) for name, q in trace.quantiles.items() if np.isfinite(q).any()}
    if trace.measured is not None:
        every = -(-trace.measured[0].size // MAX_POINTS)
        plain["points"] = [_numbers(v[::every]) for v in trace.measured]
        plain["every"] = every
    return plain


def _numbers(values: Floats) -> list[float | None]:
    """Numbers as JSON has them, rounded; None for what is not finite."""
    return [float(f"{v:.{SIGNIFICANT_DIGITS}g}") if np.isfinite(v) else None for v in values]
