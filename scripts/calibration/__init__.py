"""Truths of known curve and noise, and scores of what a fit says of them.

Curves, noises and the nearest published curve are computed here from their equations; nothing in `curves`, `noises`,
`truths`, `simulated_loop` and `real_residuals` imports the models or the noises of `sma_bayes`.
"""
