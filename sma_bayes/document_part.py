"""Parts of documents: what is told of a result, declared once where it is found.

From a declaration come the JSON that is written, the JSON Schema of it, the typed reader and the table of its keys in
the reference. A key without a default is always there; one with a default is written only where it was given.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Final, Self, TypeVar

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, GetPydanticSchema, Strict, ValidationError, WithJsonSchema
from pydantic_core.core_schema import no_info_plain_validator_function

from sma_bayes.errors import OutputError

T = TypeVar("T")


def plain(value: Any) -> Any:
    """Value as JSON knows it; what is not finite becomes null."""
    if isinstance(value, Mapping):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple | np.ndarray):
        return [plain(v) for v in value]
    if isinstance(value, bool | np.bool_):
        return bool(value)
    if isinstance(value, int | np.integer):
        return int(value)
    if isinstance(value, float | np.floating):
        return float(value) if np.isfinite(value) else None
    return value if value is None else str(value)


def _finite(value: object) -> Any:
    """Number of Python; a whole one stays whole, so that it is written as it came."""
    if type(value) is float and math.isfinite(value):  # nearly all are, in documents of thousands of records
        return value
    found = plain(value)
    if isinstance(found, bool | str) or not isinstance(found, int | float):
        raise ValueError("a finite number")
    return found


def _finite_or_null(value: object) -> Any:
    if value is None or (isinstance(value, float) and not math.isfinite(value)):
        return None
    return _finite(value)


def _as_it_is(check: Callable[[object], Any]) -> GetPydanticSchema:
    """What a check gives, written without another conversion."""
    return GetPydanticSchema(lambda source, handler: no_info_plain_validator_function(check))


Items = Annotated[tuple[T, ...], Strict(False)]
"""A list of JSON."""
Number = Annotated[float, _as_it_is(_finite), WithJsonSchema({"type": "number"})]
"""A finite number."""
NumberOrNull = Annotated[
    float | None, _as_it_is(_finite_or_null), WithJsonSchema({"type": ["number", "null"]})
]
"""A number; null where it is not told, or is not finite."""


@dataclass(frozen=True, slots=True)
class UnitOf:
    """What a unit that a part states is of, which decides how people see it; see `sma_bayes.runs.shown`.

    Attributes
    ----------
    of : str or callable
        Key with the channel, quantity or setting that is the first factor, or what tells it of the part: empty where
        there is none, None where the unit is a product of any of them. `UNDER`: what the part stands under.
    difference : bool or callable
        Whether a temperature is the difference of two.
    """

    of: str | Callable[[Any], str | None] = ""
    difference: bool | Callable[[Any], bool] = False


@dataclass(frozen=True, slots=True)
class In:
    """In which unit a number is, or all that a part within this one has in its unit.

    Attributes
    ----------
    key : str
        Key of the part with the unit, where it has one, else of the part around it; or a unit of temperature, or a
        setting.
    difference : bool
        Whether it is the difference of two.
    unless : str
        Key that says, where true, that it is in none of these.
    """

    key: str = "unit"
    difference: bool = False
    unless: str = ""


UNDER: Final = "."
TemperatureUnit = Annotated[str, UnitOf()]
"""A unit of temperature."""
UnitOfQuantity = Annotated[str, UnitOf("quantity")]
"""A unit of the quantity that its part names."""
UnitOfChannel = Annotated[str, UnitOf("channel")]
"""A unit of the channel that its part names."""
InUnit = Annotated[T, In()]
"""In the unit of the part."""
Temperature = Annotated[T, In("degC")]
"""A temperature."""
Kelvins = Annotated[T, In("K")]
"""A difference of temperatures."""


class DocumentPart(BaseModel):
    """A part of a document: immutable, its keys declared; keys of later versions are kept as they are."""

    model_config = ConfigDict(frozen=True, extra="allow", strict=True, populate_by_name=True)

    def as_json(self) -> dict[str, Any]:
        """The part as values that JSON knows, in the order of the declaration."""
        return self.model_dump(mode="json", by_alias=True, exclude_unset=True)

    @classmethod
    def about(cls, source: object, /, **told: Any) -> Self:
        """The part that tells of something: what is not given is its attribute of the same name.

        Parameters
        ----------
        source : object
            What the part tells of.
        **told
            Keys that are called otherwise there, or that are converted.
        """
        own = (n for n, f in cls.model_fields.items() if n not in told and f.alias not in told)
        same = {n: getattr(source, n) for n in own if hasattr(source, n)}
        return cls.model_validate(same | told, from_attributes=True)

    def but(self, /, **changed: object) -> Self:
        """The same part with other values of some keys, which are not checked again."""
        return self.model_copy(update=changed)

    @classmethod
    def read_as(cls, found: Mapping[str, Any], path: Path, expected: str, remedy: str) -> Self:
        """The part of a document that was read.

        Parameters
        ----------
        found : mapping
            As parsed.
        path : Path
            File of the document, for messages.
        expected, remedy : str
            See `OutputError`.

        Raises
        ------
        OutputError
            With the key, where one is missing or of another kind.
        """
        try:
            return cls.model_validate(found)
        except ValidationError as error:
            first = error.errors()[0]
            *above, key = (str(name) for name in first["loc"]) if first["loc"] else ("",)
            where = f" in {'.'.join(above)}" if above else ""
            if first["type"] == "missing":
                told = f"lacks {key!r}{where}"
            else:
                wanted = first["msg"].removeprefix("Value error, ").removeprefix("Input should be ")
                told = f"has {first['input']!r:.200} as {key!r}{where}, not {wanted}"
            raise OutputError(told, file=path, expected=expected, remedy=remedy) from None


class IntervalDocument(DocumentPart):
    """Equal-tailed 90 % interval and median; null where not told."""

    q05: InUnit[NumberOrNull] = Field(description="lower end")
    median: InUnit[NumberOrNull] = Field(description="median")
    q95: InUnit[NumberOrNull] = Field(description="upper end")

    @property
    def quantiles(self) -> tuple[float, float, float]:
        """The three, least first; NaN where not told."""
        low, median, high = (math.nan if q is None else q for q in (self.q05, self.median, self.q95))
        return low, median, high
