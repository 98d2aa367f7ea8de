"""A signal ends a run in order, whenever it comes: one line, its status, no process, no half-written file."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from sma_bayes.studies.registry import VERBS

pytestmark = pytest.mark.skipif(
    not Path("/proc/self/environ").exists(), reason="needs signals, and /proc to see what is left"
)

Same = Callable[[Path, Path], None]
ENDS_WITHIN_S = 2.0
"""After the end of the parent, for its workers."""
ROOT = Path(__file__).resolve().parents[2]
TAG = "SMA_BAYES_TEST_RUN"
ASKED = [signal.SIGINT, signal.SIGTERM, signal.SIGHUP]
OWN_VERBS = tuple(name for name, folder in VERBS.items() if folder.__name__.startswith("sma_bayes.studies."))
SPAN_S = 8.0
"""Instants are drawn from so many seconds, and from `QUICK_S` where a verb takes no longer."""
QUICK, QUICK_S = frozenset({"ask", "diff", "init", "inspect", "paper", "priors"}), 1.5
GOES_ON = frozenset({"report", "watch"})
"""Verbs that need not be told to resume."""
STUDY = """\
[study]
campaign = "campaign.toml"
out = "study-out"
jobs = 2
[fit]
[[ask]]
force = "1.5 N"
"""


def springs(folder: Path) -> Path:
    """A campaign of three conditions."""
    rng = np.random.default_rng(5)
    text = """\
[campaign]
name = "three"
[columns]
temperature = { name = "temperature_C", unit = "degC" }
force = { name = "force_N", unit = "N" }
"""
    for name, load in (("light", 1.0), ("middle", 1.5), ("heavy", 2.0)):
        up = np.linspace(30.0, 70.0, 40)
        temperature = np.concatenate([up, up[::-1]])
        force = load + 2.0 / (1.0 + np.exp(-0.3 * (temperature - 50.0 - load)))
        force += 0.03 * rng.standard_normal(temperature.size)
        rows = "".join(f"{t:.6g},{f:.6g}\n" for t, f in zip(temperature, force, strict=True))
        (folder / f"{name}.csv").write_text("temperature_C,force_N\n" + rows, encoding="utf-8")
        text += f'[[condition]]\nid = "{name}"\nfile = "{name}.csv"\nload_N = {load}\n'
    (folder / "campaign.toml").write_text(text, encoding="utf-8")
    (folder / "study.toml").write_text(STUDY, encoding="utf-8")
    write_cycles(folder / "cycles", rng)
    write_export(folder / "strip.csv", rng)
    return folder


def write_export(path: Path, rng: np.random.Generator) -> None:
    """Moduli of one heating."""
    t = np.linspace(0.0, 110.0, 60)
    share = 1.0 / (1.0 + np.exp(-0.25 * (t - 50.0)))
    storage = 28e3 + 38e3 * share + 250.0 * rng.standard_normal(t.size)
    loss = 700.0 + 6000.0 * share * (1.0 - share) + 25.0 * rng.standard_normal(t.size)
    rows = [f"{a:.6g},{b:.6g},{c:.6g}" for a, b, c in zip(t, storage, loss, strict=True)]
    header = ["Temperature,Storage modulus,Loss modulus", "°C,MPa,MPa"]
    path.write_text("\n".join([*header, *rows]) + "\n", encoding="utf-8")


def write_cycles(folder: Path, rng: np.random.Generator) -> None:
    """A campaign of one condition with four cycles, a little weaker each."""
    folder.mkdir()
    up = np.linspace(30.0, 70.0, 30)
    rows = ["time_s,temperature_C,force_N"]
    for cycle in range(4):
        for t in (*up, *up[::-1]):
            force = 1.0 + (2.0 - 0.1 * cycle) / (1.0 + np.exp(-0.3 * (t - 51.0)))
            rows.append(f"{len(rows)},{t:.6g},{force + 0.03 * rng.standard_normal():.6g}")
    (folder / "a.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    (folder / "campaign.toml").write_text('[[condition]]\nid = "a"\nfile = "a.csv"\n', encoding="utf-8")


def arguments(verb: str, campaign: Path, whole: Path, out: Path) -> list[str]:
    """Arguments of a verb that writes to `out`, if it does."""
    return [str(a) for a in calls(campaign, whole, out)[verb]]


def calls(campaign: Path, whole: Path, out: Path) -> dict[str, list[object]]:
    """A call of each verb of the program, see `test_signals_are_sent_to_every_verb`."""
    return {
        "fit": ["fit", campaign, "--out", out, "--no-figures", "--jobs", 2],
        "compare": ["compare", campaign, "--out", out, "--no-figures", "--jobs", 2],
        "gap": ["gap", campaign, "--out", out, "--no-figures", "--jobs", 2],
        "conditions": ["conditions", whole, "--out", out, "--jobs", 2],
        "demo": ["demo", "--out", out, "--no-figures", "--jobs", 2],
        "run": ["run", campaign / "study.toml", "--out", out],
        "report": ["report", whole, "--jobs", 2],
        "ask": ["ask", whole, "--force", "1.5 N"],
        "inspect": ["inspect", campaign],
        "init": ["init", out],
        "diff": ["diff", whole, whole],
        "sensitivity": ["sensitivity", whole, "--out", out, "--no-figures", "--jobs", 2],
        "simulate": ["simulate", campaign / "heated", "--reach", "force=3 N", "--out", out, "--no-figures"],
        "cycles": ["cycles", campaign / "cycles", "--out", out, "--no-figures", "--jobs", 2],
        "modulus": ["modulus", campaign / "strip.csv", "--frequency", "1 Hz",
                    "--out", out, "--no-figures", "--jobs", 2],
        "plan": ["plan", whole, "--for", "force@50degC", "--rate", "2 K/min",
                 "--out", out, "--no-figures", "--jobs", 2],
        "watch": ["watch", whole, campaign / "light.csv", "--condition", "light",
                  "--out", out, "--no-figures"],
        "card": ["card", campaign / "heated", "--out", out, "--no-figures"],
        "priors": ["priors"],
        "paper": ["paper"],
    }  # fmt: skip


class Started:
    """A command in a session of its own, whose processes are known by a mark in their environment."""

    def __init__(self, tmp_path: Path, given: list[str]) -> None:
        self.mark = f"{os.getpid()}-{time.monotonic_ns()}"
        self.temporary = tmp_path / f"tmp-{self.mark}"
        self.temporary.mkdir()
        self.log = tmp_path / f"log-{self.mark}"
        with self.log.open("wb") as log:
            self.process = subprocess.Popen(
                [sys.executable, "-m", "sma_bayes", *given],
                start_new_session=True,
                stdout=log,
                stderr=subprocess.STDOUT,
                env={
                    **os.environ,
                    TAG: self.mark,
                    "TMPDIR": str(self.temporary),
                    "JOBLIB_TEMP_FOLDER": str(self.temporary),
                },
            )

    def alive(self) -> list[str]:
        """Command lines of its processes that still live."""
        found = []
        for place in Path("/proc").iterdir():
            if not place.name.isdigit():
                continue
            try:
                if f"{TAG}={self.mark}".encode() in (place / "environ").read_bytes():
                    found.append((place / "cmdline").read_bytes().replace(b"\0", b" ").decode())
            except OSError:
                continue  # ended meanwhile, or somebody else's
        return [line for line in found if line]

    def has_our_handlers(self) -> bool:
        """Whether it heeds signals by now: as long as Python itself starts, nobody can."""
        try:
            status = Path(f"/proc/{self.process.pid}/status").read_text(encoding="ascii")
        except OSError:
            return True
        caught = next(line for line in status.splitlines() if line.startswith("SigCgt"))
        return bool(int(caught.split()[1], 16) & (1 << (signal.SIGHUP - 1)))

    def send_after(self, seconds: float, number: int, *, group: bool) -> None:
        """Send a signal that long after signals are heeded, unless it has ended."""
        while self.process.poll() is None and not self.has_our_handlers():
            time.sleep(0.001)
        time.sleep(seconds)
        if self.process.poll() is None:
            (os.killpg if group else os.kill)(self.process.pid, number)

    def text(self) -> str:
        return self.log.read_text(encoding="utf-8")

    def assert_nothing_lives(self) -> None:
        end = time.monotonic() + ENDS_WITHIN_S
        while self.alive() and time.monotonic() < end:
            time.sleep(0.05)
        assert self.alive() == []


def end_by(started: Started, seconds: float, number: int, *, group: bool) -> None:
    """End a run by a signal and check how it ends."""
    started.send_after(seconds, number, group=group)
    status = started.process.wait(timeout=240)
    try:
        started.assert_nothing_lives()
    finally:
        if started.alive():
            os.killpg(started.process.pid, signal.SIGKILL)
    if number == signal.SIGKILL:
        return
    told = started.text()
    assert "Traceback" not in told, told
    if status not in (0, 1):  # it may have been quicker than the signal
        assert status == 128 + number, told
        (line,) = [line for line in told.splitlines() if line.startswith("interrupted")]
        assert told.splitlines()[-1] == line
    assert list(started.temporary.rglob("*")) == []


@pytest.fixture(scope="module")
def campaign(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return springs(tmp_path_factory.mktemp("campaign"))


def finish(given: list[str]) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "sma_bayes", *given], capture_output=True, text=True, timeout=300, check=False
    )
    assert done.returncode in (0, 1), done.stderr


@pytest.fixture(scope="module")
def whole(campaign: Path) -> Path:
    """A fit that nobody interrupted."""
    out = campaign / "whole"
    finish(arguments("fit", campaign, out, out))
    return out


@pytest.fixture(scope="module")
def heated(campaign: Path, heated_fit: Path) -> Path:
    """A fit of a spring that a current heats, beside the campaign."""
    return Path(shutil.copytree(heated_fit, campaign / "heated"))


def try_instants(
    verbs: tuple[str, ...], numbers: list[int], count: int, seed: int, campaign: Path, whole: Path, tmp_path: Path
) -> None:  # fmt: skip
    """Send signals at random instants over verbs; every second time to all processes at once, as a terminal does."""
    rng = np.random.default_rng(seed)
    for i in range(count):
        verb, number = verbs[i % len(verbs)], numbers[(i // len(verbs)) % len(numbers)]
        out = tmp_path / f"{verb}-{i}"
        if verb == "init":
            out.mkdir()
            shutil.copy(campaign / "light.csv", out)
        started = Started(tmp_path, arguments(verb, campaign, whole, out))
        instant = float(rng.uniform(0.0, QUICK_S if verb in QUICK else SPAN_S))
        group = number != signal.SIGKILL and bool(rng.integers(2))
        try:
            end_by(started, instant, number, group=group)
            if number != signal.SIGKILL and out.exists():
                assert list(out.rglob(".*")) == []
        except AssertionError as error:
            raise AssertionError(
                f"{verb}, {signal.Signals(number).name} after {instant:.3f} s, group {group}, try {i}: {error}"
            ) from error


@pytest.mark.parametrize(
    ("number", "group"),
    [
        (signal.SIGINT, True),
        (signal.SIGTERM, False),
        (signal.SIGTERM, True),
        (signal.SIGHUP, False),
        pytest.param(signal.SIGINT, False, marks=pytest.mark.thorough),
        pytest.param(signal.SIGHUP, True, marks=pytest.mark.thorough),
    ],
)
def test_a_signal_ends_a_run_with_its_status_and_one_line(
    campaign: Path, tmp_path: Path, number: signal.Signals, group: bool
) -> None:
    """Sent to the run alone, and to all of its processes as a terminal does."""
    started = Started(tmp_path, arguments("fit", campaign, tmp_path, tmp_path / "out"))
    while started.process.poll() is None and not (tmp_path / "out").exists():
        time.sleep(0.001)
    started.send_after(0.05, number, group=group)
    assert started.process.wait(timeout=60) == 128 + number
    started.assert_nothing_lives()
    assert started.text() == "interrupted; the same command with --resume goes on from here\n"


def test_workers_end_with_a_parent_that_is_killed(campaign: Path, tmp_path: Path) -> None:
    started = Started(tmp_path, arguments("fit", campaign, tmp_path, tmp_path / "out"))
    end = time.monotonic() + 60
    while (
        len(started.alive()) < 4 and time.monotonic() < end
    ):  # itself, two workers, what counts their resources
        time.sleep(0.02)
    os.kill(started.process.pid, signal.SIGKILL)
    started.process.wait(timeout=60)
    started.assert_nothing_lives()


def test_a_signal_that_was_to_be_ignored_is_ignored(campaign: Path) -> None:
    command = f"trap '' HUP; exec {sys.executable} -m sma_bayes inspect {campaign} --quiet"
    process = subprocess.Popen(["sh", "-c", command])
    time.sleep(0.3)
    process.send_signal(signal.SIGHUP)
    assert process.wait(timeout=60) == 0


LOST = """\
import os, signal, time
from sma_bayes.interruption import ending_in_order

class Lost:
    def __del__(self):  # exceptions of callbacks go nowhere
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(0.01)

with ending_in_order():
    try:
        Lost()
        time.sleep(60)
    finally:
        print("tidied up")
"""


def test_a_signal_whose_exception_gets_lost_in_a_callback_ends_the_run_in_order() -> None:
    done = subprocess.run(
        [sys.executable, "-c", LOST], capture_output=True, text=True, timeout=60, check=False
    )
    assert (done.returncode, done.stdout, done.stderr) == (
        128 + signal.SIGTERM,
        "tidied up\n",
        "interrupted\n",
    )


def test_signals_are_sent_to_every_verb(tmp_path: Path) -> None:
    """A verb that joins the registry joins the nights, too."""
    assert set(calls(tmp_path, tmp_path, tmp_path)) == set(OWN_VERBS)
    assert set(OWN_VERBS) == {p.parent.name for p in (ROOT / "sma_bayes" / "studies").glob("*/command.py")}


def test_signals_at_random_instants(campaign: Path, whole: Path, tmp_path: Path) -> None:
    try_instants(("fit", "ask", "inspect"), ASKED, 9, 1, campaign, whole, tmp_path)


def test_the_verbs_on_fits_and_cycles_end_in_order(
    campaign: Path, whole: Path, heated: Path, tmp_path: Path
) -> None:
    """One signal each; the night sends 200 of each over all verbs."""
    verbs = ("sensitivity", "simulate", "cycles", "plan", "watch", "card")
    try_instants(verbs, [signal.SIGTERM], len(verbs), 2, campaign, whole, tmp_path)


def test_a_run_goes_on_to_the_same_bits_after_each_signal(
    campaign: Path, whole: Path, tmp_path: Path, assert_same_run: Same
) -> None:
    given = arguments("fit", campaign, whole, tmp_path / "out")
    rng = np.random.default_rng(3)
    for i, number in enumerate([*ASKED, signal.SIGKILL]):
        started = Started(tmp_path, [*given, *(["--resume"] if i else [])])
        end_by(started, float(rng.uniform(1.0, 3.0)), number, group=number == signal.SIGINT)
    finish([*given, "--resume"])
    assert_same_run(whole, tmp_path / "out")
    assert list((tmp_path / "out").rglob(".*")) == []


@pytest.mark.thorough
@pytest.mark.parametrize("verb", sorted(set(OWN_VERBS) - QUICK))
def test_what_signals_end_goes_on_to_what_it_would_have_been(
    campaign: Path, whole: Path, heated: Path, tmp_path: Path, assert_same_folder: Same, verb: str
) -> None:
    """Each verb that writes for longer than a moment, after one signal of each kind."""
    never, often = tmp_path / "never", tmp_path / "often"
    if verb == "report":  # writes into the folder that it reads
        shutil.copytree(whole, never)
        shutil.copytree(whole, often)
    given, wanted = (
        arguments(verb, campaign, out if verb == "report" else whole, out) for out in (often, never)
    )
    finish(wanted)
    rng = np.random.default_rng(6)

    def resumed() -> list[str]:
        return [*given, *(["--resume"] if often.exists() and verb not in GOES_ON else [])]

    for number in (*ASKED, signal.SIGKILL):
        end_by(Started(tmp_path, resumed()), float(rng.uniform(0.5, 5.0)), number, group=False)
    finish(resumed())
    assert_same_folder(never, often)
    assert list(often.rglob(".*")) == []


@pytest.mark.thorough
@pytest.mark.parametrize("number", [*ASKED, signal.SIGKILL], ids=lambda number: number.name)
def test_two_hundred_instants_of_each_signal_over_all_verbs(
    campaign: Path, whole: Path, heated: Path, tmp_path: Path, number: signal.Signals
) -> None:
    try_instants(OWN_VERBS, [number], 200, int(number), campaign, whole, tmp_path)


@pytest.mark.thorough
@pytest.mark.parametrize("seed", range(10))
def test_chains_of_signals_go_on_to_the_same_bits(
    campaign: Path, whole: Path, tmp_path: Path, assert_same_run: Same, seed: int
) -> None:
    given = arguments("fit", campaign, whole, tmp_path / "out")
    rng = np.random.default_rng(seed)
    for i in range(5):
        number = [*ASKED, signal.SIGKILL][int(rng.integers(4))]
        started = Started(tmp_path, [*given, *(["--resume"] if i else [])])
        end_by(started, float(rng.uniform(0.0, 5.0)), number, group=bool(rng.integers(2)))
    finish([*given, "--resume"])
    assert_same_run(whole, tmp_path / "out")
