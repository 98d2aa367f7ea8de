"""How much a finding about the measurements matters, by its kind."""

from __future__ import annotations

from typing import Final, Literal

Severity = Literal["serious", "look", "note"]
"""``serious``: numbers may be other than they seem; ``look``: rows kept out, or an assumption to confirm; ``note``:
what was done as it should be."""
SEVERITIES: Final[tuple[Severity, ...]] = ("serious", "look", "note")

_SERIOUS: Final = frozenset({
    "branch-contradicted", "clipped", "load-not-constant", "narrow-sweep", "no-branch", "no-transformation",
    "not-constant", "one-branch", "time-restart", "time-reversal", "truncated",
    "copied-readings", "implausible", "kelvin", "large-sd", "misread-decimals", "named-otherwise",
    "same-column", "same-file", "stuck", "swapped",
})  # fmt: skip
_NOTES: Final = frozenset({
    "assumed", "constant-channel", "constant-load", "cut", "held-samples", "hold", "not-fitted", "quantised",
    "recognised", "reduced", "segments", "simulated", "twin", "units",
})  # fmt: skip


def severity(kind: str) -> Severity:
    """How much a kind of finding matters; one that is not known here is worth a look.

    Examples
    --------
    >>> severity("clipped"), severity("spike"), severity("reduced")
    ('serious', 'look', 'note')
    """
    return "serious" if kind in _SERIOUS else "note" if kind in _NOTES else "look"
