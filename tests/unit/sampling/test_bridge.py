"""Bridge sampling on densities whose integral is known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from sma_bayes.sampling.bridge import bridge_evidence

SCALE = 7.5
"""Log of the integral of each density below."""


@dataclass(frozen=True)
class Bent:
    """A normal density bent along a parabola, which leaves its integral; straight for ``bend = 0``."""

    bend: float
    d: int = 3

    @property
    def names(self) -> tuple[str, ...]:
        return tuple("xyz")

    def log_prob(self, z: np.ndarray) -> np.ndarray:
        u = z.copy()
        u[:, 1] -= self.bend * (z[:, 0] ** 2 - 1.0)
        return SCALE - 0.5 * (u**2).sum(axis=1) - 0.5 * self.d * np.log(2.0 * np.pi)

    def draw_prior(self, rng: np.random.Generator, size: int) -> np.ndarray:
        return 3.0 * rng.standard_normal((size, self.d))

    def draws(self, rng: np.random.Generator) -> np.ndarray:
        z = rng.standard_normal((4000, self.d))
        z[..., 1] += self.bend * (z[..., 0] ** 2 - 1.0)
        return z


@pytest.mark.parametrize("bend", [0.0, 1.0])
def test_the_evidence_is_the_integral_within_its_error(bend: float) -> None:
    density = Bent(bend)
    off = []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        z = density.draws(rng)
        found = bridge_evidence(density, z, np.zeros(len(z)), rng)
        assert found.sd < 0.06
        off.append((found.value - SCALE) / found.sd)
    assert np.sqrt(np.mean(np.square(off))) < 1.8  # chi of 12 degrees of freedom: a false alarm in 20000
    assert np.sqrt(np.mean(np.square(off))) > 0.4


def test_weighted_draws_give_the_same_evidence() -> None:
    density = Bent(0.0)
    rng = np.random.default_rng(5)
    z = 1.3 * rng.standard_normal((6000, density.d))  # of a wider normal
    log_weight = -0.5 * (z**2).sum(axis=1) * (1.0 - 1.0 / 1.3**2)
    found = bridge_evidence(density, z, log_weight, rng)
    assert found.value == pytest.approx(SCALE, abs=4.0 * found.sd)
    assert 0.002 < found.sd < 0.03


class Comb(Bent):
    """The same density where the first coordinate is a multiple of a millionth, up to a millionth of that."""

    def log_prob(self, z: np.ndarray) -> np.ndarray:
        at = z[:, 0] * 1e6
        return np.where(np.abs(at - np.round(at)) < 1e-6, super().log_prob(z), -np.inf)


def test_a_proposal_that_never_meets_the_density_gives_no_evidence() -> None:
    density = Comb(0.0)
    rng = np.random.default_rng(6)
    z = rng.standard_normal((400, density.d))
    z[:, 0] = np.round(z[:, 0], 6)
    found = bridge_evidence(density, z, np.zeros(len(z)), rng)
    assert np.isnan(found.value)
    assert found.sd == np.inf


def test_draws_far_from_the_mass_are_bridged_with_the_error_they_deserve() -> None:
    density = Bent(0.0)
    rng = np.random.default_rng(7)
    z = (
        1e-3 * rng.standard_normal((250, density.d)) + 60.0
    )  # 60 standard deviations off, and a thousand times too narrow
    found = bridge_evidence(density, z, np.zeros(len(z)), rng)
    assert found.sd > 0.03
