"""What the effect of an erratum is made of."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Amount:
    """One number that an erratum amounts to, recomputed from what is printed.

    Attributes
    ----------
    name : str
        What it is.
    value : float
        Recomputed value [unit].
    unit : str
        ``"1"`` where it has none.
    claimed : str
        The digits that the list of errata beside the text states for it; empty where it states none.
    """

    name: str
    value: float
    unit: str = "1"
    claimed: str = ""

    @property
    def agrees(self) -> bool | None:
        """True where the value rounds to what is claimed, None where nothing is.

        Examples
        --------
        >>> Amount("ratio", 0.99788, claimed="0.9979").agrees, Amount("ratio", 9.807, claimed="10").agrees
        (True, True)
        >>> Amount("ratio", 950.0, claimed="1000").agrees
        False
        """
        if not self.claimed:
            return None
        digits, _, power = self.claimed.partition("e")
        decimals = len(digits.partition(".")[2])
        step = 10.0 ** (int(power or 0) - decimals)
        return abs(self.value - float(self.claimed)) <= 0.5 * step * (1 + 1e-9)


Effect = Callable[[], tuple[Amount, ...]]
"""Recomputes what an erratum amounts to."""
