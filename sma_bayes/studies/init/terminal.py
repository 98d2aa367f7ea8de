"""What a first campaign file declares, on the screen."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from sma_bayes.errors import many
from sma_bayes.report.screen import SHOWN, screen


def show_start(found: Mapping[str, Any]) -> None:
    """Tell what was declared, what of it is a guess, what was left out, and what comes next."""
    console = screen()

    def tell(lines: list[str]) -> None:
        for line in lines[:SHOWN]:
            console.print(f"  {line}", soft_wrap=True)
        if len(lines) > SHOWN:
            console.print(f"  and {len(lines) - SHOWN} more")

    console.print(f"{found['file']}: {many(len(found['conditions']), 'condition')}", soft_wrap=True)
    if found["guesses"]:
        console.print("guessed, please check:")
        tell(list(found["guesses"]))
    if found["left_out"]:
        console.print("left out:")
        tell([f"{name}: {why}" for name, why in found["left_out"].items()])
    console.print(f"next: sma-bayes inspect {Path(found['file']).parent}", soft_wrap=True)
