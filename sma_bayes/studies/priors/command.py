"""The verb `priors` on the command line."""

from __future__ import annotations

from typing import Annotated

import typer


def command(
    model: Annotated[
        str, typer.Argument(help="Name of a response model, or of a shipped set.")
    ] = "modified_sigmoid",
    list_all: Annotated[bool, typer.Option("--list", help="List all of them.")] = False,
) -> None:
    """Print the priors in force as TOML, to edit and pass back with --priors FILE."""
    from sma_bayes.parameters.priors_file import shipped_priors
    from sma_bayes.response import RESPONSE_MODELS, priors_named

    if list_all:
        for name in sorted({*shipped_priors(), *RESPONSE_MODELS}):
            typer.echo(f"{name}: {priors_named(name).title}")
        return
    typer.echo(priors_named(model).whole_text, nl=False)
