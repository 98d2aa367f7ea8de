"""Do the 90 % intervals that `fit` gives hold the truth in 85 to 95 % of the cases?

`run` makes measurements of known truths (`calibration.truths`), fits each as a user would, with the package's defaults,
and adds a line of JSON for each repeat to a file; what is there already is not done again. `show` prints the table,
`page` writes it to `docs/data/calibration.csv` and into `docs/explanation/calibration.md`.

    python scripts/measure_calibration.py run --out calibration.jsonl --truths white,second_step --repeats 20
    python scripts/measure_calibration.py show calibration.jsonl

Real sweeps are looked for in ``--data``, by default beside the checkout; without them, or without `simcoon`, the truths
that need them are left out with a word.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated

import typer
from joblib import Parallel, delayed
from rich.console import Console
from rich.table import Table

sys.path.insert(0, str(Path(__file__).parent))

from calibration.page import write_page
from calibration.summary import QUANTITIES, is_reached, table
from calibration.trials import Trial, attempt, missing, read, to_do
from calibration.truths import TRUTHS

ROOT = Path(__file__).resolve().parents[1]
SHORT = ("curve", "simult.", "K", "new", "cold", "middle", "hot", "start", "finish", "nearest")
"""Headings for the terminal, in the order of `QUANTITIES`."""
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
    todo = to_do(trials, out)
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


@app.command()
def show(path: Annotated[Path, typer.Argument(help="File that `run` has written.")]) -> None:
    """Print the table; shares outside 85 to 95 % are marked."""
    shown = Table("truth", "n", *SHORT, "width %", "s", "noise; model; discrepancy")
    for row in table(read(path)):
        cells = [
            "" if row[q] is None else f"{row[q]:.2f}{'' if is_reached(row, q) else ' !'}" for q in QUANTITIES
        ]
        width = "" if row["width"] is None else f"{100 * row['width']:.2g}"
        chosen = "; ".join(row[k] for k in ("noises", "models", "discrepancy"))
        shown.add_row(row["truth"], str(row["repeats"]), *cells, width, f"{row['seconds']:.1f}", chosen)
    Console(width=220).print(shown)


@app.command()
def page(path: Annotated[Path, typer.Argument(help="File that `run` has written.")]) -> None:
    """Write the table into the documentation."""
    write_page(list(read(path)), ROOT / "docs")


if __name__ == "__main__":
    app()
