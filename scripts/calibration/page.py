"""The page of the calibration: `docs/data/calibration.csv` and the table of `docs/explanation/calibration.md`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from calibration.summary import QUANTITIES, WANTED, is_reached, read_csv, table, write_csv
from calibration.truths import TRUTHS

BEGIN, END = "<!-- begin: measured -->", "<!-- end: measured -->"


def write_page(lines: Sequence[Mapping[str, Any]], docs: Path) -> None:
    """Write the table of numbers, and from it the generated part of the page.

    Parameters
    ----------
    lines : sequence of mapping
        Results of the repeats.
    docs : Path
        Folder of the documentation.
    """
    numbers = docs / "data" / "calibration.csv"
    write_csv(table(lines), numbers)
    page = docs / "explanation" / "calibration.md"
    page.write_text(
        replaced(page.read_text(encoding="utf-8"), generated(read_csv(numbers))),
        encoding="utf-8",
        newline="\n",
    )


def replaced(text: str, part: str) -> str:
    """A page with its generated part replaced."""
    before, begin, rest = text.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not (begin and end):
        raise ValueError(f"the page has no {BEGIN} ... {END}")
    return f"{before}{BEGIN}\n\n{part}\n\n{END}{after}"


def generated(rows: Sequence[Mapping[str, Any]]) -> str:
    """The generated part of the page, from the table."""
    return "\n\n".join((_coverage(rows), _misses(rows), _chosen(rows)))


def _coverage(rows: Sequence[Mapping[str, Any]]) -> str:
    header = ("truth", "repeats", *QUANTITIES.values())
    lines = ["| " + " | ".join(header) + " |", "|" + "---|" * len(header)]
    for row in rows:
        cells = (_cell(row, q) for q in QUANTITIES)
        lines.append(f"| {TRUTHS[row['truth']].title} | {row['repeats']:.0f} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def _cell(row: Mapping[str, Any], quantity: str) -> str:
    """Share in per cent with its standard error; bold outside the wanted range."""
    value, error = row[quantity], row[f"{quantity}_se"]
    if value is None:
        return "–"
    text = f"{100 * value:.0f}" + ("" if error is None else f" ± {100 * error:.0f}")
    return text if is_reached(row, quantity) else f"**{text}**"


def _misses(rows: Sequence[Mapping[str, Any]]) -> str:
    """What lies outside the wanted range by more than two standard errors, and what may be chance."""
    judged = [(row, q) for row in rows for q in QUANTITIES if row[q] is not None]
    outside = [(row, q) for row, q in judged if not is_reached(row, q)]
    sure = [(row, q) for row, q in outside if _far_out(row, q)]
    head = (
        f"{len(judged) - len(outside)} of {len(judged)} shares lie in {WANTED[0]:.0%} to {WANTED[1]:.0%}. "
        f"{len(sure)} lie outside by more than two standard errors, so that chance does not explain them"
    )
    if not sure:
        return head + "."
    by_truth: dict[str, list[str]] = {}
    for row, q in sure:
        by_truth.setdefault(row["truth"], []).append(f"{QUANTITIES[q]} {100 * row[q]:.0f} %")
    return (
        head
        + ":\n\n"
        + "\n".join(f"- {TRUTHS[t].title}: {', '.join(found)}" for t, found in by_truth.items())
    )


def _far_out(row: Mapping[str, Any], quantity: str) -> bool:
    value, error = row[quantity], row[f"{quantity}_se"] or 0.0
    return value + 2.0 * error < WANTED[0] or value - 2.0 * error > WANTED[1]


def _chosen(rows: Sequence[Mapping[str, Any]]) -> str:
    header = (
        "truth", "model", "noise", "discrepancy", "converged", "width of the curve's band, % of range",
        "width of the readings' band, % of range", "processor time, s",
    )  # fmt: skip
    lines = ["| " + " | ".join(header) + " |", "|" + "---|" * len(header)]
    for row in rows:
        lines.append(
            f"| {TRUTHS[row['truth']].title} | {row['models']} | {row['noises']} | {row['discrepancy']} | "
            f"{100 * (row['converged'] or 0.0):.0f} % | {_percent(row['width'])} | {_percent(row['reading_width'])} | "
            f"{row['seconds']:.1f} |"
        )
    return "\n".join(lines)


def _percent(value: float | None) -> str:
    return "–" if value is None else f"{100 * value:.2g}"
