"""What tells one run from another: data, priors, options and versions."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from typing import Any

from sma_bayes import __version__
from sma_bayes.fitting.posterior import versions
from sma_bayes.records.types import Campaign
from sma_bayes.runs.documents import read_mark
from sma_bayes.runs.fit_document import FitFindings, FitSummary
from sma_bayes.runs.schema import FindingDocument, StudyFindings
from sma_bayes.studies.options import FitOptions


def all_versions() -> dict[str, str]:
    """Versions of Python, of this package and of what it computes and draws with."""
    more = ("arviz", "corner", "h5netcdf", "matplotlib", "pandas", "pint", "xarray")
    return {**versions(), **{name: version(name) for name in more}}


def of_campaign(campaign: Campaign, seed: int) -> dict[str, Any]:
    """The keys of `StudyFindings` for a study of a campaign, and what was found about its measurements."""
    return {
        "campaign": campaign.name,
        "source": campaign.source,
        "seed": seed,
        "versions": all_versions(),
        "data_sha256": campaign.sha256,
        "findings": tuple(map(FindingDocument.about, campaign.findings)),
    }


def of_fit(found: StudyFindings | FitFindings, source: str | Path, seed: int) -> dict[str, Any]:
    """The keys of `StudyFindings` for a study of the findings of a finished run, in a folder or in memory."""
    return {
        "campaign": found.campaign,
        "source": str(source),
        "seed": seed,
        "versions": all_versions(),
        "data_sha256": found.data_sha256,
    }


def run_identity(campaign: Campaign, options: FitOptions) -> dict[str, Any]:
    """What decides the numbers of a run: what `run.json` holds, and what must agree for it to be resumed."""
    return {
        "schema": "sma-bayes/run/1",
        "data": campaign.sha256,
        "records": [record.key for record in campaign.records],
        "priors": hashlib.sha256(options.priors.whole_text.encode()).hexdigest(),
        "seed": options.seed,
        "model": options.model,
        "noise": options.noise,
        "sampler": options.plan.sampler.name,
        "pool": options.pool,
        "extrapolate": options.extrapolate,
        "bias_spring": None if options.bias is None else asdict(options.bias),
        "version": __version__,
        "versions": versions(),
    }


def fit_identity(verb: str, fit: FitSummary, asked: Mapping[str, object]) -> dict[str, Any]:
    """What decides the numbers of a study of a finished fit: the same of `run_identity`.

    Parameters
    ----------
    verb : str
    fit : FitSummary
        As its folder holds it.
    asked : mapping of str to object
        All options that change a number.
    """
    return study_identity(verb, fit.numbers_sha256, asked)


def study_identity(verb: str, checksum: str | None, asked: Mapping[str, object]) -> dict[str, Any]:
    """The same of a study of any finished run.

    Parameters
    ----------
    verb : str
    checksum : str or None
        Of the numbers of that run.
    asked : mapping of str to object
    """
    return {
        "schema": "sma-bayes/run/1",
        "kind": verb,
        "fit": checksum,
        **asked,
        "versions": all_versions(),
    }


def is_run_of(folder: Path, campaign: Campaign) -> bool:
    """Whether a folder holds a run of this campaign by this version."""
    found = read_mark(folder) or {}
    return bool(found.get("data") == campaign.sha256 and found.get("versions") == versions())
