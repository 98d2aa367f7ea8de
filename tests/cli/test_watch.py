"""`sma-bayes watch`: quiet cycles, a fault, what comes twice or half, resuming, a folder, and bad input."""

from __future__ import annotations

import csv
import json
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

import sma_bayes
from sma_bayes.report.notation import with_percent
from sma_bayes.runs.documents import WATCH
from sma_bayes.runs.finished_run import read_finished
from sma_bayes.runs.shown import in_declared_units
from sma_bayes.studies.watch.figures.watched import evidence_figure
from sma_bayes.studies.watch.schema import WatchDocument

Published = Callable[[str], Any]
Run = Callable[..., Any]
QUIET, FAULTY = 4, 5


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory, watched_spring: ModuleType) -> Path:
    """A fit of four cycles, files of quiet cycles that follow, and of cycles whose displacement drifts."""
    folder, rng, rig = tmp_path_factory.mktemp("watch"), np.random.default_rng(0), watched_spring.PLAIN
    campaign = sma_bayes.read_campaign(rig.campaign(folder / "bench", rng, 4))
    sma_bayes.fit_campaign(campaign, folder / "results", jobs=1, figures="none", noise="independent")
    for n in range(1, QUIET + 1):
        watched_spring.write(folder / "quiet" / f"{n}.csv", [rig.cycle(rng)])
    for n in range(1, FAULTY + 1):
        read = watched_spring.offset_drift(n, rig.cycle(rng))
        watched_spring.write(folder / "faulty" / f"{n}.csv", [read])
    return folder


def files(place: Path, name: str) -> list[Path]:
    return sorted((place / name).glob("*.csv"))


def found_in(folder: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((folder / "watch.json").read_text(encoding="utf-8"))
    return found


def without_account(found: dict[str, Any]) -> dict[str, Any]:
    of_run = {"wall_s", "stages_s", "stages_cpu_s", "workers", "content_sha256", "figures", "files_sha256"}
    return {k: v for k, v in found.items() if k not in of_run}


@pytest.fixture(scope="module")
def out(place: Path) -> Path:
    """A watch of the quiet cycles, then of the faulty ones."""
    folder = place / "out"
    limit = ["stroke=-20%", "displacement@60 degC=25 mm"]
    first = sma_bayes.watch(place / "results", files(place, "quiet"), folder, limit=limit)
    assert first["verdict"] == "same"
    assert first["exit_status"] == 0
    sma_bayes.watch(place / "results", files(place, "faulty"), folder, limit=limit)
    return folder


def test_the_document_is_as_published_and_every_file_is_there(out: Path, published: Published) -> None:
    found = found_in(out)
    published("watch").validate(found)
    published("watch-state").validate(json.loads((out / "state.json").read_text(encoding="utf-8")))
    assert len(found["cycles"]) == QUIET + FAULTY
    assert found["fitted"] == [1, 2, 3, 4]
    page = (out / "report.html").read_text(encoding="utf-8").replace("&#39;", "'").replace("\u00a0%", "%")
    assert f"<strong>Alarm:</strong> {found['statement']}.</p>" in page
    for said in (found["change"]["statement"], *(r["statement"] for r in found["limits"])):
        assert f"<p>{said[0].upper()}{said[1:]}.</p>" in page.replace("<strong>", "").replace("</strong>", "")
    for name in ("evidence", "numbers"):
        assert (out / "figures" / f"{name}.png").is_file()
    with (out / "cycles.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 10 * (4 + QUIET + FAULTY)
    with (out / "e_process.csv").open(encoding="utf-8") as file:
        assert [float(r["log10_alarm"]) for r in csv.DictReader(file)] == [2.0] * (QUIET + FAULTY)


def test_a_drift_is_found_dated_named_and_measured(out: Path) -> None:
    """The sensor has crept by 0.12 mm * 5^0.7 = 0.370 mm at the last cycle; a power is neither a step nor a ramp."""
    found = found_in(out)
    assert found["verdict"] == "changed"
    assert found["exit_status"] == 1
    assert QUIET < found["alarm"]["cycle"] <= QUIET + 4
    assert found["alarm"]["onset"]["low"] <= QUIET + 1 <= found["alarm"]["onset"]["high"] + 1
    assert found["alarm"]["numbers"] == ["heating displacement offset", "cooling displacement offset"]
    assert "displacement_offset" in found["alarm"]["causes"]
    assert found["change"]["verdict"] == "named"
    cause = found["change"]["causes"][0]
    assert cause["id"] == "displacement_offset"
    (amount,) = cause["amounts"]
    assert amount["unit"] == "m"
    assert amount["median"] == pytest.approx(0.370e-3, rel=0.15)
    inside = [n for n in found["numbers"] if n["number"] != "offset"]
    assert not any(n["alarm"] for n in inside)


def test_limits_that_are_far_are_not_reached(out: Path) -> None:
    limits = found_in(out)["limits"]
    assert [(r["limit"], r["branch"]) for r in limits] == [
        ("stroke=-20%", "heating"),
        ("stroke=-20%", "cooling"),
        ("displacement@60 degC=25 mm", "heating"),
        ("displacement@60 degC=25 mm", "cooling"),
    ]
    for r in limits[:2]:
        assert r["target"] == pytest.approx(0.8 * r["fitted"])
        assert r["fitted"] == pytest.approx(0.018, rel=0.02)
        assert r["probability"] < 0.1
    assert limits[2]["target"] == pytest.approx(0.025)


def test_title_and_legend_of_the_evidence_do_not_touch(out: Path) -> None:
    figure = evidence_figure(read_finished(WATCH, WatchDocument, out, in_declared_units)).figure
    figure.draw_without_rendering()
    (title,), (legend,) = figure.texts, figure.legends
    axes = figure.axes[0].get_tightbbox()
    boxes = [title.get_window_extent(), legend.get_window_extent(), axes]
    assert not any(a.overlaps(b) for i, a in enumerate(boxes) for b in boxes[:i])


def test_people_are_told_in_declared_units(out: Path) -> None:
    """A millimetre stays one, in table, sentence and figure; the document is in metres."""
    found = found_in(out)
    assert found["declared_units"] == {"displacement": "mm"}
    (cause, *_) = found["change"]["causes"]
    (amount,) = cause["amounts"]
    assert (amount["name"], amount["unit"]) == ("offset", "m")
    assert f"{1000.0 * amount['median']:.2g}"[:3] in found["statement"]
    assert " mm" in found["statement"]
    with (out / "tables" / "causes.csv").open(encoding="utf-8") as file:
        row = next(iter(csv.DictReader(file)))
    assert (row["unit"], float(row["value_median [unit]"])) == (
        "mm",
        pytest.approx(1000.0 * amount["median"]),
    )
    stored = {(n["branch"], n["number"]): n for n in found["numbers"]}
    factors = {"offset": 1000.0, "stroke": 1000.0, "noise": 1000.0, "shift": 1.0, "width": 1.0}
    with (out / "tables" / "numbers.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    for row in rows:
        n, factor = stored[row["branch"], row["number"]], factors[row["number"]]
        assert row["unit"] == ("mm" if factor > 1.0 else n["unit"])
        for name, value in (("last", n["value"]), ("low", n["normal_low"]), ("high", n["normal_high"])):
            assert float(row[f"{name} [unit]"]) == pytest.approx(factor * value[-1], rel=1e-8)
    with (out / "figures" / "numbers.csv").open(encoding="utf-8") as file:
        assert {r["unit"] for r in csv.DictReader(file)} == {"mm", "K", "1"}
    with (out / "tables" / "limits.csv").open(encoding="utf-8") as file:
        limits = list(csv.DictReader(file))
    assert {r["unit"] for r in limits} == {"mm"}
    targets = {(r["branch"], r["limit"]): r["target"] for r in found["limits"]}
    assert len(limits) == len(targets) == 4
    for row in limits:
        target = targets[row["branch"], row["limit"]]
        assert float(row["target [unit]"]) == pytest.approx(1000.0 * target, rel=1e-8)


def test_shifts_and_temperatures_are_told_in_declared_units(out: Path) -> None:
    found = WatchDocument.model_validate(found_in(out))
    units = {"displacement": "mm", "temperature": "degF"}
    shown = in_declared_units(found.model_copy(update={"declared_units": units}))
    for before, after in zip(found.numbers, shown.numbers, strict=True):
        if before.number == "shift":
            assert after.unit == "degF"
            assert after.value == pytest.approx([1.8 * v for v in before.value])
    warm = [(a.at, b.at) for a, b in zip(found.limits, shown.limits, strict=True) if a.at is not None]
    assert warm
    assert all(at == 60.0 and told == pytest.approx(140.0) for at, told in warm)


def test_one_call_and_many_give_the_same_numbers(place: Path, out: Path) -> None:
    again = place / "one-by-one"
    for path in (*files(place, "quiet"), *files(place, "faulty")):
        sma_bayes.watch(place / "results", path, again, figures="none")
    whole = sma_bayes.watch(place / "results", [*files(place, "quiet"), *files(place, "faulty")])
    one, other = without_account(found_in(again)), without_account(whole)
    assert one == other
    of_limits: dict[str, Any] = {"limits": [], "asked": []}
    assert {**without_account(found_in(out)), **of_limits} == {**one, **of_limits}


def test_a_watch_that_was_killed_goes_on_to_the_same_numbers(place: Path, out: Path) -> None:
    """SIGKILL as soon as the state has been written once; the same command counts the rest."""
    folder = place / "killed"
    paths = [*files(place, "quiet"), *files(place, "faulty")]
    command = [sys.executable, "-m", "sma_bayes", "watch", str(place / "results"), *map(str, paths)]
    command += ["--out", str(folder), "--no-figures", "--quiet"]
    process = subprocess.Popen(command)
    while not (folder / "state.json").is_file() and process.poll() is None:
        time.sleep(0.01)
    process.send_signal(signal.SIGKILL if os.name == "posix" else signal.SIGTERM)
    process.wait()
    assert subprocess.run(command, check=False).returncode == 1
    state = json.loads((folder / "state.json").read_text(encoding="utf-8"))
    unbroken = json.loads((out / "state.json").read_text(encoding="utf-8"))
    assert state["cycles"] == unbroken["cycles"]


def test_what_comes_twice_or_grows_counts_once(
    place: Path, watched_spring: ModuleType, tmp_path: Path
) -> None:
    rng, rig, grows = np.random.default_rng(7), watched_spring.PLAIN, tmp_path / "grows.csv"
    cycles = [rig.cycle(rng) for _ in range(3)]
    results, out = place / "results", tmp_path / "out"
    watched_spring.write(grows, cycles[:1])
    first = sma_bayes.watch(results, grows, out, figures="none")
    copied = shutil.copy(grows, tmp_path / "copy.csv")
    again = sma_bayes.watch(results, [grows, copied], out, figures="none")
    assert len(again["cycles"]) == len(first["cycles"]) == 1
    assert any("came again" in text for text in again["remarks"])
    watched_spring.write(grows, cycles)
    lines = grows.read_text(encoding="utf-8").splitlines(keepends=True)
    grows.write_text("".join(lines[:-12]), encoding="utf-8")
    grown = sma_bayes.watch(results, grows, out, figures="none")
    assert [c["cycle_in_file"] for c in grown["cycles"]] == [1, 2]
    assert len(grown["partial"]) == 1
    assert "grows.csv, cycle 3: cooling covers" in grown["partial"][0]
    watched_spring.write(grows, cycles)
    whole = sma_bayes.watch(results, grows, out, figures="none")
    assert [c["cycle_in_file"] for c in whole["cycles"]] == [1, 2, 3]
    assert whole["partial"] == []


def test_cycles_that_were_fitted_do_not_count_as_new(
    run: Run, place: Path, watched_spring: ModuleType, tmp_path: Path
) -> None:
    (fitted,) = files(place, "bench")
    grows = shutil.copy(fitted, tmp_path / "grows.csv")
    found = sma_bayes.watch(place / "results", grows)
    assert found["cycles"] == []
    assert found["verdict"] == "same"
    assert "grows.csv: 4 cycles of it were fitted, and don't count as new" in found["remarks"]
    outcome = run("watch", place / "results", grows)
    assert outcome.status == 0
    assert "4 cycles of it were fitted" in " ".join(outcome.out.split())


def test_a_line_without_an_end_is_left_out_and_told(place: Path, tmp_path: Path) -> None:
    text = files(place, "quiet")[0].read_text(encoding="utf-8")
    (tmp_path / "cut.csv").write_text(text[:-4], encoding="utf-8")
    found = sma_bayes.watch(place / "results", tmp_path / "cut.csv")
    assert len(found["cycles"]) == 1
    assert any("line 51 has no end and was left out" in r for r in found["remarks"])


def test_a_file_that_has_just_begun_is_partial(run: Run, place: Path, tmp_path: Path) -> None:
    lines = files(place, "quiet")[0].read_text(encoding="utf-8").splitlines(keepends=True)
    (tmp_path / "begun.csv").write_text("".join(lines[:8]), encoding="utf-8")
    outcome = run("watch", place / "results", tmp_path / "begun.csv", "--json")
    assert outcome.status == 0, outcome.err
    found = json.loads(outcome.out)
    assert found["cycles"] == []
    assert "begun.csv" in found["partial"][0]
    assert found["statement"] == "no whole cycle has been watched yet"


def test_a_folder_is_watched_until_there_is_an_alarm(run: Run, place: Path, tmp_path: Path) -> None:
    folder, out = tmp_path / "logger", tmp_path / "out"
    folder.mkdir()
    shutil.copy(files(place, "quiet")[0], folder / "q1.csv")
    (folder / "broken.csv").write_text("a,b\n1,2\n", encoding="utf-8")
    coming = [*files(place, "quiet")[1:], *files(place, "faulty")]

    def log() -> None:
        while not (out / "watch.json").is_file():
            time.sleep(0.1)
        for n, path in enumerate(coming):
            shutil.copy(path, folder / f"x{n:02}.csv")

    logger = threading.Thread(target=log)
    logger.start()
    outcome = run(
        "watch", place / "results", "--folder", folder, "--out", out, "--no-figures", "--idle", "60"
    )
    logger.join()
    assert outcome.status == 1, outcome.err
    (line,) = (text for text in outcome.out.splitlines() if text.startswith("broken.csv: left out"))
    assert "; expected: " in line
    assert "; what to do: " in line
    assert "changed: alarm with cycle" in outcome.out
    found = found_in(out)
    assert found["alarm"]["file"].startswith("x")
    assert len(found["cycles"]) == found["alarm"]["cycle"]


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
def test_a_watch_of_a_folder_ends_in_order_by_a_signal(place: Path, tmp_path: Path) -> None:
    folder, out = tmp_path / "logger", tmp_path / "out"
    folder.mkdir()
    shutil.copy(files(place, "quiet")[0], folder / "q1.csv")
    command = [sys.executable, "-m", "sma_bayes", "watch", str(place / "results"), "--folder", str(folder)]
    command += ["--out", str(out), "--no-figures"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stdout is not None
    assert process.stdout.readline().startswith("q1.csv: 1 new")
    process.send_signal(signal.SIGINT)
    _, told = process.communicate(timeout=60)
    assert process.returncode == 130
    assert told.splitlines()[-1] == "interrupted; the same command goes on from here"
    assert len(found_in(out)["cycles"]) == 1


def test_a_folder_in_which_nothing_comes_ends_when_idle(run: Run, place: Path, tmp_path: Path) -> None:
    (tmp_path / "logger").mkdir()
    outcome = run(
        "watch", place / "results", "--folder", tmp_path / "logger", "--out", tmp_path / "out", "--idle", "0",
        "--no-figures",
    )  # fmt: skip
    assert outcome.status == 0, outcome.err
    assert "no whole cycle has been watched yet" in outcome.out


def test_the_terminal_tells_the_same(run: Run, place: Path, out: Path) -> None:
    before = found_in(out)
    outcome = run("watch", place / "results", "--out", out, "--no-figures")
    assert outcome.status == 1
    assert with_percent(before["statement"]) in outcome.out
    assert "ALARM" in outcome.out
    assert "last 5 of the watched cycles" in outcome.out
    alarming = [n for n in before["numbers"] if n["alarm"]]
    rows = [line.split("│")[-2].strip() for line in outcome.out.splitlines() if "ALARM │" in line]
    assert sorted(rows) == sorted(f"{max(n['log10_e']):.2f} ALARM" for n in alarming)
    told = " ".join(outcome.out.split())
    for cause in before["together"]:
        line = f"({cause['title']}): most log10 e {max(cause['log10_e']):.2f} ALARM"
        assert (line in told) == cause["alarm"]


def test_the_report_is_built_anew(run: Run, place: Path, out: Path) -> None:
    (out / "report.html").unlink(missing_ok=True)
    assert run("report", out, "--quiet").status == 0
    assert (out / "report.html").is_file()


def test_a_file_of_another_campaign_is_refused_and_nothing_is_counted(
    run: Run, place: Path, out: Path, tmp_path: Path
) -> None:
    before = (out / "state.json").read_bytes()
    (tmp_path / "other.csv").write_text("a,b\n1,2\n", encoding="utf-8")
    outcome = run("watch", place / "results", tmp_path / "other.csv", files(place, "quiet")[0], "--out", out)
    assert outcome.status == 2
    assert "other.csv: is not of this campaign" in outcome.err
    assert "--campaign FILE" in outcome.err
    assert (out / "state.json").read_bytes() == before


def test_temperatures_of_another_range_are_refused(run: Run, place: Path, tmp_path: Path) -> None:
    lines = files(place, "quiet")[0].read_text(encoding="utf-8").splitlines()
    rows = [line.split(",") for line in lines[1:]]
    kelvin = [",".join([r[0], f"{float(r[1]) + 273.15:g}", *r[2:]]) for r in rows]
    (tmp_path / "kelvin.csv").write_text("\n".join([lines[0], *kelvin]) + "\n", encoding="utf-8")
    outcome = run("watch", place / "results", tmp_path / "kelvin.csv")
    assert outcome.status == 2
    assert "over which the spring was fitted" in outcome.err


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (("--limit", "colour=3"), "--limit 'colour=3'"),
        (("--limit", "stroke"), "such as 'stroke=-20%'"),
        (("--limit", "shift=10%"), "a temperature difference"),
        (("--limit", "stiffness@60=500 N/m"), "has no unit"),
        (("--limit", "stroke=3 N"), "N"),
        (("--alpha", "0"), "--alpha 0"),
        (("--condition", "other"), "unknown condition 'other'"),
        (("--campaign", "nowhere.toml"), "no such campaign file"),
        (("--folder", "nowhere"), "is not a folder"),
        (("--idle", "5"), "--idle without --folder"),
    ],
)
def test_what_can_not_be_is_refused(run: Run, place: Path, options: tuple[str, ...], told: str) -> None:
    outcome = run("watch", place / "results", files(place, "quiet")[0], *options)
    assert outcome.status == 2, outcome.out
    assert told in outcome.err


@pytest.mark.parametrize(
    ("limit", "told"),
    [
        ("stroke=9 N**9**9", "N**9**9"),
        ("stroke=3 N", "'N'"),
        ("shift=5 mm", "'mm'"),
        ("stiffness@60 degC=500 N/m", "nothing that was fitted has 'stiffness'"),
        ("displacement@60 degC=3", "has no unit"),
    ],
)
def test_limits_are_refused_before_there_are_cycles_enough_to_tell(
    run: Run, place: Path, tmp_path: Path, watched_spring: ModuleType, limit: str, told: str
) -> None:
    fit = tmp_path.parent / "of-two-cycles"
    if not fit.is_dir():
        rig = watched_spring.PLAIN
        campaign = sma_bayes.read_campaign(rig.campaign(tmp_path / "bench", np.random.default_rng(1), 2))
        sma_bayes.fit_campaign(campaign, fit, jobs=1, figures="none", noise="independent")
    outcome = run("watch", fit, "--limit", limit)
    assert outcome.status == 2, outcome.out
    assert told in outcome.err


def test_of_one_fitted_and_one_watched_cycle(run: Run, tmp_path: Path, watched_spring: ModuleType) -> None:
    """The page said that no limit was asked for, and its first cycle was between 0.60 and 1.50."""
    rig, rng, out = watched_spring.PLAIN, np.random.default_rng(1), tmp_path / "watch"
    campaign = sma_bayes.read_campaign(rig.campaign(tmp_path / "bench", rng, 1))
    sma_bayes.fit_campaign(campaign, tmp_path / "results", jobs=1, figures="none", noise="independent")
    watched_spring.write(tmp_path / "next.csv", [rig.cycle(rng)])
    outcome = run(
        "watch", tmp_path / "results", tmp_path / "next.csv", "--out", out, "--limit", "stroke=-20%",
        "--campaign", tmp_path / "bench",
    )  # fmt: skip
    assert outcome.status == 0, outcome.err
    page = (out / "report.html").read_text(encoding="utf-8")
    assert f"--campaign &#34;{tmp_path / 'bench' / 'campaign.toml'}&#34; --limit" in page
    assert "Not known yet: remaining cycles are told from three cycles on." in page
    assert "No limit was asked for" not in page
    (ax,) = evidence_figure(read_finished(WATCH, WatchDocument, out, in_declared_units)).figure.axes
    assert [t for t in ax.get_xticks() if 0.5 <= t <= 1.5] == [1.0]
    assert "--limit &#34;stroke=-20%&#34;</pre>" in page


def test_sentence_and_figure_tell_the_same_evidence_after_one_cycle(
    run: Run, place: Path, tmp_path: Path
) -> None:
    """The sentence said 1 where the figure had 0.16."""
    outcome = run("watch", place / "results", files(place, "quiet")[0], "--out", tmp_path / "one")
    stored = read_finished(WATCH, WatchDocument, tmp_path / "one", in_declared_units)
    evidence = 10.0 ** stored.found.cycles[0].log10_e
    series = len(stored.found.numbers) + len(stored.found.together)
    assert evidence < 1.0
    assert stored.found.p_value == 1.0
    assert f"the evidence of a change came to {evidence:.2g}, and 100 is an alarm" in outcome.out
    (ax,) = evidence_figure(stored).figure.axes
    assert float(ax.lines[series].get_ydata()[0]) == pytest.approx(np.log10(evidence))
    ticks = dict(zip(ax.get_yticks(), (t.get_text() for t in ax.get_yticklabels()), strict=True))
    assert ticks[2.0] == "100"
    assert all(line.get_marker() == "o" for line in ax.lines[: series + 1])


def test_a_watch_of_another_fit_or_alpha_is_refused(run: Run, place: Path, out: Path) -> None:
    outcome = run("watch", place / "results", "--out", out, "--alpha", "0.05")
    assert outcome.status == 2
    assert "differs in alpha" in outcome.err
    assert run("watch", place / "results", "--out", place / "results").status == 2
    missing = run("watch", place / "nothing", files(place, "quiet")[0])
    assert missing.status == 2
    assert "the output folder of a fit" in missing.err


def test_a_state_that_was_changed_is_refused(run: Run, place: Path, out: Path, tmp_path: Path) -> None:
    changed = shutil.copytree(out, tmp_path / "changed")
    state = json.loads((changed / "state.json").read_text(encoding="utf-8"))
    state["cycles"][0]["log_evidence"][0] += 1.0
    (changed / "state.json").write_text(json.dumps(state), encoding="utf-8")
    outcome = run("watch", place / "results", "--out", changed)
    assert outcome.status == 2
    assert "state.json" in outcome.err
