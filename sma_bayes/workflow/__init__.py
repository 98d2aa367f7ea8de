"""The workflow: what each verb does, from a campaign or a finished run to files.

The names below are the public ones, in the order in which a study goes; each is imported from its module when it is
first used.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

_PLACES = {
    "inspect_campaign": "inspection",
    "fit": "campaign_fit",
    "fit_campaign": "campaign_fit",
    "compare": "comparison",
    "study_gap": "gap_study",
    "study_conditions": "condition_study",
    "ask": "question",
    "diff": "difference",
    "run_study": "study",
}

__all__ = list(_PLACES)


def __getattr__(name: str) -> Any:
    if name in _PLACES:
        return getattr(import_module(f"{__name__}.{_PLACES[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return list(__all__)
