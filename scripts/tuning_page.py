"""Table of the constants that tune the sampler, from the modules that use them.

python scripts/tuning_page.py          # print the page
python scripts/tuning_page.py --write  # into docs/reference/tuning.md
"""

from __future__ import annotations

import argparse
import ast
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "reference" / "tuning.md"
OF_POSTERIORS = ("abilities", "first_proposals", "posterior_coordinates", "normal_equations")
MODULES = (
    *sorted(p for p in (ROOT / "sma_bayes" / "sampling").glob("*.py") if p.name != "__init__.py"),
    *(ROOT / "sma_bayes" / "fitting" / f"{name}.py" for name in OF_POSTERIORS),
)
HEAD = """\
# Constants of the sampler

What tunes the [sampler](../explanation/sampling.md), gathered from the modules that use it by `scripts/tuning_page.py`.
They decide how many evaluations a run takes, when it turns to another stage and what its audit lets pass, never the
density that is sampled. What a run is asked for (R-hat, effective sample size, ensembles, walkers) is `Plan` and
`Target`. Efficiency is the share of weighted draws that count.
"""


@dataclass(frozen=True, slots=True)
class Constant:
    """Constants that one text explains.

    Attributes
    ----------
    name, value, meaning : str
    """

    name: str
    value: str
    meaning: str


def constants(module: Path) -> Iterator[Constant]:
    """Constants of a module: assignments to capitals, with the text below them.

    Raises
    ------
    ValueError
        If one has no text.
    """
    waiting: list[tuple[str, str]] = []
    for node in ast.parse(module.read_text(encoding="utf-8")).body:
        target = node.targets[0] if isinstance(node, ast.Assign) else getattr(node, "target", None)
        name = "" if target is None else ast.unparse(target).strip("()")
        if re.fullmatch(r"[A-Z][A-Z0-9_, ]*", name) and not isinstance(node.value, ast.DictComp):
            values = node.value.elts if isinstance(target, ast.Tuple) else [node.value]
            waiting.append((name, ", ".join(map(ast.unparse, values))))
        elif isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and waiting:
            names, values = (", ".join(each) for each in zip(*waiting, strict=True))
            yield Constant(names, values, " ".join(str(node.value.value).split()))
            waiting = []
        elif waiting:
            raise ValueError(f"{module.name}: no text below {waiting[-1][0]}")


def page() -> str:
    """The page, as Markdown."""
    parts = [HEAD]
    for module in MODULES:
        rows = [
            f"| `{c.name}` | `{c.value}` | {c.meaning.replace('|', chr(92) + '|')} |"
            for c in constants(module)
        ]
        if rows:
            parts.append(
                f"\n## `{module.relative_to(ROOT)}`\n\n| constant | value | what it does |\n|---|---|---|\n"
            )
            parts.append("\n".join(rows) + "\n")
    return "".join(parts)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--write", action="store_true", help=f"write {PAGE.relative_to(ROOT)}")
    if parser.parse_args().write:
        PAGE.write_text(page(), encoding="utf-8")
    else:
        print(page(), end="")
