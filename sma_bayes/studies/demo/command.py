"""The verb `demo` on the command line."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from sma_bayes.account import Account
from sma_bayes.studies import command_options as opt
from sma_bayes.studies.command_execution import finish, progress_shown, workers


def command(
    out: Annotated[Path, typer.Option(help="Folder for the results.")] = Path("sma-bayes-demo"),
    paper: Annotated[
        bool,
        typer.Option(
            "--paper", help="The twin of the published campaign instead: 18 records in its own units."
        ),
    ] = False,
    seed: opt.Seed = 0,
    jobs: opt.Jobs = None,
    noise: opt.Noise = "auto",
    figures: opt.Figures = "report",
    no_figures: opt.NoFigures = False,
    scheduler: opt.Scheduler = None,
    resume: opt.Resume = False,
    strict: opt.Strict = False,
    quiet: opt.Quiet = False,
    verbose: opt.Verbose = False,
    as_json: opt.Json = False,
) -> None:
    """Fit measurements of a simulated rig, whose truth is known: no other file, no network."""
    from sma_bayes.paper.twin import twin_campaign
    from sma_bayes.runs.store import write_file
    from sma_bayes.simulated.campaign import MEASUREMENTS, measurement_files, simulated_campaign
    from sma_bayes.studies.demo.terminal import show_demo
    from sma_bayes.studies.fit.terminal import show_fit
    from sma_bayes.studies.fit.workflow import fit_campaign
    from sma_bayes.studies.identity import is_run_of

    account = Account()
    with workers(scheduler, jobs), progress_shown(quiet or as_json, verbose) as progress:
        with account.timed("read"):
            campaign = (twin_campaign if paper else simulated_campaign)(seed)
        summary = fit_campaign(
            campaign,
            out,
            seed=seed,
            noise=noise,
            resume=resume or is_run_of(out, campaign),
            figures="none" if no_figures else figures,
            jobs=jobs,
            progress=progress,
            account=account,
        )
    if not paper:
        for name, text in measurement_files(seed).items():
            write_file(
                out / MEASUREMENTS / name, partial(Path.write_text, data=text, encoding="utf-8", newline="\n")
            )
    finish(
        summary,
        quiet,
        as_json,
        lambda: show_fit(summary, out) if paper else show_demo(summary, out),
        strict=strict,
    )
