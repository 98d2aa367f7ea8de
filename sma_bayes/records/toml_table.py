"""TOML files that a user writes: read, and checked table by table, so that a mistake is told with file and key."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

from sma_bayes.errors import CampaignError, SmaBayesError, near_matches

_IN_TOML: Final = {
    "a valid dictionary": "a table: [name], or { key = value, ... }",
    "a valid list": "a list of tables: each begins with [[name]]",
    "a valid tuple": "a list: [ ... ]",
    "a valid string": "a text in quotation marks",
    "a valid boolean": "true or false",
}
"""What the checking library calls kinds of value, in the words of TOML."""

M = TypeVar("M", bound=BaseModel)


class StrictTable(BaseModel):
    """A table with known keys and kinds of value; anything else is a mistake."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)


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
        If it is not TOML in UTF-8, with the line.
    """
    try:
        return tomllib.loads(content.decode("utf-8-sig"))
    except UnicodeDecodeError as error:
        row = content[: error.start].count(b"\n") + 1
        raise kind(
            "the file is not UTF-8", file=path, row=row, expected="TOML in UTF-8", remedy="save it as UTF-8"
        ) from None
    except tomllib.TOMLDecodeError as error:
        place = re.search(r"\(at line (\d+)", str(error))
        raise kind(
            str(error),
            file=path,
            row=int(place.group(1)) if place else None,
            expected="TOML; texts stand in quotation marks, decimals have a point",
            remedy="correct the line",
        ) from None


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
            found, expected = f"unknown key {key!r}", near_matches(key, model.model_fields)
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
