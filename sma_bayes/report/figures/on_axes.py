"""Measurements and bands of one record on axes of the caller's."""

from __future__ import annotations

from matplotlib.axes import Axes

from sma_bayes.assess.bands import Band
from sma_bayes.quantities import unit_text
from sma_bayes.records.types import Record
from sma_bayes.report.figures.sheet import COLOURS

__all__ = ["Axes", "draw_band"]


def draw_band(record: Record, band: Band, ax: Axes | None = None) -> Axes:
    """Draw the 50 % and 90 % credible bands of a curve, and the samples where the channel was measured.

    Parameters
    ----------
    record : Record
    band : Band
    ax : Axes, optional
        The current axes of pyplot by default.
    """
    if ax is None:
        from matplotlib import pyplot

        ax = pyplot.gca()
    colour = COLOURS[record.branch]
    curve = band.curve
    ax.fill_between(band.temperature, curve["q05"], curve["q95"], color=colour, alpha=0.2, linewidth=0.0)
    ax.fill_between(band.temperature, curve["q25"], curve["q75"], color=colour, alpha=0.35, linewidth=0.0)
    ax.plot(band.temperature, curve["q50"], color=colour, label=record.key)
    if band.channel in record.channels:
        ax.plot(
            record.temperature, record.observed[band.channel], ".", color=colour, markersize=3.0, alpha=0.5
        )
    ax.set_xlabel(f"temperature [{unit_text(record.units['temperature'])}]")
    ax.set_ylabel(f"{record.quantity(band.channel)} [{unit_text(band.unit) or '1'}]")
    return ax
