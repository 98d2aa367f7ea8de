"""A run under way: how it is shared out, whom it tells, what it took so far, and how it is brought to an end."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from sma_bayes.account import Account
from sma_bayes.progress import Progress, silent
from sma_bayes.report.choice import Drawn, ReportOptions
from sma_bayes.runs.documents import FILES, Document, files_beside, sealed
from sma_bayes.runs.output_folder import claimed_folder
from sma_bayes.runs.schema import DocumentPart
from sma_bayes.runs.store import nothing_unfinished, write_json
from sma_bayes.studies.registry import report_builder


@dataclass(frozen=True, slots=True)
class RunContext:
    """A run under way.

    Attributes
    ----------
    document : Document
        Of its results.
    jobs : int or None
        See `sma_bayes.runs.jobs.run`.
    drawn : str
        Which figures will be drawn, see `sma_bayes.report.choice`.
    tell : callable
    account : Account
    begun : float
        When it began, by `time.perf_counter` [s].
    """

    document: Document
    jobs: int | None
    drawn: Drawn
    tell: Progress = silent
    account: Account = field(default_factory=Account)
    begun: float = field(default_factory=time.perf_counter)

    def with_account(self, found: Mapping[str, Any]) -> dict[str, Any]:
        """Results with what the run took so far."""
        return {
            **found,
            "figures": self.drawn,
            **self.account.run_document(),
            "wall_s": time.perf_counter() - self.begun,
        }

    def execute(
        self,
        out: str | Path | None,
        identity: dict[str, Any],
        resume: bool,
        find: Callable[[Path | None], DocumentPart],
    ) -> dict[str, Any]:
        """Find what is to be found and write it to a folder; what an earlier call has found there is read instead.

        Parameters
        ----------
        out : str or Path, optional
            Nothing is written without it.
        identity, resume
            See `sma_bayes.runs.output_folder.claim_folder`.
        find : callable
            Writes its files to the folder, if there is one, except the document, which comes last; gives what that
            will hold.

        Raises
        ------
        OutputError, ResumeError
            If the folder can't be used.
        """
        if out is None:
            return self.with_account(find(None).as_json())
        folder = Path(out).absolute()  # workers of a cluster stand elsewhere
        with claimed_folder(folder, identity, resume):
            finished = (folder / self.document.file).is_file()
            found = None if finished else find(folder).as_json()
        if found is None:
            return self.earlier(folder)
        return self.end(folder, {**found, FILES: files_beside(folder)})

    def earlier(self, folder: Path) -> dict[str, Any]:
        """Read the results of an earlier call, and draw the report where there is none."""
        found = self.document.read(folder)
        if self.drawn != "none" and not (folder / "report.html").is_file():
            self._report(folder)
        return found

    def end(self, folder: Path, found: Mapping[str, Any]) -> dict[str, Any]:
        """Write the results, draw the report, and write the results again with what that took; return them."""
        stated = sealed(self.with_account(found))
        write_json(folder / self.document.file, stated)
        if self.drawn == "none":
            return stated
        self._report(folder)
        stated = sealed(self.with_account(found))
        write_json(folder / self.document.file, stated)
        return stated

    def _report(self, folder: Path) -> None:
        wanted = ReportOptions(self.drawn, jobs=self.jobs, tell=self.tell, account=self.account)
        with nothing_unfinished(folder):
            report_builder(self.document.verb)(folder, wanted)
