"""Same seed, same numbers: on one process or two, in one go or killed and resumed."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sma_bayes import fit_campaign
from sma_bayes.records.campaign import read_campaign

Same = Callable[[Path, Path], None]
EXAMPLE = Path(__file__).resolve().parents[2] / "docs" / "examples" / "nitihf_sparse_isobaric.toml"


@pytest.fixture(autouse=True)
def chains_are_written_at_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In this process and in all that are started from it, as if records took long."""
    monkeypatch.setattr("sma_bayes.sampling.checkpoint.HELD_BACK_S", 0.0)
    own = tmp_path / "at_once"
    own.mkdir()
    line = "from sma_bayes.sampling import checkpoint\ncheckpoint.HELD_BACK_S = 0.0\n"
    (own / "sitecustomize.py").write_text(line, encoding="utf-8")
    before = os.environ.get("PYTHONPATH")
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(own), *([before] if before else [])]))


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two conditions, one of them with a short heating branch that needs differential evolution."""
    folder = tmp_path_factory.mktemp("data")
    rng = np.random.default_rng(5)
    text = '[campaign]\nname = "two"\n'
    for name, n, load in (("light", 40, 1.0), ("heavy", 12, 2.0)):
        up = np.linspace(30.0, 70.0, n)
        temperature = np.concatenate([up, up[::-1]])
        force = load + 2.0 / (1.0 + np.exp(-0.3 * (temperature - 52.0))) + 0.03 * rng.standard_normal(2 * n)
        rows = "".join(f"{t:.6g},{f:.6g}\n" for t, f in zip(temperature, force, strict=True))
        (folder / f"{name}.csv").write_text("temperature_C,force_N\n" + rows, encoding="utf-8")
        text += f'[[condition]]\nid = "{name}"\nfile = "{name}.csv"\n'
    head, _, conditions = text.partition("[[condition]]")
    columns = (
        '[columns]\ntemperature = { name = "temperature_C", unit = "degC" }\n'
        'force = { name = "force_N", unit = "N" }\n'
    )
    (folder / "campaign.toml").write_text(f"{head}{columns}[[condition]]{conditions}", encoding="utf-8")
    return folder


@pytest.fixture(scope="module")
def whole(data: Path) -> Path:
    """The run that nobody interrupted."""
    fit_campaign(read_campaign(data), data / "whole", jobs=1, figures=False)
    return data / "whole"


def command(data: Path, out: Path, *options: object) -> list[str]:
    fixed = ["--out", str(out), "--no-figures", "--quiet"]
    return [sys.executable, "-m", "sma_bayes", "fit", str(data), *fixed, *map(str, options)]


def kill_after(arguments: list[str], ready: Any) -> None:
    """Start a run and kill it with all its processes as soon as `ready()`, or let it end."""
    process = subprocess.Popen(
        arguments, start_new_session=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    deadline = time.monotonic() + 240
    try:
        while process.poll() is None and not ready() and time.monotonic() < deadline:
            time.sleep(0.01)
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def size(path: Path) -> int:
    """Bytes in a file that the run may rename or remove while it is looked at."""
    try:
        return path.stat().st_size
    except FileNotFoundError:
        return 0


def test_two_processes_give_the_numbers_of_one(data: Path, whole: Path, assert_same_run: Same) -> None:
    fit_campaign(read_campaign(data), data / "two", jobs=2, figures=False)
    assert_same_run(whole, data / "two")


def test_another_seed_gives_other_draws(data: Path, whole: Path, summary: Callable[[Path], Any]) -> None:
    other = fit_campaign(read_campaign(data), data / "seed", seed=1, jobs=2, figures=False)
    for mine, theirs in zip(summary(whole)["records"], other["records"], strict=True):
        assert mine["parameters"]["B1"]["mean"] != theirs["parameters"]["B1"]["mean"]


@pytest.mark.skipif(not hasattr(os, "killpg"), reason="needs process groups")
@pytest.mark.parametrize("jobs", [pytest.param(1, marks=pytest.mark.thorough), 2])
def test_a_run_that_was_killed_goes_on_to_the_same_bits(
    data: Path, whole: Path, jobs: int, assert_same_run: Same
) -> None:
    out = data / f"killed-{jobs}"
    call = command(data, out, "--jobs", jobs)
    chains = out / "checkpoints"
    # in the first record's chains, then between records, then while a posterior is written
    kill_after(call, lambda: any(size(p) > 20_000 for p in chains.glob("*.h5")))
    kill_after([*call, "--resume"], lambda: len(list(out.glob("bands/*.csv"))) >= 2)
    kill_after([*call, "--resume"], lambda: len(list(out.glob("posterior/*"))) >= 2)
    done = subprocess.run([*call, "--resume"], capture_output=True, text=True, timeout=240, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    assert_same_run(whole, out)
    assert list(out.rglob(".*")) == []


def test_a_half_written_file_and_a_spoilt_checkpoint_do_no_harm(
    data: Path, whole: Path, assert_same_run: Same, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = data / "spoilt"
    monkeypatch.setattr("sma_bayes.studies.fit.chains.COSTLY_EVALUATIONS", 0)  # chains stay
    fit_campaign(read_campaign(data), out, jobs=1, figures=False)
    (out / "posterior" / ".unfinished-abc.nc").write_bytes(b"half")
    (chain,) = (out / "checkpoints").glob("light-heating-*.h5")
    chain.write_bytes(chain.read_bytes()[:5000])
    (out / "posterior" / "light-heating.nc").write_bytes(b"half")
    (out / "summary.json").unlink()
    fit_campaign(read_campaign(data), out, jobs=1, figures=False, resume=True)
    assert_same_run(whole, out)
    assert not (out / "posterior" / ".unfinished-abc.nc").exists()


def test_what_a_lost_worker_left_half_written_is_gone_at_the_end(data: Path) -> None:
    out = data / "lost"

    def leave_half(done: int, total: int, message: str) -> None:
        if done == 1:
            (out / "posterior" / ".unfinished-abc.nc").write_bytes(b"half")

    fit_campaign(read_campaign(data), out, jobs=1, figures=False, progress=leave_half)
    assert list(out.rglob(".*")) == []


def test_chains_stay_until_all_is_told_and_the_draws_can_be_made_again(
    data: Path, whole: Path, assert_same_run: Same
) -> None:
    out = data / "ended"

    def end(done: int, total: int, message: str) -> None:
        if done == total:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fit_campaign(read_campaign(data), out, jobs=1, figures=False, progress=end)
    assert len({p.name.split("-")[0] for p in (out / "checkpoints").glob("*.h5")}) == 2
    for _ in range(2):  # from chains, then without them
        fit_campaign(read_campaign(data), out, jobs=1, figures=False, resume=True)
        assert_same_run(whole, out)
        assert not (out / "checkpoints").exists()
        (out / "summary.json").unlink()


def test_files_that_a_finished_run_lacks_are_made_again(
    data: Path, whole: Path, assert_same_run: Same
) -> None:
    out = data / "lacking"
    shutil.copytree(whole, out)
    (out / "posterior" / "light-heating.nc").unlink()
    fit_campaign(read_campaign(data), out, jobs=1, figures=False, resume=True)
    assert_same_run(whole, out)


@pytest.mark.slow
def test_a_real_campaign_killed_at_random_times(
    shared_data: Path, tmp_path: Path, assert_same_run: Same
) -> None:
    source = shared_data / "nitihf_sparse_isobaric"
    call = [*command(EXAMPLE, tmp_path / "killed", "--jobs", 2), "--data", str(source)]
    rng = np.random.default_rng(0)
    for i in range(4):
        end = time.monotonic() + float(rng.uniform(3.0, 12.0))
        kill_after([*call, *(["--resume"] if i else [])], lambda end=end: time.monotonic() > end)
    assert subprocess.run([*call, "--resume"], timeout=600, check=False).returncode == 0
    fit_campaign(read_campaign(EXAMPLE, data_dir=source), tmp_path / "whole", figures=False)
    assert_same_run(tmp_path / "whole", tmp_path / "killed")
