"""Figures of a study of moduli: both moduli and tan delta against temperature, and the shift with frequency."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import FuncFormatter, NullFormatter

from sma_bayes.quantities import convert
from sma_bayes.report.figures.sheet import (
    COLOURS,
    INK,
    Drawing,
    as_columns,
    branch_legend,
    dot_handle,
    empty_sheet,
    heading,
    numbered,
    ordered_colours,
    panels,
)
from sma_bayes.report.notation import unit_label
from sma_bayes.runs.declared_units import ShownUnit
from sma_bayes.studies.modulus.schema import FrequencyShift, StoredModulus
from sma_bayes.studies.modulus.shift import LEVELS, SCATTER_K, ZERO_CELSIUS, fit_line
from sma_bayes.studies.modulus.shown import degrees_of
from sma_bayes.studies.modulus.tables import modulus_unit

SYMBOLS: Final = {"storage_modulus": "E′", "loss_modulus": "E″", "tan_delta": "tan δ"}
CURVES: Final = 200
"""Places at which a line is drawn."""


def moduli_figure(stored: StoredModulus, number: int) -> Drawing:
    """Storage modulus, loss modulus and tan delta of a test against temperature, a colour for each frequency.

    Of one branch they stand side by side, of two below each other.

    Parameters
    ----------
    stored : StoredModulus
    number : int
        Test, from 1.
    """
    found = stored.found
    test = list(dict.fromkeys(s.test for s in found.sweeps))[number - 1]
    own = [s for s in found.sweeps if s.test == test]
    branches = list(dict.fromkeys(s.branch for s in own))
    channels = [c for c in SYMBOLS if any(v.channel == c for s in own for v in s.values)]
    frequencies = sorted({s.frequency for s in own if s.frequency is not None})
    beside = len(branches) == 1
    down, across = (1, len(channels)) if beside else (len(channels), len(branches))
    legend = 0.18 * -(-len(frequencies) // (4 * across))
    width, height = (2.5, 2.2) if beside and across > 1 else (3.1, 1.9)
    figure = empty_sheet(0.95 + width * across, 1.15 + legend + height * down)
    grid = panels(
        figure, down, across, left=0.7, bottom=0.5, top=0.75 + legend, gap_x=0.75, gap_y=0.5,
    )  # fmt: skip
    axes = [[ax] for ax in grid[0]] if beside else grid
    colours = dict(zip(frequencies, ordered_colours(len(frequencies)), strict=True))
    unit = modulus_unit(found)
    per = float(convert(1.0, "Pa", unit))
    degrees = degrees_of(found)
    rows: list[tuple[Any, ...]] = []
    for s in own:
        colour = INK if s.frequency is None else colours[s.frequency]
        bands, samples = (stored.columns(f"{place}/{s.id}.csv") for place in ("bands", "samples"))
        for row, channel in enumerate(channels):
            if f"{channel}_q50" not in bands:
                continue
            ax = axes[row][branches.index(s.branch)]
            factor = 1.0 if channel == "tan_delta" else per
            _draw(ax, bands, samples, channel, factor, degrees, colour)
            quantiles = (factor * bands[f"{channel}_{q}"] for q in ("q05", "q50", "q95"))
            cells = zip(degrees.values(bands["temperature_degC"]), *quantiles, strict=True)
            rows += [(s.id, channel, *values) for values in cells]
    for row, channel in enumerate(channels):
        for column, branch in enumerate(branches):
            ax = axes[row][column]
            ax.set_ylabel(
                SYMBOLS[channel] if channel == "tan_delta" else f"{SYMBOLS[channel]} [{unit_label(unit)}]"
            )
            if row == 0:
                ax.set_title(branch, color=COLOURS[branch])
            ax.set_xlabel(f"temperature [{unit_label(degrees.shown)}]")
    heading(figure, f"{test}: moduli by temperature", "")
    if frequencies:
        figure.legend(
            handles=[dot_handle(colours[f], f"{f:g} Hz") for f in frequencies], loc="upper left", borderaxespad=0.0,
            ncols=min(len(frequencies), 4 * across), bbox_to_anchor=(0.0, 1.0 - 0.32 / figure.get_figheight()),
        )  # fmt: skip
    caption = (
        f"Storage modulus, loss modulus and their quotient of {test}: samples that were fitted, median and pointwise "
        "90 % band of the curve. tan δ follows from both curves."
        if len(channels) > 1
        else f"Storage modulus of {test}: samples that were fitted, median and pointwise 90 % band of the curve."
    )
    data = as_columns(("sweep", "channel", "temperature", "q05", "q50", "q95"), rows)
    return Drawing(numbered("moduli", number), caption, caption, figure, data)


def _draw(
    ax: Axes, bands: Any, samples: Any, channel: str, factor: float, degrees: ShownUnit, colour: Any
) -> None:
    name = f"{channel}_Pa"
    if name in samples:
        seen = np.isfinite(samples[name])
        ax.plot(
            degrees.values(samples[f"{channel}_temperature_degC"][seen]), factor * samples[name][seen], "o",
            ms=1.8, color=colour, alpha=0.45, mew=0, rasterized=True,
        )  # fmt: skip
    t = degrees.values(bands["temperature_degC"])
    ax.fill_between(
        t, factor * bands[f"{channel}_q05"], factor * bands[f"{channel}_q95"], color=colour, alpha=0.3, lw=0
    )
    ax.plot(t, factor * bands[f"{channel}_q50"], color=colour, lw=0.9)


def shift_figure(stored: StoredModulus) -> Drawing:
    """Temperatures against frequency with their lines: an Arrhenius plot, frequency up, 1/T to the right."""
    shifts = [s for s in stored.found.shifts if s.shift is not None]
    names = list(dict.fromkeys(s.temperature for s in shifts))
    figure = empty_sheet(0.85 + 2.4 * len(names), 3.2)
    axes = panels(figure, 1, len(names), left=0.7, bottom=0.5, top=0.75, gap_x=0.75, gap_y=0.5)
    for s in shifts:
        _draw_shift(axes[0][names.index(s.temperature)], s, degrees_of(stored.found))
    for ax, name in zip(axes[0], names, strict=True):
        ax.set_xscale("log")
        ax.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        ax.xaxis.set_minor_formatter(NullFormatter())
        ax.set_title(name.replace("_", " "), fontsize=7.5)
        ax.set(xlabel="frequency [Hz]", ylabel=f"temperature [{unit_label(degrees_of(stored.found).shown)}]")
    heading(figure, "Shift with frequency", "")
    branch_legend(figure, (s.branch for s in shifts))
    caption = (
        "Temperatures of the transition against frequency: mean and 90 % interval of each sweep, and the straight line "
        "of 1/T over ln f with its 90 % band, scatter between sweeps included. A level line has no activation energy."
    )
    data = as_columns(
        ("branch", "temperature", "sweep", "frequency", "value", "sd"),
        [
            (s.branch, s.temperature, p.sweep, p.frequency, p.temperature, p.sd)
            for s in shifts
            for p in s.points
        ],
    )
    return Drawing("shift", caption, caption, figure, data)


def _draw_shift(ax: Axes, s: FrequencyShift, degrees: ShownUnit) -> None:
    colour = COLOURS[s.branch]
    f, t, sd = (np.array([getattr(p, k) for p in s.points]) for k in ("frequency", "temperature", "sd"))
    kelvin = (t - degrees.zero) / degrees.factor + ZERO_CELSIUS
    line = fit_line(
        np.log(f), 1.0 / kelvin, sd / degrees.factor / kelvin**2, SCATTER_K / float(np.mean(kelvin)) ** 2
    )
    at = np.geomspace(f.min(), f.max(), CURVES)
    low, middle, high = (
        degrees.values(1.0 / np.array(v) - ZERO_CELSIUS)
        for v in zip(*(line.at(float(np.log(x)), LEVELS) for x in at), strict=True)
    )
    ax.fill_between(at, low, high, color=colour, alpha=0.2, lw=0)
    ax.plot(at, middle, color=colour, lw=0.9)
    ax.errorbar(f, t, yerr=1.645 * sd, fmt="o", ms=2.6, lw=0.7, color=colour, mfc="white", mew=0.7)
