"""What the slope dF/dX along the actuation path can mean on the rig at hand.

The slope of the actuation path is not the stiffness of the spring: on the path temperature changes too. With a
dead weight the force is constant and the slope is zero; against a bias spring force balance makes it the bias
spring's stiffness, whatever the alloy does.
"""

from __future__ import annotations

import numpy as np
from pydantic import Field

from sma_bayes.document_part import DocumentPart
from sma_bayes.quantities import ARBITRARY, CHANNELS, convert, unit_text
from sma_bayes.records.types import Record
from sma_bayes.response.modified_sigmoid import channel_unit

STRAIGHT_LINE_NOISE_FACTOR = 1.5
"""A path counts as a straight line where a line explains it within this many times the noise."""
MAX_NOISE_SHARE = 0.25
"""Share of the range of the force that the noise may take for the shape of the path to be told at all."""


class PathRemark(DocumentPart):
    """What dF/dX means on this rig."""

    kind: str = Field(
        default="",
        description="`constant_load`, `constant_displacement`, `straight_path`, `path_slope` or `not_observed`",
    )
    message: str = Field(default="", description="in words")


def path_remark(record: Record, noise_sd: dict[str, float], *, slope_supported: bool = True) -> PathRemark:
    """Judge the actuation path of a record.

    Parameters
    ----------
    record : Record
    noise_sd : dict
        Standard deviation of the noise of each observed channel.
    slope_supported : bool
        Whether the fit supports a stiffness; if not, the slope of a straight path is not told either.
    """
    force, displacement, stiffness = (record.quantity(c) for c in CHANNELS)
    slope_text = f"d{record.symbol('force')}/d{record.symbol('displacement')}"
    tested = "specimen" if record.specimen else "spring"
    if "force" in record.held:
        return PathRemark(
            kind="constant_load",
            message=f"the {force} is taken as held: the slope {slope_text} of such a path tells how the rig held it, "
            f"and nothing about the {tested}; only the {displacement} is fitted",
        )
    if "displacement" in record.held:
        return PathRemark(
            kind="constant_displacement",
            message=f"the rig held the {displacement}: the slope {slope_text} of the path is not defined; only "
            f"the {force} is fitted",
        )
    if not {"force", "displacement"} <= set(record.channels):
        kind = "path_slope" if "stiffness" in record.channels else "not_observed"
        text = (
            f"{stiffness} is the slope {slope_text} of the actuation path, as the paper has it; only B1/A1 follows "
            "from it"
            if kind == "path_slope"
            else f"{force} and {displacement} were not both observed: no {stiffness} follows from this record"
        )
        return PathRemark(kind=kind, message=text)
    x, f = record.observed["displacement"], record.observed["force"]
    slope, intercept = np.polyfit(x, f, 1)
    residual = float(np.sqrt(np.mean((f - intercept - slope * x) ** 2)))
    noise = float(np.hypot(noise_sd["force"], slope * noise_sd["displacement"]))
    if residual <= STRAIGHT_LINE_NOISE_FACTOR * noise and noise <= MAX_NOISE_SHARE * float(np.ptp(f)):
        other = "an elastic constraint" if record.specimen else "a bias spring"
        within = (
            f"the noise, with slope {_as_declared(record, float(slope))}" if slope_supported else "the noise"
        )
        return PathRemark(
            kind="straight_path",
            message=f"{force} is a straight line in {displacement} within {within}: that is what {other} imposes at "
            f"every temperature, so the path slope tells {other}'s {stiffness} and nothing about the alloy",
        )
    return PathRemark(
        kind="path_slope",
        message=f"{stiffness} is the slope {slope_text} of the actuation path, along which temperature changes; it is "
        f"not the {stiffness} of the {tested} at constant temperature",
    )


def _as_declared(record: Record, slope: float) -> str:
    """A slope of the path in the unit that the measurements declare of the stiffness, or of force and displacement."""
    unit, declared = channel_unit(record.units, "stiffness"), record.declared_units
    parts = [declared.get(c) for c in ("force", "displacement")]
    derived = parts[0] if record.specimen else "/".join(p for p in parts if p) if all(parts) else None
    shown = declared.get("stiffness") or derived or unit
    if ARBITRARY not in unit and ARBITRARY not in shown:
        slope, unit = float(convert(slope, unit, shown, what="stiffness")), shown
    return f"{slope:.4g} {unit_text(unit)}".rstrip()
