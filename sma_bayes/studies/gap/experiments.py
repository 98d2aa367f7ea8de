"""Which experiment would tell effects apart that these data cannot.

Each design changes what would be applied in a further record. Both effects, fitted to the measurements at hand, predict
that record; how far the predictions are apart, after the second effect and the model have adapted to the first as
best they can on old and new samples together, is the separation in standard deviations of the noise.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.studies.gap.fitting import FittedHypothesis, held_at

Inputs = Mapping[str, Floats]
ENOUGH_SEPARATION = 5.0
"""Separation [standard deviations] that an experiment should give."""
HOPELESS_SEPARATION = 0.5
"""Separation below which no number of repeats that anybody makes would help."""


@dataclass(frozen=True, slots=True)
class ExperimentDesign:
    """A further record, made from one that exists.

    Attributes
    ----------
    title : str
        What to do, in words.
    needs : tuple of str
        Inputs that it changes and that must be there.
    inputs : callable
        From the inputs of a history to those of the further record.
    """

    title: str
    needs: tuple[str, ...]
    inputs: Callable[[Inputs], dict[str, Floats]]


@dataclass(frozen=True, slots=True)
class ProposedExperiment:
    """The experiment that separates best.

    Attributes
    ----------
    design : ExperimentDesign
    separation : float
        Least separation of the first effect from any other of the class [standard deviations of the noise].
    """

    design: ExperimentDesign
    separation: float

    def __str__(self) -> str:
        if self.separation < HOPELESS_SEPARATION:
            best = f"the best, {self.design.title}, by {self.separation:.1f} sigma"
            return f"none of the designs that were tried ({best})"
        enough = "" if self.separation >= ENOUGH_SEPARATION else ", which may not be enough: repeat it"
        return f"{self.design.title} (expected separation {self.separation:.1f} sigma{enough})"


def _faster(factor: float) -> Callable[[Inputs], dict[str, Floats]]:
    return lambda v: {**v, "time": v["time"] / factor, "rate": v["rate"] * factor}


def _scaled(name: str, factor: float) -> Callable[[Inputs], dict[str, Floats]]:
    return lambda v: {**v, name: v[name] * factor}


def _more_cycles(v: Inputs) -> dict[str, Floats]:
    later = dict(v)
    later["cycle"] = v["cycle"] + 4.0 * (v["cycle"].max() - v["cycle"].min() + 1.0)
    if "time" in v:
        later["time"] = v["time"] + 4.0 * np.ptp(v["time"])
    return later


def _lower_peak(v: Inputs) -> dict[str, Floats]:
    bottom, top = float(v["temperature"].min()), float(v["temperature"].max())
    scaled = bottom + (v["temperature"] - bottom) * 0.7
    out = {**v, "temperature": scaled}
    if "rate" in v:
        out["rate"] = v["rate"] * 0.7
    return out if top > bottom else dict(v)


def _slow_cooling_only(v: Inputs) -> dict[str, Floats]:
    cooling = v["branch"] < 0.0
    factor = np.where(cooling, 0.1, 1.0)
    dt = np.diff(v["time"], prepend=v["time"][:1]) / factor
    return {**v, "rate": v["rate"] * factor, "time": v["time"][0] + np.cumsum(dt)}


def _warmer_room(v: Inputs) -> dict[str, Floats]:
    return {**v, "ambient_temperature": v["ambient_temperature"] + 10.0}


def _waiting(v: Inputs) -> dict[str, Floats]:
    return {**v, "time": v["time"] + 10.0 * np.ptp(v["time"])}


DESIGNS: tuple[ExperimentDesign, ...] = (
    ExperimentDesign("sweep at a third of the rate", ("time", "rate"), _faster(1.0 / 3.0)),
    ExperimentDesign("sweep at three times the rate", ("time", "rate"), _faster(3.0)),
    ExperimentDesign("heat as before, cool ten times as slowly", ("time", "rate"), _slow_cooling_only),
    ExperimentDesign("repeat with twice the load", ("load",), _scaled("load", 2.0)),
    ExperimentDesign("go on for four times as many cycles, then measure again", ("cycle",), _more_cycles),
    ExperimentDesign("turn round at 70 % of the temperature range", ("temperature",), _lower_peak),
    ExperimentDesign("repeat in a room that is 10 K warmer", ("ambient_temperature",), _warmer_room),
    ExperimentDesign(
        "let the cold rig rest for ten times the length of the record, then measure again",
        ("time",),
        _waiting,
    ),
    ExperimentDesign("repeat with half the current", ("current",), _scaled("current", 0.5)),
)


def next_experiment(rivals: Sequence[FittedHypothesis]) -> ProposedExperiment | None:
    """The design that separates the first of several fitted hypotheses best from all others.

    Parameters
    ----------
    rivals : sequence of FittedHypothesis
        The same histories and baseline, each with another effect.

    Returns
    -------
    ProposedExperiment or None
        None where there is nothing to separate, or no design can be made from what was recorded.
    """
    if len(rivals) < 2:
        return None
    proposals = []
    for design in DESIGNS:
        if all(name in h.inputs for h in rivals[0].hypothesis.histories for name in design.needs):
            apart = min(_separation(rivals[0], other, design) for other in rivals[1:])
            proposals.append(ProposedExperiment(design, apart))
    return max(proposals, key=lambda p: p.separation, default=None)


def _separation(truth: FittedHypothesis, rival: FittedHypothesis, design: ExperimentDesign) -> float:
    """How far a rival stays from what the first hypothesis predicts for old and new samples together."""
    histories = truth.hypothesis.histories
    further = [replace(h, inputs=_continued(design.inputs(h.inputs))) for h in histories]
    doubled = [(*f.hypothesis.histories, *further) for f in (truth, rival)]
    hypotheses = [
        replace(f.hypothesis, histories=h, layout=f.hypothesis.layout * 2)
        for f, h in zip((truth, rival), doubled, strict=True)
    ]
    predicted = [
        replace(h, observed=hypotheses[0].predict(truth.theta, i))
        for i, h in enumerate(hypotheses[0].histories)
    ]
    noise = rival.noise * 2
    fitted = held_at(replace(hypotheses[1], histories=tuple(predicted)), rival.z, noise)
    return float(np.linalg.norm(fitted.project_out(fitted.whitened[:, None])))


def _continued(inputs: dict[str, Floats]) -> dict[str, Floats]:
    return {name: np.asarray(values, dtype=float) for name, values in inputs.items()}
