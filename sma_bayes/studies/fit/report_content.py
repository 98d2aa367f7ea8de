"""What a report says of a finished fit: its typed document in the units and under the names that people see."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Final

from sma_bayes.disk import quoted
from sma_bayes.paper.twin import printed_values
from sma_bayes.quantities import QUANTITIES, SPECIMEN_QUANTITY
from sma_bayes.records.types import setting_unit
from sma_bayes.report.averages import average_factors
from sma_bayes.report.content import (
    Channel,
    Content,
    Estimate,
    Number,
    ParameterResult,
    PrintedComparison,
    RecordContent,
)
from sma_bayes.report.notation import compact, unit_label
from sma_bayes.response import DEFAULT_MODEL
from sma_bayes.runs.declared_units import Shown, ShownUnit, shown_as, shown_units
from sma_bayes.runs.fit_document import (
    CalibrationSummary,
    FitFindings,
    HeldSummary,
    Measure,
    RecordSummary,
)
from sma_bayes.runs.outputs import StoredRun
from sma_bayes.runs.schema import Factor
from sma_bayes.runs.shown import in_shown_units, of_parameters
from sma_bayes.studies.fit.truth import is_simulated, known_truth, thermometer_offsets

TWIN_SOURCE: Final = "Tables 3 to 8 as printed"
"""How the source of the paper's twin campaign begins."""


def report_content(run: StoredRun) -> Content:
    """What the report of a finished run says."""
    units = shown_units(run.summary.records)
    summary = in_shown_units(run.summary, units)
    records = tuple(
        _record(shown, stored, units)
        for shown, stored in zip(summary.records, run.summary.records, strict=True)
    )
    return Content(
        records=records,
        loops=summary.loops,
        findings=summary.findings,
        printed=_printed(records) if is_twin(summary) else (),
        averages=tuple(f for e in summary.correlation_average for f in average_factors(e, e.data or "")),
        document=summary,
        priors=run.priors,
        command=_command(summary),
        truth=known_truth(run, records),
        offsets=thermometer_offsets(run),
    )


def is_twin(summary: FitFindings) -> bool:
    """Whether a run is one of the campaign drawn from the paper's printed parameters."""
    keys = {record.key for record in summary.records}
    return summary.source.startswith(TWIN_SOURCE) and keys <= set(printed_values())


def _record(r: RecordSummary, stored: RecordSummary, units: Shown) -> RecordContent:
    """What is said of a record, in the units in which people see it and as it is stored."""
    parameters = of_parameters(stored, units)
    names = {channel: q.name for channel, q in r.quantities.items()}
    temperature = r.temperature
    measured = {**r.quantities, "temperature": Measure(name="temperature", unit=temperature.unit)}
    return RecordContent(
        document=r,
        key=r.key,
        condition=r.condition,
        branch=r.branch,
        converged=r.converged,
        adequate=r.adequate,
        model=r.model,
        settings={k: _setting(k, v, names, units) for k, v in r.settings.items()},
        temperature_unit=temperature.unit,
        temperature_range=(temperature.lowest, temperature.highest),
        temperature_sd=temperature.sd or 0.0,
        degrees=shown_as(stored.temperature.unit, units),
        channels=tuple(_channel(c, q, r, units) for c, q in r.quantities.items()),
        held=tuple(_held(c, h, names) for c, h in r.held.items()),
        calibration=tuple(
            calibration_text(k, measured[c])
            for c, k in r.calibration.items()
            if c in measured and (k.relative_scale_sd or k.offset_sd)
        ),
        parameters=tuple(
            ParameterResult(
                **dict(p),
                name=n,
                at_bound=n in r.at_bound,
                shown=parameters.get(n, ShownUnit(p.unit, p.unit, 1.0)),
            )
            for n, p in r.parameters.items()
        ),
    )


def _setting(setting: str, value: float, names: Mapping[str, str], units: Shown) -> Number:
    """A setting as it is declared; else the stress of a specimen in the unit of the measured one, or in MPa."""
    specimen = bool(set(names.values()) & set(SPECIMEN_QUANTITY.values()))
    unit = setting_unit(setting, specimen=specimen)
    shown = units.get(setting)
    if shown is None and setting == "load" and specimen:
        shown = units.get(SPECIMEN_QUANTITY["force"]) or ShownUnit(unit, "MPa", 1e-6)
    return Number(value, unit) if shown is None else Number(shown.value(value), shown.shown)


def _channel(channel: str, quantity: Measure, r: RecordSummary, units: Shown) -> Channel:
    def agreement(found: Mapping[str, Mapping[str, Factor]]) -> dict[str, Estimate]:
        units = {"r": "1", "r2": "1", "adj_r2": "1", "rmse": quantity.unit}
        return {n: Estimate.of(f, units[n]) for n, f in found.get(channel, {}).items() if n in units}

    name = quantity.name
    goodness = r.fit.get(channel)
    return Channel(
        channel=channel,
        name=name,
        symbol=QUANTITIES[name].symbol if name in QUANTITIES else "",
        unit=quantity.unit,
        observed=channel in r.channels,
        fit=goodness.as_json() if goodness else {},
        measured=agreement(r.correlation),
        replicated=agreement(r.correlation_replicated),
        scale=units[name].factor if name in units and units[name].shown == quantity.unit else 1.0,
    )


def _held(channel: str, held: HeldSummary, names: Mapping[str, str]) -> str:
    unit = unit_label(held.unit)
    name = names.get(channel, channel)
    if name == channel and set(names.values()) & set(SPECIMEN_QUANTITY.values()):
        name = SPECIMEN_QUANTITY.get(channel, channel)
    return f"{name} held at {compact(held.mean)} {unit} (sd {compact(held.sd)} {unit})"


def calibration_text(c: CalibrationSummary, quantity: Measure) -> str:
    """How well the calibration of a quantity is known."""
    known = [f"scale known to {100 * c.relative_scale_sd:.2g} %"] if c.relative_scale_sd else []
    known += [f"offset known to {compact(c.offset_sd)} {unit_label(quantity.unit)}"] if c.offset_sd else []
    return f"{quantity.name}: {', '.join(known)} (sd)"


def _printed(records: Iterable[RecordContent]) -> tuple[PrintedComparison, ...]:
    cells = printed_values()
    return tuple(
        PrintedComparison(r.key, r.condition, r.branch, p.name, cell, p.estimate, p.mean, p.sd)
        for r in records
        for p in r.model_parameters
        for cell in [cells[r.key].get(p.name)]
        if cell is not None and p.mean is not None and p.sd is not None
    )


def _command(summary: FitFindings) -> str:
    options = summary.options
    common = [f"--seed {summary.seed}", f"--noise {options.noise}"]
    if summary.data_dir:
        common.insert(0, f"--data {quoted(summary.data_dir)}")
    if options.pool == "none" and (is_twin(summary) or is_simulated(summary)):
        verb = "sma-bayes demo --paper --out NEW" if is_twin(summary) else "sma-bayes demo --out NEW"
        return " ".join((verb, *common))
    if options.model != DEFAULT_MODEL:
        common.append(f"--model {options.model}")
    if options.extrapolate:
        common.append(f"--extrapolate {options.extrapolate}")
    source = quoted(summary.source or "PATH")
    return " ".join(
        (f"sma-bayes fit {source} --out NEW", *common, f"--pool {options.pool}", "--priors priors.toml")
    )
