"""The figures of the page, from the study and from what is printed."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np
from scipy.stats import t as student_t

from sma_bayes.arrays import Floats
from sma_bayes.assess.bands import curve_draws, temperature_grid
from sma_bayes.fitting.fit import Fit
from sma_bayes.paper.extremes import EXTREME_CONDITIONS, TABLE_9, TABLE_10, TABLE_11, extremes
from sma_bayes.paper.specifications import TEXT_VALUES, specification
from sma_bayes.paper.twin import recipes
from sma_bayes.quantities import convert
from sma_bayes.records.types import Branch, Record
from sma_bayes.report.figures.sheet import Drawing, FigureFiles, save_picture
from sma_bayes.response.logistic import Logistic, printed_constants
from sma_bayes.studies.compare.figures.averages import model_average_figure
from sma_bayes.studies.paper.distance import (
    PublishedDistance,
    distances,
    nearest_line,
    nearest_logistic,
    rising_part,
)
from sma_bayes.studies.paper.figures import (
    BandedCurve,
    NearestRivals,
    Operation,
    Plugged,
    Profile,
    duty_cycle_figure,
    extremes_figure,
    nearest_figure,
    operation_figure,
    plugged_figure,
    profile_figure,
    rival_figure,
)
from sma_bayes.studies.paper.printed import repeat_scatter
from sma_bayes.studies.paper.schema import ReproducedEntry
from sma_bayes.studies.paper.twin_study import TwinStudy

OPERATIONS: Final[Mapping[str, tuple[str, Mapping[str, str]]]] = {
    "fig-15": ("Fig. 15", {"1A-10mHz": "1 A", "1.5A-10mHz": "1.5 A", "2A-10mHz-table3": "2 A"}),
    "fig-16": ("Fig. 16", {"100g-10mHz": "100 g", "150g-10mHz": "150 g", "200g-10mHz": "200 g"}),
    "fig-18": ("Fig. 18", {"2A-10mHz-table5": "10 mHz", "2A-30mHz": "30 mHz", "2A-50mHz": "50 mHz"}),
}
"""Figures of operating conditions: what they are called in the paper, and their settings by condition."""
FIGURES: Final = {
    "fig-06": ("Fig. 6", "fig-15"),
    "fig-07": ("Fig. 7", "fig-16"),
    "fig-08": ("Fig. 8", "fig-18"),
}
"""Figures of Eq. (7): what they are called in the paper, and the figure whose settings are their panels."""
SURE: Final = 0.95
DRAWS: Final = 400
"""Draws of a band of force over displacement."""

RIVALS: Final[Mapping[str, tuple[str, str]]] = {
    "fig-09-11": ("Figs. 9 to 11", "logistic_refitted"),
    "fig-12-14": ("Figs. 12 to 14", "polynomial_corrected"),
}
RIVAL_PANELS: Final[Mapping[str, str]] = {
    "1.5A-10mHz": "1.5 A, 10 mHz",
    "2A-10mHz-table3": "2 A, 10 mHz",
    "100g-10mHz": "100 g, 10 mHz",
}
PLUGGED: Final[Mapping[str, tuple[str, str]]] = {
    "fig9": ("Fig. 9: 1.5 A", "1.5A-10mHz"),
    "fig10": ("Fig. 10: 2 A", "2A-10mHz-table3"),
    "fig11": ("Fig. 11: 100 g", "100g-10mHz"),
}
"""Panels of the printed logistic: the name of its extremes, its title, and the condition of its temperatures."""


def write_pictures(
    study: TwinStudy, tables: Mapping[str, Sequence[ReproducedEntry]], folder: Path
) -> list[FigureFiles]:
    """Draw all figures into a folder.

    Parameters
    ----------
    study : TwinStudy
    tables : mapping of str to sequence of ReproducedEntry
        As `table_entries` gives them.
    folder : Path

    Raises
    ------
    OutputError
        If a file can't be written.
    """
    extreme = [entry for n in ("9", "10", "11", "12") for entry in tables[n]]
    drawings: list[Callable[[], Drawing]] = [
        *(
            partial(profile_figure, stem, name, _profiles(study, _lettered(OPERATIONS[other][1])))
            for stem, (name, other) in FIGURES.items()
        ),
        *(
            partial(rival_figure, stem, name, rival, _profiles(study, RIVAL_PANELS, rival))
            for stem, (name, rival) in RIVALS.items()
        ),
        *(
            partial(operation_figure, stem, name, _operations(study, parts))
            for stem, (name, parts) in OPERATIONS.items()
        ),
        partial(duty_cycle_figure, *duty_cycles()),
        partial(plugged_figure, plugged()),
        partial(nearest_figure, nearest()),
        partial(extremes_figure, extreme),
        partial(model_average_figure, study.comparison),
    ]
    return [save_picture(draw, folder) for draw in drawings]


def _lettered(settings: Mapping[str, str]) -> dict[str, str]:
    return {c: f"({letter}) {text}" for letter, (c, text) in zip("abc", settings.items(), strict=True)}


def _in_si(values: Floats) -> Floats:
    return np.asarray(convert(values, "N/cm", "N/m", what="stiffness"))


def _profiles(study: TwinStudy, parts: Mapping[str, str], rival: str = "") -> list[Profile]:
    return [
        _profile(study, r, parts[r.condition.id], rival)
        for r in study.campaign.records
        if r.condition.id in parts
    ]


def _profile(study: TwinStudy, record: Record, title: str, rival: str) -> Profile:
    band = study.bands[record.key]
    quantiles = (_in_si(band.curve[q]) for q in ("q05", "q50", "q95"))
    curves = {"modified_sigmoid": BandedCurve(band.temperature, *quantiles)}
    if rival:
        stored = study.compared_curves[f"{record.key}-stiffness"]
        t = stored[f"temperature_{record.units['temperature']}"]
        curves = {
            name: BandedCurve(t, *(_in_si(stored[f"{name}_{q}"]) for q in ("q05", "q50", "q95")))
            for name in ("modified_sigmoid", rival)
        }
    row = {**extremes(TABLE_9), **extremes(TABLE_10)}.get(record.condition.id)
    return Profile(
        title=title,
        branch=record.branch.value,
        temperature=record.temperature,
        stiffness=_in_si(record.observed["stiffness"]),
        curves=curves,
        extremes=() if row is None else (row["stiffness_min"], row["stiffness_max"]),
    )


def _operations(study: TwinStudy, settings: Mapping[str, str]) -> list[Operation]:
    return [
        Operation(
            settings[r.condition.id],
            r.branch.value,
            path_band(study.parts[r.key]),
            _profile(study, r, "", "").curves["modified_sigmoid"],
        )
        for r in study.campaign.records
        if r.condition.id in settings
    ]


def path_band(fit: Fit) -> BandedCurve:
    """Band of the force over the displacement [units of the record], both along the temperature.

    Parameters
    ----------
    fit : Fit
        Of one record of both. The displacement of each draw rises or falls throughout.
    """
    (record,) = fit.records
    t = temperature_grid(record)
    x, f = (curve_draws(fit, c, t) for c in ("displacement", "force"))
    rows = np.linspace(0, len(x) - 1, min(DRAWS, len(x))).round().astype(int)
    x, f = x[rows], f[rows]
    if np.median(x[:, -1] - x[:, 0]) < 0.0:
        x, f = x[:, ::-1], f[:, ::-1]
    ends = np.median(x[:, 0]), np.median(x[:, -1])
    at = np.linspace(*ends, t.size)
    drawn = np.stack([np.interp(at, one, force) for one, force in zip(x, f, strict=True)])
    return BandedCurve(at, *np.quantile(drawn, (0.05, 0.5, 0.95), axis=0))


def duty_cycles() -> tuple[list[dict[str, float]], dict[str, float]]:
    """Rows of Table 11 with their duty cycle, and half the 90 % interval of a test of each extreme [N/m]."""
    rows = [
        {"duty_cycle": EXTREME_CONDITIONS[name].duty_cycle or float("nan"), **row}
        for name, row in extremes(TABLE_11).items()
    ]
    quantile = float(student_t.ppf(SURE, 1))
    return rows, {name: quantile * repeat_scatter(name) for name in ("stiffness_min", "stiffness_max")}


def nearest() -> list[NearestRivals]:
    """Published curves over the printed range of stiffness, and what is nearest to them."""
    by_key = {r.key: r for r in recipes()}
    return [_nearest(d, by_key) for d in distances()]


def _nearest(d: PublishedDistance, by_key: Mapping[str, Any]) -> NearestRivals:
    t, k = rising_part(by_key[f"{d.condition}-{d.branch}"], d.printed_least, d.printed_greatest)
    name = d.condition.removesuffix("-table3").removesuffix("-10mHz")
    return NearestRivals(
        title=f"{name}, {d.branch}",
        temperature=t,
        published=_in_si(k),
        logistic=_in_si(nearest_logistic(t, k)),
        line=_in_si(nearest_line(t, k)),
        rmse=None if d.rmse is None else float(convert(d.rmse, "N/cm", "N/m", what="RMSE")),
    )


def plugged() -> list[Plugged]:
    """The logistic by the printed equations, constants and extremes."""
    rows = {**extremes(TABLE_9), **extremes(TABLE_10)}
    out = []
    for name, (title, condition) in PLUGGED.items():
        low, high = (specification(TEXT_VALUES, f"stiffness_{end}_{name}", "N/m") for end in ("min", "max"))
        row = rows[condition]
        t = np.linspace(row["temperature_min"], row["temperature_max"], 241)
        out.append(
            Plugged(
                title,
                t,
                {
                    "heating, as printed": _logistic(t, (low, high), Branch.HEATING, corrected=False),
                    "heating, corrected": _logistic(t, (low, high), Branch.HEATING, corrected=True),
                    "cooling": _logistic(t, (low, high), Branch.COOLING, corrected=True),
                },
            )
        )
    return out


def _logistic(t: Floats, ends: Sequence[float], branch: Branch, *, corrected: bool) -> Floats:
    constants = printed_constants(branch, corrected=corrected)
    theta = np.array([*ends, constants["centre"], constants["width"]])
    return Logistic().predict(theta, {"temperature": t})["stiffness"]
