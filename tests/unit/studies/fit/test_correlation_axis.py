"""The axis of correlation factors, where these are all but one."""

from __future__ import annotations

import warnings

import pytest
from matplotlib.figure import Figure

from sma_bayes.studies.fit.figures.campaign import _correlation_axis


@pytest.mark.parametrize("seen", [[1.0, 1.0], [1.0 - 1e-16, 1.0], [0.999, 1.0], [0.9, 1.0]])
def test_it_has_a_width_whatever_was_found(seen: list[float]) -> None:
    """Of a curve that a formula made all are one to the last digit."""
    ax = Figure().add_subplot()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        _correlation_axis(ax, seen, "force")
        ax.figure.draw_without_rendering()
    low, high = ax.get_xlim()
    assert low < min(seen)
    assert high > 1.0
