"""A difference of expansions that is none, which solvers do not take as the card means it."""

from __future__ import annotations

import pytest

from sma_bayes.studies.card.workflow import expansion_caution


@pytest.mark.parametrize(("austenite", "martensite"), [(1.1e-5, 8e-6), (-1e-4, -1e-4)])
def test_expansions_that_are_nearly_the_same_are_no_caution(austenite: float, martensite: float) -> None:
    assert expansion_caution(austenite, martensite) == ()


def test_slopes_that_differ_are_told_with_what_helps() -> None:
    (text,) = expansion_caution(-1.1e-4, -1.6e-4)
    assert "−5e-05" in text.replace("-5e-05", "−5e-05")
    assert "tangent_mode='closest_point'" in text
