"""How the numbers and names of a study read to people."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from sma_bayes.quantities import unit_text

BEYOND = 1e-6
"""Below this a p-value is extrapolated so far that its digits say nothing."""
SMALL = 0.01
"""Share of a remainder below which it is only bounded."""
COVARIATES: Final[Mapping[str, str]] = {
    "order": "place in the record",
    "rate": "rate dT/dt",
    "ambient_temperature": "ambient temperature",
    "temperature and rate": "temperature and rate dT/dt",
}
"""How covariates are called where their name in files would not do."""
TOGETHER: Final[Mapping[str, str]] = {
    "temperature shift": "all channels, as a shift of temperature",
    "share transformed": "all channels, as a change of the share transformed",
}
"""How terms are called that act on several channels at once."""


def p_text(p: float) -> str:
    """A p-value for people; ones far in the extrapolated tail are only bounded.

    Examples
    --------
    >>> p_text(0.0123), p_text(1e-30)
    ('p = 0.012', 'p < 1e-6')
    """
    return f"p = {p:.2g}" if p >= BEYOND else "p < 1e-6"


def remainder_text(found: Mapping[str, Any]) -> str:
    """What named effects leave to a flexible term, and where; empty where they leave nothing beyond chance.

    Parameters
    ----------
    found : mapping
        What ``gap.json`` holds.

    Examples
    --------
    >>> left = {"p_value": 1e-9, "share": 0.08, "channel": "displacement", "covariate": "rate"}
    >>> remainder_text({"remaining": left, "thresholds": {"p_value": 0.02}, "channels": {}})
    'with a remainder of 8 % along rate dT/dt, in displacement'
    """
    left = found["remaining"]
    if left["share"] is None or left["p_value"] > found["thresholds"]["p_value"]:
        return ""
    share = f"{100.0 * left['share']:.0f} %" if left["share"] >= SMALL else f"less than {100.0 * SMALL:.0f} %"
    along, where = covariate_text(found, left["covariate"]), channel_text(found, left["channel"])
    return f"with a remainder of {share} along {along}, in {where}"


def closed_text(found: Mapping[str, Any]) -> str:
    """How far residuals on held-out measurements came down, beside the noise and in the units of the channels.

    Parameters
    ----------
    found : mapping
        What ``gap.json`` holds.

    Examples
    --------
    >>> force = {"unit": "N", "before": 0.52, "after": 0.49, "noise": 0.1, "before_sigma": 5.47, "after_sigma": 5.15}
    >>> gap = {"before": 5.47, "after": 5.15, "way_to_noise": 0.0716, "channels": {"force": force}}
    >>> closed_text({"gap": gap, "channels": {"force": {"name": "force", "unit": "N"}}})
    'rms 5.47 σ before, 5.15 after, noise 1: 7 % of the way; force 0.52 N before, 0.49 after, noise 0.1'
    """
    gap = found["gap"]
    way = f"{100.0 * gap['way_to_noise']:.0f} % of the way" if gap["before"] > 1.0 else "no more than noise"
    parts = [f"rms {gap['before']:.3g} σ before, {gap['after']:.3g} after, noise 1: {way}"]
    for channel, c in gap["channels"].items():
        unit = f" {unit_text(c['unit'])}".rstrip()
        parts.append(
            f"{channel_text(found, channel)} {c['before']:.3g}{unit} before, {c['after']:.3g} after, "
            f"noise {c['noise']:.3g}"
        )
    return "; ".join(parts)


def periodic_text(found: Mapping[str, Any], line: Mapping[str, Any]) -> str:
    """A disturbance that repeats in time, in words.

    Parameters
    ----------
    found : mapping
        What ``gap.json`` holds.
    line : mapping
        One of its ``periodic``.

    Examples
    --------
    >>> line = {"condition": "2A", "channel": "force", "frequency": 0.37, "unit": "Hz", "amplitude": 0.042}
    >>> periodic_text({"channels": {"force": {"name": "force", "unit": "N"}}}, line)
    '2A: force repeats at 0.37 Hz, out of step with the temperature, amplitude 0.042 N'
    """
    unit = unit_text(found["channels"][line["channel"]]["unit"])
    return (
        f"{line['condition']}: {channel_text(found, line['channel'])} repeats at {line['frequency']:.4g} "
        f"{line['unit']}, out of step with the temperature, amplitude {line['amplitude']:.3g} {unit}".rstrip()
    )


def channel_text(found: Mapping[str, Any], channel: str) -> str:
    """Name of a channel as this campaign calls it: ``strain``; of several together, what is done to them.

    Parameters
    ----------
    found : mapping
        What ``gap.json`` holds.
    channel : str
    """
    facts = found["channels"].get(channel)
    return str(facts["name"]) if facts else TOGETHER.get(channel, channel)


def covariate_text(found: Mapping[str, Any], covariate: str) -> str:
    """Name of a covariate; a response that is one is called as this campaign calls it.

    Examples
    --------
    >>> covariate_text({"channels": {"displacement": {"name": "strain"}}}, "displacement")
    'strain'
    >>> covariate_text({"channels": {}}, "order")
    'place in the record'
    """
    if covariate in found["channels"] and covariate != "temperature":
        return channel_text(found, covariate)
    return COVARIATES.get(covariate, covariate)
