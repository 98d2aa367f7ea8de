"""How the numbers and names of a study read to people."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from sma_bayes.report.notation import compact, power_text, unit_label
from sma_bayes.studies.gap.schema import GapOfModel, NamedChannel, StatedJump, StatedPeriodicity

Channels = Mapping[str, NamedChannel]

LEAST_P_SHOWN = 1e-6
"""Below this a p-value is extrapolated so far that its digits say nothing."""
SMALL_REMAINDER = 0.01
"""Share of a remainder below which it is only bounded."""
MOSTLY_SHAPE_SHARE = 0.5
"""Share of what can be explained from which on it is said to be the shape of the curve."""
COVARIATES: Final[Mapping[str, str]] = {
    "order": "sample number",
    "rate": "rate dT/dt",
    "ambient_temperature": "ambient temperature",
    "temperature and rate": "temperature and rate dT/dt",
}
"""How covariates are called where their name in files would not do."""
JOINT_TERMS: Final[Mapping[str, str]] = {
    "temperature shift": "all channels, as a shift of temperature",
    "share transformed": "all channels, as a change of the share transformed",
}
"""How terms are called that act on several channels at once."""


def p_text(p: float) -> str:
    """A p-value for people; ones far in the extrapolated tail are only bounded.

    Examples
    --------
    >>> p_text(0.0123), p_text(1e-30)
    ('p = 0.012', 'p < 10⁻⁶')
    """
    return f"p = {compact(float(f'{p:.2g}'))}" if p >= LEAST_P_SHOWN else f"p < 10{power_text(-6)}"


def remainder_text(found: GapOfModel) -> str:
    """What named effects leave to a flexible term, and where; empty where they leave nothing beyond chance."""
    left = found.remaining
    if left.share is None or left.p_value > found.thresholds.p_value:
        return ""
    share = (
        f"{100.0 * left.share:.0f} %"
        if left.share >= SMALL_REMAINDER
        else f"less than {100.0 * SMALL_REMAINDER:.0f} %"
    )
    along, where = covariate_text(found.channels, left.covariate), channel_text(found.channels, left.channel)
    return f"with a remainder of {share} along {along}, in {where}"


def shape_text(found: GapOfModel) -> str:
    """How much of what has no name is the shape of the curve; empty where a name is given or that is little."""
    shape = found.rounds[-1].shape if found.rounds else None
    if found.verdict != "unnamed" or shape is None:
        return ""
    if shape.ln_bayes_factor < found.thresholds.ln_bayes_factor_shape or shape.share < MOSTLY_SHAPE_SHARE:
        return ""
    return (
        f"{100.0 * shape.share:.0f} % of what can be explained is the shape of the curve, the same in every sweep and "
        "condition: what the model's curve misses, and not a cause"
    )


def closed_text(found: GapOfModel) -> str:
    """How far residuals on held-out measurements came down, beside the noise and in the units of the channels.

    Returns
    -------
    str
        ``rms 5.47 σ before, 5.15 after, noise 1: 7 % of the way; force 0.52 N before, 0.49 after, noise alone 0.1``
    """
    gap = found.gap
    way = f"{100.0 * gap.way_to_noise:.0f} % of the way" if gap.before > 1.0 else "no more than noise"
    parts = [f"rms {gap.before:.3g} σ before, {gap.after:.3g} after, noise 1: {way}"]
    for channel, c in gap.channels.items():
        unit = f" {unit_label(c.unit)}".rstrip()
        parts.append(
            f"{channel_text(found.channels, channel)} {c.before:.3g}{unit} before, {c.after:.3g} after, "
            f"noise alone {c.noise:.3g}"
        )
    return "; ".join(parts)


def periodic_text(channels: Channels, line: StatedPeriodicity) -> str:
    """A disturbance that repeats in time, in words.

    Returns
    -------
    str
        ``2A: force repeats at 0.37 Hz, out of step with the temperature, amplitude 0.042 N``
    """
    unit = unit_label(channels[line.channel].unit)
    return (
        f"{line.condition}: {channel_text(channels, line.channel)} repeats at {line.frequency:.4g} "
        f"{line.unit}, out of step with the temperature, amplitude {line.amplitude:.3g} {unit}".rstrip()
    )


def jump_text(channels: Channels, jump: StatedJump) -> str:
    """A jump, in words.

    Returns
    -------
    str
        ``2A: displacement jumps by -0.42 mm at 36.5 s, cycle 3 while heating``
    """
    unit = unit_label(channels[jump.channel].unit)
    when = f"sample {jump.sample + 1}" if jump.time is None else f"{jump.time:.4g} s"
    return (
        f"{jump.condition}: {channel_text(channels, jump.channel)} jumps by "
        + f"{jump.by:.3g} {unit}".rstrip()
        + f" at {when}, cycle {jump.cycle:g} while {jump.branch}"
    )


def channel_text(channels: Channels, channel: str) -> str:
    """Name of a channel as this campaign calls it: ``strain``; of several together, what is done to them."""
    facts = channels.get(channel)
    return facts.name if facts else JOINT_TERMS.get(channel, channel)


def covariate_text(channels: Channels, covariate: str) -> str:
    """Name of a covariate; a response that is one is called as this campaign calls it.

    Examples
    --------
    >>> strain = NamedChannel(name="strain", symbol="ε", unit="1")
    >>> covariate_text({"displacement": strain}, "displacement")
    'strain'
    >>> covariate_text({}, "order")
    'sample number'
    """
    if covariate in channels and covariate != "temperature":
        return channel_text(channels, covariate)
    return COVARIATES.get(covariate, covariate)
