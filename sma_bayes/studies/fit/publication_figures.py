"""Figures of a finished fit for a paper, at the width of its column."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import partial
from pathlib import Path

from sma_bayes.errors import SmaBayesError, require_known
from sma_bayes.quantities import convert, number_and_unit
from sma_bayes.report.choice import formats_for
from sma_bayes.report.figures.sheet import save, style_of
from sma_bayes.runs.outputs import read_run
from sma_bayes.runs.store import nothing_unfinished
from sma_bayes.studies.fit.figures.publication import LEAST, WIDEST, publication_figure
from sma_bayes.studies.fit.report import branch_data
from sma_bayes.studies.fit.report_content import report_content

FOLDER = "publication"
"""Where they are, in the folder of the figures."""


def publication_figures(
    folder: Path,
    width: str,
    *,
    conditions: Sequence[str] = (),
    formats: Iterable[str] = ("pdf", "png"),
    style: Path | None = None,
) -> list[Path]:
    """Draw the loop of each condition into ``figures/publication/``; nothing else is changed.

    Parameters
    ----------
    folder : Path
        Output folder of a finished fit.
    width : str
        Of a figure, with its unit: ``"85mm"``.
    conditions : sequence of str
        All by default.
    formats : iterable of str
        See `FORMATS`.
    style : Path, optional
        Style file of matplotlib, whose settings go before those of the package.

    Returns
    -------
    list of Path
        The files, without the data beside them.

    Raises
    ------
    SmaBayesError
        If the width is none, there is no such condition or format, or the style can't be read.
    OutputError
        If the folder holds no finished fit, or can't be written.
    """
    inches = _inches(width)
    wanted = formats_for(formats)
    own = {} if style is None else style_of(style)
    with nothing_unfinished(folder):
        content = report_content(read_run(folder))
        for name in conditions:
            require_known(name, content.conditions, f"the fit has no condition {name!r}")
        files: list[Path] = []
        for condition in conditions or content.conditions:
            branches = [branch_data(folder, r) for r in content.branches(condition)]
            target = folder / "figures" / FOLDER
            drawn = save(partial(publication_figure, condition, branches, inches), target, wanted, own)
            files += [target / f"{drawn.stem}.{kind}" for kind in wanted]
    return files


def _inches(text: str) -> float:
    number, unit = number_and_unit(text, what="--figure-width")
    if not unit:
        raise SmaBayesError(
            f"--figure-width {text!r} has no unit", expected="a width with its unit, such as '85mm'"
        )
    width = float(convert(number, unit, "mm", what="--figure-width"))
    if not LEAST <= width <= WIDEST:
        raise SmaBayesError(
            f"--figure-width {text!r}", expected=f"a width from {LEAST:g} to {WIDEST:g} mm, such as '85mm'"
        )
    return width / 25.4
