"""The verb `inspect` on the command line."""

from __future__ import annotations

from functools import partial

from sma_bayes.studies.command_execution import show_found
from sma_bayes.studies.command_options import Data, Json, Quiet, SourceArgument


def command(
    path: SourceArgument,
    data: Data = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Show what was read: channels, units, conditions, cycles, branches, noise, findings."""
    from sma_bayes.records.campaign import read_campaign
    from sma_bayes.studies.inspect.terminal import show_inspection
    from sma_bayes.studies.inspect.workflow import inspect_campaign

    campaign = read_campaign(path, data_dir=data)
    report = inspect_campaign(campaign)
    show_found(report, quiet, as_json, partial(show_inspection, report, campaign))
