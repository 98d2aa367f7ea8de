"""Whether the curve describes the data: what the model misses, and whether its numbers may be relied on.

Converged says that the posterior was sampled; adequate says that model and noise are such as could have made the data.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from pydantic import Field

from sma_bayes.assess import sweeps as left_out
from sma_bayes.assess.checks import FALSE_ALARM_RATE, Check
from sma_bayes.assess.conflict import contradicted
from sma_bayes.assess.identifiability import contraction
from sma_bayes.document_part import DocumentPart, Number, NumberOrNull
from sma_bayes.fitting.fit import Fit
from sma_bayes.fitting.noise_choice import MAX_MEMORY_SWEEPS
from sma_bayes.parameters.roles import Role
from sma_bayes.quantities import unit_text
from sma_bayes.records.types import Record

LARGEST_MISFIT_SHARE = 0.02
"""Share of the range of a channel that a curve may miss at its worst place and still describe the data."""
LARGEST_MISFIT_SDS = 3.0
"""Standard deviations of the noise that it must miss there, too, to count: below, nobody would see it."""
MAX_NOISE_SHARE = 0.25
"""Standard deviation of the noise over the range of the curve; beyond, it has swallowed the response."""
PRIOR_LED_CONTRACTION = 0.75
"""Contraction below which a parameter is led by its prior: more than half of the prior's standard deviation is left."""
MAX_SHOWN_RANGES = 10.0
"""Multiple of the range of a curve from which on the number itself says nothing."""
GRID = 161
"""Temperatures at which curves are looked at."""
ENDS = 2
"""And where it may be enough to look at both ends."""
SWEEP_CHECKS = ("sweep_means", left_out.STATISTIC)
"""Checks of whether the sweeps of a record are alike."""

SENTENCES = {
    "curve": "the curve misses {what}",
    "sweeps": "{what}",
    "check": "{what}",
    "noise": "the noise of a reading is {what}",
    "memory": "the noise of {what}: what the curve misses passes for it",
    "exact": "{what} has no noise: it was computed, not measured, and no interval follows from it",
    "tempered": "samples are counted as fewer than they are: no density of the data",
    "prior": "the data hardly tell {what}: its prior does",
    "conflict": "prior and data contradict each other about {what}",
}
"""Reasons why a fit is not adequate, by their kind."""
FAILURES = {
    "greatest": (
        "even the largest residual is small for this noise",
        "single readings lie too far out for this noise",
    ),
    "lag1": (
        "neighbouring residuals alternate more than the noise model allows",
        "neighbouring residuals are alike, more than the noise model allows",
    ),
    "block_means": ("", "residuals do not average out along the temperature"),
    "sweep_means": ("", "its sweeps differ by more than the noise"),
    "sd_by_temperature": ("", "the noise changes along the temperature"),
    "sd_by_response": (
        "the noise falls as the response grows, more than its model says",
        "the noise grows with the response, more than its model says",
    ),
    "pit": ("", "the noise has another distribution than its model"),
    left_out.STATISTIC: ("", "sweep {sweep} is not what the other sweeps predict"),
}
"""What a predictive check shows that fails with a p-value near 1, and near 0."""
WORTH_TRYING = {
    "curve": ("`--model auto`", "`sma-bayes gap`"),
    "check": ("`--model auto`", "`--noise auto`", "`sma-bayes gap`"),
    "memory": (
        "`--model auto`",
        "`--noise auto`",
        "parameters of their own for each condition",
        "`sma-bayes gap`",
    ),
}
"""What may describe the data better, by the kind of reason."""
REMEDIES = {
    "sweeps": "follow every cycle with `sma-bayes cycles`, or look for what moves them with `sma-bayes gap`",
    "noise": "measure a greater response or with less noise",
    "exact": "fit the readings as they were measured; of a computed curve least squares says all there is",
    "tempered": "leave out `--noise effective_samples`",
    "prior": "measure through the whole transformation, or say in a priors file what is known of it",
    "conflict": "check units and numbers of the priors file, and the units of the measurements",
}
"""What to do about the others."""


def remedy(kind: str, model: str, noise: str) -> str:
    """What to do where a fit is not adequate for a reason of some kind, besides what was done.

    Parameters
    ----------
    kind : str
    model, noise : str
        The response model and the noise that were asked for, by name or ``auto``.

    Examples
    --------
    >>> remedy("check", "modified_sigmoid", "independent")
    'try `--model auto`, `--noise auto` or `sma-bayes gap`'
    >>> remedy("check", "auto", "independent"), remedy("curve", "auto", "auto")
    ('try `--noise auto` or `sma-bayes gap`', 'try `sma-bayes gap`')
    """
    if kind not in WORTH_TRYING:
        return REMEDIES[kind]
    done = (f"`--model {model}`", f"`--noise {noise}`")
    *others, last = (way for way in WORTH_TRYING[kind] if way not in done)
    return f"try {' or '.join(filter(None, (', '.join(others), last)))}"


class DiscrepancySummary(DocumentPart):
    """What the curve of a channel misses, as far as a discrepancy beside it tells."""

    unit: str = Field(description="unit of its numbers")
    rms: NumberOrNull = Field(description="root mean square over the samples, posterior median [unit]")
    largest: NumberOrNull = Field(description="value where the median discrepancy is largest [unit]")
    at: Number = Field(description="temperature there [that of temperature]")
    share: Number = Field(description="magnitude of `largest` over the range of the channel [1]")
    ln_bayes_factor: NumberOrNull = Field(description="what it gains in ln evidence at the warm start [1]")
    between_sweeps: NumberOrNull = Field(
        default=None,
        description="root mean square of what a sweep has of its own beside it, posterior median; null where sweeps "
        "are alike [unit]",
    )


class Reason(DocumentPart):
    """One reason why a fit is not adequate."""

    kind: str = Field(
        description="`curve` (it misses more than 2 % of the range and three standard deviations of the noise "
        "somewhere), `sweeps` (a predictive check of whether the sweeps are alike has a p-value below 0.002; comes "
        "before these), `check` (that of another check is below 0.002 or above 0.998), `noise` (its standard "
        "deviation is more than a quarter of the range of the curve), `memory` (as many samples count as one as are in "
        "half a sweep, at the median: what is missed passes for noise), `tempered` (`effective_samples`: no density of "
        "the data), `prior` (contraction of a midpoint or rate below 0.75; no stiffness is given then), `conflict` "
        "(the prior hardly allows what the data say, or what they say by themselves where it wins; comes before "
        "these) or `exact` (the noise is less than 1e-8 of the range of the channel: the readings were computed; "
        "comes first)"
    )
    channel: str = Field(description="empty where it concerns all")
    message: str = Field(description="the reason in words")


def missed(fit: Fit, record: int = 0) -> dict[str, DiscrepancySummary]:
    """What the curves of a record miss, by channel; empty where nothing stands beside them."""
    r, curves = fit.records[record], fit.curves(record)
    t = np.linspace(float(r.temperature.min()), float(r.temperature.max()), GRID)
    out = {}
    for channel in curves.weights:
        at_samples = curves.discrepancy(channel, r.temperature)
        median = np.median(curves.discrepancy(channel, t), axis=0)
        i = int(np.argmax(np.abs(median)))
        span = fit.posterior.observed_range(record, channel)[1]
        apart = fit.posterior.layout[record].between.get(channel)
        gain = fit.noise_choice.discrepancy.get(channel, np.nan) if fit.noise_choice else np.nan
        out[channel] = DiscrepancySummary(
            unit=r.units[channel],
            rms=float(np.median(np.sqrt(np.mean(at_samples**2, axis=1)))),
            largest=float(median[i]),
            at=float(t[i]),
            share=abs(float(median[i])) / span,
            ln_bayes_factor=float(gain),
            between_sweeps=None if apart is None else float(np.median(fit.flat[:, apart])),
        )
    return out


def reasons(
    fit: Fit, record: int, checks: Sequence[Check], of_curve: Mapping[str, DiscrepancySummary]
) -> tuple[Reason, ...]:
    """Why a fit is not adequate; empty where it is.

    Parameters
    ----------
    fit : Fit
    record : int
    checks : sequence of Check
        Posterior predictive checks of the record.
    of_curve : mapping of str to DiscrepancySummary
        What its curves miss, by channel.
    """
    from sma_bayes.fitting.fit_records import exact_channels

    r, posterior = fit.records[record], fit.posterior
    median = np.median(fit.flat, axis=0)
    exact = exact_channels(posterior, median, record)
    out = [_reason("exact", channel, r.quantity(channel)) for channel in exact]
    if against := contradicted(fit, record):
        out.append(_reason("conflict", "", ", ".join(against)))
    sd = {c: float(median[at[0]]) for c, at in posterior.layout[record].noise.items()}
    out += [
        _reason("sweeps", c.channel, _failed(r, c))
        for c in checks
        if c.failed and c.statistic in SWEEP_CHECKS
    ]
    for channel, m in of_curve.items():
        if m.share > LARGEST_MISFIT_SHARE and abs(m.largest or 0.0) > LARGEST_MISFIT_SDS * sd[channel]:
            share = (
                f"up to {100.0 * m.share:.1f} % of" if m.share < MAX_SHOWN_RANGES else "more than ten times"
            )
            what = (
                f"{r.quantity(channel)} by {share} its range, at {m.at:.4g} {unit_text(r.units['temperature'])}; "
                "a smooth discrepancy for it is in all bands"
            )
            out.append(_reason("curve", channel, what))
    out += [
        _reason("check", c.channel, _failed(r, c))
        for c in checks
        if c.failed and c.statistic not in SWEEP_CHECKS
    ]
    if not posterior.noise.is_density:
        out.append(_reason("tempered", "", ""))
    steps = posterior.steps[record]
    for channel, own in sd.items():
        remembered = posterior.noise.memory(posterior.noise_shape(median, record, channel), steps)
        if posterior.noise.autocorrelated and remembered > MAX_MEMORY_SWEEPS * steps.longest:
            what = (
                f"{r.quantity(channel)} remembers over {remembered:.0f} samples of a sweep of {steps.longest}"
            )
            out.append(_reason("memory", channel, what))
        if own <= MAX_NOISE_SHARE * _response(fit, record, channel, ENDS):
            continue
        response = _response(fit, record, channel, GRID)
        if own > MAX_NOISE_SHARE * response:
            share = (
                f"{100.0 * own / response:.0f} % of"
                if own < MAX_SHOWN_RANGES * response
                else "more than ten times"
            )
            out.append(_reason("noise", channel, f"{share} what {r.quantity(channel)} changes by"))
    for channel in led_by_prior(fit, record):
        out.append(_reason("prior", channel, f"where and how fast {r.quantity(channel)} changes"))
    return tuple(out)


def _response(fit: Fit, record: int, channel: str, points: int) -> float:
    """Range of the median curve of a channel at even temperatures over the measured ones [unit of the channel].

    Not that of the measurements: of noise alone it is some five standard deviations, whatever the response. At more
    temperatures it is never less than at the two ends.
    """
    t = fit.records[record].temperature
    grid = np.linspace(float(t.min()), float(t.max()), points)
    return float(np.ptp(np.median(fit.curves(record).curve(channel, grid), axis=0)))


def _failed(record: Record, check: Check) -> str:
    low, high = FAILURES.get(check.statistic, (check.meaning, check.meaning))
    said = (low if check.p_value > 0.5 else high).format(sweep=check.sweep)
    return f"{record.quantity(check.channel)}: {said} ({_probability(check.p_value)})"


def _probability(p: float) -> str:
    """A p-value, of which nothing beyond `FALSE_ALARM_RATE` is told: replications are hundreds."""
    if p < FALSE_ALARM_RATE:
        return f"p < {FALSE_ALARM_RATE:g}"
    return f"p > {1.0 - FALSE_ALARM_RATE:g}" if p > 1.0 - FALSE_ALARM_RATE else f"p = {p:.2g}"


def _reason(kind: str, channel: str, what: str) -> Reason:
    return Reason(kind=kind, channel=channel, message=SENTENCES[kind].format(what=what))


def led_by_prior(fit: Fit, record: int = 0) -> tuple[str, ...]:
    """Measured channels whose midpoint or rate is led by its prior: no stiffness follows from such a curve."""
    posterior = fit.posterior
    moved = dict(zip(posterior.space.free_index.tolist(), contraction(fit).tolist(), strict=True))
    facts = {f.name: f for f in posterior.model.facts}
    led: dict[str, None] = {}
    for position, name in zip(
        posterior.layout[record].model.tolist(), posterior.model.parameter_names, strict=True
    ):
        fact = facts[name]
        telling = fact.role in (Role.MIDPOINT, Role.RATE) and fact.channel in fit.records[record].channels
        if telling and moved.get(position, 1.0) < PRIOR_LED_CONTRACTION:
            led[fact.channel] = None
    return tuple(led)
