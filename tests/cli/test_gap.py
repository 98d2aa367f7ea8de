"""The gap workflow from the command line: what it writes, what it says, and what it refuses."""

from __future__ import annotations

import json
import shutil
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sma_bayes import study_gap
from sma_bayes.arviz_bridge import open_posterior
from sma_bayes.records.campaign import read_campaign
from sma_bayes.studies.gap.terminal import ROWS_OF_ONE_REASON, show_gap

Run = Callable[..., Any]

HEADER = "time_s,temperature_C,force_N,displacement_mm"
COLUMNS = """\
[campaign]
name = "cycled"
[columns]
time = { name = "time_s", unit = "s" }
temperature = { name = "temperature_C", unit = "degC" }
"""
FORCE = 'force = { name = "force_N", unit = "N" }\n'
DISPLACEMENT = 'displacement = { name = "displacement_mm", unit = "mm" }\n'


def sweeps(seed: int, *, cycles: int = 5, samples: int = 30, training: float = 0.0) -> list[str]:
    """Lines of a CSV of a spring that is cycled, and grows by `training` millimetres as it is trained."""
    rng = np.random.default_rng(seed)
    share = np.arange(samples) / (samples - 1.0)
    rows, clock = [HEADER], 0.0
    for cycle in range(cycles):
        grown = training * (1.0 - np.exp(-cycle / 1.5))
        for rising in (True, False):
            temperature = 25.0 + 50.0 * (share if rising else 1.0 - share)
            middle = 52.0 if rising else 46.0
            phase = 1.0 / (1.0 + np.exp(-0.32 * (temperature - middle)))
            time = clock + np.arange(samples)
            clock += samples
            force = 0.4 + 2.0 * phase + 0.01 * rng.standard_normal(samples)
            stroke = 10.0 + 20.0 * phase + grown + 0.05 * rng.standard_normal(samples)
            rows += [
                ",".join(f"{v:.6g}" for v in row)
                for row in zip(time, temperature, force, stroke, strict=True)
            ]
    return rows


def campaign(
    folder: Path, *, training: float = 0.0, conditions: int = 2, columns: str = DISPLACEMENT
) -> Path:
    """A campaign folder."""
    folder.mkdir(parents=True)
    text = COLUMNS + columns
    for i in range(conditions):
        text += f'[[condition]]\nid = "c{i}"\nfile = "c{i}.csv"\n'
        (folder / f"c{i}.csv").write_text("\n".join(sweeps(i, training=training)) + "\n", encoding="utf-8")
    (folder / "campaign.toml").write_text(text, encoding="utf-8")
    return folder


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A campaign in which training was hidden, and its finished study in `out`."""
    folder = tmp_path_factory.mktemp("gap")
    source = campaign(folder / "data", training=0.6)
    study_gap(read_campaign(source), folder / "out", pool="campaign", jobs=1)
    return folder


def test_each_reason_is_said_once_on_the_screen(done: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found = json.loads((done / "out" / "gap.json").read_text(encoding="utf-8"))
    tested = [c for c in found["candidates"] if c["status"] != "untestable"]
    (reason, times), *_ = Counter(c["why"] for c in tested).most_common(1)
    assert times > ROWS_OF_ONE_REASON
    show_gap(found, done / "out")
    told = " ".join(capsys.readouterr().out.split())
    assert told.count(reason) == 1
    rejected = told.partition(f"rejected, {reason}")[2]
    for c in tested:
        alone = [d["why"] for d in tested].count(c["why"]) <= ROWS_OF_ONE_REASON
        assert (f"│ {c['id']} " in told) == alone
        assert (c["why"] == reason) <= (f"{c['id']} (" in rejected)


def strict(text: str) -> Any:
    """JSON without the words that are not JSON."""

    def refuse(word: str) -> None:
        raise AssertionError(f"{word} is not JSON")

    return json.loads(text, parse_constant=refuse)


def files(folder: Path) -> set[str]:
    return {str(p.relative_to(folder)) for p in folder.rglob("*") if p.is_file()}


def gap(run: Run, data: Path, out: Path, *options: object) -> Any:
    return run("gap", data, "--out", out, "--pool", "campaign", "--jobs", 1, *options)


def sentences(found: Any) -> Iterator[str]:
    """All texts of a document."""
    if isinstance(found, str):
        yield found
    elif isinstance(found, dict | list):
        for part in found.values() if isinstance(found, dict) else found:
            yield from sentences(part)


def test_a_study_writes_what_the_contract_names(done: Path) -> None:
    found = strict((done / "out" / "gap.json").read_text(encoding="utf-8"))
    assert (found["schema"], found["verdict"]) == ("sma-bayes/gap/1", "named")
    assert "{" not in "".join(sentences(found)), "a place for a word was left empty"
    assert [e["id"] for e in found["effects"]] == ["training_drift"]
    assert found["gap"]["shrink"] > 0.9
    there = files(done / "out")
    figures = ("disagreement", "residual-maps", "ladder", "effect-training_drift", "effect-parameters")
    assert {f"figures/{f}.{kind}" for f in figures for kind in ("pdf", "png", "csv")} <= there
    assert {f"tables/{t}.{kind}" for t in ("candidates", "effects") for kind in ("csv", "tex")} <= there
    assert {"report.html", "series.csv", "posterior/gap.nc", "priors.toml", "run.json"} <= there


def test_the_posterior_opens_and_carries_units(done: Path) -> None:
    found = strict((done / "out" / "gap.json").read_text(encoding="utf-8"))
    tree = open_posterior(done / "out" / "posterior" / "gap.nc")
    size = tree["posterior"]["training_drift.d"]
    assert size.attrs["unit"] == "m"
    told = found["effects"][0]["parameters"]["d"]
    assert float(size.median()) == pytest.approx(told["median"], abs=0.1 * (told["q95"] - told["q05"]))
    assert "training_drift.N0" in tree["prior"]


def test_the_report_begins_with_the_verdict_and_needs_no_network(done: Path) -> None:
    page = (done / "out" / "report.html").read_text(encoding="utf-8")
    assert page.index("The model misses something, and it has a name") < page.index("2. Where")
    assert page.count("data:image/png;base64,") == 5
    assert "What it does not mean" in page
    assert "<script" not in page
    assert 'src="http' not in page


def test_report_builds_the_same_again_from_what_the_folder_holds(
    run: Run, done: Path, tmp_path: Path
) -> None:
    folder = shutil.copytree(done / "out", tmp_path / "out")
    before = files(folder)
    page = (folder / "report.html").read_bytes()
    for part in ("figures", "tables"):
        shutil.rmtree(folder / part)
    (folder / "report.html").unlink()
    outcome = run("report", folder, "--jobs", 1)
    assert outcome.status == 0, outcome
    assert files(folder) == before
    assert (folder / "report.html").read_bytes() == page


def test_resuming_a_finished_study_gives_what_it_holds(run: Run, done: Path) -> None:
    stamp = (done / "out" / "gap.json").stat().st_mtime_ns
    outcome = gap(run, done / "data", done / "out", "--resume", "--json")
    assert outcome.status == 0, outcome
    assert strict(outcome.out) == strict((done / "out" / "gap.json").read_text(encoding="utf-8"))
    assert (done / "out" / "gap.json").stat().st_mtime_ns == stamp


def test_a_damaged_document_is_not_written_over(run: Run, done: Path, tmp_path: Path) -> None:
    folder = shutil.copytree(done / "out", tmp_path / "out")
    (folder / "gap.json").write_text("{ broken", encoding="utf-8")
    outcome = gap(run, done / "data", folder, "--resume")
    assert outcome.status == 2, outcome
    assert "gap.json: can't be read" in outcome.err
    assert (folder / "gap.json").read_text(encoding="utf-8") == "{ broken"


@pytest.mark.parametrize(
    ("verb", "options", "says"),
    [
        ("gap", (), "holds this run already"),
        ("gap", ("--seed", 1, "--resume"), "differs in seed"),
        ("fit", ("--resume",), "another command"),
    ],
)
def test_another_run_does_not_write_over_a_study(
    run: Run, done: Path, verb: str, options: tuple[object, ...], says: str
) -> None:
    before = files(done / "out")
    outcome = run(verb, done / "data", "--out", done / "out", "--pool", "campaign", "--jobs", 1, *options)
    assert outcome.status == 2
    assert says in outcome.err
    assert files(done / "out") == before


def test_nothing_is_named_where_nothing_is_hidden_and_no_figures_are_made_unasked(
    run: Run, tmp_path: Path
) -> None:
    data = campaign(tmp_path / "data", conditions=1)
    outcome = gap(run, data, tmp_path / "out", "--no-figures")
    assert outcome.status == 0, outcome
    assert "NONE: no disagreement beyond what chance explains" in outcome.out
    found = strict((tmp_path / "out" / "gap.json").read_text(encoding="utf-8"))
    assert (found["verdict"], found["effects"], found["disagreement"]) == ("none", [], [])
    assert files(tmp_path / "out") == {
        "gap.json",
        "series.csv",
        "priors.toml",
        "run.json",
    }
    assert run("report", tmp_path / "out", "--jobs", 1).status == 0
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "No disagreement beyond what chance explains" in page
    assert "there was nothing to explain" in page


def test_another_noise_is_refused_with_the_reason(run: Run, tmp_path: Path) -> None:
    outcome = gap(run, campaign(tmp_path / "data"), tmp_path / "out", "--noise", "ar1")
    assert (outcome.status, outcome.out) == (2, "")
    assert "--noise ar1" in outcome.err
    assert "leave --noise out" in outcome.err
    assert not (tmp_path / "out").exists()


def test_conditions_without_a_common_channel_are_refused(run: Run, tmp_path: Path) -> None:
    data = campaign(tmp_path / "data", columns="")
    text = (data / "campaign.toml").read_text(encoding="utf-8")
    own = {"c0": FORCE, "c1": DISPLACEMENT}
    for name, column in own.items():
        text = text.replace(f'file = "{name}.csv"\n', f'file = "{name}.csv"\n[condition.columns]\n{column}')
    (data / "campaign.toml").write_text(text, encoding="utf-8")
    outcome = gap(run, data, tmp_path / "out")
    assert outcome.status == 2, outcome
    assert "no channel was measured in all conditions" in outcome.err
    assert "c0: force; c1: displacement" in outcome.err
    assert not (tmp_path / "out").exists()


def test_too_few_samples_are_refused(run: Run, tmp_path: Path) -> None:
    data = campaign(tmp_path / "data")
    lines = sweeps(0, cycles=1, samples=10)
    (data / "c1.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    outcome = gap(run, data, tmp_path / "out")
    assert outcome.status == 2, outcome
    assert "condition 'c1' has 20 samples" in outcome.err
    assert not (tmp_path / "out").exists()


def test_a_single_branch_is_studied_and_said(run: Run, tmp_path: Path) -> None:
    data = campaign(tmp_path / "data", conditions=1)
    (data / "c0.csv").write_text("\n".join(sweeps(0, cycles=1, samples=60)[:61]) + "\n", encoding="utf-8")
    outcome = gap(run, data, tmp_path / "out", "--no-figures")
    assert outcome.status == 0, outcome
    assert "c0 has a heating branch only" in outcome.out


def test_an_unfinished_or_damaged_study_is_told_from_a_fit(run: Run, done: Path, tmp_path: Path) -> None:
    folder = shutil.copytree(done / "out", tmp_path / "out")
    (folder / "series.csv").unlink()
    assert "lacks series.csv" in run("report", folder).err
    (folder / "gap.json").unlink()
    outcome = run("report", folder)
    assert outcome.status == 2
    assert "holds a gap study that is not finished" in outcome.err


def test_progress_counts_stages_that_are_known_beforehand(tmp_path: Path) -> None:
    told: list[tuple[int, int, str]] = []
    study_gap(
        read_campaign(campaign(tmp_path / "data", conditions=1)),
        jobs=1,
        progress=lambda done, total, message: told.append((done, total, message)),
    )
    assert len({total for _, total, _ in told}) == 1
    done = [d for d, _, _ in told]
    assert done == sorted(done)
    assert done[-1] < told[0][1]


def test_a_channel_that_only_one_condition_has_is_left_out_and_said(run: Run, tmp_path: Path) -> None:
    data = campaign(tmp_path / "data", columns=DISPLACEMENT)
    text = (data / "campaign.toml").read_text(encoding="utf-8")
    text = text.replace('file = "c1.csv"\n', f'file = "c1.csv"\n[condition.columns]\n{FORCE}')
    (data / "campaign.toml").write_text(text, encoding="utf-8")
    outcome = gap(run, data, tmp_path / "out", "--no-figures", "--json")
    assert outcome.status == 0, outcome
    found = strict(outcome.out)
    assert list(found["channels"]) == ["displacement"]
    assert found["remarks"] == ["force was left out, as it was not measured on all branches of c0."]


def test_conditions_in_other_units_than_most_samples_are_left_out_and_said(run: Run, tmp_path: Path) -> None:
    data = campaign(tmp_path / "data", conditions=3)
    text = (data / "campaign.toml").read_text(encoding="utf-8")
    strange = DISPLACEMENT.replace('unit = "mm"', 'unit = "arbitrary"')
    text = text.replace('file = "c0.csv"\n', f'file = "c0.csv"\n[condition.columns]\n{strange}')
    (data / "campaign.toml").write_text(text, encoding="utf-8")
    outcome = gap(run, data, tmp_path / "out", "--no-figures", "--json")
    assert outcome.status == 0, outcome
    found = strict(outcome.out)
    assert [c["id"] for c in found["conditions"]] == ["c1", "c2"]
    (remark,) = found["remarks"]
    assert remark.startswith(
        "c0 was left out: displacement is in arbitrary units there and in m in the others."
    )
