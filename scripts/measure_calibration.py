"""Do the 90 % intervals that `fit` gives hold the truth in 85 to 95 % of the cases?

`run` makes measurements of known truths (`calibration.truths`), fits each as a user would, with the package's defaults,
and adds a line of JSON for each repeat to a file. `show` prints the table, `page` writes it to
`docs/data/calibration.csv` and into `docs/explanation/calibration.md`, and all repeats to
`docs/data/calibration.jsonl.gz`.

    python scripts/measure_calibration.py run --out calibration.jsonl --truths white,second_step --repeats 20
    python scripts/measure_calibration.py show calibration.jsonl

So many repeats are reached in several sittings: what the file or `docs/data/calibration.jsonl.gz` holds already is not
done again. Each line names the version of the code, a digest of what decides intervals; lines of another version do
not count, which is said, unless `--accept VERSION` lets them.

Real sweeps are looked for in ``--data``, by default beside the checkout; without them, or without `simcoon`, the truths
that need them are left out with a word.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated, Any

import typer
from joblib import Parallel, delayed
from rich.console import Console
from rich.table import Table

sys.path.insert(0, str(Path(__file__).parent))

from calibration.page import write_page
from calibration.summary import QUANTITIES, is_reached, table
from calibration.trials import Trial, attempt, code_version, collected, keep, missing, to_do
from calibration.truths import TRUTHS

ROOT = Path(__file__).resolve().parents[1]
KEPT = ROOT / "docs" / "data" / "calibration.jsonl.gz"
SHORT = ("curve", "simult.", "K", "new", "cold", "middle", "hot", "start", "finish", "nearest")
"""Headings for the terminal, in the order of `QUANTITIES`."""
Accept = Annotated[str, typer.Option(help="Versions of the code that count as well, separated by commas.")]
Paths = Annotated[list[Path], typer.Argument(help="Files that `run` has written.")]
app = typer.Typer(add_completion=False, help=__doc__)


@app.command()
def run(
    out: Annotated[Path, typer.Option(help="File of JSON lines; lines are added.")],
    truths: Annotated[str, typer.Option(help="Names separated by commas.")] = ",".join(TRUTHS),
    repeats: Annotated[int, typer.Option(help="Of each truth.", min=1)] = 200,
    model: Annotated[str, typer.Option(help="As `sma_bayes.fit` takes it; by default not passed.")] = "",
    noise: Annotated[str, typer.Option(help="As `sma_bayes.fit` takes it.")] = "auto",
    jobs: Annotated[int, typer.Option(help="Processes.", min=1)] = 2,
    data: Annotated[Path, typer.Option(help="Folder of the real measurements.")] = ROOT.parent
    / "shared"
    / "data",
    accept: Accept = "",
) -> None:
    """Make, fit and score."""
    names = truths.split(",")
    unknown = [name for name in names if name not in TRUTHS]
    if unknown:
        raise typer.BadParameter(f"no truth {', '.join(unknown)}; there are {', '.join(TRUTHS)}")
    for name in names:
        if reason := missing(name, data):
            typer.echo(f"left out: {name}: {reason}", err=True)
    possible = [name for name in names if not missing(name, data)]
    trials = [Trial(name, i, model, noise) for i in range(repeats) for name in possible]
    todo = to_do(trials, counted([KEPT, out], accept))
    typer.echo(f"{len(todo)} of {len(trials)} to do", err=True)
    cut_off = out.exists() and out.read_text(encoding="utf-8")[-1:] not in ("", "\n")
    with out.open("a", encoding="utf-8") as file:
        if cut_off:
            file.write("\n")
        results = Parallel(n_jobs=jobs, return_as="generator_unordered")(
            delayed(attempt)(t, data) for t in todo
        )
        for line in results:
            file.write(json.dumps(line) + "\n")
            file.flush()


def counted(paths: list[Path], accept: str) -> list[dict[str, Any]]:
    """Results of the present code and of accepted versions; those of others are told."""
    lines, others = collected(paths, accept.split(","))
    for version, count in others.items():
        typer.echo(f"{count} results of code {version} don't count; this is {code_version()}", err=True)
    return lines


@app.command()
def show(path: Paths, accept: Accept = "") -> None:
    """Print the table; shares outside 85 to 95 % are marked."""
    shown = Table("truth", "n", *SHORT, "width %", "s", "noise; model; discrepancy")
    for row in table(counted(path, accept)):
        cells = [
            "" if row[q] is None else f"{row[q]:.2f}{'' if is_reached(row, q) else ' !'}" for q in QUANTITIES
        ]
        width = "" if row["width"] is None else f"{100 * row['width']:.2g}"
        chosen = "; ".join(row[k] for k in ("noises", "models", "discrepancy"))
        shown.add_row(row["truth"], str(row["repeats"]), *cells, width, f"{row['seconds']:.1f}", chosen)
    Console(width=220).print(shown)


@app.command()
def page(path: Paths, accept: Accept = "") -> None:
    """Write the table into the documentation, and keep the repeats for a later run."""
    lines = counted([KEPT, *path], accept)
    if not lines:
        raise typer.BadParameter(f"no results of code {code_version()} in {', '.join(map(str, path))}")
    keep(lines, KEPT)
    write_page(lines, ROOT / "docs")


if __name__ == "__main__":
    app()
