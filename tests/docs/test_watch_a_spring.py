"""The guide to watching: its commands and its Python run on the fit that it speaks of."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import numpy as np

import sma_bayes

ROOT = Path(__file__).resolve().parents[2]
GUIDE = ROOT / "docs" / "howto" / "watch_a_spring.md"


def test_commands_and_python_say_what_they_promise(
    tmp_path: Path,
    watched_spring: ModuleType,
    command: Callable[..., str],
    python: Callable[[Path, str], str],
) -> None:
    rng, rig = np.random.default_rng(4), watched_spring.PLAIN
    campaign = sma_bayes.read_campaign(rig.campaign(tmp_path / "bench", rng, 4))
    sma_bayes.fit_campaign(campaign, tmp_path / "results", jobs=1, figures="none", noise="independent")
    for n in range(1, 5):
        watched_spring.write(tmp_path / "new" / f"{n}.csv", [rig.cycle(rng)])
    blocks = re.findall(r"^```(\w+)\n(.*?)^```", GUIDE.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)
    commands = [text for kind, text in blocks if kind == "console"]
    assert len(commands) == 2
    for text in commands:
        command(tmp_path, text)
    found = json.loads((tmp_path / "watch" / "watch.json").read_text(encoding="utf-8"))
    assert [c["file"] for c in found["cycles"]] == ["1.csv", "2.csv", "3.csv", "4.csv"]
    assert (tmp_path / "watch" / "report.html").is_file()
    (script,) = (text for kind, text in blocks if kind == "python")
    assert python(tmp_path, script).splitlines() == ["same 4", found["statement"]]
