"""Residuals of real sweeps, put back on smooth curves that were fitted to them.

The sweeps are those of the worked examples whose response is a curve of temperature: the wire in water is left out, and
so are the heating halves without samples in the transformation, and the raw NiTi, which transforms in more steps than
the smooth curve has. To each sweep two logistics with a slope for each phase are fitted by least squares, nine numbers.

Of most sweeps they leave more than what a reading scatters: waves as smooth as the curve itself. So there are two
truths. In the first the curve is the nine numbers and a smoothing spline through what they leave, as smooth as
predicts best, from the others, blocks of neighbouring readings that are left out. What that leaves is scatter, with
the tails, the rounding and the short memory of the instrument, small on the plateaus and large in the transformation.
It stays where it was found; a repeat turns the signs of blocks of readings at random. In the second the nine numbers
are the truth, and all that they leave counts as noise, moved along the sweep, cyclically, and turned in sign: waves of
misfit then stand where no specimen has them, and nobody who is given one sweep can tell them from its curve.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
from scipy.interpolate import BSpline, make_smoothing_spline
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
LEFT_OUT = 5
"""Neighbouring readings that are left out together where the smoothness of a spline is chosen."""
SMOOTHNESS = 10.0 ** np.arange(-9.0, 3.0, 0.5)
"""Penalties of splines, temperatures over their range, that are tried."""
TURNED = 10
"""Neighbouring readings whose scatter is turned in sign together."""


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
def sweep(data: Path, which: int, *, smooth: bool) -> Sweep:
    """A sweep with its curve; `which` counts round.

    Parameters
    ----------
    smooth : bool
        Whether a smooth function of what two logistics leave is a part of the curve.
    """
    records = _records(data)
    source, record = records[which % len(records)]
    (y,) = record.observed.values()
    curve = double_logistic(record.temperature, y)
    if smooth:
        curve = curve.plus(smooth_rest(record.temperature, y - curve.value(record.temperature)))
    return Sweep(source, record, curve, y - curve.value(record.temperature))


def turned(residual: Floats, rng: np.random.Generator) -> Floats:
    """Residuals (n,) in their places, signs of blocks of `TURNED` turned at random; the first is cut at random."""
    block = (np.arange(residual.size) + rng.integers(TURNED)) // TURNED
    return np.asarray(rng.choice((-1.0, 1.0), block[-1] + 1)[block] * residual)


def moved(residual: Floats, rng: np.random.Generator) -> Floats:
    """Residuals (n,), shifted cyclically by a random step, of random sign."""
    shift = int(rng.integers(residual.size))
    return np.asarray(rng.choice((-1.0, 1.0)) * np.roll(residual, shift))


def smooth_rest(temperature: Floats, rest: Floats) -> Curve:
    """Smoothing spline through what a curve leaves, as smooth as predicts blocks of readings that are left out best.

    By absolute errors, so that a few wild readings don't decide.
    """
    low, width = float(temperature.min()), float(np.ptp(temperature))
    u, n = (temperature - low) / width, rest.size
    blocks = [np.arange(n) // LEFT_OUT == k for k in range(-(-n // LEFT_OUT))]

    def missed(penalty: float) -> float:
        total = 0.0
        for out in blocks:
            known = u[~out]
            at = np.clip(u[out], known.min(), known.max())
            total += float(np.abs(rest[out] - _spline(known, rest[~out], penalty)(at)).sum())
        return total

    best = _spline(u, rest, min(SMOOTHNESS, key=missed))
    steepness = best.derivative()

    def value(t: Floats) -> Floats:
        v = (t - low) / width
        inner = np.clip(v, 0.0, 1.0)  # beyond the sweep it goes on straight
        return np.asarray(best(inner) + (v - inner) * steepness(inner))

    return Curve(value, lambda t: np.asarray(steepness(np.clip((t - low) / width, 0.0, 1.0)) / width))


def _spline(u: Floats, y: Floats, penalty: float) -> BSpline:
    """Smoothing spline; readings at one temperature count as their mean, with their number as its weight."""
    at, which, count = np.unique(u, return_inverse=True, return_counts=True)
    return make_smoothing_spline(at, np.bincount(which, y) / count, count.astype(float), lam=penalty)


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
