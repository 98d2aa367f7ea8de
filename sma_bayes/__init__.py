"""Bayesian stiffness of shape memory alloy springs.

    >>> import sma_bayes
    >>> campaign = sma_bayes.twin_campaign()
    >>> campaign.records[0].key
    '1A-10mHz-heating'

The names below are the public ones; each is imported from its module when it is first used, so that
``import sma_bayes`` is quick.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

__version__ = "0.1.0"

_PLACES = {
    "read_campaign": "sma_bayes.records.campaign",
    "start_campaign": "sma_bayes.records.starting_file",
    "twin_campaign": "sma_bayes.paper.twin",
    "read_priors": "sma_bayes.parameters.priors_file",
    "inspect_campaign": "sma_bayes.workflow",
    "fit": "sma_bayes.workflow",
    "fit_campaign": "sma_bayes.workflow",
    "study_gap": "sma_bayes.workflow",
    "compare": "sma_bayes.workflow",
    "ask": "sma_bayes.workflow",
    "diff": "sma_bayes.workflow",
    "cluster": "sma_bayes.inference.jobs",
    "run_study": "sma_bayes.workflow",
    "study_conditions": "sma_bayes.workflow",
    "reproduce_paper": "sma_bayes.reproduction.build",
    "fit_records": "sma_bayes.results.fitting",
    "credible_band": "sma_bayes.assess.bands",
    "correlation_factors": "sma_bayes.assess.correlation",
    "loop_quantities": "sma_bayes.assess.loops",
    "record_draws": "sma_bayes.conditions.draws",
    "stored_draws": "sma_bayes.report.stored_draws",
    "condition_features": "sma_bayes.conditions.features",
    "operating_effects": "sma_bayes.conditions.effects",
    "transformation_temperatures": "sma_bayes.assess.transformation",
    "open_posterior": "sma_bayes.arviz_bridge",
    "Campaign": "sma_bayes.records.types",
    "Condition": "sma_bayes.records.types",
    "Record": "sma_bayes.records.types",
    "SmaBayesError": "sma_bayes.errors",
}

__all__ = ["__version__", *sorted(_PLACES)]


def __getattr__(name: str) -> Any:
    if name in _PLACES:
        return getattr(import_module(_PLACES[name]), name)
    raise AttributeError(f"module 'sma_bayes' has no attribute {name!r}")


def __dir__() -> list[str]:
    return list(__all__)
