"""Nothing reads what a parameter is from the letters of its name: its role and channel say it."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

import sma_bayes

PACKAGE = Path(sma_bayes.__file__).parent
OWN = {"response/modified_sigmoid.py", "response/tied_sigmoid.py", "response/phase_lines.py"}
"""Files that may spell out A1 to B4: the models that have them."""
OWN_ROOMS = ("paper", "studies/paper")
PUBLISHED = re.compile(r"[AB][1-4]")
FILES = [
    p
    for p in sorted(PACKAGE.rglob("*.py"))
    if not p.relative_to(PACKAGE).as_posix().startswith(tuple(f"{room}/" for room in OWN_ROOMS))
    and p.relative_to(PACKAGE).as_posix() not in OWN
]
NAMES = {"name", "n", "parameter", "parameter_name"}


def read_by_letters(source: str) -> list[str]:
    """What in a source reads a parameter's name by its letters, with the line."""
    found = []
    for node in ast.walk(ast.parse(source)):
        line = getattr(node, "lineno", 0)
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and PUBLISHED.fullmatch(node.value):
            found.append(f"{line}: names {node.value}")
        if isinstance(node, ast.JoinedStr) and len(node.values) == 2:
            first, second = node.values
            spelled = isinstance(first, ast.FormattedValue) and getattr(second, "value", None) in (*"1234",)
            numbered = getattr(first, "value", None) in (*"AB",) and isinstance(second, ast.FormattedValue)
            if spelled or numbered:
                found.append(f"{line}: puts a name together from a letter and a number")
        if isinstance(node, ast.Subscript) and getattr(node.value, "id", "") in NAMES:
            cut = node.slice
            ends = [cut.lower, cut.upper] if isinstance(cut, ast.Slice) else [cut]
            letters = all(isinstance(getattr(end, "value", None), int) for end in ends)
            found += [f"{line}: takes a letter of a name"] * letters
        if isinstance(node, ast.Call) and getattr(node.func, "attr", "") in ("startswith", "endswith"):
            for wanted in node.args:
                letter = isinstance(wanted, ast.Constant) and wanted.value in ("A", "B", *"1234")
                if letter or getattr(wanted, "id", "") == "letter":
                    found.append(f"{line}: looks at the first or last letter")
    return found


@pytest.mark.parametrize("path", FILES, ids=lambda p: p.relative_to(PACKAGE).as_posix())
def test_no_name_is_read_by_its_letters(path: Path) -> None:
    assert not read_by_letters(path.read_text(encoding="utf-8"))


@pytest.mark.parametrize(
    "source",
    [
        'at["A1"]',
        'f"{letter}3"',
        'f"A{i}"',
        "name[0]",
        "n[1:2]",
        'name.startswith("B")',
        "name.startswith(letter)",
    ],
)
def test_the_search_finds_what_it_looks_for(source: str) -> None:
    assert read_by_letters(source)
