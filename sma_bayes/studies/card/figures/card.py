"""Figures of a card: phase diagram, transformation strain, curves beside data, stiffness tables."""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from sma_bayes.arrays import Floats
from sma_bayes.fitting.curves import quantiles
from sma_bayes.quantities import QUANTITIES
from sma_bayes.report.figures.sheet import (
    INK,
    Drawing,
    dot_handle,
    empty_sheet,
    heading,
    in_units_of,
    panels,
    take_power,
)
from sma_bayes.report.notation import unit_label
from sma_bayes.runs.declared_units import shown_as, units_of
from sma_bayes.studies.card.law import Moduli, shift, transformation_strain
from sma_bayes.studies.card.schema import CardSweep, ConstitutiveCard, StoredCard

COLOURS: Final = {"heating": "#c8501e", "cooling": "#1f6fb2"}
_STRESSES: Final = 60


def _card(stored: StoredCard) -> ConstitutiveCard:
    assert stored.found.constitutive is not None
    return stored.found.constitutive


def _draws(stored: StoredCard) -> dict[str, Floats]:
    """Draws of the constants, by name."""
    return {name.partition(" [")[0]: v for name, v in stored.columns("constitutive-draws.csv").items()}


def _note(stored: StoredCard) -> str:
    return "" if stored.found.converged else "NOT CONVERGED"


def _boundary(
    card: ConstitutiveCard, draws: dict[str, Floats], name: str, stress: float
) -> tuple[float, Floats]:
    """Temperature of a phase boundary at a stress [K]: of the card, and draws."""
    point = {c.name: np.asarray(c.value) for c in card.constants}
    moduli = Moduli(float(point["E_A"]), float(point["E_M"]))
    told = [
        c[name]
        + shift(stress, card.reference_stress, (c["H_min"], c["H_max"], c["k"]), (c["C_A"], c["C_M"]), moduli,
                cooling=name.startswith("M"))
        for c in (point, draws)
    ]  # fmt: skip
    return float(told[0]), np.asarray(told[1])


def phase_figure(stored: StoredCard) -> Drawing:
    """Stress against transformation temperature: sweeps, and the boundaries of the law with 90 % bands."""
    card, draws = _card(stored), _draws(stored)
    figure = empty_sheet(5.6, 3.9)
    ax = panels(figure, 1, 1, left=0.65, bottom=0.85, top=0.4)[0, 0]
    stress = np.linspace(0.0, 1.1 * max(card.stresses), _STRESSES)
    data: dict[str, Any] = {"stress_MPa": stress}
    for name in ("Mf", "Ms", "As", "Af"):
        colour = COLOURS["cooling" if name.startswith("M") else "heating"]
        rows = [_boundary(card, draws, name, float(s)) for s in stress]
        low, high = (np.array([float(quantiles(d, (q,))[0]) for _, d in rows]) for q in (0.05, 0.95))
        middle = np.array([p for p, _ in rows])
        ax.fill_betweenx(stress, low, high, color=colour, alpha=0.18, linewidth=0.0)
        ax.plot(middle, stress, color=colour, ls="-" if name in ("Ms", "As") else "--", lw=1.0)
        ax.annotate(name, (middle[-1], stress[-1]), xytext=(0, 2), textcoords="offset points", ha="center", fontsize=7,
                    color=colour)  # fmt: skip
        data |= {f"{name}_K": middle, f"{name}_q05_K": low, f"{name}_q95_K": high}
    for s in card.sweeps:
        for told, hollow in ((s.start, False), (s.finish, True)):
            _point(ax, told.quantiles, s, hollow=hollow)
    ax.set(xlabel="temperature [K]", ylabel="stress [MPa]", ylim=(0.0, 1.18 * max(card.stresses)))
    handles: list[Any] = [dot_handle(COLOURS[b], f"{b}: start of a sweep") for b in COLOURS]
    handles += [
        dot_handle(INK, "finish", hollow=True),
        Line2D([], [], color=INK, lw=1.0, label="start of the law"),
    ]
    handles += [
        Line2D([], [], color=INK, lw=1.0, ls="--", label="finish"),
        Patch(color=INK, alpha=0.18, label="90 %"),
    ]
    figure.legend(handles=handles, loc="lower center", ncols=3, borderaxespad=0.2)
    heading(figure, "Phase diagram", _note(stored))
    return Drawing(
        stem="phase-diagram",
        caption="Start and finish of the transformation of each sweep with 90 % intervals, and the boundaries of the "
        "law of the card with their 90 % bands, the scatter between runs included.",
        alt="stress against transformation temperature with fitted phase boundaries",
        figure=figure,
        data=data,
    )


def _point(ax: Any, told: tuple[float, float, float], sweep: CardSweep, *, hollow: bool) -> None:
    low, middle, high = told
    colour = COLOURS[sweep.branch]
    ax.plot([low, high], [sweep.stress] * 2, color=colour, lw=0.8)
    ax.plot(middle, sweep.stress, "o", ms=4.5, mec=colour, mfc="white" if hollow else colour)


def strain_figure(stored: StoredCard) -> Drawing:
    """Transformation strain against stress, and that of the law with its 90 % band."""
    card, draws = _card(stored), _draws(stored)
    point = {c.name: np.asarray(c.value) for c in card.constants}
    figure = empty_sheet(5.2, 3.3)
    ax = panels(figure, 1, 1, left=0.75, bottom=0.8, top=0.4)[0, 0]
    stress = np.linspace(0.0, 1.1 * max(card.stresses), _STRESSES)
    middle = transformation_strain(stress, point["H_min"], point["H_max"], point["k"])
    drawn = np.stack([
        transformation_strain(float(s), draws["H_min"], draws["H_max"], draws["k"])
        for s in stress
    ])  # fmt: skip
    low, high = quantiles(drawn, (0.05, 0.95), axis=1)
    ax.fill_between(stress, low, high, color=INK, alpha=0.18, linewidth=0.0)
    ax.plot(stress, middle, color=INK, lw=1.0)
    for s in card.sweeps:
        q05, median, q95 = s.strain.quantiles
        ax.plot([s.stress] * 2, [q05, q95], color=COLOURS[s.branch], lw=0.8)
        ax.plot(s.stress, median, "o", ms=4.5, color=COLOURS[s.branch])
    ax.set(
        ylim=(0.0, 1.1 * max(float(high.max()), *(s.strain.quantiles[2] for s in card.sweeps))),
        xlim=(0.0, stress[-1]),
        xlabel="stress [MPa]",
        ylabel=f"transformation strain [{in_units_of(take_power(ax.yaxis), '1')}]",
    )
    handles: list[Any] = [dot_handle(COLOURS[b], b) for b in COLOURS]
    handles += [
        Line2D([], [], color=INK, lw=1.0, label="law of the card"),
        Patch(color=INK, alpha=0.18, label="90 %"),
    ]
    figure.legend(handles=handles, loc="lower center", ncols=4, borderaxespad=0.2)
    heading(figure, "Transformation strain", _note(stored))
    return Drawing(
        stem="transformation-strain",
        caption="Transformation strain of each sweep with its 90 % interval, and Hcur of the card with its 90 % band.",
        alt="transformation strain against stress",
        figure=figure,
        data={"stress_MPa": stress, "strain": middle, "strain_q05": low, "strain_q95": high},
    )


def curves_figure(stored: StoredCard) -> Drawing:
    """Measurements and the curve of the card."""
    columns = stored.cells("constitutive-curves.csv")
    condition, branch = np.array(columns["condition"]), np.array(columns["branch"])
    stress, temperature, measured, law = (
        np.array(columns[n], dtype=float)
        for n in ("stress_MPa", "temperature_K", "strain_measured", "strain_card")
    )
    ids = list(dict.fromkeys(condition.tolist()))
    ids.sort(key=lambda c: float(stress[condition == c].mean()))
    rows = math.ceil(len(ids) / 2)
    across = min(2, len(ids))
    figure = empty_sheet(3.6 * across + 0.2, 1.0 + 2.0 * rows)
    axes = panels(figure, rows, across, left=0.75, bottom=0.85, top=0.5, gap_x=0.65, gap_y=0.55)
    for ax, name in zip(axes.flat, ids, strict=False):
        for b, colour in COLOURS.items():
            own = (condition == name) & (branch == b)
            if own.any():
                order = np.argsort(temperature[own])
                ax.plot(temperature[own], measured[own], "o", ms=2.0, mec="none", color=colour, alpha=0.45,
                        rasterized=True)  # fmt: skip
                ax.plot(temperature[own][order], law[own][order], color=colour, lw=1.1)
        ax.set(
            title=f"{name}: {stress[condition == name].mean():.4g} MPa",
            ylabel=f"strain [{in_units_of(take_power(ax.yaxis), '1')}]",
        )
    for ax in axes.flat[len(ids) :]:
        ax.set_visible(False)
    for ax in axes.flat[max(0, len(ids) - across) : len(ids)]:
        ax.set_xlabel("temperature [K]")
    handles: list[Any] = [dot_handle(COLOURS[b], f"{b}, measured") for b in COLOURS]
    handles += [Line2D([], [], color=COLOURS[b], lw=1.1, label=f"{b}, card") for b in COLOURS]
    figure.legend(handles=handles, loc="lower center", ncols=4, borderaxespad=0.2)
    heading(figure, "The card beside the measurements", _note(stored))
    return Drawing(
        stem="card-and-data",
        caption="Measured strain (dots) and the law with the constants of the card (lines), its zero of strain set for "
        "each sweep.",
        alt="strain against temperature, measured and of the card",
        figure=figure,
        data={
            "condition": condition,
            "branch": branch,
            "temperature_K": temperature,
            "strain_measured": measured,
            "strain_card": law,
        },
    )


def stiffness_figure(stored: StoredCard, condition: str) -> Drawing:
    """Rows of the stiffness tables of a condition.

    Parameters
    ----------
    stored : StoredCard
    condition : str
        Its id.
    """
    columns = stored.cells("stiffness.csv")
    own = np.array(columns["condition"]) == condition
    branch = np.array(columns["branch"])[own]
    names = ("temperature", "stiffness_q05", "stiffness_median", "stiffness_q95")
    temperature, low, middle, high = (np.array(columns[n], dtype=float)[own] for n in names)
    first = next(t for t in stored.found.stiffness if t.condition == condition)
    units = units_of(stored.found)
    unit, degrees = shown_as(first.unit, units, first.quantity), shown_as(first.temperature_unit, units)
    temperature = degrees.values(temperature)
    low, middle, high = (unit.values(v) for v in (low, middle, high))
    figure = empty_sheet(5.2, 3.3)
    ax = panels(figure, 1, 1, left=0.75, bottom=0.8, top=0.4)[0, 0]
    for b, colour in COLOURS.items():
        at = branch == b
        ax.fill_between(temperature[at], low[at], high[at], color=colour, alpha=0.25, linewidth=0.0)
        ax.plot(temperature[at], middle[at], "o-", ms=2.0, color=colour, lw=0.8)
    room = 3.0 * np.ptp(middle) + 1e-12
    ax.set(
        ylim=(max(low.min(), middle.min() - room), min(high.max(), middle.max() + room)),
        xlabel=f"temperature [{unit_label(degrees.shown)}]",
    )
    symbol = QUANTITIES[first.quantity].symbol
    ax.set_ylabel(f"{symbol} [{in_units_of(take_power(ax.yaxis), unit.shown)}]")
    handles: list[Any] = [Line2D([], [], color=COLOURS[b], marker="o", ms=3, label=b) for b in COLOURS]
    handles.append(Patch(color=INK, alpha=0.25, label="90 % of the curve"))
    figure.legend(handles=handles, loc="lower center", ncols=3, borderaxespad=0.2)
    heading(figure, f"{condition}: stiffness table", _note(stored))
    return Drawing(
        stem=f"stiffness-{condition}",
        caption=f"{condition}: rows of the table, joined by the straight lines that are read between them.",
        alt=f"{first.quantity} of {condition} against temperature",
        figure=figure,
        data={"branch": branch, "temperature": temperature, "q05": low, "median": middle, "q95": high},
    )
