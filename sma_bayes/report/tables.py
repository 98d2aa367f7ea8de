"""Tables of a report: typed cells under headers with units, written as CSV and as LaTeX for a paper."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, TypeVarTuple

from sma_bayes.assess.checks import CHECK_DRAWS, FALSE_ALARM_RATE
from sma_bayes.assess.loops import QuantityInterval
from sma_bayes.latex import Tex, longtable, share_of_line, tex_row, tex_symbol, tex_text, tex_unit, wrapped
from sma_bayes.quantities import CHANNELS
from sma_bayes.records.severity import severity
from sma_bayes.report.content import (
    INTERVAL,
    PAPER_CORRELATION,
    AverageFactor,
    Channel,
    Content,
    Estimate,
    Number,
    RecordContent,
)
from sma_bayes.report.notation import (
    MISSING,
    interval_text,
    power_text,
    sentence,
    squared,
    unit_label,
    with_minus,
    write,
    write_interval,
)
from sma_bayes.runs.fit_document import Lack
from sma_bayes.runs.store import write_csv, write_text

UNIT_OF_ROW: Final = "unit"
"""Unit of a column whose rows have units of their own, named in the column ``unit``."""
UNIT_OF_ROW_SQUARED: Final = "unit²"
"""The square of that."""

NEAREST_CURVE_NOTE: Final = (
    "The published curve, Eq. (2) or (4), that is nearest to each posterior curve, discrepancy included: least mean "
    "square over the temperatures that were measured."
)
"""Norm and range of the nearest published parameters."""

WRAPPED_COLUMN_SHARES: Final = {
    "finding": 0.38, "why": 0.5, "prior": 0.17, "meaning": 0.2, "remedy": 0.3, "believed": 0.35, "rows": 0.12,
    "sampler": 0.1,
}  # fmt: skip
"""Columns whose words may be broken in LaTeX, with the share of the line that they have where others leave it."""
MAX_WRAPPED_SHARE: Final = 0.52
"""What several of them have together at most."""
MIN_WRAPPED_SHARE: Final = 0.15
"""What they have together at least, however much the others take."""

STATISTICS: Final = {
    "greatest": "largest residual",
    "lag1": "correlation of neighbours",
    "block_means": "mean residual by temperature",
    "sweep_means": "mean residual by sweep",
    "left_out_sweeps": "sweeps left out",
    "sd_by_temperature": "spread by temperature",
    "sd_by_response": "spread by response",
    "pit": "shape of the noise",
}
"""Names of the statistics of predictive checks, for people."""

SYMBOLS: Final = ("parameter", "rhat_of", "ess_of")
"""Columns of names of parameters."""

Cell = str | int | bool | Number | Estimate | None
"""What a table holds; None where there is nothing to say."""


@dataclass(frozen=True, slots=True)
class Column:
    """A column.

    Attributes
    ----------
    name : str
        For people.
    key : str
        In CSV.
    unit : str
        Unit of its numbers, `UNIT_OF_ROW`, or empty for words.
    brief : bool
        Whether it is in the LaTeX table too, which has less room.
    """

    name: str
    key: str
    unit: str = ""
    brief: bool = True

    @property
    def header(self) -> str:
        """Name with unit, for people."""
        return self.header_with(0)

    def header_with(self, power: int) -> str:
        """The same, with the power of ten that all numbers of the column have in common."""
        label = self.unit if self.unit in (UNIT_OF_ROW, UNIT_OF_ROW_SQUARED) else unit_label(self.unit)
        label = " ".join(part for part in (f"10{power_text(power)}" if power else "", label) if part)
        return f"{self.name} [{label}]" if label and self.unit else self.name

    @property
    def csv_unit(self) -> str:
        """Suffix of the header in CSV; a pure number says 1."""
        return (
            f" [{self.unit if self.unit in (UNIT_OF_ROW, UNIT_OF_ROW_SQUARED, '1') else unit_label(self.unit)}]"
            if self.unit
            else ""
        )


def words(*names: str) -> tuple[Column, ...]:
    """Columns of words, whose keys are their names with underscores for blanks."""
    return tuple(Column(name, name.replace(" ", "_")) for name in names)


@dataclass(frozen=True, slots=True)
class Table:
    """A table.

    Attributes
    ----------
    name : str
        Of its files.
    title, note : str
        What it shows; how to read it.
    columns : tuple of Column
    rows : tuple of tuple of Cell
    grouped : int
        How many of the first columns head a group of rows in print.
    """

    name: str
    title: str
    note: str
    columns: tuple[Column, ...]
    rows: tuple[tuple[Cell, ...], ...]
    grouped: int = 0


Ts = TypeVarTuple("Ts")
Told = tuple[Column, Callable[..., Cell]]
"""A column with what it holds of that of which a row is made."""


def table_of(
    name: str,
    title: str,
    note: str,
    of: Iterable[tuple[*Ts]],
    *columns: tuple[Column, Callable[[*Ts], Cell]],
    grouped: int = 0,
) -> Table:
    """A table whose columns say each what they hold.

    Parameters
    ----------
    name, title, note
        See `Table`.
    of : iterable of tuple
        What each row is made of.
    *columns : tuple of Column and callable
        The callable takes what a row is made of, and gives the cell.
    grouped : int
    """
    rows = tuple(tuple(cell(*parts) for _, cell in columns) for parts in of)
    return Table(name, title, note, tuple(column for column, _ in columns), rows, grouped)


# --- which tables -------------------------------------------------------------------------------------

_RECORD = (Column("condition", "condition"), Column("branch", "branch"), Column("converged", "converged"))
_OF_RECORD: Final[tuple[Told, ...]] = (
    (_RECORD[0], lambda r, *_: r.condition),
    (_RECORD[1], lambda r, *_: r.branch),
    (_RECORD[2], lambda r, *_: r.converged),
)
"""Columns of the record, which comes first in what a row is made of."""
_UNIT: Final = Column("unit", "unit")


def report_tables(content: Content) -> dict[str, Table]:
    """All tables of a run, by name."""
    tables = [
        parameter_table(content.records),
        fit_table(content.records),
        correlation_table(content.records),
        average_table(content.averages),
        quantity_table(content),
        transformation_table(content.records),
        diagnostics_table(content.records),
        adequacy_table(content.records),
        missed_table(content.records),
        nearest_table(content.records),
        noise_table(content.records),
        check_table(content.records),
        finding_table(content),
    ]
    if content.printed:
        tables.append(printed_table(content))
    return {table.name: table for table in tables}


def _head(r: RecordContent) -> tuple[Cell, ...]:
    return (r.condition, r.branch, r.converged)


def parameter_table(records: Sequence[RecordContent]) -> Table:
    """Warm start, posterior, diagnostics and prior of every parameter."""
    return table_of(
        "parameters",
        "Parameters",
        f"Posterior mean, standard deviation and quantiles; 5 % and 95 % bound the {INTERVAL}. The warm start is the "
        "least-squares fit. Contraction is one less posterior over prior variance; from 0.9 a parameter counts as "
        "identified by the data. Numbers of a prior are in the parameter's unit.",
        [(r, p) for r in records for p in r.parameters],
        *_OF_RECORD,
        (Column("parameter", "parameter"), lambda r, p: p.name),
        (_UNIT, lambda r, p: unit_label(p.unit) or "1"),
        (Column("meaning", "meaning", brief=False), lambda r, p: p.meaning),
        (Column("warm start", "warm_start", UNIT_OF_ROW), lambda r, p: Number(p.warm_start, p.unit, p.sd)),
        (
            Column("its sd", "warm_start_sd", UNIT_OF_ROW, brief=False),
            lambda r, p: Number(p.warm_start_sd, p.unit, p.warm_start_sd),
        ),
        (Column("mean", "mean", UNIT_OF_ROW), lambda r, p: Number(p.mean, p.unit, p.sd)),
        (Column("sd", "sd", UNIT_OF_ROW), lambda r, p: Number(p.sd, p.unit, p.sd)),
        (Column("5 %", "q05", UNIT_OF_ROW), lambda r, p: Number(p.estimate.q05, p.unit, p.sd)),
        (Column("median", "median", UNIT_OF_ROW), lambda r, p: Number(p.estimate.median, p.unit, p.sd)),
        (Column("95 %", "q95", UNIT_OF_ROW), lambda r, p: Number(p.estimate.q95, p.unit, p.sd)),
        (Column("R-hat", "rhat", "1"), lambda r, p: Number(p.rhat, "1", 0.01)),
        (Column("ESS bulk", "ess_bulk", "1"), lambda r, p: Number(p.ess_bulk, "1", 10.0)),
        (Column("ESS tail", "ess_tail", "1"), lambda r, p: Number(p.ess_tail, "1", 10.0)),
        (Column("contraction", "contraction", "1"), lambda r, p: Number(p.contraction, "1", 0.01)),
        (Column("identified", "identified"), lambda r, p: "fixed" if p.fixed else p.identified),
        (Column("at bound", "at_bound", brief=False), lambda r, p: p.at_bound),
        (Column("prior", "prior"), lambda r, p: "fixed" if p.fixed else p.prior_text),
        (Column("why this prior", "prior_source", brief=False), lambda r, p: p.source),
        grouped=3,
    )


def fit_table(records: Sequence[RecordContent]) -> Table:
    """Goodness of the least-squares fit."""
    return table_of(
        "goodness_of_fit",
        "Goodness of the least-squares fit",
        "At the warm start, in sample: sum of squared errors SSE, RMSE (the root of SSE over n − p), R², and R² "
        "adjusted for the p parameters of the channel.",
        [(r, c, c.fit) for r in records for c in r.channels if c.fit],
        *_OF_RECORD,
        (Column("channel", "channel"), lambda r, c, f: c.name),
        (_UNIT, lambda r, c, f: unit_label(c.unit) or "1"),
        (Column("n", "n", "1"), lambda r, c, f: int(f["n"])),
        (Column("p", "p", "1"), lambda r, c, f: int(f["p"])),
        (Column("SSE", "sse", UNIT_OF_ROW_SQUARED), lambda r, c, f: Number(f.get("sse"), squared(c.unit))),
        (Column("RMSE", "rmse", UNIT_OF_ROW), lambda r, c, f: Number(f.get("rmse"), c.unit)),
        (Column("R²", "r2", "1"), lambda r, c, f: Number(f.get("r2"), "1", 1e-4)),
        (Column("adjusted R²", "adj_r2", "1"), lambda r, c, f: Number(f.get("adj_r2"), "1", 1e-4)),
        grouped=3,
    )


def correlation_table(records: Sequence[RecordContent]) -> Table:
    """Correlation factors, R2 and RMSE over the posterior."""
    beside = any(r.document.discrepancy for r in records)
    return table_of(
        "correlation",
        "Correlation factors",
        f"Median and {INTERVAL} over the posterior curves; against the measured data, and against data replicated "
        "from the posterior."
        + beside
        * " The curves are those that are plotted, with the discrepancy beside the model. The last column is r of the "
        "model alone at least squares, as the paper states it. Adjusted R² counts the parameters of the model, not "
        "what the discrepancy beside it takes up.",
        [
            (r, c, which, found)
            for r in records
            for c in r.channels
            for which, found in (("measured", c.measured), ("replicated", c.replicated))
            if found
        ],
        *_OF_RECORD,
        (Column("channel", "channel"), lambda r, c, which, found: c.name),
        (Column("data", "data"), lambda r, c, which, found: which),
        (Column("r", "r", "1"), lambda r, c, which, found: found.get("r")),
        (Column("R²", "r2", "1"), lambda r, c, which, found: found.get("r2")),
        (Column("adjusted R²", "adj_r2", "1"), lambda r, c, which, found: found.get("adj_r2")),
        (_UNIT, lambda r, c, which, found: unit_label(c.unit) or "1"),
        (Column("RMSE", "rmse", UNIT_OF_ROW), lambda r, c, which, found: found.get("rmse")),
        *([(Column("r, model alone", "r_model", "1"), _factor_of_model)] if beside else []),
        grouped=3,
    )


def _factor_of_model(r: RecordContent, c: Channel, which: str, _: object) -> Number | None:
    alone = r.document.fit.get(c.channel)
    return None if which != "measured" or alone is None else Number(alone.r, "1", 1e-4)


AVERAGE_COLUMNS: Final = (
    Column("records", "records"),
    Column("r", "r", "1"),
    Column(f"P(r > {PAPER_CORRELATION:g})", "above"),
    Column("R²", "r2", "1"),
    Column("adjusted R²", "adj_r2", "1"),
    Column("unit", "unit"),
    Column("RMSE", "rmse", UNIT_OF_ROW),
    Column("draws without r", "undefined", "1", brief=False),
)
"""Columns of `average_cells`."""


def average_table(averages: Sequence[AverageFactor]) -> Table:
    """Averages of the correlation factors over the records that converged."""
    return Table(
        "correlation_average",
        "Average correlation factors",
        f"Over the records that converged: median and {INTERVAL} of the average. Plain: mean of the records' factors; "
        "Fisher: tanh of the mean of artanh r; pooled: one factor over all samples of all records.",
        (
            *words("channel", "data", "branch", "rule"),
            *AVERAGE_COLUMNS,
        ),
        tuple(
            (a.document.quantity, a.data, a.branch, a.rule, *average_cells(a))
            for a in sorted(averages, key=lambda a: a.document.quantity)
        ),
        grouped=2,
    )


def average_cells(a: AverageFactor) -> tuple[Cell, ...]:
    """Averages of all factors, as a row of `AVERAGE_COLUMNS`."""
    f, d, count = a.factors, a.document, len(a.document.records)
    return (
        f"{count} of {count + len(d.left_out)}", f.get("r"), probability_text(a.r.above, d.draws), f.get("r2"),
        f.get("adj_r2"), unit_label(d.unit) or "1", f.get("rmse"), Number(a.r.undefined, "1", 0.01),
    )  # fmt: skip


def probability_text(share: float | None, draws: int) -> str:
    """Share of draws as a probability, not surer than their number allows.

    Examples
    --------
    >>> probability_text(1.0, 2000), probability_text(0.0, 2000), probability_text(0.3125, 2000)
    ('> 0.999', '< 0.001', '0.312')
    """
    if share is None:
        return MISSING
    finest = 10.0 ** -math.floor(math.log10(max(draws, 10)))
    if share > 1.0 - finest:
        return f"> {1.0 - finest:g}"
    return f"< {finest:g}" if share < finest else f"{share:.3f}"


def quantity_table(content: Content) -> Table:
    """Loop and stiffness quantities."""
    rows: list[tuple[Cell, ...]] = []
    for condition in content.conditions:
        records = content.branches(condition)
        whole = all(r.converged for r in records)
        rows += [
            (condition, "both", whole, *_quantity_cells(records[0], q))
            for q in content.loops
            if q.condition == condition
        ]
        rows += [
            (*_head(r), *_quantity_cells(r, q)) for r in records for q in r.document.quantities_of_branch
        ]
    return Table(
        "loops",
        "Loop and stiffness quantities",
        f"Median and {INTERVAL}. The posteriors of the two branches of a loop are independent, but for errors "
        "of a calibration, which both share.",
        (
            *_RECORD,
            *words("quantity", "channel", "unit"),
            Column("value", "value", UNIT_OF_ROW),
            Column("draws with a value", "defined", "1", brief=False),
            Column("meaning", "meaning", brief=False),
        ),
        tuple(rows),
    )


def _quantity_cells(r: RecordContent, q: QuantityInterval) -> tuple[Cell, ...]:
    name = q.name.replace("_", " ").replace("stiffness", r.name_of("stiffness"))
    unit, defined = unit_label(q.unit) or "1", Number(q.defined, "1", 0.01)
    return name, r.name_of(q.channel), unit, Estimate.of(q, q.unit), defined, q.meaning


UNSUPPORTED: Final[dict[Lack, str]] = {
    "readings": "from too few readings",
    "tangents": "without tangents",
    "plateau": "extrapolated",
}
"""Why a transformation temperature is not supported by the measurements, in a word or two."""


def transformation_table(records: Sequence[RecordContent]) -> Table:
    """Start and finish of the transformation by the tangent rule."""
    return table_of(
        "transformation",
        "Transformation temperatures",
        "Where the tangent at the steepest point crosses the tangents to the plateaus (rule of ASTM E3097), on each "
        f"posterior curve: median and {INTERVAL}. Outstanding: share of the transformation that the sweep leaves out "
        "at that end. Where the measurements do not support both tangents the last column says what they lack.",
        [(r, name, t) for r in records for name, t in r.document.transformation.items()],
        *_OF_RECORD,
        (Column("temperature", "name"), lambda r, name, t: name),
        (Column("meaning", "meaning", brief=False), lambda r, name, t: t.meaning),
        (Column("channel", "channel"), lambda r, name, t: r.name_of(t.channel)),
        (_UNIT, lambda r, name, t: unit_label(t.unit) or "1"),
        (Column("value", "value", UNIT_OF_ROW), lambda r, name, t: Estimate.of(t, t.unit)),
        (Column("outstanding", "outstanding", "1"), lambda r, name, t: Number(t.outstanding, "1", 0.01)),
        (Column("samples between", "samples", "1"), lambda r, name, t: t.samples),
        (
            Column("draws with a value", "defined", "1", brief=False),
            lambda r, name, t: Number(t.defined, "1", 0.01),
        ),
        (
            Column("supported by data", "within_data"),
            lambda r, name, t: "yes" if t.lacks is None else f"no, {UNSUPPORTED[t.lacks]}",
        ),
    )


def diagnostics_table(records: Sequence[RecordContent]) -> Table:
    """Convergence and sampling of every record."""
    return table_of(
        "diagnostics",
        "Convergence",
        "Worst R-hat and least effective sample size (ESS) of any sampled parameter, with its name; likelihood "
        "evaluations; acceptance of the ensemble moves; modes found; rank of the least-squares Jacobian.",
        [(r, r.document, r.document.sampler, r.worst_rhat, r.least_ess) for r in records],
        *_OF_RECORD,
        (Column("samples", "n", "1"), lambda r, d, s, rhat, ess: d.n),
        (Column("parameters", "parameters", "1"), lambda r, *_: sum(not p.fixed for p in r.parameters)),
        (
            Column("worst R-hat", "rhat", "1"),
            lambda r, d, s, rhat, ess: Number(rhat.rhat if rhat else None, "1", 0.01),
        ),
        (Column("parameter with it", "rhat_of"), lambda r, d, s, rhat, ess: rhat.name if rhat else None),
        (
            Column("least ESS", "ess", "1"),
            lambda r, d, s, rhat, ess: Number(ess.ess if ess else None, "1", 10.0),
        ),
        (Column("parameter with it", "ess_of"), lambda r, d, s, rhat, ess: ess.name if ess else None),
        (Column("draws", "draws", "1"), lambda r, d, s, *_: s.draws),
        (Column("evaluations", "evaluations", "1"), lambda r, d, *_: d.log_likelihood_evaluations),
        (Column("acceptance", "acceptance", "1"), lambda r, d, s, *_: Number(s.acceptance, "1", 0.1)),
        (
            Column("efficiency", "efficiency", "1", brief=False),
            lambda r, d, s, *_: Number(s.efficiency, "1", 0.1),
        ),
        (
            Column("greatest weight", "greatest_weight", "1", brief=False),
            lambda r, d, s, *_: Number(s.greatest_weight),
        ),
        (Column("modes", "modes", "1"), lambda r, d, s, *_: s.modes),
        (Column("sampler", "sampler"), lambda r, d, s, *_: s.method),
        (Column("rank", "jacobian_rank", "1"), lambda r, d, *_: d.jacobian_rank),
        (
            Column("at bound", "at_bound"),
            lambda r, *_: ", ".join(p.name for p in r.parameters if p.at_bound) or None,
        ),
        (
            Column("ln evidence", "ln_evidence", "1", brief=False),
            lambda r, d, *_: Number(d.ln_evidence, "1", d.ln_evidence_sd),
        ),
        (
            Column("its sd", "ln_evidence_sd", "1", brief=False),
            lambda r, d, *_: Number(d.ln_evidence_sd, "1", d.ln_evidence_sd),
        ),
        (Column("time", "wall", "s", brief=False), lambda r, d, *_: Number(d.wall_s or 0.0, "s", 0.1)),
    )


def adequacy_table(records: Sequence[RecordContent]) -> Table:
    """Whether curve and noise describe each record, and why not."""
    return table_of(
        "adequacy",
        "Adequacy",
        "A record is adequate where curve and noise could have made its data: the curve misses at no temperature more "
        "than 2 % of the range and three standard deviations of the noise, no predictive check fails, the noise leaves "
        "the response to be seen, and the data, not the prior, tell where and how fast it changes.",
        [(r,) for r in records],
        *_OF_RECORD,
        (Column("model", "model"), lambda r: r.model),
        (Column("adequate", "adequate"), lambda r: r.adequate),
        (Column("why not", "why"), lambda r: "; ".join(reason.message for reason in r.document.why) or None),
    )


def missed_table(records: Sequence[RecordContent]) -> Table:
    """What the curves miss, as far as a discrepancy beside them tells."""
    return table_of(
        "missed",
        "What the curves miss",
        "A smooth function of temperature beside the curve, kept apart from all that the parameters of the curve can "
        "do. Rms: root mean square over the samples. Largest: where its median is largest, with the temperature and "
        "the share of the measured range. It is taken unless the evidence is against it: ln Bayes factor, at the "
        "warm start. "
        "Between sweeps: root mean square of what a sweep has of its own beside it, where sweeps differ; the curve is "
        "their mean then, and new readings are of a new sweep.",
        [
            (r, channel, m, None if m.rms is None else 0.1 * m.rms)
            for r in records
            for channel, m in r.document.discrepancy.items()
        ],
        *_OF_RECORD,
        (Column("channel", "channel"), lambda r, channel, m, fine: r.name_of(channel)),
        (_UNIT, lambda r, channel, m, fine: unit_label(m.unit) or "1"),
        (Column("rms", "rms", UNIT_OF_ROW), lambda r, channel, m, fine: Number(m.rms, m.unit, fine)),
        (
            Column("largest", "largest", UNIT_OF_ROW),
            lambda r, channel, m, fine: Number(m.largest, m.unit, fine),
        ),
        (
            Column("between sweeps", "between_sweeps", UNIT_OF_ROW),
            lambda r, channel, m, fine: Number(m.between_sweeps, m.unit, fine),
        ),
        (
            Column("at temperature", "at"),
            lambda r, channel, m, fine: f"{write([m.at]).plain[0]} {unit_label(r.temperature_unit)}",
        ),
        (
            Column("share of range [%]", "share_percent", "1"),
            lambda r, channel, m, fine: Number(100.0 * m.share, "1", 1.0),
        ),
        (
            Column("ln Bayes factor", "ln_bayes_factor", "1"),
            lambda r, channel, m, fine: Number(m.ln_bayes_factor, "1", 1.0),
        ),
    )


def nearest_table(records: Sequence[RecordContent]) -> Table:
    """Parameters of the published curves nearest to curves of another kind."""

    def ends(r: RecordContent) -> str:
        low, high = (write([end]).plain[0] for end in r.temperature_range)
        return f"{low} to {high} {unit_label(r.temperature_unit)}"

    return table_of(
        "nearest",
        "Nearest published parameters",
        f"{NEAREST_CURVE_NOTE} Median and {INTERVAL}; none where more than 5 % of the draws have no nearest curve.",
        [(r, name, p) for r in records if r.other_than_published for name, p in r.document.nearest.items()],
        *_OF_RECORD,
        (Column("channel", "channel"), lambda r, name, p: r.name_of(p.channel)),
        (Column("parameter", "parameter"), lambda r, name, p: name),
        (_UNIT, lambda r, name, p: unit_label(p.unit) or "1"),
        (Column("value", "value", UNIT_OF_ROW), lambda r, name, p: Estimate.of(p, p.unit)),
        (Column("nearest over", "range"), lambda r, name, p: ends(r)),
        (
            Column("draws with a value", "defined", "1", brief=False),
            lambda r, name, p: Number(p.defined, "1", 0.01),
        ),
        grouped=3,
    )


def noise_table(records: Sequence[RecordContent]) -> Table:
    """The noise model of every record and why."""
    lag1 = [{r.name_of(c): v for c, v in r.document.noise.lag1.items() if v is not None} for r in records]
    names = tuple(dict.fromkeys(name for found in lag1 for name in found))
    rivals = tuple(
        dict.fromkeys(n for r in records for n, v in r.document.noise.ln_evidence.items() if v is not None)
    )
    return Table(
        "noise",
        "Noise models",
        "Correlation of neighbouring residuals (lag 1) of the least-squares fit, by channel, and the "
        "logarithm of the evidence of each noise model less that of the best, with discrepancies where they are taken.",
        (
            *_RECORD,
            Column("noise model", "noise"),
            Column("chosen by", "chosen_by"),
            *(Column(f"lag 1, {name}", f"lag1_{name}", "1") for name in names),
            *(Column(f"ln evidence, {name}", f"ln_evidence_{name}", "1", brief=False) for name in rivals),
        ),
        tuple(
            (
                *_head(r),
                r.document.noise.title or r.document.noise.name,
                r.document.noise.chosen_by,
                *(Number(found.get(name), "1", 0.1) for name in names),
                *(Number(r.document.noise.ln_evidence.get(name), "1", 1.0) for name in rivals),
            )
            for r, found in zip(records, lag1, strict=True)
        ),
    )


def check_table(records: Sequence[RecordContent]) -> Table:
    """Posterior predictive checks."""
    return table_of(
        "checks",
        "Posterior predictive checks",
        "A statistic of the standardised residuals, memory of the noise taken out: measured (posterior median), and "
        "the 5 % and 95 % quantile of replicated data. The p-value is the share of replications beyond the measured "
        "one; near 0 or 1 the model misses something. It comes in steps of "
        f"{1 / CHECK_DRAWS:.3g}. "
        "Of sweeps left out it is exact: each is predicted from the others, and the statistic is that of the most "
        "different one; that it was picked among all is allowed for.",
        [
            (r, c, None if c.q05 is None or c.q95 is None else (c.q95 - c.q05) / 3.0)
            for r in records
            for c in r.document.checks
        ],
        *_OF_RECORD,
        (Column("channel", "channel"), lambda r, c, width: r.name_of(c.channel)),
        (Column("statistic", "statistic"), lambda r, c, width: STATISTICS.get(c.statistic, c.statistic)),
        (Column("measured", "measured", "1"), lambda r, c, width: Number(c.measured, "1", width)),
        (Column("replicated 5 %", "replicated_q05", "1"), lambda r, c, width: Number(c.q05, "1", width)),
        (Column("replicated 95 %", "replicated_q95", "1"), lambda r, c, width: Number(c.q95, "1", width)),
        (
            Column("p-value", "p_value", "1"),
            lambda r, c, width: Number(c.p_value, "1", 0.05, FALSE_ALARM_RATE),
        ),
        (Column("failed", "failed"), lambda r, c, width: c.failed),
        (Column("what it would show", "meaning", brief=False), lambda r, c, width: c.meaning),
        grouped=3,
    )


def finding_table(content: Content) -> Table:
    """What the quality checks saw."""
    names = {(r.condition, c): r.name_of(c) for r in content.records for c in CHANNELS}
    return Table(
        "findings",
        "Findings about the measurements",
        "Rows are lines of the file, counted from 1. Nothing is repaired or left out silently.",
        (
            *words("kind", "severity", "file", "rows", "condition", "branch", "column"),
            Column("rows concerned", "count", "1"),
            Column("kept out", "dropped", "1"),
            Column("finding", "finding"),
        ),
        tuple(
            (
                f.kind, severity(f.kind), f.file, rows_text(f.rows, f.count), f.condition, f.branch,
                names.get((f.condition, f.column), f.column), f.count,
                f.dropped, f.message,
            )
            for f in content.findings
        ),
    )  # fmt: skip


def rows_text(rows: Sequence[int], count: int) -> str:
    """Rows with runs joined: ``3–7, 12``; dots where not all are listed.

    Examples
    --------
    >>> rows_text((3, 4, 5, 12), 4), rows_text((1, 9), 40)
    ('3–5, 12', '1, 9 …')
    """
    runs: list[list[int]] = []
    for row in rows:
        if runs and row == runs[-1][-1] + 1:
            runs[-1][-1:] = [*runs[-1][-1:], row] if len(runs[-1]) == 1 else [row]
        else:
            runs.append([row])
    text = ", ".join("–".join(str(r) for r in run) for run in runs)
    return f"{text} …" if rows and count > len(rows) else text


def printed_table(content: Content) -> Table:
    """Printed values of the paper beside the twin's posteriors."""
    return table_of(
        "printed",
        "Printed values against posteriors",
        f"Printed: Tables 3 to 5, from which the twin was drawn. Posterior: median and {INTERVAL}. Distance: printed "
        "value less posterior mean, over the posterior sd.",
        [(c, c.cell) for c in content.printed],
        (Column("record", "record"), lambda c, cell: c.record),
        (Column("parameter", "parameter"), lambda c, cell: c.parameter),
        (_UNIT, lambda c, cell: unit_label(cell.unit) or "1"),
        (Column("printed", "printed"), lambda c, cell: cell.printed),
        (Column("posterior", "posterior", UNIT_OF_ROW), lambda c, cell: c.estimate),
        (Column("distance [sd]", "distance_sd", "1"), lambda c, cell: Number(c.distance, "1", 0.1)),
        (Column("inside", "inside"), lambda c, cell: c.inside),
        (Column("printed value is", "status"), lambda c, cell: str(cell.status)),
        (Column("doubt", "doubt", brief=False), lambda c, cell: cell.reason),
        grouped=1,
    )


# --- how they are written -----------------------------------------------------------------------------


def cell_text(cell: Cell, power: int | None = None) -> str:
    """A cell as people read it; a `power` of ten that stands in the header is not written again."""
    match cell:
        case None | "" | Estimate(median=None):
            return MISSING
        case bool():
            return "yes" if cell else "no"
        case Number(float(share), finest=float(finest)) if not finest <= share <= 1.0 - finest:
            return f"< {finest:g}" if share < finest else f"> {1.0 - finest:g}"
        case Number(value, _, resolution):
            return write([value], resolution).plain[0]
        case Estimate(median, low, high):
            return interval_text(median, low, high, power=power)
        case _:
            return str(cell)


def powers(table: Table) -> tuple[int | None, ...]:
    """Power of ten of each column whose numbers share a unit, so that all are written alike; None for other columns."""
    return tuple(
        _power([row[place] for row in table.rows]) if column.unit not in ("", UNIT_OF_ROW_SQUARED) else None
        for place, column in enumerate(table.columns)
    )


def _power(cells: Sequence[Cell]) -> int | None:
    """That of the largest estimate, 0 for numbers of ordinary size; None where there are none, or others among them."""
    if len({c.unit for c in cells if isinstance(c, Estimate)}) > 1 or any(
        isinstance(c, Number) for c in cells
    ):
        return None
    written = {
        max(abs(c.median), abs(c.q05), abs(c.q95)): write_interval(c.median, c.q05, c.q95).exponent
        for c in cells
        if isinstance(c, Estimate) and c.median is not None and c.q05 is not None and c.q95 is not None
    }
    return written[max(written)] if written and any(written.values()) else None


def write_tables(tables: dict[str, Table], folder: Path) -> None:
    """Write each table as CSV, with all digits and columns, and as LaTeX.

    Raises
    ------
    OutputError
        If a file can't be written.
    """
    for table in tables.values():
        write_csv(folder / f"{table.name}.csv", csv_columns(table))
        write_text(folder / f"{table.name}.tex", tex(table))


def csv_columns(table: Table) -> dict[str, list[object]]:
    """Columns of a table as CSV has them: an estimate becomes three, numbers keep their digits.

    A number among estimates, which has no interval, is a median alone.
    """
    out: dict[str, list[object]] = {}
    for place, column in enumerate(table.columns):
        cells = [row[place] for row in table.rows]
        if any(isinstance(c, Estimate) for c in cells):
            for end in ("q05", "median", "q95"):
                out[f"{column.key}_{end}{column.csv_unit}"] = [
                    _csv_value(_end(c, end), column) for c in cells
                ]
        else:
            out[column.key + column.csv_unit] = [
                _csv_value(c.value if isinstance(c, Number) else c, column) for c in cells
            ]
    return out


def _end(cell: Cell, end: str) -> float | None:
    if isinstance(cell, Number):
        return cell.value if end == "median" else None
    found: float | None = getattr(cell, end) if isinstance(cell, Estimate) else None
    return found


def _csv_value(cell: object, column: Column) -> object:
    match cell:
        case None:
            return math.nan if column.unit else ""  # an empty cell; a column of numbers stays one
        case bool():
            return "true" if cell else "false"
        case _:
            return cell


def tex(table: Table) -> str:
    """A table in LaTeX, for the packages array, booktabs, longtable and siunitx.

    Returns
    -------
    str
        A ``longtable`` with caption and label, in ASCII and Latin letters.
    """
    places = [i for i, c in enumerate(table.columns) if c.brief and i >= table.grouped]
    common = powers(table)
    return longtable(
        table.name,
        f"{table.title}. {table.note}",
        [_tex_head(table.columns[i], common[i] or 0) for i in places],
        [_alignment(table, i, places) for i in places],
        _tex_rows(table, places),
    )


def _tex_head(column: Column, power: int) -> Tex:
    """Header with its unit for siunitx, and the power of ten that the numbers of the column have in common."""
    name = tex_symbol(column.name)
    if power and column.unit in ("1", UNIT_OF_ROW):
        return Tex(f"{name} [$10^{{{power}}}${' unit' if column.unit == UNIT_OF_ROW else ''}]")
    if column.unit in ("", "1", UNIT_OF_ROW, UNIT_OF_ROW_SQUARED):
        return Tex(tex_text(column.header_with(power)) if name == tex_text(column.name) else name)
    unit = " ".join(part for part in (f"$10^{{{power}}}$" if power else "", tex_unit(column.unit)) if part)
    return Tex(f"{name} [{unit}]")


def _alignment(table: Table, place: int, places: Sequence[int]) -> str:
    column = table.columns[place]
    if column.key in WRAPPED_COLUMN_SHARES:
        return wrapped(f"{_room(table, places) * WRAPPED_COLUMN_SHARES[column.key]:.3g}")
    return "r" if column.unit != "" else "l"


def _room(table: Table, places: Sequence[int]) -> float:
    """Factor that makes the columns that may be broken fit beside the others, which are as wide as their words."""
    broken = [k for i in places if (k := table.columns[i].key) in WRAPPED_COLUMN_SHARES]
    asked = sum(WRAPPED_COLUMN_SHARES[key] for key in broken)
    whole = [i for i in places if table.columns[i].key not in WRAPPED_COLUMN_SHARES]
    texts = [[table.columns[i].header, *(cell_text(row[i]) for row in table.rows)] for i in whole]
    left = 1.0 - share_of_line(sum(max(map(len, column)) for column in texts), len(places))
    most = min(left, MAX_WRAPPED_SHARE if len(broken) > 1 else 1.0)
    return min(1.0, max(most, MIN_WRAPPED_SHARE) / asked)


def _tex_rows(table: Table, places: Sequence[int]) -> Iterator[str]:
    group: tuple[Cell, ...] | None = None
    common = powers(table)
    for number, row in enumerate(table.rows):
        if table.grouped and row[: table.grouped] != group:
            group = row[: table.grouped]
            if number:
                yield r"\addlinespace"
            yield rf"\multicolumn{{{len(places)}}}{{l}}{{\textit{{{tex_text(group_text(table, group))}}}}} \\*"
        yield tex_row(_tex_cell(table.columns[i], row[i], common[i]) for i in places)


def _tex_cell(column: Column, cell: Cell, power: int | None) -> str:
    text = with_minus(cell_text(cell, power))
    return tex_symbol(text) if column.key in SYMBOLS else text


def group_text(table: Table, group: Sequence[Cell]) -> str:
    """Words over a group of rows: ``2A-10mHz, heating, 60 °C``, and that it did not converge where it did not."""
    words = [_group_word(column, value) for column, value in zip(table.columns, group, strict=False)]
    return ", ".join(w for w in words if w)


def _group_word(column: Column, value: Cell) -> str:
    if isinstance(value, bool):
        return "" if value else "not converged"
    if cell_text(value) == MISSING:
        return ""
    unit = "" if column.unit == UNIT_OF_ROW else unit_label(column.unit)
    return f"{cell_text(value)} {unit}".rstrip()


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


def without_same(table: Table, keys: Sequence[str]) -> Table:
    """A table whose note tells what some columns, by their keys, say alike in all of several rows, instead of them."""
    said = {
        i: cell_text(table.rows[0][i])
        for i, c in enumerate(table.columns)
        if c.key in keys and len(table.rows) > 1 and len({cell_text(row[i]) for row in table.rows}) == 1
    }
    if not said:
        return table
    kept = [i for i in range(len(table.columns)) if i not in said]
    told = "; ".join(f"{table.columns[i].name} in all rows: {text}" for i, text in said.items())
    return Table(
        table.name,
        table.title,
        f"{table.note} {sentence(told)}",
        tuple(table.columns[i] for i in kept),
        tuple(tuple(row[i] for i in kept) for row in table.rows),
        table.grouped,
    )
