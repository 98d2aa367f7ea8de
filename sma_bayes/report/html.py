"""The report as one HTML file that needs nothing else: style and pictures inside, no scripts, no network."""

from __future__ import annotations

import base64
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from itertools import chain
from pathlib import Path
from typing import Any, Final

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from sma_bayes.errors import OutputError
from sma_bayes.quantities import ARBITRARY
from sma_bayes.report.content import (
    CHECK_TAIL,
    INTERVAL,
    LEVEL,
    PAPER_CORRELATION,
    SHAPES,
    TARGET,
    Content,
    Estimate,
    Number,
    RecordContent,
)
from sma_bayes.report.figures import FigureFiles
from sma_bayes.report.figures.sheet import numbered
from sma_bayes.report.notation import MISSING, count_text, interval_text, unit_label, write, write_interval
from sma_bayes.report.tables import Cell, Column, Table, cell_text, group_text, report_tables, rows_text
from sma_bayes.results.store import write_text

TEMPLATE: Final = "report.html.j2"
SHOWN: Final = 20
"""Entries of a list or a table that the report of a campaign of many records shows."""


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


def write_report(
    folder: Path, content: Content, tables: Mapping[str, Table], figures: Mapping[str, FigureFiles]
) -> None:
    """Write ``report.html``.

    Parameters
    ----------
    folder : Path
        Output folder; the PNG files are in its ``figures/``.
    content : Content
    tables : mapping of str to Table
    figures : mapping of str to FigureFiles
        By stem.

    Raises
    ------
    OutputError
        If it can't be written, or a figure can't be read.
    """
    shown = {stem: f for stem, f in figures.items() if not content.paged or stem in of_campaign(content)}
    pictures = {stem: embedded(folder / "figures" / f"{stem}.png", f) for stem, f in shown.items()}
    write_text(folder / "report.html", render(content, tables, pictures))
    if content.paged:
        write_text(folder / "records" / "index.html", render_index(content))


def of_campaign(content: Content) -> set[str]:
    """Stems of the figures of the campaign itself."""
    numbers = range(1, len(content.by_units()) + 1)
    return {
        "diagnostics", "correlation", "correlation-average", "printed", *(numbered("parameters", n) for n in numbers)
    }  # fmt: skip


def write_record_page(
    folder: Path, content: Content, record: RecordContent, figures: Mapping[str, FigureFiles]
) -> None:
    """Write ``records/KEY.html``, with its figures as links to their files.

    Parameters
    ----------
    folder : Path
    content : Content
        Of one record, see `Content.only`.
    record : RecordContent
    figures : mapping of str to FigureFiles
        By stem.
    """
    pictures = {
        stem: replace(embedded(folder / "figures" / f"{stem}.png", f), source=f"../figures/{stem}.png")
        for stem, f in figures.items()
    }
    environment = page_environment()
    page = environment.get_template("record.html.j2").render(
        r=record,
        own_page=True,
        content=content,
        tables=report_tables(content),
        pictures=pictures,
        select=select,
        interval=INTERVAL,
        anchor=anchor,
        style=Markup(style_sheet(environment)),  # ours, not the user's
    )
    write_text(folder / "records" / f"{record.key}.html", page)


def render_index(content: Content) -> str:
    """The list of all records, each with a link to its page."""
    environment = page_environment()
    return environment.get_template("records.html.j2").render(
        content=content,
        channels=[c for c in content.channels if any(_agreement(r, c.channel) for r in content.records)],
        agreement=_agreement,
        style=Markup(style_sheet(environment)),  # ours, not the user's
    )


def _agreement(record: RecordContent, channel: str) -> float | None:
    found = record.channel(channel)
    return found.measured["r"].median if found is not None and "r" in found.measured else None


def render(content: Content, tables: Mapping[str, Table], pictures: Mapping[str, Picture]) -> str:
    """The report as text.

    Parameters
    ----------
    content : Content
    tables : mapping of str to Table
    pictures : mapping of str to Picture
        By stem; a picture that is missing is left out.
    """
    environment = page_environment(most=SHOWN if content.paged else None)
    return environment.get_template(TEMPLATE).render(
        content=content,
        tables=tables,
        pictures=pictures,
        style=Markup(style_sheet(environment)),  # ours, not the user's
        level=LEVEL,
        interval=INTERVAL,
        target=TARGET,
        check_tail=CHECK_TAIL,
        paper_correlation=PAPER_CORRELATION,
        shapes=SHAPES,
        select=select,
        without_empty=without_empty,
        overview=parameter_overview,
        noise_groups=noise_groups(content),
        parts=content.by_units(),
        arbitrary=any(_has_arbitrary_unit(r) for r in content.records),
        numbered=numbered,
        anchor=anchor,
    )


def _has_arbitrary_unit(record: RecordContent) -> bool:
    return any(ARBITRARY in unit for unit in (record.temperature_unit, *(c.unit for c in record.channels)))


@cache  # a template is compiled once, not for each of thousands of pages
def page_environment(most: int | None = None) -> Environment:
    """Templates with what they call; tables and lists are cut after `most` entries."""
    environment = Environment(
        loader=PackageLoader("sma_bayes.report", "templates"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters |= {
        "cell": cell_text,
        "count": count_text,
        "unit": unit_label,
        "estimate": _estimate,
        "number": _number,
        "rows": rows_text,
        "joined": lambda parts: list(chain.from_iterable(parts)),
        "plain": lambda value, digits=4: write([value], digits=digits).plain[0],
    }
    environment.globals |= {
        "group_text": group_text,
        "is_numeric": _is_numeric,
        "few": lambda entries: entries[:most],
        "worst_first": worst_first if most else lambda table: table,
        "with_any": lambda records, what: [r for r in records if any(getattr(p, what) for p in r.parameters)],
    }
    return environment


def style_sheet(environment: Environment) -> str:
    """The style of all pages."""
    loader = environment.loader
    if loader is None:
        raise OutputError("the templates of the report are not there", remedy="install sma_bayes anew")
    return loader.get_source(environment, "report.css")[0]


def embedded(path: Path, figure: FigureFiles) -> Picture:
    """A figure with its pixels, from its PNG file.

    Raises
    ------
    OutputError
        If it can't be read.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise OutputError(
            f"can't be read: {error.strerror}", file=path, expected="a figure made a moment ago", remedy="try again"
        ) from None  # fmt: skip
    width, height = (int.from_bytes(data[at : at + 4], "big") for at in (16, 20))  # the header of a PNG
    source = "data:image/png;base64," + base64.b64encode(data).decode("ascii")
    return Picture(figure.stem, figure.caption, figure.alt, source, width, height)


def _estimate(e: Estimate) -> str:
    text = interval_text(write_interval(e.median, e.q05, e.q95))
    return f"{text} {unit_label(e.unit)}".rstrip()


def _number(n: Number) -> str:
    return f"{write([n.value], n.resolution).plain[0]} {unit_label(n.unit)}".rstrip()


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


def parameter_overview(content: Content) -> tuple[Table, ...]:
    """Median and interval of the response's parameters of the converged records, a table for A and one for B."""
    out = []
    for letter, what in (("A", "displacement"), ("B", "force")):
        names = sorted(
            {p.name for r in content.converged for p in r.model_parameters if p.name.startswith(letter)}
        )
        if names:
            name = next((c.name for c in content.channels if c.channel == what), what)
            out.append(_overview(content.converged, names, f"Parameters of {name}"))
    return tuple(out)


def _overview(records: tuple[RecordContent, ...], names: list[str], title: str) -> Table:
    units = {n: [p.unit for r in records for p in r.parameters if p.name == n] for n in names}
    same = {n: len(set(u)) == 1 for n, u in units.items()}
    columns = (
        Column("condition", "condition"),
        Column("branch", "branch"),
        *(Column(n, n, units[n][0] if same[n] else "") for n in names),
    )
    rows = []
    for r in records:
        found = {p.name: p for p in r.parameters}
        cells: list[Cell] = []
        for n in names:
            p = found.get(n)
            if p is None:
                cells.append(None)
            elif p.fixed:
                cells.append(f"{write([p.mean]).plain[0]}, fixed")
            else:
                mark = "" if p.identified else " (not identified)"
                text = (
                    _estimate(p.estimate)
                    if not same[n]
                    else _estimate(Estimate(p.estimate.median, p.estimate.q05, p.estimate.q95))
                )
                cells.append(text + mark)
        rows.append((r.condition, r.branch, *cells))
    note = f"Median and {INTERVAL}; “(not identified)” marks what the data leave to the prior."
    return Table("parameters", title, note, columns, tuple(rows))


@dataclass(frozen=True, slots=True)
class NoiseGroup:
    """Records with the same noise model, chosen by the same.

    Attributes
    ----------
    title, chosen_by : str
    records : tuple of RecordContent
    lag1, margin : tuple of float or None
        Least and greatest correlation of neighbouring residuals, and lead over the next best model in the
        information criterion [1]; None where it was not compared.
    """

    title: str
    chosen_by: str
    records: tuple[RecordContent, ...]
    lag1: tuple[float, float] | None
    margin: tuple[float, float] | None


def noise_groups(content: Content) -> tuple[NoiseGroup, ...]:
    """Records by noise model and by who chose it."""
    groups: dict[tuple[str, str], list[RecordContent]] = {}
    for r in content.records:
        groups.setdefault((r.noise.title or r.noise.name, r.noise.chosen_by), []).append(r)
    return tuple(
        NoiseGroup(
            title,
            by,
            tuple(records),
            _ends([v for r in records for v in r.noise.lag1.values()]),
            _ends([sorted(r.noise.bic.values())[1] for r in records if len(r.noise.bic) > 1]),
        )
        for (title, by), records in groups.items()
    )


def _ends(values: list[float]) -> tuple[float, float] | None:
    return (min(values), max(values)) if values else None


def without_empty(table: Table) -> Table:
    """A table without the columns that say nothing in any row."""
    full = [
        i
        for i in range(len(table.columns))
        if i < table.grouped or any(cell_text(row[i]) != MISSING for row in table.rows)
    ]
    return Table(
        table.name,
        table.title,
        table.note,
        tuple(table.columns[i] for i in full),
        tuple(tuple(row[i] for i in full) for row in table.rows),
        table.grouped,
    )
