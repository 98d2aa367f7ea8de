"""Building everything from an output folder."""

from __future__ import annotations

import base64
import re
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from sma_bayes.errors import OutputError
from sma_bayes.report.content import Content
from sma_bayes.studies.fit import report as fit_report
from sma_bayes.studies.report.build import build_report


@pytest.fixture(scope="module")
def built(
    finished: Path, tmp_path_factory: pytest.TempPathFactory
) -> tuple[Path, list[tuple[int, int, str]]]:
    import shutil

    folder = Path(shutil.copytree(finished, tmp_path_factory.mktemp("built") / "run"))
    told: list[tuple[int, int, str]] = []
    build_report(folder, figures="all", jobs=1, progress=lambda *args: told.append(args))
    return folder, told


def test_everything_is_there(built: tuple[Path, list[tuple[int, int, str]]], content: Content) -> None:
    folder, _ = built
    stems = {p.stem for p in (folder / "figures").iterdir()}
    assert stems == {
        "loop-100g-10mHz", "overview-force", "overview-displacement", "overview-stiffness", "correlation",
        "correlation-average",
        "parameters", "diagnostics", "printed",
        *(f"{kind}-100g-10mHz-{branch}" for kind in ("corner", "trace", "predictive", "residuals")
          for branch in ("heating", "cooling")),
        *(f"discrepancy-{r.key}" for r in content.records if r.document.discrepancy),
    }  # fmt: skip
    assert len(list((folder / "figures").iterdir())) == 3 * len(stems)
    tables, tex = ({p.stem for p in (folder / "tables").glob(f"*.{kind}")} for kind in ("csv", "tex"))
    assert len(tables) == 16
    assert tex == tables | {"publication", "supplement"}
    assert not [p for p in folder.rglob(".*") if p.is_file()]  # no temporary file is left


def test_figures_of_a_campaign_whose_truth_is_known_read_each_posterior_once(
    finished: Path, content: Content, monkeypatch: pytest.MonkeyPatch
) -> None:
    read: Counter[str] = Counter()
    posterior_of = fit_report.posterior_of

    def counted(folder: Path, key: str, checksum: str | None) -> Any:
        read[key] += 1
        return posterior_of(folder, key, checksum)

    monkeypatch.setattr(fit_report, "posterior_of", counted)
    known: Any = replace(content, truth=("known",))  # type: ignore[arg-type]
    assert len(list(fit_report._of_campaign(finished, known, diagnostics=True))) > 3
    assert read == {r.key: 1 for r in content.records}


def test_unasked_only_the_figures_of_the_report_are_drawn(run_copy: Path, content: Content) -> None:
    build_report(run_copy, jobs=1)
    stems = {p.stem for p in (run_copy / "figures").iterdir()}
    assert stems == {
        "loop-100g-10mHz",
        "printed",
        *(f"discrepancy-{r.key}" for r in content.records if r.document.discrepancy),
    }
    text = (run_copy / "report.html").read_text(encoding="utf-8")
    assert all(f'id="figure-{stem}"' in text for stem in stems)


def test_the_pictures_are_inside(built: tuple[Path, list[tuple[int, int, str]]]) -> None:
    folder, _ = built
    text = (folder / "report.html").read_text(encoding="utf-8")
    embedded = {base64.b64decode(m) for m in re.findall(r'src="data:image/png;base64,([^"]+)"', text)}
    on_disk = {p.read_bytes() for p in (folder / "figures").glob("*.png")}
    assert embedded <= on_disk
    assert len(embedded) >= len(on_disk) - 3  # an overview of a single condition repeats its loop
    size = re.search(r'alt="[^"]*corner[^"]*" width="(\d+)" height="(\d+)"', text)
    assert size is not None
    assert all(300 < int(v) < 2000 for v in size.groups())


def test_progress_counts_up_to_the_end(built: tuple[Path, list[tuple[int, int, str]]]) -> None:
    _, told = built
    assert [t[0] for t in told] == sorted(t[0] for t in told)
    assert told[0][0] == 0
    assert told[-1][0] == told[-1][1]
    assert all(message for *_, message in told)


def test_building_again_gives_the_same(
    built: tuple[Path, list[tuple[int, int, str]]], tmp_path: Path
) -> None:
    folder, _ = built
    outputs = ("report.html", "tables/parameters.tex", "figures/trace-100g-10mHz-heating.pdf")
    before = {name: (folder / name).read_bytes() for name in outputs}
    build_report(folder, figures="all", jobs=1)
    assert {name: (folder / name).read_bytes() for name in outputs} == before


def test_a_folder_without_a_run_stays_as_it_is(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="holds no run"):
        build_report(tmp_path)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("kind", ['"ask"', '"report"', '["gap"]', "null"])
def test_a_mark_of_what_has_no_report_is_taken_for_that_of_a_fit(tmp_path: Path, kind: str) -> None:
    (tmp_path / "run.json").write_text(f'{{"kind": {kind}}}', encoding="utf-8")
    with pytest.raises(OutputError, match="holds a run that is not finished"):
        build_report(tmp_path)
