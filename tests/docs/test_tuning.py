"""The table of what tunes the sampler is that of the modules."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import pytest

SCRIPT = Path(__file__).resolve().parents[2] / "scripts" / "tuning_page.py"


@pytest.fixture(scope="module")
def script() -> ModuleType:
    spec = importlib.util.spec_from_file_location("tuning_page", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def test_the_page_states_the_constants_as_they_are(script: ModuleType) -> None:
    """Write it anew: scripts/tuning_page.py --write."""
    assert script.PAGE.read_text(encoding="utf-8") == script.page()


def test_values_stand_beside_their_names_with_the_text_below_them(script: ModuleType, tmp_path: Path) -> None:
    module = tmp_path / "m.py"
    module.write_text('A, B = 1, (2, 3)\n"""Both\nof them."""\nC: int = 4\nD = 5\n"""Two."""\nsmall = 6\n')
    found = [(c.name, c.value, c.meaning) for c in script.constants(module)]
    assert found == [("A, B", "1, (2, 3)", "Both of them."), ("C, D", "4, 5", "Two.")]


def test_a_constant_that_nothing_explains_is_refused(script: ModuleType, tmp_path: Path) -> None:
    module = tmp_path / "m.py"
    module.write_text("A = 1\nsmall = 2\n")
    with pytest.raises(ValueError, match="no text below A"):
        list(script.constants(module))
