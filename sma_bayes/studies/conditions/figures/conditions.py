"""Figures of a study of conditions: what was measured, what the settings do, and what was predicted."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from sma_bayes.arrays import Floats
from sma_bayes.quantities import quantity_of
from sma_bayes.report.figures.sheet import (
    COLOURS,
    FAINT,
    INK,
    RASTER_ABOVE_POINTS,
    WARNING,
    Drawing,
    as_columns,
    empty_sheet,
    few_ticks,
    heading,
    in_units_of,
    label_width,
    logarithmic,
    name_rows,
    numbered,
    panels,
    take_power,
)
from sma_bayes.report.notation import unit_label
from sma_bayes.runs.schema import IntervalDocument
from sma_bayes.runs.shown import series_shown
from sma_bayes.studies.conditions.leave_out import CURVES, PARAMETERS
from sma_bayes.studies.conditions.schema import (
    LeftOutCurve,
    PredictedChannel,
    StatedEffect,
    StatedFeature,
    StatedGroup,
    StoredConditions,
)
from sma_bayes.studies.conditions.tables import named, setting_name, setting_text

BOTH: Final = "#555555"
BY_HAND: Final = {CURVES: ("#20643c", "--", "dashed"), PARAMETERS: ("#6a3d9a", ":", "dotted")}
"""Colour and dashes of interpolation by hand, and what the dashes are called."""
FEATURES_SHOWN: Final = (
    "least_stiffness", "greatest_stiffness", "stiffness_ratio", "steepest_stiffness", "greatest_slope",
    "midpoint", "As", "Af", "Ms", "Mf", "Rs", "Rf", "hysteresis_width", "peak_temperature",
)  # fmt: skip
"""Features whose effects are drawn, in this order."""
PRIOR_LED: Final = " The scatter between conditions, and with it the width, is dominated by its prior."
MAX_RANGES_BEYOND: Final = 3.0
"""How far beyond the measured values a band is drawn [their range]; what is wider is cut off."""


def measured_figure(stored: StoredConditions, number: int) -> Drawing:
    """Stiffness extremes and transformation temperatures of each condition of a group.

    Parameters
    ----------
    stored : StoredConditions
    number : int
        Group, from 1.
    """
    group = stored.found.groups[number - 1]
    ids = group.conditions
    features = [f for f in stored.found.features if f.condition in ids]
    stiff = any(f.channel == "stiffness" for f in features)
    left = label_width(ids)
    columns = 2 if stiff else 1
    figure = empty_sheet(left + max(2.9 * columns, 4.2) + 0.35, 1.25 + 0.34 * len(ids))
    axes = panels(figure, 1, columns, left=left, bottom=0.75, top=0.45, gap_x=0.3)[0]
    rows: list[tuple[Any, ...]] = []
    for ax in axes:
        name_rows(ax, ids, labelled=ax is axes[0])
    if stiff:
        rows += _stiffness(axes[0], ids, features)
    rows += _temperatures(axes[-1], ids, features)
    _legend(figure, [
        *(Line2D([], [], color=c, marker="o", ms=4, label=b) for b, c in COLOURS.items()),
        Line2D([], [], color=FAINT, lw=4, alpha=0.5, label="measured temperatures"),
        Line2D([], [], color=INK, marker="|", ms=6, ls="none", label="start and finish"),
    ])  # fmt: skip
    heading(figure, _title(group, stored.found.specimen), "")
    return Drawing(
        stem=numbered("measured", number),
        caption=(
            ("Left: least and greatest stiffness over the measured temperatures. " if stiff else "")
            + ("Right: measured" if stiff else "Measured")
            + " range of temperature, midpoints of the transformation (dots), its start and finish by the tangent rule "
            "(bars); medians and 90 % intervals of the posteriors, which points may hide."
        ),
        alt="stiffness and transformation temperatures of each condition, with intervals",
        figure=figure,
        data=as_columns(("condition", "branch", "feature", "channel", "unit", "q05", "median", "q95"), rows),
    )


def _title(group: StatedGroup, specimen: bool) -> str:
    names = [setting_name(n, specimen) for n in group.varied]
    return f"{len(group.conditions)} conditions that differ in {' and '.join(names) or 'nothing'}"


def _legend(figure: Any, handles: list[Any]) -> None:
    figure.legend(
        handles=handles, loc="lower center", ncols=len(handles), borderaxespad=0.2, columnspacing=1.2
    )


def _offset(branch: str) -> float:
    return {"heating": -0.14, "cooling": 0.14}.get(branch, 0.0)


def _record(f: StatedFeature) -> tuple[Any, ...]:
    return (f.condition, f.branch, f.name, f.channel, f.unit, *f.quantiles)


def _stiffness(ax: Axes, ids: Sequence[str], features: Iterable[StatedFeature]) -> list[tuple[Any, ...]]:
    rows = []
    ends: dict[tuple[str, str], list[float]] = {}
    unit = ""
    for f in features:
        if f.name not in ("least_stiffness", "greatest_stiffness") or f.branch == "both":
            continue
        place = ids.index(f.condition) + _offset(f.branch)
        colour, unit = COLOURS[f.branch], f.unit
        low, median, high = f.quantiles
        ax.plot([low, high], [place, place], color=colour, lw=2.2, solid_capstyle="butt")
        ax.plot(median, place, "o", ms=3.4, color=colour)
        ends.setdefault((f.condition, f.branch), []).append(median)
        rows.append(_record(f))
    for (condition, branch), values in ends.items():
        place = ids.index(condition) + _offset(branch)
        ax.plot([min(values), max(values)], [place, place], color=COLOURS[branch], lw=0.6, alpha=0.7)
    logarithmic(ax, ax.xaxis)
    ax.set_xlabel(f"least and greatest stiffness [{in_units_of(0, unit)}]")
    return rows


def _temperatures(ax: Axes, ids: Sequence[str], features: Iterable[StatedFeature]) -> list[tuple[Any, ...]]:
    rows, unit = [], ""
    reach: dict[str, list[float]] = {}
    for f in features:
        place = ids.index(f.condition) + _offset(f.branch)
        colour = COLOURS.get(f.branch, BOTH)
        low, median, high = f.quantiles
        if f.name in ("least_temperature", "peak_temperature"):
            reach.setdefault(f.condition, []).append(median)
            unit = f.unit
        elif f.name == "midpoint":
            shift = {"force": -0.06, "displacement": 0.06}[f.channel]
            ax.plot([low, high], [place + shift] * 2, color=colour, lw=1.2)
            ax.plot(median, place + shift, "o", ms=3.2, color=colour)
        elif f.name in ("As", "Af", "Ms", "Mf", "Rs", "Rf") and f.median is not None:
            ax.plot([low, high], [place, place], color=colour, lw=1.2)
            ax.plot(median, place, "|", ms=7, color=colour)
        else:
            continue
        rows.append(_record(f))
    for condition, ends in reach.items():
        at = ids.index(condition)
        ax.plot(ends, [at, at], color=FAINT, lw=9, alpha=0.25, solid_capstyle="butt", zorder=0)
    ax.set_xlabel(f"temperature [{unit_label(unit)}]")
    return rows


def effects_figure(stored: StoredConditions, number: int, setting: str) -> Drawing:
    """Effects of one setting in one group: factors and differences with intervals.

    Parameters
    ----------
    stored : StoredConditions
    number : int
        Group, from 1.
    setting : str
    """
    group = stored.found.groups[number - 1]
    shown = [
        e for e in stored.found.effects
        if e.conditions == group.conditions and e.setting == setting and e.tested is not None
        and e.feature in FEATURES_SHOWN
    ]  # fmt: skip
    shown.sort(key=lambda e: (FEATURES_SHOWN.index(e.feature), e.branch, e.channel))
    parts = [[e for e in shown if e.kind == kind] for kind in ("factor", "difference")]
    parts = [p for p in parts if p]
    specimen = stored.found.specimen
    labels = [_label(e, specimen) for e in shown]
    left = label_width(labels)
    tall = [len(p) + 0.5 for p in parts]
    figure = empty_sheet(left + 4.3, 1.1 + 0.75 * (len(parts) - 1) + 0.2 * sum(tall))
    axes = panels(figure, len(parts), 1, left=left, right=0.2, bottom=0.75, top=0.35, gap_y=0.6, tall=tall)[
        :, 0
    ]
    rows: list[tuple[Any, ...]] = []
    for ax, part in zip(axes, parts, strict=True):
        rows += _effects(ax, part, specimen)
    _legend(figure, [
        *(Line2D([], [], color=c, lw=2, label=b) for b, c in {**COLOURS, "both branches": BOTH}.items()),
        Line2D([], [], color=INK, lw=3, marker="|", ms=9, mew=1.6, label="tested conditions"),
        Line2D([], [], color=INK, lw=0.8, marker="o", ms=3, mfc="white", label="with scatter"),
    ])  # fmt: skip
    varied = group.varied[setting]
    ends = [setting_text(setting, choose(varied.values), varied.unit) for choose in (min, max)]
    name = setting_name(setting, specimen)
    heading(figure, f"From {ends[0]} to {ends[1]} ({name})", "")
    along = sorted({named(c.name) for e in shown for c in e.confounded_with if c.strong})
    return Drawing(
        stem=f"{numbered('effects', number)}-{setting}",
        caption=(
            f"Change of each feature from the least to the greatest {name} in {', '.join(group.conditions)}: "
            "medians and 90 % intervals. Thick: how the tested conditions differ. Thin: what the setting does, "
            "conditions scattering about a straight line."
            + (f" It can't be told from an effect of {', '.join(along)}, which went along." if along else "")
        ),
        alt=f"effects of {name} on stiffness and transformation, with intervals",
        figure=figure,
        data=as_columns(
            ("feature", "branch", "channel", "kind", "unit", "tested_q05", "tested_median", "tested_q95", "beyond_q05",
             "beyond_median", "beyond_q95"), rows,
        ),
    )  # fmt: skip


def _label(e: StatedEffect, specimen: bool) -> str:
    of = f" ({quantity_of(e.channel, specimen=specimen)})" if e.channel and e.channel != "stiffness" else ""
    return f"{named(e.feature)}{of}"


def _effects(ax: Axes, part: Sequence[StatedEffect], specimen: bool) -> Iterator[tuple[Any, ...]]:
    factor = part[0].kind == "factor"
    ax.axvline(1.0 if factor else 0.0, color=INK, lw=0.6, zorder=0)
    for place, e in enumerate(part):
        colour = COLOURS.get(e.branch, BOTH)
        (low, median, high), beyond = _ends(e.tested), _ends(e.beyond)
        ax.plot(beyond[::2], [place, place], color=colour, lw=0.8)
        ax.plot(beyond[1], place, "o", ms=3.4, mfc="white", mec=colour, mew=0.8, zorder=5)
        ax.plot([low, high], [place, place], color=colour, lw=3.2, solid_capstyle="butt", alpha=0.8)
        ax.plot(median, place, "|", ms=9, mew=1.6, color=colour)
        yield (e.feature, e.branch, e.channel, e.kind, e.unit, low, median, high, *beyond)
    name_rows(ax, [_label(e, specimen) for e in part], labelled=True)
    units = sorted({unit_label(e.unit) for e in part if e.unit != "1"})
    ax.set_xlabel("factor [1]" if factor else f"difference [{' or '.join(units) or '1'}]")
    if factor:
        logarithmic(ax, ax.xaxis)
    else:
        ax.xaxis.set_major_locator(few_ticks(6))


def _ends(found: IntervalDocument | None) -> tuple[float, float, float]:
    """Quantiles of an interval; NaN, which nothing is drawn for, where there is none."""
    return (math.nan, math.nan, math.nan) if found is None else found.quantiles


def held_out_figure(stored: StoredConditions, condition: str) -> Drawing:
    """Bands predicted for a condition that was left out, over what was measured there, beside interpolation by hand."""
    held = [h for h in stored.found.held_out if h.condition == condition]
    channels, branches = _channels_and_branches((h.channel, h.branch) for h in held)
    figure, axes = _grid(channels, branches)
    data: dict[str, Any] = {}
    ways: list[str] = []
    for h in held:
        ax = axes[channels.index(h.channel), branches.index(h.branch)]
        columns = series_shown(stored, h.file, h.channel)
        beside = h.file.removesuffix(".csv") + "-samples.csv"
        measured = (stored.folder / beside).is_file()
        samples = series_shown(stored, beside, h.channel) if measured else {}
        ways += [w for w in h.ways if w in BY_HAND]
        _band(ax, columns, "hierarchical", COLOURS[h.branch])
        t = _temperature(columns)
        for name in (w for w in h.ways if w in BY_HAND):
            colour, dashes, _ = BY_HAND[name]
            ax.plot(t, columns[f"{name.replace(' ', '_')}_q50"], color=colour, ls=dashes, lw=1.1)
        if samples:
            y = samples["measured"]
            ax.plot(
                _temperature(samples),
                y,
                ".",
                ms=1.8,
                color=INK,
                alpha=0.5,
                rasterized=y.size > RASTER_ABOVE_POINTS,
            )
        else:
            ax.plot(t, columns["own_median"], color=INK, lw=0.9)
        lowest = h.channel == channels[-1]
        _finish(ax, columns["own_median"], h.channel, h, h.temperature_unit if lowest else "")
        score = h.ways["hierarchical"]
        _said(ax, f"holds {100 * score.covers_curve:.0f} % of the curve", warn=score.holds_whole is False)
        data |= {f"{h.branch} {h.channel} {k}": v for k, v in columns.items()}
    handles = [
        Line2D([], [], color=INK, marker=".", lw=0.9, ms=4, label="measured there"),
        Patch(color=BOTH, alpha=0.25, lw=0, label="predicted, 90 %"),
        *(Line2D([], [], color=BY_HAND[w][0], ls=BY_HAND[w][1], label=w) for w in dict.fromkeys(ways)),
    ]
    _legend(figure, handles)
    first = held[0]
    drawn = [f"{BY_HAND[w][2]}, {w}" for w in dict.fromkeys(ways)]
    beside = f"; beside them by hand: {'; '.join(drawn)}" if drawn else ""
    note = "EXTRAPOLATES" if first.extrapolates else ""
    heading(figure, f"{condition} predicted from {len(first.from_)} others", note)
    return Drawing(
        stem=f"held-out-{condition}",
        caption=(
            f"{condition} was left out and predicted from {', '.join(first.from_)}: 90 % band of the curve and its "
            f"median, over what was measured there{beside}."
            + (PRIOR_LED if first.prior_led else "")
        ),
        alt="predicted bands over the measurements of a condition that was left out",
        figure=figure,
        data=_same_length(data),
    )  # fmt: skip


def predicted_figure(stored: StoredConditions, condition: str) -> Drawing:
    """Bands of a condition that was not measured, over the curves of the measured ones."""
    parts = [p for p in stored.found.predictions if p.condition == condition]
    curves = [(p, channel, of) for p in parts for channel, of in p.channels.items()]
    channels, branches = _channels_and_branches((channel, p.branch) for p, channel, _ in curves)
    figure, axes = _grid(channels, branches)
    data: dict[str, Any] = {}
    for p, channel, of in curves:
        ax = axes[channels.index(channel), branches.index(p.branch)]
        columns = series_shown(stored, of.band, channel)
        seen = []
        for other in p.from_:
            own = series_shown(stored, f"curves/{other}-{p.branch}-{channel}.csv", channel)
            ax.plot(_temperature(own), own["own_q50"], color=FAINT, lw=0.8)
            seen.append(own["own_q50"])
        shown = {f"hierarchical_{q}": columns[q] for q in ("q05", "q50", "q95")}
        _band(ax, shown | {"temperature": _temperature(columns)}, "hierarchical", COLOURS[p.branch])
        lowest = channel == channels[-1]
        _finish(ax, np.concatenate(seen), channel, of, p.temperature.unit if lowest else "")
        data |= {f"{p.branch} {channel} {k}": v for k, v in columns.items() if k != "extrapolated"}
    _legend(figure, [
        Line2D([], [], color=FAINT, label="measured conditions"),
        Patch(color=BOTH, alpha=0.25, lw=0, label="predicted, 90 %"),
    ])  # fmt: skip
    first = parts[0]
    heading(figure, f"{condition}, not measured", "EXTRAPOLATES" if first.extrapolates else "")
    return Drawing(
        stem=f"predicted-{condition}",
        caption=(
            f"Curve at {condition}, which was not measured: median and 90 % band, with the median curves of "
            f"{', '.join(first.from_)}."
            + (PRIOR_LED if first.prior_led else "")
        ),
        alt="predicted bands of a condition that was not measured, with the curves of the measured ones",
        figure=figure,
        data=_same_length(data),
    )  # fmt: skip


def _channels_and_branches(places: Iterable[tuple[str, str]]) -> tuple[list[str], list[str]]:
    """Channels, and branches in the order of figures, of pairs of the two."""
    channels, branches = zip(*places, strict=True)
    return list(dict.fromkeys(channels)), [b for b in COLOURS if b in branches]


def _grid(channels: Sequence[str], branches: Sequence[str]) -> tuple[Any, Any]:
    figure = empty_sheet(0.95 + 2.9 * len(branches) + 0.75 * (len(branches) - 1), 1.15 + 2.1 * len(channels))
    axes = panels(figure, len(channels), len(branches), left=0.8, bottom=0.8, top=0.5, gap_x=0.75, gap_y=0.3)
    for row in axes[:-1]:
        for ax in row:
            ax.set_xticklabels([])
    for ax, branch in zip(axes[0], branches, strict=True):
        ax.set_title(branch)
    return figure, axes


def _temperature(columns: Mapping[str, Floats]) -> Floats:
    return next(v for n, v in columns.items() if n.startswith("temperature"))


def _band(ax: Axes, columns: Mapping[str, Floats], name: str, colour: str) -> None:
    t = _temperature(columns)
    ax.fill_between(t, columns[f"{name}_q05"], columns[f"{name}_q95"], color=colour, alpha=0.2, lw=0)
    ax.plot(t, columns[f"{name}_q50"], color=colour, lw=1.2)


def _finish(
    ax: Axes, values: Floats, channel: str, of: LeftOutCurve | PredictedChannel, temperature_unit: str
) -> None:
    """Limits about what was measured, and labels; none of the temperature without a unit."""
    low, high = float(np.min(values)), float(np.max(values))
    if channel == "stiffness" and low > 0.0:
        stretch = max((high / low) ** 0.75, 3.0)
        ax.set_ylim(low / stretch, high * stretch)
        logarithmic(ax, ax.yaxis)
    else:
        bottom, top = ax.get_ylim()
        reach = MAX_RANGES_BEYOND * (high - low) / 4.0
        ax.set_ylim(max(bottom, low - reach), min(top, high + reach))
    power = take_power(ax.yaxis)
    ax.set_ylabel(f"{of.quantity} [{in_units_of(power, of.unit)}]")
    if temperature_unit:
        ax.set_xlabel(f"temperature [{unit_label(temperature_unit)}]")


def _said(ax: Axes, text: str, *, warn: bool) -> None:
    """A few small words above a panel, where they hide nothing."""
    ax.set_title(
        text, loc="right", fontsize=6.5, fontweight="normal", style="italic", color=WARNING if warn else INK
    )


def _same_length(data: Mapping[str, Floats]) -> dict[str, Any]:
    longest = max((len(v) for v in data.values()), default=0)
    return {k: [*v, *([np.nan] * (longest - len(v)))] for k, v in data.items()}
