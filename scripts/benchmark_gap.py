"""The gap workflow on data in which an effect was hidden: how often is it named right?

`run` makes campaigns with `gap_benchmark`, whose mechanisms share no code with the catalogue of effects, runs the
workflow blind on each, and adds a row to a CSV file; rows that are there already are not made again. `table` prints
how often the outcome was right, by suite and effect, with Wilson intervals.

Suites:

- ``null``: nothing hidden, or a wrong calibration factor; any name is wrong.
- ``hidden``: one effect of the catalogue, at 10 or 5 sigma after the model has absorbed what it can.
- ``left_out``: one effect that has been taken out of the catalogue; only ``unnamed`` is right.
- ``outside``: a mechanism that no catalogue has; only ``unnamed`` is right.
- ``pairs``: two effects at once; both must be named.
"""

from __future__ import annotations

import csv
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, fields
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from joblib import Parallel, delayed
from rich.console import Console
from rich.table import Table

sys.path.insert(0, str(Path(__file__).parent))

from gap_benchmark.trials import SUITES, Row, attempt, trials

app = typer.Typer(add_completion=False, help=__doc__)


@app.command()
def run(
    out: Annotated[Path, typer.Option(help="CSV file; rows are added.")],
    suites: Annotated[str, typer.Option(help="Names separated by commas.")] = ",".join(SUITES),
    count: Annotated[int, typer.Option(help="Campaigns of each kind; pairs in all.")] = 10,
    jobs: Annotated[int, typer.Option(help="Processes.")] = 1,
) -> None:
    """Make and study campaigns."""
    unknown = set(suites.split(",")) - set(SUITES)
    if unknown:
        raise typer.BadParameter(f"no suite {', '.join(sorted(unknown))}; there are {', '.join(SUITES)}")
    done = {_key(r) for r in read(out)} if out.exists() else set()
    todo = [t for s in suites.split(",") for t in trials(s, count) if _key(asdict(t)) not in done]
    names = [f.name for f in fields(Row)]
    with out.open("a", newline="") as file:
        writer = csv.DictWriter(file, names)
        if not done:
            writer.writeheader()
        work = Parallel(n_jobs=jobs, return_as="generator")(delayed(attempt)(t) for t in todo)
        for i, row in enumerate(work):
            if row is not None:
                writer.writerow(asdict(row))
                file.flush()
            if i % 20 == 0:
                typer.echo(f"{i + 1} of {len(todo)}", err=True)


def _key(row: dict[str, object]) -> tuple[str, ...]:
    return (
        *(str(row[k]) for k in ("suite", "effects", "noise", "design", "seed")),
        f"{float(str(row['sigma'])):g}",
    )


def read(path: Path) -> list[dict[str, object]]:
    """Rows of a CSV file."""
    with path.open(newline="") as file:
        return [dict(r) for r in csv.DictReader(file)]


GOOD = {
    "null": ("none", "unnamed"),
    "hidden": ("right", "class"),
    "left_out": ("unnamed",),
    "outside": ("unnamed",),
    "pairs": ("right", "class"),
    "strong": ("right", "class"),
    "strong_outside": ("unnamed",),
}
"""Outcomes that count as right. Where nothing is hidden only a name is wrong."""
NAMED = ("right", "class", "part", "wrong", "confident")
OTHER_SIZE = (
    "saturation", "temperature_gradient", "thermal_expansion", "ambient_draught", "latent_heat", "rate_dependence",
    "training_drift", "training", "stress_stroke",
)  # fmt: skip
"""Effects whose size is another quantity in the mechanism than in the catalogue: width, temperature, length of the
part that expands, swing of the room, heat over another specific heat, shift at another rate, drift until another
cycle or by another law, growth that saturates."""
BOTH = 13.0
"""Size of two effects together from which both count as being there at 10 sigma: 14.1 but for what saturates."""


def wilson(successes: int, n: int, z: float = 1.96) -> tuple[float, float]:
    """Interval of a proportion: E. B. Wilson, Journal of the American Statistical Association 22 (1927) 209."""
    if n == 0:
        return 0.0, 1.0
    share = successes / n
    centre = (share + z * z / (2 * n)) / (1 + z * z / n)
    half = z * np.sqrt(share * (1 - share) / n + z * z / (4 * n * n)) / (1 + z * z / n)
    return max(0.0, centre - half), min(1.0, centre + half)


@app.command()
def table(
    path: Annotated[Path, typer.Argument(help="CSV file that `run` has written.")],
    by: Annotated[str, typer.Option(help="Columns to count by.")] = "suite,sigma",
    markdown: Annotated[bool, typer.Option(help="As Markdown.")] = False,
) -> None:
    """Print how often the outcome was right, with 95 % Wilson intervals."""
    rows = read(path)
    keys = by.split(",")
    outcomes = ("right", "class", "part", "unnamed", "none", "wrong", "confident")
    header = [*keys, "n", *outcomes, "as it should be", "95 %"]
    lines = []
    groups: dict[tuple[str, ...], list[dict[str, object]]] = {}
    for row in rows:
        groups.setdefault(tuple(str(row[k]) for k in keys), []).append(row)
    for key, members in groups.items():
        good = sum(str(r["outcome"]) in GOOD[str(r["suite"])] for r in members)
        low, high = wilson(good, len(members))
        counts = [str(sum(r["outcome"] == o for r in members)) for o in outcomes]
        lines.append(
            [
                *key,
                str(len(members)),
                *counts,
                f"{100 * good / len(members):.0f} %",
                f"{100 * low:.0f}-{100 * high:.0f} %",
            ]
        )
    if markdown:
        typer.echo("| " + " | ".join(header) + " |\n|" + "---|" * len(header))
        for line in lines:
            typer.echo("| " + " | ".join(line) + " |")
        return
    shown = Table(*header)
    for line in lines:
        shown.add_row(*line)
    Console(width=170).print(shown)


@app.command()
def goals(path: Annotated[Path, typer.Argument(help="CSV file that `run` has written.")]) -> None:
    """Print what is asked of the workflow beside what was measured, as Markdown."""
    typer.echo("| asked | measured | 95 % | met |\n|---|---|---|---|")
    for asked, share, interval, met in measured(read(path)):
        typer.echo(f"| {asked} | {share} | {interval} | {'yes' if met else '**no**'} |")


def measured(rows: Sequence[Mapping[str, object]]) -> Iterator[tuple[str, str, str, bool]]:
    """What is asked, what was measured with its Wilson interval, and whether the measured share reaches it."""

    def share(
        text: str,
        of: Sequence[Mapping[str, object]],
        good: Callable[[Mapping[str, object]], bool],
        goal: float,
    ) -> tuple[str, str, str, bool]:
        hits = sum(good(r) for r in of)
        low, high = wilson(hits, len(of))
        at_most = "at most" in text
        met = bool(of) and (hits <= goal * len(of) if at_most else hits >= goal * len(of))
        return text, f"{hits} of {len(of)}", f"{100 * low:.1f}-{100 * high:.1f} %", met

    def suite(name: str, **where: object) -> list[Mapping[str, object]]:
        return [
            r for r in rows if r["suite"] == name and all(float(str(r[k])) == v for k, v in where.items())
        ]

    def outcome(*names: str) -> Callable[[Mapping[str, object]], bool]:
        return lambda r: r["outcome"] in names

    yield share("nothing hidden: an effect named in at most 5 %", suite("null"), outcome(*NAMED), 0.05)
    yield share(
        "nothing hidden: a disagreement reported in at most 5 %",
        suite("null"),
        lambda r: r["outcome"] != "none",
        0.05,
    )
    for sigma, goal in ((10.0, 0.95), (5.0, 0.85)):
        text = f"hidden at {sigma:g} sigma: right effect or class in {goal:.0%}"
        yield share(text, suite("hidden", sigma=sigma), outcome("right", "class"), goal)
    missing = [*suite("left_out"), *suite("outside")]
    yield share("not in the catalogue: unnamed in 90 %", missing, outcome("unnamed"), 0.9)
    yield share(
        "not in the catalogue: a confident wrong name in at most 2 %", missing, outcome("confident"), 0.02
    )
    both = [r for r in suite("pairs") if float(str(r["sigma_reached"])) >= BOTH]
    yield share("two effects, both at 10 sigma: both named in 85 %", both, outcome("right", "class"), 0.85)
    named = [r for r in suite("hidden") if r["outcome"] == "right"]
    closed = np.array([shrink(r) for r in named if str(r["gap_before"]) != "nan"])
    if closed.size:
        low, middle, high = np.nanquantile(closed, (0.25, 0.5, 0.75)).tolist()
        found = f"median {middle:.0%} of {closed.size}"
        yield (
            "where named: 90 % of the held-out gap closed",
            found,
            f"quartiles {low:.0%}, {high:.0%}",
            middle >= 0.9,
        )
    inside = [r for r in named if str(r["in_range"]) == "True" and r["effects"] not in OTHER_SIZE]
    hit = [r for r in inside if covered(r)]
    low, high = wilson(len(hit), len(inside))
    rate = len(hit) / max(len(inside), 1)
    yield (
        "90 % intervals of the size cover in 85-95 %",
        f"{len(hit)} of {len(inside)}",
        f"{100 * low:.1f}-{100 * high:.1f} %",
        0.85 <= rate <= 0.95,
    )


def covered(row: Mapping[str, object]) -> bool:
    """Whether the interval holds the true size; for effects of either sign it is their magnitude that is known."""
    low, high, true = (float(str(row[k])) for k in ("q05", "q95", "true_size"))
    return low <= true <= high or low <= -true <= high


def shrink(row: Mapping[str, object]) -> float:
    """Share of the held-out gap above the floor that the named effect closed."""
    before, after, floor = (float(str(row[k])) for k in ("gap_before", "gap_after", "gap_floor"))
    return (before - after) / (before - floor) if before > floor else float("nan")


if __name__ == "__main__":
    app()
