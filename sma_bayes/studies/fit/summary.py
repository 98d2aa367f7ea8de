"""Everything that is said of one record, with its units: an entry of `summary.json`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, fields

import numpy as np

from sma_bayes.assess.adequacy import missed, reasons
from sma_bayes.assess.bands import band_channels
from sma_bayes.assess.checks import predictive_checks
from sma_bayes.assess.correlation import Agreement, factors
from sma_bayes.assess.identifiability import IDENTIFIED, contraction, free_directions
from sma_bayes.assess.loops import branch_quantities
from sma_bayes.assess.nearest import nearest_parameters
from sma_bayes.assess.path import path_remark
from sma_bayes.assess.sweeps import left_out_sweeps, sweep_checks
from sma_bayes.assess.transformation import transformation_temperatures
from sma_bayes.fitting.curves import interval
from sma_bayes.fitting.fit import Fit
from sma_bayes.parameters.distributions import family_name, numbers
from sma_bayes.response.base import ResponseModel
from sma_bayes.response.modified_sigmoid import channel_unit
from sma_bayes.runs.fit_document import (
    NOISE,
    HeldSummary,
    Measure,
    NearestSummary,
    NoiseSummary,
    ParameterSummary,
    RecordSummary,
    SamplerSummary,
    SamplingSummary,
    TemperatureSummary,
    TransformationSummary,
)
from sma_bayes.runs.schema import Factor
from sma_bayes.sampling.audit import Audit


def record_summary(
    fit: Fit, record: int, measured: Mapping[str, Agreement], again: Mapping[str, Agreement]
) -> RecordSummary:
    """Summary of one record.

    Parameters
    ----------
    fit : Fit
    record : int
        Which of the records that share the posterior.
    measured, again : mapping of str to Agreement
        Of each channel with the measured and with replicated data; see `correlation_factors`.
    """
    r = fit.records[record]
    settings = {k: v for k, v in asdict(r.condition).items() if k != "id" and v is not None}
    start = fit.warm_start
    sweeps, of_curve = left_out_sweeps(fit, record), missed(fit, record)
    checks = [*predictive_checks(fit, record), *sweep_checks(sweeps)]
    why = reasons(fit, record, checks, of_curve)
    noise_sd = {
        c: float(np.median(fit.flat[:, at[0]])) for c, at in fit.posterior.layout[record].noise.items()
    }
    return RecordSummary.about(
        r,
        condition=r.condition.id,
        branch=r.branch.value,
        settings=settings,
        settings_declared_units={k: r.declared_units[k] for k in settings if k in r.declared_units},
        segments=int(np.unique(r.inputs["segment"]).size),
        quantities={
            c: Measure(
                name=r.quantity(c), unit=channel_unit(r.units, c), declared_unit=r.declared_units.get(c)
            )
            for c in band_channels(r)
        },
        temperature=TemperatureSummary(
            unit=r.units["temperature"],
            lowest=float(r.temperature.min()),
            highest=float(r.temperature.max()),
            sd=r.temperature_sd,
            declared_unit=r.declared_units.get("temperature"),
        ),
        held={
            c: HeldSummary(
                mean=h.mean, sd=h.sd, unit=r.units.get(c, ""), declared_unit=r.declared_units.get(c)
            )
            for c, h in r.held.items()
        },
        calibration=dict(r.calibration),
        converged=fit.converged,
        adequate=not why,
        why=why,
        model=fit.posterior.model.name,
        rung=fit.posterior.model.rung,
        model_choice=fit.model_choice,
        nearest=_nearest(fit, record),
        discrepancy=of_curve,
        parameters=_parameters(fit, record),
        fit=start.fit[record],
        jacobian_rank=start.rank,
        free_at_warm_start=start.free_directions,
        at_bound=start.at_bound,
        correlation=_factors(measured),
        correlation_replicated=_factors(again),
        free_directions=free_directions(fit),
        shape=_shape(fit, record),
        path=path_remark(r, noise_sd, slope_supported=all(reason.kind != "prior" for reason in why)),
        quantities_of_branch=branch_quantities(fit, record),
        transformation=_transformation(fit, record),
        checks=checks,
        left_out_sweeps=sweeps,
        noise=_noise(fit),
        sampler=SamplerSummary.about(
            fit.draws, modes=len(fit.draws.modes), draws=int(np.prod(fit.draws.z.shape[:3]))
        ),
        sampling=_audit(fit),
        ln_evidence=fit.draws.ln_evidence,
        ln_evidence_sd=fit.draws.ln_evidence_sd,
        shares_parameters_with=tuple(x.key for i, x in enumerate(fit.records) if i != record),
        log_likelihood_evaluations=fit.draws.evaluations,
        wall_s=float(sum(fit.account.wall.values())),
        stages_s=fit.account.wall,
        stages_cpu_s=fit.account.cpu,
    )


def _factors(found: Mapping[str, Agreement]) -> dict[str, dict[str, Factor]]:
    return {
        channel: {name: Factor.model_validate(values) for name, values in factors(a).items()}
        for channel, a in found.items()
    }


def _noise(fit: Fit) -> NoiseSummary:
    noise, choice = fit.posterior.noise, fit.noise_choice
    return NoiseSummary.about(
        noise,
        chosen_by="evidence" if fit.chosen else "the user",
        reason=choice.reason if choice else "",
        lag1=dict(choice.lag1) if choice else {},
        ln_evidence=dict(choice.ln_evidence) if choice else {},
    )


def _audit(fit: Fit) -> SamplingSummary:
    """What the audit of a proposal found; nothing but null where there was none to be audited."""
    audit = fit.draws.audit
    found = dict.fromkeys((f.name for f in fields(Audit)), None) if audit is None else asdict(audit)
    return SamplingSummary(method=fit.draws.method, **found)


def _parameters(fit: Fit, record: int) -> dict[str, ParameterSummary]:
    space = fit.posterior.space
    theta, every = fit.calibrated(record), fit.every_calibrated(record)
    moved = dict(zip(space.free_index.tolist(), contraction(fit).tolist(), strict=True))
    diagnostics = dict(zip(space.free_index.tolist(), range(space.dimension), strict=True))
    place = fit.posterior.layout[record]
    out = {}
    parts = dict(zip(place.model.tolist(), _parts(fit.posterior.model), strict=True))
    parts |= {int(k): (channel, NOISE) for channel, at in place.noise.items() for k in at}
    parts |= {k: (channel, NOISE) for sizes in (place.size, place.between) for channel, k in sizes.items()}
    if place.temperature_sd is not None:
        parts[place.temperature_sd] = ("temperature", NOISE)
    for i, (channel, role) in parts.items():
        p = space.parameters[i]
        k = diagnostics.get(i)
        c = fit.draws.convergence
        out[p.name.partition("[")[0]] = ParameterSummary.about(
            p,
            channel=channel,
            role=role,
            warm_start=float(fit.start[i]),
            warm_start_sd=float(fit.warm_start.sd[i]) if i < fit.warm_start.sd.size else None,
            mean=float(every[:, i].mean()),
            sd=float(every[:, i].std(ddof=1)),
            **interval(theta[:, i]),
            rhat=None if k is None else float(c.rhat[k]),
            ess_bulk=None if k is None else float(c.ess_bulk[k]),
            ess_tail=None if k is None else float(c.ess_tail[k]),
            quantile_error=None if k is None else float(c.quantile_error[k]),
            sd_error=None if k is None else float(c.sd_error[k]),
            contraction=moved.get(i),
            identified=moved.get(i, 0.0) >= IDENTIFIED,
            fixed=p.fixed is not None,
            prior={"family": family_name(p.prior), **numbers(p.prior), "source": p.source},
        )
    return out


def _nearest(fit: Fit, record: int) -> dict[str, NearestSummary]:
    """Published parameters of the nearest curves: least mean square over the measured temperatures."""
    return {n.name: NearestSummary.about(n, **n.interval) for n in nearest_parameters(fit, record)}


def _parts(model: ResponseModel) -> list[tuple[str, str]]:
    """Channel and role of each parameter of a model, in its order."""
    return [(f.channel, str(f.role or "")) for f in model.facts]


def _transformation(fit: Fit, record: int) -> dict[str, TransformationSummary]:
    """Transformation temperatures by name, each with what supports it."""
    return {
        t.name: TransformationSummary.about(t, **t.interval) for t in transformation_temperatures(fit, record)
    }


def _shape(fit: Fit, record: int) -> dict[str, float]:
    """Posterior probability of each behaviour of the stiffness far from the transformation."""
    theta = fit.flat[:, fit.posterior.layout[record].model]
    limits = fit.posterior.model.limits(theta).get("stiffness")
    if limits is None:
        return {}
    ends = np.abs(np.stack([line.value for line in limits]))
    hump, unbounded = np.all(ends == 0.0, axis=0), np.any(np.isinf(ends), axis=0)
    share = {"hump": hump, "unbounded": unbounded, "sigmoid": ~(hump | unbounded)}
    return {kind: float(np.mean(found)) for kind, found in share.items()}
