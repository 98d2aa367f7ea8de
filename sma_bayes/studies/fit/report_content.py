"""What a report says of a finished fit: its typed document in the units and under the names that people see."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Final, Protocol

from sma_bayes.assess.adequacy import Missed
from sma_bayes.paper.twin import printed_values
from sma_bayes.quantities import QUANTITIES, SPECIMEN_QUANTITY
from sma_bayes.records.types import setting_unit
from sma_bayes.report.averages import average_factors
from sma_bayes.report.content import (
    Channel,
    Content,
    Estimate,
    NearestParameter,
    Number,
    ParameterResult,
    PredictiveCheck,
    PrintedComparison,
    Provenance,
    QuantityRow,
    RecordContent,
    TransformationTemperature,
)
from sma_bayes.report.notation import compact, unit_label
from sma_bayes.response import DEFAULT_MODEL
from sma_bayes.runs.declared_units import Shown, ShownUnit, in_shown_units, of_parameters, shown_units
from sma_bayes.runs.fit_document import (
    CalibrationSummary,
    CheckSummary,
    DiscrepancySummary,
    FitFindings,
    HeldSummary,
    Measure,
    NearestSummary,
    ParameterSummary,
    QuantitySummary,
    RecordSummary,
    TransformationSummary,
)
from sma_bayes.runs.outputs import StoredRun
from sma_bayes.runs.schema import Factor
from sma_bayes.runs.store import or_nan
from sma_bayes.studies.fit.truth import is_simulated, known_truth, thermometer_offsets

TWIN_SOURCE: Final = "Tables 3 to 8 as printed"
"""How the source of the paper's twin campaign begins."""
STATISTICS: Final = {
    "greatest": "largest residual",
    "lag1": "correlation of neighbours",
    "block_means": "mean residual by temperature",
    "sweep_means": "mean residual by sweep",
    "left_out_sweeps": "sweeps left out",
    "sd_by_temperature": "spread by temperature",
    "sd_by_response": "spread by response",
    "pit": "shape of the noise",
}
"""Names of the statistics of predictive checks, for people."""
QUANTITY_NAMES: Final = {
    "hysteresis_width": "hysteresis width",
    "loop_area": "loop area",
    "least_stiffness": "least {stiffness}",
    "greatest_stiffness": "greatest {stiffness}",
    "stiffness_ratio": "{stiffness} ratio",
}
"""Names of quantities of branches and loops, for people; a specimen's stiffness is its modulus."""


def report_content(run: StoredRun) -> Content:
    """What the report of a finished run says.

    Parameters
    ----------
    run : StoredRun
    """
    units = shown_units(run.summary.records)
    summary = in_shown_units(run.summary, units)
    records = tuple(
        _record(shown, of_parameters(stored, units), units)
        for shown, stored in zip(summary.records, run.summary.records, strict=True)
    )
    names = {r.condition: {c.channel: c.name for c in r.channels} for r in records}
    return Content(
        campaign=summary.campaign,
        source=summary.source,
        records=records,
        loops=tuple(_quantity(q, names.get(q.condition, {})) for q in summary.loops),
        findings=summary.findings,
        printed=_printed(records) if is_twin(summary) else (),
        averages=tuple(f for e in summary.correlation_average for f in average_factors(e, e.data or "")),
        provenance=_provenance(run),
        truth=known_truth(run, records),
        offsets=thermometer_offsets(run),
    )


def is_twin(summary: FitFindings) -> bool:
    """Whether a run is one of the campaign drawn from the paper's printed parameters."""
    keys = {record.key for record in summary.records}
    return summary.source.startswith(TWIN_SOURCE) and keys <= set(printed_values())


def _record(r: RecordSummary, scale: Mapping[str, float], units: Shown) -> RecordContent:
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
        reasons=r.why,
        model=r.model,
        model_reason=r.model_choice.reason if r.model_choice else "",
        nearest=tuple(_nearest(name, p, names) for name, p in r.nearest.items()),
        missed=tuple(_missed(c, m) for c, m in r.discrepancy.items()),
        settings={k: _setting(k, v, names, units) for k, v in r.settings.items()},
        temperature_unit=temperature.unit,
        temperature_range=(temperature.lowest, temperature.highest),
        temperature_sd=temperature.sd or 0.0,
        channels=tuple(_channel(c, q, r, units) for c, q in r.quantities.items()),
        held=tuple(_held(c, h, names) for c, h in r.held.items()),
        calibration=tuple(_calibration(k, measured[c]) for c, k in r.calibration.items() if c in measured),
        parameters=tuple(_parameter(n, p, r, names, scale.get(n, 1.0)) for n, p in r.parameters.items()),
        free_directions=tuple((d.text, d.contraction or 0.0) for d in r.free_directions),
        path_kind=r.path.kind,
        path_message=r.path.message,
        quantities=tuple(_quantity(q, names) for q in r.quantities_of_branch),
        transformation=tuple(_transformation(name, t, names) for name, t in r.transformation.items()),
        checks=tuple(_check(c, names) for c in r.checks),
        noise=r.noise,
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
        return {n: _estimate(f, units[n]) for n, f in found.get(channel, {}).items() if n in units}

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


class _Interval(Protocol):
    @property
    def q05(self) -> float | None: ...
    @property
    def median(self) -> float | None: ...
    @property
    def q95(self) -> float | None: ...


def _estimate(values: _Interval, unit: str) -> Estimate:
    return Estimate(values.median, values.q05, values.q95, unit)


def _held(channel: str, held: HeldSummary, names: Mapping[str, str]) -> str:
    unit = unit_label(held.unit)
    name = names.get(channel, channel)
    if name == channel and set(names.values()) & set(SPECIMEN_QUANTITY.values()):
        name = SPECIMEN_QUANTITY.get(channel, channel)
    return f"{name} held at {compact(held.mean)} {unit} (sd {compact(held.sd)} {unit})"


def _calibration(c: CalibrationSummary, quantity: Measure) -> str:
    unit = unit_label(quantity.unit)
    return (
        f"{quantity.name}: scale known to {100 * c.relative_scale_sd:.2g} %, offset to "
        f"{compact(c.offset_sd)} {unit}; carried on top of the posterior"
    )


def _parameter(
    name: str, p: ParameterSummary, r: RecordSummary, names: Mapping[str, str], scale: float
) -> ParameterResult:
    prior = dict(p.prior)
    family, source = str(prior.pop("family", "")), str(prior.pop("source", ""))
    return ParameterResult(
        name=name,
        meaning=p.meaning,
        unit=p.unit,
        channel=p.channel,
        of_noise=p.of_noise,
        warm_start=p.warm_start,
        warm_start_sd=p.warm_start_sd,
        mean=p.mean,
        sd=p.sd,
        estimate=_estimate(p, p.unit),
        rhat=p.rhat,
        ess_bulk=p.ess_bulk,
        ess_tail=p.ess_tail,
        contraction=p.contraction,
        identified=p.identified,
        fixed=p.fixed,
        at_bound=name in r.at_bound,
        family=family,
        numbers={n: v for n, v in prior.items() if isinstance(v, float)},
        source=source,
        scale=scale,
    )


def _quantity(q: QuantitySummary, names: Mapping[str, str]) -> QuantityRow:
    return QuantityRow(
        name=_quantity_name(q.name, names),
        condition=q.condition,
        branch=q.branch,
        channel=names.get(q.channel, q.channel),
        meaning=q.meaning,
        estimate=_estimate(q, q.unit),
    )


def _transformation(
    name: str, t: TransformationSummary, names: Mapping[str, str]
) -> TransformationTemperature:
    return TransformationTemperature(
        name=name,
        meaning=t.meaning,
        channel=names.get(t.channel, t.channel),
        estimate=_estimate(t, t.unit),
        within_data=t.within_data,
        outstanding=t.outstanding,
        samples=t.samples,
        defined=t.defined,
    )


def _nearest(name: str, p: NearestSummary, names: Mapping[str, str]) -> NearestParameter:
    return NearestParameter(name, names.get(p.channel, p.channel), _estimate(p, p.unit), p.defined)


def _missed(channel: str, m: DiscrepancySummary) -> Missed:
    return Missed(channel, m.unit, or_nan(m.rms), or_nan(m.largest), m.at, m.share, or_nan(m.ln_bayes_factor))


def _check(c: CheckSummary, names: Mapping[str, str]) -> PredictiveCheck:
    return PredictiveCheck(
        channel=names.get(c.channel, c.channel),
        statistic=STATISTICS.get(c.statistic, c.statistic),
        meaning=c.meaning,
        measured=or_nan(c.measured),
        replicated=(or_nan(c.q05), or_nan(c.q95)),
        p_value=c.p_value,
    )


def _printed(records: Iterable[RecordContent]) -> tuple[PrintedComparison, ...]:
    cells = printed_values()
    return tuple(
        PrintedComparison(r.key, r.condition, r.branch, p.name, cell, p.estimate, p.mean, p.sd)
        for r in records
        for p in r.model_parameters
        for cell in [cells[r.key].get(p.name)]
        if cell is not None and p.mean is not None and p.sd is not None
    )


def _provenance(run: StoredRun) -> Provenance:
    s = run.summary
    return Provenance(
        seed=s.seed,
        options={k: str(v) for k, v in s.options.as_json().items()},
        versions=s.versions,
        data_sha256=s.data_sha256 or "",
        priors=run.priors,
        command=_command(s),
    )


def _command(summary: FitFindings) -> str:
    options = summary.options
    common = [f"--seed {summary.seed}", f"--noise {options.noise}"]
    if summary.data_dir:
        common.insert(0, f"--data {_quoted(summary.data_dir)}")
    if options.pool == "none" and (is_twin(summary) or is_simulated(summary)):
        verb = "sma-bayes demo --paper --out NEW" if is_twin(summary) else "sma-bayes demo --out NEW"
        return " ".join((verb, *common))
    if options.model != DEFAULT_MODEL:
        common.append(f"--model {options.model}")
    if options.extrapolate:
        common.append(f"--extrapolate {options.extrapolate}")
    source = _quoted(summary.source or "PATH")
    return " ".join(
        (f"sma-bayes fit {source} --out NEW", *common, f"--pool {options.pool}", "--priors priors.toml")
    )


def _quoted(path: str) -> str:
    return f'"{path}"' if " " in path else path


def _quantity_name(name: str, names: Mapping[str, str]) -> str:
    shown = QUANTITY_NAMES.get(name, name.replace("_", " "))
    return shown.format(stiffness=names.get("stiffness", "stiffness"))
