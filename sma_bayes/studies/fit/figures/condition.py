"""Figures of a condition: its loop, and one channel of all conditions side by side."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from sma_bayes.report.content import (
    Channel,
)
from sma_bayes.report.explorer import Trace
from sma_bayes.report.figures.sheet import (
    COLOURS,
    FAINT,
    INK,
    RASTER_ABOVE_POINTS,
    WARNING,
    BranchData,
    Drawing,
    as_columns,
    axis_label,
    dot_handle,
    empty_sheet,
    heading,
    in_units_of,
    numbered,
    panels,
    remark,
    take_power,
    temperature_label,
    unconverged_note,
    wrapped,
)

LOGARITHMIC_RATIO: Final = 300.0
"""Ratio of greatest to least value from which a positive curve is drawn on a logarithmic axis, and said so."""
MAX_LOGARITHMIC_RATIO: Final = 1e9
"""Ratio of greatest to least value that a logarithmic axis shows at most."""
LABEL_MARGIN: Final = 0.09
"""Share of the axis that is added beyond the curves where names of temperatures stand."""
LEAST_LABEL_DISTANCE: Final = 0.12
"""Share of the axis below which the names of two temperatures stand apart from each other."""


def loop_figure(condition: str, branches: Sequence[BranchData], like: str = "") -> Drawing:
    """Heating and cooling of a condition, a panel for each channel.

    Parameters
    ----------
    condition : str
    branches : sequence of BranchData
    like : str
        Condition whose loop stands before it on the page, with a caption that explains both.
    """
    channels = channels_of(branches)
    width = 3.15 * max(len(channels), 1.8)
    figure = empty_sheet(width, 4.9)
    note = unconverged_note([b.content for b in branches])
    axes = panels(figure, 2, len(channels), left=0.7, right=0.1, bottom=0.85, top=0.55, gap_x=0.75, gap_y=0.22,
                 tall=(2.6, 1.0))  # fmt: skip
    for upper, lower, channel in zip(*axes, channels, strict=True):
        for branch in branches:
            if branch.content.channel(channel.channel) is not None:
                branch_on_axes(upper, branch, channel.channel)
                _about_median(lower, branch, channel.channel)
        _frame(upper, channel, branches)
        for branch in branches:
            _transformation(upper, branch, channel.channel)
        upper.set_xticklabels([])
        lower.set_xlim(upper.get_xlim())
        lower.set_xlabel(temperature_label(branches[0].content))
        lower.set_ylabel(f"less median [{in_units_of(take_power(lower.yaxis), channel.unit)}]", fontsize=6.5)
    heading(figure, condition, note)
    figure.legend(
        handles=loop_legend(branches, channels),
        loc="lower center",
        ncols=4 if width < 9 else 8,
        borderaxespad=0.2,
        columnspacing=1.2,
        handlelength=1.6,
    )
    names = ", ".join(c.name for c in channels)
    what = " and ".join(b.content.branch for b in branches)
    explained = f"Lines, bands and bars as for {like}." if like else _loop_caption(branches, channels)
    return Drawing(
        stem=f"loop-{condition}",
        caption=f"{condition}: {names} against temperature, {what}. {explained}"
        + (f" {note}." if note else ""),
        alt=f"{names} against temperature for condition {condition}, {what}, with credible bands",
        figure=figure,
        data=loop_data(branches),
        traces=traces_of({condition: branches}, channels),
    )


def _loop_caption(branches: Sequence[BranchData], channels: Sequence[Channel]) -> str:
    """What the marks of a loop are."""
    return (
        "Points: measurements. Line: posterior median of the curve. Inner and outer band: pointwise equal-tailed 50 % "
        "and 90 % credible intervals of the curve. Dotted lines: 90 % predictive interval of a new measurement. Below: "
        "the same with the median taken off."
        + (f" {channels[-1].name.capitalize()} is derived from the others." if _derived(channels) else "")
        + (
            " Bars at the edge: median and 90 % credible interval of the transformation temperatures by the tangent "
            "rule, in brackets where the measurements do not support them."
            if any(b.content.document.transformation for b in branches if b.content.converged)
            else ""
        )
        + (
            " Bands carry the uncertainty of the calibration, which moves a curve as a whole."
            if any(b.content.calibration for b in branches)
            else ""
        )
    )


def overview_figure(channel: str, conditions: Mapping[str, Sequence[BranchData]], number: int = 1) -> Drawing:
    """One channel of all conditions, a small panel each.

    Parameters
    ----------
    channel : str
    conditions : mapping of str to sequence of BranchData
        With the same units in all records, see `Content.by_units`.
    number : int
        Which of the parts it is, for the name of the file.
    """
    found = next(
        c for b in conditions.values() for d in b for c in [d.content.channel(channel)] if c is not None
    )
    columns = min(len(conditions), min((3, 4, 2), key=lambda c: -len(conditions) % c))
    rows = math.ceil(len(conditions) / columns)
    wide = 4.2 if len(conditions) == 1 else 2.55
    tall = 3.0 if len(conditions) == 1 else 1.95
    bottom = 0.8 if columns > 1 else 0.95
    figure = empty_sheet(0.75 + wide * columns, bottom + 0.35 + tall * rows)
    axes = panels(
        figure, rows, columns, left=0.65, right=0.1, bottom=bottom, top=0.35, gap_x=0.58, gap_y=0.55
    )
    for ax, (condition, branches) in zip(axes.flat, conditions.items(), strict=False):
        for branch in branches:
            if branch.content.channel(channel) is not None:
                branch_on_axes(ax, branch, channel, small=True)
        shown = limits(ax, channel, branches, ("q05", "q95"))
        power = take_power(ax.yaxis)
        name = wrapped(condition, 30, 2)
        ax.set_title(f"{name}  [{in_units_of(power, found.unit)}]" if power else name, fontsize=7.5)
        if any(not b.content.converged for b in branches):
            remark(ax, "not converged", WARNING)
        elif shown:
            remark(ax, shown, FAINT)
    for ax in list(axes.flat)[len(conditions) :]:
        ax.remove()
    some = next(iter(conditions.values()))[0].content
    middle = (0.65 + (0.75 + wide * columns - 0.1)) / 2 / (0.75 + wide * columns)
    figure.text(
        middle, (bottom - 0.38) / figure.get_figheight(), temperature_label(some), ha="center", fontsize=8.5
    )
    height = figure.get_figheight()
    figure.text(
        0.1 / figure.get_figwidth(), (bottom + (height - 0.35)) / 2 / height, axis_label(found), rotation=90,
        va="center", fontsize=8.5,
    )  # fmt: skip
    figure.legend(
        handles=_short_legend(), loc="lower center", ncols=5 if columns > 1 else 3, borderaxespad=0.15
    )
    return Drawing(
        stem=numbered(f"overview-{found.channel}", number),
        caption=(
            f"{found.name.capitalize()} against temperature, condition by condition. Line: posterior median of the "
            "curve; inner and outer band: pointwise equal-tailed 50 % and 90 % credible intervals; points: "
            "measurements."
            + (" Each panel has its own axes." if len(conditions) > 1 else "")
            + (
                " Dashed: did not converge, so without a band."
                if any(not b.content.converged for d in conditions.values() for b in d)
                else ""
            )
        ),
        alt=f"{found.name} against temperature, a panel for each of {len(conditions)} conditions, with credible bands",
        figure=figure,
        data=_overview_data(channel, conditions),
        traces=traces_of(conditions, [found]),
    )


def branch_on_axes(ax: Axes, branch: BranchData, channel: str, *, small: bool = False) -> None:
    """Draw one branch of one channel."""
    colour = COLOURS[branch.content.branch]
    band = branch.bands[channel]
    q, t = band.quantiles, band.temperature
    if channel in branch.stored.observed:
        points_on_axes(ax, branch, channel, 4.0 if small else 9.0)
    if small and not branch.content.converged:
        ax.plot(t, q["q50"], color=WARNING, lw=0.8, ls="--", zorder=3.2)
        return
    if not small and np.all(np.isfinite(q["pred_q05"])):
        for name in ("pred_q05", "pred_q95"):
            ax.plot(t, q[name], color=colour, lw=0.6, ls=":", zorder=2.5)
    ax.fill_between(t, q["q05"], q["q95"], color=colour, alpha=0.25, lw=0, zorder=3)
    ax.fill_between(t, q["q25"], q["q75"], color=colour, alpha=0.45, lw=0, zorder=3.1)
    ax.plot(t, q["q50"], color=colour, lw=0.9 if small else 1.1, zorder=3.2)
    if band.extrapolated.any():
        low, high = t[~band.extrapolated][[0, -1]]
        for edge in (low, high):
            ax.axvline(edge, color=colour, lw=0.6, ls=(0, (1, 2)), zorder=1)


def _transformation(ax: Axes, branch: BranchData, channel: str) -> None:
    """Mark start and finish of the transformation at the edge of the panel: heating below, cooling above."""
    if not branch.content.converged:
        return
    colour = COLOURS[branch.content.branch]
    place, text, align = (
        (0.012, 0.04, "bottom") if branch.content.branch == "heating" else (0.988, 0.96, "top")
    )
    low, high = ax.get_xlim()
    edge = ax.get_xaxis_transform()
    shown = [
        (stage, t)
        for stage, t in branch.content.document.transformation.items()
        if t.channel == channel and t.median is not None and low <= t.median <= high
    ]
    if shown and ax.get_yscale() == "linear":  # room for the names, which would stand on the plateau
        bottom, top = ax.get_ylim()
        room = LABEL_MARGIN * (top - bottom)
        ax.set_ylim(*((bottom - room, top) if branch.content.branch == "heating" else (bottom, top + room)))
    medians = [t.median for _, t in shown if t.median is not None]
    crowded = len(medians) > 1 and max(medians) - min(medians) < LEAST_LABEL_DISTANCE * (high - low)
    for stage, t in shown:
        if t.median is None or t.q05 is None or t.q95 is None:
            continue
        side = "center" if not crowded else "right" if t.median == min(medians) else "left"
        ax.plot([t.q05, t.q95], [place, place], color=colour, lw=2.5, alpha=0.45, transform=edge, zorder=4,
                solid_capstyle="butt")  # fmt: skip
        ax.plot([t.median], [place], color=colour, marker="|", ms=6, mew=1.1, transform=edge, zorder=4.1)
        label = stage if t.within_data else f"({stage})"
        ax.text(
            t.median,
            text,
            label,
            color=colour,
            fontsize=6.5,
            ha=side,
            va=align,
            transform=edge,
            zorder=4.1,
        )
    ax.set_xlim(low, high)


def _about_median(ax: Axes, branch: BranchData, channel: str) -> None:
    """Draw one branch of one channel with its median curve taken off."""
    colour = COLOURS[branch.content.branch]
    band = branch.bands[channel]
    q = {name: values - band.quantiles["q50"] for name, values in band.quantiles.items()}
    inside = ~band.extrapolated
    ends = (q[name][inside] for name in ("q05", "q95", "pred_q05", "pred_q95"))
    reach = [float(np.max(np.abs(v[np.isfinite(v)]), initial=0.0)) for v in ends]
    if channel in branch.curve:
        stored = branch.stored
        e = stored.observed[channel] - branch.curve[channel]
        ax.scatter(
            stored.inputs["temperature"], e, s=3, color=colour, alpha=0.4, linewidths=0, zorder=2,
            rasterized=e.size > RASTER_ABOVE_POINTS,
        )  # fmt: skip
        reach.append(float(np.quantile(np.abs(e), 0.98)))
    if np.all(np.isfinite(q["pred_q05"])):
        for name in ("pred_q05", "pred_q95"):
            ax.plot(band.temperature, q[name], color=colour, lw=0.6, ls=":", zorder=2.5)
    ax.fill_between(band.temperature, q["q05"], q["q95"], color=colour, alpha=0.3, lw=0, zorder=3)
    ax.fill_between(band.temperature, q["q25"], q["q75"], color=colour, alpha=0.5, lw=0, zorder=3.1)
    limit = max(1.15 * max(reach), max(abs(v) for v in ax.get_ylim()) if ax.lines else 0.0)
    ax.set_ylim(-(limit or 1.0), limit or 1.0)
    ax.axhline(0.0, color=INK, lw=0.4, zorder=1)


def points_on_axes(ax: Axes, branch: BranchData, channel: str, size: float = 9.0) -> None:
    """Draw measurements, later cycles darker."""
    stored, colour = branch.stored, np.array(to_rgb(COLOURS[branch.content.branch]))
    cycle = stored.inputs.get("cycle", np.zeros(stored.row.size))
    number = np.unique(cycle, return_inverse=True)[1]
    share = 1.0 - number / number.max() if number.max() else np.full(number.size, 0.35)
    faces = colour + (1.0 - colour) * 0.7 * share[:, None]
    ax.scatter(
        stored.inputs["temperature"],
        stored.observed[channel],
        s=size if number.size < 200 else 0.6 * size,
        c=faces,
        linewidths=0,
        alpha=0.8,
        zorder=2,
        rasterized=number.size > RASTER_ABOVE_POINTS,
    )


def _frame(ax: Axes, channel: Channel, branches: Sequence[BranchData]) -> None:
    ax.set_title(channel.name.capitalize() + ("" if channel.observed else " (derived)"))
    shown = limits(ax, channel.channel, branches, ("q05", "q95", "pred_q05", "pred_q95"))
    log = ", log axis" if ax.get_yscale() == "log" else ""
    ax.set_ylabel(axis_label(channel, take_power(ax.yaxis)) + log)
    notes = [shown] if shown else []
    if any(b.bands[channel.channel].extrapolated.any() for b in branches if channel.channel in b.bands):
        notes.append("beyond the dotted verticals: extrapolated")
    if notes:
        remark(ax, "\n".join(notes), FAINT)


def limits(ax: Axes, channel: str, branches: Sequence[BranchData], shown: Sequence[str]) -> str:
    """Set the vertical limits by data and median, let bands have twice that, and say what was done.

    Where there are data the curve of a branch that did not converge, which may be anywhere, has no say.
    """
    base = [b.stored.observed[channel] for b in branches if channel in b.stored.observed]
    converged = [b for b in branches if b.content.converged]
    bands = [b.bands[channel].quantiles for b in converged if channel in b.bands]
    if not (base or bands):
        bands = [b.bands[channel].quantiles for b in branches if channel in b.bands]
    middle, curves, wide = (
        values[np.isfinite(values)]
        for values in map(
            np.concatenate,
            (
                base + [q["q50"] for q in bands],
                [q["q50"] for q in bands] or base,
                [q[name] for q in bands for name in shown] or base,
            ),
        )
    )
    low, high = float(middle.min()), float(middle.max())
    if wide.min() > 0 and low > 0 and curves.max() / curves.min() > LOGARITHMIC_RATIO:
        top = min(float(wide.max()), low * MAX_LOGARITHMIC_RATIO)
        ax.set_yscale("log")
        ax.set_ylim(0.7 * max(float(wide.min()), low / MAX_LOGARITHMIC_RATIO), 1.4 * top)
        return "logarithmic axis" + ("; the band goes beyond it" if wide.max() > top else "")
    span = (high - low) or max(abs(high), 1e-12)
    lowest, highest = low - span, high + span
    bottom, top = max(lowest, min(low, float(wide.min()))), min(highest, max(high, float(wide.max())))
    margin = 0.05 * (top - bottom)
    ax.set_ylim(bottom - margin, top + margin)
    return "the band goes beyond the axis" if wide.min() < lowest or wide.max() > highest else ""


def loop_legend(branches: Sequence[BranchData], channels: Sequence[Channel]) -> list[Any]:
    """Entries of the legend of a loop."""
    handles: list[Any] = []
    for b in branches:
        colour = COLOURS[b.content.branch]
        told = "median" if b.content.converged else "not converged"
        handles.append(Line2D([], [], color=colour, lw=1.2, label=f"{b.content.branch}, {told}"))
    handles += [
        Patch(color=FAINT, alpha=0.85, lw=0, label="50 % credible"),
        Patch(color=FAINT, alpha=0.4, lw=0, label="90 % credible"),
    ]
    if any(c.observed for c in channels):
        handles.append(Line2D([], [], color=INK, lw=0.8, ls=":", label="90 % predictive"))
        cycles = np.concatenate([b.stored.inputs.get("cycle", np.zeros(1)) for b in branches])
        first, last = int(cycles.min()), int(cycles.max())
        if first == last:
            handles.append(dot_handle("#555555", "measured"))
        else:
            handles += [
                dot_handle("#c4c4c4", f"measured, cycle {first}"),
                dot_handle("#555555", f"to cycle {last}"),
            ]
    return handles


def _short_legend() -> list[Any]:
    return [
        *(Line2D([], [], color=c, lw=1.2, label=f"{name}, median") for name, c in COLOURS.items()),
        Patch(color=FAINT, alpha=0.85, lw=0, label="50 % credible"),
        Patch(color=FAINT, alpha=0.4, lw=0, label="90 % credible"),
        dot_handle("#777777", "measured"),
    ]


def loop_data(branches: Sequence[BranchData]) -> dict[str, Any]:
    """Measurements, bands and transformation temperatures of a loop, as columns."""
    rows: list[tuple[Any, ...]] = []
    names = ("q05", "q25", "q50", "q75", "q95", "pred_q05", "pred_q95")
    blank = (math.nan,) * len(names)
    for b in branches:
        stored = b.stored
        cycle = stored.inputs.get("cycle", np.ones(stored.row.size))
        for channel in b.content.channels:
            head = (b.content.branch, channel.name, channel.unit)
            if channel.observed:
                values = stored.observed[channel.channel]
                rows += [
                    ("measured", *head, *cells, *blank)
                    for cells in zip(
                        stored.row.tolist(), cycle.tolist(), stored.inputs["temperature"], values, strict=True
                    )
                ]
            band = b.bands[channel.channel]
            quantiles = zip(*(band.quantiles[n] for n in names), strict=True)
            rows += [
                ("band", *head, "", "", t, math.nan, *q)
                for t, q in zip(band.temperature, quantiles, strict=True)
            ]
            rows += [
                (f"{stage} {end}", *head, "", "", getattr(t, end), math.nan, *blank)
                for stage, t in b.content.document.transformation.items()
                if t.channel == channel.channel and b.content.converged
                for end in ("q05", "median", "q95")
                if getattr(t, end) is not None
            ]
    unit = branches[0].content.temperature_unit
    header = ("what", "branch", "channel", "unit", "row", "cycle", f"temperature [{unit}]", "measured [unit]")
    return as_columns((*header, *(f"{n} [unit]" for n in names)), rows)


def _overview_data(channel: str, conditions: Mapping[str, Sequence[BranchData]]) -> dict[str, Any]:
    names = ("q05", "q25", "q50", "q75", "q95")
    rows: list[tuple[Any, ...]] = []
    unit = temperature = ""
    for condition, branches in conditions.items():
        for b in branches:
            found = b.content.channel(channel)
            if found is None:
                continue
            unit, temperature = found.unit, b.content.temperature_unit
            band = b.bands[channel]
            cells = zip(band.temperature, *(band.quantiles[n] for n in names), strict=True)
            rows += [(condition, b.content.branch, "band", *c, math.nan) for c in cells]
            if found.observed:
                rows += [
                    (condition, b.content.branch, "measured", t, *(math.nan,) * len(names), y)
                    for t, y in zip(b.stored.inputs["temperature"], b.stored.observed[channel], strict=True)
                ]
    header = ("condition", "branch", "what", f"temperature [{temperature}]")
    return as_columns((*header, *(f"{n} [{unit}]" for n in names), f"measured [{unit}]"), rows)


def traces_of(
    conditions: Mapping[str, Sequence[BranchData]], channels: Sequence[Channel]
) -> tuple[Trace, ...]:
    """Curves, bands and measurements of these channels; a branch that did not converge has measurements alone.

    Parameters
    ----------
    conditions : mapping of str to sequence of BranchData
        With the same units in all records.
    channels : sequence of Channel
    """
    return tuple(
        _trace(condition, b, channel)
        for channel in channels
        for condition, branches in conditions.items()
        for b in branches
        if channel.channel in b.bands and (b.content.converged or channel.channel in b.stored.observed)
    )


def _trace(condition: str, branch: BranchData, channel: Channel) -> Trace:
    band, stored = branch.bands[channel.channel], branch.stored
    names = ("q50", "q05", "q95", "pred_q05", "pred_q95") if branch.content.converged else ()
    inside = band.temperature[~band.extrapolated]
    measured = stored.observed.get(channel.channel)
    return Trace(
        condition,
        branch.content.branch,
        channel.channel,
        axis_label(channel),
        temperature_label(branch.content),
        band.temperature,
        {name: band.quantiles[name] for name in names},
        (float(inside[0]), float(inside[-1])),
        None if measured is None else (stored.inputs["temperature"], measured),
    )


def channels_of(branches: Sequence[BranchData]) -> list[Channel]:
    """Channels that any of the branches has, in order."""
    found = {c.channel: c for b in branches for c in b.content.channels}
    return [found[name] for name in ("force", "displacement", "stiffness") if name in found]


def _derived(channels: Iterable[Channel]) -> bool:
    return any(not c.observed for c in channels)
