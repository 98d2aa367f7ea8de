"""The verb `paper` on the command line."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from sma_bayes.errors import SmaBayesError
from sma_bayes.limits import SEED
from sma_bayes.studies.command_execution import progress_shown
from sma_bayes.studies.command_options import Jobs, Quiet, Verbose


def command(
    errata: Annotated[bool, typer.Option("--errata", help="The errata only, without the tables.")] = False,
    table: Annotated[
        int | None, typer.Option(help="One table and its errata; 0 is the running text.", min=0)
    ] = None,
    form: Annotated[str, typer.Option("--format", help="text, csv, json, latex or markdown.")] = "text",
    out: Annotated[Path | None, typer.Option(help="Folder for files, one a table.")] = None,
    page: Annotated[
        Path | None,
        typer.Option(help="Folder for the page that puts every table and claim to the test; takes minutes."),
    ] = None,
    seed: Annotated[
        int,
        typer.Option(
            help="With --page: seed of the twin and of all random draws.", min=0, max=int(SEED.value)
        ),
    ] = 0,
    jobs: Jobs = None,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Show the paper's printed tables and their errata, printed and corrected side by side; or reproduce it."""
    if page is not None:
        if errata or table is not None or out is not None or form != "text":
            raise SmaBayesError(
                "--page together with --errata, --table, --format or --out",
                expected="--page by itself: it writes the whole page",
                remedy="give two commands",
            )
        _reproduce(page, seed, jobs, quiet, verbose)
        return
    from sma_bayes.studies.paper.export import render, select, write

    selection = select(table, errata_only=errata)
    if out is None:
        typer.echo(render(selection, form), nl=False)
        return
    for path in write(selection, out, form):
        typer.echo(str(path))


def _reproduce(folder: Path, seed: int, jobs: int | None, quiet: bool, verbose: bool) -> None:
    from sma_bayes.studies.paper.build import NUMBERS, PAGE, write_reproduction

    with progress_shown(quiet, verbose, tasks=False) as progress:
        found = write_reproduction(folder, seed=seed, jobs=jobs, progress=progress)
    if not quiet:
        for claim in found.claims:
            typer.echo(f"{claim.verdict}: {claim.claim}")
        typer.echo(f"page: {folder / PAGE}, numbers: {folder / NUMBERS}")
    if not found.converged:
        raise typer.Exit(1)
