"""CONTRIBUTING and the docs site: the map of the rooms and the navigation leave nothing out."""

from __future__ import annotations

import re
from pathlib import Path

import sma_bayes

ROOT = Path(__file__).resolve().parents[2]


def test_every_room_of_the_package_is_on_the_map():
    rooms = re.findall(
        r"^\| (`.+?) \| ", (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8"), re.MULTILINE
    )
    named = set(re.findall(r"`(\w+)(?:/|\.py)`", " ".join(rooms)))
    folders = {p.parent.name for p in (ROOT / "sma_bayes").glob("*/__init__.py")}
    assert folders <= named
    assert all((ROOT / "sma_bayes" / n).is_dir() or (ROOT / "sma_bayes" / f"{n}.py").is_file() for n in named)


def test_every_page_is_in_the_navigation_once():
    nav = (ROOT / "mkdocs.yml").read_text(encoding="utf-8").partition("\nnav:")[2]
    listed = re.findall(r"([\w/]+\.md)$", nav, re.MULTILINE)
    sources = [*(ROOT / "docs").rglob("*.md"), *(ROOT / "docs").rglob("*.ipynb")]  # each notebook has a page
    pages = {p.relative_to(ROOT / "docs").with_suffix(".md").as_posix() for p in sources}
    assert sorted(listed) == sorted(pages)


def test_the_citation_has_the_version_of_the_package():
    text = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f"\nversion: {sma_bayes.__version__}\n" in text
