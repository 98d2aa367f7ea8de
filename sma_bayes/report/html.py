"""Pages of a report, each one HTML file that needs nothing else: style, pictures and script inside, no network."""

from __future__ import annotations

import base64
import hashlib
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import chain
from pathlib import Path
from typing import Any, Final

from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape

from sma_bayes.errors import OutputError
from sma_bayes.report.content import (
    INTERVAL,
    Estimate,
    Number,
    RecordContent,
)
from sma_bayes.report.figures.sheet import FigureFiles
from sma_bayes.report.notation import (
    count_text,
    interval_text,
    sentence,
    unit_label,
    with_minus,
    with_percent,
    write,
)
from sma_bayes.report.tables import (
    UNIT_OF_ROW,
    Cell,
    Column,
    Table,
    cell_text,
    group_text,
    powers,
    rows_text,
    without_empty,
    without_same,
)
from sma_bayes.runs.fit_document import TARGET
from sma_bayes.runs.store import write_text

_BEFORE_UNIT: Final = re.compile(r"(?<=\d) (?=[°A-Za-z%]\S*$)")
"""The blank between a number and the unit that ends a cell."""
OWN_PAGE_HEIGHT: Final = 600
"""Height above which a figure is printed on a page of its own [pixel]."""


@dataclass(frozen=True, slots=True)
class Picture:
    """A figure with its pixels inside.

    Attributes
    ----------
    stem, caption, alt : str
    source : str
        Data URL of the PNG.
    width, height : int
        [pixel].
    """

    stem: str
    caption: str
    alt: str
    source: str
    width: int
    height: int

    @property
    def tall(self) -> bool:
        """Whether two of them on a printed page would be too small to be read."""
        return self.height > OWN_PAGE_HEIGHT


def write_page(folder: Path, package: str, figures: Mapping[str, FigureFiles], **words: Any) -> None:
    """Write ``report.html``.

    Parameters
    ----------
    folder : Path
        Output folder; the PNG files are in its ``figures/``.
    package : str
        That has the template, ``page.html.j2``.
    figures : mapping of str to FigureFiles
        By stem; the template gets them as ``pictures``.
    **words
        What else the template names, besides what it finds in every page: see `page_environment`.

    Raises
    ------
    OutputError
        If it can't be written, or a figure can't be read.
    """
    write_text(folder / "report.html", rendered(package, pictures=embedded(folder, figures), **words))


def rendered(package: str, template: str = "page.html.j2", *, most: int | None = None, **words: Any) -> str:
    """A page as text, from a template of a package; its tables and lists are cut after `most` entries."""
    return with_policy(page_environment(package, most).get_template(template).render(**words))


def with_policy(page: str) -> str:
    """Page that tells the browser to load nothing, and to run no script and take no style but those that stand in it.

    Whatever a name in the data holds, it could do nothing, should it ever get past the escaping.
    """

    def sources(tag: str) -> str:
        inside = re.findall(rf"<{tag}>(.*?)</{tag}>", page, flags=re.DOTALL)
        digests = (hashlib.sha256(text.encode()).digest() for text in dict.fromkeys(inside))
        return " ".join(f"'sha256-{base64.b64encode(d).decode()}'" for d in digests) or "'none'"

    policy = (
        f"default-src 'none'; img-src data:; style-src {sources('style')}; script-src {sources('script')}; "
        "base-uri 'none'; form-action 'none'"
    )
    charset = '<meta charset="utf-8">'
    return page.replace(
        charset, f'{charset}\n<meta http-equiv="Content-Security-Policy" content="{policy}">', 1
    )


@cache  # a template is compiled once, not for each of thousands of pages
def page_environment(package: str, most: int | None = None) -> Environment:
    """Templates of a package and of the kit, with what they call; tables and lists are cut after `most` entries."""
    kit = PackageLoader("sma_bayes.report", "templates")
    environment = Environment(
        loader=ChoiceLoader([PackageLoader(package, ""), kit]),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        finalize=_shown,
    )
    environment.filters |= {
        "cell": _cell_text,
        "header": _header_text,
        "count": count_text,
        "unit": unit_label,
        "estimate": estimate_text,
        "number": _number,
        "rows": rows_text,
        "commands": _commands,
        "sentence": sentence,
        "joined": lambda parts: list(chain.from_iterable(parts)),
        "plain": lambda value, digits=4: write([value], digits=digits).plain[0],
    }
    environment.globals |= {
        "style": Markup(kit.get_source(environment, "report.css")[0]),  # ours, not the user's
        "explorer_script": Markup(kit.get_source(environment, "explorer.js")[0]),
        "anchor": anchor,
        "select": select,
        "without_empty": without_empty,
        "without_same": without_same,
        "interval": INTERVAL,
        "target": TARGET,
        "group_text": group_text,
        "powers": powers,
        "is_numeric": _is_numeric,
        "is_interval": lambda cell: isinstance(cell, Estimate),
        "few": lambda entries: entries[:most],
        "worst_first": worst_first if most else lambda table: table,
        "with_any": _with_any,
    }
    return environment


def embedded(folder: Path, figures: Mapping[str, FigureFiles]) -> dict[str, Picture]:
    """Figures of a folder with their pixels, from their PNG files, by stem.

    Raises
    ------
    OutputError
        If one can't be read.
    """
    return {stem: _embedded(folder / "figures" / f"{stem}.png", f) for stem, f in figures.items()}


def _embedded(path: Path, figure: FigureFiles) -> Picture:
    try:
        data = path.read_bytes()
    except OSError as error:
        raise OutputError(
            f"can't be read: {error.strerror}", file=path, expected="a figure made a moment ago", remedy="try again"
        ) from None  # fmt: skip
    width, height = (int.from_bytes(data[at : at + 4], "big") for at in (16, 20))  # the header of a PNG
    source = "data:image/png;base64," + base64.b64encode(data).decode("ascii")
    return Picture(figure.stem, figure.caption, figure.alt, source, width, height)


def estimate_text(e: Estimate) -> str:
    """Median and interval with their unit."""
    text = interval_text(e.median, e.q05, e.q95)
    return f"{text} {unit_label(e.unit)}".rstrip()


def _shown(value: Any) -> Any:
    """A value as a page says it: texts of the study with minus signs and ``5 %`` for 5%; markup stays as it is."""
    return with_percent(with_minus(value), "\u00a0") if type(value) is str else value


def _number(n: Number) -> str:
    return f"{write([n.value], n.resolution).plain[0]} {unit_label(n.unit)}".rstrip()


def _with_any(records: Sequence[RecordContent], what: str, **facts: Any) -> list[RecordContent]:
    """Records of which some parameter has a property, and these facts."""
    return [
        r
        for r in records
        if any(getattr(p, what) and all(getattr(p, k) == v for k, v in facts.items()) for p in r.parameters)
    ]


def _commands(text: str) -> Markup:
    """Text with what stands in backquotes set as code."""
    parts = text.split("`")
    return Markup("").join(
        Markup("<code>{}</code>").format(part) if number % 2 else escape(part)
        for number, part in enumerate(parts)
    )


def _header_text(column: Column, power: int | None = None) -> Markup:
    """Header of a column, which may be broken between words and after a plus; a unit that rows name is left out."""
    text = column.name if column.unit == UNIT_OF_ROW and not power else column.header_with(power or 0)
    whole = with_minus(text).replace("-", "\u2011").replace(" > ", "\u00a0>\u00a0")
    return Markup("+<wbr>").join(escape(part) for part in whole.split("+"))


def _cell_text(cell: Cell, power: int | None = None) -> str:
    """A cell as people read it; an estimate may be broken before its interval, not within, a number not from its unit.

    Examples
    --------
    >>> _cell_text("2 K/min") == "2\u00a0K/min"
    True
    """
    text = cell_text(cell, power)
    if not isinstance(cell, Estimate):
        return _BEFORE_UNIT.sub("\u00a0", text)
    median, bracket, interval = text.partition(" [")
    return median.replace(" ", "\u00a0") + bracket + interval.replace(" ", "\u00a0")


def _is_numeric(cell: Cell) -> bool:
    return isinstance(cell, Number | Estimate) or (isinstance(cell, int) and not isinstance(cell, bool))


def anchor(text: str) -> str:
    """Text as the target of a link.

    Examples
    --------
    >>> anchor("2A 10 mHz-heating")
    '2A-10-mHz-heating'
    """
    return re.sub(r"[^\w.-]+", "-", text)


def select(table: Table, *, drop: tuple[str, ...] = (), **wanted: Any) -> Table:
    """Rows of a table with given cells, without some columns.

    Parameters
    ----------
    table : Table
    drop : tuple of str
        Keys of columns to leave out.
    **wanted
        Column key to the cell that a row must have.
    """
    keys = [c.key for c in table.columns]
    rows = [row for row in table.rows if all(row[keys.index(k)] == v for k, v in wanted.items())]
    keep = [i for i, key in enumerate(keys) if key not in drop]
    return Table(
        table.name,
        table.title,
        table.note,
        tuple(table.columns[i] for i in keep),
        tuple(tuple(row[i] for i in keep) for row in rows),
        sum(i < table.grouped for i in keep),
    )


def worst_first(table: Table) -> Table:
    """Rows of the table of diagnostics with the greatest R-hat first."""
    at = [c.key for c in table.columns].index("rhat")

    def rhat(row: tuple[Cell, ...]) -> float:
        cell = row[at]
        return cell.value if isinstance(cell, Number) and cell.value is not None else math.inf

    return replace(table, rows=tuple(sorted(table.rows, key=rhat, reverse=True)))
