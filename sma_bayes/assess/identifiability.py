"""Which parameters the data move, and which merely repeat their prior."""

from __future__ import annotations

import numpy as np
from pydantic import Field

from sma_bayes.arrays import Floats
from sma_bayes.document_part import DocumentPart, NumberOrNull
from sma_bayes.fitting.fit import Fit
from sma_bayes.parameters.transforms import Probit

IDENTIFIED = 0.9
"""Contraction from which a parameter counts as identified: its variance is a tenth of the prior's or less."""


class Direction(DocumentPart):
    """A combination of parameters that the data leave to the prior."""

    text: str = Field(description="the combination, in units of each prior's standard deviation")
    contraction: NumberOrNull = Field(
        description="1 less the ratio of posterior to prior variance along it [1]"
    )


def contraction(fit: Fit) -> Floats:
    """``1 - posterior variance / prior variance`` of each sampled parameter, shape (D,).

    Variances are those of the parameter itself, or of its logarithm where it has a sign. Near 1 where the data
    speak, near 0 where the prior is repeated; negative where the posterior is wider.
    """
    z = fit.draws.z.reshape(-1, fit.draws.z.shape[-1])
    space = fit.posterior.space
    out = 1.0 - z.var(axis=0) / space.prior_sd() ** 2
    slices = (np.arange(2000) + 0.5) / 2000
    for i, parameter in enumerate(space.free):
        transform = parameter.prior.transform
        if isinstance(transform, Probit):  # near a bound the probit stretches what is a narrow interval
            out[i] = 1.0 - transform.constrain(z[:, i]).var() / parameter.prior.quantile(slices).var()
    return np.asarray(out)


def free_directions(fit: Fit) -> tuple[Direction, ...]:
    """Combinations of parameters whose variance is more than half of the prior's."""
    z = fit.draws.z.reshape(-1, fit.draws.z.shape[-1])
    scaled = (z - z.mean(axis=0)) / fit.posterior.space.prior_sd()
    variance, vector = np.linalg.eigh(np.atleast_2d(np.cov(scaled.T)))
    out = []
    for k in np.flatnonzero(variance > 0.5)[::-1]:
        v = vector[:, k] * np.sign(vector[np.argmax(np.abs(vector[:, k])), k])
        out.append(Direction(text=_combination(v, fit), contraction=float(1.0 - variance[k])))
    return tuple(out)


def _combination(vector: Floats, fit: Fit) -> str:
    terms = [
        f"{'-' if value < 0 else '+'} {abs(value):.2f} {p.prior.transform.label(p.name)}"
        for value, p in zip(vector, fit.posterior.space.free, strict=True)
        if abs(value) >= 0.1
    ]
    return " ".join(terms).removeprefix("+ ")
