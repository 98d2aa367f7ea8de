"""Where the curve of a channel is half-way through the transformation."""

from __future__ import annotations

from sma_bayes.arrays import Floats
from sma_bayes.assess.transformation import curves_beyond, half_way
from sma_bayes.fitting.curves import CurveDraws
from sma_bayes.parameters.roles import Role


def middle_temperatures(curves: CurveDraws, channel: str) -> Floats | None:
    """Temperature at which each curve is half-way through the transformation, shape (S,).

    Where nothing stands beside the curve of the model that is its midpoint, A3 or B3. What a curve misses may move the
    place by far more than the midpoint is uncertain: the curve is then half-way where it is in the middle between the
    tangents of its plateaus, those of As and Af.

    Parameters
    ----------
    curves : CurveDraws
    channel : str

    Returns
    -------
    ndarray or None
        [unit of temperature] NaN of a draw that has no such tangents. None where the model has no midpoint of this
        channel.
    """
    position = curves.posterior.model.position(Role.MIDPOINT, channel)
    if position is None:
        return None
    if channel not in curves.weights:
        return curves.model_theta[:, position]
    measured = curves.posterior.records[curves.record].temperature
    curve, guide = curves_beyond(curves, channel)
    return half_way(curve, float(measured.min()), float(measured.max()), guide)
