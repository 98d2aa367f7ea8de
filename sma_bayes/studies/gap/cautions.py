"""What speaks against taking the verdict of a study at its word."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from sma_bayes.effects import EFFECTS
from sma_bayes.report.notation import unit_label
from sma_bayes.studies.gap.flexible import SHAPE_COVARIATE
from sma_bayes.studies.gap.scatter import members_of
from sma_bayes.studies.gap.schema import AddedEffect, GapOfModel, StatedGap, StatedRemaining, StudiedCondition
from sma_bayes.studies.gap.words import channel_text, covariate_text, p_text, remainder_text

MOSTLY_CLOSED_SHARE = 0.5
"""Share of the held-out gap below which what was named leaves most of it open."""
OPEN_GAP_SDS = 1.1
"""Held-out gap from which on more than noise is left [standard deviations of the noise]."""
UNLIKE_SPECTRUM_P = 1e-3
"""Probability, over all channels, at which a spectrum counts as unlike the model of the noise."""
LONG_MEMORY = 0.95
"""Correlation of neighbouring samples from which on the noise may well be misfit."""


def cautions(found: GapOfModel) -> list[str]:
    """Sentences, one for each reason to doubt."""
    out = _about_names(found) if found.verdict == "named" else _about_carrying_over(found)
    for e in found.added:
        far = [name for name, p in e.parameters.items() if p.outside_prior]
        if far:
            out.append(
                f"{e.id}: the posterior of {', '.join(far)} lies outside the range that the literature gives. A "
                "form that fits only with improbable numbers may be standing in for something else."
            )
    return [
        *out,
        *_about_intervals(found),
        *_about_two_loads(found),
        *_about_scatter(found),
        *_about_sweeps(found),
        *_about_suspects(found),
        *_about_steadiness(found),
        *_about_memory(found),
        *_about_spectrum(found),
    ]


def _about_intervals(found: GapOfModel) -> list[str]:
    """What numbers of effects are where more than noise is left, or may be."""
    if found.readings_as_one is None:
        return []
    return [
        "The model misses more than noise explains, or noise that remembers for long may hide what it misses. So "
        f"numbers of effects are those of least squares, and {found.readings_as_one:.3g} readings count as one in "
        "their intervals: what is missed is reckoned with as chance that is as large and lasts as long. A bias that is "
        "the same in all records is not in them."
    ]


def _about_two_loads(found: GapOfModel) -> Iterator[str]:
    """Effects of the load that two conditions alone speak for: anything else may differ between these."""
    loads = {c.settings.get("load") for c in found.conditions}
    of_load = [e.id for e in found.added if e.id in EFFECTS and "several_loads" in EFFECTS[e.id].needs]
    if of_load and len(found.conditions) == len(loads) == 2:
        one, other = (c.id for c in found.conditions)
        yield (
            f"{', '.join(of_load)}: whatever else differs between {one} and {other}, the only two loads, looks the "
            "same (a sensor set to zero anew, another temperature reading, another specimen); a third load tells, or "
            "one of the two measured again."
        )


def _about_scatter(found: GapOfModel) -> Iterator[str]:
    """Random effects: they say how much runs or cycles differ, and not why."""
    for e in found.added:
        members = members_of(EFFECTS[e.id]) if e.id in EFFECTS else ()
        if e.follows is not None and e.follows.member is not None:
            yield (
                f"{e.id} is no name: {100.0 * e.follows.share:.0f} % of how {members[0]}s differ is "
                f"{e.follows.member} alone, where something happened; the others are alike."
            )
        elif e.follows is not None and e.follows.settles:
            yield (
                f"{e.id} is no name: {100.0 * e.follows.share:.0f} % of what cycles have of their own settles with the "
                "cycle in each condition, so a cause that is not in the catalogue and dies away explains as much "
                "(training, a rig that warms up); a condition that is begun anew tells."
            )
        elif e.follows is not None and e.follows.alternates:
            yield (
                f"{e.id} is no name: {100.0 * e.follows.share:.0f} % of what cycles have of their own is how odd ones "
                "differ from even ones, so what is done anew for every second cycle explains as much."
            )
        elif e.follows is not None:
            yield (
                f"{e.id} is no name: {100.0 * e.follows.share:.0f} % of what {members[0]}s have of their own goes with "
                f"their {covariate_text(found.channels, e.follows.covariate)}, so a law of that which is not in the "
                f"catalogue explains as much; one {members[0]} measured again tells."
            )
        elif "condition" in members:
            yield f"{e.id} says how much conditions differ, not why{_about_own_settings(found.conditions)}."
        elif members:
            yield f"{e.id} says how much cycles differ, not why: what follows slowly enough looks the same."


def _about_own_settings(conditions: Sequence[StudiedCondition]) -> str:
    """Whether each condition has settings of its own, so that a law of these can't be told from chance."""
    names = dict.fromkeys(name for c in conditions for name in c.settings)
    varied = [n for n in names if len({c.settings.get(n) for c in conditions}) > 1]
    if not varied or len({tuple(c.settings.get(n) for n in varied) for c in conditions}) < len(conditions):
        return ""
    return (
        f": each has {' and '.join(varied)} of its own, and a law of that which is not in the catalogue looks the "
        "same; one condition measured again tells"
    )


CYCLE_EFFECTS = ("training", "training_drift", "amplitude_fatigue")
"""Effects that are laws of the cycle."""


def _about_sweeps(found: GapOfModel) -> list[str]:
    """What a law of the cycle can't claim."""
    law = found.sweeps.law
    if law is None or not found.sweeps.numbers:
        return []
    named = [e.id for e in found.effects if e.id in CYCLE_EFFECTS]
    if law.untestable.startswith("not testable"):
        return [f"Whether sweeps differ by a law of the cycle or by chance is {law.untestable}."]
    if law.untestable:
        return [f"{', '.join(named)}: {law.untestable}."] if named else []
    if named and law.p_value is not None and law.p_value > found.thresholds.p_value:
        return [
            f"{', '.join(named)}: other orders of the cycles fit a law as well ({p_text(law.p_value)} by exchanging "
            "whole cycles), so that the order may be chance."
        ]
    return []


def _about_suspects(found: GapOfModel) -> Iterator[str]:
    """Records that are unlike the others of the same settings."""
    for condition in dict.fromkeys(s.condition for s in found.suspects):
        own = [s for s in found.suspects if s.condition == condition]
        told = ", ".join(
            f"{s.quantity} {s.value:.3g} {unit_label(s.unit)}".rstrip() + f" (others {s.others:.3g})"
            for s in own[:3]
        )
        yield (
            f"{condition} is a suspect record: {told}, {p_text(own[0].p_value)}. The recorded input is not what was "
            "applied, or the specimen changed."
        )


def _about_names(found: GapOfModel) -> list[str]:
    gap = found.gap
    out = [*_about_closing(gap), *_about_choosing(gap.chosen_without, found.effects)]
    if remainder_text(found):
        out.append(
            f"Something is left: the extended model still disagrees ({p_text(found.remaining.p_value)}), "
            f"{remainder_text(found)}. {_about_what_is_left(found.remaining)}"
        )
    return out


def _about_what_is_left(left: StatedRemaining) -> str:
    if left.covariate == SHAPE_COVARIATE and left.channel != "temperature":
        return (
            "That is the shape of the curve, the same in every cycle and condition; --model offers richer ones "
            "('sma-bayes priors --list')."
        )
    return "That may be the form of what was named, which is never exactly that of the catalogue, or something else."


def _about_closing(gap: StatedGap) -> list[str]:
    if gap.before <= gap.floor:
        return []
    if gap.shrink < MOSTLY_CLOSED_SHARE:
        return [
            f"What was named closes {100.0 * gap.shrink:.0f} % of what can be explained on held-out measurements: "
            "most of it is still open, or the effects do not carry over to what was held out."
        ]
    if gap.after > OPEN_GAP_SDS:
        return [
            f"Held-out residuals are still {gap.after:.2f} times what noise alone would leave, so what was named is "
            "not all that is missing there."
        ]
    return []


def _about_carrying_over(found: GapOfModel) -> list[str]:
    """Whether what was added without a name helps where it was not fitted."""
    gap = found.gap
    if not found.partial or gap.after < gap.before:
        return []
    return [
        "What helps does so only where it was fitted: the gap on held-out measurements is "
        f"{gap.after:.3f} with it and {gap.before:.3f} without."
    ]


def _about_choosing(chosen: Sequence[Sequence[str]], effects: Sequence[AddedEffect]) -> list[str]:
    """Whether the choice hangs on a part of the measurements; members of a class may stand for each other."""
    alike = {name: e.id for e in effects for name in e.class_}
    unlike = [c for c in chosen if {alike.get(name, name) for name in c} != set(alike.values())]
    if not unlike:
        return []
    return [
        f"Without a part of the measurements another choice was made in {len(unlike)} of {len(chosen)} cases, so the "
        "choice hangs on few of them."
    ]


def _about_spectrum(found: GapOfModel) -> list[str]:
    unlike = [
        (n, n.spectrum)
        for n in found.noise
        if n.spectrum is not None and n.spectrum.p_value <= UNLIKE_SPECTRUM_P / len(found.noise)
    ]
    if not unlike:
        return []
    worst, band = min(unlike, key=lambda pair: pair[1].p_value)
    where = f"{worst.condition} {channel_text(found.channels, worst.channel)}"
    others = f" (so do {len(unlike) - 1} of the others)" if len(unlike) > 1 else ""
    return [
        f"The noise of {where} does not look like its model, AR(1): between {band.start:.3g} and {band.stop:.3g} "
        f"{band.unit} it has {band.ratio:.2g} times the power that is assumed{others}. Bayes factors and the "
        "p-value lean on that model."
    ]


def _about_steadiness(found: GapOfModel) -> list[str]:
    if not found.steady_noise:
        return []
    return [
        "At first nothing was seen: one cycle unlike the others, or jumps, had passed for noise that remembers. "
        "Places, sizes and the p-value are beside the shorter memory that is left without them."
    ]


def _about_memory(found: GapOfModel) -> list[str]:
    long = [n for n in found.noise if n.lag1 >= LONG_MEMORY]
    if not long:
        return []
    where = dict.fromkeys(f"{n.condition} {channel_text(found.channels, n.channel)}" for n in long)
    named = ", ".join(list(where)[:4]) + (" and others" if len(where) > 4 else "")
    return [
        f"What passes for noise of {named} hardly changes from sample to sample (correlation "
        f"{min(n.lag1 for n in long):.2f} or more). Slow misfit is probably in it: sizes in sigma are then too "
        "small, and a held-out gap near 1 does not say that the model is right."
    ]
