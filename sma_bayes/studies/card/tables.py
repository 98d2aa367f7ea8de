"""Tables of a card."""

from __future__ import annotations

from sma_bayes.report.content import INTERVAL, Estimate, Number
from sma_bayes.report.notation import unit_label
from sma_bayes.report.tables import UNIT_OF_ROW, Column, Table, table_of
from sma_bayes.runs.shown import in_declared_units
from sma_bayes.studies.card.schema import CardDocument, ConstitutiveCard, StoredCard


def card_tables(stored: StoredCard) -> dict[str, Table]:
    """All tables, by name."""
    found = in_declared_units(stored.found)
    tables = [_stiffness(found)]
    if found.constitutive is not None:
        tables = [_constants(found.constitutive), _sweeps(found.constitutive), *tables]
    return {t.name: t for t in tables if t.rows}


def _constants(card: ConstitutiveCard) -> Table:
    return table_of(
        "constants",
        "Constants of the law",
        f"In the card: the least-squares law. Median and {INTERVAL} of the draws. C_A and C_M are slopes at "
        f"{card.reference_stress:.4g} MPa; transformation temperatures are those of the tangent at half the "
        "transformation.",
        [(c,) for c in (*card.constants, *card.at_reference)],
        (Column("constant", "constant"), lambda c: c.name),
        (
            Column("in the card", "value", UNIT_OF_ROW),
            lambda c: Number(c.value, c.unit, 1e-3 * abs(c.value) or 10.0),
        ),
        (Column("posterior", "posterior", UNIT_OF_ROW), lambda c: Estimate.of(c, c.unit)),
        (Column("unit", "unit"), lambda c: unit_label(c.unit) or "1"),
        (Column("identified", "identified"), lambda c: "yes" if c.identified else "no"),
        (Column("meaning", "meaning"), lambda c: c.meaning),
        (Column("why not", "why"), lambda c: c.why),
    )


def _sweeps(card: ConstitutiveCard) -> Table:
    return table_of(
        "sweeps",
        "Sweeps and the law",
        f"Median and {INTERVAL}. Misfit: root mean square by which the law differs from the curve of the fit, over its "
        "range: fitted to this sweep alone, and with the constants of the card, whose zero of strain is set for each "
        "sweep.",
        [(s,) for s in card.sweeps],
        (Column("condition", "condition"), lambda s: s.condition),
        (Column("branch", "branch"), lambda s: s.branch),
        (Column("stress", "stress", "MPa"), lambda s: Number(s.stress, "MPa", 0.1)),
        (Column("start", "start", "K"), lambda s: Estimate.of(s.start, "K")),
        (Column("finish", "finish", "K"), lambda s: Estimate.of(s.finish, "K")),
        (Column("transformation strain", "strain", "1"), lambda s: Estimate.of(s.strain, "1")),
        (Column("misfit by itself", "alone", "1"), lambda s: Number(s.alone, "1", 1e-4)),
        (Column("misfit of the card", "card", "1"), lambda s: Number(s.card, "1", 1e-4)),
        (Column("largest misfit", "largest", "1"), lambda s: Number(s.largest, "1", 1e-4)),
        (Column("finished", "finished"), lambda s: "yes" if s.finished else "no"),
        grouped=1,
    )


def _two_digits(error: float | None, unit: str) -> Number:
    """An error, of which more digits tell nothing."""
    return Number(error, unit, 0.5 * abs(error or 0.0) or None)


def _stiffness(found: CardDocument) -> Table:
    return table_of(
        "tables",
        "Stiffness tables",
        "Rows at even temperatures, 5 %, 50 % and 95 % quantile of the curve. The error is that of linear "
        "interpolation between rows, the largest of the three.",
        [(t, unit_label(t.temperature_unit)) for t in found.stiffness],
        (Column("condition", "condition"), lambda t, degrees: t.condition),
        (Column("branch", "branch"), lambda t, degrees: t.branch),
        (Column("quantity", "quantity"), lambda t, degrees: t.quantity),
        (Column("unit", "unit"), lambda t, degrees: unit_label(t.unit)),
        (Column("rows", "rows"), lambda t, degrees: t.points),
        (Column("from", "first"), lambda t, degrees: f"{t.first:.5g} {degrees}"),
        (Column("step", "step"), lambda t, degrees: f"{t.step:.4g} {degrees}"),
        (
            Column("error", "error", UNIT_OF_ROW),
            lambda t, degrees: _two_digits(t.interpolation_error, t.unit),
        ),
        (
            Column("over the stiffness", "relative", "1"),
            lambda t, degrees: _two_digits(t.relative_error, "1"),
        ),
    )
