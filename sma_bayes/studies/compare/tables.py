"""Tables of a comparison."""

from __future__ import annotations

from collections.abc import Iterator

from sma_bayes.report.averages import average_factors
from sma_bayes.report.content import INTERVAL, PAPER_CORRELATION, AverageFactor, Estimate, Number
from sma_bayes.report.notation import unit_label
from sma_bayes.report.tables import AVERAGE_COLUMNS, UNIT_OF_ROW, Cell, Column, Table, average_cells, words
from sma_bayes.sampling.pareto import MAX_RELIABLE_K
from sma_bayes.studies.compare.schema import ComparedRecord, StatedDifference, StoredComparison
from sma_bayes.studies.compare.words import noise_words, short


def comparison_tables(stored: StoredComparison) -> dict[str, Table]:
    """All tables of a comparison, by name."""
    tables = (
        verdict_table(stored),
        overall_table(stored),
        model_table(stored),
        model_average_table(stored),
        model_correlation_table(stored),
    )
    return {table.name: table for table in tables}


def model_averages(stored: StoredComparison) -> list[tuple[str, AverageFactor]]:
    """Average correlation factors of each model over all records of a channel, in sample and held out.

    Returns
    -------
    list of tuple of str and AverageFactor
        Name of the model, and its average by one rule; over both branches where there are two.
    """
    return [
        (name, factor)
        for group in stored.found.overall
        for name, m in group.models.items()
        for data, entries in (
            ("in sample", m.correlation_average.in_sample),
            ("held out", m.correlation_average.held_out),
        )
        for factor in average_factors(entries[-1], data)
    ]


def model_average_table(stored: StoredComparison) -> Table:
    """Average correlation factor of each model, by every rule."""
    found = model_averages(stored)
    return Table(
        "correlation_average",
        "Average correlation factors",
        f"Over the records in which the model converged: median and {INTERVAL} of the average. Plain: mean of the "
        "records' factors; Fisher: tanh of the mean of artanh r; pooled: one factor over all samples of all records. "
        f"P(r > {PAPER_CORRELATION:g}): posterior probability that the average exceeds what the paper states.",
        (
            *words("channel", "model", "data", "rule"),
            *AVERAGE_COLUMNS,
        ),
        tuple((a.document.quantity, short(name), a.data, a.rule, *average_cells(a)) for name, a in found),
        grouped=2,
    )


def model_correlation_table(stored: StoredComparison) -> Table:
    """Correlation factors of each model on each record, in sample and held out."""
    return Table(
        "correlation",
        "Correlation factors, record by record",
        f"Median and {INTERVAL} over draws of the curve. Held out: each fold is predicted by draws of a fit without "
        "it, and the folds are joined; R² is about the mean of the held-out samples and can be negative. Folds below "
        "their mean: whose own R² is negative, so that their mean tells more than the model does.",
        (
            *words("condition", "branch", "channel", "model"),
            Column("r, in sample", "r_in_sample", "1"),
            Column("r, held out", "r_held_out", "1"),
            Column("R², in sample", "r2_in_sample", "1", brief=False),
            Column("R², held out", "r2_held_out", "1"),
            Column("unit", "unit"),
            Column("RMSE, in sample", "rmse_in_sample", UNIT_OF_ROW, brief=False),
            Column("RMSE, held out", "rmse_held_out", UNIT_OF_ROW),
            Column("folds below their mean", "folds_worse_than_their_mean"),
            Column("folds without r", "folds_without_r", brief=False),
        ),
        tuple(_correlation_rows(stored)),
        grouped=3,
    )


def _correlation_rows(stored: StoredComparison) -> Iterator[tuple[Cell, ...]]:
    for r in stored.found.records:
        for name, m in r.models.items():
            c = m.correlation
            if c is None or m.same_as:
                continue
            folds, (inside, out) = len(c.by_fold), (c.in_sample, c.held_out)
            yield (
                r.condition, r.branch, r.quantity, short(name), Estimate.of(inside.r), Estimate.of(out.r),
                Estimate.of(inside.r2), Estimate.of(out.r2), unit_label(r.unit) or "1",
                Estimate.of(inside.rmse, r.unit), Estimate.of(out.rmse, r.unit),
                f"{c.folds_worse_than_their_mean} of {folds}", f"{c.folds_without_r} of {folds}",
            )  # fmt: skip


def verdict_table(stored: StoredComparison) -> Table:
    """Who wins where."""
    return Table(
        "verdicts",
        "Verdicts",
        "The preferred model has the greatest evidence; the preference is decisive if it is 20 times that of every "
        "model of another family beyond its error and what was held out does not speak against it.",
        (
            *words("condition", "branch", "channel", "verdict", "preferred", "rival"),
            Column("ln Bayes factor", "ln_bayes_factor", "1"),
            Column("noise", "noise", brief=False),
            Column("held out", "held_out"),
            Column("why", "finding", brief=False),
        ),
        tuple(
            (
                r.condition, r.branch, r.quantity, short(r.verdict), short(r.preferred), short(r.rival),
                Number(r.ln_bayes_factor, "1", 0.5), _noise(r), r.held_out.kind, stored.found.reason(r),
            )
            for r in stored.found.records
        ),
    )  # fmt: skip


def _noise(record: ComparedRecord) -> str:
    """Noise of all models, with the number of samples that count as one where it is not one."""
    fewer = f", {record.memory:.1f} samples count as one" if record.memory != 1.0 else ""
    return f"{noise_words(record.noise)}{fewer}"


def overall_table(stored: StoredComparison) -> Table:
    """All records of a channel together."""
    return Table(
        "overall",
        "All records together",
        "Each record has parameters of its own; evidences and held-out folds are added up. Behind the preferred: "
        "held-out log density less that of the preferred model, with its 95 % interval from the scatter of the folds.",
        (
            *words("channel", "verdict", "model"),
            Column("ln evidence", "ln_evidence", "1"),
            Column("held-out log density", "elpd_held_out", "1"),
            Column("behind the preferred", "behind", "1"),
            Column("from", "behind_low", "1"),
            Column("to", "behind_high", "1"),
        ),
        tuple(_overall_rows(stored)),
        grouped=2,
    )


def _overall_rows(stored: StoredComparison) -> Iterator[tuple[Cell, ...]]:
    for group in stored.found.overall:
        for name, m in group.ranked:
            yield (
                group.quantity, short(group.verdict), short(name), Number(m.ln_evidence, "1", 0.5),
                Number(m.elpd_held_out, "1", 0.5), *_behind(m.behind_preferred, name == group.preferred),
            )  # fmt: skip


def _behind(behind: StatedDifference, preferred: bool) -> tuple[Cell, Cell, Cell]:
    if preferred:
        return None, None, None
    value, low, high = (Number(v, "1", 0.5) for v in (behind.value, behind.low, behind.high))
    return value, low, high


def model_table(stored: StoredComparison) -> Table:
    """Every number of every model."""
    return Table(
        "models",
        "Models, record by record",
        "elpd: log density of each sample left out in turn, a sample counted by its share: by weights of the draws "
        f"(PSIS-LOO), or, where their Pareto k is over {MAX_RELIABLE_K}, by a fit without the sample. RMSE and r are "
        "of predictions of held-out folds. A model without numbers of its own has those of another, named beside.",
        (
            *words("condition", "branch", "channel", "model"),
            Column("elpd", "elpd", "1"),
            Column("its se", "elpd_se", "1"),
            Column("effective parameters", "p_eff", "1"),
            Column("ln evidence", "ln_evidence", "1"),
            Column("weight", "weight", "1"),
            Column("held-out log density", "elpd_held_out", "1"),
            Column("held-out RMSE", "rmse_held_out", UNIT_OF_ROW),
            Column("unit", "unit", brief=False),
            Column("held-out r", "r_held_out", "1"),
            Column("greatest Pareto k", "pareto_k_max", "1", brief=False),
            Column("remark", "remark", brief=False),
        ),
        tuple(_model_rows(stored)),
        grouped=3,
    )


def _model_rows(stored: StoredComparison) -> Iterator[tuple[Cell, ...]]:
    for r in stored.found.records:
        for name, m in r.models.items():
            remark = m.unavailable or (f"as {short(m.same_as)}" if m.same_as else "")
            yield (
                r.condition, r.branch, r.quantity, short(name),
                Number(m.elpd, "1", 0.5), Number(m.elpd_se, "1", 0.5), Number(m.p_eff, "1", 0.5),
                Number(m.ln_evidence, "1", 0.5), Number(m.weight, "1", 0.05),
                Number(m.elpd_held_out, "1", 0.5), Number(m.rmse_held_out, r.unit), unit_label(r.unit) or "1",
                Number(m.r_held_out, "1", 1e-4), Number(m.pareto_k_max, "1", 0.05), remark,
            )  # fmt: skip
