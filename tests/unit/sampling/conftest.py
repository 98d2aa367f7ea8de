"""What tests of sampling share."""

from __future__ import annotations

import pytest

from sma_bayes.sampling import checkpoint


@pytest.fixture(autouse=True)
def blocks_are_written_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Runs of tests are over before the first block would be written."""
    monkeypatch.setattr(checkpoint, "HELD_BACK_S", 0.0)
