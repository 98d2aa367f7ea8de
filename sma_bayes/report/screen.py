"""The screen: how wide it is, how long a list may grow, and the last lines of every run."""

from __future__ import annotations

import sys
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from textwrap import fill
from typing import Any, Final, Self

from rich.cells import cell_len
from rich.console import Console, JustifyMethod
from rich.table import Column, Table
from rich.text import Text

from sma_bayes.disk import quoted
from sma_bayes.report.notation import with_minus, with_percent

ENTRIES_SHOWN: Final = 20
"""Entries of a list on the screen, where there are very many."""
LEAST_LETTERS_OF_WORDS: Final = 32
"""Letters of a line from which on people read sentences in a column."""
SIMPLER_NOISE_MODELS: Final = ("ar1", "independent")
"""Noise models under which fits converge that do not under richer ones, mostly in seconds; the richer first. Of four
real records two did under either, and each under one of them; but then none was adequate."""


def what_helps(noises: Collection[str] = ()) -> str:
    """What to do about a fit that has not converged.

    Parameters
    ----------
    noises : collection of str
        Names of the noise models of such records, where they are known; what is no simpler is not advised.
    """
    tried = [SIMPLER_NOISE_MODELS.index(name) if name in SIMPLER_NOISE_MODELS else -1 for name in noises]
    left = SIMPLER_NOISE_MODELS[min(tried, default=-1) + 1 :]
    advised = ", or else ".join(f"`--noise {name}`" for name in left)
    simpler = f"a simpler noise ({advised}; see whether the fit is adequate then), " if left else ""
    return (
        f"what helps: {simpler}a curve that suits the data (`--model auto`), narrower priors of what they leave open "
        "(`--priors`), or another `--seed`"
    )


FIT_AGAIN: Final = f"fit again; {what_helps()}"
"""What to do about what was made from a fit that has not converged."""
NOT_CONVERGED: Final = f"NOT CONVERGED: these numbers must not be relied on; {FIT_AGAIN}"
"""What is said of numbers that were made from one."""


class Screen(Console):
    """What people read on; negative numbers have a minus sign there, in sentences and in cells of tables."""

    def render_str(self, text: str, **how: Any) -> Text:
        return super().render_str(with_minus(text), **how)

    def print(self, *shown: Any, **how: Any) -> None:
        """Print what is shown, a table that is too wide as several, so that no cell is cut; its title is a sentence."""
        if len(shown) == 1 and isinstance(shown[0], Table):
            if shown[0].title:
                self.tell(str(shown[0].title))
            for part in fitting(shown[0], self.width):
                part.title = None
                super().print(part, **how)
        else:
            super().print(*shown, **how)

    def tell(self, *sentences: str) -> None:
        """Print sentences, each on a line that is as long as it takes."""
        for sentence in sentences:
            self.print(with_percent(sentence), soft_wrap=True)


def screen() -> Screen:
    """What people read on; as wide as the widest table where it is no terminal."""
    return Screen(width=None if sys.stdout.isatty() else 160, markup=False, emoji=False)


def fitting(table: Table, width: int) -> Iterator[Table]:
    """A table, or where it is too wide several of its columns each, after the first ones that tell its rows apart.

    Numbers stand on one line; words go on below each other, and none of them is cut. Sentences have
    `LEAST_LETTERS_OF_WORDS` where there is room.

    Parameters
    ----------
    table : Table
        Headers and cells are text.
    width : int
        Letters of a line.
    """
    columns = [_Measured.of(c) for c in table.columns]
    _, right, _, left = table.padding
    total = partial(_total, around=left + right + 1)
    if total(c.widest for c in columns) <= width:
        yield copy(table)
        return
    named = _naming(columns)
    parts: list[list[_Measured]] = [columns[:named]]
    room = width - total(c.least for c in columns[:named]) - left - right - 1
    for c in (c.readable(room) for c in columns[named:]):
        if len(parts[-1]) > named and total(x.least for x in (*parts[-1], c)) > width:
            parts.append(columns[:named])
        parts[-1].append(c)
    for number, part in enumerate(parts):
        spare = max(width - total(c.least for c in part), 0)
        some = copy(table)
        some.columns, some.rows = [], []
        some.title = table.title if number == 0 else None
        for c in part:
            more = min(spare, c.widest - c.least)
            spare -= more
            header = fill(c.header, c.least + more, break_long_words=False, break_on_hyphens=False)
            some.add_column(header, justify=c.justify, width=c.least + more, overflow="fold")
        for row, cells in zip(table.rows, zip(*(c.cells for c in part), strict=True), strict=True):
            some.add_row(*cells, style=row.style, end_section=row.end_section)
        yield some


def _naming(columns: Sequence[_Measured]) -> int:
    """How many of the first columns tell all rows apart; one where none do."""
    for count in range(1, len(columns)):
        rows = list(zip(*(c.cells for c in columns[:count]), strict=True))
        if len(set(rows)) == len(rows):
            return count
    return 1


def _total(widths: Iterable[int], around: int) -> int:
    """Width of a table, with so many letters of rule and padding around each column."""
    return sum(w + around for w in widths) + 1


@dataclass(frozen=True, slots=True)
class _Measured:
    """A column with its width where nothing wraps, and the least that cuts nothing."""

    header: str
    cells: tuple[str, ...]
    justify: JustifyMethod
    widest: int
    least: int

    @classmethod
    def of(cls, column: Column) -> Self:
        header, cells = str(column.header), tuple(map(str, column.cells))
        whole = max((cell_len(line) for text in cells for line in text.splitlines()), default=0)
        words = [header] if column.justify == "right" else [header, *cells]
        word = max((cell_len(w) for text in words for w in text.split()), default=0)
        least = max(word, whole) if column.justify == "right" or column.no_wrap else word
        return cls(header, cells, column.justify, max(whole, cell_len(header)), least)

    def readable(self, room: int) -> Self:
        """The same with as many letters for sentences as they should have, and there are."""
        words = self.justify != "right"
        return (
            replace(self, least=max(self.least, min(self.widest, LEAST_LETTERS_OF_WORDS, room)))
            if words
            else self
        )


numbers = partial(Column, justify="right")
"""A column of numbers."""


def titled(title: str, *columns: Column | str) -> Table:
    """A table under its title; a column that is but named holds words."""
    return Table(*columns, title=title, title_justify="left")


def show_end(console: Screen, found: Mapping[str, Any], out: Path | None) -> None:
    """Tell what was left out, what was lost on the way, how long it took and where it is, if it is anywhere."""
    if out is None:
        return
    if found.get("figures") == "report":
        console.tell(
            f"figures of the report only; `sma-bayes report {quoted(out)} --figures all` draws the others"
        )
    lost = found.get("workers", {}).get("lost", ())
    console.tell(*(f"a worker came to an end ({text}); what it did was done again" for text in lost))
    console.tell(f"{found['wall_s']:.1f} s; results in {out}")


def show_text(text: str, found: dict[str, Any], out: Path) -> None:
    """Tell what a run found in words that are there, and how it ended."""
    console = screen()
    console.tell(text)
    show_end(console, found, out)
