"""Which cycles are on the screen where there are very many."""

from __future__ import annotations

from sma_bayes.report.screen import ENTRIES_SHOWN
from sma_bayes.studies.cycles.terminal import shown_rows


def test_few_cycles_are_all_shown() -> None:
    assert shown_rows(7, 17) == list(range(17))


def test_of_many_cycles_first_and_last_measured_ones_and_forecasts_are_shown() -> None:
    rows = shown_rows(100, 110)
    assert rows == [*range(8), None, *range(92, 100), 100, 101, None, 108, 109]
    assert len([r for r in rows if r is not None]) == ENTRIES_SHOWN


def test_of_many_forecasts_few_are_shown() -> None:
    assert shown_rows(5, 105) == [*range(5), 5, 6, None, 103, 104]
