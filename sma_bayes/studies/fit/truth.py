"""What a fit of simulated measurements says beside the truth that they were made from."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from sma_bayes.records.types import Branch
from sma_bayes.report.content import Content, Estimate, KnownTruth, Number, RecordContent
from sma_bayes.report.notation import unit_label
from sma_bayes.report.tables import UNIT_OF_ROW, Column, Table, table_of
from sma_bayes.runs.fit_document import FitFindings
from sma_bayes.runs.outputs import StoredBand, StoredRun, band_of
from sma_bayes.simulated.campaign import LOADS, SOURCE, log_of, truth_of


def is_simulated(summary: FitFindings) -> bool:
    """Whether a run is one of the measurements of the simulated rig."""
    return summary.source.startswith(SOURCE) and {r.condition for r in summary.records} <= set(LOADS)


def known_truth(run: StoredRun, records: Iterable[RecordContent]) -> tuple[KnownTruth, ...]:
    """The true curves beside the bands, for each channel of each record; empty where the truth is not known.

    Parameters
    ----------
    run : StoredRun
    records : iterable of RecordContent
        Of this run.
    """
    if not is_simulated(run.summary):
        return ()
    return tuple(
        _beside(r, c.channel, band_of(run.folder, r.key, c.channel, r.document.band_sha256.get(c.channel)))
        for r in records
        for c in r.channels
    )


def _beside(r: RecordContent, channel: str, band: StoredBand) -> KnownTruth:
    found = r.channel(channel)
    assert found is not None
    inside = ~band.extrapolated
    t = band.temperature[inside]
    q = {name: found.scale * values[inside] for name, values in band.quantiles.items()}
    true = truth_of(r.condition, Branch(r.branch), t)
    curve = found.scale * true[channel]
    displacement = true["displacement"]
    middle = int(np.argmin(np.abs(displacement - 0.5 * (displacement.min() + displacement.max()))))
    return KnownTruth(
        record=r.key,
        condition=r.condition,
        branch=r.branch,
        channel=channel,
        name=found.name,
        unit=found.unit,
        temperature=t,
        temperature_unit=r.temperature_unit,
        curve=curve,
        within=float(np.mean((q["q05"] <= curve) & (curve <= q["q95"]))),
        middle=float(t[middle]),
        true=float(curve[middle]),
        estimate=Estimate(
            float(q["q50"][middle]), float(q["q05"][middle]), float(q["q95"][middle]), found.unit
        ),
    )


def thermometer_offsets(run: StoredRun) -> dict[str, float]:
    """What the thermocouple truly read too much in each condition [K]; empty where the truth is not known."""
    if not is_simulated(run.summary):
        return {}
    conditions = dict.fromkeys(r.condition for r in run.summary.records)
    return {c: log_of(c, run.summary.seed).offset for c in conditions}


def truth_table(content: Content) -> Table:
    """How far bands hold the truth, and what they say halfway through the transformation."""
    return table_of(
        "truth",
        "Bands and the truth",
        "Within: share of the measured temperatures at which the 90 % band holds the true curve; neighbours go "
        "together, so that one record is about one trial. Halfway: where the true displacement has gone half of its "
        "way, the true value, and median and 90 % interval of the fit there.",
        [(k, k.estimate) for k in content.truth],
        (Column("condition", "condition"), lambda k, fit: k.condition),
        (Column("branch", "branch"), lambda k, fit: k.branch),
        (Column("channel", "channel"), lambda k, fit: k.name),
        (Column("unit", "unit"), lambda k, fit: unit_label(k.unit) or "1"),
        (Column("within", "within", "1"), lambda k, fit: Number(k.within, "1", 0.01)),
        (
            Column("halfway at", "halfway", content.truth[0].temperature_unit),
            lambda k, fit: Number(k.middle, k.temperature_unit, 0.1),
        ),
        (Column("truth", "true", UNIT_OF_ROW), lambda k, fit: Number(k.true, k.unit, _width(fit))),
        (Column("posterior", "fit", UNIT_OF_ROW), lambda k, fit: fit),
        grouped=2,
    )


def _width(estimate: Estimate) -> float | None:
    return None if estimate.q05 is None or estimate.q95 is None else (estimate.q95 - estimate.q05) / 3.0
