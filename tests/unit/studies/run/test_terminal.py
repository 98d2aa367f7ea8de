"""A study on the screen: what was found, and where it is."""

from __future__ import annotations

from pathlib import Path

from sma_bayes.studies.gap.workflow import _told
from sma_bayes.studies.run.terminal import study_text


def test_a_study_says_where_its_results_are(tmp_path: Path) -> None:
    """It ended with the last step, and who had run ten had to look for their pages; one without figures has none."""
    (tmp_path / "fit").mkdir()
    (tmp_path / "fit" / "report.html").touch()
    step = {"schema": "x", "error": None, "status": "done", "exit_status": 0, "wall_s": 1.0}
    found = {
        "schema": "sma-bayes/study/1", "campaign": "rig", "source": "rig", "seed": 0, "versions": {},
        "data_sha256": "0" * 64, "study": "study.toml", "out": str(tmp_path), "finished": True, "converged": True,
        "exit_status": 0, "wall_s": 53.42,
        "steps": [
            {"step": "fit", "summary": "fit/summary.json", "told": "6 of 6 records converged", **step},
            {"step": "gap", "summary": "gap/gap.json", "told": "nothing", **step},
            {"step": "ask 1", "summary": "ask/1.json", "told": "6 records at 50 degC", **step},
        ],
    }  # fmt: skip
    last = study_text(found).splitlines()[-1]
    assert last == f"53.4 s; results in {tmp_path}; pages: fit/report.html; answers: gap/gap.json, ask/1.json"


def test_a_gap_is_told_in_words() -> None:
    """`none` and `named: stress_shift` were all that was told."""
    none = {"verdict": "none", "effects": [], "heating": None}
    assert _told(none) == "nothing is missing beyond what chance explains"
    effect = {"id": "stress_shift", "title": "load raises the transformation temperatures"}
    named = {"verdict": "named", "effects": [effect], "heating": none}
    assert _told(named) == (
        "the model misses stress_shift (load raises the transformation temperatures); heating: nothing is missing "
        "beyond what chance explains"
    )
