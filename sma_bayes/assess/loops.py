"""The loop that heating and cooling make: hysteresis width, area, stiffness ratio, with their intervals."""

from __future__ import annotations

import numpy as np
from pydantic import Field

from sma_bayes.arrays import Floats
from sma_bayes.assess.adequacy import led_by_prior
from sma_bayes.assess.bands import GRID, band_channels, curve_draws, temperature_grid
from sma_bayes.assess.draws import with_calibration_of
from sma_bayes.assess.middle import middle_temperatures
from sma_bayes.document_part import IntervalDocument, Number
from sma_bayes.fitting.curves import interval_where_defined
from sma_bayes.fitting.fit import Fit
from sma_bayes.response.modified_sigmoid import channel_unit


class QuantityInterval(IntervalDocument):
    """A quantity of a branch, or of the loop that both branches make."""

    name: str = Field(description="such as `greatest_stiffness`, `hysteresis_width`, `loop_area`")
    condition: str = Field(description="id of the condition")
    branch: str = Field(default="", description="empty where both make it")
    channel: str = Field(description="of whose curve it is")
    unit: str = Field(description="unit of its numbers")
    meaning: str = Field(default="", description="in words")
    defined: Number = Field(
        default=1.0, description="share of the draws that have it; the interval is theirs [1]"
    )
    negative: bool = Field(
        default=False,
        description="of least and greatest stiffness, which are magnitudes: whether the stiffness is negative there, "
        "as bands and `ask` have it",
    )


def branch_quantities(fit: Fit, record: int = 0) -> list[QuantityInterval]:
    """Least and greatest magnitude of the stiffness over the observed temperatures, and their ratio."""
    r = fit.records[record]
    if "stiffness" not in band_channels(r) or led_by_prior(fit, record):
        return []
    unit = channel_unit(r.units, "stiffness")
    signed = curve_draws(fit, "stiffness", temperature_grid(r), record)
    curve = np.abs(signed)
    stiffness, where = r.quantity("stiffness"), "over the observed temperatures"
    out, sizes = [], []
    for which, at in (("least", curve.argmin(axis=1)), ("greatest", curve.argmax(axis=1))):
        size, own = (np.take_along_axis(k, at[:, None], axis=1)[:, 0] for k in (curve, signed))
        meaning, negative = f"{which} {stiffness} {where}", bool(np.median(own) < 0.0)
        name = f"{which}_stiffness"
        out.append(_interval(name, fit, record, "stiffness", unit, size, meaning, negative=negative))
        sizes.append(size)
    low, high = sizes
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(np.isfinite(high), high / low, np.inf)
    meaning = f"greatest over least {stiffness} {where}"
    return [*out, _interval("stiffness_ratio", fit, record, "stiffness", "1", ratio, meaning)]


def loop_quantities(heating: Fit, cooling: Fit, records: tuple[int, int] = (0, 0)) -> list[QuantityInterval]:
    """Hysteresis width and loop area of one condition.

    The width is the distance of the temperatures at which the curves are half-way (`middle_temperatures`), heating less
    cooling; the area is the integral of heating less cooling over the temperatures that both branches cover. The
    posteriors of the two branches are independent, so their draws are paired as they come; the errors of their
    calibrations are one (`with_calibration_of`).
    """
    h, c = heating.records[records[0]], cooling.records[records[1]]
    first = heating.curves(records[0])
    second = with_calibration_of(cooling.curves(records[1]), first)
    low = max(h.temperature.min(), c.temperature.min())
    high = min(h.temperature.max(), c.temperature.max())
    t_unit = h.units["temperature"]
    out = []
    for channel in band_channels(h):
        if channel not in band_channels(c):
            continue
        a, b = (middle_temperatures(curves, channel) for curves in (first, second))
        if a is not None and b is not None:
            size = min(a.size, b.size)
            out.append(_interval(
                "hysteresis_width", heating, records[0], channel, t_unit, a[:size] - b[:size],
                "temperature at which the curve is half-way, heating less cooling", branch="",
            ))  # fmt: skip
        if high > low:
            t = np.linspace(low, high, GRID)
            weight = np.full(GRID, t[1] - t[0])  # of the trapezoidal rule
            weight[[0, -1]] /= 2.0
            up, down = (curves.curve(channel, t) for curves in (first, second))
            size = min(len(up), len(down))
            with np.errstate(invalid="ignore"):  # undefined where both are infinite
                area = (up[:size] - down[:size]) @ weight
            unit = channel_unit(h.units, channel)
            out.append(_interval(
                "loop_area", heating, records[0], channel, f"{unit} {t_unit}" if unit != "1" else t_unit, area,
                "integral of heating less cooling over the temperatures that both cover", branch="",
            ))  # fmt: skip
    return out


def _interval(
    name: str,
    fit: Fit,
    record: int,
    channel: str,
    unit: str,
    draws: Floats,
    meaning: str,
    *,
    branch: str | None = None,
    negative: bool = False,
) -> QuantityInterval:
    r = fit.records[record]
    shown = r.branch.value if branch is None else branch
    return QuantityInterval(
        name=name, condition=r.condition.id, branch=shown, channel=channel, unit=unit,
        **interval_where_defined(draws), meaning=meaning, defined=1.0 - np.isnan(draws).mean(), negative=negative,
    )  # fmt: skip
