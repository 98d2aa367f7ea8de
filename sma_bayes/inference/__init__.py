"""Warm start, ensembles, convergence, evidence."""
