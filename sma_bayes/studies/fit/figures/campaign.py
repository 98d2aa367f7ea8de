"""Figures of a campaign: correlation factors, parameters, convergence, printed values of the paper."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Any, Final

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sma_bayes.report.content import (
    PAPER_CORRELATION,
    Content,
    Estimate,
    ParameterResult,
    PrintedComparison,
    RecordContent,
    parameters_by_channel,
)
from sma_bayes.report.figures.sheet import (
    COLOURS,
    FAINT,
    INK,
    WARNING,
    Drawing,
    as_columns,
    dot_handle,
    empty_sheet,
    few_ticks,
    in_units_of,
    label_width,
    name_rows,
    numbered,
    panels,
    take_power,
)
from sma_bayes.sampling.convergence import Target

LOGARITHMIC_ESS_RATIO: Final = 20.0
"""Greatest effective sample size over the target from which its axis is logarithmic."""

HALF_A_TICK: Final = 0.25
"""Room for half of a number at the right end of an axis [inch]."""

LEAST_CORRELATION_SPAN: Final = 1e-6
"""Least width of an axis of correlation factors: those of a computed curve are all one."""


def correlation_figure(content: Content) -> Drawing:
    """Correlation factors of all records with their intervals."""
    channels = [c for c in content.channels if any(_agreement(r, c.channel) for r in content.records)]
    figure, axes = _list_sheet(content.records, len(channels), top=0.35, bottom=0.75)
    rows: list[tuple[Any, ...]] = []
    for ax, channel in zip(axes, channels, strict=True):
        seen: list[float] = []
        for place, r in enumerate(content.records):
            found = _agreement(r, channel.channel)
            if found is None:
                continue
            for offset, which, estimate in ((-0.15, "measured", found[0]), (0.2, "replicated", found[1])):
                colour = COLOURS[r.branch] if which == "measured" else FAINT
                _whisker(ax, estimate, place + offset, colour, r.converged)
                seen += [v for v in (estimate.q05, estimate.q95) if v is not None]
                rows.append(
                    (r.key, r.converged, channel.name, which, estimate.q05, estimate.median, estimate.q95)
                )
        _correlation_axis(ax, seen, channel.name)
    figure.legend(
        handles=[
            *(dot_handle(c, f"{name}, measured data") for name, c in COLOURS.items()),
            dot_handle(FAINT, "replicated data"),
        ],
        loc="lower center", ncols=3, borderaxespad=0.1,
    )  # fmt: skip
    return Drawing(
        stem="correlation",
        caption=(
            "Correlation factor r of each record: median and equal-tailed 90 % credible interval, for the measured "
            "data and for data replicated from the posterior. The paper states 0.95 as its average."
            + _open_note(content.records)
        ),
        alt="correlation factors of all records with 90 % intervals",
        figure=figure,
        data=as_columns(
            ("record", "converged", "channel", "data", "r_q05 [1]", "r_median [1]", "r_q95 [1]"), rows
        ),
    )


def _correlation_axis(ax: Axes, seen: Sequence[float], name: str) -> None:
    low = min(seen, default=0.9)
    ax.set_title(f"r of {name}")
    ax.set_xlabel("r [1]")
    if low < 0.985:
        ax.axvline(PAPER_CORRELATION, color=INK, lw=0.8, ls="--", zorder=0)
        ax.set_xlim(min(low, PAPER_CORRELATION) - 0.005, 1.002)
        ax.text(
            PAPER_CORRELATION,
            1.0,
            "0.95 ",
            transform=ax.get_xaxis_transform(),
            fontsize=6,
            ha="right",
            va="top",
        )
    else:
        span = max(1.0 - low, LEAST_CORRELATION_SPAN)
        ax.set_xlim(low - 0.06 * span, 1.0 + 0.06 * span)
        ax.set_xlabel("r [1]; 0.95 lies left of the axis")
    ax.xaxis.set_major_locator(few_ticks(4))


def parameter_figure(content: Content, number: int = 1) -> Drawing:
    """Every parameter of the response by condition and branch.

    Parameters
    ----------
    content : Content
        With the same units in all records, see `Content.by_units`.
    number : int
        Which of the parts it is, for the name of the file.
    """
    lines = parameters_by_channel(content.records)
    columns = max(len(names) for names in lines.values())
    sheet_rows = len(lines)
    conditions = content.conditions
    tall = 0.55 + 0.26 * len(conditions)
    left = label_width(conditions)
    figure = empty_sheet(left + 1.85 * columns + HALF_A_TICK, 0.75 + (tall + 0.45) * sheet_rows)
    axes = panels(
        figure,
        sheet_rows,
        columns,
        left=left,
        right=HALF_A_TICK,
        bottom=0.75,
        top=0.3,
        gap_x=0.15,
        gap_y=0.75,
    )
    rows: list[tuple[Any, ...]] = []
    for name, ax in (
        pair
        for names, line in zip(lines.values(), axes, strict=True)
        for pair in zip(names, line, strict=False)
    ):
        unit = ""
        for place, r, p in _places(content, name):
            unit = p.unit
            offset = -0.14 if r.branch == "heating" else 0.14
            _whisker(ax, p.estimate, place + offset, COLOURS[r.branch], r.converged, hollow=not p.identified)
            rows.append((r.condition, r.branch, r.converged, name, p.unit, p.estimate.q05, p.estimate.median,
                         p.estimate.q95, p.identified))  # fmt: skip
        _condition_axis(ax, conditions, labelled=ax in axes[:, 0])
        ax.set_title(f"{name} [{in_units_of(take_power(ax.xaxis), unit)}]")
    for names, line in zip(lines.values(), axes, strict=True):
        for ax in line[len(names) :]:
            ax.remove()
    handles = [dot_handle(c, name) for name, c in COLOURS.items()]
    handles.append(dot_handle("#555555", "hollow: not identified by the data", hollow=True))
    figure.legend(handles=handles, loc="lower center", ncols=3, borderaxespad=0.2)
    header = (
        "condition",
        "branch",
        "converged",
        "parameter",
        "unit",
        "q05 [unit]",
        "median [unit]",
        "q95 [unit]",
    )
    return Drawing(
        stem=numbered("parameters", number),
        caption=(
            "Parameters by condition and branch: posterior median and equal-tailed 90 % credible interval; where the "
            "interval is narrower than the point, the point hides it." + _open_note(content.records)
        ),
        alt=f"posterior medians and intervals of {', '.join(names)} for all conditions",
        figure=figure,
        data=as_columns((*header, "identified"), rows),
    )


def diagnostics_figure(content: Content) -> Drawing:
    """R-hat and effective sample size of every parameter of every record."""
    target = Target()
    figure, (rhat, ess) = _list_sheet(content.records, 2, top=0.35, bottom=0.5)
    rows: list[tuple[Any, ...]] = []
    spots: dict[str, list[tuple[float, float, str]]] = {"rhat": [], "ess": []}
    for place, r in enumerate(content.records):
        for p in r.parameters:
            if p.fixed:
                continue
            colour = COLOURS[r.branch] if r.converged else WARNING
            spots["rhat"] += [(p.rhat, place, colour)] if p.rhat is not None else []
            for value, offset in ((p.ess_bulk, -0.14), (p.ess_tail, 0.14)):
                spots["ess"] += [(value, place + offset, colour)] if value is not None else []
            rows.append((r.key, r.converged, p.name, p.rhat, p.ess_bulk, p.ess_tail))
    for ax, name in ((rhat, "rhat"), (ess, "ess")):
        if spots[name]:
            x, y, colours = zip(*spots[name], strict=True)
            ax.scatter(x, y, s=9, c=colours, alpha=0.6, linewidths=0)
    rhat.axvline(target.rhat, color=INK, lw=0.8, ls="--", zorder=0)
    ess.axvline(target.ess, color=INK, lw=0.8, ls="--", zorder=0)
    known = [v for _, _, _, v, *_ in rows if v is not None]
    rhat.set_xlim(0.999, max([target.rhat, *known]) + 0.1 * (max([target.rhat, *known]) - 0.999))
    enough = [v for v, _, _ in spots["ess"]]
    if max(enough, default=0.0) > LOGARITHMIC_ESS_RATIO * target.ess:
        ess.set_xscale("log")
        take_power(ess.xaxis)
    else:
        ess.set_xlim(0, None)
    rhat.set_title(f"R-hat, at most {target.rhat}")
    ess.set_title(f"Effective sample size, at least {target.ess:.0f}")
    rhat.set_xlabel("R-hat [1]")
    ess.set_xlabel("draws [1]; upper point bulk, lower tail")
    return Drawing(
        stem="diagnostics",
        caption=(
            "Convergence of every sampled parameter: rank-normalised split R-hat across independent ensembles, and "
            "bulk and tail effective sample size. Dashed: the target."
        ),
        alt="R-hat and effective sample sizes of all parameters of all records, with the targets",
        figure=figure,
        data=as_columns(
            ("record", "converged", "parameter", "rhat [1]", "ess_bulk [draws]", "ess_tail [draws]"), rows
        ),
    )


def printed_figure(content: Content) -> Drawing:
    """Printed parameters of the paper beside their posteriors, for the twin campaign."""
    names = tuple(dict.fromkeys(c.parameter for c in content.printed))
    keys = tuple(dict.fromkeys(c.record for c in content.printed))
    left = label_width(keys)
    columns = 3 if len(names) > 4 else len(names)
    sheet_rows = math.ceil(len(names) / columns)
    tall = 0.3 + 0.17 * len(keys)
    figure = empty_sheet(left + 2.2 * columns + HALF_A_TICK, 0.65 + (tall + 0.65) * sheet_rows)
    axes = panels(
        figure, sheet_rows, columns, left=left, right=HALF_A_TICK, bottom=0.8, top=0.3, gap_x=0.2, gap_y=0.6
    )
    rows: list[tuple[Any, ...]] = []
    for ax, name in zip(axes.flat, names, strict=False):
        ax.axvline(0, color=INK, lw=0.8, zorder=0)
        for c in content.printed:
            if c.parameter != name:
                continue
            colour = COLOURS[c.branch] if c.inside else WARNING
            _whisker(ax, _percent_off(c), keys.index(c.record), colour, True, hollow=not c.cell.sound)
            rows.append((c.record, name, c.cell.unit, c.cell.value, c.estimate.q05, c.estimate.median, c.estimate.q95,
                         c.inside, str(c.cell.status)))  # fmt: skip
        ax.set_title(name)
        ax.margins(x=0.08)
        _condition_axis(ax, keys, labelled=list(axes.flat).index(ax) % columns == 0)
    for ax in list(axes.flat)[len(names) :]:
        ax.remove()
    figure.text(0.5, 0.42 / figure.get_figheight(), "posterior less printed value, over printed value [%]",
                ha="center", fontsize=8)  # fmt: skip
    figure.legend(
        handles=[
            *(dot_handle(c, f"{name}, printed value inside") for name, c in COLOURS.items()),
            dot_handle(WARNING, "printed value outside"),
            dot_handle("#555555", "hollow: printed value doubted", hollow=True),
        ],
        loc="lower center", ncols=4, borderaxespad=0.15, columnspacing=1.0,
    )  # fmt: skip
    header = ("record", "parameter", "unit", "printed [unit]", "q05 [unit]", "median [unit]", "q95 [unit]")
    return Drawing(
        stem="printed",
        caption=(
            "Posteriors of the twin relative to the printed values of Tables 3 to 5 from which it was drawn: median "
            "and equal-tailed 90 % credible interval. About one interval in ten should miss zero."
        ),
        alt="relative difference of posterior and printed value for each parameter and record",
        figure=figure,
        data=as_columns((*header, "inside", "status of the printed value"), rows),
    )


def _percent_off(c: PrintedComparison) -> Estimate:
    """Estimate less the printed value, over the printed value [%]."""

    def off(value: float | None) -> float | None:
        return None if value is None else 100.0 * (value - c.cell.value) / abs(c.cell.value)

    return Estimate(off(c.estimate.median), off(c.estimate.q05), off(c.estimate.q95), "%")


def _list_sheet(
    records: Sequence[RecordContent], columns: int, top: float, bottom: float
) -> tuple[Figure, Any]:
    """Panels side by side with a line for each record."""
    keys = [r.key for r in records]
    left = label_width(keys)
    figure = empty_sheet(left + max(2.6 * columns, 4.5) + 0.1, bottom + 0.2 + 0.2 * len(keys) + top)
    axes = panels(figure, 1, columns, left=left, bottom=bottom, top=top, gap_x=0.25)[0]
    for number, ax in enumerate(axes):
        _condition_axis(ax, keys, labelled=number == 0)
    return figure, axes


def _condition_axis(ax: Axes, names: Sequence[str], *, labelled: bool) -> None:
    name_rows(ax, names, labelled=labelled)
    ax.xaxis.set_major_locator(few_ticks(3))


def _whisker(
    ax: Axes, e: Estimate, place: float, colour: str, converged: bool, *, hollow: bool = False
) -> None:
    """Median with its interval; a record that did not converge is a cross without interval."""
    if e.median is None or e.q05 is None or e.q95 is None:
        return
    if not converged:
        ax.plot([e.median], [place], marker="x", ms=4, color=WARNING, ls="none")
        return
    ax.plot([e.q05, e.q95], [place, place], color=colour, lw=1.2, solid_capstyle="butt")
    ax.plot(
        [e.median],
        [place],
        marker="o",
        ms=3.2,
        mfc="white" if hollow else colour,
        mec=colour,
        mew=0.8,
        ls="none",
    )


def _open_note(records: Iterable[RecordContent]) -> str:
    return " A cross marks a record that did not converge." if any(not r.converged for r in records) else ""


def _places(content: Content, name: str) -> Iterator[tuple[int, RecordContent, ParameterResult]]:
    """Records that have a parameter, with the number of their condition."""
    for place, condition in enumerate(content.conditions):
        for r in content.branches(condition):
            for p in r.parameters:
                if p.name == name:
                    yield place, r, p


def _agreement(r: RecordContent, channel: str) -> tuple[Estimate, Estimate] | None:
    found = r.channel(channel)
    if found is None or "r" not in found.measured or "r" not in found.replicated:
        return None
    return found.measured["r"], found.replicated["r"]
