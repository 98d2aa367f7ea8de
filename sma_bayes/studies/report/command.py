"""The verb `report` on the command line."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from sma_bayes.errors import SmaBayesError
from sma_bayes.studies.command_execution import progress_shown, workers
from sma_bayes.studies.command_options import Figures, Jobs, Quiet, Scheduler, Verbose


def command(
    folder: Annotated[
        Path,
        typer.Argument(
            metavar="DIR", help="Folder that fit, gap, compare or another command with a report has written."
        ),
    ],
    figures: Figures = "report",
    formats: Annotated[
        str,
        typer.Option("--format", help="Format of the figures: 'pdf', 'svg', 'png', or several: 'pdf,svg'."),
    ] = "pdf,png",
    workbook: Annotated[
        bool, typer.Option("--workbook", help="All tables as tables/results.xlsx too, a sheet a table.")
    ] = False,
    figure_width: Annotated[
        str | None,
        typer.Option(
            help="Of a fit: only its loops for a paper, so wide, such as '85mm', into figures/publication."
        ),
    ] = None,
    condition: Annotated[
        list[str] | None, typer.Option(help="With --figure-width: only this condition; may be repeated.")
    ] = None,
    style: Annotated[
        Path | None, typer.Option(help="With --figure-width: a style file of matplotlib, applied first.")
    ] = None,
    jobs: Jobs = None,
    scheduler: Scheduler = None,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Rebuild the HTML report, figures and LaTeX tables from what a folder holds."""
    if figure_width is not None:
        if figures != "report" or workbook:
            raise SmaBayesError(
                f"--figure-width with {'--workbook' if workbook else '--figures'}",
                expected="one of them",
                remedy="call report twice: with --figure-width it draws the loops for a paper and nothing else",
            )
        from sma_bayes.studies.fit.publication_figures import publication_figures

        files = publication_figures(
            folder, figure_width, conditions=condition or (), formats=formats.split(","), style=style
        )
        if not quiet:
            typer.echo("\n".join(map(str, files)))
        return
    if condition or style:
        raise SmaBayesError(
            f"{'--condition' if condition else '--style'} without --figure-width", expected="both, or neither"
        )
    from sma_bayes.studies.report.build import build_report

    with workers(scheduler, jobs), progress_shown(quiet, verbose) as progress:
        build_report(
            folder,
            figures=figures,
            formats=formats.split(","),
            workbook=workbook,
            jobs=jobs,
            progress=progress,
        )
    if not quiet:
        typer.echo(f"report: {folder / 'report.html'}")
