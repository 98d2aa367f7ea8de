"""Residuals of real sweeps, put back on smooth curves that were fitted to them.

The sweeps are those of the worked examples whose response is a curve of temperature: the wire in water is left out, and
so are the heating halves without samples in the transformation, and the raw NiTi, which transforms in more steps than
the smooth curve has. To each sweep two logistics with a slope for each
phase are fitted by least squares; they leave what a reading scatters, and they are the truth. A repeat shifts the
residuals along the sweep, cyclically, and turns their sign at random, so that each repeat has other data with the
memory, the tails and the rounding of the instrument.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares
from scipy.special import expit

from calibration.curves import Curve, Floats
from sma_bayes.records.campaign import read_campaign
from sma_bayes.records.types import Record

EXAMPLES = Path(__file__).resolve().parents[2] / "docs" / "examples"
USED = (
    "flexinol_isobaric",
    "smareact_nitico_isobaric",
    "smareact_isobaric_7cycle",
    "nitihf_sparse_isobaric",
    "guarneros_spring_force",
)
EMPTY = ("150MPa-heating", "200MPa-heating")
"""Records of NiTiCo without samples in the transformation."""
MOST = 200
"""Longer sweeps are thinned to at most so many samples."""


@dataclass(frozen=True, slots=True, eq=False)
class Sweep:
    """One sweep and the smooth curve through it.

    Attributes
    ----------
    source : str
        Example and key of the record.
    record : Record
        Of one channel, in the order of measurement.
    curve : Curve
    residual : ndarray, shape (n,)
        [unit of the channel].
    """

    source: str
    record: Record
    curve: Curve
    residual: Floats


@cache
def sweep_count(data: Path) -> int:
    """How many sweeps there are."""
    return len(_records(data))


@cache
def sweep(data: Path, which: int) -> Sweep:
    """A sweep with its curve; `which` counts round."""
    records = _records(data)
    source, record = records[which % len(records)]
    (y,) = record.observed.values()
    curve = double_logistic(record.temperature, y)
    return Sweep(source, record, curve, y - curve.value(record.temperature))


def put_back(found: Sweep, rng: np.random.Generator) -> Floats:
    """Residuals of a repeat, shape (n,): shifted cyclically by a random step, of random sign."""
    shift = int(rng.integers(found.residual.size))
    return np.asarray(rng.choice((-1.0, 1.0)) * np.roll(found.residual, shift))


def each_sweep(record: Record) -> list[Record]:
    """A record of several sweeps as one record for each."""
    segment = record.inputs["segment"]
    numbers = np.unique(segment)
    if numbers.size == 1:
        return [record]
    out = []
    for i, number in enumerate(numbers, start=1):
        part = taken(record, np.flatnonzero(segment == number))
        out.append(replace(part, condition=replace(record.condition, id=f"{record.condition.id}-{i}")))
    return out


def taken(record: Record, index: np.ndarray[tuple[int], np.dtype[np.intp]]) -> Record:
    """Some samples of a record."""
    return replace(
        record,
        inputs={k: v[index] for k, v in record.inputs.items()},
        observed={k: v[index] for k, v in record.observed.items()},
        row=record.row[index],
    )


def double_logistic(temperature: Floats, y: Floats) -> Curve:
    """Two logistics and the slopes of the phases, nine numbers, by least squares from several starts.

    ``y = a + b u + S1(u) (s1 + e u) + S2(u) s2`` with u the temperature over its range.
    """
    low, width = float(temperature.min()), float(np.ptp(temperature))
    base, size = float(y.min()), float(np.ptp(y))
    u, z = (temperature - low) / width, (y - base) / size

    def model(p: Floats, u: Floats) -> Floats:
        first, second = expit(np.exp(p[2]) * (u - p[3])), expit(np.exp(p[4]) * (u - p[5]))
        return np.asarray(p[0] + p[1] * u + first * (p[6] + p[7] * u) + second * p[8])

    rising = 1.0 if np.corrcoef(temperature, y)[0, 1] > 0.0 else -1.0
    middle = float(u[np.argmin(np.abs(z - 0.5))])
    start = 0.0 if rising > 0 else 1.0
    lower = [-5, -5, np.log(2.0), -0.3, np.log(2.0), -0.3, -5, -5, -5]
    upper = [5, 5, np.log(400.0), 1.3, np.log(400.0), 1.3, 5, 5, 5]
    found = min(
        (
            least_squares(
                lambda p: model(p, u) - z,
                [start, 0.0, np.log(k), np.clip(middle, 0.05, 0.95), np.log(k2),
                 np.clip(middle + d, 0.05, 0.95), 0.7 * rising, 0.0, 0.3 * rising],
                bounds=(lower, upper),
                max_nfev=400,
            )
            for k, k2 in ((10.0, 30.0), (30.0, 10.0), (40.0, 80.0))
            for d in (-0.15, 0.15)
        ),
        key=lambda f: f.cost,
    ).x  # fmt: skip

    def slope(t: Floats) -> Floats:
        v = (t - low) / width
        first, second = expit(np.exp(found[2]) * (v - found[3])), expit(np.exp(found[4]) * (v - found[5]))
        d = found[1] + found[7] * first
        d = d + np.exp(found[2]) * first * (1.0 - first) * (found[6] + found[7] * v)
        d = d + np.exp(found[4]) * second * (1.0 - second) * found[8]
        return np.asarray(size / width * d)

    return Curve(lambda t: base + size * model(found, (t - low) / width), slope)


@cache
def _records(data: Path) -> Sequence[tuple[str, Record]]:
    out = []
    for name in USED:
        campaign = read_campaign(EXAMPLES / f"{name}.toml", data_dir=data / name)
        for record in campaign.records:
            if name == "smareact_nitico_isobaric" and record.key in EMPTY:
                continue
            for one in each_sweep(record):
                thinned = taken(one, np.arange(0, one.n, -(-one.n // MOST)))
                out.append((f"{name} {one.key}", replace(thinned, calibration={}, held={})))
    return out
