"""Draws of the right posterior are passed whatever its tails, and those of another are not."""

from __future__ import annotations

import numpy as np
import pytest
from benchmark.judgement import ERRORS, Reference, share_errors
from scipy import stats

NORMAL, HEAVY = stats.norm(), stats.t(2.5)
"""The second has no fourth moment: the standard deviation of a thousand draws says little of its own."""


def reference_of(kind: stats.distributions.rv_frozen) -> Reference:
    z = kind.rvs((40_000, 1), random_state=np.random.default_rng(0))
    return Reference.of(z, ess=40_000.0)


@pytest.mark.parametrize("kind", [NORMAL, HEAVY], ids=["normal", "heavy"])
def test_errors_are_standard_errors(kind: stats.distributions.rv_frozen) -> None:
    """Of 2000 sets of 1000 draws: 6000 errors with variance one; its standard error is 0.02 to 0.03."""
    rng = np.random.default_rng(1)
    reference = reference_of(kind)
    sets = kind.rvs((2000, 1000), random_state=rng)
    errors = np.array([share_errors(z[:, None], reference) for z in sets])[:, :, 0]
    errors -= errors.mean(axis=0)  # that of the reference is in all of them alike
    assert np.var(errors) == pytest.approx(1.0 / (1.0 + 1000.0 / 40_000.0), abs=0.1)
    assert np.max(np.abs(errors)) < 5.0


def test_standard_deviations_could_not_judge_heavy_tails() -> None:
    rng = np.random.default_rng(2)
    reference = reference_of(HEAVY)
    sets = HEAVY.rvs((50, 1000), random_state=rng)
    assert np.mean(np.abs(sets.std(axis=1) / reference.sd - 1.0) > 0.1) > 0.3
    assert all(np.all(np.abs(share_errors(z[:, None], reference)) < ERRORS) for z in sets)


@pytest.mark.parametrize("kind", [NORMAL, HEAVY], ids=["normal", "heavy"])
@pytest.mark.parametrize(("scale", "shift"), [(0.6, 0.0), (1.5, 0.0), (1.0, 0.25)])
def test_another_posterior_is_caught(kind: stats.distributions.rv_frozen, scale: float, shift: float) -> None:
    """Much too narrow, too wide, or moved by a quarter of the scale."""
    z = shift + scale * kind.ppf((np.arange(4000) + 0.5) / 4000)[:, None]
    assert np.max(np.abs(share_errors(z, reference_of(kind)))) > ERRORS
