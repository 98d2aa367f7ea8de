"""What commands share: where their tasks are done, to whom they tell how far they are, and how they end."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from datetime import timedelta
from functools import partial, wraps
from importlib import import_module
from inspect import Parameter, signature
from typing import Any, Final

import typer

from sma_bayes.account import Account
from sma_bayes.errors import SmaBayesError
from sma_bayes.progress import LINE_S, Bar, log_lines
from sma_bayes.studies import command_options as opt

COMMON: Final = {
    "seed": (opt.Seed, 0), "jobs": (opt.Jobs, None), "figures": (opt.Figures, "report"),
    "no_figures": (opt.NoFigures, False), "scheduler": (opt.Scheduler, None), "resume": (opt.Resume, False),
    "quiet": (opt.Quiet, False), "verbose": (opt.Verbose, False), "as_json": (opt.Json, False),
}  # fmt: skip
"""Options of every study by itself, with what they are by default."""


def calls(
    function: str, show: str, *, without: tuple[str, ...] = (), tasks: bool = True
) -> Callable[[Callable[..., dict[str, Any] | None]], Callable[..., None]]:
    """Make a command of a function that has only the options of its verb.

    The options that every study has (`COMMON`) join them, and a function of the folder of the verb is called with all
    of them by name; those that were not given are left to its own defaults. Of a path it gets the campaign that stands
    there. What the command itself returns, if anything, replaces options.

    Parameters
    ----------
    function : str
        Name in `workflow` beside the command. It gives what the document holds.
    show : str
        Name in `terminal` beside it of what tells that to people; it takes what was found, and the folder `out`.
    without : tuple of str
        Common options that the verb has not, or has in another place.
    tasks : bool
        Whether its steps are tasks that take about the same time.
    """

    def of(command: Callable[..., dict[str, Any] | None]) -> Callable[..., None]:
        folder, own = command.__module__.rpartition(".")[0], signature(command, eval_str=True)
        common = {name: option for name, option in COMMON.items() if name not in without}

        @wraps(command)
        def carried_out(**given: Any) -> None:
            options = given | (command(**{name: given[name] for name in own.parameters}) or {})
            quiet, verbose, as_json = (options.pop(name) for name in ("quiet", "verbose", "as_json"))
            scheduler, strict = options.pop("scheduler", None), options.pop("strict", False)
            if options.pop("no_figures"):
                options["figures"] = "none"
            options = {name: value for name, value in options.items() if value is not None}
            account, jobs = Account(), given.get("jobs")
            carry_out = getattr(import_module(f"{folder}.workflow"), function)
            with workers(scheduler, jobs), progress_shown(quiet or as_json, verbose, tasks=tasks) as progress:
                if "path" in options:
                    from sma_bayes.records.campaign import read_campaign

                    with account.timed("read"):
                        campaign = read_campaign(options.pop("path"), data_dir=options.pop("data", None))
                    options["campaign"] = campaign
                found = carry_out(**options, progress=progress, account=account)
            tell = getattr(import_module(f"{folder}.terminal"), show)
            finish(found, quiet, as_json, partial(tell, found, given["out"]), strict=strict)

        joined = [
            Parameter(name, Parameter.KEYWORD_ONLY, annotation=option, default=usual)
            for name, (option, usual) in common.items()
        ]
        carried_out.__signature__ = own.replace(parameters=[*own.parameters.values(), *joined])  # type: ignore[attr-defined]
        return carried_out

    return of


@contextmanager
def workers(scheduler: str | None, jobs: int | None) -> Iterator[None]:
    """Where tasks are done: on processes of this machine, or on the cluster of a scheduler."""
    if scheduler is None:
        yield
        return
    if jobs is not None:
        raise SmaBayesError(
            f"--scheduler {scheduler} and --jobs {jobs}",
            expected="one of the two: a cluster has as many workers as were started",
            remedy="leave one of them out",
        )
    from sma_bayes.runs.jobs import cluster

    with cluster(scheduler):
        yield


@contextmanager
def progress_shown(
    silent: bool, verbose: bool, *, tasks: bool = True
) -> Iterator[Callable[[int, int, str], None] | None]:
    """A progress bar on standard error; log lines where that is not a terminal, or where every step is wanted."""
    if silent and not verbose:
        yield None
        return
    if verbose or not sys.stderr.isatty():
        with log_lines(0.0 if verbose else LINE_S, tasks=tasks) as lines:
            yield lines
        return
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        ProgressColumn,
        Task,
        TextColumn,
        TimeElapsedColumn,
    )
    from rich.text import Text

    class TimeLeftColumn(ProgressColumn):
        def render(self, task: Task) -> Text:
            return Text(time_left(task.time_remaining), style="progress.remaining")

    columns: list[ProgressColumn] = [TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn()]
    columns += [TimeElapsedColumn(), *([TimeLeftColumn()] if tasks else [])]
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("reading", total=None)

        def update(done: int, total: int, message: str) -> None:
            bar.update(task, completed=done, total=total, description=message)

        yield Bar(update, lambda text: bar.console.print(text, markup=False, highlight=False))


def time_left(seconds: float | None) -> str:
    """How long the rest will take, in words; empty where nobody knows yet.

    Examples
    --------
    >>> time_left(75.2), time_left(None)
    ('0:01:15 left', '')
    """
    return "" if seconds is None else f"{timedelta(seconds=int(seconds))} left"


def show_found(found: Mapping[str, Any], quiet: bool, as_json: bool, show: Callable[[], None]) -> None:
    """Tell what was found as JSON, for people or not at all."""
    if as_json:
        typer.echo(json.dumps(found, indent=1))
    elif not quiet:
        show()


def finish(
    found: dict[str, Any], quiet: bool, as_json: bool, show: Callable[[], None], *, strict: bool = False
) -> None:
    """Tell what was found, see `show_found`, and end with its exit status.

    It is ``exit_status`` where the document has one; else 1 where it has not ``converged``, and with `strict` where it
    is not ``adequate``. What says nothing of these is good.
    """
    if as_json:
        from sma_bayes.document_part import plain

        found = plain(found)
    show_found(found, quiet, as_json, show)
    good = found.get("converged", True) and (found.get("adequate", True) if strict else True)
    status = found.get("exit_status", 0 if good else 1)
    if status:
        raise typer.Exit(status)
