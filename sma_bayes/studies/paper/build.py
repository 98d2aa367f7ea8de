"""The page, its figures and its numbers, into a folder."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

from sma_bayes.errors import OutputError
from sma_bayes.progress import Progress
from sma_bayes.runs.store import nothing_unfinished, write_json, write_text
from sma_bayes.studies.paper.document import reproduction_document
from sma_bayes.studies.paper.page import PICTURES, page
from sma_bayes.studies.paper.pictures import write_pictures
from sma_bayes.studies.paper.schema import ReproductionDocument
from sma_bayes.studies.paper.tables import table_entries
from sma_bayes.studies.paper.twin_study import study_twin

PAGE: Final = "paper.md"
NUMBERS: Final = "data/paper.json"


PROBE: Final = ".writable"


def _try_to_write(folder: Path) -> None:
    """Refuse a folder that can't be written before minutes are spent on what goes there."""
    try:
        write_text(folder / PROBE, "")
    except OutputError as error:
        raise OutputError(
            error.found, file=folder, expected="a folder that can be written", remedy="choose another --page"
        ) from None
    (folder / PROBE).unlink(missing_ok=True)


def reproduce_paper(
    folder: str | Path,
    *,
    seed: int = 0,
    jobs: int | None = None,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Fit the twin of the paper's campaign, judge the paper's claims, and write the page that shows both.

    Parameters
    ----------
    folder : str or Path
        Where ``paper.md``, ``images/paper/*.png`` and ``data/paper.json`` go; made where it is missing. Files of the
        same names are replaced.
    seed : int
        Decides the twin's noise and every draw.
    jobs : int, optional
        Processes; by default one for each core.
    progress : callable, optional

    Returns
    -------
    dict
        What ``paper.json`` holds.

    Raises
    ------
    OutputError
        If a file can't be written.
    """
    return write_reproduction(Path(folder), seed=seed, jobs=jobs, progress=progress).as_json()


def write_reproduction(
    folder: Path, *, seed: int = 0, jobs: int | None = None, progress: Progress | None = None
) -> ReproductionDocument:
    """The same as `reproduce_paper`, typed."""
    _try_to_write(folder)
    with nothing_unfinished(folder):
        study = study_twin(seed=seed, jobs=jobs, progress=progress)
        tables = table_entries(study)
        found = reproduction_document(study, tables, write_pictures(study, tables, folder / PICTURES))
        write_json(folder / NUMBERS, found.as_json())
        write_text(folder / PAGE, page(found))
        return found
