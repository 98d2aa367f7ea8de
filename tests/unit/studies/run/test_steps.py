"""Steps of a study: each verb states its own, and one of another package is run like those that ship."""

from __future__ import annotations

import json
import sys
from inspect import signature
from pathlib import Path

import pytest

import sma_bayes.studies.registry
from sma_bayes.catalogue import Catalogue
from sma_bayes.errors import ResumeError, StudyError
from sma_bayes.studies.fit.workflow import fit_campaign
from sma_bayes.studies.registry import VERBS, study_steps
from sma_bayes.studies.run.workflow import run_study

COUNT = '''"""Counts records."""

from sma_bayes.errors import ResumeError, SmaBayesError
from sma_bayes.runs.documents import Document
from sma_bayes.studies.study_step import DrawnTable, StudyStep


class CountTable(DrawnTable):
    """``[count]``."""

    most: int = 10


def count(campaign, *, out, most, progress, resume, figures):
    if out.exists():
        raise ResumeError("holds another run", file=out, remedy="choose another --out")
    out.mkdir()
    return {"schema": "count/1", "converged": True, "records": len(campaign.records), "most": most}


def checked(options):
    def refuse():
        if options["most"] < 1:
            raise SmaBayesError(f"most = {options['most']}", expected="1 or more")

    return [("most", refuse)]


STEP = StudyStep(
    CountTable, Document("count", "count.json", "count/1", "a count"), count,
    lambda found: f"{found['records']} of {found['most']} records", checked, folder="counted",
)
'''
STUDY = '[study]\ncampaign = "{}"\nout = "results"\nfigures = "none"\n\n[count]\nmost = {}\n'


@pytest.mark.parametrize("verb", study_steps())
def test_every_key_of_a_table_is_an_option_of_its_call(verb: str) -> None:
    step = study_steps()[verb]
    options = {
        *signature(step.call).parameters,
        *(signature(fit_campaign).parameters if verb == "fit" else ()),
    }
    source = {"files"} if verb == "modulus" else set()  # which it takes in place of a campaign
    assert step.table.model_fields.keys() - source <= options
    assert step.document.verb == verb


@pytest.fixture
def counting(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A verb `count` of another package, and data for a study."""
    package = tmp_path / "counting_verb"
    package.mkdir()
    (package / "__init__.py").write_text('"""Counts."""\n', encoding="utf-8")
    (package / "workflow.py").write_text(COUNT, encoding="utf-8")
    monkeypatch.syspath_prepend(str(tmp_path))
    __import__("counting_verb")
    more = Catalogue("verb", {**VERBS, "count": sys.modules["counting_verb"]})
    monkeypatch.setattr(sma_bayes.studies.registry, "VERBS", more)
    rows = [f"{t},{10.0 + t / 10.0}" for t in range(20, 81)]
    rows += [f"{t},{11.0 + t / 10.0}" for t in range(80, 19, -1)]
    text = "temperature_degC,displacement_mm\n" + "\n".join(rows) + "\n"
    (tmp_path / "loop.csv").write_text(text, encoding="utf-8")
    return tmp_path


def test_a_verb_of_another_package_is_a_step(counting: Path) -> None:
    study = counting / "study.toml"
    study.write_text(STUDY.format("loop.csv", 3), encoding="utf-8")
    found = run_study(study)
    (step,) = found["steps"]
    assert (step["step"], step["status"], step["summary"]) == ("count", "done", "counted/count.json")
    assert step["told"] == "2 of 3 records"
    assert json.loads((counting / "results" / "study.json").read_text(encoding="utf-8")) == found


def test_a_step_is_told_where_it_begins_and_where_it_fails(counting: Path) -> None:
    """The step before it, which has nothing more to do, would be told for as long as the next one is silent."""
    study = counting / "study.toml"
    study.write_text(STUDY.format("loop.csv", 3) + "\n[cycles]\n", encoding="utf-8")
    told: list[str] = []
    run_study(study, progress=lambda done, total, message: told.append(f"{done} of {total}: {message}"))
    assert told == [
        "0 of 1: cycles: begins", "1 of 1: cycles: failed", "0 of 1: count: begins",
    ]  # fmt: skip


def test_a_step_that_was_changed_says_which_folder_to_remove(counting: Path) -> None:
    study = counting / "study.toml"
    study.write_text(STUDY.format("loop.csv", 3), encoding="utf-8")
    run_study(study)
    with pytest.raises(ResumeError, match=r"results.counted: holds another run") as error:
        run_study(study, resume=True)
    assert (
        error.value.remedy
        == "run [count] with what it was run with before, or remove this folder to run it anew"
    )


def test_what_such_a_verb_refuses_is_told_with_its_key(counting: Path) -> None:
    study = counting / "study.toml"
    study.write_text(STUDY.format("no-such-campaign", 0), encoding="utf-8")
    with pytest.raises(Exception, match=r"count\.most"):
        run_study(study)
    study.write_text(STUDY.format("loop.csv", 3).replace("most", "least"), encoding="utf-8")
    with pytest.raises(StudyError, match="least"):
        run_study(study)
