"""`sma-bayes plan` as a pipeline calls it."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import sma_bayes
from sma_bayes import fit_campaign, study_gap
from sma_bayes.runs.documents import PLAN, sealed
from sma_bayes.runs.finished_run import FinishedRun, read_finished
from sma_bayes.studies.plan.figures.plan import narrowing_figure
from sma_bayes.studies.plan.schema import PlanDocument
from sma_bayes.studies.plan.shown import in_declared_units
from sma_bayes.studies.plan.tables import plan_tables
from sma_bayes.studies.plan.terminal import show_plan

HEADER = "time_s,temperature_C,displacement_mm,cycle"


@pytest.fixture(scope="module")
def folder(make_campaign: Callable[..., Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("plan")
    campaign = sma_bayes.read_campaign(make_campaign(place / "bench"))
    fit_campaign(campaign, place / "out", noise="independent", jobs=1, figures=False)
    return place / "out"


@pytest.fixture(scope="module")
def gap(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A gap study of a spring that grows in four cycles, under two explanations that are much alike."""
    import numpy as np

    place = tmp_path_factory.mktemp("gap")
    rng, lines, clock = np.random.default_rng(4), [HEADER], 0.0
    up = np.linspace(25.0, 75.0, 25)
    for cycle in range(1, 5):
        for branch, middle in ((up, 52.0), (up[::-1], 46.0)):
            for t in branch:
                clock += 2.0
                stroke = 10.0 + 20.0 / (1.0 + np.exp(-0.32 * (t - middle))) + 1.2 * (1 - np.exp(1 - cycle))
                lines.append(f"{clock:g},{t:.4f},{stroke + 0.1 * rng.standard_normal():.5g},{cycle}")
    (place / "bench").mkdir()
    (place / "bench" / "a.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    (place / "bench" / "campaign.toml").write_text(
        '[[condition]]\nid = "a"\nfile = "a.csv"\n', encoding="utf-8"
    )
    study_gap(sma_bayes.read_campaign(place / "bench"), place / "out", jobs=1, figures=False)
    return place / "out"


def test_a_folder_holds_what_is_promised(
    run: Callable[..., Any], folder: Path, published: Callable[[str], Any], tmp_path: Path
) -> None:
    out = tmp_path / "plan"
    call = (
        "plan",
        folder,
        "--for",
        "stiffness@50degC",
        "--out",
        out,
        "--hours",
        "2",
        "--jobs",
        "1",
        "--json",
    )
    outcome = run(*call)
    assert outcome.status == 0
    document = json.loads(outcome.out)
    assert document == json.loads((out / "plan.json").read_text(encoding="utf-8"))
    published("plan").validate(document)
    assert {q["key"] for q in document["quantities"]} == {"a-heating", "a-cooling"}
    per_hour = [c["nats_per_hour"] for c in document["candidates"]]
    assert per_hour == sorted(per_hour, reverse=True)
    assert document["design"]["hours"] <= 2.0
    with (out / "candidates.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(document["candidates"])
    (name,) = (k for k in rows[0] if k.startswith("sd of stiffness at 50 °C, a-heating"))
    for row, candidate in zip(rows, document["candidates"], strict=True):
        told = [e["sd"] for e in candidate["expected"] if e["key"] == "a-heating"]
        assert [float(row[name])] == pytest.approx(told) if told else row[name] == ""
    for part in ("figures/candidates.png", "figures/narrowing.pdf", "tables/candidates.tex", "report.html"):
        assert (out / part).is_file(), part
    assert document["advice"].split(":")[0] in (out / "report.html").read_text(encoding="utf-8")
    again = run(*call, "--resume")
    assert json.loads(again.out) == document
    assert run("report", out, "--jobs", "1").status == 0


def test_people_get_a_table_and_a_sentence_in_their_units(run: Callable[..., Any], folder: Path) -> None:
    outcome = run("plan", folder, "--for", "stiffness@50degC", "--branch", "heating")
    assert outcome.status == 0
    last = outcome.out.rstrip().splitlines()[-1]
    assert last.startswith("Measure condition a from ")
    assert "expected to narrow stiffness at 50 °C from ±" in last
    assert "N/mm" in last
    assert run("plan", folder, "--for", "parameters", "--quiet").out == ""


def test_hours_in_which_no_whole_loop_ends_are_not_compared_with_one(
    run: Callable[..., Any], folder: Path
) -> None:
    call = ("plan", folder, "--for", "stiffness@50degC", "--jobs", "1", "--json")
    single = [c["hours"] for c in json.loads(run(*call).out)["candidates"] if c["cycles"] == 1]
    for hours, whole in ((0.5 * (min(single) + max(single)), False), (2.5 * max(single), True)):
        found = json.loads(run(*call, "--hours", str(hours)).out)
        assert (found["design"]["even_cycles"] >= 1.0) is whole
        assert ("whole loops, divided evenly" in found["advice"]) is whole
        assert ("no time for a whole loop" in found["advice"]) is not whole


def test_hours_that_are_too_few_are_told_without_an_empty_table(
    run: Callable[..., Any], folder: Path
) -> None:
    outcome = run("plan", folder, "--for", "stiffness@50degC", "--hours", "1e-6", "--jobs", "1")
    assert "No candidate fits into" in outcome.out
    assert "nats/h" not in outcome.out


def test_declared_candidates_are_judged_and_marked(
    run: Callable[..., Any], folder: Path, tmp_path: Path
) -> None:
    path = tmp_path / "candidates.toml"
    path.write_text(
        '[[candidate]]\nname = "hotter"\npeak = "90 degC"\nrate = "1 K/min"\n'
        '[[candidate]]\nname = "middle"\nlowest = "45 degC"\npeak = "55 degC"\nrate = "1 K/min"\n',
        encoding="utf-8",
    )
    outcome = run("plan", folder, "--for", "stiffness@50degC", "--candidates", path, "--json")
    by_name = {c["name"]: c for c in json.loads(outcome.out)["candidates"]}
    assert "hotter than measured" in by_name["hotter"]["beyond"]
    assert by_name["middle"]["branches"] == []
    assert by_name["middle"]["nats"] == 0.0


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (("--for", "hardness"), "tell-apart"),
        (("--for", "stiffness@50"), "has no unit"),
        (("--for", "stiffness@200degC"), "was measured by no record"),
        (("--for", "modulus@50degC"), "stiffness@..."),
        (("--for", "tell-apart"), "sma-bayes gap"),
        (("--for", "parameters", "--hours", "-1"), "--hours"),
        (("--for", "parameters", "--condition", "b"), "unknown condition 'b'"),
        (("--for", "parameters", "--branch", "up"), "unknown branch 'up'"),
        (("--for", "parameters", "--rate", "3"), "2 K/min"),
        (("--for", "parameters", "--setup", "3"), "20 min"),
        (("--for", "parameters", "--scatter", "some"), "'none' or 'usual'"),
        (("--for", "parameters", "--candidates", "nowhere.toml"), "can't be read"),
    ],
)
def test_what_can_not_be_planned_ends_with_2(
    run: Callable[..., Any], folder: Path, tmp_path: Path, options: tuple[str, ...], told: str
) -> None:
    out = tmp_path / "plan"
    outcome = run("plan", folder, *options, "--out", out)
    assert outcome.status == 2
    assert told in outcome.err
    assert not (out / "plan.json").exists()


def test_another_load_is_another_curve(run: Callable[..., Any], folder: Path, tmp_path: Path) -> None:
    path = tmp_path / "candidates.toml"
    path.write_text('[[candidate]]\nload = "900 g"\n', encoding="utf-8")
    outcome = run("plan", folder, "--for", "parameters", "--candidates", path, "--rate", "1 K/min")
    assert outcome.status == 2
    assert "another curve" in outcome.err


def test_a_fit_that_has_not_converged_says_so(run: Callable[..., Any], folder: Path, tmp_path: Path) -> None:
    import shutil

    other = tmp_path / "fit"
    shutil.copytree(folder, other)
    path = other / "summary.json"
    document = json.loads(path.read_text(encoding="utf-8"))
    for record in document["records"]:
        record["converged"] = False
    path.write_text(json.dumps(sealed(document)), encoding="utf-8")
    outcome = run("plan", other, "--for", "stiffness@50degC")
    assert outcome.status == 1
    assert "NOT CONVERGED" in outcome.out


def test_explanations_are_told_apart(
    run: Callable[..., Any], gap: Path, published: Callable[[str], Any], tmp_path: Path
) -> None:
    out = tmp_path / "plan"
    outcome = run("plan", gap, "--for", "tell-apart", "--out", out, "--jobs", "1", "--json")
    document = json.loads(outcome.out)
    published("plan").validate(document)
    assert document["rivals"]
    stated = json.loads((gap / "gap.json").read_text(encoding="utf-8"))
    assert document["rivals"][0]["first"] in {c["id"] for c in stated["candidates"]}
    for candidate in document["candidates"]:
        for pair, now in zip(candidate["pairs"], document["rivals"], strict=True):
            assert 0.0 <= pair["probability"] <= 1.0
            odds = 1.0 if now["told_apart"] else np.exp(now["ln_bayes_factor"])
            both = (odds * pair["if_first"] + pair["if_second"]) / (odds + 1.0)
            assert pair["probability"] == pytest.approx(both)
    sure = [c["probability"] >= 0.95 for c in document["candidates"]]
    assert sure == sorted(sure, reverse=True)
    # of the same experiment, more cycles tell more
    longer = {
        (c["lowest"], c["peak"], c["rate"], c["samples"], c["cycles"]): c["pairs"][0]["separation"]
        for c in document["candidates"]
    }
    grown = [(v, longer[(*k[:4], 10)]) for k, v in longer.items() if k[4] == 1 and (*k[:4], 10) in longer]
    assert grown
    assert all(few < many for few, many in grown)
    assert (out / "report.html").is_file()
    assert document["advice"] in run("plan", gap, "--for", "tell-apart").out


def test_another_load_stands_in_the_row_of_its_candidate(
    run: Callable[..., Any], gap: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    document = json.loads(run("plan", gap, "--for", "tell-apart", "--jobs", "1", "--json").out)
    show_plan(document, None)
    assert "load" not in capfd.readouterr().out.partition("remark:")[0]
    document["candidates"][0] |= {"load": 4.25, "other_load": True}
    show_plan(document, None)
    assert "4.25 N" in capfd.readouterr().out.partition("remark:")[0]
    table = plan_tables(FinishedRun(gap, PLAN, PlanDocument.model_validate(document)))["candidates"]
    place = [c.key for c in table.columns].index("load")
    assert "4.25 N" in str(table.rows[0][place])
    assert str(table.rows[1][place]) == ""


def test_a_gap_study_without_its_campaign_says_what_to_do(
    run: Callable[..., Any], gap: Path, tmp_path: Path
) -> None:
    import shutil

    assert run("plan", gap, "--for", "parameters").status == 2
    other = tmp_path / "gap"
    shutil.copytree(gap, other)
    path = other / "gap.json"
    document = json.loads(path.read_text(encoding="utf-8"))
    path.write_text(json.dumps(sealed({**document, "source": str(tmp_path / "gone")})), encoding="utf-8")
    outcome = run("plan", other, "--for", "tell-apart")
    assert outcome.status == 2
    assert "put the campaign back" in outcome.err
    assert "run it where gap was run" not in outcome.err
    path.write_text(json.dumps(sealed({**document, "source": "bench/spring"})), encoding="utf-8")
    outcome = run("plan", other, "--for", "tell-apart")
    assert outcome.status == 2
    assert "run it where gap was run, as bench/spring is a path from there" in outcome.err


def test_a_plan_is_read_in_words_and_no_outcome_hides_another(folder: Path, tmp_path: Path) -> None:
    """Where the best design is the even division, its dots lay under those of that."""
    out = tmp_path / "plan"
    sma_bayes.plan(folder, "stiffness@50degC", out, hours=2.0, jobs=1)
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "What to measure next for stiffness at 50 °C." in page
    stored = read_finished(PLAN, PlanDocument, out, in_declared_units)
    (ax,) = narrowing_figure(stored).figure.axes
    dots = [
        (float(x), float(y)) for line in ax.lines if line.get_marker() == "o" for x, y in line.get_xydata()
    ]
    assert len(dots) == 6
    assert len({y for _, y in dots}) == 6
