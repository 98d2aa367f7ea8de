"""A first campaign file for a folder of data files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from sma_bayes.records.starting_file import write_starting_file
from sma_bayes.studies.init.schema import StartDocument


def start_campaign(folder: str | Path) -> dict[str, Any]:
    """Write a commented ``campaign.toml`` for the data files of a folder, with all guesses marked as such.

    Headers tell quantities and units, file names and held forces what was set. Where there is no header, the way in
    which the numbers run tells the thermometer from the channels. Every condition is read and split into branches
    before it is declared; what fails stands in the file as a comment, with the reason.

    Parameters
    ----------
    folder : str or Path
        Sub-folders are looked into where the folder itself has no file that can be used.

    Returns
    -------
    dict
        What `sma-bayes init --json` prints (``sma-bayes/init/1``).

    Raises
    ------
    CampaignError
        If there is no such folder.
    OutputError
        If it holds a ``campaign.toml`` already, or can't be written to.
    MeasurementError
        If no file in it can be fitted; the message says why, file by file.
    """
    found = write_starting_file(folder)
    return StartDocument.about(
        found, schema="sma-bayes/init/1", file=str(found.path), left_out=dict(found.left_out)
    ).as_json()
