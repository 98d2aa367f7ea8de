"""The demo on the screen: what a fit tells, and how it compares with the truth."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from sma_bayes.report.screen import screen
from sma_bayes.runs.outputs import read_run
from sma_bayes.simulated.campaign import MEASUREMENTS
from sma_bayes.studies.fit.report_content import report_content
from sma_bayes.studies.fit.terminal import show_fit


def show_demo(summary: dict[str, Any], out: Path) -> None:
    """Tell what `summary.json` says, and how far the bands hold the truth."""
    show_fit(summary, out)
    known = report_content(read_run(out)).truth
    held = ", ".join(
        f"{name} {sum(parts) / len(parts):.0%}"
        for name in dict.fromkeys(k.name for k in known)
        for parts in [[k.within for k in known if k.name == name]]
    )
    console = screen()
    console.tell(f"truth known; share of the temperatures at which the 90 % band contains it: {held}")
    console.tell(f"the measurements: {out / MEASUREMENTS}; `sma-bayes demo --paper` fits the paper's twin")
