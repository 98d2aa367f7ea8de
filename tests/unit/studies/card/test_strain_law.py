"""How the transformation strain grows with stress: least squares comes to the law that describes it."""

from __future__ import annotations

import numpy as np
import pytest

from sma_bayes.studies.card.pooling import _StrainLaw

STRESS = np.repeat([50.0, 100.0, 150.0, 200.0], 2)
SEEN = np.array([0.0280, 0.0250, 0.0291, 0.0266, 0.0300, 0.0284, 0.0303, 0.0291])
"""As of a real wire, heating and cooling."""


def deviance(law: _StrainLaw, z: np.ndarray, sd: float) -> float:
    least, most, k = law.constants(z)
    prior = [float(least) / law.largest / 0.2, (np.log(most) - np.log(0.05)) / 0.5, np.log(k * law.top / 3.0)]
    return float(np.sum(((SEEN - law.strain(z)) / sd) ** 2) + np.sum(np.square(prior)))


@pytest.mark.parametrize("sd", [1.5e-4, 9e-4])
def test_a_strain_that_grows_is_not_held_at_its_mean(sd: float) -> None:
    """H_min at a bound beside H_max is where it stayed, 4.7 standard deviations of its prior from zero."""
    law = _StrainLaw(STRESS, 200.0, float(SEEN.max()))
    z = law.fitted(SEEN, sd, np.zeros(3))
    told = law.strain(z)
    assert told[-1] - told[0] == pytest.approx(0.0032, abs=0.0008)
    flat = np.array([5.0, np.log(SEEN.mean()), 0.0])
    assert deviance(law, z, sd) < deviance(law, flat, sd) - 5.0
    rng = np.random.default_rng(0)
    for start in rng.normal(size=(20, 3)) * [1.0, 0.3, 1.0] + [0.5, np.log(0.03), 0.0]:
        other = law.fitted(SEEN, sd, np.zeros(3), start)
        assert deviance(law, z, sd) < deviance(law, other, sd) + 0.05
