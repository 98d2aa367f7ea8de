"""Options of a plan that change its numbers."""

from __future__ import annotations

import hashlib
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Final, Literal

from sma_bayes.errors import StudyError

Scatter = Literal["none", "usual"]
MAX_RIG_HOURS: Final = 100_000.0
"""Hours on the rig beyond which none is planned [h]."""


@dataclass(frozen=True, slots=True)
class Options:
    """Options of a plan.

    Attributes
    ----------
    hours : float or None
        Time that there is [h].
    candidates : str or Path or None
        File of candidates.
    rate : str or None
        Of candidates that state none.
    setup : float
        Before each experiment [h].
    scatter : str
        That is assumed where there is one sweep only.
    seed : int
    condition, branch : str or None
        The only one.
    """

    hours: float | None
    candidates: str | Path | None
    rate: str | None
    setup: float
    scatter: Scatter
    seed: int
    condition: str | None
    branch: str | None

    def identity(self) -> dict[str, object]:
        """What must agree for a plan to be resumed.

        Raises
        ------
        StudyError
            If the file of candidates can't be read.
        """
        try:
            content = None if self.candidates is None else Path(self.candidates).read_bytes()
        except OSError as error:
            raise StudyError(
                f"can't be read: {error.strerror}",
                file=self.candidates,
                expected="a TOML file of candidates",
                remedy="correct the path after --candidates",
            ) from None
        checksum = None if content is None else hashlib.sha256(content).hexdigest()
        return asdict(self) | {"candidates": checksum}
