"""Which figures are drawn: of a campaign of thousands nobody looks at those of every record."""

from __future__ import annotations

from typing import Literal

from sma_bayes.errors import UnknownNameError, near_matches

Drawn = Literal["all", "campaign", "none"]
"""``all``: those of the campaign, of each condition and of each record; ``campaign``: only the first; ``none``: no
figures and no report."""

AUTO = "auto"
MANY = 100
"""Number of records above which `AUTO` draws the figures of the campaign only."""


def figures_for(choice: str | bool, records: int) -> Drawn:
    """What is drawn for a campaign.

    Parameters
    ----------
    choice : str or bool
        ``all``, ``campaign``, ``none``, or ``auto``: ``all`` up to `MANY` records, ``campaign`` beyond. True stands for
        ``auto``, False for ``none``.
    records : int

    Raises
    ------
    UnknownNameError
        If it is none of them.

    Examples
    --------
    >>> figures_for("auto", 18), figures_for("auto", 2000), figures_for("all", 2000)
    ('all', 'campaign', 'all')
    """
    if choice is True or choice == AUTO:
        return "all" if records <= MANY else "campaign"
    if choice == "all":
        return "all"
    if choice == "campaign":
        return "campaign"
    if choice is False or choice == "none":
        return "none"
    known = (AUTO, "all", "campaign", "none")
    raise UnknownNameError(
        f"there is no choice of figures {choice!r}", expected=near_matches(str(choice), known)
    )
