"""Column names that need no declaration: ``temperature_C``, ``force_N`` and so on."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Final

from sma_bayes.quantities import QUANTITIES, can_convert
from sma_bayes.records.declaration import SETTING_COLUMNS

EXAMPLES: Final = (
    "time_s",
    "temperature_C",
    "force_N",
    "displacement_mm",
    "stiffness_N_per_m",
    "current_A",
    "ambient_temperature_C",
    "cycle",
    "branch",
)
"""The names as they are documented; any other unit may stand at their end."""

_UNIT_OF: Final = {**{name: q.unit for name, q in QUANTITIES.items()}, **SETTING_COLUMNS}
_QUANTITY = "|".join(name.replace("_", "[ _]") for name in sorted(_UNIT_OF, key=len, reverse=True))
_HEADER = re.compile(rf"({_QUANTITY})(?:[ _]*[(\[](.+)[)\]]|[ _]+(.+))?", re.IGNORECASE)
_UNITS = {
    "C": "degC",
    "°C": "degC",
    "K": "kelvin",
    "F": "degF",
    "°F": "degF",
    "pct": "percent",
    "%": "percent",
    "-": "1",
}
_BARE = ("cycle", "branch", "drive")


def recognised(header: str) -> tuple[str, str] | None:
    """Quantity and unit that a column name tells.

    Parameters
    ----------
    header : str
        Name of a quantity, then its unit after an underscore or a blank or in brackets; ``per`` stands for a
        fraction stroke, ``pct`` for percent.

    Returns
    -------
    tuple of (quantity, unit), or None if the name isn't understood.

    Examples
    --------
    >>> recognised("temperature_C"), recognised("stiffness_N_per_m"), recognised("Force [mN]")
    (('temperature', 'degC'), ('stiffness', 'N/m'), ('force', 'mN'))
    >>> recognised("cycle"), recognised("temperature_derivative"), recognised("force_degC")
    (('cycle', '1'), None, None)
    """
    parts = _parts(header)
    if parts is None:
        return None
    quantity, written = parts
    if quantity in _BARE or written is None:
        return (quantity, "1") if quantity in _BARE and written is None else None
    unit = _UNITS.get(written.strip(), written.strip().replace("_per_", "/"))
    kinds = ("N", "kg", "Pa") if quantity == "load" else (_UNIT_OF[quantity],)
    return (quantity, unit) if any(can_convert(unit, kind) for kind in kinds) else None


def described(found: Sequence[tuple[str, str, str]], unused: Sequence[str]) -> str:
    """Sentence about what was recognised.

    Parameters
    ----------
    found : sequence of (header, quantity, unit)
    unused : sequence of str
        Headers that were not.

    Examples
    --------
    >>> described([("force_N", "force", "N")], ["note"])
    "known by their names: 'force_N' as force [N]; not used: 'note'"
    >>> described([("force_N", "force", "N")], ["time_X"])
    "known by their names: 'force_N' as force [N]; not used: 'time_X' ('X' is no unit of time)"
    """
    text = "known by their names: " + ", ".join(f"{h!r} as {q} [{u}]" for h, q, u in found)
    return text + ("; not used: " + ", ".join(map(not_recognised, unused)) if unused else "")


def lacks_unit(header: str) -> bool:
    """Whether a column has the name of a quantity, and no unit behind it."""
    parts = _parts(header)
    return parts is not None and parts[0] not in _BARE and parts[1] is None


def not_recognised(header: str) -> str:
    """Header that was not understood; where it begins as a quantity does, with what is wrong about the rest.

    Examples
    --------
    >>> not_recognised("strain"), not_recognised("force_degC"), not_recognised("note")
    ("'strain' (which unit?)", "'force_degC' ('degC' is no unit of force)", "'note'")
    """
    parts = _parts(header)
    if parts is None or parts[0] in _BARE:
        return repr(header)
    quantity, written = parts
    wrong = f"{written!r} is no unit of {quantity}" if written else "which unit?"
    return f"{header!r} ({wrong})"


def _parts(header: str) -> tuple[str, str | None] | None:
    """Quantity, and what is written behind it if anything is; None where a column begins with no quantity."""
    match = _HEADER.fullmatch(header.strip())
    if match is None:
        return None
    return match.group(1).lower().replace(" ", "_"), match.group(2) or match.group(3)
