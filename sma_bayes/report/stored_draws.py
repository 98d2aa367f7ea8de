"""The posteriors of a finished fit, read back for the study of its conditions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any, Final

import numpy as np

from sma_bayes.conditions.draws import RecordDraws
from sma_bayes.errors import OutputError
from sma_bayes.parameters.distributions import FAMILIES, Distribution
from sma_bayes.quantities import SPECIMEN_QUANTITY, Floats
from sma_bayes.records.types import Branch, Condition
from sma_bayes.report.outputs import FINISH, StoredRecord, StoredRun, posterior_path, read_record, read_run
from sma_bayes.response.modified_sigmoid import ModifiedSigmoid

MODEL: Final = ModifiedSigmoid.name


def stored_draws(folder: Path) -> tuple[RecordDraws, ...]:
    """Draws of all records of a fit.

    Parameters
    ----------
    folder : Path
        Output folder of a finished `fit` or `demo`.

    Raises
    ------
    OutputError
        If it holds no finished fit, or one in which conditions share their parameters.
    """
    run = read_run(folder)
    if run.summary["options"]["pool"] != "none":
        raise OutputError(
            "holds a fit in which all conditions share A and B",
            file=folder,
            expected="parameters of their own for each condition, from which their differences are learnt",
            remedy="fit again without --pool campaign",
        )
    return tuple(_draws(run, r) for r in run.summary["records"])


def _draws(run: StoredRun, summary: Mapping[str, Any]) -> RecordDraws:
    path = posterior_path(run.folder, summary["key"])
    stored = read_record(path)
    try:
        return _joined(summary, stored)
    except (KeyError, ValueError) as error:
        raise OutputError(
            f"does not agree with summary.json: {error}",
            file=path,
            expected="the posterior that this fit wrote",
            remedy=FINISH,
        ) from None


def _joined(summary: Mapping[str, Any], stored: StoredRecord) -> RecordDraws:
    channels = tuple(summary["channels"])
    quantities = {c: q["name"] for c, q in summary["quantities"].items()}
    names = ModifiedSigmoid(channels).parameter_names
    flat = {name: values.reshape(-1) for name, values in stored.draws.items()}
    return RecordDraws(
        condition=Condition(summary["condition"], **summary["settings"]),
        branch=Branch(summary["branch"]),
        channels=channels,
        quantities=quantities,
        units={
            "temperature": summary["temperature"]["unit"],
            **{c: q["unit"] for c, q in summary["quantities"].items()},
        },
        specimen=bool(set(quantities.values()) & set(SPECIMEN_QUANTITY.values())),
        theta=np.stack([flat[name] for name in names], axis=-1),
        priors=tuple(_prior(summary["parameters"][name]["prior"]) for name in names),
        noise=stored.noise,
        noise_theta={c: _noise(flat, c) for c in channels},
        temperature=stored.inputs["temperature"],
        observed=stored.observed,
        path=summary["path"]["kind"],
        converged=bool(summary["converged"]),
    )


def _noise(flat: Mapping[str, Floats], channel: str) -> Floats:
    """Noise parameters of a channel, in the order in which the noise model names them: standard deviation first."""
    names = [f"{channel}_sd", *(n for n in flat if n.startswith(f"{channel}_") and n != f"{channel}_sd")]
    return np.stack([flat[name] for name in names], axis=-1)


def _prior(stated: Mapping[str, Any]) -> Distribution:
    kind = FAMILIES[stated["family"]]
    prior: Distribution = kind(**{f.name: stated[f.name] for f in fields(kind)})
    return prior
