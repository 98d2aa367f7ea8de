"""What a model may miss without it being noise: columns beside which the noise is estimated."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.special import gammaln

from sma_bayes.arrays import Floats
from sma_bayes.records.history import History
from sma_bayes.studies.gap.hypothesis import Hypothesis
from sma_bayes.studies.gap.noise import ChannelBlock
from sma_bayes.studies.gap.splines import bspline_basis, grouped, indicators, row_tensor_product

TEMPERATURE_SPLINES = 8
"""Splines of temperature on each branch that are taken out; fewer where samples are few."""
COVARIATE_SPLINES = {"time": 6, "order": 6, "ambient_temperature": 6, "rate": 6, "current": 5, "load": 5}
"""Splines of what else was recorded that are tried; of `order` only where time was not."""
CURVE_CHANGE_SPLINES = {"cycle": 5, "rate": 4, "ambient_temperature": 4, "current": 4}
"""Splines of what may change the curve itself, its stroke and its place on the axis of temperature."""
LEAST_SAMPLES_PER_SPLINE = 40
"""Samples for each spline of what else was recorded, at least."""
FEWEST_CYCLES = 3
"""Cycles of a record from which on one of them may be unlike the others."""
MOST_JUMPS = 6
"""Jumps of a record that are tried."""
LEAST_SINGULAR_VALUE = 1e-6
"""Least singular value, over the greatest, of columns that count as different."""


def smooth_columns(history: History, temperature: Floats, most: int = TEMPERATURE_SPLINES) -> Floats:
    """What a model may miss without it being noise, shape (n, k); at most so many splines on each branch."""
    v = history.inputs
    branch = indicators(v["branch"])
    count = int(np.clip(history.n // (12 * branch.shape[1]), 4, most))
    cycle = indicators(grouped(v["cycle"]))
    parts = [row_tensor_product(branch, bspline_basis(temperature, count))]
    if cycle.shape[1] > 1:
        parts.append(cycle[:, 1:])
    return np.concatenate(parts, axis=1)


def recorded_columns(inputs: Mapping[str, Floats], smooth: Floats) -> Floats:
    """Smooth functions of what else was recorded, orthonormal and free of the columns `smooth` (n, k), shape (n, j).

    Parameters
    ----------
    inputs : mapping of str to ndarray, shape (n,)
        Of a history.
    smooth : ndarray, shape (n, k)
    """
    return free_of(smooth, _functions_of(inputs, COVARIATE_SPLINES, len(smooth) // LEAST_SAMPLES_PER_SPLINE))


def curve_columns(inputs: Mapping[str, Floats], curve: Sequence[Floats], smooth: Floats) -> Floats:
    """What changes the curve with something recorded, orthonormal and free of the columns `smooth` (n, k), (n, j).

    A sweep is a common shape with an offset, a stroke and a shift in temperature, on either branch. What changes these
    with the cycle or the rate, as training and a lagging sensor do, is a product of the curve or its slope with a
    function of what was recorded.

    Parameters
    ----------
    inputs : mapping of str to ndarray, shape (n,)
        Of a history.
    curve : sequence of ndarray, shape (n,)
        The response as predicted, and its slope against temperature.
    smooth : ndarray, shape (n, k)
    """
    parts = [(x - x.mean()) / max(float(np.std(x)), 1e-300) for x in curve]
    on_branch = row_tensor_product(indicators(inputs["branch"]), np.stack(parts, axis=1))
    most = len(smooth) // (LEAST_SAMPLES_PER_SPLINE * on_branch.shape[1])
    return free_of(
        smooth, [row_tensor_product(on_branch, f) for f in _functions_of(inputs, CURVE_CHANGE_SPLINES, most)]
    )


def curve_changes(inputs: Mapping[str, Floats], response: Floats, slope: Floats) -> list[Floats]:
    """What may be wrong with the curve of a record, and change it with something recorded: sets of columns (n, k).

    A sweep is a common shape with an offset, a stroke, a shift in temperature and a width, on either branch. A record
    may have a stroke, a place and a width of its own, as under another load where one curve serves all; and what
    changes stroke and place with the cycle or the rate, as training and a lagging sensor do, is a product of the curve
    or its slope with a function of what was recorded. The first set has the former, each further one what changes with
    one thing recorded, and the last, where there are several, all of these.

    Parameters
    ----------
    inputs : mapping of str to ndarray, shape (n,)
        Of a history.
    response, slope : ndarray, shape (n,)
        The response as predicted, and its derivative by temperature.
    """
    branch = indicators(inputs["branch"])
    weight = branch * np.maximum(np.abs(slope), 1e-300)[:, None]
    middle = branch @ (inputs["temperature"] @ weight / weight.sum(axis=0))
    parts = [_unit(x) for x in (response, slope, slope * (inputs["temperature"] - middle))]
    own = row_tensor_product(branch, np.stack(parts, axis=1))
    moved = row_tensor_product(branch, np.stack(parts[:2], axis=1))
    functions = _functions_of(inputs, CURVE_CHANGE_SPLINES, len(response))
    changed = [row_tensor_product(moved, f) for f in functions]
    every = [np.concatenate(changed, axis=1)] if len(changed) > 1 else []
    return [own, *changed, *every]


def cycle_columns(inputs: Mapping[str, Floats], courses: Floats, known: Floats) -> list[Floats]:
    """What one cycle alone may miss, as where a specimen was out of its seat: a set of columns (n, k) for each cycle.

    None of a record of fewer than `FEWEST_CYCLES`.

    Parameters
    ----------
    inputs : mapping of str to ndarray, shape (n,)
        Of a history.
    courses : ndarray, shape (n, k)
        What it may miss while it lasts, see `smooth_columns` and `curve_changes`.
    known : ndarray, shape (n, j)
        Columns of which the sets are to be free.
    """
    cycle = indicators(grouped(inputs["cycle"]))
    if cycle.shape[1] < FEWEST_CYCLES:
        return []
    return [free_of(known, [courses * on[:, None]]) for on in cycle.T]


def jump_columns(innovations: Floats, block: ChannelBlock, known: Floats) -> tuple[list[Floats], Floats]:
    """Levels that change for good, as where a grip slips: at the greatest innovation, at the two greatest, and so on.

    Parameters
    ----------
    innovations : ndarray, shape (n,)
    block : ChannelBlock
    known : ndarray, shape (n, k)
        Columns of which the sets are to be free.

    Returns
    -------
    sets : list of ndarray, shape (n, j)
    log_prior : ndarray, shape (sets,)
        Each set is one of all that there are of so many samples.
    """
    within = np.flatnonzero(~block.first)
    many = min(MOST_JUMPS, within.size)
    at = within[np.argsort(-np.abs(innovations[within]), kind="stable")[:many]]
    after = (np.arange(innovations.size)[:, None] >= at).astype(float)
    counts = np.arange(1, many + 1)
    ln_sets = gammaln(within.size + 1) - gammaln(counts + 1) - gammaln(within.size - counts + 1)
    return [free_of(known, [after[:, :count]]) for count in counts], -ln_sets - np.log(max(many, 1))


def slope_of(hypothesis: Hypothesis, block: ChannelBlock, theta: Floats) -> Floats:
    """Derivative of a channel as predicted by temperature, at each sample of a block, shape (n,)."""
    inputs = hypothesis.histories[block.history].inputs

    def at(by: float) -> Floats:
        moved = {**inputs, "temperature": inputs["temperature"] + by}
        return hypothesis.predict(theta, block.history, moved)[block.channel]

    return (at(0.05) - at(-0.05)) / 0.1


def free_of(smooth: Floats, parts: Sequence[Floats]) -> Floats:
    """Columns as an orthonormal basis of what they have that the columns `smooth` (n, k) do not."""
    if not parts:
        return np.empty((len(smooth), 0))
    columns = np.concatenate(parts, axis=1)
    axes, size = _axes(smooth)
    axes = axes[:, size > LEAST_SINGULAR_VALUE * size[0]]
    basis, own = _axes(columns - axes @ (axes.T @ columns))
    return np.asarray(basis[:, own > LEAST_SINGULAR_VALUE * np.linalg.norm(columns, axis=0).max()])


def _unit(x: Floats) -> Floats:
    """A series less its mean, of unit spread."""
    return np.asarray((x - x.mean()) / max(float(np.std(x)), 1e-300))


def _functions_of(inputs: Mapping[str, Floats], named: Mapping[str, int], most: int) -> list[Floats]:
    """Splines of what was recorded and varies, as many as are named for each and `most` at most."""
    out = []
    for name, few in named.items():
        x = inputs.get(name)
        if x is None or (name == "order" and "time" in inputs) or np.ptp(x) <= 1e-9 * np.max(np.abs(x)):
            continue
        count = min(few, most, np.unique(x).size)
        if count > 1:
            out.append(bspline_basis(x, count))
    return out


def _axes(columns: Floats) -> tuple[Floats, Floats]:
    """Left singular vectors (n, k) and singular values (k,) of columns, by way of QR, as n is many times k."""
    q, r = np.linalg.qr(columns)
    u, size, _ = np.linalg.svd(r)
    return q @ u[:, : size.size], size
