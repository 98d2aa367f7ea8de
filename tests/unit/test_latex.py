"""LaTeX of tables: nothing that it can't set, and as many cells in a row as there are columns."""

from __future__ import annotations

import re

from sma_bayes.latex import longtable, tex_row, tex_text, wrapped


def test_latex_sees_no_character_that_it_can_not_set() -> None:
    nasty = r"50 % of {a_b} & c^2 # ~ $5 \ <x> σ ε °C 10⁻⁴ – “q” é"
    text = tex_text(nasty)
    assert text.startswith(
        r"50 \% of \{a\_b\} \& c\textasciicircum{}2 \# \textasciitilde{} \$5 \textbackslash{}"
    )
    assert r"$\sigma$ $\varepsilon$ \textdegree{}C 10$^{-}$$^{4}$ --" in text
    assert all(ord(c) < 256 for c in text)
    assert r"\texttt{U+201C}" in text  # not silently lost


def test_a_table_has_its_head_on_every_page_and_escapes_what_is_in_it() -> None:
    text = longtable("a-b", "50 % of", ["one_two", "why"], ["r", wrapped("0.3")], [tex_row(["1 & 2", "x_1"])])
    assert text.count(r"\textbf{one\_two} & \textbf{why} \\") == 2
    assert r"\caption{50 \% of}\label{tab:a-b}" in text
    assert r"\begin{longtable}{r>{\raggedright\arraybackslash}p{0.3\linewidth}}" in text
    row = next(line for line in text.splitlines() if line.startswith("1"))
    assert len(re.findall(r"(?<!\\)&", row)) == 1
    assert row == r"1 \& 2 & x\_1 \\"


def test_many_columns_are_set_smaller() -> None:
    sizes = [longtable("t", "", ["h"] * n, ["l"] * n, []) for n in (10, 11)]
    assert [r"\scriptsize" in text for text in sizes] == [False, True]
