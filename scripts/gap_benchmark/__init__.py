"""Simulated campaigns for the gap workflow, with something hidden in them that the plain model does not know.

Mechanisms are simulated in time, from the current through the wire to the converter, and share no code with the
effects of the package; nothing here imports `sma_bayes.effects`, `sma_bayes.studies.gap` or `sma_bayes.response`.
"""
