"""What a watch has taken so far, kept in its folder: files, numbers of every cycle, evidence after each."""

from __future__ import annotations

from pathlib import Path
from typing import Final, Literal

from pydantic import Field

from sma_bayes.runs.documents import Document, sealed
from sma_bayes.runs.schema import DocumentPart, Items, Number, read_document
from sma_bayes.runs.store import write_json
from sma_bayes.studies.cycles.sweeps import NUMBERS

NOISE: Final = "noise"
WATCHED: Final = (*NUMBERS, NOISE)
"""Numbers of a sweep: the four of the shape-invariant model, and what these leave (ln of its root mean square)."""
STATE: Final = Document(
    "watch", "state.json", "sma-bayes/watch-state/2", "a watch", ("files", "cycles", "series")
)


class StrandNumbers(DocumentPart):
    """Numbers of one sweep of a channel."""

    value: Items[Number] = Field(
        description="offset over span, ln stroke, shift, ln width, ln of what is left over span"
    )
    sd: Items[Number] = Field(description="standard deviations of the first four")
    samples: int = Field(description="samples of the sweep")


class CountedCycle(DocumentPart):
    """A cycle that counts."""

    file: str = Field(description="name of its file")
    cycle: Number = Field(description="its number in the file")
    sha256: str = Field(description="of its first samples")
    sweeps: Items[StrandNumbers] = Field(description="one for each of `series`")
    log_evidence: Items[Number] = Field(
        description="of each number of each of `series`, and of each cause whose numbers are watched together: ln of "
        "its e-process after this cycle"
    )


class ReadFile(DocumentPart):
    """A file that was read."""

    name: str = Field(description="its name")
    sha256: str = Field(description="its checksum")
    counted: int = Field(description="cycles of it that were counted then")
    repeated: int = Field(description="cycles of it that had been counted before")
    partial: Items[str] = Field(description="cycles that were not whole, in words")
    remarks: Items[str] = Field(description="what else was seen")


class WatchState(DocumentPart):
    """What `state.json` holds."""

    schema_: Literal["sma-bayes/watch-state/2"] = Field(alias="schema", description="name and version")
    series: Items[str] = Field(description="branch and channel of each curve that is watched")
    files: Items[ReadFile] = Field(description="files in the order in which they came")
    cycles: Items[CountedCycle] = Field(description="cycles that count, in their order")
    content_sha256: str = Field(default="", description="checksum of all else")

    def counted(self) -> set[str]:
        """Checksums of the cycles that count."""
        return {c.sha256 for c in self.cycles}

    def file(self, sha256: str) -> ReadFile | None:
        """The file with this content, if it was read already."""
        return next((f for f in self.files if f.sha256 == sha256), None)


def empty(series: tuple[str, ...]) -> WatchState:
    """The state of a watch that has seen nothing."""
    return WatchState(schema="sma-bayes/watch-state/2", series=series, files=(), cycles=())


def read_state(folder: Path, series: tuple[str, ...]) -> WatchState:
    """The state that a folder holds; that of the beginning where there is none.

    Raises
    ------
    OutputError
        If it was changed or can't be read.
    """
    return read_document(STATE, WatchState, folder) if (folder / STATE.file).is_file() else empty(series)


def write_state(folder: Path, state: WatchState) -> None:
    """Write it, whole or not at all.

    Raises
    ------
    OutputError
        If it can't be written.
    """
    write_json(
        folder / STATE.file, sealed(state.model_dump(mode="json", by_alias=True, exclude={"content_sha256"}))
    )
