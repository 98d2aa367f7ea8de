"""Figures of a plan: what each candidate tells against its time on the rig, and what is left of the quantities."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.lines import Line2D

from sma_bayes.report.figures.sheet import (
    FAINT,
    INK,
    WARNING,
    Drawing,
    as_columns,
    dot_handle,
    empty_sheet,
    heading,
    label_width,
    logarithmic,
    name_rows,
    ordered_colours,
    panels,
)
from sma_bayes.studies.plan.schema import ExpectedQuantity, PlanDocument, PlannedCandidate, StoredPlan
from sma_bayes.studies.plan.words import asked_words, has_even, hours_text, quantity_name, range_text

COLOURED_CONDITIONS: Final = 8
"""Conditions that have colours of their own."""
MAX_QUANTITIES: Final = 24
"""Quantities that are drawn, those that shrink most."""
BEST: Final = "#1f6fb2"
"""Colour of the best candidate; red turns into a pale one on a dark page."""
OUTCOME_OFFSETS: Final = (-0.25, 0.0, 0.25)
"""Where in the row of a quantity each outcome is, so that equal ones do not hide each other."""


def candidates_figure(stored: StoredPlan) -> Drawing:
    """What each candidate is expected to tell, against its time on the rig."""
    found = stored.found
    apart = found.kind == "tell-apart"
    figure = empty_sheet(6.8, 3.9)
    ax: Axes = panels(figure, 1, 1, left=0.75, bottom=0.5, top=0.42)[0, 0]
    conditions = list(dict.fromkeys(c.condition for c in found.candidates))
    palette = [to_hex(colour) for colour in ordered_colours(COLOURED_CONDITIONS)]
    step = max((COLOURED_CONDITIONS - 1) // max(min(len(conditions), COLOURED_CONDITIONS) - 1, 1), 1)
    colour = {c: palette[i * step % COLOURED_CONDITIONS] for i, c in enumerate(conditions)}
    for c in found.candidates:
        value = _value(c, apart)
        if value is not None:
            hollow = bool(c.beyond) or not c.fits
            ax.plot(
                c.hours, value, "o", ms=4, color=colour[c.condition], mfc="white" if hollow else None, mew=0.8
            )
    front = _front(found.candidates, apart)
    ax.plot([c.hours for c, _ in front], [v for _, v in front], color=FAINT, lw=0.8, zorder=0)
    best = next((c for c in found.candidates if c.fits), None)
    if best is not None:
        ax.plot(best.hours, _value(best, apart) or 0.0, "o", ms=10, mfc="none", mec=WARNING, mew=1.0)
    if found.available is not None:
        ax.axvline(found.available, color=INK, lw=0.7, ls="--")
    if apart:
        ax.set(ylim=(-0.02, 1.05), ylabel="probability of telling apart [1]")
    else:
        ax.set(ylim=(0.0, None), ylabel="expected information [nats]")
    logarithmic(ax, ax.xaxis)
    ax.set_xlabel("time on the rig [h]")
    handles = [dot_handle(colour[c], c) for c in conditions[:COLOURED_CONDITIONS]]
    handles.append(
        Line2D([], [], marker="o", ls="", ms=8, mfc="none", mec=WARNING, label="first in the ranking")
    )
    if any(c.beyond or not c.fits for c in found.candidates):
        handles.append(dot_handle(INK, "beyond what was measured, or the hours", hollow=True))
    ax.legend(handles=handles, loc="upper left", frameon=False, ncols=1 if len(handles) < 5 else 2)
    heading(figure, f"Candidates for {asked_words(found)}", "" if found.converged else "NOT CONVERGED")
    caption = (
        "Each dot is a candidate experiment; the line joins those that no shorter one matches. A ring marks the "
        "first in the ranking"
    )
    caption += (
        "."
        if found.available is None
        else f"; the dashed line, the {hours_text(found.available)} that there are."
    )
    header = (
        "rank", "condition", "temperature", "hours [h]", "probability [1]" if apart else "information [nats]",
    )  # fmt: skip
    unit = found.temperature_unit
    rows = [(c.rank, c.condition, range_text(c, unit), c.hours, _value(c, apart)) for c in found.candidates]
    return Drawing(
        "candidates",
        caption,
        "what each candidate tells against its time on the rig",
        figure,
        as_columns(header, rows),
    )


def _value(c: PlannedCandidate, apart: bool) -> float | None:
    return c.probability if apart else c.nats


def _front(candidates: Sequence[PlannedCandidate], apart: bool) -> list[tuple[PlannedCandidate, float]]:
    """Candidates that tell more than any that take no longer."""
    out: list[tuple[PlannedCandidate, float]] = []
    told = [(c, v) for c in candidates if (v := _value(c, apart)) is not None]
    for c, v in sorted(told, key=lambda x: (x[0].hours, -x[1])):
        if not out or v > out[-1][1]:
            out.append((c, v))
    return out


def narrowing_figure(stored: StoredPlan) -> Drawing:
    """Width of the interval of each quantity that is expected, over that of now."""
    found = stored.found
    parts = outcomes(found)
    size = {(k.key, k.name): k.sd for k in found.quantities}
    left = [
        {(e.key, e.name): e.sd / size[e.key, e.name] if size[e.key, e.name] > 0.0 else 1.0 for e in expected}
        for _, expected in parts
    ]
    known = sorted(found.quantities, key=lambda k: min(one.get((k.key, k.name), 1.0) for one in left))[
        :MAX_QUANTITIES
    ]
    several = len({k.key for k in known}) > 1
    names = [k.key if several and found.kind == "quantity" else quantity_name(k, found) for k in known]
    figure = empty_sheet(6.8, 1.35 + 0.24 * len(names))
    ax: Axes = panels(figure, 1, 1, left=label_width(names), right=0.2, bottom=0.5, top=0.62)[0, 0]
    name_rows(ax, names, labelled=True)
    ax.axvline(1.0, color=INK, lw=0.6)
    colours = (BEST, INK, FAINT)
    for place, k in enumerate(known):
        for one, colour, beside in zip(left, colours, OUTCOME_OFFSETS, strict=False):
            value = one.get((k.key, k.name), 1.0)
            ax.plot(value, place + beside, "o", ms=4, color=colour)
    ax.set(xlim=(0.0, 1.08), xlabel="expected width of the interval, over that of now [1]")
    handles = [dot_handle(c, name) for c, (name, _) in zip(colours, parts, strict=False)]
    ax.legend(handles=handles, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3, frameon=False)
    heading(figure, "What is expected to be left", "" if found.converged else "NOT CONVERGED")
    header = ("quantity", *(f"{name} [1]" for name, _ in parts))
    rows = [(n, *(one.get((k.key, k.name), 1.0) for one in left)) for n, k in zip(names, known, strict=True)]
    return Drawing(
        "narrowing",
        "Expected width of the 90 % interval of each quantity over that of now: 1 where nothing is learnt.",
        "expected width of each interval over that of now",
        figure,
        as_columns(header, rows),
    )


def outcomes(found: PlanDocument) -> list[tuple[str, tuple[ExpectedQuantity, ...]]]:
    """What is drawn beside each other: the best candidate, the design and the even one."""
    best = next((c for c in found.candidates if c.fits), None)
    out = [] if best is None else [(f"best candidate, {hours_text(best.hours)}", best.expected)]
    if found.design is not None:
        out.append((f"design, {hours_text(found.design.hours)}", found.design.expected))
        if has_even(found.design):
            out.append((f"evenly divided, {hours_text(found.design.even.hours)}", found.design.even.expected))
    return out
