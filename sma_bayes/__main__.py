"""The program. Signals are heeded before the command line is imported, which takes a moment."""

from __future__ import annotations

import gc

from sma_bayes.interruption import ending_in_order

COLLECTION_THRESHOLDS = (20_000, 50, 50)
"""Thresholds of the garbage collector. What is large here are arrays, which go without it; what it looks through are
modules and figures: at its own pace it takes a fifteenth of the time of a fit."""


def main() -> None:
    """Run the command line, see `sma_bayes.cli.main`."""
    gc.set_threshold(*COLLECTION_THRESHOLDS)
    with ending_in_order():
        from sma_bayes.cli import main as command_line

        try:
            command_line()
        finally:
            gc.freeze()  # what is left goes with the process: looking through it once more takes a tenth of a short fit


if __name__ == "__main__":
    main()
