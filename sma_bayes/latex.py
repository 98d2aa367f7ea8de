"""LaTeX: plain text escaped, and long tables for the packages array, booktabs and longtable."""

from __future__ import annotations

import unicodedata
from collections.abc import Iterable, Sequence
from typing import Final

MANY: Final = 10
"""Columns up to which a table is in footnote size."""

_TEX: Final = {
    "\\": r"\textbackslash{}", "&": r"\&", "%": r"\%", "$": r"\$", "#": r"\#", "_": r"\_", "{": r"\{",
    "}": r"\}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}", "<": r"\textless{}",
    ">": r"\textgreater{}", "|": r"\textbar{}", '"': "''", "°": r"\textdegree{}", "−": "$-$",
    "×": r"$\times$", "·": r"$\cdot$", "±": r"$\pm$", "≤": r"$\leq$", "≥": r"$\geq$", "–": "--", "—": "---",
    "…": r"\ldots{}", "²": "$^2$", "³": "$^3$", "µ": r"$\mu$", "μ": r"$\mu$", "Ω": r"$\Omega$",
    "σ": r"$\sigma$", "ε": r"$\varepsilon$", "π": r"$\pi$", "ν": r"$\nu$", "\u00a0": "~", "\u202f": r"\,",
    "’": "'",
}  # fmt: skip


def tex_text(text: str) -> str:
    r"""Text as LaTeX shows it, with nothing but ASCII and Latin letters left.

    Examples
    --------
    >>> tex_text("5 % of B_1 [°C]")
    '5 \\% of B\\_1 [\\textdegree{}C]'
    """
    return "".join(_tex_character(c) for c in text)


def tex_row(cells: Iterable[str]) -> str:
    """A row of a table, of plain text."""
    return " & ".join(map(tex_text, cells)) + r" \\"


def wrapped(share: str) -> str:
    """Alignment of a column whose words are broken to a share of the line."""
    return rf">{{\raggedright\arraybackslash}}p{{{share}\linewidth}}"


def longtable(
    label: str, caption: str, heads: Sequence[str], alignment: Sequence[str], rows: Iterable[str]
) -> str:
    r"""A ``longtable`` with caption and label, in ASCII and Latin letters.

    Parameters
    ----------
    label : str
        Follows ``tab:``.
    caption, heads : str, sequence of str
        Plain text.
    alignment : sequence of str
        Of each column, in LaTeX: ``l``, ``r`` or `wrapped`.
    rows : iterable of str
        Lines of LaTeX, see `tex_row`.
    """
    size, gap = (r"\scriptsize", 2) if len(heads) > MANY else (r"\footnotesize", 3)
    header = " & ".join(rf"\textbf{{{tex_text(head)}}}" for head in heads) + r" \\"
    lines = [
        "% needs \\usepackage{array,booktabs,longtable,textcomp}; wide tables want a landscape page",
        rf"\begingroup{size}\setlength{{\tabcolsep}}{{{gap}pt}}",
        rf"\begin{{longtable}}{{{''.join(alignment)}}}",
        rf"\caption{{{tex_text(caption)}}}\label{{tab:{label}}}\\",
        *(r"\toprule", header, r"\midrule", r"\endfirsthead"),
        *(r"\toprule", header, r"\midrule", r"\endhead"),
        *(r"\bottomrule", r"\endfoot"),
        *rows,
        r"\end{longtable}",
        r"\endgroup",
    ]
    return "\n".join(lines) + "\n"


def _tex_character(c: str) -> str:
    if c in _TEX:
        return _TEX[c]
    if c in "⁻⁰¹⁴⁵⁶⁷⁸⁹":
        return f"$^{{{unicodedata.normalize('NFKC', c).replace('−', '-')}}}$"
    if ord(c) < 256 or (unicodedata.category(c)[0] == "L" and "LATIN" in unicodedata.name(c, "")):
        return c if c.isprintable() else " "
    return rf"\texttt{{U+{ord(c):04X}}}"
