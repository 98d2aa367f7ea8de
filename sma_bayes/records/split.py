"""From one run to its records: one per branch, with everything that was kept out counted."""

from __future__ import annotations

from dataclasses import dataclass

from sma_bayes.errors import MeasurementError, near_matches
from sma_bayes.quantities import CHANNELS


@dataclass(frozen=True, slots=True)
class SplitSettings:
    """How a run is split into branches, cleaned and reduced. The defaults suit most rigs.

    Attributes
    ----------
    fit_channels : tuple of str or None
        Channels to fit, among force, displacement and stiffness. None leaves it to the data: a channel that
        the rig kept constant becomes a held channel and is not fitted.
    max_samples : int
        Samples that a branch has at most; longer ones are averaged in blocks.
    """

    fit_channels: tuple[str, ...] | None = None
    max_samples: int = 400

    def __post_init__(self) -> None:
        for channel in self.fit_channels or ():
            if channel not in CHANNELS:
                raise MeasurementError(
                    f"unknown channel {channel!r} to fit",
                    expected=", ".join(CHANNELS),
                    remedy=near_matches(channel, CHANNELS),
                )
        if self.max_samples < 10:
            raise MeasurementError(f"max_samples is {self.max_samples}", expected="10 or more")
