"""Measurements and bands of one record on axes of the caller's."""

from __future__ import annotations

from matplotlib.axes import Axes

from sma_bayes.assess.bands import Band
from sma_bayes.quantities import unit_text
from sma_bayes.records.types import Record
from sma_bayes.report.figures.sheet import COLOURS
from sma_bayes.runs.declared_units import Shown, shown_as

__all__ = ["Axes", "draw_band"]


def draw_band(record: Record, band: Band, ax: Axes | None, units: Shown) -> Axes:
    """Draw the 50 % and 90 % credible bands of a curve, and the samples where the channel was measured.

    Parameters
    ----------
    record : Record
    band : Band
    ax : Axes, optional
        The current axes of pyplot by default.
    units : mapping of str to ShownUnit
        In which quantities are drawn; those that are not in it as they are stored.
    """
    if ax is None:
        from matplotlib import pyplot

        ax = pyplot.gca()
    colour, name = COLOURS[record.branch], record.quantity(band.channel)
    warmth, size = shown_as(record.units["temperature"], units), shown_as(band.unit, units, name)
    t, curve = warmth.values(band.temperature), {q: size.values(y) for q, y in band.curve.items()}
    ax.fill_between(t, curve["q05"], curve["q95"], color=colour, alpha=0.2, linewidth=0.0)
    ax.fill_between(t, curve["q25"], curve["q75"], color=colour, alpha=0.35, linewidth=0.0)
    ax.plot(t, curve["q50"], color=colour, label=record.key)
    if band.channel in record.channels:
        at, y = warmth.values(record.temperature), size.values(record.observed[band.channel])
        ax.plot(at, y, ".", color=colour, markersize=3.0, alpha=0.5)
    ax.set_xlabel(f"temperature [{unit_text(warmth.shown)}]")
    ax.set_ylabel(f"{name} [{unit_text(size.shown) or '1'}]")
    return ax
