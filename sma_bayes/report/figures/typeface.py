"""The typeface of the figures: matplotlib's own, made light enough to be embedded in many files.

Journals want TrueType fonts in PDF files, and for each file matplotlib cuts them down to the letters in use. Nearly
all of that time goes into tables for the layout of scripts that figures don't have, so these are left out once
for all files.
"""

from __future__ import annotations

import atexit
import os
import shutil
from functools import cache
from io import BytesIO
from pathlib import Path
from tempfile import mkdtemp
from typing import Final, Literal

from fontTools import subset
from fontTools.ttLib import TTFont
from matplotlib.font_manager import FontProperties, findfont, fontManager

BASE: Final = "DejaVu Sans"
LIGHT: Final = "Figure Sans"
"""Name of the light one; the licence of the base asks for another name where it was changed."""

LETTERS: Final = (*range(0x20, 0x530), *range(0x1E00, 0x2300))
"""Latin, Greek, Cyrillic; punctuation, superscripts, subscripts, arrows, operators. What else a name may hold is taken
from the base."""

FACES: Final[tuple[tuple[str, Literal["normal", "italic"]], ...]] = (
    ("normal", "normal"),
    ("bold", "normal"),
    ("normal", "italic"),
)
"""Weights and styles that figures use."""


@cache
def families() -> tuple[str, str]:
    """Names of the light typeface and of its base, made known to matplotlib on the first call of a process."""
    options = subset.Options(
        layout_features=[], name_IDs=["*"], glyph_names=True, notdef_outline=True, hinting=True
    )
    for number, (weight, style) in enumerate(FACES):
        path = findfont(FontProperties(family=BASE, weight=weight, style=style))
        font = TTFont(path, recalcTimestamp=False)  # else no two runs would write the same bytes
        for table in ("GSUB", "GPOS", "GDEF", "kern", "FFTM"):
            if table in font:
                del font[table]
        cutter = subset.Subsetter(options)
        cutter.populate(unicodes=LETTERS)
        cutter.subset(font)
        for record in font["name"].names:
            text = record.toUnicode()
            record.string = text.replace(BASE, LIGHT).replace(BASE.replace(" ", ""), LIGHT.replace(" ", ""))
        content = BytesIO()
        font.save(content)
        fontManager.addfont(_file_of(content.getvalue(), f"{number}.ttf"))
    return LIGHT, BASE


def _file_of(content: bytes, name: str) -> str:
    """Path of a file that is gone when this process is: in memory where the system has such, else temporary."""
    if hasattr(os, "memfd_create"):
        descriptor = os.memfd_create(name)
        with os.fdopen(os.dup(descriptor), "wb") as file:
            file.write(content)
        return f"/proc/self/fd/{descriptor}"
    folder = Path(mkdtemp(prefix="sma-bayes-typeface-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    (folder / name).write_bytes(content)
    return str(folder / name)
