"""The report of a fit: one page, or for very many records one of the campaign and one for each record."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

from sma_bayes.quantities import ARBITRARY
from sma_bayes.report.content import (
    INTERVAL,
    LEVEL,
    PAPER_CORRELATION,
    SHAPES,
    Content,
    Estimate,
    RecordContent,
    parameters_by_channel,
)
from sma_bayes.report.explorer import chart_data
from sma_bayes.report.figures.sheet import FigureFiles, numbered
from sma_bayes.report.html import Picture, embedded, estimate_text, rendered, select
from sma_bayes.report.notation import write
from sma_bayes.report.screen import what_helps
from sma_bayes.report.tables import Cell, Column, Table, report_tables, words
from sma_bayes.response import AUTO_MODEL, DEFAULT_MODEL
from sma_bayes.runs.fit_document import CHECK_TAIL
from sma_bayes.runs.store import write_text
from sma_bayes.studies.fit.answer import answer_tables, next_steps, spread_tables
from sma_bayes.studies.fit.findings import finding_groups
from sma_bayes.studies.fit.methods import methods_text

PACKAGE: Final = "sma_bayes.studies.fit"
EVIDENCES_SHOWN: Final = 4
"""Noise models whose evidences have room beside one another on a page."""
ENTRIES_SHOWN: Final = 20
"""Entries of a list or a table that the report of a campaign of many records shows."""


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
    write_text(folder / "report.html", render(content, tables, embedded(folder, shown), _explored(shown)))
    if content.paged:
        write_text(folder / "records" / "index.html", render_index(content))


def _explored(figures: Mapping[str, FigureFiles]) -> list[dict[str, Any]]:
    """Curves that the reader of a page may question, stiffness first where it has a band: where a fit converged."""
    traces = [t for f in figures.values() for t in f.traces]
    told = any(t.channel == "stiffness" and "q05" in t.quantiles for t in traces)
    return chart_data(sorted(traces, key=lambda t: (t.channel == "stiffness") is not told))


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
        stem: replace(picture, source=f"../figures/{stem}.png")
        for stem, picture in embedded(folder, figures).items()
    }
    page = rendered(
        PACKAGE,
        "record.html.j2",
        r=record,
        own_page=True,
        content=content,
        tables=report_tables(content),
        pictures=pictures,
        explored=_explored(figures),
    )
    write_text(folder / "records" / f"{record.key}.html", page)


def render_index(content: Content) -> str:
    """The list of all records, each with a link to its page."""
    return rendered(
        PACKAGE,
        "records.html.j2",
        content=content,
        channels=[c for c in content.channels if any(_agreement(r, c.channel) for r in content.records)],
        agreement=_agreement,
    )


def _agreement(record: RecordContent, channel: str) -> float | None:
    found = record.channel(channel)
    return found.measured["r"].median if found is not None and "r" in found.measured else None


def render(
    content: Content,
    tables: Mapping[str, Table],
    pictures: Mapping[str, Picture],
    explored: Sequence[Mapping[str, Any]] = (),
) -> str:
    """The report as text.

    Parameters
    ----------
    content : Content
    tables : mapping of str to Table
    pictures : mapping of str to Picture
        By stem; a picture that is missing is left out.
    explored : sequence of mapping
        Curves that the reader may question, see `sma_bayes.report.explorer.chart_data`.
    """
    return rendered(
        PACKAGE,
        most=ENTRIES_SHOWN if content.paged else None,
        content=content,
        tables=tables,
        pictures=pictures,
        explored=explored,
        level=LEVEL,
        check_tail=CHECK_TAIL,
        default_model=DEFAULT_MODEL,
        what_helps=what_helps([r.document.noise.name for r in content.records if not r.document.converged]),
        auto_model=AUTO_MODEL,
        paper_correlation=PAPER_CORRELATION,
        shapes=SHAPES,
        overview=parameter_overview,
        noise_groups=noise_groups(content),
        parts=content.by_units(),
        answers=answer_tables(content),
        spreads=spread_tables(content) if content.paged else (),
        steps=next_steps(content),
        by_path=_by_path_message(content.converged),
        noise_table=_narrow(tables["noise"]),
        methods=methods_text(content),
        groups=finding_groups(content.findings),
        arbitrary=any(
            ARBITRARY in u
            for r in content.records
            for u in (r.temperature_unit, *(c.unit for c in r.channels))
        ),
        numbered=numbered,
    )


def _narrow(table: Table) -> Table:
    """The table of noise models without their evidences where these are more than a page is wide."""
    evidences = tuple(c.key for c in table.columns if c.key.startswith("ln_evidence_"))
    if len(evidences) <= EVIDENCES_SHOWN:
        return table
    kept = select(table, drop=evidences)
    return replace(kept, note=f"{kept.note} Evidences of {len(evidences)} models: tables/noise.csv.")


def _by_path_message(records: Sequence[RecordContent]) -> list[tuple[str, list[RecordContent]]]:
    """Records by what is said of the slope of their path, in the order of the records."""
    found: dict[str, list[RecordContent]] = {}
    for r in records:
        found.setdefault(r.document.path.message, []).append(r)
    return list(found.items())


def parameter_overview(content: Content) -> tuple[Table, ...]:
    """Median and interval of the response's parameters of the converged records, a table for each channel."""
    out = []
    for channel, names in parameters_by_channel(content.converged).items():
        name = next((c.name for c in content.channels if c.channel == channel), channel)
        title = f"Parameters of {name}" if name else "Parameters of the response"
        out.append(_overview(content.converged, list(names), title))
    return tuple(out)


def _overview(records: tuple[RecordContent, ...], names: list[str], title: str) -> Table:
    units = {n: [p.unit for r in records for p in r.parameters if p.name == n] for n in names}
    same = {n: len(set(u)) == 1 for n, u in units.items()}
    columns = (
        *words("condition", "branch"),
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
                cells.append(estimate_text(Estimate.of(p) if same[n] else p.estimate) + mark)
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
        Least and greatest correlation of neighbouring residuals, and ln evidence less that of the best other model
        [1]; None where it was not compared.
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
        groups.setdefault(
            (r.document.noise.title or r.document.noise.name, r.document.noise.chosen_by), []
        ).append(r)
    return tuple(
        NoiseGroup(
            title,
            by,
            tuple(records),
            _ends([v for r in records for v in r.document.noise.lag1.values() if v is not None]),
            _ends([lead for r in records if (lead := _lead(r)) is not None]),
        )
        for (title, by), records in groups.items()
    )


def _lead(record: RecordContent) -> float | None:
    """Ln evidence of the noise model less that of the best other one; None where none was compared."""
    found = {n: v for n, v in record.document.noise.ln_evidence.items() if v is not None}
    own = found.pop(record.document.noise.name, None)
    return None if own is None or not found else own - max(found.values())


def _ends(values: list[float]) -> tuple[float, float] | None:
    return (min(values), max(values)) if values else None
