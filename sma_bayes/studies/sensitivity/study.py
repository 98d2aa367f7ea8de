"""What the numbers of one record rest on: prior, likelihood, sweeps, readings."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.assess.draws import RecordDraws
from sma_bayes.assess.sweeps import samples_of_sweeps
from sma_bayes.fitting.curves import interval_where_defined
from sma_bayes.sampling.power_scaling import THRESHOLD, mean_gradient, power_sensitivity
from sma_bayes.studies.sensitivity.bootstrap import SweepBootstrap, bootstrap_sweeps
from sma_bayes.studies.sensitivity.influence import (
    LeftOut,
    means_without_sweeps,
    reading_influence,
    without_readings,
)
from sma_bayes.studies.sensitivity.quantities import Densities, QuantityDraws, densities_of, quantities_of
from sma_bayes.studies.sensitivity.schema import (
    CONFLICT,
    NONE,
    STRONG_PRIOR,
    BootstrapAccount,
    BootstrapInterval,
    DecidingReading,
    LeadingPrior,
    LeftOutSweepChange,
    LeftOutSweepWeights,
    QuantitySensitivity,
    RecordSensitivity,
)

LEAST_DEFINED_SHARE = 0.5
"""Share of the draws from which on what moves a number is told [1]."""
LN_2: Final = math.log(2.0)
"""Shifts are told of a doubled power, with the binary logarithm of the power: this times a shift with the power."""
CONFLICT_SHIFT: Final = 1.0
"""Change of a mean without its prior, to first order, from which on prior and data are in conflict [posterior sd].

Of a normal distribution whose prior is right that change has a standard deviation of ``sqrt(w (1 - w))`` posterior
standard deviations, where the prior has the share w of the precision, so of a half at most: one number in twenty is
called a conflict by chance where prior and data tell as much as each other, one in a thousand where ``w`` is 0.1.
"""


@dataclass(frozen=True, eq=False)
class StudiedRecord:
    """What was found of a record.

    Attributes
    ----------
    found : RecordSensitivity
    readings : mapping of str to sequence
        Columns: each reading, and what leaving it out does to each quantity [posterior sd].
    """

    found: RecordSensitivity
    readings: Mapping[str, Sequence[object] | Floats]


def studied(draws: RecordDraws, at: Sequence[float], stiffness: bool, seed: int) -> StudiedRecord:
    """Study one record.

    Parameters
    ----------
    draws : RecordDraws
    at : sequence of float
        Temperatures at which curves are told [unit of temperature].
    stiffness : bool
        Whether the fit gives a stiffness.
    seed : int
    """
    quantities = quantities_of(draws, at, stiffness=stiffness)
    densities = densities_of(draws)
    values = np.stack([q.tamed for q in quantities], axis=1)
    left_out = means_without_sweeps(draws, quantities, values, densities, at, seed)
    bootstrap = bootstrap_sweeps(draws, at, seed, stiffness=stiffness)
    sd = values.std(axis=0)
    influence = {
        c: np.divide(i, sd[:, None], out=np.zeros_like(i), where=sd[:, None] > 0.0)
        for c, i in reading_influence(values, densities.readings).items()
    }
    record = draws.record
    sweeps = samples_of_sweeps(record)
    found = RecordSensitivity.about(
        draws,
        condition=draws.condition.id,
        branch=draws.branch.value,
        n=record.n,
        rows_averaged=record.rows_averaged,
        draws=draws.size,
        temperature_unit=record.units["temperature"],
        memory=bool(draws.posterior.noise.autocorrelated),
        quantities=tuple(_quantities(draws, quantities, values, densities, influence, left_out, bootstrap)),
        left_out_sweeps=tuple(
            LeftOutSweepWeights.about(
                one, sweep=i + 1, first_row=int(record.row[s].min()), readings=int(s.size)
            )
            for i, (s, one) in enumerate(zip(sweeps, left_out, strict=False))
        ),
        bootstrap=None
        if bootstrap is None
        else BootstrapAccount(replicates=bootstrap.quantities[0].draws.size, failed=bootstrap.failed),
    )
    return StudiedRecord(found, _columns(draws, quantities, influence))


def _quantities(
    draws: RecordDraws,
    quantities: Sequence[QuantityDraws],
    values: Floats,
    densities: Densities,
    influence: Mapping[str, Floats],
    left_out: Sequence[LeftOut],
    bootstrap: SweepBootstrap | None,
) -> Iterator[QuantitySensitivity]:
    raw = np.stack([q.draws for q in quantities], axis=1)
    mean, sd = values.mean(axis=0), values.std(axis=0)
    per_sd = np.divide(1.0, sd, out=np.full(sd.size, np.nan), where=sd > 0.0)
    per_sd[np.isfinite(raw).mean(axis=0) < LEAST_DEFINED_SHARE] = np.nan
    of_prior = power_sensitivity(raw, densities.log_prior)
    of_likelihood = power_sensitivity(raw, densities.log_likelihood)
    prior_shift = mean_gradient(values, densities.log_prior) * per_sd
    likelihood_shift = mean_gradient(values, densities.log_likelihood) * per_sd
    readings = _deciding(draws, values, mean, per_sd, densities, influence)
    again = {} if bootstrap is None else {q.name: q for q in bootstrap.quantities}
    of_prior[np.isnan(per_sd)] = of_likelihood[np.isnan(per_sd)] = np.nan
    for i, q in enumerate(quantities):
        diagnosis = diagnose(of_prior[i], of_likelihood[i], prior_shift[i], likelihood_shift[i])
        finite = np.isfinite(q.draws)
        found = interval_where_defined(q.draws[finite])
        changes = [(one.mean[i] - mean[i]) * per_sd[i] for one in left_out]
        yield QuantitySensitivity.about(
            q,
            diagnosis=diagnosis,
            leading_prior=None if diagnosis == NONE else _leading(draws, q.draws, densities),
            reading=readings[i] if np.isfinite(per_sd[i]) else None,
            sweeps=tuple(LeftOutSweepChange(sweep=s + 1, change=float(c)) for s, c in enumerate(changes)),
            bootstrap=_interval(again[q.name], found["q95"] - found["q05"]) if q.name in again else None,
            **found,
            defined=finite.mean(),
            mean=mean[i],
            sd=sd[i],
            prior=of_prior[i],
            likelihood=of_likelihood[i],
            prior_shift=prior_shift[i],
            likelihood_shift=likelihood_shift[i],
            without_prior=-prior_shift[i] / LN_2,
        )


def diagnose(
    prior: float, likelihood: float, prior_shift: float, likelihood_shift: float
) -> Literal["prior-data conflict", "strong prior / weak likelihood", "none"]:
    """What the two sensitivities say together.

    Both reach `sma_bayes.sampling.power_scaling.THRESHOLD` wherever both have a say, also where they agree. They are in
    conflict where they pull the mean in opposite directions, and far; see `CONFLICT_SHIFT`.

    Parameters
    ----------
    prior, likelihood : float
        Sensitivities [1].
    prior_shift, likelihood_shift : float
        Changes of the mean where the power of the one or the other is doubled, to first order [posterior sd].

    Examples
    --------
    >>> diagnose(0.2, 0.1, -0.8, 0.8), diagnose(0.2, 0.01, 0.0, 0.0), diagnose(0.1, 0.2, -0.1, 0.3)
    ('prior-data conflict', 'strong prior / weak likelihood', 'none')
    """
    if not prior >= THRESHOLD:
        return NONE
    apart = prior_shift * likelihood_shift < 0.0 and abs(prior_shift) >= LN_2 * CONFLICT_SHIFT
    if apart and likelihood >= THRESHOLD:
        return CONFLICT
    return STRONG_PRIOR if prior > likelihood or not likelihood >= THRESHOLD else NONE


def _leading(draws: RecordDraws, values: Floats, densities: Densities) -> LeadingPrior:
    """The parameter whose prior alone moves a quantity most."""
    each = [
        power_sensitivity(values[:, None], densities.prior[:, k])[0] for k in range(densities.prior.shape[1])
    ]
    most = int(np.nanargmax(each))
    return LeadingPrior(parameter=draws.posterior.names[most], sensitivity=float(each[most]))


def _deciding(
    draws: RecordDraws,
    values: Floats,
    mean: Floats,
    per_sd: Floats,
    densities: Densities,
    influence: Mapping[str, Floats],
) -> list[DecidingReading]:
    """For each quantity, the reading that moves it most, also by weights."""
    record, channels = draws.record, list(influence)
    joined = np.concatenate([influence[c] for c in channels], axis=1)
    most = np.argmax(np.abs(joined), axis=1)
    channel, at = [channels[i] for i in most // record.n], most % record.n
    out_of = np.stack([densities.readings[c][:, i] for c, i in zip(channel, at, strict=True)], axis=1)
    without, k = without_readings(values, out_of)
    number = np.unique(record.inputs["segment"], return_inverse=True)[1]
    size = np.abs(joined)
    with np.errstate(invalid="ignore", divide="ignore"):
        spread = size.sum(axis=1) ** 2 / (size**2).sum(axis=1)
    return [
        DecidingReading(
            channel=c,
            row=int(record.row[i]),
            sweep=int(number[i]) + 1,
            temperature=float(record.temperature[i]),
            change=float(joined[q, most[q]]),
            change_by_weights=float((without[q, q] - mean[q]) * per_sd[q]),
            pareto_k=float(k[q]),
            readings_in_effect=float(spread[q]),
        )
        for q, (c, i) in enumerate(zip(channel, at.tolist(), strict=True))
    ]


def _interval(quantity: QuantityDraws, of_posterior: float) -> BootstrapInterval:
    """Interval over the resampled sweeps, its width over that of the posterior."""
    found = interval_where_defined(quantity.draws[np.isfinite(quantity.draws)])
    width = (found["q95"] - found["q05"]) / of_posterior if of_posterior > 0.0 else np.nan
    return BootstrapInterval(**found, width=width)


def _columns(
    draws: RecordDraws, quantities: Sequence[QuantityDraws], influence: Mapping[str, Floats]
) -> dict[str, Sequence[object] | Floats]:
    """Each reading of each channel in a row."""
    record, channels = draws.record, list(influence)
    number = np.unique(record.inputs["segment"], return_inverse=True)[1] + 1
    times = len(channels)
    return {
        "channel": np.repeat(channels, record.n).tolist(),
        "row": np.tile(record.row, times).tolist(),
        "sweep": np.tile(number, times).tolist(),
        f"temperature_{record.units['temperature']}": np.tile(record.temperature, times),
        **{q.name: np.concatenate([influence[c][i] for c in channels]) for i, q in enumerate(quantities)},
    }
