"""Figures of a comparison: curves of the models over the data, and what each loses on what was held out."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from sma_bayes.arrays import Floats
from sma_bayes.report.figures.sheet import (
    FAINT,
    INK,
    Drawing,
    as_columns,
    empty_sheet,
    heading,
    in_units_of,
    label_width,
    panels,
    take_power,
)
from sma_bayes.report.notation import sentence, unit_label
from sma_bayes.runs.shown import series_shown
from sma_bayes.studies.compare.schema import ComparedRecord, StoredComparison
from sma_bayes.studies.compare.words import short

LOOKS: Final[Mapping[str, tuple[str, str]]] = {
    "modified_sigmoid": ("#c8501e", "-"),
    "modified_sigmoid_tied": ("#e0a030", "--"),
    "logistic_refitted": ("#1f6fb2", "-"),
    "bounded_logistic": ("#5aa9d6", ":"),
    "logistic_corrected": ("#20643c", "-."),
    "logistic_published": ("#20643c", ":"),
    "polynomial_corrected": ("#6a3d9a", "-"),
}
"""Colour and dashes of each model of the paper that has a curve of its own."""
OTHERS: Final = ("#b0306a", "#7a5c1e", "#3f8f8f", "#8a8a00", "#444444")
"""Colours of all other models."""
BANDED: Final = ("modified_sigmoid", "logistic_refitted", "polynomial_corrected")
"""Models whose bands are drawn; more would hide each other."""
TURN: Final = 10.0
"""Difference from which the axis is logarithmic."""
TICKS: Final = tuple(
    s * t for s, ts in ((-1.0, (1e4, 1e3, 100.0, 10.0)), (1.0, (0.0, 10.0, 100.0, 1e3, 1e4))) for t in ts
)
ROWS: Final = 6
"""Records in one figure: letters of more are too small in print."""


def look(name: str) -> tuple[str, str]:
    """Colour and dashes of a model, the same in every figure."""
    return LOOKS.get(name) or (OTHERS[sum(name.encode()) % len(OTHERS)], "-")


def drawn_order(names: Iterable[str]) -> list[str]:
    """Models in the order in which they are drawn: those of the paper first."""
    there = list(names)
    return [*(n for n in LOOKS if n in there), *(n for n in there if n not in LOOKS)]


def curves_figure(stored: StoredComparison, record: ComparedRecord) -> Drawing:
    """Curves of all models with 90 % bands over the data of one record, and held-out residuals below.

    Parameters
    ----------
    stored : StoredComparison
    record : ComparedRecord
        Its entry in ``comparison.json``.
    """
    curves, samples = (
        series_shown(stored, f"{place}/{record.key}.csv", record.quantity) for place in ("curves", "samples")
    )
    temperature = f"temperature_{record.temperature_unit}"
    names = drawn_order(c.removesuffix("_q50") for c in curves if c.endswith("_q50"))
    figure = empty_sheet(6.6, 5.2)
    axes = panels(figure, 2, 1, left=0.85, right=2.05, bottom=0.55, top=0.5, gap_y=0.3, tall=(2.2, 1.0))[:, 0]
    _curves(axes[0], curves, samples, temperature, names)
    _residuals(axes[1], samples, temperature, names)
    for ax, what in ((axes[0], record.quantity), (axes[1], "measured − held out")):
        ax.set_ylabel(f"{what} [{in_units_of(take_power(ax.yaxis), record.unit)}]")
    axes[1].set_xlabel(f"temperature [{unit_label(record.temperature_unit)}]")
    axes[0].set_xticklabels([])
    handles = [
        Line2D([], [], color=FAINT, marker="o", ms=3, ls="none", label="measured"),
        *(Line2D([], [], color=look(n)[0], ls=look(n)[1], label=_legend(record, n)) for n in names),
    ]
    figure.legend(handles=handles, loc="upper left", bbox_to_anchor=(1.0 - 1.95 / 6.6, 0.93))
    heading(figure, f"{record.condition}, {record.branch}: {record.verdict}", "")
    reason = stored.found.reason(record)
    return Drawing(
        stem=f"curves-{record.key}",
        caption=(
            f"{record.condition}, {record.branch}: medians of the models' curves, with 90 % bands of the "
            "modified sigmoid, the refitted logistic and the polynomial, over the data. Below: residuals of "
            f"predictions made without the sample's own fold ({record.held_out.kind}). "
            f"{sentence(reason)}"
        ),
        alt="measured values with the curves of all models, and residuals of held-out predictions",
        figure=figure,
        data=curves,
    )


def _legend(record: ComparedRecord, name: str) -> str:
    same = [short(n) for n, m in record.models.items() if m.same_as == name]
    return "\n".join([short(name), *(f"  = {s}" for s in same)])


def _curves(
    ax: Axes, curves: Mapping[str, Floats], samples: Mapping[str, Floats], temperature: str, names: list[str]
) -> None:
    ax.plot(samples[temperature], samples["measured"], "o", ms=2.2, mec="none", mfc=FAINT, rasterized=True)
    t, y = curves[temperature], samples["measured"]
    margin = 0.25 * float(np.ptp(y))
    for name in names:
        colour, dashes = look(name)
        if name in BANDED:
            ax.fill_between(t, curves[f"{name}_q05"], curves[f"{name}_q95"], color=colour, alpha=0.18, lw=0)
        ax.plot(t, curves[f"{name}_q50"], color=colour, ls=dashes, lw=1.1)
    ax.set_ylim(y.min() - margin, y.max() + margin)


def _residuals(ax: Axes, samples: Mapping[str, Floats], temperature: str, names: list[str]) -> None:
    order = np.argsort(samples[temperature], kind="stable")
    ax.axhline(0.0, color=INK, lw=0.6)
    drawn = []
    for name in names:
        if name in BANDED:
            left = samples["measured"] - samples[f"{name}_held_out"]
            drawn.append(left)
            ax.plot(
                samples[temperature][order], left[order], ".", ms=2.4, color=look(name)[0], rasterized=True
            )
    if drawn:
        reach = 1.1 * float(np.quantile(np.abs(np.concatenate(drawn)), 0.995))
        ax.set_ylim(-reach, reach)


def differences_figure(stored: StoredComparison, number: int) -> Drawing:
    """Held-out log density of each model less that of the preferred one, record by record, with intervals.

    Parameters
    ----------
    stored : StoredComparison
    number : int
        Page, from 1.
    """
    records = stored.found.records[(number - 1) * ROWS : number * ROWS]
    shown = [(r, [n for n in drawn_order(r.models) if _counts(r, n)]) for r in records]
    tall = [max(len(names), 1) for _, names in shown]
    left = label_width(short(n) for _, names in shown for n in names)
    figure = empty_sheet(7.2, 0.95 + sum(0.16 * n + 0.34 for n in tall))
    axes = panels(figure, len(shown), 1, left=left, right=0.2, bottom=0.6, top=0.55, gap_y=0.34, tall=tall)[
        :, 0
    ]
    rows: list[tuple[Any, ...]] = []
    for ax, (record, names) in zip(axes, shown, strict=True):
        rows += _differences(ax, record, names)
    ends = [v for row in rows for v in row[2:] if v is not None]
    low, high = 1.25 * min(-TURN, *ends), 1.25 * max(TURN, *ends)
    ticks = [t for t in TICKS if low <= t <= high]
    for ax in axes:
        ax.set_xlim(low, high)
        ax.set_xticks(ticks, [f"{t:g}".replace("-", "−") if ax is axes[-1] else "" for t in ticks])
        ax.minorticks_off()
    axes[-1].set_xlabel("held-out log density, less that of the preferred model [1]")
    heading(figure, f"What was held out: {stored.found.campaign}", "")
    return Drawing(
        stem="held-out" if number == 1 else f"held-out-{number}",
        caption=(
            "Log density of what was held out, less that of the preferred model (at 0), with 95 % intervals from the "
            "scatter between folds; linear up to 10, logarithmic beyond. Left of 0: predicts worse. Models that have "
            "the numbers of another are left out."
        ),
        alt="differences of held-out log density with intervals, for each record and model",
        figure=figure,
        data=as_columns(("record", "model", "difference [1]", "low [1]", "high [1]"), rows),
    )


def pages(stored: StoredComparison) -> int:
    """Pages of `differences_figure`."""
    return -(-len(stored.found.records) // ROWS)


def _counts(record: ComparedRecord, name: str) -> bool:
    model = record.models[name]
    return not model.same_as and not model.unavailable


def _differences(ax: Axes, record: ComparedRecord, names: list[str]) -> Iterator[tuple[Any, ...]]:
    for place, name in enumerate(names):
        d = record.models[name].behind_preferred
        if d is None:
            continue
        colour = look(name)[0]
        low, high = (d.value if v is None else v for v in (d.low, d.high))
        ax.plot([low, high], [place, place], color=colour, lw=1.4)
        ax.plot(d.value, place, "o", ms=4, color=colour)
        yield (record.key, name, d.value, d.low, d.high)
    ax.axvline(0.0, color=INK, lw=0.6)
    ax.set_xscale("symlog", linthresh=TURN)
    ax.set_yticks(range(len(names)), [short(n) for n in names])
    ax.set_ylim(len(names) - 0.4, -0.6)
    ax.yaxis.set_label_coords(-0.1, 0.5)
    ax.set_title(f"{record.condition}-{record.branch}, {record.quantity}: {record.verdict}")
