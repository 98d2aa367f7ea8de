"""The account of a run: how long each of its stages took, and which processes it lost on the way."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any


@dataclass(slots=True)
class Account:
    """What a run took, kept while it goes.

    Stages of tasks that run side by side add up, so their sum may exceed the time that went by.

    Attributes
    ----------
    wall, cpu : dict of str to float
        By stage, in the order in which they came up: time by the clock, and time of the processor in all threads of
        the process [s].
    lost : list of str
        What is known of each worker process that came to an end in the middle of a task, which was then done again.
    workers : str
        Where tasks were done, in words; empty where everything happened in this process.
    """

    wall: dict[str, float] = field(default_factory=dict)
    cpu: dict[str, float] = field(default_factory=dict)
    lost: list[str] = field(default_factory=list)
    workers: str = ""

    def add(self, stage: str, wall: float, cpu: float) -> None:
        """Add time to a stage [s]."""
        self.wall[stage] = self.wall.get(stage, 0.0) + wall
        self.cpu[stage] = self.cpu.get(stage, 0.0) + cpu

    @contextmanager
    def timed(self, stage: str) -> Iterator[None]:
        """Add what happens in a ``with`` block to a stage.

        Examples
        --------
        >>> account = Account()
        >>> with account.timed("read"):
        ...     sum(range(1000))
        499500
        >>> list(account.wall)
        ['read']
        """
        wall, cpu = time.perf_counter(), time.process_time()
        try:
            yield
        finally:
            self.add(stage, time.perf_counter() - wall, time.process_time() - cpu)

    def take(self, document: Mapping[str, Any]) -> None:
        """Add the stages that a task has told of itself, see `document`."""
        for stage, wall in document["stages_s"].items():
            self.add(stage, wall, document["stages_cpu_s"][stage])

    def document(self) -> dict[str, dict[str, float]]:
        """Stages as results hold them: ``stages_s`` by the clock and ``stages_cpu_s`` of the processor."""
        return {"stages_s": dict(self.wall), "stages_cpu_s": dict(self.cpu)}

    def run_document(self) -> dict[str, Any]:
        """The same for a whole run, with the workers it had and lost."""
        workers = self.workers or "this process"
        return {**self.document(), "workers": {"where": workers, "lost": list(self.lost)}}
