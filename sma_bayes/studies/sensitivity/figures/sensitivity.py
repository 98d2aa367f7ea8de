"""Figures of a study of sensitivity: prior against data, without each sweep, and the influence of each reading."""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from sma_bayes.report.figures.sheet import (
    FAINT,
    INK,
    PRIOR,
    WARNING,
    Drawing,
    as_columns,
    dot_handle,
    empty_sheet,
    heading,
    label_width,
    name_rows,
    ordered_colours,
    panels,
    take_power,
)
from sma_bayes.report.notation import unit_label
from sma_bayes.runs.declared_units import shown_as, units_of
from sma_bayes.runs.outputs import floats
from sma_bayes.studies.sensitivity.schema import QuantitySensitivity, RecordSensitivity, StoredSensitivity
from sma_bayes.studies.sensitivity.words import called, reported

LEAST_DRAWN: Final = 1e-3
"""Sensitivities below it are drawn there."""
CHANNELS: Final = {"force": "#c8501e", "displacement": "#1f6fb2", "stiffness": "#3f8f8f"}
"""Colour of the readings of each channel."""
NUMBERS_SHOWN: Final = 4
"""Numbers whose readings are drawn."""


def powers_figure(stored: StoredSensitivity, record: RecordSensitivity) -> Drawing:
    """Sensitivity of each number of a record to prior and likelihood, and its change without each sweep.

    Parameters
    ----------
    stored : StoredSensitivity
    record : RecordSensitivity
        Its entry in ``sensitivity.json``.
    """
    quantities, swept = reported(record), bool(record.left_out_sweeps)
    names = [q.name for q in quantities]
    figure = empty_sheet(7.8 if swept else 5.4, 1.35 + 0.17 * len(names))
    axes = panels(figure, 1, 2 if swept else 1, left=label_width(names), bottom=0.5, top=0.62, gap_x=0.5)[0]
    threshold = stored.found.thresholds.sensitivity
    _powers(axes[0], quantities, threshold)
    handles = [dot_handle(PRIOR, "prior"), dot_handle(INK, "likelihood", hollow=True)]
    handles.append(Line2D([], [], color=WARNING, lw=0.8, ls="--", label=f"threshold {threshold:g}"))
    axes[0].legend(
        handles=handles,
        loc="lower left",
        bbox_to_anchor=(0.0, 1.0),
        ncols=3,
        frameon=False,
        columnspacing=1.0,
    )
    if swept:
        _sweeps(axes[1], quantities, len(record.left_out_sweeps))
    heading(figure, f"What moves the numbers of {record.key}", "" if record.converged else "NOT CONVERGED")
    caption = (
        f"{record.condition}, {record.branch}: sensitivity of each number to the power of prior and likelihood; "
        "right of the dashed line it counts."
    )
    if swept:
        caption += " On the right, how far its mean moves without each sweep."
    header = (
        "number",
        "prior [1]",
        "likelihood [1]",
        *(f"without sweep {s.sweep} [sd]" for s in record.left_out_sweeps),
    )
    return Drawing(
        stem=f"sensitivity-{record.key}",
        caption=caption,
        alt="sensitivity of each number to prior and likelihood, and its change without each sweep",
        figure=figure,
        data=as_columns(
            header, [(q.name, q.prior, q.likelihood, *(s.change for s in q.sweeps)) for q in quantities]
        ),
    )


def _powers(ax: Axes, quantities: tuple[QuantitySensitivity, ...], threshold: float) -> None:
    name_rows(ax, [q.name for q in quantities], labelled=True)
    values = [v for q in quantities for v in (q.prior, q.likelihood) if v is not None]
    ax.set(xscale="log", xlim=(0.8 * LEAST_DRAWN, 1.6 * max([1.0, *values])))
    ax.axvline(threshold, color=WARNING, lw=0.8, ls="--")
    for place, q in enumerate(quantities):
        if q.likelihood is not None:
            ax.plot(max(q.likelihood, LEAST_DRAWN), place, "o", ms=4.5, mfc="white", mec=INK)
        if q.prior is not None:
            ax.plot(max(q.prior, LEAST_DRAWN), place, "o", ms=4.5, color=PRIOR)
    take_power(ax.xaxis)
    ax.set_xlabel("sensitivity [1]")


def _sweeps(ax: Axes, quantities: tuple[QuantitySensitivity, ...], count: int) -> None:
    name_rows(ax, [q.name for q in quantities], labelled=False)
    colours = ordered_colours(count)
    ax.axvline(0.0, color=INK, lw=0.6)
    reach = 1.0
    for place, q in enumerate(quantities):
        for s in q.sweeps:
            if s.change is not None:
                ax.plot(s.change, place, "o", ms=4, color=colours[s.sweep - 1], mec="white", mew=0.4)
                reach = max(reach, abs(s.change))
    ax.set(xlim=(-1.15 * reach, 1.15 * reach), xlabel="change of the mean without a sweep [posterior sd]")
    ends = [dot_handle(colours[0], "sweep 1"), dot_handle(colours[-1], f"sweep {count}")]
    ax.legend(handles=ends, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, frameon=False)


def readings_figure(stored: StoredSensitivity, record: RecordSensitivity) -> Drawing:
    """What leaving out each reading does to some numbers of a record, against temperature.

    Parameters
    ----------
    stored : StoredSensitivity
    record : RecordSensitivity
        Its entry in ``sensitivity.json``.
    """
    quantities = _headlines(record)
    cells = stored.cells(f"readings/{record.key}.csv")
    channel = np.array(cells["channel"])
    label, warm = next(item for item in cells.items() if item[0].startswith("temperature_"))
    degrees = shown_as(label.removeprefix("temperature_"), units_of(stored.found))
    temperature = degrees.values(floats(warm))
    names = (q.name for q in record.quantities)
    influence = dict(zip(names, list(cells.values())[-len(record.quantities) :], strict=True))
    rows = max(1, math.ceil(len(quantities) / 2))
    figure = empty_sheet(7.2, 0.85 + 1.9 * rows)
    axes = panels(figure, rows, 2, left=0.75, bottom=0.5, top=0.62, gap_x=0.7, gap_y=0.5)
    data: dict[str, Any] = {"channel": channel, "temperature": temperature}
    for ax, q in zip(axes.flat, quantities, strict=False):
        change = data[q.name] = floats(influence[q.name])
        ax.axhline(0.0, color=FAINT, lw=0.6)
        for name in dict.fromkeys(channel.tolist()):
            own = channel == name
            ax.plot(temperature[own], change[own], "o", ms=2.4, mec="none", color=CHANNELS.get(name, INK),
                    alpha=0.75, rasterized=True)  # fmt: skip
        if q.reading is not None and q.reading.change is not None:
            ax.plot(q.reading.temperature, q.reading.change, "o", ms=7, mfc="none", mec=WARNING, mew=0.9)
            ax.set_title(f"row {q.reading.row}", loc="right", fontsize=7, color=WARNING)
        ax.set_title(q.name)
        ax.margins(y=0.12)
    for ax in axes.flat[len(quantities) :]:
        ax.set_visible(False)
    for number, ax in enumerate(axes.flat[: len(quantities)]):
        if number >= len(quantities) - 2:
            ax.set_xlabel(f"temperature [{unit_label(record.temperature_unit)}]")
        if number % 2 == 0:
            ax.set_ylabel("change without [sd]")
    handles = [
        dot_handle(CHANNELS.get(name, INK), called(record, name)) for name in dict.fromkeys(channel.tolist())
    ]
    handles.append(dot_handle(WARNING, "decides most", hollow=True))
    figure.legend(handles=handles, loc="upper right", ncols=len(handles), frameon=False)
    heading(figure, f"Readings of {record.key}", "" if record.converged else "NOT CONVERGED")
    return Drawing(
        stem=f"readings-{record.key}",
        caption=(
            f"{record.condition}, {record.branch}: change of the posterior mean, to first order, where a "
            f"reading is left "
            "out, in posterior standard deviations; a ring marks the reading that decides most."
        ),
        alt="influence of each reading on some numbers, against temperature",
        figure=figure,
        data=data,
    )


def _headlines(record: RecordSensitivity) -> tuple[QuantitySensitivity, ...]:
    """Numbers whose readings are drawn: transformation temperatures and stiffness first, then parameters."""
    told = [q for q in reported(record) if q.reading is not None]
    curve = [q for q in told if q.kind == "curve"]
    wanted = [
        *[q for q in told if q.kind == "transformation"][:2],
        *(q for q in curve if q.temperature is None),
    ]
    wanted += [*(q for q in curve if q.temperature is not None), *(q for q in told if q.kind == "parameter")]
    return tuple(wanted[:NUMBERS_SHOWN])
