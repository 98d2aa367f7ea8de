"""The steps of a study on the screen."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def study_text(found: Mapping[str, Any]) -> str:
    """The steps of a study, a line each."""
    lines = [f"{found['campaign']}, seed {found['seed']}"]
    width = max(len(r["step"]) for r in found["steps"])
    for r in found["steps"]:
        told = r["told"] or r["error"].replace("\n", "\n" + " " * (width + 19))
        lines.append(f"  {r['step']:<{width}}  {r['status']:<13}  {told}")
    return "\n".join(lines)
