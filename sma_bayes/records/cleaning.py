"""The rows that a quality check keeps out of the records, and what is only reported."""

from __future__ import annotations

from typing import Final

import numpy as np

from sma_bayes.arrays import Ints
from sma_bayes.errors import many
from sma_bayes.records.ledger import Ledger
from sma_bayes.records.quality import (
    CHANNEL_WINDOW,
    TEMPERATURE_WINDOW,
    clipped,
    digit,
    out_of_order,
    repeated_rows,
    spikes,
    zero_dropouts,
)

CHANNEL_STEPS: Final = 10.0
"""A zero in a channel is a drop-out when it is this many usual steps from its neighbours: zero may be
real."""
STALLED_ROWS: Final = 4
"""Rows in a row with one time stamp, most of all that there are, from which on a logger stalled."""
MAX_SHARE_MISSING: Final = 0.5
"""A column that is missing in more than this share of the rows is left out, rather than the rows."""


def clean_rows(ledger: Ledger) -> None:
    """Keep out rows without a temperature or with a spoilt one, repeated rows, and rows out of order in time."""
    name = "temperature"
    missing = np.flatnonzero(~np.isfinite(ledger.run.columns[name]))
    ledger.keep_out(missing, "missing", "no temperature", column=name)
    if not ledger.kept.any():
        return
    time = ledger.run.columns.get("time")
    clock = time is not None and bool(np.isfinite(time).mean() >= MAX_SHARE_MISSING)
    if time is not None and clock:
        ledger.keep_out(np.flatnonzero(~np.isfinite(time)), "missing", "no time", column="time")
    _clean_repeats(ledger, clock)
    if clock:
        _clean_time(ledger)
    zero = ledger.rows[zero_dropouts(ledger.column(name))]
    why = "temperature reads exactly 0 far from its neighbours, a missing reading coded as 0"
    ledger.keep_out(zero, "drop-out", why, column=name)
    spike = ledger.rows[spikes(ledger.column(name), TEMPERATURE_WINDOW)]
    ledger.keep_out(spike, "spike", "temperature jumps away from its neighbours and back", column=name)


def _clean_repeats(ledger: Ledger, clock: bool) -> None:
    columns = [ledger.column(name) for name in ledger.run.columns if not (clock and name == "time")]
    repeated, held = repeated_rows(columns, ledger.column("time") if clock else None)
    index = ledger.rows
    ledger.keep_out(index[repeated], "duplicate", "an earlier row is repeated in every column")
    if held:
        message = f"{held} of {index.size} rows repeat the row before them: the channels are refreshed more "
        ledger.note(index[:0], "held-samples", message + "slowly than they are stored")


def _clean_time(ledger: Ledger) -> None:
    astray, restart = out_of_order(ledger.column("time"))
    index = ledger.rows
    ledger.keep_out(index[astray], "time-reversal", "time runs backwards", column="time")
    if restart.size:
        often = "once" if restart.size == 1 else f"{restart.size} times"
        message = f"the clock starts again {often}; each stretch is split on its own"
        ledger.note(index[restart], "time-restart", message, column="time")
    tied = np.flatnonzero(np.diff(ledger.column("time")) == 0) + 1
    if tied.size:
        longest = int(np.unique(ledger.column("time"), return_counts=True)[1].max()) - 1
        stalled = f"the clock stood still for {longest} of them on end, as a logger that stalls leaves it"
        why = stalled if longest >= STALLED_ROWS and 2 * longest > tied.size else "time has too few digits"
        message = f"{many(tied.size, 'row')} with the time stamp of the row before: {why}"
        ledger.note(ledger.rows[tied], "repeated-time", message, column="time")


def clean_channel(ledger: Ledger, channel: str) -> None:
    """Keep out rows in which a channel to fit is missing, drops out to zero, or has a spike.

    Parameters
    ----------
    ledger : Ledger
    channel : str
        Name of the column.
    """
    name = ledger.quantity(channel)
    missing = ledger.rows[~np.isfinite(ledger.column(channel))]
    ledger.keep_out(missing, "missing", f"no {name}", column=channel)
    zero = ledger.rows[zero_dropouts(ledger.column(channel), steps=CHANNEL_STEPS, follow_up=False)]
    why = f"{name} reads exactly 0 far from its neighbours, a missing reading coded as 0"
    ledger.keep_out(zero, "drop-out", why, column=channel)
    spike = spikes(ledger.column(channel), CHANNEL_WINDOW, against=ledger.column("temperature"))
    why = f"{name} jumps away from its neighbours and back"
    ledger.keep_out(ledger.rows[spike], "spike", why, column=channel)


def note_digits(ledger: Ledger, column: str, rows: Ints) -> None:
    """Report a column that is quantised or clipped in the given rows; both stay in.

    A quantised value is still the best one there is. A clipped one is not, but where a saturated channel ends
    and a true plateau begins is for the user to say.

    Parameters
    ----------
    ledger : Ledger
    column : str
    rows : ndarray of int
        Positions in the run, in order.
    """
    values = ledger.run.columns[column][rows]
    rows, values = rows[np.isfinite(values)], values[np.isfinite(values)]
    name, step = ledger.quantity(column), digit(values)
    if step > 0:
        message = f"{name} comes in steps of {ledger.amount(column, step, difference=True)}"
        ledger.note(rows[:0], "quantised", message, column=column)
    for top in clipped(values):
        message = (
            f"{name} stays at its extreme {ledger.amount(column, top.value)} in {many(top.count, 'row')}, entered "
            "or left at full pace, as at the end of a sensor's range; the rows stay in"
        )
        ledger.note(rows[top.start : top.stop], "clipped", message, column=column)
