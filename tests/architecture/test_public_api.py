"""The public API: every name is where the stub says, and a type checker takes a user's script and refuses nonsense."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

import sma_bayes

ROOT = Path(__file__).resolve().parents[2]

SCRIPT = """\
import numpy as np
import pandas as pd

import sma_bayes

campaign = sma_bayes.read_campaign("bench")
plain = sma_bayes.fit("file.csv")
fits = sma_bayes.fit(campaign, seed=0, noise="ar1", pool="campaign", jobs=2)
frame = pd.DataFrame({"temperature_C": [1.0], "force_N": [1.0]})
other = sma_bayes.fit(frame, columns={"force": {"name": "F", "unit": "N"}}, progress=True)
arrays = {"temperature_C": np.ones(3), "force_N": np.ones(3)}
both = sma_bayes.fit({"1A": arrays, "2A": arrays}, conditions={"2A": {"current_A": 2}})
for key, fit in fits.items():
    reveal_type(key)
    reveal_type(fit)
    reveal_type(fit.converged)
    table: pd.DataFrame = fit.stiffness(temperature=[50.0, 60.0])
    answer = fit.ask(at="60 degC", probability=0.95)
band = sma_bayes.credible_band(fits["2A-heating"], "stiffness")
reveal_type(band.unit)
found = sma_bayes.ask("results", at=["60 degC"], unit="N/mm")
same: bool = sma_bayes.diff("a", "b", tolerance=0.5)["same"]
"""
NONSENSE = {
    "an argument that is not there": "sma_bayes.fit(campaign, wrong=1)",
    "data of a wrong kind": "sma_bayes.fit(3.0)",
    "both": "sma_bayes.fit(3.0, wrong=1)",
    "a way to pool that is none": 'sma_bayes.fit(campaign, pool="all")',
    "a seed that is a text": 'sma_bayes.fit(campaign, seed="0")',
    "a name that is not there": "sma_bayes.fits(campaign)",
    "a method that is not there": 'sma_bayes.fit(campaign)["a"].stifness(50.0)',
    "a question that is none": 'sma_bayes.ask("results", stifness="1 N/m")',
    "a question to a fit that is none": 'sma_bayes.fit(campaign)["a"].ask(at="60 degC", wrong=1)',
}


def test_every_name_is_where_the_stub_says() -> None:
    for name in sma_bayes.__all__:
        assert getattr(sma_bayes, name) is not None
    assert {"fit", "read_campaign", "ask", "diff", "Fits"} <= set(dir(sma_bayes))
    with pytest.raises(AttributeError, match="no attribute 'fits'"):
        sma_bayes.fits  # noqa: B018
    assert (ROOT / "sma_bayes" / "py.typed").is_file()


def check(script: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """Run mypy over a user's script, as strictly as it can be."""
    pytest.importorskip("mypy", reason="mypy is not installed: the extra `lint` brings it")
    path = folder / "script.py"
    path.write_text(script, encoding="utf-8")
    options = [
        "--strict",
        "--no-error-summary",
        "--cache-dir",
        os.environ.get("MYPY_CACHE_DIR", str(ROOT / ".mypy_cache")),
        "--config-file",
        "",
    ]
    return subprocess.run(
        [sys.executable, "-m", "mypy", *options, str(path)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )


def test_a_users_script_is_understood(tmp_path: Path) -> None:
    found = check(SCRIPT, tmp_path)
    assert "error:" not in found.stdout, found.stdout
    revealed = [line.partition("Revealed type is ")[2].strip('"') for line in found.stdout.splitlines()]
    told = [kind.removeprefix("builtins.") for kind in revealed if kind]
    assert told == ["str", "sma_bayes.studies.fit.fitted.RecordFit", "bool", "str"]


def test_nonsense_is_refused(tmp_path: Path) -> None:
    head = 'import sma_bayes\ncampaign = sma_bayes.read_campaign("bench")\n'
    found = check(head + "\n".join(NONSENSE.values()) + "\n", tmp_path)
    refused = {int(line.split(":")[1]) for line in found.stdout.splitlines() if ": error:" in line}
    assert refused == set(range(3, 3 + len(NONSENSE))), found.stdout
