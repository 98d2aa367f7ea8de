"""What all figures share: style, panels, labels, and saving with the data beside."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from logging import Handler, getLogger
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final
from warnings import catch_warnings, simplefilter

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import (
    FuncFormatter,
    LogLocator,
    MaxNLocator,
    NullFormatter,
    NullLocator,
    ScalarFormatter,
)

from sma_bayes.arrays import Floats
from sma_bayes.errors import SmaBayesError
from sma_bayes.report.content import (
    Channel,
    RecordContent,
)
from sma_bayes.report.explorer import Trace
from sma_bayes.report.figures.typeface import families
from sma_bayes.report.notation import power_text, unit_label
from sma_bayes.runs.outputs import StoredBand, StoredRecord
from sma_bayes.runs.store import or_nan, write_csv, write_file

COLOURS: Final = {"heating": "#c8501e", "cooling": "#1f6fb2"}
"""Vermilion and blue: apart for colour-blind eyes, and in grey."""


LINEAR_TICKS_RATIO: Final = 5.0
"""Ratio of the ends of a logarithmic axis up to which its ticks are as on a linear one."""
INK, FAINT, WARNING, PRIOR = "#222222", "#9a9a9a", "#a40000", "#6a3d9a"


RASTER_ABOVE_POINTS: Final = 600
"""Points from which a scatter is drawn as pixels in PDF too."""


PNG_DPI: Final = 110


SAVED: Final[dict[str, dict[str, Any]]] = {
    "png": {"dpi": PNG_DPI},
    "pdf": {"dpi": 200, "metadata": {"CreationDate": None}},
    "svg": {"dpi": 200, "metadata": {"Date": None}},
}
"""How a figure is saved in each format; without dates, so that the same run gives the same bytes."""


STYLE: Final[dict[Any, Any]] = {
    "font.size": 8.0,
    "axes.titlesize": 8.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.titley": 1.0,
    "axes.labelsize": 8.0,
    "axes.edgecolor": "#555555",
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.formatter.use_mathtext": False,
    "axes.formatter.limits": (-3, 5),
    "axes.formatter.useoffset": False,
    "axes.unicode_minus": True,
    "text.parse_math": False,
    "xtick.labelsize": 7.0,
    "ytick.labelsize": 7.0,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "lines.linewidth": 1.0,
    "legend.fontsize": 7.0,
    "legend.frameon": False,
    "figure.facecolor": "white",
    "savefig.facecolor": "white",
    "pdf.fonttype": 42,  # TrueType, as journals ask for
    "svg.hashsalt": "sma_bayes",
    "path.simplify": True,
}
"""Settings in force while a figure is drawn; nobody else's settings are touched."""


@dataclass(frozen=True, slots=True)
class Drawing:
    """A figure, what it shows, and its data.

    Attributes
    ----------
    stem : str
        Name of its files.
    caption, alt : str
        For the eye, and for those who can't see it.
    figure : Figure
    data : mapping of str to sequence
        Columns of equal length.
    traces : tuple of Trace
        Curves of the figure that a reader of the page may question; see `sma_bayes.report.explorer`.
    """

    stem: str
    caption: str
    alt: str
    figure: Figure
    data: Mapping[str, Any]
    traces: tuple[Trace, ...] = ()


@dataclass(frozen=True, slots=True)
class FigureFiles:
    """A figure on disk: `stem` with .pdf, .png and .csv; for `traces` see `Drawing`."""

    stem: str
    caption: str
    alt: str
    traces: tuple[Trace, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class BranchData:
    """A record with what there is to draw of it.

    Attributes
    ----------
    content : RecordContent
    stored : StoredRecord
    bands : mapping of str to StoredBand
        By channel.
    curve : mapping of str to ndarray, shape (n,)
        Median curve at each sample, by observed channel [unit of the channel].
    """

    content: RecordContent
    stored: StoredRecord
    bands: Mapping[str, StoredBand]
    curve: Mapping[str, Floats]


def style_of(path: Path) -> dict[Any, Any]:
    """Settings of a style file of matplotlib.

    Raises
    ------
    SmaBayesError
        If it can't be read, or has a line that matplotlib does not know.
    """
    told: list[str] = []
    handler = Handler()
    handler.emit = lambda record: told.append(record.getMessage())  # type: ignore[method-assign]
    logger = getLogger("matplotlib")
    logger.addHandler(handler)
    try:
        with catch_warnings():
            simplefilter("error")
            found: dict[Any, Any] = dict(mpl.rc_params_from_file(path, use_default_template=False))
    except (OSError, ValueError, Warning) as error:
        told.append(str(error))
    finally:
        logger.removeHandler(handler)
    if told:
        raise SmaBayesError(
            f"can't be read as a style: {' '.join(told[0].partition('You probably')[0].split())}",
            file=path,
            expected="a style file of matplotlib, with lines such as 'font.size: 7'",
        )
    return found


def save(
    draw: Callable[[], Drawing],
    folder: Path,
    formats: Sequence[str] = ("pdf", "png"),
    style: Mapping[Any, Any] = MappingProxyType({}),
) -> FigureFiles:
    """Draw a figure and write it, by default as PDF and PNG, its data beside it as CSV.

    Parameters
    ----------
    draw : callable
        Gives the figure; called with the settings of `STYLE`.
    folder : Path
    formats : sequence of str
        Of ``png``, ``pdf``, ``svg``.
    style : mapping of str to object
        Settings of matplotlib that go before those of `STYLE`.

    Raises
    ------
    OutputError
        If a file can't be written.
    """
    with mpl.rc_context({**STYLE, "font.family": list(families()), **style}):
        drawing = draw()
        for name in sorted(formats, reverse=True):
            options = SAVED[name]
            write_file(
                folder / f"{drawing.stem}.{name}",
                partial(drawing.figure.savefig, format=name, **options),
            )
    write_csv(folder / f"{drawing.stem}.csv", drawing.data)
    return FigureFiles(drawing.stem, drawing.caption, drawing.alt, drawing.traces)


def save_picture(draw: Callable[[], Drawing], folder: Path) -> FigureFiles:
    """Draw a figure and write it as PNG alone, for a page that shows it; see `save`."""
    with mpl.rc_context({**STYLE, "font.family": list(families())}):
        drawing = draw()
        figure = drawing.figure
        write_file(
            folder / f"{drawing.stem}.png", lambda path: figure.savefig(path, format="png", dpi=PNG_DPI)
        )
    return FigureFiles(drawing.stem, drawing.caption, drawing.alt)


def ordered_colours(count: int) -> Floats:
    """Colours of what has an order (count, 4), from violet to green; none is lost on a light or a dark page."""
    return np.asarray(mpl.colormaps["viridis"](np.linspace(0.0, 0.75, count)))


def empty_sheet(width: float, height: float) -> Figure:
    """Empty figure [inch] with a canvas of its own."""
    figure = Figure(figsize=(width, height))
    FigureCanvasAgg(figure)
    return figure


def panels(
    figure: Figure,
    rows: int,
    columns: int,
    *,
    left: float,
    bottom: float,
    top: float,
    right: float = 0.15,
    gap_x: float = 0.0,
    gap_y: float = 0.0,
    ratio: Sequence[float] = (),
    tall: Sequence[float] = (),
) -> Any:
    """Panels with margins and gaps in inch; set by hand, since finding them costs as much as drawing."""
    width, height = figure.get_size_inches()
    panel_w = (width - left - right - (columns - 1) * gap_x) / columns
    panel_h = (height - top - bottom - (rows - 1) * gap_y) / rows
    axes = figure.subplots(
        rows,
        columns,
        squeeze=False,
        gridspec_kw={
            "left": left / width,
            "right": 1.0 - right / width,
            "bottom": bottom / height,
            "top": 1.0 - top / height,
            "wspace": gap_x / panel_w,
            "hspace": gap_y / panel_h,
            **({"width_ratios": ratio} if ratio else {}),
            **({"height_ratios": tall} if tall else {}),
        },
    )
    for ax in axes.flat:  # few ticks read better, and ticks are what drawing spends its time on
        for axis in (ax.xaxis, ax.yaxis):
            axis.set_major_locator(few_ticks(5))
        ax.yaxis.set_label_coords(-0.5 / panel_w, 0.5)
    return axes


def few_ticks(most: int) -> MaxNLocator:
    """At most so many ticks, at round numbers."""
    return MaxNLocator(most, steps=[1, 2, 2.5, 5, 10])


def logarithmic(ax: Axes, axis: Axis) -> None:
    """Logarithmic axis with plain numbers; over more than two decades only powers of ten have one.

    Over less than a factor of `LINEAR_TICKS_RATIO` round numbers have one, as on a linear axis.
    """
    (ax.set_xscale if axis is ax.xaxis else ax.set_yscale)("log")
    low, high = axis.get_view_interval()
    few = high / low > 100.0
    if high / low < LINEAR_TICKS_RATIO:
        axis.set_major_locator(few_ticks(5))
        axis.set_minor_locator(NullLocator())
    else:
        axis.set_major_locator(LogLocator(subs=(1.0,) if few else (1.0, 2.0, 5.0), numticks=12))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


def take_power(axis: Axis) -> int:
    """Take a power of ten out of an axis whose numbers are large or small, once its limits stand.

    A logarithmic axis keeps its powers at the ticks, as words: mathematical text is switched off.

    Returns
    -------
    int
        The power, which belongs into the label; 0 where the numbers stay as they are.
    """
    if axis.get_scale() == "log":
        axis.set_major_formatter(lambda value, _: decade_text(value))
        axis.set_minor_formatter(NullFormatter())
        return 0
    power = power_of(np.array(axis.get_view_interval()))
    formatter = ScalarFormatter(useOffset=False)
    formatter.set_scientific(power != 0)
    formatter.set_powerlimits((power, power))
    axis.set_major_formatter(formatter)
    axis.get_offset_text().set_visible(False)
    return power


def decade_text(value: float) -> str:
    """Tick of a logarithmic axis.

    Examples
    --------
    >>> decade_text(0.01), decade_text(1000.0), decade_text(1e-5), decade_text(2e6)
    ('0.01', '1000', '10⁻⁵', '2 × 10⁶')
    """
    power = math.floor(math.log10(value) + 1e-9)
    if -3 < power < 5:
        return f"{value:g}"
    factor = round(value / 10.0**power)
    return ("" if factor == 1 else f"{factor} × ") + f"10{power_text(power)}"


def power_of(values: Floats) -> int:
    """Power of ten that goes into the unit of these numbers; 0 for numbers of ordinary size.

    Examples
    --------
    >>> power_of(np.array([0.0, 4e-4])), power_of(np.array([-20.0, 3.0])), power_of(np.array([2e8]))
    (-4, 0, 8)
    """
    size = float(np.max(np.abs(values), initial=0.0))
    power = math.floor(math.log10(size)) if size > 0 else 0
    return 0 if -3 < power < 4 else power


def in_units_of(power: int, unit: str) -> str:
    """Unit with a power of ten before it: ``10⁸ Pa``; 1 for a pure number."""
    factor = f"10{power_text(power)}" if power else ""
    return " ".join(x for x in (factor, unit_label(unit)) if x) or "1"


def axis_label(channel: Channel, power: int = 0) -> str:
    """Name, symbol and unit of a channel; `power` is the power of ten that was taken out of the numbers."""
    return f"{channel.name} {channel.symbol} [{in_units_of(power, channel.unit)}]"


def temperature_label(record: RecordContent) -> str:
    """Label of a temperature axis."""
    return f"temperature T [{unit_label(record.temperature_unit)}]"


def heading(figure: Figure, title: str, note: str) -> None:
    """Write a title at the upper left; a note turns it red."""
    room = int(figure.get_figwidth() / 0.092) - (len(note) + 3 if note else 0)
    text = f"{abridged(title, max(room, 20))}   {note}".rstrip()
    figure.text(
        0.1 / figure.get_figwidth(), 1.0 - 0.08 / figure.get_figheight(), text, va="top", fontsize=9.5,
        fontweight="bold", color=WARNING if note else INK,
    )  # fmt: skip


def unconverged_note(records: Iterable[RecordContent]) -> str:
    """Warning that names the branches that did not converge; empty if all did."""
    names = [r.branch for r in records if not r.converged]
    return f"NOT CONVERGED: {' and '.join(names)}" if names else ""


def remark(ax: Axes, text: str, colour: str) -> None:
    """Write a few small words into the upper right of a panel."""
    ax.text(
        0.98, 0.985, text, transform=ax.transAxes, ha="right", va="top", fontsize=6.0, style="italic", color=colour,
        zorder=6, bbox={"facecolor": "white", "alpha": 0.7, "edgecolor": "none", "pad": 0.8},
    )  # fmt: skip


def with_margin(low: float, high: float, share: float = 0.0) -> tuple[float, float]:
    """Ends of an axis: a share of the range beyond the data, and room where these are equal to rounding."""
    margin = max(share * (high - low), 1e-9 * max(abs(low), abs(high))) or 1e-9
    return low - margin, high + margin


def branch_legend(figure: Figure, branches: Iterable[str]) -> None:
    """Legend in the upper right corner: the colour of each branch."""
    handles = [dot_handle(COLOURS[b], b) for b in dict.fromkeys(branches)]
    figure.legend(handles=handles, loc="upper right", ncols=len(handles), bbox_to_anchor=(1.0, 1.0))


def dot_handle(colour: str, label: str, *, hollow: bool = False) -> Line2D:
    """Entry of a legend for points."""
    face = "white" if hollow else colour
    return Line2D([], [], marker="o", ms=4, ls="none", mfc=face, mec=colour, label=label)


def numbered(stem: str, number: int) -> str:
    """Name of the files of a part; the first has no number.

    Examples
    --------
    >>> numbered("parameters", 1), numbered("parameters", 2)
    ('parameters', 'parameters-2')
    """
    return stem if number == 1 else f"{stem}-{number}"


def abridged(text: str, longest: int = 34) -> str:
    """Text with its middle left out where it is too long for a label."""
    if len(text) <= longest:
        return text
    half = (longest - 1) // 2
    return f"{text[:half]}…{text[-half:]}"


def wrapped(text: str, letters: int, lines: int) -> str:
    """Text in lines of so many letters, with its middle left out where it needs more lines.

    Examples
    --------
    >>> wrapped("spring 2, load 150 g, second day", 18, 2).splitlines()
    ['spring 2, load 150', 'g, second day']
    """
    longest = min(len(text), letters * lines)
    while len(parts := textwrap.wrap(abridged(text, longest), letters)) > lines:
        longest -= 1
    return "\n".join(parts)


def label_width(names: Iterable[str]) -> float:
    """Room for the longest of these labels [inch]."""
    return 0.25 + 0.062 * max((len(abridged(n)) for n in names), default=0)


def name_rows(ax: Axes, names: Sequence[str], *, labelled: bool) -> None:
    """Give each name a row of an axis, the first on top, every other one shaded."""
    ax.set_ylim(len(names) - 0.4, -0.6)
    ax.set_yticks(range(len(names)), [abridged(n) for n in names] if labelled else [""] * len(names))
    ax.yaxis.set_tick_params(length=0)
    for place in range(1, len(names), 2):
        ax.axhspan(place - 0.5, place + 0.5, color="#f4f5f6", lw=0, zorder=-1)


def as_columns(header: Sequence[str], rows: Sequence[Sequence[Any]]) -> dict[str, Any]:
    """Columns of rows; None becomes an empty cell."""
    if not rows:
        return {name: [] for name in header}
    cells = zip(*rows, strict=True)
    return {name: [or_nan(v) for v in column] for name, column in zip(header, cells, strict=True)}
