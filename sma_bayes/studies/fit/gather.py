"""From what a run stored to the content of its report."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, Final

from sma_bayes.assess.adequacy import Missed, Reason
from sma_bayes.assess.summary import NOISE
from sma_bayes.errors import OutputError
from sma_bayes.paper.twin import printed_values
from sma_bayes.quantities import QUANTITIES, SPECIMEN_QUANTITY, unit_text
from sma_bayes.records.types import setting_unit
from sma_bayes.report.averages import average_factors
from sma_bayes.report.content import (
    Channel,
    Content,
    Estimate,
    Finding,
    NearestParameter,
    Noise,
    Number,
    ParameterResult,
    PredictiveCheck,
    PrintedComparison,
    Provenance,
    Quantity,
    RecordContent,
    Sampler,
    TransformationTemperature,
)
from sma_bayes.report.notation import compact, unit_label
from sma_bayes.response import DEFAULT_MODEL
from sma_bayes.runs.outputs import StoredRun
from sma_bayes.runs.schema import CorrelationAverage

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
    "least_stiffness": "least stiffness",
    "greatest_stiffness": "greatest stiffness",
    "stiffness_ratio": "stiffness ratio",
}
"""Names of quantities of branches and loops, for people."""


def report_content(run: StoredRun) -> Content:
    """Gather what a run says.

    Parameters
    ----------
    run : StoredRun
    """
    summary = run.summary
    records = tuple(_record(r) for r in summary["records"])
    names = {r.condition: {c.channel: c.name for c in r.channels} for r in records}
    return Content(
        campaign=str(summary.get("campaign", "")),
        source=str(summary.get("source", "")),
        records=records,
        loops=tuple(_quantity(q, names.get(q["condition"], {})) for q in summary.get("loops", ())),
        findings=tuple(_finding(f) for f in summary.get("findings", ())),
        printed=_printed(records) if is_twin(summary) else (),
        averages=tuple(
            f
            for e in summary.get("correlation_average", ())
            for f in average_factors(CorrelationAverage.model_validate(e), e["data"])
        ),
        provenance=_provenance(run),
    )


def is_twin(summary: Mapping[str, Any]) -> bool:
    """Whether a run is one of the campaign drawn from the paper's printed parameters."""
    keys = {record["key"] for record in summary["records"]}
    return str(summary.get("source", "")).startswith(TWIN_SOURCE) and keys <= set(printed_values())


def _record(r: Mapping[str, Any]) -> RecordContent:
    if "adequate" not in r:
        raise OutputError(
            f"summary.json does not say whether {r['key']} is adequate",
            expected="a fit by this version",
            remedy="fit anew into another folder",
        )
    quantities: Mapping[str, Mapping[str, str]] = r["quantities"]
    names = {channel: q["name"] for channel, q in quantities.items()}
    temperature = r["temperature"]
    measured = {**quantities, "temperature": {"name": "temperature", "unit": temperature["unit"]}}
    return RecordContent(
        key=r["key"],
        checksum=r.get("posterior_sha256"),
        condition=r["condition"],
        branch=r["branch"],
        converged=bool(r["converged"]),
        adequate=bool(r["adequate"]),
        reasons=tuple(Reason(w["kind"], w["channel"], unit_text(w["message"])) for w in r["why"]),
        model=r["model"],
        model_reason=_renamed((r.get("model_choice") or {}).get("reason", ""), names),
        nearest=tuple(_nearest(name, p, names) for name, p in r["nearest"].items()),
        missed=tuple(_missed(c, m) for c, m in r["discrepancy"].items()),
        n=int(r["n"]),
        rows_averaged=int(r.get("rows_averaged", 1)),
        segments=int(r.get("segments", 1)),
        settings={k: Number(v, _setting_unit(k, names)) for k, v in r.get("settings", {}).items()},
        temperature_unit=temperature["unit"],
        temperature_range=(temperature["lowest"], temperature["highest"]),
        temperature_sd=temperature.get("sd") or 0.0,
        channels=tuple(_channel(c, q, r) for c, q in quantities.items()),
        held=tuple(_held(c, h, names) for c, h in r.get("held", {}).items()),
        calibration=tuple(
            _calibration(c, k, measured[c]) for c, k in r.get("calibration", {}).items() if c in measured
        ),
        parameters=tuple(_parameter(n, p, r, names) for n, p in r["parameters"].items()),
        free_directions=tuple((d["text"], d["contraction"]) for d in r.get("free_directions", ())),
        jacobian_rank=r.get("jacobian_rank"),
        path_kind=r.get("path", {}).get("kind", ""),
        path_message=unit_text(r.get("path", {}).get("message", "")),
        shape=dict(r.get("shape", {})),
        quantities=tuple(_quantity(q, names) for q in r.get("quantities_of_branch", ())),
        transformation=tuple(
            _transformation(name, t, names) for name, t in r.get("transformation", {}).items()
        ),
        checks=tuple(_check(c, names) for c in r.get("checks", ())),
        noise=_noise(r.get("noise", {}), names),
        sampler=_sampler(r),
        shares_with=tuple(r.get("shares_parameters_with", ())),
    )


def _setting_unit(setting: str, names: Mapping[str, str]) -> str:
    specimen = set(names.values()) & set(SPECIMEN_QUANTITY.values())
    return setting_unit(setting, specimen=bool(specimen))


def _channel(channel: str, quantity: Mapping[str, str], r: Mapping[str, Any]) -> Channel:
    def agreement(which: str) -> dict[str, Estimate]:
        found = r.get(which, {}).get(channel, {})
        units = {"r": "1", "r2": "1", "adj_r2": "1", "rmse": quantity["unit"]}
        return {name: _estimate(values, units[name]) for name, values in found.items() if name in units}

    name = quantity["name"]
    return Channel(
        channel=channel,
        name=name,
        symbol=QUANTITIES[name].symbol if name in QUANTITIES else "",
        unit=quantity["unit"],
        observed=channel in r["channels"],
        fit=dict(r.get("fit", {}).get(channel, {})),
        measured=agreement("correlation"),
        replicated=agreement("correlation_replicated"),
    )


def _estimate(values: Mapping[str, float | None], unit: str) -> Estimate:
    return Estimate(values.get("median"), values.get("q05"), values.get("q95"), unit)


def _held(channel: str, held: Mapping[str, Any], names: Mapping[str, str]) -> str:
    unit = unit_label(held.get("unit", ""))
    name = names.get(channel, channel)
    if name == channel and set(names.values()) & set(SPECIMEN_QUANTITY.values()):
        name = SPECIMEN_QUANTITY.get(channel, channel)
    return f"{name} held at {compact(held['mean'])} {unit} (sd {compact(held['sd'])} {unit})"


def _calibration(channel: str, c: Mapping[str, float], quantity: Mapping[str, str]) -> str:
    unit = unit_label(quantity["unit"])
    return (
        f"{quantity['name']}: scale known to {100 * c['relative_scale_sd']:.2g} %, offset to "
        f"{compact(c['offset_sd'])} {unit}; carried on top of the posterior"
    )


def _parameter(
    name: str, p: Mapping[str, Any], r: Mapping[str, Any], names: Mapping[str, str]
) -> ParameterResult:
    if "role" not in p:
        raise OutputError(
            f"summary.json does not say what the parameter {name!r} does",
            expected="a fit by this version",
            remedy="fit anew into another folder",
        )
    prior = dict(p.get("prior", {}))
    family, source = str(prior.pop("family", "")), str(prior.pop("source", ""))
    return ParameterResult(
        name=name,
        meaning=_renamed(p.get("meaning", ""), names),
        unit=p["unit"],
        channel=p["channel"],
        of_noise=p["role"] == NOISE,
        warm_start=p.get("warm_start"),
        warm_start_sd=p.get("warm_start_sd"),
        mean=p.get("mean"),
        sd=p.get("sd"),
        estimate=_estimate(p, p["unit"]),
        rhat=p.get("rhat"),
        ess_bulk=p.get("ess_bulk"),
        ess_tail=p.get("ess_tail"),
        contraction=p.get("contraction"),
        identified=bool(p.get("identified")),
        fixed=bool(p.get("fixed")),
        at_bound=name in r.get("at_bound", ()),
        family=family,
        numbers=prior,
        source=source,
    )


def _quantity(q: Mapping[str, Any], names: Mapping[str, str]) -> Quantity:
    shown = QUANTITY_NAMES.get(q["name"], q["name"].replace("_", " "))
    return Quantity(
        name=_renamed(shown, names),
        condition=q["condition"],
        branch=q.get("branch", ""),
        channel=names.get(q["channel"], q["channel"]),
        meaning=_renamed(q.get("meaning", ""), names),
        estimate=_estimate(q, q["unit"]),
    )


def _transformation(name: str, t: Mapping[str, Any], names: Mapping[str, str]) -> TransformationTemperature:
    return TransformationTemperature(
        name=name,
        meaning=t.get("meaning", ""),
        channel=names.get(t["channel"], t["channel"]),
        estimate=_estimate(t, t["unit"]),
        within_data=bool(t["within_data"]),
        outstanding=t.get("outstanding"),
        samples=int(t.get("samples", 0)),
        defined=float(t.get("defined", 1.0)),
    )


def _nearest(name: str, p: Mapping[str, Any], names: Mapping[str, str]) -> NearestParameter:
    return NearestParameter(
        name, names.get(p["channel"], p["channel"]), _estimate(p, p["unit"]), float(p["defined"])
    )


def _missed(channel: str, m: Mapping[str, Any]) -> Missed:
    gain = m["ln_bayes_factor"]
    return Missed(
        channel,
        m["unit"],
        m["rms"],
        m["largest"],
        m["at"],
        m["share"],
        float("nan") if gain is None else gain,
    )


def _check(c: Mapping[str, Any], names: Mapping[str, str]) -> PredictiveCheck:
    return PredictiveCheck(
        channel=names.get(c["channel"], c["channel"]),
        statistic=STATISTICS.get(c["statistic"], c["statistic"]),
        meaning=c.get("meaning", ""),
        measured=c["measured"],
        replicated=(c["q05"], c["q95"]),
        p_value=c["p_value"],
    )


def _noise(noise: Mapping[str, Any], names: Mapping[str, str]) -> Noise:
    return Noise(
        name=noise.get("name", ""),
        title=noise.get("title", ""),
        chosen_by=noise.get("chosen_by", ""),
        reason=_renamed(noise.get("reason", ""), names),
        lag1={names.get(c, c): v for c, v in noise.get("lag1", {}).items()},
        ln_evidence=dict(noise.get("ln_evidence", {})),
    )


def _sampler(r: Mapping[str, Any]) -> Sampler:
    s = r.get("sampler", {})
    return Sampler(
        method=s.get("method", ""),
        acceptance=s.get("acceptance"),
        efficiency=s.get("efficiency"),
        greatest_weight=s.get("greatest_weight"),
        modes=int(s.get("modes", 1)),
        draws=int(s.get("draws", 0)),
        evaluations=int(r.get("log_likelihood_evaluations", 0)),
        wall_s=float(r.get("wall_s") or 0.0),
        ln_evidence=r.get("ln_evidence"),
        ln_evidence_sd=r.get("ln_evidence_sd"),
    )


def _finding(f: Mapping[str, Any]) -> Finding:
    return Finding(
        kind=f.get("kind", ""),
        message=f.get("message", ""),
        file=f.get("file", ""),
        rows=tuple(f.get("rows", ())),
        count=int(f.get("count", 0)),
        dropped=int(f.get("dropped", 0)),
        condition=f.get("condition", ""),
        branch=f.get("branch", ""),
        column=f.get("column", ""),
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
    options = {str(k): str(v) for k, v in s.get("options", {}).items()}
    return Provenance(
        seed=int(s["seed"]),
        options=options,
        versions={str(k): str(v) for k, v in s.get("versions", {}).items()},
        data_sha256=str(s.get("data_sha256", "")),
        priors=run.priors,
        command=_command(s, options),
    )


def _command(summary: Mapping[str, Any], options: Mapping[str, str]) -> str:
    common = [f"--seed {summary['seed']}", f"--noise {options.get('noise', 'auto')}"]
    if summary.get("data_dir"):
        common.insert(0, f"--data {_quoted(str(summary['data_dir']))}")
    if is_twin(summary) and options.get("pool", "none") == "none":
        return " ".join(("sma-bayes demo --out NEW", *common))
    if options.get("model", DEFAULT_MODEL) != DEFAULT_MODEL:
        common.append(f"--model {options['model']}")
    if float(options.get("extrapolate") or 0.0):
        common.append(f"--extrapolate {options['extrapolate']}")
    source = _quoted(str(summary.get("source", "PATH")))
    pool = f"--pool {options.get('pool', 'none')}"
    return " ".join((f"sma-bayes fit {source} --out NEW", *common, pool, "--priors priors.toml"))


def _quoted(path: str) -> str:
    return f'"{path}"' if " " in path else path


def _renamed(text: str, names: Mapping[str, str]) -> str:
    """Text with channels and units called what they are here: strain for displacement, °C for degC."""
    for channel, name in names.items():
        text = text.replace(channel, name)
    return unit_text(text)
