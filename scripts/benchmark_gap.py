"""The gap workflow on data in which an effect was hidden: how often is it named right?

`run` makes campaigns with `gap_benchmark`, whose mechanisms share no code with the catalogue of effects, runs the
workflow blind on each, and adds a row to a CSV file. Each row says by which engine, a digest of the modules that
decide; what the present engine has done already is not done again, so counts grow over several sittings. `goals` and
`table` print how often the outcome was right, with exact intervals; `attainable`, how often it can be at best.

Suites:

- ``null``: nothing hidden, or a wrong calibration factor; any name is wrong. Noise with memory up to 0.95, with heavy
  tails, or growing with the response; curves that are no sigmoids, as far from these as the usual noise shows, or by
  as many sigma as are asked for; records of one cycle.
- ``hidden``: one effect of the catalogue, by the first law, the second, or that of `simcoon`.
- ``left_out``: one effect that has been taken out of the catalogue; only ``unnamed`` is right.
- ``outside``: a mechanism that no catalogue has; only ``unnamed`` is right.
- ``pairs``, ``triples``: two or three effects at once; all must be named.
"""

from __future__ import annotations

import csv
import itertools
import re
import sys
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, fields
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from joblib import Parallel, delayed
from rich.console import Console
from rich.table import Table
from scipy.stats import binomtest

sys.path.insert(0, str(Path(__file__).parent))

from gap_benchmark.attainable import attainable
from gap_benchmark.hide import INSIDE, LAWS, MECHANISMS
from gap_benchmark.state import Stage
from gap_benchmark.trials import SUITES, THERMAL, Row, attempt, engine, trials

app = typer.Typer(add_completion=False, help=__doc__)


@app.command()
def run(
    out: Annotated[Path, typer.Option(help="CSV file; rows are added.")],
    suites: Annotated[str, typer.Option(help="Names separated by commas.")] = ",".join(SUITES),
    count: Annotated[int, typer.Option(help="Seeds; of null, pairs and triples, campaigns.")] = 10,
    first: Annotated[int, typer.Option(help="The first seed.")] = 0,
    sigmas: Annotated[
        str, typer.Option(help="Sizes, separated by commas; those of the suite if not given.")
    ] = "",
    laws: Annotated[str, typer.Option(help="Of: first, second, simcoon.")] = "first,second",
    effects: Annotated[str, typer.Option(help="To be hidden, separated by commas; all if not given.")] = "",
    folds: Annotated[bool, typer.Option(help="Hold cycles out where the name was right.")] = False,
    jobs: Annotated[int, typer.Option(help="Processes.")] = 1,
) -> None:
    """Make and study campaigns."""
    for asked, known, what in (
        (suites, SUITES, "suite"),
        (laws, LAWS, "law"),
        (effects, MECHANISMS, "effect"),
    ):
        unknown = set(filter(None, asked.split(","))) - set(known)
        if unknown:
            raise typer.BadParameter(f"no {what} {', '.join(sorted(unknown))}; there are {', '.join(known)}")
    done = {_key(r) for r in read(out) if r["engine"] == engine()} if out.exists() else set()
    chosen = [float(s) for s in sigmas.split(",") if s]
    by_suite = [
        trials(
            s,
            count,
            first=first,
            sigmas=chosen,
            laws=laws.split(","),
            effects=[*filter(None, effects.split(","))],
        )
        for s in suites.split(",")
    ]
    in_turn = (t for some in itertools.zip_longest(*by_suite) for t in some if t is not None)
    todo = [t for t in in_turn if _key(asdict(t)) not in done]
    names = [f.name for f in fields(Row)]
    fresh = not out.exists()
    with out.open("a", newline="") as file:
        writer = csv.DictWriter(file, names, lineterminator="\n")
        if fresh:
            writer.writeheader()
        work = Parallel(n_jobs=jobs, return_as="generator")(delayed(attempt)(t, folds=folds) for t in todo)
        for i, row in enumerate(work):
            if row is not None:
                writer.writerow(
                    {k: f"{v:.6g}" if isinstance(v, float) else v for k, v in asdict(row).items()}
                )
                file.flush()
            if i % 20 == 0:
                typer.echo(f"{i + 1} of {len(todo)}", err=True)


def _key(row: Mapping[str, object]) -> tuple[str, ...]:
    return (
        *(str(row[k]) for k in ("suite", "effects", "noise", "design", "seed", "law", "curve")),
        f"{float(str(row['sigma'])):g}",
    )


def read(path: Path) -> list[dict[str, object]]:
    """Rows of a CSV file, of each campaign the last: that of the newest engine that has studied it."""
    with path.open(newline="") as file:
        return list({_key(r): dict(r) for r in csv.DictReader(file)}.values())


GOOD = {
    "null": ("none", "unnamed"),
    "hidden": ("right", "class"),
    "left_out": ("unnamed",),
    "outside": ("unnamed",),
    "pairs": ("right", "class"),
    "triples": ("right", "class"),
}
"""Outcomes that count as right. Where nothing is hidden only a name is wrong."""
NAMED = ("right", "class", "part", "wrong", "confident")
ENOUGH = 50
"""Campaigns from which on a rate counts as measured."""
OTHER_SIZE = (
    "saturation", "temperature_gradient", "thermal_expansion", "ambient_draught", "latent_heat", "rate_dependence",
    "training_drift", "training", "stress_stroke",
)  # fmt: skip
"""Effects whose size is another quantity in the mechanism than in the catalogue: width, temperature, length of the
part that expands, swing of the room, heat over another specific heat, shift at another rate, drift until another
cycle or by another law, growth that saturates."""


def exact(successes: int, n: int) -> tuple[float, float]:
    """95 % interval of a proportion: C. J. Clopper, E. S. Pearson, Biometrika 26 (1934) 404."""
    if n == 0:
        return 0.0, 1.0
    found = binomtest(successes, n).proportion_ci(0.95, method="exact")
    return float(found.low), float(found.high)


OUTCOMES = ("right", "class", "shape", "part", "unnamed", "none", "wrong", "confident")


def counted(rows: Sequence[Mapping[str, object]], keys: Sequence[str]) -> tuple[list[str], list[list[str]]]:
    """Header and lines of a table: how often each outcome came, by some columns, with exact 95 % intervals."""
    groups: dict[tuple[str, ...], list[Mapping[str, object]]] = {}
    for row in rows:
        groups.setdefault(tuple(str(row[k]) for k in keys), []).append(row)
    lines = []
    for key, members in sorted(groups.items(), key=lambda g: [_in_order(k) for k in g[0]]):
        good = sum(str(r["outcome"]) in GOOD[str(r["suite"])] for r in members)
        low, high = exact(good, len(members))
        counts = [str(sum(r["outcome"] == o for r in members)) for o in OUTCOMES]
        share = f"{100 * good / len(members):.0f} %"
        lines.append([*key, str(len(members)), *counts, share, f"{100 * low:.0f}-{100 * high:.0f} %"])
    return [*keys, "n", *OUTCOMES, "as it should be", "95 %"], lines


def as_markdown(header: Sequence[str], lines: Sequence[Sequence[str]]) -> str:
    """A table in Markdown."""
    rows = [header, ["---"] * len(header), *lines]
    return "\n".join(
        "| " + " | ".join(row) + " |" if row[0] != "---" else "|" + "---|" * len(row) for row in rows
    )


@app.command()
def table(
    path: Annotated[Path, typer.Argument(help="CSV file that `run` has written.")],
    by: Annotated[str, typer.Option(help="Columns to count by.")] = "suite,sigma",
    suites: Annotated[str, typer.Option(help="Names separated by commas.")] = ",".join(SUITES),
    markdown: Annotated[bool, typer.Option(help="As Markdown.")] = False,
) -> None:
    """Print how often the outcome was right, with exact 95 % intervals."""
    header, lines = counted([r for r in read(path) if r["suite"] in suites.split(",")], by.split(","))
    if markdown:
        typer.echo(as_markdown(header, lines))
        return
    shown = Table(*header)
    for line in lines:
        shown.add_row(*line)
    Console(width=170).print(shown)


@app.command()
def page(
    path: Annotated[Path, typer.Argument(help="CSV file that `run` has written.")],
    text: Annotated[Path, typer.Argument(help="Page whose tables are made anew.")],
) -> None:
    """Make the tables of a page from the rows."""
    text.write_text(with_tables(text.read_text(encoding="utf-8"), read(path)), encoding="utf-8")


def with_tables(text: str, rows: Sequence[Mapping[str, object]]) -> str:
    """A page with its tables made anew: what stands between ``<!-- table SUITES by KEYS -->`` and ``<!-- end -->``.

    ``<!-- goals -->`` asks for what is asked, ``<!-- engines -->`` for the number of rows of each engine.
    """

    def made(match: re.Match[str]) -> str:
        what = match[1].split()
        if what == ["goals"]:
            lines = [list(told) for told in measured(rows)]
            content = as_markdown(["asked", "measured", "95 %", "met"], lines)
        elif what == ["engines"]:
            engines = Counter((str(r["engine"]), str(r["suite"])) for r in rows)
            content = as_markdown(
                ["engine", "suite", "rows"], [[*k, str(n)] for k, n in sorted(engines.items())]
            )
        else:
            _, suites, _, keys = what
            content = as_markdown(
                *counted([r for r in rows if r["suite"] in suites.split(",")], keys.split(","))
            )
        return f"<!-- {match[1]} -->\n{content}\n<!-- end -->"

    return re.sub(r"<!-- ((?:goals|engines|table [^>]*?)) -->\n.*?<!-- end -->", made, text, flags=re.DOTALL)


def _in_order(value: str) -> tuple[int, float, str]:
    """Numbers by size, before words."""
    try:
        return 0, float(value), ""
    except ValueError:
        return 1, 0.0, value


@app.command("attainable")
def print_attainable(
    sigma: Annotated[float, typer.Option(help="Size of what is hidden.")] = 5.0,
    law: Annotated[str, typer.Option(help="Of: first, second, simcoon.")] = "first",
    seed: Annotated[int, typer.Option(help="Of the spring and of the noise.")] = 0,
    effects: Annotated[str, typer.Option(help="Separated by commas; all of the response if not given.")] = "",
) -> None:
    """Print in which share of draws of white noise an effect can be named, as Markdown."""
    asked = effects.split(",") if effects else [
        e for e in INSIDE
        if e in LAWS[law] and e not in THERMAL and MECHANISMS[e].stage is not Stage.DIGITISER
    ]  # fmt: skip
    found = []
    for e in asked:
        try:
            found.append(attainable(e, sigma, law, seed))
        except ValueError as refused:
            typer.echo(str(refused), err=True)
    numbers = np.array([(a.seen, a.supported, a.named, a.ln_bayes_factor) for a in found])
    names = [*(a.effect for a in found), "mean"]
    lines = [
        [name, *(f"{share:.0%}" for share in shares), f"{value:.1f}"]
        for name, (*shares, value) in zip(names, [*numbers, numbers.mean(axis=0)], strict=True)
    ]
    typer.echo(as_markdown(["effect", "seen", "worth 3 nats, too", "named", "ln Bayes factor, mean"], lines))


@app.command()
def goals(path: Annotated[Path, typer.Argument(help="CSV file that `run` has written.")]) -> None:
    """Print what is asked of the workflow beside what was measured, as Markdown."""
    typer.echo(with_tables("<!-- goals -->\n<!-- end -->", read(path)))


def measured(rows: Sequence[Mapping[str, object]]) -> Iterator[tuple[str, str, str, str]]:
    """What is asked, what was measured with its exact interval, and whether it is met.

    By the measured share, if there are `ENOUGH` campaigns; of a wrong name, the upper end of its interval has to be
    below twice the rate as well. Else it is open, unless the interval rules the rate out.
    """

    def share(
        text: str, of: Sequence[Mapping[str, object]], good: Sequence[str], goal: float
    ) -> tuple[str, str, str, str]:
        hits = sum(str(r["outcome"]) in good for r in of)
        low, high = exact(hits, len(of))
        if "at most" in text:
            reached, excluded, enough = hits <= goal * len(of), low > goal, high < 2.0 * goal
        else:
            reached, excluded, enough = hits >= goal * len(of), high < goal, len(of) >= ENOUGH
        met = "**no**" if excluded or (enough and not reached) else "yes" if enough else "open"
        return text, f"{hits} of {len(of)}", f"{100 * low:.1f}-{100 * high:.1f} %", met

    def suite(*names: str, **where: object) -> list[Mapping[str, object]]:
        return [r for r in rows if r["suite"] in names and all(str(r[k]) == v for k, v in where.items())]

    yield share("nothing hidden: an effect named in at most 1 %", suite("null"), NAMED, 0.01)
    plain = [r for r in suite("null", curve="sigmoid")]
    yield share(
        "nothing hidden, curves sigmoids: a disagreement reported in at most 2 %",
        plain,
        (*NAMED, "unnamed"),
        0.02,
    )
    for s in sorted({float(str(r["sigma"])) for r in suite("hidden")}):
        goal = 0.85 if s < 10.0 else 0.95
        of = [
            r
            for r in suite("hidden")
            if float(str(r["sigma"])) == s and float(str(r["sigma_reached"])) > 0.99 * s
        ]
        yield share(f"hidden at {s:g} sigma: right effect or class in {goal:.0%}", of, GOOD["hidden"], goal)
        physical = [r for r in of if r["in_range"] == "True"]
        yield share(
            "the same within its physical range, a bent curve told as a shape counted",
            physical, (*GOOD["hidden"], "shape"), goal,
        )  # fmt: skip
    for law in LAWS:
        yield share(f"of these by the {law} law: in 95%", suite("hidden", law=law), GOOD["hidden"], 0.95)
    beyond = suite("hidden", in_range="False")
    yield share(
        "beyond its physical range: a confident wrong name in at most 1 %", beyond, ("confident",), 0.01
    )
    missing = suite("left_out", "outside")
    yield share("not in the catalogue: an effect named in at most 1 %", suite("outside"), NAMED, 0.01)
    yield share(
        "taken out of the catalogue: a confident wrong name in at most 1 %",
        suite("left_out"),
        ("confident",),
        0.01,
    )
    yield share("either of these: seen, and unnamed, in 95%", missing, ("unnamed",), 0.95)
    for name, text, goal in (
        ("pairs", "two effects: both named in 85%", 0.85),
        ("triples", "three effects: all named in 70%", 0.70),
    ):
        yield share(text, suite(name), GOOD[name], goal)
        physical = suite(name, in_range="True")
        yield share(
            "the same within their physical ranges, a bent curve told as a shape counted",
            physical, (*GOOD[name], "shape"), goal,
        )  # fmt: skip
    named = [r for r in suite("hidden") if r["outcome"] == "right"]
    closed = np.array([shrink(r) for r in named if str(r["gap_before"]) != "nan"])
    if closed.size:
        low, middle, high = np.nanquantile(closed, (0.25, 0.5, 0.75)).tolist()
        found = f"median {middle:.0%} of {closed.size}"
        yield (
            "where named: 90 % of the held-out gap closed",
            found,
            f"quartiles {low:.0%}, {high:.0%}",
            "yes" if middle >= 0.9 else "**no**",
        )
    inside = [
        r for r in named
        if r["law"] == "first" and str(r["in_range"]) == "True" and r["effects"] not in OTHER_SIZE
        and float(str(r["sigma"])) <= 10.0
    ]  # fmt: skip
    hit = [r for r in inside if covered(r)]
    low, high = exact(len(hit), len(inside))
    rate = len(hit) / max(len(inside), 1)
    met = "open" if len(inside) < ENOUGH else "yes" if 0.85 <= rate <= 0.95 else "**no**"
    told = "90 % intervals of the size, up to 10 sigma and by the first law, cover in 85-95 %"
    yield told, f"{len(hit)} of {len(inside)}", f"{100 * low:.1f}-{100 * high:.1f} %", met


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
