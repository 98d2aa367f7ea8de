"""The program. Signals are heeded before the command line is imported, which takes a moment."""

from __future__ import annotations

from sma_bayes.interruption import ending_in_order


def main() -> None:
    """Run the command line, see `sma_bayes.cli.main`."""
    with ending_in_order():
        from sma_bayes.cli import main as command_line

        command_line()


if __name__ == "__main__":
    main()
