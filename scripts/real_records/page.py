"""The page of real measurements: `docs/data/real_measurements.csv` and the tables of `docs/real_measurements.md`."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from calibration.page import replaced

from real_records.baselines import TITLES
from real_records.records import SETS
from real_records.trials import METHODS, OURS, SCHEMES

Line = Mapping[str, Any]
SHARP: Final = ("flexinol_isobaric", "nitihf_sparse_isobaric")
"""Sets whose predictive bands are held against the readings' own scatter."""
DESCRIBED: Final = (
    "model", "noise", "discrepancy", "converged", "rmse", "lag1", "width", "scatter", "seconds"
)  # fmt: skip
LARGEST: Final = 1e6
"""Score that is written with a power of ten, for want of room."""
SCORES: Final = ("coverage", "log_score", "width")
NOT_MEASURED: Final = "not measured"
GAUSSIAN_PROCESSES: Final = ("gaussian_process", "celerite")


@dataclass(frozen=True, slots=True)
class Target:
    """What is asked of the fits, and what was found.

    Attributes
    ----------
    asked, found : str
    is_reached : bool
    """

    asked: str
    found: str
    is_reached: bool


def targets(lines: Sequence[Line]) -> list[Target]:
    """Targets, of records that are one sweep: a band of several different sweeps is no measure of a curve."""
    ours = [line for line in lines if line["method"] == OURS and "failed" not in line]
    single = [line for line in ours if line["sweeps"] == 1]
    return [
        _counted("rmse at most 1 % of range and correlation of innovations within ±0.5 on nine branches of ten",
                 [_is_close(line) for line in single], 0.9),
        _coverage(single),
        *(_beats(lines, single, rival) for rival in GAUSSIAN_PROCESSES),
        *(_sharp(single, example) for example in SHARP),
    ]  # fmt: skip


def _counted(asked: str, hits: Sequence[bool], share: float) -> Target:
    if not hits:
        return Target(asked, NOT_MEASURED, False)
    return Target(asked, f"{sum(hits)} of {len(hits)}", sum(hits) >= share * len(hits))


def _is_close(line: Line) -> bool:
    return bool(line["rmse"] <= 0.01 and abs(line["lag1"]) <= 0.5)


def _coverage(single: Sequence[Line]) -> Target:
    """Held-out coverage over all readings of all records."""
    asked = "held-out coverage of 90 % bands between 85 and 95 %"
    if not single:
        return Target(asked, NOT_MEASURED, False)
    n = np.array([line["n"] for line in single], dtype=float)
    found = np.array([line["held_out"]["blocks"]["coverage"] for line in single])
    pooled = float(np.sum(n * found) / n.sum())
    inside = int(np.sum((found >= 0.85) & (found <= 0.95)))
    return Target(
        asked,
        f"{100 * pooled:.1f} % of all readings; {inside} of {n.size} records by themselves",
        0.85 <= pooled <= 0.95,
    )


def _beats(lines: Sequence[Line], single: Sequence[Line], rival: str) -> Target:
    other = {line["key"]: line for line in lines if line["method"] == rival and "failed" not in line}
    pairs = [(line, other[line["key"]]) for line in single if line["key"] in other]
    hits = [a["held_out"]["blocks"]["log_score"] > b["held_out"]["blocks"]["log_score"] for a, b in pairs]
    return _counted(
        f"a better log score on held-out blocks than the {TITLES[rival]} on four records of five", hits, 0.8
    )


def _sharp(single: Sequence[Line], example: str) -> Target:
    widths = [line["width"] for line in single if line["example"] == example]
    asked = f"predictive bands at most twice as wide as the readings' own scatter on {SETS[example]}"
    if not widths:
        return Target(asked, NOT_MEASURED, False)
    return Target(asked, f"{min(widths):.2g} to {max(widths):.2g} times", max(widths) <= 2.0)


def write_page(lines: Sequence[Line], docs: Path) -> None:
    """Write the numbers and the generated part of the page.

    What the table holds of other records and methods stays, so that each can be measured anew by itself.

    Parameters
    ----------
    lines : sequence of mapping
        As `attempt` gives them.
    docs : Path
        Folder of the documentation.
    """
    table = docs / "data" / "real_measurements.csv"
    ordered = joined(lines, table)
    write_csv(ordered, table)
    page = docs / "real_measurements.md"
    parts = (_targets(ordered), _fits(ordered), _scores(ordered, "blocks"), _rest(ordered))
    text = replaced(page.read_text(encoding="utf-8"), "\n\n".join(parts))
    page.write_text(text, encoding="utf-8", newline="\n")


def joined(lines: Sequence[Line], table: Path) -> list[Line]:
    """Lines, and those of a table as `write_csv` writes it for records and methods that have none; in order."""
    found = {(line["key"], line["method"]): line for line in (*read_csv(table), *lines)}
    return sorted(
        found.values(),
        key=lambda line: (list(SETS).index(line["example"]), line["key"], METHODS.index(line["method"])),
    )


def write_csv(lines: Sequence[Line], path: Path) -> None:
    """One row for each record and method, numbers to four digits."""
    scored = [f"{scheme}_{key}" for scheme in SCHEMES for key in SCORES]
    names = [
        "example",
        "record",
        "branch",
        "n",
        "sweeps",
        "method",
        *DESCRIBED,
        *scored,
        "held_out_seconds",
        "failed",
    ]
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, names, extrasaction="ignore", lineterminator="\n")
        writer.writeheader()
        for line in lines:
            held_out = {
                f"{scheme}_{key}": value
                for scheme, found in line.get("held_out", {}).items()
                for key, value in (found or {}).items()
            }
            writer.writerow({k: _cell(v) for k, v in (line | held_out).items()})


def read_csv(path: Path) -> list[Line]:
    """What `write_csv` has written, to its four digits; nothing where there is no such file.

    Raises
    ------
    ValueError
        A cell that is not of its column's kind.
    """
    if not path.exists():
        return []
    with path.open(encoding="utf-8", newline="") as file:
        return [_line(row) for row in csv.DictReader(file)]


def _line(row: Mapping[str, str]) -> Line:
    """One row as `attempt` gives it, but for ``model_asked``."""
    about = {k: row[k] for k in ("example", "record", "branch", "method")}
    about |= {"key": f"{row['example']}/{row['record']}", "n": int(row["n"]), "sweeps": int(row["sweeps"])}
    if row["failed"]:
        return about | {"failed": row["failed"]}
    held_out = {scheme: {key: _number(row[f"{scheme}_{key}"]) for key in SCORES} for scheme in SCHEMES}
    line = about | {
        "held_out": {k: None if v["coverage"] is None else v for k, v in held_out.items()},
        "held_out_seconds": _number(row["held_out_seconds"]),
    }
    if row["method"] != OURS:
        return line
    words = {k: row[k] for k in ("model", "noise")} | {"converged": row["converged"] == "True"}
    return line | words | {k: _number(row[k]) for k in DESCRIBED if k not in words}


def _number(cell: str) -> float | None:
    return float(cell) if cell else None


def _cell(value: object) -> object:
    return f"{value:.4g}" if isinstance(value, float) else ("" if value is None else value)


def _targets(lines: Sequence[Line]) -> str:
    rows = [(t.asked, t.found, "yes" if t.is_reached else "**no**") for t in targets(lines)]
    return "## What is asked, and what was reached\n\n" + _table(("asked", "found", "reached"), rows)


def _fits(lines: Sequence[Line]) -> str:
    """The fit of each whole record."""
    rows = []
    for line in (line for line in lines if line["method"] == OURS):
        name = f"{SETS[line['example']]}, {line['record']}"
        if "failed" in line:
            rows.append((name, str(line["n"]), line["failed"], *[""] * 7))
            continue
        rows.append((
            name, str(line["n"]), line["model"], line["noise"], _percent(line["discrepancy"]),
            f"{100 * line['rmse']:.2f}", f"{line['lag1']:.2f}", f"{line['width']:.2g}",
            "yes" if line["converged"] else "**no**", f"{line['seconds']:.1f}",
        ))  # fmt: skip
    header = ("record", "n", "model", "noise", "discrepancy, % of range", "rmse, % of range",
              "correlation of innovations", "width over scatter", "converged", "s")  # fmt: skip
    return "## The fits\n\n" + _table(header, rows)


def _percent(value: float | None) -> str:
    return "–" if value is None else f"{100 * value:.2g}"


def _scores(lines: Sequence[Line], scheme: str) -> str:
    """Log score and coverage of each method on held-out blocks, the best in bold."""
    rows = []
    for key, found in _by_record(lines).items():
        scored = {m: line["held_out"][scheme] for m, line in found.items() if "failed" not in line}
        best = max((s["log_score"] for s in scored.values()), default=float("nan"))
        cells = [_score_cell(scored.get(m), best) for m in METHODS]
        rows.append((key, *cells))
    header = ("record", *(TITLES[m] for m in METHODS))
    return (
        "## Held-out blocks\n\nMean log predictive density of a held-out reading, in units of the range of the record, "
        "and the share of held-out readings inside the 90 % interval. The best log score is bold.\n\n"
        + _table(header, rows)
    )


def _score_cell(score: Line | None, best: float) -> str:
    if score is None:
        return "–"
    value = score["log_score"]
    text = f"{value:.2f}" if abs(value) < LARGEST else f"{value:.1e}"
    return f"{f'**{text}**' if score['log_score'] == best else text}, {100 * score['coverage']:.0f} %"


def _rest(lines: Sequence[Line]) -> str:
    """Medians over records for each method and scheme."""
    rows = []
    for scheme in SCHEMES:
        for method in METHODS:
            found = [
                line for line in lines
                if line["method"] == method and "failed" not in line and line["held_out"][scheme] is not None
            ]  # fmt: skip
            if not found:
                continue
            s = [line["held_out"][scheme] for line in found]
            n = np.array([line["n"] for line in found], dtype=float)
            coverage = float(np.sum(n * [x["coverage"] for x in s]) / n.sum())
            rows.append((
                scheme, TITLES[method], str(len(found)), f"{np.median([x['log_score'] for x in s]):.2f}",
                f"{100 * coverage:.0f} %", f"{100 * np.median([x['width'] for x in s]):.2g}",
                f"{np.median([line['held_out_seconds'] for line in found]):.1f}",
            ))  # fmt: skip
    header = ("held out", "method", "records", "log score, median", "coverage, all readings",
              "width of the 90 % interval, % of range, median", "s for all that is held out")  # fmt: skip
    return "## Blocks, ends and sweeps\n\n" + _table(header, rows)


def _by_record(lines: Sequence[Line]) -> dict[str, dict[str, Line]]:
    found: dict[str, dict[str, Line]] = {}
    for line in lines:
        found.setdefault(f"{SETS[line['example']]}, {line['record']}", {})[line["method"]] = line
    return found


def _table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = ["| " + " | ".join(header) + " |", "|" + "---|" * len(header)]
    return "\n".join([*lines, *("| " + " | ".join(row) + " |" for row in rows)])
