"""A stored posterior opens the same way in arviz 0.23 and in 1.x, and nothing else opens as one."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from sma_bayes.arviz_bridge import arviz, open_posterior
from sma_bayes.errors import OutputError
from sma_bayes.runs.netcdf import Variable, VariableGroup, axes, write_groups

DRAWS = np.random.default_rng(0).normal(50.0, 1.0, (4, 25))


def write(path: Path, group: str) -> Path:
    chains = axes(chain=np.arange(4), draw=np.arange(25))
    draws = VariableGroup({"B3": Variable(("chain", "draw"), DRAWS, {"unit": "degC"})}, chains)
    write_groups(path, {"/": VariableGroup(attributes={"seed": 3}), group: draws, "sample_stats": draws})
    return path


@pytest.mark.parametrize("reader", [open_posterior, lambda path: arviz().from_netcdf(path)])
def test_draws_units_and_attributes_are_found_by_the_same_names(reader, tmp_path: Path) -> None:
    found = reader(write(tmp_path / "c-heating.nc", "posterior"))
    np.testing.assert_array_equal(found["posterior"]["B3"].values, DRAWS)
    assert found["posterior"]["B3"].attrs["unit"] == "degC"
    assert found["posterior"]["B3"].dims == ("chain", "draw")
    assert found.posterior.B3.identical(found["posterior"]["B3"])
    assert "sample_stats" in found
    assert found.attrs["seed"] == 3


def test_a_file_without_draws_is_no_posterior(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match=r"c-heating.nc: .*no group 'posterior'"):
        open_posterior(write(tmp_path / "c-heating.nc", "prior"))


@pytest.mark.parametrize("content", [b"", b"temperature,force\n1,2\n", None])
def test_what_is_no_netcdf_is_refused_in_few_words(content: bytes | None, tmp_path: Path) -> None:
    path = tmp_path / "c-heating.nc"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(OutputError, match="can't be opened as a posterior") as refused:
        open_posterior(path)
    assert "install" not in str(refused.value)
    assert refused.value.__suppress_context__


def test_half_a_file_is_refused(tmp_path: Path) -> None:
    path = write(tmp_path / "c-heating.nc", "posterior")
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(OutputError, match="truncated"):
        open_posterior(path)


@pytest.mark.parametrize("cache", ["empty", "read-only"])
@pytest.mark.parametrize(
    "imports",
    [
        "from sma_bayes.arviz_bridge import arviz; arviz()",
        "from sma_bayes.studies.fit.figures.marginals import _pair",
    ],
    ids=["arviz", "corner"],
)
def test_the_first_import_of_a_day_is_silent_and_needs_no_cache(
    imports: str, cache: str, tmp_path: Path
) -> None:
    folder = tmp_path / "cache"
    if cache == "empty":
        folder.mkdir()
    else:
        folder.touch()  # no folder can be made in a file, by root either
    draw = """
import warnings
warnings.simplefilter("error")
import matplotlib
matplotlib.use("agg")
from types import SimpleNamespace
from matplotlib.figure import Figure
import numpy as np
x = np.random.default_rng(0).normal(size=(2, 500))
about = SimpleNamespace(prior_driven=False)
_pair(Figure().add_subplot(), *x, (-3, 3), (-3, 3), about, about)
"""
    ran = subprocess.run(
        [sys.executable, "-c", imports + (draw if "_pair" in imports else "")],
        env={**os.environ, "XDG_CACHE_HOME": str(folder), "MPLCONFIGDIR": str(tmp_path / "matplotlib")},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (ran.returncode, ran.stderr) == (0, "")


def test_tests_and_scripts_come_through_the_door() -> None:
    """Two test workers that import arviz 0.23 by itself on the first run of a day get in each other's way."""
    root = Path(__file__).resolve().parents[2]
    directly = re.compile(r"^\s*(?:import|from) arviz\b", re.MULTILINE)
    by_hand = {"benchmark_end_to_end.py"}  # what users write themselves
    found = {
        path.name
        for folder in ("tests", "scripts")
        for path in (root / folder).rglob("*.py")
        if directly.search(path.read_text(encoding="utf-8"))
    }
    assert found == by_hand
