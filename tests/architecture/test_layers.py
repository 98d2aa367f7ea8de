"""The house as a whole: floors, doors, tables, public names."""

from __future__ import annotations

import dataclasses
import gzip
import importlib
import importlib.util
import inspect
import pkgutil
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path
from types import ModuleType

import pytest

import sma_bayes
from sma_bayes.catalogue import Catalogue

ROOT = Path(__file__).resolve().parents[2]

SUPPORTING = {
    "sma_bayes.response": {
        "arrangement",
        "both_branches",
        "joule_heating",
        "simulation",
        "base",
        "phase_lines",
    },
    "sma_bayes.effects": {"types", "needs", "transformation", "memory", "stress", "scatter"},
    "sma_bayes.noise": {"base", "heteroscedastic", "information"},
    "sma_bayes.records.formats": {"layout", "numbers", "table"},
}
"""Folders that hold one idea a file, and their few files that are no entry: what several entries share."""

HEAVY = {"matplotlib", "corner", "arviz", "pint", "pandas", "emcee", "scipy"}


def modules() -> list[str]:
    return [m.name for m in pkgutil.walk_packages(sma_bayes.__path__, "sma_bayes.")]


# --- floors -------------------------------------------------------------------------------------------


def test_imports_go_downward_only() -> None:
    if importlib.util.find_spec("importlinter") is None:
        pytest.skip("import-linter comes with the lint extra, which is not installed")
    command = [str(Path(sys.executable).with_name("lint-imports")), "--no-cache"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stdout + done.stderr


def test_every_module_stands_on_a_floor() -> None:
    declared = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"]
    floors = {name.strip() for layer in declared["contracts"][0]["layers"] for name in layer.split("|")}
    homeless = [
        m.name for m in pkgutil.iter_modules(sma_bayes.__path__, "sma_bayes.") if m.name not in floors
    ]
    assert homeless in ([], ["sma_bayes.__main__"])


def test_importing_the_package_loads_nothing_heavy() -> None:
    command = f"import sys, sma_bayes; print(*sorted({HEAVY!r} & set(sys.modules)))"
    done = subprocess.run(
        [sys.executable, "-c", command], cwd=ROOT, capture_output=True, text=True, timeout=120, check=True
    )
    assert done.stdout.split() == []


def test_help_loads_no_array() -> None:
    """Nor any of the heavy packages: what a verb needs is imported when it runs."""
    command = (
        "import sys; from typer.testing import CliRunner; from sma_bayes.cli import command_line; "
        "assert CliRunner().invoke(command_line(), ['--help']).exit_code == 0; "
        f"print(*sorted({HEAVY | {'numpy'}!r} & set(sys.modules)))"
    )
    done = subprocess.run(
        [sys.executable, "-c", command], cwd=ROOT, capture_output=True, text=True, timeout=120, check=True
    )
    assert done.stdout.split() == []


def test_a_question_to_a_finished_fit_loads_no_sampler() -> None:
    """emcee and the `scipy.stats` that it imports take a fifth of the time of an answer, and sample nothing there."""
    command = "import sys, sma_bayes.studies.ask.terminal; print(*sorted({'emcee', 'scipy.stats'} & set(sys.modules)))"
    done = subprocess.run(
        [sys.executable, "-c", command], cwd=ROOT, capture_output=True, text=True, timeout=120, check=True
    )
    assert done.stdout.split() == []


# --- tables -------------------------------------------------------------------------------------------


def origins(entry: object) -> Iterator[str]:
    """Names of the modules that an entry of a catalogue, or anything that it holds, comes from."""
    held = (
        [getattr(entry, field.name) for field in dataclasses.fields(entry)]
        if dataclasses.is_dataclass(entry) and not inspect.isclass(entry)
        else []
    )
    for thing in (entry, *held):
        if isinstance(thing, ModuleType):
            yield thing.__name__
        elif inspect.isclass(thing) or inspect.isroutine(thing):
            yield thing.__module__
        else:
            yield type(thing).__module__


@pytest.mark.parametrize("folder", SUPPORTING)
def test_every_file_of_a_folder_is_in_its_table(folder: str) -> None:
    package = importlib.import_module(folder)
    catalogues = [value for value in vars(package).values() if isinstance(value, Catalogue)]
    assert catalogues, f"{folder} has no catalogue"
    listed = {origin for c in catalogues for entry in c.values() for origin in origins(entry)}
    files = {m.name for m in pkgutil.iter_modules(package.__path__)}
    missing = {name for name in files - SUPPORTING[folder] if f"{folder}.{name}" not in listed}
    assert not missing, f"not in the table of {folder}: {sorted(missing)}"
    assert SUPPORTING[folder] <= files, "SUPPORTING names a file that is gone"


# --- names --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", modules())
def test_public_names_exist_and_are_explained(name: str) -> None:
    module = importlib.import_module(name)
    assert module.__doc__, "a module says what it holds"
    public = getattr(module, "__all__", [])
    assert len(set(public)) == len(public)
    for item in public:
        assert hasattr(module, item), f"{name}.__all__ promises {item!r}"
        value = getattr(module, item)
        if inspect.isclass(value) or inspect.isroutine(value):
            assert value.__doc__, f"{name}.{item} is public and says nothing"


def test_the_version_is_the_one_installed() -> None:
    assert sma_bayes.__version__ == version("sma-bayes")


@pytest.mark.parametrize(
    ("name", "public"),
    [
        (
            "sma_bayes.records",
            {"Branch", "Calibration", "Campaign", "Condition", "Finding", "HeldChannel", "Record"},
        ),
    ],
)
def test_names_that_others_rely_on_stay(name: str, public: set[str]) -> None:
    assert public <= set(importlib.import_module(name).__all__)


def test_no_public_class_has_the_name_of_another() -> None:
    places: dict[str, set[str]] = {}
    for name in modules():
        for item, value in vars(importlib.import_module(name)).items():
            if inspect.isclass(value) and value.__module__ == name and not item.startswith("_"):
                places.setdefault(value.__qualname__, set()).add(name)
    assert not {item: sorted(found) for item, found in places.items() if len(found) > 1}


def test_no_module_has_a_name_that_says_nothing() -> None:
    empty = {"utils", "util", "common", "helpers", "misc", "manager"}
    assert not [m for m in modules() if m.rpartition(".")[2] in empty]


# --- files --------------------------------------------------------------------------------------------


def project_files() -> list[Path]:
    """Text files of the project, without what tools leave beside them."""
    folders = [ROOT / name for name in ("sma_bayes", "tests", "scripts", "priors", "docs", ".ci")]
    below = [path for folder in folders for path in folder.rglob("*")]
    beside = [*ROOT.glob("*.md"), *ROOT.glob("*.toml"), *ROOT.glob("*.cff")]
    return [p for p in (*below, *beside) if p.is_file() and not {"__pycache__", "_build"} & set(p.parts)]


def text_of(path: Path) -> str:
    """Text of a file, unpacked if it is compressed; empty of a binary one, whose bytes may spell anything."""
    content = path.read_bytes()
    if path.suffix == ".gz":
        content = gzip.decompress(content)
    return "" if b"\0" in content else content.decode("utf-8", errors="replace")


def test_no_file_names_a_place_on_one_machine() -> None:
    place = re.compile(r"(?<![\w.~\-})])/(?:home|root|work|tmp|Users|mnt|opt|srv)/\w|\b[A-Z]:\\\w")
    assert place.search("data in " + "/".join(("", "home", "someone")))  # it does find one
    files = project_files()
    assert len(files) > 20
    named = [
        f"{path.relative_to(ROOT)}:{number}: {line.strip()}"
        for path in files
        for number, line in enumerate(text_of(path).split("\n"), 1)
        if place.search(line)
    ]
    assert not named, "\n".join(named)
