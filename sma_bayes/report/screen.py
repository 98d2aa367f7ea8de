"""The screen: how wide it is, how long a list may grow, and the last lines of every run."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any, Final

from rich.console import Console

SHOWN: Final = 20
"""Entries of a list on the screen, where there are very many."""


def screen() -> Console:
    """What people read on; as wide as the widest table where it is no terminal."""
    return Console(width=None if sys.stdout.isatty() else 160, markup=False, emoji=False)


def show_end(console: Console, found: dict[str, Any], out: Path) -> None:
    """Tell what was left out, what was lost on the way, how long it took and where it is."""
    if found.get("figures") == "report":
        console.print(
            f"figures of the report only; `sma-bayes report {out} --figures all` draws the others",
            soft_wrap=True,
        )
    for text in found.get("workers", {}).get("lost", ()):
        console.print(f"a worker came to an end ({text}); what it did was done again", soft_wrap=True)
    console.print(f"{found['wall_s']:.1f} s; results in {out}", soft_wrap=True)


def show_text(text: str, found: dict[str, Any], out: Path) -> None:
    """Tell what a run found in words that are there, and how it ended."""
    print(text)
    show_end(screen(), found, out)
