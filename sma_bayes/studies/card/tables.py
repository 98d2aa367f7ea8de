"""Tables of a card."""

from __future__ import annotations

from sma_bayes.report.content import INTERVAL, Estimate, Number
from sma_bayes.report.notation import unit_label
from sma_bayes.report.tables import OF_ROW, Column, Table
from sma_bayes.studies.card.schema import CardDocument, ConstitutiveCard, StoredCard


def card_tables(stored: StoredCard) -> dict[str, Table]:
    """All tables, by name."""
    found = stored.found
    tables = [_stiffness(found)]
    if found.constitutive is not None:
        tables = [_constants(found.constitutive), _sweeps(found.constitutive), *tables]
    return {t.name: t for t in tables if t.rows}


def _constants(card: ConstitutiveCard) -> Table:
    return Table(
        "constants",
        "Constants of the law",
        f"In the card: the least-squares law. Median and {INTERVAL} of the draws. C_A and C_M are slopes at "
        f"{card.reference_stress:.4g} MPa; transformation temperatures are those of the tangent at half the "
        "transformation.",
        (
            Column("constant", "constant"),
            Column("in the card", "value", OF_ROW),
            Column("posterior", "posterior", OF_ROW),
            Column("unit", "unit"),
            Column("identified", "identified"),
            Column("meaning", "meaning"),
            Column("why not", "why"),
        ),
        tuple(
            (
                c.name,
                Number(c.value, c.unit, 1e-9),
                Estimate.of(c, c.unit),
                unit_label(c.unit) or "1",
                "yes" if c.identified else "no",
                c.meaning,
                c.why,
            )
            for c in (*card.constants, *card.at_reference)
        ),
    )


def _sweeps(card: ConstitutiveCard) -> Table:
    return Table(
        "sweeps",
        "Sweeps and the law",
        f"Median and {INTERVAL}. Misfit: root mean square by which the law differs from the curve of the fit, over its "
        "range: fitted to this sweep alone, and with the constants of the card, whose zero of strain is set for each "
        "sweep.",
        (
            Column("condition", "condition"),
            Column("branch", "branch"),
            Column("stress", "stress", "MPa"),
            Column("start", "start", "K"),
            Column("finish", "finish", "K"),
            Column("transformation strain", "strain", "1"),
            Column("misfit by itself", "alone", "1"),
            Column("misfit of the card", "card", "1"),
            Column("largest misfit", "largest", "1"),
            Column("finished", "finished"),
        ),
        tuple(
            (
                s.condition,
                s.branch,
                Number(s.stress, "MPa", 0.1),
                Estimate.of(s.start, "K"),
                Estimate.of(s.finish, "K"),
                Estimate.of(s.strain, "1"),
                Number(s.alone, "1", 1e-4),
                Number(s.card, "1", 1e-4),
                Number(s.largest, "1", 1e-4),
                "yes" if s.finished else "no",
            )
            for s in card.sweeps
        ),
        grouped=1,
    )


def _stiffness(found: CardDocument) -> Table:
    return Table(
        "tables",
        "Stiffness tables",
        "Rows at even temperatures, 5 %, 50 % and 95 % quantile of the curve. The error is that of linear "
        "interpolation between rows, the largest of the three.",
        (
            Column("condition", "condition"),
            Column("branch", "branch"),
            Column("quantity", "quantity"),
            Column("unit", "unit"),
            Column("rows", "rows"),
            Column("from", "first"),
            Column("step", "step"),
            Column("error", "error", OF_ROW),
            Column("over the stiffness", "relative", "1"),
        ),
        tuple(
            (
                t.condition,
                t.branch,
                t.quantity,
                unit_label(t.unit),
                t.points,
                f"{t.first:.5g} {unit_label(t.temperature_unit)}",
                f"{t.step:.4g} {unit_label(t.temperature_unit)}",
                Number(t.interpolation_error, t.unit, 1e-9),
                Number(t.relative_error, "1", 1e-5),
            )
            for t in found.stiffness
        ),
    )
