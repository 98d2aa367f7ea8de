"""Promises of SECURITY.md that the interpreter itself can watch: nothing is fetched, and no file runs code.

A process with an audit hook (PEP 578), which nothing can take off again, calls verbs on good and on hostile files. The
hook notes every connection, lookup of a name, unpickled object, started program and evaluated text.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest

WATCHED = """
import json, sys
from pathlib import Path

place, calls = Path(sys.argv[1]), json.loads(sys.argv[2])
seen, at = [], None
EVENTS = {
    "socket.connect", "socket.getaddrinfo", "socket.gethostbyname", "socket.sendto", "urllib.Request",
    "http.client.connect", "ftplib.connect", "smtplib.connect", "webbrowser.open", "os.system", "os.exec",
    "os.posix_spawn", "pickle.find_class", "marshal.loads",
}
OF_IMPORTS = {"pickle.find_class", "marshal.loads"}  # modules are marshalled; dask pickles as it is imported

def hook(event, arguments):
    if at is None:
        return
    if event in EVENTS and not (event in OF_IMPORTS and importing()):
        seen.append([at, event, repr(arguments)[:80]])
    elif event == "compile" and b"fetch_me" in bytes(str(arguments[0]), "utf-8", "replace"):
        seen.append([at, event, "text of a file"])
    elif event == "open" and str(arguments[0]).endswith("pwned"):
        seen.append([at, event, str(arguments[0])])

def importing():
    frame = sys._getframe(2)
    while frame is not None:
        if frame.f_code.co_filename.startswith("<frozen importlib"):
            return True
        frame = frame.f_back
    return False

sys.addaudithook(hook)
from sma_bayes import cli

status = []
for call in calls:
    at, sys.argv = call[0], ["sma-bayes", *call]
    try:
        cli.main()
        status.append(0)
    except SystemExit as end:
        status.append(end.code or 0)
at = None
(place / "seen.json").write_text(json.dumps({"seen": seen, "status": status}))
"""


@pytest.fixture
def folder(tmp_path: Path, make_campaign: Callable[..., Path]) -> Path:
    """A good campaign."""
    return make_campaign(tmp_path / "bench")


@pytest.fixture
def watched(tmp_path: Path) -> Callable[..., tuple[list[list[str]], list[int]]]:
    """Call the command line in a process that is watched: what was seen of each verb, and the exit statuses."""

    def run(*calls: Sequence[object]) -> tuple[list[list[str]], list[int]]:
        told = json.dumps([[str(word) for word in call] for call in calls])
        done = subprocess.run(
            [sys.executable, "-c", WATCHED, str(tmp_path), told],
            cwd=tmp_path, capture_output=True, text=True, check=False,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        found = json.loads((tmp_path / "seen.json").read_text(encoding="utf-8"))
        return found["seen"], found["status"]

    return run


def test_no_verb_opens_a_connection_or_starts_a_program(
    watched: Callable[..., tuple[list[list[str]], list[int]]], folder: Path
) -> None:
    out = folder.parent / "results"
    seen, status = watched(
        ("inspect", folder),
        ("fit", folder, "--out", out, "--noise", "independent", "--jobs", 1, "--quiet"),
        ("ask", out, "--at", "50 degC"),
        ("report", out),
        ("sensitivity", out, "--out", folder.parent / "sensitivity", "--jobs", 1, "--no-figures"),
    )
    assert status == [0, 0, 0, 0, 0]
    assert seen == []


PICKLE = b"cos\nsystem\n(S'echo > pwned # fetch_me'\ntR."
"""What unpickling would do: leave a file."""
CODE = "__import__('os').system('echo > pwned # fetch_me')"


def test_no_file_runs_what_it_holds(
    watched: Callable[..., tuple[list[list[str]], list[int]]], folder: Path, tmp_path: Path
) -> None:
    calls = []
    for name in ("a.csv", "a.xlsx", "a.mat", "a.tdms", "a.lvm", "a.nc", "a.npz", "a.pkl"):
        (tmp_path / name).write_bytes(PICKLE)
        calls.append(("inspect", tmp_path / name))
    good = (folder / "campaign.toml").read_text(encoding="utf-8")
    for number, text in enumerate((
        good.replace('"degC"', f'"{CODE}"'),
        good.replace('name = "bench"', f'name = "{{{{ {CODE} }}}}"').replace('"degC"', '"K**K"'),
        good + f'source = "{CODE}"\n',
        f"# sma-bayes: {CODE}\n{CODE}\n",
    )):  # fmt: skip
        (tmp_path / f"{number}.toml").write_text(text, encoding="utf-8")
        calls.append(("inspect", tmp_path / f"{number}.toml"))
    (tmp_path / "priors.toml").write_text(f'[both.A1]\nfamily = "{CODE}"\n', encoding="utf-8")
    calls += [
        ("fit", folder, "--out", tmp_path / "o", "--priors", tmp_path / "priors.toml"),
        ("run", tmp_path / "0.toml"),
        ("ask", tmp_path, "--at", CODE),
        ("ask", tmp_path, "--stiffness", f"1 {CODE}"),
    ]
    seen, status = watched(*calls)
    assert seen == []
    assert set(status) == {2}
    assert not list(tmp_path.rglob("pwned"))


def test_the_watch_sees_what_it_looks_for(tmp_path: Path) -> None:
    """What the hook is told of: an object that is unpickled, a name that is looked up, a program."""
    script = WATCHED.replace(
        "from sma_bayes import cli",
        "import os, pickle, socket, types\n"
        "def bad():\n"
        "    pickle.loads(b'cbuiltins\\nlen\\n.')\n"
        "    try: socket.getaddrinfo('localhost', 1)\n"
        "    except OSError: pass\n"
        "    os.system('true')\n"
        "    eval('1 # fetch_me')\n"
        "cli = types.SimpleNamespace(main=bad)",
    )
    subprocess.run([sys.executable, "-c", script, str(tmp_path), '[["bad"]]'], check=True)
    found = json.loads((tmp_path / "seen.json").read_text(encoding="utf-8"))
    assert [event for _, event, _ in found["seen"]] == [
        "pickle.find_class", "socket.getaddrinfo", "os.system", "compile",
    ]  # fmt: skip
