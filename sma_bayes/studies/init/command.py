"""The verb `init` on the command line."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from sma_bayes.studies.command_execution import show_found
from sma_bayes.studies.command_options import Json, Quiet


def command(
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="Folder with data files.")],
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Write a campaign.toml for a folder of data files, with all guesses marked; nothing is overwritten."""
    from sma_bayes.studies.init.terminal import show_start
    from sma_bayes.studies.init.workflow import start_campaign

    found = start_campaign(folder)
    show_found(found, quiet, as_json, partial(show_start, found))
