"""TOML files that a user writes: read, and checked table by table, so that a mistake is told with file and key."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

from sma_bayes.errors import CampaignError, SmaBayesError, near_matches
from sma_bayes.limits import DECLARED_BYTES, DECLARED_DEPTH, INTEGER, TEXT_CHARACTERS

_IN_TOML: Final = {
    "a valid dictionary": "a table: [name], or { key = value, ... }",
    "a valid list": "a list of tables: each begins with [[name]]",
    "a valid tuple": "a list: [ ... ]",
    "a valid string": "a text in quotation marks",
    "a valid boolean": "true or false",
}
"""What the checking library calls kinds of value, in the words of TOML."""

_DEPTH: Final = f"at most {DECLARED_DEPTH.value} tables, lists or parts of a key inside each other"
_PART: Final = r"""(?:[\w-]+|"[^"\n]*"|'[^'\n]*')"""
_LONG_KEY: Final = re.compile(rf"(?<![\w.'\"-])(?:{_PART}[ \t]*\.[ \t]*){{{DECLARED_DEPTH.value}}}{_PART}")
"""A key whose parts the parser would put into each other one by one, in time that grows with their square."""

M = TypeVar("M", bound=BaseModel)


class StrictTable(BaseModel):
    """A table with known keys and kinds of value; anything else is a mistake."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)


def declared_bytes(path: Path) -> bytes:
    """Content of a file that a user writes, as far as it is read at all; `parsed_toml` refuses what is longer."""
    with path.open("rb") as file:
        return file.read(int(DECLARED_BYTES.value) + 1)


def parsed_toml(content: bytes, path: Path, kind: type[SmaBayesError] = CampaignError) -> dict[str, Any]:
    """Parse the content of a TOML file.

    Parameters
    ----------
    content : bytes
    path : Path
        Its name, for messages.
    kind : type of SmaBayesError
        What is raised.

    Raises
    ------
    CampaignError or `kind`
        If it is not TOML in UTF-8, with the line; if it exceeds a limit, see `sma_bayes.limits`.
    """
    if len(content) > DECLARED_BYTES.value:
        raise kind(
            f"the file has more than {DECLARED_BYTES.value} bytes",
            file=path,
            expected="a declaration",
            remedy="keep data in files of their own",
        )
    try:
        text = content.decode("utf-8-sig")
        long_key = _LONG_KEY.search(text)
        if long_key:
            row = text.count("\n", 0, long_key.start()) + 1
            raise kind(
                f"a key of more than {DECLARED_DEPTH.value} parts",
                file=path,
                row=row,
                expected=_DEPTH,
                remedy="correct the line",
            )
        document = tomllib.loads(text)
    except UnicodeDecodeError as error:
        row = content[: error.start].count(b"\n") + 1
        raise kind(
            "the file is not UTF-8", file=path, row=row, expected="TOML in UTF-8", remedy="save it as UTF-8"
        ) from None
    except RecursionError:
        raise kind("tables or lists too deep inside each other", file=path, expected=_DEPTH) from None
    except ValueError as error:  # of TOML, or a whole number of thousands of digits
        place = re.search(r"\(at line (\d+)", str(error))
        raise kind(
            f"is not valid TOML: {error}",
            file=path,
            row=int(place.group(1)) if place else None,
            expected="TOML; texts stand in quotation marks, decimals have a point",
            remedy="correct the line",
        ) from None
    _require_within_limits(document, path, kind)
    return document


def _require_within_limits(document: Mapping[str, Any], path: Path, kind: type[SmaBayesError]) -> None:
    """Refuse values that are nested too deep, too long or too large, with their key."""
    inside: list[tuple[str, Any, int]] = [("", document, 0)]
    while inside:
        where, value, depth = inside.pop()
        wrong = None
        if depth > DECLARED_DEPTH.value:
            wrong = "tables or lists too deep inside each other", _DEPTH
        elif isinstance(value, Mapping):
            inside += [(f"{where}.{key}" if where else key, part, depth + 1) for key, part in value.items()]
            wrong = next((w for key in value if (w := _wrong_text(key))), None)
        elif isinstance(value, list):
            inside += [(where, part, depth + 1) for part in value]
        elif isinstance(value, str):
            wrong = _wrong_text(value)
        elif isinstance(value, int) and abs(value) > INTEGER.value:
            wrong = (
                f"a whole number of {value.bit_length()} bits",
                f"at most {INTEGER.value}, with either sign",
            )
        if wrong:
            raise kind(wrong[0], file=path, column=where[:100] or None, expected=wrong[1])


def _wrong_text(text: str) -> tuple[str, str] | None:
    """What is wrong with a text in a file, and what was expected."""
    if len(text) > TEXT_CHARACTERS.value:
        return f"a text of {len(text)} characters", f"at most {TEXT_CHARACTERS.value}"
    return ("a text with a null character", "a text without") if "\0" in text else None


def checked(
    model: type[M],
    values: Mapping[str, Any],
    *,
    file: Path,
    where: str,
    kind: type[SmaBayesError] = CampaignError,
) -> M:
    """Validate one table of a file.

    Parameters
    ----------
    model : type of BaseModel
    values : mapping
        As parsed.
    file : Path
    where : str
        Place of the table in the file.
    kind : type of SmaBayesError
        What is raised.

    Raises
    ------
    CampaignError or `kind`
        With the file, the key, what was found and what was expected.
    """
    try:
        return model.model_validate(values)
    except ValidationError as error:
        # a typing error in a key shows up twice: as a key that is missing, and as one too many, which tells more
        first = min(error.errors(), key=lambda e: e["type"] != "extra_forbidden")
        key = str(first["loc"][0]) if first["loc"] else ""
        place = ".".join(part for part in (where, key) if part) or None
        if first["type"] == "extra_forbidden":
            found, expected = (
                f"unknown key {key!r}",
                near_matches(key, [f.alias or name for name, f in model.model_fields.items()]),
            )
        elif first["type"] == "missing" and len(first["loc"]) == 1:
            found, expected = f"the key {key!r} is not there", f"{key} = ..."
        else:
            found = f"found {as_toml(first['input'])}"
            expected = first["msg"].removeprefix("Value error, ").removeprefix("Input should be ")
            expected = _IN_TOML.get(expected, expected)
        raise kind(found, file=file, column=place, expected=expected) from None


def as_toml(value: object) -> str:
    """Value as it would stand in the file, shortened."""
    if isinstance(value, Mapping):
        text = "{ " + ", ".join(f"{key} = {as_toml(part)}" for key, part in value.items()) + " }"
    elif isinstance(value, bool):
        text = str(value).lower()
    elif isinstance(value, str):
        text = f'"{value}"'
    else:
        text = str(value)
    return text if len(text) <= 200 else text[:197] + "..."
