"""The sampler knows densities with stated abilities, never what they are densities of."""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
MODULES = sorted((ROOT / "sma_bayes" / "sampling").glob("*.py"))
LIBRARIES = {"numpy", "scipy", "emcee", "arviz_stats", "h5py"}
FOUNDATIONS = {"sma_bayes.arrays", "sma_bayes.disk", "sma_bayes.errors", "sma_bayes.interruption"}
DOMAIN = {"Posterior", "Record", "ResponseModel", "NoiseModel", "DiscrepancyBasis", "ParameterSpace", "Place"}


def imported(tree: ast.AST) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.module is not None
            yield node.module


def is_known(module: str) -> bool:
    """Whether the sampler may import it."""
    top = module.partition(".")[0]
    if top == "sma_bayes":
        return module.startswith("sma_bayes.sampling") or module in FOUNDATIONS
    return top in LIBRARIES or top in sys.stdlib_module_names


def test_it_imports_arrays_and_its_own_alone() -> None:
    assert len(MODULES) > 10
    found = {
        (path.name, m) for path in MODULES for m in imported(ast.parse(path.read_text(encoding="utf-8")))
    }
    assert {entry for entry in found if not is_known(entry[1])} == set()


def test_it_asks_for_abilities_not_for_classes_of_the_domain() -> None:
    """A name in a comment is no harm; one in code is."""
    named = {
        (path.name, getattr(node, "id", getattr(node, "attr", getattr(node, "value", None))))
        for path in MODULES
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Name | ast.Attribute | ast.Constant)
    }
    assert {entry for entry in named if entry[1] in DOMAIN} == set()
