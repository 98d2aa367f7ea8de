"""What the slope dF/dX along the actuation path can mean on the rig at hand.

The slope of the actuation path is not the stiffness of the spring: on the path temperature changes too. With a
dead weight the force is constant and the slope is zero; against a bias spring force balance makes it the bias
spring's stiffness, whatever the alloy does.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sma_bayes.records.types import Record
from sma_bayes.response.modified_sigmoid import channel_unit

STRAIGHT = 1.5
"""A path counts as a straight line where a line explains it within this many times the noise."""


@dataclass(frozen=True, slots=True)
class PathRemark:
    """What the rig says about the path slope.

    Attributes
    ----------
    kind : str
        ``constant_load``, ``constant_displacement``, ``straight_path``, ``path_slope`` or ``not_observed``.
    message : str
    """

    kind: str
    message: str


def path_remark(record: Record, noise_sd: dict[str, float]) -> PathRemark:
    """Judge the actuation path of a record.

    Parameters
    ----------
    record : Record
    noise_sd : dict
        Standard deviation of the noise of each observed channel.
    """
    unit = channel_unit(record.units, "stiffness")
    if "force" in record.held:
        held = record.held["force"]
        return PathRemark(
            "constant_load",
            f"the rig held the {record.quantity('force')} at {held.mean:.4g} {record.units.get('force', '')} "
            f"(sd {held.sd:.2g}): the slope dF/dX of the path is zero by construction and says nothing about the "
            "spring; only the displacement is fitted",
        )
    if "displacement" in record.held:
        return PathRemark(
            "constant_displacement",
            f"the rig held the {record.quantity('displacement')}: the slope dF/dX of the path is not defined; only "
            "the force is fitted",
        )
    if not {"force", "displacement"} <= set(record.channels):
        kind = "path_slope" if "stiffness" in record.channels else "not_observed"
        text = (
            "stiffness is the slope dF/dX of the actuation path, as the paper has it; only B1/A1 follows from it"
            if kind == "path_slope"
            else "force and displacement were not both observed: no stiffness follows from this record"
        )
        return PathRemark(kind, text)
    x, f = record.observed["displacement"], record.observed["force"]
    slope, intercept = np.polyfit(x, f, 1)
    residual = float(np.sqrt(np.mean((f - intercept - slope * x) ** 2)))
    noise = float(np.hypot(noise_sd["force"], slope * noise_sd["displacement"]))
    if residual <= STRAIGHT * noise:
        return PathRemark(
            "straight_path",
            f"force is a straight line in displacement within the noise, with slope {slope:.4g} {unit}: that is "
            "what a bias spring of this stiffness enforces at every temperature, so the path slope tells the "
            "bias spring's stiffness and nothing about the alloy",
        )
    return PathRemark(
        "path_slope",
        "stiffness is the slope dF/dX of the actuation path, along which temperature changes; it is not the "
        "stiffness of the spring at constant temperature",
    )
