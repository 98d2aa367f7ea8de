"""The document of a fit among those that are declared; it stands in `sma_bayes.runs.fit_document`, for all its readers."""

from sma_bayes.runs.fit_document import FitSummary

DOCUMENTS = {"fit": FitSummary}
