"""Figures of a gap study: what stands beside the curves can be read."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from sma_bayes.studies.gap.figures import disagreement
from sma_bayes.studies.gap.outputs import Samples
from sma_bayes.studies.gap.schema import StatedDisagreement


def test_numbers_of_stretches_in_one_place_do_not_touch() -> None:
    """Two stretches of heating of the same temperatures, told apart by their cycles, had one number on the other."""
    ax = Figure(figsize=(4.0, 3.0)).subplots()
    t = np.linspace(20.0, 80.0, 50)
    marked = []
    for i in range(4):
        stated = {
            "condition": "c", "branch": "heating", "channel": "force", "covariate": "cycle", "from": i, "to": i,
            "unit": "1", "size_sigma": 5.0, "mean_residual": 0.1,
        }  # fmt: skip
        measured = 1.0 + 0.01 * t + 0.002 * i
        inside = Samples({"condition": np.full(t.size, "c")}, {"temperature": t, "measured": measured})
        marked.append((str(i), StatedDisagreement.model_validate(stated), inside))
        ax.plot(t, inside["measured"])
    disagreement._number(ax, marked)
    ax.figure.draw_without_rendering()
    boxes = [text.get_bbox_patch().get_window_extent() for text in ax.texts]
    assert len(boxes) == 4
    assert not any(a.overlaps(b) for i, a in enumerate(boxes) for b in boxes[:i])
