"""Fits of every set of real measurements with a temperature and a response, beside what a user would take instead.

`run` fits each record with the package's defaults and with the baselines (extra ``bench``), holds out blocks, ends and
sweeps, and adds a line of JSON for each record and method to a file; what is there already is not done again. `page`
writes `docs/data/real_measurements.csv` and the tables of `docs/real_measurements.md`, with what is asked beside what
was reached; `targets` prints the latter. Records and methods that the file does not hold are taken from the table as
it stands.

    python scripts/real_measurements.py run --out real.jsonl --data FOLDER
    python scripts/real_measurements.py targets real.jsonl
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated

import typer
from joblib import Parallel, delayed

sys.path.insert(0, str(Path(__file__).parent))

from calibration.trials import read
from real_records.page import joined, targets as reached, write_page
from real_records.records import SETS, measured_records
from real_records.trials import METHODS, attempt

ROOT = Path(__file__).resolve().parents[1]
app = typer.Typer(add_completion=False, help=__doc__)
Lines = Annotated[Path, typer.Argument(help="File that `run` has written.", exists=True, dir_okay=False)]


@app.command()
def run(
    out: Annotated[Path, typer.Option(help="File of JSON lines; lines are added.")],
    data: Annotated[Path, typer.Option(help="Folder of the sets.")] = ROOT.parent / "shared" / "data",
    methods: Annotated[str, typer.Option(help="Names separated by commas.")] = ",".join(METHODS),
    sets: Annotated[str, typer.Option(help="Names of examples separated by commas.")] = ",".join(SETS),
    model: Annotated[str, typer.Option(help="As `sma_bayes.fit` takes it; by default not passed.")] = "",
    jobs: Annotated[int, typer.Option(help="Processes.", min=1)] = 2,
) -> None:
    """Fit, hold out and score."""
    for asked, known in ((methods, METHODS), (sets, tuple(SETS))):
        if unknown := set(asked.split(",")) - set(known):
            raise typer.BadParameter(f"no {', '.join(sorted(unknown))}; there are {', '.join(known)}")
    if not data.is_dir():
        raise typer.BadParameter(f"no folder {data}")
    done = {(line["key"], line["method"], line["model_asked"]) for line in read(out)}
    records = [m for m in measured_records(data) if m.example in sets.split(",")]
    wanted = [(m, name, model if name == "ours" else "") for name in methods.split(",") for m in records]
    todo = [w for w in wanted if (w[0].key, w[1], w[2]) not in done]
    typer.echo(f"{len(todo)} of {len(wanted)} to do", err=True)
    with out.open("a", encoding="utf-8") as file:
        results = Parallel(n_jobs=jobs, return_as="generator_unordered")(delayed(attempt)(*w) for w in todo)
        for line in results:
            file.write(json.dumps(line) + "\n")
            file.flush()


@app.command()
def page(path: Lines) -> None:
    """Write the tables into the documentation."""
    write_page(list(read(path)), ROOT / "docs")


@app.command()
def targets(path: Lines) -> None:
    """Print what is asked and what was reached."""
    for target in reached(joined(list(read(path)), ROOT / "docs" / "data" / "real_measurements.csv")):
        typer.echo(f"{'reached' if target.is_reached else 'NOT reached'}: {target.asked}: {target.found}")


if __name__ == "__main__":
    app()
