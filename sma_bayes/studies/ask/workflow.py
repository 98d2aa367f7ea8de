"""Questions to a finished fit: what a temperature gives, and which temperature gives a wanted value."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Final, TypedDict

import numpy as np
from scipy.special import ndtri

from sma_bayes.arrays import Bools, Floats
from sma_bayes.assess.at import IntervalAt, credible_at, interval, predictive_at
from sma_bayes.assess.bands import bias_draws
from sma_bayes.assess.draws import RecordDraws
from sma_bayes.assess.inverse import Passage, finer, met, passages, search_grid
from sma_bayes.errors import MeasurementError, QuantityError, SmaBayesError, UnknownNameError, require_known
from sma_bayes.limits import DEGREES
from sma_bayes.quantities import (
    ARBITRARY,
    SPECIMEN_QUANTITY,
    can_convert,
    convert,
    number_and_unit,
    unit_text,
)
from sma_bayes.records.plausibility import ABSOLUTE_ZERO
from sma_bayes.records.types import Branch
from sma_bayes.response.arrangement import ArrangedSpring, Arrangement, overall_stiffness
from sma_bayes.runs.fit_document import FitFindings, RecordSummary
from sma_bayes.runs.outputs import read_run
from sma_bayes.runs.stored_draws import draws_of
from sma_bayes.studies.ask.schema import (
    AnswersDocument,
    BestTemperature,
    CredibleInterval,
    MetAt,
    StatedAnswer,
    StatedPassage,
    StatedStretch,
    ValuesAt,
    ValuesDocument,
    ValuesOfRecord,
)

SCHEMA: Final = "sma-bayes/ask/1"
AT_SCHEMA: Final = "sma-bayes/ask-at/1"
OVERALL: Final = "overall_stiffness"
"""Stiffness of the spring together with its bias spring, Eq. (8)."""
WANTED: Final = ("stiffness", "force", "displacement", OVERALL)
"""What can be asked for; one at a time. Of a specimen they mean modulus, stress, strain."""
TOLERANCE: Final = "5 %"
PROBABILITY: Final = 0.9

Curve = Callable[[Floats], Floats]


@dataclass(frozen=True, slots=True)
class _Terms:
    """On what terms a question is answered.

    Attributes
    ----------
    probability : float
    extrapolate : float
        How far beyond the measured temperatures to search [unit of temperature].
    temperature_sd : float
        Standard deviation of the error of the controller's temperature [unit of temperature].
    temperature_unit : str or None
        Unit of temperature of question and answer; None for that of the fit.
    """

    probability: float
    extrapolate: float
    temperature_sd: float
    temperature_unit: str | None


@dataclass(frozen=True, eq=False)
class FitSource:
    """A fit that is asked: one in a folder, or one in memory.

    Attributes
    ----------
    folder : str or Path
        Its name, for messages.
    summary : FitFindings
    draws : callable
        Draws of the record of an entry of ``records``.
    """

    folder: str | Path
    summary: FitFindings
    draws: Callable[[RecordSummary], RecordDraws]


class Question(TypedDict, total=False):
    """What `ask` takes beside the fit."""

    at: str | Sequence[str] | None
    unit: str | Sequence[str] | None
    stiffness: str | None
    force: str | None
    displacement: str | None
    overall_stiffness: str | None
    tolerance: str
    probability: float
    condition: str | None
    branch: str | None
    extrapolate: float
    temperature_sd: float
    temperature_unit: str | None


def ask(
    folder: str | Path | FitSource,
    *,
    at: str | Sequence[str] | None = None,
    unit: str | Sequence[str] | None = None,
    stiffness: str | None = None,
    force: str | None = None,
    displacement: str | None = None,
    overall_stiffness: str | None = None,
    tolerance: str = TOLERANCE,
    probability: float = PROBABILITY,
    condition: str | None = None,
    branch: str | None = None,
    extrapolate: float = 0.0,
    temperature_sd: float = 0.0,
    temperature_unit: str | None = None,
) -> dict[str, Any]:
    """What temperatures give, or which temperatures give a wanted value, from the posteriors of a finished fit.

    Parameters
    ----------
    folder : str, Path or FitSource
        Output folder of `fit` or `demo`; or a fit, wherever it is.
    at : str or sequence of str, optional
        Temperatures with their unit, ``"60 degC"``, at which all quantities of the records are told.
    unit : str or sequence of str, optional
        Units of the answer to `at`, such as ``"N/mm"``, each for the quantities of its kind; else those of the fit.
    stiffness, force, displacement, overall_stiffness : str, optional
        The wanted value with its unit, ``"130 N/m"``, in which the answer comes too; exactly one of them. Of a specimen
        they mean modulus, stress and strain. `overall_stiffness` is that of the spring with the bias spring which the
        fit was told of.
    tolerance : str
        How far off the value may be: a share, ``"5 %"``, or in a unit, ``"4 N/m"``.
    probability : float
        With which the value is to be met, and which the intervals hold [1].
    condition, branch : str, optional
        Only this condition, only ``heating`` or ``cooling``.
    extrapolate : float
        How far beyond the measured temperatures to search [unit of temperature]; what is found there is marked.
    temperature_sd : float
        Standard deviation of the difference between the temperature that a controller sets and that of the alloy
        [unit of temperature]. It makes every set of temperatures narrower; passages are those of the curves.
    temperature_unit : str, optional
        Unit of all temperatures and of their differences, asked and answered: ``"degF"``. By default that of the fit.

    Returns
    -------
    dict
        ``sma-bayes/ask/1``, or for `at` ``sma-bayes/ask-at/1``: see docs/reference/files.md.

    Raises
    ------
    SmaBayesError
        If neither temperatures nor exactly one value are asked about, or probability or range make no sense.
    QuantityError
        If a value has no unit, or an unknown or wrong one.
    UnknownNameError
        If there is no such condition or branch.
    MeasurementError
        If none of the records has what is asked for.
    OutputError
        If the folder holds no finished fit.
    """
    if isinstance(folder, FitSource):
        run = folder
    else:
        stored = read_run(Path(folder))
        run = FitSource(
            stored.folder, stored.summary, partial(draws_of, stored.folder, seed=stored.summary.seed)
        )
    given = dict(zip(WANTED, (stiffness, force, displacement, overall_stiffness), strict=True))
    wanted = {channel: value for channel, value in given.items() if value is not None}
    asked = [at] if isinstance(at, str) else list(at or ())
    if len(wanted) + bool(asked) != 1:
        names = [name.replace("_", " ") for name in wanted] + ["temperatures"] * bool(asked)
        raise SmaBayesError(
            f"{', '.join(names[:-1])} and {names[-1]} are asked for at once"
            if wanted or asked
            else "no value is asked for",
            expected=f"exactly one of {', '.join(WANTED)}, such as --stiffness '130 N/m', or --at '60 degC'",
        )
    if unit and not asked:
        raise SmaBayesError(
            f"--unit {unit!r} without --at",
            expected="--unit with --at; a wanted value is answered in its own unit",
        )
    if not 0.0 < probability <= 1.0:
        raise SmaBayesError(f"probability {probability}", expected="more than 0 and at most 1")
    for name, number in (("extrapolate", extrapolate), ("temperature-sd", temperature_sd)):
        if not 0.0 <= number <= DEGREES.value:
            raise SmaBayesError(
                f"--{name} {number}",
                expected=f"a finite number of degrees, at least 0 and at most {DEGREES.value:g}",
            )
    records = _selected(run, condition, branch)
    terms = _Terms(probability, extrapolate, temperature_sd, temperature_unit)
    if asked:
        units = [unit] if isinstance(unit, str) else list(unit or ())
        return _ask_at(run, records, asked, units, terms)
    ((channel, value),) = wanted.items()
    able = [r for r in records if not _lacking(run, r, channel)]
    if not able:
        has = dict.fromkeys(_name(r, c) for c in WANTED for r in records if not _lacking(run, r, c))
        which = records[0].key if len(records) == 1 else f"any of the {len(records)} records"
        raise MeasurementError(
            f"no {_named(_name(records[0], channel))} follows from {which}: {_lacking(run, records[0], channel)}",
            file=run.folder,
            expected="one of " + ", ".join(f"--{n.replace('_', '-')}" for n in has),
        )
    answers = [_answer(run, r, channel, value, tolerance, terms) for r in able]
    return AnswersDocument.about(
        terms,
        schema=SCHEMA,
        **_of_fit(run),
        quantity=answers[0].quantity,
        value=value,
        tolerance=tolerance,
        converged=all(a.converged for a in answers),
        answers=tuple(answers),
        without={r.key: _lacking(run, r, channel) for r in records if r not in able},
    ).as_json()


def _of_fit(run: FitSource) -> dict[str, Any]:
    """Which fit an answer comes from."""
    return {name: getattr(run.summary, name) for name in ("campaign", "seed", "data_sha256")}


def _ask_at(
    run: FitSource,
    records: Sequence[RecordSummary],
    asked: Sequence[str],
    units: Sequence[str],
    terms: _Terms,
) -> dict[str, Any]:
    for text in units:
        if not any(can_convert(q.unit, text) for r in records for q in r.quantities.values()):
            raise QuantityError(
                f"--unit {text!r} is of no quantity of the fit",
                expected="a unit that one of these can be turned into: "
                + ", ".join(dict.fromkeys(q.unit for r in records for q in r.quantities.values())),
            )
    answers = [_answer_at(run, r, asked, units, terms) for r in records]
    return ValuesDocument.about(
        terms,
        schema=AT_SCHEMA,
        **_of_fit(run),
        at=tuple(asked),
        converged=all(a.converged for a in answers),
        answers=tuple(answers),
    ).as_json()


def _answer_at(
    run: FitSource, summary: RecordSummary, asked: Sequence[str], units: Sequence[str], terms: _Terms
) -> ValuesOfRecord:
    """What one record gives at the temperatures: all of them, also those that it can't tell of, in the asked order."""
    draws = run.draws(summary)
    stored = summary.temperature.unit
    degrees = terms.temperature_unit or number_and_unit(asked[0], what="temperature")[1] or stored
    given = np.array([asked_temperature(text, stored, degrees) for text in asked])
    low, high = (_temperature(t, stored, degrees) for t in (draws.coldest, draws.hottest))
    known = (given >= low - terms.extrapolate) & (given <= high + terms.extrapolate)
    beyond = (given < low) | (given > high)
    error = terms.temperature_sd * _normal_scores(draws.size) if terms.temperature_sd else 0.0
    step = _temperature(1.0, stored, degrees) - _temperature(0.0, stored, degrees)
    at = np.array([_converted(t, degrees, stored, "temperature") for t in given])
    quantities = {}
    for channel in (*draws.quantities, *((OVERALL,) if not _lacking(run, summary, OVERALL) else ())):
        own = summary.quantities["stiffness" if channel == OVERALL else channel].unit
        unit = next((u for u in units if can_convert(own, u)), own)
        curve = credible_at(_curve(run, draws, channel, own), at, terms.probability, error / step)
        new = predictive_at(draws.curves, channel, at, terms.probability, run.summary.seed, error / step)
        quantities[channel] = ValuesAt(
            name=_name(summary, channel),
            unit=unit,
            **_where_known("", curve, own, unit, known),
            **_where_known("pred_", new, own, unit, known),
        )
    return ValuesOfRecord.about(
        summary,
        temperature_unit=degrees,
        temperature=tuple(given.tolist()),
        measured=(low, high),
        extrapolated=tuple(beyond.tolist()),
        quantities=quantities,
        caution=_caution(summary) if "stiffness" in quantities else None,
    )


def _caution(summary: RecordSummary) -> str | None:
    """What is to be doubted of a stiffness."""
    return None if summary.path.kind == "path_slope" else summary.path.message


def asked_temperature(text: str, stored: str, degrees: str) -> float:
    """A temperature that is asked for, ``"60 degC"``, in a unit [degrees].

    Parameters
    ----------
    text : str
    stored : str
        Unit of the temperature of the measurements.
    degrees : str
        Unit of the answer.

    Raises
    ------
    QuantityError
        If it is no temperature, has no unit, or lies below absolute zero or beyond `DEGREES`.
    """
    number, unit = number_and_unit(text, what="temperature")
    if "," in unit or ";" in unit:
        raise QuantityError(
            f"temperature {text!r} is more than one",
            expected=f"one temperature, such as '{number:g} {degrees}'",
            remedy="give each an --at of its own (in Python, a list)",
        )
    if not unit and stored != ARBITRARY:
        raise QuantityError(
            f"temperature {text!r} has no unit",
            expected=f"a number with its unit, such as '{number:g} {degrees}'",
        )
    _temperature(0.0, stored, unit or stored)  # refuses what is no unit of temperature
    value = _converted(number, unit or stored, stored, "temperature")
    least = ABSOLUTE_ZERO if stored == "degC" else -DEGREES.value
    if not least <= value <= DEGREES.value:
        raise QuantityError(
            f"temperature {text!r} is out of range", expected=f"{least:g} to {DEGREES.value:g} {stored}"
        )
    return _converted(value, stored, degrees, "temperature")


def _where_known(
    prefix: str, found: IntervalAt | None, stored: str, unit: str, known: Bools
) -> dict[str, tuple[float | None, ...]]:
    """Ends and median in the unit of the answer, by name; None at temperatures of which nothing is known."""
    out: dict[str, tuple[float | None, ...]] = {}
    for name in ("low", "median", "high"):
        values = np.full(known.size, np.nan) if found is None else convert(getattr(found, name), stored, unit)
        told = known & (found is not None)
        out[prefix + name] = tuple(float(v) if k else None for v, k in zip(values, told, strict=True))
    return out


def _selected(run: FitSource, condition: str | None, branch: str | None) -> list[RecordSummary]:
    records = list(run.summary.records)
    require_known(branch, [b.value for b in Branch], f"unknown branch {branch!r}")
    require_known(
        condition, {r.condition for r in records}, f"unknown condition {condition!r}", file=run.folder
    )
    found = [
        r for r in records
        if condition in (None, r.condition) and branch in (None, r.branch)
    ]  # fmt: skip
    if not found:
        raise UnknownNameError(
            f"{condition or 'the campaign'} has no {branch} branch",
            file=run.folder,
            expected=", ".join(r.key for r in records if condition in (None, r.condition)),
        )
    return found


def _name(record: RecordSummary, channel: str) -> str:
    """What a channel is called: strain for the displacement of a specimen."""
    specimen = {q.name for q in record.quantities.values()} & set(SPECIMEN_QUANTITY.values())
    return SPECIMEN_QUANTITY.get(channel, channel) if specimen else channel


def _named(name: str) -> str:
    return name.replace("_", " ")


def _lacking(run: FitSource, record: RecordSummary, channel: str) -> str:
    """Why a record can't tell of a channel; empty where it can."""
    known = record.quantities
    if channel != OVERALL:
        if channel in known:
            return ""
        held = record.held.get(channel)
        if held:
            return f"the rig held it at {held.mean:.4g} {unit_text(held.unit)}"
        if channel == "stiffness":
            return "neither it nor both of force and displacement were measured"
        return "it was not measured"
    if not run.summary.options.bias_spring:
        return "the fit was made without a bias spring (--arrangement)"
    if "stiffness" not in known:
        return "no stiffness follows from the record"
    if known["stiffness"].name != "stiffness" or ARBITRARY in known["stiffness"].unit:
        return "its stiffness can't be compared with that of the bias spring"
    return ""


def _answer(
    run: FitSource, summary: RecordSummary, asked: str, value: str, tolerance: str, terms: _Terms
) -> StatedAnswer:
    draws = run.draws(summary)
    channel = "stiffness" if asked == OVERALL else asked
    stored = (summary.temperature.unit, summary.quantities[channel].unit)
    what = _named(_name(summary, asked))
    unit, target, bounds = wanted_value(value, tolerance, stored[1], what)
    degrees = stored[0] if terms.temperature_unit is None else terms.temperature_unit
    low, high = (_temperature(t, stored[0], degrees) for t in (draws.coldest, draws.hottest))
    ends = (low - terms.extrapolate, high + terms.extrapolate)
    as_stored = _curve(run, draws, asked, stored[1])

    def curve(temperature: Floats) -> Floats:
        return convert(as_stored(convert(temperature, degrees, stored[0])), stored[1], unit)

    t = search_grid(low, high, terms.extrapolate)
    found = passages(curve, t, target)
    level = terms.probability
    error = terms.temperature_sd * _normal_scores(draws.size)
    grid = finer(t, _temperatures(found, error))
    values = curve(grid)
    set_values = curve(grid + error[:, None]) if terms.temperature_sd else values

    def met_between(least: float, greatest: float) -> MetAt:
        surely = met(grid, set_values, (least, greatest))
        best, top = surely.best
        most = BestTemperature(temperature=best, probability=top, extrapolated=not low <= best <= high)
        return MetAt(
            intervals=tuple(
                StatedStretch.about(s, extrapolated=bool(s.low < low or s.high > high))
                for s in surely.at_least(level)
            ),
            best=most if top > 0.0 else None,
        )

    measured = values[:, (grid >= low) & (grid <= high)]
    reachable, stays_below, stays_above = _reached(curve, found, target, (low, high), ends)
    return StatedAnswer.about(
        summary,
        quantity=_name(summary, asked),
        unit=unit,
        temperature_unit=degrees,
        measured=(low, high),
        searched=ends,
        target=target,
        bounds=bounds,
        least=CredibleInterval.about(interval(measured.min(axis=1), level)),
        greatest=CredibleInterval.about(interval(measured.max(axis=1), level)),
        reachable=reachable,
        stays_below=stays_below,
        stays_above=stays_above,
        passages=tuple(_passage(p, level, low, high) for p in found),
        within=met_between(*bounds),
        at_least=met_between(target, np.inf),
        at_most=met_between(-np.inf, target),
        caution=_caution(summary) if channel == "stiffness" else None,
    )


def wanted_value(
    asked: str, tolerance: str, stored: str, what: str
) -> tuple[str, float, tuple[float, float]]:
    """Unit of a question, the wanted value, and the bounds within which it will do [that unit].

    Parameters
    ----------
    asked : str
        Value with its unit.
    tolerance : str
        How far off it may be: a share, ``"5 %"``, or in a unit, ``"4 N/m"``.
    stored : str
        Unit of the fit, in which a number without a unit is understood where that has none itself.
    what : str
        Name of the quantity.

    Raises
    ------
    QuantityError
        If a number has no unit or another one, or the tolerance is nothing.
    """
    value, given = number_and_unit(asked, what=what)
    unit = given or stored
    _in_unit(asked, stored, stored, what)  # refuses what has no unit, or one of another kind
    text = tolerance.strip()
    if text.endswith("%"):
        share, rest = number_and_unit(text[:-1], what="tolerance")
        margin = abs(value) * share / 100.0
        if rest:
            raise QuantityError(f"tolerance {tolerance!r}", expected="such as '5 %' or '4 N/m'")
    else:
        margin = _in_unit(text, stored, unit, "tolerance")
    if not margin > 0.0:
        raise QuantityError(f"tolerance {tolerance!r} of {asked!r}", expected="more than 0")
    return unit, value, (value - margin, value + margin)


def _in_unit(text: str, stored: str, unit: str, what: str) -> float:
    number, given = number_and_unit(text, what=what)
    if not given and stored not in ("1", ARBITRARY):
        raise QuantityError(
            f"{what} {text!r} has no unit", expected=f"a number with its unit, such as '{number:g} {unit}'"
        )
    return _converted(number, given or stored, unit, what)


def _temperature(value: float, stored: str, unit: str) -> float:
    try:
        convert(0.0, unit, stored, what="temperature")
    except QuantityError as error:
        known = (
            f"{ARBITRARY!r}, since the unit of the fit is not known"
            if stored == ARBITRARY
            else "degC, degF or kelvin"
        )
        raise error.but(expected=known, remedy=_meant(error)) from None
    return _converted(value, stored, unit, "temperature")


def _converted(value: float, unit: str, to: str, what: str) -> float:
    try:
        return float(convert(value, unit, to, what=what))
    except QuantityError as error:
        raise error.but(remedy=_meant(error)) from None


def _meant(error: QuantityError) -> str | None:
    """What was meant, where that can be told; what else is proposed there is meant for files."""
    remedy = str(error.remedy or "")
    return remedy if remedy.startswith("did you mean") else None


def _curve(run: FitSource, draws: RecordDraws, channel: str, unit: str) -> Curve:
    if channel != OVERALL:
        return lambda temperature: draws.curve(channel, temperature)
    stated = run.summary.options.bias_spring
    assert stated is not None  # or the record would lack it
    bias = ArrangedSpring(Arrangement(stated.arrangement), stated.stiffness, stated.sd)
    k2 = bias_draws(bias, run.summary.seed, draws.key, draws.size, unit)[:, None]
    return lambda temperature: overall_stiffness(draws.curve("stiffness", temperature), k2, bias.arrangement)


def _normal_scores(size: int) -> Floats:
    """Quantiles of the standard normal distribution in an order of their own, one for each draw, shape (size,)."""
    scores = ndtri((np.arange(size) + 0.5) / size)
    return np.asarray(np.random.default_rng(0).permutation(scores))


def _temperatures(found: Sequence[Passage], error: Floats) -> Floats:
    """Settings of the temperature at which a curve passes the value."""
    every = np.concatenate([p.draws - error for p in found]) if found else np.empty(0)
    return np.asarray(every[np.isfinite(every)])


def _reached(
    curve: Curve, found: Sequence[Passage], target: float, measured: tuple[float, float], ends: tuple[float, float]
) -> tuple[float, float, float]:  # fmt: skip
    """Shares of the curves that pass the value where it was measured, and that stay below or above it all along."""
    above = curve(np.array(ends))[:, 0] >= target
    passing = np.zeros(above.shape, dtype=bool)
    inside = passing.copy()
    for p in found:
        passing |= np.isfinite(p.draws)
        inside |= (p.draws >= measured[0]) & (p.draws <= measured[1])
    shares = inside, ~passing & ~above, ~passing & above
    reachable, below, over = (float(np.mean(s)) for s in shares)
    return reachable, below, over


def _passage(p: Passage, level: float, low: float, high: float) -> StatedPassage:
    found = interval(p.draws[np.isfinite(p.draws)], level)
    return StatedPassage.about(
        p,
        low=found.low,
        median=found.median,
        high=found.high,
        extrapolated=bool(found.low < low or found.high > high),
    )
