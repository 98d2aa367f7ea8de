"""Two finished fits side by side: what went in differently, and what came out differently."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from sma_bayes.errors import SmaBayesError
from sma_bayes.runs.declared_units import Shown, declared_parts, shown_as, shown_units
from sma_bayes.runs.fit_document import (
    NearestSummary,
    ParameterSummary,
    RecordSummary,
    TransformationSummary,
)
from sma_bayes.runs.outputs import StoredBand, StoredRun, band_of, read_run
from sma_bayes.runs.shown import in_shown_units
from sma_bayes.studies.diff.schema import (
    ComparedBand,
    ComparedParameter,
    ComparedRecords,
    DifferenceDocument,
    ParameterOfRun,
)

TOLERANCE: Final = 0.25
"""Standard deviations of the posterior up to which two results are the same: draws of two seeds differ by less, as
converged medians are known to some 0.05 of them."""
NORMAL_90: Final = 3.28971
"""Width of the interval that holds 90 % of a normal distribution, in standard deviations."""
PRIOR_TOLERANCE: Final = 1e-3
"""Relative difference of numbers of a prior that is none: some are scaled by a least-squares fit, which ends within."""
COMPARED: Final = (
    "converged", "adequate", "model", "n", "rows_averaged", "settings", "temperature", "channels",
)  # fmt: skip
"""Keys of a record of which is told what differs, beside noise and priors."""
GRID: Final = 161
"""Temperatures at which bands are compared."""

Estimated = ParameterSummary | TransformationSummary | NearestSummary


def diff(
    a: str | Path, b: str | Path, *, tolerance: float = TOLERANCE, declared: bool = False
) -> dict[str, Any]:
    """Compare two finished fits.

    Parameters
    ----------
    a, b : str or Path
        Output folders of `fit` or `demo`.
    tolerance : float
        Up to how many standard deviations of the wider posterior medians may differ and still be the same [1].
    declared : bool
        Whether numbers are in the units in which the measurements were declared, as the terminal shows them, and not in
        those of the documents.

    Returns
    -------
    dict
        ``sma-bayes/diff/1``: see docs/reference/files.md. ``same`` says whether all results agree: the same records,
        each converged and adequate or not as in the other, with medians of parameters and bands within the tolerance.

    Raises
    ------
    OutputError
        If a folder holds no finished fit.
    SmaBayesError
        If the tolerance is no positive number.
    """
    if not (np.isfinite(tolerance) and tolerance > 0.0):
        raise SmaBayesError(f"--tolerance {tolerance}", expected="a positive number of standard deviations")
    runs = (read_run(Path(a)), read_run(Path(b)))
    everything = [r for run in runs for r in run.summary.records]
    units = shown_units(everything) if declared else {}
    records = [{r.key: r for r in in_shown_units(run.summary, units).records} for run in runs]
    keys = list(dict.fromkeys([*records[0], *records[1]]))
    compared = [
        _record(runs, units, key, records[0].get(key), records[1].get(key), tolerance) for key in keys
    ]
    return DifferenceDocument(
        schema="sma-bayes/diff/1",
        a=str(a),
        b=str(b),
        tolerance=tolerance,
        same=all(r.same for r in compared),
        inputs=_different(*map(_stated, runs)),
        converged=tuple(run.summary.converged for run in runs),
        adequate=tuple(run.summary.adequate for run in runs),
        records=tuple(compared),
        **declared_parts(everything),
    ).as_json()


def _different(
    first: Mapping[str, Any], second: Mapping[str, Any], keys: Iterable[str] | None = None
) -> dict[str, tuple[Any, Any]]:
    """Both values of each key that differs."""
    pairs = {key: (first.get(key), second.get(key)) for key in keys or {**first, **second}}
    return {key: (a, b) for key, (a, b) in pairs.items() if a != b}


def _stated(run: StoredRun) -> dict[str, Any]:
    s = run.summary
    versions = {f"version of {name}": v for name, v in s.versions.items()}
    return {
        "campaign": s.campaign,
        "data_sha256": s.data_sha256,
        "seed": s.seed,
        **s.options.as_json(),
        **versions,
    }


def _record(
    runs: Sequence[StoredRun],
    units: Shown,
    key: str,
    a: RecordSummary | None,
    b: RecordSummary | None,
    tolerance: float,
) -> ComparedRecords:
    if a is None or b is None:
        return ComparedRecords(key=key, in_="b" if a is None else "a", same=False)
    names = list(dict.fromkeys([*a.parameters, *b.parameters]))
    parameters = _parameters(a, b)
    bands = {c: _band(runs, units, (a, b), c) for c in a.quantities if c in b.quantities}
    ends = list(dict.fromkeys([*a.transformation, *b.transformation]))
    temperatures = {n: _parameter(a.transformation.get(n), b.transformation.get(n)) for n in ends}
    shifts = [p.shift for p in parameters.values()]
    shifts += [band.shift for band in bands.values() if band is not None]
    changed = _different(a.as_json(), b.as_json(), COMPARED)
    if "settings" in changed:
        changed["settings"] = (_settings(a, units), _settings(b, units))
    if a.noise.name != b.noise.name:
        changed["noise"] = (a.noise.name, b.noise.name)
    alike = not {"converged", "adequate", "model", "channels"} & set(changed)
    return ComparedRecords(
        key=key,
        in_="both",
        same=alike and max((abs(s) for s in shifts if s is not None), default=0.0) <= tolerance,
        converged=(a.converged, b.converged),
        adequate=(a.adequate, b.adequate),
        why=tuple(tuple(reason.message for reason in r.why) for r in (a, b)),
        changed=changed,
        priors=tuple(
            n for n in names
            if n in a.parameters and n in b.parameters
            and not _alike(a.parameters[n].prior, b.parameters[n].prior)
        ),
        parameters=parameters,
        transformation=temperatures,
        bands=bands,
    )  # fmt: skip


def _parameters(a: RecordSummary, b: RecordSummary) -> dict[str, ComparedParameter]:
    """Parameters of both, by name.

    Of two models A3 is not the same thing: those of the published curve nearest to either are compared, and what a
    model has beside them has no counterpart.
    """
    of_a: dict[str, Estimated] = {**a.parameters}
    of_b: dict[str, Estimated] = {**b.parameters}
    if a.model != b.model:
        of_a, of_b = ({**_of_noise(r), **r.nearest} for r in (a, b))
    return {n: _parameter(of_a.get(n), of_b.get(n)) for n in dict.fromkeys([*of_a, *of_b])}


def _of_noise(r: RecordSummary) -> dict[str, Estimated]:
    return {n: p for n, p in r.parameters.items() if p.of_noise}


def _alike(a: Mapping[str, Any] | None, b: Mapping[str, Any] | None) -> bool:
    """Whether priors are the same, but for the last digits of what the least-squares fit leaves."""
    if a is None or b is None or a.keys() != b.keys():
        return a == b
    pairs = [(a[key], b[key]) for key in a]
    return all(
        math.isclose(x, y, rel_tol=PRIOR_TOLERANCE)
        if isinstance(x, float) and isinstance(y, float)
        else x == y
        for x, y in pairs
    )


def _settings(r: RecordSummary, units: Shown) -> dict[str, float]:
    return {name: units[name].factor * v if name in units else v for name, v in r.settings.items()}


def _parameter(a: Estimated | None, b: Estimated | None) -> ComparedParameter:
    """Medians with intervals of either run, and how far b is from a in standard deviations of the wider posterior."""
    known = a or b
    first, second = _of_run(a), _of_run(b)
    shift = None
    medians = [side.median for side in (first, second) if side is not None and side.median is not None]
    if a and b and first and second and a.unit == b.unit and len(medians) == 2:
        shift = _shift(medians[1] - medians[0], max(first.sd or 0.0, second.sd or 0.0))
    return ComparedParameter(unit=known.unit if known else "", a=first, b=second, shift=shift)


def _of_run(p: Estimated | None) -> ParameterOfRun | None:
    """What has no standard deviation is as uncertain as its interval says."""
    if p is None:
        return None
    if isinstance(p, ParameterSummary):
        return ParameterOfRun.about(p)
    sd = None if p.q05 is None or p.q95 is None else (p.q95 - p.q05) / NORMAL_90
    return ParameterOfRun(median=p.median, q05=p.q05, q95=p.q95, sd=sd)


def _shift(difference: float, sd: float) -> float:
    return (
        difference / sd if sd > 0.0 else 0.0 if difference == 0.0 else float(np.copysign(np.inf, difference))
    )


def _band(
    runs: Sequence[StoredRun], units: Shown, records: Sequence[RecordSummary], channel: str
) -> ComparedBand | None:
    """Where the medians of two bands are furthest apart, in standard deviations of the wider band, and in their unit.

    None where they share no temperature.
    """
    a, b = (
        band_of(run.folder, record.key, channel, record.band_sha256.get(channel))
        for run, record in zip(runs, records, strict=True)
    )
    low = max(float(a.temperature.min()), float(b.temperature.min()))
    high = min(float(a.temperature.max()), float(b.temperature.max()))
    if not low < high:
        return None
    at = np.linspace(low, high, GRID)
    difference = _at(b, "q50", at) - _at(a, "q50", at)
    sd = np.maximum(_width(a, at), _width(b, at)) / NORMAL_90
    known = np.isfinite(difference) & np.isfinite(sd)
    if not known.any():
        return None
    at, difference, sd = at[known], difference[known], sd[known]
    shift = np.array([_shift(float(d), float(s)) for d, s in zip(difference, sd, strict=True)])
    worst = int(np.argmax(np.abs(shift)))
    stored = next(r for r in runs[0].summary.records if r.key == records[0].key)
    quantity = stored.quantities[channel]
    u = shown_as(quantity.unit, units, quantity.name, difference=True)
    degrees = shown_as(stored.temperature.unit, units)
    place, lowest, highest = (float(t) for t in degrees.values(np.array([at[worst], low, high])))
    return ComparedBand(
        name=quantity.name,
        unit=u.shown,
        shift=float(shift[worst]),
        at=place,
        medians=tuple(u.factor * float(_at(band, "q50", at[worst])) for band in (a, b)),
        temperature_unit=degrees.shown,
        difference=u.factor * float(difference[worst]),
        width_ratio=float(np.nanmedian(_width(b, at) / np.where(_width(a, at) > 0.0, _width(a, at), np.nan))),
        compared=(lowest, highest),
    )


def _at(band: StoredBand, name: str, temperature: np.ndarray[Any, np.dtype[np.float64]]) -> Any:
    return np.interp(temperature, band.temperature, band.quantiles[name])


def _width(band: StoredBand, temperature: np.ndarray[Any, np.dtype[np.float64]]) -> Any:
    return _at(band, "q95", temperature) - _at(band, "q05", temperature)
