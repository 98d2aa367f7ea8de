"""What was read of a campaign, and the noise about least squares, without sampling."""

from __future__ import annotations

from typing import Any

import numpy as np

from sma_bayes.fitting.noise_choice import choose_noise
from sma_bayes.fitting.posterior import build_posterior
from sma_bayes.fitting.warm_start import warm_start
from sma_bayes.noise import NOISE_MODELS
from sma_bayes.records.types import Campaign, Record
from sma_bayes.response import DEFAULT_MODEL, RESPONSE_MODELS
from sma_bayes.runs.fit_document import GoodnessSummary
from sma_bayes.runs.schema import FindingDocument
from sma_bayes.studies.inspect.schema import (
    HeldChannelDocument,
    InspectedChannel,
    InspectedNoise,
    InspectedRecord,
    InspectionDocument,
    TemperatureRange,
)


def inspect_campaign(campaign: Campaign) -> dict[str, Any]:
    """Describe what was read, and the noise about a least-squares fit, without sampling.

    Returns
    -------
    dict
        What `sma-bayes inspect --json` prints (`sma-bayes/inspect/1`).
    """
    return InspectionDocument(
        schema="sma-bayes/inspect/1",
        campaign=campaign.name,
        source=campaign.source,
        data_sha256=campaign.sha256,
        records=tuple(_described(r) for r in campaign.records),
        findings=tuple(map(FindingDocument.about, campaign.findings)),
    ).as_json()


def _described(record: Record) -> InspectedRecord:
    priors = RESPONSE_MODELS[DEFAULT_MODEL].default_priors()
    posterior = build_posterior([record], NOISE_MODELS["independent"], priors)
    start = warm_start(posterior, np.random.default_rng(0))
    choice = choose_noise(posterior, start, priors, sweeps=True)
    return InspectedRecord.about(
        record,
        condition=record.condition.id,
        branch=record.branch.value,
        rows=(int(record.row.min()), int(record.row.max())),
        segments=int(np.unique(record.inputs["segment"]).size),
        temperature=TemperatureRange(
            unit=record.units["temperature"],
            lowest=float(record.temperature.min()),
            highest=float(record.temperature.max()),
        ),
        channels={
            c: InspectedChannel(name=record.quantity(c), unit=record.units[c], noise_sd=start.fit[0][c].rmse)
            for c in record.channels
        },
        held={
            c: HeldChannelDocument(
                name=record.quantity(c), unit=record.units.get(c, ""), mean=h.mean, sd=h.sd
            )
            for c, h in record.held.items()
        },
        noise=InspectedNoise(name=choice.name, reason=choice.reason, lag1=dict(choice.lag1)),
        fit={c: GoodnessSummary.about(g) for c, g in start.fit[0].items()},
    )
