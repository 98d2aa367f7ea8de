"""How often an effect can be named at best: chance of the noise, with all else as if it were known.

The model is fitted to readings without noise, with the effect that was hidden and without. About these two fits it is
linear over the width of the noise, so that Bayes factors of effect and functions follow for any number of draws of it.
Nobody looks for the right effect here, it is there: no other effect is tried in its place, and none is added to it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp

from gap_benchmark.hide import Case, hide, noiseless
from gap_benchmark.spring import Floats
from gap_benchmark.trials import NAMES_OF, design_of
from sma_bayes.effects import EFFECTS
from sma_bayes.parameters.priors_file import read_priors
from sma_bayes.quantities import CHANNELS
from sma_bayes.records.history import histories
from sma_bayes.studies.gap.finite import gained_in_steps
from sma_bayes.studies.gap.fitting import FittedHypothesis, fit_hypothesis
from sma_bayes.studies.gap.flexible import TermEvidence, gains, terms_of
from sma_bayes.studies.gap.hypothesis import baseline
from sma_bayes.studies.gap.name import (
    LEAST_LN_BAYES_FACTOR,
    LEAST_SHARE_BESIDE_FLEXIBLE,
    flexible_alternative,
    screen_all,
    signature_at_mode,
    surprise_of_size,
)
from sma_bayes.studies.gap.noise import BlockNoise, blocks_of
from sma_bayes.studies.gap.study import SIGNIFICANT_P, baseline_start

DRAWS = 1000
"""Of the noise."""


@dataclass(frozen=True, slots=True)
class Attainable:
    """Shares of the draws of the noise.

    Attributes
    ----------
    effect : str
    seen : float
        In which the disagreement counts as more than chance.
    supported : float
        In which that is so and the effect is worth `LEAST_LN_BAYES_FACTOR`.
    named : float
        In which it is worth more than functions without meaning, too.
    ln_bayes_factor : float
        Of the effect, the mean.
    """

    effect: str
    seen: float
    supported: float
    named: float
    ln_bayes_factor: float


def attainable(effect: str, sigma: float, law: str = "first", seed: int = 0) -> Attainable:
    """How often an effect of a given size can be named under white noise.

    Parameters
    ----------
    effect : str
        Of the response, and no digitiser, whose signature is made of the noise.
    sigma : float
        As of `hide`.
    law : str
    seed : int
        Of the spring and of the noise.
    """
    case = hide(effect, sigma, "white", design_of([effect]), seed, law=law)
    plain = _fitted(case)
    screened, _ = screen_all(plain, EFFECTS.values())
    right = next(s for s in screened if s.effect.id == NAMES_OF.get((effect, law), (effect,))[0])
    _, start = gained_in_steps(plain, right.effect, right.start)
    whole = fit_hypothesis(plain.hypothesis.extended(right.effect), start, plain.noise)
    terms = gains(plain, terms_of(plain))
    signature = signature_at_mode(plain, whole)
    containing = [t for t in terms if flexible_alternative(signature, [t], right)[1]]

    noise = np.random.default_rng(seed).standard_normal((plain.whitened.size, DRAWS))
    chance = plain.project_out(noise)
    left = plain.left[:, None] + chance
    patterns = [*(t for t in terms if t.term.columns.shape[1] > 1), *screened]
    greatest, by_chance = (np.max([p.of(x) for p in patterns], axis=0) for x in (left, chance))
    seen = greatest >= np.quantile(by_chance, 1.0 - SIGNIFICANT_P)

    gained = whole.ln_evidence - plain.ln_evidence + (plain.whitened - whole.whitened) @ noise
    gained += _followed(whole, noise) - _followed(plain, noise)
    guard = np.full(DRAWS, -np.inf)
    if containing:
        guard = logsumexp([t.of(left) for t in containing], axis=0) - np.log(len(containing))
        guard -= surprise_of_size(plain, whole)
    alone = _best(terms, left)
    on_top = _best(gains(whole, terms_of(whole)), whole.left[:, None] + whole.project_out(noise))
    beside = (gained + on_top - alone >= LEAST_LN_BAYES_FACTOR) & (
        gained >= LEAST_SHARE_BESIDE_FLEXIBLE * (gained + on_top)
    )
    supported = seen & (gained >= LEAST_LN_BAYES_FACTOR)
    named = supported & ((gained > guard) | beside)
    shares = (float(np.mean(x)) for x in (seen, supported, named, gained))
    return Attainable(effect, *shares)


def _fitted(case: Case) -> FittedHypothesis:
    """The model without the effect, fitted to readings without noise."""
    campaign, priors = noiseless(case), read_priors("modified_sigmoid")
    own = [h.of(CHANNELS) for h in histories(campaign)]
    hypothesis = baseline(campaign, own, priors, pooled=case.pooled)
    noise = tuple(BlockNoise(case.noise_sd[b.channel], np.zeros(b.first.size)) for b in blocks_of(hypothesis))
    rng = np.random.default_rng(case.seed)
    start = baseline_start(hypothesis, campaign, priors, pooled=case.pooled, rng=rng)
    return fit_hypothesis(hypothesis, start, noise)


def _followed(fitted: FittedHypothesis, noise: Floats) -> Floats:
    """By how much the log posterior rises (S,) as the parameters follow the noise (N, S)."""
    pull = fitted.jacobian.T @ noise
    return 0.5 * np.einsum("ij,ij->j", pull, np.linalg.solve(fitted.precision, pull))


def _best(terms: Sequence[TermEvidence], residuals: Floats) -> Floats:
    """Log Bayes factor (S,) of the best term for whitened residuals (N, S); 0 where none pays for itself."""
    return np.maximum(np.max([t.of(residuals) for t in terms], axis=0), 0.0)
