"""A report is put together: its figures, its tables, and the page that shows both."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, Protocol, TypeVar

from sma_bayes.account import Account
from sma_bayes.report.choice import ReportOptions
from sma_bayes.report.drawn import FigureTask, draw_all
from sma_bayes.report.figures.sheet import Drawing
from sma_bayes.report.html import write_page
from sma_bayes.report.tables import Table, write_tables
from sma_bayes.report.took import account_table
from sma_bayes.report.workbook import write_workbook
from sma_bayes.runs.schema import RunAccount


class Stored(Protocol):
    """A finished run, as its folder holds it."""

    @property
    def folder(self) -> Path: ...
    @property
    def found(self) -> RunAccount:
        """What its document holds."""
        ...


S = TypeVar("S", bound=Stored)


def assemble(
    package: str,
    stored: S,
    wanted: ReportOptions,
    drawings: Sequence[Callable[[S], Drawing]],
    tables: Callable[[S], dict[str, Table]],
    words: Callable[[S, Mapping[str, Table]], dict[str, Any]] | None = None,
    **named: object,
) -> None:
    """Draw figures, write tables, and write the page that shows them.

    Parameters
    ----------
    package : str
        That has the template of the page, ``page.html.j2``.
    stored : Stored
    wanted : ReportOptions
    drawings : sequence of callable
        One for each figure.
    tables : callable
    words : callable, optional
        Of the run and its tables: what the template names besides ``found``, ``tables`` and ``pictures``.
    **named
        The same, where it does not follow from the tables.

    Raises
    ------
    OutputError
        If the page can't be written, or a figure can't be read.
    """
    spent = wanted.account or Account()
    tasks = [FigureTask(partial(tuple, [partial(draw, stored)])) for draw in drawings]
    figures = draw_all(stored.folder, tasks, wanted.formats, wanted.jobs, wanted.tell, spent)
    with spent.timed("report"):
        written = written_tables(tables(stored), stored.found, stored.folder, wanted)
        of_tables = {} if words is None else words(stored, written)
        write_page(stored.folder, package, figures, found=stored.found, tables=written, **of_tables, **named)
    wanted.tell(len(tasks) + 1, len(tasks) + 1, "wrote report.html")


def written_tables(
    tables: dict[str, Table], found: RunAccount, folder: Path, wanted: ReportOptions
) -> dict[str, Table]:
    """Write tables, with what the run took beside them; return all."""
    everything = tables | {"account": account_table(found, wanted.account or Account())}
    write_tables(everything, folder / "tables")
    if wanted.workbook:
        write_workbook(everything, folder / "tables" / "results.xlsx")
    return everything
