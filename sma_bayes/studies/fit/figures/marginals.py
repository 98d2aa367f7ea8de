"""Corner plots: marginal and pairwise posteriors with the priors drawn in."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from sma_bayes.arrays import Floats
from sma_bayes.arviz_bridge import arviz
from sma_bayes.parameters.distributions import FAMILIES
from sma_bayes.report.content import (
    ParameterResult,
)
from sma_bayes.report.figures.sheet import (
    INK,
    PRIOR,
    WARNING,
    BranchData,
    Drawing,
    empty_sheet,
    heading,
    in_units_of,
    power_of,
    unconverged_note,
    with_margin,
)


def corner_figure(branch: BranchData) -> Drawing:
    """Marginal and pairwise posteriors of the response's parameters, with their priors."""
    shown = [
        p for p in branch.content.model_parameters if not p.fixed and np.ptp(branch.stored.draws[p.name]) > 0
    ]
    draws = {p.name: branch.stored.draws[p.name].ravel() for p in shown}
    scale = {p.name: power_of(np.quantile(np.abs(draws[p.name]), [0.99])) for p in shown}
    side, left, bottom = 0.92, 0.72, 0.72
    size = left + side * max(len(shown), 3) + 0.12
    figure = empty_sheet(size, size - left + bottom + 0.45)
    height = figure.get_figheight()
    ranges = {n: _range(v) for n, v in draws.items()}
    for i, row in enumerate(shown):
        for j, column in enumerate(shown[: i + 1]):
            at = (left + side * j) / size, (bottom + side * (len(shown) - 1 - i)) / height
            ax = figure.add_axes((*at, 0.9 * side / size, 0.9 * side / height))
            if i == j:
                _marginal(ax, row, draws[row.name], ranges[row.name])
            else:
                _pair(
                    ax,
                    draws[column.name],
                    draws[row.name],
                    ranges[column.name],
                    ranges[row.name],
                    row,
                    column,
                )
            _corner_ticks(ax, column, scale[column.name], "x", i == len(shown) - 1)
            _corner_ticks(ax, row, scale[row.name], "y", j == 0 and i > 0)
            if i == j:
                ax.set_title(row.name, fontsize=7.5, pad=2, color=WARNING if row.prior_driven else INK)
    driven = [p.name for p in shown if p.prior_driven]
    figure.legend(
        handles=[
            Patch(facecolor="#cfd6dd", edgecolor=INK, lw=0.8, label="posterior; inner 50 %, outer 90 %"),
            Line2D([], [], color=PRIOR, lw=1.0, ls="--", label="prior; number: posterior sd over prior sd"),
            *([Patch(color="#fff1d6", label="not identified by the data")] if driven else []),
        ],
        loc="upper right",
        bbox_to_anchor=(1.0, 1.0 - 0.3 / height),
        borderaxespad=0.2,
        fontsize=7,
    )
    heading(figure, branch.content.key, unconverged_note([branch.content]))
    marked = f" Tinted: {', '.join(driven)}, which the data move little." if driven else ""
    return Drawing(
        stem=f"corner-{branch.content.key}",
        caption=(
            f"Posterior of the parameters of {branch.content.key}: histograms with the prior density (dashed) and "
            "regions that hold 50 % and 90 % of the draws. Axes span the posterior; a prior much wider than that runs "
            f"along the bottom.{marked}"
        ),
        alt=f"corner plot of {', '.join(p.name for p in shown)} of {branch.content.key} with prior densities",
        figure=figure,
        data=_corner_data(shown, draws),
    )


def _marginal(ax: Axes, p: ParameterResult, draws: Floats, span: tuple[float, float]) -> None:
    heights, edges = np.histogram(draws, bins=30, range=span, density=True)
    ax.stairs(heights, edges, color="#cfd6dd", fill=True)
    ax.stairs(heights, edges, color=INK, lw=0.8)
    x, density = _prior_line(p, span)
    ax.plot(x, density, color=PRIOR, lw=1.0, ls="--")
    ax.set_xlim(span)
    ax.set_ylim(0.0, 1.12 * max(float(heights.max()), 1e-300))
    if p.contraction is not None:
        share = math.sqrt(max(1.0 - p.contraction, 0.0))
        ax.text(
            0.98, 0.98, f"{share:.1g}", transform=ax.transAxes, ha="right", va="top", fontsize=6, color=PRIOR
        )
    if p.prior_driven:
        ax.set_facecolor("#fff1d6")


def _prior_line(p: ParameterResult, span: tuple[float, float]) -> tuple[Floats, Floats]:
    """Prior density over a range; empty where the prior is not known."""
    x = np.linspace(*span, 101)
    if p.family not in FAMILIES:
        return x[:0], x[:0]
    return x, np.exp(FAMILIES[p.family](**p.numbers).log_density(x))


def _pair(
    ax: Axes,
    x: Floats,
    y: Floats,
    x_range: tuple[float, float],
    y_range: tuple[float, float],
    row: ParameterResult,
    column: ParameterResult,
) -> None:
    arviz()  # corner imports it, too: by its one door first, so that its daily notice is not shown
    import corner

    corner.hist2d(
        x, y, ax=ax, range=[x_range, y_range], bins=24, smooth=0.9, levels=(0.5, 0.9), color=INK,
        plot_datapoints=False, plot_density=False, no_fill_contours=True, fill_contours=True,
        contour_kwargs={"linewidths": 0.6},
        contourf_kwargs={"colors": ["#ffffff00", "#cfd6dd", "#8d99a6"]},
    )  # fmt: skip
    ax.set_xlim(x_range)
    ax.set_ylim(y_range)
    if row.prior_driven or column.prior_driven:
        ax.set_facecolor("#fff1d6")


def _corner_ticks(ax: Axes, p: ParameterResult, power: int, which: str, labelled: bool) -> None:
    axis = ax.xaxis if which == "x" else ax.yaxis
    if not labelled:
        axis.set_visible(False)
        return
    axis.set_major_locator(MaxNLocator(2, min_n_ticks=2, prune=None))
    axis.set_major_formatter(lambda value, _: f"{value / 10.0**power:.7g}".replace("-", "−"))
    axis.set_tick_params(labelsize=6, rotation=45 if which == "x" else 0, length=2)
    scale = in_units_of(power, p.unit).replace("arbitrary unit", "arb. unit")
    label = f"{p.name}\n[{scale}]"
    if which == "x":
        ax.set_xlabel(label, fontsize=7)
        axis.set_label_coords(0.5, -0.42)
    else:
        ax.set_ylabel(label, fontsize=7)
        axis.set_label_coords(-0.47, 0.5)


def _corner_data(shown: Sequence[ParameterResult], draws: Mapping[str, Floats]) -> dict[str, Any]:
    count = next(iter(draws.values())).size if draws else 0
    lines = {p.name: _prior_line(p, _range(draws[p.name])) for p in shown}
    length = max((x.size for x, _ in lines.values()), default=0)
    what = ["posterior draw"] * count + ["prior, value"] * length + ["prior, density"] * length
    data: dict[str, Any] = {"what": what}
    for p in shown:
        x, density = lines[p.name]
        pad = np.full(length - x.size, np.nan)
        data[f"{p.name} [{p.unit}]"] = np.concatenate([draws[p.name], x, pad, density, pad])
    return data


def _range(draws: Floats) -> tuple[float, float]:
    """Range that shows nearly all draws, a little wider than their central 99 %, and wide enough to be divided."""
    low, high = np.quantile(draws, (0.005, 0.995)).tolist()
    return with_margin(low, high, 0.12)
