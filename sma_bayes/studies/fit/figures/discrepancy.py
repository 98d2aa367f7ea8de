"""Figure of what the curve of a record misses: the smooth discrepancy beside it, in the channel's unit."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import partial
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from sma_bayes.arrays import Floats
from sma_bayes.assess.draws import RecordDraws
from sma_bayes.report.content import Channel, RecordContent
from sma_bayes.report.figures.sheet import (
    COLOURS,
    FAINT,
    INK,
    PRIOR,
    RASTER_ABOVE_POINTS,
    Drawing,
    as_columns,
    axis_label,
    dot_handle,
    empty_sheet,
    heading,
    in_units_of,
    panels,
    take_power,
    temperature_label,
    unconverged_note,
)
from sma_bayes.report.notation import unit_label, write
from sma_bayes.runs.declared_units import ShownUnit

LEVELS: Final = (0.05, 0.25, 0.5, 0.75, 0.95)


def discrepancy_figure(content: RecordContent, draws: RecordDraws) -> Drawing:
    """Data, curve of the model and total curve above; what the curve misses below; a column for each channel.

    Parameters
    ----------
    content : RecordContent
        Of a record with a discrepancy.
    draws : RecordDraws
    """
    channels = [c for c in content.channels if c.channel in draws.weights]
    figure = empty_sheet(1.6 + 4.1 * len(channels), 5.0)
    axes = panels(
        figure, 2, len(channels), left=0.75, right=0.6, bottom=0.85, top=0.5, gap_x=1.25, gap_y=0.42, tall=(1.5, 1)
    )  # fmt: skip
    rows: list[tuple[Any, ...]] = []
    for (above, below), channel in zip(axes.T, channels, strict=True):
        found = _quantiles(draws, channel, content.degrees)
        _draw_curves(above, content, draws, channel, found)
        _draw_discrepancy(below, content, draws, channel, found)
        rows += _rows(draws, channel, found)
    heading(figure, f"{content.key}: what the curve misses", unconverged_note([content]))
    colour = COLOURS[content.branch]
    handles = [
        dot_handle(INK, "measured"),
        Line2D([], [], color=PRIOR, lw=1.0, ls="--", label="curve of the model alone"),
        Line2D([], [], color=colour, lw=1.2, label="total curve, 90 % band"),
        Patch(color=colour, alpha=0.35, lw=0, label="discrepancy, 50 % and 90 %"),
        Patch(color="#cfcfcf", lw=0, label="± 1 sd of the noise"),
    ]
    figure.legend(
        handles=handles, loc="lower center", ncols=min(len(handles), 2 + len(channels)), borderaxespad=0.1
    )
    return Drawing(
        stem=f"discrepancy-{content.key}",
        caption=(
            f"What the curve of {content.key} misses. Above: measurements, the median curve of the model alone and the "
            "total curve, discrepancy included, with its 90 % band. Below: the discrepancy, median with 50 % and 90 % "
            "bands, on the right in per cent of the measured range; grey: one standard deviation of the noise of a "
            "reading, the error of its temperature included; the circle marks where the median is largest. The "
            "discrepancy is kept apart from all that the parameters of the curve can do; it is part of all other bands."
        ),
        alt=f"discrepancy of {', '.join(c.name for c in channels)} of {content.key} against temperature",
        figure=figure,
        data=as_columns(_header(content.temperature_unit), rows),
    )


def _quantiles(draws: RecordDraws, shown: Channel, degrees: ShownUnit) -> Mapping[str, Floats]:
    """Temperatures (m,), and there quantiles (5, m) of total curve and discrepancy, model and noise (m,)."""
    t, channel, scale = draws.grid(), shown.channel, shown.scale
    whole, missed = draws.curves.curve(channel, t), draws.curves.discrepancy(channel, t)
    model = np.median(whole - missed, axis=0)
    return {
        "temperature": degrees.values(t),
        "measured_at": degrees.values(draws.record.temperature),
        "whole": scale * np.quantile(whole, LEVELS, axis=0),
        "missed": scale * np.quantile(missed, LEVELS, axis=0),
        "model": scale * model,
        "noise": scale * _noise(draws, channel, t, np.median(whole, axis=0)),
    }


def _noise(draws: RecordDraws, channel: str, temperature: Floats, curve: Floats) -> Floats:
    """Standard deviation (m,) of the noise of a reading, the error of its temperature included; median parameters."""
    posterior, place = draws.posterior, draws.posterior.layout[0]
    values = np.median(draws.theta[:, place.noise[channel]], axis=0)
    sd, shape = float(values[0]), posterior.noise.shape_of(values)
    low, span = posterior.observed_range(0, channel)
    relative = posterior.noise.relative_scale(shape, (curve - low) / span)
    own = np.broadcast_to(sd * (1.0 if relative is None else relative), temperature.shape)
    at = place.temperature_sd
    error = float(np.hypot(draws.record.temperature_sd, 0.0 if at is None else np.median(draws.theta[:, at])))
    slope = np.median(draws.curves.slope(channel, temperature), axis=0) if error > 0.0 else 0.0
    return np.asarray(np.hypot(own, error * slope))


def _draw_curves(
    ax: Axes, content: RecordContent, draws: RecordDraws, channel: Channel, found: Mapping[str, Floats]
) -> None:
    t, whole, colour = found["temperature"], found["whole"], COLOURS[content.branch]
    y = channel.scale * draws.record.observed[channel.channel]
    ax.fill_between(t, whole[0], whole[4], color=colour, alpha=0.3, lw=0, zorder=2)
    ax.scatter(
        found["measured_at"], y, s=5 if y.size < 200 else 2.5, color=INK, alpha=0.7, linewidths=0, zorder=5,
        rasterized=y.size > RASTER_ABOVE_POINTS,
    )  # fmt: skip
    ax.plot(t, whole[2], color=colour, lw=1.2, zorder=3)
    ax.plot(t, found["model"], color=PRIOR, lw=1.0, ls="--", zorder=4)
    ax.set_ylabel(axis_label(channel, take_power(ax.yaxis)))
    ax.set_title("Measurements and curves")
    ax.tick_params(labelbottom=False)


def _draw_discrepancy(
    ax: Axes, content: RecordContent, draws: RecordDraws, channel: Channel, found: Mapping[str, Floats]
) -> None:
    t, missed, noise, colour = found["temperature"], found["missed"], found["noise"], COLOURS[content.branch]
    ax.fill_between(t, -noise, noise, color="#cfcfcf", alpha=0.8, lw=0, zorder=0)
    ax.axhline(0.0, color=FAINT, lw=0.7, zorder=1)
    ax.fill_between(t, missed[0], missed[4], color=colour, alpha=0.22, lw=0, zorder=2)
    ax.fill_between(t, missed[1], missed[3], color=colour, alpha=0.38, lw=0, zorder=2)
    ax.plot(t, missed[2], color=colour, lw=1.2, zorder=3)
    at = int(np.argmax(np.abs(missed[2])))
    ax.plot(t[at], missed[2, at], marker="o", ms=6, mfc="none", mec=INK, mew=1.0, ls="none", zorder=5)
    ax.margins(y=0.12)
    span = channel.scale * draws.posterior.observed_range(0, channel.channel)[1]
    percent = ax.secondary_yaxis(
        "right", functions=(partial(np.multiply, 100.0 / span), partial(np.multiply, 0.01 * span))
    )
    percent.set_ylabel("% of range")
    power = take_power(ax.yaxis)
    ax.set_ylabel(f"missed [{in_units_of(power, channel.unit)}]")
    ax.set_xlabel(temperature_label(content))
    ax.set_title(
        _largest(missed[2, at], span, float(t[at]), channel, content), fontsize=7.5, fontweight="normal"
    )


def _largest(value: float, span: float, at: float, channel: Channel, content: RecordContent) -> str:
    """Where and how large the discrepancy is at most, in words."""
    size = f"{write([value], digits=2).plain[0]} {unit_label(channel.unit)}".rstrip()
    share = write([100.0 * abs(value) / span], digits=2).plain[0]
    place = f"{write([at], digits=3).plain[0]} {unit_label(content.temperature_unit)}"
    return f"Largest: {size} ({share} % of range) at {place}"


def _header(temperature_unit: str) -> tuple[str, ...]:
    whole = ("total_q05 [unit]", "total_q50 [unit]", "total_q95 [unit]")
    missed = tuple(f"discrepancy_{q} [unit]" for q in ("q05", "q25", "q50", "q75", "q95"))
    return (
        "what", "channel", "unit", f"temperature [{temperature_unit}]", "measured [unit]", "model_q50 [unit]", *whole,
        *missed, "noise_sd [unit]",
    )  # fmt: skip


def _rows(draws: RecordDraws, channel: Channel, found: Mapping[str, Floats]) -> list[tuple[Any, ...]]:
    measured = channel.scale * draws.record.observed[channel.channel]
    empty = (math.nan,) * 10
    rows: list[tuple[Any, ...]] = [
        ("measured", channel.name, channel.unit, t, y, *empty)
        for t, y in zip(found["measured_at"], measured, strict=True)
    ]
    whole = found["whole"][[0, 2, 4]]
    return rows + [
        ("curve", channel.name, channel.unit, t, math.nan, model, *total, *missed, noise)
        for t, model, total, missed, noise in zip(
            found["temperature"], found["model"], whole.T, found["missed"].T, found["noise"], strict=True
        )
    ]
