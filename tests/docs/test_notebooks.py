"""The notebooks: every cell runs, as printed and in order, and what their text says of the outcome holds."""

from __future__ import annotations

import ast
import contextlib
import importlib.util
import io
import json
import os
import re
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib import pyplot

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "docs" / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))
LINK = re.compile(r"\]\(([^)\s]+)\)")
notebooks = pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)


def cells(path: Path, kind: str) -> list[str]:
    """Sources of the cells of a kind, in order."""
    document = json.loads(path.read_text(encoding="utf-8"))
    return ["".join(cell["source"]) for cell in document["cells"] if cell["cell_type"] == kind]


def run(source: str, namespace: dict[str, Any], name: str) -> None:
    """Run a cell, and look at its last expression as a notebook would."""
    body = ast.parse(source, name).body
    last = body.pop() if isinstance(body[-1], ast.Expr) else None
    exec(compile(ast.Module(body, []), name, "exec"), namespace)
    if isinstance(last, ast.Expr):
        value = eval(compile(ast.Expression(last.value), name, "eval"), namespace)
        repr(value)
        getattr(value, "_repr_html_", str)()


@pytest.fixture
def outcome(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[str], dict[str, Any]]]:
    """Run a notebook in an empty folder; what its names stand for then, and as `printed` what it printed."""
    beside = Path(sys.executable).parent  # `sma-bayes` of the environment that runs the tests
    monkeypatch.setenv("PATH", f"{beside}{os.pathsep}{os.environ['PATH']}")
    monkeypatch.setenv("COLUMNS", "160")
    monkeypatch.chdir(tmp_path)
    mpl.use("agg")

    def run_all(name: str) -> dict[str, Any]:
        namespace: dict[str, Any] = {"__name__": "__main__"}
        with contextlib.redirect_stdout(io.StringIO()) as printed:
            for number, source in enumerate(cells(FOLDER / f"{name}.ipynb", "code"), start=1):
                run(source, namespace, f"<{name}, code cell {number}>")
        return namespace | {"printed": printed.getvalue()}

    with mpl.rc_context():
        yield run_all
    pyplot.close("all")


@notebooks
def test_it_is_a_notebook_without_outputs(path: Path) -> None:
    document = json.loads(path.read_text(encoding="utf-8"))
    assert (document["nbformat"], document["nbformat_minor"]) == (4, 5)
    assert document["metadata"]["kernelspec"]["name"] == "python3"
    ids = [cell["id"] for cell in document["cells"]]
    assert len(set(ids)) == len(ids)
    for cell in document["cells"]:
        assert cell["cell_type"] in ("code", "markdown")
        if cell["cell_type"] == "code":
            assert cell["outputs"] == []
            assert cell["execution_count"] is None


@notebooks
def test_it_begins_with_its_title_and_its_links_lead_somewhere(path: Path) -> None:
    texts = cells(path, "markdown")
    assert texts[0].startswith("# ")
    for target in LINK.findall("\n".join(texts)):
        assert target.startswith("https://") or (FOLDER / target.partition("#")[0]).exists(), target


@notebooks
def test_it_is_linked_from_the_documentation(path: Path) -> None:
    for page in (FOLDER / "README.md", FOLDER.parent / "index.md"):
        assert f"{path.name})" in page.read_text(encoding="utf-8"), page


@notebooks
def test_it_has_a_page_of_the_site(path: Path) -> None:
    spec = importlib.util.spec_from_file_location("notebook_pages", ROOT / "scripts" / "notebook_pages.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    page = module.as_markdown(path.read_text(encoding="utf-8"), path.name)
    assert re.findall(r"^```python\n(.*?)\n```$", page, re.DOTALL | re.MULTILINE) == cells(path, "code")
    title, link = page.split("\n\n")[:2]
    assert title == cells(path, "markdown")[0].splitlines()[0]
    assert link.endswith(f"({path.name})")
    assert page.count(".ipynb)") == 1, "links lead to pages"


def test_every_notebook_has_a_test_of_its_outcome() -> None:
    assert {f"test_{path.stem}" for path in NOTEBOOKS} <= set(globals())


def test_first_fit(outcome: Callable[[str], dict[str, Any]]) -> None:
    after = outcome("first_fit")
    assert len(after["fits"]) == 6
    assert all(fit.converged and fit.adequate for fit in after["fits"].values())
    assert after["summary"].loc[("150g-heating", "B3"), "median"] == pytest.approx(59.6, abs=0.5)
    assert after["printed"].count(" degC") == 2
    stiffness = after["axes"][2]
    assert [text.get_text() for text in stiffness.get_legend().get_texts()] == [
        "150g-heating",
        "150g-cooling",
    ]
    rising, falling = after["found"]["passages"]  # surely on the way up; perhaps again, far above
    assert rising["probability"] > 0.99
    assert after["heating"].stiffness(rising["median"])["median"].item() == pytest.approx(120.0, rel=0.02)
    assert falling["probability"] < 0.6
    assert falling["low"] > 70.0
    band = after["heating"].band("stiffness")
    width = (band["q95"] - band["q05"]) / band["q50"]
    assert width.iloc[0] > 2.0 * width.min()
    assert width.iloc[-1] > 2.0 * width.min()


def test_own_data(outcome: Callable[[str], dict[str, Any]]) -> None:
    after = outcome("own_data")
    printed = after["printed"]
    assert "# columns not used: 'ch2 [V]'" in printed
    assert printed.count("# GUESS") == 2
    assert Path("results/report.html").is_file()
    found = {f.kind: f.dropped for f in after["campaign"].findings}
    assert {kind: n for kind, n in found.items() if n} == {"missing": 2, "drop-out": 1}
    for record, midpoint in zip(after["summary"]["records"], (56.0, 48.0), strict=True):
        assert record["converged"]
        b3 = record["parameters"]["B3"]
        assert b3["median"] == pytest.approx(midpoint, abs=0.2)
        half_width = 0.5 * (b3["q95"] - b3["q05"])
        assert half_width == pytest.approx(
            1.645 * 0.5, rel=0.1
        )  # 0.5 °C of the thermocouple, and little else
        fit = after["fits"][record["key"]]
        assert fit.document["parameters"]["A1"]["median"] == record["parameters"]["A1"]["median"]
    assert printed.count("the same: True") == 2


def test_paper_figures(outcome: Callable[[str], dict[str, Any]]) -> None:
    after = outcome("paper_figures")
    assert after["summary"]["converged"]
    assert after["summary"]["adequate"]
    files = {path.name for path in after["publication"].iterdir()}
    assert files == {f"loop-150g.{kind}" for kind in ("pdf", "svg", "png", "csv")}
    assert re.search(r'width="24[01]\.\d+pt"', (after["publication"] / "loop-150g.svg").read_text("utf-8"))
    assert Path("stiffness.pdf").stat().st_size > 1000
    assert r"\usepackage{array,booktabs,longtable,siunitx,textcomp}" in after["printed"]
    assert after["printed"].count("150g & heating") == 2  # of displacement and of force
    cited = set(re.findall(r"@(\w+)\]", Path("results/methods.md").read_text(encoding="utf-8")))
    assert cited == set(re.findall(r"^@\w+\{(\w+),", after["references"], re.MULTILINE))


def test_gap(outcome: Callable[[str], dict[str, Any]]) -> None:
    after = outcome("gap")
    found, nothing = after["found"], after["nothing"]
    assert found["verdict"] == "named"
    assert found["converged"]
    assert after["effect"]["class"] == ["training_drift"]
    drift = 0.6e-3 * (1.0 - np.exp(-7.0 / 3.0))  # until the eighth cycle [m]
    for name, truth in (("d", drift), ("N0", 3.0)):
        interval = after["effect"]["parameters"][name]
        assert interval["q05"] < truth < interval["q95"]
    assert {d["covariate"] for d in found["disagreement"]} <= {"time", "cycle"}
    assert found["gap"]["before"] > 3.0
    assert found["gap"]["after"] < 1.1
    assert found["gap"]["shrink"] > 0.98
    assert len(after["untestable"]) > 0
    assert nothing["verdict"] == "none"
    assert nothing["effects"] == []
    assert nothing["gap"]["before"] == pytest.approx(1.0, abs=0.05)


def test_pipeline(outcome: Callable[[str], dict[str, Any]]) -> None:
    after = outcome("pipeline")
    status = {name: after[name].returncode for name in ("done", "wrong", "resumed", "study")}
    assert status == {"done": 0, "wrong": 2, "resumed": 0, "study": 1}
    assert after["summary"]["converged"]
    assert after["summary"]["adequate"]
    assert not Path("broken").exists()
    assert "'force_N'" in after["wrong"].stderr
    assert "ReadingError | broken.csv | force_N" in after["printed"]
    assert after["same"]
    assert [step["exit_status"] for step in after["document"]["steps"]] == [1, 0, 0]
    assert "adequate: False" in after["printed"]
    (passage,) = after["found"]["passages"]
    assert passage["low"] < 55.0 < passage["high"]
