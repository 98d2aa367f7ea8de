"""Tables of a comparison."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Final

from sma_bayes.report.comparison_outputs import StoredComparison
from sma_bayes.report.content import Number
from sma_bayes.report.tables import OF_ROW, Cell, Column, Table

SHORT: Final[Mapping[str, str]] = {
    "modified_sigmoid": "modified sigmoid",
    "modified_sigmoid_tied": "modified sigmoid, A2 = B2",
    "logistic_published": "logistic, published",
    "logistic_corrected": "logistic, corrected",
    "logistic_refitted": "logistic, refitted",
    "polynomial_published": "polynomial, published",
    "polynomial_corrected": "polynomial, corrected",
    "polynomial_refitted": "polynomial, refitted",
    "bounded_logistic": "bounded logistic",
}
"""Models, briefly."""


def comparison_tables(stored: StoredComparison) -> dict[str, Table]:
    """All tables of a comparison, by name."""
    tables = (verdict_table(stored), overall_table(stored), model_table(stored))
    return {table.name: table for table in tables}


def verdict_table(stored: StoredComparison) -> Table:
    """Who wins where."""
    return Table(
        "verdicts",
        "Verdicts",
        "The preferred model has the greatest evidence; the preference is decisive if it is 20 times that of every "
        "model of another family beyond its error and what was held out does not speak against it.",
        (
            Column("condition", "condition"),
            Column("branch", "branch"),
            Column("channel", "channel"),
            Column("verdict", "verdict"),
            Column("preferred", "preferred"),
            Column("rival", "rival"),
            Column("ln Bayes factor", "ln_bayes_factor", "1"),
            Column("samples that count as one", "memory", "1", brief=False),
            Column("held out", "held_out"),
            Column("why", "finding", brief=False),
        ),
        tuple(
            (
                r["condition"], r["branch"], r["quantity"], r["verdict"], SHORT[r["preferred"]],
                SHORT.get(r["rival"], ""), Number(r["ln_bayes_factor"], "1", 0.5), Number(r["memory"], "1", 0.5),
                r["held_out"]["kind"], r["why"],
            )
            for r in stored.found["records"]
        ),
    )  # fmt: skip


def overall_table(stored: StoredComparison) -> Table:
    """All records of a channel together."""
    return Table(
        "overall",
        "All records together",
        "Each record has parameters of its own; evidences and held-out folds are added up. Behind: held-out log "
        "density less that of the preferred model, with its 95 % interval from the scatter of the folds.",
        (
            Column("channel", "channel"),
            Column("verdict", "verdict"),
            Column("model", "model"),
            Column("ln evidence", "ln_evidence", "1"),
            Column("held-out log density", "elpd_held_out", "1"),
            Column("behind", "behind", "1"),
            Column("from", "behind_low", "1"),
            Column("to", "behind_high", "1"),
        ),
        tuple(_overall_rows(stored)),
        grouped=2,
    )


def _overall_rows(stored: StoredComparison) -> Iterator[tuple[Cell, ...]]:
    for group in stored.found["overall"]:
        ranked = sorted(group["models"].items(), key=lambda item: -item[1]["ln_evidence"])
        for name, m in ranked:
            behind = m["behind_preferred"]
            yield (
                group["channel"], group["verdict"], SHORT[name], Number(m["ln_evidence"], "1", 0.5),
                Number(m["elpd_held_out"], "1", 0.5), *_behind(behind, name == group["preferred"]),
            )  # fmt: skip


def _behind(behind: Mapping[str, Any], preferred: bool) -> tuple[Cell, Cell, Cell]:
    if preferred:
        return None, None, None
    value, low, high = (Number(behind[k], "1", 0.5) for k in ("value", "low", "high"))
    return value, low, high


def model_table(stored: StoredComparison) -> Table:
    """Every number of every model."""
    return Table(
        "models",
        "Models, record by record",
        "elpd: log density of each sample left out in turn (PSIS-LOO), a sample counted by its share. RMSE and r are "
        "of predictions of held-out folds. A model without numbers of its own has those of another, named beside.",
        (
            Column("condition", "condition"),
            Column("branch", "branch"),
            Column("channel", "channel"),
            Column("model", "model"),
            Column("elpd", "elpd", "1"),
            Column("its se", "elpd_se", "1"),
            Column("effective parameters", "p_eff", "1"),
            Column("ln evidence", "ln_evidence", "1"),
            Column("weight", "weight", "1"),
            Column("held-out log density", "elpd_held_out", "1"),
            Column("held-out RMSE", "rmse_held_out", OF_ROW),
            Column("unit", "unit", brief=False),
            Column("held-out r", "r_held_out", "1"),
            Column("greatest Pareto k", "pareto_k_max", "1", brief=False),
            Column("remark", "remark", brief=False),
        ),
        tuple(_model_rows(stored)),
        grouped=3,
    )


def _model_rows(stored: StoredComparison) -> Iterator[tuple[Cell, ...]]:
    for r in stored.found["records"]:
        head = (r["condition"], r["branch"], r["quantity"])
        for name, m in r["models"].items():
            remark = m["unavailable"] or (f"as {SHORT[m['same_as']]}" if m["same_as"] else "")
            unit = r["unit"]
            yield (
                *head, SHORT[name],
                Number(m["elpd"], "1", 0.5), Number(m["elpd_se"], "1", 0.5), Number(m["p_eff"], "1", 0.5),
                Number(m["ln_evidence"], "1", 0.5), Number(m["weight"], "1", 0.05),
                Number(m.get("elpd_held_out"), "1", 0.5), Number(m["rmse_held_out"], unit), unit,
                Number(m["r_held_out"], "1", 1e-4), Number(m["pareto_k_max"], "1", 0.05), remark,
            )  # fmt: skip
