"""The typeface of the figures: matplotlib's own, made light enough to be embedded in many files.

Journals want TrueType fonts in PDF files, and for each file matplotlib cuts them down to the letters in use. Nearly
all of that time goes into tables for the layout of scripts that figures don't have, so these are left out once
for all files. The light one is kept where matplotlib keeps its list of fonts.
"""

from __future__ import annotations

import os
from functools import cache
from pathlib import Path
from tempfile import mkstemp
from typing import Final, Literal

import matplotlib as mpl
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
FORM: Final = 1
"""Raised when what is left out changes."""


@cache
def families() -> tuple[str, str]:
    """Names of the light typeface and of its base, made known to matplotlib on the first call of a process."""
    folder = Path(mpl.get_cachedir())
    for weight, style in FACES:
        light = folder / f"sma-bayes-{FORM}-{mpl.__version__}-{weight}-{style}.ttf"
        if not light.is_file():
            _make(Path(findfont(FontProperties(family=BASE, weight=weight, style=style))), light)
        fontManager.addfont(light)
    return LIGHT, BASE


def _make(base: Path, light: Path) -> None:
    """Write a face without what figures don't need; whole at once, as other processes may be doing the same."""
    from fontTools import subset
    from fontTools.ttLib import TTFont

    options = subset.Options(
        layout_features=[], name_IDs=["*"], glyph_names=True, notdef_outline=True, hinting=True
    )
    font = TTFont(base, recalcTimestamp=False)  # else no two runs would write the same bytes
    for table in ("GSUB", "GPOS", "GDEF", "kern", "FFTM"):
        if table in font:
            del font[table]
    cutter = subset.Subsetter(options)
    cutter.populate(unicodes=LETTERS)
    cutter.subset(font)
    for record in font["name"].names:
        text = record.toUnicode()
        record.string = text.replace(BASE, LIGHT).replace(BASE.replace(" ", ""), LIGHT.replace(" ", ""))
    handle, name = mkstemp(dir=light.parent, suffix=".ttf")
    os.close(handle)
    font.save(name)
    Path(name).replace(light)
