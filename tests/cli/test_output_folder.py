"""The output folder: whose it is, where it can't be written, what a full disk leaves."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from sma_bayes.disk import FREE_BYTES
from sma_bayes.runs.output_folder import only_one_process
from sma_bayes.runs.store import UNFINISHED

Run = Callable[..., Any]


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory, make_sweep: Callable[..., list[str]]) -> Path:
    """A data file and its finished run, in `out`."""
    from sma_bayes import fit_campaign
    from sma_bayes.records.campaign import read_campaign

    folder = tmp_path_factory.mktemp("done")
    (folder / "run.csv").write_text("\n".join(make_sweep()) + "\n", encoding="utf-8")
    fit_campaign(read_campaign(folder / "run.csv"), folder / "out", jobs=1, figures=False)
    return folder


def content(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def refused(run: Run, data: Path, out: Path, *options: object) -> str:
    outcome = run("fit", data, "--out", out, "--no-figures", "--jobs", 1, *options)
    assert (outcome.status, outcome.out) == (2, ""), outcome
    assert outcome.err.startswith("error: ")
    assert outcome.err.count("error: ") == 1
    return str(outcome.err)


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ([], "holds this run already"),
        (["--seed", "3"], "holds another run"),
        (["--seed", "3", "--resume"], "differs in seed"),
        (["--noise", "ar1", "--resume"], "differs in noise"),
        (["--sampler", "de", "--resume"], "differs in sampler"),
        (["--extrapolate", "2", "--resume"], "differs in extrapolate"),
    ],
)
def test_a_finished_run_is_not_written_over(run: Run, done: Path, options: list[str], says: str) -> None:
    before = content(done / "out")
    assert says in refused(run, done / "run.csv", done / "out", *options)
    assert content(done / "out") == before


def test_resuming_with_other_priors_data_or_names_is_refused(run: Run, done: Path, tmp_path: Path) -> None:
    from sma_bayes.parameters.priors_file import read_priors

    before = content(done / "out")
    text = read_priors("modified_sigmoid").text.replace("sigma = 1.2", "sigma = 1.3")
    (tmp_path / "p.toml").write_text(text, encoding="utf-8")
    message = refused(run, done / "run.csv", done / "out", "--resume", "--priors", tmp_path / "p.toml")
    assert "differs in priors" in message
    lines = (done / "run.csv").read_text(encoding="utf-8").splitlines()
    (tmp_path / "run.csv").write_text("\n".join(lines[:-1]) + "\n", encoding="utf-8")
    assert "differs in data" in refused(run, tmp_path / "run.csv", done / "out", "--resume")
    shutil.copy(done / "run.csv", tmp_path / "other.csv")
    assert "differs in records" in refused(run, tmp_path / "other.csv", done / "out", "--resume")
    assert content(done / "out") == before


@pytest.mark.skipif(sys.platform == "win32", reason="no locks of that kind")
def test_two_processes_do_not_work_on_one_run(run: Run, done: Path) -> None:
    """The second removed what the first had half-written, and one of both ended with 'free the disk'."""
    before = content(done / "out")
    with only_one_process(done / "out"):
        half = done / "out" / f"{UNFINISHED}of-the-first"
        half.touch()
        told = refused(run, done / "run.csv", done / "out", "--resume")
        assert half.exists()
        half.unlink()
    assert "another process is at work on this run" in told
    assert "wait until that one ends, or choose another --out" in told
    assert content(done / "out") == before


def test_resuming_a_finished_run_gives_it_again(run: Run, done: Path) -> None:
    before = content(done / "out")
    assert (
        run("fit", done / "run.csv", "--out", done / "out", "--no-figures", "--jobs", 1, "--resume", "-q").err
        == ""
    )
    assert content(done / "out") == before  # read, and not done again


@pytest.mark.parametrize("text", ['{"half', "[]", ""])
def test_a_folder_whose_mark_says_nothing(run: Run, measured: Path, tmp_path: Path, text: str) -> None:
    out = tmp_path / "out"
    out.mkdir()
    (out / "run.json").write_text(text, encoding="utf-8")
    assert "run.json: does not say which run" in refused(run, measured, out, "--resume")


def test_a_file_a_path_below_a_file_and_a_folder_in_use(run: Run, measured: Path, tmp_path: Path) -> None:
    assert "is a file" in refused(run, measured, measured)
    assert "Not a directory" in refused(run, measured, measured / "below" / "it")
    assert "is not empty" in refused(run, measured, tmp_path)
    assert "File name too long" in refused(run, measured, tmp_path / ("x" * 300))
    assert [p.name for p in tmp_path.iterdir()] == ["run.csv"]


def test_a_failed_start_removes_the_folders_that_it_made(
    run: Run, measured: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(shutil, "disk_usage", lambda _: shutil._ntuple_diskusage(10**9, 10**9, 0))
    assert "0 MB are free" in refused(run, measured, tmp_path / "a" / "b" / "c")
    (tmp_path / "empty").mkdir()
    refused(run, measured, tmp_path / "empty")
    assert sorted(p.name for p in tmp_path.rglob("*")) == ["empty", "run.csv"]


@pytest.fixture
def mounted(tmp_path: Path) -> Iterator[Callable[[str], Path]]:
    """Mount a small file system; skips where that is not permitted."""
    place = tmp_path / "mounted"
    place.mkdir()
    done: list[Path] = []

    def mount(*options: str) -> Path:
        command = ["mount", *options, str(place)]
        if (
            shutil.which("mount") is None
            or subprocess.run(command, capture_output=True, check=False).returncode
        ):
            pytest.skip("mounting a small file system is not permitted here")
        done.append(place)
        return place

    yield mount
    for where in reversed(done):
        subprocess.run(["umount", str(where)], check=True)


@pytest.mark.parametrize("kilobytes", [100, 300, FREE_BYTES // 1000 + 200, FREE_BYTES // 1000 + 1500])
def test_a_full_disk(
    run: Run, measured: Path, mounted: Callable[..., Path], tmp_path: Path, kilobytes: int
) -> None:
    """What is there is whole, and after a look at the disk the run goes on from it."""
    disk = mounted("-t", "tmpfs", "-o", f"size={kilobytes}k", "tmpfs")
    out = disk / "out"
    message = refused(run, measured, out)
    assert "can't be written" in message
    assert "then repeat with --resume" in message
    assert [p for p in disk.rglob(".*")] == []
    for path in disk.rglob("*.json"):
        assert json.loads(path.read_text(encoding="utf-8"))
    subprocess.run(["mount", "-o", "remount,size=100m", str(disk)], check=True)
    outcome = run("fit", measured, "--out", out, "--no-figures", "--jobs", 1, "--resume", "-q")
    assert (outcome.status, outcome.out, outcome.err) == (0, "", "")
    assert len(list((out / "posterior").iterdir())) == 2


def test_a_read_only_disk(run: Run, measured: Path, mounted: Callable[..., Path]) -> None:
    disk = mounted("-t", "tmpfs", "-o", "size=1m,ro", "tmpfs")
    for out in (disk, disk / "out"):
        assert "Read-only file system" in refused(run, measured, out)


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_folder_without_permission(run: Run, measured: Path, tmp_path: Path) -> None:
    locked = tmp_path / "locked"
    locked.mkdir(mode=0o500)
    assert "Permission denied" in refused(run, measured, locked / "out")
