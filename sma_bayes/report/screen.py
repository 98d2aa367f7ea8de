"""The screen: how wide it is, how long a list may grow, and the last lines of every run."""

from __future__ import annotations

import sys
from collections.abc import Collection, Mapping
from functools import partial
from pathlib import Path
from typing import Any, Final

from rich.console import Console
from rich.table import Column, Table
from rich.text import Text

from sma_bayes.report.notation import with_minus

SHOWN: Final = 20
"""Entries of a list on the screen, where there are very many."""
SIMPLER: Final = ("ar1", "independent")
"""Noise models under which fits converge that do not under richer ones, mostly in seconds; the richer first. Of four
real records two did under either, and each under one of them; but then none was adequate."""


def what_helps(noises: Collection[str] = ()) -> str:
    """What to do about a fit that has not converged.

    Parameters
    ----------
    noises : collection of str
        Names of the noise models of such records, where they are known; what is no simpler is not advised.
    """
    tried = [SIMPLER.index(name) if name in SIMPLER else -1 for name in noises]
    left = SIMPLER[min(tried, default=-1) + 1 :]
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

    def tell(self, *sentences: str) -> None:
        """Print sentences, each on a line that is as long as it takes."""
        for sentence in sentences:
            self.print(sentence, soft_wrap=True)


def screen() -> Screen:
    """What people read on; as wide as the widest table where it is no terminal."""
    return Screen(width=None if sys.stdout.isatty() else 160, markup=False, emoji=False)


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
        console.tell(f"figures of the report only; `sma-bayes report {out} --figures all` draws the others")
    lost = found.get("workers", {}).get("lost", ())
    console.tell(*(f"a worker came to an end ({text}); what it did was done again" for text in lost))
    console.tell(f"{found['wall_s']:.1f} s; results in {out}")


def show_text(text: str, found: dict[str, Any], out: Path) -> None:
    """Tell what a run found in words that are there, and how it ended."""
    console = screen()
    console.tell(text)
    show_end(console, found, out)
