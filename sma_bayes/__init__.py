"""Bayesian stiffness of shape memory alloy springs.

    >>> import sma_bayes
    >>> campaign = sma_bayes.twin_campaign()
    >>> campaign.records[0].key
    '1A-10mHz-heating'

The names below are the public ones; each is imported from its module when it is first used, so that
``import sma_bayes`` is quick.
"""

from __future__ import annotations

import ast
from importlib import import_module
from pathlib import Path
from typing import Any

__version__ = "0.1.0"


def _places() -> dict[str, str]:
    """Module of each public name, as the stub that type checkers read states it."""
    stub = ast.parse(Path(__file__).with_suffix(".pyi").read_text(encoding="utf-8"))
    imports = (node for node in stub.body if isinstance(node, ast.ImportFrom))
    return {name.name: f"{__name__}.{node.module}" for node in imports for name in node.names}


_PLACES = _places()
__all__ = ["__version__", *sorted(_PLACES)]


def __getattr__(name: str) -> Any:
    if name in _PLACES:
        return getattr(import_module(_PLACES[name]), name)
    raise AttributeError(f"module 'sma_bayes' has no attribute {name!r}")


def __dir__() -> list[str]:
    return list(__all__)
