"""A posterior as a product: where channels share no parameter and no error, each has a posterior of its own.

Force and displacement of the published model have curves, noises and discrepancies of their own. Unless an error of the
thermometer moves both together their parameters are independent given the measurements, and two posteriors of half as
many parameters are far easier to sample than one of all.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from sma_bayes.fitting.posterior import ParameterIndex, Posterior
from sma_bayes.parameters.space import ParameterSpace
from sma_bayes.records.types import Record
from sma_bayes.sampling.density import DensityFactor


def channel_factors(posterior: Posterior) -> tuple[DensityFactor, ...]:
    """Posteriors of the channels alone, whose product the posterior is; none where it is no such product.

    A model tells by its parameters whether channels share any: made for one channel alone it has just those that
    this channel depends on.
    """
    channels = posterior.records[0].channels
    if len(channels) < 2 or _thermometer_errs(posterior):
        return ()
    factors = [_factor(posterior, channel) for channel in channels]
    found = tuple(f for f in factors if f is not None)
    covered = np.sort(np.concatenate([f.at for f in found])) if found else np.empty(0)
    whole = len(found) == len(channels) and np.array_equal(covered, np.arange(posterior.space.dimension))
    return found if whole else ()


def _thermometer_errs(posterior: Posterior) -> bool:
    """Whether an error of the temperature readings, declared or estimated, moves all channels of a sample."""
    return any(
        record.temperature_sd > 0.0 or place.temperature_sd is not None
        for record, place in zip(posterior.records, posterior.layout, strict=True)
    )


def _factor(posterior: Posterior, channel: str) -> DensityFactor | None:
    """Posterior of one channel; None where the model can't be made for it alone, or where nothing of it is sampled."""
    model = posterior.model
    if model.refusal([channel]):
        return None
    alone = replace(model, channels=(channel,))
    depends_on = set(model.by_channel(channel))
    own = [i for i, name in enumerate(model.parameter_names) if name in depends_on]
    if alone.parameter_names != tuple(model.parameter_names[i] for i in own):
        return None
    kept = list(own)
    layout = []
    for place in posterior.layout:
        noise = {channel: _appended(kept, place.noise[channel].tolist())}
        size = {c: int(_appended(kept, [k])[0]) for c, k in place.size.items() if c == channel}
        between = {c: int(_appended(kept, [k])[0]) for c, k in place.between.items() if c == channel}
        layout.append(ParameterIndex(np.arange(len(own)), noise, size, between=between))
    coordinate = {k: i for i, k in enumerate(posterior.space.free_index.tolist())}
    at = np.array([coordinate[k] for k in kept if k in coordinate], dtype=np.int64)
    if not at.size:
        return None
    density = Posterior(
        tuple(_of_channel(record, channel) for record in posterior.records),
        alone,
        posterior.noise,
        ParameterSpace(tuple(posterior.space.parameters[i] for i in kept)),
        tuple(layout),
        tuple({c: basis for c, basis in bases.items() if c == channel} for bases in posterior.discrepancy),
    )
    return DensityFactor(channel, density, at)


def _appended(kept: list[int], positions: list[int]) -> NDArray[np.intp]:
    """Where positions in the whole parameter vector stand in that of the channel, to which they are appended."""
    kept.extend(positions)
    return np.arange(len(kept) - len(positions), len(kept), dtype=np.intp)


def _of_channel(record: Record, channel: str) -> Record:
    """A record with one of its channels."""
    return replace(record, observed={channel: record.observed[channel]})
