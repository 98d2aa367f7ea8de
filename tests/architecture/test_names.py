"""No name stands for two things: classes, and files of a generic name outside the folders that make them plain."""

from __future__ import annotations

import ast
from collections import defaultdict
from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[2] / "sma_bayes"
OF_A_VERB = {"study"}
"""Generic names that are plain in the folder of a verb."""
OF_A_ROOM = {"types"}
"""Generic names that are plain directly in a room, where third parties import them from."""
NOWHERE = {"utils", "util", "common", "helpers", "misc", "manager", "core", "data"}


def test_no_class_name_stands_for_two_classes() -> None:
    places = defaultdict(list)
    for path in sorted(PACKAGE.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ClassDef):
                places[node.name].append(f"{path.relative_to(PACKAGE)}:{node.lineno}")
    assert {name: found for name, found in places.items() if len(found) > 1} == {}


def test_generic_files_stand_where_their_folder_makes_them_plain() -> None:
    files = defaultdict(list)
    for path in sorted(PACKAGE.rglob("*.py")):
        files[path.stem].append(path.relative_to(PACKAGE))
    assert not NOWHERE & set(files)
    for name in OF_A_VERB:
        assert all(p.parts[0] == "studies" and len(p.parts) == 3 for p in files[name]), files[name]
    for name in OF_A_ROOM:
        assert all(len(p.parts) == 2 for p in files[name]), files[name]
    assert len(files["coordinates"]) == 1
