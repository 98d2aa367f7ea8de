"""Documents in declared units: what a schema says of its units decides, and it says it of every number."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated

import pytest

from sma_bayes.document_part import UNDER, DocumentPart, In, IntervalDocument, InUnit, Items, Number, UnitOf
from sma_bayes.runs.declared_units import ShownUnit
from sma_bayes.runs.shown import shown_part
from sma_bayes.studies.registry import declared_documents

UNITS = {"force": ShownUnit("N", "mN", 1e3), "temperature": ShownUnit("degC", "degF", 1.8, 32.0)}
NOT_ALL_IN_IT = {("EffectParameter", "prior")}
"""Of a prior the quantiles are in the unit of the parameter, and the numbers of a family need not be."""


def _parts(kind: type[DocumentPart] = DocumentPart) -> Iterator[type[DocumentPart]]:
    for one in kind.__subclasses__():
        yield one
        yield from _parts(one)


def test_every_number_that_is_in_the_unit_of_its_part_is_shown_in_it() -> None:
    """A schema that tells people ``[unit]`` of a number, where the unit is converted, has the number converted too."""
    declared_documents()  # imports all schemas
    forgotten = {
        (part.__name__, name)
        for part in _parts()
        if any(isinstance(m, UnitOf) for f in part.model_fields.values() for m in f.metadata)
        for name, field in part.model_fields.items()
        if (field.description or "").rstrip(".").endswith(("[`unit`]", "[unit]"))
        and not any(isinstance(m, In) for m in field.metadata)
    }
    assert forgotten <= NOT_ALL_IN_IT


class _Value(DocumentPart):
    of: str
    unit: Annotated[str, UnitOf("of")]
    value: InUnit[Number]
    alike: Number


class _Changed(DocumentPart):
    unit: Annotated[str, UnitOf(UNDER, difference=True)]
    by: InUnit[IntervalDocument]
    probability: IntervalDocument


class _Whole(DocumentPart):
    values: Items[_Value]
    changes: dict[str, _Changed]


def test_parts_within_parts_are_shown_as_they_are_declared() -> None:
    """A slope by the quantity that it names, a change by what it stands under; what says nothing stays."""
    by = IntervalDocument(q05=1.0, median=2.0, q95=None)
    shown = shown_part(
        _Whole(
            values=(_Value(of="force", unit="N/degC", value=9.0, alike=9.0),),
            changes={"temperature": _Changed(unit="degC", by=by, probability=by)},
        ),
        UNITS,
    )
    (value,), change = shown.values, shown.changes["temperature"]
    assert (value.unit, value.value, value.alike) == ("mN/degF", pytest.approx(5000.0), 9.0)
    assert (change.unit, change.by.q05, change.by.median, change.by.q95) == ("degF", 1.8, 3.6, None)
    assert change.probability == by
