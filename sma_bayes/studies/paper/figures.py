"""Figures of the page that reproduces the paper, in the order of its own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from sma_bayes.arrays import Floats
from sma_bayes.paper.tables import CellStatus
from sma_bayes.report.figures.sheet import (
    COLOURS,
    FAINT,
    INK,
    WARNING,
    Drawing,
    as_columns,
    dot_handle,
    empty_sheet,
    label_width,
    name_rows,
    panels,
)
from sma_bayes.runs.schema import IntervalDocument
from sma_bayes.studies.compare.figures.models import LOOKS
from sma_bayes.studies.compare.words import short
from sma_bayes.studies.paper.schema import ReproducedEntry

ARBITRARY_AXIS: Final = "temperature [arbitrary unit]"
STIFFNESS_AXIS: Final = "stiffness K [N/m]"
SIGMOID: Final = "modified_sigmoid"
LINEAR: Final = 2.0
"""Difference up to which the axis of `nearest_figure` is linear [N/m]."""
LEVELS: Final = (-50.0, -10.0, -2.0, 0.0, 2.0, 10.0, 50.0)
"""Its ticks [N/m]."""
DECADES: Final = (2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1000.0)
"""Ticks of `extremes_figure` [N/m]."""


@dataclass(frozen=True, slots=True, eq=False)
class BandedCurve:
    """A curve with its 90 % band.

    Attributes
    ----------
    temperature, low, middle, high : ndarray, shape (m,)
        [unit of temperature], [N/m].
    """

    temperature: Floats
    low: Floats
    middle: Floats
    high: Floats


@dataclass(frozen=True, slots=True, eq=False)
class Profile:
    """One branch of one condition.

    Attributes
    ----------
    title, branch : str
        Title of the condition, as the paper names it.
    temperature, stiffness : ndarray, shape (n,)
        Samples [unit of temperature], [N/m].
    curves : mapping of str to BandedCurve
        By the name of the model.
    extremes : tuple of float
        Least and greatest stiffness that the paper prints for the condition [N/m]; empty where it prints none.
    """

    title: str
    branch: str
    temperature: Floats
    stiffness: Floats
    curves: Mapping[str, BandedCurve]
    extremes: tuple[float, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Operation:
    """One branch at one operating condition, as Figs. 15, 16 and 18 show it.

    Attributes
    ----------
    setting, branch : str
        What was set, such as ``1.5 A``.
    path : BandedCurve
        Force [N] over displacement [cm]; its `temperature` is the displacement.
    stiffness : BandedCurve
    """

    setting: str
    branch: str
    path: BandedCurve
    stiffness: BandedCurve


def operation_figure(stem: str, numbers: str, found: Sequence[Operation]) -> Drawing:
    """Force over displacement, and stiffness against temperature, of several settings: Figs. 15, 16 and 18.

    Parameters
    ----------
    stem, numbers : str
        Of the file; of the paper's figure.
    found : sequence of Operation
    """
    figure = empty_sheet(8.4, 3.3)
    axes = panels(figure, 1, 2, left=0.75, bottom=0.85, top=0.3, gap_x=0.85)[0]
    settings = list(dict.fromkeys(o.setting for o in found))
    colours = dict(zip(settings, colormaps["viridis"](np.linspace(0.0, 0.8, len(settings))), strict=True))
    rows: list[tuple[Any, ...]] = []
    for o in found:
        style = "-" if o.branch == "heating" else "--"
        for ax, curve, what in ((axes[0], o.path, "force"), (axes[1], o.stiffness, "stiffness")):
            _band(ax, curve, colours[o.setting], style)
            rows += [
                (o.setting, o.branch, what, *values)
                for values in zip(curve.temperature, curve.low, curve.middle, curve.high, strict=True)
            ]
    axes[0].set(xlabel="displacement [cm]", ylabel="force [N]", title="(a) force over displacement")
    axes[1].set(
        xlabel=ARBITRARY_AXIS,
        ylabel=STIFFNESS_AXIS,
        title="(b) stiffness against temperature",
        ylim=(0.0, None),
    )
    handles = [
        *(Line2D([], [], color=colours[s], label=s) for s in settings),
        *(Line2D([], [], color=INK, ls=s, label=b) for b, s in (("heating", "-"), ("cooling", "--"))),
    ]
    figure.legend(handles=handles, loc="lower center", ncols=len(handles), borderaxespad=0.2)
    return Drawing(
        stem=stem,
        caption=(
            f"As {numbers}: force over displacement and stiffness against temperature of the twin; posteriors of Eqs. "
            "(2), (4) and (7), medians and pointwise 90 % bands, most of them narrower than their line. The twin has "
            "the range of temperatures that was assumed for it, the measured figure another."
        ),
        alt=f"force over displacement and stiffness against temperature for {', '.join(settings)}, with bands",
        figure=figure,
        data=as_columns(("setting", "branch", "channel", "x", "q05", "q50", "q95"), rows),
    )


def duty_cycle_figure(points: Sequence[Mapping[str, float]], error: Mapping[str, float]) -> Drawing:
    """Least and greatest stiffness by duty cycle with the scatter of a test: what is left of Fig. 17.

    Parameters
    ----------
    points : sequence of mapping of str to float
        ``duty_cycle`` [1], ``temperature_min`` and ``temperature_max`` [degC], ``stiffness_min`` and
        ``stiffness_max`` [N/m].
    error : mapping of str to float
        Half the 90 % interval of one test, of ``stiffness_min`` and ``stiffness_max`` [N/m].
    """
    figure = empty_sheet(5.2, 3.2)
    ax = panels(figure, 1, 1, left=0.75, bottom=0.85, top=0.3)[0][0]
    colours = colormaps["viridis"](np.linspace(0.0, 0.8, len(points)))
    rows = []
    for p, colour in zip(points, colours, strict=True):
        t, k = ([p[f"{name}_{end}"] for end in ("min", "max")] for name in ("temperature", "stiffness"))
        sd = [error[f"stiffness_{end}"] for end in ("min", "max")]
        ax.plot(t, k, color=colour, lw=0.6, ls=":")
        ax.errorbar(
            t, k, yerr=sd, fmt="o", ms=3.5, lw=1.0, color=colour, label=f"{p['duty_cycle']:.0%}".replace("%", " %")
        )  # fmt: skip
        rows += [(p["duty_cycle"], *values) for values in zip(t, k, sd, strict=True)]
    ax.set(xlabel="temperature [°C]", ylabel=STIFFNESS_AXIS, ylim=(0.0, None))
    handles, labels = ax.get_legend_handles_labels()
    figure.legend(handles, labels, loc="lower center", ncols=len(points), borderaxespad=0.2)
    return Drawing(
        stem="fig-17",
        caption=(
            "What Table 11 leaves of Fig. 17: least and greatest stiffness at three duty cycles, printed, with the "
            "90 % interval of one test, whose scatter is that of the test at 2 A that was run twice (Student t, one "
            "degree of freedom). No curve is printed; the dotted lines only join the points."
        ),
        alt="printed least and greatest stiffness at duty cycles of 40, 60 and 80 %, with intervals",
        figure=figure,
        data=as_columns(("duty_cycle", "temperature_degC", "stiffness_N_m", "half_interval"), rows),
    )


def profile_figure(stem: str, numbers: str, profiles: Sequence[Profile]) -> Drawing:
    """Samples and bands of Eq. (7), a panel for each condition: Figs. 6 to 8.

    Parameters
    ----------
    stem, numbers : str
        Of the file; of the paper's figure.
    profiles : sequence of Profile
    """
    figure, axes, titles = _sheet(profiles)
    for ax, title in zip(axes, titles, strict=True):
        chosen = [p for p in profiles if p.title == title]
        for p in chosen:
            _samples(ax, p, COLOURS[p.branch])
            _band(ax, p.curves[SIGMOID], COLOURS[p.branch], "-")
        for value in chosen[0].extremes:
            ax.axhline(value, color=INK, lw=0.8, ls="--", zorder=1)
        ax.set(title=title, ylim=(0.0, None))
    handles = [Line2D([], [], color=c, label=f"{b}: median and 90 % band") for b, c in COLOURS.items()]
    handles.append(dot_handle(FAINT, "samples of the twin"))
    if any(p.extremes for p in profiles):
        handles.append(Line2D([], [], color=INK, ls="--", lw=0.8, label="printed least and greatest"))
    figure.legend(handles=handles, loc="lower center", ncols=4, borderaxespad=0.2)
    printed = " Dashed: the extremes that Tables 9 and 10 print." if len(handles) > 3 else ""
    return Drawing(
        stem=stem,
        caption=(
            f"As {numbers}: stiffness of the twin and the posterior of Eq. (7), median and pointwise 90 % band."
            f"{printed}"
        ),
        alt=f"stiffness against temperature for {', '.join(titles)}, heating and cooling, with bands",
        figure=figure,
        data=_columns(profiles),
    )


def rival_figure(stem: str, numbers: str, rival: str, profiles: Sequence[Profile]) -> Drawing:
    """Eq. (7) and a rival on the same samples, a panel for each condition: Figs. 9 to 14.

    Parameters
    ----------
    stem, numbers : str
        Of the file; of the paper's figures.
    rival : str
        Name of the other model.
    profiles : sequence of Profile
    """
    figure, axes, titles = _sheet(profiles)
    for ax, title in zip(axes, titles, strict=True):
        for p in (p for p in profiles if p.title == title):
            _samples(ax, p, FAINT)
            for model in (SIGMOID, rival):
                style = "-" if p.branch == "heating" else "--"
                _band(ax, p.curves[model], LOOKS[model][0], style)
        ax.set(title=title, ylim=(0.0, None))
    handles = [
        *(Line2D([], [], color=LOOKS[m][0], label=short(m)) for m in (SIGMOID, rival)),
        *(Line2D([], [], color=INK, ls=s, label=b) for b, s in (("heating", "-"), ("cooling", "--"))),
        dot_handle(FAINT, "samples of the twin"),
    ]
    figure.legend(handles=handles, loc="lower center", ncols=5, borderaxespad=0.2)
    return Drawing(
        stem=stem,
        caption=(
            f"As {numbers}: stiffness of the twin with the posteriors of Eq. (7) and of the "
            f"{short(rival).split(',')[0]}, all parameters inferred; medians and pointwise 90 % bands."
        ),
        alt=f"stiffness of {', '.join(titles)} with the curves of the modified sigmoid and of the {short(rival)}",
        figure=figure,
        data=_columns(profiles),
    )


@dataclass(frozen=True, slots=True, eq=False)
class NearestRivals:
    """A published curve over the printed range of stiffness, and what is nearest to it.

    Attributes
    ----------
    title : str
    temperature : ndarray, shape (m,)
        [arbitrary].
    published, logistic, line : ndarray, shape (m,)
        [N/m].
    rmse : float or None
        Printed [N/m].
    """

    title: str
    temperature: Floats
    published: Floats
    logistic: Floats
    line: Floats
    rmse: float | None


def nearest_figure(found: Sequence[NearestRivals]) -> Drawing:
    """Published curves with the logistic and the line that are nearest to them: what is left over."""
    columns = 4
    rows = -(-len(found) // columns)
    figure = empty_sheet(8.4, 0.9 + 1.55 * rows)
    axes = panels(figure, rows, columns, left=0.75, right=0.1, bottom=0.75, top=0.3, gap_x=0.15, gap_y=0.5)
    lines: list[tuple[Any, ...]] = []
    reach = max(float(np.abs(n.line - n.published).max()) for n in found)
    for place, n in enumerate(found):
        ax = axes.flat[place]
        ax.axhline(0.0, color=LOOKS[SIGMOID][0], lw=1.2)
        if n.rmse is not None:
            ax.axhspan(-n.rmse, n.rmse, color=LOOKS[SIGMOID][0], alpha=0.18, lw=0)
        for name, values in (("logistic_refitted", n.logistic), ("polynomial_corrected", n.line)):
            ax.plot(n.temperature, values - n.published, color=LOOKS[name][0], lw=1.1)
        ax.set_title(n.title, fontsize=7.0)
        ax.set_yscale("symlog", linthresh=LINEAR)
        ax.set_ylim(-1.15 * reach, 1.15 * reach)
        shown = [t for t in LEVELS if abs(t) <= 1.15 * reach]
        ax.set_yticks(shown, [f"{t:g}".replace("-", "−") if place % columns == 0 else "" for t in shown])
        ax.minorticks_off()
        if place % columns == 0:
            ax.set_ylabel("less Eq. (7) [N/m]")
        if place >= len(found) - columns:
            ax.set_xlabel(ARBITRARY_AXIS, fontsize=7.0)
        step = max(1, n.temperature.size // 40)
        lines += [
            (n.title, *values)
            for values in zip(
                n.temperature[::step], n.published[::step], n.logistic[::step], n.line[::step], strict=True
            )
        ]
    for ax in list(axes.flat)[len(found) :]:
        ax.remove()
    sigmoid = LOOKS[SIGMOID][0]
    figure.legend(
        handles=[
            Line2D([], [], color=sigmoid, label="Eq. (7) as published"),
            Patch(color=sigmoid, alpha=0.18, lw=0, label="± its printed RMSE"),
            Line2D([], [], color=LOOKS["logistic_refitted"][0], label="nearest logistic curve"),
            Line2D([], [], color=LOOKS["polynomial_corrected"][0], label="nearest straight line"),
        ],
        loc="lower center", ncols=4, borderaxespad=0.2,
    )  # fmt: skip
    return Drawing(
        stem="nearest",
        caption=(
            "Over the range of stiffness that Tables 9 and 10 print: the logistic curve and the straight line that are "
            "nearest to the published Eq. (7), less Eq. (7). The shaded band is its printed RMSE; where there is none "
            "it is lost. The axis is linear up to 2 N/m, logarithmic beyond. No twin and no measurement is involved."
        ),
        alt="differences of the nearest logistic curve and straight line from the published curves",
        figure=figure,
        data=as_columns(
            ("record", "temperature [arbitrary]", "eq7 [N/m]", "logistic [N/m]", "line [N/m]"), lines
        ),
    )


@dataclass(frozen=True, slots=True, eq=False)
class Plugged:
    """The logistic of Eqs. (9) and (10) with what the paper plugs in.

    Attributes
    ----------
    title : str
    temperature : ndarray, shape (m,)
        [degC].
    curves : mapping of str to ndarray, shape (m,)
        ``heating, as printed``, ``heating, corrected``, ``cooling`` [N/m].
    """

    title: str
    temperature: Floats
    curves: Mapping[str, Floats]


_PLUGGED_LOOKS: Final = {
    "heating, as printed": (COLOURS["heating"], ":"),
    "heating, corrected": (COLOURS["heating"], "-"),
    "cooling": (COLOURS["cooling"], "-"),
}


def plugged_figure(found: Sequence[Plugged]) -> Drawing:
    """The logistic curves of Figs. 9 to 11 by the printed equations and constants."""
    figure = empty_sheet(8.4, 2.7)
    axes = panels(figure, 1, len(found), left=0.75, right=0.1, bottom=0.8, top=0.3, gap_x=0.35)[0]
    rows: list[tuple[Any, ...]] = []
    for place, (ax, p) in enumerate(zip(axes, found, strict=True)):
        for name, values in p.curves.items():
            colour, style = _PLUGGED_LOOKS[name]
            ax.plot(p.temperature, values, color=colour, ls=style, lw=1.3)
            rows += [(p.title, name, t, v) for t, v in zip(p.temperature, values, strict=True)]
        ax.set(title=p.title, xlabel="temperature [°C]", ylim=(0.0, None))
        if place == 0:
            ax.set_ylabel(STIFFNESS_AXIS)
    figure.legend(
        handles=[Line2D([], [], color=c, ls=s, label=n) for n, (c, s) in _PLUGGED_LOOKS.items()],
        loc="lower center", ncols=3, borderaxespad=0.2,
    )  # fmt: skip
    return Drawing(
        stem="logistic-printed",
        caption=(
            "The logistic of Figs. 9 to 11 by Eqs. (9) and (10) with the printed transformation temperatures and "
            "extremes, over the temperatures that Tables 9 and 10 print. As printed, Eq. (9) is flat."
        ),
        alt="logistic curves by the printed equations, as printed and corrected, for three conditions",
        figure=figure,
        data=as_columns(("condition", "curve", "temperature [degC]", "stiffness [N/m]"), rows),
    )


def extremes_figure(entries: Sequence[ReproducedEntry]) -> Drawing:
    """Printed least and greatest stiffness of Tables 9 to 12 beside those of the twin.

    Parameters
    ----------
    entries : sequence of ReproducedEntry
        Of those tables.
    """
    kinds = ("stiffness_min", "stiffness_max")
    chosen = [(e, e.recomputed) for e in entries if e.quantity in kinds]
    names = list(dict.fromkeys(e.condition for e, _ in chosen))
    left = label_width(names)
    figure = empty_sheet(left + 5.4, 0.95 + 0.22 * len(names))
    axes = panels(figure, 1, 2, left=left, bottom=0.7, top=0.3, gap_x=0.25)[0]
    for ax, kind in zip(axes, kinds, strict=True):
        for e, found in ((e, found) for e, found in chosen if e.quantity == kind):
            place = names.index(e.condition)
            if isinstance(found, IntervalDocument):
                low, middle, high = found.quantiles
                ax.plot([low, high], [place] * 2, color=INK, lw=2.2)
                ax.plot([middle], [place], "o", ms=4, color=INK)
            if e.published is not None:
                colour = WARNING if e.status != CellStatus.OK else LOOKS[SIGMOID][0]
                ax.plot([e.published], [place], "D", ms=5, mfc="white", mec=colour, mew=1.1)
        name_rows(ax, names, labelled=ax is axes[0])
        ax.set_xscale("log")
        low, high = ax.get_xlim()
        shown = [t for t in DECADES if low <= t <= high]
        ax.set_xticks(shown, [f"{t:g}" for t in shown])
        ax.minorticks_off()
        ax.set(title=f"{'least' if kind == kinds[0] else 'greatest'} stiffness", xlabel=STIFFNESS_AXIS)
    figure.legend(
        handles=[
            *(
                Line2D([], [], marker="D", ls="none", ms=5, mfc="white", mec=c, label=text)
                for c, text in ((LOOKS[SIGMOID][0], "printed"), (WARNING, "printed, implausible"))
            ),
            dot_handle(INK, "twin, over the temperatures that it assumes"),
        ],
        loc="lower center", ncols=3, borderaxespad=0.2,
    )  # fmt: skip
    return Drawing(
        stem="extremes",
        caption=(
            "Tables 9 to 12: printed extremes of the stiffness, and those of Eq. (7) with the constants of Tables 3 to "
            "5 over the temperatures that the twin assumes (90 % intervals, mostly narrower than the point). The "
            "stiffness of Table 12 is lost; for Table 11 no constants are printed."
        ),
        alt="printed and recomputed least and greatest stiffness of each condition",
        figure=figure,
        data=as_columns(
            ("table", "condition", "quantity", "printed [N/m]", "q05 [N/m]", "median [N/m]", "q95 [N/m]"),
            [
                (
                    e.table, e.condition, e.quantity, e.published,
                    *((found.q05, found.median, found.q95) if isinstance(found, IntervalDocument) else [None] * 3),
                )
                for e, found in chosen
            ],
        ),
    )  # fmt: skip


def _sheet(profiles: Sequence[Profile]) -> tuple[Figure, Any, list[str]]:
    titles = list(dict.fromkeys(p.title for p in profiles))
    figure = empty_sheet(8.4, 2.9)
    axes = panels(figure, 1, len(titles), left=0.75, right=0.1, bottom=0.8, top=0.3, gap_x=0.35)[0]
    axes[0].set_ylabel(STIFFNESS_AXIS)
    for ax in axes:
        ax.set_xlabel(ARBITRARY_AXIS)
    return figure, axes, titles


def _samples(ax: Axes, p: Profile, colour: str) -> None:
    ax.plot(p.temperature, p.stiffness, "o", ms=2.4, mec="none", mfc=colour, alpha=0.45)


def _band(ax: Axes, curve: BandedCurve, colour: str, style: str) -> None:
    ax.fill_between(curve.temperature, curve.low, curve.high, color=colour, alpha=0.25, lw=0)
    ax.plot(curve.temperature, curve.middle, color=colour, ls=style, lw=1.1)


def _columns(profiles: Sequence[Profile]) -> dict[str, Any]:
    rows = [
        (p.title, p.branch, model, *values)
        for p in profiles
        for model, c in p.curves.items()
        for values in zip(c.temperature, c.low, c.middle, c.high, strict=True)
    ]
    return as_columns(
        ("condition", "branch", "model", "temperature [arbitrary]", "q05 [N/m]", "median [N/m]", "q95 [N/m]"), rows
    )  # fmt: skip
