"""The records of the worked examples, and what is held out of them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sma_bayes.arrays import Floats
from sma_bayes.assess.held_out import part
from sma_bayes.records.campaign import read_campaign
from sma_bayes.records.types import Record

EXAMPLES: Final = Path(__file__).resolve().parents[2] / "docs" / "examples"
SETS: Final = {
    "flexinol_isobaric": "Flexinol",
    "smareact_nitico_isobaric": "NiTiCo",
    "smareact_isobaric_7cycle": "seven cycles",
    "nitihf_sparse_isobaric": "NiTiHf",
    "niti_raw_isobaric": "NiTi, raw",
    "guarneros_spring_force": "spring force",
    "wire_in_water": "wire in water",
}
"""Sets with a temperature and a response, by the name of the example that declares them, each with a name for people.

The other sets of the collection have no temperature beside the response."""
BLOCKS: Final = 20
"""Blocks of neighbouring samples that a record is cut into."""
FOLDS: Final = 5
"""Every fifth block is held out together."""
FEWEST_SWEEPS: Final = 3
"""Sweeps from which on whole sweeps are held out, too."""
Mask = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class Measured:
    """A record and where it comes from.

    Attributes
    ----------
    example : str
    record : Record
        Of one channel.
    sweeps : int
        Uninterrupted sweeps that it joins.
    """

    example: str
    record: Record
    sweeps: int

    @property
    def key(self) -> str:
        """Name that no other record has."""
        return f"{self.example}/{self.record.key}"

    @property
    def channel(self) -> str:
        """The one channel."""
        (channel,) = self.record.channels
        return channel

    @property
    def size(self) -> float:
        """Range of the readings [unit of the channel]."""
        return float(np.ptp(self.record.observed[self.channel]))


def measured_records(data: Path) -> Iterator[Measured]:
    """Records of all sets; of the seven cycles also each sweep as a record of its own.

    Parameters
    ----------
    data : Path
        Folder with a folder for each set; sets that are missing are left out.
    """
    for example in SETS:
        if not (data / example).is_dir():
            continue
        for record in read_campaign(EXAMPLES / f"{example}.toml", data_dir=data / example).records:
            sweeps = np.unique(record.inputs["segment"])
            yield Measured(example, record, sweeps.size)
            if example == "smareact_isobaric_7cycle":
                for i, number in enumerate(sweeps, start=1):
                    one = part(record, record.inputs["segment"] == number)
                    condition = replace(record.condition, id=f"{record.condition.id}-cycle{i}")
                    yield Measured(example, replace(one, condition=condition), 1)


def held_out_blocks(record: Record) -> list[Mask]:
    """Samples held out in turn: every fifth of the inner ones of `BLOCKS` blocks of neighbours in the order of time.

    The blocks at both ends of the record are never held out; see `held_out_ends`.
    """
    block = _blocks(record)
    inner = (block > 0) & (block < block.max())
    return [inner & (block % FOLDS == k) for k in range(FOLDS)]


def held_out_ends(record: Record) -> list[Mask]:
    """The first and the last block in turn, which have to be extrapolated."""
    block = _blocks(record)
    return [block == 0, block == block.max()]


def _blocks(record: Record) -> NDArray[np.intp]:
    return np.arange(record.n) * min(BLOCKS, record.n) // record.n


def held_out_sweeps(record: Record) -> list[Mask]:
    """Each sweep in turn where there are several; else nothing."""
    segment = record.inputs["segment"]
    numbers = np.unique(segment)
    return [segment == number for number in numbers] if numbers.size >= FEWEST_SWEEPS else []


def scatter_of_readings(record: Record, channel: str) -> float:
    """Standard deviation of a reading, told from how readings differ from the line between their neighbours.

    ``(a y[i-1] + b y[i+1] - y[i]) / sqrt(a**2 + b**2 + 1)`` has the variance of the noise where the response is
    straight between neighbours (T. Gasser, L. Sroka, C. Jennen-Steinmetz, Biometrika 73 (1986) 625, doi
    10.1093/biomet/73.3.625). Within each sweep the samples are put in the order of temperature; the spread is 1.4826
    times the median of the absolute values, so that outliers and the steepest part do not matter, or the root mean
    square where rounding leaves more than half of them at zero.

    Returns
    -------
    float
        [unit of the channel]; NaN where no sweep has three samples.
    """
    found = []
    for number in np.unique(record.inputs["segment"]):
        here = record.inputs["segment"] == number
        order = np.argsort(record.temperature[here], kind="stable")
        found.append(
            _pseudo_residuals(record.temperature[here][order], record.observed[channel][here][order])
        )
    e = np.concatenate(found)
    if not e.size:
        return float("nan")
    typical = float(1.4826 * np.median(np.abs(e)))
    return typical if typical > 0.0 else float(np.sqrt(np.mean(e * e)))


def _pseudo_residuals(t: Floats, y: Floats) -> Floats:
    width = t[2:] - t[:-2]
    inner = width > 0.0
    a = np.where(inner, (t[2:] - t[1:-1]) / np.where(inner, width, 1.0), 0.5)
    b = 1.0 - a
    return np.asarray((a * y[:-2] + b * y[2:] - y[1:-1]) / np.sqrt(a * a + b * b + 1.0))
