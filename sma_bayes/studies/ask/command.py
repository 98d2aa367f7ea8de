"""The verb `ask` on the command line."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from sma_bayes.studies.command_execution import finish
from sma_bayes.studies.command_options import Json, Quiet


def command(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder that fit or demo has written.")],
    at: Annotated[
        list[str] | None,
        typer.Option(help="A temperature, such as '60 degC', at which to tell everything; may be repeated."),
    ] = None,
    unit: Annotated[
        list[str] | None,
        typer.Option(
            help="Unit of the answer to --at, such as 'N/mm', for what it suits; may be repeated. "
            "By default that of the measurements, with --json that of the fit."
        ),
    ] = None,
    stiffness: Annotated[
        str | None, typer.Option("--stiffness", "--modulus", help="Wanted stiffness, such as '130 N/m'.")
    ] = None,
    force: Annotated[
        str | None, typer.Option("--force", "--stress", help="Wanted force, such as '2.5 N'.")
    ] = None,
    displacement: Annotated[
        str | None, typer.Option("--displacement", "--strain", help="Wanted displacement, such as '12 mm'.")
    ] = None,
    overall_stiffness: Annotated[
        str | None,
        typer.Option(help="Wanted stiffness together with the bias spring of `fit --arrangement`."),
    ] = None,
    tolerance: Annotated[str, typer.Option(help="How far off it may be: '5 %' or '4 N/m'.")] = "5 %",
    probability: Annotated[float, typer.Option(help="Probability with which it is to be met.")] = 0.9,
    condition: Annotated[str | None, typer.Option(help="Only this condition.")] = None,
    branch: Annotated[str | None, typer.Option(help="Only 'heating' or 'cooling'.")] = None,
    extrapolate: Annotated[
        float,
        typer.Option(
            help="How far to search beyond the measured temperatures; results there are marked.", min=0.0
        ),
    ] = 0.0,
    temperature_sd: Annotated[
        float, typer.Option(help="Standard deviation of the error of the controller's temperature.", min=0.0)
    ] = 0.0,
    temperature_unit: Annotated[
        str | None,
        typer.Option(
            help="Unit of temperatures in question and answer, such as degF; by default that of the fit."
        ),
    ] = None,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Tell the response at a temperature, or the temperatures that give a wanted value, with probabilities."""
    from sma_bayes.report.screen import screen
    from sma_bayes.runs.declared_units import declared_units
    from sma_bayes.runs.outputs import read_run
    from sma_bayes.studies.ask.terminal import answer_text, show_values_at
    from sma_bayes.studies.ask.workflow import ask

    if at and not unit and not as_json:
        unit = declared_units(read_run(folder).summary.records)
    found = ask(
        folder,
        at=at,
        unit=unit,
        stiffness=stiffness,
        force=force,
        displacement=displacement,
        overall_stiffness=overall_stiffness,
        tolerance=tolerance,
        probability=probability,
        condition=condition,
        branch=branch,
        extrapolate=extrapolate,
        temperature_sd=temperature_sd,
        temperature_unit=temperature_unit,
    )
    show = partial(show_values_at, found) if at else lambda: screen().tell(answer_text(found))
    finish(found, quiet, as_json, show)
