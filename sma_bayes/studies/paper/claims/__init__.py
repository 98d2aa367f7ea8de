"""The claims of the paper, each with its evidence and a verdict."""

from sma_bayes.studies.paper.claims.claim import Claim, EvidenceForClaim, judged
from sma_bayes.studies.paper.claims.conditions import condition_claims
from sma_bayes.studies.paper.claims.correlation import correlation_claims
from sma_bayes.studies.paper.claims.models import model_claims
from sma_bayes.studies.paper.claims.shape import shape_claims
from sma_bayes.studies.paper.twin_study import TwinStudy

__all__ = ["Claim", "EvidenceForClaim", "claims"]


def claims(study: TwinStudy) -> tuple[Claim, ...]:
    """All claims, judged.

    Parameters
    ----------
    study : TwinStudy
        Of all conditions of the twin.
    """
    parts = (correlation_claims, model_claims, shape_claims, condition_claims)
    return judged([claim for part in parts for claim in part(study)])
