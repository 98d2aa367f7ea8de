"""Files that hold results: written whole or not at all.

Posteriors are NetCDF with flat groups, as `arviz.from_netcdf` of arviz 0.23 and 1.x both open them.
"""

from __future__ import annotations

import json
import math
import os
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.disk import NEEDED, reason, unwritable, writing
from sma_bayes.document_part import plain
from sma_bayes.fitting.fit import Fit
from sma_bayes.fitting.posterior import versions
from sma_bayes.records.types import Record
from sma_bayes.runs.netcdf import Variable, VariableGroup, axes, write_groups
from sma_bayes.runs.workers import stop_workers

PRIOR_DRAWS = 500
PRIOR_GRID = 81
"""Draws from the prior that are stored, and temperatures of the curves that they give."""
WEIGHTS, FUNCTIONS = "_discrepancy_weights", "_discrepancy_functions"
"""How the names of variables end that hold what a curve misses."""
NODE, FUNCTION = "_discrepancy_node", "_discrepancy_function"
"""And those of their dimensions: temperatures between which natural cubic splines run, and numbers of functions."""
OF_SWEEPS, OF_SWEEP = "_discrepancy_sweep_functions", "_discrepancy_sweep_function"
"""How the name of the variable ends that holds functions of what a sweep has of its own, and that of its dimension."""
MEASURED_SWEEPS = "_of_measured_sweeps"
"""How the names of variables end that hold parameters of the curve of the measured sweeps, where these differ."""
PREDICTIVE_DRAWS = 125
"""Draws of each ensemble for which pointwise likelihood and replicated data are stored."""
LARGEST_SINGLE = float(np.finfo(np.float32).max)
"""Greatest number of single precision."""
LOG_STEP = 2.0**-7
"""To what log densities of samples are rounded; the error of their sum over draws is far below that of the draws."""
NOISE_STEP = 2.0**-5
"""To what replicated data are rounded: this part of their standard deviation, or a little less."""
CURVE_BITS = 12
"""To how many binary digits curves of the prior are rounded."""
PACKED_GROUPS = ("log_likelihood", "posterior_predictive", "prior_predictive")
"""Groups that are compressed; what is rounded to a power of two takes a third of the room then."""


FORMULA = ("=", "+", "-", "@", "\t", "\r")
"""How a cell begins that spreadsheets take for a formula (OWASP, "CSV Injection")."""
UNFINISHED = ".unfinished-"
"""How the names of files begin that are being written."""


def sweep_unfinished(folder: Path) -> None:
    """Remove what a process that was killed has left half-written below a folder."""
    for path in folder.rglob(f"{UNFINISHED}*"):
        path.unlink(missing_ok=True)


@contextmanager
def nothing_unfinished(folder: Path) -> Iterator[None]:
    """Leave no half-written file below a folder, whatever ends the ``with`` block.

    Where an error or a signal does, workers are ended: they would go on writing.
    """
    try:
        yield
    except BaseException:
        stop_workers()
        raise
    finally:
        sweep_unfinished(folder)


def write_file(path: Path, write: Callable[[Path], object], *, nbytes: int = 0) -> None:
    """Write a file under a temporary name beside its place, then move it there.

    Parameters
    ----------
    path : Path
    write : callable
        Writes to the path that it is given.
    nbytes : int
        Size of the file at most, if known.

    Raises
    ------
    OutputError
        If it can't be written; nothing is left behind then.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=UNFINISHED, suffix=path.suffix)
    except OSError as error:
        raise unwritable(path, reason(error), NEEDED) from None
    os.close(handle)
    temporary = Path(name)
    try:
        with writing(path, nbytes=nbytes):
            write(temporary)
            temporary.chmod(0o644)
            temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def write_text(path: Path, text: str) -> None:
    """Write a text file whole or not at all; see `write_file`."""
    write_file(path, lambda place: place.write_text(text, encoding="utf-8"))


def write_json(path: Path, document: Mapping[str, Any]) -> None:
    """Write JSON that other tools can read: no NaN, infinities as null."""
    write_text(path, json.dumps(plain(document), indent=1, allow_nan=False) + "\n")


def write_csv(path: Path, columns: Mapping[str, Any], digits: int = 9) -> None:
    """Write columns of equal length as CSV with a header."""
    form = f"%.{digits}g"
    cells = [_cells(np.asarray(values), form) for values in columns.values()]
    rows = [
        ",".join(_cell(name, form) for name in columns),
        *(",".join(row) for row in zip(*cells, strict=True)),
    ]
    write_text(path, "\n".join(rows) + "\n")


def _cells(values: Any, form: str) -> list[str]:
    if values.dtype.kind == "f":
        return [form % v if math.isfinite(v) else "" for v in values.tolist()]
    return [_cell(v, form) for v in values]


def _cell(value: Any, form: str) -> str:
    if isinstance(value, bool | np.bool_):
        return "true" if value else "false"
    if isinstance(value, int | np.integer):
        return str(int(value))
    if isinstance(value, float | np.floating):
        return form % value if np.isfinite(value) else ""
    text = guarded_text(str(value))
    return '"' + text.replace('"', '""') + '"' if any(c in text for c in ',"\n') else text


def guarded_text(text: str) -> str:
    """Text that a spreadsheet takes for text: one that begins as a formula does gets an apostrophe before it.

    Examples
    --------
    >>> guarded_text("=cmd()"), guarded_text("2A-150g")
    ("'=cmd()", '2A-150g')
    """
    return f"'{text}" if text.lstrip("'").startswith(FORMULA) else text


def unguarded_text(text: str) -> str:
    """Text as it was before `guarded_text`."""
    return text[1:] if text.startswith("'") and text.lstrip("'").startswith(FORMULA) else text


def or_nan(value: float | None) -> float:
    """A number of a document as a table has it: a cell that stays empty where nothing is told."""
    return np.nan if value is None else value


def write_posterior(path: Path, fit: Fit, record: int, replicated: Mapping[str, Floats]) -> None:
    """Write one record's posterior as NetCDF.

    Parameters
    ----------
    path : Path
    fit : Fit
    record : int
        Which of the records that share the posterior.
    replicated : mapping of str to ndarray, shape (G N, n)
        Replicated data, one series for each kept draw.
    """
    groups = _groups(fit, record, replicated)
    write_file(
        path,
        lambda place: write_groups(place, groups, packed=PACKED_GROUPS),
        nbytes=sum(group.nbytes for group in groups.values()),
    )


def _groups(fit: Fit, record: int, replicated: Mapping[str, Floats]) -> dict[str, VariableGroup]:
    r = fit.records[record]
    chains, kept, _ = fit.theta.shape
    dims = ("chain", "draw")
    coords = axes(chain=np.arange(chains), draw=np.arange(kept))
    theta = fit.calibrated(record).reshape(fit.theta.shape)
    own = _own_parameters(fit, record)
    posterior = {
        name: Variable(dims, theta[:, :, i], {"unit": p.unit, "long_name": p.meaning, "prior": repr(p.prior),
                                              "prior_source": p.source})
        for name, i in own.items()
        for p in [fit.posterior.space.parameters[i]]
    }  # fmt: skip
    flat = fit.z.reshape(-1, fit.z.shape[-1])
    log_prior = fit.posterior.log_prior(flat).reshape(chains, kept)
    log_likelihood = fit.posterior.log_likelihood(fit.flat).reshape(chains, kept)
    densities = {"lp": log_prior + log_likelihood, "log_prior": log_prior, "log_likelihood": log_likelihood}
    points = axes(obs=np.arange(r.n)) | {
        "row": Variable(("obs",), r.row),
        **{k: Variable(("obs",), v, {"unit": r.units.get(k, "1")}) for k, v in r.inputs.items()},
    }
    prior, prior_predictive = _prior_groups(fit, record, own)
    return {
        "/": VariableGroup(attributes=_attributes(fit, r)),
        "posterior": VariableGroup(posterior, coords),
        "sample_stats": VariableGroup(
            {name: Variable(dims, values) for name, values in densities.items()}
            | _discrepancy_weights(fit, record)
            | _measured_sweeps(fit, own),
            coords | _functions(fit, record),
        ),
        **_pointwise_groups(fit, record, replicated, points),
        "log_prior": VariableGroup({"log_prior": Variable(dims, log_prior)}, coords),
        "observed_data": VariableGroup(
            {
                c: Variable(("obs",), v, {"unit": r.units[c], "quantity": r.quantity(c)})
                for c, v in r.observed.items()
            },
            points,
        ),
        "prior": prior,
        "prior_predictive": prior_predictive,
        "constant_data": _constants(fit, record, points),
    }


def _pointwise_groups(
    fit: Fit, record: int, replicated: Mapping[str, Floats], points: dict[str, Variable]
) -> dict[str, VariableGroup]:
    """Log likelihood of each sample and replicated data, for every n-th draw; rounded, as they are most of the file."""
    r = fit.records[record]
    chains, kept, _ = fit.theta.shape
    stride = max(1, kept // PREDICTIVE_DRAWS)
    few = np.arange(kept)[::stride]
    some = fit.theta[:, ::stride].reshape(-1, fit.theta.shape[-1])
    weights = tuple(
        {c: w.reshape(chains, kept, -1)[:, ::stride].reshape(len(some), -1) for c, w in own.items()}
        for own in fit.discrepancy
    )
    pointwise = fit.posterior.pointwise_log_likelihood(some, weights)[record]
    dims = ("chain", "draw", "obs")
    coords = axes(chain=np.arange(chains), draw=few) | points
    densities, data = {}, {}
    for channel, values in pointwise.items():
        shaped = values.reshape(chains, few.size, r.n)
        densities[channel] = Variable(dims, _rounded(shaped, LOG_STEP), {"rounded_to": LOG_STEP})
    for channel in r.channels:
        drawn = replicated[channel].reshape(chains, kept, r.n)[:, ::stride]
        step = NOISE_STEP * float(drawn.std(axis=(0, 1)).min())
        data[channel] = Variable(dims, _rounded(drawn, step), {"rounded_to": step})
    return {
        "log_likelihood": VariableGroup(densities, coords),
        "posterior_predictive": VariableGroup(data, coords),
    }


def _rounded(values: Floats, step: float) -> Any:
    """Values to the next power of two not above a step, in single precision; as they are where the step is 0.

    Examples
    --------
    >>> _rounded(np.array([1.3, -0.1]), 0.3).tolist()
    [1.25, 0.0]
    """
    if step > 0.0:
        power = 2.0 ** np.floor(np.log2(step))
        values = np.round(values / power) * power + 0.0
    return _single(values)


def _significant(values: Floats, bits: int) -> Any:
    """Values to so many binary digits, in single precision."""
    mantissa, exponent = np.frexp(np.clip(values, -LARGEST_SINGLE, LARGEST_SINGLE))
    return _single(np.ldexp(np.round(mantissa * 2.0**bits) / 2.0**bits, exponent))


def _single(values: Floats) -> Any:
    """Values in single precision, whose far ends stand for what overflows."""
    return np.clip(values, -LARGEST_SINGLE, LARGEST_SINGLE).astype(np.float32)


def _discrepancy_weights(fit: Fit, record: int) -> dict[str, Variable]:
    """Weights of what the curve misses, for each kept draw."""
    chains, kept, _ = fit.theta.shape
    own = fit.discrepancy[record] if fit.discrepancy else {}
    return {
        f"{channel}{WEIGHTS}": Variable(
            ("chain", "draw", f"{channel}{FUNCTION}"),
            weights.reshape(chains, kept, -1),
            {
                "unit": fit.records[record].units[channel],
                "long_name": f"weights of what the curve of {channel} misses",
            },
        )
        for channel, weights in own.items()
    }


def _measured_sweeps(fit: Fit, own: Mapping[str, int]) -> dict[str, Variable]:
    """Parameters of the curve of the measured sweeps as they were sampled, those that differ from the curve of all."""
    if fit.measured_sweeps is None:
        return {}
    return {
        f"{name}{MEASURED_SWEEPS}": Variable(
            ("chain", "draw"),
            fit.measured_sweeps[:, :, i],
            {
                "unit": fit.posterior.space.parameters[i].unit,
                "long_name": f"{name} of the curve of the measured sweeps",
            },
        )
        for name, i in own.items()
        if not np.array_equal(fit.measured_sweeps[:, :, i], fit.theta[:, :, i])
    }


def _functions(fit: Fit, record: int) -> dict[str, Variable]:
    """Numbers of these functions, the coordinates of their dimension."""
    bases = fit.posterior.discrepancy[record]
    return axes(**{f"{channel}{FUNCTION}": np.arange(basis.count) for channel, basis in bases.items()})


def _constants(fit: Fit, record: int, points: Mapping[str, Variable]) -> VariableGroup:
    """Inputs of the model, and the functions of temperature of which what a curve misses is made."""
    r, bases = fit.records[record], fit.posterior.discrepancy[record]
    coords = axes(obs=points["obs"].values) | _functions(fit, record)
    coords |= {
        f"{c}{NODE}": Variable((f"{c}{NODE}",), b.temperature, {"unit": r.units["temperature"]})
        for c, b in bases.items()
    }
    values = {
        f"{c}{FUNCTIONS}": Variable((f"{c}{NODE}", f"{c}{FUNCTION}"), b.values) for c, b in bases.items()
    }
    owns = {c: b.sweep_functions for c, b in bases.items() if b.sweep_functions is not None}
    coords |= axes(**{f"{c}{OF_SWEEP}": np.arange(own.values.shape[1]) for c, own in owns.items()})
    values |= {
        f"{c}{OF_SWEEPS}": Variable((f"{c}{NODE}", f"{c}{OF_SWEEP}"), own.values) for c, own in owns.items()
    }
    return VariableGroup({name: v for name, v in points.items() if name != "obs"} | values, coords)


def _prior_groups(fit: Fit, record: int, own: Mapping[str, int]) -> tuple[VariableGroup, VariableGroup]:
    """Draws from the prior, and the curves that they give over the observed temperatures."""
    r = fit.records[record]
    rng = np.random.default_rng(np.random.SeedSequence([fit.seed, 3, *r.key.encode()]))
    theta = fit.posterior.space.constrain(fit.posterior.draw_prior(rng, PRIOR_DRAWS))
    grid = np.linspace(r.temperature.min(), r.temperature.max(), PRIOR_GRID)
    curve = fit.posterior.predict(theta, {"temperature": grid}, record=record)
    coords = axes(chain=[0], draw=np.arange(PRIOR_DRAWS))
    draws = {name: Variable(("chain", "draw"), theta[None, :, i]) for name, i in own.items()}
    curves = {
        c: Variable(("chain", "draw", "temperature"), _significant(v[None], CURVE_BITS))
        for c, v in curve.items()
    }
    return VariableGroup(draws, coords), VariableGroup(curves, coords | axes(temperature=grid))


def _own_parameters(fit: Fit, record: int) -> dict[str, int]:
    """Names and positions of the parameters that concern one record: shared ones, and its own noise."""
    place = fit.posterior.layout[record]
    positions = [*place.model.tolist(), *(int(i) for at in place.blocks() for i in at)]
    return {fit.posterior.space.parameters[i].name.partition("[")[0]: i for i in positions}


def _attributes(fit: Fit, record: Record) -> dict[str, Any]:
    return {
        "title": f"posterior of {record.key}",
        "condition": record.condition.id,
        "branch": record.branch.value,
        "model": fit.posterior.model.name,
        "noise": fit.posterior.noise.name,
        "seed": fit.seed,
        "converged": int(fit.converged),
        "sampler": f"emcee ensembles, {fit.draws.method}",
        "fingerprint": fit.posterior.fingerprint(),
        "versions": json.dumps(versions()),
        "inference_library": "emcee",
        "inference_library_version": versions()["emcee"],
        "creation_library": "sma_bayes",
        "creation_library_version": versions()["sma-bayes"],
    }
