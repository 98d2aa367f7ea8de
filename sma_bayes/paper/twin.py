"""A twin campaign: data drawn from the published parameters, whose truth is therefore known.

The measurements behind the paper are not published. The twin takes the curves of Eqs. (2), (4) and (7) at the
parameters printed in Tables 3 to 5, for 9 conditions and both branches, and adds noise of the size that
Tables 6 to 8 report. It is in the paper's own units: force [N], displacement [cm], stiffness [N/cm] and a
temperature whose unit nobody knows.

What is not printed is assumed, and each record's `Finding` says so:

- the lower asymptotes A4 and B4 are 0;
- a record spans the central 98.7 % (five reciprocal rates either side of the midpoint) of the wider of its
  two sigmoids, in equal steps, up for heating and down for cooling; the temperatures that were covered on
  the rig can't be recovered, and may have been fewer;
- noise is independent and Gaussian. For stiffness its standard deviation is the printed RMSE; for force and
  displacement, whose RMSE is not printed, it is the same share of the curve's span;
- where a statistic is lost or contradicts others, the number of points is `DEFAULT_POINTS` and the
  noise has the median share of the records for which it is known.

The curves are written out here, apart from the response models, so that one checks the other.
"""

from __future__ import annotations

import hashlib
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from functools import cache
from types import MappingProxyType
from typing import Final

import numpy as np
from scipy.special import expit

from sma_bayes.arrays import Floats
from sma_bayes.errors import UnknownNameError, require_known, require_seed
from sma_bayes.paper.tables import (
    CONDITIONS,
    PARAMETER_TABLES,
    PARAMETER_UNITS,
    STATISTICS_TABLES,
    PrintedCell,
)
from sma_bayes.quantities import ARBITRARY, CHANNELS
from sma_bayes.records.types import Branch, Campaign, Condition, Finding, Record

DEFAULT_POINTS: Final = 100
"""Points of a record whose number can't be worked out from the tables [1]."""

FITTED_PARAMETERS: Final = 6
"""Parameters that the paper's statistics count [1]: R2 and adjusted R2 agree for 6; Eq. (7) identifies 5."""

RECIPROCAL_RATES: Final = 5.0
"""How far a record reaches beyond a midpoint, in units of one over the rate [1]."""

UNITS: Final[Mapping[str, str]] = MappingProxyType(
    {"temperature": ARBITRARY, "force": "N", "displacement": "cm", "stiffness": "N/cm"}
)
"""Units of the paper's tables."""


@dataclass(frozen=True, slots=True)
class Recipe:
    """How one record of the twin is made.

    Attributes
    ----------
    condition : Condition
    branch : Branch
    parameters : mapping of str to PrintedCell
        A1, A2, A3, B1, B2, B3 as printed.
    temperature : ndarray, shape (n,)
        In the order of the sweep [arbitrary].
    curves : mapping of str to ndarray, shape (n,)
        Force [N], displacement [cm] and stiffness [N/cm] without noise.
    points_reason : str
        Where the number of points comes from.
    rmse : PrintedCell
        Of the stiffness, as printed.
    noise_share : float
        Standard deviation of the noise over the span of a curve, of each channel [1].
    """

    condition: Condition
    branch: Branch
    parameters: Mapping[str, PrintedCell]
    temperature: Floats
    curves: Mapping[str, Floats]
    points_reason: str
    rmse: PrintedCell
    noise_share: float

    @property
    def key(self) -> str:
        """Key of the record: ``<condition>-<branch>``."""
        return f"{self.condition.id}-{self.branch.value}"

    @property
    def noise_sd(self) -> dict[str, float]:
        """Standard deviation of the noise of each channel, in its unit."""
        return {channel: self.noise_share * float(np.ptp(curve)) for channel, curve in self.curves.items()}

    @property
    def noise_reason(self) -> str:
        """Where the noise comes from."""
        if self.rmse.sound:
            why = f"since the RMSE of line {self.rmse.line} is {self.rmse.printed} {self.rmse.unit}"
        else:
            doubt = f"the RMSE of line {self.rmse.line} is marked {self.rmse.status}"
            why = f"assumed, the median of the sound records: {doubt}"
        return f"stiffness noise {self.noise_share:.2%} of the span, {why}"


def curves(temperature: Floats, parameters: Mapping[str, float]) -> dict[str, Floats]:
    """Force, displacement and stiffness by Eqs. (2), (4) and (7) with A4 = B4 = 0.

    The stiffness is the ratio of the analytic derivatives, dF/dT = B1 B2 s(b) s(-b) with b = B2 (T - B3) and
    s the logistic function, and likewise for X. Good where the exponents are moderate, as they are here.

    Parameters
    ----------
    temperature : ndarray, shape (n,)
        [unit of A3 and B3].
    parameters : mapping of str to float
        A1, A2, A3, B1, B2, B3.

    Returns
    -------
    dict of str to ndarray, shape (n,)
        ``force`` [unit of B1], ``displacement`` [unit of A1], ``stiffness`` [unit of B1 over that of A1].

    Examples
    --------
    At a common midpoint and rate the stiffness is B1/A1:

    >>> at = curves(np.array([2.0]), {"A1": 0.5, "A2": 3.0, "A3": 2.0, "B1": 1.0, "B2": 3.0, "B3": 2.0})
    >>> {name: float(values[0]) for name, values in at.items()}
    {'force': 0.5, 'displacement': 0.25, 'stiffness': 2.0}
    """
    p = parameters
    a = p["A2"] * (temperature - p["A3"])
    b = p["B2"] * (temperature - p["B3"])
    displacement_slope = p["A1"] * p["A2"] * expit(a) * expit(-a)
    force_slope = p["B1"] * p["B2"] * expit(b) * expit(-b)
    return {
        "force": p["B1"] * expit(b),
        "displacement": p["A1"] * expit(a),
        "stiffness": force_slope / displacement_slope,
    }


def printed_values() -> dict[str, dict[str, PrintedCell]]:
    """Printed parameters of each record, by record key and parameter name.

    Returns
    -------
    dict of str to dict of str to PrintedCell
        18 records of A1, A2, A3, B1, B2, B3; A4 and B4 are not printed.
    """
    return {recipe.key: dict(recipe.parameters) for recipe in recipes()}


def truth(key: str) -> dict[str, float]:
    """Parameter values from which a record of the twin was drawn.

    Parameters
    ----------
    key : str
        Key of the record, such as ``"1A-10mHz-heating"``.

    Returns
    -------
    dict of str to float
        A1 to A3 and B1 to B3 as printed, A4 and B4 zero, in the units of the tables.

    Raises
    ------
    UnknownNameError
        If the twin has no such record.
    """
    printed = printed_values()
    require_known(key, printed, f"the twin has no record {key!r}")
    value = {name: cell.value for name, cell in printed[key].items()}
    a, b = ({name: value[name] for name in PARAMETER_UNITS if name[0] == letter} for letter in "AB")
    return {**a, "A4": 0.0, **b, "B4": 0.0}


def twin_campaign(seed: int = 0, channels: Collection[str] = CHANNELS) -> Campaign:
    """Draw the twin campaign.

    Parameters
    ----------
    seed : int
        Not negative. Each channel of each record has its own random stream, so that its noise does not depend
        on which other channels are drawn.
    channels : collection of str
        Which of force, displacement and stiffness are observed.

    Returns
    -------
    Campaign
        18 records, heating and cooling of 9 conditions, each with a `Finding` that says how it was made.

    Raises
    ------
    UnknownNameError
        If there is no channel, or an unknown one.
    """
    require_seed(seed)
    unknown = sorted(set(channels) - set(CHANNELS))
    if unknown or not channels:
        raise UnknownNameError(
            f"the twin can't observe {', '.join(unknown) or 'nothing'}",
            expected="one or more of " + ", ".join(CHANNELS),
        )
    records = tuple(_draw(recipe, index, seed, channels) for index, recipe in enumerate(recipes()))
    return Campaign(
        name="twin of the published parameters",
        source=f"Tables 3 to 8 as printed, seed {seed}",
        sha256=_digest(records),
        records=records,
        findings=(_ASSUMPTIONS, *(_account(recipe) for recipe in recipes())),
    )


@cache
def recipes() -> tuple[Recipe, ...]:
    """How each of the 18 records is made, in the order of the tables; heating, then cooling."""
    made = tuple(
        _recipe(
            CONDITIONS[condition],
            branch,
            parameters.select(condition, branch),
            statistics.select(condition, branch),
        )
        for parameters, statistics in zip(PARAMETER_TABLES, STATISTICS_TABLES, strict=True)
        for condition in dict.fromkeys(cell.condition for cell in parameters.cells)
        for branch in Branch
    )
    median = float(np.median([recipe.noise_share for recipe in made if recipe.rmse.sound]))
    return tuple(recipe if recipe.rmse.sound else replace(recipe, noise_share=median) for recipe in made)


def _recipe(
    condition: Condition,
    branch: Branch,
    parameters: Mapping[str, PrintedCell],
    statistics: Mapping[str, PrintedCell],
) -> Recipe:
    """How a record is made; the share of its noise is NaN where the RMSE is lost or contradicts others."""
    value = {name: cell.value for name, cell in parameters.items()}
    rmse = statistics["rmse"]
    n, reason = _points(statistics["sse"], rmse)
    low, high = (
        choose(value["A3"] + side / value["A2"], value["B3"] + side / value["B2"])
        for choose, side in ((min, -RECIPROCAL_RATES), (max, RECIPROCAL_RATES))
    )
    start, stop = (low, high) if branch is Branch.HEATING else (high, low)
    temperature = np.linspace(start, stop, n)
    noiseless = curves(temperature, value)
    for array in (temperature, *noiseless.values()):  # recipes are shared between calls
        array.setflags(write=False)
    share = float(rmse.value / np.ptp(noiseless["stiffness"])) if rmse.sound else np.nan
    return Recipe(condition, branch, parameters, temperature, noiseless, reason, rmse, share)


def _points(sse: PrintedCell, rmse: PrintedCell) -> tuple[int, str]:
    """Number of points of a record, and where it comes from."""
    for cell in (sse, rmse):
        if not cell.sound:
            doubt = f"the {cell.quantity.upper()} of line {cell.line} is marked {cell.status}"
            return DEFAULT_POINTS, f"{DEFAULT_POINTS} points, assumed: {doubt}"
    n = round(sse.value / rmse.value**2) + FITTED_PARAMETERS
    return n, f"{n} points: SSE/RMSE**2 of lines {sse.line} and {rmse.line}, plus {FITTED_PARAMETERS}"


def _draw(recipe: Recipe, index: int, seed: int, channels: Collection[str]) -> Record:
    observed = {}
    for number, channel in enumerate(CHANNELS):
        if channel in channels:
            rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(index, number)))
            curve = recipe.curves[channel]
            observed[channel] = curve + recipe.noise_sd[channel] * rng.standard_normal(curve.size)
    return Record(
        condition=recipe.condition,
        branch=recipe.branch,
        inputs={"temperature": recipe.temperature},
        observed=observed,
        row=np.arange(1, recipe.temperature.size + 1),
        units={name: UNITS[name] for name in ("temperature", *observed)},
        source=f"line {recipe.parameters['A1'].line} of the printed tables",
    )


_ASSUMPTIONS: Final = Finding(
    kind="assumed",
    message=(
        "drawn from the published parameters, not measured; assumed, since not printed: A4 = B4 = 0, the "
        "range of temperature, and the noise of force and displacement (as large a share of the span as that "
        "of the stiffness); the unit of temperature is not known"
    ),
)


def _account(recipe: Recipe) -> Finding:
    doubts: dict[str, list[str]] = {}
    for name, cell in recipe.parameters.items():
        if not cell.sound:
            doubts.setdefault(f"marked {cell.status}: {cell.reason}", []).append(name)
    doubted = (f"{' and '.join(names)} {reason}" for reason, names in doubts.items())
    return Finding(
        kind="twin",
        message="; ".join((recipe.points_reason, recipe.noise_reason, *doubted)),
        count=recipe.temperature.size,
        condition=recipe.condition.id,
        branch=recipe.branch.value,
    )


def _digest(records: tuple[Record, ...]) -> str:
    """SHA-256 of everything that a fit of these records can depend on."""
    digest = hashlib.sha256()
    for record in records:
        digest.update(repr((record.key, sorted(record.units.items()))).encode())
        for values in (record.temperature, *record.observed.values()):
            digest.update(np.ascontiguousarray(values).tobytes())
    return digest.hexdigest()
