"""One small finished run, made once; each test gets a copy or only looks."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from sma_bayes import fit_campaign
from sma_bayes.paper.twin import twin_campaign
from sma_bayes.report.content import Content, RecordContent
from sma_bayes.report.figures.sheet import BranchData
from sma_bayes.runs.documents import sealed
from sma_bayes.runs.outputs import band_path, posterior_path, read_band, read_record, read_run
from sma_bayes.studies.fit.report_content import report_content
from sma_bayes.studies.fit.residuals import median_curves

CONDITION = "100g-10mHz"


@pytest.fixture(scope="session")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a finished fit of one condition of the twin, without figures."""
    twin = twin_campaign(0, ("force", "displacement"))
    few = replace(twin, records=tuple(r for r in twin.records if r.condition.id == CONDITION))
    folder = tmp_path_factory.mktemp("finished") / "run"
    fit_campaign(few, folder, jobs=1, figures=False)
    return folder


@pytest.fixture
def run_copy(finished: Path, tmp_path: Path) -> Path:
    """A copy of the finished run, to change."""
    return Path(shutil.copytree(finished, tmp_path / "run"))


@pytest.fixture(scope="session")
def content(finished: Path) -> Content:
    """What the finished run says."""
    return report_content(read_run(finished))


@pytest.fixture(scope="session")
def branch_of(finished: Path) -> Callable[[RecordContent], BranchData]:
    """Gather what there is to draw of a record of the finished run."""

    def gather(record: RecordContent) -> BranchData:
        stored = read_record(posterior_path(finished, record.key))
        bands = {c.channel: read_band(band_path(finished, record.key, c.channel)) for c in record.channels}
        return BranchData(record, stored, bands, median_curves(stored))

    return gather


@pytest.fixture
def edit_summary() -> Callable[[Path, Callable[[dict[str, Any]], None]], Path]:
    """Change the summary of a run."""

    def edit(folder: Path, change: Callable[[dict[str, Any]], None]) -> Path:
        path = folder / "summary.json"
        summary = json.loads(path.read_text(encoding="utf-8"))
        change(summary)
        path.write_text(json.dumps(sealed(summary)), encoding="utf-8")
        return folder

    return edit
