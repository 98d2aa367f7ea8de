"""Tables for a paper: conditions by parameters, which fit a page, and a document of all others as a supplement."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Final

from sma_bayes.errors import first_of, many
from sma_bayes.latex import Tex, longtable, tex_row, tex_symbol, tex_unit
from sma_bayes.report.content import INTERVAL, Content, ParameterResult, parameters_by_channel
from sma_bayes.report.notation import NORMAL_90_WIDTH, write
from sma_bayes.studies.fit.inadequate import RECORDS_NAMED

PARAMETERS_ACROSS: Final = 5
"""Parameters that a table has side by side, so that it fits the width of a page."""
POWER_OF_TEN_BELOW, POWER_OF_TEN_SD_BELOW = 0.1, 1e-4
"""Numbers that small, of which one has a standard deviation that small, are written with a power of ten in the head."""


def publication_tex(content: Content) -> str:
    """Parameters of the response in LaTeX, a row a record, a table for each channel and each set of units.

    For the packages array, booktabs, longtable and siunitx. Records that did not converge are left out, and named.
    """
    return "\n".join(_tables(content)) or "% no record converged\n"


def _tables(content: Content) -> Iterator[str]:
    number = 0
    for part in content.by_units():
        for channel, names in parameters_by_channel(part.converged).items():
            called = next((c.name for c in part.channels if c.channel == channel), channel or "the response")
            for first in range(0, len(names), PARAMETERS_ACROSS):
                number += 1
                yield _table(part, called, channel, names[first : first + PARAMETERS_ACROSS], number)


def _table(part: Content, called: str, channel: str, names: Sequence[str], number: int) -> str:
    found = [(r, {p.name: p for p in r.parameters}) for r in part.converged]
    of_name = {n: [p[n] for _, p in found if n in p] for n in names}
    units = {n: {p.unit for p in of_name[n]} for n in names}
    powers = {n: _power(of_name[n]) for n in names}
    heads = ["Condition", "Branch", *(_head(n, min(units[n]), powers[n]) for n in names)]
    rows = [
        tex_row((r.condition, r.branch, *(_cell(p.get(n), powers[n]) for n in names))) + "[3pt]"
        for r, p in found
    ]
    driven = any(p.prior_driven for n in names for p in of_name[n])
    caption = (
        f"Parameters of {called}. Posterior median; sub- and superscript lead to the ends of the {INTERVAL}."
        + (" Dagger: not identified by the data." if driven else "")
        + _beside(part, channel)
        + _left_out(part)
    )
    return longtable(f"parameters-{number}", caption, heads, ["l"] * (2 + len(names)), rows)


def _beside(part: Content, channel: str) -> str:
    """Sentence on curves beside which something stands, so that their parameters alone do not make them."""
    count = sum(channel in r.document.discrepancy for r in part.converged)
    if not count:
        return ""
    return (
        f" Beside {count} of {many(len(part.converged), 'curve')} stands a smooth discrepancy; the published curve "
        "nearest to both together is in the table of nearest published parameters."
    )


def _left_out(part: Content) -> str:
    """Sentence on records without a row."""
    names = [f"{r.condition} {r.branch}" for r in part.unconverged]
    return f" Left out, as not converged: {first_of(names, RECORDS_NAMED)}." if names else ""


def _power(parameters: Sequence[ParameterResult]) -> int:
    """Power of ten that all numbers of a column share; of small ones one of a thousand, as zeros take the room."""
    told = [p.estimate for p in parameters if p.estimate.median is not None]
    largest = max((abs(e.median) for e in told if e.median is not None), default=0.0)
    widths = [e.q95 - e.q05 for e in told if e.q05 is not None and e.q95 is not None]
    if (
        0.0 < largest < POWER_OF_TEN_BELOW
        and 0.0 < min(widths, default=0.0) < POWER_OF_TEN_SD_BELOW * NORMAL_90_WIDTH
    ):
        return 3 * math.floor(math.log10(largest) / 3.0)
    return write([largest]).exponent


def _head(name: str, unit: str, power: int) -> Tex:
    label = " ".join(part for part in (f"$10^{{{power}}}$" if power else "", tex_unit(unit)) if part)
    name = tex_symbol(name)
    return Tex(rf"\shortstack[l]{{{name}\\{{}}\mdseries[{label}]}}") if label else name


def _cell(p: ParameterResult | None, power: int) -> Tex:
    if p is None:
        return Tex("--")
    if p.fixed:
        return Tex(f"${write([p.mean], exponent=power).digits[0]}$ (fixed)")
    middle, low, high = p.estimate.median, p.estimate.q05, p.estimate.q95
    if middle is None or low is None or high is None:
        return Tex("--")
    digits = write(
        [middle, high - middle, middle - low], (high - low) / NORMAL_90_WIDTH, exponent=power
    ).digits
    median, up, down = digits
    mark = r"\,$^\dagger$" if p.prior_driven else ""
    return Tex(f"${median}_{{-{down}}}^{{+{up}}}${mark}")


def supplement_tex(names: Sequence[str]) -> str:
    """Document in LaTeX with tables of a folder, one after the other, on landscape pages.

    Parameters
    ----------
    names : sequence of str
        Of their files, without ending.
    """
    lines = [
        "% pdflatex supplement.tex, twice",
        r"\documentclass[a4paper]{article}",
        r"\usepackage[landscape,margin=15mm]{geometry}",
        r"\usepackage{array,booktabs,longtable,siunitx,textcomp}",
        r"\begin{document}",
        *(rf"\input{{{name}}}" for name in names),
        r"\end{document}",
    ]
    return "\n".join(lines) + "\n"
