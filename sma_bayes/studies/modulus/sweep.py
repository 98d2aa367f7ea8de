"""One branch at one frequency: posteriors of both moduli, and what follows from them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.assess.transformation import NAMES, temperatures_of_draws
from sma_bayes.fitting.curves import CurveDraws, interval
from sma_bayes.fitting.fit import Fit
from sma_bayes.fitting.fit_records import exact_channels, fit_records
from sma_bayes.records.dmta import DmtaSweep
from sma_bayes.records.types import Record
from sma_bayes.response import AUTO_MODEL, LOSS_LADDER, RESPONSE_MODELS, STORAGE_LADDER, ResponseModel
from sma_bayes.studies.modulus.schema import (
    CurveParameter,
    Modulus,
    ModulusCurve,
    ModulusSweep,
    ModulusValue,
    TransitionTemperature,
)

CHANNEL: Final = "stiffness"
STORAGE: Final = "storage_modulus"
LOSS: Final = "loss_modulus"
TAN: Final = "tan_delta"
LADDERS: Final[Mapping[Modulus, tuple[type[ResponseModel], ...]]] = {
    STORAGE: STORAGE_LADDER,
    LOSS: LOSS_LADDER,
}
POINTS: Final = 161
"""Temperatures of a band."""
FINE: Final = 801
"""Temperatures among which a peak is looked for."""
SURE: Final = 0.95
LEVELS: Final = (0.05, 0.5, 0.95)


@dataclass(frozen=True, slots=True, eq=False)
class SweepFound:
    """What was found of a sweep: its part of the document, its bands and its samples as columns."""

    document: ModulusSweep
    bands: dict[str, Floats]
    samples: dict[str, Floats]


def study_sweep(
    sweep: DmtaSweep, models: Mapping[Modulus, str], at: Sequence[float], seed: int
) -> SweepFound:
    """Fit the moduli of a sweep and tell what follows.

    Parameters
    ----------
    sweep : DmtaSweep
    models : mapping of str to str
        Name of the response model of each modulus, or ``auto``.
    at : sequence of float
        Temperatures at which moduli are told [degC].
    seed : int
    """
    measured: dict[Modulus, Record | None] = {STORAGE: sweep.storage, LOSS: sweep.loss}
    fits = {m: _fitted(r, m, models[m], seed) for m, r in measured.items() if r is not None}
    low, high = float(sweep.storage.temperature.min()), float(sweep.storage.temperature.max())
    rng = np.random.default_rng(np.random.SeedSequence([seed, 9, *sweep.id.encode()]))
    curves = _Curves(fits, rng)
    document = ModulusSweep.about(
        sweep,
        branch=sweep.branch.value,
        temperature_from=low,
        temperature_to=high,
        curves=tuple(_curve(f, channel, sweep) for channel, f in fits.items()),
        temperatures=(*_of_storage(fits[STORAGE]), *_peaks(curves, low, high)),
        values=tuple(v for t in at for v in _values(curves, t)),
    )
    return SweepFound(document, _bands(curves, np.linspace(low, high, POINTS)), _samples(fits))


def _fitted(record: Record, channel: Modulus, name: str, seed: int) -> Fit:
    types: tuple[type[ResponseModel], ...] = (
        LADDERS[channel] if name == AUTO_MODEL else (RESPONSE_MODELS[name],)
    )
    ladder = [(m.made_for([record]), m.default_priors()) for m in types]
    return fit_records([record], ladder[0][1], ladder=ladder, seed=seed)


class _Curves:
    """Draws of storage modulus, loss modulus and their quotient; those of both moduli are paired at random."""

    def __init__(self, fits: Mapping[Modulus, Fit], rng: np.random.Generator) -> None:
        self.draws: dict[str, CurveDraws] = {c: f.curves() for c, f in fits.items()}
        size = min(len(d.theta) for d in self.draws.values())
        self.order = {c: rng.permutation(len(d.theta))[:size] for c, d in self.draws.items()}
        self.channels = (STORAGE, LOSS, TAN) if LOSS in fits else (STORAGE,)

    def of(self, channel: str, temperature: Floats) -> Floats:
        """Curves (N, m)."""
        if channel == TAN:
            return np.asarray(self.of(LOSS, temperature) / self.of(STORAGE, temperature))
        return self.draws[channel].curve(CHANNEL, temperature)[self.order[channel]]


def _curve(fit: Fit, channel: Modulus, sweep: DmtaSweep) -> ModulusCurve:
    (record,) = fit.records
    model = fit.posterior.model
    median = np.median(fit.curves().curve(CHANNEL, record.temperature), axis=0)
    y = record.observed[CHANNEL]
    theta = fit.flat
    return ModulusCurve(
        channel=channel,
        source="tan_delta" if channel == LOSS and sweep.loss_from_tan_delta else "measured",
        model=model.name,
        reason="" if fit.model_choice is None else fit.model_choice.reason,
        noise=fit.posterior.noise.name,
        discrepancy=fit.posterior.has_discrepancy,
        n=record.n,
        missed=float(np.sqrt(np.mean((y - median) ** 2)) / np.ptp(y)),
        converged=fit.converged,
        computed=bool(exact_channels(fit.posterior, np.median(theta, axis=0), 0)),
        parameters={
            fact.name: CurveParameter(
                unit=fact.unit,
                meaning=fact.in_record(record.quantity).meaning,
                **interval(theta[:, i]),
            )
            for i, fact in enumerate(model.parameters(record.units))
        },
    )


def _of_storage(fit: Fit) -> list[TransitionTemperature]:
    """Start and finish by the tangent rule, and what is halfway between."""
    found = temperatures_of_draws(fit.curves(), CHANNEL)
    low, high = (next(t for t in found if t.name == name) for name in NAMES[fit.records[0].branch])
    return [
        *(
            _transition(t.name, f"{t.meaning}, tangent rule", STORAGE, t.draws, within_data=t.within_data)
            for t in found
        ),
        _transition(
            "midpoint",
            "halfway between start and finish",
            STORAGE,
            0.5 * (low.draws + high.draws),
            within_data=low.within_data and high.within_data,
        ),
    ]


def _transition(
    name: str, meaning: str, channel: str, draws: Floats, *, within_data: bool = True
) -> TransitionTemperature:
    found = draws[np.isfinite(draws)]
    defined = float(found.size / draws.size)
    told: dict[str, float | None] = dict.fromkeys(("q05", "median", "q95", "mean", "sd"))
    if found.size >= 2:
        told.update(interval(found), mean=float(found.mean()), sd=float(found.std()))
    return TransitionTemperature(
        name=name,
        meaning=meaning,
        channel=channel,
        **told,
        defined=defined,
        identified=defined >= SURE and within_data,
    )


def _peaks(curves: _Curves, low: float, high: float) -> list[TransitionTemperature]:
    if LOSS not in curves.channels:
        return []
    t = np.linspace(low, high, FINE)
    return [
        _transition(
            f"{name}_peak",
            f"greatest {channel.replace('_', ' ')} within the sweep",
            channel,
            peak_of(t, curves.of(channel, t)),
        )
        for name, channel in (("loss", LOSS), ("tan_delta", TAN))
    ]


def peak_of(t: Floats, y: Floats) -> Floats:
    """Where each curve is greatest; NaN where that is at an end.

    Parameters
    ----------
    t : ndarray, shape (m,)
        Even temperatures.
    y : ndarray, shape (N, m)

    Returns
    -------
    ndarray, shape (N,)
        Top of the parabola through the greatest value and its neighbours.

    Examples
    --------
    >>> import numpy as np
    >>> t = np.linspace(0.0, 10.0, 101)
    >>> peak_of(t, np.stack([-((t - 3.217) ** 2), t])).round(3)
    array([3.217,   nan])
    """
    at = np.argmax(y, axis=1)
    inside = (at > 0) & (at < t.size - 1)
    middle = np.clip(at, 1, t.size - 2)
    rows = np.arange(len(y))
    below, top, above = y[rows, middle - 1], y[rows, middle], y[rows, middle + 1]
    bend = below - 2.0 * top + above
    off = np.where(bend < 0.0, 0.5 * (below - above) / np.where(bend < 0.0, bend, 1.0), 0.0)
    return np.where(inside, t[middle] + off * (t[1] - t[0]), np.nan)


def _values(curves: _Curves, at: float) -> Iterator[ModulusValue]:
    for channel in curves.channels:
        draws = curves.of(channel, np.array([at]))[:, 0]
        logs = np.log(draws) if np.all(draws > 0.0) else None
        yield ModulusValue(
            channel=channel,
            at=at,
            unit="1" if channel == TAN else "Pa",
            **interval(draws),
            log_mean=None if logs is None else float(logs.mean()),
            log_sd=None if logs is None else float(logs.std()),
        )


def _bands(curves: _Curves, t: Floats) -> dict[str, Floats]:
    columns = {"temperature_degC": t}
    for channel in curves.channels:
        for level, values in zip(LEVELS, np.quantile(curves.of(channel, t), LEVELS, axis=0), strict=True):
            columns[f"{channel}_q{round(100 * level):02d}"] = values
    return columns


def _samples(fits: Mapping[Modulus, Fit]) -> dict[str, Floats]:
    """What was fitted; the moduli have temperatures of their own, and the shorter column ends in NaN."""
    size = max(f.records[0].n for f in fits.values())
    columns = {}
    for channel, fit in fits.items():
        (record,) = fit.records
        for name, values in (
            (f"{channel}_temperature_degC", record.temperature),
            (f"{channel}_Pa", record.observed[CHANNEL]),
        ):
            columns[name] = np.concatenate([values, np.full(size - record.n, np.nan)])
    return columns
