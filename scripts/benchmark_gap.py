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
import itertools
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from joblib import Parallel, delayed
from rich.console import Console
from rich.table import Table
from scipy.special import ndtri
from threadpoolctl import threadpool_limits

sys.path.insert(0, str(Path(__file__).parent))

from gap_benchmark.hide import INSIDE, OUTSIDE, hide_several

from sma_bayes.effects import EFFECTS
from sma_bayes.gap.study import GapStudy, study_campaign
from sma_bayes.parameters.priors_file import read_priors

app = typer.Typer(add_completion=False, help=__doc__)

THERMAL = ("latent_heat", "ambient_draught")
"""Effects on the temperature response, which has a design of its own."""
LADDER = ("minor_loop", "temperature_gradient")
"""Effects that need peaks of different temperature."""


@dataclass(frozen=True)
class Trial:
    """One campaign to be made and studied."""

    suite: str
    effects: str
    sigma: float
    noise: str
    design: str
    seed: int


@dataclass(frozen=True)
class Row:
    """What came of a trial."""

    suite: str
    effects: str
    sigma: float
    noise: str
    design: str
    seed: int
    sigma_reached: float
    in_range: bool
    verdict: str
    named: str
    classes: str
    outcome: str
    p_value: float
    unexplained: float
    true_size: float
    q05: float
    q95: float
    seconds: float


def design_of(effects: Sequence[str]) -> str:
    """The design in which effects can show."""
    if "latent_heat" in effects:
        return "thermal_slow"
    if any(e in THERMAL for e in effects):
        return "thermal"
    return "ladder" if any(e in LADDER for e in effects) else "standard"


def trials(suite: str, count: int) -> Iterator[Trial]:
    """All trials of a suite, `count` of each kind."""
    if suite == "null":
        kinds = [("none", n, "standard") for n in ("white", "ar1_0.5", "ar1_0.9", "student_t")]
        kinds += [("none", n, "unequal_sampling") for n in ("white", "ar1_0.5")]
        kinds += [("none", n, "unpooled") for n in ("white", "ar1_0.9")]
        kinds += [("none", "white", d) for d in ("ladder", "thermal")]
        kinds.append(("wrong_calibration", "white", "standard"))
        cells = [(e, 10.0, n, d) for e, n, d in kinds]
    elif suite == "hidden":
        cells = [(e, s, n, design_of([e])) for e in INSIDE for s in (10.0, 5.0) for n in ("white", "ar1_0.5")]
    elif suite == "left_out":
        cells = [(e, 10.0, "white", design_of([e])) for e in INSIDE]
    elif suite == "outside":
        cells = [(e, 10.0, n, "standard") for e in OUTSIDE for n in ("white", "ar1_0.5")]
    elif suite == "pairs":
        plain = [e for e in INSIDE if design_of([e]) == "standard"]
        cells = [(f"{a}+{b}", 10.0, "white", "standard") for a, b in itertools.combinations(plain, 2)]
        step = max(1, len(cells) // max(count, 1))
        for i, (e, s, n, d) in enumerate(cells[::step]):
            yield Trial(suite, e, s, n, d, i)
        return
    else:
        raise typer.BadParameter(f"no suite {suite!r}; there are null, hidden, left_out, outside, pairs")
    for seed in range(count):
        for e, s, n, d in cells:
            yield Trial(suite, e, s, n, d, seed)


def attempt(trial: Trial) -> Row | None:
    """Make a campaign, study it, and compare; None where the mechanism leaves no trace in the design."""
    began = time.perf_counter()
    hidden = trial.effects.split("+")
    try:
        case = hide_several(hidden, trial.sigma, trial.noise, trial.design, seed=trial.seed)
    except ValueError:
        return None
    catalogue = {k: v for k, v in EFFECTS.items() if trial.suite != "left_out" or k not in hidden}
    with threadpool_limits(limits=1):
        study = study_campaign(
            case.campaign,
            read_priors("modified_sigmoid"),
            pooled=case.pooled,
            effects=catalogue,
            seed=trial.seed,
        )
    wanted = [e for e in hidden if e in catalogue]
    explained = sum(s.chosen.ln_bayes_factor for s in study.steps if s.chosen is not None)
    rest = study.left.best.ln_bayes_factor if study.left.p_value <= 0.02 else 0.0
    low, high = interval(study, hidden[0])
    return Row(
        **asdict(trial),
        sigma_reached=case.sigma,
        in_range=all(a.in_range for a in case.answers),
        verdict=study.verdict,
        named="+".join(e.id for e in study.effects),
        classes=";".join("/".join(c) for c in study.classes.values()),
        outcome=outcome_of(study, wanted),
        p_value=study.p_value,
        unexplained=rest / explained if explained > 0.0 else float("nan"),
        true_size=case.answers[0].size if case.answers else 0.0,
        q05=low,
        q95=high,
        seconds=time.perf_counter() - began,
    )


def outcome_of(study: GapStudy, wanted: Sequence[str]) -> str:
    """``right``: named itself; ``class``: in the class of a name; ``part``: only some of several; ``wrong``: another
    name; ``confident``: another name with no rival; or ``none`` or ``unnamed``."""
    if study.verdict != "named":
        return study.verdict
    strangers = [c for c in study.classes.values() if not set(c) & set(wanted)]
    if strangers:
        return "confident" if any(len(c) == 1 for c in strangers) else "wrong"
    found = [w for w in wanted if any(w in c for c in study.classes.values())]
    if len(found) < len(wanted):
        return "part"
    return "right" if {e.id for e in study.effects} == set(wanted) else "class"


def interval(study: GapStudy, effect: str) -> tuple[float, float]:
    """90 % interval of an effect's size, by Laplace's approximation in its sampled coordinate."""
    final = study.final
    if effect not in final.hypothesis.effect_positions:
        return float("nan"), float("nan")
    at = int(final.hypothesis.effect_positions[effect][0])
    space = final.hypothesis.space
    i = list(space.free_index).index(at)
    sd = float(np.sqrt(final.covariance[i, i]))
    ends = [
        space.free[i].prior.transform.to_physical(np.array(final.z[i] + q * sd)) for q in ndtri((0.05, 0.95))
    ]
    return float(min(ends)), float(max(ends))


@app.command()
def run(
    out: Annotated[Path, typer.Option(help="CSV file; rows are added.")],
    suites: Annotated[
        str, typer.Option(help="Names separated by commas.")
    ] = "null,hidden,left_out,outside,pairs",
    count: Annotated[int, typer.Option(help="Campaigns of each kind; pairs in all.")] = 10,
    jobs: Annotated[int, typer.Option(help="Processes.")] = 1,
) -> None:
    """Make and study campaigns."""
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
}
"""Outcomes that count as right. Where nothing is hidden only a name is wrong."""


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


if __name__ == "__main__":
    app()
