"""Write what the reference has from the declarations of documents: JSON Schemas, and tables of keys in `files.md`.

python scripts/make_reference.py          # writes
python scripts/make_reference.py --check  # tells what is not as it would be written, with exit status 1
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from sma_bayes.runs.schema import json_schema
from sma_bayes.studies.registry import declared_documents

REFERENCE = Path(__file__).parents[1] / "docs" / "reference"
PAGE = REFERENCE / "files.md"
KINDS = {"string": "text", "boolean": "true or false", "integer": "whole number", "number": "number"}


def written() -> dict[Path, str]:
    """Every file that is made, as it should be."""
    schemas = {verb: json_schema(model) for verb, model in declared_documents().items()}
    files = {
        REFERENCE / "schemas" / f"{verb}.schema.json": json.dumps(schema, indent=1, ensure_ascii=False) + "\n"
        for verb, schema in schemas.items()
    }
    return {**files, PAGE: with_tables(PAGE.read_text(encoding="utf-8"), schemas)}


def with_tables(page: str, schemas: Mapping[str, dict[str, Any]]) -> str:
    """The page with the tables of keys between its marks."""
    for verb, schema in schemas.items():
        mark, end = f"<!-- keys of {verb} -->\n", f"<!-- end of keys of {verb} -->\n"
        before, found, rest = page.partition(mark)
        if not found or end not in rest:
            raise SystemExit(f"{PAGE.name} has no place for the keys of {verb}: {mark}{end}")
        page = before + mark + "".join(tables(verb, schema)) + end + rest.partition(end)[2]
    return page


def tables(verb: str, schema: Mapping[str, Any]) -> Iterator[str]:
    """A table of keys for the document and for each of its parts, in the order in which they are met."""
    parts = schema.get("$defs", {})
    yield f"\n[JSON Schema](schemas/{verb}.schema.json) of what follows.\n"
    waiting, seen = [("", schema)], set()
    while waiting:
        where, part = waiting.pop(0)
        yield f"\n{heading(where, part)}\n\n| key | holds | meaning |\n|---|---|---|\n"
        for key, told in part["properties"].items():
            place = f"{where}.{key}" if where else key
            for inner, name in places(told, place):
                if name not in seen:
                    seen.add(name)
                    waiting.append((inner, parts[name]))
            yield f"| `{key}` | {kind(told, key in part.get('required', ()))} | {told['description']} |\n"
    yield "\n"


def heading(where: str, part: Mapping[str, Any]) -> str:
    """Which part of the document a table is of."""
    told = re.sub(r"\s+", " ", part["description"])
    return f"`{where}`: {told[0].lower() + told[1:]}" if where else told


def alternatives(told: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """What a value may be."""
    return list(told.get("anyOf", [told]))


def kind(told: Mapping[str, Any], always: bool) -> str:
    """What a value is, in words."""
    found = list(dict.fromkeys(name for one in alternatives(told) for name in kinds(one)))
    return " or ".join(found) if always else f"{' or '.join(n for n in found if n != 'null')}; may be missing"


def kinds(one: Mapping[str, Any]) -> Iterator[str]:
    if "$ref" in one:
        yield "keys below"
    elif "const" in one:
        yield f"`{one['const']}`"
    elif "enum" in one:
        yield " or ".join(f"`{value}`" for value in one["enum"])
    elif one.get("type") == "array":
        yield f"list of {inside(one.get('items', {}))}"
    elif one.get("type") == "object":
        yield f"by name: {inside(one.get('additionalProperties', {}))}"
    else:
        types = one.get("type", "any value")
        yield from (KINDS.get(t, t) for t in ([types] if isinstance(types, str) else types))


def inside(told: Any) -> str:
    return kind(told, True) if isinstance(told, Mapping) and told else "any value"


def places(told: Mapping[str, Any], where: str) -> Iterator[tuple[str, str]]:
    """Parts that stand under a key: where, and their names."""
    for one in alternatives(told):
        if "$ref" in one:
            yield where, one["$ref"].rpartition("/")[2]
        elif one.get("type") == "array":
            yield from places(one.get("items", {}), f"{where}[]")
        elif isinstance(one.get("additionalProperties"), Mapping):
            yield from places(one["additionalProperties"], f"{where}.NAME")


def main() -> None:
    wrong = {
        path: text
        for path, text in written().items()
        if not path.is_file() or path.read_text(encoding="utf-8") != text
    }
    if "--check" in sys.argv:
        raise SystemExit("\n".join(f"{path} is not as declared" for path in wrong) or 0)
    for path, text in wrong.items():
        path.parent.mkdir(exist_ok=True)
        path.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
