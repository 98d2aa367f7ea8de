"""LaTeX: plain text escaped, units, and long tables for the packages array, booktabs, longtable and siunitx."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable, Sequence
from typing import Final

MANY: Final = 10
"""Columns up to which a table is in footnote size."""
LINE_PT: Final = 757.0
"""Line of a landscape page of A4 with margins of 15 mm, for which wide tables are laid out."""

_TEX: Final = {
    "\\": r"\textbackslash{}", "&": r"\&", "%": r"\%", "$": r"\$", "#": r"\#", "_": r"\_", "{": r"\{",
    "}": r"\}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}", "<": r"\textless{}",
    ">": r"\textgreater{}", "|": r"\textbar{}", '"': "''", "°": r"\textdegree{}", "−": "$-$",
    "×": r"$\times$", "·": r"$\cdot$", "±": r"$\pm$", "≤": r"$\leq$", "≥": r"$\geq$", "–": "--", "—": "---",
    "…": r"\ldots{}", "²": "$^2$", "³": "$^3$", "µ": r"$\mu$", "μ": r"$\mu$", "Ω": r"$\Omega$",
    "σ": r"$\sigma$", "ε": r"$\varepsilon$", "π": r"$\pi$", "ν": r"$\nu$", "\u00a0": "~", "\u202f": r"\,",
    "’": "'",
}  # fmt: skip

_STATISTICS: Final = {"R²": "$R^2$", "adjusted R²": "adjusted $R^2$", "R-hat": r"$\hat{R}$", "r": "$r$"}
_UNITS: Final = {
    "N": r"\newton", "m": r"\metre", "Pa": r"\pascal", "degC": r"\degreeCelsius", "s": r"\second", "A": r"\ampere",
    "Hz": r"\hertz", "K": r"\kelvin", "kelvin": r"\kelvin", "percent": r"\percent", "ohm": r"\ohm", "V": r"\volt",
}  # fmt: skip
_PREFIXES: Final = {
    "n": r"\nano", "u": r"\micro", "µ": r"\micro", "m": r"\milli", "c": r"\centi", "k": r"\kilo", "M": r"\mega",
    "G": r"\giga",
}  # fmt: skip


class Tex(str):
    """LaTeX as it stands, where other text is escaped."""

    __slots__ = ()


def tex_text(text: str) -> str:
    r"""Text as LaTeX shows it, with nothing but ASCII and Latin letters left.

    Examples
    --------
    >>> tex_text("5 % of B_1 [°C]")
    '5 \\% of B\\_1 [\\textdegree{}C]'
    >>> tex_text("--noise auto")  # two hyphens would become a dash
    '-{}-noise auto'
    """
    if isinstance(text, Tex):
        return text
    return "-{}-".join("".join(_tex_character(c) for c in part) for part in text.split("--"))


def tex_symbol(name: str) -> Tex:
    r"""Name of a parameter or statistic as it is set in print.

    Examples
    --------
    >>> tex_symbol("A1"), tex_symbol("force_sd"), tex_symbol("R-hat")
    ('$A_{1}$', 'force\\_sd', '$\\hat{R}$')
    """
    if name in _STATISTICS:
        return Tex(_STATISTICS[name])
    letter = re.fullmatch(r"([A-Z])(\d)", name)
    return Tex(f"${letter[1]}_{{{letter[2]}}}$" if letter else tex_text(name))


def tex_unit(unit: str) -> Tex:
    r"""Unit for the package siunitx; as text where it has a part that siunitx does not know, empty for a pure number.

    Examples
    --------
    >>> tex_unit("mN/mm"), tex_unit("1/degC"), tex_unit("1")
    ('\\unit{\\milli\\newton\\per\\milli\\metre}', '\\unit{\\per\\degreeCelsius}', '')
    """
    parts = []
    for number, factor in enumerate(unit.split("/")):
        words = [w for w in factor.split(" ") if w not in ("1", "")]
        macros = [_unit_macro(w) for w in words]
        if None in macros:
            return Tex(tex_text(unit))
        parts += [(r"\per" if number else "") + str(m) for m in macros]
    return Tex(rf"\unit{{{''.join(parts)}}}" if parts else "")


def _unit_macro(name: str) -> str | None:
    if name in _UNITS:
        return _UNITS[name]
    prefix = _PREFIXES.get(name[:1])
    return prefix + _UNITS[name[1:]] if prefix and name[1:] in _UNITS else None


def tex_row(cells: Iterable[str]) -> str:
    """A row of a table, of plain text."""
    return " & ".join(map(tex_text, cells)) + r" \\"


def wrapped(share: str) -> str:
    """Alignment of a column whose words are broken to a share of the line."""
    return rf">{{\raggedright\arraybackslash}}p{{{share}\linewidth}}"


def _layout(columns: int) -> tuple[str, float, float]:
    """Size of type of a table, half the gap between its columns, and the mean width of a character [pt]."""
    return (r"\scriptsize", 2.0, 4.1) if columns > MANY else (r"\footnotesize", 3.0, 4.7)


def share_of_line(characters: int, columns: int) -> float:
    """Share of a line of `LINE_PT` that so many characters in a row of a table take, gaps of its columns included.

    Examples
    --------
    >>> round(share_of_line(80, 10), 3)
    0.576
    """
    _, gap, character = _layout(columns)
    return (characters * character + 2.0 * gap * columns) / LINE_PT


def longtable(
    label: str, caption: str, heads: Sequence[str], alignment: Sequence[str], rows: Iterable[str]
) -> str:
    r"""A ``longtable`` with caption and label, in ASCII and Latin letters.

    Parameters
    ----------
    label : str
        Follows ``tab:``.
    caption, heads : str, sequence of str
        Plain text, or `Tex`.
    alignment : sequence of str
        Of each column, in LaTeX: ``l``, ``r`` or `wrapped`.
    rows : iterable of str
        Lines of LaTeX, see `tex_row`.
    """
    size, gap, _ = _layout(len(heads))
    header = " & ".join(rf"\textbf{{{tex_text(head)}}}" for head in heads) + r" \\"
    lines = [
        "% needs \\usepackage{array,booktabs,longtable,siunitx,textcomp}; wide tables want a landscape page",
        rf"\begingroup{size}\setlength{{\tabcolsep}}{{{gap:g}pt}}",
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
