"""What a first campaign file declares, on the screen."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from sma_bayes.disk import quoted
from sma_bayes.errors import many
from sma_bayes.report.screen import ENTRIES_SHOWN, screen
from sma_bayes.studies.init.schema import StartDocument


def show_start(found: Mapping[str, Any]) -> None:
    """Tell what was declared, what of it is a guess, what was left out, and what comes next."""
    document, console = StartDocument.model_validate(found), screen()

    def tell(lines: Sequence[str]) -> None:
        console.tell(*(f"  {line}" for line in lines[:ENTRIES_SHOWN]))
        if len(lines) > ENTRIES_SHOWN:
            console.print(f"  and {len(lines) - ENTRIES_SHOWN} more")

    console.tell(f"{document.file}: {many(len(document.conditions), 'condition')}")
    if document.guesses:
        console.print("guessed, please check:")
        tell(document.guesses)
    if document.left_out:
        console.print("left out:")
        tell([f"{name}: {why}" for name, why in document.left_out.items()])
    console.tell(f"next: sma-bayes inspect {quoted(Path(document.file).parent)}")
