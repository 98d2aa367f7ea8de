"""What speaks against taking the verdict of a study at its word."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

MOSTLY = 0.5
"""Share of the held-out gap below which what was named leaves most of it open."""
BEYOND = 1e-6
"""Below this a p-value is extrapolated so far that its digits say nothing."""


def p_text(p: float) -> str:
    """A p-value for people; ones far in the extrapolated tail are only bounded.

    Examples
    --------
    >>> p_text(0.0123), p_text(1e-30)
    ('p = 0.012', 'p < 1e-6')
    """
    return f"p = {p:.2g}" if p >= BEYOND else "p < 1e-6"


def outside_prior(parameter: Mapping[str, Any]) -> bool:
    """Whether the 90 % intervals of posterior and prior, a range from the literature, do not meet.

    Parameters
    ----------
    parameter : mapping
        An entry of ``parameters`` of an effect in ``gap.json``.
    """
    prior = parameter["prior"]
    return bool(parameter["q05"] > prior["q95"] or parameter["q95"] < prior["q05"])


def cautions(found: Mapping[str, Any]) -> list[str]:
    """Sentences, one for each reason to doubt.

    Parameters
    ----------
    found : mapping
        What ``gap.json`` holds.
    """
    out = _about_names(found) if found["verdict"] == "named" else []
    for e in (*found["effects"], *found["partial"]):
        far = [name for name, p in e["parameters"].items() if outside_prior(p)]
        if far:
            out.append(
                f"{e['id']}: the posterior of {', '.join(far)} lies outside the range that the literature gives. A "
                "form that fits only with improbable numbers may be standing in for something else."
            )
    return out


def _about_names(found: Mapping[str, Any]) -> list[str]:
    gap, left = found["gap"], found["remaining"]
    out = [*_about_closing(gap), *_about_choosing(gap["chosen_without"], found["effects"])]
    if left["p_value"] <= found["thresholds"]["p_value"]:
        channel = found["channels"][left["channel"]]["name"]
        out.append(
            f"Something is left: the extended model still disagrees ({p_text(left['p_value'])}), most in {channel} as "
            f"a function of {left['covariate']}, and nothing in the catalogue accounts for that."
        )
    return out


def _about_closing(gap: Mapping[str, Any]) -> list[str]:
    if gap["before"] <= gap["floor"] or gap["shrink"] >= MOSTLY:
        return []
    return [
        f"What was named closes {100.0 * gap['shrink']:.0f} % of the gap on held-out measurements: most of it is still "
        "open, or the effects do not carry over to what was held out."
    ]


def _about_choosing(chosen: Sequence[Sequence[str]], effects: Sequence[Mapping[str, Any]]) -> list[str]:
    """Whether the choice hangs on a part of the measurements; members of a class may stand for each other."""
    alike = {name: e["id"] for e in effects for name in e["class"]}
    unlike = [c for c in chosen if {alike.get(name, name) for name in c} != set(alike.values())]
    if not unlike:
        return []
    return [
        f"Without a part of the measurements another choice was made in {len(unlike)} of {len(chosen)} cases, so the "
        "choice hangs on few of them."
    ]
