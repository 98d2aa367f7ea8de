"""Figures of a record: traces, predictive intervals before and after the data, residuals."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes

from sma_bayes.arrays import Floats
from sma_bayes.report.content import (
    ParameterResult,
)
from sma_bayes.report.figures.sheet import (
    COLOURS,
    FAINT,
    INK,
    PRIOR,
    RASTER_ABOVE_POINTS,
    BranchData,
    Drawing,
    as_columns,
    axis_label,
    dot_handle,
    empty_sheet,
    heading,
    label_width,
    panels,
    remark,
    take_power,
    temperature_label,
    unconverged_note,
)

ENSEMBLES: Final = ("#1f6fb2", "#c8501e", "#2a8a57", "#8a6d1f", "#6a3d9a", "#555555")


INFINITE: Final = 1e300
"""Stands for infinity in prior curves, whose far tails overflow."""


def trace_figure(branch: BranchData) -> Drawing:
    """Kept draws of every parameter in their order, and their autocorrelation."""
    shown = [p for p in branch.content.parameters if not p.fixed and np.ptp(branch.stored.draws[p.name]) > 0]
    draws = {p.name: branch.stored.draws[p.name] for p in shown}
    height = 0.9 + 0.42 * max(len(shown), 2)
    figure = empty_sheet(8.6, height)
    note = unconverged_note([branch.content])
    trace, memory = panels(
        figure,
        1,
        2,
        left=max(1.15, label_width(draws)),
        right=0.15,
        bottom=0.5,
        top=0.45,
        gap_x=0.35,
        ratio=(2, 1),
    )[0]
    lags = {name: _autocorrelation(d) for name, d in draws.items()}
    for lane, (name, d) in enumerate(draws.items()):
        base = len(draws) - 1 - lane
        z = (d - d.mean()) / (9.0 * d.std())
        for g, (series, rho) in enumerate(zip(z, lags[name], strict=True)):
            colour = ENSEMBLES[g % len(ENSEMBLES)]
            trace.plot(np.arange(series.size), base + series, color=colour, lw=0.35, antialiased=False)
            memory.plot(np.arange(rho.size), base + 0.45 * rho, color=colour, lw=0.8, alpha=0.9)
        noise = 0.45 * 1.96 / math.sqrt(d.shape[1])
        memory.axhspan(base - noise, base + noise, color="#e4e4e4", lw=0, zorder=0)
    for ax, label, title in (
        (trace, "kept draw", "Draws, each lane mean ± 4.5 sd"),
        (memory, "lag [kept draws]", "Autocorrelation, each lane −1 to 1"),
    ):
        ax.set_ylim(-0.55, len(draws) - 0.45)
        ax.set_yticks(range(len(draws)), list(reversed(draws)) if ax is trace else [""] * len(draws))
        ax.set_xlabel(label)
        ax.set_title(title, fontsize=8)
    trace.margins(x=0.01)
    memory.set_xlim(0, None)
    heading(figure, branch.content.key, note)
    return Drawing(
        stem=f"trace-{branch.content.key}",
        caption=(
            f"Draws of {branch.content.key} that were kept, a colour for each independent ensemble with its walkers "
            "joined end to end, and their autocorrelation; grey: 95 % range of it for independent draws. Lanes that "
            "drift or differ by colour would mean that the ensembles disagree."
        ),
        alt=f"traces and autocorrelation of {', '.join(draws)} of {branch.content.key}",
        figure=figure,
        data=_trace_data(shown, draws, lags),
    )


def _autocorrelation(draws: Floats, lags: int = 40) -> Floats:
    """Autocorrelation of each ensemble (G, N) up to a lag, shape (G, lags + 1)."""
    centred = draws - draws.mean(axis=1, keepdims=True)
    n = draws.shape[1]
    spectrum = np.fft.rfft(centred, n=2 * n, axis=1)
    covariance = np.fft.irfft(np.abs(spectrum) ** 2, axis=1)[:, : min(lags + 1, n)]
    variance = covariance[:, :1]  # nought where a chain never moved: it is correlated with itself for ever
    return np.divide(covariance, variance, out=np.ones_like(covariance), where=variance > 0.0)


def _trace_data(
    shown: Sequence[ParameterResult], draws: Mapping[str, Floats], lags: Mapping[str, Floats]
) -> dict[str, Any]:
    if not shown:
        return {"what": []}
    groups, n = next(iter(draws.values())).shape
    m = next(iter(lags.values())).shape[1]
    return {
        "what": ["draw"] * (groups * n) + ["autocorrelation [1]"] * (groups * m),
        "ensemble": np.concatenate([np.repeat(np.arange(groups), n), np.repeat(np.arange(groups), m)]),
        "draw or lag": np.concatenate([np.tile(np.arange(n), groups), np.tile(np.arange(m), groups)]),
        **{f"{p.name} [{p.unit}]": np.concatenate([draws[p.name].ravel(), lags[p.name].ravel()]) for p in shown},
    }  # fmt: skip


def predictive_figure(branch: BranchData) -> Drawing:
    """What prior and posterior lead one to expect, beside what was measured."""
    content, stored = branch.content, branch.stored
    channels = [c for c in content.channels if c.observed]
    figure = empty_sheet(7.4, 0.95 + 2.0 * len(channels))
    axes = panels(figure, len(channels), 2, left=0.7, right=0.1, bottom=0.75, top=0.5, gap_x=0.75, gap_y=0.35)
    colour = COLOURS[content.branch]
    rows: list[tuple[Any, ...]] = []
    for (before, after), channel in zip(axes, channels, strict=True):
        grid = stored.prior_temperature
        finite = np.clip(stored.prior_curves[channel.channel], -INFINITE, INFINITE)
        prior = np.quantile(finite, (0.05, 0.25, 0.5, 0.75, 0.95), axis=0)
        band = branch.bands[channel.channel]
        q = band.quantiles
        inside = ~band.extrapolated
        t = band.temperature[inside]
        before.fill_between(grid, prior[0], prior[4], color=PRIOR, alpha=0.18, lw=0)
        before.fill_between(grid, prior[1], prior[3], color=PRIOR, alpha=0.3, lw=0)
        before.plot(grid, prior[2], color=PRIOR, lw=1.0)
        after.fill_between(t, q["pred_q05"][inside], q["pred_q95"][inside], color=colour, alpha=0.25, lw=0)
        after.plot(t, q["q50"][inside], color=colour, lw=1.0)
        y = stored.observed[channel.channel]
        for ax in (before, after):
            ax.scatter(
                stored.inputs["temperature"], y, s=5, color=INK, alpha=0.6, linewidths=0, zorder=3,
                rasterized=y.size > RASTER_ABOVE_POINTS,
            )  # fmt: skip
        _prior_limits(before, y, prior)
        before.set_ylabel(axis_label(channel, take_power(before.yaxis)))
        after.set_ylabel(axis_label(channel, take_power(after.yaxis)))
        rows += [("prior curve", channel.name, channel.unit, *c) for c in zip(grid, *prior, strict=True)]
        rows += [
            ("posterior predictive", channel.name, channel.unit, a, b, math.nan, m, math.nan, c)
            for a, b, m, c in zip(t, q["pred_q05"][inside], q["q50"][inside], q["pred_q95"][inside], strict=True)
        ]  # fmt: skip
    axes[0][0].set_title("Prior: 50 % and 90 % of curves")
    axes[0][1].set_title("Posterior: 90 % of new measurements")
    for ax in axes[-1]:
        ax.set_xlabel(temperature_label(content))
    heading(figure, content.key, unconverged_note([content]))
    figure.legend(handles=[dot_handle(INK, "measured")], loc="lower center", borderaxespad=0.1)
    names = ("q05", "q25", "q50", "q75", "q95")
    header = ("what", "channel", "unit", f"temperature [{content.temperature_unit}]")
    return Drawing(
        stem=f"predictive-{content.key}",
        caption=(
            f"{content.key}, before and after the data. Left: curves that the priors allow, median with 50 % and 90 % "
            "intervals, without noise. Right: median curve and 90 % predictive interval of a new measurement. The axes "
            "of the left panels reach at most two spans of the data beyond it."
        ),
        alt=f"prior and posterior predictive intervals of {', '.join(c.name for c in channels)} of {content.key}",
        figure=figure,
        data=as_columns((*header, *(f"{n} [unit]" for n in names)), rows),
    )


def _prior_limits(ax: Axes, y: Floats, prior: Floats) -> None:
    low, high = float(y.min()), float(y.max())
    span = (high - low) or max(abs(high), 1e-12)
    finite = prior[np.isfinite(prior)]
    bottom, top = max(low - 2 * span, float(finite.min())), min(high + 2 * span, float(finite.max()))
    bottom, top = min(bottom, low), max(top, high)
    ax.set_ylim(bottom - 0.05 * (top - bottom), top + 0.05 * (top - bottom))
    if finite.min() < bottom or finite.max() > top:
        remark(ax, "prior goes beyond the axis", FAINT)


def residual_figure(branch: BranchData, residuals: Mapping[str, Floats]) -> Drawing:
    """Standardised residuals against temperature and in the order of measurement.

    Parameters
    ----------
    branch : BranchData
    residuals : mapping of str to ndarray, shape (n,)
        By channel, see `standardised_residuals` [1].
    """
    content, stored = branch.content, branch.stored
    channels = [c for c in content.channels if c.channel in residuals]
    figure = empty_sheet(7.4, 0.75 + 1.45 * len(channels))
    axes = panels(figure, len(channels), 2, left=0.85, right=0.1, bottom=0.5, top=0.5, gap_x=0.35, gap_y=0.2)
    order = np.arange(1, stored.row.size + 1)
    columns: dict[str, Any] = {
        "order": order,
        "row": stored.row,
        f"temperature [{content.temperature_unit}]": stored.inputs["temperature"],
    }
    starts = (
        np.flatnonzero(np.diff(stored.inputs["segment"]) != 0) + 1.5 if "segment" in stored.inputs else ()
    )
    for (left, right), channel in zip(axes, channels, strict=True):
        e = residuals[channel.channel]
        columns[f"residual of {channel.name} [1]"] = e
        limit = max(3.5, 1.1 * float(np.max(np.abs(e))))
        for ax, x in ((left, stored.inputs["temperature"]), (right, order)):
            ax.axhspan(-2, 2, color="#eef1f4", lw=0, zorder=0)
            ax.axhline(0, color=FAINT, lw=0.6, zorder=1)
            ax.scatter(
                x, e, s=6 if e.size < 200 else 3, color=COLOURS[content.branch], alpha=0.75, linewidths=0,
                rasterized=e.size > RASTER_ABOVE_POINTS,
            )  # fmt: skip
            ax.set_ylim(-limit, limit)
            if channel is not channels[-1]:
                ax.set_xticklabels([])
        for start in starts:
            right.axvline(start, color=FAINT, lw=0.4, ls=":")
        left.set_ylabel(f"{channel.name}\nresidual [sd]")
        right.set_yticklabels([])
    axes[-1][0].set_xlabel(temperature_label(content))
    axes[-1][1].set_xlabel("order of measurement")
    axes[0][0].set_title("Against temperature")
    axes[0][1].set_title("In order" + (", dotted: a new sweep" if len(starts) else ""))
    heading(figure, content.key, unconverged_note([content]))
    return Drawing(
        stem=f"residuals-{content.key}",
        caption=(
            f"Residuals of {content.key} from the median curve, divided by their scale and with the memory of the "
            f"noise model ({content.document.noise.title}) taken out: if curve and noise are right they are "
            "independent with unit variance. Grey: ±2 sd."
        ),
        alt=f"standardised residuals of {content.key} against temperature and in order of measurement",
        figure=figure,
        data=columns,
    )
