"""Progress of a run: whom it tells."""

from __future__ import annotations

from collections.abc import Callable

Progress = Callable[[int, int, str], None]
"""Told how many tasks are done, how many there are, and what is going on."""


def silent(done: int, total: int, message: str) -> None:
    """Progress that nobody wants to know."""
