"""Tables of a study of moduli."""

from __future__ import annotations

from sma_bayes.quantities import convert
from sma_bayes.report.content import Estimate, Number
from sma_bayes.report.notation import unit_label
from sma_bayes.report.tables import UNIT_OF_ROW, Cell, Column, Table
from sma_bayes.runs.declared_units import shown_unit, units_of
from sma_bayes.studies.modulus.schema import ModulusDocument, ModulusSweep, StoredModulus
from sma_bayes.studies.modulus.shown import degrees_of, parameter_unit

SHOWN_UNIT = "GPa"
LARGE = 1e9
SWEEP = (Column("test", "test"), Column("frequency", "frequency"), Column("branch", "branch"))


def modulus_tables(stored: StoredModulus) -> dict[str, Table]:
    """All tables of a study of moduli, by name."""
    found = stored.found
    tables = (
        _temperatures(found), _shifts(found), _values(found), _by_frequency(found), _curves(found),
        _parameters(found), _damping(found),
    )  # fmt: skip
    return {t.name: t for t in tables}


def modulus_unit(found: ModulusDocument) -> str:
    """Unit in which people see moduli: as they are declared; of those in Pa GPa where they are as large, else MPa."""
    declared = units_of(found).get("modulus")
    if declared is not None:
        return declared.shown
    largest = max((v.median or 0.0 for s in found.sweeps for v in s.values if v.unit == "Pa"), default=0.0)
    return SHOWN_UNIT if largest >= LARGE else "MPa"


def _head(s: ModulusSweep) -> tuple[Cell, ...]:
    return s.test, _frequency(s.frequency), s.branch


def _frequency(value: float | None) -> Cell:
    return None if value is None else f"{value:g} Hz"


def _temperatures(found: ModulusDocument) -> Table:
    columns = (
        *SWEEP, Column("temperature", "temperature"), Column("value", "value", found.temperature_unit),
        Column("draws that have it", "defined", "1"), Column("identified", "identified"),
        Column("meaning", "meaning", brief=False),
    )  # fmt: skip
    rows = tuple(
        (
            *_head(s), t.name.replace("_", " "), Estimate.of(t, found.temperature_unit),
            Number(t.defined, "1", 0.01), "yes" if t.identified else "no", t.meaning,
        )
        for s in found.sweeps for t in s.temperatures
    )  # fmt: skip
    note = (
        "Median and 90 % interval. Identified: 95 % of the draws have it, and the measurements go beyond it on both "
        "sides; else it is an extrapolation, or there is none."
    )
    return Table("temperatures", "Temperatures of the transition", note, columns, rows, 3)


def _shifts(found: ModulusDocument) -> Table:
    degrees = degrees_of(found, difference=True).shown
    columns = (
        Column("branch", "branch"), Column("temperature", "temperature"), Column("sweeps", "sweeps"),
        Column("shift per decade", "shift", degrees), Column("P(rises)", "rises", "1"),
        Column("scatter", "scatter", degrees), Column("apparent activation energy", "energy", "kJ/mol"),
        Column("lower bound, if positive", "least", "kJ/mol"), Column("identified", "identified"),
    )  # fmt: skip
    rows = tuple(
        (
            s.branch, s.temperature.replace("_", " "), len(s.points), Estimate.where_told(s.shift, degrees),
            None if s.probability_rises is None else Number(s.probability_rises, "1", 0.01),
            Estimate.where_told(s.scatter, degrees), Estimate.where_told(s.activation_energy, "kJ/mol", 1e-3),
            None if s.least_energy is None else Number(1e-3 * s.least_energy, "kJ/mol", 1e-4 * s.least_energy),
            "yes" if s.identified else "no",
        )
        for s in found.shifts
    )  # fmt: skip
    note = (
        "Straight line of 1/T over ln f through the temperatures with their posteriors and a scatter between sweeps; "
        "no energy where the interval of the shift holds zero."
    )
    return Table("shifts", "Shift with frequency", note, columns, rows, 2)


def _values(found: ModulusDocument) -> Table:
    unit = modulus_unit(found)
    per = float(convert(1.0, "Pa", unit))
    columns = (
        *SWEEP, Column("at", "at", found.temperature_unit), Column("quantity", "quantity"), Column("unit", "unit"),
        Column("value", "value", UNIT_OF_ROW),
    )  # fmt: skip
    rows = tuple(
        (
            *_head(s), Number(v.at, found.temperature_unit, 0.1), v.channel.replace("_", " "),
            "1" if v.unit == "1" else unit_label(unit),
            Estimate.of(v) if v.unit == "1" else Estimate.of(v, unit, per),
        )
        for s in found.sweeps for v in s.values
    )  # fmt: skip
    return Table(
        "values", "Moduli at temperatures", "Median and 90 % interval of the curve.", columns, rows, 4
    )


def _by_frequency(found: ModulusDocument) -> Table:
    columns = (
        Column("branch", "branch"), Column("at", "at", found.temperature_unit), Column("sweeps", "sweeps"),
        Column("factor per decade", "factor", "1"), Column("P(rises)", "rises", "1"),
    )  # fmt: skip
    rows = tuple(
        (
            b.branch, Number(b.at, found.temperature_unit, 0.1), len(b.sweeps), Estimate.where_told(b.factor, "1"),
            Number(b.probability_rises, "1", 0.01),
        )
        for b in found.by_frequency
    )  # fmt: skip
    note = "Factor of the storage modulus per decade of frequency, with scatter between sweeps."
    return Table("by_frequency", "Storage modulus by frequency", note, columns, rows, 2)


def _curves(found: ModulusDocument) -> Table:
    columns = (
        *SWEEP, Column("curve", "curve"), Column("model", "model"), Column("noise", "noise"),
        Column("discrepancy", "beside"), Column("samples", "samples"), Column("rms misfit", "missed", "1"),
        Column("converged", "converged"), Column("reason", "why", brief=False),
    )  # fmt: skip
    rows = tuple(
        (
            *_head(s), c.channel.replace("_", " "), c.model, c.noise, "smooth function" if c.discrepancy else "none",
            c.n, Number(c.missed, "1", 1e-4), "yes" if c.converged else "no", c.reason,
        )
        for s in found.sweeps for c in s.curves
    )  # fmt: skip
    note = "Rms misfit: root mean square of the residuals of the median curve, over the range of the modulus."
    return Table("curves", "Curves", note, columns, rows, 3)


def _parameters(found: ModulusDocument) -> Table:
    columns = (
        *SWEEP, Column("curve", "curve"), Column("parameter", "parameter"), Column("meaning", "meaning", brief=False),
        Column("unit", "unit"), Column("value", "value", UNIT_OF_ROW),
    )  # fmt: skip
    modulus = shown_unit("Pa", modulus_unit(found))
    rows = tuple(
        (
            *_head(s), c.channel.replace("_", " "), name, p.meaning, unit_label(u.shown) or "1",
            Estimate(u.value(p.median), u.value(p.q05), u.value(p.q95), u.shown),
        )
        for s in found.sweeps for c in s.curves for name, p in c.parameters.items()
        for u in [parameter_unit(name, p, found, modulus)]
    )  # fmt: skip
    return Table("parameters", "Parameters of the curves", "Median and 90 % interval.", columns, rows, 4)


def _damping(found: ModulusDocument) -> Table:
    columns = (
        Column("test", "test"), Column("frequency", "frequency"), Column("rows", "compared"),
        Column("disagree", "disagree"), Column("greatest difference", "greatest", "1"), Column("in row", "row"),
    )  # fmt: skip
    rows = tuple(
        (
            d.test, _frequency(d.frequency), d.compared,
            d.disagree, Number(d.greatest, "1", 1e-5), d.row,
        )
        for d in found.damping
    )  # fmt: skip
    note = (
        "Declared tan delta beside E''/E' of the same row; differences over the greatest tan delta, of which more than "
        "1 % is a disagreement."
    )
    return Table("damping", "Declared tan delta", note, columns, rows, 2)
