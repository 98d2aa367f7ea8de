"""A force that contains the load that is carried."""

from __future__ import annotations

from dataclasses import dataclass

from sma_bayes.arrays import Floats
from sma_bayes.effects.types import Inputs, Place, Response, Scales
from sma_bayes.parameters.distributions import LogNormal
from sma_bayes.parameters.space import Parameter


@dataclass(frozen=True)
class DeadLoad:
    """The load cell carries what hangs on the spring: ``F -> F + share (load - r)``, r the typical load measured.

    At rest a cell in line with spring and weight bears the whole of it, hot or cold, and the share is 1; pulleys and
    levers multiply it, a guide takes some off, and a cell beside the pull sees little. The stiffness, dF/dX, stays.
    Each condition's own B4 absorbs it completely; it shows where one set of parameters serves several loads. A zero of
    the cell that was set anew between two runs looks the same where only two loads were tried: a share far from that of
    the rig speaks for it, a third load or a run that is repeated tells.
    """

    id = "dead_load"
    title = "the force contains the load"
    equation = "F -> F + share (load - r), r the typical load measured"
    reference = (
        "statics: what bears a hanging weight at rest bears all of it, times the ratio of levers and pulleys between "
        "the two and the cosine of the angle between pull and load cell"
    )
    needs = ("force", "several_loads")
    place = Place.RIG

    def parameters(self, scales: Scales) -> tuple[Parameter, ...]:
        force, load = scales.units["force"], "Pa" if scales.specimen else "N"
        sign = scales.direction("force") * scales.direction("load")
        if force == load:
            unit, prior = "1", LogNormal(0.5, 1.5, sign)
            source = (
                "1 in line, levers and pulleys up to 1:6, some per cent beside the pull or in a guide: "
                "90 % between 0.042 and 5.9"
            )
        else:
            unit = f"{force}/{load}"
            prior = LogNormal(0.5 * scales.level["force"] / scales.level["load"], 1.0, sign)
            source = "share of the greatest force that is the greatest load, 90 % between 0.097 and 2.6"
        return (Parameter("share", unit, "force a load, 1 where the cell bears all of it", prior, source),)

    def apply(self, response: Response, theta: Floats, inputs: Inputs) -> dict[str, Floats]:
        out = response(inputs)
        more = inputs["load"] - inputs["typical_load"]
        return {**out, "force": out["force"] + theta[..., :1] * more} if "force" in out else out
