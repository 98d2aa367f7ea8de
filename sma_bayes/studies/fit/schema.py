"""The document of a fit, as the registry finds it; it is declared below the verbs, which all read it."""

from typing import Final

from sma_bayes.runs.fit_document import FitSummary

DOCUMENTS: Final = {"fit": FitSummary}
